//! Buffers: on the device, mapped for upload, mapped for readback.

use super::access::ResourceState;
use super::{Error, Gpu, RetiredResource, lock};
use crate::threads;
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Common part of all buffers: handle, memory, name, state.
#[derive(Debug)]
struct RawBuffer {
    gpu: Arc<Gpu>,
    handle: vk::Buffer,
    memory: Option<Allocation>,
    bytes: u64,
    name: String,
    state: Mutex<ResourceState>,
}

impl RawBuffer {
    fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Self, Error> {
        let bytes = bytes.max(4);
        let limit = gpu.info.max_buffer.min(gpu.info.max_allocation);
        if bytes > limit {
            return Err(Error::Limit {
                what: format!("the size of buffer {name}"),
                value: bytes,
                limit,
            });
        }
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive; the size is above 0 and within the limits.
        let handle = unsafe { gpu.device.create_buffer(&info, None) }
            .map_err(Error::vulkan("vkCreateBuffer", name))?;
        // Owned from here on, so that a failure below does not leak it.
        let mut raw = Self {
            gpu: gpu.clone(),
            handle,
            memory: None,
            bytes,
            name: name.to_owned(),
            state: Mutex::default(),
        };
        // SAFETY: the buffer was just created from this device.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(handle) };
        let memory = gpu.allocate(name, requirements, location, true)?;
        // SAFETY: memory and offset come from the allocator for these requirements; bound once.
        let bound = unsafe {
            gpu.device
                .bind_buffer_memory(handle, memory.memory(), memory.offset())
        };
        raw.memory = Some(memory);
        bound.map_err(Error::vulkan("vkBindBufferMemory", name))?;
        gpu.name(handle, name);
        Ok(raw)
    }

    fn mapped(&self) -> Option<&[u8]> {
        Some(&self.memory.as_ref()?.mapped_slice()?[..self.bytes as usize])
    }

    fn mapped_mut(&mut self) -> Option<&mut [u8]> {
        Some(&mut self.memory.as_mut()?.mapped_slice_mut()?[..self.bytes as usize])
    }

    /// Makes host writes available to the device, or device writes available to the host. The allocator
    /// takes coherent memory only, where Vulkan asks for nothing; kept as one place for others.
    fn is_coherent(&self) -> bool {
        self.memory.as_ref().is_some_and(|m| {
            m.memory_properties()
                .contains(vk::MemoryPropertyFlags::HOST_COHERENT)
        })
    }
}

impl RawBuffer {
    /// Tells whether the processor caches the mapped memory.
    fn is_cached(&self) -> bool {
        self.memory.as_ref().is_some_and(|m| {
            m.memory_properties()
                .contains(vk::MemoryPropertyFlags::HOST_CACHED)
        })
    }
}

impl Drop for RawBuffer {
    fn drop(&mut self) {
        match self.memory.take() {
            Some(memory) => self.gpu.bury(RetiredResource::Buffer(self.handle, memory)),
            // SAFETY: creation failed before any use; the handle is destroyed once, here.
            None => unsafe { self.gpu.device.destroy_buffer(self.handle, None) },
        }
    }
}

/// A buffer that passes can declare as read or written.
pub trait AnyBuffer: std::fmt::Debug {
    /// The handle; valid while the buffer lives.
    #[doc(hidden)]
    fn handle(&self) -> vk::Buffer;
    /// Name, as in captures and memory reports.
    fn name(&self) -> &str;
    /// Size in bytes.
    fn bytes(&self) -> u64;
    #[doc(hidden)]
    fn state(&self) -> &Mutex<ResourceState>;
}

macro_rules! any_buffer {
    ($type:ty) => {
        impl AnyBuffer for $type {
            fn handle(&self) -> vk::Buffer {
                self.raw.handle
            }
            fn name(&self) -> &str {
                &self.raw.name
            }
            fn bytes(&self) -> u64 {
                self.raw.bytes
            }
            fn state(&self) -> &Mutex<ResourceState> {
                &self.raw.state
            }
        }
    };
}

/// Memory of the device, filled once.
#[derive(Debug)]
pub struct DeviceBuffer {
    raw: RawBuffer,
}

any_buffer!(DeviceBuffer);

/// Purpose of a device buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BufferUsage {
    /// Vertex attributes, and storage of compute passes.
    Vertex,
    /// Indices.
    Index,
    /// Storage of compute passes.
    Storage,
    /// Vertex attributes, indices, or arguments of draws and dispatches that compute passes write; may be copied from.
    List,
}

impl BufferUsage {
    fn flags(self) -> vk::BufferUsageFlags {
        match self {
            Self::Vertex => {
                vk::BufferUsageFlags::VERTEX_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER
            }
            Self::Index => vk::BufferUsageFlags::INDEX_BUFFER,
            Self::Storage => vk::BufferUsageFlags::STORAGE_BUFFER,
            Self::List => {
                vk::BufferUsageFlags::VERTEX_BUFFER
                    | vk::BufferUsageFlags::INDEX_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER
                    | vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
            }
        }
    }
}

/// Bytes staged at a time when device memory cannot be mapped.
const STAGING_BYTES: usize = 32 << 20;

impl DeviceBuffer {
    /// Makes a buffer of `bytes` bytes that the device writes, or [`DeviceBuffer::write`]. Its contents are undefined until
    /// then.
    ///
    /// # Errors
    /// When memory cannot be had or `bytes` is more than the device's buffers hold.
    pub fn new(gpu: &Arc<Gpu>, name: &str, usage: BufferUsage, bytes: u64) -> Result<Self, Error> {
        let flags = usage.flags() | vk::BufferUsageFlags::TRANSFER_DST;
        let raw = RawBuffer::new(gpu, name, bytes, flags, MemoryLocation::GpuOnly)?;
        Ok(Self { raw })
    }

    /// Makes a buffer that holds `data`: written directly where device memory is mapped, else through staged
    /// copies. Waits for the copies; not for the frame loop.
    ///
    /// # Errors
    /// When memory cannot be had or `data` is larger than the device's buffers.
    pub fn with_data(
        gpu: &Arc<Gpu>,
        name: &str,
        usage: BufferUsage,
        data: &[u8],
    ) -> Result<Self, Error> {
        let mut buffer = Self::new(gpu, name, usage, data.len() as u64)?;
        buffer.write(gpu, 0, data)?;
        Ok(buffer)
    }

    /// Writes bytes from byte `offset` on, and waits until they are there. No submission may read or write this part
    /// meanwhile; others may use the rest.
    ///
    /// # Errors
    /// [`Error::Limit`] past the buffer's end; when memory runs out or the device is lost.
    pub fn write(&mut self, gpu: &Arc<Gpu>, offset: u64, data: &[u8]) -> Result<(), Error> {
        let end = offset.saturating_add(data.len() as u64);
        if end > self.raw.bytes {
            return Err(Error::Limit {
                what: format!("the end of what is written to {}", self.raw.name),
                value: end,
                limit: self.raw.bytes,
            });
        }
        let may_map = self.raw.is_coherent() && !gpu.pretend_noncoherent;
        if let (true, Some(mapped)) = (may_map, self.raw.mapped_mut()) {
            mapped[offset as usize..end as usize].copy_from_slice(data);
            return Ok(());
        }
        if data.is_empty() {
            return Ok(());
        }
        let mut staging = UploadBuffer::new(
            gpu,
            &format!("staging for {}", self.raw.name),
            STAGING_BYTES.min(data.len()) as u64,
        )?;
        for (index, chunk) in data.chunks(STAGING_BYTES).enumerate() {
            staging.bytes_mut()[..chunk.len()].copy_from_slice(chunk);
            staging.flush(0..chunk.len() as u64);
            let at = offset + (index * STAGING_BYTES) as u64;
            super::frame::copy_once(gpu, &staging, self, at, chunk.len() as u64)?;
        }
        Ok(())
    }
}

/// Host-visible memory that the host writes and the device reads, mapped for its whole life.
///
/// Bytes written through [`bytes_mut`](UploadBuffer::bytes_mut) reach the device only after
/// [`flush`](UploadBuffer::flush), and must not change while a submission reads them: keep one upload buffer per
/// frame in flight.
#[derive(Debug)]
pub struct UploadBuffer {
    raw: RawBuffer,
    shadow: Option<Vec<u8>>,
}

any_buffer!(UploadBuffer);

impl UploadBuffer {
    /// Makes a buffer of `bytes` bytes usable as vertices, indices, uniforms, storage and copy source.
    ///
    /// # Errors
    /// When memory cannot be had.
    pub fn new(gpu: &Arc<Gpu>, name: &str, bytes: u64) -> Result<Self, Error> {
        Self::with_copy(gpu, name, bytes, |_| false)
    }

    /// Makes the same, of which the host may also read what it has written. The mapped memory of a graphics card is not
    /// cached: a read takes about a microsecond (measured on an H200). There the bytes lie in the host's memory, and a flush
    /// copies them.
    ///
    /// # Errors
    /// When memory cannot be had.
    pub fn readable(gpu: &Arc<Gpu>, name: &str, bytes: u64) -> Result<Self, Error> {
        Self::with_copy(gpu, name, bytes, |raw| !raw.is_cached())
    }

    fn with_copy(
        gpu: &Arc<Gpu>,
        name: &str,
        bytes: u64,
        has_copy: impl Fn(&RawBuffer) -> bool,
    ) -> Result<Self, Error> {
        let usage = vk::BufferUsageFlags::VERTEX_BUFFER
            | vk::BufferUsageFlags::INDEX_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC;
        let mut raw = RawBuffer::new(gpu, name, bytes, usage, MemoryLocation::CpuToGpu)?;
        let object = raw.name.clone();
        let size = raw.bytes;
        let has_copy = gpu.pretend_noncoherent || has_copy(&raw);
        let shadow = has_copy.then(|| vec![0; size as usize]);
        match raw.mapped_mut() {
            // Vulkan does not clear memory; nothing uninitialized is ever read through a slice.
            Some(mapped) => mapped.fill(0),
            None => {
                return Err(Error::Memory {
                    object,
                    bytes: size,
                    place: "upload",
                    cause: "it is not mapped".into(),
                });
            }
        }
        Ok(Self { raw, shadow })
    }

    /// The mapped bytes, or those that a flush copies there.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        match &mut self.shadow {
            Some(shadow) => shadow,
            None => self.raw.mapped_mut().unwrap_or_default(),
        }
    }

    /// Makes the bytes of `range` visible to submissions that come after.
    pub fn flush(&mut self, range: Range<u64>) {
        let range = range.start as usize..range.end as usize;
        if let Some(shadow) = &self.shadow
            && let Some(mapped) = self.raw.memory.as_mut().and_then(|m| m.mapped_slice_mut())
        {
            copy_shared(&shadow[range.clone()], &mut mapped[range]);
        }
        debug_assert!(
            self.raw.is_coherent(),
            "gpu-allocator gives coherent upload memory only"
        );
    }
}

/// Bytes that one thread copies at a time.
const COPIED_BYTES: usize = 1 << 18;

/// Copies bytes, many of them by several threads: one alone does not fill the bus of a graphics card.
fn copy_shared(from: &[u8], to: &mut [u8]) {
    let count = threads::count().min(from.len().div_ceil(COPIED_BYTES));
    let parts = from.chunks(COPIED_BYTES).zip(to.chunks_mut(COPIED_BYTES));
    threads::share(&mut vec![(); count], parts, |(), (from, to)| {
        to.copy_from_slice(from);
    });
}

/// Host-visible memory that the device writes and the host reads, mapped for its whole life.
#[derive(Debug)]
pub struct ReadbackBuffer {
    raw: RawBuffer,
    shadow: Option<Vec<u8>>,
}

any_buffer!(ReadbackBuffer);

impl ReadbackBuffer {
    /// Makes a buffer of `bytes` bytes that copies can write.
    ///
    /// # Errors
    /// When memory cannot be had.
    pub fn new(gpu: &Arc<Gpu>, name: &str, bytes: u64) -> Result<Self, Error> {
        let mut raw = RawBuffer::new(
            gpu,
            name,
            bytes,
            vk::BufferUsageFlags::TRANSFER_DST,
            MemoryLocation::GpuToCpu,
        )?;
        let shadow = gpu.pretend_noncoherent.then(|| vec![0; raw.bytes as usize]);
        if let Some(mapped) = raw.mapped_mut() {
            mapped.fill(0);
        }
        Ok(Self { raw, shadow })
    }

    /// The bytes as of the last finished submission that copied into the buffer and declared it read by the
    /// host; the caller has waited for that submission.
    pub fn bytes(&mut self) -> &[u8] {
        match &mut self.shadow {
            Some(shadow) => {
                if let Some(mapped) = self.raw.memory.as_ref().and_then(|m| m.mapped_slice()) {
                    let length = shadow.len();
                    shadow.copy_from_slice(&mapped[..length]);
                }
                shadow
            }
            None => self.raw.mapped().unwrap_or_default(),
        }
    }
}

/// The state cell of a buffer, locked.
pub(super) fn state_of(buffer: &dyn AnyBuffer) -> std::sync::MutexGuard<'_, ResourceState> {
    lock(buffer.state())
}
