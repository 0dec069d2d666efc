//! Writer of 3MF files: the archive and its parts.

use std::collections::BTreeSet;
use std::io::{self, Write};

use glam::{DMat3, DMat4};
use lodsmith_core::TriMesh;
use lodsmith_core::numbers::counted;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::assemblies::Assemblies;
use super::document::{APPLICATION, MeshObject, ModelHeader, ModelPart};
use super::kept::{KeptContents, coarse_paint};
use super::looks::Looks;
use super::marks::ExactPaint;
use super::settings::{counts_objects, updated};
use super::xml::escaped;
use crate::error::{Warning, WriteError};
use crate::excerpt::excerpt;
use crate::frame::{Frame, Unit};
use crate::gltf::{Scene, Written};
use crate::material::{Purpose, Regions, Textures, convert_materials};
use crate::numbers::TextOut;
use crate::options::WriteOptions;
use crate::sizes::Sizes;

const TYPES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">
 <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>
 <Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>
 <Default Extension=\"png\" ContentType=\"image/png\"/>
 <Default Extension=\"jpg\" ContentType=\"image/jpeg\"/>
</Types>
";
const RELATIONS: &str = "http://schemas.openxmlformats.org/package/2006/relationships";
const MODEL_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
const TEXTURE_TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture";
/// Level of compression; see the constant of the same kind for `.gz`.
const COMPRESSION: i64 = 3;
/// Names of metadata about a model, from the core specification. Others need a namespace, which is not known.
const METADATA: [&str; 6] = ["Title", "Designer", "Description", "Copyright", "LicenseTerms", "Rating"];
/// Names of metadata about a file, from the same specification: they do not apply to another file.
const FILE_METADATA: [&str; 3] = [APPLICATION, "CreationDate", "ModificationDate"];

type Archive<'a> = ZipWriter<StreamWriter<&'a mut dyn Write>>;

/// Writes a mesh as one object.
pub(super) fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let regions = options.regions.as_deref();
    let mut converted = regions
        .filter(|_| options.textures != Textures::None)
        .and_then(|regions| convert_materials(mesh, regions, Purpose::Gltf))
        .unwrap_or_default();
    let warnings = std::mem::take(&mut converted.warnings);
    let of_region = std::mem::take(&mut converted.of_region);
    let looks = Looks::of_converted(converted);
    let frame = regions.and_then(Regions::frame).unwrap_or(Frame::new(Unit::Millimeter, true));
    let (name, marks) = (String::new(), Vec::new());
    let object = MeshObject { name, mesh, of_region, sources: None, marks, paint: &[] };
    let placed = Assemblies::of_mesh(frame);
    Ok(write_objects(looks, &[Some(object)], &placed, (&[], &KeptContents::default()), warnings, out)?.0)
}

/// Writes a scene with some meshes replaced: an object for each mesh.
pub(super) fn write_scene(
    scene: &Scene,
    replaced: &[Option<TriMesh>],
    textures: Textures,
    out: &mut dyn Write,
) -> io::Result<Written> {
    let (model, mut warnings) = scene.encoded_model(replaced);
    let mesh_of = |i: usize| &*model.meshes[i].mesh;
    let none = KeptContents::default();
    let kept = scene.kept().unwrap_or(&none);
    let is_project = kept.is_project;
    let has_faces = |i: usize| mesh_of(i).face_count() > 0;
    let moved =
        scene.build_transform().map(|rows| DMat4::from_mat3(DMat3::from_cols_array_2d(&rows).transpose()));
    let of_node = |node| scene.node_of_three_mf(node);
    let placed = Assemblies::new(&model, has_faces, of_node, is_project, moved.unwrap_or_default());
    warnings.extend(scene.lost_beside_nodes());
    if placed.flattened > 0 {
        let nodes = counted(placed.flattened, "node flattens its", "nodes flatten their");
        warnings.push(Warning::lost(format!("{nodes} content, which 3MF advises against: left out")));
    }
    let is_emptied = |&i: &usize| scene.meshes()[i].mesh.face_count() > 0 && mesh_of(i).face_count() == 0;
    let emptied: Vec<usize> = (0..scene.meshes().len()).filter(is_emptied).collect();
    if let Some(first) = emptied.first() {
        let name = excerpt(&model.meshes[*first].name);
        let text = format!("meshes without faces, such as {name}, are left out: {}", emptied.len());
        warnings.push(Warning::lost(text));
    }
    let with_materials = textures != Textures::None;
    let (mut used, mut coarse) = (BTreeSet::new(), 0);
    let mut objects: Vec<Option<MeshObject<'_>>> = model.meshes.iter().map(|_| None).collect();
    let (names, left_out) = placed.names(&model);
    if left_out > 0 {
        let text = format!(
            "3MF has one name for a mesh and its nodes: other names were dropped for {left_out} meshes"
        );
        warnings.push(Warning::note(text));
    }
    for (mesh, name) in names {
        let (own, source) = (mesh_of(mesh), &model.meshes[mesh]);
        let of_region: Vec<Option<usize>> =
            source.materials.iter().map(|m| m.filter(|_| with_materials)).collect();
        let regions: BTreeSet<usize> =
            own.regions().map_or_else(|| [0].into(), |r| r.iter().map(|r| r.index()).collect());
        used.extend(regions.iter().filter_map(|&r| of_region.get(r).copied().flatten()));
        let is_as_read = scene.meshes().get(mesh).is_some_and(|read| std::ptr::eq(own, &*read.mesh));
        let sources = if is_as_read { scene.source_vertices(mesh) } else { None };
        let mut paint: &[ExactPaint] = &[];
        if let Some(exact) = kept.paint.get(&mesh) {
            let is_same =
                |read: &TriMesh| read.triangles() == own.triangles() && read.positions() == own.positions();
            match is_as_read || scene.meshes().get(mesh).is_some_and(|read| is_same(&read.mesh)) {
                true => paint = exact,
                false => coarse += exact.chunk_by(|a, b| a.0 == b.0).count(),
            }
        }
        let marks = scene.marks(mesh);
        objects[mesh] = Some(MeshObject { name, mesh: own, of_region, sources, marks, paint });
    }
    warnings.extend(coarse_paint(coarse));
    if !with_materials && !model.materials.is_empty() {
        warnings.push(Warning::note("materials dropped: --textures none"));
    }
    let mut left = scene.image_bytes_limit();
    let encoded = |image| scene.encoded_image(image, &mut left);
    let looks = Looks::of_model(&model.materials, &used, encoded, &mut warnings);
    let metadata = if is_project { scene.description() } else { metadata(scene, &mut warnings) };
    let (warnings, sizes) = write_objects(looks, &objects, &placed, (&metadata, kept), warnings, out)?;
    Ok(Written { sizes: Some(sizes), ..Written::new(warnings) })
}

/// Returns the metadata of a scene that are kept.
fn metadata(scene: &Scene, warnings: &mut Vec<Warning>) -> Vec<(String, String)> {
    let (kept, others): (Vec<_>, Vec<_>) =
        scene.description().into_iter().partition(|(name, _)| METADATA.contains(&&**name));
    let others = others.into_iter().map(|(name, _)| name);
    let others: Vec<String> =
        others.filter(|name| !FILE_METADATA.contains(&&**name)).take(16).map(|name| excerpt(&name)).collect();
    if !others.is_empty() {
        let text = format!("3MF has no standard name for the metadata {}: left out", others.join(", "));
        warnings.push(Warning::note(text));
    }
    kept
}

/// Writes the archive; adds to the warnings. Also returns the sizes of the placed objects.
fn write_objects(
    mut looks: Looks,
    objects: &[Option<MeshObject<'_>>],
    placed: &Assemblies,
    (metadata, kept): (&[(String, String)], &KeptContents),
    mut warnings: Vec<Warning>,
    out: &mut dyn Write,
) -> io::Result<(Vec<Warning>, Sizes)> {
    let all = || objects.iter().flatten();
    if !all().all(|o| o.mesh.positions().view().iter().flatten().all(f64::is_finite)) {
        let what = "coordinates that are not finite".to_owned();
        return Err(io::Error::other(WriteError::TooLarge { format: "3MF", what }));
    }
    let mut lost = std::mem::take(&mut looks.lost);
    let document = ModelPart::new(&looks, objects, placed, &mut lost);
    warnings.extend(lost.warnings());
    if document.is_rounded {
        warnings.push(Warning::note("3MF holds colours as bytes: they are rounded"));
    }
    let mut zip: Archive<'_> = ZipWriter::new_stream(out);
    let files: Vec<&(String, Vec<u8>)> = kept.files_for(placed.has_known_ids, placed.is_moved, &mut warnings);
    start(&mut zip, "[Content_Types].xml", 0)?;
    zip.write_all(kept.content_types(TYPES, &files).as_bytes())?;
    start(&mut zip, "_rels/.rels", 0)?;
    let own = [(MODEL_TYPE.to_owned(), "/3D/3dmodel.model".to_owned())];
    zip.write_all(relations(own.iter().chain(kept.relations_to(&files))).as_bytes())?;
    // A triangle with properties, or a vertex, takes less than this as text.
    let elements: usize = all().map(|o| o.mesh.face_count() + o.mesh.wedge_count()).sum();
    start(&mut zip, "3D/3dmodel.model", 128 * elements)?;
    let header = ModelHeader { metadata, namespaces: kept.namespaces_of(metadata) };
    let (skipped, written) = document.write(placed, &header, &mut TextOut::new(&mut zip))?;
    let pictures: Vec<usize> = document.used_pictures().into_iter().collect();
    if !pictures.is_empty() {
        start(&mut zip, "3D/_rels/3dmodel.model.rels", 0)?;
        let paths: Vec<String> = pictures.iter().map(|&picture| looks.path_of(picture)).collect();
        let to_textures: Vec<_> = paths.iter().map(|path| (TEXTURE_TYPE.to_owned(), path.clone())).collect();
        zip.write_all(relations(to_textures.iter()).as_bytes())?;
        for (path, picture) in paths.iter().zip(pictures) {
            let bytes = &looks.pictures[picture].bytes;
            start(&mut zip, path.trim_start_matches('/'), bytes.len())?;
            zip.write_all(bytes)?;
        }
    }
    let is_gone = kept.objects.iter().any(|&object| !written.has(object));
    let (kept_files, left_out): (Vec<_>, Vec<_>) =
        files.into_iter().partition(|(path, _)| !(is_gone && counts_objects(path)));
    if let Some((path, _)) = left_out.first() {
        let text =
            format!("settings that count objects, such as {}, are left out: objects are gone", excerpt(path));
        warnings.push(Warning::lost(text));
    }
    for (path, bytes) in kept_files {
        start(&mut zip, path, bytes.len())?;
        zip.write_all(&updated(&path.to_ascii_lowercase(), bytes, &written, &kept.part_numbers)?)?;
    }
    zip.finish().map_err(io::Error::from)?;
    if skipped > 0 {
        let triangles = counted(skipped, "triangle has", "triangles have");
        warnings.push(Warning::lost(format!(
            "{triangles} the same vertex twice, which 3MF does not allow: left out"
        )));
    }
    Ok((warnings, document.sizes(placed.meshes())))
}

fn start(zip: &mut Archive<'_>, name: &str, bytes: usize) -> io::Result<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(COMPRESSION))
        // Not the time of the run: the same scene has the same bytes.
        .last_modified_time(DateTime::default())
        // Sizes of 64 bits, where they may be needed.
        .large_file(bytes >= 1 << 31);
    Ok(zip.start_file(name, options)?)
}

/// Returns a file of relations: types and targets.
fn relations<'r>(all: impl Iterator<Item = &'r (String, String)>) -> String {
    let mut text =
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Relationships xmlns=\"{RELATIONS}\">\n");
    for (i, (kind, target)) in all.enumerate() {
        let [target, kind] = [target, kind].map(|text| escaped(text));
        text.push_str(&format!(" <Relationship Target=\"{target}\" Id=\"rel{i}\" Type=\"{kind}\"/>\n"));
    }
    text + "</Relationships>\n"
}
