//! Which pixels splats may cover, a vector of them at a time.

use crate::abi::Splat;
use crate::cut::strip_center_of;
use crate::pack::Footprint;
use crate::pack::splats::{NumberedSplat, PackedPart, SplatOutput};
use crate::render::cpu::opaque::bands::Outlines;
use crate::render::cpu::opaque::headlight::{BlockSurfaces, FrameHeadlight};
use crate::render::cpu::opaque::ovals::{OvalDiscs, OvalOutline};
use crate::render::cpu::opaque::pixel_lists::PixelSearch;
use crate::render::cpu::opaque::{ListedSplats, SplatScreen, SplatShape};
use crate::tree::{Leaf, Node};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use glam::Vec3;
use prefetch_index::prefetch_index;

pub(super) type Numbers<S> = <S as Simd>::f32s;

/// Splats whose rows are known together. They lie near each other, in the order of the tree.
pub(super) const GROUP: usize = 16;
/// Splats that are looked at together: a whole number of groups and of vectors.
pub(super) const BLOCK: usize = 64;

/// A circle of a smaller diameter is the square around it, see `shaders/common/form.glsl`.
pub(super) const LEAST_ROUND_PX: f32 = std::f32::consts::SQRT_2;

/// Side of the smallest disc whose pixels have the depth of its plane.
const LEAST_LEANING_PX: f32 = 3.0;

/// Both numbers of a word.
#[inline(always)]
pub(super) fn both(word: i32) -> [usize; 2] {
    [(word & 0xffff) as usize, (word as u32 >> 16) as usize]
}

/// Which of its pixels a disc covers: those at offsets o with `form` o.o of at most 1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RoundPixels {
    /// 1 / pixels^2; 0 of what is a square.
    pub(super) form: f32,
    /// From the center to that of the first pixel, pixels.
    pub(super) to_first: [f32; 2],
}

/// Splats that lie near each other.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NearSplats {
    /// Number of the first among those of their look.
    pub(super) first: u32,
    pub(super) count: u16,
    /// The first row that they may touch, and one past the last.
    pub(super) rows: [u16; 2],
}

pub(super) type Row = [f32; BLOCK];

/// Numbers of a block, written word by word before any are read as vectors.
struct NumberBlock {
    center: [Row; 3],
    radius: Row,
}

/// What is found of a block.
struct BlockAnswers {
    first: [i32; BLOCK],
    end: [i32; BLOCK],
    depth: Row,
    form: Row,
    to_first: [Row; 2],
    /// Form and skew of discs in the plane of the surface.
    ovals: [Row; 8],
    colors: [i32; BLOCK],
}

/// How far ahead of the item that is looked at the memory of another one is asked for.
const AHEAD: usize = 48;

/// Where no splat is drawn.
const NOWHERE: Vec3 = Vec3::NAN;

/// Finds the pixels of splats of one look, and of groups of them the rows; the number of the first of them. What they look
/// like is found as well, unless they are those of nodes alone.
pub(super) fn part(
    level: Level,
    screen: &SplatScreen,
    light: &FrameHeadlight,
    (source, look, is_one_pixel): (ListedSplats<'_>, SplatShape, bool),
    first: u32,
    places: Places<'_>,
) {
    let mut placer = SplatPlacer {
        level,
        screen,
        light: (!matches!(source, ListedSplats::Cut(..) | ListedSplats::Places(_)))
            .then_some(light),
        look,
        is_one_pixel,
        first,
        places,
        len: 0,
        surfaces: BlockSurfaces::NOTHING,
        block: NumberBlock {
            center: [[0.0; BLOCK]; 3],
            radius: [0.0; BLOCK],
        },
        answers: BlockAnswers {
            first: [0; BLOCK],
            end: [0; BLOCK],
            depth: [0.0; BLOCK],
            form: [0.0; BLOCK],
            to_first: [[0.0; BLOCK]; 2],
            ovals: [[0.0; BLOCK]; 8],
            colors: [0; BLOCK],
        },
    };
    match source {
        ListedSplats::List(splats) => {
            for splat in splats {
                placer.put(splat);
            }
        }
        ListedSplats::Places(splats) => {
            for splat in splats {
                placer.place(splat);
            }
        }
        ListedSplats::Surface(writer, part) => {
            writer.part(part, &mut placer);
            // What has no area has no splat.
            while !placer.is_full() {
                placer.push(NOWHERE, 0.0);
            }
        }
        ListedSplats::Cut(model, undrawn, PackedPart::Nodes(ids)) => {
            let nodes: &[Node] = &model.tree.nodes;
            for (index, &id) in ids.iter().enumerate() {
                if let Some(&next) = ids.get(index + AHEAD) {
                    prefetch_index(nodes, next as usize);
                }
                let is_drawn = !undrawn.has_node(id);
                placer.push_if(is_drawn, nodes[id as usize].center);
            }
        }
        ListedSplats::Cut(model, undrawn, PackedPart::Rows(rows)) => {
            let nodes: &[Node] = &model.tree.nodes;
            for (index, row) in rows.iter().enumerate() {
                if let Some(next) = rows.get(index + AHEAD) {
                    prefetch_index(nodes, next.node as usize);
                }
                let is_drawn = !undrawn.has_node(row.node);
                let center = strip_center_of(&nodes[row.node as usize], row.count);
                for i in (0..row.count).filter(|&i| row.is_seen(i)) {
                    placer.push_if(is_drawn, center(i));
                }
            }
        }
        ListedSplats::Cut(model, undrawn, PackedPart::Leaves(ids) | PackedPart::Large(ids)) => {
            let leaves: &[Leaf] = &model.tree.leaves;
            for (index, &id) in ids.iter().enumerate() {
                if let Some(&next) = ids.get(index + AHEAD) {
                    prefetch_index(leaves, next as usize);
                }
                let is_drawn = !undrawn.has_leaf(id);
                placer.push_if(is_drawn, leaves[id as usize].center);
            }
        }
    }
    placer.flush();
}

/// Where pixels, what is round, and groups go.
pub(super) type Places<'a> = (PixelSearch<'a>, Outlines<'a>, &'a mut [NearSplats]);

/// Finds where splats are, block by block.
struct SplatPlacer<'a> {
    /// Vectors of the processor. Callers of [`SplatWriter`](crate::render::cpu::opaque::SplatWriter) are not compiled for any.
    level: Level,
    screen: &'a SplatScreen,
    /// None where nobody asks what they look like.
    light: Option<&'a FrameHeadlight>,
    look: SplatShape,
    is_one_pixel: bool,
    /// Number of the first of the block.
    first: u32,
    /// What is left of it.
    places: Places<'a>,
    len: usize,
    surfaces: BlockSurfaces,
    block: NumberBlock,
    answers: BlockAnswers,
}

impl SplatOutput for SplatPlacer<'_> {
    const HAS_THICKNESS: bool = false;

    #[inline(always)]
    fn point(&mut self, named: &NumberedSplat) {
        self.put(&named.splat);
    }

    #[inline(always)]
    fn quad(&mut self, named: &NumberedSplat) {
        self.put(&named.splat);
    }
}

impl SplatPlacer<'_> {
    #[inline(always)]
    fn put(&mut self, splat: &Splat) {
        self.surfaces.put(self.len % BLOCK, splat);
        self.push(splat.center, splat.radius.model_units());
    }

    /// Takes a splat whose color nobody asks for.
    #[inline(always)]
    fn place(&mut self, splat: &Splat) {
        match self.look.footprint {
            Footprint::Oriented => self.put(splat),
            _ => self.push(splat.center, splat.radius.model_units()),
        }
    }

    /// Tells whether all are there.
    #[inline(always)]
    fn is_full(&self) -> bool {
        self.len >= self.places.0.first.len()
    }

    /// A splat without a radius of its own, or in its place one that has no pixels.
    #[inline(always)]
    fn push_if(&mut self, is_drawn: bool, center: Vec3) {
        self.push(if is_drawn { center } else { NOWHERE }, 0.0);
    }

    #[inline(always)]
    fn push(&mut self, center: Vec3, radius: f32) {
        let at = self.len % BLOCK;
        let [x, y, z] = &mut self.block.center;
        (x[at], y[at], z[at]) = (center.x, center.y, center.z);
        self.block.radius[at] = radius;
        self.len += 1;
        if self.len == BLOCK {
            self.flush();
        }
    }

    #[inline(never)]
    fn flush(&mut self) {
        dispatch!(self.level, simd => self.find(simd));
        self.store();
    }

    /// Finds all of the block.
    #[inline(always)]
    fn find<S: Simd>(&mut self, simd: S) {
        let Self {
            screen,
            look,
            answers,
            ..
        } = self;
        for at in (0..self.len).step_by(Numbers::<S>::LEN) {
            if let Some(light) = self.light {
                let (centers, colors) = (&self.block.center, &mut answers.colors);
                self.surfaces.shade(simd, light, centers, at, colors);
            }
            if look.footprint == Footprint::Oriented {
                let (normal, thickness) = self.surfaces.patches(simd, at);
                find_ovals(simd, screen, normal, thickness, (&self.block, answers), at);
            } else if self.is_one_pixel {
                find::<S, true>(simd, screen, *look, (&self.block, answers), at);
            } else {
                find::<S, false>(simd, screen, *look, (&self.block, answers), at);
            }
        }
    }

    /// What was found of the block goes to its places.
    fn store(&mut self) {
        let Self { look, answers, .. } = self;
        let (mut pixels, (rounds, ovals), groups) = std::mem::take(&mut self.places);
        let own = pixels.split(self.len);
        own.first.copy_from_slice(&answers.first[..self.len]);
        own.end.copy_from_slice(&answers.end[..self.len]);
        own.depth.copy_from_slice(&answers.depth[..self.len]);
        if self.light.is_some() {
            own.colors.copy_from_slice(&answers.colors[..self.len]);
        }
        let (rounds, rest_of_rounds) = rounds.split_at_mut(match look.footprint {
            Footprint::Circle => self.len,
            _ => 0,
        });
        for (i, round) in rounds.iter_mut().enumerate() {
            *round = RoundPixels {
                form: answers.form[i],
                to_first: [answers.to_first[0][i], answers.to_first[1][i]],
            };
        }
        let (own_ovals, rest_of_ovals) = ovals.split_at_mut(match look.footprint {
            Footprint::Oriented => self.len,
            _ => 0,
        });
        for (i, oval) in own_ovals.iter_mut().enumerate() {
            let [xx, xy, yy, skew_x, skew_y, lean_x, lean_y, dome] =
                [0, 1, 2, 3, 4, 5, 6, 7].map(|row: usize| answers.ovals[row][i]);
            *oval = OvalOutline {
                form: [xx, xy, yy],
                skew: [skew_x, skew_y],
                lean: [lean_x, lean_y],
                dome,
                to_first: [answers.to_first[0][i], answers.to_first[1][i]],
            };
        }
        let (groups, rest_of_groups) = groups.split_at_mut(self.len.div_ceil(GROUP));
        let firsts = own.first.chunks(GROUP);
        let ends = own.end.chunks(GROUP);
        let begins = (self.first..).step_by(GROUP);
        for ((group, (firsts, ends)), first) in groups.iter_mut().zip(firsts.zip(ends)).zip(begins)
        {
            let low = firsts.iter().fold(u32::MAX, |low, &v| low.min(v as u32));
            let high = ends.iter().fold(0, |high, &v| high.max(v as u32));
            *group = NearSplats {
                first,
                count: firsts.len() as u16,
                rows: [low, high].map(|v| (v >> 16) as u16),
            };
        }
        self.places = (pixels, (rest_of_rounds, rest_of_ovals), rest_of_groups);
        self.first += self.len as u32;
        self.len = 0;
    }
}

/// Of centers the reversed depth times the last component of clip space, that component, and whether they are between near and
/// far plane.
#[inline(always)]
pub(super) fn depth_of<S: Simd>(
    simd: S,
    screen: &SplatScreen,
    [x, y, z]: [Numbers<S>; 3],
) -> (Numbers<S>, Numbers<S>, S::mask32s) {
    let [a, b, c, d] = screen.along;
    let in_view = x * a + (y * b + (z * c + d));
    let depth = in_view * screen.depth[0] + screen.depth[1];
    let last = in_view * screen.last[0] + screen.last[1];
    let zero = Numbers::<S>::splat(simd, 0.0);
    let is_drawn = depth.simd_ge(zero) & depth.simd_le(last) & last.simd_gt(zero);
    (depth, last, is_drawn)
}

/// Centers of a vector of splats.
struct SeenCenters<S: Simd> {
    /// Model space.
    center: [Numbers<S>; 3],
    /// Window position, pixels.
    window: [Numbers<S>; 2],
    /// Last component of the clip position.
    last: Numbers<S>,
    /// Between the near and the far plane.
    is_drawn: S::mask32s,
}

/// Finds the centers of splats number `at` of a block and on, as many as a vector has, and stores their depths.
#[inline(always)]
fn centers_of<S: Simd>(
    simd: S,
    screen: &SplatScreen,
    (block, found): (&NumberBlock, &mut BlockAnswers),
    at: usize,
) -> SeenCenters<S> {
    let lanes = at..at + Numbers::<S>::LEN;
    let [x, y, z] = &block.center;
    let x = Numbers::<S>::from_slice(simd, &x[lanes.clone()]);
    let y = Numbers::<S>::from_slice(simd, &y[lanes.clone()]);
    let z = Numbers::<S>::from_slice(simd, &z[lanes.clone()]);
    // From the last column to the first, as shaders do it.
    let times = |row: &[f32; 4]| x * row[0] + (y * row[1] + (z * row[2] + row[3]));
    let (depth, last, is_drawn) = depth_of(simd, screen, [x, y, z]);
    (depth / last).store_slice(&mut found.depth[lanes]);
    SeenCenters {
        center: [x, y, z],
        window: [
            times(&screen.window[0]) / last,
            times(&screen.window[1]) / last,
        ],
        last,
        is_drawn,
    }
}

/// Splats number `at` of a block and on, as many as a vector has. `ONE`: they are squares of a pixel.
#[inline(always)]
fn find<S: Simd, const ONE: bool>(
    simd: S,
    screen: &SplatScreen,
    look: SplatShape,
    (block, found): (&NumberBlock, &mut BlockAnswers),
    at: usize,
) {
    let lanes = at..at + Numbers::<S>::LEN;
    let number = |v: f32| Numbers::<S>::splat(simd, v);
    let SeenCenters {
        window,
        last,
        is_drawn,
        ..
    } = centers_of(simd, screen, (block, found), at);
    let zero = number(0.0);
    let [left, top, right, bottom] = screen.rect_px.map(|v| v as f32);
    let sides = [[left, right], [top, bottom]];
    if ONE {
        let (column, is_in_x) = pixel_of::<S>(window[0], sides[0]);
        let (row, is_in_y) = pixel_of::<S>(window[1], sides[1]);
        let is_in = is_drawn & is_in_x & is_in_y;
        let ends = [[column, column + 1.0], [row, row + 1.0]];
        store(simd, is_in, ends, found, lanes);
        return;
    }
    let one_size = number(0.5 * screen.size_px);
    let half = if look.has_one_size {
        one_size
    } else {
        let radius = Numbers::<S>::from_slice(simd, &block.radius[lanes.clone()]);
        let own = radius * screen.model_scale * screen.focal_px / last;
        radius.simd_gt(zero).select(own, one_size)
    };
    let side = half * 2.0;
    let square = side.max(number(1.0)).min(number(65536.0));
    let steps = (square * 256.0).round_ties_even().to_int::<S::i32s>();
    let round_side = side.simd_ge(LEAST_ROUND_PX);
    let form = number(4.0) / (side * side);
    let mut ends = [[zero; 2]; 2];
    let mut is_in = is_drawn;
    for (i, [low, high]) in sides.into_iter().enumerate() {
        let window = window[i];
        is_in &= window.simd_gt(number(low) - square) & window.simd_lt(number(high) + square);
        let whole = |v: f32| S::i32s::splat(simd, v as i32);
        let low_step = (window * 256.0).round_ties_even().to_int::<S::i32s>() - (steps >> 1) + 127;
        let first = (low_step >> 8).max(whole(low)).to_float::<Numbers<S>>();
        let end = ((low_step + steps) >> 8)
            .min(whole(high))
            .to_float::<Numbers<S>>();
        ends[i] = [first, end];
        if look.footprint == Footprint::Circle {
            let clamped = |v: Numbers<S>| v.max(number(low)).min(number(high));
            let reach = side * 0.5;
            let first_round = clamped((window - reach - 0.5).ceil());
            let end_round = clamped((window + reach + 0.5).floor());
            ends[i] = [
                round_side.select(first_round, first),
                round_side.select(end_round, end),
            ];
            let to_first = ends[i][0] + 0.5 - window;
            to_first.store_slice(&mut found.to_first[i][lanes.clone()]);
        }
    }
    if look.footprint == Footprint::Circle {
        let form = round_side.select(form, zero);
        form.store_slice(&mut found.form[lanes.clone()]);
    }
    let [[first_x, end_x], [first_y, end_y]] = ends;
    is_in &= first_x.simd_lt(end_x) & first_y.simd_lt(end_y);
    let x = [first_x - sides[0][0], end_x - sides[0][0]];
    let y = [first_y - sides[1][0], end_y - sides[1][0]];
    store(simd, is_in, [x, y], found, lanes);
}

/// Finds pixels as [`find`] does, of discs in the plane of the surface with these normals and thicknesses.
#[inline(always)]
fn find_ovals<S: Simd>(
    simd: S,
    screen: &SplatScreen,
    normal: [Numbers<S>; 3],
    thickness: Numbers<S>,
    (block, found): (&NumberBlock, &mut BlockAnswers),
    at: usize,
) {
    let lanes = at..at + Numbers::<S>::LEN;
    let number = |v: f32| Numbers::<S>::splat(simd, v);
    let SeenCenters {
        center,
        window,
        is_drawn,
        ..
    } = centers_of(simd, screen, (block, found), at);
    let discs = OvalDiscs {
        center,
        radius: Numbers::<S>::from_slice(simd, &block.radius[lanes.clone()]),
        normal,
        thickness,
    };
    let sizes = [screen.model_scale, screen.focal_px, screen.size_px];
    let forms = screen.ovals.forms(simd, &discs, sizes);
    let (zero, one) = (number(0.0), number(1.0));
    let side = forms.sides[0].max(forms.sides[1]);
    // What is no number at all is a square of a pixel.
    let is_round = side.simd_ge(LEAST_ROUND_PX);
    let square = is_round.select(one, side.simd_ge(one).select(side, one));
    let steps = (square * 256.0).round_ties_even().to_int::<S::i32s>();
    let [left, top, right, bottom] = screen.rect_px.map(|v| v as f32);
    let mut ends = [[zero; 2]; 2];
    let mut is_in = is_drawn;
    for (i, [low, high]) in [[left, right], [top, bottom]].into_iter().enumerate() {
        let window = window[i];
        let reach = (forms.sides[i] + 1.0 / 64.0) * 0.5;
        let reach = is_round.select(reach, square);
        is_in &= window.simd_gt(number(low) - reach) & window.simd_lt(number(high) + reach);
        let low_step = (window * 256.0).round_ties_even().to_int::<S::i32s>() - (steps >> 1) + 127;
        let first = (low_step >> 8).to_float::<Numbers<S>>();
        let end = ((low_step + steps) >> 8).to_float::<Numbers<S>>();
        let first = is_round.select((window - reach - 0.5).ceil(), first);
        let end = is_round.select((window + reach + 0.5).floor(), end);
        ends[i] = [
            first.max(number(low)).min(number(high)),
            end.max(number(low)).min(number(high)),
        ];
        let to_first = ends[i][0] + 0.5 - window;
        to_first.store_slice(&mut found.to_first[i][lanes.clone()]);
    }
    let [xx, xy, yy] = forms.form;
    let is_leaning = side.simd_ge(LEAST_LEANING_PX);
    let [lean_x, lean_y] = [0, 1].map(|i: usize| is_leaning.select(forms.lean[i], zero));
    let dome = is_leaning.select(forms.dome, zero);
    let [skew_x, skew_y] = forms.skew;
    let rows = [xx, xy * 2.0, yy, skew_x, skew_y, lean_x, lean_y, dome];
    for (row, own) in found.ovals.iter_mut().zip(rows) {
        is_round
            .select(own, zero)
            .store_slice(&mut row[lanes.clone()]);
    }
    let [[first_x, end_x], [first_y, end_y]] = ends;
    is_in &= first_x.simd_lt(end_x) & first_y.simd_lt(end_y);
    let ends = [[first_x - left, end_x - left], [first_y - top, end_y - top]];
    store(simd, is_in, ends, found, lanes);
}

/// Which pixel a square of a pixel covers, from a low side on, and whether it is below a high one. A function: what a closure
/// does need not be compiled for the vectors of the one that it is in.
#[inline(always)]
fn pixel_of<S: Simd>(window: Numbers<S>, [low, high]: [f32; 2]) -> (Numbers<S>, S::mask32s) {
    let place = (window - 1.0 / 512.0).ceil() - 1.0 - low;
    (place, place.simd_ge(0.0) & place.simd_lt(high - low))
}

/// Stores first and end of columns and rows, or of what is not in something that ends before it begins.
#[inline(always)]
fn store<S: Simd>(
    simd: S,
    is_in: S::mask32s,
    [x, y]: [[Numbers<S>; 2]; 2],
    found: &mut BlockAnswers,
    lanes: std::ops::Range<usize>,
) {
    let word = |x: Numbers<S>, y: Numbers<S>| -> S::i32s {
        x.to_int::<S::i32s>() | (y.to_int::<S::i32s>() << 16)
    };
    let (first, end) = (word(x[0], y[0]), word(x[1], y[1]));
    let (none, nothing) = (S::i32s::splat(simd, -1), S::i32s::splat(simd, 0));
    let (first, end) = (is_in.select(first, none), is_in.select(end, nothing));
    first.store_slice(&mut found.first[lanes.clone()]);
    end.store_slice(&mut found.end[lanes]);
}
