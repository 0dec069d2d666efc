//! Rows of a recorded mesh: written from the engine's attributes, read for the fit of a level, and averaged
//! where they displace a vertex.

use std::collections::BTreeMap;

use lodsmith_core::splits::Layout;
use lodsmith_core::{Semantic, WedgeId};

use super::{Column, ColumnSource, Rows, unit};
use crate::collapse::attributes::Attributes;

/// Changes of values below this fraction of the largest one are rounding.
const ROUNDING: f32 = 1e-6;

/// Offsets of columns in the rows of a mesh.
#[derive(Clone)]
pub(crate) struct RowPlaces {
    /// Offset of each column; `None` if it is the same at all wedges, or was added only for the run.
    columns: Vec<Option<usize>>,
    /// Offsets of joints and of weights, for each set.
    skins: Vec<[usize; 2]>,
    /// For each discrete attribute its offset in a label, its number of values, and its offset in a row.
    labels: Vec<[usize; 3]>,
}

impl Rows {
    /// Returns the offsets of the columns, and of joints and weights of each set, in rows of a mesh.
    pub(crate) fn offsets(&self, layout: &Layout) -> RowPlaces {
        let uvs = 3 * usize::from(layout.has_normals);
        let colors = uvs + 2 * usize::from(layout.has_uvs);
        let mut at = colors + 4 * usize::from(layout.has_colors);
        let mut further = Vec::new();
        for (semantic, width) in &layout.further {
            further.push((semantic, *width, at));
            at += width;
        }
        let find = |s: &Semantic, n: usize| further.iter().find(|f| f.0 == s && f.1 == n).map(|f| f.2);
        let place = |c: &Column| match &c.source {
            ColumnSource::Normals => layout.has_normals.then_some(0),
            ColumnSource::Uvs => Some(uvs),
            ColumnSource::Colors => Some(colors),
            ColumnSource::Middle => None,
            ColumnSource::Further(semantic) => find(semantic, c.width),
        };
        let varying = |c: &Column| if c.constant.is_some() { None } else { place(c) };
        let skins = self
            .skin_sets
            .iter()
            .filter_map(|&set| Some([find(&Semantic::Joints(set), 4)?, find(&Semantic::Weights(set), 4)?]));
        let labels = self.labels.kinds().filter_map(|(s, n, at)| Some([at, n, find(s, n)?]));
        RowPlaces {
            columns: self.layout.iter().map(varying).collect(),
            skins: skins.collect(),
            labels: labels.collect(),
        }
    }

    /// Writes the engine's values of a wedge into its row of a mesh; values that are the same at all wedges
    /// are left as they are.
    pub(crate) fn write(&self, attributes: &Attributes, w: WedgeId, places: &RowPlaces, row: &mut [f32]) {
        self.write_values(attributes.of(w), places, row);
        if let Some(joint_weights) = attributes.joint_weights.get(w.index()) {
            self.write_joint_weights(joint_weights, places, row);
        }
        if let Some(&label) = attributes.labels.get(w.index()) {
            for &[from, n, to] in &places.labels {
                row[to..to + n].copy_from_slice(&self.labels.of(label)[from..from + n]);
            }
        }
    }

    fn write_values(&self, values: &[f32], places: &RowPlaces, row: &mut [f32]) {
        for (c, at) in self.placed(places) {
            let (from, to) = (&values[c.offset..c.offset + c.width], &mut row[at..at + c.width]);
            match &c.source {
                ColumnSource::Normals => to.copy_from_slice(&unit(from)),
                _ => to.iter_mut().enumerate().for_each(|(k, to)| *to = c.to_mesh_units(k, from[k])),
            }
            if matches!(&c.source, ColumnSource::Further(Semantic::Tangent)) && c.width == 4 {
                to[..3].copy_from_slice(&unit(&from[..3]));
                to[3] = if from[3] < 0.0 { -1.0 } else { 1.0 };
            }
        }
    }

    /// Writes as many joints as there is room for, the strongest first.
    fn write_joint_weights(&self, joint_weights: &[(u32, f32)], places: &RowPlaces, row: &mut [f32]) {
        let max_joints = 4 * self.skin_sets.len();
        let kept = &joint_weights[..joint_weights.len().min(max_joints)];
        let sum: f32 = kept.iter().map(|p| p.1).sum();
        for (i, [joints, weights]) in places.skins.iter().enumerate() {
            for k in 0..4 {
                let (joint, weight) = kept.get(4 * i + k).copied().unwrap_or((0, 0.0));
                row[joints + k] = joint as f32;
                row[weights + k] = if sum > 0.0 { weight / sum } else { 0.0 };
            }
        }
    }

    /// Returns the columns that are in rows of a mesh, with their offsets.
    fn placed<'a>(&'a self, places: &'a RowPlaces) -> impl Iterator<Item = (&'a Column, usize)> {
        self.layout.iter().zip(&places.columns).filter_map(|(c, at)| Some((c, (*at)?)))
    }

    /// Returns true if any attribute displaces all wedges of a vertex equally.
    pub(crate) fn moves_any_whole(&self) -> bool {
        self.has_joints_per_vertex && !self.skin_sets.is_empty() || self.layout.iter().any(|c| c.moves_whole)
    }

    /// Averages, over the rows of one vertex, the attributes that displace it as a whole.
    pub(crate) fn average_movement(&self, places: &RowPlaces, rows: &mut [Vec<f32>]) {
        let are_equal = |rows: &[Vec<f32>], of: &dyn Fn(&[f32]) -> Vec<f32>| {
            rows.windows(2).all(|r| of(&r[0]) == of(&r[1]))
        };
        for (c, at) in self.placed(places).filter(|c| c.0.moves_whole) {
            let range = at..at + c.width;
            if are_equal(rows, &|row| row[range.clone()].to_vec()) {
                continue;
            }
            for i in range {
                let sum: f64 = rows.iter().map(|row| f64::from(row[i])).sum();
                let mean = (sum / rows.len() as f64) as f32;
                rows.iter_mut().for_each(|row| row[i] = mean);
            }
        }
        let slots = || places.skins.iter().flat_map(|s| (0..4).map(move |k| s.map(|at| at + k)));
        if !self.has_joints_per_vertex || are_equal(rows, &|row| slots().flatten().map(|i| row[i]).collect())
        {
            return;
        }
        let mut sums: BTreeMap<u32, f32> = BTreeMap::new();
        for row in &*rows {
            for [joint, weight] in slots().filter(|s| row[s[1]] > 0.0) {
                *sums.entry(row[joint] as u32).or_default() += row[weight];
            }
        }
        let mut joint_weights: Vec<(u32, f32)> = sums.into_iter().collect();
        joint_weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        rows.iter_mut().for_each(|row| self.write_joint_weights(&joint_weights, places, row));
    }

    /// Sets the engine's values of a wedge from its row of a mesh; joints are left as they are.
    pub(crate) fn read(&self, attributes: &mut Attributes, w: WedgeId, places: &RowPlaces, row: &[f32]) {
        let values = attributes.values_mut(w);
        for (c, at) in self.placed(places) {
            let own = values[c.offset..c.offset + c.width].iter_mut();
            own.zip(&row[at..]).for_each(|(to, from)| {
                *to = if from.is_finite() { from / c.divisor } else { 0.0 };
            });
        }
    }

    /// Sets the weight of values that no row of a mesh contains to 0.
    pub(crate) fn clear_weights_without_place(&self, weights: &mut [f32], places: &RowPlaces) {
        let columns = self.layout.iter().zip(&places.columns);
        for (c, _) in columns.filter(|c| c.0.constant.is_none() && c.1.is_none()) {
            weights[c.offset..c.offset + c.width].fill(0.0);
        }
    }

    /// Returns the changes made by a fit in a row of a mesh; `None` if they are rounding. Attributes that
    /// displace a vertex are not changed.
    pub(crate) fn change(
        &self,
        attributes: &Attributes,
        w: WedgeId,
        places: &RowPlaces,
        row: &[f32],
    ) -> Option<Vec<f32>> {
        let mut change = row.to_vec();
        self.write_values(attributes.of(w), places, &mut change);
        change.iter_mut().zip(row).for_each(|(now, before)| *now -= before);
        for (c, at) in self.placed(places) {
            let own = &mut change[at..at + c.width];
            let least = ROUNDING * c.largest * c.divisor;
            let is_rounding = own.iter().all(|x| x.abs() <= least);
            if c.is_movement() || is_rounding || own.iter().any(|x| !x.is_finite()) {
                own.fill(0.0);
            }
        }
        change.iter().any(|x| *x != 0.0).then_some(change)
    }
}
