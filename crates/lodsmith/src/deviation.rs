//! Distance between a result and the input: measured by samples, and proven where a bound is guaranteed.

use std::sync::Arc;

use lodsmith_core::measure::proof::map::{LimitMap, MapSide};
use lodsmith_core::measure::proof::{
    WithinResult, bound_distance, prove_within, prove_within_map, samples_within, samples_within_map,
};
use lodsmith_core::measure::{CompareOptions, Comparison, Prepared, compare_prepared};
use lodsmith_core::{FaceId, Surface, TriMesh};

use crate::options::{Bound, Measure, SimplifyOptions};

/// Distances below this share of the diagonal are rounding.
pub(crate) const ROUNDING: f64 = 1e-12;
/// Relative tolerance of a proven bound. (Guessed: finer than anyone needs, and still no more work than
/// samples.)
const BOUND_TOLERANCE: f64 = 0.01;
/// A known bound is reported as it is if it is at most this many times the distance seen. (Guessed: a run
/// mostly uses a requested distance up to that ratio, and a proof takes as long as a run.)
const MAX_KNOWN_BOUND_RATIO: f64 = 1.25;

/// Samples in each direction if a proof gives the largest distance and no measurement was requested. (The RMS
/// is then known to half a percent.)
const PROOF_SAMPLES: usize = 50_000;

/// Distances known of a result, in user units.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deviation {
    pub(crate) measured: Option<Comparison>,
    pub(crate) bound: Option<f64>,
}

impl Deviation {
    /// Returns the guaranteed largest distance or, without one, the largest distance seen.
    pub(crate) fn largest(&self) -> Option<f64> {
        self.bound.or(self.measured.as_ref().map(|m| m.hausdorff.symmetric))
    }
}

/// Returns true if more than the engine's estimate has to be reported.
pub(crate) fn needs_measurement(options: &SimplifyOptions) -> bool {
    options.measure == Measure::Always
        || options.effective_bound() != Bound::Estimate
        || options.stop.error.is_some()
}

/// A result, prepared for comparison with the input.
pub(crate) struct PreparedResult(Prepared);

impl PreparedResult {
    /// The result, to compare faces of the input with it.
    pub(crate) fn prepared(&self) -> &Prepared {
        &self.0
    }

    /// Wraps a result that is prepared already.
    pub(crate) fn of(made: Prepared) -> Self {
        Self(made)
    }

    /// Returns `None` if the mesh has no face, which counts as infinitely far.
    pub(crate) fn new(mesh: &TriMesh) -> Option<Self> {
        Prepared::new(&mesh.surface()).ok().map(Self)
    }
}

/// The input, prepared for comparison with results.
pub(crate) struct InputComparer {
    reference: Arc<Prepared>,
    promised: Bound,
    samples: usize,
    seed: u64,
    /// Shares of limits, and the least limit of any place.
    map: Option<(LimitMap, f64)>,
}

impl InputComparer {
    /// Returns `None` if the surface has no face.
    pub(crate) fn new(surface: &Surface<'_>, options: &SimplifyOptions) -> Option<Self> {
        let reference = Arc::new(Prepared::new(surface).ok()?);
        let promised = options.effective_bound();
        let is_asked = options.measure == Measure::Always || promised == Bound::Estimate;
        let samples = if is_asked { CompareOptions::default().samples } else { PROOF_SAMPLES };
        Some(Self { reference, promised, samples, seed: options.seed, map: None })
    }

    /// Adds the shares of a limit at the corners of the faces. No limit is less than `rounding`.
    pub(crate) fn with_map(self, shares: impl Fn(FaceId) -> [f32; 3], rounding: f64) -> Self {
        let map = LimitMap::new(&self.reference, shares);
        Self { map: Some((map, rounding)), ..self }
    }

    /// The shares of a limit and the least limit of any place, if limits vary.
    pub(crate) fn map(&self) -> Option<(&LimitMap, f64)> {
        self.map.as_ref().map(|(map, rounding)| (map, *rounding))
    }

    /// Returns the shares of a limit, raised to the least limit of any place.
    fn map_of(&self, limit: f64) -> Option<LimitMap> {
        self.map.as_ref().map(|(map, rounding)| map.with_floor(rounding / limit))
    }

    /// True unless the guarantee covers only the result.
    pub(crate) fn is_two_sided(&self) -> bool {
        self.promised != Bound::OneSided
    }

    /// The input.
    pub(crate) fn reference(&self) -> &Arc<Prepared> {
        &self.reference
    }

    /// Returns true if a result stays within a distance at a few fixed points, the same for all distances.
    /// Never false where [`Self::proven_within`] finds a bound.
    pub(crate) fn passes_spot_check(&self, result: &PreparedResult, limit: f64) -> bool {
        if let Some(map) = self.map_of(limit) {
            let back = samples_within_map(&result.0, &self.reference, limit, MapSide::To(&map));
            let forward = || samples_within_map(&self.reference, &result.0, limit, MapSide::From(&map));
            return back && (self.promised == Bound::OneSided || forward());
        }
        let forward = || samples_within(&self.reference, &result.0, limit);
        samples_within(&result.0, &self.reference, limit) && (self.promised == Bound::OneSided || forward())
    }

    /// Returns an upper bound on the distance if the result stays within `limit`, in the sense of the
    /// guarantee.
    pub(crate) fn proven_within(&self, result: &PreparedResult, limit: f64) -> Option<f64> {
        let map = self.map_of(limit);
        let back = || match &map {
            Some(map) => prove_within_map(&result.0, &self.reference, limit, MapSide::To(map)),
            None => proven(&result.0, &self.reference, limit),
        };
        let forward = || match &map {
            Some(map) => prove_within_map(&self.reference, &result.0, limit, MapSide::From(map)),
            None => proven(&self.reference, &result.0, limit),
        };
        match self.promised {
            Bound::OneSided => back(),
            Bound::Auto | Bound::TwoSided => {
                // The direction from the result is usually quicker to prove.
                let back = back()?;
                Some(forward()?.max(back))
            }
            Bound::Estimate => {
                let seen = self.compare(&result.0).hausdorff.symmetric;
                (seen <= limit && self.passes_spot_check(result, limit)).then_some(seen)
            }
        }
    }

    /// Returns [`Self::proven_within`] of a mesh, after a check at a few points.
    pub(crate) fn proven_within_mesh(&self, mesh: &TriMesh, limit: f64) -> Option<f64> {
        let made = PreparedResult::new(mesh)?;
        self.passes_spot_check(&made, limit).then(|| self.proven_within(&made, limit)).flatten()
    }

    /// Measures a result, and proves a bound if one is guaranteed. `known` is a bound proven before.
    pub(crate) fn measure(&self, mesh: &TriMesh, known: Option<f64>) -> Deviation {
        PreparedResult::new(mesh)
            .map_or_else(Deviation::default, |result| self.measure_prepared(&result, known))
    }

    pub(crate) fn measure_prepared(
        &self,
        PreparedResult(result): &PreparedResult,
        known: Option<f64>,
    ) -> Deviation {
        let measured = self.compare(result);
        let seen = &measured.hausdorff;
        let (count, seen_of_all) = match self.promised {
            Bound::Estimate => return Deviation { bound: None, measured: Some(measured) },
            Bound::OneSided => (1, seen.backward),
            Bound::Auto | Bound::TwoSided => (2, seen.symmetric),
        };
        let bound =
            known.filter(|known| *known <= MAX_KNOWN_BOUND_RATIO * seen_of_all).unwrap_or_else(|| {
                let directions =
                    [(result, &*self.reference, seen.backward), (&*self.reference, result, seen.forward)];
                let all = directions[..count].iter();
                let bound = all
                    .map(|(from, to, seen)| bound_distance(from, to, *seen, BOUND_TOLERANCE).bound)
                    .fold(0.0, f64::max);
                known.map_or(bound, |known| known.min(bound))
            });
        Deviation { bound: Some(bound), measured: Some(measured) }
    }

    /// Measures a result by samples; `None` if it has no face.
    pub(crate) fn measured(&self, mesh: &TriMesh) -> Option<Comparison> {
        PreparedResult::new(mesh).map(|result| self.compare(&result.0))
    }

    /// Returns the two-way RMS distance of a result, by this many samples in each direction; infinite if it
    /// has no face.
    pub(crate) fn rms(&self, mesh: &TriMesh, samples: usize) -> f64 {
        self.sampled(mesh, samples).map_or(f64::INFINITY, |found| found.rms.symmetric)
    }

    /// Measures a result by this many samples in each direction; `None` if it has no face.
    pub(crate) fn sampled(&self, mesh: &TriMesh, samples: usize) -> Option<Comparison> {
        let mut options = CompareOptions::default();
        (options.samples, options.seed) = (samples, self.seed);
        PreparedResult::new(mesh)
            .map(|PreparedResult(made)| compare_prepared(&self.reference, &made, &options))
    }

    fn compare(&self, result: &Prepared) -> Comparison {
        let mut options = CompareOptions::default();
        (options.samples, options.seed) = (self.samples, self.seed);
        compare_prepared(&self.reference, result, &options)
    }
}

/// Returns an upper bound of the distance of a surface from another, if it is proven to be at most `limit`.
fn proven(from: &Prepared, to: &Prepared, limit: f64) -> Option<f64> {
    match prove_within(from, to, limit) {
        WithinResult::Yes(bound) => Some(bound),
        _ => None,
    }
}
