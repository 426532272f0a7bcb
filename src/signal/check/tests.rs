use super::*;
use crate::numerics::random::{StreamId, fill_normal, stream};

fn deg() -> Unit {
    Unit::parse("deg/s").unwrap()
}

fn samples<'a>(times: &'a [f64], values: &'a [Vec<f64>]) -> Samples<'a> {
    Samples { times, axes: values.iter().map(Vec::as_slice).collect() }
}

fn checked(times: &[f64], values: &[Vec<f64>], rate: Option<f64>) -> LogCheck {
    let unit = deg();
    let names = ["x", "y", "z"];
    let axes = names.iter().take(values.len()).map(|n| (*n, &unit));
    let mut checker = Checker::new(axes, Quantity::AngularRate, InputKind::Rate, rate, !times.is_empty(), None);
    checker.push(&[samples(times, values)]).unwrap();
    match checker.finish() {
        Outcome::Done { check, .. } => check,
        other => panic!("{other:?}"),
    }
}

/// Irregular values without repeats.
fn values(n: usize, seed: f64) -> Vec<f64> {
    (0..n).map(|i| ((i as f64 * 12.9898 + seed).sin() * 43758.5453).fract() * 1e-3).collect()
}

#[test]
fn rate_gaps_and_stamps_are_reported_with_their_place() {
    let n = 3000;
    let mut times: Vec<f64> = (0..n).map(|i| i as f64 * 0.01).collect();
    times[1000..].iter_mut().for_each(|t| *t += 0.05);
    times[2000] = times[1999];
    let check = checked(&times, &[values(n, 0.0), values(n, 1.0)], None);
    assert_eq!((check.samples, check.missing, check.time_base), (3000, 5, TimeBase::Stamps));
    assert!((check.sample_rate_hz - 100.0).abs() < 1e-6 && (check.span_s - 30.05).abs() < 1e-6);
    let gap = check.findings.iter().find(|f| f.kind == FindingKind::Gap).unwrap();
    assert_eq!((gap.count, gap.first_index), (1, 1000));
    assert!((gap.first_s - 10.05).abs() < 1e-9 && gap.message.contains("5 samples missing"), "{}", gap.message);
    let repeated = check.findings.iter().find(|f| f.kind == FindingKind::RepeatedStamp).unwrap();
    assert_eq!((repeated.count, repeated.first_index), (1, 2000));
}

#[test]
fn backward_time_is_an_error_unless_the_rate_is_given() {
    let mut times: Vec<f64> = (0..100).map(f64::from).collect();
    times[60] = 3.0;
    let unit = deg();
    let columns = [values(100, 0.0)];
    let mut strict = Checker::new([("x", &unit)], Quantity::AngularRate, InputKind::Rate, None, true, None);
    let (start, rest) = (vec![columns[0][..50].to_vec()], vec![columns[0][50..].to_vec()]);
    let back = strict.push(&[samples(&times[..50], &start), samples(&times[50..], &rest)]).unwrap_err();
    assert_eq!((back.part, back.row, back.from_s, back.to_s), (1, 10, 59.0, 3.0));
    let check = checked(&times, &columns, Some(1.0));
    assert_eq!(check.time_base, TimeBase::Given);
    assert!(check.findings.iter().any(|f| f.kind == FindingKind::BackwardStamp && f.count == 1 && f.first_index == 60));
    let other = checked(&(0..100).map(f64::from).collect::<Vec<_>>(), &columns, Some(2.0));
    assert!(other.findings.iter().any(|f| f.kind == FindingKind::Rate && f.serious));
}

#[test]
fn rows_of_zeros_and_repeated_rows_are_counted() {
    let (mut x, mut y) = (values(5000, 0.0), values(5000, 1.0));
    (x[42], y[42]) = (0.0, 0.0);
    let check = checked(&[], &[x.clone(), y.clone()], Some(100.0));
    let zero = check.findings.iter().find(|f| f.kind == FindingKind::ZeroRow).unwrap();
    assert_eq!((zero.count, zero.first_index, zero.serious), (1, 42, false));
    for i in (1..5000).step_by(2) {
        (x[i], y[i]) = (x[i - 1], y[i - 1]);
    }
    let check = checked(&[], &[x, y], Some(100.0));
    let repeated = check.findings.iter().find(|f| f.kind == FindingKind::RepeatedRow).unwrap();
    assert_eq!((repeated.count, repeated.first_index, repeated.serious), (2500, 1, true));
}

/// However the rows come: here every part begins with the row that ended the one before.
#[test]
fn repeated_rows_are_counted_from_part_to_part() {
    let (mut x, mut y) = (values(5000, 0.0), values(5000, 1.0));
    for i in (10..5000).step_by(10) {
        (x[i], y[i]) = (x[i - 1], y[i - 1]);
    }
    let unit = deg();
    let mut checker =
        Checker::new([("x", &unit), ("y", &unit)], Quantity::AngularRate, InputKind::Rate, Some(100.0), false, None);
    for (x, y) in x.chunks(10).zip(y.chunks(10)) {
        checker.push(&[Samples { times: &[], axes: vec![x, y] }]).unwrap();
    }
    let Outcome::Done { check, .. } = checker.finish() else { panic!("a rate was given") };
    let repeated = check.findings.iter().find(|f| f.kind == FindingKind::RepeatedRow).unwrap();
    assert_eq!((repeated.count, repeated.first_index), (499, 10));
}

#[test]
fn zeros_of_a_coarse_sensor_are_no_finding() {
    // two axes that are 0 in half of their samples, independently: a quarter of the rows is zero by chance.
    // The rule's own false-alarm probability is below 1e-6.
    let coarse = |axis: u32| {
        let mut x = vec![0.0; 4000];
        fill_normal(&mut stream(3, StreamId { run: 0, axis, term: 0 }), &mut x);
        x.iter().map(|v| if *v > 0.0 { 0.0 } else { 1e-3 }).collect::<Vec<_>>()
    };
    let check = checked(&[], &[coarse(0), coarse(1)], Some(100.0));
    let kinds: Vec<FindingKind> = check.findings.iter().map(|f| f.kind).collect();
    assert!(!kinds.contains(&FindingKind::ZeroRow) && !kinds.contains(&FindingKind::RepeatedRow), "{kinds:?}");
}
