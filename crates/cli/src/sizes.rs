//! Text about the sizes of files before and after, and about compression.

use lodsmith_io::Sizes;
use lodsmith_io::gltf::PackReport;

use crate::numbers::grouped;

/// Returns the line about sizes before and after; `None` if neither is known.
pub(crate) fn line(before: Option<Sizes>, after: Option<Sizes>) -> Option<String> {
    if before.is_none() && after.is_none() {
        return None;
    }
    let change = |of: &dyn Fn(&Sizes) -> Option<String>| {
        let one = |sizes: Option<Sizes>| sizes.as_ref().and_then(of);
        match (one(before), one(after)) {
            (Some(a), Some(b)) => format!("{a} → {b}"),
            (Some(a), None) => a,
            (None, Some(b)) => format!("? → {b}"),
            (None, None) => "?".to_owned(),
        }
    };
    let count = |n: u64| Some(grouped(usize::try_from(n).unwrap_or(usize::MAX)));
    Some(format!(
        "  triangles {}, draw calls {}, textures {}, file {}",
        change(&|s| count(s.triangles)),
        change(&|s| count(s.draw_calls)),
        change(&|s| Some(bytes(s.texture_bytes))),
        change(&|s| s.file_bytes.map(bytes)),
    ))
}

/// Returns the line about compression and the order for the vertex cache.
pub(crate) fn packed_line(packed: &PackReport) -> String {
    let (a, b) = (&packed.cache_before, &packed.cache);
    let streams = match packed.packed_bytes {
        0 => String::new(),
        n => format!("streams {} → {}, ", bytes(packed.stream_bytes), bytes(n)),
    };
    format!(
        "  {streams}vertex cache: ACMR {:.3} → {:.3}, ATVR {:.2} → {:.2}, overfetch {:.2} → {:.2}",
        a.acmr(),
        b.acmr(),
        a.atvr(),
        b.atvr(),
        a.overfetch(),
        b.overfetch()
    )
}

/// Formats a number of bytes, in powers of 1000.
pub(crate) fn bytes(n: u64) -> String {
    let units = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    match units.into_iter().find(|(unit, _)| n as f64 >= *unit) {
        Some((unit, name)) => {
            let x = n as f64 / unit;
            if x < 9.95 { format!("{x:.1} {name}") } else { format!("{x:.0} {name}") }
        }
        None => format!("{n} B"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_two_digits() {
        assert_eq!(
            [0, 999, 1_000, 9_949, 9_951, 123_456_789].map(bytes),
            ["0 B", "999 B", "1.0 kB", "9.9 kB", "10 kB", "123 MB"].map(String::from)
        );
    }

    #[test]
    fn unknown_sizes_are_question_marks() {
        assert_eq!(line(None, None), None);
        let mut sizes = Sizes::default();
        (sizes.triangles, sizes.draw_calls) = (12, 1);
        assert_eq!(
            line(None, Some(sizes)).unwrap(),
            "  triangles ? → 12, draw calls ? → 1, textures ? → 0 B, file ?"
        );
    }
}
