//! Decoder and encoder of `EXT_meshopt_compression` and `KHR_meshopt_compression` streams.
//!
//! The decoder reserves memory only once the stream is known to be long enough: each decoder grows its output as it
//! decodes, or first counts how many bytes the stream must have.
//!
//! Source: Khronos, "KHR_meshopt_compression" (appendices A and B), of which the older extension is a part.

mod attributes;
mod encode_attributes;
pub(super) mod encode_filters;
mod encode_indices;
mod filters;
mod indices;
mod input;

pub(super) use encode_attributes::StreamVersion;
pub(super) use filters::{Filter, apply};

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

impl StreamMode {
    /// Returns its name in a file.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Attributes => "ATTRIBUTES",
            Self::Triangles => "TRIANGLES",
            Self::Indices => "INDICES",
        }
    }
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
                return Err(format!("has {count} indices, which is not a multiple of three"));
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

/// Encodes elements of this layout, which a filter has encoded already if there is one. Bytes that do not make
/// a whole element are left out.
///
/// # Panics
/// If [`Layout::check`] refuses the layout.
pub(super) fn encode(elements: &[u8], layout: Layout, version: StreamVersion) -> Vec<u8> {
    assert_eq!(layout.check(), Ok(()), "callers check first");
    let Layout { mode, stride, count, .. } = layout;
    let elements = &elements[..count * stride];
    if mode == StreamMode::Attributes {
        return encode_attributes::encode(elements, stride, version);
    }
    let index = |bytes: &[u8]| bytes.iter().rev().fold(0u32, |n, b| n << 8 | u32::from(*b));
    let indices: Vec<u32> = elements.chunks_exact(stride).map(index).collect();
    match mode {
        StreamMode::Triangles => encode_indices::triangles(&indices),
        _ => encode_indices::sequence(&indices),
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
    use proptest::prelude::*;

    use super::*;

    /// Returns the layout and bytes of elements that change slowly, as in meshes, or not at all.
    fn elements() -> impl Strategy<Value = (usize, Vec<u8>)> {
        let step = prop_oneof![Just(0i32), -2i32..3, -40i32..40, any::<i32>()];
        (1usize..9, 0usize..700, 0u32..4).prop_flat_map(move |(words, count, _)| {
            let steps = prop::collection::vec(step.clone(), words * count);
            steps.prop_map(move |steps| {
                let mut now = vec![0i32; words];
                let mut bytes = Vec::new();
                for (i, step) in steps.into_iter().enumerate() {
                    now[i % words] = now[i % words].wrapping_add(step);
                    bytes.extend_from_slice(&now[i % words].to_le_bytes());
                }
                (4 * words, bytes)
            })
        })
    }

    /// Returns the triangles with the lowest corner first: the encoder may rotate them.
    fn turned(indices: &[u32]) -> Vec<[u32; 3]> {
        let turn = |t: &[u32; 3]| {
            let [a, b, c] = *t;
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or(*t)
        };
        indices.as_chunks::<3>().0.iter().map(turn).collect()
    }

    proptest! {
        #[test]
        fn attributes_come_back((stride, bytes) in elements(), is_new in any::<bool>()) {
            let version = if is_new { StreamVersion::V1 } else { StreamVersion::V0 };
            let layout = Layout { mode: StreamMode::Attributes, filter: Filter::None, count: bytes.len() / stride, stride };
            let stream = encode(&bytes, layout, version);
            prop_assert_eq!(decode(&stream, layout), Ok(bytes));
        }

        #[test]
        fn triangles_come_back(
            picks in prop::collection::vec(prop_oneof![0u32..30, any::<u32>()], 0..300),
            small in any::<bool>(),
        ) {
            // Most corners are near the end of the used indices.
            let mut indices = Vec::new();
            let mut next = 0u32;
            for pick in &picks[..picks.len() / 3 * 3] {
                indices.push(match pick {
                    0..9 => { next += 1; next - 1 }
                    9..28 => next.saturating_sub(*pick - 8),
                    28 | 29 => { next = 1; pick - 28 }
                    other => other % 60_000,
                });
            }
            let stride = if small { 2 } else { 4 };
            let layout = Layout { mode: StreamMode::Triangles, filter: Filter::None, count: indices.len(), stride };
            let stream = encode(&narrow(&indices, stride), layout, StreamVersion::V0);
            let got = decode(&stream, layout).unwrap();
            let got: Vec<u32> = got.chunks_exact(stride).map(|b| b.iter().rev().fold(0, |n, b| n << 8 | u32::from(*b))).collect();
            prop_assert_eq!(turned(&got), turned(&indices));
        }

        #[test]
        fn sequences_come_back(indices in prop::collection::vec(prop_oneof![0u32..60, 0u32..1 << 30], 0..300)) {
            let layout = Layout { mode: StreamMode::Indices, filter: Filter::None, count: indices.len(), stride: 4 };
            let bytes = narrow(&indices, 4);
            prop_assert_eq!(decode(&encode(&bytes, layout, StreamVersion::V0), layout), Ok(bytes));
        }
    }

    #[test]
    fn streams_of_several_meshes_start_again() {
        // Two strips, each with its own indices from 0.
        let strip =
            |n: u32| (0..n).flat_map(|i| if i % 2 == 0 { [i, i + 1, i + 2] } else { [i + 1, i, i + 2] });
        let indices: Vec<u32> = strip(100).chain(strip(100)).collect();
        let layout =
            Layout { mode: StreamMode::Triangles, filter: Filter::None, count: indices.len(), stride: 4 };
        let stream = encode(&narrow(&indices, 4), layout, StreamVersion::V0);
        assert!(stream.len() < 200 + 40, "little more than a byte per triangle: {}", stream.len());
        let got = decode(&stream, layout).unwrap();
        let got: Vec<u32> = got.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        assert_eq!(turned(&got), turned(&indices));
    }

    #[test]
    fn invalid_layouts_are_refused() {
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
