//! Generated sections of a page, each between the lines `<!-- NAME:begin -->` and `<!-- NAME:end -->`.

use std::path::Path;

use anyhow::{Context, Result};

/// Checks that a page has these sections, before a long run.
///
/// # Errors
/// If the page cannot be read or lacks a section.
pub fn check(path: &Path, names: &[&str]) -> Result<()> {
    let page = read(path)?;
    names.iter().try_for_each(|name| with_section(&page, name, "").map(drop))
}

/// Replaces the text of sections, given by name.
///
/// # Errors
/// If the page cannot be read or written, or lacks a section.
pub fn replace(path: &Path, sections: &[(&str, String)]) -> Result<()> {
    let page = sections.iter().try_fold(read(path)?, |page, (name, text)| with_section(&page, name, text))?;
    std::fs::write(path, page).with_context(|| format!("writing {}", path.display()))
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))
}

fn with_section(page: &str, name: &str, text: &str) -> Result<String> {
    let [begin, end] = ["begin", "end"].map(|edge| format!("<!-- {name}:{edge} -->"));
    let (before, rest) = page.split_once(&begin).with_context(|| format!("the page lacks {begin}"))?;
    let (_, after) = rest.split_once(&end).with_context(|| format!("the page lacks {end} after {begin}"))?;
    Ok(format!("{before}{begin}\n{}\n{end}{after}", text.trim_end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_named_section_changes() {
        let page = "a\n<!-- x:begin -->\nold\n<!-- x:end -->\nb\n<!-- y:begin -->\nkept\n<!-- y:end -->\n";
        assert_eq!(with_section(page, "x", "new\n").unwrap(), page.replace("old", "new"));
        assert!(with_section(page, "z", "").is_err());
        assert!(with_section("<!-- x:end --><!-- x:begin -->", "x", "").is_err());
    }
}
