//! Allan family: published values, an independent implementation, identities, exact degrees of freedom, Monte Carlo.
//!
//! Oracle literals: allantools 2024.06 (`adev … totdev(x, rate=1/dt, data_type="freq", taus=…)`) unless said.

use kfdesign::allan::{self, AllanError, Deviation, NoiseType, TauGrid, deviation, edf, noise_id, tau};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::distribution::chi_square_quantile;
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

    /// Table 31 of NIST SP 1065, m = 1, 10, 100: every printed digit. HDEV without overlap is from Riley's "The calculation
    /// of time domain frequency stability", table III, whose last value is cut, not rounded (3.910860e-2 for 0.0391086056).
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

    /// Table 32 (overlapping ADEV, m = 10): 981 terms, white, and 146.177 degrees of freedom by the classical formula, which
    /// the exact value must meet within 1 % (formulas.md: 0.03 % at n = 2000).
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
        assert!(tau::averaging_factors(TauGrid::Decade, u64::MAX).len() >= 57);
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

mod degrees_of_freedom {
    use super::*;

    fn oadev(n: usize, m: u64, dt: f64, terms: &[Term]) -> f64 {
        edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &model(terms))
    }

    /// The "exact" column of formulas.md section 3 (n = 2000), to its printed digits.
    #[test]
    fn table() {
        let white = [Term::White { density: 1.0 }];
        let walk = [Term::RateRandomWalk { density: 1.0 }];
        let correlated = [gauss_markov(1.0, 100.0)];
        let rows: [(&[Term], u64, f64, f64); 20] = [
            (&white, 1, 1332.89, 0.005),
            (&white, 2, 1141.63, 0.005),
            (&white, 3, 876.46, 0.005),
            (&white, 5, 569.55, 0.005),
            (&white, 10, 294.22, 0.005),
            (&white, 20, 147.37, 0.005),
            (&white, 50, 57.76, 0.005),
            (&white, 100, 27.78, 0.005),
            (&white, 500, 4.00, 0.005),
            (&walk, 1, 1999.0, 0.05),
            (&walk, 2, 1027.29, 0.005),
            (&walk, 3, 650.88, 0.005),
            (&walk, 5, 377.23, 0.005),
            (&walk, 10, 184.96, 0.005),
            (&walk, 100, 17.02, 0.005),
            (&walk, 500, 2.24, 0.005),
            (&correlated, 1, 1994.1, 0.05),
            (&correlated, 10, 186.4, 0.05),
            (&correlated, 100, 18.28, 0.005),
            (&correlated, 500, 3.06, 0.005),
        ];
        for (terms, m, expected, digit) in rows {
            let got = oadev(2000, m, 1.0, terms);
            assert!((got - expected).abs() <= digit, "{terms:?} m = {m}: {got} and {expected}");
        }
        assert!((oadev(2000, 900, 1.0, &correlated) - 1.10).abs() <= 0.005);
    }

    /// The reference sensor at tau = 367 s: 8.7, 18.9, 100.3 degrees of freedom from 1, 2, 10 h, and the interval factors.
    #[test]
    fn reference_sensor() {
        let terms = [Term::White { density: 0.0562 }, gauss_markov(0.028_059_6, 193.9312)];
        for (hours, expected, low, high) in [(1, 8.7, 0.685, 1.849), (2, 18.9, 0.760, 1.463), (10, 100.3, 0.879, 1.160)]
        {
            let got = oadev(hours * 360_000, 36_700, 0.01, &terms);
            assert!((got - expected).abs() <= 0.05, "{hours} h: {got}");
            let (lower, upper) = edf::interval(1.0, got);
            assert!((lower - low).abs() <= 6e-4 && (upper - high).abs() <= 2e-3, "{hours} h: {lower} {upper}");
        }
    }

    #[test]
    fn interval_factors() {
        for (dof, low, high) in
            [(3.0, 0.566_490, 3.728_547), (10.0, 0.698_717, 1.754_934), (100.0, 0.878_542, 1.160_737)]
        {
            let (lower, upper) = edf::interval(1.0, dof);
            assert!((lower - low).abs() < 5e-7 && (upper - high).abs() < 5e-7, "{dof}: {lower} {upper}");
        }
        assert_eq!(edf::interval(2.0, f64::INFINITY), (2.0, 2.0));
    }

    /// The coarse grid of lags against every lag, for every kind of term alone and for a mixture.
    #[test]
    fn few_lags_equal_all_lags() {
        let mixture = [
            Term::Quantization { coefficient: 1e-4 },
            Term::White { density: 0.05 },
            Term::BiasInstability { coefficient: 0.01 },
            gauss_markov(0.03, 40.0),
            gauss_markov(0.01, 0.05),
            Term::RateRandomWalk { density: 1e-4 },
        ];
        let mut models: Vec<Vec<Term>> = mixture.iter().map(|t| vec![*t]).collect();
        models.push(mixture.to_vec());
        let (n, dt) = (60_000, 0.01);
        for terms in &models {
            for m in [1, 7, 300, 9000, 25_000] {
                let count = (n + 1 - 2 * m) as f64;
                let r = |h: u64| -> f64 { terms.iter().map(|t| t.second_difference_autocovariance(m, h, dt)).sum() };
                let r0 = r(0);
                let tail: f64 = (1..n + 1 - 2 * m).map(|h| (count - h as f64) * (r(h) / r0).powi(2)).sum();
                let full = count * count / (count + 2.0 * tail);
                let fast = oadev(n as usize, m, dt, terms);
                assert!((fast / full - 1.0).abs() < 1e-6, "{terms:?} m = {m}: {fast} and {full}");
            }
        }
    }

    /// The quadratic form itself, from the covariance matrix of the samples, for all exact members and with a ramp.
    #[test]
    fn quadratic_forms() {
        let n = 48;
        let mixture = model(&[
            Term::White { density: 0.7 },
            gauss_markov(1.3, 9.0),
            Term::RateRandomWalk { density: 0.2 },
            Term::Quantization { coefficient: 0.5 },
            Term::RateRamp { slope: 0.05 },
        ]);
        let (covariance, mean) = brute::samples(&mixture, n, 1.0);
        for kind in [Deviation::Adev, Deviation::Oadev, Deviation::Mdev, Deviation::Hdev, Deviation::Ohdev] {
            for m in [1, 3, 8] {
                let a = brute::form(kind, n, m);
                let product = &a * &covariance;
                let expectation = product.trace() + (mean.transpose() * &a * &mean)[0];
                let variance =
                    2.0 * (&product * &product).trace() + 4.0 * (mean.transpose() * &a * &covariance * &a * &mean)[0];
                let full = 2.0 * expectation * expectation / variance;
                let got = edf::degrees_of_freedom(kind, n, m as u64, 1.0, &mixture);
                assert!((got / full - 1.0).abs() < 1e-7, "{kind:?} m = {m}: {got} and {full}");
                let mean = edf::expected_variance(kind, m as u64, 1.0, &mixture);
                assert!((mean / expectation - 1.0).abs() < 1e-9, "{kind:?} m = {m}: {mean} and {expectation}");
            }
        }
    }

    /// allantools 2024.06 `edf_greenhall(alpha, 2, m, N=1001, overlapping=True, modified=True)` where it sums every lag.
    #[test]
    fn modified_as_greenhall_and_riley() {
        let table = [
            (NoiseType::Quantization, [466.20944622855797, 123.94023271983103, 39.86318374180643, 1.0411412434879985]),
            (NoiseType::White, [478.9961522792087, 94.6342584913727, 29.998982005983045, 1.0012979691522201]),
            (NoiseType::Flicker, [475.6545831191038, 93.27298363859968, 29.513568551627593, 1.0007892541734547]),
            (NoiseType::RandomWalk, [382.70053866207803, 74.95713116875199, 23.664507401675202, 1.0003978789754175]),
        ];
        for (noise, values) in table {
            for (m, expected) in [2, 10, 30, 330].into_iter().zip(values) {
                let got = edf::power_law_degrees_of_freedom(Deviation::Mdev, 1000, m, noise);
                assert!((got / expected - 1.0).abs() < 1e-6, "{noise:?} m = {m}: {got} and {expected}");
            }
        }
        // its short cut for many lags, good to a per cent (m = 1000 and 20 000 of N = 100 001)
        for (noise, many, few) in [
            (NoiseType::White, 94.47549870092259, 2.7387182965356196),
            (NoiseType::Flicker, 93.04793195876876, 2.5411858794446906),
            (NoiseType::RandomWalk, 74.81924295431219, 1.9333381324589767),
        ] {
            for (m, expected) in [(1000, many), (20_000, few)] {
                let got = edf::power_law_degrees_of_freedom(Deviation::Mdev, 100_000, m, noise);
                assert!((got / expected - 1.0).abs() < 0.01, "{noise:?} m = {m}: {got} and {expected}");
            }
        }
    }

    /// NIST SP 1065 table 7 at large m; at m = 1 TOTDEV is the overlapping ADEV and has its degrees of freedom.
    #[test]
    fn total_as_published() {
        let total = |n, m, noise| edf::power_law_degrees_of_freedom(Deviation::Totdev, n, m, noise);
        let n = 100_000;
        for (noise, b, c) in
            [(NoiseType::White, 1.5, 0.0), (NoiseType::Flicker, 1.168, 0.222), (NoiseType::RandomWalk, 0.927, 0.358)]
        {
            let published = b * 50.0 - c;
            assert!((total(n, 2000, noise) / published - 1.0).abs() < 1e-12);
            let at_one = edf::power_law_degrees_of_freedom(Deviation::Oadev, n, 1, noise);
            assert!((total(n, 1, noise) / at_one - 1.0).abs() < 0.03, "{noise:?}");
        }
    }

    /// MDEV of a long log: the double coarse sum against every lag.
    #[test]
    fn modified_of_a_mixture_with_few_lags() {
        let (n, m, dt) = (12_000_i64, 900_i64, 0.01);
        let mixture = model(&[Term::White { density: 0.05 }, gauss_markov(0.03, 2.0)]);
        let second: Vec<f64> = (0..n)
            .map(|h| mixture.terms.iter().map(|t| t.second_difference_autocovariance(m as u64, h as u64, dt)).sum())
            .collect();
        let terms = n + 2 - 3 * m;
        let moving = |h: i64| -> f64 {
            (1 - m..m).map(|u| (m - u.abs()) as f64 * second[(h + u).unsigned_abs() as usize]).sum()
        };
        let r0 = moving(0);
        let tail: f64 = (1..terms).map(|h| (terms - h) as f64 * (moving(h) / r0).powi(2)).sum();
        let full = (terms as f64).powi(2) / (terms as f64 + 2.0 * tail);
        let fast = edf::degrees_of_freedom(Deviation::Mdev, n as usize, m as u64, dt, &mixture);
        assert!((fast / full - 1.0).abs() < 1e-4, "{fast} and {full}");
    }

    #[test]
    fn nothing_to_say_is_nan() {
        assert!(oadev(10, 6, 1.0, &[Term::White { density: 1.0 }]).is_nan());
        assert!(oadev(10, 1, 1.0, &[]).is_nan());
        assert_eq!(oadev(10, 1, 1.0, &[Term::RateRamp { slope: 1.0 }]), f64::INFINITY);
    }
}

/// The estimates as quadratic forms of the samples, by matrices: slow and plain.
mod brute {
    use super::*;

    /// Covariance and mean of n consecutive samples. The walk starts anywhere; quantisation is the difference of a white angle error.
    pub(super) fn samples(model: &NoiseModel, n: usize, dt: f64) -> (DMatrix<f64>, DVector<f64>) {
        let mut covariance = DMatrix::zeros(n, n);
        let mut mean = DVector::zeros(n);
        for term in &model.terms {
            for i in 0..n {
                for j in 0..n {
                    let lag = i.abs_diff(j);
                    covariance[(i, j)] += match *term {
                        Term::White { density } => f64::from(u8::from(lag == 0)) * density.powi(2) / dt,
                        Term::GaussMarkov { std_dev, correlation_time } => {
                            std_dev.powi(2) * (-(lag as f64) * dt / correlation_time).exp()
                        }
                        Term::RateRandomWalk { density } => density.powi(2) * dt * (i.min(j) as f64),
                        Term::Quantization { coefficient } => {
                            (coefficient / dt).powi(2) * [2.0, -1.0].get(lag).unwrap_or(&0.0)
                        }
                        Term::RateRamp { .. } => 0.0,
                        Term::BiasInstability { .. } => f64::NAN,
                    };
                }
                if let Term::RateRamp { slope } = term {
                    mean[i] += slope * dt * i as f64;
                }
            }
        }
        (covariance, mean)
    }

    /// The matrix A of σ̂² = yᵀ A y, from the definitions (dt = 1).
    pub(super) fn form(kind: Deviation, n: usize, m: usize) -> DMatrix<f64> {
        let (weights, step, norm): (&[f64], usize, f64) = match kind {
            Deviation::Adev => (&[-1.0, 1.0], m, 2.0),
            Deviation::Oadev | Deviation::Mdev => (&[-1.0, 1.0], 1, 2.0),
            Deviation::Hdev => (&[1.0, -2.0, 1.0], m, 6.0),
            Deviation::Ohdev => (&[1.0, -2.0, 1.0], 1, 6.0),
            Deviation::Totdev => panic!("no quadratic form here"),
        };
        let starts: Vec<usize> = (0..=n - weights.len() * m).step_by(step).collect();
        let mut difference = DMatrix::zeros(starts.len(), n);
        for (row, start) in starts.iter().enumerate() {
            for (block, weight) in weights.iter().enumerate() {
                for k in 0..m {
                    difference[(row, start + block * m + k)] = weight / m as f64;
                }
            }
        }
        if kind == Deviation::Mdev {
            let rows = starts.len() + 1 - m;
            difference = DMatrix::from_fn(rows, n, |j, k| difference.view((j, k), (m, 1)).sum() / m as f64);
        }
        difference.transpose() * &difference / (norm * difference.nrows() as f64)
    }
}

mod covariance {
    use super::*;

    #[test]
    fn equals_the_quadratic_forms() {
        let n = 60;
        let mixture = model(&[
            Term::White { density: 0.7 },
            gauss_markov(1.3, 9.0),
            Term::RateRandomWalk { density: 0.2 },
            Term::Quantization { coefficient: 0.5 },
            Term::RateRamp { slope: 0.05 },
        ]);
        let factors = [1, 2, 5, 12, 30];
        let got = edf::covariance(&factors, n, 1.0, &mixture);
        let (covariance, mean) = brute::samples(&mixture, n, 1.0);
        let forms = factors.map(|m| brute::form(Deviation::Oadev, n, m as usize));
        for i in 0..factors.len() {
            for j in 0..factors.len() {
                let (a, b) = (&forms[i], &forms[j]);
                let full = 2.0 * (a * &covariance * b * &covariance).trace()
                    + 4.0 * (mean.transpose() * a * &covariance * b * &mean)[0];
                assert!((got[(i, j)] / full - 1.0).abs() < 1e-7, "{i} {j}: {} and {full}", got[(i, j)]);
            }
        }
    }

    /// The diagonal is 2σ⁴/edf, also for a long log where both use few lags; the matrix is positive definite.
    #[test]
    fn diagonal_is_the_degrees_of_freedom() {
        let (n, dt) = (1_000_000, 0.01);
        let mixture = model(&[
            Term::White { density: 0.0562 },
            gauss_markov(0.02806, 193.93),
            Term::BiasInstability { coefficient: 1e-3 },
        ]);
        let factors = tau::averaging_factors(TauGrid::Log(4), 300_000);
        let matrix = edf::covariance(&factors, n, dt, &mixture);
        for (i, m) in factors.iter().enumerate() {
            let variance = mixture.allan_variance(*m, dt);
            let expected = 2.0 * variance.powi(2) / edf::degrees_of_freedom(Deviation::Oadev, n, *m, dt, &mixture);
            assert!((matrix[(i, i)] / expected - 1.0).abs() < 1e-4, "m = {m}: {} and {expected}", matrix[(i, i)]);
        }
        let scale = matrix.map_diagonal(|v| 1.0 / v.sqrt());
        let correlation = DMatrix::from_diagonal(&scale) * &matrix * DMatrix::from_diagonal(&scale);
        assert!(correlation.clone().symmetric_eigenvalues().min() > 0.0);
        assert!(edf::covariance(&[1, 9], 10, 1.0, &mixture)[(1, 0)].is_nan());
    }

    /// 2000 simulated logs: every entry within 6 standard errors (estimated from the products themselves), every mean within 5.
    /// False alarm below 1e-5: fifteen entries and five means, normal tails 2e-9 and 6e-7 each, widened for skewness.
    #[test]
    fn monte_carlo() {
        let (n, dt, runs) = (1000, 0.1, 2000);
        let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
        let factors = [1, 5, 25, 100, 300];
        let expected = edf::covariance(&factors, n, dt, &mixture);
        let estimates: Vec<[f64; 5]> = (0..runs)
            .map(|run| {
                let phase = deviation::phase(&path(&mixture, dt, n, 2, run), dt);
                factors.map(|m| deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap().variance)
            })
            .collect();
        let count = runs as f64;
        for i in 0..5 {
            let truth = mixture.allan_variance(factors[i], dt);
            let mean = estimates.iter().map(|e| e[i]).sum::<f64>() / count;
            let error = (expected[(i, i)] / count).sqrt();
            assert!((mean - truth).abs() < 5.0 * error, "mean at m = {}: {mean} and {truth}", factors[i]);
            for j in 0..=i {
                let truth_j = mixture.allan_variance(factors[j], dt);
                let products: Vec<f64> = estimates.iter().map(|e| (e[i] - truth) * (e[j] - truth_j)).collect();
                let mean = products.iter().sum::<f64>() / count;
                let spread = products.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let z = (mean - expected[(i, j)]) / (spread / count).sqrt();
                assert!(z.abs() < 6.0, "m = {} and {}: z = {z}", factors[i], factors[j]);
            }
        }
    }
}

mod recovery {
    use super::*;

    /// The measured curve of simulated data against the sampled forms (formulas, section 1): each ratio inside its
    /// two-sided chi-square interval with the exact degrees of freedom, 1e-6 outside; 17 points, so 2e-5 in all.
    #[test]
    fn curves_of_single_terms() {
        let (n, dt) = (200_000, 0.01);
        for (term, factors) in [
            (Term::White { density: 0.0562 }, vec![1, 10, 100, 1000]),
            (Term::Quantization { coefficient: 1e-3 / 12_f64.sqrt() }, vec![1, 3, 10, 1000]),
            (Term::RateRandomWalk { density: 0.0028 }, vec![1, 2, 50, 5000]),
            (gauss_markov(0.03, 19.4), vec![1, 10, 100, 1000, 3665]),
        ] {
            let mixture = model(&[term]);
            let phase = deviation::phase(&path(&mixture, dt, n, 1, 0), dt);
            for m in factors {
                let measured = deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap().variance;
                let ratio = measured / term.allan_variance(m, dt);
                let dof = edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &mixture);
                let (low, high) = (chi_square_quantile(5e-7, dof) / dof, chi_square_quantile(1.0 - 5e-7, dof) / dof);
                assert!((low..high).contains(&ratio), "{term:?} m = {m}: {ratio} outside {low} … {high}");
            }
        }
    }

    /// The 95 % interval of the refined curve holds the true deviation 95 % of the time: 2000 logs of white + Gauss-Markov at
    /// three taus. Allowed 92.4 … 97.6 %: 5 standard errors (0.49 % each) and 0.15 % for the chi-square shape; false alarm 2e-6.
    #[test]
    fn interval_coverage() {
        let (n, dt, runs) = (1000, 0.1, 2000);
        let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
        let factors = [4, 32, 128];
        let mut inside = [0; 3];
        let dofs = factors.map(|m| edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &mixture));
        for run in 0..runs {
            let phase = deviation::phase(&path(&mixture, dt, n, 3, run), dt);
            for (i, m) in factors.into_iter().enumerate() {
                let estimate = deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap();
                let (lower, upper) = edf::interval(estimate.variance.sqrt(), dofs[i]);
                inside[i] += u32::from((lower..upper).contains(&mixture.allan_variance(m, dt).sqrt()));
            }
        }
        for (m, count) in factors.iter().zip(inside) {
            let coverage = f64::from(count) / runs as f64;
            assert!((0.924..0.976).contains(&coverage), "m = {m}: {coverage}");
        }
    }

    /// MDEV and TOTDEV: the published degrees of freedom against the spread over 1500 logs, within 25 % (the spread itself
    /// has a standard error of at most 6 %, so 4 of them and the approximation's own error; false alarm 1e-5 in all).
    #[test]
    fn approximate_degrees_of_freedom() {
        let (n, runs) = (600, 1500);
        for (term, noise) in [
            (Term::White { density: 1.0 }, NoiseType::White),
            (Term::RateRandomWalk { density: 1.0 }, NoiseType::RandomWalk),
        ] {
            for kind in [Deviation::Mdev, Deviation::Totdev] {
                for m in [1, 4, 32] {
                    let values: Vec<f64> = (0..runs)
                        .map(|run| {
                            let phase = deviation::phase(&path(&model(&[term]), 1.0, n, 4, run), 1.0);
                            deviation::variance(kind, &phase, 1.0, m).unwrap().variance
                        })
                        .collect();
                    let count = runs as f64;
                    let mean = values.iter().sum::<f64>() / count;
                    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
                    let spread = 2.0 * mean * mean / variance;
                    let published = edf::power_law_degrees_of_freedom(kind, n, m, noise);
                    assert!(
                        (0.75..1.25).contains(&(published / spread)),
                        "{kind:?} {noise:?} m = {m}: {published} and {spread}"
                    );
                }
            }
        }
    }

    #[test]
    fn refine_replaces_power_laws() {
        let (n, dt) = (20_000, 0.1);
        let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
        let rate = path(&mixture, dt, n, 5, 0);
        for kind in ALL {
            let before = allan::curve(&rate, dt, kind, TauGrid::Octave).unwrap();
            let mut after = before.clone();
            after.refine(&mixture);
            for (a, b) in before.points.iter().zip(&after.points) {
                assert_eq!(a.deviation, b.deviation);
                assert_eq!(b.edf, edf::degrees_of_freedom(kind, n, b.m, dt, &mixture));
                assert_eq!((b.lower, b.upper), edf::interval(b.deviation, b.edf));
            }
            let mut same = before.clone();
            same.refine(&NoiseModel::default());
            assert_eq!(same.points, before.points);
        }
    }
}

mod identification {
    use super::*;

    /// Pure laws, 4000 averages: the lag-1 autocorrelation has a standard error of 1/√4000 = 0.016, so the exponent
    /// (slope below 4 of it) is off by half, which would round wrong, with probability below 1e-9.
    #[test]
    fn pure_laws() {
        for (term, exponent, expected) in [
            (Term::White { density: 1.0 }, 0.0, NoiseType::White),
            (Term::RateRandomWalk { density: 1.0 }, -2.0, NoiseType::RandomWalk),
            (Term::Quantization { coefficient: 1.0 }, 2.0, NoiseType::Quantization),
            (Term::BiasInstability { coefficient: 1.0 }, -1.0, NoiseType::Flicker),
        ] {
            for m in [1, 8] {
                let phase = deviation::phase(&path(&model(&[term]), 0.01, 4000 * m, 6, m as u64), 0.01);
                assert_eq!(noise_id::identify(&phase, m), expected, "{term:?} m = {m}");
                let found = noise_id::exponent(&phase, m).unwrap();
                assert!((found - exponent).abs() < 0.5, "{term:?} m = {m}: {found}");
            }
        }
    }

    #[test]
    fn ramp_and_few_and_constant() {
        let noise = nist();
        let ramp: Vec<f64> = noise.iter().zip(0..).map(|(y, k)| 0.1 * y + 0.01 * f64::from(k)).collect();
        let phase = deviation::phase(&ramp, 1.0);
        assert_eq!(noise_id::identify(&phase, 1), NoiseType::White);
        assert_eq!(noise_id::identify(&phase, 30), NoiseType::Ramp);
        assert_eq!(noise_id::identify(&deviation::phase(&noise, 1.0), 34), NoiseType::Unknown);
        assert_eq!(noise_id::identify(&deviation::phase(&[1.0; 100], 1.0), 1), NoiseType::Unknown);
        let constant = allan::curve(&[1.0; 100], 1.0, Deviation::Oadev, TauGrid::Octave).unwrap();
        assert!(constant.points.iter().all(|p| (p.lower, p.deviation, p.upper) == (0.0, 0.0, 0.0)));
    }

    /// White with a ramp of random numbers of our own stream: longest taus take the type last seen for their degrees of freedom.
    #[test]
    fn long_taus_keep_the_last_type() {
        let mut rate = vec![0.0; 4096];
        fill_normal(&mut stream(7, StreamId { run: 0, axis: 0, term: 0 }), &mut rate);
        let curve = allan::curve(&rate, 1.0, Deviation::Oadev, TauGrid::Octave).unwrap();
        let last = curve.points.last().unwrap();
        assert_eq!((last.m, last.noise), (2048, NoiseType::Unknown));
        let white = edf::power_law_degrees_of_freedom(Deviation::Oadev, 4096, 2048, NoiseType::White);
        assert_eq!(last.edf, white);
    }
}
