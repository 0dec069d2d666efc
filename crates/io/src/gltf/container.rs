//! File container: the JSON and the binary chunk.

use std::io::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::references::table::known;
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::limits::Limits;

/// A parsed file.
pub(super) struct Document<'a> {
    pub(super) json: Value,
    /// The binary chunk of a GLB.
    pub(super) bin: Option<&'a [u8]>,
    pub(super) is_glb: bool,
}

/// The parts of a new file: its JSON, and the bytes of its only buffer, which the JSON does not contain.
pub(super) struct FileParts {
    pub(super) json: Value,
    pub(super) bytes: Vec<u8>,
    /// Warnings of making it.
    pub(super) warnings: Vec<Warning>,
}

impl FileParts {
    /// Takes the JSON, for the readers of glTF.
    pub(super) fn document(&mut self) -> Document<'_> {
        Document { json: std::mem::take(&mut self.json), bin: Some(&self.bytes), is_glb: true }
    }
}

/// Limits on the memory of parsed JSON: bytes per byte of text, and a total that any file may reach. Scenes
/// of thousands of nodes and accessors need 20 bytes per byte, nodes with only a transform 32; nested empty
/// lists, which `extras` may hold, 130.
const MEMORY_PER_JSON_BYTE: u64 = 48;
const ALWAYS_ALLOWED_MEMORY: u64 = 512 << 20;
/// Shorter JSON is not checked.
const SMALL_JSON: usize = 1 << 20;
/// Bytes of a value within its list; of a list, with its minimum capacity of four; of an object, with its
/// list and table of keys.
const BYTES_PER_VALUE: u64 = 80;
const BYTES_PER_LIST: u64 = 304;
const BYTES_PER_OBJECT: u64 = 440;

const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// Extensions that affect only appearance or behaviour, without which a mesh can be read; extensions that
/// begin with `KHR_materials_` are of this kind too.
pub(super) const IGNORABLE_EXTENSIONS: [&str; 9] = [
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "MSFT_texture_dds",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_xmp_json_ld",
    "KHR_xmp",
];

impl<'a> Document<'a> {
    /// Parses a file. `copies`: maximum number of copies of the JSON that will be in memory at once.
    pub(super) fn parse(bytes: &'a [u8], limits: Limits, copies: u64) -> Result<Self, ReadError> {
        let is_glb = bytes.starts_with(b"glTF");
        let (text, bin) = if is_glb { chunks(bytes)? } else { (bytes, None) };
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        // Some programs pad the chunk with zeros in place of blanks.
        let text = &text[..text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1)];
        if !text.trim_ascii_start().starts_with(b"{") {
            let what = if is_glb {
                "the JSON chunk is not a JSON object"
            } else {
                "it begins with neither `glTF` nor a JSON object"
            };
            return Err(ReadError::file(format!("not glTF: {what}")));
        }
        let parsed = parsed_bytes(text);
        if parsed > ALWAYS_ALLOWED_MEMORY && parsed / MEMORY_PER_JSON_BYTE > text.len() as u64 {
            let (what, limit) = ("the JSON of the file", ALWAYS_ALLOWED_MEMORY);
            return Err(ReadError::Ratio { what, limit, times: MEMORY_PER_JSON_BYTE });
        }
        let need = parsed.saturating_mul(copies).saturating_add(bytes.len() as u64);
        limits.check_memory("reading the JSON of glTF", need)?;
        let json =
            serde_json::from_slice(text).map_err(|e| ReadError::file(format!("the JSON is damaged: {e}")))?;
        Ok(Self { json, bin, is_glb })
    }

    pub(super) fn check_version(&self) -> Result<(), ReadError> {
        let old =
            || ReadError::Unsupported("glTF 1.0 is not read: convert the file to glTF 2.0 first".to_owned());
        match self.json["asset"]["version"].as_str() {
            Some(v) if v.starts_with("2.") || v == "2" => Ok(()),
            Some(v) if v.starts_with("1.") || v.starts_with("0.") || v == "1" => Err(old()),
            Some(v) => {
                let v = excerpt(v);
                Err(ReadError::Unsupported(format!("glTF {v} is not supported: only 2.0 is")))
            }
            // In version 1 the lists were maps.
            None if self.json["meshes"].is_object() || self.json["accessors"].is_object() => Err(old()),
            None => Err(ReadError::element("asset", "the version is missing")),
        }
    }

    /// Returns an error if the file requires an unsupported extension.
    pub(super) fn check_extensions(&self) -> Result<(), ReadError> {
        for name in list(&self.json, "extensionsRequired") {
            let name = name.as_str().unwrap_or("(no name)");
            // Other materials do not prevent reading the geometry.
            if known(name).is_none() && !name.starts_with("KHR_materials_") {
                let name = excerpt(name);
                return Err(ReadError::Unsupported(format!(
                    "the file requires the extension {name}, which is not supported"
                )));
            }
        }
        Ok(())
    }
}

/// Estimates the memory of parsed JSON: the text itself, plus a constant for each value, list and object.
/// (Measured: docs/decisions/0022.)
fn parsed_bytes(text: &[u8]) -> u64 {
    // Too small to matter.
    if text.len() < SMALL_JSON {
        return SMALL_JSON as u64;
    }
    // In short runs, whose counts fit the byte lanes of SIMD registers. Characters within strings count too;
    // they are few.
    let (mut values, mut lists, mut objects) = (0u64, 0u64, 0u64);
    for piece in text.chunks(255) {
        let count = |sign: u8| u64::from(piece.iter().map(|b| u8::from(*b == sign)).sum::<u8>());
        values += count(b',');
        lists += count(b'[');
        objects += count(b'{');
    }
    let parts = [(values, BYTES_PER_VALUE), (lists, BYTES_PER_LIST), (objects, BYTES_PER_OBJECT)];
    parts.iter().fold(text.len() as u64, |sum, (n, bytes)| sum.saturating_add(n.saturating_mul(*bytes)))
}

/// Splits a GLB into its JSON and its binary chunk.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), ReadError> {
    let word = |at: usize| bytes.get(at..)?.first_chunk().map(|b| u32::from_le_bytes(*b));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(ReadError::file(format!(
            "the GLB is cut off: it has {} bytes, and its header alone takes 12",
            bytes.len()
        )));
    };
    if version == 1 {
        return Err(ReadError::Unsupported(
            "glTF 1.0 is not read: convert the file to glTF 2.0 first".to_owned(),
        ));
    }
    if version != 2 {
        return Err(ReadError::byte(4, format!("GLB version {version} is not supported: only 2 is")));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(ReadError::file(format!(
            "the header claims {length} bytes, but the file has {}: it is cut off, or the header is wrong",
            bytes.len()
        )));
    }
    let (mut json, mut bin) = (None, None);
    let mut at = 12;
    // Less than a chunk's header at the end is padding.
    while at + 8 <= length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else { break };
        let start = at + 8;
        let Some(chunk) = bytes[start..length].get(..size as usize) else {
            return Err(ReadError::byte(
                at,
                format!("a chunk claims {size} bytes, but {} are left of the GLB", length - start),
            ));
        };
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(chunk),
            BIN_CHUNK if bin.is_none() => bin = Some(chunk),
            // Others are for extensions.
            _ => {}
        }
        at = start + chunk.len();
    }
    json.map(|json| (json, bin)).ok_or_else(|| ReadError::byte(12, "the GLB has no JSON chunk"))
}

/// Writes a file: JSON in which the bytes of the first buffer are embedded, or a GLB with a binary chunk.
pub(super) fn emit(mut json: Value, bytes: &[u8], glb: bool, out: &mut dyn Write) -> io::Result<()> {
    if !glb {
        if let Some(buffer) = list_mut(&mut json, "buffers").first_mut().and_then(Value::as_object_mut) {
            let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes));
            buffer.insert("uri".to_owned(), uri.into());
        }
        serde_json::to_writer(&mut *out, &json)?;
        return out.write_all(b"\n");
    }
    let mut text = serde_json::to_vec(&json)?;
    while !text.len().is_multiple_of(4) {
        text.push(b' ');
    }
    let padding = bytes.len().next_multiple_of(4) - bytes.len();
    let chunk = if bytes.is_empty() { 0 } else { 8 + bytes.len() + padding };
    let total = 12 + 8 + text.len() + chunk;
    let size = |n: usize| {
        let problem = || format!("a GLB cannot hold {total} bytes; its sizes have 32 bits");
        u32::try_from(n).map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, problem()))
    };
    let total = size(total)?;
    out.write_all(b"glTF")?;
    for number in [2, total, size(text.len())?] {
        out.write_all(&number.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if bytes.is_empty() {
        return Ok(());
    }
    out.write_all(&size(bytes.len() + padding)?.to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    out.write_all(bytes)?;
    out.write_all(&[0; 3][..padding])
}

/// Returns the entries of a list of an object; none if it is missing.
pub(super) fn list<'v>(object: &'v Value, name: &str) -> &'v [Value] {
    object[name].as_array().map_or(&[], Vec::as_slice)
}

/// Returns the entries of a list of an object, mutably; none if it is missing.
pub(super) fn list_mut<'v>(object: &'v mut Value, name: &str) -> &'v mut [Value] {
    object.get_mut(name).and_then(Value::as_array_mut).map_or(&mut [], Vec::as_mut_slice)
}

/// Returns a property that is a non-negative integer; `None` if it is missing.
pub(super) fn whole(object: &Value, name: &str, at: &str) -> Result<Option<usize>, ReadError> {
    let value = &object[name];
    if value.is_null() {
        return Ok(None);
    }
    number(value).map(Some).ok_or_else(|| {
        let shown = excerpt(&value.to_string());
        ReadError::element(at, format!("{name} is {shown}, not a whole number from 0"))
    })
}

/// Returns a value as a non-negative integer.
pub(super) fn number(value: &Value) -> Option<usize> {
    // Some programs write whole numbers as `3.0`.
    let from_float =
        || value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..=9e15).contains(x)).map(|x| x as u64);
    value.as_u64().or_else(from_float).and_then(|n| usize::try_from(n).ok())
}

/// Returns the entry with this index, and its name for messages.
pub(super) fn entry<'v>(
    json: &'v Value,
    name: &str,
    index: usize,
    from: &str,
) -> Result<(&'v Value, String), ReadError> {
    let all = list(json, name);
    let found = all.get(index).ok_or_else(|| {
        ReadError::element(from, format!("refers to {name}[{index}], but the file has {}", all.len()))
    })?;
    Ok((found, format!("{name}[{index}]")))
}
