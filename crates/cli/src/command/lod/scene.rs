//! Levels of detail of a scene, or of a mesh that becomes one.

use lodsmith::core::{Positions, TriMesh};
use lodsmith::{OwnedMeshData, SceneChain};
use lodsmith_bake::MapKind;
use lodsmith_io::gltf::{Scene, SceneMesh};
use lodsmith_io::{Loaded, Warning};

use super::bake::{BakedLevels, bake_levels};
use super::files::{self, Plan};
use super::report::{self, Level, LodResult};
use crate::args::LodArgs;
use crate::file::Destination;
use crate::memory_need::Size;
use crate::mesh_scene::MeshScene;
use crate::normals::set_normals;
use crate::run_control::{RunControl, not_interrupted};
use crate::scene_parts::{self, parts_of, taken};
use crate::warnings::{not_reached, starved};
use crate::{baking, engine_input, images, memory, memory_need, sizes};

/// Makes the levels of a mesh that becomes a glTF scene.
pub(super) fn of_mesh(
    loaded: Loaded,
    args: &LodArgs,
    plan: &Plan,
    to: &Destination,
    watch: RunControl<'_>,
) -> anyhow::Result<LodResult> {
    let (format, count) = (loaded.format, [loaded.mesh.face_count(), loaded.mesh.vertex_count()]);
    let own = MeshScene::new(loaded, &args.engine.names, to)?;
    let mut warnings = own.warnings;
    let mut made = of_scene(own.scene, args, plan, to, watch, Some(own.data))?;
    (made.format, made.counts) = (format, count);
    warnings.append(&mut made.warnings);
    made.warnings = warnings;
    Ok(made)
}

/// Makes the levels of a scene: all in one file, or one file each.
pub(super) fn of_scene(
    mut scene: Scene,
    args: &LodArgs,
    plan: &Plan,
    to: &Destination,
    mut watch: RunControl<'_>,
    own: Option<OwnedMeshData>,
) -> anyhow::Result<LodResult> {
    if scene.has_levels() {
        anyhow::bail!("the scene has levels of detail already (MSFT_lod): start from a file without");
    }
    let sizes_before = sizes::of_input(&plan.job.source, &args.reading, scene.sizes());
    let meshes: Vec<SceneMesh> = scene.meshes().to_vec();
    let taken = taken(&meshes);
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let options = args.options();
    let (data, left_out) = engine_input::of_scene(&scene, &taken, &args.engine.names, own)?;
    let parts = parts_of(&meshes, &data);
    let size = Size::of_all(meshes.iter().map(|m| &*m.mesh));
    let need = memory_need::lod_scene(size, &options.simplify).saturating_add(scene.buffer_bytes());
    memory::check("lod", need.saturating_add(memory_need::images(&data)))?;
    let chain = not_interrupted(lodsmith::lod_scene(&parts, diagonal, &options, &mut watch))?;
    let mut replaced = vec![vec![None; meshes.len()]];
    let mut told = Vec::with_capacity(chain.levels.len());
    if let Some(geomorphs) = chain.geomorph(0) {
        for (&i, geomorph) in taken.iter().zip(geomorphs).filter(|(i, _)| meshes[**i].mesh.face_count() > 0) {
            let mut mesh = TriMesh::clone(&meshes[i].mesh);
            files::carry(&mut mesh, geomorph, |p| p)?;
            replaced[0][i] = Some(mesh);
        }
    }
    let geomorphs: Vec<Option<Vec<Positions>>> =
        (1..=chain.levels.len()).map(|k| chain.geomorph(k).map(<[_]>::to_vec)).collect();
    let SceneChain { levels, .. } = chain;
    let mut warnings: Vec<_> = scene.warnings().to_vec();
    warnings.extend(left_out);
    // Later levels have fewer faces still.
    let first_starved =
        levels.iter().enumerate().find_map(|(k, level)| Some((k + 1, starved(&level.counts)?)));
    warnings.extend(first_starved.map(|(k, warning)| Warning::note(format!("level {k}: {warning}"))));
    for (level, geomorphs) in levels.into_iter().zip(geomorphs) {
        let why = not_reached(&level.report, &options.simplify, watch.time_limit, &level.meshes);
        let mut own: Vec<Option<TriMesh>> = vec![None; meshes.len()];
        for (k, (&i, mut mesh)) in taken.iter().zip(level.meshes).enumerate() {
            set_normals(&mut mesh, args.normals)?;
            if let Some(geomorphs) = &geomorphs {
                files::carry(&mut mesh, &geomorphs[k], |p| p)?;
            }
            // A mesh without faces in the input is not changed.
            own[i] = (meshes[i].mesh.face_count() > 0).then_some(mesh);
        }
        replaced.push(own);
        let names = taken.iter().map(|&i| meshes[i].name.clone()).zip(level.counts).collect();
        told.push(Level { report: level.report, not_reached: why, meshes: names });
    }
    let mut baked = BakedLevels::default();
    if args.baking.is_asked() {
        watch.bake();
        baked = bake_levels(&mut scene, &mut replaced, &args.baking, &mut watch)?;
        warnings.append(&mut baked.warnings);
    }
    watch.write();
    let images = images::FolderMove::new(&plan.job.source, &to.sink);
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    let counts = [TriMesh::face_count, TriMesh::vertex_count].map(|of| scene_parts::count(&parts, of));
    let distances: Vec<f64> = told.iter().map(|l| report::distance(&l.report, plan)).collect();
    let mut written = plan.write_scene(&scene, replaced, &baked, &distances, &|uri| images.uri(uri))?;
    warnings.extend(written.iter_mut().flat_map(|made| std::mem::take(&mut made.warnings)));
    baking::forgive_colors(&mut warnings, args.baking.bake.contains(&MapKind::Color));
    let format = scene.format();
    let outputs = plan.outputs(told.len());
    let threads = rayon::current_num_threads();
    Ok(LodResult {
        format,
        counts,
        levels: told,
        outputs,
        sizes_before,
        written,
        diagonal,
        warnings,
        threads,
        clock: watch.end(),
    })
}
