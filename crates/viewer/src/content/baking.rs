//! Baking of maps for a result.

use std::sync::Arc;

use glam::DVec3;
use lodsmith::Control;
use lodsmith_bake::{BakeError, BakedScene, BakedSet, Texels, bake_scene, model_with, set_materials};
use lodsmith_core::model::{Pose, Transform};
use lodsmith_core::{Image, Model, Positions, TriMesh};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ModelFile, ModelSource, ReadOptions, WriteOptions};
use lodsmith_render::{Shading, linear};
use web_time::Instant;

use super::{Lighter, Original};
use crate::bake_settings::BakeSettings;
use crate::baked::{BakedMaps, NamedMap};
use crate::export::{embed, lighter_meshes};
use crate::job::Failure;

/// Bakes maps of a result from its original. The result is as a reader of the written file sees it; but if the original
/// has no colours, which are then those of the window, the result is shown in this colour (sRGB) too.
pub(crate) fn bake_result(
    original: &Original,
    shown: &Lighter,
    settings: &BakeSettings,
    surface: [f32; 3],
    control: &mut dyn Control,
) -> Result<Lighter, Failure> {
    let begin = Instant::now();
    let as_scene;
    let is_mesh = matches!(original.file.source, ModelSource::Mesh(_));
    let (original, lighter) = match &original.file.source {
        ModelSource::Mesh(_) => {
            // A mesh becomes a scene before it is simplified, as in the command.
            let source = scene_of(original)?;
            let made = Lighter::make(&source, &shown.how, control)?;
            as_scene = (source, made);
            (&as_scene.0, &as_scene.1)
        }
        _ => (original, shown),
    };
    let ModelSource::Scene(scene) = &original.file.source else {
        return Err(Failure::Error("maps cannot be baked for this kind of file".to_owned()));
    };
    let mut scene = (**scene).clone();
    let mut meshes = lighter_meshes(&scene, Some(lighter));
    let low = model_with(original.model(), &meshes);
    let baked = bake_scene(original.model(), &low, &mut scene, &settings.options(), false, control);
    let BakedScene { meshes: made, materials, sets, warnings: of_bake, .. } =
        baked.map_err(|why| match why {
            BakeError::Cancelled => Failure::Cancelled,
            why => Failure::Error(why.to_string()),
        })?;
    for (mesh, made) in meshes.iter_mut().zip(made) {
        *mesh = made.or_else(|| mesh.take());
    }
    set_materials(&mut scene, &materials);
    scene.drop_unused_materials();
    let mut warnings: Vec<String> = embed(&mut scene).iter().map(ToString::to_string).collect();
    warnings.extend(of_bake.iter().map(ToString::to_string));
    let mut bytes = Vec::new();
    lodsmith_io::write_scene_to(&scene, &meshes, Format::Glb, &|_| None, &mut bytes).map_err(failure)?;
    let mut file = ModelFile::from(Scene::read(&bytes, &ReadOptions::default()).map_err(failure)?);
    if file.model.meshes.len() != original.model().meshes.len() {
        return Err(Failure::Error("the model with maps has other meshes than the original".to_owned()));
    }
    if is_mesh {
        moved_to_place(&mut file.model);
    }
    if original.intended_shading() == Shading::Smooth {
        for material in file.model.materials.iter_mut().filter(|m| m.base_color_texture.is_none()) {
            (0..3).for_each(|k| material.base_color[k] = linear::decoded(surface[k]));
        }
    }
    let maps = BakedMaps {
        settings: settings.clone(),
        maps: named(&sets),
        seconds: begin.elapsed().as_secs_f64(),
        scene,
        meshes,
    };
    Ok(lighter.with_maps(file.model, Arc::new(maps), warnings))
}

/// Gives the mesh of a model the coordinates that its node moves it to: those of its original. A scene with single
/// precision moves a mesh far from the origin by its node.
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

/// Returns a mesh as a scene, as writing and reading it gives.
fn scene_of(original: &Original) -> Result<Original, Failure> {
    let ModelSource::Mesh(regions) = &original.file.source else { return Err(Failure::Cancelled) };
    let mut options = WriteOptions::default();
    options.regions = Some(regions.clone());
    let mut bytes = Vec::new();
    let mesh = &original.model().meshes[0].mesh;
    lodsmith_io::write_to(mesh, Format::Glb, &options, &mut bytes).map_err(failure)?;
    let scene = Scene::read(&bytes, &ReadOptions::default()).map_err(failure)?;
    Ok(Original::of_file(original.path.clone(), ModelFile::from(scene), original.read_secs))
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
