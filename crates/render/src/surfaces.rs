//! Materials, with textures prepared on first use.

use std::sync::{Arc, OnceLock};

use lodsmith_core::Image;
use lodsmith_core::model::{Material, TextureRef};

use crate::texture::{TexelKind, Texture};

/// Materials and textures of a model.
#[derive(Debug)]
pub(crate) struct MaterialSet {
    pub(crate) materials: Vec<Material>,
    images: Vec<Arc<Image>>,
    /// For each image, as colours and as numbers.
    textures: Vec<[OnceLock<Texture>; 2]>,
}

impl MaterialSet {
    pub(crate) fn new(materials: &[Material], images: &[Arc<Image>]) -> Self {
        let textures = images.iter().map(|_| Default::default()).collect();
        Self { materials: materials.to_vec(), images: images.to_vec(), textures }
    }

    /// Returns the texture of a reference; `None` if there is none.
    pub(crate) fn texture(&self, reference: &TextureRef, meaning: TexelKind) -> Option<&Texture> {
        let slots = self.textures.get(reference.image)?;
        let slot = &slots[usize::from(meaning == TexelKind::Numbers)];
        Some(slot.get_or_init(|| Texture::new(&self.images[reference.image], meaning)))
    }
}
