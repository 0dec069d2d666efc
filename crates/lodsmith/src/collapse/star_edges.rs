//! Special edges of a star: borders, seams between wedges or regions, sharp edges.

use std::collections::HashMap;

use lodsmith_core::{RegionId, VertexId, WedgeId};

use super::attributes::NO_WEDGE;
use super::kind::Kind;
use super::ring::{SHORT_RING, Spoke};
use super::store::Store;
use crate::cost::metric::VertexMemory;

/// Which lines no longer refuse collapses, because nothing else was left to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Looseness {
    /// All lines refuse.
    None,
    /// Sharp edges no longer refuse.
    Creases,
    /// Seams no longer refuse.
    Seams,
    /// Borders of regions no longer refuse either: a material may lose its last face.
    Regions,
}

impl Looseness {
    /// Returns the next step that changes anything, if there is one.
    pub(crate) fn looser(self, has_creases: bool, has_attributes: bool) -> Option<Self> {
        match self {
            Self::None if has_creases => Some(Self::Creases),
            Self::None | Self::Creases if has_attributes => Some(Self::Seams),
            Self::Seams => Some(Self::Regions),
            Self::None | Self::Creases | Self::Regions => None,
        }
    }
}

/// One side of an edge: its face, and the wedges of the face at both ends.
#[derive(Clone, Copy)]
pub(super) struct Side {
    pub(super) face: u32,
    pub(super) here: WedgeId,
    pub(super) there: WedgeId,
    /// [`NO_REGION`] if the mesh has no regions.
    pub(super) region: RegionId,
    /// True if the face comes before the edge in the order around this end.
    pub(super) ends: bool,
    /// True if the face marks the edge as sharp.
    pub(super) is_sharp: bool,
}

pub(super) const NO_REGION: RegionId = RegionId(u32::MAX);

/// An edge of a star.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    pub(super) to: VertexId,
    /// Index of its first occurrence in the faces of the star.
    pub(super) rank: u32,
    pub(super) faces: u32,
    pub(super) side: Side,
    /// The first other side that differs from it in wedges or regions.
    pub(super) other: Option<Side>,
}

impl Side {
    /// True if the edge is not an ordinary inner edge: wedges or regions differ, or it is a feature.
    pub(super) fn differs(&self, other: &Self) -> bool {
        self.is_other(other) || self.is_sharp || other.is_sharp
    }
    /// True if wedges or regions differ.
    pub(super) fn is_other(&self, other: &Self) -> bool {
        (self.here, self.there, self.region) != (other.here, other.there, other.region)
    }
}

impl<Q: VertexMemory> Store<Q> {
    /// Returns the class of a region: borders between classes are preserved exactly.
    pub(super) fn class(&self, region: RegionId) -> RegionId {
        self.classes.get(region.index()).copied().unwrap_or(region)
    }

    /// True if the classes of the regions on the sides of the edge from the centre of a star to `w` differ.
    pub(super) fn is_region_edge(&self, ring: &[Spoke], w: VertexId) -> bool {
        let Some(regions) = &self.regions else { return false };
        let mut sides = ring.iter().filter(|r| r.has(w)).map(|r| self.class(regions[r.corner.face()]));
        let first = sides.next();
        sides.any(|side| Some(side) != first)
    }

    /// True if the faces of a star belong to several regions.
    pub(crate) fn meets_regions(&self, ring: &[Spoke]) -> bool {
        self.meets(ring, |region| region)
    }

    /// True if the faces of a star belong to several classes of regions.
    pub(super) fn meets_classes(&self, ring: &[Spoke]) -> bool {
        self.meets(ring, |region| self.class(region))
    }

    pub(super) fn meets(&self, ring: &[Spoke], id_of: impl Fn(RegionId) -> RegionId) -> bool {
        let Some(regions) = &self.regions else { return false };
        let of = |r: &Spoke| id_of(regions[r.corner.face()]);
        ring.iter().any(|r| of(r) != of(&ring[0]))
    }

    /// Returns the side of the edge to the second or (`ends`) third corner of a face in a star.
    #[inline(always)]
    pub(super) fn side(&self, r: &Spoke, ends: bool) -> Side {
        const NEXT: [[usize; 3]; 2] = [[1, 2, 0], [2, 0, 1]];
        let (face, k) = (r.corner.face(), r.corner.k());
        let region = self.regions.as_ref().map_or(NO_REGION, |x| x[face]);
        let (here, there) = match &self.wedges {
            Some(wedges) => (wedges[face][k], wedges[face][NEXT[usize::from(ends)][k]]),
            None => (NO_WEDGE, NO_WEDGE),
        };
        Side { face: face as u32, here, there, region, ends, is_sharp: self.is_sharp(r.corner, !ends) }
    }

    /// Lists the special edges of a star, in the order in which its faces have them: edges that do not have
    /// exactly two faces, and edges whose sides differ. A regular kind means that the star is a closed fan.
    pub(super) fn edges(&self, ring: &[Spoke], kind: Kind, out: &mut Vec<Edge>) {
        out.clear();
        if !kind.is_regular() {
            return self.edges_of_any(ring, out);
        }
        let mut second_of = HashMap::new();
        if ring.len() > SHORT_RING {
            second_of.extend(ring.iter().enumerate().map(|(k, s)| (s.b, k)));
        }
        for (i, r) in ring.iter().enumerate() {
            // Every neighbour is also second in one face.
            let position = || ring.iter().position(|s| s.b == r.a);
            let Some(k) = second_of.get(&r.a).copied().or_else(position) else { continue };
            let (own, beyond) = (self.side(r, false), self.side(&ring[k], true));
            if own.differs(&beyond) {
                let (rank, side, other) =
                    if i <= k { (2 * i, own, beyond) } else { (2 * k + 1, beyond, own) };
                let rank = rank as u32;
                let at = out.iter().rposition(|e| e.rank < rank).map_or(0, |last| last + 1);
                out.insert(at, Edge { to: r.a, rank, faces: 2, side, other: Some(other) });
            }
        }
    }

    /// Lists the edges of a star that need not be a closed fan.
    #[inline(never)]
    pub(super) fn edges_of_any(&self, ring: &[Spoke], out: &mut Vec<Edge>) {
        let is_long = ring.len() > SHORT_RING;
        let mut place_of = HashMap::new();
        for (i, r) in ring.iter().enumerate() {
            for (to, ends) in [(r.a, false), (r.b, true)] {
                let side = self.side(r, ends);
                let known = match is_long {
                    true => {
                        let next = out.len();
                        out.get_mut(*place_of.entry(to).or_insert(next))
                    }
                    false => out.iter_mut().find(|e| e.to == to),
                };
                match known {
                    None => {
                        let rank = (2 * i + usize::from(ends)) as u32;
                        out.push(Edge { to, rank, faces: 1, side, other: None });
                    }
                    Some(e) => {
                        e.faces += 1;
                        if e.other.is_none() && e.side.differs(&side) {
                            e.other = Some(side);
                        }
                    }
                }
            }
        }
        out.retain(|e| e.faces != 2 || e.is_seam());
    }

    /// Returns the edge from the centre of a star to `w`.
    pub(super) fn edge(&self, ring: &[Spoke], w: VertexId) -> Option<Edge> {
        let mut sides = ring.iter().filter(|r| r.has(w)).map(|r| self.side(r, r.a != w));
        let side = sides.next()?;
        let mut edge = Edge { to: w, rank: 0, faces: 1, side, other: None };
        for other in sides {
            edge.faces += 1;
            edge.other = edge.other.or(Some(other).filter(|o| side.differs(o)));
        }
        Some(edge)
    }
}

impl Edge {
    /// True if wedges or regions differ on its sides, or it is sharp.
    pub(super) fn is_seam(&self) -> bool {
        self.other.is_some()
    }
    /// For an edge of one face, returns 1 if the face runs along it away from the centre of the star, else
    /// -1; 0 for other edges.
    pub(super) fn sense(&self) -> f64 {
        match (self.faces, self.side.ends) {
            (1, false) => 1.0,
            (1, true) => -1.0,
            _ => 0.0,
        }
    }
    /// True if it is one of the sharp edges that the options make features.
    pub(super) fn is_sharp(&self) -> bool {
        self.side.is_sharp || self.other.is_some_and(|other| other.is_sharp)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::collapse::ring::Ring;
    use crate::cost::tensor::Tensor;

    #[test]
    fn a_closed_fan_has_the_same_edges_as_any_star() {
        // Six triangles around vertex 0 in no particular order, starting at different corners, in three
        // charts.
        let points = vec![Vec3::ZERO; 7];
        let faces = [[0, 3, 4], [2, 0, 1], [5, 6, 0], [0, 6, 1], [3, 0, 2], [4, 5, 0]];
        let wedges = [[0, 3, 4], [12, 10, 11], [5, 6, 0], [20, 26, 21], [13, 10, 12], [4, 5, 0]];
        let (faces, wedges) =
            (faces.map(|t| t.map(VertexId)).to_vec(), wedges.map(|t| t.map(WedgeId)).to_vec());
        let mut store = Store::<Tensor>::new(&points, faces, Some(wedges), None);
        store.link();
        let (mut ring, mut edges, mut others) = (Ring::default(), Vec::new(), Vec::new());
        store.ring(VertexId(0), &mut ring);
        assert!(Kind::of(&ring, crate::options::BorderPolicy::Keep).is_regular());
        store.edges(&ring, Kind::default(), &mut edges);
        store.edges_of_any(&ring, &mut others);
        let sides = |e: &Edge| {
            let of = |s: Side| (s.face, s.here, s.there, s.ends);
            (e.to, e.rank, e.faces, of(e.side), e.other.map(of))
        };
        let all: Vec<_> = edges.iter().map(sides).collect();
        assert_eq!(all, others.iter().map(sides).collect::<Vec<_>>());
        assert_eq!(edges.iter().map(|e| e.to.0).collect::<Vec<_>>(), [3, 1, 6]);
    }
}
