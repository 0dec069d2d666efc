//! Merging of several buffers into one, without unused bytes.

use std::ops::Range;
use std::sync::Arc;

/// A byte range of a buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ByteSpan {
    pub(super) buffer: usize,
    pub(super) bytes: Range<usize>,
}

/// All buffers one after another, and a map from old to new offsets.
#[derive(Debug)]
pub(super) struct Repacked {
    pub(super) bytes: Vec<u8>,
    buffers: Vec<BufferCuts>,
}

/// Position of one buffer in the merged one, and what was cut.
#[derive(Debug)]
struct BufferCuts {
    /// Its new start.
    begin: usize,
    /// Its old length.
    length: usize,
    /// Ranges that were cut out of it, in order, each with the total length of all before it.
    cuts: Vec<(Range<usize>, usize)>,
}

/// Bytes move by multiples of this, so that numbers of any type stay aligned.
const ALIGNMENT: usize = 8;

impl Repacked {
    /// Cuts out bytes that are freed and not kept; bytes that are neither stay.
    pub(super) fn new(buffers: &[Arc<Vec<u8>>], kept: &[ByteSpan], freed: &[ByteSpan]) -> Self {
        let mut out = Self { bytes: Vec::new(), buffers: Vec::new() };
        let by_buffer = |spans: &[ByteSpan]| {
            let mut all = vec![Vec::new(); buffers.len()];
            for span in spans {
                if let (Some(list), Some(buffer)) = (all.get_mut(span.buffer), buffers.get(span.buffer)) {
                    list.push(span.bytes.start.min(buffer.len())..span.bytes.end.min(buffer.len()));
                }
            }
            all
        };
        for ((buffer, kept), freed) in buffers.iter().zip(by_buffer(kept)).zip(by_buffer(freed)) {
            // A few zeros between two spans are padding.
            let is_padding = |gap: Range<usize>| gap.len() < ALIGNMENT && buffer[gap].iter().all(|b| *b == 0);
            let mut freed = merge_spans(freed, is_padding);
            // So are zeros before the end of the buffer.
            if let Some(last) = freed.last_mut().filter(|last| is_padding(last.end..buffer.len())) {
                last.end = buffer.len();
            }
            let kept = merge_spans(kept, |gap| gap.is_empty());
            let (mut cuts, mut gone) = (Vec::new(), 0);
            for cut in subtract_spans(&freed, &kept) {
                let length =
                    if cut.end == buffer.len() { cut.len() } else { cut.len() / ALIGNMENT * ALIGNMENT };
                if length > 0 {
                    cuts.push((cut.start..cut.start + length, gone));
                    gone += length;
                }
            }
            out.bytes.resize(out.bytes.len().next_multiple_of(ALIGNMENT), 0);
            let begin = out.bytes.len();
            let mut from = 0;
            for (cut, _) in &cuts {
                out.bytes.extend_from_slice(&buffer[from..cut.start]);
                from = cut.end;
            }
            out.bytes.extend_from_slice(&buffer[from..]);
            out.buffers.push(BufferCuts { begin, length: buffer.len(), cuts });
        }
        out
    }

    /// Returns the new offset of a byte of a buffer; `None` for a buffer that does not exist.
    pub(super) fn new_offset(&self, buffer: usize, offset: usize) -> Option<usize> {
        let BufferCuts { begin, length, cuts } = self.buffers.get(buffer)?;
        let offset = offset.min(*length);
        let before = cuts.partition_point(|(cut, _)| cut.start < offset);
        let last = before.checked_sub(1).and_then(|at| cuts.get(at));
        let gone = last.map_or(0, |(cut, sum)| sum + (cut.end.min(offset) - cut.start));
        Some(begin + (offset - gone))
    }
}

/// Returns the spans sorted; spans that touch, or whose gap `may_go`, are merged.
fn merge_spans(mut spans: Vec<Range<usize>>, may_go: impl Fn(Range<usize>) -> bool) -> Vec<Range<usize>> {
    spans.retain(|s| s.start < s.end);
    spans.sort_unstable_by_key(|s| (s.start, s.end));
    let mut out: Vec<Range<usize>> = Vec::new();
    for span in spans {
        match out.last_mut() {
            Some(last) if span.start <= last.end || may_go(last.end..span.start) => {
                last.end = last.end.max(span.end);
            }
            _ => out.push(span),
        }
    }
    out
}

/// Returns the parts of `spans` that are not in `kept`; both are sorted and disjoint.
fn subtract_spans(spans: &[Range<usize>], kept: &[Range<usize>]) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut next = 0;
    for span in spans {
        let mut from = span.start;
        while next < kept.len() && kept[next].end <= from {
            next += 1;
        }
        let mut at = next;
        while at < kept.len() && kept[at].start < span.end {
            if from < kept[at].start {
                out.push(from..kept[at].start);
            }
            from = from.max(kept[at].end);
            at += 1;
        }
        if from < span.end {
            out.push(from..span.end);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(buffer: usize, bytes: Range<usize>) -> ByteSpan {
        ByteSpan { buffer, bytes }
    }

    #[test]
    fn kept_bytes_stay_aligned() {
        let buffer = Arc::new((1..=100u8).collect::<Vec<_>>());
        let kept = [span(0, 40..60), span(0, 50..64), span(0, 90..1000)];
        let got = Repacked::new(std::slice::from_ref(&buffer), &kept, &[span(0, 3..70), span(0, 61..99)]);
        // 3..40 is cut to 32 bytes, 64..90 to 24.
        assert_eq!(got.bytes.len(), 100 - 32 - 24);
        for span in &kept {
            let to = got.new_offset(0, span.bytes.start).unwrap();
            assert_eq!(to % ALIGNMENT, span.bytes.start % ALIGNMENT);
            let end = span.bytes.end.min(100);
            assert_eq!(got.bytes[to..to + end - span.bytes.start], buffer[span.bytes.start..end]);
        }
        assert_eq!(got.bytes[..3], [1, 2, 3]);
        assert_eq!(got.new_offset(1, 0), None);
        assert!(got.new_offset(0, usize::MAX).is_some());
    }

    #[test]
    fn nothing_freed_nothing_changed() {
        let buffers = [Arc::new(vec![1u8, 2, 3]), Arc::new(vec![4u8, 5])];
        let got = Repacked::new(&buffers, &[], &[]);
        assert_eq!(got.bytes, [1, 2, 3, 0, 0, 0, 0, 0, 4, 5]);
        assert_eq!(got.new_offset(1, 1), Some(9));
    }

    #[test]
    fn padding_is_removed_with_its_data() {
        let mut bytes = vec![7u8; 32];
        bytes[13..16].fill(0);
        bytes[29..].fill(0);
        let got = Repacked::new(&[Arc::new(bytes)], &[], &[span(0, 0..13), span(0, 16..29)]);
        assert!(got.bytes.is_empty());
    }
}
