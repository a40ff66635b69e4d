#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::pages::source::MemorySource;
use crate::pages::write::{PagedOptions, to_bytes};
use crate::progress::SilentProgress;
use crate::tree::{self, BuildOptions};

fn file_of(shape: GeneratedShape) -> PagedFile {
    let spec = ShapeSpec::with_triangles(shape, 40_000).unwrap();
    let model = tree::build(
        generate::mesh(&spec),
        &BuildOptions::default(),
        &SilentProgress,
    )
    .unwrap();
    let options = PagedOptions {
        page_leaves: 128,
        colors: None,
    };
    let bytes = to_bytes(&model, &options).unwrap();
    PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes))).unwrap()
}

/// A unit sphere: its solid angle is that of all directions from inside, and none from outside.
#[test]
fn the_nodes_of_the_first_page_tell_inside_from_outside() {
    let model = file_of(GeneratedShape::Sphere)
        .stand_in(DVec3::ZERO)
        .unwrap();
    let direction = Vec3::new(0.48, 0.6, 0.64);
    for (distance, is_inside) in [
        (0.0, true),
        (0.5, true),
        (0.85, true),
        (1.15, false),
        (2.0, false),
        (50.0, false),
    ] {
        let found = surrounds(&model, direction * distance);
        assert_eq!(found, is_inside, "{distance}");
    }
    // The middle of a torus is in its hole.
    let torus = file_of(GeneratedShape::Torus)
        .stand_in(DVec3::ZERO)
        .unwrap();
    assert!(!surrounds(&torus, torus.orbit_center));
    assert!(!surrounds(&Model::default(), Vec3::ZERO));
}

#[test]
fn cuts_have_numbers_of_their_own_and_rest_with_the_view() {
    let file = file_of(GeneratedShape::Statue);
    let mut pages = PagedModel::open(file, PagedModelOptions::default()).unwrap();
    let model = pages.stand_in().clone();
    let view = |azimuth: f64| {
        let camera = model.orbit_camera((200, 200), azimuth, 0.3, 1.0);
        camera.view(model.origin).unwrap()
    };
    let settings = Settings::default();
    assert_eq!(pages.resident_pages(), 0);
    pages.load(&view(0.3), &settings, &SilentProgress).unwrap();
    assert_eq!((pages.wanted_pages(), pages.has_news()), (0, false));
    let first = pages.generation();
    for _ in 0..3 {
        pages.prepare(&view(0.3), &settings).unwrap();
        assert_eq!(pages.generation(), first);
    }
    pages.load(&view(2.0), &settings, &SilentProgress).unwrap();
    let other = pages.generation();
    assert!(other > first);
    pages.prepare(&view(0.3), &settings).unwrap();
    assert!(pages.generation() > other);
    assert!(pages.parts().count() > 10 && pages.resident().count() == pages.resident_pages());
}
