//! Conversion of the names of locked and important parts and of error maps to vertices of the input.

use lodsmith::OwnedMeshData;
use lodsmith_core::{RegionId, Semantic, TriMesh, WedgeId};
use lodsmith_io::Loaded;
use lodsmith_io::gltf::Scene;

use crate::error::AssetError;

/// Names of parts and attributes of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartNames {
    /// Parts to keep: materials, groups, objects, meshes, nodes, or attributes whose value is not zero.
    pub lock: Vec<String>,
    /// The attribute that determines where more triangles are kept.
    pub importance: Option<Importance>,
    /// The attribute that is the share of the error limit at each vertex, from 0 to 1.
    pub error_map: Option<String>,
}

/// A vertex attribute, and how much denser the result is where it is 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Importance {
    /// Name of the attribute.
    pub name: String,
    /// Density of triangles where the attribute is 1, or at its largest value, relative to where it is 0.
    pub strength: f32,
}

impl Importance {
    /// Default strength. (Guessed: edges of half the length.)
    pub const DEFAULT_STRENGTH: f32 = 4.0;
}

/// Largest number of names listed in an error.
const MAX_NAMES_SHOWN: usize = 30;

/// A mesh with the names that apply to it.
struct NamedMesh<'a> {
    mesh: &'a TriMesh,
    /// Names that apply to the whole mesh.
    whole_mesh: Vec<String>,
    /// Names that apply to each region.
    regions: Vec<Vec<String>>,
    /// Vertex properties that are not attributes of the mesh.
    properties: &'a [(String, Vec<f32>)],
}

/// Returns the names of vertex properties that have to be read in addition to the mesh.
pub fn properties(names: &PartNames) -> Vec<String> {
    let importance = names.importance.as_ref().map(|i| i.name.clone());
    names.lock.iter().cloned().chain(importance).chain(names.error_map.clone()).collect()
}

/// Returns locks, importance, error maps and region classes of a mesh.
///
/// # Errors
/// If a name is not found; the error lists the names that exist.
pub fn of_mesh(names: &PartNames, loaded: &Loaded) -> Result<OwnedMeshData, AssetError> {
    let text = |name: &[u8]| String::from_utf8_lossy(name).into_owned();
    let regions = loaded.regions.iter().map(|region| {
        let groups = region.groups.into_iter().flat_map(|all| {
            // Several names separated by spaces, or one name that contains spaces.
            std::iter::once(all).chain(all.split(|c| c.is_ascii_whitespace())).filter(|name| !name.is_empty())
        });
        let others = [region.object, region.material, region.smoothing].into_iter().flatten();
        others.chain(groups).map(text).collect()
    });
    let named = NamedMesh {
        mesh: &loaded.mesh,
        whole_mesh: Vec::new(),
        regions: regions.collect(),
        properties: &loaded.properties,
    };
    let other = loaded.contents.attributes.iter().filter(|a| !VECTOR_ATTRIBUTES.contains(&a.as_str()));
    let mut all = constraints(names, &[named], other.cloned().collect()).map_err(|e| {
        if loaded.format.is_scene() {
            AssetError::Name(format!("{e} (names of meshes and nodes are known only if the output is glTF)"))
        } else {
            e
        }
    })?;
    let mut own = all.swap_remove(0);
    own.region_classes = Some(loaded.regions.classes());
    Ok(own)
}

/// Returns locks, importance and error maps of the meshes of a scene with these indices.
///
/// # Errors
/// Those of [`of_mesh`].
pub(crate) fn of_scene(
    names: &PartNames,
    scene: &Scene,
    taken: &[usize],
) -> Result<Vec<OwnedMeshData>, AssetError> {
    let of_meshes = scene.names();
    let all: Vec<_> = taken
        .iter()
        .map(|&i| {
            let (mesh, own) = (&scene.meshes()[i], &of_meshes[i]);
            let whole_mesh = std::iter::once(mesh.name.clone()).chain(own.nodes.iter().cloned()).collect();
            let regions = own.materials.iter().map(|m| m.iter().cloned().collect()).collect();
            NamedMesh { mesh: &mesh.mesh, whole_mesh, regions, properties: &[] }
        })
        .collect();
    constraints(names, &all, Vec::new())
}

/// Attributes in [`Contents::attributes`](lodsmith_io::Contents) with more than one number for each vertex.
const VECTOR_ATTRIBUTES: [&str; 3] = ["normals", "uvs", "colors"];
/// Names of colour channels on the command line.
const CHANNELS: [&str; 4] = ["color.r", "color.g", "color.b", "color.a"];

fn constraints(
    names: &PartNames,
    all: &[NamedMesh<'_>],
    other_names: Vec<String>,
) -> Result<Vec<OwnedMeshData>, AssetError> {
    let mut data = vec![OwnedMeshData::default(); all.len()];
    let unknown = |option: &str, name: &str, mut names: Vec<String>| {
        names.extend(all.iter().flat_map(NamedMesh::values_names).chain(other_names.iter().cloned()));
        let mut known = Vec::new();
        names.into_iter().for_each(|name| {
            if !known.contains(&name) {
                known.push(name);
            }
        });
        let what = match known.len() {
            0 => "the input has no names".to_owned(),
            n if n > MAX_NAMES_SHOWN => {
                format!(
                    "known names: {} and {} more",
                    known[..MAX_NAMES_SHOWN].join(", "),
                    n - MAX_NAMES_SHOWN
                )
            }
            _ => format!("known names: {}", known.join(", ")),
        };
        AssetError::Name(format!("{option} {name}: the name does not occur; {what}"))
    };
    if !names.lock.is_empty() {
        for name in &names.lock {
            let mut found = false;
            for (named, own) in all.iter().zip(&mut data) {
                let none = || vec![false; named.mesh.vertex_count()];
                found |= named.lock(name, own.locked.get_or_insert_with(none));
            }
            if !found {
                let names = all.iter().flat_map(|n| n.whole_mesh.iter().chain(n.regions.iter().flatten()));
                return Err(unknown("--lock", name, names.cloned().collect()));
            }
        }
    }
    if let Some(Importance { name, strength }) = &names.importance {
        let values: Vec<_> = all.iter().map(|n| n.values(name)).collect();
        if values.iter().all(Option::is_none) {
            return Err(unknown("--importance", name, Vec::new()));
        }
        let largest = values.iter().flatten().flatten().fold(1f32, |m, x| m.max(*x));
        let density = |x: f32| strength.powf(x.max(0.0) / largest);
        for (own, values) in data.iter_mut().zip(values) {
            own.importance = values.map(|v| v.into_iter().map(density).collect());
        }
    }
    if let Some(name) = &names.error_map {
        let values: Vec<_> = all.iter().map(|n| n.least_values(name)).collect();
        if values.iter().all(Option::is_none) {
            return Err(unknown("--error-map", name, Vec::new()));
        }
        data.iter_mut().zip(values).for_each(|(own, values)| own.error_map = values);
    }
    Ok(data)
}

impl NamedMesh<'_> {
    /// Locks the vertices that a name applies to. Returns true if the name occurs in this mesh.
    fn lock(&self, name: &str, locked: &mut [bool]) -> bool {
        let is = |other: &String| other == name;
        let mut found = self.whole_mesh.iter().any(is);
        if found {
            locked.fill(true);
        }
        let regions: Vec<bool> = self.regions.iter().map(|names| names.iter().any(is)).collect();
        if regions.contains(&true) {
            found = true;
            for (f, t) in self.mesh.triangles().iter().enumerate() {
                let region = self.mesh.regions().map_or(RegionId(0), |r| r[f]);
                if regions.get(region.index()) == Some(&true) {
                    t.iter().for_each(|&w| locked[self.mesh.vertex_of(w).index()] = true);
                }
            }
        }
        if let Some(values) = self.values(name) {
            found = true;
            locked.iter_mut().zip(values).for_each(|(l, x)| *l |= x != 0.0);
        }
        found
    }

    /// Returns the values of a name at the vertices; if a vertex has several values, the value farthest from 0. NaN and
    /// infinity count as 0.
    fn values(&self, name: &str) -> Option<Vec<f32>> {
        self.folded(name, 0.0, |value, x| if x.is_finite() && x.abs() > value.abs() { x } else { value })
    }

    /// As [`NamedMesh::values`], but the least value, and NaN if one is; 1 for a vertex without a value.
    fn least_values(&self, name: &str) -> Option<Vec<f32>> {
        self.folded(name, f32::INFINITY, |value, x| if x.is_nan() || x < value { x } else { value })
            .map(|all| all.into_iter().map(|x| if x == f32::INFINITY { 1.0 } else { x }).collect())
    }

    /// Combines all values of a name at each vertex.
    fn folded(&self, name: &str, first: f32, fold: impl Fn(f32, f32) -> f32) -> Option<Vec<f32>> {
        if let Some((_, values)) = self.properties.iter().find(|p| p.0 == name) {
            return Some(values.iter().map(|&x| fold(first, x)).collect());
        }
        let mesh = self.mesh;
        if let (Some(channel), Some(colors)) = (CHANNELS.iter().position(|c| *c == name), mesh.colors()) {
            return Some(self.folded_wedges(first, fold, |w| &colors[w.index()][channel..=channel]));
        }
        // glTF prefixes custom attributes with an underscore.
        let is_meant =
            |s: &Semantic| s.name().is_some_and(|own| own == name || own.strip_prefix('_') == Some(name));
        let attribute = mesh.further_attributes().iter().find(|a| is_meant(&a.semantic))?;
        Some(self.folded_wedges(first, fold, |w| attribute.of(w)))
    }

    fn folded_wedges<'v>(
        &self,
        first: f32,
        fold: impl Fn(f32, f32) -> f32,
        of: impl Fn(WedgeId) -> &'v [f32],
    ) -> Vec<f32> {
        let mut values = vec![first; self.mesh.vertex_count()];
        for w in (0..self.mesh.wedge_count()).map(WedgeId::new) {
            let value = &mut values[self.mesh.vertex_of(w).index()];
            *value = of(w).iter().fold(*value, |value, x| fold(value, *x));
        }
        values
    }

    /// Returns the names that [`NamedMesh::values`] finds.
    fn values_names(&self) -> Vec<String> {
        let channels = if self.mesh.colors().is_some() { &CHANNELS[..] } else { &[] };
        let further =
            self.mesh.further_attributes().iter().filter_map(|a| a.semantic.name().map(str::to_owned));
        channels.iter().map(|c| (*c).to_owned()).chain(further).collect()
    }
}
