//! `lodsmith_mesh_view`, and its conversion.

use std::ffi::c_char;
use std::ptr;

use lodsmith::OwnedMeshData;
use lodsmith_core::mesh::{IntegerType, Morphed};
use lodsmith_core::{Attribute, Positions, RegionId, Semantic, TriMesh, VertexId};

use crate::fault::Fault;
use crate::memory::{self, CStructure, Rows};

/// Named values that are interpolated.
pub const LODSMITH_ATTRIBUTE_CUSTOM: i32 = 0;
/// Named whole numbers that are never interpolated; exact up to 16,777,216.
pub const LODSMITH_ATTRIBUTE_DISCRETE: i32 = 1;
/// Four values: a direction, and the sign of the bitangent.
pub const LODSMITH_ATTRIBUTE_TANGENT: i32 = 2;
/// Two values: texture coordinates of an additional set, from 1.
pub const LODSMITH_ATTRIBUTE_UV: i32 = 3;
/// Four values: colours of an additional set, from 1.
pub const LODSMITH_ATTRIBUTE_COLOR: i32 = 4;
/// Four values: joint indices of a skin.
pub const LODSMITH_ATTRIBUTE_JOINTS: i32 = 5;
/// Four values: weights of the joints of the same set.
pub const LODSMITH_ATTRIBUTE_WEIGHTS: i32 = 6;
/// Three values: offsets of positions of morph target `set`.
pub const LODSMITH_ATTRIBUTE_MORPH_POSITION: i32 = 7;
/// Three values: offsets of normals of morph target `set`.
pub const LODSMITH_ATTRIBUTE_MORPH_NORMAL: i32 = 8;
/// Three values: offsets of tangents of morph target `set`.
pub const LODSMITH_ATTRIBUTE_MORPH_TANGENT: i32 = 9;

/// An attribute of all vertices.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LodsmithAttribute {
    /// One of `LODSMITH_ATTRIBUTE_...`.
    pub kind: i32,
    /// Index of the set or morph target, for kinds that have several.
    pub set: u32,
    /// Name, in UTF-8, for custom and discrete attributes; may be null for other kinds.
    pub name: *const c_char,
    /// Number of values for each vertex.
    pub width: usize,
    /// `width` floats every `stride` bytes.
    pub values: *const f32,
    /// Bytes from one vertex to the next.
    pub stride: usize,
}

/// A mesh in memory of the caller, which is only read. Fill it with zeros, then set `size` and the fields that the mesh
/// has. Strides are in bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LodsmithMeshView {
    /// `sizeof(lodsmith_mesh_view)` of the caller's header.
    pub size: usize,
    /// Number of vertices. Several vertices at the same position are the sides of a seam.
    pub vertex_count: usize,
    /// Three floats for each vertex; null if the positions are doubles.
    pub positions: *const f32,
    /// Three doubles for each vertex; null if the positions are floats.
    pub positions_f64: *const f64,
    /// Bytes from one position to the next.
    pub positions_stride: usize,
    /// Three indices for each triangle, counter-clockwise seen from outside.
    pub indices: *const u32,
    /// Number of indices.
    pub index_count: usize,
    /// Three floats for each vertex, of unit length; may be null.
    pub normals: *const f32,
    /// Bytes from one normal to the next.
    pub normals_stride: usize,
    /// Two floats for each vertex, (0, 0) at the lower left; may be null.
    pub uvs: *const f32,
    /// Bytes from one pair of texture coordinates to the next.
    pub uvs_stride: usize,
    /// Four floats for each vertex: red, green, blue, alpha; may be null.
    pub colors: *const f32,
    /// Bytes from one colour to the next.
    pub colors_stride: usize,
    /// Additional attributes; may be null.
    pub attributes: *const LodsmithAttribute,
    /// Number of `attributes`.
    pub attribute_count: usize,
    /// The region (such as a material or group) of each triangle, without gaps; may be null.
    pub regions: *const u32,
    /// Not 0 for each vertex that must keep its position and attributes, without gaps; may be null.
    pub locked: *const u8,
    /// Importance of each vertex, 1 is neutral, without gaps; may be null.
    pub importance: *const f32,
    /// Share of the error limit at each vertex, from 0 (keep) to 1, without gaps; may be null.
    pub error_map: *const f32,
}

// SAFETY: `repr(C)`, all fields are numbers and pointers, and the first is a `usize`.
unsafe impl CStructure for LodsmithMeshView {
    const NAME: &'static str = "lodsmith_mesh_view";
}

impl LodsmithMeshView {
    /// A view of an empty mesh.
    pub const EMPTY: Self = Self {
        size: size_of::<Self>(),
        vertex_count: 0,
        positions: ptr::null(),
        positions_f64: ptr::null(),
        positions_stride: 0,
        indices: ptr::null(),
        index_count: 0,
        normals: ptr::null(),
        normals_stride: 0,
        uvs: ptr::null(),
        uvs_stride: 0,
        colors: ptr::null(),
        colors_stride: 0,
        attributes: ptr::null(),
        attribute_count: 0,
        regions: ptr::null(),
        locked: ptr::null(),
        importance: ptr::null(),
        error_map: ptr::null(),
    };

    /// Copies the mesh.
    ///
    /// # Safety
    /// All buffers that are not null must have their extents.
    pub(crate) unsafe fn mesh(&self) -> Result<TriMesh, Fault> {
        let n = self.vertex_count;
        // SAFETY: promised by the caller.
        let indices = unsafe { memory::numbers("indices", self.indices, self.index_count) }?;
        let (faces, rest) = indices.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(Fault::argument(format!("{} indices are not a multiple of three", self.index_count)));
        }
        let triangles = faces.iter().map(|t| t.map(VertexId)).collect();
        let shape = [n, 3, self.positions_stride];
        // SAFETY: promised by the caller.
        let (single, double) = unsafe {
            (
                Rows::new("positions", self.positions, shape)?,
                match self.positions.is_null() {
                    true => Rows::new("positions_f64", self.positions_f64, shape)?,
                    false => None,
                },
            )
        };
        let positions = match (single, double) {
            (Some(rows), _) => Positions::F32(rows.rows()),
            (None, Some(rows)) => Positions::F64(rows.rows()),
            (None, None) => return Err(Fault::argument("positions is null")),
        };
        let mut mesh = TriMesh::new(positions, triangles)?;
        // SAFETY: promised by the caller.
        unsafe {
            let normals = Rows::new("normals", self.normals, [n, 3, self.normals_stride])?;
            mesh.set_normals(normals.map(|rows| rows.rows()))?;
            let uvs = Rows::new("uvs", self.uvs, [n, 2, self.uvs_stride])?;
            mesh.set_uvs(uvs.map(|rows| rows.rows()))?;
            let colors = Rows::new("colors", self.colors, [n, 4, self.colors_stride])?;
            mesh.set_colors(colors.map(|rows| rows.rows()))?;
            let regions = Rows::new("regions", self.regions, [faces.len(), 1, 4])?;
            mesh.set_regions(regions.map(|rows| rows.numbers().into_iter().map(RegionId).collect()))?;
            for attribute in self.attributes()? {
                mesh.add_attribute(attribute)?;
            }
        }
        Ok(mesh)
    }

    /// Copies the additional attributes.
    ///
    /// # Safety
    /// The list must have its length, and each attribute its extent.
    unsafe fn attributes(&self) -> Result<Vec<Attribute>, Fault> {
        if self.attribute_count > 0 && self.attributes.is_null() {
            return Err(Fault::argument("attributes is null"));
        }
        let mut all: Vec<Attribute> = Vec::new();
        for i in 0..self.attribute_count {
            // SAFETY: the caller promises `attribute_count` structures, with readable values and names.
            let (semantic, width, values) = unsafe {
                let own = self.attributes.add(i).read_unaligned();
                let values = Rows::new("values", own.values, [self.vertex_count, own.width, own.stride])?;
                (own.semantic()?, own.width, values)
            };
            let values = values.ok_or_else(|| Fault::argument(format!("attribute {i} has no values")))?;
            if all.iter().any(|other| other.semantic == semantic) {
                return Err(Fault::argument(format!("attribute {i} is given twice")));
            }
            all.push(Attribute { semantic, width, values: values.numbers() });
        }
        Ok(all)
    }

    /// Adds the locks, the importance and the error map of vertices in the view.
    ///
    /// # Safety
    /// All buffers that are not null must have their extents.
    pub(crate) unsafe fn add_data(&self, data: &mut OwnedMeshData) -> Result<(), Fault> {
        // SAFETY: promised by the caller.
        unsafe {
            let locked = Rows::new("locked", self.locked, [self.vertex_count, 1, 1])?;
            data.locked = locked.map(|rows| rows.numbers().into_iter().map(|x| x != 0).collect());
            let importance = Rows::new("importance", self.importance, [self.vertex_count, 1, 4])?;
            data.importance = importance.map(|rows| rows.numbers());
            let shares = Rows::new("error map", self.error_map, [self.vertex_count, 1, 4])?;
            data.error_map = shares.map(|rows| rows.numbers());
        }
        Ok(())
    }
}

impl LodsmithAttribute {
    /// Returns the meaning of the values.
    ///
    /// # Safety
    /// The name must be null or end with a zero byte.
    unsafe fn semantic(&self) -> Result<Semantic, Fault> {
        let small = || u8::try_from(self.set).map_err(|_| Fault::argument("the set is above 255"));
        let morph = |of: Morphed| {
            let target =
                u16::try_from(self.set).map_err(|_| Fault::argument("the morph target is above 65,535"));
            Ok::<_, Fault>(Semantic::Morph { target: target?, of })
        };
        // SAFETY: promised by the caller.
        let name = || unsafe { memory::text("the name of an attribute", self.name) };
        let (semantic, width) = match self.kind {
            LODSMITH_ATTRIBUTE_CUSTOM => (Semantic::Custom(name()?), self.width),
            LODSMITH_ATTRIBUTE_DISCRETE => {
                (Semantic::Discrete { name: name()?, of: IntegerType::U32 }, self.width)
            }
            LODSMITH_ATTRIBUTE_TANGENT => (Semantic::Tangent, 4),
            LODSMITH_ATTRIBUTE_UV => (Semantic::Uv(small()?), 2),
            LODSMITH_ATTRIBUTE_COLOR => (Semantic::Color(small()?), 4),
            LODSMITH_ATTRIBUTE_JOINTS => (Semantic::Joints(small()?), 4),
            LODSMITH_ATTRIBUTE_WEIGHTS => (Semantic::Weights(small()?), 4),
            LODSMITH_ATTRIBUTE_MORPH_POSITION => (morph(Morphed::Position)?, 3),
            LODSMITH_ATTRIBUTE_MORPH_NORMAL => (morph(Morphed::Normal)?, 3),
            LODSMITH_ATTRIBUTE_MORPH_TANGENT => (morph(Morphed::Tangent)?, 3),
            kind => return Err(Fault::argument(format!("there is no kind {kind} of attributes"))),
        };
        if self.width != width || width == 0 {
            let (got, title) = (self.width, semantic.title());
            return Err(Fault::argument(format!("{title} have {got} values instead of {width}")));
        }
        Ok(semantic)
    }
}
