#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::{ExternalError, ExternalOptions, ExternalReport, build};
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::mesh::Mesh;
use crate::mesh::stream::MeshStream;
use crate::pages::check::check;
use crate::pages::file::PagedFile;
use crate::pages::join::whole_model;
use crate::pages::source::MemorySource;
use crate::pages::write::{PagedOptions, to_bytes};
use crate::progress::{Progress, SilentProgress};
use crate::tree::{self, BuildOptions, Model};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// A shape of about that many triangles with colors, or the cloud of its vertices, without normals.
fn mesh(shape: GeneratedShape, triangles: u64, is_cloud: bool) -> Mesh {
    let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
    let mut mesh = generate::mesh(&spec);
    mesh.normals = Vec::new();
    mesh.colors = (mesh.positions.iter())
        .map(|p| {
            let [r, g, b] = (*p * 80.0 + 128.0).to_array().map(|c| c as u8);
            [r, g, b, 255]
        })
        .collect();
    if is_cloud {
        mesh.triangles.clear();
    }
    mesh
}

fn options(chunk_leaves: u64) -> ExternalOptions {
    ExternalOptions {
        pages: PagedOptions {
            page_leaves: 64,
            colors: None,
        },
        chunk_leaves,
        crease_degrees: Some(40.0),
        ..ExternalOptions::default()
    }
}

fn built(
    stream: &dyn MeshStream,
    options: &ExternalOptions,
) -> Result<(Vec<u8>, ExternalReport), ExternalError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.surfel");
    let report = build(stream, options, &path, &SilentProgress);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), usize::from(report.is_ok()), "{left:?}");
    Ok((std::fs::read(&path).unwrap_or_default(), report?))
}

fn opened(bytes: Vec<u8>) -> PagedFile {
    PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes))).unwrap()
}

fn usual(mesh: &Mesh) -> Model {
    let options = BuildOptions {
        crease_degrees: Some(40.0),
        ..BuildOptions::default()
    };
    tree::build(mesh.clone(), &options, &SilentProgress).unwrap()
}

#[test]
fn a_model_of_one_chunk_is_the_file_of_the_usual_builder() {
    for is_cloud in [false, true] {
        let mesh = mesh(GeneratedShape::Statue, 5000, is_cloud);
        let (bytes, report) = built(&mesh, &options(1 << 19)).unwrap();
        let expected = to_bytes(&usual(&mesh), &options(1 << 19).pages).unwrap();
        assert!(bytes == expected, "{is_cloud}");
        assert_eq!((report.chunks, report.temporary_bytes), (1, 0));
    }
}

#[test]
fn a_model_of_many_chunks_is_sound_and_complete() {
    for (shape, is_cloud) in [
        (GeneratedShape::Sphere, false),
        (GeneratedShape::Statue, false),
        (GeneratedShape::Torus, true),
    ] {
        let mesh = mesh(shape, 40_000, is_cloud);
        let (bytes, report) = built(&mesh, &options(2048)).unwrap();
        assert!(report.chunks >= 8, "{report:?}");
        let file = opened(bytes.clone());
        let checked = check(&file, &SilentProgress);
        assert!(checked.is_clean(), "{shape:?}: {:?}", checked.violations);
        let usual = usual(&mesh);
        assert_eq!(checked.leaves, usual.tree.leaves.len() as u64);
        assert_eq!(
            (checked.leaves, checked.nodes),
            (report.leaves, report.nodes)
        );
        let joined = whole_model(&file, &SilentProgress).unwrap();
        assert_eq!(joined.is_closed, usual.is_closed, "{shape:?}");
        let header = *file.header();
        assert_eq!(
            (header.min, header.max),
            (usual.min.into(), usual.max.into())
        );
        assert!((header.orbit_radius - usual.orbit_radius).abs() < 1e-6);
        assert!((area(&joined) - area(&usual)).abs() < 2.0);
        // The same file by other tables.
        let small = ExternalOptions {
            table_bytes: 4096,
            ..options(2048)
        };
        assert!(built(&mesh, &small).unwrap().0 == bytes, "{shape:?}");
    }
}

/// Sum of the areas of all triangles, in thousandths.
fn area(model: &Model) -> f64 {
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| model.vertices[corner as usize].position);
        f64::from(0.5 * (b - a).cross(c - a).length())
    };
    model.triangles.iter().map(area).sum::<f64>() * 1e3
}

#[test]
fn chunks_meet_without_gap() {
    let mesh = mesh(GeneratedShape::Statue, 40_000, false);
    let joined = whole_model(
        &opened(built(&mesh, &options(2048)).unwrap().0),
        &SilentProgress,
    )
    .unwrap();
    // Every edge of the closed surface has its reverse, by decoded places.
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    let key = |p: Vec3| p.to_array().map(|c| (c + 0.0).to_bits());
    for triangle in &joined.triangles {
        let places = triangle.map(|corner| key(joined.vertices[corner as usize].position));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (places[a], places[b]);
            if a != b {
                let step = if a < b { 1 } else { -1 };
                *edges.entry([a.min(b), a.max(b)]).or_default() += step;
            }
        }
    }
    assert!(joined.is_closed && edges.values().all(|&count| count == 0));
}

#[test]
fn chunks_meet_without_seam() {
    let mesh = mesh(GeneratedShape::Statue, 40_000, false);
    let joined = whole_model(
        &opened(built(&mesh, &options(2048)).unwrap().0),
        &SilentProgress,
    )
    .unwrap();
    let usual = usual(&mesh);
    // At the place of a vertex is a normal of the usual model.
    let near = |p: Vec3| (p * 200.0).round().to_array().map(|c| c as i32);
    let mut normals: HashMap<[i32; 3], Vec<(Vec3, Vec3)>> = HashMap::new();
    for vertex in &usual.vertices {
        let normal = crate::math::octahedral::decode(vertex.normal);
        normals
            .entry(near(vertex.position))
            .or_default()
            .push((vertex.position, normal));
    }
    let mut far = 0;
    for vertex in &joined.vertices {
        let [x, y, z] = near(vertex.position);
        let own = crate::math::octahedral::decode(vertex.normal);
        let is_known = (0..27).any(|i| {
            let cell = [x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1];
            let known = normals.get(&cell).into_iter().flatten();
            known.into_iter().any(|(place, normal)| {
                place.distance(vertex.position) < 1e-3 && normal.dot(own) > 0.995
            })
        });
        far += usize::from(!is_known);
    }
    // A page has normals of 14 bits, off by up to 1.3 degrees.
    assert_eq!(far, 0, "of {}", joined.vertices.len());
}

#[test]
fn what_is_not_finite_is_left_out_and_counted() {
    let mut cloud = mesh(GeneratedShape::Torus, 20_000, true);
    cloud.positions[77] = Vec3::NAN;
    cloud.positions[5000] = Vec3::new(0.0, f32::INFINITY, 0.0);
    let (bytes, report) = built(&cloud, &options(2048)).unwrap();
    assert_eq!(report.dropped, 2);
    assert!(check(&opened(bytes), &SilentProgress).is_clean());
    let mut surface = mesh(GeneratedShape::Torus, 20_000, false);
    let around = surface.triangles.iter().filter(|t| t.contains(&77)).count() as u64;
    surface.positions[77] = Vec3::NAN;
    let (bytes, report) = built(&surface, &options(2048)).unwrap();
    assert_eq!((report.dropped, around > 0), (around, true));
    let file = opened(bytes);
    assert!(check(&file, &SilentProgress).is_clean());
    assert!(!file.is_closed());
    cloud.positions.fill(Vec3::NAN);
    assert!(built(&cloud, &options(2048)).is_err());
}

#[test]
fn coordinates_of_maps_keep_their_detail() {
    let mut cloud = mesh(GeneratedShape::Statue, 30_000, true);
    cloud.origin = DVec3::new(4e5, 5.1e6, 300.0);
    let (bytes, _) = built(&cloud, &options(2048)).unwrap();
    let joined = whole_model(&opened(bytes), &SilentProgress).unwrap();
    let world = |origin: DVec3, positions: Vec<Vec3>| -> Vec<DVec3> {
        let mut all: Vec<DVec3> = positions.iter().map(|p| origin + p.as_dvec3()).collect();
        all.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
        all
    };
    let decoded = world(
        joined.origin,
        joined.vertices.iter().map(|v| v.position).collect(),
    );
    let given = world(cloud.origin, cloud.positions.clone());
    let off = decoded.iter().zip(&given).map(|(a, b)| (a.x - b.x).abs());
    assert!(off.fold(0.0, f64::max) < 2e-3);
    assert!(joined.origin.distance(cloud.origin) < 10.0);
}

#[test]
fn cancelled_leaves_nothing() {
    struct Cancelled;
    impl Progress for Cancelled {
        fn stage(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn is_cancelled(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.surfel");
    let mesh = mesh(GeneratedShape::Torus, 20_000, false);
    let result = build(&mesh, &options(2048), &path, &Cancelled);
    assert!(matches!(
        result,
        Err(ExternalError::Tree(tree::Error::Cancelled))
    ));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
