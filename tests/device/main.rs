//! Tests of what is drawn, by every backend. They are one program because every test program links the whole library.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod accuracy;
mod by_id;
#[path = "../common/mod.rs"]
mod common;
mod costs;
mod device_cut;
mod executors;
mod external;
mod eye_dome;
mod failures;
mod falsecolor;
mod golden;
mod invariants;
mod light;
mod occlusion;
mod oracle;
mod overdraw;
mod paged;
mod parts;
mod patches;
mod paths;
mod photo_look;
mod pictures;
mod processor;
mod profile;
mod reference;
mod rims;
mod samples;
mod splats;
mod stability;
mod still;
mod textures;
mod vertex_splats;
mod visibility;
#[cfg(feature = "viewer")]
mod window_renderer;
