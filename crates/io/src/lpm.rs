//! LPM, a format of progressive meshes: a base mesh, and all vertex splits that lead to the full mesh. Any
//! prefix of the file that contains the base is a coarser mesh. The format is specified in `docs/lpm.md`.

mod checkpoint;
mod container;
mod file;
mod head;
mod level_mesh;
mod read;
mod step;
mod streams;
mod values;
mod write;

pub(crate) use container::MAGIC;
pub use file::{Lpm, LpmSizes};
pub use read::LpmReader;
pub use write::{write, write_path};

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::{Contents, Loaded};
use crate::options::ReadOptions;

/// Minimum bits of a quantized coordinate. Guessed: fewer give no usable mesh.
pub const MIN_BITS: u8 = 6;
/// Maximum bits of a quantized coordinate: the bits of a single-precision mantissa.
pub const MAX_BITS: u8 = 24;

/// Options for writing a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LpmOptions {
    /// Bits of a coordinate, [`MIN_BITS`] to [`MAX_BITS`]; `None` keeps every bit of every level.
    pub bits: Option<u8>,
    /// True if fits of checkpoints keep every bit too. A file is then two to three times as large, but no
    /// level closer.
    pub exact_fits: bool,
    /// True if the file contains the images of materials.
    pub with_textures: bool,
    /// True if a write-protected file is replaced too.
    pub force: bool,
}

impl Default for LpmOptions {
    fn default() -> Self {
        Self { bits: None, exact_fits: false, with_textures: true, force: false }
    }
}

/// Result of writing a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LpmWritten {
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
    /// Sizes of the parts of the file.
    pub sizes: LpmSizes,
}

/// Reads a file, or a prefix of one.
///
/// # Errors
/// As [`LpmReader::new`] and [`LpmReader::next_chunk`].
pub fn read(from: impl std::io::Read, options: &ReadOptions) -> Result<Lpm, ReadError> {
    LpmReader::new(from, options.limits)?.finish()
}

/// Reads the full mesh, or the finest one that the bytes contain.
pub(crate) fn read_mesh(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let mut reader = LpmReader::new(bytes, options.limits)?;
    reader.read_rest()?;
    let mesh = reader.mesh()?;
    let lpm = reader.into_lpm()?;
    let mut attributes: Vec<String> = Vec::new();
    let layout = &lpm.splits.layout;
    let first = [(layout.has_normals, "normals"), (layout.has_uvs, "uvs"), (layout.has_colors, "colors")];
    attributes.extend(first.into_iter().filter(|x| x.0).map(|x| x.1.to_owned()));
    attributes.extend(layout.further.iter().map(|f| f.0.title().to_owned()));
    let mut contents = Contents { meshes: 1, polygons: mesh.face_count(), attributes, ..Contents::default() };
    (contents.materials, contents.textures) = lpm.regions.counts();
    let mut loaded = Loaded::new(mesh, Format::Lpm, contents, lpm.warnings);
    loaded.regions = lpm.regions;
    Ok(loaded)
}
