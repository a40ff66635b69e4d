use crate::render::cost::model::*;

fn splat(splat_ns: [f64; 3], box_ns: f64, covered_ns: f64) -> SplatCosts {
    SplatCosts {
        splat_ns,
        passes: PassCosts {
            box_ns,
            covered_ns,
            ..PassCosts::default()
        },
    }
}

/// A device on which a raster splat takes 100 ns whatever its size, one by compute 10 ns and 10 more for each pixel
/// above the first; shading a pixel takes 2 ns, a covered one 20 more.
fn costs() -> DrawCosts {
    let square = PerRasterizer {
        raster: Some(splat([100.0; 3], 0.0, 0.0)),
        compute: Some(splat([10.0, 90.0, 360.0], 2.0, 20.0)),
    };
    DrawCosts {
        square: Some(square),
        gauss: Some(square),
        filtered: Some(PerRasterizer {
            raster: Some(splat([400.0; 3], 5.0, 0.0)),
            compute: None,
        }),
        gauss_merge: Some(MergeCosts {
            splat_ns: 30.0,
            passes: PassCosts {
                frame_ns: 1e6,
                box_ns: 4.0,
                ..PassCosts::default()
            },
        }),
        triangle: Some(PerRasterizer {
            raster: Some(TriangleCosts {
                triangle_ns: 70.0,
                passes: PassCosts::default(),
            }),
            compute: Some(TriangleCosts {
                triangle_ns: 20.0,
                passes: PassCosts {
                    box_ns: 2.0,
                    covered_ns: 100.0,
                    ..PassCosts::default()
                },
            }),
        }),
        node_ns: Some(4.0),
        device_node_ns: Some(6.0),
        ..DrawCosts::default()
    }
}

const PIXELS: PicturePixels = PicturePixels {
    picture: 1_000_000,
    of_box: 250_000,
};

fn load(triangles: u64, splats: u64, size_px: f32) -> DrawLoad {
    DrawLoad {
        triangles,
        splats,
        size_px,
        pixels: PIXELS,
    }
}

#[test]
fn sizes_between_and_beyond_are_linear_in_area() {
    let c = splat([10.0, 90.0, 360.0], 0.0, 0.0);
    assert_eq!(SIZES_PX.map(|s| c.splat_ns(s)), [10.0, 90.0, 360.0]);
    // Side 2 has 4 pixels: 3 of the 8 between 1 and 9.
    assert_eq!(c.splat_ns(2.0), 40.0);
    // Side 12 has 144: 135 beyond 9, at 270 for 27.
    assert_eq!(c.splat_ns(12.0), 1440.0);
    assert_eq!((c.splat_ns(0.2), c.splat_ns(f32::NAN)), (10.0, 10.0));
    // A measurement that fell with the size is not carried on below its end.
    assert_eq!(splat([10.0, 90.0, 80.0], 0.0, 0.0).splat_ns(60.0), 80.0);
}

#[test]
fn passes_cost_a_frame_pixels_of_picture_and_box_and_covered_ones() {
    let passes = PassCosts {
        frame_ns: 1000.0,
        picture_ns: 0.5,
        box_ns: 2.0,
        covered_ns: 10.0,
    };
    let nothing = 1000.0 + 500_000.0 + 500_000.0;
    assert_eq!(passes.of_nothing(PIXELS), nothing);
    assert_eq!(passes.of(PIXELS, 100.0), nothing + 1000.0);
    // No more than 0.6 of the box.
    assert_eq!(passes.of(PIXELS, 1e9), nothing + 1_500_000.0);
    let c = SplatCosts {
        splat_ns: [7.0; 3],
        passes,
    };
    assert_eq!(c.frame_ns(0, 3.0, PIXELS), 0.0);
    // 100 splats of 4 x 4 pixels bring 400 pixels.
    assert_eq!(c.frame_ns(100, 4.0, PIXELS), nothing + 700.0 + 4000.0);
}

#[test]
fn many_small_splats_go_by_compute_and_few_or_large_ones_do_not() {
    let c = costs();
    let path = |count, size| {
        let chosen = c.blended_path(SplatKind::Gauss, &load(0, count, size), (false, false));
        chosen.unwrap().choice
    };
    // Side 1: 100 ns by the rasterizer, 10 and 20 for its pixel by compute, which counts a tenth more, as do the 500,000 of the
    // box: paid by 550,000 / (100 - 33) of them.
    assert_eq!(path(8_208, 1.0), Path::Raster);
    assert_eq!(path(8_210, 1.0), Path::Compute);
    // Side 3: 1 ns saved a splat (100 less 99), 3,850,000 for the box and the 150,000 pixels that it can have covered.
    assert_eq!(path(3_849_000, 3.0), Path::Raster);
    assert_eq!(path(3_851_000, 3.0), Path::Compute);
    assert_eq!(path(u64::MAX, 6.0), Path::Raster);
    assert_eq!(path(0, 1.0), Path::Raster);
    // What the rasterizer cannot goes by compute however few there are, and the other way round.
    let mut c = costs();
    let filtered = |c: &DrawCosts| {
        let load = load(0, 1_000_000, 1.0);
        let chosen = c.blended_path(SplatKind::Filtered, &load, (false, false));
        chosen.map(|chosen| chosen.choice)
    };
    assert_eq!(filtered(&c), Some(Path::Raster));
    c.filtered = c.gauss.map(|ways| PerRasterizer {
        raster: None,
        ..ways
    });
    assert_eq!(filtered(&c), Some(Path::Compute));
    c.filtered = None;
    assert_eq!(filtered(&c), None);
}

#[test]
fn beside_the_rasterizer_merging_is_paid_for() {
    let c = costs();
    let path = |count, beside| {
        let chosen = c.blended_path(SplatKind::Gauss, &load(0, count, 1.0), beside);
        chosen.map(|chosen| chosen.choice)
    };
    // 500,000 ns of the box, and 1,000,000 and 4 a pixel for merging, and a tenth: 2,750,000 / (100 - 33) = 41,045 splats.
    for (count, beside, wanted) in [
        (41_000, (true, false), Path::Raster),
        (41_100, (true, false), Path::Compute),
        // 30 ns more for each that the rasterizer looks at, 33 with the tenth: 80,882.
        (80_800, (true, true), Path::Raster),
        (80_900, (true, true), Path::Compute),
        (80_800, (false, true), Path::Raster),
        (8_300, (false, false), Path::Compute),
    ] {
        assert_eq!(path(count, beside), Some(wanted), "{count}, {beside:?}");
    }
    // Not measured, not decided.
    let mut without = c;
    without.gauss_merge = None;
    let asked = |beside| without.blended_path(SplatKind::Gauss, &load(0, 9, 1.0), beside);
    assert!(asked((true, false)).is_none() && asked((false, false)).is_some());
}

#[test]
fn splats_follow_triangles_and_their_pixels_count_once() {
    let c = costs();
    let paths = |t, s| {
        let chosen = c.opaque_paths(SplatKind::Square, &load(t, s, 1.0)).unwrap();
        (chosen.choice.triangles, chosen.choice.splats)
    };
    use Path::{Compute, Raster};
    assert_eq!(paths(0, 0), (Raster, Raster));
    assert_eq!(paths(1_000, 1_000), (Raster, Raster));
    assert_eq!(paths(1_000, 100_000), (Raster, Compute));
    // 250,000 pixels of 2 ns, 150,000 of them of 100 more: with a tenth 17,050,000 / (70 - 22) = 355,208 triangles. Beside
    // splats by compute it is 15,000,000 / (70 - 20).
    assert_eq!(paths(355_000, 0), (Raster, Raster));
    assert_eq!(paths(355_400, 0), (Compute, Compute));
    assert_eq!(paths(301_000, 100_000), (Compute, Compute));
    assert_eq!(paths(299_000, 100_000), (Raster, Compute));
    let mut without = c;
    without.square = c.square.map(|ways| PerRasterizer {
        compute: None,
        ..ways
    });
    let chosen = without
        .opaque_paths(SplatKind::Square, &load(1_000_000, 1_000_000, 1.0))
        .unwrap();
    assert_eq!(
        (chosen.choice.triangles, chosen.choice.splats),
        (Raster, Raster)
    );
    assert!(chosen.compute_ns.is_infinite() && chosen.raster_ns == 1.7e8);
    without.square = None;
    assert!(
        without
            .opaque_paths(SplatKind::Square, &load(9, 9, 1.0))
            .is_none()
    );
}

#[test]
fn points_end_where_quads_are_clearly_cheaper() {
    let largest = |point_ns, quad_ns| PrimitiveCosts { point_ns, quad_ns }.largest_point_px();
    let same = [100.0; 6];
    // What is equal, or within a tenth, stays a point.
    assert_eq!(largest(same, same), f32::INFINITY);
    assert_eq!(largest([109.0; 6], same), f32::INFINITY);
    assert_eq!(largest([111.0; 6], same), 0.0);
    assert_eq!(largest(same, [1.0; 6]), 0.0);
    assert_eq!(largest([0.0; 6], [0.0; 6]), f32::INFINITY);
    // Points grow with the area (10 ns a pixel), quads cost 1000 ns / 1.1 each: equal at 100 pixels.
    let areas = PRIMITIVE_SIZES_PX.map(|s| 10.0 * f64::from(s * s));
    let quads = [1000.0 / 1.1; 6];
    let px = largest(areas, quads);
    assert!((px - 10.0).abs() < 1e-4, "{px}");
    // One size that noise made wrong moves nothing by much.
    let mut noisy = areas;
    noisy[1] = 1500.0;
    let px = largest(noisy, quads);
    assert!((px - 10.0).abs() < 1e-4, "{px}");
    // Quads that are cheaper for small splats only are not drawn unless they are cheaper on the whole.
    assert_eq!(
        largest([120.0, 50.0, 50.0, 50.0, 50.0, 50.0], same),
        f32::INFINITY
    );
    // Where the sizes around the border contradict it, it lies in the middle of their areas.
    let px = largest([1.0, 1.0, 120.0, 1.0, 900.0, 900.0], same);
    assert!((px - 16.0).abs() > 1.0 && px > 16.0 && px < 32.0, "{px}");
    let costs = DrawCosts {
        primitives: Some(PrimitiveCosts {
            point_ns: areas,
            quad_ns: quads,
        }),
        ..DrawCosts::default()
    };
    assert!(
        costs
            .largest_point_px()
            .is_some_and(|px| (px - 10.0).abs() < 1e-4)
    );
    assert_eq!(DrawCosts::default().largest_point_px(), None);
}

#[test]
fn what_was_not_measured_comes_from_the_other() {
    let (mut a, b) = (costs(), costs());
    a.square = None;
    a.node_ns = Some(5.0);
    let both = a.or(b);
    assert_eq!((both.square, both.node_ns), (b.square, Some(5.0)));
    assert_eq!(DrawCosts::default().or(b), b);
}

#[test]
fn times_that_cannot_be_are_seen() {
    assert!(costs().is_whole() && DrawCosts::default().is_whole());
    let wrong = |change: fn(&mut DrawCosts)| {
        let mut c = costs();
        change(&mut c);
        assert!(!c.is_whole(), "{c:?}");
    };
    wrong(|c| c.node_ns = Some(f64::NAN));
    wrong(|c| c.device_node_ns = Some(-1.0));
    wrong(|c| c.square.as_mut().unwrap().raster = Some(splat([1.0, 1.0, -1.0], 0.0, 0.0)));
    wrong(|c| {
        c.gauss.as_mut().unwrap().compute = Some(splat([1.0, f64::INFINITY, 1.0], 0.0, 0.0));
    });
    wrong(|c| c.gauss_merge.as_mut().unwrap().passes.frame_ns = -1.0);
    wrong(|c| {
        c.triangle
            .as_mut()
            .unwrap()
            .compute
            .as_mut()
            .unwrap()
            .triangle_ns = f64::NAN;
    });
    wrong(|c| {
        c.primitives = Some(PrimitiveCosts {
            point_ns: [1.0; 6],
            quad_ns: [-1.0; 6],
        });
    });
}
