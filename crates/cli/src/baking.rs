//! Baking by the command: maps from a detailed scene into the materials of a lighter one.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use lodsmith::Control;
use lodsmith::core::{Model, Semantic, TriMesh};
use lodsmith_bake::{BakeError, BakeOptions, Baked, BakedSet, MapKind, bake};
use lodsmith_io::gltf::{NewMaterial, Scene, SlotImage, TextureSlot};
use lodsmith_io::{Format, ModelFile, ReadOptions, Warning};
use serde_json::{Value, json};

use crate::args::{BakeArgs, TextureArgs, Writing};
use crate::file::{self, Destination};
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
    check_memory(high, low, options)?;
    let baked = match bake(high, low, options, control) {
        Err(BakeError::Cancelled) if exit::interrupted() => return Err(Interrupted.into()),
        Err(BakeError::Cancelled) => {
            return Err(anyhow!("the time limit ended the bake, which has no partial result"));
        }
        baked => baked?,
    };
    let Baked { meshes, set_of_region, sets, found, notes, .. } = baked;
    let mut numbers = Vec::with_capacity(sets.len());
    let mut files = Vec::new();
    let several = sets.len() > 1;
    for set in &sets {
        let (material, own) = material_of(set, texture.map_files, several)?;
        numbers.push(scene.add_material(&material));
        files.extend(own);
    }
    let materials = set_of_region.iter().map(|all| all.iter().map(|s| numbers[*s]).collect()).collect();
    let total = found.by_correspondence + found.by_ray + found.by_distance + found.elsewhere;
    let mut warnings: Vec<Warning> = notes.into_iter().map(Warning::note).collect();
    let astray = found.elsewhere as f64 / total.max(1) as f64;
    if astray > MAX_ASTRAY {
        let text = format!(
            "{:.0} % of the texels have no counterpart within reach: do both models lie in the same place?",
            100.0 * astray
        );
        warnings.push(Warning::note(text));
    }
    let report = json!({
        "sets": sets.iter().map(set_json).collect::<Vec<_>>(),
        "sources": {
            "correspondence": found.by_correspondence,
            "ray": found.by_ray,
            "closest": found.by_distance,
            "elsewhere": found.elsewhere,
        },
    });
    let summary = summary(&sets);
    let is_new_atlas = sets.iter().any(|s| s.is_new_atlas);
    let has_color = options.maps.contains(&MapKind::Color);
    Ok(BakedScene { replaced: meshes, materials, files, warnings, report, summary, is_new_atlas, has_color })
}

/// Share of samples without a counterpart from which on a warning is due. (Guessed.)
const MAX_ASTRAY: f64 = 0.2;

/// Returns the material of a set, and the maps that are files, by the ends of their names.
#[allow(clippy::type_complexity, reason = "the pair is taken apart at once")]
fn material_of(
    set: &BakedSet,
    all_files: bool,
    several: bool,
) -> anyhow::Result<(NewMaterial, Vec<(String, Arc<Vec<u8>>)>)> {
    let (mut images, mut files) = (Vec::new(), Vec::new());
    for map in &set.maps {
        let png = Arc::new(map.to_png().with_context(|| format!("the map {}", map.kind.name()))?);
        let own =
            if several && !set.name.is_empty() { format!("_{}", safe(&set.name)) } else { String::new() };
        let end = format!("{own}_{}.png", map.kind.name());
        let packed = images.iter().find(|i: &&SlotImage| i.slot == TextureSlot::MetallicRoughness);
        if let (MapKind::Occlusion, Some(packed)) = (map.kind, packed) {
            // Its red channel holds the same values.
            images.push(SlotImage { slot: TextureSlot::Occlusion, ..packed.clone() });
        } else if let Some(slot) = slot_of(map.kind) {
            let name = format!("{}{}", safe(&set.name), end.trim_end_matches(".png"));
            images.push(SlotImage { slot, name: name.trim_start_matches('_').to_owned(), png: png.clone() });
        }
        if all_files || !map.kind.is_of_material() {
            files.push((end, png));
        }
    }
    Ok((NewMaterial::new(set.look.clone(), set.material, images), files))
}

fn slot_of(kind: MapKind) -> Option<TextureSlot> {
    match kind {
        MapKind::Color => Some(TextureSlot::BaseColor),
        MapKind::MetallicRoughness => Some(TextureSlot::MetallicRoughness),
        MapKind::Normal => Some(TextureSlot::Normal),
        MapKind::Occlusion => Some(TextureSlot::Occlusion),
        MapKind::Emissive => Some(TextureSlot::Emissive),
        _ => None,
    }
}

/// Returns a name that any file system accepts.
fn safe(name: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
    name.chars().take(60).map(letter).collect()
}

fn set_json(set: &BakedSet) -> Value {
    json!({
        "material": set.look.name,
        "size": set.size,
        "atlas": if set.is_new_atlas { "new" } else { "keep" },
        "maps": set.maps.iter().map(|m| m.kind.name()).collect::<Vec<_>>(),
    })
}

fn summary(sets: &[BakedSet]) -> String {
    let one = |set: &BakedSet| {
        let kinds: Vec<&str> = set.maps.iter().map(|m| m.kind.name()).collect();
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

/// Refuses a bake that needs more memory than there is: values of four floats per texel of each map, two trees and the
/// textures with their smaller copies.
fn check_memory(high: &Model, low: &Model, options: &BakeOptions) -> anyhow::Result<()> {
    let faces = |model: &Model| model.meshes.iter().map(|m| m.mesh.face_count() as u64).sum::<u64>();
    let pixels: u64 = high.images.iter().map(|i| (i.width() * i.height()) as u64).sum();
    // (A chosen size is at most 4096.)
    let size = options.size.unwrap_or(4096) as u64;
    let texels = size.saturating_mul(size).saturating_mul(24 * options.maps.len() as u64 + 32);
    let need = texels.saturating_add((faces(high) + faces(low)) * 500).saturating_add(pixels * 12);
    memory::check("baking", need)
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

/// Writes a scene with baked meshes in any format: those other than glTF by way of a GLB in memory.
pub(crate) fn write_baked(
    to: &Destination,
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    relink: &dyn Fn(&str) -> Option<String>,
) -> anyhow::Result<WriteOutcome> {
    if matches!(to.format, Format::Gltf | Format::Glb) {
        return to.write_scene(scene, replaced, relink);
    }
    // Other formats have no tangents; a viewer computes the same ones.
    let without_tangents =
        |mesh: &TriMesh| mesh.clone().without_further(|semantic| *semantic == Semantic::Tangent);
    let replaced: Vec<_> = replaced.iter().map(|mesh| mesh.as_ref().map(without_tangents)).collect();
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
    warnings.retain(|w| !(has_color && w.text.ends_with("does not have its COLOR_0 any more")));
}

/// Returns the model of a scene with other meshes.
pub(crate) fn model_with(model: &Model, replaced: &[Option<TriMesh>]) -> Model {
    let meshes = model.meshes.iter().enumerate().map(|(i, old)| match replaced.get(i) {
        Some(Some(mesh)) => Arc::new(mesh.clone()),
        _ => old.mesh.clone(),
    });
    model.with_meshes(meshes.collect())
}

/// Returns the model of a scene.
pub(crate) fn model_of(scene: &Scene) -> ModelFile {
    ModelFile::from(scene.clone())
}

/// Lets the meshes of a scene use their baked materials.
pub(crate) fn set_materials(scene: &mut Scene, materials: &[Vec<usize>]) {
    for (mesh, own) in materials.iter().enumerate() {
        for (primitive, material) in own.iter().enumerate() {
            scene.set_material(mesh, (own.len() > 1).then_some(primitive), *material);
        }
    }
}
