//! Sensors behind a low-pass: the filter is found, drift stays drift, and the innovations of what was not seen are
//! white.

use super::*;
use kfdesign::noise::{Filter, Kind};

use crate::support::Bench;

/// Butterworth low-passes of order 1 to 3 by `scipy.signal.butter(order, 2 corner)`, and what is no Butterworth
/// filter: sinc³ of four samples.
fn filters() -> Vec<(&'static str, Filter)> {
    let of = |b: &[f64], a: &[f64]| Filter::new(b, a).unwrap();
    vec![
        ("order 1 at 0.05", of(&[1.0, 1.0], &[1.0, -0.726_542_528_005_360_9])),
        ("order 2 at 0.1", of(&[1.0, 2.0, 1.0], &[1.0, -1.142_980_502_539_901_1, 0.412_801_598_096_188_77])),
        (
            "order 3 at 0.02",
            of(
                &[1.0, 3.0, 3.0, 1.0],
                &[1.0, -2.748_835_809_214_676_6, 2.528_231_219_142_558_7, -0.777_638_560_238_080_1],
            ),
        ),
        ("sinc³ of 2", of(&[1.0, 3.0, 3.0, 1.0], &[8.0])),
    ]
}

/// A tenth of a unit of white noise at 100 Hz behind each filter, the converter's own noise, and drift of 20 s. In
/// the first 30,000 samples N is found within 4 of its standard deviations (false alarm 6.3e-5 each) and the drift
/// is a Gauss-Markov process or a walk; the next 30,000 are white to the filter that is made of it: largest of 50
/// autocorrelations below 4.6/√n (2e-4 each).
#[test]
fn low_passes_are_found_and_whitened() {
    for (i, (name, filter)) in filters().into_iter().enumerate() {
        let terms = [white(0.0005), Term::BandLimit { density: 0.1, filter }, gauss_markov(0.05, 20.0)];
        let rate = log(&terms, 60_000, 0.01, 91, i as u64);
        let (first, second) = rate.split_at(30_000);
        let found = identify(first, 0.01, &ModelChoice::Auto);
        let limit = found.model.terms.iter().find_map(|term| match term {
            Term::BandLimit { density, filter } => Some((*density, *filter)),
            _ => None,
        });
        let (density, shape) = limit.unwrap_or_else(|| panic!("{name}: {}", model(&found)));
        let sigma =
            0.01 * found.precision.iter().find(|p| p.parameter == "band_limit.density").unwrap().std_dev_percent;
        assert!(sigma < 0.05 && (density / 0.1).ln().abs() < 4.0 * sigma, "{name}: {density} ± {sigma}");
        let [from, to] = [shape, filter].map(|f| f.half_power().unwrap());
        // a lower order than the true one describes the corner well enough for white innovations, no better
        assert!((from / to).ln().abs() < 0.25, "{name}: half power at {from}, {to}");
        let drift = |kind: Kind| found.model.terms.iter().any(|term| term.kind() == kind);
        assert!(drift(Kind::GaussMarkov) || drift(Kind::RateRandomWalk), "{name}: {}", model(&found));
        assert!(!drift(Kind::Oscillation), "{name}: {}", model(&found));
        let n = second.len() as f64;
        let innovations = whitened(&found, second);
        let largest = largest_autocorrelation(&innovations);
        assert!(largest < 4.6 / n.sqrt(), "{name}: {largest}");
        // the level is known from as many samples as it is tried on; 5 standard deviations
        let nis = innovations.iter().map(|y| y * y).sum::<f64>() / n;
        assert!((nis - 1.0).abs() < 10.0 / n.sqrt(), "{name}: {nis}");
    }
}

/// Over lags 1 to 50.
fn largest_autocorrelation(innovations: &[f64]) -> f64 {
    let r = |lag: usize| innovations.iter().zip(&innovations[lag..]).map(|(a, b)| a * b).sum::<f64>();
    (1..=50).map(|lag| (r(lag) / r(0)).abs()).fold(0.0, f64::max)
}

/// The chosen terms as `--model` has them.
fn model(found: &Identified) -> &str {
    &found.candidates.iter().find(|c| c.chosen).unwrap().model
}

/// Innovations over their standard deviations, by a Kalman filter written out here.
fn whitened(found: &Identified, rate: &[f64]) -> Vec<f64> {
    use nalgebra::{DMatrix, DVector};
    let states: Vec<_> = found.model.terms.iter().filter_map(|term| term.realisation(0.01, 300.0)).collect();
    let n = 1 + states.iter().map(|s| s.names.len()).sum::<usize>();
    let (mut f, mut q, mut p) = (DMatrix::identity(n, n), DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    let mut h = DVector::zeros(n);
    (h[0], p[(0, 0)]) = (1.0, 1.0);
    let mut at = 1;
    for own in &states {
        let size = own.names.len();
        f.view_mut((at, at), (size, size)).copy_from(&own.phi);
        q.view_mut((at, at), (size, size)).copy_from(&own.q);
        p.view_mut((at, at), (size, size)).copy_from(&own.p0);
        h.rows_mut(at, size).copy_from(&own.h.transpose());
        at += size;
    }
    let r = found.model.white_density().powi(2) / 0.01;
    let mut x = DVector::zeros(n);
    let sample = |z: &f64| {
        let innovation = z - h.dot(&x);
        let ph = &p * &h;
        let s = h.dot(&ph) + r;
        let gain = &ph / s;
        x += &gain * innovation;
        let keep = DMatrix::identity(n, n) - &gain * h.transpose();
        let updated = &keep * &p * keep.transpose() + &gain * gain.transpose() * r;
        x = &f * &x;
        p = &f * updated * f.transpose() + &q;
        innovation / s.sqrt()
    };
    rate.iter().map(sample).collect()
}

/// `scipy.signal.cheby1(6, 1, 0.4)`, 30,000 samples: more poles than are tried at first, one by one. With those
/// found the largest of 50 autocorrelations of the next 30,000 innovations is below 4.6/√n (2e-4).
#[test]
fn steep_filters_grow() {
    let b = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];
    let a = [
        1.0,
        -2.838_622_369_916_386,
        4.635_199_457_533_748,
        -4.806_193_018_747_612,
        3.316_783_977_970_292,
        -1.434_670_820_600_863,
        0.313_430_552_783_335,
    ];
    let limited = Term::BandLimit { density: 0.1, filter: Filter::new(&b, &a).unwrap() };
    let rate = log(&[white(0.0005), limited, gauss_markov(0.05, 20.0)], 60_000, 0.01, 95, 0);
    let (first, second) = rate.split_at(30_000);
    let found = identify(first, 0.01, &ModelChoice::Auto);
    let order = found.model.terms.iter().find_map(|term| match term {
        Term::BandLimit { filter, .. } => Some(filter.denominator().len() - 1),
        _ => None,
    });
    assert!(order.is_some_and(|order| order > 4), "{}", model(&found));
    let largest = largest_autocorrelation(&whitened(&found, second));
    assert!(largest < 4.6 / (second.len() as f64).sqrt(), "{largest}");
}

/// A filter asked for by name takes no drift of 500 samples (its density would be σ √(2 Tc), 160 times that of the
/// white noise) and no line of 150 samples: that is refused.
#[test]
fn drift_and_lines_are_no_filter() {
    let bl = |order: &str| parse_model(order).unwrap();
    let drift = log(&[white(0.01), gauss_markov(0.5, 5.0)], 60_000, 0.01, 96, 0);
    let found = identify(&drift, 0.01, &bl("bl1"));
    let density = found.model.terms.iter().find_map(|term| match term {
        Term::BandLimit { density, .. } => Some(*density),
        _ => None,
    });
    assert!(density.is_some_and(|density| (0.005..0.02).contains(&density)), "{density:?}");
    let line = Term::Oscillation { std_dev: 0.3, frequency_hz: 20.0, correlation_time: 1.5 };
    let bench = Bench::new();
    let rows = log(&[white(0.01), line], 30_000, 0.01, 97, 0).into_iter().map(|v| format!("{v}\n"));
    bench.file("log.csv", std::iter::once("gyro_x (rad/s)\n".to_string()).chain(rows).collect::<String>());
    let refused = bench.run("identify log.csv --rate 100 --model bl2");
    assert_eq!(refused.status, 2, "{}", refused.stdout);
    assert!(refused.stderr.contains("would be a line (osc) or drift (gm, flicker, rrw)"), "{}", refused.stderr);
}

/// Filters that were refused or spoiled before: a Butterworth low-pass without a converter behind it, of which
/// nothing is left at half the sample rate, a second-order one with a resonance of quality 10, and one that takes
/// low frequencies off. 60,000 samples: N and the drift's driving noise within 4 of their standard deviations (6e-5
/// each), no line for what is none, and the next 60,000 are white to the filter (4.6/√n, 2e-4 each).
#[test]
fn filters_without_a_floor_with_a_resonance_and_the_wrong_way_up() {
    let of = |b: &[f64], a: &[f64]| Filter::new(b, a).unwrap();
    let clean = of(&[1.0, 2.0, 1.0], &[1.0, -0.747_789_178_258_503_4, 0.272_214_937_925_007_17]);
    let resonant = of(&[1.0, 2.0, 1.0], &[1.0, -0.830_418_727_384_237_6, 0.913_788_196_868_377_3]);
    let rising = of(&[1.0, -0.9], &[1.0, 0.3]);
    for (i, (name, filter, floor)) in
        [("clean", clean, 1e-9), ("resonant", resonant, 1e-9), ("rising", rising, 0.002)].into_iter().enumerate()
    {
        let terms = [white(floor), Term::BandLimit { density: 0.1, filter }, gauss_markov(0.05, 20.0)];
        let rate = log(&terms, 120_000, 0.01, 98, i as u64);
        let (first, second) = rate.split_at(60_000);
        let found = identify(first, 0.01, &ModelChoice::Auto);
        let told = model(&found);
        assert!(told.starts_with("bl") && !told.contains("osc") && told.ends_with("+gm"), "{name}: {told}");
        for (parameter, truth) in [("band_limit.density", 0.1), ("gauss_markov.std_dev", 0.05)] {
            let own = found.precision.iter().find(|p| p.parameter == parameter).unwrap();
            let value = found.model.terms.iter().find_map(|term| match *term {
                Term::BandLimit { density, .. } if parameter.starts_with("band") => Some(density),
                Term::GaussMarkov { std_dev, .. } if parameter.starts_with("gauss") => Some(std_dev),
                _ => None,
            });
            let off = (value.unwrap() / truth).ln() / (0.01 * own.std_dev_percent);
            assert!(off.abs() < 4.0, "{name}: {parameter} {value:?}, {off}");
        }
        let n = second.len() as f64;
        let largest = largest_autocorrelation(&whitened(&found, second));
        assert!(largest < 4.6 / n.sqrt(), "{name}: {largest}");
    }
}

/// An average over 14 samples has zeros that a bin of 2.5 % is too wide for: white noise of a hundredth of its
/// density beside it is found within 4 standard deviations (6e-5); with bins that wide it comes out a quarter too
/// large, with an interval of 4 %.
#[test]
fn bins_are_fine_where_an_average_has_its_zeros() {
    let terms = [white(0.001), Term::MovingAverage { density: 0.1, samples: 14 }, gauss_markov(0.05, 20.0)];
    let found = identify(&log(&terms, 100_000, 0.01, 99, 0), 0.01, &parse_model("white+ma14+gm").unwrap());
    let own = found.precision.iter().find(|p| p.parameter == "white.density").unwrap();
    let density = found.model.white_density();
    let off = (density / 0.001).ln() / (0.01 * own.std_dev_percent);
    assert!(off.abs() < 4.0 && own.std_dev_percent < 5.0, "{density}, {off}");
}

/// Averages of more samples than are all tried, with white noise of a tenth of their density and a random walk: the
/// length is found, 16 as well, and no line stands in the zeros. Of the next 30,000 samples behind the average of 20
/// the largest of 50 autocorrelations is below 4.6/√n (2e-4; as lines and a filter, before, 0.03 and more).
#[test]
fn long_averages_are_found_and_whitened() {
    for (run, samples) in [(0, 16), (1, 20), (2, 33), (3, 64), (4, 18), (5, 27), (6, 40), (7, 50)] {
        let terms =
            [white(0.01), Term::MovingAverage { density: 0.1, samples }, Term::RateRandomWalk { density: 0.01 }];
        let rate = log(&terms, 60_000, 0.01, 103, run);
        let (first, second) = rate.split_at(30_000);
        let found = identify(first, 0.01, &ModelChoice::Auto);
        let own = |term: &Term| if let Term::MovingAverage { samples, .. } = term { Some(*samples) } else { None };
        assert_eq!(found.model.terms.iter().find_map(own), Some(samples), "{}", model(&found));
        assert!(found.model.terms.iter().all(|term| term.kind() != Kind::Oscillation), "{}", model(&found));
        if samples == 20 {
            let largest = largest_autocorrelation(&whitened(&found, second));
            assert!(largest < 4.6 / (second.len() as f64).sqrt(), "{largest}");
        }
    }
}

/// Two narrow lines and a wide one, twelve logs of half a minute, are no filter with a resonance: what takes a
/// filter first, for it explains more than one line does, stays there in four.
#[test]
fn lines_are_no_filter() {
    let line = |std_dev, frequency_hz, correlation_time| Term::Oscillation { std_dev, frequency_hz, correlation_time };
    let terms = [white(0.0119), line(0.061, 14.1, 0.113), line(0.0238, 20.06, 19.9), line(0.0232, 20.66, 19.9)];
    let limited = (0..12).filter(|run| {
        let found = identify(&log(&terms, 3137, 1.0 / 100.3, 94, *run), 1.0 / 100.3, &ModelChoice::Auto);
        found.model.terms.iter().any(|term| term.kind() == Kind::BandLimit)
    });
    assert_eq!(limited.count(), 0);
}

/// 40 logs of white noise: no filter is seen in any (a gain of 24 is the cost of the first order; in 300 other such
/// logs noise reached 14.6 at most, and 13.2 in one of a hundred. The tail falls like that of χ², so one log in more
/// than 10⁴, and three of 40 below 1e-7).
#[test]
fn white_noise_has_no_filter() {
    let limited = (0..40).filter(|run| {
        let found = identify(&log(&[white(0.1)], 3000, 0.01, 92, *run), 0.01, &ModelChoice::Auto);
        found.model.terms.iter().any(|term| term.kind() == Kind::BandLimit)
    });
    assert!(limited.count() < 3);
}

/// Asked for by name; averages and quantisation beside it are refused, white noise comes with it.
#[test]
fn by_name() {
    let (_, filter) = filters()[1];
    let rate =
        log(&[white(0.001), Term::BandLimit { density: 0.1, filter }, gauss_markov(0.05, 20.0)], 30_000, 0.01, 93, 0);
    let found = identify(&rate, 0.01, &parse_model("bl2+gm").unwrap());
    assert_eq!(model(&found), "bl2+gm");
    assert_eq!(model(&identify(&rate, 0.01, &parse_model("white+bl2+gm").unwrap())), "bl2+gm");
    let auto = identify(&rate, 0.01, &ModelChoice::Auto);
    let ln_l = |found: &Identified| found.candidates.iter().find(|c| c.chosen).unwrap().log_likelihood.unwrap();
    if model(&auto) == "bl2+gm" {
        assert!((ln_l(&auto) - ln_l(&found)).abs() < 0.01, "{} {}", ln_l(&auto), ln_l(&found));
    }
    for bad in ["bl2+ma2", "white+bl+quantization", "bl7", "bl+bl"] {
        assert!(parse_model(bad).is_err(), "{bad}");
    }
}

/// What the samples add up to, as datasheets call it, is told once, of all wideband noise together: 60 √(0.02² +
/// 0.05²) = 3.231 deg/√h. The density at low frequencies is known to 1 % from 20,000 samples; 4 standard deviations.
#[test]
fn the_random_walk_is_that_of_all_wideband_noise() {
    let bench = Bench::new();
    let density = |value: f64| format!(r#"{{"density": {{"value": {value}, "unit": "deg/s/sqrt(Hz)"}}}}"#);
    bench.file(
        "params.json",
        format!(
            r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": {{"value": 100, "unit": "Hz"}}, "axes": [{{"name": "gyro_x",
            "white": {}, "moving_average": [{{"samples": 2, {}]}}]}}"#,
            density(0.02),
            &density(0.05)[1..]
        ),
    );
    bench.ok("simulate params.json -o log.npy --duration 200s --seed 5");
    let told = bench.ok("identify log.npy --model white+ma2");
    let rows: Vec<&str> = told.lines().filter(|line| line.contains("angle random walk")).collect();
    assert!(rows.len() == 1 && rows[0].starts_with("moving average N"), "{told}");
    let words: Vec<&str> = rows[0].split("angle random walk ").nth(1).unwrap().split(' ').collect();
    let shown: f64 = words[0].parse().unwrap();
    assert!((shown / 3.231 - 1.0).abs() < 0.04 && words[1] == "deg/sqrt(h)", "{told}");
}
