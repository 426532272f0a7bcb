//! Normal numbers for several runs side by side: one instruction draws for all of them.
//!
//! Every run has its own generator, so that its numbers do not depend on which runs are beside it. Nothing but +, −,
//! ×, ÷, √ and bit operations is used, each rounded as IEEE 754 says, so that any processor gives the same bits.

use rand::Rng;

use super::random::{StreamId, stream};

/// Generators of `L` runs, xoshiro256++ (Blackman and Vigna 2021), each started from 256 bits of the ChaCha8 stream
/// of its address.
#[derive(Clone, Debug)]
pub struct Normals<const L: usize> {
    state: [[u64; L]; 4],
}

impl<const L: usize> Normals<L> {
    /// One stream per address.
    pub fn new(seed: u64, addresses: [StreamId; L]) -> Normals<L> {
        let mut streams = addresses.map(|address| stream(seed, address));
        Normals { state: std::array::from_fn(|_| std::array::from_fn(|l| streams[l].next_u64())) }
    }

    /// Standard normal numbers: `out[k][l]` is the k-th of run l. `words` is scratch of the same length, which must
    /// be even.
    ///
    /// Polar coordinates, √(−2 ln u) cos θ and √(−2 ln u) sin θ (Box and Muller 1958): the first half of the words
    /// gives u, the second θ.
    #[inline(always)]
    pub fn fill(&mut self, words: &mut [[u64; L]], out: &mut [[f64; L]]) {
        self.words(words);
        let (words, out) = (words.as_flattened(), out.as_flattened_mut());
        let half = out.len() / 2;
        let (radii, angles) = words.split_at(half);
        let (first, second) = out.split_at_mut(half);
        for (((x, y), u), v) in first.iter_mut().zip(second).zip(radii).zip(angles) {
            (*x, *y) = pair(*u, *v);
        }
    }

    #[inline(always)]
    fn words(&mut self, out: &mut [[u64; L]]) {
        let mut s = self.state;
        for word in out {
            for l in 0..L {
                word[l] = s[0][l].wrapping_add(s[3][l]).rotate_left(23).wrapping_add(s[0][l]);
                let shifted = s[1][l] << 17;
                s[2][l] ^= s[0][l];
                s[3][l] ^= s[1][l];
                s[1][l] ^= s[2][l];
                s[0][l] ^= s[3][l];
                s[2][l] ^= shifted;
                s[3][l] = s[3][l].rotate_left(45);
            }
        }
        self.state = s;
    }
}

/// 52 random bits as a number in [1, 2).
#[inline(always)]
fn one_to_two(word: u64) -> f64 {
    f64::from_bits((word >> 12) | 1.0_f64.to_bits())
}

/// Two independent standard normal numbers of two random words; errors below 1e-15 of the radius.
#[inline(always)]
fn pair(radius: u64, angle: u64) -> (f64, f64) {
    // the middle of one of 2^52 equal parts of (0, 1), so that ln u is finite: the largest radius is 8.57
    let u = one_to_two(radius) - (1.0 - f64::EPSILON / 2.0);
    let r = (-2.0 * ln(u)).sqrt();
    // an eighth turn to each side, then the eight places of it on the circle from bits that the fraction does not use
    let (sin, cos) = sin_cos((one_to_two(angle) - 1.5) * std::f64::consts::FRAC_PI_2);
    let swap = (angle & 1).wrapping_neg();
    let (sin, cos) = (sin.to_bits(), cos.to_bits());
    let x = ((cos & !swap) | (sin & swap)) ^ ((angle & 2) << 62);
    let y = ((sin & !swap) | (cos & swap)) ^ ((angle & 4) << 61);
    (r * f64::from_bits(x), r * f64::from_bits(y))
}

/// ln u of a positive normal number: u = 2ᵉ m with m in [√½, √2), ln m = 2 artanh((m − 1)/(m + 1)).
/// Coefficients: FDLIBM `e_log.c` (Sun Microsystems 1993), error of the polynomial below 2^−58.
#[inline(always)]
fn ln(u: f64) -> f64 {
    const P: [f64; 7] = [
        0.6666666666666735,
        0.3999999999940942,
        0.2857142874366239,
        0.22222198432149784,
        0.1818357216161805,
        0.15313837699209373,
        0.14798198605116586,
    ];
    /// 2^52 + 2^10 and its bits: adding a small integer to the bits adds it to the number.
    const LARGE: f64 = 4503599627371520.0;
    let bits = u.to_bits();
    let exponent = (bits.wrapping_sub(std::f64::consts::FRAC_1_SQRT_2.to_bits()) as i64) >> 52;
    let m = f64::from_bits(bits.wrapping_sub((exponent << 52) as u64));
    let e = f64::from_bits(LARGE.to_bits().wrapping_add(exponent as u64)) - LARGE;
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let p = P[0] + z * (P[1] + z * (P[2] + z * (P[3] + z * (P[4] + z * (P[5] + z * P[6])))));
    e * std::f64::consts::LN_2 + (2.0 * s + s * z * p)
}

/// sin y and cos y, |y| ≤ π/4. Coefficients: FDLIBM `k_sin.c` and `k_cos.c` (Sun Microsystems 1993), errors below
/// 2^−58.
#[inline(always)]
fn sin_cos(y: f64) -> (f64, f64) {
    const S: [f64; 6] = [
        -0.16666666666666632,
        0.00833333333332249,
        -0.0001984126982985795,
        2.7557313707070068e-06,
        -2.5050760253406863e-08,
        1.58969099521155e-10,
    ];
    const C: [f64; 6] = [
        0.0416666666666666,
        -0.001388888888887411,
        2.480158728947673e-05,
        -2.7557314351390663e-07,
        2.087572321298175e-09,
        -1.1359647557788195e-11,
    ];
    let q = y * y;
    let sin = S[0] + q * (S[1] + q * (S[2] + q * (S[3] + q * (S[4] + q * S[5]))));
    let cos = C[0] + q * (C[1] + q * (C[2] + q * (C[3] + q * (C[4] + q * C[5]))));
    (y + y * q * sin, (1.0 - 0.5 * q) + q * q * cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Fill<'a>(&'a mut Normals<8>, &'a mut [[u64; 8]], &'a mut [[f64; 8]]);
    impl pulp::NullaryFnOnce for Fill<'_> {
        type Output = ();
        #[inline(always)]
        fn call(self) {
            self.0.fill(self.1, self.2);
        }
    }

    fn normals() -> Normals<8> {
        Normals::new(1, std::array::from_fn(|l| StreamId { run: l as u64, axis: 2, term: 3 }))
    }

    /// The words of the authors' C program for the state 1, 2, 3, 4.
    #[test]
    fn words_are_those_of_xoshiro() {
        let mut normals = Normals { state: [[1, 5], [2, 6], [3, 7], [4, 8]] };
        let mut words = [[0; 2]; 6];
        normals.words(&mut words);
        let expected =
            [41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162];
        assert_eq!(words.map(|word| word[0]), expected);
    }

    /// The same formula with the functions of the library, on words that reach every part of it.
    #[test]
    fn pairs_are_polar_coordinates() {
        let mut words = vec![[0; 8]; 20_000];
        normals().words(&mut words);
        let ends = [0, u64::MAX, 1 << 63, (1 << 63) - 1, 1 << 12, !0xfff, 0x6a09_e667_f3bc_d000, 0x6a09_e667_f3bc_e000];
        let radii = words.as_flattened().iter().copied().chain(ends.iter().flat_map(|u| [*u; 8]));
        let angles = words.as_flattened().iter().rev().copied().chain(ends.iter().flat_map(|_| ends));
        let mut octants = [0; 8];
        for (u, v) in radii.zip(angles) {
            let r = (-2.0 * (one_to_two(u) - 1.0 + f64::EPSILON / 2.0).ln()).sqrt();
            let theta = (one_to_two(v) - 1.5) * std::f64::consts::FRAC_PI_2;
            let (a, b) = if v & 1 == 0 { (theta.cos(), theta.sin()) } else { (theta.sin(), theta.cos()) };
            let expected = (r * if v & 2 == 0 { a } else { -a }, r * if v & 4 == 0 { b } else { -b });
            let (x, y) = pair(u, v);
            // a few roundings of ln, the root, the angle and the product
            let tolerance = 4.0 * f64::EPSILON * r;
            assert!((x - expected.0).abs() <= tolerance && (y - expected.1).abs() <= tolerance, "{u:x} {v:x}: {x} {y}");
            octants[(v & 7) as usize] += 1;
        }
        assert!(octants.iter().all(|count| *count > 1000), "{octants:?}");
    }

    /// A run's numbers are the same alone and beside others, in one piece and in several.
    #[test]
    fn lanes_do_not_mix_and_any_processor_gives_the_same() {
        let (mut words, mut all) = (vec![[0; 8]; 512], vec![[0.0; 8]; 512]);
        normals().fill(&mut words, &mut all);
        let mut dispatched = vec![[0.0; 8]; 512];
        pulp::Arch::new().dispatch(Fill(&mut normals(), &mut words, &mut dispatched));
        assert_eq!(all, dispatched);
        for l in 0..8 {
            let mut alone = Normals::<1>::new(1, [StreamId { run: l as u64, axis: 2, term: 3 }]);
            let (mut words, mut out) = (vec![[0; 1]; 512], vec![[0.0; 1]; 512]);
            alone.fill(&mut words, &mut out);
            assert!(out.iter().zip(&all).all(|(a, b)| a[0].to_bits() == b[l].to_bits()), "lane {l}");
        }
    }

    /// Moments to the fourth and the correlations of neighbours, of runs and of a pair: each within 5 sigma of its
    /// own scatter, 8 figures, false alarms 5e-6 in all (fixed seed).
    #[test]
    fn numbers_are_standard_normal() {
        let mut normals = normals();
        let (mut words, mut x) = (vec![[0; 8]; 256], vec![[0.0; 8]; 256]);
        let mut sums = [0.0; 8];
        let mut count = 0.0;
        for _ in 0..1000 {
            normals.fill(&mut words, &mut x);
            for k in 0..128 {
                for l in 0..8 {
                    let (a, b) = (x[k][l], x[k + 128][l]);
                    let (next, beside) = (x[(k + 1) % 128][l], x[k][(l + 1) % 8]);
                    let terms = [
                        a,
                        (a * a - 1.0) / 2.0_f64.sqrt(),
                        a.powi(3) / 15.0_f64.sqrt(),
                        (a.powi(4) - 3.0) / 96.0_f64.sqrt(),
                        a * b,
                        a * next,
                        a * beside,
                        (a * a - 1.0) * (b * b - 1.0) / 2.0,
                    ];
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                    count += 1.0;
                }
            }
        }
        assert!(sums.iter().all(|sum| (sum / f64::sqrt(count)).abs() < 5.0), "{sums:?} of {count}");
    }
}
