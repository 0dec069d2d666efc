//! Small scenes compared with reference pictures in `tests/pictures`, by a metric with a tolerance.
//!
//! After a change that is meant to be visible:
//! `UPDATE_PICTURES=1 cargo test -p lodsmith-render --test all pictures::`, then inspect them.

use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use lodsmith_core::model::{Material, Sampler, TextureRef, Transform};
use lodsmith_core::{Image, Model, shapes};
use lodsmith_render::{
    Background, Ground, Look, PictureFormat, Shading, StandardView, Subject, View, decode, encode, render,
};

/// Largest root of the mean squared difference of bytes: rounding differs between processors by one here and
/// there.
const TOLERANCE: f64 = 1.0;

#[track_caller]
fn check(name: &str, picture: &Image) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures").join(format!("{name}.png"));
    if std::env::var_os("UPDATE_PICTURES").is_some() {
        std::fs::write(&path, encode(picture, PictureFormat::Png).unwrap()).unwrap();
    }
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let wanted = decode(&bytes).unwrap();
    assert_eq!((wanted.width(), wanted.height()), (picture.width(), picture.height()), "{name}");
    let pairs = wanted.pixels().as_flattened().iter().zip(picture.pixels().as_flattened());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
    let difference = (sum / (4 * wanted.pixels().len()) as f64).sqrt();
    assert!(difference <= TOLERANCE, "{name}: {difference} off {}", path.display());
}

fn view(subject: &Subject) -> View {
    View::of(&subject.bounds().unwrap(), StandardView::Iso, 96, 72)
}

#[test]
fn plain_shadings() {
    let subject = Subject::of_mesh(shapes::torus(32, 16)).unwrap();
    let mut view = view(&subject);
    for shading in [Shading::Smooth, Shading::Flat, Shading::Normals, Shading::Matcap] {
        view.look.shading = shading;
        check(shading.name(), &render(&subject, &view).unwrap());
    }
}

#[test]
fn heat_and_lines() {
    let mesh = shapes::grid_with_holes(12);
    let values = (0..mesh.vertex_count()).map(|i| i as f32).collect();
    let subject = Subject::of_mesh(mesh).unwrap().with_values(vec![values]).unwrap();
    let mut view = view(&subject);
    view.look = Look { shading: Shading::Heat, wireframe: true, borders: true, ..Look::default() };
    check("heat_with_lines", &render(&subject, &view).unwrap());
}

#[test]
fn a_material_on_a_turned_model_over_its_ground() {
    let mut cube = shapes::cube(1);
    let uvs = cube.positions().view().iter().map(|p| [p[0] as f32 + p[2] as f32, p[1] as f32]).collect();
    cube.set_uvs(Some(uvs)).unwrap();
    let mut model = Model::of_mesh(cube);
    let sampler = Sampler::default();
    let texture = TextureRef { image: 0, uv_set: 0, transform: TextureRef::PLAIN, sampler };
    let (metallic, roughness) = (0.6, 0.4);
    let material = Material { base_color_texture: Some(texture), metallic, roughness, ..Material::default() };
    model.materials.push(material);
    model.meshes[0].materials = vec![Some(0)];
    let pixels =
        (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { [230, 180, 60, 255] } else { [60, 90, 160, 255] });
    model.images.push(Arc::new(Image::new(8, 8, pixels.collect())));
    let (translation, rotation) = (DVec3::new(5.0, 0.0, 2.0), DQuat::from_rotation_y(0.5));
    model.nodes[0].transform = Transform::Parts { translation, rotation, scale: DVec3::ONE };
    let subject = Subject::new(&model).unwrap();
    let mut view = view(&subject);
    view.look.shading = Shading::Textured;
    view.background = Background::Color([0.8, 0.82, 0.85]);
    view.ground = Ground { grid: true, shadow: true };
    view.occlusion = true;
    view.fine = true;
    check("textured_on_ground", &render(&subject, &view).unwrap());
}
