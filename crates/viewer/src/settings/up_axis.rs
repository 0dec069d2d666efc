//! The axis of a model that points up in the pictures: chosen, or guessed from format and shape.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DQuat, DVec3};
use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Model};
use lodsmith_io::Format;
use serde::{Deserialize, Serialize};

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpAxis {
    /// As guessed from format and shape.
    #[default]
    Auto,
    /// +y, as in glTF.
    Y,
    /// +z, as in most CAD programs and scanners.
    Z,
    /// +x.
    X,
    /// -y.
    MinusY,
    /// -z.
    MinusZ,
    /// -x.
    MinusX,
}

/// Advantage of the axis that is usual for a format, in the unit of [`standing_score`]. (Guessed.)
const USUAL_STL: f64 = 0.35;
const USUAL_OBJ: f64 = 0.3;
const USUAL_SCAN: f64 = 0.08;
/// Largest distance of a base from the end of the bounding box, as a fraction of its extent.
const BASE_DEPTH: f64 = 0.01;
/// Smallest cosine between the normal of a base and the axis.
const BASE_COSINE: f64 = 0.97;

impl UpAxis {
    /// All values with their names.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Auto, "Auto"),
        (Self::Y, "Y"),
        (Self::Z, "Z"),
        (Self::X, "X"),
        (Self::MinusY, "-Y"),
        (Self::MinusZ, "-Z"),
        (Self::MinusX, "-X"),
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|a| a.0 == self).map_or("", |a| a.1)
    }

    /// Returns the rotation that makes this axis point to +y. [`UpAxis::Auto`] rotates nothing: replace it by
    /// [`guessed`] first.
    pub fn rotation(self) -> DQuat {
        match self {
            Self::Auto | Self::Y => DQuat::IDENTITY,
            Self::Z => DQuat::from_rotation_x(-FRAC_PI_2),
            Self::X => DQuat::from_rotation_z(FRAC_PI_2),
            Self::MinusY => DQuat::from_rotation_x(PI),
            Self::MinusZ => DQuat::from_rotation_x(FRAC_PI_2),
            Self::MinusX => DQuat::from_rotation_z(-FRAC_PI_2),
        }
    }
}

/// Guesses whether y or z points up. glTF defines y; in other formats the shape decides: surfaces without a
/// bottom, such as scans and terrain, face upward on average, and closed ones stand on a flat base. Where the
/// shape says nothing, z is taken for STL and y otherwise.
///
/// Cost: O(triangles).
pub fn guessed(model: &Model, format: Format, bounds: &Bounds) -> UpAxis {
    let [usual_y, usual_z] = match format {
        Format::Gltf | Format::Glb => return UpAxis::Y,
        Format::Stl => [0.0, USUAL_STL],
        Format::Obj => [USUAL_OBJ, 0.0],
        _ => [USUAL_SCAN, 0.0],
    };
    let areas = Areas::of(model, bounds);
    let [y, z] = [areas.standing_score(1), areas.standing_score(2)];
    if z + usual_z > y + usual_y { UpAxis::Z } else { UpAxis::Y }
}

/// Areas of a model by their direction.
struct Areas {
    /// Area of all faces.
    all: f64,
    /// Sum of the area vectors: zero for a closed surface.
    sum: DVec3,
    /// Area of the faces at the lower end of each axis that face down, and at the upper end that face up.
    ends: [DVec3; 2],
    /// Largest possible area of each end: that of the side of the bounding box.
    sides: DVec3,
}

impl Areas {
    fn of(model: &Model, bounds: &Bounds) -> Self {
        let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
        let size = max - min;
        let sides = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
        let mut areas = Self { all: 0.0, sum: DVec3::ZERO, ends: [DVec3::ZERO; 2], sides };
        let [low, high] = [min + size * BASE_DEPTH, max - size * BASE_DEPTH];
        for instance in model.instances(&Pose::default()) {
            let mesh = &model.meshes[instance.mesh].mesh;
            let positions = mesh.positions().view();
            for t in mesh.triangles() {
                let place = |k: usize| {
                    let p = DVec3::from(positions.get(mesh.vertex_of(t[k])));
                    instance.world_from_mesh.transform_point3(p)
                };
                let corners = [place(0), place(1), place(2)];
                let vector = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                let area = vector.length();
                if !(area > 0.0 && area.is_finite()) {
                    continue;
                }
                areas.all += area;
                areas.sum += vector;
                for k in 0..3 {
                    let cosine = vector[k] / area;
                    if cosine < -BASE_COSINE && corners.iter().all(|p| p[k] <= low[k]) {
                        areas.ends[0][k] += area;
                    } else if cosine > BASE_COSINE && corners.iter().all(|p| p[k] >= high[k]) {
                        areas.ends[1][k] += area;
                    }
                }
            }
        }
        areas
    }

    /// Returns how likely the model is upright on this axis; larger is more likely.
    fn standing_score(&self, axis: usize) -> f64 {
        if self.all <= 0.0 {
            return 0.0;
        }
        let openness = self.sum[axis] / self.all;
        let share = |end: DVec3| (end[axis] / self.sides[axis].max(1e-300)).min(1.0);
        let [base, top] = self.ends.map(share);
        2.0 * openness + (base - top) + 0.3 * base
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Positions, TriMesh, VertexId, shapes};

    use super::*;

    fn guess_of(mesh: TriMesh, format: Format) -> UpAxis {
        let model = Model::of_mesh(mesh);
        let bounds = model.bounds(&Pose::default()).unwrap();
        guessed(&model, format, &bounds)
    }

    /// A pyramid without or with its base, whose tip points along an axis.
    fn pyramid(axis: usize, is_closed: bool) -> TriMesh {
        let put = |x: f32, y: f32, up: f32| {
            let mut p = [0.0; 3];
            (p[(axis + 1) % 3], p[(axis + 2) % 3], p[axis]) = (x, y, up);
            p
        };
        let positions =
            vec![put(-1., -1., 0.), put(1., -1., 0.), put(1., 1., 0.), put(-1., 1., 0.), put(0., 0., 1.)];
        let mut faces = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        if is_closed {
            faces.extend([[0, 2, 1], [0, 3, 2]]);
        }
        let faces = faces.into_iter().map(|t| t.map(VertexId::new)).collect();
        TriMesh::new(Positions::F32(positions), faces).unwrap()
    }

    #[test]
    fn an_axis_is_turned_to_point_up() {
        let axes = [
            (UpAxis::Y, DVec3::Y),
            (UpAxis::Z, DVec3::Z),
            (UpAxis::X, DVec3::X),
            (UpAxis::MinusY, DVec3::NEG_Y),
            (UpAxis::MinusZ, DVec3::NEG_Z),
            (UpAxis::MinusX, DVec3::NEG_X),
        ];
        for (axis, direction) in axes {
            assert!((axis.rotation() * direction).distance(DVec3::Y) < 1e-12, "{axis:?}");
        }
    }

    #[test]
    fn shapes_are_upright_on_their_base() {
        for is_closed in [false, true] {
            for format in [Format::Stl, Format::Ply, Format::Off, Format::Obj] {
                assert_eq!(guess_of(pyramid(1, is_closed), format), UpAxis::Y, "{format:?}");
                assert_eq!(guess_of(pyramid(2, is_closed), format), UpAxis::Z, "{format:?}");
            }
            assert_eq!(guess_of(pyramid(2, is_closed), Format::Glb), UpAxis::Y, "glTF defines it");
        }
    }

    #[test]
    fn a_ball_lies_as_its_format_usually_does() {
        let ball = || shapes::icosphere(2);
        assert_eq!(guess_of(ball(), Format::Stl), UpAxis::Z);
        assert_eq!(guess_of(ball(), Format::Ply), UpAxis::Y);
        assert_eq!(guess_of(ball(), Format::Obj), UpAxis::Y);
    }
}
