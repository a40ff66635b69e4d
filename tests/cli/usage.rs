//! Help, version, and every way of asking for something that cannot be: exit code 2 and a reason.

use super::harness::{command, expect, names, run_with, surfel};

pub(crate) const COMMANDS: &[&str] = &[
    "render",
    "build",
    "export",
    "cross-section",
    "info",
    "check",
    "generate",
    "compare",
    "scenes",
    "join",
    "serve",
    "profile",
    "motion",
    "patches",
    "photos",
    "stability",
    "chart",
    "bench",
    "reproduce",
    "devices",
    "demo",
    "completions",
    "man",
];

#[test]
fn every_command_has_help_with_examples_that_name_its_options() {
    let whole = surfel(["--help"]);
    assert_eq!(whole.code, 0);
    let text = whole.text();
    let listed: Vec<&str> = text
        .lines()
        .skip_while(|l| *l != "Commands:")
        .skip(1)
        .take_while(|l| l.starts_with("  "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert_eq!(listed, COMMANDS);
    assert!(
        text.contains("Examples:") && text.contains("Exit codes"),
        "{text}"
    );
    let mut helps = vec![("", text.clone())];
    for name in COMMANDS {
        let help = surfel(["help", name]);
        assert_eq!(help.code, 0, "{name}: {}", help.err);
        assert_eq!(help.text(), surfel([name, "--help"]).text(), "{name}");
        assert!(
            help.text().contains(&format!("Usage: surfel {name}")),
            "{name}"
        );
        assert!(help.text().contains("Example"), "{name} has no example");
        assert_eq!(surfel([name, "-h"]).code, 0, "{name}");
        helps.push((name, help.text()));
    }
    // An example that names an option or a command that is not there is worse than none.
    let mut options = 0;
    for (of, help) in &helps {
        let (_, examples) = help.split_once("Example").unwrap();
        for line in examples.lines().filter(|l| l.starts_with("  surfel ")) {
            for call in line.split("&&") {
                let mut words = call.split("   ").next().unwrap().split_whitespace();
                assert_eq!(words.next(), Some("surfel"), "{of}: {line}");
                let Some(command) = words.next() else {
                    continue;
                };
                let Some((_, own)) = helps.iter().find(|(name, _)| *name == command) else {
                    // `surfel MODEL` opens the window.
                    assert!(command.contains(['.', ':']), "{of}: {line}");
                    continue;
                };
                for word in words
                    .take_while(|w| *w != ">")
                    .filter(|w| w.starts_with("--"))
                {
                    assert!(own.contains(word), "{of}: {line}: {command} has no {word}");
                    options += 1;
                }
            }
        }
    }
    assert!(
        options > 15,
        "only {options} options in examples: the search is broken"
    );
}

#[test]
fn the_version_is_the_crates_and_names_the_commit() {
    let number = env!("CARGO_PKG_VERSION");
    let long = match surfel::measure::COMMIT {
        "" => number.to_owned(),
        commit => format!("{number} ({commit})"),
    };
    for (option, expected) in [("-V", number), ("--version", &long)] {
        let run = surfel([option]);
        assert_eq!(run.code, 0);
        assert_eq!(run.text(), format!("surfel {expected}\n"));
    }
}

#[test]
fn completions_name_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let run = surfel(["completions", shell]);
        assert_eq!((run.code, run.err.as_str()), (0, ""), "{shell}");
        for name in COMMANDS {
            assert!(run.text().contains(name), "{shell}: {name}");
        }
        assert!(run.text().contains("threshold"), "{shell}");
    }
    assert_eq!(surfel(["completions", "no-shell"]).code, 2);
}

#[test]
fn what_cannot_be_meant_is_bad_usage() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("model.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let before = names(at);
    // Each with a part of the reason that has to be given.
    for (words, reason) in [
        ("--no-such-option", "--no-such-option"),
        ("render", "MODEL"),
        ("render model.obj --no-such-option", "--no-such-option"),
        ("info model.obj other.obj", "other.obj"),
        ("render model.obj", "nothing to write"),
        ("render model.obj -o", "--output"),
        ("render model.obj -o a.jpg", "png or exr"),
        ("render model.obj -o a", "png or exr"),
        ("render model.obj -o - --frames 2", "one picture"),
        ("render model.obj -o a.png --depth a.png", "exr or npy"),
        ("render model.obj -o a.png --normals a.png", "exr"),
        ("render model.obj -o a.png --coverage a.exr", "png"),
        ("render model.obj -o a.exr --depth a.exr", "a.exr"),
        ("render model.obj -o a.png --stats model.obj", "model.obj"),
        ("render model.obj -o a.png --size 0x10", "1 to 16384"),
        ("render model.obj -o a.png --size 10x0", "1 to 16384"),
        ("render model.obj -o a.png --size 20000x10", "1 to 16384"),
        ("render model.obj -o a.png --size 10", "width x height"),
        ("render model.obj -o a.png --size -5x10", "-5"),
        (
            "render model.obj -o a.png --size 10x10x10",
            "width x height",
        ),
        (
            "render model.obj -o a.png --size 99999999999x1",
            "width x height",
        ),
        ("render model.obj -o a.png --orbit 30", "AZIMUTH"),
        ("render model.obj -o a.png --orbit 30,91", "-90 to 90"),
        ("render model.obj -o a.png --orbit nan,0", "finite"),
        ("render model.obj -o a.png --orbit inf,0", "finite"),
        ("render model.obj -o a.png --orbit 30,20,0", "fill"),
        ("render model.obj -o a.png --orbit 30,20,-1", "fill"),
        ("render model.obj -o a.png --orbit 30,20,nan", "fill"),
        ("render model.obj -o a.png --orbit 30,20,1,1", "AZIMUTH"),
        ("render model.obj -o a.png --background pink", "#rrggbb"),
        ("render model.obj -o a.png --background #12345", "#rrggbb"),
        ("render model.obj -o a.png --background #gggggg", "#rrggbb"),
        ("render model.obj -o a.png --background 1,2", "#rrggbb"),
        ("render model.obj -o a.png --background 1,2,256", "#rrggbb"),
        ("render model.obj -o a.png --samples 0", "square"),
        ("render model.obj -o a.png --samples 2", "square"),
        ("render model.obj -o a.png --samples 81", "square"),
        ("render model.obj -o a.png --samples -4", "-4"),
        (
            "render model.obj -o a.png --samples 4 --depth d.npy",
            "--depth",
        ),
        (
            "render model.obj -o a.png --samples 4 --normals n.exr",
            "--normals",
        ),
        ("render model.obj -o a.png --threshold -1", "-1"),
        ("render model.obj -o a.png --threshold=-1", "--threshold"),
        ("render model.obj -o a.png --threshold nan", "--threshold"),
        ("render model.obj -o a.png --threshold inf", "--threshold"),
        ("render model.obj -o a.png --threshold 5000", "4096"),
        ("render model.obj -o a.png --frames 0", "--frames"),
        ("render model.obj -o a.png --frames 100001", "--frames"),
        (
            "render model.obj -o a.png --frames 2 --camera c.json",
            "--camera",
        ),
        (
            "render model.obj -o a.png --orbit 1,2 --camera c.json",
            "--camera",
        ),
        ("render model.obj -o a.png --method fuzzy-pop", "triangles"),
        ("render model.obj -o a.png --culling maybe", "auto"),
        ("render model.obj -o a.png --color-by mood", "primitive"),
        ("render generate:cube -o a.png", "statue"),
        ("render generate:sphere:many -o a.png", "many"),
        ("render generate:sphere:0 -o a.png", "at least one"),
        ("render generate:sphere:99999999999999 -o a.png", "32-bit"),
        ("build model.obj -o model.obj", "written over itself"),
        ("render s3://a.org/a.ply -o a.png", "not fetched"),
        ("build generate:sphere:100", "-o FILE"),
        ("build s3://a.org/a.ply", "not fetched"),
        ("build -", "-o FILE"),
        ("generate", "SHAPE"),
        ("generate cube -o a.ply", "statue"),
        ("generate sphere", "--output"),
        ("generate sphere --triangles 0 -o a.ply", "at least one"),
        (
            "generate sphere --triangles 99999999999999 -o a.ply",
            "32-bit",
        ),
        ("generate sphere --grid 0x5 -o a.ply", "grid"),
        ("generate sphere --grid 3xy -o a.ply", "grid"),
        (
            "generate sphere --grid 3x3 --triangles 5 -o a.ply",
            "--grid",
        ),
        ("demo --repeats 0 -o out", "--repeats"),
        ("demo --size 0x0 -o out", "1 to 16384"),
        (
            "demo --model missing.ply --device mirror -o out",
            "missing.ply",
        ),
        ("info", "MODEL"),
        ("check", "MODEL"),
        ("--log =no=such= info model.obj", "--log"),
    ] {
        let run = expect(at, 2, words);
        assert!(
            run.err.contains(reason),
            "surfel {words}: {:?} names no {reason:?}",
            run.err
        );
        assert_eq!(run.out, b"", "surfel {words}");
        assert_eq!(names(at), before, "surfel {words} left something");
    }
}

#[test]
#[cfg(not(feature = "viewer"))]
fn no_command_shows_the_help() {
    let run = surfel(["no-such-command"]);
    assert_eq!(run.code, 2);
    assert!(run.err.contains("no-such-command"), "{}", run.err);
    let run = surfel([""; 0]);
    assert_eq!(run.code, 2);
    assert!(
        run.err.contains("Usage:") && run.err.contains("render"),
        "{}",
        run.err
    );
}

#[test]
#[cfg(feature = "viewer")]
fn options_of_the_window_do_not_go_with_a_command() {
    for words in [
        "--weld info a.ply",
        "a.ply info a.ply",
        "--vsync off -q check a.ply",
    ] {
        let run = surfel(words.split(' '));
        assert_eq!(run.code, 2, "{words}");
        assert!(run.err.contains("does not go with"), "{words}: {}", run.err);
    }
}

#[test]
fn models_that_are_not_there_or_not_models() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("empty.ply"), "").unwrap();
    std::fs::write(at.join("empty.surfel"), "").unwrap();
    std::fs::write(at.join("noise.bin"), [0x93, 0x11, 0, 0xff, 7, 9]).unwrap();
    std::fs::write(at.join("nothing.obj"), "# a comment\n").unwrap();
    std::fs::create_dir(at.join("folder.ply")).unwrap();
    let before = names(at);
    for (file, reason) in [
        ("missing.ply", "missing.ply: cannot be read"),
        ("missing.surfel", "missing.surfel"),
        ("folder.ply", "folder.ply: cannot be read"),
        ("empty.ply", "empty.ply: the file is empty"),
        ("empty.surfel", "empty.surfel"),
        ("noise.bin", "noise.bin: not a model in a known format"),
        ("nothing.obj", "nothing.obj"),
    ] {
        for words in [
            format!("render {file} -o a.png --device mirror"),
            format!("build {file} -o a.surfel"),
            format!("info {file}"),
            format!("check {file}"),
            format!("demo --model {file} -o out --device mirror"),
        ] {
            // A folder may be one of photographs.
            let reason = match words.as_str() {
                "info folder.ply" => "folder.ply: no scene of photographs",
                _ => reason,
            };
            let run = expect(at, 2, &words);
            assert!(run.err.contains(reason), "surfel {words}: {:?}", run.err);
            assert_eq!(run.err.lines().count(), 1, "surfel {words}: {:?}", run.err);
            assert_eq!(names(at), before, "surfel {words} left something");
        }
    }
    // Every cause is said once.
    let run = expect(at, 2, "info missing.ply");
    assert_eq!(run.err.matches("os error").count(), 1, "{}", run.err);
}

#[test]
fn the_cut_of_another_camera_is_for_what_draws_a_cut() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let draw = "render generate:square:8 --size 20x20 --device mirror -o";
    expect(at, 0, &format!("{draw} a.png --save-camera cut.json"));
    for method in ["triangles", "points", "auto --max-error 0.1"] {
        let words = format!("{draw} b.png --method {method} --cut-camera cut.json");
        let run = expect(at, 2, &words);
        let is_told = run.err.contains("--cut-camera") && run.err.contains("draw a cut");
        assert!(is_told, "{method}: {}", run.err);
    }
    std::fs::write(at.join("bad.json"), "{\"width\": 3}").unwrap();
    for file in ["none.json", "bad.json"] {
        let run = expect(at, 2, &format!("{draw} b.png --cut-camera {file}"));
        assert!(run.err.contains(file), "{}", run.err);
    }
    assert_eq!(names(at), ["a.png", "bad.json", "cut.json"]);
    for method in ["pop", "splats"] {
        let words = format!("{draw} {method}.png --method {method} --cut-camera cut.json");
        expect(at, 0, &words);
    }
}

#[test]
fn a_device_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let without_vulkan = |words: &str| {
        let mut command = command();
        command
            .args(words.split(' '))
            .current_dir(at)
            .env("VK_DRIVER_FILES", at.join("no-driver.json"))
            .env("VK_ICD_FILENAMES", at.join("no-driver.json"));
        run_with(command, None)
    };
    for words in [
        "render generate:square:8 -o a.png --backend vulkan",
        "devices",
        "devices --json",
    ] {
        let run = without_vulkan(words);
        assert_eq!(run.code, 1, "{words}: {}", run.err);
        assert!(run.err.contains("Vulkan"), "{words}: {}", run.err);
    }
    for (how, says_so) in [
        ("", true),
        (" --normals n.exr", true),
        (" --backend cpu", false),
        (" --backend reference", false),
        (" --device mirror", false),
    ] {
        let run = without_vulkan(&format!("render generate:square:8 -o a.png{how}"));
        assert_eq!(run.code, 0, "{how}: {}", run.err);
        assert_eq!(run.err.contains("Vulkan"), says_so, "{how}: {}", run.err);
        let made = names(at);
        assert!(made.contains(&"a.png".to_owned()), "{how}: {made:?}");
        std::fs::remove_file(at.join("a.png")).unwrap();
    }
    let normals = "render generate:square:8 -o a.png --backend cpu --normals n.exr";
    let run = without_vulkan(normals);
    assert_eq!(run.code, 0, "{}", run.err);
    let run = without_vulkan(&format!("{normals} --splat filtered"));
    assert_eq!(run.code, 2, "{}", run.err);
    assert!(run.err.contains("leave --normals out"), "{}", run.err);

    if super::harness::has_device() {
        for device in ["no such device", "99", "-1"] {
            let run = surfel([
                "render",
                "generate:square:8",
                "--stats",
                "-",
                &format!("--device={device}"),
            ]);
            assert_eq!(run.code, 2, "{device}: {}", run.err);
            assert!(run.err.contains(device), "{}", run.err);
        }
        let listed = expect(at, 0, "devices --json").json();
        let name = listed[0]["device"]["name"].as_str().unwrap();
        let part = &name[1..name.len().min(6)];
        for device in ["0", name, part] {
            let run = surfel([
                "render",
                "generate:square:8",
                "--stats",
                "-",
                "--device",
                device,
            ]);
            assert_eq!(run.code, 0, "{device}: {}", run.err);
            assert_eq!(run.json()["device"]["name"].as_str(), Some(name));
        }
        assert!(expect(at, 0, "devices").text().contains(name));
    }
}

#[test]
fn cameras_that_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let made = expect(
        at,
        0,
        "render generate:square:8 --save-camera c.json --device mirror --size 40x30",
    );
    assert_eq!((made.out.len(), made.err.as_str()), (0, ""));
    let good: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at.join("c.json")).unwrap()).unwrap();
    let refuse = |text: &str, reason: &str| {
        std::fs::write(at.join("bad.json"), text).unwrap();
        let run = expect(
            at,
            2,
            "render generate:square:8 -o a.png --device mirror --camera bad.json",
        );
        assert!(
            run.err.contains("bad.json") && run.err.contains(reason),
            "{text}: {:?} names no {reason:?}",
            run.err
        );
        assert!(!at.join("a.png").exists(), "{text}");
    };
    refuse("", "line 1");
    refuse("no camera", "line 1");
    refuse("[]", "line 1");
    refuse(&good.to_string()[..100], "line 1");
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut camera = good.clone();
        change(&mut camera);
        camera.to_string()
    };
    for field in ["width", "height", "view", "proj"] {
        let missing = with(&|c| {
            c.as_object_mut().unwrap().remove(field);
        });
        refuse(&missing, field);
        refuse(&with(&|c| c[field] = "wide".into()), "line 1");
        refuse(&with(&|c| c[field] = serde_json::Value::Null), "line 1");
    }
    for side in ["width", "height"] {
        refuse(&with(&|c| c[side] = 0.into()), "16384");
        refuse(&with(&|c| c[side] = 16_385.into()), "16384");
        refuse(&with(&|c| c[side] = (-5).into()), "line 1");
        refuse(&with(&|c| c[side] = 1.5.into()), "line 1");
    }
    for matrix in ["view", "proj"] {
        refuse(&with(&|c| c[matrix] = vec![1.0; 15].into()), "16");
        refuse(&with(&|c| c[matrix] = vec![1.0; 17].into()), "line 1");
        refuse(&with(&|c| c[matrix] = vec![0.0; 16].into()), "row");
        refuse(&with(&|c| c[matrix][5] = "1".into()), "line 1");
    }
    refuse(&good.to_string().replacen("1.0", "1e999", 1), "line 1");
    refuse(&with(&|c| c["view"][0] = serde_json::json!([])), "line 1");
    refuse(&with(&|c| c["view"][3] = 1.0.into()), "0 0 0 1");
    refuse(&with(&|c| c["proj"][11] = 1.0.into()), "last row");
    refuse(&with(&|c| c["proj"][4] = 0.5.into()), "sheared");
    refuse(&with(&|c| c["proj"][0] = 0.0.into()), "flat");
    refuse(&with(&|c| c["proj"][14] = 0.0.into()), "near");
    refuse(&with(&|c| c["proj"][10] = 0.5.into()), "near");
    refuse(&with(&|c| c["light"] = "lamp".into()), "lamp");
    refuse(&with(&|c| c["y_down"] = 1.into()), "line 1");
    expect(
        at,
        2,
        "render generate:square:8 -o a.png --device mirror --camera missing.json",
    );
    expect(
        at,
        2,
        "render generate:square:8 -o a.png --device mirror --camera .",
    );
    // Of the camera's shape or not at all.
    let run = expect(
        at,
        2,
        "render generate:square:8 -o a.png --device mirror --camera c.json --size 40x31",
    );
    assert!(run.err.contains("40x30"), "{}", run.err);
    expect(
        at,
        0,
        "render generate:square:8 -o a.png --device mirror --camera c.json --size 80x60",
    );
    // Keys that are not known are no fault.
    std::fs::write(at.join("more.json"), with(&|c| c["lens"] = "50 mm".into())).unwrap();
    expect(
        at,
        0,
        "render generate:square:8 --save-camera kept.json --device mirror --camera more.json",
    );
    assert!(
        std::fs::read_to_string(at.join("kept.json"))
            .unwrap()
            .contains("50 mm")
    );
}
