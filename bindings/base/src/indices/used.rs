//! The vertices that an index buffer uses, renumbered.

use std::collections::HashMap;

use lodsmith_core::VertexId;

use super::error::IndexError;

/// Vertices per index above which used vertices are found without a pass over all vertices.
const SPARSE_RATIO: usize = 4;

/// The used vertices, and the triangles with the new numbers.
pub(crate) struct UsedVertices {
    /// The index of each used vertex, ascending.
    pub(crate) indices: Vec<u32>,
    /// Three used vertices for each face.
    pub(crate) triangles: Vec<[VertexId; 3]>,
}

impl UsedVertices {
    /// Finds the used vertices. Cost: O(V + F), or O(F log F) if there are far more vertices than indices.
    ///
    /// # Errors
    /// If the number of indices is not a multiple of three, or an index is out of range.
    pub(crate) fn new(indices: &[u32], vertex_count: usize) -> Result<Self, IndexError> {
        let (faces, rest) = indices.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(IndexError::Argument(format!(
                "{} indices are not a multiple of three",
                indices.len()
            )));
        }
        if let Some(at) = indices.iter().position(|&i| i as usize >= vertex_count) {
            let index = indices[at];
            return Err(IndexError::Argument(format!(
                "index {at} refers to vertex {index}, but there are {vertex_count} vertices"
            )));
        }
        if vertex_count / SPARSE_RATIO > indices.len() {
            Ok(Self::sparse(faces))
        } else {
            Ok(Self::dense(faces, vertex_count))
        }
    }

    fn dense(faces: &[[u32; 3]], vertex_count: usize) -> Self {
        let mut number = vec![0u32; vertex_count];
        for &i in faces.as_flattened() {
            number[i as usize] = 1;
        }
        let mut indices = Vec::new();
        for (i, number) in (0u32..).zip(&mut number).filter(|x| *x.1 == 1) {
            *number = indices.len() as u32;
            indices.push(i);
        }
        let triangles = faces.iter().map(|t| t.map(|i| VertexId(number[i as usize]))).collect();
        Self { indices, triangles }
    }

    fn sparse(faces: &[[u32; 3]]) -> Self {
        let mut indices = faces.as_flattened().to_vec();
        indices.sort_unstable();
        indices.dedup();
        let number: HashMap<u32, u32> = indices.iter().copied().zip(0..).collect();
        let triangles = faces.iter().map(|t| t.map(|i| VertexId(number[&i]))).collect();
        Self { indices, triangles }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_algorithms_give_the_same_numbers() {
        let faces = [[7, 2, 9], [9, 2, 4], [4, 0, 7]];
        let (dense, sparse) = (UsedVertices::dense(&faces, 10), UsedVertices::sparse(&faces));
        assert_eq!(dense.indices, [0, 2, 4, 7, 9]);
        assert_eq!(dense.triangles[0], [3, 1, 4].map(VertexId));
        assert_eq!((dense.indices, dense.triangles), (sparse.indices, sparse.triangles));
    }

    #[test]
    fn invalid_index_buffers_are_errors() {
        assert!(UsedVertices::new(&[0, 1], 3).is_err());
        assert!(UsedVertices::new(&[0, 1, 3], 3).is_err());
        assert!(UsedVertices::new(&[], 0).is_ok_and(|used| used.triangles.is_empty()));
    }
}
