//! Which axis of the log goes through which axis of the design.

use super::{LogShape, ReplayError};
use crate::filter::FilterDesign;
use crate::units::Quantity;

/// Sample rates may differ by this much, relatively: stamps of a good log are not better, and the filter does not
/// notice.
pub const RATE_TOLERANCE: f64 = 0.005;

/// Checks that the log can go through the design and gives, for each design axis, the index of its log axis.
///
/// The quantity must be the same and the sample rates must agree within 0.5 %. Axes are matched by name (ignoring
/// case); else by their last letter x, y, z (`gyro_x`, `wx`, `x`); else, when both have the same number of axes and
/// no name tells otherwise, by order. Log axes that the design does not have are left out.
pub fn assign(design: &FilterDesign, log: &LogShape) -> Result<Vec<usize>, ReplayError> {
    let wanted: Vec<&str> = design.axes.iter().map(|a| a.name.as_str()).collect();
    assign_to(&wanted, design.quantity, design.sample_rate_hz, log)
}

/// The same for axes, a quantity and a sample rate of any filter.
pub fn assign_to(
    wanted: &[&str],
    quantity: Quantity,
    sample_rate_hz: f64,
    log: &LogShape,
) -> Result<Vec<usize>, ReplayError> {
    if log.quantity != quantity {
        return Err(ReplayError::Quantity { log: log.quantity.si_unit(), filter: quantity.si_unit() });
    }
    let difference = (log.sample_rate_hz / sample_rate_hz - 1.0).abs();
    if difference.is_nan() || difference > RATE_TOLERANCE {
        return Err(ReplayError::Rate {
            log_hz: log.sample_rate_hz,
            filter_hz: sample_rate_hz,
            percent: 100.0 * difference,
        });
    }
    let found: Vec<&str> = log.axes.iter().map(String::as_str).collect();
    partners(wanted, &found).ok_or_else(|| ReplayError::Axes { log: found.join(", "), filter: wanted.join(", ") })
}

/// For each wanted axis the index of its partner among those found; the rule of [`assign`]. None when it cannot be
/// told.
pub fn partners(wanted: &[&str], found: &[&str]) -> Option<Vec<usize>> {
    let same_name = |a: &str, b: &str| a.trim().eq_ignore_ascii_case(b.trim());
    let same_letter = |a: &str, b: &str| direction(a).is_some() && direction(a) == direction(b);
    by_rule(wanted, found, same_name)
        .or_else(|| by_rule(wanted, found, same_letter))
        .or_else(|| by_order(wanted, found))
}

/// Each wanted axis has exactly one partner, and no two share one.
fn by_rule(wanted: &[&str], found: &[&str], matches: impl Fn(&str, &str) -> bool) -> Option<Vec<usize>> {
    let mut partners = Vec::with_capacity(wanted.len());
    for name in wanted {
        let mut candidates = (0..found.len()).filter(|&i| matches(name, found[i]));
        let partner = candidates.next()?;
        if candidates.next().is_some() || partners.contains(&partner) {
            return None;
        }
        partners.push(partner);
    }
    Some(partners)
}

/// Order decides only when the counts are equal and the names do not contradict it.
fn by_order(wanted: &[&str], found: &[&str]) -> Option<Vec<usize>> {
    let contradicts = |a: &str, b: &str| matches!((direction(a), direction(b)), (Some(x), Some(y)) if x != y);
    (wanted.len() == found.len() && !wanted.iter().zip(found).any(|(a, b)| contradicts(a, b)))
        .then(|| (0..found.len()).collect())
}

/// The axis letter a name ends in, once a unit-like suffix such as `_dps` is away: `gyr_x_dps`, `GyroX`, `wz`, `x`.
fn direction(name: &str) -> Option<char> {
    name.split(|c: char| !c.is_ascii_alphanumeric())
        .rev()
        .find_map(|part| part.chars().last().map(|c| c.to_ascii_lowercase()).filter(|c| matches!(c, 'x' | 'y' | 'z')))
}
