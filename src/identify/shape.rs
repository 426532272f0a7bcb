//! Which terms a model has, and its parameters as logarithms.

use crate::noise::{Kind, NoiseModel, Role, Term};

/// A list of kinds in the order of [`Kind`]; only Gauss-Markov and oscillation may stand more than once.
///
/// Parameters are natural logarithms of the SI coefficients, term by term; a Gauss-Markov term has two, ln σ and ln Tc,
/// an oscillation three, ln σ, ln f₀ and ln Tc.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shape {
    kinds: Vec<Kind>,
}

impl Shape {
    pub(super) fn new(mut kinds: Vec<Kind>) -> Shape {
        kinds.sort_unstable();
        Shape { kinds }
    }
    pub(super) fn kinds(&self) -> &[Kind] {
        &self.kinds
    }
    pub(super) fn has(&self, kind: Kind) -> bool {
        self.kinds.contains(&kind)
    }
    pub(super) fn count(&self, kind: Kind) -> usize {
        self.kinds.iter().filter(|k| **k == kind).count()
    }
    pub(super) fn with(&self, kind: Kind) -> Shape {
        Shape::new(self.kinds.iter().copied().chain([kind]).collect())
    }
    /// Without one term of this kind.
    pub(super) fn without(&self, kind: Kind) -> Shape {
        let mut kinds = self.kinds.clone();
        if let Some(i) = kinds.iter().position(|k| *k == kind) {
            kinds.remove(i);
        }
        Shape { kinds }
    }
    /// Kind and role of every parameter.
    pub(super) fn roles(&self) -> Vec<(Kind, Role)> {
        self.kinds.iter().flat_map(|kind| kind.roles().iter().map(|role| (*kind, *role))).collect()
    }
    pub(super) fn parameters(&self) -> usize {
        self.roles().len()
    }
    /// The terms at these parameters, SI.
    pub(super) fn model(&self, log_parameters: &[f64]) -> NoiseModel {
        let mut values = log_parameters.iter().map(|p| p.exp());
        let mut next = || values.next().unwrap_or(f64::NAN);
        let terms = self.kinds.iter().map(|kind| match kind {
            Kind::GaussMarkov => Term::GaussMarkov { std_dev: next(), correlation_time: next() },
            Kind::Oscillation => Term::Oscillation { std_dev: next(), frequency_hz: next(), correlation_time: next() },
            kind => one_coefficient(*kind, next()),
        });
        NoiseModel { terms: terms.collect() }
    }
    /// "white+gm+rrw", white first.
    pub(super) fn label(&self) -> String {
        let mut kinds = self.kinds.clone();
        kinds.sort_by_key(|k| (*k != Kind::White, *k));
        kinds.iter().map(|k| k.short_name()).collect::<Vec<_>>().join("+")
    }
}

/// A term with one coefficient; correlation times are 1 s, frequencies 1 Hz,
/// averages over two samples.
pub(super) fn one_coefficient(kind: Kind, value: f64) -> Term {
    match kind {
        Kind::Quantization => Term::Quantization { coefficient: value },
        Kind::White => Term::White { density: value },
        Kind::MovingAverage => Term::MovingAverage { density: value, samples: 2 },
        // without a filter: white
        Kind::BandLimit => Term::White { density: value },
        Kind::Oscillation => Term::Oscillation { std_dev: value, frequency_hz: 1.0, correlation_time: 1.0 },
        Kind::BiasInstability => Term::BiasInstability { coefficient: value },
        Kind::GaussMarkov => Term::GaussMarkov { std_dev: value, correlation_time: 1.0 },
        Kind::RateRandomWalk => Term::RateRandomWalk { density: value },
        Kind::RateRamp => Term::RateRamp { slope: value },
    }
}

/// The kinds that show in an Allan curve: it averages a narrow line away, and averages and band limits are white but
/// for the shortest times.
pub(super) fn in_allan_curve(kind: Kind) -> bool {
    !matches!(kind, Kind::MovingAverage | Kind::BandLimit | Kind::Oscillation)
}
