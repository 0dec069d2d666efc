//! Codec of vertex splits, relative to the ring of the vertex that is split.
//!
//! ```text
//!      x               x          corners of the ring go over to the new vertex v or stay at u; where they
//!    / | \           / | \        change sides, at an edge to some x, a new face (u, x, v) stands
//!   a  u  b   ->    a  u--v b
//!    \ | /           \ | /
//! ```
//!
//! Changes that do not follow this pattern are coded by index, anywhere in the mesh: every split can be
//! coded. The base mesh is coded as the split of an empty one.

mod fields;

use super::level_mesh::{LevelMesh, Ring, SplitChanges};
use super::range::{BelowModel, BitModel, Coded, Coder, Damaged, NumberModel};
use super::values::PlaceCode;

/// Number of channels of rows with their own model; further ones share the last. Guessed: two morph targets.
const CHANNEL_MODELS: usize = 32;

/// Predicted displacement of the new vertex from the old one, as a share of the vector between the centres of
/// both parts of the ring. On a regular mesh it is half an edge away, and the centres are 1.4 edges apart.
const PREDICTED_SHARE: f64 = 0.36;

/// Properties that all splits share.
#[derive(Clone, Copy, Debug)]
pub(super) struct SplitFormat {
    pub(super) has_vertex_map: bool,
    pub(super) has_regions: bool,
    pub(super) channels: usize,
    pub(super) places: PlaceCode,
}

/// Models of changed elements that are coded by index.
#[derive(Default)]
struct IndexModels {
    count: NumberModel,
    gap: NumberModel,
}

/// All adaptive models.
struct Models {
    born: [NumberModel; 3],
    has_focus: BitModel,
    focus: BelowModel,
    owner_moves: [BitModel; 2],
    owner_is_new: BitModel,
    owners: IndexModels,
    vertex: [BitModel; 8],
    any_vertex: BelowModel,
    goes: Vec<BitModel>,
    goes_twice: BitModel,
    target: [[BitModel; 4]; 2],
    born_wedge: BelowModel,
    any_wedge: BelowModel,
    corners: IndexModels,
    face: [[BitModel; 8]; 3],
    turn: [[BitModel; 4]; 2],
    is_plain: BitModel,
    mend: [[BitModel; 4]; 3],
    far_wedge: [[BitModel; 8]; 3],
    back: NumberModel,
    is_same_region: BitModel,
    region: NumberModel,
    near: [Vec<NumberModel>; 2],
    far: [NumberModel; 6],
    moves: [BitModel; 2],
    moved: IndexModels,
    rows: Vec<[NumberModel; 2]>,
    row_changes: BitModel,
    changed: IndexModels,
}

impl Default for Models {
    fn default() -> Self {
        Self {
            born: Default::default(),
            has_focus: BitModel::default(),
            focus: BelowModel::default(),
            owner_moves: Default::default(),
            owner_is_new: BitModel::default(),
            owners: IndexModels::default(),
            vertex: Default::default(),
            any_vertex: BelowModel::default(),
            goes: vec![BitModel::default(); RUN_CONTEXTS * TURN_CONTEXTS * SIZE_CONTEXTS * 2],
            goes_twice: BitModel::default(),
            target: Default::default(),
            born_wedge: BelowModel::default(),
            any_wedge: BelowModel::default(),
            corners: IndexModels::default(),
            face: Default::default(),
            turn: Default::default(),
            is_plain: BitModel::default(),
            mend: Default::default(),
            far_wedge: Default::default(),
            back: NumberModel::default(),
            is_same_region: BitModel::default(),
            region: NumberModel::default(),
            near: [vec![NumberModel::default(); 65], vec![NumberModel::default(); 65]],
            far: Default::default(),
            moves: Default::default(),
            moved: IndexModels::default(),
            rows: vec![Default::default(); CHANNEL_MODELS],
            row_changes: BitModel::default(),
            changed: IndexModels::default(),
        }
    }
}

// Context of a corner: how many before it went to the same side, how often the side has changed, the size of
// the ring, and the side of the last corner.
const RUN_CONTEXTS: usize = 8;
const TURN_CONTEXTS: usize = 4;
const SIZE_CONTEXTS: usize = 13;

/// A face that may be created at an edge of the ring.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    wedges: [u32; 3],
    /// The wedge of x on the other side of the edge.
    other: u32,
    /// An adjacent face.
    beside: u32,
}

/// Codec of a sequence of splits.
pub(super) struct SplitCodec {
    shape: SplitFormat,
    models: Box<Models>,
    ring: Ring,
    /// Wedge of each corner of the ring after the split, and true if it is no longer at the old vertex.
    after: Vec<(u32, bool)>,
    candidates: Vec<Candidate>,
    /// New wedges, each with the old one whose corners it took.
    parents: Vec<(u32, u32)>,
    targets: RecentTargets,
}

/// Wedges that corners went to.
#[derive(Default)]
struct RecentTargets {
    /// The last few pairs of old and new wedge.
    last: Vec<(u32, u32)>,
    used: u32,
}

/// Counts before and after a step.
#[derive(Clone, Copy)]
struct StepCounts {
    faces: [u32; 2],
    wedges: [u32; 2],
    vertices: [u32; 2],
}

impl SplitCodec {
    pub(super) fn new(shape: SplitFormat) -> Self {
        Self {
            shape,
            models: Box::default(),
            ring: Ring::default(),
            after: Vec::new(),
            candidates: Vec::new(),
            parents: Vec::new(),
            targets: RecentTargets::default(),
        }
    }

    /// Codes the step from the mesh of the walk to the next: `want` is used for writing; `got` is the result
    /// in both cases.
    ///
    /// # Errors
    /// [`Damaged`], only when reading.
    pub(super) fn code<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        got.clear();
        let span = self.code_counts(c, walk, want)?;
        let focus = self.focus(c, walk, want)?;
        if focus.is_none_or(|u| !walk.ring(u, &mut self.ring)) {
            self.ring.corners.clear();
            self.ring.fans.clear();
            self.ring.wedges.clear();
        }
        if self.shape.has_vertex_map {
            self.owners(c, span, want, got)?;
            self.vertices_of(c, focus, span, want, got)?;
        }
        self.corners(c, walk, focus, span, want, got)?;
        self.find_candidates(span, got);
        self.faces(c, walk, span, want, got)?;
        self.places(c, walk, focus, span, want, got)?;
        self.rows(c, walk, span, want, got)
    }

    fn code_counts<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        want: &SplitChanges,
    ) -> Coded<StepCounts> {
        let before = walk.counts();
        let models = &mut self.models.born;
        let faces = c.count(&mut models[0], want.faces.len())?;
        let vertices = c.count(&mut models[2], want.places.len())?;
        let wedges = match self.shape.has_vertex_map {
            true => c.count(&mut models[1], want.vertex_of.len())?,
            false => vertices,
        };
        let span = |before: u32, more: usize, times: u64| {
            let after = u64::from(before) + more as u64;
            // The largest number is reserved.
            let fits = after * times < u64::from(u32::MAX);
            fits.then_some([before, after as u32]).ok_or(Damaged("more elements than numbers can name"))
        };
        Ok(StepCounts {
            faces: span(before.faces, faces, 3)?,
            wedges: span(before.wedges, wedges, 1)?,
            vertices: span(before.vertices, vertices, 1)?,
        })
    }

    /// Codes the vertex that is split.
    fn focus<C: Coder>(&mut self, c: &mut C, walk: &LevelMesh, want: &SplitChanges) -> Coded<Option<u32>> {
        let of_wedge = |w: u32| walk.vertex_of[w as usize];
        let by_corner = want.corners.first().map(|x| of_wedge(walk.corner(x.0)));
        let by_owner = || want.owners.first().map(|x| of_wedge(x.0));
        let focus = by_corner.or_else(by_owner).or_else(|| want.moved.first().map(|x| x.0));
        if !c.bit(&mut self.models.has_focus, focus.is_some())? {
            return Ok(None);
        }
        c.below(&mut self.models.focus, walk.places.len() as u32, focus.unwrap_or(0)).map(Some)
    }

    /// Codes the wedges that go to another vertex.
    fn owners<C: Coder>(
        &mut self,
        c: &mut C,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let models = &mut *self.models;
        let mut last = false;
        for &w in &self.ring.wedges {
            let to = find(&want.owners, w);
            last = c.bit(&mut models.owner_moves[usize::from(last)], to.is_some())?;
            if last {
                let to = to.unwrap_or(0);
                let is_new = c.bit(&mut models.owner_is_new, to == span.vertices[0])?;
                let to = if is_new {
                    span.vertices[0]
                } else {
                    c.below(&mut models.any_vertex, span.vertices[1], to)?
                };
                if to >= span.vertices[1] {
                    return Err(Damaged("a wedge goes to a vertex that is not there"));
                }
                got.owners.push((w, to));
            }
        }
        let rest = want.owners.iter().filter(|o| self.ring.wedges.binary_search(&o.0).is_err());
        let rest: Vec<_> = rest.copied().collect();
        let mut at = 0;
        for i in 0..c.count(&mut models.owners.count, rest.len())? {
            let (w, to) = rest.get(i).copied().unwrap_or_default();
            let w = code_gap(c, &mut models.owners.gap, &mut at, w, span.wedges[0])?;
            got.owners.push((w, c.below(&mut models.any_vertex, span.vertices[1], to)?));
        }
        got.owners.sort_by_key(|o| o.0);
        Ok(())
    }

    /// Codes the vertices of new wedges.
    fn vertices_of<C: Coder>(
        &mut self,
        c: &mut C,
        focus: Option<u32>,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let models = &mut *self.models;
        let mut last = span.vertices[0].wrapping_sub(1);
        for i in 0..(span.wedges[1] - span.wedges[0]) as usize {
            let vertex = want.vertex_of.get(i).copied().unwrap_or(0);
            let known = [span.vertices[0], focus.unwrap_or(u32::MAX), last.wrapping_add(1), last];
            let way = known.iter().position(|&k| k == vertex && k < span.vertices[1]).unwrap_or(4);
            let way = c.tree(&mut models.vertex, 3, way as u32)?;
            last = match known.get(way as usize) {
                Some(&known) => known,
                None => c.below(&mut models.any_vertex, span.vertices[1], vertex)?,
            };
            if last >= span.vertices[1] {
                return Err(Damaged("a wedge is born to a vertex that is not there"));
            }
            got.vertex_of.push(last);
        }
        Ok(())
    }

    /// Codes the corners that go to another wedge: those of the ring first, then any.
    fn corners<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        focus: Option<u32>,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let models = &mut *self.models;
        self.targets.last.clear();
        self.targets.used = 0;
        self.after.clear();
        self.parents.clear();
        let owner = |got: &SplitChanges, w: u32| match w.checked_sub(span.wedges[0]) {
            None => find(&got.owners, w).unwrap_or(walk.vertex_of[w as usize]),
            Some(_) if !self.shape.has_vertex_map => w,
            Some(born) => got.vertex_of[born as usize],
        };
        let size = self.ring.corners.len().min(SIZE_CONTEXTS - 1);
        let (mut run, mut turns, mut last) = (0, 0, false);
        for x in &self.ring.corners {
            let to = find(&want.corners, x.corner);
            let is_gone = Some(owner(got, x.wedge)) != focus;
            let model = match is_gone {
                true => &mut models.goes_twice,
                false => {
                    &mut models.goes
                        [((size * TURN_CONTEXTS + turns) * RUN_CONTEXTS + run) * 2 + usize::from(last)]
                }
            };
            let mut now = x.wedge;
            if c.bit(model, to.is_some())? {
                now = self.targets.code(c, models.target_models(0), span, x.wedge, to.unwrap_or(0))?;
                got.corners.push((x.corner, now));
            }
            let goes = Some(owner(got, now)) != focus;
            if goes == last {
                run = (run + 1).min(RUN_CONTEXTS - 1);
            } else {
                (run, turns) = (0, (turns + 1).min(TURN_CONTEXTS - 1));
            }
            last = goes;
            self.after.push((now, goes));
        }
        let mut told: Vec<u32> = self.ring.corners.iter().map(|x| x.corner).collect();
        told.sort_unstable();
        let rest = want.corners.iter().filter(|x| told.binary_search(&x.0).is_err());
        let rest: Vec<_> = rest.copied().collect();
        let mut at = 0;
        for i in 0..c.count(&mut models.corners.count, rest.len())? {
            let (corner, to) = rest.get(i).copied().unwrap_or_default();
            let corner = code_gap(c, &mut models.corners.gap, &mut at, corner, span.faces[0] * 3)?;
            let to = self.targets.code(c, models.target_models(1), span, walk.corner(corner), to)?;
            got.corners.push((corner, to));
        }
        let born = got.corners.iter().filter(|x| x.1 >= span.wedges[0]);
        self.parents.extend(born.map(|x| (x.1 - span.wedges[0], walk.corner(x.0))));
        self.parents.sort_by_key(|p| p.0);
        self.parents.dedup_by_key(|p| p.0);
        got.corners.sort_by_key(|x| x.0);
        Ok(())
    }

    /// Finds the faces that follow the pattern.
    fn find_candidates(&mut self, span: StepCounts, got: &SplitChanges) {
        self.candidates.clear();
        let ring = &self.ring.corners;
        // The wedge opposite an open end: a new one, or the old one if that stays behind.
        let opposite = |i: usize| {
            let (old, (now, goes)) = (ring[i].wedge, self.after[i]);
            if goes && now != old && find(&got.owners, old).is_none() { old } else { span.wedges[0] }
        };
        let mut begin = 0;
        for &(end, is_closed) in &self.ring.fans {
            let (first, last) = (begin, end - 1);
            let add = |list: &mut Vec<Candidate>, i: usize, j: usize| {
                list.push(Candidate {
                    wedges: [self.after[i].0, ring[i].last, self.after[j].0],
                    other: ring[j].next,
                    beside: ring[i].corner / 3,
                });
            };
            if !is_closed {
                let x = ring[first].next;
                let wedges = [opposite(first), x, self.after[first].0];
                self.candidates.push(Candidate { wedges, other: x, beside: ring[first].corner / 3 });
            }
            for i in first..last {
                if self.after[i].1 != self.after[i + 1].1 {
                    add(&mut self.candidates, i, i + 1);
                }
            }
            if is_closed && self.after[last].1 != self.after[first].1 {
                add(&mut self.candidates, last, first);
            }
            if !is_closed {
                let x = ring[last].last;
                let wedges = [self.after[last].0, x, opposite(last)];
                self.candidates.push(Candidate { wedges, other: x, beside: ring[last].corner / 3 });
            }
            begin = end;
        }
    }

    fn faces<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let mut seen = 0;
        let mut region = walk.regions.last().copied().unwrap_or(0);
        for i in 0..(span.faces[1] - span.faces[0]) as usize {
            let face = want.faces.get(i).copied().unwrap_or_default();
            let mut told = None;
            if !self.candidates.is_empty() {
                // Seven candidates, or none.
                let known = self.candidates.iter().take(7).position(|x| turn_of(x, face).is_some());
                let way = c.tree(&mut self.models.face[i.min(2)], 3, known.unwrap_or(7) as u32)? as usize;
                if way < 7 {
                    if way >= self.candidates.len() {
                        return Err(Damaged("a face is born at an edge that is not there"));
                    }
                    told = Some(self.candidates.remove(way));
                }
            }
            let now = match &told {
                Some(candidate) => self.near_face(c, candidate, i, span, face)?,
                None => self.far_face(c, got.faces.last(), seen, span, face)?,
            };
            let newest = now.iter().filter_map(|w| w.checked_sub(span.wedges[0])).max();
            seen = newest.map_or(seen, |n| seen.max(n + 1));
            got.faces.push(now);
            if self.shape.has_regions {
                let own = want.regions.get(i).copied().unwrap_or(0);
                region = told.map_or(region, |t| walk.regions[t.beside as usize]);
                if !c.bit(&mut self.models.is_same_region, own == region)? {
                    let told = c.number(&mut self.models.region, u64::from(own))?;
                    region = u32::try_from(told).map_err(|_| Damaged("a region of no number"))?;
                }
                got.regions.push(region);
            }
        }
        Ok(())
    }

    /// Codes a face at an edge of the ring: its first corner, and differences from the prediction.
    fn near_face<C: Coder>(
        &mut self,
        c: &mut C,
        candidate: &Candidate,
        i: usize,
        span: StepCounts,
        face: [u32; 3],
    ) -> Coded<[u32; 3]> {
        let models = &mut *self.models;
        let turn = turn_of(candidate, face).unwrap_or(0);
        let turn = c.tree(&mut models.turn[i.min(1)], 2, turn as u32)? as usize;
        let mut foreseen = candidate.wedges;
        // Three is not a valid rotation and is read as none.
        foreseen.rotate_left(turn % 3);
        if c.bit(&mut models.is_plain, face == foreseen)? {
            return check_face(foreseen, span);
        }
        let mut now = [0; 3];
        for k in 0..3 {
            let of_picture = (k + turn) % 3;
            let ways = [foreseen[k], candidate.other];
            let way = ways.iter().position(|&w| w == face[k]).unwrap_or(match face[k] >= span.wedges[0] {
                true => 2,
                false => 3,
            });
            let way = c.tree(&mut models.mend[of_picture], 2, way as u32)?;
            now[k] = models.code_wedge(c, way, ways, span, face[k])?;
        }
        check_face(now, span)
    }

    /// Codes a face by indices.
    fn far_face<C: Coder>(
        &mut self,
        c: &mut C,
        last: Option<&[u32; 3]>,
        seen: u32,
        span: StepCounts,
        face: [u32; 3],
    ) -> Coded<[u32; 3]> {
        let models = &mut *self.models;
        let mut now = [0u32; 3];
        let newest = span.wedges[0] + seen;
        for k in 0..3 {
            // The wedges of the last face are known, if there is one.
            let [a, b, d] = last.copied().unwrap_or([u32::MAX; 3]);
            let mut next = newest;
            // A face may be the first to use several wedges.
            for &w in &now[..k] {
                next = next.max(w.saturating_add(1));
            }
            let known = [next, a, b, d];
            let way = known.iter().position(|&w| w == face[k] && w < span.wedges[1]);
            let is_born = face[k] >= span.wedges[0] && face[k] < next;
            let way = way.unwrap_or(if is_born { 4 } else { 5 });
            let way = c.tree(&mut models.far_wedge[k], 3, way as u32)? as usize;
            now[k] = match (known.get(way), way) {
                (Some(&known), _) => known,
                (None, 4) => {
                    let back =
                        c.number(&mut models.back, u64::from(next.wrapping_sub(face[k]).wrapping_sub(1)))?;
                    let back = u32::try_from(back).ok().and_then(|b| next.checked_sub(b)?.checked_sub(1));
                    back.ok_or(Damaged("a face names a wedge before the first"))?
                }
                _ => c.below(&mut models.any_wedge, span.wedges[1], face[k])?,
            };
            check_face([now[k]; 3], span)?;
        }
        Ok(now)
    }
}

impl Models {
    /// Returns the models of the wedges that corners go to, in the ring or outside of it.
    fn target_models(&mut self, i: usize) -> (&mut [BitModel; 4], &mut BelowModel, &mut BelowModel) {
        (&mut self.target[i], &mut self.born_wedge, &mut self.any_wedge)
    }
    fn code_wedge<C: Coder>(
        &mut self,
        c: &mut C,
        way: u32,
        ways: [u32; 2],
        span: StepCounts,
        wedge: u32,
    ) -> Coded<u32> {
        match way {
            0 | 1 => Ok(ways[way as usize]),
            2 => {
                let born = wedge.wrapping_sub(span.wedges[0]);
                Ok(span.wedges[0] + c.below(&mut self.born_wedge, span.wedges[1] - span.wedges[0], born)?)
            }
            _ => c.below(&mut self.any_wedge, span.wedges[1], wedge),
        }
    }
}

impl RecentTargets {
    /// Codes the wedge that a corner goes to: the one that an earlier corner of the same wedge went to, the
    /// next new one, any new one, or any.
    fn code<C: Coder>(
        &mut self,
        c: &mut C,
        (ways, born_wedge, any_wedge): (&mut [BitModel; 4], &mut BelowModel, &mut BelowModel),
        span: StepCounts,
        old: u32,
        to: u32,
    ) -> Coded<u32> {
        let same = self.last.iter().rev().find(|x| x.0 == old).map(|x| x.1);
        let next = span.wedges[0] + self.used;
        let way = match to {
            _ if same == Some(to) => 0,
            _ if to == next && next < span.wedges[1] => 1,
            _ if to >= span.wedges[0] => 2,
            _ => 3,
        };
        let now = match (c.tree(ways, 2, way)?, same) {
            (0, Some(same)) => same,
            (1, _) => next,
            (2, _) => {
                let born = span.wedges[1] - span.wedges[0];
                span.wedges[0] + c.below(born_wedge, born, to.wrapping_sub(span.wedges[0]))?
            }
            (_, _) => c.below(any_wedge, span.wedges[1], to)?,
        };
        if now >= span.wedges[1] {
            return Err(Damaged("a corner goes to a wedge that is not there"));
        }
        if let Some(born) = now.checked_sub(span.wedges[0]) {
            self.used = self.used.max(born + 1);
        }
        // Guessed: splits hardly ever have more wedges.
        if self.last.len() == 8 {
            self.last.remove(0);
        }
        self.last.push((old, now));
        Ok(now)
    }
}

/// Returns the rotation that turns a candidate into a face, apart from wedges across the edge.
fn turn_of(candidate: &Candidate, face: [u32; 3]) -> Option<usize> {
    let is_near = |k: usize, w: u32| candidate.wedges[k] == w || (k == 1 && candidate.other == w);
    (0..3).find(|&turn| (0..3).all(|k| is_near((k + turn) % 3, face[k]))).or_else(|| {
        // On a seam, two matching corners of three suffice.
        (0..3).find(|&turn| (0..3).filter(|&k| is_near((k + turn) % 3, face[k])).count() == 2)
    })
}

fn check_face(face: [u32; 3], span: StepCounts) -> Coded<[u32; 3]> {
    match face.iter().all(|&w| w < span.wedges[1]) {
        true => Ok(face),
        false => Err(Damaged("a face names a wedge that is not there")),
    }
}

fn find(list: &[(u32, u32)], at: u32) -> Option<u32> {
    list.binary_search_by_key(&at, |x| x.0).ok().map(|i| list[i].1)
}

/// Codes the next of ascending numbers.
fn code_gap<C: Coder>(c: &mut C, model: &mut NumberModel, at: &mut u32, wanted: u32, end: u32) -> Coded<u32> {
    let gap = c.number(model, u64::from(wanted.wrapping_sub(*at)))?;
    match u64::from(*at).checked_add(gap).filter(|&now| now < u64::from(end)) {
        None => Err(Damaged("a change of what is not there")),
        Some(now) => {
            *at = now as u32 + 1;
            Ok(now as u32)
        }
    }
}
