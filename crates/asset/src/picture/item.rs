//! The items of a picture: files and simplified levels.

use std::sync::Arc;

use lodsmith::{SimplifyOptions, Stop};
use lodsmith_core::model::{Node, Transform};
use lodsmith_core::numbers::significant;
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::{ModelFile, ReadOptions, Warning};
use lodsmith_render::{DQuat, DVec3};

use super::recipe::PictureRecipe;
use crate::asset::{Asset, read_model};
use crate::constraints::PartNames;
use crate::destination::Up;
use crate::error::{AssetError, usage};
use crate::job::{Job, Step};
use crate::memory_need::{self, Size};
use crate::paths::Source;

/// A file or a simplified level.
pub(super) struct Item {
    pub path: String,
    pub model: Model,
    pub warnings: Vec<Warning>,
    /// The target count of a level.
    pub level: Option<usize>,
    /// Index of the original of a level, or of the reference of a comparison.
    pub reference: Option<usize>,
    /// Distance of each vertex of each mesh from the reference, or of the reference from its only candidate.
    pub distances: Option<Vec<Vec<f32>>>,
    /// Diagonal of the bounding box of the reference, if distances are needed.
    pub diagonal: f64,
    pub moment: Option<Moment>,
}

/// A time in an animation.
pub(super) struct Moment {
    pub clip: usize,
    pub name: String,
    pub seconds: f64,
}

/// Reads all files, the reference first, and simplifies them to the levels.
pub(super) fn read_all(
    inputs: &[Source],
    reading: &ReadOptions,
    recipe: &PictureRecipe,
    job: &mut Job<'_>,
) -> Result<Vec<Item>, AssetError> {
    let mut items = Vec::new();
    if let Some(reference) = &recipe.compare {
        items.push(Item::read(reference, reading, recipe, job)?.0);
    }
    let reference = recipe.compare.as_ref().map(|_| 0);
    for input in inputs {
        let (item, asset) = Item::read(input, reading, recipe, job)?;
        let original = items.len();
        items.push(Item { reference, ..item });
        for &count in &recipe.levels {
            job.enter(Step::Prepare);
            let level = items[original].level(count, asset.as_ref(), recipe, job)?;
            items.push(Item { reference: Some(original), ..level });
        }
    }
    Ok(items)
}

impl Item {
    /// Returns an item with the y axis up.
    pub(super) fn upright(path: String, mut model: Model, recipe: &PictureRecipe) -> Self {
        if recipe.up == Up::Z {
            rotate_z_up(&mut model);
        }
        Self::new(path, model)
    }

    fn new(path: String, model: Model) -> Self {
        let (warnings, level, reference) = (Vec::new(), None, None);
        Self { path, model, warnings, level, reference, distances: None, diagonal: 0.0, moment: None }
    }

    fn read(
        source: &Source,
        reading: &ReadOptions,
        recipe: &PictureRecipe,
        job: &mut Job<'_>,
    ) -> Result<(Self, Option<Asset>), AssetError> {
        let named = |why: AssetError| why.of(source);
        let file = read_model(source, reading, job).map_err(named)?;
        let asset = Asset::of_model(&file, source.clone());
        let ModelFile { model, warnings, .. } = file;
        let item = Self::upright(source.to_string(), model, recipe);
        let moment = Moment::of(recipe, &item.model).map_err(named)?;
        Ok((Self { warnings, moment, ..item }, asset))
    }

    /// Returns a simplified level with the materials and nodes of the original. `asset` is the file.
    fn level(
        &self,
        count: usize,
        asset: Option<&Asset>,
        recipe: &PictureRecipe,
        job: &mut Job<'_>,
    ) -> Result<Self, AssetError> {
        let mut options = SimplifyOptions::new(Stop::faces(count));
        options.method = recipe.method.into();
        job.check_memory("render --levels", memory_need::lod(Size::of_all(self.meshes()), &options))?;
        let model = self.simplified(&options, asset, job).map_err(|why| why.of(&self.path))?;
        Ok(Self { level: Some(count), ..Self::new(self.path.clone(), model) })
    }

    fn simplified(
        &self,
        options: &SimplifyOptions,
        asset: Option<&Asset>,
        job: &mut Job<'_>,
    ) -> Result<Model, AssetError> {
        let mut meshes: Vec<Arc<TriMesh>> = self.model.meshes.iter().map(|m| m.mesh.clone()).collect();
        if let Some(asset) = asset {
            let (data, _) = asset.data(&PartNames::default())?;
            for (mesh, result) in meshes.iter_mut().zip(asset.simplify(options, &data, job)?.meshes) {
                if let Some(result) = result {
                    *mesh = Arc::new(result);
                }
            }
        }
        Ok(self.model.with_meshes(meshes))
    }

    /// Returns the meshes.
    pub(super) fn meshes(&self) -> impl Iterator<Item = &TriMesh> {
        self.model.meshes.iter().map(|m| &*m.mesh)
    }
}

impl Moment {
    /// Returns the requested time; `None` for the rest pose.
    fn of(recipe: &PictureRecipe, model: &Model) -> Result<Option<Self>, AssetError> {
        if recipe.clip.is_none() && recipe.time.is_none() {
            return Ok(None);
        }
        let names: Vec<String> = model.animations.iter().map(|a| a.name.clone()).collect();
        if names.is_empty() {
            return Err(usage("has no animation: --time and --clip need a glTF file with one"));
        }
        let clip = match &recipe.clip {
            None => Some(0),
            Some(given) => {
                let by_number = || given.parse::<usize>().ok()?.checked_sub(1).filter(|n| *n < names.len());
                names.iter().position(|n| n == given).or_else(by_number)
            }
        };
        let Some(clip) = clip else {
            let all: Vec<_> = names.iter().enumerate().map(|(i, n)| format!("{} {n:?}", i + 1)).collect();
            let given = recipe.clip.as_deref().unwrap_or_default();
            return Err(usage(format!("has no animation {given:?}; the animations are {}", all.join(", "))));
        };
        let (seconds, length) = (recipe.time.unwrap_or(0.0), model.animations[clip].duration());
        if seconds > length {
            let end = significant(length, 2);
            return Err(usage(format!("animation {:?} ends at {end} s", names[clip])));
        }
        Ok(Some(Self { clip, name: names[clip].clone(), seconds }))
    }
}

/// Rotates a model so that its z axis points up.
fn rotate_z_up(model: &mut Model) {
    let (rotation, children) = (DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2), model.roots.clone());
    let transform = Transform::Parts { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
    model.roots = vec![model.nodes.len()];
    model.nodes.push(Node { transform, children, ..Node::default() });
}
