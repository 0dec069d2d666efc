//! Warnings that the writers of all formats share: what a format cannot hold.

use lodsmith_core::TriMesh;

use crate::error::Warning;
use crate::format::Format;
use crate::gltf::Packing;
use crate::material::{Regions, Textures, drops_materials};
use crate::options::WriteOptions;

/// Returns the warnings about a mesh in a format, beside those of the writer of that format.
pub(crate) fn losses(mesh: &TriMesh, format: Format, options: &WriteOptions) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let regions = options.regions.as_deref();
    let with_materials = options.textures != Textures::None;
    if format != Format::Obj
        && let Some(lost) = regions.and_then(|regions| {
            let is_carried = matches!(format, Format::Gltf | Format::Glb | Format::ThreeMf)
                && !drops_materials(mesh, regions);
            match format {
                Format::Ply => regions.lost_in_ply(mesh, with_materials),
                _ => regions.lost_headings(with_materials && !is_carried),
            }
        })
    {
        warnings.push(Warning::lost(format!("{} cannot carry {lost}: dropped", format.title())));
    }
    warnings.extend(lost_integers_warning(mesh, format));
    if !matches!(format, Format::Gltf | Format::Glb) {
        warnings.extend(not_packed_warning(format, options.packing));
    }
    if !with_materials && regions.is_some_and(Regions::has_materials) {
        warnings.push(Warning::note("materials dropped: --textures none"));
    }
    warnings
}

/// Returns the note that a format cannot be packed, if packing was requested.
pub(crate) fn not_packed_warning(format: Format, packing: Packing) -> Option<Warning> {
    let text = format!("{} is neither compressed nor quantized: only glTF and GLB are", format.title());
    packing.is_needed().then(|| Warning::note(text))
}

/// Returns the warning about named integer attributes that a format cannot carry.
fn lost_integers_warning(mesh: &TriMesh, format: Format) -> Option<Warning> {
    let further = mesh.further_attributes().iter().filter(|a| a.semantic.is_discrete());
    let names: Vec<&str> = further.filter_map(|a| a.semantic.name()).collect();
    let is_lost = format != Format::Ply && !names.is_empty();
    is_lost.then(|| {
        Warning::lost(format!("{} cannot carry {} of vertices: dropped", format.title(), names.join(", ")))
    })
}
