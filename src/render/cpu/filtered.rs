//! Small filtered splats and the triangles beside them by the host, for software devices: what passes filtered.depth and
//! filtered.blend leave in storage.
//!
//! A software device is the host itself, in a roundabout way: it goes through the lanes of each write one by one, locks
//! what two threads might write, and reads each record twice. Here the picture is cut into bands of rows, each the job of
//! one thread from beginning to end, so nothing is locked: a band is emptied, then the nearest pushed depth of each pixel is
//! found, then deposits are added where that does not hide them. What is left is the same to the bit as what the shaders
//! leave (`shaders/filtered/depth.comp`, `shaders/filtered/blend.comp`), which have the rules: a pixel's maximum and sums
//! of whole numbers do not depend on any order, and each number is made by the same operations. Of triangles ([`CutTriangles`]) the
//! last place of a shade may be another one.

mod blend;
mod depth;
mod large;
pub(crate) mod normalize;
mod splat_block;
#[cfg(test)]
mod tests;

pub use crate::render::cpu::triangles::{CutTriangles, FrameLight, MeshVertices};

use crate::abi::FilteredSplat;
use crate::pack::filtered::ScreenGroups;
use crate::pack::parallel;
use crate::render::cpu::filtered::splat_block::SplatBlocks;
use fearless_simd::{Level, Simd, dispatch};

/// Rows of a band.
const BAND_PX: u32 = 32;

/// The part of a picture that is drawn in, and what of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureArea {
    /// Left, top, and one past right and bottom, pixels.
    pub rect_px: [u32; 4],
    /// Red, green and blue are the same in every splat.
    pub is_gray: bool,
}

impl PictureArea {
    pub(crate) fn width(&self) -> usize {
        (self.rect_px[2] - self.rect_px[0]) as usize
    }

    /// How many pixels it has.
    pub fn pixels(&self) -> usize {
        self.width() * (self.rect_px[3] - self.rect_px[1]) as usize
    }

    /// Words of the sums of a pixel, see `shaders/common/fixed_sums.glsl`.
    pub fn words(&self) -> usize {
        if self.is_gray { 2 } else { 4 }
    }
}

/// One band of the picture.
pub(crate) struct FilteredBand<'a> {
    /// First row and one past the last.
    pub(crate) rows: [u32; 2],
    pub(crate) front: &'a mut [u32],
    pub(crate) sums: &'a mut [u64],
}

/// Splats of a model.
#[derive(Debug, Clone, Copy)]
pub struct GroupedSplats<'a> {
    /// With gaps.
    pub splats: &'a [FilteredSplat],
    /// Of these splats, those that are drawn.
    pub groups: &'a ScreenGroups,
}

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct DrawnSplats<'a> {
    /// Splats of each model.
    pub splats: &'a [GroupedSplats<'a>],
    /// Corners of triangles.
    pub meshes: MeshVertices<'a>,
    /// Of models with these vertices.
    pub triangles: &'a CutTriangles,
}

/// Draws a list. `front` and `sums` become what storage of the canvas holds after the passes by compute, whatever they held; the
/// first so many words, see [`PictureArea::pixels`] and [`PictureArea::words`].
///
/// # Panics
/// When `front` or `sums` is shorter than that, or `groups` are of another list; when triangles were
/// set up for another part of the picture.
pub fn draw(list: DrawnSplats<'_>, canvas: PictureArea, front: &mut [u32], sums: &mut [u64]) {
    draw_by(Level::new(), list, canvas, (front, sums));
}

/// Leaves the nearest depths that are not pushed in `front`, where those of the passes are; of triangles they are there. The
/// pixels of `sums` stay.
///
/// # Panics
/// When `front` or `sums` is too short, as in [`draw`].
pub(crate) fn leave_surface(
    list: DrawnSplats<'_>,
    canvas: PictureArea,
    front: &mut [u32],
    sums: &mut [u64],
) {
    let level = Level::new();
    let mut bands = bands(canvas, front, sums);
    let splats: usize = list.splats.iter().map(|own| own.splats.len()).sum();
    parallel::share(splats, bands.iter_mut(), |band| {
        let near = list.near(band.rows);
        let has_large = list.has_large();
        dispatch!(level, simd => leave_depths::<_, false>(simd, &near, has_large, &canvas, band));
    });
}

/// Leaves the nearest depths of splats, pushed or not.
#[inline(always)]
fn leave_depths<S: Simd, const PUSHED: bool>(
    simd: S,
    near: &[&[FilteredSplat]],
    has_large: bool,
    canvas: &PictureArea,
    band: &mut FilteredBand<'_>,
) {
    let mut blocks = SplatBlocks::of(near);
    while let Some(block) = blocks.next() {
        depth::draw::<S, PUSHED>(simd, &block, canvas, band);
    }
    if has_large {
        let of = |splat: &FilteredSplat| match PUSHED {
            true => splat.pushed_depth,
            false => splat.depth,
        };
        near.iter()
            .for_each(|splats| large::leave_depths(splats, of, canvas, band));
    }
}

impl<'a> DrawnSplats<'a> {
    /// Splats that may reach into some rows.
    fn near(&self, rows: [u32; 2]) -> Vec<&'a [FilteredSplat]> {
        let own = self.splats.iter();
        own.flat_map(|own| own.groups.in_rows(own.splats, rows))
            .collect()
    }

    /// Tells whether any is larger than blocks of them hold.
    fn has_large(&self) -> bool {
        self.splats.iter().any(|own| !own.groups.are_small())
    }
}

/// The same by vectors of a level.
fn draw_by(
    level: Level,
    list: DrawnSplats<'_>,
    canvas: PictureArea,
    (front, sums): (&mut [u32], &mut [u64]),
) {
    assert!(
        list.triangles.are_within(canvas.rect_px),
        "they are of another part"
    );
    let mut bands = bands(canvas, front, sums);
    let splats: usize = list.splats.iter().map(|own| own.splats.len()).sum();
    let many = splats + list.triangles.count();
    parallel::share(many, bands.iter_mut(), |band| {
        dispatch!(level, simd => if canvas.is_gray {
            draw_band::<_, true>(simd, &list, &canvas, band)
        } else {
            draw_band::<_, false>(simd, &list, &canvas, band)
        });
    });
}

/// The bands of a canvas, which begin at whole multiples of their height.
fn bands<'a>(
    canvas: PictureArea,
    mut front: &'a mut [u32],
    mut sums: &'a mut [u64],
) -> Vec<FilteredBand<'a>> {
    let [_, top, _, bottom] = canvas.rect_px;
    let mut bands = Vec::new();
    let mut first = top;
    while first < bottom {
        let end = ((first / BAND_PX + 1) * BAND_PX).min(bottom);
        let pixels = (end - first) as usize * canvas.width();
        let own;
        (own, front) = front.split_at_mut(pixels);
        let own_sums;
        (own_sums, sums) = sums.split_at_mut(pixels * canvas.words());
        bands.push(FilteredBand {
            rows: [first, end],
            front: own,
            sums: own_sums,
        });
        first = end;
    }
    bands
}

#[inline(always)]
fn draw_band<S: Simd, const GRAY: bool>(
    simd: S,
    list: &DrawnSplats<'_>,
    canvas: &PictureArea,
    band: &mut FilteredBand<'_>,
) {
    band.front.fill(0);
    band.sums.fill(0);
    list.triangles.leave_depths(canvas, band);
    let near = list.near(band.rows);
    leave_depths::<S, true>(simd, &near, list.has_large(), canvas, band);
    let has_large = list.has_large();
    let mut blocks = SplatBlocks::of(&near);
    while let Some(block) = blocks.next() {
        blend::draw::<S, GRAY>(simd, &block, canvas, band);
    }
    if has_large {
        near.iter()
            .for_each(|splats| large::blend(splats, canvas, band));
    }
    list.triangles.blend(list.meshes, canvas, band);
}
