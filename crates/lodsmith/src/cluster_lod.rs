//! Cluster levels of detail: a mesh that an engine draws fine near the camera and coarse far away, without
//! cracks.
//!
//! ```text
//! weld; drop faces that cannot be drawn
//! split the faces into clusters                            (split)
//! loop until one cluster is left, or hardly any face is removed
//!     partition the clusters into groups that share much border (group)
//!     lock the vertices that several groups use
//!     each group separately: halve the faces, re-cluster   (group_simplify)
//!         measure the distance from the original           (deviation)
//!     a group that kept too many faces stays, and is regrouped in the next round
//! ```
//!
//! Like Nanite [Karis 2021]. New here: errors are measured against the original mesh instead of accumulated
//! from estimates, and the border of every group is compared edge by edge with the border of its result.

mod deviation;
mod group;
mod group_simplify;
mod hierarchy;
mod options;
mod split;

use std::collections::HashSet;

use lodsmith_core::clusters::{ClusterLod, MAX_CLUSTER_SIZE};
use lodsmith_core::mesh::compact::compact;
use lodsmith_core::mesh::part::extract_faces;
use lodsmith_core::mesh::weld::weld_mesh;
use lodsmith_core::{FaceId, Semantic, TriMesh, VertexId};

use crate::SimplifyError;
use crate::control::{Control, Stage, Verdict};
use crate::input::{Input, MeshData};
use crate::report::Cleanup;
use deviation::OriginalSurface;
use group_simplify::GroupOutcome;
use hierarchy::{Build, Front, arranged};
pub use options::ClusterLodOptions;
use split::Budget;

/// Groups processed between two progress calls. (Fixed, so that an early end does not depend on the threads.)
const BATCH_GROUPS: usize = 32;
/// A round that removes less than this share of the faces is the last. (Guessed.)
const MIN_GAIN: f64 = 0.02;

impl ClusterLodOptions {
    fn check(&self) -> Result<(), SimplifyError> {
        let range = |option, wanted, least, x: usize| match x {
            x if (least..=MAX_CLUSTER_SIZE).contains(&x) => Ok(()),
            x => Err(SimplifyError::BadOption { option, wanted, got: x as f64 }),
        };
        range("triangles", "8 to 256", 8, self.triangles)?;
        range("vertices", "8 to 256", 8, self.vertices)?;
        if !(4..=64).contains(&self.group) {
            let got = self.group as f64;
            return Err(SimplifyError::BadOption { option: "group", wanted: "4 to 64", got });
        }
        let keep = self.keep_at_most;
        if !(keep > 0.5 && keep < 1.0) {
            let wanted = "above 0.5 and below 1";
            return Err(SimplifyError::BadOption { option: "keep_at_most", wanted, got: keep });
        }
        let w = &self.weights;
        let all = [w.normal, w.uv, w.color, w.morph, w.other, w.border];
        match all.into_iter().find(|x| !(x.is_finite() && *x >= 0.0)) {
            Some(got) => Err(SimplifyError::BadOption { option: "weight", wanted: "0 or more", got }),
            None => Ok(()),
        }
    }
}

/// Report of a cluster level-of-detail build.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ClusterLodReport {
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Repairs made first.
    pub cleanup: Cleanup,
    /// Attributes that the levels do not contain: joints without weights of the same set, or weights without
    /// joints.
    pub dropped: Vec<&'static str>,
    /// Number of grouping rounds.
    pub rounds: usize,
    /// Groups left unchanged because too few faces could be removed, over all rounds.
    pub stuck_groups: usize,
    /// Groups left unchanged because their border was not preserved, over all rounds.
    pub broken_groups: usize,
    /// True if the caller ended the build before the coarsest level.
    pub ended_early: bool,
}

/// Cluster levels of detail and the report of their build.
#[derive(Clone, Debug, PartialEq)]
pub struct BuiltClusterLod {
    /// The levels.
    pub lod: ClusterLod,
    /// The report.
    pub report: ClusterLodReport,
}

/// Builds cluster levels of detail from a mesh, with its attributes and regions.
///
/// Coincident vertices are merged first, and faces with a non-finite corner or with two corners at one
/// position are dropped, as are duplicate faces; the report counts them. The error of a group is the largest
/// distance, in the units of the mesh, of its result from the original and of samples of the original from
/// its result, with a margin for points in between, or the error of a group below it if that is larger. It
/// does not include attributes. Every cut of the levels is closed if the input is.
///
/// With rayon the groups are distributed over the caller's pool; the result is the same with any number of
/// threads. Cost: O(n log n).
///
/// Of the [`MeshData`] of an input, the classes of its regions count; images do not.
///
/// # Errors
/// [`SimplifyError::BadOption`], [`SimplifyError::NoFaces`], [`SimplifyError::Cancelled`];
/// [`SimplifyError::NotTogether`] for locked vertices, importance and error maps, which cluster levels do not have.
///
/// Source: [Karis 2021].
pub fn cluster_lod<'a>(
    input: impl Into<Input<'a>>,
    options: &ClusterLodOptions,
    control: &mut dyn Control,
) -> Result<BuiltClusterLod, SimplifyError> {
    options.check()?;
    let input = input.into();
    let MeshData { locked, importance, error_map, region_classes, .. } = input.data;
    for (first, is_given) in [
        ("locked", locked.is_some()),
        ("importance", importance.is_some()),
        ("error-map", error_map.is_some()),
    ] {
        if is_given {
            return Err(SimplifyError::NotTogether { first, second: "cluster_lod" });
        }
    }
    let mesh = &*input.to_mesh()?;
    control.stage(Stage::Prepare);
    report_progress(control, 0.0)?;
    let mut report = ClusterLodReport {
        input_faces: mesh.face_count(),
        input_vertices: mesh.vertex_count(),
        ..Default::default()
    };
    let sound = cleaned(mesh, &mut report)?;
    let budget = Budget { triangles: options.triangles, vertices: options.vertices };
    let pieces = split::split(&sound, &budget);
    let pool = arranged(&sound, &pieces);
    drop(sound);
    let original = OriginalSurface::new(&pool);
    let mut build = Build { pool, clusters: Vec::new(), groups: Vec::new() };
    let mut front = build.add_clusters(0, &pieces, None);
    for own in &mut front {
        own.samples = original.samples(&build.pool, &own.faces);
    }

    control.stage(Stage::Collapse);
    let mut left = build.pool.face_count();
    let all = left;
    while front.len() > 1 {
        report.rounds += 1;
        let groups = group::group(&build, &front, options.group);
        let borders = group::borders(&build, &front, &groups);
        let mut next = Vec::with_capacity(front.len());
        let before = left;
        let mut ended = false;
        for (batch, first) in groups.chunks(BATCH_GROUPS).zip((0..).step_by(BATCH_GROUPS)) {
            if ended {
                next.extend(batch.iter().flatten().map(|&i| std::mem::take(&mut front[i])));
                continue;
            }
            let outcomes = crate::chunks::each(batch.len(), |k| {
                let members: Vec<&Front> = batch[k].iter().map(|&i| &front[i]).collect();
                group_simplify::simplify_group(
                    &build,
                    &members,
                    &borders.of(first + k),
                    options,
                    region_classes,
                    &budget,
                    &original,
                )
            });
            for (members, outcome) in batch.iter().zip(outcomes) {
                match outcome? {
                    GroupOutcome::Lighter(made) => {
                        left -= members.iter().map(|&i| front[i].faces.len()).sum::<usize>();
                        left += made.mesh.face_count();
                        next.extend(build.add_group(members, &front, *made)?);
                    }
                    stays => {
                        report.stuck_groups += usize::from(matches!(stays, GroupOutcome::Stuck));
                        report.broken_groups += usize::from(matches!(stays, GroupOutcome::Broken));
                        next.extend(members.iter().map(|&i| std::mem::take(&mut front[i])));
                    }
                }
            }
            ended = report_progress(control, 1.0 - left as f64 / all as f64)? == Verdict::Finish;
        }
        front = next;
        report.ended_early = ended && front.len() > 1;
        if ended || (before - left) as f64 <= MIN_GAIN * before as f64 {
            break;
        }
    }
    let lod = ClusterLod::new(build.pool, build.clusters, build.groups).expect("levels are made in order");
    Ok(BuiltClusterLod { lod, report })
}

fn report_progress(control: &mut dyn Control, done: f64) -> Result<Verdict, SimplifyError> {
    match control.progress(done) {
        Verdict::Cancel => Err(SimplifyError::Cancelled),
        verdict => Ok(verdict),
    }
}

/// Returns the mesh welded, without faces that cannot be drawn and without unsupported attributes.
fn cleaned(mesh: &TriMesh, report: &mut ClusterLodReport) -> Result<TriMesh, SimplifyError> {
    let welded = weld_mesh(mesh, None);
    let cleanup = &mut report.cleanup;
    cleanup.welded_vertices = welded.merged_vertex_count;
    let mesh = welded.mesh;
    let positions = mesh.positions().view();
    let mut seen: HashSet<[VertexId; 3]> = HashSet::with_capacity(mesh.face_count());
    let mut faces = Vec::with_capacity(mesh.face_count());
    for (i, t) in mesh.triangles().iter().enumerate() {
        let mut t = t.map(|w| mesh.vertex_of(w));
        let least = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
        t.rotate_left(least);
        if !t.iter().all(|&v| positions.get(v).iter().all(|x| x.is_finite())) {
            cleanup.non_finite_faces += 1;
        } else if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            cleanup.degenerate_faces += 1;
        } else if !seen.insert(t) {
            cleanup.duplicate_faces += 1;
        } else {
            faces.push(FaceId::new(i));
        }
    }
    if faces.is_empty() {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    let kept = if faces.len() == mesh.face_count() {
        compact(&mesh).mesh
    } else {
        extract_faces(&mesh, &faces).mesh
    };
    report.cleanup.unused_vertices = mesh.vertex_count() - kept.vertex_count();
    Ok(without_half_skins(kept, report))
}

/// Drops joints without weights of the same set, and weights without joints.
fn without_half_skins(mesh: TriMesh, report: &mut ClusterLodReport) -> TriMesh {
    let has =
        |wanted: Semantic| mesh.further_attributes().iter().any(|a| a.semantic == wanted && a.width == 4);
    let is_half = |semantic: &Semantic| match *semantic {
        Semantic::Joints(set) => !has(Semantic::Weights(set)) || !has(Semantic::Joints(set)),
        Semantic::Weights(set) => !has(Semantic::Joints(set)) || !has(Semantic::Weights(set)),
        _ => false,
    };
    let half: Vec<Semantic> =
        mesh.further_attributes().iter().map(|a| a.semantic.clone()).filter(is_half).collect();
    if half.is_empty() {
        return mesh;
    }
    report.dropped = half.iter().map(Semantic::title).collect();
    report.dropped.dedup();
    mesh.without_further(|semantic| half.contains(semantic))
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Attribute, shapes};

    use super::*;
    use crate::NoControl;

    #[test]
    fn joints_without_weights_are_dropped_and_reported() {
        let mut mesh = shapes::icosphere(3);
        let values = vec![0.0; 4 * mesh.wedge_count()];
        mesh.add_attribute(Attribute { semantic: Semantic::Joints(0), width: 4, values }).unwrap();
        let built = cluster_lod(&mesh, &ClusterLodOptions::default(), &mut NoControl).unwrap();
        assert_eq!(built.report.dropped, ["joints"]);
        assert!(built.lod.mesh().further_attributes().is_empty());
    }

    #[test]
    fn faces_that_cannot_be_drawn_are_counted() {
        let whole = shapes::icosphere(3);
        let mut faces: Vec<[VertexId; 3]> =
            whole.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
        let [a, b, c] = faces[0];
        faces.extend([[b, c, a], [a, a, b]]);
        let mesh = TriMesh::new(whole.positions().clone(), faces).unwrap();
        let report = cluster_lod(&mesh, &ClusterLodOptions::default(), &mut NoControl).unwrap().report;
        assert_eq!((report.cleanup.duplicate_faces, report.cleanup.degenerate_faces), (1, 1));
        assert_eq!(report.input_faces, whole.face_count() + 2);
    }

    #[test]
    fn errors_name_the_option_out_of_range() {
        let mesh = shapes::tetrahedron();
        let named = |change: &dyn Fn(&mut ClusterLodOptions)| {
            let mut options = ClusterLodOptions::default();
            change(&mut options);
            match cluster_lod(&mesh, &options, &mut NoControl) {
                Err(SimplifyError::BadOption { option, .. }) => option,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(named(&|o| o.triangles = 257), "triangles");
        assert_eq!(named(&|o| o.vertices = 2), "vertices");
        assert_eq!(named(&|o| o.group = 1), "group");
        assert_eq!(named(&|o| o.keep_at_most = f64::NAN), "keep_at_most");
        assert_eq!(named(&|o| o.weights.uv = -1.0), "weight");
    }
}
