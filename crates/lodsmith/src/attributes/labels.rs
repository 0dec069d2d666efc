//! Discrete attributes: whole numbers that identify something. They are not blended: each row takes all of
//! them from one wedge of the input, by its label.

use std::collections::HashMap;

use lodsmith_core::{Attribute, Semantic, TriMesh, WedgeId};

/// The discrete attributes of a mesh, as distinct combinations of values (labels).
#[derive(Clone, Default)]
pub(crate) struct Labels {
    /// Meaning and number of values of each attribute.
    kinds: Vec<(Semantic, usize)>,
    width: usize,
    /// The values of each label, in order of first occurrence.
    values: Vec<f32>,
}

impl Labels {
    /// Returns the labels of a mesh, and the label of each wedge; no labels of wedges if all are equal.
    pub(crate) fn new(mesh: &TriMesh) -> (Self, Vec<u32>) {
        let own: Vec<&Attribute> =
            mesh.further_attributes().iter().filter(|a| a.semantic.is_discrete()).collect();
        let kinds: Vec<_> = own.iter().map(|a| (a.semantic.clone(), a.width)).collect();
        let mut all = Self { width: kinds.iter().map(|k| k.1).sum(), kinds, values: Vec::new() };
        if all.kinds.is_empty() {
            return (all, Vec::new());
        }
        let mut known: HashMap<Vec<u32>, u32> = HashMap::new();
        let label = |w| {
            let row = || own.iter().flat_map(|a| a.of(WedgeId::new(w)));
            let count = known.len() as u32;
            *known.entry(row().map(|x| x.to_bits()).collect()).or_insert_with(|| {
                all.values.extend(row());
                count
            })
        };
        let labels: Vec<u32> = (0..mesh.wedge_count()).map(label).collect();
        let is_one = all.values.len() <= all.width;
        (all, if is_one { Vec::new() } else { labels })
    }

    /// Returns for each attribute its meaning, its number of values, and their offset in the [values of a
    /// label](Self::of).
    pub(crate) fn kinds(&self) -> impl Iterator<Item = (&Semantic, usize, usize)> {
        let mut next = 0;
        self.kinds.iter().map(move |(semantic, width)| {
            next += width;
            (semantic, *width, next - width)
        })
    }

    /// Returns the values of a label, of all discrete attributes.
    pub(crate) fn of(&self, label: u32) -> &[f32] {
        &self.values[label as usize * self.width..][..self.width]
    }
}
