//! Simplification of an index buffer that moves vertices and changes their attributes.

use lodsmith::options::QuickPass;
use lodsmith::{BorderPolicy, Input, NoControl, SimplifyOptions, Stop, TopologyPolicy, simplify_with};
use lodsmith_core::correspondence::{Source, correspondence};
use lodsmith_core::mesh::Morphed;
use lodsmith_core::{Attribute, Positions, Semantic, TriMesh, WedgeId};

use super::error::IndexError;
use super::quick::{QuickInput, data_of_flags};

/// Values per morph target.
const TARGET_WIDTH: usize = 3;

/// Factor on the error estimate of a run that moves vertices, so that an error limit leaves about as many triangles as
/// in meshoptimizer, whose error is the error of the collapses, before vertices move. (Measured on seven models at
/// .01.)
const ESTIMATE_FACTOR: f64 = 1.7;

/// The result of a run that moves vertices.
pub(crate) struct UpdateResult {
    /// Three vertices of the input for each face: where the moved vertices are stored.
    pub(crate) faces: Vec<[u32; 3]>,
    /// For each changed vertex, its index, position and attributes.
    pub(crate) vertices: Vec<(u32, [f32; 3], Vec<f32>)>,
    pub(crate) error: f64,
}

/// Attributes that are moved with the vertices.
pub(crate) struct MovedValues {
    /// `weights.len()` values for each vertex.
    pub(crate) values: Vec<f32>,
    /// Weights above 0: with weight w, a difference of 1 over an edge counts like a distance of w times `length`.
    pub(crate) weights: Vec<f32>,
    /// The edge length of the result.
    pub(crate) length: f64,
}

/// Simplifies with optimal placement. Attributes count like offsets of a position, which are distances.
pub(crate) fn run(input: &QuickInput, moved: &MovedValues) -> Result<UpdateResult, IndexError> {
    let mesh = with_values(input, moved)?;
    let limit = input.error_limit;
    let data = data_of_flags(input.flags.as_deref());
    let run = Input::new(&mesh).with(data.view());
    let done = simplify_with(&run, &options(input), &mut NoControl)?;
    let error = input.error(ESTIMATE_FACTOR * done.report.error.estimate).min(limit.unwrap_or(f64::INFINITY));
    stored(&mesh, &done.mesh, moved, error)
}

fn options(input: &QuickInput) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::faces(input.target_faces));
    options.quick = Some(QuickPass {
        max_estimate: input.largest_estimate(1.0 / ESTIMATE_FACTOR),
        move_weight: input.rules.move_weight(),
    });
    options.border = if input.rules.locks_border { BorderPolicy::Lock } else { BorderPolicy::Keep };
    options.topology = if input.rules.prunes { TopologyPolicy::Free } else { TopologyPolicy::Preserve };
    options
}

/// Returns the factor from an attribute to the offset that represents it in the cost.
fn scale(moved: &MovedValues, k: usize) -> f32 {
    (f64::from(moved.weights[k]) * moved.length) as f32
}

/// Returns the mesh with its attributes as offsets of morph targets.
fn with_values(input: &QuickInput, moved: &MovedValues) -> Result<TriMesh, IndexError> {
    let mut mesh = TriMesh::new(Positions::F32(input.positions.clone()), input.triangles.clone())?;
    let width = moved.weights.len();
    for target in 0..width.div_ceil(TARGET_WIDTH) {
        let columns = target * TARGET_WIDTH..(target + 1) * TARGET_WIDTH;
        let of = |row: &[f32]| -> Vec<f32> {
            columns.clone().map(|k| row.get(k).map_or(0.0, |x| x * scale(moved, k))).collect()
        };
        let values = moved.values.chunks_exact(width).flat_map(of).collect();
        let semantic = Semantic::Morph { target: target as u16, of: Morphed::Position };
        mesh.add_attribute(Attribute { semantic, width: TARGET_WIDTH, values })?;
    }
    Ok(mesh)
}

/// Finds a vertex of the input to store each wedge of a result: the same vertex if the wedge was kept, else the nearest
/// free vertex.
fn stored(
    mesh: &TriMesh,
    result: &TriMesh,
    moved: &MovedValues,
    error: f64,
) -> Result<UpdateResult, IndexError> {
    let from = correspondence(mesh, result).map_err(|error| IndexError::Internal(error.to_string()))?;
    let mut place: Vec<Option<WedgeId>> = vec![None; result.wedge_count()];
    let mut is_taken = vec![false; mesh.wedge_count()];
    // First the wedges that were kept.
    for is_kept in [true, false] {
        for w in (0..result.wedge_count()).map(WedgeId::new) {
            if matches!(from.sources()[w.index()], Source::Wedge(_)) != is_kept {
                continue;
            }
            let mut near = from.blend(w).into_iter().flatten().collect::<Vec<_>>();
            near.sort_by(|a, b| b.1.total_cmp(&a.1));
            let free = near.into_iter().map(|x| x.0).find(|w| !is_taken[w.index()]);
            if let Some(free) = free {
                place[w.index()] = Some(free);
                is_taken[free.index()] = true;
            }
        }
    }
    let mut free = (0..mesh.wedge_count()).map(WedgeId::new).filter(|w| !is_taken[w.index()]);
    let place: Option<Vec<WedgeId>> = place.into_iter().map(|known| known.or_else(|| free.next())).collect();
    let place = place.ok_or_else(|| IndexError::Internal("more vertices than before".to_owned()))?;

    let faces = result.triangles().iter().map(|t| t.map(|w| place[w.index()].0)).collect();
    let width = moved.weights.len();
    let positions = result.positions().view();
    let targets: Vec<&Attribute> = result.further_attributes().iter().collect();
    let vertex = |(w, place): (WedgeId, &WedgeId)| {
        let p = positions.get(result.vertex_of(w)).map(|x| x as f32);
        let value = |k: usize| {
            let target = targets.get(k / TARGET_WIDTH).map_or(0.0, |a| a.of(w)[k % TARGET_WIDTH]);
            target / scale(moved, k)
        };
        (place.0, p, (0..width).map(value).collect())
    };
    let vertices = (0..result.wedge_count()).map(WedgeId::new).zip(&place).map(vertex).collect();
    Ok(UpdateResult { faces, vertices, error })
}
