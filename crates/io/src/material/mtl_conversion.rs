//! Conversion of MTL materials to properties that glTF also has.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use lodsmith_core::TriMesh;

use super::image_type::image_type;
use super::library::{
    Image, Library, Texture, is_number, left_out_warnings, lines_of, next_word, texture_in,
};
use super::regions::{Region, Regions, drops_materials};
use crate::assets::MAX_IMAGE_BYTES;
use crate::error::Warning;
use crate::excerpt::excerpt_of_bytes;

/// The use of the converted materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Output as glTF: PNG and JPEG images only, unchanged, and warnings about everything that glTF cannot
    /// represent.
    Gltf,
    /// Display: images of any type, and warnings about missing images only.
    Picture,
}

/// The properties of a material.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConvertedMaterial {
    pub(crate) name: String,
    pub(crate) color: [f64; 3],
    /// True if the colour also applies where there is an image; many programs write colours that do not.
    pub(crate) is_tinted: bool,
    pub(crate) alpha: f64,
    /// True if the alpha of the base colour image is the opacity.
    pub(crate) is_blended: bool,
    pub(crate) emission: [f64; 3],
    pub(crate) metalness: f64,
    pub(crate) roughness: f64,
    /// The Phong exponent of highlights (`Ns`), if there are any and nothing else is specified.
    pub(crate) shininess: Option<f64>,
    /// Images, by their indices.
    pub(crate) color_image: Option<usize>,
    pub(crate) normal_image: Option<usize>,
    pub(crate) emission_image: Option<usize>,
}

/// The materials of a mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConvertedMaterials {
    pub(crate) all: Vec<ConvertedMaterial>,
    pub(crate) images: Vec<Image>,
    /// The material of each region; one entry for a mesh without regions.
    pub(crate) of_region: Vec<Option<usize>>,
    pub(crate) warnings: Vec<Warning>,
}

/// Returns the materials of the regions of a mesh, with their images; `None` if nothing is known about them.
pub(crate) fn convert_materials(
    mesh: &TriMesh,
    regions: &Regions,
    purpose: Purpose,
) -> Option<ConvertedMaterials> {
    if !regions.has_materials() || drops_materials(mesh, regions) {
        return None;
    }
    let mut looks = ConvertedMaterials::default();
    let mut numbers: HashMap<&[u8], usize> = HashMap::new();
    let shared = [regions.common_names()];
    let of_regions: Vec<Region<'_>> =
        if mesh.regions().is_some() { regions.iter().collect() } else { shared.to_vec() };
    for region in of_regions {
        let at = region.material.map(|name| {
            *numbers.entry(name).or_insert_with(|| {
                looks.all.push(ConvertedMaterial::default_for(name));
                looks.all.len() - 1
            })
        });
        looks.of_region.push(at);
    }
    let mut seen = MtlReader::new(purpose);
    for library in regions.libraries() {
        seen.read(library, &numbers, &mut looks);
        if purpose == Purpose::Gltf {
            looks.warnings.extend(library.losses());
        }
    }
    looks.warnings.extend(seen.warnings());
    Some(looks)
}

impl ConvertedMaterial {
    /// Returns the defaults of a material without a description.
    fn default_for(name: &[u8]) -> Self {
        Self {
            name: String::from_utf8_lossy(name).into_owned(),
            color: [1.0; 3],
            is_tinted: false,
            alpha: 1.0,
            is_blended: false,
            emission: [0.0; 3],
            metalness: 0.0,
            roughness: 1.0,
            shininess: None,
            color_image: None,
            normal_image: None,
            emission_image: None,
        }
    }
}

/// State of reading the libraries.
struct MtlReader {
    purpose: Purpose,
    /// Images by path; `None` for images that are left out.
    images: HashMap<PathBuf, Option<usize>>,
    /// Number of bytes left for images.
    left: u64,
    /// Materials with a description: if there are two, the first counts.
    described: BTreeSet<usize>,
    /// Statements that glTF has no equivalent for.
    unsupported: BTreeSet<String>,
    /// The statements about Phong highlights, a shading model that glTF does not have.
    highlights: BTreeSet<String>,
    /// Images that are left out, and why.
    missing: Vec<String>,
}

impl MtlReader {
    fn new(purpose: Purpose) -> Self {
        Self {
            purpose,
            images: HashMap::new(),
            left: MAX_IMAGE_BYTES,
            described: BTreeSet::new(),
            unsupported: BTreeSet::new(),
            highlights: BTreeSet::new(),
            missing: Vec::new(),
        }
    }

    fn accepts_type(&self, kind: Option<&str>) -> bool {
        self.purpose == Purpose::Picture || matches!(kind, Some("image/png" | "image/jpeg"))
    }

    fn read(&mut self, library: &Library, numbers: &HashMap<&[u8], usize>, looks: &mut ConvertedMaterials) {
        let mut present = None;
        // State of the current material.
        let (mut color_path, mut has_emission, mut has_highlights) = (None, false, true);
        for line in lines_of(library.text().unwrap_or_default()) {
            let Some((word, rest)) = next_word(line) else { continue };
            let keyword = String::from_utf8_lossy(&line[word]).to_ascii_lowercase();
            if keyword == "newmtl" {
                let at = numbers.get(line[rest..].trim_ascii()).copied();
                present = at.filter(|at| self.described.insert(*at));
                (color_path, has_emission, has_highlights) = (None, false, true);
                continue;
            }
            let Some(at) = present else { continue };
            looks.all[at].is_tinted = library.is_tinted();
            let raw: Vec<f64> = String::from_utf8_lossy(&line[rest..])
                .split_ascii_whitespace()
                .map_while(|word| word.parse().ok())
                .filter(|x: &f64| x.is_finite())
                .collect();
            let numbers: Vec<f64> = raw.iter().map(|x| x.clamp(0.0, 1.0)).collect();
            let triple = match *numbers.as_slice() {
                [x] => Some([x; 3]),
                [r, g, b, ..] => Some([r, g, b]),
                _ => None,
            };
            match keyword.as_str() {
                "map_kd" | "map_ke" | "norm" | "map_bump" | "bump" => {
                    let Some(path) = texture_in(line) else { continue };
                    for option in line[rest..path.start].split(u8::is_ascii_whitespace) {
                        if option.first() == Some(&b'-') && !is_number(option) {
                            self.leave_out(&format!("{keyword} {}", excerpt_of_bytes(option)));
                        }
                    }
                    let image = self.add_image(library, &line[path.clone()], &mut looks.images);
                    let look = &mut looks.all[at];
                    match keyword.as_str() {
                        "map_kd" => {
                            look.color_image = image;
                            color_path = Some(&line[path]);
                        }
                        "map_ke" => {
                            look.emission_image = image;
                            if image.is_some() && !has_emission {
                                look.emission = [1.0; 3];
                            }
                        }
                        // `norm` always is a normal map; a bump map often is one too.
                        "norm" => look.normal_image = image.or(look.normal_image),
                        _ => look.normal_image = look.normal_image.or(image),
                    }
                }
                "kd" => looks.all[at].color = triple.unwrap_or([1.0; 3]),
                "ke" => {
                    looks.all[at].emission = triple.unwrap_or_default();
                    has_emission = true;
                }
                // The opacity is the alpha of the base colour image, as in glTF.
                "map_d" if color_path.is_some() && texture_in(line).map(|p| &line[p]) == color_path => {
                    looks.all[at].is_blended = true;
                }
                "d" => looks.all[at].alpha = numbers.first().copied().unwrap_or(1.0),
                "tr" => looks.all[at].alpha = 1.0 - numbers.first().copied().unwrap_or(0.0),
                "pm" => looks.all[at].metalness = numbers.first().copied().unwrap_or(0.0),
                "pr" => looks.all[at].roughness = numbers.first().copied().unwrap_or(1.0),
                // Ambient light, and hints for other ways of shading.
                "ka" | "map_ka" | "illum" | "ni" | "tf" => {}
                "ks" | "ns" | "sharpness" => {
                    let shininess = &mut looks.all[at].shininess;
                    match keyword.as_str() {
                        "ks" => has_highlights = numbers.iter().any(|&x| x > 0.0),
                        "ns" => *shininess = raw.first().copied(),
                        _ => {}
                    }
                    *shininess = shininess.filter(|_| has_highlights);
                    self.highlights.insert(keyword);
                }
                other if other.starts_with('#') => {}
                other => self.leave_out(&excerpt_of_bytes(other.as_bytes())),
            }
        }
    }

    fn leave_out(&mut self, statement: &str) {
        // A library may have any number of statements; a warning needs only some.
        if self.unsupported.len() < 16 {
            self.unsupported.insert(statement.to_owned());
        }
    }

    /// Returns the index of an image in memory.
    fn add_embedded_image(&mut self, image: &Image, images: &mut Vec<Image>) -> Option<usize> {
        let key = PathBuf::from(&image.name);
        if let Some(known) = self.images.get(&key) {
            return *known;
        }
        let number = self.accepts_type(Some(image.kind)).then(|| {
            let stem = image.name.rsplit_once('.').map_or(&*image.name, |(stem, _)| stem);
            images.push(Image { name: stem.to_owned(), ..image.clone() });
            images.len() - 1
        });
        if number.is_none() {
            self.missing.push(format!("{} is neither PNG nor JPEG", image.name));
        }
        self.images.insert(key, number);
        number
    }

    /// Returns the index of an image; `None` if it is left out.
    fn add_image(&mut self, library: &Library, path: &[u8], images: &mut Vec<Image>) -> Option<usize> {
        let shown = excerpt_of_bytes(path);
        let file = match library.find_texture(path) {
            Ok(Texture::File(file)) => file,
            Ok(Texture::Embedded(image)) => return self.add_embedded_image(image, images),
            Err(why) => {
                self.missing.push(format!("{shown} {why}"));
                return None;
            }
        };
        if let Some(known) = self.images.get(file.real_path()) {
            return *known;
        }
        let read = file.read_image(&mut self.left).and_then(|bytes| {
            let kind = image_type(&bytes);
            if self.accepts_type(kind) {
                Ok((kind, bytes))
            } else {
                Err("is neither PNG nor JPEG".to_owned())
            }
        });
        let number = match read {
            Ok((kind, bytes)) => {
                // Some types are recognised by the extension only.
                let name = Path::new(file.name());
                let name = if self.purpose == Purpose::Gltf { name.file_stem() } else { name.file_name() };
                let name = name.unwrap_or_default().to_string_lossy().into_owned();
                images.push(Image { name, kind: kind.unwrap_or_default(), bytes });
                Some(images.len() - 1)
            }
            Err(problem) => {
                self.missing.push(format!("{shown} {problem}"));
                None
            }
        };
        self.images.insert(file.real_path().to_owned(), number);
        number
    }

    fn warnings(self) -> Vec<Warning> {
        let mut warnings = left_out_warnings(&self.missing);
        if self.purpose == Purpose::Picture {
            return warnings;
        }
        let listed = |words: BTreeSet<String>| words.into_iter().collect::<Vec<_>>().join(", ");
        if !self.unsupported.is_empty() {
            let text =
                format!("glTF cannot represent these material properties: {}", listed(self.unsupported));
            warnings.push(Warning::lost(text));
        }
        if !self.highlights.is_empty() {
            let text = format!("glTF has another shading model: {} left out", listed(self.highlights));
            warnings.push(Warning::note(text));
        }
        warnings
    }
}
