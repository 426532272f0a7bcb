//! `kfdesign trim`.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::Status;
use super::files::{self, Kind};
use super::flags::with_unit;
use super::output::{print_json, print_text};
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
use crate::aircraft::control::document::{CriterionDocument, LinearDocument, Linearized, ModeDocument};
use crate::aircraft::flight::FlightDocument;
use crate::export::atomic;
use crate::report::html;
use crate::report::terminal::table;
use crate::units::{Dimension, digits};

mod page;

/// Steady flight, the linear model about it, its modes, handling-quality levels and controllability
///
/// Straight, climbing or turning flight, of the section `trim` of a flight.json, or of an airplane.json by flags; flags replace what the document says.
/// Flight that is not possible is refused by what is missing: lift, thrust, elevator.
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
    if let Some(path) = &args.output {
        let mut text = serde_json::to_string_pretty(&document)?;
        text.push('\n');
        atomic::write(path, text.as_bytes())?;
    }
    if let Some(path) = &args.report {
        atomic::write(path, html::page(&page::page(&linearized, &document))?.as_bytes())?;
    }
    if args.json {
        print_json(&document)?;
    } else {
        print_text(&text(&document));
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

/// 1, 2, 3, "beyond 3" or "-".
fn level(level: Option<u8>) -> String {
    match level {
        Some(4) => "beyond 3".into(),
        Some(level) => level.to_string(),
        None => "-".into(),
    }
}

fn mode_row(mode: &ModeDocument) -> Vec<String> {
    let [re, im] = mode.eigenvalue;
    let value = if im == 0.0 { format!("{re:.4}") } else { format!("{re:.4} ± {im:.4}i") };
    let (half, double) = (mode.time_to_half, mode.time_to_double);
    let time = half.map(|t| format!("half {}", digits(t))).or(double.map(|t| format!("double {}", digits(t))));
    vec![
        mode.name.replace('_', " "),
        value,
        digits(mode.frequency),
        format!("{:.3}", mode.damping),
        time.unwrap_or_else(|| "-".into()),
    ]
}

const MODE_HEADER: [&str; 5] = ["mode", "eigenvalue (1/s)", "frequency (rad/s)", "damping", "time (s)"];

/// One row per criterion, its levels in categories A, B and C.
fn criterion_rows(document: &LinearDocument) -> Vec<Vec<String>> {
    let mut names: Vec<&str> = Vec::new();
    for criterion in &document.criteria {
        if !names.contains(&criterion.name) {
            names.push(criterion.name);
        }
    }
    let row = |name: &&str| {
        let all: Vec<&CriterionDocument> = document.criteria.iter().filter(|c| c.name == *name).collect();
        let value = |of: fn(&CriterionDocument) -> Option<f64>| {
            let mut values: Vec<String> = all.iter().filter_map(|c| of(c)).map(digits).collect();
            values.dedup();
            if values.is_empty() { "-".into() } else { values.join(", ") }
        };
        let levels =
            |of: fn(&CriterionDocument) -> Option<u8>| all.iter().map(|c| level(of(c))).collect::<Vec<_>>().join(" ");
        let unit = all.first().map_or("", |c| if c.unit == "1" { "" } else { c.unit });
        let named =
            if unit.is_empty() { name.replace('_', " ") } else { format!("{} ({unit})", name.replace('_', " ")) };
        let mut row = vec![named, value(|c| c.value), levels(|c| c.level)];
        if document.froude_scale.is_some() {
            row.extend([value(|c| c.scaled_value), levels(|c| c.scaled_level)]);
        }
        row
    };
    names.iter().map(row).collect()
}

fn criterion_header(document: &LinearDocument) -> Vec<String> {
    let mut header = vec!["criterion".to_string(), "as flown".into(), "level A B C".into()];
    if let Some(scale) = document.froude_scale {
        header.extend([format!("scaled by {}", digits(scale)), "level A B C".into()]);
    }
    header
}

fn text(document: &LinearDocument) -> String {
    let t = &document.trim;
    let deg = |x: f64| format!("{:.3}", x.to_degrees());
    let mut out = format!(
        "{} at {} m/s, {} m{}{}: alpha {} deg, bank {} deg, pitch {} deg\n",
        document.airplane,
        digits(t.airspeed),
        digits(t.altitude),
        if t.climb == 0.0 { String::new() } else { format!(", climb {} deg", digits(t.climb.to_degrees())) },
        if t.turn_rate == 0.0 {
            String::new()
        } else {
            format!(", turning {} deg/s", digits(t.turn_rate.to_degrees()))
        },
        deg(t.alpha),
        deg(t.phi),
        deg(t.theta),
    );
    let throttle = t.throttle.map_or(String::new(), |x| format!("throttle {x:.4}, "));
    let motor = if t.current == 0.0 { String::new() } else { format!(", current {} A", digits(t.current)) };
    out += &format!(
        "elevator {} deg, aileron {} deg, rudder {} deg, {throttle}thrust {} N{motor}; residual {:.0e}\n",
        deg(t.elevator),
        deg(t.aileron),
        deg(t.rudder),
        digits(t.thrust),
        t.residual
    );
    for warning in &document.warnings {
        out += &format!("warning: {warning}\n");
    }
    let rows: Vec<Vec<String>> = document.modes.iter().filter(|m| m.model != "full").map(mode_row).collect();
    out += &format!("\n{}", table(&MODE_HEADER, &rows));
    let cap = document.cap.map_or(String::new(), |cap| format!(", CAP {} 1/(g s^2)", digits(cap)));
    out += &format!("n/alpha {} 1/rad{cap}\n", digits(document.load_per_angle));
    let header = criterion_header(document);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    out += &format!("\n{}Caution: {}.\n", table(&header, &criterion_rows(document)), document.caution);
    out
}
