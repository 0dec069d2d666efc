//! A surface prepared for measuring.

use crate::mesh::Surface;
use crate::sampling::SurfaceSampler;
use crate::spatial::Bvh;

use super::error::MeasureError;

/// A surface prepared for comparison with any number of others: its tree, and its faces laid out for
/// sampling.
///
/// Owns its data, so the surface may be dropped. About 75 bytes per face.
#[derive(Clone, Debug)]
pub struct Prepared {
    tree: Bvh,
    /// Samples the slots of the tree, whose order keeps neighbours together whatever the order of the file.
    sampler: SurfaceSampler,
    diagonal: f64,
}

impl Prepared {
    /// Prepares a surface. Cost: O(n log n) for n faces.
    ///
    /// # Errors
    /// [`MeasureError::Empty`] if it has no face with finite corners.
    pub fn new(surface: &Surface<'_>) -> Result<Self, MeasureError> {
        Self::named(surface, "prepared")
    }

    pub(super) fn named(surface: &Surface<'_>, which: &'static str) -> Result<Self, MeasureError> {
        let tree = Bvh::new(surface);
        let bounds = tree.bounds().ok_or(MeasureError::Empty { which })?;
        let slots = || (0..tree.face_count() as u32).map(|slot| Some(tree.slot_corners(slot)));
        let sampler = SurfaceSampler::over(slots);
        Ok(Self { sampler, diagonal: bounds.diagonal(), tree })
    }

    /// The tree over its faces.
    pub fn tree(&self) -> &Bvh {
        &self.tree
    }
    /// Diagonal of the bounding box of its faces, in the units of the positions.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }
    pub(super) fn sampler(&self) -> &SurfaceSampler {
        &self.sampler
    }
}
