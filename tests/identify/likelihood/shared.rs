//! One correlation time for all axes, or one for each.

use kfdesign::identify::{TimeProfile, shared_time};

use super::*;

fn profiles(times: [f64; 3], seed: u64) -> Vec<Identified> {
    let choice = parse_model("white+gm").unwrap();
    let axis = |(i, time): (u64, f64)| {
        let rate = log(&[white(0.02 * (i + 1) as f64), gauss_markov(0.1, time)], 8000, 1.0, seed, i);
        identify(&rate, 1.0, &choice)
    };
    (0..).zip(times).map(axis).collect()
}

fn of(found: &[Identified]) -> kfdesign::identify::SharedTime {
    let profiles: Vec<&TimeProfile> = found.iter().map(|axis| axis.time_profile.as_ref().unwrap()).collect();
    shared_time(&profiles).unwrap()
}

/// Three axes of one time, 40 s, white noise of 1 to 3: the ratio is χ²₂ (beyond 23 with 1e-5), the common time
/// within 4.5 standard deviations of the truth (7e-6), those being at most 1/√3 of one axis' own bound for the axis
/// with the least noise, and the interval as wide as they say (25 %, the scatter of the curvature).
#[test]
fn one_time_is_found_and_known_better() {
    let found = profiles([40.0; 3], 3);
    let shared = of(&found);
    assert!(shared.likelihood_ratio < 23.0 && shared.p_value > 1e-5, "{shared:?}");
    let bounds = (1..=3).map(|i| bound(0.02 * f64::from(i), 0.1, 40.0, 8000, 1.0)[2]);
    let sigma = bounds.map(|b| b.powi(-2)).sum::<f64>().powf(-0.5);
    assert!((shared.correlation_time_s / 40.0).ln().abs() < 4.5 * sigma, "{shared:?}, {sigma}");
    let width = (shared.upper_s.unwrap() / shared.lower_s.unwrap()).ln();
    assert!((width / (2.0 * 1.96 * sigma) - 1.0).abs() < 0.25, "{width} for {}", 2.0 * 1.96 * sigma);
}

/// Times of 10, 40 and 160 s are ten and more standard deviations apart.
#[test]
fn different_times_are_told() {
    let shared = of(&profiles([10.0, 40.0, 160.0], 4));
    assert!(shared.p_value < 1e-6 && shared.likelihood_ratio > 30.0, "{shared:?}");
    assert!(shared.correlation_time_s > 10.0 && shared.correlation_time_s < 160.0, "{shared:?}");
}

#[test]
fn one_axis_or_another_model_has_nothing_to_share() {
    let found = profiles([40.0; 3], 5);
    assert!(shared_time(&[found[0].time_profile.as_ref().unwrap()]).is_none());
    let rate = log(&[white(0.05)], 4000, 1.0, 6, 0);
    assert!(identify(&rate, 1.0, &parse_model("white").unwrap()).time_profile.is_none());
}

/// The command says it of a log whose axes all have a drift of their own.
#[test]
fn the_command_says_whether_the_axes_share_a_time() {
    let bench = crate::support::Bench::new();
    let axes = [0, 1].map(|axis| log(&[white(0.02), gauss_markov(0.1, 40.0)], 8000, 1.0, 3, axis));
    let rows: String = axes[0].iter().zip(&axes[1]).map(|(x, y)| format!("{x:.6},{y:.6}\n")).collect();
    bench.file("log.csv", format!("gyro_x (deg/s),gyro_y (deg/s)\n{rows}"));
    let text = bench.ok("identify log.csv --rate 1 --model white+gm");
    assert!(
        text.contains("One correlation time for all axes: ") && text.contains("does not tell the axes apart"),
        "{text}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&bench.ok("identify log.csv --rate 1 --model white+gm --json")).unwrap();
    assert!(json["shared_correlation_time"]["p_value"].as_f64().unwrap() > 1e-5, "{json}");
    let one = bench.ok("identify log.csv --rate 1 --model white+gm --columns 1");
    assert!(!one.contains("One correlation time"), "{one}");
}
