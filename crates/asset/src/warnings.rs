//! Warnings of files and of runs, reasons why a target was not reached, and the spelling of options in them.

use lodsmith::{MeshCounts, Report, SimplifyOptions, Starved};
use lodsmith_core::TriMesh;
use lodsmith_core::numbers::{counted, grouped};
use lodsmith_core::topology::Topology;
use lodsmith_io::Warning;

use crate::proposals;

/// Spelling of option names in messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spelling {
    /// `--per-mesh`, as in all messages of this crate.
    #[default]
    CommandLine,
    /// `per_mesh`, as in keyword arguments.
    Keyword,
    /// `perMesh`, as in properties of an object.
    Property,
    /// `per mesh`, as in labels of controls.
    Words,
}

impl Spelling {
    /// Returns a text with the names of options spelled this way.
    pub fn apply(self, text: &str) -> String {
        if self == Self::CommandLine {
            return text.to_owned();
        }
        let mut spelled = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(at) = rest.find("--") {
            let (before, option) = (&rest[..at], &rest[at + 2..]);
            let is_name = |c: char| c.is_ascii_lowercase() || c == '-';
            let end = option.find(|c| !is_name(c)).unwrap_or(option.len());
            let (name, after) = option.split_at(end);
            let starts_word = before.chars().next_back().is_none_or(|c| c == '(' || c.is_whitespace());
            // After the name, a path would continue.
            let ends_word = after.chars().next().is_none_or(|c| c.is_whitespace() || ",;:)]".contains(c));
            spelled.push_str(before);
            if name.starts_with(|c: char| c.is_ascii_lowercase()) && starts_word && ends_word {
                spelled.push_str(&self.name(name));
            } else {
                spelled.extend(["--", name]);
            }
            rest = after;
        }
        spelled + rest
    }

    fn name(self, name: &str) -> String {
        match self {
            Self::CommandLine => format!("--{name}"),
            Self::Keyword => name.replace('-', "_"),
            Self::Words => name.replace('-', " "),
            Self::Property => {
                let mut parts = name.split('-');
                let mut spelled = parts.next().unwrap_or_default().to_owned();
                for part in parts {
                    let (first, others) = part.split_at(part.len().min(1));
                    spelled.extend([&first.to_ascii_uppercase(), others]);
                }
                spelled
            }
        }
    }
}

/// Returns the warnings that matter if a mesh is only viewed, not written.
pub fn viewing_warnings(warnings: &[Warning]) -> Vec<Warning> {
    warnings.iter().filter(|warning| !warning.of_scene).cloned().collect()
}

/// Returns the texts of warnings, for reports.
pub fn texts(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.text.as_str()).collect()
}

/// Returns the warnings of a run.
pub fn warnings_of(report: &Report) -> Vec<Warning> {
    let mut warnings: Vec<_> = dropped(report).collect();
    if report.cleanup.non_finite_faces > 0 {
        let faces = counted(report.cleanup.non_finite_faces, "face has", "faces have");
        warnings.push(Warning::lost(format!("{faces} a position that is not finite: removed")));
    }
    if report.error.is_incomplete {
        warnings.push(match report.error.measured {
            Some(_) => Warning::lost("time limit: the distance from the original is not proven"),
            None => not_measured(),
        });
    }
    if report.seams_relaxed {
        warnings.push(Warning::note("seams were moved off their lines to get closer to the target"));
    }
    if report.sharp_relaxed {
        warnings.push(Warning::note("some sharp edges were not preserved, to get closer to the target"));
    }
    if report.gaps > 0 {
        let places = counted(report.gaps, "place", "places");
        warnings.push(Warning::lost(format!("touching meshes separated at {places}: gaps may be visible")));
    }
    if report.unpaired_sheets > 0 {
        let sheets = counted(report.unpaired_sheets, "sheet", "sheets");
        warnings.push(Warning::lost(format!(
            "{sheets} with two sides not simplified as one, because the sides have different triangles: area may be missing"
        )));
    }
    warnings.extend(report.escalated.iter().map(|step| Warning::note(proposals::step_text(step))));
    if report.pruned.largest_kept {
        warnings.push(Warning::note("all parts are smaller than --prune: the largest was kept"));
    }
    warnings
}

/// Returns the warning that the time limit left no time to measure a result.
pub fn not_measured() -> Warning {
    Warning::lost("time limit: the distance from the original is not measured")
}

/// Returns a warning about meshes that lost their shape because all meshes share one target; `None` if there are none.
pub fn starved(counts: &[MeshCounts]) -> Option<Warning> {
    let starved = Starved::of(counts)?;
    Some(Warning::note(format!("{starved}; --per-mesh gives each mesh its own target")))
}

/// Returns the warning that `--per-mesh` has no effect because the meshes are merged.
pub(crate) fn joined_per_mesh() -> Warning {
    Warning::note("--per-mesh has no effect: this output format merges all meshes into one")
}

/// Returns warnings about attributes that the engine drops.
fn dropped(report: &Report) -> impl Iterator<Item = Warning> {
    let lost = |name: &&str| Warning::lost(format!("{name} dropped: a skin needs both joints and weights"));
    report.dropped.iter().map(lost)
}

/// Returns the reason why a run did not reach its target, and the proposals; `None` if it reached the target.
pub fn not_reached<'a>(
    report: &Report,
    options: &SimplifyOptions,
    time_limit: Option<f64>,
    result: impl IntoIterator<Item = &'a TriMesh>,
) -> Option<String> {
    if report.reached {
        return None;
    }
    let mut text = format!("target not reached, stopped by {}", report.stopped_by.name().replace('_', " "));
    let refusals = refusals(report);
    if !refusals.is_empty() {
        text += &format!("; refused: {refusals}");
    }
    let is_open = |mesh: &TriMesh| Topology::new(&mesh.surface()).counts().border_edge_count > 0;
    let has_border = || result.into_iter().any(is_open);
    if let Some(help) = proposals::text(report, options, time_limit, has_border) {
        text += &format!("; {help}");
    }
    Some(text)
}

/// Returns the refusals and their counts as text.
pub fn refusals(report: &Report) -> String {
    let of = |(r, n): &(lodsmith::Refusal, u64)| {
        format!("{} {}", r.name().replace('_', " "), grouped(usize::try_from(*n).unwrap_or(usize::MAX)))
    };
    report.refusals.iter().map(of).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_spelled_for_the_caller() {
        let text = "a higher --max-normal (now 30) would go further; --per-mesh gives each its own [or --max-normal]: x--y -- -- --low.ply";
        let of = |spelling: Spelling| spelling.apply(text);
        assert_eq!(of(Spelling::CommandLine), text);
        let expected = |max: &str, mesh: &str| {
            format!(
                "a higher {max} (now 30) would go further; {mesh} gives each its own [or {max}]: x--y -- -- --low.ply"
            )
        };
        assert_eq!(of(Spelling::Keyword), expected("max_normal", "per_mesh"));
        assert_eq!(of(Spelling::Property), expected("maxNormal", "perMesh"));
        assert_eq!(of(Spelling::Words), expected("max normal", "per mesh"));
    }
}
