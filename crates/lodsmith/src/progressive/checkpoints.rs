//! Checkpoints: levels with the result of the engine's fit and their distance from the full mesh.

use glam::Vec3;
use lodsmith_core::splits::Checkpoint;
use lodsmith_core::{FaceId, VertexId, WedgeId};

use super::values::ValueFitter;
use super::{Progressive, arrange};
use crate::SimplifyError;
use crate::collapse::kind::Kind;
use crate::collapse::order::{NONE, single_unit};
use crate::collapse::ordered_input::KeptInput;
use crate::collapse::record::Log;
use crate::collapse::ring::Ring;
use crate::collapse::store::Store;
use crate::collapse::vertex::Facing;
use crate::control::{Control, Verdict};
use crate::cost::guard::Rules;
use crate::cost::tensor::Tensor;
use crate::fit::{self, MoveGuards};
use crate::run::Run;

/// Faces of a checkpoint, as a fraction of the faces of the next finer one. (docs/decisions/0018)
const CHECKPOINT_FACTOR: f64 = 0.8;
/// The fraction below [`FINE_BELOW_FACES`] faces, where a level costs little and each split counts much.
const FINE_CHECKPOINT_FACTOR: f64 = 0.9;
const FINE_BELOW_FACES: f64 = 1000.0;
/// Minimum number of splits between checkpoints: each checkpoint takes about twenty bytes of a file, and
/// levels of a few dozen faces vary strongly from split to split.
const MIN_SPLITS_BETWEEN: usize = 4;
/// A level of at most this many faces is fitted twice in a row. (Measured: the second fit improves the RMS by
/// 1 to 3 %, a third by nothing. At such counts a recorded level is a few per cent farther away than the
/// result of a run with that goal.)
const FIT_TWICE_UP_TO_FACES: usize = 20_000;

/// Factors from the costs of contractions to squared distances in the unit frame.
#[derive(Clone, Copy)]
pub(super) struct Weights {
    pub(super) kept: f64,
    pub(super) lost: f64,
}

/// A progressive mesh as recorded, in the numbering of the record.
pub(super) struct Recorded<'a> {
    /// The changes, first contraction first.
    pub(super) order: &'a [usize],
    /// The face of the input for each face.
    pub(super) faces: &'a [FaceId],
    /// The number of each vertex in the record.
    pub(super) vertices: &'a [VertexId],
    pub(super) log: &'a Log,
    /// The number in the record of each vertex of the ordered input, and of vertices created by cuts.
    pub(super) origins: &'a [VertexId],
    /// Faces of the input in the order of the engine.
    pub(super) morton_faces: &'a [FaceId],
    /// Orientation of the input at the vertices of the ordered input.
    pub(super) facings: &'a [Facing],
    pub(super) weights: Weights,
    /// True if levels are fitted.
    pub(super) fits: bool,
}

impl Recorded<'_> {
    /// Returns the checkpoints of a progressive mesh, from the coarsest on.
    pub(super) fn checkpoints(
        &self,
        run: &Run<'_, '_>,
        progressive: &mut Progressive,
        mut fitter: Option<&mut ValueFitter>,
        control: &mut dyn Control,
    ) -> Result<Vec<Checkpoint>, SimplifyError> {
        let top = progressive.top();
        // The cleanup at the start is no contraction.
        let start = top - usize::from(self.order.first() == Some(&0));
        let levels = self.levels(progressive, start);
        let mut into: Vec<VertexId> = (0..self.origins.len() as u32).map(VertexId).collect();
        let (mut done, mut spent, mut lost) = (top, 0.0, 0.0);
        let mut checkpoints = vec![Checkpoint { level: start as u32, ..Checkpoint::default() }];
        for (i, &level) in levels.iter().enumerate() {
            if control.progress(i as f64 / levels.len() as f64) == Verdict::Cancel {
                return Err(SimplifyError::Cancelled);
            }
            while done > level {
                let change = self.order[top - done];
                for &(gone, home) in arrange::merged(self.log, change) {
                    into[gone.index()] = home;
                }
                spent += f64::from(self.log.steps[change].spent);
                lost += f64::from(self.log.steps[change].lost);
                done -= 1;
            }
            progressive.to_level(level);
            let kept = self.weights.kept * spent.max(0.0);
            let lost = self.weights.lost * lost.max(0.0);
            let mut checkpoint = Checkpoint { level: level as u32, ..Checkpoint::default() };
            let mut near = kept;
            if self.fits {
                let away = (kept + lost).sqrt();
                near = self.fit(run, progressive, fitter.as_deref_mut(), &into, away, &mut checkpoint);
            }
            let before = checkpoints.last().map_or(0.0, |c| c.error);
            let error = run.ordered.frame.user_length((near + lost).sqrt()).min(run.ordered.diagonal);
            checkpoint.error = if error.is_finite() { error.max(before) } else { before };
            checkpoints.push(checkpoint);
        }
        checkpoints.reverse();
        Ok(checkpoints)
    }

    /// Returns the levels below `start`, finest first, the base last.
    fn levels(&self, progressive: &Progressive, start: usize) -> Vec<usize> {
        let counts = &progressive.splits().counts;
        let mut levels = Vec::new();
        let (mut level, mut wanted) = (start, f64::from(counts[start].faces));
        while level > 0 {
            wanted *= if wanted < FINE_BELOW_FACES { FINE_CHECKPOINT_FACTOR } else { CHECKPOINT_FACTOR };
            let next = progressive.level_of_faces(wanted as usize);
            if next + MIN_SPLITS_BETWEEN <= level || next == 0 {
                levels.push(next);
                level = next;
            }
        }
        levels
    }

    /// Fits the current level and stores the moves. Returns the remaining mean squared distance.
    fn fit(
        &self,
        run: &Run<'_, '_>,
        progressive: &Progressive,
        mut fitter: Option<&mut ValueFitter>,
        into: &[VertexId],
        away: f64,
        checkpoint: &mut Checkpoint,
    ) -> f64 {
        let frame = run.ordered.frame;
        let counts = progressive.counts();
        // Number vertices and faces in the order of the engine.
        let mut number = vec![NONE; progressive.positions.len()];
        let names = self.vertices.iter().map(|v| v.index() + 1).max().unwrap_or(0);
        let mut by_name = vec![NONE; names];
        let vertex = |w: WedgeId| progressive.vertex_of.as_ref().map_or(VertexId(w.0), |map| map[w.index()]);
        for v in progressive.faces().iter().flatten().map(|&w| vertex(w)) {
            by_name[self.vertices[v.index()].index()] = v;
        }
        let mut origins = Vec::with_capacity(counts.vertices as usize);
        let mut live = Vec::with_capacity(counts.vertices as usize);
        for (origin, name) in self.origins.iter().enumerate() {
            let v = by_name.get(name.index()).copied().unwrap_or(NONE);
            if v != NONE {
                number[v.index()] = VertexId::new(live.len());
                origins.push(VertexId::new(origin));
                live.push(v);
            }
        }
        let mut place_of_face = vec![u32::MAX; self.faces.len()];
        for (i, f) in self.morton_faces.iter().enumerate() {
            place_of_face[f.index()] = i as u32;
        }
        let mut order: Vec<usize> = (0..progressive.face_count()).collect();
        order.sort_unstable_by_key(|&f| place_of_face[self.faces[f].index()]);
        let faces = order.iter().map(|&f| progressive.faces[f].map(|w| number[vertex(w).index()])).collect();
        let points: Vec<Vec3> =
            live.iter().map(|&v| single_unit(&frame, progressive.positions().get(v))).collect();
        let mut store = Store::<Tensor>::new(&points, faces, None, None);
        store.merged_into = into.to_vec();
        store.link();
        let mut ring = Ring::default();
        for (i, &origin) in origins.iter().enumerate() {
            store.ring(VertexId::new(i), &mut ring);
            let given = run.ordered.points.get(origin.index());
            let is_locked = run.constraints.locked().is_some_and(|l| l.get(origin.index()) == Some(&true));
            let x = &mut store.v[i];
            x.origin = origin;
            x.kind = Kind::of(&ring, run.options.border).locked(is_locked).moved(given != Some(&x.p));
            x.facing = self.facings.get(origin.index()).copied().unwrap_or_default();
        }
        let before: Vec<Vec3> = store.v.iter().map(|x| x.p).collect();
        let mut given = KeptInput { points: &run.ordered.points, faces: &run.ordered.faces };
        let home = store.homes();
        let mut values = fitter.as_deref_mut().map(|fitter| {
            let places = store.t.iter().map(|t| t.map(|v| before[v.index()]));
            fitter.begin(progressive, order.iter().copied().zip(places), away)
        });
        let guards = MoveGuards::new(&Rules::new(run.options, frame, run.ordered.diagonal), &store);
        let guards = guards.as_ref();
        let mut rms = fit::fit(&mut store, &mut given, &home, away, values.as_mut(), guards, |q| q).rms;
        if progressive.face_count() <= FIT_TWICE_UP_TO_FACES {
            rms = fit::fit(&mut store, &mut given, &home, away, None, guards, |q| q).rms;
        }
        if let Some(values) = values {
            values.solve(|face, k| {
                let v = store.t[face][k];
                let x = &store.v[v.index()];
                (!x.kind.is_locked()).then(|| x.p - before[v.index()])
            });
        }
        if let Some(fitter) = fitter {
            fitter.store_changes(progressive, checkpoint);
        }
        let mut moves: Vec<(VertexId, [f32; 3])> = Vec::new();
        for (i, &v) in live.iter().enumerate() {
            let moved = store.v[i].p - before[i];
            if moved != Vec3::ZERO {
                moves.push((v, moved.to_array().map(|x| frame.user_length(f64::from(x)) as f32)));
            }
        }
        moves.sort_unstable_by_key(|m| m.0);
        (checkpoint.vertices, checkpoint.moves) = moves.into_iter().unzip();
        rms * rms
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;
    use crate::SimplifyOptions;
    use crate::control::NoControl;

    #[test]
    fn checkpoints_become_sparser_towards_the_full_mesh() {
        let mesh = shapes::noisy_sphere(3, 0.05, 3);
        let progressive =
            Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl).expect("a sphere");
        let (counts, all) = (&progressive.splits().counts, &progressive.splits().checkpoints);
        // From the base to the full mesh, which has no error and no fit.
        assert_eq!((all[0].level, all[all.len() - 1].level as usize), (0, progressive.top()));
        let last = &all[all.len() - 1];
        assert_eq!((last.error, last.vertices.len()), (0.0, 0));
        assert!(all[0].error > 0.0 && !all[0].vertices.is_empty());
        for pair in all.windows(2) {
            let [coarse, fine] = [&pair[0], &pair[1]];
            let [low, high] = [coarse, fine].map(|c| f64::from(counts[c.level as usize].faces));
            assert!(fine.error <= coarse.error, "{} after {}", coarse.error, fine.error);
            // Each has four fifths of the faces of the next finer one, or nine tenths below a thousand faces;
            // a split adds two.
            let is_base = coarse.level == 0;
            assert!(is_base || fine.level - coarse.level >= MIN_SPLITS_BETWEEN as u32);
            let share = if high < FINE_BELOW_FACES { FINE_CHECKPOINT_FACTOR } else { CHECKPOINT_FACTOR };
            assert!(low <= share * (high + 2.0), "{low} of {high}");
        }
        assert!(all.len() > 20, "{} checkpoints", all.len());
    }
}
