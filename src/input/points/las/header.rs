//! The public header of LAS and the variable records after it.

use super::super::super::coordinate_records::SYSTEM_USER;
use super::super::super::job::ReadJob;
use super::super::super::part::PartFate;
use super::super::super::{Error, FilePlace};
use super::super::{bytes_at, system_text, text_of};
use super::extra::ExtraField;

/// Size of the smallest header (LAS 1.0), of a variable record's head, and of an extended one's.
const SMALLEST_HEADER: usize = 227;
const RECORD_HEAD: usize = 54;
const EXTENDED_HEAD: usize = 60;

/// Most variable records that are looked at.
const MOST_RECORDS: u32 = 10_000;

/// How points are stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum PointPacking {
    None,
    /// The record of `laszip` that says how.
    LasZip {
        record: Vec<u8>,
        is_copc: bool,
    },
}

/// What the header says, held against the length of the file.
#[derive(Debug, Clone)]
pub(super) struct LasHeader {
    /// Offset of the first point record, at most the length of the file.
    pub(super) points_at: usize,
    /// Points by the header; believed by nobody.
    pub(super) points: u64,
    /// 0 to 10.
    pub(super) point_format: u8,
    /// Bytes of a point record, at least those of its format.
    pub(super) record_bytes: usize,
    pub(super) scale: [f64; 3],
    pub(super) offset: [f64; 3],
    pub(super) packing: PointPacking,
    /// Fields after those of the format.
    pub(super) extra: Vec<ExtraField>,
}

/// One variable record, extended or not.
struct VariableRecord<'a> {
    user: String,
    id: u16,
    body: &'a [u8],
}

/// Bytes of a record of each point format.
pub(super) const FORMAT_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

fn u16_at(data: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(data, at))
}

fn u32_at(data: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(data, at))
}

fn u64_at(data: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes_at(data, at))
}

fn f64_at(data: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes_at(data, at))
}

impl LasHeader {
    pub(super) fn parse(job: &mut ReadJob<'_>, data: &[u8]) -> Result<LasHeader, Error> {
        if data.len() < SMALLEST_HEADER {
            let missing = format!("a LAS header has {SMALLEST_HEADER} bytes");
            return Err(job.truncated(FilePlace::Byte(data.len() as u64), missing));
        }
        job.coordinate_records.see_encoding(u16_at(data, 6));
        let (major, minor) = (data[24], data[25]);
        if major != 1 || minor > 5 {
            let reason = format!("LAS version {major}.{minor} is not known (1.0 to 1.5 are)");
            return Err(job.syntax(FilePlace::Byte(24), reason));
        }
        let header_bytes = usize::from(u16_at(data, 94));
        if header_bytes < SMALLEST_HEADER || header_bytes > data.len() {
            let reason = format!("the header says that it has {header_bytes} bytes");
            return Err(job.syntax(FilePlace::Byte(94), reason));
        }
        let points_at = u32_at(data, 96) as usize;
        if points_at < header_bytes || points_at > data.len() {
            let reason = format!(
                "the points are said to begin at byte {points_at} of {}",
                data.len()
            );
            return Err(job.syntax(FilePlace::Byte(96), reason));
        }
        // The two highest bits are marks of packing.
        let point_format = data[104] & 0x3f;
        let is_packed = data[104] & 0xc0 != 0;
        let record_bytes = usize::from(u16_at(data, 105));
        let Some(&format_bytes) = FORMAT_BYTES.get(usize::from(point_format)) else {
            let reason = format!("point format {point_format} is not known (0 to 10 are)");
            return Err(job.syntax(FilePlace::Byte(104), reason));
        };
        if record_bytes < format_bytes {
            let reason = format!(
                "point records are said to have {record_bytes} bytes, format {point_format} has {format_bytes}"
            );
            return Err(job.syntax(FilePlace::Byte(105), reason));
        }
        let legacy = u64::from(u32_at(data, 107));
        let has_wide_count = minor >= 4 && header_bytes >= 255;
        let wide = if has_wide_count { u64_at(data, 247) } else { 0 };
        let points = if wide > 0 { wide } else { legacy };
        if points == 0 {
            return Err(job.empty("the file has no points"));
        }
        let three = |at: usize| [0, 8, 16].map(|step| f64_at(data, at + step));
        let (scale, offset) = (three(131), three(155));
        let is_bad = |value: &f64| !value.is_finite();
        if scale.iter().any(|value| is_bad(value) || *value == 0.0) || offset.iter().any(is_bad) {
            let reason =
                format!("the scale {scale:?} or the offset {offset:?} is no number of use");
            return Err(job.syntax(FilePlace::Byte(131), reason));
        }
        let version =
            format!("LAS 1.{minor}, point format {point_format}, {record_bytes} bytes a point");
        job.inventory.add("header", 1, PartFate::Used, version);
        let mut header = LasHeader {
            points_at,
            points,
            point_format,
            record_bytes,
            scale,
            offset,
            packing: PointPacking::None,
            extra: Vec::new(),
        };
        header.read_records(job, data, header_bytes);
        if minor >= 4 && header_bytes >= 247 {
            header.read_extended_records(job, data);
        }
        if !is_packed {
            header.packing = PointPacking::None;
        } else if header.packing == PointPacking::None {
            let reason = "the points are packed, but no `laszip encoded` record says how";
            return Err(job.syntax(FilePlace::Byte(104), reason));
        }
        let extra_bytes = record_bytes - format_bytes;
        header.extra = ExtraField::placed(header.extra, format_bytes, record_bytes);
        let described: usize = header.extra.iter().map(ExtraField::bytes).sum();
        let left = extra_bytes.saturating_sub(described) as u64;
        let note = "no record describes them";
        job.inventory
            .add_some("further bytes of a point", left, PartFate::LeftOut, note);
        Ok(header)
    }

    /// Walks the variable records between header and points; stops where they do not fit.
    fn read_records(&mut self, job: &mut ReadJob<'_>, data: &[u8], start: usize) {
        let mut at = start;
        for _ in 0..u32_at(data, 100).min(MOST_RECORDS) {
            let Some(head) = data[..self.points_at].get(at..at + RECORD_HEAD) else {
                break;
            };
            let body_at = at + RECORD_HEAD;
            let length = usize::from(u16_at(head, 20));
            let Some(body) = data[..self.points_at].get(body_at..body_at + length) else {
                break;
            };
            let user = text_of(&head[2..18]);
            let id = u16_at(head, 18);
            self.see(job, &VariableRecord { user, id, body });
            at = body_at + length;
        }
    }

    /// Walks the extended records at the end of the file.
    fn read_extended_records(&mut self, job: &mut ReadJob<'_>, data: &[u8]) {
        let Ok(mut at) = usize::try_from(u64_at(data, 235)) else {
            return;
        };
        if at < self.points_at {
            return;
        }
        for _ in 0..u32_at(data, 243).min(MOST_RECORDS) {
            let rest = data.get(at..).unwrap_or(&[]);
            if rest.len() < EXTENDED_HEAD {
                break;
            }
            let (head, rest) = rest.split_at(EXTENDED_HEAD);
            let Some(body) = usize::try_from(u64_at(head, 20))
                .ok()
                .and_then(|length| rest.get(..length))
            else {
                break;
            };
            let user = text_of(&head[2..18]);
            let id = u16_at(head, 18);
            self.see(job, &VariableRecord { user, id, body });
            at += EXTENDED_HEAD + body.len();
        }
    }

    fn see(&mut self, job: &mut ReadJob<'_>, record: &VariableRecord<'_>) {
        (job.coordinate_records).take(&record.user, record.id, record.body);
        let mut list = |what: &str, fate, note: String| {
            job.inventory
                .add(what, record.body.len() as u64, fate, note);
        };
        match (record.user.as_str(), record.id) {
            ("laszip encoded", 22204) => {
                let is_copc = matches!(self.packing, PointPacking::LasZip { is_copc: true, .. });
                self.packing = PointPacking::LasZip {
                    record: record.body.to_owned(),
                    is_copc,
                };
                list("record laszip encoded", PartFate::Used, String::new());
            }
            ("copc", 1) => {
                self.packing = PointPacking::LasZip {
                    record: match &self.packing {
                        PointPacking::LasZip { record, .. } => record.clone(),
                        PointPacking::None => Vec::new(),
                    },
                    is_copc: true,
                };
                list("record copc", PartFate::Unneeded, String::new());
            }
            ("LASF_Spec", 4) => {
                self.extra
                    .extend(record.body.chunks_exact(192).map(ExtraField::of));
                list("record of extra bytes", PartFate::Used, String::new());
            }
            (SYSTEM_USER, 2112) => {
                let text = system_text(record.body);
                list("coordinate system", PartFate::Unneeded, text);
            }
            (SYSTEM_USER, 34737) => {
                let text: Vec<u8> = record
                    .body
                    .iter()
                    .map(|&b| if b == b'|' { b' ' } else { b })
                    .collect();
                list("coordinate system", PartFate::Unneeded, system_text(&text));
            }
            (user, id) => {
                let name = format!("record {user} {id}");
                list(&name, PartFate::Unneeded, String::new());
            }
        }
    }
}
