//! The fast raster against the exact picture.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use super::*;
use crate::image::Image;
use crate::pack::ALBEDO;
use crate::patches::tests::{
    PatchedModel, model_of, settings_of, tolerances, uncovered, view_from_anywhere,
};
use crate::patches::{PatchStyle, draw};

/// The light of exact pictures.
const LIGHT: PatchLight = PatchLight {
    is_parallel: false,
    is_two_sided: true,
    has_colors: true,
    albedo: [ALBEDO; 3],
};

/// A picture of patches on white, drawn by vectors of a level.
fn picture(
    raster: &mut PatchRaster,
    level: Level,
    list: PatchList<'_>,
    view: &View,
    rect_px: [u32; 4],
) -> Image {
    let [left, top, right, bottom] = rect_px;
    let pixels = view.width as usize * view.height as usize;
    let mut colors = vec![0x00ff_ffffu32; pixels];
    let mut depths = vec![0.0; ((right - left) * (bottom - top)) as usize];
    let from = (top * view.width + left) as usize;
    let target = PatchTarget {
        colors: &mut colors[from..],
        pitch: view.width as usize,
        depths: &mut depths,
        rect_px,
        keeps_numbers: false,
    };
    let light = PatchLight {
        is_parallel: !view.is_perspective
            || view.light == crate::math::camera::HeadlightSource::Directional,
        ..LIGHT
    };
    raster.draw_by(
        level,
        (&[list], &RasterView::new(view)),
        BlockInk::Lit(light),
        target,
        &mut [],
    );
    let color: Vec<[u8; 4]> = colors.iter().map(|word| word.to_le_bytes()).collect();
    let mut depth = vec![f32::INFINITY; pixels];
    for (row, own) in depths.chunks((right - left) as usize).enumerate() {
        for (column, &value) in own.iter().enumerate() {
            let at = (top as usize + row) * view.width as usize + left as usize + column;
            depth[at] = view.distance_of_depth(value);
        }
    }
    Image {
        width: view.width,
        height: view.height,
        values: color
            .iter()
            .map(|c| c.map(|byte| f32::from(byte) / 255.0))
            .collect(),
        color,
        depth,
        normal: Vec::new(),
    }
}

/// The fast picture is the exact one but for single pixels at edges, misses none, and depends neither on threads nor much on
/// the vectors of the processor.
#[test]
fn the_fast_picture_is_the_exact_one() {
    let mut state = 51;
    let (mut differing, mut other, mut covered) = (0, 0, 0);
    for spec in ["sphere:8000", "torus:8000", "statue:8000"] {
        let patched = PatchedModel::new(model_of(spec));
        let records = patched.patches.records.iter();
        let polygons: Vec<_> = records.map(|record| record.polygon()).collect();
        let mut rasters = [1, 3].map(PatchRaster::with_threads);
        for round in 0..60 {
            let view = view_from_anywhere(&patched.model, 97, &mut state);
            let e = [0.15, 0.5, 1.0][round % 3];
            let settings = settings_of(&patched.model, tolerances(e, e, 60.0));
            let mut cut = patched.cut(&view, &settings);
            cut.rest.clear();
            let style = PatchStyle::default();
            let exact = draw(&patched.model, &patched.patches, &cut, &view, &style).image;
            let list = PatchList {
                polygons: &polygons,
                ids: &cut.patches,
            };
            let [one, three] = [0, 1].map(|i: usize| {
                picture(&mut rasters[i], Level::new(), list, &view, [0, 0, 97, 97])
            });
            assert_eq!(one, three);
            let missed = uncovered(&exact, &one);
            assert!(missed.is_empty(), "{spec}, round {round}: {missed:?}");
            covered += exact.covered_pixels();
            let is_off =
                |(a, b): (&[f32; 4], &[f32; 4])| a[3] != b[3] || (a[0] - b[0]).abs() > 2.0 / 255.0;
            let off = |a: &Image, b: &Image| {
                a.values
                    .iter()
                    .zip(&b.values)
                    .filter(|&pair| is_off(pair))
                    .count() as u64
            };
            differing += off(&exact, &one);
            let plain = picture(
                &mut rasters[0],
                Level::baseline(),
                list,
                &view,
                [0, 0, 97, 97],
            );
            other += off(&plain, &one);
        }
    }
    // Mostly in margins of up to a pixel, which end square here.
    assert!(differing * 25 < covered, "{differing} of {covered}");
    // Rounding moves an edge across a center now and then.
    assert!(other * 2000 < covered, "{other} of {covered}");
}

/// A polygon of three to eight corners is drawn where the exact one is, but within a hundredth of a pixel of its outline.
#[test]
fn polygons_of_any_number_of_corners_are_whole() {
    let model = model_of("sphere:200");
    let camera = model.orbit_camera((90, 80), 0.4, 0.5, 1.0);
    let view = camera.view(model.origin).unwrap();
    let frame = crate::pack::polygons::PlaneFrame::new(
        model.orbit_center.as_dvec3(),
        glam::DVec3::new(0.3, 0.5, 1.0),
    )
    .unwrap();
    for count in 3..=8 {
        let corner = |i: usize| {
            let turn = 0.2 + i as f64 * std::f64::consts::TAU / count as f64;
            0.6 * f64::from(model.orbit_radius) * glam::DVec2::from_angle(turn)
        };
        let corners: Vec<_> = (0..count).map(corner).collect();
        let polygon = OrientedPolygon::flat(&frame, &corners, [200, 90, 40, 255]).unwrap();
        let seen = crate::pack::polygons::ScreenPolygon::of(&polygon, &view).unwrap();
        let list = PatchList {
            polygons: &[polygon],
            ids: &[0],
        };
        let mut raster = PatchRaster::with_threads(1);
        let found = picture(&mut raster, Level::new(), list, &view, [0, 0, 90, 80]);
        let mut inside = 0;
        for (at, color) in found.color.iter().enumerate() {
            let at = glam::DVec2::new((at % 90) as f64 + 0.5, (at / 90) as f64 + 0.5);
            let nearest = |step| seen.outside_px(at + step * 0.01) > 0.0;
            let around = [
                glam::DVec2::X,
                glam::DVec2::Y,
                glam::DVec2::NEG_X,
                glam::DVec2::NEG_Y,
            ]
            .map(nearest);
            let is_out = seen.outside_px(at) > 0.0;
            if around.iter().all(|beside| *beside == is_out) {
                assert_eq!(color[3] == 0, is_out, "{count} corners at {at}");
                inside += usize::from(!is_out);
            }
        }
        assert!(inside > 300, "{inside} pixels of {count} corners");
    }
}

/// A part of the picture is that part of the whole, however small, and what is nearer already stays.
#[test]
fn rectangles_are_parts_of_the_whole() {
    let patched = PatchedModel::new(model_of("torus:8000"));
    let records = patched.patches.records.iter();
    let polygons: Vec<_> = records.map(|record| record.polygon()).collect();
    let camera = patched.model.orbit_camera((97, 90), 0.4, 0.5, 1.0);
    let view = camera.view(patched.model.origin).unwrap();
    let settings = settings_of(&patched.model, tolerances(0.5, 0.5, 60.0));
    let cut = patched.cut(&view, &settings);
    let list = PatchList {
        polygons: &polygons,
        ids: &cut.patches,
    };
    let mut raster = PatchRaster::with_threads(2);
    let whole = picture(&mut raster, Level::new(), list, &view, [0, 0, 97, 90]);
    assert!(whole.covered_pixels() > 1000);
    for rect_px in [
        [20, 10, 71, 80],
        [30, 40, 33, 80],
        [20, 33, 70, 35],
        [40, 44, 41, 45],
        [0, 0, 97, 67],
    ] {
        let [left, top, right, bottom] = rect_px;
        let part = picture(&mut raster, Level::new(), list, &view, rect_px);
        for at in 0..97 * 90 {
            let (x, y) = (at % 97, at / 97);
            let is_within = (left..right).contains(&x) && (top..bottom).contains(&y);
            let expected = match is_within {
                true => whole.color[at as usize],
                false => [255, 255, 255, 0],
            };
            assert_eq!(part.color[at as usize], expected, "{rect_px:?} at {x}, {y}");
        }
    }
    // Everything at the near plane hides all patches.
    let mut colors = vec![7; 97 * 90];
    let mut depths = vec![1.0; 97 * 90];
    let target = PatchTarget {
        colors: &mut colors,
        pitch: 97,
        depths: &mut depths,
        rect_px: [0, 0, 97, 90],
        keeps_numbers: false,
    };
    raster.draw(&[list], &view, &LIGHT, target);
    assert!(colors.iter().all(|word| *word == 7) && depths.iter().all(|depth| *depth == 1.0));
}

/// Numbers are those of the patches that are nearest, in the order of all lists, with their places in the plane.
#[test]
fn numbers_are_those_of_what_is_seen() {
    let patched = PatchedModel::new(model_of("sphere:8000"));
    let records = patched.patches.records.iter();
    let polygons: Vec<_> = records.map(|record| record.polygon()).collect();
    let camera = patched.model.orbit_camera((64, 64), 0.4, 0.5, 1.0);
    let view = camera.view(patched.model.origin).unwrap();
    let settings = settings_of(&patched.model, tolerances(0.5, 0.5, 60.0));
    let cut = patched.cut(&view, &settings);
    let (first, second) = cut.patches.split_at(cut.patches.len() / 3);
    let lists = [first, second].map(|ids| PatchList {
        polygons: &polygons,
        ids,
    });
    let drawn: Vec<_> = cut
        .patches
        .iter()
        .map(|&id| polygons[id as usize])
        .collect();
    let mut raster = PatchRaster::with_threads(2);
    let mut depths = vec![0.0; 64 * 64];
    raster.draw_numbers(&lists, &view, &mut depths, [0, 0, 64, 64]);
    let mut seen = std::collections::BTreeSet::new();
    let (mut far, mut covered) = (0, 0);
    for y in 0..64 {
        for x in 0..64 {
            let depth = depths[(y * 64 + x) as usize];
            let found = raster.pixel(&drawn, [x, y], depth);
            assert_eq!(found.is_some(), depth > 0.0);
            let Some(pixel) = found else { continue };
            seen.insert(pixel.number);
            // What the foot shows lies in the pixel, but at rims: in the margin, and nearly edge-on.
            let point = drawn[pixel.number as usize].point(pixel.uv);
            let (at_x, at_y, _) = view.project(point);
            let off = (at_x - x as f32 - 0.5).hypot(at_y - y as f32 - 0.5);
            covered += 1;
            far += usize::from(off > 0.5);
            assert!(off < 4.0, "{off} pixels at {x}, {y}");
        }
    }
    assert!(far * 20 < covered, "{far} of {covered}");
    assert!(seen.len() > 100 && seen.last().is_some_and(|n| *n as usize >= first.len()));
}

#[test]
fn bands_are_as_high_as_blocks() {
    for rows in 4..200 {
        let edges = band_edges(rows);
        assert_eq!((edges[0], edges.last()), (0, Some(&rows)));
        let heights: Vec<usize> = edges.windows(2).map(|edge| edge[1] - edge[0]).collect();
        assert!(
            heights.iter().all(|h| (SIDE..BAND_ROWS + SIDE).contains(h)),
            "{heights:?}"
        );
    }
}
