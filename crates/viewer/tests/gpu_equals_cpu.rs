//! Compares each GPU pass with the CPU renderer's picture of the same scene. Needs an adapter; a software
//! adapter is sufficient. Without one the tests print a note and pass, unless `LODSMITH_REQUIRE_GPU` is set.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::mesh::creases::Creases;
use lodsmith_core::model::{AlphaMode, Material, Node, Pose, Skin, TextureRef, Transform};
use lodsmith_core::{
    Attribute, Bounds, Image, Model, Morphed, RegionId, Semantic, TriMesh, VertexId, shapes,
};
use lodsmith_render::{
    Background, Camera, Environment, Lens, Light, LightKind, Lighting, Look, Shading, StandardView, Subject,
    View, render,
};
use lodsmith_viewer::content::{Lighter, Original};
use lodsmith_viewer::gpu::{BufferLimits, Frame, Gpu, Marks, PlacedModel, TINTS};
use lodsmith_viewer::settings::playback::Playback;
use lodsmith_viewer::settings::simplification::Simplification;

use crate::adapter;

const SIZE: [u32; 2] = [240, 200];

fn gpu() -> Option<Gpu> {
    adapter::context().map(Gpu::on)
}

/// Returns a renderer whose vertices pull from buffers, if there is one, and one that pulls from textures, as
/// in WebGL.
fn gpus() -> Vec<Gpu> {
    let contexts = adapter::context().into_iter().flat_map(|c| [c.clone(), c.with_vertex_textures()]);
    contexts.map(Gpu::on).collect()
}

/// A scene that both renderers can draw.
struct Scene {
    name: &'static str,
    model: Model,
    look: Look,
    lighting: Lighting,
    background: Background,
    ground: bool,
    camera: Camera,
    heat: Option<Vec<f32>>,
    environment: Option<Arc<Environment>>,
    max_difference: f64,
}

impl Scene {
    fn new(name: &'static str, mesh: TriMesh, shading: Shading) -> Self {
        let model = Model::of_mesh(mesh);
        let camera =
            Camera::fitting(&bounds(&model), StandardView::Iso, f64::from(SIZE[0]) / f64::from(SIZE[1]));
        Self {
            name,
            model,
            look: Look { shading, ..Look::default() },
            lighting: Lighting::default(),
            background: Background::default(),
            ground: false,
            camera,
            heat: None,
            environment: None,
            max_difference: 1.5,
        }
    }

    fn on_cpu(&self) -> Image {
        let mut subject = Subject::new(&self.model).unwrap();
        if let Some(heat) = &self.heat {
            subject = subject.with_values(vec![heat.clone()]).unwrap();
        }
        let mut view = View::new(self.camera, SIZE[0] as usize, SIZE[1] as usize);
        view.look = self.look.clone();
        view.lighting = self.lighting.clone();
        view.background = self.background;
        view.ground.grid = self.ground;
        view.environment = self.environment.clone();
        render(&subject, &view).unwrap()
    }

    fn on_gpu(&self, gpu: &mut Gpu) -> Image {
        let mut drawn = gpu.upload(&self.model);
        let mesh = &self.model.meshes[0].mesh;
        if let Some(heat) = &self.heat {
            drawn.set_heat(0, Some(heat));
        }
        if self.look.borders || self.look.defects {
            drawn.set_marks(0, &Marks::find(mesh));
        }
        // Software adapters have no multisampling: render at double resolution instead, for the same
        // smoothness.
        let mut target = gpu.target(SIZE);
        target.resize(SIZE, if gpu.is_software() { 2.0 } else { 1.0 });
        let pose = Pose::default();
        let placed = [PlacedModel::new(&drawn, &pose)];
        let environment = self.environment.as_ref().map(|e| gpu.environment(e));
        let frame = Frame { environment: environment.as_ref(), ..self.frame(&placed) };
        gpu.draw(&mut target, &frame);
        let image = target.read_back();
        if target.size() == SIZE { image } else { halved(&image) }
    }

    fn frame<'a>(&'a self, placed: &'a [PlacedModel<'a>]) -> Frame<'a> {
        Frame {
            models: placed,
            bounds: bounds(&self.model),
            camera: self.camera,
            look: &self.look,
            lighting: &self.lighting,
            background: self.background,
            ground: self.ground,
            matcap: None,
            environment: None,
            marks_stand_out: false,
            shader: None,
        }
    }
}

fn bounds(model: &Model) -> Bounds {
    Subject::new(model).unwrap().bounds().unwrap()
}

/// Halves the resolution: each pixel is the mean of four in linear light.
fn halved(image: &Image) -> Image {
    let light = |b: u8| (f64::from(b) / 255.0).powf(2.2);
    let (w, h) = (image.width() / 2, image.height() / 2);
    let pixels = (0..w * h).map(|i| {
        let (x, y) = (2 * (i % w), 2 * (i / w));
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| image.at(x + i, y + j));
        [0, 1, 2, 3].map(|k| {
            let mean =
                four.iter().map(|p| if k < 3 { light(p[k]) } else { f64::from(p[k]) }).sum::<f64>() / 4.0;
            (if k < 3 { mean.powf(1.0 / 2.2) * 255.0 } else { mean }).round() as u8
        })
    });
    Image::new(w, h, pixels.collect())
}

/// Returns the mean difference over all channels, from 0 to 255; pixels transparent in both count as equal.
fn difference(a: &Image, b: &Image) -> f64 {
    let pixel = |(p, q): (&[u8; 4], &[u8; 4])| -> f64 {
        let seen = |p: &[u8; 4]| {
            [0, 1, 2, 3].map(|k| f64::from(p[k]) * if k < 3 { f64::from(p[3]) / 255.0 } else { 1.0 })
        };
        let (p, q) = (seen(p), seen(q));
        (0..4).map(|k| (p[k] - q[k]).abs()).sum::<f64>() / 4.0
    };
    a.pixels().iter().zip(b.pixels()).map(pixel).sum::<f64>() / a.pixels().len() as f64
}

fn keep(name: &str, image: &Image) {
    if let Some(folder) = std::env::var_os("LODSMITH_PICTURES") {
        let path = std::path::Path::new(&folder).join(format!("{name}.png"));
        let (w, h) = (image.width() as u32, image.height() as u32);
        image::save_buffer(path, bytemuck::cast_slice(image.pixels()), w, h, image::ColorType::Rgba8)
            .unwrap();
    }
}

/// A sheet with texture coordinates and a material.
fn textured(name: &'static str, material: Material) -> Scene {
    let mut mesh = shapes::wavy_sheet(24);
    let b = mesh.positions().view().bounds().unwrap();
    let uv = |p: [f64; 3]| {
        let t = [0, 1, 2].map(|k| (p[k] - b.min[k]) / (b.max[k] - b.min[k]).max(1e-9));
        [t[0] as f32, (if b.max[1] - b.min[1] > b.max[2] - b.min[2] { t[1] } else { t[2] }) as f32]
    };
    let uvs = mesh.positions().view().iter().map(uv).collect();
    mesh.set_uvs(Some(uvs)).unwrap();
    let mut scene = Scene::new(name, mesh, Shading::Textured);
    let image = |f: fn(usize, usize) -> [u8; 4]| {
        Arc::new(Image::new(64, 64, (0..64 * 64).map(|i| f(i % 64, i / 64)).collect()))
    };
    scene.model.images = vec![
        image(|x, y| if (x / 8 + y / 8) % 2 == 0 { [230, 60, 40, 255] } else { [30, 120, 220, 90] }),
        image(|x, y| {
            [128 + (40.0 * (x as f32 * 0.4).sin()) as u8, 128, if y % 16 < 8 { 240 } else { 200 }, 255]
        }),
        image(|x, _| [255, (4 * x) as u8, 255 - (4 * x) as u8, 255]),
    ];
    scene.model.materials = vec![material];
    scene.model.meshes[0].materials = vec![Some(0)];
    scene
}

fn texture(image: usize) -> Option<TextureRef> {
    let transform = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    Some(TextureRef { image, uv_set: 0, transform, sampler: Default::default() })
}

fn scenes() -> Vec<Scene> {
    let mut all = Vec::new();
    for shading in [Shading::Smooth, Shading::Flat, Shading::Normals, Shading::Matcap] {
        all.push(Scene::new(shading.name(), shapes::blob(4, 7), shading));
    }
    let mut colors = shapes::blob(3, 3);
    let color = |i: usize| [(i % 7) as f32 / 6.0, (i % 3) as f32 / 2.0, 0.4, 1.0];
    colors.set_colors(Some((0..colors.wedge_count()).map(color).collect())).unwrap();
    all.push(Scene::new("vertex-colors", colors, Shading::VertexColors));
    let mut heat = Scene::new("heat", shapes::torus(40, 20), Shading::Heat);
    let count = heat.model.meshes[0].mesh.vertex_count();
    heat.heat = Some((0..count).map(|i| (i as f32 * 0.05).sin().abs()).collect());
    all.push(heat);
    // Without normals, and with sharp edges: wedges of the mesh have copies on the GPU.
    for (name, shading) in [("sharp-edges", Shading::Smooth), ("sharp-edges-heat", Shading::Heat)] {
        let mut sharp = Scene::new(name, shapes::cube(4), shading);
        let count = sharp.model.meshes[0].mesh.vertex_count();
        sharp.heat = (shading == Shading::Heat).then(|| (0..count).map(|i| (i % 9) as f32 / 8.0).collect());
        all.push(sharp);
    }
    let mut wire = Scene::new("wireframe", shapes::icosphere(2), Shading::Smooth);
    wire.look.wireframe = true;
    wire.look.wire_width_px = 1.5;
    wire.max_difference = 2.5;
    all.push(wire);
    let mut marks = Scene::new("borders-and-defects", shapes::grid_with_holes(12), Shading::Flat);
    (marks.look.borders, marks.look.defects, marks.max_difference) = (true, true, 2.5);
    all.push(marks);
    let mut book = Scene::new("non-manifold", shapes::book(4), Shading::Flat);
    (book.look.borders, book.look.defects, book.max_difference) = (true, true, 2.5);
    all.push(book);
    let mut ground = Scene::new("ground", shapes::cube(4), Shading::Flat);
    (ground.ground, ground.max_difference) = (true, 2.5);
    all.push(ground);
    let mut clear = Scene::new("transparent", shapes::torus(30, 12), Shading::Smooth);
    (clear.background, clear.look.cull_back) = (Background::Transparent, true);
    all.push(clear);
    let mut parallel = Scene::new("parallel", shapes::cylinder(24, 4), Shading::Smooth);
    parallel.camera.lens = Lens::Parallel { height: 3.0 };
    parallel.camera = parallel.camera.framing(&bounds(&parallel.model), 1.2);
    (parallel.ground, parallel.max_difference) = (true, 2.5);
    all.push(parallel);
    let mut lights = Scene::new("lights", shapes::blob(4, 5), Shading::Smooth);
    let at = |x, y, z| glam::Vec3::new(x, y, z);
    let light = |kind, color, in_world| Light { kind, color, in_world };
    lights.lighting.lights = vec![
        light(LightKind::Point { at: at(1.4, 0.6, 0.9) }, [1.2, 0.3, 0.2], true),
        light(LightKind::Directional { to_light: at(-1.0, 0.4, 0.2) }, [0.1, 0.2, 0.6], true),
        light(
            LightKind::Spot { at: at(0.0, 2.0, 0.5), toward: at(0.0, 0.0, 0.0), half_angle_rad: 0.35 },
            [2.0, 2.0, 1.5],
            false,
        ),
    ];
    all.push(lights);
    let mut far = Scene::new("far-away", shapes::blob(4, 7), Shading::Smooth);
    let mut mesh = (*far.model.meshes[0].mesh).clone();
    let points: Vec<[f64; 3]> =
        mesh.positions().view().iter().map(|p| [p[0] + 3e7, p[1] - 1e7, p[2] + 2e7]).collect();
    let faces = mesh.surface().triangles().to_vec();
    mesh = TriMesh::new(lodsmith_core::Positions::F64(points), faces).unwrap();
    far.model = Model::of_mesh(mesh);
    far.camera = Camera::fitting(&bounds(&far.model), StandardView::Iso, 1.2);
    all.push(far);

    let base = Material { base_color_texture: texture(0), double_sided: true, ..Material::default() };
    all.push(textured("textured", base.clone()));
    let rough = Material {
        metallic: 1.0,
        metallic_roughness_texture: texture(2),
        normal_texture: texture(1),
        emissive: [0.1, 0.0, 0.05],
        ..base.clone()
    };
    all.push(textured("metal-and-normal-map", rough));
    all.push(textured("masked", Material { alpha: AlphaMode::Mask(0.5), ..base.clone() }));
    all.push(textured("blended", Material { alpha: AlphaMode::Blend, ..base.clone() }));
    all.push(textured("unlit", Material { unlit: true, ..base }));

    let of =
        |metallic, roughness| Material { metallic, roughness, double_sided: true, ..Material::default() };
    // A different colour in each direction.
    let side = |i: usize| glam::Vec3::from([3, 5, 6].map(|k| ((i * k) % 7) as f32 / 4.0));
    let colored = Arc::new(Environment::of_light(4, 3, &(0..12).map(side).collect::<Vec<_>>()));
    let studio = Arc::new(Environment::studio());
    for (name, material, around) in [
        ("metal-in-a-studio", of(1.0, 0.15), &studio),
        ("gloss-among-colors", of(0.0, 0.3), &colored),
        ("metal-among-colors", of(1.0, 0.0), &colored),
        ("half-of-each", of(0.5, 0.7), &colored),
    ] {
        all.push(Scene { environment: Some(around.clone()), ..textured(name, material) });
    }
    let behind = |name, blurred| Scene {
        environment: Some(colored.clone()),
        background: Background::Environment { blurred },
        ..textured(name, of(0.5, 0.3))
    };
    all.push(Scene { ground: true, ..behind("surroundings-behind", false) });
    all.push(behind("surroundings-blurred", true));
    let mut parallel = behind("surroundings-behind-a-parallel-view", false);
    parallel.camera.lens = Lens::Parallel { height: 3.0 };
    all.push(parallel);
    let mut none = behind("no-surroundings-behind", true);
    none.environment = None;
    all.push(none);
    all
}

#[test]
fn every_pass_draws_what_the_processor_draws() {
    gpus().into_iter().for_each(every_pass_draws_what_the_processor_draws_on);
}

fn every_pass_draws_what_the_processor_draws_on(mut gpu: Gpu) {
    let mut wrong = Vec::new();
    for scene in scenes() {
        let (cpu, own) = (scene.on_cpu(), scene.on_gpu(&mut gpu));
        keep(&format!("{}-cpu", scene.name), &cpu);
        keep(&format!("{}-gpu", scene.name), &own);
        let difference = difference(&cpu, &own);
        if difference.is_nan() || difference > scene.max_difference {
            wrong.push(format!("{}: {difference:.2} of at most {}", scene.name, scene.max_difference));
        }
        let empty = Image::filled(cpu.width(), cpu.height(), cpu.at(0, 0));
        assert!(
            self::difference(&cpu, &empty) > 2.0 * scene.max_difference,
            "{}: there is something to see",
            scene.name
        );
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_frame_is_drawn_once() {
    let Some(mut gpu) = gpu() else { return };
    let scene = Scene::new("once", shapes::icosphere(4), Shading::Smooth);
    let mut drawn = gpu.upload(&scene.model);
    let pose = Pose::default();
    let mut target = gpu.target(SIZE);
    {
        let placed = [PlacedModel::new(&drawn, &pose)];
        let first = gpu.draw(&mut target, &scene.frame(&placed));
        assert!(first.drawn && first.triangles == scene.model.face_count() as u64, "{first:?}");
        assert!(!gpu.draw(&mut target, &scene.frame(&placed)).drawn, "the same frame again");
        assert!(target.shows(&scene.frame(&placed)));
        let look = Look { wireframe: true, ..scene.look.clone() };
        assert!(!target.shows(&Frame { look: &look, ..scene.frame(&placed) }));
        assert!(gpu.draw(&mut target, &Frame { look: &look, ..scene.frame(&placed) }).drawn, "another look");
        assert!(gpu.draw(&mut target, &scene.frame(&placed)).drawn, "and back");
        target.resize(SIZE, 1.0);
        assert!(!gpu.draw(&mut target, &scene.frame(&placed)).drawn, "the same size");
    }
    drawn.replace_mesh(0, &shapes::cube(3));
    let placed = [PlacedModel::new(&drawn, &pose)];
    assert!(gpu.draw(&mut target, &scene.frame(&placed)).drawn, "another mesh");
}

#[test]
fn a_mesh_in_the_buffers_of_another_looks_like_a_new_one_and_nothing_is_left_behind() {
    gpus()
        .into_iter()
        .for_each(a_mesh_in_the_buffers_of_another_looks_like_a_new_one_and_nothing_is_left_behind_on);
}

fn a_mesh_in_the_buffers_of_another_looks_like_a_new_one_and_nothing_is_left_behind_on(mut gpu: Gpu) {
    let scene = Scene::new("replaced", shapes::blob(4, 7), Shading::Smooth);
    let fresh = scene.on_gpu(&mut gpu);
    let mut drawn = gpu.upload(&Model::of_mesh(shapes::torus(50, 30)));
    let mut target = gpu.target(SIZE);
    target.resize(SIZE, if gpu.is_software() { 2.0 } else { 1.0 });
    let pose = Pose::default();
    let mut counts = Vec::new();
    for round in 0..12 {
        drawn.replace_mesh(0, &shapes::torus(20 + 3 * (round % 5), 12));
        drawn.replace_mesh(0, &scene.model.meshes[0].mesh);
        let placed = [PlacedModel::new(&drawn, &pose)];
        gpu.draw(&mut target, &scene.frame(&placed));
        let image = target.read_back();
        let image = if target.size() == SIZE { image } else { halved(&image) };
        assert!(difference(&fresh, &image) == 0.0, "round {round}");
        counts.extend(gpu.context().resource_counts());
    }
    assert!(counts.windows(2).skip(3).all(|c| c[0] == c[1]), "{counts:?}");
}

#[test]
fn a_patched_mesh_looks_like_a_new_one() {
    gpus().into_iter().for_each(a_patched_mesh_looks_like_a_new_one_on);
}

fn a_patched_mesh_looks_like_a_new_one_on(mut gpu: Gpu) {
    // (Whether edges are sharp is decided once, for the original.)
    gpu.context().set_creases(Creases::Off);
    let own = |mut mesh: TriMesh| {
        let view = mesh.positions().view();
        let outward = |p| DVec3::from(p).normalize_or_zero().as_vec3().to_array();
        let normals: Vec<[f32; 3]> = view.iter().map(outward).collect();
        mesh.set_normals(Some(normals)).unwrap();
        mesh
    };
    for with_normals in [true, false] {
        let as_asked = |mesh: TriMesh| if with_normals { own(mesh) } else { mesh };
        let before = as_asked(shapes::icosphere(3));
        // A dent with fewer faces; then back again to more.
        let mut dented = shapes::icosphere(3);
        dented.map_positions(|p| if p[0] > 0.6 { [0.6, p[1], p[2]] } else { p });
        let faces = dented.surface().triangles()[..900].to_vec();
        let after = as_asked(TriMesh::new(dented.positions().clone(), faces).unwrap());
        let moved: Vec<usize> = (0..before.vertex_count())
            .filter(|&v| before.positions().view().iter().nth(v).unwrap()[0] > 0.6)
            .collect();
        let ranges: Vec<_> = moved.iter().map(|&v| v..v + 1).collect();
        let all = 0..before.face_count();
        let mut drawn = gpu.upload(&Model::of_mesh(before.clone()));
        assert!(drawn.patch_mesh(0, &after, &[], &ranges));
        assert_eq!(drawn.face_count(0), 900);
        let scene = Scene::new("patched", after.clone(), Shading::Smooth);
        let picture = |gpu: &mut Gpu, drawn: &lodsmith_viewer::gpu::DrawModel| {
            let mut target = gpu.target(SIZE);
            let pose = Pose::default();
            gpu.draw(&mut target, &scene.frame(&[PlacedModel::new(drawn, &pose)]));
            target.read_back()
        };
        let fresh = gpu.upload(&Model::of_mesh(after));
        assert!(difference(&picture(&mut gpu, &drawn), &picture(&mut gpu, &fresh)) < 0.02, "{with_normals}");
        let born = 900..all.end;
        assert!(drawn.patch_mesh(0, &before, std::slice::from_ref(&born), &ranges));
        let fresh = gpu.upload(&Model::of_mesh(before.clone()));
        assert!(difference(&picture(&mut gpu, &drawn), &picture(&mut gpu, &fresh)) < 0.02, "{with_normals}");
        // More than the buffers hold: they are reallocated.
        let larger = as_asked(shapes::icosphere(4));
        let (faces, wedges) = (0..larger.face_count(), 0..larger.wedge_count());
        assert!(drawn.patch_mesh(0, &larger, &[faces], &[wedges]));
        let fresh = gpu.upload(&Model::of_mesh(larger));
        assert!(difference(&picture(&mut gpu, &drawn), &picture(&mut gpu, &fresh)) < 0.02, "{with_normals}");
    }
    // Faces are sorted by region, so ranges cannot be patched.
    let mut regions = shapes::icosphere(2);
    regions.set_regions(Some((0..regions.face_count()).map(|f| RegionId::new(f % 2)).collect())).unwrap();
    let mut drawn = gpu.upload(&Model::of_mesh(regions.clone()));
    let some = 0..10;
    assert!(!drawn.patch_mesh(0, &regions, std::slice::from_ref(&some), &[]));
}

/// A tube with two joints and a morph target; two nodes move it.
fn jointed() -> Model {
    let mut mesh = shapes::cylinder(24, 16);
    let up = |mesh: &TriMesh| -> usize {
        let b = mesh.positions().view().bounds().unwrap();
        (0..3).max_by(|&a, &c| (b.max[a] - b.min[a]).total_cmp(&(b.max[c] - b.min[c]))).unwrap()
    };
    let (axis, b) = (up(&mesh), mesh.positions().view().bounds().unwrap());
    let share: Vec<f32> = mesh
        .positions()
        .view()
        .iter()
        .map(|p| ((p[axis] - b.min[axis]) / (b.max[axis] - b.min[axis])) as f32)
        .collect();
    let attribute = |semantic, width, values| Attribute { semantic, width, values };
    let joints = share.iter().flat_map(|_| [0.0, 1.0, 0.0, 0.0]).collect();
    // Weights that do not sum to 1 are normalized.
    let weights = share.iter().flat_map(|s| [2.0 * (1.0 - s), 2.0 * s, 0.0, 0.0]).collect();
    let view = mesh.positions().view();
    let bulge: Vec<f32> = view
        .iter()
        .zip(&share)
        .flat_map(|(p, s)| {
            let grow = (s * std::f32::consts::PI).sin();
            [0, 1, 2].map(|k| if k == axis { 0.0 } else { p[k] as f32 * grow })
        })
        .collect();
    mesh.add_attribute(attribute(Semantic::Joints(0), 4, joints)).unwrap();
    mesh.add_attribute(attribute(Semantic::Weights(0), 4, weights)).unwrap();
    let morph = Semantic::Morph { target: 0, of: Morphed::Position };
    mesh.add_attribute(attribute(morph, 3, bulge)).unwrap();
    let surface = mesh.surface();
    let normals = lodsmith_core::mesh::normals::vertex_normals(&surface, |v| v);
    let normals = match mesh.vertex_map() {
        None => normals,
        Some(map) => map.iter().map(|v| normals[v.index()]).collect(),
    };
    mesh.set_normals(Some(normals)).unwrap();
    let mut model = Model::of_mesh(mesh);
    model.nodes[0].skin = Some(0);
    model.nodes.extend([Node::default(), Node::default()]);
    model.roots = vec![0, 1];
    model.nodes[1].children = vec![2];
    model.meshes[0].morph_weights = vec![0.0];
    model.skins = vec![Skin { joints: vec![1, 2], joint_from_mesh: vec![DMat4::IDENTITY; 2] }];
    model
}

#[test]
fn joints_and_morph_targets_pull_as_on_the_processor() {
    gpus().into_iter().for_each(joints_and_morph_targets_pull_as_on_the_processor_on);
}

fn joints_and_morph_targets_pull_as_on_the_processor_on(mut gpu: Gpu) {
    let model = jointed();
    let drawn = gpu.upload(&model);
    for (name, turn, strength) in [("bent", 0.9, 0.0), ("bulging", 0.0, 0.8), ("both", -0.6, 0.5)] {
        let parts = |rotation| Transform::Parts { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
        let still = parts(DQuat::IDENTITY);
        let pose = Pose {
            transforms: vec![
                still,
                still,
                parts(DQuat::from_rotation_x(turn) * DQuat::from_rotation_z(0.5 * turn)),
            ],
            morph_weights: vec![Some(vec![strength]), None, None],
        };
        let instance = &model.instances(&pose)[0];
        let mut out = Default::default();
        assert!(model.deform(instance, &pose, &model.world_from_nodes(&pose), &mut out), "{name}");
        let mesh = &model.meshes[0].mesh;
        let positions = lodsmith_core::Positions::F32(out.positions.clone());
        let faces: Vec<[VertexId; 3]> = mesh.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
        let mut bent = TriMesh::new(positions, faces).unwrap();
        bent.set_normals(Some(out.normals.clone())).unwrap();
        let scene = Scene::new(name, bent, Shading::Smooth);
        let cpu = scene.on_cpu();
        let mut target = gpu.target(SIZE);
        target.resize(SIZE, if gpu.is_software() { 2.0 } else { 1.0 });
        gpu.draw(&mut target, &scene.frame(&[PlacedModel::new(&drawn, &pose)]));
        let image = target.read_back();
        let image = if target.size() == SIZE { image } else { halved(&image) };
        keep(&format!("{name}-cpu"), &cpu);
        keep(&format!("{name}-gpu"), &image);
        let difference = difference(&cpu, &image);
        assert!(difference < 1.5, "{name}: {difference}");
    }
}

#[test]
fn an_animation_looks_as_on_the_cpu_before_and_after_reduction() {
    let Some(mut gpu) = gpu() else { return };
    let original = Original::read("../../testdata/arm.glb".as_ref(), Default::default()).unwrap();
    let mut how = Simplification::default();
    how.options.stop = lodsmith::Stop::ratio(0.25);
    let lighter = Lighter::make(&original, &how, &mut lodsmith::NoControl).unwrap();
    let mut target = gpu.target(SIZE);
    target.resize(SIZE, if gpu.is_software() { 2.0 } else { 1.0 });
    for (name, model) in [("whole", original.model()), ("light", &lighter.model)] {
        let drawn = gpu.upload(model);
        let mut scene = Scene::new("animation", shapes::cube(1), Shading::Textured);
        scene.model = model.clone();
        scene.camera = Camera::fitting(&original.bounds, StandardView::Front, 1.2);
        let mut before: Option<(Image, Option<[usize; 2]>)> = None;
        for (clip, seconds) in [(0, 0.0), (0, 0.4), (0, 1.0), (0, 1.7), (1, 0.5)] {
            let pose = Playback { clip: Some(clip), seconds, ..Playback::default() }.pose(model);
            let mut view = View::new(scene.camera, SIZE[0] as usize, SIZE[1] as usize);
            (view.look, view.lighting) = (scene.look.clone(), scene.lighting.clone());
            let cpu = render(&Subject::posed(model, &pose).unwrap(), &view).unwrap();
            // Light positions are relative to the bounding box of the pose.
            let bounds = Subject::posed(model, &pose).unwrap().bounds().unwrap();
            let placed = [PlacedModel::new(&drawn, &pose)];
            assert!(gpu.draw(&mut target, &Frame { bounds, ..scene.frame(&placed) }).drawn);
            let image = target.read_back();
            let image = if target.size() == SIZE { image } else { halved(&image) };
            keep(&format!("animation-{name}-{clip}-{seconds}-cpu"), &cpu);
            keep(&format!("animation-{name}-{clip}-{seconds}-gpu"), &image);
            let apart = difference(&cpu, &image);
            assert!(apart < 1.5, "{name} {clip} {seconds}: {apart}");
            // Only the pose is uploaded: no other resource is created or changed.
            let counts = gpu.context().resource_counts();
            if let Some((last, made)) = before.replace((image.clone(), counts)) {
                assert!(difference(&last, &image) > 0.5, "{name} {clip} {seconds}: it moves");
                assert_eq!(made, counts, "{name} {clip} {seconds}");
            }
            assert_eq!(drawn.version().1, 0);
        }
    }
}

#[test]
fn a_mesh_in_many_buffers_looks_as_in_one() {
    let Some(mut whole) = gpu() else { return };
    let mut scene = Scene::new("split", shapes::blob(4, 7), Shading::Heat);
    let mesh = &scene.model.meshes[0].mesh;
    scene.heat = Some((0..mesh.vertex_count()).map(|i| i as f32).collect());
    scene.look.borders = true;
    let mut regions = (**mesh).clone();
    let third = |f: usize| RegionId::new(f % 3);
    regions.set_regions(Some((0..regions.face_count()).map(third).collect())).unwrap();
    scene.model = Model::of_mesh(regions);
    let one = scene.on_gpu(&mut whole);
    for split in
        [BufferLimits { triangles: 700, wedges: 1 << 20 }, BufferLimits { triangles: 900, wedges: 500 }]
    {
        let mut cut = Gpu::on(whole.context().clone().with_buffer_limits(split));
        assert_eq!(difference(&one, &scene.on_gpu(&mut cut)), 0.0, "{split:?}");
    }
}

#[test]
fn the_place_under_a_pixel_is_found() {
    let Some(mut gpu) = gpu() else { return };
    let scene = Scene::new("pick", shapes::icosphere(5), Shading::Smooth);
    let drawn = gpu.upload(&scene.model);
    let pose = Pose::default();
    let aside = DVec3::new(40.0, 0.0, 0.0);
    let copy =
        PlacedModel { world_from_model: DMat4::from_translation(aside), ..PlacedModel::new(&drawn, &pose) };
    let placed = [copy, PlacedModel::new(&drawn, &pose)];
    let target = gpu.target(SIZE);
    for lens in [scene.camera.lens, Lens::Parallel { height: 4.0 }] {
        let camera = Camera { lens, ..scene.camera };
        let frame = Frame { camera, ..scene.frame(&placed) };
        let hit = gpu.pick(&target, &frame, [0.5, 0.5]).expect("the ball lies in the middle");
        let wanted = (camera.eye - camera.target).normalize_or_zero();
        assert_eq!(hit.model, 1);
        assert!(hit.position.distance(wanted) < 5e-3, "{lens:?}: {} instead of {wanted}", hit.position);
        assert_eq!(gpu.pick(&target, &frame, [0.01, 0.01]), None);
    }
}

#[test]
fn a_user_shader_colours_or_reports_its_error() {
    let Some(mut gpu) = gpu() else { return };
    let scene = Scene::new("shader", shapes::icosphere(3), Shading::Smooth);
    let shader = gpu
        .shader("fn surface(at: Surface) -> vec4<f32> {\n    return vec4(0.0, 1.0, 0.0, 1.0);\n}\n")
        .unwrap();
    let drawn = gpu.upload(&scene.model);
    let pose = Pose::default();
    let placed = [PlacedModel::new(&drawn, &pose)];
    let mut target = gpu.target(SIZE);
    gpu.draw(&mut target, &Frame { shader: Some(&shader), ..scene.frame(&placed) });
    let image = target.read_back();
    assert_eq!(image.at(image.width() / 2, image.height() / 2), [0, 255, 0, 255]);
    for (text, line) in [
        ("fn surface(at: Surface) -> vec4<f32> {\n    return vec4(at.nonsense, 1.0);\n}", Some(2)),
        ("\n\nfn surface(at: Surface) -> vec4<f32> { return 1 + ; }", Some(3)),
        ("fn another() {}", None),
    ] {
        let error = gpu.shader(text).err().expect("a faulty shader");
        assert!(line.is_none() || error.line == line, "{error}");
        assert!(!error.message.is_empty());
    }
}

#[test]
fn a_tint_is_the_colour_of_the_surface_under_any_shading() {
    let Some(mut gpu) = gpu() else { return };
    for (tint, shading) in
        [(1, Shading::Smooth), (3, Shading::Normals), (7, Shading::Matcap), (12, Shading::Heat)]
    {
        let mut scene = Scene::new("tint", shapes::torus(48, 24), Shading::Smooth);
        scene.look.surface = TINTS[usize::from(tint) - 1];
        let wanted = scene.on_cpu();
        scene.look = Look { shading, ..Look::default() };
        let drawn = gpu.upload(&scene.model);
        let mut target = gpu.target(SIZE);
        target.resize(SIZE, if gpu.is_software() { 2.0 } else { 1.0 });
        let pose = Pose::default();
        let placed = [PlacedModel { tint, ..PlacedModel::new(&drawn, &pose) }];
        gpu.draw(&mut target, &scene.frame(&placed));
        let image = target.read_back();
        let image = if target.size() == SIZE { image } else { halved(&image) };
        let difference = difference(&image, &wanted);
        assert!(difference < 1.5, "tint {tint}: {difference:.2}");
        // Without the tint, the same frame is a different picture.
        let plain = [PlacedModel::new(&drawn, &pose)];
        assert!(gpu.draw(&mut target, &scene.frame(&plain)).drawn);
    }
}

#[test]
fn copies_outside_the_view_are_left_out_and_the_others_share_calls() {
    let Some(mut gpu) = gpu() else { return };
    let scene = Scene::new("copies", shapes::icosphere(2), Shading::Smooth);
    let drawn = gpu.upload(&scene.model);
    let pose = Pose::default();
    let at = |k: usize| DMat4::from_translation(DVec3::new(0.0, 0.0, -3.0 * k as f64));
    let ahead = (0..250).map(|k| PlacedModel { world_from_model: at(k), ..PlacedModel::new(&drawn, &pose) });
    let away = DMat4::from_translation(scene.camera.eye * 3.0);
    let behind = (0..250).map(|_| PlacedModel { world_from_model: away, ..PlacedModel::new(&drawn, &pose) });
    let placed: Vec<_> = ahead.chain(behind).collect();
    let mut target = gpu.target(SIZE);
    let result = gpu.draw(&mut target, &scene.frame(&placed));
    assert!(result.culled >= 250 && result.calls == 1, "{result:?}");
}

/// A picture drawn in parts equals one drawn at once, and the previous picture stays until it is complete.
#[test]
fn parts_of_a_picture_come_to_the_whole() {
    let Some(mut gpu) = gpu() else { return };
    let mut mesh = shapes::torus(400, 200);
    let half = mesh.face_count() / 2;
    let regions = (0..mesh.face_count()).map(|f| RegionId(u32::from(f >= half))).collect();
    mesh.set_regions(Some(regions)).unwrap();
    let mut model = Model::of_mesh(mesh);
    let glass = Material { base_color: [0.2, 0.4, 0.9, 0.5], alpha: AlphaMode::Blend, ..Material::default() };
    model.materials = vec![Material::default(), glass];
    model.meshes[0].materials = vec![Some(0), Some(1)];
    let drawn = gpu.upload(&model);
    let (pose, lighting) = (Pose::default(), Lighting::default());
    let look = Look { shading: Shading::Textured, borders: true, defects: true, ..Look::default() };
    let placed: Vec<_> = (0..3)
        .map(|k| PlacedModel {
            world_from_model: DMat4::from_translation(DVec3::new(0.7 * f64::from(k), 0.0, 0.0)),
            ..PlacedModel::new(&drawn, &pose)
        })
        .collect();
    let bounds = Bounds { min: [-1.5; 3], max: [3.0, 1.5, 1.5] };
    let camera = |view| Camera::fitting(&bounds, view, 1.2);
    let frame = |view| Frame { ground: true, ..Frame::new(&placed, bounds, camera(view), &look, &lighting) };
    let [mut whole, mut parts] = [(); 2].map(|()| gpu.target(SIZE));
    gpu.draw(&mut parts, &frame(StandardView::Front));
    let before = parts.read_back();
    gpu.draw(&mut whole, &frame(StandardView::Iso));
    let wanted = whole.read_back();
    let mut count = 0;
    loop {
        let some = gpu.draw_in_parts(&mut parts, &frame(StandardView::Iso));
        count += u32::from(some.drawn);
        match some.completed_fraction() {
            None => break,
            Some(share) => assert!((0.0..1.0).contains(&share)),
        }
        assert!(parts.draws(&frame(StandardView::Iso)) && !parts.shows(&frame(StandardView::Iso)));
        assert_eq!(parts.read_back(), before);
    }
    assert!(count > 1 || !gpu.is_software(), "{count}");
    assert_eq!(parts.read_back(), wanted);
    assert!(parts.shows(&frame(StandardView::Iso)));
    // A resize does not discard the picture either.
    parts.resize([100, 80], 1.0);
    assert_eq!(parts.read_back(), wanted);
    gpu.draw(&mut parts, &frame(StandardView::Iso));
    assert_eq!((parts.read_back().width(), parts.read_back().height()), (100, 80));
}
