//! Allan family: published values, an independent implementation, identities, exact degrees of freedom, Monte Carlo.
//!
//! Oracle literals: allantools 2024.06 (`adev … totdev(x, rate=1/dt, data_type="freq", taus=…)`) unless said.

mod command;
mod covariance;
mod definition;
mod degrees_of_freedom;
mod identification;
mod quadratic_form;
mod recovery;
mod wavelet;
mod windows;

use kfdesign::allan::{self, AllanError, Deviation, NoiseType, TauGrid, deviation, edf, noise_id, tau};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::distribution::chi_square_quantile;
use kfdesign::numerics::exact_sum::ExactSum;
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use nalgebra::{DMatrix, DVector};

const ALL: [Deviation; 6] =
    [Deviation::Adev, Deviation::Oadev, Deviation::Mdev, Deviation::Hdev, Deviation::Ohdev, Deviation::Totdev];

/// Uniform numbers of NIST SP 1065 section 12.4: n_{i+1} = 16807 n_i mod 2147483647, divided by the modulus.
fn congruential(first: u64, count: usize) -> Vec<f64> {
    std::iter::successors(Some(first), |n| Some(16807 * n % 2_147_483_647))
        .take(count)
        .map(|n| n as f64 / 2_147_483_647.0)
        .collect()
}

fn nist() -> Vec<f64> {
    congruential(1_234_567_890, 1000)
}

/// A random walk of 2000 steps from the same generator, dt = 0.01 s.
fn walk() -> Vec<f64> {
    congruential(16807, 2000)
        .iter()
        .scan(0.0, |sum, u| {
            *sum += u - 0.5;
            Some(*sum)
        })
        .collect()
}

fn deviation_of(kind: Deviation, rate: &[f64], dt: f64, m: u64) -> f64 {
    deviation::variance(kind, &deviation::phase(rate, dt), dt, m).unwrap().variance.sqrt()
}

fn gauss_markov(std_dev: f64, correlation_time: f64) -> Term {
    Term::GaussMarkov { std_dev, correlation_time }
}

fn model(terms: &[Term]) -> NoiseModel {
    NoiseModel { terms: terms.to_vec() }
}

/// One path of a mixture.
fn path(model: &NoiseModel, dt: f64, n: usize, seed: u64, run: u64) -> Vec<f64> {
    let mut sum = vec![0.0; n];
    let mut part = vec![0.0; n];
    for (term, number) in model.terms.iter().zip(0..) {
        term.sample_path(dt, stream(seed, StreamId { run, axis: 0, term: number })).fill(&mut part);
        for (s, p) in sum.iter_mut().zip(&part) {
            *s += p;
        }
    }
    sum
}

mod published {
    use super::*;

    /// Table 31 of NIST SP 1065, m = 1, 10, 100: every printed digit. HDEV without overlap is from Riley's "The
    /// calculation of time domain frequency stability", table III, whose last value is cut, not rounded (3.910860e-2
    /// for 0.0391086056).
    #[test]
    fn nist_1000_points() {
        let table: [(Deviation, [&str; 3]); 6] = [
            (Deviation::Adev, ["2.922319e-1", "9.965736e-2", "3.897804e-2"]),
            (Deviation::Oadev, ["2.922319e-1", "9.159953e-2", "3.241343e-2"]),
            (Deviation::Mdev, ["2.922319e-1", "6.172376e-2", "2.170921e-2"]),
            (Deviation::Hdev, ["2.943883e-1", "1.052754e-1", "3.910861e-2"]),
            (Deviation::Ohdev, ["2.943883e-1", "9.581083e-2", "3.237638e-2"]),
            (Deviation::Totdev, ["2.922319e-1", "9.134743e-2", "3.406530e-2"]),
        ];
        let rate = nist();
        for (kind, values) in table {
            for (m, printed) in [1, 10, 100].into_iter().zip(values) {
                assert_eq!(format!("{:.6e}", deviation_of(kind, &rate, 1.0, m)), printed, "{kind:?} m = {m}");
            }
        }
    }

    /// Table 32 (overlapping ADEV, m = 10): 981 terms, white, and 146.177 degrees of freedom by the classical
    /// formula, which the exact value must meet within 1 % (formulas.md: 0.03 % at n = 2000).
    #[test]
    fn nist_1000_points_confidence() {
        let curve = allan::curve(&nist(), 1.0, Deviation::Oadev, TauGrid::Decade).unwrap();
        let point = curve.points.iter().find(|p| p.m == 10).unwrap();
        assert_eq!((point.terms, point.noise), (981, NoiseType::White));
        assert!((point.edf / 146.177 - 1.0).abs() < 0.01, "edf {}", point.edf);
        // scipy 1.17.1 stats.chi2.ppf at edf 146.177 for sigma = 9.159953e-2
        let (lower, upper) = edf::interval(9.159953e-2, 146.177);
        assert!((lower / 0.08219489023203268 - 1.0).abs() < 1e-9, "{lower}");
        assert!((upper / 0.1034535575852491 - 1.0).abs() < 1e-9, "{upper}");
    }
}

mod independent {
    use super::*;

    #[test]
    fn nist_set_at_other_factors() {
        let factors = [2, 3, 7, 31, 200];
        #[rustfmt::skip]
        let table: [(Deviation, [f64; 5]); 6] = [
            (Deviation::Adev, [0.2051016155948553, 0.1727562940218499, 0.10805509695719333, 0.04169519122666076, 0.01212320252916578]),
            (Deviation::Oadev, [0.20101604217093852, 0.16444561335420452, 0.1138862025396716, 0.048410502393461535, 0.01644828634524077]),
            (Deviation::Mdev, [0.1582071982972619, 0.12323418843105285, 0.08105902304284336, 0.0347066104728761, 0.006991533708371131]),
            (Deviation::Hdev, [0.20715738326997735, 0.17114231259449422, 0.11002904686324734, 0.03873455429935862, 0.01305418771522982]),
            (Deviation::Ohdev, [0.20124832957273123, 0.16240117756993863, 0.11671221802152874, 0.04538539233656709, 0.016473012924548933]),
            (Deviation::Totdev, [0.2008850881398229, 0.16414574045620478, 0.11350888502498475, 0.04900116907618151, 0.020875990359477996]),
        ];
        agree(&nist(), 1.0, &factors, &table.map(|(kind, v)| (kind, v.to_vec())));
    }

    #[test]
    fn random_walk_set() {
        let factors = [1, 2, 5, 16, 50, 150, 300, 600];
        #[rustfmt::skip]
        let table = [
            (Deviation::Adev, vec![0.20127404920622316, 0.24862564839503395, 0.37085992508143345, 0.650427260308319, 1.177428006595224, 1.7930149000414348, 1.5517599786174294, 2.2402550765703086]),
            (Deviation::Oadev, vec![0.20127404920622316, 0.2493069504891346, 0.36776831006230637, 0.6579033246744617, 1.1865812491852246, 1.782284096375961, 1.9891373379456476, 1.4134483805807416]),
            (Deviation::Mdev, vec![0.20127404920626854, 0.22691180632990635, 0.332018249625306, 0.6064315252196915, 1.0714180200218026, 1.397655707530796, 1.4839421992120776, 0.6343955146063739]),
            (Deviation::Hdev, vec![0.1622248077271951, 0.18782404035708278, 0.2720884952389958, 0.43606558936068746, 0.9100470558879099, 1.1308970465440589, 1.39076080080591]),
            (Deviation::Ohdev, vec![0.1622248077271951, 0.1887277586917119, 0.2677728418555855, 0.44712256514401255, 0.9091424504944439, 1.241191775573285, 1.4523329821125237, 1.8920334286129135]),
            (Deviation::Totdev, vec![0.20127404920622308, 0.24939793960713164, 0.36783271360022274, 0.655082607528811, 1.1626666592106036, 1.7576906453756813, 2.3155015326816155, 2.2689743464914454]),
        ];
        agree(&walk(), 0.01, &factors, &table);
    }

    fn agree(rate: &[f64], dt: f64, factors: &[u64], table: &[(Deviation, Vec<f64>)]) {
        for (kind, values) in table {
            for (m, expected) in factors.iter().zip(values) {
                let ours = deviation_of(*kind, rate, dt, *m);
                assert!((ours / expected - 1.0).abs() < 1e-10, "{kind:?} m = {m}: {ours} and {expected}");
            }
        }
    }
}

mod identities {
    use super::*;

    /// A ramp of slope R has the Allan variance R² τ²/2 at every τ, all members that take second differences alike;
    /// third differences do not see it.
    #[test]
    fn ramp_is_exact() {
        let (slope, dt) = (2e-4, 0.1);
        let rate: Vec<f64> = (0..5000).map(|k| 7.0 + slope * dt * f64::from(k)).collect();
        for m in [1, 2, 10, 333, 1600] {
            let exact = 0.5 * (slope * m as f64 * dt).powi(2);
            for kind in [Deviation::Adev, Deviation::Oadev, Deviation::Mdev] {
                let got = deviation_of(kind, &rate, dt, m).powi(2);
                assert!((got / exact - 1.0).abs() < 1e-9, "{kind:?} m = {m}: {got} and {exact}");
            }
            let seen = deviation_of(Deviation::Ohdev, &rate, dt, m);
            assert!(seen < 1e-6 * exact.sqrt(), "m = {m}: {seen}");
        }
    }

    /// A sinusoid: Ω0² (sin²(π f0 τ)/(π f0 τ))² when every sample is an average (formulas, section 1).
    #[test]
    fn sinusoid_follows_its_lobes() {
        let (amplitude, frequency, dt) = (0.02, 0.37, 0.01);
        let w = std::f64::consts::TAU * frequency;
        let angle = |k: u32| -amplitude / w * (w * dt * f64::from(k)).cos();
        let phase: Vec<f64> = (0..=200_000).map(angle).collect();
        for (m, expected) in [(50, 1.07592e-4), (135, 1.62438e-4), (500, 5.0304e-7)] {
            let got = deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap().variance;
            assert!((got / expected - 1.0).abs() < 3e-4, "m = {m}: {got} and {expected}");
        }
    }

    /// Rate, increments and angle of the same data are the same curve.
    #[test]
    fn rate_and_angle_agree() {
        let (rate, dt) = (nist(), 0.01);
        let mut angle = vec![0.0];
        for y in &rate {
            angle.push(angle[angle.len() - 1] + y * dt);
        }
        for kind in ALL {
            let from_rate = allan::curve(&rate, dt, kind, TauGrid::Octave).unwrap();
            let from_angle = allan::curve_from_phase(&angle, dt, kind, TauGrid::Octave).unwrap();
            assert_eq!(from_rate.samples, from_angle.samples);
            for (a, b) in from_rate.points.iter().zip(&from_angle.points) {
                assert_eq!((a.m, a.terms, a.noise), (b.m, b.terms, b.noise));
                assert!((a.deviation / b.deviation - 1.0).abs() < 1e-12, "{kind:?} m = {}", a.m);
            }
        }
    }

    /// A large constant bias changes nothing (it would cost digits if the phase were summed with it).
    #[test]
    fn bias_costs_no_digits() {
        let clean: Vec<f64> = nist().iter().map(|y| (y * 1024.0).round() / 1024.0).collect();
        let biased: Vec<f64> = clean.iter().map(|y| y + 1e6).collect();
        for kind in ALL {
            for m in [1, 10, 100] {
                let (a, b) = (deviation_of(kind, &clean, 0.01, m), deviation_of(kind, &biased, 0.01, m));
                assert!((a / b - 1.0).abs() < 1e-9, "{kind:?} m = {m}");
            }
        }
    }

    #[test]
    fn grids_are_ascending_and_distinct() {
        assert_eq!(tau::averaging_factors(TauGrid::Octave, 20), [1, 2, 4, 8, 16]);
        assert_eq!(tau::averaging_factors(TauGrid::Decade, 400), [1, 2, 4, 10, 20, 40, 100, 200, 400]);
        assert_eq!(tau::averaging_factors(TauGrid::All, 4), [1, 2, 3, 4]);
        let log = tau::averaging_factors(TauGrid::Log(20), 1_000_000);
        assert!(log.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(log.iter().filter(|m| (10_000..100_000).contains(*m)).count(), 20);
        assert_eq!((log[0], log[log.len() - 1]), (1, 1_000_000));
        for grid in [TauGrid::Octave, TauGrid::Decade, TauGrid::All, TauGrid::Log(0)] {
            assert_eq!(tau::averaging_factors(grid, 0), [0_u64; 0], "{grid:?}");
        }
        assert_eq!(tau::averaging_factors(TauGrid::Octave, u64::MAX).len(), 63);
        assert_eq!(tau::averaging_factors(TauGrid::Decade, u64::MAX).len(), 57);
        assert_eq!(tau::averaging_factors(TauGrid::Log(2), 10_u64.pow(18)).len(), 37);
    }

    /// Every member from its shortest possible log on, and the message below it.
    #[test]
    fn shortest_logs() {
        for kind in ALL {
            let needed = deviation::fewest_samples(kind, 1) as usize;
            for n in needed..20 {
                let rate: Vec<f64> = nist()[..n].to_vec();
                let curve = allan::curve(&rate, 1.0, kind, TauGrid::All).unwrap();
                let last = curve.points.last().unwrap();
                assert_eq!(last.m, deviation::largest_factor(kind, n), "{kind:?} n = {n}");
                assert!(last.terms >= 1 && deviation::terms(kind, n, last.m + 1) == 0);
                assert!(curve.points.iter().all(|p| p.deviation.is_finite() && p.upper >= p.deviation), "{kind:?} {n}");
                assert!(deviation::fewest_samples(kind, last.m) <= n as u64);
                assert!(deviation::fewest_samples(kind, last.m + 1) > n as u64);
            }
            let short = allan::curve(&vec![1.0; needed - 1], 1.0, kind, TauGrid::All).unwrap_err();
            assert_eq!(short, AllanError::TooShort { samples: needed - 1, needed });
        }
        let broken = allan::curve(&[1.0, 2.0, f64::NAN, 4.0], 1.0, Deviation::Oadev, TauGrid::All).unwrap_err();
        assert_eq!(broken, AllanError::NotFinite { index: 2 });
    }
}
