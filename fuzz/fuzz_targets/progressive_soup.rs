//! Records a small soup as a progressive mesh and moves through random levels: every level is a valid mesh, and the
//! full level is bit-identical to the input, also after writing and reading a file.
#![no_main]

use lodsmith::{Input, NoControl, Progressive, Stop};
use lodsmith_core::Topology;
use lodsmith_fuzz::soup::{self, Bytes};
use lodsmith_io::{LpmOptions, ReadOptions, lpm};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mesh = soup::mesh(&mut bytes);
    let (mut options, data) = soup::options(&mut bytes, &mesh);
    if bytes.next() % 2 == 0 {
        options.stop = Stop { faces: None, vertices: None, ratio: None, error: None };
    }
    let input = Input::new(&mesh).with(data.view());
    let Ok(mut progressive) = Progressive::build(input, &options, &mut NoControl) else { return };
    let same = |other: &lodsmith_core::TriMesh| format!("{other:?}") == format!("{mesh:?}");
    assert!(same(&progressive.mesh().expect("the full level is a mesh")), "the full level is not the input");
    for _ in 0..16 {
        let amount = usize::from(bytes.next());
        match bytes.next() % 5 {
            0 => drop(progressive.to_faces(amount)),
            1 => drop(progressive.to_vertices(amount)),
            2 => drop(progressive.to_level(amount.min(progressive.top()))),
            3 => drop(progressive.refine(amount)),
            _ => drop(progressive.coarsen(amount)),
        }
        assert!(progressive.level() <= progressive.top());
        let level = progressive.mesh().expect("each level is a mesh");
        assert_eq!(level.face_count(), progressive.face_count());
        Topology::unwelded(&level.surface()).check();
        progressive.fitted_mesh().expect("each fitted level is a mesh");
    }
    progressive.to_level(progressive.top());
    assert!(same(&progressive.mesh().expect("a mesh")), "the full level is not the input after the moves");

    let mut file = Vec::new();
    if lpm::write(progressive.splits(), None, &LpmOptions::default(), &mut file).is_ok() {
        let back = lpm::read(&file[..], &ReadOptions::default()).expect("written files can be read");
        let back = Progressive::new(back.splits).mesh().expect("a mesh");
        assert!(same(&back), "the mesh of the file is not the input");
    }
});
