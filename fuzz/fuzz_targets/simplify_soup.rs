//! Simplifies a small random triangle soup with any method and random options: a result with its guarantees or an
//! error, never a panic.
#![no_main]

use lodsmith::{Input, MethodKind, NoControl, simplify_with};
use lodsmith_fuzz::soup::{self, Bytes};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mesh = soup::mesh(&mut bytes);
    let (options, data) = soup::options(&mut bytes, &mesh);
    let input = Input::new(&mesh).with(data.view());
    let Ok(result) = simplify_with(&input, &options, &mut NoControl) else { return };
    let (out, report) = (&result.mesh, &result.report);
    // The face count of a new mesh depends on its edge length only.
    if options.method.kind() != MethodKind::Remesh {
        assert!(out.face_count() <= mesh.face_count(), "more faces than before");
    }
    assert_eq!(
        (report.faces, report.vertices),
        (out.face_count(), out.vertex_count()),
        "the counts of the report are wrong"
    );
    assert!(out.positions().view().iter().flatten().all(f64::is_finite), "a non-finite coordinate");
    for t in out.surface().triangles() {
        assert!(t.iter().all(|v| v.index() < out.vertex_count()), "an index out of range");
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "a face has a vertex twice");
    }
    let again = simplify_with(&input, &options, &mut NoControl).expect("the first run succeeded");
    // (Compared as text: attributes may be NaN.)
    assert_eq!(format!("{result:?}"), format!("{again:?}"), "the same input gives another result");
});
