//! LAZ: which bytes hold which points, and the unpacking of one run of them after the other, several at a time.

use std::io::Cursor;

use laz::laszip::{ChunkTable, CompressorType, LazItemType};
use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};
use laz::{LazItem, LazVlr};
use rayon::prelude::*;

use super::super::super::job::ReadJob;
use super::super::super::stream::{RowFile, boxed};
use super::super::super::{Error, FilePlace};
use super::super::guard::guarded;
use super::super::{bytes_at, check_unpacked};
use super::fields::{PointLayout, RecordBlock};
use super::header::{LasHeader, PointPacking};
use super::sample::{self, SamplePlan};
use super::{PIECE, PointSink};
use crate::mesh::stream::StreamError;
use crate::progress::{Progress, SilentProgress};

/// Points unpacked between two looks at the progress, at least.
const BATCH_POINTS: u64 = 1 << 20;

/// How the points are packed.
struct PackedPoints<'a> {
    /// The file up to the end of the points.
    data: &'a [u8],
    items: &'a Vec<LazItem>,
    compressor: CompressorType,
    layout: &'a PointLayout,
    progress: &'a dyn Progress,
}

/// A run of points that can be unpacked by itself.
#[derive(Debug, Clone, Copy)]
struct LazChunk {
    start: usize,
    end: usize,
    points: u64,
}

/// What came out of a chunk, and where and why it ended too early.
struct UnpackedChunk {
    blocks: Vec<RecordBlock>,
    failure: Option<String>,
    /// Offset in the file after the bytes taken.
    end: usize,
}

/// Reads packed points.
pub(super) fn read(
    job: &mut ReadJob<'_>,
    data: &[u8],
    header: &LasHeader,
    sink: &mut PointSink,
) -> Result<(), Error> {
    let PointPacking::LasZip { record, .. } = &header.packing else {
        return Ok(());
    };
    let place = FilePlace::Byte(header.points_at as u64);
    let vlr = guarded(|| LazVlr::from_buffer(record).map_err(|error| error.to_string()))
        .map_err(|reason| job.syntax(place, format!("the record of the packing: {reason}")))?;
    check_items(job, header, &vlr)?;
    let points = PackedPoints {
        data,
        items: vlr.items(),
        compressor: compressor_of(record),
        layout: &sink.layout.clone(),
        progress: job.progress,
    };
    if points.compressor == CompressorType::PointWise {
        return read_in_order(job, &points, header, u64::MAX, header.points_at, sink);
    }
    match chunks(data, header, &vlr) {
        Some(chunks) => {
            let planned = chunks.iter().map(|chunk| chunk.points).sum();
            let bytes = header.record_bytes as u64;
            check_unpacked(job, planned, bytes, data.len() as u64)?;
            if let Some(plan) = SamplePlan::of(job, planned, chunks.len()) {
                sample::give(job, header, &points.sample(&chunks, plan));
            }
            read_chunks(job, &points, &chunks, sink)
        }
        // Cut off before the table, or written to a stream that could not go back.
        None if vlr.uses_variable_size_chunks()
            && points.compressor != CompressorType::LayeredChunked =>
        {
            Err(job.truncated(FilePlace::Byte(data.len() as u64), "the table of chunks"))
        }
        None => {
            let size = u64::from(vlr.chunk_size());
            let start = header.points_at + ChunkTable::OFFSET_SIZE;
            read_in_order(job, &points, header, size, start.min(data.len()), sink)
        }
    }
}

/// The kind of packing; `LazVlr` keeps it to itself.
fn compressor_of(record: &[u8]) -> CompressorType {
    match u16::from_le_bytes(bytes_at(record, 0)) {
        1 => CompressorType::PointWise,
        3 => CompressorType::LayeredChunked,
        _ => CompressorType::PointWiseChunked,
    }
}

/// Refuses a packing whose items do not add up to the points of the header.
fn check_items(job: &ReadJob<'_>, header: &LasHeader, vlr: &LazVlr) -> Result<(), Error> {
    let size: u64 = vlr.items().iter().map(|item| u64::from(item.size())).sum();
    if size == header.record_bytes as u64 {
        return Ok(());
    }
    Err(job.syntax(
        FilePlace::Byte(105),
        format!(
            "packed points of {size} bytes, where the header says {}",
            header.record_bytes
        ),
    ))
}

/// The chunks by the table at the end of the file, held against its length; `None` without a usable table.
fn chunks(data: &[u8], header: &LasHeader, vlr: &LazVlr) -> Option<Vec<LazChunk>> {
    let first = header.points_at + ChunkTable::OFFSET_SIZE;
    let at_start = i64::from_le_bytes(bytes_at(data, header.points_at));
    let at_end = i64::from_le_bytes(bytes_at(data, data.len().saturating_sub(8)));
    let table_at = [at_start, at_end]
        .into_iter()
        .filter_map(|at| usize::try_from(at).ok())
        .find(|&at| at >= first && at < data.len().saturating_sub(7))?;
    chunks_of_table(&data[table_at..], table_at, header, vlr)
}

/// The chunks by the table that begins at byte `table_at` of the file; `None` where it is of no use.
fn chunks_of_table(
    table: &[u8],
    table_at: usize,
    header: &LasHeader,
    vlr: &LazVlr,
) -> Option<Vec<LazChunk>> {
    let first = header.points_at + ChunkTable::OFFSET_SIZE;
    // A chunk holds at least one point as it is.
    let most = table_at.checked_sub(first)? / header.record_bytes;
    let number = u32::from_le_bytes(bytes_at(table, 4)) as usize;
    if number == 0 || number > most {
        return None;
    }
    let is_variable = vlr.uses_variable_size_chunks();
    let table = guarded(|| {
        let mut source = Cursor::new(table);
        ChunkTable::read(&mut source, is_variable).map_err(|error| error.to_string())
    })
    .ok()?;
    let mut left = header.points;
    let mut start = first;
    let mut out = Vec::with_capacity(number);
    for entry in &table {
        // The table counts in 32 bits; the crate widens them with a sign.
        let bytes = entry.byte_count as u32 as usize;
        let points = match is_variable {
            true => u64::from(entry.point_count as u32),
            false => u64::from(vlr.chunk_size()),
        };
        let end = start.checked_add(bytes).filter(|&end| end <= table_at)?;
        let points = points.min(left);
        left -= points;
        if points > 0 {
            out.push(LazChunk { start, end, points });
        }
        start = end;
    }
    Some(out)
}

/// The chunks of a file that is read piece by piece.
#[derive(Debug)]
pub(super) struct PackedChunks {
    record: Vec<u8>,
    items: Vec<LazItem>,
    chunks: Vec<LazChunk>,
}

/// Finds the chunks of a packed file by their table; `None` where there is none of use, or points are not in chunks.
///
/// # Errors
/// The record of the packing is damaged, or not that of the points.
pub(super) fn packed_chunks(
    job: &ReadJob<'_>,
    file: &RowFile,
    header: &LasHeader,
) -> Result<Option<PackedChunks>, Error> {
    let PointPacking::LasZip { record, .. } = &header.packing else {
        return Ok(None);
    };
    let place = FilePlace::Byte(header.points_at as u64);
    let vlr = guarded(|| LazVlr::from_buffer(record).map_err(|error| error.to_string()))
        .map_err(|reason| job.syntax(place, format!("the record of the packing: {reason}")))?;
    check_items(job, header, &vlr)?;
    let first = (header.points_at + ChunkTable::OFFSET_SIZE) as u64;
    if compressor_of(record) == CompressorType::PointWise || file.length < first {
        return Ok(None);
    }
    let at_start = file.read(header.points_at as u64, 8)?;
    let at_end = file.read(file.length - 8, 8)?;
    let table_at = [at_start, at_end]
        .into_iter()
        .filter_map(|at| u64::try_from(i64::from_le_bytes(bytes_at(&at, 0))).ok())
        .find(|&at| at >= first && at < file.length.saturating_sub(7));
    let Some(table_at) = table_at else {
        return Ok(None);
    };
    // A table has up to 8 bytes a chunk, and records may follow it.
    let longest = 16 * (header.points / 1000).max(1 << 16);
    let table = file.read(table_at, longest.min(file.length - table_at))?;
    let chunks = chunks_of_table(&table, table_at as usize, header, &vlr);
    Ok(chunks.map(|chunks| PackedChunks {
        record: record.clone(),
        items: vlr.items().clone(),
        chunks,
    }))
}

impl PackedChunks {
    /// Number of points.
    pub(super) fn points(&self) -> u64 {
        self.chunks.iter().map(|chunk| chunk.points).sum()
    }

    /// Gives all points, block by block.
    ///
    /// # Errors
    /// A chunk that cannot be unpacked; the error of `take`.
    pub(super) fn each(
        &self,
        job: &ReadJob<'_>,
        file: &RowFile,
        layout: &PointLayout,
        take: &mut dyn FnMut(&RecordBlock) -> Result<(), StreamError>,
    ) -> Result<(), StreamError> {
        let threads = rayon::current_num_threads();
        for batch in self.chunks.chunks(2 * threads) {
            let (first, last) = (batch[0], batch[batch.len() - 1]);
            let bytes = (last.end - first.start) as u64;
            let data = file.read(first.start as u64, bytes).map_err(boxed)?;
            let points = PackedPoints {
                data: &data,
                items: &self.items,
                compressor: compressor_of(&self.record),
                layout,
                progress: &SilentProgress,
            };
            let moved = |chunk: &LazChunk| LazChunk {
                start: chunk.start - first.start,
                end: chunk.end - first.start,
                points: chunk.points,
            };
            let unpacked: Vec<UnpackedChunk> = (batch.par_iter())
                .map(|chunk| points.unpack(moved(chunk)))
                .collect();
            for (chunk, unpacked) in batch.iter().zip(unpacked) {
                if let Some(reason) = unpacked.failure {
                    let place = FilePlace::Byte(chunk.start as u64);
                    let reason =
                        format!("the packed points of this chunk cannot be unpacked: {reason}");
                    return Err(boxed(job.syntax(place, reason)));
                }
                unpacked.blocks.iter().try_for_each(&mut *take)?;
            }
        }
        Ok(())
    }
}

/// Unpacks chunks in parallel, and keeps their order.
fn read_chunks(
    job: &mut ReadJob<'_>,
    points: &PackedPoints<'_>,
    chunks: &[LazChunk],
    sink: &mut PointSink,
) -> Result<(), Error> {
    let mut rest = chunks;
    while !rest.is_empty() {
        let mut sum = 0;
        let number = rest
            .iter()
            .position(|chunk| {
                sum += chunk.points;
                sum > BATCH_POINTS
            })
            .unwrap_or(rest.len())
            .max(1);
        let (batch, later) = rest.split_at(number);
        rest = later;
        let unpacked: Vec<UnpackedChunk> = points.with_room(|| {
            batch
                .par_iter()
                .map(|chunk| points.unpack(*chunk))
                .collect()
        });
        job.report(batch.last().map_or(0, |chunk| chunk.end))?;
        for (chunk, unpacked) in batch.iter().zip(unpacked) {
            if let Some(reason) = unpacked.failure {
                let place = FilePlace::Byte(chunk.start as u64);
                let reason =
                    format!("the packed points of this chunk cannot be unpacked: {reason}");
                return Err(job.syntax(place, reason));
            }
            unpacked
                .blocks
                .into_iter()
                .for_each(|block| sink.append(block));
        }
    }
    Ok(())
}

/// Unpacks chunk after chunk where no table tells their ends; ends where the bytes do.
fn read_in_order(
    job: &mut ReadJob<'_>,
    points: &PackedPoints<'_>,
    header: &LasHeader,
    chunk_points: u64,
    mut start: usize,
    sink: &mut PointSink,
) -> Result<(), Error> {
    let mut left = header.points;
    while left > 0 && start < points.data.len() {
        let count = match (chunk_points, points.compressor) {
            (0xffff_ffff, CompressorType::LayeredChunked) => {
                let at = start + header.record_bytes;
                u64::from(u32::from_le_bytes(bytes_at(points.data, at)))
            }
            _ => chunk_points,
        };
        let chunk = LazChunk {
            start,
            end: points.data.len(),
            points: count.min(left),
        };
        if count == 0 {
            break;
        }
        // What comes out is held against the bytes again and again: the header's count means nothing here.
        let unpacked = points.with_room(|| points.unpack(chunk));
        job.report(unpacked.end)?;
        let before = sink.steps.len();
        unpacked
            .blocks
            .into_iter()
            .for_each(|block| sink.append(block));
        left -= ((sink.steps.len() - before) as u64).min(left);
        if unpacked.failure.is_some() || unpacked.end <= start {
            break;
        }
        start = unpacked.end;
    }
    Ok(())
}

/// Stack of a thread that unpacks layers, bytes: address space, of which only what is used is memory.
const LAYER_STACK: usize = 1 << 30;

impl PackedPoints<'_> {
    /// Does `work` on threads with room for the recursion of the unpacker.
    ///
    /// The crate `laz` calls itself for each change between four running times that follows another. A writer makes one at
    /// most, a file made for harm tens of thousands a byte; one of them takes 64 bytes of stack.
    fn with_room<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        if self.compressor != CompressorType::LayeredChunked {
            return work();
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(rayon::current_num_threads())
            .stack_size(LAYER_STACK)
            .build();
        match pool {
            Ok(pool) => pool.install(work),
            Err(error) => {
                tracing::warn!("threads with a large stack: {error}");
                work()
            }
        }
    }

    /// The first points of many chunks; of damaged ones nothing, which the reader says after.
    fn sample(&self, chunks: &[LazChunk], plan: SamplePlan) -> Vec<RecordBlock> {
        let layout = self.layout.clone().without_fields();
        let points = PackedPoints {
            items: self.items,
            layout: &layout,
            ..*self
        };
        let chosen: Vec<LazChunk> = (chunks.iter().step_by(plan.step))
            .map(|chunk| LazChunk {
                points: chunk.points.min(plan.points as u64),
                ..*chunk
            })
            .collect();
        let unpacked: Vec<UnpackedChunk> = points.with_room(|| {
            chosen
                .par_iter()
                .map(|chunk| points.unpack(*chunk))
                .collect()
        });
        let whole = unpacked.into_iter().filter(|chunk| chunk.failure.is_none());
        whole.flat_map(|chunk| chunk.blocks).collect()
    }

    fn unpack(&self, chunk: LazChunk) -> UnpackedChunk {
        let mut out = UnpackedChunk {
            blocks: Vec::new(),
            failure: None,
            end: chunk.start,
        };
        // Blocks that were unpacked before a failure stay.
        let result = guarded(|| {
            let source = Cursor::new(&self.data[chunk.start..chunk.end]);
            if self.compressor == CompressorType::LayeredChunked {
                self.check_layers(chunk)?;
                let decoder = LayeredPointRecordDecompressor::new(source);
                self.unpack_by(decoder, chunk, &mut out)
            } else {
                let decoder = SequentialPointRecordDecompressor::new(source);
                self.unpack_by(decoder, chunk, &mut out)
            }
        });
        out.failure = result.err();
        out
    }

    fn unpack_by<'b, D: RecordDecompressor<Cursor<&'b [u8]>>>(
        &self,
        mut decoder: D,
        chunk: LazChunk,
        out: &mut UnpackedChunk,
    ) -> Result<(), String> {
        decoder
            .set_fields_from(self.items)
            .map_err(|error| error.to_string())?;
        let record = self.layout.record_bytes;
        if decoder.record_size() != record {
            return Err("the items of the packing are not those of the points".to_owned());
        }
        let mut left = chunk.points;
        let mut buffer = vec![0; record * PIECE.min(usize::try_from(left).unwrap_or(PIECE))];
        let mut kept = 0_u64;
        while left > 0 && !self.progress.is_cancelled() {
            let wanted = left.min((buffer.len() / record) as u64) as usize;
            let buffer = &mut buffer[..wanted * record];
            let got = decoder.decompress_until_end_of_file(buffer);
            let got = got.map_err(|error| error.to_string())? / record;
            out.blocks.push(self.layout.block(&buffer[..got * record]));
            out.end = chunk.start + decoder.get().position() as usize;
            kept += (got * record) as u64;
            left -= got as u64;
            if got < wanted {
                return Err("the file ends within it".to_owned());
            }
            let limit = (self.data.len() as u64).saturating_mul(super::super::LARGEST_RATIO);
            if kept > limit.max(super::super::FREE_BYTES) {
                return Err("it unpacks to more than any scan does".to_owned());
            }
        }
        Ok(())
    }

    /// Holds the lengths of a chunk's layers against the bytes of the chunk: the decoder asks for memory by them.
    ///
    /// A chunk is its first point as it is, the number of points, the length of every layer, the layers.
    fn check_layers(&self, chunk: LazChunk) -> Result<(), String> {
        let layers: usize = self
            .items
            .iter()
            .map(|item| match item.item_type() {
                LazItemType::Point14 => 9,
                LazItemType::RGBNIR14 => 2,
                LazItemType::Byte14(count) => usize::from(count),
                _ => 1,
            })
            .sum();
        let chunk = &self.data[chunk.start..chunk.end];
        let lengths_at = self.layout.record_bytes + 4;
        let lengths = chunk
            .get(lengths_at..lengths_at + 4 * layers)
            .ok_or("the file ends within its head")?;
        let (words, _) = lengths.as_chunks::<4>();
        let sum: u64 = words
            .iter()
            .map(|&word| u64::from(u32::from_le_bytes(word)))
            .sum();
        let left = (chunk.len() - lengths_at - lengths.len()) as u64;
        if sum > left {
            return Err(format!(
                "its layers are said to have {sum} bytes, {left} are left"
            ));
        }
        Ok(())
    }
}
