//! Pages and figures made from result records: they show what the record says.

use kfdesign::allan::{self, Deviation, TauGrid};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, stream};
use kfdesign::report;
use kfdesign::units::Unit;

use super::save;

/// A sensor like the reference, with a faster drift.
fn terms() -> [Term; 2] {
    let unit = Unit::parse("deg/s").unwrap();
    let si = |v: f64| unit.to_si(v);
    [Term::White { density: si(0.0562) }, Term::GaussMarkov { std_dev: si(0.02806), correlation_time: 60.0 }]
}

/// Half an hour of it at 2 Hz: samples and their period.
fn log(run: u64) -> (Vec<f64>, f64) {
    let dt = 0.5;
    let mut rate = vec![0.0; 4000];
    let mut part = rate.clone();
    for (i, term) in terms().iter().enumerate() {
        term.sample_path(dt, stream(1, StreamId { run, axis: 0, term: i as u32 })).fill(&mut part);
        rate.iter_mut().zip(&part).for_each(|(sum, value)| *sum += value);
    }
    (rate, dt)
}

#[test]
fn allan_figure_shows_the_curve_of_the_record() {
    let unit = Unit::parse("deg/s").unwrap();
    let (rate, dt) = log(0);
    let curve = allan::curve(&rate, dt, Deviation::Oadev, TauGrid::Octave).unwrap();
    let model = NoiseModel { terms: terms().to_vec() };
    let svg = report::allan::figure("gyro_x", &curve, Some(&model), &unit);
    save("allan-record.svg", &svg);
    // one dot a point, one in the legend, and a ring where N is read
    assert_eq!(svg.matches("<circle").count(), curve.points.len() + 2);
    assert!(svg.contains("N = 0.0562 deg/s/√Hz") && svg.contains("σ = 0.0281 deg/s, 60.00 s"));
    assert!(svg.contains("deviation (deg/s)") && svg.contains("white noise"));
    // without a model there is nothing fitted
    let bare = report::allan::figure("gyro_x", &curve, None, &unit);
    assert!(!bare.contains("fitted") && bare.contains("95 % interval"));
}
