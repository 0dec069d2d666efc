//! Small random triangle soups, with random options.

use lodsmith::{
    BorderPolicy, Bound, Fit, Length, Measure, Method, MethodKind, OwnedMeshData, Placement, Remesh, RemeshPattern,
    SimplifyOptions, Stop, TopologyPolicy,
};
use lodsmith_core::{Positions, RegionId, TriMesh, VertexId, WedgeId};

/// An iterator over bytes that continues with zeros.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// Returns the next byte.
    pub fn next(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// Returns one of the values.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[usize::from(self.next()) % values.len()]
    }

    /// Returns a number from 0 to 1.
    pub fn part(&mut self) -> f64 {
        f64::from(self.next()) / 255.0
    }

    /// Returns a coordinate: mostly on a coarse lattice, so that positions coincide, faces are coplanar and areas are
    /// zero; sometimes any number.
    fn coordinate(&mut self) -> f64 {
        match self.next() {
            255 => f64::from_bits(u64::from_le_bytes(std::array::from_fn(|_| self.next()))),
            254 => f64::from(f32::from_bits(u32::from_le_bytes(std::array::from_fn(|_| self.next())))),
            small => f64::from(small % 16) * 0.25,
        }
    }

    /// Returns an attribute value: mostly from 0 to 1.
    fn value(&mut self) -> f32 {
        match self.next() {
            255 => f32::from_bits(u32::from_le_bytes(std::array::from_fn(|_| self.next()))),
            small => f32::from(small % 17) / 16.0,
        }
    }
}

/// Returns a mesh with up to 64 vertices and 127 faces, in single or double precision, with or without seams,
/// attributes and regions.
pub fn mesh(bytes: &mut Bytes<'_>) -> TriMesh {
    let vertices = usize::from(bytes.next()) % 64 + 1;
    let faces = usize::from(bytes.next()) % 128;
    let kind = bytes.next();
    let double = kind & 1 != 0;
    // Some vertices have two wedges, so that attributes are discontinuous there.
    let wedges = if kind & 2 != 0 { vertices + usize::from(bytes.next()) % 32 } else { vertices };
    let triangles: Vec<[WedgeId; 3]> = (0..faces)
        .map(|_| std::array::from_fn(|_| WedgeId(u32::from(bytes.next()) % wedges as u32)))
        .collect();
    let points: Vec<[f64; 3]> = (0..vertices).map(|_| std::array::from_fn(|_| bytes.coordinate())).collect();
    let positions = if double {
        Positions::F64(points)
    } else {
        Positions::F32(points.into_iter().map(|p| p.map(|x| x as f32)).collect())
    };
    let vertex_of = (0..wedges).map(|w| VertexId((w % vertices) as u32)).collect();
    let mut mesh = if wedges > vertices {
        TriMesh::with_wedges(positions, vertex_of, triangles)
    } else {
        TriMesh::new(positions, triangles.into_iter().map(|t| t.map(|w| VertexId(w.0))).collect())
    }
    .expect("every index is a wedge");
    fn values<const N: usize>(bytes: &mut Bytes<'_>, wedges: usize) -> Option<Vec<[f32; N]>> {
        Some((0..wedges).map(|_| std::array::from_fn(|_| bytes.value())).collect())
    }
    let fits = "one value for each wedge";
    if kind & 4 != 0 {
        mesh.set_normals(values(bytes, wedges)).expect(fits);
    }
    if kind & 8 != 0 {
        mesh.set_uvs(values(bytes, wedges)).expect(fits);
    }
    if kind & 16 != 0 {
        mesh.set_colors(values(bytes, wedges)).expect(fits);
    }
    if kind & 32 != 0 {
        mesh.set_regions(Some((0..faces).map(|_| RegionId(u32::from(bytes.next() % 3))).collect()))
            .expect("one for each face");
    }
    mesh
}

/// Returns options of a random method; most are valid for the method.
pub fn options(bytes: &mut Bytes<'_>, mesh: &TriMesh) -> (SimplifyOptions, OwnedMeshData) {
    let amount = usize::from(bytes.next());
    let stop = match bytes.next() % 8 {
        0..=2 => Stop::faces(amount % (mesh.face_count() + 1)),
        3 => Stop::vertices(amount),
        4 | 5 => Stop::ratio((amount as f64 + 1.0) / 256.0),
        6 => Stop { faces: None, vertices: None, ratio: None, error: None },
        _ => Stop::error(Length::OfDiagonal(amount as f64 / 256.0)),
    };
    let mut options = SimplifyOptions::new(stop);
    options.method = bytes.one_of(&MethodKind::ALL).into();
    let length = |bytes: &mut Bytes<'_>| Some(Length::OfDiagonal(0.02 + bytes.part()));
    let flags = bytes.next();
    let has = |bit: u8| flags & bit != 0;
    match &mut options.method {
        Method::Memoryless { pairs } | Method::Quadric { pairs } if has(1) => {
            *pairs = Some(Length::OfDiagonal(0.1 * bytes.part()));
        }
        Method::Cluster { cell, two_stage } => {
            *cell = if has(1) { length(bytes) } else { None };
            *two_stage = has(2);
        }
        Method::ShortestEdge { edge_length } if has(1) => *edge_length = length(bytes),
        Method::VertexRemoval { crease_deg } if has(1) => *crease_deg = Some(90.0 * bytes.part()),
        Method::Planar { angle_deg, flat } => {
            *angle_deg = has(1).then(|| 90.0 * bytes.part());
            *flat = has(2).then(|| Length::OfDiagonal(0.1 * bytes.part()));
        }
        Method::Unsubdivide { levels } if has(1) => *levels = Some(usize::from(flags % 4) + 1),
        // At least a twentieth of the diagonal: the face count of the new mesh depends on its edge length.
        Method::Remesh(remesh) => {
            let mut longer = || Length::OfDiagonal(0.05 + bytes.part());
            *remesh = match has(2) {
                true => Remesh::Voxels { size: longer() },
                false => Remesh::OnSurface {
                    edge_length: has(1).then(longer),
                    crease_deg: None,
                    rounds: has(4).then_some(2),
                    pattern: match (has(8), has(16)) {
                        (true, _) => RemeshPattern::Adaptive,
                        (false, true) => RemeshPattern::SemiRegular { subdivisions: 1 },
                        (false, false) => RemeshPattern::Even,
                    },
                },
            };
        }
        _ => {}
    }
    options.fit = bytes.one_of(&[Fit::Auto, Fit::On, Fit::Off]);
    options.placement = bytes.one_of(&[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]);
    options.border =
        bytes.one_of(&[BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock, BorderPolicy::Free]);
    options.topology =
        bytes.one_of(&[TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free]);
    options.measure = bytes.one_of(&[Measure::Auto, Measure::Auto, Measure::Auto, Measure::Always]);
    options.bound = bytes.one_of(&[Bound::Auto, Bound::Auto, Bound::OneSided, Bound::TwoSided]);
    options.weld = bytes.one_of(&[None, None, Some(Length::OfDiagonal(0.01))]);
    let guards = bytes.next();
    options.guards.max_normal_deg = (guards & 1 != 0).then_some(30.0);
    options.guards.min_quality = (guards & 2 != 0).then_some(0.2);
    options.guards.max_valence = (guards & 4 != 0).then_some(8);
    options.guards.max_edge = (guards & 8 != 0).then_some(Length::OfDiagonal(0.3));
    options.sharp_deg = (guards & 16 != 0).then_some(40.0);
    options.prune = (guards & 32 != 0).then_some(Length::OfDiagonal(0.1));
    options.escalate = guards & 64 != 0;
    options.shape_normals = guards & 128 != 0;
    let mut data = OwnedMeshData::default();
    let data_kinds = bytes.next();
    if data_kinds & 1 != 0 {
        let locked: Vec<bool> = (0..mesh.vertex_count()).map(|_| bytes.next() % 4 == 0).collect();
        data.locked = Some(locked);
    }
    if data_kinds & 2 != 0 {
        let importance: Vec<f32> =
            (0..mesh.vertex_count()).map(|_| 1.0 + 4.0 * bytes.part() as f32).collect();
        data.importance = Some(importance);
    }
    (options, data)
}
