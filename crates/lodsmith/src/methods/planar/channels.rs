//! Attributes as scalar channels that have to be linear over a region.

use lodsmith_core::{Morphed, Semantic, TriMesh, WedgeId};

use crate::methods::task::PreparedInput;
use crate::options::AttributeWeights;

/// Tolerances between a value and the linear function of its region: half a texel of a 4096 texture; one step
/// of an 8-bit colour; about half a degree; and as a share of the largest value, for skin weights and custom
/// attributes.
const UV_TOLERANCE: f32 = 1e-4;
const COLOR_TOLERANCE: f32 = 0.004;
const NORMAL_TOLERANCE: f32 = 0.01;
const OTHER_TOLERANCE: f32 = 1e-3;
/// Rounding of single precision, as a share of the largest value.
const ROUNDING: f32 = 5e-7;

/// All scalar attribute channels that are not constant.
#[derive(Default)]
pub(super) struct Channels<'a> {
    scalars: Vec<Channel<'a>>,
    /// Wedges of each face.
    wedges: Vec<[WedgeId; 3]>,
}

struct Channel<'a> {
    values: &'a [f32],
    width: usize,
    at: usize,
    tolerance: f64,
}

impl<'a> Channels<'a> {
    /// Collects the weighted channels of a mesh, for the faces of the prepared input; `flat` is in user
    /// units.
    pub(super) fn new(
        mesh: Option<&'a TriMesh>,
        prepared: &PreparedInput,
        weights: &AttributeWeights,
        flat: f64,
    ) -> Self {
        let mut all = Self::default();
        let Some(mesh) = mesh else { return all };
        let mut add = |values: &'a [f32], width: usize, weight: f64, tolerance: f32, share: f32| {
            for at in (0..width).filter(|_| weight > 0.0) {
                let of = || values.iter().skip(at).step_by(width);
                if of().all(|x| *x == values[at]) {
                    continue;
                }
                let largest = of().fold(0f32, |m, x| m.max(x.abs()));
                let tolerance = f64::from(tolerance).max(f64::from(share) * f64::from(largest));
                all.scalars.push(Channel { values, width, at, tolerance });
            }
        };
        if let Some(x) = mesh.uvs() {
            add(bytemuck::cast_slice(x), 2, weights.uv, UV_TOLERANCE, ROUNDING);
        }
        if let Some(x) = mesh.colors() {
            add(bytemuck::cast_slice(x), 4, weights.color, COLOR_TOLERANCE, ROUNDING);
        }
        if let Some(x) = mesh.normals() {
            add(bytemuck::cast_slice(x), 3, weights.normal, NORMAL_TOLERANCE, ROUNDING);
        }
        for a in mesh.further_attributes() {
            let (weight, tolerance, share) = match a.semantic {
                Semantic::Uv(_) => (weights.uv, UV_TOLERANCE, ROUNDING),
                Semantic::Color(_) => (weights.color, COLOR_TOLERANCE, ROUNDING),
                // Tangents are directions, like normals; values that identify something must be constant.
                Semantic::Tangent => (weights.normal, NORMAL_TOLERANCE, ROUNDING),
                Semantic::Joints(_) | Semantic::Discrete { .. } => (weights.other, 0.0, 0.0),
                Semantic::Morph { of: Morphed::Position, .. } => (weights.morph, flat as f32, ROUNDING),
                Semantic::Morph { .. } => (weights.morph, NORMAL_TOLERANCE, ROUNDING),
                Semantic::Weights(_) | Semantic::Custom(_) => (weights.other, 0.0, OTHER_TOLERANCE),
            };
            add(&a.values, a.width, weight, tolerance, share);
        }
        if !all.scalars.is_empty() {
            all.wedges = prepared.origin.iter().map(|f| mesh.triangles()[f.index()]).collect();
        }
        all
    }

    pub(super) fn count(&self) -> usize {
        self.scalars.len()
    }

    pub(super) fn tolerance(&self, channel: usize) -> f64 {
        self.scalars[channel].tolerance
    }

    #[inline]
    pub(super) fn value(&self, channel: usize, face: usize, corner: usize) -> f64 {
        let s = &self.scalars[channel];
        f64::from(s.values[self.wedges[face][corner].index() * s.width + s.at])
    }
}
