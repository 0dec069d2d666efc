//! Names of attributes: `tangents`, `uvs1`, `colors1`, `joints0`, `weights0`, `morph0_positions`, or any other.

use lodsmith_core::Semantic;
use lodsmith_core::mesh::Morphed;

/// Returns the meaning of an attribute from its name in the packages.
pub fn semantic(name: &str) -> Semantic {
    let numbered = |word: &str| name.strip_prefix(word).and_then(|n| n.parse::<u8>().ok());
    if name == "tangents" {
        return Semantic::Tangent;
    }
    if let Some(set) = numbered("uvs").filter(|n| *n > 0) {
        return Semantic::Uv(set);
    }
    if let Some(set) = numbered("colors").filter(|n| *n > 0) {
        return Semantic::Color(set);
    }
    if let Some(set) = numbered("joints") {
        return Semantic::Joints(set);
    }
    if let Some(set) = numbered("weights") {
        return Semantic::Weights(set);
    }
    let morph = name.strip_prefix("morph").and_then(|rest| {
        let (target, of) = rest.split_once('_')?;
        let of = match of {
            "positions" => Morphed::Position,
            "normals" => Morphed::Normal,
            "tangents" => Morphed::Tangent,
            _ => return None,
        };
        Some(Semantic::Morph { target: target.parse().ok()?, of })
    });
    morph.unwrap_or_else(|| Semantic::Custom(name.to_owned()))
}

/// Returns the name of an attribute in the packages.
pub fn name_of(semantic: &Semantic) -> String {
    match semantic {
        Semantic::Tangent => "tangents".to_owned(),
        Semantic::Uv(set) => format!("uvs{set}"),
        Semantic::Color(set) => format!("colors{set}"),
        Semantic::Joints(set) => format!("joints{set}"),
        Semantic::Weights(set) => format!("weights{set}"),
        Semantic::Morph { target, of } => {
            let of = match of {
                Morphed::Position => "positions",
                Morphed::Normal => "normals",
                Morphed::Tangent => "tangents",
            };
            format!("morph{target}_{of}")
        }
        Semantic::Custom(name) | Semantic::Discrete { name, .. } => name.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_a_round_trip() {
        for name in
            ["tangents", "uvs1", "colors2", "joints0", "weights1", "morph3_normals", "heat", "uvs", "morph_x"]
        {
            assert_eq!(name_of(&semantic(name)), name);
        }
        assert_eq!(semantic("uvs1"), Semantic::Uv(1));
        assert_eq!(semantic("uvs0"), Semantic::Custom("uvs0".to_owned()));
    }
}
