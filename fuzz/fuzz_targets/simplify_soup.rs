//! A small soup of triangles by chance, with options by chance: an answer or an error, never a panic; and an answer holds
//! what every answer promises.
#![no_main]

use lodsmith::{
    BorderPolicy, Fit, Length, Measure, Method, NoControl, Placement, SimplifyOptions, Stop, TopologyPolicy,
    simplify,
};
use lodsmith_core::{Positions, TriMesh, VertexId};

/// Takes bytes one after another; none are left: zeros.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn next(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[usize::from(self.next()) % values.len()]
    }

    /// Mostly points of a coarse lattice, where places meet, faces are flat and areas nothing; sometimes any number.
    fn coordinate(&mut self) -> f64 {
        match self.next() {
            255 => f64::from_bits(u64::from_le_bytes(std::array::from_fn(|_| self.next()))),
            254 => f64::from(f32::from_bits(u32::from_le_bytes(std::array::from_fn(|_| self.next())))),
            small => f64::from(small % 16) * 0.25,
        }
    }
}

fn options(bytes: &mut Bytes<'_>, faces: usize) -> SimplifyOptions {
    let amount = usize::from(bytes.next());
    let stop = match bytes.next() % 4 {
        0 => Stop::faces(amount % (faces + 1)),
        1 => Stop::vertices(amount),
        2 => Stop::ratio((amount as f64 + 1.0) / 256.0),
        _ => Stop::error(Length::OfDiagonal(amount as f64 / 256.0)),
    };
    let mut options = SimplifyOptions::new(stop);
    options.method = bytes.one_of(&[Method::Memoryless, Method::Quadric]);
    options.fit = bytes.one_of(&[Fit::Auto, Fit::On, Fit::Off]);
    options.placement = bytes.one_of(&[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]);
    options.border =
        bytes.one_of(&[BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock, BorderPolicy::Free]);
    options.topology =
        bytes.one_of(&[TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free]);
    options.measure = bytes.one_of(&[Measure::Auto, Measure::Auto, Measure::Auto, Measure::Always]);
    options.weld = bytes.one_of(&[None, None, Some(Length::OfDiagonal(0.01))]);
    let guards = bytes.next();
    options.guards.max_normal_deg = (guards & 1 != 0).then_some(30.0);
    options.guards.min_quality = (guards & 2 != 0).then_some(0.2);
    options.guards.max_valence = (guards & 4 != 0).then_some(8);
    options.guards.max_edge = (guards & 8 != 0).then_some(Length::OfDiagonal(0.3));
    options
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let vertices = usize::from(bytes.next()) % 64 + 1;
    let faces = usize::from(bytes.next()) % 128;
    let options = options(&mut bytes, faces);
    let double = bytes.next() % 4 == 0;
    let corner = |bytes: &mut Bytes<'_>| VertexId(u32::from(bytes.next()) % vertices as u32);
    let triangles: Vec<[VertexId; 3]> =
        (0..faces).map(|_| std::array::from_fn(|_| corner(&mut bytes))).collect();
    let places: Vec<[f64; 3]> = (0..vertices).map(|_| std::array::from_fn(|_| bytes.coordinate())).collect();
    let positions = if double {
        Positions::F64(places)
    } else {
        Positions::F32(places.into_iter().map(|p| p.map(|x| x as f32)).collect())
    };
    let mesh = TriMesh::new(positions, triangles).expect("every index is one of a vertex");

    let Ok(result) = simplify(&mesh, &options, &mut NoControl) else { return };
    let (out, report) = (&result.mesh, &result.report);
    assert!(out.face_count() <= mesh.face_count(), "more faces than before");
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
    assert_eq!(simplify(&mesh, &options, &mut NoControl).as_ref(), Ok(&result), "the same bytes again");
});
