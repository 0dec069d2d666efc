//! Regions of an OBJ: the object, the groups, the material and the smoothing group of the faces.
//!
//! A line `o`, `g`, `usemtl` or `s` applies to the faces below it until the next of its kind. Each section of
//! a file records the positions of such lines ([`Headings`]); the regions of faces are resolved when all
//! sections are joined.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use lodsmith_core::{IntegerType, RegionId, TriMesh};

use crate::frame::Frame;

use super::library::{Library, lines_of, material_in, texture_in, unquoted, with_slashes};

/// No name: there is no such line above.
pub(crate) const NONE: u32 = u32::MAX;

/// The lines that apply to the faces below them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heading {
    Object,
    Groups,
    Material,
    Smoothing,
}

impl Heading {
    pub(crate) const ALL: [Self; 4] = [Self::Object, Self::Groups, Self::Material, Self::Smoothing];

    /// The first word of the line.
    pub(crate) const fn keyword(self) -> &'static str {
        ["o", "g", "usemtl", "s"][self as usize]
    }
    /// Its plural name for users.
    pub(crate) const fn title(self) -> &'static str {
        ["objects", "groups", "materials", "smoothing groups"][self as usize]
    }
}

/// The object, groups, material and smoothing group that all faces of a region share. Names are as in the
/// file, in its encoding; `None` if there is no such line above the faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Region<'a> {
    /// The object (`o`).
    pub object: Option<&'a [u8]>,
    /// The groups (`g`), several with blanks between them.
    pub groups: Option<&'a [u8]>,
    /// The material (`usemtl`).
    pub material: Option<&'a [u8]>,
    /// The smoothing group (`s`): a number, or `off`.
    pub smoothing: Option<&'a [u8]>,
}

/// A property of faces that a PLY has, by their regions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FaceProperty {
    pub(crate) name: String,
    /// Its type; `None` for a float.
    pub(crate) of: Option<IntegerType>,
    /// The bits of the value of each region.
    pub(crate) value_bits: Vec<u64>,
}

impl FaceProperty {
    /// Returns the value of a region.
    pub(crate) fn value(&self, region: usize) -> f64 {
        self.value_bits.get(region).map_or(0.0, |&bits| f64::from_bits(bits))
    }
}

impl<'a> Region<'a> {
    /// Creates a region with groups and a material.
    pub(crate) fn new(groups: Option<&'a str>, material: Option<&'a str>) -> Self {
        Self { groups: groups.map(str::as_bytes), material: material.map(str::as_bytes), ..Self::default() }
    }
    pub(crate) fn name(&self, heading: Heading) -> Option<&'a [u8]> {
        match heading {
            Heading::Object => self.object,
            Heading::Groups => self.groups,
            Heading::Material => self.material,
            Heading::Smoothing => self.smoothing,
        }
    }
}

/// The regions of a mesh, by their ids, and the libraries that describe their materials.
///
/// A region is a distinct combination of object, groups, material and smoothing group; ids follow the order
/// of the faces. In a glTF file only materials make regions, and the region without a material comes first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Regions {
    pub(crate) names: Vec<Arc<[u8]>>,
    /// The index of a name, or [`NONE`], for each [`Heading`].
    pub(crate) entries: Vec<[u32; 4]>,
    /// The names of all materials that the file uses, by their indices.
    pub(crate) materials: Vec<u32>,
    pub(crate) libraries: Vec<Library>,
    /// The coordinates of the mesh, for formats that define them.
    pub(crate) frame: Option<Frame>,
    /// Properties of faces of a PLY, from which names were made: labels are groups, colours are materials.
    pub(crate) face_properties: Vec<FaceProperty>,
    /// True if materials are pictures of a PLY, not colours.
    pub(crate) has_pictures: bool,
}

impl Regions {
    /// Creates one region for each of these materials, in their order; `None` for faces without one.
    pub(crate) fn of_materials(names: &[Option<String>], library: Library) -> Self {
        let mut all = NameTable::default();
        let number = |name: &Option<String>| name.as_ref().map_or(NONE, |n| all.number_of(n.as_bytes()));
        let entries: Vec<_> = names.iter().map(number).map(|n| [NONE, NONE, n, NONE]).collect();
        let materials = (0..all.texts.len() as u32).collect();
        Self { names: all.texts, entries, materials, libraries: vec![library], ..Self::default() }
    }

    /// Creates regions with these names and without libraries, so that their materials are unknown.
    pub fn named(regions: &[Region<'_>]) -> Self {
        let mut all = NameTable::default();
        let mut materials = Vec::new();
        let mut entries = Vec::with_capacity(regions.len());
        let mut seen = HashSet::new();
        for region in regions {
            let entry = Heading::ALL.map(|h| region.name(h).map_or(NONE, |n| all.number_of(n)));
            let material = entry[Heading::Material as usize];
            if material != NONE && seen.insert(material) {
                materials.push(material);
            }
            entries.push(entry);
        }
        Self { names: all.texts, entries, materials, ..Self::default() }
    }

    /// Returns the same regions of a mesh in these coordinates, which formats that have a unit and axes store; without
    /// them, its numbers are written as they are.
    #[must_use]
    pub fn with_frame(mut self, frame: Frame) -> Self {
        self.frame = Some(frame);
        self
    }
    /// The coordinates of the mesh; `None` if its format does not define them.
    pub fn frame(&self) -> Option<Frame> {
        self.frame
    }

    /// Number of regions; 0 if the file has no such lines.
    pub fn len(&self) -> usize {
        self.entries.len()
    }
    /// Returns true if there are no regions.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
    /// Returns a region.
    pub fn get(&self, id: RegionId) -> Option<Region<'_>> {
        self.entries.get(id.index()).map(|&entry| self.region(entry))
    }
    /// Iterates over all regions, in the order of their ids.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Region<'_>> {
        self.entries.iter().map(|&entry| self.region(entry))
    }
    /// For each region, the first region with the same object, groups and material: regions that differ only
    /// in the smoothing group meet at a crease, not at a border.
    pub fn classes(&self) -> Vec<RegionId> {
        let mut first: BTreeMap<[u32; 4], RegionId> = BTreeMap::new();
        let class = |(i, mut entry): (usize, [u32; 4])| {
            entry[Heading::Smoothing as usize] = NONE;
            *first.entry(entry).or_insert_with(|| RegionId::new(i))
        };
        self.entries.iter().copied().enumerate().map(class).collect()
    }
    /// Names of all materials that the file selects, even for no faces, in the order of their appearance.
    pub fn materials(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        self.materials.iter().map(|&name| &*self.names[name as usize])
    }
    /// The libraries that describe the materials (`mtllib`), in their order.
    pub fn libraries(&self) -> &[Library] {
        &self.libraries
    }

    /// Returns true if the file has materials or libraries.
    pub(crate) fn has_materials(&self) -> bool {
        !self.materials.is_empty() || !self.libraries.is_empty()
    }

    /// The headings in which regions differ.
    pub(crate) fn differing(&self) -> impl Iterator<Item = Heading> {
        let differs = |&h: &Heading| self.entries.windows(2).any(|w| w[0][h as usize] != w[1][h as usize]);
        Heading::ALL.into_iter().filter(differs)
    }

    /// The names on which all regions agree, which a mesh without regions can keep.
    pub(crate) fn common_names(&self) -> Region<'_> {
        let mut entry = self.entries.first().copied().unwrap_or([NONE; 4]);
        self.differing().for_each(|heading| entry[heading as usize] = NONE);
        self.region(entry)
    }

    /// Lists for users what is lost in a format without regions; `None` if nothing is. A single group is no
    /// loss, a single material is.
    pub(crate) fn lost_headings(&self, with_materials: bool) -> Option<String> {
        let is_lost = |heading: &Heading| match heading {
            Heading::Material => with_materials && self.has_materials(),
            other => self.differing().any(|h| h == *other),
        };
        join_titles(Heading::ALL.into_iter().filter(is_lost))
    }

    /// Returns the properties of faces, unless the mesh has lost the regions of its faces.
    pub(crate) fn properties_of_faces(&self, mesh: &TriMesh) -> &[FaceProperty] {
        if mesh.regions().is_none() && self.len() > 1 { &[] } else { &self.face_properties }
    }

    /// Lists for users what is lost in PLY, which carries the properties of faces that it had.
    pub(crate) fn lost_in_ply(&self, mesh: &TriMesh, with_materials: bool) -> Option<String> {
        if self.properties_of_faces(mesh).is_empty() {
            return self.lost_headings(with_materials);
        }
        let lost = with_materials && self.has_pictures;
        lost.then(|| Heading::Material.title().to_owned())
    }

    fn region(&self, entry: [u32; 4]) -> Region<'_> {
        let name = |heading: Heading| self.names.get(entry[heading as usize] as usize).map(|n| &**n);
        Region {
            object: name(Heading::Object),
            groups: name(Heading::Groups),
            material: name(Heading::Material),
            smoothing: name(Heading::Smoothing),
        }
    }
}

/// Joins titles with commas; `None` if there are none.
pub(crate) fn join_titles(headings: impl Iterator<Item = Heading>) -> Option<String> {
    let titles: Vec<_> = headings.map(Heading::title).collect();
    (!titles.is_empty()).then(|| titles.join(", "))
}

/// The headings of a section of a file.
#[derive(Debug, Default)]
pub(crate) struct Headings {
    names: NameTable,
    changes: Vec<Change>,
    materials: Materials,
    libraries: Vec<Arc<[u8]>>,
}

/// Lines between the same two faces; the last of a kind counts.
#[derive(Debug)]
struct Change {
    at: FacePosition,
    /// The index of a name for each [`Heading`], [`NONE`] if there is no such line.
    names: [u32; 4],
}

/// A position between faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FacePosition {
    /// Number of triangles before it.
    pub(crate) triangles: usize,
    /// Number of faces with more corners before it.
    pub(crate) polygons: usize,
}

/// Names of materials, without duplicates, in the order of their appearance.
#[derive(Debug, Default)]
struct Materials {
    all: Vec<u32>,
    seen: HashSet<u32>,
}

impl Materials {
    fn add(&mut self, name: u32) {
        if self.seen.insert(name) {
            self.all.push(name);
        }
    }
}

impl Headings {
    /// Records a line of this kind.
    pub(crate) fn add_heading(&mut self, heading: Heading, name: &[u8], at: FacePosition) {
        let name = self.names.number_of(without_continuation(name));
        if heading == Heading::Material {
            self.materials.add(name);
        }
        self.change_at(at)[heading as usize] = name;
    }

    /// Records a line that names material libraries.
    pub(crate) fn add_libraries(&mut self, names: &[u8]) {
        for name in library_names(without_continuation(names)) {
            // A file that names more libraries than this is not a real model. Guessed.
            if self.libraries.len() < 256 && !self.libraries.iter().any(|l| **l == *name) {
                self.libraries.push(name.into());
            }
        }
    }

    /// Appends the headings of the following section; `before` counts the faces before it.
    pub(crate) fn append(&mut self, next: Self, before: FacePosition) {
        let numbers: Vec<u32> = next.names.texts.iter().map(|text| self.names.number_of(text)).collect();
        for change in next.changes {
            let at = FacePosition {
                triangles: before.triangles + change.at.triangles,
                polygons: before.polygons + change.at.polygons,
            };
            let names = self.change_at(at);
            for (name, next) in names.iter_mut().zip(change.names) {
                *name = numbers.get(next as usize).copied().unwrap_or(*name);
            }
        }
        next.materials.all.iter().for_each(|&name| self.materials.add(numbers[name as usize]));
        for library in next.libraries {
            if self.libraries.len() < 256 && !self.libraries.contains(&library) {
                self.libraries.push(library);
            }
        }
    }

    fn change_at(&mut self, at: FacePosition) -> &mut [u32; 4] {
        if self.changes.last().is_none_or(|last| last.at != at) {
            self.changes.push(Change { at, names: [NONE; 4] });
        }
        let last = self.changes.len() - 1;
        &mut self.changes[last].names
    }

    /// Returns the regions, and the region of each face if there is more than one.
    ///
    /// `polygon_sizes` are the corner counts of the larger faces in their order, each cut into two triangles
    /// fewer.
    /// Cost: O(faces + lines).
    pub(crate) fn resolve(
        self,
        polygon_sizes: impl IntoIterator<Item = usize>,
        face_count: usize,
    ) -> (Regions, Option<Vec<RegionId>>) {
        let mut regions = Regions {
            names: self.names.texts,
            entries: Vec::new(),
            materials: self.materials.all,
            libraries: self.libraries.into_iter().map(Library::named).collect(),
            ..Regions::default()
        };
        if self.changes.is_empty() {
            return (regions, None);
        }
        let mut numbers: HashMap<[u32; 4], u32> = HashMap::new();
        let mut ids = Vec::new();
        let mut sizes = polygon_sizes.into_iter();
        let (mut begin, mut polygons, mut from_polygons) = (0, 0, 0);
        let mut present = [NONE; 4];
        let ends = self.changes.iter().map(Some).chain([None]);
        for change in ends {
            let end = change.map_or(face_count, |change| {
                let more = change.at.polygons - polygons;
                from_polygons += sizes.by_ref().take(more).map(|size| size - 2).sum::<usize>();
                polygons = change.at.polygons;
                change.at.triangles + from_polygons
            });
            if end > begin {
                let entries = &mut regions.entries;
                let id = *numbers.entry(present).or_insert_with(|| {
                    entries.push(present);
                    entries.len() as u32 - 1
                });
                // A single region needs no ids.
                if regions.entries.len() > 1 {
                    ids.resize(begin, RegionId(0));
                    ids.resize(end, RegionId(id));
                }
                begin = end;
            }
            for (name, new) in present.iter_mut().zip(change.map_or([NONE; 4], |c| c.names)) {
                *name = if new == NONE { *name } else { new };
            }
        }
        if regions.entries == [[NONE; 4]] {
            regions.entries.clear();
        }
        let is_one = regions.entries.len() < 2;
        (regions, (!is_one).then_some(ids))
    }
}

/// Interned names: equal texts have the same index.
#[derive(Debug, Default)]
struct NameTable {
    texts: Vec<Arc<[u8]>>,
    numbers: HashMap<Arc<[u8]>, u32>,
}

impl NameTable {
    fn number_of(&mut self, text: &[u8]) -> u32 {
        if let Some(&number) = self.numbers.get(text) {
            return number;
        }
        let (text, number): (Arc<[u8]>, _) = (text.into(), self.texts.len() as u32);
        self.texts.push(text.clone());
        self.numbers.insert(text, number);
        number
    }
}

/// Removes trailing backslashes, which would continue the line when it is written.
fn without_continuation(mut name: &[u8]) -> &[u8] {
    name = name.trim_ascii();
    while let Some(shorter) = name.strip_suffix(b"\\") {
        name = shorter.trim_ascii_end();
    }
    name
}

/// Splits the names of a line `mtllib`. Blanks separate names and, in many files, are part of one: a name
/// extends to `.mtl`.
fn library_names(line: &[u8]) -> Vec<&[u8]> {
    let mut names = Vec::new();
    let mut rest = line;
    while !rest.is_empty() {
        let is_end = |&i: &usize| {
            i >= 4
                && rest[i - 4..i].eq_ignore_ascii_case(b".mtl")
                && rest.get(i).is_none_or(u8::is_ascii_whitespace)
        };
        let end = memchr::memchr2_iter(b'l', b'L', rest).map(|i| i + 1).find(is_end).unwrap_or(rest.len());
        names.push(unquoted(rest[..end].trim_ascii()));
        rest = rest[end..].trim_ascii_start();
    }
    names
}

/// Returns true if the mesh has lost the information which of several materials its faces have.
pub(crate) fn drops_materials(mesh: &TriMesh, regions: &Regions) -> bool {
    mesh.regions().is_none() && regions.differing().any(|heading| heading == Heading::Material)
}

/// Returns the number of materials that the file or its libraries name, and of textures that the libraries
/// name.
pub(crate) fn counts(regions: &Regions) -> (usize, usize) {
    let mut materials: HashSet<&[u8]> = regions.materials().collect();
    let mut textures = HashSet::new();
    for text in regions.libraries.iter().filter_map(Library::text) {
        for line in lines_of(text) {
            if let Some(path) = texture_in(line) {
                textures.insert(with_slashes(&line[path]));
            } else if let Some(name) = material_in(line) {
                materials.insert(name);
            }
        }
    }
    (materials.len(), textures.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(triangles: usize, polygons: usize) -> FacePosition {
        FacePosition { triangles, polygons }
    }

    fn ids(regions: Option<Vec<RegionId>>) -> Vec<u32> {
        regions.unwrap().into_iter().map(|r| r.0).collect()
    }

    #[test]
    fn the_last_line_of_each_kind_applies_to_a_face() {
        let mut headings = Headings::default();
        headings.add_heading(Heading::Groups, b"a", at(1, 0));
        headings.add_heading(Heading::Material, b"wood", at(1, 0));
        // A face of five corners in between, then the earlier group again.
        headings.add_heading(Heading::Groups, b" b c ", at(1, 1));
        headings.add_heading(Heading::Groups, b"unused", at(2, 1));
        headings.add_heading(Heading::Groups, b"a", at(2, 1));
        let (regions, of_faces) = headings.resolve([5], 6);
        assert_eq!(ids(of_faces), [0, 1, 1, 1, 2, 1]);
        let names: Vec<_> = regions.iter().map(|r| (r.groups, r.material)).collect();
        let wood = Some(&b"wood"[..]);
        assert_eq!(names, [(None, None), (Some(&b"a"[..]), wood), (Some(&b"b c"[..]), wood)]);
        assert_eq!(join_titles(regions.differing()).unwrap(), "groups, materials");
        assert_eq!(regions.common_names(), Region::default());
    }

    #[test]
    fn one_region_needs_no_ids_and_keeps_its_names() {
        let mut headings = Headings::default();
        headings.add_heading(Heading::Object, b"chair", at(0, 0));
        headings.add_heading(Heading::Smoothing, b"off", at(9, 0));
        let (regions, of_faces) = headings.resolve([], 9);
        assert_eq!((regions.len(), of_faces), (1, None));
        assert_eq!(regions.common_names().object, Some(&b"chair"[..]));
        let mut late = Headings::default();
        late.add_heading(Heading::Object, b"none", at(9, 0));
        assert!(late.resolve([], 9).0.is_empty());
    }

    #[test]
    fn sections_continue_earlier_sections() {
        let mut first = Headings::default();
        first.add_heading(Heading::Material, b"x", at(0, 0));
        first.add_heading(Heading::Groups, b"a", at(2, 0));
        let mut second = Headings::default();
        second.add_heading(Heading::Material, b"y", at(0, 0));
        second.add_heading(Heading::Material, b"x", at(1, 0));
        first.append(second, at(2, 0));
        let (regions, of_faces) = first.resolve([], 4);
        assert_eq!(ids(of_faces), [0, 0, 1, 2]);
        assert_eq!(regions.materials().collect::<Vec<_>>(), [b"x", b"y"]);
        assert_eq!(regions.iter().nth(1).unwrap().groups, Some(&b"a"[..]));
    }

    #[test]
    fn a_group_for_each_face_is_fast() {
        let mut headings = Headings::default();
        let count = 200_000;
        let long = "x".repeat(10_000);
        headings.add_heading(Heading::Object, long.as_bytes(), at(0, 0));
        for face in 0..count {
            headings.add_heading(Heading::Groups, face.to_string().as_bytes(), at(face, 0));
        }
        let (regions, of_faces) = headings.resolve([], count);
        assert_eq!((regions.len(), of_faces.unwrap()[count - 1]), (count, RegionId(count as u32 - 1)));
    }

    #[test]
    fn names_of_libraries_may_hold_blanks() {
        let names = |line: &'static str| library_names(without_continuation(line.as_bytes()));
        assert_eq!(names("a.mtl b.MTL"), [&b"a.mtl"[..], b"b.MTL"]);
        assert_eq!(names("my chair.mtl"), [b"my chair.mtl"]);
        assert_eq!(names("\"my chair.mtl\""), [b"my chair.mtl"]);
        assert_eq!(names("chair \\"), [b"chair"]);
        assert_eq!(names("é.mtl.old x"), ["é.mtl.old x".as_bytes()]);
        assert!(names("  ").is_empty());
        assert_eq!(without_continuation(b" a \\ \\"), b"a");
    }
}
