//! Filters that decode elements in place.

/// Filter of decoded elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in super::super) enum Filter {
    None,
    /// Directions in octahedral encoding.
    Octahedral,
    /// Quaternions without their largest component.
    Quaternion,
    /// Floats as integers times powers of two.
    Exponential,
    /// Colours as luma and two chroma differences.
    Color,
}

impl Filter {
    /// Returns its name in a file; `None` for none.
    pub(in super::super) const fn name(self) -> Option<&'static str> {
        match self {
            Self::None => None,
            Self::Octahedral => Some("OCTAHEDRAL"),
            Self::Quaternion => Some("QUATERNION"),
            Self::Exponential => Some("EXPONENTIAL"),
            Self::Color => Some("COLOR"),
        }
    }
}

/// Applies a filter to elements, in place.
pub(in super::super) fn apply(filter: Filter, stride: usize, elements: &mut [u8]) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Exponential, _) => {
            for number in elements.as_chunks_mut::<4>().0 {
                *number = exponential(i32::from_le_bytes(*number)).to_le_bytes();
            }
        }
        (Filter::Octahedral, 4) => {
            for e in elements.as_chunks_mut::<4>().0 {
                let [x, y, z] = octahedral([e[0], e[1], e[2]].map(|b| i16::from(b as i8)), 127.0);
                e[..3].copy_from_slice(&[x, y, z].map(|n| n as i8 as u8));
            }
        }
        (Filter::Octahedral, _) => {
            each_of_four(elements, |[x, y, z, w]| {
                let [x, y, z] = octahedral([x, y, z], 32767.0);
                [x, y, z, w]
            });
        }
        (Filter::Quaternion, _) => each_of_four(elements, quaternion),
        (Filter::Color, 4) => {
            for e in elements.as_chunks_mut::<4>().0 {
                let [y, co, cg, a] = *e;
                let difference = |b: u8| i32::from(b as i8);
                *e = color([y.into(), difference(co), difference(cg), a.into()], 255.0).map(|n| n as u8);
            }
        }
        (Filter::Color, _) => each_of_four(elements, |[y, co, cg, a]| {
            let [y, a] = [y, a].map(|n| i32::from(n as u16));
            color([y, co.into(), cg.into(), a], 65535.0).map(|n| n as u16 as i16)
        }),
    }
}

/// Changes elements of four 16-bit numbers.
fn each_of_four(elements: &mut [u8], change: impl Fn([i16; 4]) -> [i16; 4]) {
    for element in elements.as_chunks_mut::<8>().0 {
        let numbers = [0, 2, 4, 6].map(|k| i16::from_le_bytes([element[k], element[k + 1]]));
        for (bytes, number) in element.as_chunks_mut::<2>().0.iter_mut().zip(change(numbers)) {
            *bytes = number.to_le_bytes();
        }
    }
}

/// Decodes a direction; `input[2]` represents 1 in the input, and `max` in the result. Zero stays zero.
fn octahedral(input: [i16; 3], max: f32) -> [i16; 3] {
    let one = f32::from(input[2]);
    let [x, y] = [input[0], input[1]].map(|n| f32::from(n) / one);
    let z = 1.0 - x.abs() - y.abs();
    // Below the equator, corners are folded outwards.
    let fold = z.min(0.0);
    let [x, y] = [x, y].map(|n| n - fold.copysign(n));
    let length = (x * x + y * y + z * z).sqrt();
    // The conversion turns NaN into zero.
    [x, y, z].map(|n| (n / length * max).round() as i16)
}

/// Decodes a rotation; the last number holds the index of its largest component, and represents 1 in the
/// others.
fn quaternion(input: [i16; 4]) -> [i16; 4] {
    let one = f32::from(input[3] | 3);
    let [x, y, z] =
        [input[0], input[1], input[2]].map(|n| f32::from(n) / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = usize::from(input[3] as u16 & 3);
    let mut out = [0; 4];
    for (k, n) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + k) % 4] = (n * 32767.0).round() as i16;
    }
    out
}

/// Decodes a 24-bit integer times a power of two.
fn exponential(input: i32) -> f32 {
    let (exponent, mantissa) = (input >> 24, input << 8 >> 8);
    // A power below the smallest normal float is the product of two exact factors.
    let power = |e: i32| f32::from_bits(((e + 127) as u32) << 23);
    match exponent {
        ..-126 => mantissa as f32 * power(exponent + 64) * power(-64),
        _ => mantissa as f32 * power(exponent),
    }
}

/// Converts luma, two chroma differences and alpha to red, green, blue and alpha; `max` represents 1 in the
/// result.
fn color([y, co, cg, a]: [i32; 4], max: f32) -> [i32; 4] {
    // The highest set bit of alpha gives the number of bits of the others; without one, the colour is black.
    let one = (1i64 << (32 - a.leading_zeros())) as i32 - 1;
    let scale = if one > 0 { max / one as f32 } else { 0.0 };
    let alpha = a & (one >> 1);
    let all = [y + co - cg, y + cg, y - co - cg, alpha << 1 | alpha & 1];
    all.map(|n| (n as f32 * scale).round().clamp(0.0, max) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions() {
        assert_eq!(octahedral([0, 0, 127], 127.0), [0, 0, 127]);
        assert_eq!(octahedral([127, 0, 127], 127.0), [127, 0, 0]);
        // The corners of the square map to the south pole.
        assert_eq!(octahedral([-511, 511, 511], 32767.0), [0, 0, -32767]);
        let [x, y, z] = octahedral([1, 1, 3], 32767.0);
        assert_eq!((x, y, z), (18918, 18918, 18918));
        // Zero length, and extreme numbers.
        assert_eq!(octahedral([0, 0, 0], 127.0), [0, 0, 0]);
        for n in [i16::MIN, -1, 0, i16::MAX] {
            let _ = octahedral([i16::MIN, i16::MAX, n], 32767.0);
        }
    }

    #[test]
    fn rotations() {
        // 1 is stored as 511, with ten bits; the largest component has index 3.
        assert_eq!(quaternion([0, 0, 0, 509 | 2]), [0, 0, 0, 32767]);
        assert_eq!(quaternion([0, 0, 0, 508 | 1]), [0, 32767, 0, 0]);
        let half = quaternion([511, 0, 0, 508]);
        assert_eq!(half, [23170, 23170, 0, 0]);
        for n in [i16::MIN, -4, 0, i16::MAX] {
            let _ = quaternion([i16::MIN, i16::MAX, n, n]);
        }
    }

    #[test]
    fn powers_of_two() {
        let number = |e: i8, m: i32| exponential(i32::from(e) << 24 | m & 0xff_ffff);
        assert_eq!(number(0, 5), 5.0);
        assert_eq!(number(-2, -3), -0.75);
        assert_eq!(number(100, 1), 2f32.powi(100));
        assert_eq!(number(-100, 0x7f_ffff), 0x7f_ffff as f32 * 2f32.powi(-100));
        assert_eq!(number(-128, 1 << 10), 2f32.powi(-118));
        assert_eq!(number(-126, 1), 2f32.powi(-126));
        assert_eq!(number(127, 1), 2f32.powi(127));
    }

    #[test]
    fn colors() {
        // Eight bits: alpha has seven, below the highest set bit.
        assert_eq!(color([128, 0, 0, 0xff], 255.0), [128, 128, 128, 255]);
        // Red alone: luma 64 (of 255 / 4), and both differences.
        assert_eq!(color([64, 127, -64, 0x80], 255.0), [255, 0, 1, 0]);
        assert_eq!(color([1, 0, 0, 3], 255.0), [85, 85, 85, 255]);
        assert_eq!(color([9, 9, 9, 0], 255.0), [0, 0, 0, 0]);
        assert_eq!(color([65535, 32767, -32768, 65535], 65535.0), [65535, 32767, 65535, 65535]);
    }
}
