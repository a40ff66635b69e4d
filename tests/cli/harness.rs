//! Runs the program and holds every run to what is always promised.

use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A run this long hangs. The longest here takes seconds; a busy machine may need ten times that.
const PATIENCE: Duration = Duration::from_secs(120);

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: i32,
    pub(crate) out: Vec<u8>,
    pub(crate) err: String,
}

impl Run {
    /// Standard output as text.
    pub(crate) fn text(&self) -> String {
        String::from_utf8(self.out.clone()).unwrap()
    }

    /// Standard output as JSON.
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.out).unwrap_or_else(|e| panic!("{e}: {}", self.text()))
    }
}

/// The program, free of what the caller's environment says about it.
pub(crate) fn command() -> Command {
    wrapped(Command::new(env!("CARGO_BIN_EXE_surfel")))
}

fn wrapped(mut command: Command) -> Command {
    command
        .stdin(Stdio::null())
        // Measured costs may change the last bits of a picture from one machine's load to the next.
        .env("SURFEL_CALIBRATE", "off")
        .env_remove("SURFEL_LOG")
        .env_remove("RUST_LOG");
    command
}

/// The program under a shell that first runs `before` (limits, traps).
#[cfg(unix)]
pub(crate) fn command_after(before: &str) -> Command {
    let mut shell = Command::new("sh");
    shell
        .arg("-c")
        .arg(format!("{before}; exec \"$0\" \"$@\""))
        .arg(env!("CARGO_BIN_EXE_surfel"));
    wrapped(shell)
}

/// Waits for an end within [`PATIENCE`]; `None` when a signal ended the program.
pub(crate) fn wait(child: &mut Child) -> Option<i32> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("hangs: killed after {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Runs a prepared command with `input` on its standard input.
pub(crate) fn run_with(mut command: Command, input: Option<&[u8]>) -> Run {
    if input.is_some() {
        command.stdin(Stdio::piped());
    }
    let shown = format!("{command:?}");
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut stdin, mut stdout, mut stderr) = (
        child.stdin.take(),
        child.stdout.take().unwrap(),
        child.stderr.take().unwrap(),
    );
    std::thread::scope(|scope| {
        if let (Some(stdin), Some(input)) = (stdin.take(), input) {
            scope.spawn(move || {
                let mut stdin = stdin;
                // The program may have seen enough.
                let _ = stdin.write_all(input);
            });
        }
        let out = scope.spawn(move || {
            let mut bytes = Vec::new();
            stdout.read_to_end(&mut bytes).unwrap();
            bytes
        });
        let err = scope.spawn(move || {
            let mut bytes = Vec::new();
            stderr.read_to_end(&mut bytes).unwrap();
            String::from_utf8(bytes).unwrap()
        });
        let code = wait(&mut child);
        let (out, err) = (out.join().unwrap(), err.join().unwrap());
        let code = code.unwrap_or_else(|| panic!("{shown}: ended by a signal: {err}"));
        let run = Run { code, out, err };
        always(&shown, &run);
        run
    })
}

/// What holds for every run that is not on a terminal.
fn always(shown: &str, run: &Run) {
    let Run { code, err, .. } = run;
    assert!(!err.contains("panicked"), "{shown}: {err}");
    assert!((0..=2).contains(code), "{shown}: exit code {code}: {err}");
    assert!(
        !err.contains(['\u{1b}', '\r', '\u{2588}']),
        "{shown}: a progress bar without a terminal: {err:?}"
    );
    if *code != 0 {
        assert!(
            err.starts_with("surfel: ")
                || err.starts_with("error: ")
                || err.lines().any(|l| l.starts_with("surfel: "))
                || err.contains("Usage:"),
            "{shown}: exit code {code} and no reason: {err:?}"
        );
        assert!(!err.contains("RUST_BACKTRACE"), "{shown}: {err}");
    }
}

/// Runs the program with arguments.
pub(crate) fn surfel<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Run {
    let mut command = command();
    command.args(args);
    run_with(command, None)
}

/// As [`surfel`] in a folder.
pub(crate) fn surfel_in<S: AsRef<OsStr>>(folder: &Path, args: impl IntoIterator<Item = S>) -> Run {
    let mut command = command();
    command.args(args).current_dir(folder);
    run_with(command, None)
}

/// Runs words, separated by spaces, in a folder; the exit code has to be `code`.
pub(crate) fn expect(folder: &Path, code: i32, words: &str) -> Run {
    let run = surfel_in(folder, words.split_whitespace());
    assert_eq!(run.code, code, "surfel {words}: {}", run.err);
    run
}

/// Names in a folder, sorted, those that begin with a dot too.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Whether a device under the validation layer is there; with `SURFEL_REQUIRE_DEVICE=1` its absence fails.
pub(crate) fn has_device() -> bool {
    let run = surfel("render generate:square:8 --size 8x8 --stats - --validate".split(' '));
    if run.code == 0 {
        return true;
    }
    assert!(
        std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
        "a device is required here: {}",
        run.err
    );
    println!("no device, nothing tested with one: {}", run.err);
    false
}
