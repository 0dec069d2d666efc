//! Baking: the detail of a surface is stored in textures of a lighter surface.
//!
//! [`bake`] takes two models, which may be any: the lighter one is often made from the detailed one by
//! [`lodsmith::simplify`]. It returns the meshes of the lighter model with texture coordinates and tangents, and the
//! maps, as plain values: no files. [`bake_scene`] puts them into the materials of a glTF scene.
//!
//! ```
//! use lodsmith::NoControl;
//! use lodsmith_bake::{BakeOptions, MapKind, bake};
//! use lodsmith_core::{Model, shapes};
//!
//! let (detailed, lighter) = (Model::of_mesh(shapes::icosphere(5)), Model::of_mesh(shapes::icosphere(2)));
//! let mut options = BakeOptions::new([MapKind::Normal]);
//! options.size = Some(128);
//! let baked = bake(&detailed, &lighter, &options, &mut NoControl)?;
//! assert_eq!(baked.sets[0].maps[0].kind, MapKind::Normal);
//! # Ok::<(), lodsmith_bake::BakeError>(())
//! ```

mod atlas;
mod baked;
mod cover;
mod curvature;
mod error;
mod flat;
mod link;
mod maps;
mod normals;
mod occluders;
mod occlusion;
mod options;
mod scene;
mod search;
mod sets;
mod source;
mod tangents;
mod texels;
mod wedges;

pub use baked::{Baked, BakedSet, bake};
pub use error::BakeError;
pub use maps::{BakedMap, Texels};
pub use options::{AtlasMode, BakeOptions, MapKind};
pub use scene::{BakedScene, bake_scene, model_with, set_materials};
pub use search::Found;
pub use wedges::with_tangents;
