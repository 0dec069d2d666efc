//! One call of the library, from its input to its result, in four steps:
//!
//! ```text
//! prepare   lend normals, leave out flat ones, remove small parts, join near vertices          `Prepared`
//! plan      the pass of the method, and looser options while needed       `pass_of`, `Escalation`
//! run       order, collapse or rebuild, fit, measure                      `run`, `cluster`
//! finish    return what was lent, and report what the preparation did     `Prepared::finish`
//! ```

pub(crate) mod prepare;

use crate::escalate::Attempts;
use crate::flat_shading::FlatShading;
use crate::input::Input;
use crate::options::{Method, SimplifyOptions, Stop};
use crate::run::{self, Done, Mergers, Pass};
use crate::{Control, SimplifyError, cluster, constraints, rebuild};
use prepare::{Prepared, lent_normals};

/// Runs with the options' method; again with looser options if requested and needed. Returns the locked
/// wedges at the corners of the result too.
pub(crate) fn simplify(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    check(input, options)?;
    let options = &options.with_own_placement();
    let mut attempts = Attempts::new(options, simplify_once(input, options, control)?);
    while let Some(change) = attempts.next_change() {
        let done = simplify_once(input, &attempts.changed_options(change), control)?;
        attempts.add(change, done);
    }
    Ok(attempts.into_best())
}

fn check(input: &Input<'_>, options: &SimplifyOptions) -> Result<(), SimplifyError> {
    options.check()?;
    constraints::check(options, input.surface.positions().len())
}

fn simplify_once(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let lent = lent_normals(input, options)?;
    let flat = FlatShading::of(input, options);
    let prepared = Prepared::new(input, lent.as_ref(), flat.as_ref(), options)?;
    let done = match options.method {
        Method::Cluster => cluster::run(&prepared.input, &prepared.options, control)?,
        method => run::run_with(pass_of(method), &prepared.input, &prepared.options, control)?,
    };
    prepared.finish(done)
}

/// Returns the pass of a method other than clustering.
fn pass_of(method: Method) -> Pass {
    run::collapses(method).unwrap_or(rebuild::pass)
}

/// Runs to one stop after another, each a count below the previous one: see [`run::is_chained`] for when this
/// is possible. With `is_traced`, returns the mergers.
pub(crate) fn simplify_chain(
    input: &Input<'_>,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<(Vec<Done>, Mergers), SimplifyError> {
    for stop in stops {
        SimplifyOptions { stop: *stop, ..options.clone() }.check()?;
    }
    constraints::check(options, input.surface.positions().len())?;
    let options = &options.with_own_placement();
    let lent = lent_normals(input, options)?;
    let flat = FlatShading::of(input, options);
    let prepared = Prepared::new(input, lent.as_ref(), flat.as_ref(), options)?;
    let (levels, mergers) = run::chain(&prepared.input, &prepared.options, stops, is_traced, control)?;
    let levels: Result<Vec<Done>, SimplifyError> =
        levels.into_iter().map(|done| prepared.finish(done)).collect();
    Ok((levels?, mergers))
}
