//! Contents of a model part: objects, groups of properties, textures and the items of the build.

use std::collections::{BTreeMap, HashMap};

use crate::frame::Unit;

/// An affine map in the order of the file: three rows of axes, and the translation; row vectors are multiplied from the
/// left.
pub(super) type Transform = [f64; 12];

/// A model part.
#[derive(Default)]
pub(super) struct Part {
    /// The unit; the millimetre if there is none.
    pub(super) unit: Option<Unit>,
    pub(super) objects: BTreeMap<u32, Object>,
    pub(super) groups: BTreeMap<u32, Group>,
    pub(super) textures: BTreeMap<u32, TextureFile>,
    /// Metalness and roughness of the entries of display properties.
    pub(super) metallic: BTreeMap<u32, Vec<[f64; 2]>>,
    pub(super) items: Vec<PlacedObject>,
    pub(super) metadata: Vec<(String, String)>,
    /// Namespaces of the prefixes that the root declares.
    pub(super) namespaces: Vec<(String, String)>,
    /// Texts of paint, each once, and their numbers.
    pub(super) paint: Vec<Box<str>>,
    pub(super) paint_numbers: HashMap<Box<str>, u32>,
    /// Content that is dropped, for warnings.
    pub(super) dropped: Vec<&'static str>,
}

#[derive(Default)]
pub(super) struct Object {
    pub(super) name: String,
    /// Its type, if that is not `model`.
    pub(super) kind: Option<&'static str>,
    /// Property of the triangles without one of their own.
    pub(super) property: Option<(u32, u32)>,
    pub(super) vertices: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Properties of the triangles: empty if none has any.
    pub(super) properties: Vec<TriangleProperty>,
    /// Paint of triangles, ascending.
    pub(super) paint: Vec<PaintOfTriangle>,
    pub(super) sets: Vec<TriangleSet>,
    pub(super) components: Vec<PlacedObject>,
}

/// The group of properties of a triangle, and the entries of its corners; no group if it has the default.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct TriangleProperty {
    pub(super) group: Option<u32>,
    pub(super) corners: [u32; 3],
}

/// Paint of a slicer on a triangle.
#[derive(Clone, Copy)]
pub(super) struct PaintOfTriangle {
    pub(super) triangle: u32,
    /// An index into [`PAINTS`](super::marks::PAINTS).
    pub(super) kind: u8,
    /// An index into [`Part::paint`].
    pub(super) text: u32,
}

/// A set of triangles.
pub(super) struct TriangleSet {
    pub(super) name: String,
    pub(super) identifier: String,
    /// First and last triangles of ranges.
    pub(super) ranges: Vec<[u32; 2]>,
}

/// A placed object: an item of the build, or a component of an object.
#[derive(Default)]
pub(super) struct PlacedObject {
    /// The part that has the object, if it is another one.
    pub(super) path: Option<String>,
    pub(super) object: u32,
    pub(super) transform: Option<Transform>,
    /// Marks of an item.
    pub(super) marks: Vec<ItemMark>,
}

/// A mark of an item of the build, which a slicer sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ItemMark {
    /// It is not printed.
    NotPrinted,
    /// It is not moved down to the bed (OrcaSlicer).
    NotDropped,
}

impl ItemMark {
    pub(super) const ALL: [Self; 2] = [Self::NotPrinted, Self::NotDropped];

    /// Returns the name of the attribute that is 0 for the mark.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::NotPrinted => "printable",
            Self::NotDropped => "auto_drop",
        }
    }
}

/// A group of properties.
pub(super) enum Group {
    /// Names and colours (sRGB) of materials, and the display properties that describe them further.
    Materials(Vec<(String, [f32; 4])>, Option<u32>),
    /// Colours, sRGB.
    Colors(Vec<[f32; 4]>),
    /// A texture, and coordinates in it.
    Coordinates(u32, Vec<[f32; 2]>),
    /// Indices into several groups; one of them is used.
    Several(Vec<u32>, Vec<Vec<u32>>),
}

/// An image, and how it repeats.
pub(super) struct TextureFile {
    pub(super) path: String,
    pub(super) wrap: [u32; 2],
    pub(super) is_nearest: bool,
}

impl Part {
    pub(super) fn unit(&self) -> Unit {
        self.unit.unwrap_or(Unit::Millimeter)
    }

    /// Returns the number of a text of paint.
    pub(super) fn paint_number(&mut self, text: &[u8]) -> u32 {
        let text = String::from_utf8_lossy(text);
        if let Some(&number) = self.paint_numbers.get(&*text) {
            return number;
        }
        let number = self.paint.len() as u32;
        self.paint.push(text.as_ref().into());
        self.paint_numbers.insert(text.into(), number);
        number
    }

    /// Records that a kind of content is dropped.
    pub(super) fn drop_content(&mut self, what: &'static str) {
        if !self.dropped.contains(&what) {
            self.dropped.push(what);
        }
    }
}
