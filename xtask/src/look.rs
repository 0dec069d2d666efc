//! Measures the preserved appearance of models: simplified to 50, 25, 10, 5 and 1 %, and compared from many
//! sides.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::{cargo, root, sample, succeed};

/// Fractions of the triangles to keep.
const RATIOS: [f64; 5] = [0.5, 0.25, 0.1, 0.05, 0.01];
/// Number of views: one for about every 40 degrees.
const VIEWS: &str = "24";

/// Prints a table for each model: `FILE`, or `TITLE=FILE`; without any, for the sample model.
pub(crate) fn run(models: &[String]) -> Result<()> {
    succeed(cargo().args(["build", "--release", "-q", "-p", "lodsmith-cli"]))?;
    let own = format!("turned finial={}", root().join(sample::PATH).display());
    let models = if models.is_empty() { &[own] } else { models };
    for model in models {
        let (title, file) = model.split_once('=').unwrap_or((model, model));
        table(title, Path::new(file)).with_context(|| file.to_owned())?;
    }
    Ok(())
}

fn table(title: &str, file: &Path) -> Result<()> {
    let folder = tempfile::tempdir()?;
    // A format that keeps materials, if the input may have some.
    let ending =
        if file.extension().is_some_and(|e| e == "gltf" || e == "glb" || e == "obj") { "glb" } else { "ply" };
    let mut rows = Vec::new();
    let mut heading = String::new();
    for ratio in RATIOS {
        let lighter = folder.path().join(format!("lighter.{ending}"));
        let report = object(
            &["simplify", "--json", "--force", "--ratio", &ratio.to_string(), "-o"],
            &[&lighter, file],
        )?;
        let compared = object(&["compare", "--json", "--views", VIEWS], &[file, &lighter])?;
        let (image, stages) = (&compared["image"], &report["seconds"]);
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        // The engine's time only, since files are read and written at every level.
        let seconds: f64 = ["prepare", "simplify", "fit"].iter().filter_map(|s| stages[*s].as_f64()).sum();
        let pair = |key: &str, factor: f64, digits: usize| {
            let [mean, worst] = ["mean", "worst"].map(|w| factor * number(&image[key][w]));
            format!("{mean:.digits$} / {worst:.digits$}")
        };
        let draw = |side: &str| format!("{:.1} ms", 1000.0 * number(&image["draw_seconds"][side]));
        if heading.is_empty() {
            heading = format!(
                "{title}: {} triangles, drawn in {}, {}",
                report["input"]["faces"],
                draw("reference"),
                image["shading"].as_str().unwrap_or_default()
            );
        }
        rows.push(format!(
            "| {} % | {} | {seconds:.3} s | {} | {:.4} % | {:.4} % | {} | {} | {} | {} % |",
            100.0 * ratio,
            report["output"]["faces"],
            draw("candidate"),
            100.0 * number(&compared["relative_to_diagonal"]["mean"]),
            100.0 * number(&compared["relative_to_diagonal"]["hausdorff"]),
            pair("flip", 1.0, 3),
            pair("ssim", 1.0, 3),
            pair("psnr_db", 1.0, 1),
            pair("silhouette", 100.0, 2),
        ));
    }
    println!("### {heading}\n");
    println!(
        "| kept | triangles | time | draws in | mean distance | largest | FLIP | SSIM | PSNR, dB | silhouette |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    println!("{}\n", rows.join("\n"));
    Ok(())
}

/// Runs the release command and returns its JSON output.
fn object(words: &[&str], files: &[&Path]) -> Result<Value> {
    let out = program().args(words).args(files).output()?;
    ensure!(out.status.success(), "{}: {}", words[0], String::from_utf8_lossy(&out.stderr).trim());
    Ok(serde_json::from_slice(&out.stdout)?)
}

/// Returns the release command.
pub(crate) fn program() -> std::process::Command {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), Into::into);
    let name = format!("lodsmith{}", std::env::consts::EXE_SUFFIX);
    std::process::Command::new(target.join("release").join(name))
}
