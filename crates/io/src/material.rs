//! Materials, for the formats that share them: face regions with their names, material libraries (MTL) and
//! their images.

mod image_sizes;
mod image_type;
mod library;
mod looks;
mod packed;
mod regions;
mod textures;

pub(crate) use image_type::image_type;
pub use library::Library;
pub(crate) use library::{Image, Made, look_up};
pub(crate) use looks::{Look, Looks, Purpose, looks};
pub(crate) use regions::{Heading, Headings, Place, counts, drops_materials, listed};
pub use regions::{Region, Regions};
pub use textures::Textures;
pub(crate) use textures::{names_of, write_beside};
