//! Images that another format refers to or embeds, added to a scene as PNG or JPEG.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use super::builder::SceneBuilder;
use crate::assets::{Assets, MAX_IMAGE_BYTES, Refusal};
use crate::error::Warning;
use crate::excerpt::excerpt;
use crate::limits::Limits;
use crate::material::image_type;
use crate::model::decode_image;

/// Adds images to a scene, within the limits of the file.
pub(crate) struct BroughtImages {
    assets: Assets,
    limits: Limits,
    /// Number of bytes left for image files.
    left: u64,
}

impl BroughtImages {
    pub(crate) fn new(assets: Assets, limits: Limits) -> Self {
        Self { assets, limits, left: MAX_IMAGE_BYTES.min(limits.max_bytes()) }
    }

    /// Adds the image file that a path names, or a file of that name beside the model; returns its index. A file that
    /// cannot be used is a warning.
    pub(crate) fn file(&mut self, path: &str, scene: &mut SceneBuilder) -> Option<usize> {
        let name = path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned();
        let found = self
            .assets
            .find(Path::new(path))
            .or_else(|refusal| self.assets.find(Path::new(&name)).map_err(|_| refusal));
        match found
            .map_err(|r| Refusal::reason(r).to_owned())
            .and_then(|asset| asset.read_image(&mut self.left))
        {
            Ok(bytes) => self.bytes(&name, &bytes, scene),
            Err(why) => {
                scene.warn(Warning::lost(format!("the texture {} {why}: dropped", excerpt(path))));
                None
            }
        }
    }

    /// Adds an image from its bytes; returns its index. Types that glTF does not allow become PNG.
    pub(crate) fn bytes(&mut self, name: &str, bytes: &[u8], scene: &mut SceneBuilder) -> Option<usize> {
        if let Some(kind @ ("image/png" | "image/jpeg")) = image_type(bytes) {
            return Some(scene.image(name, kind, bytes));
        }
        let shown = excerpt(name);
        let png = decode_image(Ok((Cow::Borrowed(bytes), name.to_owned())), self.limits).and_then(|image| {
            let mut png = Cursor::new(Vec::new());
            let size = (image.width() as u32, image.height() as u32);
            let pixels = image.pixels().as_flattened().to_vec();
            let rgba = image::RgbaImage::from_raw(size.0, size.1, pixels).ok_or("is damaged")?;
            let written = rgba.write_to(&mut png, image::ImageFormat::Png);
            written.map_err(|e| format!("cannot be converted: {e}"))?;
            Ok(png.into_inner())
        });
        match png {
            Ok(png) => {
                scene.warn(Warning::note(format!("the texture {shown} is converted to PNG")));
                let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
                Some(scene.image(&format!("{stem}.png"), "image/png", &png))
            }
            Err(why) => {
                scene.warn(Warning::lost(format!("the texture {shown} {why}: dropped")));
                None
            }
        }
    }
}
