//! Centred moving average of a slow quantity that is noisy, coarse, or not always there.

use super::Gap;

/// Mean of all finite values within `half` samples on either side, gaps counted with their length. Towards the ends
/// of the log the window shrinks on both sides, so that a straight line stays what it is. Where a window holds no
/// value: straight between its neighbours, level at the ends. NaN throughout when no value is finite.
pub fn moving_average(values: &[f64], gaps: &[Gap], half: usize) -> Vec<f64> {
    let place = places(values.len(), gaps);
    let (first, last) = (place.first().copied().unwrap_or(0), place.last().copied().unwrap_or(0));
    // sums of what is above a typical value: no digits are lost
    let level = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    let mut sums = Vec::with_capacity(values.len() + 1);
    sums.push((0.0, 0_u64));
    values.iter().fold((0.0, 0), |(sum, count), v| {
        let next = if v.is_finite() { (sum + (v - level), count + 1) } else { (sum, count) };
        sums.push(next);
        next
    });
    let (mut from, mut to) = (0, 0);
    let mut smooth: Vec<f64> = (0..values.len())
        .map(|i| {
            let reach = (half as u64).min(place[i] - first).min(last - place[i]);
            // both ends of the window only move on
            while place[from] + reach < place[i] {
                from += 1;
            }
            while to < values.len() && place[to] <= place[i] + reach {
                to += 1;
            }
            let (sum, count) = (sums[to].0 - sums[from].0, sums[to].1 - sums[from].1);
            if count > 0 { level + sum / count as f64 } else { f64::NAN }
        })
        .collect();
    fill(&mut smooth, &place);
    smooth
}

/// Straight lines over what is not finite.
fn fill(values: &mut [f64], place: &[u64]) {
    let known: Vec<usize> = (0..values.len()).filter(|i| values[*i].is_finite()).collect();
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return };
    let ends = [values[first], values[last]];
    values[..first].fill(ends[0]);
    values[last + 1..].fill(ends[1]);
    for pair in known.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let slope = (values[b] - values[a]) / (place[b] - place[a]) as f64;
        for i in a + 1..b {
            values[i] = values[a] + slope * (place[i] - place[a]) as f64;
        }
    }
}

/// Steps from the first sample, gaps included.
pub fn places(samples: usize, gaps: &[Gap]) -> Vec<u64> {
    let mut gaps = gaps.iter().peekable();
    let mut missing = 0;
    (0..samples)
        .map(|i| {
            while let Some(gap) = gaps.next_if(|gap| gap.index == i) {
                missing += gap.missing;
            }
            i as u64 + missing
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line with a hole, a gap and a missing end comes back as it is.
    #[test]
    fn a_line_stays_a_line() {
        let gaps = [Gap { index: 40, missing: 17 }];
        let line: Vec<f64> = places(90, &gaps).iter().map(|k| 20.0 - 0.25 * *k as f64).collect();
        let smooth = moving_average(&line, &gaps, 0);
        assert!(smooth.iter().zip(&line).all(|(a, b)| (a - b).abs() < 1e-12));
        for half in [1, 4, 500] {
            let without = moving_average(&line, &[], half);
            let inside = |i: &usize| half < 5 && (half..40 - half).contains(i);
            assert!((0..90).filter(inside).all(|i| (without[i] - line[i]).abs() < 1e-12), "{half}");
            assert_eq!((without[0], without[89]), (line[0], line[89]));
        }
        let mut holed = line.clone();
        holed[20..30].fill(f64::NAN);
        let smooth = moving_average(&holed, &gaps, 0);
        assert!(smooth.iter().zip(&line).all(|(a, b)| (a - b).abs() < 1e-12));
        holed[..3].fill(f64::NAN);
        assert_eq!(moving_average(&holed, &gaps, 0)[..4], [line[3]; 4]);
    }

    /// By hand: windows shrink at the ends, a gap counts with its length, what is missing does not count.
    #[test]
    fn windows() {
        let nan = f64::NAN;
        assert_eq!(moving_average(&[1.0, 3.0, 8.0, 2.0, 6.0], &[], 2), [1.0, 4.0, 4.0, 16.0 / 3.0, 6.0]);
        assert_eq!(moving_average(&[1.0, 3.0, nan, 2.0, 6.0], &[], 1), [1.0, 2.0, 2.5, 4.0, 6.0]);
        // five steps between the second and the third value
        let gaps = [Gap { index: 2, missing: 4 }];
        assert_eq!(moving_average(&[1.0, 3.0, 9.0, 2.0], &gaps, 2), [1.0, 2.0, 5.5, 2.0]);
        assert_eq!(moving_average(&[], &[], 3), [0.0; 0]);
        assert!(moving_average(&[nan; 3], &[], 1).iter().all(|v| v.is_nan()));
    }
}
