//! Materials and their textures.

use std::sync::Arc;

use lodsmith_core::Image;
use lodsmith_core::model::Material;

use crate::texture::{TexelKind, TextureSet};

/// Materials and textures of a model.
#[derive(Debug)]
pub(crate) struct MaterialSet {
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: TextureSet,
}

impl MaterialSet {
    pub(crate) fn new(materials: &[Material], images: &[Arc<Image>]) -> Self {
        Self { materials: materials.to_vec(), textures: TextureSet::new(images) }
    }

    /// Prepares the textures of these materials, before the parallel work that reads them.
    pub(crate) fn prepare(&self, used: impl Iterator<Item = usize>) {
        let used = used.filter_map(|material| self.materials.get(material)).flat_map(|m| {
            [
                (m.base_color_texture.as_ref(), TexelKind::Colors),
                (m.metallic_roughness_texture.as_ref(), TexelKind::Numbers),
                (m.normal_texture.as_ref(), TexelKind::Numbers),
                (m.occlusion_texture.as_ref(), TexelKind::Numbers),
                (m.emissive_texture.as_ref(), TexelKind::Colors),
            ]
        });
        self.textures.prepare(used.filter_map(|(reference, kind)| Some((reference?, kind))));
    }
}
