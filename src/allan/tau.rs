//! Grids of averaging factors m (tau = m dt).

use super::TauGrid;

/// Averaging factors of the grid from 1 to at most `largest`, ascending and distinct.
///
/// * octave: 1, 2, 4, 8 …
/// * decade: 1, 2, 4, 10, 20, 40, 100 … (the grid of that name in Stable32 and NIST SP 1065)
/// * log(k): k points per decade, 10^(i/k) rounded to integers (k from 1 to 10 000)
/// * all: every integer; a whole curve then costs O(n²)
pub fn averaging_factors(grid: TauGrid, largest: u64) -> Vec<u64> {
    let all = 1..=largest;
    match grid {
        TauGrid::All => all.collect(),
        TauGrid::Octave => (0..u64::BITS - 1).map(|i| 1 << i).take_while(|m| all.contains(m)).collect(),
        TauGrid::Decade => (0..19)
            .flat_map(|decade| [1, 2, 4].map(|digit: u64| digit * 10_u64.pow(decade)))
            .take_while(|m| all.contains(m))
            .collect(),
        TauGrid::Log(per_decade) => {
            let per_decade = per_decade.clamp(1, 10_000) as u32;
            let mut factors: Vec<u64> = (0..20 * per_decade)
                .map(|i| 10_f64.powf(f64::from(i) / f64::from(per_decade)).round() as u64)
                .take_while(|m| all.contains(m))
                .collect();
            factors.dedup();
            factors
        }
    }
}
