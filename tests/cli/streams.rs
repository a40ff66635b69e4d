//! Standard input, output and error: pipes, closed pipes, full devices, nobody at the terminal.

use super::harness::{command, expect, names, run_with, wait};
use std::io::Read;
use std::path::Path;

const COMMANDS_WITH_OUTPUT: &[&str] = &[
    "--help",
    "--version",
    "help render",
    "completions bash",
    "completions zsh",
    "info generate:sphere:1000",
    "info --json generate:sphere:1000",
    "check generate:sphere:1000",
    "check --json generate:sphere:1000",
    "render generate:sphere:1000 --device mirror --stats -",
    "render generate:sphere:1000 --device mirror --save-camera -",
    "render generate:sphere:1000 --device mirror --size 40x30 -o -",
];

/// Runs with standard output or error going nowhere: the other end of the pipe is closed from the start.
fn with_closed(at: &Path, words: &str, is_error: bool) -> (Option<i32>, String) {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let (mut other, kept) = std::io::pipe().unwrap();
    let mut command = command();
    command.args(words.split(' ')).current_dir(at);
    if is_error {
        command.stderr(writer).stdout(kept);
    } else {
        command.stdout(writer).stderr(kept);
    }
    let mut child = command.spawn().unwrap();
    drop(command);
    let mut text = String::new();
    other.read_to_string(&mut text).unwrap();
    (wait(&mut child), text)
}

#[test]
fn a_reader_that_went_away_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    for words in COMMANDS_WITH_OUTPUT {
        let (code, err) = with_closed(folder.path(), words, false);
        assert_eq!((code, err.as_str()), (Some(0), ""), "surfel {words}");
    }
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn pictures_on_standard_output_are_those_of_files() {
    let folder = tempfile::tempdir().unwrap();
    let render = "render generate:sphere:1000 --backend reference --size 40x30";
    for more in [
        "",
        " --samples 4",
        " --background transparent",
        " --samples 4 --background transparent",
    ] {
        expect(folder.path(), 0, &format!("{render}{more} -o a.png"));
        let file = std::fs::read(folder.path().join("a.png")).unwrap();
        let printed = expect(folder.path(), 0, &format!("{render}{more} -o -")).out;
        assert!(printed == file && file.starts_with(b"\x89PNG"), "{more}");
    }
    for (more, reason) in [
        ("-o - --frames 2", "one picture"),
        ("-o - --stats -", "takes one file"),
    ] {
        let refused = expect(folder.path(), 2, &format!("{render} {more}"));
        assert!(refused.err.contains(reason), "{}", refused.err);
        assert_eq!(refused.out, b"", "{more}");
    }
    assert_eq!(names(folder.path()), ["a.png"]);
}

#[test]
fn nobody_listening_to_errors_changes_no_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    for (words, code) in [
        ("generate sphere --triangles 1000 -o a.ply", 0),
        ("build a.ply -o a.surfel", 0),
        ("--log debug info a.ply", 0),
        ("info missing.ply", 2),
        ("--no-such-option", 2),
        ("generate sphere -o missing/a.ply", 1),
    ] {
        let (found, _) = with_closed(folder.path(), words, true);
        assert_eq!(found, Some(code), "surfel {words}");
    }
    assert_eq!(names(folder.path()), ["a.ply", "a.surfel"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_device_is_a_failed_run() {
    let folder = tempfile::tempdir().unwrap();
    let full = || {
        std::fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    // Small enough to stay in a buffer until the end, and too large for that.
    let generators = [
        "generate sphere --triangles 1000 -o -",
        "generate sphere --triangles 300000 -o -",
    ];
    for words in COMMANDS_WITH_OUTPUT
        .iter()
        .chain(&generators)
        .filter(|w| !w.contains("help") && !w.contains("version"))
    {
        let mut command = command();
        command.args(words.split(' ')).stdout(full());
        let (mut errors, writer) = std::io::pipe().unwrap();
        command.stderr(writer);
        let mut child = command.spawn().unwrap();
        drop(command);
        let mut err = String::new();
        errors.read_to_string(&mut err).unwrap();
        assert_eq!(wait(&mut child), Some(1), "surfel {words}: {err}");
        assert!(
            err.contains("standard output") || err.contains("cannot write the model"),
            "surfel {words}: {err}"
        );
    }
    for words in [
        "generate sphere --triangles 1000 -o /dev/full",
        "render generate:sphere:1000 --device mirror --stats /dev/full",
        "render generate:sphere:1000 --device mirror --save-camera /dev/full",
    ] {
        let run = expect(folder.path(), 1, words);
        assert!(run.err.contains("/dev/full"), "surfel {words}: {}", run.err);
    }
    // And what can be written to is written to, not replaced.
    expect(
        folder.path(),
        0,
        "render generate:sphere:1000 --device mirror --stats /dev/null",
    );
    expect(
        folder.path(),
        0,
        "generate sphere --triangles 1000 -o /dev/null",
    );
    use std::os::unix::fs::FileTypeExt;
    assert!(
        std::fs::metadata("/dev/null")
            .unwrap()
            .file_type()
            .is_char_device()
    );
}

#[test]
fn standard_input_is_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 3000 -o a.ply");
    let bytes = std::fs::read(at.join("a.ply")).unwrap();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &bytes).unwrap();
    let packed = packed.finish().unwrap();
    let draw = "-o a.png --size 60x50 --device mirror";
    expect(at, 0, &format!("render a.ply {draw}"));
    let wanted = std::fs::read(at.join("a.png")).unwrap();
    for input in [&bytes, &packed] {
        std::fs::remove_file(at.join("a.png")).unwrap();
        let mut command = command();
        command
            .args(format!("render - {draw}").split(' '))
            .current_dir(at);
        let run = run_with(command, Some(input));
        assert_eq!((run.code, run.err.as_str()), (0, ""));
        assert!(
            std::fs::read(at.join("a.png")).unwrap() == wanted,
            "another picture"
        );
    }
    // Trees as well, of either kind.
    for (kind, format) in [("", "paged surfel tree"), ("--exact", "surfel tree")] {
        expect(at, 0, &format!("build a.ply -o a.surfel {kind}"));
        let tree = std::fs::read(at.join("a.surfel")).unwrap();
        let mut info = command();
        info.args(["info", "-", "--json"]);
        let run = run_with(info, Some(&tree));
        assert_eq!((run.code, run.err.as_str()), (0, ""));
        assert_eq!(run.json()["format"], format);
        assert_eq!(run.json()["file_bytes"], tree.len());
    }
    let tree = std::fs::read(at.join("a.surfel")).unwrap();
    for (input, reason) in [
        (&tree[..tree.len() - 1], "standard input, byte"),
        (&bytes[..0], "standard input: the file is empty"),
        (&bytes[..bytes.len() - 1], "standard input"),
        (&packed[..packed.len() - 9], "standard input"),
    ] {
        let mut command = command();
        command.args(["info", "-"]);
        let run = run_with(command, Some(input));
        assert_eq!(run.code, 2);
        assert!(run.err.contains(reason), "{}", run.err);
    }
}

#[test]
fn generated_models_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let words = "generate statue --triangles 30000 -o";
    expect(at, 0, &format!("{words} a.ply"));
    let run = expect(at, 0, &format!("{words} -"));
    assert!(run.out == std::fs::read(at.join("a.ply")).unwrap());
    assert_eq!(names(at), ["a.ply"]);
    for size in ["1000", "300000"] {
        let words = format!("generate sphere --triangles {size} -o -");
        let (code, err) = with_closed(at, &words, false);
        assert_eq!((code, err.as_str()), (Some(0), ""), "{words}");
    }
}

/// `surfel info <(zcat a.ply.gz)`: what is read from a pipe to look at it is gone.
#[test]
#[cfg(target_os = "linux")]
fn a_pipe_with_a_name_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    expect(
        folder.path(),
        0,
        "generate sphere --triangles 1000 -o a.ply",
    );
    let bytes = std::fs::read(folder.path().join("a.ply")).unwrap();
    let mut command = command();
    command.args(["info", "/dev/stdin", "--json"]);
    let run = run_with(command, Some(&bytes));
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(run.json()["triangles"], 1024);
}

#[test]
fn talk_goes_to_standard_error_only_where_asked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let quiet = expect(
        at,
        0,
        "render generate:sphere:300000 -o a.png --device mirror --size 50x50",
    );
    assert_eq!((quiet.out.len(), quiet.err.as_str()), (0, ""));
    let loud = expect(
        at,
        0,
        "--log debug render generate:sphere:1000 -o a.png --device mirror",
    );
    assert!(
        loud.out.is_empty() && loud.err.contains("generate"),
        "{}",
        loud.err
    );
}
