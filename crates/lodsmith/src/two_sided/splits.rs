//! Both sides of a progressive mesh that was recorded for the fronts.

use lodsmith_core::splits::{Changes, Checkpoint, Counts, Layout, NO_ORIGINAL, Original, SplitData};
use lodsmith_core::{FaceId, Positions, Semantic, TriMesh, VertexId, WedgeId};

use super::plan::{BackValues, tangent_sign};
use super::single::{SingleSided, unit};

/// Source of a value in the row of a back.
#[derive(Clone, Copy)]
struct BackValue {
    /// Its offset in the row of the fronts.
    at: usize,
    is_opposite: bool,
    /// True for the first of three values that are a direction.
    begins_direction: bool,
}

/// Elements with both sides: for each element of the fronts its new number and the number of its back, which
/// may be the same.
struct Twins {
    front: Vec<u32>,
    back: Vec<u32>,
    count: u32,
}

impl Twins {
    fn new(count: usize) -> Self {
        Self { front: Vec::with_capacity(count), back: Vec::with_capacity(count), count: 0 }
    }
    /// Numbers the next element, and its back if it has one of its own.
    fn push(&mut self, has_back: bool) {
        self.front.push(self.count);
        self.count += 1;
        self.back.push(if has_back { self.count } else { self.count - 1 });
        self.count += u32::from(has_back);
    }
    /// Returns the numbers of an element: one or two.
    fn of(&self, i: usize) -> impl Iterator<Item = (u32, bool)> + use<> {
        let (front, back) = (self.front[i], self.back[i]);
        std::iter::once((front, false)).chain((back != front).then_some((back, true)))
    }
}

/// The corner of a back at each corner of its front.
const BACK_CORNER: [u32; 3] = [0, 2, 1];

impl SingleSided {
    /// Returns the splits with both sides at each level. The full level is the input, element by element, if
    /// the sides match one to one and no face was left out; otherwise it has the elements in another order.
    /// Cost: O(n).
    pub(super) fn both_splits(&self, input: &TriMesh, own: &[[VertexId; 2]], data: SplitData) -> SplitData {
        let has_own_vertices = self.table.iter().filter_map(|r| r.back).any(|b| b.has_own_vertices);
        let shares_wedges = self.wedges.iter().all(|[front, back]| back.is_none() || back == front);
        let kind = |f: usize| self.table[data.regions.as_ref().map_or(0, |r| r[f].index())];
        let owner = |w: usize| data.vertex_of.as_ref().map_or(VertexId::new(w), |all| all[w]);
        let last = data.counts.last().copied().unwrap_or_default();
        let [mut faces, mut wedges, mut vertices] =
            [last.faces, last.wedges, last.vertices].map(|n| Twins::new(n as usize));
        let mut counts = Vec::with_capacity(data.counts.len());
        let mut before = Counts::default();
        for c in &data.counts {
            (before.vertices..c.vertices).for_each(|_| vertices.push(has_own_vertices));
            (before.wedges..c.wedges).for_each(|_| wedges.push(!shares_wedges));
            (before.faces..c.faces).for_each(|f| faces.push(kind(f as usize).back.is_some()));
            before = *c;
            counts.push(Counts { faces: faces.count, wedges: wedges.count, vertices: vertices.count });
        }
        let wedge = |w: WedgeId, is_back: bool| {
            WedgeId(if is_back { wedges.back[w.index()] } else { wedges.front[w.index()] })
        };
        let vertex = |v: VertexId, is_back: bool| {
            VertexId(if is_back { vertices.back[v.index()] } else { vertices.front[v.index()] })
        };
        let triangles = data.faces.iter().enumerate().flat_map(|(f, t)| {
            let turned = |is_back: bool| if is_back { [t[0], t[2], t[1]] } else { *t };
            faces.of(f).map(move |(_, is_back)| turned(is_back).map(|w| wedge(w, is_back)))
        });
        let regions = input.regions().map(|_| {
            let of = |f: usize| {
                let kind = kind(f);
                let back = kind.back.and_then(|b| b.region);
                faces
                    .of(f)
                    .map(move |(_, is_back)| if is_back { back } else { kind.front }.unwrap_or_default())
            };
            (0..data.faces.len()).flat_map(of).collect()
        });
        let (layout, back_values) = self.back_row(&data.layout);
        let (width, back_width) = (data.layout.width(), layout.width());
        let rows = |row: &[f32], is_back: bool, is_difference: bool| -> Vec<f32> {
            if !is_back {
                return row[..back_width].to_vec();
            }
            let value = |b: &BackValue| if b.is_opposite { -row[b.at] } else { row[b.at] };
            let mut values: Vec<f32> = back_values.iter().map(value).collect();
            for (i, _) in back_values.iter().enumerate().filter(|b| b.1.begins_direction && !is_difference) {
                if let Some(unit) = unit([values[i], values[i + 1], values[i + 2]]) {
                    values[i..i + 3].copy_from_slice(&unit);
                }
            }
            values
        };
        let row_of = |w: usize| if width == 0 { &[][..] } else { &data.values[w * width..][..width] };
        let values = (0..wedges.front.len()).flat_map(|w| {
            wedges.of(w).flat_map(|(_, is_back)| rows(row_of(w), is_back, false)).collect::<Vec<_>>()
        });
        let vertex_of: Vec<VertexId> = (0..wedges.front.len())
            .flat_map(|w| wedges.of(w).map(|(_, is_back)| vertex(owner(w), is_back)).collect::<Vec<_>>())
            .collect();
        let corners = changes(&data.corners, |&corner, &w| {
            let (f, k) = (corner as usize / 3, corner as usize % 3);
            let at = |(f, is_back): (u32, bool)| 3 * f + if is_back { BACK_CORNER[k] } else { k as u32 };
            faces.of(f).map(|twin| (at(twin), wedge(w, twin.1))).collect()
        });
        let owners = changes(&data.owners, |&w, &v| {
            wedges.of(w.index()).map(|(w, is_back)| (WedgeId(w), vertex(v, is_back))).collect()
        });
        let mut changed_rows = Changes { ends: vec![0], at: Vec::new(), to: Vec::new() };
        let mut places = Changes { ends: vec![0], at: Vec::new(), to: empty(&data.positions) };
        for s in 0..data.counts.len() - 1 {
            for i in data.rows.of(s) {
                for (w, is_back) in wedges.of(data.rows.at[i].index()) {
                    changed_rows.at.push(WedgeId(w));
                    changed_rows.to.extend(rows(&data.rows.to[i * width..][..width], is_back, false));
                }
            }
            changed_rows.ends.push(changed_rows.at.len() as u32);
            for i in data.places.of(s) {
                for (v, _) in vertices.of(data.places.at[i].index()) {
                    places.at.push(VertexId(v));
                    push_from(&mut places.to, &data.places.to, i);
                }
            }
            places.ends.push(places.at.len() as u32);
        }
        let mut positions = empty(&data.positions);
        for v in 0..vertices.front.len() {
            vertices.of(v).for_each(|_| push_from(&mut positions, &data.positions, v));
        }
        let checkpoint = |c: &Checkpoint| {
            let moved = c.vertices.iter().zip(&c.moves);
            let moved = moved.flat_map(|(v, by)| vertices.of(v.index()).map(|(v, _)| (VertexId(v), *by)));
            let (own_vertices, moves) = moved.unzip();
            let (mut changed, mut by) = (Vec::new(), Vec::new());
            for (i, w) in c.wedges.iter().enumerate() {
                for (w, is_back) in wedges.of(w.index()) {
                    changed.push(WedgeId(w));
                    by.extend(rows(&c.changes[i * width..][..width], is_back, true));
                }
            }
            Checkpoint {
                level: c.level,
                error: c.error,
                vertices: own_vertices,
                moves,
                wedges: changed,
                changes: by,
            }
        };
        let original =
            data.original.as_ref().and_then(|o| self.original(input, own, o, [&faces, &wedges, &vertices]));
        let mut both = SplitData {
            counts,
            faces: triangles.collect(),
            regions,
            vertex_of: None,
            layout,
            values: values.collect(),
            positions,
            corners,
            owners,
            rows: changed_rows,
            places,
            checkpoints: data.checkpoints.iter().map(checkpoint).collect(),
            original,
        };
        let is_plain = both.counts.iter().all(|c| c.wedges == c.vertices)
            && both.owners.at.is_empty()
            && vertex_of.iter().enumerate().all(|(w, v)| v.index() == w);
        both.vertex_of = (!is_plain).then_some(vertex_of);
        both
    }

    /// Returns the layout of the input, and the source of each value of a back in the row of the fronts.
    fn back_row(&self, single: &Layout) -> (Layout, Vec<BackValue>) {
        let mut offsets = Vec::with_capacity(single.further.len());
        let mut next = 3 * usize::from(single.has_normals)
            + 2 * usize::from(single.has_uvs)
            + 4 * usize::from(single.has_colors);
        for (_, width) in &single.further {
            offsets.push(next);
            next += width;
        }
        let find =
            |semantic: &Semantic| single.further.iter().position(|f| f.0 == *semantic).map(|i| offsets[i]);
        let mut all = Vec::new();
        let mut at = 0;
        let mut add = |back: &BackValues, semantic: Option<&Semantic>, width: usize| {
            let is_normal = semantic.is_none() && width == 3;
            let is_tangent = semantic == Some(&Semantic::Tangent) && width == 4;
            let from = match back {
                BackValues::Own(own) => find(own),
                _ => None,
            };
            let sign = if is_tangent && from.is_some() { find(&tangent_sign()) } else { None };
            all.extend((0..width).map(|k| BackValue {
                at: match (sign, k) {
                    (Some(sign), 3) => sign,
                    _ => from.unwrap_or(at) + k,
                },
                is_opposite: *back == BackValues::Opposite && (!is_tangent || k == 3),
                begins_direction: k == 0 && from.is_some() && (is_normal || is_tangent),
            }));
            at += width;
        };
        let plan = &self.plan;
        for (back, width) in [(&plan.normals, 3), (&plan.uvs, 2), (&plan.colors, 4)] {
            back.iter().for_each(|back| add(back, None, width));
        }
        for ((semantic, width), back) in single.further.iter().zip(&plan.further) {
            add(back, Some(semantic), *width);
        }
        let further = single.further[..plan.further.len()].to_vec();
        (Layout { further, ..single.clone() }, all)
    }

    /// Returns the numbers of the input, if each of its elements exists once.
    fn original(
        &self,
        input: &TriMesh,
        own: &[[VertexId; 2]],
        single: &Original,
        [faces, wedges, vertices]: [&Twins; 3],
    ) -> Option<Original> {
        let none = |n: u32| n == NO_ORIGINAL;
        let mut back_of = vec![NO_ORIGINAL; input.vertex_count()];
        let mut is_back = vec![false; input.vertex_count()];
        for [back, front] in own {
            (back_of[front.index()], is_back[back.index()]) = (back.0, true);
        }
        let of = |twins: &Twins,
                  numbers: &[u32],
                  pair: &dyn Fn(u32) -> [u32; 2],
                  count: usize|
         -> Option<Vec<u32>> {
            let each = |(i, &n): (usize, &u32)| {
                let both = if none(n) { [NO_ORIGINAL; 2] } else { pair(n) };
                twins.of(i).map(|(_, is_back)| both[usize::from(is_back)]).collect::<Vec<_>>()
            };
            let all: Vec<u32> = numbers.iter().enumerate().flat_map(each).collect();
            let mut seen = vec![false; count];
            let is_new =
                |n: &u32| seen.get_mut(*n as usize).is_some_and(|seen| !std::mem::replace(seen, true));
            let is_once = all.iter().filter(|n| !none(**n)).all(is_new);
            (is_once && seen.iter().all(|x| *x)).then_some(all)
        };
        let of_vertex = |v: u32| {
            // (A vertex of a back exists as the back of a front.)
            [if is_back[v as usize] { NO_ORIGINAL } else { v }, back_of[v as usize]]
        };
        let of_wedge = |w: u32| self.wedges[w as usize].map(|w| w.map_or(NO_ORIGINAL, |w| w.0));
        let of_face = |f: u32| self.faces[f as usize];
        Some(Original {
            vertices: bytemuck::allocation::cast_vec::<u32, VertexId>(of(
                vertices,
                bytemuck::cast_slice(&single.vertices),
                &of_vertex,
                input.vertex_count(),
            )?),
            wedges: bytemuck::allocation::cast_vec::<u32, WedgeId>(of(
                wedges,
                bytemuck::cast_slice(&single.wedges),
                &of_wedge,
                input.wedge_count(),
            )?),
            faces: bytemuck::allocation::cast_vec::<u32, FaceId>(of(
                faces,
                bytemuck::cast_slice(&single.faces),
                &of_face,
                input.face_count(),
            )?),
            has_vertex_map: input.vertex_map().is_some(),
        })
    }
}

/// Returns the changes of both sides: `both` converts a single change.
fn changes<A, T>(single: &Changes<A, Vec<T>>, both: impl Fn(&A, &T) -> Vec<(A, T)>) -> Changes<A, Vec<T>> {
    let mut all = Changes { ends: vec![0], at: Vec::new(), to: Vec::new() };
    for s in 0..single.ends.len() - 1 {
        for i in single.of(s) {
            for (at, to) in both(&single.at[i], &single.to[i]) {
                all.at.push(at);
                all.to.push(to);
            }
        }
        all.ends.push(all.at.len() as u32);
    }
    all
}

fn empty(like: &Positions) -> Positions {
    match like {
        Positions::F32(_) => Positions::F32(Vec::new()),
        Positions::F64(_) => Positions::F64(Vec::new()),
    }
}

/// Appends position `i` of others of the same precision.
fn push_from(all: &mut Positions, from: &Positions, i: usize) {
    match (all, from) {
        (Positions::F32(all), Positions::F32(from)) => all.push(from[i]),
        (Positions::F64(all), Positions::F64(from)) => all.push(from[i]),
        (all, from) => {
            let p = from.view().get(VertexId::new(i));
            match all {
                Positions::F32(all) => all.push(p.map(|x| x as f32)),
                Positions::F64(all) => all.push(p),
            }
        }
    }
}
