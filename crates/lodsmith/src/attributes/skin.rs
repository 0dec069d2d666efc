//! Joints and weights of wedges, from the attributes of a mesh, and positions of the joints.

use std::collections::BTreeMap;

use glam::DVec3;
use lodsmith_core::{Semantic, TriMesh, WedgeId};

use crate::collapse::attributes::JointWeights;

/// Joint weights are clamped to this, so that any number of them can be summed.
const MAX_JOINT_WEIGHT: f32 = 1e30;

/// Returns the weighted mean of the joint positions of each wedge. The position of a joint is the weighted
/// mean of its vertices. Empty without a skin.
pub(super) fn middles(mesh: &TriMesh, skin_sets: &[u8]) -> Vec<[f32; 3]> {
    if skin_sets.is_empty() {
        return Vec::new();
    }
    let view = mesh.positions().view();
    let of = |w: usize| joint_weights(mesh, skin_sets, WedgeId::new(w));
    let mut joints: BTreeMap<u32, (DVec3, f64)> = BTreeMap::new();
    for w in 0..mesh.wedge_count() {
        let place = DVec3::from(view.get(mesh.vertex_of(WedgeId::new(w))));
        for (joint, weight) in of(w).into_iter().filter(|_| place.is_finite()) {
            let sums = joints.entry(joint).or_default();
            *sums = (sums.0 + place * f64::from(weight), sums.1 + f64::from(weight));
        }
    }
    let middle = |w: usize| {
        let (mut sum, mut all) = (DVec3::ZERO, 0.0);
        for (joint, weight) in of(w) {
            if let Some((place, weights)) = joints.get(&joint) {
                sum += *place / *weights * f64::from(weight);
                all += f64::from(weight);
            }
        }
        if all > 0.0 { (sum / all).as_vec3().to_array() } else { [0.0; 3] }
    };
    (0..mesh.wedge_count()).map(middle).collect()
}

/// Returns the sets that have joints as well as weights.
pub(super) fn skin_sets(mesh: &TriMesh) -> Vec<u8> {
    let mut sets: BTreeMap<u8, (bool, bool)> = BTreeMap::new();
    for a in mesh.further_attributes().iter().filter(|a| a.width == 4) {
        match a.semantic {
            Semantic::Joints(set) => sets.entry(set).or_default().0 = true,
            Semantic::Weights(set) => sets.entry(set).or_default().1 = true,
            _ => {}
        }
    }
    sets.into_iter().filter(|(_, has)| has.0 && has.1).map(|x| x.0).collect()
}

/// Returns the joints of a wedge with their weights, the strongest first.
pub(super) fn joint_weights(mesh: &TriMesh, sets: &[u8], w: WedgeId) -> JointWeights {
    let mut joint_weights = JointWeights::new();
    for &set in sets {
        let of = |semantic: Semantic| mesh.further_attributes().iter().find(|a| a.semantic == semantic);
        let (Some(joints), Some(weights)) = (of(Semantic::Joints(set)), of(Semantic::Weights(set))) else {
            continue;
        };
        let weighted = joints.of(w).iter().zip(weights.of(w)).filter(|x| *x.1 > 0.0 && x.1.is_finite());
        for (&joint, weight) in weighted.map(|x| (x.0, x.1.min(MAX_JOINT_WEIGHT))) {
            match joint_weights.iter_mut().find(|p| p.0 == joint as u32) {
                Some(p) => p.1 += weight,
                None => joint_weights.push((joint as u32, weight)),
            }
        }
    }
    joint_weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    joint_weights
}
