//! The placements of the meshes of a scene: how often, how large, and the box around all.

use std::collections::HashMap;

use lodsmith_core::{Bounds, TriMesh};
use serde_json::Value;

use super::affine::{Affine, Lengths};
use super::buffers::Buffers;
use super::placements::PlacedNodes;
use super::places::Places;
use crate::error::ReadError;

/// The placements of a mesh.
#[derive(Default)]
pub(super) struct MeshPlaces {
    pub(super) instances: usize,
    pub(super) lengths: Lengths,
    /// Its transform, if it is placed once.
    pub(super) only: Option<Affine>,
    /// The transforms of its first placements without a skin.
    rigid: Vec<Affine>,
}

/// Maximum number of placements of one mesh that are kept. (Guessed: parts that touch are placed thousands of times at
/// most.)
const MAX_KEPT_PLACES: usize = 1 << 16;

impl MeshPlaces {
    /// Returns the rows of the transforms of all placements, if they are kept.
    pub(super) fn known_places(&self) -> Vec<[[f64; 4]; 3]> {
        match self.rigid.len() == self.instances {
            true => self.rigid.iter().map(|place| place.0).collect(),
            false => Vec::new(),
        }
    }
}

/// Returns the placements of each mesh, and the bounding box of what is shown, from the boxes of the meshes (for
/// skinned meshes from their vertices). `size` is the size of the file, or of its buffers if they are larger.
///
/// Cost: O(nodes + copies + vertices of skinned meshes); few copies are held in memory.
pub(super) fn survey(
    json: &Value,
    buffers: &Buffers<'_>,
    nodes: &PlacedNodes,
    meshes: &[&TriMesh],
    size: usize,
) -> Result<(Vec<MeshPlaces>, Option<Bounds>), ReadError> {
    let mut places = Places::new(json, buffers, nodes, size);
    let mut all: Vec<MeshPlaces> = meshes.iter().map(|_| MeshPlaces::default()).collect();
    let mut bounds = None;
    // Computed once, however often the mesh is placed: boxes in its own coordinates, and in the scene for each skin.
    let mut own: HashMap<usize, Option<Bounds>> = HashMap::new();
    let mut skinned: HashMap<(usize, usize), Option<Bounds>> = HashMap::new();
    for placement in &nodes.placements {
        let of_node = places.of(placement)?;
        let (mesh, of_mesh) = (meshes[placement.mesh], &mut all[placement.mesh]);
        let is_first = of_mesh.instances == 0;
        let skin = of_node.skin_of(mesh);
        of_mesh.only = of_node.only(skin.is_some()).filter(|_| is_first);
        of_mesh.instances = of_mesh.instances.saturating_add(of_node.count());
        if let Some((number, skin)) = skin {
            let key = (placement.mesh, number);
            let of_skin = match skinned.get(&key) {
                Some(known) => *known,
                None => {
                    places.take_vertices(mesh.wedge_count())?;
                    skin.of_joints(mesh).for_each(|place| of_mesh.lengths.add(&place));
                    let (positions, _) = skin.deformed(mesh);
                    let found = Bounds::of(positions.into_iter().map(|p| p.map(f64::from)));
                    skinned.insert(key, found);
                    found
                }
            };
            let corners = of_skin.into_iter().flat_map(|b| [b.min, b.max]);
            corners.filter(|_| !placement.is_hidden).for_each(|p| grow(&mut bounds, p));
            continue;
        }
        let own = *own.entry(placement.mesh).or_insert_with(|| mesh.positions().view().bounds());
        for place in of_node.rigid() {
            of_mesh.lengths.add(&place);
            if of_mesh.rigid.len() < MAX_KEPT_PLACES {
                of_mesh.rigid.push(place);
            }
            let Some(Bounds { min, max }) = own.filter(|_| !placement.is_hidden) else { continue };
            for corner in 0..8 {
                let p = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { min[k] } else { max[k] });
                grow(&mut bounds, place.point(p));
            }
        }
    }
    Ok((all, bounds))
}

fn grow(bounds: &mut Option<Bounds>, p: [f64; 3]) {
    *bounds = Some(bounds.unwrap_or(Bounds { min: p, max: p }).with(p));
}
