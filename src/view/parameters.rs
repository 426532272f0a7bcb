//! Noise parameters, one row each.

use crate::identify::{Identified, Precision};
use crate::noise::FLICKER_FLOOR;
use crate::params::{Measured, TermEntry};
use crate::report::Section;
use crate::units::{Quantity, Unit, digits};

/// Values with intervals; of the likelihood method with standard deviations and their bound.
pub(super) fn table<'a>(section: Section<'a>, found: &Identified, quantity: Quantity) -> Section<'a> {
    let turn_on = found.params.turn_on_bias.as_ref();
    let name = if turn_on.is_some() { "bias (mean of all starts)" } else { "bias (mean of this log)" };
    let bias = found.params.bias.iter().map(|bias| row(name, bias, String::new()));
    let bias = bias.chain(turn_on.map(|spread| row("turn-on bias sigma", spread, String::new())));
    let terms = term_rows(&found.params.terms, quantity, 1.0 / found.curve.dt);
    if found.precision.is_empty() {
        let header = ["parameter", "value", "95 % from", "to", "unit", "also"];
        return section.table("Parameters with 95 % intervals", &header, bias.chain(terms));
    }
    let with_bound = |mut row: Vec<String>, precision: Option<&Precision>| {
        row.splice(5..5, cells(precision));
        row
    };
    let mut precision = found.precision.iter();
    let terms = terms.into_iter().map(|row| with_bound(row, precision.next()));
    section
        .table(
            "Parameters with 95 % intervals, and their standard deviation beside the Cramér-Rao bound of a log like \
             this",
            &["parameter", "value", "95 % from", "to", "unit", "sd (%)", "bound (%)", "ratio", "also"],
            bias.map(|row| with_bound(row, None)).chain(terms),
        )
        .minor(&["sd (%)", "bound (%)", "ratio"])
}

/// Standard deviation, its bound and their ratio, as far as there are any.
fn cells(precision: Option<&Precision>) -> [String; 3] {
    let none = || "-".to_string();
    match precision {
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
pub(super) fn term_rows(terms: &[TermEntry], quantity: Quantity, sample_rate_hz: f64) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let wideband: Vec<&Measured> = terms.iter().filter_map(TermEntry::wideband_density).collect();
    let total = wideband.iter().map(|density| density.si()).fold(0.0, f64::hypot);
    // beside the last of them stands the random walk of all
    let and_all = |density: &Measured, also: Option<String>| {
        let last = wideband.last().is_some_and(|last| std::ptr::eq(*last, density));
        let all = if last { random_walk_name(total, quantity) } else { None };
        also.into_iter().chain(all).collect::<Vec<_>>().join("; ")
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
