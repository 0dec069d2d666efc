//! Export of the result or of levels.

mod size;

use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(not(target_arch = "wasm32"))]
use anyhow::Context as _;
use lodsmith_asset::{Destination, Edit, Sink, Watch, Writing};
use lodsmith_core::TriMesh;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Textures, Warning};
use serde::{Deserialize, Serialize};

use crate::content::{Lighter, Original, job, texts};
use crate::job::JobControl;
use crate::numbers::grouped;
use crate::settings::simplification::Simplification;

pub use size::{byte_text, estimated_bytes};

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
            let warnings = self.write_shown(original, lighter, watch)?;
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
            warnings.extend(self.write_one(original, level.as_ref(), &path, watch)?);
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
        watch: &mut dyn Watch,
    ) -> anyhow::Result<Vec<String>> {
        self.write_one(original, lighter, &self.path, watch)
    }

    fn write_one(
        &self,
        original: &Original,
        lighter: Option<&Lighter>,
        path: &Path,
        watch: &mut dyn Watch,
    ) -> anyhow::Result<Vec<String>> {
        let writing = Writing { ascii: self.ascii, textures: self.textures, ..Writing::default() };
        let to =
            Destination { sink: Sink::Path(path.to_owned()), format: self.format, writing, dry_run: false };
        let (asset, edit) = match lighter.and_then(|l| l.baked.as_deref()) {
            Some(baked) => (baked.asset.clone(), baked.edit.clone()),
            None => {
                let meshes = lighter.map(|lighter| own_meshes(original, lighter)).unwrap_or_default();
                (original.asset()?, Edit { meshes, ..Edit::default() })
            }
        };
        Ok(texts(&asset.write(edit, &to, &mut job(watch))?.warnings))
    }
}

/// Returns the meshes of a result that differ from those of the original.
pub(crate) fn own_meshes(original: &Original, lighter: &Lighter) -> Vec<Option<TriMesh>> {
    let pairs = lighter.model.meshes.iter().zip(&original.model().meshes);
    pairs.map(|(new, old)| (!Arc::ptr_eq(&new.mesh, &old.mesh)).then(|| TriMesh::clone(&new.mesh))).collect()
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
