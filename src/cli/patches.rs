//! `surfel patches`

use super::cameras::{orbit_camera, parse_size};
use super::error_patches::parse_error;
use super::progress::JobBar;
use super::source::ModelArgs;
use super::{CommandFailure, Outcome, bytes, count, print, usage, write_text};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;
use surfel::cut::CutSettings;
use surfel::measure::patches::{PatchPlan, PatchRow, measure};
use surfel::patches::{self, ErrorTolerances, PatchCutSettings};

const EXAMPLES: &str = "\
Examples:
  surfel patches generate:sphere:1000000
  surfel patches dragon.ply.gz --fills 1,0.5 --error 0.15,0.25,16 -o pictures
  surfel patches generate:statue:2000000 --least 3 --json - | jq '.rows[] | [.view, .way, .visited, .flip]'

A node is drawn as one oriented polygon as soon as its thickness, what it reaches over the surface, and its shade are wrong
by less than the tolerances. Beside it stand one exact sample a pixel, and triangles and splats by size on screen.";

/// Measure the cut by error beside the cut by size.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PatchesArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// Tolerances: pixels at silhouettes, pixels elsewhere, grey levels of the shade; negative ones draw no patch
    #[arg(long, value_name = "RIM,INSIDE,SHADE", default_value = "0.15,0.25,24", value_parser = parse_error, allow_hyphen_values = true)]
    error: ErrorTolerances,
    /// Hold the shade to its tolerance at every vertex, not on average
    #[arg(long)]
    strict: bool,
    /// Least diameter of a patch in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 1.0)]
    least: f32,
    /// Distances: projected diameter of the bounding sphere over the shorter side
    #[arg(
        long,
        value_name = "FILLS",
        value_delimiter = ',',
        default_value = "1,0.5,0.125,4"
    )]
    fills: Vec<f64>,
    /// Direction of the view, degrees
    #[arg(long, value_name = "AZIMUTH,ELEVATION", default_value = "30,20", value_parser = super::cameras::parse_orbit, allow_hyphen_values = true)]
    orbit: [f64; 3],
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", default_value = "500x500", value_parser = parse_size)]
    size: (u32, u32),
    /// Samples of the reference along each side of a pixel
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=16))]
    grid: u32,
    /// Timed cuts of each kind
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Folder to write the pictures to; made if it is not there
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Write all figures as JSON; - for standard output, instead of the table
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl PatchesArgs {
    fn check(&self) -> Outcome {
        if let Some(bad) = self
            .fills
            .iter()
            .find(|fill| !(**fill > 1e-3 && **fill <= 100.0))
        {
            return Err(usage(format!(
                "--fills {bad}: expected above 0.001 and at most 100"
            )));
        }
        if !(self.least >= 0.0 && self.least <= 1e4) {
            return Err(usage(format!(
                "--least {} is no diameter from 0 to 10000 pixels",
                self.least
            )));
        }
        super::check_outputs(&self.json.iter().collect::<Vec<_>>(), &self.source.model)?;
        if let Some(folder) = &self.output {
            std::fs::create_dir_all(folder).map_err(|e| {
                let what = format!("cannot make the folder {}", folder.display());
                CommandFailure::Run(anyhow::Error::new(e).context(what))
            })?;
        }
        Ok(())
    }

    /// The cuts to measure: as asked for, and with polygons below a pixel.
    fn cuts(&self, is_closed: bool) -> Vec<(String, PatchCutSettings)> {
        let plain = PatchCutSettings {
            cut: CutSettings {
                cull_back: is_closed,
                ..CutSettings::default()
            },
            tolerances: self.error,
            least_px: self.least,
            tiny_polygons: false,
        };
        let tiny = PatchCutSettings {
            tiny_polygons: true,
            ..plain
        };
        vec![("patches".into(), plain), ("and tiny ones".into(), tiny)]
    }
}

pub(crate) fn run(args: PatchesArgs, quiet: bool) -> Outcome {
    args.check()?;
    let bar = JobBar::new(quiet);
    let ready = args.source.open_with(&bar)?;
    let model = &ready.model;
    if !model.kind().is_surface() {
        return Err(usage(format!(
            "{}: only surfaces of triangles have patches",
            ready.name
        )));
    }
    let start = Instant::now();
    let records = patches::build(model, &bar)?;
    let build_s = start.elapsed().as_secs_f64();
    let views = args.fills.iter().map(|&fill| {
        let [azimuth, elevation, _] = args.orbit;
        let camera = orbit_camera(&ready, args.size, [azimuth, elevation, fill]);
        Ok((format!("{fill}"), camera.view(model.origin)?))
    });
    let plan = PatchPlan {
        views: views.collect::<Result<_, CommandFailure>>()?,
        samples: args.grid,
        cuts: args.cuts(model.is_closed),
        is_strict: args.strict,
        repeats: args.repeats,
    };
    let findings = measure(model, &records, &plan, &bar)?;
    drop(bar);
    if let Some(folder) = &args.output {
        for (row, picture) in findings.rows.iter().zip(&findings.pictures) {
            let name = format!("{}-{}.png", row.view, row.way.replace(' ', "-"));
            picture.save_png(&folder.join(name))?;
        }
    }
    let usable = records
        .records
        .iter()
        .filter(|patch| patch.overhang.is_finite());
    let usable = usable.count();
    if let Some(path) = &args.json {
        let all = json!({
            "model": ready.name,
            "triangles": model.triangles.len(),
            "nodes": records.records.len(),
            "usable": usable,
            "build_s": build_s,
            "error": [args.error.rim_px, args.error.inside_px, args.error.shade_levels],
            "size": [args.size.0, args.size.1],
            "rows": findings.rows,
        });
        let text = serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
        if path == std::path::Path::new("-") {
            return Ok(());
        }
    }
    let mut text = format!(
        "{}: {} triangles; records of {} nodes ({} may be patches, {}) in {build_s:.1} s\n\n",
        ready.name,
        count(model.triangles.len() as u64),
        count(records.records.len() as u64),
        count(usable as u64),
        bytes(size_of_val(&records.records[..]) as u64),
    );
    text += &table(&findings.rows);
    text += &reasons(&findings.rows);
    print(&text)
}

/// The rows for people.
fn table(rows: &[PatchRow]) -> String {
    let mut text = format!(
        "{:>6} {:14} {:>9} {:>10} {:>8} {:>7} {:>8} {:>9} {:>8} {:>7} {:>6} {:>7} {:>6} {:>6}\n",
        "fill",
        "",
        "visited",
        "primitives",
        "patches",
        "tiny",
        "squares",
        "triangles",
        "cut ms",
        "FLIP",
        "dB",
        "missing",
        "extra",
        "wrong"
    );
    for row in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>6} {:14} {:>9} {:>10} {:>8} {:>7} {:>8} {:>9} {:>8.2} {:>7.4} {:>6.1} {:>7} {:>6} {:>6}",
            row.view,
            row.way,
            row.visited,
            row.primitives,
            row.patches,
            row.tiny,
            row.squares,
            row.triangles,
            row.cut_ms,
            row.flip,
            row.psnr_db,
            row.missing,
            row.extra,
            row.wrong
        );
    }
    text
}

/// Sizes of patches, and why other nodes are none.
fn reasons(rows: &[PatchRow]) -> String {
    let mut text = String::from(
        "\nPatches up to 2, 4, 8, 16, 32 pixels and more; nodes refused for their cone, the near plane, their error at a\n\
         silhouette, elsewhere, their shade, their size\n",
    );
    for row in rows.iter().filter(|row| row.patches > 0) {
        let refused = &row.refused;
        let reasons = [
            refused.never,
            refused.near,
            refused.rim,
            refused.inside,
            refused.shade,
            refused.size,
        ];
        let (sizes, reasons) = (row.sizes.map(count), reasons.map(count));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>6} {:14} {}; {}",
            row.view,
            row.way,
            sizes.join(" "),
            reasons.join(" ")
        );
    }
    text
}
