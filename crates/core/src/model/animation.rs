//! How models move: nodes, joints and morph targets over time.

use glam::{DMat4, DQuat, DVec3};

/// Where a node stands as seen from its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// Scaled, then turned, then moved: what animations change.
    Parts {
        /// Where to.
        translation: DVec3,
        /// How turned; unit length.
        rotation: DQuat,
        /// How much larger along each axis.
        scale: DVec3,
    },
    /// A matrix, which no animation changes.
    Matrix(DMat4),
}

impl Default for Transform {
    fn default() -> Self {
        Self::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Transform {
    /// As a matrix.
    pub fn matrix(&self) -> DMat4 {
        match *self {
            Self::Parts { translation, rotation, scale } => {
                DMat4::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

/// Joints that pull a mesh: a vertex goes where its joints take it, by their weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Nodes; [`Semantic::Joints`](crate::Semantic::Joints) are places in this list.
    pub joints: Vec<usize>,
    /// From the coordinates of the mesh to those of each joint, in the pose of the mesh.
    pub joint_from_mesh: Vec<DMat4>,
}

/// Something that moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Its name, for people; empty without one.
    pub name: String,
    /// What moves, each on its own.
    pub channels: Vec<Channel>,
}

/// One property of one node over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The node.
    pub node: usize,
    /// What of it, and how.
    pub track: Track,
    /// Seconds from the start, rising.
    pub times: Vec<f32>,
    /// How it goes from one to the next.
    pub interpolation: Interpolation,
}

/// Values of a property at each of the times; with [`Interpolation::Cubic`] three for each: tangent in, value, tangent out.
#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    /// Of [`Transform::Parts`].
    Translation(Vec<[f32; 3]>),
    /// Of [`Transform::Parts`]: x, y, z, w.
    Rotation(Vec<[f32; 4]>),
    /// Of [`Transform::Parts`].
    Scale(Vec<[f32; 3]>),
    /// Strengths of all morph targets of the node's mesh, one after the other, for each time.
    MorphWeights(Vec<f32>),
}

impl Track {
    /// How many values there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Translation(values) | Self::Scale(values) => values.len(),
            Self::Rotation(values) => values.len(),
            Self::MorphWeights(values) => values.len(),
        }
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// How a value goes from one time to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// In a straight line; rotations along the shorter arc.
    #[default]
    Linear,
    /// It stays until the next.
    Step,
    /// Along a cubic curve with given tangents.
    Cubic,
}

/// How a model stands at a moment; the default is at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Of each node, where it stands as seen from its parent; empty at rest.
    pub transforms: Vec<Transform>,
    /// Strengths of morph targets at each node, where they are not those at rest; empty at rest.
    pub morph_weights: Vec<Option<Vec<f32>>>,
}
