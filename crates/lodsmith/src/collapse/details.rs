//! Details: small parts on larger ones of another colour, such as eyes, buckles and buttons.
//!
//! By distance alone they shrink to one triangle, because a small part is never far from its original
//! position. A part at least half as large as a face of the result is visible there, and keeps most of its
//! area. Smaller ones still shrink.

use glam::Vec3;
use lodsmith_core::VertexId;
use lodsmith_core::sorted::{indices_by_key, key_of};

use super::components::{Component, Details, measure_parts};
use super::ring::Ring;
use super::{Goal, LiveMesh};
use crate::cost::metric::Metric;

/// Minimum area of a detail, relative to a mean face of the result.
const MIN_DETAIL_FACES: f32 = 0.5;
/// Maximum area of a detail, relative to a mean face of the result: larger parts do not shrink away.
const MAX_DETAIL_FACES: f32 = 16.0;
/// Maximum share of the total area that all details have together. Otherwise they are the model.
const MAX_DETAIL_AREA_SHARE: f32 = 0.1;
/// Share of its area that a detail keeps. (A disc of eight corners has .9, one of six .83, a triangle .41.)
const MIN_KEPT_AREA_SHARE: f32 = 0.8;
/// Tolerance by which a detail may extend beyond the bounding box of the part that it lies on, as a share of
/// the detail's own box.
const BOX_TOLERANCE: f32 = 0.1;
/// Minimum ratio between the area of the part that a detail lies on and the area of the detail.
const MIN_CARRIER_AREA_RATIO: f32 = 4.0;
/// Number of largest parts that details may lie on, so that the search takes linear time.
const MAX_CARRIERS: usize = 64;
/// Difference in one channel, of 255, above which a detail has another colour than the part that it lies on.
const MIN_COLOR_CONTRAST: f32 = 40.0;

/// True if a part lies in the box of a larger one.
fn lies_on(part: &Component, other: &Component) -> bool {
    let slack = BOX_TOLERANCE * (part.max - part.min);
    let is_inside = (part.min + slack).cmpge(other.min).all() && (part.max - slack).cmple(other.max).all();
    is_inside && MIN_CARRIER_AREA_RATIO * part.area < other.area
}

impl<M: Metric> LiveMesh<M> {
    /// Finds the parts that may be details, before the first sweep. `colors` returns the mean colour of
    /// each part, if it has one, from the part of each number in the ordered input and the number of parts.
    /// Cost: O(n).
    pub(crate) fn init_details(&mut self, colors: impl FnOnce(&[u32], usize) -> Vec<Option<Vec3>>) {
        let labels = self.label_parts();
        let parts = labels.iter().copied().max().map_or(0, |m| m as usize + 1);
        if parts < 2 {
            return;
        }
        let extents = measure_parts(&labels, |w| self.store.p(w), &self.store.t);
        let mut part_of = vec![u32::MAX; self.store.merged_into.len()];
        for (x, &label) in self.store.v.iter().zip(&labels) {
            part_of[x.origin.index()] = label;
        }
        let colors = colors(&part_of, parts);
        let mut largest = indices_by_key(extents.iter().map(|x| !key_of(f64::from(x.area))));
        largest.truncate(MAX_CARRIERS);
        let are_apart = |i: usize, j: usize| match (colors[i], colors[j]) {
            (Some(a), Some(b)) => (a - b).abs().max_element() > MIN_COLOR_CONTRAST,
            _ => false,
        };
        let stands_out =
            |i: usize| largest.iter().any(|&j| lies_on(&extents[i], &extents[j]) && are_apart(i, j));
        let stands_out: Vec<bool> = (0..parts).map(stands_out).collect();
        if !stands_out.contains(&true) {
            return;
        }
        let area: Vec<f32> = extents.iter().map(|part| part.area).collect();
        let is_detail = vec![false; parts];
        self.constraints.details =
            Some(Box::new(Details { part_of, left: area.clone(), area, stands_out, is_detail }));
    }

    /// Selects the parts that are details for a goal.
    pub(super) fn find_details(&mut self, goal: &Goal) {
        let Some(details) = &mut self.constraints.details else { return };
        let faces = goal.faces.or(goal.vertices.map(|n| 2 * n)).unwrap_or(usize::MAX);
        let total: f32 = details.area.iter().sum();
        let face = total / faces as f32;
        let areas = || details.area.iter().zip(&details.stands_out);
        let is_detail = |(area, stands_out): (&f32, &bool)| {
            if *stands_out && (MIN_DETAIL_FACES * face..MAX_DETAIL_FACES * face).contains(area) {
                *area
            } else {
                0.0
            }
        };
        let found: Vec<f32> = areas().map(is_detail).collect();
        let are_few = found.iter().sum::<f32>() <= MAX_DETAIL_AREA_SHARE * total;
        details.is_detail = found.iter().map(|&area| are_few && area > 0.0).collect();
    }

    /// Returns the detail that a collapse of `v` into `u` at a position changes, if any, and the change of
    /// its area.
    pub(super) fn change_of_detail(
        &self,
        u: VertexId,
        v: VertexId,
        at: Vec3,
        [ru, rv]: [&Ring; 2],
    ) -> Option<(usize, f32)> {
        let details = self.constraints.details.as_ref()?;
        let part = *details.part_of.get(self.store.v[u.index()].origin.index())? as usize;
        if !*details.is_detail.get(part)? {
            return None;
        }
        let area = |p: Vec3, [a, b]: [VertexId; 2]| {
            let [a, b] = [a, b].map(|w| self.store.p(w) - p);
            a.cross(b).length()
        };
        let (at_u, at_v) = (self.store.p(u), self.store.p(v));
        let before = ru.iter().map(|r| area(at_u, [r.a, r.b]));
        let before = before.chain(rv.iter().filter(|r| !r.has(u)).map(|r| area(at_v, [r.a, r.b])));
        let stay = ru.iter().filter(|r| !r.has(v)).chain(rv.iter().filter(|r| !r.has(u)));
        Some((part, stay.map(|r| area(at, [r.a, r.b])).sum::<f32>() - before.sum::<f32>()))
    }

    /// True if a detail keeps enough of its area with this change.
    pub(super) fn keeps_detail(&self, (part, change): (usize, f32)) -> bool {
        let keeps =
            |d: &Details| change >= 0.0 || d.left[part] + change >= MIN_KEPT_AREA_SHARE * d.area[part];
        self.constraints.details.as_deref().is_none_or(keeps)
    }

    /// Applies a change to the area of a detail.
    pub(super) fn change_detail(&mut self, (part, change): (usize, f32)) {
        if let Some(details) = &mut self.constraints.details {
            details.left[part] += change;
        }
    }
}
