//! `surfel man`

use super::{Outcome, print, require_folder, usage, write_text};
use clap::Command;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  surfel man | man -l -                    the page of the program
  surfel man photos score | man -l -       the page of a command
  surfel man --output /usr/local/share/man/man1      all of them";

/// Print a manual page, or write all of them into a folder.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ManArgs {
    /// Command whose page is printed [default: the program]
    #[arg(value_name = "COMMAND", conflicts_with = "output")]
    command: Vec<String>,
    /// Folder that gets the pages of the program and of every command
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Prints a page of `program`, or writes all of them.
pub(crate) fn run(args: &ManArgs, program: Command) -> Outcome {
    let mut program = program.disable_help_subcommand(true);
    // Names of commands within commands are known only then.
    program.build();
    let Some(folder) = &args.output else {
        return print(&page(command_named(&program, &args.command)?)?);
    };
    require_folder(&folder.join("page"))?;
    let mut open = vec![&program];
    while let Some(command) = open.pop() {
        let path = folder.join(Man::new(command.clone()).get_filename());
        write_text(&path, &page(command)?)?;
        open.extend(command.get_subcommands().filter(|c| !c.is_hide_set()));
    }
    Ok(())
}

/// Command of `program` that `words` name, one word a level.
fn command_named<'a>(
    program: &'a Command,
    words: &[String],
) -> Result<&'a Command, super::CommandFailure> {
    words.iter().try_fold(program, |command, word| {
        command
            .find_subcommand(word)
            .ok_or_else(|| usage(format!("surfel man: there is no command '{word}'")))
    })
}

/// Manual page of a command in roff. There is no date in it: the same program writes the same page.
fn page(command: &Command) -> Result<String, super::CommandFailure> {
    let after = command.get_after_help().map(ToString::to_string);
    let plain = command.clone().after_help(None);
    let mut bytes = Vec::new();
    let written = Man::new(plain)
        .source(format!("surfel {}", env!("CARGO_PKG_VERSION")))
        .manual("surfel")
        .render(&mut bytes)
        .and_then(|()| sections(&after.unwrap_or_default()).to_writer(&mut bytes));
    written.map_err(|error| super::CommandFailure::Run(anyhow::Error::new(error)))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Text that follows the options as sections of the page. A line that ends in a colon begins one; lines that are indented
/// keep their breaks, as commands must.
fn sections(text: &str) -> Roff {
    let mut roff = Roff::default();
    let mut is_kept = false;
    let mut has_heading = false;
    for line in text.lines() {
        if is_kept != line.starts_with(' ') {
            is_kept = !is_kept;
            roff.control(if is_kept { "nf" } else { "fi" }, []);
        }
        match line.strip_suffix(':') {
            Some(heading) if !is_kept => {
                roff.control("SH", [heading.to_uppercase().as_str()]);
                has_heading = true;
            }
            _ if line.trim().is_empty() => {
                roff.control("PP", []);
            }
            _ => {
                if !has_heading {
                    roff.control("SH", ["NOTES"]);
                    has_heading = true;
                }
                roff.text([roman(line)]);
            }
        }
    }
    if is_kept {
        roff.control("fi", []);
    }
    roff
}
