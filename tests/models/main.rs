//! Tests of models, trees, cuts and photographs, without a device. They are one program because every test program links the
//! whole library.
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
