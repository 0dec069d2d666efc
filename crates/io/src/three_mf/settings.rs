//! Settings of slicers: which parts of an object are printed, subtracted, or change settings inside them.
//!
//! PrusaSlicer (and Slic3r, SuperSlicer) lists ranges of the triangles of an object; BambuStudio and OrcaSlicer name its
//! components. Sources: see [`marks`](super::marks).

use std::collections::{BTreeMap, HashMap};

use quick_xml::Writer;
use quick_xml::events::{BytesStart, Event};

use super::model::{attribute, parse_events, required_number};
use crate::error::ReadError;

/// What a slicer does with a part that is not solid: the words of PrusaSlicer and of BambuStudio, and ours.
const ROLES: [(&str, &str, &str); 4] = [
    ("NegativeVolume", "negative_part", "negative part"),
    ("ParameterModifier", "modifier_part", "modifier"),
    ("SupportBlocker", "support_blocker", "support blocker"),
    ("SupportEnforcer", "support_enforcer", "support enforcer"),
];

/// A range of the triangles of an object, from the first to the last, and what it is if not solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Volume {
    pub(super) first: u32,
    pub(super) last: u32,
    pub(super) role: Option<&'static str>,
}

/// The parts of objects.
#[derive(Default)]
pub(super) struct Settings {
    /// By objects.
    pub(super) volumes: HashMap<u32, Vec<Volume>>,
    /// By objects and the objects that are their components.
    pub(super) roles: HashMap<(u32, u32), &'static str>,
    /// True if there is a file of settings of objects.
    pub(super) is_present: bool,
}

/// The program that wrote a file of settings.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Dialect {
    Prusa,
    Bambu,
}

/// Returns the dialect of a file, by its name in lower case.
fn dialect(path: &str) -> Option<Dialect> {
    match path {
        "metadata/model_settings.config" => Some(Dialect::Bambu),
        _ if path.starts_with("metadata/") && path.ends_with("_model.config") => Some(Dialect::Prusa),
        _ => None,
    }
}

/// Returns true if this file, by its name in lower case, names objects.
pub(super) fn names_objects(path: &str) -> bool {
    dialect(path).is_some()
}

/// The number and the triangles of objects as they are written.
#[derive(Default)]
pub(super) struct WrittenObjects {
    /// For each volume of an object, the number of its triangles.
    pub(super) volumes: BTreeMap<u32, Vec<usize>>,
    /// Numbers of triangles of other objects.
    pub(super) faces: BTreeMap<u32, usize>,
    /// Objects of components.
    pub(super) assemblies: Vec<u32>,
}

impl WrittenObjects {
    fn has(&self, id: u32) -> bool {
        self.volumes.contains_key(&id) || self.faces.contains_key(&id) || self.assemblies.contains(&id)
    }
}

impl Settings {
    /// Adds what a file of settings says.
    pub(super) fn add(&mut self, path: &str, text: &[u8]) -> Result<(), ReadError> {
        let Some(dialect) = dialect(path) else { return Ok(()) };
        self.is_present = true;
        let (mut object, mut part) = (0, 0);
        parse_events(path, text, |event, _| {
            let (Event::Start(e) | Event::Empty(e)) = event else { return Ok(()) };
            match (e.local_name().as_ref(), dialect) {
                (b"object", _) => object = required_number(e, b"id")?,
                (b"part", Dialect::Bambu) => {
                    part = required_number(e, b"id")?;
                    let kind = attribute(e, b"subtype")?;
                    let role = ROLES.iter().find(|(_, bambu, _)| kind.as_deref() == Some(bambu));
                    self.roles.extend(role.map(|(.., ours)| ((object, part), *ours)));
                }
                (b"volume", Dialect::Prusa) => {
                    let (first, last) = (required_number(e, b"firstid")?, required_number(e, b"lastid")?);
                    self.volumes.entry(object).or_default().push(Volume { first, last, role: None });
                }
                (b"metadata", Dialect::Prusa) => {
                    let (key, value) = (attribute(e, b"key")?, attribute(e, b"value")?);
                    let (key, value) = (key.as_deref(), value.as_deref().unwrap_or_default());
                    let word = match key {
                        Some("volume_type") => value,
                        Some("modifier") if value == "1" => "ParameterModifier",
                        _ => return Ok(()),
                    };
                    let role = ROLES.iter().find(|(prusa, ..)| word == *prusa).map(|(.., ours)| *ours);
                    let volume = self.volumes.get_mut(&object).and_then(|all| all.last_mut());
                    volume.into_iter().for_each(|volume| volume.role = role.or(volume.role));
                }
                _ => {}
            }
            Ok(())
        })
    }

    /// Returns the volumes of an object of this many triangles: `None` if it is one solid, or if they do not cover it.
    pub(super) fn volumes_of(&self, object: u32, triangles: usize) -> Option<&[Volume]> {
        let all = self.volumes.get(&object)?;
        let mut next = 0;
        let is_covered = all.iter().all(|v| {
            let fits = v.first as usize == next && v.last >= v.first;
            next = v.last as usize + 1;
            fits
        });
        let is_one = all.len() == 1 && all[0].role.is_none();
        (is_covered && next == triangles && !is_one).then_some(all)
    }
}

/// Returns a file of settings for objects as they are written: with their ranges and numbers of triangles, and without
/// those that are gone. Another file is returned as it is.
pub(super) fn updated(path: &str, text: &[u8], objects: &WrittenObjects) -> Vec<u8> {
    let Some(dialect) = dialect(path) else { return text.to_vec() };
    let mut out = Writer::new(Vec::with_capacity(text.len()));
    let mut reader = quick_xml::Reader::from_reader(text);
    let (mut object, mut at, mut next, mut faces) = (0, 0, 0, None);
    // Number of open elements of one that is left out.
    let mut skipped = 0usize;
    loop {
        let Ok(event) = reader.read_event() else { return text.to_vec() };
        if matches!(event, Event::Eof) {
            return out.into_inner();
        }
        if skipped > 0 {
            match event {
                Event::Start(_) => skipped += 1,
                Event::End(_) => skipped -= 1,
                _ => {}
            }
            continue;
        }
        let (Event::Start(e) | Event::Empty(e)) = &event else {
            let _ = out.write_event(event);
            continue;
        };
        let id = |name: &[u8]| required_number(e, name).unwrap_or(u32::MAX);
        let mut changed = None;
        let mut is_gone = false;
        match (e.local_name().as_ref(), dialect) {
            (b"object", _) => {
                (object, at, next) = (id(b"id"), 0, 0);
                is_gone = !objects.has(object);
            }
            (b"part", Dialect::Bambu) => {
                let part = id(b"id");
                faces = objects.faces.get(&part);
                is_gone = !objects.has(part);
            }
            (b"mesh_stat", Dialect::Bambu) => {
                let count = faces.map(usize::to_string);
                changed = count.map(|count| with_attributes(e, &[("face_count", count)]));
            }
            (b"volume", Dialect::Prusa) => {
                let count = match objects.volumes.get(&object) {
                    Some(all) => all.get(at).copied().unwrap_or(0),
                    None => objects.faces.get(&object).copied().unwrap_or(0),
                };
                let first = next;
                (at, next, is_gone) = (at + 1, next + count, count == 0);
                let (first, last) = (first.to_string(), next.saturating_sub(1).to_string());
                changed = Some(with_attributes(e, &[("firstid", first), ("lastid", last)]));
            }
            _ => {}
        }
        let is_empty = matches!(event, Event::Empty(_));
        if is_gone {
            skipped = usize::from(!is_empty);
            continue;
        }
        let _ = out.write_event(match (changed, is_empty) {
            (None, _) => event,
            (Some(element), true) => Event::Empty(element),
            (Some(element), false) => Event::Start(element),
        });
    }
}

/// Returns an element with other values of some of its attributes.
fn with_attributes(e: &BytesStart<'_>, values: &[(&str, String)]) -> BytesStart<'static> {
    let mut new = BytesStart::new(String::from_utf8_lossy(e.name().as_ref()).into_owned());
    for attribute in e.attributes().with_checks(false).flatten() {
        let other = values.iter().find(|(name, _)| name.as_bytes() == attribute.key.as_ref());
        match other {
            Some((name, value)) => new.push_attribute((*name, value.as_str())),
            None => new.push_attribute(attribute),
        }
    }
    new
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRUSA: &str = "metadata/slic3r_pe_model.config";

    #[test]
    fn ranges_follow_the_triangles() {
        let text = br#"<?xml version="1.0"?>
<config><object id="1" a="&amp;"><metadata type="object" key="name" value="x"/><volume firstid="0" lastid="11"/>
<volume firstid="12" lastid="23"><metadata key="volume_type" value="NegativeVolume"/><mesh edges_fixed="0"/></volume>
<volume firstid="24" lastid="30"/></object><object id="2"><volume firstid="0" lastid="9"></volume></object></config>"#;
        let mut settings = Settings::default();
        settings.add(PRUSA, text).unwrap();
        let volumes = settings.volumes_of(1, 31).unwrap();
        assert_eq!(volumes.iter().map(|v| v.role).collect::<Vec<_>>(), [None, Some("negative part"), None]);
        assert_eq!(settings.volumes_of(1, 30), None);
        assert_eq!(settings.volumes_of(2, 10), None);
        let objects = WrittenObjects { volumes: [(1, vec![4, 6, 0])].into(), ..WrittenObjects::default() };
        let expected = r#"<?xml version="1.0"?>
<config><object id="1" a="&amp;"><metadata type="object" key="name" value="x"/><volume firstid="0" lastid="3"/>
<volume firstid="4" lastid="9"><metadata key="volume_type" value="NegativeVolume"/><mesh edges_fixed="0"/></volume>
</object></config>"#;
        assert_eq!(String::from_utf8(updated(PRUSA, text, &objects)).unwrap(), expected);
    }
}
