//! Decoder of accessors: typed numbers in buffers.

use lodsmith_core::IntegerType;
use serde_json::Value;

use super::buffers::{Buffers, View};
use super::container::{entry, whole};
use crate::error::ReadError;
use crate::excerpt::excerpt;

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(super) fn from_code(code: usize) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// Returns its glTF code.
    pub(super) const fn code(self) -> u32 {
        match self {
            Self::I8 => 5120,
            Self::U8 => 5121,
            Self::I16 => 5122,
            Self::U16 => 5123,
            Self::U32 => 5125,
            Self::F32 => 5126,
        }
    }

    /// Returns the matching integer type of mesh attributes; `None` for floats.
    pub(super) const fn integer(self) -> Option<IntegerType> {
        Some(match self {
            Self::I8 => IntegerType::I8,
            Self::U8 => IntegerType::U8,
            Self::I16 => IntegerType::I16,
            Self::U16 => IntegerType::U16,
            Self::U32 => IntegerType::U32,
            Self::F32 => return None,
        })
    }

    /// Returns the integer that represents 1.0 in normalized accessors.
    pub(super) const fn one(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 => 4_294_967_295.0,
            Self::F32 => 1.0,
        }
    }

    /// Decodes the number at the start of some bytes.
    #[inline]
    pub(super) fn number(self, b: &[u8]) -> f32 {
        match self {
            Self::I8 => f32::from(b[0] as i8),
            Self::U8 => f32::from(b[0]),
            Self::I16 => f32::from(i16::from_le_bytes([b[0], b[1]])),
            Self::U16 => f32::from(u16::from_le_bytes([b[0], b[1]])),
            Self::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            Self::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }

    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::I8 => "signed bytes",
            Self::U8 => "bytes",
            Self::I16 => "signed 16-bit integers",
            Self::U16 => "16-bit integers",
            Self::U32 => "32-bit integers",
            Self::F32 => "floats",
        }
    }
}

/// Elements at a constant stride in a byte slice; bounds have been checked.
struct Elements<'b> {
    bytes: &'b [u8],
    stride: usize,
}

/// Sparse elements, which replace others.
struct Sparse<'b> {
    count: usize,
    index_kind: Component,
    indices: Elements<'b>,
    values: Elements<'b>,
}

/// Element count and type that an accessor declares.
pub(super) struct AccessorShape {
    pub(super) count: usize,
    pub(super) kind: Component,
    /// Components of an element.
    pub(super) width: usize,
}

/// Types of elements by name, with their numbers of components.
type Types = [(&'static str, usize)];
const VECTORS: &Types = &[("SCALAR", 1), ("VEC2", 2), ("VEC3", 3), ("VEC4", 4)];
const MATRICES: &Types = &[("MAT4", 16)];

impl AccessorShape {
    pub(super) fn new(accessor: &Value, at: &str) -> Result<Self, ReadError> {
        Self::of_types(accessor, at, VECTORS)
    }

    fn of_types(accessor: &Value, at: &str, types: &Types) -> Result<Self, ReadError> {
        let Some(count) = whole(accessor, "count", at)? else {
            return Err(ReadError::element(at, "count is missing"));
        };
        let kind = component(accessor, at)?;
        let of_type = accessor["type"].as_str();
        let Some(&(_, width)) = types.iter().find(|(name, _)| Some(*name) == of_type) else {
            let other = excerpt(of_type.unwrap_or("missing"));
            let wanted = if types.len() > 1 { "SCALAR or VEC2 to VEC4" } else { types[0].0 };
            return Err(ReadError::element(at, format!("the type is {other}, expected {wanted}")));
        };
        Ok(Self { count, kind, width })
    }
}

/// An accessor whose bounds have been checked.
pub(super) struct Accessor<'b> {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) kind: Component,
    /// Components of an element.
    pub(super) width: usize,
    pub(super) normalized: bool,
    /// `None`: all zero.
    elements: Option<Elements<'b>>,
    sparse: Option<Sparse<'b>>,
}

/// Limit on the elements of an accessor without data, which reads as zeros: larger counts are refused unless
/// the buffers are as large. (Guessed.)
const MAX_ZEROS: usize = 1 << 20;

impl<'b> Accessor<'b> {
    /// Opens `accessors[index]`, which `from` refers to.
    pub(super) fn new(
        json: &Value,
        buffers: &'b Buffers<'_>,
        index: usize,
        from: &str,
    ) -> Result<Self, ReadError> {
        Self::of_types(json, buffers, index, from, VECTORS)
    }

    /// Opens an accessor of matrices of four rows; their numbers are stored column by column.
    pub(super) fn of_matrices(
        json: &Value,
        buffers: &'b Buffers<'_>,
        index: usize,
        from: &str,
    ) -> Result<Self, ReadError> {
        Self::of_types(json, buffers, index, from, MATRICES)
    }

    fn of_types(
        json: &Value,
        buffers: &'b Buffers<'_>,
        index: usize,
        from: &str,
        types: &Types,
    ) -> Result<Self, ReadError> {
        let (accessor, name) = entry(json, "accessors", index, from)?;
        let at = name.as_str();
        let AccessorShape { count, kind, width } = AccessorShape::of_types(accessor, at, types)?;
        let size = kind.size() * width;
        let offset = whole(accessor, "byteOffset", at)?.unwrap_or(0);
        let elements = match whole(accessor, "bufferView", at)? {
            Some(view) => Some(slice(buffers.view(view, at)?, offset, count, size, at)?),
            None => {
                if count > MAX_ZEROS.max(buffers.total()) {
                    return Err(ReadError::element(
                        at,
                        format!("claims {count} elements, but has no bufferView"),
                    ));
                }
                None
            }
        };
        let sparse = match &accessor["sparse"] {
            Value::Null => None,
            sparse => Some(Sparse::new(buffers, sparse, size, at)?),
        };
        let normalized = accessor["normalized"].as_bool().unwrap_or(false);
        Ok(Self { count, kind, width, normalized, elements, sparse, name })
    }

    /// Decodes the elements as floats; integers are normalized to 0..1 or -1..1 if the accessor or the caller
    /// requests it.
    ///
    /// Components of `N` that the accessor lacks are zero; surplus ones are dropped.
    pub(super) fn floats<const N: usize>(&self, normalized: bool) -> Result<Vec<[f32; N]>, ReadError> {
        let unit = normalized || self.normalized;
        // (One loop for all rare types, selected by a function pointer: docs/decisions/0019.)
        let rare: fn(&[u8]) -> f32 = match (self.kind, unit) {
            (Component::F32, _) => return self.decode_packed(f32::from_le_bytes),
            (Component::I8, true) => |b| (f32::from(i8::from_le_bytes(first(b))) / 127.0).max(-1.0),
            (Component::U8, true) => |b| f32::from(b[0]) / 255.0,
            (Component::I16, true) => |b| (f32::from(i16::from_le_bytes(first(b))) / 32767.0).max(-1.0),
            (Component::U16, true) => |b| f32::from(u16::from_le_bytes(first(b))) / 65535.0,
            (Component::I8, false) => |b| f32::from(i8::from_le_bytes(first(b))),
            (Component::U8, false) => |b| f32::from(b[0]),
            (Component::I16, false) => |b| f32::from(i16::from_le_bytes(first(b))),
            (Component::U16, false) => |b| f32::from(u16::from_le_bytes(first(b))),
            (Component::U32, _) => |b| u32::from_le_bytes(first(b)) as f32,
        };
        self.decode(rare)
    }

    /// Returns the bytes of all elements, each padded with zeros to a multiple of four; and the bytes from one
    /// to the next.
    pub(super) fn padded_bytes(&self) -> Result<(Vec<u8>, usize), ReadError> {
        let size = self.kind.size() * self.width;
        let stride = size.next_multiple_of(4);
        let mut out = vec![0; self.count * stride];
        if let Some(e) = &self.elements {
            for (to, from) in out.chunks_exact_mut(stride).zip(e.bytes.chunks(e.stride)) {
                to[..size].copy_from_slice(&from[..size]);
            }
        }
        if let Some(sparse) = &self.sparse {
            for k in 0..sparse.count {
                let i = sparse.index(k);
                let to = out.chunks_exact_mut(stride).nth(i).ok_or_else(|| self.sparse_beyond(i))?;
                to[..size].copy_from_slice(&sparse.values.bytes[k * sparse.values.stride..][..size]);
            }
        }
        Ok((out, stride))
    }

    /// Decodes the chosen elements as floats, `width` numbers of `out` each; numbers that the accessor lacks
    /// stay unchanged there. Integers are normalized to 0..1 or -1..1 if the accessor or the caller requests
    /// it.
    ///
    /// # Panics
    /// If an index is out of bounds, which callers have checked.
    pub(super) fn pick(
        &self,
        chosen: &[u32],
        normalized: bool,
        width: usize,
        out: &mut [f32],
    ) -> Result<(), ReadError> {
        let used = self.width.min(width);
        let size = self.kind.size();
        let unit = (normalized || self.normalized) && self.kind != Component::F32;
        let one = self.kind.one();
        let fill = |element: &mut [f32], bytes: &[u8]| {
            for (k, x) in element[..used].iter_mut().enumerate() {
                let number = self.kind.number(&bytes[k * size..]);
                *x = if unit { (number / one).max(-1.0) } else { number };
            }
        };
        for (element, &i) in out.chunks_exact_mut(width).zip(chosen) {
            assert!((i as usize) < self.count, "callers have checked the indices");
            match &self.elements {
                Some(e) => fill(element, &e.bytes[i as usize * e.stride..]),
                None => element[..used].fill(0.0),
            }
        }
        let Some(sparse) = &self.sparse else { return Ok(()) };
        // Of two values for one element the later one wins.
        let mut replaced = Vec::new();
        for k in 0..sparse.count {
            let i = sparse.index(k);
            if i >= self.count {
                return Err(self.sparse_beyond(i));
            }
            replaced.push((i, k));
        }
        replaced.sort_unstable();
        for (element, &i) in out.chunks_exact_mut(width).zip(chosen) {
            let after = replaced.partition_point(|&(j, _)| j <= i as usize);
            if let Some(&(j, k)) = after.checked_sub(1).and_then(|at| replaced.get(at))
                && j == i as usize
            {
                fill(element, &sparse.values.bytes[k * sparse.values.stride..]);
            }
        }
        Ok(())
    }

    fn sparse_beyond(&self, i: usize) -> ReadError {
        let count = self.count;
        ReadError::element(self.name.as_str(), format!("the sparse index {i} is beyond the {count} elements"))
    }

    /// Returns the minimum and the maximum of each component, as stored; sparse values are left out.
    /// Non-finite numbers count as zero; without elements, all bounds are zero.
    pub(super) fn bounds(&self) -> (Vec<Value>, Vec<Value>) {
        let (size, no_bounds) = (self.kind.size(), (f32::INFINITY, f32::NEG_INFINITY));
        let mut bounds = vec![no_bounds; self.width];
        for i in 0..self.count {
            for (k, (min, max)) in bounds.iter_mut().enumerate() {
                let at = |e: &Elements<'_>| self.kind.number(&e.bytes[i * e.stride + k * size..]);
                let number = self.elements.as_ref().map_or(0.0, at);
                let number = if number.is_finite() { number } else { 0.0 };
                (*min, *max) = (min.min(number), max.max(number));
            }
        }
        let shown = |x: f32| match self.kind {
            Component::F32 => Value::from(f64::from(x)),
            _ => Value::from(x as i64),
        };
        let bounds = bounds.into_iter().map(|b| if b == no_bounds { (0.0, 0.0) } else { b });
        bounds.map(|(min, max)| (shown(min), shown(max))).unzip()
    }

    /// Decodes the elements as indices.
    pub(super) fn indices(&self) -> Result<Vec<u32>, ReadError> {
        if self.width != 1 {
            return Err(ReadError::element(self.name.as_str(), "indices must be of type SCALAR"));
        }
        let flat = |v: Vec<[u32; 1]>| v.into_flattened();
        match self.kind {
            Component::U8 => self.decode(|b| b[0].into()).map(flat),
            Component::U16 => self.decode_packed(|b| u16::from_le_bytes(b).into()).map(flat),
            Component::U32 => self.decode_packed(u32::from_le_bytes).map(flat),
            other => Err(ReadError::element(
                self.name.as_str(),
                format!("indices must be unsigned integers, not {}", other.name()),
            )),
        }
    }

    /// Fast path for most accessors, whose components are tightly packed: a loop without branches.
    fn decode_packed<T: Copy + Default, const N: usize, const S: usize>(
        &self,
        read: impl Fn([u8; S]) -> T,
    ) -> Result<Vec<[T; N]>, ReadError> {
        match &self.elements {
            Some(e) if e.stride == S * N && self.width == N && self.sparse.is_none() => {
                let element = |b: &[[u8; S]]| std::array::from_fn(|k| read(b[k]));
                Ok(e.bytes.as_chunks().0.chunks_exact(N).map(element).collect())
            }
            _ => self.decode(|b| read(first(b))),
        }
    }

    fn decode<T: Copy + Default, const N: usize>(
        &self,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<[T; N]>, ReadError> {
        let (used, each) = (self.width.min(N), self.kind.size());
        let element = |bytes: &[u8]| {
            let mut out = [T::default(); N];
            for (x, b) in out[..used].iter_mut().zip(bytes.chunks_exact(each)) {
                *x = read(b);
            }
            out
        };
        let size = each * self.width;
        let mut out: Vec<[T; N]> = match &self.elements {
            None => vec![[T::default(); N]; self.count],
            Some(e) => e.bytes.chunks(e.stride).take(self.count).map(|b| element(&b[..size])).collect(),
        };
        if let Some(sparse) = &self.sparse {
            for k in 0..sparse.count {
                let i = sparse.index(k);
                let place = out.get_mut(i).ok_or_else(|| self.sparse_beyond(i))?;
                let at = k * sparse.values.stride;
                *place = element(&sparse.values.bytes[at..at + size]);
            }
        }
        Ok(out)
    }
}

impl<'b> Sparse<'b> {
    fn new(buffers: &'b Buffers<'_>, sparse: &Value, size: usize, at: &str) -> Result<Self, ReadError> {
        let Some(count) = whole(sparse, "count", at)? else {
            return Err(ReadError::element(at, "sparse.count is missing"));
        };
        let part = |name: &str, size: usize| {
            let part = &sparse[name];
            let Some(view) = whole(part, "bufferView", at)? else {
                return Err(ReadError::element(at, format!("sparse.{name} has no bufferView")));
            };
            let offset = whole(part, "byteOffset", at)?.unwrap_or(0);
            slice(buffers.view(view, at)?, offset, count, size, at)
        };
        let index_kind = component(&sparse["indices"], at)?;
        if !matches!(index_kind, Component::U8 | Component::U16 | Component::U32) {
            let problem = format!("sparse indices must be unsigned integers, not {}", index_kind.name());
            return Err(ReadError::element(at, problem));
        }
        Ok(Self {
            count,
            index_kind,
            indices: part("indices", index_kind.size())?,
            values: part("values", size)?,
        })
    }

    fn index(&self, k: usize) -> usize {
        let b = &self.indices.bytes[k * self.indices.stride..];
        match self.index_kind {
            Component::U8 => b[0].into(),
            Component::U16 => u16::from_le_bytes([b[0], b[1]]).into(),
            _ => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize,
        }
    }
}

/// Returns the first bytes of a component, as many as its type has.
#[inline(always)]
fn first<const S: usize>(bytes: &[u8]) -> [u8; S] {
    *bytes.first_chunk().expect("at least as many bytes as its type has")
}

fn component(object: &Value, at: &str) -> Result<Component, ReadError> {
    let code = whole(object, "componentType", at)?;
    code.and_then(Component::from_code).ok_or_else(|| {
        let shown = code.map_or("missing".to_owned(), |c| c.to_string());
        ReadError::element(at, format!("componentType is {shown}, expected 5120 to 5123, 5125 or 5126"))
    })
}

/// Returns `count` elements of `size` bytes from byte `offset` of a view, after a bounds check.
fn slice<'b>(
    view: View<'b>,
    offset: usize,
    count: usize,
    size: usize,
    at: &str,
) -> Result<Elements<'b>, ReadError> {
    let stride = view.stride.unwrap_or(size);
    if stride < size {
        return Err(ReadError::element(
            view.name,
            format!("byteStride is {stride}, but an element of {at} has {size} bytes"),
        ));
    }
    let length = match count {
        0 => Some(0),
        _ => stride.checked_mul(count - 1).and_then(|n| n.checked_add(size)),
    };
    let end = length.and_then(|n| n.checked_add(offset));
    let bytes = end.and_then(|end| view.bytes.get(offset..end)).ok_or_else(|| {
        ReadError::element(
            at,
            format!(
                "{count} elements of {size} bytes from byte {offset} reach beyond {} of {} bytes",
                view.name,
                view.bytes.len()
            ),
        )
    })?;
    Ok(Elements { bytes, stride })
}
