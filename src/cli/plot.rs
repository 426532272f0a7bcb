//! `--plot`, and how its figures are written.

use std::path::PathBuf;

use super::files::{Kind, Output};
use crate::export::atomic;
use crate::report::Report;
use crate::report::print::{Width, print};

/// The figures of a command in a file.
#[derive(Debug, clap::Args)]
pub(super) struct Plot {
    /// The figures, as its ending says: SVG, PDF (lines and letters as paths) or PNG
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    plot: Option<PathBuf>,
    /// Width of the figures, their text included: 85mm (a PNG has 300 dots per inch then), 3.3in, 1600px
    /// [default: 440px, of a PNG 1320px]
    #[arg(long, requires = "plot", allow_hyphen_values = true)]
    width: Option<Width>,
    /// An SVG for paper: dark on white whatever the reader's setting, as PDF and PNG always are
    #[arg(long, requires = "plot")]
    light: bool,
}

impl Plot {
    pub(super) fn wanted(&self) -> bool {
        self.plot.is_some()
    }

    pub(super) fn output(&self) -> Output<'_> {
        ("--plot", &self.plot, Kind::Plot)
    }

    /// The figures, under `title`, where a file for them is named.
    pub(super) fn write(&self, title: &str, report: &Report<'_>) -> anyhow::Result<()> {
        let Some(path) = &self.plot else { return Ok(()) };
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        Ok(atomic::write(path, &print(&report.sheet(title), &ending, self.width, self.light)?)?)
    }
}
