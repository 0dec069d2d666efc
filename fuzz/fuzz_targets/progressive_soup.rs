//! Records a small soup as a progressive mesh and moves through its levels by a script: every level is a
//! valid mesh, the full one is bit-identical to the input, and a file of it gives the same.
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
    let Ok(mut road) = Progressive::build(input, &options, &mut NoControl) else { return };
    let same = |other: &lodsmith_core::TriMesh| format!("{other:?}") == format!("{mesh:?}");
    assert!(same(&road.mesh().expect("the full level is a mesh")), "the full level is not the input");
    for _ in 0..16 {
        let amount = usize::from(bytes.next());
        match bytes.next() % 5 {
            0 => drop(road.to_faces(amount)),
            1 => drop(road.to_vertices(amount)),
            2 => drop(road.to_level(amount.min(road.top()))),
            3 => drop(road.refine(amount)),
            _ => drop(road.coarsen(amount)),
        }
        assert!(road.level() <= road.top());
        let level = road.mesh().expect("each level is a mesh");
        assert_eq!(level.face_count(), road.face_count());
        Topology::unwelded(&level.surface()).check();
        road.fitted_mesh().expect("with its fit too");
    }
    road.to_level(road.top());
    assert!(same(&road.mesh().expect("a mesh")), "the way back does not lead to the input");

    let mut file = Vec::new();
    if lpm::write(road.splits(), None, &LpmOptions::default(), &mut file).is_ok() {
        let back = lpm::read(&file[..], &ReadOptions::default()).expect("what we write, we read");
        let back = Progressive::new(back.splits).mesh().expect("a mesh");
        assert!(same(&back), "the file does not hold the input");
    }
});
