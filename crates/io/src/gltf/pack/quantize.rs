//! Rounding of attributes and animations to fewer bits.

use super::super::accessors::{Accessor, Component};
use super::super::encode::NumberType;
use super::super::meshopt::encode_filters::{color, exponential, multiples, octahedral, quaternion};
use super::super::meshopt::{Filter, apply};
use super::options::{Compression, QuantizationErrors};
use super::streams::{PackedStream, StreamKind};
use crate::error::ReadError;

/// Bits of positions, within the box of all meshes, and of other values: as in gltfpack, so that files can be
/// compared.
const POSITION_BITS: u32 = 14;
const NORMAL_BITS: u32 = 8;
const UV_BITS: i32 = 12;
const ROTATION_BITS: u32 = 12;
const VECTOR_BITS: u32 = 16;

/// Grid of the positions of a mesh: they are `offset` plus integer multiples of `step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    pub(super) offset: [f32; 3],
    pub(super) step: f32,
    /// Diagonal of the box of the mesh.
    pub(super) diagonal: f32,
}

/// Box of the positions of a mesh, with room for its morph targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PositionBox {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

impl PositionBox {
    pub(super) const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    pub(super) fn add(&mut self, other: &Self) {
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
    }

    /// Returns its longest side; negative if it is empty, infinite if it does not fit.
    pub(super) fn extent(&self) -> f32 {
        (0..3).map(|k| self.max[k] - self.min[k]).fold(f32::NEG_INFINITY, f32::max)
    }

    /// Returns a grid in this box for a mesh with its own box.
    pub(super) fn grid(&self, mesh: &Self) -> Grid {
        let steps = ((1u32 << POSITION_BITS) - 1) as f32;
        let step = self.extent() / steps;
        let diagonal = (0..3).map(|k| (mesh.max[k] - mesh.min[k]).powi(2)).sum::<f32>().sqrt();
        // All positions are one, or nearly.
        Grid { offset: self.min, step: if step >= f32::MIN_POSITIVE { step } else { 1.0 }, diagonal }
    }
}

const fn integers(component: Component) -> NumberType {
    NumberType { component, normalized: false }
}

const fn fractions(component: Component) -> NumberType {
    NumberType { component, normalized: true }
}

/// State of the rounding of one primitive or animation.
pub(super) struct Rounding {
    pub(super) compression: Compression,
    pub(super) errors: QuantizationErrors,
}

/// Raises a largest difference.
fn raise(largest: &mut f64, difference: f64) {
    if difference > *largest {
        *largest = difference;
    }
}

/// Returns the angle between two directions in degrees; 0 if one has no length.
fn angle(a: &[f32], b: &[f32]) -> f64 {
    let length = |v: &[f32]| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let (la, lb) = (length(a), length(b));
    if !(la > 0.0 && lb > 0.0) {
        return 0.0;
    }
    let chord = a.iter().zip(b).map(|(a, b)| (f64::from(*a) / la - f64::from(*b) / lb).powi(2)).sum::<f64>();
    2.0 * (chord.sqrt() / 2.0).min(1.0).asin().to_degrees()
}

/// Returns the elements of an accessor as they are.
pub(super) fn unchanged(
    kind: StreamKind,
    accessor: &Accessor<'_>,
    has_bounds: bool,
) -> Result<PackedStream, ReadError> {
    let (bytes, stride) = accessor.padded_bytes()?;
    let number = NumberType { component: accessor.kind, normalized: accessor.normalized };
    let width = accessor.width;
    Ok(PackedStream { kind, number, width, stride, bytes, filter: Filter::None, has_bounds })
}

impl Rounding {
    fn is_compressed(&self) -> bool {
        self.compression != Compression::None
    }

    /// Rounds an attribute; `None` for one that stays as it is. `grid` is for the positions of a mesh.
    pub(super) fn attribute(
        &mut self,
        kind: &StreamKind,
        accessor: &Accessor<'_>,
        grid: Option<Grid>,
    ) -> Result<Option<PackedStream>, ReadError> {
        let StreamKind::Attribute { name, is_target } = kind else { return Ok(None) };
        let is_float = accessor.kind == Component::F32;
        let made = match (name.as_str(), is_target, accessor.width) {
            ("POSITION" | "_GEOMORPH", false, 3) => grid
                .map(|grid| Ok::<_, ReadError>(self.positions(&accessor.floats::<3>(false)?, grid)))
                .transpose()?,
            ("POSITION", true, 3) => grid
                .map(|grid| Ok::<_, ReadError>(self.offsets(&accessor.floats::<3>(false)?, grid)))
                .transpose()?,
            ("NORMAL", false, 3) | ("TANGENT", false, 4) if is_float => {
                Some(self.directions(&accessor.floats::<4>(false)?, accessor.width))
            }
            ("NORMAL" | "TANGENT", true, 3) if is_float => {
                self.direction_offsets(&accessor.floats::<3>(false)?, name == "NORMAL")
            }
            (name, false, 2) if name.starts_with("TEXCOORD_") && is_float => {
                self.uvs(&accessor.floats::<2>(false)?)
            }
            (name, false, 3 | 4) if name.starts_with("COLOR_") && (is_float || accessor.normalized) => {
                let mut colors = accessor.floats::<4>(false)?;
                if accessor.width == 3 {
                    colors.iter_mut().for_each(|c| c[3] = 1.0);
                }
                self.colors(&colors, accessor.width)
            }
            _ => None,
        };
        Ok(made.map(|mut stream| {
            stream.kind = kind.clone();
            // glTF requires bounds of positions.
            stream.has_bounds = name == "POSITION";
            stream
        }))
    }

    fn positions(&mut self, positions: &[[f32; 3]], grid: Grid) -> PackedStream {
        let mut bytes = Vec::with_capacity(8 * positions.len());
        for p in positions {
            let (mut sum, step) = (0.0, f64::from(grid.step));
            for (x, offset) in p.iter().zip(grid.offset) {
                let exact = (f64::from(*x) - f64::from(offset)) / step;
                let whole = exact.round().clamp(0.0, 65535.0);
                bytes.extend_from_slice(&(whole as u16).to_le_bytes());
                sum += ((whole - exact) * step).powi(2);
            }
            bytes.extend([0; 2]);
            self.moved(sum.sqrt(), grid);
        }
        self.made(integers(Component::U16), 3, 8, bytes, Filter::None)
    }

    /// Raises the largest distance of positions.
    fn moved(&mut self, distance: f64, grid: Grid) {
        raise(&mut self.errors.position, distance);
        if grid.diagonal > 0.0 {
            raise(&mut self.errors.position_share, distance / f64::from(grid.diagonal));
        }
    }

    fn offsets(&mut self, offsets: &[[f32; 3]], grid: Grid) -> PackedStream {
        let step = f64::from(grid.step);
        let whole = |x: f32| (f64::from(x) / step).round().clamp(-32767.0, 32767.0);
        let is_small = offsets.as_flattened().iter().all(|x| whole(*x).abs() <= 127.0);
        let mut bytes = Vec::new();
        for offset in offsets {
            let mut sum = 0.0;
            for &x in offset {
                match whole(x) {
                    n if is_small => bytes.push(n as i8 as u8),
                    n => bytes.extend_from_slice(&(n as i16).to_le_bytes()),
                }
                sum += (whole(x) * step - f64::from(x)).powi(2);
            }
            bytes.resize(bytes.len().next_multiple_of(if is_small { 4 } else { 8 }), 0);
            self.moved(sum.sqrt(), grid);
        }
        let (component, stride) = if is_small { (Component::I8, 4) } else { (Component::I16, 8) };
        self.made(integers(component), 3, stride, bytes, Filter::None)
    }

    /// Rounds normals, or tangents with their side in the fourth number.
    fn directions(&mut self, directions: &[[f32; 4]], width: usize) -> PackedStream {
        let mut bytes = Vec::with_capacity(4 * directions.len());
        let filter = if self.is_compressed() { Filter::Octahedral } else { Filter::None };
        for d in directions {
            let encoded = octahedral(*d, NORMAL_BITS).map(|n| n as u8);
            let mut decoded = encoded;
            apply(Filter::Octahedral, 4, &mut decoded);
            let got = decoded.map(|n| f32::from(n as i8) / 127.0);
            let largest = if width == 3 { &mut self.errors.normal } else { &mut self.errors.tangent };
            raise(largest, angle(&got[..3], &d[..3]));
            bytes.extend(if filter == Filter::None { decoded } else { encoded });
        }
        self.made(fractions(Component::I8), width, 4, bytes, filter)
    }

    /// Rounds offsets of normals or tangents by morph targets, unless one is too large.
    fn direction_offsets(&mut self, offsets: &[[f32; 3]], is_normal: bool) -> Option<PackedStream> {
        if offsets.as_flattened().iter().any(|x| x.is_nan() || x.abs() > 1.0) {
            return None;
        }
        let mut bytes = Vec::with_capacity(4 * offsets.len());
        for offset in offsets {
            let whole = offset.map(|x| (x * 127.0).round());
            bytes.extend(whole.map(|n| n as i8 as u8));
            bytes.push(0);
            let off = whole.iter().zip(offset).map(|(n, x)| f64::from(n / 127.0 - x).powi(2)).sum::<f64>();
            let largest = if is_normal { &mut self.errors.normal } else { &mut self.errors.tangent };
            raise(largest, off.sqrt().to_degrees());
        }
        Some(self.made(fractions(Component::I8), 3, 4, bytes, Filter::None))
    }

    /// Rounds texture coordinates: compressed, to floats of few bits; else to integers, if they are within one
    /// image.
    fn uvs(&mut self, uvs: &[[f32; 2]]) -> Option<PackedStream> {
        let (mut min, mut max) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for uv in uvs {
            if !uv.iter().all(|x| x.is_finite()) {
                return None;
            }
            for k in 0..2 {
                (min[k], max[k]) = (min[k].min(uv[k]), max[k].max(uv[k]));
            }
        }
        let mut bytes = Vec::new();
        if self.is_compressed() {
            let range = (max[0] - min[0]).max(max[1] - min[1]).max(f32::MIN_POSITIVE);
            // The power of two that is nearest to the range.
            let bits = range.to_bits();
            let above = i32::from((bits & 0x7f_ffff) >= (std::f32::consts::SQRT_2.to_bits() & 0x7f_ffff));
            let exponent = (bits >> 23) as i32 - 127 + above - UV_BITS;
            let largest = min.iter().chain(&max).fold(0f32, |m, x| m.max(x.abs()));
            if exponent < -100 || f64::from(largest) >= 2f64.powi(exponent + 23) {
                return None;
            }
            multiples(uvs.as_flattened(), exponent, &mut bytes);
            self.compare(uvs.as_flattened(), &bytes, Filter::Exponential, 8, |e| &mut e.uv);
            return Some(self.made(NumberType::FLOAT, 2, 8, bytes, Filter::Exponential));
        }
        if min.iter().any(|x| *x < 0.0) || max.iter().any(|x| *x > 1.0) {
            return None;
        }
        for &x in uvs.as_flattened() {
            let whole = (f64::from(x) * 65535.0).round();
            bytes.extend_from_slice(&(whole as u16).to_le_bytes());
            raise(&mut self.errors.uv, (whole / 65535.0 - f64::from(x)).abs());
        }
        Some(self.made(fractions(Component::U16), 2, 4, bytes, Filter::None))
    }

    fn colors(&mut self, colors: &[[f32; 4]], width: usize) -> Option<PackedStream> {
        if !colors.as_flattened().iter().all(|x| (0.0..=1.0).contains(x)) {
            return None;
        }
        // Seven bits of alpha suffice for none, half and all.
        let has_filter = self.compression == Compression::MeshoptKhr
            && width == 4
            && colors.iter().all(|c| c[3] == 0.0 || c[3] == 1.0);
        let filter = if has_filter { Filter::Color } else { Filter::None };
        let mut bytes = Vec::with_capacity(4 * colors.len());
        for c in colors {
            let whole = c.map(|x| (x * 255.0).round() as u8);
            let mut decoded = whole;
            if has_filter {
                decoded = color(whole);
                bytes.extend(decoded);
                apply(Filter::Color, 4, &mut decoded);
            } else {
                bytes.extend([whole[0], whole[1], whole[2], if width == 4 { whole[3] } else { 0 }]);
            }
            for (n, x) in decoded.iter().zip(c) {
                raise(&mut self.errors.color, (f64::from(*n) / 255.0 - f64::from(*x)).abs());
            }
        }
        Some(self.made(fractions(Component::U8), width, 4, bytes, filter))
    }

    /// Rounds joint weights; over all sets of a vertex their sum is 1.
    pub(super) fn weights(&mut self, exact: &[[f32; 4]], normalized: &[f32]) -> PackedStream {
        let mut bytes = Vec::with_capacity(normalized.len());
        for (x, exact) in normalized.iter().zip(exact.as_flattened()) {
            let whole = (x * 255.0).round();
            bytes.push(whole as u8);
            raise(&mut self.errors.weight, f64::from((whole / 255.0 - exact).abs()));
        }
        self.made(fractions(Component::U8), 4, 4, bytes, Filter::None)
    }

    /// Rounds animated rotations that are interpolated between unit quaternions; `None` if they are not.
    pub(super) fn rotations(&mut self, rotations: &[[f32; 4]]) -> Option<PackedStream> {
        // Guessed: quaternions of real files are that close to unit length.
        let is_unit = |q: &[f32; 4]| (q.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-3;
        if !rotations.iter().all(is_unit) {
            return None;
        }
        let filter = if self.is_compressed() { Filter::Quaternion } else { Filter::None };
        let mut bytes = Vec::with_capacity(8 * rotations.len());
        for q in rotations {
            let mut element = [0; 8];
            let whole = match filter {
                Filter::None => q.map(|x| (x * 32767.0).round().clamp(-32767.0, 32767.0) as i16),
                _ => quaternion(*q, ROTATION_BITS),
            };
            element.as_chunks_mut::<2>().0.iter_mut().zip(whole).for_each(|(b, n)| *b = n.to_le_bytes());
            bytes.extend(element);
            apply(filter, 8, &mut element);
            let got: Vec<f32> = element
                .as_chunks::<2>()
                .0
                .iter()
                .map(|b| f32::from(i16::from_le_bytes(*b)) / 32767.0)
                .collect();
            let opposite: Vec<f32> = got.iter().map(|x| -x).collect();
            // Half the angle of rotations lies between their quaternions.
            raise(&mut self.errors.rotation, 2.0 * angle(&got, q).min(angle(&opposite, q)));
        }
        Some(self.made(fractions(Component::I16), 4, 8, bytes, filter))
    }

    /// Rounds animated vectors that are compressed, each with the exponent of its largest component. `None` if
    /// one is not finite, or they are not compressed.
    pub(super) fn vectors(
        &mut self,
        values: &[f32],
        width: usize,
        is_translation: bool,
    ) -> Option<PackedStream> {
        if !self.is_compressed() || !values.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut bytes = Vec::with_capacity(4 * values.len());
        values.chunks_exact(width).for_each(|v| exponential(v, VECTOR_BITS, &mut bytes));
        let stride = 4 * width;
        self.compare(values, &bytes, Filter::Exponential, stride, |e| {
            if is_translation { &mut e.translation } else { &mut e.scale }
        });
        Some(self.made(NumberType::FLOAT, width, stride, bytes, Filter::Exponential))
    }

    /// Raises a largest difference by comparing filtered floats.
    fn compare(
        &mut self,
        exact: &[f32],
        encoded: &[u8],
        filter: Filter,
        stride: usize,
        largest: impl Fn(&mut QuantizationErrors) -> &mut f64,
    ) {
        let mut decoded = encoded.to_vec();
        apply(filter, stride, &mut decoded);
        for (bytes, x) in decoded.as_chunks::<4>().0.iter().zip(exact) {
            raise(largest(&mut self.errors), f64::from((f32::from_le_bytes(*bytes) - x).abs()));
        }
    }

    /// Returns a stream whose kind the caller sets.
    fn made(
        &self,
        number: NumberType,
        width: usize,
        stride: usize,
        bytes: Vec<u8>,
        filter: Filter,
    ) -> PackedStream {
        PackedStream { kind: StreamKind::Other(""), number, width, stride, bytes, filter, has_bounds: false }
    }
}
