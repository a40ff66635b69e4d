//! LAS and LAZ piece by piece: records of one size, or packed chunks by their table.

use super::super::super::stream::{RowFile, StreamedModel, boxed};
use super::fields::{PointLayout, RecordBlock};
use super::header::{LasHeader, PointPacking};
use super::unpack::{PackedChunks, packed_chunks};
use super::{PIECE, byte_of_color};
use crate::input::assemble::StepGrid;
use crate::input::job::ReadJob;
use crate::input::{Error, Format, ReadOptions, ReadWarning};
use crate::mesh::stream::{MeshStream, StreamError, StreamFacts, TakePiece, VertexPiece};
use crate::progress::{Progress, SilentProgress};
use glam::DVec3;
use rayon::prelude::*;

/// Bytes of records that are not packed, read at once.
const PLAIN_BYTES: u64 = 16 << 20;

/// An open file.
struct LasStream {
    file: RowFile,
    options: ReadOptions,
    layout: PointLayout,
    points_at: u64,
    /// Points of the file, as many as are there.
    points: u64,
    grid: StepGrid,
    packed: Option<PackedChunks>,
    /// The largest value of a color; 0 where there are none.
    largest_color: u16,
}

/// Opens a LAS or LAZ file as a stream; `None` where it must be read whole. Files with colors are looked through once, for the
/// range of their values.
///
/// # Errors
/// The header is damaged; packed points that cannot be unpacked; cancelled.
pub(in crate::input) fn open_stream(
    job: &mut ReadJob<'_>,
    file: RowFile,
    progress: &dyn Progress,
) -> Result<Option<StreamedModel>, Error> {
    let head = file.read(0, file.length.min(227))?;
    let points_at = head.get(96..100).map_or(0, |at| {
        u64::from(u32::from_le_bytes([at[0], at[1], at[2], at[3]]))
    });
    let head = file.read(0, file.length.min(points_at.max(227)))?;
    let header = LasHeader::parse(job, &head)?;
    let mut format = Format::Las;
    let mut packed = None;
    let length = header.record_bytes as u64;
    let mut points = header.points.min((file.length - points_at) / length.max(1));
    if let PointPacking::LasZip { is_copc, .. } = &header.packing {
        format = if *is_copc { Format::Copc } else { Format::Laz };
        let Some(chunks) = packed_chunks(job, &file, &header)? else {
            return Ok(None);
        };
        points = chunks.points();
        packed = Some(chunks);
    }
    job.check_vertices(points)?;
    if points != header.points {
        job.warn(ReadWarning::CountContradicts {
            what: "points",
            promised: header.points,
            found: points,
        });
    }
    let layout = PointLayout::of(&header).without_fields();
    let mut stream = LasStream {
        options: job.options.clone(),
        points_at,
        points,
        grid: StepGrid {
            steps: Vec::new(),
            scale: DVec3::from_array(header.scale),
            offset: DVec3::from_array(header.offset),
        },
        packed,
        largest_color: 0,
        layout,
        file,
    };
    if stream.layout.color.is_some() {
        progress.stage("looking at colors", points);
        let mut largest = 0;
        let looked = stream.blocks(&mut |block| {
            let channels = block.colors.as_flattened().iter().copied();
            largest = channels.fold(largest, u16::max);
            progress.advance(block.steps.len() as u64);
            match progress.is_cancelled() {
                true => Err(boxed(Error::Cancelled)),
                false => Ok(()),
            }
        });
        looked.map_err(|error| match error.downcast::<Error>() {
            Ok(own) => *own,
            Err(other) => Error::Open {
                path: stream.file.path.clone(),
                source: std::io::Error::other(other),
            },
        })?;
        stream.largest_color = largest;
        if largest > 0 && largest <= 255 {
            job.warn(ReadWarning::ColorRange { largest: 255 });
        }
    }
    job.warn(ReadWarning::LeftOut {
        parts: vec!["attributes of points".to_owned()],
    });
    let file_bytes = stream.file.length;
    Ok(Some(StreamedModel {
        stream: Box::new(stream),
        format,
        file_bytes,
        warnings: std::mem::take(&mut job.warnings),
    }))
}

impl LasStream {
    /// Gives all points, block by block.
    fn blocks(
        &self,
        take: &mut dyn FnMut(&RecordBlock) -> Result<(), StreamError>,
    ) -> Result<(), StreamError> {
        if let Some(packed) = &self.packed {
            let job = ReadJob::new(&self.file.path, None, &self.options, &SilentProgress);
            return packed.each(&job, &self.file, &self.layout, take);
        }
        let length = self.layout.record_bytes as u64;
        let rows = (PLAIN_BYTES / length).max(1);
        for first in (0..self.points).step_by(rows as usize) {
            let count = rows.min(self.points - first);
            let at = self.points_at + first * length;
            let data = self.file.read(at, count * length).map_err(boxed)?;
            let blocks: Vec<RecordBlock> = data
                .par_chunks(PIECE * length as usize)
                .map(|piece| self.layout.block(piece))
                .collect();
            blocks.iter().try_for_each(&mut *take)?;
        }
        Ok(())
    }
}

impl MeshStream for LasStream {
    fn facts(&self) -> StreamFacts {
        StreamFacts {
            vertices: self.points,
            faces: 0,
            has_normals: false,
            has_colors: self.largest_color > 0,
        }
    }

    fn vertices(&self, take: &mut TakePiece<'_, VertexPiece>) -> Result<(), StreamError> {
        self.blocks(&mut |block| {
            let color = |&[r, g, b]: &[u16; 3]| {
                let [r, g, b] = [r, g, b].map(|value| byte_of_color(value, self.largest_color));
                [r, g, b, 255]
            };
            take(&VertexPiece {
                positions: block
                    .steps
                    .iter()
                    .map(|&step| self.grid.place(step))
                    .collect(),
                normals: Vec::new(),
                colors: match self.largest_color {
                    0 => Vec::new(),
                    _ => block.colors.iter().map(color).collect(),
                },
            })
        })
    }

    fn vertices_at(&self, _: &[u32]) -> Result<VertexPiece, StreamError> {
        Err("points of a scan are read in their order".into())
    }

    fn triangles(&self, _: &mut TakePiece<'_, [[u32; 3]]>) -> Result<(), StreamError> {
        Ok(())
    }
}
