//! Looks: passes over the finished picture of a frame, whatever technique drew it.

use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::{Error, Gpu};
use crate::render::frame_plan::FramePlan;
use crate::render::vulkan::eye_dome::EyeDomePass;
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pass::PhotoPass;
use crate::render::vulkan::targets::FrameTargets;
use std::sync::Arc;

/// The looks of pictures of one size, made when a frame first has them.
#[derive(Debug, Default)]
pub(super) struct PictureLooks {
    eye_dome: Option<EyeDomePass>,
    /// The last frame had eye-dome lighting.
    is_darkened: bool,
    photos: Option<PhotoPass>,
    /// The last frame had photographs; it is not darkened then.
    has_photos: bool,
}

impl PictureLooks {
    /// Makes what a planned frame needs.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(super) fn prepare(
        &mut self,
        gpu: &Arc<Gpu>,
        targets: &FrameTargets,
        (plan, photos): (&FramePlan, Option<&DevicePhotos>),
    ) -> Result<(), Error> {
        self.has_photos = plan.settings.shows_photos();
        if self.has_photos {
            let Some(photos) = photos else {
                return Err(Error::Unsupported {
                    what: "photographs",
                    why: "none are given; name a scene of photographs with --photos".into(),
                });
            };
            let made = self.photos.take();
            self.photos = Some(PhotoPass::ready(made, gpu, targets, plan, photos)?);
        }
        self.is_darkened = plan.constants.eye_dome > 0.0;
        if self.is_darkened && self.eye_dome.is_none() {
            self.eye_dome = Some(EyeDomePass::new(gpu, targets)?);
        }
        Ok(())
    }

    /// Forgets the last frame: what is drawn next is the picture itself.
    #[cfg(feature = "viewer")]
    pub(super) fn forget(&mut self) {
        (self.is_darkened, self.has_photos) = (false, false);
    }

    /// Records the looks of a frame, whose technique is recorded.
    ///
    /// # Errors
    /// When the frame has no room for their constants.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        plan: &FramePlan,
        constants: UniformBlock,
    ) -> Result<(), Error> {
        if let (true, Some(pass)) = (self.has_photos, &self.photos) {
            pass.record(frame, targets, plan, constants)?;
        }
        if let (true, Some(pass)) = (self.is_darkened, &self.eye_dome) {
            pass.record(frame, targets, &plan.context, constants);
        }
        Ok(())
    }

    /// The picture of the last frame, as its looks left it.
    pub(super) fn picture<'a>(&'a self, targets: &'a FrameTargets) -> &'a Target {
        match (&self.eye_dome, &self.photos) {
            (_, Some(pass)) if self.has_photos => pass.picture(),
            (Some(pass), _) if self.is_darkened => pass.picture(),
            _ => targets.color(),
        }
    }
}
