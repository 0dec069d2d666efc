//! Colour images of a mesh, for runs that repair texture colours.

use std::sync::Arc;

use lodsmith_core::model::{Model, Sampler, TextureRef, Wrap};
use lodsmith_core::{Image, RegionId};

/// A colour image, and how texture coordinates address it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The pixels.
    pub image: Arc<Image>,
    /// Maps texture coordinates to the image, as two rows of three; see [`TextureRef::transform`].
    pub transform: [[f32; 3]; 2],
    /// How the image repeats beyond its edges.
    pub sampler: Sampler,
}

impl Texture {
    /// Creates a repeating texture without a transform.
    pub fn new(image: impl Into<Arc<Image>>) -> Self {
        Self { image: image.into(), transform: TextureRef::PLAIN, sampler: Sampler::default() }
    }

    /// Returns the pixel at texture coordinates; `None` if they are not finite or the image is empty.
    pub(crate) fn color(&self, [u, v]: [f32; 2]) -> Option<[u8; 4]> {
        let row = |[a, b, c]: [f32; 3]| a * u + b * v + c;
        let [u, v] = self.transform.map(row);
        let (w, h) = (self.image.width(), self.image.height());
        if w == 0 || h == 0 || !u.is_finite() || !v.is_finite() {
            return None;
        }
        let x = pixel(u, w, self.sampler.wrap_u);
        let y = pixel(1.0 - v, h, self.sampler.wrap_v);
        Some(self.image.at(x, y))
    }
}

/// Returns the index of the pixel at a coordinate, in a row of `n`; the image spans coordinates from 0 to 1.
fn pixel(at: f32, n: usize, wrap: Wrap) -> usize {
    let inside = match wrap {
        Wrap::Clamp => at,
        Wrap::Repeat => at - at.floor(),
        Wrap::Mirror => {
            let twice = at - 2.0 * (at / 2.0).floor();
            if twice > 1.0 { 2.0 - twice } else { twice }
        }
    };
    // (The cast saturates, so coordinates beyond an edge give the last pixel there.)
    ((inside * n as f32) as usize).min(n - 1)
}

/// The colour image of each region of a mesh: see [`MeshData::textures`](crate::MeshData::textures).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures(Vec<Option<Texture>>);

impl Textures {
    /// Takes the textures of the regions of one mesh, by index; a mesh without regions uses the first.
    pub fn of_regions(regions: Vec<Option<Texture>>) -> Self {
        Self(regions)
    }

    /// Takes the base colour textures of a mesh of a model, given by index. Textures that use any but the
    /// first set of texture coordinates are left out.
    ///
    /// # Panics
    /// If the model has no mesh with this index.
    pub fn of_model(model: &Model, mesh: usize) -> Self {
        let texture = |material: &Option<usize>| {
            let at = model.materials.get((*material)?)?.base_color_texture?;
            let image = model.images.get(at.image).filter(|_| at.uv_set == 0)?;
            Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
        };
        Self(model.meshes[mesh].materials.iter().map(texture).collect())
    }

    /// True if no region has a texture.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }

    /// Returns the bytes of the images of several meshes, each image counted once.
    pub fn bytes_of_all<'a>(all: impl IntoIterator<Item = &'a Self>) -> u64 {
        let images = all.into_iter().flat_map(|own| own.0.iter().flatten()).map(|texture| &texture.image);
        let mut known: Vec<*const Image> = Vec::new();
        let mut bytes = 0;
        for image in images {
            let address = Arc::as_ptr(image);
            if !known.contains(&address) {
                known.push(address);
                bytes += std::mem::size_of_val(image.pixels()) as u64;
            }
        }
        bytes
    }

    /// Returns the texture of a region.
    pub(crate) fn of(&self, region: Option<RegionId>) -> Option<&Texture> {
        self.0.get(region.unwrap_or_default().index())?.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_wrap_as_their_sampler_specifies() {
        let all = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
        let at = |x: f32| all.map(|wrap| pixel(x, 4, wrap));
        assert_eq!(at(0.3), [1, 1, 1]);
        assert_eq!(at(1.3), [1, 2, 3]);
        assert_eq!(at(-0.3), [2, 1, 0]);
        assert_eq!(at(1e30)[2], 3);
    }

    #[test]
    fn texture_coordinates_start_at_the_lower_left() {
        let (red, green) = ([255, 0, 0, 255], [0, 255, 0, 255]);
        let texture = Texture::new(Image::new(1, 2, vec![red, green]));
        assert_eq!(texture.color([0.5, 0.9]), Some(red));
        assert_eq!(texture.color([0.5, 0.1]), Some(green));
        assert_eq!(texture.color([f32::NAN, 0.1]), None);
        assert_eq!(Texture::new(Image::new(0, 0, Vec::new())).color([0.5, 0.5]), None);
    }
}
