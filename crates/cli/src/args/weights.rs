//! Values of `--weight` and `--importance`.

use lodsmith::AttributeWeights;

use super::values::number;

/// An attribute, or else, that `--weight` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AttributeName {
    Normal,
    Uv,
    Color,
    Morph,
    Skin,
    Other,
    Border,
}

impl AttributeName {
    pub(crate) const ALL: [(&str, Self); 7] = [
        ("normal", Self::Normal),
        ("uv", Self::Uv),
        ("color", Self::Color),
        ("morph", Self::Morph),
        ("skin", Self::Skin),
        ("other", Self::Other),
        ("border", Self::Border),
    ];

    pub(super) fn of(self, weights: &mut AttributeWeights) -> &mut f64 {
        match self {
            Self::Normal => &mut weights.normal,
            Self::Uv => &mut weights.uv,
            Self::Color => &mut weights.color,
            Self::Morph => &mut weights.morph,
            Self::Skin => &mut weights.skin,
            Self::Other => &mut weights.other,
            Self::Border => &mut weights.border,
        }
    }
}

/// An attribute of vertices, and how much denser the result is where it is 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Importance {
    pub(crate) name: String,
    pub(crate) strength: f32,
}

/// Parses an attribute and its weight.
pub(super) fn weight(text: &str) -> Result<(AttributeName, f64), String> {
    let wanted = || {
        let names: Vec<_> = AttributeName::ALL.iter().map(|(name, _)| *name).collect();
        format!("a weight is NAME=W with a W of 0 or more; names are {}", names.join(", "))
    };
    let (name, number) = text.split_once('=').ok_or_else(wanted)?;
    let found = AttributeName::ALL.into_iter().find(|(known, _)| *known == name).ok_or_else(wanted)?;
    let weight: f64 = number.parse().map_err(|_| wanted())?;
    if weight.is_finite() && weight >= 0.0 { Ok((found.1, weight)) } else { Err(wanted()) }
}

/// Default density of triangles where an attribute is 1, relative to where it is 0. (Guessed: half as long
/// edges.)
const DEFAULT_STRENGTH: f32 = 4.0;

/// Parses an attribute of importance and its strength.
pub(super) fn importance(text: &str) -> Result<Importance, String> {
    let (name, strength) = match text.rsplit_once('=') {
        None => (text, DEFAULT_STRENGTH),
        Some((name, typed)) => {
            let wanted = "a strength from 0.001 to 1000";
            (
                name,
                number(typed, |x| (1e-3..=1e3).contains(&x), wanted)
                    .map_err(|_| format!("it wants {wanted}"))? as f32,
            )
        }
    };
    if name.is_empty() {
        return Err("it wants the name of an attribute".to_owned());
    }
    Ok(Importance { name: name.to_owned(), strength })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn importance_has_a_strength() {
        let of = |name: &str, strength| Ok(Importance { name: name.to_owned(), strength });
        assert_eq!(importance("quality"), of("quality", DEFAULT_STRENGTH));
        assert_eq!(importance("color.r=9.5"), of("color.r", 9.5));
        for bad in ["", "=2", "a=", "a=b", "a=0", "a=-1", "a=nan", "a=1e9"] {
            assert!(importance(bad).is_err(), "{bad}");
        }
    }
}
