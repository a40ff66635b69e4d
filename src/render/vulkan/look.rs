//! Looks: passes over the finished picture of a frame, whatever technique drew it.

use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::{Error, Gpu};
use crate::render::frame_plan::FramePlan;
use crate::render::vulkan::darken::{DarkenPass, DarkenRule};
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pass::PhotoPass;
use crate::render::vulkan::targets::FrameTargets;
use std::sync::Arc;

/// The looks of pictures of one size, made when a frame first has them.
#[derive(Debug, Default)]
pub(super) struct PictureLooks {
    /// One after the other, each with whether the last frame had it.
    darkened: [(Option<DarkenPass>, bool); 2],
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
        let constants = &plan.constants;
        let rules = [
            (DarkenRule::AmbientOcclusion, constants.ambient_occlusion),
            (DarkenRule::EyeDome, constants.eye_dome),
        ];
        for ((pass, is_on), (rule, strength)) in self.darkened.iter_mut().zip(rules) {
            *is_on = strength > 0.0;
            if *is_on && pass.is_none() {
                *pass = Some(DarkenPass::new(rule, gpu, targets)?);
            }
        }
        Ok(())
    }

    /// Forgets the last frame: what is drawn next is the picture itself.
    #[cfg(feature = "viewer")]
    pub(super) fn forget(&mut self) {
        self.has_photos = false;
        self.darkened
            .iter_mut()
            .for_each(|(_, is_on)| *is_on = false);
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
        let mut picture = targets.color();
        for pass in self.darkening() {
            pass.record(frame, (picture, targets), &plan.context, constants);
            picture = pass.picture();
        }
        Ok(())
    }

    /// The passes of the last frame that darken, in order.
    fn darkening(&self) -> impl Iterator<Item = &DarkenPass> {
        let passes = self.darkened.iter().filter(|(_, is_on)| *is_on);
        passes.filter_map(|(pass, _)| pass.as_ref())
    }

    /// The picture of the last frame, as its looks left it.
    pub(super) fn picture<'a>(&'a self, targets: &'a FrameTargets) -> &'a Target {
        match (self.darkening().last(), &self.photos) {
            (_, Some(pass)) if self.has_photos => pass.picture(),
            (Some(pass), _) => pass.picture(),
            _ => targets.color(),
        }
    }
}
