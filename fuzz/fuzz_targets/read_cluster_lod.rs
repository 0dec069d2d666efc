//! Bytes of a stranger as levels of clusters: levels or an error, never a panic, and what is read is cut and written.
#![no_main]

use lodsmith_io::Limits;
use lodsmith_io::cluster_lod::{read_bytes, write_to};

/// Gives every section the checksum of its bytes, so that what lies behind the checksums is reached.
fn resealed(bytes: &[u8]) -> Vec<u8> {
    let mut file = bytes.to_vec();
    let mut at = 16;
    while let Some(length) = file.get(at + 4..at + 12) {
        let length = u64::from_le_bytes(length.try_into().expect("eight bytes"));
        let end = usize::try_from(length).ok().and_then(|n| n.checked_add(at + 12));
        let Some(end) = end.filter(|end| end.checked_add(4).is_some_and(|e| e <= file.len())) else { break };
        let mut sum = crc32fast::Hasher::new();
        sum.update(&file[at..at + 4]);
        sum.update(&file[at + 12..end]);
        file[end..end + 4].copy_from_slice(&sum.finalize().to_le_bytes());
        at = end + 4;
    }
    file
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut limits = Limits::default();
    limits.bytes = 16 << 20;
    let _ = read_bytes(bytes, limits);
    let Ok(stored) = read_bytes(&resealed(bytes), limits) else { return };
    let lod = &stored.lod;
    // Three bytes make a triangle.
    assert!(lod.mesh().face_count() <= bytes.len().saturating_mul(1024));
    for error in [0.0, 0.5 * lod.coarsest_error(), f64::INFINITY] {
        let surface = lod.mesh_of(&lod.cut(error));
        assert!(surface.face_count() <= lod.mesh().face_count());
    }
    let mut out = Vec::new();
    write_to(lod, &stored.regions, &mut out).expect("memory takes all bytes");
    read_bytes(&out, Limits::default()).expect("what we write, we read");
});
