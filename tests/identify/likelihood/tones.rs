//! Steady tones, drift that a log does not tell, slopes that are none.

use kfdesign::identify::recent;
use kfdesign::params::TermEntry;

use super::*;

fn tone(amplitude: f64, frequency: f64, dt: f64, rate: &mut [f64]) {
    rate.iter_mut().enumerate().for_each(|(k, x)| *x += amplitude * (TAU * frequency * k as f64 * dt).sin());
}

fn oscillation(found: &Identified) -> [f64; 2] {
    found
        .model
        .terms
        .iter()
        .find_map(|term| match term {
            Term::Oscillation { std_dev, correlation_time, .. } => Some([*std_dev, *correlation_time]),
            _ => None,
        })
        .expect("a line")
}

/// 0.5 sin(2π 12.3456 Hz t) has the standard deviation 0.354 and no end, and no line of finite correlation time is
/// that: what is found is the nearest one, within a factor of 1.5. Of the correlation time a lower limit is told, so
/// of the standard deviation, which grows with it, too; and what is said of drift is what the same noise without the
/// tone says, within a factor of 2.
#[test]
fn a_steady_tone_is_a_line_without_an_end() {
    let dt = 0.01;
    let mut rate = log(&[white(0.01)], 60_000, dt, 77, 0);
    let alone = identify(&rate, dt, &ModelChoice::Auto);
    tone(0.5, 12.3456, dt, &mut rate);
    let found = identify(&rate, dt, &ModelChoice::Auto);
    let [sigma, time] = oscillation(&found);
    let line = found.params.terms.iter().find_map(|term| match term {
        TermEntry::Oscillation { std_dev, .. } => std_dev.interval_si(),
        _ => None,
    });
    let [low, high] = line.unwrap();
    assert!(low < sigma.min(0.3536) && high.is_infinite(), "{low} {sigma} {high}");
    assert!((0.2357..0.53).contains(&sigma), "{sigma}");
    assert!(time > 60.0, "{time}");
    let said = |found: &Identified, term: &str| {
        let entry = found.not_identified.iter().find(|entry| entry.term == term);
        entry.unwrap_or_else(|| panic!("{term}: {:?}", found.not_identified)).reason.clone()
    };
    assert!(said(&found, "oscillation.correlation_time").starts_with("above "));
    let limit = |found: &Identified| {
        let reason = said(found, "rate_random_walk");
        reason.split("above ").last().unwrap().split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let ratio = limit(&found) / limit(&alone);
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    assert!((found.model.white_density() / alone.model.white_density() - 1.0).abs() < 0.01);
}

/// A sinusoid alone is told; white noise of its power has its standard deviation, √dt times (whole periods: to 1e-6,
/// the search ends within 1e-4).
#[test]
fn a_sinusoid_alone_is_told() {
    let dt = 0.01;
    let mut rate = vec![0.0; 30_000];
    tone(0.5, 1.0, dt, &mut rate);
    let forced = identify(&rate, dt, &parse_model("white").unwrap());
    let expected = 0.5 / 2.0_f64.sqrt() * dt.sqrt();
    assert!((forced.model.white_density() / expected - 1.0).abs() < 1e-3, "{}", forced.model.white_density());
    let told = |found: &Identified| {
        let words = found.warnings.iter().find(|words| words.contains("a sinusoid, not noise"))?;
        words.split("at ").nth(1)?.split(' ').next()?.parse::<f64>().ok()
    };
    assert!(told(&forced).is_some_and(|frequency| (frequency - 1.0).abs() < 1e-3), "{:?}", forced.warnings);
    let found = identify(&rate, dt, &ModelChoice::Auto);
    assert_eq!(recent(&rate, dt, &found.fitted.unwrap()), None, "that it goes on is no change of the noise");
    // nine tenths of the power in a line are the noise of some sensors
    let mut noisy = log(&[white(0.01)], 30_000, dt, 78, 0);
    tone(0.4, 1.0, dt, &mut noisy);
    assert_eq!(told(&identify(&noisy, dt, &parse_model("white").unwrap())), None);
    // a walk has as much of its power at its lowest frequencies, and is none
    let walk = log(&[white(0.001), Term::RateRandomWalk { density: 1.0 }], 30_000, dt, 79, 0);
    assert_eq!(told(&identify(&walk, dt, &parse_model("white+rrw").unwrap())), None);
}

/// Eight minutes of drift of 100 s, model given: often the drift is not identified, but it moves the mean of the
/// log, and the interval of the bias counts it. Of 40 intervals that would hold the truth in nine tenths (the drift
/// is estimated from five correlation times) fewer than 26 do with a probability of 1e-6; with white noise alone it
/// is one.
#[test]
fn the_bias_counts_drift_that_is_not_told() {
    let choice = parse_model("white+gm").unwrap();
    let covers = |run: u64| {
        let found = identify(&log(&[white(0.005), gauss_markov(0.03, 100.0)], 480, 1.0, 79, run), 1.0, &choice);
        let [low, high] = found.params.bias.unwrap().interval_si().unwrap();
        (low < 0.0 && 0.0 < high, found.model.terms.len() == 1)
    };
    let found: Vec<(bool, bool)> = (0..40).map(covers).collect();
    let count = |of: fn(&(bool, bool)) -> bool| found.iter().filter(|own| of(own)).count();
    assert!(count(|own| own.0) >= 26, "{found:?}");
    assert!(count(|own| own.1) >= 5, "none of these logs lacks the drift: {found:?}");
}

/// Slopes of two of their standard deviations, √12 N T^(−3/2) each: what is chosen has no ramp whose interval holds
/// zero.
#[test]
fn a_slope_whose_interval_holds_zero_is_not_identified() {
    let slope = 2.0 * 12.0_f64.sqrt() * 0.05 * 300.0_f64.powf(-1.5);
    let terms = [white(0.05), Term::RateRamp { slope }];
    let mut ramps = 0;
    for run in 0..150 {
        let found = identify(&log(&terms, 300, 1.0, 80, run), 1.0, &ModelChoice::Auto);
        for term in &found.params.terms {
            if let TermEntry::RateRamp { slope } = term {
                let [low, high] = slope.interval_si().unwrap();
                assert!(low * high > 0.0, "run {run}: {low} to {high}");
                ramps += 1;
            }
        }
    }
    assert!(ramps > 5, "{ramps}");
}

/// `ma3` is an average over three samples, `ma` one of a length that the log chooses: here two.
#[test]
fn the_length_of_an_average_may_be_said() {
    let rate = log(&[white(0.02), Term::MovingAverage { density: 0.05, samples: 2 }], 5000, 0.01, 81, 0);
    let samples = |model: &str| {
        let found = identify(&rate, 0.01, &parse_model(model).unwrap());
        found.model.terms.iter().find_map(|term| match term {
            Term::MovingAverage { samples, .. } => Some(*samples),
            _ => None,
        })
    };
    assert_eq!(["white+ma", "white+ma2", "white+ma3", "ma4+white"].map(samples), [Some(2), Some(2), Some(3), Some(4)]);
    for bad in ["white+ma65", "white+ma1", "white+ma2+ma3"] {
        assert!(parse_model(bad).is_err(), "{bad}");
    }
}
