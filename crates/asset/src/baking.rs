//! Baking: maps of a detailed model in the materials of a lighter one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lodsmith_bake::{BakeError, BakeOptions, BakedMap, BakedSet, MapKind};
use lodsmith_core::numbers::significant;
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::Warning;
use lodsmith_io::gltf::Scene;
use serde_json::{Value, json};

use crate::destination::{Destination, Writing};
use crate::error::{AssetError, usage};
use crate::job::Job;
use crate::paths::Sink;

/// Maps to bake, and where they go.
#[derive(Clone, Debug)]
pub struct Baking {
    /// The maps and their texels.
    pub options: BakeOptions,
    /// Write every map as a file beside the output, too.
    pub map_files: bool,
}

/// A file beside an output: the suffix of its name, and its bytes.
pub type SideFile = (String, Arc<Vec<u8>>);

/// Result of a bake on a scene.
#[derive(Debug)]
pub struct BakedScene {
    /// The meshes of the scene, with texture coordinates and tangents.
    pub replaced: Vec<Option<TriMesh>>,
    /// For each mesh and primitive (one entry for all), its material in the scene.
    pub materials: Vec<Vec<usize>>,
    /// Maps that are files beside the output.
    pub files: Vec<SideFile>,
    /// The maps.
    pub sets: Vec<BakedSet>,
    /// Warnings of the bake.
    pub warnings: Vec<Warning>,
    /// The report of the sets.
    pub report: Value,
    /// True if any set has an atlas of its own.
    pub is_new_atlas: bool,
}

impl Baking {
    /// True if colours are baked everywhere.
    pub(crate) fn has_color(&self) -> bool {
        self.options.maps.contains(&MapKind::Color)
    }

    /// Bakes maps of a lighter model from a detailed one, and adds their materials to the scene of the lighter one. Which
    /// meshes use them is for the caller to set.
    pub(crate) fn bake(
        &self,
        detailed: &Model,
        lighter: &Model,
        scene: &mut Scene,
        job: &mut Job<'_>,
    ) -> Result<BakedScene, AssetError> {
        let mut options = self.options.clone();
        options.memory = job.memory();
        let made = lodsmith_bake::bake_scene(detailed, lighter, scene, &options, self.map_files, job);
        let baked = made.map_err(|why| match why {
            BakeError::Cancelled if job.is_cancelled() => AssetError::Cancelled,
            BakeError::Cancelled => AssetError::BakeTimeout,
            why => AssetError::Bake(why),
        })?;
        let (sets, found) = (&baked.sets, &baked.found);
        let report = json!({
            "sets": sets.iter().map(set_json).collect::<Vec<_>>(),
            "sources": {
                "correspondence": found.by_correspondence,
                "ray": found.by_ray,
                "closest": found.by_distance,
                "elsewhere": found.elsewhere,
            },
        });
        Ok(BakedScene {
            warnings: baked.warnings,
            replaced: baked.meshes,
            materials: baked.materials,
            files: baked.files,
            is_new_atlas: sets.iter().any(|s| s.is_new_atlas),
            sets: baked.sets,
            report,
        })
    }

    /// Checks that the maps fit how and where they are written.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn check(&self, writing: &Writing, output: Option<&Sink>) -> Result<(), AssetError> {
        if writing.moves() {
            return Err(usage("a bake keeps the coordinates: use `lodsmith convert` for --scale and --up"));
        }
        output.map_or(Ok(()), |to| self.refuse_streams(to))
    }

    /// Returns an error if maps would have to be files and the output has no folder.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn refuse_streams(&self, to: &Sink) -> Result<(), AssetError> {
        let lost = self.options.maps.iter().find(|kind| self.map_files || !kind.is_of_material());
        match (to, lost) {
            (Sink::Stream, Some(kind)) => Err(usage(format!(
                "the map {} is a file beside the output: standard output has no folder",
                kind.name()
            ))),
            _ => Ok(()),
        }
    }
}

fn set_json(set: &BakedSet) -> Value {
    json!({
        "material": set.look.name,
        "size": set.size,
        "atlas": if set.is_new_atlas { "new" } else { "keep" },
        "maps": set.maps.iter().map(|m| m.kind.name()).collect::<Vec<_>>(),
        "ranges": set.maps.iter().filter_map(|m| Some((m.kind.name(), m.range?))).collect::<BTreeMap<_, _>>(),
    })
}

impl BakedScene {
    /// Returns a line for people.
    pub fn summary(&self) -> String {
        let named = |map: &BakedMap| match map.range {
            Some(range) => format!("{} up to {}", map.kind.name(), significant(range, 2)),
            None => map.kind.name().to_owned(),
        };
        match &self.sets[..] {
            [set] => {
                let kinds: Vec<String> = set.maps.iter().map(named).collect();
                format!("{} at {}²", kinds.join(", "), set.size)
            }
            sets => {
                let count: usize = sets.iter().map(|s| s.maps.len()).sum();
                format!("{count} maps of {} materials", sets.len())
            }
        }
    }
}

/// Writes files beside the output, with `mark` in their names.
///
/// # Errors
/// If the output is standard output, or a file cannot be written.
pub(crate) fn write_files(
    files: &[SideFile],
    mark: &str,
    to: &Destination,
    job: &mut Job<'_>,
) -> Result<(), AssetError> {
    for (end, bytes) in files {
        let path = beside(&to.sink, &format!("{mark}{end}"))?;
        if !to.dry_run {
            job.put_bytes(bytes, &Sink::Path(path), to.writing.force)?;
        }
    }
    Ok(())
}

fn beside(sink: &Sink, end: &str) -> Result<PathBuf, AssetError> {
    let Sink::Path(path) = sink else { return Err(usage("maps cannot be written to standard output")) };
    let name = path.file_name().map(Path::new).unwrap_or(path);
    let name = if name.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        name.with_extension("")
    } else {
        name.to_owned()
    };
    let stem = name.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(path.with_file_name(format!("{stem}{end}")))
}

/// Removes the warnings that vertex colours are gone, which are in a map.
pub(crate) fn forgive_colors(warnings: &mut Vec<Warning>) {
    warnings.retain(|w| !w.text.ends_with("no longer has its COLOR_0"));
}
