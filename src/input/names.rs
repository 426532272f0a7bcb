//! Column names: the words in them, and the unit in brackets or behind the name.
//!
//! A name is cut into words (`UncompGyroX` is `uncomp gyro x`). Words say which sensor and which axis a column is; a
//! unit in brackets (`gyro_x (deg/s)`) or behind the name (`gyr_x_dps`) says its unit.

use crate::units::{Quantity, Unit, plain};

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
    /// The name does not say what the column is: one of several under one name.
    pub(super) silent: bool,
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
const TEMPERATURE_WORDS: [&str; 6] = ["temp", "temperature", "temperatures", "tempc", "tempf", "tempk"];
/// Behind the name of a temperature column, or in brackets.
const TEMPERATURE_UNITS: [(&str, &str); 8] = [
    ("celsius", "degC"),
    ("degc", "degC"),
    ("c", "degC"),
    ("kelvin", "K"),
    ("k", "K"),
    ("fahrenheit", "degF"),
    ("degf", "degF"),
    ("f", "degF"),
];
const AXIS_WORDS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// What the sample rate is called, without separators.
const RATE_WORDS: [&str; 13] = [
    "samplingrate",
    "samplerate",
    "samplingfrequency",
    "samplefrequency",
    "samplingratehz",
    "sampleratehz",
    "updaterate",
    "updateratehz",
    "outputrate",
    "outputdatarate",
    "ratehz",
    "fs",
    "fshz",
];
/// Columns that are about a sensor but are not its output.
const NOT_A_SENSOR: [&str; 20] = [
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
    "est",
    "estimate",
    "innovation",
];

impl Head {
    /// A cell of the header.
    pub(super) fn parse(cell: &str) -> Head {
        let full = plain(cell.trim()).into_owned();
        let text = inside_type(&full).unwrap_or(&full);
        let mut head = Head { full: full.clone(), name: text.to_string(), unit_text: None, unit: None, silent: false };
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
        Head { full: name.clone(), name, unit_text: None, unit: None, silent: false }
    }

    /// The unit that stands in a row of its own below the names.
    pub(super) fn set_unit_below(&mut self, unit: &str) {
        if self.unit.is_none() && !unit.is_empty() {
            self.set_unit(&self.name.clone(), bracketed(unit).map_or(unit, |(_, inner)| inner));
        }
    }

    fn set_unit(&mut self, name: &str, unit: &str) {
        self.name = name.trim().trim_end_matches('/').trim_end().to_string();
        // C and F are no units by themselves, but a temperature has no others
        let of_temperature = || temperature_unit(unit).filter(|_| is_temperature(&words(&self.name)));
        self.unit = Unit::parse(of_temperature().unwrap_or(unit)).ok();
        self.unit_text = Some(plain(unit.trim()).into_owned());
    }
}

/// The name of a sample rate.
pub(super) fn is_rate(name: &str) -> bool {
    let plain: String = name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    RATE_WORDS.contains(&plain.as_str())
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
    let all = words(text);
    if is_temperature(&all) {
        // `degC` is two words to one who splits at capitals, and `imuTempF` one text to one who splits at separators
        let whole = TEMPERATURE_UNITS.iter().filter_map(|(suffix, unit)| Some((cut(suffix)?, *unit)));
        let last = TEMPERATURE_UNITS.iter().filter(|(suffix, _)| all.last().is_some_and(|word| word == suffix));
        let glued = last.filter_map(|(suffix, unit)| Some((text.get(..text.len().checked_sub(suffix.len())?)?, *unit)));
        if let Some((name, unit)) = whole.chain(glued).min_by_key(|(name, _)| name.len()) {
            return Some((name.trim_end_matches(['_', ' ', '.', '-']), unit));
        }
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
pub(super) fn words(name: &str) -> Vec<String> {
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
pub(super) fn axis_at(words: &[String]) -> Option<usize> {
    let digit = |w: &str| w.chars().all(|c| c.is_ascii_digit());
    words
        .iter()
        .rposition(|w| AXIS_WORDS.contains(&w.as_str()))
        .or_else(|| words.len().checked_sub(1).filter(|&i| i > 0 && digit(&words[i])))
}

/// True for a column about a sensor that is not its output: truth, bias, standard deviation, magnetometer,
/// temperature …
pub(super) fn is_excluded(words: &[String]) -> bool {
    is_temperature(words) || words.iter().any(|w| NOT_A_SENSOR.contains(&w.as_str()))
}

/// The words are about a temperature.
pub(super) fn is_temperature(words: &[String]) -> bool {
    words.iter().any(|w| TEMPERATURE_WORDS.contains(&w.as_str()))
}

/// `C`, `°C`, `deg C` and their kin.
fn temperature_unit(text: &str) -> Option<&'static str> {
    let sign = |c: &char| c.is_whitespace() || matches!(c, '°' | 'º' | '˚');
    let letters: String = text.chars().filter(|c| !sign(c)).flat_map(char::to_lowercase).collect();
    let bare = letters.strip_prefix("deg").unwrap_or(&letters);
    TEMPERATURE_UNITS.iter().find(|(name, _)| *name == bare).map(|(_, unit)| *unit)
}

/// A word for the sensor of this quantity is among them.
pub(super) fn is_of(words: &[String], quantity: Quantity) -> bool {
    let list: &[&str] = match quantity {
        Quantity::AngularRate => &GYRO_WORDS,
        Quantity::SpecificForce => &FORCE_WORDS,
    };
    words.iter().any(|w| list.contains(&w.as_str()))
}

/// Gyro or accelerometer, if the words say so.
pub(super) fn sensor_of(words: &[String]) -> Option<Quantity> {
    let has = |list: &[&str]| words.iter().any(|w| list.contains(&w.as_str()));
    if is_excluded(words) {
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
pub(super) fn time_rank(name: &str) -> u8 {
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

#[cfg(test)]
#[path = "names_tests.rs"]
mod tests;
