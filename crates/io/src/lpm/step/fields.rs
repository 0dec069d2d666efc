//! Coding of the positions and the attribute rows of a split.

use super::{CHANNEL_MODELS, Models, PREDICTED_SHARE, SplitCodec, StepCounts, code_gap, find};
use crate::lpm::level_mesh::{LevelMesh, SplitChanges};
use crate::lpm::range::{Coded, Coder};

/// Model of positions without a prediction.
const NO_PREDICTION: usize = 64;

/// Models for a position: those of a ring, by its scale along each axis, or those without a ring.
#[derive(Clone, Copy)]
enum PlaceModels {
    Near(usize, [usize; 3]),
    Far(usize),
}

impl Models {
    fn place<C: Coder>(
        &mut self,
        c: &mut C,
        group: PlaceModels,
        foreseen: [i64; 3],
        wanted: [i64; 3],
    ) -> Coded<[i64; 3]> {
        let mut now = [0; 3];
        for k in 0..3 {
            let model = match group {
                PlaceModels::Near(i, scale) => &mut self.near[i][scale[k]],
                PlaceModels::Far(i) => &mut self.far[i * 3 + k],
            };
            now[k] = foreseen[k].wrapping_add(c.signed(model, wanted[k].wrapping_sub(foreseen[k]))?);
        }
        Ok(now)
    }
    /// Codes a row of numbers, channel by channel.
    fn row<C: Coder>(
        &mut self,
        c: &mut C,
        way: usize,
        foreseen: &[i32],
        wanted: Option<&[i32]>,
        out: &mut Vec<i32>,
    ) -> Coded<()> {
        for (k, &f) in foreseen.iter().enumerate() {
            let by = wanted.map_or(0, |w| w[k].wrapping_sub(f));
            let by = c.signed(&mut self.rows[k.min(CHANNEL_MODELS - 1)][way], i64::from(by))?;
            out.push(f.wrapping_add(by as i32));
        }
        Ok(())
    }
}

impl SplitCodec {
    pub(super) fn places<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        focus: Option<u32>,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let code = self.shape.places;
        let (foreseen, scale) = match focus {
            Some(u) => self.predict(walk, u),
            None => ([0; 3], [NO_PREDICTION; 3]),
        };
        let parents = self.vertex_parents(walk, span, got);
        let born = span.vertices[1] - span.vertices[0];
        for i in 0..born {
            let wanted = want.places.get(i as usize).copied().unwrap_or_default();
            let now = if i == 0 && focus.is_some() {
                self.models.place(c, PlaceModels::Near(0, scale), foreseen, wanted)?
            } else {
                let parent = find(&parents, i).map(|v| walk.places[v as usize]);
                let last = || got.places.last().or(walk.places.last()).copied();
                self.models.place(c, PlaceModels::Far(0), parent.or_else(last).unwrap_or_default(), wanted)?
            };
            got.places.push(now);
            if !self.shape.has_vertex_map {
                got.vertex_of.push(span.vertices[0] + i);
            }
        }
        let target = |v: u32| want.moved.binary_search_by_key(&v, |m| m.0).ok().map(|i| want.moved[i].1);
        if let Some(u) = focus {
            let old = walk.places[u as usize];
            let to = target(u);
            if c.bit(&mut self.models.moves[usize::from(born > 0)], to.is_some())? {
                // The old position is about midway between the two.
                let mirrored = got.places.first().and_then(|&v| {
                    let (p, v) = (code.coordinates(old), code.coordinates(v));
                    code.nearest([0, 1, 2].map(|k| 2.0 * p[k] - v[k]))
                });
                let (foreseen, to) = (mirrored.unwrap_or(old), to.unwrap_or_default());
                let now = self.models.place(c, PlaceModels::Near(1, scale), foreseen, to)?;
                got.moved.push((u, now));
            }
        }
        let rest: Vec<_> = want.moved.iter().filter(|m| Some(m.0) != focus).copied().collect();
        let mut at = 0;
        for i in 0..c.count(&mut self.models.moved.count, rest.len())? {
            let (v, to) = rest.get(i).copied().unwrap_or_default();
            let v = code_gap(c, &mut self.models.moved.gap, &mut at, v, span.vertices[0])?;
            got.moved.push((v, self.models.place(c, PlaceModels::Far(1), walk.places[v as usize], to)?));
        }
        got.moved.sort_by_key(|m| m.0);
        Ok(())
    }

    /// Predicts the position of the new vertex of a split; also returns the approximate size of the ring
    /// along each axis.
    fn predict(&self, walk: &LevelMesh, u: u32) -> ([i64; 3], [usize; 3]) {
        let code = self.shape.places;
        let old = walk.places[u as usize];
        let ring = &self.ring.corners;
        if ring.is_empty() {
            return (old, [NO_PREDICTION; 3]);
        }
        let (mut sums, mut counts, mut sizes) = ([[0f64; 3]; 2], [0u32; 2], [0u64; 3]);
        for (x, (_, goes)) in ring.iter().zip(&self.after) {
            let side = usize::from(*goes);
            for w in [x.next, x.last] {
                let place = walk.places[walk.vertex_of[w as usize] as usize];
                let p = code.coordinates(place);
                for k in 0..3 {
                    sums[side][k] += p[k];
                    sizes[k] = sizes[k].saturating_add(place[k].wrapping_sub(old[k]).unsigned_abs());
                }
                counts[side] += 1;
            }
        }
        let mean = |k: usize| sizes[k] / (2 * ring.len() as u64);
        let scale = [0, 1, 2].map(|k| (u64::BITS - mean(k).leading_zeros()) as usize);
        let p = code.coordinates(old);
        let centre = |side: usize| match counts[side] {
            0 => p,
            n => sums[side].map(|x| x / f64::from(n)),
        };
        let (stays, goes) = (centre(0), centre(1));
        let foreseen = code.nearest([0, 1, 2].map(|k| p[k] + PREDICTED_SHARE * (goes[k] - stays[k])));
        (foreseen.unwrap_or(old), scale)
    }

    /// Returns the new vertices, each with the old vertex of the wedge whose corners it took.
    fn vertex_parents(&self, walk: &LevelMesh, span: StepCounts, got: &SplitChanges) -> Vec<(u32, u32)> {
        let parent = |&(born, old): &(u32, u32)| {
            let vertex = match self.shape.has_vertex_map {
                true => got.vertex_of[born as usize],
                false => span.wedges[0] + born,
            };
            Some((vertex.checked_sub(span.vertices[0])?, walk.vertex_of[old as usize]))
        };
        let mut parents: Vec<_> = self.parents.iter().filter_map(parent).collect();
        parents.sort_by_key(|p| p.0);
        parents.dedup_by_key(|p| p.0);
        parents
    }

    pub(super) fn rows<C: Coder>(
        &mut self,
        c: &mut C,
        walk: &LevelMesh,
        span: StepCounts,
        want: &SplitChanges,
        got: &mut SplitChanges,
    ) -> Coded<()> {
        let channels = self.shape.channels;
        if channels == 0 {
            return Ok(());
        }
        let old_row = |w: u32| &walk.rows[w as usize * channels..][..channels];
        let models = &mut *self.models;
        let mut foreseen: Vec<i32> = Vec::with_capacity(channels);
        for i in 0..(span.wedges[1] - span.wedges[0]) as usize {
            let parent = find(&self.parents, i as u32).or_else(|| self.ring.wedges.first().copied());
            foreseen.clear();
            match parent {
                Some(w) => foreseen.extend_from_slice(old_row(w)),
                None => {
                    let last = |rows: &[i32]| Some(rows.len().checked_sub(channels)?..rows.len());
                    match (last(&got.rows), last(&walk.rows)) {
                        (Some(at), _) => foreseen.extend_from_slice(&got.rows[at]),
                        (None, Some(at)) => foreseen.extend_from_slice(&walk.rows[at]),
                        (None, None) => foreseen.resize(channels, 0),
                    }
                }
            }
            let wanted = want.rows.get(i * channels..(i + 1) * channels);
            models.row(c, 0, &foreseen, wanted, &mut got.rows)?;
        }
        let change = |w: u32| {
            let i = want.changed.binary_search(&w).ok()?;
            Some(&want.changed_rows[i * channels..][..channels])
        };
        for &w in &self.ring.wedges {
            let wanted = change(w);
            if !c.bit(&mut models.row_changes, wanted.is_some())? {
                continue;
            }
            foreseen.clear();
            foreseen.extend_from_slice(old_row(w));
            if let Some(&(born, _)) = self.parents.iter().find(|p| p.1 == w) {
                let twin = &got.rows[born as usize * channels..][..channels];
                for (f, t) in foreseen.iter_mut().zip(twin) {
                    *f = f.wrapping_mul(2).wrapping_sub(*t);
                }
            }
            got.changed.push(w);
            models.row(c, 1, &foreseen, wanted, &mut got.changed_rows)?;
        }
        let rest = want.changed.iter().filter(|w| self.ring.wedges.binary_search(w).is_err());
        let rest: Vec<u32> = rest.copied().collect();
        let mut at = 0;
        for i in 0..c.count(&mut models.changed.count, rest.len())? {
            let w = code_gap(
                c,
                &mut models.changed.gap,
                &mut at,
                rest.get(i).copied().unwrap_or(0),
                span.wedges[0],
            )?;
            got.changed.push(w);
            models.row(c, 1, old_row(w), change(w), &mut got.changed_rows)?;
        }
        if !got.changed.is_sorted() {
            let mut order: Vec<usize> = (0..got.changed.len()).collect();
            order.sort_by_key(|&i| got.changed[i]);
            let rows =
                order.iter().flat_map(|&i| got.changed_rows[i * channels..][..channels].iter().copied());
            got.changed_rows = rows.collect();
            got.changed = order.iter().map(|&i| got.changed[i]).collect();
        }
        Ok(())
    }
}
