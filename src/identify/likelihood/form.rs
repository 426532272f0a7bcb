//! Which processes a model has, and its parameters as logarithms.

use std::ops::Range;

use crate::noise::{Filter, HIGHEST_ORDER, Kind, NoiseModel, Role, Term};

/// White noise beside a band limit whose shape is searched, variance over that of its innovations. An ARMA(p, p)
/// process holds any white noise in itself, so that none of its own can be told; a filter needs some measurement
/// noise. Little, since nothing is left at half the sample rate of what no converter has followed; but not so little
/// beside the samples, [`LEAST`] of white noise of the same density, that the first update of a covariance loses its
/// digits, and at most [`LARGEST_FLOOR`].
const FLOOR: f64 = 1e-9;
const LEAST: f64 = 1e-8;
const LARGEST_FLOOR: f64 = 1e-5;

/// Density, and the area ratios of poles and zeros.
const BAND_LIMIT: [Role; 2 * HIGHEST_ORDER + 1] = {
    let mut roles = [Role::Shape; 2 * HIGHEST_ORDER + 1];
    roles[0] = Role::Coefficient;
    roles
};

/// One process of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Piece {
    White,
    /// Over so many samples.
    MovingAverage(u32),
    /// Of so many poles and zeros, searched; with the [`FLOOR`] of white noise that a filter needs.
    BandLimit(u8),
    /// Of this very shape.
    Filtered(Filter),
    Quantization,
    Oscillation,
    Flicker,
    GaussMarkov,
    RandomWalk,
    Ramp,
}

impl Piece {
    /// Parameters that stand in the spectrum. The slope of a ramp is none of them: its best value follows from the
    /// others.
    pub(super) fn roles(self) -> &'static [Role] {
        match self {
            Piece::Ramp => &[],
            Piece::BandLimit(order) => &BAND_LIMIT[..=2 * usize::from(order)],
            piece => piece.kind().roles(),
        }
    }

    pub(super) fn kind(self) -> Kind {
        match self {
            Piece::White => Kind::White,
            Piece::MovingAverage(_) => Kind::MovingAverage,
            Piece::BandLimit(_) | Piece::Filtered(_) => Kind::BandLimit,
            Piece::Quantization => Kind::Quantization,
            Piece::Oscillation => Kind::Oscillation,
            Piece::Flicker => Kind::BiasInstability,
            Piece::GaussMarkov => Kind::GaussMarkov,
            Piece::RandomWalk => Kind::RateRandomWalk,
            Piece::Ramp => Kind::RateRamp,
        }
    }

    /// The process at these values (not logarithms); none for a ramp.
    pub(super) fn term(self, values: &[f64]) -> Option<Term> {
        Some(match (self, values) {
            (Piece::White, &[density]) => Term::White { density },
            (Piece::MovingAverage(samples), &[density]) => Term::MovingAverage { density, samples },
            (Piece::BandLimit(_), [density, ratios @ ..]) => {
                Term::BandLimit { density: *density, filter: Filter::from_area_ratios(ratios)? }
            }
            (Piece::Filtered(filter), &[density]) => Term::BandLimit { density, filter },
            (Piece::Quantization, &[coefficient]) => Term::Quantization { coefficient },
            (Piece::Oscillation, &[std_dev, frequency_hz, correlation_time]) => {
                Term::Oscillation { std_dev, frequency_hz, correlation_time }
            }
            (Piece::Flicker, &[coefficient]) => Term::BiasInstability { coefficient },
            (Piece::GaussMarkov, &[std_dev, correlation_time]) => Term::GaussMarkov { std_dev, correlation_time },
            (Piece::RandomWalk, &[density]) => Term::RateRandomWalk { density },
            _ => return None,
        })
    }

    /// White noise that goes with the piece at these values.
    pub(super) fn floor(self, values: &[f64]) -> Option<Term> {
        match (self, self.term(values)?) {
            (Piece::BandLimit(_), Term::BandLimit { density, filter }) => {
                let innovation = filter.innovation();
                let floor = (FLOOR * innovation).max(LEAST.min(LARGEST_FLOOR * innovation));
                Some(Term::White { density: density * floor.sqrt() })
            }
            _ => None,
        }
    }

    /// All processes of the piece at these values.
    pub(super) fn terms(self, values: &[f64]) -> impl Iterator<Item = Term> + use<> {
        self.floor(values).into_iter().chain(self.term(values))
    }

    /// The piece that a process is, with its values; the slope of a ramp is none of them.
    pub(super) fn of(term: &Term) -> (Piece, Vec<f64>) {
        match *term {
            Term::White { density } => (Piece::White, vec![density]),
            Term::MovingAverage { density, samples } => (Piece::MovingAverage(samples), vec![density]),
            Term::BandLimit { density, filter } => (Piece::Filtered(filter), vec![density]),
            Term::Quantization { coefficient } => (Piece::Quantization, vec![coefficient]),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                (Piece::Oscillation, vec![std_dev, frequency_hz, correlation_time])
            }
            Term::BiasInstability { coefficient } => (Piece::Flicker, vec![coefficient]),
            Term::GaussMarkov { std_dev, correlation_time } => (Piece::GaussMarkov, vec![std_dev, correlation_time]),
            Term::RateRandomWalk { density } => (Piece::RandomWalk, vec![density]),
            Term::RateRamp { .. } => (Piece::Ramp, vec![]),
        }
    }

    /// In `--model`.
    fn short_name(self) -> String {
        match self {
            Piece::MovingAverage(samples) => format!("ma{samples}"),
            Piece::BandLimit(order) => format!("bl{order}"),
            piece => piece.kind().short_name().to_string(),
        }
    }
}

/// The processes of a model; Gauss-Markov and oscillation may stand more than once.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Form {
    pieces: Vec<Piece>,
}

impl Form {
    pub(super) fn new(mut pieces: Vec<Piece>) -> Form {
        pieces.sort_unstable();
        Form { pieces }
    }

    /// Of a model, with its logarithms; the slope of a ramp is none of them.
    pub(super) fn of(model: &NoiseModel) -> (Form, Vec<f64>) {
        Form::with_floor(model, 1.001 * LARGEST_FLOOR)
    }

    /// The same, where white noise beside a band limit is a floor up to this share of its innovations.
    pub(super) fn with_floor(model: &NoiseModel, largest: f64) -> (Form, Vec<f64>) {
        let mut pieces: Vec<(Piece, Vec<f64>)> = model.terms.iter().map(Piece::of).collect();
        searched(&mut pieces, largest);
        pieces.sort_by_key(|(piece, _)| *piece);
        let logs = pieces.iter().flat_map(|(_, values)| values.iter().map(|v| v.ln())).collect();
        (Form::new(pieces.into_iter().map(|(piece, _)| piece).collect()), logs)
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(super) fn count(&self, kind: Kind) -> usize {
        self.pieces.iter().filter(|piece| piece.kind() == kind).count()
    }

    pub(super) fn has(&self, kind: Kind) -> bool {
        self.count(kind) > 0
    }

    /// Piece and role of every logarithm, in order.
    pub(super) fn roles(&self) -> Vec<(usize, Role)> {
        let of = |(i, piece): (usize, &Piece)| piece.roles().iter().map(move |role| (i, *role)).collect::<Vec<_>>();
        self.pieces.iter().enumerate().flat_map(of).collect()
    }

    /// Number of parameters, the slope of a ramp included.
    pub(super) fn parameters(&self) -> usize {
        self.pieces.iter().map(|piece| piece.roles().len().max(1)).sum()
    }

    /// The logarithms of each piece.
    pub(super) fn split<'a>(&'a self, logs: &'a [f64]) -> impl Iterator<Item = (Piece, &'a [f64])> {
        let mut rest = logs;
        self.pieces.iter().map(move |piece| {
            let (own, later) = rest.split_at(piece.roles().len().min(rest.len()));
            rest = later;
            (*piece, own)
        })
    }

    /// The processes at these logarithms; a ramp is none of them.
    pub(super) fn terms<'a>(&'a self, logs: &'a [f64]) -> impl Iterator<Item = Term> + 'a {
        self.split(logs).flat_map(|(piece, own)| piece.terms(&own.iter().map(|v| v.exp()).collect::<Vec<f64>>()))
    }

    /// This form and its logarithms with one piece more, and where its logarithms are.
    pub(super) fn with(&self, logs: &[f64], piece: Piece, own: &[f64]) -> (Form, Vec<f64>, Range<usize>) {
        let at = self.pieces.partition_point(|p| *p <= piece);
        let before: usize = self.pieces[..at].iter().map(|p| p.roles().len()).sum();
        let (mut pieces, mut all) = (self.pieces.clone(), logs.to_vec());
        pieces.insert(at, piece);
        all.splice(before..before, own.iter().copied());
        (Form { pieces }, all, before..before + own.len())
    }

    /// This form and its logarithms without piece number `at`.
    pub(super) fn without(&self, logs: &[f64], at: usize) -> (Form, Vec<f64>) {
        let before: usize = self.pieces[..at].iter().map(|p| p.roles().len()).sum();
        let (mut pieces, mut all) = (self.pieces.clone(), logs.to_vec());
        let piece = pieces.remove(at);
        all.drain(before..before + piece.roles().len());
        (Form { pieces }, all)
    }

    /// "white+gm+rrw".
    pub(super) fn label(&self) -> String {
        self.pieces.iter().map(|piece| piece.short_name()).collect::<Vec<_>>().join("+")
    }
}

/// A band limit beside a floor of at most this share of its innovations, and no other white noise, becomes one whose
/// shape is searched, as it was when it was found.
fn searched(pieces: &mut Vec<(Piece, Vec<f64>)>, largest: f64) {
    let whites: Vec<usize> = (0..pieces.len()).filter(|i| pieces[*i].0 == Piece::White).collect();
    let limits: Vec<usize> = (0..pieces.len()).filter(|i| matches!(pieces[*i].0, Piece::Filtered(_))).collect();
    let ([white], [limit]) = (&whites[..], &limits[..]) else { return };
    let (Piece::Filtered(filter), density) = (pieces[*limit].0, pieces[*limit].1[0]) else { return };
    let Some(ratios) = filter.area_ratios() else { return };
    let piece = Piece::BandLimit((ratios.len() / 2) as u8);
    let values: Vec<f64> = [density].into_iter().chain(ratios).collect();
    let white_share = (pieces[*white].1[0] / density).powi(2) / filter.innovation();
    if white_share <= largest {
        pieces[*limit] = (piece, values);
        pieces.remove(*white);
    }
}
