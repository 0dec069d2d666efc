//! Conversions between meshes and scenes in memory: the same as by way of the bytes of a GLB.

use std::fs;
use std::io::Cursor;
use std::sync::Arc;

use lodsmith_core::{Attribute, IntegerType, Positions, Semantic, TriMesh, shapes};
use lodsmith_io::gltf::{Compression, Packing, Scene};
use lodsmith_io::{
    Format, Limits, Loaded, ReadError, ReadOptions, Regions, Textures, WriteOptions, read_bytes, read_path,
    write_to,
};
use tempfile::TempDir;

/// A mesh, its regions, and a name for messages.
type NamedMesh = (String, TriMesh, Regions);

/// Reads a file of `testdata`.
fn testdata(name: &str) -> Vec<u8> {
    fs::read(format!("{}/../../testdata/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn read(bytes: &[u8]) -> Loaded {
    read_bytes(bytes, &ReadOptions::default()).unwrap()
}

/// Returns an OBJ of two objects with a material each: one has an image beside the file, one an image that is absent.
/// The image is in the folder.
fn obj() -> (TempDir, Loaded) {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    let mut png = Cursor::new(Vec::new());
    image::RgbaImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    put("grain.png", &png.into_inner());
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
    (folder, all.into_iter().map(|(name, loaded)| (name.to_owned(), loaded.mesh, loaded.regions)).collect())
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
        "1 normals have length zero",
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
