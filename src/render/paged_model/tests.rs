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

/// Median radii of points, by which ambient occlusion knows a plane, are those of the whole cloud, and 0 for a surface.
#[test]
fn clouds_know_how_wide_their_points_are() {
    for is_cloud in [true, false] {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 40_000);
        let mut mesh = generate::mesh(&spec.unwrap());
        if is_cloud {
            mesh.triangles.clear();
        }
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let options = PagedOptions {
            page_leaves: 128,
            colors: None,
        };
        let bytes = to_bytes(&model, &options).unwrap();
        let file = PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes))).unwrap();
        let mut pages = PagedModel::open(file, PagedModelOptions::default()).unwrap();
        let view = model.orbit_camera((200, 200), 0.3, 0.3, 1.0);
        let view = view.view(model.origin).unwrap();
        pages
            .load(&view, &Settings::default(), &SilentProgress)
            .unwrap();
        let whole = DrawnFacts::from(&model).point_radius;
        let widest = |radius: f32, facts: &Arc<ModelFacts>| radius.max(facts.drawn().point_radius);
        let own = pages.parts().map(|(_, facts)| facts).fold(0.0, widest);
        assert_eq!(own > 0.0, is_cloud);
        // Codes round radii up.
        assert!((whole..=1.2 * whole).contains(&own), "{own} {whole}");
        // The pages are the same as ever to whatever keeps something of them.
        let known = |id: u64| pages.known.values().any(|own| own.facts.id() == id);
        assert!(pages.parts().all(|(_, facts)| known(facts.id())));
    }
}
