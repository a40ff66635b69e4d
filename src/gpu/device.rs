//! Instance, choice of a device, and what it can do.

pub(super) mod info;

use super::messages::{self, LayerMessages};
use super::{DeviceOptions, Error, SWAPCHAIN, clock, loader_lock};
use ash::vk;
use std::ffi::{CStr, CString};

pub use info::{DeviceInfo, DeviceKind};

pub(super) fn load_entry() -> Result<ash::Entry, Error> {
    // SAFETY: loading the Vulkan loader runs its initializers, which is what every Vulkan program does.
    unsafe { ash::Entry::load() }.map_err(|e| Error::NoLoader(e.to_string()))
}

/// An instance that destroys itself unless taken apart.
pub(super) struct VulkanInstance {
    raw: Option<ash::Instance>,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    has_debug: bool,
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

impl VulkanInstance {
    pub(super) fn create(
        entry: &ash::Entry,
        options: &DeviceOptions,
        messages: &LayerMessages,
    ) -> Result<Self, Error> {
        // SAFETY: the entry is loaded.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(Error::vulkan("vkEnumerateInstanceVersion", "the loader"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_3 {
            return Err(Error::NoDevice(format!(
                "the Vulkan loader knows {} only",
                version_text(version)
            )));
        }
        // SAFETY: the entry is loaded.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.map_err(
            Error::vulkan("vkEnumerateInstanceExtensionProperties", "the loader"),
        )?;
        let has = |name: &CStr| {
            extensions
                .iter()
                .any(|e| e.extension_name_as_c_str() == Ok(name))
        };
        let mut wanted: Vec<CString> = Vec::new();
        let mut layers = Vec::new();
        if options.validation {
            // SAFETY: the entry is loaded.
            let available = unsafe { entry.enumerate_instance_layer_properties() }.map_err(
                Error::vulkan("vkEnumerateInstanceLayerProperties", "the loader"),
            )?;
            if !available
                .iter()
                .any(|l| l.layer_name_as_c_str() == Ok(VALIDATION))
            {
                return Err(Error::NoValidation);
            }
            layers.push(VALIDATION.as_ptr());
        }
        // With the validation layer the extension is there even if the loader alone does not list it.
        let has_debug = has(ash::ext::debug_utils::NAME) || options.validation;
        if has_debug {
            wanted.push(ash::ext::debug_utils::NAME.into());
        }
        let mut flags = vk::InstanceCreateFlags::empty();
        if has(ash::khr::portability_enumeration::NAME) {
            wanted.push(ash::khr::portability_enumeration::NAME.into());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        for name in &options.surface_extensions {
            if let Ok(name) = CString::new(name.as_str()) {
                wanted.push(name);
            }
        }
        let names: Vec<_> = wanted.iter().map(|n| n.as_ptr()).collect();
        let application = vk::ApplicationInfo::default()
            .application_name(c"surfel")
            .engine_name(c"surfel")
            .api_version(vk::API_VERSION_1_3);
        let mut messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
                    | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                    | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(messages::callback))
            .user_data(messages.user_data());
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut validation =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&names);
        if options.validation {
            info = info.push_next(&mut validation);
        }
        if has_debug {
            // Covers the creation and destruction of the instance itself.
            info = info.push_next(&mut messenger_info);
        }
        let turn = loader_lock::change();
        // SAFETY: all pointers live until the call returns; the message list outlives the instance because
        // `Gpu` keeps it.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                Error::NoDevice("no Vulkan driver is installed".into())
            }
            result => Error::Vulkan {
                call: "vkCreateInstance",
                object: "the instance".into(),
                result,
            },
        })?;
        drop(turn);
        let mut instance = Self {
            raw: Some(raw),
            messenger: None,
            has_debug,
        };
        if has_debug {
            let debug = ash::ext::debug_utils::Instance::new(entry, instance.raw());
            let mut info = messenger_info;
            info.p_next = std::ptr::null();
            // SAFETY: the extension is enabled; the callback's list outlives the messenger (see `Gpu`).
            let messenger = unsafe { debug.create_debug_utils_messenger(&info, None) }.map_err(
                Error::vulkan("vkCreateDebugUtilsMessengerEXT", "the messenger"),
            )?;
            instance.messenger = Some((debug, messenger));
        }
        Ok(instance)
    }

    fn raw(&self) -> &ash::Instance {
        match &self.raw {
            Some(raw) => raw,
            None => {
                unreachable!("an instance is taken apart only by into_parts, which consumes it")
            }
        }
    }

    /// Gives the parts away; the caller destroys them.
    pub(super) fn into_parts(
        mut self,
    ) -> (
        ash::Instance,
        Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
        bool,
    ) {
        let raw = self.raw().clone();
        self.raw = None;
        (raw, self.messenger.take(), self.has_debug)
    }
}

impl Drop for VulkanInstance {
    fn drop(&mut self) {
        let _turn = loader_lock::change();
        // SAFETY: nothing made from the instance is left: either no device was made or `into_parts` took all.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            if let Some(raw) = self.raw.take() {
                raw.destroy_instance(None);
            }
        }
    }
}

/// A device that was looked at.
pub(super) struct ChosenDevice {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) info: DeviceInfo,
    pub(super) queue_family: u32,
    /// The extension by which the clocks are compared.
    pub(super) calibration: Option<&'static CStr>,
}

fn version_text(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}

fn text(chars: Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    chars
        .map(|c| c.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// The largest side of an image as [`Image::mapped`](super::image::DeviceImage::mapped) makes it.
fn max_mapped_side(instance: &ash::Instance, physical: vk::PhysicalDevice) -> u32 {
    use super::image::{MAPPED_FORMAT, MAPPED_USAGE};
    use vk::FormatFeatureFlags as F;
    let format = MAPPED_FORMAT.vk();
    // SAFETY: the physical device belongs to the instance.
    let (can, most) = unsafe {
        let found = instance.get_physical_device_format_properties(physical, format);
        let most = instance.get_physical_device_image_format_properties(
            physical,
            format,
            vk::ImageType::TYPE_2D,
            vk::ImageTiling::LINEAR,
            MAPPED_USAGE,
            vk::ImageCreateFlags::empty(),
        );
        (found.linear_tiling_features, most)
    };
    let wanted = F::SAMPLED_IMAGE | F::BLIT_SRC | F::TRANSFER_SRC;
    match most {
        Ok(most) if can.contains(wanted) => most.max_extent.width.min(most.max_extent.height),
        _ => 0,
    }
}

fn inspect(
    entry: &ash::Entry,
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    index: usize,
) -> ChosenDevice {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut driver)
        .push_next(&mut maintenance3)
        .push_next(&mut maintenance4);
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
    // SAFETY: the physical device belongs to the instance, and the chained structures live until the calls
    // return. A device older than 1.3 ignores what it does not know.
    let (families, memory, float_targets) = unsafe {
        instance.get_physical_device_properties2(physical, &mut properties);
        (
            instance.get_physical_device_queue_family_properties(physical),
            instance.get_physical_device_memory_properties(physical),
            [vk::Format::R32_SFLOAT, vk::Format::R32G32B32A32_SFLOAT]
                .map(|format| instance.get_physical_device_format_properties(physical, format)),
        )
    };
    let p = properties.properties;
    let is_recent = p.api_version >= vk::API_VERSION_1_3;
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if is_recent {
        features = features
            .push_next(&mut features12)
            .push_next(&mut features13);
    }
    // SAFETY: as above.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let core = features.features;
    let family = families.iter().position(|f| {
        f.queue_flags
            .contains(vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE)
            && f.queue_count > 0
    });
    let mut missing = Vec::new();
    if !is_recent {
        missing.push(format!(
            "it knows Vulkan {} only, 1.3 is needed",
            version_text(p.api_version)
        ));
    }
    for (has, name) in [
        (features13.dynamic_rendering, "dynamicRendering"),
        (features13.synchronization2, "synchronization2"),
        (features13.maintenance4, "maintenance4"),
        (
            features13.shader_demote_to_helper_invocation,
            "shaderDemoteToHelperInvocation",
        ),
        (features12.timeline_semaphore, "timelineSemaphore"),
        (features12.host_query_reset, "hostQueryReset"),
        (core.large_points, "largePoints"),
    ] {
        if has == vk::FALSE {
            missing.push(format!("it lacks {name}"));
        }
    }
    if family.is_none() {
        missing.push("it has no queue for graphics and compute".into());
    }
    let family = family.unwrap_or(0);
    let timestamp_bits = families.get(family).map_or(0, |f| f.timestamp_valid_bits);
    let has_timestamps = timestamp_bits >= 36;
    let calibration = clock::extension(entry, instance, physical).filter(|_| has_timestamps);
    let device_memory = memory.memory_heaps[..memory.memory_heap_count as usize]
        .iter()
        .filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(|h| h.size)
        .max()
        .unwrap_or(0);
    let info = DeviceInfo {
        index,
        name: text(p.device_name_as_c_str()),
        kind: match p.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        driver: format!(
            "{} {}",
            text(driver.driver_name_as_c_str()),
            text(driver.driver_info_as_c_str())
        ),
        api_version: version_text(p.api_version),
        unusable: (!missing.is_empty()).then(|| missing.join(", ")),
        timestamp_period_ns: if has_timestamps {
            p.limits.timestamp_period
        } else {
            0.0
        },
        timestamp_bits,
        has_calibrated_timestamps: calibration.is_some(),
        has_pipeline_statistics: core.pipeline_statistics_query == vk::TRUE,
        has_sample_counts: core.occlusion_query_precise == vk::TRUE,
        max_point_size_px: p.limits.point_size_range[1],
        point_step_px: p.limits.point_size_granularity,
        max_image_side: p
            .limits
            .max_image_dimension2_d
            .min(p.limits.max_framebuffer_width)
            .min(p.limits.max_framebuffer_height),
        max_mapped_side: max_mapped_side(instance, physical),
        max_storage_range: u64::from(p.limits.max_storage_buffer_range),
        max_storage_buffers: p.limits.max_per_stage_descriptor_storage_buffers,
        max_allocation: maintenance3.max_memory_allocation_size,
        max_buffer: if is_recent {
            maintenance4.max_buffer_size
        } else {
            0
        },
        uniform_alignment: p.limits.min_uniform_buffer_offset_alignment.max(1),
        device_memory,
        has_full_index: core.full_draw_index_uint32 == vk::TRUE,
        has_first_instance: core.draw_indirect_first_instance == vk::TRUE,
        has_int64_atomics: core.shader_int64 == vk::TRUE
            && features12.shader_buffer_int64_atomics == vk::TRUE,
        has_float_blend: float_targets.iter().all(|target| {
            target
                .optimal_tiling_features
                .contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND)
        }),
        subpixel_bits: p.limits.sub_pixel_precision_bits,
    };
    ChosenDevice {
        physical,
        info,
        queue_family: family as u32,
        calibration,
    }
}

fn all(entry: &ash::Entry, instance: &VulkanInstance) -> Result<Vec<ChosenDevice>, Error> {
    let turn = loader_lock::change();
    // SAFETY: the instance is alive.
    let devices = unsafe { instance.raw().enumerate_physical_devices() }
        .map_err(Error::vulkan("vkEnumeratePhysicalDevices", "the instance"))?;
    drop(turn);
    Ok(devices
        .into_iter()
        .enumerate()
        .map(|(index, physical)| inspect(entry, instance.raw(), physical, index))
        .collect())
}

/// Every Vulkan device of this machine, usable or not.
///
/// # Errors
/// When there is no loader or no driver.
pub fn list() -> Result<Vec<DeviceInfo>, Error> {
    let entry = load_entry()?;
    let messages = LayerMessages::default();
    let instance = VulkanInstance::create(&entry, &DeviceOptions::default(), &messages)?;
    Ok(all(&entry, &instance)?
        .into_iter()
        .map(|c| c.info)
        .collect())
}

/// Rank of a kind: lower is better.
fn rank(kind: DeviceKind) -> u8 {
    match kind {
        DeviceKind::Discrete => 0,
        DeviceKind::Integrated => 1,
        DeviceKind::Virtual => 2,
        DeviceKind::Other => 3,
        DeviceKind::Cpu => 4,
    }
}

pub(super) fn choose(
    entry: &ash::Entry,
    instance: &VulkanInstance,
    options: &DeviceOptions,
) -> Result<ChosenDevice, Error> {
    let mut devices = all(entry, instance)?;
    let available = devices
        .iter()
        .map(|d| format!("{}: {}", d.info.index, d.info.name))
        .collect::<Vec<_>>()
        .join("; ");
    let position = match &options.device {
        Some(wanted) => {
            let lower = wanted.to_lowercase();
            let found = match wanted.parse::<usize>() {
                Ok(index) => devices.iter().position(|d| d.info.index == index),
                Err(_) => devices
                    .iter()
                    .position(|d| d.info.name.to_lowercase().contains(&lower)),
            };
            found.ok_or_else(|| Error::UnknownDevice {
                wanted: wanted.clone(),
                available: available.clone(),
            })?
        }
        None => {
            let best = devices
                .iter()
                .enumerate()
                .filter(|(_, d)| d.info.unusable.is_none())
                .min_by_key(|(index, d)| (rank(d.info.kind), *index));
            match best {
                Some((position, _)) => position,
                None if devices.is_empty() => {
                    return Err(Error::NoDevice("there is no Vulkan device".into()));
                }
                None => {
                    let reasons = devices
                        .iter()
                        .map(|d| {
                            format!(
                                "{}: {}",
                                d.info.name,
                                d.info.unusable.as_deref().unwrap_or("")
                            )
                        })
                        .collect::<Vec<_>>()
                        .join("; ");
                    return Err(Error::NoDevice(reasons));
                }
            }
        }
    };
    let chosen = devices.swap_remove(position);
    match &chosen.info.unusable {
        Some(reason) => Err(Error::NoDevice(format!("{}: {reason}", chosen.info.name))),
        None => Ok(chosen),
    }
}

pub(super) fn create(
    instance: &VulkanInstance,
    chosen: &ChosenDevice,
    options: &DeviceOptions,
) -> Result<(ash::Device, vk::Queue), Error> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(chosen.queue_family)
        .queue_priorities(&priorities)];
    let core = vk::PhysicalDeviceFeatures::default()
        .large_points(true)
        .full_draw_index_uint32(chosen.info.has_full_index)
        .draw_indirect_first_instance(chosen.info.has_first_instance)
        .pipeline_statistics_query(chosen.info.has_pipeline_statistics)
        .occlusion_query_precise(chosen.info.has_sample_counts)
        .shader_int64(chosen.info.has_int64_atomics);
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default()
        .shader_buffer_int64_atomics(chosen.info.has_int64_atomics)
        .timeline_semaphore(true)
        .host_query_reset(true);
    let mut features13 = vk::PhysicalDeviceVulkan13Features::default()
        .dynamic_rendering(true)
        .synchronization2(true)
        .maintenance4(true)
        .shader_demote_to_helper_invocation(true);
    // SAFETY: the physical device belongs to the instance.
    let extensions = unsafe {
        instance
            .raw()
            .enumerate_device_extension_properties(chosen.physical)
    }
    .map_err(Error::vulkan(
        "vkEnumerateDeviceExtensionProperties",
        &chosen.info.name,
    ))?;
    let has = |name: &CStr| {
        extensions
            .iter()
            .any(|e| e.extension_name_as_c_str() == Ok(name))
    };
    let mut names = Vec::new();
    // The specification demands the subset extension to be enabled where it is offered.
    if has(c"VK_KHR_portability_subset") {
        names.push(c"VK_KHR_portability_subset".as_ptr());
    }
    names.extend(chosen.calibration.map(CStr::as_ptr));
    if !options.surface_extensions.is_empty() {
        if !has(SWAPCHAIN) {
            return Err(Error::NoDevice(format!(
                "{} cannot present to a window",
                chosen.info.name
            )));
        }
        names.push(SWAPCHAIN.as_ptr());
    }
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&names)
        .enabled_features(&core)
        .push_next(&mut features12)
        .push_next(&mut features13);
    let turn = loader_lock::change();
    // SAFETY: every feature and extension asked for was reported by the device; all pointers live until the
    // call returns.
    let device = unsafe { instance.raw().create_device(chosen.physical, &info, None) }
        .map_err(Error::vulkan("vkCreateDevice", &chosen.info.name))?;
    drop(turn);
    // SAFETY: queue 0 of this family was created with the device.
    let queue = unsafe { device.get_device_queue(chosen.queue_family, 0) };
    Ok((device, queue))
}
