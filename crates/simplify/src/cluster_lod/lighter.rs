//! One group: half its faces, clusters again, and whether its border stayed.

use std::collections::HashMap;
use std::sync::Arc;

use lodsmith_core::mesh::part::{Known, Part, part};
use lodsmith_core::{FaceId, TriMesh, VertexId};

use super::deviation::Original;
use super::group::{Border, Edge, directed};
use super::split::{Budget, split};
use super::{Build, ClusterLodOptions, Front, arranged};
use crate::control::NoControl;
use crate::options::{SimplifyOptions, Stop};
use crate::{Simplified, SimplifyError, simplify};

/// The part of its faces that a group is to keep.
const WANTED: f64 = 0.5;
/// ... and the most that is asked for, where that fills clusters better.
const MOST_WANTED: f64 = 0.6;

/// What became of a group.
pub(super) enum Outcome {
    /// It is lighter.
    Lighter(Box<Made>),
    /// Too little could go.
    Stuck,
    /// Its border is not what it was.
    Broken,
}

/// A lighter group.
pub(super) struct Made {
    /// Its faces, cluster after cluster.
    pub(super) mesh: TriMesh,
    /// What of it is in the pool already.
    pub(super) known: Known,
    pub(super) pieces: Vec<Vec<u32>>,
    pub(super) error: f64,
    /// Places of the original, for each cluster.
    pub(super) samples: Vec<Vec<[f64; 3]>>,
}

/// Makes a group lighter, up to its border.
pub(super) fn lighter(
    build: &Build,
    members: &[&Front],
    border: &Border<'_>,
    options: &ClusterLodOptions,
    budget: &Budget,
    original: &Original,
) -> Result<Outcome, SimplifyError> {
    if members.len() < 2 {
        return Ok(Outcome::Stuck);
    }
    let faces: Vec<FaceId> = members.iter().flat_map(|m| &m.faces).copied().collect();
    let group = part(&build.pool, &faces);
    let locked: Vec<bool> = group.vertices.iter().map(|&v| border.is_shared(v)).collect();
    let full = budget.faces(group.wedges.len(), faces.len());
    let wanted = full * ((faces.len() as f64 * WANTED / full as f64).round() as usize).max(1);
    let wanted = wanted.min((faces.len() as f64 * MOST_WANTED) as usize).max(1);
    let mut inner = SimplifyOptions {
        locked: Some(Arc::from(locked)),
        weights: options.weights,
        border: options.border,
        keeps_blended_normals: true,
        region_classes: options.region_classes.clone(),
        ..SimplifyOptions::default()
    };
    let most = (options.keep_at_most * faces.len() as f64) as usize;
    let mut to = |wanted| {
        inner.stop = Stop::faces(wanted);
        match simplify(&group.mesh, &inner, &mut NoControl) {
            // Nothing but needles: there is nothing to go by.
            Err(SimplifyError::NoFaces { .. }) => Ok(None),
            done => done.map(Some),
        }
    };
    let mut done = to(wanted)?;
    let tears = |done: &Option<Simplified>| done.as_ref().is_some_and(|d| d.report.seams_relaxed);
    if tears(&done) && border.is_any() {
        // Seams need not give way here: in another group they may have more room.
        done = to(most)?.filter(|d| !d.report.seams_relaxed);
    }
    let Some(lighter) = done.map(|d| d.mesh).filter(|m| (1..=most).contains(&m.face_count())) else {
        return Ok(Outcome::Stuck);
    };
    let pieces = split(&lighter, budget);
    if pieces.len() >= members.len() {
        return Ok(Outcome::Stuck);
    }
    let mesh = arranged(&lighter, &pieces);
    let known = group.shared_with(&mesh);
    if !keeps_border(&group, &mesh, &known, border) {
        return Ok(Outcome::Broken);
    }
    let samples: Vec<[f64; 3]> = members.iter().flat_map(|m| &m.samples).copied().collect();
    let deviation = original.deviation(&mesh, &pieces, &samples);
    Ok(Outcome::Lighter(Box::new(Made {
        mesh,
        known,
        pieces,
        error: deviation.error,
        samples: deviation.samples,
    })))
}

/// How much more often faces go along each edge in one direction than in the other, where they do.
fn open_edges(faces: impl Iterator<Item = [VertexId; 3]>) -> HashMap<Edge, i32> {
    let mut net: HashMap<Edge, i32> = HashMap::new();
    for (edge, way) in faces.flat_map(directed) {
        *net.entry(edge).or_insert(0) += way;
    }
    net.retain(|_, way| *way != 0);
    net
}

/// Whether the edges that other groups share go the same way as before, and whether what was closed but for them still is.
fn keeps_border(group: &Part, made: &TriMesh, known: &Known, border: &Border<'_>) -> bool {
    let before = open_edges(
        group.mesh.triangles().iter().map(|t| t.map(|w| group.vertices[group.mesh.vertex_of(w).index()])),
    );
    // New vertices get numbers that none of the pool has.
    let name = |v: VertexId| known.vertices[v.index()].unwrap_or(VertexId(u32::MAX - v.0));
    let after = open_edges(made.triangles().iter().map(|t| t.map(|w| name(made.vertex_of(w)))));
    let stays = border.edges().all(|e| before.get(&e) == after.get(&e));
    let was_closed = before.keys().all(|e| border.has(e));
    stays && (!was_closed || after.keys().all(|e| border.has(e)))
}
