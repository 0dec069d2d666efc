//! Access to the bytes of buffers: in the file itself, in data URIs, or in separate files.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use serde_json::Value;

use super::compressed::fallbacks;
use super::container::{Document, entry, list, whole};
use crate::assets::{Assets, Refusal};
use crate::error::ReadError;
use crate::excerpt::excerpt;
use crate::limits::Limits;

/// The buffers of a file, loaded on first use.
pub(super) struct Buffers<'a> {
    json: &'a Value,
    bin: Option<&'a [u8]>,
    pub(super) assets: Assets,
    limit: u64,
    loaded: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Number of bytes that were decoded from compressed streams.
    unpacked: usize,
}

/// A buffer view: a range of bytes of a buffer.
pub(super) struct View<'b> {
    pub(super) bytes: &'b [u8],
    pub(super) stride: Option<usize>,
    pub(super) name: String,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(document: &'a Document<'a>, assets: Assets, limits: Limits) -> Self {
        Self {
            json: &document.json,
            bin: document.bin,
            assets,
            limit: limits.max_bytes(),
            loaded: list(&document.json, "buffers").iter().map(|_| OnceCell::new()).collect(),
            unpacked: 0,
        }
    }

    /// Wraps buffers that are already loaded; `unpacked` is the number of their bytes that were decoded from
    /// compressed streams.
    pub(super) fn loaded(json: &'a Value, bytes: &'a [Arc<Vec<u8>>], unpacked: usize) -> Self {
        let cell = |b: &'a Arc<Vec<u8>>| OnceCell::from(Cow::Borrowed(b.as_slice()));
        let loaded = bytes.iter().map(cell).collect();
        Self { json, bin: None, assets: Assets::default(), limit: 0, loaded, unpacked }
    }

    /// Loads every buffer; fallback buffers for readers without an extension stay empty.
    pub(super) fn load_all(&self) -> Result<Vec<Arc<Vec<u8>>>, ReadError> {
        // Several buffers may name the same file.
        let mut known: HashMap<(&str, &Value), Arc<Vec<u8>>> = HashMap::new();
        let (mut all, mut total) = (Vec::new(), 0u64);
        let fallbacks = fallbacks(self.json);
        for (i, buffer) in list(self.json, "buffers").iter().enumerate() {
            if fallbacks.contains(&i) {
                all.push(Arc::default());
                continue;
            }
            let key = buffer["uri"].as_str().map(|uri| (uri, &buffer["byteLength"]));
            let bytes = match key.and_then(|key| known.get(&key)) {
                Some(bytes) => bytes.clone(),
                None => {
                    let bytes = self.bytes(i, "the file")?;
                    total = total.saturating_add(bytes.len() as u64);
                    Arc::new(bytes.to_vec())
                }
            };
            if total > self.limit {
                return Err(ReadError::Limit { what: "size of all buffers", size: total, limit: self.limit });
            }
            if let Some(key) = key {
                known.insert(key, bytes.clone());
            }
            all.push(bytes);
        }
        Ok(all)
    }

    /// Returns the number of bytes of all loaded buffers.
    pub(super) fn opened_bytes(&self) -> usize {
        self.loaded.iter().filter_map(OnceCell::get).map(|b| b.len()).sum()
    }

    /// Returns the number of bytes of all loaded buffers, as a measure of what the file may request: sixteen
    /// bytes decoded from a compressed stream count as one.
    pub(super) fn total(&self) -> usize {
        self.opened_bytes().saturating_sub(self.unpacked) + self.unpacked / 16
    }

    /// Returns `bufferViews[index]`, which `from` refers to.
    pub(super) fn view(&self, index: usize, from: &str) -> Result<View<'_>, ReadError> {
        let (view, name) = entry(self.json, "bufferViews", index, from)?;
        let Some(buffer) = whole(view, "buffer", &name)? else {
            return Err(ReadError::element(name, "does not refer to a buffer"));
        };
        let offset = whole(view, "byteOffset", &name)?.unwrap_or(0);
        let length = whole(view, "byteLength", &name)?
            .ok_or_else(|| ReadError::element(name.as_str(), "byteLength is missing"))?;
        let bytes = self.bytes(buffer, &name)?;
        let end = offset.checked_add(length);
        let slice = end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            ReadError::element(
                name.as_str(),
                format!(
                    "{length} bytes from byte {offset} reach beyond buffers[{buffer}] of {} bytes",
                    bytes.len()
                ),
            )
        })?;
        let stride = whole(view, "byteStride", &name)?.filter(|&s| s > 0);
        Ok(View { bytes: slice, stride, name })
    }

    fn bytes(&self, index: usize, from: &str) -> Result<&[u8], ReadError> {
        let (buffer, name) = entry(self.json, "buffers", index, from)?;
        let cell = &self.loaded[index];
        if cell.get().is_none() {
            let bytes = self.load(buffer, index, &name)?;
            let length = whole(buffer, "byteLength", &name)?
                .ok_or_else(|| ReadError::element(name.as_str(), "byteLength is missing"))?;
            if bytes.len() < length {
                let got = bytes.len();
                return Err(ReadError::element(
                    name,
                    format!("byteLength is {length}, but there are {got} bytes"),
                ));
            }
            let bytes = match bytes {
                Cow::Borrowed(b) => Cow::Borrowed(&b[..length]),
                Cow::Owned(mut b) => {
                    b.truncate(length);
                    Cow::Owned(b)
                }
            };
            // The cell is still empty: this type is used by one thread.
            let _ = cell.set(bytes);
        }
        Ok(cell.get().map_or(&[], |b| b))
    }

    fn load(&self, buffer: &Value, index: usize, name: &str) -> Result<Cow<'a, [u8]>, ReadError> {
        match (buffer["uri"].as_str(), self.bin) {
            (Some(uri), _) => match inline_data(uri) {
                Some(data) => data_uri(data, name).map(Cow::Owned),
                None => self.file(uri, name).map(Cow::Owned),
            },
            (None, Some(bin)) if index == 0 => Ok(Cow::Borrowed(bin)),
            (None, _) => Err(ReadError::element(name, "has neither a uri nor a binary chunk")),
        }
    }

    fn file(&self, uri: &str, name: &str) -> Result<Vec<u8>, ReadError> {
        let path = path_of(uri)
            .map_err(|problem| ReadError::element(name, format!("the uri `{}` {problem}", excerpt(uri))))?;
        let shown = excerpt(&path.to_string_lossy());
        let fails = |why: &str| ReadError::element(name, format!("the file {shown} {why}"));
        if !self.assets.has_folder() {
            return Err(fails("is needed, but no folder is known to search for it"));
        }
        let file = self.assets.find(&path).map_err(|refusal| fails(Refusal::reason(refusal)))?;
        file.read(self.limit).map_err(|why| fails(&why))
    }
}

/// Returns a `data:` URI without that prefix, whose case does not matter; `None` for other URIs.
pub(super) fn inline_data(uri: &str) -> Option<&str> {
    let (scheme, data) = uri.split_at_checked(5)?;
    scheme.eq_ignore_ascii_case("data:").then_some(data)
}

/// Decodes a `data:` URI, given without that prefix.
pub(super) fn data_uri(data: &str, name: &str) -> Result<Vec<u8>, ReadError> {
    // Some programs leave the padding out.
    const LENIENT: GeneralPurpose = GeneralPurpose::new(
        &alphabet::STANDARD,
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
    );
    let Some((kind, content)) = data.split_once(',') else {
        return Err(ReadError::element(name, "the data uri has no comma before its data"));
    };
    if kind.to_ascii_lowercase().ends_with(";base64") {
        LENIENT.decode(content).map_err(|e| ReadError::element(name, format!("the data uri is damaged: {e}")))
    } else {
        percent_decoded(content)
            .ok_or_else(|| ReadError::element(name, "the data uri has an invalid % escape"))
    }
}

/// Converts a URI to a path. [`Assets`] decides where it may lead.
pub(super) fn path_of(uri: &str) -> Result<PathBuf, &'static str> {
    let scheme = uri.split_once(':').map(|(s, _)| s);
    // A drive letter looks like a scheme, and is refused as one.
    if scheme
        .is_some_and(|s| !s.is_empty() && s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)))
    {
        return Err("is a network address; only files are read");
    }
    let text = percent_decoded(uri).and_then(|b| String::from_utf8(b).ok());
    let text = text.ok_or("has an invalid % escape")?;
    if text.contains('\0') || text.is_empty() {
        return Err("is not a file name");
    }
    // Windows accepts both kinds of slash, and drive letters.
    let text = text.replace('\\', "/");
    if text.contains(':') {
        return Err("is a network address; only files are read");
    }
    Ok(PathBuf::from(text))
}

/// Converts a URI to a path; `file:` is allowed before it.
pub(crate) fn file_path_of_uri(uri: &str) -> Result<String, &'static str> {
    // An absolute path keeps its slash; on Windows a drive letter follows it.
    let plain = uri.strip_prefix("file://").unwrap_or(uri);
    let drive = |path: &str| path.as_bytes().get(2) == Some(&b':');
    let plain = plain.strip_prefix('/').filter(|_| drive(plain)).unwrap_or(plain);
    if plain.contains("://") {
        return Err("is a network address; only files are read");
    }
    let text = percent_decoded(plain).and_then(|b| String::from_utf8(b).ok());
    // Some programs write paths as they are.
    let text = text.unwrap_or_else(|| plain.to_owned()).replace('\\', "/");
    if text.is_empty() || text.contains('\0') { Err("is not a file name") } else { Ok(text) }
}

pub(crate) fn percent_decoded(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(b) = bytes.next() {
        if b != b'%' {
            out.push(b);
            continue;
        }
        let digit = |b: Option<u8>| char::from(b?).to_digit(16);
        let (high, low) = (digit(bytes.next())?, digit(bytes.next())?);
        out.push((high * 16 + low) as u8);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_become_paths_and_addresses_do_not() {
        assert_eq!(path_of("a%20b/c.bin"), Ok(PathBuf::from("a b/c.bin")));
        assert_eq!(path_of("./x.bin"), Ok(PathBuf::from("./x.bin")));
        for up in ["../x", "%2e%2e/x", "..\\x", "%2e%2e%5cx"] {
            assert_eq!(path_of(up), Ok(PathBuf::from("../x")), "{up}");
        }
        for bad in ["http://a/b", "file:///a", "C:\\a", "c:a", "%43:/a", "a:b/c"] {
            assert!(path_of(bad).unwrap_err().starts_with("is a network address"), "{bad}");
        }
        assert!(path_of("a%2").is_err());
        assert!(path_of("").is_err());
    }

    #[test]
    fn data_uris() {
        assert_eq!(data_uri("application/octet-stream;base64,AAEC", "").unwrap(), [0, 1, 2]);
        assert_eq!(data_uri(";base64,AAE", "").unwrap(), [0, 1]);
        assert_eq!(data_uri("text/plain,a%20b", "").unwrap(), b"a b");
        assert!(data_uri("application/octet-stream;base64,A*", "").is_err());
        assert!(data_uri("base64", "").is_err());
    }
}
