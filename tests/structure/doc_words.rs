//! First words of documentation: it begins with a noun or a verb, not with a pronoun or a question.

use super::{files, is_word, text};

/// Words that a comment of documentation does not begin with.
const NOT_FIRST: &[&str] = &[
    "As", "How", "It", "Its", "That", "Their", "These", "They", "This", "Those", "We", "What",
    "Where", "Whether", "Which",
];

/// Comments that do. To be lowered with each that is mended, never raised.
const WRONG: usize = 1201;

/// Line numbers of documentation that begins with one of those words, in front of the unit tests of a file.
fn wrong_lines(source: &str) -> Vec<usize> {
    let words = |line: &str| {
        let line = line.trim_start();
        let rest = line.strip_prefix("///").or(line.strip_prefix("//!"))?;
        (!rest.starts_with('/')).then(|| rest.trim_start().to_owned())
    };
    let code = source.split("\n#[cfg(test)]\nmod tests {").next();
    let (mut wrong, mut is_inside) = (Vec::new(), false);
    for (index, line) in code.unwrap_or_default().lines().enumerate() {
        let Some(rest) = words(line) else {
            is_inside = false;
            continue;
        };
        let end = rest.find(|c: char| !is_word(c)).unwrap_or(rest.len());
        if !is_inside && NOT_FIRST.contains(&&rest[..end]) {
            wrong.push(index + 1);
        }
        is_inside = true;
    }
    wrong
}

#[test]
fn documentation_begins_with_a_noun_or_a_verb() {
    let files = files("src", &["rs"]).into_iter();
    let files = files.filter(|file| !file.contains("/tests") && !file.contains("for_tests"));
    let mut found = Vec::new();
    for file in files {
        let wrong = wrong_lines(&text(&file));
        found.extend(wrong.iter().map(|line| format!("{file}:{line}")));
    }
    assert_eq!(found.len(), WRONG, "{found:#?}");
}

#[test]
fn wrong_first_words_are_seen() {
    let source = "//! What this is.\n\n/// A noun.\n/// It is one.\n/// Itself.\nfn a() {}\n    /// Its name.\n    b: u8,\n\
        // What it is.\n//// What it was.\n#[cfg(test)]\nmod tests {\n    /// This is not read.\n}\n";
    assert_eq!(wrong_lines(source), [1, 7]);
}
