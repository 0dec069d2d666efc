//! Simplifies a small random triangle soup by any method with random options: a result or an error, never a
//! panic; and a result keeps its guarantees.
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
        "the report counts what is there"
    );
    assert!(out.positions().view().iter().flatten().all(f64::is_finite), "a coordinate that is no number");
    for t in out.surface().triangles() {
        assert!(t.iter().all(|v| v.index() < out.vertex_count()), "an index beyond the vertices");
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "a face names a vertex twice");
    }
    let again = simplify_with(&input, &options, &mut NoControl).expect("it was done before");
    // (Compared as text: attributes may be NaN.)
    assert_eq!(format!("{result:?}"), format!("{again:?}"), "the same bytes again");
});
