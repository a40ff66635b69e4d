//! `surfel reproduce`

use super::progress::Bar;
use super::render::{DeviceArgs, validated};
use super::source::{Framing, KeepArgs, Source, SurfaceArgs};
use super::{Failure, Outcome, print, say, usage, write_text};
use clap::ValueEnum;
use serde_json::json;
use std::path::{Path, PathBuf};
use surfel::chart::plot::angles::angles_svg;
use surfel::chart::published::{PublishedSubject, Table, benda, dietz, qsplat};

const EXAMPLES: &str = "\
Examples:
  surfel reproduce benda                                  his sphere and torus, which are generated
  surfel reproduce benda horse.ply hand.ply.gz dragon.ply.gz
  surfel reproduce qsplat bunny.ply.gz --csv qsplat.csv
  surfel reproduce dietz porsche.obj bunny.obj.gz --json
  surfel reproduce dietz porsche.obj --chart angles.svg

Counts can be compared; times only as ratios, since the machines are not the same. docs/MEASURING.md has the protocol.";

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Origin {
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
pub(crate) struct Args {
    /// Whose tables
    #[arg(value_enum, value_name = "SOURCE")]
    origin: Origin,
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
    /// Of dietz and one model: draw error and time of splats from vertices by angle as SVG
    #[arg(long, value_name = "FILE")]
    chart: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The square meshes of figure 5.8 with the nodes of their trees.
fn squares(bar: &Bar) -> Result<Vec<(u64, u64)>, Failure> {
    (1..=10)
        .map(|k| {
            let triangles = k * 100_000;
            let source = Source {
                model: PathBuf::from(format!("generate:square:{triangles}")),
                weld: false,
                frame: Framing::Robust,
                surface: SurfaceArgs::default(),
                keep: KeepArgs::default(),
            };
            let tree = source.open_with(bar)?.model.tree;
            Ok((triangles, (tree.nodes.len() + tree.leaves.len()) as u64))
        })
        .collect()
}

pub(crate) fn run(mut args: Args, quiet: bool) -> Outcome {
    let is_default = args.models.is_empty();
    if is_default {
        args.models = match args.origin {
            Origin::Benda => vec![
                "generate:sphere:1000000".into(),
                "generate:torus:4000000".into(),
            ],
            Origin::Qsplat | Origin::Dietz => vec!["generate:statue:400000".into()],
        };
    }
    if let Some(path) = &args.csv {
        super::require_folder(path)?;
        if args.models.contains(path) && path != Path::new("-") {
            return Err(usage(format!(
                "--csv {} would be written over its model",
                path.display()
            )));
        }
    }
    if let Some(path) = &args.chart {
        if !matches!(args.origin, Origin::Dietz) || args.models.len() != 1 {
            return Err(usage(
                "--chart shows the splats of dietz on one model; name one, or leave --chart out",
            ));
        }
        super::require_folder(path)?;
        if args.models.contains(path) || args.csv.as_ref() == Some(path) {
            return Err(usage(format!(
                "--chart {} would be written over another file of this command",
                path.display()
            )));
        }
    }
    let backend = args.device.open()?;
    let bar = Bar::new(quiet);
    let mut tables: Vec<Table> = Vec::new();
    for path in &args.models {
        let source = Source {
            model: path.clone(),
            weld: false,
            frame: Framing::Robust,
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
            Origin::Benda => benda::tables(&backend, &subject, args.repeats, &bar)?,
            Origin::Qsplat => qsplat::tables(&backend, &subject, args.repeats, &bar)?,
            Origin::Dietz => {
                let (tables, lines) = dietz::tables(&backend, &subject, args.repeats, &bar)?;
                if let Some(path) = &args.chart {
                    let title = format!("{}, {}", ready.name, backend.name());
                    write_text(path, &angles_svg(&title, &lines))?;
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
    if is_default && matches!(args.origin, Origin::Benda) {
        tables.push(benda::squares(&squares(&bar)?));
    }
    drop(bar);
    if args.json {
        let all = json!({
            "device": super::stats::device_of(&backend),
            "repeats": args.repeats,
            "tables": tables,
        });
        let text = serde_json::to_string_pretty(&all).map_err(|e| Failure::Run(e.into()))?;
        print(&(text + "\n"))?;
    } else if let Some(path) = &args.csv {
        let mut text = String::new();
        for table in &tables {
            text += &table.csv().map_err(|e| Failure::Run(e.into()))?;
            text.push('\n');
        }
        write_text(path, text.trim_end_matches('\n'))?;
    } else {
        let text: Vec<String> = tables.iter().map(Table::text).collect();
        print(&text.join("\n"))?;
        say(&format!("measured on {}", backend.name()));
    }
    validated(&backend)
}
