//! Streams of `EXT_meshopt_compression` and `KHR_meshopt_compression`: bytes to the bytes of a view.
//!
//! Nothing is reserved before the stream has been seen to hold it: each decoder grows its output as it goes, or counts
//! first how many bytes the stream must have.
//!
//! Source: Khronos, "KHR_meshopt_compression" (appendices A and B), of which the older extension is a part.

mod attributes;
mod filters;
mod indices;

/// What a stream holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Elements of any kind.
    Attributes,
    /// Indices, three for each triangle.
    Triangles,
    /// Indices of any kind.
    Indices,
}

/// What is done with decoded elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    /// Directions on an octahedron.
    Octahedral,
    /// Rotations without their largest component.
    Quaternion,
    /// Floats as whole numbers times powers of two.
    Exponential,
    /// Colours as brightness and two differences.
    Color,
}

/// How a stream is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) mode: Mode,
    pub(super) filter: Filter,
    pub(super) count: usize,
    /// Bytes of an element.
    pub(super) stride: usize,
}

impl Layout {
    /// What the format does not allow; a clause that goes on after the name of a view.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { mode, filter, count, stride } = *self;
        let needs = |what: &str| Err(format!("has a byteStride of {stride}, and {what}"));
        match mode {
            Mode::Attributes if !stride.is_multiple_of(4) || !(4..=256).contains(&stride) => {
                return needs("ATTRIBUTES need a multiple of 4 up to 256");
            }
            Mode::Triangles | Mode::Indices if stride != 2 && stride != 4 => {
                return needs("indices need 2 or 4");
            }
            Mode::Triangles if !count.is_multiple_of(3) => {
                return Err(format!("has {count} indices, which make no whole triangles"));
            }
            Mode::Triangles | Mode::Indices if filter != Filter::None => {
                return Err("has a filter, which indices cannot have".to_owned());
            }
            _ => {}
        }
        match filter {
            Filter::Octahedral | Filter::Color if stride != 4 && stride != 8 => {
                needs("its filter needs 4 or 8")
            }
            Filter::Quaternion if stride != 8 => needs("its filter needs 8"),
            _ => Ok(()),
        }
    }
}

/// The bytes that a stream holds: `count` elements of `stride` bytes. Errors go on after the name of a view.
///
/// # Panics
/// If the layout is not one that [`Layout::check`] lets pass.
pub(super) fn decode(stream: &[u8], layout: Layout) -> Result<Vec<u8>, &'static str> {
    assert_eq!(layout.check(), Ok(()), "callers check first");
    let Layout { mode, filter, count, stride } = layout;
    match mode {
        Mode::Attributes => {
            let mut elements = attributes::decode(stream, count, stride)?;
            filters::apply(filter, stride, &mut elements);
            Ok(elements)
        }
        Mode::Triangles => indices::triangles(stream, count / 3).map(|all| narrow(&all, stride)),
        Mode::Indices => indices::sequence(stream, count).map(|all| narrow(&all, stride)),
    }
}

/// Indices as bytes, of 2 or of 4 each.
fn narrow(indices: &[u32], stride: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(indices.len() * stride);
    for i in indices {
        out.extend_from_slice(&i.to_le_bytes()[..stride]);
    }
    out
}

const ENDS: &str = "is cut off: its compressed bytes end too early";
const GOES_ON: &str = "is damaged: compressed bytes are left over";

/// Bytes that are read one after another.
struct Input<'b> {
    bytes: &'b [u8],
}

impl<'b> Input<'b> {
    fn take(&mut self, count: usize) -> Result<&'b [u8], &'static str> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(ENDS)?;
        self.bytes = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, &'static str> {
        let (&first, rest) = self.bytes.split_first().ok_or(ENDS)?;
        self.bytes = rest;
        Ok(first)
    }

    /// A number in groups of seven bits, the lowest first; bits beyond 32 are passed over.
    fn number(&mut self) -> Result<u32, &'static str> {
        let mut number = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err("is damaged: an index has more than five bytes")
    }

    fn end(self) -> Result<(), &'static str> {
        if self.bytes.is_empty() { Ok(()) } else { Err(GOES_ON) }
    }
}

/// The difference that a number without sign stands for: 0, -1, 1, -2, 2 and so on.
const fn zigzag(n: u32) -> u32 {
    (n >> 1) ^ (n & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_seven_bits() {
        let read = |bytes: &[u8]| Input { bytes }.number();
        assert_eq!(read(&[0x7f]), Ok(0x7f));
        assert_eq!(read(&[0x81, 0x04]), Ok(0x201));
        assert_eq!(read(&[0xff, 0xa0, 0x05]), Ok(0x7f | 0x20 << 7 | 0x05 << 14));
        assert_eq!(
            read(&[0xff, 0xff, 0xff, 0xff, 0xff]),
            Err("is damaged: an index has more than five bytes")
        );
        assert_eq!(read(&[0x80]), Err(ENDS));
    }

    #[test]
    fn differences() {
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|n| zigzag(n) as i32), [0, -1, 1, -2, i32::MIN]);
    }

    #[test]
    fn layouts_that_are_none() {
        let layout = |mode, filter, count, stride| Layout { mode, filter, count, stride }.check();
        assert!(layout(Mode::Attributes, Filter::None, 1, 256).is_ok());
        for stride in [0, 2, 6, 260] {
            assert!(layout(Mode::Attributes, Filter::None, 1, stride).is_err());
            assert!(layout(Mode::Indices, Filter::None, 1, stride).is_ok() == (stride == 2));
        }
        assert!(layout(Mode::Triangles, Filter::None, 4, 2).is_err());
        assert!(layout(Mode::Triangles, Filter::Octahedral, 3, 4).is_err());
        assert!(layout(Mode::Attributes, Filter::Octahedral, 3, 12).is_err());
        assert!(layout(Mode::Attributes, Filter::Quaternion, 3, 4).is_err());
        assert!(layout(Mode::Attributes, Filter::Exponential, 3, 12).is_ok());
        assert!(layout(Mode::Attributes, Filter::Color, 3, 12).is_err());
    }
}
