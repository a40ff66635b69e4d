//! `surfel chart`

use super::cameras::parse_size;
use super::costs::costs_of;
use super::photo_args::{PhotoArgs, StagedScene};
use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::source::{KeepArgs, ModelArgs, SurfaceArgs, ViewFraming};
use super::{CommandFailure, Outcome, count, print, say, usage, write_text};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use surfel::OpenedModel;
use surfel::chart::agree::{ReferenceAgreement, agreement};
use surfel::chart::page::{PointShot, html, panel_facts};
use surfel::chart::plot::{METRICS, pixels, svg};
use surfel::chart::run::{ChartBench, ChartPlace, block, empty_row, orbit};
use surfel::chart::summary::{SummaryPanel, summarize};
use surfel::chart::{ChartPlan, ChartRow, DrawConfiguration, read_rows, write_rows};
use surfel::image::FloatImage;
use surfel::progress::Progress;
use surfel::render::engine::Backend;

const EXAMPLES: &str = "\
Examples:
  surfel chart dragon.ply.gz -o chart --quick
  surfel chart horse.ply hand.ply.gz dragon.ply.gz -o chart       some hours on a software device; goes on when interrupted
  surfel chart generate:statue:1000000 -o chart --views 2 --thresholds 1,2,4 --json
  surfel chart castle.ply -o chart --quick --photos scene.mvs     with photographs on it
  surfel chart dragon.ply.gz -o again --quick --against chart     measures again and says whether the two runs agree

The folder gets rows.csv (a row a choice, distance and view), chart.svg, chart.png and index.html, which shows the
pictures beside the reference. docs/MEASURING.md says what each column means.";

/// Measure time and error of every method, splat and threshold, and draw them as a chart.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ChartArgs {
    /// Model files, generate:SHAPE[:TRIANGLES], or scene:NAME
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<PathBuf>,
    /// Folder for the chart; made if it is not there. Rows of an interrupted run with the same settings are taken over
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// One view of each distance, few choices: about two minutes for a million triangles
    #[arg(long)]
    quick: bool,
    /// Views of the standard orbit at each distance [default: 4, quick 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=360))]
    views: Option<u32>,
    /// Timed frames of each choice and view [default: 9, quick 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: Option<u32>,
    /// Thresholds in pixels, with all methods and splats [default: 0.5 to 16, ten of them]
    #[arg(
        long,
        value_name = "PIXELS",
        value_delimiter = ',',
        conflicts_with = "quick"
    )]
    thresholds: Option<Vec<f32>>,
    /// Distances: projected diameter of the bounding sphere over the shorter side [default: 1,0.5,0.125]
    #[arg(long, value_name = "FILLS", value_delimiter = ',')]
    fills: Option<Vec<f64>>,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", default_value = "500x500", value_parser = parse_size)]
    size: (u32, u32),
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
    /// Folder of an earlier chart of the same models: say whether the two agree (the frontier, and times relative to
    /// triangles within 15 percent), and end with exit code 1 if they do not
    #[arg(long, value_name = "FOLDER")]
    against: Option<PathBuf>,
    /// Put the photographs of a scene on the one model, in every picture: the time has that of choosing their colors
    #[arg(long, value_name = "SCENE")]
    photos: Option<PathBuf>,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    weld: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl ChartArgs {
    fn plan(&self) -> Result<ChartPlan, CommandFailure> {
        let mut plan = if self.quick {
            ChartPlan::quick()
        } else {
            ChartPlan::full()
        };
        plan.size = self.size;
        plan.views = self.views.unwrap_or(plan.views);
        plan.repeats = self.repeats.unwrap_or(plan.repeats);
        if let Some(thresholds) = &self.thresholds {
            if let Some(bad) = thresholds.iter().find(|t| !(0.0..=255.0).contains(*t)) {
                return Err(usage(format!(
                    "--thresholds {bad} is no size in pixels from 0 to 255"
                )));
            }
            plan.thresholds = Some(unique(thresholds));
        }
        if let Some(fills) = &self.fills {
            if let Some(bad) = fills.iter().find(|f| !(**f > 1e-3 && **f <= 100.0)) {
                return Err(usage(format!(
                    "--fills {bad}: expected above 0.001 and at most 100"
                )));
            }
            plan.fills = unique(fills);
        }
        for (i, model) in self.models.iter().enumerate() {
            if self.models[..i].contains(model) {
                return Err(usage(format!("{} is named twice", model.display())));
            }
        }
        if self.photos.is_some() && self.models.len() > 1 {
            return Err(usage("--photos puts photographs on one model"));
        }
        if self.output.exists() && !self.output.is_dir() {
            return Err(usage(format!(
                "--output {} is not a folder",
                self.output.display()
            )));
        }
        if self.against.as_ref() == Some(&self.output) {
            return Err(usage(
                "--against and --output are the same folder: a chart agrees with itself".to_owned(),
            ));
        }
        Ok(plan)
    }

    /// The panels of the chart that this one is compared with.
    fn other_panels(&self) -> Result<Option<Vec<SummaryPanel>>, CommandFailure> {
        let Some(folder) = &self.against else {
            return Ok(None);
        };
        let path = folder.join("rows.csv");
        let rows = read_rows(&path)?;
        if rows.is_empty() {
            return Err(usage(format!(
                "--against {}: there are no rows of a chart in {}",
                folder.display(),
                path.display()
            )));
        }
        Ok(Some(summarize(&rows)))
    }
}

/// Without repetitions, in the same order.
fn unique<T: PartialEq + Copy>(values: &[T]) -> Vec<T> {
    let mut kept = Vec::new();
    for value in values {
        if !kept.contains(value) {
            kept.push(*value);
        }
    }
    kept
}

/// Rows of an earlier run that this one can go on from; what was measured otherwise is kept in another file.
fn earlier_rows(path: &Path, like: &ChartRow) -> Result<Vec<ChartRow>, CommandFailure> {
    let all = read_rows(path)?;
    let (rows, others): (Vec<ChartRow>, Vec<ChartRow>) =
        all.into_iter().partition(|r| r.is_like(like));
    if !others.is_empty() {
        let aside = path.with_file_name("rows.other.csv");
        let mut kept = read_rows(&aside)?;
        say(&format!(
            "surfel: {} rows of {} were measured by another program, device or effort: moved to {}",
            others.len(),
            path.display(),
            aside.display()
        ));
        kept.extend(others);
        write_rows(&aside, &kept)?;
        write_rows(path, &rows)?;
    }
    Ok(rows)
}

/// What a run collects.
struct ChartRun<'a> {
    plan: &'a ChartPlan,
    backend: &'a Backend,
    path: PathBuf,
    earlier: Vec<ChartRow>,
    rows: Vec<ChartRow>,
    references: Vec<FloatImage>,
    shots: Vec<PointShot>,
}

impl ChartRun<'_> {
    /// Measures all of a model that is not measured yet, and draws the pictures of its frontier.
    fn model(
        &mut self,
        ready: &OpenedModel,
        mut staged: Option<StagedScene>,
        bar: &JobBar,
    ) -> Outcome {
        let (model, plan) = (&ready.model, self.plan);
        let choices = plan.choices(model, self.backend);
        let mut bench = ChartBench::new(self.backend, model, plan.size)?;
        let settings: Vec<_> = choices.iter().map(DrawConfiguration::settings).collect();
        bench.set_costs(costs_of(self.backend, &settings));
        let blocks = plan.fills.len() as u64 * u64::from(plan.views);
        bar.stage("measure", blocks * plan.block_frames(choices.len()));
        let first_row = self.rows.len();
        let mut references = Vec::new();
        for fill in 0..plan.fills.len() {
            let mut reference = None;
            for view in 0..plan.views {
                let place = ChartPlace {
                    model: &ready.name,
                    fill,
                    view,
                };
                let like = |c| empty_row(self.backend, model, plan, place, c);
                let found: Vec<ChartRow> = choices
                    .iter()
                    .filter_map(|choice| {
                        let row = like(choice);
                        let is_it =
                            |r: &&ChartRow| r.is_of_block(&row) && r.choice() == Some(*choice);
                        self.earlier.iter().find(is_it).cloned()
                    })
                    .collect();
                if found.len() == choices.len() {
                    self.rows.extend(found);
                    bar.advance(plan.block_frames(choices.len()));
                    continue;
                }
                if let Some(staged) = &mut staged {
                    let view = orbit(model, plan.size, plan.fills[fill], view, plan.views)?;
                    bench.set_photos(staged.frame(&view))?;
                }
                let (rows, seen) = block(self.backend, &mut bench, plan, place, bar)?;
                self.rows.extend(rows);
                self.save()?;
                if view == 0 {
                    reference = Some(seen.picture);
                }
            }
            references.push(reference);
        }
        let panels = summarize(&self.rows[first_row..]);
        let first_panel = self.references.len();
        bar.stage("pictures", panels.len() as u64);
        for (i, (panel, reference)) in panels.iter().zip(references).enumerate() {
            let view = orbit(model, plan.size, plan.fills[i], 0, plan.views)?;
            if let Some(staged) = &mut staged {
                bench.set_photos(staged.frame(&view))?;
            }
            let reference = match reference {
                Some(reference) => reference,
                None => bench.reference(&view, plan.grid, bar)?.picture,
            };
            for &point in &panel.frontier {
                let picture = bench.picture(&view, &panel.points[point].choice)?;
                self.shots.push(PointShot {
                    panel: first_panel + i,
                    point,
                    picture,
                });
            }
            self.references.push(reference);
            bar.advance(1);
        }
        Ok(())
    }

    /// Writes what is measured so far, and what earlier runs have measured of models that are still to come.
    fn save(&self) -> Outcome {
        let rest = self.earlier.iter().filter(|old| {
            !self
                .rows
                .iter()
                .any(|r| r.is_of_block(old) && r.choice() == old.choice())
        });
        let all: Vec<ChartRow> = self.rows.iter().chain(rest).cloned().collect();
        Ok(write_rows(&self.path, &all)?)
    }
}

pub(crate) fn run(args: ChartArgs, quiet: bool) -> Outcome {
    let plan = args.plan()?;
    let other = args.other_panels()?;
    let backend = args.device.open()?;
    let bar = JobBar::new(quiet);
    let mut run: Option<ChartRun<'_>> = None;
    for path in &args.models {
        let source = ModelArgs {
            model: path.clone(),
            weld: args.weld,
            frame: ViewFraming::Robust,
            surface: SurfaceArgs::default(),
            keep: KeepArgs::default(),
        };
        let mut ready = source.open_with(&bar)?;
        let photos = PhotoArgs {
            photos: args.photos.clone(),
            ..PhotoArgs::default()
        };
        let staged = (photos.read()?)
            .map(|scene| StagedScene::new(scene, &ready, &backend, photos.most(), quiet));
        let staged = staged.transpose()?;
        if staged.is_some() {
            // Rows without photographs are other rows.
            ready.name += " with photographs";
        }
        surfel::patches::add_records(&mut ready.model, &bar).map_err(surfel::Error::from)?;
        if ready.model.vertices.is_empty() {
            return Err(usage(format!(
                "{}: there is nothing in it to draw",
                ready.name
            )));
        }
        let run = match &mut run {
            Some(run) => run,
            none => {
                // Only now, so that a model or device that is not there leaves no folder behind.
                std::fs::create_dir_all(&args.output).map_err(|e| {
                    CommandFailure::Run(
                        anyhow::Error::new(e)
                            .context(format!("cannot make the folder {}", args.output.display())),
                    )
                })?;
                let place = ChartPlace {
                    model: &ready.name,
                    fill: 0,
                    view: 0,
                };
                let any = surfel::chart::choice::TRIANGLES;
                let like = empty_row(&backend, &ready.model, &plan, place, &any);
                let path = args.output.join("rows.csv");
                none.insert(ChartRun {
                    plan: &plan,
                    backend: &backend,
                    earlier: earlier_rows(&path, &like)?,
                    path,
                    rows: Vec::new(),
                    references: Vec::new(),
                    shots: Vec::new(),
                })
            }
        };
        run.model(&ready, staged, &bar).map_err(with_hint)?;
    }
    let Some(run) = run else { return Ok(()) };
    bar.stage("chart", 0);
    let panels = summarize(&run.rows);
    let (title, subtitle) = heading(&run);
    let chart = svg(&title, &subtitle, &panels, &METRICS[0]);
    let file = |name: &str| args.output.join(name);
    write_text(&file("chart.svg"), &chart)?;
    pixels(&chart, 1.5)?.save_png(&file("chart.png"))?;
    let page = html(&title, &subtitle, &panels, &run.references, &run.shots)?;
    write_text(&file("index.html"), &page)?;
    drop(bar);
    if args.json {
        let all = json!({
            "device": super::stats::device_of(&backend),
            "version": env!("CARGO_PKG_VERSION"),
            "commit": surfel::measure::COMMIT,
            "width": plan.size.0,
            "height": plan.size.1,
            "views": plan.views,
            "repeats": plan.repeats,
            "samples": plan.grid * plan.grid,
            "panels": panels.iter().map(panel_facts).collect::<Vec<_>>(),
        });
        let text = serde_json::to_string_pretty(&all).map_err(|e| CommandFailure::Run(e.into()))?;
        print(&(text + "\n"))?;
    } else {
        print(&table(&panels, &args.output))?;
    }
    if let (Some(other), Some(folder)) = (other, &args.against) {
        report_agreement(&other, &panels, folder, args.json)?;
    }
    validated(&backend)
}

/// Says whether the panels of two charts agree.
///
/// # Errors
/// When they do not, or are of other models or distances.
fn report_agreement(
    first: &[SummaryPanel],
    second: &[SummaryPanel],
    folder: &Path,
    is_json: bool,
) -> Outcome {
    let Some(all) = agreement(first, second) else {
        return Err(usage(format!(
            "--against {}: it has no model and distance in common with this chart",
            folder.display()
        )));
    };
    let text = agreement_text(&all);
    if is_json {
        say(text.trim_end());
    } else {
        print(&text)?;
    }
    if all.iter().all(ReferenceAgreement::is_kept) {
        return Ok(());
    }
    Err(CommandFailure::Run(anyhow::anyhow!(
        "this chart and the one in {} differ by more than 15 percent or in their frontier; other work on the machine shows \
         first in short frames, so give both runs a quiet machine",
        folder.display()
    )))
}

/// What two charts say of each other, for people.
fn agreement_text(all: &[ReferenceAgreement]) -> String {
    let mut out = String::new();
    for panel in all {
        let ratios = panel.compared - panel.off.len();
        let verdict = if panel.is_kept() { "agree" } else { "DIFFER" };
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "{}, fill {}: the runs {verdict}; {ratios} of {} times relative to triangles are within 15 percent",
            panel.model, panel.fill, panel.compared
        );
        if !panel.off.is_empty() && !(0.95..=1.05).contains(&panel.common) {
            let _ = writeln!(
                out,
                "  half of all are {:.2} times as fast or more, beside triangles: the time of triangles itself has changed",
                panel.common
            );
        }
        for ratio in &panel.off {
            let [a, b] = ratio.speeds;
            let _ = writeln!(out, "  {}: {a:.3} and {b:.3} times as fast", ratio.name);
        }
        for (what, names) in [
            ("other errors", &panel.other_errors),
            ("in another order on the frontier", &panel.out_of_order),
            ("on one frontier only", &panel.moved),
            (
                "on one frontier only, a tie within 15 percent of time",
                &panel.tied,
            ),
        ] {
            if !names.is_empty() {
                let _ = writeln!(out, "  {what}: {}", names.join("; "));
            }
        }
    }
    out
}

/// Tells a user who cancelled what is left.
fn with_hint(failure: CommandFailure) -> CommandFailure {
    use surfel::{Error, chart};
    match failure {
        CommandFailure::Run(error)
            if matches!(
                error.downcast_ref(),
                Some(Error::Chart(chart::ChartError::Cancelled))
            ) =>
        {
            CommandFailure::Run(anyhow::anyhow!(
                "cancelled; the same command goes on from the last whole view"
            ))
        }
        other => other,
    }
}

/// Title and subtitle of the chart.
fn heading(run: &ChartRun<'_>) -> (String, String) {
    let plan = run.plan;
    let kind = match run.backend.device() {
        Some(gpu) if gpu.info().is_cpu() => {
            ", a software device: it ranks methods and predicts no graphics card"
        }
        _ => "",
    };
    let subtitle = format!(
        "{}{kind}; {} x {} pixels; reference: triangles, {} samples a pixel (of clouds the densest cut); {} view{}, {} \
         rounds of frames; surfel {}",
        run.backend.name(),
        plan.size.0,
        plan.size.1,
        plan.grid * plan.grid,
        plan.views,
        if plan.views == 1 { "" } else { "s" },
        plan.repeats,
        env!("CARGO_PKG_VERSION"),
    );
    ("Speed against accuracy".into(), subtitle)
}

/// The frontier of every panel for people.
fn table(panels: &[SummaryPanel], folder: &Path) -> String {
    let mut out = String::new();
    for panel in panels {
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "{}, {} triangles, {} vertices; fill {}: {} choices, {} on the frontier",
            panel.model,
            count(panel.triangles),
            count(panel.vertices),
            panel.fill,
            panel.points.len(),
            panel.frontier.len()
        );
        let _ = writeln!(
            out,
            "  {:<28}{:>10}{:>10}{:>10}{:>10}{:>9}{:>10}{:>10}",
            "", "frame ms", "p5", "p95", "FLIP", "PSNR dB", "outline", "speed"
        );
        for &i in &panel.frontier {
            let p = &panel.points[i];
            let _ = writeln!(
                out,
                "  {:<28}{:>10.2}{:>10.2}{:>10.2}{:>10.5}{:>9.1}{:>10.3}{:>10}",
                p.choice.name(),
                p.frame.median,
                p.frame.p5,
                p.frame.p95,
                p.flip,
                -20.0 * p.rmse_object.log10(),
                p.silhouette_px,
                match panel.speed(p) {
                    s if s.is_finite() => format!("{s:.2} x"),
                    _ => "-".into(),
                }
            );
        }
        if let Some(p) = panel.cheapest(0.01) {
            let _ = writeln!(
                out,
                "  mean FLIP at most 0.01 in every view: {}, {:.2} ms",
                p.choice.name(),
                p.frame.median
            );
        }
        for (name, why) in &panel.refused {
            let _ = writeln!(out, "  {name}: refused: {why}");
        }
    }
    let _ = writeln!(
        out,
        "FLIP: mean over the picture; PSNR: over object pixels; outline: mean distance in pixels; speed: against triangles\n\
         {}",
        folder.join("index.html").display()
    );
    out
}
