//! Fuzzy splats and their triangles as the rasterizer takes them, in each of the two passes.

use crate::abi::{Vertex, WeightedSplat, constants};
use crate::math::octahedral;
use crate::pack::{ColorBy, Footprint, SurfaceLighting};
use crate::render::reference::disc::{DiscFootprint, SurfacePatch};
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use crate::render::reference::fuzzy::{FragmentDepth, FragmentShare};
use crate::render::reference::shade::{SPLAT_TINT, SurfaceKind, SurfacePoint, TRIANGLE_TINT};
use crate::render::reference::splat::{PlacedSplat, RasterSplat, SplatFootprint, splat_of_vertex};
use crate::render::reference::square::SquareFootprint;
use glam::{DVec3, Vec3};

/// Least |cosine| by which depth offsets are divided.
const LEAST_COSINE: f64 = 0.1;
/// Least cosine under which a patch is taken to be seen, where weights are areas.
const LEAST_FACING: f64 = 0.02;
/// Least weight in the middle, where weights are areas.
pub(super) const LEAST_DEPOSIT: f64 = 1e-3;

/// What a splat leaves in a pixel.
#[derive(Debug, Clone, Copy)]
pub(in crate::render::reference) struct FuzzyFragment {
    pub(super) depth: FragmentDepth,
    /// Weight in the middle.
    pub(super) weight: f64,
    is_gauss: bool,
    pub(super) share: FragmentShare,
}

impl FuzzyFragment {
    /// The weight at the square of a distance from the center in radii.
    pub(super) fn weight_at(&self, rho_squared: f64) -> f32 {
        let kernel = if self.is_gauss {
            (-2.0 * rho_squared).exp()
        } else {
            1.0
        };
        (self.weight * kernel) as f32
    }
}

/// A vertex as a splat of the frame's constant size: what it stands for is unknown.
pub(in crate::render::reference) fn weighted(vertex: &Vertex) -> WeightedSplat {
    WeightedSplat {
        splat: splat_of_vertex(vertex),
        area: -1.0,
    }
}

/// A splat in the first pass: its pixels, and its pushed depth.
pub(super) fn set_up_pushed(
    frame: &ReferenceFrame,
    weighted: &WeightedSplat,
) -> Option<RasterSplat<f32>> {
    let ready = set_up(frame, weighted, None)?;
    Some(RasterSplat {
        footprint: ready.footprint,
        fragment: ready.fragment.depth.pushed,
    })
}

/// A splat in the second pass: its footprint is widened.
pub(in crate::render::reference) fn set_up_blended(
    frame: &ReferenceFrame,
    weighted: &WeightedSplat,
) -> Option<RasterSplat<FuzzyFragment>> {
    set_up(frame, weighted, Some(f64::from(frame.style.low_pass_px)))
}

/// `low_pass_px` is that of the blend pass; `None` for the first.
fn set_up(
    frame: &ReferenceFrame,
    weighted: &WeightedSplat,
    low_pass_px: Option<f64>,
) -> Option<RasterSplat<FuzzyFragment>> {
    let WeightedSplat { splat, area } = weighted;
    let is_gauss = frame.style.is_gauss;
    let seen = PlacedSplat::new(frame, splat)?;
    let patch = &seen.patch;
    let footprint = footprint(frame, &seen, low_pass_px)?;
    let facing = if patch.normal == DVec3::ZERO {
        1.0
    } else {
        patch
            .normal
            .dot(frame.to_eye(patch.center.as_dvec3()))
            .abs()
    };
    let weight = match &footprint {
        SplatFootprint::Disc(disc) if is_gauss && *area >= 0.0 => {
            let covered_px = area_px(frame, patch, f64::from(*area), facing);
            (covered_px / disc.gaussian_px()).max(LEAST_DEPOSIT)
        }
        // A Gaussian is round.
        SplatFootprint::Square(_) if is_gauss && *area >= 0.0 => return None,
        _ => 1.0,
    };
    Some(RasterSplat {
        footprint,
        fragment: FuzzyFragment {
            depth: depth_of(frame, &seen, facing),
            weight,
            is_gauss,
            share: share(frame, &seen.point),
        },
    })
}

/// The pixels of a splat in a pass.
fn footprint(
    frame: &ReferenceFrame,
    seen: &PlacedSplat,
    low_pass_px: Option<f64>,
) -> Option<SplatFootprint> {
    let radius_px = seen.radius_px(frame);
    let disc = match frame.style.footprint {
        Footprint::Square => {
            let side_px = (2.0 * radius_px) as f32;
            let square = SquareFootprint::around(frame, &seen.placed, side_px);
            return square.map(SplatFootprint::Square);
        }
        Footprint::Circle => DiscFootprint::circle(frame, seen.patch.center, radius_px),
        Footprint::Oriented => match low_pass_px {
            // A Gaussian hides what is behind its own footprint only: there its kernel is never 0.
            None if frame.style.is_gauss => DiscFootprint::exact(frame, &seen.patch),
            low_pass => DiscFootprint::new(frame, &seen.patch, low_pass.unwrap_or(0.0)),
        },
    };
    disc.map(SplatFootprint::Disc)
}

/// Where a splat lies, seen under a cosine.
fn depth_of(frame: &ReferenceFrame, seen: &PlacedSplat, facing: f64) -> FragmentDepth {
    let (patch, center) = (&seen.patch, seen.patch.center);
    let depth_at = |in_view: Vec3| frame.project(in_view).map_or(0.0, |p| p.depth());
    let offset = f64::from(frame.style.depth_offset) * patch.radius / facing.max(LEAST_COSINE);
    // The extent of a disc along the view axis (methods 8.4).
    let half = (patch.radius * (1.0 - patch.normal.z * patch.normal.z).max(0.0).sqrt()) as f32;
    let moved = |by: f32| {
        let z = (seen.placed.distance + by).max(frame.view.near);
        depth_at(Vec3::new(center.x, center.y, -z))
    };
    FragmentDepth {
        own: seen.placed.depth(),
        tested: seen.placed.depth(),
        pushed: depth_at(frame.pushed(center, offset as f32)),
        nearest: moved(-half),
        farthest: moved(half),
    }
}

/// The pixels that a patch of surface covers: f² A (n . v) |c| / z³, with the cosine of a patch of some thickness.
fn area_px(frame: &ReferenceFrame, patch: &SurfacePatch, area: f64, facing: f64) -> f64 {
    let facing = facing.hypot(patch.thickness).clamp(LEAST_FACING, 1.0);
    let scale = f64::from(frame.view.focal_px()) * f64::from(frame.view.model_scale);
    if frame.view.is_perspective {
        let center = patch.center.as_dvec3();
        let z = -center.z;
        area * facing * (scale / z).powi(2) * center.length() / z
    } else {
        area * facing * scale * scale
    }
}

/// Shaded, or with deferred shading what is to be shaded: the base color, and the normal turned to the viewer where both
/// sides are lit, so that they do not cancel. In the light of a lamp only what is certainly seen from behind is turned.
pub(super) fn share(frame: &ReferenceFrame, point: &SurfacePoint) -> FragmentShare {
    let (style, view) = (frame.style, frame.view.view_from_model.as_dmat4());
    let in_view = view.transform_vector3(point.normal) / f64::from(frame.view.model_scale);
    if !style.is_deferred {
        return FragmentShare {
            color: frame.shading.value(point).as_vec3(),
            normal: in_view.as_vec3(),
        };
    }
    let color = match (style.color_by, point.kind) {
        (ColorBy::Primitive, SurfaceKind::Triangle) => TRIANGLE_TINT,
        (ColorBy::Primitive, SurfaceKind::Splat | SurfaceKind::Patch) => SPLAT_TINT,
        _ => point.color,
    };
    let cosine = in_view.dot(frame.to_eye(view.transform_point3(point.position)));
    let is_back = match style.light {
        SurfaceLighting::Headlight => cosine < 0.0,
        SurfaceLighting::Phong(_) | SurfaceLighting::Sphere(_) => {
            cosine < -f64::from(constants::LEAST_BACK) && !style.cull_back_faces
        }
    };
    let is_turned = style.two_sided && is_back;
    FragmentShare {
        color: color.as_vec3(),
        normal: if is_turned { -in_view } else { in_view }.as_vec3(),
    }
}

/// The vertex shader of the first pass. `None` when the result is not finite.
pub(super) fn place_pushed(frame: &ReferenceFrame, vertex: &Vertex) -> Option<PlacedVertex> {
    let view = frame.view;
    let in_view = view.view_from_model.transform_point3(vertex.position);
    let cosine = if vertex.color[3] == 0 {
        1.0
    } else {
        let normal = view
            .view_from_model
            .transform_vector3(octahedral::decode(vertex.normal))
            .normalize_or_zero();
        let to_eye = if view.is_perspective {
            (-in_view).normalize_or_zero()
        } else {
            Vec3::Z
        };
        normal.dot(to_eye).abs()
    };
    let distance = if view.is_perspective {
        // What lies behind the eye stays: large splats would pull it through the eye.
        (-in_view.z).max(0.0)
    } else {
        1.0
    };
    let radius = frame.style.depth_offset * frame.style.splat_size_px.max(1.0) * distance
        / (2.0 * view.focal_px());
    frame.project(frame.pushed(in_view, radius / cosine.max(LEAST_COSINE as f32)))
}
