//! Decoder of `EXT_meshopt_compression` and `KHR_meshopt_compression` streams.
//!
//! Memory is only reserved once the stream is known to be long enough: each decoder grows its output as it
//! decodes, or first counts how many bytes the stream must have.
//!
//! Source: Khronos, "KHR_meshopt_compression" (appendices A and B), of which the older extension is a part.

mod attributes;
mod filters;
mod indices;
mod input;

pub(super) use filters::Filter;

/// Content of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StreamMode {
    /// Elements of any kind.
    Attributes,
    /// Indices, three for each triangle.
    Triangles,
    /// Indices of any kind.
    Indices,
}

/// Properties of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) mode: StreamMode,
    pub(super) filter: Filter,
    pub(super) count: usize,
    /// Bytes of an element.
    pub(super) stride: usize,
}

impl Layout {
    /// Checks what the format allows. The error is a clause that follows the name of a view.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { mode, filter, count, stride } = *self;
        let needs = |what: &str| Err(format!("has a byteStride of {stride}, and {what}"));
        match mode {
            StreamMode::Attributes if !stride.is_multiple_of(4) || !(4..=256).contains(&stride) => {
                return needs("ATTRIBUTES need a multiple of 4 up to 256");
            }
            StreamMode::Triangles | StreamMode::Indices if stride != 2 && stride != 4 => {
                return needs("indices need 2 or 4");
            }
            StreamMode::Triangles if !count.is_multiple_of(3) => {
                return Err(format!("has {count} indices, which make no whole triangles"));
            }
            StreamMode::Triangles | StreamMode::Indices if filter != Filter::None => {
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

/// Decodes `count` elements of `stride` bytes from a stream. The error is a clause that follows the name of a
/// view.
///
/// # Panics
/// If [`Layout::check`] refuses the layout.
pub(super) fn decode(stream: &[u8], layout: Layout) -> Result<Vec<u8>, &'static str> {
    assert_eq!(layout.check(), Ok(()), "callers check first");
    let Layout { mode, filter, count, stride } = layout;
    match mode {
        StreamMode::Attributes => {
            let mut elements = attributes::decode(stream, count, stride)?;
            filters::apply(filter, stride, &mut elements);
            Ok(elements)
        }
        StreamMode::Triangles => indices::triangles(stream, count / 3).map(|all| narrow(&all, stride)),
        StreamMode::Indices => indices::sequence(stream, count).map(|all| narrow(&all, stride)),
    }
}

/// Converts indices to bytes, 2 or 4 each.
fn narrow(indices: &[u32], stride: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(indices.len() * stride);
    for i in indices {
        out.extend_from_slice(&i.to_le_bytes()[..stride]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_that_are_none() {
        let layout = |mode, filter, count, stride| Layout { mode, filter, count, stride }.check();
        assert!(layout(StreamMode::Attributes, Filter::None, 1, 256).is_ok());
        for stride in [0, 2, 6, 260] {
            assert!(layout(StreamMode::Attributes, Filter::None, 1, stride).is_err());
            assert!(layout(StreamMode::Indices, Filter::None, 1, stride).is_ok() == (stride == 2));
        }
        assert!(layout(StreamMode::Triangles, Filter::None, 4, 2).is_err());
        assert!(layout(StreamMode::Triangles, Filter::Octahedral, 3, 4).is_err());
        assert!(layout(StreamMode::Attributes, Filter::Octahedral, 3, 12).is_err());
        assert!(layout(StreamMode::Attributes, Filter::Quaternion, 3, 4).is_err());
        assert!(layout(StreamMode::Attributes, Filter::Exponential, 3, 12).is_ok());
        assert!(layout(StreamMode::Attributes, Filter::Color, 3, 12).is_err());
    }
}
