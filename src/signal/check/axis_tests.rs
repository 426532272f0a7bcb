use super::*;
use crate::numerics::random::{StreamId, fill_normal, stream};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn noise(n: usize, sigma: f64, axis: u32) -> Vec<f64> {
    let mut rng = stream(7, StreamId { run: 0, axis, term: 0 });
    let mut x = vec![0.0; n];
    fill_normal(&mut rng, &mut x);
    x.iter_mut().for_each(|v| *v *= sigma);
    x
}

fn check(values: &[f64], kind: InputKind) -> Vec<Note> {
    let unit = Unit::parse(if kind == InputKind::Rate { "deg/s" } else { "deg" }).unwrap();
    let mut axis = AxisCheck::new("x", &unit, Quantity::AngularRate, kind);
    axis.add_all(values, Places { first: 0, times: &[] });
    axis.findings(100.0)
}

fn kinds(values: &[f64]) -> Vec<FindingKind> {
    check(values, InputKind::Rate).iter().map(|f| f.kind).collect()
}

fn only(values: &[f64], kind: FindingKind) -> (u64, u64, bool) {
    let found = check(values, InputKind::Rate);
    let note = found.iter().find(|f| f.kind == kind).unwrap_or_else(|| panic!("no {kind:?} among {}", found.len()));
    (note.count, note.first.map_or(0, |p| p.index), note.serious)
}

// A window's threshold of 8 robust sigma: below 1e-14 per sample, so below 1e-8 for all samples of these tests; the
// other rules are further away still.
#[test]
fn white_noise_with_a_slow_drift_has_nothing_to_say() {
    let mut x = noise(100_000, 0.1 * DEG, 0);
    x.iter_mut().enumerate().for_each(|(i, v)| *v += 0.2 * DEG * (i as f64 / 3e4).sin());
    assert!(kinds(&x).is_empty(), "{:?}", kinds(&x));
}

#[test]
fn each_defect_is_found_once_with_count_and_place() {
    let rest = noise(20_000, 0.1 * DEG, 1);
    let with = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut x = rest.clone();
        change(&mut x);
        x
    };
    let nan = with(&|x| (500..510).for_each(|i| x[i] = f64::NAN));
    assert_eq!((kinds(&nan), only(&nan, FindingKind::Nan)), (vec![FindingKind::Nan], (10, 500, false)));
    let stuck = with(&|x| (700..720).for_each(|i| x[i] = x[699]));
    assert_eq!((kinds(&stuck), only(&stuck, FindingKind::Stuck)), (vec![FindingKind::Stuck], (21, 699, true)));
    let outlier = with(&|x| (0..3).for_each(|i| x[5000 + 2000 * i] += 2.0 * DEG));
    assert_eq!((kinds(&outlier), only(&outlier, FindingKind::Outlier)), (vec![FindingKind::Outlier], (3, 5000, true)));
    let limited = with(&|x| x.iter_mut().for_each(|v| *v = v.min(0.22 * DEG)));
    let above = rest.iter().filter(|v| **v >= 0.22 * DEG).count() as u64;
    let first = rest.iter().position(|v| *v >= 0.22 * DEG).unwrap() as u64;
    assert_eq!(only(&limited, FindingKind::Saturated), (above, first, true));
    let lowest = with(&|x| x.iter_mut().for_each(|v| *v = v.max(-0.22 * DEG)));
    assert!(kinds(&lowest).contains(&FindingKind::Saturated));
    let moved = with(&|x| (8000..9000).for_each(|i| x[i] += 5.0 * DEG * ((i as f64) / 20.0).sin()));
    let (_, first, serious) = only(&moved, FindingKind::Motion);
    assert!(serious && first.abs_diff(8000) < 64, "{first}");
    let turning = with(&|x| x.iter_mut().for_each(|v| *v += 40.0 * DEG));
    assert_eq!((kinds(&turning), only(&turning, FindingKind::Motion)), (vec![FindingKind::Motion], (20_000, 0, true)));
    let swaying = with(&|x| x.iter_mut().enumerate().for_each(|(i, v)| *v += 4.0 * DEG * (i as f64 / 3e3).sin()));
    assert_eq!(only(&swaying, FindingKind::Motion), (20_000, 0, true));
}

#[test]
fn the_quantisation_step_is_measured_also_through_printing() {
    let step = DEG / 131.0;
    let coarse: Vec<f64> = noise(20_000, 0.1 * DEG, 2).iter().map(|x| (x / step).round() * step).collect();
    // printed with six decimals of a degree, with an offset that is no multiple
    let printed: Vec<f64> = coarse.iter().map(|x| ((x / DEG + 0.0023) * 1e6).round() / 1e6 * DEG).collect();
    for x in [&coarse, &printed] {
        let mut sample = x.clone();
        let found = quantisation_step(&mut sample).unwrap();
        assert!((found / step - 1.0).abs() < 1e-3, "{found}");
        assert_eq!((kinds(x), only(x, FindingKind::Quantised)), (vec![FindingKind::Quantised], (20_000, 0, false)));
    }
    // the noise is below the steps
    let hidden: Vec<f64> = noise(20_000, 0.1 * DEG, 3).iter().map(|x| (x / (0.3 * DEG)).round() * 0.3 * DEG).collect();
    assert!(only(&hidden, FindingKind::Quantised).2);
    assert!(quantisation_step(&mut noise(20_000, 1.0, 4)).is_none());
}

#[test]
fn increments_and_integrals_are_judged_as_the_rate_they_make() {
    let rate = noise(20_000, 0.1 * DEG, 5);
    let increments: Vec<f64> = rate.iter().map(|r| r * 0.01).collect();
    let mut angle = Vec::new();
    increments.iter().fold(0.0, |sum, d| {
        angle.push(sum + d);
        sum + d
    });
    assert!(check(&increments, InputKind::Increments).is_empty());
    assert!(check(&angle, InputKind::Angle).is_empty());
    let turning: Vec<f64> = angle.iter().enumerate().map(|(i, a)| a + 30.0 * DEG * i as f64 * 0.01).collect();
    let found = check(&turning, InputKind::Angle);
    assert_eq!(found.iter().map(|f| f.kind).collect::<Vec<_>>(), [FindingKind::Motion]);
    assert!(
        found[0].message.contains("the mean is 30 deg/s") || found[0].message.contains("29.99 deg/s"),
        "{}",
        found[0].message
    );
}

/// Noise behind two equal first-order low-passes; `pole`: of each.
fn low_passed(n: usize, pole: f64, axis: u32) -> Vec<f64> {
    let settle = (20.0 / (1.0 - pole)) as usize;
    let (mut once, mut twice) = (0.0, 0.0);
    let all = noise(n + settle, 0.1 * DEG, axis).into_iter().map(|x| {
        once = pole * once + (1.0 - pole) * x;
        twice = pole * twice + (1.0 - pole) * once;
        twice
    });
    all.skip(settle).collect()
}

/// Correlated noise and noise with outliers scatter from window to window, and are at rest all the same: poles of up
/// to 0.99, 1 % of samples of ten times the spread. The rule is made for 1 of 10⁶ logs; that the variance of a
/// window has a chi-square law is an approximation, so that none of 60 is what is asked. A burst of thirty times the
/// noise is found in each.
#[test]
fn low_passed_noise_and_outliers_are_no_motion() {
    let moves = |x: &[f64]| kinds(x).contains(&FindingKind::Motion);
    for (k, pole) in [0.0, 0.5, 0.8, 0.9, 0.95, 0.99].into_iter().enumerate() {
        for run in 0..8 {
            let mut x = low_passed(if run % 2 == 0 { 20_000 } else { 100_000 }, pole, 100 + 10 * k as u32 + run);
            assert!(!moves(&x), "pole {pole}, run {run}: {:?}", kinds(&x));
            let burst = low_passed(2000, pole, 200 + 10 * k as u32 + run);
            (0..2000).for_each(|i| x[9000 + i] += 30.0 * burst[i]);
            assert!(moves(&x), "pole {pole}, run {run}: the burst is not seen");
        }
    }
    for run in 0..12 {
        let (mut x, loud) = (noise(50_000, 0.1 * DEG, 300 + run), noise(50_000, 0.1 * DEG, 320 + run));
        x.iter_mut().zip(loud).enumerate().for_each(|(i, (x, loud))| {
            if i.wrapping_mul(2_654_435_761) % 100 == 7 {
                *x = 10.0 * loud;
            }
        });
        assert!(!moves(&x), "run {run}: {:?}", kinds(&x));
    }
}
