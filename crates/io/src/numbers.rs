//! Numbers in text: fast parsing, and writing of the shortest text that reads back the same.

use std::io::{self, Write};

/// A decimal number of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decimal {
    /// Its value, correctly rounded.
    pub(crate) value: f64,
    /// Its digits as an integer; saturated if there are more than 19.
    mantissa: u64,
    /// Number of digits in the text, including leading zeros.
    written: u32,
    /// Power of ten of the last digit.
    exponent: i32,
}

impl Decimal {
    /// Creates a number that is not finite.
    pub(crate) const fn non_number(value: f64) -> Self {
        Self { value, mantissa: 0, written: 0, exponent: 0 }
    }

    /// Returns true if single precision would lose digits of the file.
    ///
    /// That is the case if the nearest `f32`, printed with as many digits as the number has, is another
    /// number. The number must have at least 8 digits (not counting zeros that fill up an integer; any count
    /// for a subnormal `f32`, which has fewer digits itself), and a relative difference above 1e-9; so an
    /// `f32` that was printed with 9 digits, or with 6 decimals, is no loss. A number too large or too small
    /// for an `f32` always is.
    #[inline]
    pub(crate) fn needs_f64(&self) -> bool {
        if self.mantissa < MIN_F64_MANTISSA && self.exponent.unsigned_abs() <= 30 {
            return false;
        }
        self.differs_from_f32()
    }

    /// Number of significant digits.
    fn digits(&self) -> u32 {
        if self.written <= 19 { digit_count(self.mantissa) } else { self.written }
    }

    fn differs_from_f32(&self) -> bool {
        if !self.value.is_finite() || self.value == 0.0 {
            return false;
        }
        let single = self.value as f32;
        if single == 0.0 || !single.is_finite() {
            return true;
        }
        let off = (self.value - f64::from(single)).abs();
        // Zeros at the end of an integer are not significant: the f32 34601252 is printed as 34601250.
        let (mut digits, mut exponent, mut rest) = (self.digits(), self.exponent, self.value);
        if rest.fract() == 0.0 {
            if exponent < 0 {
                digits = digits.saturating_sub(exponent.unsigned_abs());
                exponent = 0;
            }
            while digits >= MIN_F64_DIGITS && rest % 10.0 == 0.0 {
                (digits, exponent, rest) = (digits - 1, exponent + 1, rest / 10.0);
            }
        }
        // Half a unit of the last digit, plus a margin for the rounding of this computation.
        let unit = match EXACT_POWERS.get(exponent.unsigned_abs() as usize) {
            Some(power) if exponent < 0 => 1.0 / power,
            Some(power) => *power,
            None => 10f64.powi(exponent),
        };
        let printed_alike = off <= 0.500_001 * unit;
        (digits >= MIN_F64_DIGITS || single.is_subnormal())
            && off > 1e-9 * self.value.abs()
            && !printed_alike
            && !self.is_shortest_of(single)
    }

    /// Returns true if the number is the shortest text that distinguishes this `f32` from its neighbours: at
    /// a few powers of two, whose lower neighbour is closer than the upper one, that is not the nearest
    /// number with this many digits.
    #[cold]
    fn is_shortest_of(&self, single: f32) -> bool {
        format!("{single:e}").parse() == Ok(self.value)
    }
}

/// Numbers of fewer digits than this need no `f64`: an `f32` distinguishes any two of them (except for some
/// numbers of seven digits, whose last digit is noise).
const MIN_F64_DIGITS: u32 = 8;

/// The smallest number with this many digits.
const MIN_F64_MANTISSA: u64 = 10u64.pow(MIN_F64_DIGITS - 1);

/// Reads the number at the start of `bytes` and returns it with its length; `None` if there is none.
///
/// Decimal notation with optional sign, point and exponent, `nan`, `inf` and `infinity` in any case. The
/// caller checks what follows.
#[inline]
pub(crate) fn parse_decimal(bytes: &[u8]) -> Option<(Decimal, usize)> {
    let mut at = 0;
    let negative = match bytes.first() {
        Some(b'-') => {
            at = 1;
            true
        }
        Some(b'+') => {
            at = 1;
            false
        }
        _ => false,
    };
    let start = at;
    let mut mantissa = 0u64;
    match bytes.get(at..) {
        // Most coordinates have one digit before the point.
        Some([digit @ b'0'..=b'9', b'.', ..]) => {
            mantissa = u64::from(digit - b'0');
            at += 1;
        }
        _ => at += digits(&bytes[at..], &mut mantissa),
    }
    let mut all = at - start;
    let mut exponent = 0i32;
    if bytes.get(at) == Some(&b'.') {
        at += 1;
        let places = digits(&bytes[at..], &mut mantissa);
        at += places;
        all += places;
        exponent = -i32::try_from(places).ok()?;
    }
    if all == 0 {
        return parse_special(bytes);
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (power, length) = power_of_ten(&bytes[at + 1..]);
        if length > 0 {
            at += 1 + length;
            exponent = exponent.saturating_add(power);
        }
    }
    // Nineteen digits fit 64 bits; if mantissa and power of ten are both exact doubles, the result is rounded
    // only once.
    let few = all <= 19;
    if few && mantissa < 1 << 53 && exponent.unsigned_abs() <= 22 {
        let power = EXACT_POWERS[exponent.unsigned_abs() as usize];
        let value = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
        let value = if negative { -value } else { value };
        return Some((Decimal { value, mantissa, written: all as u32, exponent }, at));
    }
    let text = &bytes[usize::from(bytes[0] == b'+')..at];
    let value = fast_float2::parse::<f64, _>(text).ok()?;
    let mantissa = if few { mantissa } else { u64::MAX };
    let written = u32::try_from(all).unwrap_or(u32::MAX);
    Some((Decimal { value, mantissa, written, exponent }, at))
}

/// Appends the digits at the start of `bytes` to a number, and returns their count. With more than 19 digits
/// (in total) the number is meaningless.
#[inline]
fn digits(bytes: &[u8], number: &mut u64) -> usize {
    let mut at = 0;
    // Eight at a time: one step suffices for most coordinates and indices.
    while let Some(eight) = bytes[at..].first_chunk::<8>() {
        let (value, count) = up_to_eight_digits(u64::from_le_bytes(*eight));
        *number = number.wrapping_mul(POWERS[count]).wrapping_add(value);
        at += count;
        if count < 8 {
            return at;
        }
    }
    while let Some(digit) = digit_at(bytes, at) {
        *number = number.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    at
}

const POWERS: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// Returns the value of the digits at the start of eight characters, the first of which is the lowest byte,
/// and their count.
///
/// Source: the idea of digits as lanes of one number is from [Lemire 2021]; the lanes are added in pairs, then fours,
/// then all eight.
#[inline]
fn up_to_eight_digits(characters: u64) -> (u64, usize) {
    let lanes = characters ^ 0x3030_3030_3030_3030;
    // A lane above 9 sets its high bit; its carry reaches only later lanes, which do not count any more.
    let strange = (lanes.wrapping_add(0x7676_7676_7676_7676) | lanes) & 0x8080_8080_8080_8080;
    let count = (strange.trailing_zeros() / 8) as usize;
    if count == 0 {
        return (0, 0);
    }
    // Zeros are shifted in as leading digits.
    let lanes = lanes << (64 - 8 * count);
    let pairs = (lanes.wrapping_mul(10)).wrapping_add(lanes >> 8) & 0x00ff_00ff_00ff_00ff;
    let fours = (pairs.wrapping_mul(100)).wrapping_add(pairs >> 16) & 0x0000_ffff_0000_ffff;
    let all = (fours.wrapping_mul(10_000)).wrapping_add(fours >> 32) & 0xffff_ffff;
    (all, count)
}

#[inline]
fn digit_at(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

#[inline]
fn digit_count(mantissa: u64) -> u32 {
    mantissa.checked_ilog10().map_or(0, |n| n + 1)
}

/// Returns the exponent after an `e`, and its length; zeros if there are no digits.
fn power_of_ten(bytes: &[u8]) -> (i32, usize) {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let (mut power, mut at) = (0i32, start);
    while let Some(digit) = digit_at(bytes, at) {
        power = power.saturating_mul(10).saturating_add(digit as i32);
        at += 1;
    }
    if at == start { (0, 0) } else { (if negative { -power } else { power }, at) }
}

#[cold]
fn parse_special(bytes: &[u8]) -> Option<(Decimal, usize)> {
    let start = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let word = &bytes[start..];
    let begins = |name: &str| word.get(..name.len()).is_some_and(|w| w.eq_ignore_ascii_case(name.as_bytes()));
    let (value, length) = [("infinity", f64::INFINITY), ("inf", f64::INFINITY), ("nan", f64::NAN)]
        .into_iter()
        .find(|(name, _)| begins(name))
        .map(|(name, value)| (value, name.len()))?;
    let value = if bytes[0] == b'-' { -value } else { value };
    Some((Decimal::non_number(value), start + length))
}

/// Returns the value of a word as the C library of Windows prints what is no number: `-nan(ind)`, `1.#QNAN`, `-1.#IND`,
/// `1.#INF`; also `nan` and `inf`.
#[cold]
pub(crate) fn parse_non_number(word: &[u8]) -> Option<f64> {
    let bare = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
    let begins = |name: &str| bare.get(..name.len()).is_some_and(|w| w.eq_ignore_ascii_case(name.as_bytes()));
    if begins("1.#inf") || begins("inf") {
        Some(if word[0] == b'-' { f64::NEG_INFINITY } else { f64::INFINITY })
    } else if begins("1.#") || begins("nan") {
        Some(f64::NAN)
    } else {
        None
    }
}

/// Powers of ten that are exact in double precision.
const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Reads the integer at the start of `bytes` and returns it with its length; `None` if there is none. Numbers
/// too large for an index saturate.
#[inline]
pub(crate) fn parse_integer(bytes: &[u8]) -> Option<(i64, usize)> {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(negative || bytes.first() == Some(&b'+'));
    let mut value = 0u64;
    let at = start + digits(&bytes[start..], &mut value);
    if at == start {
        return None;
    }
    let value = if at - start > 18 { saturated(&bytes[start..at]) } else { value as i64 };
    Some((if negative { -value } else { value }, at))
}

/// Reads an integer without a sign and of at most seven digits; `None` for any other number, or near the end
/// of the bytes. A faster [`whole`] for most indices.
#[inline(always)]
pub(crate) fn parse_short_integer(bytes: &[u8]) -> Option<(u32, usize)> {
    let (value, count) = up_to_eight_digits(u64::from_le_bytes(*bytes.first_chunk::<8>()?));
    // Seven digits fit 32 bits.
    (1..8).contains(&count).then_some((value as u32, count))
}

#[cold]
fn saturated(digits: &[u8]) -> i64 {
    digits.iter().fold(0i64, |v, d| v.saturating_mul(10).saturating_add(i64::from(d - b'0')))
}

/// A buffered text writer for numbers and words.
pub(crate) struct TextOut<'a> {
    buffer: Vec<u8>,
    out: &'a mut dyn Write,
    whole: itoa::Buffer,
    decimal: zmij::Buffer,
}

impl<'a> TextOut<'a> {
    pub(crate) fn new(out: &'a mut dyn Write) -> Self {
        let buffer = Vec::with_capacity(BUFFER + BUFFER / 4);
        Self { buffer, out, whole: itoa::Buffer::new(), decimal: zmij::Buffer::new() }
    }
    pub(crate) fn text(&mut self, text: &str) {
        self.buffer.extend_from_slice(text.as_bytes());
    }
    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }
    pub(crate) fn byte(&mut self, byte: u8) {
        self.buffer.push(byte);
    }
    pub(crate) fn parse_integer(&mut self, number: impl itoa::Integer) {
        self.buffer.extend_from_slice(self.whole.format(number).as_bytes());
    }
    /// Writes the shortest decimal that reads back as the same number.
    pub(crate) fn parse_decimal(&mut self, number: impl zmij::Float) {
        let text = self.decimal.format(number);
        self.buffer.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes());
    }
    /// Writes numbers, each after a blank.
    pub(crate) fn decimals(&mut self, numbers: impl IntoIterator<Item = impl zmij::Float>) {
        for number in numbers {
            self.byte(b' ');
            self.parse_decimal(number);
        }
    }
    /// Ends a line.
    pub(crate) fn end_line(&mut self) -> io::Result<()> {
        self.buffer.push(b'\n');
        if self.buffer.len() >= BUFFER { self.finish() } else { Ok(()) }
    }
    /// Flushes the buffer.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.out.write_all(&self.buffer)?;
        self.buffer.clear();
        Ok(())
    }
}

/// Size of the buffer in bytes. Guessed.
const BUFFER: usize = 1 << 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Option<(f64, usize)> {
        parse_decimal(text.as_bytes()).map(|(d, n)| (d.value, n))
    }

    #[test]
    fn every_spelling_is_read() {
        for (text, wanted) in [
            ("0", 0.0),
            ("2.", 2.0),
            (".5", 0.5),
            ("+3.0", 3.0),
            ("-2.e1", -20.0),
            ("3.1E2", 310.0),
            ("1e+2", 100.0),
            ("2.e-1", 0.2),
            ("2.e01", 20.0),
            ("0.1", 0.1),
            ("-5.257311121191337e-16", -5.257311121191337e-16),
            ("+850650808352040.12345678901234567890", 850650808352040.1),
            ("123456789012345678901234567890", 123456789012345678901234567890.0),
            ("1e400", f64::INFINITY),
            ("1e-400", 0.0),
            ("1e99999999999999", f64::INFINITY),
            ("-inf", f64::NEG_INFINITY),
            ("Infinity", f64::INFINITY),
        ] {
            assert_eq!(value(text), Some((wanted, text.len())), "{text}");
        }
        assert!(value("NaN").is_some_and(|(v, n)| v.is_nan() && n == 3));
        assert!(value("-nan").is_some_and(|(v, n)| v.is_nan() && n == 4));
    }

    #[test]
    fn other_text_is_none_and_the_rest_is_not_consumed() {
        for text in ["", "-", "+", ".", "abc", "e5", "-e5"] {
            assert_eq!(value(text), None, "{text}");
        }
        assert_eq!(value("3.1+e2"), Some((3.1, 3)));
        assert_eq!(value("3e"), Some((3.0, 1)));
        assert_eq!(value("3e+ 1"), Some((3.0, 1)));
        assert_eq!(value("1 2"), Some((1.0, 1)));
    }

    #[test]
    fn rounding_is_that_of_the_standard_library() {
        let mut state = 0x2545_f491_4f6c_dd1d_u64;
        for _ in 0..20_000 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let number = f64::from_bits(state);
            if !number.is_finite() {
                continue;
            }
            for text in
                [format!("{number}"), format!("{number:e}"), format!("{:.6}", (state >> 40) as f64 / 1e3)]
            {
                assert_eq!(value(&text), Some((text.parse().unwrap(), text.len())), "{text}");
            }
        }
    }

    #[test]
    fn only_digits_that_an_f32_cannot_hold_need_f64() {
        let needs = |text: &str| parse_decimal(text.as_bytes()).unwrap().0.needs_f64();
        for text in [
            "0.1",
            "1.234567",
            "100000",
            "1e20",
            "0",
            "-0.0",
            "nan",
            "inf",
            "0.5000000000",
            "16777216",
            "1e-42",
        ] {
            assert!(!needs(text), "{text}");
        }
        for text in [
            "0.5257311121191336",
            "500000.123",
            "16777217",
            "1e300",
            "1e-300",
            "1.2345678e-42",
            "1e-46",
            "123456789.5",
            "123456789.0",
            "123456789.000000000000000000000",
        ] {
            assert!(needs(text), "{text}");
        }
        // Found by fuzzing: 1.2379401e27 is 2^90, although 1.2379400e27 is nearer; and subnormal numbers,
        // which have few digits.
        let powers = (1u32..255).map(|exponent| exponent << 23);
        for bits in powers.chain((1..1 << 23).step_by(1009)).chain((0..23).map(|bit| 1 << bit)) {
            let number = f32::from_bits(bits);
            for text in [format!("{number}"), format!("{number:e}"), format!("{number:.8e}")] {
                assert!(!needs(&text), "{text}");
            }
        }
        // Any f32, in any common notation.
        for bits in (0x3000_0000u32..0x5000_0000).step_by(104_729) {
            let number = f32::from_bits(bits);
            for text in [
                format!("{number}"),
                format!("{number:.8e}"),
                format!("{number:.6}"),
                format!("{:.17}", f64::from(number)),
                format!("{:e}", f64::from(number)),
            ] {
                assert!(!needs(&text), "{text}");
            }
        }
    }

    #[test]
    fn whole_numbers_saturate() {
        assert_eq!(parse_integer(b"-12/3"), Some((-12, 3)));
        assert_eq!(parse_integer(b"+7 "), Some((7, 2)));
        assert_eq!(parse_integer(b"353535235358"), Some((353_535_235_358, 12)));
        assert_eq!(parse_integer(b"99999999999999999999999"), Some((i64::MAX, 23)));
        assert_eq!(parse_integer(b"-99999999999999999999999"), Some((-i64::MAX, 24)));
        assert_eq!(parse_short_integer(b"1234567 "), Some((1_234_567, 7)));
        assert_eq!(parse_short_integer(b"12/34 56"), Some((12, 2)));
        assert_eq!(
            (
                parse_short_integer(b"12345678 "),
                parse_short_integer(b"-2345678"),
                parse_short_integer(b"1 2")
            ),
            (None, None, None)
        );
        assert_eq!(parse_integer(b"-"), None);
        assert_eq!(parse_integer(b"x"), None);
    }

    #[test]
    fn what_is_no_number_is_read_in_every_spelling() {
        for word in ["nan", "-nan(ind)", "-nan", "1.#QNAN", "-1.#IND", "1.#SNAN"] {
            assert!(parse_non_number(word.as_bytes()).unwrap().is_nan(), "{word}");
        }
        assert_eq!(parse_non_number(b"-1.#INF"), Some(f64::NEG_INFINITY));
        assert_eq!(parse_non_number(b"inf"), Some(f64::INFINITY));
        assert_eq!([&b""[..], b"-", b"x", b"1.0#"].map(parse_non_number), [None; 4]);
    }

    #[test]
    fn written_numbers_read_back_the_same() {
        let mut bytes = Vec::new();
        let mut out = TextOut::new(&mut bytes);
        out.decimals([0.1f32, 1.0, -2.5e-7, 1e20]);
        out.decimals([0.1f64, 123456.789012345]);
        out.end_line().unwrap();
        out.finish().unwrap();
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.starts_with(" 0.1 1 -2.5e-7 "), "{text}");
        let singles: Vec<f32> = text.split_whitespace().take(4).map(|w| w.parse().unwrap()).collect();
        assert_eq!(singles, [0.1, 1.0, -2.5e-7, 1e20]);
        assert!(text.trim_end().ends_with("0.1 123456.789012345"), "{text}");
    }
}
