//! The only place with Vulkan: a thin owned layer over Vulkan 1.3 (dynamic rendering, synchronization2).
//!
//! [`Gpu`] is the root that owns entry, instance, messenger, device, queue and allocator; its `Drop` destroys
//! them in an order written by hand. Resources own handle, memory and name and keep the root alive; dropping
//! one puts its handles on a list that is emptied when the device has passed the last submission that could
//! use them. Commands are recorded only through [`frame::FrameRecorder`] and its passes.

#![expect(
    unsafe_code,
    reason = "this is the GPU layer; every block says why it is sound"
)]

pub mod access;
pub mod bind;
pub mod buffer;
pub mod clock;
pub mod compute;
mod copy;
pub mod device;
pub mod faults;
#[cfg(test)]
pub(crate) mod for_tests;
pub mod frame;
pub mod image;
mod indirect;
mod loader_lock;
pub mod messages;
#[cfg(feature = "viewer")]
pub mod overlay;
mod pass;
pub mod pipeline;
pub mod profile;
mod query;
mod slot;
#[cfg(feature = "viewer")]
pub mod surface;

use ash::{khr, vk};
use device::DeviceInfo;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use messages::LayerMessages;
use std::collections::VecDeque;
use std::ffi::CStr;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Why the device could not do what was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no Vulkan loader.
    #[error(
        "no Vulkan loader on this machine ({0}). Install it (Debian/Ubuntu: apt install libvulkan1 mesa-vulkan-drivers; Fedora: dnf install vulkan-loader mesa-vulkan-drivers; Arch: pacman -S vulkan-icd-loader vulkan-swrast), or draw on the processor with --backend cpu"
    )]
    NoLoader(String),
    /// There is a loader but no usable device.
    #[error(
        "no usable Vulkan 1.3 device: {0}. Install a driver (a software one: Debian/Ubuntu: apt install mesa-vulkan-drivers), or draw on the processor with --backend cpu"
    )]
    NoDevice(String),
    /// The device that was asked for is not there.
    #[error("no device matches {wanted:?}; there is: {available}")]
    UnknownDevice {
        /// Name or index that was asked for.
        wanted: String,
        /// The devices of this machine.
        available: String,
    },
    /// Validation was asked for and the layer is missing.
    #[error(
        "the validation layer VK_LAYER_KHRONOS_validation is not installed (Debian/Ubuntu: apt install vulkan-validationlayers)"
    )]
    NoValidation,
    /// A Vulkan call failed.
    #[error("{call} failed for {object}: {result}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// Object of the call.
        object: String,
        /// Answer of Vulkan.
        result: vk::Result,
    },
    /// Memory ran out or could not be had.
    #[error("cannot allocate {bytes} bytes of {place} memory for {object}: {cause}")]
    Memory {
        /// Object of the memory.
        object: String,
        /// Number of bytes.
        bytes: u64,
        /// Kind of memory.
        place: &'static str,
        /// The allocator's reason.
        cause: String,
    },
    /// The device cannot show pictures in this window.
    #[error(
        "{device} cannot show pictures in a window: {cause}. Choose another with --device (see surfel devices), or make pictures with surfel render"
    )]
    Surface {
        /// The device.
        device: String,
        /// Reason of the failure.
        cause: String,
    },
    /// The device lacks what this needs.
    #[error("{what} cannot be drawn: {why}")]
    Unsupported {
        /// Feature that was asked for.
        what: &'static str,
        /// Reason why it is not there.
        why: String,
    },
    /// Something is larger than the device allows.
    #[error("{what} is {value}; this device allows {limit}")]
    Limit {
        /// Name of the quantity.
        what: String,
        /// Value that was wanted.
        value: u64,
        /// Largest value that is allowed.
        limit: u64,
    },
}

impl Error {
    fn vulkan(call: &'static str, object: impl Into<String>) -> impl FnOnce(vk::Result) -> Self {
        let object = object.into();
        move |result| Self::Vulkan {
            call,
            object,
            result,
        }
    }
}

/// Options of opening a device.
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// Part of a device's name or its index in [`device::list`]; `None` takes the best.
    pub device: Option<String>,
    /// Load the validation layer with synchronization validation; messages go to [`Gpu::messages`].
    pub validation: bool,
    /// Give mapped memory out as a copy that reaches the device only by an explicit flush, as on a device
    /// whose memory is not coherent. For tests: a forgotten flush shows in the picture.
    pub pretend_noncoherent: bool,
    /// A call that fails on purpose. For tests.
    pub call_faults: Option<faults::CallFaults>,
    /// Takes abilities and limits away from the device before it is used. For tests.
    pub narrowed: Option<fn(&mut DeviceInfo)>,
    /// Instance extensions that a window system needs; also asks for a device that can present.
    pub surface_extensions: Vec<String>,
}

/// Handles of a dropped resource, waiting for the device to be done with them.
enum RetiredResource {
    Buffer(vk::Buffer, Allocation),
    Image(vk::Image, vk::ImageView, Allocation),
    Pipeline(vk::Pipeline),
    PipelineLayout(vk::PipelineLayout),
    DescriptorSetLayout(vk::DescriptorSetLayout),
    CommandPool(vk::CommandPool),
    QueryPool(vk::QueryPool),
    DescriptorPool(vk::DescriptorPool),
}

/// The root of everything on the device.
pub struct Gpu {
    info: DeviceInfo,
    messages: LayerMessages,
    pretend_noncoherent: bool,
    // Destroyed by hand, in this order.
    remains: Mutex<VecDeque<(u64, RetiredResource)>>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    timeline: vk::Semaphore,
    pipeline_cache: vk::PipelineCache,
    kept_pipelines: Mutex<pipeline::KeptPipelines>,
    /// Reads single texels; passes that filter do it by themselves.
    sampler: vk::Sampler,
    device: ash::Device,
    debug_device: Option<ash::ext::debug_utils::Device>,
    calibration: Option<clock::ClockFunctions>,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    instance: ash::Instance,
    entry: ash::Entry,
    #[cfg(feature = "viewer")]
    physical: vk::PhysicalDevice,
    queue: Mutex<vk::Queue>,
    queue_family: u32,
    submitted: AtomicU64,
    compiled_pipelines: AtomicU64,
    created_resources: AtomicU64,
    /// A binding of the frame being recorded could not be made.
    binding_failure: Mutex<Option<vk::Result>>,
    /// Dropped last, after `Drop` has destroyed the device.
    fault_guard: Option<faults::FaultGuard>,
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu")
            .field("info", &self.info)
            .finish_non_exhaustive()
    }
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic while a lock is held leaves data that is still whole here: every critical section is one call.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// Opens the device that `options` asks for.
    ///
    /// # Errors
    /// When there is no loader, no device of Vulkan 1.3 with the features needed, none of the wanted name, no
    /// validation layer although asked for, or a Vulkan call fails.
    pub fn open(options: &DeviceOptions) -> Result<Arc<Self>, Error> {
        let messages = LayerMessages::default();
        let entry = device::load_entry()?;
        // The guard goes last wherever this ends.
        let (fault_guard, entry) = match &options.call_faults {
            Some(faults) => {
                faults.listen(&messages);
                let (guard, entry) = faults::count(entry, faults);
                (Some(guard), entry)
            }
            None => (None, entry),
        };
        let instance = device::VulkanInstance::create(&entry, options, &messages)?;
        let mut chosen = device::choose(&entry, &instance, options)?;
        if let Some(narrow) = options.narrowed {
            narrow(&mut chosen.info);
        }
        let (device, queue) = device::create(&instance, &chosen, options)?;
        // From here on the root owns everything, so that a failure below is cleaned up by its Drop.
        let (instance, messenger, has_debug) = instance.into_parts();
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: chosen.physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        });
        let turn = loader_lock::read();
        let debug_device =
            has_debug.then(|| ash::ext::debug_utils::Device::new(&instance, &device));
        let calibration = chosen
            .calibration
            .map(|name| clock::ClockFunctions::new(&instance, &device, name));
        drop(turn);
        let allocator = match allocator {
            Ok(allocator) => allocator,
            Err(cause) => {
                let _turn = loader_lock::change();
                // SAFETY: nothing was made from the device yet; the messenger goes before its instance.
                unsafe {
                    device.destroy_device(None);
                    if let Some((debug, messenger)) = messenger {
                        debug.destroy_debug_utils_messenger(messenger, None);
                    }
                    instance.destroy_instance(None);
                }
                return Err(Error::Memory {
                    object: "the allocator".into(),
                    bytes: 0,
                    place: "device",
                    cause: cause.to_string(),
                });
            }
        };
        let mut gpu = Self {
            info: chosen.info,
            messages,
            pretend_noncoherent: options.pretend_noncoherent,
            remains: Mutex::default(),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            timeline: vk::Semaphore::null(),
            pipeline_cache: vk::PipelineCache::null(),
            kept_pipelines: Mutex::default(),
            sampler: vk::Sampler::null(),
            device,
            debug_device,
            calibration,
            messenger,
            instance,
            entry,
            #[cfg(feature = "viewer")]
            physical: chosen.physical,
            queue: Mutex::new(queue),
            queue_family: chosen.queue_family,
            submitted: AtomicU64::new(0),
            compiled_pipelines: AtomicU64::new(0),
            created_resources: AtomicU64::new(0),
            binding_failure: Mutex::new(None),
            fault_guard,
        };
        let mut kind = vk::SemaphoreTypeCreateInfo::default()
            .semaphore_type(vk::SemaphoreType::TIMELINE)
            .initial_value(0);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive and has the timelineSemaphore feature.
        gpu.timeline = unsafe { gpu.device.create_semaphore(&info, None) }
            .map_err(Error::vulkan("vkCreateSemaphore", "the timeline"))?;
        gpu.pipeline_cache = pipeline::load_cache(&gpu)?;
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::NEAREST)
            .min_filter(vk::Filter::NEAREST)
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE);
        // SAFETY: the device is alive.
        gpu.sampler = unsafe { gpu.device.create_sampler(&info, None) }
            .map_err(Error::vulkan("vkCreateSampler", "the sampler"))?;
        gpu.name(gpu.sampler, "nearest");
        gpu.name(gpu.timeline, "timeline");
        gpu.name(gpu.device.handle(), "surfel");
        gpu.name(queue, "queue");
        gpu.name(gpu.pipeline_cache, "pipelines");
        Ok(Arc::new(gpu))
    }

    /// The device: name, kind, limits.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Messages of the validation layer so far; the list outlives the device.
    pub fn messages(&self) -> &LayerMessages {
        &self.messages
    }

    /// Number of pipelines compiled since the device was opened. A frame loop must not raise it.
    pub fn compiled_pipelines(&self) -> u64 {
        self.compiled_pipelines.load(Ordering::Relaxed)
    }

    /// Number of buffers and images created since the device was opened. A frame loop must not raise it
    /// once its buffers have grown to their size.
    pub fn created_resources(&self) -> u64 {
        self.created_resources.load(Ordering::Relaxed)
    }

    /// Live allocations by name, largest first: (name, bytes).
    pub fn memory_report(&self) -> Vec<(String, u64)> {
        let report = lock(&self.allocator).generate_report();
        let mut rows: Vec<(String, u64)> = report
            .allocations
            .into_iter()
            .map(|a| (a.name, a.size))
            .collect();
        rows.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        rows
    }

    /// Waits until the device has done everything. For shutdown and resize, not for the frame loop.
    pub fn wait_idle(&self) {
        let _queue = lock(&self.queue);
        // SAFETY: the device is alive and the queue is externally synchronized by the lock.
        if let Err(result) = unsafe { self.device.device_wait_idle() } {
            tracing::error!("vkDeviceWaitIdle: {result}");
        }
    }

    #[cfg(feature = "viewer")]
    fn swapchains(&self) -> khr::swapchain::Device {
        let _turn = loader_lock::read();
        khr::swapchain::Device::new(&self.instance, &self.device)
    }

    fn name<T: vk::Handle>(&self, handle: T, name: &str) {
        let Some(debug) = &self.debug_device else {
            return;
        };
        let mut bytes: Vec<u8> = name.bytes().filter(|b| *b != 0).collect();
        bytes.push(0);
        let Ok(text) = CStr::from_bytes_with_nul(&bytes) else {
            return;
        };
        let info = vk::DebugUtilsObjectNameInfoEXT::default()
            .object_handle(handle)
            .object_name(text);
        let _turn = loader_lock::read();
        // SAFETY: the handle belongs to this device and is alive; names are only a help, so a failure is
        // ignored.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Opens a label in a command buffer being recorded; cut off after 63 bytes.
    fn begin_label(&self, commands: vk::CommandBuffer, name: &str) {
        let Some(debug) = &self.debug_device else {
            return;
        };
        let mut text = [0u8; 64];
        let length = name.len().min(text.len() - 1);
        text[..length].copy_from_slice(&name.as_bytes()[..length]);
        if let Ok(label) = CStr::from_bytes_until_nul(&text) {
            let info = vk::DebugUtilsLabelEXT::default().label_name(label);
            // SAFETY: the command buffer is being recorded; the callers close the label with `end_label`.
            unsafe { debug.cmd_begin_debug_utils_label(commands, &info) };
        }
    }

    /// Closes the label that was opened last.
    fn end_label(&self, commands: vk::CommandBuffer) {
        if let Some(debug) = &self.debug_device {
            // SAFETY: closes what `begin_label` opened in this command buffer.
            unsafe { debug.cmd_end_debug_utils_label(commands) };
        }
    }

    fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: gpu_allocator::MemoryLocation,
        linear: bool,
    ) -> Result<Allocation, Error> {
        self.created_resources.fetch_add(1, Ordering::Relaxed);
        lock(&self.allocator)
            .allocate(&AllocationCreateDesc {
                name,
                requirements,
                location,
                linear,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|cause| Error::Memory {
                object: name.into(),
                bytes: requirements.size,
                place: match location {
                    gpu_allocator::MemoryLocation::GpuOnly => "device",
                    gpu_allocator::MemoryLocation::CpuToGpu => "upload",
                    _ => "readback",
                },
                cause: cause.to_string(),
            })
    }

    /// Takes the handles of a dropped resource; they are destroyed once no submission can use them.
    fn bury(&self, remains: RetiredResource) {
        // The submission being recorded now, if any, is the next one.
        let last_use = self.submitted.load(Ordering::Acquire) + 1;
        lock(&self.remains).push_back((last_use, remains));
    }

    /// Destroys what the device is done with.
    fn collect(&self) {
        // SAFETY: the semaphore is alive and a timeline.
        let Ok(done) = (unsafe { self.device.get_semaphore_counter_value(self.timeline) }) else {
            return;
        };
        loop {
            let next = {
                let mut list = lock(&self.remains);
                match list.front() {
                    Some((last_use, _)) if *last_use <= done => list.pop_front(),
                    _ => None,
                }
            };
            let Some((_, remains)) = next else { return };
            self.destroy(remains);
        }
    }

    fn destroy(&self, remains: RetiredResource) {
        // SAFETY: the handles came from this device, each is destroyed once (its owner is gone), and the
        // device has passed the last submission that could use it or is idle.
        unsafe {
            match remains {
                RetiredResource::Buffer(buffer, memory) => {
                    self.device.destroy_buffer(buffer, None);
                    self.free(memory);
                }
                RetiredResource::Image(image, view, memory) => {
                    self.device.destroy_image_view(view, None);
                    self.device.destroy_image(image, None);
                    self.free(memory);
                }
                RetiredResource::Pipeline(pipeline) => self.device.destroy_pipeline(pipeline, None),
                RetiredResource::PipelineLayout(layout) => {
                    self.device.destroy_pipeline_layout(layout, None)
                }
                RetiredResource::DescriptorSetLayout(layout) => {
                    self.device.destroy_descriptor_set_layout(layout, None)
                }
                RetiredResource::CommandPool(pool) => self.device.destroy_command_pool(pool, None),
                RetiredResource::QueryPool(pool) => self.device.destroy_query_pool(pool, None),
                RetiredResource::DescriptorPool(pool) => {
                    self.device.destroy_descriptor_pool(pool, None)
                }
            }
        }
    }

    fn free(&self, memory: Allocation) {
        if let Err(cause) = lock(&self.allocator).free(memory) {
            tracing::error!("freeing device memory: {cause}");
        }
    }

    /// Submits a recorded command buffer and returns the timeline value that it signals. The stages given
    /// with `waits` wait for these binary semaphores; `signals` are signalled beside the timeline.
    fn submit(
        &self,
        commands: vk::CommandBuffer,
        waits: Option<(vk::Semaphore, vk::PipelineStageFlags2)>,
        signals: Option<vk::Semaphore>,
    ) -> Result<u64, Error> {
        let queue = lock(&self.queue);
        let value = self.submitted.load(Ordering::Acquire) + 1;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let signal = |semaphore| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(semaphore)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        // The second entries are used only where a window is presented to.
        let all_signals = [
            signal(self.timeline).value(value),
            signal(signals.unwrap_or_default()),
        ];
        let all_signals = &all_signals[..1 + usize::from(signals.is_some())];
        let (semaphore, stages) = waits.unwrap_or_default();
        let wait = [vk::SemaphoreSubmitInfo::default()
            .semaphore(semaphore)
            .stage_mask(stages)];
        let waits = &wait[..usize::from(waits.is_some())];
        let submit = vk::SubmitInfo2::default()
            .command_buffer_infos(&commands)
            .wait_semaphore_infos(waits)
            .signal_semaphore_infos(all_signals);
        // SAFETY: the queue is locked, the command buffer is recorded and not pending (its frame slot was
        // waited for), the semaphores are alive, and the timeline value rises.
        unsafe {
            self.device
                .queue_submit2(*queue, &[submit], vk::Fence::null())
        }
        .map_err(Error::vulkan("vkQueueSubmit2", "a frame"))?;
        self.submitted.store(value, Ordering::Release);
        Ok(value)
    }

    /// Waits until the submission that signals `value` has finished.
    fn wait_for(&self, value: u64) -> Result<(), Error> {
        if value == 0 {
            return Ok(());
        }
        let semaphores = [self.timeline];
        let values = [value];
        let info = vk::SemaphoreWaitInfo::default()
            .semaphores(&semaphores)
            .values(&values);
        // SAFETY: the semaphore is alive and a timeline; `value` has been submitted.
        unsafe { self.device.wait_semaphores(&info, u64::MAX) }
            .map_err(Error::vulkan("vkWaitSemaphores", "a frame"))
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        self.wait_idle();
        pipeline::store_cache(self);
        let kept = std::mem::take(&mut *lock(&self.kept_pipelines));
        kept.remains().for_each(|remains| self.destroy(remains));
        loop {
            let next = lock(&self.remains).pop_front();
            let Some((_, remains)) = next else { break };
            self.destroy(remains);
        }
        let _turn = loader_lock::change();
        // SAFETY: the device is idle, every resource is gone (each kept this root alive), the allocator goes
        // before its device, the messenger after the device so that it sees leaks, the instance last. The
        // allocator is not used after this.
        unsafe {
            self.device.destroy_sampler(self.sampler, None);
            self.device
                .destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_semaphore(self.timeline, None);
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_device(None);
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
        // Dropped last: the loader's library, and what counts its calls.
        let _ = (&self.entry, &self.fault_guard);
    }
}

/// The swapchain extension's name, for device creation.
const SWAPCHAIN: &CStr = khr::swapchain::NAME;
