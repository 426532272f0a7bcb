//! Distributions, searches, random streams and sums against independent values.

mod optimize;

mod distribution {
    #![allow(clippy::excessive_precision, reason = "17 digits, as the oracle printed them")]

    use kfdesign::numerics::distribution::*;

    /// Relative difference, both tails of one value checked by the caller.
    fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
        let scale = expected.abs().max(f64::MIN_POSITIVE);
        assert!((found - expected).abs() <= tolerance * scale, "{what}: {found:e}, expected {expected:e}");
    }

    // mpmath 1.3: gammainc(dof/2, x/2, inf, regularized=True) at 50 digits; above 2e5 degrees of freedom quadrature
    // of the density.
    const CHI_SQUARE: [(f64, f64, f64, f64); 22] = [
        (0.000982, 1.0, 0.024999120533269977, 0.97500087946673002),
        (5.0239, 1.0, 0.97500019940840437, 0.024999800591595625),
        (60.0, 1.0, 0.99999999999999051, 9.4857375710738484e-15),
        (0.5, 2.0, 0.22119921692859513, 0.77880078307140487),
        (100.0, 2.0, 1.0, 1.9287498479639178e-22),
        (3.247, 10.0, 0.025000776910263972, 0.97499922308973603),
        (20.0, 10.5, 0.96335669609577024, 0.036643303904229756),
        (0.001, 0.3, 0.34270187767344203, 0.65729812232655797),
        (120.0, 100.0, 0.91559331890630817, 0.08440668109369183),
        (900.0, 1000.0, 0.010717238091289742, 0.98928276190871026),
        (1200.0, 1000.0, 0.99998774405766938, 1.2255942330622904e-5),
        (100000.0, 100000.0, 0.50059470810479331, 0.49940529189520669),
        (101000.0, 100000.0, 0.98713115962276633, 0.01286884037723367),
        (99000.0, 100000.0, 0.012478315638082799, 0.9875216843619172),
        (250000.0, 250000.5, 0.50009403144941919, 0.49990596855058081),
        (253000.0, 250000.5, 0.99998810717380651, 1.1892826193487535e-5),
        (246000.0, 250000.5, 6.4617297231528828e-9, 0.99999999353827028),
        (1001000.0, 1e6, 0.76032319517447864, 0.23967680482552136),
        (998000.0, 1e6, 0.078580291987144946, 0.92141970801285505),
        (100005000.0, 1e8, 0.63817865350158888, 0.36182134649841112),
        (99990000.0, 1e8, 0.23975738403750398, 0.76024261596249602),
        (1000000100000.0, 1e12, 0.52818617555415933, 0.47181382444584067),
    ];

    #[test]
    fn chi_square_tails() {
        for (x, dof, cdf, sf) in CHI_SQUARE {
            close(chi_square_cdf(x, dof), cdf, 1e-9, &format!("cdf({x}, {dof})"));
            close(chi_square_sf(x, dof), sf, 1e-9, &format!("sf({x}, {dof})"));
        }
    }

    /// SciPy 1.16 `t.ppf`.
    #[test]
    fn student_quantiles() {
        for (p, dof, t) in [
            (0.975, 1.0, 12.706204736174694),
            (0.975, 5.0, 2.5705818356363146),
            (0.975, 2.5, 3.5746548420036817),
            (0.9, 30.0, 1.3104150253913955),
        ] {
            close(student_quantile(p, dof), t, 1e-7, &format!("{p} of {dof}"));
        }
        assert!(student_quantile(1.1, 3.0).is_nan() && student_quantile(0.5, 0.0).is_nan());
    }

    #[test]
    fn chi_square_quantiles() {
        // mpmath 1.3: root of the regularised incomplete gamma function
        for (p, dof, x) in [
            (0.025, 1.0, 0.00098206911717525602),
            (0.975, 1.0, 5.023886187314889),
            (0.025, 2.0, 0.050635615968579751),
            (0.975, 2.0, 7.3777589082278726),
            (0.025, 10.0, 3.2469727802368411),
            (0.975, 35.0, 53.203348542056495),
            (0.025, 100.0, 74.221927474923726),
            (0.975, 1000.0, 1089.5309127749135),
            (0.999999, 50.0, 112.60809249896166),
            (1e-6, 50.0, 15.855062815648318),
            (0.025, 3.7, 0.39457687534151664),
            (0.995, 18.9, 38.440195637679401),
            (0.025, 1e6, 997230.0871432901),
            (0.975, 1e6, 1002773.701467926),
            (0.001, 1e8, 99956303.215245894),
            (0.9999, 1e8, 100052603.38977952),
        ] {
            close(chi_square_quantile(p, dof), x, 1e-9, &format!("quantile({p}, {dof})"));
        }
        // far tails of the expansion invert
        for dof in [250_000.0, 1e6, 1e9] {
            for p in [1e-9, 1e-6, 1e-3] {
                close(chi_square_cdf(chi_square_quantile(p, dof), dof), p, 1e-8, &format!("lower {p} of {dof}"));
                let x = chi_square_quantile(1.0 - p, dof);
                close(chi_square_sf(x, dof), 1.0 - (1.0 - p), 1e-8, &format!("upper {p} of {dof}"));
            }
        }
        // the two sides of the switch to the expansion agree
        for p in [1e-6, 0.025, 0.5, 0.975, 1.0 - 1e-6] {
            let ratio = chi_square_quantile(p, 200_001.0) - chi_square_quantile(p, 200_000.0);
            assert!((0.98..1.02).contains(&ratio), "step at the switch for p = {p}: {ratio}");
        }
    }

    #[test]
    fn normal_tails() {
        // mpmath 1.3: erfc(±x/√2)/2
        for (x, cdf, sf) in [
            (-37.0, 5.7255712225245768e-300, 1.0),
            (-8.0, 6.2209605742717841e-16, 0.99999999999999938),
            (-1.5, 0.066807201268858066, 0.93319279873114193),
            (-0.3, 0.38208857781104736, 0.61791142218895264),
            (0.0, 0.5, 0.5),
            (0.1, 0.53982783727702898, 0.46017216272297102),
            (0.4999, 0.69142725386121737, 0.30857274613878263),
            (0.6, 0.72574688224992642, 0.27425311775007358),
            (1.0, 0.84134474606854295, 0.15865525393145705),
            (3.0, 0.99865010196836991, 0.0013498980316300945),
            (6.0, 0.99999999901341235, 9.8658764503769814e-10),
            (10.0, 1.0, 7.6198530241605261e-24),
        ] {
            close(normal_cdf(x), cdf, 1e-12, &format!("cdf({x})"));
            close(normal_sf(x), sf, 1e-12, &format!("sf({x})"));
        }
    }

    #[test]
    fn normal_quantiles() {
        // mpmath 1.3: root of log(erfc(-x/√2)/2) − log p
        for (p, x) in [
            (1e-300, -37.047096299361199),
            (1e-12, -7.0344838253011319),
            (1e-5, -4.2648907939228246),
            (0.025, -1.9599639845400542),
            (0.3, -0.52440051270804082),
            (0.6, 0.25334710313579974),
            (0.975, 1.9599639845400539),
            (0.999999, 4.7534243088170878),
        ] {
            close(normal_quantile(p), x, 1e-9, &format!("quantile({p})"));
        }
        assert!(normal_quantile(0.5).abs() < 1e-15);
    }

    #[test]
    fn kolmogorov() {
        // mpmath 1.3: both series at 50 digits, which agree to 1e-50
        for (x, sf) in [
            (0.1, 1.0),
            (0.2, 0.99999999999949496),
            (0.3, 0.99999069419866543),
            (0.5, 0.96394524366487509),
            (0.8275735551899077, 0.49999999999999998),
            (1.0, 0.26999967167735452),
            (1.2238, 0.10002342783567782),
            (1.3581, 0.049999630431667436),
            (1.6276, 0.010001537333060768),
            (2.5, 7.4533063441573416e-6),
            (4.0, 2.5328331098188351e-14),
        ] {
            close(kolmogorov_sf(x), sf, 1e-12, &format!("kolmogorov({x})"));
        }
        assert!((kolmogorov_sf(1.0 - 1e-12) - kolmogorov_sf(1.0)).abs() < 1e-11);
    }

    #[test]
    fn nothing_panics() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 1e-300, 0.5, 1.0, 2.0, 1e300];
        for a in odd {
            for b in odd {
                for value in [chi_square_cdf(a, b), chi_square_sf(a, b)] {
                    assert!(value.is_nan() || (0.0..=1.0).contains(&value), "chi_square({a}, {b}) = {value}");
                }
                let _ = chi_square_quantile(a, b);
            }
            let _ = (normal_cdf(a), normal_quantile(a), kolmogorov_sf(a));
        }
        assert!(chi_square_cdf(1.0, -1.0).is_nan() && chi_square_quantile(1.5, 2.0).is_nan());
        assert!(normal_quantile(-0.1).is_nan());
        assert_eq!(chi_square_quantile(0.0, 3.0), 0.0);
        assert_eq!(chi_square_quantile(1.0, 3.0), f64::INFINITY);
    }
}

mod random {
    use kfdesign::numerics::random::{StreamId, fill_normal, normal, stream};
    use rand::Rng;

    const HOME: StreamId = StreamId { run: 0, axis: 0, term: 0 };

    #[test]
    fn first_words_never_change() {
        // A change detector for the address, plus one value from the cipher itself: ChaCha8 block 0 of the key
        // "kfdesign" | 1 | 0 | 0 | 0 (little-endian), computed by an independent implementation written from RFC 8439.
        let mut rng = stream(1, HOME);
        let words: Vec<u32> = (0..4).map(|_| rng.next_u32()).collect();
        assert_eq!(words, WORDS_SEED_1);
    }
    const WORDS_SEED_1: [u32; 4] = [1364205963, 2627281596, 4153454620, 2147467643];

    #[test]
    fn first_normals_never_change() {
        // change detector: these numbers are part of every published simulation
        let mut rng = stream(1, StreamId { run: 2, axis: 3, term: 4 });
        let x = [normal(&mut rng), normal(&mut rng), normal(&mut rng)];
        assert_eq!(x, [0.6288259559756516, 0.9128706318169924, -1.5788489830965171]);
    }

    #[test]
    fn every_part_of_the_address_matters() {
        let ids = [
            (1, HOME),
            (2, HOME),
            (1, StreamId { run: 1, ..HOME }),
            (1, StreamId { axis: 1, ..HOME }),
            (1, StreamId { term: 1, ..HOME }),
            (1 << 63, HOME),
            (1, StreamId { run: 1 << 63, ..HOME }),
            (1, StreamId { axis: 1 << 31, ..HOME }),
            (1, StreamId { term: 1 << 31, ..HOME }),
        ];
        let first: Vec<u64> = ids.iter().map(|(seed, id)| stream(*seed, *id).next_u64()).collect();
        for (i, a) in first.iter().enumerate() {
            for b in &first[i + 1..] {
                assert_ne!(a, b, "two addresses give one stream: {first:?}");
            }
        }
    }

    #[test]
    fn blocks_do_not_matter() {
        let (mut whole, mut parts) = (vec![0.0; 1000], vec![0.0; 1000]);
        fill_normal(&mut stream(5, HOME), &mut whole);
        let mut rng = stream(5, HOME);
        for part in parts.chunks_mut(7) {
            fill_normal(&mut rng, part);
        }
        assert_eq!(whole, parts);
    }

    /// Moments up to the fourth of 10⁶ numbers. The standard errors of mean, variance, third and fourth moment are
    /// 1, √2, √15, √96 times 1e-3; 5 of them each, two-sided: false alarm 4 × 5.7e-7.
    #[test]
    fn normal_moments() {
        let mut x = vec![0.0; 1_000_000];
        fill_normal(&mut stream(11, HOME), &mut x);
        let moment = |k: i32| x.iter().map(|x| x.powi(k)).sum::<f64>() / x.len() as f64;
        for (k, expected, spread) in
            [(1, 0.0, 1.0), (2, 1.0, 2f64.sqrt()), (3, 0.0, 15f64.sqrt()), (4, 3.0, 96f64.sqrt())]
        {
            assert!((moment(k) - expected).abs() < 5e-3 * spread, "moment {k}: {}", moment(k));
        }
    }
}

mod reduce {
    use kfdesign::numerics::reduce::{Moments, Sum, mean};

    #[test]
    fn sum_keeps_what_plain_addition_loses() {
        // Neumaier's own example: 1 + 1e100 + 1 − 1e100 = 2
        let mut sum = Sum::default();
        for x in [1.0, 1e100, 1.0, -1e100] {
            sum.add(x);
        }
        assert_eq!(sum.value(), 2.0);
        let mut infinite = Sum::default();
        infinite.add(f64::INFINITY);
        infinite.add(1.0);
        assert_eq!(infinite.value(), f64::INFINITY);
    }

    #[test]
    fn mean_of_a_large_offset() {
        let x: Vec<f64> = (0..100_000).map(|k| 1e9 + f64::from(k % 10) * 0.1).collect();
        // the inputs themselves carry 1.2e-7 rounding
        assert!((mean(&x) - 1e9 - 0.45).abs() < 1.2e-7);
        assert!(mean(&[]).is_nan());
    }

    #[test]
    fn moments_merge_to_the_whole() {
        let x: Vec<f64> = (0..1000).map(|k| 1e6 + f64::from(k).sin()).collect();
        let mut whole = Moments::default();
        x.iter().for_each(|x| whole.add(*x));
        let mut merged = Moments::default();
        for part in x.chunks(37) {
            let mut m = Moments::default();
            part.iter().for_each(|x| m.add(*x));
            merged.merge(&m);
        }
        let centre = mean(&x);
        let direct = x.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / 999.0;
        assert_eq!(merged.count, 1000);
        for m in [whole, merged] {
            assert!((m.mean - centre).abs() < 1e-8);
            assert!((m.variance() / direct - 1.0).abs() < 1e-8, "{} against {direct}", m.variance());
        }
        assert!(Moments::default().variance().is_nan());
    }
}

mod quadratic_form {
    use kfdesign::numerics::distribution::{chi_square_quantile, normal_sf};
    use kfdesign::numerics::quadratic_form::QuadraticForm;

    /// Equal weights make a chi-square law. The saddlepoint formula is off by some 1e-3 of the tail for four degrees
    /// of freedom and less for more (Barndorff-Nielsen 1990: order 1/n^1.5); straight lines between saddlepoints add
    /// at most as much.
    #[test]
    fn equal_weights_are_chi_square() {
        for (weights, freedom) in [(4, 5.0), (3, 40.0), (40, 1.0), (1, 1e5)] {
            let form = QuadraticForm::new(&vec![2.5; weights]);
            assert!(
                (form.sum - 2.5 * weights as f64).abs() < 1e-12 && (form.squares - 6.25 * weights as f64).abs() < 1e-12
            );
            for p in [1e-8, 1e-4, 0.01, 0.3, 0.5, 0.9, 0.9999] {
                let x = 2.5 * chi_square_quantile(p, weights as f64 * freedom);
                let found = normal_sf(-form.z(x, freedom));
                assert!((found / p - 1.0).abs() < 1e-3, "{weights} weights, {freedom}, p = {p}: {found}");
            }
        }
    }

    /// Two degrees of freedom each are exponentials of mean 2 w: P(X > x) = Σ_i e^{−x/(2 w_i)} Π_{j≠i} w_i/(w_i −
    /// w_j). So few degrees of freedom are the worst case, and the far tail, where one weight alone counts, its
    /// worst place: 5 %.
    #[test]
    fn pairs_are_sums_of_exponentials() {
        let weights: [f64; 4] = [3.0, 1.0, 0.5, 0.1];
        let form = QuadraticForm::new(&[3.0, 0.0, 1.0, 0.5, -1e-18, 0.1]);
        for x in [0.3, 1.0, 5.0, 20.0, 60.0, 120.0] {
            let share = |w: f64| weights.iter().filter(|v| **v != w).map(|v| w / (w - v)).product::<f64>();
            let above: f64 = weights.iter().map(|w| share(*w) * f64::exp(-x / (2.0 * w))).sum();
            let z = form.z(x, 2.0);
            assert!((normal_sf(z) / above - 1.0).abs() < 0.05, "{x}: {} for {above}", normal_sf(z));
            assert!((form.quantile(z, 2.0) / x - 1.0).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn a_form_of_nothing_has_no_law() {
        let form = QuadraticForm::new(&[f64::NAN, -1.0]);
        assert!(form.z(1.0, 3.0).is_nan() && form.quantile(0.0, 3.0).is_nan());
        assert!(QuadraticForm::new(&[1.0]).z(f64::NAN, 1.0).is_nan());
    }
}
