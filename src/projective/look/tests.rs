//! Weights by their closed forms, and a generated scene: a wall with a box before it.

use super::*;
use crate::photos::decode::PhotoPixels;
use crate::photos::gains::exposure_gains;
use crate::photos::lens::CameraLens;
use crate::photos::scene::CalibratedCamera;
use glam::{DMat3, DVec2, DVec3};

/// Limit of 70 degrees.
fn limit() -> f32 {
    70_f32.to_radians().cos()
}

fn camera(center: DVec3, turn: f64) -> CalibratedCamera {
    CalibratedCamera {
        width: 240,
        height: 180,
        focal: [200.0; 2],
        principal: [120.0, 90.0],
        lens: CameraLens::default(),
        rotation: DMat3::from_rotation_y(turn),
        center,
    }
}

#[test]
fn princ_weights_have_their_values() {
    let photo = ProjectedPhoto::new(0, &camera(DVec3::ZERO, 0.0), DVec3::ZERO, 1.0);
    let weight = |form: WeightForm, degrees: f32| {
        let a = degrees.to_radians();
        let normal = -Vec3::new(a.sin(), 0.0, a.cos());
        princ_weight(form, &photo, Vec3::Z, normal, Vec3::Z, limit())
    };
    for (degrees, wanted) in [
        (0.0, 1.0),
        (30.0, 0.7964),
        (45.0, 0.5549),
        (60.0, 0.2401),
        (70.0, 0.0),
        (120.0, 0.0),
    ] {
        let found = weight(WeightForm::Mended, degrees);
        assert!((found - wanted).abs() < 1e-4, "{degrees}: {found}");
    }
    // As printed nothing ever has weight 0, not even what faces away.
    for (degrees, wanted) in [(0.0, 4.04), (90.0, 2.52), (180.0, 1.0)] {
        let found = weight(WeightForm::Printed, degrees);
        assert!((found - wanted).abs() < 5e-3, "{degrees}: {found}");
    }
    // Two negative factors make no weight.
    let behind = princ_weight(
        WeightForm::Mended,
        &photo,
        Vec3::Z,
        Vec3::Z,
        -Vec3::Z,
        limit(),
    );
    assert_eq!(behind, 0.0);
}

/// Depth of the wall and of the box before it, whose front is 2 x 2.
const WALL: f64 = 10.0;
const BOX: f64 = 5.0;

/// Distance along z, and color, of what a ray meets: the wall is blue, the box red.
fn trace(eye: DVec3, ray: DVec3) -> Option<(f64, [f32; 3])> {
    if ray.z <= 0.0 {
        return None;
    }
    let at = |z: f64| eye + ray * ((z - eye.z) / ray.z);
    let wave = |p: DVec3| 0.12 * ((3.0 * p.x).sin() * (2.0 * p.y).cos()) as f32;
    let front = at(BOX);
    if front.x.abs() <= 1.0 && front.y.abs() <= 1.0 {
        return Some((BOX, [0.55 + wave(front), 0.15, 0.15]));
    }
    let wall = at(WALL);
    Some((WALL, [0.15, 0.2, 0.55 + wave(wall)]))
}

struct TracedPhoto {
    photo: ProjectedPhoto,
    pixels: PhotoPyramid,
    depth: PhotoDepth,
}

impl TracedPhoto {
    fn new(index: u32, camera: &CalibratedCamera, exposure: f32) -> Self {
        let (mut rgb, mut depth) = (Vec::new(), Vec::new());
        for at in 0..camera.width * camera.height {
            let pixel = pixel_of(camera, at);
            let (z, color) = trace(camera.center, camera.direction(pixel).unwrap()).unwrap();
            rgb.push(color.map(|v| (v * exposure * 255.0 + 0.5).min(255.0) as u8));
            let point = camera.center
                + camera.direction(pixel).unwrap()
                    * ((z - camera.center.z) / camera.direction(pixel).unwrap().z);
            depth.push(camera.to_camera(point).z as f32);
        }
        let size = [camera.width, camera.height];
        let pair = |v: [f64; 2]| Vec2::new(v[0] as f32, v[1] as f32);
        let pixels = PhotoPixels {
            width: size[0],
            height: size[1],
            rgb,
        };
        Self {
            photo: ProjectedPhoto::new(index, camera, DVec3::ZERO, 10.0),
            pixels: PhotoPyramid::new(pixels),
            depth: PhotoDepth::new(size, pair(camera.focal), pair(camera.principal), depth),
        }
    }

    fn look(&self) -> LookPhoto<'_> {
        LookPhoto {
            photo: &self.photo,
            pixels: &self.pixels,
            depth: &self.depth,
            mask: None,
        }
    }
}

fn pixel_of(camera: &CalibratedCamera, at: u32) -> DVec2 {
    DVec2::new(
        f64::from(at % camera.width) + 0.5,
        f64::from(at / camera.width) + 0.5,
    )
}

/// The true surface of a picture, its colors, and what the look makes of it.
struct Rephotograph {
    truth: Vec<[f32; 3]>,
    depth: Vec<f64>,
    pixels: Vec<LookPixel>,
}

fn rephotograph(
    camera: &CalibratedCamera,
    photos: &[TracedPhoto],
    settings: &LookSettings,
) -> Rephotograph {
    let photos: Vec<LookPhoto<'_>> = photos.iter().map(TracedPhoto::look).collect();
    let view = LookView {
        eye: camera.center.as_vec3(),
        direction: camera.axis().as_vec3(),
        parallel: None,
    };
    let mut found = Rephotograph {
        truth: vec![],
        depth: vec![],
        pixels: vec![],
    };
    for at in 0..camera.width * camera.height {
        let pixel = pixel_of(camera, at);
        let meet = |p: DVec2, z: f64| {
            let ray = camera.direction(p).unwrap();
            camera.center + ray * ((z - camera.center.z) / ray.z)
        };
        let (z, color) = trace(camera.center, camera.direction(pixel).unwrap()).unwrap();
        let position = meet(pixel, z);
        let step = |d: DVec2| (meet(pixel + d, z) - position).as_vec3();
        let surface = SurfacePixel {
            position: position.as_vec3(),
            normal: -Vec3::Z,
            steps: [step(DVec2::X), step(DVec2::Y)],
        };
        found
            .pixels
            .push(look_at_pixel(&surface, &view, &photos, settings));
        found.truth.push(color);
        found.depth.push(z);
    }
    found
}

impl Rephotograph {
    fn psnr(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (pixel, truth) in self
            .pixels
            .iter()
            .zip(&self.truth)
            .filter(|(p, _)| p.weight > 0.0)
        {
            sum += (0..3)
                .map(|c| f64::from(pixel.color[c] - truth[c]).powi(2))
                .sum::<f64>();
            count += 3;
        }
        -10.0 * (sum / f64::from(count)).log10()
    }

    /// Pixels that show the other surface, more than a pixel from an outline.
    fn wrong(&self, width: usize) -> usize {
        let is_box = |c: &[f32; 3]| c[0] > c[2];
        let height = self.depth.len() / width;
        let is_outline = |x: usize, y: usize| {
            let near = |v: usize, most: usize| v.saturating_sub(1)..=(v + 1).min(most - 1);
            near(y, height).any(|j| {
                near(x, width).any(|i| self.depth[j * width + i] != self.depth[y * width + x])
            })
        };
        (0..self.depth.len())
            .filter(|at| self.pixels[*at].weight > 0.0 && !is_outline(at % width, at / width))
            .filter(|at| is_box(&self.pixels[*at].color) != is_box(&self.truth[*at]))
            .count()
    }
}

/// Four photographs from the sides, in which the box hides different parts of the wall.
fn photos(exposures: [f32; 4]) -> Vec<TracedPhoto> {
    let places = [(-3.0, 0.3), (-1.5, 0.15), (1.5, -0.15), (3.0, -0.3)];
    (0..)
        .zip(places)
        .zip(exposures)
        .map(|((index, (x, turn)), exposure)| {
            TracedPhoto::new(index, &camera(DVec3::new(x, 0.2, 0.0), -turn), exposure)
        })
        .collect()
}

#[test]
fn no_texel_comes_through_the_box() {
    let photos = photos([1.0; 4]);
    let camera = camera(DVec3::new(0.3, 0.0, 0.0), 0.0);
    let wrong = |settings: LookSettings| rephotograph(&camera, &photos, &settings).wrong(240);
    let usual = LookSettings::default();
    for blend in 1..=3 {
        let soft = LookSettings { blend, ..usual };
        assert_eq!(wrong(soft), 0, "{blend}");
        // Hard visibility takes texels that lie half on the box in a photograph.
        let hard = LookSettings {
            visibility: PhotoVisibility::Depth,
            ..soft
        };
        assert!(wrong(hard) <= 20, "{blend}: {}", wrong(hard));
    }
    let without = LookSettings {
        visibility: PhotoVisibility::Off,
        consensus: false,
        blend: 1,
        ..usual
    };
    assert!(wrong(without) > 500, "{}", wrong(without));
    let mended = LookSettings {
        form: WeightForm::Mended,
        limit_cos: limit(),
        visibility: PhotoVisibility::DepthSoft,
        ..without
    };
    assert!(wrong(mended) <= 20, "{}", wrong(mended));
    let blind = LookSettings {
        visibility: PhotoVisibility::Off,
        ..mended
    };
    assert!(wrong(blind) > wrong(mended) + 20, "{}", wrong(blind));
}

#[test]
fn a_photographs_own_pose_gives_the_photograph() {
    // The others are darker and lighter, so that any part of theirs shows.
    let photos = photos([0.7, 0.8, 1.0, 1.25]);
    let own = camera(DVec3::new(1.5, 0.2, 0.0), 0.15);
    let found = rephotograph(&own, &photos, &LookSettings::default());
    let mut past = 0;
    for (pixel, texel) in found.pixels.iter().zip(&photos[2].pixels.levels[0].rgb) {
        assert!(pixel.weight > 0.0);
        let away = (0..3)
            .map(|c| (pixel.color[c] * 255.0 - f32::from(texel[c])).abs())
            .fold(0.0, f32::max);
        past += usize::from(away > 1.0);
    }
    assert_eq!(past, 0, "at borders and outlines too");
}

#[test]
fn what_lessens_a_weight_does_so_by_its_odds() {
    for weight in [1e-6, 0.01, 0.5, 0.9] {
        for part in [1e-3, 0.1, 1.0] {
            let found = lessened(weight, part);
            let odds = |w: f32| w / (1.0 - w);
            assert!(
                (odds(found) / (part * odds(weight)) - 1.0).abs() < 1e-4,
                "{weight} {part}: {found}"
            );
            assert!(found <= weight * (1.0 + 1e-6), "a bound stays one");
        }
    }
    // What weighs all does so wherever it is seen at all.
    assert_eq!(lessened(1.0, 1e-6), 1.0);
    assert_eq!([lessened(1.0, 0.0), lessened(0.0, 1.0)], [0.0; 2]);
}

#[test]
fn one_photograph_at_twice_the_exposure_changes_little() {
    let places: Vec<Vec3> = (0..2000)
        .map(|i| {
            let (x, y) = ((i % 50) as f32 / 10.0 - 2.5, (i / 50) as f32 / 10.0 - 2.0);
            Vec3::new(x, y, WALL as f32)
        })
        .collect();
    let psnr = |exposures: [f32; 4], gains: bool| {
        let mut photos = photos(exposures);
        let colors: Vec<Vec<Option<Vec3>>> = photos
            .iter()
            .map(|traced| {
                places
                    .iter()
                    .map(|p| {
                        let place = traced.photo.place(*p)?;
                        let ray =
                            (traced.photo.rotation * (*p - traced.photo.center)) / place.depth;
                        let query = DepthQuery {
                            ray: ray.truncate(),
                            depth: place.depth,
                            slope: 0.3,
                        };
                        let is_seen =
                            traced.depth.visibility(query, PhotoVisibility::DepthSoft) > 0.9;
                        is_seen.then(|| {
                            Vec3::from(
                                traced
                                    .pixels
                                    .sample((place.pixel / traced.photo.size).to_array(), 0.0),
                            )
                        })
                    })
                    .collect()
            })
            .collect();
        let found = exposure_gains(&colors);
        for (traced, gain) in photos.iter_mut().zip(&found) {
            // To the exposure of the first.
            traced.photo.gain = *gain / found[0];
        }
        let settings = LookSettings {
            gains,
            ..LookSettings::default()
        };
        rephotograph(&camera(DVec3::new(0.3, 0.0, 0.0), 0.0), &photos, &settings).psnr()
    };
    // One step of exposure is a factor of 2^(1/2.2) of encoded values.
    let bright = [1.0, 1.0, 2_f32.powf(1.0 / 2.2), 1.0];
    let (even, uneven, naive) = (
        psnr([1.0; 4], true),
        psnr(bright, true),
        psnr(bright, false),
    );
    println!("{even:.2} dB, one brighter {uneven:.2} dB, without gains {naive:.2} dB");
    assert!((even - uneven).abs() < 0.3, "{even} {uneven}");
    assert!(naive < even - 3.0, "{naive}");
}

#[test]
fn supplementary_photographs_fill_only_what_is_left() {
    // From the right the box hides what the left sees beside it.
    let mut photos = photos([1.0; 4]).split_off(1);
    photos.remove(1);
    let camera = camera(DVec3::new(-1.5, 0.2, 0.0), -0.15);
    photos[0].photo.stage = 1;
    let count = |photos: &[TracedPhoto], best: u32| {
        let found = rephotograph(&camera, photos, &LookSettings::default());
        found
            .pixels
            .iter()
            .filter(|pixel| pixel.best == best && pixel.weight > 0.0)
            .count()
    };
    let (filled, others) = (count(&photos, 0), count(&photos, 1));
    assert!(filled > 500 && others > 15_000, "{filled} {others}");
    // In the first stage it is the best nearly everywhere.
    photos[0].photo.stage = 0;
    assert!(count(&photos, 0) > 40_000, "{}", count(&photos, 0));
}

#[test]
fn a_camera_that_faces_away_and_a_mask_give_nothing() {
    let ahead = camera(DVec3::ZERO, 0.0);
    let away = TracedPhoto {
        photo: ProjectedPhoto::new(
            0,
            &camera(DVec3::ZERO, std::f64::consts::PI),
            DVec3::ZERO,
            10.0,
        ),
        ..TracedPhoto::new(0, &ahead, 1.0)
    };
    for form in [WeightForm::Printed, WeightForm::Mended, WeightForm::Quality] {
        let settings = LookSettings {
            form,
            visibility: PhotoVisibility::Off,
            ..LookSettings::default()
        };
        let found = rephotograph(&ahead, std::slice::from_ref(&away), &settings);
        assert!(
            found
                .pixels
                .iter()
                .all(|pixel| *pixel == LookPixel::default()),
            "{form:?}"
        );
    }
    let traced = TracedPhoto::new(0, &ahead, 1.0);
    let dark = PhotoPyramid::new(PhotoPixels::filled(240, 180, [0; 3]));
    let masked = LookPhoto {
        mask: Some(&dark),
        ..traced.look()
    };
    let pixel = SurfacePixel {
        position: Vec3::new(0.0, 0.0, 5.0),
        normal: -Vec3::Z,
        steps: [Vec3::X * 0.025, Vec3::Y * 0.025],
    };
    let view = LookView {
        eye: Vec3::ZERO,
        direction: Vec3::Z,
        parallel: None,
    };
    let settings = LookSettings::default();
    assert_eq!(
        look_at_pixel(&pixel, &view, &[masked], &settings).weight,
        0.0
    );
    assert!(look_at_pixel(&pixel, &view, &[traced.look()], &settings).weight > 0.0);
}

#[test]
fn colors_change_without_steps_along_the_way_of_a_camera() {
    // Four photographs that disagree in everything.
    let mut photos = photos([1.0; 4]);
    for (traced, rgb) in
        photos
            .iter_mut()
            .zip([[230, 20, 20], [20, 230, 20], [20, 20, 230], [230, 230, 20]])
    {
        traced.pixels = PhotoPyramid::new(PhotoPixels::filled(240, 180, rgb));
    }
    let looks: Vec<LookPhoto<'_>> = photos.iter().map(TracedPhoto::look).collect();
    let pixel = SurfacePixel {
        position: Vec3::new(0.0, 3.0, WALL as f32),
        normal: -Vec3::Z,
        steps: [Vec3::X * 0.05, Vec3::Y * 0.05],
    };
    let colors: Vec<LookPixel> = (0..=600)
        .map(|step| {
            let view = LookView {
                eye: Vec3::new(0.01 * step as f32 - 3.0, 0.2, 0.0),
                direction: Vec3::Z,
                parallel: None,
            };
            look_at_pixel(&pixel, &view, &looks, &LookSettings::default())
        })
        .collect();
    let chosen: std::collections::BTreeSet<u32> = colors.iter().map(|own| own.best).collect();
    assert_eq!(chosen.len(), 4, "all are the best somewhere");
    let largest = (colors.windows(2))
        .flat_map(|pair| (0..3).map(|c| (pair[0].color[c] - pair[1].color[c]).abs()))
        .fold(0.0, f32::max);
    // A weight falls from 1 to a half within 14 of these steps, so that the 0.82 between two colors take 7 at least.
    assert!(largest < 0.12, "{largest}");
}

#[test]
fn few_of_many_photographs_are_those_of_a_search_through_all() {
    // A hundred cameras, so that there are several blocks.
    let photos: Vec<TracedPhoto> = (0..100)
        .map(|index| {
            let x = (f64::from(index) * 0.618_034).fract() * 6.0 - 3.0;
            let own = CalibratedCamera {
                width: 24,
                height: 18,
                focal: [20.0; 2],
                principal: [12.0, 9.0],
                ..camera(DVec3::new(x, 0.2, 0.0), -0.1 * x)
            };
            TracedPhoto::new(index, &own, 1.0)
        })
        .collect();
    let looks: Vec<LookPhoto<'_>> = photos.iter().map(TracedPhoto::look).collect();
    let settings = LookSettings::default();
    for step in 0..40 {
        let pixel = SurfacePixel {
            position: Vec3::new(0.1 * step as f32 - 2.0, 1.6, WALL as f32),
            normal: Vec3::new(0.02 * step as f32, 0.0, -1.0).normalize(),
            steps: [Vec3::X * 0.5, Vec3::Y * 0.5],
        };
        let view = LookView {
            eye: Vec3::new(0.3, 0.1, 0.5),
            direction: Vec3::Z,
            parallel: None,
        };
        let mut all: Vec<(f32, u32)> = (0..)
            .zip(&looks)
            .map(|(index, of)| (photo_weight(&pixel, &view, of, &settings), index))
            .filter(|(weight, _)| *weight > 0.0)
            .collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let least = LEAST_SHARE * all.first().map_or(0.0, |own| own.0);
        all.retain(|own| own.0 >= least);
        all.truncate(CANDIDATES);
        let mut best = [PixelCandidate::default(); CANDIDATES];
        let count = best_of_stage(&pixel, &view, (&looks, 0), &settings, &mut best);
        let found: Vec<(f32, u32)> = best[..count]
            .iter()
            .map(|own| (own.weight, own.list_index))
            .filter(|own| own.0 >= LEAST_SHARE * best[0].weight)
            .collect();
        assert_eq!(found, all, "{step}");
        assert!(!all.is_empty());
    }
}
