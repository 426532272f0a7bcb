//! Parameters that keep a given value: the others are best beside it, and its price is that of the likelihood.

use super::*;
use crate::support::Bench;
use kfdesign::filter::likelihood::{Stretch, diffuse_log_likelihood};
use kfdesign::identify::{Hold, identify_logs};
use kfdesign::model::sensor_errors;

const DT: f64 = 0.1;

fn rate(run: u64) -> Vec<f64> {
    log(&[white(0.01), gauss_markov(0.01, 20.0)], 20_000, DT, 83, run)
}

fn hold(parameter: &str, value: f64, unit: &str) -> Hold {
    Hold { parameter: parameter.into(), value, unit: Unit::parse(unit).unwrap() }
}

fn holding(rate: &[f64], holds: &[Hold]) -> Identified {
    let (unit, choice) = (Unit::parse("rad/s").unwrap(), parse_model("white+gm").unwrap());
    let whole = [vec![Stretch { missing: 0, samples: rate }]];
    identify_logs("x", &[rate], &whole, DT, &unit, &choice, holds).unwrap()
}

/// N, sigma and Tc.
fn values(found: &Identified) -> [f64; 3] {
    let mut values = [0.0; 3];
    for term in &found.model.terms {
        match *term {
            Term::White { density } => values[0] = density,
            Term::GaussMarkov { std_dev, correlation_time } => [values[1], values[2]] = [std_dev, correlation_time],
            _ => panic!("{term:?}"),
        }
    }
    values
}

/// ln L of the samples by a Kalman filter.
fn log_likelihood(rate: &[f64], [density, std_dev, correlation_time]: [f64; 3]) -> f64 {
    let terms = vec![white(density), gauss_markov(std_dev, correlation_time)];
    let model = sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, None, DT, 2000.0).unwrap();
    diffuse_log_likelihood(&model, &[Stretch { missing: 0, samples: rate }], false).value
}

/// A held time constant stays, has no interval, and the price is what the filter's likelihood says; no other value of N
/// or sigma beside it is better.
#[test]
fn the_others_are_best_beside_it_and_the_price_is_that_of_the_likelihood() {
    let rate = rate(0);
    let free = holding(&rate, &[]);
    let best = log_likelihood(&rate, values(&free));
    for time in [5.0, 20.0, 120.0] {
        let found = holding(&rate, &[hold("gauss_markov.correlation_time", time, "s")]);
        let own = values(&found);
        assert!((own[2] / time - 1.0).abs() < 1e-12, "{own:?}");
        let value = log_likelihood(&rate, own);
        for i in 0..2 {
            for by in [0.995, 1.005] {
                let mut beside = own;
                beside[i] *= by;
                assert!(log_likelihood(&rate, beside) < value, "{time} s: {i} times {by}");
            }
        }
        let cost = found.hold.as_ref().unwrap();
        assert!((cost.log_likelihood - (value - best)).abs() < 1e-5, "{} and {}", cost.log_likelihood, value - best);
        let held = &cost.parameters[0];
        assert!((held.free / values(&free)[2] - 1.0).abs() < 1e-9);
        assert_eq!(held.inside, time == 20.0, "{held:?}");
        let Some(TermEntry::GaussMarkov { std_dev, correlation_time }) =
            found.params.terms.iter().find(|term| matches!(term, TermEntry::GaussMarkov { .. }))
        else {
            panic!("{:?}", found.params.terms)
        };
        assert_eq!((correlation_time.interval, std_dev.interval.is_some()), (None, true));
    }
}

/// Held where the log puts it, a parameter costs nothing and moves nothing; the others are known better than beside a
/// free one.
#[test]
fn what_is_held_where_it_is_costs_nothing() {
    let rate = rate(1);
    let free = holding(&rate, &[]);
    let [density, std_dev, time] = values(&free);
    let found = holding(&rate, &[hold("gauss_markov.correlation_time", time, "s")]);
    for (a, b) in values(&found).into_iter().zip([density, std_dev, time]) {
        assert!((a / b - 1.0).abs() < 1e-5, "{a} and {b}");
    }
    assert!(found.hold.unwrap().log_likelihood.abs() < 1e-6);
    assert!(free.hold.is_none());
    let width = |found: &Identified| found.precision[1].std_dev_percent;
    // sigma and Tc go together: their correlation is 0.7 for so long a log
    assert!(width(&free) / width(&holding(&rate, &[hold("gauss_markov.correlation_time", time, "s")])) > 1.2);
}

/// The true values of sigma and Tc are refused at 5 % in 5 % of 200 logs: 1 to 24 of them (false alarm 5e-5).
#[test]
fn the_p_value_is_one() {
    let truth = [hold("gauss_markov.correlation_time", 20.0, "s"), hold("gauss_markov.std_dev", 0.01, "rad/s")];
    let refused = (0..200_u64)
        .into_par_iter()
        .filter(|run| holding(&rate(100 + run), &truth).hold.unwrap().p_value < 0.05)
        .count();
    assert!((1..=24).contains(&refused), "{refused} of 200");
}

/// The command: of every axis, or of one; what it costs in the text, in the document and in params.json.
#[test]
fn command_holds() {
    let bench = Bench::new();
    let [x, y] = [rate(2), rate(3)];
    let rows: String = x.iter().zip(&y).map(|(x, y)| format!("{x},{y}\n")).collect();
    bench.file("log.csv", format!("x (rad/s),y (rad/s)\n{rows}"));
    let command = "identify log.csv --rate 10 --model white+gm";
    let out = bench.run(&format!("{command} --hold x.gauss_markov.correlation_time=0.5min --json -o params.json"));
    assert_eq!(out.status, 0, "{}", out.stderr);
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let [x, y] = [0, 1].map(|i| &document["axes"][i]);
    assert_eq!(x["hold"]["parameters"][0]["value"], 0.5);
    assert_eq!(x["hold"]["parameters"][0]["parameter"], "gauss_markov.correlation_time");
    assert!(x["hold"]["log_likelihood"].as_f64().unwrap() < 0.0);
    assert!(y["hold"].is_null());
    let time = &document["params"]["axes"][0]["gauss_markov"][0]["correlation_time"];
    assert!((time["value"].as_f64().unwrap() - 30.0).abs() < 1e-9 && time["interval"].is_null(), "{time}");
    assert_eq!(document["params"]["source"]["note"], "held: x.gauss_markov.correlation_time=0.5min");
    let both = bench.ok(&format!("{command} --hold gauss_markov.correlation_time=20s"));
    assert_eq!(both.matches("Held: gauss_markov.correlation_time at 20.00 s").count(), 2, "{both}");
    let windows = bench.ok(&format!("{command} --hold gauss_markov.correlation_time=20s --window 1000s"));
    assert_eq!(windows.matches("Held: gauss_markov.correlation_time at 20.00 s").count(), 2, "{windows}");
    for (flags, said) in [
        (
            "--hold rate_random_walk.density=1",
            "--hold rate_random_walk.density=1: expected NAME=VALUE, for example gauss_markov.correlation_time=200s",
        ),
        (
            "--hold rate_random_walk.density=1deg/h^1.5",
            "x: hold rate_random_walk.density: the model white+gm has no such parameter; it has white.density, \
             gauss_markov.std_dev, gauss_markov.correlation_time",
        ),
        ("--hold gauss_markov.correlation_time=20deg", "x: hold gauss_markov.correlation_time: "),
        ("--hold gauss_markov.correlation_time=-3s", "-3 s: expected a value above zero"),
        ("--hold white.density=1deg/h --method allan", "only --method likelihood holds parameters"),
        (
            "--hold gauss_markov.std_dev=1deg/s --hold gauss_markov.std_dev=2deg/s",
            "x: hold gauss_markov.std_dev: it is held twice",
        ),
    ] {
        let out = bench.run(&format!("{command} {flags}"));
        assert_eq!((out.status, out.stderr.lines().filter(|l| l.starts_with("kfdesign: ")).count()), (2, 1), "{flags}");
        assert!(out.stderr.contains(said), "{flags}: {}", out.stderr);
    }
}
