//! The software bill of materials in CycloneDX format, for finding programs that contain a vulnerable
//! package.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use time::OffsetDateTime;

use super::{hex, licences};

/// Its file name in the archive.
pub(super) const NAME: &str = "sbom.cdx.json";

/// Returns the packages linked into a program, each with licence, checksum and dependencies.
///
/// Equal packages give equal bytes: the serial number is derived from the content, and the time comes from the
/// sources.
pub(super) fn text(metadata: &Value, lock: &str, program: &str, seconds: u64) -> Result<Vec<u8>> {
    let packages = metadata["packages"].as_array().context("cargo metadata lists no packages")?;
    let reached = licences::reached(metadata, program)?;
    let names: HashMap<&str, String> = packages
        .iter()
        .filter(|package| package["id"].as_str().is_some_and(|id| reached.contains(id)))
        .map(|package| Ok((text_of(package, "id")?, place(package)?)))
        .collect::<Result<_>>()?;
    let sums = checksums(lock);

    let (mut whole, mut parts) = (Value::Null, BTreeMap::new());
    for package in packages {
        let Some(name) = package["id"].as_str().and_then(|id| names.get(id)) else { continue };
        let part = component(package, name, &sums)?;
        if package["name"] == program {
            whole = part;
            whole["type"] = "application".into();
        } else {
            parts.insert(name, part);
        }
    }
    let nodes = metadata["resolve"]["nodes"].as_array().context("cargo metadata has no tree")?;
    let mut needs = BTreeMap::new();
    for node in nodes {
        let Some(name) = node["id"].as_str().and_then(|id| names.get(id)) else { continue };
        let linked = licences::linked(node).filter_map(|id| names.get(id));
        let on: BTreeSet<&String> = linked.collect();
        needs.insert(name, json!({ "ref": name, "dependsOn": on }));
    }
    let time = OffsetDateTime::from_unix_timestamp(i64::try_from(seconds)?)?;
    let time = format!(
        "{}-{:02}-{:02}T{:02}:{:02}:{:02}Z",
        time.year(),
        u8::from(time.month()),
        time.day(),
        time.hour(),
        time.minute(),
        time.second()
    );
    let mut list = json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "timestamp": time, "component": whole },
        "components": parts.into_values().collect::<Vec<_>>(),
        "dependencies": needs.into_values().collect::<Vec<_>>(),
    });
    list["serialNumber"] = number(&serde_json::to_vec(&list)?).into();
    check(&list)?;
    let mut bytes = serde_json::to_vec_pretty(&list)?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn text_of<'a>(package: &'a Value, key: &str) -> Result<&'a str> {
    package[key].as_str().with_context(|| format!("a package without {key}"))
}

/// Returns the package URL of a package, which is also its reference in the list.
fn place(package: &Value) -> Result<String> {
    Ok(format!("pkg:cargo/{}@{}", text_of(package, "name")?, text_of(package, "version")?))
}

fn component(package: &Value, place: &str, sums: &BTreeMap<(&str, &str), &str>) -> Result<Value> {
    let (name, version) = (text_of(package, "name")?, text_of(package, "version")?);
    let mut part =
        json!({ "type": "library", "bom-ref": place, "name": name, "version": version, "purl": place });
    if let Some(terms) = package["license"].as_str() {
        // An old notation of "or", which CycloneDX does not support.
        part["licenses"] = json!([{ "expression": terms.replace('/', " OR ") }]);
    }
    if let Some(sum) = sums.get(&(name, version)) {
        part["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(url) = package["repository"].as_str() {
        part["externalReferences"] = json!([{ "type": "vcs", "url": url }]);
    }
    Ok(part)
}

/// Parses the checksums of a lock file, by name and version.
fn checksums(lock: &str) -> BTreeMap<(&str, &str), &str> {
    let value = |line: &'_ str, key: &str| -> Option<(usize, usize)> {
        let head = format!("{key} = \"");
        line.starts_with(&head).then(|| (head.len(), line.len() - 1))
    };
    let (mut sums, mut name, mut version) = (BTreeMap::new(), "", "");
    for line in lock.lines() {
        if let Some((from, to)) = value(line, "name") {
            name = &line[from..to];
        } else if let Some((from, to)) = value(line, "version") {
            version = &line[from..to];
        } else if let Some((from, to)) = value(line, "checksum") {
            sums.insert((name, version), &line[from..to]);
        }
    }
    sums
}

/// Returns a serial number that depends only on the content: a UUID of version 8 (RFC 9562).
fn number(content: &[u8]) -> String {
    let mut bytes: [u8; 16] = Sha256::digest(content)[..16].try_into().expect("a digest is longer");
    bytes[6] = bytes[6] & 0x0f | 0x80;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    let all = hex(&bytes);
    format!("urn:uuid:{}-{}-{}-{}-{}", &all[..8], &all[8..12], &all[12..16], &all[16..20], &all[20..])
}

/// Checks the list against the used parts of the CycloneDX 1.5 specification.
fn check(list: &Value) -> Result<()> {
    for (key, value) in
        [("bomFormat", json!("CycloneDX")), ("specVersion", json!("1.5")), ("version", json!(1))]
    {
        ensure!(list[key] == value, "{key} is {}", list[key]);
    }
    let number = list["serialNumber"].as_str().and_then(|n| n.strip_prefix("urn:uuid:")).unwrap_or_default();
    let groups: Vec<usize> = number.split('-').map(str::len).collect();
    ensure!(groups == [8, 4, 4, 4, 12], "serialNumber is {}", list["serialNumber"]);
    let parts = list["components"].as_array().context("no components")?;
    ensure!(!parts.is_empty(), "no components");
    let mut known = BTreeSet::new();
    for part in parts.iter().chain([&list["metadata"]["component"]]) {
        for key in ["type", "bom-ref", "name", "version", "purl"] {
            ensure!(part[key].as_str().is_some_and(|text| !text.is_empty()), "{} has no {key}", part["name"]);
        }
        ensure!(part["licenses"][0]["expression"].is_string(), "{} has no terms", part["name"]);
        for hash in part["hashes"].as_array().into_iter().flatten() {
            let sum = hash["content"].as_str().unwrap_or_default();
            ensure!(
                hash["alg"] == "SHA-256" && sum.len() == 64 && sum.bytes().all(|b| b.is_ascii_hexdigit()),
                "the checksum of {} is {hash}",
                part["name"]
            );
        }
        ensure!(known.insert(part["bom-ref"].as_str()), "{} is listed twice", part["bom-ref"]);
    }
    for need in list["dependencies"].as_array().context("no dependencies")? {
        let on = need["dependsOn"].as_array().context("no dependsOn")?;
        for name in on.iter().chain([&need["ref"]]) {
            if !known.contains(&name.as_str()) {
                bail!("{name} is not among the components");
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOCK: &str = "[[package]]\nname = \"a\"\nversion = \"1.0.0\"\n\n[[package]]\nname = \"b\"\nversion = \"2.0.0\"\n\
        source = \"x\"\nchecksum = \"1111111111111111111111111111111111111111111111111111111111111111\"\n";

    fn metadata() -> Value {
        let package = |name: &str, version: &str, terms: &str| json!({ "id": name, "name": name, "version": version, "license": terms, "repository": null });
        let need = |name: &str, kind: Value| json!({ "pkg": name, "dep_kinds": [{ "kind": kind }] });
        json!({
            "packages": [package("a", "1.0.0", "MIT"), package("b", "2.0.0", "MIT/Zlib"), package("t", "3.0.0", "MIT")],
            "resolve": { "nodes": [
                { "id": "a", "deps": [need("b", Value::Null), need("t", json!("dev"))] },
                { "id": "b", "deps": [] },
                { "id": "t", "deps": [] },
            ] },
        })
    }

    fn list() -> Value {
        serde_json::from_slice(&text(&metadata(), LOCK, "a", 86_400).unwrap()).unwrap()
    }

    #[test]
    fn linked_packages_are_listed_with_licences_and_checksums() {
        let list = list();
        assert_eq!(list["metadata"]["timestamp"], "1970-01-02T00:00:00Z");
        assert_eq!(list["metadata"]["component"]["purl"], "pkg:cargo/a@1.0.0");
        assert_eq!(list["metadata"]["component"]["type"], "application");
        // Without test dependencies.
        assert_eq!(list["components"].as_array().unwrap().len(), 1);
        let b = &list["components"][0];
        assert_eq!((&b["name"], &b["licenses"][0]["expression"]), (&json!("b"), &json!("MIT OR Zlib")));
        assert_eq!(b["hashes"][0]["content"].as_str().unwrap(), "1".repeat(64));
        let a = json!({ "ref": "pkg:cargo/a@1.0.0", "dependsOn": ["pkg:cargo/b@2.0.0"] });
        assert_eq!(list["dependencies"][0], a);
    }

    #[test]
    fn the_same_packages_give_the_same_bytes_and_different_ones_another_number() {
        let again = |seconds| text(&metadata(), LOCK, "a", seconds).unwrap();
        assert_eq!(again(7), again(7));
        let number =
            |bytes: Vec<u8>| serde_json::from_slice::<Value>(&bytes).unwrap()["serialNumber"].clone();
        assert_ne!(number(again(7)), number(again(8)));
    }

    #[test]
    fn the_check_finds_missing_fields() {
        assert!(check(&list()).is_ok());
        let damages: [fn(&mut Value); 8] = [
            |l| l["bomFormat"] = "SPDX".into(),
            |l| l["serialNumber"] = "urn:uuid:1".into(),
            |l| l["components"] = json!([]),
            |l| l["components"][0]["version"] = "".into(),
            |l| l["components"][0]["licenses"] = Value::Null,
            |l| l["components"][0]["hashes"][0]["content"] = "12".into(),
            |l| l["metadata"]["component"]["bom-ref"] = "pkg:cargo/b@2.0.0".into(),
            |l| l["dependencies"][0]["dependsOn"][0] = "pkg:cargo/c@1.0.0".into(),
        ];
        for damage in damages {
            let mut list = list();
            damage(&mut list);
            assert!(check(&list).is_err(), "{list}");
        }
    }
}
