//! Checks that apply to every result, whatever the options.

pub(crate) mod attributed;
pub(crate) mod charts;
pub(crate) mod without_ties;

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

use lodsmith::core::mesh::defects::{clean_surface, defects};
use lodsmith::core::topology::TopologyCounts;
use lodsmith::core::{Positions, Surface, Topology, TriMesh, VertexId};
use lodsmith::{
    Control, Input, Method, NoControl, Part, Refusal, Simplified, SimplifiedScene, SimplifyError,
    SimplifyOptions, StoppedBy, TopologyPolicy, Verdict, simplify_with,
};

/// Returns true if all cases of long products of cases have to be run, as `.ci/run` requests with
/// `LODSMITH_LONG=1`.
pub(crate) fn is_long() -> bool {
    std::env::var_os("LODSMITH_LONG").is_some()
}

/// Returns the size of a long product of cases: `whole` if all cases are requested, else `part`.
pub(crate) fn size<T>(whole: T, part: T) -> T {
    if is_long() { whole } else { part }
}

/// Gives a verdict from the nth question on.
pub(crate) struct EndsFrom(pub(crate) usize, pub(crate) Verdict);

impl Control for EndsFrom {
    fn progress(&mut self, done: f64) -> Verdict {
        assert!((0.0..=1.0).contains(&done), "{done}");
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { self.1 } else { Verdict::Continue }
    }
}

/// Selects the cases of a long product: all, or every `n`th. If `n` has no factor in common with the numbers
/// of options, every option occurs in some cases.
pub(crate) struct CaseFilter {
    n: usize,
    seen: usize,
}

impl CaseFilter {
    pub(crate) fn every(n: usize) -> Self {
        Self { n: if is_long() { 1 } else { n }, seen: 0 }
    }
    /// Returns true if the next case is selected.
    pub(crate) fn takes(&mut self) -> bool {
        self.seen += 1;
        (self.seen - 1).is_multiple_of(self.n)
    }
}

/// Complaints about many cases, which are reported together at the end.
#[derive(Default)]
pub(crate) struct Complaints(Vec<String>);

impl Complaints {
    pub(crate) fn add(&mut self, case: &str, complaints: impl IntoIterator<Item = String>) {
        self.0.extend(complaints.into_iter().map(|c| format!("{case}: {c}")));
    }
    pub(crate) fn check(&mut self, case: &str, holds: bool, otherwise: &str) {
        if !holds {
            self.add(case, [otherwise.to_owned()]);
        }
    }
    /// # Panics
    /// If there are complaints.
    pub(crate) fn report_all(self) {
        let shown = self.0.iter().take(25).map(|c| format!("\n  {c}")).collect::<String>();
        assert!(self.0.is_empty(), "{} complaints:{shown}", self.0.len());
    }
}

/// Returns the options that are not at their defaults, in one line.
pub(crate) fn options_text(options: &SimplifyOptions) -> String {
    let d = SimplifyOptions::default();
    let mut words = Vec::new();
    let s = &options.stop;
    words.extend(s.faces.map(|n| format!("faces {n}")));
    words.extend(s.vertices.map(|n| format!("vertices {n}")));
    words.extend(s.ratio.map(|n| format!("ratio {n}")));
    words.extend(s.error.map(|e| format!("error {e:?}")));
    let mut word = |differs: bool, text: String| words.extend(differs.then_some(text));
    word(options.method != d.method, format!("{:?}", options.method));
    word(options.fit != d.fit, format!("fit {:?}", options.fit));
    word(options.placement != d.placement, format!("{:?}", options.placement));
    word(options.border != d.border, format!("border {:?}", options.border));
    word(options.topology != d.topology, format!("topology {:?}", options.topology));
    word(options.guards != d.guards, format!("{:?}", options.guards));
    word(options.weld.is_some(), format!("weld {:?}", options.weld));
    word(options.prune.is_some(), format!("prune {:?}", options.prune));
    word(options.escalate, "escalate".into());
    word(options.per_mesh, "per mesh".into());
    word(options.shape_normals, "shape normals".into());
    word(options.weights != d.weights, format!("{:?}", options.weights));
    word(options.measure != d.measure, "measured".into());
    word(options.seed != d.seed, format!("seed {}", options.seed));
    words.join(", ")
}

/// Runs; a panic becomes a complaint.
pub(crate) fn run<'a>(
    input: impl Into<Input<'a>>,
    options: &SimplifyOptions,
) -> Result<Result<Simplified, SimplifyError>, String> {
    let input = input.into();
    catch_unwind(AssertUnwindSafe(|| simplify_with(input, options, &mut NoControl))).map_err(|cause| {
        let text = cause.downcast_ref::<String>().cloned();
        let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_owned()));
        format!("panics: {}", text.unwrap_or_default())
    })
}

/// Returns the three coordinates as bits.
pub(crate) fn bits(p: [f64; 3]) -> [u64; 3] {
    p.map(f64::to_bits)
}

/// Returns the positions of a mesh as bits.
pub(crate) fn places(mesh: &TriMesh) -> HashSet<[u64; 3]> {
    mesh.positions().view().iter().map(bits).collect()
}

/// Returns all buffers of a mesh as bits: equal meshes give equal bytes.
pub(crate) fn bytes(mesh: &TriMesh) -> Vec<u64> {
    let mut all: Vec<u64> = mesh.positions().view().iter().flat_map(bits).collect();
    all.extend(mesh.triangles().iter().flatten().map(|w| u64::from(w.0)));
    all.extend(mesh.vertex_map().into_iter().flatten().map(|v| u64::from(v.0)));
    let floats = mesh.normals().into_iter().flatten().flatten();
    let floats = floats.chain(mesh.uvs().into_iter().flatten().flatten());
    let floats = floats.chain(mesh.colors().into_iter().flatten().flatten());
    let floats = floats.chain(mesh.further_attributes().iter().flat_map(|a| &a.values));
    all.extend(floats.map(|x| u64::from(x.to_bits())));
    all.extend(mesh.regions().into_iter().flatten().map(|r| u64::from(r.0)));
    all
}

/// Returns the defects of a result that no mesh should have.
fn mesh_complaints(mesh: &TriMesh, result: &TriMesh) -> Vec<String> {
    let mut found = Vec::new();
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));
    let (faces, vertices) = (result.face_count(), result.vertex_count());
    check(faces <= mesh.face_count(), format!("{faces} faces from {}", mesh.face_count()));
    let surface = result.surface();
    check(
        surface.triangles().iter().flatten().all(|v| v.index() < vertices),
        "an index is out of range".into(),
    );
    let infinite = surface.positions().iter().filter(|p| !p.iter().all(|x| x.is_finite())).count();
    check(infinite == 0, format!("{infinite} vertices are not finite"));
    let flat = surface.triangles().iter().filter(|t| t[0] == t[1] || t[1] == t[2] || t[2] == t[0]).count();
    check(flat == 0, format!("{flat} degenerate faces"));
    let mut seen = HashSet::new();
    let twice = surface.triangles().iter().filter(|t| !seen.insert(turned(**t))).count();
    check(twice == 0, format!("{twice} duplicate faces"));
    let used: HashSet<VertexId> = surface.triangles().iter().flatten().copied().collect();
    check(used.len() == vertices, format!("{} of {vertices} vertices are used", used.len()));
    let is_double = |m: &TriMesh| matches!(m.positions(), Positions::F64(_));
    check(is_double(mesh) == is_double(result), "the precision changed".into());
    found
}

/// Checks the guarantees that hold for any mesh; by index, not by position.
pub(crate) fn complaints(mesh: &TriMesh, options: &SimplifyOptions, done: &Simplified) -> Vec<String> {
    let (result, report) = (&done.mesh, &done.report);
    let (faces, vertices) = (result.face_count(), result.vertex_count());
    let mut found = mesh_complaints(mesh, result);
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));

    // The report.
    check(
        (report.faces, report.vertices) == (faces, vertices),
        format!("the report has {} faces, {} vertices", report.faces, report.vertices),
    );
    check(
        (report.input_faces, report.input_vertices) == (mesh.face_count(), mesh.vertex_count()),
        "the report has the counts of another input".into(),
    );
    let stop = &options.stop;
    let by_faces = stop.faces.is_some_and(|n| faces <= n);
    let by_vertices = stop.vertices.is_some_and(|n| vertices <= n);
    let by_ratio =
        stop.ratio.is_some_and(|r| faces as f64 <= (r * mesh.face_count() as f64).round().max(1.0));
    let met = by_faces || by_vertices || by_ratio;
    let counts = stop.faces.is_some() || stop.vertices.is_some() || stop.ratio.is_some();
    let stopped_by = report.stopped_by;
    // The cell size of clustering is a stop too.
    let has_cell = matches!(options.method, Method::Cluster { cell: Some(_), .. });
    let by_cell = stopped_by == StoppedBy::Exhausted && has_cell;
    if stop.error.is_none() && counts && !by_cell {
        check(
            report.reached == met,
            format!("reached is {} at {faces} faces, {vertices} vertices", report.reached),
        );
    }
    let is_true = match stopped_by {
        StoppedBy::Faces => by_faces,
        StoppedBy::Vertices => by_vertices,
        StoppedBy::Ratio => by_ratio,
        StoppedBy::Error => stop.error.is_some(),
        StoppedBy::Refusals | StoppedBy::Exhausted => !met,
        StoppedBy::Nothing => !counts || report.collapses == 0,
        _ => false,
    };
    check(is_true, format!("stopped by {stopped_by:?} at {faces} faces, {vertices} vertices"));
    let order = |r: Refusal| Refusal::ALL.iter().position(|&x| x == r);
    check(
        report.refusals.is_sorted_by(|a, b| order(a.0) < order(b.0))
            && report.refusals.iter().all(|r| r.1 > 0),
        format!("refusals {:?}", report.refusals),
    );
    let error = &report.error;
    check(
        error.estimate.is_finite() && error.estimate >= 0.0 && error.estimate <= error.diagonal,
        format!("estimate {} of a diagonal {}", error.estimate, error.diagonal),
    );
    if options.topology == TopologyPolicy::Preserve && !options.escalate {
        check(report.necks_cut == 0, format!("{} necks cut", report.necks_cut));
    }
    if options.topology == TopologyPolicy::Preserve && !options.escalate {
        check(report.parts_removed == 0, format!("{} parts removed", report.parts_removed));
    }
    if let Some(limit) = stop.error {
        // The measurement itself rounds.
        let limit = limit.in_units(error.diagonal) + 1e-12 * error.diagonal;
        let got = error.measured.as_ref().map(|m| m.hausdorff.symmetric);
        check(got.is_some_and(|d| d <= limit), format!("measured {got:?} beyond {limit}"));
    }
    found
}

/// Checks the guarantees that hold for a scene of any meshes.
pub(crate) fn scene_complaints(
    parts: &[Part<'_>],
    options: &SimplifyOptions,
    diagonal: f64,
    done: &SimplifiedScene,
) -> Vec<String> {
    let mut found = Vec::new();
    let report = &done.report;
    let is_placed = parts.iter().any(|p| p.instances > 0);
    let times = |i: usize| if is_placed { parts[i].instances } else { 1 };
    let sum = |of: &dyn Fn(usize) -> usize| (0..parts.len()).map(|i| times(i) * of(i)).sum::<usize>();
    let (input_faces, input_vertices) =
        (sum(&|i| parts[i].mesh.face_count()), sum(&|i| parts[i].mesh.vertex_count()));
    let faces = sum(&|i| done.meshes[i].face_count());
    let vertices = sum(&|i| done.meshes[i].vertex_count());
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));
    check(done.meshes.len() == parts.len() && done.counts.len() == parts.len(), "a mesh is missing".into());
    let reported = [report.input_faces, report.input_vertices, report.faces, report.vertices];
    let is = [input_faces, input_vertices, faces, vertices];
    check(reported == is, format!("the report has {reported:?} for {is:?}"));
    check(report.error.diagonal == diagonal, "the diagonal is wrong".into());
    let estimate = report.error.estimate;
    check(estimate.is_finite() && estimate >= 0.0, format!("estimate {estimate}"));
    let met = |faces: usize, vertices: usize, all: usize| {
        let stop = &options.stop;
        let share = |r: f64| (r * all as f64).round().max(1.0);
        stop.faces.is_some_and(|n| faces <= n)
            || stop.vertices.is_some_and(|n| vertices <= n)
            || stop.ratio.is_some_and(|r| faces as f64 <= share(r))
    };
    // A mesh in which no face has an area is unchanged.
    let is_left = |i: usize| options.per_mesh && done.meshes[i] == *parts[i].mesh;
    let each = || {
        let counts = done.counts.iter().enumerate();
        counts.map(|(i, c)| is_left(i) && c.reached || met(c.faces, c.vertices, c.input_faces))
    };
    if options.stop.error.is_none() {
        let reached = match options.per_mesh {
            true => each().all(|met| met),
            false => met(faces, vertices, input_faces),
        };
        check(report.reached == reached, format!("reached is {} at {faces} faces", report.reached));
    }
    for (i, (part, mesh)) in parts.iter().zip(&done.meshes).enumerate() {
        let c = &done.counts[i];
        let reported = [c.instances, c.input_faces, c.input_vertices, c.faces, c.vertices];
        let (before, own) = (part.mesh, mesh);
        let is = [
            part.instances,
            before.face_count(),
            before.vertex_count(),
            own.face_count(),
            own.vertex_count(),
        ];
        check(reported == is, format!("part {i}: counts {reported:?} for {is:?}"));
        let locked = part.data.locked;
        let mut wrongs = if is_left(i) { Vec::new() } else { mesh_complaints(before, own) };
        if !is_left(i) {
            // A position that is locked in one part is locked in its neighbours.
            let near = vec![true; before.vertex_count()];
            let is_near = part.system.is_some() && parts.iter().any(|p| p.data.locked.is_some());
            let held = if is_near { Some(&near[..]) } else { locked };
            wrongs.extend(attributed::attribute_complaints(before, options.placement, held, own));
        }
        if let Some(locked) = locked {
            // Parts that touch are welded.
            let welded = options.weld.is_some() || parts.iter().any(|p| p.system.is_some());
            wrongs.extend(attributed::locked_complaints(
                before,
                locked,
                (welded, report.pairs_contracted > 0),
                own,
            ));
        }
        wrongs.into_iter().for_each(|x| check(false, format!("part {i}: {x}")));
    }
    found
}

/// Returns the topology of a mesh as an engine sees it: welded, without broken and duplicate faces.
pub(crate) fn counts(mesh: &TriMesh) -> TopologyCounts {
    let surface = mesh.surface();
    let cleaned = clean_surface(&surface, None);
    let surface = Surface::with_triangles(surface.positions(), cleaned.triangles).expect("indices stay");
    Topology::unwelded(&surface).counts()
}

/// Checks the guarantees of a topology policy; by position, as in a file.
pub(crate) fn topology_complaints(
    mesh: &TriMesh,
    options: &SimplifyOptions,
    done: &Simplified,
) -> Vec<String> {
    let mut found = Vec::new();
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));
    let (old_defects, new_defects) = (defects(&mesh.surface()), defects(&done.mesh.surface()));
    let flat = new_defects.degenerate_face_count;
    check(flat == 0, format!("{flat} faces with two corners at one position"));
    let twice = new_defects.same_winding_duplicate_count;
    check(twice == 0, format!("{twice} duplicate faces, by position"));
    if options.topology == TopologyPolicy::Free {
        return found;
    }
    let (old, new) = (counts(mesh), counts(&done.mesh));
    let mut not_above = |what: &str, old: usize, new: usize| {
        check(new <= old, format!("{what}: {old} became {new}"));
    };
    not_above("border edges", old.border_edge_count, new.border_edge_count);
    not_above("non-manifold edges", old.non_manifold_edge_count, new.non_manifold_edge_count);
    not_above("non-manifold vertices", old.non_manifold_vertex_count, new.non_manifold_vertex_count);
    // An edge of four faces can become one of two faces with opposite winding.
    let twisted = |c: &TopologyCounts| c.misoriented_edge_count + c.non_manifold_edge_count;
    not_above("misoriented or non-manifold edges", twisted(&old), twisted(&new));
    not_above(
        "faces back to back",
        old_defects.opposite_duplicate_count,
        new_defects.opposite_duplicate_count,
    );
    not_above("zero-area faces", old_defects.zero_area_face_count, new_defects.zero_area_face_count);
    if options.topology == TopologyPolicy::Preserve {
        let mut stays = |what: &str, old: i64, new: i64| {
            check(new == old, format!("{what}: {old} became {new}"));
        };
        stays("parts", old.component_count as i64, new.component_count as i64);
        if old.is_manifold() {
            stays("Euler number", old.euler(), new.euler());
            stays("border loops", old.border_loop_count as i64, new.border_loop_count as i64);
        }
    }
    found
}

/// Returns a face rotated to start at its lowest vertex.
fn turned(t: [VertexId; 3]) -> [VertexId; 3] {
    let [a, b, c] = t;
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or(t)
}

/// A small seeded generator (xorshift64*, Vigna 2016): the same numbers on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) % n
    }
    pub(crate) fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / (1u64 << 30) as f64
    }
    pub(crate) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u64) as usize]
    }
}
