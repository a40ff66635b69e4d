//! How steady a picture is while time passes: flicker and popping, against what the reference does.
//!
//! With P and R the values (0..=1) of picture and reference, the *excess* of a pixel from one frame to the next is
//!
//! ```text
//! e = (P' - P) - (R' - R) = (P' - R') - (P - R)
//! ```
//!
//! for each of red, green and blue: what changes in the picture and not in the scene. An error that stays where it is
//! does not flicker. Pixels that count are object pixels, covered at all in one of the four pictures.
//!
//! A *pop* is a tile of [`TILE`] x [`TILE`] pixels (on a grid from the top left, smaller at the right and lower border)
//! in which the root of the mean of e² over its pixels and channels is above [`TemporalRules::pop_level`]: a patch of the
//! picture that jumps, not a lone pixel. What appears and stays pops once, what flashes up pops twice. The rate in
//! seconds is that of [`TemporalRules::frames_per_second`]: a path in half as large steps at twice the rate is the same motion.

use super::PictureTile;
use crate::image::{Error, FloatImage, Image, PixelSource, contact_sheet, unorm8};
use std::sync::Arc;

/// Side of the tiles that can pop, pixels: 7 minutes of arc on a screen of 67 pixels a degree, half a period of the four
/// or so in a degree that the eye sees best.
pub const TILE: u32 = 8;

/// What counts as a pop.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct TemporalRules {
    /// A tile pops above this, levels of 255.
    pub pop_level: f64,
    /// Frames shown a second.
    pub frames_per_second: f64,
}

impl Default for TemporalRules {
    /// 16 levels (a sixteenth of black to white) and 60 frames a second.
    fn default() -> Self {
        Self {
            pop_level: 16.0,
            frames_per_second: 60.0,
        }
    }
}

/// One frame and the one before it. Levels are of 255.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct TemporalStep {
    /// Index of the later frame.
    pub frame: usize,
    /// Pixels that count.
    pub object_pixels: u64,
    /// Mean of |e| over these pixels and three channels.
    pub mean_level: f64,
    /// Largest |e| of a channel.
    pub max_level: f64,
    /// Column and row of the first pixel that has it.
    pub max_at: [u32; 2],
    /// Mean change of the reference over the same pixels.
    pub reference_level: f64,
    /// Tiles that pop.
    pub pops: u64,
    /// The tile with the largest root of the mean of e², values of 0..=1; the first of equals.
    pub worst_tile: PictureTile,
    /// How much of the cut is not in both frames, see [`churn`]; `None` where there is no cut.
    pub churn: Option<f64>,
}

/// All steps of a sequence taken together. Levels are of 255.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct SequenceFigures {
    /// Pairs of frames.
    pub steps: usize,
    /// Flicker: mean of |e| over object pixels of all steps and three channels.
    pub mean_level: f64,
    /// 99th percentile over object pixels of all steps, of the channel that changes most; in sixteenths of a level,
    /// rounded up.
    pub p99_level: f64,
    /// Largest |e| of all.
    pub max_level: f64,
    /// Mean change of the reference over the same pixels.
    pub reference_level: f64,
    /// Tiles that pop, a second.
    pub pops_per_second: f64,
    /// Tiles that pop in the step that has most.
    pub most_pops: u64,
    /// Mean over the steps of what the cut changes; `None` where there is no cut.
    pub mean_churn: Option<f64>,
    /// Most of what the cut changes in a step.
    pub max_churn: Option<f64>,
    /// Later frame of the step with the largest mean.
    pub worst_frame: usize,
}

/// Reference and picture of one frame.
type ShownDifference = [Arc<FloatImage>; 2];

/// The step with the largest mean flicker, to look at.
#[derive(Debug, Clone)]
struct WorstStep {
    step: TemporalStep,
    before: ShownDifference,
    after: ShownDifference,
}

/// Bins of a level in the histogram of [`SequenceFigures::p99_level`].
const BINS: f64 = 16.0;

/// Frames of one way to draw, as they come. Keeps the last frame and the worst step, not all of them.
#[derive(Debug, Clone)]
pub struct PictureSequence {
    rules: TemporalRules,
    frames: usize,
    last: Option<ShownDifference>,
    steps: Vec<TemporalStep>,
    /// Object pixels by |e| of the channel that changes most, which is at most 2 x 255 levels.
    histogram: Vec<u64>,
    worst: Option<WorstStep>,
}

impl PictureSequence {
    /// A sequence without frames.
    pub fn new(rules: TemporalRules) -> Self {
        Self {
            rules,
            frames: 0,
            last: None,
            steps: Vec::new(),
            histogram: vec![0; (2.0 * 255.0 * BINS) as usize + 1],
            worst: None,
        }
    }

    /// Adds the next frame. `churn` is that of the cut since the frame before.
    ///
    /// # Errors
    /// [`Error::Size`] when a picture has another size than the reference or the frame before; the sequence stays as
    /// it was.
    pub fn push(
        &mut self,
        reference: Arc<FloatImage>,
        picture: Arc<FloatImage>,
        churn: Option<f64>,
    ) -> Result<(), Error> {
        let first = self.last.as_ref().map_or(&reference, |[r, _]| r).size();
        for second in [reference.size(), picture.size()] {
            if first != second {
                return Err(Error::Size { first, second });
            }
        }
        let shown = [reference, picture];
        if let Some(before) = self.last.take() {
            let mut step = compare(&before, &shown, &self.rules, &mut self.histogram);
            step.frame = self.frames;
            step.churn = churn;
            let is_worst = |worst: &WorstStep| step.mean_level > worst.step.mean_level;
            if self.worst.as_ref().is_none_or(is_worst) {
                self.worst = Some(WorstStep {
                    step: step.clone(),
                    before,
                    after: shown.clone(),
                });
            }
            self.steps.push(step);
        }
        self.last = Some(shown);
        self.frames += 1;
        Ok(())
    }

    /// The steps so far, in order.
    pub fn steps(&self) -> &[TemporalStep] {
        &self.steps
    }

    /// All steps so far taken together; zeros for none.
    pub fn figures(&self) -> SequenceFigures {
        let steps = &self.steps;
        let pixels: u64 = steps.iter().map(|s| s.object_pixels).sum();
        let mean = |of: fn(&TemporalStep) -> f64| {
            let sum: f64 = steps.iter().map(|s| of(s) * s.object_pixels as f64).sum();
            sum / pixels.max(1) as f64
        };
        let pops: u64 = steps.iter().map(|s| s.pops).sum();
        let churn: Vec<f64> = steps.iter().filter_map(|s| s.churn).collect();
        let has_churn = !churn.is_empty();
        SequenceFigures {
            steps: steps.len(),
            mean_level: mean(|s| s.mean_level),
            p99_level: self.percentile(0.99),
            max_level: steps.iter().map(|s| s.max_level).fold(0.0, f64::max),
            reference_level: mean(|s| s.reference_level),
            pops_per_second: pops as f64 * self.rules.frames_per_second / steps.len().max(1) as f64,
            most_pops: steps.iter().map(|s| s.pops).max().unwrap_or(0),
            mean_churn: has_churn.then(|| churn.iter().sum::<f64>() / churn.len() as f64),
            max_churn: has_churn.then(|| churn.iter().copied().fold(0.0, f64::max)),
            worst_frame: self.worst.as_ref().map_or(0, |w| w.step.frame),
        }
    }

    /// The level that a share of the object pixels does not pass.
    fn percentile(&self, share: f64) -> f64 {
        let all: u64 = self.histogram.iter().sum();
        let rank = (share * all as f64).ceil().max(1.0) as u64;
        let mut below = 0;
        for (bin, count) in self.histogram.iter().enumerate() {
            below += count;
            if below >= rank {
                return bin as f64 / BINS;
            }
        }
        0.0
    }

    /// The step that flickers most: both pictures and both references, what changes in each beside the other's (the
    /// excess) and in the reference (`gain` times, against gray), and the worst tile with what is around it, enlarged.
    /// `None` before there are two frames.
    pub fn worst_picture(&self, gain: f64) -> Option<Image> {
        let WorstStep {
            step,
            before,
            after,
        } = self.worst.as_ref()?;
        let [width, height] = before[0].size();
        let paint = |change: &dyn Fn(usize) -> [f64; 3]| {
            let mut image = Image::filled(width, height, [0; 4]);
            for (i, pixel) in image.color.iter_mut().enumerate() {
                let [r, g, b] = change(i).map(|e| unorm8(0.5 + gain * e));
                *pixel = [r, g, b, 255];
            }
            image
        };
        let excess = paint(&|i| excess_of(before, after, i));
        let change = paint(&|i| {
            let (from, to) = (before[0].value(i), after[0].value(i));
            [0, 1, 2].map(|c| to[c] - from[c])
        });
        // A tile alone is too small to know where one is.
        let tile = &step.worst_tile;
        let around = PictureTile {
            x: tile.x.saturating_sub(2 * TILE),
            y: tile.y.saturating_sub(2 * TILE),
            width: 5 * TILE,
            height: 5 * TILE,
            ..*tile
        };
        let enlarge = (width.min(height) / (5 * TILE)).clamp(1, 12);
        let part = |picture: &FloatImage| super::crop(picture, &around, enlarge);
        let [first, second] = [step.frame - 1, step.frame].map(|frame| format!("frame {frame}"));
        let at = format!("at {},{}", tile.x, tile.y);
        let [[r0, p0], [r1, p1]] = [before, after].map(|[r, p]| [&**r, &**p]);
        Some(contact_sheet(
            &[
                (format!("picture, {first}"), p0.to_image()),
                (format!("picture, {second}"), p1.to_image()),
                (format!("excess x {gain}"), excess.clone()),
                (format!("reference, {first}"), r0.to_image()),
                (format!("reference, {second}"), r1.to_image()),
                (format!("its change x {gain}"), change),
                (format!("{first} {at}"), part(p0)),
                (format!("{second} {at}"), part(p1)),
                (
                    format!("excess {at}"),
                    super::crop(&excess, &around, enlarge),
                ),
            ],
            3,
        ))
    }
}

/// The excess of one pixel; what is not finite counts as 0.
fn excess_of(before: &ShownDifference, after: &ShownDifference, pixel: usize) -> [f64; 3] {
    let [r, p] = [0, 1].map(|at| (before[at].value(pixel), after[at].value(pixel)));
    [0, 1, 2].map(|c| {
        let e = (p.1[c] - p.0[c]) - (r.1[c] - r.0[c]);
        if e.is_finite() { e } else { 0.0 }
    })
}

/// One step, and its object pixels into the histogram. `frame` and `churn` are left open.
fn compare(
    before: &ShownDifference,
    after: &ShownDifference,
    rules: &TemporalRules,
    histogram: &mut [u64],
) -> TemporalStep {
    let [width, height] = before[0].size();
    let columns = width.div_ceil(TILE) as usize;
    let mut tiles = vec![0.0f64; columns * height.div_ceil(TILE) as usize];
    let (mut object, mut sum, mut change) = (0u64, 0.0, 0.0);
    let (mut max, mut max_at) = (0.0f64, [0; 2]);
    for (i, (x, y)) in (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .enumerate()
    {
        let e = excess_of(before, after, i);
        tiles[(y / TILE) as usize * columns + (x / TILE) as usize] +=
            e.iter().map(|e| e * e).sum::<f64>();
        let largest = e.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        if largest > max {
            (max, max_at) = (largest, [x, y]);
        }
        let mut all = before.iter().chain(after);
        if !all.any(|picture| picture.value(i)[3] > 0.0) {
            continue;
        }
        object += 1;
        sum += e.iter().map(|e| e.abs()).sum::<f64>();
        let [from, to] = [before, after].map(|shown| shown[0].value(i));
        change += (0..3).map(|c| (to[c] - from[c]).abs()).sum::<f64>();
        // The slack is for single precision: a whole level stays in its bin.
        let bin = (255.0 * largest * BINS - 1e-3).ceil().max(0.0) as usize;
        histogram[bin.min(histogram.len() - 1)] += 1;
    }
    let mut worst = PictureTile {
        rmse: -1.0,
        ..PictureTile::default()
    };
    let mut pops = 0;
    for (i, sum) in tiles.iter().enumerate() {
        let (x, y) = ((i % columns) as u32 * TILE, (i / columns) as u32 * TILE);
        let (w, h) = (TILE.min(width - x), TILE.min(height - y));
        let rmse = (sum / (3.0 * f64::from(w) * f64::from(h))).sqrt();
        pops += u64::from(255.0 * rmse > rules.pop_level);
        if rmse > worst.rmse {
            worst = PictureTile {
                x,
                y,
                width: w,
                height: h,
                rmse,
            };
        }
    }
    let channels = 3.0 * object.max(1) as f64;
    TemporalStep {
        frame: 0,
        object_pixels: object,
        mean_level: 255.0 * sum / channels,
        max_level: 255.0 * max,
        max_at,
        reference_level: 255.0 * change / channels,
        pops,
        worst_tile: PictureTile {
            rmse: worst.rmse.max(0.0),
            ..worst
        },
        churn: None,
    }
}

/// Of what two lists hold together, the share that is in one of them only: 0 for equal lists (also empty ones), 1 for
/// lists that share nothing. Both ascending and without repetition.
pub fn churn<T: Ord>(
    before: impl IntoIterator<Item = T>,
    after: impl IntoIterator<Item = T>,
) -> f64 {
    let (mut before, mut after) = (before.into_iter().peekable(), after.into_iter().peekable());
    let (mut shared, mut all) = (0u64, 0u64);
    loop {
        let order = match (before.peek(), after.peek()) {
            (Some(a), Some(b)) => a.cmp(b),
            (Some(_), None) => std::cmp::Ordering::Less,
            (None, Some(_)) => std::cmp::Ordering::Greater,
            (None, None) => break,
        };
        if order.is_le() {
            before.next();
            all += 1;
        }
        if order.is_ge() {
            after.next();
            all += 1;
        }
        shared += 2 * u64::from(order.is_eq());
    }
    (all - shared) as f64 / all.max(1) as f64
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    const GREY: f32 = 100.0 / 255.0;

    /// A grey picture, covered everywhere.
    fn flat() -> FloatImage {
        FloatImage {
            width: 30,
            height: 20,
            color: vec![[GREY, GREY, GREY, 1.0]; 600],
            ..FloatImage::default()
        }
    }

    fn sequence(frames: &[(&FloatImage, &FloatImage)]) -> PictureSequence {
        let mut sequence = PictureSequence::new(TemporalRules::default());
        for (reference, picture) in frames {
            let [r, p] = [*reference, *picture].map(|p| Arc::new(p.clone()));
            sequence.push(r, p, None).unwrap();
        }
        sequence
    }

    /// A bright square that is somewhere else in every frame.
    fn moving(frame: usize) -> FloatImage {
        let mut picture = flat();
        for i in 0..9 {
            picture.color[(frame + i / 3) * 30 + 2 * frame + i % 3] = [1.0, 0.5, 0.0, 1.0];
        }
        picture
    }

    #[test]
    fn a_picture_that_equals_its_reference_has_no_flicker() {
        let frames: Vec<FloatImage> = (0..6).map(moving).collect();
        let pairs: Vec<_> = frames.iter().map(|f| (f, f)).collect();
        let found = sequence(&pairs).figures();
        // 2 of 9 pixels stay; the others change by 155, 27.5 and 100 levels.
        let change = 14.0 * (155.0 + 27.5 + 100.0) / 3.0 / 600.0;
        assert!((found.reference_level - change).abs() < 1e-4);
        let expected = SequenceFigures {
            steps: 5,
            reference_level: found.reference_level,
            worst_frame: 1,
            ..SequenceFigures::default()
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn an_error_that_stays_does_not_flicker() {
        let frames: Vec<FloatImage> = (0..4).map(moving).collect();
        let wrong: Vec<FloatImage> = frames
            .iter()
            .map(|f| {
                let mut f = f.clone();
                for pixel in &mut f.color[60..90] {
                    pixel[1] += 0.25;
                }
                f
            })
            .collect();
        let pairs: Vec<_> = frames.iter().zip(&wrong).collect();
        let found = sequence(&pairs).figures();
        assert!(
            found.max_level < 1e-3 && found.pops_per_second == 0.0,
            "{found:?}"
        );
        assert!(found.p99_level <= 1.0 / BINS, "{found:?}");
    }

    /// A block of 8 x 8 pixels that becomes 64 levels brighter in frame 3 and stays so.
    #[test]
    fn a_planted_pop_is_counted_once_at_its_place() {
        let before = flat();
        let mut after = flat();
        for y in 8..16 {
            for x in 16..24 {
                for c in 0..3 {
                    after.color[y * 30 + x][c] += 64.0 / 255.0;
                }
            }
        }
        let frames = [
            (&before, &before),
            (&before, &before),
            (&before, &before),
            (&before, &after),
            (&before, &after),
        ];
        let sequence = sequence(&frames);
        let found = sequence.figures();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
        assert_eq!((found.steps, found.most_pops, found.worst_frame), (4, 1, 3));
        assert!(near(found.pops_per_second, 60.0 / 4.0));
        assert!(
            near(found.mean_level, 64.0 * 64.0 / 600.0 / 4.0),
            "{found:?}"
        );
        assert!(
            near(found.max_level, 64.0) && near(found.p99_level, 64.0),
            "{found:?}"
        );
        for step in sequence.steps() {
            let is_it = step.frame == 3;
            assert_eq!(step.pops, u64::from(is_it));
            assert!(near(
                step.mean_level,
                if is_it { 64.0 * 64.0 / 600.0 } else { 0.0 }
            ));
        }
        let step = &sequence.steps()[2];
        assert_eq!(step.max_at, [16, 8]);
        let tile = step.worst_tile;
        assert_eq!((tile.x, tile.y, tile.width, tile.height), (16, 8, 8, 8));
        assert!(near(255.0 * tile.rmse, 64.0));
        // The same change of the reference is no pop, and one that goes back is another.
        assert_eq!(
            self::sequence(&[(&before, &before), (&after, &after)])
                .figures()
                .most_pops,
            0
        );
        let twice = self::sequence(&[(&before, &before), (&before, &after), (&before, &before)]);
        assert_eq!(twice.steps().iter().map(|s| s.pops).sum::<u64>(), 2);
        // A lone pixel does not pop: 64 levels in one of 64 pixels are 8 in the root of the mean.
        let mut lone = flat();
        for c in 0..3 {
            lone.color[45][c] += 64.0 / 255.0;
        }
        let found = self::sequence(&[(&before, &before), (&before, &lone)]).figures();
        assert_eq!(found.most_pops, 0);
        assert!(near(found.max_level, 64.0) && found.p99_level == 0.0);
    }

    #[test]
    fn what_is_background_throughout_does_not_count() {
        let mut before = flat();
        for pixel in &mut before.color[..540] {
            *pixel = [0.0; 4];
        }
        let mut after = before.clone();
        // One pixel becomes covered, one row was all along.
        after.color[0] = [60.0 / 255.0, 0.0, 0.0, 0.5];
        let sequence = sequence(&[(&before, &before), (&before, &after)]);
        let step = &sequence.steps()[0];
        assert_eq!(step.object_pixels, 61);
        assert!((step.mean_level - 20.0 / 61.0).abs() < 1e-4);
    }

    #[test]
    fn pictures_of_other_sizes_are_refused() {
        let small = FloatImage {
            width: 1,
            height: 1,
            color: vec![[0.0; 4]],
            ..FloatImage::default()
        };
        let mut sequence = sequence(&[(&flat(), &flat())]);
        let (small, flat) = (Arc::new(small), Arc::new(flat()));
        assert!(sequence.push(flat.clone(), small.clone(), None).is_err());
        assert!(sequence.push(small.clone(), small, None).is_err());
        sequence.push(flat.clone(), flat, None).unwrap();
        assert_eq!(sequence.steps().len(), 1);
        assert!(sequence.worst_picture(4.0).is_some());
    }

    #[test]
    fn no_frames_have_no_figures() {
        let sequence = PictureSequence::new(TemporalRules::default());
        assert_eq!(sequence.figures(), SequenceFigures::default());
        assert!(sequence.worst_picture(1.0).is_none());
        let nothing = Arc::new(FloatImage::default());
        let mut sequence = sequence;
        for _ in 0..2 {
            sequence
                .push(nothing.clone(), nothing.clone(), None)
                .unwrap();
        }
        assert_eq!(sequence.figures().mean_level, 0.0);
        assert!(sequence.worst_picture(1.0).is_some());
    }

    #[test]
    fn churn_is_the_share_that_only_one_list_has() {
        assert_eq!(churn([1, 2, 3], [1, 2, 3]), 0.0);
        assert_eq!(churn::<u32>([], []), 0.0);
        assert_eq!(churn([1, 2], [3, 4]), 1.0);
        assert_eq!(churn(vec![], [3, 4]), 1.0);
        // Five drawn before, four after, three of them in both.
        assert_eq!(churn([1, 2, 5, 7, 9], [2, 5, 6, 9]), 3.0 / 9.0);
    }
}
