//! Reference-sensor flights of ten minutes with a heading aid: does the filter tell the truth?

use kfdesign::consistency::Verdict;
use kfdesign::filter::Kalman;
use kfdesign::montecarlo::{Plan, verify};
use kfdesign::numerics::distribution::chi_square_quantile;
use kfdesign::numerics::linalg::mahalanobis;
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::simulate::{Scenario, Simulator, TrueRate};
use kfdesign::tune::{TuneOptions, Tuned, tune};

use super::gyro;

const WHITE: &str = r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#;
const CORRELATED: &str = r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz",
    "gauss_markov": {"std_dev": "3 deg", "correlation_time": "60 s"}}]}"#;

fn tuned(design: &str) -> Tuned {
    tune(&gyro(design), &TuneOptions::default()).unwrap()
}

/// False alarm 1e-5 each.
#[test]
fn the_gate_finds_the_angle_filter_consistent_and_its_bias_sigma_true() {
    for design in [WHITE, CORRELATED] {
        let tuned = tuned(design);
        let plan = Plan { runs: 100, alpha: 1e-5, ..Plan::quick(100.0) };
        assert_eq!(plan.steps, 60_000);
        let outcome = verify(&tuned.design, &plan).unwrap();
        assert_eq!(outcome.verdict, Verdict::Consistent, "{}", outcome.meaning);
        let axis = &outcome.axes[0];
        let names: Vec<&str> = axis.errors.iter().map(|error| error.name.as_str()).collect();
        assert_eq!(names[..3], ["angle", "bias", "gauss_markov"], "every state is judged");
        let bias = &axis.errors[1];
        let (rms, sigma) = (bias.rms[bias.rms.len() - 1], bias.predicted_sigma[bias.rms.len() - 1]);
        let bounds = [5e-6, 1.0 - 5e-6].map(|p| (chi_square_quantile(p, 100.0) / 100.0).sqrt());
        assert!((bounds[0]..bounds[1]).contains(&(rms / sigma)), "{rms} {sigma}");
        // that sigma is the one that tune predicts for the end of the flight
        let predicted = &tuned.reports[0].predicted;
        let near = predicted.time_s.iter().position(|t| *t > 500.0).unwrap();
        let (time, promised) = (predicted.time_s[near], predicted.sigma[1][near]);
        assert!((time - 562.0).abs() < 1.0 && (sigma / promised - 1.0).abs() < 0.1, "{time} s: {sigma} {promised}");
    }
}

/// Another road than the gate's: sensor streams from `simulate` with a turning vehicle, its true angle summed up
/// here, the heading made here. Each bound is left with probability 1e-5.
#[test]
fn simulated_flights_are_followed_as_claimed() {
    const FLIGHTS: u64 = 40;
    const SAMPLES: u64 = 60_000;
    let degrees = std::f64::consts::PI / 180.0;
    for (design, correlated) in [(WHITE, None), (CORRELATED, Some((3.0 * degrees, 60.0)))] {
        let params = gyro(design);
        let tuned = tuned(design);
        let model = &tuned.design.axes[0].model;
        let (mut nees, mut bias, mut nis, mut updates) = (0.0, 0.0, 0.0, 0.0);
        for run in 0..FLIGHTS {
            let scenario = Scenario {
                seed: 5,
                run,
                samples: SAMPLES,
                rate_hz: 100.0,
                true_rate: TrueRate::Sinusoid { amplitude: 20.0 * degrees, frequency_hz: 0.05 },
                turn_on: true,
                saturation: None,
                quantisation: None,
            };
            let mut flight = Simulator::new(&params, &scenario).unwrap();
            let mut rng = stream(99, StreamId { run, axis: 0, term: 0 });
            let mut angle = model.p0[(0, 0)].sqrt() * normal(&mut rng);
            let mut heading_error = correlated.map_or(0.0, |(sigma, _)| sigma * normal(&mut rng));
            let mut kalman = Kalman::new(model);
            let (mut before, mut truth) = (None, [0.0; 2]);
            let mut blocks = Vec::new();
            for step in 0..SAMPLES {
                let k = (step % 1000) as usize;
                if k == 0 {
                    assert_eq!(flight.next_block(1000, &mut blocks), 1000);
                }
                let block = &blocks[0];
                if let Some((measured, rate)) = before {
                    kalman.predict();
                    kalman.drive(&[measured]);
                    angle += rate * 0.01;
                }
                if step % 100 == 0 {
                    if let (Some((sigma, tc)), true) = (correlated, step > 0) {
                        let decay = (-1.0_f64 / tc).exp();
                        heading_error = decay * heading_error + sigma * (1.0 - decay * decay).sqrt() * normal(&mut rng);
                    }
                    let z = angle + heading_error + 2.0 * degrees * normal(&mut rng);
                    nis += kalman.update(0, z, None).nis;
                    updates += 1.0;
                }
                before = Some((block.measured[k], block.true_rate[k]));
                truth = [block.bias, block.drift[k]];
            }
            // the heading's error is a state too; between two measurements its mean decays
            let mut error = kalman.x.clone();
            for (state, truth) in [angle, truth[0], truth[1]].into_iter().enumerate() {
                error[state] -= truth;
            }
            let judged = kalman.p.view((0, 0), (3, 3)).into_owned();
            let error = error.rows(0, 3).into_owned();
            nees += mahalanobis(&error, &judged).unwrap();
            bias += error[1] * error[1] / kalman.p[(1, 1)];
        }
        let within = |sum: f64, freedom: f64| {
            let bounds = [5e-6, 1.0 - 5e-6].map(|p| chi_square_quantile(p, freedom));
            assert!((bounds[0]..bounds[1]).contains(&sum), "{sum} beside {bounds:?}");
        };
        within(nees, 3.0 * FLIGHTS as f64);
        within(bias, FLIGHTS as f64);
        within(nis, updates);
    }
}
