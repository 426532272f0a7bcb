//! `kfdesign simulate`.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use schemars::JsonSchema;
use serde::Serialize;

use super::Status;
use super::files::{self, Kind};
use super::flags::{whole, with_unit};
use super::output::{digits, notes_of_rate, print_json, print_text, progress, say_all, shown_unit, table};
use super::tune::plant_flags::PlantFlags;
use crate::cli::checked;
use crate::export::table::TableWriter;
use crate::input::{self, LogOptions};
use crate::numerics::reduce::Moments;
use crate::params::{AxisParams, Design, Params, PlantEntry, TermEntry};
use crate::simulate::{AxisBlock, Flight, FlightBlock, Scenario, Simulator, TrueRate};
use crate::units::{Dimension, Quantity, Unit};

/// A sensor stream with truth columns from params.json
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign simulate data/params.json -o log.npy --duration 2h --seed 1\n\
    Columns: time (s); gyro_NAME or accel_NAME per axis; truth_NAME_rate, truth_NAME_bias (constant), truth_NAME_drift. With a plant: AID_NAME \
    for every aid (empty where it measures nothing), accelerometer_NAME, truth_NAME_angle (or tilt).")]
pub struct Args {
    /// params.json: the sensor
    params: PathBuf,
    /// Log to write: .csv, .csv.gz or .npy
    #[arg(short, long, value_name = "LOG")]
    output: PathBuf,
    /// Length: 2h, 600s, 90min, "1.5 h" [default: that of the true-rate file, if there is one]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    duration: Option<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    seed: u64,
    /// Number of the run: another run of the same seed is independent of this one
    #[arg(long, default_value_t = 0, value_parser = whole::<u64>, allow_negative_numbers = true)]
    run: u64,
    /// Sample rate in Hz [default: sample_rate of the parameters]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// rest, constant:1deg/s, sine:10deg/s,0.5Hz or file:RATE.csv (one row per sample, one column for all axes or one for each)
    #[arg(long, value_name = "MOTION", default_value = "rest")]
    true_rate: String,
    /// Draw the turn-on bias too and add it to the constant bias
    #[arg(long)]
    turn_on: bool,
    /// Largest value the sensor can show, with unit: "250 deg/s"
    #[arg(long, value_name = "LIMIT", allow_hyphen_values = true)]
    saturate: Option<String>,
    /// Step of the output, with unit: "1/131 deg/s"
    #[arg(long, value_name = "STEP", alias = "quantize", allow_hyphen_values = true)]
    quantise: Option<String>,
    /// Unit of the columns [default: that of the parameters]
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Round the numbers to this many decimals in that unit [default: all digits]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=15))]
    decimals: Option<u8>,
    /// Leave the truth columns out
    #[arg(long)]
    no_truth: bool,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    plant: PlantFlags,
}

/// Rows handed to the writer at once.
const BLOCK: usize = 8192;

/// What `simulate --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Summary {
    /// "kfdesign-simulation/1".
    format: &'static str,
    log: String,
    quantity: Quantity,
    sample_rate_hz: f64,
    samples: u64,
    duration_s: f64,
    seed: u64,
    run: u64,
    unit: String,
    axes: Vec<AxisSummary>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct AxisSummary {
    /// Name of the column.
    name: String,
    /// Constant bias with the turn-on draw, in `unit`.
    bias: f64,
    /// Of the measured column, in `unit`.
    mean: f64,
    std_dev: f64,
    /// Samples at the limit.
    saturated: u64,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let motion = args.true_rate.strip_prefix("file:").map(Path::new);
    let inputs: Vec<&Path> = std::iter::once(args.params.as_path()).chain(motion).collect();
    files::check(&[("-o", &Some(args.output.clone()), Kind::Table)], &inputs)?;
    let params = checked::params(&args.params)?;
    let scenario = scenario(args, &params)?;
    say_all(&notes_of_rate(&params, &params.axes.iter().collect::<Vec<_>>(), scenario.rate_hz));
    let unit = match &args.unit {
        None => display_unit(&params)?,
        Some(text) => {
            let unit = Unit::parse(text).context("--unit")?;
            unit.require(params.quantity.dimension()).context("--unit")?;
            unit
        }
    };
    let mut simulator = Simulator::new(&params, &scenario)?;
    let design = args.plant.design(&params)?.or_else(|| params.design.clone()).unwrap_or_default();
    let mut flight = Flight::new(&design, params.axes.len(), &scenario)?;
    let names: Vec<String> = params.axes.iter().map(|axis| column_name(axis, params.quantity)).collect();
    let mut header = header(&params, &names, &unit, !args.no_truth);
    let plant = PlantColumns::new(&design, params.quantity, &unit);
    header.extend(plant.header(&params, !args.no_truth));
    let mut writer = TableWriter::create(&args.output, &header)?;
    let mut shape = Shape::new(&scenario, unit, plant, args);
    let mut moments = vec![(Moments::default(), 0); params.axes.len()];
    let (mut blocks, mut flown) = (Vec::new(), Vec::new());
    let bar = progress(scenario.samples, "simulating");
    loop {
        let n = simulator.next_block(BLOCK, &mut blocks);
        if n == 0 {
            break;
        }
        for (block, (moments, saturated)) in blocks.iter().zip(&mut moments) {
            block.measured.iter().for_each(|x| moments.add(*x));
            *saturated += count_saturated(block, &scenario);
        }
        if let Some(flight) = &mut flight {
            flight.next_block(&blocks, &mut flown);
        }
        writer.write(&shape.columns(n, &blocks, &flown))?;
        bar.inc(n as u64);
    }
    bar.finish_and_clear();
    writer.finish()?;
    let axes = names
        .into_iter()
        .zip(&blocks)
        .zip(&moments)
        .map(|((name, block), (moments, saturated))| AxisSummary {
            name,
            bias: shape.unit.from_si(block.bias),
            mean: shape.unit.from_si(moments.mean),
            std_dev: shape.unit.from_si(moments.variance().sqrt()),
            saturated: *saturated,
        })
        .collect();
    report(
        args,
        &Summary {
            format: "kfdesign-simulation/1",
            log: args.output.display().to_string(),
            quantity: params.quantity,
            sample_rate_hz: scenario.rate_hz,
            samples: scenario.samples,
            duration_s: scenario.samples as f64 / scenario.rate_hz,
            seed: scenario.seed,
            run: scenario.run,
            unit: shape.unit.text().into(),
            axes,
        },
    )?;
    Ok(Status::Done)
}

fn report(args: &Args, summary: &Summary) -> anyhow::Result<()> {
    if args.json {
        return print_json(summary);
    }
    let unit = &summary.unit;
    let header =
        ["axis", &format!("bias ({unit})"), &format!("mean ({unit})"), &format!("std dev ({unit})"), "saturated"];
    let rows: Vec<Vec<String>> = summary
        .axes
        .iter()
        .map(|a| vec![a.name.clone(), digits(a.bias), digits(a.mean), digits(a.std_dev), a.saturated.to_string()])
        .collect();
    let sentence = format!(
        "{}: {} samples at {} Hz ({} s), seed {}, run {}.\n",
        summary.log,
        summary.samples,
        summary.sample_rate_hz,
        digits(summary.duration_s),
        summary.seed,
        summary.run
    );
    print_text(&format!("{}{sentence}", table(&header, &rows)));
    Ok(())
}

fn count_saturated(block: &AxisBlock, scenario: &Scenario) -> u64 {
    scenario.saturation.map_or(0, |limit| block.measured.iter().filter(|x| x.abs() >= limit).count() as u64)
}

/// The flags, checked.
fn scenario(args: &Args, params: &Params) -> anyhow::Result<Scenario> {
    let rate_hz = args.rate.unwrap_or(params.sample_rate_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        bail!("--rate {rate_hz}: expected a positive number of Hz");
    }
    let dimension = params.quantity.dimension();
    let true_rate = true_rate(&args.true_rate, params, rate_hz)?;
    let samples = match (&args.duration, &true_rate) {
        (Some(text), _) => {
            let duration_s = with_unit("--duration", text, Dimension::TIME, "2h")?;
            let samples = (duration_s * rate_hz).round();
            if samples < 1.0 {
                bail!("--duration {text}: not one sample at {rate_hz} Hz; expected a positive time, for example 2h");
            }
            // saturates; the limit is checked with the rest of the scenario
            samples as u64
        }
        (None, TrueRate::Samples(columns)) => columns.iter().map(Vec::len).min().unwrap_or(0) as u64,
        (None, _) => bail!("--duration is missing, for example --duration 2h"),
    };
    let limit = |flag: &str, text: &Option<String>, example: &str| -> anyhow::Result<Option<f64>> {
        let Some(text) = text else { return Ok(None) };
        let value = with_unit(flag, text, dimension, example)?;
        if value <= 0.0 {
            bail!("{flag} {text}: expected a value above zero, for example \"{example}\"");
        }
        Ok(Some(value))
    };
    let scenario = Scenario {
        seed: args.seed,
        run: args.run,
        samples,
        rate_hz,
        true_rate,
        turn_on: args.turn_on,
        saturation: limit("--saturate", &args.saturate, "250 deg/s")?,
        quantisation: limit("--quantise", &args.quantise, "1/131 deg/s")?,
    };
    scenario.check(params.axes.len())?;
    Ok(scenario)
}

fn true_rate(text: &str, params: &Params, rate_hz: f64) -> anyhow::Result<TrueRate> {
    let dimension = params.quantity.dimension();
    let expected =
        || anyhow!("--true-rate {text}: expected rest, constant:1deg/s, sine:10deg/s,0.5Hz or file:RATE.csv");
    if text == "rest" {
        return Ok(TrueRate::Rest);
    }
    match text.split_once(':').ok_or_else(expected)? {
        ("constant", rate) => Ok(TrueRate::Constant(with_unit("--true-rate constant", rate, dimension, "1deg/s")?)),
        ("sine", rest) => {
            let (amplitude, frequency) = rest.split_once(',').ok_or_else(expected)?;
            let amplitude = with_unit("--true-rate sine", amplitude, dimension, "10deg/s")?;
            let frequency_hz = with_unit("--true-rate sine", frequency, Dimension::new(0, 0, -2), "0.5Hz")?;
            if frequency_hz <= 0.0 {
                bail!("--true-rate {text}: expected a frequency above zero");
            }
            Ok(TrueRate::Sinusoid { amplitude, frequency_hz })
        }
        ("file", path) => {
            let path = Path::new(path);
            let options =
                LogOptions { rate_hz: Some(rate_hz), quantity: Some(params.quantity), ..LogOptions::default() };
            let (recording, _) = input::read(path, &options)?;
            if let Some(gap) = recording.gaps.first() {
                bail!("{}: {} samples are missing before sample {}", path.display(), gap.missing, gap.index + 1);
            }
            Ok(TrueRate::Samples(recording.axes.into_iter().map(|axis| axis.values).collect()))
        }
        _ => Err(expected()),
    }
}

/// The unit the parameters speak: the white density without its root, or that of a drift or bias, whichever comes first; else SI.
fn display_unit(params: &Params) -> anyhow::Result<Unit> {
    let dimension = params.quantity.dimension();
    let spoken = params.axes.iter().flat_map(|axis| {
        let terms = axis.terms.iter().filter_map(|term| match term {
            TermEntry::White { density } => {
                let text = density.unit.text();
                ["/sqrt(Hz)", "/√Hz", "/rtHz"].iter().find_map(|root| Unit::parse(text.strip_suffix(root)?).ok())
            }
            TermEntry::GaussMarkov { std_dev, .. } | TermEntry::Oscillation { std_dev, .. } => {
                Some(std_dev.unit.clone())
            }
            TermEntry::BiasInstability { coefficient } => Some(coefficient.unit.clone()),
            _ => None,
        });
        let bias = axis.bias.iter().chain(&axis.turn_on_bias).map(|b| b.unit.clone());
        terms.chain(bias).collect::<Vec<_>>()
    });
    let mut spoken = spoken.filter(|unit| unit.require(dimension).is_ok());
    Ok(spoken.next().map_or_else(|| Unit::parse(params.quantity.si_unit()), Ok)?)
}

/// `gyro_x`, `accel_x`; an axis that carries the prefix already keeps its name.
fn column_name(axis: &AxisParams, quantity: Quantity) -> String {
    let prefix = match quantity {
        Quantity::AngularRate => "gyro_",
        Quantity::SpecificForce => "accel_",
    };
    if axis.name.starts_with(prefix) { axis.name.clone() } else { format!("{prefix}{}", axis.name) }
}

fn header(params: &Params, names: &[String], unit: &Unit, truth: bool) -> Vec<String> {
    let mut header = vec!["time (s)".to_string()];
    header.extend(names.iter().map(|name| format!("{name} ({unit})")));
    if truth {
        for axis in &params.axes {
            header.extend(["rate", "bias", "drift"].map(|what| format!("truth_{}_{what} ({unit})", axis.name)));
        }
    }
    header
}

/// The columns of the plant: names and units.
struct PlantColumns {
    /// Name of the state; `None` for a sensor at rest.
    state: Option<&'static str>,
    /// Of the state and of what aids it: scale and text.
    unit: (f64, String),
    accelerometer: bool,
    aids: Vec<String>,
}

impl PlantColumns {
    fn new(design: &Design, quantity: Quantity, unit: &Unit) -> PlantColumns {
        let (state, si) = match design.plant {
            PlantEntry::Angle { .. } => (Some("angle"), "rad"),
            PlantEntry::Vertical { .. } => (Some("tilt"), "rad"),
            // its state is the true rate, which has a column
            PlantEntry::Rate { .. } => (Some("rate"), quantity.si_unit()),
            PlantEntry::Static | PlantEntry::Attitude(_) | PlantEntry::Custom(_) => (None, quantity.si_unit()),
        };
        PlantColumns {
            state,
            unit: shown_unit(si, quantity, unit),
            accelerometer: matches!(design.plant, PlantEntry::Vertical { .. }),
            aids: design.aids.iter().map(|aid| aid.name.clone()).collect(),
        }
    }

    fn shows_state(&self, truth: bool) -> bool {
        truth && self.state.is_some_and(|name| name != "rate")
    }

    fn header(&self, params: &Params, truth: bool) -> Vec<String> {
        let Some(state) = self.state else { return Vec::new() };
        let unit = &self.unit.1;
        let of_axis = |axis: &AxisParams| {
            let name = &axis.name;
            let accelerometer = self.accelerometer.then(|| format!("accelerometer_{name} (m/s^2)"));
            let aids = self.aids.iter().map(move |aid| format!("{aid}_{name} ({unit})"));
            let truth = self.shows_state(truth).then(|| format!("truth_{name}_{state} ({unit})"));
            accelerometer.into_iter().chain(aids).chain(truth).collect::<Vec<_>>()
        };
        params.axes.iter().flat_map(of_axis).collect()
    }
}

/// Blocks in SI to the columns of the file.
struct Shape {
    unit: Unit,
    plant: PlantColumns,
    rate_hz: f64,
    truth: bool,
    /// 10^decimals.
    rounding: Option<f64>,
    next: u64,
    buffers: Vec<Vec<f64>>,
}

impl Shape {
    fn new(scenario: &Scenario, unit: Unit, plant: PlantColumns, args: &Args) -> Self {
        Shape {
            unit,
            plant,
            rate_hz: scenario.rate_hz,
            truth: !args.no_truth,
            rounding: args.decimals.map(|n| 10f64.powi(i32::from(n))),
            next: 0,
            buffers: Vec::new(),
        }
    }

    fn columns(&mut self, n: usize, blocks: &[AxisBlock], flown: &[FlightBlock]) -> Vec<&[f64]> {
        let plant = &self.plant;
        let states = plant.shows_state(self.truth);
        let of_plant = usize::from(plant.accelerometer) + plant.aids.len() + usize::from(states);
        let count = 1 + blocks.len() * if self.truth { 4 } else { 1 } + flown.len() * of_plant;
        self.buffers.resize_with(count, Vec::new);
        let (unit, rounding) = (&self.unit, self.rounding);
        let round = |value: f64| match rounding {
            // adding zero makes -0 a plain 0
            Some(scale) => (value * scale).round() / scale + 0.0,
            None => value,
        };
        let show = |si: f64| round(unit.from_si(si));
        let mut buffers = self.buffers.iter_mut();
        let mut put = |values: &mut dyn Iterator<Item = f64>| {
            if let Some(buffer) = buffers.next() {
                buffer.clear();
                buffer.extend(values);
            }
        };
        put(&mut (self.next..).take(n).map(|k| k as f64 / self.rate_hz));
        for block in blocks {
            put(&mut block.measured.iter().map(|x| show(*x)));
        }
        for block in blocks.iter().filter(|_| self.truth) {
            put(&mut block.true_rate.iter().map(|x| show(*x)));
            put(&mut std::iter::repeat_n(show(block.bias), n));
            put(&mut block.drift.iter().map(|x| show(*x)));
        }
        for block in flown {
            if let Some(values) = &block.accelerometer {
                put(&mut values.iter().map(|x| round(*x)));
            }
            let states = states.then_some(&block.state);
            for values in block.aids.iter().chain(states) {
                put(&mut values.iter().map(|x| round(x / plant.unit.0)));
            }
        }
        self.next += n as u64;
        self.buffers.iter().map(Vec::as_slice).collect()
    }
}
