//! Splats of constant depth: what the frame makes of a record, and the pixels of its square, disc or ellipse (methods 7).

use crate::abi::{Splat, SplatRadius, Vertex};
use crate::render::reference::bands::PixelCoverage;
use crate::render::reference::disc::{DiscFootprint, DiscSample, SurfacePatch, thickness_of};
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame};
use crate::render::reference::shade::SurfacePoint;
use crate::render::reference::square::SquareFootprint;
use glam::DVec3;
use std::ops::Range;

/// A vertex as a splat of the constant size of the frame.
pub(super) fn splat_of_vertex(vertex: &Vertex) -> Splat {
    Splat {
        center: vertex.position,
        radius: SplatRadius::OF_FRAME,
        normal: vertex.normal,
        color: vertex.color,
    }
}

/// A splat as the frame sees it.
pub(super) struct PlacedSplat {
    /// Center of the splat.
    pub(super) placed: PlacedVertex,
    /// The patch of surface it stands for, in view space; a radius of 0 is the constant size of the frame.
    pub(super) patch: SurfacePatch,
    /// What is shaded.
    pub(super) point: SurfacePoint,
}

impl PlacedSplat {
    /// `None` when the center lies before the near or behind the far plane, or it is no place, or the radius no number.
    pub(super) fn new(frame: &ReferenceFrame, splat: &Splat) -> Option<Self> {
        let placed = frame.place(splat.center)?;
        let distance = placed.distance;
        let view = frame.view;
        let own = splat.radius.model_units();
        if !(distance >= view.near && distance <= view.far) || own.is_nan() {
            return None;
        }
        let point = SurfacePoint::of_splat(splat, distance);
        let scale = f64::from(view.model_scale);
        let radius = if own > 0.0 {
            f64::from(own) * scale
        } else {
            let depth = if view.is_perspective { distance } else { 1.0 };
            0.5 * f64::from(frame.style.splat_size_px) * f64::from(depth)
                / f64::from(view.focal_px())
        };
        let normal: DVec3 = view
            .view_from_model
            .as_dmat4()
            .transform_vector3(point.normal)
            / scale;
        Some(Self {
            placed,
            patch: SurfacePatch {
                center: view.view_from_model.transform_point3(splat.center),
                normal,
                radius,
                thickness: thickness_of(splat.color),
            },
            point,
        })
    }

    /// Radius in pixels of a facing disc in the middle of the picture.
    pub(super) fn radius_px(&self, frame: &ReferenceFrame) -> f64 {
        let scale = if frame.view.is_perspective {
            f64::from(self.placed.distance)
        } else {
            1.0
        };
        self.patch.radius * f64::from(frame.view.focal_px()) / scale
    }
}

/// The pixels of a splat.
pub(super) enum SplatFootprint {
    Square(SquareFootprint),
    Disc(DiscFootprint),
}

/// A splat ready to be drawn: its pixels, and what it leaves in each.
pub(super) struct RasterSplat<F> {
    pub(super) footprint: SplatFootprint,
    pub(super) fragment: F,
}

impl<F> PixelCoverage for RasterSplat<F> {
    type Sample = DiscSample;

    fn rows(&self) -> Range<u32> {
        match &self.footprint {
            SplatFootprint::Square(square) => square.rows.clone(),
            SplatFootprint::Disc(disc) => disc.rows.clone(),
        }
    }

    fn columns(&self, _y: u32) -> Range<u32> {
        match &self.footprint {
            SplatFootprint::Square(square) => square.columns.clone(),
            SplatFootprint::Disc(disc) => disc.columns.clone(),
        }
    }

    fn sample(&self, x: u32, y: u32) -> Option<DiscSample> {
        match &self.footprint {
            SplatFootprint::Square(_) => Some(DiscSample::default()),
            SplatFootprint::Disc(disc) => disc.sample(x, y),
        }
    }
}
