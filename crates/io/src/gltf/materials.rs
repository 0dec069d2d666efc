//! Materials of a scene whose meshes are merged, converted to a material library (MTL).
//!
//! The OBJ writer and measurements in texels then handle one kind of description only. Properties that MTL
//! cannot express are kept by name, for warnings.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt::Write as _;

use lodsmith_core::RegionId;
use lodsmith_core::model::TextureRef;
use serde_json::Value;

use super::buffers::{Buffers, data_uri, inline_data, path_of};
use super::container::{list, number};
use super::texture_transform::{self, UvTransform};
use crate::assets::{Assets, Refusal};
use crate::excerpt::excerpt;
use crate::material::{GeneratedLibrary, Image, Library, Regions, image_type};

/// Consecutive faces with the same material.
pub(super) struct Run {
    /// Number of faces up to its end.
    pub(super) end: usize,
    pub(super) material: Option<usize>,
}

/// Returns the regions, one for each material, with the library that describes these, and the region of each
/// face if there is more than one. The region without a material comes first. Empty if no face has a
/// material.
pub(super) fn regions(
    json: &Value,
    buffers: &Buffers<'_>,
    runs: &[Run],
    assets: Assets,
    file_bytes: usize,
) -> (Regions, Option<Vec<RegionId>>) {
    let all = list(json, "materials");
    let known = |run: &Run| run.material.filter(|&m| m < all.len());
    let mut order: Vec<Option<usize>> = Vec::new();
    let mut place_of: HashMap<Option<usize>, u32> = HashMap::new();
    let bare = runs.iter().any(|run| known(run).is_none()).then_some(None);
    for material in bare.into_iter().chain(runs.iter().map(known)) {
        place_of.entry(material).or_insert_with(|| {
            order.push(material);
            order.len() as u32 - 1
        });
    }
    if order.iter().all(Option::is_none) {
        return (Regions::default(), None);
    }
    let mut builder = LibraryBuilder::new(json, buffers, file_bytes);
    let names: Vec<Option<String>> = order.iter().map(|m| m.map(|m| builder.material(m, &all[m]))).collect();
    let made = GeneratedLibrary {
        images: builder.images,
        unsupported: builder.left_out.into_iter().collect(),
        missing: builder.missing,
        tints_images: true,
    };
    let library = Library::generated(builder.text, assets, made);
    let mut ids = Vec::new();
    if order.len() > 1 {
        for run in runs {
            ids.resize(run.end, RegionId(place_of[&known(run)]));
        }
    }
    (Regions::of_materials(&names, library), (order.len() > 1).then_some(ids))
}

/// Writer of a library.
struct LibraryBuilder<'a, 'b> {
    json: &'a Value,
    buffers: &'a Buffers<'b>,
    text: String,
    /// Names of materials that are taken.
    names: UsedNames,
    /// Names of files that are taken.
    files: UsedNames,
    images: Vec<Image>,
    /// Names of images, by index; `None` for images that are left out.
    known: HashMap<usize, Option<String>>,
    left_out: BTreeSet<String>,
    missing: Vec<String>,
    /// Bytes of all images so far, and their limit: several images can use the same bytes.
    taken: usize,
    room: usize,
    /// The transform that the texture coordinates of this material have already.
    applied: UvTransform,
}

/// Maximum bytes of a path: the library repeats it for every material that uses it. (Guessed.)
const MAX_PATH_BYTES: usize = 512;

impl<'a, 'b> LibraryBuilder<'a, 'b> {
    fn new(json: &'a Value, buffers: &'a Buffers<'b>, room: usize) -> Self {
        Self {
            json,
            buffers,
            text: String::new(),
            names: UsedNames::default(),
            files: UsedNames { folds: true, ..UsedNames::default() },
            images: Vec::new(),
            known: HashMap::new(),
            left_out: BTreeSet::new(),
            missing: Vec::new(),
            taken: 0,
            room,
            applied: TextureRef::PLAIN,
        }
    }

    /// Describes a material; returns its name in the library.
    fn material(&mut self, index: usize, material: &Value) -> String {
        let name = material["name"].as_str().map(clean).filter(|name| !name.is_empty());
        let name = self.names.free(name.unwrap_or_else(|| format!("material_{index}")), "");
        self.applied = texture_transform::of_material(material);
        let extensions = &material["extensions"];
        let mut surface = &material["pbrMetallicRoughness"];
        let mut words = ["baseColorFactor", "baseColorTexture"];
        let mut is_metal_known = surface["metallicRoughnessTexture"].is_null();
        for word in extensions.as_object().into_iter().flat_map(|e| e.keys()) {
            match word.as_str() {
                "KHR_materials_emissive_strength" | "KHR_materials_unlit" => {}
                "KHR_materials_pbrSpecularGlossiness" => {
                    // The older workflow; the core properties beside it are a fallback for readers without
                    // the extension.
                    surface = &extensions[word];
                    words = ["diffuseFactor", "diffuseTexture"];
                    is_metal_known = false;
                    self.leave_out(word);
                }
                word => self.leave_out(word),
            }
        }
        if !surface["metallicRoughnessTexture"].is_null() {
            self.leave_out("metallicRoughnessTexture");
        }
        if !material["occlusionTexture"].is_null() {
            self.leave_out("occlusionTexture");
        }
        let color = numbers(&surface[words[0]], [1.0; 4]);
        let is_opaque = !["MASK", "BLEND"].contains(&material["alphaMode"].as_str().unwrap_or("OPAQUE"));
        let strength = &extensions["KHR_materials_emissive_strength"]["emissiveStrength"];
        let emission =
            numbers(&material["emissiveFactor"], [0.0; 3]).map(|x| x * strength.as_f64().unwrap_or(1.0));

        let mut lines = format!("newmtl {name}\n");
        let [r, g, b, alpha] = color;
        line(&mut lines, "Kd", &[r, g, b]);
        let mut is_seen_through = !is_opaque && alpha != 1.0;
        if is_seen_through {
            line(&mut lines, "d", &[alpha]);
        }
        if emission != [0.0; 3] {
            line(&mut lines, "Ke", &emission);
        }
        if !extensions["KHR_materials_unlit"].is_null() {
            lines += "illum 0\n";
        } else if is_metal_known {
            let factor = |what: &str| surface[what].as_f64().unwrap_or(1.0);
            line(&mut lines, "Pm", &[factor("metallicFactor")]);
            line(&mut lines, "Pr", &[factor("roughnessFactor")]);
        }
        if let Some(file) = self.texture(&surface[words[1]], words[1]) {
            let _ = writeln!(lines, "map_Kd {file}");
            // A JPEG has no alpha: readers would use its brightness.
            let lower = file.to_lowercase();
            if !is_opaque && ![".jpg", ".jpeg"].iter().any(|ending| lower.ends_with(ending)) {
                let _ = writeln!(lines, "map_d {file}");
                is_seen_through = true;
            }
        }
        if is_seen_through && material["alphaMode"] == "MASK" {
            self.leave_out("alphaMode MASK");
        }
        if emission != [0.0; 3]
            && let Some(file) = self.texture(&material["emissiveTexture"], "emissiveTexture")
        {
            let _ = writeln!(lines, "map_Ke {file}");
        }
        let normal = &material["normalTexture"];
        if let Some(file) = self.texture(normal, "normalTexture") {
            let _ = writeln!(lines, "norm {file}");
            if normal["scale"].as_f64().is_some_and(|scale| scale != 1.0) {
                self.leave_out("scale of normalTexture");
            }
        }
        self.text += &lines;
        name
    }

    fn leave_out(&mut self, word: &str) {
        // A file may have any number of extensions; these are enough for a warning.
        if self.left_out.len() < 16 {
            self.left_out.insert(excerpt(word));
        }
    }

    /// Returns the file name of a texture; `None` if the texture is left out.
    fn texture(&mut self, slot: &Value, what: &str) -> Option<String> {
        let index = number(&slot["index"])?;
        if number(texture_transform::set_of(slot)).is_some_and(|set| set != 0) {
            self.leave_out(&format!("{what} with another set of texture coordinates"));
            return None;
        }
        if texture_transform::of_texture(slot) != self.applied {
            self.leave_out("KHR_texture_transform");
        }
        let texture = &list(self.json, "textures").get(index)?;
        let sampler = number(&texture["sampler"]).map_or(&Value::Null, |s| &self.json["samplers"][s]);
        const REPEAT: usize = 10497;
        if ["wrapS", "wrapT"].iter().any(|&way| number(&sampler[way]).is_some_and(|way| way != REPEAT)) {
            self.leave_out("clamped or mirrored textures");
        }
        let others = texture["extensions"].as_object().into_iter().flat_map(|e| e.values());
        // All programs read the plain image; few read an image in an extension.
        let source = std::iter::once(*texture).chain(others).find_map(|t| number(&t["source"]))?;
        if let Some(known) = self.known.get(&source) {
            return known.clone();
        }
        let file = match self.image(source) {
            Ok(file) => Some(file),
            Err(why) => {
                self.missing.push(format!("images[{source}] {why}"));
                None
            }
        };
        self.known.insert(source, file.clone());
        file
    }

    /// Returns the file name of an image; keeps its bytes unless it is a separate file.
    fn image(&mut self, index: usize) -> Result<String, String> {
        let image = list(self.json, "images").get(index).ok_or("does not exist")?;
        let at = format!("images[{index}]");
        let bytes = match image["uri"].as_str() {
            Some(uri) => match inline_data(uri) {
                Some(data) => data_uri(data, &at).map_err(|e| e.to_string())?,
                None => {
                    let path = path_of(uri)?;
                    if self.buffers.assets.find(&path) == Err(Refusal::Outside) {
                        return Err(Refusal::Outside.reason().to_owned());
                    }
                    let is_fine =
                        |path: &&str| path.len() <= MAX_PATH_BYTES && !path.contains(char::is_control);
                    let path = path
                        .to_str()
                        .filter(is_fine)
                        .ok_or("has a name that a material library cannot store")?;
                    self.files.take(path);
                    return Ok(path.to_owned());
                }
            },
            None => {
                let view = number(&image["bufferView"]).ok_or("has neither a uri nor a view")?;
                let view = self.buffers.view(view, &at).map_err(|e| e.to_string())?;
                self.room = self.room.max(self.buffers.total());
                view.bytes.to_vec()
            }
        };
        self.taken = self.taken.saturating_add(bytes.len());
        if self.taken > self.room {
            return Err("uses the same bytes as other images".to_owned());
        }
        let kind = image_type(&bytes).ok_or("has an unknown type")?;
        let name = image["name"].as_str().map(file_stem).filter(|name| !name.is_empty());
        let ending = match kind {
            "image/jpeg" => ".jpg",
            "image/png" => ".png",
            "image/webp" => ".webp",
            _ => ".ktx2",
        };
        let stem = name.unwrap_or_else(|| format!("image_{index}"));
        let name = self.files.free(stem, ending);
        self.images.push(Image { name: name.clone(), kind, bytes });
        Ok(name)
    }
}

/// Set of names that are taken.
#[derive(Default)]
struct UsedNames {
    /// True if names that differ only in case are equal, as in some file systems.
    folds: bool,
    taken: HashSet<String>,
    /// Last number that was appended to a name.
    last: HashMap<String, usize>,
}

impl UsedNames {
    fn key(&self, name: &str) -> String {
        if self.folds { name.to_lowercase() } else { name.to_owned() }
    }

    /// Takes a name; returns true if it was free.
    fn take(&mut self, name: &str) -> bool {
        self.taken.insert(self.key(name))
    }

    /// Takes a free name with this ending, numbered if necessary.
    fn free(&mut self, stem: String, ending: &str) -> String {
        let mut name = format!("{stem}{ending}");
        while !self.take(&name) {
            let key = self.key(&stem);
            let number = self.last.entry(key).or_default();
            *number += 1;
            name = format!("{stem}_{number}{ending}");
        }
        name
    }
}

/// Returns a name that is valid up to the end of a line.
fn clean(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_control() { '_' } else { c }).collect();
    plain.trim().trim_end_matches('\\').trim_end().to_owned()
}

/// Returns a file name that is valid on every system, without its ending.
fn file_stem(name: &str) -> String {
    // Guessed: long enough to read, short enough for every system.
    const MAX_STEM_CHARS: usize = 64;
    let bare = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let endings = [".png", ".jpg", ".jpeg", ".webp", ".ktx2"];
    let lower = bare.to_ascii_lowercase();
    let length = endings.iter().find(|e| lower.ends_with(**e)).map_or(bare.len(), |e| bare.len() - e.len());
    let fine = |c: char| c.is_alphanumeric() || "-_.+()".contains(c);
    let plain: String =
        bare[..length].chars().take(MAX_STEM_CHARS).map(|c| if fine(c) { c } else { '_' }).collect();
    plain.trim_start_matches(['.', '-']).trim_end_matches('.').to_owned()
}

fn line(text: &mut String, keyword: &str, numbers: &[f64]) {
    *text += keyword;
    for number in numbers {
        let _ = write!(text, " {number}");
    }
    text.push('\n');
}

fn numbers<const N: usize>(value: &Value, default: [f64; N]) -> [f64; N] {
    let all: Option<Vec<f64>> = value.as_array().and_then(|all| all.iter().map(Value::as_f64).collect());
    all.and_then(|all| all.try_into().ok()).unwrap_or(default)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_lines_and_files() {
        assert_eq!(clean(" old\nwood \\ "), "old_wood");
        assert_eq!(file_stem("tex/My wood.PNG"), "My_wood");
        assert_eq!(file_stem("..\\..\\-x.jpeg"), "x");
        assert_eq!(file_stem("a:b*c"), "a_b_c");
        assert_eq!(file_stem(".png"), "");
        assert_eq!(file_stem(&"ü".repeat(100)).chars().count(), 64);
        let mut names = UsedNames { folds: true, ..UsedNames::default() };
        assert!(names.take("A.png"));
        assert_eq!(names.free("a".into(), ".png"), "a_1.png");
        assert_eq!([names.free("a".into(), ".png"), names.free("a".into(), "")], ["a_2.png", "a"]);
        let mut names = UsedNames::default();
        assert_eq!(["a", "A", "a"].map(|n| names.free(n.into(), "")), ["a", "A", "a_1"]);
    }
}
