//! Levels of detail of a scene, or of a mesh that becomes one.

use std::sync::Arc;

use lodsmith::SceneChain;
use lodsmith::core::{Positions, TriMesh};
use lodsmith_io::Loaded;
use lodsmith_io::gltf::{Scene, SceneMesh};

use super::files::{self, Plan};
use super::report::{self, Level, LodResult};
use crate::args::LodArgs;
use crate::file::Destination;
use crate::memory_need::Size;
use crate::normals::set_normals;
use crate::orient::orient;
use crate::run_control::{RunControl, not_interrupted};
use crate::scene_parts::{self, parts_of};
use crate::warnings::not_reached;
use crate::{constraints, images, memory, memory_need, palettes};

/// Makes the levels of a mesh that becomes a glTF scene: locks and importance are mapped to the vertices of
/// the scene.
pub(super) fn of_mesh(
    loaded: Loaded,
    args: &LodArgs,
    plan: &Plan,
    to: &Destination,
    watch: RunControl<'_>,
) -> anyhow::Result<LodResult> {
    let mut own = args.options().simplify;
    constraints::of_mesh(&args.engine.how, &loaded, &mut own)?;
    let Loaded { mut mesh, regions, mut warnings, format, .. } = loaded;
    orient(&mut mesh, &to.writing);
    let (scene, lost) = to.as_scene(&mesh, regions)?;
    warnings.extend(lost);
    let of_vertices = scene.meshes().first().map(|there| files::vertices_of(there, &mesh));
    let carried = of_vertices.map(|of| VertexConstraints {
        locked: own.locked.as_deref().map(|all| of.iter().map(|v| v.iter().any(|&v| all[v])).collect()),
        importance: own.importance.as_deref().map(|all| {
            of.iter().map(|v| v.iter().map(|&v| all[v]).reduce(f32::max).unwrap_or(1.0)).collect()
        }),
    });
    let mut made = of_scene(scene, args, plan, to, watch, Some(carried.unwrap_or_default()))?;
    made.format = format;
    made.counts = [mesh.face_count(), mesh.vertex_count()];
    warnings.append(&mut made.warnings);
    made.warnings = warnings;
    Ok(made)
}

/// Locks and importance of the vertices of a scene's only mesh.
#[derive(Default)]
pub(super) struct VertexConstraints {
    locked: Option<Arc<[bool]>>,
    importance: Option<Arc<[f32]>>,
}

/// Makes the levels of a scene: all in one file, or one file each.
pub(super) fn of_scene(
    mut scene: Scene,
    args: &LodArgs,
    plan: &Plan,
    to: &Destination,
    mut watch: RunControl<'_>,
    cared: Option<VertexConstraints>,
) -> anyhow::Result<LodResult> {
    if scene.has_levels() {
        anyhow::bail!("the scene has levels of detail already (MSFT_lod): start from a file without");
    }
    let meshes: Vec<SceneMesh> = scene.meshes().to_vec();
    let (taken, parts) = parts_of(&meshes);
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let mut options = args.options();
    match cared {
        Some(cared) => {
            (options.simplify.locked, options.simplify.importance) = (cared.locked, cared.importance);
        }
        None => constraints::of_scene(&args.engine.how, &scene, &taken, &mut options.simplify)?,
    }
    options.simplify.textures = palettes::of_scene(&scene, &taken);
    let size = Size::of_all(meshes.iter().map(|m| &*m.mesh));
    memory::check(
        "lod",
        memory_need::lod_scene(size, &options.simplify).saturating_add(scene.buffer_bytes()),
    )?;
    let chain = not_interrupted(lodsmith::lod_scene(&parts, diagonal, &options, &mut watch))?;
    watch.write();
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
    let mut warnings: Vec<_> = scene.warnings().to_vec();
    let images = images::FolderMove::new(&plan.job.source, &to.sink);
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    let counts = [TriMesh::face_count, TriMesh::vertex_count].map(|of| scene_parts::count(&parts, of));
    let distances: Vec<f64> = told.iter().map(|l| report::distance(&l.report, plan)).collect();
    warnings.extend(plan.write_scene(&scene, replaced, &distances, &|uri| images.uri(uri))?);
    let format = scene.format();
    let outputs = plan.outputs(told.len());
    let threads = rayon::current_num_threads();
    Ok(LodResult { format, counts, levels: told, outputs, diagonal, warnings, threads, clock: watch.end() })
}
