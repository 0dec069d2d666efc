//! Conversion of pieces to the accessors and views of the file, and the bytes of its only buffer.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use serde_json::{Value, json};

use super::super::container::{list, list_mut, number};
use super::super::lists::{drop_nulls, move_view, put, view_span};
use super::super::mesh::TYPE_NAMES;
use super::super::references::{ReferenceKind, each_reference, views_of};
use super::super::repack::Repacked;
use super::edit::{AccessorRole, Data, Edit, NewView, Piece, Spot};
use crate::error::Warning;

/// Indices of accessors and views that are free.
struct FreeIndices {
    accessors: BTreeSet<usize>,
    views: BTreeSet<usize>,
}

impl Edit<'_> {
    /// Places the pieces in the file; returns the JSON, its bytes and the warnings.
    pub(super) fn finish(mut self, buffers: &[Arc<Vec<u8>>]) -> (Value, Vec<u8>, Vec<Warning>) {
        self.free();
        let is_free = |json: &Value, name: &str| -> BTreeSet<usize> {
            list(json, name).iter().enumerate().filter(|(_, v)| v.is_null()).map(|(i, _)| i).collect()
        };
        let mut free = FreeIndices {
            accessors: is_free(&self.json, "accessors"),
            views: is_free(&self.json, "bufferViews"),
        };
        let spans_of = |is_kept: bool| {
            let views = list(self.source, "bufferViews").iter().enumerate();
            views
                .filter(|(i, _)| free.views.contains(i) != is_kept)
                .filter_map(|(_, v)| view_span(v))
                .collect::<Vec<_>>()
        };
        let mut repacked = Repacked::new(buffers, &spans_of(true), &spans_of(false));
        for view in list_mut(&mut self.json, "bufferViews") {
            move_view(view, &repacked);
        }
        let mut bytes = std::mem::take(&mut repacked.bytes);
        if !self.fresh.is_empty() {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let base = bytes.len();
        bytes.extend_from_slice(&self.fresh);

        // Pieces that reuse the index they replace come first, so that no other piece takes it before them.
        let pieces = std::mem::take(&mut self.pieces);
        let mut accessors: Vec<Option<usize>> = Vec::with_capacity(pieces.len());
        for piece in &pieces {
            let reused = piece.old.filter(|_| !matches!(piece.data, Data::Shared(_)));
            accessors.push(reused.filter(|old| free.accessors.remove(old)));
        }
        let mut views: Vec<Vec<Option<usize>>> = Vec::with_capacity(pieces.len());
        for (piece, accessor) in pieces.iter().zip(&accessors) {
            let before = accessor.map_or(&Value::Null, |a| &self.source["accessors"][a]);
            let named = match &piece.data {
                Data::Zeros | Data::Shared(_) => Vec::new(),
                Data::Dense(_) => vec![&before["bufferView"]],
                Data::Sparse(..) => {
                    ["indices", "values"].map(|k| &before["sparse"][k]["bufferView"]).to_vec()
                }
            };
            views.push(named.into_iter().map(|v| number(v).filter(|v| free.views.remove(v))).collect());
        }
        let mut placed = Vec::with_capacity(pieces.len());
        for ((piece, accessor), views) in pieces.into_iter().zip(accessors).zip(views) {
            let at = match piece.data {
                Data::Shared(twin) => placed[twin],
                _ => self.accessor(&piece, accessor, &views, base, &mut free),
            };
            placed.push(at);
            let Spot { mesh, primitive, part } = piece.spot;
            let primitive = &mut self.json["meshes"][mesh]["primitives"][primitive];
            match part {
                AccessorRole::Indices => primitive["indices"] = at.into(),
                AccessorRole::Attribute(key) => primitive["attributes"][key] = at.into(),
                AccessorRole::Target(target, key) => primitive["targets"][target][key] = at.into(),
            }
        }
        self.tidy();
        self.changes.remove_nulls(&self.json);
        self.changes.apply(&mut self.json, &mut self.losses);
        self.warnings.extend(self.losses.warnings());
        (self.json, bytes, self.warnings)
    }

    /// Clears released accessors and views that nothing else refers to.
    fn free(&mut self) {
        let mut still = [HashSet::new(), HashSet::new()];
        let mut views = BTreeSet::new();
        each_reference(&mut self.json, &mut |named, value| {
            if let (ReferenceKind::Accessor, Some(i)) = (named, number(value)) {
                still[0].insert(i);
            }
        });
        for &i in self.released.iter().filter(|i| !still[0].contains(*i)) {
            let Some(accessor) = list_mut(&mut self.json, "accessors").get_mut(i) else { continue };
            let mut taken = accessor.take();
            self.changes.change([i]);
            views_of(&mut taken, &mut |_, value| views.extend(number(value)));
        }
        each_reference(&mut self.json, &mut |named, value| {
            if let (ReferenceKind::View, Some(i)) = (named, number(value)) {
                still[1].insert(i);
            }
        });
        for &i in views.iter().filter(|i| !still[1].contains(*i)) {
            if let Some(view) = list_mut(&mut self.json, "bufferViews").get_mut(i) {
                *view = Value::Null;
                self.changes.change([i]);
            }
        }
    }

    /// Creates the accessor of a piece, with its views; returns its index.
    fn accessor(
        &mut self,
        piece: &Piece,
        accessor: Option<usize>,
        views: &[Option<usize>],
        base: usize,
        free: &mut FreeIndices,
    ) -> usize {
        let source = accessor.and_then(|a| self.source["accessors"][a].as_object());
        let mut object = source.cloned().unwrap_or_default();
        let had_bounds = object.contains_key("min") || object.contains_key("max");
        ["byteOffset", "normalized", "min", "max", "sparse", "bufferView"].iter().for_each(|key| {
            // A null keeps the position of a key that is written again below.
            if let Some(value) = object.get_mut(*key) {
                *value = Value::Null;
            }
        });
        let mut stretches = match &piece.data {
            Data::Zeros | Data::Shared(_) => Vec::new(),
            Data::Dense(one) => vec![one],
            Data::Sparse(_, _, two) => two.iter().collect(),
        };
        let mut numbers = Vec::new();
        for (stretch, old) in stretches.drain(..).zip(views) {
            numbers.push(self.place_view(stretch, *old, base, free));
        }
        match (&piece.data, numbers.as_slice()) {
            (Data::Dense(_), [view]) => {
                object.insert("bufferView".to_owned(), (*view).into());
            }
            (Data::Sparse(count, component, _), [indices, values]) => {
                let sparse = json!({
                    "count": count,
                    "indices": { "bufferView": indices, "componentType": component.code() },
                    "values": { "bufferView": values },
                });
                object.insert("sparse".to_owned(), sparse);
            }
            _ => {}
        }
        object.insert("componentType".to_owned(), piece.kind.component.code().into());
        if piece.kind.normalized {
            object.insert("normalized".to_owned(), true.into());
        }
        object.insert("count".to_owned(), piece.count.into());
        object.insert("type".to_owned(), TYPE_NAMES[piece.width].into());
        let is_position = match &piece.spot.part {
            AccessorRole::Attribute(key) | AccessorRole::Target(_, key) => key == "POSITION",
            AccessorRole::Indices => false,
        };
        if had_bounds || is_position {
            object.insert("min".to_owned(), piece.min.clone().into());
            object.insert("max".to_owned(), piece.max.clone().into());
        }
        drop_nulls(&mut object);
        put(&mut self.json, "accessors", accessor.or_else(|| free.accessors.pop_first()), object)
    }

    fn place_view(
        &mut self,
        stretch: &NewView,
        old: Option<usize>,
        base: usize,
        free: &mut FreeIndices,
    ) -> usize {
        let source = old.and_then(|v| self.source["bufferViews"][v].as_object());
        let mut view = Value::Object(source.cloned().unwrap_or_default());
        view["buffer"] = 0.into();
        view["byteOffset"] = (base + stretch.bytes.start).into();
        view["byteLength"] = stretch.bytes.len().into();
        for (key, value) in
            [("byteStride", stretch.stride.map(Value::from)), ("target", stretch.target.map(Value::from))]
        {
            view[key] = value.into();
        }
        let mut object = view.as_object().cloned().unwrap_or_default();
        drop_nulls(&mut object);
        put(&mut self.json, "bufferViews", old.or_else(|| free.views.pop_first()), object)
    }
}
