//! Clean-up: what is broken in a mesh is mended, step by step, and each step says what it did.

pub(crate) mod orient;
mod pairs;
mod slivers;

use std::borrow::Cow;

use lodsmith_core::mesh::compact::compact;
use lodsmith_core::mesh::defects::{defects, duplicates};
use lodsmith_core::mesh::weld::{Weld, weld, weld_mesh_by, weld_within};
use lodsmith_core::topology::Topology;
use lodsmith_core::{Positions, RegionId, Surface, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::control::{Control, Stage, Verdict};
use crate::options::Length;
use crate::prune::{self, Pruned};
use crate::run::with_attributes;

/// What becomes of edges with more than two faces, and of vertices where a surface only touches itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NonManifold {
    /// They stay. Vertices at one place are one.
    #[default]
    Keep,
    /// The surface is parted there: of the faces round an edge those stay joined that bound the same inside, the others
    /// get vertices of their own at the same places. What comes out is manifold, with borders where nothing was left to
    /// join with. [Gueziec et al. 2001]
    Cut,
    /// Vertices stay apart as the mesh has them, and borders at the same places are sewn together, two faces to an edge.
    /// So cracks close, and what only touches is not joined.
    Merge,
}

/// What a clean-up is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CleanOptions {
    /// Vertices closer than this are joined. Equal places always are, but with [`NonManifold::Merge`], which joins along
    /// borders alone.
    pub weld: Option<Length>,
    /// What becomes of what is not manifold.
    pub non_manifold: NonManifold,
    /// Connected parts whose bounding box has a diagonal below this go; the largest stays in any case.
    pub prune: Option<Length>,
}

/// A mesh after its clean-up, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleaned {
    /// The mesh. Faces and vertices keep their order; what is new comes last.
    pub mesh: TriMesh,
    /// What was done, and what is left.
    pub report: CleanReport,
}

/// What a clean-up did, in the order of its steps, and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CleanReport {
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// Vertices that became one with another.
    pub welded_vertices: usize,
    /// Faces with a corner that is not finite: dropped.
    pub non_finite_faces: usize,
    /// Faces that name a place twice: dropped.
    pub degenerate_faces: usize,
    /// Faces over the same places as an earlier one, turned the same way: dropped.
    pub duplicate_faces: usize,
    /// Small parts: dropped.
    pub pruned: Pruned,
    /// Faces turned over, so that neighbours agree and closed parts look outward.
    pub flipped_faces: usize,
    /// Faces without area: taken together with their neighbour over the longest edge, which is divided in their place;
    /// on a border dropped.
    pub zero_area_faces: usize,
    /// Vertices added where the surface was parted ([`NonManifold::Cut`]).
    pub parted_vertices: usize,
    /// Border edges joined with another ([`NonManifold::Merge`]), counted as pairs.
    pub sewn_edges: usize,
    /// Vertices that no face uses: dropped.
    pub unused_vertices: usize,
    /// What is still there.
    pub left: Left,
    /// Steps taken at faces without area, as a measure of the work done: a few for each.
    #[doc(hidden)]
    pub steps: usize,
}

/// What a clean-up leaves; vertices are told apart by their number, not by their place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Left {
    /// Edges with one face.
    pub border_edges: usize,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Vertices whose faces do not hang together.
    pub non_manifold_vertices: usize,
    /// Edges whose two faces disagree about the outside: one-sided surfaces have them.
    pub misoriented_edges: usize,
    /// Faces that lie back to back with an earlier one.
    pub opposite_faces: usize,
    /// Faces without area.
    pub zero_area_faces: usize,
}

/// A mesh on its way: faces may go and turn, wedges and vertices stand.
struct Work<'a> {
    mesh: &'a TriMesh,
    /// The place of each vertex: the vertex that stands for it.
    place: Weld,
    faces: Vec<[WedgeId; 3]>,
    regions: Option<Vec<RegionId>>,
}

impl Work<'_> {
    /// The places of a face.
    fn places(&self, t: [WedgeId; 3]) -> [VertexId; 3] {
        t.map(|w| self.place.of(self.mesh.vertex_of(w)))
    }
    /// The faces over places.
    fn surface(&self) -> Result<Surface<'_>, SimplifyError> {
        let triangles = self.faces.iter().map(|&t| self.places(t)).collect();
        Ok(Surface::with_triangles(self.mesh.positions().view(), triangles)?)
    }
    /// Drops the marked faces.
    fn drop_faces(&mut self, goes: impl Fn(usize) -> bool) {
        let mut at = 0;
        let mut stays = || {
            at += 1;
            !goes(at - 1)
        };
        self.faces.retain(|_| stays());
        at = 0;
        if let Some(regions) = &mut self.regions {
            regions.retain(|_| {
                at += 1;
                !goes(at - 1)
            });
        }
    }
}

/// Mends a mesh.
///
/// The steps, in this order: vertices at the same place, or closer than asked, become one; faces that are not finite,
/// name a place twice or stand there already go; small parts go, if asked; faces are turned so that neighbours agree,
/// closed parts outward, open ones as most of their faces were (a closed part inside another keeps the side of most of
/// its faces, for it may be a cavity); faces without area go where that opens nothing; what is not manifold is dealt with
/// as asked; vertices without a face go. Attributes stay on their wedges, and regions on their faces. Positions are not
/// changed, but for those of vertices joined with another. A face that turns keeps its normals. Sharing of edges is by
/// places throughout.
///
/// It ends on any input: each step at faces without area leaves fewer of them, or as many with shorter edges, and each
/// round of parting a surface leaves fewer edges joined.
/// Cost: O(n log n), whatever the number of faces at an edge or a vertex.
///
/// # Errors
/// [`SimplifyError::NoFaces`] if no face is left, [`SimplifyError::BadOption`], [`SimplifyError::Cancelled`].
pub fn clean(
    mesh: &TriMesh,
    options: &CleanOptions,
    control: &mut dyn Control,
) -> Result<Cleaned, SimplifyError> {
    check(options)?;
    control.stage(Stage::Prepare);
    let mut report =
        CleanReport { input_faces: mesh.face_count(), input_vertices: mesh.vertex_count(), ..<_>::default() };
    let mut ask = |done: f64| match control.progress(done) {
        Verdict::Cancel => Err(SimplifyError::Cancelled),
        Verdict::Continue | Verdict::Finish => Ok(()),
    };
    ask(0.0)?;
    let diagonal = prune::diagonal(&mesh.surface());
    let near = options.weld.map(|d| d.in_units(diagonal));
    let view = mesh.positions().view();
    let place = near.map_or_else(|| weld(view), |d| weld_within(view, d));
    let is_sewn = options.non_manifold == NonManifold::Merge;
    let source = if is_sewn || place.is_identity() {
        Cow::Borrowed(mesh)
    } else {
        let welded = weld_mesh_by(mesh, &place);
        report.welded_vertices = welded.merged_vertex_count;
        Cow::Owned(welded.mesh)
    };
    let place = match is_sewn {
        true => place,
        false => Weld::from_representatives((0..source.vertex_count()).map(VertexId::new).collect()),
    };
    let mut work = Work {
        mesh: &source,
        place,
        faces: source.triangles().to_vec(),
        regions: source.regions().map(<[_]>::to_vec),
    };
    ask(0.2)?;
    drop_broken(&mut work, &mut report);
    ask(0.35)?;
    if let Some(size) = options.prune {
        let small = prune::small_parts(&work.surface()?, size.in_units(diagonal), None, None);
        report.pruned = small.pruned;
        work.drop_faces(|f| small.is_small[f]);
    }
    if work.faces.is_empty() {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    ask(0.4)?;
    let turned = orient::turned(&work.surface()?);
    for (t, _) in work.faces.iter_mut().zip(&turned).filter(|x| *x.1) {
        t.swap(1, 2);
        report.flipped_faces += 1;
    }
    ask(0.6)?;
    let mended = slivers::mend(&mut work);
    (report.zero_area_faces, report.steps) = (mended.faces, mended.steps);
    if work.faces.is_empty() {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    ask(0.7)?;
    let Work { faces, regions, place, .. } = work;
    let mended = rebuilt(&source, faces, regions)?;
    let whole = match options.non_manifold {
        NonManifold::Keep => mended,
        NonManifold::Cut => {
            let parted = pairs::parted(&mended.surface());
            report.parted_vertices = parted.copy_of.len();
            if parted.copy_of.is_empty() { mended } else { with_copies(&mended, &parted)? }
        }
        NonManifold::Merge => {
            let (sewn, edges) = pairs::sewn(&mended.surface(), &place);
            report.sewn_edges = edges;
            let welded = weld_mesh_by(&mended, &sewn);
            report.welded_vertices = welded.merged_vertex_count;
            welded.mesh
        }
    };
    ask(0.85)?;
    let compacted = compact(&whole);
    report.unused_vertices = compacted.dropped_vertex_count;
    let mesh = compacted.mesh;
    report.left = left(&mesh);
    (report.faces, report.vertices) = (mesh.face_count(), mesh.vertex_count());
    Ok(Cleaned { mesh, report })
}

fn check(options: &CleanOptions) -> Result<(), SimplifyError> {
    for (option, length) in [("weld", options.weld), ("prune", options.prune)] {
        let Some(Length::Units(got) | Length::OfDiagonal(got)) = length else { continue };
        if !(got.is_finite() && got >= 0.0) {
            return Err(SimplifyError::BadOption { option, wanted: "a length of 0 or more", got });
        }
    }
    Ok(())
}

/// Drops faces that are not finite, name a place twice, or stand there already.
fn drop_broken(work: &mut Work<'_>, report: &mut CleanReport) {
    let positions = work.mesh.positions().view();
    let mut goes = vec![false; work.faces.len()];
    for (goes, &t) in goes.iter_mut().zip(&work.faces) {
        let [a, b, c] = work.places(t);
        let is_finite = [a, b, c].iter().all(|&v| positions.get(v).iter().all(|x| x.is_finite()));
        report.non_finite_faces += usize::from(!is_finite);
        let repeats = a == b || b == c || c == a;
        report.degenerate_faces += usize::from(is_finite && repeats);
        *goes = repeats || !is_finite;
    }
    work.drop_faces(|f| goes[f]);
    let places: Vec<_> = work.faces.iter().map(|&t| work.places(t)).collect();
    let twice = duplicates(&places, positions.len()).same_winding;
    report.duplicate_faces = twice.len();
    work.drop_faces(|f| twice.binary_search_by_key(&f, |d| d.index()).is_ok());
}

/// The same wedges under other faces.
fn rebuilt(
    source: &TriMesh,
    faces: Vec<[WedgeId; 3]>,
    regions: Option<Vec<RegionId>>,
) -> Result<TriMesh, SimplifyError> {
    let positions = source.positions().clone();
    let mut mesh = match source.vertex_map() {
        Some(map) => TriMesh::with_wedges(positions, map.to_vec(), faces)?,
        None => TriMesh::new(positions, bytemuck::allocation::cast_vec(faces))?,
    };
    mesh.set_normals(source.normals().map(<[_]>::to_vec))?;
    mesh.set_uvs(source.uvs().map(<[_]>::to_vec))?;
    mesh.set_colors(source.colors().map(<[_]>::to_vec))?;
    for a in source.further_attributes() {
        mesh.add_attribute(a.clone())?;
    }
    mesh.set_regions(regions)?;
    Ok(mesh)
}

/// A mesh over vertices some of which are copies, with the wedges that they had.
fn with_copies(mesh: &TriMesh, parted: &pairs::Parted) -> Result<TriMesh, SimplifyError> {
    let mut positions = mesh.positions().clone();
    match &mut positions {
        Positions::F32(p) => parted.copy_of.iter().for_each(|v| p.push(p[v.index()])),
        Positions::F64(p) => parted.copy_of.iter().for_each(|v| p.push(p[v.index()])),
    }
    let mut copied = with_attributes(mesh, positions, &parted.faces, mesh.triangles())?;
    copied.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    Ok(copied)
}

fn left(mesh: &TriMesh) -> Left {
    let surface = mesh.surface();
    let counts = Topology::unwelded(&surface).counts();
    let found = defects(&surface);
    Left {
        border_edges: counts.border_edge_count,
        non_manifold_edges: counts.non_manifold_edge_count,
        non_manifold_vertices: counts.non_manifold_vertex_count,
        misoriented_edges: counts.misoriented_edge_count,
        opposite_faces: found.opposite_duplicate_count,
        zero_area_faces: found.zero_area_face_count,
    }
}
