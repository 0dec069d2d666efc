//! Benchmark of walking through copies of a file, 500 by default: `cargo run -p lodsmith-viewer --example
//! walk -- FILE [COPIES]`. Prints triangles per frame and the time of the main thread; drawing itself is done
//! by the adapter.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::{self, Key};
use egui_kittest::Harness;
use lodsmith_viewer::ViewOptions;
use lodsmith_viewer::app::App;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::gpu::Context;
use lodsmith_viewer::stage::StageChange;
use lodsmith_viewer::stage::scatter::Scatter;

/// CPU time of this thread; wall time if the system does not provide it.
fn own_secs(since: Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanos = text.split_whitespace().next().and_then(|n| n.parse::<f64>().ok());
    nanos.map_or_else(|| since.elapsed().as_secs_f64(), |n| n * 1e-9)
}

fn main() -> Result<(), String> {
    let file = std::env::args_os().nth(1).map(PathBuf::from).ok_or("which file?")?;
    let count = std::env::args().nth(2).map_or(Ok(500), |n| n.parse()).map_err(|e| format!("copies: {e}"))?;
    let options = ViewOptions {
        inputs: vec![file],
        remember: false,
        use_system_dialogs: false,
        ..ViewOptions::default()
    };
    let mut harness = Harness::builder()
        .with_size(egui::vec2(1440.0, 900.0))
        .with_step_dt(1.0 / 30.0)
        .wgpu_setup(Context::setup())
        .build_eframe(move |cc| App::new(cc, &options).unwrap_or_else(|e| unreachable!("{e}")));
    let settle = |harness: &mut Harness<'static, App>| {
        harness.run_steps(2);
        while !harness.state_mut().document_mut().settle(Duration::from_secs(60)) {}
        harness.run_steps(2);
    };
    settle(&mut harness);
    let base = harness.state().document().stage_base().ok_or("there is nothing in it")?;
    let scatter = Scatter { count, footprint: base.footprint(), ..Scatter::default() };
    for change in [StageChange::Show(true), StageChange::Scatter(scatter)] {
        harness.state_mut().document_mut().run(Command::Stage(change));
    }
    settle(&mut harness);
    harness.key_press(Key::F);
    harness.run_steps(2);
    harness.key_press(Key::I);
    harness.run_steps(2);
    harness.key_down(Key::W);
    harness.key_down(Key::ArrowRight);
    let start = Instant::now();
    let (mut triangles, mut frame_ms, mut stage_ms) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..300 {
        // In waves through the middle, not in circles.
        if k % 40 == 0 {
            let (down, up) =
                [(Key::ArrowLeft, Key::ArrowRight), (Key::ArrowRight, Key::ArrowLeft)][k / 40 % 2];
            harness.key_up(up);
            harness.key_down(down);
        }
        let before = own_secs(start);
        harness.step();
        frame_ms.push(1e3 * (own_secs(start) - before));
        let facts = harness.state().stage_view().status();
        triangles.push(facts.chosen.triangles as f64);
        stage_ms.push(1e3 * facts.secs);
    }
    let mut out = std::io::stdout();
    for (name, mut values) in [
        ("triangles in sight", triangles),
        ("frame, own thread, ms", frame_ms),
        ("levels and draw calls, ms", stage_ms),
    ] {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
        let line = format!("{name:>26}: median {:.1}, 99 % {:.1}, most {:.1}", at(0.5), at(0.99), at(1.0));
        writeln!(out, "{line}").map_err(|e| e.to_string())?;
    }
    Ok(())
}
