//! The initial corpus of the fuzz targets, in addition to the files in `fuzz/seeds`. It has small shapes in every
//! format that the command writes, sessions and layouts of the viewer, the small files of `testdata`, and random bytes
//! for the targets that build triangle soups.

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use lodsmith::core::{TriMesh, shapes};
use lodsmith::{MethodKind, Stop};
use lodsmith_viewer::settings::playback::Playback;
use lodsmith_viewer::settings::session::Session;
use lodsmith_viewer::settings::{Backdrop, EnvironmentChoice, Pose, Settings};
use lodsmith_viewer::stage::file::LayoutFile;
use lodsmith_viewer::stage::motion::{CameraPlacement, Curve, Tracks};
use lodsmith_viewer::stage::{Placement, Stage};

use crate::faults::Random;
use crate::{release_command, root};

/// Maximum size of a seed: larger files slow fuzzing down.
const MAX_SEED_BYTES: u64 = 8192;
/// Targets that build meshes from arbitrary bytes.
const SOUPS: [&str; 6] =
    ["simplify_soup", "clean_soup", "compare_soup", "progressive_soup", "index_calls", "write"];
/// Number of random files for each of these targets.
const RANDOM_FILES: usize = 16;

/// Returns an LPM file with uncompressed streams, so that a changed byte is a changed number. The checksums are wrong:
/// the target corrects them.
fn uncompressed(file: &[u8]) -> Result<Vec<u8>> {
    let (magic, mut rest) = file.split_at_checked(8).context("the magic number is missing")?;
    let mut out = magic.to_vec();
    while let Some((length, tail)) = rest.split_first_chunk() {
        let length = u32::from_le_bytes(*length) as usize;
        let (chunk, tail) = tail.split_at_checked(length + 8).context("a chunk is truncated")?;
        let (kind, content) = chunk[..length + 4].split_at(4);
        let front = match kind {
            b"BASE" | b"ORIG" => 0,
            b"SPLT" => 4,
            b"CHKP" => 16,
            _ => length,
        };
        let mut new = content[..front].to_vec();
        if front < length {
            let mut plain = Vec::new();
            DeflateDecoder::new(&content[front..]).read_to_end(&mut plain)?;
            let mut packed = DeflateEncoder::new(new, Compression::none());
            packed.write_all(&plain)?;
            new = packed.finish()?;
        }
        out.extend((new.len() as u32).to_le_bytes());
        out.extend([kind, &new, &[0; 4]].concat());
        rest = tail;
    }
    Ok(out)
}

/// Adds the seeds to `fuzz/corpus`.
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
        for (target, extension, more) in [
            ("read_obj", "obj", &[][..]),
            ("read_off", "off", &[]),
            ("read_ply", "ply", &[]),
            ("read_ply", "text.ply", &["--ascii"]),
            ("read_stl", "stl", &[]),
            ("read_stl", "text.stl", &["--ascii"]),
            ("read_gltf", "gltf", &[]),
            ("read_gltf", "glb", &[]),
            ("read_three_mf", "3mf", &[]),
        ] {
            let out = folder(target)?.join(format!("{name}.{extension}"));
            call(Command::new(&program).arg("convert").args([&input, &out]).args(more))?;
        }
        let out = folder("read_lpm")?.join(format!("{name}.lpm"));
        call(Command::new(&program).args(["progressive", "build"]).arg(&input).arg("-o").arg(&out))?;
        std::fs::write(&out, uncompressed(&std::fs::read(&out)?)?)?;
    }
    let targets = [("glb", "read_gltf"), ("3mf", "read_three_mf"), ("dae", "read_dae"), ("fbx", "read_fbx")];
    for entry in std::fs::read_dir(root().join("testdata"))? {
        let entry = entry?;
        let name = entry.file_name();
        let extension = Path::new(&name).extension().unwrap_or_default();
        if let Some((_, target)) = targets.iter().find(|(e, _)| extension == *e)
            && entry.metadata()?.len() <= MAX_SEED_BYTES
        {
            std::fs::copy(entry.path(), folder(target)?.join(&name))?;
        }
    }
    sessions(&folder("read_session")?)?;
    let mut random = Random(47);
    for target in SOUPS {
        for number in 0..RANDOM_FILES {
            let length = 64 << (number % 4);
            let bytes: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
            std::fs::write(folder(target)?.join(format!("random{number:02}")), bytes)?;
        }
    }
    println!("{}", corpus.display());
    Ok(())
}

/// Writes one session for each method, so that all method names occur, and their stage layout.
fn sessions(folder: &Path) -> Result<()> {
    let stage = stage();
    LayoutFile::new(Path::new("a.glb"), &stage).save(&folder.join("layout.json"))?;
    for (number, method) in MethodKind::ALL.into_iter().enumerate() {
        let mut settings = Settings { files: vec![folder.join("a.glb")], ..Settings::default() };
        settings.simplify.options.stop = Stop::faces(number + 1);
        settings.simplify.options.method = method.into();
        // One session has all parts of a session; the others are short.
        if method == MethodKind::Memoryless {
            settings.stage = stage.clone();
            settings.look.backdrop = Backdrop::Color([0.1, 0.2, 0.3]);
            settings.look.around = EnvironmentChoice::Studio;
            settings.look.look.heat_range = Some([0.0, 0.5]);
            settings.playback = Playback { clip: None, seconds: 1.25, speed: 0.5, repeats: false };
            settings.cameras[2] = Some(pose());
        }
        let session = Session::new(settings, [pose(); 2]).with_stage_camera(Some(pose()));
        session.save(&folder.join(format!("{}.json", method.name())))?;
    }
    Ok(())
}

fn pose() -> Pose {
    Pose { eye: [3.0, 2.0, 1.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 }
}

/// Returns a stage with two copies; one of them and the camera move.
fn stage() -> Stage {
    let mut tracks = Tracks { length_secs: Some(8.0), ..Tracks::default() };
    let stand = CameraPlacement { x: 1.0, y: 2.0, z: 3.0, yaw_deg: 10.0, pitch_deg: -5.0, distance: 4.0 };
    tracks.camera.set(1.0, stand);
    tracks.camera.set(3.0, CameraPlacement { x: 2.0, ..stand });
    let track = tracks.copies.entry(1).or_default();
    track.curve = Curve::Step;
    for secs in [0.5, 2.0] {
        track.set(secs, Placement { turn_deg: 33.0, scale: secs, ..Placement::at(secs, 0.0) });
    }
    let copies = vec![Placement::at(0.0, 0.0), Placement::at(2.0, -1.0)].into();
    Stage { is_on: true, copies, motion: tracks.into(), ..Stage::default() }
}

fn call(command: &mut Command) -> Result<()> {
    let output = command.arg("--quiet").output()?;
    ensure!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(())
}

/// Returns small shapes: closed, open, non-manifold, and with several components.
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

/// Returns a mesh as OBJ with texture coordinates and two materials, so that other formats get seams and
/// regions.
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
    use lodsmith_io::AssetScope;

    use super::*;

    #[test]
    fn each_target_is_run_in_ci_and_seeds_are_small() {
        let manifest = std::fs::read_to_string(root().join("fuzz/Cargo.toml")).unwrap();
        let targets: Vec<&str> =
            manifest.lines().filter_map(|l| l.strip_prefix("path = \"fuzz_targets/")).collect();
        let gate = std::fs::read_to_string(root().join(".ci/run")).unwrap();
        assert!(targets.len() >= 13, "{targets:?}");
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
                assert!(file.metadata().unwrap().len() <= MAX_SEED_BYTES, "{}", file.path().display());
            }
        }
    }
    #[test]
    fn session_seeds_are_readable_and_small() {
        let folder = tempfile::tempdir().unwrap();
        sessions(folder.path()).unwrap();
        let mut opened = 0;
        for file in std::fs::read_dir(folder.path()).unwrap() {
            let path = file.unwrap().path();
            assert!(path.metadata().unwrap().len() <= MAX_SEED_BYTES, "{}", path.display());
            if LayoutFile::is_layout(&path) {
                assert_eq!(LayoutFile::open(&path).unwrap().0.len(), 2);
            } else {
                opened += usize::from(Session::open(&path, &AssetScope::Folder).is_ok());
            }
        }
        assert_eq!(opened, MethodKind::ALL.len());
    }
}
