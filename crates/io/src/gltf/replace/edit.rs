//! A scene as it changes: new accessors, and the bytes that they have until these have a place in the file.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use serde_json::Value;

use super::super::accessors::Component;
use super::super::encode::Kind;
use crate::error::Warning;

/// What views are for.
pub(super) const VERTICES: u32 = 34962;
pub(super) const INDICES: u32 = 34963;

/// An extension of a primitive whose content depends on its vertices, and goes with them.
pub(super) const OF_VERTICES: &str = "CESIUM_primitive_outline";

/// A new accessor.
pub(super) struct Piece {
    pub(super) spot: Spot,
    /// The accessor that stood there.
    pub(super) old: Option<usize>,
    pub(super) kind: Kind,
    pub(super) width: usize,
    pub(super) count: usize,
    pub(super) min: Vec<Value>,
    pub(super) max: Vec<Value>,
    pub(super) data: Data,
}

/// Where an accessor is named.
pub(super) struct Spot {
    pub(super) mesh: usize,
    pub(super) primitive: usize,
    pub(super) part: Part,
}

impl Spot {
    /// The attribute that is named here.
    pub(super) fn attribute(&self) -> Option<String> {
        match &self.part {
            Part::Attribute(name) => Some(name.clone()),
            Part::Indices | Part::Target(..) => None,
        }
    }
}

pub(super) enum Part {
    Indices,
    Attribute(String),
    Target(usize, String),
}

/// Where the numbers of an accessor are.
pub(super) enum Data {
    /// All are zero.
    Nowhere,
    /// In this earlier piece, which takes the place of the same accessor.
    Shared(usize),
    Dense(Stretch),
    /// Those that are not zero: how many, the type of their indices, these, and the numbers.
    Sparse(usize, Component, [Stretch; 2]),
}

/// Some of the new bytes: a view.
pub(super) struct Stretch {
    pub(super) bytes: Range<usize>,
    pub(super) stride: Option<usize>,
    pub(super) target: Option<u32>,
}

/// The scene as it changes.
pub(super) struct Edit<'s> {
    pub(super) source: &'s Value,
    pub(super) json: Value,
    pub(super) pieces: Vec<Piece>,
    /// Pieces by the accessor that they replace and a hash of their bytes.
    pub(super) known: HashMap<(usize, u64), usize>,
    /// Bytes of the pieces.
    pub(super) fresh: Vec<u8>,
    /// Accessors that replaced primitives named.
    pub(super) let_go: BTreeSet<usize>,
    /// Primitives that have no face any more.
    pub(super) emptied: Vec<String>,
    pub(super) warnings: Vec<Warning>,
}

impl<'s> Edit<'s> {
    pub(super) fn new(source: &'s Value) -> Self {
        Self {
            source,
            json: source.clone(),
            pieces: Vec::new(),
            known: HashMap::new(),
            fresh: Vec::new(),
            let_go: BTreeSet::new(),
            emptied: Vec::new(),
            warnings: Vec::new(),
        }
    }
}
