//! Choice of the backend that draws a frame.

use crate::gpu::Error;
use crate::render::cpu::supported::unsupported_reason;
use crate::render::technique::Technique;
use crate::render::{Path, PictureOutputs, Settings};

/// The backend of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FrameBackend {
    /// The Vulkan device.
    Device,
    /// The processor's fast renderer.
    Cpu,
    /// The reference on the processor.
    Reference,
}

/// The backends that may draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct AvailableBackends {
    /// A Vulkan device.
    pub(crate) has_device: bool,
    /// The processor's fast renderer.
    pub(crate) has_cpu: bool,
    /// The reference.
    pub(crate) has_reference: bool,
}

impl AvailableBackends {
    /// Chooses the backend of a frame of these settings, outputs and size, pixels. The processor comes first. Beside a
    /// device it leaves frames to that for which somebody insists on a rasterizer, those that draw the whole mesh without
    /// photographs, and those of splats from vertices that are blended.
    ///
    /// # Errors
    /// [`Error::Unsupported`] when none can draw it, with the reason.
    pub(crate) fn choose(
        self,
        settings: &Settings,
        outputs: PictureOutputs,
        size: [u32; 2],
    ) -> Result<FrameBackend, Error> {
        let is_left = self.has_device && !is_usual(settings);
        let reason = match self.has_cpu {
            false => Some("it is not asked for"),
            true if is_left => Some("it is left to the device"),
            true => unsupported_reason(settings, outputs, size),
        };
        match reason {
            None => Ok(FrameBackend::Cpu),
            Some(_) if self.has_device => Ok(FrameBackend::Device),
            Some(_) if self.has_reference => Ok(FrameBackend::Reference),
            Some(why) => Err(Error::Unsupported {
                what: "this picture by the processor's renderer",
                why: why.into(),
            }),
        }
    }
}

/// Tells whether the processor's renderer is the usual choice beside a device that is the processor itself, where it can.
pub(crate) fn is_usual(settings: &Settings) -> bool {
    // Photographs take longer than what they are put on, and the processor's renderer looks only where it must.
    settings.path == Path::Auto
        && (settings.has_lists() || settings.shows_photos())
        && !Technique::blends_vertex_splats(settings)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::oriented::splats::SplatRules;
    use crate::render::{Blend, Method, PhotoDisplay, SplatKind};

    #[test]
    fn the_processor_draws_what_it_can_and_nobody_insists_on() {
        let of = |has_device, has_cpu, has_reference| AvailableBackends {
            has_device,
            has_cpu,
            has_reference,
        };
        let outputs = PictureOutputs::default();
        let plain = Settings::default();
        let rastered = Settings {
            path: Path::Raster,
            ..plain
        };
        let whole = Settings {
            method: Method::Triangles,
            ..plain
        };
        let fuzzy = Settings {
            splat: SplatKind::Gauss,
            ..plain
        };
        let photographed = Settings {
            photos: PhotoDisplay::Color,
            ..plain
        };
        let (device, cpu, reference) = (
            Some(FrameBackend::Device),
            Some(FrameBackend::Cpu),
            Some(FrameBackend::Reference),
        );
        for (available, wanted) in [
            (of(true, true, false), [cpu, device, device, device]),
            (of(true, false, false), [device; 4]),
            (of(false, true, true), [cpu, cpu, cpu, reference]),
            (of(false, true, false), [cpu, cpu, cpu, None]),
            (of(false, false, true), [reference; 4]),
        ] {
            let found = [plain, rastered, whole, fuzzy]
                .map(|settings| available.choose(&settings, outputs, [100, 100]).ok());
            assert_eq!(found, wanted, "{available:?}");
        }
        // Where they are not blended they are ellipses, which it draws.
        let flat = Settings {
            blend: Some(Blend::Opaque),
            ..fuzzy
        };
        let chosen = of(true, true, false).choose(&flat, outputs, [100, 100]);
        assert_eq!(chosen.ok(), cpu);
        // It puts photographs on the whole mesh, too.
        let on_all = Settings {
            method: Method::Triangles,
            ..photographed
        };
        for settings in [photographed, on_all] {
            let chosen = of(true, true, false).choose(&settings, outputs, [100, 100]);
            assert_eq!(chosen.ok(), cpu);
        }
        // Splats from vertices that are blended it draws where there is no device.
        let of_vertices = Settings {
            method: Method::Splats,
            vertex_splats: Some(SplatRules::default()),
            ..fuzzy
        };
        let chosen =
            |available: AvailableBackends| available.choose(&of_vertices, outputs, [100, 100]).ok();
        assert_eq!(chosen(of(true, true, false)), device);
        assert_eq!(chosen(of(false, true, true)), cpu);
        let error = of(false, true, false).choose(&fuzzy, outputs, [100, 100]);
        assert!(error.unwrap_err().to_string().contains("filtered"));
    }
}
