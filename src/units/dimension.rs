//! What a dimension is called, with an example unit, for messages that a person understands.

use super::Dimension;

/// Doubled exponents of angle, length, time, then name and example.
const NAMED: &[(i8, i8, i8, &str, &str)] = &[
    (0, 0, 0, "a plain number", "1"),
    (2, 0, 0, "an angle", "deg"),
    (2, 0, -2, "an angular rate", "deg/s"),
    (2, 0, -1, "a noise density of angular rate (angle random walk)", "deg/s/sqrt(Hz)"),
    (2, 0, -3, "an angular-rate random walk", "deg/s/sqrt(s)"),
    (2, 0, -4, "an angular acceleration", "deg/s^2"),
    (4, 0, -2, "a power density of angular rate", "(deg/s)^2/Hz"),
    (0, 2, 0, "a length", "m"),
    (0, 2, -2, "a velocity", "m/s"),
    (0, 2, -4, "a specific force", "m/s^2"),
    (0, 2, -3, "a noise density of specific force (velocity random walk)", "m/s^2/sqrt(Hz)"),
    (0, 2, -5, "a specific-force random walk", "m/s^2/sqrt(s)"),
    (0, 2, -6, "a change of specific force with time", "m/s^3"),
    (0, 4, -6, "a power density of specific force", "(m/s^2)^2/Hz"),
    (0, 0, 2, "a time", "s"),
    (0, 0, -2, "a frequency", "Hz"),
];

/// Of mechanics and electricity: doubled exponents of angle, length, time, mass, current, then name and example.
const WITH_MASS: &[([i8; 5], &str, &str)] = &[
    ([0, 0, 0, 2, 0], "a mass", "kg"),
    ([0, 4, 0, 2, 0], "a moment of inertia", "kg m^2"),
    ([0, 2, -4, 2, 0], "a force", "N"),
    ([0, 4, -6, 2, -2], "a voltage", "V"),
    ([0, 4, -6, 2, -4], "a resistance", "ohm"),
    ([0, 0, 0, 0, 2], "a current", "A"),
    ([2, -4, 4, -2, 2], "an angular rate per voltage", "rpm/V"),
];

/// Largest doubled exponent a unit may reach.
const LARGEST: i16 = 24;

impl Dimension {
    pub const NONE: Dimension = Dimension::new(0, 0, 0);
    pub const TIME: Dimension = Dimension::new(0, 0, 2);
    pub const FREQUENCY: Dimension = Dimension::new(0, 0, -2);
    pub const TEMPERATURE: Dimension = Dimension { temperature: 2, ..Dimension::NONE };
    pub const MASS: Dimension = Dimension { mass: 2, ..Dimension::NONE };
    pub const CURRENT: Dimension = Dimension { current: 2, ..Dimension::NONE };
    pub const FORCE: Dimension = Dimension { mass: 2, ..Dimension::new(0, 2, -4) };
    pub const INERTIA: Dimension = Dimension { mass: 2, ..Dimension::new(0, 4, 0) };
    pub const VOLTAGE: Dimension = Dimension { mass: 2, current: -2, ..Dimension::new(0, 4, -6) };
    pub const RESISTANCE: Dimension = Dimension { mass: 2, current: -4, ..Dimension::new(0, 4, -6) };
    /// Of a motor.
    pub const RATE_PER_VOLTAGE: Dimension = Dimension { mass: -2, current: 2, ..Dimension::new(2, -4, 4) };

    /// Doubled exponents of angle, length, time.
    pub const fn new(angle: i8, length: i8, time: i8) -> Self {
        Dimension { angle, length, time, temperature: 0, mass: 0, current: 0 }
    }

    /// The change of this dimension with temperature.
    pub const fn per_temperature(self) -> Self {
        Dimension { temperature: self.temperature - 2, ..self }
    }

    /// The same dimension times `time^(half_powers/2)`.
    pub const fn times_time(self, half_powers: i8) -> Self {
        Dimension { time: self.time.saturating_add(half_powers), ..self }
    }

    /// "an angular rate", or the exponents when it has no name.
    pub fn name(self) -> String {
        if let Some(named) = self.named() {
            return named.3.to_string();
        }
        if self == Dimension::TEMPERATURE {
            return "a temperature".into();
        }
        if self.temperature == -2 {
            return format!("{} per temperature", Dimension { temperature: 0, ..self }.name());
        }
        if let Some(named) = self.named_with_mass() {
            return named.1.to_string();
        }
        format!("a {}", self.powers(["angle", "length", "time", "temperature", "mass", "current"]))
    }

    /// A unit of this dimension.
    pub fn example(self) -> String {
        if self == Dimension::TEMPERATURE {
            return "degC".into();
        }
        if self.temperature == -2 {
            return format!("{}/degC", Dimension { temperature: 0, ..self }.example());
        }
        if let Some(named) = self.named_with_mass() {
            return named.2.to_string();
        }
        self.named().map_or_else(|| self.powers(["rad", "m", "s", "K", "kg", "A"]), |named| named.4.to_string())
    }

    /// self · other^(half_power/2), where `other` is a symbol's dimension (whole powers); saturates.
    pub(super) fn times(self, other: Dimension, half_power: i8) -> Dimension {
        self.checked_times(other, half_power).unwrap_or(Dimension { angle: i8::MAX, ..self })
    }

    /// `None` beyond any power a unit has.
    pub(super) fn checked_times(self, other: Dimension, half_power: i8) -> Option<Dimension> {
        let add = |a: i8, b: i8| {
            let sum = i16::from(a) + i16::from(b) * i16::from(half_power) / 2;
            (sum.abs() <= LARGEST).then_some(sum as i8)
        };
        Some(Dimension {
            angle: add(self.angle, other.angle)?,
            length: add(self.length, other.length)?,
            time: add(self.time, other.time)?,
            temperature: add(self.temperature, other.temperature)?,
            mass: add(self.mass, other.mass)?,
            current: add(self.current, other.current)?,
        })
    }

    fn named(self) -> Option<&'static (i8, i8, i8, &'static str, &'static str)> {
        NAMED.iter().find(|n| Dimension::new(n.0, n.1, n.2) == self)
    }

    fn named_with_mass(self) -> Option<&'static ([i8; 5], &'static str, &'static str)> {
        let exponents = [self.angle, self.length, self.time, self.mass, self.current];
        WITH_MASS.iter().find(|named| self.temperature == 0 && named.0 == exponents)
    }

    fn powers(self, base: [&str; 6]) -> String {
        let exponents = [self.angle, self.length, self.time, self.temperature, self.mass, self.current];
        let words: Vec<String> = base
            .iter()
            .zip(exponents)
            .filter(|(_, e)| *e != 0)
            .map(|(name, e)| match e {
                2 => (*name).to_string(),
                _ if e % 2 == 0 => format!("{name}^{}", e / 2),
                _ => format!("{name}^({e}/2)"),
            })
            .collect();
        words.join(" ")
    }
}

/// What was found, and how it relates to what was expected when that is a known confusion.
pub(super) fn found(found: Dimension, expected: Dimension) -> String {
    let name = found.name();
    let rate = |d: Dimension| matches!((d.angle, d.length, d.time), (2, 0, -2) | (0, 2, -4));
    let swapped_axis = (found.angle > 0 && expected.length > 0) || (found.length > 0 && expected.angle > 0);
    if swapped_axis {
        return name;
    }
    if rate(found) && expected == found.times_time(1) {
        return format!("{name}, such as the standard deviation of one sample");
    }
    if rate(expected) && found == expected.times_time(1) {
        return format!("{name}, per root hertz");
    }
    let doubled =
        Dimension { angle: expected.angle * 2, length: expected.length * 2, time: expected.time * 2, ..found };
    if found == doubled {
        return format!("{name}, the square of what is wanted");
    }
    if found == expected.times_time(2) && rate(expected) {
        return format!("{name}, the integral of what is wanted");
    }
    name
}
