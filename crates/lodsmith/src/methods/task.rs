//! Input and result of the methods that construct a new surface.

use glam::DVec3;
use lodsmith_core::geometry::frame::UnitFrame;
use lodsmith_core::{Bounds, FaceId, PositionsView, RegionId, TriMesh, VertexId};

use super::distinct;
use crate::collapse::Goal;
use crate::collapse::order::Ordered;
use crate::input::Input;
use crate::options::{Length, SimplifyOptions};
use crate::report::Refusal;

/// The prepared input: coincident vertices are merged, degenerate and duplicate faces dropped. Positions are
/// in double precision, in a frame from -1 to 1; vertices are sorted along a Morton curve, faces by their
/// lowest vertex.
pub(crate) struct PreparedInput {
    pub(crate) frame: UnitFrame,
    pub(crate) points: Vec<DVec3>,
    pub(crate) faces: Vec<[VertexId; 3]>,
    /// The input face of each face.
    pub(crate) origin: Vec<FaceId>,
    /// The region of each face, if there are several.
    pub(crate) regions: Option<Vec<RegionId>>,
    /// True for each locked vertex, if any is locked.
    pub(crate) locked: Option<Vec<bool>>,
    /// Cost factor at each vertex, if importance varies.
    pub(crate) cost_factors: Option<Vec<f32>>,
    /// Number of duplicate faces dropped.
    pub(crate) duplicate_faces: usize,
    /// Diagonal of the bounding box, in user units.
    pub(crate) diagonal: f64,
    /// True if positions are output in single precision.
    pub(crate) is_single: bool,
    /// One input vertex at each distinct position.
    pub(super) first: Vec<VertexId>,
}

impl PreparedInput {
    /// Prepares the input, without per-vertex locks and importance.
    pub(crate) fn of(input: &Input<'_>, ordered: &Ordered) -> Self {
        let surface = &input.surface;
        let positions = surface.positions();
        let first = ordered.first_vertices();
        let places: Vec<[f64; 3]> = first.iter().map(|&v| positions.get(v)).collect();
        let bounds = PositionsView::F64(&places).bounds().unwrap_or(Bounds { min: [0.0; 3], max: [0.0; 3] });
        let frame = UnitFrame::of(&bounds);
        let mut faces = match ordered.faces.is_empty() {
            // An earlier pass has consumed it.
            true => ordered.remake_faces(surface),
            false => ordered.faces.clone(),
        };
        let mut origin = ordered.of_faces(surface, FaceId::new);
        let regions = input.mesh.and_then(TriMesh::regions).filter(|r| r.iter().any(|x| *x != r[0]));
        let mut regions = regions.map(|r| ordered.of_faces(surface, |i| r[i]));
        let keep = distinct::first_of_each(&faces);
        let duplicate_faces = keep.iter().filter(|k| !**k).count();
        if duplicate_faces > 0 {
            distinct::retain(&mut faces, &keep);
            distinct::retain(&mut origin, &keep);
            regions.iter_mut().for_each(|r| distinct::retain(r, &keep));
        }
        Self {
            frame,
            points: places.iter().map(|&p| frame.unit_from_user(p)).collect(),
            faces,
            origin,
            regions,
            locked: None,
            cost_factors: None,
            duplicate_faces,
            diagonal: ordered.diagonal,
            is_single: matches!(positions, PositionsView::F32(_)),
            first,
        }
    }

    /// Converts a length of the options to the unit frame.
    pub(crate) fn length(&self, length: Length) -> f64 {
        self.frame.unit_length(length.in_units(self.diagonal))
    }
}

/// Parameters of a method.
pub(crate) struct Task<'a> {
    pub(crate) input: &'a PreparedInput,
    /// The mesh that `input` was made from, if attributes are kept: `origin` indexes its faces.
    pub(crate) mesh: Option<&'a TriMesh>,
    pub(crate) options: &'a SimplifyOptions,
    /// Counts at which the method may stop; empty if it runs to its own end.
    pub(crate) goal: Goal,
    /// In the search for an error: the largest distance that one step may cause, in the unit frame.
    pub(crate) step: Option<f64>,
}

/// Result of a method.
#[derive(Default)]
pub(crate) struct RebuiltSurface {
    /// Positions in the unit frame, each of them used by a face.
    pub(crate) points: Vec<DVec3>,
    /// The input vertex that each point still equals bit by bit, or [`NONE`].
    pub(crate) kept: Vec<VertexId>,
    pub(crate) faces: Vec<[VertexId; 3]>,
    /// For each face the input face that it replaces, if the method knows it; otherwise it is found by
    /// position.
    pub(crate) stands_for: Option<Vec<usize>>,
    /// The region of each face, if already determined.
    pub(crate) regions: Option<Vec<RegionId>>,
    pub(crate) end: Ending,
    /// Number of steps, reported as collapses.
    pub(crate) steps: u64,
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) parts_removed: usize,
    pub(crate) necks_cut: usize,
    /// True if seams had to give way.
    pub(crate) seams_relaxed: bool,
    /// RMS distance in the unit frame, if the method knows it; otherwise measured with few samples.
    pub(crate) estimate: Option<f64>,
}

/// Reason why a method ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The goal is met.
    Goal,
    /// Nothing is left to remove.
    #[default]
    Exhausted,
    /// All remaining steps were refused.
    Stuck,
    /// The caller asked to finish with the best result so far.
    Finish,
}
