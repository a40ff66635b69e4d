//! What is known of a device.

/// What kind of processor a device is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the memory of the CPU.
    Integrated,
    /// A GPU seen through a virtual machine.
    Virtual,
    /// A software device.
    Cpu,
    /// Something else.
    Other,
}

/// A device with the limits that matter here.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DeviceInfo {
    /// Index in the list of devices.
    pub index: usize,
    /// Name as the driver gives it.
    pub name: String,
    /// Kind of processor.
    pub kind: DeviceKind,
    /// Driver name and version in words.
    pub driver: String,
    /// Vulkan version, such as 1.3.230.
    pub api_version: String,
    /// Why the device cannot be used, if it cannot.
    pub unusable: Option<String>,
    /// Nanoseconds per timestamp tick; 0 when there are no timestamps.
    pub timestamp_period_ns: f32,
    /// Bits of a timestamp that count; it wraps there.
    pub timestamp_bits: u32,
    /// The device's clock can be read together with the host's.
    pub has_calibrated_timestamps: bool,
    /// Counts what the stages of the pipeline do.
    pub has_pipeline_statistics: bool,
    /// Counts the samples that a draw leaves in its targets.
    pub has_sample_counts: bool,
    /// Largest size of a point, pixels.
    pub max_point_size_px: f32,
    /// Step that sizes of points are rounded to, pixels; 0: every size is there.
    pub point_step_px: f32,
    /// Largest picture side, pixels.
    pub max_image_side: u32,
    /// The same of pictures that the host writes in mapped memory; 0: there are none.
    pub max_mapped_side: u32,
    /// Largest range of a storage buffer binding, bytes.
    pub max_storage_range: u64,
    /// Most storage buffers that a shader has bound.
    pub max_storage_buffers: u32,
    /// Largest single allocation, bytes.
    pub max_allocation: u64,
    /// Largest buffer, bytes.
    pub max_buffer: u64,
    /// Alignment of a uniform buffer's offset, bytes.
    pub uniform_alignment: u64,
    /// Size of the device's own memory as reported, bytes.
    pub device_memory: u64,
    /// Indices up to 2^32 - 1 may be drawn (else 2^24 - 1).
    pub has_full_index: bool,
    /// Draws whose arguments the device wrote may begin at any instance.
    pub has_first_instance: bool,
    /// 64-bit atomics on storage buffers.
    pub has_int64_atomics: bool,
    /// Blending into 32-bit float targets.
    pub has_float_blend: bool,
    /// Sub-pixel bits of the rasterizer.
    pub subpixel_bits: u32,
}

impl DeviceInfo {
    /// Tells whether this is a software device: it ranks passes, it does not predict a GPU.
    pub fn is_cpu(&self) -> bool {
        self.kind == DeviceKind::Cpu
    }
}
