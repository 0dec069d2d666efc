//! Base-colour images for the engine, which keeps palette colours in place.

use lodsmith::{OwnedMeshData, Texture, Textures};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{BaseColor, Loaded, Warning};

/// The base-colour textures of the meshes that a run simplifies, and warnings about textures that are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Palettes {
    of_meshes: Vec<Option<Textures>>,
    pub(crate) left_out: Vec<Warning>,
}

impl Palettes {
    /// Decodes the images of some meshes of a scene.
    pub(crate) fn of_scene(scene: &Scene, taken: &[usize]) -> Self {
        if taken.iter().all(|&i| scene.meshes()[i].mesh.uvs().is_none()) {
            return Self::default();
        }
        let (all, left_out) = scene.base_colors();
        let of_meshes = taken.iter().map(|&i| textures(all.get(i).into_iter().flatten())).collect();
        Self { of_meshes, left_out }
    }

    /// Decodes the images of a mesh.
    pub(crate) fn of_mesh(loaded: &Loaded) -> Self {
        if loaded.mesh.uvs().is_none() {
            return Self::default();
        }
        let (all, left_out) = loaded.base_colors();
        Self { of_meshes: vec![textures(all.iter())], left_out }
    }

    /// Adds the textures to the data of the meshes.
    pub(crate) fn add_to(&self, data: &mut [OwnedMeshData]) {
        for (own, textures) in data.iter_mut().zip(&self.of_meshes) {
            own.textures = textures.clone();
        }
    }
}

/// Returns the textures of the regions of a mesh, if there are any.
fn textures<'a>(of_regions: impl Iterator<Item = &'a Option<BaseColor>>) -> Option<Textures> {
    Some(Textures::of_regions(of_regions.map(texture).collect())).filter(|own| !own.is_empty())
}

/// Returns a texture that uses the texture coordinates of the mesh.
fn texture(of: &Option<BaseColor>) -> Option<Texture> {
    let (image, at) = of.as_ref().filter(|(_, at)| at.uv_set == 0)?;
    Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
}
