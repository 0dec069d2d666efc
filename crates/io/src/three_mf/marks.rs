//! Marks of triangles: what a slicer painted on them, and the sets that they are in.
//!
//! In a scene they are `extras` of primitives, so triangles with equal marks are a region. A slicer may paint a part of a
//! triangle. The region of such a triangle is the paint of its largest part; the exact texts are kept beside the scene, for
//! meshes that do not change.
//!
//! Sources of the attributes: PrusaSlicer, `src/libslic3r/Format/3mf.cpp`, and BambuStudio and OrcaSlicer,
//! `src/libslic3r/Format/bbs_3mf.cpp`; of their texts: `TriangleSelector::serialize` and
//! `FacetsAnnotation::get_triangle_as_string` there. Of sets: 3MF Consortium, "Triangle Sets Extension" 1.0.

use std::collections::{BTreeMap, HashMap};
use std::io;

use serde_json::{Map, Value, json};

use super::resources::{Object, Part, TriangleSet};
use super::xml::escaped;
use crate::numbers::TextOut;

/// Attributes of triangles for paint, and the prefixes that they are written with.
pub(super) const PAINTS: [(&str, &str); 10] = [
    ("custom_supports", PRUSA_PREFIX),
    ("custom_seam", PRUSA_PREFIX),
    ("mmu_segmentation", PRUSA_PREFIX),
    ("fuzzy_skin", PRUSA_PREFIX),
    ("texture_skin", PRUSA_PREFIX),
    ("paint_supports", ""),
    ("paint_seam", ""),
    ("paint_color", ""),
    ("paint_fuzzy_skin", ""),
    ("face_property", ""),
];
/// The last of [`PAINTS`] is a word, the others are trees of painted parts.
const FIRST_WORD: u8 = 9;
pub(super) const PRUSA_PREFIX: &str = "slic3rpe:";
/// The namespace of [`PRUSA_PREFIX`].
pub(super) const PRUSA_NAMESPACE: &str = "http://schemas.slic3r.org/3mf/2017/06";

pub(super) const SETS_PREFIX: &str = "t:";
/// The namespace of [`SETS_PREFIX`].
pub(super) const SETS_NAMESPACE: &str = "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07";

/// Limit on combinations of sets. Guessed: more regions than this leave nothing to reduce.
const MAX_COMBINATIONS: usize = 1 << 10;
/// Limit on memberships in sets for each triangle, in the mean. Guessed: more than programs write.
pub(super) const MAX_MEMBERSHIPS: usize = 16;

/// Paint of a triangle of which a part is painted: its number, an index into [`PAINTS`], and the text.
pub(super) type ExactPaint = (u32, u8, Box<str>);

/// Kinds and texts of paint, and the number of a combination of sets.
type MarkKey = (Vec<(u8, String)>, Option<u32>);

/// The marks of the triangles of an object.
#[derive(Default)]
pub(super) struct Marks {
    /// The mark of each triangle, as an index; empty if no triangle has any.
    pub(super) of_triangle: Vec<u32>,
    /// Marks as extras; null for none.
    pub(super) all: Vec<Value>,
    pub(super) exact: Vec<ExactPaint>,
    /// True if the sets are too many, or name triangles that are not there.
    pub(super) lost_sets: bool,
}

impl Marks {
    pub(super) fn new(object: &Object, part: &Part) -> Self {
        let count = object.triangles.len();
        let mut new = Self::default();
        let sets = Sets::new(object, count);
        new.lost_sets = sets.is_lost;
        if object.paint.is_empty() && sets.combinations.is_empty() {
            return new;
        }
        let mut known: HashMap<MarkKey, u32> = HashMap::new();
        let mut paint = object.paint.iter().peekable();
        for triangle in 0..count {
            let mut painted = Vec::new();
            while let Some(own) = paint.next_if(|p| p.triangle as usize == triangle) {
                let text = &part.paint[own.text as usize];
                let main = if own.kind < FIRST_WORD { main_state(text) } else { None };
                match main {
                    Some(0) => {}
                    Some(state) => painted.push((own.kind, text_of_state(state))),
                    None => painted.push((own.kind, text.to_string())),
                }
                if main.is_some_and(|state| **text != text_of_state(state)) {
                    new.exact.push((triangle as u32, own.kind, text.clone()));
                }
            }
            painted.sort_unstable();
            let combination = sets.of_triangle.get(triangle).copied().flatten();
            let mark = *known.entry((painted, combination)).or_insert_with_key(|(painted, combination)| {
                let sets = combination.map_or(&[][..], |c| &sets.combinations[c as usize]);
                new.all.push(mark_of(painted, sets.iter().map(|&set| &object.sets[set as usize])));
                new.all.len() as u32 - 1
            });
            new.of_triangle.push(mark);
        }
        new
    }

    /// Returns the mark of a triangle.
    pub(super) fn of(&self, triangle: usize) -> u32 {
        self.of_triangle.get(triangle).copied().unwrap_or(0)
    }

    /// Returns the extras of a mark; null for none.
    pub(super) fn extras(&self, mark: u32) -> Value {
        self.all.get(mark as usize).cloned().unwrap_or_default()
    }
}

/// The combination of sets that each triangle is in.
#[derive(Default)]
struct Sets {
    /// Empty if there are no sets.
    of_triangle: Vec<Option<u32>>,
    /// Ascending numbers of sets.
    combinations: Vec<Vec<u32>>,
    is_lost: bool,
}

impl Sets {
    fn new(object: &Object, count: usize) -> Self {
        let mut new = Self::default();
        let mut left = count.saturating_mul(MAX_MEMBERSHIPS);
        let mut of_triangle: Vec<Vec<u32>> = vec![Vec::new(); if object.sets.is_empty() { 0 } else { count }];
        for (set, number) in object.sets.iter().zip(0..) {
            for &[first, last] in &set.ranges {
                let Some(range) = of_triangle.get_mut(first as usize..=last as usize) else {
                    new.is_lost = true;
                    continue;
                };
                let Some(less) = left.checked_sub(range.len()) else {
                    return Self { is_lost: true, ..Self::default() };
                };
                left = less;
                // A triangle may be named twice.
                range.iter_mut().filter(|own| own.last() != Some(&number)).for_each(|own| own.push(number));
            }
        }
        let mut known = HashMap::new();
        for own in of_triangle {
            let combination = (!own.is_empty()).then(|| {
                *known.entry(own).or_insert_with_key(|own| {
                    new.combinations.push(own.clone());
                    new.combinations.len() as u32 - 1
                })
            });
            new.of_triangle.push(combination);
        }
        if new.combinations.len() > MAX_COMBINATIONS {
            return Self { is_lost: true, ..Self::default() };
        }
        new
    }
}

/// Writes the paint of triangles.
pub(super) struct RegionMarks<'a> {
    /// Paint of each region: entries of [`PAINTS`] and texts.
    of_regions: Vec<Vec<(u8, &'a str)>>,
    exact: std::iter::Peekable<std::slice::Iter<'a, ExactPaint>>,
}

impl<'a> RegionMarks<'a> {
    /// Takes the marks of regions, and the paint of triangles of which a part is painted.
    pub(super) fn new(marks: &'a [Value], exact: &'a [ExactPaint]) -> Self {
        let text = |mark: &'a Value, (name, _): &(&str, &str)| mark["paint"][name].as_str();
        let of_region = |mark: &'a Value| {
            let all = PAINTS.iter().zip(0..).filter_map(|(paint, kind)| Some((kind, text(mark, paint)?)));
            all.filter(|(_, text)| text.bytes().all(|b| b.is_ascii_alphanumeric())).collect()
        };
        Self { of_regions: marks.iter().map(of_region).collect(), exact: exact.iter().peekable() }
    }

    /// Writes the attributes of a triangle; triangles come in ascending order.
    pub(super) fn write(&mut self, triangle: usize, region: usize, out: &mut TextOut<'_>) {
        let mut painted: BTreeMap<u8, &str> = BTreeMap::new();
        painted.extend(self.of_regions.get(region).into_iter().flatten().copied());
        // Triangles before may have been left out.
        while let Some((at, kind, text)) = self.exact.next_if(|p| p.0 as usize <= triangle) {
            if *at as usize == triangle {
                painted.insert(*kind, text);
            }
        }
        for (kind, text) in painted {
            let (name, prefix) = PAINTS[usize::from(kind)];
            for text in [" ", prefix, name, "=\"", text, "\""] {
                out.text(text);
            }
        }
    }
}

/// Sets of triangles as they are written, in the order of the regions that first have them: name and identifier, and ranges.
#[derive(Default)]
pub(super) struct WrittenSets {
    all: Vec<([String; 2], Vec<[u32; 2]>)>,
    /// For each region of the current mesh, indices into `all`.
    of_regions: Vec<Vec<usize>>,
}

impl WrittenSets {
    /// Begins with another mesh whose regions have these marks.
    pub(super) fn begin(&mut self, marks: &[Value]) {
        let mut known: HashMap<[String; 2], usize> =
            self.all.iter().zip(0..).map(|((key, _), at)| (key.clone(), at)).collect();
        self.of_regions.clear();
        for mark in marks {
            let mut own = Vec::new();
            for set in mark["sets"].as_array().into_iter().flatten() {
                let key = ["name", "identifier"].map(|key| set[key].as_str().unwrap_or_default().to_owned());
                own.push(*known.entry(key).or_insert_with_key(|key| {
                    self.all.push((key.clone(), Vec::new()));
                    self.all.len() - 1
                }));
            }
            self.of_regions.push(own);
        }
    }

    /// Adds a triangle to the sets of its region; triangles come in ascending order.
    pub(super) fn add(&mut self, region: usize, triangle: u32) {
        for &set in self.of_regions.get(region).into_iter().flatten() {
            let ranges = &mut self.all[set].1;
            match ranges.last_mut() {
                Some([_, last]) if *last + 1 == triangle => *last = triangle,
                Some([_, last]) if *last == triangle => {}
                _ => ranges.push([triangle; 2]),
            }
        }
    }

    pub(super) fn write(&self, out: &mut TextOut<'_>) -> io::Result<()> {
        if self.all.iter().all(|(_, ranges)| ranges.is_empty()) {
            return Ok(());
        }
        out.text("    <t:trianglesets>\n");
        for ([name, identifier], ranges) in self.all.iter().filter(|(_, ranges)| !ranges.is_empty()) {
            let [name, identifier] = [name, identifier].map(|text| escaped(text));
            out.text(&format!("     <t:triangleset name=\"{name}\" identifier=\"{identifier}\">\n"));
            for [first, last] in ranges {
                // (lib3mf 2.5 does not read ranges.)
                for triangle in *first..=*last {
                    out.text("      <t:ref index=\"");
                    out.parse_integer(triangle);
                    out.text("\"/>");
                    out.end_line()?;
                }
            }
            out.text("     </t:triangleset>\n");
        }
        out.text("    </t:trianglesets>\n");
        Ok(())
    }
}

/// Returns a mark as extras of a primitive; null if there is nothing.
fn mark_of<'s>(painted: &[(u8, String)], sets: impl Iterator<Item = &'s TriangleSet>) -> Value {
    let mut mark = Map::new();
    if !painted.is_empty() {
        let name = |kind: u8| PAINTS[usize::from(kind)].0.to_owned();
        let paint: Map<String, Value> =
            painted.iter().map(|(k, text)| (name(*k), text.as_str().into())).collect();
        mark.insert("paint".to_owned(), paint.into());
    }
    let sets: Vec<Value> =
        sets.map(|set| json!({ "name": set.name, "identifier": set.identifier })).collect();
    if !sets.is_empty() {
        mark.insert("sets".to_owned(), sets.into());
    }
    if mark.is_empty() { Value::Null } else { mark.into() }
}

/// Returns the state that the largest part of a triangle is painted with, 0 for none; `None` for a text of another form.
///
/// The text is a tree, from its end: a digit whose two low bits are 0 is a part with a state in its two high bits, or, if
/// these are 3, in the next digit and 3 more. Other values of the low bits count the sides that are split, which makes one
/// part more. (Parts of one split count alike here.)
fn main_state(text: &str) -> Option<u32> {
    let mut digits = text.chars().rev().map(|c| c.to_digit(16));
    let mut open = vec![1.0];
    let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
    while let Some(share) = open.pop() {
        let digit = digits.next()??;
        let splits = digit & 3;
        if splits > 0 {
            open.extend((0..=splits).map(|_| share / f64::from(splits + 1)));
            continue;
        }
        let state = match digit >> 2 {
            // The last digit announces another one in newer files.
            3 => 3 + digits.next()?.filter(|more| *more < 15)?,
            state => state,
        };
        *shares.entry(state).or_default() += share;
    }
    if digits.next().is_some() {
        return None;
    }
    let largest = shares.into_iter().reduce(|best, other| if other.1 > best.1 { other } else { best });
    largest.map(|(state, _)| state)
}

/// Returns the text of a triangle that is painted as a whole.
fn text_of_state(state: u32) -> String {
    if state < 3 { format!("{:X}", state << 2) } else { format!("{:X}C", state - 3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_part_counts() {
        for (text, state) in [("4", 1), ("8", 2), ("0C", 3), ("1C", 4), ("0", 0)] {
            assert_eq!(main_state(text), Some(state), "{text}");
            assert_eq!(text_of_state(state), text);
        }
        // Four parts, of which three have state 1, and two halves of states 0 and 2.
        assert_eq!(main_state("48443"), Some(1));
        assert_eq!(main_state("801"), Some(0));
        assert_eq!(main_state("8811"), None);
        for bad in ["", "x", "44", "3", "FC", "C"] {
            assert_eq!(main_state(bad), None, "{bad}");
        }
    }

    #[test]
    fn sets_without_end_are_refused() {
        let set = || TriangleSet { name: String::new(), identifier: String::new(), ranges: vec![[0, 99]] };
        let object = Object { sets: (0..17).map(|_| set()).collect(), ..Object::default() };
        assert!(Sets::new(&object, 100).is_lost);
        let object = Object { sets: vec![set()], ..Object::default() };
        assert!(Sets::new(&object, 99).is_lost);
        let sets = Sets::new(&object, 100);
        assert_eq!((sets.is_lost, sets.combinations), (false, vec![vec![0]]));
    }
}
