//! The images that give surfaces their colours, for a run that is to keep them in place.

use std::sync::Arc;

use lodsmith_core::model::{Model, Sampler, TextureRef, Wrap};
use lodsmith_core::{Image, RegionId};

/// An image of colours, and how texture coordinates look into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The pixels.
    pub image: Arc<Image>,
    /// Two rows of three: where in the image a pair of texture coordinates looks, as [`TextureRef::transform`].
    pub transform: [[f32; 3]; 2],
    /// How it goes on beyond its edges.
    pub sampler: Sampler,
}

impl Texture {
    /// An image that repeats, and that texture coordinates look into as they are.
    pub fn new(image: impl Into<Arc<Image>>) -> Self {
        Self { image: image.into(), transform: TextureRef::PLAIN, sampler: Sampler::default() }
    }

    /// The pixel that a pair of texture coordinates looks at; `None` where they are no numbers or there is none.
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

/// The pixel of a row of `n` at a place in sizes of the image.
fn pixel(at: f32, n: usize, wrap: Wrap) -> usize {
    let inside = match wrap {
        Wrap::Clamp => at,
        Wrap::Repeat => at - at.floor(),
        Wrap::Mirror => {
            let twice = at - 2.0 * (at / 2.0).floor();
            if twice > 1.0 { 2.0 - twice } else { twice }
        }
    };
    // (A cast saturates, so what lies beyond an edge is the last pixel there.)
    ((inside * n as f32) as usize).min(n - 1)
}

/// The image of colours of each region of a mesh, or of each part of a scene: see
/// [`SimplifyOptions::textures`](crate::SimplifyOptions::textures).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures(Vec<Vec<Option<Texture>>>);

impl Textures {
    /// Those of the regions of one mesh, by number; the first is that of a mesh without regions.
    pub fn of_regions(regions: Vec<Option<Texture>>) -> Self {
        Self(vec![regions])
    }

    /// The same for each part of a scene, in their order.
    pub fn of_parts(parts: Vec<Vec<Option<Texture>>>) -> Self {
        Self(parts)
    }

    /// The base colours of some meshes of a model, by number, as parts of a scene in this order. Textures that do not go
    /// by the mesh's own texture coordinates are left out.
    ///
    /// # Panics
    /// If the model has no mesh of a number.
    pub fn of_model(model: &Model, meshes: impl IntoIterator<Item = usize>) -> Self {
        let texture = |material: &Option<usize>| {
            let at = model.materials.get((*material)?)?.base_color_texture?;
            let image = model.images.get(at.image).filter(|_| at.uv_set == 0)?;
            Some(Texture { image: image.clone(), transform: at.transform, sampler: at.sampler })
        };
        Self(meshes.into_iter().map(|i| model.meshes[i].materials.iter().map(texture).collect()).collect())
    }

    /// Whether no surface has one.
    pub fn is_empty(&self) -> bool {
        self.0.iter().flatten().all(Option::is_none)
    }

    /// That of a region of a part.
    pub(crate) fn of(&self, part: usize, region: Option<RegionId>) -> Option<&Texture> {
        self.0.get(part)?.get(region.unwrap_or_default().index())?.as_ref()
    }

    /// Those of one part alone.
    pub(crate) fn part(&self, part: usize) -> Self {
        Self(vec![self.0.get(part).cloned().unwrap_or_default()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_go_on_as_their_sampler_says() {
        let all = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
        let at = |x: f32| all.map(|wrap| pixel(x, 4, wrap));
        assert_eq!(at(0.3), [1, 1, 1]);
        assert_eq!(at(1.3), [1, 2, 3]);
        assert_eq!(at(-0.3), [2, 1, 0]);
        assert_eq!(at(1e30)[2], 3);
    }

    #[test]
    fn texture_coordinates_count_from_the_lower_left() {
        let (red, green) = ([255, 0, 0, 255], [0, 255, 0, 255]);
        let texture = Texture::new(Image::new(1, 2, vec![red, green]));
        assert_eq!(texture.color([0.5, 0.9]), Some(red));
        assert_eq!(texture.color([0.5, 0.1]), Some(green));
        assert_eq!(texture.color([f32::NAN, 0.1]), None);
        assert_eq!(Texture::new(Image::new(0, 0, Vec::new())).color([0.5, 0.5]), None);
    }
}
