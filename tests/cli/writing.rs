//! Files that are written: complete or not at all, with the user's permissions, nothing else left behind.

use super::harness::{expect, names};
use std::path::Path;

/// Every command that writes, with the file it writes; `@` stands for the folder of the file.
pub(crate) const WRITERS: &[(&str, &str)] = &[
    ("generate sphere --triangles 2000 -o @out.ply", "out.ply"),
    ("build model.ply --exact -o @out.surfel", "out.surfel"),
    ("build model.ply -o @out.surfel", "out.surfel"),
    (
        "render model.ply --size 64x48 --device mirror -o @out.png",
        "out.png",
    ),
    (
        "render model.ply --size 64x48 --device mirror -o @out.exr",
        "out.exr",
    ),
    (
        "render model.ply --size 64x48 --device mirror --depth @out.exr",
        "out.exr",
    ),
    (
        "render model.ply --size 64x48 --device mirror --depth @out.npy",
        "out.npy",
    ),
    (
        "render model.ply --size 64x48 --device mirror --normals @out.exr",
        "out.exr",
    ),
    (
        "render model.ply --size 64x48 --device mirror --coverage @out.png",
        "out.png",
    ),
    (
        "render model.ply --size 64x48 --device mirror --stats @out.json",
        "out.json",
    ),
    (
        "render model.ply --size 64x48 --device mirror --save-camera @out.json",
        "out.json",
    ),
    (
        concat!(
            "compare ",
            env!("CARGO_MANIFEST_DIR"),
            "/assets/golden/scan-disc.png ",
            env!("CARGO_MANIFEST_DIR"),
            "/assets/golden/scan-ellipse.png --difference @out.png"
        ),
        "out.png",
    ),
    (
        concat!(
            "compare ",
            env!("CARGO_MANIFEST_DIR"),
            "/assets/golden/scan-disc.png ",
            env!("CARGO_MANIFEST_DIR"),
            "/assets/golden/scan-ellipse.png --flip-map @out.png"
        ),
        "out.png",
    ),
    (
        "motion model.ply --device mirror --size 48x40 --steps 2 --csv @out.csv",
        "out.csv",
    ),
    (
        "motion model.ply --device mirror --size 48x40 --steps 2 --json @out.json",
        "out.json",
    ),
];

/// A folder with a model.
pub(crate) fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    expect(
        folder.path(),
        0,
        "generate statue --triangles 3000 -o model.ply",
    );
    folder
}

fn fill(words: &str, folder: &str) -> String {
    words.replace('@', folder)
}

#[test]
fn a_folder_that_is_missing_fails_the_run() {
    let folder = prepared();
    let at = folder.path();
    for (words, _) in WRITERS {
        for target in ["missing/", "model.ply/"] {
            let words = fill(words, target);
            let run = expect(at, 1, &words);
            assert!(
                run.err.contains("cannot write") && run.err.contains(target),
                "{words}: {}",
                run.err
            );
            assert_eq!(run.err.lines().count(), 1, "{words}: {}", run.err);
            assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
        }
    }
    let run = expect(
        at,
        1,
        "demo --model model.ply --repeats 1 --device mirror -o model.ply",
    );
    assert!(run.err.contains("model.ply"), "{}", run.err);
}

#[test]
fn a_folder_of_that_name_fails_the_run() {
    let folder = prepared();
    let at = folder.path();
    for (words, file) in WRITERS {
        std::fs::create_dir(at.join(file)).unwrap();
        let words = fill(words, "");
        let run = expect(at, 1, &words);
        assert!(run.err.contains(file), "{words}: {}", run.err);
        assert_eq!(names(&at.join(file)), Vec::<String>::new(), "{words}");
        std::fs::remove_dir(at.join(file)).unwrap();
        assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
    }
}

/// The disk fills in the middle of a file: here a limit on the size of files, reported as an error of the write.
#[test]
#[cfg(unix)]
fn what_fails_in_the_middle_leaves_the_old_file() {
    use super::harness::{command_after, run_with};
    let folder = prepared();
    let at = folder.path();
    let mut tested = 0;
    for (words, file) in WRITERS {
        std::fs::write(at.join(file), "old").unwrap();
        let words = fill(words, "");
        // One block is 512 or 1024 bytes, less than any of these files but the camera's.
        let mut command = command_after("trap '' XFSZ; ulimit -f 1");
        command.args(words.split(' ')).current_dir(at);
        let run = run_with(command, None);
        if run.code == 0 {
            let length = at.join(file).metadata().unwrap().len();
            assert!(
                length <= 1024,
                "{words}: {length} bytes in spite of the limit"
            );
        } else {
            assert_eq!(run.code, 1, "{words}: {}", run.err);
            assert!(run.err.contains(file), "{words}: {}", run.err);
            assert_eq!(std::fs::read(at.join(file)).unwrap(), b"old", "{words}");
            tested += 1;
        }
        std::fs::remove_file(at.join(file)).unwrap();
        assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
    }
    assert!(tested >= WRITERS.len() - 2, "only {tested} writes failed");
}

#[test]
fn files_are_replaced_and_have_ordinary_permissions() {
    let folder = prepared();
    let at = folder.path();
    std::fs::write(at.join("ordinary"), "").unwrap();
    let ordinary = at.join("ordinary").metadata().unwrap().permissions();
    std::fs::remove_file(at.join("ordinary")).unwrap();
    for (words, file) in WRITERS {
        let words = fill(words, "");
        std::fs::write(at.join(file), "old").unwrap();
        expect(at, 0, &words);
        assert!(at.join(file).metadata().unwrap().len() > 100, "{words}");
        assert_eq!(
            at.join(file).metadata().unwrap().permissions(),
            ordinary,
            "{words}"
        );
        std::fs::remove_file(at.join(file)).unwrap();
        assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
    }
}

#[test]
#[cfg(unix)]
fn a_link_is_followed() {
    let folder = prepared();
    let at = folder.path();
    for (words, file) in WRITERS {
        if file.ends_with(".surfel") {
            continue; // Written beside its link's target by the layer below; not promised there.
        }
        std::fs::create_dir(at.join("far")).unwrap();
        std::fs::write(at.join("far/target"), "old").unwrap();
        std::os::unix::fs::symlink("far/target", at.join(file)).unwrap();
        expect(at, 0, &fill(words, ""));
        assert!(
            at.join(file).symlink_metadata().unwrap().is_symlink(),
            "{words}"
        );
        assert!(
            at.join("far/target").metadata().unwrap().len() > 100,
            "{words}"
        );
        std::fs::remove_file(at.join(file)).unwrap();
        assert_eq!(names(&at.join("far")), ["target"], "{words}");
        std::fs::remove_dir_all(at.join("far")).unwrap();
    }
}

#[test]
fn a_tree_is_written_beside_its_model_by_default() {
    let folder = prepared();
    let run = expect(folder.path(), 0, "build model.ply");
    assert!(
        run.out.is_empty() && run.err.contains("model.surfel"),
        "{}",
        run.err
    );
    assert_eq!(names(folder.path()), ["model.ply", "model.surfel"]);
    expect(folder.path(), 2, "build model.surfel");
}

/// Interrupts a command as soon as `ready` sees that it is at work; its exit code, and what it said.
#[cfg(unix)]
fn interrupted(at: &Path, words: &str, ready: impl Fn(&[String]) -> bool) -> (Option<i32>, String) {
    use super::harness::{command, wait};
    use std::io::Read;
    use std::time::{Duration, Instant};
    let mut command = command();
    command
        .args(words.split(' '))
        .current_dir(at)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    let start = Instant::now();
    while !ready(&names(at)) {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "{words}: never at work"
        );
        assert!(
            child.try_wait().unwrap().is_none(),
            "{words}: over before it was interrupted"
        );
        std::thread::sleep(Duration::from_millis(1));
    }
    let killed = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    let code = wait(&mut child);
    let mut err = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut err)
        .unwrap();
    (code, err)
}

#[test]
#[cfg(unix)]
fn interrupting_leaves_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // 160 million triangles: far more than is written before the signal comes.
    let words = "generate statue --triangles 160000000 -o a.ply";
    let (code, err) = interrupted(at, words, |names| {
        names.iter().any(|n| n.starts_with(".surfel-"))
    });
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("cancelled"), "{err}");
    assert_eq!(names(at), Vec::<String>::new());

    let words =
        "render generate:statue:3000 --device mirror --size 64x64 --frames 100000 -o turn.png";
    let (code, err) = interrupted(at, words, |names| {
        names.iter().any(|n| n == "turn-00001.png")
    });
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("cancelled"), "{err}");
    let names = names(at);
    assert!(
        names.len() > 1 && names.len() < 100_000,
        "{} files",
        names.len()
    );
    for name in names {
        assert!(name.starts_with("turn-"), "{name} was left");
        surfel::image::FloatImage::load(&at.join(&name)).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// A pipe in the place of each file: what is written arrives there, and the pipe stays.
#[test]
#[cfg(unix)]
fn a_pipe_is_written_to_and_stays() {
    use std::os::unix::fs::FileTypeExt;
    let folder = prepared();
    let at = folder.path();
    for (words, file) in WRITERS {
        let path = at.join(file);
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success(), "{file}");
        let reader = {
            let path = path.clone();
            std::thread::spawn(move || std::fs::read(path).unwrap().len())
        };
        expect(at, 0, &fill(words, ""));
        assert!(reader.join().unwrap() > 100, "{words}");
        let kind = path.symlink_metadata().unwrap().file_type();
        assert!(kind.is_fifo(), "{words} replaced the pipe");
        std::fs::remove_file(&path).unwrap();
        assert_eq!(names(at), ["model.ply"], "surfel {words} left something");
    }
}

#[test]
fn a_variable_that_hides_the_drivers_is_named() {
    use super::harness::{command, run_with};
    let folder = prepared();
    for (name, words, code) in [
        ("VK_ICD_FILENAMES", "render model.ply -o out.png", 0),
        ("VK_DRIVER_FILES", "devices", 1),
    ] {
        let mut command = command();
        command
            .args(words.split(' '))
            .current_dir(folder.path())
            .env_remove("VK_ICD_FILENAMES")
            .env_remove("VK_DRIVER_FILES")
            .env(name, "/nonexistent.json");
        let run = run_with(command, None);
        let wanted = format!("the variable {name} allows only /nonexistent.json");
        assert!(run.err.contains(&wanted), "{}", run.err);
        assert_eq!(run.code, code, "{}", run.err);
    }
}
