//! `surfel stability`

use super::look::{MethodName, SplatName};
use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::{CommandFailure, Outcome, print, say, usage, write_text};
use std::path::{Path, PathBuf};
use surfel::render::{Method, SplatKind};
use surfel::scenes::{self, SceneEntry};
use surfel::stability::page::{CellShot, SceneRow, SceneTable, thumb};
use surfel::stability::{self, FailureFigure, FailureLook, FailureVerdict};

/// Draw every scene that methods fail at by every method, and hold what is measured to the stated bounds.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel stability -o failures                              everything: a minute or two\n  surfel stability -o failures --quick                      the hardest scenes by every kind of splat\n  surfel stability -o gauss --method pop --splat gauss,filtered\n  surfel stability -o fence --scene fence,foliage --backend reference\n\nThe folder gets index.html (one page, needs no other file), stability.csv, a contact sheet for each group of scenes, and\nin pictures/ every picture. Each cell is a pass, a known limit with its cause, or a failure.\nExit codes: 0 no cell fails, 1 a cell is out of its bounds, 2 bad usage."
)]
pub(crate) struct StabilityArgs {
    /// Folder for table and pictures; made if it is not there
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Methods to draw by [default: all]
    #[arg(long, short, value_enum, value_delimiter = ',')]
    method: Vec<MethodName>,
    /// Kinds of splats to draw by, where a method has them [default: all]
    #[arg(long, value_enum, value_delimiter = ',')]
    splat: Vec<SplatName>,
    /// Scenes to draw (surfel scenes) [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,
    /// Only the hardest scenes, by triangles and by pop with each kind of splat
    #[arg(long, conflicts_with = "scene")]
    quick: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

/// One scene or two of each kind of failure.
const QUICK: [&str; 14] = [
    "silhouette",
    "horizon",
    "cube-edge",
    "thin-plate",
    "sheets-0.5",
    "sheets-2",
    "stack",
    "opposite-normals",
    "checkerboard",
    "fence",
    "needles",
    "degenerate",
    "beside-view",
    "inside",
];

impl StabilityArgs {
    fn looks(&self) -> Result<Vec<FailureLook>, CommandFailure> {
        let methods: Vec<Method> = self.method.iter().map(|m| (*m).into()).collect();
        let splats: Vec<SplatKind> = self.splat.iter().map(|s| (*s).into()).collect();
        let is_wanted = |look: &FailureLook| {
            let s = &look.settings;
            let has_method = methods.is_empty() || methods.contains(&s.method);
            let has_splat = !s.draws_splats() || splats.is_empty() || splats.contains(&s.splat);
            let is_quick =
                look.only.is_empty() && matches!(s.method, Method::Triangles | Method::Pop);
            has_method && has_splat && (!self.quick || is_quick)
        };
        let looks: Vec<FailureLook> = stability::looks().into_iter().filter(is_wanted).collect();
        if looks.is_empty() {
            return Err(usage(
                "no way of drawing is left: points are drawn as squares, and --quick knows triangles and pop",
            ));
        }
        Ok(looks)
    }

    fn entries(&self) -> Result<Vec<&'static SceneEntry>, CommandFailure> {
        if self.quick {
            let is_quick = |e: &&SceneEntry| QUICK.contains(&e.name);
            return Ok(scenes::ALL.iter().filter(is_quick).collect());
        }
        if let Some(name) = self.scene.iter().find(|n| scenes::find(n).is_none()) {
            return Err(usage(format!(
                "--scene {name}: there is no such scene; surfel scenes lists them"
            )));
        }
        let is_wanted =
            |e: &&SceneEntry| self.scene.is_empty() || self.scene.iter().any(|n| n == e.name);
        Ok(scenes::ALL.iter().filter(is_wanted).collect())
    }
}

fn make_folder(folder: &Path) -> Outcome {
    std::fs::create_dir_all(folder).map_err(|e| {
        CommandFailure::Run(
            anyhow::Error::new(e).context(format!("cannot make the folder {}", folder.display())),
        )
    })
}

/// A name without blanks and commas.
fn file_name(scene: &str, look: &str) -> String {
    format!("{scene}-{}.png", look.replace(", ", "-").replace(' ', "-"))
}

pub(crate) fn run(args: StabilityArgs, quiet: bool) -> Outcome {
    let (looks, entries) = (args.looks()?, args.entries()?);
    let backend = args.device.open()?;
    say(&format!(
        "drawing {} scenes in {} ways on {}",
        entries.len(),
        looks.len(),
        backend.name()
    ));
    // Only now, so that a mistake or a missing device leaves no folder behind.
    let pictures = args.output.join("pictures");
    make_folder(&pictures)?;
    let mut table = SceneTable {
        device: backend.name().to_owned(),
        ..SceneTable::default()
    };
    let bar = JobBar::new(quiet);
    stability::run(
        &backend,
        &entries,
        &looks,
        &bar,
        &mut |case, look, mut cell, picture| {
            let is_new = table
                .scenes
                .last()
                .is_none_or(|row| row.entry.name != cell.scene);
            if is_new {
                let truth = case.truth.as_ref().map(|t| t.to_image());
                if let Some(truth) = &truth {
                    truth.save_png(&pictures.join(file_name(cell.scene, "truth")))?;
                }
                table.scenes.push(SceneRow {
                    entry: case.entry,
                    threshold_px: case.threshold_px,
                    truth: truth.as_ref().map(thumb),
                    shots: Vec::new(),
                });
            }
            if let Some(flip) = case.flip(&picture)? {
                cell.figures.push((FailureFigure::Flip, flip));
            }
            picture.save_png(&pictures.join(file_name(cell.scene, look.name)))?;
            if let Some(row) = table.scenes.last_mut() {
                row.shots.push(CellShot {
                    cell,
                    thumb: thumb(&picture),
                });
            }
            Ok(())
        },
    )?;
    drop(bar);
    // A column for what was drawn at least once.
    let is_drawn = |name: &&str| {
        let mut shots = table.scenes.iter().flat_map(|row| &row.shots);
        shots.any(|shot| shot.cell.look == *name)
    };
    table.looks = looks
        .iter()
        .map(|look| look.name)
        .filter(is_drawn)
        .collect();
    for (group, sheet) in table.sheets() {
        sheet.save_png(&args.output.join(format!("failures-{group}.png")))?;
    }
    write_text(&args.output.join("stability.csv"), &table.csv())?;
    let page = args.output.join("index.html");
    write_text(&page, &table.html()?)?;
    print(&format!("{}all of it: {}\n", table.text(), page.display()))?;
    validated(&backend)?;
    match table.count(FailureVerdict::Fail) {
        0 => Ok(()),
        n => Err(CommandFailure::Run(anyhow::anyhow!(
            "{n} cells are out of their bounds; see {}",
            page.display()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quick_scenes_are_there_and_names_of_files_are_plain() {
        assert!(QUICK.iter().all(|name| scenes::find(name).is_some()));
        assert_eq!(
            file_name("inside", "filtered, culling off"),
            "inside-filtered-culling-off.png"
        );
    }
}
