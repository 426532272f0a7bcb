//! A sensor stream with truth columns.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::{whole, with_unit};
use super::checked;
use super::tune::plant_flags::PlantFlags;
use crate::export::table::TableWriter;
use crate::input::{self, LogOptions};
use crate::numerics::progress::{advance, begin, note};
use crate::numerics::reduce::Moments;
use crate::params::{AxisParams, Design, Params, PlantEntry, TermEntry};
use crate::simulate::{AxisBlock, AxisSummary, Flight, FlightBlock, Scenario, Simulator, Summary, TrueRate};
use crate::units::{Dimension, Quantity, Unit, shown_unit};
use crate::view;

/// What is simulated, and where it is written.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// params.json: the sensor
    pub params: PathBuf,
    /// Log to write: .csv, .csv.gz or .npy
    #[arg(short, long, value_name = "LOG")]
    pub output: PathBuf,
    /// Length: 2h, 600s, 90min, "1.5 h" [default: that of the true-rate file, if there is one]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    #[serde(default)]
    pub duration: Option<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "seed")]
    pub seed: u64,
    /// Number of the run: another run of the same seed is independent of this one
    #[arg(long, default_value_t = 0, value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default)]
    pub run: u64,
    /// Sample rate in Hz [default: sample_rate of the parameters]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    #[serde(default)]
    pub rate: Option<f64>,
    /// rest, constant:1deg/s, sine:10deg/s,0.5Hz or file:RATE.csv (one row per sample, one column for all axes or
    /// one for each)
    #[arg(long, value_name = "MOTION", default_value = "rest")]
    #[serde(default = "rest")]
    pub true_rate: String,
    /// Draw the turn-on bias too and add it to the constant bias
    #[arg(long)]
    #[serde(default)]
    pub turn_on: bool,
    /// Largest value the sensor can show, with unit: "250 deg/s"
    #[arg(long, value_name = "LIMIT", allow_hyphen_values = true)]
    #[serde(default)]
    pub saturate: Option<String>,
    /// Step of the output, with unit: "1/131 deg/s"
    #[arg(long, value_name = "STEP", alias = "quantize", allow_hyphen_values = true)]
    #[serde(default)]
    pub quantise: Option<String>,
    /// Unit of the columns [default: that of the parameters]
    #[arg(long, value_name = "UNIT")]
    #[serde(default)]
    pub unit: Option<String>,
    /// Round the numbers to this many decimals in that unit [default: all digits]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=15))]
    #[serde(default)]
    pub decimals: Option<u8>,
    /// Leave the truth columns out
    #[arg(long)]
    #[serde(default)]
    pub no_truth: bool,
    #[command(flatten)]
    #[serde(default)]
    pub plant: PlantFlags,
}

fn seed() -> u64 {
    1
}

fn rest() -> String {
    "rest".into()
}

impl Request {
    /// Files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        let motion = self.true_rate.strip_prefix("file:").map(Path::new);
        std::iter::once(self.params.as_path()).chain(motion).collect()
    }
}

/// Rows handed to the writer at once.
const BLOCK: usize = 8192;

/// The log is written as it comes. Notes say what another rate makes of terms that count samples.
pub fn run(request: &Request) -> anyhow::Result<Summary> {
    let params = checked::params(&request.params)?;
    let scenario = scenario(request, &params)?;
    let all: Vec<&AxisParams> = params.axes.iter().collect();
    for line in view::notes_of_rate(&params, &all, scenario.rate_hz) {
        note(&format!("note: {line}"));
    }
    let unit = match &request.unit {
        None => display_unit(&params)?,
        Some(text) => {
            let unit = Unit::parse(text).context("`unit`")?;
            unit.require(params.quantity.dimension()).context("`unit`")?;
            unit
        }
    };
    let mut simulator = Simulator::new(&params, &scenario)?;
    let design = request.plant.design(&params)?.or_else(|| params.design.clone()).unwrap_or_default();
    let mut flight = Flight::new(&design, params.axes.len(), &scenario)?;
    let names: Vec<String> = params.axes.iter().map(|axis| column_name(axis, params.quantity)).collect();
    let mut header = header(&params, &names, &unit, !request.no_truth);
    let plant = PlantColumns::new(&design, params.quantity, &unit);
    header.extend(plant.header(&params, !request.no_truth));
    let mut writer = TableWriter::create(&request.output, &header)?;
    let mut shape = Shape::new(&scenario, unit, plant, request);
    let mut moments = vec![(Moments::default(), 0); params.axes.len()];
    let (mut blocks, mut flown) = (Vec::new(), Vec::new());
    begin("simulating", scenario.samples);
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
        advance(n as u64);
    }
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
    Ok(Summary {
        format: "kfdesign-simulation/1",
        log: request.output.display().to_string(),
        quantity: params.quantity,
        sample_rate_hz: scenario.rate_hz,
        samples: scenario.samples,
        duration_s: scenario.samples as f64 / scenario.rate_hz,
        seed: scenario.seed,
        run: scenario.run,
        unit: shape.unit.text().into(),
        axes,
    })
}

fn count_saturated(block: &AxisBlock, scenario: &Scenario) -> u64 {
    scenario.saturation.map_or(0, |limit| block.measured.iter().filter(|x| x.abs() >= limit).count() as u64)
}

/// The flags, checked.
fn scenario(request: &Request, params: &Params) -> anyhow::Result<Scenario> {
    let rate_hz = request.rate.unwrap_or(params.sample_rate_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        bail!("`rate` {rate_hz}: expected a positive number of Hz");
    }
    let dimension = params.quantity.dimension();
    let true_rate = true_rate(&request.true_rate, params, rate_hz)?;
    let samples = match (&request.duration, &true_rate) {
        (Some(text), _) => {
            let duration_s = with_unit("`duration`", text, Dimension::TIME, "2h")?;
            let samples = (duration_s * rate_hz).round();
            if samples < 1.0 {
                bail!("`duration` {text}: not one sample at {rate_hz} Hz; expected a positive time, for example 2h");
            }
            // saturates; the limit is checked with the rest of the scenario
            samples as u64
        }
        (None, TrueRate::Samples(columns)) => columns.iter().map(Vec::len).min().unwrap_or(0) as u64,
        (None, _) => bail!("`duration` is missing, for example `duration` 2h"),
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
        seed: request.seed,
        run: request.run,
        samples,
        rate_hz,
        true_rate,
        turn_on: request.turn_on,
        saturation: limit("`saturate`", &request.saturate, "250 deg/s")?,
        quantisation: limit("`quantise`", &request.quantise, "1/131 deg/s")?,
    };
    scenario.check(params.axes.len())?;
    Ok(scenario)
}

fn true_rate(text: &str, params: &Params, rate_hz: f64) -> anyhow::Result<TrueRate> {
    let dimension = params.quantity.dimension();
    let expected =
        || anyhow!("`true_rate` {text}: expected rest, constant:1deg/s, sine:10deg/s,0.5Hz or file:RATE.csv");
    if text == "rest" {
        return Ok(TrueRate::Rest);
    }
    match text.split_once(':').ok_or_else(expected)? {
        ("constant", rate) => Ok(TrueRate::Constant(with_unit("`true_rate` constant", rate, dimension, "1deg/s")?)),
        ("sine", rest) => {
            let (amplitude, frequency) = rest.split_once(',').ok_or_else(expected)?;
            let amplitude = with_unit("`true_rate` sine", amplitude, dimension, "10deg/s")?;
            let frequency_hz = with_unit("`true_rate` sine", frequency, Dimension::new(0, 0, -2), "0.5Hz")?;
            if frequency_hz <= 0.0 {
                bail!("`true_rate` {text}: expected a frequency above zero");
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

/// The unit the parameters speak: the white density without its root, or that of a drift or bias, whichever comes
/// first; else SI.
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
    fn new(scenario: &Scenario, unit: Unit, plant: PlantColumns, request: &Request) -> Self {
        Shape {
            unit,
            plant,
            rate_hz: scenario.rate_hz,
            truth: !request.no_truth,
            rounding: request.decimals.map(|n| 10f64.powi(i32::from(n))),
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
