//! `surfel reproduce`

use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::source::{KeepArgs, ModelArgs, SurfaceArgs, ViewFraming};
use super::{CommandFailure, Outcome, print, say, usage, write_text};
use clap::ValueEnum;
use serde_json::json;
use std::path::{Path, PathBuf};
use surfel::chart::plot::angles::angles_svg;
use surfel::chart::plot::pixels;
use surfel::chart::published::dietz_failures::failures;
use surfel::chart::published::{PublishedSubject, PublishedTable, benda, dietz, qsplat};
use surfel::render::engine::Backend;

const EXAMPLES: &str = "\
Examples:
  surfel reproduce benda                                  his sphere and torus, which are generated
  surfel reproduce benda horse.ply hand.ply.gz dragon.ply.gz
  surfel reproduce qsplat bunny.ply.gz --csv qsplat.csv
  surfel reproduce dietz porsche.obj bunny.obj.gz --json
  surfel reproduce dietz porsche.obj --chart angles.svg
  surfel reproduce dietz --failures failures.png

Counts can be compared; times only as ratios, since the machines are not the same. docs/MEASURING.md has the protocol.";

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ModelOrigin {
    /// Benda, Point Based Rendering: tables 5.1 to 5.6, figure 5.8
    Benda,
    /// Rusinkiewicz and Levoy, QSplat: what the text says
    Qsplat,
    /// Dietz, Point Rendering: counts, levels of detail
    Dietz,
}

/// Print published tables beside what is measured here.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ReproduceArgs {
    /// Whose tables
    #[arg(value_enum, value_name = "SOURCE")]
    origin: ModelOrigin,
    /// Models to measure [default: for benda generate:sphere:1000000 and generate:torus:4000000, else generate:statue:400000]
    #[arg(value_name = "MODEL")]
    models: Vec<PathBuf>,
    /// Timed frames of each cell
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write the tables as comma-separated values; - for standard output, instead of the text
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    csv: Option<PathBuf>,
    /// Of dietz and one model: draw error and time of splats from vertices by angle, as SVG or PNG
    #[arg(long, value_name = "FILE")]
    chart: Option<PathBuf>,
    /// Of dietz: draw his failures beside ours as PNG; without models that is all that is done
    #[arg(long, value_name = "FILE")]
    failures: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The square meshes of figure 5.8 with the nodes of their trees.
fn squares(bar: &JobBar) -> Result<Vec<(u64, u64)>, CommandFailure> {
    (1..=10)
        .map(|k| {
            let triangles = k * 100_000;
            let source = ModelArgs {
                model: PathBuf::from(format!("generate:square:{triangles}")),
                weld: false,
                frame: ViewFraming::Robust,
                surface: SurfaceArgs::default(),
                keep: KeepArgs::default(),
            };
            let tree = source.open_with(bar)?.model.tree;
            Ok((triangles, (tree.nodes.len() + tree.leaves.len()) as u64))
        })
        .collect()
}

impl ReproduceArgs {
    /// Refuses files that cannot be written, or would be over others of this command.
    fn check_files(&self) -> Outcome {
        let all = [
            ("csv", &self.csv),
            ("chart", &self.chart),
            ("failures", &self.failures),
        ];
        let given = all.map(|(name, path)| path.as_deref().map(|path| (name, path)));
        let given: Vec<(&str, &Path)> = given.into_iter().flatten().collect();
        for (i, &(name, path)) in given.iter().enumerate() {
            super::require_folder(path)?;
            let is_other = given[..i].iter().any(|other| other.1 == path);
            if path != Path::new("-") && (is_other || self.models.iter().any(|m| m == path)) {
                return Err(usage(format!(
                    "--{name} {} would be written over another file of this command",
                    path.display()
                )));
            }
        }
        let is_dietz = matches!(self.origin, ModelOrigin::Dietz);
        if self.failures.is_some() && !is_dietz {
            return Err(usage(
                "--failures shows those of dietz; leave it out with other sources",
            ));
        }
        if let Some(path) = &self.failures
            && !has_end(path, "png")
        {
            return Err(usage(format!(
                "--failures {} is no PNG file; its name must end in .png",
                path.display()
            )));
        }
        if let Some(path) = &self.chart {
            if !is_dietz || self.models.len() != 1 {
                return Err(usage(
                    "--chart shows the splats of dietz on one model; name one, or leave --chart out",
                ));
            }
            if !has_end(path, "svg") && !has_end(path, "png") {
                return Err(usage(format!(
                    "--chart {} is neither an SVG nor a PNG file; its name must end in .svg or .png",
                    path.display()
                )));
            }
        }
        Ok(())
    }

    /// Prints the tables, or writes them where that is asked for; `backend` is what they were measured on.
    fn show(&self, tables: &[PublishedTable], backend: Option<&Backend>) -> Outcome {
        if self.json {
            let all = json!({
                "device": backend.map(super::stats::device_of),
                "repeats": self.repeats,
                "tables": tables,
            });
            let text =
                serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
            print(&(text + "\n"))?;
        } else if let Some(path) = &self.csv {
            let mut text = String::new();
            for table in tables {
                text += &table.csv().map_err(|e| CommandFailure::Run(e.into()))?;
                text.push('\n');
            }
            write_text(path, text.trim_end_matches('\n'))?;
        } else {
            let text: Vec<String> = tables.iter().map(PublishedTable::text).collect();
            print(&text.join("\n"))?;
            if let Some(backend) = backend {
                say(&format!("measured on {}", backend.name()));
            }
        }
        Ok(())
    }
}

/// Tells whether a file's name ends so, in capitals or not.
fn has_end(path: &Path, end: &str) -> bool {
    (path.extension()).is_some_and(|found| found.eq_ignore_ascii_case(end))
}

/// Writes a chart as its file's name asks for.
pub(super) fn write_chart(path: &Path, svg: &str) -> Outcome {
    if has_end(path, "png") {
        return Ok(pixels(svg, 1.5)?.save_png(path)?);
    }
    write_text(path, svg)
}

pub(crate) fn run(mut args: ReproduceArgs, quiet: bool) -> Outcome {
    let is_default = args.models.is_empty();
    if is_default {
        args.models = match args.origin {
            ModelOrigin::Benda => vec![
                "generate:sphere:1000000".into(),
                "generate:torus:4000000".into(),
            ],
            ModelOrigin::Qsplat | ModelOrigin::Dietz => vec!["generate:statue:400000".into()],
        };
    }
    args.check_files()?;
    let bar = JobBar::new(quiet);
    let mut tables: Vec<PublishedTable> = Vec::new();
    if let Some(path) = &args.failures {
        let (sheet, table) = failures(&bar)?;
        sheet.save_png(path)?;
        tables.push(table);
        if is_default {
            drop(bar);
            return args.show(&tables, None);
        }
    }
    let backend = args.device.open()?;
    for path in &args.models {
        let source = ModelArgs {
            model: path.clone(),
            weld: false,
            frame: ViewFraming::Robust,
            surface: SurfaceArgs::default(),
            keep: KeepArgs::default(),
        };
        let ready = source.open_with(&bar)?;
        if ready.model.vertices.is_empty() {
            return Err(usage(format!(
                "{}: there is nothing in it to draw",
                ready.name
            )));
        }
        let subject = PublishedSubject {
            name: &ready.name,
            model: &ready.model,
            build_s: ready.build_ms / 1e3,
        };
        let found = match args.origin {
            ModelOrigin::Benda => benda::tables(&backend, &subject, args.repeats, &bar)?,
            ModelOrigin::Qsplat => qsplat::tables(&backend, &subject, args.repeats, &bar)?,
            ModelOrigin::Dietz => {
                let (tables, lines) = dietz::tables(&backend, &subject, args.repeats, &bar)?;
                if let Some(path) = &args.chart {
                    let file = Path::new(&ready.name).file_name();
                    let name = file.unwrap_or(ready.name.as_ref()).to_string_lossy();
                    let title = format!("{name}, {}", backend.name());
                    write_chart(path, &angles_svg(&title, &lines))?;
                }
                tables
            }
        };
        if found.is_empty() {
            let names: Vec<String> = benda::MODELS
                .iter()
                .map(|m| format!("{} ({})", m.name, super::count(m.triangles)))
                .collect();
            return Err(usage(format!(
                "{}: {} triangles are none of his models: {}",
                ready.name,
                super::count(ready.model.triangles.len() as u64),
                names.join(", ")
            )));
        }
        tables.extend(found);
    }
    if is_default && matches!(args.origin, ModelOrigin::Benda) {
        tables.push(benda::squares(&squares(&bar)?));
    }
    drop(bar);
    args.show(&tables, Some(&backend))?;
    validated(&backend)
}
