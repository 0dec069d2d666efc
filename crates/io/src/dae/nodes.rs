//! Nodes of the visual scene, and the geometries that they place.

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3};
use serde_json::json;

use super::document::{Ids, child, children, descend, error, numbers};
use super::geometry::{self, Geometry};
use super::materials::DaeMaterials;
use super::tree::{DaeElement, XmlTree};
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::format::Format;
use crate::gltf::{BroughtImages, BuiltScene, SceneBuilder, matrix_of_node};
use crate::options::ReadOptions;

/// Limits on the nodes that instances create: each may place any other node several times. Guessed: more than any file
/// has, and within memory.
const ALWAYS_ALLOWED_NODES: usize = 1 << 16;
const MAX_NODES: usize = 1 << 21;
const MAX_DEPTH: usize = 256;
/// Number of file bytes that allow one more node.
const BYTES_PER_NODE: usize = 16;

/// Builds the scene of a file; `warning` is about its text.
pub(super) fn build(
    text: &str,
    warning: Option<Warning>,
    options: &ReadOptions,
) -> Result<BuiltScene, ReadError> {
    let document = XmlTree::parse(text, options.limits)?;
    let root = document.root();
    if root.tag() != "COLLADA" {
        return Err(ReadError::file("it is XML, but not a COLLADA document"));
    }
    let version = root.attribute("version").unwrap_or("1.4");
    if !version.starts_with("1.4") && !version.starts_with("1.5") {
        let version = excerpt(version);
        return Err(ReadError::Unsupported(format!(
            "COLLADA {version} is not supported: only 1.4 and 1.5 are"
        )));
    }
    let images = BroughtImages::new(options.files(), options.limits);
    let mut builder = DaeScene {
        ids: Ids::new(root),
        scene: SceneBuilder::new(Format::Dae),
        materials: DaeMaterials::new(images),
        geometries: HashMap::new(),
        meshes: HashMap::new(),
        at_root: Vec::new(),
        open: Vec::new(),
        nodes: ALWAYS_ALLOWED_NODES.saturating_add(text.len() / BYTES_PER_NODE).min(MAX_NODES),
    };
    warning.into_iter().for_each(|w| builder.scene.warn(w));
    builder.warn_of_losses(root);
    let mut roots = builder.roots(root)?;
    for warning in builder.ids.dangling(builder.meshes.values().all(Option::is_none))? {
        builder.scene.warn(warning);
    }
    roots.append(&mut builder.at_root);
    let roots = builder.in_gltf_axes(root, roots)?;
    Ok(builder.scene.finish(&roots))
}

struct DaeScene<'a> {
    ids: Ids<'a>,
    scene: SceneBuilder,
    materials: DaeMaterials<'a>,
    geometries: HashMap<&'a str, Geometry>,
    /// Meshes by their geometry and the materials that its symbols are bound to.
    meshes: HashMap<(&'a str, Vec<Option<usize>>), Option<usize>>,
    /// Nodes of skinned meshes, which are not moved by other nodes.
    at_root: Vec<usize>,
    /// The ancestors of the node that is being placed.
    open: Vec<DaeElement<'a>>,
    /// Number of nodes that may still be created.
    nodes: usize,
}

impl<'a> DaeScene<'a> {
    fn warn_of_losses(&mut self, root: DaeElement<'a>) {
        for (library, entry, what) in [
            ("library_animations", "animation", "animations"),
            ("library_cameras", "camera", "cameras"),
            ("library_lights", "light", "lights"),
            ("library_physics_scenes", "physics_scene", "physics scenes"),
            ("library_articulated_systems", "articulated_system", "kinematics"),
        ] {
            if children(root, library).any(|l| child(l, entry).is_some()) {
                self.scene.warn(Warning::lost_of_scene(format!("{what} of COLLADA are not read: dropped")));
            }
        }
    }

    fn roots(&mut self, root: DaeElement<'a>) -> Result<Vec<usize>, ReadError> {
        let shown = descend(root, &["scene", "instance_visual_scene"]);
        let shown = shown.and_then(|instance| self.ids.target_or_note(instance, "url", "visual_scene"));
        let scene = shown.or_else(|| descend(root, &["library_visual_scenes", "visual_scene"]));
        if let Some(scene) = scene {
            return children(scene, "node").map(|node| self.node(node)).collect();
        }
        // A library of geometries: each is placed at the origin.
        let all: Vec<_> =
            children(root, "library_geometries").flat_map(|l| children(l, "geometry")).collect();
        let mut roots = Vec::new();
        for geometry in all {
            if let Some(mesh) = self.mesh(geometry, None)? {
                roots.push(self.scene.add("nodes", json!({ "mesh": mesh })));
            }
        }
        Ok(roots)
    }

    /// Returns the roots, below a node that converts units and axes if these differ from glTF.
    fn in_gltf_axes(&mut self, root: DaeElement<'a>, roots: Vec<usize>) -> Result<Vec<usize>, ReadError> {
        let unit = descend(root, &["asset", "unit"]).and_then(|u| Some((u, u.attribute("meter")?)));
        let scale = match unit {
            None => 1.0,
            Some((element, meters)) => {
                let meters = meters.trim().parse::<f64>().ok().filter(|m| m.is_finite() && *m > 0.0);
                meters.ok_or_else(|| error(element, "the unit is not a number above 0"))?
            }
        };
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let rotation = match descend(root, &["asset", "up_axis"]).map(|e| e.text().trim()) {
            Some("Z_UP") => Some([-half, 0.0, 0.0, half]),
            Some("X_UP") => Some([0.0, 0.0, half, half]),
            _ => None,
        };
        if roots.is_empty() || (scale == 1.0 && rotation.is_none()) {
            return Ok(roots);
        }
        let mut node = json!({ "name": "COLLADA scene", "children": roots, "scale": ([scale; 3]) });
        if let Some(rotation) = rotation {
            node["rotation"] = json!(rotation);
        }
        Ok(vec![self.scene.add("nodes", node)])
    }

    /// Adds a node with all below it; returns its index.
    fn node(&mut self, element: DaeElement<'a>) -> Result<usize, ReadError> {
        if self.open.contains(&element) {
            return Err(error(element, "the node contains itself"));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(error(element, format!("nodes are nested more than {MAX_DEPTH} deep")));
        }
        self.count_node(element)?;
        let mut node = json!({});
        if let Some(name) = element.attribute("name").or(element.attribute("id")) {
            node["name"] = name.into();
        }
        let index = self.scene.add("nodes", node);
        if let Some(matrix) = matrix_of_node(transform(element)?, &mut self.scene) {
            self.scene.entry("nodes", index)["matrix"] = matrix;
        }
        self.open.push(element);
        let (mut child_nodes, mut meshes) = (Vec::new(), Vec::new());
        for part in element.children() {
            match part.tag() {
                "node" => child_nodes.push(self.node(part)?),
                "instance_node" => {
                    if let Some(node) = self.ids.target_or_note(part, "url", "node") {
                        child_nodes.push(self.node(node)?);
                    }
                }
                "instance_geometry" => {
                    if let Some(geometry) = self.ids.target_or_note(part, "url", "geometry") {
                        meshes.extend(self.mesh(geometry, Some(part))?);
                    }
                }
                "instance_controller" => meshes.extend(self.controller(part)?),
                _ => {}
            }
        }
        self.open.pop();
        // A node of glTF has one mesh.
        if let [mesh] = meshes[..] {
            self.scene.entry("nodes", index)["mesh"] = mesh.into();
        } else {
            for mesh in meshes {
                self.count_node(element)?;
                child_nodes.push(self.scene.add("nodes", json!({ "mesh": mesh })));
            }
        }
        if !child_nodes.is_empty() {
            self.scene.entry("nodes", index)["children"] = child_nodes.into();
        }
        Ok(index)
    }

    fn count_node(&mut self, element: DaeElement<'a>) -> Result<(), ReadError> {
        let left = self.nodes.checked_sub(1);
        self.nodes = left.ok_or_else(|| {
            error(element, "instances create more nodes than allowed for a file of this size")
        })?;
        Ok(())
    }

    /// Returns the mesh of a controller without its skin or shapes, if the node of the instance places it.
    fn controller(&mut self, instance: DaeElement<'a>) -> Result<Option<usize>, ReadError> {
        let Some(mut controller) = self.ids.target_or_note(instance, "url", "controller") else {
            return Ok(None);
        };
        let mut bind = None;
        // A skin may be over shapes, and these over a geometry.
        for _ in 0..8 {
            let (kind, what) = match (child(controller, "skin"), child(controller, "morph")) {
                (Some(skin), _) => (skin, "skins"),
                (None, Some(morph)) => (morph, "morph targets"),
                (None, None) => return Err(error(controller, "it is neither a skin nor a morph")),
            };
            self.scene.warn(Warning::lost_of_scene(format!("{what} of COLLADA are not read: dropped")));
            if what == "skins" {
                let matrix = child(kind, "bind_shape_matrix").map(numbers).transpose()?;
                bind = Some(matrix.and_then(|m| Some(rows(m.first_chunk()?))).unwrap_or(DMat4::IDENTITY));
            }
            let source = kind.attribute("source").and_then(|s| self.ids.find(s));
            if let Some(over) = source.filter(|s| s.tag() == "controller") {
                controller = over;
                continue;
            }
            let Some(source) = self.ids.target_or_note(kind, "source", "geometry") else { return Ok(None) };
            let mesh = self.mesh(source, Some(instance))?;
            let (Some(mesh), Some(bind)) = (mesh, bind) else { return Ok(mesh) };
            // A skinned mesh is placed by its joints; in the bind pose that is at the root.
            self.count_node(instance)?;
            let mut node = json!({ "mesh": mesh });
            if let Some(matrix) = matrix_of_node(bind, &mut self.scene) {
                node["matrix"] = matrix;
            }
            self.at_root.push(self.scene.add("nodes", node));
            return Ok(None);
        }
        Err(error(controller, "controllers refer to each other"))
    }

    /// Returns the mesh of a geometry with the materials that an instance binds; `None` if it has no faces.
    fn mesh(
        &mut self,
        element: DaeElement<'a>,
        instance: Option<DaeElement<'a>>,
    ) -> Result<Option<usize>, ReadError> {
        let id = element.attribute("id").unwrap_or_default();
        if !self.geometries.contains_key(id) {
            let read = geometry::read(&mut self.ids, element, &mut self.scene)?;
            self.geometries.insert(id, read);
        }
        let Geometry { mesh: corners, uv_sets } = &self.geometries[id];
        if corners.is_empty() {
            return Ok(None);
        }
        let mut bound = HashMap::new();
        let technique = instance.and_then(|i| descend(i, &["bind_material", "technique_common"]));
        for binding in technique.into_iter().flat_map(|t| children(t, "instance_material")) {
            let material = self.materials.of_instance(&mut self.ids, binding, uv_sets, &mut self.scene)?;
            if let Some(material) = material {
                bound.insert(binding.attribute("symbol").unwrap_or_default(), material);
            }
        }
        let bound_to = |symbol: &Option<String>| bound.get(symbol.as_deref()?).copied();
        let key = (id, corners.primitives.iter().map(|(symbol, _)| bound_to(symbol)).collect::<Vec<_>>());
        if let Some(&known) = self.meshes.get(&key) {
            return Ok(known);
        }
        if corners.primitives.iter().any(|(symbol, _)| symbol.is_some() && bound_to(symbol).is_none()) {
            self.scene.warn(Warning::note(
                "some faces use material symbols that are not bound: they get no material",
            ));
        }
        let split = corners.split(bound_to);
        if split.lost_normals {
            self.scene
                .warn(Warning::lost("a geometry has normals for some of its faces only: they are dropped"));
        }
        let mesh = self.scene.mesh(split.parts);
        self.meshes.insert(key, mesh);
        Ok(mesh)
    }
}

/// Returns the product of the transforms of a node.
fn transform(node: DaeElement<'_>) -> Result<DMat4, ReadError> {
    let mut product = DMat4::IDENTITY;
    for element in node.children() {
        let name = element.tag();
        if !matches!(name, "matrix" | "translate" | "rotate" | "scale" | "lookat" | "skew") {
            continue;
        }
        let values = numbers(element)?;
        let next = match (name, &values[..]) {
            ("matrix", all) if all.len() == 16 => all.first_chunk().map(rows).unwrap_or_default(),
            ("translate", &[x, y, z]) => DMat4::from_translation(DVec3::new(x, y, z)),
            ("scale", &[x, y, z]) => DMat4::from_scale(DVec3::new(x, y, z)),
            ("rotate", &[x, y, z, degrees]) => {
                let axis = DVec3::new(x, y, z).try_normalize();
                axis.map_or(DMat4::IDENTITY, |a| {
                    DMat4::from_quat(DQuat::from_axis_angle(a, degrees.to_radians()))
                })
            }
            ("lookat", &[ex, ey, ez, ix, iy, iz, ux, uy, uz]) => {
                let (eye, up) = (DVec3::new(ex, ey, ez), DVec3::new(ux, uy, uz));
                let back = (eye - DVec3::new(ix, iy, iz)).normalize_or(DVec3::Z);
                let right = up.cross(back).normalize_or(DVec3::X);
                let up = back.cross(right);
                DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0))
            }
            ("skew", _) => return Err(error(element, "skewed nodes are not read")),
            _ => {
                return Err(error(
                    element,
                    format!("it has {} numbers, which is the wrong count", values.len()),
                ));
            }
        };
        product *= next;
    }
    if !product.is_finite() {
        return Err(error(node, "its transform is not finite"));
    }
    Ok(product)
}

/// Returns a matrix from its rows.
fn rows(values: &[f64; 16]) -> DMat4 {
    DMat4::from_cols_array(values).transpose()
}
