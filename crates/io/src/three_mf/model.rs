//! Parser of a model part.
//!
//! The XML is read as a stream of events.

use quick_xml::events::{BytesStart, Event};

use super::marks::PAINTS;
use super::resources::{
    Group, ItemMark, Object, PaintOfTriangle, Part, PlacedObject, TextureFile, Transform, TriangleProperty,
    TriangleSet,
};
use crate::error::ReadError;
use crate::excerpt::{excerpt, excerpt_of_bytes};
use crate::frame::Unit;
use crate::numbers::{parse_decimal, parse_short_integer};
use crate::xml::{self, Problem};

/// glTF codes of texture wrapping.
const REPEAT: u32 = 10497;
const MIRROR: u32 = 33648;
const CLAMP: u32 = 33071;

/// Limit on names of sets of triangles, in bytes: each may be in many combinations. (Guessed: names are for people.)
const MAX_SET_NAME: usize = 1 << 10;

/// Types of objects other than `model`.
pub(super) const OTHER_TYPES: [&str; 4] = ["solidsupport", "support", "surface", "other"];

/// Attributes of items and of objects that are dropped, and what they are.
const DROPPED_OF_ITEMS: [(&str, &str); 1] = [PART_NUMBERS];
const DROPPED_OF_OBJECTS: [(&str, &str); 3] =
    [PART_NUMBERS, ("thumbnail", "thumbnails of objects"), ("auto_drop", "marks of objects (auto_drop)")];
const PART_NUMBERS: (&str, &str) = ("partnumber", "part numbers of objects and items");

/// Namespaces of extensions that a reader may be required to know, by the ends of their names, and which of their
/// contents are lost.
const EXTENSIONS: &[(&str, Option<&str>)] = &[
    ("material/2015/02", None),
    ("production/2015/06", None),
    ("trianglesets/2021/07", None),
    ("slice/2015/07", Some("slices")),
    ("beamlattice/2017/02", Some("beam lattices")),
    ("beamlattice/balls/2020/07", Some("beam lattices")),
];

/// Passes each event of a part to `take`.
pub(super) fn parse_events(
    part: &str,
    text: &[u8],
    mut take: impl FnMut(&Event<'_>) -> Result<(), Problem>,
) -> Result<(), ReadError> {
    xml::parse_events(text, |event, _| take(event))
        .map_err(|(line, problem)| ReadError::element(format!("{}, line {line}", excerpt(part)), problem))
}

/// Returns an attribute as text, by its name without a prefix.
pub(super) fn attribute(element: &BytesStart<'_>, name: &[u8]) -> Result<Option<String>, Problem> {
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| format!("an attribute is damaged: {e}"))?;
        if attribute.key.local_name().as_ref() == name {
            let raw = String::from_utf8_lossy(&attribute.value);
            let text =
                quick_xml::escape::unescape(&raw).map_err(|e| format!("an attribute is damaged: {e}"))?;
            return Ok(Some(text.into_owned()));
        }
    }
    Ok(None)
}

/// Parses a model part.
pub(super) fn parse(path: &str, text: &[u8]) -> Result<Part, ReadError> {
    let mut parser = ModelParser::default();
    parse_events(path, text, |event| match event {
        Event::Start(e) => parser.begin(e),
        Event::Empty(e) => {
            parser.begin(e)?;
            parser.end(e.local_name().as_ref());
            Ok(())
        }
        Event::End(e) => {
            parser.end(e.local_name().as_ref());
            Ok(())
        }
        Event::Text(t) => {
            if let (Some((_, value)), Ok(text)) =
                (&mut parser.metadata, t.xml_content(quick_xml::XmlVersion::Implicit1_0))
            {
                value.push_str(&text);
            }
            Ok(())
        }
        Event::CData(text) => {
            if let (Some((_, value)), Ok(text)) = (&mut parser.metadata, text.decode()) {
                value.push_str(&text);
            }
            Ok(())
        }
        // The reader returns `&lt;` and other entities separately from the text around them.
        Event::GeneralRef(name) => {
            if let (Some((_, value)), Ok(name)) = (&mut parser.metadata, name.decode()) {
                let text = format!("&{name};");
                value.push_str(&quick_xml::escape::unescape(&text).unwrap_or_default());
            }
            Ok(())
        }
        _ => Ok(()),
    })?;
    if !parser.is_model {
        return Err(ReadError::element(excerpt(path), "it has no element `model`"));
    }
    Ok(parser.part)
}

#[derive(Default)]
struct ModelParser {
    part: Part,
    is_model: bool,
    /// The object that is open, and its number.
    object: Option<(u32, Object)>,
    /// The group that is open, and its number.
    group: Option<(u32, Group)>,
    /// The display properties that are open, and their entries.
    metallic: Option<(u32, Vec<[f64; 2]>)>,
    metadata: Option<(String, String)>,
    /// True within the metadata of an object or an item.
    is_in_group: bool,
}

impl ModelParser {
    fn begin(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        match e.local_name().as_ref() {
            b"vertex" => self.vertex(e),
            b"triangleset" | b"ref" | b"refrange" => self.triangle_set(e),
            b"triangle" => self.triangle(e),
            b"model" => self.model(e),
            b"metadatagroup" => {
                self.part.drop_content("metadata of objects and items");
                self.is_in_group = true;
                Ok(())
            }
            b"metadata" => {
                let name = attribute(e, b"name")?.filter(|_| !self.is_in_group);
                self.metadata = name.map(|name| (name, String::new()));
                Ok(())
            }
            b"object" => self.object(e),
            b"component" => {
                let component = component(e)?;
                if let Some((_, object)) = &mut self.object {
                    object.components.push(component);
                }
                Ok(())
            }
            b"item" => {
                let mut item = component(e)?;
                for mark in ItemMark::ALL {
                    let value = attribute(e, mark.name().as_bytes())?;
                    item.marks.extend(matches!(value.as_deref(), Some("0" | "false")).then_some(mark));
                }
                self.drop_attributes(e, &DROPPED_OF_ITEMS)?;
                self.part.items.push(item);
                Ok(())
            }
            b"base" | b"color" | b"tex2coord" | b"multi" => self.entry(e),
            b"basematerials"
            | b"colorgroup"
            | b"texture2dgroup"
            | b"multiproperties"
            | b"compositematerials" => self.group(e),
            b"texture2d" => self.texture(e),
            b"pbmetallicdisplayproperties" => {
                self.metallic = Some((required_number(e, b"id")?, Vec::new()));
                Ok(())
            }
            b"pbmetallic" => {
                let value = |name: &[u8]| -> Result<f64, Problem> {
                    Ok(attribute(e, name)?.and_then(|t| t.parse().ok()).unwrap_or(0.0f64).clamp(0.0, 1.0))
                };
                let entry = [value(b"metallicness")?, value(b"roughness")?];
                if let Some((_, all)) = &mut self.metallic {
                    all.push(entry);
                }
                Ok(())
            }
            b"pbspeculardisplayproperties" | b"translucentdisplayproperties" => {
                self.part.drop_content("specular and translucent display properties");
                Ok(())
            }
            b"pbmetallictexturedisplayproperties" | b"pbspeculartexturedisplayproperties" => {
                self.part.drop_content("textured display properties");
                Ok(())
            }
            b"beamlattice" => {
                self.part.drop_content("beam lattices");
                Ok(())
            }
            b"slicestack" => {
                self.part.drop_content("slices");
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn end(&mut self, name: &[u8]) {
        match name {
            b"object" => {
                if let Some((id, mut object)) = self.object.take() {
                    if object.properties.iter().all(|p| p.group.is_none()) {
                        object.properties = Vec::new();
                    }
                    self.part.objects.insert(id, object);
                }
            }
            b"basematerials" | b"colorgroup" | b"texture2dgroup" | b"multiproperties" => {
                self.part.groups.extend(self.group.take());
            }
            b"pbmetallicdisplayproperties" => self.part.metallic.extend(self.metallic.take()),
            b"metadata" => self.part.metadata.extend(self.metadata.take()),
            b"metadatagroup" => self.is_in_group = false,
            _ => {}
        }
    }

    fn model(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        self.is_model = true;
        for attribute in e.attributes().with_checks(false) {
            let attribute = attribute.map_err(|e| format!("an attribute is damaged: {e}"))?;
            if let Some(prefix) = attribute.key.as_ref().strip_prefix(b"xmlns:") {
                let [prefix, uri] =
                    [prefix, &*attribute.value].map(|t| String::from_utf8_lossy(t).into_owned());
                self.part.namespaces.push((prefix, uri));
            }
        }
        if let Some(unit) = attribute(e, b"unit")? {
            let known = Unit::ALL.into_iter().find(|u| u.name() == unit);
            self.part.unit =
                Some(known.ok_or_else(|| format!("the unit `{}` is not known", excerpt(&unit)))?);
        }
        for prefix in attribute(e, b"requiredextensions")?.unwrap_or_default().split_ascii_whitespace() {
            let namespace = namespace(e, prefix)?.unwrap_or_default();
            match EXTENSIONS.iter().find(|(end, _)| namespace.ends_with(end)) {
                Some((_, None)) => {}
                Some((_, Some(lost))) => self.part.drop_content(lost),
                None => {
                    let name = if namespace.is_empty() { prefix } else { &namespace };
                    return Err(format!(
                        "the file requires the extension {}, which is not supported",
                        excerpt(name)
                    ));
                }
            }
        }
        Ok(())
    }

    fn object(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let mut object = Object { name: attribute(e, b"name")?.unwrap_or_default(), ..Object::default() };
        if let Some(group) = number(e, b"pid")? {
            object.property = Some((group, number(e, b"pindex")?.unwrap_or(0)));
        }
        self.drop_attributes(e, &DROPPED_OF_OBJECTS)?;
        let kind = attribute(e, b"type")?;
        object.kind = OTHER_TYPES.into_iter().find(|other| kind.as_deref() == Some(other));
        self.object = Some((required_number(e, b"id")?, object));
        Ok(())
    }

    /// Records attributes that are dropped.
    fn drop_attributes(
        &mut self,
        e: &BytesStart<'_>,
        all: &[(&'static str, &'static str)],
    ) -> Result<(), Problem> {
        for (name, what) in all {
            if attribute(e, name.as_bytes())?.is_some() {
                self.part.drop_content(what);
            }
        }
        Ok(())
    }

    fn triangle_set(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let Some((_, object)) = &mut self.object else { return Ok(()) };
        let range = match e.local_name().as_ref() {
            b"triangleset" => {
                let text = |name: &[u8]| Ok::<_, Problem>(attribute(e, name)?.unwrap_or_default());
                let (name, identifier) = (text(b"name")?, text(b"identifier")?);
                if name.len().max(identifier.len()) > MAX_SET_NAME {
                    return Err(format!("a name of a set of triangles has more than {MAX_SET_NAME} bytes"));
                }
                object.sets.push(TriangleSet { name, identifier, ranges: Vec::new() });
                return Ok(());
            }
            b"ref" => [required_number(e, b"index")?; 2],
            _ => [required_number(e, b"startindex")?, required_number(e, b"endindex")?],
        };
        if let Some(set) = object.sets.last_mut() {
            set.ranges.push(range);
        }
        Ok(())
    }

    fn vertex(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let Some((_, object)) = &mut self.object else { return Ok(()) };
        let mut p = [None; 3];
        for attribute in e.attributes().with_checks(false) {
            let attribute = attribute.map_err(|e| format!("an attribute is damaged: {e}"))?;
            let axis = match attribute.key.local_name().as_ref() {
                b"x" => 0,
                b"y" => 1,
                b"z" => 2,
                _ => continue,
            };
            p[axis] = Some(float(&attribute.value)?);
        }
        let [Some(x), Some(y), Some(z)] = p else {
            return Err(format!("vertex {} lacks x, y or z", object.vertices.len()));
        };
        object.vertices.push([x as f32, y as f32, z as f32]);
        Ok(())
    }

    fn triangle(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let Some((_, object)) = &mut self.object else { return Ok(()) };
        let mut corners = [None; 3];
        let mut entries = [None; 3];
        let mut group = None;
        let at = object.triangles.len();
        for attribute in e.attributes().with_checks(false) {
            let attribute = attribute.map_err(|e| format!("an attribute is damaged: {e}"))?;
            let value = &*attribute.value;
            match attribute.key.local_name().as_ref() {
                b"v1" => corners[0] = Some(whole(value)?),
                b"v2" => corners[1] = Some(whole(value)?),
                b"v3" => corners[2] = Some(whole(value)?),
                b"pid" => group = Some(whole(value)?),
                b"p1" => entries[0] = Some(whole(value)?),
                b"p2" => entries[1] = Some(whole(value)?),
                b"p3" => entries[2] = Some(whole(value)?),
                name => {
                    let kind = PAINTS.iter().position(|(paint, _)| paint.as_bytes() == name);
                    let is_word = value.iter().all(u8::is_ascii_alphanumeric);
                    if (kind.is_some() && !is_word) || (kind.is_none() && name.starts_with(b"paint_")) {
                        self.part.drop_content("some kinds of paint of a slicer");
                    }
                    if let Some(kind) = kind.filter(|_| is_word && !value.is_empty()) {
                        let text = self.part.paint_number(value);
                        object.paint.push(PaintOfTriangle { triangle: at as u32, kind: kind as u8, text });
                    }
                }
            }
        }
        let [Some(a), Some(b), Some(c)] = corners else {
            return Err(format!("triangle {at} lacks v1, v2 or v3"));
        };
        object.triangles.push([a, b, c]);
        // Entries without a group are of the group of the object.
        let group = group.or(entries[0].and(object.property).map(|(group, _)| group));
        if group.is_some() || !object.properties.is_empty() {
            let none = TriangleProperty { group: None, corners: [0; 3] };
            object.properties.resize(at, none);
            let first = entries[0].unwrap_or(0);
            let corners = [first, entries[1].unwrap_or(first), entries[2].unwrap_or(first)];
            object.properties.push(TriangleProperty { group, corners });
        }
        Ok(())
    }

    fn group(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let id = required_number(e, b"id")?;
        self.group = match e.local_name().as_ref() {
            b"basematerials" => Some((id, Group::Materials(Vec::new(), number(e, b"displaypropertiesid")?))),
            b"colorgroup" => Some((id, Group::Colors(Vec::new()))),
            b"texture2dgroup" => Some((id, Group::Coordinates(required_number(e, b"texid")?, Vec::new()))),
            b"multiproperties" => {
                let ids = attribute(e, b"pids")?.unwrap_or_default();
                Some((id, Group::Several(list(&ids)?, Vec::new())))
            }
            _ => {
                self.part.drop_content("mixtures of materials");
                None
            }
        };
        Ok(())
    }

    fn entry(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let color = |name: &[u8]| -> Result<[f32; 4], Problem> {
            Ok(attribute(e, name)?.map(|text| color(&text)).transpose()?.unwrap_or([1.0; 4]))
        };
        match (&mut self.group, e.local_name().as_ref()) {
            (Some((_, Group::Materials(all, _))), b"base") => {
                all.push((attribute(e, b"name")?.unwrap_or_default(), color(b"displaycolor")?));
            }
            (Some((_, Group::Colors(all))), b"color") => all.push(color(b"color")?),
            (Some((_, Group::Coordinates(_, all))), b"tex2coord") => {
                let number = |name: &[u8]| match attribute(e, name)? {
                    Some(text) => float(text.as_bytes()),
                    None => Err("a texture coordinate lacks u or v".to_owned()),
                };
                all.push([number(b"u")? as f32, number(b"v")? as f32]);
            }
            (Some((_, Group::Several(_, all))), b"multi") => {
                all.push(list(&attribute(e, b"pindices")?.unwrap_or_default())?);
            }
            _ => {}
        }
        Ok(())
    }

    fn texture(&mut self, e: &BytesStart<'_>) -> Result<(), Problem> {
        let path = attribute(e, b"path")?.ok_or("texture2d lacks its path")?;
        let mut wrap = [REPEAT; 2];
        for (wrap, name) in wrap.iter_mut().zip([b"tilestyleu", b"tilestylev"]) {
            *wrap = match attribute(e, name)?.as_deref() {
                Some("mirror") => MIRROR,
                Some("clamp" | "none") => CLAMP,
                _ => REPEAT,
            };
        }
        let is_nearest = attribute(e, b"filter")?.as_deref() == Some("nearest");
        self.part.textures.insert(required_number(e, b"id")?, TextureFile { path, wrap, is_nearest });
        Ok(())
    }
}

fn component(e: &BytesStart<'_>) -> Result<PlacedObject, Problem> {
    let transform = attribute(e, b"transform")?.map(|text| transform(&text)).transpose()?;
    let (path, object) = (attribute(e, b"path")?, required_number(e, b"objectid")?);
    Ok(PlacedObject { path, object, transform, marks: Vec::new() })
}

fn transform(text: &str) -> Result<Transform, Problem> {
    let mut values = Vec::new();
    for word in text.split_ascii_whitespace().take(13) {
        values.push(float(word.as_bytes())?);
    }
    values.try_into().map_err(|_| format!("the transform `{}` does not have 12 numbers", excerpt(text)))
}

/// Returns the namespace of a prefix, as this element declares it.
fn namespace(e: &BytesStart<'_>, prefix: &str) -> Result<Option<String>, Problem> {
    for attribute in e.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| format!("an attribute is damaged: {e}"))?;
        if attribute.key.as_ref().strip_prefix(b"xmlns:") == Some(prefix.as_bytes()) {
            return Ok(Some(String::from_utf8_lossy(&attribute.value).into_owned()));
        }
    }
    Ok(None)
}

fn number(e: &BytesStart<'_>, name: &[u8]) -> Result<Option<u32>, Problem> {
    attribute(e, name)?.map(|text| whole(text.as_bytes())).transpose()
}

pub(super) fn required_number(e: &BytesStart<'_>, name: &[u8]) -> Result<u32, Problem> {
    number(e, name)?.ok_or_else(|| {
        let element = String::from_utf8_lossy(e.local_name().as_ref()).into_owned();
        format!("`{}` lacks its {}", excerpt(&element), String::from_utf8_lossy(name))
    })
}

fn list(text: &str) -> Result<Vec<u32>, Problem> {
    text.split_ascii_whitespace().map(|word| whole(word.as_bytes())).collect()
}

fn whole(text: &[u8]) -> Result<u32, Problem> {
    let text = text.trim_ascii();
    match parse_short_integer(text) {
        Some((value, length)) if length == text.len() => Ok(value),
        _ => str::from_utf8(text)
            .ok()
            .and_then(|t| t.parse().ok())
            .ok_or_else(|| format!("`{}` is not a whole number from 0", excerpt_of_bytes(text))),
    }
}

fn float(text: &[u8]) -> Result<f64, Problem> {
    let text = text.trim_ascii();
    match parse_decimal(text) {
        Some((number, length)) if length == text.len() && number.value.is_finite() => Ok(number.value),
        _ => Err(format!("`{}` is not a number", excerpt_of_bytes(text))),
    }
}

/// Parses `#RRGGBB` or `#RRGGBBAA`.
fn color(text: &str) -> Result<[f32; 4], Problem> {
    let digits = text.trim().strip_prefix('#').unwrap_or_default();
    let is_hex = digits.bytes().all(|b| b.is_ascii_hexdigit());
    let value = u32::from_str_radix(digits, 16).ok().filter(|_| is_hex);
    let bytes = match (digits.len(), value) {
        (6, Some(value)) => (value << 8 | 0xff).to_be_bytes(),
        (8, Some(value)) => value.to_be_bytes(),
        _ => return Err(format!("`{}` is not a colour such as #RRGGBB", excerpt(text))),
    };
    Ok(bytes.map(|b| f32::from(b) / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_hexadecimal() {
        assert_eq!(color("#FF0033"), Ok([1.0, 0.0, 0.2, 1.0]));
        assert_eq!(color("#ff003300"), Ok([1.0, 0.0, 0.2, 0.0]));
        for bad in ["FF0033", "#FF003", "#GG0033", "#+F0033", ""] {
            assert!(color(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn metadata_are_unescaped() {
        let text = br#"<model><metadata name="a">x &lt;&#65;&gt; &amp; &none;y</metadata></model>"#;
        assert_eq!(parse("m", text).unwrap().metadata, [("a".to_owned(), "x <A> & y".to_owned())]);
    }

    #[test]
    fn a_document_type_is_refused() {
        let text = br#"<!DOCTYPE m [<!ENTITY a "b">]><model/>"#;
        assert!(parse("m", text).err().unwrap().to_string().contains("document type"));
        let text = br#"<model><object id="&a;"/></model>"#;
        assert!(parse("m", text).err().unwrap().to_string().contains("line 1"));
    }
}
