//! The dictionary of gnss-ins-sim's IMU model, as Python or JSON.
//!
//! Source: Aceinna/gnss-ins-sim, sim/imu_model.py and pathgen/pathgen.py: `gyro_b` and `gyro_b_stability` in deg/h,
//! `gyro_arw` in deg/√h, `accel_vrw` in m/s/√h, the others in m/s² and s. The drift is b⁺ = (1 − dt/Tc) b + σ √(1 −
//! e^(−2dt/Tc)) n with σ = `b_stability`; where `b_corr` is not there or infinite it is white noise of the deviation
//! σ, whatever the README says.

use super::{Imported, Problem, axis, sensor_name};
use crate::params::{AxisParams, Measured, Params, TermEntry};
use crate::units::{Quantity, Unit, digits};

/// Of one sensor: constant bias, white noise, size and time of the drift, with their units.
struct Names {
    quantity: Quantity,
    bias: &'static str,
    white: (&'static str, &'static str),
    drift: &'static str,
    /// Of bias and drift.
    unit: &'static str,
    time: &'static str,
}

const SENSORS: [Names; 2] = [
    Names {
        quantity: Quantity::AngularRate,
        bias: "gyro_b",
        white: ("gyro_arw", "deg/sqrt(h)"),
        drift: "gyro_b_stability",
        unit: "deg/h",
        time: "gyro_b_corr",
    },
    Names {
        quantity: Quantity::SpecificForce,
        bias: "accel_b",
        white: ("accel_vrw", "m/s/sqrt(h)"),
        drift: "accel_b_stability",
        unit: "m/s^2",
        time: "accel_b_corr",
    },
];

pub(super) fn knows(text: &str) -> bool {
    SENSORS
        .iter()
        .any(|names| ["'", "\""].iter().any(|quote| text.contains(&format!("{quote}{}{quote}", names.white.0))))
}

pub(super) fn parse(text: &str, rate_hz: Option<f64>) -> Result<Imported, Problem> {
    let sample_rate_hz = super::rate(rate_hz, "the dictionary has no rate")?;
    let (mut sensors, mut rules, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for names in &SENSORS {
        let Some(white) = value(text, names.white.0)? else {
            if let Some(stray) = value(text, names.drift)? {
                return Err(Problem::at(stray.line, format!("{} stands without {}", names.drift, names.white.0)));
            }
            continue;
        };
        let (bias, drift, time) = (value(text, names.bias)?, value(text, names.drift)?, value(text, names.time)?);
        let dt = 1.0 / sample_rate_hz;
        let mut axes = Vec::new();
        for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
            let of = |value: &Option<Value>| value.as_ref().map(|v| v.numbers[i]);
            let times = of(&time).unwrap_or(f64::INFINITY);
            axes.push(
                one(names, name, [of(&bias), Some(white.numbers[i]), of(&drift), Some(times)], dt)
                    .map_err(|message| Problem::at(white.line, format!("axis {name}: {message}")))?,
            );
            if times.is_infinite() && of(&drift).is_some_and(|sigma| sigma > 0.0) {
                warnings.push(format!(
                    "{name}: without a finite {} the program makes white noise of the deviation {}, no drift: it is \
                     read as that, at {} Hz",
                    names.time,
                    names.drift,
                    digits(sample_rate_hz)
                ));
            }
        }
        rules.push(format!(
            "{} is N in {}; {} is the sigma of a Gauss-Markov drift in {} and {} its correlation time in s, as the \
             code takes them",
            names.white.0, names.white.1, names.drift, names.unit, names.time
        ));
        if of_any(&drift, |sigma| sigma > 0.0) {
            rules.push(format!(
                "the {}'s {} is sigma, not the floor of an Allan deviation, whatever a datasheet calls it",
                sensor_name(names.quantity),
                names.drift
            ));
        }
        sensors.push(Params { quantity: names.quantity, sample_rate_hz, axes, design: None, source: None });
    }
    Ok(Imported { origin: "gnss-ins-sim", sensors, rules, warnings })
}

fn of_any(value: &Option<Value>, is: impl Fn(f64) -> bool) -> bool {
    value.as_ref().is_some_and(|v| v.numbers.iter().any(|n| is(*n)))
}

/// One axis of: bias, N, sigma, Tc in the units of the file.
fn one(names: &Names, name: &str, [bias, white, drift, time]: [Option<f64>; 4], dt: f64) -> Result<AxisParams, String> {
    let positive = |key: &str, value: f64| match value > 0.0 {
        true => Ok(value),
        false => Err(format!("{key} is {value}, expected a number above 0")),
    };
    let of = |value: f64, unit: &str| {
        let unit = Unit::parse(unit).map_err(|e| e.to_string())?;
        Ok::<_, String>(Measured { value, unit, interval: None })
    };
    let mut terms =
        vec![TermEntry::White { density: of(positive(names.white.0, white.unwrap_or(0.0))?, names.white.1)? }];
    let sigma = drift.unwrap_or(0.0);
    if sigma != 0.0 {
        let sigma = of(positive(names.drift, sigma)?, names.unit)?;
        match time.filter(|time| time.is_finite()) {
            Some(time) => terms.push(TermEntry::GaussMarkov {
                std_dev: sigma,
                correlation_time: of(positive(names.time, time)?, "s")?,
            }),
            // deviation of a sample to density
            None => terms
                .push(TermEntry::White { density: of(sigma.si() * dt.sqrt(), &super::density_unit(names.quantity))? }),
        }
    }
    let bias = bias.filter(|bias| *bias != 0.0).map(|bias| of(bias, names.unit)).transpose()?;
    Ok(axis(name, bias, None, terms))
}

/// What a key of the dictionary holds.
struct Value {
    numbers: [f64; 3],
    line: usize,
}

/// The value behind `'key':`; `None` when the key is not there.
fn value(text: &str, key: &str) -> Result<Option<Value>, Problem> {
    let mut found: Option<(usize, Vec<char>)> = None;
    for quote in ['\'', '"'] {
        let quoted = format!("{quote}{key}{quote}");
        for (at, _) in text.match_indices(&quoted) {
            let line = text[..at].matches('\n').count() + 1;
            let before = text[..at].rsplit('\n').next().unwrap_or_default();
            let Some(rest) = text[at + quoted.len()..].trim_start().strip_prefix(':') else { continue };
            if before.contains('#') {
                continue;
            }
            if let Some((earlier, _)) = found {
                return Err(Problem::at(
                    line,
                    format!("{key} stands in line {earlier} too: keep one dictionary in the file"),
                ));
            }
            let uncommented: String =
                rest.lines().map(|l| l.split('#').next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
            found = Some((line, uncommented.chars().collect()));
        }
    }
    let Some((line, chars)) = found else { return Ok(None) };
    let mut reader = Reader { chars, at: 0, depth: 0 };
    let problem = |message: String| Problem::at(line, format!("{key}: {message}"));
    let values = reader.product().map_err(problem)?;
    match reader.next() {
        None | Some(',' | '}') => {}
        Some(other) => {
            return Err(problem(format!(
                "found '{other}' behind the numbers, expected a comma or the end of the dictionary"
            )));
        }
    }
    let numbers = match values[..] {
        [one] => [one; 3],
        [x, y, z] => [x, y, z],
        _ => return Err(problem(format!("found {} numbers, expected one or three", values.len()))),
    };
    if numbers.iter().any(|n| n.is_nan()) {
        return Err(problem("a number is not defined".into()));
    }
    Ok(Some(Value { numbers, line }))
}

/// `np.array([3.5, 3.5, 3.5]) * D2R / 3600.0`: products of numbers and lists, element by element.
struct Reader {
    chars: Vec<char>,
    at: usize,
    depth: usize,
}

/// Brackets within brackets.
const DEEPEST: usize = 8;
const EXPECTED: &str = "expected numbers such as np.array([0.25, 0.25, 0.25]) or [0.25, 0.25, 0.25]";

impl Reader {
    /// Behind white space.
    fn next(&mut self) -> Option<char> {
        while self.chars.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.chars.get(self.at).copied()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.next() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    fn product(&mut self) -> Result<Vec<f64>, String> {
        let mut values = self.factor()?;
        loop {
            let divide = match self.next() {
                Some('*') => false,
                Some('/') => true,
                _ => return Ok(values),
            };
            self.at += 1;
            let other = self.factor()?;
            let length = values.len().max(other.len());
            if [values.len(), other.len()].iter().any(|n| *n != 1 && *n != length) {
                return Err(format!("lists of {} and of {} numbers cannot be multiplied", values.len(), other.len()));
            }
            let of = |list: &[f64], i: usize| if list.len() == 1 { list[0] } else { list[i] };
            values = (0..length)
                .map(|i| if divide { of(&values, i) / of(&other, i) } else { of(&values, i) * of(&other, i) })
                .collect();
        }
    }

    fn factor(&mut self) -> Result<Vec<f64>, String> {
        match self.next() {
            Some('-') => {
                self.at += 1;
                Ok(self.factor()?.iter().map(|v| -v).collect())
            }
            Some('(') => self.list(')'),
            Some('[') => self.list(']'),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() => self.name(),
            Some(c) => Err(format!("found '{c}', {EXPECTED}")),
            None => Err(format!("the file ends, {EXPECTED}")),
        }
    }

    /// The values between brackets; one list within is that list.
    fn list(&mut self, close: char) -> Result<Vec<f64>, String> {
        self.at += 1;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("too many brackets, {EXPECTED}"));
        }
        let mut values = Vec::new();
        while !self.take(close) {
            values.extend(self.product()?);
            if !self.take(',') && self.next() != Some(close) {
                return Err(format!("a bracket is not closed, {EXPECTED}"));
            }
        }
        self.depth -= 1;
        Ok(values)
    }

    fn number(&mut self) -> Result<Vec<f64>, String> {
        let mut text = String::new();
        while let Some(c) = self.chars.get(self.at) {
            let sign = "+-".contains(*c) && text.ends_with(['e', 'E']);
            if !(c.is_ascii_digit() || ".eE".contains(*c) || sign) {
                break;
            }
            text.push(*c);
            self.at += 1;
        }
        text.parse::<f64>().map(|v| vec![v]).map_err(|_| format!("'{text}' is no number"))
    }

    fn name(&mut self) -> Result<Vec<f64>, String> {
        let mut text = String::new();
        while let Some(c) = self.chars.get(self.at).filter(|c| c.is_alphanumeric() || **c == '_' || **c == '.') {
            text.push(*c);
            self.at += 1;
        }
        let last = text.rsplit('.').next().unwrap_or_default();
        match last {
            "array" | "float" if self.next() == Some('(') => {
                let quoted = self.chars.get(self.at + 1).filter(|c| **c == '"' || **c == '\'').copied();
                let Some(quote) = quoted else { return self.list(')') };
                let inside: String = self.chars[self.at + 2..].iter().take_while(|c| **c != quote).collect();
                self.at += 2 + inside.chars().count() + 1;
                match (inside.trim_start_matches('+'), self.take(')')) {
                    ("inf" | "Infinity", true) => Ok(vec![f64::INFINITY]),
                    _ => {
                        let shown: String = inside.chars().take_while(|c| !c.is_control()).take(20).collect();
                        Err(format!("found {text}('{shown}'), {EXPECTED}"))
                    }
                }
            }
            "zeros" | "ones" if self.next() == Some('(') => {
                let count = self.list(')')?;
                let value = f64::from(u8::from(last == "ones"));
                if count == [3.0] {
                    Ok(vec![value; 3])
                } else {
                    Err(format!("{text} of another length than 3, {EXPECTED}"))
                }
            }
            "inf" | "Inf" | "Infinity" => Ok(vec![f64::INFINITY]),
            "pi" => Ok(vec![std::f64::consts::PI]),
            "D2R" => Ok(vec![std::f64::consts::PI / 180.0]),
            _ => Err(format!("found '{text}', {EXPECTED}")),
        }
    }
}
