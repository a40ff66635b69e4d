//! Every writer, with each of the system calls that touch its file failing once, or the program killed there: the old file
//! is left or the new one, whole. Needs strace; without it the test says so.
//!
//! Each test run takes a part of the calls; `SURFEL_FAULTS=all` takes all of them.

use super::harness::names;
use super::writing::{WRITERS, prepared};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

/// Calls that bring a file to the disk.
const CALLS: &str = "openat,write,writev,pwrite64,ftruncate,fallocate,fchmod,fsync,fdatasync,\
                     rename,renameat,renameat2,link,linkat,lseek";

/// What each call is made to do. Killed before the call and after it.
const FAULTS: [&str; 4] = [
    "error=ENOSPC",
    "error=EROFS",
    "error=EIO",
    "error=EIO:signal=KILL",
];

fn strace(at: &Path, words: &str, more: &[&str]) -> Output {
    Command::new("strace")
        .args(["-f", "-qq", "-y", "-e"])
        .arg(format!("trace={CALLS}"))
        .args(more)
        .arg(env!("CARGO_BIN_EXE_surfel"))
        .args(words.split(' '))
        .current_dir(at)
        .env("SURFEL_CALIBRATE", "off")
        .output()
        .unwrap()
}

/// Calls that touch the file that is written, as (name, number among its thread's calls of that name).
fn calls_for(log: &str, file: &str) -> Vec<(String, u64)> {
    let mut counts: BTreeMap<(&str, &str), u64> = BTreeMap::new();
    let mut found = Vec::new();
    for line in log.lines() {
        // A line is "12 write(4<.surfel-ab>, ...": thread, call, and the file behind a number.
        let Some((thread, call)) = line.split_once(' ') else {
            continue;
        };
        let call = call.trim_start();
        let Some((name, _)) = call.split_once('(') else {
            continue;
        };
        if !name.bytes().all(|b| b.is_ascii_alphanumeric()) {
            continue;
        }
        let count = counts.entry((thread, name)).or_default();
        *count += 1;
        let is_of_file = call.contains(".surfel-") || call.contains(file);
        if is_of_file {
            found.push((name.to_owned(), *count));
        }
    }
    found.sort();
    found.dedup();
    found
}

/// Calls of one kind that are tried where not all are.
const SAMPLES: usize = 2;

fn sampled(calls: Vec<(String, u64)>) -> Vec<(String, u64)> {
    if std::env::var("SURFEL_FAULTS").is_ok_and(|value| value == "all") {
        return calls;
    }
    let mut by_name: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for (name, number) in calls {
        by_name.entry(name).or_default().push(number);
    }
    let mut kept = Vec::new();
    for (name, numbers) in by_name {
        let every = numbers.len().div_ceil(SAMPLES);
        kept.extend(numbers.iter().step_by(every).map(|n| (name.clone(), *n)));
    }
    kept
}

/// A file is what it was, or the new one, which two runs without faults have written alike; of one with times in it, as
/// long as JSON is whole.
fn is_old_or_new(now: &[u8], new: &[u8], is_json: bool) -> bool {
    let is_whole_json =
        || is_json && serde_json::from_slice::<serde_json::Value>(now).is_ok_and(|v| v.is_object());
    now == b"old" || now == new || is_whole_json()
}

#[test]
fn write_faults_leave_the_old_file_or_the_new_one() {
    if Command::new("strace").arg("-V").output().is_err() {
        println!("no strace: faults of writing system calls are not tested");
        return;
    }
    let folder = prepared();
    let at = folder.path();
    println!("| written | calls | runs | failed | killed | unharmed |");
    let mut all = 0;
    for (words, file) in WRITERS {
        let words = words.replace('@', "");
        let log = at.join("log");
        let whole = strace(at, &words, &["-o", log.to_str().unwrap()]);
        if !whole.status.success() && String::from_utf8_lossy(&whole.stderr).contains("ptrace") {
            println!("strace may not trace here: faults of writing system calls are not tested");
            return;
        }
        assert!(whole.status.success(), "{words}: {whole:?}");
        let new = std::fs::read(at.join(file)).unwrap();
        let calls = calls_for(&std::fs::read_to_string(&log).unwrap(), file);
        std::fs::remove_file(&log).unwrap();
        assert!(calls.len() >= 3, "{words}: {calls:?}");
        let count = calls.len();
        let (mut runs, mut failed, mut killed, mut unharmed) = (0, 0, 0, 0);
        for (name, number) in sampled(calls) {
            for fault in FAULTS {
                std::fs::write(at.join(file), "old").unwrap();
                let inject = format!("inject={name}:{fault}:when={number}");
                let run = strace(at, &words, &["-o", "/dev/null", "-e", &inject]);
                runs += 1;
                let what = format!("{words}, {inject}");
                let now = std::fs::read(at.join(file)).unwrap();
                assert!(
                    is_old_or_new(&now, &new, file.ends_with("json")),
                    "{what}: {} bytes, neither old nor new",
                    now.len()
                );
                let err = String::from_utf8_lossy(&run.stderr);
                let left = names(at);
                match run.status.code() {
                    Some(0) => {
                        // Nothing that matters failed, such as a place that was asked for and not needed.
                        assert!(now != b"old", "{what}: ended well and wrote nothing: {err}");
                        unharmed += 1;
                    }
                    Some(code) => {
                        assert!(code == 1 || code == 2, "{what}: exit code {code}: {err}");
                        assert!(!err.contains("panicked"), "{what}: {err}");
                        assert_eq!(now, b"old", "{what}: failed, and wrote: {err}");
                        failed += 1;
                    }
                    None => killed += 1,
                }
                for name in left {
                    // What a kill leaves is hidden, and of another name.
                    let is_scrap = name.starts_with(".surfel-");
                    let is_known = name == "model.ply" || name == *file;
                    let is_killed = run.status.code().is_none();
                    assert!(is_known || is_scrap && is_killed, "{what}: {name} is left");
                    if is_scrap {
                        std::fs::remove_file(at.join(name)).unwrap();
                    }
                }
            }
        }
        std::fs::remove_file(at.join(file)).unwrap();
        assert!(failed > 0 && killed > 0, "{words}: {failed}, {killed}");
        println!("| {words} | {count} | {runs} | {failed} | {killed} | {unharmed} |");
        all += runs;
    }
    assert!(all > 200, "only {all} runs");
}
