//! Codec of vertex splits, relative to the ring of the vertex that is split.
//!
//! ```text
//!      x               x          corners of the ring move to the new vertex v or stay at u; where they
//!    / | \           / | \        change sides, at an edge to some x, a new face (u, x, v) is added
//!   a  u  b   ->    a  u--v b
//!    \ | /           \ | /
//! ```
//!
//! Changes that do not follow this pattern are coded by index, anywhere in the mesh: every split can be
//! coded. The base mesh is coded as the split of an empty one.

use super::level_mesh::{LevelMesh, RingCorner, SplitChanges};
use super::streams::{Coded, Damaged, NO_ELEMENT, Streams};

// The streams of a chunk of splits; the first one holds the low bits.
const NEW_FACES: usize = 1;
const NEW_VERTICES: usize = 2;
const NEW_WEDGES: usize = 3;
const FOCUS: usize = 4;
const OWNER_CHANGES: usize = 5;
const OWNERS: usize = 6;
const VERTICES: usize = 7;
const CORNER_CHANGES: usize = 8;
const CORNERS: usize = 9;
const FACES: usize = 10;
const FACE_WEDGES: usize = 11;
const REGIONS: usize = 12;
const FIRST_PLACES: usize = 13;
const OTHER_PLACES: usize = 14;
const MOVES: usize = 15;
const MOVED_PLACES: usize = 16;
const OTHERS: usize = 17;
const ROW_CHANGES: usize = 18;
/// Two for each channel.
const ROWS: usize = 19;

/// Number of wedges near a face that a single byte can distinguish: 6 · 6 · 6 is below 256.
const NEAR_WEDGES: usize = 6;
/// Marks a face that has other wedges.
const FAR_FACE: u8 = 216;

/// Properties that all splits share.
#[derive(Clone, Copy, Debug)]
pub(super) struct SplitFormat {
    pub(super) has_vertex_map: bool,
    pub(super) has_regions: bool,
    pub(super) channels: usize,
}

/// Codec of a split: the ring of its vertex, and the part of the split coded so far.
struct StepCodec<'a> {
    shape: SplitFormat,
    io: &'a mut Streams,
    mesh: &'a LevelMesh,
    want: &'a SplitChanges,
    /// The vertex that is split.
    focus: Option<u32>,
    ring: Vec<RingCorner>,
    /// The wedges of the ring, ascending.
    ring_wedges: Vec<u32>,
    /// Counts before and after the step.
    faces: [u32; 2],
    wedges: [u32; 2],
    vertices: [u32; 2],
}

/// Codes the step from a mesh to the next: `want` is used for writing; the result is the step in both cases.
///
/// # Errors
/// [`Damaged`], only when reading.
pub(super) fn code_step(
    shape: SplitFormat,
    io: &mut Streams,
    mesh: &LevelMesh,
    want: &SplitChanges,
) -> Coded<SplitChanges> {
    let mut got = SplitChanges::default();
    let mut step = StepCodec::begin(shape, io, mesh, want)?;
    if shape.has_vertex_map {
        step.owners(&mut got)?;
    }
    step.corners(&mut got)?;
    step.faces(&mut got)?;
    step.places(&mut got)?;
    if shape.channels > 0 {
        step.rows(&mut got)?;
    }
    Ok(got)
}

impl<'a> StepCodec<'a> {
    /// Codes the number of new elements, and the vertex that is split.
    fn begin(
        shape: SplitFormat,
        io: &'a mut Streams,
        mesh: &'a LevelMesh,
        want: &'a SplitChanges,
    ) -> Coded<Self> {
        let before = mesh.counts();
        let faces = io.count(NEW_FACES, want.faces.len())?;
        let vertices = io.count(NEW_VERTICES, want.places.len())?;
        let wedges = match shape.has_vertex_map {
            true => io.count(NEW_WEDGES, want.vertex_of.len())?,
            false => vertices,
        };
        let span = |before: u32, more: usize, times: u64| {
            let after = u64::from(before) + more as u64;
            // The largest number is reserved.
            let fits = after * times < u64::from(u32::MAX);
            fits.then_some([before, after as u32])
                .ok_or(Damaged("more elements than 32-bit numbers can count"))
        };
        // The wanted focus, plus one.
        let of_wedge = |w: u32| mesh.vertex_of[w as usize] + 1;
        let by_corner = want.corners.first().map(|x| of_wedge(mesh.corner(x.0)));
        let by_owner = || want.owners.first().map(|x| of_wedge(x.0));
        let focus = by_corner.or_else(by_owner).or_else(|| want.moved.first().map(|x| x.0 + 1));
        let focus = io.number(FOCUS, focus.unwrap_or(0).into())?;
        let focus =
            u32::try_from(focus).ok().filter(|&u| u <= before.vertices).ok_or(NO_ELEMENT)?.checked_sub(1);
        let (ring, ring_wedges) = focus.map(|u| mesh.ring(u)).unwrap_or_default();
        Ok(Self {
            shape,
            mesh,
            want,
            focus,
            ring,
            ring_wedges,
            faces: span(before.faces, faces, 3)?,
            wedges: span(before.wedges, wedges, 1)?,
            vertices: span(before.vertices, vertices, 1)?,
            io,
        })
    }

    /// Codes which elements change: a mark for each of some near elements, and the indices of others.
    fn changes(
        &mut self,
        stream: usize,
        near: &[u32],
        want: impl Iterator<Item = u32>,
        count: u32,
    ) -> Coded<Vec<u32>> {
        let (mut wanted, others): (Vec<u32>, Vec<u32>) = want.partition(|w| near.binary_search(w).is_ok());
        let mut got = Vec::new();
        for &n in near {
            let is_next = wanted.first() == Some(&n);
            if is_next {
                wanted.remove(0);
            }
            if self.io.flag(stream, is_next)? {
                got.push(n);
            }
        }
        let others = self.io.ascending(OTHERS, &others, count)?;
        if !others.is_empty() {
            got.extend(others);
            got.sort_unstable();
            got.dedup();
        }
        Ok(got)
    }

    /// Codes the wedges that go to another vertex, and the vertices of new ones.
    fn owners(&mut self, got: &mut SplitChanges) -> Coded<()> {
        let [new, end] = self.vertices;
        let near = std::mem::take(&mut self.ring_wedges);
        let want = self.want;
        for w in self.changes(OWNER_CHANGES, &near, want.owners.iter().map(|o| o.0), self.wedges[0])? {
            let to = find(&want.owners, w).unwrap_or(0);
            got.owners.push((w, self.io.element(OWNERS, to, new, end)?));
        }
        self.ring_wedges = near;
        let mut last = new.wrapping_sub(1);
        for i in 0..(self.wedges[1] - self.wedges[0]) as usize {
            let vertex = want.vertex_of.get(i).copied().unwrap_or(0);
            let known = [new, self.focus.unwrap_or(end), last.wrapping_add(1), last];
            let way = known.iter().position(|&k| k == vertex).map_or(u64::from(vertex) + 4, |way| way as u64);
            let way = self.io.number(VERTICES, way)?;
            let vertex = known.get(way as usize).copied().map_or(way.wrapping_sub(4), u64::from);
            last = u32::try_from(vertex).ok().filter(|&v| v < end).ok_or(NO_ELEMENT)?;
            got.vertex_of.push(last);
        }
        Ok(())
    }

    /// Codes the corners that go to another wedge.
    fn corners(&mut self, got: &mut SplitChanges) -> Coded<()> {
        let near: Vec<u32> = self.ring.iter().map(|x| x.corner).collect();
        let want = self.want;
        for c in self.changes(CORNER_CHANGES, &near, want.corners.iter().map(|x| x.0), self.faces[0] * 3)? {
            let to = find(&want.corners, c).unwrap_or(0);
            got.corners.push((c, self.io.element(CORNERS, to, self.wedges[0], self.wedges[1])?));
        }
        Ok(())
    }

    /// Returns the vertex of a wedge after the step.
    fn vertex_after(&self, w: u32, got: &SplitChanges) -> u32 {
        match w.checked_sub(self.wedges[0]) {
            None => find(&got.owners, w).unwrap_or(self.mesh.vertex_of[w as usize]),
            Some(_) if !self.shape.has_vertex_map => w,
            Some(new) => got.vertex_of[new as usize],
        }
    }

    /// Returns the wedges that new faces probably have: wedges at edges of the ring where sides change,
    /// wedges at its open ends, and the first new wedge.
    fn near_wedges(&self, got: &SplitChanges) -> Vec<u32> {
        let mut near = Vec::new();
        let add = |wedges: &[u32], near: &mut Vec<u32>| {
            for &w in wedges {
                if near.len() < NEAR_WEDGES && !near.contains(&w) {
                    near.push(w);
                }
            }
        };
        let after: Vec<(u32, bool)> = self
            .ring
            .iter()
            .map(|x| {
                let now = find(&got.corners, x.corner).unwrap_or(x.wedge);
                (now, Some(self.vertex_after(now, got)) != self.focus)
            })
            .collect();
        let vertex = |w: u32| self.mesh.vertex_of[w as usize];
        let follows = |c: &RingCorner, d: &RingCorner| vertex(c.last) == vertex(d.next);
        for goes in [false, true] {
            for (c, now) in self.ring.iter().zip(&after).filter(|x| x.1.1 == goes) {
                let next = self.ring.iter().zip(&after).find(|(d, _)| follows(c, d));
                if let Some((d, then)) = next.filter(|x| x.1.1 != goes) {
                    add(&[now.0, c.last, then.0, d.next], &mut near);
                }
            }
        }
        for (c, now) in self.ring.iter().zip(&after) {
            if !self.ring.iter().any(|d| follows(c, d)) {
                add(&[now.0, c.last], &mut near);
            }
            if !self.ring.iter().any(|d| follows(d, c)) {
                add(&[now.0, c.next], &mut near);
            }
        }
        if self.focus.is_some() {
            add(&[self.wedges[0]], &mut near);
            self.ring_wedges.iter().for_each(|&w| add(&[w], &mut near));
        }
        near
    }

    fn faces(&mut self, got: &mut SplitChanges) -> Coded<()> {
        let near = self.near_wedges(got);
        let mut region = self.mesh.regions.last().copied().unwrap_or(0);
        // One more than the highest wedge so far.
        let mut next = self.wedges[0];
        for i in 0..(self.faces[1] - self.faces[0]) as usize {
            let wanted = self.want.faces.get(i).copied().unwrap_or_default();
            let ways = wanted.map(|w| near.iter().position(|&n| n == w));
            let byte = match ways {
                [Some(a), Some(b), Some(c)] => (a + NEAR_WEDGES * (b + NEAR_WEDGES * c)) as u8,
                _ => FAR_FACE,
            };
            let byte = usize::from(self.io.byte(FACES, byte)?);
            let mut face = [0; 3];
            for (k, w) in face.iter_mut().enumerate() {
                *w = if byte < usize::from(FAR_FACE) {
                    let way = byte / NEAR_WEDGES.pow(k as u32) % NEAR_WEDGES;
                    near.get(way).copied().filter(|&w| w < self.wedges[1]).ok_or(NO_ELEMENT)?
                } else {
                    self.io.element(FACE_WEDGES, wanted[k], next, self.wedges[1])?
                };
                next = next.max(*w + 1);
            }
            got.faces.push(face);
            if self.shape.has_regions {
                let beside = self.ring.iter().find(|x| face.contains(&x.next) || face.contains(&x.last));
                region = beside.map_or(region, |x| self.mesh.regions[x.corner as usize / 3]);
                let wanted = self.want.regions.get(i).copied().unwrap_or(0);
                region = self.io.element(REGIONS, wanted, region, u32::MAX)?;
                got.regions.push(region);
            }
        }
        Ok(())
    }

    fn place(&mut self, stream: usize, predicted: [i64; 3], want: Option<&[i64; 3]>) -> Coded<[i64; 3]> {
        let mut now = predicted;
        for k in 0..3 {
            let by = want.map_or(0, |w| w[k].wrapping_sub(predicted[k]));
            now[k] = now[k].wrapping_add(self.io.signed(stream, by)?);
        }
        Ok(now)
    }

    /// Codes the positions of new and of moved vertices.
    fn places(&mut self, got: &mut SplitChanges) -> Coded<()> {
        let (mesh, want) = (self.mesh, self.want);
        for i in 0..(self.vertices[1] - self.vertices[0]) as usize {
            let (stream, predicted) = match (self.focus, i) {
                (Some(u), 0) => (FIRST_PLACES, mesh.places[u as usize]),
                _ => (OTHER_PLACES, got.places.last().or(mesh.places.last()).copied().unwrap_or_default()),
            };
            let place = self.place(stream, predicted, want.places.get(i))?;
            got.places.push(place);
            if !self.shape.has_vertex_map {
                got.vertex_of.push(self.vertices[0] + i as u32);
            }
        }
        let near: Vec<u32> = self.focus.into_iter().collect();
        for v in self.changes(MOVES, &near, want.moved.iter().map(|m| m.0), self.vertices[0])? {
            let old = mesh.places[v as usize];
            let (stream, predicted) = match got.places.first() {
                // The old position is about midway between the two.
                Some(new) if Some(v) == self.focus => {
                    (MOVED_PLACES, [0, 1, 2].map(|k| old[k].wrapping_mul(2).wrapping_sub(new[k])))
                }
                _ => (OTHER_PLACES, old),
            };
            let wanted = want.moved.binary_search_by_key(&v, |m| m.0).ok().map(|i| &want.moved[i].1);
            let place = self.place(stream, predicted, wanted)?;
            got.moved.push((v, place));
        }
        Ok(())
    }

    /// Codes the rows of new and of changed wedges.
    fn rows(&mut self, got: &mut SplitChanges) -> Coded<()> {
        let (mesh, want, channels) = (self.mesh, self.want, self.shape.channels);
        let row = |rows: &[i32], i: usize| rows.get(i * channels..(i + 1) * channels).map(<[i32]>::to_vec);
        // New wedges, each with the old wedge whose first corner it took, and vice versa.
        let new = got.corners.iter().filter(|x| x.1 >= self.wedges[0]);
        let mut parents: Vec<(u32, u32)> = new.map(|&(c, to)| (to, mesh.corner(c))).collect();
        parents.sort_by_key(|p| p.0);
        parents.dedup_by_key(|p| p.0);
        let mut children: Vec<(u32, u32)> = parents.iter().map(|&(new, old)| (old, new)).collect();
        children.sort_by_key(|p| p.0);
        children.dedup_by_key(|p| p.0);
        for i in 0..(self.wedges[1] - self.wedges[0]) as usize {
            let parent = find(&parents, self.wedges[0] + i as u32).or(self.ring_wedges.first().copied());
            let predicted = match parent {
                Some(w) => row(&mesh.rows, w as usize),
                None if i > 0 => row(&got.rows, i - 1),
                None => (self.wedges[0] as usize).checked_sub(1).and_then(|w| row(&mesh.rows, w)),
            };
            let predicted = predicted.unwrap_or_else(|| vec![0; channels]);
            self.row(0, &predicted, row(&want.rows, i), &mut got.rows)?;
        }
        let near = std::mem::take(&mut self.ring_wedges);
        got.changed = self.changes(ROW_CHANGES, &near, want.changed.iter().copied(), self.wedges[0])?;
        for &w in &got.changed {
            let mut predicted = row(&mesh.rows, w as usize).unwrap_or_default();
            if let Some(new) = find(&children, w) {
                let twin = row(&got.rows, (new - self.wedges[0]) as usize).unwrap_or_default();
                for (p, t) in predicted.iter_mut().zip(twin) {
                    *p = p.wrapping_mul(2).wrapping_sub(t);
                }
            }
            let wanted = want.changed.binary_search(&w).ok().and_then(|i| row(&want.changed_rows, i));
            self.row(1, &predicted, wanted, &mut got.changed_rows)?;
        }
        Ok(())
    }

    fn row(
        &mut self,
        kind: usize,
        predicted: &[i32],
        want: Option<Vec<i32>>,
        out: &mut Vec<i32>,
    ) -> Coded<()> {
        for (k, &p) in predicted.iter().enumerate() {
            let by = want.as_ref().map_or(0, |w| w[k].wrapping_sub(p));
            out.push(p.wrapping_add(self.io.signed(ROWS + 2 * k + kind, by.into())? as i32));
        }
        Ok(())
    }
}

fn find(list: &[(u32, u32)], at: u32) -> Option<u32> {
    list.binary_search_by_key(&at, |x| x.0).ok().map(|i| list[i].1)
}
