//! Models, trees, cuts and photographs without a device: one program, since each links the library anew.
#![allow(
    clippy::unwrap_used,
    unreachable_pub,
    reason = "tests stop at the first surprise; modules are private to the test"
)]

#[path = "../common/models.rs"]
mod common_models;
mod cut;
mod generate;
mod mirror;
mod photos;
mod tree;
