//! Mesh clean-up: repairs defects in steps, and reports what each step did.

pub(crate) mod orient;
mod pairs;
mod slivers;
mod state;

use std::borrow::Cow;

use lodsmith_core::mesh::compact::compact;
use lodsmith_core::mesh::defects::{defects, duplicates};
use lodsmith_core::mesh::weld::{Weld, weld, weld_mesh_by, weld_within};
use lodsmith_core::topology::Topology;
use lodsmith_core::{Positions, RegionId, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::attributes::with_input_attributes;
use crate::control::{Control, Stage, Verdict};
use crate::options::Length;
use crate::options::names::name_values;
use crate::prune::{self, Pruned};
use crate::two_sided::{self, Sides};
use state::CleanState;

/// Treatment of edges with more than two faces, and of vertices where a surface touches itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NonManifold {
    /// Keep them. Coincident vertices are merged.
    #[default]
    Keep,
    /// Cut the surface there: faces around an edge that bound the same inside stay connected, the others get
    /// their own copies of the vertices. The result is manifold, with borders where no matching face was
    /// left. [Gueziec et al. 2001]
    Cut,
    /// Keep vertices separate as in the mesh, and sew coincident borders together, two faces to an edge. This
    /// closes cracks without joining surfaces that only touch.
    Merge,
}

name_values! {
    NonManifold { Keep = "keep", Cut = "cut", Merge = "merge" }
}

/// Treatment of faces that lie on each other with opposite windings: the two sides of a sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sheets {
    /// Keep both sides.
    #[default]
    Both,
    /// Keep one side, consistently for connected faces. To be visible from both sides it needs a double-sided
    /// material: [`Cleaned::single_sided`] lists the regions.
    Single,
}

name_values! {
    Sheets { Both = "both", Single = "single" }
}

/// Options of [`clean`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CleanOptions {
    /// Vertices closer than this are merged. Coincident vertices always are, except with
    /// [`NonManifold::Merge`], which only merges along borders.
    pub weld: Option<Length>,
    /// Treatment of non-manifold edges and vertices.
    pub non_manifold: NonManifold,
    /// Connected components whose bounding box has a diagonal below this are removed; the largest is always
    /// kept.
    pub prune: Option<Length>,
    /// Treatment of the two sides of sheets.
    pub sheets: Sheets,
}

/// A cleaned mesh, with a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleaned {
    /// The mesh. Faces and vertices keep their order; new ones come last.
    pub mesh: TriMesh,
    /// The changes made and the defects left.
    pub report: CleanReport,
    /// With [`Sheets::Single`], the regions of faces that lost their other side, ascending; the first region for a
    /// mesh without any.
    pub single_sided: Vec<RegionId>,
}

/// Changes made by a clean-up, in the order of its steps, and the defects left.
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
    /// Vertices merged into another.
    pub welded_vertices: usize,
    /// Faces with a non-finite corner: dropped.
    pub non_finite_faces: usize,
    /// Faces with two corners at one position: dropped.
    pub degenerate_faces: usize,
    /// Duplicates of an earlier face, with the same winding: dropped.
    pub duplicate_faces: usize,
    /// Second sides of sheets: dropped ([`Sheets::Single`]).
    pub back_faces: usize,
    /// Small components: dropped.
    pub pruned: Pruned,
    /// Faces flipped, so that neighbours agree and closed components face outward.
    pub flipped_faces: usize,
    /// Zero-area faces: removed by flipping their longest edge, which divides the neighbour there; on a
    /// border dropped.
    pub zero_area_faces: usize,
    /// Vertices added by cutting the surface ([`NonManifold::Cut`]).
    pub parted_vertices: usize,
    /// Border edges sewn to another ([`NonManifold::Merge`]), counted in pairs.
    pub sewn_edges: usize,
    /// Unused vertices: dropped.
    pub unused_vertices: usize,
    /// Defects that remain.
    pub remaining: RemainingDefects,
    /// Number of repair steps at zero-area faces, a measure of the work done: a few per face.
    #[doc(hidden)]
    pub steps: usize,
}

/// Defects left by a clean-up; vertices count as different by index, not by position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RemainingDefects {
    /// Edges with one face.
    pub border_edges: usize,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Vertices whose faces form several fans.
    pub non_manifold_vertices: usize,
    /// Edges whose two faces disagree on orientation, as on one-sided surfaces.
    pub misoriented_edges: usize,
    /// Faces back to back with an earlier one.
    pub opposite_faces: usize,
    /// Faces of zero area.
    pub zero_area_faces: usize,
}

/// Cleans a mesh up.
///
/// The steps, in this order: vertices that coincide, or are closer than requested, are merged; non-finite,
/// degenerate and duplicate faces are dropped, and one side of sheets, if requested; small components are
/// removed, if requested; faces are flipped so that neighbours agree, closed components facing outward, open
/// ones as most of their faces did (a closed component inside another keeps the side of most of its faces,
/// since it may be a cavity); zero-area faces are removed where that opens no hole; non-manifold edges and
/// vertices are treated as requested; unused vertices are dropped. Attributes stay on their wedges, and
/// regions on their faces. Only merged vertices change their positions. A flipped face keeps its normals.
/// Faces share an edge if its ends have equal positions, in all steps.
///
/// It terminates on any input: each step at zero-area faces leaves fewer of them, or as many with shorter
/// edges, and each round of cutting a surface leaves fewer edges joined. Cost: O(n log n), whatever the
/// number of faces at an edge or a vertex.
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
    let mut report_progress = |done: f64| match control.progress(done) {
        Verdict::Cancel => Err(SimplifyError::Cancelled),
        Verdict::Continue | Verdict::Finish => Ok(()),
    };
    report_progress(0.0)?;
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
    let mut work = CleanState {
        mesh: &source,
        place,
        faces: source.triangles().to_vec(),
        regions: source.regions().map(<[_]>::to_vec),
    };
    report_progress(0.2)?;
    drop_broken(&mut work, &mut report);
    let single_sided = match options.sheets {
        Sheets::Both => Vec::new(),
        Sheets::Single => drop_backs(&mut work, &mut report)?,
    };
    report_progress(0.35)?;
    if let Some(size) = options.prune {
        let small = prune::small_parts(&work.surface()?, size.in_units(diagonal), None, None);
        report.pruned = small.pruned;
        work.drop_faces(|f| small.is_small[f]);
    }
    if work.faces.is_empty() {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    report_progress(0.4)?;
    let turned = orient::faces_to_flip(&work.surface()?);
    for (t, _) in work.faces.iter_mut().zip(&turned).filter(|x| *x.1) {
        t.swap(1, 2);
        report.flipped_faces += 1;
    }
    report_progress(0.6)?;
    let mended = slivers::repair(&mut work);
    (report.zero_area_faces, report.steps) = (mended.faces, mended.steps);
    if work.faces.is_empty() {
        return Err(SimplifyError::NoFaces { faces: mesh.face_count() });
    }
    report_progress(0.7)?;
    let CleanState { faces, regions, place, .. } = work;
    let mended = rebuilt(&source, faces, regions)?;
    let whole = match options.non_manifold {
        NonManifold::Keep => mended,
        NonManifold::Cut => {
            let parted = pairs::cut_non_manifold(&mended.surface());
            report.parted_vertices = parted.copy_of.len();
            if parted.copy_of.is_empty() { mended } else { with_copies(&mended, &parted)? }
        }
        NonManifold::Merge => {
            let (sewn, edges) = pairs::sew_borders(&mended.surface(), &place);
            report.sewn_edges = edges;
            let welded = weld_mesh_by(&mended, &sewn);
            report.welded_vertices = welded.merged_vertex_count;
            welded.mesh
        }
    };
    report_progress(0.85)?;
    let compacted = compact(&whole);
    report.unused_vertices = compacted.dropped_vertex_count;
    let mesh = compacted.mesh;
    report.remaining = remaining_defects(&mesh);
    (report.faces, report.vertices) = (mesh.face_count(), mesh.vertex_count());
    Ok(Cleaned { mesh, report, single_sided })
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

/// Drops non-finite, degenerate and duplicate faces.
fn drop_broken(work: &mut CleanState<'_>, report: &mut CleanReport) {
    let positions = work.mesh.positions().view();
    let mut is_dropped = vec![false; work.faces.len()];
    for (is_dropped, &t) in is_dropped.iter_mut().zip(&work.faces) {
        let [a, b, c] = work.places(t);
        let is_finite = [a, b, c].iter().all(|&v| positions.get(v).iter().all(|x| x.is_finite()));
        report.non_finite_faces += usize::from(!is_finite);
        let repeats = a == b || b == c || c == a;
        report.degenerate_faces += usize::from(is_finite && repeats);
        *is_dropped = repeats || !is_finite;
    }
    work.drop_faces(|f| is_dropped[f]);
    let places: Vec<_> = work.faces.iter().map(|&t| work.places(t)).collect();
    let twice = duplicates(&places, positions.len()).same_winding;
    report.duplicate_faces = twice.len();
    work.drop_faces(|f| twice.binary_search_by_key(&f, |d| d.index()).is_ok());
}

/// Drops the backs of sheets. Returns the regions of the fronts.
fn drop_backs(work: &mut CleanState<'_>, report: &mut CleanReport) -> Result<Vec<RegionId>, SimplifyError> {
    let Sides { fronts, backs } = two_sided::sides(&work.surface()?);
    report.back_faces = backs.len();
    let region = |f: &u32| work.regions.as_ref().map_or(RegionId::default(), |r| r[*f as usize]);
    let mut regions: Vec<RegionId> = fronts.iter().map(region).collect();
    regions.sort_unstable();
    regions.dedup();
    work.drop_faces(|f| backs.binary_search_by_key(&f, |b| *b as usize).is_ok());
    Ok(regions)
}

/// Builds a mesh from the same wedges and other faces.
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

/// Builds a mesh with copied vertices, whose wedges keep their attributes.
fn with_copies(mesh: &TriMesh, parted: &pairs::CutSurface) -> Result<TriMesh, SimplifyError> {
    let mut positions = mesh.positions().clone();
    match &mut positions {
        Positions::F32(p) => parted.copy_of.iter().for_each(|v| p.push(p[v.index()])),
        Positions::F64(p) => parted.copy_of.iter().for_each(|v| p.push(p[v.index()])),
    }
    let mut copied = with_input_attributes(mesh, positions, &parted.faces, mesh.triangles())?;
    copied.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    Ok(copied)
}

fn remaining_defects(mesh: &TriMesh) -> RemainingDefects {
    let surface = mesh.surface();
    let counts = Topology::unwelded(&surface).counts();
    let found = defects(&surface);
    RemainingDefects {
        border_edges: counts.border_edge_count,
        non_manifold_edges: counts.non_manifold_edge_count,
        non_manifold_vertices: counts.non_manifold_vertex_count,
        misoriented_edges: counts.misoriented_edge_count,
        opposite_faces: found.opposite_duplicate_count,
        zero_area_faces: found.zero_area_face_count,
    }
}
