//! Replay against independent filters, its verdicts on right and wrong designs, and its behaviour on damaged logs.

mod command;
mod follow;

use approx::assert_relative_eq;
use kfdesign::consistency::Verdict;
use kfdesign::filter::document::SteadyState;
use kfdesign::filter::{AxisDesign, FilterDesign};
use kfdesign::input::Block;
use kfdesign::model::{LinearModel, Named};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::params::AxisParams;
use kfdesign::replay::{Estimates, LogShape, Options, ReplayError, ReplayResult, Replayer};
use kfdesign::units::Quantity;
use nalgebra::{DMatrix, DVector};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn named(name: &str) -> Named {
    Named { name: name.into(), unit: "rad/s".into() }
}

/// Bias and one drift: F = diag(1, φ), H = [1, 1].
fn axis(name: &str, dt: f64, q: f64, phi: f64, r: f64, x0: [f64; 2], p0: [f64; 2]) -> AxisDesign {
    let model = LinearModel {
        dt,
        states: vec![named("bias"), named("drift")],
        inputs: vec![],
        measurements: vec![named("rate")],
        every: vec![1],
        outputs: vec![],
        f: DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, phi])),
        g: DMatrix::zeros(2, 0),
        h: DMatrix::from_row_slice(1, 2, &[1.0, 1.0]),
        q: DMatrix::from_diagonal(&DVector::from_row_slice(&[0.0, q])),
        r: DMatrix::from_element(1, 1, r),
        x0: DVector::from_row_slice(&x0),
        p0: DMatrix::from_diagonal(&DVector::from_row_slice(&p0)),
    };
    // the closed form of the one-state filter: the constant is learnt in the end
    let b = r * (1.0 - phi * phi) - q;
    let predicted = (-b + (b * b + 4.0 * q * r).sqrt()) / 2.0;
    let gain = predicted / (predicted + r);
    let pole = (1.0 - gain) * phi;
    AxisDesign {
        name: name.into(),
        model,
        steady_state: SteadyState {
            period: 1,
            gain: DMatrix::from_row_slice(2, 1, &[0.0, gain]),
            predicted_covariance: DMatrix::from_diagonal(&DVector::from_row_slice(&[0.0, predicted])),
            innovation_covariance: DMatrix::from_element(1, 1, predicted + r),
            poles: vec![(1.0, 0.0), (pole, 0.0)],
            settling_time: -4.0 * dt / pole.ln(),
            residual: 0.0,
            eigenvector_difference: 0.0,
        },
        noise: AxisParams {
            name: name.into(),
            bias: None,
            turn_on_bias: None,
            temperature: None,
            terms: vec![],
            not_identified: vec![],
        },
        about: Default::default(),
    }
}

fn design(axes: Vec<AxisDesign>) -> FilterDesign {
    FilterDesign {
        quantity: Quantity::AngularRate,
        sample_rate_hz: 1.0 / axes[0].model.dt,
        plant: "static".into(),
        design: None,
        axes,
        tuning: serde_json::Value::Null,
    }
}

fn shape(axes: &[&str], rate: f64) -> LogShape {
    LogShape {
        axes: axes.iter().map(ToString::to_string).collect(),
        quantity: Quantity::AngularRate,
        sample_rate_hz: rate,
        aids: 0,
    }
}

/// Rows from..to of a one-axis log as a block.
fn block(z: &[f64], missing: &[u64], dt: f64, range: std::ops::Range<usize>) -> Block {
    Block {
        values: vec![z[range.clone()].to_vec()],
        extra: vec![],
        missing: missing[range.clone()].to_vec(),
        time_s: range.map(|k| k as f64 * dt).collect(),
    }
}

fn replay(design: &FilterDesign, z: &[f64], options: Options) -> ReplayResult {
    let dt = design.axes[0].model.dt;
    let mut replayer = Replayer::new(design, &shape(&["x"], 1.0 / dt), options).unwrap();
    for start in (0..z.len()).step_by(4096) {
        let end = (start + 4096).min(z.len());
        replayer.push(&block(z, &vec![0; z.len()], dt, start..end), None);
    }
    replayer.finish()
}

/// The small log of the oracle: 40 samples of 0.1 s, one NaN, one outlier, gaps of 5 and of 1000 samples.
fn oracle_log() -> (FilterDesign, Vec<f64>, Vec<u64>) {
    let phi = (-0.1_f64 / 5.0).exp();
    let q = 0.02 * 0.02 * (1.0 - phi * phi);
    let small = design(vec![axis("x", 0.1, q, phi, 0.05 * 0.05 / 0.1, [0.1, 0.03], [0.04, 0.0009])]);
    let mut z: Vec<f64> =
        (0..40).map(f64::from).map(|k| 0.15 + 0.05 * (0.7 * k).sin() + 0.1 * (1.3 * k * k).sin()).collect();
    z[7] = f64::NAN;
    z[15] = 3.0;
    let mut missing = vec![0; 40];
    missing[0] = 2; // before the first sample: nothing to predict
    missing[20] = 5;
    missing[30] = 1000;
    (small, z, missing)
}

/// One row of the oracle: sample, ν, √S, x(k|k), √diag P(k|k).
type Row = (usize, f64, f64, [f64; 2], [f64; 2]);

/// `counts`: accepted and rejected samples; `start`: the statistic and its p-value.
fn check(rows: &[Row], gate: Option<f64>, log_likelihood: f64, nis: f64, counts: (u64, u64), start: (f64, f64)) {
    let (small, z, missing) = oracle_log();
    let mut replayer = Replayer::new(&small, &shape(&["x"], 10.0), Options { gate, ..Options::default() }).unwrap();
    let (mut first, mut second) = (Estimates::default(), Estimates::default());
    replayer.push(&block(&z, &missing, 0.1, 0..18), Some(&mut first));
    replayer.push(&block(&z, &missing, 0.1, 18..40), Some(&mut second));
    for &(k, innovation, sigma, x, s) in rows {
        let (estimates, i) = if k < 18 { (&first, k) } else { (&second, k - 18) };
        let out = &estimates.axes[0];
        assert_relative_eq!(out.updates[0].innovation[i], innovation, max_relative = 1e-11);
        assert_relative_eq!(out.updates[0].innovation_sigma[i], sigma, max_relative = 1e-12);
        assert_relative_eq!(out.updates[0].nis[i], (innovation / sigma).powi(2), max_relative = 1e-11);
        for state in 0..2 {
            assert_relative_eq!(out.states[state][i], x[state], max_relative = 1e-10);
            assert_relative_eq!(out.sigmas[state][i], s[state], max_relative = 1e-11);
        }
    }
    let skipped = &first.axes[0];
    assert!(skipped.updates[0].innovation[7].is_nan() && skipped.updates[0].nis[7].is_nan());
    assert!(skipped.sigmas[0][7] >= skipped.sigmas[0][6], "a skipped sample is a prediction only");
    let result = replayer.finish();
    let axis = &result.axes[0];
    assert_relative_eq!(axis.log_likelihood, log_likelihood, max_relative = 1e-13);
    assert_relative_eq!(axis.nis.unwrap().mean, nis, max_relative = 1e-12);
    assert_eq!((axis.samples, axis.unusable, axis.gaps, axis.missing), (40, 1, 2, 1005));
    assert_eq!((axis.accepted, axis.rejected), counts);
    assert_relative_eq!(axis.start.unwrap().sigmas, start.0, max_relative = 1e-9);
    assert_relative_eq!(axis.start.unwrap().p_value, start.1, max_relative = 1e-8);
}

/// An independent filter in numpy 2.4.6 (Joseph form, a loop of predictions over gaps); statsmodels 0.15.0
/// (MLEModel.ssm.filter(), known initial state, NaN rows in the gaps) gives the same log-likelihood,
/// −127.37343447181166, and the same last innovation. The start statistic: the innovations regressed on the answer
/// of the same filter to a shift of x0 by one sigma of P0.
#[test]
fn equals_independent_filters() {
    let rows = [
        (
            0,
            0.01999999999999999,
            0.2567099530598687,
            [0.11213960546282245, 0.030273141122913506],
            [0.12538257085558216, 0.029794439908628796],
        ),
        (
            1,
            0.13675340467527342,
            0.20129193756563302,
            [0.16339144384839227, 0.030798003452717205],
            [0.10014839131626671, 0.029425271286281723],
        ),
        (
            6,
            -0.04365657042879892,
            0.16974566479586226,
            [0.14855405982438766, 0.02757125632408058],
            [0.0629461234360132, 0.027911981671453947],
        ),
        (
            8,
            0.043256197555439996,
            0.1683326148384203,
            [0.1535521077747723, 0.026584504099500327],
            [0.05986577204318711, 0.027382457963872286],
        ),
        (
            16,
            -0.26058069738791356,
            0.16335410270581147,
            [0.29862816731272446, 0.025812819018588274],
            [0.04649100891571344, 0.025564228579897822],
        ),
        (
            20,
            -0.1837577708876102,
            0.16262509671112052,
            [0.2530646658865467, 0.020390480965000204],
            [0.04290523989146196, 0.024013452011034307],
        ),
        (
            29,
            -0.04018293527439035,
            0.16136981150173094,
            [0.2251715621800833, 0.015619895180911563],
            [0.0373608708590923, 0.022851297950421113],
        ),
        (
            30,
            0.06371692673846685,
            0.16369433304025027,
            [0.22849067115844587, 0.0009511467657635428],
            [0.03637476568078112, 0.019850161781017395],
        ),
        (
            39,
            -0.10905331133220271,
            0.16160571678446375,
            [0.20625502805524573, -0.0050175292809219755],
            [0.030653215215504386, 0.019194464889809595],
        ),
    ];
    check(&rows, None, -127.37343447181163, 8.266943182534062, (39, 0), (0.6521246420989274, 0.5194147020160792));
}

/// The same oracle with a gate of five sigmas: sample 15 is counted and changes nothing.
#[test]
fn gated_sample_changes_nothing() {
    let rows = [
        (
            16,
            -0.07035244065893095,
            0.16371929339207292,
            [0.12381226392553481, 0.022115622369451405],
            [0.04755531121709753, 0.0255651042084344],
        ),
        (
            20,
            -0.03419131150666048,
            0.16284659868052523,
            [0.11375555308249767, 0.01822811281215239],
            [0.04362517077448921, 0.02401376452711676],
        ),
        (
            30,
            0.1564364832175248,
            0.16377833970714395,
            [0.14075309643895625, 0.0023328408534325517],
            [0.03671262319848868, 0.019850316033743345],
        ),
        (
            39,
            -0.052313444055642824,
            0.1616375721828741,
            [0.1439900793768056, 0.002913295728521529],
            [0.03085459051512706, 0.019199698732776493],
        ),
    ];
    check(
        &rows,
        Some(5.0),
        28.218364669142225,
        0.24752897547788963,
        (38, 1),
        (0.18703552059811326, 0.8534535355074933),
    );
}

/// The reference sensor ("skydog") and mistuned copies; P0 of the bias from 0.5 deg/s.
fn skydog(dt: f64, n: f64, sigma: f64, tc: f64) -> FilterDesign {
    let (n, sigma, tc) = (0.0562 * n * DEG, 0.0280596 * sigma * DEG, 193.9312 * tc);
    let phi = (-dt / tc).exp();
    let q = -sigma * sigma * (-2.0 * dt / tc).exp_m1();
    design(vec![axis("x", dt, q, phi, n * n / dt, [0.0, 0.0], [(0.5 * DEG).powi(2), sigma * sigma])])
}

/// A log drawn from a design: its bias from P0, its drift stationary.
fn draw(design: &FilterDesign, run: u64, samples: usize) -> Vec<f64> {
    let model = &design.axes[0].model;
    let mut normals = vec![0.0; 2 * samples + 1];
    fill_normal(&mut stream(31, StreamId { run, axis: 0, term: 0 }), &mut normals);
    let bias = normals[2 * samples] * model.p0[(0, 0)].sqrt();
    let (phi, root_q, root_r) = (model.f[(1, 1)], model.q[(1, 1)].sqrt(), model.r[(0, 0)].sqrt());
    let mut drift = normals[0] * model.p0[(1, 1)].sqrt();
    (0..samples)
        .map(|k| {
            if k > 0 {
                drift = phi * drift + root_q * normals[2 * k];
            }
            bias + drift + root_r * normals[2 * k + 1]
        })
        .collect()
}

/// One hour at 100 Hz. The right design is consistent; each wrong one is caught for the right reason and on the
/// right side. The right design alone may fail by chance, with probability at most alpha = 0.001 over seeds; the
/// seed is fixed and was not chosen among several. σ × 2.24 is the seed paper's recipe on its own model; mean NIS
/// cannot see it (its test passes), the low-frequency test does.
#[test]
fn verdicts_on_an_hour_of_the_reference_sensor() {
    let right = skydog(0.01, 1.0, 1.0, 1.0);
    let log = draw(&right, 1, 360_000);
    let options = Options { alpha: 0.001, ..Options::default() };
    let result = replay(&right, &log, options);
    assert_eq!(result.verdict, Verdict::Consistent, "{}", result.meaning);
    assert_eq!(result.axes[0].low_frequency.len(), 4, "blocks of 1/4, 1, 4 and 16 time constants");
    let cases = [
        (skydog(0.01, 1.0, 2.24, 1.0), "low_frequency", "pessimistic"),
        (skydog(0.01, 1.0, 1.0 / 2.24, 1.0), "low_frequency", "optimistic"),
        (skydog(0.01, 1.06, 1.0, 1.0), "nis", "pessimistic"),
        (skydog(0.01, 1.0 / 1.06, 1.0, 1.0), "nis", "optimistic"),
    ];
    for (wrong, test, side) in cases {
        let result = replay(&wrong, &log, options);
        assert_eq!(result.verdict, Verdict::Inconsistent);
        let failed: Vec<&str> = result.tests.iter().filter(|t| !t.pass()).map(|t| t.name.as_str()).collect();
        assert!(failed.contains(&test), "{test} {side}: {failed:?}");
        assert!(result.meaning.contains(side), "{side}: {}", result.meaning);
        let opposite = if side == "optimistic" { "pessimistic" } else { "optimistic" };
        assert!(!result.meaning.contains(opposite), "{side}: {}", result.meaning);
        let nis = result.tests.iter().find(|t| t.name == "nis").unwrap();
        assert_eq!(nis.pass(), test != "nis");
    }
}

/// 500 logs of the right design (25 min at 1 Hz) at alpha = 0.05: at most 0.05 are called inconsistent. Bound 0.05 +
/// 4.9 standard deviations (1e-6 at the worst case); nearly all others must be consistent, since the logs are long
/// enough.
#[test]
fn right_designs_are_rarely_rejected() {
    let right = skydog(1.0, 1.0, 1.0, 1.0);
    let options = Options { alpha: 0.05, ..Options::default() };
    let mut counts = [0u32; 3];
    for run in 0..500 {
        let verdict = replay(&right, &draw(&right, 100 + run, 1500), options).verdict;
        counts[match verdict {
            Verdict::Consistent => 0,
            Verdict::Inconsistent => 1,
            Verdict::Inconclusive => 2,
        }] += 1;
    }
    assert!(f64::from(counts[1]) <= 500.0 * 0.05 + 4.9 * (500.0 * 0.05 * 0.95_f64).sqrt(), "{counts:?}");
    assert!(counts[1] > 0, "a gate that never fires is broken: P < 1e-5 at a rate of 0.025, {counts:?}");
    assert!(counts[0] >= 440, "{counts:?}");
}

/// The same with a gap: 500 logs of 3000 samples at 10 Hz of which 100 are missing; bound 0.05 + 4.9 standard
/// deviations (1e-6).
#[test]
fn gaps_reject_no_right_design() {
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    let mut missing = vec![0; 2900];
    missing[1199] = 100;
    let rejected = |run: u64| {
        let mut z = draw(&right, 1000 + run, 3000);
        z.drain(1199..1299);
        let mut replayer =
            Replayer::new(&right, &shape(&["x"], 10.0), Options { alpha: 0.05, ..Options::default() }).unwrap();
        replayer.push(&block(&z, &missing, 0.1, 0..2900), None);
        replayer.finish().verdict == Verdict::Inconsistent
    };
    let rejected = (0..500).filter(|run| rejected(*run)).count() as f64;
    assert!(rejected <= 500.0 * 0.05 + 4.9 * (500.0 * 0.05 * 0.95_f64).sqrt(), "{rejected}");
}

/// The start statistic is N(0, 1): 3000 logs of 60 samples, level 0.05; bound 4.9 standard deviations (1e-6).
#[test]
fn start_test_has_its_size() {
    let right = skydog(1.0, 1.0, 1.0, 1.0);
    let options = Options { alpha: 0.05, ..Options::default() };
    let (mut rejected, mut spread) = (0u32, 0.0);
    for run in 0..3000 {
        let result = replay(&right, &draw(&right, 10_000 + run, 60), options);
        let start = result.axes[0].start.unwrap();
        rejected += u32::from(start.p_value < 0.05);
        spread += start.sigmas.powi(2) / 3000.0;
    }
    let size = f64::from(rejected) / 3000.0;
    assert!((size - 0.05).abs() < 4.9 * (0.05 * 0.95 / 3000.0_f64).sqrt(), "{size}");
    // P0 is 0.5 deg/s and the bias is soon known to 1 %: the distance in P0 sigmas is itself standard normal
    assert!((spread - 1.0).abs() < 4.9 * (2.0 / 3000.0_f64).sqrt() + 0.02, "{spread}");
}

/// A log that starts 8 sigma from x0 is told in words and in sigmas.
#[test]
fn bias_outside_p0_is_named() {
    let right = skydog(1.0, 1.0, 1.0, 1.0);
    let mut log = draw(&right, 2, 1500);
    let first = replay(&right, &log, Options::default()).axes[0].start.unwrap().sigmas;
    log.iter_mut().for_each(|z| *z += 8.0 * 0.5 * DEG);
    let result = replay(&right, &log, Options::default());
    assert_eq!(result.verdict, Verdict::Inconsistent);
    let start = result.tests.iter().find(|t| t.name == "start").unwrap();
    assert!(!start.pass() && start.meaning.contains("outside what P0 allows"));
    // the shift was 8 sigma of the bias alone; P0 of what is measured has the drift too, 0.16 % more
    assert_relative_eq!(result.axes[0].start.unwrap().sigmas - first, 8.0, max_relative = 0.01);
}

/// Behind a gate of 2 sigma the NIS of accepted innovations is 0.774 (formulas: 1 − 2gφ(g)/p) and the verdict stays
/// right: 200 logs of the right design at alpha = 0.01; more than 12 inconsistent have P < 1e-6.
#[test]
fn gated_statistics_have_truncated_moments() {
    let right = skydog(1.0, 1.0, 1.0, 1.0);
    let options = Options { alpha: 0.01, gate: Some(2.0), ..Options::default() };
    let (mut bad, mut nis, mut rejected) = (0, 0.0, 0);
    for run in 0..200 {
        let mut log = draw(&right, 20_000 + run, 1500);
        // the bias starts at x0: a gate that tight would shut out a log that starts far off
        let model = &right.axes[0].model;
        let mut normals = vec![0.0; 3001];
        fill_normal(&mut stream(31, StreamId { run: 20_000 + run, axis: 0, term: 0 }), &mut normals);
        log.iter_mut().for_each(|z| *z -= normals[3000] * model.p0[(0, 0)].sqrt() * 0.5);
        let result = replay(&right, &log, options);
        bad += u32::from(result.verdict == Verdict::Inconsistent);
        nis += result.axes[0].nis.unwrap().mean / 200.0;
        rejected += result.axes[0].rejected;
    }
    assert!(bad <= 12, "{bad}");
    assert!((nis - 0.77374).abs() < 0.01, "{nis}");
    assert!((rejected as f64 / 300_000.0 - 0.0455).abs() < 0.003, "{rejected}");
}

/// Results do not depend on how the log is cut into blocks, to the last bit.
#[test]
fn block_size_changes_nothing() {
    let right = skydog(1.0, 1.0, 1.0, 1.0);
    let mut log = draw(&right, 3, 3000);
    log[100] = f64::NAN;
    let mut missing = vec![0; 3000];
    missing[2000] = 77;
    let run = |size: usize| {
        let mut replayer = Replayer::new(&right, &shape(&["x"], 1.0), Options::default()).unwrap();
        for start in (0..3000).step_by(size) {
            replayer.push(&block(&log, &missing, 1.0, start..(start + size).min(3000)), None);
        }
        serde_json::to_string(&replayer.finish()).unwrap()
    };
    let whole = run(3000);
    assert_eq!(run(1), whole);
    assert_eq!(run(999), whole);
}

#[test]
fn short_or_empty_logs_are_inconclusive() {
    let right = skydog(0.01, 1.0, 1.0, 1.0);
    for log in [vec![], vec![0.001], vec![f64::NAN; 5000], draw(&right, 4, 6000)] {
        let result = replay(&right, &log, Options::default());
        assert_eq!(result.verdict, Verdict::Inconclusive, "{} samples", log.len());
        assert!(result.meaning.contains("x: "), "{}", result.meaning);
        assert!(!serde_json::to_string(&result).unwrap().contains("NaN"));
    }
    let minute = replay(&right, &draw(&right, 4, 6000), Options::default());
    // thirty times 1/K = 2183.507 samples (formulas: K = 4.579788053e-4)
    assert!(minute.meaning.contains("655.1 s"), "{}", minute.meaning);
    // a minute is enough to see a wrong white noise, though not the drift
    let loud = replay(&skydog(0.01, 1.5, 1.0, 1.0), &draw(&right, 4, 6000), Options::default());
    assert_eq!(loud.verdict, Verdict::Inconsistent);
}

#[test]
fn axes_are_matched_by_name_letter_or_order() {
    let one = |name: &str| skydog(1.0, 1.0, 1.0, 1.0).axes.remove(0).renamed(name);
    let three = design(vec![one("x"), one("y"), one("z")]);
    let matched =
        |names: &[&str]| Replayer::new(&three, &shape(names, 1.0), Options::default()).map(|r| r.log_axes().join(" "));
    assert_eq!(matched(&["z", "Y", "x"]).unwrap(), "x Y z");
    assert_eq!(matched(&["gyro_x", "gyro_y", "gyro_z"]).unwrap(), "gyro_x gyro_y gyro_z");
    assert_eq!(matched(&["gyr_z_dps", "gyr_y_dps", "gyr_x_dps", "temp"]).unwrap(), "gyr_x_dps gyr_y_dps gyr_z_dps");
    assert_eq!(matched(&["GyroX", "GyroY", "GyroZ"]).unwrap(), "GyroX GyroY GyroZ");
    assert_eq!(matched(&["box_z", "box_y", "box_x"]).unwrap(), "box_x box_y box_z");
    assert_eq!(matched(&["1", "2", "3"]).unwrap(), "1 2 3");
    for unclear in [&["x", "y"][..], &["a", "b", "c", "d"], &["z", "a", "b"]] {
        let error = matched(unclear).unwrap_err();
        assert!(matches!(&error, ReplayError::Axes { .. }), "{unclear:?}");
        assert!(error.to_string().contains(&unclear.join(", ")) && error.to_string().contains("`columns`"));
    }
    let single = design(vec![one("skydog")]);
    assert!(Replayer::new(&single, &shape(&["wx"], 1.0), Options::default()).is_ok());
    assert!(Replayer::new(&single, &shape(&["wx", "wy"], 1.0), Options::default()).is_err());
}

trait Renamed {
    fn renamed(self, name: &str) -> Self;
}

impl Renamed for AxisDesign {
    fn renamed(mut self, name: &str) -> Self {
        self.name = name.into();
        self
    }
}

#[test]
fn wrong_logs_and_options_are_refused() {
    let right = skydog(0.01, 1.0, 1.0, 1.0);
    let refuse = |log: &LogShape, options: Options| Replayer::new(&right, log, options).unwrap_err().to_string();
    let fits = shape(&["x"], 100.0);
    assert!(refuse(&shape(&["x"], 101.0), Options::default()).contains("101 Hz but the filter is for 100 Hz"));
    assert!(refuse(&shape(&["x"], f64::NAN), Options::default()).contains("Hz"));
    assert!(Replayer::new(&right, &shape(&["x"], 100.4), Options::default()).is_ok());
    let force = LogShape { quantity: Quantity::SpecificForce, ..fits.clone() };
    assert!(refuse(&force, Options::default()).contains("the log is in m/s^2 but the filter is for rad/s"));
    for alpha in [0.0, 1.0, f64::NAN] {
        assert!(refuse(&fits, Options { alpha, ..Options::default() }).starts_with("alpha is"));
    }
    for gate in [0.5, -3.0, f64::NAN, f64::INFINITY] {
        assert!(refuse(&fits, Options { gate: Some(gate), ..Options::default() }).starts_with("gate is"));
    }
}
