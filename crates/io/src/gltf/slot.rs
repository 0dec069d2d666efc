//! Mapping between attributes of primitives and attributes of meshes.

use std::ops::RangeInclusive;

use lodsmith_core::TriMesh;
use lodsmith_core::mesh::{IntegerType, Morphed, Semantic};

/// Attribute of a mesh that an attribute of a primitive maps to. Custom attributes are [`Semantic::Custom`]
/// here, discrete or not.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Slot {
    Position,
    Normal,
    Uv,
    Color,
    Further(Semantic),
}

impl Slot {
    /// Returns the slot of an attribute, or of its displacement by a morph target.
    pub(super) fn of(target: Option<usize>, name: &str) -> Self {
        if let Some(target) = target {
            let of = match name {
                "POSITION" => Some(Morphed::Position),
                "NORMAL" => Some(Morphed::Normal),
                "TANGENT" => Some(Morphed::Tangent),
                _ => None,
            };
            return Self::Further(match (of, u16::try_from(target)) {
                (Some(of), Ok(target)) => Semantic::Morph { target, of },
                _ => Semantic::Custom(format!("targets[{target}].{name}")),
            });
        }
        // Without leading zeros, so that every name has its own slot.
        let numbered = |prefix: &str| {
            let digits = name.strip_prefix(prefix)?;
            digits.parse::<u8>().ok().filter(|n| n.to_string() == digits)
        };
        match name {
            "POSITION" => Self::Position,
            "NORMAL" => Self::Normal,
            "TEXCOORD_0" => Self::Uv,
            "COLOR_0" => Self::Color,
            "TANGENT" => Self::Further(Semantic::Tangent),
            _ => Self::Further(if let Some(n) = numbered("TEXCOORD_") {
                Semantic::Uv(n)
            } else if let Some(n) = numbered("COLOR_") {
                Semantic::Color(n)
            } else if let Some(n) = numbered("JOINTS_") {
                Semantic::Joints(n)
            } else if let Some(n) = numbered("WEIGHTS_") {
                Semantic::Weights(n)
            } else {
                Semantic::Custom(name.to_owned())
            }),
        }
    }

    /// Returns the glTF name; `None` for morph targets, and for names that glTF does not allow.
    pub(super) fn name(&self) -> Option<String> {
        Some(match self {
            Self::Position => "POSITION".to_owned(),
            Self::Normal => "NORMAL".to_owned(),
            Self::Uv => "TEXCOORD_0".to_owned(),
            Self::Color => "COLOR_0".to_owned(),
            Self::Further(semantic) => match semantic {
                Semantic::Tangent => "TANGENT".to_owned(),
                Semantic::Uv(n) => format!("TEXCOORD_{n}"),
                Semantic::Color(n) => format!("COLOR_{n}"),
                Semantic::Joints(n) => format!("JOINTS_{n}"),
                Semantic::Weights(n) => format!("WEIGHTS_{n}"),
                Semantic::Custom(name) if name.starts_with('_') => name.clone(),
                Semantic::Morph { .. } | Semantic::Custom(_) | Semantic::Discrete { .. } => return None,
            },
        })
    }

    /// Returns the numbers of components that glTF allows.
    pub(super) fn widths(&self) -> RangeInclusive<usize> {
        match self {
            Self::Position | Self::Normal | Self::Further(Semantic::Morph { .. }) => 3..=3,
            Self::Uv | Self::Further(Semantic::Uv(_)) => 2..=2,
            Self::Color | Self::Further(Semantic::Color(_)) => 3..=4,
            Self::Further(Semantic::Tangent | Semantic::Joints(_) | Semantic::Weights(_)) => 4..=4,
            Self::Further(Semantic::Custom(_) | Semantic::Discrete { .. }) => 1..=4,
        }
    }

    pub(super) fn is_uv(&self) -> bool {
        matches!(self, Self::Uv | Self::Further(Semantic::Uv(_)))
    }

    pub(super) fn is_color(&self) -> bool {
        matches!(self, Self::Color | Self::Further(Semantic::Color(_)))
    }

    /// Returns true if integers are always normalized to 0..1 here, whatever the file declares.
    pub(super) fn is_normalized(&self) -> bool {
        self.is_color() || matches!(self, Self::Further(Semantic::Weights(_)))
    }

    /// Returns true if it holds integer ids, whatever their type: feature ids of `EXT_mesh_features`, which
    /// may be floats, and the older batch ids of 3D Tiles.
    pub(super) fn holds_ids(&self) -> bool {
        let Self::Further(Semantic::Custom(name)) = self else { return false };
        name.starts_with("_FEATURE_ID_") || name == "_BATCHID"
    }

    /// Returns the integer type of a mesh's attribute; `None` if it is not discrete.
    pub(super) fn integer(&self, mesh: &TriMesh) -> Option<IntegerType> {
        let all = mesh.further_attributes().iter().filter(|a| Self::of_mesh(&a.semantic) == *self);
        all.filter_map(|a| if let Semantic::Discrete { of, .. } = a.semantic { Some(of) } else { None })
            .next()
    }

    fn of_mesh(semantic: &Semantic) -> Self {
        Self::Further(match semantic {
            Semantic::Discrete { name, .. } => Semantic::Custom(name.clone()),
            other => other.clone(),
        })
    }

    /// Returns the number of components and the values of a mesh; `None` for positions and for attributes it
    /// lacks.
    pub(super) fn values<'m>(&self, mesh: &'m TriMesh) -> Option<(usize, &'m [f32])> {
        match self {
            Self::Position => None,
            Self::Normal => mesh.normals().map(|n| (3, n.as_flattened())),
            Self::Uv => mesh.uvs().map(|t| (2, t.as_flattened())),
            Self::Color => mesh.colors().map(|c| (4, c.as_flattened())),
            Self::Further(_) => {
                let found = mesh.further_attributes().iter().find(|a| Self::of_mesh(&a.semantic) == *self)?;
                Some((found.width, &found.values))
            }
        }
    }

    /// Returns all attributes of a mesh except positions.
    pub(super) fn all_of(mesh: &TriMesh) -> Vec<Self> {
        let own = [
            (mesh.normals().is_some(), Self::Normal),
            (mesh.uvs().is_some(), Self::Uv),
            (mesh.colors().is_some(), Self::Color),
        ];
        let further = mesh.further_attributes().iter().map(|a| Self::of_mesh(&a.semantic));
        own.into_iter().filter(|(is, _)| *is).map(|(_, slot)| slot).chain(further).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_slots_correspond() {
        for name in ["NORMAL", "TEXCOORD_0", "TEXCOORD_12", "COLOR_0", "COLOR_1", "TANGENT", "JOINTS_0", "_A"]
        {
            assert_eq!(Slot::of(None, name).name().as_deref(), Some(name));
        }
        assert_eq!(Slot::of(None, "TEXCOORD_01"), Slot::Further(Semantic::Custom("TEXCOORD_01".to_owned())));
        assert_eq!(Slot::of(None, "WEIGHTS_300"), Slot::Further(Semantic::Custom("WEIGHTS_300".to_owned())));
        let moved = Semantic::Morph { target: 3, of: Morphed::Normal };
        assert_eq!(Slot::of(Some(3), "NORMAL"), Slot::Further(moved));
        let other = Slot::of(Some(3), "COLOR_0");
        assert_eq!(other, Slot::Further(Semantic::Custom("targets[3].COLOR_0".to_owned())));
        assert_eq!(other.name(), None);
    }
}
