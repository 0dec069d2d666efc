//! Settings of slicers: which parts of an object are printed, subtracted, or change settings inside them.
//!
//! PrusaSlicer (and Slic3r, SuperSlicer) lists ranges of the triangles of an object; BambuStudio and OrcaSlicer name its
//! components. Sources: see [`marks`](super::marks).

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesStart, Event};

use super::model::{attribute, parse_events, required_number};
use crate::error::ReadError;

/// Roles of parts that are not solid, in the words of PrusaSlicer, of BambuStudio and ours.
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

/// The parts of an object.
#[derive(Default)]
pub(super) struct PartRoles {
    /// Numbers, which may repeat, and what each is if not solid.
    all: Vec<(u32, Option<&'static str>)>,
    /// The first part of each number.
    firsts: HashMap<u32, usize>,
}

/// The parts of objects.
#[derive(Default)]
pub(super) struct Settings {
    /// By objects.
    pub(super) volumes: HashMap<u32, Vec<Volume>>,
    /// By objects.
    pub(super) parts: HashMap<u32, PartRoles>,
    /// True if there is a file of settings of objects.
    pub(super) is_present: bool,
    /// True if such a file cannot be read.
    pub(super) is_damaged: bool,
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

/// Ends of the names of files that name objects by their places in the list of all.
const COUNTING: [&str; 6] = [
    "layer_heights_profile.txt",
    "layer_config_ranges.xml",
    "sla_support_points.txt",
    "sla_drain_holes.txt",
    "cut_information.xml",
    "brim_ear_points.txt",
];

/// Returns true if this file names objects by their places in the list of all.
pub(super) fn counts_objects(path: &str) -> bool {
    COUNTING.iter().any(|end| path.to_ascii_lowercase().ends_with(end))
}

/// Ends of the names of files that have heights above the bed.
const WITH_HEIGHTS: [&str; 4] = [
    "layer_heights_profile.txt",
    "layer_config_ranges.xml",
    "custom_gcode_per_layer.xml",
    "custom_gcode_per_print_z.xml",
];

/// Returns true if this file has heights above the bed, which do not fit objects of another size or direction.
pub(super) fn has_heights(path: &str) -> bool {
    WITH_HEIGHTS.iter().any(|end| path.to_ascii_lowercase().ends_with(end))
}

/// The number and the triangles of objects as they are written.
#[derive(Default)]
pub(super) struct WrittenObjects {
    /// For each volume of an object, the number of its triangles.
    pub(super) volumes: BTreeMap<u32, Vec<usize>>,
    /// Numbers of triangles of other objects.
    pub(super) faces: BTreeMap<u32, usize>,
    /// Objects of components.
    pub(super) assemblies: BTreeSet<u32>,
}

impl WrittenObjects {
    pub(super) fn has(&self, id: u32) -> bool {
        self.volumes.contains_key(&id) || self.faces.contains_key(&id) || self.assemblies.contains(&id)
    }
}

impl Settings {
    /// Adds what a file of settings says.
    pub(super) fn add(&mut self, path: &str, text: &[u8]) -> Result<(), ReadError> {
        let Some(dialect) = dialect(path) else { return Ok(()) };
        self.is_present = true;
        let mut object = 0;
        parse_events(path, text, |event| {
            let (Event::Start(e) | Event::Empty(e)) = event else { return Ok(()) };
            match (e.local_name().as_ref(), dialect) {
                (b"object", _) => object = required_number(e, b"id")?,
                (b"part", Dialect::Bambu) => {
                    let part = required_number(e, b"id")?;
                    let kind = attribute(e, b"subtype")?;
                    let role = ROLES.iter().find(|(_, bambu, _)| kind.as_deref() == Some(bambu));
                    let parts = self.parts.entry(object).or_default();
                    parts.firsts.entry(part).or_insert(parts.all.len());
                    parts.all.push((part, role.map(|(.., ours)| *ours)));
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

    /// Returns the volumes of an object, which are at least two, or one that is not solid.
    fn parted(&self, object: u32) -> Option<&[Volume]> {
        let all = self.volumes.get(&object)?;
        (all.len() > 1 || all.iter().any(|volume| volume.role.is_some())).then_some(all)
    }

    /// Returns the volumes of an object of this many triangles.
    pub(super) fn volumes_of(&self, object: u32, triangles: usize) -> ObjectVolumes<'_> {
        let Some(all) = self.parted(object) else { return ObjectVolumes::One };
        let mut sorted = all.to_vec();
        sorted.sort_unstable_by_key(|volume| volume.first);
        let mut next = 0;
        let fits = sorted.iter().all(|v| {
            let fits = v.first as usize == next && v.last >= v.first;
            next = v.last as usize + 1;
            fits
        });
        if fits && next == triangles { ObjectVolumes::Several(all) } else { ObjectVolumes::Unfit }
    }

    /// Returns true if the settings name parts of an object.
    pub(super) fn names_parts_of(&self, object: u32) -> bool {
        self.parts.contains_key(&object)
    }

    /// Returns which part of an object is meant by a place in the list of all and a number, and what it is if not solid;
    /// `None` if the settings do not name it. Parts with the same number are told apart by their order. (Source: the file
    /// of the importer of BambuStudio in [`marks`](super::marks), `_generate_volumes_new`.)
    pub(super) fn part(&self, object: u32, at: usize, id: u32) -> Option<(usize, Option<&'static str>)> {
        let parts = self.parts.get(&object)?;
        let is_it = parts.all.get(at).is_some_and(|part| part.0 == id);
        let at = if is_it { at } else { *parts.firsts.get(&id)? };
        Some((at, parts.all[at].1))
    }
}

/// The volumes of an object.
pub(super) enum ObjectVolumes<'s> {
    /// It is one solid.
    One,
    /// They cover its triangles, in any order.
    Several(&'s [Volume]),
    /// They overlap, leave triangles out or name others.
    Unfit,
}

/// Returns a file of settings for objects as they are written: with their numbers, ranges and numbers of triangles, and
/// without those that are gone. Another file is returned as it is. `part_numbers`: see [`KeptContents::part_numbers`].
pub(super) fn updated(
    path: &str,
    text: &[u8],
    objects: &WrittenObjects,
    part_numbers: &BTreeMap<(u32, usize), u32>,
) -> io::Result<Vec<u8>> {
    let Some(dialect) = dialect(path) else { return Ok(text.to_vec()) };
    let mut before = Settings::default();
    before.add(path, text).map_err(io::Error::other)?;
    let mut out = Writer::new(Vec::with_capacity(text.len()));
    let mut reader = quick_xml::Reader::from_reader(text);
    let parts = HashMap::new();
    let mut state =
        Updating { dialect, objects, part_numbers, before, object: 0, at: 0, next: 0, parts, faces: None };
    // Number of open elements of one that is left out.
    let mut skipped = 0usize;
    // The events of an instance, which names its object within.
    let mut instance: Option<(Vec<Event<'_>>, bool)> = None;
    loop {
        let event = reader.read_event().map_err(io::Error::other)?;
        if matches!(event, Event::Eof) {
            return Ok(out.into_inner());
        }
        if skipped > 0 {
            match event {
                Event::Start(_) => skipped += 1,
                Event::End(_) => skipped -= 1,
                _ => {}
            }
            continue;
        }
        let mut event = event;
        if let Event::Start(e) | Event::Empty(e) = &event {
            let is_empty = matches!(event, Event::Empty(_));
            match state.element(e) {
                ElementChange::None => {}
                ElementChange::Gone => {
                    skipped = usize::from(!is_empty);
                    continue;
                }
                ElementChange::GoneInstance => {
                    instance.iter_mut().for_each(|(_, is_gone)| *is_gone = true);
                }
                ElementChange::To(element) => {
                    event = if is_empty { Event::Empty(element) } else { Event::Start(element) };
                }
            }
        }
        let name = |e: &[u8]| e == b"model_instance";
        let begins = matches!(&event, Event::Start(e) if name(e.local_name().as_ref()));
        let ends = matches!(&event, Event::End(e) if name(e.local_name().as_ref()));
        if begins {
            instance = Some((Vec::new(), false));
        }
        let Some((events, is_gone)) = &mut instance else {
            out.write_event(event)?;
            continue;
        };
        events.push(event);
        if ends {
            for event in events.drain(..).filter(|_| !*is_gone) {
                out.write_event(event)?;
            }
            instance = None;
        }
    }
}

/// The change of an element.
enum ElementChange {
    None,
    Gone,
    /// The instance around it is of an object that is gone.
    GoneInstance,
    To(BytesStart<'static>),
}

/// The place in a file of settings that is updated.
struct Updating<'o> {
    dialect: Dialect,
    objects: &'o WrittenObjects,
    part_numbers: &'o BTreeMap<(u32, usize), u32>,
    before: Settings,
    object: u32,
    /// Number of the next volume, and of its first triangle.
    at: usize,
    next: usize,
    /// Number of parts so far, by objects.
    parts: HashMap<u32, usize>,
    /// Number of triangles of the part.
    faces: Option<usize>,
}

impl Updating<'_> {
    fn element(&mut self, e: &BytesStart<'_>) -> ElementChange {
        let id = |name: &[u8]| required_number(e, name).unwrap_or(u32::MAX);
        let gone = |is_gone: bool| if is_gone { ElementChange::Gone } else { ElementChange::None };
        let objects = self.objects;
        match (e.local_name().as_ref(), self.dialect) {
            (b"object", _) => {
                (self.object, self.at, self.next) = (id(b"id"), 0, 0);
                // Ranges that do not fit are left out with all that is said of the object: it is one solid.
                let is_unfit =
                    self.before.parted(self.object).is_some() && !objects.volumes.contains_key(&self.object);
                gone(is_unfit || !objects.has(self.object))
            }
            (b"part", Dialect::Bambu) => {
                let at = self.parts.entry(self.object).or_default();
                let own = id(b"id");
                let part = self.part_numbers.get(&(self.object, *at)).copied().unwrap_or(own);
                *at += 1;
                self.faces = objects.faces.get(&part).copied();
                match objects.has(part) {
                    true if part == own => ElementChange::None,
                    true => ElementChange::To(with_attributes(e, &[("id", part.to_string())])),
                    false => ElementChange::Gone,
                }
            }
            (b"assemble_item", Dialect::Bambu) => gone(!objects.has(id(b"object_id"))),
            (b"metadata", Dialect::Bambu) => {
                let text = |name: &[u8]| attribute(e, name).ok().flatten().unwrap_or_default();
                match &*text(b"key") {
                    "object_id" => match text(b"value").parse() {
                        Ok(object) if objects.has(object) => ElementChange::None,
                        _ => ElementChange::GoneInstance,
                    },
                    // Results of slicing are left out.
                    "gcode_file" | "pattern_bbox_file" => {
                        ElementChange::To(with_attributes(e, &[("value", String::new())]))
                    }
                    _ => ElementChange::None,
                }
            }
            (b"mesh_stat", Dialect::Bambu) => match self.faces {
                Some(count) => ElementChange::To(with_attributes(e, &[("face_count", count.to_string())])),
                None => ElementChange::None,
            },
            (b"volume", Dialect::Prusa) => {
                let count = match objects.volumes.get(&self.object) {
                    Some(all) => all.get(self.at).copied().unwrap_or(0),
                    None => objects.faces.get(&self.object).copied().unwrap_or(0),
                };
                let first = self.next;
                (self.at, self.next) = (self.at + 1, first + count);
                if count == 0 {
                    return ElementChange::Gone;
                }
                let (first, last) = (first.to_string(), (self.next - 1).to_string());
                ElementChange::To(with_attributes(e, &[("firstid", first), ("lastid", last)]))
            }
            _ => ElementChange::None,
        }
    }
}

/// Returns an element with other values of some of its attributes.
fn with_attributes(e: &BytesStart<'_>, values: &[(&str, String)]) -> BytesStart<'static> {
    let mut new = BytesStart::new(String::from_utf8_lossy(e.name().as_ref()).into_owned());
    for attribute in e.attributes().with_checks(false).flatten() {
        let other = values.iter().find(|(name, _)| name.as_bytes() == attribute.key.as_ref());
        match other {
            Some((name, value)) => new.push_attribute((*name, value.as_str())),
            // The writer does not escape what is escaped already, and quotes with `"`.
            None => {
                let value = String::from_utf8_lossy(&attribute.value).replace('"', "&quot;");
                new.push_attribute((attribute.key.as_ref(), value.as_bytes()));
            }
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
        let ObjectVolumes::Several(volumes) = settings.volumes_of(1, 31) else { panic!("three") };
        assert_eq!(volumes.iter().map(|v| v.role).collect::<Vec<_>>(), [None, Some("negative part"), None]);
        assert!(matches!(settings.volumes_of(1, 30), ObjectVolumes::Unfit));
        assert!(matches!(settings.volumes_of(2, 10), ObjectVolumes::One));
        let objects = WrittenObjects { volumes: [(1, vec![4, 6, 0])].into(), ..WrittenObjects::default() };
        let expected = r#"<?xml version="1.0"?>
<config><object id="1" a="&amp;"><metadata type="object" key="name" value="x"/><volume firstid="0" lastid="3"/>
<volume firstid="4" lastid="9"><metadata key="volume_type" value="NegativeVolume"/><mesh edges_fixed="0"/></volume>
</object></config>"#;
        let new = updated(PRUSA, text, &objects, &BTreeMap::new()).unwrap();
        assert_eq!(String::from_utf8(new).unwrap(), expected);
        // Damaged settings are not written unchanged: they would be of other objects.
        assert!(updated(PRUSA, &text[..200], &objects, &BTreeMap::new()).is_err());
    }
}
