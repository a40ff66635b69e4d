//! Generated models: square, sphere, torus and statue, to any size.
