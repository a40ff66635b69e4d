//! Opaque triangles, splats and points: one depth test, the nearest wins.

use crate::abi::Splat;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{DrawList, Footprint, PrimitiveStyle};
use crate::render::PictureOutputs;
use crate::render::reference::bands::{OpaquePixel, PixelRows, ShownPixel, picture};
use crate::render::reference::disc::{DiscFootprint, DiscSample};
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::polygons;
use crate::render::reference::polygons::PolygonList;
use crate::render::reference::rims;
use crate::render::reference::splat::{PlacedSplat, RasterSplat, SplatFootprint, splat_of_vertex};
use crate::render::reference::square::SquareFootprint;
use crate::render::reference::triangle;

/// Draws `list` as `view` sees it: triangles, then splats, then points, with one depth test (nearer wins,
/// first drawn wins ties).
///
/// A covered pixel has alpha 255; the others show the background with alpha 0. Degenerate input draws
/// nothing and is no error: positions that are not finite, triangles without area once snapped, splats whose
/// radius is NaN, and triangles with an index past the vertices. Splats and points are dropped when their
/// center is nearer than the near or farther than the far plane, but not when it lies beside the picture.
///
/// The light of [`HeadlightSource::Point`](crate::math::camera::HeadlightSource::Point) needs an eye; an orthographic view is lit
/// along the view direction instead.
///
/// Cost: linear in primitives plus covered pixels, on all threads of the rayon pool; the picture does not
/// depend on their number.
pub fn render(
    view: &View,
    list: &DrawList,
    style: &PrimitiveStyle,
    outputs: PictureOutputs,
) -> Image {
    render_with_polygons(view, list, PolygonList::default(), style, outputs)
}

/// Draws a list as [`render`] does, and oriented polygons between its triangles and its splats.
pub fn render_with_polygons(
    view: &View,
    list: &DrawList,
    polygons: PolygonList<'_>,
    style: &PrimitiveStyle,
    outputs: PictureOutputs,
) -> Image {
    let frame = ReferenceFrame::new(view, style);
    let mut target = PixelRows::cleared(
        view,
        OpaquePixel {
            depth: 0.0,
            shown: ShownPixel::background(style),
            patch: None,
        },
    );
    target.draw(
        list.triangles,
        |corners| {
            triangle::set_up(&frame, (list.vertices, list.textures), *corners, |v| {
                frame.place(v.position)
            })
        },
        |pixel, triangle, sample| {
            // Strictly nearer wins, so the first drawn wins ties and a NaN never passes.
            if sample.depth > pixel.depth {
                *pixel = OpaquePixel {
                    depth: sample.depth,
                    shown: frame.shading.shown(&triangle.surface(sample)),
                    patch: None,
                };
            }
        },
    );
    polygons::draw(&frame, &mut target, polygons);
    let put = |pixel: &mut OpaquePixel, splat: &RasterSplat<OpaquePixel>, sample: DiscSample| {
        let mut own = splat.fragment;
        if let Some(distance) = sample.distance {
            own.depth = frame.depth_of(distance);
            own.shown.distance = distance;
        }
        if own.depth > pixel.depth {
            *pixel = own;
        }
    };
    target.draw(list.splats, |s| set_up(&frame, s), put);
    target.draw(list.points, |p| set_up(&frame, &splat_of_vertex(p)), put);
    let mut pixels = target.into_pixels();
    if polygons.covers_rims {
        rims::cover(&frame, &mut pixels, polygons);
    }
    picture(view, outputs, |i| pixels[i].shown)
}

/// A splat; `None` when it covers no pixel.
pub(super) fn set_up(frame: &ReferenceFrame, splat: &Splat) -> Option<RasterSplat<OpaquePixel>> {
    let seen = PlacedSplat::new(frame, splat)?;
    let footprint = match frame.style.footprint {
        Footprint::Square => {
            let side_px = side_px(frame, splat.radius.model_units(), seen.placed.distance);
            SplatFootprint::Square(SquareFootprint::around(frame, &seen.placed, side_px)?)
        }
        Footprint::Circle => {
            let radius_px = seen.radius_px(frame);
            SplatFootprint::Disc(DiscFootprint::circle(frame, seen.patch.center, radius_px)?)
        }
        Footprint::Oriented => SplatFootprint::Disc(DiscFootprint::new(frame, &seen.patch, 0.0)?),
    };
    Some(RasterSplat {
        footprint,
        fragment: OpaquePixel {
            depth: seen.placed.depth(),
            shown: frame.shading.shown(&seen.point),
            patch: None,
        },
    })
}

/// The side of a square before the lower bound of 1 pixel, in single precision as in the vertex shader: that of the frame
/// for radius 0, else the projected diameter.
fn side_px(frame: &ReferenceFrame, radius: f32, distance: f32) -> f32 {
    if radius > 0.0 {
        let view = frame.view;
        let side = 2.0 * (view.focal_px() * view.model_scale) * radius;
        if view.is_perspective {
            side / distance
        } else {
            side
        }
    } else {
        frame.style.splat_size_px
    }
}
