//! Benchmark of the slider: time until its preview is ready, and time of a jump. `slider_times FILE...`, with
//! an adapter if there is one. Prints a line for each file.

use std::io::Write;
use std::path::PathBuf;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use lodsmith_core::model::Pose;
use lodsmith_render::{Camera, Lighting, Look, StandardView};
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::document::Document;
use lodsmith_viewer::gpu::{Frame, Gpu, PlacedModel};

/// Number of jumps of each kind.
const JUMPS: usize = 40;

fn main() {
    let mut gpu = Gpu::headless().ok();
    let mut out = std::io::stdout();
    let adapter = gpu.as_ref().map_or_else(|| "no adapter".to_owned(), Gpu::adapter_name);
    drop(writeln!(out, "{adapter}; ms of a jump, mean and longest: anywhere; 2 % on"));
    for path in std::env::args().skip(1).map(PathBuf::from) {
        let begin = Instant::now();
        let mut document = Document::new(gpu.as_ref().map(|g| g.context().clone()), || {});
        document.run(Command::Open(vec![path.clone()]));
        while document.opening().is_some() {
            document.settle(Duration::from_millis(5));
        }
        let opened = begin.elapsed().as_secs_f64();
        let is_done = document.settle(Duration::from_secs(600));
        let Some(faces) =
            document.original().map(|o| o.content.faces).filter(|_| is_done && document.has_preview())
        else {
            drop(writeln!(out, "{}: no progressive mesh", path.display()));
            continue;
        };
        let ready = begin.elapsed().as_secs_f64();
        let mut times = |count: &dyn Fn(usize) -> usize| {
            let (mut sum, mut longest) = (0.0, 0f64);
            for k in 0..JUMPS {
                let target = Command::Target(SimplifyTarget::Faces(count(k).clamp(4, faces - 1)));
                let start = Instant::now();
                document.run(target);
                let ms = start.elapsed().as_secs_f64() * 1e3;
                (sum, longest) = (sum + ms, longest.max(ms));
                flush(gpu.as_mut(), &document);
            }
            format!("{:7.1} {longest:7.1}", sum / JUMPS as f64)
        };
        // Steps of the golden ratio cover the whole range.
        let anywhere = times(&|k| ((k as f64 * 0.618_034).fract() * faces as f64) as usize);
        let near = times(&|k| (faces as f64 * 0.5 * 0.98f64.powi(k as i32)) as usize);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        drop(writeln!(
            out,
            "{name:24} {faces:>9} faces; open {opened:6.2} s, progressive mesh {:6.2} s; {anywhere}; {near}",
            ready - opened
        ));
    }
}

/// Draws a frame, which uploads the patched buffers to the GPU.
fn flush(gpu: Option<&mut Gpu>, document: &Document) {
    let drawing = document.lighter().and_then(|l| l.draw.clone());
    let (Some(gpu), Some(drawing), Some(original)) = (gpu, drawing, document.original()) else { return };
    let model = drawing.lock().unwrap_or_else(PoisonError::into_inner);
    let bounds = original.content.bounds;
    let (pose, look, lighting) = (Pose::default(), Look::default(), Lighting::default());
    let mut target = gpu.target([16, 16]);
    let camera = Camera::fitting(&bounds, StandardView::Iso, 1.0);
    gpu.draw(&mut target, &Frame::new(&[PlacedModel::new(&model, &pose)], bounds, camera, &look, &lighting));
    target.read_back();
}
