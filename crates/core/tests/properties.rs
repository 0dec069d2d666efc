//! Properties that hold for every mesh.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use lodsmith_core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith_core::mesh::compact::compact;
use lodsmith_core::mesh::defects::{clean_surface, defects};
use lodsmith_core::mesh::weld::{weld, weld_mesh, weld_within};
use lodsmith_core::polygon::Triangulator;
use lodsmith_core::topology::TopologyCounts;
use lodsmith_core::{FaceId, PositionsView, Surface, Topology, TriMesh, VertexId};
use proptest::prelude::*;

fn any_soup() -> impl Strategy<Value = TriMesh> {
    prop_oneof![
        soup(12, Coordinates::Tame),
        soup(40, Coordinates::Tame),
        soup(20, Coordinates::Wild),
        soup(20, Coordinates::NotFinite),
        perturbed_shape(0.0),
        perturbed_shape(0.01),
    ]
}

/// The lowest vertex with the same bits, with -0.0 as 0.0.
fn naive_weld(positions: PositionsView<'_>) -> Vec<VertexId> {
    let bits = |x: f64| if x == 0.0 { 0 } else { x.to_bits() };
    let mut seen = HashMap::new();
    positions
        .iter()
        .enumerate()
        .map(|(i, p)| *seen.entry(p.map(bits)).or_insert(VertexId(i as u32)))
        .collect()
}

/// Groups that the pairs connect, as a representative for each.
fn naive_groups<T: Copy + Ord>(all: &BTreeSet<T>, pairs: &[(T, T)]) -> BTreeMap<T, T> {
    let mut group: BTreeMap<T, T> = all.iter().map(|&x| (x, x)).collect();
    for &(a, b) in pairs {
        let (a, b) = (group[&a], group[&b]);
        group.values_mut().filter(|g| **g == a).for_each(|g| *g = b);
    }
    group
}

fn group_count<T: Ord>(groups: &BTreeMap<T, T>) -> usize {
    groups.values().collect::<BTreeSet<_>>().len()
}

fn naive_counts(surface: &Surface<'_>) -> TopologyCounts {
    let welded = naive_weld(surface.positions());
    let all: Vec<[VertexId; 3]> = surface.triangles().iter().map(|t| t.map(|v| welded[v.index()])).collect();
    let faces: Vec<[VertexId; 3]> =
        all.iter().copied().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
    let mut edges: BTreeMap<[VertexId; 2], Vec<(usize, bool)>> = BTreeMap::new();
    for (f, t) in faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.entry([a.min(b), a.max(b)]).or_default().push((f, a < b));
        }
    }
    let vertices: BTreeSet<VertexId> = faces.iter().flatten().copied().collect();
    let steps: Vec<_> = edges.keys().map(|e| (e[0], e[1])).collect();
    let rim: Vec<_> = edges.iter().filter(|(_, f)| f.len() == 1).map(|(e, _)| (e[0], e[1])).collect();
    let rim_vertices = rim.iter().flat_map(|&(a, b)| [a, b]).collect();
    let mut want = TopologyCounts::default();
    want.vertex_count = vertices.len();
    want.edge_count = edges.len();
    want.face_count = faces.len();
    want.degenerate_face_count = all.len() - faces.len();
    want.component_count = group_count(&naive_groups(&vertices, &steps));
    want.border_edge_count = rim.len();
    want.border_loop_count = group_count(&naive_groups(&rim_vertices, &rim));
    want.non_manifold_edge_count = edges.values().filter(|f| f.len() > 2).count();
    want.misoriented_edge_count = edges.values().filter(|f| f.len() == 2 && f[0].1 == f[1].1).count();
    for &v in &vertices {
        let around: BTreeSet<usize> = (0..faces.len()).filter(|&f| faces[f].contains(&v)).collect();
        let joined = |most: usize| {
            let at_v = edges.iter().filter(|(e, f)| e.contains(&v) && f.len() <= most);
            let pairs: Vec<_> = at_v.flat_map(|(_, f)| f.iter().map(|x| (f[0].0, x.0))).collect();
            group_count(&naive_groups(&around, &pairs))
        };
        want.non_manifold_vertex_count += usize::from(joined(2) > 1);
        want.pinched_vertex_count += usize::from(joined(usize::MAX) > 1);
    }
    // Orientable if no face is connected to its own other side in the double cover.
    let sides: BTreeSet<(usize, bool)> = (0..faces.len()).flat_map(|f| [(f, false), (f, true)]).collect();
    let mut pairs = Vec::new();
    for f in edges.values().filter(|f| f.len() == 2) {
        let same = f[0].1 == f[1].1;
        pairs.extend([((f[0].0, false), (f[1].0, same)), ((f[0].0, true), (f[1].0, !same))]);
    }
    let cover = naive_groups(&sides, &pairs);
    want.is_orientable = (0..faces.len()).all(|f| cover[&(f, false)] != cover[&(f, true)]);
    want
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    #[test]
    fn weld_agrees_with_a_naive_one(mesh in any_soup()) {
        let positions = mesh.positions().view();
        let got = weld(positions);
        let want = naive_weld(positions);
        let distinct = want.iter().enumerate().filter(|(i, v)| v.index() == *i).count();
        prop_assert_eq!(&got.representative, &want);
        prop_assert_eq!(got.distinct_count, distinct);
    }

    #[test]
    fn a_weld_within_a_distance_follows_its_rule(mesh in any_soup(), distance in 0.0..2.0f64) {
        let positions = mesh.positions().view();
        let got = weld_within(positions, distance);
        // The documented rule: the lowest representative within the distance.
        let exact = naive_weld(positions);
        let mut representatives: Vec<VertexId> = Vec::new();
        for (i, p) in positions.iter().enumerate() {
            let own = VertexId(i as u32);
            let want = if exact[i] != own {
                got.of(exact[i])
            } else {
                let near = |r: &&VertexId| {
                    let q = positions.get(**r);
                    let d = [0, 1, 2].map(|k| (p[k] - q[k]) / distance);
                    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= 1.0
                };
                let is_finite = p.iter().all(|x| x.is_finite());
                representatives.iter().find(near).copied().filter(|_| is_finite).unwrap_or(own)
            };
            if want == own {
                representatives.push(own);
            }
            prop_assert_eq!(got.of(own), want);
        }
        prop_assert_eq!(got.distinct_count, representatives.len());
    }

    #[test]
    fn a_welded_and_compacted_mesh_has_the_same_topology(mesh in any_soup()) {
        let welded = weld_mesh(&mesh, None);
        prop_assert_eq!(weld_mesh(&welded.mesh, None).merged_vertex_count, 0);
        let small = compact(&welded.mesh);
        prop_assert_eq!(mesh.vertex_count(),
            small.mesh.vertex_count() + small.dropped_vertex_count + welded.merged_vertex_count);
        prop_assert_eq!(compact(&small.mesh).dropped_vertex_count, 0);
        let want = Topology::new(&mesh.surface()).counts();
        prop_assert_eq!(Topology::unwelded(&small.mesh.surface()).counts(), want);
        // The same positions, corner by corner.
        let places = |mesh: &TriMesh| -> Vec<[u64; 3]> {
            let p = mesh.positions().view();
            let bits = |x: f64| if x == 0.0 { 0 } else { x.to_bits() };
            mesh.surface().triangles().iter().flatten().map(|v| p.get(*v).map(bits)).collect()
        };
        prop_assert_eq!(places(&mesh), places(&small.mesh));
    }

    #[test]
    fn topology_agrees_with_a_naive_one(mesh in prop_oneof![
        soup(6, Coordinates::Tame), soup(14, Coordinates::Tame), soup(30, Coordinates::NotFinite)
    ]) {
        let surface = mesh.surface();
        let topology = Topology::new(&surface);
        topology.check();
        prop_assert_eq!(topology.counts(), naive_counts(&surface));
        let parts = topology.components();
        prop_assert_eq!(parts.face_counts().iter().sum::<usize>(), topology.counts().face_count);
        for face in (0..mesh.face_count() as u32).map(FaceId) {
            prop_assert_eq!(parts.of_face(face).is_none(), topology.is_degenerate(face));
        }
    }

    #[test]
    fn topology_of_shapes_holds_together(mesh in perturbed_shape(0.01)) {
        let topology = Topology::new(&mesh.surface());
        topology.check();
        let counts = topology.counts();
        // The border sets of a manifold are its loops, and its genus is an integer.
        if let (true, Some(genus)) = (counts.is_manifold(), counts.genus()) {
            let loops = counts.border_loop_count as i64;
            prop_assert_eq!(
                counts.euler(), 2 * counts.component_count as i64 - 2 * genus as i64 - loops);
        }
    }

    #[test]
    fn a_clean_surface_has_nothing_left_to_clean(mesh in any_soup()) {
        let surface = mesh.surface();
        let cleaned = clean_surface(&surface, None);
        let found = defects(&surface);
        prop_assert_eq!(cleaned.triangles.len() + cleaned.dropped_face_count(), mesh.face_count());
        prop_assert_eq!(cleaned.non_finite_count, found.non_finite_face_count);
        // Naive: the first of each face, rotated to its lowest corner.
        let welded = naive_weld(surface.positions());
        let mut seen = BTreeSet::new();
        let want: Vec<_> = surface.triangles().iter().map(|t| t.map(|v| welded[v.index()])).filter(|&[a, b, c]| {
            let finite = [a, b, c].iter().all(|&v| surface.positions().get(v).iter().all(|x| x.is_finite()));
            finite && a != b && b != c && c != a && seen.insert([a, b, c].min([b, c, a]).min([c, a, b]))
        }).collect();
        prop_assert_eq!(&cleaned.triangles, &want);
        let again = Surface::new(surface.positions(), &cleaned.triangles).unwrap();
        prop_assert_eq!(clean_surface(&again, None).dropped_face_count(), 0);
        let left = defects(&again);
        prop_assert_eq!((left.degenerate_face_count, left.same_winding_duplicate_count), (0, 0));
        let regular = mesh.face_count() - found.degenerate_face_count;
        let sets: BTreeSet<_> = surface.triangles().iter().map(|t| {
            let mut t = t.map(|v| welded[v.index()]);
            t.sort();
            t
        }).filter(|t| t[0] != t[1] && t[1] != t[2]).collect();
        prop_assert_eq!(found.duplicate_face_count(), regular - sets.len());
    }

    #[test]
    fn star_polygons_are_tiled(
        radii in prop::collection::vec(0.05..1.0f64, 3..60), tilt in -1.0..1.0f64, exponent in -20..20i32,
    ) {
        // Star-shaped around the middle, so simple; but arbitrarily concave.
        let scale = 10f64.powi(exponent);
        let n = radii.len();
        let points: Vec<[f64; 3]> = radii.iter().enumerate().map(|(i, r)| {
            let a = i as f64 / n as f64 * std::f64::consts::TAU;
            [r * a.cos() * scale, r * a.sin() * scale, tilt * r * a.cos() * scale]
        }).collect();
        let mut triangles = Vec::new();
        Triangulator::default().triangulate(&points, &mut triangles);
        prop_assert_eq!(triangles.len(), n - 2);
        let area = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
        };
        let whole: f64 = (0..n).map(|i| area([0.0; 3], points[i], points[(i + 1) % n])).sum();
        let sum: f64 = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            area(a, b, c).abs()
        }).sum();
        prop_assert!((sum / whole - 1.0).abs() < 1e-9, "{sum} instead of {whole}");
    }

    #[test]
    fn any_polygon_gets_its_triangles(mesh in any_soup()) {
        let points: Vec<[f64; 3]> = mesh.positions().view().iter().collect();
        let mut triangles = Vec::new();
        Triangulator::default().triangulate(&points, &mut triangles);
        prop_assert_eq!(triangles.len(), points.len().saturating_sub(2));
        // Each side of the polygon is a side of just one triangle, each diagonal of two, in opposite
        // directions.
        let mut sides: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for t in &triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *sides.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        if !triangles.is_empty() {
            let n = points.len() as u32;
            let rim: BTreeMap<_, _> = (0..n).map(|i| {
                let j = (i + 1) % n;
                ((i.min(j), i.max(j)), if i < j { 1 } else { -1 })
            }).collect();
            sides.retain(|_, count| *count != 0);
            prop_assert_eq!(sides, rim);
        }
    }
}
