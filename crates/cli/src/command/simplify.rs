//! `lodsmith simplify`: reads, simplifies, writes, and reports the result.

mod report;
mod scene;

use lodsmith::Simplified;
use lodsmith_io::Loaded;

use super::batch;
use crate::args::SimplifyArgs;
use crate::file::{self, Destination, Input};
use crate::in_order::Turn;
use crate::normals::set_normals;
use crate::orient::orient;
use crate::paths::Source;
use crate::plan::Job;
use crate::run_control::{RunControl, not_interrupted};
use crate::sizes::{self, WriteOutcome};
use crate::status::{Status, usage};
use crate::warnings::{not_reached, warnings_of};
use crate::{baking, constraints, engine_input, memory, memory_need};
use report::SimplifyOutcome;

/// Simplifies every input.
pub(super) fn run(args: &SimplifyArgs) -> anyhow::Result<Status> {
    if !args.has_end() {
        return Err(usage(
            "a target is needed: --faces, --vertices, --ratio, --error, or what the method ends by",
        ));
    }
    let wanted = args.wanted();
    baking::check(&args.baking, &args.writing, wanted.output)?;
    batch::run(
        &wanted,
        &args.run,
        |job, watch, turn| simplify_one(job, args, watch, turn),
        |out, path, outcome, job| report::show(out, path, outcome, job, args),
    )
}

fn simplify_one(
    job: &Job,
    args: &SimplifyArgs,
    mut watch: RunControl<'_>,
    turn: &Turn<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    watch.read();
    let properties = constraints::properties(&args.engine.names);
    let bakes = args.baking.is_asked() && job.output.is_some();
    let input = file::read_input(&job.source, &args.reading, properties, job.keeps_scenes() || bakes)?;
    watch.prepare();
    match (input, &job.output) {
        (Input::Scene(scene), Some(to)) => scene::simplify_scene(*scene, &job.source, to, args, None, watch),
        (Input::Mesh(loaded), Some(to)) if bakes => {
            scene::simplify_mesh(*loaded, &job.source, to, args, watch)
        }
        (Input::Scene(_), None) => unreachable!("a scene is read where it can stay one"),
        (Input::Mesh(loaded), to) => simplify_mesh(*loaded, &job.source, to.as_ref(), args, watch, turn),
    }
}

/// Simplifies a mesh and writes it.
fn simplify_mesh(
    mut loaded: Loaded,
    source: &Source,
    to: Option<&Destination>,
    args: &SimplifyArgs,
    mut watch: RunControl<'_>,
    turn: &Turn<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    let sizes_before = sizes::of_input(source, &args.reading, sizes::of_loaded(&loaded));
    let options = args.options();
    let data = engine_input::of_mesh(&mut loaded, &args.engine.names, to, &options)?;
    let Loaded { mesh, regions, mut warnings, format, .. } = loaded;
    let need = memory_need::simplify(&mesh, &options);
    memory::check("simplify", need.saturating_add(memory_need::images(std::slice::from_ref(&data))))?;
    let done = lodsmith::simplify_with(lodsmith::Input::new(&mesh).with(data.view()), &options, &mut watch);
    let Simplified { mesh: mut lighter, report } = not_interrupted(done)?;
    drop(mesh);
    let not_reached = not_reached(&report, &options, watch.time_limit, [&lighter]);
    warnings.extend(warnings_of(&report));

    watch.write();
    let mut written = WriteOutcome::default();
    if let Some(to) = to {
        orient(&mut lighter, &to.writing);
        set_normals(&mut lighter, args.normals)?;
        // If two textures have one name, that of the earlier input keeps it.
        if to.shares_names(&regions) {
            turn.wait();
        }
        written = to.write(&lighter, regions)?;
        warnings.append(&mut written.warnings);
    }
    Ok(SimplifyOutcome {
        input_format: format,
        report,
        not_reached,
        warnings,
        meshes: Vec::new(),
        baked: None,
        sizes_before,
        written,
        threads: rayon::current_num_threads(),
        clock: watch.end(),
    })
}
