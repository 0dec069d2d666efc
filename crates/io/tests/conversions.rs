//! Conversions of meshes to scenes and back: the same as by way of the bytes of a GLB.

use std::fs;
use std::io::Cursor;
use std::sync::Arc;

use lodsmith_core::{Attribute, IntegerType, Positions, Semantic, TriMesh, VertexId, WedgeId, shapes};
use lodsmith_io::gltf::{Compression, Packing, Scene};
use lodsmith_io::{
    Format, Limits, Loaded, ReadError, ReadOptions, Regions, Textures, Warning, WriteOptions, read_bytes,
    read_path, read_scene_bytes, read_scene_path, write_scene_to, write_to,
};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::scenes::{Pack, everything, glb, split};

/// A mesh, its regions, and a name for messages.
type NamedMesh = (String, TriMesh, Regions);

/// Reads a file of `testdata`.
fn testdata(name: &str) -> Vec<u8> {
    fs::read(format!("{}/../../testdata/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn read(bytes: &[u8]) -> Loaded {
    read_bytes(bytes, &ReadOptions::default()).unwrap()
}

fn png() -> Vec<u8> {
    let mut png = Cursor::new(Vec::new());
    image::RgbaImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// Returns an OBJ of two objects with a material each: one has an image beside the file, one an image that is absent.
/// The image is in the folder.
fn obj() -> (TempDir, Loaded) {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    put("grain.png", &png());
    put("a.mtl", b"newmtl wood\nKd 0.5 1 1\nmap_Kd grain.png\nd 0.25\nnewmtl tin\nPm 1\nmap_Kd gone.png\n");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.1\nvt 0 0\nvt 1 0\nvt 0.3 1\n";
    let faces = "o one\nusemtl wood\nf 1/1 2/2 3/3\no two\nusemtl tin\nf 2/1 4/2 3/3\nf 4/1 3/2 1/3\n";
    put("a.obj", format!("mtllib a.mtl\n{corners}{faces}").as_bytes());
    let loaded = read_path(&folder.path().join("a.obj"), &ReadOptions::default()).unwrap();
    (folder, loaded)
}

const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 -0\nendloop\n\
    endfacet\nendsolid\n";

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
    property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nend_header\n\
    0 0 0 255 0 9\n1 0 0 1 2 3\n0 1 0 200 100 50\n3 0 1 2\n";

/// Returns meshes that were read from files.
fn meshes_of_files() -> (TempDir, Vec<NamedMesh>) {
    let files = ["arm.glb", "finial.ply", "huts.dae", "tokens.3mf", "wave.glb", "wave_draco.glb"];
    let mut all: Vec<_> = files.map(|name| (name, read(&testdata(name)))).into();
    all.extend([("STL", read(STL.as_bytes())), ("PLY", read(PLY.as_bytes()))]);
    let (folder, loaded) = obj();
    all.push(("OBJ", loaded));
    (
        folder,
        all.into_iter()
            .map(|(name, loaded)| (name.to_owned(), TriMesh::clone(&loaded.mesh), loaded.regions))
            .collect(),
    )
}

/// Returns meshes with values that a GLB changes or drops.
fn odd_meshes() -> Vec<NamedMesh> {
    let mut far = shapes::cube(2).into_buffers();
    far.positions = Positions::F64(far.positions.view().iter().map(|p| p.map(|x| x / 7.0 + 1e7)).collect());
    let far = TriMesh::try_from(far).unwrap();
    let mut odd = shapes::grid(3);
    let count = odd.wedge_count();
    odd.set_normals(Some((0..count).map(|i| [0.0, 0.0, i as f32]).collect())).unwrap();
    odd.set_uvs(Some(vec![[f32::NAN, -0.0]; count])).unwrap();
    odd.set_colors(Some(vec![[0.1, 0.2, 7.0, 1.0]; count])).unwrap();
    let semantic = Semantic::Discrete { name: "id".to_owned(), of: IntegerType::U8 };
    odd.add_attribute(Attribute { semantic, width: 1, values: vec![7.0; count] }).unwrap();
    let mut no_faces = shapes::cube(1).into_buffers();
    no_faces.triangles.clear();
    let named = |(name, mesh): (&str, TriMesh)| (name.to_owned(), mesh, Regions::default());
    [("far", far), ("odd", odd), ("no faces", TriMesh::try_from(no_faces).unwrap())].map(named).into()
}

/// Returns all that can be seen of a scene, as bytes and as text. (Missing values are not equal to themselves.)
fn content(scene: &Scene) -> (Vec<u8>, String) {
    let mut bytes = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut bytes).unwrap();
    let counts = (scene.contents(), scene.buffer_bytes(), scene.external_files());
    (bytes, format!("{:?}", (scene.format(), scene.meshes(), scene.bounds(), counts, scene.warnings())))
}

#[test]
fn a_mesh_becomes_the_scene_that_its_glb_is() {
    let (_folder, mut all) = meshes_of_files();
    all.extend(odd_meshes());
    let mut texts = String::new();
    for (name, mesh, regions) in all {
        for textures in [Textures::Copy, Textures::None] {
            let mut options = WriteOptions::default();
            options.regions = Some(Arc::new(regions.clone()));
            options.textures = textures;
            let mut bytes = Vec::new();
            let written = write_to(&mesh, Format::Glb, &options, &mut bytes).unwrap();
            let wanted = Scene::read(&bytes, &ReadOptions::default()).unwrap();
            // Neither matters here.
            options.format = Some(Format::Ply);
            options.packing = Packing::new(Compression::Meshopt, true);
            let (scene, lost) = Scene::of_mesh(&mesh, &options, Limits::default()).unwrap();
            assert_eq!(lost, written.warnings, "{name}");
            let (got, wanted) = (content(&scene), content(&wanted));
            assert!(got == wanted, "{name}: {}\n{}", got.1, wanted.1);
            assert_eq!(scene.meshes()[0].mesh.face_count(), mesh.face_count(), "{name}");
            lost.iter().for_each(|w| texts += &w.text);
        }
    }
    for said in [
        "GLB cannot carry objects: dropped",
        "GLB cannot carry id of vertices: dropped",
        "materials dropped: --textures none",
        "1 normal has length zero",
        "gone.png",
    ] {
        assert!(texts.contains(said), "{said} is not in {texts}");
    }
}

#[test]
fn a_mesh_without_vertices_becomes_a_scene_without_faces() {
    let nothing = TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap();
    let (scene, lost) = Scene::of_mesh(&nothing, &WriteOptions::default(), Limits::default()).unwrap();
    assert_eq!((scene.meshes()[0].mesh.face_count(), scene.bounds(), lost), (0, None, Vec::new()));
}

#[test]
fn a_mesh_that_would_not_fit_in_memory_as_a_scene_is_refused() {
    let mesh = shapes::grid(50);
    let with = |memory: u64| {
        let mut limits = Limits::default();
        limits.memory = memory;
        Scene::of_mesh(&mesh, &WriteOptions::default(), limits)
    };
    let bytes = with(u64::MAX).unwrap().0.buffer_bytes();
    assert!(matches!(with(2 * bytes), Err(ReadError::Memory(_))));
    assert!(with(8 * bytes).is_ok());
}

/// Returns three instances of a triangle.
fn instances() -> Vec<u8> {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let places = pack.floats("VEC3", 3, &[0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0, 0.0]);
    let instancing = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    let json = pack.json(json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "scale": [-1, 1, 1], "extensions": instancing}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
    }));
    glb(&json, &pack.bin)
}

/// Returns a folder with a glTF file whose buffer and image are files beside it.
fn external() -> TempDir {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let uvs = pack.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let primitive = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "material": 0});
    let mut json = pack.json(json!({
        "meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "grain.png"}],
    }));
    json["buffers"][0]["uri"] = "a.bin".into();
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    put("a.gltf", json.to_string().as_bytes());
    put("a.bin", &pack.bin);
    put("grain.png", &png());
    folder
}

/// Returns what [`Scene::joined`] gives, as text, by way of the bytes of a GLB.
fn joined_by_bytes(scene: &Scene, replaced: &[Option<TriMesh>], options: &ReadOptions) -> String {
    let mut bytes = Vec::new();
    let written = write_scene_to(scene, replaced, Format::Glb, &|_| None, &mut bytes).unwrap();
    let mut loaded = read_bytes(&bytes, options);
    if let Ok(loaded) = &mut loaded {
        loaded.warnings.splice(0..0, written.warnings);
    }
    format!("{loaded:?}")
}

/// Returns a mesh of a third of the size, with every n-th of the faces, from the last one on.
fn smaller(n: usize, mesh: &TriMesh) -> TriMesh {
    let mut buffers = mesh.clone().into_buffers();
    buffers.triangles = buffers.triangles.into_iter().rev().step_by(n).collect();
    buffers.regions = buffers.regions.map(|all| all.into_iter().rev().step_by(n).collect());
    let mut mesh = TriMesh::try_from(buffers).unwrap();
    mesh.map_positions(|p| p.map(|x| x / 3.0));
    mesh
}

#[test]
fn a_joined_scene_is_the_mesh_that_its_glb_is() {
    let names = ["arm.glb", "huts.dae", "tokens.3mf", "wave.glb", "wave_draco.glb", "wave_meshopt_ext.glb"];
    let mut files: Vec<_> = names.map(|name| (name, testdata(name))).into();
    files.extend([("everything", glb(&everything().0, &everything().1)), ("instances", instances())]);
    let scene_of = |(name, bytes): (&str, Vec<u8>)| {
        let scene = read_scene_bytes(&bytes, &ReadOptions::default()).unwrap().unwrap();
        (name.to_owned(), scene, ReadOptions::default())
    };
    let mut all: Vec<_> = files.into_iter().map(scene_of).collect();
    let folder = external();
    let mut options = ReadOptions::default();
    options.folder = Some(folder.path().to_owned());
    options.limits.pixels = 3;
    let scene = read_scene_path(&folder.path().join("a.gltf"), &options).unwrap().unwrap();
    all.push(("external".to_owned(), scene, options));
    let (_folder, mut meshes) = meshes_of_files();
    meshes.extend(odd_meshes());
    for (name, mesh, regions) in meshes {
        let mut options = WriteOptions::default();
        options.regions = Some(Arc::new(regions));
        let (scene, _) = Scene::of_mesh(&mesh, &options, Limits::default()).unwrap();
        all.push((format!("{name} as a scene"), scene, ReadOptions::default()));
    }

    let mut texts = String::new();
    for (name, scene, options) in all {
        let smaller = |n: usize| scene.meshes().iter().map(|m| Some(smaller(n, &m.mesh))).collect();
        let mut first_emptied: Vec<Option<TriMesh>> = smaller(1);
        first_emptied[0] = Some(TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap());
        for replaced in [Vec::new(), smaller(2), first_emptied] {
            let mut bytes = Vec::new();
            write_scene_to(&scene, &replaced, Format::Glb, &|_| None, &mut bytes).unwrap();
            let read = Scene::read(&bytes, &options);
            let (got, wanted) =
                (scene.with_meshes(&replaced).map(|s| content(&s)), read.map(|s| content(&s)));
            assert!(format!("{got:?}") == format!("{wanted:?}"), "{name}: {got:?}\n{wanted:?}");
            let (got, wanted) = (scene.joined(&replaced), joined_by_bytes(&scene, &replaced, &options));
            assert!(format!("{got:?}") == wanted, "{name}: {got:?}\n{wanted}");
            texts += &wanted;
        }
    }
    for said in [
        "NoFaces { vertices: 0 }",
        "meshes[0] has no faces left: removed",
        "the input was compressed, and the output is not",
        "skins are not carried",
        "RegionId(1)",
        "positions: F64",
        "pixels: 3",
    ] {
        assert!(texts.contains(said), "{said} is in none");
    }
}

#[test]
fn a_joined_scene_finds_its_files() {
    let folder = external();
    let scene = read_scene_path(&folder.path().join("a.gltf"), &ReadOptions::default()).unwrap().unwrap();
    let (colors, warnings) = scene.joined(&[]).unwrap().base_colors();
    assert_eq!((colors.len(), colors[0].is_some(), warnings), (1, true, Vec::new()));
}

#[test]
fn meshes_are_joined_within_the_limits_of_their_scene() {
    let mut bytes = Vec::new();
    write_to(&shapes::grid(8), Format::Glb, &WriteOptions::default(), &mut bytes).unwrap();
    let (mut json, bin) = split(&bytes);
    json["nodes"] = vec![json!({"mesh": 0}); 10_000].into();
    json["scenes"] = json!([{"nodes": Value::from_iter(0..10_000)}]);
    let joined = |memory: u64| {
        let mut options = ReadOptions::default();
        options.limits.memory = memory;
        Scene::read(&glb(&json, &bin), &options).unwrap().joined(&[])
    };
    // Nodes count as part of the file: for its buffer alone, these would be too many faces.
    assert_eq!(joined(u64::MAX).unwrap().mesh.face_count(), 1_280_000);
    assert!(matches!(joined(20 << 20), Err(ReadError::Memory(_))));
}

#[test]
fn a_replacement_that_no_primitive_can_hold_is_refused() {
    let (json, bin) = everything();
    let scene = Scene::read(&glb(&json, &bin), &ReadOptions::default()).unwrap();
    let mut lines = TriMesh::clone(&scene.meshes()[0].mesh);
    lines.set_regions(Some(vec![lodsmith_core::RegionId(1); lines.face_count()])).unwrap();
    let error = scene.joined(&[Some(lines)]).unwrap_err();
    assert!(matches!(error, ReadError::Malformed { .. }));
    assert_eq!(
        error.to_string(),
        "face 0 of meshes[0] has region 1, which is not a primitive with triangles"
    );
}

/// No format gets NaN or infinity, as a mesh or within a scene; the faces that use them go, with a warning.
#[test]
fn positions_that_are_not_finite_are_removed() {
    let mut buffers = shapes::grid(3).into_buffers();
    let Positions::F32(positions) = &mut buffers.positions else { panic!("a grid is single") };
    (positions[0][1], positions[5][0]) = (f32::NAN, f32::INFINITY);
    let (bad_a, bad_b) = (0, 5);
    let uses = |t: &[WedgeId; 3]| t.iter().any(|w| w.0 == bad_a || w.0 == bad_b);
    let removed = buffers.triangles.iter().filter(|t| uses(t)).count();
    let left = buffers.triangles.len() - removed;
    let mut mesh = TriMesh::try_from(buffers).unwrap();
    mesh.set_uvs(Some(vec![[f32::NAN, 0.25]; mesh.wedge_count()])).unwrap();
    let said = |warnings: &[Warning]| {
        let text = "2 vertices have positions that are not finite";
        assert!(warnings.iter().any(|w| w.data_lost && w.text.starts_with(text)), "{warnings:?}");
    };
    for format in
        [Format::Obj, Format::Off, Format::Ply, Format::Stl, Format::Gltf, Format::Glb, Format::ThreeMf]
    {
        let mut bytes = Vec::new();
        said(&write_to(&mesh, format, &WriteOptions::default(), &mut bytes).unwrap().warnings);
        let got = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
        assert_eq!(got.face_count(), left, "{format:?}");
        assert!(got.positions().view().iter().flatten().all(f64::is_finite), "{format:?}");
        if format == Format::Glb {
            assert_eq!(got.uvs().unwrap()[0], [0.0, 0.25]);
        }
    }
    // The same in a scene that a file brings, whose meshes are else kept byte for byte.
    let mut glb = Vec::new();
    write_to(&shapes::grid(3), Format::Glb, &WriteOptions::default(), &mut glb).unwrap();
    let corner = shapes::grid(3).positions().view().get(VertexId(5)).map(|x| (x as f32).to_le_bytes());
    let at = glb.windows(12).position(|w| w == corner.as_flattened()).unwrap();
    glb[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let scene = read_scene_bytes(&glb, &ReadOptions::default()).unwrap().unwrap();
    for format in [Format::Glb, Format::ThreeMf] {
        let mut bytes = Vec::new();
        let written = write_scene_to(&scene, &[], format, &|_| None, &mut bytes).unwrap();
        assert!(written.warnings.iter().any(|w| w.data_lost && w.text.contains("not finite")));
        let got = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
        assert!(got.positions().view().iter().flatten().all(f64::is_finite) && got.face_count() > 0);
    }
    // Doubles that single precision cannot hold.
    let far = |least: f64| {
        let mut far = shapes::grid(3).into_buffers();
        let moved = |p: [f64; 3]| p.map(|x| if x >= least { 1e200 } else { x });
        far.positions = Positions::F64(far.positions.view().iter().map(moved).collect());
        TriMesh::try_from(far).unwrap()
    };
    let write = |mesh: &TriMesh, format| write_to(mesh, format, &WriteOptions::default(), &mut Vec::new());
    let highest = shapes::grid(3).positions().view().iter().flatten().fold(f64::MIN, f64::max);
    let warnings = write(&far(highest), Format::Stl).unwrap().warnings;
    assert!(
        warnings.iter().any(|w| w.data_lost && w.text.contains("within single precision")),
        "{warnings:?}"
    );
    assert!(write(&far(highest), Format::Ply).unwrap().warnings.is_empty());
    let error = write(&far(f64::MIN), Format::Stl).unwrap_err().to_string();
    assert_eq!(error, "STL cannot hold positions that are not finite, which all faces have");
}
