//! What methods that make a new surface start from, and what they make.

use glam::DVec3;
use lodsmith_core::geometry::frame::UnitFrame;
use lodsmith_core::{FaceId, RegionId, TriMesh, VertexId};

use crate::collapse::Goal;
use crate::options::{Length, SimplifyOptions};
use crate::report::Refusal;

/// The input of such a method: equal places are one vertex, faces without three places and those that stand twice are left
/// out. In double precision, in a frame from -1 to 1; vertices along a Morton curve, faces by their least vertex.
pub(crate) struct Ground {
    pub(crate) frame: UnitFrame,
    pub(crate) points: Vec<DVec3>,
    pub(crate) faces: Vec<[VertexId; 3]>,
    /// The face of the input that each face is.
    pub(crate) origin: Vec<FaceId>,
    /// The region of each face, where there are several.
    pub(crate) regions: Option<Vec<RegionId>>,
    /// Whether each vertex is locked, where any is.
    pub(crate) locked: Option<Vec<bool>>,
    /// What a step costs times at each vertex, where places are not equally important.
    pub(crate) prices: Option<Vec<f32>>,
    /// Faces that were there already, left out.
    pub(crate) duplicate_faces: usize,
    /// Diagonal of the box, in user units.
    pub(crate) diagonal: f64,
    /// Whether positions leave in single precision.
    pub(crate) is_single: bool,
    /// A vertex of the input at each place.
    pub(super) first: Vec<VertexId>,
}

impl Ground {
    /// A length of the options, in the frame.
    pub(crate) fn length(&self, length: Length) -> f64 {
        self.frame.unit_length(length.in_units(self.diagonal))
    }
}

/// What such a method is told.
pub(crate) struct Task<'a> {
    pub(crate) ground: &'a Ground,
    /// What the ground was made from, where attributes are kept: `origin` names its faces.
    pub(crate) mesh: Option<&'a TriMesh>,
    pub(crate) options: &'a SimplifyOptions,
    /// Counts at which it may end; none where it goes on by itself.
    pub(crate) goal: Goal,
    /// In search of an error: the largest distance that a step may leave, in the frame.
    pub(crate) step: Option<f64>,
}

/// What such a method makes.
#[derive(Default)]
pub(crate) struct Made {
    /// In the frame; each is named by a face.
    pub(crate) points: Vec<DVec3>,
    /// The vertex of the ground that each point still is, bit by bit, or [`NONE`].
    pub(crate) kept: Vec<VertexId>,
    pub(crate) faces: Vec<[VertexId; 3]>,
    /// For each face one of the ground that it stands for, where the method knows it; else it is found by place.
    pub(crate) stands_for: Option<Vec<usize>>,
    /// The region of each face, where that is settled already.
    pub(crate) regions: Option<Vec<RegionId>>,
    pub(crate) end: Ending,
    /// Steps taken: what the report calls collapses.
    pub(crate) steps: u64,
    pub(crate) refusals: [u64; Refusal::ALL.len()],
    pub(crate) parts_removed: usize,
    pub(crate) necks_cut: usize,
    /// RMS distance in the frame, where the method has a figure; else it is measured with few samples.
    pub(crate) estimate: Option<f64>,
}

/// How such a method came to its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The goal is met.
    Goal,
    /// It has nothing more to take away.
    #[default]
    Exhausted,
    /// What is left was refused.
    Stuck,
    /// The caller wants the best so far.
    Finish,
}
