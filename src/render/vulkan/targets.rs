//! What a frame draws into, and what its passes share.

use crate::gpu::frame::{Load, Pass};
use crate::gpu::image::{Format, Image as Target};
use crate::gpu::{Error, Gpu};
pub(crate) use crate::render::frame_constants::FrameContext as Context;
use crate::render::vulkan::{NORMAL, triangles};
use std::sync::Arc;

/// The targets of a frame.
#[derive(Debug)]
pub(crate) struct Targets {
    pub(super) color: Target,
    pub(super) depth: Target,
    pub(super) normal: Option<Target>,
}

impl Targets {
    /// Targets of `width` x `height` pixels; `color` is the format of the picture.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        (color, normals): (Format, bool),
    ) -> Result<Self, Error> {
        Ok(Self {
            color: Target::new(gpu, "color", color, width, height)?,
            depth: Target::new(gpu, "depth", Format::Depth32, width, height)?,
            normal: normals
                .then(|| Target::new(gpu, "normal", NORMAL, width, height))
                .transpose()?,
        })
    }

    pub(crate) fn color(&self) -> &Target {
        &self.color
    }

    /// Formats of the color targets, as pipelines that draw into all of them have to know.
    pub(crate) fn formats(&self) -> &'static [Format] {
        triangles::targets(self.color.format, self.normal.is_some())
    }

    pub(crate) fn depth(&self) -> &Target {
        &self.depth
    }

    pub(crate) fn normal(&self) -> Option<&Target> {
        self.normal.as_ref()
    }

    /// Attaches all targets, cleared: color to the background with coverage 0, depth to far.
    pub(crate) fn attach<'f>(&self, pass: Pass<'f>, context: &Context) -> Pass<'f> {
        self.attach_with(pass, context, Load::Clear)
    }

    /// Attaches all targets: cleared in the first pass of a frame, else with what the one before left in them. A pass that
    /// does nothing but clear takes a software device a quarter of a millisecond.
    pub(crate) fn attach_after<'f>(
        &self,
        pass: Pass<'f>,
        context: &Context,
        is_first: bool,
    ) -> Pass<'f> {
        self.attach_with(pass, context, |value| match is_first {
            true => Load::Clear(value),
            false => Load::Keep,
        })
    }

    /// Attaches all targets; `load` decides from the clear value.
    pub(crate) fn attach_with<'f>(
        &self,
        pass: Pass<'f>,
        context: &Context,
        load: impl Fn([f32; 4]) -> Load,
    ) -> Pass<'f> {
        let [r, g, b] = context.background;
        let pass = pass.color(&self.color, load([r, g, b, 0.0]));
        let pass = match &self.normal {
            Some(normal) => pass.color(normal, load([0.0; 4])),
            None => pass,
        };
        pass.depth(&self.depth, load([0.0; 4]))
    }
}

/// What every pass of a frame needs besides its resources.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Context {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Pixels by which the viewport reaches beyond the picture on every side.
    pub(crate) guard_px: u32,
    /// The part of the picture that something may be drawn in: left, top, and one past right and bottom, pixels.
    pub(crate) rect_px: [u32; 4],
    pub(crate) background: [f32; 3],
    pub(crate) cull_back: bool,
    /// The camera mirrors the picture, so that fronts turn clockwise.
    pub(crate) is_mirrored: bool,
    /// Positions in model space.
    pub(crate) light: Lighting,
    /// Of colors by depth.
    pub(crate) depth_range: [f32; 2],
}

impl Context {
    /// All of the picture: left, top, and one past right and bottom, pixels.
    pub(crate) fn whole_px(&self) -> [u32; 4] {
        [0, 0, self.width, self.height]
    }

    /// The viewport: larger than the picture by the guard band. A point is dropped by the device when its
    /// center leaves the view volume, even if its square still reaches into the picture; with the view volume
    /// widened by half the largest square, none of those is lost.
    pub(crate) fn viewport(&self) -> [f32; 4] {
        let guard = self.guard_px as f32;
        [
            -guard,
            -guard,
            self.width as f32 + 2.0 * guard,
            self.height as f32 + 2.0 * guard,
        ]
    }
}
