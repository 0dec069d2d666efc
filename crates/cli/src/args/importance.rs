//! Values of `--importance`.

use super::values::number;

/// An attribute of vertices, and how much denser the result is where it is 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Importance {
    pub(crate) name: String,
    pub(crate) strength: f32,
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
