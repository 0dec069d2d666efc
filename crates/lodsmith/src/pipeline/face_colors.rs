//! Colours of faces: meshes of which each face has a colour of its own. All edges would be seams, and all corners wedges.
//! A run that leaves few of the faces blends these colours at the vertices.

use std::collections::HashSet;

use glam::DVec3;
use lodsmith_core::geometry::triangle::double_area_normal;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::{MeshError, TriMesh, VertexId, WedgeId};

use crate::input::Input;
use crate::options::{Placement, SimplifyOptions};
use crate::run;

/// Largest share of the faces or vertices that a run leaves with blended colours. (Measured on 50,000 faces with smooth,
/// noisy and random colours and those of quads: at 20 % mean, RMS and 95 % of the differences are less than with a seam at
/// each edge, at 33 % the mean is not with quads, because faces that stay keep their colour there.)
const MAX_LEFT_SHARE: f64 = 0.2;
/// Faces have colours if this share of them has one colour at all corners, ... (Guessed: as many as have flat normals.)
const ONE_COLOR_SHARE: f64 = 0.99;
/// ... and if there are more of them than in a palette. (As for colours that become regions of PLY files.)
const MAX_PALETTE: usize = 256;
/// A vertex is motley if it has at least this share of the colours of as many faces, and three. (Guessed: where patches
/// of one colour meet there are fewer.)
const MOTLEY_SHARE: f64 = 0.6;
/// Faces have colours of their own if this share of the vertices is motley. (Guessed: with fewer there are patches of one
/// colour, whose borders are worth keeping.)
const MOTLEY_VERTEX_SHARE: f64 = 0.5;

/// A corner of a face at a vertex.
#[derive(Clone, Copy)]
struct ColoredCorner {
    vertex: VertexId,
    color: [f32; 4],
    wedge: WedgeId,
    area: f64,
}

impl ColoredCorner {
    fn key(&self) -> (VertexId, [u32; 4]) {
        (self.vertex, self.color.map(f32::to_bits))
    }
}

/// Blends the colours of an input whose faces have colours of their own: each vertex that is motley and not locked gets
/// their mean by area. Returns `None` for other inputs, for runs that leave more of the faces, and for those whose results
/// have only attributes of the input.
///
/// Cost: O(n log n), of most other inputs O(n).
pub(super) fn blended(input: &Input<'_>, options: &SimplifyOptions) -> Result<Option<TriMesh>, MeshError> {
    let Some((mesh, colors)) = input.mesh.and_then(|mesh| Some((mesh, mesh.colors()?))) else {
        return Ok(None);
    };
    if !(leaves_few(mesh, options) && has_face_colors(mesh, colors)) {
        return Ok(None);
    }
    let corners = corners_by_vertex(mesh, colors);
    let (mut motley, mut vertices) = (Vec::new(), 0);
    for at_vertex in corners.chunk_by(|a, b| a.vertex == b.vertex) {
        vertices += 1;
        let count = at_vertex.chunk_by(|a, b| a.key() == b.key()).count();
        if count >= 3 && count as f64 >= MOTLEY_SHARE * at_vertex.len() as f64 {
            motley.push(at_vertex);
        }
    }
    if (motley.len() as f64) < MOTLEY_VERTEX_SHARE * f64::from(vertices) {
        return Ok(None);
    }
    let mut blended = colors.to_vec();
    let is_locked =
        |c: &ColoredCorner| input.data.locked.is_some_and(|locked| locked[mesh.vertex_of(c.wedge).index()]);
    for at_vertex in motley.into_iter().filter(|at_vertex| !at_vertex.iter().any(is_locked)) {
        let mean = mean(at_vertex);
        at_vertex.iter().for_each(|c| blended[c.wedge.index()] = mean);
    }
    let mut mesh = mesh.clone();
    mesh.set_colors(Some(blended))?;
    Ok(Some(mesh))
}

/// True if a run by sweeps, which may blend attributes, ends at few of the faces or vertices.
fn leaves_few(mesh: &TriMesh, options: &SimplifyOptions) -> bool {
    let blends = run::collapses(options.method.kind()).is_some()
        && options.placement != Placement::Endpoint
        && options.quick.is_none();
    let goal = run::goal(options, mesh.face_count());
    let is_few =
        |goal: Option<usize>, all: usize| goal.is_none_or(|n| n as f64 <= MAX_LEFT_SHARE * all as f64);
    let ends_by_count = options.stop.error.is_none() && !goal.is_none();
    blends
        && ends_by_count
        && is_few(goal.faces, mesh.face_count())
        && is_few(goal.vertices, mesh.vertex_count())
}

/// True if nearly each face has one colour, and there are many colours.
fn has_face_colors(mesh: &TriMesh, colors: &[[f32; 4]]) -> bool {
    let has_one = |t: &&[WedgeId; 3]| {
        let [a, b, c] = t.map(|w| colors[w.index()]);
        a == b && a == c
    };
    let faces = mesh.triangles();
    let mut seen = HashSet::new();
    let mut is_beyond_palette = |c: &[f32; 4]| seen.insert(c.map(f32::to_bits)) && seen.len() > MAX_PALETTE;
    faces.iter().filter(has_one).count() as f64 >= ONE_COLOR_SHARE * faces.len() as f64
        && colors.iter().any(&mut is_beyond_palette)
}

/// Returns the corners of all faces, those of a vertex or of several at one place together, by colour.
fn corners_by_vertex(mesh: &TriMesh, colors: &[[f32; 4]]) -> Vec<ColoredCorner> {
    let view = mesh.positions().view();
    let same = weld(view);
    let mut corners = Vec::with_capacity(3 * mesh.face_count());
    for t in mesh.triangles() {
        let area = double_area_normal(t.map(|w| DVec3::from(view.get(mesh.vertex_of(w))))).length();
        let area = if area.is_finite() { area } else { 0.0 };
        corners.extend(t.map(|wedge| {
            let vertex = same.of(mesh.vertex_of(wedge));
            ColoredCorner { vertex, color: colors[wedge.index()], wedge, area }
        }));
    }
    corners.sort_by_key(ColoredCorner::key);
    corners
}

/// Returns the mean colour of corners by area.
fn mean(corners: &[ColoredCorner]) -> [f32; 4] {
    let total: f64 = corners.iter().map(|c| c.area).sum();
    let share = |c: &ColoredCorner| if total > 0.0 { c.area / total } else { 1.0 / corners.len() as f64 };
    let first = corners[0].color;
    // (Relative to the first, so that what is equal everywhere stays exact.)
    std::array::from_fn(|k| {
        let off = |c: &ColoredCorner| share(c) * (f64::from(c.color[k]) - f64::from(first[k]));
        (f64::from(first[k]) + corners.iter().map(off).sum::<f64>()) as f32
    })
}
