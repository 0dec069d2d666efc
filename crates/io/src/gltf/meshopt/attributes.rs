//! Decoder of attribute streams: elements of any kind, as differences of their bytes.
//!
//! ```text
//! stream = version, blocks, tail          tail = zeros, the element before the first, a mode for each channel (version 1)
//! block  = up to 256 elements, as many as 8192 bytes hold
//!        = controls (version 1), then for each byte of an element: 2 bits for each group of 16, then the groups
//! group  = 16 differences of 0, 1, 2, 4 or 8 bits; one with all bits set is a byte behind them
//! ```

use super::input::{ENDS_TOO_EARLY, Input, unzigzag, zigzag};

/// Elements of a group.
pub(super) const GROUP: usize = 16;
/// Maximum bytes of the elements of a block.
const BLOCK_BYTES: usize = 8192;
/// Maximum elements of a block.
const BLOCK_ELEMENTS: usize = 256;

/// Returns the number of elements of a block.
pub(super) fn block_elements(stride: usize) -> usize {
    (BLOCK_BYTES / stride / GROUP * GROUP).min(BLOCK_ELEMENTS)
}

/// Returns the numbers of bits that a group can have: in version 0, or under one of the first two controls
/// of version 1.
pub(super) const fn widths(control: Option<u8>) -> [u32; 4] {
    match control {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(_) => [1, 2, 4, 8],
    }
}

/// Encoding of the four bytes of a channel as differences.
#[derive(Clone, Copy)]
pub(super) enum Channel {
    Bytes,
    Words,
    /// XOR of 32 bits, rotated left by this many bits.
    Xor(u32),
}

/// Decodes `count` elements of `stride` bytes, a multiple of four up to 256.
pub(super) fn decode(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let (&header, rest) = stream.split_first().ok_or(ENDS_TOO_EARLY)?;
    let channels = stride / 4;
    let (modes_length, least_tail) = match header {
        0xa0 => (0, 32),
        0xa1 => (channels, 24),
        _ => return Err("is damaged: its compressed bytes begin with an unknown version"),
    };
    let tail = stride + modes_length;
    let body_length = rest.len().checked_sub(tail.max(least_tail)).ok_or(ENDS_TOO_EARLY)?;
    let mut input = Input { bytes: &rest[..body_length] };
    let (first, modes) = rest[rest.len() - tail..].split_at(stride);
    let mut before = first.to_vec();
    let modes = match header {
        0xa0 => vec![Channel::Bytes; channels],
        _ => modes.iter().map(|m| Channel::new(*m)).collect::<Result<_, _>>()?,
    };

    let most = block_elements(stride);
    let mut differences = vec![[0u8; BLOCK_ELEMENTS]; stride];
    let mut out = Vec::new();
    let mut left = count;
    while left > 0 {
        let elements = left.min(most);
        left -= elements;
        let controls = if header == 0xa0 { None } else { Some(input.take(channels)?) };
        for (k, plane) in differences.iter_mut().enumerate() {
            let plane = &mut plane[..elements.next_multiple_of(GROUP)];
            match controls.map(|c| c[k / 4] >> (k % 4 * 2) & 3) {
                Some(2) => plane.fill(0),
                Some(3) => plane[..elements].copy_from_slice(input.take(elements)?),
                control => groups(&mut input, widths(control), plane)?,
            }
        }
        let start = out.len();
        out.resize(start + elements * stride, 0);
        let channels = modes.iter().zip(differences.as_chunks::<4>().0).zip(before.as_chunks_mut::<4>().0);
        for (c, ((mode, planes), before)) in channels.enumerate() {
            for (i, element) in out[start..].chunks_exact_mut(stride).enumerate() {
                let difference = [0, 1, 2, 3].map(|k| planes[k][i]);
                *before = mode.after(*before, difference);
                element[4 * c..4 * c + 4].copy_from_slice(before);
            }
        }
    }
    input.end()?;
    Ok(out)
}

impl Channel {
    fn new(mode: u8) -> Result<Self, &'static str> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, turn) => Ok(Self::Xor(turn.into())),
            _ => Err("is damaged: a channel of its compressed bytes has an unknown mode"),
        }
    }

    /// Returns the number of the mode, the inverse of [`new`](Self::new).
    pub(super) const fn code(self) -> u8 {
        match self {
            Self::Bytes => 0,
            Self::Words => 1,
            Self::Xor(turn) => 2 | (turn as u8) << 4,
        }
    }

    /// Returns the difference of some bytes from the bytes before, the inverse of [`after`](Self::after).
    #[inline]
    pub(super) fn difference(self, before: [u8; 4], now: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => {
                [0, 1, 2, 3].map(|k| unzigzag(i32::from(now[k].wrapping_sub(before[k]) as i8) as u32) as u8)
            }
            Self::Words => {
                let [a, b] = [0, 2].map(|k| {
                    let [now, before] = [now, before].map(|n| i16::from_le_bytes([n[k], n[k + 1]]));
                    (unzigzag(i32::from(now.wrapping_sub(before)) as u32) as u16).to_le_bytes()
                });
                [a[0], a[1], b[0], b[1]]
            }
            Self::Xor(turn) => {
                (u32::from_le_bytes(before) ^ u32::from_le_bytes(now)).rotate_left(turn).to_le_bytes()
            }
        }
    }

    /// Returns the bytes that have this difference from the bytes before.
    #[inline]
    fn after(self, before: [u8; 4], difference: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => [0, 1, 2, 3].map(|k| before[k].wrapping_add(zigzag(difference[k].into()) as u8)),
            Self::Words => {
                let [a, b] = [0, 2].map(|k| {
                    let difference = u16::from_le_bytes([difference[k], difference[k + 1]]);
                    let before = u16::from_le_bytes([before[k], before[k + 1]]);
                    before.wrapping_add(zigzag(difference.into()) as u16).to_le_bytes()
                });
                [a[0], a[1], b[0], b[1]]
            }
            Self::Xor(turn) => {
                let difference = u32::from_le_bytes(difference).rotate_right(turn);
                (u32::from_le_bytes(before) ^ difference).to_le_bytes()
            }
        }
    }
}

/// Decodes the differences of one byte of the elements of a block; each group has one of these numbers of
/// bits.
fn groups(input: &mut Input<'_>, bits: [u32; 4], out: &mut [u8]) -> Result<(), &'static str> {
    let groups = out.as_chunks_mut::<GROUP>().0;
    let header = input.take(groups.len().div_ceil(4))?;
    for (i, group) in groups.iter_mut().enumerate() {
        match bits[usize::from(header[i / 4] >> (i % 4 * 2) & 3)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(input.take(GROUP)?),
            bits => short(input, bits, group)?,
        }
    }
    Ok(())
}

/// Decodes differences of 1, 2 or 4 bits; larger differences are stored after them.
fn short(input: &mut Input<'_>, bits: u32, group: &mut [u8; GROUP]) -> Result<(), &'static str> {
    let packed = input.take(GROUP / 8 * bits as usize)?;
    let per_byte = 8 / bits;
    let beyond = (1u8 << bits) - 1;
    for (i, difference) in (0u32..).zip(group.iter_mut()) {
        let place = i % per_byte;
        // Single bits start at the lowest bit, others at the highest.
        let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
        *difference = packed[(i / per_byte) as usize] >> shift & beyond;
        if *difference == beyond {
            *difference = input.byte()?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::input::BYTES_LEFT_OVER;
    use super::*;

    #[test]
    fn the_group_of_the_specification() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let mut group = [0; GROUP];
        let mut input = Input { bytes: &bytes };
        short(&mut input, 4, &mut group).unwrap();
        input.end().unwrap();
        let signed = group.map(|d| zigzag(d.into()) as i8);
        assert_eq!(signed, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn bits_from_both_ends() {
        let mut group = [9; GROUP];
        short(&mut Input { bytes: &[0b0000_0101, 0x80, 7, 8, 9] }, 1, &mut group).unwrap();
        assert_eq!(group, [7, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9]);
        short(&mut Input { bytes: &[0b0001_1011, 0, 0, 0, 77] }, 2, &mut group).unwrap();
        assert_eq!(group[..5], [0, 1, 2, 77, 0]);
    }

    /// A stream of version 1 with two elements of four bytes.
    fn two(mode: u8, controls: u8, body: &[u8]) -> Vec<u8> {
        let mut stream = vec![0xa1, controls];
        stream.extend_from_slice(body);
        stream.resize(stream.len() + 24 - 5, 0);
        stream.extend([1, 2, 0x80, 0xff, mode]);
        stream
    }

    #[test]
    fn channels() {
        // All four bytes are stored plainly, two differences each.
        let body = [2, 0, 0, 0, 1, 0, 4, 0];
        let bytes = decode(&two(0, 0xff, &body), 2, 4).unwrap();
        assert_eq!(bytes, [2, 2, 0x7f, 1, 2, 2, 0x7f, 1]);
        let words = decode(&two(1, 0xff, &body), 2, 4).unwrap();
        // 0x0201 + 1; 0xff80 - 0x0201, from the difference 0x0401.
        assert_eq!(words, [2, 2, 0x7f, 0xfd, 2, 2, 0x7f, 0xfd]);
        let xor = decode(&two(2, 0xff, &body), 2, 4).unwrap();
        assert_eq!(xor, [3, 2, 0x81, 0xfb, 3, 2, 0x81, 0xfb]);
        let turned = decode(&two(0x42, 0xff, &body), 2, 4).unwrap();
        // 0x0401_0002 rotated right by four bits is 0x2040_1000.
        assert_eq!(turned, [1, 0x12, 0xc0, 0xdf, 1, 0x12, 0xc0, 0xdf]);
        // Nothing stored at all.
        assert_eq!(decode(&two(0, 0b1010_1010, &[]), 2, 4).unwrap(), [1, 2, 0x80, 0xff, 1, 2, 0x80, 0xff]);
        for mode in [3, 0x10, 0x11, 0x0f] {
            assert!(decode(&two(mode, 0xff, &body), 2, 4).unwrap_err().contains("channel"));
        }
    }

    #[test]
    fn too_short_and_too_long() {
        let whole = two(0, 0xff, &[0; 8]);
        assert!(decode(&whole, 2, 4).is_ok());
        assert_eq!(decode(&whole, 1, 4), Err(BYTES_LEFT_OVER));
        assert_eq!(decode(&whole, 3, 4), Err(ENDS_TOO_EARLY));
        assert_eq!(decode(&whole, usize::MAX, 4), Err(ENDS_TOO_EARLY));
        for end in 0..whole.len() {
            assert!(decode(&whole[..end], 2, 4).is_err(), "{end}");
        }
        assert!(decode(&[0xa2; 60], 1, 4).unwrap_err().contains("version"));
    }
}
