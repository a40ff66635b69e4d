//! The shape of the crate: which folder may know which, what the documents name, where `unsafe` may stand, how
//! long a file may be. Read from the sources as text, so that a wrong turn is found before it is built upon.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "structure/circles.rs"]
mod circles;
#[path = "structure/doc_words.rs"]
mod doc_words;
#[path = "structure/names.rs"]
mod names;
#[path = "structure/parameters.rs"]
mod parameters;
#[path = "structure/sizes.rs"]
mod sizes;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A folder (or file) of `src`, what it may use, and why where the way of the data alone does not say it.
///
/// The order is the way of the data, bottom first: a row may name only rows above it, so the arrows cannot
/// form a circle. What is on top (`viewer`, `cli`, `error`) may use all of the library.
struct Layer {
    name: &'static str,
    may_use: &'static [&'static str],
}

const fn layer(name: &'static str, may_use: &'static [&'static str]) -> Layer {
    Layer { name, may_use }
}

const LAYERS: &[Layer] = &[
    layer("progress", &[]),
    layer("math", &[]),
    // Threads that frames share.
    layer("threads", &[]),
    layer("free_memory", &[]),
    // Vectors as wide as the processor has them.
    layer("simd", &[]),
    // Words out of files, fit to be shown.
    layer("printable", &[]),
    // Images on surfaces: what a mesh carries and every picture shows.
    layer("textures", &["math"]),
    layer("mesh", &["math", "textures"]),
    layer(
        "input",
        &["progress", "math", "printable", "mesh", "textures"],
    ),
    // `abi` is the bottom of the device's side. It takes `octahedral` for its constructors, nothing else.
    layer("abi", &["math"]),
    layer("generate", &["progress", "math", "mesh"]),
    // A scene is a mesh with a camera; who draws it builds the tree.
    layer("scenes", &["math", "mesh", "generate"]),
    // A model keeps its vertices as the records that shaders read, so that drawing copies nothing.
    layer("tree", &["progress", "math", "mesh", "textures", "abi"]),
    // The strips' exact size of a triangle reads those records.
    layer("cut", &["math", "threads", "simd", "tree", "abi"]),
    layer(
        "pack",
        &["math", "threads", "simd", "textures", "tree", "cut", "abi"],
    ),
    // Splats from vertices, cut at edges: polygons of a mesh, without a tree.
    layer("oriented", &["progress", "math", "mesh", "abi", "pack"]),
    layer("image", &["math", "mesh", "textures"]),
    // Records of nodes as oriented polygons, the cut by their errors, and an exact picture of it.
    layer(
        "patches",
        &[
            "progress", "math", "threads", "simd", "abi", "textures", "tree", "cut", "pack",
            "image",
        ],
    ),
    // Pages decode into the records of a tree and of its patches, and a cut of a page is a cut of its tree.
    layer(
        "pages",
        &[
            "progress",
            "math",
            "threads",
            "free_memory",
            "mesh",
            "abi",
            "tree",
            "cut",
            "patches",
        ],
    ),
    // Calibrated cameras and what a photograph shows of a surface: plain values, that every backend draws by.
    layer("projective", &["math", "simd"]),
    // Vulkan knows records and layouts, but neither trees nor meshes.
    // Threads copy what a graphics card reads.
    layer("gpu", &["threads", "abi"]),
    layer(
        "render",
        &[
            "progress",
            "math",
            "textures",
            "abi",
            "tree",
            "cut",
            "pages",
            "pack",
            "oriented",
            "image",
            "patches",
            "projective",
            "gpu",
        ],
    ),
    layer(
        "measure",
        &[
            "progress",
            "math",
            "abi",
            "tree",
            "cut",
            "pack",
            "image",
            "patches",
            "projective",
            "gpu",
            "render",
        ],
    ),
    // Calibrated photographs: their scenes know nothing of models; the look and its score draw one.
    layer(
        "photos",
        &[
            "progress",
            "math",
            "printable",
            "abi",
            "tree",
            "image",
            "projective",
            "gpu",
            "render",
            "measure",
        ],
    ),
    // Draws every scene by every method and measures the pictures.
    layer(
        "stability",
        &[
            "progress", "math", "scenes", "tree", "cut", "oriented", "image", "patches", "gpu",
            "render", "measure",
        ],
    ),
    // Lays what `measure` finds side by side.
    layer(
        "chart",
        &[
            "progress",
            "math",
            "projective",
            "printable",
            "mesh",
            "abi",
            "tree",
            "pages",
            "cut",
            "pack",
            "oriented",
            "image",
            "patches",
            "gpu",
            "render",
            "measure",
        ],
    ),
    // Measures whole frames of generated models, and holds them to bounds.
    layer(
        "bench",
        &[
            "progress", "math", "mesh", "input", "abi", "generate", "tree", "pages", "cut",
            "image", "patches", "gpu", "render", "measure", "chart",
        ],
    ),
    // Wraps the error of every layer; no layer may use it.
    layer(
        "error",
        &[
            "math",
            "input",
            "generate",
            "scenes",
            "tree",
            "image",
            "gpu",
            "measure",
            "photos",
            "stability",
            "chart",
            "bench",
        ],
    ),
    // The one door: what a name means, read and built. Its errors are those of the library.
    layer(
        "open",
        &[
            "progress",
            "math",
            "printable",
            "free_memory",
            "mesh",
            "input",
            "generate",
            "scenes",
            "tree",
            "pages",
            "photos",
            "error",
        ],
    ),
    layer(
        "viewer",
        &[
            "progress",
            "math",
            "printable",
            "mesh",
            "input",
            "abi",
            "generate",
            "tree",
            "cut",
            "pack",
            "oriented",
            "image",
            "projective",
            "gpu",
            "render",
            "measure",
            "photos",
            "bench",
            "error",
            "open",
        ],
    ),
    layer(
        "cli",
        &[
            "progress",
            "math",
            "mesh",
            "input",
            "abi",
            "generate",
            "scenes",
            "tree",
            "cut",
            "pack",
            "image",
            "patches",
            "projective",
            "gpu",
            "render",
            "measure",
            "photos",
            "stability",
            "chart",
            "bench",
            "error",
            "open",
            "viewer",
        ],
    ),
];

/// Layers that a build may be without.
const OPTIONAL: &[&str] = &["viewer"];

/// Files above this many lines are split by thought.
const LONGEST: usize = 600;

/// Known to be longer, and to be split; an entry that is no longer needed fails the test.
const OVERDUE: &[&str] = &[];

/// The folders in which `unsafe` may stand.
const UNSAFE: &[&str] = &["src/gpu/"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Files below `folder` (given from the root) with one of the endings, as paths from the root, sorted.
fn files(folder: &str, endings: &[&str]) -> Vec<String> {
    fn walk(at: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(at).unwrap_or_else(|e| panic!("{}: {e}", at.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&root().join(folder), &mut found);
    let mut names: Vec<String> = found
        .iter()
        .filter(|p| {
            p.extension()
                .is_some_and(|e| endings.iter().any(|wanted| e == *wanted))
        })
        .map(|p| {
            p.strip_prefix(root())
                .unwrap()
                .to_string_lossy()
                .replace('\\', "/")
        })
        .collect();
    names.sort();
    assert!(!names.is_empty(), "no file in {folder}");
    names
}

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// Source without comments and without the unit tests, which may look at whatever they like.
fn code(source: &str) -> String {
    let mut out = String::new();
    let mut lines = source.lines().peekable();
    while let Some(line) = lines.next() {
        let is_tests = line.starts_with("#[cfg(test)]")
            && lines
                .peek()
                .is_some_and(|next| next.starts_with("mod ") && next.ends_with('{'));
        if is_tests {
            // Formatted code: the block ends at the next brace in the first column.
            for inside in lines.by_ref() {
                if inside == "}" {
                    break;
                }
            }
            continue;
        }
        out.push_str(without_comment(line));
        out.push('\n');
    }
    out
}

/// A line up to `//`, unless that is the one of an address.
fn without_comment(line: &str) -> &str {
    match line.find("//") {
        Some(at) if at == 0 || !line[..at].ends_with(':') => &line[..at],
        _ => line,
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The first names of what follows `crate::`: one, or those of a group in braces.
fn names_after(rest: &str) -> Vec<String> {
    let name = |text: &str| -> String { text.chars().take_while(|c| is_word(*c)).collect() };
    let Some(group) = rest.strip_prefix('{') else {
        return vec![name(rest)];
    };
    let mut depth = 0;
    let mut names = Vec::new();
    let mut starts = true;
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => starts = true,
            c if starts && is_word(c) => {
                names.push(name(&group[at..]));
                starts = false;
            }
            _ => {}
        }
    }
    names
}

/// Every module of the root that a file names, by `crate::` or by enough `super::`.
fn used_modules(file: &str, code: &str) -> BTreeSet<String> {
    let inside = file.strip_prefix("src/").unwrap();
    // src/math.rs and src/math/mod.rs are one step below the root, src/math/cone.rs two.
    let depth = inside.split('/').count() - usize::from(inside.ends_with("/mod.rs"));
    let mut used = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        if !code[..at].ends_with(is_word) {
            used.extend(names_after(&code[at + "crate::".len()..]));
        }
    }
    for (at, _) in code.match_indices("super::") {
        let before = &code[..at];
        if before.ends_with("super::") || before.ends_with(is_word) {
            continue;
        }
        let mut rest = &code[at..];
        let mut steps = 0;
        while let Some(next) = rest.strip_prefix("super::") {
            rest = next;
            steps += 1;
        }
        if steps >= depth {
            used.extend(names_after(rest));
        }
    }
    used
}

/// The layer that a file belongs to; none for `lib.rs` and `main.rs`.
fn layer_of(file: &str) -> Option<&str> {
    let inside = file.strip_prefix("src/")?;
    let name = inside.split('/').next()?.trim_end_matches(".rs");
    (name != "lib" && name != "main").then_some(name)
}

/// Arrows that the table does not have, as sentences.
fn arrows_that_point_back(sources: &BTreeMap<String, String>) -> Vec<String> {
    let mut wrong = Vec::new();
    for (file, source) in sources {
        // Unit tests in a file of their own, as those at the end of one.
        if file.ends_with("/tests.rs") || file.contains("/tests/") {
            continue;
        }
        let Some(name) = layer_of(file) else { continue };
        let Some(layer) = LAYERS.iter().find(|l| l.name == name) else {
            wrong.push(format!("{file}: `{name}` is in no row of the table"));
            continue;
        };
        for used in used_modules(file, source) {
            let is_layer = LAYERS.iter().any(|l| l.name == used);
            // `crate::Error` is the one name of the root itself.
            let used = if used == "Error" { "error" } else { &used };
            if used != name && !layer.may_use.contains(&used) && (is_layer || used == "error") {
                wrong.push(format!("{file}: {name} must not know {used}"));
            }
        }
    }
    wrong
}

fn sources() -> BTreeMap<String, String> {
    files("src", &["rs"])
        .into_iter()
        .map(|file| (file.clone(), code(&text(&file))))
        .collect()
}

#[test]
fn the_table_of_layers_has_no_circle_and_knows_every_folder() {
    for (at, layer) in LAYERS.iter().enumerate() {
        for used in layer.may_use {
            assert!(
                LAYERS[..at].iter().any(|below| below.name == *used),
                "{} may use {used}, which is not below it",
                layer.name
            );
        }
    }
    let sources = sources();
    let there: BTreeSet<&str> = sources.keys().filter_map(|f| layer_of(f)).collect();
    for layer in LAYERS {
        assert!(
            there.contains(layer.name) || OPTIONAL.contains(&layer.name),
            "{} has a row and no file",
            layer.name
        );
    }
}

#[test]
fn no_arrow_points_back() {
    let wrong = arrows_that_point_back(&sources());
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn arrows_that_point_back_are_seen() {
    let see = |file: &str, source: &str| {
        arrows_that_point_back(&BTreeMap::from([(file.to_owned(), code(source))]))
    };
    for (file, source) in [
        ("src/math/cone.rs", "use crate::tree::Node;\n"),
        (
            "src/math/cone.rs",
            "use crate::{\n    math::sphere,\n    tree::{self, Node},\n};\n",
        ),
        ("src/math/cone.rs", "use super::super::tree::Node;\n"),
        ("src/math/mod.rs", "use super::tree;\n"),
        (
            "src/gpu/frame.rs",
            "fn f() { crate::mesh::normals::add(); }\n",
        ),
        ("src/cut/select.rs", "use crate::Error;\n"),
        (
            "src/tree/node.rs",
            "/// Text.\npub(crate) fn f(a: crate::cut::Cut) {}\n",
        ),
        ("src/new/mod.rs", "\n"),
    ] {
        assert_eq!(see(file, source).len(), 1, "{file}: {source}");
    }
    for (file, source) in [
        (
            "src/math/cone.rs",
            "/// As [`crate::tree::Node`].\nuse super::sphere; // crate::cut\n",
        ),
        (
            "src/tree/node.rs",
            "#[cfg(test)]\nmod tests {\n    use crate::cut::Cut;\n}\n",
        ),
        (
            "src/tree/node.rs",
            "#[cfg(test)]\nmod tests {\n    use super::*;\n}\nuse crate::math::cone;\n",
        ),
        (
            "src/cut/select.rs",
            "use crate::{math::{camera, cut}, tree};\nuse super::Cut;\n",
        ),
        ("src/tree/node/tests.rs", "use crate::cut::Cut;\n"),
    ] {
        assert_eq!(see(file, source), Vec::<String>::new(), "{source}");
    }
    // What comes after the tests counts again.
    let late = "#[cfg(test)]\nmod tests {\n}\nuse crate::cut::Cut;\n";
    assert_eq!(see("src/tree/node.rs", late).len(), 1);
}

/// A folder below `src/render` and what it must not name.
struct Backend {
    folder: &'static str,
    unknown: &'static [&'static str],
}

/// No backend knows another, and only that of Vulkan knows a device.
const BACKENDS: &[Backend] = &[
    Backend {
        folder: "src/render/cpu",
        unknown: &[
            "crate::gpu",
            "crate::render::vulkan",
            "crate::render::reference",
            "crate::render::engine",
        ],
    },
    Backend {
        folder: "src/render/reference",
        unknown: &[
            "crate::gpu",
            "crate::render::vulkan",
            "crate::render::cpu",
            "crate::render::engine",
            "crate::render::cost",
        ],
    },
    Backend {
        folder: "src/render/cost",
        unknown: &[
            "crate::gpu",
            "crate::render::vulkan",
            "crate::render::cpu",
            "crate::render::reference",
            "crate::render::engine",
        ],
    },
    Backend {
        folder: "src/render/vulkan",
        unknown: &[
            "crate::render::cpu",
            "crate::render::reference",
            "crate::render::engine",
        ],
    },
];

/// Files of a backend's folder that name what they must not, in the order of their names; tests may compare backends.
fn files_that_know_another(backend: &Backend, sources: &BTreeMap<String, String>) -> Vec<String> {
    let is_own = |file: &&String| file.starts_with(backend.folder) && !file.contains("/tests");
    let files = sources.keys().filter(is_own);
    let knows = |file: &&String| {
        let code = code(&sources[*file]);
        backend.unknown.iter().any(|name| code.contains(name))
    };
    files.filter(knows).cloned().collect()
}

#[test]
fn no_backend_knows_another() {
    let sources = sources();
    for backend in BACKENDS {
        assert!(
            root().join(backend.folder).is_dir(),
            "{} is not there",
            backend.folder
        );
        let found = files_that_know_another(backend, &sources);
        assert!(found.is_empty(), "{}: {found:?}", backend.folder);
    }
}

#[test]
fn a_backend_that_knows_another_is_seen() {
    let mut sources = BTreeMap::new();
    for (name, text) in [
        ("a.rs", "use crate::gpu::Gpu;\n"),
        ("b.rs", "// crate::gpu\nuse crate::math;\n"),
        ("c.rs", "mod tests {\n}\n"),
    ] {
        sources.insert(format!("src/render/cpu/{name}"), text.to_owned());
    }
    let found = files_that_know_another(&BACKENDS[0], &sources);
    assert_eq!(found, ["src/render/cpu/a.rs"]);
}

#[test]
fn unsafe_stands_only_where_vulkan_is() {
    let has_unsafe = |code: &str| {
        code.match_indices("unsafe").any(|(at, word)| {
            !code[..at].ends_with(is_word) && !code[at + word.len()..].starts_with(is_word)
        })
    };
    assert!(has_unsafe("let a = unsafe { b };") && !has_unsafe("#![deny(unsafe_code)]"));
    let mut seen = 0;
    for folder in ["src", "tests", "examples", "benches"] {
        for file in files(folder, &["rs"]) {
            if file == "tests/structure.rs" {
                continue;
            }
            let source = text(&file);
            let all: String = source
                .lines()
                .map(|l| without_comment(l).to_owned() + "\n")
                .collect();
            if has_unsafe(&all) {
                assert!(
                    UNSAFE.iter().any(|allowed| file.starts_with(allowed)),
                    "{file} has `unsafe`"
                );
                seen += 1;
            }
        }
    }
    assert!(
        seen > 3,
        "only {seen} files with `unsafe`: the search is broken"
    );
}

#[test]
fn no_file_is_too_long_to_read() {
    let mut long = Vec::new();
    for file in files("src", &["rs"]) {
        let lines = text(&file).lines().count();
        if lines > LONGEST {
            if !OVERDUE.contains(&file.as_str()) {
                long.push(format!("{file}: {lines} lines"));
            }
        } else {
            assert!(
                !OVERDUE.contains(&file.as_str()),
                "{file} has {lines} lines; take it off the list"
            );
        }
    }
    assert!(long.is_empty(), "longer than {LONGEST} lines: {long:#?}");
}

#[test]
fn every_shader_is_used() {
    let code: String = sources()
        .iter()
        .filter(|(file, _)| *file != "src/abi.rs")
        .map(|(_, code)| code.as_str())
        .collect();
    let shaders = files("shaders", &["vert", "frag", "comp"]);
    for file in &shaders {
        let name = file.strip_prefix("shaders/").unwrap();
        let constant = name.replace(['/', '-', '.'], "_").to_uppercase();
        assert!(
            code.contains(&format!("shaders::{constant}")),
            "{file} is in no pipeline"
        );
    }
    // What is included is included by something; `build.rs` reads the constants.
    let mut including = text("build.rs");
    for file in files("shaders", &["vert", "frag", "comp", "glsl"]) {
        including += &text(&file);
    }
    for file in files("shaders", &["glsl"]) {
        let name = file.rsplit('/').next().unwrap();
        assert!(
            including.contains(&format!("/{name}\"")) || including.contains(&format!("\"{name}\"")),
            "{file} is included by nothing"
        );
    }
}

/// `shaders/points/draw.{vert,frag}` as two paths.
fn expanded(path: &str) -> Vec<String> {
    match (path.find('{'), path.find('}')) {
        (Some(open), Some(close)) if open < close => path[open + 1..close]
            .split(',')
            .flat_map(|part| {
                expanded(&format!(
                    "{}{}{}",
                    &path[..open],
                    part.trim(),
                    &path[close + 1..]
                ))
            })
            .collect(),
        _ => vec![path.to_owned()],
    }
}

/// Whether a word between backticks is meant as a path of this repository.
fn is_path(word: &str) -> bool {
    const ENDINGS: &[&str] = &[
        "rs", "vert", "frag", "comp", "glsl", "md", "toml", "sh", "lock", "json", "png",
    ];
    const TOPS: &[&str] = &[
        "src", "shaders", "tests", "assets", "docs", "benches", "examples", "scripts", ".ci",
    ];
    let is_plain = !word.is_empty() && word.chars().all(|c| is_word(c) || "/.-{},".contains(c));
    if !is_plain || word.starts_with('/') || word.starts_with("..") {
        return false;
    }
    let top = word.split('/').next().unwrap_or_default();
    let has_ending = word
        .trim_end_matches('}')
        .rsplit(['.', ',', '{'])
        .next()
        .is_some_and(|e| ENDINGS.contains(&e));
    if word.contains('/') {
        // Paths below src/ may leave that out: `gpu/frame.rs`.
        TOPS.contains(&top) || (has_ending && LAYERS.iter().any(|l| l.name == top))
    } else {
        [
            "build.rs",
            "Makefile",
            "Cargo.toml",
            "Cargo.lock",
            "clippy.toml",
        ]
        .contains(&word)
            || (word.ends_with(".md") && word.starts_with(char::is_uppercase))
    }
}

/// The paths that a document names between backticks (outside of fenced blocks: those are commands).
fn named_paths(document: &str) -> Vec<String> {
    let mut is_fenced = false;
    let mut paths = Vec::new();
    for line in document.lines() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
            continue;
        }
        if is_fenced {
            continue;
        }
        for code in line.split('`').skip(1).step_by(2) {
            for word in code.split_whitespace().filter(|w| is_path(w)) {
                paths.extend(expanded(word));
            }
        }
    }
    paths
}

#[test]
fn the_documents_name_only_what_is_there() {
    let example = "Look at `src/math/cone.rs`, `shaders/points/draw.{vert,frag}` and `-o FILE.png`.\n\
                   ```\n`src/in/a/block.rs`\n```\n`tests/` and `cargo test`; `gpu/frame.rs`, `a/b`, `../shared/x.ply`";
    assert_eq!(
        named_paths(example),
        [
            "src/math/cone.rs",
            "shaders/points/draw.vert",
            "shaders/points/draw.frag",
            "tests/",
            "gpu/frame.rs"
        ]
    );
    for document in documents() {
        let source = text(&document);
        let paths = named_paths(&source);
        let folder = Path::new(&document).parent().unwrap();
        for path in &paths {
            let places = [
                root().join(path),
                root().join("src").join(path),
                root().join(folder).join(path),
            ];
            assert!(
                places.iter().any(|p| p.exists()),
                "{document} names {path}, which is not there"
            );
        }
        let at_least = NAMES_AT_LEAST
            .iter()
            .find(|(name, _)| *name == document)
            .map_or(0, |(_, count)| *count);
        assert!(
            paths.len() >= at_least,
            "{document} names {} paths; the search or the document is broken",
            paths.len()
        );
        let wrong = broken_links(&source, folder);
        assert!(wrong.is_empty(), "{document}: {wrong:#?}");
    }
}

/// Documents that name paths of this repository, and how many at least.
const NAMES_AT_LEAST: &[(&str, usize)] = &[
    ("README.md", 1),
    ("CONTRIBUTING.md", 20),
    ("docs/ARCHITECTURE.md", 60),
    ("docs/METHODS.md", 5),
    ("docs/MEASURING.md", 3),
    ("docs/PERFORMANCE.md", 1),
];

/// The documents for people, as paths from the root.
fn documents() -> Vec<String> {
    let mut all = files("docs", &["md"]);
    all.extend(["README.md", "CONTRIBUTING.md", "assets/README.md"].map(str::to_owned));
    all
}

/// Links between brackets to files of this repository that are not there, or to a heading that the file does not have.
fn broken_links(source: &str, folder: &Path) -> Vec<String> {
    let mut wrong = Vec::new();
    for (at, _) in source.match_indices("](") {
        let target = source[at + 2..].split(')').next().unwrap_or_default();
        let (file, heading) = target.split_once('#').unwrap_or((target, ""));
        if target.contains(':') || target.contains(char::is_whitespace) {
            continue;
        }
        let path = root().join(folder).join(file);
        if !file.is_empty() && !path.exists() {
            wrong.push(format!("links to {file}, which is not there"));
        } else if !heading.is_empty() {
            let there = match file {
                "" => source.to_owned(),
                _ => std::fs::read_to_string(&path).unwrap_or_default(),
            };
            if !headings(&there).contains(heading) {
                wrong.push(format!("links to {target}, a heading that is not there"));
            }
        }
    }
    wrong
}

/// The headings of a document as links name them: small letters, `-` for spaces, nothing else but letters and digits.
fn headings(document: &str) -> BTreeSet<String> {
    document
        .lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| is_word(*c) || " -".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

#[test]
fn broken_links_are_seen() {
    let source =
        "# Some words, *and* more\n[a](#some-words-and-more) [b](src/lib.rs) [c](https://a.org/#x)";
    assert_eq!(broken_links(source, Path::new("")), Vec::<String>::new());
    let source = "# Some words\n[a](#other-words) [b](src/none.rs) [c](README.md#no-such-heading)";
    assert_eq!(broken_links(source, Path::new("")).len(), 3);
}

/// Most words that a document may have: one that says everything is read by nobody.
const MOST_WORDS: &[(&str, usize)] = &[
    ("README.md", 2700),
    ("CONTRIBUTING.md", 1500),
    ("docs/ARCHITECTURE.md", 2500),
    ("docs/PERFORMANCE.md", 3500),
];

/// Most words of README, CONTRIBUTING and everything in docs together.
const MOST_WORDS_TOGETHER: usize = 25_000;

/// Most words of a page in docs/experiments.
const MOST_WORDS_OF_AN_EXPERIMENT: usize = 300;

/// Words of a document; the bars of tables are none.
fn words(document: &str) -> usize {
    let is_one = |word: &&str| word.chars().any(char::is_alphanumeric);
    text(document).split_whitespace().filter(is_one).count()
}

#[test]
fn documents_keep_to_their_words() {
    let mut together = 0;
    for document in documents() {
        let count = words(&document);
        let most = match MOST_WORDS.iter().find(|(name, _)| *name == document) {
            Some((_, most)) => *most,
            None if document.starts_with("docs/experiments/") => MOST_WORDS_OF_AN_EXPERIMENT,
            None => MOST_WORDS_TOGETHER,
        };
        assert!(
            count <= most,
            "{document} has {count} words, more than {most}"
        );
        if document != "assets/README.md" {
            together += count;
        }
    }
    assert!(
        together <= MOST_WORDS_TOGETHER,
        "the documents have {together} words together, more than {MOST_WORDS_TOGETHER}"
    );
    assert!(
        together > 10_000,
        "only {together} words: the search is broken"
    );
}

/// Folders of `src`, two levels deep, that hold more than unit tests.
fn folders_of_src() -> BTreeSet<String> {
    files("src", &["rs", "html"])
        .iter()
        .filter(|file| !file.ends_with("/tests.rs") && !file.contains("/tests/"))
        .filter_map(|file| {
            let parts: Vec<_> = file.split('/').collect();
            (parts.len() > 2).then(|| parts[..parts.len().min(4) - 1].join("/"))
        })
        .collect()
}

#[test]
fn the_architecture_names_every_folder_of_src() {
    let folders = folders_of_src();
    assert!(
        folders.contains("src/render/vulkan") && folders.contains("src/cut") && folders.len() > 30,
        "the search is broken: {folders:#?}"
    );
    let named: BTreeSet<_> = named_paths(&text("docs/ARCHITECTURE.md"))
        .into_iter()
        .collect();
    let missing: Vec<_> = folders.iter().filter(|f| !named.contains(*f)).collect();
    assert!(
        missing.is_empty(),
        "docs/ARCHITECTURE.md leaves out {missing:#?}"
    );
}

/// The code lines of a Rust example in a document, without blank lines and comments.
fn example(document: &str, fence: &str) -> Vec<String> {
    let after = document.split(fence).nth(1).unwrap_or_default();
    let block = after.split("```").next().unwrap_or_default();
    block
        .lines()
        .map(|line| line.trim_start_matches("//!").trim().to_owned())
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .collect()
}

#[test]
fn the_library_example_is_short_and_the_same_everywhere() {
    const MOST_LINES: usize = 12;
    let readme = example(&text("README.md"), "```rust\n");
    assert_eq!(readme, example(&text("src/lib.rs"), "```no_run\n"));
    let program: Vec<_> = text("examples/headless.rs")
        .lines()
        .map(str::to_owned)
        .collect();
    let start = program.iter().position(|l| l.starts_with("use ")).unwrap();
    let program = example(&format!("#{}", program[start..].join("\n")), "#");
    for (name, lines) in [("README.md", &readme), ("examples/headless.rs", &program)] {
        assert!(
            (5..=MOST_LINES).contains(&lines.len()) && lines.iter().any(|l| l.contains("::open(")),
            "the example of {name} has {} lines, or does not open a model",
            lines.len()
        );
    }
}

/// Files that may read a model file or a tree file themselves: the door, and the layers below it.
const BEHIND_THE_DOOR: &[&str] = &["src/open", "src/input/", "src/tree/"];

#[test]
fn models_are_opened_through_the_one_door() {
    let reads = |code: &str| {
        [
            "input::load",
            "load_stream(",
            "tree::file::read",
            "file::read_from(",
        ]
        .iter()
        .any(|name| code.contains(name))
    };
    let mut behind = 0;
    for (file, code) in sources() {
        // Unit tests in a file of their own may look at whatever they like.
        if !reads(&code) || file.ends_with("/tests.rs") {
            continue;
        }
        assert!(
            BEHIND_THE_DOOR.iter().any(|place| file.starts_with(place)),
            "{file} opens a model beside `surfel::open`"
        );
        behind += 1;
    }
    assert!(behind > 0, "the search is broken");
}

/// The files that a checkout has: those of the index where git is there, else the folders of the crate.
fn tracked() -> Vec<String> {
    let listed = std::process::Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(root())
        .output();
    if let Ok(listed) = listed
        && listed.status.success()
        && !listed.stdout.is_empty()
    {
        return String::from_utf8_lossy(&listed.stdout)
            .split('\0')
            .filter(|f| !f.is_empty() && root().join(f).is_file())
            .map(str::to_owned)
            .collect();
    }
    let endings = [
        "rs", "md", "sh", "toml", "json", "vert", "frag", "comp", "glsl",
    ];
    [
        "src", "shaders", "tests", "assets", "benches", "examples", "scripts",
    ]
    .iter()
    .flat_map(|folder| files_or_none(folder, &endings))
    .collect()
}

fn files_or_none(folder: &str, endings: &[&str]) -> Vec<String> {
    if root().join(folder).is_dir() {
        files(folder, endings)
    } else {
        Vec::new()
    }
}

/// The first path of somebody's own machine in a text.
fn private_path(text: &str) -> Option<&str> {
    // Put together here, so that this file does not find itself.
    let folders = ["work", "tmp", "root", "home", "Users"].map(|name| format!("/{name}/"));
    folders.iter().find_map(|folder| {
        text.match_indices(folder.as_str()).find_map(|(at, _)| {
            // `target/tmp/x` and `https://host/home/` are no paths from the root.
            let is_absolute = !text[..at].ends_with(|c: char| is_word(c) || "./~})-$*".contains(c));
            is_absolute.then(|| text[at..].split_whitespace().next().unwrap_or_default())
        })
    })
}

#[test]
fn nothing_names_a_folder_of_one_machine() {
    let planted = format!("see /{}/x for it", "work");
    assert!(private_path(&planted).is_some());
    assert_eq!(private_path("target/tmp/x, https://a.org/home/x"), None);
    let files = tracked();
    assert!(files.len() > 50, "only {} files", files.len());
    let mut wrong = Vec::new();
    for file in files {
        // What is no text names nothing.
        let Ok(source) = std::fs::read_to_string(root().join(&file)) else {
            continue;
        };
        for (number, line) in source.lines().enumerate() {
            if let Some(path) = private_path(line) {
                wrong.push(format!("{file}:{}: {path}", number + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
