//! Simplifies a small random triangle soup with the index calls of the C interface and random arguments: a result with
//! its guarantees or an error, never a panic.
#![no_main]

use lodsmith_c::{IndexCall, IndexResult};
use lodsmith_core::WedgeId;
use lodsmith_fuzz::soup::{self, Bytes};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mesh = soup::mesh(&mut bytes);
    let view = mesh.positions().view();
    let position = |w| view.get(mesh.vertex_of(WedgeId::new(w))).map(|x| x as f32);
    let positions: Vec<[f32; 3]> = (0..mesh.wedge_count()).map(position).collect();
    let mut indices: Vec<u32> = mesh.triangles().iter().flatten().map(|w| w.0).collect();
    if bytes.next() == 255 {
        indices.push(u32::from(bytes.next()));
    }
    let values: Vec<f32> = mesh.uvs().unwrap_or_default().iter().flatten().copied().collect();
    let weights = if values.is_empty() { vec![] } else { vec![bytes.one_of(&[0.0, 1.0, 1e-3, -1.0, f32::NAN]), 0.5] };
    let has_locks = bytes.next() & 1 != 0;
    let locks: Vec<u8> = if has_locks { positions.iter().map(|_| bytes.next() & 7).collect() } else { vec![] };
    let call = IndexCall {
        indices: &indices,
        positions: &positions,
        attributes: &values,
        weights: &weights,
        locks: &locks,
        target_index_count: usize::from(bytes.next()),
        target_error: bytes.one_of(&[f32::MAX, 0.0, 1e-3, 0.05, 1.0, f32::NAN]),
        options: u32::from(bytes.next()) | u32::from(bytes.next() & 1) << 8,
    };
    let which = bytes.next();
    let run = || match which % 3 {
        0 => call.simplify(),
        1 => call.with_attributes(),
        _ => call.with_update().map(|done| {
            assert!(done.positions.len() == positions.len() && done.attributes.len() == values.len());
            IndexResult { indices: done.indices, error: done.error }
        }),
    };
    match run() {
        Ok(done) => {
            assert!(done.indices.len() <= indices.len(), "more indices than before");
            assert!(done.indices.iter().all(|&i| (i as usize) < positions.len()), "an index out of range");
            assert!(done.error >= 0.0, "the error is {}", done.error);
            assert_eq!(run(), Ok(done), "the same input gives another result");
        }
        Err(text) => assert!(!text.starts_with("internal error"), "{text}"),
    }
});
