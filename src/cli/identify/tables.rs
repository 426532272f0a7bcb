//! The tables of `identify`, for the terminal and for the page.

use super::Axis;
use crate::cli::output::digits;
use crate::identify::{Candidate, Precision};
use crate::noise::FLICKER_FLOOR;
use crate::params::{Measured, TermEntry};
use crate::units::{Quantity, Unit};

/// A table as text and as HTML.
pub(super) struct Shown {
    pub(super) caption: &'static str,
    pub(super) header: &'static [&'static str],
    pub(super) rows: Vec<Vec<String>>,
}

/// Values with intervals; of the likelihood method with standard deviations beside their bound.
pub(super) fn parameters(axis: &Axis, quantity: Quantity) -> Shown {
    let found = &axis.found;
    let turn_on = found.params.turn_on_bias.as_ref();
    let caption = if turn_on.is_some() { "bias (mean of all starts)" } else { "bias (mean of this log)" };
    let bias = found.params.bias.iter().map(|bias| row(caption, bias, String::new()));
    let bias = bias.chain(turn_on.map(|spread| row("turn-on bias sigma", spread, String::new()))).collect();
    let (bias, mut rows): (Vec<Vec<String>>, _) =
        (bias, term_rows(&found.params.terms, quantity, 1.0 / found.curve.dt));
    if found.precision.is_empty() {
        let header = &["parameter", "value", "95 % from", "to", "unit", "also"];
        return Shown { caption: "Parameters with 95 % intervals", header, rows: [bias, rows].concat() };
    }
    let mut precision = found.precision.iter();
    for row in &mut rows {
        row.splice(5..5, cells(precision.next()));
    }
    let bias = bias.into_iter().map(|mut row| {
        row.splice(5..5, cells(None));
        row
    });
    Shown {
        caption: "Parameters with 95 % intervals, and their standard deviation beside the Cramér-Rao bound of a log like this",
        header: &["parameter", "value", "95 % from", "to", "unit", "sd (%)", "bound (%)", "ratio", "also"],
        rows: bias.chain(rows).collect(),
    }
}

/// Standard deviation, its bound and their ratio, as far as there are any.
fn cells(own: Option<&Precision>) -> [String; 3] {
    let none = || "-".to_string();
    match own {
        Some(Precision { std_dev_percent: sd, cramer_rao_percent: bound, .. }) if *sd < 1000.0 => {
            let known = bound.is_finite();
            let [bound, ratio] = [digits(*bound), format!("{:.2}", sd / bound)].map(|cell| known.then_some(cell));
            [digits(*sd), bound.unwrap_or_else(none), ratio.unwrap_or_else(none)]
        }
        _ => [none(), none(), none()],
    }
}

fn row(name: &str, value: &Measured, also: String) -> Vec<String> {
    let end = |end: f64| if end.is_finite() { digits(end) } else { "-".into() };
    let [lower, upper] = value.interval.map_or(["-".into(), "-".into()], |ends| ends.map(end));
    vec![name.to_string(), digits(value.value), lower, upper, value.unit.to_string(), also]
}

/// One row for each parameter, in the order of the document.
pub(in crate::cli) fn term_rows(terms: &[TermEntry], quantity: Quantity, sample_rate_hz: f64) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let wideband: Vec<&Measured> = terms.iter().filter_map(TermEntry::wideband_density).collect();
    let total = wideband.iter().map(|density| density.si()).fold(0.0, f64::hypot);
    // the last of them is told as a random walk: all together
    let and_all = |density: &Measured, own: Option<String>| {
        let last = wideband.last().is_some_and(|last| std::ptr::eq(*last, density));
        let all = if last { random_walk_name(total, quantity) } else { None };
        own.into_iter().chain(all).collect::<Vec<_>>().join("; ")
    };
    for term in terms {
        match term {
            TermEntry::Quantization { coefficient } => rows.push(row("quantization Q", coefficient, String::new())),
            TermEntry::White { density } => {
                let floor = density.is_floor_of(total).then(|| "a floor that a filter needs".to_string());
                rows.push(row("white N", density, and_all(density, floor)));
            }
            TermEntry::MovingAverage { density, samples } => {
                let unit = &density.unit;
                let also = format!("over {samples} samples; with white {} {unit}", digits(unit.from_si(total)));
                rows.push(row("moving average N", density, and_all(density, Some(also))));
            }
            TermEntry::BandLimit { density, filter } => {
                let corner = filter.half_power().map(|share| format!("-3 dB at {} Hz", digits(share * sample_rate_hz)));
                rows.push(row("band limit N", density, and_all(density, corner)));
            }
            TermEntry::Oscillation { std_dev, frequency, correlation_time } => {
                rows.push(row("oscillation sigma", std_dev, String::new()));
                rows.push(row("oscillation f0", frequency, String::new()));
                rows.push(row("oscillation Tc", correlation_time, String::new()));
            }
            TermEntry::BiasInstability { coefficient } => {
                rows.push(row("flicker B (bias instability)", coefficient, floor_name(coefficient, quantity)));
            }
            TermEntry::GaussMarkov { std_dev, correlation_time } => {
                rows.push(row("Gauss-Markov sigma", std_dev, driving_name(std_dev, correlation_time)));
                rows.push(row("Gauss-Markov Tc", correlation_time, String::new()));
            }
            TermEntry::RateRandomWalk { density } => {
                rows.push(row("rate random walk K", density, walk_name(density, quantity)));
            }
            TermEntry::RateRamp { slope } => rows.push(row("rate ramp R", slope, String::new())),
        }
    }
    rows
}

/// A value in another unit: "3.372 deg/sqrt(h)".
fn in_unit(si: f64, unit: &str) -> Option<String> {
    Unit::parse(unit).ok().map(|unit| format!("{} {unit}", digits(unit.from_si(si))))
}

/// The integral of white noise as datasheets call it.
fn random_walk_name(density_si: f64, quantity: Quantity) -> Option<String> {
    let (name, unit) = match quantity {
        Quantity::AngularRate => ("angle random walk", "deg/sqrt(h)"),
        Quantity::SpecificForce => ("velocity random walk", "m/s/sqrt(h)"),
    };
    in_unit(density_si, unit).map(|value| format!("{name} {value}"))
}

fn floor_name(coefficient: &Measured, quantity: Quantity) -> String {
    let unit = match quantity {
        Quantity::AngularRate => "deg/h",
        Quantity::SpecificForce => "mg",
    };
    let floor = FLICKER_FLOOR * coefficient.si();
    in_unit(floor, unit).map_or_else(String::new, |value| format!("Allan floor 0.6643 B = {value}"))
}

/// The driving noise of a Gauss-Markov process: the random walk it is at short times.
fn driving_name(std_dev: &Measured, correlation_time: &Measured) -> String {
    let unit = std_dev.unit.times_time(-1);
    let driving = std_dev.si() * (2.0 / correlation_time.si()).sqrt();
    format!("driving noise {} {unit}", digits(unit.from_si(driving)))
}

fn walk_name(density: &Measured, quantity: Quantity) -> String {
    let unit = match quantity {
        Quantity::AngularRate => "deg/h/sqrt(h)",
        Quantity::SpecificForce => "mg/sqrt(h)",
    };
    in_unit(density.si(), unit).unwrap_or_default()
}

/// Candidates shown; all are in the JSON document.
const SHOWN_CANDIDATES: usize = 6;

/// The models that were compared; none for the graphical recipe.
pub(super) fn candidates(candidates: &[Candidate]) -> Option<Shown> {
    let chosen = candidates.iter().find(|c| c.chosen)?;
    let best = candidates.iter().map(|c| c.score).fold(f64::INFINITY, f64::min);
    let shown = |(place, c): &(usize, &Candidate)| *place < SHOWN_CANDIDATES || c.chosen;
    let against = |own: Option<f64>, other: Option<f64>| match (own, other) {
        (Some(own), Some(other)) => format!("{:+.2}", own - other),
        _ => "-".into(),
    };
    let row = |(_, c): (usize, &Candidate)| {
        let mark = match (c.chosen, c.identified) {
            (true, _) => "chosen",
            (false, false) => "not identified",
            (false, true) => "",
        };
        let figures = match c.chi_square.zip(c.dof) {
            Some((chi_square, dof)) => [digits(chi_square), dof.to_string(), digits(c.score)],
            None => [
                against(c.log_likelihood, chosen.log_likelihood),
                against(c.held_out, chosen.held_out),
                format!("{:+.2}", c.score - best),
            ],
        };
        [vec![c.model.clone(), c.parameters.to_string()], figures.to_vec(), vec![mark.to_string()]].concat()
    };
    let rows = candidates.iter().enumerate().filter(shown).map(row).collect();
    Some(if chosen.chi_square.is_some() {
        Shown {
            caption: "Candidates (score = chi-square + 4 per parameter + 4 per process; lowest wins)",
            header: &["model", "parameters", "chi-square", "dof", "score", ""],
            rows,
        }
    } else {
        Shown {
            caption: "Candidates (ln L of the log, and of its last third under what the first two thirds give, against the chosen; score: \
                      -2 ln L plus a cost for every process, lowest wins, unless one within 6 of it foretells that third better by more than 3)",
            header: &["model", "parameters", "ln L", "held out", "score", ""],
            rows,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_without_end_is_a_dash() {
        let shown = |std_dev_percent: f64, cramer_rao_percent: f64| {
            cells(Some(&Precision { parameter: String::new(), std_dev_percent, cramer_rao_percent }))
        };
        assert_eq!(shown(3.0, 2.0), ["3.000", "2.000", "1.50"]);
        assert_eq!(shown(3.0, f64::INFINITY), ["3.000", "-", "-"]);
        assert_eq!(shown(f64::INFINITY, f64::INFINITY), ["-", "-", "-"]);
        assert_eq!(cells(None), ["-", "-", "-"]);
    }
}
