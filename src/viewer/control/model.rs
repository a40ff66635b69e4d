//! What a frame will take, part by part: what a node, a splat, a triangle and a pixel take, learned from frames that have
//! finished. Pure logic.
//!
//! The parts of a frame go with different numbers: the cut with the nodes that it looks at, packing with what is packed,
//! passes over the picture with its pixels, and passes that draw with splats, their pixels, and triangles. Each was
//! measured by itself, so each is foreseen by itself. Of all of a frame's time at once the parts cannot be told apart:
//! frames that are all held at one time look as if it came from nothing (tried: thresholds swung).
//!
//! What splats, their pixels and triangles take of the drawing passes is known beforehand only roughly. One factor for all
//! of it is that of the frames kept that are most like the coming one: seen from about there, of about as much, drawn in the
//! same way. What counts do not tell (splats that nearer ones hide, passes that only some frames have) is in it so. How
//! pixels and triangles compare with splats follows slowly, a step a frame at most, in the direction in which the frames
//! kept agree better; it matters where none is like the coming one.

use super::median;
use crate::render::cost::model::{PerRasterizer, SIZES_PX, SplatCosts};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::VecDeque;

/// Frames whose median says what a unit of work takes: a quarter of those that are kept, at most and at least so many.
const RATES: usize = 31;
const LEAST: usize = 5;
/// Frames that are kept of each of the two ways.
const FRAMES: usize = 768;
/// Frames differ by 1 where their thresholds, what they pack, and the pixels of their boxes differ by these (logarithms),
/// triangles are so much more of what they pack, and they are seen from places so far apart; or so many frames later.
const NEAR_PX: f64 = 0.15;
const NEAR_PACKED: f64 = 0.2;
const NEAR_PIXELS: f64 = 0.3;
const NEAR_SHARE: f64 = 0.15;
const NEAR_PLACE: f64 = 0.1;
const RECENT: f64 = 400.0;
/// How much farther than the nearest ones frames count.
const FARTHER: f64 = 1.0;
/// So far apart are a frame that the processor drew and one that the device did. Filtered splats are the processor's up to
/// some threshold, and the device's above it.
const OTHER_BACKEND: f64 = 4.0;
/// Two frames that differ by less from one say what it takes.
const KNOWN: f64 = 2.0;
/// Frames at most from which shares are learned, evenly of those kept.
const LEARNED: usize = 96;
/// Frames from which on they are.
const LEAST_FRAMES: usize = 10;
/// Factors by which a share may change from frame to frame.
const STEPS: [f64; 5] = [0.5, 0.87, 1.0, 1.15, 2.0];
/// Other shares must leave less by this part of what the frames disagree by, for a factor of e.
const BETTER: f64 = 0.2;
/// What shares that differ from the usual ones by a factor of e count as, of the mean square of what frames disagree by.
const UNUSUAL: f64 = 3e-5;
/// What a frame disagrees by counts less and less above this: one that waited for something must not decide.
const FAR_OFF: f64 = 0.1;

/// Reads a number; none is infinity, which JSON has no word for.
fn or_infinity<'de, D: Deserializer<'de>>(from: D) -> Result<f32, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f32::INFINITY))
}

/// What is drawn in a frame, in numbers that are known before it is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameWork {
    /// Nodes that the cut looked at.
    pub visited: u64,
    /// Splats.
    pub splats: u64,
    /// Triangles.
    pub triangles: u64,
    /// Pixels of the box around the model in the picture.
    pub pixels: u64,
    /// Splats are blended.
    pub is_blended: bool,
    /// Small ones are drawn by compute: a unit takes another time then.
    pub by_compute: bool,
    /// Small splats may be drawn in the other way as well.
    pub is_free: bool,
    /// The largest threshold with which compute draws such splats, pixels.
    #[serde(deserialize_with = "or_infinity")]
    pub largest_by_compute_px: f32,
    /// Nodes that cuts looked at which were counted for this frame and not drawn.
    pub counted: u64,
    /// Where it is seen from.
    pub place: EyePlace,
}

/// Where the eye is, in radii of the model, and which way it looks, of length 1.
pub type EyePlace = [f64; 6];

/// How far apart two places are, radii of the model or radians.
pub(super) fn apart(a: &EyePlace, b: &EyePlace) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// What a frame took, milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TimeTaken {
    /// Choosing the cut, and those that were counted.
    pub cut_ms: f64,
    /// Writing draw lists and submitting.
    pub pack_ms: f64,
    /// Passes over all of the picture.
    pub picture_ms: f64,
    /// Passes that draw splats and triangles; what is not known to be anything else.
    pub draw_ms: f64,
    /// The device works while the processor does: the longer of the two decides.
    pub overlaps: bool,
}

impl TimeTaken {
    /// All of it, milliseconds.
    pub fn ms(&self) -> f64 {
        let (processor, device) = (self.cut_ms + self.pack_ms, self.picture_ms + self.draw_ms);
        if self.overlaps {
            processor.max(device)
        } else {
            processor + device
        }
    }

    fn is_time(&self) -> bool {
        let parts = [self.cut_ms, self.pack_ms, self.picture_ms, self.draw_ms];
        parts.iter().all(|ms| ms.is_finite() && *ms >= 0.0) && self.ms() > 0.0
    }
}

impl From<f64> for TimeTaken {
    /// So many milliseconds, of which nothing else is known.
    fn from(ms: f64) -> Self {
        Self {
            draw_ms: ms,
            ..Self::default()
        }
    }
}

/// What a splat, a pixel of a splat as large as the threshold, and a triangle take of the passes that draw, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
struct UnitShares {
    splat: f64,
    pixel: f64,
    triangle: f64,
}

impl UnitShares {
    /// The usual ones: what a software device takes. Only how they compare matters on others.
    fn usual(is_blended: bool, by_compute: bool) -> Self {
        let (splat, pixel, triangle) = match (is_blended, by_compute) {
            (false, false) => (140.0, 0.7, 200.0),
            (false, true) => (12.0, 0.7, 30.0),
            (true, false) => (560.0, 2.7, 450.0),
            (true, true) => (105.0, 5.7, 100.0),
        };
        Self {
            splat,
            pixel,
            triangle,
        }
    }

    /// As the usual ones, with splats as they were measured on the device.
    fn measured(self, costs: &SplatCosts) -> Self {
        let largest = SIZES_PX.len() - 1;
        let areas = f64::from(SIZES_PX[largest]).powi(2) - f64::from(SIZES_PX[0]).powi(2);
        let ns = costs.splat_ns[largest] - costs.splat_ns[0];
        let pixel = (ns / areas).max(0.0);
        let splat = costs.splat_ns[0] - pixel * f64::from(SIZES_PX[0]).powi(2);
        Self {
            splat: splat.max(1.0),
            pixel,
            ..self
        }
    }

    /// Nanoseconds of all that is drawn with a threshold of `px`.
    fn ns(self, work: &WorkNumbers, px: f64) -> f64 {
        let splat = self.splat + self.pixel * px * px;
        (work.splats * splat + self.triangle * work.triangles).max(1.0)
    }
}

/// The numbers of a [`FrameWork`], or what they become with another threshold.
#[derive(Debug, Clone, Copy)]
pub(super) struct WorkNumbers {
    visited: f64,
    splats: f64,
    triangles: f64,
    pixels: f64,
}

impl WorkNumbers {
    pub(super) fn of(work: &FrameWork) -> Self {
        Self {
            visited: work.visited as f64,
            splats: work.splats as f64,
            triangles: work.triangles as f64,
            pixels: work.pixels.max(1) as f64,
        }
    }

    /// With so many times as many nodes.
    pub(super) fn times(self, factor: f64) -> Self {
        Self {
            visited: factor * self.visited,
            splats: factor * self.splats,
            triangles: factor * self.triangles,
            ..self
        }
    }

    fn triangle_share(&self) -> f64 {
        self.triangles / self.packed()
    }

    /// What is packed.
    pub(super) fn packed(&self) -> f64 {
        (self.splats + self.triangles).max(1.0)
    }
}

/// A frame that has finished.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TimedFrame {
    work: FrameWork,
    px: f32,
    took: TimeTaken,
    number: u64,
}

impl TimedFrame {
    /// Tells whether the processor drew its splats, while it packed them.
    fn is_of_processor(&self) -> bool {
        self.took.draw_ms == 0.0 && self.work.splats > 0
    }

    fn draw_rate(&self, shares: UnitShares) -> f64 {
        self.took.draw_ms / shares.ns(&WorkNumbers::of(&self.work), self.px.into())
    }
}

/// What is known of one way to draw small splats.
#[derive(Debug, Clone, PartialEq)]
struct KnownWay {
    /// Last frames of the way, oldest first.
    frames: VecDeque<TimedFrame>,
    /// There was more than one.
    is_known: bool,
    /// Factors of the usual shares of pixels and triangles.
    learned: [f64; 2],
}

impl Default for KnownWay {
    fn default() -> Self {
        Self {
            frames: VecDeque::with_capacity(FRAMES),
            is_known: false,
            learned: [1.0; 2],
        }
    }
}

impl KnownWay {
    fn shares(usual: UnitShares, learned: [f64; 2]) -> UnitShares {
        UnitShares {
            pixel: learned[0] * usual.pixel,
            triangle: learned[1] * usual.triangle,
            ..usual
        }
    }

    /// One step, if the frames agree better there.
    fn learn(&mut self, usual: UnitShares) {
        if self.frames.len() < LEAST_FRAMES {
            return;
        }
        // Mean square of the distance of logarithms from their mean.
        let stride = self.frames.len().div_ceil(LEARNED);
        let disagreement = |learned: [f64; 2]| {
            let shares = Self::shares(usual, learned);
            let frames = self.frames.iter().rev().step_by(stride);
            let rates = frames.map(|f| f.draw_rate(shares));
            let logs: Vec<f64> = rates.filter(|r| *r > 0.0).map(f64::ln).collect();
            let middle = median(logs.clone());
            let off = |r: &f64| ((r - middle) / FAR_OFF).powi(2).ln_1p() * FAR_OFF.powi(2);
            let sum: f64 = logs.iter().map(off).sum();
            // What frames hardly tell stays as usual.
            let unusual: f64 = learned.iter().map(|l| l.ln().powi(2)).sum();
            sum / logs.len().max(1) as f64 + UNUSUAL * unusual
        };
        let now = disagreement(self.learned);
        let (mut best, mut least) = (self.learned, 1.0);
        for (of_pixel, of_triangle) in STEPS.iter().flat_map(|a| STEPS.map(|b| (a, b))) {
            let learned = [
                (self.learned[0] * of_pixel).clamp(1e-2, 1e2),
                (self.learned[1] * of_triangle).clamp(1e-2, 1e2),
            ];
            // The larger the step, the better it must be.
            let step: f64 = of_pixel.ln().abs() + of_triangle.ln().abs();
            let value = disagreement(learned) / now.max(1e-12) + BETTER * step;
            if value < least {
                (best, least) = (learned, value);
            }
        }
        self.learned = best;
    }
}

/// What the parts of frames are foreseen by, of frames of about one threshold that are drawn in one way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WorkRates {
    cut: f64,
    pack: f64,
    picture: f64,
    draw: f64,
    shares: UnitShares,
    /// Frames nearly like this one were drawn.
    pub(super) is_known: bool,
    overlaps: bool,
}

impl WorkRates {
    /// Milliseconds of a frame.
    pub(super) fn ms(&self, work: &WorkNumbers, px: f32) -> f64 {
        TimeTaken {
            cut_ms: self.cut * work.visited,
            pack_ms: self.pack * work.packed(),
            picture_ms: self.picture * work.pixels,
            draw_ms: self.draw * self.shares.ns(work, px.into()),
            overlaps: self.overlaps,
        }
        .ms()
    }

    /// Milliseconds of cuts that look at so many nodes, as far as they make the frame longer.
    pub(super) fn cut_ms(&self, visited: u64) -> f64 {
        if self.overlaps {
            0.0
        } else {
            self.cut * visited as f64
        }
    }
}

/// All that is known of what frames take.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct TimeModel {
    /// By the rasterizer, and by compute.
    ways: [KnownWay; 2],
    /// What splats were measured to take.
    costs: Option<PerRasterizer<SplatCosts>>,
    /// Frames so far.
    pub(super) count: u64,
}

impl TimeModel {
    /// Factors of the usual shares of pixels and triangles, by the rasterizer and by compute.
    pub(super) fn learned(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|way: usize| self.ways[way].learned)
    }

    /// Forgets all frames.
    pub(super) fn forget(&mut self) {
        *self = Self {
            costs: self.costs,
            ..Self::default()
        };
    }

    /// What splats were measured to take on the device.
    pub(super) fn know(&mut self, costs: Option<PerRasterizer<SplatCosts>>) {
        self.costs = costs;
    }

    fn usual(&self, is_blended: bool, by_compute: bool) -> UnitShares {
        let usual = UnitShares::usual(is_blended, by_compute);
        let costs = self.costs.as_ref();
        let measured = costs.and_then(|ways| match by_compute {
            true => ways.compute.as_ref(),
            false => ways.raster.as_ref(),
        });
        measured.map_or(usual, |costs| usual.measured(costs))
    }

    /// A frame has finished. Returns whether its time can be.
    pub(super) fn learn(&mut self, px: f32, work: &FrameWork, took: TimeTaken) -> bool {
        if !(took.is_time() && px > 0.0) {
            return false;
        }
        self.count += 1;
        let usual = self.usual(work.is_blended, work.by_compute);
        let way = &mut self.ways[usize::from(work.by_compute)];
        // The first frame of a way makes what is made once, and waits for it: it counts only until there is another.
        if way.frames.len() == FRAMES || way.frames.len() == 1 && !way.is_known {
            way.is_known = true;
            way.frames.pop_front();
        }
        way.frames.push_back(TimedFrame {
            work: *work,
            px,
            took,
            number: self.count,
        });
        way.learn(usual);
        true
    }

    /// The frames of a way that tell most of one like `work`: those that drew about the same from about there, and of late.
    /// And whether some are so near that it is known what it takes.
    fn frames(&self, px: f32, work: &FrameWork, by_compute: bool) -> (Vec<&TimedFrame>, bool) {
        let wanted = WorkNumbers::of(work);
        let far = |a: f64, b: f64, near: f64| ((a / b).ln() / near).powi(2);
        let frames = &self.ways[usize::from(by_compute)].frames;
        // Of the backend that drew at about this threshold.
        let off = |f: &&TimedFrame| (f.px / px).ln().abs();
        let nearest = frames.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        let is_of_processor = nearest.is_some_and(TimedFrame::is_of_processor);
        let distance = |f: &TimedFrame| {
            let drew = WorkNumbers::of(&f.work);
            let triangles = (wanted.triangle_share() - drew.triangle_share()) / NEAR_SHARE;
            let place = apart(&work.place, &f.work.place) / NEAR_PLACE;
            let squares = far(px.into(), f.px.into(), NEAR_PX)
                + far(wanted.packed(), drew.packed(), NEAR_PACKED)
                + far(wanted.pixels, drew.pixels, NEAR_PIXELS)
                + triangles.powi(2)
                + place.powi(2);
            let other_backend = match f.is_of_processor() == is_of_processor {
                true => 0.0,
                false => OTHER_BACKEND,
            };
            squares.sqrt() + other_backend + (self.count - f.number) as f64 / RECENT
        };
        let mut found: Vec<(f64, &TimedFrame)> = frames.iter().map(|f| (distance(f), f)).collect();
        let most = (found.len() / 4).clamp(LEAST, RATES).min(found.len());
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(most);
        // What is much less like it than the nearest ones says nothing beside them.
        if let Some(limit) = found.get(LEAST - 1).map(|(d, _)| d + FARTHER) {
            found.retain(|(d, _)| *d <= limit);
        }
        let is_known = found.iter().filter(|(d, _)| *d < KNOWN).count() > 1;
        (found.into_iter().map(|(_, f)| f).collect(), is_known)
    }

    /// Tells whether the last frame was drawn by compute; none before the first.
    fn last_by_compute(&self) -> Option<bool> {
        let number = |way: &KnownWay| way.frames.back().map_or(0, |f| f.number);
        let [raster, compute] = &self.ways;
        let is_any = !(raster.frames.is_empty() && compute.frames.is_empty());
        is_any.then(|| number(compute) > number(raster))
    }

    /// What frames like `work` take that are drawn in one way with about `px`. None before the first frame.
    ///
    /// Of the way of the last frame that is what the last frames say. Of the other one it is what all its frames say, as
    /// much more or less as the present way's last ones take than all of its: a device that is slow for a while is slow in
    /// both. What was never drawn in the other way is taken to be different as usual.
    pub(super) fn rates(&self, px: f32, work: &FrameWork, by_compute: bool) -> Option<WorkRates> {
        let present = self.last_by_compute()?;
        let shares = |by_compute: bool| {
            let way = &self.ways[usize::from(by_compute)];
            KnownWay::shares(self.usual(work.is_blended, by_compute), way.learned)
        };
        let of_draw = |frames: &[&TimedFrame], by_compute: bool| {
            let shares = shares(by_compute);
            median_of(frames, |f| f.draw_rate(shares))
        };
        let of_picture = |f: &TimedFrame| f.took.picture_ms / f.work.pixels.max(1) as f64;
        let other = &self.ways[usize::from(by_compute)];
        let of_way = by_compute == present || other.is_known;
        let (frames, is_known) = self.frames(px, work, if of_way { by_compute } else { present });
        let picture = median_of(&frames, of_picture);
        let draw = if of_way {
            of_draw(&frames, by_compute)
        } else {
            // What was learned of this way's shares says nothing of how the ways compare.
            let usual = self.usual(work.is_blended, present);
            median_of(&frames, |f| f.draw_rate(usual))
        };
        let looked = |f: &TimedFrame| (f.work.visited + f.work.counted).max(1) as f64;
        Some(WorkRates {
            cut: median_of(&frames, |f| f.took.cut_ms / looked(f)),
            pack: median_of(&frames, |f| {
                f.took.pack_ms / WorkNumbers::of(&f.work).packed()
            }),
            picture,
            draw,
            shares: shares(by_compute),
            is_known,
            overlaps: frames.first()?.took.overlaps,
        })
    }
}

fn median_of(frames: &[&TimedFrame], of: impl Fn(&TimedFrame) -> f64) -> f64 {
    median(frames.iter().map(|f| of(f)).collect())
}
