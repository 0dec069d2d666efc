//! Kinds of elements that references name.

/// Kind of a referenced element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in super::super) enum ReferenceKind {
    Accessor,
    View,
    Mesh,
    /// A mesh whose coordinates matter.
    ShapeMesh,
    /// A node that stays the same if its mesh moves to a child.
    Node,
    /// A node that is placed by another one, or by a scene, with all that it holds.
    Child,
    /// A node that is named for its mesh.
    MeshNode,
    /// A node that is named for the coordinates of its mesh.
    ShapeNode,
    Material,
    Texture,
    Image,
    Sampler,
    Animation,
    /// A JSON pointer to a property, as a string.
    Pointer,
}

impl ReferenceKind {
    /// Returns the list that a number of this kind counts in; none for pointers.
    pub(in super::super) const fn list(self) -> Option<&'static str> {
        Some(match self {
            Self::Accessor => "accessors",
            Self::View => "bufferViews",
            Self::Mesh | Self::ShapeMesh => "meshes",
            Self::Node | Self::Child | Self::MeshNode | Self::ShapeNode => "nodes",
            Self::Material => "materials",
            Self::Texture => "textures",
            Self::Image => "images",
            Self::Sampler => "samplers",
            Self::Animation => "animations",
            Self::Pointer => return None,
        })
    }
}
