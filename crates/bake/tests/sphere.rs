//! A bake with a known result: a sphere with bumps given by a formula, onto a sphere of few faces.

use std::collections::HashMap;

use glam::{DMat4, DVec2, DVec3, Vec3, Vec4};
use lodsmith::NoControl;
use lodsmith_bake::{AtlasMode, BakeOptions, Baked, MapKind, Texels, bake};
use lodsmith_core::model::Transform;
use lodsmith_core::{Image, Model, Semantic, TriMesh, shapes};

const BUMP: f64 = 0.02;
const WAVES: f64 = 6.0;

/// The radius in a direction of unit length, and its gradient.
fn bumps(d: DVec3) -> (f64, DVec3) {
    let [x, y, z] = (d * WAVES).to_array();
    let ([sx, cx], [sy, cy], [sz, cz]) = ([x.sin(), x.cos()], [y.sin(), y.cos()], [z.sin(), z.cos()]);
    let radius = 1.0 + BUMP * sx * sy * sz;
    (radius, DVec3::new(cx * sy * sz, sx * cy * sz, sx * sy * cz) * (BUMP * WAVES))
}

/// The normal of the bumpy ball in a direction.
fn formula(d: DVec3) -> DVec3 {
    let (radius, gradient) = bumps(d);
    (d * radius - (gradient - d * gradient.dot(d))).normalize_or_zero()
}

fn bumpy(n: u32) -> TriMesh {
    let mut mesh = shapes::icosphere(n);
    mesh.map_positions(|p| {
        let d = DVec3::from(p).normalize_or_zero();
        (d * bumps(d).0).to_array()
    });
    let normal = |p: [f64; 3]| formula(DVec3::from(p).normalize_or_zero()).as_vec3().to_array();
    let normals = mesh.positions().view().iter().map(normal).collect();
    mesh.set_normals(Some(normals)).unwrap();
    mesh
}

fn baked(maps: &[MapKind], size: usize) -> Baked {
    let mut options = BakeOptions::new(maps.iter().copied());
    (options.size, options.atlas) = (Some(size), AtlasMode::New);
    let (detailed, lighter) = (Model::of_mesh(bumpy(6)), Model::of_mesh(shapes::icosphere(3)));
    bake(&detailed, &lighter, &options, &mut NoControl).unwrap()
}

fn image(baked: &Baked, kind: MapKind) -> &Image {
    match &baked.sets[0].maps.iter().find(|m| m.kind == kind).unwrap().texels {
        Texels::Rgba8(image) => image,
        other => panic!("{other:?}"),
    }
}

/// Samples an image as a renderer does: between its four nearest texels, each channel from 0 to 255.
fn filtered(image: &Image, uv: DVec2) -> Vec4 {
    let (x, y) = (uv.x * image.width() as f64 - 0.5, (1.0 - uv.y) * image.height() as f64 - 0.5);
    let at = |i: f64, j: f64| {
        let [i, j] =
            [(i, image.width()), (j, image.height())].map(|(i, n)| (i as i64).clamp(0, n as i64 - 1));
        Vec4::from(image.at(i as usize, j as usize).map(f32::from))
    };
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let (x, y) = (x.floor(), y.floor());
    let upper = at(x, y).lerp(at(x + 1.0, y), fx);
    upper.lerp(at(x, y + 1.0).lerp(at(x + 1.0, y + 1.0), fx), fy)
}

/// A mesh with the data that a renderer interpolates.
struct ShownMesh<'a> {
    mesh: &'a TriMesh,
    tangents: Option<&'a [f32]>,
}

impl<'a> ShownMesh<'a> {
    fn new(mesh: &'a TriMesh) -> Self {
        let tangents = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Tangent);
        Self { mesh, tangents: tangents.map(|t| &*t.values) }
    }
    fn place(&self, face: usize, k: usize) -> DVec3 {
        DVec3::from(self.mesh.positions().view().get(self.mesh.vertex_of(self.mesh.triangles()[face][k])))
    }
    fn uv(&self, face: usize, weights: [f64; 3]) -> DVec2 {
        let uvs = self.mesh.uvs().unwrap();
        let corner = |k: usize| DVec2::from(uvs[self.mesh.triangles()[face][k].index()].map(f64::from));
        (0..3).map(|k| corner(k) * weights[k]).sum()
    }
    /// The normal that a renderer shows at a place.
    fn shown(&self, map: &Image, face: usize, weights: [f64; 3]) -> Vec3 {
        let wedges = self.mesh.triangles()[face].map(|w| w.index());
        let normals = self.mesh.normals().unwrap();
        let normal: Vec3 = (0..3).map(|k| Vec3::from(normals[wedges[k]]) * weights[k] as f32).sum();
        let tangents = self.tangents.unwrap();
        let corner = |k: usize| Vec3::from_slice(&tangents[wedges[k] * 4..]);
        let tangent: Vec3 = (0..3).map(|k| corner(k) * weights[k] as f32).sum();
        let bitangent = normal.cross(tangent) * tangents[wedges[0] * 4 + 3];
        let [x, y, z, _] = filtered(map, self.uv(face, weights)).to_array().map(|c| c / 127.5 - 1.0);
        (tangent * x + bitangent * y + normal * z).normalize_or_zero()
    }
}

#[test]
fn baked_normals_match_the_formula() {
    let baked = baked(&[MapKind::Normal], 512);
    let mesh = baked.meshes[0].as_ref().unwrap();
    let corners = ShownMesh::new(mesh);
    let map = image(&baked, MapKind::Normal);
    let (mut sum, mut count, mut largest) = (0.0, 0.0, 0f64);
    for f in 0..mesh.face_count() {
        for weights in
            [[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6], [0.1, 0.45, 0.45], [0.98, 0.01, 0.01]]
        {
            let place: DVec3 = (0..3).map(|k| corners.place(f, k) * weights[k]).sum();
            let wanted = formula(place.normalize_or_zero());
            let angle = corners.shown(map, f, weights).as_dvec3().angle_between(wanted).to_degrees();
            (sum, count, largest) = (sum + angle, count + 1.0, largest.max(angle));
        }
    }
    let mean = sum / count;
    // Measured: 0.12 and 0.29.
    assert!(mean < 0.3, "{mean}");
    assert!(largest < 1.0, "{largest}");
    // Without the map, the normals are far off: the test can fail.
    let plain = (0..mesh.face_count()).map(|f| {
        let place = (0..3).map(|k| corners.place(f, k)).sum::<DVec3>().normalize_or_zero();
        place.angle_between(formula(place)).to_degrees()
    });
    assert!(plain.sum::<f64>() / mesh.face_count() as f64 > 2.0);
    assert_eq!(baked.found.elsewhere, 0, "{:?}", baked.found);
}

#[test]
fn both_sides_of_a_seam_look_the_same() {
    let baked = baked(&[MapKind::Normal, MapKind::ObjectNormal, MapKind::Height], 512);
    let mesh = baked.meshes[0].as_ref().unwrap();
    let corners = ShownMesh::new(mesh);
    // Edges whose sides have different coordinates.
    let mut sides: HashMap<[u32; 2], Vec<(usize, usize)>> = HashMap::new();
    for (f, t) in mesh.triangles().iter().enumerate() {
        for k in 0..3 {
            let mut ends = [t[k], t[(k + 1) % 3]].map(|w| mesh.vertex_of(w).0);
            ends.sort_unstable();
            sides.entry(ends).or_default().push((f, k));
        }
    }
    let (mut object, mut tangent): (Vec<f32>, Vec<f32>) = (Vec::new(), Vec::new());
    let (object_map, tangent_map) = (image(&baked, MapKind::ObjectNormal), image(&baked, MapKind::Normal));
    for pair in sides.values() {
        let &[(f, i), (g, j)] = &pair[..] else { panic!("a ball is closed") };
        for step in 1..16 {
            let t = f64::from(step) / 16.0;
            let at = |k: usize, t: f64| {
                let mut weights = [0.0; 3];
                (weights[k], weights[(k + 1) % 3]) = (1.0 - t, t);
                weights
            };
            let (a, b) = (at(i, t), at(j, 1.0 - t));
            let uv = [corners.uv(f, a), corners.uv(g, b)];
            if uv[0].distance(uv[1]) < 1e-6 {
                continue;
            }
            let off = filtered(object_map, uv[0]) - filtered(object_map, uv[1]);
            object.extend(off.abs().to_array()[..3].iter());
            let off = corners.shown(tangent_map, f, a) - corners.shown(tangent_map, g, b);
            tangent.extend((off.abs() * 127.5).to_array());
        }
    }
    assert!(object.len() > 1000, "there are seams");
    for (name, mut all) in [("object", object), ("tangent", tangent)] {
        all.sort_unstable_by(f32::total_cmp);
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        let high = all[all.len() * 99 / 100];
        // Measured: 0.19 and 0.66.
        assert!(mean <= 0.5 && high <= 1.5, "{name}: {mean} {high}");
    }
}

#[test]
fn heights_match_the_formula() {
    let baked = baked(&[MapKind::Height], 256);
    let map = &baked.sets[0].maps[0];
    let Texels::Gray16 { width, height, values } = &map.texels else { panic!("{map:?}") };
    let mesh = baked.meshes[0].as_ref().unwrap();
    let corners = ShownMesh::new(mesh);
    let mut sum = 0.0;
    for f in 0..mesh.face_count() {
        let weights = [0.3, 0.3, 0.4];
        let place: DVec3 = (0..3).map(|k| corners.place(f, k) * weights[k]).sum();
        let uv = corners.uv(f, weights);
        let (x, y) = ((uv.x * *width as f64) as usize, ((1.0 - uv.y) * *height as f64) as usize);
        let stored = (f64::from(values[y * width + x]) / 65535.0 * 2.0 - 1.0) * map.range.unwrap();
        sum += (stored - (bumps(place.normalize_or_zero()).0 - place.length())).abs();
    }
    let mean = sum / mesh.face_count() as f64;
    assert!(mean < 0.05 * BUMP, "{mean}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| baked(&[MapKind::Normal, MapKind::Occlusion, MapKind::Curvature], 64))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.meshes, three.meshes);
    assert!(one.sets[0].maps == three.sets[0].maps);
}

/// Cancels at the second call with the progress of the unwrapping.
struct Impatient(usize);

impl lodsmith::Control for Impatient {
    fn progress(&mut self, done: f64) -> lodsmith::Verdict {
        assert!(done <= 0.05, "the bake went on to {done}");
        self.0 += usize::from(done == 0.05);
        if self.0 < 2 { lodsmith::Verdict::Continue } else { lodsmith::Verdict::Cancel }
    }
}

#[test]
fn unwrapping_can_be_cancelled() {
    let model = Model::of_mesh(shapes::noisy_sphere(7, 0.02, 1));
    let mut options = BakeOptions::new([MapKind::Height]);
    options.size = Some(1024);
    let result = bake(&model, &model, &options, &mut Impatient(0));
    assert!(matches!(result, Err(lodsmith_bake::BakeError::Cancelled)));
}

#[test]
fn the_maps_of_a_mesh_in_a_mirror_are_its_own() {
    let mirrored = |mesh: TriMesh| {
        let mut model = Model::of_mesh(mesh);
        model.nodes[0].transform = Transform::Matrix(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        model
    };
    let mut options = BakeOptions::new([MapKind::Normal]);
    options.size = Some(128);
    let plain = bake(&Model::of_mesh(bumpy(5)), &Model::of_mesh(bumpy(2)), &options, &mut NoControl).unwrap();
    // The same texture coordinates for both.
    let light = plain.meshes[0].clone().unwrap();
    let pair = [
        bake(&Model::of_mesh(bumpy(5)), &Model::of_mesh(light.clone()), &options, &mut NoControl).unwrap(),
        bake(&mirrored(bumpy(5)), &mirrored(light), &options, &mut NoControl).unwrap(),
    ];
    let [a, b] = pair.each_ref().map(|baked| image(baked, MapKind::Normal));
    let differences =
        a.pixels().iter().zip(b.pixels()).map(|(a, b)| (0..3).map(|k| a[k].abs_diff(b[k])).max());
    let most = differences.flatten().filter(|d| *d > 2).count();
    assert!(most < a.pixels().len() / 200, "{most} texels differ");
}
