//! Looks of the user's: a picture of a lit ball, a shader. Read when they are named, and again when they change.

use std::path::{Path, PathBuf};

use lodsmith_core::Image;

use crate::gpu::{Gpu, Matcap, SurfaceShader};
use crate::settings::Appearance;

/// What was read, and what was wrong with it.
#[derive(Default)]
pub struct OwnFiles {
    matcap: Option<(PathBuf, Result<Matcap, String>)>,
    shader: Option<(PathBuf, Result<SurfaceShader, String>)>,
}

/// Largest picture of a ball, in pixels along a side: more show nothing more.
const LARGEST: u32 = 4096;
/// Longest shader, in bytes. Guessed.
const LONGEST: u64 = 1 << 20;

impl OwnFiles {
    /// Reads what the look names and is not known yet; and all again if they have changed.
    pub fn follow(&mut self, gpu: Option<&Gpu>, look: &Appearance, have_changed: bool) {
        let Some(gpu) = gpu else { return };
        let is_known =
            |of: Option<&Path>, path: Option<&PathBuf>| !have_changed && of == path.map(PathBuf::as_path);
        if !is_known(self.matcap.as_ref().map(|m| m.0.as_path()), look.matcap.as_ref()) {
            let read = |path: &PathBuf| (path.clone(), image_of(path).map(|image| gpu.matcap(&image)));
            self.matcap = look.matcap.as_ref().map(read);
        }
        if !is_known(self.shader.as_ref().map(|s| s.0.as_path()), look.shader.as_ref()) {
            let make = |text: String| gpu.shader(&text).map_err(|e| e.to_string());
            let read = |path: &PathBuf| (path.clone(), text_of(path).and_then(make));
            self.shader = look.shader.as_ref().map(read);
        }
    }

    /// The picture of a ball.
    pub fn matcap(&self) -> Option<&Matcap> {
        self.matcap.as_ref().and_then(|m| m.1.as_ref().ok())
    }
    /// The shader.
    pub fn shader(&self) -> Option<&SurfaceShader> {
        self.shader.as_ref().and_then(|s| s.1.as_ref().ok())
    }
    /// What is wrong with them.
    pub fn error(&self) -> Option<String> {
        let of = |path: &Path, why: &String| format!("{}: {why}", path.display());
        let matcap = self.matcap.as_ref().and_then(|m| m.1.as_ref().err().map(|e| of(&m.0, e)));
        let shader = self.shader.as_ref().and_then(|s| s.1.as_ref().err().map(|e| of(&s.0, e)));
        matcap.into_iter().chain(shader).reduce(|a, b| format!("{a}\n{b}"))
    }
}

fn image_of(path: &Path) -> Result<Image, String> {
    let mut reader =
        image::ImageReader::open(path).and_then(|r| r.with_guessed_format()).map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LARGEST), Some(LARGEST));
    reader.limits(limits);
    let pixels = reader.decode().map_err(|e| e.to_string())?.into_rgba8();
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    Ok(Image::new(width, height, pixels.into_raw().as_chunks().0.to_vec()))
}

fn text_of(path: &Path) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    if size > LONGEST {
        return Err(format!("{size} bytes are too many for a shader"));
    }
    std::fs::read_to_string(path).map_err(|e| e.to_string())
}
