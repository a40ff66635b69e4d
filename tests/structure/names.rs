//! Names of types: two words or more, and each but once.

use super::{is_word, sources};
use std::collections::BTreeMap;

/// Nouns of the field that are clear alone.
const NOUNS: &[&str] = &[
    "Backend",
    "Camera",
    "Cut",
    "Engine",
    "Frustum",
    "Gpu",
    "Image",
    "Leaf",
    "Mesh",
    "Model",
    "Node",
    "Plane",
    "Settings",
    "Sphere",
    "Splat",
    "Technique",
    "Tree",
    "Triangle",
    "Vertex",
    "View",
];

/// Other types whose name is one word. To be lowered with each that gets a better one, never raised.
const ONE_WORD: usize = 13;

/// Names that more than one type has, likewise.
const SHARED: usize = 1;

/// The names of all types and how many have each.
fn names(sources: &BTreeMap<String, String>) -> BTreeMap<String, usize> {
    let mut names = BTreeMap::new();
    let is_code = |file: &&String| !file.contains("/tests");
    for file in sources.keys().filter(is_code) {
        for line in sources[file].lines() {
            let line = line.trim_start();
            let line = match line.strip_prefix("pub") {
                Some(rest) if rest.starts_with('(') => rest.split_once(") ").map_or("", |r| r.1),
                Some(rest) => rest.trim_start(),
                None => line,
            };
            let keywords = ["struct ", "enum ", "trait ", "union "];
            let Some(rest) = keywords
                .iter()
                .find_map(|keyword| line.strip_prefix(keyword))
            else {
                continue;
            };
            let name: String = rest.chars().take_while(|c| is_word(*c)).collect();
            *names.entry(name).or_default() += 1;
        }
    }
    names
}

fn is_one_word(name: &str) -> bool {
    name.chars().filter(char::is_ascii_uppercase).count() < 2
}

#[test]
fn types_have_names_of_two_words_and_of_their_own() {
    let names = names(&sources());
    let one_word: Vec<&str> = (names.keys().map(String::as_str))
        .filter(|name| is_one_word(name) && !NOUNS.contains(name))
        .collect();
    assert_eq!(one_word.len(), ONE_WORD, "{one_word:?}");
    let shared: Vec<&String> = names
        .iter()
        .filter(|(_, n)| **n > 1)
        .map(|(name, _)| name)
        .collect();
    assert_eq!(shared.len(), SHARED, "{shared:?}");
}

#[test]
fn names_are_read() {
    let code =
        "pub struct One;\npub(super) enum TwoWords {\n}\n  trait One {}\nlet structure = 1;\n";
    let found = names(&[("src/a.rs".to_owned(), code.to_owned())].into());
    let wanted = [("One".to_owned(), 2), ("TwoWords".to_owned(), 1)];
    assert_eq!(found, wanted.into());
    assert!(is_one_word("One") && !is_one_word("TwoWords"));
}
