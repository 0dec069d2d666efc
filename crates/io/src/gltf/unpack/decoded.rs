//! Collection of decoded bytes, and the limit on them.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use serde_json::{Value, json};

use super::super::compressed::MESHOPT;
use super::super::container::{list, list_mut};
use super::super::lists::{move_view, take_extension, view_span};
use super::super::repack::{ByteSpan, Repacked};
use crate::error::ReadError;

/// Limit on decoded bytes, and how much of it is used.
pub(super) struct DecodeBudget {
    pub(super) limit: u64,
    pub(super) used: u64,
}

impl DecodeBudget {
    pub(super) fn left(&self) -> u64 {
        self.limit - self.used
    }

    pub(super) fn take(&mut self, bytes: u64) -> Result<(), ReadError> {
        let size = self.used.saturating_add(bytes);
        if size > self.limit {
            let what = "unpacked size of compressed data, for a file of this size,";
            return Err(ReadError::Limit { what, size, limit: self.limit });
        }
        self.used = size;
        Ok(())
    }
}

/// Decoded bytes, not yet placed in a buffer.
#[derive(Default)]
pub(super) struct DecodedBytes {
    pub(super) bytes: Vec<u8>,
    /// Views, each with its range of these bytes.
    pub(super) placed: Vec<(usize, Range<usize>)>,
    /// Byte ranges of the streams.
    pub(super) freed: Vec<ByteSpan>,
}

impl DecodedBytes {
    /// Appends the bytes of a view, aligned for numbers of any type.
    pub(super) fn push(&mut self, view: usize, bytes: &[u8]) {
        let start = self.bytes.len().next_multiple_of(8);
        self.bytes.resize(start, 0);
        self.bytes.extend_from_slice(bytes);
        self.placed.push((view, start..self.bytes.len()));
    }

    /// Merges the remaining bytes and the decoded bytes into one buffer.
    pub(super) fn finish(self, json: &mut Value, buffers: &mut Vec<Arc<Vec<u8>>>) {
        let new: HashSet<usize> = self.placed.iter().map(|(view, _)| *view).collect();
        let views = || list(json, "bufferViews").iter().enumerate().filter(|(i, _)| !new.contains(i));
        let kept: Vec<ByteSpan> = views().filter_map(|(_, view)| view_span(view)).collect();
        let mut repacked = Repacked::new(buffers, &kept, &self.freed);
        let mut bytes = std::mem::take(&mut repacked.bytes);
        let base = bytes.len().next_multiple_of(8);
        bytes.resize(base, 0);
        bytes.extend_from_slice(&self.bytes);

        let all = list_mut(json, "bufferViews");
        for (_, view) in all.iter_mut().enumerate().filter(|(i, _)| !new.contains(i)) {
            move_view(view, &repacked);
        }
        for (view, range) in self.placed {
            let view = &mut all[view];
            view["buffer"] = 0.into();
            view["byteOffset"] = (base + range.start).into();
            view["byteLength"] = range.len().into();
        }
        if let Some(list) = json.get_mut("buffers").and_then(Value::as_array_mut) {
            list.truncate(1);
            for buffer in list {
                MESHOPT.iter().for_each(|extension| drop(take_extension(buffer, extension)));
                if !buffer.is_object() {
                    *buffer = json!({});
                }
                buffer["byteLength"] = bytes.len().into();
            }
        }
        *buffers = vec![Arc::new(bytes)];
    }
}
