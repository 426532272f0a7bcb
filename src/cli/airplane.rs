//! `kfdesign airplane`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::flags::with_unit;
use super::output::{print_json, print_text};
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::check::{AirplaneCheck, SpeedPoint};
use crate::export::atomic;
use crate::report::figure::{self, Curve, Lines};
use crate::report::terminal::table;
use crate::units::{Dimension, digits};

/// What an airplane document says, and whether it makes sense
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign airplane data/airplanes/aerosonde.json --altitude \"100 m\" --plot speeds.svg"
)]
pub struct Args {
    /// airplane.json
    airplane: PathBuf,
    /// Where speeds are looked at
    #[arg(long, value_name = "LENGTH", default_value = "0 m", allow_hyphen_values = true)]
    altitude: String,
    /// Figures of angle of attack and elevator, drag and thrust, power over the speeds of level flight
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("--plot", &args.plot, Kind::Svg)], &[&args.airplane])?;
    let altitude = with_unit("--altitude", &args.altitude, Dimension::new(0, 2, 0), "100 m")?;
    let check = Airplane::read(&args.airplane)?.check(altitude)?;
    if let Some(path) = &args.plot {
        atomic::write(path, figures(&check).as_bytes())?;
    }
    if args.json {
        print_json(&check)?;
    } else {
        print_text(&text(&check));
    }
    Ok(Status::Done)
}

fn text(check: &AirplaneCheck) -> String {
    let at = format!("at {} m", digits(check.altitude));
    let mut out = match &check.level_flight {
        None => format!("{}: no level flight {at}\n", check.name),
        Some(range) => {
            let limit = |limit: Option<&str>| limit.map_or("not ended".to_string(), |what| format!("ended by {what}"));
            format!(
                "{}: level flight {at} from {:.2} m/s ({}) to {:.2} m/s ({})\n",
                check.name,
                range.slowest,
                limit(range.slowest_limit),
                range.fastest,
                limit(range.fastest_limit)
            )
        }
    };
    let [pitch, roll, yaw] = check.control_power.map(digits);
    let [a, b, c] = check.principal_moments.map(digits);
    let mut rows = vec![
        ("mass, wing loading", format!("{} kg, {} kg/m^2", digits(check.mass), digits(check.wing_loading))),
        ("aspect ratio", digits(check.aspect_ratio)),
        ("principal moments of inertia", format!("{a}, {b}, {c} kg m^2")),
        ("static margin", format!("{:.3} chords", check.static_margin)),
        ("control power, elevator aileron rudder", format!("{pitch}, {roll}, {yaw} 1/rad")),
    ];
    if let Some(stall) = check.stall {
        let lift =
            format!("CL {:.2} at {:.1} deg, {:.2} m/s", stall.greatest_lift, stall.angle.to_degrees(), stall.airspeed);
        rows.push(("stall", lift));
    }
    let best = |key: fn(&SpeedPoint) -> f64| check.curve.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    if let Some((range, endurance)) = best(|p| p.drag).zip(best(|p| p.power)) {
        rows.push(("least drag", format!("{} N at {:.1} m/s", digits(range.drag), range.airspeed)));
        rows.push(("least power", format!("{} W at {:.1} m/s", digits(endurance.power), endurance.airspeed)));
    }
    let rows: Vec<Vec<String>> = rows.into_iter().map(|(name, value)| vec![name.into(), value]).collect();
    out += table(&["", ""], &rows).trim_start_matches('\n');
    for warning in &check.warnings {
        out += &format!("warning: {warning}\n");
    }
    out
}

fn figures(check: &AirplaneCheck) -> String {
    let speed = ("airspeed".to_string(), "m/s".to_string());
    let curve = |label: &str, of: fn(&SpeedPoint) -> f64| Curve {
        label: label.into(),
        points: check.curve.iter().map(|p| (p.airspeed, of(p))).collect(),
    };
    let figure = |title: &str, y: (&str, &str), curves: Vec<Curve>| {
        figure::lines(&Lines {
            title: title.into(),
            description: format!("{title} of {} over the speeds of level flight.", check.name),
            x: speed.clone(),
            y: (y.0.into(), y.1.into()),
            curves,
            ..Lines::default()
        })
    };
    let angles =
        vec![curve("angle of attack", |p| p.alpha.to_degrees()), curve("elevator", |p| p.elevator.to_degrees())];
    let drag = vec![curve("drag", |p| p.drag), curve("thrust at full throttle", |p| p.thrust_available)];
    let figures = [
        figure("Angle of attack and elevator", ("angle", "deg"), angles),
        figure("Drag and thrust", ("force", "N"), drag),
        figure("Power of level flight", ("power", "W"), vec![curve("drag times airspeed", |p| p.power)]),
    ];
    figure::sheet(&format!("Level flight of {}", check.name), &figures)
}
