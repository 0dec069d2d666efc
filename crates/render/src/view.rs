//! What a picture is asked to be.

use std::sync::Arc;

use lodsmith_core::{Bounds, Image};

use crate::camera::{Camera, StandardView};
use crate::environment::Environment;
use crate::light::Lighting;
use crate::look::{Background, Look};

/// Most pixels along a side.
pub const SIDE_MAX: usize = 16384;

/// How something is drawn: from where, how large, in which light.
#[derive(Clone, Debug)]
pub struct View {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// From where.
    pub camera: Camera,
    /// How surfaces are shown.
    pub look: Look,
    /// In which light.
    pub lighting: Lighting,
    /// Before what.
    pub background: Background,
    /// The lit ball of [`Shading::Matcap`](crate::Shading::Matcap); `None` takes one of clay.
    pub matcap: Option<Arc<Image>>,
    /// What materials mirror, and are lit by beside the lights; `None` is the plain light from above and below.
    pub environment: Option<Arc<Environment>>,
    /// A floor below the model.
    pub ground: Ground,
    /// Whether creases are darker, as if less light came into them.
    pub occlusion: bool,
    /// Sixteen samples a pixel instead of four: four times the work, for pictures that stay.
    pub fine: bool,
}

/// A floor below the model, seen from above only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ground {
    /// Lines on it.
    pub grid: bool,
    /// The model darkens it where it stands.
    pub shadow: bool,
}

impl View {
    /// The whole of a box from a standard view, with the usual look and light.
    pub fn of(bounds: &Bounds, view: StandardView, width: usize, height: usize) -> Self {
        let aspect = width.max(1) as f64 / height.max(1) as f64;
        Self::new(Camera::fitting(bounds, view, aspect), width, height)
    }

    /// Through a camera, with the usual look and light.
    pub fn new(camera: Camera, width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            camera,
            look: Look::default(),
            lighting: Lighting::default(),
            background: Background::default(),
            matcap: None,
            environment: None,
            ground: Ground::default(),
            occlusion: false,
            fine: false,
        }
    }
}

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// No pixel, or more than there may be.
    #[error("a picture of {width} x {height} pixels: 1 to {SIDE_MAX} a side can be drawn")]
    Size {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A camera that sees nothing.
    #[error("the camera sees nothing: {what}")]
    Camera {
        /// Why.
        what: &'static str,
    },
    /// More faces than numbers can name.
    #[error("{faces} faces are more than one picture can hold")]
    TooManyFaces {
        /// How many there are.
        faces: usize,
    },
    /// Values for a heat map that are not one for each vertex.
    #[error("mesh {mesh} has {vertices} vertices, but {values} values to show")]
    Values {
        /// The mesh, by number.
        mesh: usize,
        /// Its vertices.
        vertices: usize,
        /// The values given.
        values: usize,
    },
}
