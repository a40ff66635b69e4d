//! Files of `packaging`, and what packages are made of: pages, types of files, thumbnails, icons, versions.

use crate::harness::{command, expect, names, run_with};
use std::collections::BTreeSet;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    let path = root().join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Value of `key` in a desktop entry.
fn value(entry: &str, key: &str) -> String {
    let line = entry
        .lines()
        .find_map(|l| l.strip_prefix(key)?.strip_prefix('='));
    line.unwrap_or_else(|| panic!("no {key}")).to_owned()
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "man --output .");
    let mut wanted = vec!["surfel.1".to_owned()];
    for words in
        super::usage::COMMANDS
            .iter()
            .chain(&["photos score", "photos render", "photos walk"])
    {
        wanted.push(format!("surfel-{}.1", words.replace(' ', "-")));
        let printed = expect(at, 0, &format!("man {words}")).text();
        let written = std::fs::read_to_string(at.join(wanted.last().unwrap())).unwrap();
        assert_eq!(printed, written, "{words}");
        for section in [".SH NAME", ".SH SYNOPSIS", ".SH OPTIONS"] {
            assert!(printed.contains(section), "{words} has no {section}");
        }
        // Those within `photos` have none in their help.
        let has_examples = printed.contains(".SH EXAMPLE");
        assert!(has_examples || words.contains(' '), "{words}");
    }
    wanted.sort();
    assert_eq!(names(at), wanted);
    for words in ["man no-such-command", "man photos no-such-command"] {
        let run = expect(at, 2, words);
        assert!(run.err.contains("no-such-command"), "{}", run.err);
    }
    expect(at, 1, "man --output none");
}

/// Types of `packaging/mime.xml`, each with its endings.
fn types() -> Vec<(String, Vec<String>)> {
    let text = read("packaging/mime.xml");
    let document = roxmltree::Document::parse(&text).unwrap();
    let types = document
        .descendants()
        .filter(|n| n.has_tag_name((NAMESPACE, "mime-type")));
    types
        .map(|node| {
            let globs = node.children().filter_map(|n| n.attribute("pattern"));
            let endings = globs.map(|glob| glob.strip_prefix("*.").unwrap().to_owned());
            (
                node.attribute("type").unwrap().to_owned(),
                endings.collect(),
            )
        })
        .collect()
}

const NAMESPACE: &str = "http://www.freedesktop.org/standards/shared-mime-info";

#[test]
fn types_of_files_are_what_the_program_reads() {
    let types = types();
    for entry in ["surfel.desktop", "surfel.thumbnailer"] {
        let listed = value(&read(&format!("packaging/{entry}")), "MimeType");
        let all: String = types.iter().map(|(name, _)| format!("{name};")).collect();
        assert_eq!(listed, all, "{entry}");
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let is_known = |name: &str| {
        let run = expect(at, 2, &format!("info {name}"));
        !["not a model in a known format", "is not read yet"]
            .iter()
            .any(|r| run.err.contains(r))
    };
    // What says nothing: the ending decides. Trees are decided by their first bytes alone.
    let endings: BTreeSet<String> = types.into_iter().flat_map(|(_, endings)| endings).collect();
    for ending in &endings {
        let name = format!("a.{ending}");
        let bytes: &[u8] = match ending.as_str() {
            "surfel" => b"surfel\x1a\n",
            "qs" => b"QSplat11",
            gzipped if gzipped.ends_with(".gz") => &[
                0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 0x63, 0, 0, 0x8d, 0xef, 2, 0xd2, 1, 0, 0, 0,
            ],
            _ => &[0, 1, 2],
        };
        std::fs::write(at.join(&name), bytes).unwrap();
        assert!(is_known(&name), "{name}");
    }
    std::fs::write(at.join("a.other"), [0, 1, 2]).unwrap();
    assert!(!is_known("a.other"));
    // And nothing of the list of formats is missing but text of any purpose.
    for ending in "obj ply stl off tri gltf glb las laz e57 pcd xyz pts ptx qs surfel".split(' ') {
        assert!(endings.contains(ending), "{ending}");
    }
}

#[test]
fn the_thumbnailer_makes_a_square_picture_and_says_nothing() {
    let entry = read("packaging/surfel.thumbnailer");
    let line = value(&entry, "Exec");
    // Both begin something else for those who read the line.
    assert!(!line.contains(['#', '"']), "{line}");
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate sphere --triangles 200 -o ball.ply");
    std::fs::rename(at.join("ball.ply"), at.join("a ball.ply")).unwrap();
    let mut words = line.split(' ').map(|word| match word {
        "%i" => "a ball.ply".to_owned(),
        "%o" => "a picture.png".to_owned(),
        word => word.replace("%s", "64"),
    });
    assert_eq!(words.next().unwrap(), "surfel");
    let mut command = command();
    command.args(words).current_dir(at);
    let run = run_with(command, None);
    assert_eq!((run.code, run.err.as_str(), run.out.len()), (0, "", 0));
    let picture = image::open(at.join("a picture.png")).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (64, 64));
    let colors: BTreeSet<_> = picture.pixels().map(|p| p.0).collect();
    assert!(colors.len() > 10, "{} colors", colors.len());
}

#[test]
fn icons_are_those_of_the_drawing() {
    use resvg::{tiny_skia, usvg};
    let drawing = usvg::Tree::from_str(&read("packaging/icon.svg"), &Default::default()).unwrap();
    for side in [48_u32, 256] {
        let mut drawn = tiny_skia::Pixmap::new(side, side).unwrap();
        let scale = side as f32 / drawing.size().width();
        let scaled = tiny_skia::Transform::from_scale(scale, scale);
        resvg::render(&drawing, scaled, &mut drawn.as_mut());
        let path = root().join(format!("packaging/icon-{side}.png"));
        if std::env::var_os("SURFEL_BLESS").is_some_and(|v| v == "1") {
            drawn.save_png(&path).unwrap();
        }
        let kept = tiny_skia::Pixmap::load_png(&path).unwrap();
        // Another version of the drawing library may round edges otherwise.
        let far = kept.data().iter().zip(drawn.data());
        let far = far.filter(|(a, b)| a.abs_diff(**b) > 8).count();
        assert!(far * 100 < kept.data().len(), "{side}: {far} bytes differ");
    }
}

/// Version in a `Cargo.toml`.
fn version_in(file: &str) -> String {
    let text = read(file);
    let line = text.lines().find_map(|l| l.strip_prefix("version = "));
    line.unwrap_or_else(|| panic!("{file} has no version"))
        .trim_matches('"')
        .to_owned()
}

#[test]
fn versions_of_program_and_package_agree() {
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(version_in("Cargo.toml"), version);
    assert_eq!(version_in("python/Cargo.toml"), version);
    let locked = format!("name = \"surfel\"\nversion = \"{version}\"\n");
    assert!(read("python/Cargo.lock").contains(&locked), "{locked}");
    assert!(read("CHANGELOG.md").contains(version));
    let folder = tempfile::tempdir().unwrap();
    let told = expect(folder.path(), 0, "-V").text();
    assert_eq!(told, format!("surfel {version}\n"));
}

#[test]
fn options_of_the_python_package_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let help = expect(folder.path(), 0, "render --help").text();
    let stub = read("python/package/surfel/__init__.pyi");
    let rules = read("python/src/look.rs");
    let (_, look) = stub.split_once("class Look(").unwrap();
    let (look, _) = look.split_once("class Statistics(").unwrap();
    let mut options = 0;
    for line in look
        .lines()
        .filter(|l| l.starts_with("    ") && l.contains(": "))
    {
        let (name, _) = line.trim().split_once(": ").unwrap();
        // `colors=False` is `--no-colors`.
        let option = match name {
            "colors" => "--no-colors".to_owned(),
            name => format!("--{}", name.replace('_', "-")),
        };
        assert!(help.contains(&option), "{option}");
        assert!(rules.contains(&format!("\"{name}\" =>")), "{name}");
        options += 1;
    }
    assert!(options > 15, "{options}");
    let words = look
        .split('"')
        .skip(1)
        .step_by(2)
        .filter(|w| !w.contains('`'));
    for word in words.filter(|w| !w.is_empty() && !w.contains(char::is_whitespace)) {
        assert!(help.contains(word), "{word}");
        assert!(rules.contains(&format!("\"{word}\"")), "{word}");
    }
}
