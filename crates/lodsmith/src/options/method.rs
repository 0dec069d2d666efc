//! Methods of simplification, each with its own options.

use super::length::Length;

/// Name of a method of simplification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MethodKind {
    /// See [`Method::Memoryless`].
    #[default]
    Memoryless,
    /// See [`Method::Quadric`].
    Quadric,
    /// See [`Method::LindstromTurk`].
    LindstromTurk,
    /// See [`Method::Melax`].
    Melax,
    /// See [`Method::ShortestEdge`].
    ShortestEdge,
    /// See [`Method::Cluster`].
    Cluster,
    /// See [`Method::VertexRemoval`].
    VertexRemoval,
    /// See [`Method::Planar`].
    Planar,
    /// See [`Method::Unsubdivide`].
    Unsubdivide,
    /// See [`Method::Remesh`].
    Remesh,
}

/// Method of simplification, with the options that only this method has. Options that are `None` have a default or
/// follow from the stop.
///
/// ```
/// use lodsmith::{Length, Method, MethodKind, SimplifyOptions, Stop};
///
/// let mut options = SimplifyOptions::new(Stop::ratio(0.1));
/// options.method = MethodKind::Quadric.into();
/// options.method = Method::Cluster { cell: Some(Length::OfDiagonal(0.01)), two_stage: false };
/// assert!(options.method.ends_without_stop());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Edge collapse by the tensors of the current star, and a final fit: the default. Based on the finding of
    /// [Lindstrom-Turk 1998] that costs without memory are better.
    Memoryless {
        /// Pairs of vertices closer than this that share no edge are contracted too. A second run is made without
        /// pairs; its result is used if only that run meets the stop, or if it is closer by a quarter.
        pairs: Option<Length>,
    },
    /// Edge collapse by accumulated plane quadrics, weighted by area. [Garland-Heckbert 1997]
    Quadric {
        /// As for [`Method::Memoryless`].
        pairs: Option<Length>,
    },
    /// Edge collapse that preserves volume and borders, with a cost from the current surface only.
    /// [Lindstrom-Turk 1998]
    LindstromTurk,
    /// Half-edge collapse by length times curvature, onto vertices of the input. [Melax 1998]
    Melax,
    /// Edge collapse in order of edge length, onto the midpoint.
    ShortestEdge {
        /// Edges up to this length are collapsed.
        edge_length: Option<Length>,
    },
    /// Vertex clustering: one vertex for each cell of a grid. [Rossignac-Borrel 1993] [Lindstrom 2000]
    Cluster {
        /// Edge length of a cell.
        cell: Option<Length>,
        /// Clusters only to a multiple of the stop, then continues with [`Method::Memoryless`].
        two_stage: bool,
    },
    /// Removal of vertices, those nearest to the plane of their neighbours first; the holes are retriangulated.
    /// [Schroeder et al. 1992]
    VertexRemoval {
        /// Edges with a larger dihedral angle, in degrees, are creases and are preserved.
        crease_deg: Option<f64>,
    },
    /// Coplanar regions are replaced by as few triangles as their outlines need. [Hinker-Hansen 1993]
    /// [Kalvin-Taylor 1996]
    Planar {
        /// Largest angle, in degrees, between a face and the plane of its region; 5 by default.
        angle_deg: Option<f64>,
        /// Largest distance of a vertex from the plane of its region, and of a removed vertex from the edge of
        /// the simplified outline. By default 2e-7 of the diagonal, or the error of the stop.
        flat: Option<Length>,
    },
    /// Reversal of 4:1 subdivision where the mesh has its pattern. [Taubin 2001]
    Unsubdivide {
        /// Largest number of levels to undo.
        levels: Option<usize>,
    },
    /// A new mesh on the same surface. [Botsch-Kobbelt 2004]
    Remesh(Remesh),
}

/// Kind of surface that [`Method::Remesh`] makes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remesh {
    /// Triangles on the surface of the input.
    OnSurface {
        /// Length of the new edges.
        edge_length: Option<Length>,
        /// Edges of the input with a larger dihedral angle, in degrees, are creases and are preserved.
        crease_deg: Option<f64>,
        /// Number of iterations of remeshing.
        rounds: Option<usize>,
        /// Sizes and connectivity of the triangles.
        pattern: RemeshPattern,
    },
    /// A closed surface around the input, even if the input is open or damaged.
    Voxels {
        /// Edge length of a voxel.
        size: Length,
    },
}

/// Sizes and connectivity of new triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RemeshPattern {
    /// Even sizes.
    #[default]
    Even,
    /// Shorter edges where the surface is curved.
    Adaptive,
    /// Semi-regular: a base mesh, subdivided several times. [Eck et al. 1995]
    SemiRegular {
        /// Number of subdivisions.
        subdivisions: usize,
    },
}

impl Default for Method {
    fn default() -> Self {
        MethodKind::default().into()
    }
}

impl Default for Remesh {
    fn default() -> Self {
        let pattern = RemeshPattern::default();
        Self::OnSurface { edge_length: None, crease_deg: None, rounds: None, pattern }
    }
}

impl From<MethodKind> for Method {
    /// Returns the method with its options at their defaults.
    fn from(kind: MethodKind) -> Self {
        match kind {
            MethodKind::Memoryless => Self::Memoryless { pairs: None },
            MethodKind::Quadric => Self::Quadric { pairs: None },
            MethodKind::LindstromTurk => Self::LindstromTurk,
            MethodKind::Melax => Self::Melax,
            MethodKind::ShortestEdge => Self::ShortestEdge { edge_length: None },
            MethodKind::Cluster => Self::Cluster { cell: None, two_stage: false },
            MethodKind::VertexRemoval => Self::VertexRemoval { crease_deg: None },
            MethodKind::Planar => Self::Planar { angle_deg: None, flat: None },
            MethodKind::Unsubdivide => Self::Unsubdivide { levels: None },
            MethodKind::Remesh => Self::Remesh(Remesh::default()),
        }
    }
}

impl Method {
    /// Returns the name of the method, as on the command line.
    pub const fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// Returns the method without its options.
    pub const fn kind(&self) -> MethodKind {
        match self {
            Self::Memoryless { .. } => MethodKind::Memoryless,
            Self::Quadric { .. } => MethodKind::Quadric,
            Self::LindstromTurk => MethodKind::LindstromTurk,
            Self::Melax => MethodKind::Melax,
            Self::ShortestEdge { .. } => MethodKind::ShortestEdge,
            Self::Cluster { .. } => MethodKind::Cluster,
            Self::VertexRemoval { .. } => MethodKind::VertexRemoval,
            Self::Planar { .. } => MethodKind::Planar,
            Self::Unsubdivide { .. } => MethodKind::Unsubdivide,
            Self::Remesh(_) => MethodKind::Remesh,
        }
    }

    /// Returns true if a run of this method ends without a stop.
    pub const fn ends_without_stop(&self) -> bool {
        match self {
            Self::Planar { .. } | Self::Unsubdivide { .. } | Self::Remesh(Remesh::Voxels { .. }) => true,
            Self::Cluster { cell, two_stage } => cell.is_some() && !*two_stage,
            Self::ShortestEdge { edge_length } | Self::Remesh(Remesh::OnSurface { edge_length, .. }) => {
                edge_length.is_some()
            }
            _ => false,
        }
    }

    /// True if an error limit bounds each step of the method, instead of the number of steps.
    pub(crate) const fn limits_error_by_step(&self) -> bool {
        matches!(self, Self::Planar { .. } | Self::Unsubdivide { .. })
    }

    /// True if a voxel surface is made, which keeps no elements of the input.
    pub(crate) const fn makes_voxels(&self) -> bool {
        matches!(self, Self::Remesh(Remesh::Voxels { .. }))
    }

    /// Returns the largest distance of contracted pairs.
    pub(crate) const fn pairs(&self) -> Option<Length> {
        match self {
            Self::Memoryless { pairs } | Self::Quadric { pairs } => *pairs,
            _ => None,
        }
    }

    /// Returns the method with another distance of pairs, if it has one.
    pub(crate) const fn with_pairs(mut self, distance: Option<Length>) -> Self {
        if let Self::Memoryless { pairs } | Self::Quadric { pairs } = &mut self {
            *pairs = distance;
        }
        self
    }

    /// Returns the dihedral angle above which edges are creases.
    pub(crate) const fn crease_deg(&self) -> Option<f64> {
        match self {
            Self::VertexRemoval { crease_deg } | Self::Remesh(Remesh::OnSurface { crease_deg, .. }) => {
                *crease_deg
            }
            _ => None,
        }
    }

    /// Returns the length up to which edges are collapsed, or the length of new edges.
    pub(crate) const fn edge_length(&self) -> Option<Length> {
        match self {
            Self::ShortestEdge { edge_length } | Self::Remesh(Remesh::OnSurface { edge_length, .. }) => {
                *edge_length
            }
            _ => None,
        }
    }

    /// Returns the number of iterations of a remesh.
    pub(crate) const fn rounds(&self) -> Option<usize> {
        match self {
            Self::Remesh(Remesh::OnSurface { rounds, .. }) => *rounds,
            _ => None,
        }
    }

    /// True if new edges are shorter where the surface is curved.
    pub(crate) const fn is_adaptive(&self) -> bool {
        matches!(self, Self::Remesh(Remesh::OnSurface { pattern: RemeshPattern::Adaptive, .. }))
    }

    /// Returns the lengths among the options.
    pub(crate) fn lengths_mut(&mut self) -> impl Iterator<Item = &mut Length> {
        let [first, second] = match self {
            Self::Memoryless { pairs: length }
            | Self::Quadric { pairs: length }
            | Self::ShortestEdge { edge_length: length }
            | Self::Cluster { cell: length, .. }
            | Self::Remesh(Remesh::OnSurface { edge_length: length, .. }) => [length.as_mut(), None],
            Self::Planar { flat, .. } => [flat.as_mut(), None],
            Self::Remesh(Remesh::Voxels { size }) => [None, Some(size)],
            _ => [None, None],
        };
        first.into_iter().chain(second)
    }
}
