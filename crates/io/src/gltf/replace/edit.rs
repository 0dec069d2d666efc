//! A scene under edit: new accessors, and their bytes until they are placed in the file.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use serde_json::Value;

use super::super::accessors::Component;
use super::super::encode::NumberType;
use super::super::extension_losses::ExtensionLosses;
use super::super::renumber::Renumbering;
use crate::error::Warning;

/// Targets of views.
pub(super) const VERTEX_TARGET: u32 = 34962;
pub(super) const INDEX_TARGET: u32 = 34963;

/// A new accessor.
pub(super) struct Piece {
    pub(super) spot: Spot,
    /// The accessor that it replaces.
    pub(super) old: Option<usize>,
    pub(super) kind: NumberType,
    pub(super) width: usize,
    pub(super) count: usize,
    pub(super) min: Vec<Value>,
    pub(super) max: Vec<Value>,
    pub(super) data: Data,
}

/// Location of a reference to an accessor.
pub(super) struct Spot {
    pub(super) mesh: usize,
    pub(super) primitive: usize,
    pub(super) part: AccessorRole,
}

impl Spot {
    /// Returns the name of the attribute; `None` for indices and targets.
    pub(super) fn attribute(&self) -> Option<String> {
        match &self.part {
            AccessorRole::Attribute(name) => Some(name.clone()),
            AccessorRole::Indices | AccessorRole::Target(..) => None,
        }
    }
}

pub(super) enum AccessorRole {
    Indices,
    Attribute(String),
    Target(usize, String),
}

/// Storage of the numbers of an accessor.
pub(super) enum Data {
    /// All are zero.
    Zeros,
    /// Shared with this earlier piece, which replaces the same accessor.
    Shared(usize),
    Dense(NewView),
    /// Non-zero elements: their number, the type of their indices, and the bytes of indices and values.
    Sparse(usize, Component, [NewView; 2]),
}

/// A range of the new bytes: a view.
pub(super) struct NewView {
    pub(super) bytes: Range<usize>,
    pub(super) stride: Option<usize>,
    pub(super) target: Option<u32>,
}

/// The scene under edit.
pub(super) struct Edit<'s> {
    pub(super) source: &'s Value,
    pub(super) json: Value,
    pub(super) pieces: Vec<Piece>,
    /// Pieces by the accessor that they replace and a hash of their bytes.
    pub(super) known: HashMap<(usize, u64), usize>,
    /// Bytes of the pieces.
    pub(super) fresh: Vec<u8>,
    /// Accessors that replaced primitives referred to.
    pub(super) released: BTreeSet<usize>,
    /// Names of primitives that have no faces left.
    pub(super) emptied: Vec<String>,
    pub(super) warnings: Vec<Warning>,
    /// Extensions that are left out.
    pub(super) losses: ExtensionLosses,
    /// Changes of numbers and of their meaning.
    pub(super) changes: Renumbering,
}

impl<'s> Edit<'s> {
    pub(super) fn new(source: &'s Value) -> Self {
        Self {
            source,
            json: source.clone(),
            pieces: Vec::new(),
            known: HashMap::new(),
            fresh: Vec::new(),
            released: BTreeSet::new(),
            emptied: Vec::new(),
            warnings: Vec::new(),
            losses: ExtensionLosses::default(),
            changes: Renumbering::default(),
        }
    }
}
