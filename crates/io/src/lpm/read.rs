//! Reader of progressive meshes, chunk by chunk.

use std::io::Read;

use lodsmith_core::splits::{Changes, Counts, NO_ORIGINAL, Original, SplitData, Splits};
use lodsmith_core::{Attribute, RegionId, TriMesh, VertexId, WedgeId};

use super::checkpoint::{CheckpointHead, code_original, order_of};
use super::container::{self, CHUNK_OVERHEAD, ChunkReader, NextChunk};
use super::file::{Lpm, LpmSizes};
use super::head::{ColumnKind, Head};
use super::level_mesh::{LevelMesh, SplitChanges};
use super::step::code_step;
use super::streams::{Damaged, Streams};
use crate::error::{ReadError, Warning};
use crate::limits::Limits;
use crate::material::Regions;

/// Reads a file chunk by chunk: after each one a mesh is available.
pub struct LpmReader<R> {
    chunks: ChunkReader<R>,
    head: Head,
    regions: Regions,
    warnings: Vec<Warning>,
    sizes: LpmSizes,
    limits: Limits,
    unpacked: u64,
    state: ReadProgress,
    level_mesh: LevelMesh,
    data: SplitData,
}

/// Reasons why a chunk is not read.
enum ChunkError {
    Damaged(Damaged),
    Read(ReadError),
}

impl From<Damaged> for ChunkError {
    fn from(damaged: Damaged) -> Self {
        Self::Damaged(damaged)
    }
}

impl From<ReadError> for ChunkError {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

/// Memory of a split without any change: its counts, and the ends of four lists.
const BYTES_PER_STEP: usize = 28;
/// Memory of an element of the original: its number, and its position in the order.
const BYTES_PER_ORIGINAL: u64 = 8;

/// Progress of reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReadProgress {
    Open,
    Complete,
    /// The bytes end too early.
    Cut,
    /// The bytes are damaged.
    Damaged,
}

fn no_changes<A, T: Default>() -> Changes<A, T> {
    Changes { ends: vec![0], at: Vec::new(), to: T::default() }
}

impl<R: Read> LpmReader<R> {
    /// Reads up to the base mesh.
    ///
    /// # Errors
    /// [`ReadError`] if the bytes are of another format, or end or are damaged before the end of the base.
    pub fn new(from: R, limits: Limits) -> Result<Self, ReadError> {
        let mut chunks = ChunkReader::new(from, limits.max_bytes());
        if !chunks.magic()? {
            return Err(ReadError::byte(0, "this is not an LPM file: its first bytes do not match"));
        }
        let (kind, bytes) = required_chunk(&mut chunks, limits)?;
        if kind != container::HEAD {
            return Err(ReadError::byte(8, "the head is missing"));
        }
        let head = Head::from_bytes(&bytes)?;
        let data = SplitData {
            counts: Vec::new(),
            faces: Vec::new(),
            regions: head.has_regions.then(Vec::new),
            vertex_of: head.has_vertex_map.then(Vec::new),
            layout: head.layout(),
            values: Vec::new(),
            positions: head.no_positions(),
            corners: no_changes(),
            owners: no_changes(),
            rows: no_changes(),
            places: Changes { ends: vec![0], at: Vec::new(), to: head.no_positions() },
            checkpoints: Vec::new(),
            original: None,
        };
        let mut reader = Self {
            chunks,
            head,
            regions: Regions::default(),
            warnings: Vec::new(),
            sizes: LpmSizes::default(),
            limits,
            unpacked: 0,
            state: ReadProgress::Open,
            level_mesh: LevelMesh::default(),
            data,
        };
        reader.sizes.head = reader.chunks.at;
        loop {
            let (kind, bytes) = required_chunk(&mut reader.chunks, limits)?;
            let size = bytes.len() as u64 + CHUNK_OVERHEAD;
            match kind {
                container::BASE => {
                    reader.sizes.base = size;
                    return match reader.read_steps(&bytes, 1) {
                        Ok(()) => Ok(reader),
                        Err(ChunkError::Damaged(why)) => Err(ReadError::element("the base mesh", why.0)),
                        Err(ChunkError::Read(error)) => Err(error),
                    };
                }
                container::MATERIALS => {
                    reader.sizes.materials += size;
                    let (regions, warnings) = Regions::unpack(&bytes, limits)?;
                    (reader.regions, reader.warnings) = (regions, warnings);
                }
                kind if is_critical(kind) => {
                    return Err(ReadError::file("the base mesh is missing: another chunk is in its place"));
                }
                _ => reader.sizes.others += size,
            }
        }
    }

    /// Returns the number of splits read so far: the level of the current mesh.
    pub fn level(&self) -> usize {
        self.data.counts.len() - 1
    }
    /// Returns the number of elements of the current mesh, holes included.
    pub fn counts(&self) -> Counts {
        self.level_mesh.counts()
    }
    /// Returns the number of splits and elements of the full mesh, as declared in the head; they are not
    /// checked.
    pub fn announced(&self) -> (usize, Counts) {
        (self.head.splits as usize, self.head.full)
    }
    /// Returns true if the whole file has been read and is valid.
    pub fn is_complete(&self) -> bool {
        self.state == ReadProgress::Complete
    }
    /// Returns the warnings so far.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Reads one more chunk; returns true if more may follow. If bytes are missing or damaged, everything
    /// before stays valid, and a warning reports how much was read.
    ///
    /// # Errors
    /// [`ReadError::Io`] if the stream fails; [`ReadError::Limit`] or [`ReadError::Memory`] if a chunk is too
    /// large, or unpacks to too much. The mesh up to there stays available.
    pub fn next_chunk(&mut self) -> Result<bool, ReadError> {
        if self.state != ReadProgress::Open {
            return Ok(false);
        }
        let at = self.chunks.at;
        match self.chunks.next()? {
            NextChunk::Chunk { kind, bytes } => match self.chunk(kind, &bytes) {
                Ok(()) => {}
                Err(ChunkError::Damaged(why)) => {
                    self.stop(ReadProgress::Damaged, &format!("byte {at}: {}", why.0));
                }
                Err(ChunkError::Read(error)) => {
                    self.state = ReadProgress::Cut;
                    return Err(error);
                }
            },
            NextChunk::End => {
                self.stop(
                    ReadProgress::Cut,
                    &format!("the file ends at byte {}, before its end", self.chunks.at),
                );
            }
            NextChunk::Damaged => {
                self.stop(
                    ReadProgress::Damaged,
                    &format!("byte {at}: the checksum does not match, the file is damaged"),
                );
            }
            NextChunk::TooLarge => return Err(too_large(&self.chunks, self.limits)),
        }
        Ok(self.state == ReadProgress::Open)
    }

    /// Reads the rest of the file. One that ends too early gives the part that was read; a damaged one is an
    /// error.
    ///
    /// # Errors
    /// As [`LpmReader::next_chunk`]; also if bytes are damaged, or if the splits are inconsistent.
    pub fn finish(mut self) -> Result<Lpm, ReadError> {
        self.read_rest()?;
        self.into_lpm()
    }

    /// Reads the rest of the file; damage is an error.
    pub(super) fn read_rest(&mut self) -> Result<(), ReadError> {
        while self.next_chunk()? {}
        match self.warnings.pop_if(|_| self.state == ReadProgress::Damaged) {
            Some(why) => Err(ReadError::file(why.text)),
            None => Ok(()),
        }
    }

    /// Returns everything read so far.
    ///
    /// # Errors
    /// If the splits are inconsistent.
    pub fn into_lpm(self) -> Result<Lpm, ReadError> {
        let is_complete = self.is_complete();
        let splits = Splits::new(self.data).map_err(|e| ReadError::file(e.to_string()))?;
        Ok(Lpm {
            splits,
            regions: self.regions,
            warnings: self.warnings,
            is_complete,
            announced: (self.head.splits as usize, self.head.full),
            bits: (!self.head.is_exact()).then_some(self.head.bits),
            sizes: self.sizes,
        })
    }

    fn chunk(&mut self, kind: [u8; 4], bytes: &[u8]) -> Result<(), ChunkError> {
        let size = bytes.len() as u64 + CHUNK_OVERHEAD;
        match kind {
            container::SPLITS => {
                self.sizes.splits += size;
                self.sizes.chunks += 1;
                let (count, packed) =
                    bytes.split_first_chunk().ok_or(Damaged("a chunk of splits is too short"))?;
                self.read_steps(packed, u32::from_le_bytes(*count))?;
            }
            container::CHECKPOINT => {
                self.sizes.checkpoints += size;
                self.checkpoint(bytes)?;
            }
            container::ORIGINAL => {
                self.sizes.original += size;
                let mut streams = self.unpack(bytes)?;
                let Counts { faces, wedges, vertices } = self.level_mesh.counts();
                let elements = u64::from(faces) + u64::from(wedges) + u64::from(vertices);
                self.add_unpacked(elements * BYTES_PER_ORIGINAL)?;
                let original = code_original(&mut streams, &self.level_mesh, None)?;
                streams.check_end()?;
                self.data.original = Some(original);
            }
            container::DONE => {
                self.sizes.others += size;
                if !bytes.try_into().is_ok_and(|n| u32::from_le_bytes(n) as usize == self.level()) {
                    return Err(Damaged("splits are missing").into());
                }
                self.state = ReadProgress::Complete;
            }
            kind if is_critical(kind) => {
                return Err(Damaged("a chunk has an unknown kind").into());
            }
            _ => self.sizes.others += size,
        }
        Ok(())
    }

    /// Unpacks the streams of a chunk.
    fn unpack(&self, packed: &[u8]) -> Result<Streams, ChunkError> {
        let most = self.limits.max_unpacked_bytes(packed.len());
        let streams = Streams::unpack(packed, most)?;
        self.check_size(streams.as_ref().map_or(most.saturating_add(1), Streams::size))?;
        let times = most / (packed.len() as u64).max(1);
        Ok(streams.ok_or(ReadError::Ratio { what: "a chunk", limit: most, times })?)
    }

    /// Reads steps, and keeps all before the first that is invalid or takes too much memory.
    fn read_steps(&mut self, packed: &[u8], count: u32) -> Result<(), ChunkError> {
        let mut streams = self.unpack(packed)?;
        let nothing = SplitChanges::default();
        for _ in 0..count {
            let step = code_step(self.head.split_format(), &mut streams, &self.level_mesh, &nothing)?;
            let row = 16 + 8 * self.head.width();
            let size = BYTES_PER_STEP
                + step.faces.len() * 24
                + (step.vertex_of.len() + step.changed.len()) * row
                + (step.places.len() + step.moved.len()) * 48
                + (step.corners.len() + step.owners.len()) * 8;
            self.add_unpacked(size as u64)?;
            self.keep(&step)?;
        }
        Ok(streams.check_end()?)
    }

    fn checkpoint(&mut self, bytes: &[u8]) -> Result<(), ChunkError> {
        let front = CheckpointHead::from_bytes(bytes)?;
        let mut streams = self.unpack(front.packed)?;
        let checkpoint = front.read(&self.head, &mut streams)?;
        let size = std::mem::size_of_val(&checkpoint)
            + checkpoint.vertices.len() * 16
            + checkpoint.wedges.len() * (4 + 4 * self.head.width());
        self.add_unpacked(size as u64)?;
        let last = self.data.checkpoints.last();
        let is_after = last.is_none_or(|c| c.level < checkpoint.level && c.error >= checkpoint.error);
        if checkpoint.level as usize > self.level() || !is_after {
            return Err(Damaged("a checkpoint is at the wrong level").into());
        }
        self.data.checkpoints.push(checkpoint);
        Ok(())
    }

    /// Adds approximate bytes to the memory that the result takes, and checks that.
    fn add_unpacked(&mut self, bytes: u64) -> Result<(), ReadError> {
        self.check_size(bytes)?;
        self.unpacked += bytes;
        Ok(())
    }

    /// Returns an error if there is no room for this many more bytes.
    fn check_size(&self, more: u64) -> Result<(), ReadError> {
        let (size, limit) = (self.unpacked.saturating_add(more), self.limits.bytes);
        if size > limit {
            return Err(ReadError::Limit { what: "the unpacked progressive mesh", size, limit });
        }
        // (Measured: the result takes up to twice as much.)
        self.limits.check_memory("unpacking the progressive mesh", size.saturating_mul(2))
    }

    fn keep(&mut self, step: &SplitChanges) -> Result<(), Damaged> {
        let Self { data, head, level_mesh, .. } = self;
        let has_more_than_numbers = |n: usize| n >= u32::MAX as usize;
        let changes = [data.corners.at.len(), data.owners.at.len(), data.rows.at.len(), data.places.at.len()];
        if changes.into_iter().any(has_more_than_numbers) {
            return Err(Damaged("more changes than 32-bit numbers can count"));
        }
        level_mesh.apply(step);
        data.faces.extend(step.faces.iter().map(|f| f.map(WedgeId)));
        if let Some(regions) = &mut data.regions {
            regions.extend(step.regions.iter().map(|&r| RegionId(r)));
        }
        if let Some(vertex_of) = &mut data.vertex_of {
            vertex_of.extend(step.vertex_of.iter().map(|&v| VertexId(v)));
        }
        let channels = head.channels();
        for row in step.rows.chunks_exact(channels.max(1)) {
            head.decode_row(row, &mut data.values);
        }
        step.places.iter().for_each(|&p| head.places.push(p, &mut data.positions));
        data.counts.push(level_mesh.counts());
        if data.counts.len() == 1 {
            return Ok(());
        }
        data.corners.at.extend(step.corners.iter().map(|c| c.0));
        data.corners.to.extend(step.corners.iter().map(|c| WedgeId(c.1)));
        data.corners.ends.push(data.corners.at.len() as u32);
        data.owners.at.extend(step.owners.iter().map(|o| WedgeId(o.0)));
        data.owners.to.extend(step.owners.iter().map(|o| VertexId(o.1)));
        data.owners.ends.push(data.owners.at.len() as u32);
        data.rows.at.extend(step.changed.iter().map(|&w| WedgeId(w)));
        for row in step.changed_rows.chunks_exact(channels.max(1)) {
            head.decode_row(row, &mut data.rows.to);
        }
        data.rows.ends.push(data.rows.at.len() as u32);
        for &(v, place) in &step.moved {
            data.places.at.push(VertexId(v));
            head.places.push(place, &mut data.places.to);
        }
        data.places.ends.push(data.places.at.len() as u32);
        Ok(())
    }

    /// Stops reading; adds a warning with the reason and with how much was read.
    fn stop(&mut self, state: ReadProgress, why: &str) {
        self.state = state;
        let counts = self.level_mesh.counts();
        let text = format!(
            "{why}: incomplete, {} of {} splits and {} of {} faces were read",
            self.level(),
            self.head.splits,
            counts.faces,
            self.head.full.faces
        );
        self.warnings.push(Warning::lost(text));
    }

    /// Returns the mesh of the splits read so far, without elements that no face uses. Once all are read, it
    /// is the mesh that was written, in its original order if the file contains that.
    ///
    /// # Errors
    /// [`ReadError::Mesh`] if the file describes an invalid mesh.
    pub fn mesh(&self) -> Result<TriMesh, ReadError> {
        let original = self.data.original.as_ref().filter(|_| self.state == ReadProgress::Complete);
        mesh_of(&self.head, &self.level_mesh, original)
    }
}

fn mesh_of(head: &Head, level_mesh: &LevelMesh, original: Option<&Original>) -> Result<TriMesh, ReadError> {
    let Counts { faces, wedges, vertices } = level_mesh.counts();
    let (vertex_order, wedge_order, face_order) = match original {
        Some(o) => (
            order_of(bytemuck::cast_slice(&o.vertices)),
            order_of(bytemuck::cast_slice(&o.wedges)),
            order_of(bytemuck::cast_slice(&o.faces)),
        ),
        None => {
            let mut is_used = vec![false; wedges as usize];
            level_mesh.faces.as_flattened().iter().for_each(|&w| is_used[w as usize] = true);
            let used: Vec<u32> = (0..wedges).filter(|&w| is_used[w as usize]).collect();
            let mut has_wedge = vec![false; vertices as usize];
            used.iter().for_each(|&w| has_wedge[level_mesh.vertex_of[w as usize] as usize] = true);
            let all = (0..vertices).filter(|&v| has_wedge[v as usize]).collect();
            (all, used, (0..faces).collect())
        }
    };
    let places = |order: &[u32], count: u32| {
        let mut places = vec![NO_ORIGINAL; count as usize];
        (0..).zip(order).for_each(|(i, &n)| places[n as usize] = i);
        places
    };
    let (vertex_at, wedge_at) = (places(&vertex_order, vertices), places(&wedge_order, wedges));
    let mut positions = head.no_positions();
    vertex_order.iter().for_each(|&v| head.places.push(level_mesh.places[v as usize], &mut positions));
    let owners: Vec<VertexId> =
        wedge_order.iter().map(|&w| VertexId(vertex_at[level_mesh.vertex_of[w as usize] as usize])).collect();
    let triangles: Vec<[WedgeId; 3]> = face_order
        .iter()
        .map(|&f| level_mesh.faces[f as usize].map(|w| WedgeId(wedge_at[w as usize])))
        .collect();
    let is_plain = owners.len() == vertex_order.len() && (0..).zip(&owners).all(|(i, v)| v.0 == i);
    let keeps_map = original.map_or(head.has_vertex_map, |o| o.has_vertex_map);
    let mut mesh = match is_plain && !keeps_map {
        true => TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?,
        false => TriMesh::with_wedges(positions, owners, triangles)?,
    };
    let mut values = Vec::new();
    let channels = head.channels();
    for &w in &wedge_order {
        head.decode_row(&level_mesh.rows[w as usize * channels..][..channels], &mut values);
    }
    let width = head.width();
    let mut begin = 0;
    for column in &head.columns {
        let own = values.chunks_exact(width).flat_map(|row| row[begin..begin + column.width].iter().copied());
        let own: Vec<f32> = own.collect();
        begin += column.width;
        match &column.kind {
            ColumnKind::Normal => mesh.set_normals(Some(bytemuck::cast_slice(&own).to_vec()))?,
            ColumnKind::Uv => mesh.set_uvs(Some(bytemuck::cast_slice(&own).to_vec()))?,
            ColumnKind::Color => mesh.set_colors(Some(bytemuck::cast_slice(&own).to_vec()))?,
            ColumnKind::Further(semantic) => mesh.add_attribute(Attribute {
                semantic: semantic.clone(),
                width: column.width,
                values: own,
            })?,
        }
    }
    if head.has_regions {
        mesh.set_regions(Some(
            face_order.iter().map(|&f| RegionId(level_mesh.regions[f as usize])).collect(),
        ))?;
    }
    Ok(mesh)
}

/// Reads the next chunk, which has to exist.
fn required_chunk<R: Read>(
    chunks: &mut ChunkReader<R>,
    limits: Limits,
) -> Result<([u8; 4], Vec<u8>), ReadError> {
    let at = chunks.at as usize;
    match chunks.next()? {
        NextChunk::Chunk { kind, bytes } => Ok((kind, bytes)),
        NextChunk::End => {
            let text = format!("the file ends at byte {}, before the end of the base mesh", chunks.at);
            Err(ReadError::file(text))
        }
        NextChunk::Damaged => Err(ReadError::byte(at, "the checksum does not match, the file is damaged")),
        NextChunk::TooLarge => Err(too_large(chunks, limits)),
    }
}

fn too_large<R>(chunks: &ChunkReader<R>, limits: Limits) -> ReadError {
    ReadError::Limit { what: "the file", size: chunks.at, limit: limits.max_bytes() }
}

/// Returns true if a chunk of unknown kind must not be skipped: its first letter is a capital.
fn is_critical(kind: [u8; 4]) -> bool {
    !kind[0].is_ascii_lowercase()
}
