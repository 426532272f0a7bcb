//! NEES, NIS, whiteness, the low-frequency innovation test, multiplicity and the verdict record (floor 3).
//!
//! Every test is two-sided: a covariance that is too large (a pessimistic filter) fails like one that is too small (an
//! optimistic filter), and the sentence in [`Test::meaning`] says which of the two it is.
//!
//! The tests take *normalised* innovations y = ν/√S. For a filter whose model is true they are independent N(0, 1),
//! so the null distribution of each statistic here is exact or has a stated approximation; see each function. NEES
//! is correlated in time: use [`normalized::across_runs`] at one epoch, or [`normalized::over_time`] with its
//! effective sample size, never χ² with one run's sample count.

pub mod effect;
pub mod low_frequency;
pub mod multiplicity;
pub mod normalized;
pub mod spectrum;
pub mod whiteness;

use schemars::JsonSchema;
use serde::Serialize;

pub use effect::Effect;

/// The outcome of a command that judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    Consistent,
    Inconsistent,
    Inconclusive,
}

impl Verdict {
    /// The word used in documents and on the screen.
    pub const fn word(self) -> &'static str {
        match self {
            Verdict::Consistent => "consistent",
            Verdict::Inconsistent => "inconsistent",
            Verdict::Inconclusive => "inconclusive",
        }
    }
}

/// Of a test whose statistic or p-value is none.
const NO_NUMBER: &str = "its numbers are too large to be computed, or missing: nothing can be said";

/// What a test looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestKind {
    /// Normalised squared estimation errors at one time.
    Nees,
    /// The same over all times.
    NeesAverage,
    /// Errors have a mean.
    MeanError,
    /// Normalised squared innovations.
    Nis,
    /// Innovations have a mean.
    InnovationMean,
    /// Of innovations over runs, the largest lag.
    Autocorrelation,
    /// Autocorrelation of innovations, the largest lag.
    Whiteness,
    /// All lags together.
    LjungBox,
    /// Of innovations against a straight line.
    CumulativePeriodogram,
    /// Averages of innovations against what is predicted.
    LowFrequency,
    /// The estimate before the log against the log.
    Start,
    /// How many samples the gate refused.
    Rejected,
    /// The Allan curve of a log against the model's.
    AllanCurve,
    /// Bands of the spectrum of a log over the model's.
    SpectrumRatio,
    /// The cumulative spectrum of a log over the model's.
    CumulativeSpectrum,
}

impl TestKind {
    /// As in documents.
    pub fn name(self) -> &'static str {
        match self {
            TestKind::Nees => "nees",
            TestKind::NeesAverage => "nees_average",
            TestKind::MeanError => "mean_error",
            TestKind::Nis => "nis",
            TestKind::InnovationMean => "innovation_mean",
            TestKind::Autocorrelation => "autocorrelation",
            TestKind::Whiteness => "whiteness",
            TestKind::LjungBox => "ljung_box",
            TestKind::CumulativePeriodogram => "cumulative_periodogram",
            TestKind::LowFrequency => "low_frequency",
            TestKind::Start => "start",
            TestKind::Rejected => "rejected",
            TestKind::AllanCurve => "allan_curve",
            TestKind::SpectrumRatio => "spectrum_ratio",
            TestKind::CumulativeSpectrum => "cumulative_spectrum",
        }
    }

    /// Whether it is slow drift that it looks at.
    pub fn is_of_drift(self) -> bool {
        matches!(self, TestKind::LowFrequency | TestKind::CumulativePeriodogram | TestKind::Start)
    }
}

/// One test of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Test {
    pub axis: String,
    #[serde(skip)]
    pub kind: TestKind,
    /// Of the kind, and of the measurement where there are several.
    pub name: String,
    pub statistic: f64,
    /// replay: the statistic lies in [lower, upper] with probability 1 − alpha when the design is true (each test
    /// alone); montecarlo: the bounds beyond which the gate rejects, all tests together.
    pub lower: f64,
    pub upper: f64,
    /// Two-sided.
    pub p_value: f64,
    /// Over all tests and axes of the document: Holm (replay), law of the least p-value (montecarlo).
    pub adjusted_p_value: f64,
    /// Written by [`Test::judge`] alone.
    pass: bool,
    /// A sentence.
    pub meaning: String,
    /// Averaging time of a low-frequency test, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub averaging_s: Option<f64>,
    /// How large the deviation is, where it can be said; judged on measured logs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effect: Option<Effect>,
}

impl Test {
    /// A test not yet judged: `adjusted_p_value` is the p-value and it does not pass until [`multiplicity::judge`]
    /// or [`effect::judge`] has seen all tests of the document. Without a number for its statistic or its p-value it
    /// means nothing, and says so.
    pub fn new(axis: &str, kind: TestKind, statistic: f64, bounds: [f64; 2], p_value: f64, meaning: String) -> Test {
        let meaning = if statistic.is_finite() && !p_value.is_nan() { meaning } else { NO_NUMBER.to_string() };
        Test {
            axis: axis.to_string(),
            kind,
            name: kind.name().to_string(),
            statistic,
            lower: bounds[0],
            upper: bounds[1],
            p_value,
            adjusted_p_value: p_value,
            pass: false,
            meaning,
            averaging_s: None,
            effect: None,
        }
    }

    #[must_use]
    pub fn of_measurement(mut self, name: &str) -> Test {
        self.name = format!("{} of {name}", self.kind.name());
        self
    }

    /// Whether the design passes this test.
    pub fn pass(&self) -> bool {
        self.pass
    }

    /// Whether there are numbers to judge.
    pub fn has_numbers(&self) -> bool {
        self.statistic.is_finite() && !self.p_value.is_nan() && !self.adjusted_p_value.is_nan()
    }

    /// The verdict on this test, from its adjusted p-value: what has no number never passes.
    pub(crate) fn judge(&mut self, adjusted_p_value: f64, pass: impl FnOnce(&Test) -> bool) {
        self.adjusted_p_value = adjusted_p_value;
        self.pass = self.has_numbers() && pass(self);
    }

    #[must_use]
    pub fn with_averaging(mut self, seconds: f64) -> Test {
        self.averaging_s = Some(seconds);
        self
    }

    #[must_use]
    pub fn with_effect(mut self, effect: Effect) -> Test {
        self.effect = Some(effect);
        self
    }
}
