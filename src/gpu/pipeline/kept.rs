//! Pipelines whose owner is gone, kept for who asks for the same next.
//!
//! A renderer of another picture size or of another model needs the pipelines that the last one had. A driver takes milliseconds
//! for each, lavapipe under validation a tenth of a second: it makes them anew whatever its own cache holds.

use super::{PipelineDescription, PrimitiveTopology, VertexRecord};
use crate::abi::{BindingKind, CompiledShader, ConstantValue};
use crate::gpu::RetiredResource;
use crate::gpu::image::ImageFormat;
use crate::gpu::pipeline::DepthMode;
use ash::vk;
use std::collections::VecDeque;

/// Number of pipelines that are kept at most. All methods with all splats have about 60.
const MOST: usize = 128;

/// Parts that a pipeline is made of: two pipelines of one key are the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::gpu) struct PipelineKey {
    /// Name, as in captures.
    pub(super) name: String,
    /// SPIR-V of all stages.
    shaders: Vec<&'static [u32]>,
    constants: Vec<ConstantValue>,
    /// Flags of the frame, where the pipeline is for these alone.
    flags: u32,
    /// State that a graphics pipeline has besides.
    raster: Option<RasterState>,
}

/// State of a graphics pipeline besides its shaders.
#[derive(Debug, Clone, PartialEq, Eq)]
struct RasterState {
    record: VertexRecord,
    topology: PrimitiveTopology,
    colors: Vec<ImageFormat>,
    depth: DepthMode,
    is_additive: bool,
    is_over: bool,
}

impl PipelineKey {
    /// Key of a graphics pipeline.
    pub(super) fn graphics(
        description: &PipelineDescription<'_>,
        (flags, is_over): (u32, bool),
    ) -> Self {
        let stages = std::iter::once(description.vertex).chain(description.fragment);
        Self {
            name: description.name.to_owned(),
            shaders: stages.map(|shader| shader.words).collect(),
            constants: description.constants.to_vec(),
            flags,
            raster: Some(RasterState {
                record: description.record,
                topology: description.topology,
                colors: description.colors.to_vec(),
                depth: description.depth,
                is_additive: description.is_additive,
                is_over,
            }),
        }
    }

    /// Key of a compute pipeline.
    pub(super) fn compute(
        name: &str,
        shader: &CompiledShader,
        (constants, flags): (&[ConstantValue], u32),
    ) -> Self {
        Self {
            name: name.to_owned(),
            shaders: vec![shader.words],
            constants: constants.to_vec(),
            flags,
            raster: None,
        }
    }
}

/// Handles of a pipeline, and what is known of its shaders.
#[derive(Debug)]
pub(in crate::gpu) struct PipelineParts {
    pub(in crate::gpu) handle: vk::Pipeline,
    pub(in crate::gpu) layout: vk::PipelineLayout,
    pub(in crate::gpu) set_layout: vk::DescriptorSetLayout,
    /// Bindings of set 0, ascending.
    pub(in crate::gpu) bindings: Vec<(u32, BindingKind)>,
    /// Invocations of a workgroup; 1 for graphics.
    pub(in crate::gpu) group: u32,
}

impl PipelineParts {
    /// Handles that are to be destroyed.
    pub(in crate::gpu) fn remains(self) -> [RetiredResource; 3] {
        [
            RetiredResource::Pipeline(self.handle),
            RetiredResource::PipelineLayout(self.layout),
            RetiredResource::DescriptorSetLayout(self.set_layout),
        ]
    }
}

/// Pipelines without an owner, the longest unused first.
#[derive(Debug, Default)]
pub(in crate::gpu) struct KeptPipelines {
    kept: VecDeque<(PipelineKey, PipelineParts)>,
}

impl KeptPipelines {
    /// Takes the pipeline of a key, if there is one.
    pub(super) fn take(&mut self, key: &PipelineKey) -> Option<PipelineParts> {
        let found = self.kept.iter().rposition(|(own, _)| own == key)?;
        self.kept.remove(found).map(|(_, parts)| parts)
    }

    /// Keeps a whole pipeline; gives the one that there is no room for any more.
    pub(super) fn keep(&mut self, key: PipelineKey, parts: PipelineParts) -> Option<PipelineParts> {
        self.kept.push_back((key, parts));
        match self.kept.len() > MOST {
            true => self.kept.pop_front().map(|(_, parts)| parts),
            false => None,
        }
    }

    /// Handles of all of them, to be destroyed.
    pub(in crate::gpu) fn remains(self) -> impl Iterator<Item = RetiredResource> {
        self.kept.into_iter().flat_map(|(_, parts)| parts.remains())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::abi::{constants, shaders};
    use crate::gpu::for_tests::{close_in_silence, device};
    use crate::gpu::pipeline::ShaderPipeline;
    use std::sync::Arc;

    #[test]
    fn the_same_again_is_not_compiled_and_another_is() {
        let Some(gpu) = device() else { return };
        let made = |name: &str, flags| {
            let shader = &shaders::LISTS_TRIANGLES_COMP;
            let pipeline =
                ShaderPipeline::compute_for_flags(&gpu, name, shader, &[], flags).unwrap();
            (pipeline.parts().handle, pipeline.parts().bindings.clone())
        };
        let first = made("a", 0);
        assert_eq!((made("a", 0), gpu.compiled_pipelines()), (first, 1));
        // Another name, or other flags.
        made("b", 0);
        made("a", constants::FLAG_ORTHOGRAPHIC);
        assert_eq!(gpu.compiled_pipelines(), 3);
        // Two at once are two.
        let shader = &shaders::LISTS_TRIANGLES_COMP;
        let two: Vec<_> = (0..2)
            .map(|_| ShaderPipeline::compute_for_flags(&gpu, "a", shader, &[], 0).unwrap())
            .collect();
        assert_ne!(two[0].parts().handle, two[1].parts().handle);
        assert_eq!(gpu.compiled_pipelines(), 4);
        drop(two);
        // No more than there is room for, and the longest unused goes first.
        for flags in 0..MOST as u32 {
            made("c", flags);
        }
        assert_eq!(crate::gpu::lock(&gpu.kept_pipelines).kept.len(), MOST);
        let before = gpu.compiled_pipelines();
        made("c", 0);
        assert_eq!(gpu.compiled_pipelines(), before);
        made("a", 0);
        assert_eq!(gpu.compiled_pipelines(), before + 1);
        assert_eq!(Arc::strong_count(&gpu), 1);
        close_in_silence(gpu);
    }
}
