//! The table of the extensions that are understood: what each refers to, and what becomes of it when a mesh changes.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::kind::ReferenceKind::{
    self, Accessor, Child, Image, Material, Mesh, MeshNode, Node, Pointer, ShapeMesh, ShapeNode, Texture,
    View,
};

/// An extension that is understood: all that it refers to is in its list of references.
pub(in super::super) struct KnownExtension {
    pub(in super::super) name: &'static str,
    /// Paths from the extension's object to its references.
    ///
    /// A segment is a key, `*` for every entry of a list or an object, or `+` for every entry of a list whose entries
    /// are removed when what they name is removed, and repeated for the levels of what they name. A path that only
    /// holds in one list of the file begins with its name: `nodes:ids/*`.
    pub(super) references: &'static [(&'static str, ReferenceKind)],
    /// True if it describes vertices or triangles of its mesh or primitive by their order.
    pub(in super::super) is_of_vertices: bool,
    /// Extensions with numbers of entries of its lists, which go with it.
    pub(in super::super) users: &'static [&'static str],
}

/// An extension with these references.
const fn with(name: &'static str, references: &'static [(&'static str, ReferenceKind)]) -> KnownExtension {
    KnownExtension { name, references, is_of_vertices: false, users: &[] }
}

/// An extension that refers to nothing but the entries of lists of extensions, which never change their numbers.
const fn plain(name: &'static str) -> KnownExtension {
    with(name, &[])
}

/// An extension of a mesh or a primitive that describes its vertices or triangles.
const fn of_vertices(
    name: &'static str,
    references: &'static [(&'static str, ReferenceKind)],
) -> KnownExtension {
    KnownExtension { is_of_vertices: true, ..with(name, references) }
}

/// Extension of nodes that places a mesh several times.
pub(in super::super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// Extension of nodes with attributes of their instances.
const INSTANCE_FEATURES: &str = "EXT_instance_features";
/// Extensions of nodes that belong to the mesh of the node, and move with it.
pub(in super::super) const OF_INSTANCES: [&str; 2] = [INSTANCING, INSTANCE_FEATURES];
/// Features of vertices, by attributes or textures.
pub(in super::super) const MESH_FEATURES: &str = "EXT_mesh_features";
pub(in super::super) const METADATA: &str = "EXT_structural_metadata";
pub(in super::super) const VARIANTS: &str = "KHR_materials_variants";
pub(in super::super) const POINTERS: &str = "KHR_animation_pointer";
/// Avatars before version 1.
pub(in super::super) const VRM_0: &str = "VRM";

/// References of the core of glTF, by paths from the root of the file. (Targets of animations are not among them: which
/// kind they are depends on their path.)
pub(super) const CORE: &[(&str, ReferenceKind)] = &[
    ("meshes/*/primitives/*/attributes/*", Accessor),
    ("meshes/*/primitives/*/indices", Accessor),
    ("meshes/*/primitives/*/targets/*/*", Accessor),
    ("meshes/*/primitives/*/material", Material),
    ("animations/*/samplers/*/input", Accessor),
    ("animations/*/samplers/*/output", Accessor),
    ("skins/*/inverseBindMatrices", Accessor),
    ("skins/*/joints/*", Node),
    ("skins/*/skeleton", Node),
    ("accessors/*/bufferView", View),
    ("accessors/*/sparse/indices/bufferView", View),
    ("accessors/*/sparse/values/bufferView", View),
    ("images/*/bufferView", View),
    ("textures/*/source", Image),
    ("textures/*/sampler", ReferenceKind::Sampler),
    ("materials/*/pbrMetallicRoughness/baseColorTexture/index", Texture),
    ("materials/*/pbrMetallicRoughness/metallicRoughnessTexture/index", Texture),
    ("materials/*/normalTexture/index", Texture),
    ("materials/*/occlusionTexture/index", Texture),
    ("materials/*/emissiveTexture/index", Texture),
    ("nodes/*/mesh", Mesh),
    ("nodes/*/children/*", Child),
    ("scenes/*/nodes/*", Child),
];

/// Every extension that is understood. Those that are not in this table are opaque: see
/// [`Renumbering`](super::super::renumber::Renumbering).
const TABLE: &[KnownExtension] = &[
    // Materials.
    with("KHR_materials_anisotropy", &[("anisotropyTexture/index", Texture)]),
    with(
        "KHR_materials_clearcoat",
        &[
            ("clearcoatTexture/index", Texture),
            ("clearcoatRoughnessTexture/index", Texture),
            ("clearcoatNormalTexture/index", Texture),
        ],
    ),
    with(
        "KHR_materials_diffuse_transmission",
        &[("diffuseTransmissionTexture/index", Texture), ("diffuseTransmissionColorTexture/index", Texture)],
    ),
    plain("KHR_materials_dispersion"),
    plain("KHR_materials_emissive_strength"),
    plain("KHR_materials_ior"),
    with(
        "KHR_materials_iridescence",
        &[("iridescenceTexture/index", Texture), ("iridescenceThicknessTexture/index", Texture)],
    ),
    with(
        "KHR_materials_pbrSpecularGlossiness",
        &[("diffuseTexture/index", Texture), ("specularGlossinessTexture/index", Texture)],
    ),
    with(
        "KHR_materials_sheen",
        &[("sheenColorTexture/index", Texture), ("sheenRoughnessTexture/index", Texture)],
    ),
    with(
        "KHR_materials_specular",
        &[("specularTexture/index", Texture), ("specularColorTexture/index", Texture)],
    ),
    with("KHR_materials_transmission", &[("transmissionTexture/index", Texture)]),
    plain("KHR_materials_unlit"),
    with(VARIANTS, &[("mappings/*/material", Material)]),
    with("KHR_materials_volume", &[("thicknessTexture/index", Texture)]),
    with("ADOBE_materials_clearcoat_specular", &[("clearcoatSpecularTexture/index", Texture)]),
    with("ADOBE_materials_clearcoat_tint", &[("clearcoatTintTexture/index", Texture)]),
    with("ADOBE_materials_thin_transparency", &[("transmissionTexture/index", Texture)]),
    plain("BENTLEY_materials_planar_fill"),
    plain("BENTLEY_materials_point_style"),
    plain("BENTLEY_materials_line_style"),
    with("MSFT_packing_normalRoughnessMetallic", &[("normalRoughnessMetallicTexture/index", Texture)]),
    with(
        "MSFT_packing_occlusionRoughnessMetallic",
        &[
            ("occlusionRoughnessMetallicTexture/index", Texture),
            ("roughnessMetallicOcclusionTexture/index", Texture),
            ("normalTexture/index", Texture),
        ],
    ),
    with("MOZ_lightmap", &[("index", Texture)]),
    plain("VRMC_materials_hdr_emissiveMultiplier"),
    with(
        "VRMC_materials_mtoon",
        &[
            ("shadeMultiplyTexture/index", Texture),
            ("shadingShiftTexture/index", Texture),
            ("matcapTexture/index", Texture),
            ("rimMultiplyTexture/index", Texture),
            ("outlineWidthMultiplyTexture/index", Texture),
            ("uvAnimationMaskTexture/index", Texture),
        ],
    ),
    // Textures.
    with("EXT_texture_avif", &[("source", Image)]),
    with("EXT_texture_webp", &[("source", Image)]),
    with("KHR_texture_basisu", &[("source", Image)]),
    plain("KHR_texture_transform"),
    with("MSFT_texture_dds", &[("source", Image)]),
    // Storage of geometry.
    plain("KHR_mesh_quantization"),
    with("KHR_draco_mesh_compression", &[("bufferView", View)]),
    plain("EXT_meshopt_compression"),
    plain("KHR_meshopt_compression"),
    // Meshes and primitives.
    of_vertices("CESIUM_primitive_outline", &[("indices", Accessor)]),
    with(
        "EXT_feature_metadata",
        &[
            ("featureTables/*/properties/*/bufferView", View),
            ("featureTables/*/properties/*/arrayOffsetBufferView", View),
            ("featureTables/*/properties/*/stringOffsetBufferView", View),
            ("featureTextures/*/properties/*/texture/index", Texture),
            ("featureIdTextures/*/featureIds/texture/index", Texture),
        ],
    ),
    with(MESH_FEATURES, &[("featureIds/*/texture/index", Texture)]),
    of_vertices(
        "EXT_mesh_manifold",
        &[
            ("manifoldPrimitive/indices", Accessor),
            ("manifoldPrimitive/attributes/*", Accessor),
            ("mergeIndices", Accessor),
            ("mergeValues", Accessor),
        ],
    ),
    of_vertices(
        "EXT_mesh_primitive_edge_visibility",
        &[
            ("visibility", Accessor),
            ("silhouetteNormals", Accessor),
            ("material", Material),
            ("lineStrings/*/indices", Accessor),
            ("lineStrings/*/material", Material),
        ],
    ),
    with(
        METADATA,
        &[
            ("propertyTables/*/properties/*/values", View),
            ("propertyTables/*/properties/*/arrayOffsets", View),
            ("propertyTables/*/properties/*/stringOffsets", View),
            ("root:propertyTextures/*/properties/*/index", Texture),
        ],
    ),
    of_vertices("FB_ngon_encoding", &[]),
    // Nodes and scenes.
    plain("AGI_articulations"),
    plain("AGI_stk_metadata"),
    plain("CESIUM_RTC"),
    plain(INSTANCE_FEATURES),
    with("EXT_lights_ies", &[("lights/*/bufferView", View)]),
    with("EXT_lights_image_based", &[("lights/*/specularImages/*/*", Image)]),
    with(INSTANCING, &[("attributes/*", Accessor)]),
    plain("GODOT_single_root"),
    plain("KHR_lights_punctual"),
    plain("KHR_node_hoverability"),
    plain("KHR_node_selectability"),
    plain("KHR_node_visibility"),
    with("MSFT_lod", &[("nodes:ids/*", Child), ("materials:ids/*", Material)]),
    with(
        "OMI_environment_sky",
        &[("skies/*/panorama/cubemap/*", Texture), ("skies/*/panorama/equirectangular", Texture)],
    ),
    plain("OMI_link"),
    plain("OMI_personality"),
    plain("OMI_spawn_point"),
    plain("OMI_seat"),
    with("OMI_vehicle_body", &[("pilotSeat", Node)]),
    plain("OMI_vehicle_hover_thruster"),
    plain("OMI_vehicle_thruster"),
    plain("OMI_vehicle_wheel"),
    // Sound.
    with("KHR_audio_emitter", &[("audio/*/bufferView", View)]),
    with("OMI_audio_emitter", &[("audio/*/bufferView", View)]),
    with("MSFT_audio_emitter", &[("clips/*/bufferView", View)]),
    // Physics.
    plain("KHR_implicit_shapes"),
    with(
        "KHR_physics_rigid_bodies",
        &[
            ("collider/geometry/node", ShapeNode),
            ("collider/geometry/mesh", ShapeMesh),
            ("trigger/geometry/node", ShapeNode),
            ("trigger/geometry/mesh", ShapeMesh),
            ("trigger/nodes/*", Node),
            ("joint/connectedNode", Node),
        ],
    ),
    with("OMI_collider", &[("mesh", ShapeMesh), ("colliders/*/mesh", ShapeMesh)]),
    with("OMI_physics_body", &[("trigger/nodes/*", Node)]),
    plain("OMI_physics_gravity"),
    with("OMI_physics_joint", &[("connectedNode", Node), ("nodeA", Node), ("nodeB", Node)]),
    KnownExtension {
        users: &["OMI_physics_body"],
        ..with(
            "OMI_physics_shape",
            &[("shapes/*/convex/mesh", ShapeMesh), ("shapes/*/trimesh/mesh", ShapeMesh)],
        )
    },
    // Animations and metadata.
    with(POINTERS, &[("pointer", Pointer)]),
    plain("KHR_xmp"),
    plain("KHR_xmp_json_ld"),
    // Avatars.
    with(
        VRM_0,
        &[
            ("meta/texture", Texture),
            ("humanoid/humanBones/*/node", Node),
            ("firstPerson/firstPersonBone", Node),
            ("firstPerson/meshAnnotations/+/mesh", Mesh),
            ("blendShapeMaster/blendShapeGroups/*/binds/+/mesh", Mesh),
            ("secondaryAnimation/boneGroups/*/center", Node),
            ("secondaryAnimation/boneGroups/*/bones/*", Node),
            ("secondaryAnimation/colliderGroups/*/node", Node),
            ("materialProperties/*/textureProperties/*", Texture),
        ],
    ),
    with(
        "VRMC_vrm",
        &[
            ("meta/thumbnailImage", Image),
            ("humanoid/humanBones/*/node", Node),
            ("firstPerson/meshAnnotations/+/node", MeshNode),
            ("expressions/*/*/morphTargetBinds/+/node", MeshNode),
            ("expressions/*/*/materialColorBinds/+/material", Material),
            ("expressions/*/*/textureTransformBinds/+/material", Material),
        ],
    ),
    with(
        "VRMC_springBone",
        &[("colliders/*/node", Node), ("springs/*/joints/*/node", Node), ("springs/*/center", Node)],
    ),
    plain("VRMC_springBone_extended_collider"),
    with("VRMC_node_constraint", &[("constraint/*/source", Node)]),
    with(
        "VRMC_vrm_animation",
        &[("humanoid/humanBones/*/node", Node), ("expressions/*/*/node", Node), ("lookAt/node", Node)],
    ),
];

/// Returns what is known about an extension.
pub(in super::super) fn known(name: &str) -> Option<&'static KnownExtension> {
    static BY_NAME: LazyLock<HashMap<&str, &KnownExtension>> =
        LazyLock::new(|| TABLE.iter().map(|known| (known.name, known)).collect());
    BY_NAME.get(name).copied()
}
