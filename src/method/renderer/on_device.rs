//! Frames whose cut the device chooses and draws: the host records the same commands whatever is seen.

use super::{End, FrameTimes, Renderer};
use crate::cut::Tester;
use crate::gpu::Error;
use crate::gpu::frame::Ticket;
use crate::math::camera::View;
use crate::method::device_cut::{self, DeviceCut};
use crate::method::plan::{Choice, cut_settings, frame_constants, splat_plan};
use crate::method::scene::Scene;
use crate::method::splats::Splats;
use crate::method::times::{Kept, Stage};
use crate::method::{CutOn, Settings};
use crate::tree::Model;

impl Renderer {
    /// Whether the next frame has its cut chosen on the device; makes what that needs.
    ///
    /// # Errors
    /// When it is asked for and cannot be.
    pub(super) fn prepare_cut(
        &mut self,
        model: &Model,
        scene: &Scene,
        settings: &Settings,
    ) -> Result<bool, Error> {
        let max_point = self.gpu.info().max_point_size_px;
        let has_points = || splat_plan(settings, max_point).fits_always(model);
        let why_not = match device_cut::why_not(settings, model) {
            None if !has_points() => Some("the device has no points of this size"),
            why_not => why_not,
        };
        match (settings.cut_on, why_not) {
            (CutOn::Host, _) => return Ok(false),
            (CutOn::Device, Some(why)) => {
                return Err(Error::Unsupported {
                    what: "the cut on the device",
                    why: why.into(),
                });
            }
            (CutOn::Auto, _) => {
                let pays = self.costs.is_some_and(|costs| costs.cuts_on_device());
                if why_not.is_some() || !pays || self.too_large == Some(scene.id()) {
                    return Ok(false);
                }
            }
            (CutOn::Device, None) => {}
        }
        if self.device_cut.as_ref().is_none_or(|cut| !cut.is_of(scene)) {
            // Its memory first.
            (self.device_cut, self.held_on_device) = (None, None);
            match DeviceCut::new(&self.gpu, model, scene, self.frames.in_flight()) {
                Ok(made) => self.device_cut = Some(made),
                Err(error) if settings.cut_on == CutOn::Auto => {
                    tracing::info!(%error, "the host chooses cuts");
                    self.too_large = Some(scene.id());
                    return Ok(false);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    pub(super) fn draw_on_device(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let max_point = self.gpu.info().max_point_size_px;
        let largest = splat_plan(settings, max_point).largest_point_px(model);
        let context = self.context(view, settings, model, largest);
        let mut times = FrameTimes::default();
        self.foreseen = None;
        let choice = (scene.id(), Choice::of(settings, model, view));
        if self.keeps_lists && self.held_on_device == Some(choice) {
            times.kept = Kept::Lists;
        }
        let submit = Stage::Submit.begin();
        let constants = frame_constants(view, settings, &context);
        let variant = Splats::variant_of(settings, constants.flags);
        let splats = self.splats.iter().find(|s| s.variant == variant);
        let (Some(cut), Some((_, triangles)), Some(splats)) =
            (&self.device_cut, &self.triangles, splats)
        else {
            unreachable!("prepare made the pipelines")
        };
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&constants)?;
        self.held_on_device = None;
        if times.kept != Kept::Lists {
            let tester = Tester::new(model, view, &cut_settings(settings, model));
            let tests = frame.uniform(&cut.constants(&tester, view))?;
            cut.choose(&mut frame, scene, tests);
        } else {
            cut.count(&mut frame);
        }
        cut.draw(
            &mut frame,
            (triangles, splats),
            (&self.targets, scene),
            &context,
            constants,
        );
        let ticket = end(frame, &self.targets.color)?;
        self.held_on_device = Some(choice);
        submit.end(&mut times);
        Ok((ticket, times))
    }
}
