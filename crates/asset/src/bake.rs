//! Baking the detail of one file into textures of another.

use lodsmith_io::{ModelFile, ReadOptions, Warning};
use serde_json::{Value, json};

use crate::asset::{Asset, Edit, read_model};
use crate::baking::Baking;
use crate::constraints::PartNames;
use crate::destination::Destination;
use crate::error::AssetError;
use crate::job::{Job, StageClock, Step};
use crate::paths::{self, Source};
use crate::report_json::micros;
use crate::warnings::texts;

/// Outcome of baking.
#[derive(Debug)]
pub struct BakeOutcome {
    /// Number of faces of the low-poly model.
    pub faces: usize,
    /// One line of text for people.
    pub summary: String,
    /// Report of the maps.
    pub baked: Value,
    /// Warnings of reading, baking and writing.
    pub warnings: Vec<Warning>,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads both models, bakes maps of the high-poly model for the low-poly model, and writes the low-poly model with its
/// maps.
///
/// # Errors
/// Those of [`Asset::read`] and [`Asset::write`]; [`AssetError::Bake`]. An error of the high-poly model names its file.
pub fn bake(
    high: &Source,
    low: &Source,
    reading: &ReadOptions,
    baking: &Baking,
    to: &Destination,
    job: &mut Job<'_>,
) -> Result<BakeOutcome, AssetError> {
    paths::at_most_one_stream([high, low])?;
    baking.refuse_streams(&to.sink)?;
    job.enter(Step::Read);
    let detailed = read_model(high, reading, job).map_err(|why| why.of(high))?;
    let mut asset = Asset::read(low, reading, true, job)?;
    asset.become_scene(&PartNames::default(), &to.writing)?;
    let mut scene = asset.scene().expect("the asset is a scene").clone();
    let model = ModelFile::from(scene.clone()).model;
    job.enter(Step::Bake);
    let mut baked = baking.bake(&detailed.model, &model, &mut scene, job)?;
    job.enter(Step::Write);
    lodsmith_bake::set_materials(&mut scene, &baked.materials);
    scene.drop_unused_materials();
    let mut warnings = asset.warnings().to_vec();
    warnings.extend(detailed.warnings);
    warnings.append(&mut baked.warnings);
    let faces = baked.replaced.iter().flatten().map(|m| m.face_count()).sum();
    let edit = Edit {
        meshes: std::mem::take(&mut baked.replaced),
        scene: Some(Box::new(scene)),
        files: std::mem::take(&mut baked.files),
        is_baked: true,
        moved: baking.moved(),
    };
    warnings.extend(asset.write(edit, to, job)?.warnings);
    Ok(BakeOutcome { faces, summary: baked.summary(), baked: baked.report, warnings, clock: job.times() })
}

impl BakeOutcome {
    /// Returns the report, with these paths.
    pub fn to_json(&self, high: &str, low: &str, to: &Destination) -> Value {
        json!({
            "high": high,
            "low": low,
            "output": to.sink.to_string(),
            "seconds": micros(self.clock.total()),
            "warnings": texts(&self.warnings),
            "baked": self.baked,
        })
    }
}
