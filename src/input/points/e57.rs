//! E57, the exchange format of terrestrial scanners (ASTM E2807): several scans in one file, each with its pose.
//!
//! The crate `e57` reads packets and the description; values come raw from it and are interpreted here, so that intensities
//! stay what they are and poses are applied in double precision. Scans are read side by side.

use std::io::Cursor;

use e57::{E57Reader, PointCloud, RawValues, Record, RecordDataType, RecordName, RecordValue};
use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

use super::super::assemble::RawMesh;
use super::super::color::ColorRange;
use super::super::job::ReadJob;
use super::super::part::PartFate;
use super::super::text::shown;
use super::super::{Error, FilePlace, Format, ReadWarning};
use super::guard::guarded;
use super::roles::{ColumnRole, attribute_name, kind_of, role_of_name};
use super::sink::{CloudSink, TableBlock};
use super::{FREE_BYTES, LARGEST_RATIO, bytes_at, system_text};
use crate::mesh::attributes::{AttributeColumn, AttributeValues, NumberType};
use crate::progress::Progress;

/// Points between two looks at the progress.
const STEP: usize = 1 << 16;

/// The values of a point that a record of the description holds.
#[derive(Debug, Clone)]
struct ValueSource {
    at: usize,
    kind: RecordDataType,
}

impl ValueSource {
    #[inline]
    fn get(&self, values: &RawValues) -> f64 {
        match (values.get(self.at), &self.kind) {
            (Some(RecordValue::Single(value)), _) => f64::from(*value),
            (Some(RecordValue::Double(value)), _) => *value,
            (
                Some(RecordValue::ScaledInteger(value)),
                RecordDataType::ScaledInteger { scale, offset, .. },
            ) => *value as f64 * scale + offset,
            (Some(RecordValue::Integer(value) | RecordValue::ScaledInteger(value)), _) => {
                *value as f64
            }
            (None, _) => f64::NAN,
        }
    }
}

/// A channel of a color and its range in the file.
#[derive(Debug, Clone)]
struct ColorSource {
    value: ValueSource,
    low: f64,
    high: f64,
}

/// Where the parts of a point of a scan are.
#[derive(Debug)]
struct ScanPlan {
    /// Cartesian, or else range, azimuth and elevation.
    position: [ValueSource; 3],
    is_spherical: bool,
    invalid: Option<ValueSource>,
    normal: Option<[ValueSource; 3]>,
    color: Option<[ColorSource; 3]>,
    color_invalid: Option<ValueSource>,
    /// Columns of the sink.
    columns: usize,
    /// The attribute of each column of the sink, where the scan has it; not of the one that numbers the scans.
    attributes: Vec<Option<ValueSource>>,
    intensity_column: Option<usize>,
    intensity_invalid: Option<ValueSource>,
    turn: DQuat,
    shift: DVec3,
}

/// What came out of a scan.
#[derive(Default)]
struct ScanBlock {
    table: TableBlock,
    /// The columns of the sink, while they grow.
    columns: Vec<Vec<f64>>,
    holes: u64,
    read: u64,
    failure: Option<String>,
}

/// Reads an E57 file.
pub(in super::super) fn read(
    job: &mut ReadJob<'_>,
    data: &[u8],
) -> Result<(Format, RawMesh), Error> {
    check_header(job, data)?;
    let open = || E57Reader::new(Cursor::new(data)).map_err(|error| error.to_string());
    let reader = guarded(open).map_err(|reason| job.syntax(FilePlace::Byte(0), short(&reason)))?;
    let scans = reader.pointclouds();
    if scans.is_empty() {
        return Err(job.empty("the file has no scans"));
    }
    list_others(job, &reader);
    let columns = columns_of(&scans);
    let mut plans = Vec::new();
    for (index, scan) in scans.iter().enumerate() {
        let plan = ScanPlan::of(scan, &columns, scans.len() > 1).map_err(|reason| {
            job.syntax(
                FilePlace::Byte(scan.file_offset),
                format!("scan {index}: {reason}"),
            )
        })?;
        plans.push(plan);
    }
    let mut sink = CloudSink::new(columns, ColorRange::BYTE);
    let blocks = read_scans(job.progress, data, &scans, &plans);
    job.skip_to(data.len());
    job.report(data.len())?;
    let has_colors = plans.iter().any(|plan| plan.color.is_some());
    let has_normals = plans.iter().any(|plan| plan.normal.is_some());
    for (index, mut block) in blocks.into_iter().enumerate() {
        let (scan, plan) = (&scans[index], &plans[index]);
        let name = scan.name.as_deref().unwrap_or("");
        let moved = if plan.is_posed() {
            ", moved to its pose"
        } else {
            ""
        };
        let note = format!("{}{moved}", shown(name.as_bytes()));
        job.inventory
            .add(format!("scan {index}"), block.read, PartFate::Used, note);
        sink.scans += 1;
        sink.posed += u64::from(plan.is_posed());
        sink.points += block.read;
        sink.holes += block.holes;
        if let Some(reason) = block.failure.take() {
            if block.read == 0 && scans.len() == 1 {
                return Err(job.syntax(FilePlace::Byte(scan.file_offset), short(&reason)));
            }
            let parts = vec![format!("the rest of scan {index} ({})", short(&reason))];
            job.warn(ReadWarning::LeftOut { parts });
        }
        if block.read < scan.records {
            job.warn(ReadWarning::CountContradicts {
                what: "points of a scan",
                promised: scan.records,
                found: block.read,
            });
        }
        let points = block.table.positions.len();
        block
            .table
            .colors
            .resize(if has_colors { points } else { 0 }, [255.0; 3]);
        block
            .table
            .normals
            .resize(if has_normals { points } else { 0 }, Vec3::ZERO);
        // A scanner measures angles around itself; places alone may have been moved by whoever wrote the file.
        let is_placed = plan.is_posed() || plan.is_spherical;
        sink.scanners.push(points, is_placed.then_some(plan.shift));
        sink.append(block.table);
    }
    Ok((Format::E57, sink.finish(job)?))
}

/// Holds the lengths in the header against the file: memory for the description is asked for by them.
fn check_header(job: &ReadJob<'_>, data: &[u8]) -> Result<(), Error> {
    let number = |at| u64::from_le_bytes(bytes_at(data, at));
    let (xml_at, xml_bytes) = (number(24), number(32));
    let end = xml_at.checked_add(xml_bytes);
    if data.len() < 48 || end.is_none_or(|end| end > data.len() as u64) {
        let missing = format!("the description of {xml_bytes} bytes at byte {xml_at}");
        return Err(job.truncated(FilePlace::Byte(data.len() as u64), missing));
    }
    Ok(())
}

/// The first line of what the crate says, at most 200 characters.
fn short(reason: &str) -> String {
    let line = reason.lines().next().unwrap_or("");
    line.chars().take(200).collect()
}

fn list_others(job: &mut ReadJob<'_>, reader: &E57Reader<Cursor<&[u8]>>) {
    let images = reader.images().len() as u64;
    job.inventory
        .add_some("pictures", images, PartFate::Unneeded, "");
    if let Some(text) = reader.coordinate_metadata().filter(|text| !text.is_empty()) {
        let note = system_text(text.as_bytes());
        job.inventory
            .add("coordinate system", 1, PartFate::Unneeded, note);
    }
}

/// The name under which a record is kept; `None` for those that are something else.
fn kept_name(name: &RecordName) -> Option<String> {
    match name {
        RecordName::Intensity => Some("intensity".to_owned()),
        RecordName::RowIndex => Some("row".to_owned()),
        RecordName::ColumnIndex => Some("column".to_owned()),
        RecordName::ReturnIndex => Some("return".to_owned()),
        RecordName::ReturnCount => Some("returns".to_owned()),
        RecordName::TimeStamp => Some("time".to_owned()),
        RecordName::Unknown { name, .. } => match role_of_name(name) {
            ColumnRole::Normal(_) => None,
            _ => Some(attribute_name(name)),
        },
        _ => None,
    }
}

/// The attributes of all scans; of several scans, also which one a point is of.
fn columns_of(scans: &[PointCloud]) -> Vec<AttributeColumn> {
    let mut columns: Vec<AttributeColumn> = Vec::new();
    let records = scans.iter().flat_map(|scan| &scan.prototype);
    for name in records.filter_map(|record| kept_name(&record.name)) {
        if columns.iter().all(|column| column.name != name) {
            let kind = kind_of(&name);
            columns.push(AttributeColumn::new(name, kind, NumberType::F64));
        }
    }
    if scans.len() > 1 {
        let kind = crate::mesh::attributes::AttributeKind::Category;
        columns.push(AttributeColumn::new("scan", kind, NumberType::F64));
    }
    columns
}

/// Reads all scans, as many at a time as there are threads, each by a reader of its own.
fn read_scans(
    progress: &dyn Progress,
    data: &[u8],
    scans: &[PointCloud],
    plans: &[ScanPlan],
) -> Vec<ScanBlock> {
    let groups = rayon::current_num_threads().max(1);
    let total: u64 = scans
        .iter()
        .map(|scan| scan.records)
        .fold(0, u64::saturating_add)
        .max(1);
    let bytes_a_point = data.len() as f64 / total as f64;
    let group_size = scans.len().div_ceil(groups);
    scans
        .par_chunks(group_size)
        .enumerate()
        .flat_map_iter(|(group, members)| {
            let mut reader =
                guarded(|| E57Reader::new(Cursor::new(data)).map_err(|e| e.to_string()));
            members.iter().enumerate().map(move |(member, scan)| {
                let index = group * group_size + member;
                let mut out = ScanBlock {
                    columns: vec![Vec::new(); plans[index].columns],
                    ..ScanBlock::default()
                };
                let result = match &mut reader {
                    Err(reason) => Err(reason.clone()),
                    Ok(reader) => guarded(|| {
                        let cap = (data.len() as u64 * LARGEST_RATIO).max(FREE_BYTES);
                        read_scan(
                            progress,
                            reader,
                            scan,
                            &plans[index],
                            cap,
                            bytes_a_point,
                            index,
                            &mut out,
                        )
                    }),
                };
                out.failure = result.err();
                let columns = std::mem::take(&mut out.columns);
                out.table.values = columns.into_iter().map(AttributeValues::of).collect();
                out
            })
        })
        .collect()
}

#[allow(
    clippy::too_many_arguments,
    reason = "one caller; all of them differ in type"
)]
fn read_scan(
    progress: &dyn Progress,
    reader: &mut E57Reader<Cursor<&[u8]>>,
    scan: &PointCloud,
    plan: &ScanPlan,
    cap: u64,
    bytes_a_point: f64,
    index: usize,
    out: &mut ScanBlock,
) -> Result<(), String> {
    let points = reader
        .pointcloud_raw(scan)
        .map_err(|error| error.to_string())?;
    let mut result = Ok(());
    let point_bytes = (48 + 8 * plan.columns) as u64;
    for values in points {
        match values {
            Ok(values) => plan.push(&values, index, out),
            Err(error) => {
                result = Err(error.to_string());
                break;
            }
        }
        out.read += 1;
        if (out.read as usize).is_multiple_of(STEP) {
            progress.advance((bytes_a_point * STEP as f64) as u64);
            if progress.is_cancelled() {
                break;
            }
        }
        if out.read.saturating_mul(point_bytes) > cap {
            result = Err("it unpacks to more than any scan does".to_owned());
            break;
        }
    }
    result
}

impl ScanPlan {
    fn of(scan: &PointCloud, columns: &[AttributeColumn], has_scan: bool) -> Result<Self, String> {
        let find = |wanted: &dyn Fn(&RecordName) -> bool| {
            let at = scan
                .prototype
                .iter()
                .position(|record: &Record| wanted(&record.name))?;
            let kind = scan.prototype[at].data_type.clone();
            Some(ValueSource { at, kind })
        };
        let named = |name: RecordName| find(&|other| *other == name);
        let all = |[a, b, c]: [Option<ValueSource>; 3]| Some([a?, b?, c?]);
        let cartesian = all([
            named(RecordName::CartesianX),
            named(RecordName::CartesianY),
            named(RecordName::CartesianZ),
        ]);
        let spherical = all([
            named(RecordName::SphericalRange),
            named(RecordName::SphericalAzimuth),
            named(RecordName::SphericalElevation),
        ]);
        let is_spherical = cartesian.is_none();
        let position = cartesian.or(spherical).ok_or("it has no coordinates")?;
        // Records of no bits say nothing of how many there are: with nothing else, there would be no end.
        let has_bits = |record: &Record| match record.data_type {
            RecordDataType::Integer { min, max }
            | RecordDataType::ScaledInteger { min, max, .. } => min != max,
            _ => true,
        };
        if !scan.prototype.iter().any(has_bits) {
            return Err("all its values are of no bits".to_owned());
        }
        let normal = |axis: usize| {
            find(&|name| match name {
                RecordName::Unknown { name, .. } => role_of_name(name) == ColumnRole::Normal(axis),
                _ => false,
            })
        };
        let kept = |column: &AttributeColumn| {
            find(&|name| kept_name(name).as_deref() == Some(column.name.as_str()))
        };
        let mut attributes: Vec<Option<ValueSource>> = columns.iter().map(kept).collect();
        if has_scan {
            // The last column is the number of the scan.
            attributes.pop();
        }
        let pose = scan.transform.clone().unwrap_or_default();
        let turn = &pose.rotation;
        let turn = DQuat::from_xyzw(turn.x, turn.y, turn.z, turn.w);
        let shift = DVec3::new(pose.translation.x, pose.translation.y, pose.translation.z);
        let length = turn.length();
        if !(length.is_finite() && length > 0.0 && shift.is_finite()) {
            return Err("its pose is no place and turn".to_owned());
        }
        Ok(Self {
            position,
            is_spherical,
            invalid: named(if is_spherical {
                RecordName::SphericalInvalidState
            } else {
                RecordName::CartesianInvalidState
            }),
            normal: all([normal(0), normal(1), normal(2)]),
            color: color_of(scan, &named),
            color_invalid: named(RecordName::IsColorInvalid),
            intensity_column: columns.iter().position(|column| column.name == "intensity"),
            intensity_invalid: named(RecordName::IsIntensityInvalid),
            columns: columns.len(),
            attributes,
            turn: turn / length,
            shift,
        })
    }

    fn is_posed(&self) -> bool {
        self.turn != DQuat::IDENTITY || self.shift != DVec3::ZERO
    }

    fn push(&self, values: &RawValues, scan: usize, out: &mut ScanBlock) {
        let is_marked = |source: &Option<ValueSource>| {
            source
                .as_ref()
                .is_some_and(|source| source.get(values) != 0.0)
        };
        let three = |sources: &[ValueSource; 3]| {
            DVec3::new(
                sources[0].get(values),
                sources[1].get(values),
                sources[2].get(values),
            )
        };
        let place = three(&self.position);
        if is_marked(&self.invalid) || !place.is_finite() {
            out.holes += 1;
            return;
        }
        let place = if self.is_spherical {
            let (azimuth, elevation) = (place.y.sin_cos(), place.z.sin_cos());
            place.x
                * DVec3::new(
                    elevation.1 * azimuth.1,
                    elevation.1 * azimuth.0,
                    elevation.0,
                )
        } else {
            place
        };
        let table = &mut out.table;
        table.positions.push(if self.is_posed() {
            self.turn * place + self.shift
        } else {
            place
        });
        if let Some(normal) = &self.normal {
            table.normals.push((self.turn * three(normal)).as_vec3());
        }
        if let Some(color) = &self.color {
            let byte = |source: &ColorSource| {
                let unit = (source.value.get(values) - source.low) / (source.high - source.low);
                (unit.clamp(0.0, 1.0) * 255.0) as f32
            };
            let color = if is_marked(&self.color_invalid) {
                [255.0; 3]
            } else {
                [byte(&color[0]), byte(&color[1]), byte(&color[2])]
            };
            table.colors.push(color);
        }
        let columns = &mut out.columns;
        for (column, source) in columns.iter_mut().zip(&self.attributes) {
            column.push(
                source
                    .as_ref()
                    .map_or(f64::NAN, |source| source.get(values)),
            );
        }
        if let Some(at) = self.intensity_column
            && is_marked(&self.intensity_invalid)
            && let Some(last) = columns.get_mut(at).and_then(|column| column.last_mut())
        {
            *last = f64::NAN;
        }
        if let Some(column) = columns.get_mut(self.attributes.len()) {
            column.push(scan as f64);
        }
    }
}

/// The channels of the color and their ranges: by the limits of the scan, else by the range of the values.
fn color_of(
    scan: &PointCloud,
    named: &dyn Fn(RecordName) -> Option<ValueSource>,
) -> Option<[ColorSource; 3]> {
    let limits = scan.color_limits.as_ref();
    let channel = |name, low: Option<&RecordValue>, high: Option<&RecordValue>| {
        let value = named(name)?;
        let by_type = match value.kind {
            RecordDataType::Integer { min, max } => [min as f64, max as f64],
            RecordDataType::ScaledInteger {
                min,
                max,
                scale,
                offset,
            } => [min, max].map(|value| value as f64 * scale + offset),
            RecordDataType::Single { min, max } => {
                [min, max].map(|value| value.map_or(f64::NAN, f64::from))
            }
            RecordDataType::Double { min, max } => {
                [min, max].map(|value| value.unwrap_or(f64::NAN))
            }
        };
        let number = |limit: Option<&RecordValue>| {
            Some(
                ValueSource {
                    at: 0,
                    kind: value.kind.clone(),
                }
                .get(&vec![limit?.clone()]),
            )
        };
        let low = number(low).unwrap_or(by_type[0]);
        let high = number(high).unwrap_or(by_type[1]);
        // Ranges beyond 16 bits are the type's own, and say nothing.
        let is_usable = low.is_finite() && high > low && high - low <= 65536.0;
        let (low, high) = if is_usable { (low, high) } else { (0.0, 255.0) };
        Some(ColorSource { value, low, high })
    };
    Some([
        channel(
            RecordName::ColorRed,
            limits.and_then(|limits| limits.red_min.as_ref()),
            limits.and_then(|limits| limits.red_max.as_ref()),
        )?,
        channel(
            RecordName::ColorGreen,
            limits.and_then(|limits| limits.green_min.as_ref()),
            limits.and_then(|limits| limits.green_max.as_ref()),
        )?,
        channel(
            RecordName::ColorBlue,
            limits.and_then(|limits| limits.blue_min.as_ref()),
            limits.and_then(|limits| limits.blue_max.as_ref()),
        )?,
    ])
}
