//! What fuzz targets begin with, beside the files that are kept in `fuzz/seeds`: small shapes in every format that the
//! command writes, the small files of `testdata`, and bytes by chance for the targets that make soups of them.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::core::{TriMesh, shapes};

use crate::faults::Chance;
use crate::{release_command, root};

/// Larger files only slow the search down.
const LARGEST: u64 = 8192;
/// Targets that make meshes out of any bytes.
const SOUPS: [&str; 5] = ["simplify_soup", "clean_soup", "compare_soup", "progressive_soup", "write"];
/// Files of bytes for each of them.
const BYTES: usize = 16;

/// Fills `fuzz/corpus`, beside what is there already.
pub(crate) fn run(args: &[String]) -> Result<()> {
    let program = match args {
        [] => release_command()?,
        [option, binary] if option == "--binary" => std::path::absolute(binary)?,
        _ => bail!("no such options: cargo xtask seeds [--binary FILE]"),
    };
    let corpus = root().join("fuzz/corpus");
    let folder = |target: &str| -> Result<PathBuf> {
        let folder = corpus.join(target);
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        Ok(folder)
    };
    let inputs = tempfile::tempdir()?;
    for (name, mesh) in small_shapes() {
        let input = inputs.path().join(format!("{name}.obj"));
        std::fs::write(&input, obj(&mesh))?;
        for (target, ending, more) in [
            ("read_obj", "obj", &[][..]),
            ("read_off", "off", &[]),
            ("read_ply", "ply", &[]),
            ("read_ply", "text.ply", &["--ascii"]),
            ("read_stl", "stl", &[]),
            ("read_stl", "text.stl", &["--ascii"]),
            ("read_gltf", "gltf", &[]),
            ("read_gltf", "glb", &[]),
        ] {
            let out = folder(target)?.join(format!("{name}.{ending}"));
            call(Command::new(&program).arg("convert").args([&input, &out]).args(more))?;
        }
        let out = folder("read_lpm")?.join(format!("{name}.lpm"));
        call(Command::new(&program).args(["progressive", "build"]).arg(&input).arg("-o").arg(out))?;
    }
    for entry in std::fs::read_dir(root().join("testdata"))? {
        let entry = entry?;
        let name = entry.file_name();
        if entry.metadata()?.len() <= LARGEST && Path::new(&name).extension().is_some_and(|e| e == "glb") {
            std::fs::copy(entry.path(), folder("read_gltf")?.join(&name))?;
        }
    }
    let mut chance = Chance(47);
    for target in SOUPS {
        for number in 0..BYTES {
            let length = 64 << (number % 4);
            let bytes: Vec<u8> = (0..length).map(|_| chance.below(256) as u8).collect();
            std::fs::write(folder(target)?.join(format!("chance{number:02}")), bytes)?;
        }
    }
    println!("{}", corpus.display());
    Ok(())
}

fn call(command: &mut Command) -> Result<()> {
    let output = command.arg("--quiet").output()?;
    ensure!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(())
}

/// Closed, open, non-manifold, and in pieces.
fn small_shapes() -> Vec<(&'static str, TriMesh)> {
    vec![
        ("cube", shapes::cube(1)),
        ("torus", shapes::torus(8, 5)),
        ("mobius", shapes::mobius_strip(9)),
        ("hourglass", shapes::hourglass()),
        ("book", shapes::book(5)),
        ("sheet", shapes::grid_with_holes(8)),
        ("tetrahedra", shapes::tetrahedra(3)),
    ]
}

/// A mesh as OBJ with texture coordinates and two materials, so that other formats have seams and regions to carry.
fn obj(mesh: &TriMesh) -> String {
    let mut text = String::from("vt 0 0\nvt 1 0\nvt 0 1\nusemtl a\n");
    for [x, y, z] in mesh.positions().view().iter() {
        writeln!(text, "v {x:.4} {y:.4} {z:.4}").expect("text grows");
    }
    let half = mesh.face_count() / 2;
    for (i, [a, b, c]) in mesh.surface().triangles().iter().map(|t| t.map(|v| v.0 + 1)).enumerate() {
        if i == half {
            text.push_str("usemtl b\n");
        }
        writeln!(text, "f {a}/1 {b}/2 {c}/3").expect("text grows");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_target_has_a_row_in_the_gate_and_seeds_are_small() {
        let manifest = std::fs::read_to_string(root().join("fuzz/Cargo.toml")).unwrap();
        let targets: Vec<&str> =
            manifest.lines().filter_map(|l| l.strip_prefix("path = \"fuzz_targets/")).collect();
        let gate = std::fs::read_to_string(root().join(".ci/run")).unwrap();
        assert!(targets.len() >= 12, "{targets:?}");
        for target in targets.iter().filter_map(|path| path.strip_suffix(".rs\"")) {
            assert!(gate.contains(&format!(" {target} ")), "{target} is not run in .ci/run");
            assert!(root().join(format!("fuzz/fuzz_targets/{target}.rs")).is_file(), "{target}");
        }
        for folder in std::fs::read_dir(root().join("fuzz/seeds")).unwrap() {
            let folder = folder.unwrap().path();
            let target = folder.file_name().unwrap().to_string_lossy().into_owned();
            assert!(targets.contains(&format!("{target}.rs\"").as_str()), "{target} is no target");
            for file in std::fs::read_dir(&folder).unwrap() {
                let file = file.unwrap();
                assert!(file.metadata().unwrap().len() <= LARGEST, "{}", file.path().display());
            }
        }
    }
}
