//! Discs in the plane of the surface as the picture sees them: the quadratic form of `shaders/common/disc.glsl`, a vector of discs
//! at a time, in single precision.

use crate::abi::FrameConstants;
use crate::abi::constants::FLAG_ORTHOGRAPHIC;
use fearless_simd::prelude::*;

type Numbers<S> = <S as Simd>::f32s;

/// Smallest ratio of the axes of a footprint: at a rim normals are unsure, and a line would leave holes.
const LEAST_RATIO: f32 = 0.1;

/// Height of the dome that an opaque splat is, over its radius; see `shaders/common/form.glsl`.
const DOME_HEIGHT: f32 = 0.25;

/// From the plane of a disc to the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OvalScreen {
    /// From model to view space, rows.
    view: [[f32; 4]; 3],
    ray_scale: [f32; 2],
    is_orthographic: bool,
    /// Distance of the near plane.
    near: f32,
    /// Reversed depth is the second over the distance less the first; without perspective the second less the first times the
    /// distance.
    depth: [f32; 2],
}

impl OvalScreen {
    pub(super) fn new(frame: &FrameConstants) -> Self {
        let (view, clip) = (&frame.view_from_model, &frame.clip_from_view);
        Self {
            view: [0, 1, 2].map(|row: usize| [0, 1, 2, 3].map(|column: usize| view[column][row])),
            ray_scale: frame.ray_scale,
            is_orthographic: frame.flags & FLAG_ORTHOGRAPHIC != 0,
            near: clip[3][2] / (1.0 + clip[2][2]),
            depth: [clip[2][2], clip[3][2]],
        }
    }
}

/// Outline of a disc in the plane of the surface. It covers those pixels of its rectangle that lie at offsets o from its center with
/// `form`(o) <= (1 + `skew`.o)^2 on the near side of the horizon of its plane.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct OvalOutline {
    /// xx, twice xy and yy of the form, 1 / pixels^2; 0 of what is a square.
    pub(super) form: [f32; 3],
    /// 1 / pixels.
    pub(super) skew: [f32; 2],
    /// Change of reversed depth, which is affine on the picture of a plane; 1 / pixels.
    pub(super) lean: [f32; 2],
    /// Reversed depth lost per unit of the form.
    pub(super) dome: f32,
    /// From the center to that of the first pixel, pixels.
    pub(super) to_first: [f32; 2],
}

/// Discs of a vector of lanes, model space.
pub(super) struct OvalDiscs<S: Simd> {
    pub(super) center: [Numbers<S>; 3],
    /// Radius; 0 stands for that of the frame's constant size.
    pub(super) radius: Numbers<S>,
    /// Normal of any length; where it is 0 the disc faces the viewer.
    pub(super) normal: [Numbers<S>; 3],
    /// Half the thickness of the patch of surface, over its radius.
    pub(super) thickness: Numbers<S>,
}

/// Footprints of those discs on the picture.
pub(super) struct OvalForms<S: Simd> {
    /// Quadratic form: xx, xy and yy, 1 / pixels^2.
    pub(super) form: [Numbers<S>; 3],
    /// Change of the distance along the ray with the offset, 1 / pixels.
    pub(super) skew: [Numbers<S>; 2],
    /// Change of reversed depth with the offset, 1 / pixels.
    pub(super) lean: [Numbers<S>; 2],
    /// Reversed depth lost per unit of the form.
    pub(super) dome: Numbers<S>,
    /// Width and height of the rectangle around the center that contains them, pixels.
    pub(super) sides: [Numbers<S>; 2],
}

// Functions, as what closures do need not be compiled for the vectors of the function that they are in.

#[inline(always)]
fn dot<S: Simd>(a: [Numbers<S>; 3], b: [Numbers<S>; 3]) -> Numbers<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn turned<S: Simd>(row: &[f32; 4], [x, y, z]: [Numbers<S>; 3]) -> Numbers<S> {
    x * row[0] + y * row[1] + z * row[2]
}

/// Width or height of the rectangle around a footprint, from the inverse of its form along that side, and from the shift of its
/// middle by perspective; see `sides_of` in `shaders/common/form.glsl`.
#[inline(always)]
fn side_of<S: Simd>(inverse: Numbers<S>, shift: Numbers<S>, rest: Numbers<S>) -> Numbers<S> {
    (shift.abs() + (inverse * rest + shift * shift).sqrt()) * 2.0 / rest
}

impl OvalScreen {
    /// Forms of discs. `model_scale`, `focal_px` and `size_px` are those of the frame.
    #[inline(always)]
    pub(super) fn forms<S: Simd>(
        &self,
        simd: S,
        discs: &OvalDiscs<S>,
        [model_scale, focal_px, size_px]: [f32; 3],
    ) -> OvalForms<S> {
        let number = |v: f32| Numbers::<S>::splat(simd, v);
        let (zero, one) = (number(0.0), number(1.0));
        let center = [
            turned::<S>(&self.view[0], discs.center) + self.view[0][3],
            turned::<S>(&self.view[1], discs.center) + self.view[1][3],
            turned::<S>(&self.view[2], discs.center) + self.view[2][3],
        ];
        let distance = match self.is_orthographic {
            true => one,
            false => -center[2],
        };
        let of_frame = distance * (0.5 * size_px / focal_px);
        let has_own = discs.radius.simd_gt(zero);
        let radius = has_own.select(discs.radius * model_scale, of_frame);
        let to_eye = match self.is_orthographic {
            true => [zero, zero, one],
            false => {
                let inverse = number(-1.0) / dot::<S>(center, center).sqrt();
                [
                    center[0] * inverse,
                    center[1] * inverse,
                    center[2] * inverse,
                ]
            }
        };
        let normal = self.footprint_normal(simd, discs, to_eye);
        let [slope, along] = match self.is_orthographic {
            true => {
                let inverse = one / normal[2];
                [[normal[0] * inverse, normal[1] * inverse], [zero, zero]]
            }
            false => {
                let inverse = one / distance;
                let along = [center[0] * inverse, center[1] * inverse];
                let facing = normal[0] * along[0] + normal[1] * along[1] - normal[2];
                [[normal[0] / facing, normal[1] / facing], along]
            }
        };
        // Rays of one pixel to the right and one down meet the plane there, less the ray of the center.
        let unit = distance / radius;
        let scale = [unit * self.ray_scale[0], unit * self.ray_scale[1]];
        let depth = match self.is_orthographic {
            true => -one,
            false => one,
        };
        let x = [
            (one - along[0] * slope[0]) * scale[0],
            -(along[1] * slope[0]) * scale[0],
            depth * slope[0] * scale[0],
        ];
        let y = [
            -(along[0] * slope[1]) * scale[1],
            (one - along[1] * slope[1]) * scale[1],
            depth * slope[1] * scale[1],
        ];
        // What reaches the near plane and may reach behind the eye, where the plane has no picture, is a circle that faces the viewer.
        let nearest = distance - (normal[0] * normal[0] + normal[1] * normal[1]).sqrt() * radius;
        let is_near = match self.is_orthographic {
            true => zero.simd_gt(one),
            false => nearest.simd_le(number(self.near)),
        };
        let extent = radius * focal_px / distance.max(number(self.near));
        let circle = one / (extent * extent);
        let skewed = match self.is_orthographic {
            true => [zero; 2],
            false => [slope[0] * self.ray_scale[0], slope[1] * self.ray_scale[1]],
        };
        let form = [
            is_near.select(circle, dot::<S>(x, x)),
            is_near.select(zero, dot::<S>(x, y)),
            is_near.select(circle, dot::<S>(y, y)),
        ];
        let skew = [
            is_near.select(zero, skewed[0]),
            is_near.select(zero, skewed[1]),
        ];
        let [per_distance, over_distance] = self.depth;
        let lean = match self.is_orthographic {
            true => [
                slope[0] * (-per_distance * self.ray_scale[0]),
                slope[1] * (-per_distance * self.ray_scale[1]),
            ],
            false => {
                let unit = number(over_distance) / distance;
                [skew[0] * unit, skew[1] * unit]
            }
        };
        let height = number(DOME_HEIGHT) / dot::<S>(normal, to_eye);
        let height = radius * height.min(one);
        let dome = match self.is_orthographic {
            true => height * per_distance,
            // Half of the nearest distance at most, lest depth ends behind everything.
            false => {
                let own = height.min(nearest * 0.5) * over_distance / (distance * distance);
                is_near.select(zero, own)
            }
        };
        let determinant = form[0] * form[2] - form[1] * form[1];
        let inverse = [
            form[2] / determinant,
            -(form[1] / determinant),
            form[0] / determinant,
        ];
        let shift = [
            inverse[0] * skew[0] + inverse[1] * skew[1],
            inverse[1] * skew[0] + inverse[2] * skew[1],
        ];
        let rest = one - (skew[0] * shift[0] + skew[1] * shift[1]);
        OvalForms {
            form,
            skew,
            lean,
            dome,
            sides: [
                side_of::<S>(inverse[0], shift[0], rest),
                side_of::<S>(inverse[2], shift[1], rest),
            ],
        }
    }

    /// Computes unit normals of the planes in which the footprints are discs, turned to the eye; the direction to the eye where a
    /// disc has no normal.
    #[inline(always)]
    fn footprint_normal<S: Simd>(
        &self,
        simd: S,
        discs: &OvalDiscs<S>,
        to_eye: [Numbers<S>; 3],
    ) -> [Numbers<S>; 3] {
        let number = |v: f32| Numbers::<S>::splat(simd, v);
        let (zero, one) = (number(0.0), number(1.0));
        let normal = [
            turned::<S>(&self.view[0], discs.normal),
            turned::<S>(&self.view[1], discs.normal),
            turned::<S>(&self.view[2], discs.normal),
        ];
        let length = dot::<S>(normal, normal).sqrt();
        let facing = dot::<S>(normal, to_eye) / length;
        let inverse = one / length;
        let across = [
            normal[0] * inverse - to_eye[0] * facing,
            normal[1] * inverse - to_eye[1] * facing,
            normal[2] * inverse - to_eye[2] * facing,
        ];
        let sine = dot::<S>(across, across).sqrt();
        // Not a number where there is no normal.
        let has_side = sine.simd_ge(number(1e-6));
        let ratio = facing.abs() + discs.thickness * sine;
        let ratio = ratio.max(number(LEAST_RATIO)).min(one);
        let side = (one - ratio * ratio).sqrt() / sine;
        let side = facing.simd_lt(zero).select(-side, side);
        let ratio = has_side.select(ratio, one);
        [
            to_eye[0] * ratio + has_side.select(across[0] * side, zero),
            to_eye[1] * ratio + has_side.select(across[1] * side, zero),
            to_eye[2] * ratio + has_side.select(across[2] * side, zero),
        ]
    }
}
