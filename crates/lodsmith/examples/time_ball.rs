//! Prints the time of each run of the engine on a sphere of a million triangles, in seconds: `time_ball
//! RUNS`. The benchmark of the Python package compares its own times with these.
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::time::Instant;

use lodsmith::core::shapes;
use lodsmith::{NoControl, SimplifyOptions, Stop, simplify_with};

fn main() {
    let runs = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(5);
    let mesh = shapes::icosphere(8);
    let surface = mesh.surface();
    for _ in 0..runs {
        let begin = Instant::now();
        let done = simplify_with(surface.clone(), &SimplifyOptions::new(Stop::ratio(0.1)), &mut NoControl);
        let seconds = begin.elapsed().as_secs_f64();
        assert!(done.is_ok_and(|done| done.report.reached), "a sphere can have any number of triangles");
        println!("{seconds}");
    }
}
