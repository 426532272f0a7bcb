//! `kfdesign completions`.

use clap::CommandFactory;
use clap_complete::Shell;

use super::output::print_text;
use super::{Cli, Status};

/// The completion script of a shell
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign completions bash > ~/.local/share/bash-completion/completions/kfdesign")]
pub struct Args {
    /// Which shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "kfdesign", &mut script);
    print_text(&String::from_utf8(script)?);
    Ok(Status::Done)
}
