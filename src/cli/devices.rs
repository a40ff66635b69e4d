//! `surfel devices`

use super::{CommandFailure, Outcome, bytes, print, say};
use std::fmt::Write;
use surfel::bench::calibrate::{CalibrationPart, DeviceCalibration, FoundCalibration};
use surfel::bench::rates;
use surfel::gpu::{self, DeviceOptions, Gpu, device, profile};
use surfel::measure::store;
use surfel::render::cost::model::{DrawCosts, PRIMITIVE_SIZES_PX, PassCosts, SIZES_PX};

/// List the devices of this machine and the limits that matter.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel devices\n  surfel devices --self-test\n  surfel devices --calibrate\n  surfel devices --json"
)]
pub(crate) struct DevicesArgs {
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
fn costs_text(found: &FoundCalibration) -> String {
    let mut out = String::new();
    let calibration = &found.calibration;
    let costs: &DrawCosts = &calibration.costs;
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
    let mut line = |name: &str, cells: &[String]| {
        let cells: String = cells.iter().map(|cell| format!("{cell:>10}")).collect();
        let _ = writeln!(out, "      {name:<26}{}", cells.trim_end());
    };
    let sizes = |sizes: &[f32]| sizes.iter().map(|s| format!("{s} px")).collect::<Vec<_>>();
    let tenths = |ns: &[f64]| ns.iter().map(|ns| format!("{ns:.1}")).collect::<Vec<_>>();
    let passes = |p: &PassCosts| {
        let pixels = [p.picture_ns, p.box_ns, p.covered_ns].map(|ns| format!("{ns:.2}"));
        [vec![format!("{:.0}", p.frame_ns)], pixels.to_vec()].concat()
    };
    let rest = ["a frame", "a pixel", "in box", "covered"].map(str::to_owned);
    line("", &[sizes(&SIZES_PX), rest.to_vec()].concat());
    // One figure for all sizes.
    let one = |ns: f64| [tenths(&[ns]), vec![String::new(); SIZES_PX.len() - 1]].concat();
    for (name, ways) in rates::kinds(costs) {
        for (by, way) in [("raster", &ways.raster), ("compute", &ways.compute)] {
            if let Some(way) = way {
                let cells = [tenths(&way.splat_ns), passes(&way.passes)].concat();
                line(&format!("{name}, {by}"), &cells);
            }
        }
    }
    for (name, merge) in rates::merges(costs) {
        let cells = [one(merge.splat_ns), passes(&merge.passes)].concat();
        line(&format!("{name}, both, on top"), &cells);
    }
    for (by, way) in rates::triangles(costs) {
        let cells = [one(way.triangle_ns), passes(&way.passes)].concat();
        line(&format!("triangle, {by}"), &cells);
    }
    if let Some(ns) = costs.node_ns {
        line("visited node, CPU", &[format!("{ns:.2}")]);
    }
    if let Some(ns) = costs.device_node_ns {
        line("visited node, device", &[format!("{ns:.2}")]);
    }
    if let Some(both) = &costs.primitives {
        line("", &sizes(&PRIMITIVE_SIZES_PX));
        line("square as point", &tenths(&both.point_ns));
        line("square as quad", &tenths(&both.quad_ns));
        let px = both.largest_point_px();
        let choice = if px == 0.0 {
            "quads".to_owned()
        } else if px.is_finite() {
            format!("points up to {px:.1} px, then quads")
        } else {
            "points up to the largest that there are".to_owned()
        };
        line(&format!("by the rasterizer: {choice}"), &[]);
    }
    out.truncate(out.trim_end().len());
    out
}

pub(crate) fn run(args: DevicesArgs) -> Outcome {
    let devices = device::list()?;
    let mut reports = Vec::new();
    for info in &devices {
        if !(args.self_test || args.calibrate) || info.unusable.is_some() {
            reports.push((None, None));
            continue;
        }
        let gpu = Gpu::open(&DeviceOptions {
            device: Some(info.index.to_string()),
            ..DeviceOptions::default()
        })?;
        let test = if args.self_test {
            Some(profile::self_test(&gpu)?)
        } else {
            None
        };
        let costs = if args.calibrate {
            let found = DeviceCalibration::kept(
                &gpu,
                store::folder().as_deref(),
                &CalibrationPart::ALL,
                true,
            )?;
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
        let text =
            serde_json::to_string_pretty(&rows).map_err(|e| CommandFailure::Run(e.into()))?;
        return print(&(text + "\n"));
    }
    let mut out = String::new();
    for (d, (report, found)) in devices.iter().zip(&reports) {
        let kind = match d.kind {
            device::DeviceKind::Discrete => "discrete GPU",
            device::DeviceKind::Integrated => "integrated GPU",
            device::DeviceKind::Virtual => "virtual GPU",
            device::DeviceKind::Cpu => "software, on the CPU",
            device::DeviceKind::Other => "other",
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
            "   largest picture side {} px, largest point {} px in steps of {} px, {} sub-pixel bits",
            d.max_image_side, d.max_point_size_px, d.point_step_px, d.subpixel_bits
        );
        let _ = writeln!(
            out,
            "   timestamps {}, 64-bit atomics {}, 32-bit float blending {}, full 32-bit indices {}, indirect first instances {}",
            if d.timestamp_period_ns > 0.0 {
                format!("every {} ns", d.timestamp_period_ns)
            } else {
                "no".into()
            },
            yes(d.has_int64_atomics),
            yes(d.has_float_blend),
            yes(d.has_full_index),
            yes(d.has_first_instance)
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
