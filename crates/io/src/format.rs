//! The formats that are read and written.

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// Object File Format, with its coloured and normal-carrying kinds.
    Off,
    /// Stanford polygon file.
    Ply,
    /// Stereolithography.
    Stl,
    /// glTF 2.0 as JSON, buffers beside it or inside.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
    /// A progressive mesh; read at its full level.
    Lpm,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::Obj, Self::Off, Self::Ply, Self::Stl, Self::Gltf, Self::Glb, Self::Lpm];
    /// Those that a mesh alone can be written in.
    pub const WRITTEN: [Self; 6] = [Self::Obj, Self::Off, Self::Ply, Self::Stl, Self::Gltf, Self::Glb];

    /// Its name, which is also the usual ending of its files: `obj`, `off`, `ply`, `stl`, `gltf`, `glb`, `lpm`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Off => "off",
            Self::Ply => "ply",
            Self::Stl => "stl",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Lpm => "lpm",
        }
    }

    /// Its name as people write it: `OBJ`, `OFF`, `PLY`, `STL`, `glTF`, `GLB`, `LPM`.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Gltf => "glTF",
            Self::Glb => "GLB",
            Self::Lpm => "LPM",
        }
    }

    /// The format with this name or ending, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name().eq_ignore_ascii_case(name))
    }
}
