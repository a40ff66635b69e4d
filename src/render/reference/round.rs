//! Discs and ellipses: round splats of constant depth that hide what is behind (methods 7, "circle" and 7.2).

use crate::abi::{Splat, Vertex};
use crate::pack::Footprint;
use crate::render::reference::disc::{Disc, Patch, thickness_of};
use crate::render::reference::shade::{Kind, color_of, normal_of};
use crate::render::reference::target::{Band, Fragment};
use crate::render::reference::{Frame, Placed};
use glam::{DVec3, Vec3};

/// A round splat ready to be drawn.
pub(super) struct Round {
    pub(super) disc: Disc,
    /// Reversed depth of the center.
    pub(super) depth: f32,
    pub(super) fragment: Fragment,
}

/// A splat; radius 0 asks for the constant size of the frame.
pub(super) fn of_splat(frame: &Frame, splat: &Splat) -> Option<Round> {
    set_up(frame, splat.center, splat.radius, splat.normal, splat.color)
}

/// A vertex as a point of the constant size of the frame.
pub(super) fn of_point(frame: &Frame, point: &Vertex) -> Option<Round> {
    set_up(frame, point.position, 0.0, point.normal, point.color)
}

fn set_up(
    frame: &Frame,
    center: Vec3,
    radius: f32,
    normal: [i16; 2],
    color: [u8; 4],
) -> Option<Round> {
    let (patch, placed) = patch(frame, center, radius, normal, color)?;
    let disc = match frame.style.footprint {
        Footprint::Oriented => Disc::new(frame, &patch, 0.0)?,
        Footprint::Square | Footprint::Circle => Disc::circle(
            frame,
            patch.center,
            radius_px(frame, &patch, placed.distance),
        )?,
    };
    let normal = normal_of(normal, color);
    Some(Round {
        disc,
        depth: (placed.clip.z / placed.clip.w).clamp(0.0, 1.0),
        fragment: Fragment {
            color: frame
                .shading
                .color(Kind::Splat, center.as_dvec3(), normal, color_of(color)),
            normal: normal.as_vec3().to_array(),
            distance: placed.distance,
        },
    })
}

/// Radius in pixels of a facing disc in the middle of the picture.
pub(super) fn radius_px(frame: &Frame, patch: &Patch, distance: f32) -> f64 {
    let scale = if frame.view.is_perspective {
        f64::from(distance)
    } else {
        1.0
    };
    patch.radius * f64::from(frame.view.focal_px()) / scale
}

/// A record in view space; `None` when its center lies before the near or behind the far plane, or it is no place.
pub(super) fn patch(
    frame: &Frame,
    center: Vec3,
    radius: f32,
    normal: [i16; 2],
    color: [u8; 4],
) -> Option<(Patch, Placed)> {
    let placed = frame.place(center)?;
    let distance = placed.distance;
    if !(distance >= frame.view.near && distance <= frame.view.far) || radius.is_nan() {
        return None;
    }
    let view = frame.view;
    let scale = f64::from(view.model_scale);
    let radius = if radius > 0.0 {
        f64::from(radius) * scale
    } else {
        let depth = if view.is_perspective { distance } else { 1.0 };
        0.5 * f64::from(frame.style.splat_size_px) * f64::from(depth) / f64::from(view.focal_px())
    };
    let normal = normal_of(normal, color);
    let in_view: DVec3 = view.view_from_model.as_dmat4().transform_vector3(normal) / scale;
    Some((
        Patch {
            center: view.view_from_model.transform_point3(center),
            normal: in_view,
            radius,
            thickness: thickness_of(color),
        },
        placed,
    ))
}

/// Draws the rows of a round splat that lie in the band.
pub(super) fn rasterize(round: &Round, band: &mut Band) {
    let rows = band.rows(&round.disc.rows);
    round.disc.for_each_pixel(rows, |x, y, _| {
        band.put(x, y, round.depth, || round.fragment);
    });
}
