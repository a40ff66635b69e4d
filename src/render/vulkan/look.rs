//! Looks: passes over the finished picture of a frame, whatever technique drew it.

use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::{Error, Gpu};
use crate::render::frame_plan::FramePlan;
use crate::render::vulkan::look_pass::{LookPass, LookRule};
use crate::render::vulkan::opaque::rims::{NumberedPatches, RimPass};
use crate::render::vulkan::photos::DevicePhotos;
use crate::render::vulkan::photos::pass::PhotoPass;
use crate::render::vulkan::targets::FrameTargets;
use std::sync::Arc;

/// The looks of pictures of one size, made when a frame first has them.
#[derive(Debug, Default)]
pub(super) struct PictureLooks {
    /// One after the other, each with whether the last frame had it.
    passes: [(Option<LookPass>, bool); 3],
    photos: Option<PhotoPass>,
    /// Pass before all others, and whether the last frame had it.
    rims: (Option<RimPass>, bool),
    /// The last frame had photographs; it has no other look then.
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
        let (rims, covers_rims) = &mut self.rims;
        *covers_rims = plan.primitives.covers_rims;
        if *covers_rims {
            *rims = Some(RimPass::ready(rims.take(), gpu, targets, constants.flags)?);
        }
        let rules = [
            (
                LookRule::AmbientOcclusion,
                constants.ambient_occlusion > 0.0,
            ),
            (LookRule::EyeDome, constants.eye_dome > 0.0),
            (
                LookRule::Background,
                plan.settings.background_bottom.is_some(),
            ),
        ];
        for ((pass, is_on), (rule, is_wanted)) in self.passes.iter_mut().zip(rules) {
            *is_on = is_wanted;
            if *is_on && pass.is_none() {
                *pass = Some(LookPass::new(rule, gpu, targets)?);
            }
        }
        Ok(())
    }

    /// Forgets the last frame: what is drawn next is the picture itself.
    #[cfg(feature = "viewer")]
    pub(super) fn forget(&mut self) {
        self.has_photos = false;
        self.rims.1 = false;
        self.passes.iter_mut().for_each(|(_, is_on)| *is_on = false);
    }

    /// Records the looks of a frame, whose technique is recorded; `patches` are those that it shows, if their rims are covered.
    ///
    /// # Errors
    /// When the frame has no room for their constants.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        (plan, patches): (&FramePlan, Option<NumberedPatches<'_>>),
        constants: UniformBlock,
    ) -> Result<(), Error> {
        if let (true, Some(pass)) = (self.has_photos, &self.photos) {
            pass.record(frame, targets, plan, constants)?;
        }
        if let (Some(rims), Some(patches)) = (self.present_rims(), patches) {
            let shown = (patches, &plan.context);
            rims.record(frame, targets, shown, constants)?;
        }
        let mut picture = self.drawn_picture(targets);
        for pass in self.present_passes() {
            pass.record(frame, (picture, targets), &plan.context, constants);
            picture = pass.picture();
        }
        Ok(())
    }

    /// The pass that covered rims in the last frame.
    fn present_rims(&self) -> Option<&RimPass> {
        let (pass, is_on) = &self.rims;
        pass.as_ref().filter(|_| *is_on)
    }

    /// The picture of the last frame as its technique left it, with covered rims where it has them.
    fn drawn_picture<'a>(&'a self, targets: &'a FrameTargets) -> &'a Target {
        self.present_rims()
            .map_or(targets.color(), RimPass::picture)
    }

    /// The passes of the last frame, in order.
    fn present_passes(&self) -> impl Iterator<Item = &LookPass> {
        let passes = self.passes.iter().filter(|(_, is_on)| *is_on);
        passes.filter_map(|(pass, _)| pass.as_ref())
    }

    /// The picture of the last frame, as its looks left it.
    pub(super) fn picture<'a>(&'a self, targets: &'a FrameTargets) -> &'a Target {
        match (self.present_passes().last(), &self.photos) {
            (_, Some(pass)) if self.has_photos => pass.picture(),
            (Some(pass), _) => pass.picture(),
            _ => self.drawn_picture(targets),
        }
    }
}
