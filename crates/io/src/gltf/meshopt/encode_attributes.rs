//! Encoder of attribute streams; their layout is described at the decoder.
//!
//! ```text
//! version 1: choose for each channel the kind of difference that takes the fewest bytes
//! for each block, for each byte of an element: the differences, in groups of 16, each with the number of bits that takes the fewest bytes
//! ```

use super::attributes::{Channel, GROUP, block_elements, widths};

/// Version of an attribute stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum StreamVersion {
    /// The version of `EXT_meshopt_compression`.
    V0,
    /// The version of `KHR_meshopt_compression`, with more kinds of differences.
    V1,
}

/// Blocks that are tried to choose the kind of difference of a channel: spread evenly over the stream.
/// (Guessed: with all blocks the Knight of the test models is 0.1 % smaller, and takes five times as long.)
const TRIED_BLOCKS: usize = 24;

/// Encodes elements of `stride` bytes, a multiple of four up to 256.
pub(super) fn encode(elements: &[u8], stride: usize, version: StreamVersion) -> Vec<u8> {
    let per_block = block_elements(stride);
    let modes = match version {
        StreamVersion::V0 => vec![Channel::Bytes; stride / 4],
        StreamVersion::V1 => (0..stride / 4).map(|c| best_channel(elements, stride, c)).collect(),
    };
    let mut out = vec![if version == StreamVersion::V0 { 0xa0 } else { 0xa1 }];
    let first = elements.get(..stride).map_or_else(|| vec![0; stride], <[u8]>::to_vec);
    let mut before = first.clone();
    for block in elements.chunks(per_block * stride) {
        let controls = out.len();
        if version == StreamVersion::V1 {
            out.resize(controls + stride / 4, 0);
        }
        for (c, mode) in modes.iter().enumerate() {
            let planes = differences(block, &before, stride, c, *mode);
            for (k, plane) in planes.iter().enumerate() {
                let elements = block.len() / stride;
                match version {
                    StreamVersion::V0 => groups(plane, widths(None), &mut out),
                    StreamVersion::V1 => {
                        let control = control(plane, elements);
                        out[controls + c] |= control << (2 * k);
                        match control {
                            2 => {}
                            3 => out.extend_from_slice(&plane[..elements]),
                            _ => groups(plane, widths(Some(control)), &mut out),
                        }
                    }
                }
            }
        }
        before.copy_from_slice(&block[block.len() - stride..]);
    }
    let modes: Vec<u8> = match version {
        StreamVersion::V0 => Vec::new(),
        StreamVersion::V1 => modes.into_iter().map(Channel::code).collect(),
    };
    // Decoders may read that far beyond the last group.
    let least: usize = if version == StreamVersion::V0 { 32 } else { 24 };
    let padding = least.saturating_sub(stride + modes.len());
    out.resize(out.len() + padding, 0);
    out.extend_from_slice(&first);
    out.extend_from_slice(&modes);
    out
}

/// Returns the differences of the four bytes of a channel, one list for each byte, padded with zeros to
/// whole groups.
fn differences(block: &[u8], before: &[u8], stride: usize, channel: usize, mode: Channel) -> [Vec<u8>; 4] {
    let count = block.len() / stride;
    let mut planes = [(); 4].map(|()| vec![0; count.next_multiple_of(GROUP)]);
    let at = 4 * channel;
    let bytes = |element: &[u8]| [element[at], element[at + 1], element[at + 2], element[at + 3]];
    let mut last = bytes(before);
    for (i, element) in block.chunks_exact(stride).enumerate() {
        let now = bytes(element);
        for (plane, d) in planes.iter_mut().zip(mode.difference(last, now)) {
            plane[i] = d;
        }
        last = now;
    }
    planes
}

/// Returns the kind of difference that takes the fewest bytes for a channel, by a sample of the blocks.
fn best_channel(elements: &[u8], stride: usize, channel: usize) -> Channel {
    let per_block = block_elements(stride) * stride;
    let blocks = elements.len().div_ceil(per_block);
    let step = blocks.div_ceil(TRIED_BLOCKS).max(1);
    let cost = |mode: Channel| -> usize {
        let cost_of = |b: usize| {
            let start = b * per_block;
            let block = &elements[start..elements.len().min(start + per_block)];
            let before = &elements[start.saturating_sub(stride)..][..stride];
            let planes = differences(block, before, stride, channel, mode);
            planes.iter().map(|plane| plane_bytes(plane, block.len() / stride)).sum::<usize>()
        };
        (0..blocks).step_by(step).map(cost_of).sum()
    };
    // Rotations by whole bytes only exchange the bytes, so seven are enough.
    let all = [Channel::Bytes, Channel::Words].into_iter().chain((0..8).map(Channel::Xor));
    all.min_by_key(|mode| cost(*mode)).unwrap_or(Channel::Bytes)
}

/// Returns the number of bytes that the differences of one byte take in version 1.
fn plane_bytes(plane: &[u8], elements: usize) -> usize {
    match control(plane, elements) {
        2 => 0,
        3 => elements,
        control => groups_bytes(plane, widths(Some(control))),
    }
}

/// Returns the encoding of the differences of one byte: 0 or 1 for groups of either choice of widths, 2 for
/// zeros, 3 for plain bytes.
fn control(plane: &[u8], elements: usize) -> u8 {
    if plane.iter().all(|d| *d == 0) {
        return 2;
    }
    let [a, b] = [0, 1].map(|control| groups_bytes(plane, widths(Some(control))));
    match () {
        () if elements <= a.min(b) => 3,
        () if a < b => 0,
        () => 1,
    }
}

fn groups_bytes(plane: &[u8], widths: [u32; 4]) -> usize {
    let groups = plane.as_chunks::<GROUP>().0;
    groups.len().div_ceil(4) + groups.iter().map(|group| best_width(group, widths).1).sum::<usize>()
}

/// Returns the index of the width that takes the fewest bytes for a group, and their number.
fn best_width(group: &[u8; GROUP], widths: [u32; 4]) -> (usize, usize) {
    let bytes = |bits: u32| match bits {
        0 if group.iter().all(|d| *d == 0) => 0,
        0 => usize::MAX,
        8 => GROUP,
        bits => GROUP / 8 * bits as usize + group.iter().filter(|d| **d >= (1 << bits) - 1).count(),
    };
    let all = widths.into_iter().map(bytes).enumerate();
    all.min_by_key(|(_, bytes)| *bytes).unwrap_or((3, GROUP))
}

/// Appends the groups of one byte, each with the best of four widths.
fn groups(plane: &[u8], widths: [u32; 4], out: &mut Vec<u8>) {
    let groups = plane.as_chunks::<GROUP>().0;
    let header = out.len();
    out.resize(header + groups.len().div_ceil(4), 0);
    for (i, group) in groups.iter().enumerate() {
        let (width, _) = best_width(group, widths);
        out[header + i / 4] |= (width as u8) << (i % 4 * 2);
        match widths[width] {
            0 => {}
            8 => out.extend_from_slice(group),
            bits => short(group, bits, out),
        }
    }
}

/// Appends differences of 1, 2 or 4 bits; larger differences follow as bytes.
fn short(group: &[u8; GROUP], bits: u32, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + GROUP / 8 * bits as usize, 0);
    let per_byte = 8 / bits;
    let beyond = (1u8 << bits) - 1;
    for (i, &difference) in (0u32..).zip(group) {
        let place = i % per_byte;
        // Single bits start at the lowest bit, others at the highest.
        let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
        out[start + (i / per_byte) as usize] |= difference.min(beyond) << shift;
    }
    out.extend(group.iter().copied().filter(|d| *d >= beyond));
}
