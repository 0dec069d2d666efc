//! Values of options with names.

use std::ffi::OsStr;

use lodsmith::{NonManifold, Sheets};
use lodsmith_bake::{AtlasMode, MapKind};
use lodsmith_io::gltf::Compression;
use lodsmith_io::{Format, Textures};

use crate::destination::Up;
use crate::lod::Naming;
use crate::normals::Normals;

/// A choice whose values have names.
pub(super) trait Named: Copy + 'static {
    const ALL: &'static [Self];
    fn name(self) -> &'static str;
}

macro_rules! named {
    ($($choice:ty),+) => {$(
        impl Named for $choice {
            const ALL: &'static [Self] = &<$choice>::ALL;
            fn name(self) -> &'static str {
                <$choice>::name(self)
            }
        }
    )+};
}

named!(AtlasMode, Compression, Format, MapKind, Naming, NonManifold, Normals, Sheets, Textures, Up);
#[cfg(feature = "pictures")]
named!(
    lodsmith::MethodKind,
    lodsmith_render::ColorMap,
    lodsmith_render::Shading,
    lodsmith_render::StandardView
);

/// Returns the names of these values.
pub(super) fn names_of<T: Named>(values: &[T]) -> Vec<&'static str> {
    values.iter().map(|value| value.name()).collect()
}

/// Returns the names of all values of a choice.
pub(super) fn names<T: Named>() -> Vec<&'static str> {
    names_of(T::ALL)
}

/// Returns that of these values which has this name.
pub(super) fn one_of<T: Named>(name: &OsStr, values: &[T]) -> Result<T, String> {
    let found = values.iter().copied().find(|value| name == value.name());
    found.ok_or_else(|| format!("one of {} is expected", names_of(values).join(", ")))
}

/// Name of GLB files that are avatars.
const VRM: &str = "vrm";

/// Returns the names of the formats that can be written, and `vrm`, which is GLB.
pub(super) fn output_names() -> Vec<&'static str> {
    let mut names = names_of(&Format::WRITTEN);
    names.push(VRM);
    names
}

/// Returns the format to write that has this name.
pub(super) fn output_format(name: &OsStr) -> Result<Format, String> {
    let written = || Format::from_name(name.to_str()?).filter(|format| Format::WRITTEN.contains(format));
    written().ok_or_else(|| format!("one of {} is expected", output_names().join(", ")))
}

/// Returns the value with this name.
pub(super) fn word<T: Named>(name: &OsStr) -> Result<T, String> {
    one_of(name, T::ALL)
}

/// Parses a text.
pub(super) fn parsed<T>(word: &OsStr, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, String> {
    parse(word.to_str().ok_or("it is not UTF-8")?)
}

/// Parses a flag.
pub(super) fn flag(word: &OsStr) -> Result<bool, String> {
    parsed(word, |text| text.parse().map_err(|_| "true or false is expected".to_owned()))
}
