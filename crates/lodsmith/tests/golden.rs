//! Golden reports. Update them with `cargo xtask goldens`, then review the difference.

use std::fmt::Write as _;

use lodsmith::core::shapes;
use lodsmith::{Measure, MethodKind, SimplifyOptions, Stop, simplify};

#[test]
fn golden_reports() {
    let mut text = String::new();
    for name in ["cube", "fine_cube", "blob", "torus", "cylinder", "wavy_sheet", "two_far_parts", "soup"] {
        let mesh = shapes::all().into_iter().find(|s| s.0 == name).unwrap().1;
        for method in [MethodKind::Memoryless, MethodKind::Quadric] {
            for share in [0.5, 0.1] {
                let mut options = SimplifyOptions::new(Stop::ratio(share));
                (options.method, options.measure) = (method.into(), Measure::Always);
                let report = simplify(&mesh, &options).unwrap().report;
                let percent = |x: f64| format!("{:.2}", x / report.error.diagonal * 100.0);
                let measured = report.error.measured.as_ref().unwrap();
                writeln!(
                    text,
                    "{name} {} -> {} faces, {} vertices, {method:?}, {}{}; estimate {} %, rms {} %, max {:.1} %",
                    report.input_faces,
                    report.faces,
                    report.vertices,
                    report.stopped_by.name(),
                    if report.reached { "" } else { ", not reached" },
                    percent(report.error.estimate),
                    percent(measured.rms.symmetric),
                    measured.hausdorff.symmetric / report.error.diagonal * 100.0,
                )
                .unwrap();
            }
        }
    }
    insta::assert_snapshot!(text);
}
