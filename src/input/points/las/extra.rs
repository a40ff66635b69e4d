//! Fields of LAS points beyond those of their format.

use super::super::{bytes_at, text_of};

/// An extra field of point records, as its record of 192 bytes describes it.
#[derive(Debug, Clone)]
pub(super) struct ExtraField {
    pub(super) name: String,
    /// Data type of the specification, 0 (bytes without meaning) to 30.
    pub(super) data_type: u8,
    pub(super) options: u8,
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// Offset in the point record.
    pub(super) at: usize,
}

impl ExtraField {
    pub(super) fn of(record: &[u8]) -> Self {
        let number = |at| f64::from_le_bytes(bytes_at(record, at));
        Self {
            name: text_of(&record[4..36]),
            data_type: record[2],
            options: record[3],
            scale: number(112),
            offset: number(136),
            at: 0,
        }
    }

    /// Bytes in a point record. Types 11 to 30 are pairs and triples of the first ten, of old files.
    pub(super) fn bytes(&self) -> usize {
        const SIZES: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
        match self.data_type {
            0 => usize::from(self.options),
            kind @ 1..=30 => SIZES[usize::from(kind - 1) % 10] * (1 + usize::from(kind - 1) / 10),
            _ => 0,
        }
    }

    /// The fields with their offsets, as far as they fit in the record.
    pub(super) fn placed(fields: Vec<ExtraField>, start: usize, end: usize) -> Vec<ExtraField> {
        let mut at = start;
        let mut out = Vec::new();
        for mut field in fields {
            field.at = at;
            at += field.bytes();
            if at > end || field.bytes() == 0 {
                break;
            }
            out.push(field);
        }
        out
    }
}
