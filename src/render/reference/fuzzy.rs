//! The reference of fuzzy splats: two passes and a division, and the two single-pass variants of the literature.
//!
//! Sources: Benda, *Point Based Rendering*, section 2.3.3; Rusinkiewicz and Levoy, *QSplat*, 2000, section 3.3. Each
//! pixel shows Σ c w / Σ w over the splats of the front surface. Coverage of triangles, snapping and the vertex shader
//! are those of [`crate::render::reference::render`]; footprints those of [`crate::render::reference::disc`].

mod normalize;
mod set_up;

pub(super) use crate::render::reference::fuzzy::set_up::{set_up_blended, weighted};

use crate::abi::{OrientedPolygon, Vertex};
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{FuzzyList, PrimitiveStyle};
use crate::render::PictureOutputs;
use crate::render::reference::bands::{PixelRows, plane};
use crate::render::reference::disc::DiscSample;
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use crate::render::reference::fuzzy::set_up::{FuzzyFragment, place_pushed, set_up_pushed, share};
use crate::render::reference::polygons::{FramedPolygon, PushedPolygon};
use crate::render::reference::splat::RasterSplat;
use crate::render::reference::triangle;
use glam::{Vec3, Vec4};

/// How splats that overlap become one surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlendPasses {
    /// A pass for depth, one for the sums.
    Two,
    /// One pass: nearer than the pixel's depth by more than the offset replaces, within the offset adds, else nothing.
    /// The depth is that of the fragment that came first. Depends on the order of the list.
    DepthThreshold,
    /// One pass: each splat has a range of depth; one wholly before the pixel's range replaces, one that overlaps it
    /// adds and widens it. Depends on the order of the list; ranges chain.
    DepthRange,
}

/// What [`render_fuzzy`] draws: the picture, and the attachments it comes from, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct FuzzyRendering {
    /// The picture. [`Image::depth`], where asked for, holds the view-space distance of [`FuzzyRendering::front`] at pixels that
    /// show something. [`Image::normal`], where asked for, is the mean normal.
    pub image: Image,
    /// Reversed depth after the first pass: of the nearest pushed surface; 0 where nothing is. In one pass: the depth
    /// (of a range its nearest end) that fragments are compared with.
    pub front: Vec<f32>,
    /// Farthest end of the range of [`BlendPasses::DepthRange`], reversed depth; else 0.
    pub back: Vec<f32>,
    /// Sums: red, green, blue times weight, and weight.
    pub sums: Vec<[f32; 4]>,
    /// Sums of normals (view space; with deferred shading turned to the viewer where both sides are lit) and of reversed
    /// depths, times weight. Empty unless shading is deferred or normals are asked for.
    pub normals: Vec<[f32; 4]>,
}

/// Draws `list` as `view` sees it.
///
/// **Depth.** A splat's footprint is that of [`PrimitiveStyle::footprint`], with the depth of its center pushed away from the eye
/// along the ray by `m r / max(|n . v|, 0.1)`: m is [`PrimitiveStyle::depth_offset`], r its radius in view space. The corners of
/// triangles are pushed likewise, by the r of [`PrimitiveStyle::splat_size_px`]. The nearest stays.
///
/// **Blend.** Both again, not pushed; a fragment that is not farther than that depth adds (color * w, w). A
/// triangle has w = 1, a splat w = 1 inside its footprint. With [`PrimitiveStyle::is_gauss`] a splat has w = a exp(-2 rho²), cut
/// at rho = 1, over a footprint that is widened by [`PrimitiveStyle::low_pass_px`]; where its area is known a is such that the
/// weights add up to the pixels that its patch covers, else 1.
///
/// **Normalize.** A pixel whose sum of weights is less than 1e-4 shows the background with alpha 0, any other the mean.
/// With [`FuzzyList::has_coverage`] alpha is the sum of weights, at most 1, where one of 8 neighbors has less than that.
///
/// Degenerate input draws nothing, as in [`crate::render::reference::render`].
pub fn render_fuzzy(
    view: &View,
    list: &FuzzyList,
    style: &PrimitiveStyle,
    passes: BlendPasses,
    outputs: PictureOutputs,
) -> FuzzyRendering {
    render_fuzzy_polygons(view, list, None, style, passes, outputs)
}

/// Draws a list as [`render_fuzzy`] does, and splats from vertices between its triangles and its splats.
///
/// In the first pass such a splat is pushed away by 0.01 m r / max(|n . v|, 0.1), and no triangle is. In the second the place
/// that is compared is pulled towards the eye by 2 s m r / max(|n . v|, 0.1), where s is the sine of the greatest angle of its
/// faces with its plane: two splats of one surface are no farther apart. There it has w = 1, with
/// [`PrimitiveStyle::is_gauss`] w = exp(-2 rho²) for the distance rho from its center over its radius.
pub fn render_fuzzy_polygons(
    view: &View,
    list: &FuzzyList,
    polygons: Option<&[OrientedPolygon]>,
    style: &PrimitiveStyle,
    passes: BlendPasses,
    outputs: PictureOutputs,
) -> FuzzyRendering {
    let frame = ReferenceFrame::new(view, style);
    let mut target = PixelRows::cleared(view, FuzzyPixel::default());
    let (is_pushed, polygons) = (polygons.is_none(), polygons.unwrap_or_default());

    // Depth.
    if passes == BlendPasses::Two {
        target.draw(
            list.triangles,
            |corners| {
                let place = placed_first(&frame, is_pushed);
                triangle::set_up(&frame, (list.vertices, list.textures), *corners, place)
            },
            |pixel, _, sample| pixel.keep_nearest(sample.depth),
        );
        let keep = |pixel: &mut FuzzyPixel, splat: &RasterSplat<f32>, _| {
            pixel.keep_nearest(splat.fragment);
        };
        let place = |polygon: &_| framed(&frame, polygon);
        target.draw(polygons, place, |pixel, _: &FramedPolygon<'_>, sample| {
            pixel.keep_nearest(sample.least_pushed.min(1.0));
        });
        target.draw(list.splats, |s| set_up_pushed(&frame, s), keep);
        target.draw(list.points, |p| set_up_pushed(&frame, &weighted(p)), keep);
    }

    // Blend.
    target.draw(
        list.triangles,
        |corners| {
            triangle::set_up(&frame, (list.vertices, list.textures), *corners, |v| {
                frame.place(v.position)
            })
        },
        |pixel, triangle, sample| {
            let depth = FragmentDepth::flat(sample.depth);
            let add = || share(&frame, &triangle.surface(sample));
            pixel.blend(passes, &depth, 1.0, add);
        },
    );
    target.draw(
        polygons,
        |polygon| framed(&frame, polygon),
        |pixel, polygon: &FramedPolygon<'_>, sample| {
            let own = sample.own.clamp(0.0, 1.0);
            let depth = FragmentDepth {
                tested: sample.pulled.max(own).min(1.0),
                ..FragmentDepth::flat(own)
            };
            let add = || share(&frame, &polygon.pushed.surface(sample));
            pixel.blend(passes, &depth, sample.weight, add);
        },
    );
    let add = |pixel: &mut FuzzyPixel, splat: &RasterSplat<FuzzyFragment>, sample: DiscSample| {
        let splat = &splat.fragment;
        let weight = splat.weight_at(sample.rho_squared);
        pixel.blend(passes, &splat.depth, weight, || splat.share);
    };
    target.draw(list.splats, |s| set_up_blended(&frame, s), add);
    target.draw(list.points, |p| set_up_blended(&frame, &weighted(p)), add);

    let pixels = target.into_pixels();
    let has_normals = style.is_deferred || outputs.normal;
    FuzzyRendering {
        image: normalize::image(&frame, list.has_coverage, outputs, &pixels),
        front: plane(true, &pixels, |pixel| pixel.front),
        back: plane(true, &pixels, |pixel| pixel.back),
        sums: plane(true, &pixels, |pixel| pixel.sum.to_array()),
        normals: plane(has_normals, &pixels, |pixel| pixel.normal.to_array()),
    }
}

/// Places of corners of triangles in the first pass.
fn placed_first<'a>(
    frame: &'a ReferenceFrame<'a>,
    is_pushed: bool,
) -> impl Fn(&Vertex) -> Option<PlacedVertex> + 'a {
    move |vertex| match is_pushed {
        true => place_pushed(frame, vertex),
        false => frame.place(vertex.position),
    }
}

/// A splat from a vertex with its frame; `None` where it covers no pixel or is left out.
fn framed<'a>(
    frame: &'a ReferenceFrame<'a>,
    polygon: &OrientedPolygon,
) -> Option<FramedPolygon<'a>> {
    let pushed = PushedPolygon::new(frame, polygon)?;
    Some(FramedPolygon { pushed, frame })
}

/// What a fragment adds per unit of weight: a color, and a normal in view space.
#[derive(Debug, Clone, Copy)]
struct FragmentShare {
    color: Vec3,
    normal: Vec3,
}

/// Where a fragment lies; all in reversed depth, where nearer is greater.
#[derive(Debug, Clone, Copy)]
struct FragmentDepth {
    own: f32,
    /// Depth that two passes compare with that of the first.
    tested: f32,
    /// Depth of the fragment, farther by the depth offset.
    pushed: f32,
    /// Of the nearest and the farthest point of its patch.
    nearest: f32,
    farthest: f32,
}

impl FragmentDepth {
    /// Of a triangle, which has no extent in depth.
    fn flat(depth: f32) -> Self {
        Self {
            own: depth,
            tested: depth,
            pushed: depth,
            nearest: depth,
            farthest: depth,
        }
    }
}

/// A pixel of the attachments, see [`FuzzyRendering`].
#[derive(Debug, Clone, Copy, Default)]
struct FuzzyPixel {
    front: f32,
    back: f32,
    /// Color times weight, and weight.
    sum: Vec4,
    /// Normal and reversed depth, times weight.
    normal: Vec4,
}

impl FuzzyPixel {
    /// The depth test of the first pass: nearer wins; a depth of 0 or NaN never does.
    fn keep_nearest(&mut self, depth: f32) {
        if depth > self.front {
            self.front = depth;
        }
    }

    /// Adds a fragment, where the passes have it so.
    fn blend(
        &mut self,
        passes: BlendPasses,
        depth: &FragmentDepth,
        weight: f32,
        share: impl FnOnce() -> FragmentShare,
    ) {
        if passes.admit(self, depth) {
            let FragmentShare { color, normal } = share();
            self.sum += (color * weight).extend(weight);
            self.normal += normal.extend(depth.own) * weight;
        }
    }
}

impl BlendPasses {
    /// Tells whether a fragment adds to a pixel. With one pass the pixel is told before what depths it has from now on, and
    /// starts anew where the fragment replaces what is there.
    fn admit(self, pixel: &mut FuzzyPixel, depth: &FragmentDepth) -> bool {
        let is_empty = pixel.front == 0.0;
        match self {
            Self::Two => depth.tested >= pixel.front,
            Self::DepthThreshold => {
                let step = depth.own - depth.pushed;
                if is_empty || depth.own > pixel.front + step {
                    *pixel = FuzzyPixel {
                        front: depth.own,
                        ..FuzzyPixel::default()
                    };
                    return true;
                }
                depth.own > pixel.front - step
            }
            Self::DepthRange => {
                if is_empty || depth.farthest > pixel.front {
                    *pixel = FuzzyPixel {
                        front: depth.nearest,
                        back: depth.farthest,
                        ..FuzzyPixel::default()
                    };
                    return true;
                }
                let overlaps = depth.nearest >= pixel.back;
                if overlaps {
                    pixel.front = pixel.front.max(depth.nearest);
                    pixel.back = pixel.back.min(depth.farthest);
                }
                overlaps
            }
        }
    }
}

#[cfg(test)]
mod tests;
