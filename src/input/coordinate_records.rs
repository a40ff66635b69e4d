//! Coordinate systems of LAS files, as their records have them: text of the Open Geospatial Consortium (WKT), or keys of GeoTIFF.

/// User of the records that hold a coordinate system.
pub(super) const SYSTEM_USER: &str = "LASF_Projection";

/// Record of the text.
const TEXT_RECORD: u16 = 2112;

/// Records of GeoTIFF: directory, numbers, texts.
const KEY_RECORDS: [u16; 3] = [34735, 34736, 34737];

/// Bit of the header's global encoding that says that the text counts.
pub(super) const TEXT_BIT: u16 = 16;

/// The first point format whose files must have the text (LAS 1.4, table 4).
const FIRST_OF_TEXT: u8 = 6;

/// Records of the coordinate system of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CoordinateRecords {
    /// Numbers of the records, and what they hold.
    records: Vec<(u16, Vec<u8>)>,
    /// The file says that its text counts.
    is_text: bool,
}

impl CoordinateRecords {
    /// Takes a record, if it holds a part of a coordinate system.
    pub(super) fn take(&mut self, user: &str, id: u16, body: &[u8]) {
        let is_known = id == TEXT_RECORD || KEY_RECORDS.contains(&id);
        if user == SYSTEM_USER && is_known && self.records.iter().all(|own| own.0 != id) {
            self.records.push((id, body.to_owned()));
        }
    }

    /// Takes note of the header's global encoding.
    pub(super) fn see_encoding(&mut self, encoding: u16) {
        self.is_text = encoding & TEXT_BIT != 0;
    }

    /// The records for a file of a point format: the text or the keys, whichever count in the file and may be in the other. Empty
    /// where neither may, or does not fit a record.
    pub(super) fn for_format(&self, format: u8) -> Vec<(u16, &[u8])> {
        let of = |wanted: &[u16]| -> Vec<(u16, &[u8])> {
            let own = self.records.iter();
            own.filter(|(id, body)| wanted.contains(id) && body.len() <= usize::from(u16::MAX))
                .map(|(id, body)| (*id, body.as_slice()))
                .collect()
        };
        let (text, keys) = (of(&[TEXT_RECORD]), of(&KEY_RECORDS));
        // Keys are read from their directory.
        let has_keys = keys.iter().any(|(id, _)| *id == KEY_RECORDS[0]);
        match format >= FIRST_OF_TEXT {
            true => text,
            false if has_keys && (!self.is_text || text.is_empty()) => keys,
            false => text,
        }
    }

    /// Tells whether records are the text.
    pub(super) fn are_text(records: &[(u16, &[u8])]) -> bool {
        records.iter().any(|(id, _)| *id == TEXT_RECORD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_counts_in_the_file_is_written_where_it_may_be() {
        let mut both = CoordinateRecords::default();
        for (user, id) in [
            (SYSTEM_USER, 2112),
            (SYSTEM_USER, 34737),
            (SYSTEM_USER, 34735),
            (SYSTEM_USER, 34735),
            (SYSTEM_USER, 2111),
            ("other", 34736),
        ] {
            both.take(user, id, &id.to_le_bytes());
        }
        let ids = |own: &CoordinateRecords, format| {
            let records = own.for_format(format);
            (
                CoordinateRecords::are_text(&records),
                records.iter().map(|(id, _)| *id).collect::<Vec<_>>(),
            )
        };
        assert_eq!(ids(&both, 1), (false, vec![34737, 34735]));
        assert_eq!(ids(&both, 7), (true, vec![2112]));
        both.see_encoding(0x11);
        assert_eq!(ids(&both, 1), (true, vec![2112]));
        let mut keys = CoordinateRecords::default();
        keys.take(SYSTEM_USER, 34735, &[1; 8]);
        assert_eq!(ids(&keys, 3), (false, vec![34735]));
        assert_eq!(ids(&keys, 6), (false, vec![]));
        let mut long = CoordinateRecords::default();
        long.take(SYSTEM_USER, 2112, &vec![b' '; 70_000]);
        assert_eq!(ids(&long, 6), (false, vec![]));
    }
}
