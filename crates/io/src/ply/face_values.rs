//! Values of faces: labels, colours and numbers of textures, which become regions or colours of corners.

use std::collections::{HashMap, HashSet};

use lodsmith_core::RegionId;

use super::header::{Element, PropertyType, Scalar};
use crate::assets::Assets;
use crate::attributes::linear_of_srgb;
use crate::error::Warning;
use crate::material::{FaceProperty, GeneratedLibrary, Library, Region, Regions};

/// Most colours of faces that become regions; more are colours of corners. Guessed: more than a palette has.
const MAX_COLORS: usize = 256;
/// Most values of a label. Guessed: segmentations have fewer, numbers of faces have more.
const MAX_LABELS: usize = 4096;
/// A value is only a name of a region if at least this many faces share it in the mean; few labels always are.
const MIN_FACES_PER_VALUE: usize = 10;
const ALWAYS_ALLOWED_LABELS: usize = 16;

/// Numbers of faces that are read, by property.
pub(super) struct FaceColumn {
    pub(super) name: String,
    pub(super) kind: Scalar,
    /// The place of the property in the element.
    pub(super) property: usize,
    /// The value of each face.
    pub(super) values: Vec<f64>,
}

/// Regions, or colours of corners, made of the values of faces.
#[derive(Default)]
pub(super) struct FaceValues {
    pub(super) regions: Regions,
    /// The region of each face, if there are several.
    pub(super) of_faces: Option<Vec<RegionId>>,
    /// Colours, and the one of each face, if they are too many for regions.
    pub(super) colors: Option<(Vec<[f32; 4]>, Vec<u32>)>,
}

/// Names of the colours of faces.
const COLOR_NAMES: [[&str; 4]; 2] =
    [["red", "green", "blue", "alpha"], ["diffuse_red", "diffuse_green", "diffuse_blue", "alpha"]];

/// Returns the properties of faces that are read; `has_textures` if the file names pictures.
pub(super) fn columns(element: &Element, has_textures: bool) -> Vec<FaceColumn> {
    let has = |name: &str| {
        element.properties.iter().any(|p| p.name == name && matches!(p.kind, PropertyType::One(_)))
    };
    let colors = COLOR_NAMES.into_iter().find(|names| names[..3].iter().all(|name| has(name)));
    let column = |(property, p): (usize, &super::header::Property)| {
        let PropertyType::One(kind) = p.kind else { return None };
        let is_color = colors.is_some_and(|names| names.contains(&&*p.name));
        let is_texture = p.name == "texnumber" && has_textures;
        (is_color || is_texture || kind.integer().is_some()).then(|| FaceColumn {
            name: p.name.clone(),
            kind,
            property,
            values: Vec::new(),
        })
    };
    element.properties.iter().enumerate().filter_map(column).collect()
}

/// Makes regions of the values of faces.
pub(super) fn regions(
    columns: Vec<FaceColumn>,
    face_count: usize,
    pictures: &[String],
    assets: Assets,
    warnings: &mut Vec<Warning>,
) -> FaceValues {
    let mut made = FaceValues::default();
    let is_few = |count: usize, most: usize| count <= most && count * MIN_FACES_PER_VALUE < face_count;
    let (mut textures, mut colors, mut labels) = (None, Vec::new(), Vec::new());
    for column in columns {
        if column.name == "texnumber" && !pictures.is_empty() {
            textures = Some(column);
        } else if COLOR_NAMES.as_flattened().contains(&&*column.name) {
            colors.push(column);
        } else {
            let distinct = column.values.iter().map(|x| x.to_bits()).collect::<HashSet<u64>>().len();
            if distinct <= ALWAYS_ALLOWED_LABELS || is_few(distinct, MAX_LABELS) {
                labels.push(column);
            } else {
                let text =
                    format!("face property {} has {distinct} values, too many for regions", column.name);
                warnings.push(Warning::lost(text + ": dropped"));
            }
        }
    }
    if !colors.is_empty() {
        let (palette, of_faces) = palette(&colors, face_count);
        if !is_few(palette.len(), MAX_COLORS) {
            made.colors = Some((palette, of_faces));
            colors.clear();
        }
    }
    if textures.is_none() && colors.is_empty() && labels.is_empty() && pictures.is_empty() {
        return made;
    }
    // Distinct rows of values are the regions.
    let columns: Vec<&FaceColumn> = textures.iter().chain(&colors).chain(&labels).collect();
    let mut numbers: HashMap<Vec<u64>, u32> = HashMap::new();
    let mut rows: Vec<usize> = Vec::new();
    let row = |face: usize| columns.iter().map(|c| c.values[face].to_bits()).collect::<Vec<u64>>();
    let of_faces: Vec<RegionId> = (0..face_count)
        .map(|face| {
            RegionId(*numbers.entry(row(face)).or_insert_with(|| {
                rows.push(face);
                rows.len() as u32 - 1
            }))
        })
        .collect();
    let names: Vec<(Option<String>, Option<String>)> = rows
        .iter()
        .map(|&face| {
            let picture = textures
                .as_ref()
                .map_or(Some(0), |t| (t.values[face] >= 0.0).then_some(t.values[face] as usize));
            let material = if pictures.is_empty() {
                (!colors.is_empty()).then(|| color_name(color_of(&colors, face)))
            } else {
                picture.filter(|&k| k < pictures.len()).map(picture_name)
            };
            let group = |c: &FaceColumn| format!("{}_{}", c.name, c.values[face]);
            let groups: Vec<String> = labels.iter().map(group).collect();
            ((!groups.is_empty()).then(|| groups.join(" ")), material)
        })
        .collect();
    let named: Vec<Region<'_>> =
        names.iter().map(|(groups, material)| Region::new(groups.as_deref(), material.as_deref())).collect();
    made.regions = Regions::named(&named);
    let library = library(pictures, &colors, &rows);
    if !library.is_empty() {
        made.regions.libraries = vec![Library::generated(library, assets, GeneratedLibrary::default())];
    }
    made.regions.has_pictures = !pictures.is_empty();
    let property = |c: &FaceColumn| FaceProperty {
        name: c.name.clone(),
        of: c.kind.integer(),
        value_bits: rows.iter().map(|&face| c.values[face].to_bits()).collect(),
    };
    made.regions.face_properties = colors.iter().chain(&labels).map(property).collect();
    made.of_faces = (rows.len() > 1).then_some(of_faces);
    made
}

/// Returns the distinct colours of faces, and the one of each.
fn palette(columns: &[FaceColumn], face_count: usize) -> (Vec<[f32; 4]>, Vec<u32>) {
    let mut numbers: HashMap<[u32; 4], u32> = HashMap::new();
    let mut all = Vec::new();
    let of_faces = (0..face_count).map(|face| {
        let color = color_of(columns, face);
        *numbers.entry(color.map(f32::to_bits)).or_insert_with(|| {
            all.push(color);
            all.len() as u32 - 1
        })
    });
    let of_faces = of_faces.collect();
    (all, of_faces)
}

/// Returns the colour of a face.
fn color_of(columns: &[FaceColumn], face: usize) -> [f32; 4] {
    let mut color = [1.0; 4];
    for column in columns {
        let at = COLOR_NAMES.iter().find_map(|names| names.iter().position(|name| *name == column.name));
        color[at.unwrap_or(3)] = column.values[face] as f32 / column.kind.color_divisor();
    }
    color
}

fn color_name(color: [f32; 4]) -> String {
    let [r, g, b, a] = color.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
    if a == 255 {
        format!("color_{r:02x}{g:02x}{b:02x}")
    } else {
        format!("color_{r:02x}{g:02x}{b:02x}{a:02x}")
    }
}

fn picture_name(at: usize) -> String {
    format!("material_{at}")
}

/// Returns a material library: a material for each picture, or else for each colour.
fn library(pictures: &[String], colors: &[FaceColumn], rows: &[usize]) -> String {
    let mut text = String::new();
    for (at, picture) in pictures.iter().enumerate() {
        text += &format!("newmtl {}\nmap_Kd {picture}\n", picture_name(at));
    }
    if pictures.is_empty() && !colors.is_empty() {
        let mut seen = HashSet::new();
        for color in rows.iter().map(|&face| color_of(colors, face)) {
            let name = color_name(color);
            if seen.insert(name.clone()) {
                // Colours of materials are linear, as in glTF.
                let [r, g, b] = [0, 1, 2].map(|k| linear_of_srgb(color[k].clamp(0.0, 1.0)));
                text += &format!("newmtl {name}\nKd {r} {g} {b}\n");
                if color[3] < 1.0 {
                    text += &format!("d {}\n", color[3].clamp(0.0, 1.0));
                }
            }
        }
    }
    text
}
