//! Contents that one 3MF file gets from another beside the scene: settings, thumbnails, and references to them.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use lodsmith_core::numbers::counted;
use serde_json::Value;

use super::marks::ExactPaint;
use super::settings::{has_heights, names_objects};
use super::xml::escaped;
use crate::error::Warning;
use crate::excerpt::excerpt;
use crate::gltf::percent_decoded;

/// The name in `extras` of nodes and primitives under which the data are that only 3MF has.
pub(crate) const OF_THREE_MF: &str = "3mf";

/// Numbers of objects from this one on are not kept. Guessed: far more than any file has, and all further numbers are small
/// enough.
pub(super) const END_OF_NUMBERS: u32 = 1 << 30;

/// The content type of files of which nothing is known.
const UNKNOWN_TYPE: &str = "application/octet-stream";

/// Contents of a 3MF file that a scene does not hold.
#[derive(Debug, Default)]
pub(crate) struct KeptContents {
    /// Settings, thumbnails and other files of slicers, by their paths in the archive.
    pub(super) files: Vec<(String, Vec<u8>)>,
    /// Relations of the archive to these files: type and target.
    pub(super) relations: Vec<(String, String)>,
    /// Content types of extensions in lower case, and of parts by [`name_of`] them.
    pub(super) types: BTreeMap<String, String>,
    pub(super) part_types: BTreeMap<String, String>,
    /// Namespaces of prefixes of metadata.
    pub(super) namespaces: Vec<(String, String)>,
    /// True if a slicer wrote the file: then its description and the numbers of its objects are kept.
    pub(super) is_project: bool,
    /// Numbers of the placed objects of the first part.
    pub(super) objects: BTreeSet<u32>,
    /// Numbers of parts of objects, by the number of the object in settings, and the place of the part in the list there.
    pub(super) part_numbers: BTreeMap<(u32, usize), u32>,
    /// Paint of triangles of which a part is painted, by mesh.
    pub(super) paint: BTreeMap<usize, Vec<ExactPaint>>,
}

/// Returns a warning for triangles that lose the paint of parts of them.
pub(super) fn coarse_paint(triangles: usize) -> Option<Warning> {
    let triangles = (triangles > 0).then(|| counted(triangles, "triangle", "triangles"))?;
    let text = format!("paint of parts of {triangles} is dropped: the paint of the largest part is kept");
    Some(Warning::lost(text))
}

impl KeptContents {
    /// Returns a warning for what another format than 3MF does not hold, beside the nodes and meshes of the scene.
    pub(crate) fn file_losses(&self) -> Option<Warning> {
        let files = counted(self.files.len(), "file is", "files are");
        let text = format!("settings and pictures of a slicer are dropped: {files} kept in 3MF only");
        (!self.files.is_empty()).then(|| Warning::lost(text))
    }

    /// Returns warnings for what glTF does not hold, or programs that read it may not know. `json`: the scene.
    pub(crate) fn losses(&self, json: &Value) -> Vec<Warning> {
        let mut warnings: Vec<Warning> = self.file_losses().into_iter().collect();
        let nodes = json["nodes"].as_array().into_iter().flatten();
        let hidden =
            nodes.filter(|node| node["extensions"]["KHR_node_visibility"]["visible"] == false).count();
        if hidden > 0 {
            let parts = counted(
                hidden,
                "part that a slicer does not print is",
                "parts that a slicer does not print are",
            );
            let text = format!("{parts} hidden (KHR_node_visibility), which many programs do not know");
            warnings.push(Warning::lost(text));
        }
        let painted = self.paint.values().map(|own| own.chunk_by(|a, b| a.0 == b.0).count()).sum();
        warnings.extend(coarse_paint(painted));
        warnings
    }

    /// Returns the files that another 3MF file has too: without settings of objects if their numbers are not kept, and
    /// without heights if `is_moved` says that all objects are scaled or rotated.
    pub(super) fn files_for(
        &self,
        has_known_ids: bool,
        is_moved: bool,
        warnings: &mut Vec<Warning>,
    ) -> Vec<&(String, Vec<u8>)> {
        let mut files: Vec<&(String, Vec<u8>)> = self.files.iter().collect();
        if !has_known_ids && files.iter().any(|(path, _)| names_objects(&path.to_ascii_lowercase())) {
            let text = "settings of objects name several objects by one number, or one by a very large number: left out";
            warnings.push(Warning::lost(text));
            files.retain(|(path, _)| !names_objects(&path.to_ascii_lowercase()));
        }
        if let Some((path, _)) = files.iter().find(|(path, _)| is_moved && has_heights(path)) {
            let first = excerpt(path);
            let text = format!(
                "settings at heights, such as {first}, are left out: they are those before --scale and --up"
            );
            warnings.push(Warning::lost(text));
            files.retain(|(path, _)| !has_heights(path));
        }
        files
    }

    /// Returns the relations of the archive to these files: types and targets.
    pub(super) fn relations_to<'k>(
        &'k self,
        files: &[&'k (String, Vec<u8>)],
    ) -> impl Iterator<Item = &'k (String, String)> {
        let names: HashSet<String> = files.iter().map(|(path, _)| name_of(path)).collect();
        self.relations.iter().filter(move |(_, target)| names.contains(&name_of(target)))
    }

    /// Returns the namespaces of prefixes that these metadata have.
    pub(super) fn namespaces_of(&self, metadata: &[(String, String)]) -> Vec<&(String, String)> {
        let is_used = |prefix: &str| {
            metadata.iter().any(|(name, _)| name.split_once(':').is_some_and(|(own, _)| own == prefix))
        };
        self.namespaces.iter().filter(|(prefix, _)| is_used(prefix)).collect()
    }

    /// Returns a file of content types with those of these files.
    pub(super) fn content_types(&self, own: &str, files: &[&(String, Vec<u8>)]) -> String {
        let mut text = String::new();
        let mut known: BTreeSet<String> = ["rels", "model", "png", "jpg"].map(str::to_owned).into();
        for (path, _) in files {
            let name = name_of(path);
            let of_part = self.part_types.get(&name).map(String::as_str);
            let file = name.rsplit('/').next().unwrap_or_default();
            let (Some((_, extension)), None) = (file.rsplit_once('.'), of_part) else {
                let (path, kind) = (escaped(path), escaped(of_part.unwrap_or(UNKNOWN_TYPE)));
                text.push_str(&format!(" <Override PartName=\"/{path}\" ContentType=\"{kind}\"/>\n"));
                continue;
            };
            if known.insert(extension.to_owned()) {
                let kind = self.types.get(extension).map_or(UNKNOWN_TYPE, String::as_str);
                let (extension, kind) = (escaped(extension), escaped(kind));
                text.push_str(&format!(" <Default Extension=\"{extension}\" ContentType=\"{kind}\"/>\n"));
            }
        }
        own.replace("</Types>", &format!("{text}</Types>"))
    }
}

/// Returns the name of a part without its leading slash or `./`, in lower case, with blanks for `%20` and slashes for
/// backslashes: programs differ in whether they encode the names in the archive, in references to them, or both.
pub(super) fn name_of(path: &str) -> String {
    let decoded = percent_decoded(path).and_then(|bytes| String::from_utf8(bytes).ok());
    let path = decoded.unwrap_or_else(|| path.to_owned()).replace('\\', "/");
    path.trim_start_matches("./").trim_start_matches('/').to_ascii_lowercase()
}
