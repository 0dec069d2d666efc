//! Encoder of accessor data: numbers of a mesh as typed bytes.

use serde_json::Value;

use super::accessors::Component;

/// The type of an accessor's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NumberType {
    pub(super) component: Component,
    /// True if integers are normalized.
    pub(super) normalized: bool,
}

/// Bytes of an accessor, and its properties.
#[derive(Debug)]
pub(super) struct EncodedAccessor {
    pub(super) kind: NumberType,
    pub(super) width: usize,
    /// Bytes from one element to the next: a multiple of 4.
    pub(super) stride: usize,
    pub(super) bytes: Vec<u8>,
    pub(super) min: Vec<Value>,
    pub(super) max: Vec<Value>,
}

impl NumberType {
    pub(super) const FLOAT: Self = Self { component: Component::F32, normalized: false };

    /// Returns the integer for a number, clamped to the range of the type.
    fn whole(self, x: f32) -> f64 {
        let scaled = if self.normalized { x * self.component.one() } else { x };
        let (low, high) = match self.component {
            Component::I8 if self.normalized => (-127.0, 127.0),
            Component::I16 if self.normalized => (-32767.0, 32767.0),
            Component::I8 => (-128.0, 127.0),
            Component::I16 => (-32768.0, 32767.0),
            component => (0.0, f64::from(component.one())),
        };
        // NaN becomes zero.
        let whole = f64::from(scaled).round().clamp(low, high);
        if whole.is_nan() { 0.0 } else { whole }
    }

    /// Returns true if a number survives the round trip.
    fn holds(self, x: f32) -> bool {
        let whole = self.whole(x) as f32;
        x == if self.normalized { whole / self.component.one() } else { whole }
    }
}

/// Encodes elements of `width` numbers, in their source type if that represents them exactly, else as floats.
///
/// With `is_forced` they are always rounded to their type.
pub(super) fn encode(values: &[f32], width: usize, kind: NumberType, is_forced: bool) -> EncodedAccessor {
    let is_float = kind.component == Component::F32;
    let fits = !is_float && (is_forced || values.iter().all(|&x| kind.holds(x)));
    let kind = if fits { kind } else { NumberType::FLOAT };
    let size = kind.component.size();
    let stride = (size * width).next_multiple_of(4);
    let mut bytes = Vec::with_capacity(values.len() / width * stride);
    let (mut min, mut max) = (vec![f64::INFINITY; width], vec![f64::NEG_INFINITY; width]);
    for element in values.chunks_exact(width) {
        for (k, &x) in element.iter().enumerate() {
            let raw = match kind.component {
                Component::F32 => f64::from(x),
                _ => kind.whole(x),
            };
            match kind.component {
                Component::F32 => bytes.extend_from_slice(&x.to_le_bytes()),
                Component::I8 => bytes.extend_from_slice(&(raw as i8).to_le_bytes()),
                Component::U8 => bytes.push(raw as u8),
                Component::I16 => bytes.extend_from_slice(&(raw as i16).to_le_bytes()),
                Component::U16 => bytes.extend_from_slice(&(raw as u16).to_le_bytes()),
                Component::U32 => bytes.extend_from_slice(&(raw as u32).to_le_bytes()),
            }
            if raw.is_finite() {
                min[k] = min[k].min(raw);
                max[k] = max[k].max(raw);
            }
        }
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let shown = |bound: Vec<f64>| {
        let number = |x: f64| match kind.component {
            // JSON has no NaN or infinity.
            _ if !x.is_finite() => Value::from(0),
            Component::F32 => Value::from(x),
            _ => Value::from(x as i64),
        };
        bound.into_iter().map(number).collect()
    };
    EncodedAccessor { kind, width, stride, bytes, min: shown(min), max: shown(max) }
}

/// Normalizes the direction in the first three numbers of each element; returns the number of directions
/// without length, which become `instead`.
pub(super) fn unit_directions(values: &mut [f32], width: usize, instead: [f32; 3]) -> usize {
    let mut replaced = 0;
    for element in values.chunks_exact_mut(width) {
        let [x, y, z] = [0, 1, 2].map(|k| f64::from(element[k]));
        let length = (x * x + y * y + z * z).sqrt();
        // The tolerance is well within the tolerance of the glTF validator.
        if (length - 1.0).abs() <= 1e-4 {
            continue;
        }
        let unit = if length > 0.0 && length.is_finite() {
            [x, y, z].map(|c| (c / length) as f32)
        } else {
            replaced += 1;
            instead
        };
        element[..3].copy_from_slice(&unit);
    }
    replaced
}

/// Scales the weights of each vertex, over all sets, to the sum one. `one` is the integer that represents
/// 1.0, if they are stored as integers: then the integers sum to it exactly. Weights that are all zero stay
/// zero.
pub(super) fn normalize_weights(sets: &mut [Vec<f32>], one: Option<f32>) {
    let count = sets.iter().map(|s| s.len() / 4).min().unwrap_or(0);
    for i in 0..count {
        let places: Vec<(usize, usize)> =
            (0..sets.len()).flat_map(|s| (0..4).map(move |k| (s, 4 * i + k))).collect();
        let sum: f64 = places.iter().map(|&(s, k)| f64::from(sets[s][k])).sum();
        let used = places.iter().filter(|&&(s, k)| sets[s][k] != 0.0).count();
        if !(sum > 0.0 && sum.is_finite()) {
            continue;
        }
        // Half the tolerance of the glTF validator.
        if (sum - 1.0).abs() > 1e-7 * used as f64 {
            for &(s, k) in &places {
                sets[s][k] = (f64::from(sets[s][k]) / sum) as f32;
            }
        }
        let Some(one) = one else { continue };
        let mut left = one;
        let mut largest = (0, 0);
        let mut most = -1.0;
        for (s, k) in places {
            if sets[s][k] > most {
                (most, largest) = (sets[s][k], (s, k));
            }
            let whole = (sets[s][k] * one).round();
            left -= whole;
            sets[s][k] = whole / one;
        }
        let (s, k) = largest;
        sets[s][k] = ((sets[s][k] * one).round() + left).max(0.0) / one;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_stay_where_they_hold_the_values() {
        let bytes = NumberType { component: Component::U8, normalized: true };
        let got = encode(&[0.0, 1.0, 51.0 / 255.0], 3, bytes, false);
        assert_eq!((got.kind, got.stride, got.bytes), (bytes, 4, vec![0, 255, 51, 0]));
        assert_eq!(
            (got.min, got.max),
            (vec![0.into(), 255.into(), 51.into()], vec![0.into(), 255.into(), 51.into()])
        );
        let got = encode(&[0.0, 1.0, 0.3], 3, bytes, false);
        assert_eq!((got.kind, got.stride), (NumberType::FLOAT, 12));
        let got = encode(&[-0.5, 2.0, 0.3, f32::NAN], 4, bytes, true);
        assert_eq!(got.bytes, [0, 255, 77, 0]);
        let signed = NumberType { component: Component::I16, normalized: true };
        let got = encode(&[-1.0, 1.0], 2, signed, false);
        assert_eq!(got.bytes, [0x01, 0x80, 0xff, 0x7f]);
    }

    #[test]
    fn every_integer_of_a_type_comes_back() {
        for (component, all) in
            [(Component::U8, 0..256), (Component::I16, -32767..32768), (Component::U16, 0..65536)]
        {
            let kind = NumberType { component, normalized: true };
            assert!(all.into_iter().all(|i| kind.holds(i as f32 / component.one())), "{component:?}");
        }
    }

    #[test]
    fn weights_sum_to_one() {
        let mut sets =
            vec![vec![0.3, 0.3, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0], vec![0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
        normalize_weights(&mut sets, None);
        assert!((sets.iter().flatten().map(|&x| f64::from(x)).sum::<f64>() - 1.0).abs() < 1e-7);
        normalize_weights(&mut sets, Some(255.0));
        let whole: f32 = sets.iter().flatten().map(|&x| (x * 255.0).round()).sum();
        assert_eq!(whole, 255.0);
        assert_eq!(sets[0][4..], [0.0; 4]);
    }

    #[test]
    fn directions_have_length_one() {
        let mut values = [0.0, 0.0, 2.0, -1.0, 0.0, 0.0, 0.0, 1.0];
        assert_eq!(unit_directions(&mut values, 4, [1.0, 0.0, 0.0]), 1);
        assert_eq!(values, [0.0, 0.0, 1.0, -1.0, 1.0, 0.0, 0.0, 1.0]);
    }
}
