//! Reading models: every format and variant from hand-made bytes, every damage refused in words, the real models
//! counted.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

#[path = "../common/models.rs"]
mod common_models;
mod damage;
mod dialects;
mod models;
mod obj;
mod other;
mod ply;
mod ply_attributes;
mod scans;
mod textures;

use glam::Vec3;
use surfel::input::{self, Error, LoadedMesh, ReadOptions};
use surfel::progress::SilentProgress;

fn try_read(name: &str, bytes: impl AsRef<[u8]>) -> Result<LoadedMesh, Error> {
    // The files are made by hand: what their faces have in common is none of a surface.
    let options = ReadOptions {
        repair_faces: false,
        ..ReadOptions::default()
    };
    input::load_bytes(name, bytes.as_ref(), &options, &SilentProgress)
}

fn read(name: &str, bytes: impl AsRef<[u8]>) -> LoadedMesh {
    try_read(name, bytes).unwrap_or_else(|error| panic!("{error}"))
}

fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    try_read(name, bytes)
        .expect_err("this file is damaged")
        .to_string()
}

const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

/// What `Mesh` promises, and bounds on what a file of `bytes` may grow to.
fn check(loaded: &LoadedMesh, bytes: usize) {
    let mesh = &loaded.mesh;
    let vertices = mesh.positions.len();
    assert!(vertices > 0);
    assert!(mesh.positions.iter().all(|point| point.is_finite()));
    assert!(
        mesh.triangles
            .iter()
            .flatten()
            .all(|&corner| (corner as usize) < vertices)
    );
    assert!(mesh.normals.is_empty() || mesh.normals.len() == vertices);
    assert!(mesh.colors.is_empty() || mesh.colors.len() == vertices);
    assert!(
        mesh.normals
            .iter()
            .all(|normal| *normal == Vec3::ZERO || (normal.length() - 1.0).abs() < 1e-5)
    );
    assert!(mesh.origin.is_finite());
    assert!(
        vertices + mesh.triangles.len() <= bytes,
        "{vertices} vertices from {bytes} bytes"
    );
}
