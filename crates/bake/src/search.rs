//! The point of the detailed surface that belongs to a point of the lighter one.

use glam::DVec3;
use lodsmith_core::spatial::Crossing;

use crate::flat::Flat;
use crate::link::{Cage, Link};
use crate::source::{Source, SourcePoint};

/// A sample on the lighter surface. The weights may be negative: beyond the edge of a chart the face is extended in its
/// plane, so that filtering across the edge reads matching values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) face: usize,
    pub(crate) weights: [f64; 3],
}

impl Sample {
    fn is_inside(&self) -> bool {
        self.weights.iter().all(|&w| w >= 0.0)
    }
}

/// Returns the reach of the cage at a sample: inwards, and outwards.
fn reach(sample: &Sample, cages: &[Cage; 3]) -> [f64; 2] {
    let (mut outwards, mut inwards) = (0.0, 0.0);
    for (cage, weight) in cages.iter().zip(sample.weights) {
        let weight = weight.clamp(0.0, 1.0);
        outwards += cage.outwards * weight;
        inwards += cage.inwards * weight;
    }
    [inwards, outwards]
}

/// Counts of how source points were found, for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// On a face that both surfaces share.
    pub by_correspondence: usize,
    /// By a ray within the cage.
    pub by_ray: usize,
    /// As the closest point of the corresponding parts.
    pub by_distance: usize,
    /// On any part, as nothing else was found.
    pub elsewhere: usize,
}

impl Found {
    pub(crate) fn add(&mut self, other: &Self) {
        self.by_correspondence += other.by_correspondence;
        self.by_ray += other.by_ray;
        self.by_distance += other.by_distance;
        self.elsewhere += other.elsewhere;
    }
}

pub(crate) struct Search<'a> {
    pub(crate) source: &'a Source<'a>,
    pub(crate) light: &'a Flat,
    pub(crate) link: &'a Link,
}

impl Search<'_> {
    /// Finds the source of a sample: on the face that both surfaces share, else where a ray along the cage meets the
    /// detailed surface, else at the closest point.
    pub(crate) fn find(
        &self,
        sample: &Sample,
        crossings: &mut Vec<Crossing>,
        found: &mut Found,
    ) -> Option<SourcePoint> {
        let weights = sample.weights;
        let blend = |v: [DVec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        let point = blend(self.light.corners(sample.face));
        let cages = &self.link.cages[sample.face];
        let [a, b, c] = cages;
        let direction = blend([a.direction, b.direction, c.direction]).normalize_or(a.direction);
        if let Some(same) = self.link.same_faces[sample.face].filter(|_| sample.is_inside()) {
            let at = |k: usize| (0..3).map(|c| weights[c] * same.weights[c][k]).sum::<f64>().max(0.0);
            let mut at = SourcePoint { face: same.face, weights: [at(0), at(1), at(2)], height: 0.0 };
            at.height = (self.source.point(&at) - point).dot(direction);
            found.by_correspondence += 1;
            return Some(at);
        }
        if let Some(at) = self.by_ray(sample, point, direction, cages, crossings) {
            found.by_ray += 1;
            return Some(at);
        }
        self.by_distance(sample, point, direction, cages, found)
    }

    fn by_ray(
        &self,
        sample: &Sample,
        point: DVec3,
        direction: DVec3,
        cages: &[Cage; 3],
        crossings: &mut Vec<Crossing>,
    ) -> Option<SourcePoint> {
        let [inwards, outwards] = reach(sample, cages);
        let (from, to) = (point - direction * inwards, point + direction * outwards);
        crossings.clear();
        self.source.tree.crossings(from.to_array(), to.to_array(), |c| {
            if self.link.may_take(sample.face, c.face.index()) {
                crossings.push(c);
            }
            true
        });
        crossings.sort_unstable_by(|a, b| a.along.total_cmp(&b.along).then(a.face.cmp(&b.face)));
        let height = |c: &Crossing| c.along * (inwards + outwards) - inwards;
        // The ray runs outwards: it leaves the body through the back of a face. The nearest such crossing is the
        // surface itself. Faces that touch it without a gap (a rivet, a decal) cover it; a face that the ray enters
        // from the front is another wall or fold.
        let leaves = (0..crossings.len()).filter(|&i| !crossings[i].is_front);
        let mut at =
            leaves.min_by(|&a, &b| height(&crossings[a]).abs().total_cmp(&height(&crossings[b]).abs()))?;
        while let Some(next) = crossings.get(at + 1).filter(|c| !c.is_front) {
            debug_assert!(next.along >= crossings[at].along, "crossings are sorted");
            at += 1;
        }
        let c = &crossings[at];
        Some(SourcePoint { face: c.face.index(), weights: c.weights, height: height(c) })
    }

    fn by_distance(
        &self,
        sample: &Sample,
        point: DVec3,
        direction: DVec3,
        cages: &[Cage; 3],
        found: &mut Found,
    ) -> Option<SourcePoint> {
        let tree = &self.source.tree;
        let fits = |face: usize| {
            self.link.may_take(sample.face, face) && self.source.face_normal(face).dot(direction) > 0.0
        };
        let nearest = tree.closest(point.to_array())?;
        let mut hit = nearest;
        if fits(nearest.face.index()) {
            found.by_distance += 1;
        } else {
            // Only nearby: a far search is expensive, and finds unrelated points.
            let reach = cages.iter().map(|c| c.outwards.max(c.inwards)).fold(0.0, f64::max) * 4.0;
            match tree.closest_of_within(point.to_array(), reach, |f| fits(f.index())) {
                Some(other) => {
                    hit = other;
                    found.by_distance += 1;
                }
                None => found.elsewhere += 1,
            }
        }
        let corners = self.source.flat.corners(hit.face.index());
        let there = DVec3::from(hit.point);
        let weights = lodsmith_core::geometry::triangle::weights_at(there, corners);
        let mut height = (there - point).dot(direction);
        if !sample.is_inside() {
            // The extension of a face that is narrow in the map reaches far beyond the surface within a
            // texel.
            let [inwards, outwards] = reach(sample, cages);
            height = height.max(-inwards).min(outwards);
        }
        Some(SourcePoint { face: hit.face.index(), weights, height })
    }
}
