//! Simplification of an index buffer without changing vertices, in one quick pass.

use lodsmith::options::QuickPass;
use lodsmith::{
    BorderPolicy, Input, Length, MeshData, NoControl, OwnedMeshData, Placement, Simplified, SimplifyOptions,
    Stop, TopologyPolicy, simplify_with,
};
use lodsmith_core::{Attribute, Positions, PositionsView, Semantic, Surface, TriMesh, VertexId, WedgeId};

use super::error::IndexError;
use super::flags::{VERTEX_LOCK, VERTEX_PRIORITY, VERTEX_PROTECT};
use super::position_table::PositionTable;

/// The returned error is `ERROR_FACTOR * d.powf(ERROR_POWER)` for the estimated RMS distance `d`, both as fractions of
/// the extent, so that an error limit leaves about as many triangles as in meshoptimizer. (Measured on ten models at
/// .001, .01 and .05. The error of meshoptimizer is the largest of its quadrics, which grows more slowly than the
/// mean.)
const ERROR_FACTOR: f64 = 1.25;
const ERROR_POWER: f64 = 0.9;
/// Smallest estimate used as a limit, as a fraction of the extent: rounding errors of flat surfaces. (Guessed.)
const LEAST_ESTIMATE: f64 = 1e-7;
/// Importance of a vertex with priority. (Its collapses cost 1.4 times as much, which is guessed. As with any
/// importance above 1 in a quick pass, its displacement counts like a distance, as in meshoptimizer.)
const PRIORITY_IMPORTANCE: f32 = 1.15;
/// Weight of the squared displacement of a vertex in the two degrees of regularity. (As in meshoptimizer.)
const REGULAR_MOVE: f32 = 0.1;
const NEARLY_REGULAR_MOVE: f32 = 0.01;
/// Rules of a pass, from the flags of the call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct QuickRules {
    /// Vertices on open borders are locked.
    pub(crate) locks_border: bool,
    /// Whole parts may be removed.
    pub(crate) prunes: bool,
    /// Degree of regularity of the faces: 0 to 2.
    pub(crate) regularity: u8,
    /// Discontinuities of attributes may be collapsed.
    pub(crate) is_permissive: bool,
}

impl QuickRules {
    /// Returns the weight of the squared displacement of a vertex.
    pub(crate) fn move_weight(self) -> f32 {
        match self.regularity {
            0 => 0.0,
            1 => NEARLY_REGULAR_MOVE,
            _ => REGULAR_MOVE,
        }
    }
}

/// A mesh without unused vertices, and the target of the simplification.
pub(crate) struct QuickInput {
    /// Positions of the vertices.
    pub(crate) positions: Vec<[f32; 3]>,
    /// Three vertices for each face.
    pub(crate) triangles: Vec<[VertexId; 3]>,
    /// Weighted attributes, the same number for each vertex, as fractions of the largest extent.
    pub(crate) values: Option<Vec<f32>>,
    /// Flags of each vertex: `VERTEX_...`.
    pub(crate) flags: Option<Vec<u8>>,
    /// Number of faces to reach.
    pub(crate) target_faces: usize,
    /// Largest error, in the units of the mesh.
    pub(crate) error_limit: Option<f64>,
    /// Largest extent of the mesh.
    pub(crate) extent: f64,
    /// Rules of the pass.
    pub(crate) rules: QuickRules,
}

/// The remaining faces, and the estimate of the error in the units of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct QuickResult {
    /// Three vertices of the input for each face.
    pub(crate) faces: Vec<[u32; 3]>,
    /// Estimate of the error.
    pub(crate) error: f64,
}

impl QuickInput {
    /// Simplifies. The result has at most the target number of faces, if the rules allow it, and an error up to the
    /// limit.
    ///
    /// # Errors
    /// If no face has an area.
    pub(crate) fn run(self) -> Result<QuickResult, IndexError> {
        let all = self.triangles.len();
        if self.target_faces >= all {
            return Ok(self.unchanged());
        }
        let table = PositionTable::new(&self.positions);
        let mesh = (table.has_duplicates || self.values.is_some()).then(|| self.mesh()).transpose()?;
        let options = self.options();
        let mut data = data_of_flags(self.flags.as_deref());
        data.wedge_values = self.values.clone();
        let mut result = match &mesh {
            Some(mesh) => self.pass_by_index_attribute(mesh, data.view(), &options)?,
            None => self.pass_by_position(&table, data.view(), &options)?,
        };
        // (The last collapse may exceed the limit by its cost.)
        result.error = result.error.min(self.error_limit.unwrap_or(f64::INFINITY));
        Ok(result)
    }

    /// Returns the error to return for an estimate of the RMS distance.
    pub(crate) fn error(&self, estimate: f64) -> f64 {
        let extent = self.extent.max(f64::MIN_POSITIVE);
        ERROR_FACTOR * extent * libm::pow(estimate / extent, ERROR_POWER)
    }

    /// Returns the estimate of the RMS distance at which the returned error reaches the limit, multiplied by a factor.
    pub(crate) fn largest_estimate(&self, factor: f64) -> Option<Length> {
        let extent = self.extent.max(f64::MIN_POSITIVE);
        let share =
            |limit: f64| libm::pow(limit / extent / ERROR_FACTOR, 1.0 / ERROR_POWER).max(LEAST_ESTIMATE);
        self.error_limit.map(|limit| Length::Units(factor * extent * share(limit)))
    }

    /// Runs one pass over a mesh whose wedges have their index as an attribute.
    fn pass_by_index_attribute(
        &self,
        mesh: &TriMesh,
        data: MeshData<'_>,
        options: &SimplifyOptions,
    ) -> Result<QuickResult, IndexError> {
        let done = simplify_with(Input::new(mesh).with(data), options, &mut NoControl)?;
        let faces = faces_by_index_attribute(&done)?;
        Ok(QuickResult { faces, error: self.error(done.report.error.estimate) })
    }

    /// Runs one pass over a mesh whose positions all differ.
    fn pass_by_position(
        &self,
        table: &PositionTable,
        data: MeshData<'_>,
        options: &SimplifyOptions,
    ) -> Result<QuickResult, IndexError> {
        let surface = Surface::new(PositionsView::F32(&self.positions), &self.triangles)?;
        let done = simplify_with(Input::of_surface(surface).with(data), options, &mut NoControl)?;
        let faces = self.faces_by_position(&done, table)?;
        Ok(QuickResult { faces, error: self.error(done.report.error.estimate) })
    }

    fn unchanged(&self) -> QuickResult {
        QuickResult { faces: self.triangles.iter().map(|t| t.map(|v| v.0)).collect(), error: 0.0 }
    }

    fn options(&self) -> SimplifyOptions {
        let mut options = SimplifyOptions::new(Stop::faces(self.target_faces));
        options.placement = Placement::Endpoint;
        let max_estimate = self.largest_estimate(1.0);
        options.quick = Some(QuickPass { max_estimate, move_weight: self.rules.move_weight() });
        let QuickRules { locks_border, prunes, .. } = self.rules;
        options.border = if locks_border { BorderPolicy::Lock } else { BorderPolicy::Keep };
        options.topology = if prunes { TopologyPolicy::Free } else { TopologyPolicy::Preserve };
        options
    }

    /// Returns the mesh with a wedge for each vertex, and the index of the wedge as an attribute. Wedges at the same
    /// position have different texture coordinates, so that a collapse must find a partner for each; if the rules are
    /// permissive, only protected wedges have them.
    fn mesh(&self) -> Result<TriMesh, IndexError> {
        let mut mesh = TriMesh::new(Positions::F32(self.positions.clone()), self.triangles.clone())?;
        let indices: Vec<[f32; 2]> = (0..self.positions.len() as u32).map(index_as_floats).collect();
        let is_protected = |i: usize| self.flags.as_ref().is_some_and(|flags| flags[i] & VERTEX_PROTECT != 0);
        let side = |(i, index): (usize, &[f32; 2])| match self.rules.is_permissive && !is_protected(i) {
            true => [-1.0; 2],
            false => *index,
        };
        mesh.set_uvs(Some(indices.iter().enumerate().map(side).collect()))?;
        let values = indices.into_iter().flatten().collect();
        mesh.add_attribute(Attribute { semantic: index_attribute(), width: 2, values })?;
        Ok(mesh)
    }

    /// Returns the faces of a result with vertices of the input, found by their positions.
    fn faces_by_position(
        &self,
        done: &Simplified,
        table: &PositionTable,
    ) -> Result<Vec<[u32; 3]>, IndexError> {
        let Positions::F32(positions) = done.mesh.positions() else {
            return Err(IndexError::Internal("the precision has changed".to_owned()));
        };
        let known = positions.iter().map(|&p| table.first(p, &self.positions));
        let known: Option<Vec<u32>> = known.collect();
        let known = known.ok_or_else(|| IndexError::Internal("a vertex has moved".to_owned()))?;
        Ok(done.mesh.triangles().iter().map(|t| t.map(|w| known[done.mesh.vertex_of(w).index()])).collect())
    }
}

/// Returns locks and importance of vertices from their flags.
pub(crate) fn data_of_flags(flags: Option<&[u8]>) -> OwnedMeshData {
    let mut data = OwnedMeshData::default();
    let has = |flag: u8| flags.filter(|flags| flags.iter().any(|f| f & flag != 0));
    data.locked = has(VERTEX_LOCK).map(|flags| flags.iter().map(|f| f & VERTEX_LOCK != 0).collect());
    let importance = |f: &u8| if f & VERTEX_PRIORITY != 0 { PRIORITY_IMPORTANCE } else { 1.0 };
    data.importance = has(VERTEX_PRIORITY).map(|flags| flags.iter().map(importance).collect());
    data
}

/// The attribute with the index of each wedge.
fn index_attribute() -> Semantic {
    Semantic::Custom("index".into())
}

/// Splits an index into two numbers that single precision represents exactly.
fn index_as_floats(i: u32) -> [f32; 2] {
    [(i & 0xFFFF) as f32, (i >> 16) as f32]
}

/// Returns the faces of a result with the indices that its wedges have as an attribute.
fn faces_by_index_attribute(done: &Simplified) -> Result<Vec<[u32; 3]>, IndexError> {
    let indices = done.mesh.further_attributes().iter().find(|a| a.semantic == index_attribute());
    let indices =
        indices.ok_or_else(|| IndexError::Internal("the indices of the vertices are lost".to_owned()))?;
    let of = |w: WedgeId| match *indices.of(w) {
        [low, high] => low as u32 | (high as u32) << 16,
        _ => 0,
    };
    Ok(done.mesh.triangles().iter().map(|t| t.map(of)).collect())
}

#[cfg(test)]
mod tests {
    use lodsmith_core::measure::{CompareOptions, compare};
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn indices_as_floats_are_exact() {
        for i in [0, 1, 65_535, 65_536, 16_777_217, u32::MAX - 1] {
            let [low, high] = index_as_floats(i);
            assert_eq!(low as u32 | (high as u32) << 16, i);
        }
    }

    #[test]
    fn the_error_limit_is_used_and_not_exceeded() {
        let mesh = shapes::blob(4, 1);
        let positions: Vec<[f32; 3]> = mesh.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
        let run = |target_faces, error_limit| {
            let input = QuickInput {
                positions: positions.clone(),
                triangles: mesh.surface().triangles().to_vec(),
                values: None,
                flags: None,
                target_faces,
                error_limit,
                extent: 2.0,
                rules: QuickRules::default(),
            };
            input.run().unwrap()
        };
        let plain = run(500, None);
        assert_eq!(plain.faces.len(), 500);
        for limit in [plain.error / 8.0, plain.error / 2.0, plain.error * 0.99] {
            let limited = run(0, Some(limit));
            assert!(limited.error <= limit && limited.error > 0.9 * limit, "{} of {limit}", limited.error);
            assert!(limited.faces.len() > 500);
        }
        assert_eq!(run(500, Some(0.0)).error, 0.0);
    }

    /// When a collapse put a vertex onto a seam that had not been on one before, it was not marked as a seam vertex.
    /// (Debug builds check this after each sweep.)
    #[test]
    fn a_collapse_may_put_a_vertex_onto_a_seam() {
        let corner = [3.5; 3];
        let moved = [
            (1, [3.25, 1.75, 3.5]),
            (9, [1.25, 2.25, 3.75]),
            (11, [2.25, 3.5, 1.75]),
            (12, [0.75, 0.0, 1.5]),
            (13, [3.0, 0.75, 3.5]),
            (45, [1.25, 2.25, 3.75]),
            (47, [2.25, 3.5, 1.75]),
            (49, [3.0, 0.75, 3.5]),
        ];
        let mut positions = vec![corner; 53];
        moved.iter().for_each(|&(i, p): &(usize, [f32; 3])| positions[i] = p);
        let [fan, sheet]: [&[u32]; 2] = [
            &[18, 13, 47, 1, 52, 12, 18, 6, 3, 50, 35, 47, 41, 39],
            &[19, 2, 49, 32, 24, 40, 30, 11, 27, 49, 45, 29],
        ];
        let same = |count| vec![9; count];
        let indices: Vec<u32> =
            [fan, fan, &fan[..10], sheet, &same(49), sheet, &same(24), &sheet[..7]].concat();
        let triangles = indices.as_chunks::<3>().0.iter().map(|t| t.map(VertexId)).collect();
        let input = QuickInput {
            positions,
            triangles,
            values: None,
            flags: None,
            target_faces: 0,
            error_limit: None,
            extent: 3.5,
            rules: QuickRules::default(),
        };
        assert!(input.run().unwrap().faces.len() < 10);
    }

    /// A chart of a single face, with lines on all sides, was never removed.
    #[test]
    fn charts_of_single_faces_do_not_hold_a_pass_back() {
        let mesh = shapes::blob(4, 1);
        let whole: Vec<[f32; 3]> = mesh.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
        let surface = mesh.surface();
        let triangles = surface.triangles();
        let target_faces = triangles.len() / 8;
        // Every fourth face has vertices of its own.
        let mut positions = whole.clone();
        let mut apart = triangles.to_vec();
        for corner in apart.iter_mut().step_by(4).flatten() {
            positions.push(whole[corner.index()]);
            *corner = VertexId(positions.len() as u32 - 1);
        }
        let mean = |positions: &[[f32; 3]], triangles: &[[VertexId; 3]]| {
            let input = QuickInput {
                positions: positions.to_vec(),
                triangles: triangles.to_vec(),
                values: None,
                flags: None,
                target_faces,
                error_limit: None,
                extent: 2.0,
                rules: QuickRules::default(),
            };
            let faces: Vec<_> = input.run().unwrap().faces.iter().map(|t| t.map(VertexId)).collect();
            assert_eq!(faces.len(), target_faces);
            let got = Surface::new(PositionsView::F32(positions), &faces).unwrap();
            compare(&surface, &got, &CompareOptions::default()).unwrap().mean.symmetric
        };
        let [plain, charts] = [mean(&whole, triangles), mean(&positions, &apart)];
        assert!(charts < 2.0 * plain, "{charts} with charts, {plain} without");
    }

    /// The back of a sheet is removed together with its front, whatever else is in the call.
    #[test]
    fn sheets_with_two_sides_are_simplified() {
        // Two sheets, one of them with a back.
        let mesh = shapes::grid(8);
        let count = mesh.vertex_count() as u32;
        let fronts = mesh.surface().triangles().to_vec();
        let backs = fronts.iter().map(|&[a, b, c]| [a, c, b]);
        let others = fronts.iter().map(|t| t.map(|v| VertexId(v.0 + count)));
        let near: Vec<[f32; 3]> = mesh.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
        let far = near.iter().map(|p| [p[0], p[1], p[2] + 5.0]);
        let input = QuickInput {
            positions: near.iter().copied().chain(far).collect(),
            triangles: fronts.iter().copied().chain(backs).chain(others).collect(),
            values: None,
            flags: Some(vec![VERTEX_PRIORITY; 2 * near.len()]),
            target_faces: fronts.len(),
            error_limit: None,
            extent: 5.0,
            rules: QuickRules::default(),
        };
        let got = input.run().unwrap().faces;
        assert!(got.len() <= fronts.len() && got.len() > fronts.len() / 2, "{} faces", got.len());
        let is_paired = |f: &[u32; 3]| {
            let turned = [[f[0], f[2], f[1]], [f[2], f[1], f[0]], [f[1], f[0], f[2]]];
            f[0] >= count || turned.iter().any(|t| got.contains(t))
        };
        assert!(got.iter().all(is_paired), "{got:?}");
    }
}
