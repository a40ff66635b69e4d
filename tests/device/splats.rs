//! Round and fuzzy splats: the device against the mirror, closed forms, and what must not change a picture.

mod fuzzy;
mod lists;
mod opaque;
mod oracle;
