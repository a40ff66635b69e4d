//! Runs targets on good and damaged inputs, and holds each run to what is promised: no panic, no hang, bounded memory.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};
use std::time::{Duration, Instant};

use super::mutate::{FileMutator, Random};
use super::repair::repair;
use super::targets::{FuzzTarget, InputOutcome};

/// Memory that any input may take beyond four times its size, bytes.
const FREE_MEMORY: usize = 64 << 20;

/// Memory at which a run is given up before the machine is, bytes.
const MOST_MEMORY: usize = 6 << 30;

/// Largest damaged input, bytes.
const MOST_BYTES: usize = 128 << 10;

/// Most inputs kept of a target beyond its corpus.
const MOST_KEPT: usize = 400;

/// An input that broke a promise.
#[derive(Debug)]
pub(crate) struct FuzzFinding {
    pub(crate) target: &'static str,
    pub(crate) cause: String,
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
}

/// What the last panic said, and the input that is being read.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());
static RUNNING: Mutex<Option<RunningInput>> = Mutex::new(None);
static ONCE: Once = Once::new();

struct RunningInput {
    start: Instant,
    target: &'static str,
    name: String,
    bytes: Vec<u8>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps panics of inputs quiet and ends the process, with the input kept, when one hangs or fills the memory.
pub(crate) fn set_up() {
    ONCE.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if lock(&RUNNING).is_none() {
                return usual(info);
            }
            let payload = info.payload();
            let what = (payload.downcast_ref::<&str>().copied())
                .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
                .unwrap_or("no words");
            let place = info.location().map(ToString::to_string);
            *lock(&LAST_PANIC) = format!("panic at {}: {what}", place.unwrap_or_default());
        }));
        let patience = Duration::from_secs(60);
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_millis(50));
                let running = lock(&RUNNING);
                let Some(input) = &*running else { continue };
                let memory = super::MEMORY.current_usage();
                let cause = match input.start.elapsed() {
                    time if time > patience => format!("hangs: {time:?}"),
                    _ if memory > MOST_MEMORY => format!("takes {memory} bytes"),
                    _ => continue,
                };
                let path = keep(&FuzzFinding {
                    target: input.target,
                    cause,
                    name: input.name.clone(),
                    bytes: input.bytes.clone(),
                });
                eprintln!("{}: {}: stopped", input.target, path.display());
                std::process::exit(101);
            }
        });
    });
}

/// Writes a finding where it can be found, with its cause beside it.
pub(crate) fn keep(finding: &FuzzFinding) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/fuzz-findings");
    let sum = surfel::tree::file::hash(&finding.bytes);
    let path = folder.join(format!("{}-{sum:016x}-{}", finding.target, finding.name));
    let cause = path.with_file_name(format!("{}-{sum:016x}.cause", finding.target));
    let written = std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&path, &finding.bytes))
        .and_then(|()| std::fs::write(cause, &finding.cause));
    if let Err(error) = written {
        eprintln!("{}: {error}", path.display());
    }
    path
}

/// Figures of the runs of one target.
#[derive(Debug, Default)]
pub(crate) struct TargetFigures {
    pub(crate) runs: u64,
    pub(crate) opened: u64,
    pub(crate) time: Duration,
    pub(crate) most_memory: usize,
    pub(crate) slowest: Duration,
    pub(crate) findings: Vec<FuzzFinding>,
}

/// A target with its inputs.
pub(crate) struct TargetRunner {
    pub(crate) target: &'static FuzzTarget,
    pub(crate) corpus: Vec<(String, Vec<u8>)>,
    pub(crate) figures: TargetFigures,
    kept: Vec<(String, Vec<u8>)>,
    classes: HashSet<u64>,
    causes: HashSet<String>,
    folder: PathBuf,
    _owner: Arc<tempfile::TempDir>,
}

impl TargetRunner {
    /// A target with the files of its folder in the corpus.
    pub(crate) fn new(target: &'static FuzzTarget, scratch: &Arc<tempfile::TempDir>) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/fuzz/corpus")
            .join(target.name);
        let mut corpus = Vec::new();
        for entry in
            std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            corpus.push((name, std::fs::read(&path).unwrap()));
        }
        corpus.sort();
        Self::with(target, corpus, scratch)
    }

    /// A target with these inputs.
    pub(crate) fn with(
        target: &'static FuzzTarget,
        corpus: Vec<(String, Vec<u8>)>,
        scratch: &Arc<tempfile::TempDir>,
    ) -> Self {
        let folder = scratch.path().join(target.name);
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["a.png", "b.png"] {
            // Photographs that scenes name.
            let photo = include_bytes!("corpus/pictures/colors.png");
            std::fs::write(folder.join(name), photo).unwrap();
        }
        std::fs::write(folder.join("list.txt"), "a.png 0 70.0\nb.png\nc.png\n").unwrap();
        Self {
            target,
            corpus,
            figures: TargetFigures::default(),
            kept: Vec::new(),
            classes: HashSet::new(),
            causes: HashSet::new(),
            folder,
            _owner: Arc::clone(scratch),
        }
    }

    /// How many kinds of outcomes were seen.
    pub(crate) fn kinds(&self) -> usize {
        self.classes.len()
    }

    /// Reads every file of the corpus.
    pub(crate) fn replay(&mut self) {
        for index in 0..self.corpus.len() {
            let (name, bytes) = self.corpus[index].clone();
            self.run(&name, &bytes);
        }
    }

    /// Reads `runs` damaged inputs, the same ones for the same seed.
    pub(crate) fn damage(&mut self, runs: u64, seed: u64) {
        let target = self.target;
        let mut mutator = FileMutator {
            random: Random(seed),
            words: target.words,
        };
        for _ in 0..runs {
            let mut input = || {
                let is_good = self.kept.is_empty() || mutator.random.below(3) > 0;
                let from = if is_good { &self.corpus } else { &self.kept };
                &from[mutator.random.below(from.len())]
            };
            let ((name, bytes), (_, other)) = (input(), input());
            let most = (4 * bytes.len()).clamp(4 << 10, MOST_BYTES);
            let mut damaged = mutator.damaged(bytes, other, most);
            if mutator.random.below(8) > 0 {
                repair(&mut damaged);
            }
            let name = name.clone();
            if self.target.has_parts {
                self.write_parts(&name);
            }
            let opened = self.figures.opened;
            let is_new = self.run(&name, &damaged);
            // Most kinds of errors are of the words in them; what is read is worth more.
            let is_read = self.figures.opened > opened;
            if is_new && self.kept.len() < if is_read { MOST_KEPT } else { MOST_KEPT / 4 } {
                self.kept.push((name, damaged));
            }
        }
    }

    /// Writes the good files that belong to a part of an input.
    fn write_parts(&self, name: &str) {
        let ending = name.rsplit('.').next().unwrap_or("");
        let folder = self.folder.join(ending);
        std::fs::create_dir_all(&folder).unwrap();
        for (part, bytes) in &self.corpus {
            if part != name && part.ends_with(ending) {
                std::fs::write(folder.join(part), bytes).unwrap();
            }
        }
    }

    /// Reads one input. Returns whether it is of a kind not seen before.
    pub(crate) fn run(&mut self, name: &str, bytes: &[u8]) -> bool {
        let folder = if self.target.has_parts {
            self.write_parts(name);
            self.folder.join(name.rsplit('.').next().unwrap_or(""))
        } else {
            self.folder.clone()
        };
        let (result, figures) = measured(self.target, &folder, name, bytes);
        let own = &mut self.figures;
        own.runs += 1;
        own.time += figures.time;
        own.slowest = own.slowest.max(figures.time);
        own.most_memory = own.most_memory.max(figures.memory);
        match result {
            Ok(outcome) => {
                own.opened += u64::from(outcome.is_opened);
                self.classes.insert(outcome.class)
            }
            Err(cause) => {
                // One finding for a place in the source, or for a promise.
                let kind: String = cause
                    .chars()
                    .take(80)
                    .filter(|c| cause.starts_with("panic") || !c.is_ascii_digit())
                    .collect();
                if self.causes.insert(kind) {
                    let finding = FuzzFinding {
                        target: self.target.name,
                        cause,
                        name: name.to_owned(),
                        bytes: bytes.to_vec(),
                    };
                    let path = keep(&finding);
                    eprintln!("{}: {}", path.display(), finding.cause);
                    own.findings.push(finding);
                }
                false
            }
        }
    }
}

/// What one run took.
struct RunFigures {
    time: Duration,
    memory: usize,
}

fn measured(
    target: &'static FuzzTarget,
    folder: &Path,
    name: &str,
    bytes: &[u8],
) -> (Result<InputOutcome, String>, RunFigures) {
    if std::env::var_os("SURFEL_FUZZ_CAREFUL").is_some() {
        // What ends the process (a stack that overflows) leaves its input behind.
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/fuzz-findings");
        let _ = std::fs::create_dir_all(&folder);
        let _ = std::fs::write(folder.join(format!("last-{}-{name}", target.name)), bytes);
    }
    let start = Instant::now();
    *lock(&RUNNING) = Some(RunningInput {
        start,
        target: target.name,
        name: name.to_owned(),
        bytes: bytes.to_vec(),
    });
    super::MEMORY.reset_peak_usage();
    let before = super::MEMORY.current_usage();
    let result = catch_unwind(AssertUnwindSafe(|| (target.run)(folder, name, bytes)));
    let memory = super::MEMORY.peak_usage().saturating_sub(before);
    let time = start.elapsed();
    *lock(&RUNNING) = None;
    let result = match result {
        Ok(Ok(_)) if memory > 4 * bytes.len() + FREE_MEMORY + target.more_memory => Err(format!(
            "takes {memory} bytes for a file of {}",
            bytes.len()
        )),
        Ok(result) => result,
        Err(_) => Err(lock(&LAST_PANIC).clone()),
    };
    (result, RunFigures { time, memory })
}
