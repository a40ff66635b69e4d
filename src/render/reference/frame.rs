//! The constants of a frame: the vertex shader, the viewport, and the grid that window positions are snapped to.

use crate::math::camera::View;
use crate::pack::PrimitiveStyle;
use crate::render::reference::shade::SurfaceShading;
use glam::{DVec3, Mat4, Vec3, Vec4};
use std::ops::{Range, RangeInclusive};

/// Binary places of a window position after snapping (`subPixelPrecisionBits`): Vulkan asks for 4 at least; with more
/// than 8 the edge functions of the rasterizer could leave 62 bits.
const SUBPIXEL_BITS: RangeInclusive<u32> = 4..=8;

/// The grid of snapped window positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct SubpixelGrid {
    /// Steps in one pixel.
    pub(super) steps: i64,
}

impl SubpixelGrid {
    /// A grid of so many binary places a pixel, brought into 4..=8.
    pub(super) fn new(bits: u32) -> Self {
        Self {
            steps: 1 << bits.clamp(*SUBPIXEL_BITS.start(), *SUBPIXEL_BITS.end()),
        }
    }

    /// The nearest step of a window coordinate; the cast saturates far outside of every picture.
    pub(super) fn snap(self, coordinate_px: f64) -> i64 {
        (coordinate_px * self.steps as f64).round() as i64
    }

    /// The pixels whose centers lie in `low..high` (steps), within `0..size`.
    pub(super) fn pixels_between(self, low: i64, high: i64, size: u32) -> Range<u32> {
        let steps = self.steps;
        // Center of pixel i: i * steps + steps / 2 >= low  <=>  i >= ceil((low - steps / 2) / steps).
        let first_at = |edge: i64| (edge - steps / 2 + steps - 1).div_euclid(steps);
        let clamp = |i: i64| i.clamp(0, i64::from(size)) as u32;
        clamp(first_at(low))..clamp(first_at(high))
    }
}

/// The constants of a frame.
pub(super) struct ReferenceFrame<'a> {
    pub(super) view: &'a View,
    pub(super) style: &'a PrimitiveStyle,
    pub(super) shading: SurfaceShading,
    pub(super) grid: SubpixelGrid,
    /// The view mirrors: what is counter-clockwise in the world is clockwise in the picture.
    pub(super) is_mirrored: bool,
    clip_from_view: Mat4,
}

/// A vertex after the vertex shader.
#[derive(Clone, Copy)]
pub(super) struct PlacedVertex {
    /// Clip space of the device: y down, reversed depth.
    pub(super) clip: Vec4,
    /// Distance along the view direction.
    pub(super) distance: f32,
}

impl PlacedVertex {
    /// Reversed depth, within 0..=1.
    pub(super) fn depth(&self) -> f32 {
        (self.clip.z / self.clip.w).clamp(0.0, 1.0)
    }
}

impl ReferenceFrame<'_> {
    /// Reversed depth of what lies so far along the view direction, within 0..=1.
    pub(super) fn depth_of(&self, distance: f32) -> f32 {
        let clip = self.clip_from_view * Vec4::new(0.0, 0.0, -distance, 1.0);
        (clip.z / clip.w).clamp(0.0, 1.0)
    }
}

impl<'a> ReferenceFrame<'a> {
    pub(super) fn new(view: &'a View, style: &'a PrimitiveStyle) -> Self {
        let [sx, sy] = view.scale;
        Self {
            view,
            style,
            shading: SurfaceShading::new(view, style),
            grid: SubpixelGrid::new(style.subpixel_bits),
            is_mirrored: view.view_from_model.determinant() * sx * sy < 0.0,
            clip_from_view: view.clip_from_view(),
        }
    }

    /// The vertex shader: single precision, matrix by matrix. `None` when the result is not finite.
    pub(super) fn place(&self, position: Vec3) -> Option<PlacedVertex> {
        self.project(self.view.view_from_model.transform_point3(position))
    }

    /// The second half of the vertex shader. `None` when the result is not finite.
    pub(super) fn project(&self, in_view: Vec3) -> Option<PlacedVertex> {
        let clip = self.clip_from_view * in_view.extend(1.0);
        clip.is_finite().then_some(PlacedVertex {
            clip,
            distance: -in_view.z,
        })
    }

    /// The viewport transform: pixels, x right, y down, pixel centers at halves.
    pub(super) fn window(&self, x_ndc: f64, y_ndc: f64) -> [f64; 2] {
        [
            (x_ndc + 1.0) / 2.0 * f64::from(self.view.width),
            (y_ndc + 1.0) / 2.0 * f64::from(self.view.height),
        ]
    }

    /// Unit vector from a view-space point to the eye, zero in the eye itself; without perspective the direction to
    /// the viewer.
    pub(super) fn to_eye(&self, in_view: DVec3) -> DVec3 {
        if self.view.is_perspective {
            (-in_view).normalize_or_zero()
        } else {
            DVec3::Z
        }
    }

    /// A view-space point, pushed away from the eye by a view-space length; a point in the eye itself stays.
    pub(super) fn pushed(&self, in_view: Vec3, by: f32) -> Vec3 {
        if !self.view.is_perspective {
            return in_view - Vec3::new(0.0, 0.0, by);
        }
        let length = in_view.length();
        if length > 0.0 {
            // The factor is exactly 1 for an offset of 0: a splat is never behind itself.
            in_view * ((length + by) / length)
        } else {
            in_view
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_those_whose_centers_lie_in_the_half_open_range() {
        for bits in [4, 6, 8] {
            let grid = SubpixelGrid::new(bits);
            let steps = grid.steps;
            assert_eq!(steps, 1 << bits);
            for low in -3 * steps..3 * steps {
                for width in [0, 1, steps / 2, steps - 1, steps, steps + 1, 2 * steps + 88] {
                    let is_in = |i: &u32| {
                        let center = i64::from(*i) * steps + steps / 2;
                        (low..low + width).contains(&center)
                    };
                    let expected: Vec<u32> = (0..3).filter(is_in).collect();
                    let got: Vec<u32> = grid.pixels_between(low, low + width, 3).collect();
                    assert_eq!(got, expected, "{bits} bits: {low} {width}");
                }
            }
        }
    }

    /// A place that two grids see on two sides of a pixel's center, and what has no grid at all.
    #[test]
    fn coarse_grids_snap_coarsely_and_bits_stay_in_their_range() {
        let [coarse, fine] = [4, 8].map(SubpixelGrid::new);
        // 10.48 pixels: 2683 / 256 lies before the center at 10.5, 168 / 16 is the center.
        assert_eq!((fine.snap(10.48), coarse.snap(10.48)), (2683, 168));
        let first = |grid: SubpixelGrid| grid.pixels_between(grid.snap(10.52), 1 << 20, 64).start;
        assert_eq!((first(fine), first(coarse)), (11, 10));
        for (bits, steps) in [(0, 16), (3, 16), (9, 256), (u32::MAX, 256)] {
            assert_eq!(SubpixelGrid::new(bits).steps, steps);
        }
    }
}
