//! `lodsmith lod`: reads, makes a chain of levels, writes them, and reports the result.

mod files;
mod report;

use std::sync::Arc;
use std::time::{Duration, Instant};

use lodsmith::core::{Positions, TriMesh};
use lodsmith::{LodChain, SceneChain};
use lodsmith_io::gltf::{Scene, SceneMesh};
use lodsmith_io::{Format, Loaded, Textures, Warning};

use crate::args::LodArgs;
use crate::constraints;
use crate::exit;
use crate::file::{self, Input};
use crate::images;
use crate::in_order;
use crate::memory_need::Size;
use crate::normals::set_normals;
use crate::orient::{orient, oriented};
use crate::output::Output;
use crate::palettes;
use crate::progress::{FileProgress, Progress};
use crate::run_control::{RunControl, StageClock, not_interrupted};
use crate::scene_parts::{self, parts_of};
use crate::status::{Interrupted, Status};
use crate::warnings::not_reached;
use crate::{memory, memory_need};
use files::Plan;
use report::{Level, LodResult};

/// Makes the levels of one input.
pub(super) fn run(args: &LodArgs) -> anyhow::Result<Status> {
    let plan = Plan::new(args)?;
    let out = Output::new(&args.run, args.ending.json, plan.takes_stdout());
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let made = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        let made = exit::guarded(|| make(args, &plan, &bar));
        bar.end();
        made
    });
    progress.finish();
    let status = report::show(&out, &path, made, &plan, args);
    out.finish(status)
}

fn make(args: &LodArgs, plan: &Plan, bar: &FileProgress<'_>) -> anyhow::Result<LodResult> {
    if exit::interrupted() {
        return Err(Interrupted.into());
    }
    let mut clock = StageClock::new();
    let deadline = args.run.time_limit.map(|s| Instant::now() + Duration::from_secs_f64(s));
    bar.read();
    clock.enter("read");
    let properties = constraints::properties(&args.engine.how);
    // Rotating or scaling a scene would need changes of its nodes.
    let is_plain = args.writing.scale.is_none() && args.writing.up.is_none();
    let input = if plan.makes_scenes() && is_plain {
        file::read_scene(&args.input, &args.reading, properties)?
    } else {
        Input::Mesh(Box::new(file::read_with(&args.input, &args.reading, properties)?))
    };
    let mut watch = RunControl::new(&mut clock, bar, deadline);
    let mut made = match input {
        Input::Scene(scene) => of_scene(*scene, args, plan, &mut watch, None)?,
        Input::Mesh(loaded) if plan.makes_scenes() => of_mesh_as_scene(*loaded, args, plan, &mut watch)?,
        Input::Mesh(loaded) => of_mesh(*loaded, args, plan, &mut watch)?,
    };
    clock.end();
    made.clock = clock;
    Ok(made)
}

/// Makes the levels of a mesh, each in a file of its own.
fn of_mesh(
    loaded: Loaded,
    args: &LodArgs,
    plan: &Plan,
    watch: &mut RunControl<'_>,
) -> anyhow::Result<LodResult> {
    let mut options = args.options();
    constraints::of_mesh(&args.engine.how, &loaded, &mut options.simplify)?;
    options.simplify.textures = palettes::of_mesh(&loaded);
    let Loaded { mut mesh, regions, contents, mut warnings, format: from, .. } = loaded;
    let is_kept = plan.format() == Some(Format::Obj) && args.writing.textures != Textures::None;
    if matches!(from, Format::Gltf | Format::Glb) && !is_kept {
        // If materials are not written, their borders need not be preserved.
        mesh.set_regions(None)?;
    }
    if args.engine.is_per_mesh() && contents.meshes > 1 {
        let text = "--per-mesh: the meshes become one on this way, and share the target";
        warnings.push(Warning::note(text));
    }
    memory::check("lod", memory_need::lod(Size::of(&mesh), &options.simplify))?;
    let chain = not_interrupted(lodsmith::lod(&mesh, &options, watch))?;
    watch.write();
    let counts = [mesh.face_count(), mesh.vertex_count()];
    let diagonal = chain.levels.first().map_or(0.0, |l| l.report.error.diagonal);
    let geomorphs: Vec<Option<Positions>> =
        (0..=chain.levels.len()).map(|k| chain.geomorph(k).cloned()).collect();
    let LodChain { levels, .. } = chain;
    let mut meshes = vec![mesh];
    let mut told = Vec::with_capacity(levels.len());
    for level in levels {
        let mut mesh = level.mesh;
        let why = not_reached(&level.report, &options.simplify, args.run.time_limit, [&mesh]);
        set_normals(&mut mesh, args.normals)?;
        meshes.push(mesh);
        told.push(Level { report: level.report, not_reached: why, meshes: Vec::new() });
    }
    for (mesh, geomorph) in meshes.iter_mut().zip(geomorphs) {
        orient(mesh, &args.writing);
        if let Some(geomorph) = geomorph {
            files::carry(mesh, &geomorph, |p| oriented(p, &args.writing))?;
        }
    }
    warnings.extend(plan.write_meshes(&meshes, &regions, args)?);
    Ok(LodResult { format: from, counts, levels: told, diagonal, warnings, clock: StageClock::new() })
}

/// Makes the levels of a mesh that becomes a glTF scene: locks and importance are mapped to the vertices of
/// the scene.
fn of_mesh_as_scene(
    loaded: Loaded,
    args: &LodArgs,
    plan: &Plan,
    watch: &mut RunControl<'_>,
) -> anyhow::Result<LodResult> {
    let mut own = args.options().simplify;
    constraints::of_mesh(&args.engine.how, &loaded, &mut own)?;
    let Loaded { mut mesh, regions, mut warnings, format, .. } = loaded;
    orient(&mut mesh, &args.writing);
    let options = file::options(&args.writing, Format::Glb, regions);
    let (scene, lost) = file::as_scene(&mesh, &options)?;
    warnings.extend(lost);
    let of_vertices = scene.meshes().first().map(|there| files::vertices_of(there, &mesh));
    let carried = of_vertices.map(|of| VertexConstraints {
        locked: own.locked.as_deref().map(|all| of.iter().map(|v| v.iter().any(|&v| all[v])).collect()),
        importance: own.importance.as_deref().map(|all| {
            of.iter().map(|v| v.iter().map(|&v| all[v]).reduce(f32::max).unwrap_or(1.0)).collect()
        }),
    });
    let mut made = of_scene(scene, args, plan, watch, Some(carried.unwrap_or_default()))?;
    made.format = format;
    made.counts = [mesh.face_count(), mesh.vertex_count()];
    warnings.append(&mut made.warnings);
    made.warnings = warnings;
    Ok(made)
}

/// Locks and importance of the vertices of a scene's only mesh.
#[derive(Default)]
struct VertexConstraints {
    locked: Option<Arc<[bool]>>,
    importance: Option<Arc<[f32]>>,
}

/// Makes the levels of a scene: all in one file, or one file each.
fn of_scene(
    mut scene: Scene,
    args: &LodArgs,
    plan: &Plan,
    watch: &mut RunControl<'_>,
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
    let chain = not_interrupted(lodsmith::lod_scene(&parts, diagonal, &options, watch))?;
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
        let why = not_reached(&level.report, &options.simplify, args.run.time_limit, &level.meshes);
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
    let images = images::FolderMove::new(&args.input, &plan.first_sink());
    let format = plan.format().unwrap_or(Format::Gltf);
    warnings.extend(images.bring(&mut scene, format, args.writing.textures));
    let counts = [TriMesh::face_count, TriMesh::vertex_count].map(|of| scene_parts::count(&parts, of));
    let distances: Vec<f64> = told.iter().map(|l| report::distance(&l.report, args)).collect();
    warnings.extend(plan.write_scene(&scene, replaced, &distances, &|uri| images.uri(uri), args)?);
    let format = scene.format();
    Ok(LodResult { format, counts, levels: told, diagonal, warnings, clock: StageClock::new() })
}
