//! How a run on the front of a sheet stores each attribute of its back.

use lodsmith_core::{Attribute, IntegerType, Morphed, Semantic, TriMesh, WedgeId};

/// Largest difference of a component at which the normals of two sides count as opposite. (Guessed: below the
/// resolution of a normal with ten bits.)
const OPPOSITE_TOLERANCE: f32 = 1e-3;
/// Prefix of the names under which named values of the back are stored: no name in a file starts with it.
const BACK_PREFIX: &str = "\u{f8ff}back:";
/// Name under which the signs of the tangents of the back are stored.
const TANGENT_SIGN: &str = "\u{f8ff}tangent";

/// Source of the values of an attribute at the back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum BackValues {
    /// They equal the values of the front.
    Same,
    /// They are the opposite: all components of a vector, the sign of a tangent.
    Opposite,
    /// They are stored as a further attribute; the sign of a tangent as another one.
    Own(Semantic),
}

/// The plan for all attributes of a mesh; `None` for attributes that it does not have.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Plan {
    pub(super) normals: Option<BackValues>,
    pub(super) uvs: Option<BackValues>,
    pub(super) colors: Option<BackValues>,
    /// For each further attribute of the mesh.
    pub(super) further: Vec<BackValues>,
}

impl Plan {
    /// Makes the plan of a mesh whose front and back wedges are `corners`.
    pub(super) fn new(mesh: &TriMesh, corners: &[[WedgeId; 2]]) -> Self {
        let further = mesh.further_attributes();
        let next = |of: fn(&Semantic) -> Option<usize>| {
            further.iter().filter_map(|a| of(&a.semantic)).max().unwrap_or(0) + 1
        };
        let uv = next(|s| if let Semantic::Uv(set) = s { Some(usize::from(*set)) } else { None });
        let color = next(|s| if let Semantic::Color(set) = s { Some(usize::from(*set)) } else { None });
        let target =
            next(|s| if let Semantic::Morph { target, .. } = s { Some(usize::from(*target)) } else { None });
        // (Beyond 255 sets, none is free: values of such a set are taken from the front.)
        let own_uv = |set: usize| u8::try_from(uv + set).map(Semantic::Uv).ok();
        let own_color = |set: usize| u8::try_from(color + set).map(Semantic::Color).ok();
        let own_morph = |number: usize, of: Morphed| {
            u16::try_from(target + number).map(|target| Semantic::Morph { target, of }).ok()
        };
        let own = |semantic: &Semantic| match semantic {
            Semantic::Tangent => own_morph(0, Morphed::Tangent),
            Semantic::Uv(set) => own_uv(usize::from(*set)),
            Semantic::Color(set) => own_color(usize::from(*set)),
            Semantic::Morph { target, of } => own_morph(1 + usize::from(*target), *of),
            Semantic::Custom(name) => Some(Semantic::Custom(format!("{BACK_PREFIX}{name}"))),
            Semantic::Discrete { name, of } => {
                Some(Semantic::Discrete { name: format!("{BACK_PREFIX}{name}"), of: *of })
            }
            // Sides with different joints are not paired.
            Semantic::Joints(_) | Semantic::Weights(_) => None,
        };
        let chosen = |relation: Relation, own: Option<Semantic>| match (relation, own) {
            (Relation::Same, _) | (Relation::Differs, None) => BackValues::Same,
            (Relation::Opposite, _) => BackValues::Opposite,
            (Relation::Differs, Some(semantic)) => BackValues::Own(semantic),
        };
        let of_further = |a: &Attribute| {
            let signs: &[f32] = match a.semantic {
                Semantic::Tangent => &[1.0, 1.0, 1.0, -1.0],
                Semantic::Morph { of: Morphed::Normal, .. } => &[-1.0; 3],
                _ => &[],
            };
            chosen(relation(&a.values, a.width, signs, corners), own(&a.semantic))
        };
        Self {
            normals: mesh.normals().map(|n| {
                chosen(relation(n.as_flattened(), 3, &[-1.0; 3], corners), own_morph(0, Morphed::Normal))
            }),
            uvs: mesh.uvs().map(|t| chosen(relation(t.as_flattened(), 2, &[], corners), own_uv(0))),
            colors: mesh.colors().map(|c| chosen(relation(c.as_flattened(), 4, &[], corners), own_color(0))),
            further: further.iter().map(of_further).collect(),
        }
    }

    /// True if the back has the values of the front throughout.
    pub(super) fn is_same(&self) -> bool {
        [&self.normals, &self.uvs, &self.colors]
            .into_iter()
            .flatten()
            .chain(&self.further)
            .all(|values| *values == BackValues::Same)
    }
}

/// The attribute that stores the signs of the tangents of the back.
pub(super) fn tangent_sign() -> Semantic {
    Semantic::Discrete { name: TANGENT_SIGN.to_owned(), of: IntegerType::I8 }
}

/// Relation of the values of the two sides.
enum Relation {
    Same,
    Opposite,
    Differs,
}

/// Compares the values at both wedges of each corner; `signs` turn a value into its opposite, if it has one.
fn relation(values: &[f32], width: usize, signs: &[f32], corners: &[[WedgeId; 2]]) -> Relation {
    let of = |w: WedgeId| &values[w.index() * width..][..width];
    let is_same = |[front, back]: &[WedgeId; 2]| {
        front == back || of(*front).iter().zip(of(*back)).all(|(a, b)| a.to_bits() == b.to_bits())
    };
    if corners.iter().all(is_same) {
        return Relation::Same;
    }
    let is_opposite = |[front, back]: &[WedgeId; 2]| {
        let pairs = of(*front).iter().zip(of(*back)).zip(signs);
        pairs.into_iter().all(|((a, b), sign)| (a * sign - b).abs() <= OPPOSITE_TOLERANCE)
    };
    if signs.len() == width && corners.iter().all(is_opposite) {
        return Relation::Opposite;
    }
    Relation::Differs
}
