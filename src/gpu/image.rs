//! Images that passes draw into, sample and copy.

use super::access::{ResourceAccess, ResourceState};
use super::{Error, Gpu, RetiredResource, lock};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use std::sync::{Arc, Mutex};

/// Pixel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ImageFormat {
    /// Eight bits a channel, 0..=1.
    Rgba8,
    /// One 32-bit float.
    R32Float,
    /// One 32-bit whole number.
    R32Uint,
    /// Two 32-bit floats.
    Rg32Float,
    /// Four 16-bit floats.
    Rgba16Float,
    /// Four 32-bit floats.
    Rgba32Float,
    /// 32-bit float depth, reversed: 1 at the near plane, 0 at the far plane.
    Depth32,
}

impl ImageFormat {
    /// Bytes of one pixel.
    pub fn pixel_bytes(self) -> u64 {
        match self {
            Self::Rgba8 | Self::R32Float | Self::R32Uint | Self::Depth32 => 4,
            Self::Rg32Float => 8,
            Self::Rgba16Float => 8,
            Self::Rgba32Float => 16,
        }
    }

    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::R32Float => vk::Format::R32_SFLOAT,
            Self::R32Uint => vk::Format::R32_UINT,
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
pub struct DeviceImage {
    gpu: Arc<Gpu>,
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    memory: Option<Allocation>,
    /// Pixel format.
    pub format: ImageFormat,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    name: String,
    pub(super) state: Mutex<ResourceState>,
    rows: Option<MappedRows>,
}

/// Place of the rows of an image that the processor writes.
#[derive(Debug)]
struct MappedRows {
    /// The first byte in the image's memory, and bytes from row to row: multiples of 4.
    first: usize,
    pitch: usize,
    shadow: Option<Vec<u8>>,
}

/// Memory that an image lies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ImageMemory {
    /// Memory of the device.
    Device,
    /// Mapped, row by row.
    Mapped,
}

/// Uses of a mapped image.
pub(super) const MAPPED_USAGE: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::SAMPLED.as_raw() | vk::ImageUsageFlags::TRANSFER_SRC.as_raw(),
);
/// Format of a mapped image.
pub(super) const MAPPED_FORMAT: ImageFormat = ImageFormat::Rgba8;

impl DeviceImage {
    /// Makes an image that can be a target, sampled and copied from. Its contents are undefined until a pass
    /// clears it.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory cannot be had.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        format: ImageFormat,
        width: u32,
        height: u32,
    ) -> Result<Self, Error> {
        let usage = target(format);
        Self::with(
            gpu,
            name,
            format,
            (width, height),
            usage,
            ImageMemory::Device,
        )
    }

    /// Makes an image as [`new`](DeviceImage::new) does that can be copied to as well.
    ///
    /// # Errors
    /// As there.
    pub fn copied_to(
        gpu: &Arc<Gpu>,
        name: &str,
        format: ImageFormat,
        width: u32,
        height: u32,
    ) -> Result<Self, Error> {
        let usage = target(format) | vk::ImageUsageFlags::TRANSFER_DST;
        Self::with(
            gpu,
            name,
            format,
            (width, height),
            usage,
            ImageMemory::Device,
        )
    }

    /// Makes a picture of eight bits a channel that the host writes, in memory that is mapped for its whole life; it can be sampled
    /// and copied from. Black, and empty, at first. `None` where the device has no such images of this size.
    ///
    /// Words written through [`words_mut`](DeviceImage::words_mut) reach the device only after [`flush`](DeviceImage::flush), and must not
    /// change while a submission reads them.
    ///
    /// # Errors
    /// When a side is 0, or memory cannot be had.
    pub fn mapped(
        gpu: &Arc<Gpu>,
        name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<Self>, Error> {
        if width.max(height) > gpu.info.max_mapped_side {
            return Ok(None);
        }
        let mut image = Self::with(
            gpu,
            name,
            MAPPED_FORMAT,
            (width, height),
            MAPPED_USAGE,
            ImageMemory::Mapped,
        )?;
        let plane = vk::ImageSubresource {
            aspect_mask: MAPPED_FORMAT.aspect(),
            mip_level: 0,
            array_layer: 0,
        };
        // SAFETY: the image is alive, has linear tiling, and has this one level and layer.
        let layout = unsafe { gpu.device.get_image_subresource_layout(image.handle, plane) };
        let (first, pitch) = (layout.offset as usize, layout.row_pitch as usize);
        let word = size_of::<u32>();
        let bytes = pitch * (height as usize - 1) + width as usize * word;
        let memory = image.memory.as_mut();
        let mapped = memory.and_then(|memory| memory.mapped_slice_mut());
        let rows = mapped.and_then(|mapped| mapped.get_mut(first..first + bytes));
        match rows {
            // Vulkan does not clear memory; nothing uninitialized is ever read through a slice.
            Some(rows) if first.is_multiple_of(word) && pitch.is_multiple_of(word) => rows.fill(0),
            _ => return Ok(None),
        }
        image.rows = Some(MappedRows {
            first,
            pitch,
            shadow: gpu.pretend_noncoherent.then(|| vec![0; bytes]),
        });
        image.state = Mutex::new(ResourceState::mapped());
        Ok(Some(image))
    }

    /// The pixels of an image that the host writes, red in the lowest byte, and how many words lie from row to row; nothing of others.
    pub fn words_mut(&mut self) -> (&mut [u32], usize) {
        let Some(rows) = &mut self.rows else {
            return (&mut [], 0);
        };
        let length = rows.pitch * (self.height as usize - 1) + 4 * self.width as usize;
        let mapped = self.memory.as_mut().and_then(|m| m.mapped_slice_mut());
        let bytes = match (&mut rows.shadow, mapped) {
            (Some(shadow), _) => shadow,
            (None, Some(mapped)) => &mut mapped[rows.first..rows.first + length],
            (None, None) => return (&mut [], 0),
        };
        (bytemuck::cast_slice_mut(bytes), rows.pitch / 4)
    }

    /// Makes the words visible to submissions that come after.
    pub fn flush(&mut self) {
        let memory = self.memory.as_mut();
        if let Some(rows) = &self.rows
            && let Some(shadow) = &rows.shadow
            && let Some(mapped) = memory.and_then(|m| m.mapped_slice_mut())
        {
            mapped[rows.first..rows.first + shadow.len()].copy_from_slice(shadow);
        }
    }

    /// The layout that an access finds it in.
    pub(super) fn layout_of(&self, access: ResourceAccess) -> vk::ImageLayout {
        lock(&self.state).layout_of(access)
    }

    fn with(
        gpu: &Arc<Gpu>,
        name: &str,
        format: ImageFormat,
        (width, height): (u32, u32),
        usage: vk::ImageUsageFlags,
        place: ImageMemory,
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
        let is_mapped = place == ImageMemory::Mapped;
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
            .tiling(match place {
                ImageMemory::Device => vk::ImageTiling::OPTIMAL,
                ImageMemory::Mapped => vk::ImageTiling::LINEAR,
            })
            .usage(usage)
            .initial_layout(match place {
                ImageMemory::Device => vk::ImageLayout::UNDEFINED,
                ImageMemory::Mapped => vk::ImageLayout::PREINITIALIZED,
            });
        // SAFETY: the device is alive; sides are within the limits; these formats and usages are mandatory in
        // Vulkan 1.3, and the device was asked about the one of mapped images.
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
            rows: None,
        };
        // SAFETY: the image was just created from this device.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(handle) };
        let location = match place {
            ImageMemory::Device => MemoryLocation::GpuOnly,
            ImageMemory::Mapped => MemoryLocation::CpuToGpu,
        };
        let memory = gpu.allocate(name, requirements, location, is_mapped)?;
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

/// Uses of a target: to be drawn into, sampled and copied from.
fn target(format: ImageFormat) -> vk::ImageUsageFlags {
    let drawn = match format {
        ImageFormat::Depth32 => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
        _ => vk::ImageUsageFlags::COLOR_ATTACHMENT,
    };
    drawn | vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_SRC
}

/// The one level and layer of an image.
pub(super) fn range(format: ImageFormat) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: format.aspect(),
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}

impl Drop for DeviceImage {
    fn drop(&mut self) {
        match self.memory.take() {
            Some(memory) => self
                .gpu
                .bury(RetiredResource::Image(self.handle, self.view, memory)),
            // SAFETY: creation failed before any use; destroyed once, here. A null view is allowed.
            None => unsafe {
                self.gpu.device.destroy_image_view(self.view, None);
                self.gpu.device.destroy_image(self.handle, None);
            },
        }
    }
}
