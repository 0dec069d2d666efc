//! The coordinates of a mesh: its unit, and which axis points up.

use lodsmith_core::TriMesh;

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// A thousandth of a millimetre.
    Micron,
    /// A thousandth of a metre.
    Millimeter,
    /// A hundredth of a metre.
    Centimeter,
    /// 25.4 mm.
    Inch,
    /// 12 inches.
    Foot,
    /// A metre.
    Meter,
}

impl Unit {
    /// All units.
    pub const ALL: [Self; 6] =
        [Self::Micron, Self::Millimeter, Self::Centimeter, Self::Inch, Self::Foot, Self::Meter];

    /// Its name in English, in the singular: `micron`, `millimeter`, `centimeter`, `inch`, `foot`, `meter`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Micron => "micron",
            Self::Millimeter => "millimeter",
            Self::Centimeter => "centimeter",
            Self::Inch => "inch",
            Self::Foot => "foot",
            Self::Meter => "meter",
        }
    }

    /// Its length in metres.
    pub const fn meters(self) -> f64 {
        match self {
            Self::Micron => 1e-6,
            Self::Millimeter => 0.001,
            Self::Centimeter => 0.01,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
            Self::Meter => 1.0,
        }
    }
}

/// The unit and the axes of coordinates, for formats that define them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Frame {
    /// The unit.
    pub unit: Unit,
    /// True if z points up (and y away from the viewer); else y does (and z towards the viewer).
    pub z_up: bool,
}

impl Frame {
    /// The coordinates of glTF: metres, y up.
    pub const GLTF: Self = Self { unit: Unit::Meter, z_up: false };

    /// Creates coordinates.
    pub const fn new(unit: Unit, z_up: bool) -> Self {
        Self { unit, z_up }
    }

    /// Moves a mesh from these coordinates to others. Cost: O(vertices).
    pub fn convert(self, mesh: &mut TriMesh, to: Self) {
        if self == to {
            return;
        }
        let factor = self.unit.meters() / to.unit.meters();
        mesh.map_positions(|p| self.turned(p, to).map(|x| x * factor));
        if let Some(normals) = mesh.normals() {
            let turned =
                normals.iter().map(|n| self.turned(n.map(f64::from), to).map(|x| x as f32)).collect();
            // As many as before.
            let _ = mesh.set_normals(Some(turned));
        }
    }

    /// Returns the rotation to the axes of glTF, as a quaternion with its real part last; `None` if they are the same.
    pub(crate) fn rotation_to_gltf(self) -> Option<[f64; 4]> {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        self.z_up.then_some([-half, 0.0, 0.0, half])
    }

    /// Returns a direction in other coordinates.
    pub(crate) fn turned(self, [x, y, z]: [f64; 3], to: Self) -> [f64; 3] {
        match (self.z_up, to.z_up) {
            (true, false) => [x, z, -y],
            (false, true) => [x, -z, y],
            _ => [x, y, z],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lodsmith_core::shapes;

    #[test]
    fn a_mesh_comes_back() {
        let mesh = shapes::cube(1);
        let (mm, mut moved) = (Frame::new(Unit::Millimeter, true), mesh.clone());
        mm.convert(&mut moved, Frame::GLTF);
        let at = |m: &TriMesh| m.positions().view().iter().collect::<Vec<_>>();
        let [x, y, z] = at(&mesh)[0];
        let got = at(&moved)[0];
        for (got, wanted) in got.iter().zip([x / 1000.0, z / 1000.0, -y / 1000.0]) {
            assert!((got - wanted).abs() < 1e-9);
        }
        Frame::GLTF.convert(&mut moved, mm);
        assert!(
            at(&mesh).iter().flatten().zip(at(&moved).iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6)
        );
    }
}
