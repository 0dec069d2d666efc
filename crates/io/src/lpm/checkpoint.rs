//! Levels with a fit, and which element of the original each one is.

use lodsmith_core::splits::{Checkpoint, Counts, NO_ORIGINAL, Original};
use lodsmith_core::{FaceId, VertexId, WedgeId};

use super::head::Head;
use super::range::{Below, Bit, Coded, Coder, Damaged, Decoder, Encoder, Number};
use super::values::ValueCode;
use super::walk::Walk;

/// Codes one checkpoint after the other.
#[derive(Default)]
pub(super) struct Checkpoints {
    counts: [Number; 2],
    gaps: [Number; 2],
    moves: [Number; 3],
    changes: Vec<Number>,
}

impl Checkpoints {
    pub(super) fn write(&mut self, head: &Head, checkpoint: &Checkpoint) -> Vec<u8> {
        let mut bytes = checkpoint.level.to_le_bytes().to_vec();
        bytes.extend(checkpoint.error.to_le_bytes());
        let mut encoder = Encoder::new();
        let mut same = Checkpoint::default();
        let coded = self.code(&mut encoder, head, checkpoint, &mut same);
        assert!(coded.is_ok(), "what is written is not damaged");
        bytes.extend(encoder.finish());
        bytes
    }

    pub(super) fn read(&mut self, head: &Head, bytes: &[u8]) -> Coded<Checkpoint> {
        let short = Damaged("a checkpoint is too short");
        let (level, rest) = bytes.split_first_chunk().ok_or(short)?;
        let (error, rest) = rest.split_first_chunk().ok_or(short)?;
        let (level, error) = (u32::from_le_bytes(*level), f64::from_le_bytes(*error));
        let mut checkpoint = Checkpoint { level, error, ..Checkpoint::default() };
        self.code(&mut Decoder::new(rest)?, head, &Checkpoint::default(), &mut checkpoint)?;
        Ok(checkpoint)
    }

    fn code<C: Coder>(
        &mut self,
        c: &mut C,
        head: &Head,
        want: &Checkpoint,
        got: &mut Checkpoint,
    ) -> Coded<()> {
        let mut at = 0;
        for i in 0..c.count(&mut self.counts[0], want.vertices.len())? {
            let v = rise(c, &mut self.gaps[0], &mut at, want.vertices.get(i).map_or(0, |v| v.0))?;
            let by = want.moves.get(i).map_or([0; 3], |m| head.places.code_of_move(*m));
            let mut codes = [0; 3];
            for k in 0..3 {
                codes[k] = c.signed(&mut self.moves[k], by[k])?;
            }
            got.vertices.push(VertexId(v));
            got.moves.push(head.places.move_of(codes));
        }
        let width = head.width();
        self.changes.resize_with(width.max(1), Number::default);
        let of_value: Vec<(&ValueCode, usize)> =
            head.columns.iter().flat_map(|x| (0..x.width).map(|k| (&x.code, k))).collect();
        at = 0;
        for i in 0..c.count(&mut self.counts[1], want.wedges.len())? {
            let w = rise(c, &mut self.gaps[1], &mut at, want.wedges.get(i).map_or(0, |w| w.0))?;
            got.wedges.push(WedgeId(w));
            for (k, (code, value)) in of_value.iter().enumerate() {
                let by = want.changes.get(i * width + k).map_or(0, |&x| code.code_of_change(x, *value));
                let by = c.signed(&mut self.changes[k], i64::from(by))?;
                got.changes.push(code.change_of(by as i32, *value));
            }
        }
        Ok(())
    }
}

/// The next of rising numbers.
fn rise<C: Coder>(c: &mut C, model: &mut Number, at: &mut u32, wanted: u32) -> Coded<u32> {
    let gap = c.number(model, u64::from(wanted.wrapping_sub(*at)))?;
    let now = u64::from(*at).checked_add(gap).filter(|&now| now < u64::from(u32::MAX));
    let now = now.ok_or(Damaged("a checkpoint names what no number can"))? as u32;
    *at = now + 1;
    Ok(now)
}

/// Elements in the order of the original: mostly, one comes near the one before.
struct Order {
    is_near: [Bit; 2],
    near: [Bit; 64],
    any: Below,
}

/// The most neighbours that are looked at.
const NEAR: usize = 63;

pub(super) fn write_original(walk: &Walk, original: &Original) -> Vec<u8> {
    let mut encoder = Encoder::new();
    let coded = code_original(&mut encoder, walk, Some(original));
    assert!(coded.is_ok(), "what is written is not damaged");
    encoder.finish()
}

pub(super) fn read_original(walk: &Walk, bytes: &[u8]) -> Coded<Original> {
    code_original(&mut Decoder::new(bytes)?, walk, None)
}

fn code_original<C: Coder>(c: &mut C, walk: &Walk, want: Option<&Original>) -> Coded<Original> {
    let Counts { faces, wedges, vertices } = walk.counts();
    let has_vertex_map = c.bit(&mut Bit::default(), want.is_some_and(|w| w.has_vertex_map))?;
    let of = |ids: &[u32], count: u32| -> Vec<u32> {
        let mut order = vec![NO_ORIGINAL; ids.iter().filter(|&&n| n != NO_ORIGINAL).count()];
        for (i, &n) in (0..count).zip(ids).filter(|x| *x.1 != NO_ORIGINAL) {
            order[n as usize] = i;
        }
        order
    };
    let wanted = |ids: fn(&Original) -> &[u32], count: u32| want.map(|w| of(ids(w), count));
    let face_order = wanted(|o| bytemuck::cast_slice(&o.faces), faces);
    let face_order = code_order(c, faces, face_order, &[], |f, near| {
        for w in walk.faces[f as usize] {
            near.extend(walk.corners_of(walk.vertex_of[w as usize]).take(NEAR / 3).map(|c| c / 3));
        }
    })?;
    // As a rule vertices are numbered as faces meet them.
    let met = |of_wedge: &dyn Fn(u32) -> u32| -> Vec<u32> {
        face_order.iter().flat_map(|&f| walk.faces[f as usize]).map(of_wedge).collect()
    };
    let vertex_order = wanted(|o| bytemuck::cast_slice(&o.vertices), vertices);
    let by_faces = met(&|w| walk.vertex_of[w as usize]);
    let vertex_order = code_order(c, vertices, vertex_order, &by_faces, |v, near| {
        for corner in walk.corners_of(v).take(NEAR / 2) {
            let face = walk.faces[corner as usize / 3];
            near.extend([1, 2].map(|k| walk.vertex_of[face[(corner as usize + k) % 3] as usize]));
        }
    })?;
    let wedge_order = wanted(|o| bytemuck::cast_slice(&o.wedges), wedges);
    let is_same = c.bit(&mut Bit::default(), wedge_order.as_ref() == Some(&vertex_order))?;
    let wedge_order = match is_same {
        true => vertex_order.clone(),
        false => code_order(c, wedges, wedge_order, &met(&|w| w), |w, near| {
            for corner in walk.corners_of(walk.vertex_of[w as usize]).take(NEAR / 2) {
                let face = walk.faces[corner as usize / 3];
                near.extend([0, 1, 2].map(|k| face[(corner as usize + k) % 3]));
            }
        })?,
    };
    let numbers = |order: &[u32], count: u32| -> Coded<Vec<u32>> {
        let mut numbers = vec![NO_ORIGINAL; count as usize];
        for (n, &i) in (0..).zip(order) {
            *numbers.get_mut(i as usize).ok_or(Damaged("the original has what the mesh has not"))? = n;
        }
        Ok(numbers)
    };
    Ok(Original {
        vertices: numbers(&vertex_order, vertices)?.into_iter().map(VertexId).collect(),
        wedges: numbers(&wedge_order, wedges)?.into_iter().map(WedgeId).collect(),
        faces: numbers(&face_order, faces)?.into_iter().map(FaceId).collect(),
        has_vertex_map,
    })
}

/// Elements in the order of the original: the next that faces meet and that was not named yet, a neighbour of the one
/// before, or any.
fn code_order<C: Coder>(
    c: &mut C,
    count: u32,
    want: Option<Vec<u32>>,
    met: &[u32],
    near_of: impl Fn(u32, &mut Vec<u32>),
) -> Coded<Vec<u32>> {
    let mut total = Number::default();
    let mut model = Order { is_near: Default::default(), near: [Bit::default(); 64], any: Below::default() };
    let length = c.count(&mut total, want.as_ref().map_or(0, Vec::len))?;
    if length > count as usize {
        return Err(Damaged("the original has more elements than the mesh"));
    }
    let mut is_named = vec![false; count as usize];
    let (mut order, mut met, mut near) = (Vec::new(), met.iter().copied().peekable(), Vec::new());
    let mut was_near = false;
    for i in 0..length {
        let wanted = want.as_ref().map_or(0, |w| w[i]);
        while met.next_if(|&m| is_named[m as usize]).is_some() {}
        near.clear();
        if let Some(&last) = order.last() {
            near_of(last, &mut near);
        }
        let mut places: Vec<u32> = met.peek().copied().into_iter().collect();
        for &n in &near {
            if !is_named[n as usize] && !places.contains(&n) && places.len() < NEAR {
                places.push(n);
            }
        }
        let known = places.iter().position(|&p| p == wanted);
        was_near = c.bit(&mut model.is_near[usize::from(was_near)], known.is_some())?;
        let now = match was_near {
            true => {
                let at = c.tree(&mut model.near, 6, known.unwrap_or(0) as u32)?;
                *places.get(at as usize).ok_or(Damaged("a neighbour is named that is not there"))?
            }
            false => c.below(&mut model.any, count, wanted)?,
        };
        if std::mem::replace(&mut is_named[now as usize], true) {
            return Err(Damaged("an element of the original is named twice"));
        }
        order.push(now);
    }
    Ok(order)
}
