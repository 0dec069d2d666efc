//! How files are read and written.

use std::path::PathBuf;
use std::sync::Arc;

use crate::assets::{AssetScope, Assets};
use crate::format::Format;
use crate::limits::Limits;
use crate::material::{Regions, Textures};

/// How to read.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ReadOptions {
    /// The format, where content should not decide.
    pub format: Option<Format>,
    /// What a file may ask of the machine.
    pub limits: Limits,
    /// Folder in which files named by the file are looked for (glTF buffers, libraries of OBJ materials); none are read
    /// where it is `None`.
    pub folder: Option<PathBuf>,
    /// Which of the files named by the file may be read: those in the folder and below, unless this says otherwise.
    pub assets: AssetScope,
    /// Names of properties of vertices that are wanted beside the mesh; see [`Loaded::properties`](crate::Loaded::properties).
    pub properties: Vec<String>,
}

impl ReadOptions {
    /// The files that a model may name which is read like this; none where no folder is known.
    pub(crate) fn files(&self) -> Assets {
        self.folder.as_ref().map_or_else(Assets::default, |folder| Assets::new(folder, &self.assets))
    }
}

/// How to write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// The format, where the ending of the path should not decide.
    pub format: Option<Format>,
    /// Text instead of binary, for the formats that have both (PLY, STL).
    pub ascii: bool,
    /// What the regions of the mesh stand for, as its reader had it.
    pub regions: Option<Arc<Regions>>,
    /// What becomes of materials and textures, for the formats that have them in files of their own.
    pub textures: Textures,
    /// The path that such files are named after and lie beside, where it is not that of the mesh itself. A stream with
    /// one stands for a file there.
    pub beside: Option<PathBuf>,
    /// Whether a write-protected file is replaced too.
    pub force: bool,
}
