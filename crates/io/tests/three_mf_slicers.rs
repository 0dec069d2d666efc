//! Files of slicers: what they paint, subtract and do not print, and their settings.
//!
//! The files are as PrusaSlicer and BambuStudio write them (sources: `src/three_mf/marks.rs`), but smaller.

use std::io::{Cursor, Read as _, Write};
use std::time::{Duration, Instant};

use lodsmith_core::{TriMesh, WedgeId};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, Warning, read_bytes, read_scene_bytes, write_scene_to};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const VERTICES: &str = r#"<vertices><vertex x="0" y="0" z="0"/><vertex x="10" y="0" z="0"/>
<vertex x="0" y="10" z="0"/><vertex x="0" y="0" z="10"/></vertices>"#;
const TRIANGLES: [&str; 4] = [
    r#"v1="0" v2="2" v3="1""#,
    r#"v1="0" v2="1" v3="3""#,
    r#"v1="1" v2="2" v3="3""#,
    r#"v1="0" v2="3" v3="2""#,
];
const RELATIONS: &str = r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
<Relationship Target="/Metadata/thumbnail.png" Id="b" Type="http://schemas.openxmlformats.org/package/2006/relationships/metadata/thumbnail"/>
</Relationships>"#;
const TYPES: &str = r#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="config" ContentType="text/plain"/></Types>"#;

fn scene_of(bytes: &[u8]) -> Scene {
    read_scene_bytes(bytes, &ReadOptions::default()).unwrap().unwrap()
}

fn written(scene: &Scene, replaced: &[Option<TriMesh>], format: Format) -> (Vec<u8>, Vec<Warning>) {
    let mut out = Vec::new();
    let written = write_scene_to(scene, replaced, format, &|_| None, &mut out).unwrap();
    (out, written.warnings)
}

fn losses(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().filter(|w| w.data_lost).map(|w| &*w.text).collect()
}

fn part(bytes: &[u8], name: &str) -> Option<String> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut text = String::new();
    archive.by_name(name).ok()?.read_to_string(&mut text).unwrap();
    Some(text)
}

fn model_of(bytes: &[u8]) -> String {
    part(bytes, "3D/3dmodel.model").unwrap()
}

/// Returns the elements of an XML text that begin with this.
fn elements<'t>(text: &'t str, begin: &str) -> Vec<&'t str> {
    text.lines().map(str::trim).filter(|line| line.starts_with(begin)).collect()
}

/// Returns a file of this model and further parts.
fn package(model: &str, parts: &[(&str, &str)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let head = r#"<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:slic3rpe="http://schemas.slic3r.org/3mf/2017/06" xmlns:BambuStudio="http://schemas.bambulab.com/package/2021"
 xmlns:t="http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07">"#;
    let model = format!("{head}{model}</model>");
    let own = [("_rels/.rels", RELATIONS), ("[Content_Types].xml", TYPES), ("3D/3dmodel.model", &*model)];
    for (name, text) in own.iter().chain(parts) {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Returns an object whose triangles have these further attributes, in two pieces if there are eight.
fn object(id: u32, attributes: &str, of_triangles: &[&str], after: &str) -> String {
    let mut vertices = VERTICES.to_owned();
    if of_triangles.len() > 4 {
        let further = vertices.replace("<vertices>", "").replace(r#"x="0""#, r#"x="5""#);
        vertices = vertices.replace("</vertices>", &further);
    }
    let triangle = |(at, more): (usize, &&str)| {
        let corners = match at < 4 {
            true => TRIANGLES[at].to_owned(),
            false => TRIANGLES[at - 4]
                .replace('3', "7")
                .replace("v7", "v3")
                .replace(r#""2""#, r#""6""#)
                .replace(r#""1""#, r#""5""#)
                .replace(r#""0""#, r#""4""#),
        };
        format!("<triangle {corners} {more}/>")
    };
    let triangles: String = of_triangles.iter().enumerate().map(triangle).collect();
    format!(
        r#"<object id="{id}" {attributes}><mesh>{vertices}<triangles>{triangles}</triangles>{after}</mesh></object>"#
    )
}

/// Returns a mesh of the first triangles of a mesh, in their regions.
fn first_faces(mesh: &TriMesh, count: usize) -> TriMesh {
    let map = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(WedgeId::new(w))).collect();
    let triangles = mesh.triangles()[..count].to_vec();
    let mut new = TriMesh::with_wedges(mesh.positions().clone(), map, triangles).unwrap();
    if let Some(regions) = mesh.regions() {
        new.set_regions(Some(regions[..count].to_vec())).unwrap();
    }
    new
}

const PRUSA: &str = "Metadata/Slic3r_PE_model.config";
const PRUSA_CONFIG: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<config>
 <object id="7" instances_count="2">
  <metadata type="object" key="name" value="body &amp; hole"/>
  <volume firstid="0" lastid="3">
   <metadata type="volume" key="volume_type" value="ModelPart"/>
  </volume>
  <volume firstid="4" lastid="7">
   <metadata type="volume" key="volume_type" value="NegativeVolume"/>
  </volume>
 </object>
</config>"#;

/// A project of PrusaSlicer: a body with a hole, placed twice, with painted supports; a triangle is painted in part.
fn prusa() -> Vec<u8> {
    let painted = [
        r#"slic3rpe:custom_supports="4""#,
        "",
        r#"slic3rpe:custom_supports="441""#,
        r#"slic3rpe:custom_seam="8""#,
    ];
    let triangles = [painted[0], painted[1], painted[2], painted[3], "", "", "", ""];
    let model = format!(
        r#"<metadata name="slic3rpe:Version3mf">1</metadata><metadata name="Application">PrusaSlicer-2.8.0</metadata>
<resources>{}</resources><build><item objectid="7"/>
<item objectid="7" transform="1 0 0 0 1 0 0 0 1 50 0 0" printable="0"/></build>"#,
        object(7, r#"name="body" type="model""#, &triangles, "")
    );
    let parts = [
        (PRUSA, PRUSA_CONFIG),
        ("Metadata/thumbnail.png", "a picture"),
        ("Metadata/Slic3r_PE.config", "; layer_height = 0.2"),
        ("Metadata/plate_1.gcode", "G1"),
    ];
    package(&model, &parts)
}

#[test]
fn a_project_of_prusaslicer_comes_back() {
    let scene = scene_of(&prusa());
    assert_eq!(
        losses(scene.warnings()),
        ["1 file of a sliced model is not kept (metadata/plate_1.gcode first)"]
    );
    // The hole is no part of the shape.
    assert_eq!(scene.meshes().len(), 2);
    assert_eq!(scene.bounds().unwrap().max.map(|x| (x * 1e3).round()), [60.0, 10.0, 0.0]);
    let (bytes, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let text = model_of(&bytes);
    assert_eq!(elements(&text, "<object"), [r#"<object id="7" type="model" name="body">"#]);
    assert_eq!(elements(&text, "<vertex").len(), 8);
    let of_read = |text: &str| {
        let mut all = elements(text, "<triangle ").iter().map(|t| t.replace(" />", "/>")).collect::<Vec<_>>();
        all.sort();
        all
    };
    let expected = [
        r#"<triangle v1="0" v2="1" v3="3"/>"#,
        r#"<triangle v1="0" v2="2" v3="1" slic3rpe:custom_supports="4"/>"#,
        r#"<triangle v1="0" v2="3" v3="2" slic3rpe:custom_seam="8"/>"#,
        r#"<triangle v1="1" v2="2" v3="3" slic3rpe:custom_supports="441"/>"#,
        r#"<triangle v1="4" v2="5" v3="7"/>"#,
        r#"<triangle v1="4" v2="6" v3="5"/>"#,
        r#"<triangle v1="4" v2="7" v3="6"/>"#,
        r#"<triangle v1="5" v2="6" v3="7"/>"#,
    ];
    assert_eq!(of_read(&text), expected);
    let items = [
        r#"<item objectid="7"/>"#,
        r#"<item objectid="7" transform="1 0 0 0 1 0 0 0 1 50 0 0" printable="0"/>"#,
    ];
    assert_eq!(elements(&text, "<item"), items);
    assert!(text.contains(r#" xmlns:slic3rpe="http://schemas.slic3r.org/3mf/2017/06""#), "{text}");
    assert!(text.contains(r#"<metadata name="slic3rpe:Version3mf">1</metadata>"#), "{text}");
    assert!(text.contains(r#"<metadata name="Application">PrusaSlicer-2.8.0</metadata>"#), "{text}");
    assert_eq!(part(&bytes, PRUSA).unwrap(), PRUSA_CONFIG);
    assert_eq!(part(&bytes, "Metadata/thumbnail.png").unwrap(), "a picture");
    assert_eq!(part(&bytes, "Metadata/Slic3r_PE.config").unwrap(), "; layer_height = 0.2");
    assert_eq!(part(&bytes, "Metadata/plate_1.gcode"), None);
    let relations = part(&bytes, "_rels/.rels").unwrap();
    assert!(relations.contains(r#"Target="/Metadata/thumbnail.png""#), "{relations}");
    let types = part(&bytes, "[Content_Types].xml").unwrap();
    assert!(types.contains(r#"Extension="config" ContentType="text/plain""#), "{types}");
}

#[test]
fn ranges_and_paint_follow_a_reduction() {
    let scene = scene_of(&prusa());
    let mesh = &scene.meshes()[0].mesh;
    // Paint makes regions: without, a little, supports, seam.
    assert_eq!(mesh.regions().unwrap().len(), 4);
    let (bytes, warnings) = written(&scene, &[Some(first_faces(mesh, 3))], Format::ThreeMf);
    assert_eq!(
        losses(&warnings),
        ["paint of parts of 1 triangle is dropped: the paint of the largest part is kept"]
    );
    let text = model_of(&bytes);
    assert_eq!(elements(&text, "<triangle ").len(), 7);
    assert_eq!(text.matches(r#"slic3rpe:custom_supports="4""#).count(), 2, "{text}");
    let config = part(&bytes, PRUSA).unwrap();
    assert_eq!(
        elements(&config, "<volume"),
        [r#"<volume firstid="0" lastid="2">"#, r#"<volume firstid="3" lastid="6">"#]
    );
    // Read again, the hole is still one.
    assert_eq!(read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh.face_count(), 6);
}

#[test]
fn a_mesh_has_only_what_is_printed() {
    let loaded = read_bytes(&prusa(), &ReadOptions::default()).unwrap();
    assert_eq!(loaded.mesh.face_count(), 8);
    let expected = [
        "1 file of a sliced model is not kept (metadata/plate_1.gcode first)",
        "2 hidden meshes (what a slicer does not print) left out",
        "names of nodes and meshes are not carried: only a scene that is written as glTF or GLB keeps them",
        "marks of parts that are not printed are dropped: only 3MF keeps them",
        "what a slicer painted on triangles is dropped: only 3MF keeps them",
        "settings and pictures of a slicer are dropped: 3 files are kept in 3MF only",
    ];
    let all = losses(&loaded.warnings);
    for text in expected {
        assert!(all.contains(&text), "{text}: {all:?}");
    }
}

const BAMBU: &str = "Metadata/model_settings.config";

fn bambu(second_id: u32) -> Vec<u8> {
    let model = format!(
        r#"<metadata name="Application">BambuStudio-02.00.00.95</metadata><metadata name="BambuStudio:3mfVersion">1</metadata>
<resources>{}{}<object id="5" type="model"><components><component objectid="1"/>
<component objectid="2" transform="1 0 0 0 1 0 0 0 1 1 2 3"/></components></object></resources>
<build><item objectid="5" printable="1"/><item objectid="5" transform="1 0 0 0 1 0 0 0 1 50 0 0"/></build>"#,
        object(1, r#"type="model""#, &[r#"paint_color="0C""#, r#"paint_color="0C""#, "", ""], ""),
        object(2, r#"type="model""#, &[""; 4], ""),
    );
    let config = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<config>
  <object id="5">
    <part id="1" subtype="normal_part">
      <mesh_stat face_count="4" edges_fixed="0"/>
    </part>
    <part id="{second_id}" subtype="negative_part">
      <mesh_stat face_count="4" edges_fixed="0"/>
    </part>
  </object>
</config>"#
    );
    package(&model, &[(BAMBU, &config), ("Metadata/project_settings.config", "{}")])
}

#[test]
fn a_project_of_bambustudio_comes_back() {
    let scene = scene_of(&bambu(2));
    assert_eq!(losses(scene.warnings()), [""; 0]);
    let mesh = &scene.meshes()[0].mesh;
    for (kept, count) in [(None, 4), (Some(first_faces(mesh, 3)), 3)] {
        let (bytes, warnings) = written(&scene, &[kept], Format::ThreeMf);
        assert_eq!(losses(&warnings), [""; 0]);
        let text = model_of(&bytes);
        let objects = [
            r#"<object id="1" type="model">"#,
            r#"<object id="2" type="model">"#,
            r#"<object id="5" type="model">"#,
        ];
        assert_eq!(elements(&text, "<object"), objects);
        let components = [
            r#"<component objectid="1"/>"#,
            r#"<component objectid="2" transform="1 0 0 0 1 0 0 0 1 1 2 3"/>"#,
        ];
        assert_eq!(elements(&text, "<component "), components);
        assert_eq!(elements(&text, "<item").len(), 2);
        assert_eq!(text.matches(r#" paint_color="0C""#).count(), 2);
        assert!(text.contains("BambuStudio-02.00.00.95") && !text.contains("Lodsmith"), "{text}");
        let config = part(&bytes, BAMBU).unwrap();
        let stats = [
            format!(r#"<mesh_stat face_count="{count}" edges_fixed="0"/>"#),
            r#"<mesh_stat face_count="4" edges_fixed="0"/>"#.to_owned(),
        ];
        assert_eq!(elements(&config, "<mesh_stat"), stats);
        assert_eq!(part(&bytes, "Metadata/project_settings.config").unwrap(), "{}");
        assert_eq!(read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh.face_count(), 2 * count);
    }
    // Without faces, it is gone from the settings too.
    let (bytes, _) = written(&scene, &[Some(first_faces(mesh, 0))], Format::ThreeMf);
    assert_eq!(elements(&part(&bytes, BAMBU).unwrap(), "<part").len(), 1);
}

#[test]
fn types_and_marks_of_items_come_back() {
    let model = format!(
        r#"<resources>{}{}{}</resources><build><item objectid="1"/><item objectid="2"/><item objectid="3" printable="0"/></build>"#,
        object(1, "", &[""; 4], ""),
        object(2, r#"type="support""#, &[""; 4], ""),
        object(3, r#"type="surface""#, &[""; 4], ""),
    );
    let bytes = package(&model, &[]);
    let scene = scene_of(&bytes);
    let (again, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let text = model_of(&again);
    let kinds: Vec<&str> = elements(&text, "<object").iter().map(|e| e.split('"').nth(3).unwrap()).collect();
    assert_eq!(kinds, ["model", "support", "surface"]);
    assert_eq!(text.matches(r#"printable="0""#).count(), 1);
    assert!(text.contains(r#"<metadata name="Application">Lodsmith</metadata>"#));
    assert_eq!(read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh.face_count(), 8);
    // In GLB it is hidden, and marks are extras; from there they come back.
    let (glb, warnings) = written(&scene, &[], Format::Glb);
    let hidden = "1 part that a slicer does not print is hidden (KHR_node_visibility), which many programs do not know";
    assert_eq!(losses(&warnings), [hidden]);
    let (again, warnings) = written(&scene_of(&glb), &[], Format::ThreeMf);
    let left_out = "1 hidden mesh (what a slicer does not print) left out";
    assert_eq!(losses(&warnings), [left_out]);
    let text = model_of(&again);
    assert_eq!((elements(&text, "<object").len(), text.matches(r#"printable="0""#).count()), (2, 1));
}

#[test]
fn sets_of_triangles_are_regions() {
    let sets = r#"<t:trianglesets><t:triangleset name="a &amp; b" identifier="x"><t:refrange startindex="0" endindex="2"/>
<t:ref index="1"/></t:triangleset><t:triangleset name="c" identifier="y"><t:ref index="2"/></t:triangleset></t:trianglesets>"#;
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1"/></build>"#,
        object(1, "", &[""; 4], sets)
    );
    let scene = scene_of(&package(&model, &[]));
    let mesh = &scene.meshes()[0].mesh;
    assert_eq!(mesh.regions().unwrap().iter().map(|r| r.index()).collect::<Vec<_>>(), [0, 0, 1, 2]);
    let (bytes, warnings) = written(&scene, &[Some(first_faces(mesh, 3))], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let text = model_of(&bytes);
    let expected = [
        r#"<t:trianglesets>"#,
        r#"<t:triangleset name="a &amp; b" identifier="x">"#,
        r#"<t:ref index="0"/>"#,
        r#"<t:ref index="1"/>"#,
        r#"<t:ref index="2"/>"#,
        r#"<t:triangleset name="c" identifier="y">"#,
        r#"<t:ref index="2"/>"#,
    ];
    assert_eq!(elements(&text, "<t:"), expected);
    let beyond = sets.replace(r#"index="2""#, r#"index="4""#);
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1"/></build>"#,
        object(1, "", &[""; 4], &beyond)
    );
    let scene = scene_of(&package(&model, &[]));
    assert_eq!(
        losses(scene.warnings()),
        ["sets of triangles are too many, or name triangles that are not there: dropped"]
    );
}

/// Returns a file with a part `3D/Objects/object_1.model` and so on for each of these lists of objects.
fn package_of_parts(resources: &str, build: &str, objects: &[String], further: &[(&str, &str)]) -> Vec<u8> {
    let model = format!(r#"<resources>{resources}</resources><build>{build}</build>"#);
    let head =
        r#"<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">"#;
    let of = |all: &String| format!("{head}<resources>{all}</resources><build/></model>");
    let all: Vec<(String, String)> =
        objects.iter().zip(1..).map(|(all, at)| (format!("3D/Objects/object_{at}.model"), of(all))).collect();
    let parts: Vec<(&str, &str)> = all.iter().map(|(name, text)| (&**name, &**text)).collect();
    package(&model, &[&parts, further].concat())
}

/// BambuStudio writes each object into its own part, with an object of components in the first one, whose settings name
/// the components by number alone. It numbers them through all parts; other programs begin again in each. (Source:
/// BambuStudio, `src/libslic3r/Format/bbs_3mf.cpp`, `_add_model_file_to_archive`, `_add_object_components_to_stream` and
/// `_generate_volumes_new`.)
#[test]
fn objects_of_one_number_in_several_parts_keep_their_roles() {
    let assembly = |id: u32, part: u32| {
        let component = |object: u32| {
            format!(r#"<component p:path="/3D/Objects/object_{part}.model" objectid="{object}"/>"#)
        };
        let components = component(1) + &component(2);
        format!(r#"<object id="{id}" type="model"><components>{components}</components></object>"#)
    };
    let two =
        |kind: &str| object(1, "", &[""; 4], "") + &object(2, &format!(r#"type="{kind}""#), &[""; 4], "");
    let config = r#"<config>
<object id="3">
<part id="1" subtype="normal_part"/>
<part id="2" subtype="negative_part"/>
</object>
<object id="4">
<part id="1" subtype="modifier_part"/>
<part id="2" subtype="normal_part"/>
</object>
</config>"#;
    let items = r#"<item objectid="3"/><item objectid="4" transform="1 0 0 0 1 0 0 0 1 50 0 0"/>"#;
    let resources = assembly(3, 1) + &assembly(4, 2);
    let bytes = package_of_parts(&resources, items, &[two("other"), two("model")], &[(BAMBU, config)]);
    let scene = scene_of(&bytes);
    assert_eq!(losses(scene.warnings()), [""; 0]);
    let (again, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let expected = config.replace(r#""1" subtype="normal"#, r#""5" subtype="normal"#);
    let expected = expected.replace(r#""2" subtype="negative"#, r#""6" subtype="negative"#);
    assert_eq!(part(&again, BAMBU).unwrap(), expected);
    let text = model_of(&again);
    let mut components: Vec<&str> = elements(&text, "<component ");
    components.sort_unstable();
    let expected = ["1", "2", "5", "6"].map(|id| format!(r#"<component objectid="{id}"/>"#));
    assert_eq!(components, expected);
    // The solid ones are the first at 0 and the second at 50.
    for bytes in [bytes, again] {
        let mesh = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
        assert_eq!((mesh.face_count(), mesh.positions().view().bounds().unwrap().max[0]), (8, 60.0));
    }
    // An object of the first part has its own number.
    let resources = object(1, "", &[""; 4], "") + &assembly(3, 1);
    let items = r#"<item objectid="1"/><item objectid="3"/>"#;
    let config = r#"<config><object id="1"><metadata key="name" value="a"/></object><object id="3"><part id="1" subtype="negative_part"/></object></config>"#;
    let bytes = package_of_parts(&resources, items, &[two("model")], &[(BAMBU, config)]);
    let (again, warnings) = written(&scene_of(&bytes), &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    assert_eq!(part(&again, BAMBU).unwrap(), config.replace(r#"<part id="1""#, r#"<part id="4""#));
}

#[test]
fn settings_of_one_part_for_two_objects_are_a_loss() {
    let component =
        |part: u32| format!(r#"<component p:path="/3D/Objects/object_{part}.model" objectid="1"/>"#);
    let components = component(1) + &component(2);
    let resources = format!(r#"<object id="3"><components>{components}</components></object>"#);
    let one = object(1, "", &[""; 4], "");
    let config = r#"<config><object id="3"><part id="1" subtype="negative_part"/></object></config>"#;
    let item = r#"<item objectid="3"/>"#;
    let bytes = package_of_parts(&resources, item, &[one.clone(), one], &[(BAMBU, config)]);
    let text = "settings of one part of object 3 are those of several objects: only one has them";
    assert_eq!(losses(scene_of(&bytes).warnings()), [text]);
}

/// BambuStudio lists the parts of an object by their depth (source: as above, `_generate_current_object_list`).
#[test]
fn parts_of_assemblies_in_assemblies_keep_their_roles() {
    let places = |all: &[(u32, u32)]| -> String {
        let place = |(id, x): &(u32, u32)| {
            format!(r#"<component objectid="{id}" transform="1 0 0 0 1 0 0 0 1 {x} 0 0"/>"#)
        };
        all.iter().map(place).collect()
    };
    let assembly = |id: u32, all: &[(u32, u32)]| {
        format!(r#"<object id="{id}" type="model"><components>{}</components></object>"#, places(all))
    };
    // By depth: 1 at 40, 2 at 0, 1 at 20.
    let model = format!(
        r#"<resources>{}{}{}{}{}</resources><build><item objectid="7"/><item objectid="7" transform="1 0 0 0 1 0 0 0 1 0 50 0"/></build>"#,
        object(1, "", &[""; 4], ""),
        object(2, "", &[""; 4], ""),
        assembly(5, &[(2, 0), (1, 20)]),
        assembly(6, &[(5, 0)]),
        assembly(7, &[(6, 0), (1, 40)]),
    );
    let config = r#"<config><object id="7">
<part id="1" subtype="normal_part"/>
<part id="2" subtype="negative_part"/>
<part id="1" subtype="support_blocker"/>
</object></config>"#;
    let bytes = package(&model, &[(BAMBU, config)]);
    let scene = scene_of(&bytes);
    assert_eq!(losses(scene.warnings()), [""; 0]);
    let (again, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    assert_eq!(part(&again, BAMBU).unwrap(), config);
    for bytes in [bytes, again] {
        let mesh = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
        assert_eq!((mesh.face_count(), mesh.positions().view().bounds().unwrap().min[0]), (8, 40.0));
    }
}

/// Below 64 levels, components were merged into the object above, and volumes became solid.
#[test]
fn deep_components_keep_their_volumes() {
    for depth in [70, 255, 256] {
        let mut resources = object(7, "", &[""; 8], "");
        for at in 0..depth {
            let (id, below) = (100 + at, if at == 0 { 7 } else { 99 + at });
            resources += &format!(
                r#"<object id="{id}"><components><component objectid="{below}"/></components></object>"#
            );
        }
        let model =
            format!(r#"<resources>{resources}</resources><build><item objectid="{}"/></build>"#, 99 + depth);
        let bytes = package(&model, &[(PRUSA, PRUSA_CONFIG)]);
        if depth == 256 {
            let error = read_scene_bytes(&bytes, &ReadOptions::default()).unwrap_err().to_string();
            assert!(error.contains("nested more than 256 deep"), "{error}");
            continue;
        }
        let (again, warnings) = written(&scene_of(&bytes), &[], Format::ThreeMf);
        assert_eq!(losses(&warnings), [""; 0]);
        assert_eq!(part(&again, PRUSA).unwrap(), PRUSA_CONFIG);
        assert_eq!(elements(&model_of(&again), "<component ").len(), depth);
        assert_eq!(read_bytes(&again, &ReadOptions::default()).unwrap().mesh.face_count(), 4);
    }
}

#[test]
fn names_that_differ_in_case_are_a_loss() {
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1"/></build>"#,
        object(1, "", &[""; 4], "")
    );
    let parts = [("Metadata/a.txt", "1"), ("metadata/A.TXT", "2"), ("3D/3DModel.model", "<model/>")];
    let scene = scene_of(&package(&model, &parts));
    let text = "2 files have the name of an earlier file in the archive, but for case (metadata/A.TXT first): dropped";
    assert_eq!(losses(scene.warnings()), [text]);
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    let archive = zip::ZipArchive::new(Cursor::new(&bytes)).unwrap();
    let mut names: Vec<String> =
        archive.file_names().map(|name| name.unwrap().to_ascii_lowercase()).collect();
    names.sort();
    assert_eq!(names, ["3d/3dmodel.model", "[content_types].xml", "_rels/.rels", "metadata/a.txt"]);
    assert_eq!(part(&bytes, "Metadata/a.txt").as_deref(), Some("1"));
}

#[test]
fn marks_of_items_are_kept_and_other_attributes_are_named() {
    let attributes = r#"partnumber="a-1" thumbnail="/Thumbnails/a.png" auto_drop="0""#;
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1" auto_drop="0" printable="0" partnumber="b"/>
<item objectid="1" auto_drop="1"/></build>"#,
        object(1, attributes, &[""; 4], "")
    );
    let scene = scene_of(&package(&model, &[]));
    let expected = [
        "part numbers of objects and items are not read: dropped",
        "thumbnails of objects are not read: dropped",
        "marks of objects (auto_drop) are not read: dropped",
    ];
    assert_eq!(losses(scene.warnings()), expected);
    let (bytes, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let items = [r#"<item objectid="1" printable="0" auto_drop="0"/>"#, r#"<item objectid="1"/>"#]
        .map(|item| item.replace(r#"objectid="1""#, &format!("objectid=\"{}\"", object_id(&bytes))));
    assert_eq!(elements(&model_of(&bytes), "<item"), items);
}

/// Returns the number of the first object.
fn object_id(bytes: &[u8]) -> String {
    elements(&model_of(bytes), "<object")[0].split('"').nth(1).unwrap().to_owned()
}

/// BambuStudio writes the boxes of the objects of a plate when it is sliced.
#[test]
fn boxes_of_plates_are_results_of_slicing() {
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1"/></build>"#,
        object(1, "", &[""; 4], "")
    );
    let config = r#"<config><plate><metadata key="pattern_bbox_file" value="Metadata/plate_1.json"/></plate></config>"#;
    let parts = [(BAMBU, config), ("Metadata/plate_1.json", "{}"), ("Metadata/plate_1.png", "a picture")];
    let scene = scene_of(&package(&model, &parts));
    assert_eq!(
        losses(scene.warnings()),
        ["1 file of a sliced model is not kept (metadata/plate_1.json first)"]
    );
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(part(&bytes, "Metadata/plate_1.json"), None);
    assert_eq!(part(&bytes, "Metadata/plate_1.png").as_deref(), Some("a picture"));
    assert_eq!(part(&bytes, BAMBU).unwrap(), config.replace("Metadata/plate_1.json", ""));
}

#[test]
fn sets_follow_their_triangles_into_volumes() {
    let sets = r#"<t:trianglesets><t:triangleset name="a" identifier="x"><t:refrange startindex="2" endindex="5"/>
<t:ref index="0"/></t:triangleset><t:triangleset name="c" identifier="y"><t:ref index="7"/></t:triangleset></t:trianglesets>"#;
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="7"/></build>"#,
        object(7, "", &[""; 8], sets)
    );
    let (bytes, warnings) =
        written(&scene_of(&package(&model, &[(PRUSA, PRUSA_CONFIG)])), &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    // Triangles are ordered by their sets: 0, 2, 3, 1, then 4, 5, 6, 7.
    let text = model_of(&bytes);
    let all: Vec<&str> = elements(&text, "<t:ref ").iter().map(|e| e.split('"').nth(1).unwrap()).collect();
    assert_eq!(all, ["0", "1", "2", "4", "5", "7"]);
}

#[test]
fn paint_stays_on_its_triangle_beside_degenerate_ones() {
    let triangles = format!(
        r#"<triangle v1="0" v2="0" v3="1" paint_color="481"/><triangle {}/><triangle {} paint_color="441"/>"#,
        TRIANGLES[0], TRIANGLES[1]
    );
    let model = format!(
        r#"<resources><object id="1"><mesh>{VERTICES}<triangles>{triangles}</triangles></mesh></object></resources><build><item objectid="1"/></build>"#
    );
    let (bytes, _) = written(&scene_of(&package(&model, &[])), &[], Format::ThreeMf);
    let text = model_of(&bytes);
    let expected =
        [r#"<triangle v1="0" v2="1" v3="3" paint_color="441"/>"#, r#"<triangle v1="0" v2="2" v3="1"/>"#];
    assert_eq!(elements(&text, "<triangle "), expected);
}

#[test]
fn a_volume_without_material_stays_without_one() {
    let material = r#"pid="1" p1="0""#;
    let triangles = [material, material, material, material, "", "", "", ""];
    let model = format!(
        r##"<resources><basematerials id="1"><base name="red" displaycolor="#FF0000"/></basematerials>{}</resources>
<build><item objectid="7"/></build>"##,
        object(7, "", &triangles, "")
    );
    let (bytes, _) = written(&scene_of(&package(&model, &[(PRUSA, PRUSA_CONFIG)])), &[], Format::ThreeMf);
    let text = model_of(&bytes);
    assert_eq!(
        elements(&text, "<base "),
        [
            r##"<base name="red" displaycolor="#FF0000"/>"##,
            r##"<base name="default" displaycolor="#FFFFFF"/>"##,
        ]
    );
    assert_eq!(text.matches(r#" p1="1""#).count(), 4, "{text}");
}

/// BambuStudio writes one object for parts that share a mesh, and tells them apart by their order.
#[test]
fn parts_that_share_a_mesh_are_told_apart() {
    let model = format!(
        r#"<resources>{}<object id="5" type="model"><components><component objectid="1"/>
<component objectid="1" transform="1 0 0 0 1 0 0 0 1 30 0 0"/></components></object></resources>
<build><item objectid="5"/></build>"#,
        object(1, r#"type="other""#, &[""; 4], "")
    );
    let config = r#"<config><object id="5"><part id="1" subtype="negative_part"/><part id="1" subtype="normal_part"/></object></config>"#;
    let bytes = package(&model, &[(BAMBU, config)]);
    let scene = scene_of(&bytes);
    assert_eq!(scene.bounds().unwrap().min.map(f64::round), [0.0, 0.0, 0.0]);
    let loaded = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.mesh.face_count(), 4);
    assert!(loaded.mesh.positions().view().iter().all(|p| p[0] >= 30.0), "the solid part");
    let (again, _) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(part(&again, BAMBU).unwrap(), config);
}

#[test]
fn nothing_names_objects_that_are_gone() {
    let two = |second: &str| {
        let model = format!(
            r#"<resources>{}{}</resources><build><item objectid="1"/><item objectid="2"/></build>"#,
            object(1, "", &[""; 4], ""),
            object(2, "", &[""; 4], ""),
        );
        let config = format!(
            r#"<config><object id="1"/>{second}<plate a='q"q'><metadata key="gcode_file" value="Metadata/a.gcode"/>
<model_instance><metadata key="object_id" value="1"/></model_instance>
<model_instance><metadata key="object_id" value="2"/></model_instance></plate>
<assemble><assemble_item object_id="1"/><assemble_item object_id="2"/></assemble></config>"#
        );
        package(&model, &[(BAMBU, &config), ("Metadata/layer_heights_profile.txt", "object_id=2|0;1")])
    };
    let scene = scene_of(&two(r#"<object id="2"/>"#));
    let (bytes, warnings) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    let config = part(&bytes, BAMBU).unwrap();
    assert_eq!(config.matches("2\"").count(), 3, "{config}");
    assert!(part(&bytes, "Metadata/layer_heights_profile.txt").is_some());
    let mesh = &scene.meshes()[1].mesh;
    let (bytes, warnings) = written(&scene, &[None, Some(first_faces(mesh, 0))], Format::ThreeMf);
    let config = part(&bytes, BAMBU).unwrap();
    assert_eq!(config.matches("\"2\"").count(), 0, "{config}");
    assert_eq!(config.matches("model_instance>").count(), 2, "{config}");
    assert!(config.contains("a='q\"q'") || config.contains("a=\"q&quot;q\""), "{config}");
    assert!(config.contains(r#"key="gcode_file" value="""#), "{config}");
    let text = "settings that count objects, such as Metadata/layer_heights_profile.txt, are left out: objects are gone";
    assert!(losses(&warnings).contains(&text), "{warnings:?}");
    assert_eq!(part(&bytes, "Metadata/layer_heights_profile.txt"), None);
}

#[test]
fn ranges_in_another_order_fit_and_others_are_a_loss() {
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="7"/></build>"#,
        object(7, "", &[""; 8], "")
    );
    let config = |first: [u32; 2], second: [u32; 2]| {
        let volume = |[a, b]: [u32; 2], kind: &str| {
            format!(
                r#"<volume firstid="{a}" lastid="{b}"><metadata key="volume_type" value="{kind}"/></volume>"#
            )
        };
        let volumes = volume(first, "NegativeVolume") + &volume(second, "ModelPart");
        format!(r#"<config><object id="7">{volumes}</object></config>"#)
    };
    let scene = scene_of(&package(&model, &[(PRUSA, &config([4, 7], [0, 3]))]));
    assert_eq!(losses(scene.warnings()), [""; 0]);
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(part(&bytes, PRUSA).unwrap(), config([0, 3], [4, 7]));
    for (first, second) in [([0, 3], [3, 7]), ([0, 3], [5, 7]), ([0, 3], [4, 8])] {
        let scene = scene_of(&package(&model, &[(PRUSA, &config(first, second))]));
        let text = "ranges of parts of object 7 do not fit its triangles: it is one solid, without settings";
        assert_eq!(losses(scene.warnings()), [text]);
        let (bytes, _) = written(&scene, &[], Format::ThreeMf);
        assert_eq!(part(&bytes, PRUSA).unwrap(), "<config></config>");
    }
}

#[test]
fn damaged_settings_and_large_numbers_leave_no_wrong_settings() {
    for (id, config) in [(7, "<config><object id=\"x\"/></config>"), (1 << 30, "<config/>")] {
        let model = format!(
            r#"<resources>{}</resources><build><item objectid="{id}"/></build>"#,
            object(id, "", &[""; 4], "")
        );
        let scene = scene_of(&package(&model, &[(PRUSA, config)]));
        let (bytes, warnings) = written(&scene, &[], Format::ThreeMf);
        assert_eq!(losses(scene.warnings()).len() + losses(&warnings).len(), 1, "{warnings:?}");
        assert_eq!(part(&bytes, PRUSA), None);
    }
}

#[test]
fn shapes_and_line_breaks_are_kept_and_metadata_of_objects_are_not_those_of_the_file() {
    let group = r#"<metadatagroup><metadata name="Title">of the object</metadata></metadatagroup>"#;
    let own = object(1, r#"name="a&#10;b""#, &[""; 4], "").replace("<mesh>", &format!("{group}<mesh>"));
    let model = format!(
        "<metadata name=\"Title\">one\ntwo</metadata><resources>{own}</resources><build><item objectid=\"1\"/></build>"
    );
    let scene = scene_of(&package(&model, &[("3D/star.svg", "<svg/>")]));
    assert_eq!(losses(scene.warnings()), ["metadata of objects and items are not read: dropped"]);
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    let text = model_of(&bytes);
    assert!(text.contains(r#"<metadata name="Title">one&#10;two</metadata>"#), "{text}");
    assert!(text.contains(r#"name="a&#10;b""#), "{text}");
    assert_eq!(part(&bytes, "3D/star.svg").as_deref(), Some("<svg/>"));
}

#[test]
fn paint_of_parts_is_kept_on_equal_meshes() {
    let scene = scene_of(&prusa());
    let mesh = &scene.meshes()[0].mesh;
    let (bytes, warnings) = written(&scene, &[Some(first_faces(mesh, 4))], Format::ThreeMf);
    assert_eq!(losses(&warnings), [""; 0]);
    assert!(model_of(&bytes).contains(r#"slic3rpe:custom_supports="441""#));
}

/// After a file that is too large the next ones had no limit.
#[test]
fn files_beside_the_model_have_a_limit_together() {
    let model = format!(
        r#"<resources>{}</resources><build><item objectid="1"/></build>"#,
        object(1, "", &[""; 4], "")
    );
    let zeros = "0".repeat(70 << 20);
    let scene = scene_of(&package(&model, &[("Metadata/a.txt", &zeros), ("Metadata/b.txt", "b")]));
    let all = losses(scene.warnings());
    assert!(
        all.len() == 1 && all[0].starts_with("a file beside the model, and those after it, is left out"),
        "{all:?}"
    );
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    assert_eq!((part(&bytes, "Metadata/a.txt"), part(&bytes, "Metadata/b.txt")), (None, None));
}

/// Each place of an object made its volumes again.
#[test]
fn volumes_are_made_once_for_all_places() {
    const SIDE: usize = 100;
    let vertices: String = (0..(SIDE + 1) * (SIDE + 1))
        .map(|v| format!(r#"<vertex x="{}" y="{}" z="0"/>"#, v % (SIDE + 1), v / (SIDE + 1)))
        .collect();
    let square = |at: usize| {
        let a = at / SIDE * (SIDE + 1) + at % SIDE;
        let (b, c, d) = (a + 1, a + SIDE + 2, a + SIDE + 1);
        format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/><triangle v1="{a}" v2="{c}" v3="{d}"/>"#)
    };
    let triangles: String = (0..SIDE * SIDE).map(square).collect();
    let items = r#"<item objectid="7"/>"#.repeat(20_000);
    let model = format!(
        r#"<resources><object id="7"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object></resources>
<build>{items}</build>"#
    );
    let config = r#"<config><object id="7"><volume firstid="0" lastid="9999"/>
<volume firstid="10000" lastid="19999"><metadata key="volume_type" value="NegativeVolume"/></volume></object></config>"#;
    let bytes = package(&model, &[(PRUSA, config)]);
    let start = Instant::now();
    let scene = scene_of(&bytes);
    // Minutes, if it takes time for the triangles of each place.
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
    let found: Vec<_> = scene.meshes().iter().map(|m| (m.mesh.face_count(), m.instances)).collect();
    assert_eq!(found, [(10_000, 20_000); 2], "all places share the meshes");
}

#[test]
fn objects_and_files_that_nothing_uses_are_named() {
    let resources = format!(
        "{}{}{}",
        object(1, "", &[""; 4], ""),
        object(2, "", &[""; 4], ""),
        object(3, "", &[""; 4], "")
    );
    let model = format!(r#"<resources>{resources}</resources><build><item objectid="2"/></build>"#);
    let used = package(&model, &[("Metadata/a.txt", "a"), ("./Metadata/b.txt", "b")]);
    let scene = scene_of(&used);
    assert_eq!(losses(scene.warnings()), ["2 objects with triangles are not in the build: dropped"]);
    let (bytes, _) = written(&scene, &[], Format::ThreeMf);
    assert_eq!(part(&bytes, "Metadata/b.txt").or(part(&bytes, "./Metadata/b.txt")).as_deref(), Some("b"));
    let model = model.replace("</build>", r#"<item objectid="1"/><item objectid="3"/></build>"#);
    let unused = package(&model, &[("docProps/core.xml", "<a/>"), ("Notes/note.txt", "n")]);
    let scene = scene_of(&unused);
    let text = "no part of the model uses 2 files (docprops/core.xml first): dropped";
    assert_eq!(losses(scene.warnings()), [text]);
}
