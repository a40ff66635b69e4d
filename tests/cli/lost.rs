//! Nothing is lost: a program that is killed leaves the old file or the new one, whole; a disk that is full is said.

use super::harness::{command, expect, names, run_with, surfel_in, wait};
use std::path::Path;
use std::time::{Duration, Instant};

/// Writers of large files, with the file that each writes.
const LARGE: &[(&str, &str)] = &[
    ("generate statue --triangles 400000 -o out.ply", "out.ply"),
    ("build model.ply --exact -o out.surfel", "out.surfel"),
    ("build model.ply -o out.surfel", "out.surfel"),
    (
        "render model.ply --device cpu --samples 1 --size 1500x1200 -o out.png",
        "out.png",
    ),
    (
        "render model.ply --device cpu --samples 1 --size 900x900 -o out.exr",
        "out.exr",
    ),
];

/// Kills a command after a while; returns whether it was still at work.
fn killed(at: &Path, words: &str, after: Duration) -> bool {
    let mut command = command();
    command
        .args(words.split(' '))
        .current_dir(at)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null());
    let mut child = command.spawn().unwrap();
    std::thread::sleep(after);
    // The signal that no program can catch.
    child.kill().unwrap();
    wait(&mut child) != Some(0)
}

#[test]
fn a_kill_leaves_the_old_file_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 60000 -o model.ply");
    for (words, file) in LARGE {
        let start = Instant::now();
        expect(at, 0, words);
        let whole = start.elapsed();
        let new = std::fs::read(at.join(file)).unwrap();
        let mut was_at_work = 0;
        for part in [0.3, 0.6, 0.75, 0.85, 0.9, 0.95, 1.0] {
            std::fs::write(at.join(file), "old").unwrap();
            was_at_work += u32::from(killed(at, words, whole.mul_f64(part)));
            let found = std::fs::read(at.join(file)).unwrap();
            // Pictures and trees have the same bytes on every run.
            assert!(
                found == b"old" || found == new,
                "{words}, killed at {part}: {} bytes, neither old nor new",
                found.len()
            );
            for name in names(at) {
                let is_known = name == "model.ply" || name == *file;
                assert!(is_known || name.starts_with(".surfel-"), "{words}: {name}");
                if !is_known {
                    std::fs::remove_file(at.join(name)).unwrap();
                }
            }
        }
        assert!(was_at_work > 0, "{words}: always over before it was killed");
        std::fs::remove_file(at.join(file)).unwrap();
    }
}

/// A device that is always full, in the place of the file.
#[test]
#[cfg(target_os = "linux")]
fn a_full_device_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 3000 -o model.ply");
    for (words, file) in super::writing::WRITERS {
        std::os::unix::fs::symlink("/dev/full", at.join(file)).unwrap();
        let run = surfel_in(at, words.replace('@', "").split(' '));
        assert_eq!(run.code, 1, "{words}: {}", run.err);
        assert!(run.err.contains("No space left"), "{words}: {}", run.err);
        std::fs::remove_file(at.join(file)).unwrap();
        assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
    }
}

/// A folder that may not be written to. The superuser may, so there it is only tried.
#[test]
fn a_folder_that_is_read_only_fails_the_run() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 3000 -o model.ply");
    let inside = at.join("closed");
    std::fs::create_dir(&inside).unwrap();
    std::fs::set_permissions(&inside, std::fs::Permissions::from_mode(0o555)).unwrap();
    let may_write = std::fs::write(inside.join("probe"), "").is_ok();
    let _ = std::fs::remove_file(inside.join("probe"));
    if may_write {
        println!("this user writes into any folder: not tested");
        return;
    }
    for (words, _) in super::writing::WRITERS {
        let mut command = command();
        let words = words.replace('@', "closed/");
        command.args(words.split(' ')).current_dir(at);
        let run = run_with(command, None);
        assert_eq!(run.code, 1, "{words}: {}", run.err);
        assert!(run.err.contains("cannot write"), "{words}: {}", run.err);
        assert_eq!(names(&inside), Vec::<String>::new(), "{words}");
    }
}
