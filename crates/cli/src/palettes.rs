//! Base-colour images for the engine, which keeps the colours of palettes in place.

use std::sync::Arc;

use lodsmith::{Texture, Textures};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{BaseColor, Loaded};

/// Largest total number of pixels of base-colour images that are decoded for a run. (Palettes are small: four
/// of 1024 by 1024, which take some hundredths of a second. Larger images are usually photographs or
/// paintings.)
const MAX_PALETTE_PIXELS: u64 = 1 << 22;

/// Returns the base-colour textures of some meshes of a scene.
pub(crate) fn of_scene(scene: &Scene, taken: &[usize]) -> Option<Arc<Textures>> {
    if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
        return None;
    }
    let all = scene.base_colors(MAX_PALETTE_PIXELS);
    let of_mesh = |&i: &usize| all.get(i).into_iter().flatten().map(texture).collect();
    shared(Textures::of_parts(taken.iter().map(of_mesh).collect()))
}

/// Returns the base-colour textures of a mesh.
pub(crate) fn of_mesh(loaded: &Loaded) -> Option<Arc<Textures>> {
    loaded.mesh.uvs()?;
    shared(Textures::of_regions(loaded.base_colors(MAX_PALETTE_PIXELS).iter().map(texture).collect()))
}

/// Returns a texture that uses the mesh's own texture coordinates.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}

fn shared(textures: Textures) -> Option<Arc<Textures>> {
    (!textures.is_empty()).then(|| Arc::new(textures))
}
