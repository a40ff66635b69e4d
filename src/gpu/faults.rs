//! Calls of Vulkan that fail on purpose: functions that count stand in the place of those that can fail, in the tables of
//! loader, instance, device, surface and swapchain. For tests; a device opened without [`CallFaults`] has its own tables.
//!
//! All tables are filled by two functions that look others up by name. Those are replaced, and so is what they find.

use super::lock;
use super::messages::LayerMessages;
use ash::vk;
use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Ways in which a call fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CallFault {
    /// The host has no memory.
    OutOfHostMemory,
    /// The device has no memory.
    OutOfDeviceMemory,
    /// An instance or a device cannot be made.
    InitializationFailed,
    /// The device is lost, and stays so: every later call that can say it does, until another is made.
    DeviceLost,
    /// The surface of a window is lost.
    SurfaceLost,
    /// The swapchain no longer fits its surface.
    OutOfDate,
    /// No image of a window became free in time.
    Timeout,
}

impl CallFault {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::OutOfHostMemory,
        Self::OutOfDeviceMemory,
        Self::InitializationFailed,
        Self::DeviceLost,
        Self::SurfaceLost,
        Self::OutOfDate,
        Self::Timeout,
    ];

    fn result(self) -> vk::Result {
        match self {
            Self::OutOfHostMemory => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            Self::OutOfDeviceMemory => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            Self::InitializationFailed => vk::Result::ERROR_INITIALIZATION_FAILED,
            Self::DeviceLost => vk::Result::ERROR_DEVICE_LOST,
            Self::SurfaceLost => vk::Result::ERROR_SURFACE_LOST_KHR,
            Self::OutOfDate => vk::Result::ERROR_OUT_OF_DATE_KHR,
            Self::Timeout => vk::Result::TIMEOUT,
        }
    }
}

/// Faults that the specification names for a kind of call.
mod can {
    use super::CallFault::{self, *};

    pub(super) const MEMORY: &[CallFault] = &[OutOfHostMemory, OutOfDeviceMemory];
    pub(super) const INSTANCE: &[CallFault] =
        &[OutOfHostMemory, OutOfDeviceMemory, InitializationFailed];
    pub(super) const DEVICE: &[CallFault] = &[
        OutOfHostMemory,
        OutOfDeviceMemory,
        InitializationFailed,
        DeviceLost,
    ];
    pub(super) const WAIT: &[CallFault] = &[OutOfHostMemory, OutOfDeviceMemory, DeviceLost];
    pub(super) const SURFACE: &[CallFault] = &[OutOfHostMemory, OutOfDeviceMemory, SurfaceLost];
    pub(super) const SWAPCHAIN: &[CallFault] = &[
        OutOfHostMemory,
        OutOfDeviceMemory,
        InitializationFailed,
        DeviceLost,
        SurfaceLost,
    ];
    pub(super) const PRESENT: &[CallFault] = &[
        OutOfHostMemory,
        OutOfDeviceMemory,
        DeviceLost,
        SurfaceLost,
        OutOfDate,
    ];
    pub(super) const ACQUIRE: &[CallFault] = &[
        OutOfHostMemory,
        OutOfDeviceMemory,
        DeviceLost,
        SurfaceLost,
        OutOfDate,
        Timeout,
    ];
}

/// A fault at one call of a device, counted over the calls that the specification lets fail so, from the making of its
/// instance on. Clones share the count.
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
    messages: Mutex<Vec<LayerMessages>>,
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
            messages: Mutex::default(),
        }))
    }

    /// Number of calls so far that can fail so.
    pub fn calls(&self) -> u64 {
        self.0.calls.load(Ordering::Relaxed)
    }

    /// The call that failed, once it has.
    pub fn failed(&self) -> Option<&'static str> {
        *lock(&self.0.failed)
    }

    /// Messages of validation to all devices that were opened with these faults, those included that could not be.
    pub fn messages(&self) -> Vec<super::messages::LayerMessage> {
        let lists = lock(&self.0.messages);
        lists.iter().flat_map(LayerMessages::list).collect()
    }

    /// Listens to the messages of a device that is about to be opened.
    pub(super) fn listen(&self, messages: &LayerMessages) {
        lock(&self.0.messages).push(messages.clone());
    }

    /// The result in the place of a call's own, when it is this one's turn.
    fn next(&self, name: &'static str, can: &[CallFault]) -> Option<vk::Result> {
        let counter = &*self.0;
        if !can.contains(&counter.fault) {
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

/// Devices whose calls are counted, all with the same faults, since a function of Vulkan knows nothing but its arguments.
struct CountedDevices {
    faults: CallFaults,
    /// Roots that are open.
    open: usize,
    /// The device that was made last; another one is lost or being closed.
    device: vk::Device,
}

static COUNTED: Mutex<Option<CountedDevices>> = Mutex::new(None);

/// Keeps the counting functions, and the loader's own, in their places; dropped after the instance.
pub(super) struct FaultGuard {
    _own: ash::Entry,
}

impl FaultGuard {
    /// The fault in the place of making a surface, which the window system's library does with functions of its own.
    #[cfg(feature = "viewer")]
    pub(super) fn making_surface(&self) -> Option<vk::Result> {
        turn("glfwCreateWindowSurface", can::SURFACE)
    }
}

impl Drop for FaultGuard {
    fn drop(&mut self) {
        let mut counted = lock(&COUNTED);
        let open = counted.as_mut().map_or(0, |counted| {
            counted.open -= 1;
            counted.open
        });
        if open == 0 {
            *counted = None;
        }
    }
}

/// Number of open devices whose calls are counted. For tests: none may be left.
pub fn open_devices() -> usize {
    lock(&COUNTED).as_ref().map_or(0, |counted| counted.open)
}

/// The fault in the place of a call, if it is its turn.
fn turn(name: &'static str, can: &[CallFault]) -> Option<vk::Result> {
    let (faults, device) = {
        let counted = lock(&COUNTED);
        let counted = counted.as_ref()?;
        (counted.faults.clone(), counted.device)
    };
    let result = faults.next(name, can)?;
    if result == vk::Result::ERROR_DEVICE_LOST && device != vk::Device::null() {
        // What waits for the device believes that it is idle or lost, and destroys.
        let own = own_functions::device_wait_idle();
        // SAFETY: the device is alive while its own functions are asked for. The caller owns the queue where the call is
        // one of a queue; waits are not called while another thread submits.
        let _ = unsafe { own(device) };
    }
    Some(result)
}

macro_rules! counted {
    (
        $($name:literal $can:ident $field:ident $pfn:ident($($arg:ident: $kind:ty),*);)*
        by hand: $($own_name:literal $own_field:ident $own_pfn:ident;)*
    ) => {
        /// Functions that others stand for, as they were looked up last.
        mod own_functions {
            use super::*;

            pub(super) struct OwnFunctions {
                $(pub(super) $field: AtomicPtr<c_void>,)*
                $(pub(super) $own_field: AtomicPtr<c_void>,)*
            }

            pub(super) static OWN: OwnFunctions = OwnFunctions {
                $($field: AtomicPtr::new(std::ptr::null_mut()),)*
                $($own_field: AtomicPtr::new(std::ptr::null_mut()),)*
            };

            own_function!($($name $field $pfn)* $($own_name $own_field $own_pfn)*);
        }

        $(
            /// Stands for the function of this name.
            ///
            /// # Safety
            /// The promises of that function.
            unsafe extern "system" fn $field($($arg: $kind),*) -> vk::Result {
                match turn($name, can::$can) {
                    Some(result) => result,
                    // SAFETY: the arguments are the caller's, who keeps the promises of the function that this stands for.
                    None => unsafe { own_functions::$field()($($arg),*) },
                }
            }
        )*

        /// The function that stands for one of this name; `own` itself for one that is not counted.
        fn stand_in(name: &CStr, own: unsafe extern "system" fn()) -> unsafe extern "system" fn() {
            stand_in_for!(name, own, $($name $field $pfn)* $($own_name $own_field $own_pfn)*);
            own
        }
    };
}

macro_rules! own_function {
    ($($name:literal $field:ident $pfn:ident)*) => {
        $(
            pub(super) fn $field() -> vk::$pfn {
                let own = OWN.$field.load(Ordering::Relaxed);
                assert!(!own.is_null(), "{} was never looked up", $name);
                // SAFETY: stored by `stand_in` for the function of this name, which has this type.
                unsafe { std::mem::transmute::<*mut c_void, vk::$pfn>(own) }
            }
        )*
    };
}

macro_rules! stand_in_for {
    ($wanted:ident, $own:ident, $($name:literal $field:ident $pfn:ident)*) => {
        $(
            if $wanted.to_bytes() == $name.as_bytes() {
                own_functions::OWN.$field.store($own as *mut c_void, Ordering::Relaxed);
                let function: vk::$pfn = $field;
                // SAFETY: functions are looked up without their type; who calls it gives it this type again.
                return unsafe {
                    std::mem::transmute::<vk::$pfn, unsafe extern "system" fn()>(function)
                };
            }
        )*
    };
}

counted! {
    "vkEnumerateInstanceExtensionProperties" MEMORY enumerate_instance_extension_properties PFN_vkEnumerateInstanceExtensionProperties(layer: *const c_char, count: *mut u32, out: *mut vk::ExtensionProperties);
    "vkEnumerateInstanceLayerProperties" MEMORY enumerate_instance_layer_properties PFN_vkEnumerateInstanceLayerProperties(count: *mut u32, out: *mut vk::LayerProperties);
    "vkCreateInstance" INSTANCE create_instance PFN_vkCreateInstance(info: *const vk::InstanceCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Instance);
    "vkCreateDebugUtilsMessengerEXT" MEMORY create_debug_utils_messenger PFN_vkCreateDebugUtilsMessengerEXT(instance: vk::Instance, info: *const vk::DebugUtilsMessengerCreateInfoEXT<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DebugUtilsMessengerEXT);
    "vkEnumeratePhysicalDevices" INSTANCE enumerate_physical_devices PFN_vkEnumeratePhysicalDevices(instance: vk::Instance, count: *mut u32, out: *mut vk::PhysicalDevice);
    "vkEnumerateDeviceExtensionProperties" MEMORY enumerate_device_extension_properties PFN_vkEnumerateDeviceExtensionProperties(physical: vk::PhysicalDevice, layer: *const c_char, count: *mut u32, out: *mut vk::ExtensionProperties);
    "vkGetPhysicalDeviceSurfaceSupportKHR" SURFACE get_physical_device_surface_support PFN_vkGetPhysicalDeviceSurfaceSupportKHR(physical: vk::PhysicalDevice, family: u32, surface: vk::SurfaceKHR, out: *mut vk::Bool32);
    "vkGetPhysicalDeviceSurfacePresentModesKHR" SURFACE get_physical_device_surface_present_modes PFN_vkGetPhysicalDeviceSurfacePresentModesKHR(physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, count: *mut u32, out: *mut vk::PresentModeKHR);
    "vkGetPhysicalDeviceSurfaceCapabilitiesKHR" SURFACE get_physical_device_surface_capabilities PFN_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, out: *mut vk::SurfaceCapabilitiesKHR);
    "vkGetPhysicalDeviceSurfaceFormatsKHR" SURFACE get_physical_device_surface_formats PFN_vkGetPhysicalDeviceSurfaceFormatsKHR(physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, count: *mut u32, out: *mut vk::SurfaceFormatKHR);
    "vkCreateSwapchainKHR" SWAPCHAIN create_swapchain PFN_vkCreateSwapchainKHR(device: vk::Device, info: *const vk::SwapchainCreateInfoKHR<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::SwapchainKHR);
    "vkGetSwapchainImagesKHR" MEMORY get_swapchain_images PFN_vkGetSwapchainImagesKHR(device: vk::Device, swapchain: vk::SwapchainKHR, count: *mut u32, out: *mut vk::Image);
    "vkAcquireNextImageKHR" ACQUIRE acquire_next_image PFN_vkAcquireNextImageKHR(device: vk::Device, swapchain: vk::SwapchainKHR, timeout: u64, semaphore: vk::Semaphore, fence: vk::Fence, out: *mut u32);
    "vkAllocateMemory" MEMORY allocate_memory PFN_vkAllocateMemory(device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DeviceMemory);
    "vkMapMemory" MEMORY map_memory PFN_vkMapMemory(device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize, flags: vk::MemoryMapFlags, out: *mut *mut c_void);
    "vkFlushMappedMemoryRanges" MEMORY flush_mapped_memory_ranges PFN_vkFlushMappedMemoryRanges(device: vk::Device, count: u32, ranges: *const vk::MappedMemoryRange<'_>);
    "vkInvalidateMappedMemoryRanges" MEMORY invalidate_mapped_memory_ranges PFN_vkInvalidateMappedMemoryRanges(device: vk::Device, count: u32, ranges: *const vk::MappedMemoryRange<'_>);
    "vkBindBufferMemory" MEMORY bind_buffer_memory PFN_vkBindBufferMemory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    "vkBindImageMemory" MEMORY bind_image_memory PFN_vkBindImageMemory(device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize);
    "vkCreateBuffer" MEMORY create_buffer PFN_vkCreateBuffer(device: vk::Device, info: *const vk::BufferCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Buffer);
    "vkCreateImage" MEMORY create_image PFN_vkCreateImage(device: vk::Device, info: *const vk::ImageCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Image);
    "vkCreateImageView" MEMORY create_image_view PFN_vkCreateImageView(device: vk::Device, info: *const vk::ImageViewCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::ImageView);
    "vkCreateSampler" MEMORY create_sampler PFN_vkCreateSampler(device: vk::Device, info: *const vk::SamplerCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Sampler);
    "vkCreateSemaphore" MEMORY create_semaphore PFN_vkCreateSemaphore(device: vk::Device, info: *const vk::SemaphoreCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::Semaphore);
    "vkCreateQueryPool" MEMORY create_query_pool PFN_vkCreateQueryPool(device: vk::Device, info: *const vk::QueryPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::QueryPool);
    "vkCreateShaderModule" MEMORY create_shader_module PFN_vkCreateShaderModule(device: vk::Device, info: *const vk::ShaderModuleCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::ShaderModule);
    "vkCreatePipelineCache" MEMORY create_pipeline_cache PFN_vkCreatePipelineCache(device: vk::Device, info: *const vk::PipelineCacheCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineCache);
    "vkGetPipelineCacheData" MEMORY get_pipeline_cache_data PFN_vkGetPipelineCacheData(device: vk::Device, cache: vk::PipelineCache, size: *mut usize, data: *mut c_void);
    "vkCreatePipelineLayout" MEMORY create_pipeline_layout PFN_vkCreatePipelineLayout(device: vk::Device, info: *const vk::PipelineLayoutCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::PipelineLayout);
    "vkCreateDescriptorSetLayout" MEMORY create_descriptor_set_layout PFN_vkCreateDescriptorSetLayout(device: vk::Device, info: *const vk::DescriptorSetLayoutCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DescriptorSetLayout);
    "vkCreateDescriptorPool" MEMORY create_descriptor_pool PFN_vkCreateDescriptorPool(device: vk::Device, info: *const vk::DescriptorPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::DescriptorPool);
    "vkAllocateDescriptorSets" MEMORY allocate_descriptor_sets PFN_vkAllocateDescriptorSets(device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, out: *mut vk::DescriptorSet);
    "vkCreateCommandPool" MEMORY create_command_pool PFN_vkCreateCommandPool(device: vk::Device, info: *const vk::CommandPoolCreateInfo<'_>, callbacks: *const vk::AllocationCallbacks<'_>, out: *mut vk::CommandPool);
    "vkAllocateCommandBuffers" MEMORY allocate_command_buffers PFN_vkAllocateCommandBuffers(device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, out: *mut vk::CommandBuffer);
    "vkBeginCommandBuffer" MEMORY begin_command_buffer PFN_vkBeginCommandBuffer(commands: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>);
    "vkEndCommandBuffer" MEMORY end_command_buffer PFN_vkEndCommandBuffer(commands: vk::CommandBuffer);
    "vkResetCommandPool" MEMORY reset_command_pool PFN_vkResetCommandPool(device: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags);
    "vkGetQueryPoolResults" WAIT get_query_pool_results PFN_vkGetQueryPoolResults(device: vk::Device, pool: vk::QueryPool, first: u32, count: u32, size: usize, data: *mut c_void, stride: vk::DeviceSize, flags: vk::QueryResultFlags);
    "vkDeviceWaitIdle" WAIT device_wait_idle PFN_vkDeviceWaitIdle(device: vk::Device);
    "vkGetSemaphoreCounterValue" WAIT get_semaphore_counter_value PFN_vkGetSemaphoreCounterValue(device: vk::Device, semaphore: vk::Semaphore, out: *mut u64);
    "vkWaitSemaphores" WAIT wait_semaphores PFN_vkWaitSemaphores(device: vk::Device, info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64);
    "vkQueueSubmit2" WAIT queue_submit2 PFN_vkQueueSubmit2(queue: vk::Queue, count: u32, submits: *const vk::SubmitInfo2<'_>, fence: vk::Fence);
    by hand:
    "vkGetDeviceProcAddr" get_device_proc_addr PFN_vkGetDeviceProcAddr;
    "vkCreateDevice" create_device PFN_vkCreateDevice;
    "vkCreateGraphicsPipelines" create_graphics_pipelines PFN_vkCreateGraphicsPipelines;
    "vkCreateComputePipelines" create_compute_pipelines PFN_vkCreateComputePipelines;
    "vkQueuePresentKHR" queue_present PFN_vkQueuePresentKHR;
}

/// Looks a function of a device up.
///
/// # Safety
/// The promises of the function of this name.
unsafe extern "system" fn get_device_proc_addr(
    device: vk::Device,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: the arguments are the caller's; a name is a string with a zero at its end.
    unsafe {
        let own = own_functions::get_device_proc_addr()(device, name)?;
        Some(stand_in(CStr::from_ptr(name), own))
    }
}

/// The loader's own way to look a function up.
static OWN_LOOKUP: Mutex<Option<vk::PFN_vkGetInstanceProcAddr>> = Mutex::new(None);

/// Looks a function of the loader or an instance up.
///
/// # Safety
/// The promises of the function of this name.
unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let lookup = (*lock(&OWN_LOOKUP))?;
    // SAFETY: the arguments are the caller's; a name is a string with a zero at its end.
    unsafe {
        let own = lookup(instance, name)?;
        Some(stand_in(CStr::from_ptr(name), own))
    }
}

/// Stands for the function of this name, and remembers the device.
///
/// # Safety
/// The promises of that function.
unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Device,
) -> vk::Result {
    // One that was lost does not keep another from being made.
    if let Some(counted) = lock(&COUNTED).as_ref() {
        counted.faults.0.is_lost.store(false, Ordering::Relaxed);
    }
    if let Some(result) = turn("vkCreateDevice", can::DEVICE) {
        return result;
    }
    // SAFETY: the arguments are the caller's, who keeps the promises of the function that this stands for.
    let result = unsafe { own_functions::create_device()(physical, info, callbacks, out) };
    if result == vk::Result::SUCCESS
        && let Some(counted) = lock(&COUNTED).as_mut()
    {
        // SAFETY: written by the call above.
        counted.device = unsafe { *out };
    }
    result
}

/// Stands for the function of this name. What is refused because of the window has been waited for all the same, as the
/// specification has it.
///
/// # Safety
/// The promises of that function.
unsafe extern "system" fn queue_present(
    queue: vk::Queue,
    info: *const vk::PresentInfoKHR<'_>,
) -> vk::Result {
    let fault = turn("vkQueuePresentKHR", can::PRESENT);
    let is_refused_first = matches!(
        fault,
        Some(
            vk::Result::ERROR_OUT_OF_HOST_MEMORY
                | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
                | vk::Result::ERROR_DEVICE_LOST
        )
    );
    let own = match is_refused_first {
        true => vk::Result::SUCCESS,
        // SAFETY: the arguments are the caller's, who keeps the promises of the function that this stands for.
        false => unsafe { own_functions::queue_present()(queue, info) },
    };
    fault.unwrap_or(own)
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
        match turn("vkCreateGraphicsPipelines", can::MEMORY) {
            None => own_functions::create_graphics_pipelines()(
                device, cache, count, infos, callbacks, out,
            ),
            Some(result) => {
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
        match turn("vkCreateComputePipelines", can::MEMORY) {
            None => own_functions::create_compute_pipelines()(
                device, cache, count, infos, callbacks, out,
            ),
            Some(result) => {
                no_pipelines(count, out);
                result
            }
        }
    }
}

/// The loader with counting functions, for a device with these faults, and what keeps them there.
///
/// # Panics
/// While a device with other faults is open.
pub(super) fn count(own: ash::Entry, faults: &CallFaults) -> (FaultGuard, ash::Entry) {
    let mut counted = lock(&COUNTED);
    let devices = counted.get_or_insert_with(|| CountedDevices {
        faults: faults.clone(),
        open: 0,
        device: vk::Device::null(),
    });
    assert!(
        Arc::ptr_eq(&devices.faults.0, &faults.0),
        "other faults are counted already"
    );
    devices.open += 1;
    drop(counted);
    *lock(&OWN_LOOKUP) = Some(own.static_fn().get_instance_proc_addr);
    let functions = ash::StaticFn {
        get_instance_proc_addr,
    };
    // SAFETY: it looks functions up as the loader's own does; the library stays loaded by the guard.
    let entry = unsafe { ash::Entry::from_static_fn(functions) };
    (FaultGuard { _own: own }, entry)
}
