//! Melax metric: length times curvature, with placement at vertices of the input. [Melax 1998]
//!
//! The collapse of u onto v costs |uv| · max over the faces f of u, min over the faces g on uv, of (1 −
//! f·g) / 2: the largest turn of the faces of u away from the faces on the edge. Unlike in the article, a
//! vertex on a border (or another feature edge) moves only along it, and the turn of the border there counts
//! like a turn of faces; the article covers closed surfaces only.

use glam::{DVec3, Vec3};

use super::{
    AllowedPlace, CostSource, Dimension, EdgeNeighbourhood, EdgePart, NeighbourhoodMetric, StarTriangle,
};

pub(crate) const MELAX: NeighbourhoodMetric = NeighbourhoodMetric {
    cost_source: CostSource::Stars,
    evaluate: |around, _| evaluate(around),
    // The cost falls with the density of triangles to the power 1.5 on a smooth surface, and 0.5 on a rough
    // one.
    cost_factor_exponent: 0.4,
    squared_rms_factor: 1.0,
    dimension: Dimension { length: 1, face: 0 },
    // As much as the collapse of an edge as long as the part itself, between faces at right angles.
    part_cost_per_face_pair: |_, part, _| 0.5 * part.cost_factor * part.size_sq.sqrt(),
};

/// Weight of length alone against curvature: breaks ties among flat places only. (Normals in single
/// precision are not more precise.)
const LENGTH_TIE: f64 = 1e-7;
/// Maximum number of faces on an edge that are used.
const MAX_SIDES: usize = 4;

/// Returns the cost of removing the cheaper of the two ends, or the only removable one, and the
/// displacement to the other.
fn evaluate(around: &EdgeNeighbourhood) -> Option<(f32, Vec3)> {
    let length = around.d.length();
    let [kept, removed] = turns(around).map(|turn| turn.map(|t| (length * (t + LENGTH_TIE)) as f32));
    let onto_kept = removed.map(|cost| (cost, Vec3::ZERO));
    let onto_removed = kept.map(|cost| (cost, around.d.as_vec3()));
    match (around.place, onto_kept, onto_removed) {
        (AllowedPlace::Kept, onto, _) | (AllowedPlace::Removed, _, onto) => onto,
        (_, Some(a), Some(b)) if b.0 < a.0 => Some(b),
        (_, a, b) => a.or(b),
    }
}

/// Returns the turn of the stars of both ends away from the edge, from 0 to 1; `None` for an end that must
/// not be removed.
fn turns(around: &EdgeNeighbourhood) -> [Option<f64>; 2] {
    let normal = |w: &StarTriangle| (w.b - w.a).cross(around.end(w.at) - w.a).normalize_or_zero();
    // Two, except at borders and non-manifold edges.
    let (mut sides, mut count) = ([DVec3::ZERO; MAX_SIDES], 0);
    for w in around.triangles.iter().filter(|w| w.at == EdgePart::Both).take(MAX_SIDES) {
        sides[count] = normal(w);
        count += 1;
    }
    // For each star, the least cosine of a face with its best matching side.
    let mut least = [1f64; 2];
    for w in around.triangles.iter().filter(|w| w.at != EdgePart::Both) {
        let n = normal(w);
        let nearest = sides[..count].iter().fold(-1.0, |most, s| f64::max(most, n.dot(*s)));
        let of_end = &mut least[usize::from(w.at == EdgePart::Removed)];
        *of_end = of_end.min(nearest);
    }
    [EdgePart::Kept, EdgePart::Removed].map(|end| {
        let i = usize::from(end == EdgePart::Removed);
        let turn = 0.5 - 0.5 * least[i];
        if around.on_lines[i] { Some(turn.max(turn_of_line(around, end)?)) } else { Some(turn) }
    })
}

/// Returns the turn of the feature edges at an end away from the edge; `None` if the edge is not a feature
/// edge.
fn turn_of_line(around: &EdgeNeighbourhood, end: EdgePart) -> Option<f64> {
    if !around.is_line() {
        return None;
    }
    let here = around.end(end);
    let onward = (around.d - here - here).normalize_or_zero();
    let others = around.lines.iter().filter(|l| l.at == end);
    Some(others.fold(0.0, |most, line| {
        let back = (here - line.to).normalize_or_zero();
        f64::max(most, line.weight.min(1.0) * (0.5 - 0.5 * back.dot(onward)))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::metric::FeatureLine;

    /// A flat strip along x with its ends at (0, 0, 0) and (1, 0, 0); `tip` is the far corner beyond the
    /// kept end.
    fn strip(tip: DVec3) -> EdgeNeighbourhood {
        let d = DVec3::X;
        let wall = |at, a, b| StarTriangle { at, a, b };
        EdgeNeighbourhood {
            d,
            place: AllowedPlace::Ends,
            triangles: vec![
                wall(EdgePart::Both, d, DVec3::Y),
                wall(EdgePart::Both, -DVec3::Y, d),
                wall(EdgePart::Kept, DVec3::Y, tip),
                wall(EdgePart::Kept, tip, -DVec3::Y),
                wall(EdgePart::Removed, DVec3::new(2.0, 0.0, 0.0), DVec3::Y),
                wall(EdgePart::Removed, -DVec3::Y, DVec3::new(2.0, 0.0, 0.0)),
            ],
            ..EdgeNeighbourhood::default()
        }
    }

    #[test]
    fn the_end_whose_faces_do_not_turn_is_removed() {
        //      Y           The kept end has steep faces; the removed one lies flat.
        //    / | \
        // tip--0---d--2
        //    \ | /
        //     -Y
        let (cost, step) = evaluate(&strip(DVec3::new(-1.0, 0.0, 1.0))).unwrap();
        assert_eq!(step, Vec3::ZERO);
        assert!(cost <= 2.0 * LENGTH_TIE as f32, "{cost}");
        let (cost, step) = evaluate(&EdgeNeighbourhood {
            place: AllowedPlace::Removed,
            ..strip(DVec3::new(-1.0, 0.0, 1.0))
        })
        .unwrap();
        // Their normals are (1, 0, 1) / √2, half a right angle off z.
        assert_eq!(step, Vec3::X);
        assert!((f64::from(cost) - (0.5 - 0.5 / 2f64.sqrt())).abs() < 1e-6, "{cost}");
    }

    #[test]
    fn border_vertices_move_along_the_border_and_pay_for_its_turn() {
        let mut around = strip(-DVec3::X);
        around.on_lines = [true, false];
        around.lines =
            vec![FeatureLine { at: EdgePart::Kept, to: DVec3::new(0.0, 1.0, 0.0), weight: 1.0, sense: 1.0 }];
        assert_eq!(evaluate(&EdgeNeighbourhood { place: AllowedPlace::Removed, ..around.clone() }), None);
        // The edge itself is on the border, which turns by a right angle at the kept end.
        around.lines.push(FeatureLine { at: EdgePart::Both, to: around.d, weight: 1.0, sense: -1.0 });
        around.on_lines = [true, true];
        let (cost, step) = evaluate(&EdgeNeighbourhood { place: AllowedPlace::Removed, ..around }).unwrap();
        assert_eq!(step, Vec3::X);
        assert!((cost - 0.5).abs() < 1e-6, "{cost}");
    }
}
