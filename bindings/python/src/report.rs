//! JSON reports with the names that this package had before it shared those of the command.

use lodsmith::CleanReport;
use lodsmith::core::measure::Comparison;
use lodsmith_asset::report_json;
use serde_json::{Value, json};

/// Returns a comparison as JSON.
pub(crate) fn comparison(c: &Comparison) -> Value {
    let mut all = report_json::comparison(c);
    (all["normal_mean_deg"], all["normal_p95_deg"]) = (c.normal_mean_deg.into(), c.normal_p95_deg.into());
    all
}

/// Returns the report of a clean-up.
pub(crate) fn cleaned(r: &CleanReport) -> Value {
    let mut all = report_json::cleaned(r);
    let [done, left] = ["done", "left"].map(|key| all[key].clone());
    report_json::extend(&mut all, done);
    all["remaining"] = left;
    all["pruned"] = json!({ "parts": r.pruned.parts, "faces": r.pruned.faces });
    all
}
