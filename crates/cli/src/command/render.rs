//! `lodsmith render`: renders an image without a window.

use lodsmith_asset::request::{Done, Note, Places, Request, Verb};

use crate::args::{RenderArgs, threads};
use crate::in_order;
use crate::numbers::{counted, seconds};
use crate::output::Output;
use crate::progress::Progress;
use crate::run_control::BarWatch;
use crate::status::Status;

/// Renders all inputs in one image, and prints the outcome.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Status> {
    let request = Request::of(Verb::Render, args.options.clone())?;
    let (inputs, output, out_dir) = (&args.inputs, args.output.as_ref(), args.out_dir.as_deref());
    let job = request.plan(&Places { inputs, output, out_dir, name: "", json: args.json })?;
    let to = job.pictures().expect("the arguments require an output");
    let out = Output::new(args.loudness, args.json, to.is_stdout());
    let progress = Progress::new(1, args.loudness.quiet);
    let drawn = in_order::pool(threads(&args.options))?.install(|| {
        let bar = progress.file("");
        let mut watch = BarWatch::new(&bar);
        job.run(&job.files[0], &mut job.begin(&mut watch))
    });
    progress.finish();
    let drawn = drawn?;

    for Note { about, text, .. } in drawn.notes("") {
        out.warning(&format!("{about}: {text}"));
    }
    out.object(&job.report(&job.files[0], &drawn));
    let Done::Render(drawn) = drawn else { unreachable!("the job renders") };
    let ([width, height], faces) = (drawn.size, drawn.rows.iter().map(|row| row.faces).sum());
    let (faces, time) = (counted(faces, "face", "faces"), seconds(drawn.clock.total()));
    out.line(&format!("{to}: {width} × {height} pixels, {faces}, {time}"));
    for row in &drawn.rows {
        let faces = counted(row.faces, "face", "faces");
        out.detail(&format!("  {}: {faces}, rendered in {:.3} s", row.path, row.seconds));
    }
    out.finish(Status::Done)
}
