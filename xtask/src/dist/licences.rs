//! Third-party packages in the program, with their licences and licence texts.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

/// Prefixes of the names of licence files.
const NAMES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"];

/// Returns the third-party packages of a program as a list, followed by the licence texts without duplicates.
pub(super) fn text(metadata: &Value, program: &str) -> Result<String> {
    let packages = metadata["packages"].as_array().context("cargo metadata lists no packages")?;
    let by_id: HashMap<&str, &Value> = packages.iter().filter_map(|p| Some((p["id"].as_str()?, p))).collect();
    let mut all: Vec<&Value> = reached(metadata, program)?
        .into_iter()
        .filter_map(|id| by_id.get(id).copied())
        // Packages of the workspace have no source.
        .filter(|package| !package["source"].is_null())
        .collect();
    let of = |package: &Value, key: &str| package[key].as_str().unwrap_or_default().to_owned();
    all.sort_by_key(|p| (of(p, "name"), of(p, "version")));

    let mut text = format!(
        "Lodsmith contains {} third-party packages under these licences. The licence texts follow the list.\n\n",
        all.len()
    );
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut bare = Vec::new();
    for package in all {
        let name = format!("{} {}", of(package, "name"), of(package, "version"));
        let terms = Some(of(package, "license")).filter(|t| !t.is_empty());
        let place = Some(of(package, "repository")).filter(|t| !t.is_empty());
        let _ = writeln!(
            text,
            "{name}: {}{}",
            terms.unwrap_or_else(|| "see the licence text".to_owned()),
            place.map(|place| format!(" ({place})")).unwrap_or_default()
        );
        let manifest = of(package, "manifest_path");
        let folder = Path::new(&manifest).parent().context("a package without a folder")?;
        let own = terms_in(folder)?;
        if own.is_empty() {
            bare.push(name.clone());
        }
        for terms in own {
            texts.entry(terms).or_default().push(name.clone());
        }
    }
    if !bare.is_empty() {
        let _ = write!(
            text,
            "\nWithout a text of their own come {}: LICENSE-APACHE and LICENSE-MIT beside this file have the words of these \
             two.\n",
            bare.join(", ")
        );
    }
    let mut texts: Vec<_> = texts.into_iter().collect();
    texts.sort_by(|a, b| a.1.cmp(&b.1).then_with(|| a.0.cmp(&b.0)));
    for (terms, of) in texts {
        let _ = write!(text, "\n{}\n{}\n\n{terms}\n", "-".repeat(80), of.join(", "));
    }
    Ok(text)
}

/// Returns the packages that are linked into a program, without test and build dependencies.
pub(super) fn reached<'a>(metadata: &'a Value, program: &str) -> Result<BTreeSet<&'a str>> {
    let nodes = metadata["resolve"]["nodes"].as_array().context("cargo metadata has no tree")?;
    let by_id: HashMap<&str, &Value> = nodes.iter().filter_map(|n| Some((n["id"].as_str()?, n))).collect();
    let packages = metadata["packages"].as_array().into_iter().flatten();
    let mut named = packages.filter(|p| p["name"] == program);
    let first = named.next().and_then(|p| p["id"].as_str());
    let mut open = vec![first.with_context(|| format!("there is no package {program}"))?];
    let mut seen = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !seen.insert(id) {
            continue;
        }
        open.extend(by_id.get(id).into_iter().flat_map(|node| linked(node)));
    }
    Ok(seen)
}

/// Returns the linked dependencies of a package.
pub(super) fn linked(node: &Value) -> impl Iterator<Item = &str> {
    let is_linked = |kind: &Value| kind["kind"].is_null();
    let needs = node["deps"].as_array().into_iter().flatten();
    let needs = needs
        .filter(move |need| need["dep_kinds"].as_array().is_some_and(|kinds| kinds.iter().any(is_linked)));
    needs.filter_map(|need| need["pkg"].as_str())
}

/// Returns the licence texts in the folder of a package, with normalised line ends.
fn terms_in(folder: &Path) -> Result<Vec<String>> {
    let is_terms = |name: &str| NAMES.iter().any(|n| name.starts_with(n));
    let mut files = files_of(folder, is_terms)?;
    // Licences of fonts are in the folder of the fonts.
    let fonts = folder.join("fonts");
    if fonts.is_dir() {
        files.extend(files_of(&fonts, |name| name.ends_with(".TXT"))?);
    }
    let read = |path: &PathBuf| {
        let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
        Ok(String::from_utf8_lossy(&bytes).replace("\r\n", "\n").trim().to_owned())
    };
    files.iter().map(read).collect()
}

/// Returns the files of a folder whose upper-case names are accepted, sorted.
fn files_of(folder: &Path, is_taken: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for file in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let file = file?;
        let name = file.file_name().to_string_lossy().to_uppercase();
        if file.file_type()?.is_file() && is_taken(&name) {
            files.push(file.path());
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn linked_packages_are_listed_without_test_dependencies() {
        let folder = tempfile::tempdir().unwrap();
        let package = |name: &str, source: Option<&str>, terms: &str| {
            let place = folder.path().join(name);
            std::fs::create_dir(&place).unwrap();
            if terms.is_empty() {
                std::fs::create_dir(place.join("fonts")).unwrap();
                std::fs::write(place.join("fonts/Face.txt"), "of a font").unwrap();
            } else {
                std::fs::write(place.join("LICENSE-MIT"), format!("{terms}\r\n")).unwrap();
            }
            std::fs::write(place.join("lib.rs"), "no terms").unwrap();
            json!({"id": name, "name": name, "version": "1.0.0", "license": "MIT", "source": source,
                "manifest_path": place.join("Cargo.toml")})
        };
        let node = |id: &str, deps: &[(&str, Option<&str>)]| {
            let deps: Vec<_> =
                deps.iter().map(|(pkg, kind)| json!({"pkg": pkg, "dep_kinds": [{"kind": kind}]})).collect();
            json!({"id": id, "deps": deps})
        };
        let metadata = json!({
            "packages": [package("own", None, "ours"), package("b", Some("r"), "same"), package("a", Some("r"), "same"),
                package("c", Some("r"), ""), package("test", Some("r"), "of tests")],
            "resolve": {"nodes": [node("own", &[("b", None), ("test", Some("dev"))]), node("b", &[("a", None), ("c", None)]),
                node("a", &[]), node("c", &[]), node("test", &[])]},
        });
        let text = text(&metadata, "own").unwrap();
        assert!(text.starts_with("Lodsmith contains 3 third-party packages"), "{text}");
        assert!(text.contains("\na 1.0.0: MIT\nb 1.0.0: MIT\nc 1.0.0: MIT\n"), "{text}");
        assert!(text.contains("\na 1.0.0, b 1.0.0\n\nsame\n"), "each text once: {text}");
        assert!(text.contains("\nc 1.0.0\n\nof a font\n"), "{text}");
        assert!(!text.contains("ours") && !text.contains("of tests") && !text.contains('\r'), "{text}");
        assert!(super::text(&metadata, "nobody").is_err());
    }
}
