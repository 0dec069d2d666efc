//! Simplification of all meshes of a scene with one budget: triangles are removed where that costs least, in
//! any mesh.
//!
//! All meshes are laid side by side in one, at the sizes that they have in the scene, and simplified in one
//! run: its threshold is the same for all. A collapse in a mesh with several instances multiplies saved
//! triangles and errors equally, so instances change only the count.

mod farthest;
mod joined;
mod layout;
mod part;
mod per_mesh;
mod touching;

use lodsmith_core::VertexId;

use crate::control::Control;
use crate::options::{SimplifyOptions, Stop};
use crate::run::{CountedGoal, is_chained};
use crate::{SimplifyError, pipeline};
use joined::JoinedScene;
use layout::PartPlacement;
pub use part::{MeshCounts, Part, Place, SimplifiedScene, Starved};

/// Reduces the number of triangles of several meshes with one budget: triangles are removed where that costs
/// least, in any mesh.
///
/// # Input
/// Each [`Part`] is a mesh in its own coordinates, with a scale and a number of instances. The counts of the
/// stop refer to all instances together. `diagonal` is the diagonal of the scene's bounding box, in the units
/// of the scene; lengths given as shares refer to it.
///
/// # Output
/// One mesh for each part, in the same order and in the units, precision, attributes and regions of that
/// part; a mesh may have lost all its faces. Counts in the report include all instances; its lengths are in
/// the units of the scene. The place of the largest distance has the number of its
/// [part](crate::ErrorReport::farthest_part), and is in the coordinates of the scene if [`Part::places`] are known (at
/// the instance where it is largest), else in those of the part.
///
/// With [`SimplifyOptions::per_mesh`] each part is simplified separately, and the stop applies to each, with
/// its instances counted once; parts that touch then do not stay connected ([`Report::gaps`](crate::Report)).
///
/// # Promises
/// Those of [`simplify`](crate::simplify()), for all parts laid side by side. Parts of one
/// [system](Part::system) that touch stay connected, and so do all parts whose borders touch at their
/// [places](Part::places), up to rounding; [`Report::gaps`](crate::Report) counts the exceptions. A proven
/// bound includes the rounding of the results to the precision of their parts. The same parts, options and
/// seed give the same bytes.
///
/// # Cost
/// That of [`simplify`](crate::simplify()) for all parts joined in one mesh, whose positions have double
/// precision: about 60 more bytes for each triangle. If meshes have different numbers of instances, the count
/// has to be searched for: up to six runs.
///
/// # Errors
/// Those of [`simplify`](crate::simplify()): [`SimplifyError::NoFaces`] if no part has a face with an area
/// (with `per_mesh`, a part without one stays as it is), [`SimplifyError::WrongLength`] if a list of
/// a part does not have one entry for each of its vertices, [`SimplifyError::Mesh`] if all parts together have
/// more elements than 32-bit ids can address.
///
/// # Panics
/// Never because of a mesh or an option.
pub fn simplify_scene(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<SimplifiedScene, SimplifyError> {
    if options.per_mesh {
        return per_mesh::simplify_each(parts, diagonal, options, control);
    }
    JoinedScene::new(parts, diagonal, options)?.run_to(&options.stop, control)
}

/// A level of a scene, and for each part the positions to which the vertices of the level before it moved,
/// where known.
pub(crate) type SceneLevel = (SimplifiedScene, Vec<Vec<Option<[f64; 3]>>>);

/// Makes the levels of a scene in one run if that meets the counts of the scene. Returns `None` if meshes
/// have different numbers of instances, only some faces belong to two-sided sheets, or the method makes each
/// level separately.
pub(crate) fn chain_of_scene(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<Option<Vec<SceneLevel>>, SimplifyError> {
    if options.per_mesh || !is_chained(options, stops) {
        return Ok(None);
    }
    let whole = JoinedScene::new(parts, diagonal, options)?;
    let goals: Vec<CountedGoal> = stops.iter().map(|stop| whole.goal(stop)).collect();
    if goals.iter().any(|goal| !whole.is_direct(goal)) {
        return Ok(None);
    }
    let own: Vec<Stop> = goals.iter().map(|goal| whole.own_stop(goal, goal.wanted())).collect();
    let made = pipeline::simplify_chain(&whole.input(), &whole.options, &own, is_traced, control)?;
    let Some((all, mergers)) = made else { return Ok(None) };
    let mut first = 0;
    let mut before: Vec<Vec<VertexId>> = Vec::with_capacity(parts.len());
    for part in parts {
        let next = first + part.mesh.vertex_count();
        before.push((first..next).map(VertexId::new).collect());
        first = next;
    }
    let mut levels = Vec::with_capacity(all.len());
    for (k, ((done, held), goal)) in all.into_iter().zip(&goals).enumerate() {
        let view = done.mesh.positions().view();
        let went = |(numbers, place): (&Vec<VertexId>, &PartPlacement)| {
            let to =
                |v: &VertexId| mergers.get(k)?.get(v.index()).filter(|to| to.index() < view.len()).copied();
            numbers.iter().map(|v| to(v).map(|to| place.to_part(view.get(to)))).collect()
        };
        let targets = before.iter().zip(&whole.layout.places).map(went).collect();
        let (meshes, numbers) = whole.split_parts(&done.mesh, &held)?;
        before = numbers;
        levels.push((whole.build_result(done.report, meshes, goal), targets));
    }
    Ok(Some(levels))
}
