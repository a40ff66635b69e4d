//! Sizes that a reader can hold: fields of a type, lines of a function. What is larger is counted, and the number only goes
//! down.

use super::sources;
use std::collections::BTreeMap;

/// Types have at most so many fields.
const MOST_FIELDS: usize = 15;

/// Types that have more. To be lowered with each that is split, never raised.
const LARGE_TYPES: usize = 26;

/// Functions have at most so many lines, the first and the last counted.
const MOST_LINES: usize = 80;

/// Functions that have more, likewise.
const LONG_FUNCTIONS: usize = 88;

/// A block of formatted code: what its first line declares, and the lines between its braces.
struct CodeBlock<'a> {
    name: &'a str,
    inside: &'a [&'a str],
    /// Lines from the first to the closing brace.
    lines: usize,
}

/// The name that a line declares with `fn ` or `struct `, whatever stands before it.
fn declared<'a>(line: &'a str, keyword: &str) -> Option<&'a str> {
    let mut rest = line.trim_start();
    loop {
        if let Some(name) = rest.strip_prefix(keyword) {
            let end = name.find(|c: char| !super::is_word(c));
            return Some(&name[..end.unwrap_or(name.len())]);
        }
        // `pub(in crate::a)`, `const` and the like.
        let (word, behind) = match rest.strip_prefix("pub(") {
            Some(inside) => ("pub", inside.split_once(") ")?.1),
            None => rest.split_once(' ')?,
        };
        let is_before = |c: char| c.is_ascii_lowercase() || "\"C".contains(c);
        rest = word.chars().all(is_before).then_some(behind)?;
    }
}

/// The blocks that `keyword` declares, each closed by a brace as far in as it begins.
fn blocks<'a>(lines: &'a [&'a str], keyword: &str) -> Vec<CodeBlock<'a>> {
    let mut found = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let Some(name) = declared(line, keyword) else {
            continue;
        };
        let is_end = |line: &&str| line.trim_end().ends_with(['{', ';', '}']);
        let Some(open) = lines[first..].iter().position(is_end) else {
            continue;
        };
        if !lines[first + open].trim_end().ends_with('{') {
            continue;
        }
        let indent = &line[..line.len() - line.trim_start().len()];
        let is_close = |line: &&str| line.strip_prefix(indent) == Some("}");
        let rest = &lines[first + open + 1..];
        let inside = &rest[..rest.iter().position(is_close).unwrap_or(0)];
        found.push(CodeBlock {
            name,
            inside,
            lines: open + inside.len() + 2,
        });
    }
    found
}

/// Fields in the lines of a type: what is named one step further in than its first line.
fn fields(block: &CodeBlock<'_>) -> usize {
    let depth = |line: &str| line.len() - line.trim_start().len();
    let first = block.inside.iter().find(|line| !line.trim().is_empty());
    let indent = first.map_or(0, |line| depth(line));
    let is_field = |line: &&&str| {
        let line = line.trim_start();
        let line = match line.strip_prefix("pub(") {
            Some(rest) => rest.split_once(") ").map_or("", |(_, name)| name),
            None => line.strip_prefix("pub ").unwrap_or(line),
        };
        let end = line.find(|c: char| !super::is_word(c)).unwrap_or(0);
        end > 0 && line[end..].starts_with(':') && !line[end..].starts_with("::")
    };
    let lines = block.inside.iter().filter(|line| depth(line) == indent);
    lines.filter(is_field).count()
}

/// What is too large, as `file: name has so many`.
fn too_large(
    sources: &BTreeMap<String, String>,
    keyword: &str,
    most: usize,
    size: impl Fn(&CodeBlock<'_>) -> usize,
) -> Vec<String> {
    let is_code = |file: &&String| !file.contains("/tests") && !file.contains("for_tests");
    let mut found = Vec::new();
    for file in sources.keys().filter(is_code) {
        let lines: Vec<&str> = sources[file].lines().collect();
        for block in blocks(&lines, keyword) {
            let has = size(&block);
            if has > most {
                found.push(format!("{file}: {} has {has}", block.name));
            }
        }
    }
    found
}

fn large_types(sources: &BTreeMap<String, String>) -> Vec<String> {
    too_large(sources, "struct ", MOST_FIELDS, fields)
}

fn long_functions(sources: &BTreeMap<String, String>) -> Vec<String> {
    too_large(sources, "fn ", MOST_LINES, |block| block.lines)
}

#[test]
fn types_have_few_fields() {
    let found = large_types(&sources());
    assert_eq!(found.len(), LARGE_TYPES, "{found:#?}");
}

#[test]
fn functions_are_short() {
    let found = long_functions(&sources());
    assert_eq!(found.len(), LONG_FUNCTIONS, "{found:#?}");
}

#[test]
fn large_types_and_long_functions_are_seen() {
    let of = |code: String| BTreeMap::from([("src/a.rs".to_owned(), code)]);
    let with_fields = |count: usize| {
        let fields: String = (0..count)
            .map(|i| format!("    pub(crate) field_{i}: std::fs::File,\n"))
            .collect();
        of(format!(
            "pub struct Large<T> {{\n{fields}}}\nstruct Small(u8);\n"
        ))
    };
    assert!(large_types(&with_fields(MOST_FIELDS)).is_empty());
    let found = large_types(&with_fields(MOST_FIELDS + 1));
    assert_eq!(found, ["src/a.rs: Large has 16"]);
    let with_lines = |count: usize| {
        let lines = "        if a {}\n".repeat(count - 5);
        let signature = "    pub(super) const fn long(\n        a: bool,\n    ) -> u8 {\n";
        of(format!(
            "impl A {{\n{signature}{lines}        1\n    }}\n    fn short() {{}}\n}}\n"
        ))
    };
    assert!(long_functions(&with_lines(MOST_LINES)).is_empty());
    let found = long_functions(&with_lines(MOST_LINES + 1));
    assert_eq!(found, ["src/a.rs: long has 81"]);
}
