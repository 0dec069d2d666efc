//! The supported file formats.

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// Object File Format, with its variants for colours and normals.
    Off,
    /// Stanford polygon file.
    Ply,
    /// Stereolithography.
    Stl,
    /// glTF 2.0 as JSON, with external or embedded buffers.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
    /// A progressive mesh; read at its full level.
    Lpm,
    /// 3D Manufacturing Format.
    ThreeMf,
    /// COLLADA; read only.
    Dae,
    /// FBX; read only, with the feature `fbx`.
    Fbx,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 10] = [
        Self::Obj,
        Self::Off,
        Self::Ply,
        Self::Stl,
        Self::Gltf,
        Self::Glb,
        Self::Lpm,
        Self::ThreeMf,
        Self::Dae,
        Self::Fbx,
    ];
    /// Formats that can hold a mesh alone.
    pub const WRITTEN: [Self; 7] =
        [Self::Obj, Self::Off, Self::Ply, Self::Stl, Self::Gltf, Self::Glb, Self::ThreeMf];

    /// Its name, which is also the usual extension: `obj`, `off`, `ply`, `stl`, `gltf`, `glb`, `lpm`, `3mf`, `dae`, `fbx`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Off => "off",
            Self::Ply => "ply",
            Self::Stl => "stl",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Lpm => "lpm",
            Self::ThreeMf => "3mf",
            Self::Dae => "dae",
            Self::Fbx => "fbx",
        }
    }

    /// Its display name: `OBJ`, `OFF`, `PLY`, `STL`, `glTF`, `GLB`, `LPM`, `3MF`, `COLLADA`, `FBX`.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Gltf => "glTF",
            Self::Glb => "GLB",
            Self::Lpm => "LPM",
            Self::ThreeMf => "3MF",
            Self::Dae => "COLLADA",
            Self::Fbx => "FBX",
        }
    }

    /// Returns true if files of this format are read as whole scenes: nodes, meshes, materials.
    pub const fn is_scene(self) -> bool {
        matches!(self, Self::Gltf | Self::Glb | Self::ThreeMf | Self::Dae | Self::Fbx)
    }

    /// Returns true if whole scenes are written to this format; other formats get all meshes merged into one.
    pub const fn keeps_scenes(self) -> bool {
        matches!(self, Self::Gltf | Self::Glb | Self::ThreeMf)
    }

    /// Returns the format with this name or extension, ignoring case. `vrm`, an avatar, is [`Format::Glb`].
    pub fn from_name(name: &str) -> Option<Self> {
        if name.eq_ignore_ascii_case("vrm") {
            return Some(Self::Glb);
        }
        Self::ALL.into_iter().find(|f| f.name().eq_ignore_ascii_case(name))
    }
}
