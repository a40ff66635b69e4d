//! Clouds as text: XYZ, PTS, PTX, CSV and their relatives, one point a line.
//!
//! No two programs agree on columns and separators, so the first 64 lines decide, and a remark says what they decided. A
//! line of one whole number counts the points of the scan that follows. PTX has ten lines before each scan: columns and
//! rows, place and axes of the scanner, and the matrix that takes its points to the world (by rows, a point is a row).

mod dialect;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use self::dialect::{LineKind, TextDialect};
use super::super::assemble::RawMesh;
use super::super::color::ColorRange;
use super::super::job::ReadJob;
use super::super::job::at_line;
use super::super::part::{PartFate, PartFault};
use super::super::text::TextScanner;
use super::super::{Error, Format, ReadWarning};
use super::roles::{ColumnRole, kind_of};
use super::sink::{CloudSink, TableBlock};
use crate::mesh::attributes::{AttributeColumn, AttributeValues, NumberType};

/// Bytes of a parallel piece, and pieces between two looks at the progress.
const PIECE: usize = 1 << 20;
const PIECES_A_BATCH: usize = 16;

/// Lines of a scan's head in PTX.
const PTX_HEAD: usize = 10;

/// Where the parts of a point are in a line.
struct TextPlan {
    dialect: TextDialect,
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    color: Option<[usize; 3]>,
    /// Columns that are kept as attributes.
    attributes: Vec<usize>,
    /// Points at the scanner itself stand for nothing.
    has_holes: bool,
}

/// Points of a piece of text, and what else its lines were.
#[derive(Default)]
struct TextBlock {
    table: TableBlock,
    /// Lines of one whole number.
    count_lines: u64,
    bad_lines: u64,
    /// Offset of the first in the data.
    first_bad: Option<usize>,
    holes: u64,
}

/// Place of a scan of PTX in the world.
#[derive(Debug, Clone, Copy)]
struct ScanPose {
    rows: [DVec3; 4],
}

impl ScanPose {
    const NONE: ScanPose = ScanPose {
        rows: [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO],
    };

    fn turn(&self, v: DVec3) -> DVec3 {
        self.rows[0] * v.x + self.rows[1] * v.y + self.rows[2] * v.z
    }
}

/// Reads a cloud of text.
pub(in super::super) fn read(
    job: &mut ReadJob<'_>,
    data: &[u8],
) -> Result<(Format, RawMesh), Error> {
    let is_ptx = ptx_head(data, 0).is_some();
    let start = match ptx_head(data, 0) {
        Some(head) => head.points_at,
        None => 0,
    };
    let mut dialect = TextDialect::sniff(&data[start..]);
    if is_ptx && dialect.columns.len() >= 4 {
        dialect.name_as_ptx();
    }
    let plan = plan(job, dialect, is_ptx)?;
    job.warn(ReadWarning::ColumnsDecided {
        columns: plan.dialect.words(),
    });
    let column = |&at: &usize| {
        let ColumnRole::Attribute(name) = &plan.dialect.columns[at] else {
            return AttributeColumn::new("", kind_of(""), NumberType::F64);
        };
        AttributeColumn::new(name, kind_of(name), NumberType::F64)
    };
    let columns = plan.attributes.iter().map(column).collect();
    let mut sink = CloudSink::new(columns, ColorRange::EITHER);
    let mut state = ReadState::default();
    if is_ptx {
        read_ptx(job, data, &plan, &mut sink, &mut state)?;
    } else {
        let start = start + plan.dialect.skip_bytes;
        read_lines(
            job,
            data,
            start..data.len(),
            &plan,
            ScanPose::NONE,
            &mut sink,
            &mut state,
        )?;
        sink.scans = state.count_lines.max(1);
    }
    if state.bad_lines > sink.positions.len() as u64 {
        let place = at_line(data, state.first_bad.unwrap_or(0));
        return Err(job.syntax(
            place,
            format!("{} lines are no points, more than are", state.bad_lines),
        ));
    }
    let first = state.first_bad.unwrap_or(0);
    if state.bad_lines > 0 {
        job.inventory
            .fault(PartFault::POINT_LINE, state.bad_lines, || {
                at_line(data, first)
            });
    }
    sink.points = sink.positions.len() as u64 + state.holes;
    sink.holes = state.holes;
    let rows = sink.points;
    job.inventory
        .add_some("scans", sink.scans, PartFate::Used, "");
    job.inventory.add(
        "lines of points",
        rows,
        PartFate::Used,
        plan.dialect.words(),
    );
    let format = if is_ptx {
        Format::Ptx
    } else {
        Format::TextPoints
    };
    Ok((format, sink.finish(job)?))
}

/// What lines were found so far.
#[derive(Default)]
struct ReadState {
    count_lines: u64,
    bad_lines: u64,
    first_bad: Option<usize>,
    holes: u64,
}

/// Where everything is, by the roles of the columns.
fn plan(job: &ReadJob<'_>, dialect: TextDialect, is_ptx: bool) -> Result<TextPlan, Error> {
    let find = |wanted: &ColumnRole| dialect.columns.iter().position(|role| role == wanted);
    let three =
        |role: fn(usize) -> ColumnRole| Some([find(&role(0))?, find(&role(1))?, find(&role(2))?]);
    let Some(position) = three(ColumnRole::Position) else {
        return Err(job.syntax(
            super::super::FilePlace::Line(1),
            "no line of three numbers was found in the first 64 lines",
        ));
    };
    let is_attribute = |role: &ColumnRole| matches!(role, ColumnRole::Attribute(_));
    let attributes = (0..dialect.columns.len()).filter(|&at| is_attribute(&dialect.columns[at]));
    Ok(TextPlan {
        position,
        normal: three(ColumnRole::Normal),
        color: three(ColumnRole::Color),
        attributes: attributes.collect(),
        has_holes: is_ptx,
        dialect,
    })
}

/// Reads the lines of a part of the data in parallel, keeping their order.
fn read_lines(
    job: &mut ReadJob<'_>,
    data: &[u8],
    part: std::ops::Range<usize>,
    plan: &TextPlan,
    pose: ScanPose,
    sink: &mut CloudSink,
    state: &mut ReadState,
) -> Result<(), Error> {
    let mut at = part.start;
    while at < part.end {
        let mut pieces = Vec::new();
        while pieces.len() < PIECES_A_BATCH && at < part.end {
            let cut = (at + PIECE).min(part.end);
            let end = data[cut..part.end]
                .iter()
                .position(|&byte| byte == b'\n' || byte == b'\r')
                .map_or(part.end, |length| cut + length + 1);
            pieces.push(at..end);
            at = end;
        }
        let blocks: Vec<TextBlock> = pieces
            .into_par_iter()
            .map(|piece| plan.block(data, piece, pose))
            .collect();
        for block in blocks {
            state.count_lines += block.count_lines;
            state.bad_lines += block.bad_lines;
            state.first_bad = state.first_bad.or(block.first_bad);
            state.holes += block.holes;
            sink.append(block.table);
        }
        job.report(at)?;
        job.check_vertices(sink.positions.len() as u64)?;
    }
    Ok(())
}

impl TextPlan {
    /// The points of a piece of whole lines.
    fn block(&self, data: &[u8], piece: std::ops::Range<usize>, pose: ScanPose) -> TextBlock {
        let mut out = TextBlock::default();
        let mut scanner = TextScanner::new(&data[..piece.end], piece.start);
        let wanted = self.dialect.columns.len();
        let mut numbers = Vec::with_capacity(wanted + 1);
        let mut columns = vec![Vec::new(); self.attributes.len()];
        while let Some((line, start)) = scanner.line() {
            match self.dialect.parse(line, &mut numbers) {
                LineKind::Nothing => continue,
                LineKind::Count => {
                    out.count_lines += 1;
                    continue;
                }
                LineKind::Numbers if numbers.len() >= wanted => {}
                LineKind::Numbers | LineKind::Words => {
                    out.bad_lines += 1;
                    out.first_bad.get_or_insert(start);
                    continue;
                }
            }
            let three = |at: [usize; 3]| DVec3::from_array(at.map(|at| numbers[at]));
            let place = three(self.position);
            if self.has_holes && place == DVec3::ZERO {
                out.holes += 1;
                continue;
            }
            out.table.positions.push(pose.turn(place) + pose.rows[3]);
            if let Some(at) = self.normal {
                let normal: Vec3 = pose.turn(three(at)).as_vec3();
                out.table.normals.push(normal);
            }
            if let Some(at) = self.color {
                out.table.colors.push(at.map(|at| numbers[at] as f32));
            }
            for (column, &at) in columns.iter_mut().zip(&self.attributes) {
                column.push(numbers[at]);
            }
        }
        out.table.values = columns.into_iter().map(AttributeValues::of).collect();
        out
    }
}

/// The head of a scan in PTX.
struct PtxHead {
    points: u64,
    /// Registered place of the scanner.
    scanner: DVec3,
    pose: ScanPose,
    /// Offset of the first line of points.
    points_at: usize,
}

/// The head that begins at `at`; `None` where none does.
fn ptx_head(data: &[u8], at: usize) -> Option<PtxHead> {
    let end = data.len().min(at + 4096);
    let mut scanner = TextScanner::new(&data[..end], at);
    let mut rows: Vec<Vec<f64>> = Vec::new();
    while rows.len() < PTX_HEAD {
        let (line, _) = scanner.line()?;
        if line.trim_ascii().is_empty() {
            continue;
        }
        let row = super::super::text::words(line).map(super::super::text::parse_f64);
        rows.push(row.collect::<Option<Vec<f64>>>()?);
    }
    let lengths: Vec<usize> = rows.iter().map(Vec::len).collect();
    if lengths != [1, 1, 3, 3, 3, 3, 4, 4, 4, 4] {
        return None;
    }
    let count = |row: &[f64]| (row[0] >= 0.0 && row[0].fract() == 0.0).then_some(row[0] as u64);
    let three = |row: &[f64]| DVec3::new(row[0], row[1], row[2]);
    Some(PtxHead {
        points: count(&rows[0])?.saturating_mul(count(&rows[1])?),
        scanner: three(&rows[2]),
        pose: ScanPose {
            rows: [6, 7, 8, 9].map(|row: usize| three(&rows[row])),
        },
        points_at: scanner.at,
    })
}

/// Reads scan after scan. One that promises more lines than are left is read as far as it goes.
fn read_ptx(
    job: &mut ReadJob<'_>,
    data: &[u8],
    plan: &TextPlan,
    sink: &mut CloudSink,
    state: &mut ReadState,
) -> Result<(), Error> {
    let mut at = 0;
    while let Some(head) = ptx_head(data, at) {
        let mut end = head.points_at;
        let mut lines = 0;
        while lines < head.points
            && let Some(length) = data[end..].iter().position(|&byte| byte == b'\n')
        {
            end += length + 1;
            lines += 1;
        }
        if lines < head.points {
            end = data.len();
        }
        let pose = head.pose;
        sink.scans += 1;
        let is_posed = pose.rows != ScanPose::NONE.rows;
        sink.posed += u64::from(is_posed);
        let (first, scanner) = (sink.positions.len(), head.scanner);
        let before = first as u64 + state.holes + state.bad_lines;
        read_lines(job, data, head.points_at..end, plan, pose, sink, state)?;
        // Coordinates that the file moves are around the scanner.
        let scanner = if is_posed { pose.rows[3] } else { scanner };
        (sink.scanners).push(sink.positions.len() - first, Some(scanner));
        let found = sink.positions.len() as u64 + state.holes + state.bad_lines - before;
        if found < head.points {
            job.warn(ReadWarning::CountContradicts {
                what: "points of a scan",
                promised: head.points,
                found,
            });
        }
        at = end;
    }
    let rest = data[at..].trim_ascii().len() as u64;
    job.warn_count(rest, |bytes| ReadWarning::TrailingBytes { bytes });
    Ok(())
}
