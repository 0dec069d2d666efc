//! Number formatting for display.

/// Formats a count with thousands separators: `69,451`.
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Formats a count with its noun: `1 face`, `2,000 faces`.
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(count), if count == 1 { one } else { many })
}

/// Formats a number with `digits` significant digits, at least one; digits before the point are never
/// dropped: `0.017`, `1.7`, `170`. Very small and very large numbers have an exponent.
pub fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    // Below this, leading zeros are harder to read than an exponent.
    if !x.is_finite() || x.abs() < 1e-4 || x.abs() >= 1e15 {
        return format!("{x:.*e}", digits.saturating_sub(1));
    }
    let decimals = digits as i32 - 1 - libm::log10(x.abs()).floor() as i32;
    format!("{x:.*}", decimals.max(0) as usize)
}

/// Formats the coordinates of a point to some ten-thousandths of a size, that of its model: `12.346, -0.50000, 0`.
pub fn point(p: [f64; 3], size: f64) -> String {
    let exponent = |x: f64| libm::log10(x.abs()).floor();
    let coordinate = |x: f64| {
        // (A cast saturates, and NaN gives 0.)
        let digits = if size > 0.0 { (exponent(x) - exponent(size)) as i32 + 5 } else { 5 };
        if digits < 1 { "0".to_owned() } else { significant(x, digits.min(17) as usize) }
    };
    p.map(coordinate).join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_as_exact_as_the_model_is_large() {
        assert_eq!(point([12.3456789, -0.5, 1e-9], 3.0), "12.3457, -0.5000, 0");
        assert_eq!(point([1_000_000.123456, 0.0, 2e-7], 0.02), "1000000.123456, 0, 0");
        assert_eq!(point([2e-7, f64::NAN, 1234.56], 0.0), "2.0000e-7, NaN, 1234.6");
    }

    #[test]
    fn counts_are_grouped() {
        assert_eq!(
            [0, 999, 1000, 69451, 1234567].map(grouped),
            ["0", "999", "1,000", "69,451", "1,234,567"].map(String::from)
        );
    }

    #[test]
    fn one_is_not_many() {
        let faces = |n| counted(n, "face", "faces");
        assert_eq!([0, 1, 2000].map(faces), ["0 faces", "1 face", "2,000 faces"].map(String::from));
    }

    #[test]
    fn leading_digits_are_kept() {
        assert_eq!(
            [0.0, 0.0174, 0.168, 1.74, 17.4, 174.0].map(|x| significant(x, 2)),
            ["0", "0.017", "0.17", "1.7", "17", "174"].map(String::from)
        );
        assert_eq!([2.5e-7, f64::INFINITY].map(|x| significant(x, 2)), ["2.5e-7", "inf"].map(String::from));
    }
}
