//! Animation data: transforms, skins, keyframe channels and poses.

use glam::{DMat4, DQuat, DVec3};

/// Transform of a node to its parent's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Transform {
    /// Scale, then rotation, then translation; can be animated.
    Parts {
        /// Translation.
        translation: DVec3,
        /// Rotation; unit length.
        rotation: DQuat,
        /// Scale along each axis.
        scale: DVec3,
    },
    /// A matrix, which cannot be animated.
    Matrix(DMat4),
}

impl Default for Transform {
    fn default() -> Self {
        Self::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Transform {
    /// Converts the transform to a matrix.
    pub fn matrix(&self) -> DMat4 {
        match *self {
            Self::Parts { translation, rotation, scale } => {
                DMat4::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

/// Joints that deform a mesh: each vertex follows its joints by their weights.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Skin {
    /// Node indices; [`Semantic::Joints`](crate::Semantic::Joints) are indices into this list.
    pub joints: Vec<usize>,
    /// Transform from mesh to joint coordinates, for each joint in the bind pose.
    pub joint_from_mesh: Vec<DMat4>,
}

/// An animation of a model.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Animation {
    /// Display name; empty if it has none.
    pub name: String,
    /// Independent channels, one for each animated property.
    pub channels: Vec<Channel>,
}

/// One property of one node over time.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channel {
    /// Index of the node.
    pub node: usize,
    /// The property and its values.
    pub track: Track,
    /// Keyframe times in seconds from the start, ascending.
    pub times: Vec<f32>,
    /// Interpolation between keyframes.
    pub interpolation: Interpolation,
}

/// Values of a property at the keyframes; with [`Interpolation::Cubic`] three for each: in-tangent, value,
/// out-tangent.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Track {
    /// Translation of [`Transform::Parts`].
    Translation(Vec<[f32; 3]>),
    /// Rotation of [`Transform::Parts`]: x, y, z, w.
    Rotation(Vec<[f32; 4]>),
    /// Scale of [`Transform::Parts`].
    Scale(Vec<[f32; 3]>),
    /// Weights of all morph targets of the node's mesh, keyframe after keyframe.
    MorphWeights(Vec<f32>),
}

impl Track {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Translation(values) | Self::Scale(values) => values.len(),
            Self::Rotation(values) => values.len(),
            Self::MorphWeights(values) => values.len(),
        }
    }
    /// True if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Interpolation between two keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Interpolation {
    /// Linear; rotations along the shorter arc.
    #[default]
    Linear,
    /// Holds the value until the next keyframe.
    Step,
    /// A cubic spline with given tangents.
    Cubic,
}

/// A pose of a model; the default is the rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// Transform of each node to its parent's coordinates; empty at rest.
    pub transforms: Vec<Transform>,
    /// Morph weights of each node, if they differ from the rest weights; empty at rest.
    pub morph_weights: Vec<Option<Vec<f32>>>,
}
