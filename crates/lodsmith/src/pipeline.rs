//! One call of the library, from its input to its result, in seven steps.
//!
//! ```text
//! complete  extend known attributes where values are missing                                  `missing`
//! blend     give the vertices mean colours if each face has a colour of its own               `face_colors`
//! repeat    with looser options, while requested and needed                                   `Attempts`
//!     prepare   add temporary normals, leave out flat ones,                                   `FlatShading`,
//!               remove small parts, join near vertices                                        `Prepared`
//!     sheets    of two-sided sheets: take these four steps on the fronts, then add the backs  `TwoSidedInput`
//!     run       order, collapse or rebuild, fit, measure                                      `run`, `methods`
//!     finish    remove temporary normals, add flat ones, report what was prepared             `Prepared`
//! ```

pub(crate) mod borders;
mod escalate;
mod face_colors;
mod flat_shading;
mod missing;
pub(crate) mod prepare;
mod shading;

use crate::input::Input;
use crate::methods::{self, cluster};
use crate::options::{Method, MethodKind, SimplifyOptions, Stop};
use crate::pipeline::escalate::Attempts;
use crate::pipeline::flat_shading::FlatShading;
use crate::report::Cleanup;
use crate::run::{self, Done, Mergers, Pass};
use crate::two_sided::TwoSidedInput;
use crate::{Control, SimplifyError, constraints, two_sided};
use prepare::{Prepared, temporary_normals};

/// Runs with the options' method; again with looser options if requested and needed. Returns the locked
/// wedges at the corners of the result too.
pub(crate) fn simplify(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    check(input, options)?;
    if let Some(locked) = constraints::locks_of_map(&input.data) {
        return simplify(&input.clone().locked(&locked), options, control);
    }
    if let Some(completed) = missing::completed(input)? {
        return Ok(completed.finished(simplify(&completed.input(input), options, control)?, input));
    }
    let options = &options.with_own_placement();
    let blended = face_colors::blended(input, options)?;
    let input = &input.clone().with_mesh(blended.as_ref());
    let mut attempts = Attempts::new(options, simplify_once(input, options, control)?);
    while let Some(change) = attempts.next_change() {
        let done = simplify_once(input, &attempts.changed_options(change), control)?;
        attempts.add(change, done);
    }
    Ok(attempts.into_best())
}

fn check(input: &Input<'_>, options: &SimplifyOptions) -> Result<(), SimplifyError> {
    options.check(&input.data)?;
    constraints::check(&input.data, input.surface.positions().len())
}

fn simplify_once(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Done, SimplifyError> {
    let with_normals = temporary_normals(input, options)?;
    let flat = FlatShading::of(input, options);
    let mut prepared = Prepared::new(input, with_normals.as_ref(), flat.as_ref(), options)?;
    let mut ordered = None;
    if two_sided::is_looked_for(&prepared.input.surface, options) {
        let own = ordered.insert(run::ordered(&prepared.input, control)?);
        if let Some(sheets) = TwoSidedInput::find(input, &prepared.input, own, options)? {
            let cleanup = own.cleanup;
            ordered = None;
            let done = sheets.simplify(options, simplify_once, control)?;
            if sheets.has_no_more_opposite(&done.0.mesh) {
                return Ok(with_sheets(done, &sheets, &prepared, cleanup));
            }
        }
    }
    prepared.unpaired_sheets = ordered.as_ref().map_or(0, two_sided::unpaired_sheets);
    prepared.finish(match options.method {
        Method::Cluster { .. } => cluster::run(&prepared.input, &prepared.options, control)?,
        _ => {
            let ordered = match ordered {
                Some(ordered) => ordered,
                None => run::ordered(&prepared.input, control)?,
            };
            run::run_ordered(
                pass_of(options.method.kind()),
                &prepared.input,
                &prepared.options,
                ordered,
                control,
            )?
        }
    })
}

/// Returns a result with both sides of sheets, and what was done to the whole input in its report.
fn with_sheets(
    (mut done, held): Done,
    sheets: &TwoSidedInput<'_>,
    prepared: &Prepared<'_>,
    cleanup: Cleanup,
) -> Done {
    let duplicate_faces = done.report.cleanup.duplicate_faces + sheets.duplicates();
    done.report.cleanup = Cleanup { duplicate_faces, ..cleanup };
    prepared.report(&mut done.report);
    (done, held)
}

/// Returns the pass of a method other than clustering.
fn pass_of(method: MethodKind) -> Pass {
    run::collapses(method).unwrap_or(methods::rebuild)
}

/// Runs to one stop after another, each a count below the previous one: see [`run::is_chained`] for when this
/// is possible. With `is_traced`, returns the mergers. Returns `None` if a mesh with two-sided sheets needs a
/// search for its counts, and so separate runs for each level.
pub(crate) fn simplify_chain(
    input: &Input<'_>,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<Option<(Vec<Done>, Mergers)>, SimplifyError> {
    for stop in stops {
        SimplifyOptions { stop: *stop, ..options.clone() }.check(&input.data)?;
    }
    constraints::check(&input.data, input.surface.positions().len())?;
    if let Some(completed) = missing::completed(input)? {
        let made = simplify_chain(&completed.input(input), options, stops, is_traced, control)?;
        let finish = |(levels, mergers): (Vec<Done>, Mergers)| {
            (levels.into_iter().map(|done| completed.finished(done, input)).collect(), mergers)
        };
        return Ok(made.map(finish));
    }
    let options = &options.with_own_placement();
    let blended = match stops {
        [most, ..] => face_colors::blended(input, &SimplifyOptions { stop: *most, ..options.clone() })?,
        [] => None,
    };
    let input = &input.clone().with_mesh(blended.as_ref());
    let with_normals = temporary_normals(input, options)?;
    let flat = FlatShading::of(input, options);
    let mut prepared = Prepared::new(input, with_normals.as_ref(), flat.as_ref(), options)?;
    let ordered = run::ordered(&prepared.input, control)?;
    if let Some(sheets) = TwoSidedInput::find(input, &prepared.input, &ordered, options)? {
        let cleanup = ordered.cleanup;
        drop(ordered);
        let Some(own) = sheets.chain_stops(stops) else { return Ok(None) };
        let made = simplify_chain(&sheets.input(), options, &own, is_traced, control)?;
        let Some((levels, mergers)) = made else { return Ok(None) };
        let (levels, mergers) = sheets.both_levels(levels, &mergers, stops, options, control)?;
        let all = levels.into_iter().map(|done| with_sheets(done, &sheets, &prepared, cleanup));
        return Ok(Some((all.collect(), mergers)));
    }
    prepared.unpaired_sheets = two_sided::unpaired_sheets(&ordered);
    let (levels, mergers) =
        run::chain(&prepared.input, &prepared.options, stops, is_traced, ordered, control)?;
    let levels: Result<Vec<Done>, SimplifyError> =
        levels.into_iter().map(|done| prepared.finish(done)).collect();
    Ok(Some((levels?, mergers)))
}
