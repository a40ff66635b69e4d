//! Table of promises and executors: for each pair the golden case or the test that shows it, or why there is none. This
//! file checks that the cases and tests are there, and that no setting is without a golden case.

use super::golden::catalog::{GoldenCase, PictureExecutor, cases};
use std::path::Path;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::{
    AmbientOcclusion, Blend, EyeDome, Method, Reconstruction, Shading, SplatKind,
};

/// What shows that a promise is kept.
#[derive(Debug, Clone, Copy)]
enum PromiseProof {
    /// These golden cases, by `tests/device/golden.rs`: an executor draws at least one, or refuses all as the catalog says.
    Golden(&'static [&'static str]),
    /// A test.
    Test {
        file: &'static str,
        name: &'static str,
    },
    /// The executor makes no such promise, for this reason.
    None(&'static str),
}

use PromiseProof::{Golden, None as Nothing};

const fn test(file: &'static str, name: &'static str) -> PromiseProof {
    PromiseProof::Test { file, name }
}

/// A row of the table.
struct ExecutorPromise {
    name: &'static str,
    hardware: PromiseProof,
    compute: PromiseProof,
    host: PromiseProof,
    /// The hardware rasterizer, of lists that the device chose.
    device_cut: PromiseProof,
    reference: PromiseProof,
}

impl ExecutorPromise {
    fn proofs(&self) -> [PromiseProof; 5] {
        [
            self.hardware,
            self.compute,
            self.host,
            self.device_cut,
            self.reference,
        ]
    }
}

/// A technique, whose pictures golden cases hold for the four executors.
const fn technique(
    name: &'static str,
    golden: &'static [&'static str],
    device_cut: PromiseProof,
) -> ExecutorPromise {
    ExecutorPromise {
        name,
        hardware: Golden(golden),
        compute: Golden(golden),
        host: Golden(golden),
        device_cut,
        reference: Golden(golden),
    }
}

const DEVICE_CUT: PromiseProof = test(
    "tests/device/device_cut.rs",
    "the_device_draws_what_the_host_draws",
);
const DEVICE_CUT_COLORS: PromiseProof = test(
    "tests/device/device_cut.rs",
    "the_device_cut_is_drawn_in_every_light_and_color",
);
const NO_DEVICE_CUT: PromiseProof = test(
    "tests/device/device_cut.rs",
    "what_the_device_cannot_choose_is_refused_by_name",
);
const FLOATS: PromiseProof = test(
    "tests/device/reference.rs",
    "a_shade_between_two_levels_stays_between_them",
);
const NO_CUT: PromiseProof = Nothing("there is no cut to choose");

const TABLE: &[ExecutorPromise] = &[
    technique("triangles", &["triangles"], NO_CUT),
    technique("points", &["points-2", "points-gauss"], NO_CUT),
    technique(
        "squares",
        &["pop-1", "pop-4", "pop-near", "background"],
        DEVICE_CUT,
    ),
    technique("discs", &["disc"], DEVICE_CUT),
    technique("ellipses", &["ellipse"], NO_DEVICE_CUT),
    technique("Gaussians", &["gauss", "splats-gauss"], NO_DEVICE_CUT),
    technique("deferred shading", &["gauss-deferred"], NO_DEVICE_CUT),
    technique("blended discs", &["disc-blended"], NO_DEVICE_CUT),
    technique(
        "blending in one pass",
        &["disc-threshold", "disc-range"],
        NO_DEVICE_CUT,
    ),
    technique("patches", &["patches", "patches-coarse"], NO_DEVICE_CUT),
    technique(
        "splats from vertices",
        &[
            "from-vertices",
            "from-vertices-gauss",
            "from-vertices-visibility",
        ],
        NO_CUT,
    ),
    technique("splats alone", &["splats", "splats-gauss"], NO_DEVICE_CUT),
    technique(
        "filtered splats",
        &["filtered-1", "filtered-3"],
        NO_DEVICE_CUT,
    ),
    technique(
        "visibility splats",
        &[
            "visibility-gaussian",
            "visibility-pull-push",
            "visibility-holes",
        ],
        NO_DEVICE_CUT,
    ),
    technique(
        "visibility splats of points",
        &["visibility-density"],
        NO_CUT,
    ),
    technique("a lamp, on triangles", &["lamp-triangles"], NO_CUT),
    technique("a lamp, on opaque splats", &["lamp"], DEVICE_CUT_COLORS),
    technique("a lamp, on blended splats", &["lamp-gauss"], NO_DEVICE_CUT),
    technique(
        "a lamp, on filtered splats",
        &["lamp-filtered"],
        NO_DEVICE_CUT,
    ),
    technique(
        "lights that go with the camera, on opaque splats and triangles",
        &["studio", "clay", "metal-triangles"],
        DEVICE_CUT_COLORS,
    ),
    technique(
        "lights that go with the camera, on blended splats",
        &["porcelain-filtered", "metal-gauss"],
        NO_DEVICE_CUT,
    ),
    technique("ambient occlusion", &["occlusion"], DEVICE_CUT_COLORS),
    technique("eye-dome lighting", &["eye-dome"], DEVICE_CUT_COLORS),
    technique(
        "a background of two colors",
        &["gradient"],
        DEVICE_CUT_COLORS,
    ),
    technique("overdraw", &["overdraw"], NO_DEVICE_CUT),
    technique("color by primitive", &["primitive"], DEVICE_CUT_COLORS),
    technique("color by class", &["visibility-class"], NO_DEVICE_CUT),
    technique("color by level", &["level"], NO_DEVICE_CUT),
    technique("color by normal", &["normal"], DEVICE_CUT_COLORS),
    technique("color by depth", &["depth"], DEVICE_CUT_COLORS),
    ExecutorPromise {
        name: "the same frame again is the same to the bit",
        hardware: test(
            "tests/device/invariants.rs",
            "the_same_frame_twice_is_bit_identical",
        ),
        compute: test(
            "tests/device/paths.rs",
            "a_frame_by_compute_is_the_same_again",
        ),
        host: test(
            "tests/device/still.rs",
            "a_still_camera_is_not_cut_and_packed_again",
        ),
        device_cut: Nothing("its lists are in no order: of equally near splats another may win"),
        reference: test(
            "tests/models/mirror/coverage.rs",
            "the_picture_does_not_depend_on_the_number_of_threads",
        ),
    },
    ExecutorPromise {
        name: "leaving out what is hidden changes no bit",
        hardware: test(
            "tests/device/occlusion.rs",
            "no_bit_of_a_picture_changes_on_an_orbit",
        ),
        compute: test(
            "tests/device/occlusion.rs",
            "no_bit_of_a_picture_changes_on_an_orbit",
        ),
        host: test("tests/device/occlusion.rs", "no_bit_of_any_scene_changes"),
        device_cut: Nothing("it leaves out nothing that is hidden"),
        reference: test(
            "tests/device/occlusion.rs",
            "no_bit_of_a_picture_changes_on_an_orbit",
        ),
    },
    ExecutorPromise {
        name: "the picture of another executor",
        hardware: test(
            "tests/device/oracle.rs",
            "smooth_and_rough_surfaces_from_outside",
        ),
        compute: test(
            "tests/device/paths.rs",
            "compute_and_rasterizer_draw_the_same_picture",
        ),
        host: test(
            "tests/device/paths.rs",
            "the_processor_draws_what_the_device_does",
        ),
        device_cut: DEVICE_CUT,
        reference: test(
            "tests/device/oracle.rs",
            "smooth_and_rough_surfaces_from_outside",
        ),
    },
    ExecutorPromise {
        name: "samples that are averaged are floats",
        hardware: FLOATS,
        compute: FLOATS,
        host: FLOATS,
        device_cut: Nothing("its lists are drawn by the hardware as others are"),
        reference: FLOATS,
    },
    ExecutorPromise {
        name: "normals beside the color",
        hardware: test(
            "tests/device/oracle.rs",
            "smooth_and_rough_surfaces_from_outside",
        ),
        compute: test(
            "tests/device/paths.rs",
            "compute_and_rasterizer_draw_the_same_picture",
        ),
        host: test(
            "tests/device/processor.rs",
            "normals_are_those_of_the_reference",
        ),
        device_cut: Nothing("its records are those of the hardware, which has them"),
        reference: test(
            "tests/device/oracle.rs",
            "smooth_and_rough_surfaces_from_outside",
        ),
    },
    ExecutorPromise {
        name: "scans with open borders, needles and triangles without area",
        hardware: test("tests/device/oracle.rs", "scans_and_real_models"),
        compute: test(
            "tests/device/paths.rs",
            "scans_and_real_models_with_colors_draw_the_same",
        ),
        host: test(
            "tests/device/occlusion.rs",
            "no_bit_of_scans_and_clouds_changes",
        ),
        device_cut: test("tests/device/device_cut.rs", "a_scan_is_cut_on_the_device"),
        reference: test("tests/device/oracle.rs", "scans_and_real_models"),
    },
    ExecutorPromise {
        name: "lists of ids draw what lists of records draw",
        hardware: test("tests/device/by_id.rs", "numbers_draw_what_records_draw"),
        compute: test("tests/device/by_id.rs", "numbers_draw_what_records_draw"),
        host: test(
            "tests/device/by_id.rs",
            "what_numbers_cannot_say_is_refused_by_name",
        ),
        device_cut: Nothing("the device writes records"),
        reference: Nothing("it has no lists on a device"),
    },
    ExecutorPromise {
        name: "every change of a setting and of the camera is seen",
        hardware: test(
            "tests/device/still.rs",
            "every_change_of_the_camera_is_seen",
        ),
        compute: test(
            "tests/device/still.rs",
            "every_change_of_the_camera_is_seen",
        ),
        host: test("tests/device/still.rs", "every_change_of_a_setting_is_seen"),
        device_cut: test("tests/device/device_cut.rs", "lists_stay_on_the_device"),
        reference: Nothing("it keeps nothing"),
    },
    ExecutorPromise {
        name: "what cannot be drawn is refused by name",
        hardware: test(
            "tests/device/falsecolor.rs",
            "what_cannot_be_drawn_is_refused_by_name",
        ),
        compute: test(
            "tests/device/paths.rs",
            "what_compute_cannot_draw_is_refused_by_name_only_where_it_is_insisted_on",
        ),
        host: Golden(&["points-2", "ellipse", "gauss", "overdraw"]),
        device_cut: NO_DEVICE_CUT,
        reference: test(
            "tests/device/falsecolor.rs",
            "what_cannot_be_drawn_is_refused_by_name",
        ),
    },
];

fn named<'a>(cases: &'a [GoldenCase], name: &str) -> &'a GoldenCase {
    let mut found = cases.iter().filter(|case| case.name == name);
    let case = found.next();
    assert!(found.next().is_none(), "two cases {name}");
    case.unwrap_or_else(|| panic!("no golden case {name}"))
}

#[test]
fn every_promise_of_every_executor_has_a_case_a_test_or_a_reason() {
    let cases = cases();
    for promise in TABLE {
        for proof in promise.proofs() {
            match proof {
                Golden(names) => {
                    assert!(!names.is_empty(), "{}", promise.name);
                    names
                        .iter()
                        .for_each(|name| assert_eq!(named(&cases, name).name, *name));
                }
                PromiseProof::Test { file, name } => {
                    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
                    let text = std::fs::read_to_string(&path).unwrap();
                    let code = text.split_whitespace().collect::<Vec<_>>().join(" ");
                    assert!(
                        code.contains(&format!("#[test] fn {name}()")),
                        "{}: no test {name} in {file}",
                        promise.name
                    );
                }
                Nothing(reason) => assert!(reason.len() > 10, "{}", promise.name),
            }
        }
    }
}

/// Every case belongs to a technique, and every executor draws it or refuses it for a reason.
#[test]
fn every_golden_case_is_in_the_table() {
    let cases = cases();
    let listed = |name: &str| {
        TABLE
            .iter()
            .any(|row| matches!(row.hardware, Golden(names) if names.contains(&name)))
    };
    for case in &cases {
        assert!(listed(case.name), "{} is in no row", case.name);
        assert!(
            case.blessed_by().is_some(),
            "{}: nobody draws it",
            case.name
        );
        for refusal in &case.refused {
            assert!(refusal.words.len() > 10, "{}", case.name);
        }
        let by_hardware = case.refusal(PictureExecutor::Hardware).is_none();
        assert!(
            case.blessed_by() == Some(PictureExecutor::Hardware) || !by_hardware,
            "{}: the rasterizer blesses what it draws",
            case.name
        );
        assert!(
            case.refusal(PictureExecutor::Reference).is_none(),
            "{}",
            case.name
        );
    }
    for executor in PictureExecutor::ALL {
        let drawn = cases.iter().filter(|case| case.refusal(executor).is_none());
        println!(
            "{executor:?} draws {} of {} cases",
            drawn.count(),
            cases.len()
        );
    }
}

/// All values of an enum; a new one does not compile until it is named here.
macro_rules! all {
    ($type:ident: $($variant:ident),* $(,)?) => {{
        let is_known = |value: &$type| match value { $($type::$variant => true),* };
        let all = vec![$($type::$variant),*];
        assert!(all.iter().all(is_known));
        all
    }};
}

#[test]
fn every_setting_has_a_golden_case() {
    let cases = cases();
    let has = |what: String, is_in: &dyn Fn(&GoldenCase) -> bool| {
        assert!(cases.iter().any(is_in), "no golden case has {what}");
    };
    for method in all!(Method: Triangles, Points, Splats, Pop) {
        has(format!("{method:?}"), &|case| {
            case.settings.method == method
        });
    }
    for splat in all!(SplatKind: Square, Disc, Ellipse, Gauss, Visibility, Filtered) {
        has(format!("{splat:?}"), &|case| {
            case.settings.draws_splats() && case.settings.splat == splat
        });
    }
    for blend in all!(Blend: Opaque, TwoPass, DepthThreshold, DepthRange) {
        has(format!("{blend:?}"), &|case| case.settings.blend() == blend);
    }
    for shading in all!(Shading: PerSplat, Deferred) {
        has(format!("{shading:?}"), &|case| {
            case.settings.shading == shading
        });
    }
    for reconstruction in all!(Reconstruction: Gaussian, Density, PullPush) {
        has(format!("{reconstruction:?}"), &|case| {
            case.settings.draws_visibility() && case.settings.reconstruction == reconstruction
        });
    }
    for color_by in
        all!(ColorBy: Shading, Primitive, Classification, Level, Normal, Depth, Overdraw)
    {
        has(format!("{color_by:?}"), &|case| {
            case.settings.color_by == color_by
        });
    }
    let kind = |light: &SurfaceLighting| match light {
        SurfaceLighting::Headlight => "headlight",
        SurfaceLighting::Phong(_) => "lamp",
        SurfaceLighting::Sphere(sphere) => sphere.name(),
    };
    let spheres = all!(LitSphere: Studio, Clay, Porcelain, Metal);
    let lights = spheres.into_iter().map(SurfaceLighting::Sphere);
    for light in lights.chain([
        SurfaceLighting::Headlight,
        SurfaceLighting::Phong(Phong::default()),
    ]) {
        has(format!("{light:?}"), &|case| {
            kind(&case.settings.light) == kind(&light)
        });
    }
    has("eye-dome lighting".into(), &|case| {
        case.settings.eye_dome == EyeDome::On
    });
    has("ambient occlusion".into(), &|case| {
        case.settings.ambient_occlusion == AmbientOcclusion::On
    });
    has("a background of two colors".into(), &|case| {
        case.settings.background_bottom.is_some()
    });
}
