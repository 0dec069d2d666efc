//! Base-colour images for the engine, which keeps their colours in place.

use std::sync::Arc;

use lodsmith::{Texture, Textures};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{BaseColor, Loaded, Warning};

/// The images of a run; `None` without any.
pub(crate) type Palettes = Option<Arc<Textures>>;

/// Returns the base-colour textures of some meshes of a scene, and warns of those that are left out.
pub(crate) fn of_scene(scene: &Scene, taken: &[usize]) -> (Palettes, Vec<Warning>) {
    if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
        return (None, Vec::new());
    }
    let (all, warnings) = scene.base_colors();
    let of_mesh = |&i: &usize| all.get(i).into_iter().flatten().map(texture).collect();
    (shared(Textures::of_parts(taken.iter().map(of_mesh).collect())), warnings)
}

/// Returns the base-colour textures of a mesh, and warns of those that are left out.
pub(crate) fn of_mesh(loaded: &Loaded) -> (Palettes, Vec<Warning>) {
    if loaded.mesh.uvs().is_none() {
        return (None, Vec::new());
    }
    let (all, warnings) = loaded.base_colors();
    (shared(Textures::of_regions(all.iter().map(texture).collect())), warnings)
}

/// Returns a texture that uses the mesh's own texture coordinates.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}

fn shared(textures: Textures) -> Palettes {
    (!textures.is_empty()).then(|| Arc::new(textures))
}
