//! Decimal numbers from text, eight digits at a time, each rounded to the nearest f64 (ties to even) like `str::parse`.
//!
//! A number is m·10^e with an integer m of at most 64 bits. Where m ≤ 2^53 and |e| ≤ 22 both m and 10^|e| are exact
//! in f64, so one division or product is correctly rounded (Clinger 1990, "How to read floating point numbers
//! accurately"). Otherwise, for |e| ≤ 27, 5^|e| fits into 64 bits, so m·5^e or the first 62 bits of m/5^|e| and
//! whether anything follows are found in integers and rounded once.

/// Bytes that must stand before a digit that is read.
pub(super) const LEAD: usize = 32;
/// 10^e and 5^e are known up to here.
const LARGEST_EXPONENT: i32 = 27;
const TEN: [u64; 20] = powers(10);
const FIVE: [u64; LARGEST_EXPONENT as usize + 1] = powers(5);
/// Exact in f64.
const EXACT_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

const SIGNED_TEN: [[f64; 23]; 2] = {
    let mut table = [EXACT_TEN; 2];
    let mut i = 0;
    while i < 23 {
        table[1][i] = -EXACT_TEN[i];
        i += 1;
    }
    table
};

const fn powers<const N: usize>(base: u64) -> [u64; N] {
    let mut table = [1; N];
    let mut i = 1;
    while i < N {
        table[i] = table[i - 1] * base;
        i += 1;
    }
    table
}

/// What is done to many bytes at once. Integers only: every way gives the same.
pub(super) trait Bytes: Copy {
    /// One bit for each byte that is a separator or the end of a line, for each end of a line, and for each quote.
    fn ends(self, block: &[u8; 64], separators: [u8; 2]) -> (u64, u64, u64);
    /// One bit for each byte that is no digit.
    fn others(self, text: &[u8; 32]) -> u32;
    /// The last `count` bytes, which are digits, as a number.
    fn sixteen(self, text: &[u8; 16], count: usize) -> u64;
    /// The places of the bits that are set, behind `at`.
    #[inline(always)]
    fn places(self, mut bits: u64, at: u32, places: &mut [u32; 80]) {
        // four at a time: how many there are is less of a surprise
        for four in places.as_chunks_mut::<4>().0 {
            for place in four {
                *place = at + bits.trailing_zeros();
                bits &= bits.wrapping_sub(1);
            }
            if bits == 0 {
                break;
            }
        }
    }
    /// Eight fields as numbers, where that is quicker than one by one.
    #[inline(always)]
    fn numbers(self, _fields: &Eight, _point: u8) -> Option<Numbers> {
        None
    }
    /// Eight stamps since `origin` (an integer, and what is behind its point), likewise.
    #[inline(always)]
    fn stamps(self, _fields: &Eight, _point: u8, _origin: (i64, f64)) -> Option<Numbers> {
        None
    }
}

/// The last 24 bytes of eight fields, the last eight bytes first, and how long each field is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight {
    pub(super) words: [[u64; 8]; 3],
    pub(super) lengths: [u64; 8],
}

/// Eight numbers, and one bit for each that is right; the others are to be read in another way.
pub(super) type Numbers = ([f64; 8], u8);

/// Eight bytes in a word.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words;

const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
const EACH: u64 = 0x0101_0101_0101_0101;

/// The high bits of eight bytes side by side.
#[inline(always)]
fn high_bits(word: u64) -> u64 {
    ((word & !LOW) >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

impl Bytes for Words {
    #[inline(always)]
    fn ends(self, block: &[u8; 64], separators: [u8; 2]) -> (u64, u64, u64) {
        let (mut ends, mut feeds, mut quotes) = (0, 0, 0);
        for (i, word) in block.as_chunks::<8>().0.iter().enumerate() {
            // the high bit of a byte that is zero: no carry from 7 bits plus 127
            let is = |byte: u8| {
                let x = u64::from_le_bytes(*word) ^ (EACH * u64::from(byte));
                !(((x & LOW) + LOW) | x)
            };
            ends |= high_bits(is(separators[0]) | is(separators[1]) | is(b'\n')) << (8 * i);
            feeds |= high_bits(is(b'\n')) << (8 * i);
            quotes |= high_bits(is(b'"')) << (8 * i);
        }
        (ends, feeds, quotes)
    }
    #[inline(always)]
    fn others(self, text: &[u8; 32]) -> u32 {
        let mut all = 0;
        for (i, word) in text.as_chunks::<8>().0.iter().enumerate() {
            let x = u64::from_le_bytes(*word) ^ (EACH * u64::from(b'0'));
            // a byte of x is a digit if it is at most 9: no carry from 7 bits plus 118, and its own high bit not set
            all |= high_bits(((x & LOW) + EACH * 118) | x) << (8 * i);
        }
        all as u32
    }
    #[inline(always)]
    fn sixteen(self, text: &[u8; 16], count: usize) -> u64 {
        eight(text, 16, count.min(8)) + TEN[8] * eight(text, 8, count.saturating_sub(8))
    }
}

#[cfg(target_arch = "x86_64")]
impl Bytes for pulp::x86::V3 {
    #[inline(always)]
    fn ends(self, block: &[u8; 64], separators: [u8; 2]) -> (u64, u64, u64) {
        let each = |byte: u8| self.avx._mm256_set1_epi8(byte as i8);
        let (mut ends, mut feeds, mut quotes) = (0, 0, 0);
        for (i, half) in block.as_chunks::<32>().0.iter().enumerate() {
            let is = |byte: u8| self.avx2._mm256_cmpeq_epi8(pulp::cast(*half), each(byte));
            let either = self.avx2._mm256_or_si256(is(separators[0]), is(separators[1]));
            let feed = is(b'\n');
            let bits = |x| u64::from(self.avx2._mm256_movemask_epi8(x) as u32) << (32 * i);
            ends |= bits(self.avx2._mm256_or_si256(either, feed));
            feeds |= bits(feed);
            quotes |= bits(is(b'"'));
        }
        (ends, feeds, quotes)
    }
    #[inline(always)]
    fn others(self, text: &[u8; 32]) -> u32 {
        // the digits become the smallest ten of the signed bytes
        let moved = self.avx2._mm256_add_epi8(pulp::cast(*text), self.avx._mm256_set1_epi8((0x80 - b'0') as i8));
        let above = self.avx2._mm256_cmpgt_epi8(moved, self.avx._mm256_set1_epi8(-128 + 9));
        self.avx2._mm256_movemask_epi8(above) as u32
    }
    #[inline(always)]
    fn sixteen(self, text: &[u8; 16], count: usize) -> u64 {
        const KEEP: [[u8; 16]; 17] = keep();
        let ascii = self.sse2._mm_xor_si128(pulp::cast(*text), self.sse2._mm_set1_epi8(b'0' as i8));
        let digits = self.sse2._mm_and_si128(ascii, pulp::cast(KEEP[count]));
        let twos = self.ssse3._mm_maddubs_epi16(digits, self.sse2._mm_set1_epi16(1 << 8 | 10));
        let fours = self.sse2._mm_madd_epi16(twos, self.sse2._mm_set1_epi32(1 << 16 | 100));
        let packed = self.sse2._mm_packs_epi32(fours, fours);
        let eights = self.sse2._mm_madd_epi16(packed, self.sse2._mm_set1_epi32(1 << 16 | 10_000));
        let [both, _]: [u64; 2] = pulp::cast(eights);
        (both & 0xffff_ffff) * TEN[8] + (both >> 32)
    }
}

/// The last `count` (at most 8) bytes before `end`, which are digits, as a number. The digits stand in one word, the
/// last in its highest byte; neighbours are joined to numbers of 2, 4 and 8 digits (Lemire 2021, "Number parsing at
/// a gigabyte per second", section 6).
#[inline(always)]
pub(super) fn eight(text: &[u8], end: usize, count: usize) -> u64 {
    const KEEP: [u64; 9] = [0, !0 << 56, !0 << 48, !0 << 40, !0 << 32, !0 << 24, !0 << 16, !0 << 8, !0];
    let Some(word) = text[..end].last_chunk::<8>() else { return 0 };
    let digits = (u64::from_le_bytes(*word) ^ 0x3030_3030_3030_3030) & KEEP[count];
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let first = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(0x000f_4240_0000_0064);
    let second = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(0x0000_2710_0000_0001);
    first.wrapping_add(second) >> 32
}

/// `whole`·10^count + fraction, for at most 19 digits in all.
#[inline(always)]
pub(super) fn joined(whole: u64, fraction: u64, count: usize) -> u64 {
    whole * TEN[count] + fraction
}

/// m and 10^count are exact in f64, so that one division is correctly rounded.
#[inline(always)]
pub(super) fn is_exact(m: u64) -> bool {
    m <= 1 << 53
}

/// m over 10^count for an m that is not exact, correctly rounded.
pub(super) fn inexact(m: u64, count: usize) -> f64 {
    wide(m, -(count as i32)).unwrap_or(f64::NAN)
}

/// A number of at most 19 digits after leading zeros, with or without sign, point and exponent; `None` for anything
/// else.
pub(super) fn number(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let point = if decimal_comma { b',' } else { b'.' };
    let (negative, text) = signed(field);
    let (mut m, mut count, mut behind, mut significant) = (0u64, 0, None, 0);
    let mut left = text.iter();
    let mut exponent = 0;
    while let Some(byte) = left.next() {
        match byte {
            b'0'..=b'9' => {
                m = m.wrapping_mul(10).wrapping_add(u64::from(byte - b'0'));
                significant += u32::from(significant > 0 || *byte != b'0');
                count += 1;
                behind = behind.map(|digits| digits + 1);
            }
            _ if *byte == point && behind.is_none() => behind = Some(0),
            b'e' | b'E' => {
                let (down, power) = signed(left.as_slice());
                if !(1..=4).contains(&power.len()) || !power.iter().all(u8::is_ascii_digit) {
                    return None;
                }
                let power = power.iter().fold(0, |sum, digit| 10 * sum + i32::from(digit - b'0'));
                exponent = if down { -power } else { power };
                left = [].iter();
            }
            _ => return None,
        }
    }
    if count == 0 || significant > 19 || (decimal_comma && (behind == Some(0) || field.len() > 64)) {
        return None;
    }
    scaled(m, exponent - behind.unwrap_or(0)).map(|x| if negative { -x } else { x })
}

/// An integer of at most 18 digits, with or without a minus, or 19 that fit.
pub(super) fn integer(field: &[u8]) -> Option<i64> {
    let (negative, digits) = field.strip_prefix(b"-").map_or((false, field), |rest| (true, rest));
    if !(1..=19).contains(&digits.len()) || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let whole = i64::try_from(digits.iter().fold(0u64, |sum, digit| 10 * sum + u64::from(digit - b'0'))).ok()?;
    Some(if negative { -whole } else { whole })
}

/// Whether there is a minus, and what is behind the sign.
fn signed(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

/// 10^count for at most 22 digits of a fraction, with the sign of the number.
#[inline(always)]
pub(super) fn signed_ten(count: usize, negative: bool) -> f64 {
    SIGNED_TEN[usize::from(negative)][count]
}

/// m·10^e, correctly rounded; `None` where neither way of the module's description applies.
fn scaled(m: u64, e: i32) -> Option<f64> {
    if m <= 1 << 53 && e.unsigned_abs() <= 22 {
        let x = m as i64 as f64;
        let power = EXACT_TEN[e.unsigned_abs() as usize];
        return Some(if e < 0 { x / power } else { x * power });
    }
    wide(m, e)
}

#[cold]
#[inline(never)]
fn wide(m: u64, e: i32) -> Option<f64> {
    if m == 0 {
        return Some(0.0);
    }
    if e.abs() > LARGEST_EXPONENT {
        return None;
    }
    let five = FIVE[e.unsigned_abs() as usize];
    if e >= 0 {
        return Some(rounded(u128::from(m) * u128::from(five), false, e));
    }
    // shifted so far that the quotient has 63 or 64 bits: bits(m << shift) = bits(five) + 63
    let shift = 63 + m.leading_zeros() - five.leading_zeros();
    let (dividend, divisor) = (u128::from(m) << shift, u128::from(five));
    let quotient = dividend / divisor;
    Some(rounded(quotient, quotient * divisor != dividend, e - shift as i32))
}

/// (q + a part of one if `more`)·2^e, rounded to the nearest, ties to even. With q ≥ 2^54 if `more`, and a normal
/// result.
fn rounded(q: u128, more: bool, e: i32) -> f64 {
    let drop = (128 - q.leading_zeros()).saturating_sub(53);
    let kept = (q >> drop) as u64;
    let rest = q - (u128::from(kept) << drop);
    let half = if drop > 0 { 1 << (drop - 1) } else { 1 };
    let up = rest > half || (rest == half && (more || kept & 1 == 1));
    let two = f64::from_bits(((1023 + e + drop as i32) as u64) << 52);
    (kept + u64::from(up)) as f64 * two
}

/// All bits of the last bytes, so many.
#[cfg(target_arch = "x86_64")]
const fn keep() -> [[u8; 16]; 17] {
    let mut table = [[0; 16]; 17];
    let mut count = 1;
    while count <= 16 {
        table[count] = (u128::MAX << (128 - 8 * count)).to_le_bytes();
        count += 1;
    }
    table
}
