//! Access to the parts of the archive.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashSet};
use std::io::{Cursor, Read};

use lodsmith_core::numbers::counted;
use quick_xml::events::Event;
use zip::ZipArchive;
use zip::result::ZipError;

use super::kept::{KeptContents, name_of};
use super::model::{attribute, parse_events};
use super::settings::{Settings, names_objects};
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::limits::Limits;
use crate::lines::utf8_of;

/// The type of the relation that names the first model.
const MODEL_RELATION: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/// The end of the types of relations that name thumbnails.
const THUMBNAIL: &str = "/metadata/thumbnail";
/// Folders of settings, thumbnails and pictures, of PrusaSlicer and of BambuStudio and OrcaSlicer.
const KEPT_FOLDERS: [&str; 2] = ["metadata/", "auxiliaries/"];
/// Folders of the parts that the writer makes.
const OWN_FOLDERS: [&str; 3] = ["3d/", "_rels/", "[content_types]"];
const CONTENT_TYPES: &str = "[content_types].xml";
/// Usual name of the first model part.
const USUAL_MODEL: &str = "3d/3dmodel.model";

/// An open archive. All its parts together may unpack to no more bytes than the limits allow.
pub(super) struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    /// Entries by their names in lower case: case does not matter.
    names: BTreeMap<String, usize>,
    /// Names of entries that are not there for these names, since earlier ones have them, but for case.
    repeated: Vec<String>,
    /// Those that were read.
    read: HashSet<usize>,
    /// Relations of the archive: type and target.
    relations: Vec<(String, String)>,
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
        let mut repeated = Vec::new();
        for index in 0..archive.len() {
            if let Some(Ok(name)) = archive.name_for_index(index) {
                match names.entry(name_of(&name)) {
                    Entry::Vacant(entry) => _ = entry.insert(index),
                    Entry::Occupied(_) if name.ends_with(['/', '\\']) => {}
                    Entry::Occupied(_) => repeated.push(name.into_owned()),
                }
            }
        }
        let (packed, limit) = (bytes.len() as u64, limits.max_unpacked_bytes(bytes.len()));
        let relations = Vec::new();
        let read = HashSet::new();
        Ok(Self { archive, names, repeated, read, relations, packed, limit, unpacked: 0, limits })
    }

    /// Returns the bytes of a part; `None` if there is no part of this name.
    pub(super) fn part(&mut self, path: &str) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(&index) = self.names.get(&name_of(path)) else { return Ok(None) };
        self.read.insert(index);
        let file = self.archive.by_index(index).map_err(|e| damaged(path, &e))?;
        if file.encrypted() {
            return Err(ReadError::Unsupported(format!("{} is encrypted: it is not read", excerpt(path))));
        }
        let left = self.limit.saturating_sub(self.unpacked);
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

    /// Returns what the files of settings say.
    pub(super) fn settings(&mut self, warn: &mut dyn FnMut(Warning)) -> Settings {
        let mut settings = Settings::default();
        let names: Vec<String> = self.names.keys().filter(|name| names_objects(name)).cloned().collect();
        for name in names {
            let read = self.part(&name).and_then(|text| settings.add(&name, &text.unwrap_or_default()));
            if let Err(e) = read {
                warn(Warning::lost(format!("settings of a slicer cannot be read: {e}")));
                return Settings { is_damaged: true, ..Settings::default() };
            }
        }
        settings
    }

    /// Returns settings, thumbnails and other files of slicers, with what refers to them. Files that cannot be unpacked and
    /// results of slicing, which do not fit another mesh, are left out, with a warning.
    /// `is_damaged`: true if settings of objects cannot be read.
    pub(super) fn kept_contents(&mut self, is_damaged: bool, warn: &mut dyn FnMut(Warning)) -> KeptContents {
        let mut kept = KeptContents::default();
        if let Some(first) = self.repeated.first() {
            let files = counted(self.repeated.len(), "file has", "files have");
            let text = format!(
                "{files} the name of an earlier file in the archive, but for case ({} first): dropped",
                excerpt(first)
            );
            warn(Warning::lost(text));
        }
        let thumbnails = self.relations.iter().filter(|(kind, _)| kind.ends_with(THUMBNAIL));
        let thumbnails: HashSet<String> = thumbnails.map(|(_, target)| name_of(target)).collect();
        let is_kept = |name: &str| {
            let is_beside = KEPT_FOLDERS.iter().any(|folder| name.starts_with(folder))
                // Shapes that slicers cut or emboss.
                || (name.starts_with("3d/") && name.ends_with(".svg"))
                || (thumbnails.contains(name) && !OWN_FOLDERS.iter().any(|folder| name.starts_with(folder)));
            is_beside && !name.ends_with('/') && !name.split('/').any(|word| word == "..")
        };
        if self.names.keys().any(|name| thumbnails.contains(name) && !is_kept(name)) {
            warn(Warning::lost("a thumbnail among the parts of the model is not kept"));
        }
        let (kept_names, others): (Vec<_>, Vec<_>) = self.names.iter().partition(|(name, _)| is_kept(name));
        let names: Vec<(String, usize)> = kept_names.into_iter().map(|(n, i)| (n.clone(), *i)).collect();
        // Folders, relations and types are made anew.
        let is_made = |name: &str| {
            name.ends_with('/')
                || name.contains("_rels/")
                || name == CONTENT_TYPES
                || thumbnails.contains(name)
        };
        let mut others =
            others.into_iter().filter(|(name, index)| !self.read.contains(index) && !is_made(name));
        if let Some((first, _)) = others.next() {
            let files = counted(others.count() + 1, "file", "files");
            let first = excerpt(first);
            warn(Warning::lost(format!("no part of the model uses {files} ({first} first): dropped")));
        }
        let mut sliced = Vec::new();
        for (name, index) in names {
            if is_result_of_slicing(&name) {
                sliced.push(name);
                continue;
            }
            // Relations of files in a folder name results of slicing, and damaged settings fit no object.
            if name.contains("_rels/") || (is_damaged && names_objects(&name)) {
                continue;
            }
            let path = self.archive.name_for_index(index).and_then(Result::ok).unwrap_or_default();
            let path = path.replace('\\', "/").trim_start_matches("./").trim_start_matches('/').to_owned();
            match self.part(&name) {
                Ok(Some(bytes)) => {
                    kept.is_project |= names_objects(&name);
                    kept.files.push((path, bytes));
                }
                Ok(None) => {}
                Err(e) => {
                    let is_limit = !matches!(e, ReadError::Malformed { .. } | ReadError::Unsupported(_));
                    let further = if is_limit { ", and those after it," } else { "" };
                    warn(Warning::lost(format!("a file beside the model{further} is left out: {e}")));
                    if is_limit {
                        break;
                    }
                }
            }
        }
        if let Some(first) = sliced.first() {
            let files = counted(sliced.len(), "file of a sliced model is", "files of a sliced model are");
            warn(Warning::lost(format!("{files} not kept ({} first)", excerpt(first))));
            // What the result of slicing weighs and costs.
            kept.files.retain(|(path, _)| name_of(path) != "metadata/slice_info.config");
        }
        let names: HashSet<String> = kept.files.iter().map(|(path, _)| name_of(path)).collect();
        let relations = self.relations.iter().filter(|(_, target)| names.contains(&name_of(target)));
        kept.relations = relations.cloned().collect();
        if let Ok(Some(text)) = self.part(CONTENT_TYPES) {
            // Types that cannot be read are those of no part.
            let _ = parse_events("[Content_Types].xml", &utf8_of(&text), |event| {
                if let Event::Start(e) | Event::Empty(e) = event
                    && let Some(kind) = attribute(e, b"ContentType")?
                {
                    if let Some(extension) = attribute(e, b"Extension")? {
                        kept.types.entry(extension.to_ascii_lowercase()).or_insert_with(|| kind.clone());
                    }
                    kept.part_types.extend(attribute(e, b"PartName")?.map(|part| (name_of(&part), kind)));
                }
                Ok(())
            });
        }
        kept
    }

    /// Returns the path of the first model.
    pub(super) fn first_model(&mut self) -> Result<String, ReadError> {
        if let Some(relations) = self.part("_rels/.rels")? {
            parse_events("_rels/.rels", &utf8_of(&relations), |event| {
                if let Event::Start(e) | Event::Empty(e) = event
                    && let (Some(kind), Some(target)) = (attribute(e, b"Type")?, attribute(e, b"Target")?)
                {
                    self.relations.push((kind, target));
                }
                Ok(())
            })?;
        }
        if let Some((_, path)) = self.relations.iter().find(|(kind, _)| kind == MODEL_RELATION) {
            return Ok(path.clone());
        }
        let mut names: Vec<&String> = self.names.keys().filter(|name| name.ends_with(".model")).collect();
        names.sort_by_key(|name| (*name != USUAL_MODEL, name.len()));
        match names.first() {
            Some(name) => Ok((*name).clone()),
            None => Err(ReadError::file("the ZIP archive holds no 3D model: a 3MF file has one in 3D/")),
        }
    }
}

/// Returns true for G-code, and for boxes of the objects on a plate (BambuStudio), by the name in lower case.
fn is_result_of_slicing(name: &str) -> bool {
    let plate = name.strip_prefix("metadata/plate_").and_then(|rest| rest.strip_suffix(".json"));
    name.ends_with(".gcode") || name.ends_with(".gcode.md5") || plate.is_some()
}

fn damaged(what: &str, error: &ZipError) -> ReadError {
    ReadError::element(excerpt(what), format!("cannot be unpacked: {error}"))
}
