//! Guarantees of cluster levels: no cut has a crack, errors are correct, and results are the same with any
//! number of threads.

use std::collections::{HashMap, HashSet};

use lodsmith::core::clusters::{ClusterLod, Eye};
use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::mesh::weld::weld_mesh;
use lodsmith::core::{
    ClusterId, Positions, RegionId, Topology, TriMesh, VertexId, WedgeId, arbitrary, shapes,
};
use lodsmith::{ClusterLodOptions, Control, Input, NoControl, SimplifyError, Verdict, cluster_lod};
use proptest::prelude::*;

use crate::support::{CaseFilter, Complaints, is_long, size};

/// Small clusters and groups, so that small meshes have many of them.
fn small() -> ClusterLodOptions {
    let mut options = ClusterLodOptions::default();
    (options.triangles, options.vertices, options.group) = (16, 24, 4);
    options
}

fn built(mesh: &TriMesh, options: &ClusterLodOptions) -> ClusterLod {
    cluster_lod(mesh, options, &mut NoControl).unwrap().lod
}

type Place = [u64; 3];

fn place(mesh: &TriMesh, w: WedgeId) -> Place {
    mesh.positions().view().get(mesh.vertex_of(w)).map(|x| (x + 0.0).to_bits())
}

/// Counts the edges, by exact position, that are not traversed equally often in both directions.
fn open_edge_count(mesh: &TriMesh) -> usize {
    let mut ids = HashMap::new();
    let positions = mesh.positions().view();
    let id_of: Vec<u32> = positions
        .iter()
        .map(|p| {
            let next = ids.len() as u32;
            *ids.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        })
        .collect();
    let mut edges = Vec::with_capacity(3 * mesh.face_count());
    for t in mesh.triangles() {
        let corners = t.map(|w| id_of[mesh.vertex_of(w).index()]);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a != b {
                edges.push((a.min(b), a.max(b), if a < b { 1 } else { -1 }));
            }
        }
    }
    edges.sort_unstable();
    let groups = edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1));
    groups.filter(|group| group.iter().map(|edge| edge.2).sum::<i32>() != 0).count()
}

/// A hash as a source of random numbers: equal inputs give equal values.
fn roll(seed: u64, x: u64) -> u64 {
    let mut z = seed ^ x.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z ^ (z >> 27)
}

/// Returns cuts of all kinds: finest, coarsest, by error, for several eye positions, and random.
fn cuts(lod: &ClusterLod, seed: u64) -> Vec<Vec<ClusterId>> {
    let most = lod.coarsest_error();
    let bounds = lod.mesh().positions().view().bounds().unwrap();
    let size = bounds.diagonal();
    let mut all = vec![lod.cut_where(|_| false), lod.cut_where(|_| true), lod.cut(most)];
    all.extend((0..6).map(|k| lod.cut(most * 0.3f64.powi(k))));
    for k in 0..8 {
        let unit = |salt: u64| (roll(seed, 16 * k + salt) % 1001) as f64 / 1000.0;
        let position = [0, 1, 2].map(|i| bounds.min[i] + size * (3.0 * unit(i as u64) - 1.0));
        let eye = Eye { position, pixels_per_unit: 1000.0, near: 1e-3 * size.max(1e-300) };
        all.push(lod.cut_for_view(&eye, 1000.0 * most / size.max(1e-300) * 4.0 * unit(3)));
    }
    // A random choice for each group.
    all.extend((0..8u64).map(|k| {
        let chance = |x: f64| roll(seed.wrapping_add(k), x.to_bits());
        lod.cut_where(|b| !chance(b.error + b.sphere.center[0]).is_multiple_of(3))
    }));
    all
}

/// Checks the guarantees that hold for any levels.
fn complaints(lod: &ClusterLod, options: &ClusterLodOptions, seed: u64) -> Vec<String> {
    let mut all = Vec::new();
    for id in lod.ids() {
        let meshlet = lod.meshlet(id);
        if meshlet.triangles.len() > options.triangles || meshlet.wedges.len() > options.vertices {
            all.push(format!("cluster {id} is too large"));
        }
        if lod.parent_bound(id).is_some_and(|p| p.error < lod.cluster_bound(id).error) {
            all.push(format!("the error of cluster {id} is above its parent's"));
        }
    }
    // A closed mesh stays closed; in an open one, any edge that was open at first may be open again.
    let finest = lod.mesh_of(&lod.cut_where(|_| false));
    let is_closed = open_edge_count(&finest) == 0;
    for (k, cut) in cuts(lod, seed).iter().enumerate() {
        let ids: HashSet<_> = cut.iter().collect();
        if ids.len() != cut.len() || cut.is_empty() {
            all.push(format!("cut {k} has a cluster twice, or no cluster"));
        }
        let surface = lod.mesh_of(cut);
        let open = if is_closed { open_edge_count(&surface) } else { 0 };
        if open > 0 {
            all.push(format!("cut {k} has {open} open edges"));
        }
        if surface.face_count() > finest.face_count() {
            all.push(format!("cut {k} has more faces than the original"));
        }
    }
    all
}

/// A sphere in two charts, with normals and colours that depend on the position, and two regions across the
/// charts.
fn textured(n: u32) -> TriMesh {
    let bare = shapes::noisy_sphere(n, 0.01, 3);
    let p = bare.positions().view();
    let mut wedges: HashMap<(VertexId, bool), WedgeId> = HashMap::new();
    let (mut vertex_of, mut uvs) = (Vec::new(), Vec::new());
    let mut triangles = Vec::new();
    let mut regions = Vec::new();
    for t in bare.triangles() {
        let vertices = t.map(|w| bare.vertex_of(w));
        let sum = |k: usize| vertices.iter().map(|&v| p.get(v)[k]).sum::<f64>();
        let left = sum(0) < 0.0;
        regions.push(RegionId(u32::from(sum(2) > 0.5)));
        triangles.push(vertices.map(|v| {
            *wedges.entry((v, left)).or_insert_with(|| {
                vertex_of.push(v);
                let [x, y, z] = p.get(v);
                uvs.push([
                    (0.25 * y + if left { 0.25 } else { 0.75 }) as f32,
                    (0.5 * z + 0.5 + 0.0 * x) as f32,
                ]);
                WedgeId::new(vertex_of.len() - 1)
            })
        }));
    }
    let places: Vec<[f64; 3]> = vertex_of.iter().map(|&v| p.get(v)).collect();
    let mut mesh = TriMesh::with_wedges(bare.positions().clone(), vertex_of, triangles).unwrap();
    mesh.set_uvs(Some(uvs)).unwrap();
    mesh.set_normals(Some(places.iter().map(|p| p.map(|x| x as f32)).collect())).unwrap();
    mesh.set_colors(Some(places.iter().map(|p| [p[0].abs() as f32, 0.5, 0.5, 1.0]).collect())).unwrap();
    mesh.set_regions(Some(regions)).unwrap();
    mesh
}

#[test]
fn no_cut_of_any_shape_has_a_crack() {
    let mut found = Complaints::default();
    let large = [
        ("icosphere", shapes::icosphere(4)),
        ("blob", shapes::blob(4, 2)),
        ("torus", shapes::torus(60, 30)),
        ("noisy", shapes::noisy_sphere(4, 0.03, 5)),
        ("tetrahedra", shapes::tetrahedra(500)),
        ("textured", textured(4)),
    ];
    let mut cases = CaseFilter::every(3);
    for (name, mesh) in shapes::all().into_iter().chain(large) {
        for options in [small(), ClusterLodOptions::default()] {
            if !cases.takes() {
                continue;
            }
            let got = complaints(&built(&mesh, &options), &options, 7);
            found.add(&format!("{name} in clusters of {}", options.triangles), got);
        }
    }
    found.report_all();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(size(32, 8)))]

    #[test]
    fn no_cut_of_a_random_mesh_has_a_crack(mesh in arbitrary::perturbed_shape(0.05), seed in any::<u64>()) {
        if let Ok(built) = cluster_lod(&mesh, &small(), &mut NoControl) {
            let found = complaints(&built.lod, &small(), seed);
            prop_assert!(found.is_empty(), "{found:?}");
        }
    }

    #[test]
    fn any_soup_makes_levels_or_an_error(mesh in arbitrary::soup(60, arbitrary::Coordinates::NotFinite)) {
        match cluster_lod(&mesh, &small(), &mut NoControl) {
            Ok(built) => {
                let c = built.report.cleanup;
                let left_out = c.degenerate_faces + c.duplicate_faces + c.non_finite_faces;
                let finest = built.lod.mesh_of(&built.lod.cut_where(|_| false));
                prop_assert_eq!(finest.face_count() + left_out, mesh.face_count());
            }
            Err(e) => prop_assert!(matches!(e, SimplifyError::NoFaces { .. }), "{e}"),
        }
    }
}

#[test]
fn the_finest_cut_is_the_input() {
    let mesh = textured(3);
    let lod = built(&mesh, &small());
    let finest = lod.mesh_of(&lod.cut_where(|_| false));
    let faces = |mesh: &TriMesh| {
        let corner = |w: WedgeId| {
            let i = w.index();
            let attributes =
                (mesh.uvs().unwrap()[i].map(f32::to_bits), mesh.normals().unwrap()[i].map(f32::to_bits));
            (place(mesh, w), attributes)
        };
        let regions = mesh.regions().unwrap();
        let mut all: Vec<_> =
            mesh.triangles().iter().zip(regions).map(|(t, r)| (t.map(corner), *r)).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(faces(&finest), faces(&mesh));
    assert_eq!((finest.vertex_count(), finest.wedge_count()), (mesh.vertex_count(), mesh.wedge_count()));
}

#[test]
fn levels_end_at_a_single_cluster() {
    let (n, levels) = size((6, 8), (5, 6));
    let mesh = shapes::blob(n, 1);
    let lod = built(&mesh, &ClusterLodOptions::default());
    let roots: Vec<_> = lod.ids().filter(|&id| lod.parent_bound(id).is_none()).collect();
    assert_eq!(roots.len(), 1);
    assert!(lod.level(roots[0]) >= levels, "{}", lod.level(roots[0]));
    let leaves = lod.ids().filter(|&id| lod.level(id) == 0).count();
    let fill = mesh.face_count() as f64 / (128 * leaves) as f64;
    assert!(fill > 0.95, "{fill}");
}

#[test]
fn cuts_are_within_their_error() {
    let mut found = Complaints::default();
    let mut cases = CaseFilter::every(4);
    for (name, mesh) in
        [("blob", shapes::blob(5, 4)), ("torus", shapes::torus(120, 60)), ("textured", textured(5))]
    {
        let lod = built(&mesh, &ClusterLodOptions::default());
        for k in 0..7 {
            if !cases.takes() {
                continue;
            }
            let error = lod.coarsest_error() * 0.4f64.powi(k);
            let surface = lod.mesh_of(&lod.cut(error));
            let options = CompareOptions::default();
            let got = compare(&mesh.surface(), &surface.surface(), &options).unwrap().hausdorff.symmetric;
            found.check(name, got <= error, &format!("{got} at a cut for {error}"));
        }
    }
    found.report_all();
}

#[test]
fn cuts_of_a_textured_mesh_keep_their_charts_and_regions() {
    let mesh = textured(5);
    let lod = built(&mesh, &ClusterLodOptions::default());
    for surface in cuts(&lod, 3).iter().map(|cut| lod.mesh_of(cut)).filter(|s| s.face_count() > 1000) {
        // Compared by texture coordinates, because normals far off their faces are split within charts too.
        let mut wedges_at: HashMap<Place, HashSet<[u32; 2]>> = HashMap::new();
        for &w in surface.triangles().iter().flatten() {
            let uv = surface.uvs().unwrap()[w.index()].map(f32::to_bits);
            wedges_at.entry(place(&surface, w)).or_default().insert(uv);
        }
        // A seam vertex has a wedge on each side, whichever levels the two sides come from.
        let most = wedges_at.iter().max_by_key(|w| w.1.len()).unwrap();
        assert!(
            most.1.len() <= 2,
            "{:?}",
            most.1.iter().map(|uv| uv.map(f32::from_bits)).collect::<Vec<_>>()
        );
        assert!(wedges_at.values().any(|w| w.len() == 2));
        let regions: HashSet<_> = surface.regions().unwrap().iter().collect();
        assert_eq!(regions.len(), 2);
    }
}

#[test]
fn regions_of_one_class_have_a_border_that_may_move() {
    let mesh = textured(size(5, 4));
    let classes = [RegionId(0), RegionId(0)];
    let options = ClusterLodOptions::default();
    let input = Input::new(&mesh).region_classes(&classes);
    assert_ne!(cluster_lod(input, &options, &mut NoControl).unwrap().lod, built(&mesh, &options));
}

#[test]
fn locks_and_importance_are_refused() {
    let mesh = shapes::grid(4);
    let (locked, importance) = (vec![true; mesh.vertex_count()], vec![2.0; mesh.vertex_count()]);
    for input in [Input::new(&mesh).locked(&locked), Input::new(&mesh).importance(&importance)] {
        let refused = cluster_lod(input, &small(), &mut NoControl);
        assert!(matches!(refused, Err(SimplifyError::NotTogether { second: "cluster_lod", .. })));
    }
}

#[test]
fn an_open_sheet_stays_one_sheet() {
    let mesh = shapes::grid(40);
    let lod = built(&mesh, &small());
    for cut in cuts(&lod, 9) {
        let counts = Topology::new(&lod.mesh_of(&cut).surface()).counts();
        // A crack would be an additional border loop or split the sheet.
        assert_eq!((counts.border_loop_count, counts.component_count), (1, 1));
    }
}

#[test]
fn borders_are_kept_in_double_precision_and_far_from_the_origin() {
    let mut mesh = shapes::blob(size(5, 4), 3);
    let points = mesh.positions().view().iter().map(|p| [p[0] + 500_000.0, p[1] + 4e6, p[2]]).collect();
    let faces = mesh.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
    mesh = TriMesh::new(Positions::F64(points), faces).unwrap();
    assert_eq!(complaints(&built(&mesh, &small()), &small(), 5), Vec::<String>::new());
    assert!(matches!(built(&mesh, &small()).mesh().positions(), Positions::F64(_)));
}

#[test]
fn a_soup_of_corners_is_joined_first() {
    let whole = shapes::torus(40, 20);
    let view = whole.positions().view();
    let corners = whole.triangles().iter().flatten().map(|w| view.get(VertexId(w.0)).map(|x| x as f32));
    let corners: Vec<[f32; 3]> = corners.collect();
    let faces = (0..whole.face_count() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2].map(VertexId)).collect();
    let soup = TriMesh::new(Positions::F32(corners), faces).unwrap();
    assert_eq!(complaints(&built(&soup, &small()), &small(), 1), Vec::<String>::new());
    let report = cluster_lod(&soup, &small(), &mut NoControl).unwrap().report;
    assert_eq!(
        report.cleanup.welded_vertices,
        soup.vertex_count() - weld_mesh(&soup, None).mesh.vertex_count()
    );
}

#[test]
fn the_same_bytes_at_any_number_of_threads() {
    let mesh = textured(size(5, 3));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cluster_lod(&mesh, &small(), &mut NoControl).unwrap())
    };
    let one = on(1);
    assert_eq!(one, on(3));
    if is_long() {
        assert_eq!(one, on(4));
    }
}

#[test]
fn a_caller_can_finish_or_cancel() {
    struct AnswerAfter(usize, Verdict);
    impl Control for AnswerAfter {
        fn progress(&mut self, _: f64) -> Verdict {
            self.0 = self.0.saturating_sub(1);
            if self.0 == 0 { self.1 } else { Verdict::Continue }
        }
    }
    let mesh = shapes::icosphere(size(5, 4));
    let early = cluster_lod(&mesh, &small(), &mut AnswerAfter(4, Verdict::Finish)).unwrap();
    assert!(early.report.ended_early && early.lod.groups().len() < built(&mesh, &small()).groups().len());
    for cut in cuts(&early.lod, 2) {
        assert_eq!(open_edge_count(&early.lod.mesh_of(&cut)), 0);
    }
    let cancelled = cluster_lod(&mesh, &small(), &mut AnswerAfter(3, Verdict::Cancel));
    assert_eq!(cancelled.unwrap_err(), SimplifyError::Cancelled);
}
