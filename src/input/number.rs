//! One number as it is stored in a binary log.

/// Whole and fraction apart, so that nanoseconds since 1970 keep their last digits.
pub(super) type Split = (i128, f64);

/// A stamp since the first one that is a number.
pub(super) fn since(origin: &mut Option<Split>, stamp: Split) -> f64 {
    let (whole, part) = stamp;
    let first = match *origin {
        None if part.is_finite() => *origin.insert(stamp),
        known => known.unwrap_or((0, 0.0)),
    };
    (whole - first.0) as f64 + (part - first.1)
}

/// How one number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Number {
    pub(super) kind: Kind,
    pub(super) big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Float(u8),
    Signed(u8),
    Unsigned(u8),
    /// Nanoseconds and the like since 1970, or a span of them; the smallest value is "not a time".
    Time,
}

impl Number {
    pub(super) fn size(self) -> usize {
        match self.kind {
            Kind::Float(size) | Kind::Signed(size) | Kind::Unsigned(size) => size as usize,
            Kind::Time => 8,
        }
    }

    /// Whole and fraction of the value at the start of `bytes`; integers keep every digit.
    pub(super) fn decode(self, bytes: &[u8]) -> Split {
        let mut raw = 0u64;
        for i in 0..self.size() {
            let byte = bytes.get(if self.big_endian { i } else { self.size() - 1 - i }).copied().unwrap_or(0);
            raw = raw << 8 | u64::from(byte);
        }
        let signed = |size: u8| {
            let unused = 64 - 8 * u32::from(size);
            i128::from(((raw << unused) as i64) >> unused)
        };
        match self.kind {
            Kind::Float(2) => (0, half(raw as u16)),
            Kind::Float(4) => (0, f64::from(f32::from_bits(raw as u32))),
            Kind::Float(_) => (0, f64::from_bits(raw)),
            Kind::Signed(size) => (signed(size), 0.0),
            Kind::Unsigned(_) => (i128::from(raw), 0.0),
            Kind::Time if raw == 1 << 63 => (0, f64::NAN),
            Kind::Time => (signed(8), 0.0),
        }
    }
}

/// IEEE 754 half precision.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    }
}
