//! Baking: maps of a high-poly model in the materials of a low-poly model.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lodsmith_bake::{AtlasMode, BakeError, BakeOptions, BakedMap, BakedSet, MapKind};
use lodsmith_core::numbers::significant;
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::Warning;
use lodsmith_io::gltf::Scene;
use serde_json::{Value, json};

use crate::destination::{Destination, Writing};
use crate::error::{AssetError, usage};
use crate::job::Job;
use crate::paths::Sink;

/// Maps to bake, and whether they are written to files.
#[derive(Clone, Debug)]
pub struct Baking {
    /// The maps, and options of their texels.
    pub options: BakeOptions,
    /// Also write every map to a file beside the output.
    pub map_files: bool,
}

/// A file beside an output: the suffix of its name, and its content.
pub type SideFile = (String, Arc<Vec<u8>>);

/// Result of baking a scene.
#[derive(Debug)]
pub struct BakedScene {
    /// The meshes of the scene, with texture coordinates and tangents.
    pub replaced: Vec<Option<TriMesh>>,
    /// For each mesh, the materials of its primitives in the scene (a single entry applies to all primitives).
    pub materials: Vec<Vec<usize>>,
    /// Maps that are written to files beside the output.
    pub files: Vec<SideFile>,
    /// The maps.
    pub sets: Vec<BakedSet>,
    /// Warnings of baking.
    pub warnings: Vec<Warning>,
    /// The report of the map sets.
    pub report: Value,
    /// True if any set has a new atlas.
    pub is_new_atlas: bool,
}

/// The data of meshes that baked maps hold, so that the meshes may lack them without a loss.
#[derive(Clone, Copy, Debug, Default)]
pub struct MovedIntoMaps {
    /// Colours of vertices.
    colors: bool,
    /// Materials: all faces have one material.
    materials: bool,
}

impl Baking {
    /// True if base colours are baked.
    pub(crate) fn has_color(&self) -> bool {
        self.options.maps.contains(&MapKind::Color)
    }

    /// Returns the data of the meshes that the maps hold.
    pub(crate) fn moved(&self) -> MovedIntoMaps {
        MovedIntoMaps { colors: self.has_color(), materials: self.options.atlas == AtlasMode::New }
    }

    /// Bakes maps of a low-poly model from a high-poly model, and adds materials with these maps to the scene of the
    /// low-poly model. The caller assigns the materials to meshes.
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

    /// Checks that the maps are compatible with the output and the options of writing.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn check(&self, writing: &Writing, output: Option<&Sink>) -> Result<(), AssetError> {
        if writing.moves() {
            return Err(usage("a bake does not move the mesh: use `lodsmith convert` for --scale and --up"));
        }
        output.map_or(Ok(()), |to| self.refuse_streams(to))
    }

    /// Returns an error if maps are written to files and the output has no folder.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn refuse_streams(&self, to: &Sink) -> Result<(), AssetError> {
        let lost = self.options.maps.iter().find(|kind| self.map_files || !kind.is_of_material());
        match (to, lost) {
            (Sink::Stream, Some(kind)) => Err(usage(format!(
                "the map {} is written to a file beside the output, which is impossible with standard output",
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
    /// Returns one line of text for people.
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
        let path = map_path(&to.sink, &format!("{mark}{end}"))?;
        if !to.dry_run {
            job.put_bytes(bytes, &Sink::Path(path), to.writing.force)?;
        }
    }
    Ok(())
}

fn map_path(sink: &Sink, end: &str) -> Result<PathBuf, AssetError> {
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

impl MovedIntoMaps {
    /// Removes the warnings of writing about data that the maps hold.
    pub(crate) fn drop_warnings(self, warnings: &mut Vec<Warning>) {
        let is_moved = |text: &str| {
            (self.colors && text.ends_with("no longer has its COLOR_0"))
                || (self.materials && text.ends_with("has no faces left: removed, with its material"))
                || (self.materials
                    && text.contains("primitives have no faces left: removed, with their materials"))
        };
        warnings.retain(|w| !is_moved(&w.text));
    }
}
