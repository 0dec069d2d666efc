//! Simplification of index buffers, with the arguments and flags of the functions of meshoptimizer.

mod error;
pub mod flags;
mod position_table;
mod quick;
mod update;
mod used;

use lodsmith_core::VertexId;

pub use error::IndexError;
use quick::{QuickInput, QuickRules};
use update::MovedValues;
use used::UsedVertices;

/// Largest number of attributes. (As many as meshoptimizer takes.)
const MAX_ATTRIBUTES: usize = 32;

/// An index buffer, its vertices, and the target of the simplification.
pub struct IndexCall<'a> {
    /// Three indices for each triangle.
    pub indices: &'a [u32],
    /// Number of vertices.
    pub vertex_count: usize,
    /// Returns the position of a vertex, by its index.
    pub position: &'a dyn Fn(usize) -> [f32; 3],
    /// Attributes in the cost.
    pub attributes: Option<IndexAttributes<'a>>,
    /// Returns the flags of a vertex: `flags::VERTEX_...`.
    pub vertex_flags: Option<&'a dyn Fn(usize) -> u8>,
    /// Number of indices to reach.
    pub target_index_count: usize,
    /// Largest error, as a fraction of the largest extent, unless the flags specify another unit.
    pub target_error: f32,
    /// `flags::...`
    pub flags: u32,
}

/// Attributes of the vertices.
#[derive(Clone, Copy)]
pub struct IndexAttributes<'a> {
    /// Returns an attribute of a vertex.
    pub value: &'a dyn Fn(usize, usize) -> f32,
    /// Weight of each attribute. Attributes with weight 0 are not read.
    pub weights: &'a [f32],
}

/// The remaining indices, and the estimate of the error.
#[derive(Clone, Debug, PartialEq)]
pub struct IndexResult {
    /// Three indices of input vertices for each triangle.
    pub indices: Vec<u32>,
    /// Estimate of the error, in the unit of the call.
    pub error: f32,
}

/// The remaining indices, and the vertices that have changed.
#[derive(Clone, Debug, PartialEq)]
pub struct UpdateResult {
    /// Three indices of input vertices for each triangle; some of the vertices have moved.
    pub indices: Vec<u32>,
    /// Estimate of the error, in the unit of the call.
    pub error: f32,
    /// The vertices that have new values.
    pub vertices: Vec<UpdatedVertex>,
    /// The attributes to which the values of the vertices belong.
    pub columns: Vec<usize>,
}

/// New values of a vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct UpdatedVertex {
    /// Its index.
    pub index: u32,
    /// Its position.
    pub position: [f32; 3],
    /// Its attributes with a weight above 0.
    pub values: Vec<f32>,
}

/// Simplifies an index buffer without changing vertices.
///
/// # Errors
/// [`IndexError::Argument`] for indices out of range, a number of indices that is not a multiple of three, unknown
/// flags, and weights or limits that are negative or not numbers; [`IndexError::Engine`] if no face has an area.
pub fn simplify_indices(call: &IndexCall<'_>) -> Result<IndexResult, IndexError> {
    if call.indices.is_empty() {
        return Ok(IndexResult { indices: Vec::new(), error: 0.0 });
    }
    let (mut input, frame) = call.prepare()?;
    input.values = call.columns()?.map(|columns| columns.of(&frame.used, |weight| weight));
    let result = input.run()?;
    Ok(IndexResult { indices: frame.of_input(&result.faces), error: frame.error(result.error) })
}

/// Simplifies an index buffer and moves vertices, with their attributes, to minimise the error.
///
/// # Errors
/// Those of [`simplify_indices`].
pub fn simplify_with_update(call: &IndexCall<'_>) -> Result<UpdateResult, IndexError> {
    let unchanged = || UpdateResult {
        indices: call.indices.to_vec(),
        error: 0.0,
        vertices: Vec::new(),
        columns: Vec::new(),
    };
    if call.indices.is_empty() {
        return Ok(unchanged());
    }
    let (input, frame) = call.prepare()?;
    let columns = call.columns()?;
    if input.target_faces >= input.triangles.len() {
        return Ok(unchanged());
    }
    let moved = MovedValues {
        values: columns.as_ref().map_or_else(Vec::new, |a| a.of(&frame.used, |_| 1.0)),
        weights: columns.iter().flat_map(|a| a.columns.iter().map(|column| column.1)).collect(),
        length: edge_length(&input),
    };
    let result = update::run(&input, &moved)?;
    let vertices = result.vertices.into_iter().map(|(v, position, values)| UpdatedVertex {
        index: frame.used.indices[v as usize],
        position,
        values,
    });
    Ok(UpdateResult {
        indices: frame.of_input(&result.faces),
        error: frame.error(result.error),
        vertices: vertices.collect(),
        columns: columns.iter().flat_map(|a| a.columns.iter().map(|column| column.0)).collect(),
    })
}

/// The used vertices of a call, and the unit of its errors.
struct CallFrame {
    used: UsedVertices,
    /// Unit of errors.
    unit: f64,
}

impl CallFrame {
    fn of_input(&self, faces: &[[u32; 3]]) -> Vec<u32> {
        faces.as_flattened().iter().map(|&v| self.used.indices[v as usize]).collect()
    }

    /// Converts an error to the unit of the call.
    fn error(&self, error: f64) -> f32 {
        if self.unit > 0.0 { (error / self.unit) as f32 } else { 0.0 }
    }
}

impl<'a> IndexCall<'a> {
    fn prepare(&self) -> Result<(QuickInput, CallFrame), IndexError> {
        let unknown = self.flags & !flags::ALL;
        if unknown != 0 {
            return Err(IndexError::Argument(format!("unknown bits in the options: {unknown:#x}")));
        }
        if self.target_error.is_nan() || self.target_error < 0.0 {
            return Err(IndexError::Argument(format!("the target error is {}", self.target_error)));
        }
        let has = |flag: u32| self.flags & flag != 0;
        let used = UsedVertices::new(self.indices, self.vertex_count)?;
        let points: Vec<[f32; 3]> = used.indices.iter().map(|&i| (self.position)(i as usize)).collect();
        let extent = match has(flags::SPARSE) {
            true => largest_extent(points.iter().copied()),
            false => largest_extent((0..self.vertex_count).map(self.position)),
        };
        let unit = if has(flags::ERROR_ABSOLUTE) { 1.0 } else { extent };
        let limit = f64::from(self.target_error) * unit;
        let regularity = match () {
            () if has(flags::REGULARIZE) => 2,
            () => u8::from(has(flags::REGULARIZE_LIGHT)),
        };
        let input = QuickInput {
            positions: points,
            triangles: used.triangles.clone(),
            values: None,
            flags: self.vertex_flags.map(|of| used.indices.iter().map(|&i| of(i as usize)).collect()),
            target_faces: self.target_index_count / 3,
            // No error can exceed twice the extent.
            error_limit: (limit < 2.0 * extent).then_some(limit),
            extent,
            rules: QuickRules {
                locks_border: has(flags::LOCK_BORDER),
                prunes: has(flags::PRUNE),
                regularity,
                is_permissive: has(flags::PERMISSIVE),
            },
        };
        Ok((input, CallFrame { used, unit }))
    }

    /// Returns the attributes with a weight above 0; `None` if there are none.
    fn columns(&self) -> Result<Option<Columns<'a>>, IndexError> {
        let Some(attributes) = self.attributes else { return Ok(None) };
        let count = attributes.weights.len();
        if count > MAX_ATTRIBUTES {
            return Err(IndexError::Argument(format!("{count} attributes are more than {MAX_ATTRIBUTES}")));
        }
        if let Some(bad) = attributes.weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return Err(IndexError::Argument(format!("a weight of an attribute is {bad}")));
        }
        let weights = attributes.weights.iter().copied().enumerate();
        let columns: Vec<(usize, f32)> = weights.filter(|x| x.1 > 0.0).collect();
        Ok((!columns.is_empty()).then_some(Columns { value: attributes.value, columns }))
    }
}

/// Returns the largest side of the bounding box of the finite points.
fn largest_extent(points: impl Iterator<Item = [f32; 3]>) -> f64 {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for p in points.filter(|p| p.iter().all(|x| x.is_finite())) {
        for k in 0..3 {
            (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
        }
    }
    (0..3).map(|k| f64::from(max[k]) - f64::from(min[k])).fold(0.0, f64::max)
}

/// Returns the edge length of a result with the target number of faces, if all faces were equilateral. Without a target
/// number, assumes a quarter of the faces.
fn edge_length(input: &QuickInput) -> f64 {
    let doubled = |t: &[VertexId; 3]| {
        let [a, b, c] = t.map(|v| input.positions[v.index()].map(f64::from));
        let [p, q] = [b, c].map(|x| [x[0] - a[0], x[1] - a[1], x[2] - a[2]]);
        let n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        n.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let area = 0.5 * input.triangles.iter().map(doubled).filter(|x| x.is_finite()).sum::<f64>();
    let quarter = (input.triangles.len() / 4).max(1);
    let count = if input.target_faces > 0 { input.target_faces } else { quarter };
    (area / (3.0f64.sqrt() / 4.0 * count as f64)).sqrt()
}

/// The attributes of a call with a weight above 0.
struct Columns<'a> {
    value: &'a dyn Fn(usize, usize) -> f32,
    /// Their indices and weights.
    columns: Vec<(usize, f32)>,
}

impl Columns<'_> {
    /// Returns the values of the used vertices, each multiplied by its factor.
    fn of(&self, used: &UsedVertices, factor: impl Fn(f32) -> f32) -> Vec<f32> {
        let value = |i: u32, &(k, weight): &(usize, f32)| {
            let x = (self.value)(i as usize, k) * factor(weight);
            // (NaN and infinity cannot be compared.)
            if x.is_finite() { x } else { 0.0 }
        };
        let row = |&i: &u32| self.columns.iter().map(move |column| value(i, column));
        used.indices.iter().flat_map(row).collect()
    }
}
