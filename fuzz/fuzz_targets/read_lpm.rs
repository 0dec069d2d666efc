//! Reads untrusted bytes as LPM: a mesh after every chunk or an error, never a panic. The checksums are corrected
//! first; otherwise they would stop nearly every input.
#![no_main]

use lodsmith_core::Topology;
use lodsmith_io::{Limits, LpmReader};

/// Returns the bytes with correct checksums.
fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let Some(all) = bytes.get(at + 4..at + 8 + length) else { break };
        let sum = crc32fast::hash(all).to_le_bytes();
        let Some(field) = bytes.get_mut(at + 8 + length..at + 12 + length) else { break };
        field.copy_from_slice(&sum);
        at += 12 + length;
    }
    bytes
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let bytes = with_checksums(bytes);
    let mut limits = Limits::default();
    limits.bytes = 16 << 20;
    if let Ok(mut reader) = LpmReader::new(&bytes[..], limits) {
        while let Ok(true) = reader.next_chunk() {}
        if reader.counts().faces < 100_000
            && let Ok(mesh) = reader.mesh()
        {
            Topology::unwelded(&mesh.surface()).check();
        }
        if let Ok(part) = reader.into_lpm() {
            assert_eq!(part.splits.faces.len(), part.splits.counts[part.splits.len()].faces as usize);
        }
    }
});
