//! `kfdesign man`.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Command, CommandFactory};
use clap_mangen::Man;

use super::output::print_text;
use super::{Cli, Status};
use crate::export::atomic;

/// The manual pages
///
/// kfdesign.1 and one page for every command, kfdesign-COMMAND.1.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign man -o ~/.local/share/man/man1")]
pub struct Args {
    /// The folder, which must be there [default: kfdesign.1 on stdout]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let mut cli = Cli::command();
    // gives every command its full name
    cli.build();
    let Some(folder) = &args.output else {
        print_text(&page(cli)?);
        return Ok(Status::Done);
    };
    // the command that clap adds for help has no page of its own
    let commands: Vec<Command> = cli.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
    let pages: Vec<(String, String)> = std::iter::once(cli)
        .chain(commands)
        .map(|command| {
            let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
            Ok((format!("{name}.1"), page(command)?))
        })
        .collect::<anyhow::Result<_>>()?;
    for (name, text) in &pages {
        atomic::write(&folder.join(name), text.as_bytes())?;
    }
    print_text(&format!("{} pages in {}\n", pages.len(), folder.display()));
    Ok(Status::Done)
}

/// In roff; without a date, so that the same version gives the same bytes.
fn page(command: Command) -> anyhow::Result<String> {
    let name = command.get_name().to_owned();
    let mut text = Vec::new();
    Man::new(command).render(&mut text).with_context(|| format!("manual page of {name}"))?;
    Ok(String::from_utf8(text)?)
}
