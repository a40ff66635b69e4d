//! Writes clouds as LAS 1.4, packed (LAZ) or not.
//!
//! Point formats 0 to 3 where all values fit them, else 6 to 8. What the format has no place for becomes extra bytes. Colors
//! have the 8 bits that a cloud keeps, spread over 16.

use std::io::{self, Seek, Write};

use glam::DVec3;
use laz::laszip::LasZipCompressor;
use laz::{LazVlr, LazVlrBuilder};

use super::header::FORMAT_BYTES;
use crate::input::coordinate_records::{CoordinateRecords, SYSTEM_USER, TEXT_BIT};
use crate::mesh::Mesh;
use crate::mesh::attributes::{AttributeColumn, CoordinateGrid, NumberType, PointAttributes};

const HEADER_BYTES: usize = 375;
const RECORD_HEAD_BYTES: usize = 54;
const EXTRA_BYTES: usize = 192;

/// Records between two calls of the compressor.
const BLOCK: usize = 1 << 14;

/// Names of attributes that have a place in point records.
const PLACED: [&str; 13] = [
    "intensity",
    "return",
    "returns",
    "scan_direction",
    "edge_of_line",
    "class",
    "class_flags",
    "scanner_channel",
    "scan_angle",
    "user_data",
    "point_source",
    "time",
    "infrared",
];

/// Where the values of a cloud go in a record.
struct RecordPlan<'a> {
    mesh: &'a Mesh,
    /// In the order of [`PLACED`].
    placed: [Option<&'a AttributeColumn>; 13],
    extra: Vec<&'a AttributeColumn>,
    format: u8,
    bytes: usize,
    grid: CoordinateGrid,
    /// Records of the coordinate system.
    system: Vec<(u16, &'a [u8])>,
}

/// Writes all points of a cloud; the attributes are in their order. Returns whether the coordinate system is in the file.
///
/// # Errors
/// When the stream fails; coordinates too far apart for their step, or too many attributes, which is
/// [`io::ErrorKind::InvalidInput`].
pub(crate) fn write<W: Write + Seek + Send + Sync>(
    (mesh, attributes): (&Mesh, &PointAttributes),
    system: &CoordinateRecords,
    is_packed: bool,
    out: &mut W,
) -> io::Result<bool> {
    let mut plan = RecordPlan::of(mesh, attributes)?;
    plan.system = system.for_format(plan.format);
    let packing = is_packed
        .then(|| plan.packing())
        .transpose()
        .map_err(io::Error::other)?;
    let head = plan.head(packing.as_ref())?;
    out.write_all(&head)?;
    let mut block = Vec::with_capacity(BLOCK * plan.bytes);
    let count = mesh.positions.len();
    let mut packer = match packing {
        Some(packing) => RecordPacker::Laz(Box::new(
            LasZipCompressor::new(out, packing).map_err(io::Error::other)?,
        )),
        None => RecordPacker::Plain(out),
    };
    for first in (0..count).step_by(BLOCK) {
        block.clear();
        for index in first..(first + BLOCK).min(count) {
            plan.push(index, &mut block);
        }
        match &mut packer {
            RecordPacker::Plain(out) => out.write_all(&block)?,
            RecordPacker::Laz(packer) => packer.compress_many(&block)?,
        }
    }
    match &mut packer {
        RecordPacker::Plain(out) => out.flush()?,
        RecordPacker::Laz(packer) => packer.done()?,
    }
    Ok(!plan.system.is_empty())
}

enum RecordPacker<'a, W: Write + Seek + Send + Sync> {
    Plain(&'a mut W),
    Laz(Box<LasZipCompressor<'a, &'a mut W>>),
}

fn refused(cause: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, cause.into())
}

/// World position of a point.
fn place(mesh: &Mesh, index: usize) -> DVec3 {
    mesh.origin + mesh.positions[index].as_dvec3()
}

/// A grid for coordinates without one: a power of ten that single precision reaches.
fn grid_of(mesh: &Mesh) -> CoordinateGrid {
    let reach = mesh
        .positions
        .iter()
        .fold(0.0_f32, |most, place| most.max(place.abs().max_element()));
    let unit = f64::from(reach) * f64::from(f32::EPSILON);
    let step = if unit > 0.0 {
        10f64.powf(unit.log10().floor())
    } else {
        1e-3
    };
    CoordinateGrid {
        step: DVec3::splat(step),
        offset: mesh.origin,
    }
}

impl<'a> RecordPlan<'a> {
    fn of(mesh: &'a Mesh, attributes: &'a PointAttributes) -> io::Result<Self> {
        let placed = PLACED.map(|name| attributes.find(name));
        let is_placed = |column: &&AttributeColumn| {
            PLACED
                .iter()
                .any(|name| column.name.eq_ignore_ascii_case(name))
        };
        let extra: Vec<_> = attributes
            .columns
            .iter()
            .filter(|column| !is_placed(column))
            .collect();
        let grid = attributes.grid.unwrap_or_else(|| grid_of(mesh));
        let mut plan = Self {
            mesh,
            placed,
            extra,
            format: 0,
            bytes: 0,
            grid,
            system: Vec::new(),
        };
        plan.format = plan.format();
        let own = plan
            .extra
            .iter()
            .map(|column| column.values.number().bytes());
        plan.bytes = FORMAT_BYTES[usize::from(plan.format)] + own.sum::<usize>();
        if plan.bytes > usize::from(u16::MAX) || plan.extra.len() > 300 {
            return Err(refused(
                "more attributes than a LAS record has room for; write .ply",
            ));
        }
        let limit = f64::from(i32::MAX);
        let fits = |index| grid.steps(place(mesh, index)).abs().max_element() <= limit;
        if !(0..mesh.positions.len()).all(fits) {
            return Err(refused(format!(
                "coordinates too far apart for steps of {}; write .ply",
                grid.step.max_element()
            )));
        }
        Ok(plan)
    }

    /// The column of a name of [`PLACED`].
    fn column(&self, name: &str) -> Option<&'a AttributeColumn> {
        let at = PLACED.iter().position(|placed| *placed == name)?;
        self.placed[at]
    }

    fn value(&self, name: &str, index: usize) -> f64 {
        let column = self.column(name);
        column.and_then(|column| column.value(index)).unwrap_or(0.0)
    }

    /// The smallest point format that holds everything.
    fn format(&self) -> u8 {
        let exceeds = |name: &str, most: f64| {
            let range = self.column(name).and_then(AttributeColumn::range);
            range.is_some_and(|[low, high]| low < 0.0 || high > most)
        };
        let is_angle_fine = self.column("scan_angle").is_some_and(|column| {
            let is_whole = |index| {
                let value = column.value(index).unwrap_or(0.0);
                value.fract() == 0.0 && (-128.0..=127.0).contains(&value)
            };
            !(0..self.mesh.positions.len()).all(is_whole)
        });
        let is_wide = exceeds("return", 7.0)
            || exceeds("returns", 7.0)
            || exceeds("class", 31.0)
            || exceeds("class_flags", 7.0)
            || exceeds("scanner_channel", 0.0)
            || self.column("infrared").is_some()
            || is_angle_fine;
        let has_color = !self.mesh.colors.is_empty();
        match (is_wide, has_color) {
            (true, _) if self.column("infrared").is_some() => 8,
            (true, has_color) => 6 + u8::from(has_color),
            (false, has_color) => u8::from(self.column("time").is_some()) + 2 * u8::from(has_color),
        }
    }

    fn packing(&self) -> laz::Result<LazVlr> {
        let extra = self.bytes - FORMAT_BYTES[usize::from(self.format)];
        let builder = LazVlrBuilder::default().with_point_format(self.format, extra as u16)?;
        Ok(builder.build())
    }

    /// Appends the record of a point. Values that a field cannot hold become the nearest that it can.
    fn push(&self, index: usize, out: &mut Vec<u8>) {
        let value = |name: &str| self.value(name, index);
        let byte = |name: &str, most: u8| (value(name) as u8).min(most);
        let or_one = |name: &str, most: u8| match self.column(name) {
            Some(_) => byte(name, most),
            None => 1,
        };
        for steps in self.grid.steps(place(self.mesh, index)).to_array() {
            out.extend((steps as i32).to_le_bytes());
        }
        out.extend((value("intensity") as u16).to_le_bytes());
        let edges = byte("scan_direction", 1) << 6 | byte("edge_of_line", 1) << 7;
        if self.format < 6 {
            out.push(or_one("return", 7) | or_one("returns", 7) << 3 | edges);
            out.push(byte("class", 31) | byte("class_flags", 7) << 5);
            out.push((value("scan_angle") as i8).to_le_bytes()[0]);
            out.push(byte("user_data", u8::MAX));
        } else {
            out.push(or_one("return", 15) | or_one("returns", 15) << 4);
            out.push(byte("class_flags", 15) | byte("scanner_channel", 3) << 4 | edges);
            out.push(byte("class", u8::MAX));
            out.push(byte("user_data", u8::MAX));
            // Steps of 0.006 degrees (LAS 1.4, table 14).
            out.extend(((value("scan_angle") / 0.006).round() as i16).to_le_bytes());
        }
        out.extend((value("point_source") as u16).to_le_bytes());
        if self.format >= 6 || matches!(self.format, 1 | 3) {
            out.extend(value("time").to_le_bytes());
        }
        if matches!(self.format, 2 | 3 | 7 | 8) {
            let [red, green, blue, _] = self.mesh.colors.get(index).copied().unwrap_or_default();
            for channel in [red, green, blue] {
                out.extend((u16::from(channel) * 257).to_le_bytes());
            }
        }
        if self.format == 8 {
            out.extend((value("infrared") as u16).to_le_bytes());
        }
        for column in &self.extra {
            let stored = column.values.get(index).unwrap_or(0.0);
            match column.values.number() {
                NumberType::U8 => out.extend((stored as u8).to_le_bytes()),
                NumberType::I8 => out.extend((stored as i8).to_le_bytes()),
                NumberType::U16 => out.extend((stored as u16).to_le_bytes()),
                NumberType::I16 => out.extend((stored as i16).to_le_bytes()),
                NumberType::U32 => out.extend((stored as u32).to_le_bytes()),
                NumberType::I32 => out.extend((stored as i32).to_le_bytes()),
                NumberType::F32 => out.extend((stored as f32).to_le_bytes()),
                NumberType::F64 => out.extend(stored.to_le_bytes()),
            }
        }
    }

    /// Number of points of each return, from the first on.
    fn points_by_return(&self) -> [u64; 15] {
        let mut by_return = [0; 15];
        let returns = self.column("return");
        for index in 0..self.mesh.positions.len() {
            let number = returns.map_or(1.0, |_| self.value("return", index));
            if let Some(count) = by_return.get_mut((number as usize).wrapping_sub(1)) {
                *count += 1;
            }
        }
        by_return
    }

    /// Header and variable records.
    fn head(&self, packing: Option<&LazVlr>) -> io::Result<Vec<u8>> {
        let mut records: Vec<u8> = Vec::new();
        let mut count = 0_u32;
        let mut add = |user: &str, id: u16, body: &[u8]| {
            let mut head = [0; RECORD_HEAD_BYTES];
            head[2..2 + user.len()].copy_from_slice(user.as_bytes());
            head[18..20].copy_from_slice(&id.to_le_bytes());
            head[20..22].copy_from_slice(&(body.len() as u16).to_le_bytes());
            records.extend(head);
            records.extend(body);
            count += 1;
        };
        for (id, body) in &self.system {
            add(SYSTEM_USER, *id, body);
        }
        if !self.extra.is_empty() {
            let body: Vec<u8> = self
                .extra
                .iter()
                .flat_map(|column| extra_record(column))
                .collect();
            add("LASF_Spec", 4, &body);
        }
        if let Some(packing) = packing {
            let mut body = Vec::new();
            packing.write_to(&mut body)?;
            add("laszip encoded", 22204, &body);
        }
        let points = self.mesh.positions.len() as u64;
        let by_return = self.points_by_return();
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for index in 0..self.mesh.positions.len() {
            let place = self.grid.nearest(place(self.mesh, index));
            (low, high) = (low.min(place), high.max(place));
        }
        let mut head = Vec::with_capacity(HEADER_BYTES + records.len());
        head.extend(b"LASF\0\0");
        // Formats from 6 on must say that their coordinate systems are texts.
        let is_text = self.format >= 6 || CoordinateRecords::are_text(&self.system);
        head.extend((if is_text { TEXT_BIT } else { 0 }).to_le_bytes());
        head.extend([0; 16]);
        head.extend([1, 4]);
        head.extend(padded::<32>("EXTRACTION"));
        head.extend(padded::<32>(concat!("surfel ", env!("CARGO_PKG_VERSION"))));
        head.extend([0; 4]);
        head.extend((HEADER_BYTES as u16).to_le_bytes());
        head.extend(((HEADER_BYTES + records.len()) as u32).to_le_bytes());
        head.extend(count.to_le_bytes());
        head.push(self.format | if packing.is_some() { 0x80 } else { 0 });
        head.extend((self.bytes as u16).to_le_bytes());
        let legacy = |count: u64| match u32::try_from(count) {
            Ok(count) if self.format < 6 => count,
            _ => 0,
        };
        head.extend(legacy(points).to_le_bytes());
        for count in &by_return[..5] {
            head.extend(legacy(*count).to_le_bytes());
        }
        for vector in [self.grid.step, self.grid.offset] {
            head.extend(vector.to_array().into_iter().flat_map(f64::to_le_bytes));
        }
        for axis in 0..3 {
            head.extend(high[axis].to_le_bytes());
            head.extend(low[axis].to_le_bytes());
        }
        head.extend([0; 20]);
        head.extend(points.to_le_bytes());
        for count in by_return {
            head.extend(count.to_le_bytes());
        }
        debug_assert_eq!(head.len(), HEADER_BYTES);
        head.extend(records);
        Ok(head)
    }
}

/// A text in a field of fixed size.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    // The last byte stays zero.
    for (to, from) in field[..N - 1].iter_mut().zip(text.bytes()) {
        *to = from;
    }
    field
}

/// The description of an extra field (LAS 1.4, table 24).
fn extra_record(column: &AttributeColumn) -> [u8; EXTRA_BYTES] {
    let mut record = [0; EXTRA_BYTES];
    record[2] = match column.values.number() {
        NumberType::U8 => 1,
        NumberType::I8 => 2,
        NumberType::U16 => 3,
        NumberType::I16 => 4,
        NumberType::U32 => 5,
        NumberType::I32 => 6,
        NumberType::F32 => 9,
        NumberType::F64 => 10,
    };
    record[4..36].copy_from_slice(&padded::<32>(&column.name));
    if (column.scale, column.offset) != (1.0, 0.0) {
        record[3] = 8 | 16;
        record[112..120].copy_from_slice(&column.scale.to_le_bytes());
        record[136..144].copy_from_slice(&column.offset.to_le_bytes());
    }
    record
}
