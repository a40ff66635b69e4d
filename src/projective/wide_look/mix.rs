//! Colors of a block from the photographs that weigh most in each lane.

use crate::projective::look::{
    CANDIDATES, COARSER, LEAST_LEFT, LEAST_SHARE, LookPhoto, LookPixel, LookSettings, MOST_BLENDED,
    SHARPER,
};
use crate::projective::wide_look::block::BlockPhotos;
use crate::projective::wide_look::lanes::{floor, load, set_bits, smooth, splat};
use crate::projective::wide_look::texels::LaneTexels;
use crate::simd::{FloatLanes, WIDEST, WideLanes};
use fearless_simd::prelude::*;

/// Best few photographs of a block, as vectors.
struct BlockMix<'a, S: Simd> {
    simd: S,
    block: &'a BlockPhotos,
    photos: &'a [LookPhoto<'a>],
    has_gains: bool,
    weights: [WideLanes<S>; CANDIDATES],
    indices: [WideLanes<S>; CANDIDATES],
}

impl BlockPhotos {
    /// Gives the pixels of the block their colors; those that no photograph shows are left as they are.
    #[inline(always)]
    pub(super) fn mix<S: Simd>(
        &self,
        simd: S,
        photos: &[LookPhoto<'_>],
        settings: &LookSettings,
        found: &mut [LookPixel],
    ) {
        let lanes = WideLanes::<S>::LANES;
        let zero = splat(simd, 0.0);
        let (mut weights, mut indices) = ([zero; CANDIDATES], [zero; CANDIDATES]);
        for k in 0..CANDIDATES {
            weights[k] = load(simd, &self.weights[k]);
            indices[k] = load(simd, &self.indices[k]);
        }
        let mut mix = BlockMix {
            simd,
            block: self,
            photos,
            has_gains: settings.gains,
            weights,
            indices,
        };
        let covered = WideLanes::<S>::bits(mix.weights[0].gt(zero));
        if covered == 0 {
            return;
        }
        if settings.consensus {
            mix.agree(settings.tolerance);
        }
        let color = mix.color(settings);
        let [mut red, mut green, mut blue, mut weight, mut index] = [[0.0; WIDEST]; 5];
        color[0].store(&mut red[..lanes]);
        color[1].store(&mut green[..lanes]);
        color[2].store(&mut blue[..lanes]);
        mix.weights[0].store(&mut weight[..lanes]);
        mix.indices[0].store(&mut index[..lanes]);
        for lane in set_bits(covered) {
            found[lane] = LookPixel {
                color: [red[lane], green[lane], blue[lane]].map(|v| v.clamp(0.0, 1.0)),
                weight: weight[lane],
                best: index[lane] as u32,
            };
        }
    }
}

impl<S: Simd> BlockMix<'_, S> {
    /// Colors of one photograph in each of the lanes given; black in others. `coarser`: of one level, so much above the one
    /// that fits.
    #[inline(always)]
    fn colors(&self, index: WideLanes<S>, set: u32, coarser: Option<f32>) -> [WideLanes<S>; 3] {
        let simd = self.simd;
        let lanes = WideLanes::<S>::LANES;
        let mut indices = [0.0; WIDEST];
        index.store(&mut indices[..lanes]);
        let (mut fine, mut coarse) = (LaneTexels::default(), LaneTexels::default());
        let mut parts = [0.0; WIDEST];
        let mut gains = [[1.0; WIDEST]; 3];
        let mut blends = false;
        let first = indices[set.trailing_zeros() as usize];
        let is_one = index.ge(splat(simd, first)) & index.le(splat(simd, first));
        if set & !WideLanes::<S>::bits(is_one) == 0
            && let Some(part) = self.of_one(first as usize, set, coarser, [&mut fine, &mut coarse])
        {
            // Neighbors nearly always have the same photographs.
            part.store(&mut parts[..lanes]);
            blends = WideLanes::<S>::bits(part.gt(splat(simd, 0.0))) & set != 0;
            for (row, gain) in gains
                .iter_mut()
                .zip(self.photos[first as usize].photo.gain.to_array())
            {
                *row = [gain; WIDEST];
            }
        } else {
            for lane in set_bits(set) {
                let photo = indices[lane] as usize;
                let of = &self.photos[photo];
                let [u, v, level] = &self.block.spots[photo];
                let at = [u[lane], v[lane]];
                let levels = &of.pixels.levels;
                let last = levels.len() - 1;
                let level = (level[lane] - SHARPER).max(0.0);
                match coarser {
                    Some(coarser) => {
                        let level = (level + coarser + 0.5) as usize;
                        fine.take(lane, &levels[level.min(last)], at);
                    }
                    None => {
                        let first = (level as usize).min(last);
                        fine.take(lane, &levels[first], at);
                        let part = level - first as f32;
                        if part > 0.0 && first < last {
                            (parts[lane], blends) = (part, true);
                            coarse.take(lane, &levels[first + 1], at);
                        }
                    }
                }
                for (row, gain) in gains.iter_mut().zip(of.photo.gain.to_array()) {
                    row[lane] = gain;
                }
            }
        }
        let mut color = fine.mean(simd);
        if blends {
            let part = load(simd, &parts);
            let coarse = coarse.mean(simd);
            for c in 0..3 {
                color[c] = color[c] + part * (coarse[c] - color[c]);
            }
        }
        if self.has_gains {
            for c in 0..3 {
                color[c] = color[c] * load(simd, &gains[c]);
            }
        }
        color
    }

    /// Texels of one photograph in the lanes given, where all of them need the same level: the part of the next one that is
    /// blended in. `None` where they do not.
    #[inline(always)]
    fn of_one(
        &self,
        photo: usize,
        set: u32,
        coarser: Option<f32>,
        [fine, coarse]: [&mut LaneTexels; 2],
    ) -> Option<WideLanes<S>> {
        let simd = self.simd;
        let zero = splat(simd, 0.0);
        let levels = &self.photos[photo].pixels.levels;
        let last = levels.len() - 1;
        let [u, v, level] = &self.block.spots[photo];
        let at = [load(simd, u), load(simd, v)];
        let level = (load(simd, level) - splat(simd, SHARPER)).max(zero);
        let level = match coarser {
            Some(coarser) => floor(level + splat(simd, coarser + 0.5)),
            None => level,
        };
        let level = level.min(splat(simd, last as f32));
        let whole = floor(level);
        let mut wholes = [0_u32; WIDEST];
        whole.store_whole(&mut wholes[..WideLanes::<S>::LANES]);
        let first = wholes[set.trailing_zeros() as usize];
        let is_same = whole.ge(splat(simd, first as f32)) & whole.le(splat(simd, first as f32));
        if set & !WideLanes::<S>::bits(is_same) != 0 {
            return None;
        }
        fine.take_all(simd, &levels[first as usize], at, set);
        let part = level - whole;
        let blending = set & WideLanes::<S>::bits(part.gt(zero));
        if blending != 0 {
            coarse.take_all(simd, &levels[first as usize + 1], at, blending);
        }
        Some(part)
    }

    /// Multiplies each weight by the share of the others that show the same, in lanes with more than two, and sorts again.
    #[inline(always)]
    fn agree(&mut self, tolerance: f32) {
        let zero = splat(self.simd, 0.0);
        let are_compared = self.weights[2].gt(zero);
        let set = WideLanes::<S>::bits(are_compared);
        if set == 0 {
            return;
        }
        let mut colors = [[zero; 3]; CANDIDATES];
        for (k, color) in colors.iter_mut().enumerate() {
            let lanes = set & WideLanes::<S>::bits(self.weights[k].gt(zero));
            if lanes != 0 {
                *color = self.colors(self.indices[k], lanes, Some(COARSER));
            }
        }
        let mut same = self.weights;
        let mut all = zero;
        for i in 0..CANDIDATES {
            all = all + self.weights[i];
            for j in 0..i {
                let apart = apart(&colors[i], &colors[j]);
                let agrees = splat(self.simd, 1.0) - smooth(tolerance, 2.5 * tolerance, apart);
                same[i] = same[i] + self.weights[j] * agrees;
                same[j] = same[j] + self.weights[i] * agrees;
            }
        }
        for (weight, same) in self.weights.iter_mut().zip(same) {
            let agreed =
                *weight * same / WideLanes::choose(are_compared, all, splat(self.simd, 1.0));
            *weight = WideLanes::choose(are_compared, agreed, *weight);
        }
        // Neighbors are swapped until all are in order: those that tie keep theirs.
        for end in (1..CANDIDATES).rev() {
            for k in 0..end {
                let is_less = self.weights[k].lt(self.weights[k + 1]);
                swap(&mut self.weights, k, is_less);
                swap(&mut self.indices, k, is_less);
            }
        }
    }

    /// The mean of the best few: see [`look_at_pixel`](crate::projective::look::look_at_pixel).
    #[inline(always)]
    fn color(&self, settings: &LookSettings) -> [WideLanes<S>; 3] {
        let simd = self.simd;
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let most = (settings.blend as usize).clamp(1, MOST_BLENDED);
        let first = self.weights[0];
        let left_out = self.weights[most].max(first * LEAST_SHARE) * (1.0 - LEAST_LEFT);
        let span = first - left_out;
        let span = WideLanes::choose(span.gt(zero), span, one);
        let (mut sum, mut weights) = ([zero; 3], zero);
        for k in 0..most {
            let part = ((self.weights[k] - left_out) / span).max(zero);
            let set = WideLanes::<S>::bits(part.gt(zero));
            if set == 0 {
                continue;
            }
            let color = self.colors(self.indices[k], set, None);
            for c in 0..3 {
                sum[c] = sum[c] + color[c] * part;
            }
            weights = weights + part;
        }
        let all = WideLanes::choose(weights.gt(zero), weights, one);
        [sum[0] / all, sum[1] / all, sum[2] / all]
    }
}

/// Largest difference of a channel.
#[inline(always)]
fn apart<S: Simd>(a: &[WideLanes<S>; 3], b: &[WideLanes<S>; 3]) -> WideLanes<S> {
    let (red, green, blue) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    red.abs().max(green.abs()).max(blue.abs())
}

/// Swaps two neighbors in some lanes.
#[inline(always)]
fn swap<S: Simd>(list: &mut [WideLanes<S>; CANDIDATES], k: usize, lanes: S::mask32s) {
    let (a, b) = (list[k], list[k + 1]);
    list[k] = WideLanes::choose(lanes, b, a);
    list[k + 1] = WideLanes::choose(lanes, a, b);
}
