//! Creation of new accessors and their bytes, which are placed in the file later.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use serde_json::Value;

use super::super::accessors::Component;
use super::super::container::list;
use super::super::encode::{EncodedAccessor, NumberType};
use super::edit::{Data, Edit, INDEX_TARGET, NewView, Piece, Spot, VERTEX_TARGET};

impl Edit<'_> {
    /// Appends bytes, aligned to 4.
    fn append(&mut self, bytes: &[u8]) -> Range<usize> {
        let start = self.fresh.len().next_multiple_of(4);
        self.fresh.resize(start, 0);
        self.fresh.extend_from_slice(bytes);
        start..self.fresh.len()
    }

    pub(super) fn dense(
        &mut self,
        spot: Spot,
        old: Option<usize>,
        encoded: EncodedAccessor,
        target: Option<u32>,
    ) {
        let tight = encoded.kind.component.size() * encoded.width;
        let bytes = self.append(&encoded.bytes);
        let stride = (encoded.stride != tight).then_some(encoded.stride);
        let count = bytes.len() / encoded.stride;
        self.piece(spot, old, encoded, count, Data::Dense(NewView { bytes, stride, target }));
    }

    pub(super) fn zeros(&mut self, spot: Spot, old: Option<usize>, encoded: EncodedAccessor, count: usize) {
        self.piece(spot, old, encoded, count, Data::Zeros);
    }

    /// Adds the data of a morph target: sparse if it was sparse and still few elements are not zero.
    pub(super) fn target(
        &mut self,
        spot: Spot,
        old: Option<usize>,
        encoded: EncodedAccessor,
        values: &[f32],
    ) {
        let width = encoded.width;
        let count = values.len() / width;
        let before = old.and_then(|i| list(self.source, "accessors").get(i)).unwrap_or(&Value::Null);
        let was_sparse = before["bufferView"].is_null();
        let is_tight = encoded.stride == encoded.kind.component.size() * width;
        let moved: Vec<usize> =
            (0..count).filter(|i| values[i * width..][..width].iter().any(|x| *x != 0.0)).collect();
        // Guessed: beyond a third, the indices cost as much as they save.
        if !was_sparse || !is_tight || moved.len() * 3 > count {
            return self.dense(spot, old, encoded, Some(VERTEX_TARGET));
        }
        if moved.is_empty() {
            return self.zeros(spot, old, encoded, count);
        }
        let is_small = count <= usize::from(u16::MAX);
        let mut indices = Vec::new();
        for &i in &moved {
            if is_small {
                indices.extend_from_slice(&(i as u16).to_le_bytes());
            } else {
                indices.extend_from_slice(&(i as u32).to_le_bytes());
            }
        }
        let stride = encoded.stride;
        let numbers: Vec<u8> =
            moved.iter().flat_map(|i| encoded.bytes[i * stride..][..stride].iter().copied()).collect();
        let views = [indices, numbers].map(|bytes| {
            let bytes = self.append(&bytes);
            NewView { bytes, stride: None, target: None }
        });
        let component = if is_small { Component::U16 } else { Component::U32 };
        self.piece(spot, old, encoded, count, Data::Sparse(moved.len(), component, views));
    }

    pub(super) fn indices(&mut self, spot: Spot, old: Option<usize>, indices: &[u32], vertices: usize) {
        // The largest value of a type is not allowed as an index.
        let is_small = vertices <= usize::from(u16::MAX);
        let component = if is_small { Component::U16 } else { Component::U32 };
        let mut bytes = Vec::with_capacity(indices.len() * component.size());
        for i in indices {
            if is_small {
                bytes.extend_from_slice(&(*i as u16).to_le_bytes());
            } else {
                bytes.extend_from_slice(&i.to_le_bytes());
            }
        }
        let bound = |x: Option<&u32>| vec![x.copied().unwrap_or(0).into()];
        let (min, max) = (bound(indices.iter().min()), bound(indices.iter().max()));
        let kind = NumberType { component, normalized: false };
        let bytes = self.append(&bytes);
        let data = Data::Dense(NewView { bytes, stride: None, target: Some(INDEX_TARGET) });
        self.push(Piece { spot, old, kind, width: 1, count: indices.len(), min, max, data });
    }

    fn piece(&mut self, spot: Spot, old: Option<usize>, encoded: EncodedAccessor, count: usize, data: Data) {
        let EncodedAccessor { kind, width, min, max, .. } = encoded;
        self.push(Piece { spot, old, kind, width, count, min, max, data });
    }

    /// Adds a piece whose bytes were appended last. Data that primitives shared, and that is still equal, is
    /// shared again.
    fn push(&mut self, mut piece: Piece) {
        let next = self.pieces.len();
        if let (Some(old), Data::Dense(stretch)) = (piece.old, &piece.data) {
            let mut hasher = DefaultHasher::new();
            self.fresh[stretch.bytes.clone()].hash(&mut hasher);
            let twin = *self.known.entry((old, hasher.finish())).or_insert(next);
            if let Some(Piece { kind, width, data: Data::Dense(other), .. }) = self.pieces.get(twin)
                && (*kind, *width) == (piece.kind, piece.width)
                && self.fresh[other.bytes.clone()] == self.fresh[stretch.bytes.clone()]
            {
                self.fresh.truncate(stretch.bytes.start);
                piece.data = Data::Shared(twin);
            }
        }
        self.pieces.push(piece);
    }
}
