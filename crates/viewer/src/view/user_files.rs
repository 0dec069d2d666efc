//! The user's own appearance files: matcap, shader, environment. Read when they are chosen, reread when they
//! change.

use std::io::Read;
use std::path::{Path, PathBuf};

use lodsmith_core::Image;
use lodsmith_render::Environment;

use crate::gpu::{EnvironmentMap, Gpu, Matcap, SurfaceShader};
use crate::settings::{Appearance, EnvironmentChoice};

/// Files that were read, or errors.
#[derive(Default)]
pub(crate) struct UserFiles {
    matcap: Option<(PathBuf, Result<Matcap, String>)>,
    shader: Option<(PathBuf, Result<SurfaceShader, String>)>,
    around: Option<(EnvironmentChoice, Result<EnvironmentMap, String>)>,
}

/// Largest matcap, in pixels along a side: more pixels show no more detail.
const MAX_MATCAP_SIDE_PX: u32 = 4096;
/// Largest shader file, in bytes. Guessed.
const MAX_SHADER_BYTES: u64 = 1 << 20;

impl UserFiles {
    /// Reads files that the appearance newly refers to, or all of them if they have changed.
    pub(crate) fn follow(
        &mut self,
        gpu: Option<&Gpu>,
        look: &Appearance,
        has_metal: bool,
        have_changed: bool,
    ) {
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
        let around = look.surroundings(has_metal);
        let is_known = self.around.as_ref().is_some_and(|(of, _)| *of == around)
            && (!have_changed || around.file().is_none());
        if around == EnvironmentChoice::Plain {
            self.around = None;
        } else if !is_known {
            let made = match around.file() {
                None => Ok(Environment::studio()),
                Some(path) => environment_of(path),
            };
            self.around = Some((around, made.map(|made| gpu.environment(&made))));
        }
    }

    /// Returns the environment.
    pub(crate) fn environment(&self) -> Option<&EnvironmentMap> {
        self.around.as_ref().and_then(|a| a.1.as_ref().ok())
    }
    /// Returns the matcap.
    pub(crate) fn matcap(&self) -> Option<&Matcap> {
        self.matcap.as_ref().and_then(|m| m.1.as_ref().ok())
    }
    /// Returns the shader.
    pub(crate) fn shader(&self) -> Option<&SurfaceShader> {
        self.shader.as_ref().and_then(|s| s.1.as_ref().ok())
    }
    /// Returns the errors, one per line.
    pub(crate) fn error(&self) -> Option<String> {
        let of_file = |path: &Path, why: &String| format!("{}: {why}", path.display());
        let matcap = self.matcap.as_ref().and_then(|m| m.1.as_ref().err().map(|e| of_file(&m.0, e)));
        let shader = self.shader.as_ref().and_then(|s| s.1.as_ref().err().map(|e| of_file(&s.0, e)));
        let around =
            self.around.as_ref().and_then(|(of, made)| Some(of_file(of.file()?, made.as_ref().err()?)));
        matcap.into_iter().chain(shader).chain(around).reduce(|a, b| format!("{a}\n{b}"))
    }
}

fn image_of(path: &Path) -> Result<Image, String> {
    let bytes = bytes_of(path).map_err(|e| e.to_string())?;
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_MATCAP_SIDE_PX), Some(MAX_MATCAP_SIDE_PX));
    reader.limits(limits);
    let pixels = reader.decode().map_err(|e| e.to_string())?.into_rgba8();
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    Ok(Image::new(width, height, pixels.into_raw().as_chunks().0.to_vec()))
}

fn environment_of(path: &Path) -> Result<Environment, String> {
    let bytes = bytes_of(path).map_err(|e| e.to_string())?;
    Environment::decode(&bytes).map_err(|e| e.to_string())
}

fn bytes_of(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    lodsmith_io::drive::open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn text_of(path: &Path) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    if size > MAX_SHADER_BYTES {
        return Err(format!("the file has {size} bytes, too large for a shader"));
    }
    std::fs::read_to_string(path).map_err(|e| e.to_string())
}
