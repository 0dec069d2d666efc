//! Base-colour images for the engine, which keeps their colours in place.

use lodsmith::{OwnedMeshData, Texture, Textures};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{BaseColor, Loaded, Warning};

/// Adds the base-colour textures of some meshes of a scene to their data, and warns of those that are left out.
pub(crate) fn add_of_scene(scene: &Scene, taken: &[usize], data: &mut [OwnedMeshData]) -> Vec<Warning> {
    if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
        return Vec::new();
    }
    let (all, warnings) = scene.base_colors();
    for (&i, own) in taken.iter().zip(data) {
        own.textures = textures(all.get(i).into_iter().flatten());
    }
    warnings
}

/// Adds the base-colour textures of a mesh to its data, and warns of those that are left out.
pub(crate) fn add_of_mesh(loaded: &Loaded, data: &mut OwnedMeshData) -> Vec<Warning> {
    if loaded.mesh.uvs().is_none() {
        return Vec::new();
    }
    let (all, warnings) = loaded.base_colors();
    data.textures = textures(all.iter());
    warnings
}

/// Returns the textures of the regions of a mesh, if there are any.
fn textures<'a>(of_regions: impl Iterator<Item = &'a Option<BaseColor>>) -> Option<Textures> {
    Some(Textures::of_regions(of_regions.map(texture).collect())).filter(|own| !own.is_empty())
}

/// Returns a texture that uses the mesh's own texture coordinates.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}
