//! Eight fields of a text log at once, one in each 64-bit lane, for processors with 512-bit registers.
//!
//! A field stands in three words, its last byte in the highest byte of the first one. The digits behind the point
//! are what is left of the words when the lower bytes are cleared; the digits before it are brought to the same
//! place by shifts. Neighbours are joined to numbers of 2, 4 and 8 digits as in `digits::eight`.

use super::digits::{Bytes, Eight, Numbers};
use pulp::x86::V4;
use std::arch::x86_64::{__m512d, __m512i, _CMP_LT_OQ};

/// A sign or none, 1 to 8 digits, a point, 1 to 15 digits.
struct Decimals {
    negative: u8,
    good: u8,
    /// Integers.
    whole: __m512i,
    fraction: __m512i,
    /// 10^count, for so many digits of the fraction.
    ten: __m512d,
}

/// Functions, not closures: they are compiled for the instructions of V4 where they are used.
#[derive(Clone, Copy)]
struct Lanes(V4);

/// whole + fraction/10^count, rounded once.
#[inline(always)]
fn read_numbers(simd: V4, eight: &Eight, point: u8) -> Numbers {
    let lanes = Lanes(simd);
    let Decimals { negative, good, whole, fraction, ten } = lanes.decimals(eight, point);
    let V4 { avx512f: f, avx512dq: dq, .. } = simd;
    // integers below 2^53: their sum is exact if it is below too, and one that is above is not rounded below
    let m = f._mm512_fmadd_pd(dq._mm512_cvtepi64_pd(whole), ten, dq._mm512_cvtepi64_pd(fraction));
    let exact = f._mm512_cmp_pd_mask::<_CMP_LT_OQ>(m, f._mm512_set1_pd(9_007_199_254_740_992.0));
    (pulp::cast(lanes.signed(negative, f._mm512_div_pd(m, ten))), good & exact)
}

/// Since `origin`, an integer and what is behind its point: (whole − integer) + (fraction/10^count − what is behind).
#[inline(always)]
fn read_stamps(simd: V4, eight: &Eight, point: u8, origin: (i64, f64)) -> Numbers {
    let lanes = Lanes(simd);
    let Decimals { negative, good, whole, fraction, ten } = lanes.decimals(eight, point);
    let V4 { avx512f: f, avx512dq: dq, .. } = simd;
    let whole = f._mm512_mask_sub_epi64(whole, negative, lanes.same(0), whole);
    let since = dq._mm512_cvtepi64_pd(f._mm512_sub_epi64(whole, lanes.same(origin.0)));
    let behind = lanes.signed(negative, f._mm512_div_pd(dq._mm512_cvtepi64_pd(fraction), ten));
    let behind = f._mm512_sub_pd(behind, f._mm512_set1_pd(origin.1));
    (pulp::cast(f._mm512_add_pd(since, behind)), good)
}

impl Lanes {
    #[inline(always)]
    fn decimals(self, eight: &Eight, point: u8) -> Decimals {
        let V4 { avx512f: f, avx512bw: bw, .. } = self.0;
        let [first, second, third]: [__m512i; 3] = pulp::cast(eight.words);
        // 8 × the digits behind the last point of the first two words; 128 if there is none
        let point = f._mm512_set1_epi8(point as i8);
        let (behind, more) = (self.bits_behind(first, point), self.bits_behind(second, point));
        let none = f._mm512_cmpeq_epi64_mask(behind, self.same(64));
        let behind = f._mm512_mask_add_epi64(behind, none, behind, more);
        // digits become 0 to 9, all else more
        let zeros = f._mm512_set1_epi8(b'0' as i8);
        let first = f._mm512_xor_si512(first, zeros);
        let second = f._mm512_xor_si512(second, zeros);
        let third = f._mm512_xor_si512(third, zeros);
        let low = self.highest(first, 64, behind);
        let high = self.highest(second, 128, behind);
        // what stands before the point; a shift by 64 or more, or by less than none, leaves nothing
        let past = f._mm512_add_epi64(behind, self.same(8));
        let before = f._mm512_or_si512(
            f._mm512_or_si512(f._mm512_sllv_epi64(first, past), self.moved(second, 64, past)),
            self.moved(third, 128, past),
        );
        let left = f._mm512_sub_epi64(f._mm512_slli_epi64::<3>(pulp::cast(eight.lengths)), past);
        let lead = f._mm512_srlv_epi64(before, f._mm512_sub_epi64(self.same(64), left));
        let lead = f._mm512_and_si512(lead, self.same(0xff));
        let negative = f._mm512_cmpeq_epi64_mask(lead, self.same(i64::from(b'-' ^ b'0')));
        let digits = f._mm512_mask_sub_epi64(left, negative, left, self.same(8));
        let before = self.highest(before, 64, digits);
        let largest = bw._mm512_max_epu8(bw._mm512_max_epu8(low, high), before);
        let others = bw._mm512_subs_epu8(largest, f._mm512_set1_epi8(9));
        let bad = f._mm512_test_epi64_mask(others, others);
        let good = self.within(digits, 8) & self.within(behind, 15) & !bad;
        let fraction = f._mm512_mul_epu32(self.eight_digits(high), self.same(100_000_000));
        let fraction = f._mm512_add_epi64(fraction, self.eight_digits(low));
        let count = f._mm512_srli_epi64::<3>(behind);
        let ten = f._mm512_permutex2var_pd(pulp::cast(TEN), count, pulp::cast(MORE));
        Decimals { negative, good, whole: self.eight_digits(before), fraction, ten }
    }

    #[inline(always)]
    fn same(self, x: i64) -> __m512i {
        self.0.avx512f._mm512_set1_epi64(x)
    }
    /// Bits behind the last byte that is a point.
    #[inline(always)]
    fn bits_behind(self, word: __m512i, point: __m512i) -> __m512i {
        let V4 { avx512bw: bw, avx512cd: cd, .. } = self.0;
        cd._mm512_lzcnt_epi64(bw._mm512_movm_epi8(bw._mm512_cmpeq_epi8_mask(word, point)))
    }
    /// Without the bits that are more than `bits` from the highest one, which counts from `end` − 64 on.
    #[inline(always)]
    fn highest(self, word: __m512i, end: i64, bits: __m512i) -> __m512i {
        let V4 { avx512f: f, avx512bw: bw, .. } = self.0;
        let cleared = bw._mm512_subs_epu16(self.same(end), bits);
        f._mm512_and_si512(word, f._mm512_sllv_epi64(self.same(-1), cleared))
    }
    /// Shifted up by `past` − `by`, or down where that is negative.
    #[inline(always)]
    fn moved(self, word: __m512i, by: i64, past: __m512i) -> __m512i {
        let f = self.0.avx512f;
        let up = f._mm512_sllv_epi64(word, f._mm512_sub_epi64(past, self.same(by)));
        let down = f._mm512_srlv_epi64(word, f._mm512_sub_epi64(self.same(by), past));
        f._mm512_or_si512(up, down)
    }
    /// Bits of 1 byte to `most` bytes.
    #[inline(always)]
    fn within(self, bits: __m512i, most: i64) -> u8 {
        let f = self.0.avx512f;
        f._mm512_cmplt_epu64_mask(f._mm512_sub_epi64(bits, self.same(8)), self.same(8 * most))
    }
    #[inline(always)]
    fn eight_digits(self, digits: __m512i) -> __m512i {
        let V4 { avx512f: f, avx512bw: bw, .. } = self.0;
        let twos = bw._mm512_maddubs_epi16(digits, f._mm512_set1_epi16(1 << 8 | 10));
        let fours = bw._mm512_madd_epi16(twos, f._mm512_set1_epi32(1 << 16 | 100));
        f._mm512_add_epi64(f._mm512_mul_epu32(fours, self.same(10_000)), f._mm512_srli_epi64::<32>(fours))
    }
    #[inline(always)]
    fn signed(self, negative: u8, x: __m512d) -> __m512d {
        let V4 { avx512f: f, avx512dq: dq, .. } = self.0;
        dq._mm512_mask_xor_pd(x, negative, x, f._mm512_set1_pd(-0.0))
    }
}

const TEN: [f64; 8] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
const MORE: [f64; 8] = [1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The places of the bits that are set, behind `at`.
#[inline(always)]
fn write_places(simd: V4, bits: u64, at: u32, places: &mut [u32; 80]) {
    const FIRST: [u32; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    let f = simd.avx512f;
    let mut count = 0;
    for quarter in 0..4 {
        let some = (bits >> (16 * quarter)) as u16;
        let all = f._mm512_add_epi32(pulp::cast(FIRST), f._mm512_set1_epi32((at + 16 * quarter) as i32));
        let Some(room) = places[count..].first_chunk_mut::<16>() else { return };
        *room = pulp::cast(f._mm512_maskz_compress_epi32(some, all));
        count += some.count_ones() as usize;
    }
}

impl Bytes for V4 {
    #[inline(always)]
    fn ends(self, block: &[u8; 64], separators: [u8; 2]) -> (u64, u64, u64) {
        let block = pulp::cast(*block);
        let is = |byte: u8| self.avx512bw._mm512_cmpeq_epi8_mask(block, self.avx512f._mm512_set1_epi8(byte as i8));
        let feeds = is(b'\n');
        (is(separators[0]) | is(separators[1]) | feeds, feeds, is(b'"'))
    }
    #[inline(always)]
    fn others(self, text: &[u8; 32]) -> u32 {
        let moved = self.avx2._mm256_sub_epi8(pulp::cast(*text), self.avx._mm256_set1_epi8(b'0' as i8));
        self.avx512bw._mm256_cmpgt_epu8_mask(moved, self.avx._mm256_set1_epi8(9))
    }
    #[inline(always)]
    fn sixteen(self, text: &[u8; 16], count: usize) -> u64 {
        (*self).sixteen(text, count)
    }
    #[inline(always)]
    fn places(self, bits: u64, at: u32, places: &mut [u32; 80]) {
        write_places(self, bits, at, places);
    }
    #[inline(always)]
    fn numbers(self, fields: &Eight, point: u8) -> Option<Numbers> {
        Some(read_numbers(self, fields, point))
    }
    #[inline(always)]
    fn stamps(self, fields: &Eight, point: u8, origin: (i64, f64)) -> Option<Numbers> {
        Some(read_stamps(self, fields, point, origin))
    }
}
