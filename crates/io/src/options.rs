//! Options of reading and writing.

use std::path::PathBuf;
use std::sync::Arc;

use crate::assets::{AssetScope, Assets};
use crate::format::Format;
use crate::gltf::Packing;
use crate::limits::Limits;
use crate::material::{Regions, Textures};

/// Options of reading.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ReadOptions {
    /// The format; `None` detects it from the content.
    pub format: Option<Format>,
    /// Limits on the resources that the file may use.
    pub limits: Limits,
    /// Folder that is searched for the files that the file names (glTF buffers, OBJ material libraries);
    /// `None` reads none of them.
    pub folder: Option<PathBuf>,
    /// The folder that limits which of these files may be read; by default the folder above and its
    /// subfolders.
    pub assets: AssetScope,
    /// Names of vertex properties to return besides the mesh; see
    /// [`Loaded::properties`](crate::Loaded::properties).
    pub properties: Vec<String>,
}

impl ReadOptions {
    /// Returns the assets of a model read with these options; none if the folder is unknown.
    pub(crate) fn files(&self) -> Assets {
        self.folder.as_ref().map_or_else(Assets::default, |folder| Assets::new(folder, &self.assets))
    }
}

/// Options of writing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The format; `None` derives it from the extension of the path.
    pub format: Option<Format>,
    /// Write text instead of binary, for the formats that have both (PLY, STL).
    pub ascii: bool,
    /// The regions of the mesh, as its reader returned them.
    pub regions: Option<Arc<Regions>>,
    /// Treatment of materials and textures, for the formats that keep them in separate files.
    pub textures: Textures,
    /// The path that these files are named after and written beside, if it is not the path of the mesh. A
    /// stream with this option is treated as a file at the path.
    pub beside: Option<PathBuf>,
    /// Packing of glTF and GLB; no other format has it.
    pub packing: Packing,
    /// Also replace a write-protected file.
    pub force: bool,
}
