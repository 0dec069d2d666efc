//! Construction of the engine for a run.

use std::borrow::Cow;

use glam::Vec3;
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::{RegionId, VertexId, WedgeId};

use super::context::{Run, TopologyChanges};
use crate::attributes::recolor;
use crate::attributes::sides::SideValues;
use crate::attributes::{Rows, WeightContext};
use crate::collapse::attributes::Attributes;
use crate::collapse::creases::sharp_edges;
use crate::collapse::ordered_input::INPUT_COPY_MAX_FACES;
use crate::collapse::store::Store;
use crate::collapse::{Engine, Goal, Wedges};
use crate::cost::guard::Rules;
use crate::cost::metric::{CostSource, Metric, VertexMemory};
use crate::fit;
use crate::options::{Fit, Length, Placement};

/// Data of a run that stays unchanged from its start.
pub(crate) struct Root {
    pub(crate) rows: Option<Rows>,
    pub(crate) originals: Option<fit::Originals>,
    pub(super) duplicate_faces: usize,
    /// True if the ordered input still has its points and faces.
    pub(crate) is_kept: bool,
    /// Topology changes in order of cost.
    pub(super) changes: TopologyChanges,
    /// Attribute weights for each goal of a chain.
    pub(crate) weights: Vec<Vec<f32>>,
}

/// Wedges and attributes at the corners of the ordered faces.
struct Corners {
    wedges: Option<Vec<[WedgeId; 3]>>,
    endpoints: Option<Wedges>,
    rows: Option<(Rows, Option<Attributes>)>,
}

impl Run<'_, '_> {
    /// Creates an engine before its first sweep; if it is `recorded`, faces have the numbers of the ordered
    /// input. `goals` are the goals of a chain, if it is one, and `level` is the first one to sweep to.
    pub(crate) fn start<M: Metric>(
        &mut self,
        metric: M,
        recorded: bool,
        (goals, level): (&[Goal], usize),
    ) -> (Engine<M>, Root) {
        let (store, endpoints, attributes, mut root) =
            self.parts_of_engine(metric.cost_source(), recorded, (goals, level));
        let rules = Rules::new(self.options, self.ordered.frame, self.ordered.diagonal);
        let mut engine;
        (engine, root.duplicate_faces) = Engine::new(metric, store, rules, endpoints, attributes);
        // (Runs to an error limit preserve details anyway; recorded ones have no goal yet.)
        if let (Some(textures), Some(mesh)) = (self.input.data.textures, self.input.mesh)
            && !recorded
            && self.options.stop.error.is_none()
        {
            engine.mesh.init_details(|part_of, parts| {
                let part_of_face = |f: usize| {
                    let number = self.place(mesh, mesh.triangles()[f][0]);
                    part_of.get(number.index()).map(|&part| part as usize)
                };
                recolor::mean_colors(mesh, textures, part_of_face, parts)
            });
        }
        engine.mesh.set_cost_factors(self.constraints.cost_factors());
        if let Some(distance) = self.options.method.pairs() {
            engine.mesh.enable_pairs(pairs_reach(distance, self.ordered.frame, self.ordered.diagonal));
        }
        (engine, root)
    }

    /// Creates the parts of an engine that do not depend on the metric, except for its cost source.
    fn parts_of_engine<Q: VertexMemory>(
        &mut self,
        cost_source: CostSource,
        recorded: bool,
        (goals, level): (&[Goal], usize),
    ) -> (Store<Q>, Option<Wedges>, Option<Attributes>, Root) {
        let surface = &self.input.surface;
        if self.ordered.points.is_empty() {
            // Taken by an earlier pass.
            self.ordered.points = self.ordered.remake_points(surface);
            self.ordered.faces = self.ordered.remake_faces(surface);
        }
        // A chain needs the input at each level.
        let is_needed_again = !goals.is_empty() || recorded;
        let is_kept = self.ordered.faces.len() <= INPUT_COPY_MAX_FACES || is_needed_again;
        let (points, faces) = if is_kept {
            (Cow::Borrowed(&self.ordered.points[..]), self.ordered.faces.clone())
        } else {
            (Cow::Owned(std::mem::take(&mut self.ordered.points)), std::mem::take(&mut self.ordered.faces))
        };
        let regions = self.regions();
        let Corners { wedges, endpoints, mut rows } = self.corners(&faces, &points);
        let mut weights = Vec::new();
        if !matches!(cost_source, CostSource::Engine) {
            if let Some((_, Some(attributes))) = &mut rows {
                attributes.weights_mut().fill(0.0);
            }
        } else if let (Some((rows, Some(attributes))), Some(wedges)) = (&mut rows, &wedges) {
            for goal in goals {
                self.set_attribute_weights(rows, attributes, (&faces, wedges, &points), goal);
                weights.push(attributes.weights_mut().to_vec());
            }
            if let Some(first) = weights.get(level) {
                attributes.weights_mut().copy_from_slice(first);
            }
        }
        let (rows, attributes) = rows.unzip();
        let attributes = attributes.flatten();
        let originals = match (&attributes, &wedges) {
            (Some(attributes), Some(wedges)) if self.wants_fit(cost_source) && attributes.lanes() > 0 => {
                Some(fit::Originals::new(attributes, wedges))
            }
            _ => None,
        };
        let sharp = self.options.sharp_deg.and_then(|deg| sharp_edges(&points, &faces, deg));
        let mut store = Store::new(&points, faces, wedges, regions);
        store.creases = sharp;
        drop(points);
        if recorded {
            store.names = Some((0..store.t.len() as u32).collect());
        }
        if let Some(classes) = self.input.data.region_classes {
            store.classes = classes.to_vec();
        }
        if let Some(locked) = self.constraints.locked() {
            store.lock(locked);
        }
        let changes = TopologyChanges::default();
        let root = Root { rows, originals, duplicate_faces: 0, is_kept, changes, weights };
        (store, endpoints, attributes, root)
    }

    /// Returns the regions of the ordered faces, if there are several.
    fn regions(&self) -> Option<Vec<RegionId>> {
        let regions = self.input.mesh?.regions()?;
        regions
            .iter()
            .any(|r| *r != regions[0])
            .then(|| self.ordered.of_faces(&self.input.surface, |i| regions[i]))
    }

    /// True if the run ends with a fit.
    pub(crate) fn wants_fit(&self, cost_source: CostSource) -> bool {
        match self.options.fit {
            Fit::Off => false,
            Fit::On => self.options.placement != Placement::Endpoint,
            Fit::Auto => {
                matches!(cost_source, CostSource::Engine) && self.options.placement == Placement::Optimal
            }
        }
    }

    /// Returns the wedges of the ordered faces, if there are attributes or regions.
    fn corners(&self, faces: &[[VertexId; 3]], points: &[Vec3]) -> Corners {
        let none = Corners { wedges: None, endpoints: None, rows: None };
        let Some(mesh) = self.input.mesh.filter(|m| m.has_attributes() || m.regions().is_some()) else {
            return none;
        };
        let mut wedges = self.ordered.wedges(&self.input.surface, mesh);
        debug_assert_eq!(wedges.len(), faces.len());
        if self.options.placement == Placement::Endpoint {
            // (A quick pass distinguishes sides only by texture coordinates.)
            let sides = match (&self.options.quick, mesh.uvs()) {
                (None, _) => SideValues::new(mesh),
                (Some(_), uvs) => SideValues::of_uvs(uvs.unwrap_or_default()),
            };
            let values = self.input.data.wedge_values.filter(|_| self.options.quick.is_some());
            let width = values.map_or(0, |values| values.len() / mesh.wedge_count().max(1));
            let endpoints = Wedges {
                sides,
                normals: mesh.normals().map(<[_]>::to_vec),
                values: values.map(Into::into),
                width,
                has_seam_lines: self.options.quick.is_some(),
                ..Wedges::default()
            };
            return Corners { wedges: Some(wedges), endpoints: Some(endpoints), rows: None };
        }
        let Some((rows, mut attributes)) = Rows::new(mesh, |w| self.place(mesh, w)) else { return none };
        for w in wedges.iter_mut().flatten() {
            *w = rows.wedge_rows[w.index()];
        }
        if attributes.is_empty() && mesh.regions().is_none() {
            // The values are the same everywhere, so the run does not need them.
            return Corners { wedges: None, endpoints: None, rows: Some((rows, None)) };
        }
        self.set_attribute_weights(&rows, &mut attributes, (faces, &wedges, points), &self.goal);
        Corners { wedges: Some(wedges), endpoints: None, rows: Some((rows, Some(attributes))) }
    }

    /// Sets the attribute weights for a goal.
    fn set_attribute_weights(
        &self,
        rows: &Rows,
        attributes: &mut Attributes,
        (faces, wedges, points): (&[[VertexId; 3]], &[[WedgeId; 3]], &[Vec3]),
        goal: &Goal,
    ) {
        let edge = result_edge(faces, points, goal);
        let on = WeightContext { faces, wedges, points, frame: self.ordered.frame, edge };
        rows.set_weights(attributes, &self.options.weights, &on);
    }
}

/// Estimates the edge length of a result, in the unit frame, as if its triangles were equilateral.
fn result_edge(faces: &[[VertexId; 3]], points: &[Vec3], goal: &Goal) -> f64 {
    let doubled = |t: &[VertexId; 3]| {
        let [a, b, c] = t.map(|v| points[v.index()]);
        f64::from((b - a).cross(c - a).length())
    };
    let area = 0.5 * faces.iter().map(doubled).sum::<f64>();
    let by_vertices = goal.vertices.map(|n| 2 * n);
    let count = goal.faces.or(by_vertices).unwrap_or(faces.len() / 10).clamp(1, faces.len().max(1));
    (area / (0.433 * count as f64)).sqrt()
}

/// Returns the maximum distance of vertices that are contracted as pairs, in the unit frame. (A box has a
/// diagonal below 2 there.)
pub(super) fn pairs_reach(distance: Length, frame: UnitFrame, diagonal: f64) -> f32 {
    frame.unit_length(distance.in_units(diagonal)).min(2.0) as f32
}
