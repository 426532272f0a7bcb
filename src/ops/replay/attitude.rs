//! `replay` of an attitude filter.

use std::path::Path;

use anyhow::{Context, anyhow, bail};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Done, FormFlag, Request};
use crate::export::table::TableWriter;
use crate::filter::AttitudeDesign;
use crate::filter::attitude::{Heading, Row};
use crate::input::{Block, ExtraColumn, LogOptions, LogReader};
use crate::numerics::progress::{advance, begin};
use crate::ops::aid_columns::column_and_unit;
use crate::ops::checked;
use crate::ops::reading::note_check;
use crate::params::Measured;
use crate::replay::LogShape;
use crate::replay::attitude::{AttitudeEstimate, AttitudeReplayer, LogRow, Reference};
use crate::replay::axes::assign_to;
use crate::units::{Dimension, Quantity, Unit};

/// What only an attitude filter is asked.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[command(next_help_heading = "Attitude")]
pub struct Flags {
    /// True orientation from the body to east, north, up: columns of w, x, y, z; a row without a number has none
    #[arg(long, value_delimiter = ',', value_name = "COLUMNS")]
    pub reference: Option<Vec<String>>,
    /// Noise of the reference about each axis, beside one sample of error in its time
    #[arg(long, default_value = "0.5 deg", value_name = "SIGMA", requires = "reference", allow_hyphen_values = true)]
    pub reference_sigma: String,
    /// Column that is 1 where the body moves: errors count there, rests are elsewhere
    #[arg(long, value_name = "COLUMN")]
    pub movement: Option<String>,
}

impl Default for Flags {
    fn default() -> Flags {
        Flags { reference: None, reference_sigma: "0.5 deg".into(), movement: None }
    }
}

impl Flags {
    /// For filters that are not of the plant attitude.
    pub(super) fn refuse(&self) -> anyhow::Result<()> {
        for (flag, given) in [("`reference`", self.reference.is_some()), ("`movement`", self.movement.is_some())] {
            if given {
                bail!("{flag} belongs to a filter of the plant attitude (tune `plant` attitude)");
            }
        }
        Ok(())
    }
}

/// Where the parts of a row are among the extra columns.
struct Columns {
    force: [usize; 3],
    heading: Option<HeadingColumns>,
    reference: Option<[usize; 4]>,
    movement: Option<usize>,
}

enum HeadingColumns {
    Field([usize; 3]),
    Yaw(usize),
}

/// That only linear filters have.
pub fn linear_only(option: &str, filter: &Path) -> anyhow::Error {
    anyhow!("`{option}` is made for linear filters, {} is an attitude filter", filter.display())
}

pub(super) fn run(request: &Request) -> anyhow::Result<Done> {
    let given = [
        ("innovations", request.innovations),
        ("smooth", request.smooth),
        ("gate", request.gate.is_some()),
        ("clip", request.clip.is_some()),
        ("follow", request.follow.is_some()),
        ("form", request.form != FormFlag::Joseph),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        return Err(linear_only(option, &request.filter));
    }
    let design = AttitudeDesign::read(&request.filter)?;
    checked::say(&request.filter, checked::recorded(&design.tuning));
    let std_dev =
        Measured::positive(request.attitude.reference_sigma.trim(), Quantity::AngularRate.dimension().times_time(2));
    let std_dev = std_dev.map_err(|message| anyhow::anyhow!("`reference_sigma`: {message}"))?.si();
    let reference = Reference { std_dev, timing: design.model.dt };
    let (extra, columns) = columns(request, &design).with_context(|| request.filter.display().to_string())?;
    let mut reader = LogReader::open(&request.log, &LogOptions { extra, ..request.reading.rates()? })?;
    let name = request.log.display().to_string();
    let mut check = reader.check().clone();
    check.expect_motion();
    note_check(&name, &check);
    let shape = LogShape::of(&reader, 0);
    let wanted = design.axes.each_ref().map(String::as_str);
    let assigned =
        assign_to(&wanted, Quantity::AngularRate, design.sample_rate_hz, &shape).with_context(|| name.clone())?;
    let mut writer = match &request.output {
        Some(path) => Some(TableWriter::create(path, &header(&design))?),
        None => None,
    };
    let mut replayer = AttitudeReplayer::new(&design, reference);
    begin("replay", reader.check().samples);
    let (mut block, mut table) = (Block::default(), vec![Vec::new(); 14]);
    while reader.next_block(&mut block)? {
        table.iter_mut().for_each(Vec::clear);
        for i in 0..block.time_s.len() {
            let estimate = replayer.push(&row(&block, i, &assigned, &columns));
            if writer.is_some() {
                write_row(&mut table, &estimate);
            }
        }
        if let Some(writer) = &mut writer {
            writer.write(&table.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
        }
        advance(block.time_s.len() as u64);
    }
    let mut result = replayer.finish();
    if result.specific_force.samples == 0 {
        bail!(
            "{name}: no row has a number in all three columns of the accelerometer; without it an attitude cannot be \
             found"
        );
    }
    if request.attitude.reference.is_some() && result.errors.is_none() {
        bail!("{name}: no row has a reference that counts (a unit quaternion, and movement where `movement` is given)");
    }
    if let Some(writer) = writer {
        writer.finish()?;
    }
    result.log = Some(name);
    result.log_sha256 = Some(reader.sha256().to_string());
    Ok(Done::Attitude(Box::new(result), Box::new(design)))
}

/// The extra columns of the log and what each is.
fn columns(request: &Request, design: &AttitudeDesign) -> anyhow::Result<(Vec<ExtraColumn>, Columns)> {
    let mut extra = Vec::new();
    let heading_name = design.model.heading.as_ref().map(|heading| heading.name.as_str());
    let (mut force, mut heading) = (None, None);
    for flag in &request.aid {
        let (name, list) = flag.split_once('=').with_context(|| format!("`aid` {flag}: expected NAME=COLUMNS"))?;
        let list: Vec<&str> = list.split(',').map(str::trim).collect();
        let first = extra.len();
        let three = [first, first + 1, first + 2];
        let dimensions = match (name.trim(), list.len()) {
            ("accelerometer", 3) if force.is_none() => {
                force = Some(three);
                Some(Quantity::SpecificForce.dimension())
            }
            (name, 3) if Some(name) == heading_name && heading.is_none() => {
                heading = Some(HeadingColumns::Field(three));
                None
            }
            (name, 1) if Some(name) == heading_name && heading.is_none() => {
                heading = Some(HeadingColumns::Yaw(first));
                Some(Quantity::AngularRate.dimension().times_time(2))
            }
            (name, found) if name == "accelerometer" || Some(name) == heading_name => {
                let columns = if name == "accelerometer" {
                    "three columns x, y, z"
                } else {
                    "three columns x, y, z of a field, or one of the yaw angle"
                };
                bail!("`aid` {flag}: {found} columns, or given twice; expected {columns}, once");
            }
            (name, _) => {
                let known = heading_name.map_or(String::new(), |name| format!(" and {name}"));
                bail!("`aid` {flag}: the filter has no measurement '{name}'; it has accelerometer{known}");
            }
        };
        extra.extend(list.iter().map(|text| column(text, dimensions, &format!("`aid` {}", name.trim()))));
    }
    let force = force.context(
        "an attitude filter needs the accelerometer; say which columns it has: `aid` accelerometer=AX,AY,AZ",
    )?;
    if let (Some(name), None) = (heading_name, &heading) {
        bail!(
            "the filter measures {name}; say which columns that is: `aid` {name}=MX,MY,MZ for a field, or `aid` \
             {name}=YAW"
        );
    }
    let reference = match request.attitude.reference.as_deref() {
        Some([w, x, y, z]) => {
            let first = extra.len();
            extra.extend([w, x, y, z].iter().map(|text| column(text, None, "`reference`")));
            Some([first, first + 1, first + 2, first + 3])
        }
        Some(other) => bail!("`reference`: {} columns; expected four, w, x, y, z of the quaternion", other.len()),
        None => None,
    };
    let movement = request.attitude.movement.as_deref().map(|text| {
        extra.push(column(text, None, "`movement`"));
        extra.len() - 1
    });
    Ok((extra, Columns { force, heading, reference, movement }))
}

/// Without a dimension the column is a direction or a flag: its unit does not matter.
fn column(text: &str, dimension: Option<Dimension>, flag: &str) -> ExtraColumn {
    let (column, unit) = column_and_unit(text);
    ExtraColumn {
        column: column.to_string(),
        unit: unit.or_else(|| dimension.is_none().then(Unit::one)),
        dimension: dimension.unwrap_or(Dimension::NONE),
        flag: format!("{flag}={column}"),
    }
}

fn row(block: &Block, i: usize, assigned: &[usize], columns: &Columns) -> LogRow {
    let extra = |column: usize| block.extra.get(column).and_then(|values| values.get(i)).copied().unwrap_or(f64::NAN);
    let vector = |of: &[usize; 3]| Vector3::from_fn(|k, _| extra(of[k]));
    let rate = |k: usize| block.values.get(assigned[k]).and_then(|values| values.get(i)).copied().unwrap_or(f64::NAN);
    let heading = columns.heading.as_ref().map(|heading| match heading {
        HeadingColumns::Field(of) => Heading::Field(vector(of)),
        HeadingColumns::Yaw(of) => Heading::Yaw(extra(*of)),
    });
    let reference = columns.reference.and_then(|[w, x, y, z]| {
        let quaternion = Quaternion::new(extra(w), extra(x), extra(y), extra(z));
        (quaternion.norm() > 0.9 && quaternion.norm() < 1.1).then(|| UnitQuaternion::from_quaternion(quaternion))
    });
    LogRow {
        time_s: block.time_s[i],
        missing: block.missing[i],
        sensors: Row { rate: Vector3::from_fn(|k, _| rate(k)), force: vector(&columns.force), heading },
        reference,
        movement: columns.movement.map(|of| extra(of) > 0.5),
    }
}

fn header(design: &AttitudeDesign) -> Vec<String> {
    let mut names: Vec<String> = ["time (s)", "q_w", "q_x", "q_y", "q_z"].map(String::from).to_vec();
    names.extend(["east", "north", "up"].map(|d| format!("rotation_{d}_sigma (rad)")));
    for axis in &design.axes {
        names.push(format!("{axis}_drift (rad/s)"));
        names.push(format!("{axis}_drift_sigma (rad/s)"));
    }
    names
}

fn write_row(table: &mut [Vec<f64>], estimate: &AttitudeEstimate) {
    let attitude = estimate.attitude.unwrap_or([f64::NAN; 4]);
    let drift = estimate.drift.iter().zip(&estimate.drift_sigma).flat_map(|(value, sigma)| [*value, *sigma]);
    let values = [estimate.time_s].into_iter().chain(attitude).chain(estimate.sigma).chain(drift);
    table.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
}
