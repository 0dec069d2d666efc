//! Sets of faces that share maps, with their texture coordinates.

use std::collections::BTreeSet;

use glam::DVec3;
use lodsmith_core::Model;
use lodsmith_core::geometry::triangle::double_area_normal;
use lodsmith_core::model::{AlphaMode, Material};

use crate::atlas::{USUAL_FILL, unwrap};
use crate::cover::{Cover, MAX_TILES, TexelFace};
use crate::error::BakeError;
use crate::flat::{Flat, NO_MATERIAL};
use crate::options::{AtlasMode, BakeOptions, MapKind};

/// Faces with common maps.
pub(crate) struct FaceSet {
    pub(crate) name: String,
    /// The material of the lighter model that gets the maps; `None` for a new one.
    pub(crate) material: Option<usize>,
    /// Materials of the lighter model that the set replaces or belongs to.
    pub(crate) materials: BTreeSet<u32>,
    /// Numbers of faces in the flat lighter surface, ascending.
    pub(crate) faces: Vec<usize>,
    pub(crate) is_new: bool,
    pub(crate) size: usize,
    pub(crate) maps: Vec<MapJob>,
}

/// A map to bake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapJob {
    pub(crate) kind: MapKind,
    /// True if occlusion comes from the map of the source, not from rays.
    pub(crate) is_copied: bool,
}

/// Share of covered texels that may have more than one face before coordinates count as overlapping: allows for
/// touching edges of charts, and for faces that a run has folded over. (Guessed.)
const MAX_OVERLAP: f64 = 0.005;
/// Size at which overlaps are searched for.
const OVERLAP_SIZE: usize = 1024;

/// Splits the faces into sets, and returns the notes for the user.
pub(crate) fn split(
    light: &Flat,
    model: &Model,
    has_uvs: &dyn Fn(usize) -> bool,
    mode: AtlasMode,
) -> (Vec<FaceSet>, Vec<String>) {
    let mut notes = Vec::new();
    let mut by_material: std::collections::BTreeMap<u32, Vec<usize>> = std::collections::BTreeMap::new();
    for (f, &material) in light.materials.iter().enumerate() {
        by_material.entry(material).or_default().push(f);
    }
    let (mut sets, mut rest, mut replaced) = (Vec::new(), Vec::new(), BTreeSet::new());
    for (material, faces) in by_material {
        let known = model.materials.get(material as usize).filter(|_| material != NO_MATERIAL);
        let name = known.map_or("", |m| m.name.as_str()).to_owned();
        let problem = match mode {
            AtlasMode::New => Some(None),
            AtlasMode::Keep if faces.iter().all(|&f| has_uvs(f)) => overlap_problem(light, &faces).map(Some),
            AtlasMode::Keep => Some(Some("they have no texture coordinates".to_owned())),
        };
        if let Some(problem) = problem {
            if let Some(problem) = problem {
                let title = if name.is_empty() { String::new() } else { format!(" of material {name}") };
                notes.push(format!("faces{title} get a new atlas: {problem}"));
            }
            rest.extend(faces);
            replaced.insert(material);
            continue;
        }
        let own = (material != NO_MATERIAL).then_some(material as usize);
        let materials = [material].into();
        sets.push(FaceSet {
            name,
            material: own,
            materials,
            faces,
            is_new: false,
            size: 0,
            maps: Vec::new(),
        });
    }
    if !rest.is_empty() {
        rest.sort_unstable();
        let name = if sets.is_empty() { "baked" } else { "baked_atlas" }.to_owned();
        let set = FaceSet {
            name,
            material: None,
            materials: replaced,
            faces: rest,
            is_new: true,
            size: 0,
            maps: Vec::new(),
        };
        sets.push(set);
    }
    (sets, notes)
}

/// Returns the corner coordinates of a face of the flat surface.
pub(crate) fn face_uvs(light: &Flat, face: usize) -> [[f32; 2]; 3] {
    let uvs = light.mesh.uvs().unwrap_or_default();
    light.mesh.triangles()[face].map(|w| uvs.get(w.index()).copied().unwrap_or_default())
}

/// Returns why coordinates cannot be used for baking.
fn overlap_problem(light: &Flat, faces: &[usize]) -> Option<String> {
    let side = |uvs: &[[f32; 2]; 3], k: usize| {
        let of = |f: fn(f32, f32) -> f32| uvs.iter().map(|uv| uv[k]).reduce(f).unwrap_or(0.0);
        f64::from(of(f32::max) - of(f32::min))
    };
    let all = || faces.iter().map(|&f| face_uvs(light, f));
    let is_wide = |uvs: &[[f32; 2]; 3]| !(side(uvs, 0) <= MAX_TILES && side(uvs, 1) <= MAX_TILES);
    if all().any(|uvs| is_wide(&uvs)) {
        return Some("a texture is repeated over a face".to_owned());
    }
    // Twice the area of the tile cannot fit into it without overlaps.
    let area: f64 = all().map(|uvs| TexelFace::new(0, uvs, 1).double_area().abs() / 2.0).sum();
    if area > 1.0 + MAX_OVERLAP {
        return Some(format!("texture coordinates overlap: they cover {area:.1} times the texture"));
    }
    if area == 0.0 {
        return Some("texture coordinates have no area".to_owned());
    }
    let numbered = faces.iter().zip(all()).map(|(&f, uvs)| TexelFace::new(f as u32, uvs, OVERLAP_SIZE));
    let overlap = Cover::new(OVERLAP_SIZE, numbered).overlap();
    (overlap > MAX_OVERLAP)
        .then(|| format!("texture coordinates overlap in {:.1} % of their area", 100.0 * overlap))
}

/// Chooses the maps of a set: the requested maps, and for a new atlas also the maps that its materials have.
pub(crate) fn maps_of(set: &FaceSet, model: &Model, options: &BakeOptions) -> Vec<MapJob> {
    let mut jobs: Vec<MapJob> = options.maps.iter().map(|&kind| MapJob { kind, is_copied: false }).collect();
    jobs.sort_by_key(|j| j.kind);
    jobs.dedup();
    if !set.is_new {
        return jobs;
    }
    let plain = Material::default();
    let own: Vec<&Material> =
        set.materials.iter().map(|&m| model.materials.get(m as usize).unwrap_or(&plain)).collect();
    let first = own.first().copied().unwrap_or(&plain);
    let differs = |of: &dyn Fn(&Material) -> [f32; 4]| own.iter().any(|m| of(m) != of(first));
    let has = |of: &dyn Fn(&Material) -> bool| own.iter().any(|m| of(m));
    let needed = [
        // A normal map of the source can only be baked together with its geometry.
        (MapKind::Normal, has(&|m| m.normal_texture.is_some())),
        (MapKind::Color, has(&|m| m.base_color_texture.is_some()) || differs(&|m| m.base_color)),
        (
            MapKind::MetallicRoughness,
            has(&|m| m.metallic_roughness_texture.is_some())
                || differs(&|m| [m.metallic, m.roughness, 0.0, 0.0]),
        ),
        (
            MapKind::Emissive,
            has(&|m| m.emissive_texture.is_some())
                || differs(&|m| [m.emissive[0], m.emissive[1], m.emissive[2], 0.0]),
        ),
        (MapKind::Occlusion, has(&|m| m.occlusion_texture.is_some())),
    ];
    for (kind, is_needed) in needed {
        if is_needed && !jobs.iter().any(|j| j.kind == kind) {
            jobs.push(MapJob { kind, is_copied: true });
        }
    }
    jobs.sort_by_key(|j| j.kind);
    jobs
}

/// Returns the material for a set without its own.
pub(crate) fn material_of(set: &FaceSet, model: &Model) -> Material {
    let known: Vec<&Material> =
        set.materials.iter().filter_map(|&m| model.materials.get(m as usize)).collect();
    let mut made = known.first().map(|m| (*m).clone()).unwrap_or_default();
    made.name = set.name.clone();
    made.double_sided = known.iter().any(|m| m.double_sided);
    made.unlit = !known.is_empty() && known.iter().all(|m| m.unlit);
    let blends = known.iter().any(|m| m.alpha == AlphaMode::Blend);
    let mask = known.iter().find_map(|m| matches!(m.alpha, AlphaMode::Mask(_)).then_some(m.alpha));
    made.alpha = if blends { AlphaMode::Blend } else { mask.unwrap_or_default() };
    made.textures_mut().into_iter().for_each(|t| *t = None);
    made
}

/// Smallest and largest size that is chosen automatically.
const CHOSEN_SIZES: [f64; 2] = [256.0, 4096.0];
/// Texels for each face of the source, so that its normals are not lost. (Guessed.)
const TEXELS_PER_FACE: f64 = 4.0;

/// Chooses a power of two for the size of a set's maps: the density of the textures of the source, or a few texels for
/// each of its faces if that is more.
pub(crate) fn chosen_size(set: &FaceSet, light: &Flat, source: &Flat, model: &Model) -> usize {
    let area_of = |flat: &Flat, f: usize| double_area_normal(flat.corners(f)).length() / 2.0;
    let (mut area, mut texels) = (0.0, 0.0);
    for f in 0..source.mesh.face_count() {
        area += area_of(source, f);
        let material = model.materials.get(source.materials[f] as usize);
        let maps = material.map_or([None; 2], |m| [m.base_color_texture, m.normal_texture]);
        let of_map = maps.into_iter().flatten().map(|map| {
            let image = &model.images[map.image];
            let [a, b, c] = face_uvs(source, f).map(|uv| map.look_up(uv).map(f64::from));
            let double = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            double.abs() / 2.0 * (image.width() * image.height()) as f64
        });
        texels += of_map.fold(TEXELS_PER_FACE, f64::max);
    }
    let own_area: f64 = set.faces.iter().map(|&f| area_of(light, f)).sum();
    let fill: f64 = if set.is_new {
        USUAL_FILL
    } else {
        set.faces.iter().map(|&f| TexelFace::new(0, face_uvs(light, f), 1).double_area().abs() / 2.0).sum()
    };
    let wanted = libm::sqrt(texels / area.max(f64::MIN_POSITIVE) * own_area / fill.max(1e-3));
    let wanted = if wanted.is_finite() { wanted } else { CHOSEN_SIZES[0] };
    let clamped = wanted.clamp(CHOSEN_SIZES[0], CHOSEN_SIZES[1]);
    1 << libm::round(libm::log2(clamped)) as u32
}

/// Returns the coordinates at the corners of all faces: of the lighter surface, or of new atlases.
pub(crate) fn all_uvs(
    light: &Flat,
    sets: &[FaceSet],
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<[[f32; 2]; 3]>, BakeError> {
    let mut uvs: Vec<[[f32; 2]; 3]> = (0..light.mesh.face_count()).map(|f| face_uvs(light, f)).collect();
    for set in sets.iter().filter(|s| s.is_new) {
        let made = unwrap(light, &set.faces, set.size, proceed)?;
        set.faces.iter().zip(made).for_each(|(&f, uv)| uvs[f] = uv);
    }
    Ok(uvs)
}

/// The steps on the surface from one sample to the next along the rows and columns of a map of some size.
pub(crate) fn texel_steps(corners: [DVec3; 3], face: &TexelFace) -> [DVec3; 2] {
    let [a, b, c] = face.corners;
    let (d1, d2) = (b - a, c - a);
    let inverse = 1.0 / d1.perp_dot(d2);
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let x = (e1 * d2.y - e2 * d1.y) * inverse;
    let y = (e2 * d1.x - e1 * d2.x) * inverse;
    [x, y]
}
