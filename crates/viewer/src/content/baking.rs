//! Baking of maps for a result.

use std::sync::Arc;

use glam::DVec3;
use lodsmith_asset::{Edit, Made, Recipe, Watch};
use lodsmith_bake::{BakedSet, Texels};
use lodsmith_core::model::{Pose, Transform};
use lodsmith_core::{Image, Model, Positions, TriMesh};
use lodsmith_io::ModelFile;
use lodsmith_render::{Shading, linear};
use web_time::Instant;

use super::{Lighter, Original, job, texts};
use crate::content::baked::{BakedMaps, NamedMap};
use crate::content::export::own_meshes;
use crate::job::Failure;
use crate::settings::bake::BakeSettings;

/// Bakes maps of a result from its original. Returns the result as a reader of the written file sees it. If the
/// original has no colours, the window shows it in the colour `surface` (sRGB), and the result too.
pub(crate) fn bake_result(
    original: &Original,
    shown: &Lighter,
    settings: &BakeSettings,
    surface: [f32; 3],
    watch: &mut dyn Watch,
) -> Result<Lighter, Failure> {
    let begin = Instant::now();
    let asset = original.asset()?;
    let baking = settings.baking();
    let mut job = job(watch);
    let (asset, edit, baked, report) = match asset.scene() {
        Some(scene) => {
            let mut edit = Edit { meshes: own_meshes(original, shown), ..Edit::default() };
            let baked = edit.bake(scene.clone(), &baking, &mut job)?;
            (asset, edit, baked, None)
        }
        None => {
            // A mesh becomes a scene before it is simplified.
            let recipe = Recipe { baking: Some(baking), ..shown.how.recipe() };
            let Made { asset, edit, baked, report, .. } = recipe.run(asset, None, &mut job)?;
            let baked = baked.ok_or_else(|| Failure::Error("nothing was baked".to_owned()))?;
            (asset, edit, baked, Some(report))
        }
    };
    let scene = edit.scene.as_deref().map(|scene| scene.with_meshes(&edit.meshes)).transpose();
    let scene = scene.map_err(failure)?.ok_or_else(|| Failure::Error("nothing was baked".to_owned()))?;
    let mut model = ModelFile::from(scene).model;
    if model.meshes.len() != original.model().meshes.len() {
        return Err(Failure::Error("the model with maps has other meshes than the original".to_owned()));
    }
    if report.is_some() {
        moved_to_place(&mut model);
    }
    if original.intended_shading() == Shading::Smooth {
        for material in model.materials.iter_mut().filter(|m| m.base_color_texture.is_none()) {
            (0..3).for_each(|k| material.base_color[k] = linear::decoded(surface[k]));
        }
    }
    let (maps, warnings) = (named(&baked.sets), texts(&baked.warnings));
    let seconds = begin.elapsed().as_secs_f64();
    let maps = BakedMaps { settings: settings.clone(), maps, seconds, asset, edit };
    let mut made = shown.with_maps(model, Arc::new(maps), warnings);
    made.report = report.or(made.report);
    Ok(made)
}

/// Applies the translation of the node to the mesh of a model, which gives it the coordinates of the original. In a
/// scene with single precision, a mesh far from the origin is moved by its node.
fn moved_to_place(model: &mut Model) {
    let instances = model.instances(&Pose::default());
    let [instance] = &instances[..] else { return };
    let by = instance.world_from_mesh.w_axis.truncate();
    if by == DVec3::ZERO {
        return;
    }
    let mesh = &mut model.meshes[instance.mesh].mesh;
    let mut buffers = TriMesh::clone(mesh).into_buffers();
    let moved = buffers.positions.view().iter().map(|p| (DVec3::from(p) + by).to_array()).collect();
    buffers.positions = Positions::F64(moved);
    if let Ok(moved) = TriMesh::try_from(buffers) {
        *mesh = Arc::new(moved);
        model.nodes[instance.node].transform = Transform::default();
    }
}

fn failure(why: impl std::fmt::Display) -> Failure {
    Failure::Error(why.to_string())
}

fn named(sets: &[BakedSet]) -> Vec<NamedMap> {
    let several = sets.len() > 1;
    let named = |set: &BakedSet, map: &lodsmith_bake::BakedMap| NamedMap {
        name: match several {
            true => format!("{} {}", set.name, map.kind.name()),
            false => map.kind.name().to_owned(),
        },
        image: match &map.texels {
            Texels::Rgba8(image) => image.clone(),
            Texels::Gray16 { width, height, values } => {
                let gray = |value: &u16| {
                    let g = (value >> 8) as u8;
                    [g, g, g, 255]
                };
                Image::new(*width, *height, values.iter().map(gray).collect())
            }
            _ => Image::new(1, 1, vec![[0; 4]]),
        },
    };
    sets.iter().flat_map(|set| set.maps.iter().map(move |map| named(set, map))).collect()
}
