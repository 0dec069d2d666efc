//! Values of faces and wedges in blocks. A wedge belongs to the block of its vertex.

use std::borrow::Cow;

use lodsmith_core::{RegionId, WedgeId};

use super::elements::InBlock;
use crate::chunks;
use crate::collapse::attributes::Attributes;
use crate::collapse::store::Store;
use crate::cost::metric::VertexMemory;

/// Values of faces.
pub(super) struct FaceValues<'a> {
    pub(super) wedges: Option<Cow<'a, [[WedgeId; 3]]>>,
    regions: Option<Cow<'a, [RegionId]>>,
    creases: Option<Cow<'a, [u8]>>,
}

impl<'a> FaceValues<'a> {
    /// Returns the values of all faces of a store.
    pub(super) fn of<Q: VertexMemory>(store: &'a Store<Q>) -> Self {
        Self {
            wedges: store.wedges.as_deref().map(Cow::Borrowed),
            regions: store.regions.as_deref().map(Cow::Borrowed),
            creases: store.creases.as_deref().map(Cow::Borrowed),
        }
    }

    pub(super) fn borrowed(&'a self) -> Self {
        Self {
            wedges: self.wedges.as_deref().map(Cow::Borrowed),
            regions: self.regions.as_deref().map(Cow::Borrowed),
            creases: self.creases.as_deref().map(Cow::Borrowed),
        }
    }

    /// Returns the values of some of these faces.
    pub(super) fn of_some(&self, faces: &[u32]) -> FaceValues<'static> {
        fn some<T: Copy>(all: Option<&[T]>, faces: &[u32]) -> Option<Cow<'static, [T]>> {
            all.map(|all| faces.iter().map(|&i| all[i as usize]).collect())
        }
        FaceValues {
            wedges: some(self.wedges.as_deref(), faces),
            regions: some(self.regions.as_deref(), faces),
            creases: some(self.creases.as_deref(), faces),
        }
    }

    /// Returns the values of these faces of several parts. Wedges get the `numbers` of their part, if it has any.
    pub(super) fn joined(
        parts: Vec<FaceValues<'_>>,
        numbers: Vec<&[WedgeId]>,
        faces: &[InBlock],
    ) -> FaceValues<'static> {
        let wedges = parts.iter().map(|part| part.wedges.as_deref());
        let numbered = |part: usize, of_face: [WedgeId; 3]| match numbers.get(part) {
            Some(numbers) => of_face.map(|w| numbers[w.index()]),
            None => of_face,
        };
        FaceValues {
            wedges: in_order(wedges, faces, numbered),
            regions: in_order(parts.iter().map(|part| part.regions.as_deref()), faces, |_, region| region),
            creases: in_order(parts.iter().map(|part| part.creases.as_deref()), faces, |_, bits| bits),
        }
    }

    /// Gives these values to the faces of a store.
    pub(super) fn put_into<Q: VertexMemory>(self, store: &mut Store<Q>) {
        store.wedges = self.wedges.map(Cow::into_owned);
        store.regions = self.regions.map(Cow::into_owned);
        store.creases = self.creases.map(Cow::into_owned);
    }
}

/// Returns the values of these faces, if all parts have any.
fn in_order<'a, T: Copy + Send + Sync + 'a>(
    parts: impl Iterator<Item = Option<&'a [T]>>,
    faces: &[InBlock],
    renamed: impl Fn(usize, T) -> T + Sync,
) -> Option<Cow<'static, [T]>> {
    let parts: Vec<&[T]> = parts.collect::<Option<_>>()?;
    let one = |at: InBlock| renamed(at.block(), parts[at.block()][at.index()]);
    Some(Cow::Owned(chunks::list(faces.len(), |i| one(faces[i]))))
}

/// Wedges of a block, in the order of its vertices.
pub(super) struct BlockWedges {
    pub(super) attributes: Attributes,
    /// First wedge of each vertex.
    pub(super) first: Vec<WedgeId>,
    /// Number of each wedge in the run.
    pub(super) numbers: Vec<WedgeId>,
}

impl BlockWedges {
    /// Copies chains of wedges, each from attributes with the same layout as `like`. With them come the numbers of all
    /// their wedges in the run; none if these are numbered so already.
    pub(super) fn of<'a>(
        like: &Attributes,
        chains: impl Iterator<Item = (&'a Attributes, WedgeId, &'a [WedgeId])>,
        vertices: usize,
    ) -> Self {
        let mut found = Self {
            attributes: like.without_wedges(vertices),
            first: Vec::with_capacity(vertices),
            numbers: Vec::with_capacity(vertices),
        };
        for (from, first, numbers) in chains {
            found.first.push(found.attributes.add_chain(from, first));
            let number = |w: WedgeId| numbers.get(w.index()).copied().unwrap_or(w);
            found.numbers.extend(from.chain(first).map(number));
        }
        found
    }
}
