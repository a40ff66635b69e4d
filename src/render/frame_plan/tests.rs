//! Plans of frames, for devices that are made up.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::math::camera::Camera;
use crate::render::model_facts::ModelFacts;
use crate::render::{SplatKind, cut_key};
use glam::DVec3;

fn statue() -> Model {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 2_000).unwrap();
    let options = crate::tree::BuildOptions::default();
    crate::tree::build(
        generate::mesh(&spec),
        &options,
        &crate::progress::SilentProgress,
    )
    .unwrap()
}

fn view_of(model: &Model) -> View {
    let sphere = model.orbit_sphere();
    let at = sphere.center + DVec3::Z * 4.0 * sphere.radius;
    let planes = [sphere.radius, 8.0 * sphere.radius];
    let camera = Camera::look_at((200, 100), at, sphere.center, DVec3::Y, 0.6, planes);
    camera.view(model.origin).unwrap()
}

/// A graphics card with points of 64 pixels.
const CARD: RendererCapabilities = RendererCapabilities {
    max_point_px: 64.0,
    largest_guarded_px: f32::INFINITY,
    largest_hidden_px: f32::INFINITY,
    is_software: false,
    has_int64_atomics: true,
    max_storage_range: 1 << 27,
    binds_vertices: true,
    has_first_instance: true,
    cuts_sooner: false,
    fits_device_cut: true,
    fits_filtered_cut: true,
    fits_tree: true,
};

/// Plans a frame of one model.
fn plan_of(
    (model, facts): (&Model, &ModelFacts),
    settings: &Settings,
    (view, capabilities): (&View, &RendererCapabilities),
) -> Result<FramePlan, Error> {
    let parts = [FactedModel {
        model,
        facts,
        cut: None,
    }];
    let input = PlanInput {
        parts: DrawnParts::new(&parts),
        view,
        outputs: PictureOutputs::default(),
        capabilities,
        costs: None,
    };
    FramePlan::new(settings, &input)
}

/// Plans a frame of a statue.
fn planned(settings: &Settings, capabilities: &RendererCapabilities) -> Result<FramePlan, Error> {
    let model = statue();
    let seen = (&view_of(&model), capabilities);
    plan_of((&model, &ModelFacts::of(&model)), settings, seen)
}

fn of_splat(splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        splat,
        threshold_px,
        ..Settings::default()
    }
}

/// Ambient occlusion comes by itself but where depths of triangles lie beside pushed ones, and always if asked for.
#[test]
fn ambient_occlusion_leaves_out_mixed_depths() {
    let resolved = |splat, threshold_px, method, ambient_occlusion| {
        let settings = Settings {
            method,
            ambient_occlusion,
            ..of_splat(splat, threshold_px)
        };
        planned(&settings, &CARD)
            .unwrap()
            .settings
            .ambient_occlusion
    };
    for (splat, threshold_px, method, is_dark) in [
        (SplatKind::Square, 3.0, Method::Pop, true),
        (SplatKind::Visibility, 3.0, Method::Pop, true),
        (SplatKind::Gauss, 1.0, Method::Pop, true),
        (SplatKind::Gauss, 2.0, Method::Pop, false),
        (SplatKind::Filtered, 1.0, Method::Pop, true),
        (SplatKind::Filtered, 2.0, Method::Pop, true),
        (SplatKind::Filtered, 2.0, Method::Splats, true),
        (SplatKind::Filtered, 2.0, Method::Triangles, true),
    ] {
        let found = resolved(splat, threshold_px, method, AmbientOcclusion::Auto);
        let wanted = if is_dark {
            AmbientOcclusion::On
        } else {
            AmbientOcclusion::Off
        };
        assert_eq!(found, wanted, "{splat:?}, {method:?} of {threshold_px} px");
        let asked = resolved(splat, threshold_px, method, AmbientOcclusion::On);
        assert_eq!(asked, AmbientOcclusion::On);
    }
}

#[test]
fn sizes_and_guard_bands_follow_from_who_draws() {
    let square = of_splat(SplatKind::Square, 3.0);
    let by_compute = planned(&square, &CARD).unwrap();
    assert!(by_compute.may_use_compute);
    assert_eq!(by_compute.max_point_px, compute_limits::LARGEST_SQUARE_PX);
    assert_eq!(
        (by_compute.largest_px, by_compute.context.guard_px),
        (3.0, 3)
    );
    let by_raster = Settings {
        path: Path::Raster,
        ..square
    };
    let by_raster = planned(&by_raster, &CARD).unwrap();
    assert!(!by_raster.may_use_compute);
    assert_eq!((by_raster.max_point_px, by_raster.largest_px), (64.0, 3.0));
    // Leaves are as large as they are: as a point may be, or the picture.
    let leaves = Settings {
        method: Method::Splats,
        ..square
    };
    let of_card = planned(&leaves, &CARD).unwrap();
    assert_eq!((of_card.largest_px, of_card.context.guard_px), (64.0, 33));
    let of_cpu = planned(&leaves, &RendererCapabilities::PROCESSOR).unwrap();
    assert_eq!((of_cpu.largest_px, of_cpu.context.guard_px), (200.0, 101));
    // A vertex that is too large for a point is a quad, which needs no guard band.
    let vertices = |threshold_px| Settings {
        method: Method::Points,
        ..of_splat(SplatKind::Square, threshold_px)
    };
    for (px, largest_px, are_quads) in [(5.0, 5.0, false), (65.0, 0.0, true)] {
        let plan = planned(&vertices(px), &CARD).unwrap();
        assert_eq!(
            (plan.largest_px, plan.primitives.are_quads),
            (largest_px, are_quads)
        );
        assert_eq!(plan.cut_place, CutPlace::Nowhere);
    }
}

#[test]
fn thresholds_of_little_more_than_a_pixel_are_a_pixel() {
    for (given, wanted) in [(1.0, 1.0), (1.25, 1.0), (1.5, 1.0), (1.6, 1.6), (0.5, 0.5)] {
        let plan = planned(&of_splat(SplatKind::Disc, given), &CARD).unwrap();
        assert_eq!(plan.settings.threshold_px, wanted);
        let plan = planned(&of_splat(SplatKind::Ellipse, given), &CARD).unwrap();
        assert_eq!(plan.settings.threshold_px, given);
    }
}

#[test]
fn the_processor_draws_large_splats_sooner_than_it_finds_hidden_ones() {
    let hides = |threshold_px, capabilities| {
        let plan = planned(&of_splat(SplatKind::Square, threshold_px), capabilities);
        plan.unwrap().cut.hides()
    };
    let cpu = &RendererCapabilities::PROCESSOR;
    assert!(hides(1.0, cpu) && hides(1.0, &CARD));
    assert!(!hides(2.0, cpu) && hides(2.0, &CARD));
    assert!(!hides(cut_key::LARGEST_HIDDEN_PX[1] + 0.5, &CARD));
}

#[test]
fn the_device_chooses_cuts_where_it_is_asked_or_sooner() {
    let square = |cut_on| Settings {
        cut_on,
        ..of_splat(SplatKind::Square, 2.0)
    };
    let place = |cut_on, capabilities| planned(&square(cut_on), capabilities).unwrap().cut_place;
    let sooner = RendererCapabilities {
        cuts_sooner: true,
        ..CARD
    };
    let too_large = RendererCapabilities {
        fits_device_cut: false,
        ..sooner
    };
    assert_eq!(place(CutOn::Auto, &CARD), CutPlace::Processor);
    assert_eq!(place(CutOn::Auto, &sooner), CutPlace::Device);
    assert_eq!(place(CutOn::Auto, &too_large), CutPlace::Processor);
    let filtered = |capabilities| {
        let settings = Settings {
            splat: SplatKind::Filtered,
            ..square(CutOn::Auto)
        };
        planned(&settings, capabilities).unwrap().cut_place
    };
    let no_pieces = RendererCapabilities {
        fits_filtered_cut: false,
        ..sooner
    };
    // Lists of filtered splats are larger: only their own size decides.
    assert_eq!(filtered(&too_large), CutPlace::Device);
    assert_eq!(filtered(&no_pieces), CutPlace::Processor);
    assert_eq!(place(CutOn::Auto, &no_pieces), CutPlace::Device);
    assert_eq!(place(CutOn::Processor, &sooner), CutPlace::Processor);
    assert_eq!(place(CutOn::Device, &CARD), CutPlace::Device);
    let of = |splat, path| Settings {
        splat,
        path,
        ..square(CutOn::Device)
    };
    // What compute draws of blended splats only the processor makes.
    for splat in [SplatKind::Gauss, SplatKind::Filtered] {
        let blended = planned(&of(splat, Path::Auto), &CARD).unwrap();
        assert_eq!(blended.cut_place, CutPlace::Device);
        assert!(!blended.may_use_compute && !blended.draws_cut_by_compute);
    }
    let visibility = planned(&of(SplatKind::Visibility, Path::Compute), &CARD).unwrap();
    assert!(visibility.draws_cut_by_compute);
    for (refused, word) in [
        (of(SplatKind::Gauss, Path::Compute), "--path raster"),
        (of(SplatKind::Filtered, Path::Compute), "--path raster"),
    ] {
        let error = planned(&refused, &CARD).unwrap_err().to_string();
        assert!(
            error.contains("cut on the device") && error.contains(word),
            "{error}"
        );
    }
}

#[test]
fn lists_hold_ids_where_the_device_has_memory_of_its_own() {
    let ids = |list_of, splat, capabilities| {
        let settings = Settings {
            list_of,
            ..of_splat(splat, 2.0)
        };
        planned(&settings, capabilities).map(|plan| plan.uploads_ids)
    };
    let software = RendererCapabilities {
        is_software: true,
        ..CARD
    };
    let full = RendererCapabilities {
        fits_tree: false,
        ..CARD
    };
    let square = SplatKind::Square;
    assert!(ids(ListOf::Auto, square, &CARD).unwrap());
    assert!(!ids(ListOf::Auto, square, &software).unwrap());
    assert!(!ids(ListOf::Auto, square, &full).unwrap());
    assert!(!ids(ListOf::Records, square, &CARD).unwrap());
    assert!(ids(ListOf::Ids, square, &software).unwrap());
    let filtered = SplatKind::Filtered;
    assert!(ids(ListOf::Auto, filtered, &CARD).unwrap());
    assert!(!ids(ListOf::Auto, filtered, &software).unwrap());
    let facts = DrawnFacts {
        has_textures: true,
        ..(&statue()).into()
    };
    let of_textured = |list_of, splat| {
        let settings = Settings {
            list_of,
            ..of_splat(splat, 2.0)
        };
        uploads_ids(&settings, (&facts, true), true, &CARD)
    };
    assert!(of_textured(ListOf::Ids, square).unwrap());
    assert!(!of_textured(ListOf::Auto, filtered).unwrap());
    let refused = of_textured(ListOf::Ids, filtered).unwrap_err().to_string();
    assert!(
        refused.contains("lists of ids") && refused.contains("images"),
        "{refused}"
    );
}

#[test]
fn plans_of_the_same_lists_are_told_from_others() {
    let model = statue();
    let facts = ModelFacts::of(&model);
    let view = view_of(&model);
    let mut moved = view;
    moved.offset[0] += 0.01;
    let key = |settings: &Settings, view: &View| {
        let seen = (view, &CARD);
        plan_of((&model, &facts), settings, seen)
            .unwrap()
            .pack_key()
    };
    let base = of_splat(SplatKind::Gauss, 2.0);
    let red = Settings {
        background: [1.0, 0.0, 0.0],
        ..base
    };
    let raster = Settings {
        path: Path::Raster,
        ..base
    };
    assert_eq!(key(&base, &view), key(&red, &view));
    assert_ne!(key(&base, &view), key(&base, &moved));
    assert_ne!(key(&base, &view), key(&raster, &view));
    assert_ne!(
        key(&base, &view),
        key(&of_splat(SplatKind::Gauss, 2.5), &view)
    );
    assert_ne!(
        key(&base, &view),
        key(&of_splat(SplatKind::Disc, 2.0), &view)
    );
}

#[test]
fn plans_of_the_same_inputs_are_equal_and_others_are_not() {
    let model = statue();
    let facts = ModelFacts::of(&model);
    let view = view_of(&model);
    let mut moved = view;
    moved.offset[0] += 0.01;
    let plan = |settings: &Settings, view: &View| {
        plan_of((&model, &facts), settings, (view, &CARD)).unwrap()
    };
    let base = of_splat(SplatKind::Square, 2.0);
    // No draw list is told of it, but the whole plan is.
    let red = Settings {
        background: [1.0, 0.0, 0.0],
        ..base
    };
    assert_eq!(plan(&base, &view), plan(&base, &view));
    assert_ne!(plan(&base, &view), plan(&red, &view));
    assert_ne!(plan(&base, &view), plan(&base, &moved));
    assert_ne!(
        plan(&base, &view),
        plan(&of_splat(SplatKind::Square, 2.5), &view)
    );
}
