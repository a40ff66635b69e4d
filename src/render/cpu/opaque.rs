//! Opaque squares, discs and ellipses by the host, for software devices: what passes compute.clear, compute.splats and compute.resolve, or of large ones the rasterizer,
//! leave in the picture.
//!
//! A software device goes through the lanes of each write one by one and locks each pixel that it writes
//! (`docs/PERFORMANCE.md`, "The floor of rates by compute"). Here the pixels of all splats are found first, many at a time;
//! then the picture is cut into bands of rows, each the job of one thread, so nothing is locked. Which splat a pixel shows is the
//! same: the greatest key of a pixel does not depend on any order, and each number is made by the operations of
//! `shaders/compute/splats.comp`, in their order. So are colors but for the last place of a root, which decides in few pixels how
//! a value is rounded to one of 255.

mod band_raster;
mod bands;
mod deferred_shading;
mod framebuffer;
mod headlight;
mod ovals;
mod pixel_lists;
mod splat_bounds;
mod surface_pass;
mod triangles;
mod viewport;

pub use crate::render::cpu::opaque::bands::SplatPlaces;
pub use crate::render::cpu::opaque::framebuffer::ShownRectangle;
pub use crate::render::cpu::opaque::headlight::FrameHeadlight;
pub(crate) use crate::render::cpu::opaque::surface_pass::{
    SurfaceList, SurfacePlanes, draw_surfaces,
};
pub use crate::render::cpu::opaque::triangles::draw as draw_triangles;
pub use crate::render::cpu::opaque::viewport::SplatScreen;

use crate::abi::Splat;
use crate::cut::{Cut, ZeroAreaSet};
use crate::math::camera::View;
use crate::pack::Footprint;
use crate::pack::parallel;
use crate::pack::splats;
use crate::pack::splats::{PackedPart, SplatPlan, SplatWriter};
use crate::render::cpu::opaque::bands::{KnownSplats, OpaqueSplatList, SPLAT_BIT, draw_by};
use crate::render::cpu::opaque::deferred_shading::WrittenPart;
use crate::tree::Model;
use fearless_simd::Level;

/// The shape of splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SplatShape {
    /// Shape on the picture.
    pub footprint: Footprint,
    /// None has a radius of its own.
    pub has_one_size: bool,
}

/// Splats of a draw list, a part of it.
#[derive(Clone, Copy)]
pub(super) enum ListedSplats<'a> {
    /// Of a cut of a mesh; none has a radius of its own. What they look like is not asked for.
    Cut(&'a Model, &'a ZeroAreaSet, PackedPart<'a>),
    /// The same, with what they look like.
    Surface(&'a SplatWriter<'a>, PackedPart<'a>),
    /// Splats that are written already.
    List(&'a [Splat]),
    /// Splats that are written already. What they look like is not asked for.
    Places(&'a [Splat]),
}

/// Where a frame is drawn, and how it is lit.
pub type Frame<'a> = (&'a SplatScreen, &'a FrameHeadlight);

/// Draws a list, whose last `samples` splats are squares of a pixel and whose others look like `look`. The picture
/// becomes that, whatever it held: its first pixels, see [`SplatScreen::pixels`].
///
/// # Panics
/// When the picture has fewer, or the list has fewer splats than `samples`.
pub fn draw(
    splats: &[Splat],
    (look, samples): (SplatShape, usize),
    frame: Frame<'_>,
    places: &mut SplatPlaces,
    picture: ShownRectangle<'_>,
) {
    let (own, sampled) = splats.split_at(splats.len() - samples);
    let own = own.chunks(parallel::PART);
    let own = own
        .map(|part| (ListedSplats::List(part), part.len()))
        .collect();
    let list = OpaqueSplatList {
        parts: own,
        look,
        samples: sampled,
    };
    let known = KnownSplats::Colors;
    draw_by(Level::new(), list, frame, known, (places, picture));
}

/// A mesh and its cut.
#[derive(Clone, Copy)]
pub struct CutMesh<'a> {
    /// The mesh.
    pub model: &'a Model,
    /// What of it has no area.
    pub undrawn: &'a ZeroAreaSet,
    /// The cut.
    pub cut: &'a Cut,
}

/// The splats of cuts of meshes, none of which has a radius of its own.
#[derive(Clone, Copy)]
pub struct CutSplats<'a> {
    /// The meshes with their cuts.
    pub meshes: &'a [CutMesh<'a>],
    /// What is seen of them.
    pub view: &'a View,
    /// How splats would be written: squares or circles, since discs in the plane of the surface have sizes of their own.
    pub plan: &'a SplatPlan,
    /// Most of them are seen, as what is hidden was left out: then they are shaded while they are looked at, and else
    /// what is seen once that is known.
    pub are_seen: bool,
}

/// Draws the splats of cuts, and after them samples, which are squares of a pixel: the picture is that of [`draw`] with the list
/// that [`splats::pack`] would write.
///
/// # Panics
/// When the picture has fewer pixels than [`SplatScreen::pixels`].
pub fn draw_cut(
    splats: CutSplats<'_>,
    samples: &[Splat],
    frame: Frame<'_>,
    places: &mut SplatPlaces,
    picture: ShownRectangle<'_>,
) {
    draw_cut_by(Level::new(), splats, samples, frame, (places, picture));
}

fn draw_cut_by(
    level: Level,
    splats: CutSplats<'_>,
    samples: &[Splat],
    frame: Frame<'_>,
    (places, mut picture): (&mut SplatPlaces, ShownRectangle<'_>),
) {
    let CutSplats {
        meshes,
        view,
        plan,
        are_seen,
    } = splats;
    let look = SplatShape {
        footprint: plan.footprint,
        has_one_size: true,
    };
    let writers = meshes
        .iter()
        .map(|mesh| SplatWriter::new(mesh.model, view, plan));
    let writers: Vec<SplatWriter<'_>> = writers.collect();
    let (mut parts, mut own) = (Vec::new(), Vec::new());
    for (mesh, writer) in meshes.iter().zip(&writers) {
        for (part, count) in splats::parts_of(mesh.cut, plan) {
            let source = match are_seen {
                true => ListedSplats::Surface(writer, part),
                false => ListedSplats::Cut(mesh.model, mesh.undrawn, part),
            };
            own.push((source, count));
            parts.push(WrittenPart {
                writer,
                part,
                count,
            });
        }
    }
    let known = match are_seen {
        true => KnownSplats::Colors,
        false => KnownSplats::Places,
    };
    let list = OpaqueSplatList {
        parts: own,
        look,
        samples,
    };
    draw_by(level, list, frame, known, (places, picture.again()));
    if !are_seen {
        let count = parts.iter().map(|part| part.count).sum::<usize>();
        let colors = &mut places.pixels.colors_mut()[..count];
        let seen = &places.seen[..count];
        deferred_shading::shade(level, frame.1, parts, seen, colors);
        paint(frame.0, count + samples.len(), places, picture);
    }
}

/// Numbers become colors: those of as many splats.
fn paint(screen: &SplatScreen, count: usize, places: &SplatPlaces, picture: ShownRectangle<'_>) {
    let colors = &places.pixels.colors()[..count];
    let width = screen.width().max(1);
    parallel::share(count, picture.bands(screen), |mut band| {
        let rows = band.rows(width);
        let shown = rows.flat_map(|(colors, depths)| colors.iter_mut().zip(depths));
        let keys = shown.filter(|(color, depth)| **depth != 0.0 && **color & SPLAT_BIT == 0);
        for (color, _) in keys {
            let number = !*color & !SPLAT_BIT;
            *color = colors[number as usize] as u32;
        }
    });
}

#[cfg(test)]
mod tests;
