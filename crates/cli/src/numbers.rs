//! Numbers as people read them.

/// A count in groups of three: `69,451`.
pub(crate) fn grouped(count: usize) -> String {
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

/// Two leading digits, more only before the point: `0.017`, `0.17`, `1.7`, `17`, `170`.
pub(crate) fn short(x: f64) -> String {
    significant(x, 2)
}

/// As many leading digits as asked, more only before the point; very small ones with an exponent.
pub(crate) fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    // Below this a row of zeros is harder to read than an exponent.
    if !x.is_finite() || x.abs() < 1e-4 || x.abs() >= 1e15 {
        return format!("{x:.*e}", digits - 1);
    }
    let decimals = digits as i32 - 1 - x.abs().log10().floor() as i32;
    format!("{x:.*}", decimals.max(0) as usize)
}

/// One thing or many of them: `1 face`, `2,000 faces`.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(count), if count == 1 { one } else { many })
}

/// Seconds for people: `0.04 s`, `12.3 s`.
pub(crate) fn seconds(secs: f64) -> String {
    if secs < 10.0 { format!("{secs:.2} s") } else { format!("{secs:.1} s") }
}

/// Seconds for programs, to the microsecond.
pub(crate) fn micros(secs: f64) -> f64 {
    (secs * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped() {
        assert_eq!(
            [0, 999, 1000, 69451, 1234567].map(grouped),
            ["0", "999", "1,000", "69,451", "1,234,567"].map(String::from)
        );
    }

    #[test]
    fn figures_keep_two_digits() {
        assert_eq!(
            [0.0, 0.0174, 0.168, 1.74, 17.4, 174.0].map(short),
            ["0", "0.017", "0.17", "1.7", "17", "174"].map(String::from)
        );
        assert_eq!(short(2.5e-7), "2.5e-7");
    }
}
