//! Fields of LAS point records, from rows of bytes to columns.

use super::super::bytes_at;
use super::extra::ExtraField;
use super::header::LasHeader;
use crate::mesh::attributes::{
    AttributeColumn, AttributeKind, AttributeNumber, AttributeValues, NumberType,
};

/// Where a value is in a record.
#[derive(Debug, Clone, Copy)]
enum FieldSource {
    /// Some bits of a byte.
    Bits {
        at: usize,
        shift: u8,
        mask: u8,
    },
    Number {
        at: usize,
        number: NumberType,
    },
    /// Integers of 64 bits, kept as doubles.
    Unsigned {
        at: usize,
    },
    Signed {
        at: usize,
    },
}

/// A field that becomes an attribute.
#[derive(Debug, Clone)]
struct PointField {
    name: String,
    kind: AttributeKind,
    source: FieldSource,
    scale: f64,
    offset: f64,
}

/// Where the parts of a point record are.
#[derive(Debug, Clone)]
pub(super) struct PointLayout {
    pub(super) record_bytes: usize,
    /// Offset of red, green and blue.
    pub(super) color: Option<usize>,
    fields: Vec<PointField>,
}

/// Points of a run of records.
pub(super) struct RecordBlock {
    pub(super) steps: Vec<[i32; 3]>,
    pub(super) colors: Vec<[u16; 3]>,
    pub(super) values: Vec<AttributeValues>,
}

impl PointLayout {
    pub(super) fn of(header: &LasHeader) -> Self {
        use AttributeKind::{Category, Quantity};
        let mut fields = Vec::new();
        let mut add = |name: &str, kind, source| {
            fields.push(PointField {
                name: name.to_owned(),
                kind,
                source,
                scale: 1.0,
                offset: 0.0,
            });
        };
        let bits = |at, shift, mask| FieldSource::Bits { at, shift, mask };
        let number = |at, number| FieldSource::Number { at, number };
        let format = header.point_format;
        let (color, time, infrared) = match format {
            1 => (None, Some(20), None),
            2 => (Some(20), None, None),
            3 | 5 => (Some(28), Some(20), None),
            4 => (None, Some(20), None),
            6 | 9 => (None, Some(22), None),
            7 => (Some(30), Some(22), None),
            8 | 10 => (Some(30), Some(22), Some(36)),
            _ => (None, None, None),
        };
        add("intensity", Quantity, number(12, NumberType::U16));
        if format <= 5 {
            add("return", Category, bits(14, 0, 7));
            add("returns", Category, bits(14, 3, 7));
            add("scan_direction", Category, bits(14, 6, 1));
            add("edge_of_line", Category, bits(14, 7, 1));
            add("class", Category, bits(15, 0, 31));
            add("class_flags", Category, bits(15, 5, 7));
            add("scan_angle", Quantity, number(16, NumberType::I8));
            add("user_data", Category, number(17, NumberType::U8));
            add("point_source", Category, number(18, NumberType::U16));
        } else {
            add("return", Category, bits(14, 0, 15));
            add("returns", Category, bits(14, 4, 15));
            add("class_flags", Category, bits(15, 0, 15));
            add("scanner_channel", Category, bits(15, 4, 3));
            add("scan_direction", Category, bits(15, 6, 1));
            add("edge_of_line", Category, bits(15, 7, 1));
            add("class", Category, number(16, NumberType::U8));
            add("user_data", Category, number(17, NumberType::U8));
            add("scan_angle", Quantity, number(18, NumberType::I16));
            add("point_source", Category, number(20, NumberType::U16));
        }
        if let Some(at) = time {
            add("time", Quantity, number(at, NumberType::F64));
        }
        if let Some(at) = infrared {
            add("infrared", Quantity, number(at, NumberType::U16));
        }
        if format > 5 {
            let angle = fields.iter_mut().find(|field| field.name == "scan_angle");
            // Steps of 0.006 degrees (LAS 1.4, table 14).
            angle.into_iter().for_each(|field| field.scale = 0.006);
        }
        fields.extend(header.extra.iter().flat_map(extra_fields));
        Self {
            record_bytes: header.record_bytes,
            color,
            fields,
        }
    }

    /// The layout with position and color alone.
    pub(super) fn without_fields(self) -> Self {
        Self {
            fields: Vec::new(),
            ..self
        }
    }

    /// The columns without values yet.
    pub(super) fn columns(&self) -> Vec<AttributeColumn> {
        let column = |field: &PointField| {
            let number = match field.source {
                FieldSource::Bits { .. } => NumberType::U8,
                FieldSource::Number { number, .. } => number,
                FieldSource::Unsigned { .. } | FieldSource::Signed { .. } => NumberType::F64,
            };
            let mut column = AttributeColumn::new(&field.name, field.kind, number);
            (column.scale, column.offset) = (field.scale, field.offset);
            column
        };
        self.fields.iter().map(column).collect()
    }

    /// The points of whole records.
    pub(super) fn block(&self, records: &[u8]) -> RecordBlock {
        let rows = || records.chunks_exact(self.record_bytes);
        let step = |row: &[u8], at| i32::from_le_bytes(bytes_at(row, at));
        let channel = |row: &[u8], at| u16::from_le_bytes(bytes_at(row, at));
        RecordBlock {
            steps: rows()
                .map(|row| [0, 4, 8].map(|at| step(row, at)))
                .collect(),
            colors: self.color.map_or(Vec::new(), |color| {
                rows()
                    .map(|row| [0, 2, 4].map(|at| channel(row, color + at)))
                    .collect()
            }),
            values: self
                .fields
                .iter()
                .map(|field| column_of(records, self.record_bytes, field.source))
                .collect(),
        }
    }
}

/// The values of one field of all records.
fn column_of(records: &[u8], record_bytes: usize, source: FieldSource) -> AttributeValues {
    fn collect<const N: usize, T: AttributeNumber>(
        records: &[u8],
        record_bytes: usize,
        at: usize,
        value: impl Fn([u8; N]) -> T,
    ) -> AttributeValues {
        let rows = records.chunks_exact(record_bytes);
        AttributeValues::of(rows.map(|row| value(bytes_at(row, at))).collect())
    }
    match source {
        FieldSource::Bits { at, shift, mask } => {
            collect(records, record_bytes, at, |[byte]: [u8; 1]| {
                (byte >> shift) & mask
            })
        }
        FieldSource::Unsigned { at } => {
            collect(records, record_bytes, at, |b| u64::from_le_bytes(b) as f64)
        }
        FieldSource::Signed { at } => {
            collect(records, record_bytes, at, |b| i64::from_le_bytes(b) as f64)
        }
        FieldSource::Number { at, number } => match number {
            NumberType::U8 => collect(records, record_bytes, at, u8::from_le_bytes),
            NumberType::I8 => collect(records, record_bytes, at, i8::from_le_bytes),
            NumberType::U16 => collect(records, record_bytes, at, u16::from_le_bytes),
            NumberType::I16 => collect(records, record_bytes, at, i16::from_le_bytes),
            NumberType::U32 => collect(records, record_bytes, at, u32::from_le_bytes),
            NumberType::I32 => collect(records, record_bytes, at, i32::from_le_bytes),
            NumberType::F32 => collect(records, record_bytes, at, f32::from_le_bytes),
            NumberType::F64 => collect(records, record_bytes, at, f64::from_le_bytes),
        },
    }
}

/// The attributes of an extra field: one, or two or three for the pairs and triples of old files; none for bytes without
/// meaning.
fn extra_fields(extra: &ExtraField) -> Vec<PointField> {
    let Some(base) = extra.data_type.checked_sub(1).filter(|&kind| kind < 30) else {
        return Vec::new();
    };
    let members = 1 + usize::from(base / 10);
    let size = extra.bytes() / members;
    let mut fields = Vec::new();
    for member in 0..members {
        let at = extra.at + member * size;
        let number = |number| FieldSource::Number { at, number };
        let source = match base % 10 {
            0 => number(NumberType::U8),
            1 => number(NumberType::I8),
            2 => number(NumberType::U16),
            3 => number(NumberType::I16),
            4 => number(NumberType::U32),
            5 => number(NumberType::I32),
            6 => FieldSource::Unsigned { at },
            7 => FieldSource::Signed { at },
            8 => number(NumberType::F32),
            _ => number(NumberType::F64),
        };
        let name = if extra.name.is_empty() {
            "extra"
        } else {
            &extra.name
        };
        let usable =
            |value: f64, bit: u8| members == 1 && extra.options & bit != 0 && value.is_finite();
        fields.push(PointField {
            name: if members == 1 {
                name.to_owned()
            } else {
                format!("{name}_{member}")
            },
            kind: AttributeKind::Quantity,
            source,
            scale: if usable(extra.scale, 8) && extra.scale != 0.0 {
                extra.scale
            } else {
                1.0
            },
            offset: if usable(extra.offset, 16) {
                extra.offset
            } else {
                0.0
            },
        });
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::super::header::FORMAT_BYTES;
    use super::*;

    #[test]
    fn fields_lie_within_the_records_of_their_formats() {
        for (format, &bytes) in FORMAT_BYTES.iter().enumerate() {
            let header = LasHeader {
                points_at: 0,
                points: 1,
                point_format: format as u8,
                record_bytes: bytes,
                scale: [1.0; 3],
                offset: [0.0; 3],
                packing: super::super::header::PointPacking::None,
                extra: Vec::new(),
            };
            let layout = PointLayout::of(&header);
            // Every bit set: a field beyond the end would read zeros.
            let block = layout.block(&vec![0xff; bytes]);
            assert_eq!(block.steps, [[-1; 3]], "{format}");
            let color = [[u16::MAX; 3]];
            let has_color = [2, 3, 5, 7, 8, 10].contains(&format);
            assert_eq!(block.colors, &color[..usize::from(has_color)], "{format}");
            for (field, values) in layout.fields.iter().zip(&block.values) {
                assert_ne!(values.get(0), Some(0.0), "{format}, {}", field.name);
            }
        }
    }

    #[test]
    fn old_pairs_and_triples_are_several_attributes() {
        let mut record = vec![0; 192];
        record[2] = 23;
        record[4..7].copy_from_slice(b"dir");
        let placed = ExtraField::placed(vec![ExtraField::of(&record)], 20, 26);
        let names: Vec<String> = extra_fields(&placed[0])
            .into_iter()
            .map(|f| f.name)
            .collect();
        assert_eq!(names, ["dir_0", "dir_1", "dir_2"]);
        assert!(ExtraField::placed(vec![ExtraField::of(&record)], 20, 25).is_empty());
    }
}
