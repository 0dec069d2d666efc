//! Progressive meshes of a scene: one for each mesh, and a common order for all their splits.

use std::sync::Arc;

use lodsmith_core::Splits;

use super::build::{self, RecordedMesh};
use super::{ChangedRanges, Progressive, arrange};
use crate::SimplifyError;
use crate::constraints;
use crate::control::{Control, ProgressShare};
use crate::input::Input;
use crate::options::{Length, SimplifyOptions, Stop};
use crate::scene::Part;

/// The meshes of a scene, each as a [progressive mesh](Progressive), that change level with a common
/// threshold: splits are done where they gain most, in any mesh.
///
/// Counts include all instances, errors are lengths in the scene. A level depends only on its number. Parts
/// that touch are not kept connected: gaps may open between them as they lose vertices.
///
/// ```
/// use lodsmith::core::shapes;
/// use lodsmith::{NoControl, Part, ProgressiveScene, SimplifyOptions};
///
/// let (a, b) = (shapes::icosphere(3), shapes::torus(24, 12));
/// let part = |mesh, instances| Part { instances, ..Part::new(mesh) };
/// let parts = [part(&a, 1), part(&b, 3)];
/// let mut scene = ProgressiveScene::build(&parts, 10.0, &SimplifyOptions::default(), &mut NoControl)?;
/// scene.to_faces(500);
/// assert!(scene.face_count() <= 500);
/// let light: Vec<_> = scene.meshes().iter().map(|mesh| mesh.fitted_mesh()).collect::<Result<_, _>>()?;
/// # assert!(light[0].face_count() + 3 * light[1].face_count() <= 500);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ProgressiveScene {
    meshes: Vec<Progressive>,
    order: Arc<SceneOrder>,
    level: usize,
}

/// The mesh that each split of the scene belongs to.
#[derive(Debug)]
struct SceneOrder {
    splits: usize,
    /// For each mesh, its splits as numbers in the scene, ascending.
    of_mesh: Vec<Vec<u32>>,
    /// Number of instances of each mesh.
    times: Vec<usize>,
    /// Weight of each mesh in the mean of squared distances, which are in its own units.
    shares: Vec<f64>,
}

impl ProgressiveScene {
    /// Records the simplification of each mesh as far as possible and merges all splits into one order. The
    /// stops, counted as in [`simplify_scene`](crate::simplify_scene), determine the base of the scene;
    /// `diagonal` is the scene's, and lengths given as shares refer to it. The result is at the level of the
    /// full scene. A mesh in which no face has an area is unchanged.
    ///
    /// # Errors
    /// Those of [`Progressive::build`]; [`SimplifyError::NotTogether`] with [`SimplifyOptions::per_mesh`].
    pub fn build(
        parts: &[Part<'_>],
        diagonal: f64,
        options: &SimplifyOptions,
        control: &mut dyn Control,
    ) -> Result<Self, SimplifyError> {
        if options.per_mesh {
            return Err(SimplifyError::NotTogether { first: "progressive", second: "per-mesh" });
        }
        for part in parts {
            options.check(&part.data)?;
            constraints::check(&part.data, part.mesh.vertex_count())?;
        }
        let faces = parts.iter().map(|p| p.mesh.face_count()).sum::<usize>();
        let share = |n: usize| n as f64 / faces.max(1) as f64;
        let mut begun = 0;
        let (mut meshes, mut all) = (Vec::with_capacity(parts.len()), Vec::new());
        let mut is_any = false;
        for (number, part) in parts.iter().enumerate() {
            let mut own =
                ProgressShare { control, begin: share(begun), length: share(part.mesh.face_count()) };
            begun += part.mesh.face_count();
            let scale = scale_of(part);
            let options = of_part(options, diagonal, scale);
            match build::build(&Input::new(part.mesh).with(part.data), &options, &mut own) {
                Ok(RecordedMesh { mesh: progressive, costs }) => {
                    let factor = costs.factor(scale);
                    let step = |(i, cost): (usize, &f32)| SceneSplit {
                        is_late: i < costs.late,
                        cost: f64::from(*cost) * factor,
                        mesh: number,
                    };
                    all.extend(costs.of_split.iter().enumerate().map(step));
                    meshes.push(progressive);
                    is_any = true;
                }
                Err(SimplifyError::NoFaces { .. }) => {
                    let data = arrange::single_level(part.mesh);
                    meshes.push(Progressive::new(Splits::new(data).expect("splits of a valid mesh")));
                }
                Err(other) => return Err(other),
            }
        }
        if !is_any {
            return Err(SimplifyError::NoFaces { faces });
        }
        // The most expensive splits come first. The splits of each mesh are in order already, and stay in
        // order.
        all.sort_by(|a, b| {
            b.is_late.cmp(&a.is_late).then(b.cost.total_cmp(&a.cost)).then(a.mesh.cmp(&b.mesh))
        });
        let mut of_mesh: Vec<Vec<u32>> = meshes.iter().map(|r| Vec::with_capacity(r.top())).collect();
        for (split, step) in all.iter().enumerate() {
            of_mesh[step.mesh].push(split as u32);
        }
        let is_placed = parts.iter().any(|p| p.instances > 0);
        let times: Vec<usize> = parts.iter().map(|p| if is_placed { p.instances } else { 1 }).collect();
        let order = SceneOrder { splits: all.len(), of_mesh, shares: shares(parts, &times), times };
        let scene = Self { meshes, level: order.splits, order: Arc::new(order) };
        Ok(scene.with_base_at(&options.stop, diagonal))
    }

    /// Returns the scene with a new base: the level at which the first stop is met.
    fn with_base_at(mut self, stop: &Stop, diagonal: f64) -> Self {
        let is_stopped = *stop != Stop::default();
        let base = if is_stopped { self.level_of(stop, diagonal) } else { 0 };
        if base == 0 {
            return self;
        }
        let levels = self.order.levels(base);
        self.meshes =
            self.meshes.into_iter().zip(&levels).map(|(r, &level)| r.without_below(level)).collect();
        let SceneOrder { splits, of_mesh, times, shares } = &*self.order;
        let above =
            |(all, level): (&Vec<u32>, &usize)| all[*level..].iter().map(|s| s - base as u32).collect();
        let of_mesh = of_mesh.iter().zip(&levels).map(above).collect();
        let splits = splits - base;
        self.order = Arc::new(SceneOrder { splits, of_mesh, times: times.clone(), shares: shares.clone() });
        self.level = 0;
        self.to_level(splits);
        self
    }

    /// Returns the progressive meshes, in the order of the parts, at their levels. Clones can change level
    /// independently.
    pub fn meshes(&self) -> &[Progressive] {
        &self.meshes
    }
    /// Returns the progressive meshes, to be used separately.
    pub fn into_meshes(self) -> Vec<Progressive> {
        self.meshes
    }
    /// Returns the number of the finest level, which is the number of splits.
    pub fn top(&self) -> usize {
        self.order.splits
    }
    /// Returns the current level, which is the number of splits done.
    pub fn level(&self) -> usize {
        self.level
    }
    /// Returns the number of faces of all instances at the current level.
    pub fn face_count(&self) -> usize {
        self.count(self.level, |progressive, level| progressive.splits().counts[level].faces)
    }
    /// Returns the number of vertices of all instances at the current level that a face uses.
    pub fn vertex_count(&self) -> usize {
        self.count(self.level, |progressive, level| progressive.sequence.vertices[level])
    }
    /// Returns the estimated distance (RMS over all instances) of the current level, with its fit, from the
    /// full scene.
    pub fn error(&self) -> f64 {
        self.error_at(self.level)
    }

    /// Returns the level at which the first of these stops is met, going down from the full scene; without
    /// stops, the full scene. An error refers to the [estimate](Self::error), and shares refer to this
    /// diagonal.
    pub fn level_of(&self, stop: &Stop, diagonal: f64) -> usize {
        let whole = self.count(self.top(), |progressive, level| progressive.splits().counts[level].faces);
        let by_ratio = stop.ratio.map(|r| ((whole as f64 * r).round() as usize).max(1));
        let by_faces = stop.faces.into_iter().chain(by_ratio).max().map(|n| self.level_of_faces(n));
        let by_vertices = stop.vertices.map(|n| self.level_of_vertices(n));
        let by_error = stop.error.map(|e| self.level_of_error(e.in_units(diagonal)));
        by_faces.into_iter().chain(by_vertices).chain(by_error).max().unwrap_or(self.top())
    }
    /// Returns the finest level with at most `n` faces in all instances, or the base.
    pub fn level_of_faces(&self, n: usize) -> usize {
        let is_within = |l| self.count(l, |progressive, level| progressive.splits().counts[level].faces) <= n;
        first_where(self.top() + 1, |l| !is_within(l)).saturating_sub(1)
    }
    /// Returns a fine level with at most `n` vertices in use in all instances, at this and all coarser
    /// levels, or the base.
    pub fn level_of_vertices(&self, n: usize) -> usize {
        let is_within =
            |l| self.count(l, |progressive, level| progressive.sequence.most_vertices[level]) <= n;
        first_where(self.top() + 1, |l| !is_within(l)).saturating_sub(1)
    }
    /// Returns the coarsest level whose estimated error is at most `distance`, or the full scene.
    pub fn level_of_error(&self, distance: f64) -> usize {
        first_where(self.top(), |l| self.error_at(l) <= distance)
    }
    /// Goes to [the level](Self::level_of_faces) of a number of faces.
    pub fn to_faces(&mut self, n: usize) -> Vec<ChangedRanges> {
        self.to_level(self.level_of_faces(n))
    }
    /// Goes to [the level](Self::level_of_vertices) of a number of vertices.
    pub fn to_vertices(&mut self, n: usize) -> Vec<ChangedRanges> {
        self.to_level(self.level_of_vertices(n))
    }
    /// Goes to [the level](Self::level_of_error) of an estimated error.
    pub fn to_error(&mut self, distance: f64) -> Vec<ChangedRanges> {
        self.to_level(self.level_of_error(distance))
    }
    /// Goes to a level, or to the full scene if the number is larger. Returns the changes of each mesh.
    pub fn to_level(&mut self, level: usize) -> Vec<ChangedRanges> {
        self.level = level.min(self.top());
        let levels = self.order.levels(self.level);
        self.meshes.iter_mut().zip(levels).map(|(progressive, level)| progressive.to_level(level)).collect()
    }

    /// Returns a sum over all instances.
    fn count(&self, level: usize, of: impl Fn(&Progressive, usize) -> u32) -> usize {
        let all = self.meshes.iter().zip(self.order.levels(level)).zip(&self.order.times);
        all.map(|((progressive, level), times)| (of(progressive, level) as usize).saturating_mul(*times))
            .sum()
    }

    fn error_at(&self, level: usize) -> f64 {
        let all = self.meshes.iter().zip(self.order.levels(level)).zip(&self.order.shares);
        all.map(|((progressive, level), share)| share * progressive.error_at(level).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

impl SceneOrder {
    /// Returns the level of each mesh at a level of the scene.
    fn levels(&self, level: usize) -> Vec<usize> {
        self.of_mesh.iter().map(|all| all.partition_point(|&split| (split as usize) < level)).collect()
    }
}

/// A split in the order of the scene.
struct SceneSplit {
    is_late: bool,
    cost: f64,
    mesh: usize,
}

/// Returns the first number below `end` from which a predicate holds, or `end`.
fn first_where(end: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, end);
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) { high = middle } else { low = middle + 1 }
    }
    high
}

fn scale_of(part: &Part<'_>) -> f64 {
    if part.scale.is_finite() && part.scale > 0.0 { part.scale } else { 1.0 }
}

/// Returns the options for one mesh: no stops, and lengths in its units.
fn of_part(options: &SimplifyOptions, diagonal: f64, scale: f64) -> SimplifyOptions {
    let mut own = options.clone();
    let units = |length: Length| Length::Units(length.in_units(diagonal) / scale);
    own.stop = Stop::default();
    own.weld = options.weld.map(units);
    own.prune = options.prune.map(units);
    own.guards.max_edge = options.guards.max_edge.map(units);
    own.method.lengths_mut().for_each(|length| *length = units(*length));
    own
}

/// Returns the weight of each mesh by its area in the scene, all instances together; distances are in the
/// units of the mesh.
fn shares(parts: &[Part<'_>], times: &[usize]) -> Vec<f64> {
    let area = |(part, times): (&Part<'_>, &usize)| {
        let own = part.area();
        if own.is_finite() { own * *times as f64 } else { 0.0 }
    };
    let areas: Vec<f64> = parts.iter().zip(times).map(area).collect();
    let total: f64 = areas.iter().sum();
    let share = |(part, area): (&Part<'_>, f64)| {
        let of_all = if total > 0.0 { area / total } else { 1.0 / parts.len() as f64 };
        of_all * scale_of(part).powi(2)
    };
    parts.iter().zip(areas).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::NoControl;
    use crate::test_support::{octahedron, tetrahedron};

    fn part(mesh: &lodsmith_core::TriMesh, instances: usize, scale: f64) -> Part<'_> {
        Part { instances, scale, ..Part::new(mesh) }
    }

    #[test]
    fn levels_of_the_meshes_add_up_to_the_scene_level() {
        let of_mesh = vec![vec![0, 3, 4], vec![1, 2], Vec::new()];
        let order = SceneOrder { splits: 5, of_mesh, times: vec![1; 3], shares: vec![1.0; 3] };
        let wanted = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0], [2, 2, 0], [3, 2, 0]];
        for (level, wanted) in wanted.into_iter().enumerate() {
            assert_eq!(order.levels(level), wanted);
        }
        assert_eq!([0, 3, 5].map(|n| first_where(5, |i| i >= n)), [0, 3, 5]);
    }

    #[test]
    fn shares_are_by_the_area_in_the_scene() {
        // Octahedra with area 4 √3 each: three instances of one, and one twice as large, whose distances are
        // in its own units.
        let mesh = octahedron().mesh();
        let found = shares(&[part(&mesh, 3, 1.0), part(&mesh, 1, 2.0)], &[3, 1]);
        assert!(
            (found[0] - 3.0 / 7.0).abs() < 1e-9 && (found[1] - 4.0 * 4.0 / 7.0).abs() < 1e-9,
            "{found:?}"
        );
        assert_eq!(
            [2.0, 0.0, -1.0, f64::NAN].map(|scale| scale_of(&part(&mesh, 1, scale))),
            [2.0, 1.0, 1.0, 1.0]
        );
    }

    #[test]
    fn options_of_a_mesh_are_in_its_units() {
        let mut options = SimplifyOptions::new(Stop::faces(10));
        options.weld = Some(Length::OfDiagonal(0.1));
        options.guards.max_edge = Some(Length::Units(3.0));
        let own = of_part(&options, 20.0, 4.0);
        assert_eq!(own.stop, Stop::default());
        assert_eq!((own.weld, own.guards.max_edge), (Some(Length::Units(0.5)), Some(Length::Units(0.75))));
    }

    #[test]
    fn the_larger_of_two_equal_meshes_is_refined_first() {
        let mesh = octahedron().mesh();
        let parts = [part(&mesh, 1, 1.0), part(&mesh, 2, 10.0)];
        let mut scene = ProgressiveScene::build(&parts, 20.0, &SimplifyOptions::default(), &mut NoControl)
            .expect("two octahedra");
        let top = scene.meshes()[0].top();
        assert!(top > 0 && scene.top() == 2 * top && scene.meshes()[1].top() == top);
        scene.to_level(top);
        assert_eq!([0, 1].map(|i: usize| scene.meshes()[i].level()), [0, top]);
        // Each split of the second one counts twice.
        let base = scene.meshes()[0].face_count();
        assert_eq!((scene.face_count(), scene.level_of_faces(base + 16)), (base + 16, top));
        assert_eq!(scene.level_of_faces(base + 15), top - 1);
        scene.to_level(2 * top);
        assert_eq!((scene.face_count(), scene.vertex_count()), (24, 18));
        // A mesh without area is unchanged.
        let flat = tetrahedron().scaled(0.0).mesh();
        let beside = [part(&mesh, 1, 1.0), part(&flat, 1, 1.0)];
        let scene = ProgressiveScene::build(&beside, 20.0, &SimplifyOptions::default(), &mut NoControl)
            .expect("one octahedron");
        assert_eq!((scene.meshes()[1].top(), scene.meshes()[1].face_count()), (0, 4));
    }
}
