//! `surfel devices`

use super::{Failure, Outcome, bytes, print, say};
use std::fmt::Write;
use surfel::bench::calibrate::{Calibration, Found};
use surfel::bench::rates::kinds;
use surfel::gpu::{self, Gpu, Options, device, profile};
use surfel::measure::store;
use surfel::method::costs::{Costs, PixelCosts, SIZES_PX};

/// List the devices of this machine and the limits that matter.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel devices\n  surfel devices --self-test\n  surfel devices --calibrate\n  surfel devices --json"
)]
pub(crate) struct Args {
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Check on every usable device that pass times can be believed
    #[arg(long)]
    self_test: bool,
    /// Measure anew on every usable device what splats, triangles, pixels and nodes cost, and keep it for the choice of paths
    #[arg(long)]
    calibrate: bool,
}

/// The costs of a device for people.
fn costs_text(found: &Found) -> String {
    let mut out = String::new();
    let calibration = &found.calibration;
    let costs: &Costs = &calibration.costs;
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "   costs in nanoseconds, measured in {:.0} ms; {}",
        calibration.took_ms,
        match (&found.file, &found.not_kept) {
            (Some(file), None) => format!("kept in {}", file.display()),
            _ => "not kept".into(),
        }
    );
    let head: Vec<String> = SIZES_PX.iter().map(|s| format!("{s} px")).collect();
    let _ = writeln!(
        out,
        "      {:<22}{:>10}{:>10}{:>10}{:>10}{:>10}",
        "", head[0], head[1], head[2], "a pixel", "covered"
    );
    let mut row = |name: String, splat: &[f64], pixels: &PixelCosts| {
        let mut line = format!("      {name:<22}");
        for i in 0..SIZES_PX.len() {
            let cell = splat
                .get(i)
                .map_or_else(String::new, |ns| format!("{ns:.1}"));
            line += &format!("{cell:>10}");
        }
        line += &format!("{:>10.2}{:>10.2}", pixels.any_ns, pixels.covered_ns);
        let _ = writeln!(out, "{line}");
    };
    for (name, ways) in kinds(costs) {
        for (by, way) in [("raster", &ways.raster), ("compute", &ways.compute)] {
            if let Some(way) = way {
                row(format!("{name}, {by}"), &way.splat_ns, &way.pixels);
            }
        }
    }
    let triangle = &costs.triangle;
    for (by, way) in [("raster", &triangle.raster), ("compute", &triangle.compute)] {
        if let Some(way) = way {
            row(format!("triangle, {by}"), &[way.triangle_ns], &way.pixels);
        }
    }
    let _ = write!(
        out,
        "      {:<22}{:>10.2}",
        "visited node, CPU", costs.node_ns
    );
    out
}

pub(crate) fn run(args: Args) -> Outcome {
    let devices = device::list()?;
    let mut reports = Vec::new();
    for info in &devices {
        if !(args.self_test || args.calibrate) || info.unusable.is_some() {
            reports.push((None, None));
            continue;
        }
        let gpu = Gpu::open(&Options {
            device: Some(info.index.to_string()),
            ..Options::default()
        })?;
        let test = if args.self_test {
            Some(profile::self_test(&gpu)?)
        } else {
            None
        };
        let costs = if args.calibrate {
            let found = Calibration::kept(&gpu, store::folder().as_deref(), true)?;
            if let Some(error) = &found.not_kept {
                say(&format!("surfel: warning: the costs are not kept: {error}"));
            }
            Some(found)
        } else {
            None
        };
        reports.push((test, costs));
    }
    if args.json {
        let rows: Vec<_> = devices
            .iter()
            .zip(&reports)
            .map(|(d, (test, found))| {
                serde_json::json!({
                    "device": d,
                    "self_test": test,
                    "costs_ns": found.as_ref().map(|f| &f.calibration.costs),
                    "costs_file": found.as_ref().and_then(|f| f.file.as_ref()),
                })
            })
            .collect();
        let text = serde_json::to_string_pretty(&rows).map_err(|e| Failure::Run(e.into()))?;
        return print(&(text + "\n"));
    }
    let mut out = String::new();
    for (d, (report, found)) in devices.iter().zip(&reports) {
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
        if let Some(found) = found {
            let _ = writeln!(out, "{}", costs_text(found));
        }
    }
    if devices.is_empty() {
        return Err(gpu::Error::NoDevice("there is no Vulkan device".into()).into());
    }
    print(&out)
}
