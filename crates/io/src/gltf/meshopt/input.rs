//! Sequential reader of the bytes of a stream.

pub(super) const ENDS_TOO_EARLY: &str = "is cut off: its compressed bytes end too early";
pub(super) const BYTES_LEFT_OVER: &str = "is damaged: compressed bytes are left over";

/// Bytes of a stream that are still to be read.
pub(super) struct Input<'b> {
    pub(super) bytes: &'b [u8],
}

impl<'b> Input<'b> {
    pub(super) fn take(&mut self, count: usize) -> Result<&'b [u8], &'static str> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(ENDS_TOO_EARLY)?;
        self.bytes = rest;
        Ok(taken)
    }

    pub(super) fn byte(&mut self) -> Result<u8, &'static str> {
        let (&first, rest) = self.bytes.split_first().ok_or(ENDS_TOO_EARLY)?;
        self.bytes = rest;
        Ok(first)
    }

    /// Reads a number in groups of seven bits, the lowest first; bits beyond 32 are ignored.
    pub(super) fn number(&mut self) -> Result<u32, &'static str> {
        let mut number = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err("is damaged: an index has more than five bytes")
    }

    pub(super) fn end(self) -> Result<(), &'static str> {
        if self.bytes.is_empty() { Ok(()) } else { Err(BYTES_LEFT_OVER) }
    }
}

/// Decodes a signed difference from an unsigned number: 0, -1, 1, -2, 2 and so on.
pub(super) const fn zigzag(n: u32) -> u32 {
    (n >> 1) ^ (n & 1).wrapping_neg()
}

/// Encodes a signed difference as an unsigned number, the inverse of [`zigzag`].
pub(super) const fn unzigzag(n: u32) -> u32 {
    (n << 1) ^ ((n as i32) >> 31) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_seven_bits() {
        let read = |bytes: &[u8]| Input { bytes }.number();
        assert_eq!(read(&[0x7f]), Ok(0x7f));
        assert_eq!(read(&[0x81, 0x04]), Ok(0x201));
        assert_eq!(read(&[0xff, 0xa0, 0x05]), Ok(0x7f | 0x20 << 7 | 0x05 << 14));
        assert_eq!(
            read(&[0xff, 0xff, 0xff, 0xff, 0xff]),
            Err("is damaged: an index has more than five bytes")
        );
        assert_eq!(read(&[0x80]), Err(ENDS_TOO_EARLY));
    }

    #[test]
    fn differences() {
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|n| zigzag(n) as i32), [0, -1, 1, -2, i32::MIN]);
        assert!([0, 1, 2, 3, 1 << 31, u32::MAX].into_iter().all(|n| unzigzag(zigzag(n)) == n));
    }
}
