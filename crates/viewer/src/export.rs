//! Export of the result or of levels.

use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(not(target_arch = "wasm32"))]
use anyhow::Context as _;
use lodsmith_core::{Semantic, TriMesh};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ModelSource, Textures, Warning, WriteOptions};
use serde::{Deserialize, Serialize};

use crate::baked::BakedMaps;
use crate::content::{Lighter, Original, placed_meshes};
use crate::job::JobControl;
use crate::numbers::grouped;
use crate::option_words::Simplification;

pub use crate::export_size::{byte_text, estimated_bytes};

/// Options of an export.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Export {
    /// The file; for several levels, the folder.
    pub path: PathBuf,
    /// File format.
    pub format: Format,
    /// Write text if the format has both text and binary.
    pub ascii: bool,
    /// Treatment of materials and textures that are files.
    pub textures: Textures,
    /// Fractions of the triangles, one file each; if empty, the shown mesh is written.
    pub levels: Vec<f64>,
}

/// Returns the file that an export writes unless another one is chosen, and its format: beside the original,
/// in its format if that can be written; with baked maps as GLB, unless the format holds them too.
pub fn default_file(original: &Path, has_maps: bool) -> (PathBuf, Format) {
    let stem = original.file_stem().map_or("model".into(), |s| s.to_string_lossy());
    let ending = original.extension().map(|e| e.to_string_lossy().into_owned());
    // A compressed file is named after its content.
    let (stem, ending) = match ending.filter(|e| !e.eq_ignore_ascii_case("gz")) {
        Some(ending) => (stem.into_owned(), Some(ending)),
        None => {
            let inner = Path::new(&*stem);
            let of = |part: Option<&std::ffi::OsStr>| part.map(|s| s.to_string_lossy().into_owned());
            (of(inner.file_stem()).unwrap_or_default(), of(inner.extension()))
        }
    };
    // The shown model is a single level, so it cannot be written as a progressive mesh.
    let format = match ending.and_then(|e| Format::from_name(&e)) {
        Some(format @ (Format::Gltf | Format::Glb | Format::Obj)) => format,
        _ if has_maps => Format::Glb,
        Some(format) if Format::WRITTEN.contains(&format) => format,
        Some(format) if format.is_scene() => Format::Glb,
        _ => Format::Ply,
    };
    (original.with_file_name(format!("{stem}_low.{}", format.name())), format)
}

/// Summary and warnings of an export.
#[derive(Debug, Serialize, Deserialize)]
pub struct Written {
    /// Summary, such as `6,945 faces`.
    pub summary: String,
    /// Data that the format cannot hold.
    pub warnings: Vec<String>,
}

impl Export {
    /// Writes the files.
    ///
    /// # Errors
    /// Errors of the file system or of the engine; existing files then stay unchanged.
    pub fn write(
        &self,
        original: &Original,
        lighter: Option<&Lighter>,
        how: &Simplification,
        watch: &mut JobControl,
    ) -> anyhow::Result<Written> {
        if self.levels.is_empty() {
            let warnings = self.write_shown(original, lighter)?;
            let faces = lighter.map_or(original.faces, |l| l.faces);
            return Ok(Written { summary: format!("{} faces", grouped(faces)), warnings });
        }
        // In memory every folder exists.
        #[cfg(not(target_arch = "wasm32"))]
        std::fs::create_dir_all(&self.path).with_context(|| self.path.display().to_string())?;
        let stem = original.path.file_stem().map_or("model".into(), |s| s.to_string_lossy());
        let (mut counts, mut warnings) = (Vec::new(), Vec::new());
        let mut ratios = self.levels.clone();
        ratios.sort_by(|a, b| b.total_cmp(a));
        ratios.dedup();
        let fewer: Vec<f64> = ratios.iter().copied().filter(|r| *r < 1.0).collect();
        let made = if fewer.is_empty() { Vec::new() } else { Lighter::chain(original, how, &fewer, watch)? };
        let whole = (fewer.len() < ratios.len()).then_some(None);
        for (i, level) in whole.into_iter().chain(made.into_iter().map(Some)).enumerate() {
            let path = self.path.join(format!("{stem}_lod{i}.{}", self.format.name()));
            warnings.extend(self.write_one(original, level.as_ref(), &path)?);
            counts.push(grouped(level.as_ref().map_or(original.faces, |l| l.faces)));
        }
        warnings.dedup();
        Ok(Written { summary: format!("{} levels: {} faces", counts.len(), counts.join(", ")), warnings })
    }

    /// Writes the shown mesh; returns its warnings.
    ///
    /// # Errors
    /// As [`Export::write`].
    pub(crate) fn write_shown(
        &self,
        original: &Original,
        lighter: Option<&Lighter>,
    ) -> anyhow::Result<Vec<String>> {
        self.write_one(original, lighter, &self.path)
    }

    fn write_one(
        &self,
        original: &Original,
        lighter: Option<&Lighter>,
        path: &Path,
    ) -> anyhow::Result<Vec<String>> {
        let mut options = WriteOptions::default();
        options.format = Some(self.format);
        options.ascii = self.ascii;
        options.textures = self.textures;
        let is_scene = self.format.keeps_scenes();
        if let Some(baked) = lighter.and_then(|l| l.baked.as_deref()) {
            let warnings = write_baked(original, baked, self.format, path, options)?;
            return Ok(warnings.iter().map(ToString::to_string).collect());
        }
        let warnings = match (&original.file.source, is_scene) {
            (ModelSource::Scene(scene), true) => {
                let replaced = lighter_meshes(scene, lighter);
                let mut scene = (**scene).clone();
                let mut warnings = embed(&mut scene);
                warnings.extend(lodsmith_io::write_scene_path(&scene, &replaced, path, &options, &|_| None)?);
                warnings
            }
            (ModelSource::Scene(scene), false) => {
                // Other formats hold one mesh: all instances joined, as the `simplify` command joins them.
                let (mesh, regions, told) = joined(original, scene, &all_meshes(scene, lighter))?;
                options.regions = Some(regions);
                let mut warnings = lodsmith_io::write_path(&mesh, path, &options)?.warnings;
                warnings.extend(told);
                warnings
            }
            (ModelSource::Mesh(regions), _) => {
                options.regions = Some(regions.clone());
                let model = lighter.map_or(original.model(), |l| &l.model);
                lodsmith_io::write_path(&model.meshes[0].mesh, path, &options)?.warnings
            }
            _ => anyhow::bail!("{}: this kind of source cannot be written", path.display()),
        };
        Ok(warnings.iter().map(ToString::to_string).collect())
    }
}

/// Writes a result with its baked maps, as a scene or as one mesh.
fn write_baked(
    original: &Original,
    baked: &BakedMaps,
    format: Format,
    path: &Path,
    mut options: WriteOptions,
) -> anyhow::Result<Vec<Warning>> {
    let bare;
    let meshes = if matches!(format, Format::Gltf | Format::Glb) {
        &baked.meshes
    } else {
        bare = without_tangents(&baked.meshes);
        &bare
    };
    if format.keeps_scenes() {
        let written = lodsmith_io::write_scene_path(&baked.scene, meshes, path, &options, &|_| None)?;
        return Ok(written.warnings);
    }
    let (mesh, regions, mut warnings) = joined(original, &baked.scene, meshes)?;
    options.regions = Some(regions);
    warnings.extend(lodsmith_io::write_path(&mesh, path, &options)?.warnings);
    Ok(warnings)
}

/// Returns the meshes of a scene that a result replaces: those that are placed and had faces.
pub(crate) fn lighter_meshes(scene: &Scene, lighter: Option<&Lighter>) -> Vec<Option<TriMesh>> {
    let had_faces = |i: usize| scene.meshes()[i].mesh.face_count() > 0;
    let all = all_meshes(scene, lighter);
    all.into_iter().enumerate().map(|(i, mesh)| mesh.filter(|_| had_faces(i))).collect()
}

/// Returns the meshes of a result that are placed.
fn all_meshes(scene: &Scene, lighter: Option<&Lighter>) -> Vec<Option<TriMesh>> {
    let taken = placed_meshes(scene);
    let mesh = |i: usize| {
        let model = &lighter.filter(|_| taken.contains(&i))?.model;
        Some(TriMesh::clone(&model.meshes[i].mesh))
    };
    (0..scene.meshes().len()).map(mesh).collect()
}

/// Returns meshes for formats without tangents; viewers of the maps compute the same ones.
fn without_tangents(meshes: &[Option<TriMesh>]) -> Vec<Option<TriMesh>> {
    let bare = |mesh: &TriMesh| mesh.clone().without_further(|semantic| *semantic == Semantic::Tangent);
    meshes.iter().map(|mesh| mesh.as_ref().map(bare)).collect()
}

/// Embeds external images, so that the scene can be written to any folder.
pub(crate) fn embed(scene: &mut Scene) -> Vec<Warning> {
    let mut warnings = scene.embed_files();
    let left = scene.external_files();
    let text =
        |uri: &String| Warning::note(format!("{uri} remains a separate file that the scene refers to"));
    warnings.extend(left.first().map(text));
    warnings
}

/// Joins all instances into one mesh: writes GLB in memory and reads it back, as if that file had been
/// opened.
fn joined(
    original: &Original,
    scene: &Scene,
    replaced: &[Option<TriMesh>],
) -> anyhow::Result<(TriMesh, Arc<lodsmith_io::Regions>, Vec<Warning>)> {
    let mut bytes = Vec::new();
    let _ = lodsmith_io::write_scene_to(scene, replaced, Format::Glb, &|_| None, &mut bytes)?;
    let mut read = lodsmith_io::ReadOptions::default();
    read.folder = original.path.parent().map(Path::to_owned);
    read.assets = original.assets.clone();
    let loaded = lodsmith_io::read_bytes(&bytes, &read)?;
    Ok((loaded.mesh, Arc::new(loaded.regions), loaded.warnings))
}
