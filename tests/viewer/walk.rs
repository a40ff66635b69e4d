//! The time of frames on a recorded walk. No clock decides here: what a frame takes is computed from what its cut
//! draws, with noise, and told two frames later, as on a window.

use std::collections::VecDeque;
use std::path::Path;
use surfel::cut::{Cut, CutSelector};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::math::camera::View;
use surfel::progress::SilentProgress;
use surfel::render::{LARGEST_COMPUTE_BLENDED_PX, LARGEST_COMPUTE_SQUARE_PX, Settings, cut_key};
use surfel::tree::{self, BuildOptions, Model, OrbitSphere};
use surfel::viewer::camera::OrbitCamera;
use surfel::viewer::control::{EyePlace, FrameBudget, FrameWork, TimeTaken};
use surfel::viewer::event::{KeyboardKey, ViewerEvent};
use surfel::viewer::input::{DragAction, MouseGesture, MouseState};
use surfel::viewer::pace::{PaceSummary, PacedFrame};
use surfel::viewer::record;

use glam::{DVec2, DVec3};

/// The cameras of the walk, one for each step that moves, as the window makes them: a drag, a flight, and back.
fn walk(model: &Model) -> Vec<OrbitCamera> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/walk.jsonl");
    let OrbitSphere { center, radius } = model.orbit_sphere();
    let home = (30f64.to_radians(), 20f64.to_radians(), 1.0);
    let mut orbit = OrbitCamera::new(center, radius, (640, 480), home);
    let (mut mouse, mut held, mut flies, mut last) = (MouseState::default(), None, false, None);
    let mut cameras = Vec::new();
    for entry in record::read(&path).unwrap() {
        let before = orbit.clone();
        match entry.event {
            ViewerEvent::Cursor(at) => {
                let at = DVec2::from_array(at);
                let gesture = mouse.moved(at);
                if flies {
                    if let Some(last) = last.replace(at) {
                        orbit.look_around(at - last);
                    }
                } else if let Some(MouseGesture::Move(DragAction::Turn, by)) = gesture {
                    orbit.turn(by);
                }
            }
            ViewerEvent::Button {
                button,
                pressed,
                modifiers,
            } => {
                mouse.button(button, pressed, modifiers, entry.time);
            }
            ViewerEvent::Key { key, pressed, .. } => match key {
                KeyboardKey::Char('g') => (flies, last) = (!flies, None),
                KeyboardKey::Char(c) => held = pressed.then_some(c),
                other => panic!("the walk has no use for {other:?}"),
            },
            ViewerEvent::Tick(seconds) => {
                let way = match held {
                    Some('w') => DVec3::NEG_Z,
                    Some('s') => DVec3::Z,
                    Some('a') => DVec3::NEG_X,
                    Some('d') => DVec3::X,
                    other => panic!("a tick with {other:?} held"),
                };
                orbit.fly(way * 0.5 * seconds);
            }
            _ => {}
        }
        if orbit != before {
            cameras.push(orbit.clone());
        }
    }
    cameras
}

/// Evenly spread numbers from 0 to 1 (Knuth's MMIX generator).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }

    /// Of mean 0 and deviation 1, nearly normal.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// Blended splats take time for each of their pixels, and both ways can draw them.
#[derive(Clone, Copy)]
struct Blended {
    /// A pixel of a splat, by the rasterizer and by compute, milliseconds.
    splat_pixel: [f64; 2],
    /// A pixel of the box around the model in the picture, milliseconds.
    picture_pixel: f64,
    /// A splat or triangle that is written, milliseconds.
    packed: f64,
    /// What counts do not tell (splats that nearer ones hide, sizes below the threshold) makes drawing longer and shorter
    /// by up to this part, slowly along the way.
    unseen: f64,
}

/// What a device takes: for a frame at all, and for each node visited, splat and triangle, milliseconds.
struct Device {
    frame: f64,
    visited: f64,
    splat: f64,
    triangle: f64,
    /// Splats of up to 6 pixels (16, if they are blended) are drawn by compute, and each takes this part of the time.
    by_compute: Option<f64>,
    blended: Option<Blended>,
    /// Passes are timed: it is known what takes how long.
    tells_parts: bool,
    /// Frames that are on their way when the next is planned.
    ahead: usize,
}

impl Device {
    fn largest_by_compute_px(&self) -> f32 {
        match self.blended {
            Some(_) => LARGEST_COMPUTE_BLENDED_PX,
            None => LARGEST_COMPUTE_SQUARE_PX,
        }
    }

    fn draws_by_compute(&self, threshold_px: f32) -> bool {
        self.by_compute.is_some() && threshold_px <= self.largest_by_compute_px()
    }

    /// What a frame takes; `at` is how far along the way it is.
    fn took(&self, work: &FrameWork, px: f32, at: f64) -> TimeTaken {
        let part = match self.by_compute {
            Some(part) if work.by_compute => part,
            _ => 1.0,
        };
        let mut took = TimeTaken {
            cut_ms: self.visited * (work.visited + work.counted) as f64,
            draw_ms: self.frame
                + part * self.splat * work.splats as f64
                + self.triangle * work.triangles as f64,
            ..TimeTaken::default()
        };
        if let Some(blended) = &self.blended {
            let pixels = work.splats as f64 * f64::from(px).powi(2);
            took.draw_ms += blended.splat_pixel[usize::from(work.by_compute)] * pixels;
            took.draw_ms *= 1.0 + blended.unseen * (12.0 * at).sin();
            took.picture_ms = blended.picture_pixel * work.pixels as f64;
            took.pack_ms = blended.packed * (work.splats + work.triangles) as f64;
        }
        took
    }
}

/// Nothing but what counts tell, of a device whose passes are not timed.
const PLAIN: Device = Device {
    frame: 0.0,
    visited: 0.0,
    splat: 0.0,
    triangle: 0.0,
    by_compute: None,
    blended: None,
    tells_parts: false,
    ahead: 2,
};

/// Blended splats as a software device draws them (in the order of twice as slow: the model is smaller than a scan).
const BLENDED: Device = Device {
    frame: 0.1,
    visited: 1e-5,
    splat: 1.2e-3,
    triangle: 1.5e-3,
    by_compute: Some(0.2),
    blended: Some(Blended {
        splat_pixel: [4e-6, 9e-6],
        picture_pixel: 2e-5,
        packed: 4e-5,
        unseen: 0.1,
    }),
    tells_parts: true,
    ahead: 0,
};

const TARGET: f64 = 33.0;

/// Pixels of the square around the model's ball in a picture.
fn pixels(model: &Model, orbit: &OrbitCamera, view: &View) -> u64 {
    let center = model.orbit_sphere().center;
    let distance = (orbit.eye() - center).length() as f32;
    let radius_px = view.focal_px() * model.orbit_radius / distance.max(1e-3);
    let side = |most: u32| (2.0 * radius_px).min(most as f32);
    (side(view.width) * side(view.height)) as u64
}

/// Eye and direction of a camera, as the window tells them.
fn place(model: &Model, orbit: &OrbitCamera) -> EyePlace {
    let center = model.orbit_sphere().center;
    let world = orbit.camera().view.inverse();
    let eye = (world.w_axis.truncate() - center) / f64::from(model.orbit_radius);
    let toward = -world.z_axis.truncate();
    [eye.x, eye.y, eye.z, toward.x, toward.y, toward.z]
}

/// The frames of a walk over `cameras`.
fn drive(
    model: &Model,
    cameras: &[OrbitCamera],
    device: &Device,
    control: &mut FrameBudget,
    noise: &mut Noise,
) -> Vec<PacedFrame> {
    let finest = 1.0;
    let mut selector = CutSelector::default();
    let mut cut = Cut::default();
    let mut under_way: VecDeque<(f32, FrameWork, TimeTaken)> = VecDeque::new();
    cameras
        .iter()
        .map(|orbit| {
            let view = orbit.camera().view(model.origin).unwrap();
            let place = place(model, orbit);
            let mut work = |threshold_px: f32| {
                let settings = Settings {
                    threshold_px,
                    ..Settings::default()
                };
                let with = cut_key::cut_settings(&settings, model);
                selector.select(model, &view, &with, &mut cut);
                let strips: u64 = cut.strips.iter().map(|s| u64::from(s.count)).sum();
                let by_compute = device.draws_by_compute(threshold_px);
                FrameWork {
                    visited: cut.stats.visited,
                    splats: (cut.nodes.len() + cut.leaves.len()) as u64 + strips,
                    triangles: cut.triangles.len() as u64,
                    pixels: pixels(model, orbit, &view),
                    is_blended: device.blended.is_some(),
                    is_free: by_compute,
                    largest_by_compute_px: device.largest_by_compute_px(),
                    by_compute,
                    place,
                    ..FrameWork::default()
                }
            };
            control.moved();
            let threshold_px = control.plan(place, &mut work);
            let mut drawn = FrameWork {
                counted: control.counted(),
                ..work(threshold_px)
            };
            if drawn.is_free {
                drawn.by_compute = control.by_compute();
            }
            // The same place looks the same, whichever way it is come to.
            let at = (orbit.eye() - model.origin).length() / f64::from(model.orbit_radius);
            // One frame in a hundred waits for something else.
            let hiccup = if noise.next() < 0.01 { 2.0 } else { 1.0 };
            let factor = hiccup * (1.0 + 0.03 * noise.normal());
            let exact = device.took(&drawn, threshold_px, at);
            let took = TimeTaken {
                cut_ms: factor * exact.cut_ms,
                pack_ms: factor * exact.pack_ms,
                picture_ms: factor * exact.picture_ms,
                draw_ms: factor * exact.draw_ms,
                ..exact
            };
            let told = match device.tells_parts {
                true => took,
                // The processor's clock is always there.
                false => TimeTaken {
                    picture_ms: 0.0,
                    draw_ms: took.picture_ms + took.draw_ms,
                    ..took
                },
            };
            under_way.push_back((threshold_px, drawn, told));
            if under_way.len() > device.ahead
                && let Some((px, drawn, took)) = under_way.pop_front()
            {
                control.frame(px, &drawn, took);
            }
            PacedFrame {
                ms: took.ms(),
                threshold_px,
                is_finest: threshold_px <= finest,
            }
        })
        .collect()
}

fn statue() -> Model {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 200_000).unwrap();
    let mesh = surfel::generate::mesh(&spec);
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

#[test]
fn on_a_recorded_walk_frames_keep_their_time_and_the_way_back_has_the_thresholds_of_the_way_there()
{
    let model = statue();
    let cameras = walk(&model);
    let half = cameras.len() / 2;
    // It ends about where it began, and has been elsewhere.
    let apart = |a: &OrbitCamera, b: &OrbitCamera| {
        (a.eye() - b.eye()).length() / f64::from(model.orbit_radius)
    };
    assert!(cameras.len() > 400 && apart(&cameras[cameras.len() - 1], &cameras[0]) < 0.1);
    assert!(apart(&cameras[half], &cameras[0]) > 1.0);
    // Splats that cost much, triangles that cost much, and a device that takes half of the time for nothing.
    for (name, device) in [
        (
            "splats",
            Device {
                frame: 1.0,
                visited: 2e-5,
                splat: 2e-3,
                triangle: 3e-3,
                ..PLAIN
            },
        ),
        (
            "triangles",
            Device {
                frame: 3.0,
                visited: 1e-5,
                splat: 5e-4,
                triangle: 3e-3,
                ..PLAIN
            },
        ),
        (
            "slow to begin",
            Device {
                frame: TARGET / 2.0,
                visited: 1e-5,
                splat: 1e-3,
                triangle: 1.5e-3,
                ..PLAIN
            },
        ),
        // The time jumps by half where compute ends, in the middle of the thresholds of this walk.
        (
            "two ways",
            Device {
                frame: 3.0,
                visited: 8e-6,
                splat: 4e-3,
                triangle: 4e-3,
                by_compute: Some(0.6),
                ..PLAIN
            },
        ),
        // Where compute ends the rasterizer takes longer until thresholds of twice that, in the middle of this walk.
        (
            "far apart",
            Device {
                frame: 0.5,
                visited: 8e-6,
                splat: 3.6e-3,
                triangle: 4e-3,
                by_compute: Some(0.25),
                tells_parts: true,
                ahead: 0,
                ..PLAIN
            },
        ),
        // Small splats by compute take little each and much for their pixels; near the model the rasterizer is faster.
        ("blended", BLENDED),
        (
            "blended, late",
            Device {
                ahead: 2,
                ..BLENDED
            },
        ),
        (
            "blended, in one",
            Device {
                tells_parts: false,
                ..BLENDED
            },
        ),
        (
            "blended, raster",
            Device {
                by_compute: None,
                ..BLENDED
            },
        ),
    ] {
        let mut control = FrameBudget::new(TARGET, 1.0);
        let mut noise = Noise(1);
        let frames = drive(&model, &cameras, &device, &mut control, &mut noise);
        let summary = PaceSummary::of(&frames, TARGET);
        println!("{name}: {summary}");
        assert!(
            summary.frames > 350 && summary.kept() >= 0.95,
            "{name}: {summary}"
        );
        // The walk asks for other thresholds on its way, or it would show nothing.
        let (least, most) = summary.thresholds_px;
        assert!(
            most > 1.25 * least && summary.finer == 0,
            "{name}: {summary}"
        );
        // The same way again and back, now that the device is known.
        let mut there: Vec<OrbitCamera> = cameras[..half].to_vec();
        drive(&model, &there, &device, &mut control, &mut noise);
        let forward = drive(&model, &there, &device, &mut control, &mut noise);
        there.reverse();
        let mut back = drive(&model, &there, &device, &mut control, &mut noise);
        back.reverse();
        let ratios = forward
            .iter()
            .zip(&back)
            .map(|(a, b)| (a.threshold_px / b.threshold_px).max(b.threshold_px / a.threshold_px));
        let apart = ratios.clone().filter(|ratio| *ratio >= 1.1).count();
        let most = ratios.fold(1.0f32, f32::max);
        println!("{name}: there and back {apart} frames are apart, by a factor of at most {most}");
        assert!(apart == 0, "{name}: {apart} frames, {most}");
        for frames in [&forward, &back] {
            let again = PaceSummary::of(frames, TARGET);
            assert!(again.kept() >= 0.95, "{name}, the way known: {again}");
        }
        // A camera that stays where it is, as under a hand that trembles: the threshold settles and stays within
        // what noise may move it, and it does not swing.
        let still = vec![cameras[half].clone(); 120];
        let rest = drive(&model, &still, &device, &mut control, &mut noise);
        let late = &rest[20..];
        let turns = late
            .windows(2)
            .filter(|w| w[0].threshold_px != w[1].threshold_px)
            .count();
        assert!(turns <= 4, "{name}: {turns} changes at rest");
        let bounds = PaceSummary::of(late, TARGET).thresholds_px;
        assert!(bounds.1 < 1.08 * bounds.0, "{name}: {bounds:?} at rest");
    }
}
