//! Numbers as people read them.

/// A count in groups of three: `69,451`.
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

/// As many leading digits as asked, more only before the point; very small ones with an exponent.
pub fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !x.is_finite() || x.abs() < 1e-4 || x.abs() >= 1e15 {
        return format!("{x:.*e}", digits - 1);
    }
    let decimals = digits as i32 - 1 - x.abs().log10().floor() as i32;
    format!("{x:.*}", decimals.max(0) as usize)
}

/// A share as percent: `100 %`, `12.5 %`, `0.25 %`.
pub fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p >= 99.95 => format!("{p:.0} %"),
        p if p >= 10.0 => format!("{p:.1} %"),
        p => format!("{} %", significant(p, 2)),
    }
}

/// Seconds: `3.2 ms`, `0.41 s`, `12.3 s`.
pub fn seconds(secs: f64) -> String {
    match secs {
        s if s < 0.1 => format!("{:.1} ms", 1e3 * s),
        s if s < 10.0 => format!("{s:.2} s"),
        s => format!("{s:.1} s"),
    }
}

/// A whole number as it is typed: digits, with or without groups, and `k` or `M` at the end.
pub fn count_of(text: &str) -> Option<usize> {
    let text: String = text.chars().filter(|c| !matches!(c, ',' | ' ' | '_' | '\'')).collect();
    let (number, factor) = match text.chars().last()? {
        'k' | 'K' => (&text[..text.len() - 1], 1e3),
        'm' | 'M' => (&text[..text.len() - 1], 1e6),
        _ => (&*text, 1.0),
    };
    let n = number.parse::<f64>().ok()? * factor;
    (n.is_finite() && (0.0..1e15).contains(&n)).then(|| n.round() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!([0, 999, 69451, 1234567].map(grouped), ["0", "999", "69,451", "1,234,567"]);
        assert_eq!([1.0, 0.125, 0.0025].map(percent), ["100 %", "12.5 %", "0.25 %"]);
        assert_eq!([0.0032, 0.41, 12.34].map(seconds), ["3.2 ms", "0.41 s", "12.3 s"]);
    }

    #[test]
    fn counts_are_typed_in_many_ways() {
        assert_eq!(count_of("69,451"), Some(69451));
        assert_eq!(count_of("1.5k"), Some(1500));
        assert_eq!(count_of(" 2 M "), Some(2_000_000));
        assert_eq!([count_of(""), count_of("x"), count_of("-1")], [None; 3]);
    }
}
