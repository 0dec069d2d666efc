//! Benchmark of the longest time between two frames of the window while a file is opened, rotated and
//! simplified: by dragging the slider, by holding M, and in one run. `frame_gaps FILE` opens the window,
//! simulates mouse and keys, prints a line for each phase and exits.

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
    Slide,
    RestAfterSlide,
    Hold,
    RestAfterHold,
    Simplify,
}

const PHASES: [Phase; 9] = [
    Phase::Open,
    Phase::Rest,
    Phase::Turn,
    Phase::RestAgain,
    Phase::Slide,
    Phase::RestAfterSlide,
    Phase::Hold,
    Phase::RestAfterHold,
    Phase::Simplify,
];
/// Time for which the mouse rotates the model or drags the slider, or M is held.
const INPUT_TIME: Duration = Duration::from_secs(5);
/// Height of the slider in the window of the benchmark, and its ends.
const SLIDER_Y: f32 = 869.0;
const SLIDER_X: [f32; 2] = [330.0, 1110.0];
/// Number of idle frames that end a phase.
const IDLE_FRAMES: usize = 4;

struct Watched {
    app: App,
    /// Index of the phase, and its start.
    phase: (usize, Instant),
    last: Instant,
    longest: f64,
    frames: u32,
    /// Number of frames that show another result than the one before.
    results: u32,
    faces: Option<usize>,
    calm: usize,
}

impl Watched {
    fn is_over(&self) -> bool {
        let (document, since) = (self.app.document(), self.phase.1.elapsed());
        let is_idle = document.is_idle() && self.app.triangles_left() == 0;
        match PHASES[self.phase.0] {
            Phase::Open => document.original().is_some(),
            Phase::Turn | Phase::Slide | Phase::Hold => since > INPUT_TIME,
            _ => is_idle && since > Duration::from_millis(600) && self.calm >= IDLE_FRAMES,
        }
    }

    fn next(&mut self, ctx: &egui::Context) {
        let (number, since) = self.phase;
        let (secs, ms) = (since.elapsed().as_secs_f64(), 1e3 * self.longest);
        let line =
            format!("{:?}: {secs:.2} s, {} frames, longest gap {ms:.0} ms", PHASES[number], self.frames);
        let faces = self.faces.map_or(String::new(), |n| format!(", at {n} faces"));
        let results = match self.results {
            0 => String::new(),
            n => format!(", {n} results: {:.1} per second{faces}", f64::from(n) / secs),
        };
        say(&(line + &results));
        (self.longest, self.frames, self.results, self.calm) = (0.0, 0, 0, 0);
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
        let modifiers = egui::Modifiers::NONE;
        let button =
            |pos, pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
        let key =
            |pressed| Event::Key { key: egui::Key::M, physical_key: None, pressed, repeat: false, modifiers };
        // From the right end to the left one and back, once.
        let share = 2.0 * since / INPUT_TIME.as_secs_f32();
        let share = if share > 1.0 { 2.0 - share } else { share };
        let on_slider = pos2(SLIDER_X[1] + (SLIDER_X[0] - SLIDER_X[1]) * share, SLIDER_Y);
        let is_first = self.frames == 0;
        match PHASES.get(self.phase.0) {
            Some(Phase::Turn) => {
                input.events.push(Event::PointerMoved(at(since)));
                input.events.extend(is_first.then(|| button(at(since), true)));
            }
            Some(Phase::RestAgain) if is_first => input.events.push(button(at(since), false)),
            Some(Phase::Slide) => {
                input.events.push(Event::PointerMoved(on_slider));
                input.events.extend(is_first.then(|| button(on_slider, true)));
            }
            Some(Phase::RestAfterSlide) if is_first => {
                input.events.push(button(pos2(SLIDER_X[1], SLIDER_Y), false));
            }
            Some(Phase::Hold) if is_first => input.events.push(key(true)),
            Some(Phase::RestAfterHold) if is_first => input.events.push(key(false)),
            _ => {}
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let gap = self.last.elapsed().as_secs_f64();
        self.last = Instant::now();
        self.longest = self.longest.max(gap);
        self.app.ui(ui, frame);
        self.frames += 1;
        let faces = self.app.document().lighter().map(|l| l.content.faces);
        self.results += u32::from(faces != self.faces);
        self.faces = faces;
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
        Ok(Box::new(Watched {
            app,
            phase: (0, now),
            last: now,
            longest: 0.0,
            frames: 0,
            results: 0,
            faces: None,
            calm: 0,
        }))
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
