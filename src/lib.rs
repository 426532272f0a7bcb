//! Kalman-filter design workbench for inertial sensors.
//!
//! A gyro or accelerometer log at rest goes in; noise parameters with intervals, a filter that estimates the bias
//! drift, and a proof that the covariance of the filter tells the truth come out:
//!
//! ```text
//! log ─ input ─> Recording ─ identify ─> Params ─ tune ─> FilterDesign ─ replay ─────> verdict on a log
//!                                                                      └ montecarlo ─> verdict on simulated runs
//! ```
//!
//! The sensor gives `g = r + b + b_r(t) + w`: true rate, constant bias, bias drift (Gauss-Markov processes, random
//! walk, flicker) and wideband noise. The `kfdesign` command is a thin layer on this library.
//!
//! # A filter, and whether it is honest
//!
//! ```
//! use kfdesign::consistency::Verdict;
//! use kfdesign::montecarlo::{self, Plan};
//! use kfdesign::params::Params;
//! use kfdesign::tune::{TuneOptions, tune};
//!
//! let text = r#"{
//!     "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz",
//!     "axes": [{
//!         "name": "x",
//!         "white": {"density": "0.2 deg/sqrt(h)"},
//!         "gauss_markov": [{"std_dev": "0.03 deg/s", "correlation_time": "200 s"}]
//!     }]
//! }"#;
//! let params = Params::from_json(text, "my gyro")?;
//! let design = tune(&params, &TuneOptions::default())?.design;
//! let outcome = montecarlo::verify(&design, &Plan::quick(design.sample_rate_hz))?;
//! assert_eq!(outcome.verdict, Verdict::Consistent);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What is promised
//!
//! - Numbers are SI and rad in every struct; units stand in documents only, and are never guessed ([`units`]).
//! - Results are the same for any number of threads: random numbers are addressed by seed, run, axis and term
//!   ([`numerics::random`]).
//! - Errors are values that say what was found, what was expected and what to do. A panic is a defect.
//! - Rooms stand on floors, and each uses only lower ones (docs/architecture.md).

#![forbid(unsafe_code)]

pub mod aircraft;
pub mod allan;
pub mod cli;
pub mod compare;
pub mod consistency;
pub mod export;
pub mod filter;
pub mod identify;
pub mod import;
pub mod input;
pub mod model;
pub mod montecarlo;
pub mod noise;
pub mod numerics;
pub mod ops;
pub mod params;
pub mod replay;
pub mod report;
#[cfg(feature = "serve")]
pub mod serve;
pub mod signal;
pub mod simulate;
pub mod tune;
pub mod units;
pub mod view;
