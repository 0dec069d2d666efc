//! Two-sided sheets: faces that lie on each other with opposite windings, such as the cards of foliage and
//! hair. One side is reduced, and both are written.
//!
//! ```text
//! find pairs of opposite faces, and a consistent front           (pairs)
//! leave the backs out; their values are kept with the fronts'    (plan, single)
//! run on the rest, with counts of both sides                     (this file)
//! add the backs to the result, or to each level                  (both, splits)
//! ```
//!
//! With both sides in one run, inner edges of a sheet would have four faces, which no collapse may touch, and
//! edges on its outline would have two, as if it were closed there.

mod both;
mod near;
mod pairs;
mod plan;
mod single;
mod splits;
mod unpaired;

use std::borrow::Cow;

use lodsmith_core::mesh::defects::defects;
use lodsmith_core::splits::SplitData;
use lodsmith_core::{Morphed, Semantic, Surface, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::collapse::order::{NONE, Ordered, order};
use crate::control::{Control, Stage, has_time_for};
use crate::deviation::InputComparer;
use crate::input::{Input, OwnedMeshData};
use crate::options::{Bound, Method, SimplifyOptions, Stop, TopologyPolicy};
use crate::report::Report;
use crate::run::{CountedGoal, Done, Mergers};
use both::BothSides;
use pairs::{FacePair, FacePairs};
use single::{SingleSided, back_corners};

/// An input with two-sided sheets, and the same without their backs.
pub(crate) struct TwoSidedInput<'a> {
    whole: Cow<'a, TriMesh>,
    single: SingleSided,
    /// Number of pairs of faces.
    pair_count: usize,
    /// Number of duplicates of faces in pairs.
    duplicates: usize,
    /// True if every face belongs to a pair, and front and back share either all their vertices or none.
    is_uniform: bool,
    /// True if the input can be restored exactly from the fronts.
    is_exact: bool,
    /// Vertices of backs that are not the vertex of the front there, each followed by that vertex.
    own_vertices: Vec<[VertexId; 2]>,
    /// The vertex that each vertex is to be merged with, as in the input.
    joined: Option<Vec<VertexId>>,
    /// Data of the input without backs.
    data: OwnedMeshData,
}

/// True if a run should look for sheets. Not with voxels, whose surface encloses everything inside; nor with
/// pairs, which would join single cards to branching sheets, unless the topology is free; and with
/// clustering, which needs no ordered input otherwise, only if sampled faces occur twice.
pub(crate) fn is_looked_for(surface: &Surface<'_>, options: &SimplifyOptions) -> bool {
    if options.method.pairs().is_some() && options.topology != TopologyPolicy::Free {
        return false;
    }
    match options.method {
        Method::Remesh(_) => !options.method.makes_voxels(),
        Method::Cluster { .. } => pairs::may_have_sheets(surface),
        _ => true,
    }
}

/// The faces of the two sides of all sheets of a surface, ascending.
pub(crate) struct Sides {
    pub(crate) fronts: Vec<u32>,
    pub(crate) backs: Vec<u32>,
}

/// Returns the sides of the sheets of a surface. Cost: O(n log n).
pub(crate) fn sides(surface: &Surface<'_>) -> Sides {
    let ordered = order(surface);
    let near = near::joined(surface, &ordered, surface.triangles(), pairs::MAX_BENT_GAP, |_, _| true);
    let (surface, ordered) = near.as_ref().map_or((surface, &ordered), |near| (&near.surface, &near.ordered));
    let found = pairs::find(surface, ordered, pairs::MAX_BENT_GAP, &|_| true).unwrap_or_default();
    let all = |side: fn(&FacePair) -> &[u32]| {
        let mut faces: Vec<u32> = found.pairs.iter().flat_map(side).copied().collect();
        faces.sort_unstable();
        faces
    };
    Sides { fronts: all(FacePair::fronts), backs: all(FacePair::backs) }
}

/// Counts the faces of a surface that lie on a face of opposite winding, on both sides:
/// [`simplify`](crate::simplify()) reduces these as one sheet. Quads whose sides are cut along different
/// diagonals count too, and so do sides up to a millionth of the diagonal apart. Cost: O(n log n).
pub fn two_sided_faces(surface: &Surface<'_>) -> usize {
    let Sides { fronts, backs } = sides(surface);
    fronts.len() + backs.len()
}

/// Counts the parts of an input that are sheets with two sides, but cannot be reduced as one because the sides
/// have different triangles: see [`Report::unpaired_sheets`]. Cost: O(n).
pub(crate) fn unpaired_sheets(ordered: &Ordered) -> usize {
    unpaired::count(&ordered.points, &ordered.faces)
}

impl<'a> TwoSidedInput<'a> {
    /// Returns the sheets of an input, if it has any. `prepared` is the input after welding and pruning, and
    /// `ordered` its order, with the faces. Cost: O(F); with sheets O(F log F).
    pub(crate) fn find(
        input: &Input<'a>,
        prepared: &Input<'_>,
        ordered: &Ordered,
        options: &SimplifyOptions,
    ) -> Result<Option<Self>, SimplifyError> {
        let surface = &prepared.surface;
        // A bent quad has a back of another shape: one cannot stand for the other where a distance is
        // guaranteed.
        let is_bound = options.stop.error.is_some() || options.effective_bound() != Bound::Estimate;
        let bent = if is_bound { 0.0 } else { pairs::MAX_BENT_GAP };
        let may_pair = |pair: &FacePair, places: &dyn Fn(u32) -> [VertexId; 3]| {
            may_pair(input, input.data.locked, pair, places)
        };
        // (A requested weld defines what is joined.)
        let near = match options.weld {
            None => near::joined(surface, ordered, input.surface.triangles(), bent, may_pair),
            Some(_) => None,
        };
        let (surface, ordered) = near.as_ref().map_or((surface, ordered), |n| (&n.surface, &n.ordered));
        let places = |f: u32| surface.triangles()[f as usize].map(|v| ordered.rank[v.index()]);
        let Some(found) = pairs::find(surface, ordered, bent, &|pair| may_pair(pair, &places)) else {
            return Ok(None);
        };
        let whole = input.to_mesh()?;
        let rank = |v: VertexId| {
            let v = prepared.joined(v);
            ordered.rank[near.as_ref().map_or(v, |near| near.to[v.index()]).index()]
        };
        let single = SingleSided::new(&whole, &found, rank)?;
        let FacePairs { pairs, duplicates } = &found;
        let mut own_vertices = Vec::new();
        let (mut pair_count, mut shared) = (0, 0);
        for pair in pairs {
            pair_count += pair.fronts().len();
            for &front in pair.fronts() {
                for (k, back) in back_corners(front, pair.backs(), places).into_iter().enumerate() {
                    let of = |f: u32, k: usize| whole.vertex_of(whole.triangles()[f as usize][k]);
                    let (v, u) = (of(front, k), of(back.0, back.1));
                    if u == v {
                        shared += 1;
                    } else {
                        own_vertices.push([u, v]);
                    }
                }
            }
        }
        let sound = surface.triangles().iter().filter(|t| ordered.is_sound(t)).count();
        let is_uniform =
            2 * pair_count + duplicates.len() == sound && (shared == 0 || own_vertices.is_empty());
        own_vertices.sort_unstable();
        own_vertices.dedup();
        let is_exact = single.is_exact(&whole, &found, &own_vertices);
        let duplicates = duplicates.len();
        let joined = input.joined.clone();
        let data = single.data_of(&input.data, &own_vertices, whole.wedge_count());
        Ok(Some(Self {
            whole,
            single,
            pair_count,
            duplicates,
            is_uniform,
            is_exact,
            own_vertices,
            joined,
            data,
        }))
    }

    /// Runs on the fronts, with `run`, and returns both sides.
    pub(crate) fn simplify(
        &self,
        options: &SimplifyOptions,
        run: impl Fn(&Input<'_>, &SimplifyOptions, &mut dyn Control) -> Result<Done, SimplifyError>,
        control: &mut dyn Control,
    ) -> Result<Done, SimplifyError> {
        let mut own = options.clone();
        let goal = self.goal(&options.stop);
        let once = |stop| {
            own.stop = stop;
            let (done, held) = run(&self.input(), &own, control)?;
            let reached = done.report.reached;
            let (both, report) = self.both_sides(&done.mesh, &held, done.report)?;
            let counted = (goal.counted)(&both.mesh);
            Ok(((both, report), counted, reached))
        };
        let (both, mut report) =
            goal.search(self.is_uniform || goal.count.is_none(), 2.0, options.stop.error, once)?;
        goal.judge(&mut report);
        self.measure(&both.mesh, &mut report, options, control)?;
        Ok((crate::Simplified { mesh: both.mesh, report }, both.held))
    }

    /// True if a result has no more faces back to back than the input. (In a jumble of loose faces, others
    /// can end up on a sheet.)
    pub(crate) fn has_no_more_opposite(&self, result: &TriMesh) -> bool {
        let count = |mesh: &TriMesh| defects(&mesh.surface()).opposite_duplicate_count;
        count(result) <= count(&self.whole).max(self.pair_count)
    }

    /// Returns the stops of a chain of runs on the fronts, if the counts of both sides follow from the counts
    /// of the fronts.
    pub(crate) fn chain_stops(&self, stops: &[Stop]) -> Option<Vec<Stop>> {
        self.is_uniform.then(|| {
            let own = |stop: &Stop| {
                let goal = self.goal(stop);
                goal.own_stop(stop.error, goal.wanted())
            };
            stops.iter().map(own).collect()
        })
    }

    /// Returns both sides of the levels of a chain.
    pub(crate) fn both_levels(
        &self,
        levels: Vec<Done>,
        mergers: &Mergers,
        stops: &[Stop],
        options: &SimplifyOptions,
        control: &mut dyn Control,
    ) -> Result<(Vec<Done>, Mergers), SimplifyError> {
        let mut all: Vec<Done> = Vec::with_capacity(levels.len());
        let mut both_mergers = Mergers::new();
        // For each vertex of the level before, its vertex on the front, and whether it belongs to a back.
        let mut before: Vec<(VertexId, bool)> =
            (0..self.whole.vertex_count()).map(|v| (VertexId::new(v), false)).collect();
        for [back, front] in &self.own_vertices {
            before[back.index()] = (*front, true);
        }
        for (k, ((done, held), stop)) in levels.into_iter().zip(stops).enumerate() {
            let (both, mut report) = self.both_sides(&done.mesh, &held, done.report)?;
            self.goal(stop).judge(&mut report);
            self.measure(&both.mesh, &mut report, options, control)?;
            let fronts = done.mesh.vertex_count();
            if let Some(into) = mergers.get(k) {
                let mut copy = vec![NONE; fronts];
                for (v, front) in both.vertices.iter().enumerate().skip(fronts) {
                    copy[front.index()] = VertexId::new(v);
                }
                let home = |&(front, is_back): &(VertexId, bool)| {
                    let to = into.get(front.index()).copied().unwrap_or(NONE);
                    let own = copy.get(to.index()).copied().filter(|own| is_back && *own != NONE);
                    own.unwrap_or(to)
                };
                both_mergers.push(before.iter().map(home).collect());
            }
            before = both.vertices.iter().enumerate().map(|(v, front)| (*front, v >= fronts)).collect();
            all.push((crate::Simplified { mesh: both.mesh, report }, both.held));
        }
        Ok((all, both_mergers))
    }

    /// True if the full level of [`Self::both_splits`] is the input.
    pub(crate) fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// Returns both sides of a progressive mesh of the fronts.
    pub(crate) fn both_splits(&self, data: SplitData) -> SplitData {
        self.single.both_splits(&self.whole, &self.own_vertices, data)
    }

    /// Returns a stop at which both sides together have no more elements than the given stop allows.
    pub(crate) fn lowest_stop(&self, stop: &Stop) -> Stop {
        let goal = self.goal(stop);
        goal.own_stop(
            stop.error,
            if self.is_uniform { goal.wanted() } else { goal.count.map(|n| 0.5 * n as f64) },
        )
    }

    /// The mesh with both sides.
    pub(crate) fn whole(&self) -> &TriMesh {
        &self.whole
    }

    /// The number of duplicates of faces in pairs.
    pub(crate) fn duplicates(&self) -> usize {
        self.duplicates
    }

    /// The input without backs.
    pub(crate) fn input(&self) -> Input<'_> {
        let joined = self.joined.clone();
        Input { joined, ..Input::new(&self.single.mesh).with(self.data.view()) }
    }

    /// Measures a result with both sides, if the run was measured: by area, so that sheets count twice. A bound that is
    /// proven for one side holds for both.
    fn measure(
        &self,
        mesh: &TriMesh,
        report: &mut Report,
        options: &SimplifyOptions,
        control: &mut dyn Control,
    ) -> Result<(), SimplifyError> {
        if report.error.measured.take().is_some() {
            let comparer = if has_time_for(Stage::Measure, control)? {
                InputComparer::new(&self.whole.surface(), options)
            } else {
                None
            };
            if let Some(comparer) = comparer {
                report.error.measured = comparer.measured(mesh, control)?;
            }
            // (Before, there was a face to measure from.)
            report.error.is_incomplete |= report.error.measured.is_none();
        }
        Ok(())
    }

    fn goal(&self, stop: &Stop) -> CountedGoal {
        CountedGoal::new(stop, |of| of(&self.whole), &self.single.mesh)
    }

    /// Adds the backs to a result, and counts them in its report.
    fn both_sides(
        &self,
        mesh: &TriMesh,
        held: &crate::constraints::HeldWedges,
        mut report: Report,
    ) -> Result<(BothSides, Report), SimplifyError> {
        let both = self.single.both_sides(&self.whole, mesh, held)?;
        report.input_faces = self.whole.face_count();
        report.input_vertices = self.whole.vertex_count();
        report.faces = both.mesh.face_count();
        report.vertices = both.mesh.vertex_count();
        report.two_sided_pairs = self.pair_count;
        Ok((both, report))
    }
}

/// True if the back of a pair may be left out of a run on an input: it differs from the front only in its
/// winding and its values, and locked vertices can be restored bit for bit. `places` gives the places of the
/// corners of a face.
fn may_pair(
    input: &Input<'_>,
    locked: Option<&[bool]>,
    pair: &FacePair,
    places: &dyn Fn(u32) -> [VertexId; 3],
) -> bool {
    let own = |f: u32, k: usize| input.surface.triangles()[f as usize][k];
    let at = |f: u32, k: usize| input.surface.positions().get(own(f, k));
    let is_locked = |f: &u32| locked.is_some_and(|locked| (0..3).any(|k| locked[own(*f, k).index()]));
    let must_be_exact = pair.fronts().iter().chain(pair.backs()).any(is_locked);
    let corners = || {
        let of_front = |front: u32| {
            (0..3).zip(back_corners(front, pair.backs(), places)).map(move |(k, back)| ((front, k), back))
        };
        pair.fronts().iter().flat_map(move |f| of_front(*f))
    };
    let is_exact = || corners().all(|(front, back)| at(front.0, front.1) == at(back.0, back.1));
    (!must_be_exact || is_exact())
        && input
            .mesh
            .is_none_or(|mesh| is_whole(mesh, pair) && corners().all(|(a, b)| moves_alike(mesh, a, b)))
}

/// True if each side of a pair has only one region, and only one wedge at each corner of a quad.
fn is_whole(mesh: &TriMesh, pair: &FacePair) -> bool {
    [pair.fronts(), pair.backs()].into_iter().all(|side| {
        let [a, b] = [side[0], side[side.len() - 1]].map(|f| f as usize);
        let (own, other) = (mesh.triangles()[a], mesh.triangles()[b]);
        mesh.regions().is_none_or(|r| r[a] == r[b])
            && (a == b || own.iter().filter(|w| other.contains(w)).count() == 2)
    })
}

/// True if joints and morph targets move two corners, one of each face, equally, so that the sides stay
/// together.
fn moves_alike(mesh: &TriMesh, front: (u32, usize), back: (u32, usize)) -> bool {
    let wedge = |(f, k): (u32, usize)| -> WedgeId { mesh.triangles()[f as usize][k] };
    let mut moves = mesh.further_attributes().iter().filter(|a| {
        matches!(
            a.semantic,
            Semantic::Joints(_) | Semantic::Weights(_) | Semantic::Morph { of: Morphed::Position, .. }
        )
    });
    moves.all(|a| a.of(wedge(front)) == a.of(wedge(back)))
}
