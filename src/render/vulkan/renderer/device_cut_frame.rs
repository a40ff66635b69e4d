//! Frames whose cut the device chooses: the processor records the same commands whatever is seen.

use crate::cut::NodeTester;
use crate::gpu::Error;
use crate::gpu::frame::FrameTicket;
use crate::pack::filtered::device_constants;
use crate::render::cut_key::cut_settings;
use crate::render::model_facts::FactedModel;
use crate::render::stats::{FrameStage, KeptWork};
use crate::render::vulkan::device_cut::{ChoiceConstants, ChoiceRules, ChosenKey};
use crate::render::vulkan::renderer::cut_frame::ListPlace;
use crate::render::vulkan::renderer::{FrameEnding, FrameTimes, PlannedFrame, VulkanRenderer};

impl VulkanRenderer {
    pub(super) fn draw_on_device(
        &mut self,
        drawn: PlannedFrame<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<(FrameTicket, FrameTimes), Error> {
        let PlannedFrame { plan, parts, .. } = drawn;
        let (Some(FactedModel { model, .. }), Some(cut)) = (parts.single(), &self.device_cut)
        else {
            unreachable!("the device chooses cuts of one model, for which prepare made room")
        };
        let mut times = FrameTimes::default();
        self.ahead = None;
        let key = ChosenKey::of(plan);
        let is_kept = self.keeps_lists && self.held_on_device == Some(key);
        if is_kept {
            times.kept = KeptWork::Lists;
        }
        let submit = FrameStage::Submit.begin();
        let rules = ChoiceRules::of(plan);
        let tests = (!is_kept).then(|| {
            let tester = NodeTester::new(model, &plan.view, &cut_settings(&plan.settings, model));
            ChoiceConstants {
                cut: cut.constants(&tester, &plan.view, rules),
                eye: (plan.filtered_shade()).map(|shade| device_constants(&plan.view, shade)),
            }
        });
        self.held_on_device = None;
        let ticket = self.record_cut(drawn, ListPlace::Device(tests.as_ref()), end)?;
        self.held_on_device = Some(key);
        submit.end(&mut times);
        Ok((ticket, times))
    }
}
