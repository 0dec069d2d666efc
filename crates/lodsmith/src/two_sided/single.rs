//! A mesh without the backs of its sheets: the values of the backs are stored as further attributes.

use std::collections::{BTreeMap, HashMap};

use lodsmith_core::{Attribute, MeshError, RegionId, Semantic, TriMesh, VertexId, WedgeId};

use super::pairs::FacePairs;
use super::plan::{BackValues, Plan, tangent_sign};
use crate::attributes::textures::Textures;
use crate::input::{MeshData, OwnedMeshData};

/// What the faces of a region of the single-sided mesh stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SheetRegion {
    /// The region of the face, if the input has regions.
    pub(super) front: Option<RegionId>,
    pub(super) back: Option<Back>,
}

/// The back of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Back {
    pub(super) region: Option<RegionId>,
    /// True if its vertices differ from the vertices of the front.
    pub(super) has_own_vertices: bool,
}

/// A mesh without the backs of its sheets.
pub(super) struct SingleSided {
    pub(super) mesh: TriMesh,
    pub(super) plan: Plan,
    /// What each region of the mesh stands for.
    pub(super) table: Vec<SheetRegion>,
    /// Wedges of the input that each wedge stands for: front, and back at sheets.
    pub(super) wedges: Vec<[Option<WedgeId>; 2]>,
    /// Faces of the input that each face stands for, front and back; [`u32::MAX`] without a back.
    pub(super) faces: Vec<[u32; 2]>,
}

/// Returns for each corner of the front of a pair the back face at the same place and its corner there.
/// `places` gives the vertices of a face; a corner for which no back has the place is a bug of the caller.
pub(super) fn back_corners(
    front: u32,
    backs: &[u32],
    places: impl Fn(u32) -> [VertexId; 3],
) -> [(u32, usize); 3] {
    places(front).map(|v| {
        let corner = |f: u32| places(f).iter().position(|b| *b == v).map(|k| (f, k));
        backs.iter().find_map(|f| corner(*f)).expect("both sides of a pair have the same corners")
    })
}

impl SingleSided {
    /// Leaves the backs out of a mesh. `rank` gives the place of a vertex, which is equal for the vertices of
    /// both sides.
    pub(super) fn new(
        input: &TriMesh,
        pairs: &FacePairs,
        rank: impl Fn(VertexId) -> VertexId,
    ) -> Result<Self, MeshError> {
        let triangles = input.triangles();
        let mut is_left_out = vec![false; triangles.len()];
        for f in pairs.pairs.iter().flat_map(|p| p.backs()).chain(&pairs.duplicates) {
            is_left_out[*f as usize] = true;
        }
        let places = |f: u32| triangles[f as usize].map(|w| rank(input.vertex_of(w)));
        // A face of the back, and its wedges at the corners of the front.
        let mut backs: HashMap<u32, (u32, [WedgeId; 3])> = HashMap::with_capacity(pairs.pairs.len());
        for pair in &pairs.pairs {
            for &front in pair.fronts() {
                let corners = back_corners(front, pair.backs(), places);
                backs.insert(front, (corners[0].0, corners.map(|(f, k)| triangles[f as usize][k])));
            }
        }
        let region = |f: u32| input.regions().map(|r| r[f as usize]);

        let mut table: Vec<SheetRegion> = Vec::new();
        let mut number_of: BTreeMap<SheetRegion, RegionId> = BTreeMap::new();
        let mut wedges: Vec<[Option<WedgeId>; 2]> = Vec::new();
        let mut wedge_of: HashMap<(WedgeId, Option<WedgeId>), WedgeId> = HashMap::new();
        let (mut faces, mut regions, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut corners: Vec<[WedgeId; 2]> = Vec::new();
        for (f, t) in (0u32..).zip(triangles).filter(|(f, _)| !is_left_out[*f as usize]) {
            let own = backs.get(&f).copied();
            faces.push([0, 1, 2].map(|k| {
                let (front, back) = (t[k], own.map(|b| b.1[k]));
                corners.extend(back.map(|back| [front, back]));
                *wedge_of.entry((front, back)).or_insert_with(|| {
                    wedges.push([Some(front), back]);
                    WedgeId::new(wedges.len() - 1)
                })
            }));
            sources.push([f, own.map_or(u32::MAX, |b| b.0)]);
            let back = own.map(|b| Back {
                region: region(b.0),
                has_own_vertices: (0..3).any(|k| input.vertex_of(b.1[k]) != input.vertex_of(t[k])),
            });
            let kind = SheetRegion { front: region(f), back };
            regions.push(*number_of.entry(kind).or_insert_with(|| {
                table.push(kind);
                RegionId::new(table.len() - 1)
            }));
        }
        let front = |w: &[Option<WedgeId>; 2]| w[0].unwrap_or_default();
        let vertex_of = wedges.iter().map(|w| input.vertex_of(front(w))).collect();
        let mut mesh = TriMesh::with_wedges(input.positions().clone(), vertex_of, faces)?;
        mesh.set_regions(Some(regions))?;
        let plan = Plan::new(input, &corners);
        copy_fronts(&mut mesh, input, &wedges)?;
        add_backs(&mut mesh, input, &plan, &wedges)?;
        Ok(Self { mesh, plan, table, wedges, faces: sources })
    }

    /// True if the input can be restored from this mesh, element by element: each wedge and vertex belongs to
    /// one front, to one back, or to no face, and no face was left out.
    pub(super) fn is_exact(&self, input: &TriMesh, pairs: &FacePairs, own: &[[VertexId; 2]]) -> bool {
        let is_plain = pairs.duplicates.is_empty() && pairs.pairs.iter().all(|p| p.fronts().len() == 1);
        let mut uses = vec![0u8; input.wedge_count()];
        for [front, back] in &self.wedges {
            let shares = front == back;
            for w in front.iter().chain(back.iter().filter(|_| !shares)) {
                uses[w.index()] = uses[w.index()].saturating_add(1);
            }
        }
        let are_own = own.is_empty() || self.table.iter().filter_map(|r| r.back).all(|b| b.has_own_vertices);
        let shares_wedge = self.wedges.iter().any(|[front, back]| front == back);
        let differs = self.wedges.iter().any(|[front, back]| back.is_some() && front != back);
        // Each vertex of a back belongs to one vertex of a front, and is not used by a front itself.
        let (mut is_front, mut is_back) =
            (vec![false; input.vertex_count()], vec![false; input.vertex_count()]);
        let is_matched = own.iter().all(|[back, front]| {
            !std::mem::replace(&mut is_back[back.index()], true)
                && !std::mem::replace(&mut is_front[front.index()], true)
        });
        let view = input.positions().view();
        let are_at_one_place = own
            .iter()
            .all(|[back, front]| view.get(*back).map(f64::to_bits) == view.get(*front).map(f64::to_bits));
        let front_of_none = self.wedges.iter().all(|w| {
            let v = input.vertex_of(w[0].unwrap_or_default());
            !is_back[v.index()]
        });
        is_plain
            && uses.iter().all(|n| *n == 1)
            && are_own
            && !(shares_wedge && differs)
            && is_matched
            && are_at_one_place
            && front_of_none
    }

    /// Returns the data of this mesh from the data of the input, which has `wedge_count` wedges. `own` pairs
    /// the vertices of backs with vertices of fronts: a lock, importance or share of the error on one side applies
    /// to both.
    pub(super) fn data_of(
        &self,
        data: &MeshData<'_>,
        own: &[[VertexId; 2]],
        wedge_count: usize,
    ) -> OwnedMeshData {
        let mut locked = data.locked.map(<[bool]>::to_vec);
        let mut importance = data.importance.map(<[f32]>::to_vec);
        let mut error_map = data.error_map.map(<[f32]>::to_vec);
        for [back, front] in own.iter().map(|both| both.map(VertexId::index)) {
            locked.iter_mut().for_each(|all| all[front] |= all[back]);
            importance.iter_mut().for_each(|all| all[front] = all[front].max(all[back]));
            error_map.iter_mut().for_each(|all| all[front] = all[front].min(all[back]));
        }
        let textures = data
            .textures
            .map(|all| Textures::of_regions(self.table.iter().map(|r| all.of(r.front).cloned()).collect()));
        let region_classes = data.region_classes.map(|own| {
            let mut first: BTreeMap<(Option<RegionId>, Option<Back>), RegionId> = BTreeMap::new();
            let class = |(i, region): (usize, &SheetRegion)| {
                let front = region.front.map(|r| own.get(r.index()).copied().unwrap_or(r));
                *first.entry((front, region.back)).or_insert_with(|| RegionId::new(i))
            };
            self.table.iter().enumerate().map(class).collect()
        });
        let wedge_values = data.wedge_values.map(|all| {
            let width = all.len() / wedge_count.max(1);
            let of_front = |w: &[Option<WedgeId>; 2]| {
                let first = w[0].unwrap_or_default().index() * width;
                &all[first..first + width]
            };
            self.wedges.iter().flat_map(of_front).copied().collect()
        });
        OwnedMeshData { locked, importance, error_map, textures, region_classes, wedge_values }
    }
}

/// Copies the attributes of the input at the front wedges.
fn copy_fronts(
    mesh: &mut TriMesh,
    input: &TriMesh,
    wedges: &[[Option<WedgeId>; 2]],
) -> Result<(), MeshError> {
    let fronts = || wedges.iter().map(|w| w[0].unwrap_or_default());
    mesh.set_normals(input.normals().map(|n| fronts().map(|w| n[w.index()]).collect()))?;
    mesh.set_uvs(input.uvs().map(|t| fronts().map(|w| t[w.index()]).collect()))?;
    mesh.set_colors(input.colors().map(|c| fronts().map(|w| c[w.index()]).collect()))?;
    for a in input.further_attributes() {
        let values = fronts().flat_map(|w| a.of(w)).copied().collect();
        mesh.add_attribute(Attribute { values, ..a.clone() })?;
    }
    Ok(())
}

/// Adds the attributes that store values of the backs. At faces without a back they have the values of the
/// front, which adds neither seams nor gradients.
fn add_backs(
    mesh: &mut TriMesh,
    input: &TriMesh,
    plan: &Plan,
    wedges: &[[Option<WedgeId>; 2]],
) -> Result<(), MeshError> {
    let sources = || wedges.iter().map(|w| w[1].or(w[0]).unwrap_or_default());
    let mut add = |semantic: &Semantic, width: usize, values: Vec<f32>| {
        mesh.add_attribute(Attribute { semantic: semantic.clone(), width, values })
    };
    if let (Some(BackValues::Own(semantic)), Some(n)) = (&plan.normals, input.normals()) {
        add(semantic, 3, sources().flat_map(|w| n[w.index()]).collect())?;
    }
    if let (Some(BackValues::Own(semantic)), Some(t)) = (&plan.uvs, input.uvs()) {
        add(semantic, 2, sources().flat_map(|w| t[w.index()]).collect())?;
    }
    if let (Some(BackValues::Own(semantic)), Some(c)) = (&plan.colors, input.colors()) {
        add(semantic, 4, sources().flat_map(|w| c[w.index()]).collect())?;
    }
    for (a, back) in input.further_attributes().iter().zip(&plan.further) {
        let BackValues::Own(semantic) = back else { continue };
        if a.semantic == Semantic::Tangent && a.width == 4 {
            add(semantic, 3, sources().flat_map(|w| &a.of(w)[..3]).copied().collect())?;
            add(&tangent_sign(), 1, sources().map(|w| a.of(w)[3]).collect())?;
        } else {
            add(semantic, a.width, sources().flat_map(|w| a.of(w)).copied().collect())?;
        }
    }
    Ok(())
}

/// Returns a vector at length 1, if it has one.
pub(super) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    glam::Vec3::from(v).try_normalize().map(|v| v.to_array())
}
