//! Pipelines from embedded shaders, and the pipeline cache on disk.

mod attributes;
mod kept;
mod specialization;

pub(crate) use attributes::record;
pub use attributes::{AttributeFormat, RecordAttribute, VertexRecord};
pub(super) use kept::KeptPipelines;
use kept::{PipelineKey, PipelineParts};

use super::image::ImageFormat;
use super::{Error, Gpu, lock};
use crate::abi::{BindingKind, CompiledShader, ConstantValue, ShaderStage, constants};
use ash::vk;
use specialization::{SpecializedConstants, check_constants};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Primitives that a pipeline draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PrimitiveTopology {
    /// Separate triangles.
    Triangles,
    /// Points, sized by the vertex shader.
    Points,
    /// Two triangles for every record, which the vertex shader places by `gl_VertexIndex` (0 to 5).
    Quads,
    /// Six triangles for every record, a fan of eight corners, which the vertex shader places by `gl_VertexIndex` (0 to 17).
    Fans,
}

/// Parts that a graphics pipeline is made of.
#[derive(Debug, Clone, Copy)]
pub struct PipelineDescription<'a> {
    /// Name, as in captures.
    pub name: &'a str,
    /// Vertex shader.
    pub vertex: &'a CompiledShader,
    /// Fragment shader; none for a pass that writes depth only.
    pub fragment: Option<&'a CompiledShader>,
    /// Values of all specialization constants of both shaders but the frame's flags.
    pub constants: &'a [ConstantValue],
    /// Vertex record.
    pub record: VertexRecord,
    /// Primitives that are drawn.
    pub topology: PrimitiveTopology,
    /// Color targets in order of location.
    pub colors: &'a [ImageFormat],
    /// Use of the [`ImageFormat::Depth32`] target.
    pub depth: DepthMode,
    /// Add to the color targets instead of replacing.
    pub is_additive: bool,
}

/// Use that a pipeline makes of depth (reversed: nearer is greater).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthMode {
    /// There is no depth target.
    None,
    /// Nearer passes and is written; the first drawn wins a tie.
    Nearest,
    /// Fragments that are not farther pass and are written; the last drawn wins a tie.
    NotFarther,
    /// Fragments that are not farther pass; nothing is written.
    TestOnly,
}

/// A graphics pipeline with its layout.
#[derive(Debug)]
pub struct ShaderPipeline {
    gpu: Arc<Gpu>,
    parts: PipelineParts,
    key: PipelineKey,
}

fn stage_flags(stage: ShaderStage) -> vk::ShaderStageFlags {
    match stage {
        ShaderStage::Vertex => vk::ShaderStageFlags::VERTEX,
        ShaderStage::Fragment => vk::ShaderStageFlags::FRAGMENT,
        ShaderStage::Compute => vk::ShaderStageFlags::COMPUTE,
    }
}

fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
    }
}

/// A shader module that lives for one pipeline creation.
struct ShaderModule<'a> {
    gpu: &'a Gpu,
    handle: vk::ShaderModule,
}

impl<'a> ShaderModule<'a> {
    fn new(gpu: &'a Gpu, shader: &CompiledShader) -> Result<Self, Error> {
        let info = vk::ShaderModuleCreateInfo::default().code(shader.words);
        // SAFETY: the words are SPIR-V that the build compiled for Vulkan 1.3.
        let handle = unsafe { gpu.device.create_shader_module(&info, None) }
            .map_err(Error::vulkan("vkCreateShaderModule", shader.name))?;
        gpu.name(handle, shader.name);
        Ok(Self { gpu, handle })
    }
}

impl Drop for ShaderModule<'_> {
    fn drop(&mut self) {
        // SAFETY: modules may go once the pipeline exists; destroyed once, here.
        unsafe { self.gpu.device.destroy_shader_module(self.handle, None) };
    }
}

impl ShaderPipeline {
    /// Compiles a graphics pipeline. Layouts come out of the shaders. Not for the frame loop.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    ///
    /// # Panics
    /// When a shader wants a vertex input that the record lacks, the shaders disagree about a binding, a specialization
    /// constant has no value or a value no constant, or the fragment shader has more or fewer outputs than there are color
    /// targets: broken promises of this crate, found by the first test that draws.
    pub fn new(gpu: &Arc<Gpu>, description: &PipelineDescription<'_>) -> Result<Self, Error> {
        Self::with(gpu, description, 0, false)
    }

    /// Makes a pipeline as [`new`](ShaderPipeline::new) does, for frames whose [flags](crate::abi::FrameConstants::flags) are
    /// these alone: shaders then neither look at the flags of the frame nor branch on them.
    ///
    /// # Errors
    /// As [`new`](ShaderPipeline::new).
    pub fn for_flags(
        gpu: &Arc<Gpu>,
        description: &PipelineDescription<'_>,
        flags: u32,
    ) -> Result<Self, Error> {
        Self::with(gpu, description, flags | constants::FLAGS_ARE_KNOWN, false)
    }

    /// Makes a pipeline as [`new`](ShaderPipeline::new) does that draws over what is there by premultiplied alpha.
    #[cfg(feature = "viewer")]
    pub(super) fn over(
        gpu: &Arc<Gpu>,
        description: &PipelineDescription<'_>,
    ) -> Result<Self, Error> {
        Self::with(gpu, description, 0, true)
    }

    fn with(
        gpu: &Arc<Gpu>,
        description: &PipelineDescription<'_>,
        flags: u32,
        is_over: bool,
    ) -> Result<Self, Error> {
        let key = PipelineKey::graphics(description, (flags, is_over));
        if let Some(kept) = Self::kept(gpu, &key) {
            return Ok(kept);
        }
        let shaders = std::iter::once(description.vertex).chain(description.fragment);
        let mut pipeline = Self::with_layout(gpu, key, shaders)?;
        let parts = &mut pipeline.parts;
        parts.handle = compile(gpu, description, parts.layout, (flags, is_over))?;
        gpu.compiled_pipelines.fetch_add(1, Ordering::Relaxed);
        gpu.name(parts.handle, description.name);
        Ok(pipeline)
    }

    /// Compiles a compute pipeline with values of all specialization constants of its shader but the frame's flags. Not for
    /// the frame loop.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    ///
    /// # Panics
    /// When a specialization constant has no value or a value no constant.
    pub fn compute(
        gpu: &Arc<Gpu>,
        name: &str,
        shader: &CompiledShader,
        constants: &[ConstantValue],
    ) -> Result<Self, Error> {
        Self::compute_with(gpu, name, shader, (constants, 0))
    }

    /// Makes a pipeline as [`compute`](ShaderPipeline::compute) does, for frames whose
    /// [flags](crate::abi::FrameConstants::flags) are these alone.
    ///
    /// # Errors
    /// As [`compute`](ShaderPipeline::compute).
    pub fn compute_for_flags(
        gpu: &Arc<Gpu>,
        name: &str,
        shader: &CompiledShader,
        values: &[ConstantValue],
        flags: u32,
    ) -> Result<Self, Error> {
        let flags = flags | constants::FLAGS_ARE_KNOWN;
        Self::compute_with(gpu, name, shader, (values, flags))
    }

    fn compute_with(
        gpu: &Arc<Gpu>,
        name: &str,
        shader: &CompiledShader,
        (constants, flags): (&[ConstantValue], u32),
    ) -> Result<Self, Error> {
        check_constants(name, &[shader], constants);
        let key = PipelineKey::compute(name, shader, (constants, flags));
        if let Some(kept) = Self::kept(gpu, &key) {
            return Ok(kept);
        }
        let mut pipeline = Self::with_layout(gpu, key, std::iter::once(shader))?;
        let parts = &mut pipeline.parts;
        let module = ShaderModule::new(gpu, shader)?;
        let specialized = SpecializedConstants::new(shader, constants, flags);
        let specialization = specialized.info();
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(
                vk::PipelineShaderStageCreateInfo::default()
                    .stage(vk::ShaderStageFlags::COMPUTE)
                    .module(module.handle)
                    .name(c"main")
                    .specialization_info(&specialization),
            )
            .layout(parts.layout);
        // SAFETY: everything the description points to lives until the call returns, and belongs to this device.
        let made = unsafe {
            gpu.device
                .create_compute_pipelines(gpu.pipeline_cache, &[info], None)
        };
        parts.handle = match made {
            Ok(pipelines) => pipelines[0],
            Err((_, result)) => {
                return Err(Error::vulkan("vkCreateComputePipelines", name)(result));
            }
        };
        parts.group = shader.local_size.iter().product();
        gpu.compiled_pipelines.fetch_add(1, Ordering::Relaxed);
        gpu.name(parts.handle, name);
        Ok(pipeline)
    }

    /// Takes the pipeline of a key, where one is kept.
    fn kept(gpu: &Arc<Gpu>, key: &PipelineKey) -> Option<Self> {
        let parts = lock(&gpu.kept_pipelines).take(key)?;
        Some(Self {
            gpu: gpu.clone(),
            parts,
            key: key.clone(),
        })
    }

    /// Everything but the pipeline itself: layouts as the shaders declare them.
    fn with_layout<'s>(
        gpu: &Arc<Gpu>,
        key: PipelineKey,
        shaders: impl Iterator<Item = &'s CompiledShader>,
    ) -> Result<Self, Error> {
        let name = &key.name.clone();
        // Union of the bindings of all stages.
        let mut bindings: Vec<(u32, BindingKind, vk::ShaderStageFlags)> = Vec::new();
        for shader in shaders {
            for &(binding, kind) in shader.bindings {
                match bindings.iter_mut().find(|b| b.0 == binding) {
                    Some(known) => {
                        assert!(
                            known.1 == kind,
                            "{name}: the shaders disagree about binding {binding}"
                        );
                        known.2 |= stage_flags(shader.stage);
                    }
                    None => bindings.push((binding, kind, stage_flags(shader.stage))),
                }
            }
        }
        // In the order in which resources are given, whichever stage names them first.
        bindings.sort_unstable_by_key(|binding| binding.0);
        let mut pipeline = Self {
            gpu: gpu.clone(),
            parts: PipelineParts {
                handle: vk::Pipeline::null(),
                layout: vk::PipelineLayout::null(),
                set_layout: vk::DescriptorSetLayout::null(),
                bindings: bindings.iter().map(|b| (b.0, b.1)).collect(),
                group: 1,
            },
            key,
        };
        let descriptors: Vec<_> = bindings
            .iter()
            .map(|&(binding, kind, stages)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(descriptor_type(kind))
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&descriptors);
        let parts = &mut pipeline.parts;
        // SAFETY: the device is alive; the description lives until the call returns.
        parts.set_layout = unsafe { gpu.device.create_descriptor_set_layout(&info, None) }
            .map_err(Error::vulkan("vkCreateDescriptorSetLayout", name))?;
        let sets = [parts.set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: as above; the set layout was just made.
        parts.layout = unsafe { gpu.device.create_pipeline_layout(&info, None) }
            .map_err(Error::vulkan("vkCreatePipelineLayout", name))?;
        gpu.name(parts.layout, name);
        gpu.name(parts.set_layout, name);
        Ok(pipeline)
    }

    /// Name, as in captures.
    pub fn name(&self) -> &str {
        &self.key.name
    }

    pub(super) fn parts(&self) -> &PipelineParts {
        &self.parts
    }
}

fn compile(
    gpu: &Gpu,
    description: &PipelineDescription<'_>,
    layout: vk::PipelineLayout,
    (flags, is_over): (u32, bool),
) -> Result<vk::Pipeline, Error> {
    let name = description.name;
    let outputs = description.fragment.map_or(0, |fragment| fragment.outputs);
    assert!(
        outputs as usize == description.colors.len(),
        "{name}: its fragment shader has {outputs} outputs, its pass {} color targets",
        description.colors.len()
    );
    let vertex = ShaderModule::new(gpu, description.vertex)?;
    let fragment = description
        .fragment
        .map(|f| ShaderModule::new(gpu, f))
        .transpose()?;
    let shaders: Vec<&CompiledShader> = std::iter::once(description.vertex)
        .chain(description.fragment)
        .collect();
    check_constants(name, &shaders, description.constants);
    let specialized: Vec<SpecializedConstants> = shaders
        .iter()
        .map(|shader| SpecializedConstants::new(shader, description.constants, flags))
        .collect();
    let specialization: Vec<_> = specialized.iter().map(SpecializedConstants::info).collect();
    let modules = std::iter::once(&vertex).chain(&fragment);
    let stages: Vec<_> = shaders
        .iter()
        .zip(modules)
        .zip(&specialization)
        .map(|((shader, module), specialization)| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage_flags(shader.stage))
                .module(module.handle)
                .name(c"main")
                .specialization_info(specialization)
        })
        .collect();
    let attributes: Vec<_> = description
        .vertex
        .inputs
        .iter()
        .map(|&(location, input)| {
            let found = description
                .record
                .attributes
                .iter()
                .find(|a| a.name == input);
            let Some(attribute) = found else {
                panic!("{name}: no attribute for the shader's input {input}")
            };
            vk::VertexInputAttributeDescription::default()
                .location(location)
                .binding(0)
                .format(attribute.format.vk())
                .offset(attribute.offset)
        })
        .collect();
    let records = [vk::VertexInputBindingDescription::default()
        .binding(0)
        .stride(description.record.stride)
        .input_rate(match description.topology {
            PrimitiveTopology::Quads | PrimitiveTopology::Fans => vk::VertexInputRate::INSTANCE,
            PrimitiveTopology::Triangles | PrimitiveTopology::Points => vk::VertexInputRate::VERTEX,
        })];
    let input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_attribute_descriptions(&attributes)
        .vertex_binding_descriptions(if attributes.is_empty() { &[] } else { &records });
    let assembly =
        vk::PipelineInputAssemblyStateCreateInfo::default().topology(match description.topology {
            PrimitiveTopology::Triangles | PrimitiveTopology::Quads | PrimitiveTopology::Fans => {
                vk::PrimitiveTopology::TRIANGLE_LIST
            }
            PrimitiveTopology::Points => vk::PrimitiveTopology::POINT_LIST,
        });
    let viewport = vk::PipelineViewportStateCreateInfo::default()
        .viewport_count(1)
        .scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .line_width(1.0);
    let samples = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(description.depth != DepthMode::None)
        .depth_write_enable(matches!(
            description.depth,
            DepthMode::Nearest | DepthMode::NotFarther
        ))
        .depth_compare_op(match description.depth {
            DepthMode::TestOnly | DepthMode::NotFarther => vk::CompareOp::GREATER_OR_EQUAL,
            _ => vk::CompareOp::GREATER,
        });
    let under = if is_over {
        vk::BlendFactor::ONE_MINUS_SRC_ALPHA
    } else {
        vk::BlendFactor::ONE
    };
    let target = vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(vk::ColorComponentFlags::RGBA)
        .blend_enable(description.is_additive || is_over)
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(under)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(under)
        .alpha_blend_op(vk::BlendOp::ADD);
    let targets = vec![target; description.colors.len()];
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&targets);
    let states = [
        vk::DynamicState::VIEWPORT,
        vk::DynamicState::SCISSOR,
        vk::DynamicState::CULL_MODE,
        vk::DynamicState::FRONT_FACE,
    ];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);
    let formats: Vec<_> = description.colors.iter().map(|f| f.vk()).collect();
    let mut rendering =
        vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
    if description.depth != DepthMode::None {
        rendering = rendering.depth_attachment_format(ImageFormat::Depth32.vk());
    }
    let info = vk::GraphicsPipelineCreateInfo::default()
        .stages(&stages)
        .vertex_input_state(&input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout)
        .push_next(&mut rendering);
    // SAFETY: everything the description points to lives until the call returns, and belongs to this device.
    let made = unsafe {
        gpu.device
            .create_graphics_pipelines(gpu.pipeline_cache, &[info], None)
    };
    match made {
        Ok(pipelines) => Ok(pipelines[0]),
        Err((_, result)) => Err(Error::vulkan("vkCreateGraphicsPipelines", name)(result)),
    }
}

impl Drop for ShaderPipeline {
    fn drop(&mut self) {
        let gone = PipelineParts {
            bindings: std::mem::take(&mut self.parts.bindings),
            ..self.parts
        };
        let gone = match gone.handle == vk::Pipeline::null() {
            // It was never whole.
            true => Some(gone),
            false => lock(&self.gpu.kept_pipelines).keep(self.key.clone(), gone),
        };
        for remains in gone.into_iter().flat_map(PipelineParts::remains) {
            self.gpu.bury(remains);
        }
    }
}

/// First bytes of our cache file; the driver's own header follows.
const CACHE_MAGIC: &[u8; 8] = b"SURFPC01";
/// A cache larger than this is not ours.
const CACHE_LIMIT: u64 = 64 << 20;

/// Path of the cache of this device: one file per device and driver.
fn cache_path(gpu: &Gpu) -> Option<PathBuf> {
    let folder = match std::env::var_os("SURFEL_CACHE") {
        Some(folder) if !folder.is_empty() => PathBuf::from(folder),
        _ => dirs::cache_dir()?.join("surfel"),
    };
    let key = fnv1a(
        format!(
            "{} {} {}",
            gpu.info.name, gpu.info.driver, gpu.info.api_version
        )
        .as_bytes(),
    );
    Some(folder.join(format!("pipelines-{key:016x}.bin")))
}

/// FNV-1a, 64 bits: names a file and notices damage; not against malice.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The driver's part of a cache file, if the file is whole: magic, checksum, then the driver's bytes.
fn unwrap_cache(bytes: &[u8]) -> Option<&[u8]> {
    let rest = bytes.strip_prefix(CACHE_MAGIC)?;
    let (sum, body) = rest.split_at_checked(8)?;
    (sum == fnv1a(body).to_le_bytes()).then_some(body)
}

/// A cache filled from disk. A missing, damaged or foreign file is ignored: the driver checks its own header
/// (vendor, device, cache UUID), and the checksum sees to it that the driver is never fed damaged bytes.
pub(super) fn load_cache(gpu: &Gpu) -> Result<vk::PipelineCache, Error> {
    let bytes = cache_path(gpu)
        .filter(|path| std::fs::metadata(path).is_ok_and(|m| m.len() <= CACHE_LIMIT))
        .and_then(|path| std::fs::read(path).ok())
        .unwrap_or_default();
    let body = unwrap_cache(&bytes).unwrap_or_default();
    let info = vk::PipelineCacheCreateInfo::default().initial_data(body);
    // SAFETY: the device is alive; the data carries the driver's own header, which the driver must check.
    unsafe { gpu.device.create_pipeline_cache(&info, None) }
        .map_err(Error::vulkan("vkCreatePipelineCache", "the cache"))
}

/// Writes the cache beside and renames it. Nothing depends on it, so a failure is only logged.
pub(super) fn store_cache(gpu: &Gpu) {
    if gpu.compiled_pipelines() == 0 || gpu.pipeline_cache == vk::PipelineCache::null() {
        return;
    }
    // SAFETY: the cache belongs to this device and is alive.
    let Ok(body) = (unsafe { gpu.device.get_pipeline_cache_data(gpu.pipeline_cache) }) else {
        return;
    };
    let Some(path) = cache_path(gpu) else { return };
    let mut bytes = Vec::with_capacity(body.len() + 16);
    bytes.extend_from_slice(CACHE_MAGIC);
    bytes.extend_from_slice(&fnv1a(&body).to_le_bytes());
    bytes.extend_from_slice(&body);
    if std::fs::read(&path).is_ok_and(|old| old == bytes) {
        return;
    }
    let written = path
        .parent()
        .ok_or_else(|| std::io::Error::other("no folder"))
        .and_then(|folder| {
            std::fs::create_dir_all(folder)?;
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            std::io::Write::write_all(&mut file, &bytes)?;
            file.persist(&path).map_err(|e| e.error)?;
            Ok(())
        });
    if let Err(e) = written {
        tracing::debug!("the pipeline cache was not stored: {e}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_or_foreign_cache_is_not_trusted() {
        let body = b"driver bytes";
        let mut file = CACHE_MAGIC.to_vec();
        file.extend_from_slice(&fnv1a(body).to_le_bytes());
        file.extend_from_slice(body);
        assert_eq!(unwrap_cache(&file), Some(&body[..]));
        for i in 0..file.len() {
            let mut damaged = file.clone();
            damaged[i] ^= 1;
            assert_eq!(unwrap_cache(&damaged), None, "byte {i}");
            assert_eq!(unwrap_cache(&file[..i]), None, "cut at {i}");
        }
        assert_eq!(unwrap_cache(b"something else entirely"), None);
    }
}
