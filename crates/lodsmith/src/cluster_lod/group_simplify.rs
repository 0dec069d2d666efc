//! Simplification of one group: halves its faces, re-clusters them, and verifies the border.

use std::collections::HashMap;

use lodsmith_core::mesh::part::{Part, SharedIds, extract_faces};
use lodsmith_core::{FaceId, RegionId, TriMesh, VertexId};

use super::deviation::OriginalSurface;
use super::group::{Border, VertexPair, directed};
use super::hierarchy::{Build, Front, SimplifiedGroup, arranged};
use super::options::ClusterLodOptions;
use super::split::{Budget, split};
use crate::control::NoControl;
use crate::input::Input;
use crate::options::{SimplifyOptions, Stop};
use crate::{Simplified, SimplifyError, simplify_with};

/// Target fraction of the faces of a group.
const TARGET_FRACTION: f64 = 0.5;
/// Maximum target fraction, if that fills clusters better.
const MAX_TARGET_FRACTION: f64 = 0.6;

/// Result of simplifying a group.
pub(super) enum GroupOutcome {
    /// It was simplified.
    Lighter(Box<SimplifiedGroup>),
    /// Too few faces could be removed.
    Stuck,
    /// Its border was not preserved.
    Broken,
}

/// Simplifies a group and keeps its border.
pub(super) fn simplify_group(
    build: &Build,
    members: &[&Front],
    border: &Border<'_>,
    options: &ClusterLodOptions,
    region_classes: Option<&[RegionId]>,
    budget: &Budget,
    original: &OriginalSurface,
) -> Result<GroupOutcome, SimplifyError> {
    if members.len() < 2 {
        return Ok(GroupOutcome::Stuck);
    }
    let faces: Vec<FaceId> = members.iter().flat_map(|m| &m.faces).copied().collect();
    let group = extract_faces(&build.pool, &faces);
    let locked: Vec<bool> = group.vertices.iter().map(|&v| border.is_shared(v)).collect();
    let full = budget.faces(group.wedges.len(), faces.len());
    let wanted = full * ((faces.len() as f64 * TARGET_FRACTION / full as f64).round() as usize).max(1);
    let wanted = wanted.min((faces.len() as f64 * MAX_TARGET_FRACTION) as usize).max(1);
    let mut inner =
        SimplifyOptions { weights: options.weights, border: options.border, ..SimplifyOptions::default() };
    let mut input = Input::new(&group.mesh).locked(&locked);
    input.data.region_classes = region_classes;
    input.keeps_blended_normals = true;
    let max_faces = (options.keep_at_most * faces.len() as f64) as usize;
    let mut to = |wanted| {
        inner.stop = Stop::faces(wanted);
        match simplify_with(&input, &inner, &mut NoControl) {
            // Only zero-area faces: nothing can be simplified.
            Err(SimplifyError::NoFaces { .. }) => Ok(None),
            done => done.map(Some),
        }
    };
    let mut done = to(wanted)?;
    let relaxes_seams = |done: &Option<Simplified>| done.as_ref().is_some_and(|d| d.report.seams_relaxed);
    if relaxes_seams(&done) && border.is_any() {
        // Seams need not be relaxed here: another grouping may leave them more room.
        done = to(max_faces)?.filter(|d| !d.report.seams_relaxed);
    }
    let Some(lighter) = done.map(|d| d.mesh).filter(|m| (1..=max_faces).contains(&m.face_count())) else {
        return Ok(GroupOutcome::Stuck);
    };
    let pieces = split(&lighter, budget);
    if pieces.len() >= members.len() {
        return Ok(GroupOutcome::Stuck);
    }
    let mesh = arranged(&lighter, &pieces);
    let known = group.shared_with(&mesh);
    if !keeps_border(&group, &mesh, &known, border) {
        return Ok(GroupOutcome::Broken);
    }
    let samples: Vec<[f64; 3]> = members.iter().flat_map(|m| &m.samples).copied().collect();
    let deviation = original.deviation(&mesh, &pieces, &samples);
    Ok(GroupOutcome::Lighter(Box::new(SimplifiedGroup {
        mesh,
        known,
        pieces,
        error: deviation.error,
        samples: deviation.samples,
    })))
}

/// Returns the edges with more faces in one direction than in the other, and the difference.
fn open_edges(faces: impl Iterator<Item = [VertexId; 3]>) -> HashMap<VertexPair, i32> {
    let mut net: HashMap<VertexPair, i32> = HashMap::new();
    for (edge, sign) in faces.flat_map(directed) {
        *net.entry(edge).or_insert(0) += sign;
    }
    net.retain(|_, sign| *sign != 0);
    net
}

/// True if the edges shared with other groups keep their faces per direction, and if a group that was closed
/// apart from them still is.
fn keeps_border(group: &Part, made: &TriMesh, known: &SharedIds, border: &Border<'_>) -> bool {
    let before = open_edges(
        group.mesh.triangles().iter().map(|t| t.map(|w| group.vertices[group.mesh.vertex_of(w).index()])),
    );
    // New vertices get numbers not used in the pool.
    let name = |v: VertexId| known.vertices[v.index()].unwrap_or(VertexId(u32::MAX - v.0));
    let after = open_edges(made.triangles().iter().map(|t| t.map(|w| name(made.vertex_of(w)))));
    let stays = border.edges().all(|e| before.get(&e) == after.get(&e));
    let was_closed = before.keys().all(|e| border.has(e));
    stays && (!was_closed || after.keys().all(|e| border.has(e)))
}
