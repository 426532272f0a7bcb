//! The check in single precision: nothing is lost where nothing should be, and what is lost is what f32 cannot hold.

use kfdesign::filter::single::{SingleForm, single_precision};
use nalgebra::DMatrix;

use super::{bias_and_drift, drift, model, named};

/// The reference sensor at 100 Hz: no form loses a thousandth in error or claimed sigma.
#[test]
fn a_plain_filter_runs_in_single_precision() {
    let found = single_precision(&drift(0.02806, 193.93, 0.0562, 0.01), 30_000, 3).unwrap();
    assert_eq!(
        found.forms.iter().map(|f| f.form).collect::<Vec<_>>(),
        [SingleForm::Conventional, SingleForm::Joseph, SingleForm::SquareRoot]
    );
    for form in &found.forms {
        assert_eq!(form.lost_at, None);
        let off = |v: &f64| (v - 1.0).abs();
        assert!(form.error.iter().all(|e| off(e) < 1e-3) && form.claimed.iter().all(|c| off(c) < 2e-3), "{form:?}");
    }
    // one state: its correlation matrix is 1
    assert!((found.condition - 1.0).abs() < 1e-12);
    assert!(single_precision(&bias_and_drift(), 2000, 3).unwrap().condition > 1.0);
}

/// Three nearly parallel measurements, from P = I: as they become more alike, the condition of P grows like 1/d². Up
/// to 10⁵ every form in f32 claims what f64 does to 1 %; from 10⁸ on P - K h P and Joseph are off by more than 2 %,
/// or lost; the square root holds 1 % throughout. (The same steps in NumPy's float32: 8e-4 at most at 7e4, from 8 %
/// on at 2e8, and 6e-4 for the square root at 3e9.)
#[test]
fn the_condition_of_p_says_what_single_precision_holds() {
    let mut seen = [0, 0];
    for d in [0.1, 0.03, 0.01, 1e-3, 2e-4, 1e-4, 5e-5] {
        let one: [&[f64]; 3] = [&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]];
        let none: [&[f64]; 3] = [&[0.0; 3]; 3];
        let mut m = model(&one, &[1.0; 3], &none, d * d, &[0.0; 3], &one);
        m.measurements = vec![named("a"), named("b"), named("c")];
        m.every = vec![1; 3];
        m.h = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0 + d, 1.0, 1.0 + d, 1.0]);
        m.r = DMatrix::identity(3, 3) * (d * d);
        let found = single_precision(&m, 1, 5).unwrap();
        for form in &found.forms {
            let off = form.claimed.iter().map(|c| (c - 1.0).abs()).fold(0.0, f64::max);
            let square_root = form.form == SingleForm::SquareRoot;
            if found.condition < 1e5 || square_root {
                assert!(off < 0.01 && form.lost_at.is_none(), "{:e} {form:?}", found.condition);
                seen[0] += 1;
            } else if found.condition > 1e8 {
                assert!(form.lost_at.is_some() || off.is_nan() || off > 0.02, "{:e} {form:?}", found.condition);
                seen[1] += 1;
            }
        }
    }
    assert_eq!(seen, [13, 6]);
}
