//! Distance between a result and the input: measured by samples, and proven where a bound is guaranteed.

use std::sync::Arc;

use lodsmith_core::measure::proof::map::{LimitMap, MapSide};
use lodsmith_core::measure::proof::{
    WithinResult, bound_distance_until, prove_within_until, samples_within_until,
};
use lodsmith_core::measure::{
    CompareOptions, Comparison, EstimatedRms, Prepared, compare_prepared_until, rms_prepared_until,
};
use lodsmith_core::{FaceId, Surface, TriMesh};

use crate::SimplifyError;
use crate::control::{Control, ProgressShare, Stage, has_time_for, while_wanted};
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
    /// True if the caller ended the run before all was known.
    pub(crate) is_incomplete: bool,
}

/// Answer to the question whether a result is within a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Judgement {
    /// It is, and has this bound.
    Within(f64),
    /// It is not, or cannot be proven to be.
    Unproven,
    /// The caller ended the run before that was known.
    Unknown,
}

/// A test that asks from time to time whether to end, and returns `None` then.
type IsOver<'a> = &'a mut dyn FnMut() -> bool;

impl Judgement {
    fn of(known: Option<Option<f64>>) -> Self {
        match known {
            Some(Some(bound)) => Self::Within(bound),
            Some(None) => Self::Unproven,
            None => Self::Unknown,
        }
    }

    /// The proven bound, if there is one.
    pub(crate) fn bound(self) -> Option<f64> {
        match self {
            Self::Within(bound) => Some(bound),
            Self::Unproven | Self::Unknown => None,
        }
    }
}

impl Deviation {
    /// Returns what is known of a result that the caller left no time to measure.
    pub(crate) fn unknown() -> Self {
        Self { is_incomplete: true, ..Self::default() }
    }

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

/// Measures results of one input, if more than their estimates is asked for. `comparer` prepares the input.
pub(crate) fn measured(
    options: &SimplifyOptions,
    results: &[&TriMesh],
    comparer: impl FnOnce(&mut dyn Control) -> Option<InputComparer>,
    control: &mut dyn Control,
) -> Result<Vec<Deviation>, SimplifyError> {
    let count = results.len();
    if !needs_measurement(options) {
        return Ok(vec![Deviation::default(); count]);
    }
    if !has_time_for(Stage::Measure, control)? {
        return Ok(vec![Deviation::unknown(); count]);
    }
    let Some(comparer) = comparer(control) else { return Ok(vec![Deviation::default(); count]) };
    let measure = |(i, mesh)| comparer.measure(mesh, None, &mut ProgressShare::of(control, i, count));
    results.iter().copied().enumerate().map(measure).collect()
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

    /// Returns true if a result stays within a distance at a few fixed points, the same for all distances; false
    /// too if the caller ends the run. Otherwise never false where [`Self::proven_within`] finds a bound.
    pub(crate) fn passes_spot_check(
        &self,
        result: &PreparedResult,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<bool, SimplifyError> {
        Ok(while_wanted(control, |is_over| self.spot_check(result, limit, is_over))? == Some(true))
    }

    fn spot_check(
        &self,
        PreparedResult(result): &PreparedResult,
        limit: f64,
        is_over: IsOver<'_>,
    ) -> Option<bool> {
        let map = self.map_of(limit);
        let (to, from) = (map.as_ref().map(MapSide::To), map.as_ref().map(MapSide::From));
        let is_near = samples_within_until(result, &self.reference, limit, to, is_over)?;
        if !is_near || !self.is_two_sided() {
            return Some(is_near);
        }
        samples_within_until(&self.reference, result, limit, from, is_over)
    }

    /// Tests whether the result stays within `limit`, in the sense of the guarantee.
    pub(crate) fn proven_within(
        &self,
        result: &PreparedResult,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Judgement, SimplifyError> {
        Ok(Judgement::of(while_wanted(control, |is_over| self.bound_within(result, limit, is_over))?))
    }

    /// Returns an upper bound on the distance if the result stays within `limit`.
    fn bound_within(&self, result: &PreparedResult, limit: f64, is_over: IsOver<'_>) -> Option<Option<f64>> {
        if self.promised == Bound::Estimate {
            let seen = self.compare(&result.0, self.samples, is_over)?.hausdorff.symmetric;
            return Some((seen <= limit && self.spot_check(result, limit, is_over)?).then_some(seen));
        }
        let map = self.map_of(limit);
        let (to, from) = (map.as_ref().map(MapSide::To), map.as_ref().map(MapSide::From));
        let bound_of = |proof| if let WithinResult::Yes(bound) = proof { Some(bound) } else { None };
        // The direction from the result is usually quicker to prove.
        let back = prove_within_until(&result.0, &self.reference, limit, to, is_over)?;
        let Some(back) = bound_of(back).filter(|_| self.is_two_sided()) else { return Some(bound_of(back)) };
        let forward = prove_within_until(&self.reference, &result.0, limit, from, is_over)?;
        Some(bound_of(forward).map(|forward| forward.max(back)))
    }

    /// Returns [`Self::proven_within`] of a mesh, after a check at a few points.
    pub(crate) fn proven_within_mesh(
        &self,
        mesh: &TriMesh,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<Judgement, SimplifyError> {
        let Some(made) = PreparedResult::new(mesh) else { return Ok(Judgement::Unproven) };
        Ok(Judgement::of(while_wanted(control, |is_over| {
            if self.spot_check(&made, limit, is_over)? {
                self.bound_within(&made, limit, is_over)
            } else {
                Some(None)
            }
        })?))
    }

    /// Measures a result, and proves a bound if one is guaranteed. `known` is a bound proven before.
    pub(crate) fn measure(
        &self,
        mesh: &TriMesh,
        known: Option<f64>,
        control: &mut dyn Control,
    ) -> Result<Deviation, SimplifyError> {
        match PreparedResult::new(mesh) {
            Some(result) => self.measure_prepared(&result, known, control),
            None => Ok(Deviation::default()),
        }
    }

    pub(crate) fn measure_prepared(
        &self,
        PreparedResult(result): &PreparedResult,
        known: Option<f64>,
        control: &mut dyn Control,
    ) -> Result<Deviation, SimplifyError> {
        let without = Deviation { bound: known, ..Deviation::unknown() };
        let Some(measured) = while_wanted(control, |is_over| self.compare(result, self.samples, is_over))?
        else {
            return Ok(without);
        };
        let seen = &measured.hausdorff;
        let (count, seen_of_all) = match self.promised {
            Bound::Estimate => return Ok(Deviation { measured: Some(measured), ..Deviation::default() }),
            Bound::OneSided => (1, seen.backward),
            Bound::Auto | Bound::TwoSided => (2, seen.symmetric),
        };
        let directions =
            [(result, &*self.reference, seen.backward), (&*self.reference, result, seen.forward)];
        let bound = known.filter(|known| *known <= MAX_KNOWN_BOUND_RATIO * seen_of_all);
        let bound = match bound {
            Some(bound) => Some(bound),
            None => while_wanted(control, |is_over| {
                let mut bound = 0f64;
                for (from, to, seen) in &directions[..count] {
                    bound = bound.max(bound_distance_until(from, to, *seen, BOUND_TOLERANCE, is_over)?.bound);
                }
                Some(known.map_or(bound, |known| known.min(bound)))
            })?,
        };
        let measured = Some(measured);
        Ok(match bound {
            Some(_) => Deviation { measured, bound, is_incomplete: false },
            // (A bound that is known is proven, too.)
            None => Deviation { measured, is_incomplete: known.is_none(), ..without },
        })
    }

    /// Measures a result by samples; `None` if it has no face, or the caller ends the run.
    pub(crate) fn measured(
        &self,
        mesh: &TriMesh,
        control: &mut dyn Control,
    ) -> Result<Option<Comparison>, SimplifyError> {
        self.sampled(mesh, self.samples, control)
    }

    /// Returns the two-way RMS distance of a result, by this many samples in each direction; `None` if the caller
    /// ends the run.
    pub(crate) fn rms(
        &self,
        PreparedResult(made): &PreparedResult,
        samples: usize,
        control: &mut dyn Control,
    ) -> Result<Option<EstimatedRms>, SimplifyError> {
        let options = self.sampling(samples);
        while_wanted(control, |is_over| rms_prepared_until(&self.reference, made, &options, is_over))
    }

    /// Measures a result by this many samples in each direction; `None` if it has no face, or the caller ends the
    /// run.
    pub(crate) fn sampled(
        &self,
        mesh: &TriMesh,
        samples: usize,
        control: &mut dyn Control,
    ) -> Result<Option<Comparison>, SimplifyError> {
        let Some(PreparedResult(made)) = PreparedResult::new(mesh) else { return Ok(None) };
        while_wanted(control, |is_over| self.compare(&made, samples, is_over))
    }

    fn compare(&self, result: &Prepared, samples: usize, is_over: IsOver<'_>) -> Option<Comparison> {
        compare_prepared_until(&self.reference, result, &self.sampling(samples), is_over)
    }

    fn sampling(&self, samples: usize) -> CompareOptions {
        let mut options = CompareOptions::default();
        (options.samples, options.seed) = (samples, self.seed);
        options
    }
}
