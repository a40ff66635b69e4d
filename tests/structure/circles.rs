//! No circles between files: what two files share is in a third.

use super::{is_word, sources};
use std::collections::{BTreeMap, BTreeSet};

/// Circles that are still to be opened, each by its first file.
const OVERDUE: &[&str] = &[
    "src/cut/batch.rs",
    "src/cut/coherent.rs",
    "src/input/ply/columns.rs",
    "src/pack/filtered.rs",
    "src/pack/parallel.rs",
    "src/pack/small_triangles.rs",
    "src/render/cpu/filtered.rs",
    "src/render/cpu/float_planes.rs",
    "src/render/reference/fuzzy.rs",
    "src/tree/build.rs",
];

/// A module's path without `crate`: of `src/cut/mod.rs` and `src/cut.rs` it is `["cut"]`.
fn module_of(file: &str) -> Vec<String> {
    let path = file.trim_start_matches("src/").trim_end_matches(".rs");
    let path = path.trim_end_matches("/mod").trim_end_matches("lib");
    let parts = path.split('/').filter(|part| !part.is_empty());
    parts.map(str::to_owned).collect()
}

/// The paths of a tree of imports: `a::{b, c::d}` has `a::b` and `a::c::d`.
fn paths_of(tree: &str) -> Vec<String> {
    let Some((before, group)) = tree.split_once('{') else {
        let end = tree.find(" as ").unwrap_or(tree.len());
        return vec![tree[..end].trim().to_owned()];
    };
    let group = group.rsplit_once('}').map_or(group, |(inside, _)| inside);
    let (mut depth, mut first, mut parts) = (0, 0, Vec::new());
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&group[first..at]);
                first = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&group[first..]);
    let parts = parts.into_iter().filter(|part| !part.trim().is_empty());
    parts
        .flat_map(paths_of)
        .map(|path| format!("{}{path}", before.trim()))
        .collect()
}

/// Paths that some code names: those of its imports, and those that begin with `crate::` elsewhere.
fn named_paths(code: &str) -> Vec<String> {
    let imports = code
        .split("use ")
        .skip(1)
        .filter_map(|rest| rest.split_once(';'));
    let mut paths: Vec<String> = imports.flat_map(|(tree, _)| paths_of(tree)).collect();
    let inline = code.split("crate::").skip(1);
    paths.extend(inline.map(|rest| {
        let end = rest
            .find(|c| !(is_word(c) || c == ':'))
            .unwrap_or(rest.len());
        format!("crate::{}", &rest[..end])
    }));
    paths
}

/// The files that each file uses.
fn used_files(sources: &BTreeMap<String, String>) -> BTreeMap<&str, BTreeSet<&str>> {
    let is_code = |file: &&String| !file.contains("/tests") && !file.contains("for_tests");
    let files: Vec<&String> = sources.keys().filter(is_code).collect();
    let modules: BTreeMap<Vec<String>, &str> = files
        .iter()
        .map(|file| (module_of(file), file.as_str()))
        .collect();
    let mut used = BTreeMap::new();
    for (own, file) in &modules {
        let mut of_file = BTreeSet::new();
        for path in named_paths(&sources[*file]) {
            let mut parts: Vec<&str> = path.split("::").map(str::trim).collect();
            let mut whole: Vec<String> = own.clone();
            match parts[0] {
                "crate" => whole.clear(),
                "super" => {}
                _ => continue,
            }
            while parts.first().is_some_and(|part| *part == "super") {
                whole.pop();
                parts.remove(0);
            }
            whole.extend(
                parts
                    .iter()
                    .filter(|part| **part != "crate")
                    .map(|p| (*p).to_owned()),
            );
            // The longest beginning that is a module.
            while !whole.is_empty() && !modules.contains_key(&whole) {
                whole.pop();
            }
            if let Some(other) = modules.get(&whole).filter(|other| *other != file) {
                of_file.insert(*other);
            }
        }
        used.insert(*file, of_file);
    }
    used
}

/// Files that reach each other, circle by circle.
fn circles(sources: &BTreeMap<String, String>) -> Vec<Vec<String>> {
    let used = used_files(sources);
    let reached: BTreeMap<&str, BTreeSet<&str>> = used
        .keys()
        .map(|file| {
            let (mut reached, mut open) = (BTreeSet::new(), vec![*file]);
            while let Some(next) = open.pop() {
                for other in &used[next] {
                    if reached.insert(*other) {
                        open.push(other);
                    }
                }
            }
            (*file, reached)
        })
        .collect();
    let mut found: Vec<Vec<String>> = Vec::new();
    for (file, others) in &reached {
        let is_known = found.iter().any(|circle| circle.iter().any(|f| f == file));
        if others.contains(file) && !is_known {
            let of_circle = others
                .iter()
                .filter(|other| reached[**other].contains(file));
            found.push(of_circle.map(|f| (*f).to_owned()).collect());
        }
    }
    found
}

#[test]
fn files_have_no_circles() {
    let found = circles(&sources());
    let firsts: Vec<&str> = found.iter().map(|circle| circle[0].as_str()).collect();
    assert_eq!(firsts, OVERDUE, "{found:#?}");
}

#[test]
fn circles_are_seen() {
    let of = |pairs: &[(&str, &str)]| -> Vec<Vec<String>> {
        let own = |(file, code): &(&str, &str)| (format!("src/{file}"), (*code).to_owned());
        circles(&pairs.iter().map(own).collect())
    };
    let a = ("a.rs", "use crate::b::{self, Thing};\n");
    let c = ("c/mod.rs", "fn f() { crate::a::g(); }\n");
    assert!(of(&[a, c, ("b.rs", "use std::fs;\n")]).is_empty());
    let found = of(&[a, c, ("b.rs", "use crate::{\n    c::{Other, More},\n};\n")]);
    assert_eq!(found, [["src/a.rs", "src/b.rs", "src/c/mod.rs"]]);
    let found = of(&[
        ("d/mod.rs", "mod e;\nuse super::d::e::X;\n"),
        ("d/e.rs", "use super::Y;\n"),
    ]);
    assert_eq!(found, [["src/d/e.rs", "src/d/mod.rs"]]);
}
