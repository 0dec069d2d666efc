//! Head of the file: its properties, and the coding of positions and values.

use lodsmith_core::mesh::Morphed;
use lodsmith_core::splits::{Counts, Layout};
use lodsmith_core::{IntegerType, Positions, Semantic};

use super::step::SplitFormat;
use super::values::{PlaceCode, ValueCode};
use crate::error::ReadError;

/// The version of the format.
pub(super) const VERSION: u16 = 2;

/// Maximum number of values of a wedge. Guessed: no mesh has as many, and a few bytes could request all of
/// them.
pub(super) const MAX_VALUES_PER_WEDGE: usize = 4096;
/// Maximum number of bytes in the name of an attribute.
pub(super) const MAX_NAME_BYTES: usize = u16::MAX as usize;

const HAS_VERTEX_MAP: u16 = 1;
const HAS_REGIONS: u16 = 2;
const IS_DOUBLE: u16 = 4;
const IS_GRID: u16 = 8;

/// Properties of a file, which precede the base mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Head {
    pub(super) has_vertex_map: bool,
    pub(super) has_regions: bool,
    /// Declared counts: of splits, the full mesh, the base. No memory is reserved because of them.
    pub(super) splits: u32,
    pub(super) full: Counts,
    pub(super) base: Counts,
    pub(super) places: PlaceCode,
    /// Bits of a coordinate, if positions are on a grid.
    pub(super) bits: u8,
    pub(super) columns: Vec<Column>,
}

/// An attribute and its coding.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    pub(super) kind: ColumnKind,
    pub(super) width: usize,
    pub(super) code: ValueCode,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ColumnKind {
    Normal,
    Uv,
    Color,
    Further(Semantic),
}

/// Returns the attributes of a layout, in the order of a row.
pub(super) fn column_kinds(layout: &Layout) -> Vec<(ColumnKind, usize)> {
    let first = [
        (layout.has_normals, (ColumnKind::Normal, 3)),
        (layout.has_uvs, (ColumnKind::Uv, 2)),
        (layout.has_colors, (ColumnKind::Color, 4)),
    ];
    let first = first.into_iter().filter(|x| x.0).map(|x| x.1);
    first.chain(layout.further.iter().map(|(s, width)| (ColumnKind::Further(s.clone()), *width))).collect()
}

impl Head {
    pub(super) fn layout(&self) -> Layout {
        let has = |kind: ColumnKind| self.columns.iter().any(|c| c.kind == kind);
        let further = self.columns.iter().filter_map(|c| match &c.kind {
            ColumnKind::Further(semantic) => Some((semantic.clone(), c.width)),
            _ => None,
        });
        Layout {
            has_normals: has(ColumnKind::Normal),
            has_uvs: has(ColumnKind::Uv),
            has_colors: has(ColumnKind::Color),
            further: further.collect(),
        }
    }
    /// Returns the number of coded integers per wedge.
    pub(super) fn channels(&self) -> usize {
        self.columns.iter().map(|c| c.code.channels(c.width)).sum()
    }
    /// Returns the number of values per wedge.
    pub(super) fn width(&self) -> usize {
        self.columns.iter().map(|c| c.width).sum()
    }
    pub(super) fn is_exact(&self) -> bool {
        !matches!(self.places, PlaceCode::Grid { .. })
    }
    pub(super) fn split_format(&self) -> SplitFormat {
        SplitFormat {
            has_vertex_map: self.has_vertex_map,
            has_regions: self.has_regions,
            channels: self.channels(),
        }
    }
    pub(super) fn no_positions(&self) -> Positions {
        if self.places.is_double() { Positions::F64(Vec::new()) } else { Positions::F32(Vec::new()) }
    }
    pub(super) fn encode_row(&self, mut row: &[f32], out: &mut Vec<i32>) {
        for column in &self.columns {
            let (own, rest) = row.split_at(column.width);
            column.code.encode(own, out);
            row = rest;
        }
    }
    pub(super) fn decode_row(&self, mut codes: &[i32], out: &mut Vec<f32>) {
        for column in &self.columns {
            let (own, rest) = codes.split_at(column.code.channels(column.width));
            column.code.decode(own, out);
            codes = rest;
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let flags = [
            (HAS_VERTEX_MAP, self.has_vertex_map),
            (HAS_REGIONS, self.has_regions),
            (IS_DOUBLE, self.places.is_double()),
            (IS_GRID, !self.is_exact()),
        ];
        let flags = flags.iter().filter(|f| f.1).fold(0, |sum, f| sum | f.0);
        out.extend(VERSION.to_le_bytes());
        out.extend(flags.to_le_bytes());
        let counts = [self.full, self.base].map(|c| [c.faces, c.wedges, c.vertices]);
        for n in [self.splits].iter().chain(counts.as_flattened()) {
            out.extend(n.to_le_bytes());
        }
        if let PlaceCode::Grid { min, step, .. } = self.places {
            out.push(self.bits);
            min.iter().chain([&step]).for_each(|x| out.extend(x.to_le_bytes()));
        }
        out.extend((self.columns.len() as u16).to_le_bytes());
        for column in &self.columns {
            let (kind, set, name) = kind_number(&column.kind);
            out.push(kind);
            out.extend(set.to_le_bytes());
            out.extend((name.len() as u16).to_le_bytes());
            out.extend(name.as_bytes());
            out.extend((column.width as u32).to_le_bytes());
            match &column.code {
                ValueCode::Float => out.push(0),
                ValueCode::Grid { bits, axes } => {
                    out.extend([1, *bits]);
                    axes.as_flattened().iter().for_each(|x| out.extend(x.to_le_bytes()));
                }
                ValueCode::Direction { bits } => out.extend([2, *bits]),
                ValueCode::Tangent { bits } => out.extend([3, *bits]),
            }
        }
        out
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, ReadError> {
        let mut bytes = HeadBytes(bytes);
        let version = u16::from_le_bytes(bytes.take()?);
        if version == 1 {
            return Err(ReadError::Unsupported(
                "version 1 of LPM is no longer read: build the file again with `lodsmith progressive build`"
                    .into(),
            ));
        }
        if version != VERSION {
            return Err(ReadError::Unsupported(format!(
                "LPM version {version} is not supported, only {VERSION}: use a newer lodsmith"
            )));
        }
        let flags = u16::from_le_bytes(bytes.take()?);
        let mut number = || bytes.take().map(u32::from_le_bytes);
        let splits = number()?;
        let mut counts =
            || Ok::<_, ReadError>(Counts { faces: number()?, wedges: number()?, vertices: number()? });
        let (full, base) = (counts()?, counts()?);
        let is_double = flags & IS_DOUBLE != 0;
        let (mut bits, mut places) = (0, if is_double { PlaceCode::F64 } else { PlaceCode::F32 });
        if flags & IS_GRID != 0 {
            bits = bytes.byte()?;
            let min = [bytes.float()?, bytes.float()?, bytes.float()?];
            places = PlaceCode::Grid { min, step: bytes.positive()?, is_double };
        }
        let count = u16::from_le_bytes(bytes.take()?);
        let mut columns = Vec::new();
        for _ in 0..count {
            columns.push(column(&mut bytes)?);
        }
        let head = Self {
            has_vertex_map: flags & HAS_VERTEX_MAP != 0,
            has_regions: flags & HAS_REGIONS != 0,
            splits,
            full,
            base,
            places,
            bits,
            columns,
        };
        if head.width() > MAX_VALUES_PER_WEDGE {
            return Err(head_error("it has more than 4,096 values for each wedge"));
        }
        // The layout has one of each standard attribute, before all others.
        let wanted = column_kinds(&head.layout());
        match head.columns.iter().map(|c| (&c.kind, c.width)).eq(wanted.iter().map(|(k, w)| (k, *w))) {
            true => Ok(head),
            false => Err(head_error("its attributes are in an invalid order")),
        }
    }
}

fn column(bytes: &mut HeadBytes<'_>) -> Result<Column, ReadError> {
    let kind = bytes.byte()?;
    let set = u16::from_le_bytes(bytes.take()?);
    let name = u16::from_le_bytes(bytes.take()?);
    let name = String::from_utf8(bytes.slice(usize::from(name))?.to_vec())
        .map_err(|_| head_error("the name of an attribute is not UTF-8"))?;
    let width = u32::from_le_bytes(bytes.take()?) as usize;
    let kind =
        kind_of(kind, set, name).ok_or_else(|| head_error("it has an attribute of an unknown kind"))?;
    if width == 0 || width > MAX_VALUES_PER_WEDGE {
        return Err(head_error("an attribute has no values, or too many"));
    }
    let code = match bytes.byte()? {
        0 => ValueCode::Float,
        1 => {
            let bits = bytes.byte()?;
            let axes = (0..width).map(|_| Ok([bytes.float()?, bytes.positive()?]));
            ValueCode::Grid { bits, axes: axes.collect::<Result<_, ReadError>>()? }
        }
        2 if width == 3 => ValueCode::Direction { bits: bytes.direction_bits()? },
        3 if width == 4 => ValueCode::Tangent { bits: bytes.direction_bits()? },
        _ => return Err(head_error("the values of an attribute have an unknown coding")),
    };
    Ok(Column { kind, width, code })
}

/// Returns the code of a kind, the number of its set or morph target, and its name.
pub(super) fn kind_number(kind: &ColumnKind) -> (u8, u16, &str) {
    match kind {
        ColumnKind::Normal => (0, 0, ""),
        ColumnKind::Uv => (1, 0, ""),
        ColumnKind::Color => (2, 0, ""),
        ColumnKind::Further(semantic) => match semantic {
            Semantic::Tangent => (3, 0, ""),
            Semantic::Uv(set) => (4, u16::from(*set), ""),
            Semantic::Color(set) => (5, u16::from(*set), ""),
            Semantic::Joints(set) => (6, u16::from(*set), ""),
            Semantic::Weights(set) => (7, u16::from(*set), ""),
            Semantic::Morph { target, of: Morphed::Position } => (8, *target, ""),
            Semantic::Morph { target, of: Morphed::Normal } => (9, *target, ""),
            Semantic::Morph { target, of: Morphed::Tangent } => (10, *target, ""),
            Semantic::Custom(name) => (11, 0, name),
            Semantic::Discrete { name, of } => (12, of.number() as u16, name),
        },
    }
}

fn kind_of(number: u8, set: u16, name: String) -> Option<ColumnKind> {
    let small = || u8::try_from(set).ok();
    Some(ColumnKind::Further(match number {
        0 => return Some(ColumnKind::Normal),
        1 => return Some(ColumnKind::Uv),
        2 => return Some(ColumnKind::Color),
        3 => Semantic::Tangent,
        4 => Semantic::Uv(small()?),
        5 => Semantic::Color(small()?),
        6 => Semantic::Joints(small()?),
        7 => Semantic::Weights(small()?),
        8 => Semantic::Morph { target: set, of: Morphed::Position },
        9 => Semantic::Morph { target: set, of: Morphed::Normal },
        10 => Semantic::Morph { target: set, of: Morphed::Tangent },
        11 => Semantic::Custom(name),
        12 => Semantic::Discrete { name, of: IntegerType::from_number(set.into())? },
        _ => return None,
    }))
}

fn head_error(what: &str) -> ReadError {
    ReadError::element("the head", what)
}

/// Bytes that are still to be read.
struct HeadBytes<'a>(&'a [u8]);

impl<'a> HeadBytes<'a> {
    fn slice(&mut self, count: usize) -> Result<&'a [u8], ReadError> {
        let (front, rest) = self.0.split_at_checked(count).ok_or_else(|| head_error("it is too short"))?;
        self.0 = rest;
        Ok(front)
    }
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let (front, rest) = self.0.split_first_chunk().ok_or_else(|| head_error("it is too short"))?;
        self.0 = rest;
        Ok(*front)
    }
    fn byte(&mut self) -> Result<u8, ReadError> {
        self.take().map(|[b]| b)
    }
    fn float(&mut self) -> Result<f64, ReadError> {
        let x = f64::from_le_bytes(self.take()?);
        if x.is_finite() { Ok(x) } else { Err(head_error("the origin of a grid is not finite")) }
    }
    fn positive(&mut self) -> Result<f64, ReadError> {
        let x = self.float()?;
        if x > 0.0 { Ok(x) } else { Err(head_error("the step of a grid is not above 0")) }
    }
    fn direction_bits(&mut self) -> Result<u8, ReadError> {
        let bits = self.byte()?;
        if (2..=24).contains(&bits) {
            Ok(bits)
        } else {
            Err(head_error("a direction has an invalid number of bits"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head() -> Head {
        let columns = vec![
            Column { kind: ColumnKind::Normal, width: 3, code: ValueCode::Direction { bits: 12 } },
            Column {
                kind: ColumnKind::Further(Semantic::Tangent),
                width: 4,
                code: ValueCode::Tangent { bits: 12 },
            },
            Column {
                kind: ColumnKind::Further(Semantic::Uv(1)),
                width: 2,
                code: ValueCode::Grid { bits: 16, axes: vec![[0.0, 0.5], [-1.0, 0.25]] },
            },
            Column {
                kind: ColumnKind::Further(Semantic::Custom("heat ü".to_owned())),
                width: 1,
                code: ValueCode::Float,
            },
        ];
        let counts = |n| Counts { faces: n, wedges: n + 1, vertices: n + 2 };
        Head {
            has_vertex_map: true,
            has_regions: false,
            splits: 7,
            full: counts(90),
            base: counts(4),
            places: PlaceCode::Grid { min: [1.0, -2.0, 3.5], step: 0.125, is_double: true },
            bits: 16,
            columns,
        }
    }

    #[test]
    fn a_head_comes_back() {
        assert_eq!(Head::from_bytes(&head().to_bytes()).unwrap(), head());
        assert_eq!((head().channels(), head().width()), (2 + 3 + 2 + 1, 3 + 4 + 2 + 1));
    }

    #[test]
    fn a_head_that_is_cut_or_wrong_is_refused() {
        let bytes = head().to_bytes();
        for end in 0..bytes.len() {
            assert!(Head::from_bytes(&bytes[..end]).is_err(), "{end}");
        }
        for (version, advice) in [(0, "not supported"), (1, "progressive build"), (3, "a newer lodsmith")] {
            let mut other = bytes.clone();
            other[0] = version;
            let Err(ReadError::Unsupported(text)) = Head::from_bytes(&other) else { panic!("{version}") };
            assert!(text.contains(advice), "{text}");
        }
        let mut twice = head();
        twice.columns.insert(1, twice.columns[0].clone());
        assert!(Head::from_bytes(&twice.to_bytes()).is_err());
        let mut flat = head();
        flat.places = PlaceCode::Grid { min: [0.0; 3], step: 0.0, is_double: false };
        assert!(Head::from_bytes(&flat.to_bytes()).is_err());
    }
}
