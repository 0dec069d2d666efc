//! Arguments shared by all commands that simplify: targets, method, constraints.

use clap::Args;
use lodsmith::{BorderPolicy, Fit, Guards, Method, Placement, Preset, SimplifyOptions, Stop, TopologyPolicy};
use serde_json::{Map, Value};

use super::of_method::OfMethod;
use super::scope::Scope;
use super::weights::{self, AttributeName, Importance};
use super::{TypedLength, choice, values};

/// Target of a run.
#[derive(Args, Debug)]
pub(crate) struct Target {
    /// Stop at N triangles
    #[arg(long, value_name = "N", value_parser = values::count)]
    faces: Option<usize>,
    /// Stop at N vertices
    #[arg(long, value_name = "N", value_parser = values::count)]
    vertices: Option<usize>,
    /// Keep this fraction of the triangles (0.1 or 10%)
    #[arg(long, value_name = "R", value_parser = values::ratio)]
    ratio: Option<f64>,
    /// Keep the deviation below D, in units of the file or as a share of the diagonal (0.1%)
    #[arg(long, value_name = "D")]
    error: Option<TypedLength>,
}

impl Target {
    /// Returns true if any target is set.
    pub(crate) fn is_given(&self) -> bool {
        self.faces.is_some() || self.vertices.is_some() || self.ratio.is_some() || self.error.is_some()
    }

    /// Converts the target to a stop of the engine.
    pub(super) fn stop(&self) -> Stop {
        Stop {
            faces: self.faces,
            vertices: self.vertices,
            ratio: self.ratio,
            error: self.error.as_ref().map(|e| e.length),
        }
    }

    /// Returns the target by name, for reports.
    pub(crate) fn to_json(&self) -> Value {
        let all = [
            ("faces", self.faces.map(Value::from)),
            ("vertices", self.vertices.map(Value::from)),
            ("ratio", self.ratio.map(Value::from)),
            ("error", self.error.as_ref().map(TypedLength::to_json)),
        ];
        Value::Object(all.into_iter().filter_map(|(k, v)| Some((k.to_owned(), v?))).collect::<Map<_, _>>())
    }
}

/// Options of a run besides its target.
#[derive(Args, Debug)]
pub(crate) struct EngineArgs {
    #[command(flatten)]
    pub(crate) how: How,
    #[command(flatten)]
    of_method: OfMethod,
    #[command(flatten)]
    scope: Scope,
    #[command(flatten)]
    guards: GuardArgs,
    /// Seed of the samples; equal seeds give equal results
    #[arg(long, value_name = "N", default_value_t = SimplifyOptions::default().seed, help_heading = "Simplification")]
    seed: u64,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Simplification")]
pub(crate) struct How {
    /// Set several options for a purpose, see below; explicit options override it
    #[arg(long, value_name = "PURPOSE", value_parser = choice(Preset::ALL, Preset::name),
          default_value = Preset::default().name())]
    preset: Preset,
    /// Simplification method, see below
    #[arg(long, value_name = "METHOD", value_parser = choice(Method::ALL, Method::name),
          default_value = Method::default().name())]
    method: Method,
    /// Fit the result to the original by least squares at the end
    #[arg(long, value_name = "WHEN", value_parser = choice(Fit::ALL, Fit::name),
          default_value = Fit::default().name())]
    fit: Fit,
    /// Position of a merged vertex: the one with the least error, an end of the edge (so that the vertices are a subset of
    /// those of the input), or its midpoint
    #[arg(long, value_name = "POSITION", value_parser = choice(Placement::ALL, Placement::name),
          default_value = Placement::default().name())]
    placement: Placement,
    /// Treatment of open borders: keep their shape, slide along them, lock them, or ignore them (free) [default: keep, or by
    /// preset]
    #[arg(long, value_name = "POLICY", value_parser = choice(BorderPolicy::ALL, BorderPolicy::name))]
    border: Option<BorderPolicy>,
    /// Permitted changes of the topology: parts and handles if the target needs it (relaxed), none (preserve), or those
    /// that cost least (free) [default: relaxed, or by preset]
    #[arg(long, value_name = "POLICY", value_parser = choice(TopologyPolicy::ALL, TopologyPolicy::name))]
    topology: Option<TopologyPolicy>,
    /// Preserve edges whose faces meet at more than DEG degrees [default: off]
    #[arg(long, value_name = "DEG", value_parser = values::sharp_deg)]
    sharp: Option<f64>,
    /// Multiply the weight of an attribute in the cost (normal, uv, color, morph, skin, other), or of the lines of
    /// open borders (border), by W; may be repeated
    #[arg(long, value_name = "NAME=W", value_parser = weights::weight)]
    weight: Vec<(AttributeName, f64)>,
    /// Keep this unchanged, bit for bit: a material, group, object, mesh or node, or the vertices where this attribute is
    /// not zero; may be repeated
    #[arg(long, value_name = "NAME")]
    pub(crate) lock: Vec<String>,
    /// Keep more triangles where this attribute of vertices is large: at 1, or at the largest value if that is above 1,
    /// STRENGTH times as many per area as at 0 [default STRENGTH: 4]
    #[arg(long, value_name = "NAME[=STRENGTH]", value_parser = weights::importance)]
    pub(crate) importance: Option<Importance>,
    /// Merge vertices closer than D first (coincident vertices are always merged); 0 turns off the weld of a preset
    #[arg(long, value_name = "D")]
    weld: Option<TypedLength>,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Guards of the result")]
struct GuardArgs {
    /// Reject steps that turn a face by more than DEG degrees; the final fit is one step
    #[arg(long, value_name = "DEG", value_parser = values::turn_deg)]
    max_normal: Option<f64>,
    /// Reject faces of lower quality than this, from 0 to 1 (equilateral), unless they were worse before
    #[arg(long, value_name = "Q", value_parser = values::quality)]
    min_quality: Option<f64>,
    /// Reject vertices with more edges than this, unless they had more before
    #[arg(long, value_name = "N", value_parser = values::valence)]
    max_valence: Option<usize>,
    /// Reject longer edges than this, unless they were longer before
    #[arg(long, value_name = "D", value_parser = values::some_length)]
    max_edge: Option<TypedLength>,
}

impl EngineArgs {
    /// Returns the engine's options for this stop.
    pub(super) fn options(&self, stop: Stop) -> SimplifyOptions {
        let (how, guards) = (&self.how, &self.guards);
        let mut options = SimplifyOptions::preset(how.preset, stop);
        options.method = how.method;
        options.method_options = self.of_method.options();
        options.fit = how.fit;
        options.placement = how.placement;
        options.border = how.border.unwrap_or(options.border);
        options.topology = how.topology.unwrap_or(options.topology);
        options.sharp_deg = how.sharp;
        for (name, weight) in &how.weight {
            *name.of(&mut options.weights) = *weight;
        }
        if let Some(distance) = &how.weld {
            options.weld = (!distance.is_zero()).then_some(distance.length);
        }
        options.guards = Guards {
            max_normal_deg: guards.max_normal,
            min_quality: guards.min_quality,
            max_valence: guards.max_valence,
            max_edge: guards.max_edge.as_ref().map(|d| d.length),
        };
        self.scope.apply(&mut options);
        options.seed = self.seed;
        options
    }
}
