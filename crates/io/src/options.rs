//! Options of reading and writing.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::assets::{AssetScope, Assets};
use crate::format::Format;
use crate::gltf::pack::Packing;
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
    /// Folder that is searched for the files that the file refers to (glTF buffers, OBJ material libraries);
    /// `None` reads none of them.
    pub folder: Option<PathBuf>,
    /// The folder that limits which of these files may be read; by default the folder above and its
    /// subfolders.
    pub assets: AssetScope,
    /// Names of vertex properties to return besides the mesh; see
    /// [`Loaded::properties`](crate::Loaded::properties).
    pub properties: Vec<String>,
    /// Reports to another thread how much of the file has been read.
    pub progress: SharedProgress,
}

/// Number of records between two updates of the progress: some milliseconds.
pub(crate) const PROGRESS_RECORDS: usize = 1 << 16;

/// How much of a file has been read; clones share it.
#[derive(Clone, Debug, Default)]
pub struct SharedProgress(Arc<[AtomicU64; 2]>);

impl SharedProgress {
    /// Returns the part of the file that has been read, from 0 to 1; `None` if the reader does not count. The readers
    /// of OBJ (files from a megabyte on), PLY and binary STL do.
    pub fn done(&self) -> Option<f64> {
        let [done, whole] = self.0.each_ref().map(|n| n.load(Ordering::Relaxed));
        (whole > 0).then(|| (done as f64 / whole as f64).min(1.0))
    }

    /// Sets the amount that has been read, and the total.
    pub(crate) fn set(&self, done: u64, whole: u64) {
        self.0[0].store(done, Ordering::Relaxed);
        self.0[1].store(whole, Ordering::Relaxed);
    }

    /// Adds to the amount that has been read.
    pub(crate) fn add(&self, more: u64) {
        self.0[0].fetch_add(more, Ordering::Relaxed);
    }
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
