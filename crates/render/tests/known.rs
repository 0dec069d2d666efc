//! Pictures with known results, and invalid input.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::mesh::{Attribute, Morphed, Semantic};
use lodsmith_core::model::{
    AlphaMode, Material, ModelMesh, Node, Pose, Sampler, Skin, TextureRef, Transform,
};
use lodsmith_core::{Image, Model, Positions, TriMesh, VertexId, WedgeId, shapes};
use lodsmith_render::{
    Background, Camera, Environment, Ground, Lens, Light, LightKind, Lighting, Look, RenderError, Shading,
    StandardView, Subject, View, render,
};

const PLAIN: [[f32; 3]; 2] = TextureRef::PLAIN;

fn mesh(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> TriMesh {
    let faces = faces.iter().map(|f| f.map(VertexId)).collect();
    TriMesh::new(Positions::F32(positions.to_vec()), faces).unwrap()
}

/// A rectangle at depth z, seen from +z.
fn rectangle([x0, y0, x1, y1]: [f32; 4], z: f32) -> TriMesh {
    mesh(&[[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], &[[0, 1, 2], [0, 2, 3]])
}

/// A camera along -z whose pixels are unit squares, with the origin in the lower left corner.
fn pixel_view(width: usize, height: usize) -> View {
    let middle = DVec3::new(width as f64 / 2.0, height as f64 / 2.0, 0.0);
    let camera = Camera {
        eye: middle + 10.0 * DVec3::Z,
        target: middle,
        up: DVec3::Y,
        lens: Lens::Parallel { height: height as f64 },
    };
    let mut view = View::new(camera, width, height);
    view.background = Background::Transparent;
    // Unlit, so that colours are known.
    view.look.shading = Shading::Textured;
    view
}

fn unlit(color: [f32; 4]) -> Material {
    Material { base_color: color, unlit: true, double_sided: true, ..Material::default() }
}

fn model(parts: Vec<(TriMesh, Material)>) -> Model {
    let mut model = Model::default();
    for (i, (mesh, material)) in parts.into_iter().enumerate() {
        let materials = vec![Some(i)];
        let (name, mesh, morph_weights) = (String::new(), Arc::new(mesh), Vec::new());
        model.meshes.push(ModelMesh { name, mesh, materials, morph_weights });
        model.nodes.push(Node { mesh: Some(i), ..Node::default() });
        model.roots.push(i);
        model.materials.push(material);
    }
    model
}

fn draw(model: &Model, view: &View) -> Image {
    render(&Subject::new(model).unwrap(), view).unwrap()
}

#[test]
fn a_square_covers_exactly_its_pixels() {
    let square = model(vec![(rectangle([3.0, 2.0, 9.0, 7.0], 0.0), unlit([1.0, 0.0, 0.0, 1.0]))]);
    let picture = draw(&square, &pixel_view(16, 12));
    for y in 0..12 {
        for x in 0..16 {
            let is_in = (3..9).contains(&x) && (2..7).contains(&(11 - y));
            let wanted = if is_in { [255, 0, 0, 255] } else { [0; 4] };
            assert_eq!(picture.at(x, y), wanted, "{x} {y}");
        }
    }
}

#[test]
fn edges_are_as_opaque_as_they_are_covered() {
    // Coverage of a half, and a quarter at the corner.
    let square = model(vec![(rectangle([2.0, 2.0, 5.5, 5.5], 0.0), unlit([1.0; 4]))]);
    let picture = draw(&square, &pixel_view(8, 8));
    let alpha = |x: usize, y: usize| picture.at(x, 7 - y)[3];
    assert_eq!([alpha(4, 4), alpha(5, 4), alpha(4, 5), alpha(6, 4)], [255, 128, 128, 0]);
    assert_eq!(alpha(5, 5), 64);
}

#[test]
fn neighbours_neither_overlap_nor_leave_a_gap() {
    // A fan of thin triangles fills its outline: with half-transparent faces, samples taken twice would be
    // visible.
    let n = 97u32;
    let mut positions = vec![[15.7f32, 16.3, 0.0]];
    positions.extend((0..n).map(|i| {
        let a = i as f32 / n as f32 * std::f32::consts::TAU;
        [16.0 + 40.0 * a.cos(), 16.0 + 40.0 * a.sin(), 0.0]
    }));
    let faces: Vec<[u32; 3]> = (0..n).map(|i| [0, 1 + i, 1 + (i + 1) % n]).collect();
    let material = Material { alpha: AlphaMode::Blend, ..unlit([1.0, 1.0, 1.0, 0.5]) };
    let picture = draw(&model(vec![(mesh(&positions, &faces), material)]), &pixel_view(32, 32));
    assert!(picture.pixels().iter().all(|p| p[3].abs_diff(128) <= 1), "every sample is seen once");
}

#[test]
fn what_is_nearer_hides_what_is_behind_in_any_order() {
    let (near, far) = (rectangle([0.0, 0.0, 4.0, 4.0], 2.0), rectangle([2.0, 0.0, 8.0, 4.0], 1.0));
    let (red, blue) = (unlit([1.0, 0.0, 0.0, 1.0]), unlit([0.0, 0.0, 1.0, 1.0]));
    for parts in
        [vec![(near.clone(), red.clone()), (far.clone(), blue.clone())], vec![(far, blue), (near, red)]]
    {
        let picture = draw(&model(parts), &pixel_view(8, 4));
        assert_eq!([picture.at(3, 1), picture.at(4, 1)], [[255, 0, 0, 255], [0, 0, 255, 255]]);
    }
}

#[test]
fn transparent_faces_blend_from_the_back() {
    let glass =
        |color: [f32; 3]| Material { alpha: AlphaMode::Blend, ..unlit([color[0], color[1], color[2], 0.5]) };
    let parts = vec![
        (rectangle([0.0, 0.0, 4.0, 4.0], 3.0), glass([1.0, 0.0, 0.0])),
        (rectangle([0.0, 0.0, 4.0, 4.0], 1.0), unlit([0.0, 0.0, 1.0, 1.0])),
        (rectangle([0.0, 0.0, 4.0, 4.0], 2.0), glass([0.0, 1.0, 0.0])),
    ];
    // Half-transparent red over green over blue, in linear light: a half, a quarter, a quarter.
    let [r, g, b, a] = draw(&model(parts), &pixel_view(4, 4)).at(1, 1);
    assert!(r.abs_diff(188) <= 1 && g.abs_diff(137) <= 1 && b.abs_diff(137) <= 1 && a == 255, "{r} {g} {b}");
}

#[test]
fn a_mask_cuts_holes() {
    let mut square = rectangle([0.0, 0.0, 8.0, 8.0], 0.0);
    square.set_uvs(Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).unwrap();
    let sampler = Sampler { nearest: true, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, transform: PLAIN, sampler };
    let material =
        Material { alpha: AlphaMode::Mask(0.5), base_color_texture: Some(texture), ..unlit([1.0; 4]) };
    let mut model = model(vec![(square, material)]);
    // The left half is opaque, the right half is not.
    model.images.push(Arc::new(Image::new(2, 1, vec![[255; 4], [255, 255, 255, 20]])));
    let picture = draw(&model, &pixel_view(8, 8));
    assert_eq!([picture.at(2, 4)[3], picture.at(6, 4)[3]], [255, 0]);
}

#[test]
fn images_shrink_with_distance_as_they_should() {
    // A checkerboard of 8 × 8 squares on a floor that recedes from the eye.
    let n = 8usize;
    let pixels = (0..n * n)
        .map(|i| if (i % n + i / n).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] })
        .collect();
    let mut floor = mesh(
        &[[-4.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, -8.0], [-4.0, 0.0, -8.0]],
        &[[0, 1, 2], [0, 2, 3]],
    );
    floor.set_uvs(Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).unwrap();
    let sampler = Sampler { nearest: true, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, transform: PLAIN, sampler };
    let mut model = model(vec![(floor, Material { base_color_texture: Some(texture), ..unlit([1.0; 4]) })]);
    model.images.push(Arc::new(Image::new(n, n, pixels)));
    let (w, h) = (400, 300);
    let camera = Camera {
        eye: DVec3::new(0.0, 2.0, 2.0),
        target: DVec3::new(0.0, 0.0, -3.0),
        up: DVec3::Y,
        lens: Lens::Perspective { fov_y_rad: 0.9 },
    };
    let mut view = View::new(camera, w, h);
    view.look.shading = Shading::Textured;
    let picture = draw(&model, &view);
    let project = camera.view_from_world();
    let mut seen = 0;
    for z in 0..8 {
        for x in 0..8 {
            // The centre of a square, computed with the projection.
            let p = project.transform_point3(DVec3::new(f64::from(x) - 3.5, 0.0, -0.5 - f64::from(z)));
            let slope = 0.45f64.tan();
            let at = [p.x / (-p.z * slope) * 0.75, p.y / (-p.z * slope)];
            let (px, py) = ((0.5 + 0.5 * at[0]) * w as f64, (0.5 - 0.5 * at[1]) * h as f64);
            if px < 0.0 || py < 0.0 || px >= w as f64 || py >= h as f64 {
                continue;
            }
            seen += 1;
            // Row 0 of the image is its upper edge, v = 1, far away.
            let wanted = if (x + (7 - z)) % 2 == 0 { 255 } else { 0 };
            assert_eq!(picture.at(px as usize, py as usize)[0], wanted, "square {x} {z}");
        }
    }
    assert!(seen > 50, "{seen} of 64 squares are in the picture");
}

#[test]
fn a_ball_covers_the_disc_that_it_should() {
    let ball = Subject::of_mesh(shapes::icosphere(5)).unwrap();
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 4.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        lens: Lens::Perspective { fov_y_rad: 0.8 },
    };
    let mut view = View::new(camera, 300, 200);
    view.background = Background::Transparent;
    for fine in [false, true] {
        view.fine = fine;
        let picture = render(&ball, &view).unwrap();
        let covered: f64 = picture.pixels().iter().map(|p| f64::from(p[3]) / 255.0).sum();
        // The sphere is seen under asin(1/4); pixels are tangents.
        let radius = 0.25f64.asin().tan() / 0.4f64.tan() * 100.0;
        let disc = std::f64::consts::PI * radius * radius;
        assert!((covered / disc - 1.0).abs() < 0.002, "{covered} of {disc}");
    }
}

#[test]
fn the_same_picture_with_any_number_of_threads() {
    let mut model = Model::of_mesh(shapes::torus(64, 48));
    model.nodes[0].transform = Transform::Parts {
        translation: DVec3::ONE,
        rotation: DQuat::from_rotation_y(0.4),
        scale: DVec3::new(1.0, -2.0, 1.0),
    };
    let subject = Subject::new(&model).unwrap();
    let mut view = View::of(&subject.bounds().unwrap(), StandardView::Iso, 211, 173);
    view.look = Look { wireframe: true, borders: true, defects: true, ..Look::default() };
    view.ground = Ground { grid: true, shadow: true };
    for occlusion in [false, true] {
        view.occlusion = occlusion;
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&subject, &view).unwrap())
        };
        let one = with(1);
        assert!(one == with(2) && one == with(7));
    }
}

#[test]
fn size_and_place_of_the_numbers_do_not_matter() {
    let picture = |scale: f64, shift: f64| {
        let mut ball = shapes::torus(32, 24);
        let positions = ball.positions().view().iter().map(|p| p.map(|x| x * scale + shift)).collect();
        ball = TriMesh::new(Positions::F64(positions), ball.surface().triangles().to_vec()).unwrap();
        let subject = Subject::of_mesh(ball).unwrap();
        let mut view = View::of(&subject.bounds().unwrap(), StandardView::Iso, 120, 100);
        view.look.shading = Shading::Flat;
        view.ground = Ground { grid: false, shadow: true };
        render(&subject, &view).unwrap()
    };
    let usual = picture(1.0, 0.0);
    for (scale, shift) in [(1e-200, 0.0), (1e200, 0.0), (1e-15, 0.0), (1.0, 1e7), (0.001, -4e6)] {
        let other = picture(scale, shift);
        let differing = usual
            .pixels()
            .iter()
            .zip(other.pixels())
            .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 8))
            .count();
        assert!(differing < 40, "{scale} {shift}: {differing} pixels");
    }
}

#[test]
fn faces_that_reach_behind_the_eye_are_clipped() {
    // An endless floor: the eye is above it, its corners are far away on all sides.
    let r = 1e6;
    let floor = mesh(&[[-r, 0.0, r], [r, 0.0, r], [r, 0.0, -r], [-r, 0.0, -r]], &[[0, 1, 2], [0, 2, 3]]);
    let camera = Camera {
        eye: DVec3::new(0.0, 1.0, 0.0),
        target: DVec3::new(0.0, 1.0, -1.0),
        up: DVec3::Y,
        lens: Lens::Perspective { fov_y_rad: 1.0 },
    };
    let mut view = View::new(camera, 64, 64);
    view.background = Background::Transparent;
    view.look.wireframe = true;
    let picture = render(&Subject::of_mesh(floor).unwrap(), &view).unwrap();
    let row = |y: usize| (0..64).map(|x| u32::from(picture.at(x, y)[3])).sum::<u32>();
    assert_eq!([row(10), row(30), row(33), row(60)], [0, 0, 64 * 255, 64 * 255]);
}

#[test]
fn nothing_to_draw_is_the_background() {
    let view = pixel_view(5, 4);
    assert!(draw(&Model::default(), &view).pixels().iter().all(|p| *p == [0; 4]));
    let empty = TriMesh::new(Positions::F32(vec![]), vec![]).unwrap();
    let mut view = View::new(view.camera, 5, 4);
    view.background = Background::Color([1.0, 0.0, 0.0]);
    view.look = Look { wireframe: true, borders: true, defects: true, ..Look::default() };
    view.ground = Ground { grid: true, shadow: true };
    view.occlusion = true;
    for shading in Shading::ALL.into_iter().filter(|s| *s != Shading::Heat) {
        view.look.shading = shading;
        let subject = Subject::of_mesh(empty.clone()).unwrap();
        assert_eq!(subject.bounds(), None);
        let picture = render(&subject, &view).unwrap();
        assert!(picture.pixels().iter().all(|p| *p == [255, 0, 0, 255]), "{shading:?}");
    }
}

#[test]
fn broken_faces_are_left_out_and_marked() {
    let p = [
        [1.0, 1.0, 0.0],
        [7.0, 1.0, 0.0],
        [7.0, 7.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [f32::INFINITY, 2.0, 0.0],
        [4.0, 1.0, 0.0],
        [3e38, -3e38, 3e38],
    ];
    let broken = mesh(&p, &[[0, 1, 2], [0, 1, 3], [4, 1, 2], [0, 1, 5], [0, 0, 1], [2, 2, 2], [0, 1, 2]]);
    let mut view = pixel_view(8, 8);
    for shading in Shading::ALL {
        view.look.shading = shading;
        let values = vec![vec![0.0, 1.0, f32::NAN, 0.0, f32::INFINITY, 0.0, 2.0]];
        let subject = Subject::of_mesh(broken.clone()).unwrap().with_values(values).unwrap();
        let picture = render(&subject, &view).unwrap();
        assert_eq!([picture.at(5, 4)[3], picture.at(1, 1)[3]], [255, 0], "{shading:?}");
    }
    view.look.shading = Shading::Smooth;
    view.look.defects = true;
    let with_marks = render(&Subject::of_mesh(broken).unwrap(), &view).unwrap();
    let yellow = |p: &&[u8; 4]| p[0] > 200 && p[1] > 150 && p[2] < 120;
    assert!(with_marks.pixels().iter().filter(yellow).count() >= 3, "the face without area is marked");
    // A far corner is clipped, not an error.
    let far = mesh(&p, &[[0, 1, 6]]);
    assert!(render(&Subject::of_mesh(far).unwrap(), &view).is_ok());
}

#[test]
fn errors_say_why_a_picture_cannot_be_drawn() {
    let subject = Subject::of_mesh(shapes::cube(1)).unwrap();
    let view = pixel_view(4, 4);
    let with = |change: &dyn Fn(&mut View)| {
        let mut view = view.clone();
        change(&mut view);
        render(&subject, &view).unwrap_err()
    };
    assert_eq!(with(&|v| v.width = 0), RenderError::Size { width: 0, height: 4 });
    assert!(matches!(with(&|v| v.height = 1 << 20), RenderError::Size { .. }));
    assert!(matches!(with(&|v| v.camera.eye = v.camera.target), RenderError::Camera { .. }));
    assert!(matches!(with(&|v| v.camera.eye.x = f64::NAN), RenderError::Camera { .. }));
    assert!(matches!(with(&|v| v.camera.lens = Lens::Parallel { height: 0.0 }), RenderError::Camera { .. }));
    assert!(matches!(with(&|v| v.look.shading = Shading::Heat), RenderError::Values { values: 0, .. }));
    let few = Subject::of_mesh(shapes::cube(1)).unwrap().with_values(vec![vec![1.0]]).unwrap_err();
    assert!(few.to_string().contains("1 values"), "{few}");
}

#[test]
fn lights_shine_where_they_point() {
    let wall = rectangle([0.0, 0.0, 40.0, 40.0], 0.0);
    let subject = Subject::of_mesh(wall).unwrap();
    let mut view = pixel_view(40, 40);
    view.look.shading = Shading::Smooth;
    let dark = lodsmith_render::Ambient { above: [0.0; 3], below: [0.0; 3] };
    // Radii are half the diagonal; the spot is in front of the middle and has a cone of 20 degrees.
    let at = glam::Vec3::new(0.0, 0.0, 1.0);
    let kind = LightKind::Spot { at, toward: glam::Vec3::ZERO, half_angle_rad: 0.35 };
    let light = Light { kind, color: [1.0; 3], in_world: true };
    view.lighting = Lighting { ambient: dark, lights: vec![light] };
    let picture = render(&subject, &view).unwrap();
    assert!(picture.at(20, 20)[0] > 150, "{:?}", picture.at(20, 20));
    assert_eq!(picture.at(2, 2), [0, 0, 0, 255]);
    view.lighting.lights[0].kind = LightKind::Point { at };
    let picture = render(&subject, &view).unwrap();
    let brightness = [picture.at(20, 20)[0], picture.at(8, 20)[0], picture.at(2, 2)[0]];
    assert!(
        brightness[0] > brightness[1] && brightness[1] > brightness[2] && brightness[2] > 20,
        "{brightness:?}"
    );
}

#[test]
fn single_sided_faces_are_visible_from_the_front_only() {
    let one_sided = Material { double_sided: false, ..unlit([1.0; 4]) };
    let front = model(vec![(rectangle([0.0, 0.0, 4.0, 4.0], 0.0), one_sided.clone())]);
    let back = model(vec![(mesh(&[[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]], &[[0, 2, 1]]), one_sided)]);
    let alpha = |m: &Model| draw(m, &pixel_view(4, 4)).at(0, 3)[3];
    assert_eq!([alpha(&front), alpha(&back)], [255, 0]);
}

/// Covered pixels of a picture of 12 by 12, from the lower left corner.
fn covered(subject: &Subject, view: &View) -> Vec<[usize; 2]> {
    let picture = render(subject, view).unwrap();
    let all = (0..12).flat_map(|y| (0..12).map(move |x| [x, y]));
    all.filter(|&[x, y]| picture.at(x, 11 - y)[3] == 255).collect()
}

/// The pixels of a rectangle.
fn pixels([x0, y0, x1, y1]: [usize; 4]) -> Vec<[usize; 2]> {
    (y0..y1).flat_map(|y| (x0..x1).map(move |x| [x, y])).collect()
}

#[test]
fn joints_bend_what_is_drawn() {
    // An arm along x: one joint moves its inner half, a second one at (6, 2) its outer half.
    let places =
        [[0.0f32, 2.0], [6.0, 2.0], [6.0, 4.0], [0.0, 4.0], [6.0, 2.0], [10.0, 2.0], [10.0, 4.0], [6.0, 4.0]];
    let mut arm = mesh(&places.map(|[x, y]| [x, y, 0.0]), &[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]);
    let joints =
        [[0.0f32, 0.0, 0.0, 0.0]; 4].into_iter().chain([[1.0, 0.0, 0.0, 0.0]; 4]).flatten().collect();
    let weights = [1.0f32, 0.0, 0.0, 0.0].repeat(8);
    arm.add_attribute(Attribute { semantic: Semantic::Joints(0), width: 4, values: joints }).unwrap();
    arm.add_attribute(Attribute { semantic: Semantic::Weights(0), width: 4, values: weights }).unwrap();
    let mut model = model(vec![(arm, unlit([1.0; 4]))]);
    let elbow = DVec3::new(6.0, 2.0, 0.0);
    let at = |translation: DVec3, rotation| Transform::Parts { translation, rotation, scale: DVec3::ONE };
    model.nodes[0].skin = Some(0);
    // Only the joints place it.
    model.nodes[0].transform = at(DVec3::splat(77.0), DQuat::IDENTITY);
    model.nodes.push(Node { children: vec![2], ..Node::default() });
    model.nodes.push(Node { transform: at(elbow, DQuat::IDENTITY), ..Node::default() });
    model.roots.push(1);
    let joint_from_mesh = vec![DMat4::IDENTITY, DMat4::from_translation(-elbow)];
    model.skins.push(Skin { joints: vec![1, 2], joint_from_mesh });
    let view = pixel_view(12, 12);
    assert_eq!(covered(&Subject::new(&model).unwrap(), &view), pixels([0, 2, 10, 4]));

    let mut pose = Pose { transforms: model.nodes.iter().map(|n| n.transform).collect(), ..Pose::default() };
    pose.transforms[2] = at(elbow, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2));
    let bent = Subject::posed(&model, &pose).unwrap();
    let mut wanted = [pixels([0, 2, 6, 4]), pixels([4, 4, 6, 6])].concat();
    wanted.sort_by_key(|&[x, y]| [y, x]);
    assert_eq!(covered(&bent, &view), wanted);
    let bounds = bent.bounds().unwrap();
    assert!((bounds.max[0] - 6.0).abs() < 1e-5 && (bounds.max[1] - 6.0).abs() < 1e-5, "{bounds:?}");
}

#[test]
fn morph_targets_move_what_is_drawn() {
    // One vertex of the square has two wedges, and one of those is moved alone.
    let positions = [[1.0, 1.0], [5.0, 1.0], [5.0, 5.0], [1.0, 5.0]].map(|[x, y]| [x, y, 0.0]);
    let wedges = [0, 1, 2, 3, 2].map(VertexId).to_vec();
    let faces = [[0, 1, 2], [0, 4, 3]].map(|f| f.map(WedgeId)).to_vec();
    let mut square = TriMesh::with_wedges(Positions::F32(positions.to_vec()), wedges, faces).unwrap();
    let mut values = [4.0, 0.0, 0.0].repeat(5);
    values[12..].copy_from_slice(&[4.0, 2.0, 0.0]);
    let semantic = Semantic::Morph { target: 0, of: Morphed::Position };
    square.add_attribute(Attribute { semantic, width: 3, values }).unwrap();
    let mut model = model(vec![(square, unlit([1.0; 4]))]);
    let view = pixel_view(12, 12);
    assert_eq!(covered(&Subject::new(&model).unwrap(), &view), pixels([1, 1, 5, 5]));
    model.meshes[0].morph_weights = vec![1.0];
    let moved = Subject::new(&model).unwrap();
    let top = moved.bounds().unwrap();
    assert_eq!((top.min, top.max), ([5.0, 1.0, 0.0], [9.0, 7.0, 0.0]));
    // At rest the weights of the mesh apply, in a pose the weights of the pose.
    let pose = Pose { morph_weights: vec![Some(vec![0.5])], ..Pose::default() };
    let half = Subject::posed(&model, &pose).unwrap().bounds().unwrap();
    assert_eq!((half.min, half.max), ([3.0, 1.0, 0.0], [7.0, 6.0, 0.0]));
    // One value for each vertex of the model; both wedges of a vertex get the same.
    let mut view = pixel_view(12, 12);
    view.look.shading = Shading::Heat;
    view.look.heat_range = Some([0.0, 1.0]);
    let hot = moved.with_values(vec![vec![1.0; 4]]).unwrap();
    let drawn = render(&hot, &view).unwrap();
    assert_eq!(drawn.at(8, 9), drawn.at(5, 7));
    assert_eq!(drawn.at(5, 7)[3], 255);
}

#[test]
fn a_framed_subject_fills_its_picture() {
    // A long thin box whose bounding sphere would leave most of the picture empty, far from the origin.
    let mut long = shapes::cube(2);
    long.map_positions(|p| [8.0 * p[0] + 1e6, p[1], p[2] - 1e6]);
    let subject = Subject::of_mesh(long).unwrap();
    let bounds = subject.bounds().unwrap();
    for (width, height) in [(200, 100), (90, 150)] {
        for parallel in [false, true] {
            for which in StandardView::ALL {
                let aspect = width as f64 / height as f64;
                let mut camera = Camera::fitting(&bounds, which, aspect);
                if parallel {
                    camera.lens = Lens::Parallel { height: 1.0 };
                }
                let mut view = View::new(subject.framed(camera, aspect, 0.06), width, height);
                view.background = Background::Transparent;
                let picture = render(&subject, &view).unwrap();
                let opaque = picture.pixels().iter().enumerate().filter(|(_, p)| p[3] > 0);
                let seen: Vec<[usize; 2]> = opaque.map(|(i, _)| [i % width, i / width]).collect();
                let [x, y] = [0, 1].map(|k| {
                    let all = seen.iter().map(|p| p[k]);
                    (all.clone().min().unwrap(), all.max().unwrap() + 1)
                });
                let (free_x, free_y) = (x.0.min(width - x.1), y.0.min(height - y.1));
                let [least_x, least_y] = [width, height].map(|side| (0.06 * side as f64) as usize);
                let name = format!("{which:?} {width} {parallel}: {x:?} {y:?}");
                assert!(free_x + 1 >= least_x && free_y + 1 >= least_y, "{name}");
                assert!(free_x <= least_x + 2 || free_y <= least_y + 2, "{name}");
                // Centred along the filled axis; along the other one depth shifts it a little.
                let off = |(first, end): (usize, usize), side: usize| first.abs_diff(side - end);
                let filled = if free_x <= least_x + 2 { off(x, width) } else { off(y, height) };
                assert!(filled <= 2, "{name}");
            }
        }
    }
    // A mesh without a face, and one without extent.
    let camera = Camera::fitting(&bounds, StandardView::Iso, 1.0);
    let nothing = Subject::of_mesh(mesh(&[[0.0; 3]], &[])).unwrap();
    assert_eq!(nothing.framed(camera, 1.0, 0.06), camera);
    let point = Subject::of_mesh(mesh(&[[3.0; 3]; 3], &[[0, 1, 2]])).unwrap();
    let near = point.framed(camera, 1.0, 0.06);
    assert!(near.eye.is_finite() && near.distance() > 0.0 && near.target == DVec3::splat(3.0));
}

/// A sphere of a material in an environment, without any lights, seen from the front.
fn ball_in(environment: Environment, material: Material) -> Image {
    let model = model(vec![(shapes::icosphere(5), Material { double_sided: true, ..material })]);
    let subject = Subject::new(&model).unwrap();
    let mut view = View::of(&subject.bounds().unwrap(), StandardView::Front, 80, 80);
    view.look.shading = Shading::Textured;
    view.background = Background::Transparent;
    view.lighting.lights.clear();
    view.environment = Some(Arc::new(environment));
    view.camera = subject.framed(view.camera, 1.0, 0.05);
    render(&subject, &view).unwrap()
}

#[test]
fn a_white_ball_vanishes_in_white_surroundings() {
    // White furnace test: every material reflects all incoming light. 188 is linear one half.
    let half = Environment::of_light(1, 1, &[glam::Vec3::splat(0.5)]);
    for (roughness, metallic) in [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 1.0), (0.4, 1.0), (1.0, 0.5)] {
        let material = Material { roughness, metallic, ..Material::default() };
        let picture = ball_in(half.clone(), material);
        for p in picture.pixels().iter().filter(|p| p[3] == 255) {
            assert!(p[..3].iter().all(|c| c.abs_diff(188) <= 1), "{roughness} {metallic}: {p:?}");
        }
    }
}

#[test]
fn a_metal_ball_mirrors_what_is_around() {
    // Red above, green below, blue to the right: +x.
    let (w, h) = (64, 32);
    let light = |i: usize| match (i % w, i / w) {
        (x, y) if (28..36).contains(&x) && (12..20).contains(&y) => glam::Vec3::Z,
        (_, y) if y < h / 2 => glam::Vec3::X,
        _ => glam::Vec3::Y,
    };
    let pixels: Vec<glam::Vec3> = (0..w * h).map(light).collect();
    let around = Environment::of_light(w, h, &pixels);
    let metal = |roughness: f32| Material { roughness, metallic: 1.0, ..Material::default() };
    let smooth = ball_in(around.clone(), metal(0.0));
    // The normal halfway between the eye and +x reflects +x: at about sin 45 degrees of the radius, which is
    // 36 pixels.
    let strongest = |p: [u8; 4]| (0..3).find(|&k| p[k] > 150).unwrap();
    let seen = [(40, 22), (40, 58), (65, 40)].map(|(x, y)| strongest(smooth.at(x, y)));
    assert_eq!(seen, [0, 1, 2]);
    assert!(smooth.at(40, 22)[0] > 200, "metal is not dark: {:?}", smooth.at(40, 22));
    // The rougher, the more both are mixed.
    let share = |roughness: f32| ball_in(around.clone(), metal(roughness)).at(40, 30)[1];
    let all = [0.0, 0.5, 1.0].map(share);
    assert!(all[0] < 40 && all[0] <= all[1] && all[1] < all[2], "{all:?}");
    // Without metal or gloss it is lit from both sides, softly.
    let matt = ball_in(around, Material { roughness: 1.0, metallic: 0.0, ..Material::default() });
    let [above, below] = [matt.at(40, 12), matt.at(40, 68)];
    assert!(above[0] > above[1] + 100 && below[1] > below[0] + 100, "{above:?} {below:?}");
}

#[test]
fn surroundings_are_seen_behind_the_model() {
    // Red above, green below, blue straight ahead when looking from the front: -z.
    let (w, h) = (256, 128);
    let light = |i: usize| match (i % w, i / w) {
        (x, y) if x.abs_diff(w / 4) < 4 && y.abs_diff(h / 2) < 4 => glam::Vec3::Z,
        (_, y) if y < h / 2 => glam::Vec3::X,
        _ => glam::Vec3::Y,
    };
    let around = Environment::of_light(w, h, &(0..w * h).map(light).collect::<Vec<_>>());
    let subject =
        Subject::of_mesh(mesh(&[[0.0; 3], [1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0]], &[[0, 1, 2]])).unwrap();
    let bounds = lodsmith_core::Bounds { min: [-1.0; 3], max: [1.0; 3] };
    let mut view = View::of(&bounds, StandardView::Front, 90, 60);
    view.background = Background::Environment { blurred: false };
    let usual = render(&subject, &View { background: Background::default(), ..view.clone() }).unwrap();
    assert_eq!(render(&subject, &view).unwrap(), usual, "without any, the usual gradient");
    view.environment = Some(Arc::new(around));
    for lens in [view.camera.lens, Lens::Parallel { height: 3.0 }] {
        view.camera.lens = lens;
        let picture = render(&subject, &view).unwrap();
        let seen = [(45, 3), (45, 56), (44, 29)].map(|(x, y)| picture.at(x, y));
        assert_eq!(seen, [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]], "{lens:?}");
    }
    // Blurred, there is no sharp edge between the two.
    view.background = Background::Environment { blurred: true };
    let soft = render(&subject, &view).unwrap().at(10, 30);
    assert!(soft[0] > 120 && soft[1] > 120, "{soft:?}");
}

/// Sixteen textures, each on a square of its own, drawn by more threads than a picture of this size keeps busy, so that
/// several threads need the same texture.
#[test]
fn many_threads_draw_many_textures_without_waiting_for_each_other() {
    let square = |i: usize| {
        let y = 8.0 * i as f32;
        let mut square = rectangle([0.0, y, 64.0, y + 8.0], 0.0);
        square.set_uvs(Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).unwrap();
        let (transform, sampler) = (PLAIN, Sampler::default());
        let texture = TextureRef { image: i, uv_set: 0, transform, sampler };
        (square, Material { base_color_texture: Some(texture), ..unlit([1.0; 4]) })
    };
    let mut model = model((0..16).map(square).collect());
    model.images = (0..16).map(|i| Arc::new(Image::filled(128, 128, [16 * i as u8, 0, 0, 255]))).collect();
    let (done, is_done) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().unwrap();
        for _ in 0..100 {
            let picture = pool.install(|| draw(&model, &pixel_view(64, 128)));
            assert_eq!([picture.at(9, 127), picture.at(9, 3)], [[0, 0, 0, 255], [240, 0, 0, 255]]);
        }
        done.send(()).unwrap();
    });
    is_done.recv_timeout(std::time::Duration::from_secs(120)).expect("there is no deadlock");
}

/// Normals as colours: a face of a box has one, unless its edges are smooth.
#[test]
fn edges_of_a_box_without_normals_are_sharp() {
    use lodsmith_core::mesh::creases::Creases;
    let colors = |subject: &Subject| {
        let bounds = subject.bounds().unwrap();
        let mut view = View::of(&bounds, StandardView::Iso, 96, 96);
        (view.background, view.look.shading) = (Background::Transparent, Shading::Normals);
        let picture = render(subject, &view).unwrap();
        // Of whole pixels, away from the edges of faces.
        let mut colors: Vec<[u8; 4]> = picture.pixels().iter().copied().filter(|p| p[3] == 255).collect();
        colors.sort_unstable();
        let mut counts: Vec<usize> = colors.chunk_by(|a, b| a == b).map(<[_]>::len).collect();
        counts.sort_unstable();
        counts.iter().rev().take(3).sum::<usize>() as f64 / colors.len() as f64
    };
    let whole = Subject::of_mesh(shapes::cube(1)).unwrap();
    assert!(colors(&whole) > 0.9, "three faces are seen: {}", colors(&whole));
    // A result is shaded like its original, whatever its own shape.
    let ball = Subject::of_mesh(shapes::icosphere(4)).unwrap();
    assert_eq!(ball.creases(), Creases::Off);
    let like_the_ball = Subject::of_mesh(shapes::cube(1)).unwrap().with_creases(ball.creases());
    assert!(colors(&like_the_ball) < 0.2, "{}", colors(&like_the_ball));
    let above = |angle| Subject::of_mesh(shapes::cube(1)).unwrap().with_creases(Creases::Above(angle));
    assert!(colors(&above(89.0)) > 0.9 && colors(&above(91.0)) < 0.2);
}
