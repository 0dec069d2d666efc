//! Checks that references in written glTF files name elements that exist.

#[path = "../../../crates/io/tests/references/dangling.rs"]
mod dangling;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::extension;

/// Returns a problem for each kind of reference that names nothing in a glTF file of a folder, and of which there are
/// fewer in the model that the file was made from.
pub(super) fn problems(model: &Path, folder: &Path) -> Result<Vec<String>> {
    let is_gltf = |path: &Path| matches!(&*extension(path), "glb" | "gltf");
    let entries = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut written: Vec<PathBuf> = entries.collect::<Result<_>>()?;
    written.retain(|path| is_gltf(path));
    written.sort();
    if written.is_empty() {
        return Ok(Vec::new());
    }
    // Damaged inputs need not be readable.
    let source = if is_gltf(model) { document(&std::fs::read(model)?) } else { None };
    let mut problems = Vec::new();
    for path in written {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let json = document(&std::fs::read(&path)?).with_context(|| format!("{name} is not glTF"))?;
        let found = dangling::new_dangling(&json, source.as_ref());
        problems.extend(found.into_iter().map(|line| format!("references in {name}: {line}")));
    }
    Ok(problems)
}

/// Returns the JSON of a glTF or GLB file.
fn document(bytes: &[u8]) -> Option<Value> {
    let text = match bytes.strip_prefix(b"glTF") {
        // After the mark come the version, the length of the file, and the length and the kind of the JSON.
        Some(rest) => {
            let length = u32::from_le_bytes(rest.get(8..12)?.try_into().ok()?);
            rest.get(16..)?.get(..usize::try_from(length).ok()?)?
        }
        None => bytes,
    };
    serde_json::from_slice(text).ok()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn glb(json: &Value) -> Vec<u8> {
        let text = json.to_string();
        let words = [2, 20 + text.len() as u32, text.len() as u32].map(u32::to_le_bytes);
        [b"glTF", words.as_flattened(), b"JSON", text.as_bytes()].concat()
    }

    #[test]
    fn a_reference_to_nothing_is_a_problem_unless_the_model_has_it() -> Result<()> {
        let with = |accessor: u64, node: u64| {
            json!({
                "asset": {"version": "2.0"}, "accessors": [{}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": accessor}}]}], "nodes": [{"mesh": 0}],
                "extensions": {"VRMC_springBone": {"colliders": [{"node": node}]}},
            })
        };
        let (models, folder) = (tempfile::tempdir()?, tempfile::tempdir()?);
        let [whole, broken] = ["whole.glb", "broken.gltf"].map(|name| models.path().join(name));
        std::fs::write(&whole, glb(&with(0, 0)))?;
        std::fs::write(&broken, with(0, 9).to_string())?;
        std::fs::write(folder.path().join("remark.txt"), "no model")?;
        assert_eq!(problems(&whole, folder.path())?, [""; 0]);
        std::fs::write(folder.path().join("good.glb"), glb(&with(0, 0)))?;
        assert_eq!(problems(&whole, folder.path())?, [""; 0]);
        std::fs::write(folder.path().join("out.glb"), glb(&with(7, 5)))?;
        let count = |model: &Path| problems(model, folder.path()).map(|found| found.len());
        assert_eq!((count(&whole)?, count(&broken)?, count(Path::new("a.obj"))?), (2, 1, 2));
        let found = problems(&broken, folder.path())?;
        assert!(
            found[0].contains("out.glb")
                && found[0].contains("/meshes/0/primitives/0/attributes/POSITION is 7")
        );
        Ok(())
    }
}
