//! Seams: edges whose two sides differ in wedges or regions. What they weigh, and what they refuse.

use lodsmith_core::{RegionId, VertexId, WedgeId};

use super::Engine;
use super::kind::{distinct, faces_at};
use super::store::{Ring, Spoke, Store};
use crate::metric::{Memory, Metric};
use crate::report::Refusal;

/// Weight of the line of a seam edge against the planes of faces: a seam that leaves its line shows what lies beyond the
/// chart. (Guessed, a fifth of a border's.)
pub(crate) const SEAM: f32 = 2.0;
/// The same for a soft seam: a crease of normals, or textures that go on much as they were on the other side.
const SOFT: f32 = 0.5;

/// Which lines no longer refuse, because nothing else was left to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Looseness {
    /// All hold.
    None,
    /// Seams give way.
    Seams,
    /// The borders of regions too: a material may lose its last face.
    Regions,
}

impl Looseness {
    /// The next step, if there is one.
    pub(crate) fn looser(self) -> Option<Self> {
        match self {
            Self::None => Some(Self::Seams),
            Self::Seams => Some(Self::Regions),
            Self::Regions => None,
        }
    }
}

/// One side of an edge: its face, and the wedges that it has at the ends.
#[derive(Clone, Copy)]
struct Side {
    face: usize,
    here: WedgeId,
    there: WedgeId,
    region: Option<RegionId>,
    /// Its class.
    class: Option<RegionId>,
    /// Whether the face ends at the edge, as seen from here.
    ends: bool,
}

impl Side {
    fn differs(&self, other: &Self) -> bool {
        (self.here, self.there, self.region) != (other.here, other.there, other.region)
    }
}

impl<Q: Memory> Store<Q> {
    /// The class of a region: between classes borders are exact.
    fn class(&self, region: RegionId) -> RegionId {
        self.classes.get(region.index()).copied().unwrap_or(region)
    }

    /// Whether classes of regions differ on the two sides of the edge from the centre of a star to `w`.
    fn is_region_edge(&self, ring: &[Spoke], w: VertexId) -> bool {
        let Some(regions) = &self.regions else { return false };
        let mut sides = ring.iter().filter(|r| r.has(w)).map(|r| self.class(regions[r.corner.face()]));
        let first = sides.next();
        sides.any(|side| Some(side) != first)
    }

    /// Whether faces of several regions meet in a star.
    pub(crate) fn meets_regions(&self, ring: &[Spoke]) -> bool {
        self.meets(ring, |region| region)
    }

    /// Whether faces of several classes of regions meet in a star.
    fn meets_classes(&self, ring: &[Spoke]) -> bool {
        self.meets(ring, |region| self.class(region))
    }

    fn meets(&self, ring: &[Spoke], name: impl Fn(RegionId) -> RegionId) -> bool {
        let Some(regions) = &self.regions else { return false };
        let of = |r: &Spoke| name(regions[r.corner.face()]);
        ring.iter().any(|r| of(r) != of(&ring[0]))
    }

    /// The first two sides of the edge from the centre of a star to `w` that differ in wedges or regions.
    fn sides(&self, ring: &[Spoke], w: VertexId) -> Option<[Side; 2]> {
        let wedges = self.wedges.as_ref()?;
        let mut first: Option<Side> = None;
        for r in ring.iter().filter(|r| r.has(w)) {
            let (face, k) = (r.corner.face(), r.corner.k());
            let other = if r.a == w { (k + 1) % 3 } else { (k + 2) % 3 };
            let region = self.regions.as_ref().map(|x| x[face]);
            let (here, there) = (wedges[face][k], wedges[face][other]);
            let side =
                Side { face, here, there, region, class: region.map(|r| self.class(r)), ends: r.a != w };
            match first {
                None => first = Some(side),
                Some(s) if s.differs(&side) => return Some([s, side]),
                Some(_) => {}
            }
        }
        None
    }

    /// Whether wedges or regions differ on the two sides of the edge from the centre of a star to `w`.
    pub(crate) fn is_seam_edge(&self, ring: &[Spoke], w: VertexId) -> bool {
        self.sides(ring, w).is_some()
    }
}

impl<M: Metric> Engine<M> {
    /// Weight of the line along the edge from the centre of a star to `w`; 0 for an edge inside.
    #[inline]
    pub(crate) fn line_weight(&self, ring: &[Spoke], w: VertexId, seams: bool) -> f32 {
        if faces_at(ring, w) != 2 {
            return self.rules.border_weight;
        }
        match self.store.sides(ring, w).filter(|_| seams) {
            Some(sides) if self.is_hard(&sides) => SEAM,
            Some(_) => SOFT,
            None => 0.0,
        }
    }

    /// Whether a seam parts regions, or has been hard from the start.
    fn is_hard(&self, [s, t]: &[Side; 2]) -> bool {
        if s.class != t.class {
            return true;
        }
        let Some(attributes) = &self.attributes else { return s.region == t.region };
        let here = |s: &Side| attributes.heads[s.here.index()].hard[usize::from(s.ends)];
        let there = |s: &Side| attributes.heads[s.there.index()].hard[usize::from(!s.ends)];
        (here(s) || here(t)) && (there(s) || there(t))
    }

    /// Marks the wedges of hard seams round a vertex: where texture coordinates jump farther than the faces on both sides
    /// reach, what lies beyond is another piece of the texture. A smaller jump is one between faces with the same
    /// piece each, as in palettes.
    pub(crate) fn mark_hard_seams(&mut self, ring: &[Spoke]) {
        let (Some(attributes), Some(wedges)) = (&mut self.attributes, &self.store.wedges) else { return };
        for w in distinct(ring) {
            let Some(sides) = self.store.sides(ring, w) else { continue };
            let reach = sides.iter().map(|s| attributes.reach(wedges[s.face])).fold(0f32, f32::max);
            let [s, t] = sides;
            if attributes.jump(s.here, t.here).max(attributes.jump(s.there, t.there)) > reach {
                for s in [s, t] {
                    attributes.heads[s.here.index()].hard[usize::from(s.ends)] = true;
                }
            }
        }
    }

    /// Whether seams and regions allow the collapse: two vertices on the borders of regions merge along one only, and no
    /// face goes that has lines on all sides. (Two vertices on other seams may merge across: their lines say at what
    /// cost. Refusing that too cost CesiumMan its limbs at 10 %, for nothing else was left.)
    pub(crate) fn ask_seams(&self, u: VertexId, v: VertexId, ru: &Ring, rv: &Ring) -> Result<(), Refusal> {
        let (ku, kv) = (self.store.v[u.index()].kind, self.store.v[v.index()].kind);
        if self.looseness == Looseness::Regions
            || !(ku.is_seam() || kv.is_seam())
            || !(ku.has_lines() && kv.has_lines())
        {
            return Ok(());
        }
        let is_line = |ring: &Ring, w| match self.looseness {
            Looseness::None => self.line_weight(ring, w, true) > SOFT,
            _ => faces_at(ring, w) != 2 || self.store.is_region_edge(ring, w),
        };
        if !is_line(ru, v) {
            let both = self.store.meets_classes(ru) && self.store.meets_classes(rv);
            return if both { Err(Refusal::Seam) } else { Ok(()) };
        }
        for r in ru.iter().filter(|r| r.has(v)) {
            let apex = if r.a == v { r.b } else { r.a };
            if is_line(ru, apex) && is_line(rv, apex) {
                return Err(Refusal::Seam);
            }
        }
        Ok(())
    }
}
