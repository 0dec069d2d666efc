//! Materials, for the formats that share them: face regions with their names, material libraries (MTL) and
//! their images.

mod image_sizes;
mod image_type;
mod library;
mod mtl_conversion;
mod packed;
mod regions;
mod textures;

pub(crate) use image_sizes::{bytes_with_mipmaps, size_of, size_of_file};
pub(crate) use image_type::image_type;
pub use library::Library;
pub(crate) use library::{GeneratedLibrary, Image, left_out_warnings, read_libraries};
pub(crate) use mtl_conversion::{ConvertedMaterial, ConvertedMaterials, Purpose, convert_materials};
pub(crate) use regions::{
    FacePosition, FaceProperty, Heading, Headings, counts, drops_materials, join_titles,
};
pub use regions::{Region, Regions};
pub use textures::Textures;
pub(crate) use textures::{SidecarFiles, bytes_of_path, copy_into, names_of, write_sidecar_files};
