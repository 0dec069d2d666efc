//! Geometries: sources of numbers, and polygons whose corners refer to them.

use std::collections::HashMap;

use lodsmith_core::polygon::Triangulator;

use super::document::{Ids, child, children, descend, error, numbers, whole_numbers};
use super::tree::DaeElement;
use crate::corners::{COLOR, Corner, CornerMesh, FIRST_UV, KINDS, MAX_UV_SETS, NONE, NORMAL, POSITION};
use crate::error::{ReadError, Warning};
use crate::gltf::SceneBuilder;

/// A geometry. Its primitives have the symbols of materials.
#[derive(Default)]
pub(super) struct Geometry {
    pub(super) mesh: CornerMesh<Option<String>>,
    /// The numbers of its sets of texture coordinates, in the order in which the mesh has them.
    pub(super) uv_sets: Vec<u32>,
}

/// The values of all sources of each kind.
#[derive(Default)]
struct Pools {
    values: [Vec<[f32; 4]>; KINDS],
    /// The first value of a source and their number, by its id and kind.
    starts: HashMap<(String, usize), (u32, u32)>,
    /// The numbers of the sets of texture coordinates.
    uv_sets: Vec<u32>,
}

/// An input of a primitive: the position of its index in a corner, its kind, and the range of its source.
struct CornerInput {
    offset: usize,
    kind: usize,
    start: u32,
    count: u32,
}

/// Reads the triangles and polygons of a geometry.
pub(super) fn read<'a>(
    ids: &mut Ids<'a>,
    element: DaeElement<'a>,
    scene: &mut SceneBuilder,
) -> Result<Geometry, ReadError> {
    let name = element.attribute("name").or(element.attribute("id")).unwrap_or_default().to_owned();
    let mut geometry = Geometry::default();
    geometry.mesh.name = name;
    let mut pools = Pools::default();
    for kind in ["convex_mesh", "spline", "brep"] {
        if child(element, kind).is_some() {
            scene.warn(Warning::lost(format!("geometries of type `{kind}` are not read: dropped")));
        }
    }
    let Some(mesh) = child(element, "mesh") else { return Ok(geometry) };
    for primitive in mesh.children() {
        match primitive.tag() {
            tag @ ("triangles" | "polylist" | "polygons" | "trifans" | "tristrips") => {
                let Some(inputs) = inputs(ids, primitive, &mut pools, scene)? else { continue };
                let polygons = polygons(primitive, tag, &inputs, scene)?;
                let triangles = triangulated(primitive, &polygons, &pools)?;
                let symbol = primitive.attribute("material").map(str::to_owned);
                geometry.mesh.primitives.push((symbol, triangles));
            }
            "lines" | "linestrips" => {
                scene.warn(Warning::lost("lines are not read: dropped"));
            }
            _ => {}
        }
    }
    (geometry.mesh.values, geometry.uv_sets) = (pools.values, pools.uv_sets);
    Ok(geometry)
}

/// Returns the inputs of a primitive whose values are read; the inputs of its vertices have the same offset. `None` if
/// the file lacks its positions.
fn inputs<'a>(
    ids: &mut Ids<'a>,
    primitive: DaeElement<'a>,
    values: &mut Pools,
    scene: &mut SceneBuilder,
) -> Result<Option<Vec<CornerInput>>, ReadError> {
    let mut all = Vec::new();
    let mut found: Vec<(DaeElement<'a>, usize)> = Vec::new();
    for input in children(primitive, "input") {
        let offset = input.attribute("offset").map_or(Some(0), |o| o.trim().parse::<usize>().ok());
        // Guessed: no file has more.
        let offset = offset
            .filter(|&o| o < 256)
            .ok_or_else(|| error(input, "the offset is not a whole number below 256"))?;
        if input.attribute("semantic") == Some("VERTEX") {
            let Some(vertices) = ids.target_or_note(input, "source", "vertices") else { return Ok(None) };
            found.extend(children(vertices, "input").map(|i| (i, offset)));
        } else {
            found.push((input, offset));
        }
    }
    for (input, offset) in found {
        let kind = match input.attribute("semantic").unwrap_or_default() {
            "POSITION" => POSITION,
            "NORMAL" => NORMAL,
            "COLOR" => COLOR,
            "TEXCOORD" | "UV" => {
                let set = input.attribute("set").and_then(|s| s.trim().parse().ok()).unwrap_or(0);
                // The same for all primitives, whatever the order of their inputs is.
                let uv_sets = &mut values.uv_sets;
                let at = uv_sets.iter().position(|&s| s == set).unwrap_or_else(|| {
                    if uv_sets.len() < MAX_UV_SETS {
                        uv_sets.push(set);
                        uv_sets.len() - 1
                    } else {
                        MAX_UV_SETS
                    }
                });
                if at >= MAX_UV_SETS {
                    let text = format!("texture coordinates beyond {MAX_UV_SETS} sets are not read: dropped");
                    scene.warn(Warning::lost(text));
                    all.push(CornerInput { offset, kind: KINDS, start: 0, count: NONE });
                    continue;
                }
                FIRST_UV + at
            }
            // Tangents are recomputed where they are needed.
            _ => {
                all.push(CornerInput { offset, kind: KINDS, start: 0, count: NONE });
                continue;
            }
        };
        if all.iter().any(|i: &CornerInput| i.kind == kind) {
            continue;
        }
        match values.source(ids, input, kind)? {
            Some((start, count)) => all.push(CornerInput { offset, kind, start, count }),
            None if kind == POSITION => return Ok(None),
            None => all.push(CornerInput { offset, kind: KINDS, start: 0, count: NONE }),
        }
    }
    if !all.iter().any(|i| i.kind == POSITION) {
        return Err(error(primitive, "it has no input with positions"));
    }
    Ok(Some(all))
}

impl Pools {
    /// Adds the values that an input refers to; returns the first and their number. `None` if the file lacks them.
    fn source<'a>(
        &mut self,
        ids: &mut Ids<'a>,
        input: DaeElement<'a>,
        kind: usize,
    ) -> Result<Option<(u32, u32)>, ReadError> {
        let Some(source) = ids.target_or_note(input, "source", "source") else { return Ok(None) };
        let key = (source.attribute("id").unwrap_or_default().to_owned(), kind);
        if let Some(&known) = self.starts.get(&key) {
            return Ok(Some(known));
        }
        let accessor = descend(source, &["technique_common", "accessor"])
            .ok_or_else(|| error(source, "it has no accessor"))?;
        let Some(array) = ids.target_or_note(accessor, "source", "float_array") else { return Ok(None) };
        let numbers = numbers(array)?;
        let attribute = |name: &str, default: usize| match accessor.attribute(name) {
            None => Ok(default),
            Some(text) => {
                text.trim().parse().map_err(|_| error(accessor, format!("the {name} is not a number")))
            }
        };
        let (count, stride, offset) =
            (attribute("count", 0)?, attribute("stride", 1)?, attribute("offset", 0)?);
        // Params without a name are skipped.
        let named: Vec<usize> = children(accessor, "param")
            .enumerate()
            .filter(|(_, p)| p.attribute("name").is_some_and(|n| !n.is_empty()))
            .map(|(at, _)| at)
            .collect();
        let wanted = if kind >= FIRST_UV { 2 } else { 3 };
        let places: Vec<usize> = if named.len() >= wanted {
            named.into_iter().take(4).collect()
        } else {
            (0..stride.min(4)).collect()
        };
        if places.len() < wanted || places.iter().any(|&p| p >= stride) {
            return Err(error(accessor, format!("its values have fewer than {wanted} numbers")));
        }
        let end = count.checked_sub(1).map_or(Some(0), |last| {
            last.checked_mul(stride)?.checked_add(offset)?.checked_add(places.iter().max()? + 1)
        });
        if end.is_none_or(|end| end > numbers.len()) {
            let have = numbers.len();
            return Err(error(
                accessor,
                format!("its {count} values reach beyond the {have} numbers of the array"),
            ));
        }
        let pool = &mut self.values[kind];
        let start = u32::try_from(pool.len()).ok().filter(|s| s.checked_add(count as u32).is_some());
        let start = start.ok_or_else(|| error(source, "there are too many values"))?;
        for at in 0..count {
            let mut value = [0.0, 0.0, 0.0, 1.0];
            for (k, place) in places.iter().enumerate() {
                value[k] = numbers[offset + at * stride + place] as f32;
            }
            pool.push(value);
        }
        self.starts.insert(key, (start, count as u32));
        Ok(Some((start, count as u32)))
    }
}

/// Returns the corners of the polygons of a primitive.
fn polygons(
    primitive: DaeElement<'_>,
    tag: &str,
    inputs: &[CornerInput],
    scene: &mut SceneBuilder,
) -> Result<Vec<Vec<Corner>>, ReadError> {
    let stride = inputs.iter().map(|i| i.offset + 1).max().unwrap_or(1);
    let corners = |element: DaeElement<'_>| -> Result<Vec<Corner>, ReadError> {
        let indices = whole_numbers(element)?;
        indices.chunks_exact(stride).map(|corner| resolved(element, corner, inputs)).collect()
    };
    let mut polygons = Vec::new();
    match tag {
        "triangles" => {
            for p in children(primitive, "p") {
                polygons.extend(corners(p)?.chunks_exact(3).map(<[Corner]>::to_vec));
            }
        }
        "polylist" => {
            let counts = child(primitive, "vcount").map(whole_numbers).transpose()?.unwrap_or_default();
            let all = child(primitive, "p").map(corners).transpose()?.unwrap_or_default();
            let mut rest = all.as_slice();
            for count in counts {
                let Some((polygon, more)) = rest.split_at_checked(count as usize) else {
                    return Err(error(primitive, "vcount asks for more corners than p has"));
                };
                polygons.push(polygon.to_vec());
                rest = more;
            }
        }
        "polygons" => {
            for element in primitive.children() {
                match element.tag() {
                    "p" => polygons.push(corners(element)?),
                    "ph" => {
                        scene.warn(Warning::lost("holes of polygons are not read: they are closed"));
                        polygons.extend(child(element, "p").map(corners).transpose()?);
                    }
                    _ => {}
                }
            }
        }
        "trifans" => {
            for p in children(primitive, "p") {
                let all = corners(p)?;
                polygons.extend((2..all.len()).map(|i| vec![all[0], all[i - 1], all[i]]));
            }
        }
        _ => {
            for p in children(primitive, "p") {
                let all = corners(p)?;
                let strip = |i: usize| {
                    if i.is_multiple_of(2) {
                        vec![all[i], all[i + 1], all[i + 2]]
                    } else {
                        vec![all[i + 1], all[i], all[i + 2]]
                    }
                };
                polygons.extend((0..all.len().saturating_sub(2)).map(strip));
            }
        }
    }
    Ok(polygons)
}

fn resolved(element: DaeElement<'_>, indices: &[u32], inputs: &[CornerInput]) -> Result<Corner, ReadError> {
    let mut corner = [NONE; KINDS];
    for input in inputs.iter().filter(|i| i.kind < KINDS) {
        let index = indices[input.offset];
        if index >= input.count {
            return Err(error(
                element,
                format!("the index {index} is beyond the {} values of its source", input.count),
            ));
        }
        corner[input.kind] = input.start + index;
    }
    Ok(corner)
}

fn triangulated(
    primitive: DaeElement<'_>,
    polygons: &[Vec<Corner>],
    values: &Pools,
) -> Result<Vec<[Corner; 3]>, ReadError> {
    let (mut all, mut triangles) = (Vec::new(), Vec::new());
    let mut triangulator = Triangulator::default();
    for polygon in polygons {
        if u32::try_from(polygon.len()).is_err() {
            return Err(error(primitive, "a polygon has too many corners"));
        }
        let point = |corner: &Corner| {
            let [x, y, z, _] = values.values[POSITION][corner[POSITION] as usize];
            [x, y, z].map(f64::from)
        };
        let points: Vec<[f64; 3]> = polygon.iter().map(point).collect();
        triangulator.triangulate(&points, &mut triangles);
        all.extend(triangles.iter().map(|t| t.map(|i| polygon[i as usize])));
    }
    Ok(all)
}
