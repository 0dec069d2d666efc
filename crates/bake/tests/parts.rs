//! Values stay with their part, and on their side of a wall.

use glam::DVec3;
use lodsmith::NoControl;
use lodsmith_bake::{AtlasMode, BakeOptions, Baked, MapKind, Texels, bake};
use lodsmith_core::{Model, Positions, TriMesh, VertexId, WedgeId};

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

/// A square sheet of `2 n²` triangles with waves, above or below the plane, facing up or down.
struct Sheet {
    n: usize,
    height: f64,
    waves: f64,
    faces_up: bool,
    color: [f32; 4],
}

fn mesh_of(sheets: &[Sheet]) -> TriMesh {
    let (mut positions, mut triangles, mut colors) = (Vec::new(), Vec::new(), Vec::new());
    for sheet in sheets {
        let (n, first) = (sheet.n, positions.len());
        for i in 0..(n + 1) * (n + 1) {
            let (x, y) = ((i % (n + 1)) as f64 / n as f64, (i / (n + 1)) as f64 / n as f64);
            positions.push([x, y, sheet.height + sheet.waves * (17.0 * x).sin() * (13.0 * y).sin()]);
            colors.push(sheet.color);
        }
        for i in 0..n * n {
            let a = first + i / n * (n + 1) + i % n;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            for t in [[a, b, d], [a, d, c]] {
                let t = if sheet.faces_up { t } else { [t[0], t[2], t[1]] };
                triangles.push(t.map(VertexId::new));
            }
        }
    }
    let mut mesh = TriMesh::new(Positions::F64(positions), triangles).unwrap();
    mesh.set_colors(Some(colors)).unwrap();
    mesh
}

fn baked(high: TriMesh, low: TriMesh) -> Baked {
    let mut options = BakeOptions::new([MapKind::Color]);
    (options.size, options.atlas) = (Some(128), AtlasMode::New);
    bake(&Model::of_mesh(high), &Model::of_mesh(low), &options, &mut NoControl).unwrap()
}

/// Checks the baked colour at several places of each face.
fn each_color(baked: &Baked, check: impl Fn(usize, DVec3, [u8; 4])) {
    let mesh = baked.meshes[0].as_ref().unwrap();
    let Texels::Rgba8(image) = &baked.sets[0].maps[0].texels else { panic!("colours have 8 bits") };
    let uvs = mesh.uvs().unwrap();
    for (f, wedges) in mesh.triangles().iter().enumerate() {
        for weights in [[0.5, 0.25, 0.25], [0.1, 0.8, 0.1], [0.2, 0.2, 0.6], [0.34, 0.33, 0.33]] {
            let blend =
                |of: &dyn Fn(WedgeId) -> DVec3| (0..3).map(|k| of(wedges[k]) * weights[k]).sum::<DVec3>();
            let uv = blend(&|w| DVec3::from([uvs[w.index()][0].into(), uvs[w.index()][1].into(), 0.0]));
            let place = blend(&|w| DVec3::from(mesh.positions().view().get(mesh.vertex_of(w))));
            let texel = image.at((uv.x * 128.0) as usize, ((1.0 - uv.y) * 128.0) as usize);
            check(f, place, texel);
        }
    }
}

#[test]
fn touching_layers_keep_their_colours() {
    // The waves are higher than the gap, so the sheets cross. The vertices of the lighter mesh are some of the detailed
    // one, as after a collapse, and identify the sheets.
    let sheets = |n: usize, waves: f64| {
        let shirt = Sheet { n, height: 0.0, waves, faces_up: true, color: RED };
        mesh_of(&[shirt, Sheet { n, height: 0.01, waves: -waves, faces_up: true, color: BLUE }])
    };
    let baked = baked(sheets(48, 0.02), sheets(6, 0.02));
    each_color(&baked, |f, place, texel| {
        let is_shirt = f < 72;
        let wanted = if is_shirt { [255, 0, 0, 255] } else { [0, 0, 255, 255] };
        assert_eq!(texel, wanted, "face {f} at {place}");
    });
}

#[test]
fn the_sides_of_a_thin_wall_do_not_mix() {
    let wall = |n: usize, waves: f64| {
        let front = Sheet { n, height: 0.002, waves, faces_up: true, color: RED };
        mesh_of(&[front, Sheet { n, height: -0.002, waves, faces_up: false, color: BLUE }])
    };
    let baked = baked(wall(48, 0.01), wall(4, 0.0));
    each_color(&baked, |f, place, texel| {
        let wanted = if f < 32 { [255, 0, 0, 255] } else { [0, 0, 255, 255] };
        assert_eq!(texel, wanted, "face {f} at {place}");
    });
}

#[test]
fn a_removed_part_is_baked_onto_the_plate_below() {
    let plate = |n: usize| Sheet { n, height: 0.0, waves: 0.0, faces_up: true, color: RED };
    let mut high =
        mesh_of(&[plate(16), Sheet { n: 4, height: 0.003, waves: 0.0, faces_up: true, color: BLUE }]);
    // The second sheet becomes a small one in the middle.
    let first = 17 * 17;
    let count = high.vertex_count();
    let mut places: Vec<[f32; 3]> = high.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
    for p in &mut places[first..count] {
        *p = [0.4 + 0.2 * p[0], 0.4 + 0.2 * p[1], p[2]];
    }
    high.set_wedge_positions(places).unwrap();
    let baked = baked(high, mesh_of(&[plate(3)]));
    each_color(&baked, |_, place, texel| {
        let far = (place.x - 0.5).abs().max((place.y - 0.5).abs());
        let wanted = if far < 0.08 { [0, 0, 255, 255] } else { [255, 0, 0, 255] };
        if !(0.08..0.12).contains(&far) {
            assert_eq!(texel, wanted, "at {place}");
        }
    });
}

#[test]
fn degenerate_models_give_a_result_or_an_error() {
    let square = || mesh_of(&[Sheet { n: 2, height: 0.0, waves: 0.0, faces_up: true, color: RED }]);
    let mut options = BakeOptions::new(MapKind::ALL);
    (options.size, options.rays) = (Some(16), 4);
    let empty = TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap();
    for (high, low) in [(empty.clone(), square()), (square(), empty)] {
        assert!(bake(&Model::of_mesh(high), &Model::of_mesh(low), &options, &mut NoControl).is_err());
    }
    for (name, shape) in lodsmith_core::shapes::all() {
        if shape.face_count() == 0 || shape.face_count() > 3000 {
            continue;
        }
        let model = Model::of_mesh(shape);
        let made = bake(&model, &model, &options, &mut NoControl);
        if let Ok(made) = made {
            assert_eq!(made.sets[0].maps.len(), MapKind::ALL.len(), "{name}");
        }
    }
    let far = |scale: f64| {
        let mut mesh = square();
        mesh.map_positions(|p| p.map(|x| x * scale));
        Model::of_mesh(mesh)
    };
    for scale in [1e-30, 1e30, 1e150] {
        let _ = bake(&far(scale), &far(scale), &options, &mut NoControl);
    }
}

#[test]
fn a_face_that_is_narrow_in_the_map_does_not_change_the_heights_of_others() {
    // A square with one half folded up. In the map that half is a needle, whose extension reaches far beyond the
    // surface within a texel.
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
    let faces = [[0, 1, 2], [0, 2, 3]].map(|t| t.map(VertexId::new));
    let mut mesh = TriMesh::new(Positions::F64(corners), faces.to_vec()).unwrap();
    mesh.set_uvs(Some(vec![[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.5 - 1e-5, 0.5 + 1e-5]])).unwrap();
    let model = Model::of_mesh(mesh);
    let mut options = BakeOptions::new([MapKind::Height]);
    options.size = Some(64);
    let baked = bake(&model, &model, &options, &mut NoControl).unwrap();
    assert!(!baked.sets[0].is_new_atlas);
    let range = baked.sets[0].maps[0].range.unwrap();
    assert!(range < 0.01, "the surfaces are the same: {range}");
}

#[test]
fn options_out_of_range_and_bakes_above_the_memory_limit_are_refused() {
    let model =
        Model::of_mesh(mesh_of(&[Sheet { n: 2, height: 0.0, waves: 0.0, faces_up: true, color: RED }]));
    let refused = |change: &dyn Fn(&mut BakeOptions)| {
        let mut options = BakeOptions::new([MapKind::Occlusion]);
        options.size = Some(512);
        change(&mut options);
        bake(&model, &model, &options, &mut NoControl).expect_err("it is refused").to_string()
    };
    assert_eq!(refused(&|o| o.rays = 10_000_000_000_000), "rays: must be from 1 to 65536");
    assert_eq!(refused(&|o| o.rays = 0), "rays: must be from 1 to 65536");
    assert_eq!(refused(&|o| o.size = Some(20_000)), "size: must be from 16 to 16384 texels");
    let too_much = refused(&|o| o.memory = 20 << 20);
    assert!(too_much.contains("baking would take about 22.") && too_much.contains("20.00 MiB"), "{too_much}");
}

/// Returns triangles that share no vertices, each a chart of its own.
fn scattered(count: usize) -> Model {
    let mut positions = Vec::new();
    for i in 0..count {
        let (x, y) = ((i % 256) as f64, (i / 256) as f64);
        let side = 0.4 + 0.4 * (i % 7) as f64 / 7.0;
        positions.extend([[x, y, 0.0], [x + side, y, 0.0], [x, y + side, 0.0]]);
    }
    let triangles = (0..count).map(|i| [0, 1, 2].map(|k| VertexId::new(3 * i + k)));
    Model::of_mesh(TriMesh::new(Positions::F64(positions), triangles.collect::<Vec<_>>()).unwrap())
}

/// Fault C7: dozens of densities were tried for charts that are more than a map has room for.
#[test]
fn more_charts_than_a_map_has_room_for_are_refused_before_they_are_packed() {
    let model = scattered(2_000);
    let mut options = BakeOptions::new([MapKind::Occlusion]);
    (options.size, options.atlas) = (Some(64), AtlasMode::New);
    let mut calls = Calls::default();
    let e = bake(&model, &model, &options, &mut calls).expect_err("64 texels squared are 4,096").to_string();
    assert!(e.contains("2000 charts need 9 texels each or more") && e.contains("--texture-size"), "{e}");
    // One for each chart, few for the stages, and none for packing.
    assert!((2_000..2_100).contains(&calls.0), "{}", calls.0);
}

/// Thousands of charts took minutes.
#[test]
fn very_many_charts_are_packed_in_rows() {
    let model = scattered(20_000);
    let mut options = BakeOptions::new([MapKind::Occlusion]);
    (options.size, options.atlas, options.rays) = (Some(512), AtlasMode::New, 1);
    let baked = bake(&model, &model, &options, &mut NoControl).unwrap();
    let mesh = baked.meshes[0].as_ref().unwrap();
    let uvs = mesh.uvs().unwrap();
    // No two charts are in one texel.
    let mut texels: Vec<[i32; 2]> = Vec::new();
    for wedges in mesh.triangles() {
        let centre = |k: usize| wedges.iter().map(|w| uvs[w.index()][k]).sum::<f32>() / 3.0;
        texels.push([0, 1].map(|k| (centre(k) * 512.0) as i32));
    }
    texels.sort_unstable();
    texels.dedup();
    assert_eq!(texels.len(), 20_000);
}

/// Counts the calls while the texture coordinates are made.
#[derive(Default)]
struct Calls(usize);

impl lodsmith::Control for Calls {
    fn progress(&mut self, done: f64) -> lodsmith::Verdict {
        self.0 += usize::from(done == 0.05);
        lodsmith::Verdict::Continue
    }
}
