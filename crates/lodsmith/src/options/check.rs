//! Checks of option values against their ranges.

use super::by_name::{LengthRange, OPTIONS, OptionKind, OptionValue};
use super::{Length, SimplifyOptions};
use crate::SimplifyError;
use crate::input::MeshData;

impl SimplifyOptions {
    /// Returns an error if a value is out of range, or if the method does not have an option or does not take the data
    /// of the mesh.
    pub(crate) fn check(&self, data: &MeshData<'_>) -> Result<(), SimplifyError> {
        for option in OPTIONS {
            let Some(value) = option.get(self) else { continue };
            if let Some((wanted, got)) = out_of_range(option.kind, &value) {
                return Err(SimplifyError::BadOption { option: option.name, wanted, got });
            }
        }
        if let Some(x) = self.guards.max_valence.filter(|x| *x < 3) {
            return Err(SimplifyError::BadOption {
                option: "max-valence",
                wanted: "at least 3",
                got: x as f64,
            });
        }
        self.check_method(data)
    }
}

/// Returns the range and the number if a value is out of range. (Every count of elements is in range.)
fn out_of_range(kind: OptionKind, value: &OptionValue<'_>) -> Option<(&'static str, f64)> {
    match (kind, value) {
        (OptionKind::Ratio, OptionValue::Number(x)) => {
            (!(*x > 0.0 && *x <= 1.0)).then_some(("above 0 and at most 1", *x))
        }
        (OptionKind::Degrees(range) | OptionKind::Number(range), OptionValue::Number(x)) => {
            (!range.contains(*x)).then_some((range.text, *x))
        }
        (OptionKind::Length(range), OptionValue::Length(Length::Units(x) | Length::OfDiagonal(x))) => {
            let wanted = match range {
                LengthRange::Positive => "a length above 0",
                LengthRange::FromZero | LengthRange::ZeroIsOff => "a length of 0 or more",
            };
            (!range.contains(Length::Units(*x))).then_some((wanted, *x))
        }
        (OptionKind::Weights(_), OptionValue::Weights(all)) => {
            let bad = all.iter().find(|(_, x)| !(x.is_finite() && *x >= 0.0));
            bad.map(|(_, x)| ("0 or more", *x))
        }
        _ => None,
    }
}
