//! Type names that a crate defines more than once: a search for a type should find one definition.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::Item;

use super::cycles::is_test;

/// Returns each name of a struct, enum, union, trait or type alias that several modules of these files define, with the
/// files. Ignores tests, types within functions, and associated types.
pub(super) fn repeated(files: &[PathBuf]) -> Result<BTreeMap<String, Vec<&Path>>> {
    let mut defined: BTreeMap<String, Vec<&Path>> = BTreeMap::new();
    for file in files {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let mut names = Vec::new();
        collect(&parsed.items, &mut names);
        for name in names {
            defined.entry(name).or_default().push(file);
        }
    }
    defined.retain(|_, files| files.len() > 1);
    Ok(defined)
}

fn collect(items: &[Item], names: &mut Vec<String>) {
    for item in items {
        let name = match item {
            Item::Struct(x) if !is_test(&x.attrs) => &x.ident,
            Item::Enum(x) if !is_test(&x.attrs) => &x.ident,
            Item::Union(x) if !is_test(&x.attrs) => &x.ident,
            Item::Trait(x) if !is_test(&x.attrs) => &x.ident,
            Item::Type(x) if !is_test(&x.attrs) => &x.ident,
            Item::Mod(inner) if !is_test(&inner.attrs) => {
                collect(inner.content.as_ref().map_or(&[], |content| &content.1), names);
                continue;
            }
            _ => continue,
        };
        names.push(name.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_names_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let files = [
            write("a.rs", "struct Edge; enum Side {} impl Iterator for Edge { type Item = u8; }"),
            write("b.rs", "mod inner { pub trait Edge {} } type Item = u8; fn f() { struct Side; }"),
            write("c.rs", "#[cfg(test)] mod tests { struct Edge; struct Side; }"),
        ];
        let found = repeated(&files).unwrap();
        assert_eq!(
            found.into_iter().collect::<Vec<_>>(),
            [("Edge".to_owned(), vec![&*files[0], &*files[1]])]
        );
    }
}
