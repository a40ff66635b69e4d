//! The device's clock beside the host's: where on the host's time line a timestamp lies.
//!
//! Timestamps count from an origin of the device's own. Where the device has calibrated timestamps, its clock is
//! read between two readings of the host's; the truth lies between them, so the error is known. Where it has not,
//! a submission can still be anchored: its first command cannot run before it was submitted.

use super::device::info::DeviceInfo;
use super::{Error, Gpu};
use ash::{ext, khr, vk};
use std::ffi::CStr;
use std::time::{Duration, Instant};

/// One moment on both clocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockAnchor {
    /// On the processor's clock.
    pub host: Instant,
    /// On the device's clock, ticks.
    pub ticks: u64,
    /// Most that the two can be apart.
    pub within: Duration,
}

impl ClockAnchor {
    /// The moment of a timestamp on the processor's clock; `None` when it lies outside of what the processor's clock can say.
    pub fn instant_of(&self, ticks: u64, info: &DeviceInfo) -> Option<Instant> {
        let ms = info.ms_between(self.ticks, ticks);
        let offset = Duration::try_from_secs_f64(ms.abs() / 1e3).ok()?;
        if ms < 0.0 {
            self.host.checked_sub(offset)
        } else {
            self.host.checked_add(offset)
        }
    }
}

impl DeviceInfo {
    /// Milliseconds from one timestamp to another, negative when the other is earlier. The clock wraps after
    /// [`timestamp_bits`](DeviceInfo::timestamp_bits); of the two ways around, the shorter is meant.
    pub fn ms_between(&self, from: u64, to: u64) -> f64 {
        let unused = 64 - self.timestamp_bits.clamp(1, 64);
        // Moved to the top of the word, the difference has its sign where the word has it.
        let ticks = (to.wrapping_sub(from) << unused).cast_signed() >> unused;
        ticks as f64 * f64::from(self.timestamp_period_ns) / 1e6
    }
}

/// The extension's functions, under either of its names.
pub(super) enum ClockFunctions {
    Ext(ext::calibrated_timestamps::Device),
    Khr(khr::calibrated_timestamps::Device),
}

impl ClockFunctions {
    /// `name` is what [`extension`] answered.
    pub(super) fn new(instance: &ash::Instance, device: &ash::Device, name: &CStr) -> Self {
        if name == ext::calibrated_timestamps::NAME {
            Self::Ext(ext::calibrated_timestamps::Device::new(instance, device))
        } else {
            Self::Khr(khr::calibrated_timestamps::Device::new(instance, device))
        }
    }
}

/// The extension by which a device compares its clock, if it has one and calibrates the clock of timestamps. The
/// older name comes first: every driver and every validation layer knows it.
pub(super) fn extension(
    entry: &ash::Entry,
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
) -> Option<&'static CStr> {
    // SAFETY: the physical device belongs to the instance. One that cannot answer counts as having nothing.
    let extensions =
        unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let has = |name: &CStr| {
        extensions
            .iter()
            .any(|e| e.extension_name_as_c_str() == Ok(name))
    };
    // SAFETY: the device offers the extension whose function is called; functions of the physical device need no
    // more than that. Both structures below are made for this instance.
    let (name, domains) = unsafe {
        if has(ext::calibrated_timestamps::NAME) {
            let calls = ext::calibrated_timestamps::Instance::new(entry, instance);
            (
                ext::calibrated_timestamps::NAME,
                calls.get_physical_device_calibrateable_time_domains(physical),
            )
        } else if has(khr::calibrated_timestamps::NAME) {
            let calls = khr::calibrated_timestamps::Instance::new(entry, instance);
            (
                khr::calibrated_timestamps::NAME,
                calls.get_physical_device_calibrateable_time_domains(physical),
            )
        } else {
            return None;
        }
    };
    domains
        .unwrap_or_default()
        .contains(&vk::TimeDomainKHR::DEVICE)
        .then_some(name)
}

/// Readings of which the tightest is taken: the host may be interrupted in any.
const READINGS: usize = 5;

impl Gpu {
    /// Reads both clocks; `None` where the device has no calibrated timestamps. Takes microseconds; not for the
    /// part of a frame that is timed.
    ///
    /// # Errors
    /// When the Vulkan call fails.
    pub fn anchor(&self) -> Result<Option<ClockAnchor>, Error> {
        let Some(calibration) = &self.calibration else {
            return Ok(None);
        };
        let domains =
            [vk::CalibratedTimestampInfoKHR::default().time_domain(vk::TimeDomainKHR::DEVICE)];
        let mut best: Option<ClockAnchor> = None;
        for _ in 0..READINGS {
            let before = Instant::now();
            // SAFETY: the extension is enabled on this device, and the domain is one that it calibrates.
            let read = unsafe {
                match calibration {
                    ClockFunctions::Ext(calls) => calls.get_calibrated_timestamps(&domains),
                    ClockFunctions::Khr(calls) => calls.get_calibrated_timestamps(&domains),
                }
            };
            let half = before.elapsed() / 2;
            let (ticks, _) = read.map_err(Error::vulkan(
                "vkGetCalibratedTimestamps",
                self.info.name.as_str(),
            ))?;
            let anchor = ClockAnchor {
                host: before + half,
                ticks: ticks[0],
                within: half,
            };
            if best.is_none_or(|b| anchor.within < b.within) {
                best = Some(anchor);
            }
        }
        Ok(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::DeviceKind;

    fn info(bits: u32, period_ns: f32) -> DeviceInfo {
        DeviceInfo {
            index: 0,
            name: String::new(),
            kind: DeviceKind::Other,
            driver: String::new(),
            api_version: String::new(),
            unusable: None,
            timestamp_period_ns: period_ns,
            timestamp_bits: bits,
            has_calibrated_timestamps: true,
            has_pipeline_statistics: true,
            has_sample_counts: true,
            max_point_size_px: 1.0,
            point_step_px: 0.0,
            max_image_side: 1,
            max_mapped_side: 1,
            max_storage_range: 1,
            max_storage_buffers: 1,
            max_allocation: 1,
            max_buffer: 1,
            uniform_alignment: 1,
            device_memory: 1,
            has_full_index: true,
            has_first_instance: true,
            has_int64_atomics: true,
            has_float_blend: true,
            subpixel_bits: 8,
        }
    }

    #[test]
    fn a_clock_may_wrap_between_two_timestamps() {
        let whole = info(64, 1.0);
        assert_eq!(whole.ms_between(1_000_000, 3_000_000), 2.0);
        assert_eq!(whole.ms_between(3_000_000, 1_000_000), -2.0);
        assert_eq!(whole.ms_between(u64::MAX, 999_999), 1.0);
        // 36 bits of 52 ns: from just before the end to just after.
        let short = info(36, 52.0);
        let end = (1 << 36) - 1;
        assert_eq!(short.ms_between(end, 999_999), 52.0);
        assert_eq!(short.ms_between(999_999, end), -52.0);
        // Bits above the valid ones say nothing.
        assert_eq!(short.ms_between(end, (7 << 36) | 999_999), 52.0);
    }

    #[test]
    fn an_anchor_puts_timestamps_on_the_host_clock() {
        let host = Instant::now();
        let anchor = ClockAnchor {
            host,
            ticks: 5_000_000,
            within: Duration::ZERO,
        };
        let info = info(64, 2.0);
        let at = |ticks| anchor.instant_of(ticks, &info);
        assert_eq!(at(5_000_000), Some(host));
        assert_eq!(at(5_500_000), Some(host + Duration::from_millis(1)));
        assert_eq!(
            at(5_500_000 - 1_000_000),
            host.checked_sub(Duration::from_millis(1))
        );
    }
}
