//! Meshes as the engine gets them, and the data that belong to them.

use lodsmith::{OwnedMeshData, SimplifyOptions};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Loaded, Warning};

use crate::args::PartNames;
use crate::file::Destination;
use crate::{constraints, palettes};

/// Returns the data of a mesh, and removes from it what the output cannot hold.
///
/// # Errors
/// If a name on the command line is not found.
pub(crate) fn of_mesh(
    loaded: &mut Loaded,
    names: &PartNames,
    to: Option<&Destination>,
    options: &SimplifyOptions,
) -> anyhow::Result<OwnedMeshData> {
    let mut data = constraints::of_mesh(names, loaded)?;
    let left_out = palettes::add_of_mesh(loaded, &mut data);
    loaded.warnings.extend(left_out);
    if loaded.format.is_scene() && !to.is_some_and(Destination::keeps_materials) {
        // If materials are not written, their borders need not be preserved.
        loaded.mesh.set_regions(None)?;
    }
    if options.per_mesh && loaded.contents.meshes > 1 {
        let text = "--per-mesh: the meshes become one on this way, and share the target";
        loaded.warnings.push(Warning::note(text));
    }
    Ok(data)
}

/// Returns the data of the meshes of a scene with these numbers, and warnings of images that are left out. `own` has the
/// data of a mesh that became a scene.
///
/// # Errors
/// If a name on the command line is not found.
pub(crate) fn of_scene(
    scene: &Scene,
    taken: &[usize],
    names: &PartNames,
    own: Option<OwnedMeshData>,
) -> anyhow::Result<(Vec<OwnedMeshData>, Vec<Warning>)> {
    let mut data = match own {
        Some(own) => vec![own],
        None => constraints::of_scene(names, scene, taken)?,
    };
    let left_out = palettes::add_of_scene(scene, taken, &mut data);
    Ok((data, left_out))
}
