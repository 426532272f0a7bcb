//! Long work that is asked to stop: it ends, leaves nothing behind, and the same call works afterwards.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use kfdesign::allan::{self, Deviation, TauGrid};
use kfdesign::export::table::TableWriter;
use kfdesign::filter::FilterDesign;
use kfdesign::identify::{Method, ModelChoice, identify_axis};
use kfdesign::input::{Block, LogOptions, LogReader};
use kfdesign::montecarlo::{Plan, verify};
use kfdesign::numerics::progress::{Progress, Stopped, checkpoint, watched};
use kfdesign::params::Params;
use kfdesign::replay::{Estimates, LogShape, Options, Replayer};
use kfdesign::tune::objective::{Objective, Request, tune_by};
use kfdesign::tune::{TuneOptions, tune};
use kfdesign::units::Unit;

use crate::support::{Bench, data};

/// Stops the work when it has asked so often.
struct StopAt {
    asked: AtomicU64,
    at: u64,
}

impl Progress for StopAt {
    fn is_stopped(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.at
    }
}

/// What the work gives, and how often it asked; `None` for one that was stopped.
fn run<T: Send>(at: u64, work: &(dyn Fn() -> T + Sync)) -> (Option<T>, u64) {
    let stop = Arc::new(StopAt { asked: AtomicU64::new(0), at });
    let watch: Arc<dyn Progress> = Arc::clone(&stop) as _;
    let done = watched(&watch, work).map_err(|Stopped| ()).ok();
    (done, stop.asked.load(Ordering::Relaxed))
}

/// Stopped at its first question, in the middle and near the end, the work ends; then it gives what it gave before.
fn stops_anywhere(name: &str, work: &(dyn Fn() -> String + Sync)) {
    let (whole, asked) = run(u64::MAX, work);
    let whole = whole.unwrap();
    assert!(asked > 4, "{name} asked {asked} times");
    // how often it asks depends a little on how threads share the work
    for at in [0, asked / 2, asked - 1 - asked / 4] {
        let (done, _) = run(at, work);
        assert!(done.is_none(), "{name} went on after question {at} of {asked}");
    }
    assert_eq!(run(u64::MAX, work).0.unwrap(), whole, "{name} is another after a stop");
    assert_eq!(work(), whole, "{name} is another when nobody waits");
}

fn params() -> Params {
    Params::read(&data("params.json")).unwrap()
}

fn known_within_intervals() -> Params {
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
    Params::from_json(text, "sensor").unwrap()
}

fn design() -> FilterDesign {
    tune(&params(), &TuneOptions::default()).unwrap().design
}

fn rate() -> Vec<f64> {
    // any noise does: white, from the fractional parts of multiples of an irrational number
    (0..20_000).map(|k| (f64::from(k) * 0.754_877_666).fract() - 0.5).collect()
}

#[test]
fn every_long_command_stops() {
    let rate = rate();
    let unit = Unit::parse("rad/s").unwrap();
    stops_anywhere("allan", &|| {
        format!("{:?}", allan::curve(&rate, 0.01, Deviation::Mdev, TauGrid::Octave).unwrap().points)
    });
    stops_anywhere("identify", &|| {
        let found = identify_axis("x", &rate, 0.01, &unit, Method::Likelihood, &ModelChoice::Auto).unwrap();
        format!("{:?}", found.model)
    });
    let (sensor, design) = (known_within_intervals(), design());
    let plan = Plan::quick(design.sample_rate_hz);
    stops_anywhere("montecarlo", &|| serde_json::to_string(&verify(&design, &plan).unwrap()).unwrap());
    let request = Request {
        objective: Objective::Robust,
        hold: &[],
        truth: None,
        logs: &[],
        held_out: 0.0,
        priors: true,
        seed: 1,
    };
    stops_anywhere("tune", &|| tune_by(&sensor, &TuneOptions::default(), &request).unwrap().0.design.to_json());
}

/// Replay into a table: a stop leaves no file, whole or not.
#[test]
fn a_stopped_replay_leaves_no_file() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    bench.ok("simulate params.json --duration 10min --seed 3 -o log.npy");
    let before = bench.files();
    let (design, log, out) = (design(), bench.path("log.npy"), bench.path("out.csv"));
    let replay = || {
        let mut reader = LogReader::open(&log, &LogOptions::default()).unwrap();
        let shape = LogShape {
            axes: reader.axes().iter().map(|axis| axis.name.clone()).collect(),
            quantity: reader.quantity(),
            sample_rate_hz: reader.check().sample_rate_hz,
            aids: 0,
        };
        let mut replayer = Replayer::new(&design, &shape, Options::default()).unwrap();
        let mut writer = TableWriter::create(&out, &["time (s)".to_string()]).unwrap();
        let (mut block, mut estimates) = (Block::default(), Estimates::default());
        while reader.next_block(&mut block).unwrap() {
            replayer.push(&block, Some(&mut estimates));
            writer.write(&[&estimates.time_s]).unwrap();
        }
        // the file is whole when all is done
        let result = serde_json::to_string(&replayer.finish()).unwrap();
        writer.finish().unwrap();
        result
    };
    let (whole, asked) = run(u64::MAX, &replay);
    std::fs::remove_file(&out).unwrap();
    for at in [0, asked / 2, asked - 1] {
        assert!(run(at, &replay).0.is_none());
        assert_eq!(bench.files(), before, "stopped at question {at} of {asked}");
    }
    assert_eq!(run(u64::MAX, &replay).0, whole);
}

/// The way out is that of a panic, and a panic stays one.
#[test]
fn a_panic_is_no_stop() {
    let watch: Arc<dyn Progress> = Arc::new(StopAt { asked: AtomicU64::new(0), at: u64::MAX });
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        watched(&watch, || -> () { std::panic::resume_unwind(Box::new("no stop")) })
    }));
    assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"no stop"));
    // and nobody waits any more
    checkpoint();
}

/// A command line needs no process of its own.
#[test]
fn a_command_line_gives_its_status() {
    let bench = Bench::new();
    let stop = kfdesign::cli::Stop::default();
    let run = |args: &[&str]| {
        let words = ["kfdesign"].iter().chain(args).map(std::ffi::OsString::from).collect::<Vec<_>>();
        kfdesign::cli::run(words, &stop)
    };
    let out = bench.path("log.npy").display().to_string();
    let params = data("params.json").display().to_string();
    assert_eq!(run(&["simulate", &params, "-o", &out, "--duration", "1min"]), 0);
    assert_eq!(run(&["simulate", &params, "-o", &out, "--duration", "1parsec"]), 2);
    assert_eq!(bench.files(), ["log.npy"]);
}
