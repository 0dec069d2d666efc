//! Formatting of numbers for display.

pub use lodsmith_core::numbers::{grouped, point, significant};

/// Formats a fraction as percent: `100 %`, `12.5 %`, `0.25 %`.
pub fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p >= 99.95 => format!("{p:.0} %"),
        p if p >= 10.0 => format!("{p:.1} %"),
        p => format!("{} %", significant(p, 2)),
    }
}

/// Formats seconds: `3.2 ms`, `0.41 s`, `12.3 s`.
pub fn seconds(secs: f64) -> String {
    match secs {
        s if s < 0.1 => format!("{:.1} ms", 1e3 * s),
        s if s < 10.0 => format!("{s:.2} s"),
        s => format!("{s:.1} s"),
    }
}

/// Parses a typed count: digits, with or without group separators, and an optional suffix `k` or `M`.
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
