//! Finds references of a glTF file to elements that do not exist; the tests and `cargo xtask corpus` use it.
//!
//! The tables are made from the specifications and do not know the table of the crate.

use std::collections::BTreeMap;

use serde_json::Value;

/// The list of the file that has the extension.
const HOST: &str = "@host";
/// The morph targets of the mesh that is named beside the number, by its own number or by that of its node.
const MORPHS: &str = "@morphs";
/// A JSON pointer in place of a number.
const POINTER: &str = "@pointer";

/// Paths from the root of a file to numbers, and the path to the list that a number there is of. In the first, `*` is
/// every entry of a list or an object, `*Texture` every entry with such an end; in the second, `*` stands for what the
/// first ones of the first are.
const CORE: &[(&str, &str)] = &[
    ("scene", "scenes"),
    ("scenes/*/nodes/*", "nodes"),
    ("nodes/*/children/*", "nodes"),
    ("nodes/*/mesh", "meshes"),
    ("nodes/*/camera", "cameras"),
    ("nodes/*/skin", "skins"),
    ("skins/*/joints/*", "nodes"),
    ("skins/*/skeleton", "nodes"),
    ("skins/*/inverseBindMatrices", "accessors"),
    ("meshes/*/primitives/*/attributes/*", "accessors"),
    ("meshes/*/primitives/*/indices", "accessors"),
    ("meshes/*/primitives/*/targets/*/*", "accessors"),
    ("meshes/*/primitives/*/material", "materials"),
    ("animations/*/samplers/*/input", "accessors"),
    ("animations/*/samplers/*/output", "accessors"),
    ("animations/*/channels/*/sampler", "animations/*/samplers"),
    ("animations/*/channels/*/target/node", "nodes"),
    ("accessors/*/bufferView", "bufferViews"),
    ("accessors/*/sparse/indices/bufferView", "bufferViews"),
    ("accessors/*/sparse/values/bufferView", "bufferViews"),
    ("bufferViews/*/buffer", "buffers"),
    ("images/*/bufferView", "bufferViews"),
    ("textures/*/source", "images"),
    ("textures/*/sampler", "samplers"),
    ("materials/*/*Texture/index", "textures"),
    ("materials/*/pbrMetallicRoughness/*Texture/index", "textures"),
    // Textures have such names in all extensions of materials.
    ("materials/*/extensions/*/*Texture/index", "textures"),
];

/// Extensions, wherever they are, with paths from their object.
const EXTENSIONS: &[(&str, &str, &str)] = &[
    // Materials and textures.
    ("KHR_materials_variants", "mappings/*/material", "materials"),
    ("KHR_materials_variants", "mappings/*/variants/*", "extensions/KHR_materials_variants/variants"),
    ("MOZ_lightmap", "index", "textures"),
    ("KHR_texture_basisu", "source", "images"),
    ("EXT_texture_avif", "source", "images"),
    ("EXT_texture_webp", "source", "images"),
    ("MSFT_texture_dds", "source", "images"),
    // Storage.
    ("KHR_draco_mesh_compression", "bufferView", "bufferViews"),
    ("EXT_meshopt_compression", "buffer", "buffers"),
    ("KHR_meshopt_compression", "buffer", "buffers"),
    // Meshes and their features.
    ("CESIUM_primitive_outline", "indices", "accessors"),
    ("EXT_mesh_manifold", "manifoldPrimitive/indices", "accessors"),
    ("EXT_mesh_manifold", "manifoldPrimitive/attributes/*", "accessors"),
    ("EXT_mesh_manifold", "mergeIndices", "accessors"),
    ("EXT_mesh_manifold", "mergeValues", "accessors"),
    ("EXT_mesh_primitive_edge_visibility", "visibility", "accessors"),
    ("EXT_mesh_primitive_edge_visibility", "silhouetteNormals", "accessors"),
    ("EXT_mesh_primitive_edge_visibility", "material", "materials"),
    ("EXT_mesh_primitive_edge_visibility", "lineStrings/*/indices", "accessors"),
    ("EXT_mesh_primitive_edge_visibility", "lineStrings/*/material", "materials"),
    ("EXT_mesh_features", "featureIds/*/texture/index", "textures"),
    ("EXT_mesh_features", "featureIds/*/propertyTable", "extensions/EXT_structural_metadata/propertyTables"),
    (
        "EXT_instance_features",
        "featureIds/*/propertyTable",
        "extensions/EXT_structural_metadata/propertyTables",
    ),
    ("EXT_structural_metadata", "propertyTables/*/properties/*/values", "bufferViews"),
    ("EXT_structural_metadata", "propertyTables/*/properties/*/arrayOffsets", "bufferViews"),
    ("EXT_structural_metadata", "propertyTables/*/properties/*/stringOffsets", "bufferViews"),
    ("EXT_structural_metadata", "propertyTextures/*/properties/*/index", "textures"),
    // Of a primitive; at the root, the entries are objects.
    ("EXT_structural_metadata", "propertyTextures/*", "extensions/EXT_structural_metadata/propertyTextures"),
    (
        "EXT_structural_metadata",
        "propertyAttributes/*",
        "extensions/EXT_structural_metadata/propertyAttributes",
    ),
    ("EXT_feature_metadata", "featureTables/*/properties/*/bufferView", "bufferViews"),
    ("EXT_feature_metadata", "featureTables/*/properties/*/arrayOffsetBufferView", "bufferViews"),
    ("EXT_feature_metadata", "featureTables/*/properties/*/stringOffsetBufferView", "bufferViews"),
    ("EXT_feature_metadata", "featureTextures/*/properties/*/texture/index", "textures"),
    ("EXT_feature_metadata", "featureIdTextures/*/featureIds/texture/index", "textures"),
    // Nodes and scenes.
    ("EXT_mesh_gpu_instancing", "attributes/*", "accessors"),
    ("MSFT_lod", "ids/*", HOST),
    ("KHR_lights_punctual", "light", "extensions/KHR_lights_punctual/lights"),
    ("EXT_lights_ies", "light", "extensions/EXT_lights_ies/lights"),
    ("EXT_lights_ies", "lights/*/bufferView", "bufferViews"),
    ("EXT_lights_image_based", "light", "extensions/EXT_lights_image_based/lights"),
    ("EXT_lights_image_based", "lights/*/specularImages/*/*", "images"),
    ("OMI_environment_sky", "sky", "extensions/OMI_environment_sky/skies"),
    ("OMI_environment_sky", "skies/*/panorama/cubemap/*", "textures"),
    ("OMI_environment_sky", "skies/*/panorama/equirectangular", "textures"),
    ("OMI_vehicle_body", "pilotSeat", "nodes"),
    ("KHR_xmp", "packet", "extensions/KHR_xmp/packets"),
    ("KHR_xmp_json_ld", "packet", "extensions/KHR_xmp_json_ld/packets"),
    ("KHR_animation_pointer", "pointer", POINTER),
    // Sound. Nodes have one emitter, scenes have several; at the root, they are objects.
    ("KHR_audio_emitter", "emitter", "extensions/KHR_audio_emitter/emitters"),
    ("KHR_audio_emitter", "emitters/*", "extensions/KHR_audio_emitter/emitters"),
    ("KHR_audio_emitter", "emitters/*/sources/*", "extensions/KHR_audio_emitter/sources"),
    ("KHR_audio_emitter", "sources/*/audio", "extensions/KHR_audio_emitter/audio"),
    ("KHR_audio_emitter", "audio/*/bufferView", "bufferViews"),
    ("OMI_audio_emitter", "audio/*/bufferView", "bufferViews"),
    ("MSFT_audio_emitter", "emitters/*", "extensions/MSFT_audio_emitter/emitters"),
    ("MSFT_audio_emitter", "emitters/*/clips/*/clip", "extensions/MSFT_audio_emitter/clips"),
    ("MSFT_audio_emitter", "clips/*/bufferView", "bufferViews"),
    // Physics.
    ("KHR_physics_rigid_bodies", "*/geometry/node", "nodes"),
    ("KHR_physics_rigid_bodies", "*/geometry/mesh", "meshes"),
    ("KHR_physics_rigid_bodies", "*/geometry/shape", "extensions/KHR_implicit_shapes/shapes"),
    ("KHR_physics_rigid_bodies", "*/physicsMaterial", "extensions/KHR_physics_rigid_bodies/physicsMaterials"),
    ("KHR_physics_rigid_bodies", "*/collisionFilter", "extensions/KHR_physics_rigid_bodies/collisionFilters"),
    ("KHR_physics_rigid_bodies", "trigger/nodes/*", "nodes"),
    ("KHR_physics_rigid_bodies", "joint/connectedNode", "nodes"),
    ("KHR_physics_rigid_bodies", "joint/joint", "extensions/KHR_physics_rigid_bodies/physicsJoints"),
    ("OMI_collider", "mesh", "meshes"),
    ("OMI_collider", "colliders/*/mesh", "meshes"),
    ("OMI_collider", "collider", "extensions/OMI_collider/colliders"),
    ("OMI_physics_body", "trigger/nodes/*", "nodes"),
    ("OMI_physics_body", "*/shape", "extensions/OMI_physics_shape/shapes"),
    ("OMI_physics_joint", "connectedNode", "nodes"),
    ("OMI_physics_joint", "nodeA", "nodes"),
    ("OMI_physics_joint", "nodeB", "nodes"),
    ("OMI_physics_shape", "shapes/*/*/mesh", "meshes"),
    // Avatars.
    ("VRM", "meta/texture", "textures"),
    ("VRM", "humanoid/humanBones/*/node", "nodes"),
    ("VRM", "firstPerson/firstPersonBone", "nodes"),
    ("VRM", "firstPerson/meshAnnotations/*/mesh", "meshes"),
    ("VRM", "blendShapeMaster/blendShapeGroups/*/binds/*/mesh", "meshes"),
    ("VRM", "blendShapeMaster/blendShapeGroups/*/binds/*/index", MORPHS),
    ("VRM", "secondaryAnimation/boneGroups/*/center", "nodes"),
    ("VRM", "secondaryAnimation/boneGroups/*/bones/*", "nodes"),
    (
        "VRM",
        "secondaryAnimation/boneGroups/*/colliderGroups/*",
        "extensions/VRM/secondaryAnimation/colliderGroups",
    ),
    ("VRM", "secondaryAnimation/colliderGroups/*/node", "nodes"),
    ("VRM", "materialProperties/*/textureProperties/*", "textures"),
    ("VRMC_vrm", "meta/thumbnailImage", "images"),
    ("VRMC_vrm", "humanoid/humanBones/*/node", "nodes"),
    ("VRMC_vrm", "firstPerson/meshAnnotations/*/node", "nodes"),
    ("VRMC_vrm", "expressions/*/*/morphTargetBinds/*/node", "nodes"),
    ("VRMC_vrm", "expressions/*/*/morphTargetBinds/*/index", MORPHS),
    ("VRMC_vrm", "expressions/*/*/materialColorBinds/*/material", "materials"),
    ("VRMC_vrm", "expressions/*/*/textureTransformBinds/*/material", "materials"),
    ("VRMC_springBone", "colliders/*/node", "nodes"),
    ("VRMC_springBone", "colliderGroups/*/colliders/*", "extensions/VRMC_springBone/colliders"),
    ("VRMC_springBone", "springs/*/center", "nodes"),
    ("VRMC_springBone", "springs/*/joints/*/node", "nodes"),
    ("VRMC_springBone", "springs/*/colliderGroups/*", "extensions/VRMC_springBone/colliderGroups"),
    ("VRMC_node_constraint", "constraint/*/source", "nodes"),
    ("VRMC_vrm_animation", "humanoid/humanBones/*/node", "nodes"),
    ("VRMC_vrm_animation", "expressions/*/*/node", "nodes"),
    ("VRMC_vrm_animation", "lookAt/node", "nodes"),
];

/// The extension in which a negative number means none.
const WITH_NEGATIVE_NUMBERS: &str = "VRM";

/// Returns a line for each kind of reference of which more dangle in a file than in the one that it was made from.
pub(crate) fn new_dangling(json: &Value, source: Option<&Value>) -> Vec<String> {
    let before = source.map(dangling).unwrap_or_default();
    let more = |(kind, all): (String, Vec<String>)| {
        let known = before.get(&kind).map_or(0, Vec::len);
        (all.len() > known).then(|| format!("{} dangling, in the input {known}: {}", all.len(), all[0]))
    };
    dangling(json).into_iter().filter_map(more).collect()
}

/// Returns the references to elements that do not exist: for each path, with `*` for numbers, what is there.
pub(crate) fn dangling(json: &Value) -> BTreeMap<String, Vec<String>> {
    let mut search = Search { json, found: BTreeMap::new() };
    let root = Place { path: String::new(), stars: Vec::new() };
    for (path, list) in CORE {
        search.follow(json, path, list, &root);
    }
    search.extensions(json, &root.path);
    search.found
}

/// A place in the file: the JSON pointer to it, and the keys that stand for the `*` of a path.
#[derive(Clone)]
struct Place {
    path: String,
    stars: Vec<String>,
}

impl Place {
    fn entry(&self, key: &str, is_star: bool) -> Self {
        let key = key.replace('~', "~0").replace('/', "~1");
        let path = format!("{}/{key}", self.path);
        let mut stars = self.stars.clone();
        stars.extend(is_star.then_some(key));
        Self { path, stars }
    }
}

struct Search<'a> {
    json: &'a Value,
    found: BTreeMap<String, Vec<String>>,
}

impl Search<'_> {
    /// Checks the extensions of a value and of all that it contains.
    fn extensions(&mut self, value: &Value, path: &str) {
        let place = |key: &str| Place { path: path.to_owned(), stars: Vec::new() }.entry(key, false);
        match value {
            Value::Array(all) => {
                for (i, value) in all.iter().enumerate() {
                    self.extensions(value, &place(&i.to_string()).path);
                }
            }
            Value::Object(all) => {
                for (name, content) in all.get("extensions").and_then(Value::as_object).into_iter().flatten()
                {
                    let host = place("extensions").entry(name, false);
                    for (_, path, list) in EXTENSIONS.iter().filter(|row| row.0 == name) {
                        self.follow(content, path, list, &host);
                    }
                }
                // What users add is no business of the format.
                for (key, value) in all.iter().filter(|(key, _)| *key != "extras") {
                    self.extensions(value, &place(key).path);
                }
            }
            _ => {}
        }
    }

    /// Checks all references at a path from a value.
    fn follow(&mut self, value: &Value, path: &str, list: &str, at: &Place) {
        if path.is_empty() {
            if !self.names_something(value, list, at) {
                let kind = at.path.split('/').map(|key| if key.parse::<u64>().is_ok() { "*" } else { key });
                let line = format!("{} is {value}", at.path);
                self.found.entry(kind.collect::<Vec<_>>().join("/")).or_default().push(line);
            }
            return;
        }
        let (key, rest) = path.split_once('/').unwrap_or((path, ""));
        match (key.strip_prefix('*'), value) {
            (Some(""), Value::Array(all)) => {
                for (i, value) in all.iter().enumerate() {
                    self.follow(value, rest, list, &at.entry(&i.to_string(), true));
                }
            }
            (Some(end), Value::Object(all)) => {
                for (key, value) in all.iter().filter(|(key, _)| key.ends_with(end)) {
                    self.follow(value, rest, list, &at.entry(key, true));
                }
            }
            (None, Value::Object(all)) => {
                if let Some(value) = all.get(key) {
                    self.follow(value, rest, list, &at.entry(key, false));
                }
            }
            _ => {}
        }
    }

    /// Returns whether a reference names an element; what is neither number nor pointer is no reference.
    fn names_something(&self, value: &Value, list: &str, at: &Place) -> bool {
        if list == POINTER {
            return value.as_str().is_none_or(|pointer| self.resolves(pointer));
        }
        let Value::Number(number) = value else { return true };
        let Some(index) = number.as_u64() else {
            return number.as_i64().is_some()
                && at.path.starts_with(&format!("/extensions/{WITH_NEGATIVE_NUMBERS}/"));
        };
        let count = match list {
            // A missing mesh is found where it is named.
            MORPHS => self.morph_count(at).unwrap_or(usize::MAX),
            HOST => self.length(&format!("/{}", at.path.split('/').nth(1).unwrap_or_default())),
            list => {
                let mut stars = at.stars.iter();
                let keys =
                    list.split('/').map(|key| if key == "*" { stars.next().map_or("", |s| s) } else { key });
                self.length(&format!("/{}", keys.collect::<Vec<_>>().join("/")))
            }
        };
        index < count as u64
    }

    fn length(&self, pointer: &str) -> usize {
        self.json.pointer(pointer).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// Returns the number of morph targets of the mesh that is named beside a number; `None` if there is no such mesh.
    fn morph_count(&self, at: &Place) -> Option<usize> {
        let (bind, _) = at.path.rsplit_once('/')?;
        let bind = self.json.pointer(bind)?;
        let mesh = match bind["node"].as_u64() {
            Some(node) => &self.json.pointer(&format!("/nodes/{node}"))?["mesh"],
            None => &bind["mesh"],
        };
        // A node without a mesh has no morph targets.
        let Some(mesh) = mesh.as_u64() else { return Some(0) };
        let primitives = self.json.pointer(&format!("/meshes/{mesh}/primitives"))?.as_array()?;
        primitives.iter().map(|p| p["targets"].as_array().map_or(0, Vec::len)).max()
    }

    /// Returns whether all that a JSON pointer passes exists. A property at its end need not, since it may have its
    /// default value.
    fn resolves(&self, pointer: &str) -> bool {
        let Some(pointer) = pointer.strip_prefix('/') else { return false };
        let (mut here, mut keys) = (self.json, pointer.split('/'));
        while let Some(key) = keys.next() {
            let key = key.replace("~1", "/").replace("~0", "~");
            let next = match here {
                Value::Array(all) => key.parse().ok().and_then(|i: usize| all.get(i)),
                _ => here.get(&key),
            };
            here = match next {
                Some(next) => next,
                None if !here.is_object() => return false,
                // A node may have the weights of its mesh, and a mesh those of zero.
                None if key == "weights" => return !here["mesh"].is_null() || !here["primitives"].is_null(),
                None => return keys.all(|key| key.parse::<usize>().is_err()),
            };
        }
        true
    }
}
