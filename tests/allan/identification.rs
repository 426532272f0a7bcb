//! Power-law type by the lag-1 autocorrelation.

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

/// White with a ramp of random numbers of our own stream: longest taus take the type last seen for their degrees of
/// freedom.
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
