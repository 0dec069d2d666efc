//! Text and JSON of proposals: changes of the options that would let a stuck run continue.

use lodsmith::{BorderPolicy, Change, Escalation, Length, Proposal, Report, SimplifyOptions, StoppedBy};
use lodsmith_core::numbers::grouped;
use serde_json::{Value, json};

/// An option, its current value, and the value that it would need.
struct OptionChange {
    option: &'static str,
    now: Value,
    to: String,
    /// True if `to` is a value of the option, false if it is a direction such as "higher".
    is_value: bool,
}

impl OptionChange {
    fn of(change: Change, options: &SimplifyOptions) -> Self {
        let policy =
            |option, now: &str, to: &str| Self { option, now: now.into(), to: to.to_owned(), is_value: true };
        let guard = |option, now, to: &str| Self { option, now, to: to.to_owned(), is_value: false };
        let guards = &options.guards;
        match change {
            Change::Border(to) => policy("border", options.border.name(), to.name()),
            Change::Topology(to) => policy("topology", options.topology.name(), to.name()),
            Change::Placement(to) => policy("placement", options.placement.name(), to.name()),
            Change::MaxNormal => guard("max-normal", json!(guards.max_normal_deg), "higher"),
            Change::MinQuality => guard("min-quality", json!(guards.min_quality), "lower"),
            Change::MaxValence => guard("max-valence", json!(guards.max_valence), "higher"),
            Change::MaxEdge => {
                let now = match guards.max_edge {
                    Some(Length::Units(x)) => json!(x),
                    Some(share) => json!(length(share)),
                    None => Value::Null,
                };
                guard("max-edge", now, "higher")
            }
            Change::Locked => guard("lock", Value::Null, "less"),
            Change::Pairs(distance) => {
                Self { option: "pairs", now: Value::Null, to: length(distance), is_value: true }
            }
        }
    }

    fn text(&self) -> String {
        let Self { option, to, .. } = self;
        let now = match &self.now {
            Value::String(word) => word.clone(),
            Value::Number(x) => x.as_f64().map_or_else(|| x.to_string(), |x| x.to_string()),
            other => other.to_string(),
        };
        match self.is_value {
            true if self.now.is_null() => format!("--{option} {to}"),
            false if self.now.is_null() => format!("{to} --{option}"),
            true => format!("--{option} {to} (now {now})"),
            false => format!("a {to} --{option} (now {now})"),
        }
    }
}

/// Formats a length as on the command line.
fn length(length: Length) -> String {
    match length {
        Length::Units(x) => x.to_string(),
        Length::OfDiagonal(x) => format!("{}%", 100.0 * x),
    }
}

/// Returns a step of an escalation as text.
pub(crate) fn step_text(step: &Escalation) -> String {
    let Escalation { change, before, after, .. } = *step;
    let change = OptionChange::of(change, &SimplifyOptions::default());
    let result = match after < before {
        true => format!("{} → {} faces", grouped(before), grouped(after)),
        false => format!("no fewer than {} faces", grouped(before)),
    };
    format!("escalated to --{} {}: {result}", change.option, change.to)
}

/// Returns the steps of an escalation as JSON.
pub(crate) fn steps_json(report: &Report) -> Value {
    let of = |step: &Escalation| {
        let change = OptionChange::of(step.change, &SimplifyOptions::default());
        json!({ "option": change.option, "to": change.to, "before": step.before, "after": step.after })
    };
    report.escalated.iter().map(of).collect()
}

/// Returns the proposals as text, or other advice if there are none. `has_border` is called only if the advice depends
/// on whether the result has open borders.
pub(crate) fn text(
    report: &Report,
    options: &SimplifyOptions,
    time_limit: Option<f64>,
    has_border: impl FnOnce() -> bool,
) -> Option<String> {
    match (report.stopped_by, time_limit) {
        (StoppedBy::Caller, Some(s)) => Some(format!("a higher --time-limit (now {s}) would go further")),
        (StoppedBy::Refusals, _) if report.proposals.is_empty() => {
            // (With free borders, costs differ, so that a new run does other collapses.)
            let holds_border = options.border != BorderPolicy::Free && has_border();
            let advice = if holds_border { "; a new run with --border free may remove more" } else { "" };
            Some(format!("no option permits more collapses{advice}"))
        }
        (StoppedBy::Refusals, _) => {
            let of = |p: &Proposal| {
                p.changes
                    .iter()
                    .map(|c| OptionChange::of(*c, options).text())
                    .collect::<Vec<_>>()
                    .join(" together with ")
            };
            let all: Vec<_> = report.proposals.iter().map(of).collect();
            Some(format!("{} would go further", all.join(", or ")))
        }
        _ => None,
    }
}

/// Returns the proposals as JSON.
pub(crate) fn to_json(report: &Report, options: &SimplifyOptions) -> Value {
    let change = |c: &Change| {
        let change = OptionChange::of(*c, options);
        json!({ "option": change.option, "now": change.now, "to": change.to })
    };
    let of =
        |p: &Proposal| json!({ "changes": p.changes.iter().map(change).collect::<Vec<_>>(), "gain": p.gain });
    report.proposals.iter().map(of).collect()
}
