//! The way in. Every count comes from bytes that are there; nothing is reserved on a header's word.

use std::path::Path;

use lodsmith_core::clusters::{Bound, Cluster, ClusterLod, Sphere};
use lodsmith_core::{
    Attribute, GroupId, Integer, Morphed, Positions, RegionId, Semantic, TriMesh, VertexId, WedgeId,
};

use super::sections::{self, Section, Tag, double, four};
use super::{CLUSTER, DOUBLE, GROUP, MAGIC, NONE, StoredClusterLod, VERSION};
use crate::error::ReadError;
use crate::limits::Limits;
use crate::obj::{Region, Regions};
use crate::read::{bytes_of, unpacked};

/// Reads a file of levels; `.gz` opens by itself.
///
/// # Errors
/// [`ReadError::File`] with the path and the reason.
pub fn read_path(path: &Path, limits: Limits) -> Result<StoredClusterLod, ReadError> {
    let read = || read_bytes(&bytes_of(path, limits)?, limits);
    read().map_err(|e| e.at(path))
}

/// Reads levels from bytes; gzip opens by itself.
///
/// What is read obeys all rules of [`ClusterLod`]: whatever is cut from it is a mesh. That its cuts have no cracks is for
/// the writer of the file to see to.
///
/// # Errors
/// [`ReadError`] with the place in the file.
pub fn read_bytes(bytes: &[u8], limits: Limits) -> Result<StoredClusterLod, ReadError> {
    let file = &*unpacked(bytes, limits)?;
    if file.len() as u64 > limits.bytes {
        return Err(ReadError::Limit { what: "the file", size: file.len() as u64, limit: limits.bytes });
    }
    if !file.starts_with(&MAGIC) {
        return Err(ReadError::byte(0, "this is no file of cluster levels: its first bytes are others"));
    }
    let (Some(version), Some(flags)) = (word(file, 8), word(file, 12)) else {
        return Err(ReadError::byte(file.len(), "the file ends in its header"));
    };
    if version != VERSION {
        let text = format!("version {version} of cluster levels; this program reads version {VERSION}");
        return Err(ReadError::Unsupported(text));
    }
    if flags & !DOUBLE != 0 {
        return Err(ReadError::Unsupported(format!("flags {flags:#x} of cluster levels are not known")));
    }
    let all = Parts::new(&sections::all(file, 16)?)?;
    all.stored(flags & DOUBLE != 0)
}

fn word(file: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(four(file.get(at..at + 4)?)))
}

/// The sections by their names.
#[derive(Default)]
struct Parts<'a> {
    once: Vec<Section<'a>>,
    attributes: Vec<Section<'a>>,
}

/// Those that may stand once.
const ONCE: [Tag; 10] =
    [*b"POSI", *b"WEDG", *b"NORM", *b"TEXC", *b"COLR", *b"GRUP", *b"CLUS", *b"LIST", *b"REGI", *b"NAME"];

impl<'a> Parts<'a> {
    fn new(sections: &[Section<'a>]) -> Result<Self, ReadError> {
        let mut parts = Self::default();
        for s in sections {
            match &s.tag {
                b"ATTR" => parts.attributes.push(*s),
                b"DONE" if s.bytes.is_empty() => {}
                tag if ONCE.contains(tag) => {
                    if parts.get(*tag).is_some() {
                        return Err(s.wrong("it stands twice"));
                    }
                    parts.once.push(*s);
                }
                tag if tag[0].is_ascii_lowercase() => {}
                _ => return Err(s.wrong("it is not known, and it must not be passed over")),
            }
        }
        Ok(parts)
    }

    fn get(&self, tag: Tag) -> Option<&Section<'a>> {
        self.once.iter().find(|s| s.tag == tag)
    }

    fn need(&self, tag: Tag) -> Result<&Section<'a>, ReadError> {
        self.get(tag).ok_or_else(|| ReadError::file(format!("section {} is missing", sections::name(tag))))
    }

    fn stored(&self, is_double: bool) -> Result<StoredClusterLod, ReadError> {
        let (clusters, triangles) = self.clusters()?;
        let mesh = self.mesh(is_double, triangles)?;
        let groups = self.need(*b"GRUP")?.entries(GROUP)?;
        let group = |e: &[u8]| Bound { error: double(e), sphere: sphere(&e[8..]) };
        let lod = ClusterLod::new(mesh, clusters, groups.map(group).collect())
            .map_err(|e| ReadError::file(format!("these are no cluster levels: {e}")))?;
        Ok(StoredClusterLod { regions: self.regions(&lod)?, lod })
    }

    fn mesh(&self, is_double: bool, triangles: Vec<[WedgeId; 3]>) -> Result<TriMesh, ReadError> {
        let s = self.need(*b"POSI")?;
        let positions = if is_double {
            let entry = |e: &[u8]| [double(e), double(&e[8..]), double(&e[16..])];
            Positions::F64(s.entries(24)?.map(entry).collect())
        } else {
            Positions::F32(s.singles()?)
        };
        if let Some(v) = positions.view().iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(s.wrong(format!("the position of vertex {v} is no number")));
        }
        let mut mesh = match self.get(*b"WEDG") {
            Some(s) => TriMesh::with_wedges(positions, s.numbers()?.map(VertexId).collect(), triangles)?,
            None => {
                let triangles = triangles.into_iter().map(|t| t.map(|w| VertexId(w.0))).collect();
                TriMesh::new(positions, triangles)?
            }
        };
        if let Some(s) = self.get(*b"NORM") {
            mesh.set_normals(Some(s.singles()?)).map_err(|e| s.wrong(e))?;
        }
        if let Some(s) = self.get(*b"TEXC") {
            mesh.set_uvs(Some(s.singles()?)).map_err(|e| s.wrong(e))?;
        }
        if let Some(s) = self.get(*b"COLR") {
            mesh.set_colors(Some(s.singles()?)).map_err(|e| s.wrong(e))?;
        }
        for s in &self.attributes {
            let attribute = attribute(s)?;
            if mesh.further_attributes().iter().any(|a| a.semantic == attribute.semantic) {
                return Err(s.wrong(format!("{} stand twice", attribute.semantic.title())));
            }
            mesh.add_attribute(attribute).map_err(|e| s.wrong(e))?;
        }
        if let Some(s) = self.get(*b"REGI") {
            mesh.set_regions(Some(s.numbers()?.map(RegionId).collect())).map_err(|e| s.wrong(e))?;
        }
        Ok(mesh)
    }

    /// The clusters, and the triangles of all in their order.
    fn clusters(&self) -> Result<(Vec<Cluster>, Vec<[WedgeId; 3]>), ReadError> {
        let lists = self.need(*b"LIST")?;
        let mut clusters = Vec::new();
        let mut triangles = Vec::new();
        let mut rest = lists.bytes;
        for (i, e) in self.need(*b"CLUS")?.entries(CLUSTER)?.enumerate() {
            let [faces, wedges] = [0, 2].map(|k| usize::from(u16::from_le_bytes([e[k], e[k + 1]])));
            let group = |at: usize| {
                let n = u32::from_le_bytes(four(&e[at..]));
                (n != NONE).then_some(GroupId(n))
            };
            let size = 4 * wedges + (3 * faces).next_multiple_of(4);
            let Some((own, after)) = rest.split_at_checked(size) else {
                return Err(lists.wrong(format!("it ends before the triangles of cluster {i}")));
            };
            rest = after;
            let (names, corners) = own.split_at(4 * wedges);
            let wedge = |k: u8| {
                let at = 4 * usize::from(k);
                names.get(at..at + 4).map(|n| WedgeId(u32::from_le_bytes(four(n))))
            };
            for t in corners[..3 * faces].chunks_exact(3) {
                let (Some(a), Some(b), Some(c)) = (wedge(t[0]), wedge(t[1]), wedge(t[2])) else {
                    let text = format!("a triangle of cluster {i} uses a vertex beyond its {wedges}");
                    return Err(lists.wrong(text));
                };
                triangles.push([a, b, c]);
            }
            let (from, into) = (group(4), group(8));
            clusters.push(Cluster { face_count: faces, sphere: sphere(&e[12..]), from, into });
        }
        if !rest.is_empty() {
            return Err(lists.wrong(format!("{} bytes belong to no cluster", rest.len())));
        }
        Ok((clusters, triangles))
    }

    fn regions(&self, lod: &ClusterLod) -> Result<Regions, ReadError> {
        let Some(s) = self.get(*b"NAME") else { return Ok(Regions::default()) };
        let mut rest = s.bytes;
        let mut names = Vec::new();
        while !rest.is_empty() {
            let length = word(rest, 0).ok_or_else(|| s.wrong("it ends in a length"))?;
            rest = &rest[4..];
            let size = if length == NONE { 0 } else { length as usize };
            let (name, after) = rest.split_at_checked(size).ok_or_else(|| s.wrong("it ends in a name"))?;
            names.push((length != NONE).then_some(name));
            rest = after;
        }
        if names.len() % 4 != 0 {
            return Err(s.wrong("its names do not come in fours"));
        }
        let regions: Vec<Region<'_>> = names
            .chunks_exact(4)
            .map(|n| Region { object: n[0], groups: n[1], material: n[2], smoothing: n[3] })
            .collect();
        let most = lod.mesh().regions().and_then(|r| r.iter().max());
        match most.filter(|r| r.index() >= regions.len()) {
            Some(r) => Err(s.wrong(format!("a face is of region {r}, but {} have names", regions.len()))),
            None => Ok(Regions::named(&regions)),
        }
    }
}

fn sphere(e: &[u8]) -> Sphere {
    Sphere { center: [double(e), double(&e[8..]), double(&e[16..])], radius: double(&e[24..]) }
}

fn attribute(s: &Section<'_>) -> Result<Attribute, ReadError> {
    let words: Option<Vec<u32>> = (0..5).map(|k| word(s.bytes, 4 * k)).collect();
    let Some(&[kind, first, second, width, length]) = words.as_deref() else {
        return Err(s.wrong("it ends in its head"));
    };
    let rest = &s.bytes[20..];
    let padded = (length as usize).checked_next_multiple_of(4).unwrap_or(usize::MAX);
    let Some((name, values)) = rest.split_at_checked(padded) else {
        return Err(s.wrong("it ends in its name"));
    };
    let set = || u8::try_from(first).map_err(|_| s.wrong(format!("there is no set {first}")));
    let semantic = match kind {
        0 => Semantic::Tangent,
        1 => Semantic::Uv(set()?),
        2 => Semantic::Color(set()?),
        3 => Semantic::Joints(set()?),
        4 => Semantic::Weights(set()?),
        5 => {
            let of = [Morphed::Position, Morphed::Normal, Morphed::Tangent];
            let of = *of.get(second as usize).ok_or_else(|| s.wrong("nothing is morphed by that number"))?;
            let target = u16::try_from(first).map_err(|_| s.wrong(format!("there is no target {first}")))?;
            Semantic::Morph { target, of }
        }
        6 => match str::from_utf8(&name[..length as usize]) {
            Ok(name) => Semantic::Custom(name.to_owned()),
            Err(_) => return Err(s.wrong("its name is not UTF-8")),
        },
        7 => {
            let of = Integer::from_number(first);
            let of = of.ok_or_else(|| s.wrong(format!("there are no integers of type {first}")))?;
            let name = str::from_utf8(&name[..length as usize]);
            let name = name.map_err(|_| s.wrong("its name is not UTF-8"))?.to_owned();
            Semantic::Discrete { name, of }
        }
        _ => return Err(s.wrong(format!("attributes of kind {kind} are not known"))),
    };
    let wanted = match semantic {
        Semantic::Tangent | Semantic::Color(_) | Semantic::Joints(_) | Semantic::Weights(_) => Some(4),
        Semantic::Uv(_) => Some(2),
        Semantic::Morph { .. } => Some(3),
        Semantic::Custom(_) | Semantic::Discrete { .. } => None,
    };
    if wanted.is_some_and(|w| w != width) {
        return Err(s.wrong(format!("{} of {width} values", semantic.title())));
    }
    if values.len() % 4 != 0 {
        return Err(s.wrong("its length is no multiple of 4"));
    }
    let values = values.chunks_exact(4).map(|v| f32::from_le_bytes(four(v))).collect();
    Ok(Attribute { semantic, width: width as usize, values })
}
