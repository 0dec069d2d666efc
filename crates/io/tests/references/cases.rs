//! Extensions with references by name: what the tests put into a scene, and where.

use serde_json::{Value, json};

/// An extension of an element. In its contents `@list/name` stands for the number of an element of this name, and in a
/// JSON pointer, which begins with `/`, for that number as text.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// The element that has it, and the content; more than one for extensions that belong together.
    pub(crate) parts: Vec<(&'static str, Value)>,
    /// The jobs that lose some or all of it: see [`Job`](super::Job).
    pub(crate) lost_in: &'static str,
}

fn case(name: &'static str, lost_in: &'static str, host: &'static str, content: Value) -> Case {
    Case { name, parts: vec![(host, content)], lost_in }
}

/// Returns all cases.
pub(crate) fn all() -> Vec<Case> {
    let texture = |keys: &[&str]| {
        let all =
            keys.iter().map(|key| ((*key).to_owned(), json!({"index": "@textures/coat", "texCoord": 1})));
        Value::Object(all.collect())
    };
    let material = |name, keys: &[&str]| case(name, "", "materials/other", texture(keys));
    let mut all = vec![
        material("KHR_materials_anisotropy", &["anisotropyTexture"]),
        material(
            "KHR_materials_clearcoat",
            &["clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"],
        ),
        material(
            "KHR_materials_diffuse_transmission",
            &["diffuseTransmissionTexture", "diffuseTransmissionColorTexture"],
        ),
        case("KHR_materials_dispersion", "", "materials/other", json!({"dispersion": 1})),
        case("KHR_materials_emissive_strength", "", "materials/other", json!({"emissiveStrength": 2})),
        case("KHR_materials_ior", "", "materials/other", json!({"ior": 1.5})),
        material("KHR_materials_iridescence", &["iridescenceTexture", "iridescenceThicknessTexture"]),
        material("KHR_materials_pbrSpecularGlossiness", &["diffuseTexture", "specularGlossinessTexture"]),
        material("KHR_materials_sheen", &["sheenColorTexture", "sheenRoughnessTexture"]),
        material("KHR_materials_specular", &["specularTexture", "specularColorTexture"]),
        material("KHR_materials_transmission", &["transmissionTexture"]),
        case("KHR_materials_unlit", "", "materials/other", json!({})),
        material("KHR_materials_volume", &["thicknessTexture"]),
        material(
            "VRMC_materials_mtoon",
            &[
                "shadeMultiplyTexture",
                "matcapTexture",
                "outlineWidthMultiplyTexture",
                "uvAnimationMaskTexture",
            ],
        ),
        material("MSFT_packing_normalRoughnessMetallic", &["normalRoughnessMetallicTexture"]),
        case("MOZ_lightmap", "", "materials/other", json!({"index": "@textures/coat", "intensity": 1})),
        case("MSFT_lod of materials", "", "materials/other", json!({"ids": ["@materials/odd"]})),
    ];
    for name in ["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"] {
        all.push(case(name, "", "textures/coat", json!({"source": "@images/picture"})));
    }
    all.extend(scenes());
    all.extend(meshes());
    all.extend(avatars());
    all
}

/// Extensions of nodes, scenes and animations.
fn scenes() -> Vec<Case> {
    let pointer = |name, lost_in, pointer: &str| case(name, lost_in, "channel", json!({"pointer": pointer}));
    vec![
        case("KHR_lights_punctual", "", "nodes/bone", json!({"light": 0})),
        case("KHR_node_visibility", "", "nodes/bone", json!({"visible": true})),
        case("KHR_node_hoverability", "", "nodes/bone", json!({"hoverable": true})),
        case("KHR_node_selectability", "", "nodes/bone", json!({"selectable": true})),
        case("KHR_xmp_json_ld", "", "root", json!({"packets": [{"dc:count": 1}]})),
        case(
            "EXT_lights_image_based",
            "",
            "root",
            json!({"lights": [{"specularImages": [["@images/picture"]]}]}),
        ),
        case("EXT_lights_ies", "", "root", json!({"lights": [{"bufferView": "@bufferViews/table"}]})),
        case("KHR_audio_emitter", "", "root", json!({"audio": [{"bufferView": "@bufferViews/table"}]})),
        case(
            "EXT_mesh_gpu_instancing",
            "",
            "nodes/third",
            json!({"attributes": {"TRANSLATION": "@accessors/places", "_ID": "@accessors/ids"}}),
        ),
        case("EXT_instance_features", "", "nodes/third", json!({"featureIds": [{"featureCount": 2}]})),
        case("MSFT_lod", "", "nodes/third", json!({"ids": ["@nodes/far"]})),
        case("OMI_vehicle_body", "", "nodes/bone", json!({"pilotSeat": "@nodes/tip"})),
        case(
            "OMI_environment_sky",
            "",
            "root",
            json!({"skies": [{"panorama": {"cubemap": ["@textures/coat"], "equirectangular": "@textures/coat"}}]}),
        ),
        case("OMI_physics_body", "", "nodes/bone", json!({"trigger": {"nodes": ["@nodes/tip"]}})),
        Case {
            name: "OMI_physics_shape",
            parts: vec![(
                "root",
                json!({"shapes": [{"type": "trimesh", "trimesh": {"mesh": "@meshes/third"}}]}),
            )],
            lost_in: "",
        },
        case(
            "OMI_physics_shape of the gone mesh",
            "s",
            "root",
            json!({"shapes": [{"trimesh": {"mesh": "@meshes/gone"}}]}),
        ),
        case(
            "KHR_physics_rigid_bodies",
            "",
            "nodes/bone",
            json!({"collider": {"geometry": {"node": "@nodes/third"}}, "joint": {"connectedNode": "@nodes/tip", "joint": 0}}),
        ),
        case(
            "AGI_articulations",
            "",
            "nodes/bone",
            json!({"articulationName": "arm", "isAttachPoint": true}),
        ),
        case(
            "VRMC_node_constraint",
            "",
            "nodes/bone",
            json!({"constraint": {"roll": {"source": "@nodes/main"}}}),
        ),
        pointer("KHR_animation_pointer at a node", "", "/nodes/@nodes/main/translation"),
        pointer("KHR_animation_pointer at morphs of a node", "", "/nodes/@nodes/main/weights"),
        pointer("KHR_animation_pointer at morphs of a mesh", "", "/meshes/@meshes/main/weights/0"),
        pointer("KHR_animation_pointer at the gone mesh", "s", "/meshes/@meshes/gone/weights/0"),
        pointer("KHR_animation_pointer at a material", "", "/materials/@materials/other/alphaCutoff"),
        pointer("KHR_animation_pointer at the baked material", "b", "/materials/@materials/main/alphaCutoff"),
    ]
}

/// Extensions of meshes and primitives, and of the data that they refer to.
fn meshes() -> Vec<Case> {
    vec![
        case(
            "KHR_materials_variants",
            "b",
            "primitive",
            json!({"mappings": [{"material": "@materials/odd", "variants": [0]}]}),
        ),
        case(
            "EXT_mesh_features",
            "",
            "primitive",
            json!({"featureIds": [{"featureCount": 9, "attribute": 0, "propertyTable": 0}]}),
        ),
        case(
            "EXT_mesh_features by a texture",
            "b",
            "primitive",
            json!({"featureIds": [{"featureCount": 9, "texture": {"index": "@textures/coat", "channels": [0]}}]}),
        ),
        case("EXT_mesh_features by vertex", "sl", "primitive", json!({"featureIds": [{"featureCount": 9}]})),
        Case {
            name: "EXT_structural_metadata",
            parts: vec![
                (
                    "root",
                    json!({
                        "propertyTables": [{"count": 9, "properties": {"a": {
                            "values": "@bufferViews/table", "stringOffsets": "@bufferViews/offsets"}}}],
                        "propertyTextures": [{"properties": {"b": {"index": "@textures/coat", "channels": [0]}}}],
                        "propertyAttributes": [{"properties": {"c": {"attribute": "_HEAT"}}}],
                    }),
                ),
                ("primitive", json!({"propertyAttributes": [0]})),
            ],
            lost_in: "",
        },
        case("CESIUM_primitive_outline", "sl", "primitive", json!({"indices": "@accessors/edges"})),
        case(
            "EXT_mesh_manifold",
            "sl",
            "mesh",
            json!({"manifoldPrimitive": {
                "indices": "@accessors/triangles", "attributes": {"POSITION": "@accessors/positions"}}}),
        ),
        case(
            "EXT_mesh_primitive_edge_visibility",
            "sl",
            "primitive",
            json!({"visibility": "@accessors/edges", "material": "@materials/odd"}),
        ),
        // Nobody knows what these mean.
        case("ACME_named", "smqb", "root", json!({"thing": [{"any": "@nodes/gone"}]})),
        case("ACME_pointer", "smqb", "root", json!({"target": "/nodes/@nodes/gone/translation"})),
        case("ACME_of_vertices", "sl", "primitive", json!({"values": [1000000]})),
        case("ACME_flag", "", "primitive", json!({"on": true, "label": "x", "share": 0.5})),
        case("ACME_far", "", "root", json!({"version": "1.0", "id": 1000000})),
        case("KHR_interactivity", "smqb", "root", json!({"graphs": [{"nodes": [{"value": [0]}]}]})),
    ]
}

/// Extensions of avatars.
fn avatars() -> Vec<Case> {
    let binds = |mesh: &str| json!({"binds": [{"mesh": mesh, "index": 0, "weight": 100}]});
    vec![
        case(
            "VRM",
            "",
            "root",
            json!({
                "meta": {"texture": "@textures/coat"},
                "humanoid": {"humanBones": [{"bone": "head", "node": "@nodes/main"}]},
                "firstPerson": {"firstPersonBone": "@nodes/bone", "meshAnnotations": [{"mesh": "@meshes/third"}]},
                "blendShapeMaster": {"blendShapeGroups": [binds("@meshes/main")]},
                "secondaryAnimation": {
                    "boneGroups": [{"center": -1, "bones": ["@nodes/bone", "@nodes/tip"]}],
                    "colliderGroups": [{"node": "@nodes/tip"}],
                },
            }),
        ),
        case(
            "VRM with the gone mesh",
            "s",
            "root",
            json!({"blendShapeMaster": {"blendShapeGroups": [binds("@meshes/gone"), binds("@meshes/main")]}}),
        ),
        case(
            "VRMC_vrm",
            "",
            "root",
            json!({
                "meta": {"thumbnailImage": "@images/picture"},
                "humanoid": {"humanBones": {"hips": {"node": "@nodes/main"}, "head": {"node": "@nodes/bone"}}},
                "firstPerson": {"meshAnnotations": [{"node": "=nodes/main"}]},
                "expressions": {"preset": {"aa": {
                    "morphTargetBinds": [{"node": "=nodes/main", "index": 0}],
                    "materialColorBinds": [{"material": "@materials/other"}],
                }}},
            }),
        ),
        case(
            "VRMC_vrm with the gone mesh",
            "s",
            "root",
            json!({"firstPerson": {"meshAnnotations": [{"node": "=nodes/gone"}, {"node": "=nodes/third"}]}}),
        ),
        case(
            "VRMC_vrm with the baked material",
            "b",
            "root",
            json!({"expressions": {"custom": {"a": {
                "materialColorBinds": [{"material": "@materials/main"}, {"material": "@materials/other"}]}}}}),
        ),
        case(
            "VRMC_springBone",
            "",
            "root",
            json!({
                "colliders": [{"node": "@nodes/bone"}],
                "springs": [{"center": "@nodes/tip", "joints": [{"node": "@nodes/bone"}, {"node": "@nodes/tip"}]}],
            }),
        ),
        case(
            "VRMC_vrm_animation",
            "",
            "root",
            json!({"humanoid": {"humanBones": {"hips": {"node": "@nodes/bone"}}}}),
        ),
    ]
}
