//! `surfel soak`: random input for the window, for minutes; memory must not grow and validation must be silent.
//!
//! A run is a row of sessions. Each opens a device and the window (or its replay without one), plays a recording made from
//! the seed, and closes all of it. Memory is measured between sessions, where nothing is open.
//!
//! The C library of Linux keeps freed memory for later, more and more of it in programs of many threads. jemalloc gives it back
//! where it is loaded before (`make soak`), so that what is left is what the program holds (docs/TRUST.md).

use super::progress::is_interrupted;
use super::soak_input::{SeededNumbers, session};
use super::{CommandFailure, Outcome, bytes, print, usage};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use surfel::gpu::{self, DeviceOptions};
use surfel::progress::SilentProgress;
use surfel::render::Settings;
use surfel::render::window_renderer::WindowBackend;
use surfel::viewer::control::FrameGoal;
use surfel::viewer::record::EventRecorder;
use surfel::viewer::{self, InjectedFaults, RestSmoothing, RunFigures, ViewerOptions};

const EXAMPLES: &str = "\
Examples:
  surfel soak --minutes 10
  surfel soak --minutes 60 --seed 7 castle.ply castle/scene.mvs
  surfel soak --seed 7 --session 12 --minutes 1      that session again
  xvfb-run -a surfel soak --window --minutes 10      in a real window";

/// Give the window random input for some minutes: loads, files good and bad, turns, sizes, methods, splats, backends,
/// devices that are lost, photographs, recordings. Fails on any message of validation, and when memory grows.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct SoakArgs {
    /// Files that are dropped besides small ones that are made: models, scenes of photographs, cameras
    #[arg(value_name = "MODEL")]
    models: Vec<PathBuf>,
    /// How long
    #[arg(long, value_name = "MINUTES", default_value_t = 10.0)]
    minutes: f64,
    /// What the input is made from
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Play this session alone, again and again
    #[arg(long, value_name = "NUMBER")]
    session: Option<u64>,
    /// Keep the recordings of the sessions in this folder (surfel --replay plays them)
    #[arg(long, value_name = "FOLDER")]
    recordings: Option<PathBuf>,
    /// Things that are done in a session
    #[arg(long, value_name = "COUNT", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    acts: u64,
    /// Most that memory may grow after the first minute, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    most_growth: f64,
    /// Open a real window for each session
    #[arg(long)]
    window: bool,
    /// Without the validation layer, to measure the program's own memory
    #[arg(long)]
    no_validation: bool,
}

/// Figures of a minute.
#[derive(Debug, Clone, Copy, Default)]
struct MinuteFigures {
    sessions: u64,
    frames: u64,
    longest_ms: f64,
    /// Least memory held between its sessions; nothing where none ended in it.
    held: HeldMemory,
}

impl MinuteFigures {
    fn add(&mut self, figures: &RunFigures, held: HeldMemory) {
        self.sessions += 1;
        self.frames += figures.frames;
        self.longest_ms = self.longest_ms.max(figures.longest_ms);
        if self.held.data == 0 || held.data < self.held.data {
            self.held = held;
        }
    }
}

/// Memory of this process that is in RAM and in no file, bytes. Pages of programs and libraries come in as code is first run, and
/// the system takes them back; they are not counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct HeldMemory {
    /// Data.
    data: u64,
    /// Machine code that a driver made of shaders.
    code: u64,
}

impl HeldMemory {
    /// Memory held now; nothing where the system does not tell.
    fn now() -> Self {
        Self::of(&std::fs::read_to_string("/proc/self/smaps").unwrap_or_default())
    }

    /// Memory that the text of `/proc/self/smaps` tells.
    fn of(smaps: &str) -> Self {
        let mut held = Self::default();
        let (mut is_code, mut is_shared) = (false, false);
        for line in smaps.lines() {
            let mut words = line.split_ascii_whitespace();
            let (Some(first), Some(second)) = (words.next(), words.next()) else {
                continue;
            };
            if !first.ends_with(':') {
                // A mapping begins: its range, its rights, and at the end its file.
                is_code = second.contains('x') && !line.contains('/');
                is_shared = second.ends_with('s') && line.contains("/memfd:");
            } else if first == (if is_shared { "Rss:" } else { "Anonymous:" }) {
                let bytes = 1024 * second.parse().unwrap_or(0);
                *(if is_code {
                    &mut held.code
                } else {
                    &mut held.data
                }) += bytes;
            }
        }
        held
    }
}

/// Writes the small files that sessions drop into `folder`: good ones and bad ones. Names of generators are among them.
fn make_files(folder: &Path) -> Result<Vec<PathBuf>, CommandFailure> {
    let failed =
        |e: std::io::Error| CommandFailure::Run(anyhow::Error::new(e).context("files of a soak"));
    let mut files: Vec<PathBuf> = [
        "generate:statue:30000",
        "generate:torus:4000",
        "scene:fence",
    ]
    .map(PathBuf::from)
    .to_vec();
    for (name, shape) in [("ball.ply", "sphere:5000"), ("flat.ply", "square:2000")] {
        let spec = shape.parse().map_err(surfel::Error::from)?;
        let path = folder.join(name);
        surfel::generate::write_ply_file(&spec, &path, &SilentProgress)?;
        files.push(path);
    }
    let ball = std::fs::read(folder.join("ball.ply")).map_err(failed)?;
    let points: String = (0..3000)
        .map(|i: u32| format!("{} {} {}\n", i % 50, i / 50, (i * i) % 17))
        .collect();
    let camera =
        surfel::math::camera::Camera::orbit((320, 240), glam::DVec3::ZERO, 1.0, 1.0, 0.3, 0.9);
    let camera = serde_json::to_string(&camera).map_err(|e| CommandFailure::Run(e.into()))?;
    let made: [(&str, &[u8]); 7] = [
        ("cut-short.ply", &ball[..ball.len() / 2]),
        ("empty.obj", b""),
        ("noise.bin", &[0x93, 0x11, 0, 0xff, 7, 9]),
        ("one-triangle.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("cloud.xyz", points.as_bytes()),
        ("camera.json", camera.as_bytes()),
        ("no-camera.json", b"{\"width\": 3}"),
    ];
    for (name, content) in made {
        let path = folder.join(name);
        std::fs::write(&path, content).map_err(failed)?;
        files.push(path);
    }
    files.push(folder.join("missing.ply"));
    Ok(files)
}

/// Plays one session.
fn play(
    args: &SoakArgs,
    number: u64,
    files: &[PathBuf],
    devices: &[String],
    recording: &Path,
) -> Result<RunFigures, CommandFailure> {
    let mut numbers = SeededNumbers::of(args.seed, number);
    let first = numbers.one(&files[..3]);
    let backends = [
        WindowBackend::Auto,
        WindowBackend::Vulkan,
        WindowBackend::Cpu,
    ];
    let backend = numbers.one(&backends);
    let device = numbers.one(devices);
    let every = |numbers: &mut SeededNumbers| match numbers.once_in(4) {
        true => 10 + numbers.below(30),
        false => 0,
    };
    let faults = InjectedFaults {
        surface: every(&mut numbers),
        device: every(&mut numbers),
        memory: every(&mut numbers),
    };
    let frame_goal = match numbers.once_in(3) {
        true => FrameGoal::Usual,
        false => FrameGoal::Free,
    };
    let entries = session(&mut numbers, first.clone(), files, args.acts);
    let mut recorder = EventRecorder::create(recording).map_err(viewer::ViewerError::from)?;
    recorder.add(&entries).map_err(viewer::ViewerError::from)?;
    recorder.finish().map_err(viewer::ViewerError::from)?;
    let options = ViewerOptions {
        model: first,
        orbit: (0.5, 0.35, 1.0),
        size: (320, 240),
        settings: Settings::default(),
        backend,
        section: None,
        frame_goal,
        smoothing: RestSmoothing::WhileQuick,
        splat_by_model: true,
        watches: false,
        gpu: DeviceOptions {
            device: Some(device),
            validation: !args.no_validation,
            ..DeviceOptions::default()
        },
        replay: Some(recording.to_owned()),
        headless: !args.window,
        faults,
        ..ViewerOptions::default()
    };
    match viewer::run(options, &is_interrupted) {
        // What a frame needs is refused by a backend, or a device is lost too often: told, not a fault.
        Err(viewer::ViewerError::DeviceGone(_)) if faults.device > 0 => Ok(RunFigures::default()),
        outcome => Ok(outcome?),
    }
}

/// Growth of memory in percent: the least of the last third of the minutes over the least of the first third, the first minute
/// left out. `None` below three further minutes. A least is no average: what a session leaves behind for a while does not count,
/// and what every session leaves behind does.
fn growth(minutes: &[MinuteFigures]) -> Option<f64> {
    let later: Vec<u64> = (minutes.iter().skip(1).map(|m| m.held.data))
        .filter(|&held| held > 0)
        .collect();
    let third = later.len() / 3;
    let before = *later[..third].iter().min()?;
    let after = *later[later.len() - third..].iter().min()?;
    Some((after as f64 / before as f64 - 1.0) * 100.0)
}

/// A line of the table.
fn row(minute: usize, figures: &MinuteFigures) -> String {
    format!(
        "{minute:>6}  {:>8}  {:>7}  {:>10.0}  {:>10}  {:>10}\n",
        figures.sessions,
        figures.frames,
        figures.longest_ms,
        bytes(figures.held.data),
        bytes(figures.held.code)
    )
}

pub(crate) fn run(args: &SoakArgs, quiet: bool) -> Outcome {
    if !(args.minutes > 0.0 && args.minutes <= 100_000.0) {
        return Err(usage("--minutes: a number above 0"));
    }
    let folder = tempfile::tempdir().map_err(|e| CommandFailure::Run(e.into()))?;
    let mut files = make_files(folder.path())?;
    for model in &args.models {
        let path = model.canonicalize().map_err(|e| {
            CommandFailure::Input(anyhow::Error::new(e).context(model.display().to_string()))
        })?;
        files.push(path);
    }
    let found = gpu::device::list()?.into_iter();
    let usable = found.filter(|device| device.unusable.is_none());
    let devices: Vec<String> = usable.map(|device| device.index.to_string()).collect();
    if devices.is_empty() {
        return Err(gpu::Error::NoDevice("nothing shows the frames of a window".into()).into());
    }
    let recordings = match &args.recordings {
        Some(kept) => kept.canonicalize().map_err(|e| {
            CommandFailure::Input(anyhow::Error::new(e).context(kept.display().to_string()))
        })?,
        None => folder.path().to_owned(),
    };
    // Keys write pictures into the folder that the program is in.
    let pictures = folder.path().join("pictures");
    let start = Instant::now();
    let mut minutes: Vec<MinuteFigures> = Vec::new();
    let mut now = MinuteFigures::default();
    print("minute  sessions   frames  longest ms        held        code\n")?;
    for count in 0.. {
        let number = args.session.unwrap_or(count);
        let made = std::fs::create_dir_all(&pictures);
        made.and_then(|()| std::env::set_current_dir(&pictures))
            .map_err(|e| CommandFailure::Run(e.into()))?;
        let recording = match &args.recordings {
            Some(_) => recordings.join(format!("session-{number:05}.jsonl")),
            None => recordings.join("session.jsonl"),
        };
        let figures = play(args, number, &files, &devices, &recording).map_err(|failure| {
            let seed = args.seed;
            let told =
                format!("session {number} of seed {seed} (--seed {seed} --session {number})");
            match failure {
                CommandFailure::Input(error) | CommandFailure::Run(error) => {
                    CommandFailure::Run(error.context(told))
                }
            }
        })?;
        std::env::set_current_dir(folder.path())
            .and_then(|()| std::fs::remove_dir_all(&pictures))
            .map_err(|e| CommandFailure::Run(e.into()))?;
        if !quiet {
            let held = bytes(HeldMemory::now().data);
            tracing::info!(number, figures.frames, figures.longest_ms, held, "session");
        }
        now.add(&figures, HeldMemory::now());
        let elapsed = start.elapsed();
        let is_over = is_interrupted() || elapsed >= Duration::from_secs_f64(args.minutes * 60.0);
        if is_over || elapsed.as_secs() / 60 > minutes.len() as u64 {
            print(&row(minutes.len() + 1, &now))?;
            minutes.push(std::mem::take(&mut now));
        }
        if is_over {
            break;
        }
    }
    match growth(&minutes) {
        None => print("too short, or this system tells no memory: growth not judged\n"),
        Some(percent) if percent > args.most_growth => Err(CommandFailure::Run(anyhow::anyhow!(
            "memory grew by {percent:.2} percent after the first minute, more than {}",
            args.most_growth
        ))),
        Some(percent) => print(&format!(
            "memory grew by {percent:.2} percent after the first minute\n"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_files_are_not_held_and_code_is_counted_apart() {
        let smaps = "\
55d0-55d1 r-xp 00001000 fe:00 12 /usr/bin/surfel
Rss:                 900 kB
Anonymous:             4 kB
7f00-7f10 rw-p 00000000 00:00 0 
Rss:                 128 kB
Anonymous:           128 kB
7f20-7f30 rwxp 00000000 00:00 0 
Rss:                  64 kB
Anonymous:            60 kB
7f40-7f50 rw-s 00000000 00:01 77 /memfd:allocation (deleted)
Rss:                  32 kB
Anonymous:             0 kB
";
        let held = HeldMemory {
            data: (4 + 128 + 32) << 10,
            code: 60 << 10,
        };
        assert_eq!(HeldMemory::of(smaps), held);
        assert_eq!(HeldMemory::of(""), HeldMemory::default());
    }

    #[test]
    fn growth_is_that_of_what_every_session_leaves_behind() {
        let of = |megabytes: &[u64]| {
            let minute = |&held: &u64| MinuteFigures {
                held: HeldMemory {
                    data: held << 20,
                    code: 0,
                },
                ..MinuteFigures::default()
            };
            growth(&megabytes.iter().map(minute).collect::<Vec<_>>())
        };
        assert_eq!(of(&[50, 100, 100]), None);
        assert_eq!(of(&[50, 100, 130, 100]), Some(0.0));
        // Single minutes may hold more.
        assert_eq!(of(&[50, 100, 180, 100, 170, 190, 100]), Some(0.0));
        let leaking = of(&[50, 100, 101, 102, 103, 104, 105]);
        assert!(
            leaking.is_some_and(|percent| (percent - 4.0).abs() < 1e-9),
            "{leaking:?}"
        );
    }
}
