//! Discs in the plane of the surface as the picture sees them: the quadratic form of `shaders/common/disc.glsl`, in its order
//! and in single precision.

use crate::abi::constants::FLAG_ORTHOGRAPHIC;
use crate::abi::{FrameConstants, Splat};
use crate::math::octahedral;
use crate::render::cpu::opaque::Screen;
use crate::render::cpu::opaque::splat_bounds::LEAST_ROUND_PX;
use glam::{Mat3, Mat4, Vec2, Vec3};

/// Smallest ratio of the axes of a footprint: at a rim normals are unsure, and a line would leave holes.
const LEAST_RATIO: f32 = 0.1;

/// What the outline of a disc is drawn larger by than it is, pixels, so that rounding cuts none of its pixels off.
const SLACK_PX: f32 = 1.0 / 64.0;

/// From the plane of a disc to the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OvalScreen {
    view_from_model: Mat4,
    /// Turns directions of model space to view space, unit ones to unit ones.
    turn: Mat3,
    ray_scale: Vec2,
    is_orthographic: bool,
    /// Distance of the near plane.
    near: f32,
    /// Sum of the slopes along x and y of the steepest ray of the picture, and a little; 0 for parallel rays.
    most_slope: f32,
}

impl OvalScreen {
    pub(super) fn new(frame: &FrameConstants, rect_px: [u32; 4]) -> Self {
        let view_from_model = Mat4::from_cols_array_2d(&frame.view_from_model);
        let clip = &frame.clip_from_view;
        let is_orthographic = frame.flags & FLAG_ORTHOGRAPHIC != 0;
        let slope = |i: usize, [low, high]: [u32; 2]| {
            let at = |px: f32| (px * frame.ray_scale[i] + frame.ray_offset[i]).abs();
            at(low as f32 - 1.0).max(at(high as f32 + 1.0))
        };
        let [left, top, right, bottom] = rect_px;
        Self {
            view_from_model,
            turn: Mat3::from_mat4(view_from_model) * (1.0 / frame.model_scale),
            ray_scale: Vec2::from(frame.ray_scale),
            is_orthographic,
            most_slope: match is_orthographic {
                true => 0.0,
                false => slope(0, [left, right]) + slope(1, [top, bottom]),
            },
            near: clip[3][2] / (1.0 + clip[2][2]),
        }
    }
}

/// Which pixels of its rectangle a disc in the plane of the surface covers: those at offsets o from its center with
/// `form`(o) <= (1 + `skew`.o)^2 on the near side of the horizon of its plane.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct OvalOutline {
    /// xx, twice xy and yy of the form, 1 / pixels^2; 0 of what is a square.
    pub(super) form: [f32; 3],
    /// 1 / pixels.
    pub(super) skew: [f32; 2],
    /// From the center to that of the first pixel, pixels.
    pub(super) to_first: [f32; 2],
}

/// A disc where the frame sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlacedOval {
    pub(super) oval: OvalOutline,
    /// Pixels that it may cover, from the corner of the rectangle that is drawn in: first, and one past the last.
    pub(super) first: [u16; 2],
    pub(super) end: [u16; 2],
    /// Reversed depth.
    pub(super) depth: f32,
}

/// Where the disc of a splat is; `None` where it covers nothing.
pub(super) fn placed(screen: &Screen, splat: &Splat) -> Option<PlacedOval> {
    let Vec3 { x, y, z } = splat.center;
    let times = |row: &[f32; 4]| x * row[0] + (y * row[1] + (z * row[2] + row[3]));
    let in_view = times(&screen.along);
    let depth = in_view * screen.depth[0] + screen.depth[1];
    let last = in_view * screen.last[0] + screen.last[1];
    // The view volume in depth, and nothing that is not finite.
    if !(depth >= 0.0 && depth <= last && last > 0.0) {
        return None;
    }
    let window = screen.window.map(|row| times(&row) / last);
    let (form, skew) = match is_below_a_pixel(screen, splat, last, window) {
        true => (Vec3::INFINITY, Vec2::ZERO),
        false => form_of(screen, splat),
    };
    let sides = match form == Vec3::INFINITY {
        true => [0.0; 2],
        false => sides_of(form, skew),
    };
    // What is nothing at all has no number for a side.
    let is_round = sides[0].max(sides[1]) >= LEAST_ROUND_PX;
    let [left, top, right, bottom] = screen.rect_px;
    let (mut first, mut end, mut to_first) = ([0; 2], [0; 2], [0.0; 2]);
    for (i, (low, high)) in [(left, right), (top, bottom)].into_iter().enumerate() {
        let [from, to] = if is_round {
            let reach = 0.5 * (sides[i] + SLACK_PX);
            [
                (window[i] - reach - 0.5).ceil(),
                (window[i] + reach + 0.5).floor(),
            ]
        } else {
            // A square of a pixel at least, in steps of 1/256 pixel.
            let side = sides[0].max(sides[1]).max(1.0);
            let steps = (side * 256.0).round_ties_even();
            let low = (window[i] * 256.0).round_ties_even() - (steps * 0.5).floor() + 127.0;
            [(low / 256.0).floor(), ((low + steps) / 256.0).floor()]
        };
        let [low, high] = [low as f32, high as f32];
        let [from, to] = [from.max(low).min(high), to.max(low).min(high)];
        // What is no number has become the first pixel twice.
        if from >= to {
            return None;
        }
        first[i] = (from - low) as u16;
        end[i] = (to - low) as u16;
        to_first[i] = from + 0.5 - window[i];
    }
    let oval = match is_round {
        true => OvalOutline {
            form: [form.x, 2.0 * form.y, form.z],
            skew: skew.to_array(),
            to_first,
        },
        false => OvalOutline::default(),
    };
    Some(PlacedOval {
        oval,
        first,
        end,
        depth: depth / last,
    })
}

/// Whether the disc of a splat is certainly narrower than a pixel, so that its form does not matter: a ball of radius r at a
/// distance of z reaches at most f r (1 + s) / (z - r) from its center on the picture, s the slope of the ray there.
fn is_below_a_pixel(screen: &Screen, splat: &Splat, last: f32, window: [f32; 2]) -> bool {
    let [left, top, right, bottom] = screen.rect_px.map(|edge| edge as f32);
    let is_near_picture = window[0] >= left - 1.0
        && window[0] <= right + 1.0
        && window[1] >= top - 1.0
        && window[1] <= bottom + 1.0;
    let radius = splat.radius * screen.model_scale;
    let reach = screen.focal_px * radius * (1.0 + screen.ovals.most_slope);
    let room = match screen.ovals.is_orthographic {
        true => 1.0,
        false => last - radius,
    };
    is_near_picture && splat.radius > 0.0 && 2.0 * reach < room
}

/// Form (xx, xy, yy) and skew of the disc of a splat.
fn form_of(screen: &Screen, splat: &Splat) -> (Vec3, Vec2) {
    let rays = &screen.ovals;
    let center = rays.view_from_model.transform_point3(splat.center);
    let distance = match rays.is_orthographic {
        true => 1.0,
        false => -center.z,
    };
    let radius = match splat.radius > 0.0 {
        true => splat.radius * screen.model_scale,
        false => 0.5 * screen.size_px * distance / screen.focal_px,
    };
    if !rays.is_orthographic && distance - radius <= rays.near {
        // It may reach behind the eye, where the plane has no picture: a circle that faces the viewer.
        let extent = radius * screen.focal_px / distance.max(rays.near);
        return (Vec3::new(1.0, 0.0, 1.0) / (extent * extent), Vec2::ZERO);
    }
    let normal = footprint_normal(rays, splat, center);
    let (x, y, skew) = if rays.is_orthographic {
        (
            Vec3::new(1.0, 0.0, -normal.x / normal.z),
            Vec3::new(0.0, 1.0, -normal.y / normal.z),
            Vec2::ZERO,
        )
    } else {
        let along = center / distance;
        let slope = normal.truncate() / normal.dot(along);
        (
            Vec3::X - along * slope.x,
            Vec3::Y - along * slope.y,
            slope * rays.ray_scale,
        )
    };
    let x = x * (rays.ray_scale.x * distance / radius);
    let y = y * (rays.ray_scale.y * distance / radius);
    (Vec3::new(x.dot(x), x.dot(y), y.dot(y)), skew)
}

/// Normal of the plane in which the footprint of a patch is a disc, turned to the eye; that direction where there is none.
fn footprint_normal(rays: &OvalScreen, splat: &Splat, center: Vec3) -> Vec3 {
    let to_eye = match rays.is_orthographic {
        true => Vec3::Z,
        false => -center.normalize(),
    };
    let alpha = splat.color[3];
    if alpha == 0 {
        return to_eye;
    }
    let normal = rays.turn * octahedral::decode(splat.normal);
    let facing = normal.dot(to_eye);
    let across = normal - facing * to_eye;
    let sine = across.length();
    if sine < 1e-6 {
        return to_eye;
    }
    let thickness = f32::from(255 - alpha) / 254.0;
    let ratio = (facing.abs() + thickness * sine).clamp(LEAST_RATIO, 1.0);
    let side = if facing < 0.0 { -across } else { across };
    ratio * to_eye + (1.0 - ratio * ratio).sqrt() * (side / sine)
}

/// Width and height of the rectangle around the center that contains the disc.
fn sides_of(form: Vec3, skew: Vec2) -> [f32; 2] {
    let inverse = Vec3::new(form.z, -form.y, form.x) / (form.x * form.z - form.y * form.y);
    let shift = [
        inverse.x * skew.x + inverse.y * skew.y,
        inverse.y * skew.x + inverse.z * skew.y,
    ];
    let rest = 1.0 - (skew.x * shift[0] + skew.y * shift[1]);
    [(inverse.x, shift[0]), (inverse.z, shift[1])]
        .map(|(own, shift)| 2.0 * (shift.abs() + (own * rest + shift * shift).sqrt()) / rest)
}
