//! How long after a stop is asked for the work has ended: two hours of a gyro at 100 Hz, stopped at thirty moments of
//! each command's work. Prints a table.

#![allow(clippy::print_stdout)] // a table is all it makes

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use kfdesign::allan::{self, Deviation, TauGrid};
use kfdesign::filter::FilterDesign;
use kfdesign::identify::{Method, ModelChoice, identify_axis};
use kfdesign::input::Block;
use kfdesign::montecarlo::{Plan, verify};
use kfdesign::numerics::progress::{Progress, watched};
use kfdesign::params::Params;
use kfdesign::replay::{LogShape, Options, Replayer};
use kfdesign::simulate::{Scenario, Simulator, TrueRate};
use kfdesign::tune::objective::{Objective, Request, tune_by};
use kfdesign::tune::{TuneOptions, tune};
use kfdesign::units::{Quantity, Unit};

const SAMPLES: usize = 720_000;
const RATE_HZ: f64 = 100.0;
const MOMENTS: u32 = 30;

#[derive(Default)]
struct Stop(AtomicBool);

impl Progress for Stop {
    fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Time that the work takes, and the times from the request to the end.
fn stopped(work: &(dyn Fn() + Sync)) -> (Duration, Vec<Duration>) {
    let start = Instant::now();
    work();
    let whole = start.elapsed();
    let moment = |number: u32| {
        let stop = Arc::new(Stop::default());
        let watch: Arc<dyn Progress> = Arc::clone(&stop) as _;
        std::thread::scope(|scope| {
            let working = scope.spawn(|| (watched(&watch, work).is_err(), Instant::now()));
            std::thread::sleep(whole * number / (MOMENTS + 1));
            let asked = Instant::now();
            stop.0.store(true, Ordering::Relaxed);
            let (ended_early, end) = working.join().expect("the work ends");
            ended_early.then(|| end.duration_since(asked))
        })
    };
    let mut times: Vec<Duration> = (1..=MOMENTS).filter_map(moment).collect();
    times.sort();
    (whole, times)
}

fn main() {
    let text = r#"{
        "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz",
        "axes": [{
            "name": "x",
            "white": {"density": {"value": 0.2, "unit": "deg/sqrt(h)", "interval": [0.19, 0.21]}},
            "gauss_markov": [{
                "std_dev": {"value": 0.03, "unit": "deg/s", "interval": [0.02, 0.045]},
                "correlation_time": {"value": 200, "unit": "s", "interval": [100, 400]}
            }]
        }]
    }"#;
    let params = Params::from_json(text, "sensor").expect("parameters");
    let design: FilterDesign = tune(&params, &TuneOptions::default()).expect("a design").design;
    let scenario = Scenario {
        seed: 1,
        run: 0,
        samples: SAMPLES as u64,
        rate_hz: RATE_HZ,
        true_rate: TrueRate::Rest,
        turn_on: false,
        saturation: None,
        quantisation: None,
    };
    let mut axes = Vec::new();
    Simulator::new(&params, &scenario).expect("a simulation").next_block(SAMPLES, &mut axes);
    let rate = &axes[0].measured;
    let unit = Unit::parse("rad/s").expect("a unit");
    let shape = LogShape { axes: vec!["x".into()], quantity: Quantity::AngularRate, sample_rate_hz: RATE_HZ, aids: 0 };
    let block = |samples: &[f64], first: usize| Block {
        time_s: (0..samples.len()).map(|k| (first + k) as f64 / RATE_HZ).collect(),
        values: vec![samples.to_vec()],
        missing: vec![0; samples.len()],
        extra: vec![],
    };
    let blocks: Vec<Block> = rate.chunks(8192).enumerate().map(|(i, own)| block(own, 8192 * i)).collect();
    let robust = Request {
        objective: Objective::Robust,
        hold: &[],
        truth: None,
        logs: &[],
        held_out: 0.0,
        priors: true,
        seed: 1,
    };
    let plan = Plan { steps: SAMPLES as u64, ..Plan::quick(RATE_HZ) };
    let works: [(&str, &(dyn Fn() + Sync)); 5] = [
        ("allan, every tau of a log grid", &|| {
            allan::curve(rate, 0.01, Deviation::Mdev, TauGrid::Log(100)).expect("a curve");
        }),
        ("identify", &|| {
            identify_axis("x", rate, 0.01, &unit, Method::Likelihood, &ModelChoice::Auto).expect("a model");
        }),
        ("tune --objective robust", &|| {
            tune_by(&params, &TuneOptions::default(), &robust).expect("a design");
        }),
        ("replay", &|| {
            let mut replayer = Replayer::new(&design, &shape, Options::default()).expect("a replay");
            blocks.iter().for_each(|block| replayer.push(block, None));
            replayer.finish();
        }),
        ("montecarlo, 100 runs of 2 h", &|| {
            verify(&design, &plan).expect("a verdict");
        }),
    ];
    println!("{:<34}{:>10}{:>12}{:>12}", "", "whole s", "median ms", "longest ms");
    for (name, work) in works {
        let (whole, times) = stopped(work);
        let ms = |time: Option<&Duration>| time.map_or(f64::NAN, |t| 1e3 * t.as_secs_f64());
        println!(
            "{name:<34}{:>10.2}{:>12.2}{:>12.2}",
            whole.as_secs_f64(),
            ms(times.get(times.len() / 2)),
            ms(times.last())
        );
    }
}
