//! What a frame will take, part by part: what a node, a splat, a triangle and a pixel take, learned from frames that have
//! finished. Pure logic.
//!
//! The parts of a frame go with different numbers: the cut with the nodes that it looks at, packing with what is packed,
//! passes over the picture with its pixels, and passes that draw with splats, their pixels, and triangles. Each was
//! measured by itself, so each is foreseen by itself. Of all of a frame's time at once the parts cannot be told apart:
//! frames that are all held at one time look as if it came from nothing (tried: thresholds swung).
//!
//! What splats, their pixels and triangles take of the drawing passes is known beforehand only roughly. One factor for all
//! of it follows the last frames at once; how pixels and triangles compare with splats follows slowly, a step a frame
//! at most, in the direction in which the frames kept agree better.

use super::median;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Frames whose median says what a unit of work takes.
const RATES: usize = 7;
/// A frame whose threshold differs by this factor tells as little as one that is as old as the next.
const NEAR: f64 = 1.6;
/// Frames that are kept of each of the two ways.
const FRAMES: usize = 96;
/// So many frames later a frame tells little.
const RECENT: f64 = 40.0;
/// Frames from which on shares are learned.
const LEAST_FRAMES: usize = 10;
/// Factors by which a share may change from frame to frame.
const STEPS: [f64; 5] = [0.5, 0.87, 1.0, 1.15, 2.0];
/// Other shares must leave less than this part of what the frames disagree by.
const BETTER: f64 = 0.97;
/// What a frame disagrees by counts less and less above this: one that waited for something must not decide.
const FAR_OFF: f64 = 0.1;

/// What is drawn in a frame, in numbers that are known before it is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Work {
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
    /// They may be drawn in the other way as well.
    pub is_free: bool,
    /// Nodes that cuts looked at which were counted for this frame and not drawn.
    pub counted: u64,
}

/// What a frame took, milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Took {
    /// Choosing the cut, and those that were counted.
    pub cut_ms: f64,
    /// Writing draw lists and submitting.
    pub pack_ms: f64,
    /// Passes over all of the picture.
    pub picture_ms: f64,
    /// Passes that draw splats and triangles; what is not known to be anything else.
    pub draw_ms: f64,
    /// The device works while the host does: the longer of the two decides.
    pub overlaps: bool,
}

impl Took {
    /// All of it, milliseconds.
    pub fn ms(&self) -> f64 {
        let (host, device) = (self.cut_ms + self.pack_ms, self.picture_ms + self.draw_ms);
        if self.overlaps {
            host.max(device)
        } else {
            host + device
        }
    }

    fn is_time(&self) -> bool {
        let parts = [self.cut_ms, self.pack_ms, self.picture_ms, self.draw_ms];
        parts.iter().all(|ms| ms.is_finite() && *ms >= 0.0) && self.ms() > 0.0
    }
}

impl From<f64> for Took {
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
struct Shares {
    splat: f64,
    pixel: f64,
    triangle: f64,
}

impl Shares {
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

    /// Nanoseconds of all that is drawn with a threshold of `px`.
    fn ns(self, work: &Numbers, px: f64) -> f64 {
        let splat = self.splat + self.pixel * px * px;
        (work.splats * splat + self.triangle * work.triangles).max(1.0)
    }
}

/// The numbers of a [`Work`], or what they become with another threshold.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers {
    visited: f64,
    splats: f64,
    triangles: f64,
    pixels: f64,
}

impl Numbers {
    pub(super) fn of(work: &Work) -> Self {
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

    /// What is packed.
    pub(super) fn packed(&self) -> f64 {
        (self.splats + self.triangles).max(1.0)
    }
}

/// A frame that has finished.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    work: Work,
    px: f32,
    took: Took,
    number: u64,
}

impl Frame {
    fn draw_rate(&self, shares: Shares) -> f64 {
        self.took.draw_ms / shares.ns(&Numbers::of(&self.work), self.px.into())
    }
}

/// What is known of one way to draw small splats.
#[derive(Debug, Clone, PartialEq)]
struct Way {
    /// Its last frames, oldest first.
    frames: VecDeque<Frame>,
    /// There was more than one.
    is_known: bool,
    /// Factors of the usual shares of pixels and triangles.
    learned: [f64; 2],
}

impl Default for Way {
    fn default() -> Self {
        Self {
            frames: VecDeque::with_capacity(FRAMES),
            is_known: false,
            learned: [1.0; 2],
        }
    }
}

impl Way {
    fn shares(&self, is_blended: bool, by_compute: bool, learned: [f64; 2]) -> Shares {
        let usual = Shares::usual(is_blended, by_compute);
        Shares {
            pixel: learned[0] * usual.pixel,
            triangle: learned[1] * usual.triangle,
            ..usual
        }
    }

    /// One step, if the frames agree better there.
    fn learn(&mut self, by_compute: bool) {
        let Some(last) = self.frames.back() else {
            return;
        };
        if self.frames.len() < LEAST_FRAMES {
            return;
        }
        let is_blended = last.work.is_blended;
        // Mean square of the distance of logarithms from their mean.
        let disagreement = |learned: [f64; 2]| {
            let shares = self.shares(is_blended, by_compute, learned);
            let rates = self.frames.iter().map(|f| f.draw_rate(shares));
            let logs: Vec<f64> = rates.filter(|r| *r > 0.0).map(f64::ln).collect();
            let middle = median(logs.clone());
            let off = |r: &f64| ((r - middle) / FAR_OFF).powi(2).ln_1p() * FAR_OFF.powi(2);
            let sum: f64 = logs.iter().map(off).sum();
            sum
        };
        let (mut best, mut least) = (self.learned, BETTER * disagreement(self.learned));
        for (of_pixel, of_triangle) in STEPS.iter().flat_map(|a| STEPS.map(|b| (a, b))) {
            let learned = [
                (self.learned[0] * of_pixel).clamp(1e-2, 1e2),
                (self.learned[1] * of_triangle).clamp(1e-2, 1e2),
            ];
            let value = disagreement(learned);
            if value < least {
                (best, least) = (learned, value);
            }
        }
        self.learned = best;
    }
}

/// What the parts of frames are foreseen by, of frames of about one threshold that are drawn in one way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rates {
    cut: f64,
    pack: f64,
    picture: f64,
    draw: f64,
    shares: Shares,
    overlaps: bool,
}

impl Rates {
    /// Milliseconds of a frame.
    pub(super) fn ms(&self, work: &Numbers, px: f32) -> f64 {
        Took {
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
pub(super) struct Model {
    /// By the rasterizer, and by compute.
    ways: [Way; 2],
    /// Frames so far.
    pub(super) count: u64,
}

impl Model {
    /// Factors of the usual shares of pixels and triangles, by the rasterizer and by compute.
    pub(super) fn learned(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|way: usize| self.ways[way].learned)
    }

    /// A frame has finished. Returns whether its time can be.
    pub(super) fn learn(&mut self, px: f32, work: &Work, took: Took) -> bool {
        if !(took.is_time() && px > 0.0) {
            return false;
        }
        self.count += 1;
        let way = &mut self.ways[usize::from(work.by_compute)];
        // The first frame of a way makes what is made once, and waits for it: it counts only until there is another.
        if way.frames.len() == FRAMES || way.frames.len() == 1 && !way.is_known {
            way.is_known = true;
            way.frames.pop_front();
        }
        way.frames.push_back(Frame {
            work: *work,
            px,
            took,
            number: self.count,
        });
        way.learn(work.by_compute);
        true
    }

    /// The frames of a way that tell most of one with a threshold of about `px`: of late, and with about that threshold.
    fn frames(&self, px: f32, by_compute: bool) -> Vec<&Frame> {
        let distance = |f: &Frame| {
            let age = (self.count - f.number) as f64 / RECENT;
            f64::from(f.px / px).ln().abs() / NEAR.ln() + age
        };
        let frames = &self.ways[usize::from(by_compute)].frames;
        let mut found: Vec<&Frame> = frames.iter().rev().collect();
        found.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        found.truncate(RATES);
        found
    }

    /// Whether the last frame was drawn by compute; none before the first.
    fn last_by_compute(&self) -> Option<bool> {
        let number = |way: &Way| way.frames.back().map_or(0, |f| f.number);
        let [raster, compute] = &self.ways;
        let is_any = !(raster.frames.is_empty() && compute.frames.is_empty());
        is_any.then(|| number(compute) > number(raster))
    }

    /// What frames like `work` take that are drawn in one way with about `px`. None before the first frame.
    ///
    /// Of the way of the last frame that is what the last frames say. Of the other one it is what all its frames say, as
    /// much more or less as the present way's last ones take than all of its: a device that is slow for a while is slow in
    /// both. What was never drawn in the other way is taken to be different as usual.
    pub(super) fn rates(&self, px: f32, work: &Work, by_compute: bool) -> Option<Rates> {
        let present = self.last_by_compute()?;
        let shares = |by_compute: bool| {
            let way = &self.ways[usize::from(by_compute)];
            way.shares(work.is_blended, by_compute, way.learned)
        };
        let of_draw = |frames: &[&Frame], by_compute: bool| {
            let shares = shares(by_compute);
            median_of(frames, |f| f.draw_rate(shares))
        };
        let of_picture = |f: &Frame| f.took.picture_ms / f.work.pixels.max(1) as f64;
        let frames = self.frames(px, present);
        let mut draw = of_draw(&frames, present);
        let mut picture = median_of(&frames, of_picture);
        let other = &self.ways[usize::from(by_compute)];
        if by_compute != present && !other.is_known {
            // What was learned of this way's shares says nothing of how the ways compare.
            let usual = Shares::usual(work.is_blended, present);
            draw = median_of(&frames, |f| f.draw_rate(usual));
        } else if by_compute != present {
            let all = |by_compute: bool| -> Vec<&Frame> {
                self.ways[usize::from(by_compute)].frames.iter().collect()
            };
            let slower = draw / of_draw(&all(present), present).max(1e-12);
            draw = slower * of_draw(&all(by_compute), by_compute);
            picture = slower * median_of(&all(by_compute), of_picture);
        }
        // The host's work is the same in both ways.
        let mut last: Vec<&Frame> = self.ways.iter().flat_map(|way| &way.frames).collect();
        last.sort_by_key(|f| std::cmp::Reverse(f.number));
        last.truncate(RATES);
        let looked = |f: &Frame| (f.work.visited + f.work.counted).max(1) as f64;
        Some(Rates {
            cut: median_of(&last, |f| f.took.cut_ms / looked(f)),
            pack: median_of(&last, |f| f.took.pack_ms / Numbers::of(&f.work).packed()),
            picture,
            draw,
            shares: shares(by_compute),
            overlaps: last.first()?.took.overlaps,
        })
    }
}

fn median_of(frames: &[&Frame], of: impl Fn(&Frame) -> f64) -> f64 {
    median(frames.iter().map(|f| of(f)).collect())
}
