//! A column that runs like a clock: what an example may offer where neither the log nor an option says the time.

use super::InputError;
use super::rows::Rows;
use super::table::Table;

/// Fewer rows say little of how a column runs: noise rises so often in a row with a probability below 1e-32.
const FEWEST: usize = 30;
/// Rates of inertial sensors, Hz, by which the unit is found; a count of samples has the rate 1 in every unit.
const RATES: [f64; 2] = [2.0, 20_000.0];

/// Puts the column that runs like a clock in the place of a rate that nobody knows. The table is read for it, and is
/// of no use to anybody else: it could not be opened.
pub(super) fn offer(mut error: InputError, table: &mut dyn Table) -> InputError {
    let Some(rate) = error.missing.iter().position(|(option, _)| *option == "rate") else { return error };
    let names: Vec<String> = table.heads().iter().map(|head| head.full.clone()).collect();
    let axes = error.missing.iter().find(|(option, _)| *option == "columns").map_or("", |(_, columns)| columns);
    let taken: Vec<&str> = axes.split(',').collect();
    let free = |i: &usize| !taken.contains(&&*(i + 1).to_string()) && !taken.contains(&&*names[*i]);
    let free: Vec<usize> = (0..names.len()).filter(free).collect();
    table.select(None, &free, None);
    let mut rows = Rows::default();
    if !table.next_rows(&mut rows).unwrap_or(false) {
        return error;
    }
    let clock = free.iter().zip(&rows.values).find_map(|(column, values)| Some((*column, unit(values)?)));
    if let Some((column, unit)) = clock {
        let name = if table.named() { names[column].clone() } else { (column + 1).to_string() };
        error.message += &format!("; column '{name}' runs like a clock in {unit}");
        error.missing[rate] = ("time", format!("{name}:{unit}"));
    }
    error
}

/// The unit of values that run like a clock: they rise from row to row, however unevenly (a log that is read in
/// bursts has steps of a fifth and of thirty times the usual one).
fn unit(values: &[f64]) -> Option<&'static str> {
    let (first, last) = (values.first()?, values.last()?);
    if values.len() < FEWEST || !values.is_sorted_by(|a, b| a < b) {
        return None;
    }
    let usual = (last - first) / (values.len() - 1) as f64;
    let units = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    let fits = |(_, second): &&(&str, f64)| (RATES[0]..=RATES[1]).contains(&(1.0 / (usual * second)));
    if usual == 1.0 { None } else { units.iter().find(fits).map(|(unit, _)| *unit) }
}

#[cfg(test)]
mod tests {
    use super::unit;

    #[test]
    fn a_clock_rises_in_steps_of_some_unit() {
        let at = |step: f64| (0..100).map(|i| 5.0 + step * f64::from(i)).collect::<Vec<_>>();
        for (step, expected) in [(0.01, Some("s")), (10.0, Some("ms")), (1e4, Some("us")), (1e7, Some("ns"))] {
            assert_eq!(unit(&at(step)), expected);
        }
        // a count, a sensor, a clock that goes back or stands still
        assert_eq!(unit(&at(1.0)), None);
        assert_eq!(unit(&(0..100).map(|i| (f64::from(i)).sin()).collect::<Vec<_>>()), None);
        let mut values = at(0.01);
        values.swap(40, 41);
        assert_eq!(unit(&values), None);
        let mut lost = at(0.01);
        lost[50..].iter_mut().for_each(|t| *t += 0.3);
        assert_eq!(unit(&lost), Some("s"));
    }
}
