//! Whole GLB files, with the bytes of the command.

use js_sys::{Array, Function, Object, Uint8Array};
use lodsmith::{OwnedMeshData, Part, SimplifiedScene, Starved, Texture, Textures, simplify_scene};
use lodsmith_io::gltf::{Compression, Packing, PlacedMesh, Scene, SceneFormat, SceneMesh, placed_meshes};
use lodsmith_io::{BaseColor, Format, ReadOptions, Warning};
use wasm_bindgen::prelude::*;

use crate::errors::{run_error, wrong_type, wrong_value};
use crate::options::{data_of_meshes, options_of};
use crate::progress::Progress;
use crate::report::{report, set};

/// Memory of a module in bytes: its addresses have 32 bits. A quarter is left for the run.
const MEMORY: u64 = 3 << 30;

/// Simplifies all meshes of a GLB file, or of a glTF file whose buffers and images are in it, under one budget.
///
/// # Errors
/// A file that cannot be read, options that are wrong, a run that failed or was cancelled.
#[wasm_bindgen(js_name = simplifyGlb)]
pub fn simplify_glb(
    bytes: &[u8],
    options: &JsValue,
    compress: &JsValue,
    quantize: &JsValue,
    progress: Option<Function>,
) -> Result<Object, JsValue> {
    let (options, data) = options_of(options)?;
    let packing = packing_of(compress, quantize)?;
    let mut reading = ReadOptions::default();
    reading.limits.memory = MEMORY;
    let scene = lodsmith_io::read_scene_bytes(bytes, &reading).map_err(|e| wrong_value(&e.to_string()))?;
    let scene = scene.ok_or_else(|| wrong_value("not a file of glTF 2.0"))?;
    let meshes = scene.meshes().to_vec();
    let placed = placed_meshes(&meshes);
    let taken: Vec<usize> = placed.iter().map(|p| p.index).collect();
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let mut data = data_of_meshes(&data, taken.iter().map(|&i| meshes[i].mesh.vertex_count()))?;
    let left_out = add_palettes(&scene, &taken, &mut data);
    let parts = parts_of(&meshes, &placed, &data);
    let done = simplify_scene(&parts, diagonal, &options, &mut Progress::new(progress));
    let SimplifiedScene { meshes: lighter, report: mut told, counts } = done.map_err(|e| run_error(&e))?;
    let starved = Starved::of(&counts).map(|s| Warning::note(format!("{s}; perMesh gives each its own")));
    // As in the file: the reader merges vertices at one place.
    told.input_vertices = wedge_count(&parts);
    let mut replaced = vec![None; meshes.len()];
    for (&i, mesh) in taken.iter().zip(lighter) {
        // A mesh without faces in the input is not changed.
        replaced[i] = (meshes[i].mesh.face_count() > 0).then_some(mesh);
    }
    let mut out = Vec::new();
    let lost = lodsmith_io::write_scene_to(
        &scene,
        &replaced,
        SceneFormat::new(Format::Glb, packing),
        &|_| None,
        &mut out,
    )
    .map_err(|e| wrong_value(&e.to_string()))?
    .warnings;
    let text = |w: &Warning| JsValue::from(w.text.as_str());
    let warnings: Array =
        scene.warnings().iter().chain(&left_out).chain(&starved).chain(&lost).map(text).collect();
    let all = Object::new();
    set(&all, "bytes", &Uint8Array::from(&out[..]));
    set(&all, "report", &report(&told));
    set(&all, "warnings", &warnings);
    Ok(all)
}

/// Converts the options that only files have.
fn packing_of(compress: &JsValue, quantize: &JsValue) -> Result<Packing, JsValue> {
    let name = compress.as_string().ok_or_else(|| wrong_type("compress: a string is expected"))?;
    let compression = Compression::ALL.into_iter().find(|c| c.name() == name).ok_or_else(|| {
        let names = Compression::ALL.map(Compression::name).join(", ");
        wrong_value(&format!("compress: one of {names} is expected, not {name:?}"))
    })?;
    let quantize = quantize.as_bool().ok_or_else(|| wrong_type("quantize: true or false is expected"))?;
    Ok(Packing::new(compression, quantize))
}

/// Returns the number of wedges of all instances; each mesh counts once if none is placed.
fn wedge_count(parts: &[Part<'_>]) -> usize {
    let is_placed = parts.iter().any(|p| p.instances > 0);
    parts.iter().map(|p| p.mesh.wedge_count() * if is_placed { p.instances } else { 1 }).sum()
}

/// Returns the meshes of a scene to simplify, with their data, as parts.
fn parts_of<'a>(meshes: &'a [SceneMesh], placed: &[PlacedMesh], data: &'a [OwnedMeshData]) -> Vec<Part<'a>> {
    let part = |(placed, data): (&PlacedMesh, &'a OwnedMeshData)| {
        let m = &meshes[placed.index];
        let (instances, scale, stretch) = (m.instances, m.scale, m.stretch);
        let (system, places, data) = (placed.system, &m.places, data.view());
        Part { mesh: &m.mesh, instances, scale, stretch, system, places, data }
    };
    placed.iter().zip(data).map(part).collect()
}

/// Adds the base-colour textures of some meshes of a scene, whose colours the engine keeps in place, and warns of those
/// that are left out.
fn add_palettes(scene: &Scene, taken: &[usize], data: &mut [OwnedMeshData]) -> Vec<Warning> {
    if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
        return Vec::new();
    }
    let (all, warnings) = scene.base_colors();
    for (&i, own) in taken.iter().zip(data) {
        own.textures = Some(Textures::of_regions(all.get(i).into_iter().flatten().map(texture).collect()));
    }
    warnings
}

/// Returns a texture that uses the mesh's own texture coordinates.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}
