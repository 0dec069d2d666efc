//! Description of a picture to be drawn.

use std::sync::Arc;

use lodsmith_core::{Bounds, Image};

use crate::camera::{Camera, StandardView};
use crate::environment::Environment;
use crate::light::Lighting;
use crate::look::{Background, Look};

/// Maximum number of pixels along a side.
pub const MAX_SIDE_PX: usize = 16384;

/// View of a picture: camera, size, look and lighting.
#[derive(Clone, Debug)]
pub struct View {
    /// Number of pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Camera.
    pub camera: Camera,
    /// Appearance of surfaces.
    pub look: Look,
    /// Lights.
    pub lighting: Lighting,
    /// Background.
    pub background: Background,
    /// The sphere image of [`Shading::Matcap`](crate::Shading::Matcap); `None` for clay.
    pub matcap: Option<Arc<Image>>,
    /// Environment that materials reflect and are lit by, in addition to the lights; `None` for plain ambient
    /// light from above and below.
    pub environment: Option<Arc<Environment>>,
    /// A floor below the model.
    pub ground: Ground,
    /// True if creases are darkened (ambient occlusion).
    pub occlusion: bool,
    /// Sixteen samples per pixel instead of four: four times the work, for final pictures.
    pub fine: bool,
}

/// A floor below the model, visible from above only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ground {
    /// Grid lines.
    pub grid: bool,
    /// A contact shadow of the model.
    pub shadow: bool,
}

impl View {
    /// A standard view of a whole box, with the default look and lighting.
    pub fn of(bounds: &Bounds, view: StandardView, width: usize, height: usize) -> Self {
        let aspect = width.max(1) as f64 / height.max(1) as f64;
        Self::new(Camera::fitting(bounds, view, aspect), width, height)
    }

    /// A view through a camera, with the default look and lighting.
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

/// Errors of drawing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The picture has no pixels, or too many.
    #[error("a picture of {width} x {height} pixels cannot be drawn: each side must have 1 to {MAX_SIDE_PX}")]
    Size {
        /// Number of pixels in a row.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// The camera sees nothing.
    #[error("the camera sees nothing: {what}")]
    Camera {
        /// Reason.
        what: &'static str,
    },
    /// More faces than ids can number.
    #[error("{faces} faces are too many for one picture")]
    TooManyFaces {
        /// Number of faces.
        faces: usize,
    },
    /// The number of values for a heat map is not the number of vertices.
    #[error("mesh {mesh} has {vertices} vertices, but {values} values")]
    Values {
        /// Index of the mesh.
        mesh: usize,
        /// Number of its vertices.
        vertices: usize,
        /// Number of values given.
        values: usize,
    },
}
