//! Frames that need the tree on the device: whose cut it chooses and draws, the host recording the same commands whatever is
//! seen, or whose lists name splats and triangles by numbers.

use crate::cut::Tester;
use crate::gpu::Error;
use crate::gpu::frame::Ticket;
use crate::math::camera::View;
use crate::pack::ids;
use crate::render::cut_key::{CutKey, cut_settings};
use crate::render::frame_constants::frame_constants;
use crate::render::pack_params::splat_plan;
use crate::render::stats::{Kept, Stage};
use crate::render::technique::Technique;
use crate::render::vulkan::device_cut;
use crate::render::vulkan::device_cut::DeviceCut;
use crate::render::vulkan::device_tree::DeviceTree;
use crate::render::vulkan::expand_ids::ById;
use crate::render::vulkan::opaque::hardware::Splats;
use crate::render::vulkan::renderer::{End, FrameTimes, Renderer};
use crate::render::vulkan::scene::Scene;
use crate::render::{CutOn, ListOf, Settings};
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
                if why_not.is_some() || !pays || self.too_large[0] == Some(scene.id()) {
                    return Ok(false);
                }
            }
            (CutOn::Device, None) => {}
        }
        if self.device_cut.as_ref().is_none_or(|cut| !cut.is_of(scene)) {
            // Its memory first.
            (self.device_cut, self.held_on_device) = (None, None);
            match self.make_device_cut(model, scene) {
                Ok(made) => self.device_cut = Some(made),
                Err(error) if settings.cut_on == CutOn::Auto => {
                    tracing::info!(%error, "the host chooses cuts");
                    self.too_large[0] = Some(scene.id());
                    return Ok(false);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    fn make_device_cut(&mut self, model: &Model, scene: &Scene) -> Result<DeviceCut, Error> {
        let slots = self.frames.in_flight();
        let gpu = self.gpu.clone();
        DeviceCut::new(
            &gpu,
            self.tree_on_device(model, scene)?,
            (model, scene),
            slots,
        )
    }

    /// The tree of a scene on the device, copied at the first call.
    fn tree_on_device(&mut self, model: &Model, scene: &Scene) -> Result<&DeviceTree, Error> {
        let tree = self.device_tree.take().filter(|tree| tree.is_of(scene));
        let tree = match tree {
            Some(tree) => tree,
            None => {
                // Of another tree.
                (self.device_cut, self.held_on_device) = (None, None);
                DeviceTree::new(&self.gpu, model, scene)?
            }
        };
        Ok(self.device_tree.insert(tree))
    }

    /// Whether the lists of the next frame may name splats and triangles by numbers; makes what that needs.
    ///
    /// # Errors
    /// When it is asked for and cannot be.
    pub(super) fn prepare_lists(
        &mut self,
        model: &Model,
        scene: &Scene,
        settings: &Settings,
    ) -> Result<bool, Error> {
        let refused = |why: &str| Error::Unsupported {
            what: "draw lists of numbers",
            why: why.into(),
        };
        let drawing = Technique::of(settings);
        let by_compute = self.wants_compute(settings)?;
        let why_not = if !settings.has_cut() {
            Some("methods without a cut have no lists")
        } else if !matches!(
            drawing,
            Technique::Opaque | Technique::Visibility | Technique::Fuzzy
        ) {
            Some("filtered splats depend on the view, and the host makes them")
        } else if drawing == Technique::Fuzzy && by_compute {
            Some("what compute draws of fuzzy splats the host makes; use --path raster")
        } else {
            ids::why_not(&splat_plan(settings, f32::INFINITY))
        };
        match (settings.list_of, why_not) {
            (ListOf::Records, _) | (ListOf::Auto, Some(_)) => return Ok(false),
            (ListOf::Ids, Some(why)) => return Err(refused(why)),
            // What it calls its own is the host's memory: the tree would be there twice.
            (ListOf::Auto, None) if self.gpu.info().is_cpu() => return Ok(false),
            (ListOf::Auto, None) if self.too_large[1] == Some(scene.id()) => return Ok(false),
            (ListOf::Auto | ListOf::Ids, None) => {}
        }
        if let Err(error) = self.tree_on_device(model, scene) {
            if settings.list_of == ListOf::Ids {
                return Err(error);
            }
            tracing::info!(%error, "draw lists hold records");
            self.too_large[1] = Some(scene.id());
            return Ok(false);
        }
        let has_triangles = model.kind().is_surface();
        if self
            .by_id
            .as_ref()
            .is_none_or(|made| !made.is_of(has_triangles))
        {
            self.by_id = Some(ById::new(&self.gpu, has_triangles)?);
        }
        // Looks at the whole model, once.
        scene.undrawn(model);
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
        self.ahead = None;
        let choice = (scene.id(), CutKey::of(settings, model, view));
        if self.keeps_lists && self.held_on_device == Some(choice) {
            times.kept = Kept::Lists;
        }
        let submit = Stage::Submit.begin();
        let constants = frame_constants(view, settings, &context);
        let variant = Splats::variant_of(settings, constants.flags);
        let splats = self.splats.iter().find(|s| s.variant == variant);
        let (Some(tree), Some(cut), Some((_, triangles)), Some(splats)) =
            (&self.device_tree, &self.device_cut, &self.triangles, splats)
        else {
            unreachable!("prepare made the pipelines")
        };
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&constants)?;
        self.held_on_device = None;
        if times.kept != Kept::Lists {
            let tester = Tester::new(model, view, &cut_settings(settings, model));
            let tests = frame.uniform(&cut.constants(&tester, view))?;
            cut.choose(&mut frame, (tree, scene), tests);
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
