//! Calls of Vulkan that fail on purpose: the table of a device's functions, with counting ones in the place of those that
//! can fail. For tests; a device opened without [`CallFaults`] has its own table.

use super::lock;
use ash::vk;
use std::ffi::c_void;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Ways in which a call fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CallFault {
    /// The host has no memory.
    OutOfHostMemory,
    /// The device has no memory.
    OutOfDeviceMemory,
    /// The device is lost, and stays so: every later call that can say it does.
    DeviceLost,
}

impl CallFault {
    fn result(self) -> vk::Result {
        match self {
            Self::OutOfHostMemory => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            Self::OutOfDeviceMemory => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            Self::DeviceLost => vk::Result::ERROR_DEVICE_LOST,
        }
    }
}

/// A fault at one call of a device, counted over the calls that the specification lets fail so. Clones share the count.
#[derive(Debug, Clone)]
pub struct CallFaults(Arc<FaultCounter>);

#[derive(Debug)]
struct FaultCounter {
    fault: CallFault,
    /// The call that fails, from 1 on; 0 for none.
    at: u64,
    calls: AtomicU64,
    is_lost: AtomicBool,
    failed: Mutex<Option<&'static str>>,
}

impl CallFaults {
    /// Lets call `at` fail, counted from 1; 0 lets none fail and only counts.
    pub fn new(fault: CallFault, at: u64) -> Self {
        Self(Arc::new(FaultCounter {
            fault,
            at,
            calls: AtomicU64::new(0),
            is_lost: AtomicBool::new(false),
            failed: Mutex::new(None),
        }))
    }

    /// How many calls there were that can fail so.
    pub fn calls(&self) -> u64 {
        self.0.calls.load(Ordering::Relaxed)
    }

    /// The call that failed, once it has.
    pub fn failed(&self) -> Option<&'static str> {
        *lock(&self.0.failed)
    }

    /// The result in the place of a call's own, when it is this one's turn.
    fn next(&self, name: &'static str, can_be_lost: bool) -> Option<vk::Result> {
        let counter = &*self.0;
        if counter.fault == CallFault::DeviceLost && !can_be_lost {
            return None;
        }
        let call = counter.calls.fetch_add(1, Ordering::Relaxed) + 1;
        if call == counter.at {
            *lock(&counter.failed) = Some(name);
            let is_lost = counter.fault == CallFault::DeviceLost;
            counter.is_lost.store(is_lost, Ordering::Relaxed);
            return Some(counter.fault.result());
        }
        let is_lost = counter.is_lost.load(Ordering::Relaxed);
        is_lost.then(|| counter.fault.result())
    }
}

/// The device whose calls are counted: one at a time, since a function of Vulkan knows nothing but its arguments.
static COUNTED: Mutex<Option<CountedDevice>> = Mutex::new(None);

#[derive(Clone)]
struct CountedDevice {
    faults: CallFaults,
    own: ash::Device,
}

/// Keeps the counted device in its place; dropped after the device.
pub(super) struct FaultGuard;

impl Drop for FaultGuard {
    fn drop(&mut self) {
        *lock(&COUNTED) = None;
    }
}

/// A call of the counted device: the fault in its place, or its own table.
fn turn(name: &'static str, can_be_lost: bool) -> Result<ash::Device, vk::Result> {
    let counted = lock(&COUNTED).clone();
    let Some(CountedDevice { faults, own }) = counted else {
        // Never: the guard outlives the device. There is no table to go on with.
        return Err(vk::Result::ERROR_UNKNOWN);
    };
    match faults.next(name, can_be_lost) {
        None => Ok(own),
        Some(result) => {
            if can_be_lost {
                // What waits for the device believes that it is idle or lost, and destroys.
                // SAFETY: the device is alive while it is counted. The caller owns the queue where the call is one of a queue;
                // waits are not called while another thread submits.
                let _ = unsafe { own.device_wait_idle() };
            }
            Err(result)
        }
    }
}

macro_rules! counted {
    ($($table:ident $can_be_lost:literal $name:literal $field:ident($($arg:ident: $kind:ty),*);)*) => {
        $(
            /// Stands for the function of this name.
            ///
            /// # Safety
            /// The promises of that function.
            unsafe extern "system" fn $field($($arg: $kind),*) -> vk::Result {
                match turn($name, $can_be_lost) {
                    // SAFETY: the arguments are the caller's, who keeps the promises of the function that this stands for.
                    Ok(own) => unsafe { (own.$table().$field)($($arg),*) },
                    Err(result) => result,
                }
            }
        )*

        /// The device with counting functions in its table.
        fn with_counting(own: &ash::Device) -> ash::Device {
            let mut tables = FunctionTables {
                fp_v1_0: own.fp_v1_0().clone(),
                fp_v1_2: own.fp_v1_2().clone(),
                fp_v1_3: own.fp_v1_3().clone(),
            };
            $(tables.$table.$field = $field;)*
            tables.fp_v1_0.create_graphics_pipelines = create_graphics_pipelines;
            tables.fp_v1_0.create_compute_pipelines = create_compute_pipelines;
            ash::Device::from_parts_1_3(
                own.handle(),
                tables.fp_v1_0,
                own.fp_v1_1().clone(),
                tables.fp_v1_2,
                tables.fp_v1_3,
            )
        }
    };
}

/// Tables that have functions which can fail.
struct FunctionTables {
    fp_v1_0: ash::DeviceFnV1_0,
    fp_v1_2: ash::DeviceFnV1_2,
    fp_v1_3: ash::DeviceFnV1_3,
}

counted! {
    fp_v1_0 false "vkAllocateMemory" allocate_memory(device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DeviceMemory);
    fp_v1_0 false "vkMapMemory" map_memory(device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize, flags: vk::MemoryMapFlags, out: *mut *mut c_void);
    fp_v1_0 false "vkFlushMappedMemoryRanges" flush_mapped_memory_ranges(device: vk::Device, count: u32, ranges: *const vk::MappedMemoryRange<'_>);
    fp_v1_0 false "vkInvalidateMappedMemoryRanges" invalidate_mapped_memory_ranges(device: vk::Device, count: u32, ranges: *const vk::MappedMemoryRange<'_>);
    fp_v1_0 false "vkBindBufferMemory" bind_buffer_memory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    fp_v1_0 false "vkBindImageMemory" bind_image_memory(device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    fp_v1_0 false "vkCreateBuffer" create_buffer(device: vk::Device, info: *const vk::BufferCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Buffer);
    fp_v1_0 false "vkCreateImage" create_image(device: vk::Device, info: *const vk::ImageCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Image);
    fp_v1_0 false "vkCreateImageView" create_image_view(device: vk::Device, info: *const vk::ImageViewCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::ImageView);
    fp_v1_0 false "vkCreateSampler" create_sampler(device: vk::Device, info: *const vk::SamplerCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Sampler);
    fp_v1_0 false "vkCreateSemaphore" create_semaphore(device: vk::Device, info: *const vk::SemaphoreCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Semaphore);
    fp_v1_0 false "vkCreateQueryPool" create_query_pool(device: vk::Device, info: *const vk::QueryPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::QueryPool);
    fp_v1_0 false "vkCreateShaderModule" create_shader_module(device: vk::Device, info: *const vk::ShaderModuleCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::ShaderModule);
    fp_v1_0 false "vkCreatePipelineCache" create_pipeline_cache(device: vk::Device, info: *const vk::PipelineCacheCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineCache);
    fp_v1_0 false "vkGetPipelineCacheData" get_pipeline_cache_data(device: vk::Device, cache: vk::PipelineCache, size: *mut usize, data: *mut c_void);
    fp_v1_0 false "vkCreatePipelineLayout" create_pipeline_layout(device: vk::Device, info: *const vk::PipelineLayoutCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineLayout);
    fp_v1_0 false "vkCreateDescriptorSetLayout" create_descriptor_set_layout(device: vk::Device, info: *const vk::DescriptorSetLayoutCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DescriptorSetLayout);
    fp_v1_0 false "vkCreateDescriptorPool" create_descriptor_pool(device: vk::Device, info: *const vk::DescriptorPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DescriptorPool);
    fp_v1_0 false "vkAllocateDescriptorSets" allocate_descriptor_sets(device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, out: *mut vk::DescriptorSet);
    fp_v1_0 false "vkCreateCommandPool" create_command_pool(device: vk::Device, info: *const vk::CommandPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::CommandPool);
    fp_v1_0 false "vkAllocateCommandBuffers" allocate_command_buffers(device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, out: *mut vk::CommandBuffer);
    fp_v1_0 false "vkBeginCommandBuffer" begin_command_buffer(commands: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>);
    fp_v1_0 false "vkEndCommandBuffer" end_command_buffer(commands: vk::CommandBuffer);
    fp_v1_0 false "vkResetCommandPool" reset_command_pool(device: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags);
    fp_v1_0 true "vkGetQueryPoolResults" get_query_pool_results(device: vk::Device, pool: vk::QueryPool, first: u32, count: u32, size: usize, data: *mut c_void, stride: vk::DeviceSize, flags: vk::QueryResultFlags);
    fp_v1_0 true "vkDeviceWaitIdle" device_wait_idle(device: vk::Device);
    fp_v1_2 true "vkGetSemaphoreCounterValue" get_semaphore_counter_value(device: vk::Device, semaphore: vk::Semaphore, out: *mut u64);
    fp_v1_2 true "vkWaitSemaphores" wait_semaphores(device: vk::Device, info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64);
    fp_v1_3 true "vkQueueSubmit2" queue_submit2(queue: vk::Queue, count: u32, submits: *const vk::SubmitInfo2<'_>, fence: vk::Fence);
}

/// Says that no pipeline was made, as a driver has to.
///
/// # Safety
/// `out` has room for `count` pipelines.
unsafe fn no_pipelines(count: u32, out: *mut vk::Pipeline) {
    for index in 0..count as usize {
        // SAFETY: promised by the caller.
        unsafe { out.add(index).write(vk::Pipeline::null()) };
    }
}

/// Stands for the function of this name.
///
/// # Safety
/// The promises of that function.
unsafe extern "system" fn create_graphics_pipelines(
    device: vk::Device,
    cache: vk::PipelineCache,
    count: u32,
    infos: *const vk::GraphicsPipelineCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Pipeline,
) -> vk::Result {
    // SAFETY: the arguments are the caller's, who keeps the promises of the function that this stands for.
    unsafe {
        match turn("vkCreateGraphicsPipelines", false) {
            Ok(own) => (own.fp_v1_0().create_graphics_pipelines)(
                device, cache, count, infos, callbacks, out,
            ),
            Err(result) => {
                no_pipelines(count, out);
                result
            }
        }
    }
}

/// Stands for the function of this name.
///
/// # Safety
/// The promises of that function.
unsafe extern "system" fn create_compute_pipelines(
    device: vk::Device,
    cache: vk::PipelineCache,
    count: u32,
    infos: *const vk::ComputePipelineCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Pipeline,
) -> vk::Result {
    // SAFETY: as above.
    unsafe {
        match turn("vkCreateComputePipelines", false) {
            Ok(own) => (own.fp_v1_0().create_compute_pipelines)(
                device, cache, count, infos, callbacks, out,
            ),
            Err(result) => {
                no_pipelines(count, out);
                result
            }
        }
    }
}

/// Puts the counting functions into a device's table.
///
/// # Panics
/// While another device has them.
pub(super) fn count(own: ash::Device, faults: &CallFaults) -> (ash::Device, FaultGuard) {
    let device = with_counting(&own);
    let faults = faults.clone();
    let before = lock(&COUNTED).replace(CountedDevice { faults, own });
    assert!(before.is_none(), "one device with faults at a time");
    (device, FaultGuard)
}
