//! Meshes with attributes of all kinds, and checks of results with attributes.

use std::collections::{HashMap, HashSet};

use lodsmith::core::mesh::normals::vertex_normals;
use lodsmith::core::{Attribute, Morphed, RegionId, Semantic, TriMesh, VertexId, WedgeId};
use lodsmith::{AttributeWeights, Length, OwnedMeshData, Placement, Preset, SimplifyOptions};

use super::Random;

/// Returns the mesh with random attributes: charts, regions, skins, morph targets, tangents; sometimes with
/// invalid numbers.
pub(crate) fn with_random_attributes(plain: &TriMesh, random: &mut Random) -> TriMesh {
    let mut mesh = charted(plain, random);
    let count = mesh.wedge_count();
    let wild = random.below(4) == 0;
    let [smooth, flat] = [random.below(3) > 0, random.below(8) == 0];
    let waves: Vec<[f64; 4]> = (0..8).map(|_| [0; 4].map(|_| 4.0 * random.unit() - 2.0)).collect();
    let size = plain.positions().view().bounds().map_or(1.0, |b| b.diagonal()).max(1e-30);
    let places: Vec<[f64; 3]> = {
        let view = mesh.positions().view();
        (0..count as u32).map(|w| view.get(mesh.vertex_of(WedgeId(w))).map(|x| x / size)).collect()
    };
    let mut wave = 0;
    // One value for each wedge, from 0 to 1 for valid attributes.
    let mut column = |random: &mut Random| -> Vec<f32> {
        wave += 1;
        let [a, b, c, d] = waves[wave % waves.len()];
        let value = |p: &[f64; 3]| match (flat, smooth) {
            (true, _) => 0.25,
            (_, true) => 0.5 + 0.5 * (a * p[0] + b * p[1] + c * p[2] + d).sin(),
            _ => random.unit(),
        };
        let mut values: Vec<f32> = places.iter().map(value).map(|x| x as f32).collect();
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX, 1e-40, -0.0, 1e20, -1.0];
        for x in values.iter_mut() {
            if wild && random.below(6) == 0 {
                *x = random.pick(&odd);
            }
        }
        values
    };
    let mut columns = |n: usize, random: &mut Random| -> Vec<f32> {
        let all: Vec<Vec<f32>> = (0..n).map(|_| column(random)).collect();
        (0..count).flat_map(|w| all.iter().map(move |c| c[w])).collect()
    };
    if random.below(2) == 0 {
        let own = vertex_normals(&mesh.surface(), |v| v);
        let normals = match random.below(3) {
            0 => columns(3, random).as_chunks::<3>().0.to_vec(),
            1 => (0..count).map(|_| direction(random)).collect(),
            _ => (0..count as u32).map(|w| own[mesh.vertex_of(WedgeId(w)).index()]).collect(),
        };
        mesh.set_normals(Some(normals)).unwrap();
    }
    if random.below(2) == 0 {
        mesh.set_uvs(Some(columns(2, random).as_chunks::<2>().0.to_vec())).unwrap();
    }
    if random.below(3) == 0 {
        mesh.set_colors(Some(columns(4, random).as_chunks::<4>().0.to_vec())).unwrap();
    }
    let mut add =
        |semantic, width, values| mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    if random.below(4) == 0 {
        let side = |random: &mut Random| if random.below(2) == 0 { 1.0 } else { -1.0 };
        let mut tangents = Vec::new();
        for _ in 0..count {
            tangents.extend(direction(random));
            tangents.push(side(random));
        }
        add(Semantic::Tangent, 4, tangents);
    }
    if random.below(4) == 0 {
        let sets = 1 + random.below(2) as u8;
        let mut weights: Vec<Vec<f32>> = (0..sets).map(|_| columns(4, random)).collect();
        if !wild {
            for w in 0..count {
                weights.iter_mut().for_each(|x| x[4 * w..4 * w + 4].iter_mut().for_each(|x| *x = x.abs()));
                let sum: f32 = weights.iter().map(|x| x[4 * w..4 * w + 4].iter().sum::<f32>()).sum();
                for own in weights.iter_mut().flat_map(|x| &mut x[4 * w..4 * w + 4]) {
                    *own = if sum > 0.0 { *own / sum } else { 0.125 * f32::from(3 - sets) };
                }
            }
        }
        for (set, weights) in (0..sets).zip(weights) {
            let any = (0..4 * count).map(|_| random.below(6) as f32).collect();
            let joints = if wild && random.below(2) == 0 { columns(4, random) } else { any };
            add(Semantic::Joints(set), 4, joints);
            add(Semantic::Weights(set), 4, weights);
        }
    }
    let others = [
        (Semantic::Uv(1), 2),
        (Semantic::Color(1), 4),
        (Semantic::Morph { target: 0, of: Morphed::Position }, 3),
        (Semantic::Morph { target: 1, of: Morphed::Position }, 3),
        (Semantic::Morph { target: 1, of: Morphed::Normal }, 3),
        (Semantic::Morph { target: 0, of: Morphed::Tangent }, 3),
        (Semantic::Custom("_HEAT".to_owned()), 1),
        (Semantic::Custom("_WIDE".to_owned()), 1 + random.below(6) as usize),
        // Weights without joints are no skin.
        (Semantic::Weights(5), 4),
    ];
    for (semantic, width) in others {
        if random.below(6) == 0 {
            add(semantic, width, columns(width, random));
        }
    }
    mesh
}

/// Random values of rarely used options, and random locks and importance of vertices.
pub(crate) fn with_rare_options(
    mut options: SimplifyOptions,
    random: &mut Random,
    vertices: usize,
) -> (SimplifyOptions, OwnedMeshData) {
    let mut data = OwnedMeshData::default();
    let shape = [Preset::Auto, Preset::Auto, Preset::Scan, Preset::Cad, Preset::Visual, Preset::Print];
    let preset = SimplifyOptions::preset(random.pick(&shape), options.stop);
    options.weights = preset.weights;
    options.weld = options.weld.or(preset.weld);
    options.shape_normals = preset.shape_normals || random.below(4) == 0;
    options.prune = (random.below(6) == 0).then(|| Length::OfDiagonal(0.5 * random.unit()));
    options.escalate = random.below(4) == 0;
    options.per_mesh = random.below(4) == 0;
    if random.below(3) == 0 {
        let mut any = || random.pick(&[0.0, 1.0, 1.0, 0.5, 10.0, 1e6, 1e30]);
        let [normal, uv, color, morph, skin, other, border] = [0; 7].map(|_| any());
        options.weights = AttributeWeights { normal, uv, color, morph, skin, other, border };
    }
    if random.below(3) == 0 {
        let one_in = random.pick(&[1, 2, 4, 20]);
        data.locked = Some((0..vertices).map(|_| random.below(one_in) == 0).collect());
    }
    if random.below(3) == 0 {
        let of = random.pick(&[[1.0f32, 4.0], [1e-30, 1e30], [0.1, 1.0], [2.0, 2.0]]);
        data.importance = Some((0..vertices).map(|_| random.pick(&of)).collect());
    }
    (options, data)
}

/// Returns the same faces with wedges: one for each vertex, for each chart at a vertex, or for each corner;
/// with or without regions.
fn charted(plain: &TriMesh, random: &mut Random) -> TriMesh {
    let surface = plain.surface();
    let normal = direction(random).map(f64::from);
    let view = surface.positions();
    let height = |v: VertexId| view.get(v).iter().zip(normal).map(|(x, n)| x * n).sum::<f64>();
    let charts: Vec<u32> = match random.below(4) {
        0 | 1 => vec![0; plain.face_count()],
        2 => {
            let level = view
                .bounds()
                .map_or(0.0, |b| [0, 1, 2].map(|k| normal[k] * 0.5 * (b.min[k] + b.max[k])).iter().sum());
            let side = |t: &[VertexId; 3]| u32::from(t.iter().map(|&v| height(v) - level).sum::<f64>() > 0.0);
            surface.triangles().iter().map(side).collect()
        }
        _ => (0..plain.face_count()).map(|_| random.below(3) as u32).collect(),
    };
    let mut mesh = match random.below(3) {
        0 => TriMesh::new(plain.positions().clone(), surface.triangles().to_vec()).unwrap(),
        kind => {
            let mut known: HashMap<(VertexId, u32), WedgeId> = HashMap::new();
            let mut vertex_of = Vec::new();
            let mut triangles = Vec::new();
            for (f, t) in surface.triangles().iter().enumerate() {
                triangles.push(t.map(|v| {
                    let name = if kind == 1 { charts[f] } else { f as u32 };
                    *known.entry((v, name)).or_insert_with(|| {
                        vertex_of.push(v);
                        WedgeId::new(vertex_of.len() - 1)
                    })
                }));
            }
            TriMesh::with_wedges(plain.positions().clone(), vertex_of, triangles).unwrap()
        }
    };
    if random.below(3) == 0 {
        let shift = random.below(3) as u32;
        mesh.set_regions(Some(charts.iter().map(|&c| RegionId(c + shift)).collect())).unwrap();
    }
    mesh
}

fn direction(random: &mut Random) -> [f32; 3] {
    let v = [0; 3].map(|_| 2.0 * random.unit() - 1.0);
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.01 { v.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
}

/// Returns every attribute by name, with its width and its values.
pub(crate) fn kinds(mesh: &TriMesh) -> Vec<(String, usize, Vec<f32>)> {
    let mut all = Vec::new();
    all.extend(mesh.normals().map(|x| ("normals".to_owned(), 3, x.as_flattened().to_vec())));
    all.extend(mesh.uvs().map(|x| ("uvs".to_owned(), 2, x.as_flattened().to_vec())));
    all.extend(mesh.colors().map(|x| ("colours".to_owned(), 4, x.as_flattened().to_vec())));
    let further = mesh.further_attributes().iter();
    all.extend(further.map(|a| (format!("{:?}", a.semantic), a.width, a.values.clone())));
    all
}

fn is_unit(n: &[f32]) -> bool {
    (n[..3].iter().map(|x| f64::from(x * x)).sum::<f64>() - 1.0).abs() < 1e-3
}

/// Returns the sum of the weights of all sets at each wedge.
fn weight_sums(mesh: &TriMesh) -> Vec<f64> {
    let sets = mesh.further_attributes().iter().filter(|a| matches!(a.semantic, Semantic::Weights(0 | 1)));
    let mut sums = Vec::new();
    for a in sets {
        sums.resize(mesh.wedge_count(), 0.0);
        let own = a.values.chunks_exact(4).map(|w| w.iter().map(|&x| f64::from(x)).sum::<f64>());
        sums.iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
    }
    sums
}

/// Returns what is wrong with the attributes of a result. Attributes of locked vertices, and all attributes
/// with endpoint placement, are values of the input, valid or not.
pub(crate) fn attribute_complaints(
    mesh: &TriMesh,
    placement: Placement,
    locked: Option<&[bool]>,
    result: &TriMesh,
) -> Vec<String> {
    let mut found = Vec::new();
    let (old, new) = (kinds(mesh), kinds(result));
    // (Weights without joints are dropped where values are transferred; with endpoint placement only if seams
    // gave way.)
    let is_kept = |all: &[(String, usize, Vec<f32>)]| all.iter().any(|x| x.0 == "Weights(5)");
    let dropped = |name: &str| name == "Weights(5)" && (placement != Placement::Endpoint || !is_kept(&new));
    let names = |all: &[(String, usize, Vec<f32>)]| {
        let mut names: Vec<_> = all.iter().map(|x| (x.0.clone(), x.1)).filter(|x| !dropped(&x.0)).collect();
        names.sort();
        names
    };
    if names(&old) != names(&new) {
        found.push(format!("attributes {:?} became {:?}", names(&old), names(&new)));
    }
    if mesh.regions().is_some() != result.regions().is_some() {
        found.push("regions appeared or disappeared".to_owned());
    }
    let known: HashSet<RegionId> = mesh.regions().into_iter().flatten().copied().collect();
    if result.regions().into_iter().flatten().any(|r| !known.contains(r)) {
        found.push("a region that is not in the input".to_owned());
    }
    let used: HashSet<WedgeId> = result.triangles().iter().flatten().copied().collect();
    if used.len() != result.wedge_count() {
        found.push(format!("{} of {} wedges are used", used.len(), result.wedge_count()));
    }
    if placement == Placement::Endpoint {
        return found;
    }
    // Positions of locked vertices; -0 equals 0.
    let place =
        |m: &TriMesh, v: usize| m.positions().view().get(VertexId::new(v)).map(|x| (x + 0.0).to_bits());
    let held: HashSet<[u64; 3]> =
        (0..mesh.vertex_count()).filter(|&v| locked.is_some_and(|l| l[v])).map(|v| place(mesh, v)).collect();
    let is_free = |w: usize| !held.contains(&place(result, result.vertex_of(WedgeId::new(w)).index()));
    for (name, width, values) in &new {
        // Named values that are missing in the input are missing in the result: NaN, and nowhere else.
        let source =
            old.iter().find(|x| x.0 == *name && x.1 == *width).filter(|_| name.starts_with("Custom"));
        let missing =
            |k: usize| source.is_some_and(|x| x.2.iter().skip(k).step_by(*width).any(|x| !x.is_finite()));
        let is_valid = |(k, x): (usize, &f32)| x.is_finite() || x.is_nan() && missing(k);
        let bad = |x: &(usize, &[f32])| is_free(x.0) && !x.1.iter().enumerate().all(is_valid);
        if let Some((w, bad)) = values.chunks_exact(*width).enumerate().find(bad) {
            found.push(format!("{name} of wedge {w} are {bad:?}"));
        }
        let is_direction = name == "normals" || name == "Tangent";
        let before = old.iter().find(|x| x.0 == *name);
        let all_unit = || before.is_some_and(|x| x.2.chunks_exact(*width).all(is_unit));
        if is_direction && all_unit() {
            let bad = |x: &(usize, &[f32])| !is_unit(x.1);
            if let Some((w, bad)) = values.chunks_exact(*width).enumerate().find(bad) {
                found.push(format!("{name} of wedge {w} are {bad:?}"));
            }
        }
    }
    let off = |x: &f64| (x - 1.0).abs() >= 1e-3;
    if !weight_sums(mesh).iter().any(off)
        && let Some(sum) = weight_sums(result).into_iter().find(off)
    {
        found.push(format!("weights sum to {sum}"));
    }
    found
}

/// Returns all attributes of a corner, as bits.
fn corner(mesh: &TriMesh, w: WedgeId) -> Vec<u64> {
    let mut all = super::bits(mesh.positions().view().get(mesh.vertex_of(w)).map(|x| x + 0.0)).to_vec();
    let mut kinds: Vec<(String, Vec<f32>)> = Vec::new();
    kinds.extend(mesh.normals().map(|x| ("a".to_owned(), x[w.index()].to_vec())));
    kinds.extend(mesh.uvs().map(|x| ("b".to_owned(), x[w.index()].to_vec())));
    kinds.extend(mesh.colors().map(|x| ("c".to_owned(), x[w.index()].to_vec())));
    let further = mesh.further_attributes().iter().filter(|a| a.semantic != Semantic::Weights(5));
    kinds.extend(further.map(|a| (format!("{:?}", a.semantic), a.of(w).to_vec())));
    kinds.sort_by(|a, b| a.0.cmp(&b.0));
    all.extend(kinds.iter().flat_map(|k| &k.1).map(|x| u64::from(x.to_bits())));
    all
}

/// Returns what is wrong with the locked part of a result. If vertices were `welded`, or contracted in pairs
/// (`paired`), others may have been merged onto locked ones, with their attributes.
pub(crate) fn locked_complaints(
    mesh: &TriMesh,
    locked: &[bool],
    (welded, paired): (bool, bool),
    result: &TriMesh,
) -> Vec<String> {
    let mut found = Vec::new();
    let place =
        |m: &TriMesh, w: WedgeId| m.positions().view().get(m.vertex_of(w)).map(|x| (x + 0.0).to_bits());
    let finite = |p: &[u64; 3]| p.iter().all(|x| f64::from_bits(*x).is_finite());
    let turned = |[a, b, c]: [[u64; 3]; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min();
    let is_sound = |t: &[[u64; 3]; 3]| t.iter().all(finite) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    let places: HashSet<[u64; 3]> = mesh
        .triangles()
        .iter()
        .flatten()
        .filter(|w| locked[mesh.vertex_of(**w).index()])
        .map(|w| place(mesh, *w))
        .collect();
    let of = |m: &TriMesh, t: &[WedgeId; 3]| t.map(|w| place(m, w));
    let left: HashSet<_> = result.triangles().iter().filter_map(|t| turned(of(result, t))).collect();
    let sound = || mesh.triangles().iter().map(|t| (t, of(mesh, t))).filter(|x| is_sound(&x.1));
    let is_locked = |t: &[[u64; 3]; 3]| t.iter().all(|p| places.contains(p));
    let gone =
        sound().filter(|x| is_locked(&x.1)).filter(|x| !turned(x.1).is_some_and(|t| left.contains(&t)));
    let gone = gone.count();
    if gone > 0 {
        found.push(format!("{gone} locked faces are gone"));
    }
    let there: HashSet<_> = result.triangles().iter().flatten().map(|w| place(result, *w)).collect();
    // A face next to a locked vertex may have collapsed in a weld.
    let missing: HashSet<_> = sound()
        .filter(|x| !welded || is_locked(&x.1))
        .flat_map(|x| x.1)
        .filter(|p| places.contains(p) && !there.contains(p))
        .collect();
    if !missing.is_empty() {
        found.push(format!("{} locked vertices are gone", missing.len()));
    }
    if !welded && !paired {
        let corners = |m: &TriMesh| {
            let wedges = m.triangles().iter().flatten().filter(|w| places.contains(&place(m, **w)));
            wedges.map(|&w| corner(m, w)).collect::<HashSet<_>>()
        };
        let wanted = corners(mesh);
        if let Some(changed) = corners(result).difference(&wanted).next() {
            let was = wanted.iter().find(|c| c[..3] == changed[..3]);
            found.push(format!("a corner of a locked vertex has other values: {changed:?} for {was:?}"));
        }
    }
    found
}
