//! Cleans a small random triangle soup: cleaning terminates, the result has none of the defects that are always
//! removed, and cleaning it again changes nothing.
#![no_main]

use lodsmith::{CleanOptions, Cleaned, Length, NoControl, NonManifold, clean};
use lodsmith_fuzz::soup::{self, Bytes};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mesh = soup::mesh(&mut bytes);
    let mut options = CleanOptions::default();
    options.non_manifold = bytes.one_of(&[NonManifold::Keep, NonManifold::Cut, NonManifold::Merge]);
    options.weld = bytes.one_of(&[None, None, Some(Length::OfDiagonal(0.05))]);
    options.prune = bytes.one_of(&[None, None, Some(Length::OfDiagonal(0.2))]);
    let Ok(cleaned) = clean(&mesh, &options, &mut NoControl) else { return };
    let (out, report) = (&cleaned.mesh, &cleaned.report);
    assert_eq!((report.faces, report.vertices), (out.face_count(), out.vertex_count()));
    assert!(out.face_count() <= mesh.face_count(), "more faces than before");
    assert!(out.positions().view().iter().flatten().all(f64::is_finite), "a non-finite coordinate");
    for t in out.surface().triangles() {
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "a face has a vertex twice");
    }
    if options.non_manifold == NonManifold::Cut {
        assert_eq!((report.remaining.non_manifold_edges, report.remaining.non_manifold_vertices), (0, 0));
    }
    // With pruning or welding, a second run may remove more: faces that joined components may be gone, and welding
    // moves vertices together.
    if options.weld.is_none() && options.prune.is_none() {
        match clean(out, &options, &mut NoControl) {
            Ok(Cleaned { report: again, .. }) => {
                assert_eq!((again.non_finite_faces, again.degenerate_faces, again.duplicate_faces), (0, 0, 0));
            }
            // Faces of zero area that had to stay may be removable after the removal of others.
            Err(why) => assert!(report.remaining.zero_area_faces > 0, "the result has faces: {why}"),
        }
    }
});
