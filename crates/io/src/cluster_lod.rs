//! Files of cluster levels, `.lclod`: what they hold and in which order is in `docs/cluster-lod.md`.
//!
//! ```text
//! magic, version, flags
//! sections: tag, length, bytes, checksum
//!     POSI  WEDG?  NORM?  TEXC?  COLR?  ATTR*     what stands at vertices
//!     GRUP  CLUS  LIST                           groups, clusters, and the triangles of each
//!     REGI?  NAME?                               the region of each face, and what regions stand for
//!     DONE
//! ```

mod read;
mod sections;
mod write;

use lodsmith_core::ClusterLod;

pub use read::{read_bytes, read_path};
pub use write::{write_path, write_to};

use crate::obj::Regions;

/// First bytes: a byte that no text has, the name, and line ends that a careless copy would change.
pub const MAGIC: [u8; 8] = *b"\x89LCLOD\r\n";
/// The only version so far.
pub const VERSION: u32 = 1;
/// Usual ending of the files.
pub const ENDING: &str = "lclod";

/// Positions are in double precision.
const DOUBLE: u32 = 1;
/// Bytes of a group: error, centre, radius.
const GROUP: usize = 5 * 8;
/// Bytes of a cluster: counts of faces and wedges, groups below and above, sphere.
const CLUSTER: usize = 2 * 2 + 2 * 4 + 4 * 8;
/// No group.
const NONE: u32 = u32::MAX;

/// What a file of cluster levels holds.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredClusterLod {
    /// The levels.
    pub lod: ClusterLod,
    /// What the regions of the faces stand for, by name: libraries and textures are not in the file.
    pub regions: Regions,
}
