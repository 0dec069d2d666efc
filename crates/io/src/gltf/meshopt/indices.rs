//! Decoders of index streams: triangles with local coherence, and plain sequences.

use super::input::{ENDS_TOO_EARLY, Input, zigzag};

/// First byte of a stream of triangles.
pub(super) const TRIANGLES: u8 = 0xe1;
/// First byte of a stream of indices of any kind.
pub(super) const SEQUENCE: u8 = 0xd1;

/// Number of entries of a history.
const HISTORY_LENGTH: usize = 16;

const BAD_REFERENCE: &str = "is damaged: a triangle refers to more than came before it";

/// History of the last sixteen entries.
pub(super) struct Latest<T> {
    entries: [Option<T>; HISTORY_LENGTH],
    next: usize,
}

impl<T: Copy + PartialEq> Latest<T> {
    pub(super) const fn new() -> Self {
        Self { entries: [None; HISTORY_LENGTH], next: 0 }
    }

    pub(super) fn push(&mut self, entry: T) {
        self.entries[self.next] = Some(entry);
        self.next = (self.next + 1) % HISTORY_LENGTH;
    }

    /// Returns the number of steps from the latest entry back to one that equals this.
    pub(super) fn position(&self, entry: T) -> Option<u8> {
        let back =
            |n: u8| self.entries[(self.next + 2 * HISTORY_LENGTH - 1 - usize::from(n)) % HISTORY_LENGTH];
        (0..HISTORY_LENGTH as u8).find(|n| back(*n) == Some(entry))
    }

    /// Returns the entry `back` steps before the latest.
    fn get(&self, back: u8) -> Result<T, &'static str> {
        let at = (self.next + 2 * HISTORY_LENGTH - 1 - usize::from(back)) % HISTORY_LENGTH;
        self.entries[at].ok_or(BAD_REFERENCE)
    }
}

/// State of the decoder between triangles.
struct TriangleDecoder<'b> {
    data: Input<'b>,
    edges: Latest<[u32; 2]>,
    vertices: Latest<u32>,
    /// First index that has not been used.
    next: u32,
    /// Last explicit index.
    last: u32,
}

impl TriangleDecoder<'_> {
    fn fresh(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn explicit(&mut self) -> Result<u32, &'static str> {
        self.last = self.last.wrapping_add(zigzag(self.data.number()?));
        Ok(self.last)
    }

    /// Decodes a corner: a fresh index for 0, an explicit one for 15, else one of the latest vertices. Also
    /// returns true if it is not one of these.
    fn corner(&mut self, code: u8) -> Result<(u32, bool), &'static str> {
        Ok(match code {
            0 => (self.fresh(), true),
            15 => (self.explicit()?, true),
            n => (self.vertices.get(n - 1)?, false),
        })
    }

    /// Decodes a triangle adjacent to one of the latest edges.
    fn beside(&mut self, edge: u8, code: u8) -> Result<[u32; 3], &'static str> {
        let [a, b] = self.edges.get(edge)?;
        let (c, is_new) = match code {
            0 => (self.fresh(), true),
            1..=12 => (self.vertices.get(code)?, false),
            15 => (self.explicit()?, true),
            near => {
                let step = if near == 13 { u32::MAX } else { 1 };
                self.last = self.last.wrapping_add(step);
                (self.last, true)
            }
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// Decodes a triangle whose first corner is fresh or explicit.
    fn alone(&mut self, first: u8, others: u8) -> Result<[u32; 3], &'static str> {
        let (a, _) = self.corner(first)?;
        let (b, b_is_new) = self.corner(others >> 4)?;
        let (c, c_is_new) = self.corner(others & 15)?;
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
        for (corner, _) in [(a, true), (b, b_is_new), (c, c_is_new)].into_iter().filter(|(_, is_new)| *is_new)
        {
            self.vertices.push(corner);
        }
        Ok([a, b, c])
    }
}

/// Decodes the indices of `count` triangles.
pub(super) fn triangles(stream: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    let (codes, rest) = after_header(stream, TRIANGLES)?.split_at_checked(count).ok_or(ENDS_TOO_EARLY)?;
    let (data, table) = rest.split_last_chunk::<16>().ok_or(ENDS_TOO_EARLY)?;
    if table[14..] != [0, 0] || table.iter().any(|t| t >> 4 == 15 || t & 15 == 15) {
        return Err("is damaged: the table at the end of its compressed bytes is invalid");
    }
    let mut state = TriangleDecoder {
        data: Input { bytes: data },
        edges: Latest::new(),
        vertices: Latest::new(),
        next: 0,
        last: 0,
    };
    let mut out = Vec::with_capacity(3 * codes.len());
    for code in codes {
        let triangle = match (code >> 4, code & 15) {
            (15, how @ 14..) => {
                let others = state.data.byte()?;
                if others == 0 {
                    state.next = 0;
                }
                state.alone(if how == 14 { 0 } else { 15 }, others)?
            }
            (15, at) => state.alone(0, table[usize::from(at)])?,
            (edge, third) => state.beside(edge, third)?,
        };
        out.extend(triangle);
    }
    state.data.end()?;
    Ok(out)
}

/// Decodes `count` indices of any kind.
pub(super) fn sequence(stream: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    // Trailing zeros let a decoder read past the end.
    let (body, _) = after_header(stream, SEQUENCE)?.split_last_chunk::<4>().ok_or(ENDS_TOO_EARLY)?;
    if count > body.len() {
        return Err(ENDS_TOO_EARLY);
    }
    let mut input = Input { bytes: body };
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let number = input.number()?;
        let base = &mut last[(number & 1) as usize];
        *base = base.wrapping_add(zigzag(number >> 1));
        out.push(*base);
    }
    input.end()?;
    Ok(out)
}

fn after_header(stream: &[u8], header: u8) -> Result<&[u8], &'static str> {
    match stream.split_first() {
        Some((first, rest)) if *first == header => Ok(rest),
        Some(_) => Err("is damaged: its compressed bytes begin with an unknown version"),
        None => Err(ENDS_TOO_EARLY),
    }
}

#[cfg(test)]
mod tests {
    use super::super::input::BYTES_LEFT_OVER;
    use super::*;

    fn stream(codes: &[u8], data: &[u8]) -> Vec<u8> {
        let mut table = [0u8; 16];
        table[1] = 0x10;
        [&[0xe1], codes, data, &table].concat()
    }

    #[test]
    fn triangles_of_all_kinds() {
        let codes = [
            0xf0, // three fresh ones: 0 1 2
            0x00, // adjacent to the edge (0, 2), fresh 3: the edges (3, 2) and (0, 3)
            0x02, // adjacent to (0, 3), the third of the latest vertices: 1
            0xf1, // fresh 4, the latest vertex 3, fresh 5
            0x0f, // adjacent to (4, 5), explicit 20
            0x0d, // adjacent to (4, 20), 19
            0x0e, // adjacent to (4, 19), 20
            0xfe, // codes from the data: fresh 6, explicit 7, the second latest vertex: 19
            0xff, // explicit 9, and fresh indices start again: 0, 1
        ];
        let data = [40, 0xf2, 25, 0x00, 4];
        let got = triangles(&stream(&codes, &data), codes.len()).unwrap();
        let wanted = [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 1],
            [4, 3, 5],
            [4, 5, 20],
            [4, 20, 19],
            [4, 19, 20],
            [6, 7, 19],
            [9, 0, 1],
        ];
        assert_eq!(got, wanted.as_flattened());
    }

    #[test]
    fn references_to_missing_entries_are_errors() {
        for codes in [&[0x00][..], &[0xf1], &[0xf0, 0x30], &[0xf0, 0x04]] {
            assert_eq!(triangles(&stream(codes, &[]), codes.len()), Err(BAD_REFERENCE), "{codes:x?}");
        }
    }

    #[test]
    fn too_short_and_too_long() {
        let whole = stream(&[0xf0, 0x0f], &[4]);
        assert_eq!(triangles(&whole, 2).unwrap(), [0, 1, 2, 0, 2, 2]);
        assert_eq!(triangles(&whole, usize::MAX), Err(ENDS_TOO_EARLY));
        assert!(triangles(&whole, 1).is_err());
        assert!((0..whole.len()).all(|end| triangles(&whole[..end], 2).is_err()));
        assert_eq!(triangles(&stream(&[0xf0], &[7]), 1), Err(BYTES_LEFT_OVER));
        let mut odd = whole;
        *odd.last_mut().unwrap() = 1;
        assert!(triangles(&odd, 2).unwrap_err().contains("table"));
    }

    #[test]
    fn two_sequences_in_one() {
        // 1000 above the second base, 3 and -2 above the first.
        let bytes = [0xd1, 0xa1, 0x1f, 0x0c, 0x06, 0, 0, 0, 0];
        assert_eq!(sequence(&bytes, 3).unwrap(), [1000, 3, 1]);
        assert_eq!(sequence(&bytes, 2), Err(BYTES_LEFT_OVER));
        assert_eq!(sequence(&bytes, 4), Err(ENDS_TOO_EARLY));
        assert!((0..bytes.len()).all(|end| sequence(&bytes[..end], 3).is_err()));
    }
}
