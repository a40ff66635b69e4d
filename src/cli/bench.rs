//! `surfel bench`

use super::progress::JobBar;
use super::render::{DeviceArgs, validated};
use super::source::{KeepArgs, ModelArgs, SurfaceArgs, ViewFraming};
use super::{CommandFailure, Outcome, print, say, usage, write_text};
use std::path::{Path, PathBuf};
use surfel::OpenedModel;
use surfel::bench::cases::CaseStandard;
use surfel::bench::report::{RunFacts, csv, line, summary};
use surfel::bench::{
    BenchCase, BenchError, BenchFigure, BenchPlan, BenchSession, accuracy, cuts, frames, growth,
    memory, pages, pictures, rates, rivals,
};
use surfel::measure::store;
use surfel::progress::Progress;

const EXAMPLES: &str = "\
Examples:
  surfel bench --quick                         every figure from few views, less than two minutes
  surfel bench --csv bench.csv                 36 views, two picture sizes, less than ten minutes
  surfel bench --large --only growth           one view of up to 64 million triangles; needs 8 GB of memory
  surfel bench --case statue --only cut --only rates
  surfel bench scan.ply                        a model of your own beside the standard ones
  surfel bench --only pictures --case dragon *.ply      default pictures of the dragon, files, hard scenes and a thin blade
  surfel bench --only pictures --files-only *.ply        of the files alone
  surfel bench --only pages                    paged files beside whole trees

Parts: rates (primitives a second, the empty frame), cut, frames (beside plain triangles), accuracy (time against error,
beside rays and simplified meshes where built with the feature rivals), pictures (the default of `surfel render` beside
one exact sample a pixel), pages (paged files: size, build, opening, decoding, cut, pictures), growth. The standard models are generated; the
dragon is read from SURFEL_MODELS/thesis/dragon_vrip.ply.gz, or is a file of 871,414 triangles given here. What is missed
is no failure of the run: the exit code is 0. docs/PERFORMANCE.md says what each figure means.";

/// Measure every figure that the program has to reach, with pass or miss.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct BenchArgs {
    /// More model files
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Few views, one picture size
    #[arg(long)]
    quick: bool,
    /// Write every figure as a row; - for standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Only this standard model (sphere, torus, statue, dragon); may be given several times
    #[arg(long = "case", value_name = "NAME", value_parser = parse_case)]
    cases: Vec<CaseStandard>,
    /// No standard model, only the files
    #[arg(long, requires = "files", conflicts_with = "cases")]
    files_only: bool,
    /// Only this part of the run; may be given several times
    #[arg(long, value_name = "PART")]
    only: Vec<BenchPart>,
    /// Also models of up to 64 million triangles, for their growth
    #[arg(long)]
    large: bool,
    /// Triangles of the generated models instead, to see that it runs: targets hold for the full size only
    #[arg(long, value_name = "N", hide = true)]
    triangles: Option<u64>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// A part of the run. Pictures and pages are measured where they are asked for: they take minutes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum BenchPart {
    Rates,
    Cut,
    Frames,
    Accuracy,
    Pictures,
    Pages,
    Growth,
}

impl BenchPart {
    /// Parts that are measured of every model.
    const OF_MODELS: [Self; 5] = [
        Self::Cut,
        Self::Frames,
        Self::Accuracy,
        Self::Pictures,
        Self::Pages,
    ];
}

fn parse_case(text: &str) -> Result<CaseStandard, String> {
    CaseStandard::ALL
        .into_iter()
        .find(|s| s.name() == text)
        .ok_or_else(|| "there are sphere, torus, statue and dragon".to_owned())
}

impl BenchArgs {
    fn check(&self) -> Outcome {
        for (i, file) in self.files.iter().enumerate() {
            if self.files[..i].contains(file) {
                return Err(usage(format!("{} is named twice", file.display())));
            }
            if self.csv.as_ref() == Some(file) {
                return Err(usage(format!(
                    "{} would be written over by the figures",
                    file.display()
                )));
            }
        }
        if self
            .triangles
            .is_some_and(|n| !(100..=100_000_000).contains(&n))
        {
            return Err(usage("--triangles: expected 100 to 100000000"));
        }
        if self.large {
            let all = growth::TRIANGLES.iter().sum();
            memory::require(
                "the statue of 1 to 64 million triangles",
                all,
                surfel::free_memory::available(),
            )?;
        }
        self.csv.as_deref().map_or(Ok(()), super::require_folder)
    }

    fn wants(&self, part: BenchPart) -> bool {
        let is_usual = !matches!(part, BenchPart::Pictures | BenchPart::Pages);
        is_usual && self.only.is_empty() || self.only.contains(&part)
    }

    fn wants_case(&self, case: CaseStandard) -> bool {
        !self.files_only && (self.cases.is_empty() || self.cases.contains(&case))
    }

    /// The options, for the rows.
    fn words(&self) -> String {
        let mut words = vec![if self.quick { "quick" } else { "full" }.to_owned()];
        words.extend(self.large.then(|| "large".to_owned()));
        words.extend(self.triangles.map(|n| format!("triangles {n}")));
        if rivals::ARE_BUILT_IN {
            words.push("rivals".into());
        }
        words.join(" ")
    }
}

/// Where the dragon is, if anywhere: in the folder that SURFEL_MODELS names.
fn dragon() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("SURFEL_MODELS")?);
    let path = folder.join("thesis/dragon_vrip.ply.gz");
    path.is_file().then_some(path)
}

/// The figures so far, printed as they come.
struct PrintedFigures<'a> {
    all: Vec<BenchFigure>,
    prints: bool,
    /// The file of rows.
    csv: Option<&'a Path>,
    about: RunFacts,
}

impl PrintedFigures<'_> {
    /// Writes the rows so far. A device or a pipe gets them once: at the end.
    fn save(&self, is_end: bool) -> Outcome {
        let Some(path) = self.csv else { return Ok(()) };
        let is_file = path != Path::new("-") && (path.is_file() || !path.exists());
        if is_file || is_end {
            let rows = csv(&self.about, &self.all).map_err(|e| CommandFailure::Run(e.into()))?;
            write_text(path, &rows)?;
        }
        Ok(())
    }

    fn add(&mut self, title: &str, figures: Vec<BenchFigure>) -> Outcome {
        if self.prints && !figures.is_empty() {
            let mut text = format!("\n{title}\n");
            for figure in figures.iter().filter(|f| !f.is_detail) {
                text += &line(figure);
                text.push('\n');
            }
            print(&text)?;
        }
        self.all.extend(figures);
        // A run that is ended from outside keeps what was measured.
        self.save(false)
    }
}

pub(crate) fn run(args: BenchArgs, quiet: bool) -> Outcome {
    args.check()?;
    let backend = args.device.open()?;
    let Some(gpu) = backend.device() else {
        return Err(usage(
            "bench measures a Vulkan device: the processor and the reference have none of what it asks for",
        ));
    };
    let plan = if args.quick {
        BenchPlan::quick()
    } else {
        BenchPlan::full()
    };
    let bar = JobBar::new(quiet);
    bar.stage("calibrate", 0);
    let folder = store::folder();
    let session = BenchSession::open(gpu, folder.as_deref())?;
    let about = session.about(args.words());
    let of_device = rates::calibration(&session);
    let head = format!(
        "surfel {} on {}, {}, {} threads; {}",
        about.version, about.device, about.driver, about.threads, about.settings
    );
    let mut figures = PrintedFigures {
        all: Vec::new(),
        prints: args.csv.as_deref() != Some(Path::new("-")),
        csv: args.csv.as_deref(),
        about,
    };
    figures.add(&head, of_device)?;
    let measured = models(&args, &session, &plan, &mut figures, &bar);
    drop(bar);
    // What is measured is kept, whatever ended the run.
    figures.save(true)?;
    measured.map_err(|failure| with_hint(failure, &args))?;
    if figures.prints {
        print(&format!("\n{}", summary(&figures.all)))?;
    }
    validated(&backend)
}

/// Tells a user who cancelled what is left.
fn with_hint(failure: CommandFailure, args: &BenchArgs) -> CommandFailure {
    match failure {
        CommandFailure::Run(error) if is_cancelled(&error) => CommandFailure::Run(anyhow::anyhow!(
            "cancelled{}",
            args.csv.as_ref().map_or_else(String::new, |path| format!(
                "; {} has what was measured",
                path.display()
            ))
        )),
        other => other,
    }
}

fn is_cancelled(error: &anyhow::Error) -> bool {
    let error: Option<&surfel::Error> = error.downcast_ref();
    error.is_some_and(surfel::Error::is_cancelled)
}

/// A model of the run, once it is needed: name and file.
fn sources(args: &BenchArgs) -> Vec<(String, PathBuf)> {
    let mut sources = Vec::new();
    for standard in CaseStandard::ALL {
        if !args.wants_case(standard) {
            continue;
        }
        let name = standard.name().to_owned();
        if standard == CaseStandard::Dragon {
            match dragon() {
                Some(path) => sources.push((name, path)),
                None if args.files.is_empty() => say(
                    "surfel: the dragon is absent: SURFEL_MODELS names no folder with thesis/dragon_vrip.ply.gz, and no FILE is given",
                ),
                None => {}
            }
        } else {
            let triangles = args.triangles.unwrap_or(standard.triangles());
            sources.push((name.clone(), format!("generate:{name}:{triangles}").into()));
        }
    }
    sources.extend(args.files.iter().map(|file| {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        (name.into_owned(), file.clone())
    }));
    sources
}

fn load(path: &Path, bar: &JobBar) -> Result<OpenedModel, CommandFailure> {
    let source = ModelArgs {
        model: path.to_owned(),
        weld: false,
        frame: ViewFraming::Robust,
        surface: SurfaceArgs::default(),
        keep: KeepArgs::default(),
    };
    source.open_with(bar)
}

/// Opens a model that is compared with its triangles.
fn load_surface(path: &Path, bar: &JobBar) -> Result<OpenedModel, CommandFailure> {
    let ready = load(path, bar)?;
    match ready.model.kind().is_surface() {
        true => Ok(ready),
        false => Err(usage(format!(
            "{}: bench compares with triangles, and there are none in it",
            ready.name
        ))),
    }
}

fn models(
    args: &BenchArgs,
    session: &BenchSession,
    plan: &BenchPlan,
    figures: &mut PrintedFigures<'_>,
    bar: &JobBar,
) -> Outcome {
    let sources = sources(args);
    let wants_models =
        args.wants(BenchPart::Rates) || BenchPart::OF_MODELS.iter().any(|part| args.wants(*part));
    if sources.is_empty() && wants_models {
        return Err(usage("nothing is left to measure: no case is there"));
    }
    // Rates are asked of the largest model: its parts are all splats.
    let rated = sources
        .iter()
        .position(|(name, _)| name == CaseStandard::Statue.name())
        .unwrap_or(0);
    let sources = if wants_models { &sources[..] } else { &[] };
    for (i, (name, path)) in sources.iter().enumerate() {
        let is_rated = i == rated && args.wants(BenchPart::Rates);
        if !is_rated && !BenchPart::OF_MODELS.iter().any(|part| args.wants(*part)) {
            continue;
        }
        let ready = load_surface(path, bar)?;
        let is_dragon = ready.model.triangles.len() as u64 == CaseStandard::Dragon.triangles();
        let name = if is_dragon {
            CaseStandard::Dragon.name()
        } else {
            name
        };
        let case = BenchCase {
            name,
            model: &ready.model,
        };
        let count = super::count(ready.model.triangles.len() as u64);
        if is_rated {
            let title = format!("rates and the empty frame: {name}, {count} triangles");
            figures.add(&title, rates::figures(session, &case, plan, bar)?)?;
        }
        type Measure = fn(
            &BenchSession,
            &BenchCase<'_>,
            &BenchPlan,
            &dyn Progress,
        ) -> Result<Vec<BenchFigure>, BenchError>;
        let parts: [(BenchPart, &str, Measure); 5] = [
            (BenchPart::Cut, "cut", cuts::figures),
            (BenchPart::Frames, "frames", frames::figures),
            (BenchPart::Accuracy, "time against error", accuracy::figures),
            (BenchPart::Pictures, "default picture", pictures::figures),
            (BenchPart::Pages, "pages", pages::figures),
        ];
        for (part, what, measure) in parts {
            if args.wants(part) {
                let found = measure(session, &case, plan, bar)?;
                figures.add(&format!("{what}: {name}, {count} triangles"), found)?;
            }
        }
    }
    if args.wants(BenchPart::Pictures) && !args.files_only {
        scenes(session, figures, bar)?;
    }
    if args.wants(BenchPart::Growth) && args.wants_case(CaseStandard::Statue) {
        grow(args, session, plan, figures, bar)?;
    }
    Ok(())
}

/// Default pictures of the scenes of the stability table, and of a blade thinner than a pixel.
fn scenes(session: &BenchSession, figures: &mut PrintedFigures<'_>, bar: &JobBar) -> Outcome {
    let entries = surfel::scenes::ALL;
    bar.stage("pictures of scenes", entries.len() as u64);
    let mut found = Vec::new();
    for entry in entries {
        let opened = load(
            Path::new(&format!("scene:{}", entry.name)),
            &JobBar::new(true),
        )?;
        let Some(scene) = &opened.scene else {
            unreachable!("{} is a scene", entry.name)
        };
        let case = BenchCase {
            name: entry.name,
            model: &opened.model,
        };
        found.extend(pictures::figures_of_scene(session, &case, &scene.camera)?);
        bar.advance(1);
    }
    let (blade, camera) = pictures::blade(bar)?;
    let case = BenchCase {
        name: "blade",
        model: &blade,
    };
    found.extend(pictures::figures_of_scene(session, &case, &camera)?);
    figures.add(
        "default picture: scenes, and a blade of 0.6 x 129 units from its edge",
        found,
    )
}

/// One view of the statue with ever more triangles.
fn grow(
    args: &BenchArgs,
    session: &BenchSession,
    plan: &BenchPlan,
    figures: &mut PrintedFigures<'_>,
    bar: &JobBar,
) -> Outcome {
    let scale = |n: u64| {
        args.triangles
            .map_or(n, |small| small * n / 8_000_000)
            .max(12)
    };
    let counts = if args.large {
        &growth::TRIANGLES[..]
    } else {
        &growth::TRIANGLES[..2]
    };
    let mut models = Vec::new();
    for &count in counts {
        let path = format!("generate:statue:{}", scale(count));
        models.push(load_surface(Path::new(&path), bar)?.model);
    }
    let cases: Vec<BenchCase<'_>> = models
        .iter()
        .map(|model| BenchCase {
            name: "statue",
            model,
        })
        .collect();
    let mut found = growth::figures(session, &cases, plan.rounds, bar)?;
    if !args.large {
        found.push(growth::not_asked());
    }
    figures.add("growth: one view of the statue", found)
}
