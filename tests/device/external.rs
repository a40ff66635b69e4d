//! Paged files that are built piece by piece, against the same model read and built as a whole.

use crate::common::models::real_file;
use glam::DVec3;
use std::path::{Path, PathBuf};
use surfel::mesh::stream::{JoinedStream, MeshStream};
use surfel::open::{ModelSource, external_options, open_stream};
use surfel::pages::check::check;
use surfel::pages::external::{self, ExternalOptions, ExternalReport};
use surfel::pages::file::PagedFile;
use surfel::pages::join::whole_model;
use surfel::pages::source::{FileSource, MemorySource};
use surfel::pages::write::{PagedOptions, to_bytes};
use surfel::progress::SilentProgress;
use surfel::tree::Model;
use surfel::{OpenOptions, open};

fn streamed(path: &Path) -> Option<Box<dyn MeshStream>> {
    let source = ModelSource::File(path.to_owned());
    let opened = open_stream(&source, &OpenOptions::default(), &SilentProgress).unwrap();
    opened.map(|opened| opened.stream)
}

/// Builds in small chunks; the joined model of the file, which is clean.
fn built(stream: &dyn MeshStream) -> (Model, ExternalReport) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.surfel");
    let options = ExternalOptions {
        chunk_leaves: 4096,
        ..external_options(&OpenOptions::default(), 256 << 20)
    };
    let report = external::build(stream, &options, &path, &SilentProgress).unwrap();
    let file = PagedFile::open(std::sync::Arc::new(FileSource::open(&path).unwrap())).unwrap();
    let checked = check(&file, &SilentProgress);
    assert!(checked.is_clean(), "{:?}", checked.violations);
    (whole_model(&file, &SilentProgress).unwrap(), report)
}

/// Sorted coordinates of an axis, in the world.
fn along(model: &Model, axis: usize) -> Vec<f64> {
    let place = |p: glam::Vec3| (model.origin + p.as_dvec3())[axis];
    let mut all: Vec<f64> = if model.triangles.is_empty() {
        model.vertices.iter().map(|v| place(v.position)).collect()
    } else {
        let corners = model.triangles.as_flattened().iter();
        corners
            .map(|&c| place(model.vertices[c as usize].position))
            .collect()
    };
    all.sort_unstable_by(f64::total_cmp);
    all
}

fn mean_color(model: &Model) -> DVec3 {
    let colors = model.vertices.iter().map(|v| v.color.map(f64::from));
    let sum: DVec3 = colors.map(|[r, g, b, _]| DVec3::new(r, g, b)).sum();
    sum / model.vertices.len() as f64
}

/// Compares with the model that is opened as a whole.
fn same_as_whole(path: &Path, pieces: &Model) {
    let whole = open(path, &OpenOptions::default(), &SilentProgress)
        .unwrap()
        .model;
    let name = path.display();
    assert_eq!(pieces.tree.leaves.len(), whole.tree.leaves.len(), "{name}");
    assert_eq!(pieces.has_colors, whole.has_colors, "{name}");
    assert_eq!(pieces.is_closed, whole.is_closed, "{name}");
    let bytes = to_bytes(&whole, &PagedOptions::default()).unwrap();
    let file = PagedFile::open(std::sync::Arc::new(MemorySource::new("t", bytes))).unwrap();
    let paged = whole_model(&file, &SilentProgress).unwrap();
    for axis in 0..3 {
        let expected = along(&whole, axis);
        let off = |model: &Model| {
            let own = along(model, axis);
            let off: f64 = own.iter().zip(&expected).map(|(a, b)| (a - b).abs()).sum();
            off / own.len() as f64
        };
        // What is quantized is off by a part of its node or page; those of the usual builder are about as large in the mean: steps of
        // grids are powers of two, and at the rim of chunks, which are no boxes, some nodes are larger.
        let (own, usual) = (off(pieces), off(&paged));
        assert!(own <= 4.0 * usual, "{name}: {own}, {usual}");
    }
    if whole.triangles.is_empty() {
        // Colors of points have 5 or 6 bits.
        let off = (mean_color(pieces) - mean_color(&whole))
            .abs()
            .max_element();
        assert!(off < 4.0, "{name}: {off}");
    }
}

/// A scan of 20,000 points on map coordinates, with colors of 16 bits, in the version and format of points given.
fn scan(folder: &Path, (minor, format): (u8, u8), ending: &str) -> PathBuf {
    let mut builder = las::Builder::from((1, minor));
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = ending == "laz";
    let axis = |offset| las::Transform {
        scale: 0.001,
        offset,
    };
    builder.transforms = las::Vector {
        x: axis(484_600.0),
        y: axis(6_632_600.0),
        z: axis(100.0),
    };
    let shape = builder.point_format;
    let path = folder.join(format!("scan-{minor}-{format}.{ending}"));
    let mut writer = las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for i in 0..20_000u32 {
        let [x, y] = [i % 200, i / 200].map(f64::from);
        let color = las::Color::new((x * 300.0) as u16, (y * 600.0) as u16, 40_000);
        let point = las::Point {
            x: 484_600.0 + x * 0.25,
            y: 6_632_600.0 + y * 0.25,
            z: 100.0 + (x * 0.1).sin() + (y * 0.07).cos(),
            gps_time: shape.has_gps_time.then_some(f64::from(i)),
            color: shape.has_color.then_some(color),
            ..las::Point::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    path
}

#[test]
fn scans_are_the_same_piece_by_piece() {
    let folder = tempfile::tempdir().unwrap();
    for (version, ending) in [((2, 2), "las"), ((2, 1), "laz"), ((4, 7), "laz")] {
        let path = scan(folder.path(), version, ending);
        let stream = streamed(&path).unwrap();
        let (model, report) = built(stream.as_ref());
        assert_eq!((report.leaves, report.chunks >= 5), (20_000, true));
        assert_eq!(model.has_colors, version.1 != 1);
        same_as_whole(&path, &model);
    }
}

#[test]
fn real_files_are_the_same_piece_by_piece() {
    let files = [
        "scans/autzen_trim.las",
        "scans/autzen_trim.laz",
        "scans/pine_plot.laz",
        "scans/lion_takanawa.copc.laz",
        "scans/lato000.ply",
        "thesis/horse.ply",
        "meshes/mannequin.ply",
        "sharp/cycloidal.ply",
    ];
    for path in files.iter().filter_map(|file| real_file(file)) {
        match streamed(&path) {
            Some(stream) => same_as_whole(&path, &built(stream.as_ref()).0),
            None => assert!(
                path.extension().unwrap() == "ply",
                "text, not {}",
                path.display()
            ),
        }
    }
}

/// A binary PLY file of a grid of quads, one of them concave, a triangle, and a line that is no face.
fn polygons(folder: &Path) -> PathBuf {
    let side = 120u32;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n",
        side * side,
        (side - 1) * (side - 1) + 2
    )
    .into_bytes();
    for j in 0..side {
        for i in 0..side {
            let mut place = [i as f32, j as f32, (i * j % 7) as f32 * 0.1];
            if (i, j) == (5, 5) {
                // Behind the diagonal of the quad before it.
                place = [4.2, 4.2, 0.0];
            }
            bytes.extend(place.iter().flat_map(|c| c.to_le_bytes()));
            bytes.extend([i as u8, j as u8, 77]);
        }
    }
    let mut face = |corners: &[u32]| {
        bytes.extend([9, corners.len() as u8]);
        bytes.extend(corners.iter().flat_map(|c| c.to_le_bytes()));
    };
    for j in 0..side - 1 {
        for i in 0..side - 1 {
            let a = j * side + i;
            face(&[a, a + 1, a + side + 1, a + side]);
        }
    }
    face(&[0, 1, side]);
    face(&[0, 1]);
    let path = folder.join("quads.ply");
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn polygons_are_cut_and_what_is_no_face_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = polygons(folder.path());
    let stream = streamed(&path).unwrap();
    let (model, _) = built(stream.as_ref());
    same_as_whole(&path, &model);
    let remarks = stream.remarks();
    assert!(
        remarks.len() == 1 && remarks[0].contains("fewer than three"),
        "{remarks:?}"
    );
}

#[test]
fn a_damaged_file_is_an_error_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = polygons(folder.path());
    let bytes = std::fs::read(&path).unwrap();
    let out = folder.path().join("t.surfel");
    let failure = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let stream = streamed(&path).unwrap();
        let options = ExternalOptions::default();
        let error = external::build(stream.as_ref(), &options, &out, &SilentProgress);
        error.unwrap_err().to_string()
    };
    let cut = failure(&bytes[..bytes.len() - 300]);
    // The face that is cut has a length, a flag and four corners: 18 bytes.
    let mut places = bytes.len() - 318..bytes.len() - 299;
    let is_placed = places.any(|at| cut.contains(&format!("byte {at}")));
    assert!(is_placed && cut.contains("ends early"), "{cut}");
    let mut wrong = bytes.clone();
    let end = wrong.len();
    wrong[end - 40..end - 36].copy_from_slice(&u32::MAX.to_le_bytes());
    let wrong = failure(&wrong);
    assert!(
        wrong.contains("vertex") && wrong.contains("byte"),
        "{wrong}"
    );
    assert!(!out.exists());
}

#[test]
fn several_inputs_are_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let quads = polygons(folder.path());
    let streams = vec![streamed(&quads).unwrap(), streamed(&quads).unwrap()];
    let one = built(streams[0].as_ref()).0;
    let (both, _) = built(&JoinedStream::new(streams).unwrap());
    assert_eq!(both.tree.leaves.len(), 2 * one.tree.leaves.len());
    assert_eq!((both.min, both.max), (one.min, one.max));
    let scan = scan(folder.path(), (2, 2), "las");
    let mixed = vec![streamed(&quads).unwrap(), streamed(&scan).unwrap()];
    assert!(JoinedStream::new(mixed).is_err());
}
