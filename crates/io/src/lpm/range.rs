//! Adaptive binary range coder.
//!
//! One function defines the coding in both directions: a [`Coder`] that writes returns the value that it is
//! given, one that reads returns the value in the bytes.

/// Error: the bytes are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Damaged(pub(super) &'static str);

pub(super) type Coded<T> = Result<T, Damaged>;

/// Adaptive probability that a bit is 0: the mean of a fast and a slow estimate, in 65536ths.
#[derive(Clone, Copy, Debug)]
pub(super) struct BitModel {
    fast: u16,
    slow: u16,
}

impl Default for BitModel {
    fn default() -> Self {
        Self { fast: 1 << 15, slow: 1 << 15 }
    }
}

// Guessed: the fast estimate soon adapts to a new mesh, the slow one is accurate in the long run.
const FAST_SHIFT: u32 = 5;
const SLOW_SHIFT: u32 = 7;

impl BitModel {
    /// Returns the probability in 4096ths; neither 0 nor 4096.
    fn probability(self) -> u32 {
        (u32::from(self.fast) + u32::from(self.slow)) >> 5
    }
    fn learn(&mut self, bit: bool) {
        if bit {
            self.fast -= self.fast >> FAST_SHIFT;
            self.slow -= self.slow >> SLOW_SHIFT;
        } else {
            self.fast += (u16::MAX - self.fast) >> FAST_SHIFT;
            self.slow += (u16::MAX - self.slow) >> SLOW_SHIFT;
        }
    }
}

/// Minimum of the range between two bits.
const MIN_RANGE: u32 = 1 << 24;
/// Maximum number of bits without a model that are coded at once.
const MAX_BITS_AT_ONCE: u32 = 12;

pub(super) trait Coder {
    /// Codes a bit with its model.
    fn bit(&mut self, model: &mut BitModel, bit: bool) -> Coded<bool>;
    /// Codes up to [`MAX_BITS_AT_ONCE`] bits without a model.
    fn bits_at_once(&mut self, value: u32, bits: u32) -> Coded<u32>;

    /// Codes any number of bits without a model, the highest first.
    fn raw_bits(&mut self, value: u64, bits: u32) -> Coded<u64> {
        let (mut left, mut got) = (bits, 0);
        while left > 0 {
            let now = left.min(MAX_BITS_AT_ONCE);
            left -= now;
            let part = (value >> left) as u32 & ((1 << now) - 1);
            got = got << now | u64::from(self.bits_at_once(part, now)?);
        }
        Ok(got)
    }
    /// Codes a number of `bits` bits, the highest first; `models` has one entry for each such number.
    fn tree(&mut self, models: &mut [BitModel], bits: u32, value: u32) -> Coded<u32> {
        let mut node = 1;
        for i in (0..bits).rev() {
            let bit = self.bit(&mut models[node], value >> i & 1 == 1)?;
            node = node << 1 | usize::from(bit);
        }
        Ok(node as u32 - (1 << bits))
    }
    /// Codes a number of any size, small ones in fewer bits.
    fn number(&mut self, model: &mut NumberModel, value: u64) -> Coded<u64> {
        let size = self.tree(&mut model.size, 7, u64::BITS - value.leading_zeros())?;
        if size < 2 {
            return Ok(u64::from(size));
        }
        let Some(high) = model.high.get_mut(size as usize) else {
            return Err(Damaged("a number of more than 64 bits"));
        };
        let below = size - 1;
        let modelled = below.min(2);
        let rest = below - modelled;
        let top = self.tree(high, modelled, (value >> rest) as u32 & ((1 << modelled) - 1))?;
        let low = self.raw_bits(value & ((1 << rest) - 1), rest)?;
        Ok((1 << modelled | u64::from(top)) << rest | low)
    }
    /// Codes a signed number.
    fn signed(&mut self, model: &mut NumberModel, value: i64) -> Coded<i64> {
        let size = self.number(model, value.unsigned_abs())?;
        if size == 0 {
            return Ok(0);
        }
        let is_negative = self.bit(&mut model.sign, value < 0)?;
        Ok(if is_negative { (size as i64).wrapping_neg() } else { size as i64 })
    }
    /// Codes a number below a count.
    fn below(&mut self, model: &mut BelowModel, count: u32, value: u32) -> Coded<u32> {
        if count < 2 {
            return if count == 1 { Ok(0) } else { Err(Damaged("an element is named where there is none")) };
        }
        let bits = u32::BITS - (count - 1).leading_zeros();
        let modelled = bits.min(8);
        let rest = bits - modelled;
        let top = self.tree(&mut model.0, modelled, value >> rest)?;
        let low = self.raw_bits(u64::from(value) & ((1 << rest) - 1), rest)? as u32;
        let got = top << rest | low;
        if got < count { Ok(got) } else { Err(Damaged("an element is named that is not there")) }
    }
    /// Codes a count of items, each of which is coded in the bytes.
    fn count(&mut self, model: &mut NumberModel, count: usize) -> Coded<usize> {
        let count = self.number(model, count as u64)?;
        if count < u64::from(u32::MAX) {
            Ok(count as usize)
        } else {
            Err(Damaged("a count beyond all bounds"))
        }
    }
}

/// Model of numbers: their number of bits, and the two bits below the highest.
#[derive(Clone, Debug)]
pub(super) struct NumberModel {
    size: [BitModel; 128],
    high: [[BitModel; 4]; 65],
    sign: BitModel,
}

impl Default for NumberModel {
    fn default() -> Self {
        Self {
            size: [BitModel::default(); 128],
            high: [[BitModel::default(); 4]; 65],
            sign: BitModel::default(),
        }
    }
}

/// Model of numbers below a count: their highest eight bits.
#[derive(Clone, Debug)]
pub(super) struct BelowModel([BitModel; 256]);

impl Default for BelowModel {
    fn default() -> Self {
        Self([BitModel::default(); 256])
    }
}

/// Coder that writes.
pub(super) struct Encoder {
    low: u64,
    range: u32,
    /// Number of bytes that a carry may still change: `last` and the 0xff behind it; none at the very start.
    pending: u64,
    last: u8,
    out: Vec<u8>,
}

impl Encoder {
    pub(super) fn new() -> Self {
        Self { low: 0, range: u32::MAX, pending: 0, last: 0, out: Vec::new() }
    }
    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > 0xffff_ffff {
            let carry = (self.low >> 32) as u8;
            for i in 0..self.pending {
                let byte = if i == 0 { self.last } else { 0xff };
                self.out.push(byte.wrapping_add(carry));
            }
            self.pending = 0;
            self.last = (self.low >> 24) as u8;
        }
        self.pending += 1;
        self.low = (self.low & 0x00ff_ffff) << 8;
    }
    fn renormalize(&mut self) {
        while self.range < MIN_RANGE {
            self.range <<= 8;
            self.shift();
        }
    }
    /// Flushes the coder; returns the bytes.
    pub(super) fn finish(mut self) -> Vec<u8> {
        (0..5).for_each(|_| self.shift());
        self.out
    }
}

impl Coder for Encoder {
    fn bit(&mut self, model: &mut BitModel, bit: bool) -> Coded<bool> {
        let bound = (self.range >> 12) * model.probability();
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        self.renormalize();
        Ok(bit)
    }
    fn bits_at_once(&mut self, value: u32, bits: u32) -> Coded<u32> {
        self.range >>= bits;
        self.low += u64::from(self.range) * u64::from(value);
        self.renormalize();
        Ok(value)
    }
}

/// Coder that reads.
pub(super) struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: std::slice::Iter<'a, u8>,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Coded<Self> {
        let mut decoder = Self { code: 0, range: u32::MAX, bytes: bytes.iter() };
        for _ in 0..4 {
            decoder.shift()?;
        }
        Ok(decoder)
    }
    fn shift(&mut self) -> Coded<()> {
        let Some(byte) = self.bytes.next() else { return Err(Damaged("more is said than there are bytes")) };
        self.code = self.code << 8 | u32::from(*byte);
        Ok(())
    }
    fn renormalize(&mut self) -> Coded<()> {
        while self.range < MIN_RANGE {
            self.range <<= 8;
            self.shift()?;
        }
        Ok(())
    }
    /// Returns true if no bytes are left.
    pub(super) fn is_at_end(&self) -> bool {
        self.bytes.len() == 0
    }
}

impl Coder for Decoder<'_> {
    fn bit(&mut self, model: &mut BitModel, _: bool) -> Coded<bool> {
        let bound = (self.range >> 12) * model.probability();
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        self.renormalize()?;
        Ok(bit)
    }
    fn bits_at_once(&mut self, _: u32, bits: u32) -> Coded<u32> {
        self.range >>= bits;
        let value = (self.code / self.range).min((1 << bits) - 1);
        self.code -= value * self.range;
        self.renormalize()?;
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(coder: &mut impl Coder, wanted: &[i64]) -> Coded<Vec<i64>> {
        let (mut number, mut below, mut tree) =
            (NumberModel::default(), BelowModel::default(), [BitModel::default(); 8]);
        let mut got = Vec::new();
        for &n in wanted {
            let n = coder.signed(&mut number, n)?;
            let m = coder.below(&mut below, 1000, (n as u64 % 1000) as u32)?;
            let t = coder.tree(&mut tree, 3, (n & 7) as u32)?;
            assert_eq!((u64::from(m), i64::from(t)), (n as u64 % 1000, n & 7));
            got.push(n);
        }
        Ok(got)
    }

    #[test]
    fn what_is_written_is_read() {
        let mut wanted: Vec<i64> = (0..64).flat_map(|i| [1 << i, -(1i64 << (i % 63)), i, -i]).collect();
        wanted.extend([i64::MIN, i64::MAX, 0, 0, 0]);
        // Carries through long runs of 0xff are rare.
        wanted.extend((0..50_000i64).map(|i| (i * i * 2_654_435_761) % 977 - 400));
        let mut encoder = Encoder::new();
        all(&mut encoder, &wanted).unwrap();
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes).unwrap();
        assert_eq!(all(&mut decoder, &wanted).unwrap(), wanted);
        assert!(decoder.is_at_end());
    }

    #[test]
    fn bytes_that_end_too_early_are_no_numbers() {
        let mut encoder = Encoder::new();
        let wanted: Vec<i64> = (0..100).map(|i| i * i).collect();
        all(&mut encoder, &wanted).unwrap();
        let bytes = encoder.finish();
        let cut = &bytes[..bytes.len() / 2];
        let mut decoder = Decoder::new(cut).unwrap();
        let (mut number, mut read) = (NumberModel::default(), 0);
        while decoder.signed(&mut number, 0).is_ok() {
            read += 1;
            assert!(read < 100_000);
        }
        assert!(Decoder::new(&[1, 2, 3]).is_err());
    }

    #[test]
    fn what_is_likely_is_cheap() {
        let mut encoder = Encoder::new();
        let mut model = BitModel::default();
        for i in 0..10_000 {
            encoder.bit(&mut model, i % 100 == 0).unwrap();
        }
        // The entropy is 0.081 bit each, which makes 101 bytes.
        let size = encoder.finish().len();
        assert!((80..140).contains(&size), "{size}");
    }
}
