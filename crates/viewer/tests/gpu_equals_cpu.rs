//! Pictures of the graphics passes. They need an adapter; one that computes on the processor will do.
//!
//! Without any they say so and pass, unless `LODSMITH_REQUIRE_GPU` is set.

use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Image, Model, shapes};
use lodsmith_render::{Background, Camera, Lighting, Look, StandardView};
use lodsmith_viewer::gpu::{Context, Frame, Gpu, Placed};

/// What draws; `None` where nothing can and nobody insists.
fn gpu() -> Option<Gpu> {
    match Context::headless() {
        Ok(context) => Some(Gpu::on(context)),
        Err(e) if std::env::var_os("LODSMITH_REQUIRE_GPU").is_some() => panic!("{e}"),
        Err(e) => {
            std::io::Write::write_all(&mut std::io::stderr(), format!("SKIPPED: {e}\n").as_bytes()).ok();
            None
        }
    }
}

fn bounds(model: &Model) -> Bounds {
    model.meshes[0].mesh.positions().view().bounds().unwrap()
}

fn covered(image: &Image) -> usize {
    image.pixels().iter().filter(|p| p[3] > 127).count()
}

#[test]
fn a_ball_is_drawn_once() {
    let Some(mut gpu) = gpu() else { return };
    let model = Model::of_mesh(shapes::icosphere(4));
    let drawn = gpu.upload(&model);
    let pose = Pose::default();
    let mut target = gpu.target([200, 100]);
    let bounds = bounds(&model);
    let look = Look::default();
    let placed = [Placed::new(&drawn, &pose)];
    let camera = Camera::fitting(&bounds, StandardView::Iso, 2.0);
    let frame = Frame {
        models: &placed,
        bounds,
        camera,
        look: &look,
        lighting: &Lighting::default(),
        background: Background::Transparent,
        ground: false,
        matcap: None,
        shader: None,
    };
    let first = gpu.draw(&mut target, &frame);
    assert!(first.drawn && first.triangles == model.face_count() as u64, "{first:?}");
    assert!(!gpu.draw(&mut target, &frame).drawn, "the same frame again");
    let image = target.read_back();
    // A ball inside the box whose corners' ball fills the height: 1 / sqrt(3) of it, a little less for its distance.
    let disc = std::f64::consts::PI * (50.0f64 / 3f64.sqrt()).powi(2);
    let share = covered(&image) as f64 / disc;
    assert!((0.85..1.1).contains(&share), "{share} of the disc");
    if let Some(path) = std::env::var_os("LODSMITH_PICTURES") {
        let bytes: &[u8] = bytemuck::cast_slice(image.pixels());
        image::save_buffer(path, bytes, 200, 100, image::ColorType::Rgba8).unwrap();
    }
    let look = Look { wireframe: true, ..look.clone() };
    assert!(gpu.draw(&mut target, &Frame { look: &look, ..frame }).drawn, "another look");
}
