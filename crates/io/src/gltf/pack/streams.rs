//! Output of packing: accessors whose data are streams, in views that streams of one kind share, and the bytes
//! of the buffer.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use serde_json::{Map, Value, json};

use super::super::accessors::Component;
use super::super::encode::NumberType;
use super::super::mesh::TYPE_NAMES;
use super::super::meshopt::{Filter, Layout, StreamMode, StreamVersion, encode};
use super::options::Compression;

/// Kind of the data in a stream. Streams of one kind share a view.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum StreamKind {
    /// An attribute of vertices of this name, of morph targets or not.
    Attribute { name: String, is_target: bool },
    /// Indices of triangles.
    Triangles,
    /// Other indices.
    Indices,
    /// Data of animations, skins and others, by name.
    Other(&'static str),
}

impl StreamKind {
    /// Returns the glTF code of the target of its views.
    fn target(&self) -> Option<u32> {
        match self {
            Self::Attribute { .. } => Some(34962),
            Self::Triangles | Self::Indices => Some(34963),
            Self::Other(_) => None,
        }
    }
}

/// Elements of an accessor, ready to be written.
#[derive(Clone, Debug)]
pub(super) struct PackedStream {
    pub(super) kind: StreamKind,
    pub(super) number: NumberType,
    /// Components of an element; 16 for matrices.
    pub(super) width: usize,
    pub(super) stride: usize,
    /// Encoded by the filter, if there is one.
    pub(super) bytes: Vec<u8>,
    pub(super) filter: Filter,
    /// True if the accessor has the least and largest values of each component. Such a stream has no filter.
    pub(super) has_bounds: bool,
}

impl PackedStream {
    pub(super) fn count(&self) -> usize {
        self.bytes.len() / self.stride
    }
}

/// Streams of a view.
struct StreamView {
    kind: StreamKind,
    stride: usize,
    filter: Filter,
    bytes: Vec<u8>,
}

/// An accessor, and the range of its elements in its view.
type Placed = (usize, Range<usize>);

/// Accessors, views and bytes of the file that is made.
pub(super) struct Output {
    compression: Compression,
    pub(super) accessors: Vec<Value>,
    streams: Vec<StreamView>,
    known: HashMap<(StreamKind, usize, bool), usize>,
    /// Accessors by stream view, to be given the view's number.
    of_stream: Vec<(usize, usize)>,
    /// Views that are copied as they are, with their bytes.
    copied: Vec<(Value, Vec<u8>)>,
    /// Indices of copied views, by their indices in the source.
    copied_of: HashMap<usize, usize>,
    /// Accessors of non-vertex data, by their view and a hash of their elements.
    equal: HashMap<(usize, u64), Vec<Placed>>,
    /// Accessors by copied view, and the pointer to the property that names it.
    of_copied: Vec<(usize, &'static str, usize)>,
}

/// Bytes of the buffers of the file, and how many went into compressed streams.
pub(super) struct PackedBuffers {
    pub(super) bytes: Vec<u8>,
    pub(super) stream_bytes: u64,
    pub(super) packed_bytes: u64,
}

impl Output {
    pub(super) fn new(compression: Compression) -> Self {
        Self {
            compression,
            accessors: Vec::new(),
            streams: Vec::new(),
            known: HashMap::new(),
            of_stream: Vec::new(),
            copied: Vec::new(),
            copied_of: HashMap::new(),
            equal: HashMap::new(),
            of_copied: Vec::new(),
        }
    }

    /// Adds an accessor with the data of a stream; `source` gives its name and other properties. Returns its
    /// index. Equal accessors of animations and skins become one.
    pub(super) fn stream(&mut self, source: Option<&Value>, stream: &PackedStream) -> usize {
        let mut object = source.and_then(Value::as_object).cloned().unwrap_or_default();
        for gone in ["bufferView", "byteOffset", "normalized", "sparse", "min", "max"] {
            object.shift_remove(gone);
        }
        let is_zero = stream.bytes.iter().all(|b| *b == 0)
            && matches!(&stream.kind, StreamKind::Attribute { is_target: true, .. });
        object.insert("componentType".to_owned(), stream.number.component.code().into());
        if stream.number.normalized {
            object.insert("normalized".to_owned(), true.into());
        }
        object.insert("count".to_owned(), stream.count().into());
        let kind = if stream.width == 16 { "MAT4" } else { TYPE_NAMES[stream.width] };
        object.insert("type".to_owned(), kind.into());
        if stream.has_bounds {
            let [min, max] = bounds(stream);
            object.insert("min".to_owned(), min.into());
            object.insert("max".to_owned(), max.into());
        }
        // Without a view, all elements are zero.
        if is_zero {
            self.accessors.push(object.into());
            return self.accessors.len() - 1;
        }
        object.insert("bufferView".to_owned(), Value::Null);
        let view = self.view_of(stream);
        let hash = match stream.kind {
            StreamKind::Other(_) => {
                let mut hasher = DefaultHasher::new();
                stream.bytes.hash(&mut hasher);
                Some(hasher.finish())
            }
            _ => None,
        };
        if let Some(same) = hash.and_then(|hash| self.same(&object, view, hash, &stream.bytes)) {
            return same;
        }
        let bytes = &mut self.streams[view].bytes;
        let range = bytes.len()..bytes.len() + stream.bytes.len();
        bytes.extend_from_slice(&stream.bytes);
        if range.start > 0 {
            object.insert("byteOffset".to_owned(), range.start.into());
        }
        let accessor = self.accessors.len();
        self.of_stream.push((accessor, view));
        if let Some(hash) = hash {
            self.equal.entry((view, hash)).or_default().push((accessor, range));
        }
        self.accessors.push(object.into());
        accessor
    }

    /// Returns a known accessor with these properties and elements.
    fn same(&self, object: &Map<String, Value>, view: usize, hash: u64, bytes: &[u8]) -> Option<usize> {
        let mut all = self.equal.get(&(view, hash))?.iter();
        let (accessor, _) = all.find(|(accessor, range)| {
            let mut known = self.accessors[*accessor].as_object().cloned().unwrap_or_default();
            known.shift_remove("byteOffset");
            known == *object && self.streams[view].bytes[range.clone()] == *bytes
        })?;
        Some(*accessor)
    }

    /// Returns the view of the kind of a stream.
    fn view_of(&mut self, stream: &PackedStream) -> usize {
        // Views of one filter have one stride for each kind.
        let key = (stream.kind.clone(), stream.stride, stream.filter != Filter::None);
        let next = self.streams.len();
        let view = *self.known.entry(key).or_insert(next);
        if view == next {
            let PackedStream { kind, stride, filter, .. } = stream;
            let view = StreamView { kind: kind.clone(), stride: *stride, filter: *filter, bytes: Vec::new() };
            self.streams.push(view);
        }
        view
    }

    /// Adds a view that stays as it is, unless the view with this source index was added before; returns its index
    /// among the copied views.
    pub(super) fn copy_view(&mut self, number: usize, view: &Value, bytes: &[u8]) -> usize {
        *self.copied_of.entry(number).or_insert_with(|| {
            self.copied.push((view.clone(), bytes.to_vec()));
            self.copied.len() - 1
        })
    }

    /// Adds an accessor that stays as it is, with its copied views by the name of the property that refers to
    /// them: `""` for the accessor's own, or a part of its sparse elements. Returns its index.
    pub(super) fn copy_accessor(&mut self, source: &Value, views: &[(&'static str, usize)]) -> usize {
        let accessor = self.accessors.len();
        self.accessors.push(source.clone());
        self.of_copied.extend(views.iter().map(|(part, view)| (accessor, *part, *view)));
        accessor
    }

    /// Puts the accessors and views into a file; `of_views` are references to copied views elsewhere. Returns
    /// the bytes of its first buffer. With compression there is a second one, without bytes, for readers
    /// without the extension.
    pub(super) fn finish(
        mut self,
        json: &mut Value,
        of_views: &mut dyn FnMut(&mut Value, usize),
    ) -> PackedBuffers {
        let mut out = PackedBuffers { bytes: Vec::new(), stream_bytes: 0, packed_bytes: 0 };
        let (mut views, mut fallback) = (Vec::new(), 0usize);
        for stream in &self.streams {
            views.push(self.stream_view(stream, &mut out, &mut fallback));
        }
        for (accessor, view) in &self.of_stream {
            self.accessors[*accessor]["bufferView"] = (*view).into();
        }
        let first_copied = views.len();
        for (view, bytes) in &self.copied {
            let place = place(&mut out.bytes, bytes);
            let mut view = view.clone();
            view["buffer"] = 0.into();
            view["byteOffset"] = place.start.into();
            views.push(view);
        }
        for (accessor, part, view) in &self.of_copied {
            let accessor = &mut self.accessors[*accessor];
            let owner = if part.is_empty() { accessor } else { &mut accessor["sparse"][*part] };
            owner["bufferView"] = (first_copied + view).into();
        }
        of_views(json, first_copied);
        put_list(json, "accessors", self.accessors);
        put_list(json, "bufferViews", views);
        let mut buffers = vec![json!({ "byteLength": out.bytes.len() })];
        if let (Some(extension), true) = (self.compression.extension(), fallback > 0) {
            buffers
                .push(json!({ "byteLength": fallback, "extensions": { extension: { "fallback": true } } }));
        }
        put_list(json, "buffers", if out.bytes.is_empty() { Vec::new() } else { buffers });
        out
    }

    /// Writes a stream; returns its view.
    fn stream_view(&self, stream: &StreamView, out: &mut PackedBuffers, fallback: &mut usize) -> Value {
        let StreamView { kind, stride, filter, bytes } = stream;
        let mode = match kind {
            StreamKind::Triangles => StreamMode::Triangles,
            StreamKind::Indices => StreamMode::Indices,
            _ => StreamMode::Attributes,
        };
        let mut view = Map::new();
        let layout = Layout { mode, filter: *filter, count: bytes.len() / stride, stride: *stride };
        let packed = self.compression.extension().filter(|_| layout.check().is_ok());
        match packed {
            Some(extension) => {
                let version = match self.compression {
                    Compression::MeshoptKhr => StreamVersion::V1,
                    _ => StreamVersion::V0,
                };
                let packed = encode(bytes, layout, version);
                let at = place(&mut out.bytes, &packed);
                out.stream_bytes += bytes.len() as u64;
                out.packed_bytes += packed.len() as u64;
                let begin = fallback.next_multiple_of(4);
                *fallback = begin + bytes.len();
                view.insert("buffer".to_owned(), 1.into());
                view.insert("byteOffset".to_owned(), begin.into());
                let mut object = json!({
                    "buffer": 0, "byteOffset": at.start, "byteLength": at.len(),
                    "byteStride": stride, "count": layout.count, "mode": mode.name(),
                });
                if let Some(filter) = filter.name() {
                    object["filter"] = filter.into();
                }
                view.insert("extensions".to_owned(), json!({ extension: object }));
            }
            None => {
                let at = place(&mut out.bytes, bytes);
                view.insert("buffer".to_owned(), 0.into());
                view.insert("byteOffset".to_owned(), at.start.into());
            }
        }
        view.insert("byteLength".to_owned(), bytes.len().into());
        if matches!(kind, StreamKind::Attribute { .. }) {
            view.insert("byteStride".to_owned(), (*stride).into());
        }
        if let Some(target) = kind.target() {
            view.insert("target".to_owned(), target.into());
        }
        // Set last, for the usual order of keys.
        Value::Object(view)
    }
}

/// Appends bytes at a multiple of eight; returns their range.
fn place(buffer: &mut Vec<u8>, bytes: &[u8]) -> Range<usize> {
    const ALIGNMENT: usize = 8;
    buffer.resize(buffer.len().next_multiple_of(ALIGNMENT), 0);
    buffer.extend_from_slice(bytes);
    buffer.len() - bytes.len()..buffer.len()
}

/// Sets a list of a file; an empty one is removed.
fn put_list(json: &mut Value, name: &str, entries: Vec<Value>) {
    let Some(root) = json.as_object_mut() else { return };
    if entries.is_empty() {
        root.shift_remove(name);
    } else {
        root.insert(name.to_owned(), entries.into());
    }
}

/// Returns the least and the largest values of each component of a stream without a filter, as an accessor declares
/// them.
fn bounds(stream: &PackedStream) -> [Vec<Value>; 2] {
    let number = stream.number;
    let size = number.component.size();
    let mut found = vec![(f32::INFINITY, f32::NEG_INFINITY); stream.width];
    for element in stream.bytes.chunks_exact(stream.stride) {
        for ((min, max), bytes) in found.iter_mut().zip(element.chunks_exact(size)) {
            let x = number.component.number(bytes);
            if x.is_finite() {
                (*min, *max) = (min.min(x), max.max(x));
            }
        }
    }
    let shown = |x: f32| match number.component {
        // JSON has no infinity.
        _ if !x.is_finite() => Value::from(0),
        Component::F32 => Value::from(f64::from(x)),
        _ => Value::from(x as i64),
    };
    [found.iter().map(|b| shown(b.0)).collect(), found.iter().map(|b| shown(b.1)).collect()]
}
