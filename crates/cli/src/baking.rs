//! Baking by the command: maps from a detailed scene into the materials of a lighter one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use lodsmith::Control;
use lodsmith::core::{Model, Semantic, TriMesh};
use lodsmith_bake::{BakeError, BakeOptions, BakedMap, BakedSet, MapKind};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ModelFile, ReadOptions, Warning};
use serde_json::{Value, json};

use crate::args::{BakeArgs, TextureArgs, Writing};
use crate::file::{self, Destination};
use crate::numbers::short;
use crate::paths::Sink;
use crate::sizes::WriteOutcome;
use crate::status::{Interrupted, usage};
use crate::{exit, memory};

/// Result of a bake on a scene.
pub(crate) struct BakedScene {
    /// The meshes of the scene, with texture coordinates and tangents.
    pub(crate) replaced: Vec<Option<TriMesh>>,
    /// For each mesh and primitive (one entry for all), its material in the scene.
    pub(crate) materials: Vec<Vec<usize>>,
    /// Maps that are files beside the output, by the end of their names.
    pub(crate) files: Vec<(String, Arc<Vec<u8>>)>,
    pub(crate) warnings: Vec<Warning>,
    /// The report of the sets.
    pub(crate) report: Value,
    /// One line for people.
    pub(crate) summary: String,
    /// True if any set has an atlas of its own.
    pub(crate) is_new_atlas: bool,
    /// True if colours are baked everywhere.
    pub(crate) has_color: bool,
}

/// Bakes maps of a lighter model from a detailed one, and adds their materials to the scene of the lighter one. Which
/// meshes use them is for the caller to set.
pub(crate) fn bake_scene(
    high: &Model,
    low: &Model,
    scene: &mut Scene,
    options: &BakeOptions,
    texture: &TextureArgs,
    control: &mut dyn Control,
) -> anyhow::Result<BakedScene> {
    let baked = match lodsmith_bake::bake_scene(high, low, scene, options, texture.map_files, control) {
        Err(BakeError::Cancelled) if exit::interrupted() => return Err(Interrupted.into()),
        Err(BakeError::Cancelled) => {
            return Err(anyhow!("the time limit ended the bake, which has no partial result"));
        }
        baked => baked?,
    };
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
    let (is_new_atlas, summary) = (sets.iter().any(|s| s.is_new_atlas), summary(sets));
    Ok(BakedScene {
        warnings: baked.warnings,
        replaced: baked.meshes,
        materials: baked.materials,
        files: baked.files,
        report,
        summary,
        is_new_atlas,
        has_color: options.maps.contains(&MapKind::Color),
    })
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

fn summary(sets: &[BakedSet]) -> String {
    let one = |set: &BakedSet| {
        let named = |map: &BakedMap| match map.range {
            Some(range) => format!("{} up to {}", map.kind.name(), short(range)),
            None => map.kind.name().to_owned(),
        };
        let kinds: Vec<String> = set.maps.iter().map(named).collect();
        format!("{} at {}²", kinds.join(", "), set.size)
    };
    match sets {
        [set] => one(set),
        _ => {
            let count: usize = sets.iter().map(|s| s.maps.len()).sum();
            format!("{count} maps of {} materials", sets.len())
        }
    }
}

/// Writes the maps that are files beside the output, with `mark` in their names.
///
/// # Errors
/// If the output is standard output, or a file cannot be written.
pub(crate) fn write_files(
    files: &[(String, Arc<Vec<u8>>)],
    mark: &str,
    to: &Destination,
) -> anyhow::Result<()> {
    for (end, png) in files {
        let path = beside(&to.sink, &format!("{mark}{end}"))?;
        if !to.dry_run {
            file::write_bytes(png, &path, to.writing.force)?;
        }
    }
    Ok(())
}

/// Checks that options of baking go together and fit the output.
///
/// # Errors
/// A usage error.
pub(crate) fn check(args: &BakeArgs, writing: &Writing, output: Option<&Sink>) -> anyhow::Result<()> {
    let texture = &args.texture;
    if !args.is_asked() {
        let is_set = texture.texture_size.is_some() || texture.ao_distance.is_some() || texture.map_files;
        return if is_set {
            Err(usage("--texture-size, --ao-distance and --map-files need --bake"))
        } else {
            Ok(())
        };
    }
    if writing.scale.is_some() || writing.up.is_some() {
        return Err(usage("--bake keeps the coordinates: use `lodsmith convert` for --scale and --up"));
    }
    output.map_or(Ok(()), |to| refuse_streams(to, &args.bake, texture))
}

/// Returns an error if maps would have to be files and the output has no folder.
pub(crate) fn refuse_streams(to: &Sink, maps: &[MapKind], texture: &TextureArgs) -> anyhow::Result<()> {
    let lost = maps.iter().find(|kind| texture.map_files || !kind.is_of_material());
    match (to, lost) {
        (Sink::Stdout, Some(kind)) => Err(usage(format!(
            "the map {} is a file beside the output: standard output has no folder",
            kind.name()
        ))),
        _ => Ok(()),
    }
}

fn beside(sink: &Sink, end: &str) -> anyhow::Result<PathBuf> {
    let Sink::Path(path) = sink else { return Err(anyhow!("maps cannot be written to standard output")) };
    let name = path.file_name().map(Path::new).unwrap_or(path);
    let name = if name.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        name.with_extension("")
    } else {
        name.to_owned()
    };
    let stem = name.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(path.with_file_name(format!("{stem}{end}")))
}

/// Writes a scene with baked meshes in any format: those that hold one mesh by way of a GLB in memory.
pub(crate) fn write_baked(
    to: &Destination,
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    relink: &dyn Fn(&str) -> Option<String>,
) -> anyhow::Result<WriteOutcome> {
    if to.keeps_scenes() {
        return to.write_scene(scene, replaced, relink);
    }
    // Other formats have no tangents; a viewer computes the same ones.
    let without_tangents =
        |mesh: &TriMesh| mesh.clone().without_further(|semantic| *semantic == Semantic::Tangent);
    let replaced: Vec<_> = replaced.iter().map(|mesh| mesh.as_ref().map(without_tangents)).collect();
    if to.format.keeps_scenes() {
        return to.write_scene(scene, &replaced, relink);
    }
    let mut bytes = Vec::new();
    let mut warnings = lodsmith_io::write_scene_to(scene, &replaced, Format::Glb, &|_| None, &mut bytes)
        .map_err(|e| anyhow!("{e}"))?
        .warnings;
    let mut options = ReadOptions::default();
    options.limits = memory::limits();
    let loaded = lodsmith_io::read_bytes(&bytes, &options).map_err(file::unnamed)?;
    warnings.extend(loaded.warnings);
    let mut made = to.write(&loaded.mesh, loaded.regions)?;
    made.warnings.splice(0..0, warnings);
    Ok(made)
}

/// Removes the warnings that vertex colours are gone, if they are in a map.
pub(crate) fn forgive_colors(warnings: &mut Vec<Warning>, has_color: bool) {
    warnings.retain(|w| !(has_color && w.text.ends_with("no longer has its COLOR_0")));
}

/// Returns the model of a scene.
pub(crate) fn model_of(scene: &Scene) -> ModelFile {
    ModelFile::from(scene.clone())
}
