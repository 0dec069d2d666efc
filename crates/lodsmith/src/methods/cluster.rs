//! Vertex clustering: a grid, with one vertex per cell. [Rossignac-Borrel 1993]
//!
//! ```text
//! drop faces with non-finite corners                        (model)
//! until the count is right                                  (search)
//!     estimate the cell size from a sample of faces         (sample)
//!     number the cells that contain vertices                (grid)
//!     keep faces with corners in three cells, each once     (faces)
//! place each cell's vertex by the planes of its faces and its borders (place)
//! ```
//!
//! Nothing is welded and no adjacency is built: coincident vertices share a cell anyway. A result vertex is
//! at most one cell diagonal away from each vertex that it replaces. Features thinner than a cell may vanish
//! or self-intersect: topology is not preserved. Of the faces between the same three cells one is kept per
//! orientation, so that a plate whose sides coincide stays visible from both.

mod faces;
mod grid;
mod locked;
mod model;
mod place;
mod sample;
mod search;
mod two_stage;

use lodsmith_core::{PositionsView, RegionId, Surface, TriMesh, VertexId};

use crate::collapse::Goal;
use crate::collapse::order::NONE;
use crate::constraints::HeldWedges;
use crate::control::{Control, Stage, Verdict};
use crate::deviation::{self, Deviation, InputComparer, Judgement, ROUNDING};
use crate::input::Input;
use crate::methods::transfer::transfer_to_bare_mesh;
use crate::options::{BorderPolicy, Method, SimplifyOptions};
use crate::prune::Pruned;
use crate::report::{Clustered, ErrorReport, Report, StoppedBy};
use crate::run;
use crate::run::level_search::{LevelTest, search_around};
use crate::{Simplified, SimplifyError, chunks};
use grid::MAX_RESOLUTION;
use locked::LockedPositions;
use model::{ClusterInput, ClusterPosition};
use search::{Clusters, SearchResult};

/// Clusters the input until the options' stop, or at their cell size.
pub(crate) fn run(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<(Simplified, HeldWedges), SimplifyError> {
    match input.surface.positions() {
        PositionsView::F32(points) => ClusterRun::start(points, input, options, control)?.run_stages(control),
        PositionsView::F64(points) => ClusterRun::start(points, input, options, control)?.run_stages(control),
    }
}

/// Ratio between successive resolutions in the search for an error. (Guessed: three percent more along an
/// axis is six percent more vertices, about one level of the search of other methods.)
const RESOLUTION_STEP: f64 = 1.03;
/// Largest distance, in cell diagonals, assumed for the first guess of a search. (Measured: 0.4 to 0.7.)
const FIRST_DISTANCE: f64 = 0.55;
/// Ratio of the distance between result and input to the RMS distance to planes. (Measured on scans at 1 and
/// 10 %: 0.7 to 0.9.)
const ESTIMATE_PER_PLANE_RMS: f64 = 0.8;

struct ClusterRun<'a, P> {
    input: &'a Input<'a>,
    options: &'a SimplifyOptions,
    model: ClusterInput<'a, P>,
    locked: LockedPositions,
    goal: Goal,
    diagonal: f64,
    /// Cells along the longest edge of the box, from the cell size option.
    coarsest: Option<f64>,
    is_over: bool,
}

/// A result and its properties.
struct ClusteredMesh {
    mesh: TriMesh,
    /// True for each locked vertex of the mesh, if any is locked.
    locked: Option<Vec<bool>>,
    held: HeldWedges,
    estimate: f64,
    cell: f64,
    non_manifold_edges: usize,
    by: StoppedBy,
}

impl<'a, P: ClusterPosition> ClusterRun<'a, P> {
    fn start(
        points: &'a [P],
        input: &'a Input<'a>,
        options: &'a SimplifyOptions,
        control: &mut dyn Control,
    ) -> Result<Self, SimplifyError> {
        control.stage(Stage::Prepare);
        if control.progress(0.0) == Verdict::Cancel {
            return Err(SimplifyError::Cancelled);
        }
        let model = ClusterInput::new(points, &input.surface)?;
        let diagonal = model.diagonal();
        let locked = match input.data.locked.filter(|l| l.contains(&true)) {
            Some(own) => {
                let mut is_locked = vec![false; points.len()];
                (0..own.len()).for_each(|i| is_locked[input.joined(VertexId::new(i)).index()] |= own[i]);
                LockedPositions::new(&model, |v| is_locked[v])
            }
            None => LockedPositions::default(),
        };
        let longest = model.extent().max_element();
        let cell = match options.method {
            Method::Cluster { cell, .. } => cell,
            _ => None,
        };
        let coarsest = match cell.map(|l| l.in_units(diagonal)) {
            Some(cell) if cell * MAX_RESOLUTION < longest => {
                let wanted = "at least 1/2000000 of the longest edge of the box round the mesh";
                return Err(SimplifyError::BadOption { option: "cell", wanted, got: cell });
            }
            Some(cell) => Some(longest / cell),
            None => None,
        };
        let goal = run::goal(options, input.surface.triangles().len());
        Ok(Self { input, options, model, locked, goal, diagonal, coarsest, is_over: false })
    }

    /// Asks the caller whether to continue. A run that has to finish still makes one pass, because it has no
    /// result before.
    fn report_progress(&mut self, done: f64, control: &mut dyn Control) -> Result<bool, SimplifyError> {
        match control.progress(done) {
            Verdict::Continue => {}
            Verdict::Finish => self.is_over = true,
            Verdict::Cancel => return Err(SimplifyError::Cancelled),
        }
        Ok(!self.is_over)
    }

    fn run_stages(self, control: &mut dyn Control) -> Result<(Simplified, HeldWedges), SimplifyError> {
        if let Method::Cluster { two_stage: true, .. } = self.options.method {
            self.in_two_stages(control)
        } else {
            self.finished(control)
        }
    }

    fn longest(&self) -> f64 {
        self.model.extent().max_element()
    }

    fn finished(mut self, control: &mut dyn Control) -> Result<(Simplified, HeldWedges), SimplifyError> {
        control.stage(Stage::Collapse);
        let (made, deviation) = match self.options.stop.error.map(|e| e.in_units(self.diagonal)) {
            None => {
                let made = self.reach_goal(control)?;
                let comparer = |control: &mut dyn Control| self.input_comparer(control);
                let measured = deviation::measured(self.options, &[&made.mesh], comparer, control)?.pop();
                (made, measured.unwrap_or_default())
            }
            Some(limit) => self.within(limit, control)?,
        };
        self.build_report(made, deviation)
    }

    /// Makes the finest result that meets the goal, or the result with the given cell size.
    fn reach_goal(&mut self, control: &mut dyn Control) -> Result<ClusteredMesh, SimplifyError> {
        let has_goal = self.goal.faces.is_some() || self.goal.vertices.is_some();
        if !has_goal && self.coarsest.is_none() || self.is_met() {
            return self.untouched();
        }
        let (goal, coarsest) = (self.goal, self.coarsest);
        let found = {
            let Self { model, locked, is_over, .. } = self;
            search::search(model, locked, goal, coarsest, |done| match control.progress(done) {
                Verdict::Continue => Ok(true),
                Verdict::Finish => {
                    *is_over = true;
                    Ok(false)
                }
                Verdict::Cancel => Err(SimplifyError::Cancelled),
            })?
        };
        let SearchResult { clusters, is_within } = found;
        if clusters.face_count() == 0 {
            let wanted = "so small that a face is left";
            let got = clusters.grid.cell;
            return Err(SimplifyError::BadOption { option: "cell", wanted, got });
        }
        let by = if has_goal && is_within { self.by_count() } else { StoppedBy::Exhausted };
        self.made(&clusters, by)
    }

    /// True if the input already meets the goal.
    fn is_met(&self) -> bool {
        let vertices = self.model.points.len() - self.model.cleanup.unused_vertices;
        self.goal.faces.is_some_and(|n| self.model.sound_faces() <= n)
            || self.goal.vertices.is_some_and(|n| vertices <= n)
    }

    /// Returns the first count in the order of reports; the caller determines later which one was met.
    fn by_count(&self) -> StoppedBy {
        match self.goal {
            Goal { faces: Some(_), .. } => StoppedBy::Faces,
            _ => StoppedBy::Vertices,
        }
    }

    /// Returns the input with every distinct position as a cluster of its own.
    fn untouched(&self) -> Result<ClusteredMesh, SimplifyError> {
        let all = LockedPositions::new(&self.model, |_| true);
        let clusters = Clusters::new(&self.model, &all, 1.0);
        self.made_with(&clusters, &all, StoppedBy::Nothing)
    }

    fn made(&self, clusters: &Clusters, by: StoppedBy) -> Result<ClusteredMesh, SimplifyError> {
        self.made_with(clusters, &self.locked, by)
    }

    fn made_with(
        &self,
        clusters: &Clusters,
        locked: &LockedPositions,
        by: StoppedBy,
    ) -> Result<ClusteredMesh, SimplifyError> {
        let Clusters { grid, of, cells, first_locked, faces, shares } = clusters;
        let all = cells.len();
        let borders = match self.options.border {
            BorderPolicy::Free => 0.0,
            _ => self.options.weights.border,
        };
        let (placed, non_manifold_edges) = chunks::both(
            self.model.faces.len(),
            || place::place(&self.model, clusters, borders),
            || faces::non_manifold_edges(faces, all),
        );
        let number = |c: u32| placed.number(shares, c);
        let mut points = vec![P::of([0.0; 3]); placed.points.iter().map(Vec::len).sum()];
        let mut triangles = vec![[VertexId(0); 3]; clusters.face_count()];
        let points_of = chunks::cut(&mut points, placed.points.iter().map(Vec::len));
        let triangles_of = chunks::cut(&mut triangles, faces.iter().map(Vec::len));
        chunks::over(points_of.into_iter().zip(triangles_of).collect(), |k, (points, triangles)| {
            points.copy_from_slice(&placed.points[k]);
            for (t, f) in triangles.iter_mut().zip(&faces[k]) {
                *t = f.corners.map(|c| VertexId(number(c).expect("it has this face")));
            }
        });
        let mut is_locked = Vec::new();
        if !locked.places.is_empty() {
            // Index of some vertex of each cluster.
            let mut some = vec![NONE; all];
            let used = (0..of.len()).rev().filter(|&v| self.model.is_used(v));
            used.for_each(|v| some[of[v] as usize] = VertexId::new(v));
            for (c, &some) in some.iter().enumerate() {
                let Some(n) = number(c as u32) else { continue };
                let point = &mut points[n as usize];
                *point = match c.checked_sub(*first_locked) {
                    None => self.beside(*point, some, locked),
                    Some(place) => self.model.points[locked.places[place].index()],
                };
                is_locked.push(c >= *first_locked);
            }
        }
        let mut mesh = TriMesh::new(P::positions(points), triangles)?;
        let mut held = HeldWedges::default();
        if let Some(input) = self.input.mesh {
            let origin = |f: &faces::ClusterFace| self.model.origin(f.from);
            if let Some(regions) = input.regions() {
                mesh.set_regions(Some(
                    faces.iter().flatten().map(|f| regions[origin(f)]).collect::<Vec<RegionId>>(),
                ))?;
            }
            if !self.locked.places.is_empty() {
                held = HeldWedges::new(faces.iter().flatten().map(|f| {
                    let of_face = self.model.faces[f.from as usize].map(|v| of[v.index()]);
                    f.corners.map(|c| {
                        let k = of_face.iter().position(|x| *x == c && c as usize >= *first_locked)?;
                        Some(input.triangles()[origin(f)][k])
                    })
                }));
            }
        }
        let estimate = ESTIMATE_PER_PLANE_RMS * placed.mean_square.sqrt();
        let is_grid = by != StoppedBy::Nothing;
        Ok(ClusteredMesh {
            mesh,
            locked: is_locked.contains(&true).then_some(is_locked),
            held,
            estimate: if is_grid { estimate.min(self.diagonal) } else { 0.0 },
            cell: if is_grid { grid.cell } else { 0.0 },
            non_manifold_edges,
            by,
        })
    }

    /// Returns the position of a cell's vertex; if a locked vertex is there, a point halfway to a vertex of
    /// the cell.
    fn beside(&self, place: P, some: VertexId, locked: &LockedPositions) -> P {
        match some != NONE && locked.is_taken(place.wide()) {
            true => P::of((0.5 * (place.wide() + self.model.place(some))).to_array()),
            false => place,
        }
    }

    /// Finds the coarsest result within `limit` that is no coarser than goal and cell size. Cell sizes are
    /// taken from one fixed sequence, which does not depend on the limit. The distance is about proportional
    /// to the cell size.
    fn within(
        &mut self,
        limit: f64,
        control: &mut dyn Control,
    ) -> Result<(ClusteredMesh, Deviation), SimplifyError> {
        let allowed = limit + ROUNDING * self.diagonal;
        let has_goal = self.goal.faces.is_some() || self.goal.vertices.is_some();
        let Some(comparer) = self.input_comparer(control) else {
            return Ok((self.untouched()?, Deviation::default()));
        };
        let longest = self.longest();
        let mut coarsest = self.coarsest.unwrap_or(1.0);
        if has_goal || self.coarsest.is_some() {
            control.stage(Stage::Collapse);
            let made = self.reach_goal(control)?;
            control.stage(Stage::Measure);
            let judgement = comparer.proven_within_mesh(&made.mesh, allowed, control)?;
            if judgement == Judgement::Unknown {
                self.is_over = true;
                return Ok((made, Deviation::unknown()));
            }
            if judgement.bound().is_some() || self.is_over {
                let deviation = comparer.measure(&made.mesh, judgement.bound(), control)?;
                return Ok((made, deviation));
            }
            coarsest = longest / made.cell;
        }
        // Levels are powers of `RESOLUTION_STEP`; the finest has the lowest number.
        let power = |resolution: f64| -libm::log(resolution) / libm::log(RESOLUTION_STEP);
        let levels =
            -(libm::log(MAX_RESOLUTION) / libm::log(RESOLUTION_STEP)) as i64..=power(coarsest).floor() as i64;
        let resolution = longest * 3f64.sqrt() * FIRST_DISTANCE / limit.max(f64::MIN_POSITIVE);
        let begin = power(resolution.clamp(1.0, MAX_RESOLUTION)).floor() as i64;
        let mut best: Option<(i64, ClusteredMesh, f64)> = None;
        let mut asked = 0;
        search_around(levels, begin, &mut |level| {
            asked += 1;
            if !self.report_progress(1.0 - 1.0 / f64::from(asked), control)? {
                return Ok(LevelTest::Over);
            }
            control.stage(Stage::Collapse);
            let resolution = libm::pow(RESOLUTION_STEP, -level as f64).clamp(1.0, MAX_RESOLUTION);
            let clusters = Clusters::new(&self.model, &self.locked, resolution);
            let made = self.made(&clusters, StoppedBy::Error)?;
            drop(clusters);
            control.stage(Stage::Measure);
            let bound = match comparer.proven_within_mesh(&made.mesh, allowed, control)? {
                Judgement::Within(bound) => bound,
                Judgement::Unproven => return Ok(LevelTest::Beyond),
                Judgement::Unknown => {
                    self.is_over = true;
                    return Ok(LevelTest::Over);
                }
            };
            if best.as_ref().is_none_or(|b| level > b.0) {
                best = Some((level, made, bound));
            }
            Ok(LevelTest::Kept)
        })?;
        let (made, known) = match best {
            Some((_, made, bound)) => (made, Some(bound)),
            None => (self.untouched()?, None),
        };
        control.stage(Stage::Measure);
        let deviation = comparer.measure(&made.mesh, known, control)?;
        Ok((made, deviation))
    }

    fn input_comparer(&self, control: &mut dyn Control) -> Option<InputComparer> {
        control.stage(Stage::Measure);
        let sound = |t: &&[VertexId; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let faces = self.model.faces.iter().filter(sound).copied().collect();
        let clean = Surface::with_triangles(self.input.surface.positions(), faces).ok()?;
        InputComparer::new(&clean, self.options)
    }

    fn build_report(
        self,
        mut made: ClusteredMesh,
        deviation: Deviation,
    ) -> Result<(Simplified, HeldWedges), SimplifyError> {
        if let Some(input) = self.input.mesh.filter(|mesh| mesh.has_attributes()) {
            made.mesh = transfer_to_bare_mesh(self.input, &made.mesh)?;
            made.held.restore(&mut made.mesh, input);
        }
        let stop = &self.options.stop;
        let input_faces = self.input.surface.triangles().len();
        let (faces, vertices) = (made.mesh.face_count(), made.mesh.vertex_count());
        let met = |n: Option<usize>, count: usize| n.is_some_and(|n| count <= n);
        let limit = stop.error.map(|e| e.in_units(self.diagonal));
        let stopped_by = match () {
            () if self.is_over => StoppedBy::Caller,
            () if met(stop.faces, faces) => StoppedBy::Faces,
            () if met(stop.vertices, vertices) => StoppedBy::Vertices,
            () if met(stop.ratio.map(|r| run::share(r, input_faces)), faces) => StoppedBy::Ratio,
            () if limit.is_some() => StoppedBy::Error,
            // Even one cell was over the goal.
            () if matches!(made.by, StoppedBy::Faces | StoppedBy::Vertices) => StoppedBy::Exhausted,
            () => made.by,
        };
        let rounding = ROUNDING * self.diagonal;
        let within = |l: f64| deviation.largest().is_some_and(|d| d <= l + rounding);
        let reached = match stopped_by {
            StoppedBy::Caller => false,
            StoppedBy::Error => limit.is_some_and(within),
            StoppedBy::Exhausted | StoppedBy::Refusals => {
                self.goal.faces.is_none() && self.goal.vertices.is_none()
            }
            _ => true,
        };
        let report = Report {
            input_faces,
            input_vertices: self.model.points.len(),
            faces,
            vertices,
            reached,
            stopped_by,
            error: ErrorReport {
                estimate: made.estimate,
                measured: deviation.measured,
                farthest_part: None,
                bound: deviation.bound,
                is_incomplete: deviation.is_incomplete,
                diagonal: self.diagonal,
            },
            refusals: Vec::new(),
            collapses: 0,
            parts_removed: 0,
            necks_cut: 0,
            pairs_contracted: 0,
            locked_vertices: self.locked.places.len(),
            locked_faces: self.locked.faces,
            seams_relaxed: false,
            sharp_relaxed: false,
            cleanup: self.model.cleanup,
            dropped: self.input.mesh.map_or_else(Vec::new, |mesh| run::names_of_dropped(mesh, &made.mesh)),
            fitted: false,
            proposals: Vec::new(),
            escalated: Vec::new(),
            pruned: Pruned::default(),
            gaps: 0,
            two_sided_pairs: 0,
            unpaired_sheets: 0,
            clustered: Some(clustered(&made)),
            faces_visited: 0,
        };
        Ok((Simplified { mesh: made.mesh, report }, made.held))
    }
}

fn clustered(made: &ClusteredMesh) -> Clustered {
    Clustered {
        cell: made.cell,
        faces: made.mesh.face_count(),
        vertices: made.mesh.vertex_count(),
        non_manifold_edges: made.non_manifold_edges,
    }
}
