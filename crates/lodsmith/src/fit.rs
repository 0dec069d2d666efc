//! Final least-squares fit: moves the vertices of the result towards the original surface.
//!
//! Each original vertex knows the final vertex that it was merged into, its home. Samples of the original
//! (centres and corners of faces) are assigned to the nearest triangle of the star of their home. A vertex
//! displaced by delta moves the surface at barycentric coordinates b by b_k n·delta, so nine sums for each
//! triangle stand for its samples. Then a few Gauss-Seidel sweeps of 3×3 systems are done.
//! (docs/decisions/0006)

mod faces;
mod move_guards;
mod normal_equations;
mod outliers;
mod sampler;
#[cfg(test)]
mod simd_tests;
mod solve;
mod stars;
mod values;

use lodsmith_core::VertexId;

use crate::collapse::ordered_input::OrderedInput;
use crate::collapse::store::Store;
use crate::cost::metric::VertexMemory;
use crate::cost::tensor::Tensor;
use faces::{FaceData, face_data};
pub(crate) use move_guards::MoveGuards;
use outliers::pull_in_outliers;
use sampler::{SampleParameters, take_samples};
use solve::solve;
pub(crate) use values::{Originals, Values};

/// Largest distance of a vertex from the original, in RMS heights of the samples.
const MAX_OUTLIER_RMS: f32 = 6.0;
/// Fraction of the squared limit that a sample must lie from a face of a vertex for the vertex to be checked
/// as an outlier.
const OUTLIER_CHECK_SHARE: f32 = 0.25;
/// Squared height, over the mean square predicted by the costs, above which a sample counts by its height
/// instead of its square, at one sample for each final triangle; it grows with the square of the number of
/// samples per triangle. (Measured at 50 %, where there are three and some lie on the wrong triangle: means
/// 1.5 to 3 % lower, RMS equal. With many samples the square is better: cow and bunny at 100 faces have 5 to
/// 10 % less RMS with it.)
const ROBUST_HEIGHT_SQ: f64 = 0.017;
/// Result of the fit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fitted {
    /// RMS distance of the samples to the result, in the unit frame.
    pub(crate) rms: f64,
}

/// Moves the vertices of a compacted store towards the original; `away` is the approximate RMS distance. Each
/// vertex of the original has its `home`, or [`NONE`](crate::collapse::order::NONE). Samples are passed to `values`, if given; moves
/// respect the `guards`, if given. The quadrics of the vertices are lost: `tensor` selects the part of them
/// that the solve uses as scratch space.
pub(crate) fn fit<Q: VertexMemory>(
    store: &mut Store<Q>,
    given: &mut impl OrderedInput,
    home: &[VertexId],
    away: f64,
    values: Option<&mut Values<'_>>,
    guards: Option<&MoveGuards>,
    tensor: fn(&mut Q) -> &mut Tensor,
) -> Fitted {
    if store.t.is_empty() {
        return Fitted::default();
    }
    let FaceData { mut loads, leeway } = face_data(store);
    let per_face = (given.point_count() + given.face_count()) as f64 / store.t.len() as f64;
    let robust_height_sq = (ROBUST_HEIGHT_SQ * (per_face * away).powi(2)).clamp(1e-30, 1e30) as f32;
    let parameters = SampleParameters { home, per_face, robust_height_sq };
    let sums = take_samples(store, &mut loads, given, &parameters, values);
    let limit = MAX_OUTLIER_RMS * MAX_OUTLIER_RMS * (sums.height_sq / sums.weight.max(1e-30)) as f32;
    let suspects = solve(store, &mut loads, leeway, OUTLIER_CHECK_SHARE * limit, guards, tensor);
    let after = sums.height_sq - loads.iter().map(|l| f64::from(l.gain())).sum::<f64>();
    pull_in_outliers(store, &loads, suspects, given, home, (limit, guards));
    let distance_sq_sum = after.max(0.0) + sums.beside_sq;
    Fitted { rms: (distance_sq_sum / sums.total_weight().max(1e-30)).sqrt() }
}
