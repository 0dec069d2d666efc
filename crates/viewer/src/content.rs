//! The shown models: the file's, and those made of it.

pub mod baked;
pub(crate) mod baking;
pub mod benchmark;
pub mod difference;
pub mod export;
pub mod flaws;
pub(crate) mod parts;
pub mod slider_preview;

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use glam::{DMat4, DVec3};
use lodsmith::{Levels, LodOptions, MeshCounts, Report, Stop};
use lodsmith_asset::warnings::{Spelling, starved, warnings_of};
use lodsmith_asset::{Asset, AssetError, Job, PartNames, Source, Watch};
use lodsmith_core::measure::{ComparedAttribute, Comparison, MeasureError, Prepared, wedge_differences};
use lodsmith_core::mesh::creases::Creases;
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Model, Topology, TriMesh, WedgeId};
use lodsmith_io::{AssetScope, ModelFile, ReadError, ReadOptions, SharedProgress, Warning};
use lodsmith_render::Shading;
use serde::{Deserialize, Serialize};
use web_time::Instant;

use crate::content::baked::BakedMaps;
use crate::settings::HeatOf;
use crate::settings::simplification::Simplification;
use crate::settings::up_axis::{self, UpAxis};

/// Memory for reading in a browser, in bytes: a WebAssembly module has 4 GB, and a quarter is left for runs.
const BROWSER_MEMORY: u64 = 3 << 30;

/// A file that was read, with its counts.
#[derive(Debug)]
pub struct Original {
    /// Path of the file.
    pub path: PathBuf,
    /// Contents of the file.
    pub file: ModelFile,
    /// Scope of the files it may refer to.
    pub assets: AssetScope,
    /// Bounding box of all mesh instances.
    pub bounds: Bounds,
    /// Axis that probably points up.
    pub guessed_up: UpAxis,
    /// Number of triangles over all mesh instances.
    pub faces: usize,
    /// Number of vertices over all mesh instances.
    pub vertices: usize,
    /// Number of vertices of all meshes with a coordinate that is infinite or NaN.
    pub non_finite_vertices: usize,
    /// Load time in seconds.
    pub read_secs: f64,
    /// The angle of [`Creases::Auto`].
    auto_crease_deg: Option<f64>,
    /// The file as jobs take it; `None` if another process has it.
    asset: Option<Asset>,
    prepared: PreparedMeshes,
}

impl Original {
    /// Reads a file.
    ///
    /// # Errors
    /// As [`lodsmith_io::read_model_path`].
    pub fn read(path: &Path, assets: AssetScope) -> Result<Self, ReadError> {
        Self::read_watched(path, assets, SharedProgress::default())
    }

    /// Reads a file, and shares its progress with another thread.
    ///
    /// # Errors
    /// As [`Original::read`].
    pub(crate) fn read_watched(
        path: &Path,
        assets: AssetScope,
        progress: SharedProgress,
    ) -> Result<Self, ReadError> {
        let begin = Instant::now();
        let mut options = ReadOptions::default();
        (options.assets, options.progress) = (assets.clone(), progress);
        if cfg!(target_arch = "wasm32") {
            options.limits.memory = BROWSER_MEMORY;
        }
        let file = lodsmith_io::read_model_path(path, &options)?;
        Ok(Self { assets, ..Self::of_file(path.to_owned(), file, begin.elapsed().as_secs_f64()) })
    }

    /// Makes one of a file that was already read.
    pub fn of_file(path: PathBuf, file: ModelFile, read_secs: f64) -> Self {
        let model = &file.model;
        let count = |of: fn(&TriMesh) -> usize| sum_over_instances(model, of);
        let prepared = PreparedMeshes::of(model);
        let bounds = bounds_of(model);
        let (faces, vertices) = (count(TriMesh::face_count), count(TriMesh::vertex_count));
        let non_finite_vertices = model.meshes.iter().map(|m| non_finite_vertices(&m.mesh)).sum();
        let assets = AssetScope::Folder;
        let guessed_up = up_axis::guessed(model, file.format, &bounds);
        let auto_crease_deg = Creases::Auto.angle_deg(model.meshes.iter().map(|m| &*m.mesh));
        let asset = Asset::of_model(&file, Source::Path(path.clone()));
        Self {
            asset,
            path,
            assets,
            bounds,
            guessed_up,
            faces,
            vertices,
            non_finite_vertices,
            file,
            read_secs,
            auto_crease_deg,
            prepared,
        }
    }

    /// Returns which edges of this file and its results are sharp; [`Creases::Auto`] is resolved by the shape of the
    /// file.
    pub fn creases(&self, chosen: Creases) -> Creases {
        match chosen {
            Creases::Auto => self.auto_crease_deg.map_or(Creases::Off, Creases::Above),
            chosen => chosen,
        }
    }

    /// Returns the file as jobs take it.
    ///
    /// # Errors
    /// If another process has it.
    pub(crate) fn asset(&self) -> Result<Asset, AssetError> {
        let missing = || AssetError::Usage("this kind of source cannot be written".to_owned());
        self.asset.clone().ok_or_else(missing)
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.file.model
    }

    /// Returns the shading that the file intends: materials or vertex colours, if it has them.
    pub fn intended_shading(&self) -> Shading {
        Shading::intended_by(self.model())
    }

    /// Returns a mesh prepared for measuring; `None` if it has no faces. It is prepared on the first call.
    pub fn prepared(&self, mesh: usize) -> Option<&Prepared> {
        self.prepared.get(self.model(), mesh)
    }

    /// Returns the largest scale of each mesh over its instances.
    pub fn scales(&self) -> Vec<f64> {
        let mut scales = vec![0.0; self.model().meshes.len()];
        for instance in self.model().instances(&Pose::default()) {
            let scale = largest_scale(instance.world_from_mesh);
            scales[instance.mesh] = scale.max(scales[instance.mesh]);
        }
        // A mesh without instances has scale 1.
        scales.iter().map(|&s| if s > 0.0 { s } else { 1.0 }).collect()
    }
}

/// The meshes of a model, each prepared for measuring when it is asked for.
#[derive(Debug)]
pub(crate) struct PreparedMeshes(Vec<OnceLock<Option<Prepared>>>);

impl PreparedMeshes {
    /// Makes one without a prepared mesh.
    pub(crate) fn of(model: &Model) -> Self {
        Self(model.meshes.iter().map(|_| OnceLock::new()).collect())
    }

    /// Returns a mesh of the same model; `None` if it has no faces. It is prepared on the first call.
    fn get(&self, model: &Model, mesh: usize) -> Option<&Prepared> {
        let slot = &self.0[mesh];
        if let Some(prepared) = slot.get() {
            return prepared.as_ref();
        }
        // Not in the initialiser: preparing is parallel work, and a waiting thread may take up other work that needs
        // the same mesh.
        let prepared = Prepared::new(&model.meshes[mesh].mesh.surface()).ok();
        slot.get_or_init(|| prepared).as_ref()
    }
}

/// A simplified model, and how it was made.
#[derive(Debug)]
pub struct Lighter {
    /// The original model with simplified meshes.
    pub model: Model,
    /// Number of triangles over all mesh instances.
    pub faces: usize,
    /// Number of vertices over all mesh instances.
    pub vertices: usize,
    /// Report of the engine; `None` for a level of a progressive mesh, for which there was no run.
    pub report: Option<Report>,
    /// Counts of each mesh of a scene.
    pub counts: Vec<MeshCounts>,
    /// Options it was made with.
    pub how: Simplification,
    /// Time to make it in seconds.
    pub seconds: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Its baked maps.
    pub baked: Option<Arc<BakedMaps>>,
    /// Estimate of the largest distance from the original; only for a level of a progressive mesh.
    pub largest_estimate: Option<f64>,
    estimate: f64,
    prepared: PreparedMeshes,
}

impl Lighter {
    /// Simplifies the original.
    ///
    /// # Errors
    /// As [`Recipe::run`](lodsmith_asset::Recipe::run).
    pub fn make(
        original: &Original,
        how: &Simplification,
        watch: &mut dyn Watch,
    ) -> Result<Self, AssetError> {
        let begin = Instant::now();
        let made = how.recipe().run(original.asset()?, None, &mut job(watch))?;
        let counts = made.meshes.into_iter().map(|(_, counts)| counts).collect();
        let mut done = Self::of(original, how, made.edit.meshes, made.report, counts);
        done.warnings = texts(&made.warnings);
        done.seconds = begin.elapsed().as_secs_f64();
        Ok(done)
    }

    /// Makes several levels with these fractions of the triangles, in descending order; in one run if the
    /// method can.
    ///
    /// # Errors
    /// As [`Asset::levels`].
    pub fn chain(
        original: &Original,
        how: &Simplification,
        ratios: &[f64],
        watch: &mut dyn Watch,
    ) -> Result<Vec<Self>, AssetError> {
        let begin = Instant::now();
        let mut options = LodOptions::new(Levels::Ratios(ratios.to_vec()));
        options.simplify = how.options.clone();
        options.simplify.stop = Stop::default();
        let asset = original.asset()?;
        let (data, _) = asset.data(&PartNames::default())?;
        let chain = asset.levels(&options, &data, &mut job(watch))?;
        let seconds = begin.elapsed().as_secs_f64() / ratios.len().max(1) as f64;
        let level = |(made, ratio): (lodsmith_asset::SimplifiedMeshes, &f64)| {
            let mut how = how.clone();
            how.options.stop = Stop::ratio(*ratio);
            let mut meshes = made.meshes;
            meshes.iter_mut().flatten().for_each(|mesh| how.normals.apply(mesh));
            let counts = made.counts.into_iter().map(|(_, counts)| counts).collect();
            let mut warnings = warnings_of(&made.report);
            let mut level = Self::of(original, &how, meshes, made.report, counts);
            warnings.extend(starved(&level.counts));
            level.warnings = texts(&warnings);
            level.seconds = seconds;
            level
        };
        Ok(chain.levels.into_iter().zip(ratios).map(level).collect())
    }

    fn of(
        original: &Original,
        how: &Simplification,
        meshes: Vec<Option<TriMesh>>,
        report: Report,
        counts: Vec<MeshCounts>,
    ) -> Self {
        let originals = original.model().meshes.iter().map(|m| &m.mesh);
        let meshes = originals.zip(meshes).map(|(old, new)| new.map_or_else(|| old.clone(), Arc::new));
        let model = original.model().with_meshes(meshes.collect());
        let (faces, vertices, estimate) = (report.faces, report.vertices, report.error.estimate);
        let mut done = Self::of_level(model, [faces, vertices], estimate, how, 0.0);
        (done.report, done.counts) = (Some(report), counts);
        done
    }

    /// Makes one of a level of a progressive mesh, with its number of triangles and vertices and its error.
    pub(crate) fn of_level(
        model: Model,
        [faces, vertices]: [usize; 2],
        estimate: f64,
        how: &Simplification,
        seconds: f64,
    ) -> Self {
        let (counts, warnings, how) = (Vec::new(), Vec::new(), how.clone());
        let prepared = PreparedMeshes::of(&model);
        Self {
            model,
            faces,
            vertices,
            report: None,
            counts,
            how,
            seconds,
            warnings,
            baked: None,
            largest_estimate: None,
            estimate,
            prepared,
        }
    }

    /// Returns a mesh prepared for measuring; `None` if it has no faces. It is prepared on the first call.
    pub fn prepared(&self, mesh: usize) -> Option<&Prepared> {
        self.prepared.get(&self.model, mesh)
    }

    /// Returns the same result with baked maps, in a model that has them.
    pub(crate) fn with_maps(&self, model: Model, baked: Arc<BakedMaps>, warnings: Vec<String>) -> Self {
        Self {
            prepared: PreparedMeshes::of(&model),
            faces: sum_over_instances(&model, TriMesh::face_count),
            vertices: sum_over_instances(&model, TriMesh::vertex_count),
            model,
            report: self.report.clone(),
            counts: self.counts.clone(),
            how: self.how.clone(),
            seconds: self.seconds,
            warnings: self.warnings.iter().cloned().chain(warnings).collect(),
            baked: Some(baked),
            largest_estimate: self.largest_estimate,
            estimate: self.estimate,
        }
    }

    /// Returns the two-way comparison, if it was measured.
    pub fn measured(&self) -> Option<&Comparison> {
        self.report.as_ref()?.error.measured.as_ref()
    }

    /// Returns the RMS distance from the original: measured if that was requested, else estimated.
    pub fn error(&self) -> f64 {
        self.measured().map_or(self.estimate, |m| m.rms.symmetric)
    }
}

/// Fractions of the triangles of the automatic levels.
const AUTO_LEVEL_RATIOS: [f64; 9] = [0.5, 0.25, 0.125, 0.0625, 0.03, 0.015, 0.0075, 0.0035, 0.0015];

/// Levels with fewer triangles are not made.
const MIN_LEVEL_FACES: f64 = 50.0;

/// Returns the fractions of the triangles that the levels of a model have.
pub(crate) fn level_ratios(faces: usize) -> Vec<f64> {
    let fewest = MIN_LEVEL_FACES / faces.max(1) as f64;
    AUTO_LEVEL_RATIOS.into_iter().filter(|r| *r > fewest).collect()
}

/// Returns a job with the memory limit of the window or the page.
pub(crate) fn job(watch: &mut dyn Watch) -> Job<'_> {
    let memory = if cfg!(target_arch = "wasm32") { BROWSER_MEMORY } else { Job::default_memory() };
    Job::new(watch, None, memory)
}

/// Returns the texts of warnings, with options as words.
pub(crate) fn texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|warning| Spelling::Words.apply(&warning.text)).collect()
}

/// Returns a sum over all mesh instances.
pub fn sum_over_instances(model: &Model, of: impl Fn(&TriMesh) -> usize) -> usize {
    let instances = model.instances(&Pose::default());
    instances.iter().fold(0, |n, i| of(&model.meshes[i.mesh].mesh).saturating_add(n))
}

fn non_finite_vertices(mesh: &TriMesh) -> usize {
    mesh.positions().view().iter().filter(|p| !p.iter().all(|x| x.is_finite())).count()
}

/// Returns the bounding box of all mesh instances; a unit cube at the origin if there are none.
pub fn bounds_of(model: &Model) -> Bounds {
    let boxes: Vec<_> = model.meshes.iter().map(|m| m.mesh.positions().view().bounds()).collect();
    let mut all: Option<Bounds> = None;
    for instance in model.instances(&Pose::default()) {
        let Some(own) = boxes[instance.mesh] else { continue };
        for corner in 0..8 {
            let pick = |k: usize| if corner >> k & 1 == 0 { own.min[k] } else { own.max[k] };
            let p = instance.world_from_mesh.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            if !p.is_finite() {
                continue;
            }
            let p = p.to_array();
            let grown = all.get_or_insert(Bounds { min: p, max: p });
            for (k, x) in p.into_iter().enumerate() {
                (grown.min[k], grown.max[k]) = (grown.min[k].min(x), grown.max[k].max(x));
            }
        }
    }
    all.unwrap_or(Bounds { min: [-0.5; 3], max: [0.5; 3] })
}

fn largest_scale(matrix: DMat4) -> f64 {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis]
        .map(|a| a.truncate().length())
        .into_iter()
        .fold(0.0, f64::max)
}

/// Topology counts of a model, after vertices at equal places were joined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologySummary {
    /// Number of connected components.
    pub components: usize,
    /// Number of edges with one face.
    pub border_edges: usize,
    /// Number of border loops.
    pub border_loops: usize,
    /// Number of edges with more than two faces.
    pub non_manifold_edges: usize,
    /// True if every mesh is closed.
    pub is_closed: bool,
    /// Names of the vertex attributes.
    pub attributes: Vec<String>,
}

impl TopologySummary {
    /// Counts a model; each mesh counts once. Cost: O(n).
    pub fn of(model: &Model) -> Self {
        let mut all = Self { is_closed: true, ..Self::default() };
        let mut has = [false; 4];
        for mesh in model.meshes.iter().map(|m| &m.mesh).filter(|m| m.face_count() > 0) {
            let counts = Topology::new(&mesh.surface()).counts();
            all.components += counts.component_count;
            all.border_edges += counts.border_edge_count;
            all.border_loops += counts.border_loop_count;
            all.non_manifold_edges += counts.non_manifold_edge_count;
            all.is_closed &= counts.is_closed();
            let own = [mesh.normals().is_some(), mesh.uvs().is_some(), mesh.colors().is_some()];
            for (has, own) in has.iter_mut().zip(own) {
                *has |= own;
            }
            has[3] |= !mesh.further_attributes().is_empty();
        }
        let names = ["normals", "UVs", "colours", "others"];
        all.attributes = names.into_iter().zip(has).filter(|x| x.1).map(|x| x.0.to_owned()).collect();
        all
    }
}

/// Distances between result and original at their vertices, or differences of an attribute at their wedges.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Distances {
    /// The quantity.
    pub quantity: HeatOf,
    /// Per mesh: distance of each vertex of the result to the original, in the units of the scene; or the
    /// difference of an attribute at each wedge, NaN where it is not known.
    pub of_result: Vec<Vec<f32>>,
    /// Per mesh: the same for the original.
    pub of_original: Vec<Vec<f32>>,
    /// Largest of all distances.
    pub largest: f64,
    /// Mean over the vertices (wedges) of both.
    pub mean: f64,
    /// Root mean square over the vertices (wedges) of both.
    pub rms: f64,
    /// Number of vertices in each of equal intervals up to the largest distance.
    pub histogram: Vec<u32>,
    /// Time to measure in seconds.
    pub seconds: f64,
}

/// Number of bins of the histogram.
const HISTOGRAM_BINS: usize = 48;
/// Number of vertices between two checks for cancellation. (About 20 ms.)
const CANCEL_CHECK_VERTICES: usize = 1 << 14;

impl Distances {
    /// Measures; returns `None` if `go_on` returns false. `go_on` receives the progress.
    pub fn measure(
        original: &Original,
        lighter: &Lighter,
        quantity: HeatOf,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Option<Self> {
        let begin = Instant::now();
        let scales = original.scales();
        let mut all = Self { quantity, ..Self::default() };
        let attribute = match quantity {
            HeatOf::Distance => None,
            HeatOf::Normals => Some(ComparedAttribute::Normals),
            HeatOf::Uvs => Some(ComparedAttribute::Uvs),
            HeatOf::Colors => Some(ComparedAttribute::Colors),
        };
        let count = scales.len().max(1) as f64;
        for (i, scale) in scales.iter().enumerate() {
            let [one, two] = [&original.model().meshes[i].mesh, &lighter.model.meshes[i].mesh];
            let at = |part: f64| (i as f64 + part) / count;
            if !go_on(at(0.0)) {
                return None;
            }
            let same = Arc::ptr_eq(one, two);
            if let Some(attribute) = attribute {
                let [one, two] = [one, two].map(|mesh| with_some_normals(mesh, attribute));
                let mut half = |a, b, from| differences(a, b, attribute, &mut |x| go_on(at(from + 0.5 * x)));
                all.of_result.push(half(&two, &one, 0.0)?);
                all.of_original.push(half(&one, &two, 0.5)?);
                continue;
            }
            let own = original.prepared(i).filter(|_| !same);
            all.of_result.push(distances(two, own, *scale, &mut |x| go_on(at(0.2 + 0.2 * x)))?);
            let other = lighter.prepared(i).filter(|_| !same);
            all.of_original.push(distances(one, other, *scale, &mut |x| go_on(at(0.4 + 0.6 * x)))?);
        }
        all.sum_up();
        all.seconds = begin.elapsed().as_secs_f64();
        Some(all)
    }

    fn sum_up(&mut self) {
        let values = || {
            let all = self.of_result.iter().chain(&self.of_original).flatten();
            all.copied().map(f64::from).filter(|d| d.is_finite())
        };
        let (mut largest, mut sum, mut squares, mut n) = (0f64, 0.0, 0.0, 0usize);
        for d in values() {
            largest = largest.max(d);
            sum += d;
            squares += d * d;
            n += 1;
        }
        let mut histogram = vec![0u32; HISTOGRAM_BINS];
        if largest > 0.0 {
            for d in values() {
                histogram[((d / largest * HISTOGRAM_BINS as f64) as usize).min(HISTOGRAM_BINS - 1)] += 1;
            }
        }
        let n = n.max(1) as f64;
        (self.largest, self.mean, self.rms) = (largest, sum / n, (squares / n).sqrt());
        self.histogram = histogram;
    }
}

/// Returns a mesh with normals, if these are compared: those of the file, or of the shape.
fn with_some_normals(mesh: &Arc<TriMesh>, attribute: ComparedAttribute) -> Arc<TriMesh> {
    if attribute != ComparedAttribute::Normals || mesh.normals().is_some() || mesh.face_count() == 0 {
        return mesh.clone();
    }
    let joined = weld(mesh.positions().view());
    let of_vertex = vertex_normals(&mesh.surface(), |v| joined.of(v));
    let of_wedge = (0..mesh.wedge_count()).map(|w| of_vertex[mesh.vertex_of(WedgeId::new(w)).index()]);
    let mut made = (**mesh).clone();
    made.set_normals(Some(of_wedge.collect())).expect("there is one for each wedge");
    Arc::new(made)
}

/// Returns the differences of an attribute at the wedges of a mesh; NaN where there is nothing to compare.
fn differences(
    mesh: &TriMesh,
    other: &TriMesh,
    attribute: ComparedAttribute,
    go_on: &mut dyn FnMut(f64) -> bool,
) -> Option<Vec<f32>> {
    match wedge_differences(mesh, other, attribute, go_on) {
        Ok(found) => found,
        Err(MeasureError::Empty { .. }) => Some(vec![f32::NAN; mesh.wedge_count()]),
        Err(_) => None,
    }
}

/// Returns the distances of the vertices of a mesh; zeros if there is nothing to measure against.
fn distances(
    mesh: &TriMesh,
    to: Option<&Prepared>,
    scale: f64,
    go_on: &mut dyn FnMut(f64) -> bool,
) -> Option<Vec<f32>> {
    let places = mesh.positions().view();
    let Some(to) = to else { return Some(vec![0.0; places.len()]) };
    let mut found = Vec::with_capacity(places.len());
    while found.len() < places.len() {
        if !go_on(found.len() as f64 / places.len() as f64) {
            return None;
        }
        let range = found.len()..places.len().min(found.len() + CANCEL_CHECK_VERTICES);
        let chunk = match places {
            lodsmith_core::PositionsView::F32(p) => lodsmith_core::PositionsView::F32(&p[range]),
            lodsmith_core::PositionsView::F64(p) => lodsmith_core::PositionsView::F64(&p[range]),
        };
        let surface = lodsmith_core::Surface::new(chunk, &[]).expect("no triangle names a place");
        found.extend(
            lodsmith_core::measure::vertex_distances(&surface, to).into_iter().map(|d| (d * scale) as f32),
        );
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use lodsmith::NoControl;
    use lodsmith_core::shapes;

    use super::*;

    fn sphere(folder: &tempfile::TempDir) -> Original {
        let path = folder.path().join("sphere.ply");
        lodsmith_io::write_path(&shapes::icosphere(4), &path, &Default::default()).unwrap();
        Original::read(&path, AssetScope::Folder).unwrap()
    }

    #[test]
    fn a_lighter_sphere_lies_within_the_distance_that_is_measured() {
        let folder = tempfile::tempdir().unwrap();
        let original = sphere(&folder);
        assert_eq!(original.faces, 5120);
        let how = Simplification::of_preset(Default::default(), Stop::faces(320));
        let lighter = Lighter::make(&original, &how, &mut NoControl).unwrap();
        assert!(sum_over_instances(&lighter.model, TriMesh::face_count) <= 320);
        let distances = Distances::measure(&original, &lighter, HeatOf::Distance, &mut |_| true).unwrap();
        // An evenly triangulated sphere of radius 1 with 320 faces lies up to 1.5 % too low at face centres;
        // these are less even.
        assert!(distances.largest > 1e-4 && distances.largest < 0.03, "{}", distances.largest);
        assert!(distances.mean <= distances.rms && distances.rms <= distances.largest);
        let counted: u32 = distances.histogram.iter().sum();
        assert_eq!(counted as usize, original.vertices + lighter.vertices);
        assert!(Distances::measure(&original, &lighter, HeatOf::Distance, &mut |_| false).is_none());
    }

    /// The normals of a sphere are known: those of the shape differ by some degrees, everywhere.
    #[test]
    fn normals_are_compared_at_wedges_and_missing_attributes_are_not_known() {
        let folder = tempfile::tempdir().unwrap();
        let original = sphere(&folder);
        let how = Simplification::of_preset(Default::default(), Stop::faces(320));
        let lighter = Lighter::make(&original, &how, &mut NoControl).unwrap();
        let measure = |quantity| Distances::measure(&original, &lighter, quantity, &mut |_| true).unwrap();
        let normals = measure(HeatOf::Normals);
        assert_eq!(normals.of_result[0].len(), lighter.model.meshes[0].mesh.wedge_count());
        assert!(normals.largest > 0.5 && normals.largest < 25.0, "{}", normals.largest);
        assert!(normals.rms < 6.0, "{}", normals.rms);
        let uvs = measure(HeatOf::Uvs);
        assert!(uvs.of_original[0].iter().all(|d| d.is_nan()) && uvs.largest == 0.0);
        assert!(Distances::measure(&original, &lighter, HeatOf::Normals, &mut |_| false).is_none());
    }

    #[test]
    fn a_chain_falls_and_its_errors_rise() {
        let folder = tempfile::tempdir().unwrap();
        let original = sphere(&folder);
        let chain = Lighter::chain(&original, &Simplification::default(), &[0.5, 0.25, 0.05], &mut NoControl)
            .unwrap();
        let counts: Vec<_> =
            chain.iter().map(|l| sum_over_instances(&l.model, TriMesh::face_count)).collect();
        assert!(counts[0] <= 2560 && counts[1] <= 1280 && counts[2] <= 256, "{counts:?}");
        assert!(chain[0].error() < chain[1].error() && chain[1].error() < chain[2].error());
    }

    #[test]
    fn a_sphere_is_closed_and_in_one_part() {
        let folder = tempfile::tempdir().unwrap();
        let topology = TopologySummary::of(sphere(&folder).model());
        assert!(topology.is_closed);
        assert_eq!((topology.components, topology.border_edges, topology.non_manifold_edges), (1, 0, 0));
    }

    /// All threads of the pool ask for a mesh while this one prepares it, which is parallel work: neither may wait for
    /// the other.
    #[test]
    fn a_mesh_is_prepared_while_all_threads_of_the_pool_ask_for_it() {
        let model = Model::of_mesh(shapes::icosphere(6));
        let (done, is_done) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let prepared = PreparedMeshes::of(&model);
            let ask = || assert!(prepared.get(&model, 0).is_some());
            let held = std::sync::Barrier::new(rayon::current_num_threads() + 1);
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    rayon::broadcast(|_| {
                        held.wait();
                        std::thread::sleep(std::time::Duration::from_millis(200));
                        ask();
                    });
                });
                held.wait();
                ask();
            });
            done.send(()).unwrap();
        });
        is_done.recv_timeout(std::time::Duration::from_secs(60)).expect("no thread waits for ever");
    }
}
