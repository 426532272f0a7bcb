//! Figures as self-contained SVG: plain data in, one string out.
//!
//! Text stays text in generic fonts, colours follow the reader's light or dark setting, series differ by line style
//! as well as by colour, and the same data give the same bytes. Values that are not finite, or not positive on a
//! logarithmic axis, leave a gap.

mod allan;
mod budget;
mod chart;
mod closed_loop;
mod consistency;
mod course;
mod error;
mod flight;
mod lines;
mod ratio;
mod scale;
mod sheet;
mod style;
mod trace;
mod worth;

pub use allan::{Allan, AllanMark, AllanPoint, allan, allan_overlay};
pub use budget::{BudgetItem, error_budget};
pub use closed_loop::{Found, FoundPoint, Nyquist, OverLog, found, nyquist, over_log};
pub use consistency::{
    Autocorrelation, Histogram, Nees, Periodogram, autocorrelation, cumulative_periodogram, nees, nis_histogram,
};
pub use course::{Course, course};
pub use error::{Component, Errors, Rms, errors, rms};
pub use flight::{Envelope, TimeLines, Track, time_lines, track};
pub use lines::{Lines, lines};
pub use ratio::{SpectrumRatio, spectrum_ratio};
pub use sheet::sheet;
pub(super) use style::UNITS;
pub use style::{light_style_sheet, style_sheet};
pub use trace::{Estimate, Innovations, Sigma, SigmaState, estimate, innovations, sigma};
pub use worth::{Worth, worth};

/// A named line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    pub label: String,
    /// (x, y).
    pub points: Vec<(f64, f64)>,
}
