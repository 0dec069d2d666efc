//! What is drawn, and how, as plain data.

use std::ffi::OsString;
use std::path::PathBuf;

use lodsmith::MethodKind;
use lodsmith_render::{Background, Camera, Ground, Light, Look, Shading, View};

use super::camera::Viewpoint;
use crate::destination::Up;
use crate::error::{AssetError, usage};
use crate::paths::Source;

/// How files are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureRecipe {
    /// A file that is drawn first, and that the others are compared with.
    pub compare: Option<Source>,
    /// Numbers of faces: each file has its simplifications to them beside it.
    pub levels: Vec<usize>,
    /// The method that makes them.
    pub method: MethodKind,
    /// Colouring of surfaces; `None` for what each file intends.
    pub shading: Option<Shading>,
    /// The other appearance of surfaces.
    pub look: Look,
    /// Lights in place of the usual ones.
    pub lights: Vec<Light>,
    /// Picture of a lit ball for [`Shading::Matcap`]; clay without one.
    pub matcap: Option<PathBuf>,
    /// What lights the model from all sides, and is reflected.
    pub environment: Surroundings,
    /// What is behind the model.
    pub background: Background,
    /// What is below the model.
    pub ground: Ground,
    /// Creases are darkened.
    pub occlusion: bool,
    /// Direction and lens of the camera.
    pub viewpoint: Viewpoint,
    /// The axis that points up in the files.
    pub up: Up,
    /// An animation, by its name or by its number from 1; the first if there is only a time.
    pub clip: Option<String>,
    /// Time in the animation, in seconds.
    pub time: Option<f64>,
    /// Number of pictures of a turn around the model.
    pub turntable: Option<usize>,
    /// Pictures per second, if they are frames of one file.
    pub fps: u16,
    /// Width and height of the picture, or of each if there are several.
    pub size: Option<[usize; 2]>,
    /// Number of pictures in a row.
    pub columns: Option<usize>,
    /// Pictures side by side have captions.
    pub captions: bool,
    /// Sixteen samples per pixel instead of four.
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

/// What lights the model from all sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// The studio for models with metal, or if it is the background.
    Auto,
    /// Nothing.
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
    /// Checks that its parts go together.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn check(&self) -> Result<(), AssetError> {
        let is_compared = self.compare.is_some();
        if is_compared && !self.levels.is_empty() {
            return Err(usage("--levels are compared with their own file: leave out --compare"));
        }
        if self.is_heat() && !is_compared && self.levels.is_empty() {
            return Err(usage("--shading heat shows a distance: say from what, with --compare or --levels"));
        }
        if self.is_measured() && (self.clip.is_some() || self.time.is_some()) {
            return Err(usage(
                "--time and --clip show a scene as it moves; --levels and --shading heat show one mesh at rest: leave \
                 out one of them",
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
    pub fn size(&self, count: usize) -> [usize; 2] {
        self.size.unwrap_or(if count > 1 { [480, 480] } else { [1200, 800] })
    }

    /// Returns what a camera sees, without the images of the recipe.
    pub fn view(
        &self,
        camera: Camera,
        [width, height]: [usize; 2],
        shading: Shading,
        heat_range: Option<[f32; 2]>,
    ) -> View {
        let mut view = View::new(camera, width, height);
        view.look = Look { shading, heat_range, ..self.look.clone() };
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
