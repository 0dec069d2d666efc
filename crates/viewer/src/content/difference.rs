//! The perceived difference (FLIP) of the pictures of both sides, drawn on the CPU and without the window.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DMat4;
use lodsmith_core::Image;
use lodsmith_core::mesh::creases::Creases;
use lodsmith_core::model::Pose;
use lodsmith_render::image_error::{PIXELS_PER_DEGREE, flip};
use lodsmith_render::{Background, ColorMap, Environment, RenderError, Shading, Subject, View, render};
use serde::{Deserialize, Serialize};

use crate::content::{Lighter, Original};
use crate::settings::{Appearance, EnvironmentChoice, Pose as CameraPose};
use crate::view::orbit::moved_camera;

/// A description of a difference picture: both models, seen the same way. Equal descriptions give equal pictures.
#[derive(Clone, Debug)]
pub struct DifferenceView {
    /// The original.
    pub original: Arc<Original>,
    /// The result.
    pub lighter: Arc<Lighter>,
    /// The pose, the camera and the appearance of both.
    pub seen: DifferenceSettings,
}

/// Settings of a difference picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DifferenceSettings {
    /// Pose of both models.
    pub pose: Pose,
    /// Rotation of the model in the world.
    pub world_from_model: DMat4,
    /// Camera in the world.
    pub camera: CameraPose,
    /// Width and height of the picture in pixels.
    pub size: [usize; 2],
    /// Pixels of the picture per pixel of the screen.
    pub scale: f32,
    /// Appearance of both.
    pub look: Appearance,
}

impl PartialEq for DifferenceView {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.original, &other.original)
            && Arc::ptr_eq(&self.lighter, &other.lighter)
            && self.seen == other.seen
    }
}

/// A difference picture, and its description.
#[derive(Debug)]
pub struct DifferencePicture {
    /// Its description.
    pub of: DifferenceView,
    /// The picture.
    pub drawn: DrawnDifference,
}

/// A difference picture without its description.
#[derive(Debug, Serialize, Deserialize)]
pub struct DrawnDifference {
    /// The differences as colours; transparent where neither side covers a pixel.
    pub picture: Image,
    /// The difference of each pixel, from 0 to 1.
    #[serde(with = "lodsmith_core::wire::plain")]
    pub values: Vec<f32>,
    /// Mean difference over the pixels that either side covers.
    pub mean: f64,
}

/// Both models prepared for drawing, kept while they are unchanged.
#[derive(Clone, Default)]
pub(crate) struct PreparedSides {
    of: Option<(Arc<Original>, Arc<Lighter>, Pose, Creases)>,
    sides: Option<[Arc<Subject>; 2]>,
    studio: Option<Arc<Environment>>,
}

/// Prepared models that jobs share.
pub(crate) type SharedSides = Arc<Mutex<PreparedSides>>;

impl PreparedSides {
    fn sides(&mut self, view: &DifferenceView) -> Result<[Arc<Subject>; 2], RenderError> {
        let creases = view.original.creases(view.seen.look.creases);
        let is_same = self.of.as_ref().is_some_and(|(one, two, pose, edges)| {
            Arc::ptr_eq(one, &view.original)
                && Arc::ptr_eq(two, &view.lighter)
                && (pose, edges) == (&view.seen.pose, &creases)
        });
        if let Some(sides) = self.sides.as_ref().filter(|_| is_same) {
            return Ok(sides.clone());
        }
        let subject = |model| {
            Ok::<_, RenderError>(Arc::new(Subject::posed(model, &view.seen.pose)?.with_creases(creases)))
        };
        let sides = [subject(view.original.model())?, subject(&view.lighter.model)?];
        self.of = Some((view.original.clone(), view.lighter.clone(), view.seen.pose.clone(), creases));
        self.sides = Some(sides.clone());
        Ok(sides)
    }

    fn studio(&mut self, view: &DifferenceView) -> Option<Arc<Environment>> {
        let around = view.seen.look.surroundings(view.original.model().has_metal());
        (around != EnvironmentChoice::Plain)
            .then(|| self.studio.get_or_insert_with(|| Arc::new(Environment::studio())).clone())
    }
}

impl DifferencePicture {
    /// Draws both sides and compares them; returns `None` if `go_on` returns false. `go_on` receives the
    /// progress.
    ///
    /// Cost: O(faces + pixels).
    ///
    /// # Errors
    /// As [`render`].
    pub(crate) fn draw(
        of: DifferenceView,
        prepared: &SharedSides,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Self>, RenderError> {
        let lock = || prepared.lock().unwrap_or_else(PoisonError::into_inner);
        // The lock is not held here: preparing is parallel work.
        let mut kept = lock().clone();
        let (sides, studio) = (kept.sides(&of)?, kept.studio(&of));
        *lock() = kept;
        let seen = &of.seen;
        let camera = moved_camera(&seen.camera.camera(), &seen.world_from_model.inverse());
        let mut view = View::new(camera, seen.size[0], seen.size[1]);
        view.background = Background::Transparent;
        view.lighting = seen.look.lighting();
        view.environment = studio;
        view.look = seen.look.look.clone();
        if view.look.shading == Shading::Heat {
            view.look.shading = of.original.intended_shading();
        }
        let mut pictures = Vec::new();
        for (side, done) in sides.iter().zip([0.1, 0.3]) {
            if !go_on(done) {
                return Ok(None);
            }
            pictures.push(render(side, &view)?);
        }
        if !go_on(0.5) {
            return Ok(None);
        }
        let [one, two] = [&pictures[0], &pictures[1]];
        let values = flip(one, two, PIXELS_PER_DEGREE * seen.scale).expect("both have the size of the view");
        let covered: Vec<bool> =
            one.pixels().iter().zip(two.pixels()).map(|(a, b)| a[3] > 0 || b[3] > 0).collect();
        let count = covered.iter().filter(|c| **c).count().max(1);
        let sum: f64 = values.iter().zip(&covered).filter(|v| *v.1).map(|v| f64::from(*v.0)).sum();
        let picture = colored(&values, &covered, seen.look.look.color_map, seen.size);
        let drawn = DrawnDifference { picture, values, mean: sum / count as f64 };
        Ok(go_on(1.0).then_some(Self { of, drawn }))
    }

    /// Returns the difference at a place of the picture, both coordinates from 0 to 1; `None` where neither
    /// side covers it.
    pub fn at(&self, [x, y]: [f32; 2]) -> Option<f32> {
        let [width, height] = self.of.seen.size;
        let pixel = |t: f32, n: usize| ((t * n as f32).max(0.0) as usize).min(n - 1);
        let (x, y) = (pixel(x, width), pixel(y, height));
        (self.drawn.picture.at(x, y)[3] > 0).then(|| self.drawn.values[y * width + x])
    }
}

/// Returns the values as colours, transparent where nothing is covered.
fn colored(values: &[f32], covered: &[bool], map: ColorMap, [width, height]: [usize; 2]) -> Image {
    let pixel = |(value, is_covered): (&f32, &bool)| {
        let [r, g, b] = map.color(*value).map(|c| (c * 255.0).round() as u8);
        if *is_covered { [r, g, b, 255] } else { [0; 4] }
    };
    Image::new(width, height, values.iter().zip(covered).map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use lodsmith::{NoControl, Stop};
    use lodsmith_core::shapes;
    use lodsmith_io::AssetScope;
    use lodsmith_render::{Camera, StandardView};

    use super::*;
    use crate::settings::simplification::Simplification;

    fn view(faces: usize) -> DifferenceView {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sphere.ply");
        lodsmith_io::write_path(&shapes::icosphere(4), &path, &Default::default()).unwrap();
        let original = Original::read(&path, AssetScope::Folder).unwrap();
        let how = Simplification::of_preset(Default::default(), Stop::faces(faces));
        let lighter = Lighter::make(&original, &how, &mut NoControl).unwrap();
        let camera = Camera::fitting(&original.bounds, StandardView::Iso, 1.0);
        DifferenceView {
            original: Arc::new(original),
            lighter: Arc::new(lighter),
            seen: DifferenceSettings {
                pose: Pose::default(),
                world_from_model: DMat4::IDENTITY,
                camera: CameraPose::of(&camera),
                size: [96, 80],
                scale: 1.0,
                look: Appearance::default(),
            },
        }
    }

    fn drawn(view: &DifferenceView) -> DifferencePicture {
        DifferencePicture::draw(view.clone(), &SharedSides::default(), &mut |_| true).unwrap().unwrap()
    }

    #[test]
    fn fewer_faces_differ_more_and_equal_ones_do_not() {
        let same = drawn(&view(5120)).drawn;
        assert!(same.mean < 1e-6 && same.values.iter().all(|v| *v < 1e-3), "{}", same.mean);
        let [some, picture] = [400, 60].map(|n| drawn(&view(n)));
        let (some, few) = (some.drawn, &picture.drawn);
        assert!(
            some.mean > 0.01 && few.mean > 1.5 * some.mean && few.mean < 0.8,
            "{} {}",
            some.mean,
            few.mean
        );
        assert_eq!(few.picture.at(0, 0), [0; 4]);
        assert_eq!(picture.at([0.0, 0.0]), None);
        assert!(picture.at([0.5, 0.5]).is_some_and(|v| (0.0..=1.0).contains(&v)));
    }

    #[test]
    fn it_can_be_cancelled_at_each_step() {
        let view = view(100);
        for stop in [0.1, 0.3, 0.5, 1.0] {
            let drawn = DifferencePicture::draw(view.clone(), &SharedSides::default(), &mut |x| x < stop);
            assert!(drawn.unwrap().is_none(), "{stop}");
        }
    }

    /// A turned model from a turned camera is the same picture.
    #[test]
    fn the_model_may_be_turned() {
        let plain = view(200);
        let turn = DMat4::from_rotation_y(0.7);
        let mut turned = plain.clone();
        turned.seen.world_from_model = turn;
        let only_model = drawn(&turned).drawn.mean;
        turned.seen.camera = CameraPose::of(&moved_camera(&plain.seen.camera.camera(), &turn));
        let mean = drawn(&plain).drawn.mean;
        assert!((mean - drawn(&turned).drawn.mean).abs() < 1e-4);
        assert!((mean - only_model).abs() > 1e-5);
    }
}
