//! Encoders of index streams: triangles with local coherence, and plain sequences.

use super::indices::{Latest, SEQUENCE, TRIANGLES};
use super::input::unzigzag;

/// Number of pairs of corners that a code alone can name.
const TABLE_LENGTH: usize = 14;

/// Appends a number in groups of seven bits, the lowest first.
fn number(mut n: u32, out: &mut Vec<u8>) {
    while n > 0x7f {
        out.push(n as u8 | 0x80);
        n >>= 7;
    }
    out.push(n as u8);
}

/// State of the encoder between triangles.
struct TriangleEncoder {
    codes: Vec<Code>,
    /// Explicit indices, each with the number of codes before it.
    data: Vec<u8>,
    edges: Latest<[u32; 2]>,
    vertices: Latest<u32>,
    next: u32,
    last: u32,
}

/// Code of a triangle; the explicit indices of each are the bytes of the data up to `data_end`.
struct Code {
    kind: CodeKind,
    data_end: usize,
}

enum CodeKind {
    /// Adjacent to one of the latest edges.
    Beside(u8),
    /// The first corner is fresh or not; codes of the two others. With `restarts`, fresh indices start at 0.
    Alone { is_fresh: bool, others: u8, restarts: bool },
}

impl TriangleEncoder {
    fn explicit(&mut self, index: u32) {
        number(unzigzag(index.wrapping_sub(self.last)), &mut self.data);
        self.last = index;
    }

    /// Returns true and counts on if the index is the next fresh one.
    fn is_fresh(&mut self, index: u32) -> bool {
        let is_next = index == self.next;
        self.next = self.next.wrapping_add(u32::from(is_next));
        is_next
    }

    fn triangle(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle;
        let turned = [[a, b, c], [b, c, a], [c, a, b]];
        // The edge with the lowest number; with equal ones, the first corner.
        let known = turned.iter().filter_map(|t| Some((self.edges.position([t[0], t[1]])?, *t)));
        match known.min_by_key(|(edge, _)| *edge).filter(|(edge, _)| *edge < 15) {
            Some((edge, triangle)) => self.beside(edge, triangle),
            None => {
                let first = turned.iter().find(|t| t[0] == self.next).unwrap_or(&turned[0]);
                self.alone(*first);
            }
        }
    }

    fn beside(&mut self, edge: u8, [a, b, c]: [u32; 3]) {
        let latest = self.vertices.position(c).filter(|n| (1..=12).contains(n));
        let third = match latest {
            Some(n) => n,
            None if self.is_fresh(c) => 0,
            None if c == self.last.wrapping_sub(1) => 13,
            None if c == self.last.wrapping_add(1) => 14,
            None => 15,
        };
        match third {
            13 | 14 => self.last = c,
            15 => self.explicit(c),
            _ => {}
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if latest.is_none() {
            self.vertices.push(c);
        }
        self.code(CodeKind::Beside(edge << 4 | third));
    }

    fn alone(&mut self, triangle: [u32; 3]) {
        let restarts = triangle == [0, 1, 2] && self.next > 0;
        if restarts {
            self.next = 0;
            // Vertices of another mesh would be mistaken for vertices of this mesh.
            self.vertices = Latest::new();
        }
        let mut codes = [0; 3];
        for (k, index) in triangle.into_iter().enumerate() {
            let latest = self.vertices.position(index).filter(|n| *n < 14 && k > 0);
            codes[k] = match latest {
                Some(n) => n + 1,
                None if self.is_fresh(index) => 0,
                None => 15,
            };
        }
        for (index, _) in triangle.into_iter().zip(codes).filter(|(_, code)| *code == 15) {
            self.explicit(index);
        }
        let [a, b, c] = triangle;
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
        for (index, _) in triangle.into_iter().zip(codes).filter(|(_, code)| matches!(code, 0 | 15)) {
            self.vertices.push(index);
        }
        let [first, b, c] = codes;
        self.code(CodeKind::Alone { is_fresh: first == 0, others: b << 4 | c, restarts });
    }

    fn code(&mut self, kind: CodeKind) {
        self.codes.push(Code { kind, data_end: self.data.len() });
    }

    /// Returns the pairs of corners that occur most often behind a fresh one, in the order of their numbers.
    fn table(&self) -> [u8; 16] {
        let mut counts = [0usize; 256];
        for code in &self.codes {
            if let CodeKind::Alone { is_fresh: true, others, restarts: false } = code.kind
                && others >> 4 != 15
                && others & 15 != 15
            {
                counts[usize::from(others)] += 1;
            }
        }
        // Outside the table, this pair would mean that fresh indices start again.
        counts[0] = usize::MAX;
        let mut all: Vec<u8> = (0..=255).filter(|pair| counts[usize::from(*pair)] > 0).collect();
        all.sort_by_key(|pair| (std::cmp::Reverse(counts[usize::from(*pair)]), *pair));
        let mut table = [0; 16];
        table.iter_mut().zip(all).take(TABLE_LENGTH).for_each(|(entry, pair)| *entry = pair);
        table
    }
}

/// Encodes triangles. The first corner of each may change, their winding and order stay.
pub(super) fn triangles(indices: &[u32]) -> Vec<u8> {
    let mut state = TriangleEncoder {
        codes: Vec::with_capacity(indices.len() / 3),
        data: Vec::new(),
        edges: Latest::new(),
        vertices: Latest::new(),
        next: 0,
        last: 0,
    };
    indices.as_chunks::<3>().0.iter().for_each(|triangle| state.triangle(*triangle));
    let table = state.table();
    let (mut codes, mut data) = (vec![TRIANGLES], Vec::new());
    let mut from = 0;
    for Code { kind, data_end } in &state.codes {
        match *kind {
            CodeKind::Beside(code) => codes.push(code),
            CodeKind::Alone { is_fresh, others, restarts } => {
                let known = table[..TABLE_LENGTH].iter().position(|pair| *pair == others);
                match known.filter(|_| is_fresh && !restarts) {
                    Some(at) => codes.push(0xf0 | at as u8),
                    None => {
                        codes.push(if is_fresh { 0xfe } else { 0xff });
                        data.push(others);
                    }
                }
            }
        }
        data.extend_from_slice(&state.data[from..*data_end]);
        from = *data_end;
    }
    [codes.as_slice(), &data, &table].concat()
}

/// Encodes indices of any kind.
pub(super) fn sequence(indices: &[u32]) -> Vec<u8> {
    let mut out = vec![SEQUENCE];
    let mut last = [0u32; 2];
    let mut base = 0;
    // Guessed: a jump as long as this is worth a change of the base.
    const FAR: u32 = 30;
    for &index in indices {
        let distance = |base: u32| (index.wrapping_sub(base) as i32).unsigned_abs();
        if distance(last[base]) >= FAR && distance(last[1 - base]) < distance(last[base]) {
            base = 1 - base;
        }
        let difference = index.wrapping_sub(last[base]);
        // One bit of the difference gives way to the base.
        number(unzigzag(difference) << 1 | base as u32, &mut out);
        last[base] = index;
    }
    // Decoders may read that far behind the last number.
    out.extend([0; 4]);
    out
}
