//! Writer of progressive meshes.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use lodsmith_core::splits::{Changes, Counts, SplitData, Splits};
use lodsmith_core::{Positions, Semantic};

use super::checkpoint::{write_checkpoint, write_original};
use super::container::{self, MAGIC, write_chunk};
use super::head::{
    Column, ColumnKind, Head, MAX_NAME_BYTES, MAX_VALUES_PER_WEDGE, column_kinds, kind_number,
};
use super::level_mesh::{LevelMesh, SplitChanges};
use super::step::code_step;
use super::streams::Streams;
use super::values::{PlaceCode, ValueCode};
use super::{LpmOptions, LpmWritten, MAX_BITS, MIN_BITS};
use crate::error::WriteError;
use crate::excerpt::excerpt;
use crate::material::Regions;
use crate::write::write_file;

/// Maximum number of splits in a chunk: some twenty kilobytes, so that a stream refines the mesh several times
/// a second. Measured: with twice as many files shrink by 0.2 %, with half as many they grow by 0.4 %.
const SPLITS_PER_CHUNK: usize = 2048;

/// Minimum number of splits in a chunk that ends at a checkpoint. Measured: without it small files grow by 8 to 20 %,
/// since each chunk has its own codes.
const MIN_SPLITS_PER_CHUNK: usize = 256;

/// Bits of a value of texture coordinates, weights, joints and morph targets.
const VALUE_BITS: u8 = 16;
/// Bits of a component of a colour.
const COLOR_BITS: u8 = 8;
/// A normal gets this many bits fewer than a position, within bounds: 12 bits if positions have 16, which is
/// 0.04 degrees.
const FEWER_NORMAL_BITS: u8 = 4;

/// Writes a file.
///
/// Within a split, changes are written in the order of their elements; of several changes of one element,
/// only the last. Splits in that order survive a round trip bit for bit unless [`LpmOptions::bits`] is given,
/// except for the fits of checkpoints, which are rounded to a quarter of their residual error. With bits,
/// positions and attributes are rounded, and the numbering of the original is left out.
///
/// Cost: O(n).
///
/// # Errors
/// I/O errors of the stream; `InvalidInput` if `bits` cannot be used: out of range, or with positions that
/// are not finite; also if a wedge has more than 4,096 values, or a name more than 65,535 bytes.
pub fn write(
    splits: &Splits,
    regions: Option<&Regions>,
    options: &LpmOptions,
    out: &mut dyn Write,
) -> io::Result<LpmWritten> {
    let mut written = LpmWritten::default();
    let sizes = &mut written.sizes;
    let head = head_of(splits, options).map_err(|text| io::Error::new(io::ErrorKind::InvalidInput, text))?;
    out.write_all(&MAGIC)?;
    sizes.head = MAGIC.len() as u64 + write_chunk(out, container::HEAD, &head.to_bytes())?;
    if let Some(regions) = regions.filter(|r| !r.is_empty() || r.has_materials()) {
        let (bytes, lost) = regions.pack(options.with_textures)?;
        sizes.materials = write_chunk(out, container::MATERIALS, &bytes)?;
        written.warnings = lost;
    }
    let mut waiting = splits.checkpoints.iter().peekable();
    let (mut walk, mut want) = (LevelMesh::default(), SplitChanges::default());
    let mut begin = 0;
    // The base is step 0, split s is step s + 1.
    let count = splits.counts.len();
    while begin < count {
        let mut streams = Streams::default();
        let mut stops = waiting.clone().map(|c| c.level as usize + 1);
        let next_stop = stops.find(|&s| s >= begin + MIN_SPLITS_PER_CHUNK).unwrap_or(count);
        let end = if begin == 0 { 1 } else { count.min(begin + SPLITS_PER_CHUNK).min(next_stop) };
        for s in begin..end {
            fill_step(splits, &head, s, &mut want);
            let coded = code_step(head.split_format(), &mut streams, &walk, &want);
            debug_assert_eq!(coded.as_ref(), Ok(&want), "a split is coded as it is");
            walk.apply(&want);
        }
        let bytes = streams.pack()?;
        if begin == 0 {
            sizes.base = write_chunk(out, container::BASE, &bytes)?;
        } else {
            let mut all = ((end - begin) as u32).to_le_bytes().to_vec();
            all.extend(bytes);
            sizes.splits += write_chunk(out, container::SPLITS, &all)?;
            sizes.chunks += 1;
        }
        begin = end;
        while let Some(checkpoint) = waiting.next_if(|c| (c.level as usize) < end) {
            let bytes = write_checkpoint(&head, checkpoint, options.exact_fits)?;
            sizes.checkpoints += write_chunk(out, container::CHECKPOINT, &bytes)?;
        }
    }
    if let (Some(original), true) = (&splits.original, head.is_exact()) {
        sizes.original = write_chunk(out, container::ORIGINAL, &write_original(&walk, original)?)?;
    }
    sizes.others = write_chunk(out, container::DONE, &(splits.len() as u32).to_le_bytes())?;
    out.flush()?;
    Ok(written)
}

/// Writes a file to a path, by way of a temporary file beside it, which is then renamed. An existing file
/// survives a failure.
///
/// # Errors
/// [`WriteError`], which names the path; no temporary file is left behind.
pub fn write_path(
    splits: &Splits,
    regions: Option<&Regions>,
    options: &LpmOptions,
    path: &Path,
) -> Result<LpmWritten, WriteError> {
    write_file(path, options.force, |out| write(splits, regions, options, out))
        .map_err(|source| WriteError::Io { path: path.to_owned(), source })
}

/// Fills a step with split s - 1, or with the base.
fn fill_step(data: &SplitData, head: &Head, s: usize, step: &mut SplitChanges) {
    step.clear();
    let before = if s == 0 { Counts::default() } else { data.counts[s - 1] };
    let after = data.counts[s];
    let span = |a: u32, b: u32| a as usize..b as usize;
    let faces = span(before.faces, after.faces);
    step.faces.extend(data.faces[faces.clone()].iter().map(|f| f.map(|w| w.0)));
    if let Some(regions) = &data.regions {
        step.regions.extend(regions[faces].iter().map(|r| r.0));
    }
    let wedges = span(before.wedges, after.wedges);
    match &data.vertex_of {
        Some(vertex_of) => step.vertex_of.extend(vertex_of[wedges.clone()].iter().map(|v| v.0)),
        None => step.vertex_of.extend(before.wedges..after.wedges),
    }
    let width = head.width();
    for w in wedges {
        head.encode_row(&data.values[w * width..(w + 1) * width], &mut step.rows);
    }
    let vertices = span(before.vertices, after.vertices);
    step.places.extend(vertices.map(|v| head.places.code(&data.positions, v)));
    let Some(s) = s.checked_sub(1) else { return };
    in_order(&data.corners, s, |at| *at, |i, at| step.corners.push((at, data.corners.to[i].0)));
    in_order(&data.owners, s, |at| at.0, |i, at| step.owners.push((at, data.owners.to[i].0)));
    in_order(&data.places, s, |at| at.0, |i, at| step.moved.push((at, head.places.code(&data.places.to, i))));
    if width > 0 {
        in_order(
            &data.rows,
            s,
            |at| at.0,
            |i, at| {
                step.changed.push(at);
                head.encode_row(&data.rows.to[i * width..(i + 1) * width], &mut step.changed_rows);
            },
        );
    }
}

/// Visits the changes of a split in the order of their elements; of several changes of one element, only the
/// last.
fn in_order<A, T>(
    changes: &Changes<A, T>,
    split: usize,
    number: impl Fn(&A) -> u32,
    mut take: impl FnMut(usize, u32),
) {
    let range: Range<usize> = changes.of(split);
    let numbers = || range.clone().map(|i| number(&changes.at[i]));
    if numbers().zip(numbers().skip(1)).all(|(a, b)| a < b) {
        range.clone().zip(numbers()).for_each(|(i, at)| take(i, at));
        return;
    }
    let last: BTreeMap<u32, usize> = numbers().zip(range.clone()).collect();
    last.into_iter().for_each(|(at, i)| take(i, at));
}

fn head_of(data: &SplitData, options: &LpmOptions) -> Result<Head, String> {
    let full = data.counts[data.counts.len() - 1];
    let mut places = match data.positions {
        Positions::F32(_) => PlaceCode::F32,
        Positions::F64(_) => PlaceCode::F64,
    };
    if let Some(bits) = options.bits {
        if !(MIN_BITS..=MAX_BITS).contains(&bits) {
            return Err(format!("{bits} bits for a coordinate: must be {MIN_BITS} to {MAX_BITS}"));
        }
        places = grid_of(data, bits)?;
    }
    let mut columns = Vec::new();
    let mut begin = 0;
    let width = data.layout.width();
    if width > MAX_VALUES_PER_WEDGE {
        return Err(format!("LPM holds up to 4,096 attribute values for each wedge: this mesh has {width}"));
    }
    for (kind, own) in column_kinds(&data.layout) {
        let name = kind_number(&kind).2;
        if name.len() > MAX_NAME_BYTES {
            let (front, bytes) = (excerpt(name), name.len());
            return Err(format!(
                "LPM holds names of attributes of up to 65,535 bytes: `{front}` has {bytes}"
            ));
        }
        if own == 0 {
            return Err("LPM holds no attributes without values".to_owned());
        }
        let column = || {
            let rows = data.values.chunks_exact(width).chain(data.rows.to.chunks_exact(width));
            rows.map(move |row| &row[begin..begin + own])
        };
        let code = options.bits.map_or(ValueCode::Float, |bits| code_of(&kind, own, column, bits));
        begin += own;
        columns.push(Column { kind, width: own, code });
    }
    Ok(Head {
        has_vertex_map: data.vertex_of.is_some(),
        has_regions: data.regions.is_some(),
        splits: data.counts.len() as u32 - 1,
        full,
        base: data.counts[0],
        places,
        bits: options.bits.unwrap_or(0),
        columns,
    })
}

/// Returns the grid for all positions of all levels, with the same step along all axes.
fn grid_of(data: &SplitData, bits: u8) -> Result<PlaceCode, String> {
    let all = || data.positions.view().iter().chain(data.places.to.view().iter()).collect::<Vec<_>>();
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in all() {
        if !p.iter().all(|x| x.is_finite()) {
            return Err(
                "positions that are not finite cannot be put on a grid: write without --bits".to_owned()
            );
        }
        for k in 0..3 {
            (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
        }
    }
    let is_double = matches!(data.positions, Positions::F64(_));
    let size = (0..3).map(|k| max[k] - min[k]).fold(0.0, f64::max);
    let step = size / f64::from((1u32 << bits) - 1);
    if !size.is_finite() && max[0] >= min[0] {
        return Err("the mesh is too large for a grid: write without --bits".to_owned());
    }
    let is_flat = step.is_nan() || step <= 0.0;
    let min = if max[0] < min[0] { [0.0; 3] } else { min };
    Ok(PlaceCode::Grid { min, step: if is_flat { 1.0 } else { step }, is_double })
}

/// Returns the coding that rounds an attribute; floats if its values are not of the usual kind.
fn code_of<'a, I: Iterator<Item = &'a [f32]>>(
    kind: &ColumnKind,
    width: usize,
    rows: impl Fn() -> I,
    bits: u8,
) -> ValueCode {
    let is_direction =
        |row: &[f32]| row[..3].iter().all(|x| x.is_finite()) && row[..3].iter().any(|&x| x != 0.0);
    let is_whole = |row: &[f32]| row.iter().all(|&x| x.fract() == 0.0 && (0.0..=65535.0).contains(&x));
    let direction_bits = bits.saturating_sub(FEWER_NORMAL_BITS).clamp(8, 16);
    let fixed = |bits: u8, max: f64| ValueCode::Grid {
        bits,
        axes: vec![[0.0, max / f64::from((1u32 << bits) - 1)]; width],
    };
    let within = |max: f32| rows().all(|row| row.iter().all(|x| (0.0..=max).contains(x)));
    match kind {
        ColumnKind::Normal if rows().all(is_direction) => ValueCode::Direction { bits: direction_bits },
        ColumnKind::Further(Semantic::Tangent)
            if width == 4 && rows().all(|row| is_direction(row) && row[3].abs() == 1.0) =>
        {
            ValueCode::Tangent { bits: direction_bits }
        }
        ColumnKind::Color | ColumnKind::Further(Semantic::Color(_)) if within(1.0) => fixed(COLOR_BITS, 1.0),
        ColumnKind::Further(Semantic::Weights(_)) if within(1.0) => fixed(VALUE_BITS, 1.0),
        ColumnKind::Further(Semantic::Joints(_)) if rows().all(is_whole) => fixed(VALUE_BITS, 65535.0),
        ColumnKind::Uv | ColumnKind::Further(Semantic::Uv(_) | Semantic::Morph { .. }) => {
            let mut axes = vec![[f64::INFINITY, f64::NEG_INFINITY]; width];
            for row in rows() {
                for (axis, &x) in axes.iter_mut().zip(row) {
                    if !x.is_finite() {
                        return ValueCode::Float;
                    }
                    *axis = [axis[0].min(f64::from(x)), axis[1].max(f64::from(x))];
                }
            }
            for axis in &mut axes {
                let size = axis[1] - axis[0];
                let step = size / f64::from((1u32 << VALUE_BITS) - 1);
                *axis = [if size >= 0.0 { axis[0] } else { 0.0 }, if step > 0.0 { step } else { 1.0 }];
            }
            ValueCode::Grid { bits: VALUE_BITS, axes }
        }
        _ => ValueCode::Float,
    }
}
