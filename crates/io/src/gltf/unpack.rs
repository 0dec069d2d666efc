//! Compressed geometry on its way in: afterwards the file is as if it had never been compressed.
//!
//! ```text
//! decode each stream, within what a file of this size may ask for
//! cut the streams out of the buffers, append what they held: one buffer, which the views name
//! take the extensions off elements and lists
//! ```

mod draco;
mod views;

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use serde_json::{Value, json};

use super::container::{list, list_mut, number};
use super::lists::{forget_extensions, move_view, span, take_extension};
use super::repack::{Repacked, Span};
use crate::error::ReadError;

use views::MESHOPT;

/// The extension of primitives.
const DRACO: &str = "KHR_draco_mesh_compression";

/// Bytes for each byte of a file that its compressed streams may become, and that any file may have. Guessed: the best
/// streams of real meshes come to a tenth, and only zeros without end to less than a hundredth.
const PER_BYTE: u64 = 256;
const ALWAYS: u64 = 16 << 20;

/// Whether anything in the file is compressed.
pub(super) fn is_needed(json: &Value) -> bool {
    let views = list(json, "bufferViews").iter();
    let mut primitives = list(json, "meshes").iter().flat_map(|m| list(m, "primitives"));
    views.chain(list(json, "buffers")).any(|v| views::extension(v).is_some())
        || primitives.any(|p| !p["extensions"][DRACO].is_null())
}

/// Buffers for readers without an extension, that nothing else needs; their bytes may be left out.
pub(super) fn fallbacks(json: &Value) -> HashSet<usize> {
    let (mut plain, mut spare) = (HashSet::new(), HashSet::new());
    for view in list(json, "bufferViews") {
        match views::extension(view) {
            Some((_, extension)) => {
                plain.extend(number(&extension["buffer"]));
                spare.extend(number(&view["buffer"]));
            }
            None => plain.extend(number(&view["buffer"])),
        }
    }
    let marked = |b: &Value| views::extension(b).is_some_and(|(_, e)| e["fallback"] == true);
    spare.extend(list(json, "buffers").iter().enumerate().filter(|(_, b)| marked(b)).map(|(i, _)| i));
    spare.retain(|buffer| !plain.contains(buffer));
    spare
}

/// Decodes all that is compressed. How many bytes of the buffers came out of streams.
pub(super) fn unpack(
    json: &mut Value,
    buffers: &mut Vec<Arc<Vec<u8>>>,
    limit: u64,
) -> Result<usize, ReadError> {
    if !is_needed(json) {
        return Ok(0);
    }
    let packed: u64 = buffers.iter().map(|b| b.len() as u64).sum();
    let mut room = Room { limit: packed.saturating_mul(PER_BYTE).saturating_add(ALWAYS).min(limit), used: 0 };
    views::unpack(json, buffers, &mut room)?;
    draco::unpack(json, buffers, &mut room)?;
    forget_extensions(json, &[MESHOPT[0], MESHOPT[1], DRACO]);
    Ok(room.used as usize)
}

/// What may still be decoded.
struct Room {
    limit: u64,
    used: u64,
}

impl Room {
    fn left(&self) -> u64 {
        self.limit - self.used
    }

    fn take(&mut self, bytes: u64) -> Result<(), ReadError> {
        let size = self.used.saturating_add(bytes);
        if size > self.limit {
            let what = "size of what is compressed, for a file of this size,";
            return Err(ReadError::Limit { what, size, limit: self.limit });
        }
        self.used = size;
        Ok(())
    }
}

/// Decoded bytes until they have a place.
#[derive(Default)]
struct Fresh {
    bytes: Vec<u8>,
    /// Views and what they hold of these.
    placed: Vec<(usize, Range<usize>)>,
    /// The streams.
    freed: Vec<Span>,
}

impl Fresh {
    /// Appends the bytes of a view; they begin where numbers of any type may.
    fn push(&mut self, view: usize, bytes: &[u8]) {
        let start = self.bytes.len().next_multiple_of(8);
        self.bytes.resize(start, 0);
        self.bytes.extend_from_slice(bytes);
        self.placed.push((view, start..self.bytes.len()));
    }

    /// Makes one buffer of what stays and what is new.
    fn finish(self, json: &mut Value, buffers: &mut Vec<Arc<Vec<u8>>>) {
        let new: HashSet<usize> = self.placed.iter().map(|(view, _)| *view).collect();
        let views = || list(json, "bufferViews").iter().enumerate().filter(|(i, _)| !new.contains(i));
        let kept: Vec<Span> = views().filter_map(|(_, view)| span(view)).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_that_are_spare() {
        let compressed = |buffer: usize, of: usize| json!({ "buffer": buffer, "extensions": { "EXT_meshopt_compression": { "buffer": of } } });
        let json = json!({
            "buffers": [{}, {}, {}, { "extensions": { "KHR_meshopt_compression": { "fallback": true } } }],
            "bufferViews": [compressed(1, 0), compressed(2, 0), { "buffer": 2 }],
        });
        assert_eq!(fallbacks(&json), HashSet::from([1, 3]));
        assert!(is_needed(&json));
        assert!(!is_needed(&json!({ "buffers": [{}], "bufferViews": [{ "buffer": 0 }] })));
    }

    #[test]
    fn room_is_for_all_together() {
        let mut room = Room { limit: 10, used: 0 };
        assert!(room.take(6).is_ok());
        assert!(room.take(5).is_err());
        assert!(room.take(u64::MAX).is_err());
        assert_eq!(room.left(), 4);
        assert!(room.take(4).is_ok());
    }
}
