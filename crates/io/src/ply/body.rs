//! Parser of the PLY body: records of the elements that the header declares.

use lodsmith_core::{IntegerType, Positions};

use super::face_values::{self, FaceColumn};
use super::header::{Element, Encoding, Header, PropertyType, Scalar};
use super::source::{Binary, Fault, NumberSource, Text, triangle_record};
use crate::error::{ReadError, Warning};
use crate::limits::try_with_capacity;
use crate::options::{PROGRESS_RECORDS, SharedProgress};

/// The contents of the body.
pub(super) struct Body {
    pub(super) vertices: VertexBuffers,
    pub(super) faces: Faces,
    /// Numbers of the faces; none if there are strips too.
    pub(super) columns: Vec<FaceColumn>,
    pub(super) warnings: Vec<Warning>,
}

/// Buffers with one entry per vertex.
pub(super) struct VertexBuffers {
    pub(super) positions: Positions,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    pub(super) colors: Option<Vec<[f32; 4]>>,
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    /// Integer properties that become attributes of the mesh.
    pub(super) discrete: Vec<Discrete>,
    /// Names of the properties that are not in the mesh.
    pub(super) unknown: Vec<String>,
    /// Requested scalar properties, whether in the mesh or not.
    pub(super) wanted: Vec<(String, Vec<f32>)>,
}

/// An integer property of the vertices.
pub(super) struct Discrete {
    pub(super) name: String,
    pub(super) of: IntegerType,
    pub(super) values: Vec<f32>,
    /// True if all values are exact: single precision does not hold all 32-bit integers.
    is_exact: bool,
}

/// Faces with checked vertex indices.
pub(super) enum Faces {
    Triangles(Vec<[u32; 3]>),
    Polygons(Corners),
}

/// Polygons: the corners of all, concatenated, and the end of each.
#[derive(Default)]
pub(super) struct Corners {
    pub(super) indices: Vec<u32>,
    pub(super) ends: Vec<usize>,
    /// Texture coordinates, one per corner.
    pub(super) uvs: Option<Vec<[f32; 2]>>,
}

impl Body {
    /// Reads the records; `wanted` names vertex properties to return besides the mesh.
    pub(super) fn read(
        header: &Header,
        bytes: &[u8],
        wanted: &[String],
        progress: &SharedProgress,
    ) -> Result<Self, ReadError> {
        let at = header.body;
        match header.encoding {
            Encoding::Ascii => Self::read_from(header, Text { bytes, at }, wanted, progress),
            Encoding::Little => Self::read_from(header, Binary::<false> { bytes, at }, wanted, progress),
            Encoding::Big => Self::read_from(header, Binary::<true> { bytes, at }, wanted, progress),
        }
    }

    fn read_from<S: NumberSource>(
        header: &Header,
        mut source: S,
        wanted: &[String],
        progress: &SharedProgress,
    ) -> Result<Self, ReadError> {
        let vertex_count = header
            .element("vertex")
            .ok_or_else(|| ReadError::file("the header does not declare an element `vertex`"))?
            .count;
        let mut warnings = Vec::new();
        let mut vertices = None;
        let mut faces: Option<Faces> = None;
        let mut columns = Vec::new();
        let has_strips = header.element("tristrips").is_some_and(|e| e.count > 0);
        for element in &header.elements {
            match element.name.as_str() {
                "vertex" => {
                    vertices = Some(read_vertices(element, wanted, &mut source, &mut warnings, progress)?);
                }
                "face" => {
                    if element.count > 0 && !has_strips {
                        columns = face_values::columns(element, !header.pictures.is_empty());
                    }
                    let more = read_faces(
                        element,
                        vertex_count,
                        &mut columns,
                        &mut source,
                        &mut warnings,
                        progress,
                    )?;
                    faces = Some(join(faces, more));
                }
                "tristrips" => {
                    let more = Faces::Triangles(read_strips(element, vertex_count, &mut source)?);
                    faces = Some(join(faces, more));
                }
                _ => {
                    skip(element, &mut source)?;
                    if element.count > 0 {
                        warnings.push(Warning::lost(format!(
                            "element {} is not supported: {} records dropped",
                            element.name, element.count
                        )));
                    }
                }
            }
        }
        progress.set(1, 1);
        let vertices =
            vertices.ok_or_else(|| ReadError::file("the header does not declare an element `vertex`"))?;
        Ok(Self { vertices, faces: faces.unwrap_or(Faces::Triangles(Vec::new())), columns, warnings })
    }
}

/// Joins the faces of several elements (faces and strips).
fn join(first: Option<Faces>, second: Faces) -> Faces {
    match (first, second) {
        (None, faces) => faces,
        (Some(Faces::Triangles(mut a)), Faces::Triangles(b)) => {
            a.extend(b);
            Faces::Triangles(a)
        }
        (Some(a), b) => {
            let (mut a, b) = (polygons(a), polygons(b));
            let shift = a.indices.len();
            if a.uvs.is_some() || b.uvs.is_some() {
                let mut uvs = a.uvs.unwrap_or_else(|| vec![[0.0; 2]; shift]);
                uvs.extend(b.uvs.unwrap_or_else(|| vec![[0.0; 2]; b.indices.len()]));
                a.uvs = Some(uvs);
            }
            a.indices.extend(b.indices);
            a.ends.extend(b.ends.into_iter().map(|e| e + shift));
            Faces::Polygons(a)
        }
    }
}

fn polygons(faces: Faces) -> Corners {
    match faces {
        Faces::Polygons(c) => c,
        Faces::Triangles(t) => {
            Corners { ends: (1..=t.len()).map(|i| 3 * i).collect(), indices: t.into_flattened(), uvs: None }
        }
    }
}

// ---- vertices

/// The destination of a vertex property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PropertyTarget {
    Position(usize),
    Normal(usize),
    Color(usize),
    Uv(usize),
    /// A named number: its index among the discrete attributes, and among the requested properties.
    Named(Option<usize>, Option<usize>),
    Nothing,
}

/// Names of a group of properties, and the destination of the k-th of them.
type PropertyGroup = (&'static [&'static str], fn(usize) -> PropertyTarget);

/// Names of the known vertex properties: only complete groups, and only the first group of a kind, are used.
const PROPERTY_GROUPS: [PropertyGroup; 9] = [
    (&["x", "y", "z"], PropertyTarget::Position),
    (&["nx", "ny", "nz"], PropertyTarget::Normal),
    (&["normal_x", "normal_y", "normal_z"], PropertyTarget::Normal),
    (&["red", "green", "blue"], PropertyTarget::Color),
    (&["diffuse_red", "diffuse_green", "diffuse_blue"], PropertyTarget::Color),
    (&["r", "g", "b"], PropertyTarget::Color),
    (&["s", "t"], PropertyTarget::Uv),
    (&["u", "v"], PropertyTarget::Uv),
    (&["texture_u", "texture_v"], PropertyTarget::Uv),
];

/// Returns the destination of each vertex property, the discrete attributes of the mesh, and the requested
/// properties.
fn targets(element: &Element, wanted: &[String]) -> (Vec<PropertyTarget>, Vec<Discrete>, Vec<String>) {
    let one = |name: &str| {
        element.properties.iter().position(|p| p.name == name && matches!(p.kind, PropertyType::One(_)))
    };
    let mut targets = vec![PropertyTarget::Nothing; element.properties.len()];
    for (names, target) in PROPERTY_GROUPS {
        let found: Vec<usize> = names.iter().filter_map(|n| one(n)).collect();
        if found.len() == names.len() && !targets.contains(&target(0)) {
            for (k, at) in found.into_iter().enumerate() {
                targets[at] = target(k);
            }
        }
    }
    if let (true, Some(alpha)) =
        (targets.contains(&PropertyTarget::Color(0)), one("alpha").or_else(|| one("a")))
    {
        targets[alpha] = PropertyTarget::Color(3);
    }
    let (mut discrete, mut aside): (Vec<Discrete>, Vec<String>) = (Vec::new(), Vec::new());
    for (property, target) in element.properties.iter().zip(&mut targets) {
        let (PropertyType::One(kind), PropertyTarget::Nothing) = (property.kind, *target) else { continue };
        let name = &property.name;
        let (mut carried, mut beside) = (None, None);
        if let Some(of) = kind.integer().filter(|_| discrete.iter().all(|d| d.name != *name)) {
            carried = Some(discrete.len());
            discrete.push(Discrete { name: name.clone(), of, values: Vec::new(), is_exact: true });
        }
        if wanted.contains(name) && !aside.contains(name) {
            beside = Some(aside.len());
            aside.push(name.clone());
        }
        if carried.is_some() || beside.is_some() {
            *target = PropertyTarget::Named(carried, beside);
        }
    }
    (targets, discrete, aside)
}

fn read_vertices<S: NumberSource>(
    element: &Element,
    wanted: &[String],
    source: &mut S,
    warnings: &mut Vec<Warning>,
    progress: &SharedProgress,
) -> Result<VertexBuffers, ReadError> {
    let (targets, mut discrete, aside) = targets(element, wanted);
    if !targets.contains(&PropertyTarget::Position(0)) {
        return Err(ReadError::element("element vertex", "lacks one of the properties x, y, z"));
    }
    let mut unknown: Vec<String> = element
        .properties
        .iter()
        .zip(&targets)
        .filter(|(_, t)| matches!(t, PropertyTarget::Nothing | PropertyTarget::Named(None, _)))
        .map(|(p, _)| p.name.clone())
        .collect();

    let count = element.count;
    let has = |t: PropertyTarget| targets.contains(&t);
    let wide = element.properties.iter().zip(&targets).any(|(p, t)| {
        matches!(t, PropertyTarget::Position(_))
            && matches!(p.kind, PropertyType::One(Scalar::F64 | Scalar::I32 | Scalar::U32))
    });
    let mut normals = has(PropertyTarget::Normal(0)).then(|| try_with_capacity(count)).transpose()?;
    let mut colors = has(PropertyTarget::Color(0)).then(|| try_with_capacity(count)).transpose()?;
    let mut uvs = has(PropertyTarget::Uv(0)).then(|| try_with_capacity(count)).transpose()?;
    let mut wanted: Vec<_> = aside
        .into_iter()
        .map(|name| Ok((name, try_with_capacity(count)?)))
        .collect::<Result<_, ReadError>>()?;
    let attributes =
        normals.is_some() || colors.is_some() || uvs.is_some() || !discrete.is_empty() || !wanted.is_empty();
    discrete.iter_mut().for_each(|d| d.values.reserve_exact(count));

    let x = targets
        .iter()
        .position(|t| *t == PropertyTarget::Position(0))
        .filter(|&x| (1..3).all(|k| targets.get(x + k) == Some(&PropertyTarget::Position(k))));
    let ready = x.filter(|_| !wide).and_then(|x| source.f32_positions(element, x));
    let from_block = ready.is_some();
    let mut narrow = ready.unwrap_or_default();
    let mut double: Vec<[f64; 3]> = try_with_capacity(if wide { count } else { 0 })?;
    if !from_block && !wide {
        narrow = try_with_capacity(count)?;
    }
    if from_block && !attributes {
        skip(element, source)?;
    } else {
        for record in 0..count {
            follow(progress, source, record);
            let (mut p, mut n, mut c, mut uv) = ([0f64; 3], [0f32; 3], [1f32; 4], [0f32; 2]);
            for (property, target) in element.properties.iter().zip(&targets) {
                let read = match property.kind {
                    PropertyType::One(kind) => source.number(kind).map(|x| match *target {
                        PropertyTarget::Position(k) => p[k] = x,
                        PropertyTarget::Normal(k) => n[k] = x as f32,
                        PropertyTarget::Color(k) => c[k] = x as f32 / kind.color_divisor(),
                        PropertyTarget::Uv(k) => uv[k] = x as f32,
                        PropertyTarget::Named(carried, beside) => {
                            carried.iter().for_each(|&k| discrete[k].push(x));
                            beside.iter().for_each(|&k| wanted[k].1.push(x as f32));
                        }
                        PropertyTarget::Nothing => {}
                    }),
                    PropertyType::List { count, item } => source.skip_list(count, item),
                };
                read.map_err(|f| source.error(f, "vertex", record, &property.name))?;
            }
            if wide {
                double.push(p);
            } else if !from_block {
                narrow.push(p.map(|x| x as f32));
            }
            normals.iter_mut().for_each(|v| v.push(normalized(n)));
            colors.iter_mut().for_each(|v| v.push(c));
            uvs.iter_mut().for_each(|v| v.push(uv));
        }
    }
    let positions = if wide { Positions::F64(double) } else { Positions::F32(narrow) };
    // An inexact integer would identify something else, so it is useless.
    unknown.extend(discrete.iter().filter(|d| !d.is_exact).map(|d| d.name.clone()));
    discrete.retain(|d| d.is_exact);
    if !unknown.is_empty() {
        warnings.push(Warning::lost(format!(
            "vertex properties are not supported: {} dropped",
            some_names(&unknown)
        )));
    }
    Ok(VertexBuffers { positions, normals, colors, uvs, discrete, unknown, wanted })
}

impl Discrete {
    fn push(&mut self, x: f64) {
        let single = x as f32;
        self.is_exact &= f64::from(single) == x && self.of.holds(single);
        self.values.push(single);
    }
}

/// Normalises a normal; it stays unchanged if it is unit length already (to a thousandth) or has no length.
fn normalized(n: [f32; 3]) -> [f32; 3] {
    let length_sq: f64 = n.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
    if (length_sq - 1.0).abs() <= 2e-3 || length_sq <= 0.0 || !length_sq.is_finite() {
        return n;
    }
    n.map(|x| (f64::from(x) / length_sq.sqrt()) as f32)
}

/// Joins at most eight names for a warning.
fn some_names(names: &[String]) -> String {
    let mut text = names[..names.len().min(8)].join(", ");
    if names.len() > 8 {
        text += &format!(" and {} more", names.len() - 8);
    }
    text
}

// ---- faces

fn is_index_list(p: &super::header::Property) -> bool {
    matches!(p.kind, PropertyType::List { .. })
        && matches!(p.name.as_str(), "vertex_indices" | "vertex_index")
}

fn read_faces<S: NumberSource>(
    element: &Element,
    vertex_count: usize,
    columns: &mut [FaceColumn],
    source: &mut S,
    warnings: &mut Vec<Warning>,
    progress: &SharedProgress,
) -> Result<Faces, ReadError> {
    if element.count == 0 {
        return Ok(Faces::Triangles(Vec::new()));
    }
    let Some(at) = element.properties.iter().position(is_index_list) else {
        return Err(ReadError::element("element face", "lacks a list vertex_indices"));
    };
    let texcoord = element
        .properties
        .iter()
        .position(|p| p.name == "texcoord" && matches!(p.kind, PropertyType::List { .. }));
    warn_of_face_properties(element, at, texcoord, columns, warnings);

    if columns.is_empty()
        && let Some(triangles) = source.triangles(element, at)
    {
        let bad = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= vertex_count);
        if !triangles.iter().any(bad) {
            skip_bytes_of_triangles(element, source);
            return Ok(Faces::Triangles(triangles));
        }
        // The general parser below reports the error.
    }

    let mut corners = Corners { uvs: texcoord.map(|_| Vec::new()), ..Corners::default() };
    corners.ends = try_with_capacity(element.count)?;
    corners.indices = try_with_capacity(element.count * 3)?;
    let mut column_of: Vec<Option<usize>> = vec![None; element.properties.len()];
    for (k, column) in columns.iter_mut().enumerate() {
        column.values = try_with_capacity(element.count)?;
        column_of[column.property] = Some(k);
    }
    for face in 0..element.count {
        follow(progress, source, face);
        let start = corners.indices.len();
        let mut uv_numbers = 0;
        for (k, property) in element.properties.iter().enumerate() {
            let read = match property.kind {
                PropertyType::List { count, item } if k == at => {
                    source.list_length(count, item).and_then(|n| {
                        (0..n).try_for_each(|_| {
                            let i = source.integer(item)?;
                            let index = usize::try_from(i).ok().filter(|&i| i < vertex_count);
                            corners.indices.push(index.ok_or(Fault::Index(i, vertex_count))? as u32);
                            Ok(())
                        })
                    })
                }
                PropertyType::List { count, item } if Some(k) == texcoord => {
                    let uvs = corners.uvs.get_or_insert_default();
                    source.list_length(count, item).and_then(|n| {
                        uv_numbers = n;
                        for _ in 0..n / 2 {
                            let uv = [source.number(item)?, source.number(item)?];
                            uvs.push(uv.map(|x| x as f32));
                        }
                        if n % 2 == 1 {
                            source.number(item)?;
                        }
                        Ok(())
                    })
                }
                PropertyType::List { count, item } => source.skip_list(count, item),
                PropertyType::One(kind) => match column_of[k] {
                    Some(column) => source.number(kind).map(|x| columns[column].values.push(x)),
                    None => source.skip_one(kind),
                },
            };
            read.map_err(|f| source.error(f, "face", face, &property.name))?;
        }
        let size = corners.indices.len() - start;
        if let Some(uvs) = &mut corners.uvs {
            // A face without a texture has an empty list.
            if uv_numbers != 2 * size && uv_numbers != 0 {
                return Err(ReadError::element(
                    format!("face {face}"),
                    format!("texcoord has {uv_numbers} numbers for {size} corners; two for each are needed"),
                ));
            }
            uvs.resize(corners.indices.len(), [0.0; 2]);
        }
        corners.ends.push(corners.indices.len());
    }
    Ok(Faces::Polygons(corners))
}

/// Reports how far a source is, now and then.
fn follow<S: NumberSource>(progress: &SharedProgress, source: &S, record: usize) {
    if record.is_multiple_of(PROGRESS_RECORDS) {
        let (bytes, at) = source.bytes();
        progress.set(at as u64, bytes.len() as u64);
    }
}

fn skip_bytes_of_triangles<S: NumberSource>(element: &Element, source: &mut S) {
    let size = triangle_record(element).map_or(0, |(size, _)| size);
    source.advance(size * element.count);
}

fn warn_of_face_properties(
    element: &Element,
    indices: usize,
    texcoord: Option<usize>,
    columns: &[FaceColumn],
    warnings: &mut Vec<Warning>,
) {
    let is_color = |name: &str| matches!(name, "red" | "green" | "blue" | "alpha");
    let (colors, others): (Vec<_>, Vec<_>) = element
        .properties
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != indices && Some(*k) != texcoord && columns.iter().all(|c| c.property != *k))
        .map(|(_, p)| p.name.clone())
        .partition(|name| is_color(name));
    if !colors.is_empty() {
        warnings.push(Warning::lost("face colours are not supported: dropped"));
    }
    if !others.is_empty() {
        warnings.push(Warning::lost(format!(
            "face properties are not supported: {} dropped",
            some_names(&others)
        )));
    }
}

fn read_strips<S: NumberSource>(
    element: &Element,
    vertex_count: usize,
    source: &mut S,
) -> Result<Vec<[u32; 3]>, ReadError> {
    let Some(at) = element.properties.iter().position(is_index_list) else {
        return Err(ReadError::element("element tristrips", "lacks a list vertex_indices"));
    };
    let mut triangles = Vec::new();
    for strip in 0..element.count {
        for (k, property) in element.properties.iter().enumerate() {
            let read = match property.kind {
                PropertyType::List { count, item } if k == at => {
                    source.list_length(count, item).and_then(|n| {
                        let mut last: [Option<u32>; 2] = [None; 2];
                        let mut turned = false;
                        for _ in 0..n {
                            let i = source.integer(item)?;
                            if is_restart(i, item, vertex_count) {
                                last = [None; 2];
                                turned = false;
                                continue;
                            }
                            let index = usize::try_from(i).ok().filter(|&i| i < vertex_count);
                            let c = index.ok_or(Fault::Index(i, vertex_count))? as u32;
                            if let [Some(a), Some(b)] = last {
                                // Strips are joined by degenerate triangles, which are skipped.
                                if a != b && b != c && c != a {
                                    triangles.push(if turned { [b, a, c] } else { [a, b, c] });
                                }
                                turned = !turned;
                            }
                            last = [last[1], Some(c)];
                        }
                        Ok(())
                    })
                }
                PropertyType::List { count, item } => source.skip_list(count, item),
                PropertyType::One(kind) => source.skip_one(kind),
            };
            read.map_err(|f| source.error(f, "strip", strip, &property.name))?;
        }
    }
    Ok(triangles)
}

/// Returns true if an index ends a strip: -1, which unsigned types hold as their largest number.
fn is_restart(index: i64, kind: Scalar, vertex_count: usize) -> bool {
    let largest = match kind {
        Scalar::U8 => u8::MAX.into(),
        Scalar::U16 => u16::MAX.into(),
        Scalar::U32 => u32::MAX.into(),
        _ => -1,
    };
    // In a large mesh, the largest number may be a vertex index.
    index == -1 || (index == largest && index >= vertex_count as i64)
}

fn skip<S: NumberSource>(element: &Element, source: &mut S) -> Result<(), ReadError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    if let (true, Some(size)) = (S::BINARY, element.fixed_size()) {
        // The header check covers the size only if no list comes before.
        let fits = size.checked_mul(element.count).filter(|&n| n <= source.remaining());
        let bytes = fits.ok_or_else(|| source.error(Fault::End, &element.name, 0, "its records"))?;
        source.advance(bytes);
        return Ok(());
    }
    for record in 0..element.count {
        for property in &element.properties {
            let read = match property.kind {
                PropertyType::List { count, item } => source.skip_list(count, item),
                PropertyType::One(kind) => source.skip_one(kind),
            };
            read.map_err(|f| source.error(f, &element.name, record, &property.name))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_normalised_unless_they_are_unit_length() {
        assert_eq!(normalized([0.0, 3.0, 4.0]), [0.0, 0.6, 0.8]);
        assert_eq!(normalized([0.6, 0.8, 1e-4]), [0.6, 0.8, 1e-4]);
        assert_eq!(normalized([0.0; 3]), [0.0; 3]);
    }
}
