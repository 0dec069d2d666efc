//! Simplifies to a tenth of the faces and prints the distance from the input and the reasons of refused
//! collapses.
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use lodsmith::core::shapes;
use lodsmith::{Control, Measure, SimplifyError, SimplifyOptions, Stage, Stop, Verdict, simplify_with};

/// A control that prints the stages; the caller could also measure time and end the run here.
struct Stages;

impl Control for Stages {
    fn stage(&mut self, stage: Stage) {
        println!("{} ...", stage.name());
    }
    fn progress(&mut self, _done: f64) -> Verdict {
        Verdict::Continue
    }
}

fn main() -> Result<(), SimplifyError> {
    let mesh = shapes::blob(5, 1);
    let mut options = SimplifyOptions::new(Stop::ratio(0.1));
    options.measure = Measure::Always;
    let done = simplify_with(&mesh, &options, &mut Stages)?;

    let report = &done.report;
    println!("{} -> {} faces, stopped by {}", report.input_faces, report.faces, report.stopped_by.name());
    if let Some(measured) = &report.error.measured {
        let percent = |x: f64| x / report.error.diagonal * 100.0;
        println!(
            "rms {:.3} %, largest {:.3} % of the diagonal, in both directions",
            percent(measured.rms.symmetric),
            percent(measured.hausdorff.symmetric)
        );
    }
    for (why, count) in &report.refusals {
        println!("{count} collapses refused: {}", why.name());
    }
    Ok(())
}
