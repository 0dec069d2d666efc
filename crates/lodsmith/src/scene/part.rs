//! The meshes of a scene, and the results of simplifying them.

use std::fmt;

use glam::{DMat3, DVec3};
use lodsmith_core::measure::{CompareOptions, compare};
use lodsmith_core::numbers::{grouped, significant};
use lodsmith_core::topology::size_of;
use lodsmith_core::{PositionsView, Surface, TriMesh};

use crate::input::MeshData;
use crate::report::Report;

/// A transform: three rows, each of three factors and a translation.
pub type Place = [[f64; 4]; 3];

/// A mesh of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The mesh, in its own coordinates.
    pub mesh: &'a TriMesh,
    /// Number of instances in the scene. A mesh without instances is simplified too but not counted, unless
    /// no mesh has any.
    pub instances: usize,
    /// Scale of the mesh in the scene: the largest, if several instances or axes have different ones.
    pub scale: f64,
    /// The rows of a linear map that gives the mesh the lengths that it has in the scene, if its scale
    /// differs by axis: the mesh is simplified and measured as transformed by it. `None` if [`Part::scale`]
    /// is the factor of all lengths or, for instances stretched in different ways, their upper bound. A map
    /// without an inverse counts as `None`.
    pub stretch: Option<[[f64; 3]; 3]>,
    /// Number of the coordinate system of the mesh, if it has one instance. Parts of one system that touch
    /// stay connected.
    pub system: Option<usize>,
    /// The transforms of its instances in the scene, if known. Borders of two parts that touch there stay
    /// connected too; for instances, by keeping the vertices at which they touch.
    pub places: &'a [Place],
    /// Locked vertices, importance, images and classes of regions of the mesh.
    pub data: MeshData<'a>,
}

impl<'a> Part<'a> {
    /// Takes a mesh with one instance, unscaled, with an unknown place.
    pub fn new(mesh: &'a TriMesh) -> Self {
        let data = MeshData::default();
        Self { mesh, instances: 1, scale: 1.0, stretch: None, system: None, places: &[], data }
    }
}

/// The simplified meshes of a scene and the report of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifiedScene {
    /// As many meshes as parts, in the same order; a mesh may have lost all its faces.
    pub meshes: Vec<TriMesh>,
    /// The report, with counts of all instances and lengths in the scene.
    pub report: Report,
    /// Counts of each mesh, in the same order.
    pub counts: Vec<MeshCounts>,
}

/// Counts of one mesh of a scene, regardless of its number of instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeshCounts {
    /// Number of instances in the scene.
    pub instances: usize,
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// True if its stop was met; if all meshes share one stop, the scene's.
    pub reached: bool,
    /// True if the mesh lost its shape because all meshes share one target: it is small in the scene, so its
    /// faces were the cheapest. It kept less than an eighth of the fraction of faces that the scene kept, and
    /// its RMS distance from the input is above a hundredth of its diagonal. Meshes with few faces do not
    /// count.
    pub is_starved: bool,
}

/// Totals of the [starved](MeshCounts::is_starved) meshes of a result. Displayed as a sentence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Starved {
    /// Number of all meshes of the scene.
    pub all: usize,
    /// Number of starved meshes.
    pub meshes: usize,
    /// Triangles of their inputs.
    pub input_faces: usize,
    /// Triangles of their results.
    pub faces: usize,
}

impl Starved {
    /// Returns the totals of the starved meshes; `None` if there are none.
    pub fn of(counts: &[MeshCounts]) -> Option<Self> {
        let starved = counts.iter().filter(|c| c.is_starved);
        let add = |all: Self, c: &MeshCounts| Self {
            all: counts.len(),
            meshes: all.meshes + 1,
            input_faces: all.input_faces.saturating_add(c.input_faces),
            faces: all.faces.saturating_add(c.faces),
        };
        Some(starved.fold(Self::default(), add)).filter(|all| all.meshes > 0)
    }
}

impl fmt::Display for Starved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [meshes, all, faces, input] = [self.meshes, self.all, self.faces, self.input_faces].map(grouped);
        let percent = significant(100.0 * self.faces as f64 / self.input_faces.max(1) as f64, 2);
        write!(
            f,
            "{meshes} of {all} meshes are small in the scene and lost their shape: {faces} of their {input} faces \
             ({percent} %) are left, since all meshes share the target"
        )
    }
}

/// Meshes with fewer faces are never starved: they have little to lose. (Guessed.)
const MIN_STARVED_FACES: usize = 64;
/// A starved mesh keeps less than this part of the fraction of faces that the scene keeps. (Guessed.)
const STARVED_SHARE: f64 = 0.125;
/// The RMS distance of a starved mesh from its input is larger than this share of its diagonal. (Guessed: a
/// sphere of ten faces is at several hundredths, a flat mesh at zero whatever it loses.)
const STARVED_DISTANCE: f64 = 0.01;
/// Number of samples for that. (Guessed: the RMS is then known to a few percent.)
const STARVED_SAMPLES: usize = 500;

impl Part<'_> {
    /// Returns the area of one instance in the scene.
    pub(crate) fn area(&self) -> f64 {
        match PartMap::new(self) {
            PartMap::Scale(scale) => size_of(&self.mesh.surface()).area * scale * scale,
            map => {
                let places: Vec<[f64; 3]> =
                    self.mesh.positions().view().iter().map(|p| map.to_scene(p)).collect();
                let surface = self.mesh.surface();
                let stretched =
                    Surface::with_triangles(PositionsView::F64(&places), surface.triangles().to_vec());
                stretched.map_or(0.0, |stretched| size_of(&stretched).area)
            }
        }
    }
}

/// The linear map from a part to the scene, up to a rotation.
#[derive(Clone, Copy)]
pub(super) enum PartMap {
    Scale(f64),
    Stretch { to_scene: DMat3, to_part: DMat3 },
}

impl PartMap {
    pub(super) fn new(part: &Part<'_>) -> Self {
        let stretch = part.stretch.map(|rows| DMat3::from_cols_array_2d(&rows).transpose());
        let inverse = |to_scene: DMat3| (to_scene, to_scene.inverse());
        match stretch.map(inverse).filter(|(m, inverse)| m.is_finite() && inverse.is_finite()) {
            Some((to_scene, to_part)) => Self::Stretch { to_scene, to_part },
            None if part.scale.is_finite() && part.scale > 0.0 => Self::Scale(part.scale),
            None => Self::Scale(1.0),
        }
    }

    pub(super) fn to_scene(self, p: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Scale(scale) => p.map(|x| x * scale),
            Self::Stretch { to_scene, .. } => (to_scene * DVec3::from(p)).to_array(),
        }
    }
    pub(super) fn to_part(self, p: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Scale(scale) => p.map(|x| x / scale),
            Self::Stretch { to_part, .. } => (to_part * DVec3::from(p)).to_array(),
        }
    }

    /// Returns a direction of the part, such as a tangent, in the scene; unit length is kept.
    pub(super) fn direction_to_scene(self, d: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => d,
            Self::Stretch { to_scene, .. } => turned(to_scene, d),
        }
    }
    pub(super) fn direction_to_part(self, d: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => d,
            Self::Stretch { to_part, .. } => turned(to_part, d),
        }
    }
    /// Returns a normal of the part in the scene.
    pub(super) fn normal_to_scene(self, n: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => n,
            Self::Stretch { to_part, .. } => turned(to_part.transpose(), n),
        }
    }
    pub(super) fn normal_to_part(self, n: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Scale(_) => n,
            Self::Stretch { to_scene, .. } => turned(to_scene.transpose(), n),
        }
    }
}

/// Returns the image of a direction with unit length; zero and non-finite vectors are unchanged.
fn turned(matrix: DMat3, d: [f32; 3]) -> [f32; 3] {
    let image = matrix * DVec3::from(d.map(f64::from));
    image.try_normalize().map_or(d, |image| image.as_vec3().to_array())
}

impl MeshCounts {
    pub(super) fn new(part: &Part<'_>, result: &TriMesh, reached: bool) -> Self {
        Self {
            instances: part.instances,
            input_faces: part.mesh.face_count(),
            input_vertices: part.mesh.vertex_count(),
            faces: result.face_count(),
            vertices: result.vertex_count(),
            reached,
            is_starved: false,
        }
    }

    /// Determines whether a mesh is starved in a scene that kept this share of its faces.
    pub(super) fn with_share(mut self, part: &Part<'_>, result: &TriMesh, share: f64) -> Self {
        let few = self.faces as f64 <= STARVED_SHARE * share * self.input_faces as f64;
        if few && self.input_faces >= MIN_STARVED_FACES {
            let mut options = CompareOptions::default();
            options.samples = STARVED_SAMPLES;
            let seen = compare(&part.mesh.surface(), &result.surface(), &options);
            let is_far = seen.is_ok_and(|c| c.rms.symmetric > STARVED_DISTANCE * c.diagonal);
            self.is_starved = is_far || self.faces == 0;
        }
        self
    }
}
