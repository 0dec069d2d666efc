//! Filters that round elements and encode them, so that they take fewer bytes. Each encoding is defined by
//! its decoder.

/// Smallest exponent of a number: decoders agree from here on.
const MIN_EXPONENT: i32 = -100;

fn rounded(n: f32, one: i32) -> i16 {
    (n * one as f32).round().clamp(-one as f32, one as f32) as i16
}

/// Encodes a direction as a point of the octahedron, with `bits` for each of its two numbers, and a fourth
/// number with eight bits. A direction of length zero becomes the z axis.
pub(in super::super) fn octahedral([x, y, z, w]: [f32; 4], bits: u32) -> [i8; 4] {
    let sum = x.abs() + y.abs() + z.abs();
    let scale = if sum > 0.0 && sum.is_finite() { 1.0 / sum } else { 0.0 };
    let [x, y] = [x * scale, y * scale];
    let [u, v] = if z >= 0.0 { [x, y] } else { [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)] };
    let one = (1i32 << (bits - 1)) - 1;
    [rounded(u, one), rounded(v, one), one as i16, rounded(w, 127)].map(|n| n as i8)
}

/// Encodes a rotation by its three smaller components, with `bits` each. Its sign may change, which is the
/// same rotation.
pub(in super::super) fn quaternion(q: [f32; 4], bits: u32) -> [i16; 4] {
    let largest = (1..4).fold(0, |at, k| if q[k].abs() > q[at].abs() { k } else { at });
    let scale = std::f32::consts::SQRT_2.copysign(q[largest]);
    let one = (1i32 << (bits - 1)) - 1;
    let component = |k: usize| rounded(q[(largest + k) % 4] * scale, one);
    [component(1), component(2), component(3), (one as i16 & !3) | largest as i16]
}

/// Encodes finite floats that share one power of two, with `bits` for the largest of them.
pub(in super::super) fn exponential(values: &[f32], bits: u32, out: &mut Vec<u8>) {
    let exponent = |x: f32| if x == 0.0 { MIN_EXPONENT } else { (x.to_bits() >> 23 & 0xff) as i32 - 126 };
    let shared = values.iter().map(|x| exponent(*x)).fold(MIN_EXPONENT, i32::max);
    multiples(values, shared - (bits as i32 - 1), out);
}

/// Encodes finite floats as multiples of a power of two, up to 2²³ of them.
pub(in super::super) fn multiples(values: &[f32], exponent: i32, out: &mut Vec<u8>) {
    const MAX_MULTIPLE: f64 = 0x7f_ffff as f64;
    let exponent = exponent.clamp(MIN_EXPONENT, 127);
    let factor = f64::from_bits(((1023 - exponent) as u64) << 52);
    for x in values {
        let multiple = (f64::from(*x) * factor).round().clamp(-MAX_MULTIPLE, MAX_MULTIPLE) as i32;
        out.extend_from_slice(&((exponent << 24) | (multiple & 0xff_ffff)).to_le_bytes());
    }
}

/// Encodes a colour of bytes as luma, two chroma differences, and alpha of seven bits.
pub(in super::super) fn color([r, g, b, a]: [u8; 4]) -> [u8; 4] {
    let [r, g, b] = [r, g, b].map(i32::from);
    let orange = (r - b) / 2;
    let middle = b + orange;
    let green = (g - middle) / 2;
    [(middle + green) as u8, orange as u8, green as u8, a >> 1 | 0x80]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::filters::{Filter, apply};
    use super::*;

    fn length(v: &[f32]) -> f32 {
        v.iter().map(|x| x * x).sum::<f32>().sqrt()
    }

    proptest! {
        #[test]
        fn directions_come_back(v in prop::array::uniform3(-1f32..1.0), w in prop::bool::ANY) {
            let l = length(&v);
            prop_assume!(l > 0.1);
            let sign = if w { 1.0 } else { -1.0 };
            let unit = v.map(|x| x / l);
            let mut bytes = octahedral([unit[0], unit[1], unit[2], sign], 8).map(|b| b as u8);
            apply(Filter::Octahedral, 4, &mut bytes);
            let got = bytes.map(|b| f32::from(b as i8) / 127.0);
            prop_assert_eq!(got[3], sign);
            let off = length(&[0, 1, 2].map(|k| got[k] - unit[k]));
            prop_assert!(off < 0.02, "{unit:?} {got:?}");
        }

        #[test]
        fn rotations_come_back(q in prop::array::uniform4(-1f32..1.0)) {
            let l = length(&q);
            prop_assume!(l > 0.1);
            let unit = q.map(|x| x / l);
            let mut bytes: Vec<u8> = quaternion(unit, 12).iter().flat_map(|n| n.to_le_bytes()).collect();
            apply(Filter::Quaternion, 8, &mut bytes);
            let got: Vec<f32> = bytes.as_chunks::<2>().0.iter().map(|b| f32::from(i16::from_le_bytes(*b)) / 32767.0).collect();
            let dot: f32 = got.iter().zip(unit).map(|(a, b)| a * b).sum();
            prop_assert!(dot.abs() > 0.9999, "{unit:?} {got:?}");
        }

        #[test]
        fn floats_come_back(v in prop::array::uniform3(-1e6f32..1e6), small in -80i32..80) {
            let v = v.map(|x| x * 2f32.powi(small));
            let mut bytes = Vec::new();
            exponential(&v, 16, &mut bytes);
            apply(Filter::Exponential, 12, &mut bytes);
            let got = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
            let most = v.iter().fold(1e-30f32, |m, x| m.max(x.abs()));
            for (got, wanted) in got.zip(v) {
                prop_assert!((got - wanted).abs() <= most / 32767.0, "{got} {wanted}");
            }
        }

        #[test]
        fn colors_come_back(c in prop::array::uniform4(0u8..=255)) {
            let mut got = color(c);
            apply(Filter::Color, 4, &mut got);
            for (got, wanted) in got.into_iter().zip(c) {
                prop_assert!(got.abs_diff(wanted) <= 3, "{c:?} {got}");
            }
        }
    }

    #[test]
    fn zero_stays_zero() {
        let mut bytes = Vec::new();
        exponential(&[0.0, 0.0, 1.5], 16, &mut bytes);
        apply(Filter::Exponential, 12, &mut bytes);
        assert_eq!(bytes, [0.0f32, 0.0, 1.5].map(f32::to_le_bytes).concat());
    }
}
