//! Frames whose cut the device chooses and draws, by the rasterizer or by compute: the processor records the same commands whatever is seen.

use crate::cut::NodeTester;
use crate::gpu::Error;
use crate::gpu::frame::FrameTicket;
use crate::render::cut_key::cut_settings;
use crate::render::model_facts::FactedModel;
use crate::render::stats::{FrameStage, KeptWork};
use crate::render::vulkan::opaque::compute::ComputeVariant;
use crate::render::vulkan::opaque::hardware::OpaqueSplats;
use crate::render::vulkan::renderer::{
    FrameEnd, FrameEnding, FrameTimes, PlannedFrame, VulkanRenderer,
};

impl VulkanRenderer {
    pub(super) fn draw_on_device(
        &mut self,
        drawn: PlannedFrame<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<(FrameTicket, FrameTimes), Error> {
        let PlannedFrame { plan, parts, scene } = drawn;
        let Some(FactedModel { model, .. }) = parts.single() else {
            unreachable!("the device chooses cuts of one model")
        };
        let mut times = FrameTimes::default();
        self.ahead = None;
        let by_compute = plan.draws_cut_by_compute;
        let held = (plan.drawn, plan.cut, by_compute);
        if self.keeps_lists && self.held_on_device == Some(held) {
            times.kept = KeptWork::Lists;
        }
        let submit = FrameStage::Submit.begin();
        let variant = OpaqueSplats::variant_of(&plan.settings, plan.constants.flags);
        let splats = self.splats.iter().find(|s| s.variant == variant);
        let (Some(tree), Some(cut), Some((_, triangles)), Some(splats)) =
            (&self.device_tree, &self.device_cut, &self.triangles, splats)
        else {
            unreachable!("prepare made the pipelines")
        };
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&plan.constants)?;
        self.held_on_device = None;
        if times.kept != KeptWork::Lists {
            let tester = NodeTester::new(model, &plan.view, &cut_settings(&plan.settings, model));
            let how = (plan.settings.threshold_px, by_compute);
            let tests = frame.uniform(&cut.constants(&tester, &plan.view, how))?;
            cut.choose(&mut frame, (tree, scene), tests);
        } else {
            cut.count(&mut frame);
        }
        let context = &plan.context;
        let targets = &self.targets;
        cut.draw_triangles(&mut frame, triangles, (targets, scene), context, constants);
        match (&self.small, by_compute) {
            (Some(small), true) => {
                let lists = (cut.lists(), ComputeVariant::of(plan));
                small.record_chosen(&mut frame, targets, (lists, scene), context, constants)?;
            }
            _ => cut.draw_splats(&mut frame, splats, targets, context, constants),
        }
        let last = FrameEnd {
            targets: &self.targets,
            looks: &self.looks,
            plan,
        };
        let ticket = last.end(frame, constants, end)?;
        self.held_on_device = Some(held);
        submit.end(&mut times);
        Ok((ticket, times))
    }
}
