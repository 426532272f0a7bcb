//! The columns to read: axes, their units, and the time. What stays ambiguous is an error that lists what is there.

use super::names::{Head, axis_at, is_excluded, sensor_of, time_rank, words};
use crate::params::place::meant;
use crate::units::{Dimension, Quantity, Unit};

use super::{AxisInfo, ExtraColumn, InputError, InputKind, LogOptions};

/// What to read: the time column and its unit, the axes, what they measure, the temperature beside them.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) time: Option<(usize, Unit)>,
    pub(super) columns: Vec<usize>,
    /// In physical units: counts of a converter (`1/131 deg/s`) end at this door.
    pub(super) axes: Vec<AxisInfo>,
    /// As the log has them, with the step of a converter.
    pub(super) stored: Vec<Unit>,
    pub(super) quantity: Quantity,
    pub(super) temperature: Temperature,
    /// Units of the extra columns, which come after the axes in `columns`.
    pub(super) extra: Vec<Unit>,
}

/// The columns of a log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    pub(super) heads: &'a [&'a Head],
    /// False when there is no header and the names are only `column 3`.
    pub(super) named: bool,
    /// File, and line of the header: the beginning of every message.
    pub(super) place: &'a str,
    /// The sample rate, where the file says it.
    pub(super) rate_hz: Option<f64>,
}

/// A column that may be an axis.
struct Candidate {
    column: usize,
    quantity: Quantity,
    /// By its name, not only its unit.
    named: bool,
    /// Its words without that of the axis.
    stem: Vec<String>,
    axis: bool,
}

/// The dimension of the values.
pub(super) fn dimension(quantity: Quantity, kind: InputKind) -> Dimension {
    match kind {
        InputKind::Rate => quantity.dimension(),
        InputKind::Increments | InputKind::Angle => quantity.dimension().times_time(2),
    }
}

pub(super) fn quantity_of(unit: &Unit, kind: InputKind) -> Option<Quantity> {
    [Quantity::AngularRate, Quantity::SpecificForce].into_iter().find(|q| dimension(*q, kind) == unit.dimension())
}

impl Table<'_> {
    /// Time column and axes for these options. What is missing is said at once, not one thing after the other: where
    /// an option is missing, the search goes on as if it were there.
    pub(super) fn choose(&self, options: &LogOptions) -> Result<Choice, InputError> {
        let mut all = match self.chosen(options) {
            Err(error) if !error.missing.is_empty() => error,
            chosen => return chosen,
        };
        let mut as_if = options.clone();
        loop {
            for (option, value) in &all.missing {
                match *option {
                    "columns" => as_if.columns = Some(value.split(',').map(String::from).collect()),
                    "unit" => as_if.unit = Unit::parse(value).ok(),
                    "time" => as_if.time = Some(value.clone()),
                    _ => as_if.rate_hz = value.parse().ok(),
                }
            }
            match self.chosen(&as_if) {
                Err(next) if next.missing.iter().any(|new| !all.missing.contains(new)) => {
                    let message = next.message.trim_start_matches(self.place).trim_start_matches(": ");
                    all.message += &format!("; {message}");
                    all.missing.extend(next.missing);
                }
                _ => return Err(all),
            }
        }
    }

    fn chosen(&self, options: &LogOptions) -> Result<Choice, InputError> {
        let columns = match &options.columns {
            Some(list) => self.listed(list)?,
            None => self.by_name(options)?,
        };
        let (mut axes, quantity) = self.axes(&columns, options)?;
        let physical = |axis: &mut AxisInfo| {
            let unit = axis.unit.times_time(0);
            std::mem::replace(&mut axis.unit, unit)
        };
        let stored = axes.iter_mut().map(physical).collect();
        let time = self.time(options)?;
        if let Some((time, _)) = &time
            && columns.contains(time)
        {
            return self.fail(format!("column '{}' is taken both as time and as an axis", self.heads[*time].full));
        }
        let temperature = self.temperature(&options.temperature, &columns, time.as_ref().map(|(c, _)| *c), quantity)?;
        let mut columns = columns;
        let mut extra = Vec::with_capacity(options.extra.len());
        for wanted in &options.extra {
            let column = self.find(&wanted.column)?;
            if columns.contains(&column) || time.as_ref().is_some_and(|(time, _)| *time == column) {
                return self.fail(format!("column '{}' is asked for twice ({})", self.heads[column].full, wanted.flag));
            }
            columns.push(column);
            extra.push(self.extra(self.heads[column], wanted)?);
        }
        Ok(Choice { time, columns, axes, stored, quantity, temperature, extra })
    }

    fn error(&self, what: impl std::fmt::Display) -> InputError {
        InputError::new(format!("{}: {what}", self.place))
    }

    pub(super) fn fail<T>(&self, what: impl std::fmt::Display) -> Result<T, InputError> {
        Err(self.error(what))
    }

    /// `1 time, 2 gx, 3 gy`
    fn there_are(&self) -> String {
        const MOST: usize = 60;
        if !self.named {
            return format!("there is no header; the columns are numbered 1 to {}", self.heads.len());
        }
        let mut list: Vec<String> =
            self.heads.iter().take(MOST).enumerate().map(|(i, h)| format!("{} '{}'", i + 1, h.full)).collect();
        if self.heads.len() > MOST {
            list.push(format!("… {} in all", self.heads.len()));
        }
        format!("there are {}", list.join(", "))
    }

    /// A name (with or without its unit, upper or lower case) or a 1-based number.
    pub(super) fn find(&self, wanted: &str) -> Result<usize, InputError> {
        let wanted = wanted.trim();
        let lower = wanted.to_lowercase();
        let tests: [&dyn Fn(&Head) -> bool; 4] =
            [&|h| h.full == wanted, &|h| h.name == wanted, &|h| h.full.to_lowercase() == lower, &|h| {
                h.name.to_lowercase() == lower
            }];
        for test in tests.iter().filter(|_| self.named && !wanted.is_empty()) {
            let hits: Vec<usize> = (0..self.heads.len()).filter(|&i| test(self.heads[i])).collect();
            match hits[..] {
                [] => {}
                [hit] => return Ok(hit),
                [first, second, ..] => {
                    let (first, second) = (first + 1, second + 1);
                    return self
                        .fail(format!("columns {first} and {second} are both named '{wanted}'; give the number"));
                }
            }
        }
        match wanted.parse::<usize>() {
            Ok(number) if (1..=self.heads.len()).contains(&number) => Ok(number - 1),
            _ => {
                let names = self.heads.iter().filter(|_| self.named).map(|head| &*head.name);
                self.fail(format!("no column '{wanted}'; {}{}", meant(wanted, names), self.there_are()))
            }
        }
    }

    fn listed(&self, list: &[String]) -> Result<Vec<usize>, InputError> {
        let mut columns = Vec::with_capacity(list.len());
        for wanted in list {
            let column = self.find(wanted)?;
            if columns.contains(&column) {
                return self.fail(format!("column '{}' is asked for twice", self.heads[column].full));
            }
            columns.push(column);
        }
        if columns.is_empty() {
            return self.fail("`columns` is empty");
        }
        Ok(columns)
    }

    /// Columns that by name or unit hold the output of a sensor.
    fn candidates(&self, kind: InputKind) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for (column, head) in self.heads.iter().enumerate().filter(|(_, head)| !head.silent) {
            let mut stem = words(&head.name);
            let by_unit = head.unit.as_ref().and_then(|u| quantity_of(u, kind));
            let sensor = sensor_of(&stem);
            // the temperature of a gyro, or its stamps
            let other = [Dimension::TEMPERATURE, Dimension::TIME];
            let other = head.unit.as_ref().is_some_and(|unit| other.contains(&unit.dimension()));
            let excluded = other || is_excluded(&stem);
            let Some(quantity) = sensor.or(by_unit).filter(|_| !excluded) else { continue };
            let axis = axis_at(&stem);
            if let Some(at) = axis {
                stem.remove(at);
            }
            candidates.push(Candidate { column, quantity, named: sensor.is_some(), stem, axis: axis.is_some() });
        }
        candidates
    }

    /// There is a sensor of this quantity among the columns.
    pub(super) fn has(&self, quantity: Quantity, options: &LogOptions) -> bool {
        self.named && self.candidates(options.kind).iter().any(|c| c.quantity == quantity)
    }

    /// The gyro (else the accelerometer) by names, else by units.
    fn by_name(&self, options: &LogOptions) -> Result<Vec<usize>, InputError> {
        if !self.named {
            return match self.heads.len() {
                1 => Ok(vec![0]),
                n => {
                    let columns = self.guess();
                    let why = format!(
                        "no header names the {n} columns; say which with `columns`, for example `columns` {columns}"
                    );
                    self.error(why).lacking("columns", columns)
                }
            };
        }
        let mut candidates = self.candidates(options.kind);
        let from_flag = options.sought();
        let quantity = from_flag.unwrap_or_else(|| {
            let gyro = candidates.iter().any(|c| c.quantity == Quantity::AngularRate);
            if gyro { Quantity::AngularRate } else { Quantity::SpecificForce }
        });
        candidates.retain(|c| c.quantity == quantity);
        if candidates.iter().any(|c| c.named) {
            candidates.retain(|c| c.named);
        }
        // gyro_north, gyro_east: without axis words they are the axes of one sensor
        if candidates.iter().all(|c| !c.axis) {
            candidates.iter_mut().for_each(|c| c.stem.clear());
        }
        let sensor = match (from_flag, quantity) {
            (None, _) => "gyro or accelerometer",
            (_, Quantity::AngularRate) => "gyro",
            (_, Quantity::SpecificForce) => "accelerometer",
        };
        let Some(first) = candidates.first() else {
            let why = format!(
                "no {sensor} column is known by its name or unit; say which with `columns`; {}",
                self.there_are()
            );
            return self.error(why).lacking("columns", self.guess());
        };
        if candidates.iter().any(|c| c.stem != first.stem) {
            let names: Vec<String> = candidates.iter().map(|c| format!("'{}'", self.heads[c.column].full)).collect();
            let one = candidates.iter().filter(|c| c.stem == first.stem).map(|c| self.heads[c.column].full.clone());
            let why = format!("more than one sensor could be meant: {}; choose with `columns`", names.join(", "));
            return self.error(why).lacking("columns", one.collect::<Vec<_>>().join(","));
        }
        Ok(candidates.iter().map(|c| c.column).collect())
    }

    /// Columns that may be meant where nothing says it: three, without the first of four, which is mostly the time.
    fn guess(&self) -> &'static str {
        match self.heads.len() {
            0 | 1 => "1",
            2 => "1,2",
            3 => "1,2,3",
            _ => "2,3,4",
        }
    }

    /// Unit of an extra column.
    fn extra(&self, head: &Head, wanted: &ExtraColumn) -> Result<Unit, InputError> {
        let (full, flag) = (&head.full, &wanted.flag);
        let unit = match (&head.unit, &wanted.unit) {
            (Some(header), Some(said)) if !same(header, said) => {
                return self.fail(format!("column '{full}' is in {header} by its header, but {flag} says {said}"));
            }
            (Some(unit), _) | (None, Some(unit)) => unit.clone(),
            (None, None) => {
                let example = wanted.dimension.example();
                return self.fail(format!("no unit is known for column '{full}'; say it with {flag}:{example}"));
            }
        };
        match unit.require(wanted.dimension) {
            Ok(()) => Ok(unit),
            Err(error) => self.fail(format!("column '{full}' ({flag}): {error}")),
        }
    }

    /// Unit of each column from the header or the flag, never both different, never neither.
    fn axes(&self, columns: &[usize], options: &LogOptions) -> Result<(Vec<AxisInfo>, Quantity), InputError> {
        let mut axes: Vec<AxisInfo> = Vec::with_capacity(columns.len());
        let mut quantity = options.quantity;
        for head in columns.iter().map(|&c| self.heads[c]) {
            let unit = match (&head.unit, &options.unit) {
                (Some(header), Some(flag)) if !same(header, flag) => {
                    let full = &head.full;
                    return self.fail(format!(
                        "column '{full}' is in {header} by its header, but `unit` says {flag}; drop one of them"
                    ));
                }
                (_, Some(flag)) => flag.clone(),
                (Some(header), None) => header.clone(),
                (None, None) => {
                    let why = match &head.unit_text {
                        Some(text) => match Unit::parse(text) {
                            Err(error) => format!("no unit is known for column '{}' ({error})", head.full),
                            Ok(_) => format!("no unit is known for column '{}'", head.full),
                        },
                        None => format!("the header gives no unit for column '{}'", head.full),
                    };
                    let unit = if quantity == Some(Quantity::SpecificForce) { "m/s^2" } else { "deg/s" };
                    return self
                        .error(format!("{why}; say it with `unit`, for example `unit` {unit}"))
                        .lacking("unit", unit);
                }
            };
            let wanted = quantity.or_else(|| quantity_of(&unit, options.kind)).unwrap_or_else(|| {
                // no such quantity: the error below names the nearer one
                if unit.dimension().length != 0 { Quantity::SpecificForce } else { Quantity::AngularRate }
            });
            if let Err(error) = unit.require(dimension(wanted, options.kind)) {
                let hint = match options.kind {
                    InputKind::Rate if unit.dimension() == wanted.dimension().times_time(2) => {
                        "; increments or an integrated angle are read with `input` increments or `input` angle"
                    }
                    InputKind::Increments | InputKind::Angle if unit.dimension() == wanted.dimension() => {
                        "; a rate is read without `input`"
                    }
                    _ => "",
                };
                return self.fail(format!("column '{}': {error}{hint}", head.full));
            }
            quantity = Some(wanted);
            let unit_name = if axes.iter().any(|a| a.name == head.name) { &head.full } else { &head.name };
            let name = if unit_name.is_empty() { "value".to_string() } else { unit_name.clone() };
            axes.push(AxisInfo { name, unit });
        }
        Ok((axes, quantity.unwrap_or(Quantity::AngularRate)))
    }

    pub(super) fn time(&self, options: &LogOptions) -> Result<Option<(usize, Unit)>, InputError> {
        let (column, flag) = match options.time.as_deref().map(str::trim) {
            Some("none") => return self.no_time(options),
            Some(text) => self.with_unit(text, Dimension::TIME)?,
            None => match self.time_by_name(options)? {
                Some(column) => (column, None),
                None => return self.no_time(options),
            },
        };
        let head = self.heads[column];
        let unit = match (&head.unit, flag) {
            (Some(header), Some(flag)) if !same(header, &flag) => {
                return self
                    .fail(format!("column '{}' is in {header} by its header, but `time` says {flag}", head.full));
            }
            (Some(unit), _) => unit.clone(),
            (None, Some(flag)) => flag,
            // with --rate the stamps are not needed
            (None, None) if options.rate_hz.is_some() => return Ok(None),
            (None, None) => {
                let name = &head.full;
                let or = match self.rate_hz {
                    Some(rate) => format!("take the {rate} Hz that the file says with `time` none"),
                    None => "give `rate` HZ".into(),
                };
                return self
                    .error(format!(
                        "time column '{name}' has no unit; say it with `time` '{name}:s' (or ms, us, ns), or {or}"
                    ))
                    .lacking("time", format!("{name}:s"));
            }
        };
        match unit.require(Dimension::TIME) {
            Ok(()) => Ok(Some((column, unit))),
            Err(error) => self.fail(format!("time column '{}': {error}", head.full)),
        }
    }

    fn no_time(&self, options: &LogOptions) -> Result<Option<(usize, Unit)>, InputError> {
        match options.rate_hz.or(self.rate_hz) {
            Some(_) => Ok(None),
            None => self
                .error("no sample rate: no time column is used; give `rate` HZ, or `time` COLUMN")
                .lacking("rate", "100"),
        }
    }

    /// `NAME`, `NAME:ms`, `3`, `3:ms`.
    pub(super) fn with_unit(&self, text: &str, of: Dimension) -> Result<(usize, Option<Unit>), InputError> {
        let whole = match self.find(text) {
            Ok(column) => return Ok((column, None)),
            Err(error) => error,
        };
        match text.rsplit_once(':').map(|(name, unit)| (name, Unit::parse(unit))) {
            Some((name, Ok(unit))) if unit.dimension() == of => Ok((self.find(name)?, Some(unit))),
            _ => Err(whole),
        }
    }

    fn time_by_name(&self, options: &LogOptions) -> Result<Option<usize>, InputError> {
        if !self.named {
            return Ok(None);
        }
        let rank = |head: &Head| match &head.unit {
            Some(unit) if unit.dimension() != Dimension::TIME => 0,
            _ => time_rank(&head.name),
        };
        let best = self.heads.iter().map(|h| rank(h)).max().unwrap_or(0);
        let hits: Vec<usize> = (0..self.heads.len()).filter(|&i| best > 0 && rank(self.heads[i]) == best).collect();
        match hits[..] {
            [] => Ok(None),
            [hit] => Ok(Some(hit)),
            _ if options.rate_hz.is_some() => Ok(None),
            _ => {
                let names: Vec<String> = hits.iter().map(|&i| format!("'{}'", self.heads[i].full)).collect();
                self.fail(format!("several columns could be the time: {}; choose with `time`", names.join(", ")))
            }
        }
    }

    /// Other columns that could be the time, for a message.
    pub(super) fn other_times(&self, than: usize) -> String {
        let names: Vec<String> = (0..self.heads.len())
            .filter(|&i| i != than && self.named)
            .filter(|&i| self.heads[i].unit.as_ref().is_some_and(|u| u.dimension() == Dimension::TIME))
            .filter(|&i| time_rank(&self.heads[i].name) > 0)
            .map(|i| format!("'{}'", self.heads[i].full))
            .collect();
        if names.is_empty() { String::new() } else { format!(" (there is also {})", names.join(", ")) }
    }
}

/// The same factor and dimension, however it is spelled.
pub(super) fn same(a: &Unit, b: &Unit) -> bool {
    a.dimension() == b.dimension() && (a.scale() - b.scale()).abs() <= 1e-9 * a.scale().abs()
}

/// What became of that.
#[derive(Clone, Debug, Default)]
pub(super) struct Temperature {
    pub(super) column: Option<(usize, AxisInfo)>,
    /// Why a column that looks like a temperature is not read.
    pub(super) note: Option<String>,
}

impl Temperature {
    pub(super) fn passed_over(note: String) -> Temperature {
        Temperature { column: None, note: Some(note) }
    }
}
