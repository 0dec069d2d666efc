//! `lodsmith lod`: reads, makes a chain of levels, writes them, and reports the result.

mod bake;
mod files;
mod report;
mod scene;

use lodsmith::LodChain;
use lodsmith::core::Positions;
use lodsmith_io::{Format, Loaded, Warning};

use super::batch;
use crate::args::LodArgs;
use crate::file::{self, Input};
use crate::memory_need::Size;
use crate::normals::set_normals;
use crate::orient::{orient, oriented};
use crate::run_control::{RunControl, not_interrupted};
use crate::status::Status;
use crate::warnings::not_reached;
use crate::{constraints, engine_input, memory, memory_need, sizes};
use files::Plan;
use report::{Level, LodResult};

/// Makes the levels of one input.
pub(super) fn run(args: &LodArgs) -> anyhow::Result<Status> {
    let plan = Plan::new(args)?;
    batch::run_jobs(
        std::slice::from_ref(&plan.job),
        args.ending.json,
        &args.run,
        |_, watch, _| make(args, &plan, watch),
        |out, path, made, _| report::show(out, path, made, &plan, args.ending.strict),
    )
}

fn make(args: &LodArgs, plan: &Plan, mut watch: RunControl<'_>) -> anyhow::Result<LodResult> {
    watch.read();
    let properties = constraints::properties(&args.engine.names);
    let keeps_scenes = plan.job.keeps_scenes() || args.baking.is_asked();
    let input = file::read_input(&args.input, &args.reading, properties, keeps_scenes)?;
    watch.prepare();
    let is_scene = matches!(input, Input::Scene(_)) || args.baking.is_asked();
    let to = if is_scene { plan.job.output.as_ref() } else { plan.scenes() };
    let made = match (input, to) {
        (Input::Scene(scene), Some(to)) => scene::of_scene(*scene, args, plan, to, watch, None),
        (Input::Scene(_), None) => unreachable!("a scene is read where it can stay one"),
        (Input::Mesh(loaded), Some(to)) => scene::of_mesh(*loaded, args, plan, to, watch),
        (Input::Mesh(loaded), None) => of_mesh(*loaded, args, plan, watch),
    }?;
    plan.write_list(&report::list(&made, plan))?;
    Ok(made)
}

/// Makes the levels of a mesh, each in a file of its own.
fn of_mesh(
    mut loaded: Loaded,
    args: &LodArgs,
    plan: &Plan,
    mut watch: RunControl<'_>,
) -> anyhow::Result<LodResult> {
    let sizes_before = sizes::of_input(&args.input, &args.reading, sizes::of_loaded(&loaded));
    let options = args.options();
    let to = plan.job.output.as_ref();
    let data = engine_input::of_mesh(&mut loaded, &args.engine.names, to, &options.simplify)?;
    let Loaded { mesh, regions, mut warnings, format, .. } = loaded;
    let need = memory_need::lod(Size::of(&mesh), &options.simplify);
    memory::check("lod", need.saturating_add(memory_need::images(std::slice::from_ref(&data))))?;
    let engine_input = lodsmith::Input::new(&mesh).with(data.view());
    let chain = not_interrupted(lodsmith::lod_with(&engine_input, &options, &mut watch))?;
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
        let why = not_reached(&level.report, &options.simplify, watch.time_limit, [&mesh]);
        set_normals(&mut mesh, args.normals)?;
        meshes.push(mesh);
        told.push(Level { report: level.report, not_reached: why, meshes: Vec::new() });
    }
    let mut written = Vec::new();
    if let Some(to) = to {
        for (mesh, geomorph) in meshes.iter_mut().zip(geomorphs) {
            orient(mesh, &to.writing);
            if let Some(geomorph) = geomorph {
                files::carry(mesh, &geomorph, |p| oriented(p, &to.writing))?;
            }
        }
        written = plan.write_meshes(&meshes, &regions)?;
        warnings.extend(written.iter_mut().flat_map(|made| std::mem::take(&mut made.warnings)));
        if options.geomorph && to.format != Format::Ply {
            let text = format!("{} cannot carry geomorph data: dropped", to.format.title());
            warnings.push(Warning::lost(text));
        }
    }
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
