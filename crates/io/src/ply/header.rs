//! The PLY header: elements and their properties.

use lodsmith_core::IntegerType;

use crate::error::ReadError;
use crate::excerpt::excerpt;

/// The encoding of numbers in the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A numeric type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Returns the corresponding integer type of mesh attributes.
    pub(super) const fn integer(self) -> Option<IntegerType> {
        Some(match self {
            Self::I8 => IntegerType::I8,
            Self::U8 => IntegerType::U8,
            Self::I16 => IntegerType::I16,
            Self::U16 => IntegerType::U16,
            Self::I32 => IntegerType::I32,
            Self::U32 => IntegerType::U32,
            Self::F32 | Self::F64 => return None,
        })
    }

    /// Returns the value that maps to 1 in a colour of this type; integers wider than 16 bits hold bytes in practice.
    pub(super) const fn color_divisor(self) -> f32 {
        match self {
            Self::F32 | Self::F64 => 1.0,
            Self::U16 => 65535.0,
            _ => 255.0,
        }
    }

    /// Returns the size in a binary body in bytes.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// The type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PropertyType {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: PropertyType,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Returns the minimum size of a record in bytes: lists are empty, text numbers have one digit and one
    /// blank.
    fn least_size(&self, encoding: Encoding) -> u64 {
        let size = |p: &Property| match (encoding, p.kind) {
            (Encoding::Ascii, _) => 2,
            (_, PropertyType::One(s) | PropertyType::List { count: s, .. }) => s.size() as u64,
        };
        self.properties.iter().map(size).sum()
    }

    /// Returns the size of a binary record in bytes, if no property is a list.
    pub(super) fn fixed_size(&self) -> Option<usize> {
        self.properties
            .iter()
            .map(|p| match p.kind {
                PropertyType::One(s) => Some(s.size()),
                PropertyType::List { .. } => None,
            })
            .sum()
    }
}

/// A file that names more pictures than this is not a real model. Guessed.
const MAX_PICTURES: usize = 4096;

/// A parsed header.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Offset of the body from the start of the file, in bytes.
    pub(super) body: usize,
    /// Names of pictures in `comment TextureFile` lines.
    pub(super) pictures: Vec<String>,
}

impl Header {
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// Parses the header of a file.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, ReadError> {
        let mut lines = HeaderLines::new(bytes);
        if lines.next().is_none_or(|(_, l)| l.trim() != "ply") {
            return Err(ReadError::line(1, "a PLY file begins with a line `ply`"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut pictures = Vec::new();
        while let Some((number, line)) = lines.next() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                [] | ["obj_info", ..] => {}
                ["comment", "TextureFile", ..] if pictures.len() < MAX_PICTURES => {
                    // The name may hold blanks.
                    let name = line.split_once("TextureFile").map_or("", |(_, name)| name.trim());
                    pictures.extend((!name.is_empty()).then(|| name.to_owned()));
                }
                ["comment", ..] => {}
                ["format", name, ..] => encoding = Some(encoding_named(number, name)?),
                ["element", name, count] => {
                    if elements.iter().any(|e| e.name == name) {
                        return Err(ReadError::line(number, format!("element {name} is declared twice")));
                    }
                    let count = count.parse().map_err(|_| {
                        ReadError::line(number, format!("`{}` is not a number of records", excerpt(count)))
                    })?;
                    elements.push(Element { name: excerpt(name), count, properties: Vec::new() });
                }
                ["property", "list", count, item, name] => {
                    let kind = PropertyType::List {
                        count: scalar_named(number, count)?,
                        item: scalar_named(number, item)?,
                    };
                    add_property(number, &mut elements, name, kind)?;
                }
                ["property", kind, name] => {
                    let kind = PropertyType::One(scalar_named(number, kind)?);
                    add_property(number, &mut elements, name, kind)?;
                }
                ["end_header"] => {
                    let encoding = encoding.ok_or_else(|| {
                        ReadError::line(number, "the header has no format line (ascii, binary_...)")
                    })?;
                    return Ok(Self { encoding, elements, body: lines.at, pictures });
                }
                _ => {
                    let line = excerpt(line.trim());
                    return Err(ReadError::line(number, format!("`{line}` is not a line of a PLY header")));
                }
            }
        }
        Err(ReadError::file("the header has no end: a line `end_header` is missing"))
    }

    /// Checks the counts against the size of the file, before any allocation.
    pub(super) fn check_size(&self, file: usize) -> Result<(), ReadError> {
        let present = (file - self.body) as u64;
        let mut wanted = 0u64;
        for e in &self.elements {
            wanted = wanted.saturating_add((e.count as u64).saturating_mul(e.least_size(self.encoding)));
            // The last text number needs no blank after it.
            if wanted > present + 1 || (wanted > present && self.encoding != Encoding::Ascii) {
                let (name, count) = (&e.name, e.count);
                return Err(ReadError::file(format!(
                    "the header claims {count} records of element {name}, which end at byte {wanted} of the body or \
                     later, but the body has {present} bytes: the file is cut off, or the header is wrong"
                )));
            }
        }
        Ok(())
    }

    /// Estimates from the counts the bytes of memory that the mesh takes while it is built.
    pub(super) fn mesh_bytes(&self) -> u64 {
        let vertex = |p: &Property| match p.kind {
            PropertyType::One(Scalar::F64 | Scalar::I32 | Scalar::U32) if is_named(p, &["x", "y", "z"]) => 8,
            _ if is_named(p, &["s", "t", "u", "v", "texture_u", "texture_v", "alpha"]) => 4,
            _ if is_named(p, &["x", "y", "z", "nx", "ny", "nz", "red", "green"]) => 4,
            // Includes the space for alpha.
            _ if is_named(p, &["blue"]) => 8,
            PropertyType::One(_) => 4,
            PropertyType::List { .. } => 0,
        };
        // Little-endian triangles are copied directly; others go through a list of corners.
        let face = if self.encoding == Encoding::Little { 12 } else { 32 };
        let bytes = |e: &Element| {
            // Numbers of faces are read in double precision.
            let numbers =
                e.properties.iter().filter(|p| matches!(p.kind, PropertyType::One(_))).count() as u64;
            let each = match &*e.name {
                "vertex" => e.properties.iter().map(vertex).sum(),
                "face" => face + 16 * numbers,
                _ => face,
            };
            (e.count as u64).saturating_mul(each)
        };
        self.elements.iter().map(bytes).fold(0, u64::saturating_add)
    }
}

/// Returns true if a property has one of these names.
fn is_named(property: &Property, names: &[&str]) -> bool {
    names.contains(&property.name.as_str())
}

fn add_property(
    number: usize,
    elements: &mut [Element],
    name: &str,
    kind: PropertyType,
) -> Result<(), ReadError> {
    let Some(element) = elements.last_mut() else {
        return Err(ReadError::line(number, format!("property {} belongs to no element", excerpt(name))));
    };
    element.properties.push(Property { name: excerpt(name), kind });
    Ok(())
}

fn encoding_named(number: usize, name: &str) -> Result<Encoding, ReadError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        _ => Err(ReadError::line(
            number,
            format!(
                "`{}` is not a PLY format (ascii, binary_little_endian, binary_big_endian)",
                excerpt(name)
            ),
        )),
    }
}

fn scalar_named(number: usize, name: &str) -> Result<Scalar, ReadError> {
    Scalar::from_name(name)
        .ok_or_else(|| ReadError::line(number, format!("`{}` is not a PLY number type", excerpt(name))))
}

/// An iterator over header lines: their number from 1, and their text. The first line decides the line
/// ending.
struct HeaderLines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: usize,
    end: u8,
}

impl<'a> HeaderLines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let end = match bytes.iter().position(|&b| b == b'\n' || b == b'\r') {
            Some(i) if bytes[i] == b'\r' && bytes.get(i + 1) != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        Self { bytes, at: 0, number: 0, end }
    }

    fn next(&mut self) -> Option<(usize, std::borrow::Cow<'a, str>)> {
        // Guessed: no header line is longer; without this, a binary file whose header has no end would be
        // scanned as one line.
        const MAX_LINE_BYTES: usize = 1 << 16;
        let rest = &self.bytes[self.at..];
        let rest = &rest[..rest.len().min(MAX_LINE_BYTES)];
        let length = match rest.iter().position(|&b| b == self.end) {
            Some(i) => {
                self.at += i + 1;
                i
            }
            // The last line of a file may lack its end.
            None if !rest.is_empty() && rest.len() < MAX_LINE_BYTES => {
                self.at += rest.len();
                rest.len()
            }
            None => return None,
        };
        self.number += 1;
        Some((self.number, String::from_utf8_lossy(&rest[..length])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_parsed() {
        let h = Header::parse(
            b"ply\r\nformat binary_big_endian 1.0\r\nobj_info x\r\ncomment \xff\r\nelement vertex 2\r\n\
              property float64 x\r\nelement face 1\r\nproperty list uint8 int16 vertex_index\r\nend_header\r\n\n\n",
        )
        .unwrap();
        assert_eq!(h.encoding, Encoding::Big);
        assert_eq!(h.element("vertex").unwrap().fixed_size(), Some(8));
        assert_eq!(h.element("face").unwrap().fixed_size(), None);
        assert!(h.check_size(h.body + 17).is_ok());
        assert!(h.check_size(h.body + 16).is_err());
    }

    #[test]
    fn errors_of_headers_name_the_line() {
        let error = |text: &str| Header::parse(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(error("plx\n"), "line 1: a PLY file begins with a line `ply`");
        assert_eq!(error("ply\nelement vertex -3\n"), "line 2: `-3` is not a number of records");
        assert_eq!(error("ply\nproperty float x\n"), "line 2: property x belongs to no element");
        assert_eq!(error("ply\nformat ascii 1.0\n"), "the header has no end: a line `end_header` is missing");
        assert_eq!(error("ply\nend_header\n"), "line 2: the header has no format line (ascii, binary_...)");
        assert_eq!(error("ply\n\u{1b}[2J\n"), "line 2: `\\u{1b}[2J` is not a line of a PLY header");
        assert_eq!(error("ply\nhello\n"), "line 2: `hello` is not a line of a PLY header");
    }
}
