//! Which terms a model has, and its parameters as logarithms.

use crate::noise::{Kind, NoiseModel, Term};

/// A list of kinds in the order of [`Kind`]; only Gauss-Markov may stand more than once.
///
/// Parameters are natural logarithms of the SI coefficients, term by term; a Gauss-Markov term has two, ln σ and ln Tc.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shape {
    kinds: Vec<Kind>,
}

/// What one parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Enters the Allan variance as its square.
    Coefficient,
    CorrelationTime,
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
        let of = |kind: Kind| {
            let second = (kind == Kind::GaussMarkov).then_some((kind, Role::CorrelationTime));
            [Some((kind, Role::Coefficient)), second].into_iter().flatten()
        };
        self.kinds.iter().copied().flat_map(of).collect()
    }
    pub(super) fn parameters(&self) -> usize {
        self.kinds.len() + self.count(Kind::GaussMarkov)
    }
    /// The terms at these parameters, SI.
    pub(super) fn model(&self, log_parameters: &[f64]) -> NoiseModel {
        let mut values = log_parameters.iter().map(|p| p.exp());
        let mut next = || values.next().unwrap_or(f64::NAN);
        let terms = self.kinds.iter().map(|kind| match kind {
            Kind::GaussMarkov => Term::GaussMarkov { std_dev: next(), correlation_time: next() },
            kind => one_coefficient(*kind, next()),
        });
        NoiseModel { terms: terms.collect() }
    }
    /// "white+gm+rrw", white first.
    pub(super) fn label(&self) -> String {
        let mut kinds = self.kinds.clone();
        kinds.sort_by_key(|k| (*k != Kind::White, *k));
        kinds.iter().map(|k| short_name(*k)).collect::<Vec<_>>().join("+")
    }
}

/// A term with one coefficient; Gauss-Markov gets a correlation time of 1 s.
pub(super) fn one_coefficient(kind: Kind, value: f64) -> Term {
    match kind {
        Kind::Quantization => Term::Quantization { coefficient: value },
        Kind::White => Term::White { density: value },
        Kind::BiasInstability => Term::BiasInstability { coefficient: value },
        Kind::GaussMarkov => Term::GaussMarkov { std_dev: value, correlation_time: 1.0 },
        Kind::RateRandomWalk => Term::RateRandomWalk { density: value },
        Kind::RateRamp => Term::RateRamp { slope: value },
    }
}

/// The name in `--model`.
pub(super) fn short_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Quantization => "quantization",
        Kind::White => "white",
        Kind::BiasInstability => "flicker",
        Kind::GaussMarkov => "gm",
        Kind::RateRandomWalk => "rrw",
        Kind::RateRamp => "ramp",
    }
}

/// The name in params.json.
pub(super) fn document_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Quantization => "quantization",
        Kind::White => "white",
        Kind::BiasInstability => "bias_instability",
        Kind::GaussMarkov => "gauss_markov",
        Kind::RateRandomWalk => "rate_random_walk",
        Kind::RateRamp => "rate_ramp",
    }
}

/// All kinds, in the fixed order.
pub(super) const KINDS: [Kind; 6] =
    [Kind::Quantization, Kind::White, Kind::BiasInstability, Kind::GaussMarkov, Kind::RateRandomWalk, Kind::RateRamp];
