//! Baked maps of a result.

use lodsmith_asset::{Asset, Edit};
use lodsmith_core::Image;

use crate::settings::bake::BakeSettings;

/// The maps of a result, and the scene that it is written as.
pub struct BakedMaps {
    /// The settings that they were made with.
    pub settings: BakeSettings,
    /// The maps.
    pub maps: Vec<NamedMap>,
    /// Time to bake in seconds.
    pub seconds: f64,
    /// The scene that is written.
    pub(crate) asset: Asset,
    /// Its new meshes and materials.
    pub(crate) edit: Edit,
}

impl std::fmt::Debug for BakedMaps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BakedMaps").field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// A map with its name.
pub struct NamedMap {
    /// The kind of the map, after the name of the material if there are several.
    pub name: String,
    /// Its texels.
    pub image: Image,
}
