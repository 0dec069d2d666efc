//! Benchmark of frame times: tori of increasing triangle counts, and 500 copies. Prints a table.

use std::io::Write;
use std::time::Instant;

use glam::{DMat4, DVec3};
use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Model, shapes};
use lodsmith_render::{Camera, Lighting, Look, StandardView};
use lodsmith_viewer::gpu::{Frame, Gpu, GpuError, PlacedModel};

fn main() -> Result<(), GpuError> {
    let mut gpu = Gpu::headless()?;
    let mut out = std::io::stdout();
    let ms = |since: Instant| since.elapsed().as_secs_f64() * 1e3;
    drop(writeln!(
        out,
        "{}, 1024 x 768; ms: upload, replace, our thread for a frame, the frame",
        gpu.adapter_name()
    ));
    let mut target = gpu.target([1024, 768]);
    let bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
    let (pose, look, lighting) = (Pose::default(), Look::default(), Lighting::default());
    let frame = |k: usize| {
        let mut camera = Camera::fitting(&bounds, StandardView::Iso, 4.0 / 3.0);
        camera.eye.x += 0.01 * k as f64;
        Frame::new(&[], bounds, camera, &look, &lighting)
    };
    for n in [60, 230, 420] {
        let mesh = shapes::torus(n * 5 / 2, n / 4 * 5 / 2);
        let model = Model::of_mesh(mesh.clone());
        let start = Instant::now();
        let mut drawn = gpu.upload(&model);
        let upload = ms(start);
        let start = Instant::now();
        drawn.replace_mesh(0, &mesh);
        let replace = ms(start);
        let placed = [PlacedModel::new(&drawn, &pose)];
        let (mut own, mut whole) = (f64::MAX, f64::MAX);
        for k in 0..4 {
            let start = Instant::now();
            gpu.draw(&mut target, &Frame { models: &placed, ..frame(k) });
            own = own.min(ms(start));
            target.read_back();
            whole = whole.min(ms(start));
        }
        drop(writeln!(
            out,
            "{:>8} triangles {upload:8.1} {replace:8.1} {own:8.2} {whole:8.1}",
            model.face_count()
        ));
    }
    let levels: Vec<_> = [60, 30, 12].map(|n| gpu.upload(&Model::of_mesh(shapes::torus(n, n / 2)))).into();
    let placed: Vec<_> = (0..500)
        .map(|k| {
            let at = DVec3::new(f64::from(k % 25) - 12.0, 0.0, -f64::from(k / 25));
            let level = &levels[(k / 25) as usize * 3 / 20];
            PlacedModel {
                world_from_model: DMat4::from_translation(3.0 * at),
                ..PlacedModel::new(level, &pose)
            }
        })
        .collect();
    let (mut own, mut whole, mut last) = (f64::MAX, f64::MAX, None);
    for k in 0..4 {
        let start = Instant::now();
        last = Some(gpu.draw(&mut target, &Frame { models: &placed, ..frame(k) }));
        own = own.min(ms(start));
        target.read_back();
        whole = whole.min(ms(start));
    }
    drop(writeln!(out, "500 copies: {own:.2} of our thread, {whole:.1} in all; {last:?}"));
    Ok(())
}
