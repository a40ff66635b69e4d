//! LAS 1.0 to 1.5 and its compressed form LAZ, COPC included (American Society for Photogrammetry and Remote Sensing,
//! "LAS Specification 1.4 - R15", 2019; M. Isenburg, "LASzip: lossless compression of LiDAR data", 2013).
//!
//! The header, the variable records and the fields of points are read here, so that no number of the file is believed
//! before it was held against the length of the file; the crate `laz` unpacks single chunks. Bounds in headers are not
//! used: many understate.

mod extra;
mod fields;
mod header;
mod sample;
mod stream;
mod unpack;
mod write;

pub(in super::super) use stream::open_stream;
pub(crate) use write::write;

use glam::DVec3;
use rayon::prelude::*;

use self::fields::{PointLayout, RecordBlock};
use self::header::{LasHeader, PointPacking};
use self::sample::SamplePlan;
use super::super::assemble::{FileCoordinates, RawMesh, StepGrid};
use super::super::job::ReadJob;
use super::super::part::PartFate;
use super::super::polygon::PolygonRuns;
use super::super::{Error, FileCounts, FilePlace, Format, ReadWarning};
use super::keep_attributes;
use crate::mesh::attributes::AttributeColumn;

/// Points of a parallel piece, about two megabytes of records.
const PIECE: usize = 1 << 16;

/// Pieces between two looks at the progress.
const PIECES_A_BATCH: usize = 16;

/// What has been read so far.
struct PointSink {
    layout: PointLayout,
    steps: Vec<[i32; 3]>,
    colors: Vec<[u16; 3]>,
    columns: Vec<AttributeColumn>,
}

impl PointSink {
    fn append(&mut self, block: RecordBlock) {
        self.steps.extend_from_slice(&block.steps);
        self.colors.extend_from_slice(&block.colors);
        for (column, values) in self.columns.iter_mut().zip(block.values) {
            column.values.append(values);
        }
    }
}

/// Reads a LAS or LAZ file.
pub(in super::super) fn read(
    job: &mut ReadJob<'_>,
    data: &[u8],
) -> Result<(Format, RawMesh), Error> {
    let header = LasHeader::parse(job, data)?;
    let layout = PointLayout::of(&header);
    let mut sink = PointSink {
        columns: layout.columns(),
        layout,
        steps: Vec::new(),
        colors: Vec::new(),
    };
    let format = match header.packing {
        PointPacking::None => {
            read_plain(job, data, &header, &mut sink)?;
            Format::Las
        }
        PointPacking::LasZip { is_copc, .. } => {
            unpack::read(job, data, &header, &mut sink)?;
            if is_copc { Format::Copc } else { Format::Laz }
        }
    };
    let found = sink.steps.len() as u64;
    if found != header.points {
        if found == 0 && header.points > 0 {
            let place = FilePlace::Byte(header.points_at as u64);
            return Err(job.truncated(place, format!("{} points", header.points)));
        }
        job.warn(ReadWarning::CountContradicts {
            what: "points",
            promised: header.points,
            found,
        });
    }
    keep_attributes(job, sink.columns);
    let colors = bytes_of_colors(job, &sink.colors);
    let raw = RawMesh {
        coordinates: FileCoordinates::Steps(StepGrid {
            steps: sink.steps,
            scale: DVec3::from_array(header.scale),
            offset: DVec3::from_array(header.offset),
        }),
        normals: Vec::new(),
        absent_normals: 0,
        colors,
        triangles: Vec::new(),
        polygons: PolygonRuns::default(),
        counts: FileCounts {
            vertices: found,
            faces: 0,
        },
        textures: None,
    };
    Ok((format, raw))
}

/// Reads points that are not packed, as many as are there.
fn read_plain(
    job: &mut ReadJob<'_>,
    data: &[u8],
    header: &LasHeader,
    sink: &mut PointSink,
) -> Result<(), Error> {
    let length = sink.layout.record_bytes;
    let records = &data[header.points_at..];
    let there = records.len() / length;
    let count = usize::try_from(header.points).map_or(there, |points| points.min(there));
    job.check_vertices(count as u64)?;
    sink.steps.reserve_exact(count);
    sink.colors.reserve_exact(if sink.layout.color.is_some() {
        count
    } else {
        0
    });
    let records = &records[..count * length];
    if let Some(plan) = SamplePlan::of(job, count as u64, count) {
        let sample = sample::of_rows(&sink.layout, records, plan);
        sample::give(job, header, &[sample]);
    }
    let mut done = header.points_at;
    for batch in records.chunks(PIECE * PIECES_A_BATCH * length) {
        let layout = &sink.layout;
        let blocks: Vec<RecordBlock> = batch
            .par_chunks(PIECE * length)
            .map(|piece| layout.block(piece))
            .collect();
        blocks.into_iter().for_each(|block| sink.append(block));
        done += batch.len();
        job.report(done)?;
    }
    Ok(())
}

/// Colors of 8 bits. Many writers put 8-bit values into the fields of 16 bits, which the largest value tells.
fn bytes_of_colors(job: &mut ReadJob<'_>, colors: &[[u16; 3]]) -> Vec<[u8; 4]> {
    let largest = colors
        .par_iter()
        .with_min_len(PIECE)
        .map(|&[r, g, b]| r.max(g).max(b))
        .max()
        .unwrap_or(0);
    let count = colors.len() as u64;
    if largest == 0 {
        let note = "zero everywhere: no colors";
        job.inventory
            .add_some("point color", count, PartFate::Unneeded, note);
        return Vec::new();
    }
    let bits = if largest > 255 { 16 } else { 8 };
    if bits == 8 {
        job.warn(ReadWarning::ColorRange { largest: 255 });
    }
    let note = format!("{bits} bits, largest value {largest}");
    job.inventory
        .add("point color", count, PartFate::Used, note);
    let byte = |value: u16| byte_of_color(value, largest);
    colors
        .par_iter()
        .with_min_len(PIECE)
        .map(|&[r, g, b]| [byte(r), byte(g), byte(b), 255])
        .collect()
}

/// A channel of 8 bits, where `largest` is the largest value of any.
#[inline]
fn byte_of_color(value: u16, largest: u16) -> u8 {
    let shift = if largest > 255 { 8 } else { 0 };
    (value >> shift) as u8
}
