//! The command line: one file per subcommand. A subcommand turns its arguments into a checked plan and runs
//! it with the library. Data goes to standard output, talk to standard error.

mod auto;
mod background;
mod bench;
mod build;
mod cameras;
mod chart;
mod check;
mod color_choice;
mod compare;
mod costs;
mod cross_section;
mod darkening;
mod demo;
mod devices;
mod error_patches;
mod export;
mod generate;
mod info;
mod join;
mod light;
mod look;
mod man;
mod mark_args;
mod motion;
mod patches;
mod photo_args;
mod photos;
mod placement_args;
mod profile;
mod progress;
mod renamed;
mod render;
mod rendered_picture;
mod reproduce;
mod scenes;
#[cfg(feature = "remote")]
mod serve;
#[cfg(feature = "viewer")]
mod soak;
#[cfg(feature = "viewer")]
mod soak_input;
mod source;
mod stability;
mod stats;
mod vertex_splats;
#[cfg(feature = "viewer")]
mod view;

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use tracing_subscriber::fmt::format::FmtSpan;

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum CommandFailure {
    /// Bad usage or bad input: exit code 2.
    Input(anyhow::Error),
    /// The run failed: exit code 1.
    Run(anyhow::Error),
}

pub(crate) type Outcome = Result<(), CommandFailure>;

/// Tells whether a device's error is of what was asked for.
fn is_of_input(error: &surfel::gpu::Error) -> bool {
    use surfel::gpu::Error as G;
    matches!(
        error,
        G::UnknownDevice { .. } | G::Limit { .. } | G::Unsupported { .. }
    )
}

impl From<surfel::Error> for CommandFailure {
    fn from(error: surfel::Error) -> Self {
        use surfel::Error as E;
        use surfel::generate::GenerateError as G;
        use surfel::photos::error::PhotoError as P;
        let is_input = match &error {
            error if error.is_cancelled() => false,
            // A bad specification is bad input; a file that cannot be written is not.
            E::Generate(G::Write { .. } | G::Stream(_)) => false,
            E::Input(_) | E::Tree(_) | E::Camera(_) | E::Generate(_) | E::Scene(_) => true,
            E::Image(surfel::image::Error::Read { .. }) => true,
            E::Photos(P::Gpu(g)) => is_of_input(g),
            E::Photos(P::Picture(_) | P::Cancelled) => false,
            E::Photos(_) => true,
            E::Bench(
                surfel::bench::BenchError::Memory { .. } | surfel::bench::BenchError::Camera(_),
            ) => true,
            E::Chart(
                surfel::chart::ChartError::Rows { .. } | surfel::chart::ChartError::Camera(_),
            ) => true,
            E::Gpu(g)
            | E::Profile(surfel::measure::profile::ProfileError::Gpu(g))
            | E::Chart(surfel::chart::ChartError::Gpu(g))
            | E::Bench(surfel::bench::BenchError::Gpu(g)) => is_of_input(g),
            _ => false,
        };
        if is_input {
            Self::Input(error.into())
        } else {
            Self::Run(error.into())
        }
    }
}

macro_rules! failure_from {
    ($($type:ty),+) => {$(
        impl From<$type> for CommandFailure {
            fn from(error: $type) -> Self {
                surfel::Error::from(error).into()
            }
        }
    )+};
}

failure_from!(
    surfel::input::Error,
    surfel::tree::Error,
    surfel::math::camera::CameraError,
    surfel::image::Error,
    surfel::gpu::Error,
    surfel::generate::GenerateError,
    surfel::measure::profile::ProfileError,
    surfel::stability::FailuresError,
    surfel::chart::ChartError,
    surfel::bench::BenchError
);

/// A usage error with the given text.
pub(crate) fn usage(text: impl Into<String>) -> CommandFailure {
    CommandFailure::Input(anyhow::Error::msg(text.into()))
}

const EXAMPLES: &str = "\
Examples:
  surfel dragon.ply.gz                               look at a model (where the viewer is built in)
  surfel render horse.ply -o horse.png               one picture, points and triangles by size on screen
  surfel render horse.ply -o horse.png --method triangles --samples 16
  surfel render scan.ply.gz -o scan.png --size 1024x768 --orbit 30,20,0.5 --stats scan.json
  surfel render scan.ply -o scan.png --method auto --max-error 0.01
  surfel render generate:statue:8000000 --frames 36 --threshold 3 --stats -
  surfel build scan.ply -o scan.surfel               build the tree once, open it at once later
  surfel check scan.ply                              file and tree, every invariant
  surfel compare reference.png picture.png           how far one picture is from another
  surfel scenes                                      small scenes that methods fail at
  surfel profile scan.ply --frames 120               what each pass and stage of a frame costs
  surfel motion scan.ply --threshold 3               how much flickers and pops when the camera moves
  surfel photos castle                               photographs on their scene's points, in a window
  surfel photos score castle --mesh castle/mesh.ply  photographs on a mesh, each predicted from the others
  surfel stability -o failures                       where the methods fail, measured: a table with pictures
  surfel chart scan.ply -o chart --quick             time against error of every method, as a chart and a page
  surfel bench --quick                               every figure that has to be reached, with pass or miss
  surfel devices                                     what can draw here

A model is a file (OBJ, PLY, STL, OFF, TRI, glTF, GLB, LAS, LAZ, COPC, E57, PCD, XYZ, PTS, PTX or CSV,
each also .gz, or .surfel), - for standard input,
generate:SHAPE[:TRIANGLES] with SHAPE square, sphere, torus or statue, or scene:NAME (surfel scenes).
Exit codes: 0 done, 1 the run failed, 2 bad usage or input.";

/// What follows the options in `surfel --help`.
fn help() -> String {
    #[cfg(feature = "viewer")]
    return format!("{}\n\n{EXAMPLES}", view::help());
    #[cfg(not(feature = "viewer"))]
    return EXAMPLES.to_owned();
}

/// What `surfel --version` says; `-V` says the number alone.
fn version() -> String {
    let number = env!("CARGO_PKG_VERSION");
    match surfel::measure::COMMIT {
        "" => number.to_owned(),
        commit => format!("{number} ({commit})"),
    }
}

/// Draws enormous meshes and scans with points, triangles or both.
#[derive(Debug, Parser)]
#[command(name = "surfel", version, long_version = version(), after_help = help(), subcommand_negates_reqs = true)]
#[command(arg_required_else_help = cfg!(not(feature = "viewer")))]
struct CommandLine {
    /// What to log on standard error, such as `info` or `surfel=debug`.
    #[arg(
        long,
        global = true,
        value_name = "FILTER",
        env = "SURFEL_LOG",
        hide_env = true
    )]
    log: Option<String>,
    /// No progress bars.
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Option<ProgramCommand>,
    #[cfg(feature = "viewer")]
    #[command(flatten)]
    view: view::ViewArgs,
}

#[derive(Debug, Subcommand)]
enum ProgramCommand {
    /// Draw a model into a picture file
    Render(Box<render::RenderArgs>),
    /// Build the tree of a model and write it to a file that opens at once
    Build(build::BuildArgs),
    /// Write what is kept of a point cloud, with all that its points carry
    Export(export::ExportArgs),
    /// Cut models upright along a line: a picture and a table of what is there
    CrossSection(Box<cross_section::CrossSectionArgs>),
    /// Say what is in a model file or a scene of photographs
    Info(info::InfoArgs),
    /// Check a model file and every invariant of its tree
    Check(check::CheckArgs),
    /// Write a generated model as PLY
    Generate(generate::GenerateArgs),
    /// Compare two pictures: FLIP, PSNR, SSIM, coverage, the worst place
    Compare(Box<compare::CompareArgs>),
    /// List the built-in scenes that methods fail at
    Scenes(scenes::ScenesArgs),
    /// Join paged trees into one model that refers to their files
    Join(join::JoinArgs),
    /// Serve the paged trees of a folder over http
    #[cfg(feature = "remote")]
    Serve(serve::ServeArgs),
    /// Measure what each pass and each stage of a frame costs
    Profile(Box<profile::ProfileArgs>),
    /// Measure how steady pictures are in motion: flicker, popping, churn of the cut
    Motion(Box<motion::MotionArgs>),
    /// Measure nodes drawn as one polygon where their error is small
    Patches(Box<patches::PatchesArgs>),
    /// Photographs on a mesh or their points: look, draw, predict each from the others
    Photos(Box<photos::PhotosArgs>),
    /// Draw the scenes that methods fail at, measure, and hold everything to its bounds
    Stability(stability::StabilityArgs),
    /// Measure time and error of every method, splat and threshold, as a chart and a page
    Chart(Box<chart::ChartArgs>),
    /// Measure every figure that the program has to reach, with pass or miss
    Bench(bench::BenchArgs),
    /// Print published tables beside what is measured here
    Reproduce(reproduce::ReproduceArgs),
    /// List the devices of this machine and the limits that matter
    Devices(devices::DevicesArgs),
    /// Draw the built-in statue with every method
    Demo(demo::DemoArgs),
    /// Print a completion script for a shell
    #[command(
        after_help = "Example:\n  surfel completions bash > ~/.local/share/bash-completion/completions/surfel"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print a manual page, or write all of them into a folder
    Man(man::ManArgs),
    /// Give the window random input for some minutes, and watch memory and messages
    #[cfg(feature = "viewer")]
    #[command(hide = true)]
    Soak(soak::SoakArgs),
}

/// The argument of a window that stands before a command, in words.
fn stray_argument(command: &clap::Command, matches: &clap::ArgMatches) -> Option<String> {
    let (name, own) = matches.subcommand()?;
    let is_given = |arg: &&clap::Arg| {
        matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine)
    };
    let mut arguments = command.get_arguments().filter(|arg| !arg.is_global_set());
    match arguments.find(is_given) {
        Some(arg) => Some(format!("'{arg}' does not go with the command '{name}'")),
        None => stray_argument(command.find_subcommand(name)?, own),
    }
}

/// Parses the arguments. Those of the window do not go with a command; those of every command may stand before it
/// (`args_conflicts_with_subcommands` would refuse these as well).
fn parse() -> Result<CommandLine, clap::Error> {
    let mut command = CommandLine::command();
    let matches =
        command.try_get_matches_from_mut(renamed::in_words(std::env::args_os().collect()))?;
    if let Some(text) = stray_argument(&command, &matches) {
        return Err(command.error(ErrorKind::ArgumentConflict, text));
    }
    let cli = CommandLine::from_arg_matches(&matches).map_err(|error| error.format(&mut command));
    #[cfg(feature = "viewer")]
    let cli = cli.map(|mut cli| {
        cli.view.note_given(&matches);
        if let (Some(ProgramCommand::Photos(photos)), Some((_, own))) =
            (&mut cli.command, matches.subcommand())
        {
            photos.view.note_given(own);
        }
        cli
    });
    cli
}

/// Parses the arguments, runs the command and turns its end into an exit code.
pub(crate) fn main() -> ExitCode {
    let cli = match parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no errors; clap uses code 2 for the others.
            let code = error.exit_code();
            // Nothing is left to report to when the terminal is gone.
            let _ = error.print();
            return ExitCode::from(u8::try_from(code).unwrap_or(2));
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_new(cli.log.as_deref().unwrap_or("error"));
    match filter {
        Ok(filter) => tracing_subscriber::fmt()
            .with_env_filter(filter)
            // A span is told at its end, with the time it took: stages and passes read as a list.
            .with_span_events(FmtSpan::CLOSE)
            .with_writer(std::io::stderr)
            .with_ansi(is_colorful())
            // It would report a closed standard error on standard error, and panic.
            .log_internal_errors(false)
            .init(),
        Err(error) => {
            say(&format!("surfel: --log: {error}"));
            return ExitCode::from(2);
        }
    }
    progress::catch_interrupt();
    let quiet = cli.quiet;
    let outcome = match cli.command {
        Some(ProgramCommand::Render(args)) => render::run(*args, quiet),
        Some(ProgramCommand::Build(args)) => build::run(args, quiet),
        Some(ProgramCommand::Export(args)) => export::run(args, quiet),
        Some(ProgramCommand::CrossSection(args)) => cross_section::run(*args, quiet),
        Some(ProgramCommand::Info(args)) => info::run(args, quiet),
        Some(ProgramCommand::Check(args)) => check::run(args, quiet),
        Some(ProgramCommand::Generate(args)) => generate::run(args, quiet),
        Some(ProgramCommand::Compare(args)) => compare::run(*args),
        Some(ProgramCommand::Scenes(args)) => scenes::run(args),
        Some(ProgramCommand::Join(args)) => join::run(&args, quiet),
        #[cfg(feature = "remote")]
        Some(ProgramCommand::Serve(args)) => serve::run(&args),
        Some(ProgramCommand::Profile(args)) => profile::run(*args, quiet),
        Some(ProgramCommand::Motion(args)) => motion::run(*args, quiet),
        Some(ProgramCommand::Patches(args)) => patches::run(*args, quiet),
        Some(ProgramCommand::Photos(args)) => photos::run(*args, quiet),
        Some(ProgramCommand::Stability(args)) => stability::run(args, quiet),
        Some(ProgramCommand::Chart(args)) => chart::run(*args, quiet),
        Some(ProgramCommand::Bench(args)) => bench::run(args, quiet),
        Some(ProgramCommand::Reproduce(args)) => reproduce::run(args, quiet),
        Some(ProgramCommand::Devices(args)) => devices::run(args),
        Some(ProgramCommand::Demo(args)) => demo::run(args, quiet),
        Some(ProgramCommand::Completions { shell }) => {
            // Not straight to standard output: the generator panics when its reader goes away.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut CommandLine::command(), "surfel", &mut script);
            print(&String::from_utf8_lossy(&script))
        }
        Some(ProgramCommand::Man(args)) => man::run(&args, CommandLine::command()),
        #[cfg(feature = "viewer")]
        Some(ProgramCommand::Soak(args)) => soak::run(&args, quiet),
        #[cfg(feature = "viewer")]
        None => view::run(cli.view, quiet),
        #[cfg(not(feature = "viewer"))]
        None => Err(usage("no command; see surfel --help")),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(CommandFailure::Input(error)) => {
            say(&format!("surfel: {}", with_driver_hint(chain(&error))));
            ExitCode::from(2)
        }
        Err(CommandFailure::Run(error)) => {
            say(&format!("surfel: {}", with_driver_hint(chain(&error))));
            ExitCode::from(1)
        }
    }
}

/// The text of an error, and where it says that Vulkan is missing, the variable that keeps drivers out of sight.
pub(crate) fn with_driver_hint(text: String) -> String {
    let is_missing = ["Vulkan driver", "Vulkan device", "Vulkan loader"];
    if !is_missing.iter().any(|what| text.contains(what)) {
        return text;
    }
    let variables = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];
    let set = variables.into_iter().find_map(|name| {
        let value = std::env::var_os(name).filter(|value| !value.is_empty())?;
        Some(format!(
            "{text} (the variable {name} allows only {}: unset it, or name a driver that is there)",
            value.display()
        ))
    });
    set.unwrap_or(text)
}

/// An error and its causes in one line, each said once: many errors of the library quote their cause already.
pub(crate) fn chain(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if !text.contains(&cause) {
            if !text.is_empty() {
                text.push_str(": ");
            }
            text.push_str(&cause);
        }
    }
    text
}

/// Tells whether colors make sense on standard error: on a terminal, unless the user wants none (no-color.org).
fn is_colorful() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// A line of talk on standard error. Unlike `eprintln!` it does not panic when nobody listens any more.
pub(crate) fn say(line: &str) {
    use std::io::Write;
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}

/// Fails at once, before minutes of work, when an output of a command would be written over by another of its outputs or over
/// its model, or into a folder that is not there.
pub(crate) fn check_outputs(paths: &[&std::path::PathBuf], model: &Path) -> Outcome {
    for (i, path) in paths.iter().enumerate() {
        if path.as_path() == Path::new("-") && paths[..i].contains(path) {
            return Err(usage(
                "- (standard output) takes one file, and another output of this run goes there as well",
            ));
        }
        let is_model = path.as_path() == model && path.as_path() != Path::new("-");
        if paths[..i].contains(path) || is_model {
            return Err(usage(format!(
                "{} would be written over by another output of this run, or is its model",
                path.display()
            )));
        }
        require_folder(path)?;
    }
    Ok(())
}

/// Fails at once, before minutes of work, when the folder that `path` is to be written to is not there.
pub(crate) fn require_folder(path: &Path) -> Outcome {
    let folder = folder_of(path);
    let reason = if path == Path::new("-") || folder.is_dir() {
        return Ok(());
    } else if folder.exists() {
        "is not a folder"
    } else {
        "does not exist"
    };
    Err(CommandFailure::Run(anyhow::anyhow!(
        "cannot write {}: {} {reason}",
        path.display(),
        folder.display()
    )))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Writes data to standard output; a reader that went away is no failure.
pub(crate) fn print(text: &str) -> Outcome {
    print_bytes(text.as_bytes())
}

/// Writes data that is no text, as [`print`] does.
pub(crate) fn print_bytes(bytes: &[u8]) -> Outcome {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(CommandFailure::Run(
            anyhow::Error::new(e).context("cannot write to standard output"),
        )),
        _ => Ok(()),
    }
}

/// Writes `text` beside `path` and renames it into place; `-` is standard output. A link is followed, and what is
/// no plain file (a pipe, `/dev/null`) is written directly.
pub(crate) fn write_text(path: &Path, text: &str) -> Outcome {
    if path == Path::new("-") {
        return print(text);
    }
    require_folder(path)?;
    let write = || -> std::io::Result<()> {
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if target.exists() && !target.is_file() {
            let mut file = std::fs::OpenOptions::new().write(true).open(&target)?;
            return std::io::Write::write_all(&mut file, text.as_bytes());
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".surfel-");
        // Private by default; this one becomes an ordinary file under the user's mask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder_of(&target))?;
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.persist(&target).map_err(|e| e.error)?;
        Ok(())
    };
    write().map_err(|e| {
        CommandFailure::Run(
            anyhow::Error::new(e).context(format!("cannot write {}", path.display())),
        )
    })
}

/// Bytes for people: 12.3 MB.
pub(crate) fn bytes(count: u64) -> String {
    indicatif::HumanBytes(count).to_string()
}

/// A count with thousands separated.
pub(crate) fn count(value: u64) -> String {
    indicatif::HumanCount(value).to_string()
}
