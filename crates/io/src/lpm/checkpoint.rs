//! Codec of checkpoints, and of the numbering of the original mesh.

use lodsmith_core::splits::{Checkpoint, Counts, NO_ORIGINAL, Original};
use lodsmith_core::{FaceId, VertexId, WedgeId};

use super::head::Head;
use super::level_mesh::LevelMesh;
use super::range::{BelowModel, BitModel, Coded, Coder, Damaged, Decoder, Encoder, NumberModel};
use super::values::{PlaceCode, code_f32, value_f32};

/// Codec of a sequence of checkpoints.
#[derive(Default)]
pub(super) struct CheckpointCodec {
    counts: [NumberModel; 2],
    gaps: [NumberModel; 2],
    moves: Vec<NumberModel>,
    changes: Vec<NumberModel>,
}

/// Coding of the numbers of a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FitCode {
    /// Floats by their rank.
    Exact,
    /// Steps of these powers of two: for moves, and for changes of values.
    Steps([i16; 2]),
}

/// A fit is rounded to steps of at most its residual error divided by this. A uniform rounding error then has
/// an RMS of 0.29 / 4 of that error along the normal, which raises the total by 0.3 %.
const STEPS_PER_ERROR: f64 = 4.0;
/// Changes of values are rounded to steps of the largest change divided by this.
const STEPS_PER_LARGEST_CHANGE: f64 = 256.0;
/// Marks numbers stored as floats.
const EXACT_MARK: i16 = i16::MAX;

impl FitCode {
    fn of(head: &Head, checkpoint: &Checkpoint, exact: bool) -> Self {
        let largest = checkpoint.changes.iter().fold(0f32, |m, x| m.max(x.abs()));
        let moves = checkpoint.moves.as_flattened();
        let farthest = moves.iter().fold(0f32, |m, x| m.max(x.abs()));
        // Positions on a grid need no finer fit.
        let finest = match head.places {
            PlaceCode::Grid { step, .. } => step,
            _ => 0.0,
        };
        // Beyond 2^30 steps, and for numbers that are not finite, rounding is of no use.
        let power = |step: f64, reach: f32| {
            let power = step.log2().floor();
            let fits =
                (-1000.0..1000.0).contains(&power) && f64::from(reach) / power.exp2() < f64::from(1 << 30);
            fits.then_some(power as i16)
        };
        let step = (checkpoint.error / STEPS_PER_ERROR).max(finest);
        let value_step = if largest > 0.0 { f64::from(largest) / STEPS_PER_LARGEST_CHANGE } else { 1.0 };
        let has_nan = moves.iter().chain(&checkpoint.changes).any(|x| x.is_nan());
        match (power(step, farthest), power(value_step, largest)) {
            (Some(a), Some(b)) if !exact && !has_nan => Self::Steps([a, b]),
            _ => Self::Exact,
        }
    }
    fn code(self, x: f32, kind: usize) -> i64 {
        match self {
            Self::Exact => i64::from(code_f32(x)),
            Self::Steps(powers) => (f64::from(x) / f64::from(powers[kind]).exp2()).round() as i64,
        }
    }
    fn value(self, code: i64, kind: usize) -> f32 {
        match self {
            Self::Exact => value_f32(code as i32),
            Self::Steps(powers) => (code as f64 * f64::from(powers[kind]).exp2()) as f32,
        }
    }
}

/// Number of models for a number, selected by the size of the number before.
const SIZE_MODELS: usize = 12;

fn size_of(code: i64) -> usize {
    ((u64::BITS - code.unsigned_abs().leading_zeros()) as usize).min(SIZE_MODELS - 1)
}

impl CheckpointCodec {
    pub(super) fn write(&mut self, head: &Head, checkpoint: &Checkpoint, exact: bool) -> Vec<u8> {
        let mut bytes = checkpoint.level.to_le_bytes().to_vec();
        bytes.extend(checkpoint.error.to_le_bytes());
        let fit = FitCode::of(head, checkpoint, exact);
        let powers = match fit {
            FitCode::Exact => [EXACT_MARK; 2],
            FitCode::Steps(powers) => powers,
        };
        powers.iter().for_each(|p| bytes.extend(p.to_le_bytes()));
        let mut encoder = Encoder::new();
        let mut same = Checkpoint::default();
        let coded = self.code(&mut encoder, head.width(), fit, checkpoint, &mut same);
        assert!(coded.is_ok(), "what is written is not damaged");
        bytes.extend(encoder.finish());
        bytes
    }

    pub(super) fn read(&mut self, head: &Head, bytes: &[u8]) -> Coded<Checkpoint> {
        let short = Damaged("a checkpoint is too short");
        let (level, rest) = bytes.split_first_chunk().ok_or(short)?;
        let (error, rest) = rest.split_first_chunk().ok_or(short)?;
        let (moves, rest) = rest.split_first_chunk().ok_or(short)?;
        let (changes, rest) = rest.split_first_chunk().ok_or(short)?;
        let (level, error) = (u32::from_le_bytes(*level), f64::from_le_bytes(*error));
        let powers = [moves, changes].map(|p| i16::from_le_bytes(*p));
        let fit = if powers.contains(&EXACT_MARK) { FitCode::Exact } else { FitCode::Steps(powers) };
        let mut checkpoint = Checkpoint { level, error, ..Checkpoint::default() };
        self.code(&mut Decoder::new(rest)?, head.width(), fit, &Checkpoint::default(), &mut checkpoint)?;
        Ok(checkpoint)
    }

    fn code<C: Coder>(
        &mut self,
        c: &mut C,
        width: usize,
        fit: FitCode,
        want: &Checkpoint,
        got: &mut Checkpoint,
    ) -> Coded<()> {
        self.moves.resize_with(3 * SIZE_MODELS, NumberModel::default);
        self.changes.resize_with(width * SIZE_MODELS, NumberModel::default);
        let (mut at, mut size) = (0, 0);
        for i in 0..c.count(&mut self.counts[0], want.vertices.len())? {
            let v = code_ascending(c, &mut self.gaps[0], &mut at, want.vertices.get(i).map_or(0, |v| v.0))?;
            let mut by = [0.0; 3];
            for (k, by) in by.iter_mut().enumerate() {
                let code = want.moves.get(i).map_or(0, |m| fit.code(m[k], 0));
                let code = c.signed(&mut self.moves[k * SIZE_MODELS + size], code)?;
                (*by, size) = (fit.value(code, 0), size_of(code));
            }
            got.vertices.push(VertexId(v));
            got.moves.push(by);
        }
        (at, size) = (0, 0);
        for i in 0..c.count(&mut self.counts[1], want.wedges.len())? {
            let w = code_ascending(c, &mut self.gaps[1], &mut at, want.wedges.get(i).map_or(0, |w| w.0))?;
            got.wedges.push(WedgeId(w));
            for k in 0..width {
                let code = want.changes.get(i * width + k).map_or(0, |&x| fit.code(x, 1));
                let code = c.signed(&mut self.changes[k * SIZE_MODELS + size], code)?;
                size = size_of(code);
                got.changes.push(fit.value(code, 1));
            }
        }
        Ok(())
    }
}

/// Codes the next of ascending numbers.
fn code_ascending<C: Coder>(c: &mut C, model: &mut NumberModel, at: &mut u32, wanted: u32) -> Coded<u32> {
    let gap = c.number(model, u64::from(wanted.wrapping_sub(*at)))?;
    let now = u64::from(*at).checked_add(gap).filter(|&now| now < u64::from(u32::MAX));
    let now = now.ok_or(Damaged("a checkpoint names what no number can"))? as u32;
    *at = now + 1;
    Ok(now)
}

/// Models of elements in the order of the original: most are near the one before.
struct OrderModels {
    is_near: [BitModel; 2],
    near: [BitModel; 64],
    any: BelowModel,
}

/// Maximum number of neighbours considered.
const MAX_NEIGHBOURS: usize = 63;

pub(super) fn write_original(walk: &LevelMesh, original: &Original) -> Vec<u8> {
    let mut encoder = Encoder::new();
    let coded = code_original(&mut encoder, walk, Some(original));
    assert!(coded.is_ok(), "what is written is not damaged");
    encoder.finish()
}

pub(super) fn read_original(walk: &LevelMesh, bytes: &[u8]) -> Coded<Original> {
    code_original(&mut Decoder::new(bytes)?, walk, None)
}

fn code_original<C: Coder>(c: &mut C, walk: &LevelMesh, want: Option<&Original>) -> Coded<Original> {
    let Counts { faces, wedges, vertices } = walk.counts();
    let has_vertex_map = c.bit(&mut BitModel::default(), want.is_some_and(|w| w.has_vertex_map))?;
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
            near.extend(walk.corners_of(walk.vertex_of[w as usize]).take(MAX_NEIGHBOURS / 3).map(|c| c / 3));
        }
    })?;
    // Usually vertices are numbered in the order in which faces use them.
    let met = |of_wedge: &dyn Fn(u32) -> u32| -> Vec<u32> {
        face_order.iter().flat_map(|&f| walk.faces[f as usize]).map(of_wedge).collect()
    };
    let vertex_order = wanted(|o| bytemuck::cast_slice(&o.vertices), vertices);
    let by_faces = met(&|w| walk.vertex_of[w as usize]);
    let vertex_order = code_order(c, vertices, vertex_order, &by_faces, |v, near| {
        for corner in walk.corners_of(v).take(MAX_NEIGHBOURS / 2) {
            let face = walk.faces[corner as usize / 3];
            near.extend([1, 2].map(|k| walk.vertex_of[face[(corner as usize + k) % 3] as usize]));
        }
    })?;
    let wedge_order = wanted(|o| bytemuck::cast_slice(&o.wedges), wedges);
    let is_same = c.bit(&mut BitModel::default(), wedge_order.as_ref() == Some(&vertex_order))?;
    let wedge_order = match is_same {
        true => vertex_order.clone(),
        false => code_order(c, wedges, wedge_order, &met(&|w| w), |w, near| {
            for corner in walk.corners_of(walk.vertex_of[w as usize]).take(MAX_NEIGHBOURS / 2) {
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

/// Codes elements in the order of the original: the next one that faces use and that has not been coded, a
/// neighbour of the one before, or any.
fn code_order<C: Coder>(
    c: &mut C,
    count: u32,
    want: Option<Vec<u32>>,
    met: &[u32],
    near_of: impl Fn(u32, &mut Vec<u32>),
) -> Coded<Vec<u32>> {
    let mut total = NumberModel::default();
    let mut model = OrderModels {
        is_near: Default::default(),
        near: [BitModel::default(); 64],
        any: BelowModel::default(),
    };
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
            if !is_named[n as usize] && !places.contains(&n) && places.len() < MAX_NEIGHBOURS {
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
