//! Groups, materials and smoothing groups of OBJ: round trips, and copying of libraries and textures.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lodsmith_core::{RegionId, TriMesh, WedgeId};
use lodsmith_io::{
    AssetScope, Format, Loaded, ReadOptions, Textures, Warning, WriteOptions, read_bytes, read_path,
    write_path, write_to,
};
use proptest::prelude::*;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

/// Returns a chair whose later faces return to earlier groups and materials.
fn chair() -> String {
    format!(
        "mtllib chair.mtl\no chair\n{SQUARE}g legs left\nusemtl my wood\ns 1\nf 1/1 2/2 3/3\n\
         g seat\nusemtl cloth\nf 1/1 2/2 3/3 4/4\ng legs left\nusemtl my wood\nf 1/2 3/3 4/4\ns off\nf 1 2 4\n"
    )
}

const LIBRARY: &str = "# by hand\r\nnewmtl my wood\r\nKd 1 1 1\nmap_Kd -s 1 1 1 -bm 0.5 tex\\wood grain.png\r\n\
                       map_Bump -clamp on tex/wood grain.png\nspecial 1 2 3\n\
                       newmtl cloth\nmap_Kd cloth.png\nnorm gone.png\nmap_aat on";

fn read(path: &Path) -> Loaded {
    read_path(path, &ReadOptions::default()).unwrap()
}

fn options_of(loaded: &Loaded, textures: Textures) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.regions = Some(Arc::new(loaded.regions.clone()));
    options.textures = textures;
    options
}

fn text_of(loaded: &Loaded) -> String {
    let mut bytes = Vec::new();
    let options = options_of(loaded, Textures::Copy);
    assert_eq!(write_to(&loaded.mesh, Format::Obj, &options, &mut bytes).unwrap().warnings, []);
    String::from_utf8(bytes).unwrap()
}

/// All names of a region, and the corners of a face.
type FaceWithNames = (Vec<Option<Vec<u8>>>, Vec<[u64; 3]>);

/// Returns the faces with the names of their regions, in the order of writing.
fn faces(loaded: &Loaded) -> Vec<FaceWithNames> {
    let mesh: &TriMesh = &loaded.mesh;
    let place = |w: &WedgeId| mesh.positions().view().get(mesh.vertex_of(*w)).map(f64::to_bits);
    let id = |face: usize| mesh.regions().map_or(RegionId(0), |ids| ids[face]);
    let mut order: Vec<usize> = (0..mesh.face_count()).collect();
    order.sort_by_key(|&face| id(face));
    let face = |face: usize| {
        let r = loaded.regions.get(id(face)).unwrap_or_default();
        let names = [r.object, r.groups, r.material, r.smoothing].map(|n| n.map(<[u8]>::to_vec));
        (names.to_vec(), mesh.triangles()[face].iter().map(place).collect())
    };
    order.into_iter().map(face).collect()
}

/// Images of one pixel. Their type is recognised by their content, not by their names.
const WOOD: &str = "P3 1 1 255 120 80 40";
const CLOTH: &str = "P3 1 1 255 90 90 90";

/// A test folder with a chair, its library and two textures.
struct MaterialFolder {
    folder: tempfile::TempDir,
}

impl MaterialFolder {
    fn new() -> Self {
        let shop = Self { folder: tempfile::tempdir().unwrap() };
        fs::create_dir_all(shop.path("in/tex")).unwrap();
        fs::create_dir(shop.path("out")).unwrap();
        shop.put("in/chair.obj", &chair());
        shop.put("in/chair.mtl", LIBRARY);
        shop.put("in/tex/wood grain.png", WOOD);
        shop.put("in/cloth.png", CLOTH);
        shop
    }
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    fn put(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }
    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }
    fn names(&self, folder: &str) -> Vec<String> {
        let name = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().to_string_lossy().into_owned();
        let mut names: Vec<_> = fs::read_dir(self.path(folder)).unwrap().map(name).collect();
        names.sort();
        names
    }
    fn convert(&self, from: &str, to: &str, textures: Textures) -> Vec<String> {
        let loaded = read(&self.path(from));
        let warnings =
            write_path(&loaded.mesh, &self.path(to), &options_of(&loaded, textures)).unwrap().warnings;
        warnings.iter().map(ToString::to_string).collect()
    }
}

#[test]
fn faces_are_written_by_region_and_lines_only_where_they_change() {
    let loaded = read_bytes(chair().as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(loaded.warnings.len(), 1, "corners without texture coordinates");
    assert_eq!((loaded.regions.len(), loaded.contents.materials, loaded.contents.textures), (3, 2, 0));
    let text = text_of(&loaded);
    let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('v') && !l.starts_with('#')).collect();
    let shown: Vec<&str> = lines.iter().map(|l| if l.starts_with('f') { "f" } else { l }).collect();
    assert_eq!(
        shown,
        [
            "mtllib chair.mtl",
            "o chair",
            "g legs left",
            "usemtl my wood",
            "s 1",
            "f",
            "f",
            "g seat",
            "usemtl cloth",
            "f",
            "f",
            "g legs left",
            "usemtl my wood",
            "s off",
            "f"
        ]
    );
    let again = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(faces(&again), faces(&loaded));
    assert_eq!(text_of(&again), text);
    // Equal texture coordinates are written once.
    assert_eq!(text.lines().filter(|l| l.starts_with("vt ")).count(), 4);
}

#[test]
fn a_single_region_keeps_its_names() {
    let plain = read_bytes(format!("{SQUARE}f 1 2 3\n").as_bytes(), &ReadOptions::default()).unwrap();
    let mut bytes = Vec::new();
    write_to(&plain.mesh, Format::Obj, &WriteOptions::default(), &mut bytes).unwrap();
    assert_eq!(text_of(&plain).as_bytes(), bytes);
    let text = format!("o a\ng\n{SQUARE}usemtl x\ns 3\nf 1 2 3\n");
    let one = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap();
    assert!(one.mesh.regions().is_none());
    assert!(text_of(&one).contains("o a\ng\nusemtl x\ns 3\nf "));
}

#[test]
fn names_shared_by_all_regions_are_kept_without_regions() {
    let mut loaded = read_bytes(chair().as_bytes(), &ReadOptions::default()).unwrap();
    Arc::make_mut(&mut loaded.mesh).set_regions(None).unwrap();
    let mut bytes = Vec::new();
    let warnings = write_to(&loaded.mesh, Format::Obj, &options_of(&loaded, Textures::Copy), &mut bytes)
        .unwrap()
        .warnings;
    let lost =
        "groups, materials, smoothing groups dropped: the mesh does not store which faces they belong to";
    assert_eq!(warnings, [Warning::lost(lost)]);
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("\no chair\nf ") && !text.contains("mtl"), "{text}");
}

#[test]
fn other_formats_say_what_they_lose() {
    for (lines, lost) in [
        ("o a\ng b\ns off\n", None),
        ("usemtl a\n", Some("materials")),
        ("mtllib a.mtl\n", Some("materials")),
        ("g a\nf 1 2 3\ng b\no c\n", Some("objects, groups")),
        ("s 1\nf 1 2 3\nusemtl a\ns 2\n", Some("materials, smoothing groups")),
    ] {
        let text = format!("{SQUARE}{lines}f 1 2 3\n");
        let loaded = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap();
        let got = write_to(&loaded.mesh, Format::Stl, &options_of(&loaded, Textures::Copy), &mut Vec::new());
        let lost = lost.map(|lost| Warning::lost(format!("STL cannot carry {lost}: dropped")));
        assert_eq!(got.unwrap().warnings, Vec::from_iter(lost), "{lines}");
    }
}

#[test]
fn libraries_and_textures_are_counted() {
    let shop = MaterialFolder::new();
    let loaded = read(&shop.path("in/chair.obj"));
    assert_eq!((loaded.contents.materials, loaded.contents.textures), (2, 3));
    let text = format!("mtllib my lib.mtl none.mtl\n{SQUARE}usemtl x\nf 1 2 3\n");
    shop.put("in/two.obj", &text);
    shop.put("in/my lib.mtl", "newmtl x\nmap_Kd a.png\nnewmtl y\nmap_Kd a.png");
    let loaded = read(&shop.path("in/two.obj"));
    assert_eq!((loaded.contents.materials, loaded.contents.textures), (2, 1));
    let wanted = "material library none.mtl was not found: its materials are unknown";
    assert_eq!(loaded.warnings, [Warning::note(wanted)]);
}

#[test]
fn copies_lie_beside_the_output_and_the_rest_is_kept() {
    let shop = MaterialFolder::new();
    let warnings = shop.convert("in/chair.obj", "out/my seat.obj", Textures::Copy);
    assert_eq!(warnings, ["texture gone.png was not found: its name is kept"]);
    assert_eq!(shop.names("out"), ["cloth.png", "my seat.mtl", "my seat.obj", "wood grain.png"]);
    let wanted = LIBRARY.replace("tex\\wood", "wood").replace("tex/wood", "wood");
    assert_eq!(shop.text("out/my seat.mtl"), format!("# Lodsmith\n{wanted}"));
    assert!(shop.text("out/my seat.obj").starts_with("# Lodsmith\nmtllib my seat.mtl\n"));
    assert_eq!(shop.text("out/wood grain.png"), WOOD);
    let [before, after] = ["in/chair.obj", "out/my seat.obj"].map(|name| read(&shop.path(name)));
    assert_eq!(faces(&before), faces(&after));
    assert_eq!(after.contents.materials, 2);
    // Converting again, and converting the result: no duplicates are created.
    shop.convert("in/chair.obj", "out/my seat.obj", Textures::Copy);
    shop.convert("out/my seat.obj", "out/b.obj.gz", Textures::Copy);
    let names = ["b.mtl", "b.obj.gz", "cloth.png", "my seat.mtl", "my seat.obj", "wood grain.png"];
    assert_eq!(shop.names("out"), names);
    assert_eq!(shop.text("out/b.mtl"), shop.text("out/my seat.mtl"));
}

#[test]
fn other_files_of_the_same_name_are_left_alone() {
    let shop = MaterialFolder::new();
    shop.put("out/cloth.png", "silk!");
    shop.put("out/cloth_1.png", CLOTH);
    shop.put("out/wood grain.png", "oak");
    shop.put("out/chair.mtl", "newmtl somebody else's");
    shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(shop.text("out/cloth.png"), "silk!");
    assert_eq!(shop.text("out/chair.mtl"), "newmtl somebody else's");
    let library = shop.text("out/chair_1.mtl");
    assert!(library.contains("map_Kd cloth_1.png\n"), "{library}");
    assert!(library.contains("map_Kd -s 1 1 1 -bm 0.5 wood grain_1.png\r\n"), "{library}");
    assert!(shop.text("out/chair.obj").contains("mtllib chair_1.mtl\n"));
    assert_eq!(shop.names("out").len(), 7);
}

#[test]
fn in_its_own_folder_everything_stays_where_it_is() {
    let shop = MaterialFolder::new();
    let before = shop.names("in");
    shop.convert("in/chair.obj", "in/chair.obj", Textures::Copy);
    assert_eq!(shop.names("in"), before);
    assert_eq!(shop.text("in/chair.mtl"), LIBRARY);
    shop.convert("in/chair.obj", "in/low.obj", Textures::Copy);
    let library = shop.text("in/low.mtl");
    assert_eq!(library, format!("# Lodsmith\n{LIBRARY}"));
    assert_eq!(shop.names("in").len(), before.len() + 2);
}

#[test]
fn linked_paths_are_relative_and_none_drops_materials() {
    let shop = MaterialFolder::new();
    shop.convert("in/chair.obj", "out/linked.obj", Textures::Link);
    assert_eq!(shop.names("out"), ["linked.mtl", "linked.obj"]);
    let library = shop.text("out/linked.mtl");
    assert!(library.contains("map_Kd -s 1 1 1 -bm 0.5 ../in/tex/wood grain.png\r\n"), "{library}");
    assert!(library.contains("map_Kd ../in/cloth.png\nnorm gone.png\n"), "{library}");
    let warnings = shop.convert("in/chair.obj", "out/bare.obj", Textures::None);
    assert_eq!(warnings, ["materials dropped: --textures none"]);
    let text = shop.text("out/bare.obj");
    assert!(!text.contains("mtl") && text.contains("g seat\n"), "{text}");
    assert_eq!(shop.names("out"), ["bare.obj", "linked.mtl", "linked.obj"]);
}

#[test]
fn names_of_what_is_missing_are_kept() {
    let shop = MaterialFolder::new();
    fs::remove_file(shop.path("in/chair.mtl")).unwrap();
    let warnings = shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert!(warnings.is_empty(), "{warnings:?}");
    let text = shop.text("out/chair.obj");
    assert!(text.contains("mtllib chair.mtl\n") && text.contains("usemtl my wood\n"), "{text}");
    assert_eq!(shop.names("out"), ["chair.obj"]);
}

#[test]
fn only_files_are_copied_and_a_failure_leaves_nothing() {
    let shop = MaterialFolder::new();
    fs::remove_file(shop.path("in/cloth.png")).unwrap();
    fs::create_dir(shop.path("in/cloth.png")).unwrap();
    let warnings = shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(warnings[0], "texture cloth.png is not a regular file: its name is kept");
    let loaded = read(&shop.path("in/chair.obj"));
    fs::create_dir(shop.path("out/folder.obj")).unwrap();
    for (name, wanted) in [("none/a.obj", "there is no folder"), ("out/folder.obj", "it is a folder")] {
        let options = options_of(&loaded, Textures::Copy);
        let error = write_path(&loaded.mesh, &shop.path(name), &options).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
    assert_eq!(shop.names("out"), ["chair.mtl", "chair.obj", "folder.obj", "wood grain.png"]);
}

#[cfg(unix)]
#[test]
fn a_link_is_copied_under_its_own_name() {
    let shop = MaterialFolder::new();
    fs::rename(shop.path("in/cloth.png"), shop.path("in/tex/0f3a")).unwrap();
    std::os::unix::fs::symlink("tex/0f3a", shop.path("in/cloth.png")).unwrap();
    shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(shop.names("out"), ["chair.mtl", "chair.obj", "cloth.png", "wood grain.png"]);
    assert!(fs::symlink_metadata(shop.path("out/cloth.png")).unwrap().is_file());
}

const OUTSIDE: &str = "is outside the folder of the model (--asset-root DIR or --allow-outside permits it)";

/// Returns asset scopes, and whether a file outside the folder is in each.
fn scopes(shop: &MaterialFolder) -> [(AssetScope, bool); 4] {
    let all = shop.folder.path().to_owned();
    [
        (AssetScope::Folder, false),
        (AssetScope::Root(shop.path("in")), false),
        (AssetScope::Root(all), true),
        (AssetScope::Anywhere, true),
    ]
}

fn read_within(shop: &MaterialFolder, scope: AssetScope) -> Loaded {
    let mut options = ReadOptions::default();
    options.assets = scope;
    read_path(&shop.path("in/chair.obj"), &options).unwrap()
}

#[test]
fn a_material_library_outside_the_folder_is_left_out() {
    let shop = MaterialFolder::new();
    shop.put("secret.mtl", "newmtl cloth\n# a word that nobody else may read\n");
    for name in ["../secret.mtl".to_owned(), shop.path("secret.mtl").display().to_string()] {
        shop.put("in/chair.obj", &chair().replace("chair.mtl", &name));
        for (scope, is_read) in scopes(&shop) {
            let loaded = read_within(&shop, scope);
            let warnings: Vec<_> = loaded.warnings.iter().filter(|w| w.text.contains(OUTSIDE)).collect();
            assert_eq!(warnings.is_empty(), is_read, "{warnings:?}");
            write_path(&loaded.mesh, &shop.path("out/a.obj"), &options_of(&loaded, Textures::Copy)).unwrap();
            let written =
                shop.names("out").iter().any(|name| shop.text(&format!("out/{name}")).contains("nobody"));
            assert_eq!(written, is_read);
            fs::remove_dir_all(shop.path("out")).unwrap();
            fs::create_dir(shop.path("out")).unwrap();
        }
    }
}

#[test]
fn a_texture_outside_the_folder_is_not_copied() {
    let shop = MaterialFolder::new();
    shop.put("secret.ppm", WOOD);
    for name in ["../secret.ppm".to_owned(), shop.path("secret.ppm").display().to_string()] {
        shop.put("in/chair.mtl", &format!("newmtl cloth\nmap_Kd {name}\n"));
        for (scope, is_copied) in scopes(&shop) {
            // (From here the relative path leads elsewhere.)
            fs::create_dir(shop.path("out/deep")).unwrap();
            let loaded = read_within(&shop, scope);
            let warnings =
                write_path(&loaded.mesh, &shop.path("out/deep/a.obj"), &options_of(&loaded, Textures::Copy))
                    .unwrap()
                    .warnings;
            assert_eq!(shop.path("out/deep/secret.ppm").exists(), is_copied);
            let warnings: Vec<_> = warnings.iter().filter(|w| w.text.contains(OUTSIDE)).collect();
            assert_eq!(warnings.is_empty(), is_copied, "{warnings:?}");
            fs::remove_dir_all(shop.path("out/deep")).unwrap();
        }
    }
    // It is not embedded in a glTF file either.
    let loaded = read_within(&shop, AssetScope::Folder);
    let mut glb = Vec::new();
    let warnings =
        write_to(&loaded.mesh, Format::Glb, &options_of(&loaded, Textures::Copy), &mut glb).unwrap().warnings;
    assert!(warnings.iter().any(|w| w.text.contains(OUTSIDE)), "{warnings:?}");
    assert!(!glb.windows(WOOD.len()).any(|bytes| bytes == WOOD.as_bytes()));
}

#[cfg(unix)]
#[test]
fn a_link_out_of_the_folder_is_not_followed() {
    let shop = MaterialFolder::new();
    shop.put("secret.ppm", WOOD);
    fs::remove_file(shop.path("in/cloth.png")).unwrap();
    std::os::unix::fs::symlink("../secret.ppm", shop.path("in/cloth.png")).unwrap();
    let warnings = shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(warnings[0], format!("texture cloth.png {OUTSIDE}: its name is kept"));
    assert_eq!(shop.names("out"), ["chair.mtl", "chair.obj", "wood grain.png"]);
}

#[test]
fn a_text_is_not_copied_as_a_texture() {
    let shop = MaterialFolder::new();
    shop.put("in/cloth.png", "user = me\npassword = tree\n");
    let warnings = shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(warnings[0], "texture cloth.png is not an image of a known type: its name is kept");
    assert_eq!(shop.names("out"), ["chair.mtl", "chair.obj", "wood grain.png"]);
}

#[test]
fn a_text_without_materials_is_no_material_library() {
    let shop = MaterialFolder::new();
    shop.put("in/chair.mtl", "user = me\npassword = tree\n");
    let loaded = read(&shop.path("in/chair.obj"));
    let wanted = "material library chair.mtl has no line that begins with newmtl, so it is not a material library: its \
                materials are unknown";
    assert!(loaded.warnings.contains(&Warning::note(wanted)), "{:?}", loaded.warnings);
    shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(shop.names("out"), ["chair.obj"]);
}

#[test]
fn very_many_missing_textures_give_few_warnings() {
    let shop = MaterialFolder::new();
    let many: String = (0..20_000).map(|i| format!("map_Kd {i}.png\n")).collect();
    let many = format!("newmtl my wood\n{many}");
    shop.put("in/chair.mtl", &many);
    let warnings = shop.convert("in/chair.obj", "out/chair.obj", Textures::Copy);
    assert_eq!(
        (warnings.len(), warnings[16].as_str()),
        (17, "19984 more textures cannot be copied or linked")
    );
    assert_eq!(shop.text("out/chair.mtl"), format!("# Lodsmith\n{many}"));
}

#[test]
fn a_group_for_each_face_under_a_long_name_takes_no_square_time() {
    let mut text = format!("{SQUARE}o {}\n", "x".repeat(1_000_000));
    (0..100_000).for_each(|i| text.push_str(&format!("g {i}\nf 1 2 3\n")));
    let loaded = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(loaded.regions.len(), 100_000);
    let written = text_of(&loaded);
    assert_eq!(written.matches("\no x").count(), 1);
    assert!(written.ends_with("g 99999\nf 1 2 3\n"));
}

/// Generates fragments of OBJ and library lines.
fn words() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec![
        "o",
        "g",
        "s",
        "usemtl",
        "mtllib",
        "newmtl",
        "map_Kd",
        "bump",
        "-s",
        "-bm",
        "-mm",
        "1",
        "0.5",
        "on",
        "a",
        "b.mtl",
        "c.png",
        "\\",
        "\\\n",
        "\n",
        "\r\n",
        " ",
        "\t",
        "\"",
        "#",
        "\u{0}",
        "ü",
        "f 1 2 3\n",
        "f 1 2 3 4\n",
    ]);
    prop::collection::vec(word, 0..60).prop_map(|words| words.join(" "))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// With any lines between faces and in libraries, reading and writing succeed and agree.
    #[test]
    fn lines_of_any_kind_do_no_harm(obj in words(), library in words()) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("b.mtl"), &library).unwrap();
        fs::write(folder.path().join("c.png"), "c").unwrap();
        fs::create_dir(folder.path().join("out")).unwrap();
        let text = format!("mtllib b.mtl\n{SQUARE}f 1 2 3\n{obj}\nf 1 2 3\n");
        let mut options = ReadOptions::default();
        options.folder = Some(folder.path().to_owned());
        // Control characters prevent the detection as text, so the format is given.
        options.format = Some(Format::Obj);
        let loaded = read_bytes(text.as_bytes(), &options).unwrap();
        let out = folder.path().join("out/a.obj");
        write_path(&loaded.mesh, &out, &options_of(&loaded, Textures::Copy)).unwrap();
        options.folder = None;
        let again = read_path(&out, &options).unwrap();
        prop_assert_eq!(faces(&again), faces(&loaded));
    }
}
