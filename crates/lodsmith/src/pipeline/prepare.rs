//! Preparation of the input before a run (temporary and flat normals, pruning, welding), and its part of the
//! report.

use lodsmith_core::mesh::weld::{self, Weld};
use lodsmith_core::{MeshError, Surface, TriMesh};

use super::{borders, shading};
use crate::SimplifyError;
use crate::input::Input;
use crate::options::{Length, SimplifyOptions};
use crate::pipeline::flat_shading::FlatShading;
use crate::prune::Pruned;
use crate::report::Report;
use crate::run::Done;
use crate::{constraints, prune};

/// Returns the mesh with normals computed from its shape, if it has none and the options let them count.
pub(crate) fn temporary_normals(
    input: &Input<'_>,
    options: &SimplifyOptions,
) -> Result<Option<TriMesh>, MeshError> {
    if options.shape_normals { shading::with_shape_normals(input) } else { Ok(None) }
}

/// The input of a run after welding and pruning, and the part of the report about these.
pub(crate) struct Prepared<'a> {
    pub(crate) input: Input<'a>,
    /// The options, with lengths that are shares of the whole input converted to its units.
    pub(crate) options: SimplifyOptions,
    /// Small parts that were removed, with the diagonal of the input before, if there are any.
    pruned: Pruned,
    diagonal: Option<f64>,
    /// Vertices that only removed parts used.
    unused: usize,
    /// Vertices that were joined with others.
    welded: usize,
    /// Sheets that are reduced as closed surfaces: see [`Report::unpaired_sheets`].
    pub(crate) unpaired_sheets: usize,
    /// Where normals were left out, and the mesh that still has them.
    flat: Option<(&'a FlatShading, &'a TriMesh)>,
    /// With temporary normals: true if the input has attributes or regions.
    has_seams: Option<bool>,
}

impl<'a> Prepared<'a> {
    /// Prepares an input as the options require; `with_normals` is its mesh with [`temporary_normals`], and
    /// `flat` its mesh without normals where they are flat. Small parts are removed before close vertices are
    /// joined. Cost: O(n), with a weld O(n log n).
    pub(crate) fn new(
        input: &'a Input<'_>,
        with_normals: Option<&'a TriMesh>,
        flat: Option<&'a FlatShading>,
        options: &SimplifyOptions,
    ) -> Result<Self, SimplifyError> {
        let (surface, mesh) = match with_normals.or(flat.map(|flat| &flat.mesh)) {
            Some(mesh) => (mesh.surface(), Some(mesh)),
            None => (input.surface.clone(), input.mesh),
        };
        let mut prepared = Self {
            input: Input {
                surface,
                mesh,
                joined: None,
                keeps_blended_normals: input.keeps_blended_normals || with_normals.is_some(),
                ..*input
            },
            options: options.clone(),
            pruned: Pruned::default(),
            diagonal: None,
            unused: 0,
            welded: 0,
            unpaired_sheets: 0,
            flat: flat.zip(input.mesh),
            has_seams: with_normals
                .map(|_| input.mesh.is_some_and(|m| m.has_attributes() || m.regions().is_some())),
        };
        if let Some(size) = options.prune {
            prepared.prune(size)?;
        }
        let weld = match (prepared.options.weld, &input.joined) {
            (Some(distance), _) => Some(prepared.weld_within(distance)),
            (None, Some(joined)) => Some(Weld::from_representatives(joined.clone())),
            (None, None) if input.knows_borders => None,
            (None, None) => borders::joined(&prepared.input.surface),
        };
        if let Some(weld) = weld {
            prepared.join(&weld)?;
        }
        Ok(prepared)
    }

    /// Removes parts with a diagonal below `size`.
    fn prune(&mut self, size: Length) -> Result<(), SimplifyError> {
        let surface = &self.input.surface;
        let diagonal = prune::diagonal(surface);
        // Shares refer to the whole input, including small parts.
        self.options.lengths_to_units(diagonal);
        let options = &self.options;
        let near = options.weld.map(|d| d.in_units(diagonal));
        let small = prune::small_parts(surface, size.in_units(diagonal), near, self.input.data.locked);
        self.pruned = small.pruned;
        if small.pruned.parts > 0 {
            let (triangles, unused) = prune::without_small(surface, &small.is_small);
            (self.diagonal, self.unused) = (Some(diagonal), unused);
            self.input.surface = Surface::with_triangles(surface.positions(), triangles)?;
        }
        Ok(())
    }

    /// Finds vertices nearer to each other than `distance`.
    fn weld_within(&self, distance: Length) -> Weld {
        let positions = self.input.surface.positions();
        let diagonal = positions.bounds().map_or(0.0, |b| b.diagonal());
        weld::weld_within(positions, distance.in_units(diagonal))
    }

    /// Joins vertices; vertices near locked ones are joined onto these.
    fn join(&mut self, weld: &Weld) -> Result<(), SimplifyError> {
        let surface = &self.input.surface;
        let positions = surface.positions();
        let (joined, merged) = constraints::weld_onto_locked(weld, positions, self.input.data.locked);
        let triangles = surface.triangles().iter().map(|t| t.map(|v| joined[v.index()])).collect();
        self.input.surface = Surface::with_triangles(positions, triangles)?;
        (self.input.joined, self.welded) = (Some(joined), merged);
        Ok(())
    }

    /// Returns the result with flat normals, without temporary ones, and with the preparation in its report.
    pub(crate) fn finish(&self, (mut done, held): Done) -> Result<Done, SimplifyError> {
        self.report(&mut done.report);
        if let Some(has_seams) = self.has_seams {
            done.report.seams_relaxed &= has_seams;
            done.mesh = shading::without_temporary_normals(done.mesh)?;
        }
        if let Some((flat, input)) = self.flat {
            done.mesh = flat.with_normals(&done.mesh, &held, input)?;
        }
        Ok((done, held))
    }

    /// Adds the preparation to a report.
    pub(crate) fn report(&self, report: &mut Report) {
        // Joined vertices have no faces any more: they count as joined, not as unused.
        let cleanup = &mut report.cleanup;
        cleanup.welded_vertices += self.welded;
        cleanup.unused_vertices = cleanup.unused_vertices.saturating_sub(self.welded + self.unused);
        cleanup.degenerate_faces = cleanup.degenerate_faces.saturating_sub(match self.diagonal {
            Some(_) => self.pruned.faces,
            None => 0,
        });
        report.pruned = self.pruned;
        report.unpaired_sheets += self.unpaired_sheets;
        report.error.diagonal = self.diagonal.unwrap_or(report.error.diagonal);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::tetrahedron;

    #[test]
    fn close_vertices_are_merged_and_small_parts_removed() {
        use glam::Vec3;
        let small = tetrahedron().and(&tetrahedron().scaled(0.01), Vec3::X * 1.005);
        let mesh = small.mesh();
        let whole = Input::new(&mesh);
        let prepared =
            |options: &SimplifyOptions| Prepared::new(&whole, None, None, options).expect("a mesh").input;
        let mut options = SimplifyOptions::default();
        let plain = prepared(&options);
        assert_eq!((plain.surface.triangles().len(), plain.joined.is_none()), (8, true));
        options.prune = Some(Length::Units(0.1));
        let pruned = prepared(&options);
        // (Faces keep their numbers: removed ones have no extent.)
        let sound =
            pruned.surface.triangles().iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
        assert_eq!((pruned.surface.triangles().len(), sound.count()), (8, 4));
        options.prune = None;
        options.weld = Some(Length::Units(0.006));
        let welded = prepared(&options);
        // Vertex 4 is .005 from vertex 1.
        let joined = welded.joined.as_ref().expect("some vertices are close");
        assert_eq!(joined[4], joined[1]);
        assert_ne!(joined[0], joined[1]);
    }
}
