//! Images that give surfaces their colours, for the engine to keep them in place.

use std::sync::Arc;

use lodsmith::{Texture, Textures};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{BaseColor, Loaded};

/// Pixels of all images of colours together that are decoded for a run. (Palettes are small: four of 1024 by 1024, which
/// take some hundredths of a second. What is larger is a photograph or a painting, as a rule.)
const PIXELS: u64 = 1 << 22;

/// Those of some meshes of a scene.
pub(crate) fn of_scene(scene: &Scene, taken: &[usize]) -> Option<Arc<Textures>> {
    if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
        return None;
    }
    let all = scene.base_colors(PIXELS);
    let of_mesh = |&i: &usize| all.get(i).into_iter().flatten().map(texture).collect();
    shared(Textures::of_parts(taken.iter().map(of_mesh).collect()))
}

/// Those of a mesh.
pub(crate) fn of_mesh(loaded: &Loaded) -> Option<Arc<Textures>> {
    loaded.mesh.uvs()?;
    shared(Textures::of_regions(loaded.base_colors(PIXELS).iter().map(texture).collect()))
}

/// A texture that goes by the mesh's own texture coordinates.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}

fn shared(textures: Textures) -> Option<Arc<Textures>> {
    (!textures.is_empty()).then(|| Arc::new(textures))
}
