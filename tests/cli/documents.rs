//! Command lines of the documents: the program has each subcommand and each long option that they name.

use crate::harness::surfel;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Names in a help text: subcommands, and long options with their dashes.
#[derive(Debug, Default)]
struct HelpText {
    commands: BTreeSet<String>,
    options: BTreeSet<String>,
}

/// Help texts, each asked for once, by the words of their command.
#[derive(Debug, Default)]
struct AskedHelp {
    texts: BTreeMap<Vec<String>, HelpText>,
}

impl HelpText {
    /// Reads a text: commands are in their section, options begin a line of another one.
    fn of(text: &str) -> Self {
        let mut help = Self::default();
        let mut is_of_commands = false;
        for line in text.lines() {
            if !line.starts_with(' ') {
                is_of_commands = line.starts_with("Commands:");
                continue;
            }
            let Some(first) = line.split_whitespace().next() else {
                continue;
            };
            if is_of_commands && line.starts_with("  ") && !line.starts_with("   ") {
                help.commands.insert(first.to_owned());
            }
            if first.starts_with('-') {
                let words = line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
                let first_two = words.filter(|word| word.len() > 1).take(2);
                let options = first_two.filter(|word| word.starts_with("--"));
                help.options.extend(options.map(str::to_owned));
            }
        }
        help
    }
}

impl AskedHelp {
    /// The help text of a command; that of the program itself has no words.
    fn of(&mut self, command: &[String]) -> &HelpText {
        self.texts.entry(command.to_vec()).or_insert_with(|| {
            let words = command.iter().map(String::as_str).chain(["--help"]);
            let run = surfel(words);
            assert_eq!(run.code, 0, "{command:?}: {}", run.err);
            HelpText::of(&run.text())
        })
    }

    /// Tells whether a command is there that no list shows.
    fn has_hidden(&self, name: &str) -> bool {
        let help = surfel([name, "--help"]).text();
        help.contains(&format!("Usage: surfel {name}"))
    }

    /// Names in a command line that the program does not have.
    fn missing(&mut self, line: &str) -> Vec<String> {
        let mut command: Vec<String> = Vec::new();
        let mut wrong = Vec::new();
        let mut is_first = true;
        for word in unquoted(line).split_whitespace() {
            let word = word.trim_end_matches([',', ';', ':', '.']);
            let (name, _) = word.split_once('=').unwrap_or((word, ""));
            if name.starts_with("--") {
                let is_there = self.of(&command).options.contains(name);
                if !is_there {
                    wrong.push(format!("{command:?} has no {name}"));
                }
                is_first = false;
                continue;
            }
            let help = self.of(&command);
            let is_listed = help.commands.contains(name);
            // Beside commands the program takes models, which have a dot, a colon or a placeholder.
            let is_plain = !name.is_empty()
                && name.chars().all(|c| c.is_ascii_lowercase() || c == '-')
                && !name.starts_with('-');
            if is_first && (is_listed || is_plain && command.is_empty() && self.has_hidden(name)) {
                command.push(name.to_owned());
                continue;
            }
            if is_first && is_plain && command.is_empty() {
                wrong.push(format!("there is no command {name}"));
            }
            is_first = false;
        }
        wrong
    }
}

/// A command line without what stands in quotation marks.
fn unquoted(line: &str) -> String {
    line.split('"').step_by(2).collect::<Vec<_>>().join(" ")
}

/// Words that follow `surfel` in a line or in back quotes, also behind variables of the environment.
fn arguments(code: &str) -> Option<String> {
    let mut words = code.split_whitespace().skip_while(|word| {
        let name = word.split('=').next().unwrap_or_default();
        word.contains('=') && name.chars().all(|c| c.is_ascii_uppercase() || c == '_')
    });
    let program = words.next()?;
    let is_program = program == "surfel" || program.ends_with("/surfel");
    is_program.then(|| words.collect::<Vec<_>>().join(" "))
}

/// The command lines of a document: lines of code, and what stands in back quotes.
fn command_lines(document: &str) -> Vec<String> {
    let (mut found, mut prose, mut is_fenced) = (Vec::new(), String::new(), false);
    for line in document.lines() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if is_fenced || line.starts_with("    ") {
            let code = line.trim_start().trim_start_matches("$ ");
            let code = code.split(" # ").next().unwrap_or(code);
            // What explains a command stands far from it.
            found.extend(arguments(code.split("    ").next().unwrap_or(code)));
        } else {
            prose += line;
            prose.push('\n');
        }
    }
    // A paragraph and a cell each close their quotes.
    for part in prose.split("\n\n") {
        found.extend(part.split('`').skip(1).step_by(2).filter_map(arguments));
    }
    found
}

/// Names and texts of the documents that name command lines.
fn documents() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = vec![root.join("README.md"), root.join("CONTRIBUTING.md")];
    for entry in std::fs::read_dir(root.join("docs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "md") {
            files.push(path);
        }
    }
    files.sort();
    let read = |path: &std::path::PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read_to_string(path).unwrap())
    };
    files.iter().map(read).collect()
}

#[test]
fn every_command_of_the_documents_is_there() {
    let mut asked = AskedHelp::default();
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (name, document) in documents() {
        for line in command_lines(&document) {
            // A window has the options of the program; without the feature there is none.
            let is_window = !line.starts_with(|c: char| c.is_ascii_lowercase())
                || line
                    .split_whitespace()
                    .next()
                    .unwrap_or_default()
                    .contains(['.', ':']);
            let is_viewers = is_window || line.starts_with("soak");
            if cfg!(not(feature = "viewer")) && is_viewers
                || cfg!(not(feature = "remote")) && line.starts_with("serve")
            {
                continue;
            }
            let missing = asked.missing(&line);
            wrong.extend(
                missing
                    .iter()
                    .map(|what| format!("{name}: surfel {line}: {what}")),
            );
            count += 1;
        }
    }
    assert!(count > 100, "{count} command lines: the search is broken");
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn false_commands_are_seen() {
    let document = "Text `surfel rendre a.ply` and `surfel render a.ply --tresh 3\n--size 4x4`.\n\n    \
        X=1 surfel info a.ply --jsn     explained --so\n\n```sh\ntarget/release/surfel devices --self-tst # why --so\n```\n\
        Fine: `surfel render a.ply --threshold=3`, `surfel motion a.ply --with \"--none 3\"`, `cargo --none`.\n";
    let lines = command_lines(document);
    assert_eq!(lines.len(), 6, "{lines:?}");
    let mut asked = AskedHelp::default();
    let wrong: Vec<_> = lines.iter().flat_map(|line| asked.missing(line)).collect();
    for name in ["rendre", "--tresh", "--jsn", "--self-tst"] {
        assert!(
            wrong.iter().any(|what| what.ends_with(name)),
            "{name}: {wrong:?}"
        );
    }
    assert_eq!(wrong.len(), 4, "{wrong:?}");
}
