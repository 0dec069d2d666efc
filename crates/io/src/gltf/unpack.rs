//! Decoding of compressed geometry: afterwards the file is as if it had never been compressed.
//!
//! ```text
//! decode each stream, within the limit for a file of this size
//! cut the streams out of the buffers, append their decoded bytes: one buffer, which the views refer to
//! remove the extensions from elements and lists
//! ```

mod decoded;
mod draco;
mod views;

use std::sync::Arc;

use serde_json::Value;

use super::compressed::{DRACO, MESHOPT, extension};
use super::container::list;
use super::extension_losses::ExtensionLosses;
use super::lists::drop_unused_extensions;
use crate::error::ReadError;

use decoded::DecodeBudget;

/// Limits on decoded bytes: per byte of the file, and a total that any file may reach. Guessed: the best
/// streams of real meshes shrink to a tenth, and only endless zeros to less than a hundredth.
const DECODED_PER_BYTE: u64 = 256;
const ALWAYS_DECODED: u64 = 16 << 20;

/// Returns true if anything in the file is compressed.
pub(super) fn is_needed(json: &Value) -> bool {
    let views = list(json, "bufferViews").iter();
    let mut primitives = list(json, "meshes").iter().flat_map(|m| list(m, "primitives"));
    views.chain(list(json, "buffers")).any(|v| extension(v).is_some())
        || primitives.any(|p| !p["extensions"][DRACO].is_null())
}

/// Decodes all compressed streams; returns the number of decoded bytes, and the extensions that are left out since views
/// have other numbers.
pub(super) fn unpack(
    json: &mut Value,
    buffers: &mut Vec<Arc<Vec<u8>>>,
    limit: u64,
) -> Result<(usize, ExtensionLosses), ReadError> {
    let mut losses = ExtensionLosses::default();
    if !is_needed(json) {
        return Ok((0, losses));
    }
    let packed: u64 = buffers.iter().map(|b| b.len() as u64).sum();
    let mut room = DecodeBudget {
        limit: packed.saturating_mul(DECODED_PER_BYTE).saturating_add(ALWAYS_DECODED).min(limit),
        used: 0,
    };
    views::unpack(json, buffers, &mut room)?;
    draco::unpack(json, buffers, &mut room, &mut losses)?;
    drop_unused_extensions(json, &[MESHOPT[0], MESHOPT[1], DRACO]);
    Ok((room.used as usize, losses))
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use serde_json::json;

    use super::*;
    use crate::gltf::compressed::fallbacks;

    #[test]
    fn fallback_buffers_are_found() {
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
    fn the_limit_is_shared_by_all_streams() {
        let mut room = DecodeBudget { limit: 10, used: 0 };
        assert!(room.take(6).is_ok());
        assert!(room.take(5).is_err());
        assert!(room.take(u64::MAX).is_err());
        assert_eq!(room.left(), 4);
        assert!(room.take(4).is_ok());
    }
}
