//! Colours of faces: meshes of which each face has a colour of its own. All edges would be seams, and all corners wedges.
//! A run that leaves few of the faces blends these colours at the vertices.

use glam::DVec3;
use lodsmith_core::geometry::triangle::double_area_normal;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::{MeshError, TriMesh, WedgeId};

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
    let corners = corners_by_vertex(mesh);
    let wedge = |corner: u64| mesh.triangles().as_flattened()[corner as u32 as usize];
    let (mut motley, mut vertices) = (Vec::new(), 0);
    for at_vertex in corners.chunk_by(|a, b| a >> 32 == b >> 32) {
        vertices += 1;
        let count = distinct(at_vertex.iter().map(|&corner| colors[wedge(corner).index()]));
        if count >= 3 && count as f64 >= MOTLEY_SHARE * at_vertex.len() as f64 {
            motley.push(at_vertex);
        }
    }
    if (motley.len() as f64) < MOTLEY_VERTEX_SHARE * f64::from(vertices) {
        return Ok(None);
    }
    let areas: Vec<f64> = mesh.triangles().iter().map(|t| area(mesh, t)).collect();
    let mut blended = colors.to_vec();
    for at_vertex in motley {
        let wedges = || at_vertex.iter().map(|&corner| wedge(corner));
        if wedges().any(|w| input.data.locked.is_some_and(|locked| locked[mesh.vertex_of(w).index()])) {
            continue;
        }
        let mean = mean(at_vertex.iter().map(|&c| (colors[wedge(c).index()], areas[c as u32 as usize / 3])));
        wedges().for_each(|w| blended[w.index()] = mean);
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
    faces.iter().filter(has_one).count() as f64 >= ONE_COLOR_SHARE * faces.len() as f64
        && distinct(faces.iter().map(|t| colors[t[0].index()])) > MAX_PALETTE
}

/// Returns the number of distinct colours, by keys that are very likely to differ.
fn distinct(colors: impl Iterator<Item = [f32; 4]>) -> usize {
    let mix =
        |key: u64, x: f32| (key ^ u64::from(x.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    let mut keys: Vec<u64> = colors.map(|c| c.into_iter().fold(0, mix)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys.len()
}

/// Returns the corners of all faces, those of a vertex or of several at one place together: the vertex in the upper half,
/// the number of the corner in the lower.
fn corners_by_vertex(mesh: &TriMesh) -> Vec<u64> {
    let same = weld(mesh.positions().view());
    let vertex = |w: &WedgeId| u64::from(same.of(mesh.vertex_of(*w)).0);
    let corners = mesh.triangles().as_flattened().iter().zip(0u64..);
    let mut corners: Vec<u64> = corners.map(|(w, corner)| vertex(w) << 32 | corner).collect();
    corners.sort_unstable();
    corners
}

/// Returns twice the area of a face; 0 if it is not finite.
fn area(mesh: &TriMesh, face: &[WedgeId; 3]) -> f64 {
    let view = mesh.positions().view();
    let area = double_area_normal(face.map(|w| DVec3::from(view.get(mesh.vertex_of(w))))).length();
    if area.is_finite() { area } else { 0.0 }
}

/// Returns the mean of colours by area.
fn mean(corners: impl Iterator<Item = ([f32; 4], f64)> + Clone) -> [f32; 4] {
    let total: f64 = corners.clone().map(|(_, area)| area).sum();
    let count = corners.clone().count() as f64;
    let first = corners.clone().next().unwrap_or_default().0;
    // (Relative to the first, so that what is equal everywhere stays exact.)
    std::array::from_fn(|k| {
        let off = |(color, area): ([f32; 4], f64)| {
            let share = if total > 0.0 { area / total } else { 1.0 / count };
            share * (f64::from(color[k]) - f64::from(first[k]))
        };
        (f64::from(first[k]) + corners.clone().map(off).sum::<f64>()) as f32
    })
}
