//! `surfel devices`

use super::{Failure, Outcome, bytes, print};
use std::fmt::Write;
use surfel::gpu::{self, Gpu, Options, device, profile};

/// List the devices of this machine and the limits that matter.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel devices\n  surfel devices --self-test\n  surfel devices --json"
)]
pub(crate) struct Args {
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Check on every usable device that pass times can be believed
    #[arg(long)]
    self_test: bool,
}

pub(crate) fn run(args: Args) -> Outcome {
    let devices = device::list()?;
    let mut reports = Vec::new();
    for info in &devices {
        let report = if args.self_test && info.unusable.is_none() {
            let gpu = Gpu::open(&Options {
                device: Some(info.index.to_string()),
                ..Options::default()
            })?;
            Some(profile::self_test(&gpu)?)
        } else {
            None
        };
        reports.push(report);
    }
    if args.json {
        let rows: Vec<_> = devices
            .iter()
            .zip(&reports)
            .map(|(d, r)| serde_json::json!({ "device": d, "self_test": r }))
            .collect();
        let text = serde_json::to_string_pretty(&rows).map_err(|e| Failure::Run(e.into()))?;
        return print(&(text + "\n"));
    }
    let mut out = String::new();
    for (d, report) in devices.iter().zip(&reports) {
        let kind = match d.kind {
            device::Kind::Discrete => "discrete GPU",
            device::Kind::Integrated => "integrated GPU",
            device::Kind::Virtual => "virtual GPU",
            device::Kind::Cpu => "software, on the CPU",
            device::Kind::Other => "other",
        };
        let yes = |b: bool| if b { "yes" } else { "no" };
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{}: {} ({kind})", d.index, d.name);
        let _ = writeln!(out, "   driver {}, Vulkan {}", d.driver, d.api_version);
        if let Some(reason) = &d.unusable {
            let _ = writeln!(out, "   NOT USABLE: {reason}");
        }
        let _ = writeln!(
            out,
            "   memory {}; largest buffer {}, allocation {}, storage binding {}",
            bytes(d.device_memory),
            bytes(d.max_buffer),
            bytes(d.max_allocation),
            bytes(d.max_storage_range)
        );
        let _ = writeln!(
            out,
            "   largest picture side {} px, largest point {} px, {} sub-pixel bits",
            d.max_image_side, d.max_point_size_px, d.subpixel_bits
        );
        let _ = writeln!(
            out,
            "   timestamps {}, 64-bit atomics {}, 32-bit float blending {}, full 32-bit indices {}",
            if d.timestamp_period_ns > 0.0 {
                format!("every {} ns", d.timestamp_period_ns)
            } else {
                "no".into()
            },
            yes(d.has_int64_atomics),
            yes(d.has_float_blend),
            yes(d.has_full_index)
        );
        let _ = writeln!(
            out,
            "   calibrated timestamps {}, pipeline statistics {}, exact sample counts {}",
            yes(d.has_calibrated_timestamps),
            yes(d.has_pipeline_statistics),
            yes(d.has_sample_counts)
        );
        if let Some(report) = report {
            let _ = writeln!(out, "{report}");
        }
    }
    if devices.is_empty() {
        return Err(gpu::Error::NoDevice("there is no Vulkan device".into()).into());
    }
    print(&out)
}
