//! Benchmark of the longest time between two frames of the window while a file is opened, rotated and
//! simplified. `frame_gaps FILE` opens the window, simulates the mouse, prints a line for each phase and
//! exits.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use eframe::egui::{self, Event, PointerButton, Pos2, pos2};
use lodsmith_viewer::ViewOptions;
use lodsmith_viewer::app::App;
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::gpu::Context;

/// Phases of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Open,
    Rest,
    Turn,
    RestAgain,
    Simplify,
}

const PHASES: [Phase; 5] = [Phase::Open, Phase::Rest, Phase::Turn, Phase::RestAgain, Phase::Simplify];
/// Time for which the mouse rotates the model.
const TURN_TIME: Duration = Duration::from_secs(5);
/// Number of idle frames that end a phase.
const IDLE_FRAMES: usize = 4;

struct Watched {
    app: App,
    /// Index of the phase, and its start.
    phase: (usize, Instant),
    last: Instant,
    longest: f64,
    frames: u32,
    calm: usize,
}

impl Watched {
    fn is_over(&self) -> bool {
        let (document, since) = (self.app.document(), self.phase.1.elapsed());
        let is_idle = document.is_idle() && self.app.triangles_left() == 0;
        match PHASES[self.phase.0] {
            Phase::Open => document.original().is_some(),
            Phase::Turn => since > TURN_TIME,
            _ => is_idle && since > Duration::from_millis(600) && self.calm >= IDLE_FRAMES,
        }
    }

    fn next(&mut self, ctx: &egui::Context) {
        let (number, since) = self.phase;
        let (secs, ms) = (since.elapsed().as_secs_f64(), 1e3 * self.longest);
        let line =
            format!("{:?}: {secs:.2} s, {} frames, longest gap {ms:.0} ms", PHASES[number], self.frames);
        say(&line);
        (self.longest, self.frames, self.calm) = (0.0, 0, 0);
        self.phase = (number + 1, Instant::now());
        match PHASES.get(number + 1) {
            None => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Some(Phase::Simplify) => {
                let document = self.app.document_mut();
                document.run(Command::Target(SimplifyTarget::Ratio(0.1)));
                document.seal();
            }
            Some(_) => {}
        }
    }
}

impl eframe::App for Watched {
    fn raw_input_hook(&mut self, _: &egui::Context, input: &mut egui::RawInput) {
        let since = self.phase.1.elapsed().as_secs_f32();
        let at = |secs: f32| -> Pos2 { pos2(560.0 + 40.0 * secs, 420.0 + 30.0 * (2.0 * secs).sin()) };
        let button = |pressed| Event::PointerButton {
            pos: at(since),
            button: PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        match PHASES.get(self.phase.0) {
            Some(Phase::Turn) => {
                input.events.push(Event::PointerMoved(at(since)));
                if self.frames == 0 {
                    input.events.push(button(true));
                }
            }
            Some(Phase::RestAgain) if self.frames == 0 => input.events.push(button(false)),
            _ => {}
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let gap = self.last.elapsed().as_secs_f64();
        self.last = Instant::now();
        self.longest = self.longest.max(gap);
        self.app.ui(ui, frame);
        self.frames += 1;
        let is_still = self.app.document().is_idle() && self.app.triangles_left() == 0;
        self.calm = if is_still { self.calm + 1 } else { 0 };
        if self.phase.0 < PHASES.len() && self.is_over() {
            self.next(ui.ctx());
        }
        ui.ctx().request_repaint();
    }
}

fn main() {
    let mut options = ViewOptions {
        inputs: std::env::args().skip(1).map(PathBuf::from).collect(),
        ..ViewOptions::default()
    };
    (options.remember, options.use_system_dialogs) = (false, false);
    let mut native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default().with_inner_size([1440.0, 900.0]),
        renderer: eframe::Renderer::Wgpu,
        ..eframe::NativeOptions::default()
    };
    native.wgpu_options.wgpu_setup = Context::setup();
    let create: eframe::AppCreator<'_> = Box::new(move |cc| {
        let now = Instant::now();
        let app = App::new(cc, &options)?;
        Ok(Box::new(Watched { app, phase: (0, now), last: now, longest: 0.0, frames: 0, calm: 0 }))
    });
    let ended = eframe::run_native("frame_gaps", native, create);
    if let Err(why) = ended {
        say(&why.to_string());
    }
}

/// Prints a line.
fn say(line: &str) {
    drop(writeln!(std::io::stdout(), "{line}"));
}
