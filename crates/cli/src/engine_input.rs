//! A mesh as the engine gets it, and the data that belong to it.

use lodsmith::{OwnedMeshData, SimplifyOptions};
use lodsmith_io::{Loaded, Warning};

use crate::args::PartNames;
use crate::file::Destination;
use crate::{constraints, palettes};

/// Returns the data of a mesh, and removes from it what the output cannot hold.
///
/// # Errors
/// If a name on the command line is not found.
pub(crate) fn prepare(
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
