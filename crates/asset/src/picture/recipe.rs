//! Options of pictures as plain data.

use std::ffi::OsString;
use std::path::PathBuf;

use lodsmith::MethodKind;
use lodsmith_render::{Background, Camera, Ground, Light, Look, Shading, View};

use super::camera::Viewpoint;
use crate::destination::Up;
use crate::error::{AssetError, usage};
use crate::paths::Source;

/// Options of pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureRecipe {
    /// The reference of a comparison, which is rendered first.
    pub compare: Option<Source>,
    /// Numbers of faces of simplified levels, which are rendered beside each file.
    pub levels: Vec<usize>,
    /// The method that makes the levels.
    pub method: MethodKind,
    /// Shading of surfaces; `None` for that which each file intends.
    pub shading: Option<Shading>,
    /// Other options of the appearance of surfaces.
    pub look: Look,
    /// Lights instead of the default lights.
    pub lights: Vec<Light>,
    /// Image of a lit sphere for [`Shading::Matcap`]; clay if `None`.
    pub matcap: Option<PathBuf>,
    /// The environment that lights the model and is reflected.
    pub environment: Surroundings,
    /// The background.
    pub background: Background,
    /// Shadow and grid on the ground.
    pub ground: Ground,
    /// Darken creases (ambient occlusion).
    pub occlusion: bool,
    /// Direction and lens of the camera.
    pub viewpoint: Viewpoint,
    /// The axis that points up in the files.
    pub up: Up,
    /// An animation, by name or by number from 1; the first one if only a time is given.
    pub clip: Option<String>,
    /// Time in the animation, in seconds.
    pub time: Option<f64>,
    /// Number of frames of a turntable.
    pub turntable: Option<usize>,
    /// Frames per second of an animated file.
    pub fps: u16,
    /// Width and height of the picture, or of each picture if there are several.
    pub size: Option<[usize; 2]>,
    /// Number of pictures in a row.
    pub columns: Option<usize>,
    /// Write captions below pictures side by side.
    pub captions: bool,
    /// Use 16 samples per pixel instead of 4.
    pub fine: bool,
}

impl Default for PictureRecipe {
    fn default() -> Self {
        Self {
            compare: None,
            levels: Vec::new(),
            method: MethodKind::default(),
            shading: None,
            look: Look::default(),
            lights: Vec::new(),
            matcap: None,
            environment: Surroundings::Auto,
            background: Background::default(),
            ground: Ground::default(),
            occlusion: false,
            viewpoint: Viewpoint::default(),
            up: Up::Y,
            clip: None,
            time: None,
            turntable: None,
            fps: 20,
            size: None,
            columns: None,
            captions: true,
            fine: false,
        }
    }
}

/// An environment, which lights a model from all sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// The studio for models with metal or if the environment is the background, else none.
    Auto,
    /// No environment.
    None,
    /// A dark room with soft lamps.
    Studio,
    /// A panorama.
    File(PathBuf),
}

impl From<OsString> for Surroundings {
    fn from(word: OsString) -> Self {
        match word.to_str() {
            Some("auto") => Self::Auto,
            Some("none") => Self::None,
            Some("studio") => Self::Studio,
            _ => Self::File(word.into()),
        }
    }
}

impl PictureRecipe {
    /// Checks that the options do not exclude each other.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn check(&self) -> Result<(), AssetError> {
        let is_compared = self.compare.is_some();
        if is_compared && !self.levels.is_empty() {
            return Err(usage("--levels compares with the original of each level: leave out --compare"));
        }
        if self.is_heat() && !is_compared && self.levels.is_empty() {
            return Err(usage("--shading heat shows distances from a reference: add --compare or --levels"));
        }
        if self.is_measured() && (self.clip.is_some() || self.time.is_some()) {
            return Err(usage(
                "--time and --clip pose a scene; --levels and --shading heat need the rest pose: the two cannot be \
                 combined",
            ));
        }
        self.viewpoint.check()
    }

    /// True if distances are shown as colours.
    pub(super) fn is_heat(&self) -> bool {
        self.shading == Some(Shading::Heat)
    }

    /// True if distances are needed.
    pub(super) fn is_measured(&self) -> bool {
        self.is_heat() || !self.levels.is_empty()
    }

    /// Returns the size of each of `count` pictures, in pixels.
    pub(super) fn size(&self, count: usize) -> [usize; 2] {
        self.size.unwrap_or(if count > 1 { [480, 480] } else { [1200, 800] })
    }

    /// Returns the view of a camera, without the images of the recipe.
    pub(super) fn view(&self, camera: Camera, [width, height]: [usize; 2], shading: Shading) -> View {
        let mut view = View::new(camera, width, height);
        view.look = Look { shading, ..self.look.clone() };
        view.background = self.background;
        view.ground = self.ground;
        view.occlusion = self.occlusion;
        view.fine = self.fine;
        if !self.lights.is_empty() {
            view.lighting.lights.clone_from(&self.lights);
        }
        view
    }
}
