//! Surface extraction from signs at grid points: one vertex per cell, one quad per edge whose ends differ, as
//! in dual contouring [Ju et al. 2002].
//!
//! The boundary of a set of grid points is manifold if no face of a cell has alternating corners and no two
//! opposite corners of a cell are isolated [Latecki 1997]. Points are added first until the set has this
//! property.

use std::collections::HashMap;

use lodsmith_core::VertexId;

/// Integer coordinates of a grid point or cell; a cell has the coordinates of its lowest corner.
pub(super) type GridCoord = [i32; 3];

/// Offsets of the corners of a cell; bit k of the index is the step along axis k.
pub(super) const CORNERS: [GridCoord; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// The faces of a cell: corners in cyclic order, and the offset of the cell beyond.
pub(super) const SIDES: [([usize; 4], GridCoord); 6] = [
    ([0, 2, 6, 4], [-1, 0, 0]),
    ([1, 3, 7, 5], [1, 0, 0]),
    ([0, 1, 5, 4], [0, -1, 0]),
    ([2, 3, 7, 6], [0, 1, 0]),
    ([0, 1, 3, 2], [0, 0, -1]),
    ([4, 5, 7, 6], [0, 0, 1]),
];

pub(super) fn plus(a: GridCoord, b: GridCoord) -> GridCoord {
    [0, 1, 2].map(|k| a[k] + b[k])
}

/// Returns the corners of a cell, as bits, that must be added to make it unambiguous; 0 if it is already.
pub(super) fn disambiguating_corners(mask: u8) -> u8 {
    let mut mask = mask;
    let before = mask;
    loop {
        let now = mask;
        for (side, _) in SIDES {
            let bit = |k: usize| mask >> side[k] & 1;
            if bit(0) == bit(2) && bit(1) == bit(3) && bit(0) != bit(1) {
                side.iter().for_each(|&c| mask |= 1 << c);
            }
        }
        for c in 0..4u8 {
            let pair = 1 << c | 1 << (7 - c);
            if mask == pair || mask == !pair {
                mask = 0xFF;
            }
        }
        if mask == now {
            return mask & !before;
        }
    }
}

/// Returns the quads between points whose signs differ, indexing the sorted cells as vertices.
///
/// `cells` are all cells that the surface passes through, sorted.
pub(super) fn quads(cells: &[GridCoord], is_inside: &HashMap<GridCoord, bool>) -> Vec<[VertexId; 4]> {
    let number = |c: GridCoord| VertexId::new(cells.partition_point(|x| *x < c));
    let mut quads = Vec::new();
    for &cell in cells {
        for axis in 0..3 {
            // Visits each edge once, from the cell that has it as its lowest edge. The other three cells
            // around the edge lie below.
            let mut end = cell;
            end[axis] += 1;
            let (a, b) = (is_inside[&cell], is_inside[&end]);
            if a == b {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let below = |du: i32, dv: i32| {
                let mut c = cell;
                (c[u], c[v]) = (c[u] - du, c[v] - dv);
                number(c)
            };
            let round = [below(1, 1), below(0, 1), below(0, 0), below(1, 0)];
            let [p, q, r, s] = round;
            quads.push(if a { round } else { [s, r, q, p] });
        }
    }
    quads
}

#[cfg(test)]
mod tests {
    use lodsmith_core::topology::Topology;
    use lodsmith_core::{PositionsView, Surface};

    use super::*;

    #[test]
    fn cells_without_ambiguity_are_unchanged() {
        assert_eq!(
            (
                disambiguating_corners(0),
                disambiguating_corners(0xFF),
                disambiguating_corners(1),
                disambiguating_corners(0b1111)
            ),
            (0, 0, 0, 0)
        );
        // Opposite corners of a face, and of the cell.
        assert_ne!(disambiguating_corners(0b1001), 0);
        assert_ne!(disambiguating_corners(1 | 1 << 7), 0);
        for mask in 0..=u8::MAX {
            assert_eq!(disambiguating_corners(mask | disambiguating_corners(mask)), 0, "{mask:b}");
        }
    }

    /// Surface of random signs in a box of n³ points, disambiguated as in a run.
    fn surface_of(seed: u64, share: u64, n: i32) -> Vec<[VertexId; 3]> {
        let mut state = seed;
        let mut signs = HashMap::new();
        let mut all = Vec::new();
        for x in -3..n + 3 {
            for y in -3..n + 3 {
                for z in -3..n + 3 {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    let is_in = [x, y, z].iter().all(|&k| (0..n).contains(&k));
                    signs.insert([x, y, z], is_in && (state >> 40) % 100 < share);
                    if [x, y, z].iter().all(|&k| k < n + 2) {
                        all.push([x, y, z]);
                    }
                }
            }
        }
        let mask = |signs: &HashMap<GridCoord, bool>, c: GridCoord| {
            (0..8).fold(0u8, |m, k| m | u8::from(signs[&plus(c, CORNERS[k])]) << k)
        };
        loop {
            let before = signs.clone();
            for &c in &all {
                let more = disambiguating_corners(mask(&signs, c));
                for k in (0..8).filter(|k| more >> k & 1 == 1) {
                    signs.insert(plus(c, CORNERS[k]), true);
                }
            }
            if signs == before {
                break;
            }
        }
        let mut cells: Vec<GridCoord> =
            all.into_iter().filter(|&c| !matches!(mask(&signs, c), 0 | 0xFF)).collect();
        cells.sort_unstable();
        quads(&cells, &signs).into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
    }

    #[test]
    fn any_signs_give_a_closed_oriented_manifold() {
        for seed in 0..400u64 {
            let faces = surface_of(seed, 2 + seed % 60, 3 + (seed % 4) as i32);
            let count = faces.as_flattened().iter().map(|v| v.index() + 1).max().unwrap_or(0);
            let places: Vec<[f64; 3]> = (0..count).map(|i| [i as f64, 0.0, 0.0]).collect();
            let surface = Surface::new(PositionsView::F64(&places), &faces).unwrap();
            let counts = Topology::unwelded(&surface).counts();
            assert!(faces.is_empty() || counts.is_closed(), "{seed} {counts:?}");
            assert!(counts.is_manifold() && counts.is_oriented(), "{seed} {counts:?}");
        }
    }
}
