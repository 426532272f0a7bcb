//! Column names and header units to axes.
//!
//! A name is cut into words (`UncompGyroX` is `uncomp gyro x`). Words say which sensor and which axis a column is; a unit
//! in brackets (`gyro_x (deg/s)`) or behind the name (`gyr_x_dps`) says its unit. What stays ambiguous is an error.

use crate::units::{Dimension, Quantity, Unit};

use super::{AxisInfo, InputError, InputKind, LogOptions};

/// One column as the header names it.
#[derive(Clone, Debug)]
pub(super) struct Head {
    /// The whole cell.
    pub(super) full: String,
    /// The name without its unit.
    pub(super) name: String,
    /// What stands where a unit would stand, if anything does.
    pub(super) unit_text: Option<String>,
    pub(super) unit: Option<Unit>,
}

/// What to read: the time column and its unit, the axes, what they measure.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) time: Option<(usize, Unit)>,
    pub(super) columns: Vec<usize>,
    pub(super) axes: Vec<AxisInfo>,
    pub(super) quantity: Quantity,
}

/// The columns of a log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    pub(super) heads: &'a [Head],
    /// False when there is no header and the names are only `column 3`.
    pub(super) named: bool,
    /// File, and line of the header: the beginning of every message.
    pub(super) place: &'a str,
}

/// Units written behind a name and the unit meant, longest first where one ends in another.
const RATE_SUFFIXES: [(&str, &str); 19] = [
    ("deg_per_sec", "deg/s"),
    ("deg_per_s", "deg/s"),
    ("rad_per_sec", "rad/s"),
    ("rad_per_s", "rad/s"),
    ("mrad_s", "mrad/s"),
    ("deg_hr", "deg/h"),
    ("deg_sec", "deg/s"),
    ("deg_s", "deg/s"),
    ("deg/s", "deg/s"),
    ("deg_h", "deg/h"),
    ("rad_sec", "rad/s"),
    ("rad_s", "rad/s"),
    ("rad/s", "rad/s"),
    ("degps", "deg/s"),
    ("radps", "rad/s"),
    ("mdps", "mdps"),
    ("dps", "deg/s"),
    ("dph", "deg/h"),
    ("deg", "deg"),
];
const FORCE_SUFFIXES: [(&str, &str); 11] = [
    ("m_per_s2", "m/s^2"),
    ("m_s_2", "m/s^2"),
    ("m_s^2", "m/s^2"),
    ("m/s^2", "m/s^2"),
    ("m/s2", "m/s^2"),
    ("m_s2", "m/s^2"),
    ("mps2", "m/s^2"),
    ("ms2", "m/s^2"),
    ("mg", "mg"),
    ("ug", "ug"),
    ("g", "g"),
];
/// Behind the name of a time column, or the whole name.
const TIME_SUFFIXES: [(&str, &str); 17] = [
    ("milliseconds", "ms"),
    ("microseconds", "us"),
    ("nanoseconds", "ns"),
    ("seconds", "s"),
    ("millis", "ms"),
    ("micros", "us"),
    ("nanos", "ns"),
    ("secs", "s"),
    ("msec", "ms"),
    ("usec", "us"),
    ("nsec", "ns"),
    ("sec", "s"),
    ("ms", "ms"),
    ("us", "us"),
    ("µs", "us"),
    ("ns", "ns"),
    ("s", "s"),
];

const TIME_WORDS: [&str; 7] = ["time", "timestamp", "timestamps", "stamp", "t", "elapsed", "clock"];
/// A name with one of these is no time of a sample.
const NO_TIME: [&str; 11] = ["delta", "dt", "diff", "week", "status", "ok", "info", "zone", "leap", "valid", "delay"];
const GYRO_WORDS: [&str; 13] = [
    "gyro",
    "gyros",
    "gyr",
    "gyroscope",
    "gyroscopes",
    "gyrometer",
    "omega",
    "angvel",
    "angrate",
    "angularvelocity",
    "angularrate",
    "rotationrate",
    "turnrate",
];
const FORCE_WORDS: [&str; 9] = [
    "acc",
    "accs",
    "accel",
    "accels",
    "accelerometer",
    "accelerometers",
    "acceleration",
    "accelerations",
    "specificforce",
];
/// Two words that mean a gyro, or an accelerometer.
const PAIRS: [(&str, &str, Quantity); 7] = [
    ("angular", "velocity", Quantity::AngularRate),
    ("angular", "rate", Quantity::AngularRate),
    ("angular", "speed", Quantity::AngularRate),
    ("ang", "vel", Quantity::AngularRate),
    ("rotation", "rate", Quantity::AngularRate),
    ("turn", "rate", Quantity::AngularRate),
    ("specific", "force", Quantity::SpecificForce),
];
const AXIS_WORDS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// Columns that are about a sensor but are not its output.
const NOT_A_SENSOR: [&str; 22] = [
    "truth",
    "true",
    "bias",
    "offset",
    "std",
    "sigma",
    "stddev",
    "cov",
    "covariance",
    "var",
    "variance",
    "mag",
    "magnetometer",
    "compass",
    "quat",
    "quaternion",
    "euler",
    "temp",
    "temperature",
    "est",
    "estimate",
    "innovation",
];

impl Head {
    /// A cell of the header.
    pub(super) fn parse(cell: &str) -> Head {
        let full = cell.trim().to_string();
        let text = inside_type(&full).unwrap_or(&full);
        let mut head = Head { full: full.clone(), name: text.to_string(), unit_text: None, unit: None };
        if let Some((name, inner)) = bracketed(text) {
            if !is_index(inner) {
                head.set_unit(name, inner);
            }
        } else if let Some((name, unit)) = text.rsplit_once(" / ") {
            if Unit::parse(unit).is_ok() {
                head.set_unit(name, unit);
            }
        } else if let Some((name, unit)) = suffixed(text) {
            head.set_unit(name, unit);
        }
        head
    }

    /// A column that has only a number (from 1).
    pub(super) fn numbered(number: usize) -> Head {
        let name = format!("column {number}");
        Head { full: name.clone(), name, unit_text: None, unit: None }
    }

    /// The unit that stands in a row of its own below the names.
    pub(super) fn set_unit_below(&mut self, unit: &str) {
        if self.unit.is_none() && !unit.is_empty() {
            self.set_unit(&self.name.clone(), bracketed(unit).map_or(unit, |(_, inner)| inner));
        }
    }

    fn set_unit(&mut self, name: &str, unit: &str) {
        self.name = name.trim().to_string();
        self.unit = Unit::parse(unit).ok();
        self.unit_text = Some(unit.trim().to_string());
    }
}

/// `%float(RawGyroX)` is `RawGyroX`.
fn inside_type(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once('%')?;
    let (kind, rest) = rest.split_once('(')?;
    let (name, _) = rest.rsplit_once(')')?;
    kind.chars().all(|c| c.is_ascii_alphabetic()).then_some(name)
}

/// `name (inner)`, `name [inner]`, `name {inner}`.
fn bracketed(text: &str) -> Option<(&str, &str)> {
    let close = text.chars().next_back()?;
    let open = match close {
        ')' => '(',
        ']' => '[',
        '}' => '{',
        _ => return None,
    };
    let mut depth = 0;
    for (i, c) in text.char_indices().rev() {
        if c == close {
            depth += 1;
        } else if c == open {
            depth -= 1;
            if depth == 0 {
                return Some((&text[..i], &text[i + 1..text.len() - 1]));
            }
        }
    }
    None
}

/// `[0]`, `(x)`: part of the name, no unit.
fn is_index(inner: &str) -> bool {
    let inner = inner.trim().to_ascii_lowercase();
    inner.is_empty() || inner.chars().all(|c| c.is_ascii_digit()) || AXIS_WORDS.contains(&inner.as_str())
}

/// A unit behind the name. Only where the rest of the name says what the column is, so that `gyr_x_g` stays without.
fn suffixed(text: &str) -> Option<(&str, &'static str)> {
    let lower = text.to_ascii_lowercase();
    let cut = |suffix: &str| {
        let stem = lower.strip_suffix(suffix)?;
        let stem = stem.strip_suffix(['_', ' ', '.', '-'])?;
        text.get(..stem.len())
    };
    let table: &[(&str, &str)] = match sensor_of(&words(text)) {
        Some(Quantity::AngularRate) => &RATE_SUFFIXES,
        Some(Quantity::SpecificForce) => &FORCE_SUFFIXES,
        None => &[],
    };
    if let Some(found) = table.iter().find_map(|(suffix, unit)| cut(suffix).map(|name| (name, *unit))) {
        return Some(found);
    }
    for (suffix, unit) in TIME_SUFFIXES {
        if lower == suffix && suffix.len() > 2 {
            return Some((text, unit));
        }
        if let Some(name) = cut(suffix).filter(|name| time_rank(name) > 0) {
            return Some((name, unit));
        }
    }
    // TimeUS, timestampNs: the name of flight logs
    let name = text.get(..text.len().checked_sub(2)?)?;
    let unit = match text.get(name.len()..)? {
        "US" | "Us" => "us",
        "MS" | "Ms" => "ms",
        "NS" | "Ns" => "ns",
        _ => return None,
    };
    let stem = name.to_ascii_lowercase();
    (stem.ends_with("time") || stem.ends_with("stamp")).then_some((name, unit))
}

/// Lower-case words: cut at everything that is no letter or digit, at `aB`, and between letters and digits.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut last = ' ';
    for c in name.chars() {
        if c.is_alphanumeric() {
            let same = last.is_alphanumeric()
                && last.is_ascii_digit() == c.is_ascii_digit()
                && !(last.is_lowercase() && c.is_uppercase());
            match words.last_mut().filter(|_| same) {
                Some(word) => word.extend(c.to_lowercase()),
                None => words.push(c.to_lowercase().collect()),
            }
        }
        last = c;
    }
    split_compounds(words)
}

/// `gyrox`, `xgyro`, `gx`, `wx`, `ax` are a sensor and an axis.
fn split_compounds(words: Vec<String>) -> Vec<String> {
    let mut out = Vec::with_capacity(words.len());
    for word in words {
        let first = ["x", "y", "z"].into_iter().find(|axis| word.starts_with(axis));
        let last = ["x", "y", "z"].into_iter().find(|axis| word.ends_with(axis));
        let sensor = |w: &str| GYRO_WORDS.contains(&w) || FORCE_WORDS.contains(&w);
        match (first, last) {
            (_, Some(axis))
                if sensor(&word[..word.len() - 1]) || ["w", "g", "a"].contains(&&word[..word.len() - 1]) =>
            {
                out.extend([word[..word.len() - 1].to_string(), axis.to_string()]);
            }
            (Some(axis), _) if sensor(&word[1..]) => out.extend([word[1..].to_string(), axis.to_string()]),
            _ => out.push(word),
        }
    }
    out
}

/// Where the axis word stands: a letter or angle name, or a digit at the end.
fn axis_at(words: &[String]) -> Option<usize> {
    let digit = |w: &str| w.chars().all(|c| c.is_ascii_digit());
    words
        .iter()
        .rposition(|w| AXIS_WORDS.contains(&w.as_str()))
        .or_else(|| words.len().checked_sub(1).filter(|&i| i > 0 && digit(&words[i])))
}

fn sensor_of(words: &[String]) -> Option<Quantity> {
    let has = |list: &[&str]| words.iter().any(|w| list.contains(&w.as_str()));
    if has(&NOT_A_SENSOR) {
        return None;
    }
    let pair = |a: &str, b: &str| words.windows(2).any(|w| w[0] == a && w[1] == b);
    if let Some((_, _, quantity)) = PAIRS.iter().find(|(a, b, _)| pair(a, b)) {
        return Some(*quantity);
    }
    // one letter means a sensor only beside an axis: w_RS_S_x, g_x, ax
    let axis = axis_at(words).is_some();
    let lists: [(bool, &[&str], Quantity); 4] = [
        (true, &GYRO_WORDS, Quantity::AngularRate),
        (true, &FORCE_WORDS, Quantity::SpecificForce),
        (axis, &["w", "g"], Quantity::AngularRate),
        (axis, &["a"], Quantity::SpecificForce),
    ];
    lists.into_iter().find(|(applies, list, _)| *applies && has(list)).map(|(_, _, quantity)| quantity)
}

/// 2: the name is only about time (`time`, `timestamp`, `t`); 1: it contains time (`SampleTimeFine`); 0: it is no time.
fn time_rank(name: &str) -> u8 {
    let words = words(name);
    let is_time =
        |w: &String| TIME_WORDS.contains(&w.as_str()) || TIME_SUFFIXES.iter().any(|(s, _)| s.len() > 2 && w == s);
    if words.is_empty() || words.iter().any(|w| NO_TIME.contains(&w.as_str())) {
        0
    } else if words.iter().all(is_time) {
        2
    } else if words.iter().any(|w| w != "t" && is_time(w)) {
        1
    } else {
        0
    }
}

/// The dimension of the values.
pub(super) fn dimension(quantity: Quantity, kind: InputKind) -> Dimension {
    match kind {
        InputKind::Rate => quantity.dimension(),
        InputKind::Increments | InputKind::Angle => quantity.dimension().times_time(2),
    }
}

fn quantity_of(unit: &Unit, kind: InputKind) -> Option<Quantity> {
    [Quantity::AngularRate, Quantity::SpecificForce].into_iter().find(|q| dimension(*q, kind) == unit.dimension())
}

impl Table<'_> {
    /// Time column and axes for these options.
    pub(super) fn choose(&self, options: &LogOptions) -> Result<Choice, InputError> {
        let columns = match &options.columns {
            Some(list) => self.listed(list)?,
            None => self.by_name(options)?,
        };
        let (axes, quantity) = self.axes(&columns, options)?;
        let time = self.time(options)?;
        if let Some((time, _)) = &time
            && columns.contains(time)
        {
            return self.fail(format!("column '{}' is taken both as time and as an axis", self.heads[*time].full));
        }
        Ok(Choice { time, columns, axes, quantity })
    }

    fn fail<T>(&self, what: impl std::fmt::Display) -> Result<T, InputError> {
        Err(InputError { message: format!("{}: {what}", self.place) })
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
    fn find(&self, wanted: &str) -> Result<usize, InputError> {
        let wanted = wanted.trim();
        let lower = wanted.to_lowercase();
        let tests: [&dyn Fn(&Head) -> bool; 4] =
            [&|h| h.full == wanted, &|h| h.name == wanted, &|h| h.full.to_lowercase() == lower, &|h| {
                h.name.to_lowercase() == lower
            }];
        for test in tests.iter().filter(|_| self.named && !wanted.is_empty()) {
            let hits: Vec<usize> = (0..self.heads.len()).filter(|&i| test(&self.heads[i])).collect();
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
            _ => self.fail(format!("no column '{wanted}'; {}", self.there_are())),
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
            return self.fail("--columns is empty");
        }
        Ok(columns)
    }

    /// The gyro (else the accelerometer) by names, else by units.
    fn by_name(&self, options: &LogOptions) -> Result<Vec<usize>, InputError> {
        if !self.named {
            return match self.heads.len() {
                1 => Ok(vec![0]),
                n => self.fail(format!(
                    "no header names the {n} columns; say which with --columns, for example --columns 1,2,3"
                )),
            };
        }
        struct Candidate {
            column: usize,
            quantity: Quantity,
            named: bool,
            stem: Vec<String>,
            axis: bool,
        }
        let mut candidates = Vec::new();
        for (column, head) in self.heads.iter().enumerate() {
            let mut stem = words(&head.name);
            let by_unit = head.unit.as_ref().and_then(|u| quantity_of(u, options.kind));
            let sensor = sensor_of(&stem);
            let excluded = stem.iter().any(|w| NOT_A_SENSOR.contains(&w.as_str()));
            let Some(quantity) = sensor.or(by_unit).filter(|_| !excluded) else { continue };
            let axis = axis_at(&stem);
            if let Some(at) = axis {
                stem.remove(at);
            }
            candidates.push(Candidate { column, quantity, named: sensor.is_some(), stem, axis: axis.is_some() });
        }
        let from_flag = options.quantity.or_else(|| options.unit.as_ref().and_then(|u| quantity_of(u, options.kind)));
        let quantity = from_flag.unwrap_or_else(|| {
            let gyro = candidates.iter().any(|c| c.quantity == Quantity::AngularRate);
            if gyro { Quantity::AngularRate } else { Quantity::SpecificForce }
        });
        candidates.retain(|c| c.quantity == quantity);
        if candidates.iter().any(|c| c.named) {
            candidates.retain(|c| c.named);
        } else if candidates.iter().all(|c| !c.axis) {
            candidates.iter_mut().for_each(|c| c.stem.clear());
        }
        let sensor = match (from_flag, quantity) {
            (None, _) => "gyro or accelerometer",
            (_, Quantity::AngularRate) => "gyro",
            (_, Quantity::SpecificForce) => "accelerometer",
        };
        let Some(first) = candidates.first() else {
            return self.fail(format!(
                "no {sensor} column is known by its name or unit; say which with --columns; {}",
                self.there_are()
            ));
        };
        if candidates.iter().any(|c| c.stem != first.stem) {
            let names: Vec<String> = candidates.iter().map(|c| format!("'{}'", self.heads[c.column].full)).collect();
            return self
                .fail(format!("more than one sensor could be meant: {}; choose with --columns", names.join(", ")));
        }
        Ok(candidates.iter().map(|c| c.column).collect())
    }

    /// Unit of each column from the header or the flag, never both different, never neither.
    fn axes(&self, columns: &[usize], options: &LogOptions) -> Result<(Vec<AxisInfo>, Quantity), InputError> {
        let mut axes: Vec<AxisInfo> = Vec::with_capacity(columns.len());
        let mut quantity = options.quantity;
        for head in columns.iter().map(|&c| &self.heads[c]) {
            let unit = match (&head.unit, &options.unit) {
                (Some(header), Some(flag)) if !same(header, flag) => {
                    let full = &head.full;
                    return self.fail(format!(
                        "column '{full}' is in {header} by its header, but --unit says {flag}; drop one of them"
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
                    return self.fail(format!("{why}; say it with --unit, for example --unit deg/s"));
                }
            };
            let wanted = quantity.or_else(|| quantity_of(&unit, options.kind)).unwrap_or_else(|| {
                let of_time = [0, -2, 2].map(|p| (p, unit.dimension().times_time(p)));
                let force = Quantity::SpecificForce.dimension();
                let is_force = of_time.iter().any(|(_, d)| *d == force) || unit.dimension().length != 0;
                if is_force { Quantity::SpecificForce } else { Quantity::AngularRate }
            });
            if let Err(error) = unit.require(dimension(wanted, options.kind)) {
                let hint = match options.kind {
                    InputKind::Rate if unit.dimension() == wanted.dimension().times_time(2) => {
                        "; increments or an integrated angle are read with --input increments or --input angle"
                    }
                    InputKind::Increments | InputKind::Angle if unit.dimension() == wanted.dimension() => {
                        "; a rate is read without --input"
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

    fn time(&self, options: &LogOptions) -> Result<Option<(usize, Unit)>, InputError> {
        let (column, flag) = match options.time.as_deref().map(str::trim) {
            Some("none") => return self.no_time(options),
            Some(text) => self.time_flag(text)?,
            None => match self.time_by_name(options)? {
                Some(column) => (column, None),
                None => return self.no_time(options),
            },
        };
        let head = &self.heads[column];
        let unit = match (&head.unit, flag) {
            (Some(header), Some(flag)) if !same(header, &flag) => {
                return self
                    .fail(format!("column '{}' is in {header} by its header, but --time says {flag}", head.full));
            }
            (Some(unit), _) => unit.clone(),
            (None, Some(flag)) => flag,
            // with --rate the stamps are not needed
            (None, None) if options.rate_hz.is_some() => return Ok(None),
            (None, None) => {
                let name = &head.full;
                return self.fail(format!(
                    "time column '{name}' has no unit; say it with --time '{name}:s' (or ms, us, ns), or give --rate HZ"
                ));
            }
        };
        match unit.require(Dimension::TIME) {
            Ok(()) => Ok(Some((column, unit))),
            Err(error) => self.fail(format!("time column '{}': {error}", head.full)),
        }
    }

    fn no_time(&self, options: &LogOptions) -> Result<Option<(usize, Unit)>, InputError> {
        match options.rate_hz {
            Some(_) => Ok(None),
            None => self.fail("no sample rate: no time column is used; give --rate HZ, or --time COLUMN"),
        }
    }

    /// `NAME`, `NAME:ms`, `3`, `3:ms`.
    fn time_flag(&self, text: &str) -> Result<(usize, Option<Unit>), InputError> {
        let whole = match self.find(text) {
            Ok(column) => return Ok((column, None)),
            Err(error) => error,
        };
        match text.rsplit_once(':').map(|(name, unit)| (name, Unit::parse(unit))) {
            Some((name, Ok(unit))) if unit.dimension() == Dimension::TIME => Ok((self.find(name)?, Some(unit))),
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
        let best = self.heads.iter().map(rank).max().unwrap_or(0);
        let hits: Vec<usize> = (0..self.heads.len()).filter(|&i| best > 0 && rank(&self.heads[i]) == best).collect();
        match hits[..] {
            [] => Ok(None),
            [hit] => Ok(Some(hit)),
            _ if options.rate_hz.is_some() => Ok(None),
            _ => {
                let names: Vec<String> = hits.iter().map(|&i| format!("'{}'", self.heads[i].full)).collect();
                self.fail(format!("several columns could be the time: {}; choose with --time", names.join(", ")))
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
fn same(a: &Unit, b: &Unit) -> bool {
    a.dimension() == b.dimension() && (a.scale() - b.scale()).abs() <= 1e-9 * a.scale().abs()
}

#[cfg(test)]
#[path = "columns_tests.rs"]
mod tests;
