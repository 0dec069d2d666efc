//! Formatting of numbers for people.

pub(crate) use lodsmith::core::numbers::{counted, grouped, significant};
pub(crate) use lodsmith_asset::report_json::micros;

/// Formats with two significant digits, or all digits before the decimal point: `0.017`, `0.17`, `1.7`, `17`, `170`.
pub(crate) fn short(x: f64) -> String {
    significant(x, 2)
}

/// Formats seconds for people: `0.04 s`, `12.3 s`.
pub(crate) fn seconds(secs: f64) -> String {
    if secs < 10.0 { format!("{secs:.2} s") } else { format!("{secs:.1} s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_two_significant_digits() {
        assert_eq!(
            [0.0, 0.0174, 0.168, 1.74, 17.4, 174.0].map(short),
            ["0", "0.017", "0.17", "1.7", "17", "174"].map(String::from)
        );
        assert_eq!(short(2.5e-7), "2.5e-7");
    }
}
