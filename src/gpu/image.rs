//! Images that passes draw into, sample and copy.

use super::access::State;
use super::{Error, Gpu, Remains};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use std::sync::{Arc, Mutex};

/// Pixel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Eight bits a channel, 0..=1.
    Rgba8,
    /// One 32-bit float.
    R32Float,
    /// Two 32-bit floats.
    Rg32Float,
    /// Four 16-bit floats.
    Rgba16Float,
    /// Four 32-bit floats.
    Rgba32Float,
    /// 32-bit float depth, reversed: 1 at the near plane, 0 at the far plane.
    Depth32,
}

impl Format {
    /// Bytes of one pixel.
    pub fn pixel_bytes(self) -> u64 {
        match self {
            Self::Rgba8 | Self::R32Float | Self::Depth32 => 4,
            Self::Rg32Float => 8,
            Self::Rgba16Float => 8,
            Self::Rgba32Float => 16,
        }
    }

    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::R32Float => vk::Format::R32_SFLOAT,
            Self::Rg32Float => vk::Format::R32G32_SFLOAT,
            Self::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Self::Depth32 => vk::Format::D32_SFLOAT,
        }
    }

    pub(super) fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::Depth32 => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}

/// A two-dimensional image with one level.
#[derive(Debug)]
pub struct Image {
    gpu: Arc<Gpu>,
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    memory: Option<Allocation>,
    /// Pixel format.
    pub format: Format,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    name: String,
    pub(super) state: Mutex<State>,
}

impl Image {
    /// Makes an image that can be a target, sampled and copied from. Its contents are undefined until a pass
    /// clears it.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory cannot be had.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        format: Format,
        width: u32,
        height: u32,
    ) -> Result<Self, Error> {
        Self::with(
            gpu,
            name,
            format,
            (width, height),
            vk::ImageUsageFlags::empty(),
        )
    }

    /// As [`new`](Image::new), and can be copied to.
    ///
    /// # Errors
    /// As there.
    pub fn copied_to(
        gpu: &Arc<Gpu>,
        name: &str,
        format: Format,
        width: u32,
        height: u32,
    ) -> Result<Self, Error> {
        let usage = vk::ImageUsageFlags::TRANSFER_DST;
        Self::with(gpu, name, format, (width, height), usage)
    }

    fn with(
        gpu: &Arc<Gpu>,
        name: &str,
        format: Format,
        (width, height): (u32, u32),
        usage: vk::ImageUsageFlags,
    ) -> Result<Self, Error> {
        let limit = gpu.info.max_image_side;
        for side in [width, height] {
            if side == 0 || side > limit {
                return Err(Error::Limit {
                    what: format!("a side of image {name}"),
                    value: u64::from(side),
                    limit: u64::from(limit),
                });
            }
        }
        let target = match format {
            Format::Depth32 => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            _ => vk::ImageUsageFlags::COLOR_ATTACHMENT,
        };
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format.vk())
            .extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(
                target | usage | vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_SRC,
            )
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is alive; sides are within the limits; these formats and usages are mandatory in
        // Vulkan 1.3.
        let handle = unsafe { gpu.device.create_image(&info, None) }
            .map_err(Error::vulkan("vkCreateImage", name))?;
        let mut image = Self {
            gpu: gpu.clone(),
            handle,
            view: vk::ImageView::null(),
            memory: None,
            format,
            width,
            height,
            name: name.to_owned(),
            state: Mutex::default(),
        };
        // SAFETY: the image was just created from this device.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(handle) };
        let memory = gpu.allocate(name, requirements, MemoryLocation::GpuOnly, false)?;
        // SAFETY: memory and offset come from the allocator for these requirements; bound once.
        let bound = unsafe {
            gpu.device
                .bind_image_memory(handle, memory.memory(), memory.offset())
        };
        image.memory = Some(memory);
        bound.map_err(Error::vulkan("vkBindImageMemory", name))?;
        let view = vk::ImageViewCreateInfo::default()
            .image(handle)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format.vk())
            .subresource_range(range(format));
        // SAFETY: the image is bound and of this format.
        image.view = unsafe { gpu.device.create_image_view(&view, None) }
            .map_err(Error::vulkan("vkCreateImageView", name))?;
        gpu.name(handle, name);
        gpu.name(image.view, name);
        Ok(image)
    }

    /// Name, as in captures and memory reports.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Size of its pixels when copied out, bytes.
    pub fn bytes(&self) -> u64 {
        self.format.pixel_bytes() * u64::from(self.width) * u64::from(self.height)
    }
}

/// The one level and layer of an image.
pub(super) fn range(format: Format) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: format.aspect(),
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        match self.memory.take() {
            Some(memory) => self
                .gpu
                .bury(Remains::Image(self.handle, self.view, memory)),
            // SAFETY: creation failed before any use; destroyed once, here. A null view is allowed.
            None => unsafe {
                self.gpu.device.destroy_image_view(self.view, None);
                self.gpu.device.destroy_image(self.handle, None);
            },
        }
    }
}
