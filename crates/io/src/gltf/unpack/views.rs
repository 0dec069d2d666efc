//! Decoder of views whose bytes are meshopt streams.

use std::collections::HashSet;
use std::sync::Arc;

use serde_json::Value;

use super::super::accessors::Accessor;
use super::super::buffers::Buffers;
use super::super::compressed::{MESHOPT, extension};
use super::super::container::{list, list_mut, number, whole};
use super::super::lists::take_extension;
use super::super::meshopt::{Filter, Layout, StreamMode, decode};
use super::super::repack::ByteSpan;
use super::decoded::{DecodeBudget, DecodedBytes};
use crate::error::ReadError;
use crate::excerpt::excerpt;

/// Decodes all compressed views.
pub(super) fn unpack(
    json: &mut Value,
    buffers: &mut Vec<Arc<Vec<u8>>>,
    room: &mut DecodeBudget,
) -> Result<(), ReadError> {
    let is_used = |name: &str| list(json, name).iter().any(|e| extension(e).is_some());
    if !is_used("bufferViews") && !is_used("buffers") {
        return Ok(());
    }
    let mut fresh = DecodedBytes::default();
    let mut rounded = HashSet::new();
    for (i, view) in list(json, "bufferViews").iter().enumerate() {
        let Some((name, extension)) = extension(view) else { continue };
        let at = format!("bufferViews[{i}]");
        let (layout, source) = layout(extension, &format!("{at}.{name}"))?;
        layout.check().map_err(|problem| ReadError::element(at.as_str(), problem))?;
        let Layout { count, stride, filter, .. } = layout;
        let length = whole(view, "byteLength", &at)?;
        let size = count.checked_mul(stride).filter(|size| Some(*size) == length).ok_or_else(|| {
            let shown = length.map_or("missing".to_owned(), |n| n.to_string());
            let problem = format!("byteLength is {shown}, but it holds {count} elements of {stride} bytes");
            ReadError::element(at.as_str(), problem)
        })?;
        room.take(size as u64)?;
        let ByteSpan { buffer, bytes } = &source;
        let Some(whole_buffer) = buffers.get(*buffer) else {
            let problem = format!("refers to buffers[{buffer}], but the file has {}", buffers.len());
            return Err(ReadError::element(at, problem));
        };
        let stream = whole_buffer.get(bytes.clone()).ok_or_else(|| {
            let (from, to, length) = (bytes.start, bytes.end, whole_buffer.len());
            let problem =
                format!("its bytes {from} to {to} reach beyond buffers[{buffer}] of {length} bytes");
            ReadError::element(at.as_str(), problem)
        })?;
        let decoded = decode(stream, layout).map_err(|problem| ReadError::element(at.as_str(), problem))?;
        fresh.push(i, &decoded);
        fresh.freed.push(source);
        if filter != Filter::None {
            rounded.insert(i);
        }
    }
    for view in list_mut(json, "bufferViews") {
        MESHOPT.iter().for_each(|name| drop(take_extension(view, name)));
    }
    fresh.finish(json, buffers);
    bounds(json, buffers, &rounded)
}

/// Returns the layout of a stream, and its byte range.
fn layout(extension: &Value, at: &str) -> Result<(Layout, ByteSpan), ReadError> {
    let needed = |name: &str| {
        whole(extension, name, at)?.ok_or_else(|| ReadError::element(at, format!("{name} is missing")))
    };
    let word = |name: &str| match &extension[name] {
        Value::Null => Ok(None),
        Value::String(word) => Ok(Some(word.as_str())),
        other => {
            Err(ReadError::element(at, format!("{name} is {}, not a string", excerpt(&other.to_string()))))
        }
    };
    let unknown = |name: &str, word: &str| {
        ReadError::Unsupported(format!("{at}: the {name} {} is unknown", excerpt(word)))
    };
    let mode = match word("mode")? {
        Some("ATTRIBUTES") => StreamMode::Attributes,
        Some("TRIANGLES") => StreamMode::Triangles,
        Some("INDICES") => StreamMode::Indices,
        Some(other) => return Err(unknown("mode", other)),
        None => return Err(ReadError::element(at, "mode is missing")),
    };
    let filter = match word("filter")? {
        None | Some("NONE") => Filter::None,
        Some("OCTAHEDRAL") => Filter::Octahedral,
        Some("QUATERNION") => Filter::Quaternion,
        Some("EXPONENTIAL") => Filter::Exponential,
        Some("COLOR") => Filter::Color,
        Some(other) => return Err(unknown("filter", other)),
    };
    let start = whole(extension, "byteOffset", at)?.unwrap_or(0);
    let end = start.saturating_add(needed("byteLength")?);
    let source = ByteSpan { buffer: needed("buffer")?, bytes: start..end };
    Ok((Layout { mode, filter, count: needed("count")?, stride: needed("byteStride")? }, source))
}

/// Recomputes the bounds of accessors that a filter has rounded: writers may have computed them before that.
fn bounds(json: &mut Value, buffers: &[Arc<Vec<u8>>], rounded: &HashSet<usize>) -> Result<(), ReadError> {
    let mut found = Vec::new();
    {
        let opened = Buffers::loaded(json, buffers, 0);
        for (i, accessor) in list(json, "accessors").iter().enumerate() {
            let is_rounded = number(&accessor["bufferView"]).is_some_and(|view| rounded.contains(&view));
            let has_bounds = !accessor["min"].is_null() || !accessor["max"].is_null();
            if is_rounded && has_bounds && accessor["sparse"].is_null() {
                let name = format!("accessors[{i}]");
                found.push((i, Accessor::new(json, &opened, i, &name)?.bounds()));
            }
        }
    }
    for (i, (min, max)) in found {
        let accessor = &mut list_mut(json, "accessors")[i];
        for (name, bound) in [("min", min), ("max", max)] {
            if !accessor[name].is_null() {
                accessor[name] = bound.into();
            }
        }
    }
    Ok(())
}
