//! `kfdesign trim`.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
use crate::aircraft::control::document::Linearized;
use crate::aircraft::flight::FlightDocument;
use crate::ops::amounts::with_unit;
use crate::units::Dimension;
use crate::view;

/// Steady flight, the linear model about it, its modes, handling-quality levels and controllability
///
/// Straight, climbing or turning flight, of the section `trim` of a flight.json, or of an airplane.json by flags;
/// flags replace what the document says. Flight that is not possible is refused by what is missing: lift, thrust,
/// elevator.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign trim data/airplanes/aerosonde.json --speed \"25 m/s\" --altitude \"100 m\" -o linear.json"
)]
pub struct Args {
    /// flight.json or airplane.json
    file: PathBuf,
    /// Airspeed
    #[arg(long, visible_alias = "airspeed", value_name = "SPEED", allow_hyphen_values = true)]
    speed: Option<String>,
    /// Above the sea
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    altitude: Option<String>,
    /// Angle of the flight path, positive up
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    climb: Option<String>,
    /// Of the heading, positive to the right: "10 deg/s"
    #[arg(long, value_name = "RATE", allow_hyphen_values = true)]
    turn_rate: Option<String>,
    /// Angle of bank of a turn
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true, conflicts_with = "turn_rate")]
    bank: Option<String>,
    /// What fixes the sideways motion
    #[arg(long, value_name = "WHAT", value_parser = Sideways::NAMES)]
    lateral: Option<String>,
    /// Also levels of an airplane this many times as large, by Froude's law
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    froude: Option<f64>,
    /// The document: linear.json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// One HTML page with tables, poles and step responses
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// One JSON document on stdout, the same as -o writes
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html)], &[&args.file])?;
    if let Some(scale) = args.froude.filter(|n| !(*n > 0.0 && n.is_finite())) {
        bail!("--froude {scale}: expected a positive number, full size over model");
    }
    let (airplane, documented) = read(&args.file)?;
    let request = request(args, documented)?;
    let shown = args.file.display();
    let trim = airplane.trim(&request).with_context(|| shown.to_string())?;
    let linearized = Linearized::new(&airplane, trim).with_context(|| shown.to_string())?;
    let document = linearized.document(&airplane, &request, args.froude)?;
    files::write_json(args.output.as_deref(), &document)?;
    let report = view::trim::trim(&linearized, &document);
    files::write_page(args.report.as_deref(), &report)?;
    if args.json {
        print_json(&document)?;
    } else {
        print_report(&report);
    }
    Ok(Status::Done)
}

/// The airplane, and the steady flight that a flight document asks for.
fn read(path: &Path) -> anyhow::Result<(Airplane, Option<TrimRequest>)> {
    let shown = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("{shown}: cannot read"))?;
    if !text.contains("\"kfdesign-flight/") {
        return Ok((Airplane::from_json(&text, &shown)?, None));
    }
    let flight = FlightDocument::from_json(&text, &shown)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let (text, of_airplane) = flight.airplane.text("airplane", folder).map_err(|e| anyhow!("{shown}: {e}"))?;
    let airplane = Airplane::from_json(&text, &of_airplane)?;
    Ok((airplane, flight.trim.as_ref().map(|trim| trim.request())))
}

/// Flags over what the document says.
fn request(args: &Args, documented: Option<TrimRequest>) -> anyhow::Result<TrimRequest> {
    const ANGLE: Dimension = Dimension::new(2, 0, 0);
    let of = |flag: &str, given: &Option<String>, dimension: Dimension, example: &str| {
        given.as_ref().map(|text| with_unit(flag, text, dimension, example)).transpose()
    };
    let asked = |flag: &str, found: Option<f64>, before: Option<f64>, example: &str| {
        found
            .or(before)
            .with_context(|| format!("{}: no {flag} is given: add {flag} \"{example}\"", args.file.display()))
    };
    let speed = of("--speed", &args.speed, Dimension::new(0, 2, -2), "25 m/s")?;
    let altitude = of("--altitude", &args.altitude, Dimension::new(0, 2, 0), "100 m")?;
    let turn_rate = of("--turn-rate", &args.turn_rate, Dimension::new(2, 0, -2), "10 deg/s")?.map(Turn::Rate);
    let bank = of("--bank", &args.bank, ANGLE, "30 deg")?.map(Turn::Bank);
    Ok(TrimRequest {
        airspeed: asked("--speed", speed, documented.map(|d| d.airspeed), "25 m/s")?,
        altitude: asked("--altitude", altitude, documented.map(|d| d.altitude), "100 m")?,
        climb: of("--climb", &args.climb, ANGLE, "5 deg")?.or(documented.map(|d| d.climb)).unwrap_or(0.0),
        turn: turn_rate.or(bank).or(documented.map(|d| d.turn)).unwrap_or(Turn::Rate(0.0)),
        sideways: args
            .lateral
            .as_deref()
            .and_then(Sideways::named)
            .or(documented.map(|d| d.sideways))
            .unwrap_or_default(),
    })
}
