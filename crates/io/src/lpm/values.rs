//! Positions and values as the integers in the file: floats by their rank, or steps of a grid.

use lodsmith_core::Positions;

/// Converts a float to its rank among all floats, and back.
pub(super) fn rank_f32(bits: i32) -> i32 {
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

pub(super) fn rank_f64(bits: i64) -> i64 {
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

pub(super) fn code_f32(x: f32) -> i32 {
    rank_f32(x.to_bits() as i32)
}

pub(super) fn value_f32(code: i32) -> f32 {
    f32::from_bits(rank_f32(code) as u32)
}

/// Coding of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PlaceCode {
    F32,
    F64,
    /// A grid: its first point, and its step.
    Grid {
        min: [f64; 3],
        step: f64,
        is_double: bool,
    },
}

impl PlaceCode {
    pub(super) fn is_double(&self) -> bool {
        matches!(self, Self::F64 | Self::Grid { is_double: true, .. })
    }
    pub(super) fn code(&self, positions: &Positions, i: usize) -> [i64; 3] {
        match (self, positions) {
            (Self::Grid { min, step, .. }, _) => {
                let p = positions.view().get(lodsmith_core::VertexId(i as u32));
                [0, 1, 2].map(|k| ((p[k] - min[k]) / step).round() as i64)
            }
            (_, Positions::F32(p)) => p[i].map(|x| i64::from(code_f32(x))),
            (_, Positions::F64(p)) => p[i].map(|x| rank_f64(x.to_bits() as i64)),
        }
    }
    pub(super) fn push(&self, code: [i64; 3], to: &mut Positions) {
        let p = match self {
            Self::Grid { min, step, .. } => [0, 1, 2].map(|k| min[k] + code[k] as f64 * step),
            Self::F32 => {
                if let Positions::F32(to) = to {
                    to.push(code.map(|c| value_f32(c as i32)));
                }
                return;
            }
            Self::F64 => code.map(|c| f64::from_bits(rank_f64(c) as u64)),
        };
        match to {
            Positions::F32(to) => to.push(p.map(|x| x as f32)),
            Positions::F64(to) => to.push(p),
        }
    }
}

/// Coding of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ValueCode {
    /// Floats.
    Float,
    /// A grid for each value: its first point, and its step.
    Grid { bits: u8, axes: Vec<[f64; 2]> },
    /// A direction in octahedral encoding, in signed coordinates of this many bits.
    Direction { bits: u8 },
    /// A direction like this, and the side of a tangent: 1 or -1.
    Tangent { bits: u8 },
}

impl ValueCode {
    /// Returns the number of integers for each row of `width` values.
    pub(super) fn channels(&self, width: usize) -> usize {
        match self {
            Self::Float | Self::Grid { .. } => width,
            Self::Direction { .. } => 2,
            Self::Tangent { .. } => 3,
        }
    }
    pub(super) fn encode(&self, row: &[f32], out: &mut Vec<i32>) {
        match self {
            Self::Float => out.extend(row.iter().map(|&x| code_f32(x))),
            Self::Grid { axes, .. } => {
                let step =
                    |(&x, [min, step]): (&f32, &[f64; 2])| ((f64::from(x) - min) / step).round() as i32;
                out.extend(row.iter().zip(axes).map(step));
            }
            Self::Direction { bits } => out.extend(onto_octahedron([row[0], row[1], row[2]], *bits)),
            Self::Tangent { bits } => {
                out.extend(onto_octahedron([row[0], row[1], row[2]], *bits));
                out.push(if row[3] < 0.0 { -1 } else { 1 });
            }
        }
    }
    pub(super) fn decode(&self, codes: &[i32], out: &mut Vec<f32>) {
        match self {
            Self::Float => out.extend(codes.iter().map(|&c| value_f32(c))),
            Self::Grid { axes, .. } => {
                out.extend(
                    codes.iter().zip(axes).map(|(&c, [min, step])| (min + f64::from(c) * step) as f32),
                );
            }
            Self::Direction { bits } => out.extend(off_octahedron([codes[0], codes[1]], *bits)),
            Self::Tangent { bits } => {
                out.extend(off_octahedron([codes[0], codes[1]], *bits));
                out.push(codes[2] as f32);
            }
        }
    }
}

fn half_axis(bits: u8) -> f64 {
    f64::from((1u32 << (bits - 1)) - 1)
}

/// Encodes a direction: maps the sphere to an octahedron, and the octahedron to a square [Cigolle et al.
/// 2014].
fn onto_octahedron(n: [f32; 3], bits: u8) -> [i32; 2] {
    let n = n.map(f64::from);
    let sum = n[0].abs() + n[1].abs() + n[2].abs();
    let (mut x, mut y) = (n[0] / sum, n[1] / sum);
    if n[2] < 0.0 {
        (x, y) = ((1.0 - y.abs()) * side(x), (1.0 - x.abs()) * side(y));
    }
    [x, y].map(|x| (x * half_axis(bits)).round() as i32)
}

fn off_octahedron(codes: [i32; 2], bits: u8) -> [f32; 3] {
    let [mut x, mut y] = codes.map(|c| f64::from(c) / half_axis(bits));
    let z = 1.0 - x.abs() - y.abs();
    if z < 0.0 {
        (x, y) = ((1.0 - y.abs()) * side(x), (1.0 - x.abs()) * side(y));
    }
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|x| (x / length) as f32)
}

fn side(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_keep_their_order_and_every_bit() {
        let rising = [f32::NEG_INFINITY, -1e30, -1.0, -1e-40, -0.0, 0.0, 1e-40, 1.0, f32::INFINITY];
        assert!(rising.windows(2).all(|w| code_f32(w[0]) < code_f32(w[1])));
        for bits in [0, 1, u32::MAX, 0x7fc0_0001, 0xff80_0000, 0x8000_0000] {
            assert_eq!(value_f32(code_f32(f32::from_bits(bits))).to_bits(), bits);
        }
        assert_eq!(rank_f64(rank_f64(i64::MIN)), i64::MIN);
    }

    #[test]
    fn directions_come_back_within_the_grid() {
        for n in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-0.6, 0.0, 0.8], [0.48, -0.6, -0.64], [-1.0, 0.0, 0.0]]
        {
            for bits in [8, 12, 16] {
                let back = off_octahedron(onto_octahedron(n, bits), bits);
                let dot: f32 = (0..3).map(|k| n[k] * back[k]).sum();
                let off = f64::from(dot.min(1.0)).acos();
                assert!(off < 2.0 / half_axis(bits) + 1e-3, "{n:?} {bits} {off}");
                assert_eq!(onto_octahedron(back, bits), onto_octahedron(n, bits));
            }
        }
    }

    #[test]
    fn a_grid_is_as_far_off_as_half_a_step() {
        let grid = PlaceCode::Grid { min: [-1.0, 0.0, 5.0], step: 0.25, is_double: false };
        let positions = Positions::F32(vec![[0.1, 7.0, 5.0]]);
        let code = grid.code(&positions, 0);
        assert_eq!(code, [4, 28, 0]);
        let mut back = Positions::F32(Vec::new());
        grid.push(code, &mut back);
        assert_eq!(back, Positions::F32(vec![[0.0, 7.0, 5.0]]));
    }
}
