//! Pictures of files: one, several side by side, or a turntable.

mod camera;
mod distances;
mod drawing;
mod item;
mod output;
mod recipe;
pub mod words;

use std::path::Path;
use std::sync::Arc;

use lodsmith_core::{Image, Model, TriMesh};
use lodsmith_io::{ReadOptions, Warning};
use lodsmith_render::{Background, Environment, PictureError, decode};
use serde_json::{Value, json};

use crate::error::AssetError;
use crate::job::{Job, StageClock, Step};
use crate::memory_need::{self, Size};
use crate::paths::{self, Source};
use crate::report_json::micros;
use drawing::{Drawing, Images};
use item::Item;

pub use camera::{Viewpoint, camera};
pub use drawing::{PictureRow, heat_legend};
pub use output::{PictureOutput, picture_format, write_picture};
pub use recipe::{PictureRecipe, Surroundings};

/// Result of rendering pictures.
#[derive(Debug)]
pub struct PictureOutcome {
    /// The picture, if there is no output; the first one of a turntable.
    pub picture: Option<Image>,
    /// Width and height of the picture, or of each picture if there are several.
    pub size: [usize; 2],
    /// The rendered items, in the order of the contact sheet.
    pub rows: Vec<PictureRow>,
    /// Values at the ends of the colour scale of a heat map.
    pub heat_range: Option<[f32; 2]>,
    /// Warnings from reading, with the path of each file.
    pub warnings: Vec<(String, Vec<Warning>)>,
    /// Number of threads of the pool.
    pub threads: usize,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads files, renders all of them in one picture, and writes it.
///
/// # Errors
/// [`AssetError::Usage`] for a recipe that contradicts itself or the files, [`AssetError::Read`],
/// [`AssetError::Memory`]; [`AssetError::Simplify`] for levels. An error of a file has its name.
pub fn render(
    inputs: &[Source],
    reading: &ReadOptions,
    recipe: &PictureRecipe,
    to: Option<&PictureOutput>,
    job: &mut Job<'_>,
) -> Result<PictureOutcome, AssetError> {
    paths::at_most_one_stream(inputs.iter().chain(&recipe.compare))?;
    recipe.check()?;
    job.enter(Step::Read);
    let images = images(recipe)?;
    let mut items = item::read_all(inputs, reading, recipe, job)?;
    check_memory(recipe, &items, job)?;
    if recipe.is_measured() {
        distances::measure(&mut items)?;
    }
    job.enter(Step::Draw);
    let drawing = Drawing::new(recipe, &items, images)?;
    let (mut rows, mut size) = (drawing.rows(), [0; 2]);
    let mut draw = |turn_rad: f64| {
        let picture = drawing.draw(turn_rad, &mut rows)?;
        size = [picture.width(), picture.height()];
        Ok(picture)
    };
    let picture = match to {
        None => Some(draw(0.0)?),
        Some(to) => to.write(recipe.background == Background::Transparent, &mut draw, job).map(|()| None)?,
    };
    let heat_range = drawing.heat_range;
    let warnings = items.into_iter().filter(|item| item.level.is_none());
    Ok(PictureOutcome {
        picture,
        size,
        rows,
        heat_range,
        warnings: warnings.map(|item| (item.path, item.warnings)).collect(),
        threads: rayon::current_num_threads(),
        clock: job.times(),
    })
}

/// Renders a mesh like a file that has only this mesh. `values` are those of its vertices for
/// [`Shading::Heat`](lodsmith_render::Shading::Heat).
///
/// # Errors
/// [`AssetError::Render`] for a wrong number of values and for a wrong size; those of reading images.
pub fn render_mesh(
    mesh: TriMesh,
    values: Option<Vec<f32>>,
    recipe: &PictureRecipe,
) -> Result<Image, AssetError> {
    let mut item = Item::upright(String::new(), Model::of_mesh(mesh), recipe);
    item.distances = values.map(|values| vec![values]);
    Drawing::new(recipe, &[item], images(recipe)?)?.draw_alone()
}

/// Reads the images of a recipe.
fn images(recipe: &PictureRecipe) -> Result<Images, AssetError> {
    fn read<T>(path: &Path, decode: fn(&[u8]) -> Result<T, PictureError>) -> Result<Arc<T>, AssetError> {
        let bytes =
            std::fs::read(path).map_err(|problem| AssetError::File { path: path.to_owned(), problem })?;
        decode(&bytes).map(Arc::new).map_err(|why| AssetError::from(why).of(path.display()))
    }
    let matcap = recipe.matcap.as_deref().map(|path| read(path, decode)).transpose()?;
    let environment = match &recipe.environment {
        Surroundings::Auto | Surroundings::None => None,
        Surroundings::Studio => Some(Arc::new(Environment::studio())),
        Surroundings::File(path) => Some(read(path, Environment::decode)?),
    };
    Ok(Images { matcap, environment })
}

fn check_memory(recipe: &PictureRecipe, items: &[Item], job: &Job<'_>) -> Result<(), AssetError> {
    let size = Size::of_all(items.iter().flat_map(Item::meshes));
    let mut need = memory_need::render(size, recipe.size(items.len()), items.len(), recipe.occlusion);
    if recipe.is_measured() {
        need = need.saturating_add(memory_need::distances(size));
    }
    job.check_memory("render", need)
}

impl PictureOutcome {
    /// Returns the report.
    pub fn to_json(&self, to: Option<&PictureOutput>) -> Value {
        let [width, height] = self.size;
        let mut output = json!({ "path": null, "format": null, "width": width, "height": height });
        if let Some(to) = to {
            to.describe(&mut output);
        }
        let named = |(path, all): &(String, Vec<Warning>)| -> Vec<String> {
            all.iter().map(|warning| format!("{path}: {warning}")).collect()
        };
        json!({
            "output": output,
            "pictures": self.rows.iter().map(PictureRow::to_json).collect::<Vec<_>>(),
            "heat_range": self.heat_range,
            "threads": self.threads,
            "seconds": micros(self.clock.total()),
            "warnings": self.warnings.iter().flat_map(named).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use lodsmith::NoControl;

    use super::*;
    use crate::destination::Up;

    /// Fault: a mesh had no margin, and its camera other angles where only one was given.
    #[test]
    fn a_mesh_has_the_picture_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fin.obj");
        std::fs::write(&path, "v 0 0 0\nv 5 0 0\nv 0 2 0\nv 1 0 .5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
            .unwrap();
        let places = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.5]];
        let mesh = TriMesh::from_indexed(&places, &[0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]).unwrap();
        let iso = Viewpoint::default();
        let side = Viewpoint { azimuth_deg: Some(200.0), ..iso };
        let mut before = None;
        for (viewpoint, up) in [(iso, Up::Y), (iso, Up::Z), (side, Up::Y)] {
            let recipe = PictureRecipe { viewpoint, up, size: Some([64, 48]), ..PictureRecipe::default() };
            let mut watch = NoControl;
            let mut job = Job::new(&mut watch, None, u64::MAX);
            let input = [Source::Path(path.clone())];
            let of_file = render(&input, &ReadOptions::default(), &recipe, None, &mut job).unwrap().picture;
            assert!(of_file != before, "{viewpoint:?} {up:?}: nothing has changed");
            assert!(
                Some(render_mesh(mesh.clone(), None, &recipe).unwrap()) == of_file,
                "{viewpoint:?} {up:?}"
            );
            before = of_file;
        }
    }
}
