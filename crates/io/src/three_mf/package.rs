//! Access to the parts of the archive.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use quick_xml::events::Event;
use zip::ZipArchive;
use zip::result::ZipError;

use super::model::{attribute, parse_events};
use crate::error::ReadError;
use crate::excerpt::excerpt;
use crate::gltf::percent_decoded;
use crate::limits::Limits;
use crate::lines::utf8_of;

/// The type of the relation that names the first model.
const MODEL_RELATION: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/// Usual name of the first model part.
const USUAL_MODEL: &str = "3d/3dmodel.model";

/// An open archive. All its parts together may unpack to no more bytes than the limits allow.
pub(super) struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    /// Entries by their names in lower case: case does not matter.
    names: BTreeMap<String, usize>,
    packed: u64,
    limit: u64,
    /// Number of unpacked bytes so far.
    pub(super) unpacked: u64,
    limits: Limits,
}

impl<'a> Package<'a> {
    pub(super) fn open(bytes: &'a [u8], limits: Limits) -> Result<Self, ReadError> {
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| damaged("the ZIP archive", &e))?;
        let mut names = BTreeMap::new();
        for index in 0..archive.len() {
            if let Some(Ok(name)) = archive.name_for_index(index) {
                names.entry(name_of(&name)).or_insert(index);
            }
        }
        let (packed, limit) = (bytes.len() as u64, limits.max_unpacked_bytes(bytes.len()));
        Ok(Self { archive, names, packed, limit, unpacked: 0, limits })
    }

    /// Returns the bytes of a part; `None` if there is no part of this name.
    pub(super) fn part(&mut self, path: &str) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(&index) = self.names.get(&name_of(path)) else { return Ok(None) };
        let file = self.archive.by_index(index).map_err(|e| damaged(path, &e))?;
        if file.encrypted() {
            return Err(ReadError::Unsupported(format!("{} is encrypted: it is not read", excerpt(path))));
        }
        let left = self.limit - self.unpacked;
        let mut bytes = Vec::new();
        let read = file.take(left.saturating_add(1)).read_to_end(&mut bytes);
        self.unpacked += bytes.len() as u64;
        self.limits.check_memory("unpacking 3MF", self.unpacked.saturating_add(self.packed))?;
        if bytes.len() as u64 > left {
            let times = self.limit / self.packed.max(1);
            return Err(ReadError::Ratio { what: "the ZIP archive", limit: self.limit, times });
        }
        match read {
            Ok(_) => Ok(Some(bytes)),
            Err(e) => {
                Err(ReadError::element(excerpt(path), format!("the ZIP archive is damaged there: {e}")))
            }
        }
    }

    /// Returns the path of the first model.
    pub(super) fn first_model(&mut self) -> Result<String, ReadError> {
        let mut found = None;
        if let Some(relations) = self.part("_rels/.rels")? {
            let text = utf8_of(&relations);
            parse_events("_rels/.rels", &text, |event, _| {
                if let Event::Start(e) | Event::Empty(e) = event
                    && attribute(e, b"Type")?.as_deref() == Some(MODEL_RELATION)
                    && found.is_none()
                {
                    found = attribute(e, b"Target")?;
                }
                Ok(())
            })?;
        }
        if let Some(path) = found {
            return Ok(path);
        }
        let mut names: Vec<&String> = self.names.keys().filter(|name| name.ends_with(".model")).collect();
        names.sort_by_key(|name| (*name != USUAL_MODEL, name.len()));
        match names.first() {
            Some(name) => Ok((*name).clone()),
            None => Err(ReadError::file("the ZIP archive holds no 3D model: a 3MF file has one in 3D/")),
        }
    }
}

/// Returns the name of a part without its leading slash, in lower case, with blanks for `%20` and slashes for
/// backslashes: programs differ in whether they encode the names in the archive, in references to them, or both.
pub(super) fn name_of(path: &str) -> String {
    let decoded = percent_decoded(path).and_then(|bytes| String::from_utf8(bytes).ok());
    let path = decoded.unwrap_or_else(|| path.to_owned()).replace('\\', "/");
    path.trim_start_matches('/').to_ascii_lowercase()
}

fn damaged(what: &str, error: &ZipError) -> ReadError {
    ReadError::element(excerpt(what), format!("cannot be unpacked: {error}"))
}
