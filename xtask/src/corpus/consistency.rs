//! Checks that a result agrees with its model: the bounding box in the rendered image, and the area of two-sided
//! sheets.

use std::path::{Path, PathBuf};

use anyhow::Result;
use serde_json::Value;

use super::{CorpusRow, Limits, call, one_line, value};

/// Maximum difference between a bounding box and the rendered one, as a share of the diagonal.
const MAX_BOUNDS_OFFSET: f64 = 1e-4;
/// Maximum ratio of the diagonal of a report to the rendered one: the report may add up rotated boxes of the meshes.
const MAX_DIAGONAL_RATIO: f64 = 1.8;
/// Maximum share of area that a model with two-sided sheets may lose in addition to its loss without the back sides.
const MAX_AREA_LOSS: f64 = 0.02;

/// Returns the diagonal of the bounding box of a rendered model, after comparing the box with the one of `info`.
pub(super) fn drawn_diagonal(
    command: &Path,
    file: &Path,
    info: &Value,
    limits: Limits,
    row: &mut CorpusRow,
) -> Result<Option<f64>> {
    let folder = tempfile::tempdir()?;
    let picture = folder.path().join("picture.png");
    let command_args = ["render".as_ref(), file.as_os_str(), "-o".as_ref(), picture.as_os_str()];
    let args = [command_args.as_slice(), &["--size".as_ref(), "16x16".as_ref(), "--json".as_ref()]].concat();
    let outcome = call(command, &args, limits)?;
    let Some(report) = value(&outcome).filter(|_| outcome.status == Some(0)) else {
        row.problem(format!("render: {}", one_line(&outcome)));
        return Ok(None);
    };
    let drawn = &report["pictures"][0]["bounds"];
    let corner = |bounds: &Value, end: &str| -> Option<Vec<f64>> {
        bounds[end].as_array()?.iter().map(Value::as_f64).collect()
    };
    let (Some(min), Some(max)) = (corner(drawn, "min"), corner(drawn, "max")) else { return Ok(None) };
    let diagonal = min.iter().zip(&max).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt();
    // The box of `info` includes unused vertices. It has the units and axes of the file; a 3MF file is rendered in
    // metres, with y up.
    if info["unused_vertices"] == 0 && info["non_finite_vertices"] == 0 && info["format"] != "3mf" {
        for (end, drawn) in [("min", min), ("max", max)] {
            let reported = corner(&info["bounds"], end).unwrap_or_default();
            let off = drawn.iter().zip(&reported).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if reported.len() != 3 || off > MAX_BOUNDS_OFFSET * diagonal {
                row.problem(format!("info: {end} corner {reported:?}, but rendered at {drawn:?}"));
            }
        }
    }
    Ok(Some(diagonal))
}

/// Compares the diagonal in a report with the rendered one.
pub(super) fn check_diagonal(drawn: f64, report: &Value, what: &str, row: &mut CorpusRow) {
    let reported = report["error"]["diagonal"].as_f64().unwrap_or(0.0);
    if reported < (1.0 - MAX_BOUNDS_OFFSET) * drawn || reported > MAX_DIAGONAL_RATIO * drawn {
        row.problem(format!("{what}: a diagonal of {reported:.4e}, but rendered with {drawn:.4e}"));
    }
}

/// A model with two-sided sheets, and a copy without their back sides.
pub(super) struct Sheets {
    single: PathBuf,
    /// Areas of the model and of the copy without back sides.
    area: [f64; 2],
}

impl Sheets {
    /// `None` if a model has no two-sided sheets.
    pub(super) fn of(
        command: &Path,
        file: &Path,
        info: &Value,
        single: PathBuf,
        limits: Limits,
        row: &mut CorpusRow,
    ) -> Result<Option<Self>> {
        if info["two_sided_faces"].as_u64().is_none_or(|n| n == 0) {
            return Ok(None);
        }
        let command_args = ["clean".as_ref(), file.as_os_str(), "--sheets".as_ref(), "single".as_ref()];
        let args =
            [command_args.as_slice(), &["-o".as_ref(), single.as_os_str(), "--quiet".as_ref()]].concat();
        let outcome = call(command, &args, limits)?;
        if outcome.status != Some(0) {
            row.problem(format!("clean --sheets single: {}", one_line(&outcome)));
            return Ok(None);
        }
        let area = [info["area"].as_f64(), area(command, &single, limits)?];
        let [Some(whole), Some(half)] = area else { return Ok(None) };
        Ok((half > 0.0).then_some(Self { single, area: [whole, half] }))
    }

    /// Checks that a result keeps about as much of its area as the model without back sides at the same ratio.
    pub(super) fn check(
        &self,
        command: &Path,
        (ratio, after): (f64, &Value),
        limits: Limits,
        row: &mut CorpusRow,
    ) -> Result<()> {
        let reduced = self.single.with_file_name(format!("reduced {}", file_name(&self.single)));
        let text = ratio.to_string();
        let command_args = ["simplify".as_ref(), self.single.as_os_str(), "--ratio".as_ref(), text.as_ref()];
        let args =
            [command_args.as_slice(), &["-o".as_ref(), reduced.as_os_str(), "--quiet".as_ref()]].concat();
        let outcome = call(command, &args, limits)?;
        let left = area(command, &reduced, limits)?.filter(|_| outcome.status == Some(0));
        let (Some(left), Some(after)) = (left, after["area"].as_f64()) else {
            row.problem(format!("without back sides to {ratio}: {}", one_line(&outcome)));
            return Ok(());
        };
        let (wanted, got) = (left / self.area[1], after / self.area[0]);
        if got < wanted - MAX_AREA_LOSS {
            row.problem(format!(
                "to {ratio}: {:.1} % of the area left, without back sides {:.1} %",
                100.0 * got,
                100.0 * wanted
            ));
        }
        Ok(())
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn area(command: &Path, file: &Path, limits: Limits) -> Result<Option<f64>> {
    let outcome = call(command, &["info".as_ref(), file.as_os_str(), "--json".as_ref()], limits)?;
    Ok(value(&outcome).and_then(|info| info["area"].as_f64()))
}
