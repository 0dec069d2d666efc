//! Sheets with two coincident sides: cards of foliage and hair, fins on a solid.

use lodsmith::core::topology::size_of;
use lodsmith::core::{
    Attribute, IntegerType, Positions, RegionId, Semantic, TriMesh, VertexId, WedgeId, shapes,
};
use lodsmith::{
    CleanOptions, Input, Length, Levels, LodOptions, MethodKind, NoControl, Placement, Progressive, Sheets,
    Simplified, SimplifyOptions, Stop, clean, lod, simplify, simplify_with, two_sided_faces,
};

/// How the backs of cards are made.
#[derive(Clone, Copy, PartialEq)]
enum Backs {
    None,
    /// On the vertices of the front.
    Shared,
    /// On vertices of their own.
    Own,
    /// On vertices of their own, with quads cut along their other diagonal.
    OtherDiagonals,
}

/// A part of a mesh: positions, texture coordinates and triangles, in a region.
#[derive(Default)]
struct Builder {
    points: Vec<[f64; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// The vertex of each wedge.
    wedges: Vec<u32>,
    faces: Vec<[u32; 3]>,
    regions: Vec<u32>,
    /// Largest distance between vertices of a back and of its front.
    gap: f64,
}

/// Returns a number between -1 and 1 that looks random.
fn scattered(seed: u64) -> f64 {
    ((seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Builder {
    /// Adds a bent card of `n` by `m` cells at a place, with its back.
    fn card(&mut self, number: usize, [n, m]: [usize; 2], backs: Backs, back_region: u32) {
        let turn = number as f64 * 2.4;
        let (sin, cos) = turn.sin_cos();
        let centre = [(number % 5) as f64 * 2.5, (number / 5) as f64 * 2.5, (number % 3) as f64 * 0.3];
        let point = |i: usize, j: usize| {
            let (u, v) = (i as f64 / n as f64, j as f64 / m as f64);
            let (x, y, z) = (0.4 * (u - 0.5), v, 0.35 * v * v + 0.02 * (7.0 * u + 3.0 * v).sin());
            [centre[0] + cos * x - sin * z, centre[1] + sin * x + cos * z, centre[2] + y]
        };
        let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let first_point = self.points.len() as u32;
        let grid = || (0..=m).flat_map(|j| (0..=n).map(move |i| (i, j)));
        self.points.extend(grid().map(|(i, j)| point(i, j)));
        if [Backs::Own, Backs::OtherDiagonals].contains(&backs) {
            let first = self.points.len() as u64;
            let apart = |(v, p): (u64, [f64; 3])| {
                [0, 1, 2].map(|k| p[k] + self.gap / 3f64.sqrt() * scattered(3 * (first + v) + k as u64))
            };
            let backs: Vec<_> = (0..).zip(grid().map(|(i, j)| point(i, j))).map(apart).collect();
            self.points.extend(backs);
        }
        let mut side = |is_back: bool, first_vertex: u32, region: u32| {
            let first = self.wedges.len() as u32;
            for (i, j) in grid() {
                let (u, v) = (i as f32 / n as f32, j as f32 / m as f32);
                // The back has the other half of the texture, mirrored.
                self.uvs.push(if is_back { [1.0 - 0.5 * u, v] } else { [0.5 * u, v] });
                let slope = [sin as f32, -cos as f32, 0.3 * v];
                self.normals.push(if is_back { slope.map(|x| -x) } else { slope });
                self.wedges.push(first_vertex + at(i, j));
            }
            for (i, j) in (0..m).flat_map(|j| (0..n).map(move |i| (i, j))) {
                let [a, b, c, d] =
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(|w| first + w);
                let two = match is_back && backs == Backs::OtherDiagonals {
                    true => [[a, b, d], [b, c, d]],
                    false => [[a, b, c], [a, c, d]],
                };
                self.faces.extend(two.map(|t| if is_back { [t[0], t[2], t[1]] } else { t }));
                self.regions.extend([region; 2]);
            }
        };
        side(false, first_point, 0);
        match backs {
            Backs::None => {}
            Backs::Shared => side(true, first_point, back_region),
            Backs::Own | Backs::OtherDiagonals => {
                side(true, first_point + ((n + 1) * (m + 1)) as u32, back_region)
            }
        }
    }

    fn mesh(self, has_attributes: bool) -> TriMesh {
        let wedges = self.wedges.iter().map(|v| VertexId(*v)).collect();
        let faces = self.faces.iter().map(|t| t.map(WedgeId)).collect();
        let mut mesh = TriMesh::with_wedges(Positions::F64(self.points), wedges, faces).unwrap();
        if has_attributes {
            mesh.set_uvs(Some(self.uvs)).unwrap();
            mesh.set_normals(Some(self.normals)).unwrap();
            mesh.set_regions(Some(self.regions.into_iter().map(RegionId).collect())).unwrap();
        }
        mesh
    }
}

fn cards(count: usize, cells: [usize; 2], backs: Backs, back_region: u32, has_attributes: bool) -> TriMesh {
    let mut all = Builder::default();
    (0..count).for_each(|i| all.card(i, cells, backs, back_region));
    all.mesh(has_attributes)
}

fn area(mesh: &TriMesh) -> f64 {
    size_of(&mesh.surface()).area
}

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> Simplified {
    simplify(mesh, options).expect("cards can be simplified")
}

/// Returns the number of faces without an opposite face, compared by position and with their multiplicity.
fn unpaired(mesh: &TriMesh) -> usize {
    let view = mesh.positions().view();
    let mut keys = std::collections::HashMap::new();
    for t in mesh.triangles() {
        let p = t.map(|w| view.get(mesh.vertex_of(w)).map(f64::to_bits));
        let mut sorted = p;
        sorted.sort_unstable();
        let at = sorted.map(|s| p.iter().position(|q| *q == s).unwrap());
        let is_even = matches!(at, [0, 1, 2] | [1, 2, 0] | [2, 0, 1]);
        *keys.entry(sorted).or_insert(0i64) += if is_even { 1 } else { -1 };
    }
    keys.values().filter(|n| **n != 0).count()
}

/// Returns the number of faces of the fins of [`shapes::box_with_fins`] without an opposite face; faces of
/// the box have none.
fn unpaired_faces_of_sheets(mesh: &TriMesh) -> usize {
    let view = mesh.positions().view();
    let on_fin = |t: &[WedgeId; 3]| t.iter().any(|w| view.get(mesh.vertex_of(*w))[2] > 0.51);
    let fins = mesh.triangles().iter().filter(|t| on_fin(t)).copied().collect();
    let vertices = (0..mesh.wedge_count()).map(WedgeId::new).map(|w| mesh.vertex_of(w)).collect();
    unpaired(&TriMesh::with_wedges(mesh.positions().clone(), vertices, fins).unwrap())
}

#[test]
fn two_sided_cards_keep_as_much_area_as_single_sided_ones() {
    for count in [20, 150] {
        for (backs, back_region, has_attributes) in [
            (Backs::Own, 0, false),
            (Backs::Shared, 0, false),
            (Backs::Own, 0, true),
            (Backs::Shared, 1, true),
            (Backs::OtherDiagonals, 0, true),
        ] {
            let single = cards(count, [2, 6], Backs::None, 0, has_attributes);
            let both = cards(count, [2, 6], backs, back_region, has_attributes);
            assert_eq!(both.face_count(), 2 * single.face_count());
            for ratio in [0.5, 0.25, 0.2, 0.1] {
                let options = SimplifyOptions::new(Stop::ratio(ratio));
                let [wanted, got] = [run(&single, &options), run(&both, &options)];
                let (a, b) = (2.0 * area(&wanted.mesh), area(&got.mesh));
                assert!((b / a - 1.0).abs() < 0.02, "{count} cards at {ratio}: {b} for {a}");
                assert_eq!(got.report.faces, got.mesh.face_count());
                assert_eq!(got.report.two_sided_pairs, single.face_count());
                assert!(
                    got.report.reached
                        && got.mesh.face_count() <= (ratio * both.face_count() as f64) as usize
                );
                assert_eq!(unpaired(&got.mesh), 0, "{count} cards at {ratio}");
                assert_eq!(wanted.report.two_sided_pairs, 0);
            }
        }
    }
}

#[test]
fn each_side_of_a_card_keeps_its_own_values() {
    let mesh = cards(6, [3, 8], Backs::Own, 1, true);
    let got = run(&mesh, &SimplifyOptions::new(Stop::ratio(0.3))).mesh;
    let (uvs, normals, regions) = (got.uvs().unwrap(), got.normals().unwrap(), got.regions().unwrap());
    let mut counts = [0; 2];
    for (t, region) in got.triangles().iter().zip(regions) {
        let is_back = *region == RegionId(1);
        counts[usize::from(is_back)] += 1;
        let view = got.positions().view();
        let p = t.map(|w| glam::DVec3::from(view.get(got.vertex_of(w))));
        let own = (p[1] - p[0]).cross(p[2] - p[0]);
        for w in t {
            let [u, _] = uvs[w.index()];
            assert!(if is_back { u >= 0.5 - 1e-6 } else { u <= 0.5 + 1e-6 }, "{u} on the other half");
            assert!(
                own.dot(glam::Vec3::from(normals[w.index()]).as_dvec3()) > 0.0,
                "a normal of the other side"
            );
        }
    }
    assert_eq!(counts[0], counts[1]);
    // Sides with their own vertices keep their own.
    assert!(got.triangles().iter().zip(regions).all(|(t, r)| {
        let of =
            |region| got.triangles().iter().zip(regions).filter(move |x| *x.1 == region).flat_map(|x| x.0);
        let other = RegionId(1 - r.0);
        t.iter().all(|w| of(other).all(|x| got.vertex_of(*x) != got.vertex_of(*w)))
    }));
}

#[test]
fn all_methods_keep_both_sides_together() {
    let [single, mesh] = [Backs::None, Backs::Own].map(|backs| cards(4, [8, 16], backs, 0, false));
    for method in MethodKind::ALL {
        let mut options = SimplifyOptions::new(Stop::ratio(0.3));
        options.method = method.into();
        let [wanted, got] = [run(&single, &options).mesh, run(&mesh, &options).mesh];
        assert_eq!(unpaired(&got), 0, "{method:?}");
        let (a, b) = (2.0 * area(&wanted), area(&got));
        assert!((b / a - 1.0).abs() < 0.02, "{method:?}: {b} for {a}");
    }
    let mut options = SimplifyOptions::new(Stop::ratio(0.3));
    options.placement = Placement::Endpoint;
    assert_eq!(unpaired(&run(&mesh, &options).mesh), 0);
}

#[test]
fn fins_on_a_closed_solid_keep_both_sides() {
    let mesh = |has_backs: bool| {
        let sphere = shapes::icosphere(4);
        let mut all = Builder::default();
        for i in 0..6 {
            all.card(i, [4, 8], if has_backs { Backs::Own } else { Backs::None }, 0);
        }
        let first = all.points.len() as u32;
        all.points.extend(sphere.positions().view().iter().map(|p| p.map(|x| x - 3.0)));
        let first_wedge = all.wedges.len() as u32;
        all.wedges.extend((0..sphere.vertex_count() as u32).map(|v| v + first));
        all.faces.extend(sphere.triangles().iter().map(|t| t.map(|w| w.0 + first_wedge)));
        all.mesh(false)
    };
    let (single, both) = (mesh(false), mesh(true));
    for ratio in [0.5, 0.25, 0.1] {
        let got = run(&both, &SimplifyOptions::new(Stop::ratio(ratio)));
        assert!(got.report.reached, "{ratio}");
        assert!(got.mesh.face_count() as f64 > 0.95 * ratio * both.face_count() as f64, "{ratio}");
        let cards = 2.0 * (area(&single) - 4.0 * std::f64::consts::PI);
        let fins = area(&got.mesh) - 4.0 * std::f64::consts::PI;
        assert!((fins / cards - 1.0).abs() < 0.05, "{ratio}: {fins} of {cards}");
    }
}

#[test]
fn fins_on_a_closed_box_keep_their_area() {
    let [single, both] = [false, true].map(shapes::box_with_fins);
    let fins = |mesh: &TriMesh| area(mesh) - 6.0;
    assert!((fins(&both) / fins(&single) - 2.0).abs() < 1e-6);
    for ratio in [0.5, 0.25, 0.1] {
        let options = SimplifyOptions::new(Stop::ratio(ratio));
        let [wanted, got] = [run(&single, &options), run(&both, &options)];
        assert!(got.report.reached, "{ratio}");
        assert_eq!(got.report.two_sided_pairs, 4 * 8 * 8 * 2);
        assert_eq!(unpaired_faces_of_sheets(&got.mesh), 0, "{ratio}");
        let (a, b) = (2.0 * fins(&wanted.mesh), fins(&got.mesh));
        assert!((b / a - 1.0).abs() < 0.02, "{ratio}: {b} for {a}");
    }
}

#[test]
fn sides_up_to_a_millionth_of_the_diagonal_apart_are_one_sheet() {
    let single = cards(20, [2, 6], Backs::None, 0, true);
    let diagonal = single.positions().view().bounds().unwrap().diagonal();
    let with_gap = |share: f64, backs: Backs| {
        let mut all = Builder { gap: share * diagonal, ..Builder::default() };
        (0..20).for_each(|i| all.card(i, [2, 6], backs, 0));
        all.mesh(true)
    };
    // Sides that are cut along different diagonals have no triangle in common.
    for share in [1e-8, 1e-7, 1e-6] {
        let near = with_gap(share, Backs::OtherDiagonals);
        assert_eq!(two_sided_faces(&near.surface()), near.face_count(), "{share}");
        let got = run(&near, &SimplifyOptions::new(Stop::ratio(0.25)));
        assert_eq!(got.report.two_sided_pairs, single.face_count(), "{share}");
    }
    for share in [1e-8, 1e-7, 5e-7, 1e-6] {
        let near = with_gap(share, Backs::Own);
        assert_eq!(two_sided_faces(&near.surface()), near.face_count(), "{share}");
        for ratio in [0.5, 0.25, 0.1] {
            let options = SimplifyOptions::new(Stop::ratio(ratio));
            let [wanted, got] = [run(&single, &options), run(&near, &options)];
            assert_eq!(got.report.two_sided_pairs, single.face_count(), "{share} at {ratio}");
            assert_eq!(unpaired(&got.mesh), 0, "{share} at {ratio}");
            let (a, b) = (2.0 * area(&wanted.mesh), area(&got.mesh));
            assert!((b / a - 1.0).abs() < 0.02, "{share} at {ratio}: {b} for {a}");
        }
    }
    // A surface closed by its indices is a solid, however thin.
    let mut lens = shapes::icosphere(3);
    lens.map_positions(|[x, y, z]| [x, y, 1e-7 * z]);
    assert_eq!(two_sided_faces(&lens.surface()), 0);
    // Sides that are farther apart are two surfaces.
    let apart = with_gap(1e-4, Backs::Own);
    assert_eq!(two_sided_faces(&apart.surface()), 0);
}

#[test]
fn sheets_whose_sides_have_different_triangles_are_counted() {
    // Flat cards: twelve cells in front, three at the back.
    let side = |n: usize, m: usize, is_back: bool, at: f64| {
        let grid = (0..=m).flat_map(move |j| (0..=n).map(move |i| (i, j)));
        let points: Vec<[f64; 3]> =
            grid.map(|(i, j)| [at + i as f64 / n as f64, j as f64 / m as f64, 0.5 * at]).collect();
        let cells = (0..m).flat_map(move |j| (0..n).map(move |i| (j * (n + 1) + i) as u32));
        let faces: Vec<[u32; 3]> = cells
            .flat_map(|a| {
                let [b, c, d] = [a + 1, a + n as u32 + 2, a + n as u32 + 1];
                [[a, b, c], [a, c, d]].map(|t| if is_back { [t[0], t[2], t[1]] } else { t })
            })
            .collect();
        (points, faces)
    };
    let mesh = |backs: &[(usize, usize)]| {
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        let mut add = |(p, f): (Vec<[f64; 3]>, Vec<[u32; 3]>)| {
            let first = points.len() as u32;
            points.extend(p);
            faces.extend(f.into_iter().map(|t| t.map(|v| VertexId(v + first))));
        };
        for (k, (n, m)) in backs.iter().enumerate() {
            add(side(4, 3, false, 2.0 * k as f64));
            add(side(*n, *m, true, 2.0 * k as f64));
        }
        TriMesh::new(Positions::F64(points), faces).unwrap()
    };
    let options = SimplifyOptions::new(Stop::ratio(0.5));
    let unlike = run(&mesh(&[(1, 3), (2, 1), (4, 3)]), &options).report;
    assert_eq!((unlike.unpaired_sheets, unlike.two_sided_pairs), (2, 4 * 3 * 2));
    let alike = run(&mesh(&[(4, 3), (4, 3)]), &options).report;
    assert_eq!((alike.unpaired_sheets, alike.two_sided_pairs), (0, 2 * 4 * 3 * 2));
    let solid = run(&shapes::cube(4), &options).report;
    assert_eq!(solid.unpaired_sheets, 0);
}

#[test]
fn an_error_limit_counts_a_sheet_once() {
    let (single, both) =
        (cards(10, [4, 12], Backs::None, 0, false), cards(10, [4, 12], Backs::Shared, 0, false));
    let options = SimplifyOptions::new(Stop::error(Length::OfDiagonal(0.002)));
    let [wanted, got] = [run(&single, &options), run(&both, &options)];
    assert_eq!(got.mesh.face_count(), 2 * wanted.mesh.face_count());
    let limit = 0.002 * got.report.error.diagonal;
    assert!([wanted, got].iter().all(|done| done.report.error.bound.is_some_and(|bound| bound <= limit)));
}

#[test]
fn levels_keep_both_sides() {
    for (count, backs) in [(12, Backs::Own), (12, Backs::Shared)] {
        let mesh = cards(count, [4, 12], backs, 0, true);
        let mut options = LodOptions::new(Levels::Ratios(vec![0.5, 0.2]));
        options.geomorph = true;
        let chain = lod(&mesh, &options).unwrap();
        let mut before = mesh.vertex_count();
        for (k, level) in chain.levels.iter().enumerate() {
            assert_eq!(unpaired(&level.mesh), 0);
            assert!(level.report.reached);
            assert_eq!(chain.geomorph(k).unwrap().len(), before);
            before = level.mesh.vertex_count();
        }
    }
}

#[test]
fn locked_backs_keep_their_bits() {
    let mut mesh = cards(3, [3, 6], Backs::Own, 1, true);
    let tags = Semantic::Discrete { name: "tag".into(), of: IntegerType::U32 };
    let values = (0..mesh.wedge_count()).map(|w| w as f32).collect();
    mesh.add_attribute(Attribute { semantic: tags.clone(), width: 1, values }).unwrap();
    // The vertices of the back of the first card.
    let of_back = 28..56;
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|v| of_back.contains(&v)).collect();
    let input = Input::new(&mesh).locked(&locked);
    let got = simplify_with(input, &SimplifyOptions::new(Stop::ratio(0.3)), &mut NoControl).unwrap().mesh;
    let view = got.positions().view();
    for v in of_back {
        let p = mesh.positions().view().get(VertexId::new(v));
        assert!(view.iter().any(|q| q == p), "vertex {v} moved");
    }
    // Each wedge of the locked back exists, with its own number.
    let tag = got.further_attributes().iter().find(|a| a.semantic == tags).unwrap();
    let kept: std::collections::BTreeSet<u32> = tag.values.iter().map(|x| *x as u32).collect();
    assert!((28..56).all(|w| kept.contains(&w)), "{kept:?}");
}

#[test]
fn a_thin_closed_plate_is_no_sheet() {
    let mut all = Builder::default();
    let n = 12;
    // Two grids, 1e-4 of the diagonal apart, connected by walls to a closed surface.
    for z in [0.0, 1e-4] {
        all.points.extend(
            (0..=n).flat_map(|j| (0..=n).map(move |i| [i as f64 / n as f64, j as f64 / n as f64, z])),
        );
    }
    let (row, side) = (n as u32 + 1, ((n + 1) * (n + 1)) as u32);
    for (i, j) in (0..n as u32).flat_map(|j| (0..n as u32).map(move |i| (i, j))) {
        let [a, b, c, d] = [j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i];
        all.faces.extend([[a, c, b], [a, d, c]]);
        all.faces.extend([[a, b, c], [a, c, d]].map(|t| t.map(|v| v + side)));
    }
    let rim: Vec<u32> = (0..n as u32)
        .chain((0..n as u32).map(|j| j * row + n as u32))
        .chain((1..=n as u32).rev().map(|i| n as u32 * row + i))
        .chain((1..=n as u32).rev().map(|j| j * row))
        .collect();
    for (k, &a) in rim.iter().enumerate() {
        let b = rim[(k + 1) % rim.len()];
        all.faces.extend([[a, b, b + side], [a, b + side, a + side]]);
    }
    all.wedges = (0..all.points.len() as u32).collect();
    let mesh = all.mesh(false);
    let got = run(&mesh, &SimplifyOptions::new(Stop::ratio(0.2)));
    assert_eq!(got.report.two_sided_pairs, 0);
}

#[test]
fn clean_keeps_one_side_of_each_sheet() {
    for backs in [Backs::Own, Backs::Shared, Backs::OtherDiagonals] {
        let mesh = cards(5, [3, 6], backs, 1, true);
        assert_eq!(two_sided_faces(&mesh.surface()), mesh.face_count());
        let mut options = CleanOptions::default();
        options.sheets = Sheets::Single;
        let cleaned = clean(&mesh, &options, &mut NoControl).unwrap();
        assert_eq!((cleaned.report.back_faces, cleaned.mesh.face_count()), (5 * 36, 5 * 36));
        assert_eq!(cleaned.single_sided, [RegionId(0)]);
        assert!((2.0 * area(&cleaned.mesh) / area(&mesh) - 1.0).abs() < 2e-3);
        assert_eq!(two_sided_faces(&cleaned.mesh.surface()), 0);
        let kept = clean(&mesh, &CleanOptions::default(), &mut NoControl).unwrap();
        assert_eq!((kept.report.back_faces, kept.mesh.face_count()), (0, 5 * 72));
        assert!(kept.single_sided.is_empty());
    }
}

#[test]
fn levels_of_progressive_meshes_have_both_sides() {
    for (backs, back_region, has_attributes) in
        [(Backs::Own, 1, true), (Backs::Shared, 0, true), (Backs::Own, 0, false), (Backs::Shared, 0, false)]
    {
        let mesh = cards(6, [3, 10], backs, back_region, has_attributes);
        let mut progressive = Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl).unwrap();
        assert!(progressive.mesh().unwrap() == mesh, "the full level is the input");
        for ratio in [0.7, 0.3, 0.1] {
            progressive.to_faces((ratio * mesh.face_count() as f64) as usize);
            for level in [progressive.mesh().unwrap(), progressive.fitted_mesh().unwrap()] {
                assert_eq!(unpaired(&level), 0);
                assert!(
                    (area(&level) / area(&mesh) - 1.0).abs() < 0.05,
                    "{} of {}",
                    area(&level),
                    area(&mesh)
                );
                for (t, region) in level.triangles().iter().zip(level.regions().unwrap_or_default()) {
                    let uvs = t.map(|w| level.uvs().unwrap()[w.index()][0]);
                    let is_back = back_region == 1 && *region == RegionId(1);
                    assert!(!is_back || uvs.iter().all(|u| *u >= 0.5 - 1e-3), "{uvs:?}");
                }
            }
        }
        let ended = SimplifyOptions::new(Stop::ratio(0.25));
        let mut progressive = Progressive::build(&mesh, &ended, &mut NoControl).unwrap();
        progressive.to_level(0);
        let faces = progressive.face_count();
        assert!(faces * 4 <= mesh.face_count() && faces * 5 > mesh.face_count(), "{faces}");
    }
}
