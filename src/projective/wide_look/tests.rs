#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::projective::camera::CalibratedCamera;
use crate::projective::depth_map::{PhotoDepth, PhotoVisibility};
use crate::projective::lens::{CameraLens, LensModel};
use crate::projective::projected::ProjectedPhoto;
use crate::projective::pyramid::{PhotoPixels, PhotoPyramid};
use glam::{DMat3, DVec3, Vec2};

/// Width and height of the picture: no whole number of vectors.
const SIZE: [u32; 2] = [131, 60];

/// A photograph of a bent wall, made up: its pixels are waves, and a bar stands before a part of what it sees.
struct MadePhoto {
    photo: ProjectedPhoto,
    pixels: PhotoPyramid,
    depth: PhotoDepth,
    mask: Option<PhotoPyramid>,
}

fn made(index: u32, lens: CameraLens) -> MadePhoto {
    let turn = 0.45 * (f64::from(index) * 0.618_034).fract() - 0.2;
    let center = DVec3::new(9.0 * turn, 0.3 * f64::from(index % 3) - 0.3, -6.0);
    let camera = CalibratedCamera {
        width: 160,
        height: 120,
        focal: [150.0, 152.0],
        principal: [81.0, 58.5],
        lens,
        rotation: DMat3::from_rotation_y(turn) * DMat3::from_rotation_z(0.1 * f64::from(index)),
        center,
    };
    let wave = |at: u32, speed: f32| (127.0 + 90.0 * (at as f32 * speed).sin()) as u8;
    let tint = 20 * (index % 5) as u8;
    let rgb = (0..160 * 120).map(|at| {
        let (x, y) = (at % 160, at / 160);
        [wave(x, 0.21), wave(y, 0.17), wave(x + y, 0.05) / 2 + tint]
    });
    let pixels = PhotoPixels {
        width: 160,
        height: 120,
        rgb: rgb.collect(),
    };
    let bar = 30 + 7 * index % 90;
    let depth = (0..160 * 120).map(|at| match (bar..bar + 20).contains(&(at % 160)) {
        true => 3.0,
        false => 9.0,
    });
    let mask = (index % 4 == 1).then(|| {
        let kept = |at: u32| if at % 80 < 30 { [0; 3] } else { [255; 3] };
        PhotoPyramid::new(PhotoPixels {
            width: 80,
            height: 60,
            rgb: (0..80 * 60).map(kept).collect(),
        })
    });
    let mut photo = ProjectedPhoto::new(index, &camera, DVec3::ZERO, 10.0);
    photo.gain = Vec3::new(1.1, 0.95, 1.0 + 0.02 * index as f32);
    MadePhoto {
        photo,
        pixels: PhotoPyramid::new(pixels),
        depth: PhotoDepth::new(
            [160, 120],
            Vec2::new(150.0, 152.0),
            Vec2::new(81.0, 58.5),
            depth.collect(),
        ),
        mask,
    }
}

fn rays(is_perspective: bool) -> SurfaceRays {
    let [width, height] = SIZE.map(|side| side as f32);
    let step = if is_perspective { 0.009 } else { 0.06 };
    let corner = Vec3::new(-0.5 * step * width, -0.5 * step * height, 0.0);
    let eye = Vec3::new(0.4, 0.1, -6.3);
    SurfaceRays {
        start: if is_perspective { eye } else { eye + corner },
        towards: if is_perspective {
            corner + Vec3::Z
        } else {
            Vec3::Z
        },
        right: Vec3::X * step,
        down: Vec3::Y * step,
        is_perspective,
    }
}

/// Distances and normals of a row: a wall in waves, with holes, without a normal at some pixels, and one that faces away.
fn row_of(row: u32) -> (Vec<f32>, Vec<[f32; 3]>) {
    let distance = |x: u32| match (x * 7 + row) % 23 {
        0 => f32::INFINITY,
        _ => 6.0 + 0.4 * (x as f32 * 0.1).sin(),
    };
    let normal = |x: u32| match (x + 3 * row) % 29 {
        0 => Vec3::ZERO,
        1 => Vec3::Z,
        k => Vec3::new(0.05 * k as f32 - 0.7, 0.2, -1.0).normalize(),
    };
    let columns = || 0..SIZE[0];
    (
        columns().map(distance).collect(),
        columns().map(|x| normal(x).into()).collect(),
    )
}

/// Largest difference of any channel to the function for one pixel, where both choose alike, and pixels where they do not.
fn compared(
    photos: &[LookPhoto<'_>],
    settings: &LookSettings,
    is_perspective: bool,
) -> (f32, usize, usize) {
    let rays = rays(is_perspective);
    let wide = WideLook::new(&rays, Vec3::Z, photos, settings);
    assert!(wide.is_wide);
    let view = rays.look_view(Vec3::Z);
    let (mut largest, mut otherwise, mut covered) = (0.0_f32, 0, 0);
    for y in 0..SIZE[1] {
        let (distances, normals) = row_of(y);
        let mut found = vec![
            LookPixel {
                weight: 9.0,
                ..LookPixel::default()
            };
            distances.len()
        ];
        let row = SurfaceRow {
            first: [0, y],
            distances: &distances,
            normals: &normals,
        };
        wide.row(row, &mut found);
        for (x, own) in (0..).zip(&found) {
            let distance = distances[x as usize];
            let wanted = match distance.is_finite() {
                false => LookPixel::default(),
                true => {
                    let pixel = rays.pixel([x, y], distance, Vec3::from(normals[x as usize]));
                    look_at_pixel(&pixel, &view, photos, settings)
                }
            };
            let apart = (0..3)
                .map(|c| (own.color[c] - wanted.color[c]).abs())
                .fold(0.0, f32::max);
            covered += usize::from(wanted.weight > 0.0);
            if own.best != wanted.best
                || (own.weight > 0.0) != (wanted.weight > 0.0)
                || apart > 1.0 / 255.0
            {
                otherwise += 1;
            } else {
                largest = largest.max(apart);
            }
        }
    }
    (largest, otherwise, covered)
}

#[test]
fn many_pixels_at_once_are_the_same_as_one_after_the_other() {
    let brown = CameraLens::new(LensModel::Brown, &[-0.05, 0.01, 1e-3, 2e-3]);
    let rational = CameraLens::new(LensModel::Rational, &[0.02, 0.01, 1e-3, -1e-3, 0.0, 0.04]);
    let fisheye = CameraLens::new(LensModel::Fisheye, &[0.01, 0.002]);
    let lenses = [CameraLens::default(), brown, rational, fisheye];
    let made: Vec<MadePhoto> = (0..24).map(|k| made(k, lenses[k as usize % 4])).collect();
    let all: Vec<LookPhoto<'_>> = (made.iter())
        .map(|own| LookPhoto {
            photo: &own.photo,
            pixels: &own.pixels,
            depth: &own.depth,
            mask: own.mask.as_ref(),
        })
        .collect();
    let usual = LookSettings::default();
    for (what, photos, settings, is_perspective) in [
        ("usual", &all[..], usual, true),
        ("parallel", &all[..], usual, false),
        ("one photograph", &all[..1], usual, true),
        ("seven", &all[4..11], usual, true),
        (
            "the best alone",
            &all[..],
            LookSettings { blend: 1, ..usual },
            true,
        ),
        (
            "no consensus, no gains",
            &all[..],
            LookSettings {
                consensus: false,
                gains: false,
                ..usual
            },
            true,
        ),
        (
            "hard",
            &all[..],
            LookSettings {
                visibility: PhotoVisibility::Depth,
                ..usual
            },
            true,
        ),
        (
            "blind",
            &all[..],
            LookSettings {
                visibility: PhotoVisibility::Off,
                border: 0.0,
                ..usual
            },
            true,
        ),
    ] {
        let (largest, otherwise, covered) = compared(photos, &settings, is_perspective);
        println!("{what}: {otherwise} of {covered} pixels otherwise, {largest} at most");
        assert!(covered > 3000, "{what}: {covered}");
        // A comparison that falls out otherwise, of a depth or at a border, changes a pixel: rounding decides few.
        assert!(
            400 * otherwise <= covered,
            "{what}: {otherwise} of {covered}"
        );
    }
}

#[test]
fn what_is_not_wide_goes_pixel_by_pixel() {
    let mut own = made(0, CameraLens::default());
    own.photo.stage = 1;
    let photos = [LookPhoto {
        photo: &own.photo,
        pixels: &own.pixels,
        depth: &own.depth,
        mask: None,
    }];
    let (rays, settings) = (rays(true), LookSettings::default());
    let wide = WideLook::new(&rays, Vec3::Z, &photos, &settings);
    assert!(!wide.is_wide);
    let (distances, normals) = row_of(30);
    let mut found = vec![LookPixel::default(); distances.len()];
    let row = SurfaceRow {
        first: [0, 30],
        distances: &distances,
        normals: &normals,
    };
    wide.row(row, &mut found);
    let view = rays.look_view(Vec3::Z);
    let pixel = rays.pixel([60, 30], distances[60], Vec3::from(normals[60]));
    assert_eq!(found[60], look_at_pixel(&pixel, &view, &photos, &settings));
    assert!(found.iter().any(|pixel| pixel.weight > 0.0));
    assert!(
        distances
            .iter()
            .zip(&found)
            .all(|(d, own)| d.is_finite() || *own == LookPixel::default())
    );
}
