//! Attribute transfer from the original surface to the corners of a new one.
//!
//! A new face belongs to one position of the original surface, under its centre. From there its corners
//! search for their nearest points without crossing a seam, so a face across a seam takes all of its values
//! from one side. Shading seams and texture seams are separate: each kind has its own neighbourhood.

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::geometry::triangle::{double_area_normal, nearest, weights_at};
use lodsmith_core::spatial::Bvh;
use lodsmith_core::{FaceId, Positions, PositionsView, RegionId, Surface, TriMesh, VertexId, WedgeId};

use super::task::{PreparedInput, RebuiltSurface};
use crate::SimplifyError;
use crate::attributes::Rows;
use crate::collapse::attributes::{Attributes, JointWeights};
use crate::collapse::order::{self, NONE, Ordered};
use crate::constraints::HeldWedges;
use crate::input::Input;

/// No neighbour: at a border, a seam or a non-manifold edge.
const NO_NEIGHBOUR: u32 = u32::MAX;
/// Cosine of the angle beyond which a face of the original faces away from a new face.
const MIN_FACING_COS: f64 = -0.2;
/// Upper limit of the rounding of a distance, in a frame of size 1.
const DISTANCE_SLACK: f64 = 1e-9;
/// Share by which a corner is moved towards the centre of its face to choose among equally near faces.
const INWARD_SHARE: f64 = 0.1;
/// Rows at one vertex whose values differ by less than this share of the largest of their kind are merged.
const ROW_TOLERANCE: f32 = 1e-5;
/// Maximum number of corners searched at a locked vertex, so that the work at fans stays linear. (Guessed:
/// all vertices but the centres of fans have fewer.)
const MAX_CORNERS: usize = 64;

/// Attribute values at the corners of the original surface.
struct AttributeSource<'a> {
    pub(super) prepared: &'a PreparedInput,
    pub(super) rows: &'a Rows,
    pub(super) attributes: &'a Attributes,
    /// The value row of each corner of the prepared input.
    pub(super) corners: &'a [[WedgeId; 3]],
    /// The input wedge of each of these corners.
    pub(super) wedges: &'a [[WedgeId; 3]],
    /// Rows of values of the new corners, if these keep their shading.
    pub(super) shading: Option<&'a [f32]>,
}

/// Attributes of the new surface.
struct TransferredAttributes {
    pub(super) corners: Vec<[WedgeId; 3]>,
    pub(super) attributes: Attributes,
    pub(super) regions: Option<Vec<RegionId>>,
    pub(super) held: HeldWedges,
}

/// Transfers the input's attributes to a mesh without any.
pub(crate) fn transfer_to_bare_mesh(input: &Input<'_>, mesh: &TriMesh) -> Result<TriMesh, SimplifyError> {
    let kept = vec![NONE; mesh.vertex_count()];
    transfer_to_mesh(input, &order::order(&input.surface), mesh, kept, None)
}

/// Transfers the input's attributes to a mesh; `kept` has for each of its vertices the equal vertex of the
/// ordered input, or [`NONE`]; `shading` has a row of values for each corner, if these keep their shading.
/// Also used for results whose seams were relaxed: a face across a seam would show the area between two pieces
/// of the texture.
pub(crate) fn transfer_to_mesh(
    input: &Input<'_>,
    ordered: &Ordered,
    mesh: &TriMesh,
    kept: Vec<VertexId>,
    shading: Option<&[f32]>,
) -> Result<TriMesh, SimplifyError> {
    let prepared = PreparedInput::of(input, ordered);
    let surface = mesh.surface();
    let view = surface.positions();
    let points: Vec<DVec3> = view.iter().map(|p| prepared.frame.unit_from_user(p)).collect();
    let made = RebuiltSurface {
        kept,
        points,
        faces: surface.triangles().to_vec(),
        regions: mesh.regions().map(<[_]>::to_vec),
        ..RebuiltSurface::default()
    };
    Ok(with_transferred_attributes(input, ordered, &prepared, &made, mesh.positions().clone(), shading)?.0)
}

/// Builds the new mesh, with attributes transferred from the input.
pub(super) fn with_transferred_attributes(
    input: &Input<'_>,
    ordered: &Ordered,
    prepared: &PreparedInput,
    made: &RebuiltSurface,
    positions: Positions,
    shading: Option<&[f32]>,
) -> Result<(TriMesh, HeldWedges), SimplifyError> {
    let place = |mesh: &TriMesh, w| ordered.rank[input.joined(mesh.vertex_of(w)).index()];
    let rows = |mesh: &TriMesh| Rows::new(mesh, |w| place(mesh, w));
    let Some((input, (rows, attributes))) = input.mesh.and_then(|mesh| Some((mesh, rows(mesh)?))) else {
        return Ok((TriMesh::new(positions, made.faces.clone())?, HeldWedges::default()));
    };
    let wedges: Vec<_> = prepared.origin.iter().map(|f| input.triangles()[f.index()]).collect();
    let corners: Vec<_> = wedges.iter().map(|t| t.map(|w| rows.wedge_rows[w.index()])).collect();
    let source = AttributeSource {
        prepared,
        rows: &rows,
        attributes: &attributes,
        corners: &corners,
        wedges: &wedges,
        shading,
    };
    let TransferredAttributes { corners, attributes, regions, held } = transfer_attributes(&source, made)?;
    let mut mesh = rows.mesh(Some(&attributes), positions, &made.faces, &corners)?;
    let all_one = || input.regions().and_then(|all| all.first().map(|&r| vec![r; made.faces.len()]));
    mesh.set_regions(regions.or_else(all_one))?;
    held.restore(&mut mesh, input);
    Ok((mesh, held))
}

/// Transfers attributes to the faces of `made`. Cost: O(n log n) for n faces of the prepared input; a new
/// face visits the original faces under it.
fn transfer_attributes(
    source: &AttributeSource<'_>,
    made: &RebuiltSurface,
) -> Result<TransferredAttributes, SimplifyError> {
    let prepared = source.prepared;
    let points: Vec<[f64; 3]> = prepared.points.iter().map(|p| p.to_array()).collect();
    let surface = Surface::new(PositionsView::F64(&points), bytemuck::cast_slice(&prepared.faces))?;
    let tree = Bvh::new(&surface);
    let is_shading = source.rows.shading();
    let mut patches = source.patches(&is_shading);
    let locked_corners = LockedCorners::new(prepared);
    let mut rows = NewRows::new(source, made.points.len());
    let mut corners = vec![[WedgeId(0); 3]; made.faces.len()];
    let mut held = Vec::with_capacity(made.faces.len());
    let mut regions = prepared.regions.as_ref().map(|_| Vec::with_capacity(made.faces.len()));
    let mut row = Row { values: vec![0f32; source.rows.width()], ..Row::default() };
    let settled = |i: usize| made.regions.as_ref().filter(|_| prepared.regions.is_some()).map(|r| r[i]);
    for (i, t) in made.faces.iter().enumerate() {
        let places = t.map(|v| made.points[v.index()]);
        let centre = (places[0] + places[1] + places[2]) / 3.0;
        let normal = double_area_normal(places);
        let under = match &made.stands_for {
            Some(known) => known[i],
            None => face_under(&tree, prepared, centre, normal, settled(i)),
        };
        let region = || prepared.regions.as_ref().map(|r| r[under]);
        if let (Some(regions), Some(own)) = (&mut regions, settled(i).or_else(region)) {
            regions.push(own);
        }
        let radius = places.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        for patch in patches.iter_mut().flatten() {
            patch.grow(prepared, under, centre, radius);
        }
        let mut own_held = [None; 3];
        for (k, &v) in t.iter().enumerate() {
            let (place, kept) = (places[k], made.kept[v.index()]);
            let inward = place.lerp(centre, INWARD_SHARE);
            let own_corner = locked_corners.corner(prepared, kept, inward, &patches);
            let point = |patch: &SourcePatch| {
                own_corner.unwrap_or_else(|| patch.nearest(prepared, place, centre, kept))
            };
            let at = patches.each_ref().map(|patch| patch.as_ref().map(point));
            own_held[k] = source.read_row(&at, kept, &is_shading, &mut row);
            if let Some(own) = source.shading {
                let own = &own[(3 * i + k) * is_shading.len()..][..is_shading.len()];
                for lane in (0..is_shading.len()).filter(|&lane| is_shading[lane]) {
                    row.values[lane] = own[lane];
                }
            }
            corners[i][k] = rows.find_or_add(v, &row);
        }
        held.push(own_held);
    }
    let attributes = rows.into_attributes(source.attributes);
    Ok(TransferredAttributes { corners, attributes, regions, held: HeldWedges::new(held.into_iter()) })
}

/// Attributes of one new corner.
#[derive(Default)]
struct Row {
    values: Vec<f32>,
    joint_weights: JointWeights,
    label: Option<u32>,
}

impl AttributeSource<'_> {
    /// Returns two patches, for the attributes that are not shading and for the shading, if there are any:
    /// each ends where its own attributes have a seam.
    fn patches(&self, is_shading: &[bool]) -> [Option<SourcePatch>; 2] {
        let AttributeSource { prepared, attributes, .. } = *self;
        let same = |a: WedgeId, b: WedgeId, shading: bool| {
            let (x, y) = (attributes.of(a), attributes.of(b));
            let joint_weights =
                |w: WedgeId| (attributes.joint_weights.get(w.index()), attributes.labels.get(w.index()));
            let has_equal_joints = shading || joint_weights(a) == joint_weights(b);
            let is_equal = |k: usize| is_shading[k] != shading || x[k].to_bits() == y[k].to_bits();
            a == b || has_equal_joints && (0..is_shading.len()).all(is_equal)
        };
        let region = |f: usize| prepared.regions.as_ref().map(|r| r[f]);
        let links = |shading: bool| {
            let joined = |[f, g]: [usize; 2], corners: [[usize; 2]; 2]| {
                let row = |f: usize, k: usize| self.corners[f][k];
                region(f) == region(g)
                    && corners.into_iter().all(|[a, b]| same(row(f, a), row(g, b), shading))
            };
            neighbours(&prepared.faces, prepared.points.len(), joined)
        };
        let has_others = is_shading.contains(&false)
            || !attributes.joint_weights.is_empty()
            || !attributes.labels.is_empty();
        let has = [has_others, self.shading.is_none() && is_shading.contains(&true)];
        [false, true]
            .map(|shading| has[usize::from(shading)].then(|| SourcePatch::new(links(shading), prepared)))
    }

    /// True if no vertex has several rows.
    fn has_one_row_each(&self) -> bool {
        let mut row_of = vec![WedgeId(NO_ROW); self.prepared.points.len()];
        let mut corners =
            self.prepared.faces.iter().zip(self.corners).flat_map(|(t, rows)| t.iter().zip(rows));
        corners.all(|(v, row)| {
            let known = &mut row_of[v.index()];
            if known.0 == NO_ROW {
                *known = *row;
            }
            known == row
        })
    }

    /// Reads the attributes at a point of each patch into `row`. Returns the input wedge that has exactly
    /// these attributes, if the vertex is a vertex of the input.
    fn read_row(
        &self,
        at: &[Option<SurfacePoint>; 2],
        kept: VertexId,
        is_shading: &[bool],
        row: &mut Row,
    ) -> Option<WedgeId> {
        let attributes = self.attributes;
        (row.joint_weights, row.label) = (JointWeights::new(), None);
        let mut exact = true;
        let mut wedge = None;
        for (at, shading) in at.iter().zip([false, true]) {
            let Some(at) = at else { continue };
            let at_corner = at.weights.iter().position(|w| *w >= 1.0);
            let rows_there = self.corners[at.face];
            for lane in (0..is_shading.len()).filter(|&lane| is_shading[lane] == shading) {
                let value = |c: usize| attributes.of(rows_there[c])[lane];
                let part = |c: usize| at.weights[c] * f64::from(value(c));
                row.values[lane] = at_corner.map_or_else(|| (part(0) + part(1) + part(2)) as f32, value);
            }
            if !shading && !attributes.joint_weights.is_empty() {
                row.joint_weights =
                    blend(&rows_there.map(|r| &attributes.joint_weights[r.index()]), &at.weights);
            }
            if !shading && !attributes.labels.is_empty() {
                row.label = Some(attributes.labels[rows_there[nearest_corner(&at.weights)].index()]);
            }
            let own = at_corner.filter(|_| kept != NONE).map(|c| self.wedges[at.face][c]);
            exact &= own.is_some() && wedge.is_none_or(|w| Some(w) == own);
            wedge = own;
        }
        wedge.filter(|_| exact)
    }
}

/// Rows of the new mesh; similar rows at one vertex are merged.
struct NewRows {
    width: usize,
    /// Largest absolute value of each lane.
    largest: Vec<f32>,
    has_joint_weights: bool,
    values: Vec<f32>,
    joint_weights: Vec<JointWeights>,
    labels: Vec<u32>,
    /// True if each vertex has a single row, as in the input, so that a mesh closed by its indices stays
    /// closed.
    has_one_each: bool,
    /// Last row of each new vertex, the head of a linked list.
    first: Vec<u32>,
    next: Vec<u32>,
}

impl NewRows {
    fn new(source: &AttributeSource<'_>, vertices: usize) -> Self {
        Self {
            width: source.rows.width(),
            largest: source.rows.largest(),
            has_joint_weights: !source.attributes.joint_weights.is_empty(),
            values: Vec::new(),
            joint_weights: Vec::new(),
            labels: Vec::new(),
            has_one_each: source.has_one_row_each(),
            first: vec![NO_ROW; vertices],
            next: Vec::new(),
        }
    }

    /// Returns a similar row of this vertex, or adds one.
    fn find_or_add(&mut self, v: VertexId, row: &Row) -> WedgeId {
        let mut known = self.first[v.index()];
        while known != NO_ROW {
            if self.has_one_each || self.is_similar(known as usize, row) {
                return WedgeId(known);
            }
            known = self.next[known as usize];
        }
        let added = self.next.len() as u32;
        self.next.push(std::mem::replace(&mut self.first[v.index()], added));
        self.values.extend_from_slice(&row.values);
        if self.has_joint_weights {
            self.joint_weights.push(row.joint_weights.clone());
        }
        self.labels.extend(row.label);
        WedgeId(added)
    }

    fn is_similar(&self, r: usize, row: &Row) -> bool {
        let values = &self.values[r * self.width..];
        let is_similar = |k: usize| (values[k] - row.values[k]).abs() <= ROW_TOLERANCE * self.largest[k];
        (0..self.width).all(is_similar)
            && (self.joint_weights.is_empty()
                || are_joint_weights_similar(&self.joint_weights[r], &row.joint_weights))
            && self.labels.get(r).copied() == row.label
    }

    fn into_attributes(self, source: &Attributes) -> Attributes {
        let (directions, textures) = (source.directions.clone(), source.textures.clone());
        let mut attributes = Attributes::new(
            self.next.len(),
            self.width,
            directions,
            textures,
            &self.values,
            self.joint_weights,
        );
        attributes.labels = self.labels;
        attributes
    }
}

const NO_ROW: u32 = u32::MAX;

/// Returns the original face nearest to the centre of a new face, that is in its region, if that is
/// determined, and does not face away; if all face away, the nearest face of the region; if it has none, the
/// nearest of all.
fn face_under(
    tree: &Bvh,
    prepared: &PreparedInput,
    centre: DVec3,
    normal: DVec3,
    settled: Option<RegionId>,
) -> usize {
    let is_ours = |f: FaceId| settled.is_none() || prepared.regions.as_ref().map(|r| r[f.index()]) == settled;
    let faces_us = |f: FaceId| {
        let own = double_area_normal(prepared.faces[f.index()].map(|v| prepared.points[v.index()]));
        own.dot(normal) > MIN_FACING_COS * own.length() * normal.length()
    };
    let place = centre.to_array();
    let hit = tree.closest_of(place, |f| is_ours(f) && faces_us(f));
    let hit = hit.or_else(|| tree.closest_of(place, is_ours)).or_else(|| tree.closest(place));
    hit.map_or(0, |h| h.face.index())
}

/// Returns for each edge of each face (from corner k to the next) the face beyond it, or [`NO_NEIGHBOUR`].
fn neighbours(
    faces: &[[VertexId; 3]],
    vertices: usize,
    joined: impl Fn([usize; 2], [[usize; 2]; 2]) -> bool,
) -> Vec<[u32; 3]> {
    // Edges are sorted by their lower end: a counting sort, then a sort of the few edges at each vertex.
    let ends = |f: usize, k: usize| [faces[f][k], faces[f][(k + 1) % 3]];
    let mut at = vec![0u32; vertices + 1];
    for f in 0..faces.len() {
        for k in 0..3 {
            let [a, b] = ends(f, k);
            at[a.min(b).index() + 1] += 1;
        }
    }
    for i in 0..vertices {
        at[i + 1] += at[i];
    }
    let mut slots = at.clone();
    let mut edges = vec![(0u32, 0u32); 3 * faces.len()];
    for f in 0..faces.len() {
        for k in 0..3 {
            let [a, b] = ends(f, k);
            let slot = &mut slots[a.min(b).index()];
            edges[*slot as usize] = (a.max(b).0, (3 * f + k) as u32);
            *slot += 1;
        }
    }
    let mut beyond = vec![[NO_NEIGHBOUR; 3]; faces.len()];
    for i in 0..vertices {
        let own = &mut edges[at[i] as usize..at[i + 1] as usize];
        own.sort_unstable();
        for same in own.chunk_by(|a, b| a.0 == b.0) {
            let &[(_, one), (_, other)] = same else { continue };
            let [(f, k), (g, l)] = [one, other].map(|x| (x as usize / 3, x as usize % 3));
            // Corners at the same vertex, on both sides.
            let is_turned = faces[f][k] == faces[g][l];
            let pairs = match is_turned {
                true => [[k, l], [(k + 1) % 3, (l + 1) % 3]],
                false => [[k, (l + 1) % 3], [(k + 1) % 3, l]],
            };
            if joined([f, g], pairs) {
                (beyond[f][k], beyond[g][l]) = (g as u32, f as u32);
            }
        }
    }
    beyond
}

/// Original faces around a new one, up to the next seam.
struct SourcePatch {
    links: Vec<[u32; 3]>,
    /// Bounding box of each original face.
    boxes: Vec<[DVec3; 2]>,
    faces: Vec<u32>,
    seen: Vec<u32>,
    turn: u32,
}

/// The nearest point of a patch.
#[derive(Clone, Copy)]
struct SurfacePoint {
    face: usize,
    weights: [f64; 3],
}

impl SourcePatch {
    fn new(links: Vec<[u32; 3]>, prepared: &PreparedInput) -> Self {
        let bounds = |t: &[VertexId; 3]| {
            let [a, b, c] = t.map(|v| prepared.points[v.index()]);
            [a.min(b).min(c), a.max(b).max(c)]
        };
        let boxes = prepared.faces.iter().map(bounds).collect();
        Self { links, boxes, faces: Vec::new(), seen: vec![0; prepared.faces.len()], turn: 0 }
    }

    /// Lower bound of the squared distance to a face, apart from rounding.
    #[inline(always)]
    fn at_least_sq(&self, face: usize, place: DVec3) -> f64 {
        let [min, max] = self.boxes[face];
        (min - place).max(place - max).max(DVec3::ZERO).length_squared()
    }

    /// Collects the faces around `from` within the radius from the centre, or more if the surface is farther
    /// away.
    fn grow(&mut self, prepared: &PreparedInput, from: usize, centre: DVec3, radius: f64) {
        let distance_sq =
            |f: usize| nearest(centre, prepared.faces[f].map(|v| prepared.points[v.index()])).distance_sq;
        let reach = radius + distance_sq(from).sqrt();
        let limit_sq = (reach + DISTANCE_SLACK) * (reach + DISTANCE_SLACK);
        self.turn += 1;
        self.faces.clear();
        self.faces.push(from as u32);
        self.seen[from] = self.turn;
        let mut looked = 0;
        while looked < self.faces.len() {
            for g in self.links[self.faces[looked] as usize] {
                if g != NO_NEIGHBOUR && self.seen[g as usize] != self.turn {
                    self.seen[g as usize] = self.turn;
                    if self.at_least_sq(g as usize, centre) <= limit_sq
                        && distance_sq(g as usize) <= reach * reach
                    {
                        self.faces.push(g);
                    }
                }
            }
            looked += 1;
        }
    }

    /// Returns the nearest point to a corner; if several faces share it, the point is on the face towards the
    /// centre. A kept vertex is matched to itself, if the patch contains it.
    fn nearest(&self, prepared: &PreparedInput, place: DVec3, centre: DVec3, kept: VertexId) -> SurfacePoint {
        let corners = |f: u32| prepared.faces[f as usize].map(|v| prepared.points[v.index()]);
        let inwards = place.lerp(centre, INWARD_SHARE);
        let mut best = (f64::INFINITY, f64::INFINITY, u32::MAX, None);
        let mut limit_sq = f64::INFINITY;
        for &f in &self.faces {
            let own =
                if kept == NONE { None } else { prepared.faces[f as usize].iter().position(|v| *v == kept) };
            // (The boxes rule out most faces.)
            if own.is_none() && self.at_least_sq(f as usize, place) > limit_sq {
                continue;
            }
            let distance_sq = if own.is_some() { 0.0 } else { nearest(place, corners(f)).distance_sq };
            // Equal apart from rounding, in a frame of size 1.
            if distance_sq.sqrt() > best.0.sqrt() + 1e-12 {
                continue;
            }
            let aside = nearest(inwards, corners(f)).distance_sq;
            let is_nearer = distance_sq.sqrt() + 1e-12 < best.0.sqrt();
            if is_nearer || (aside, f) < (best.1, best.2) {
                best = (distance_sq.min(best.0), aside, f, own);
                limit_sq = (best.0.sqrt() + DISTANCE_SLACK).powi(2);
            }
        }
        let face = best.2 as usize;
        let weights = match best.3 {
            Some(c) => [0, 1, 2].map(|k| f64::from(u8::from(k == c))),
            None => {
                let own = corners(best.2);
                weights_at(nearest(place, own).point, own)
            }
        };
        SurfacePoint { face, weights }
    }
}

/// The corners of the prepared input at each locked vertex, as face and corner: the result may only have
/// attributes of these corners, even if a new face is separated from all of them by a seam.
struct LockedCorners(HashMap<VertexId, Vec<(u32, usize)>>);

impl LockedCorners {
    fn new(prepared: &PreparedInput) -> Self {
        let mut at: HashMap<VertexId, Vec<(u32, usize)>> = HashMap::new();
        if let Some(locked) = &prepared.locked {
            for (f, t) in prepared.faces.iter().enumerate() {
                for (c, v) in t.iter().enumerate().filter(|(_, v)| locked[v.index()]) {
                    at.entry(*v).or_default().push((f as u32, c));
                }
            }
        }
        Self(at)
    }

    /// Returns the corner that a new face takes at a locked vertex: the nearest of those in the patches or,
    /// if there are none, of all.
    fn corner(
        &self,
        prepared: &PreparedInput,
        kept: VertexId,
        inwards: DVec3,
        patches: &[Option<SourcePatch>; 2],
    ) -> Option<SurfacePoint> {
        let rank = |f: u32| {
            let unseen = patches.iter().flatten().filter(|p| p.seen[f as usize] != p.turn).count();
            let away =
                nearest(inwards, prepared.faces[f as usize].map(|v| prepared.points[v.index()])).distance_sq;
            (unseen, away)
        };
        let of = self.0.get(&kept)?.iter().take(MAX_CORNERS).map(|&(f, c)| (rank(f), f, c));
        let (_, f, c) =
            of.min_by(|(a, f, _), (b, g, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(f.cmp(g)))?;
        Some(SurfacePoint { face: f as usize, weights: [0, 1, 2].map(|k| f64::from(u8::from(k == c))) })
    }
}

/// Returns the corner with the largest weight, the first among equals.
fn nearest_corner(weights: &[f64; 3]) -> usize {
    (1..3).fold(0, |best, k| if weights[k] > weights[best] { k } else { best })
}

/// Blends joint weights, strongest first.
fn blend(of: &[&JointWeights; 3], weights: &[f64; 3]) -> JointWeights {
    let mut all: JointWeights = Vec::new();
    for (joint_weights, weight) in of.iter().zip(weights).filter(|x| *x.1 > 0.0) {
        for &(joint, joint_weight) in *joint_weights {
            let share = joint_weight * *weight as f32;
            match all.iter_mut().find(|x| x.0 == joint) {
                Some(known) => known.1 += share,
                None => all.push((joint, share)),
            }
        }
    }
    all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    all
}

/// True if two sets of joint weights are equal apart from rounding.
fn are_joint_weights_similar(a: &JointWeights, b: &JointWeights) -> bool {
    let weight_of = |of: &JointWeights, joint: u32| of.iter().find(|x| x.0 == joint).map_or(0.0, |x| x.1);
    let one_way = |a: &JointWeights, b: &JointWeights| {
        a.iter().all(|x| (x.1 - weight_of(b, x.0)).abs() <= ROW_TOLERANCE * x.1.abs().max(1.0))
    };
    one_way(a, b) && one_way(b, a)
}
