//! Export of the result or of levels.

mod size;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lodsmith::{Levels, LodOptions, Screen, Stop};
use lodsmith_asset::plan::Outputs;
use lodsmith_asset::request::{Done, Note};
use lodsmith_asset::warnings::Spelling;
use lodsmith_asset::{
    Destination, Edit, LevelOutputs, LodRecipe, Naming, PartNames, Sink, Source, Watch, Writing,
};
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
    /// Fractions of the triangles, one file each beside the original as level 0; if empty, the shown mesh is written.
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
    /// Writes the files. Levels are made anew, with maps if the shown mesh has them.
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
        let mut levels = self.levels.clone();
        levels.retain(|ratio| *ratio < 1.0);
        levels.sort_by(|a, b| b.total_cmp(a));
        levels.dedup();
        let mut options = LodOptions::new(Levels::Ratios(levels));
        options.simplify = how.options.clone();
        options.simplify.stop = Stop::default();
        let baking = lighter.and_then(|l| l.baked.as_deref()).map(|baked| baked.settings.baking());
        let naming = Naming::default();
        let recipe = LodRecipe {
            options,
            names: PartNames::default(),
            normals: how.normals,
            baking,
            screen: Screen::default(),
            naming,
        };
        let outputs = Outputs {
            inputs: &[Source::Path(original.path.clone())],
            out_dir: Some(&self.path),
            to: Some(self.format),
            writing: self.writing(),
            ..Outputs::default()
        };
        let outputs = LevelOutputs::new(&outputs, None, naming, recipe.options.levels.count())?;
        let done = recipe.run(original.asset()?, &outputs, &mut job(watch))?;
        let counts =
            std::iter::once(done.counts[0]).chain(done.levels.iter().map(|level| level.report.faces));
        let counts: Vec<String> = counts.map(grouped).collect();
        let summary = format!("{} levels: {} faces", counts.len(), counts.join(", "));
        let notes = Done::Lod(done).notes(&self.path.display().to_string());
        let text = |note: Note| Spelling::Words.apply(&format!("{}: {}", note.about, note.text));
        Ok(Written { summary, warnings: notes.into_iter().map(text).collect() })
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
        let sink = Sink::Path(self.path.clone());
        let to = Destination { sink, format: self.format, writing: self.writing(), dry_run: false };
        let (asset, edit) = match lighter.and_then(|l| l.baked.as_deref()) {
            Some(baked) => (baked.asset.clone(), baked.edit.clone()),
            None => {
                let meshes = lighter.map(|lighter| own_meshes(original, lighter)).unwrap_or_default();
                (original.asset()?, Edit { meshes, ..Edit::default() })
            }
        };
        Ok(texts(&asset.write(edit, &to, &mut job(watch))?.warnings))
    }

    fn writing(&self) -> Writing {
        Writing { ascii: self.ascii, textures: self.textures, ..Writing::default() }
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
