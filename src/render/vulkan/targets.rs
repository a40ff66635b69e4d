//! What a frame draws into, and what its passes share.

use crate::gpu::frame::{PassBuilder, TargetLoad};
use crate::gpu::image::{DeviceImage as Target, ImageFormat};
use crate::gpu::{Error, Gpu};
pub(crate) use crate::render::frame_constants::FrameContext as Context;
use crate::render::vulkan::{COLOR, NORMAL, NUMBER, SAMPLES};
use std::sync::Arc;

/// The color targets of a pass whose first is [`COLOR`] or [`SAMPLES`].
pub(crate) fn color_formats(color: ImageFormat, normals: bool) -> &'static [ImageFormat] {
    match (color, normals) {
        (SAMPLES, false) => &[SAMPLES],
        (SAMPLES, true) => &[SAMPLES, NORMAL],
        (_, false) => &[COLOR],
        (_, true) => &[COLOR, NORMAL],
    }
}

/// Formats of the color targets, and after them [`NUMBER`].
fn numbered_formats(color: ImageFormat, normals: bool) -> &'static [ImageFormat] {
    match (color, normals) {
        (SAMPLES, false) => &[SAMPLES, NUMBER],
        (SAMPLES, true) => &[SAMPLES, NORMAL, NUMBER],
        (_, false) => &[COLOR, NUMBER],
        (_, true) => &[COLOR, NORMAL, NUMBER],
    }
}

/// The targets of a frame.
#[derive(Debug)]
pub(crate) struct FrameTargets {
    pub(super) color: Target,
    pub(super) depth: Target,
    pub(super) normal: Option<Target>,
}

impl FrameTargets {
    /// Targets of `width` x `height` pixels; `color` is the format of the picture.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        (color, normals): (ImageFormat, bool),
    ) -> Result<Self, Error> {
        Ok(Self {
            color: Target::new(gpu, "color", color, width, height)?,
            depth: Target::new(gpu, "depth", ImageFormat::Depth32, width, height)?,
            normal: normals
                .then(|| Target::new(gpu, "normal", NORMAL, width, height))
                .transpose()?,
        })
    }

    pub(crate) fn color(&self) -> &Target {
        &self.color
    }

    /// Formats of the color targets, as pipelines that draw into all of them have to know.
    pub(crate) fn formats(&self) -> &'static [ImageFormat] {
        color_formats(self.color.format, self.normal.is_some())
    }

    /// Formats of the color targets, and of one of numbers.
    pub(crate) fn numbered_formats(&self) -> &'static [ImageFormat] {
        numbered_formats(self.color.format, self.normal.is_some())
    }

    pub(crate) fn depth(&self) -> &Target {
        &self.depth
    }

    pub(crate) fn normal(&self) -> Option<&Target> {
        self.normal.as_ref()
    }

    /// Attaches all targets, cleared: color to the background with coverage 0, depth to far.
    pub(crate) fn attach<'f>(&self, pass: PassBuilder<'f>, context: &Context) -> PassBuilder<'f> {
        self.attach_with(pass, context, TargetLoad::Clear)
    }

    /// Attaches all targets: cleared in the first pass of a frame, else with what the one before left in them. A pass that
    /// does nothing but clear takes a software device a quarter of a millisecond.
    pub(crate) fn attach_after<'f>(
        &self,
        pass: PassBuilder<'f>,
        context: &Context,
        is_first: bool,
    ) -> PassBuilder<'f> {
        self.attach_with(pass, context, |value| match is_first {
            true => TargetLoad::Clear(value),
            false => TargetLoad::Keep,
        })
    }

    /// Attaches all targets; `load` decides from the clear value.
    pub(crate) fn attach_with<'f>(
        &self,
        pass: PassBuilder<'f>,
        context: &Context,
        load: impl Fn([f32; 4]) -> TargetLoad,
    ) -> PassBuilder<'f> {
        let [r, g, b] = context.background;
        let pass = pass.color(&self.color, load([r, g, b, 0.0]));
        let pass = match &self.normal {
            Some(normal) => pass.color(normal, load([0.0; 4])),
            None => pass,
        };
        pass.depth(&self.depth, load([0.0; 4]))
    }
}
