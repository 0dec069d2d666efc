//! The parts of a scene side by side as one mesh, and its results as parts again.

use std::collections::BTreeMap;

use lodsmith_core::{
    Attribute, Bounds, MeshError, Morphed, Positions, RegionId, Semantic, TriMesh, VertexId, WedgeId,
};

use super::part::{Part, PartMap};
use super::touching::Touching;
use crate::attributes::ranges::{has_ranges, ranges, within};
use crate::constraints::{self, HeldWedges};

/// Gap between meshes laid side by side, as a multiple of the size of the largest.
const PART_GAP: f64 = 0.25;

/// Placement of each part: scaled or stretched, then moved.
pub(super) struct Layout {
    pub(super) places: Vec<PartPlacement>,
    /// Group of each part: parts of a group are placed as in the scene.
    pub(super) groups: Vec<usize>,
    /// Offset of the joint indices of each part: joints of different systems are different joints.
    first_joints: Vec<f32>,
    /// True if several parts lie in one coordinate system.
    pub(super) has_neighbours: bool,
}

#[derive(Clone, Copy)]
pub(super) struct PartPlacement {
    map: PartMap,
    offset: [f64; 3],
}

impl PartPlacement {
    pub(super) fn to_scene(self, p: [f64; 3]) -> [f64; 3] {
        let p = self.map.to_scene(p);
        [0, 1, 2].map(|k| p[k] + self.offset[k])
    }
    pub(super) fn to_part(self, p: [f64; 3]) -> [f64; 3] {
        self.map.to_part([0, 1, 2].map(|k| p[k] - self.offset[k]))
    }

    /// Converts the values of an attribute that are lengths or directions, wedge after wedge.
    fn values_to_scene(self, semantic: &Semantic, values: &mut [f32]) {
        match semantic {
            Semantic::Tangent => map_rows::<4>(values, |d| self.map.direction_to_scene(d)),
            _ if is_displacement(semantic) => {
                map_rows::<3>(values, |d| self.map.to_scene(d.map(f64::from)).map(single))
            }
            _ => {}
        }
    }
    fn values_to_part(self, semantic: &Semantic, values: &mut [f32]) {
        match semantic {
            Semantic::Tangent => map_rows::<4>(values, |d| self.map.direction_to_part(d)),
            _ if is_displacement(semantic) => {
                map_rows::<3>(values, |d| self.map.to_part(d.map(f64::from)).map(single))
            }
            _ => {}
        }
    }
}

/// Changes the first three of every `N` values.
fn map_rows<const N: usize>(values: &mut [f32], map: impl Fn([f32; 3]) -> [f32; 3]) {
    for row in values.as_chunks_mut::<N>().0 {
        let [x, y, z] = map([row[0], row[1], row[2]]);
        (row[0], row[1], row[2]) = (x, y, z);
    }
}

/// For each region of the joined mesh, its part and its region in that part.
pub(super) type RegionTable = Vec<(usize, Option<RegionId>)>;

impl Layout {
    /// Places groups so far apart that no distance up to `near` connects two of them. Systems that touch form
    /// one group.
    pub(super) fn new(parts: &[Part<'_>], near: f64, touching: Option<&Touching>) -> Self {
        // The group of each part, and the bounding box of each group.
        let mut groups: BTreeMap<usize, usize> = BTreeMap::new();
        let mut boxes: Vec<Option<Bounds>> = Vec::new();
        let mut maps: Vec<PartMap> = Vec::new();
        let mut group_of = Vec::with_capacity(parts.len());
        let mut origins = Vec::with_capacity(parts.len());
        for p in parts {
            let mut fresh = || {
                boxes.push(None);
                maps.push(PartMap::new(p));
                boxes.len() - 1
            };
            let root = p.system.map(|s| touching.map_or((s, [0.0; 3]), |touching| touching.root(s)));
            let (group, origin) = match root {
                Some((system, origin)) => (*groups.entry(system).or_insert_with(fresh), origin),
                None => (fresh(), [0.0; 3]),
            };
            group_of.push(group);
            // All parts of a system use exactly the same map.
            let map = maps[group];
            let origin = map.to_scene(origin);
            origins.push(origin);
            if let Some(own) = p.mesh.positions().view().bounds() {
                for corner in 0..8 {
                    let p = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { own.min[k] } else { own.max[k] });
                    let p = map.to_scene(p);
                    let p = [0, 1, 2].map(|k| p[k] + origin[k]);
                    boxes[group] = Some(boxes[group].unwrap_or(Bounds { min: p, max: p }).with(p));
                }
            }
        }
        let extents = boxes.iter().flatten().flat_map(|b| [0, 1, 2].map(|k| b.max[k] - b.min[k]));
        let largest = extents.fold(0f64, f64::max);
        let cell = if largest.is_finite() && largest > 0.0 { largest * (1.0 + PART_GAP) } else { 1.0 };
        let cell = if near.is_finite() && near > 0.0 { cell + near } else { cell };
        let side = (1..).find(|n: &usize| n * n * n >= boxes.len()).unwrap_or(1);
        let offset = |group: usize| {
            let min = boxes[group].map_or([0.0; 3], |b| b.min);
            let at = [group % side, group / side % side, group / side / side];
            // A single group keeps its position.
            [0, 1, 2].map(|k| if boxes.len() > 1 { at[k] as f64 * cell - min[k] } else { 0.0 })
        };
        let place = |(&group, origin): (&usize, &[f64; 3])| {
            let offset = offset(group);
            PartPlacement { map: maps[group], offset: [0, 1, 2].map(|k| offset[k] + origin[k]) }
        };
        let has_neighbours = boxes.len() < parts.len();
        let mut joints = vec![0f32; boxes.len()];
        for (part, &group) in parts.iter().zip(&group_of) {
            joints[group] = joints[group].max(joint_count(part.mesh));
        }
        let first = |&group: &usize| {
            let first: f32 = joints[..group].iter().sum();
            // If single precision could not represent all joint indices, systems share their numbers.
            if first + MAX_JOINTS < 16_777_216.0 { first } else { 0.0 }
        };
        let first_joints = group_of.iter().map(first).collect();
        let places = group_of.iter().zip(&origins).map(place).collect();
        Self { places, groups: group_of, first_joints, has_neighbours }
    }

    /// Returns the offset of the joint indices of a part; 0 for other attributes.
    fn first_joint(&self, part: usize, semantic: &Semantic) -> f32 {
        if matches!(semantic, Semantic::Joints(_)) { self.first_joints[part] } else { 0.0 }
    }

    /// Returns all parts as one mesh whose regions identify the part of each face.
    pub(super) fn join_parts(&self, parts: &[Part<'_>]) -> Result<(TriMesh, RegionTable), MeshError> {
        let (mut positions, mut vertex_of, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        let (mut regions, mut table) = (Vec::new(), RegionTable::new());
        for (i, (part, place)) in parts.iter().zip(&self.places).enumerate() {
            let mesh = part.mesh;
            let (first_vertex, first_wedge) = (positions.len() as u32, vertex_of.len() as u32);
            positions.extend(mesh.positions().view().iter().map(|p| place.to_scene(p)));
            let wedges = (0..mesh.wedge_count() as u32).map(WedgeId);
            vertex_of.extend(wedges.map(|w| VertexId(mesh.vertex_of(w).0 + first_vertex)));
            triangles.extend(mesh.triangles().iter().map(|t| t.map(|w| WedgeId(w.0 + first_wedge))));
            let mut known: BTreeMap<Option<RegionId>, RegionId> = BTreeMap::new();
            for f in 0..mesh.face_count() {
                let own = mesh.regions().map(|r| r[f]);
                let id = *known.entry(own).or_insert_with(|| {
                    table.push((i, own));
                    RegionId::new(table.len() - 1)
                });
                regions.push(id);
            }
        }
        let mut all = TriMesh::with_wedges(Positions::F64(positions), vertex_of, triangles)?;
        all.set_regions(Some(regions))?;
        let any = |has: fn(&TriMesh) -> bool| parts.iter().any(|p| has(p.mesh));
        if any(|m| m.normals().is_some()) {
            let mut normals = joined(parts, TriMesh::normals, [0.0; 3]);
            let mut first = 0;
            for (part, place) in parts.iter().zip(&self.places) {
                let own = first..first + part.mesh.wedge_count();
                first = own.end;
                normals[own].iter_mut().for_each(|n| *n = place.map.normal_to_scene(*n));
            }
            all.set_normals(Some(normals))?;
        }
        if any(|m| m.uvs().is_some()) {
            all.set_uvs(Some(joined(parts, TriMesh::uvs, [0.0; 2])))?;
        }
        if any(|m| m.colors().is_some()) {
            all.set_colors(Some(joined(parts, TriMesh::colors, [1.0; 4])))?;
        }
        // An attribute name may have different widths in different parts: each is a separate attribute.
        let mut kinds: Vec<(&Semantic, usize)> = Vec::new();
        for a in parts.iter().flat_map(|p| p.mesh.further_attributes()) {
            if !kinds.contains(&(&a.semantic, a.width)) {
                kinds.push((&a.semantic, a.width));
            }
        }
        for (semantic, width) in kinds {
            let mut values = Vec::new();
            for (i, (part, place)) in parts.iter().zip(&self.places).enumerate() {
                let first = self.first_joint(i, semantic);
                match find(part.mesh, semantic, width) {
                    Some(a) => {
                        let begin = values.len();
                        values.extend(a.values.iter().map(|x| x + first));
                        place.values_to_scene(semantic, &mut values[begin..]);
                    }
                    None => values.resize(values.len() + part.mesh.wedge_count() * width, 0.0),
                }
            }
            all.add_attribute(Attribute { semantic: semantic.clone(), width, values })?;
        }
        Ok((all, table))
    }

    /// Splits a result into parts, each with the same kinds of attributes as before, and returns the numbers
    /// of their vertices in the result. Locked vertices keep the bits of the input.
    pub(super) fn split_parts(
        &self,
        parts: &[Part<'_>],
        all: &TriMesh,
        table: &RegionTable,
        held: &HeldWedges,
    ) -> Result<(Vec<TriMesh>, Vec<Vec<VertexId>>), MeshError> {
        let mut faces_of: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
        let regions = all.regions().unwrap_or_default();
        for (f, r) in regions.iter().enumerate() {
            faces_of[table[r.index()].0].push(f);
        }
        let mut number_of_wedge = vec![u32::MAX; all.wedge_count()];
        let mut number_of_vertex = vec![u32::MAX; all.vertex_count()];
        let positions = self.settled_positions(parts, all, &faces_of);
        let (mut meshes, mut numbers) = (Vec::with_capacity(parts.len()), Vec::with_capacity(parts.len()));
        let mut first_wedge = 0;
        for (i, ((part, place), faces)) in parts.iter().zip(&self.places).zip(&faces_of).enumerate() {
            let (mut wedges, mut vertices) = (Vec::new(), Vec::new());
            // The part's own wedge and vertex for each wedge and vertex, if locked.
            let (mut own_wedges, mut own_vertices) = (Vec::new(), Vec::new());
            for (f, k) in faces.iter().flat_map(|&f| [(f, 0), (f, 1), (f, 2)]) {
                let w = all.triangles()[f][k];
                if number_of_wedge[w.index()] == u32::MAX {
                    number_of_wedge[w.index()] = wedges.len() as u32;
                    wedges.push(w);
                    let own = held.at(f, k).and_then(|h| h.index().checked_sub(first_wedge));
                    let own = own.filter(|&i| i < part.mesh.wedge_count()).map(WedgeId::new);
                    own_wedges.push(own);
                    let v = all.vertex_of(w);
                    if number_of_vertex[v.index()] == u32::MAX {
                        number_of_vertex[v.index()] = vertices.len() as u32;
                        vertices.push(v);
                        own_vertices.push(own.map(|w| part.mesh.vertex_of(w)));
                    }
                }
            }
            first_wedge += part.mesh.wedge_count();
            let places = vertices.iter().map(|&v| place.to_part(positions[v.index()])).zip(&own_vertices);
            let positions = match part.mesh.positions() {
                Positions::F32(own) => Positions::F32(
                    places.map(|(p, v)| v.map_or_else(|| p.map(|x| x as f32), |v| own[v.index()])).collect(),
                ),
                Positions::F64(own) => {
                    Positions::F64(places.map(|(p, v)| v.map_or(p, |v| own[v.index()])).collect())
                }
            };
            let vertex_of = wedges.iter().map(|&w| VertexId(number_of_vertex[all.vertex_of(w).index()]));
            let triangles =
                faces.iter().map(|&f| all.triangles()[f].map(|w| WedgeId(number_of_wedge[w.index()])));
            let mut mesh = TriMesh::with_wedges(positions, vertex_of.collect(), triangles.collect())?;
            if part.mesh.regions().is_some() {
                let own = faces.iter().map(|&f| table[regions[f].index()].1.unwrap_or_default());
                mesh.set_regions(Some(own.collect()))?;
            }
            self.copy_attributes(&mut mesh, (i, part), all, &wedges)?;
            if own_wedges.iter().any(Option::is_some) {
                constraints::restore(&mut mesh, part.mesh, &own_wedges);
            }
            meshes.push(mesh);
            // Parts that touch share vertices, and each part counts them.
            wedges.iter().for_each(|w| number_of_wedge[w.index()] = u32::MAX);
            vertices.iter().for_each(|v| number_of_vertex[v.index()] = u32::MAX);
            numbers.push(vertices);
        }
        Ok((meshes, numbers))
    }

    /// Returns the positions of a result. Vertices that parts with different origins share are moved to
    /// positions that all of these parts can represent in single precision: otherwise each part would round
    /// them differently, and they would no longer coincide in the scene.
    fn settled_positions(&self, parts: &[Part<'_>], all: &TriMesh, faces_of: &[Vec<usize>]) -> Vec<[f64; 3]> {
        let mut positions: Vec<[f64; 3]> = all.positions().view().iter().collect();
        let mut users = vec![None; positions.len()];
        let mut is_shared = vec![false; positions.len()];
        let vertices_of =
            |i: usize| faces_of[i].iter().flat_map(|&f| all.triangles()[f].map(|w| all.vertex_of(w).index()));
        for (i, place) in self.places.iter().enumerate() {
            for v in vertices_of(i) {
                let first = *users[v].get_or_insert(i);
                is_shared[v] |= self.places[first].offset != place.offset;
            }
        }
        if !is_shared.contains(&true) {
            return positions;
        }
        // A position that is representable with one origin may not be with another: the second round finds
        // one that is with both.
        for i in (0..parts.len()).chain(0..parts.len()) {
            let Positions::F32(_) = parts[i].mesh.positions() else { continue };
            for v in vertices_of(i).filter(|&v| is_shared[v]) {
                let own = self.places[i].to_part(positions[v]).map(|x| f64::from(x as f32));
                positions[v] = self.places[i].to_scene(own);
            }
        }
        positions
    }

    /// Gives a part of the result the attributes that it had, from its `wedges` in the joined mesh.
    fn copy_attributes(
        &self,
        mesh: &mut TriMesh,
        (i, part): (usize, &Part<'_>),
        all: &TriMesh,
        wedges: &[WedgeId],
    ) -> Result<(), MeshError> {
        if part.mesh.normals().is_some() {
            let own = |w: &WedgeId, n: &[[f32; 3]]| self.places[i].map.normal_to_part(n[w.index()]);
            mesh.set_normals(all.normals().map(|n| wedges.iter().map(|w| own(w, n)).collect()))?;
        }
        if part.mesh.uvs().is_some() {
            mesh.set_uvs(all.uvs().map(|t| of_part(t, wedges, part.mesh.uvs())))?;
        }
        if part.mesh.colors().is_some() {
            mesh.set_colors(all.colors().map(|c| of_part(c, wedges, part.mesh.colors())))?;
        }
        for a in part.mesh.further_attributes() {
            let Some(source) = find(all, &a.semantic, a.width) else { continue };
            let first = self.first_joint(i, &a.semantic);
            let given = |x: &f32| match first {
                0.0 => *x,
                // (A joint with weight 0 has index 0 in the joined mesh.)
                first => (x - first).max(0.0),
            };
            let mut values: Vec<f32> = wedges.iter().flat_map(|&w| source.of(w)).map(given).collect();
            self.places[i].values_to_part(&a.semantic, &mut values);
            if has_ranges(&a.semantic) {
                let ranges = ranges(&a.values, a.width);
                for row in values.chunks_exact_mut(a.width) {
                    row.iter_mut().zip(&ranges).for_each(|(x, range)| *x = within(*x, *range));
                }
            }
            mesh.add_attribute(Attribute { values, ..a.clone() })?;
        }
        resum_weights(mesh, all, wedges);
        Ok(())
    }
}

/// Largest number of joints that a glTF mesh can use: their indices have two bytes.
const MAX_JOINTS: f32 = 65_536.0;

/// Returns the number of joints that a mesh may use.
fn joint_count(mesh: &TriMesh) -> f32 {
    let sets = mesh.further_attributes().iter().filter(|a| matches!(a.semantic, Semantic::Joints(_)));
    let largest = sets.flat_map(|a| &a.values).copied().filter(|x| x.is_finite()).fold(-1.0, f32::max);
    (largest + 1.0).min(MAX_JOINTS)
}

/// Concatenates an attribute of all parts, wedge after wedge; `blank` fills parts that do not have it.
fn joined<'a, const N: usize>(
    parts: &[Part<'a>],
    of: impl Fn(&'a TriMesh) -> Option<&'a [[f32; N]]>,
    blank: [f32; N],
) -> Vec<[f32; N]> {
    let mut all = Vec::new();
    for part in parts {
        match of(part.mesh) {
            Some(values) => all.extend_from_slice(values),
            None => all.resize(all.len() + part.mesh.wedge_count(), blank),
        }
    }
    all
}

/// Extracts an attribute of a part from the joined mesh, clamped to its ranges in the part.
fn of_part<const N: usize>(
    all: &[[f32; N]],
    wedges: &[WedgeId],
    source: Option<&[[f32; N]]>,
) -> Vec<[f32; N]> {
    let ranges = ranges(source.map_or(&[], <[_]>::as_flattened), N);
    wedges.iter().map(|w| std::array::from_fn(|k| within(all[w.index()][k], ranges[k]))).collect()
}

fn find<'a>(mesh: &'a TriMesh, semantic: &Semantic, width: usize) -> Option<&'a Attribute> {
    mesh.further_attributes().iter().find(|a| a.semantic == *semantic && a.width == width)
}

/// Returns true for values that grow with the mesh.
fn is_displacement(semantic: &Semantic) -> bool {
    matches!(semantic, Semantic::Morph { of: Morphed::Position, .. })
}

/// Converts to single precision; finite values beyond its range are clamped.
fn single(x: f64) -> f32 {
    if x.is_finite() { x.clamp(f64::from(-f32::MAX), f64::from(f32::MAX)) as f32 } else { x as f32 }
}

/// Rescales joint weights to a sum of 1 where `all`, the joined mesh, has weights in sets that the mesh does
/// not have.
fn resum_weights(mesh: &mut TriMesh, all: &TriMesh, wedges: &[WedgeId]) {
    let is_weight = |a: &Attribute| matches!(a.semantic, Semantic::Weights(_)) && a.width == 4;
    let own = mesh.further_attributes();
    let sets: Vec<usize> = (0..own.len()).filter(|&i| is_weight(&own[i])).collect();
    let is_lost = |a: &&Attribute| is_weight(a) && !own.iter().any(|b| b.semantic == a.semantic);
    let lost: Vec<&Attribute> = all.further_attributes().iter().filter(is_lost).collect();
    for (w, of_all) in wedges.iter().enumerate() {
        if lost.iter().all(|a| a.of(*of_all) == [0.0; 4]) {
            continue;
        }
        let of = 4 * w..4 * w + 4;
        let sum: f32 = sets.iter().flat_map(|&i| &mesh.further_attributes()[i].values[of.clone()]).sum();
        if sum > 0.0 {
            for &i in &sets {
                mesh.further_values_mut(i)[of.clone()].iter_mut().for_each(|x| *x /= sum);
            }
        }
    }
}
