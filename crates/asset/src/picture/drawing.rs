//! Rendering of items with their cameras, from any side.

use std::sync::Arc;

use lodsmith_core::numbers::{counted, significant};
use lodsmith_core::{Bounds, Image};
use lodsmith_render::{
    Background, Camera, ColorMap, Environment, Legend, Panel, Shading, Subject, View, render, sheet,
};
use serde_json::{Value, json};
use web_time::Instant;

use super::camera::{MARGIN, NO_BOUNDS, aspect};
use super::distances::largest;
use super::item::Item;
use super::recipe::{PictureRecipe, Surroundings};
use crate::error::AssetError;
use crate::report_json::micros;

/// Number of poses of an animation that the camera is fitted to.
const CAMERA_POSES: usize = 17;

/// The images of a recipe.
pub(super) struct Images {
    pub matcap: Option<Arc<Image>>,
    pub environment: Option<Arc<Environment>>,
}

/// Items that are rendered together.
pub(super) struct Drawing<'a> {
    recipe: &'a PictureRecipe,
    images: Images,
    shown: Vec<Shown<'a>>,
    /// The size of each picture.
    size: [usize; 2],
    /// Values at the ends of the colour scale of a heat map.
    pub heat_range: Option<[f32; 2]>,
}

/// An item and its camera.
struct Shown<'a> {
    item: &'a Item,
    subject: Subject,
    shading: Shading,
    camera: Camera,
}

/// A file or a simplified level in a picture.
#[derive(Clone, Debug)]
pub struct PictureRow {
    /// The file.
    pub path: String,
    /// Number of faces.
    pub faces: usize,
    /// Bounding box of the faces as rendered.
    pub bounds: Option<Bounds>,
    /// The requested number of faces of a simplified level.
    pub level: Option<usize>,
    /// Largest distance from the reference.
    pub largest_distance: Option<f64>,
    /// Shading of the surface.
    pub shading: Shading,
    /// The animation and its time in seconds.
    pub moment: Option<(String, f64)>,
    /// Rendering time in seconds.
    pub seconds: f64,
}

impl PictureRow {
    pub(super) fn to_json(&self) -> Value {
        json!({
            "path": self.path,
            "faces": self.faces,
            "bounds": self.bounds.map(|b| json!({ "min": b.min, "max": b.max })),
            "level": self.level,
            "shading": self.shading.name(),
            "clip": self.moment.as_ref().map(|m| &m.0),
            "time": self.moment.as_ref().map(|m| m.1),
            "largest_distance": self.largest_distance,
            "seconds": micros(self.seconds),
        })
    }
}

impl<'a> Drawing<'a> {
    /// Prepares items. A candidate has the camera and the creases of its reference.
    pub(super) fn new(
        recipe: &'a PictureRecipe,
        items: &'a [Item],
        mut images: Images,
    ) -> Result<Self, AssetError> {
        if recipe.environment == Surroundings::Auto && wants_studio(recipe, items) {
            images.environment = Some(Arc::new(Environment::studio()));
        }
        let size = recipe.size(items.len());
        let mut shown: Vec<Shown<'a>> = Vec::with_capacity(items.len());
        for item in items {
            let shading = shading(recipe, item);
            let subject = subject(item, shading)?;
            shown.push(match item.reference {
                Some(of) => {
                    let (subject, camera) =
                        (subject.with_creases(shown[of].subject.creases()), shown[of].camera);
                    Shown { item, subject, shading, camera }
                }
                None => {
                    let camera = camera(recipe, &subject, item, aspect(size));
                    Shown { item, subject, shading, camera }
                }
            });
        }
        let heat_range = recipe.is_heat().then(|| heat_range(recipe, items));
        Ok(Self { recipe, images, shown, size, heat_range })
    }

    /// Returns the rows of the report, before rendering.
    pub(super) fn rows(&self) -> Vec<PictureRow> {
        let row = |shown: &Shown<'_>| PictureRow {
            path: shown.item.path.clone(),
            faces: shown.item.model.face_count(),
            bounds: shown.subject.exact_bounds(),
            level: shown.item.level,
            largest_distance: shown.item.distances.as_ref().map(|d| largest(d)),
            shading: shown.shading,
            moment: shown.item.moment.as_ref().map(|m| (m.name.clone(), m.seconds)),
            seconds: 0.0,
        };
        self.shown.iter().map(row).collect()
    }

    /// Renders all items with cameras rotated around them by an angle. Adds the time of each item to its row.
    pub(super) fn draw(&self, turn_rad: f64, rows: &mut [PictureRow]) -> Result<Image, AssetError> {
        let mut panels = Vec::new();
        for (i, (shown, row)) in self.shown.iter().zip(rows).enumerate() {
            let axis = self.shown[shown.item.reference.unwrap_or(i)].subject.centre();
            let turned = || shown.camera.turned_around(axis, turn_rad);
            let camera = if turn_rad == 0.0 { shown.camera } else { turned() };
            let start = Instant::now();
            let picture = render(&shown.subject, &self.view(camera, shown.shading));
            row.seconds += start.elapsed().as_secs_f64();
            let picture = picture.map_err(|why| AssetError::from(why).of(&row.path))?;
            let caption = if self.recipe.captions { caption(shown.item, row) } else { Vec::new() };
            panels.push(Panel { picture, caption });
        }
        if !self.is_sheet() {
            return Ok(panels.remove(0).picture);
        }
        let columns = self.recipe.columns.unwrap_or_else(|| columns(panels.len()));
        let legend = self.heat_range.map(|range| heat_legend(self.recipe.look.color_map, range));
        Ok(sheet(&panels, columns, self.recipe.background, legend.as_ref()))
    }

    /// Renders the only item without a legend; the colours of its values are in the requested range, or in theirs.
    pub(super) fn draw_alone(mut self) -> Result<Image, AssetError> {
        self.heat_range = None;
        Ok(render(&self.shown[0].subject, &self.view(self.shown[0].camera, self.shown[0].shading))?)
    }

    /// True if the result is a contact sheet, with captions or a legend on a common background.
    fn is_sheet(&self) -> bool {
        self.shown.len() > 1 || self.heat_range.is_some()
    }

    fn view(&self, camera: Camera, shading: Shading) -> View {
        let mut view = self.recipe.view(camera, self.size, shading);
        view.look.heat_range = self.heat_range.or(view.look.heat_range);
        view.matcap = self.images.matcap.clone();
        view.environment = self.images.environment.clone();
        if self.is_sheet() {
            view.background = Background::Transparent;
        }
        view
    }
}

/// Returns true if the automatic environment is the studio: metal without an environment has little to reflect.
fn wants_studio(recipe: &PictureRecipe, items: &[Item]) -> bool {
    let is_background = matches!(recipe.background, Background::Environment { .. });
    is_background || items.iter().any(|item| item.model.has_metal())
}

/// Returns the requested shading, or that which the file intends.
fn shading(recipe: &PictureRecipe, item: &Item) -> Shading {
    // A heat map needs distances: a reference with several candidates has none.
    let has_values = |shading: &Shading| *shading != Shading::Heat || item.distances.is_some();
    recipe.shading.filter(has_values).unwrap_or_else(|| Shading::intended_by(&item.model))
}

fn subject(item: &Item, shading: Shading) -> Result<Subject, AssetError> {
    let subject = match &item.moment {
        Some(moment) => Subject::posed(&item.model, &item.model.pose(moment.clip, moment.seconds))?,
        None => Subject::new(&item.model)?,
    };
    Ok(match &item.distances {
        Some(distances) if shading == Shading::Heat => subject.with_values(distances.clone())?,
        _ => subject,
    })
}

/// Returns the requested camera, at a distance that shows everything; it is the same for all times of a clip.
fn camera(recipe: &PictureRecipe, subject: &Subject, item: &Item, aspect: f64) -> Camera {
    let moving = item.moment.as_ref().filter(|_| recipe.turntable.is_none());
    let clip = moving.map(|m| item.model.bounds_over(m.clip, CAMERA_POSES));
    let bounds = clip.unwrap_or_else(|| subject.bounds()).unwrap_or(NO_BOUNDS);
    let camera = recipe.viewpoint.camera(&bounds, aspect);
    // Leaves space for the shadow beside the model.
    let has_floor = recipe.ground.shadow || recipe.ground.grid;
    let margin = if has_floor { 2.0 * MARGIN } else { MARGIN };
    if recipe.turntable.is_some() {
        subject.framed_all_round(camera, aspect, margin)
    } else if clip.is_some() {
        camera
    } else {
        subject.framed(camera, aspect, margin)
    }
}

/// Returns the values at the ends of the colour scale: the requested ones, or 0 and the largest distance of all.
fn heat_range(recipe: &PictureRecipe, items: &[Item]) -> [f32; 2] {
    let all = items.iter().filter_map(|item| item.distances.as_ref().map(|d| largest(d)));
    recipe.look.heat_range.unwrap_or_else(|| [0.0, all.fold(0f64, f64::max) as f32])
}

/// Returns the legend of a heat map of distances.
pub fn heat_legend(map: ColorMap, range: [f32; 2]) -> Legend {
    Legend { map, range, title: "distance in the units of the file".to_owned() }
}

/// Returns two lines: the number of faces; then the file, or the distance from the original.
fn caption(item: &Item, row: &PictureRow) -> Vec<String> {
    let name = row.path.rsplit(['/', '\\']).next().unwrap_or_default();
    let below = match (row.level, row.largest_distance, &row.moment) {
        (Some(_), Some(largest), _) if item.diagonal > 0.0 => {
            // Smaller distances are rounding errors of single precision.
            let part = Some(largest / item.diagonal).filter(|part| *part >= 1e-7).unwrap_or(0.0);
            format!("max {} %", significant(100.0 * part, 2))
        }
        (.., Some((_, seconds))) => format!("{name} at {seconds} s"),
        _ => name.to_owned(),
    };
    vec![counted(row.faces, "face", "faces"), below]
}

/// Returns the number of pictures in a row: at most four, and three if that leaves fewer gaps in the last row.
fn columns(count: usize) -> usize {
    let free = |columns: usize| count.div_ceil(columns) * columns - count;
    if count <= 4 {
        count
    } else if free(3) < free(4) {
        3
    } else {
        4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_row_is_as_full_as_possible() {
        assert_eq!([1, 2, 3, 4, 6, 7, 8].map(columns), [1, 2, 3, 4, 3, 4, 4]);
    }
}
