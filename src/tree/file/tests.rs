//! Tree files: what is written is read, and nothing else.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;
use crate::mesh::Mesh;
use crate::tree::{BuildOptions, build};

/// A strip of triangles, as a file in memory.
fn bytes() -> Vec<u8> {
    bytes_with(None)
}

/// A strip of triangles with records of patches, all alike, as a file in memory.
fn bytes_with_patches() -> Vec<u8> {
    let record = PackedPatch {
        plane: 0x0102_0304,
        ..PackedPatch::zeroed()
    };
    bytes_with(Some(record))
}

fn bytes_with(patch: Option<PackedPatch>) -> Vec<u8> {
    let mesh = Mesh {
        positions: (0..14)
            .map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.1))
            .collect(),
        triangles: (0..12).map(|i| [i, i + 1, i + 2]).collect(),
        ..Mesh::default()
    };
    let mut model = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    model.patches = patch.map(|record| {
        Arc::new(PatchRecords {
            records: vec![record; model.tree.nodes.len()],
            colors: Vec::new(),
        })
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.surfel");
    write(&model, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn reads(mut bytes: &[u8]) -> Result<Model, Error> {
    let length = bytes.len() as u64;
    read_from(
        &mut bytes,
        length,
        Path::new("model.surfel"),
        &SilentProgress,
    )
}

#[test]
fn every_truncation_and_every_flipped_bit_is_refused() {
    for good in [bytes(), bytes_with_patches()] {
        assert!(reads(&good).is_ok());
        for length in 0..good.len() {
            assert!(reads(&good[..length]).is_err(), "cut at {length}");
        }
        let mut bytes = good.clone();
        for bit in 0..8 * good.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(reads(&bytes).is_err(), "bit {bit} flipped");
            bytes[bit / 8] = good[bit / 8];
        }
        bytes.push(0);
        let error = reads(&bytes).unwrap_err().to_string();
        assert!(
            error.contains("model.surfel, byte") && error.contains("its header says"),
            "{error}"
        );
    }
}

#[test]
fn records_of_patches_are_read_as_they_were_written() {
    let model = reads(&bytes_with_patches()).unwrap();
    let patches = model.patches.unwrap();
    assert_eq!(patches.records.len(), model.tree.nodes.len());
    assert!(
        patches
            .records
            .iter()
            .all(|record| record.plane == 0x0102_0304)
    );
    assert!(reads(&bytes()).unwrap().patches.is_none());
}

/// Changes the table of patches and makes all checksums right again.
fn forged_table(change: impl FnOnce(&mut PatchTable)) -> Result<Model, Error> {
    let mut bytes = bytes_with_patches();
    let header: TreeHeader = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
    let last = header.sections[SECTIONS - 1];
    let start = (last.offset + last.count * last.stride).next_multiple_of(ALIGNMENT) as usize;
    let range = start..start + size_of::<PatchTable>();
    let mut table: PatchTable = bytemuck::pod_read_unaligned(&bytes[range.clone()]);
    change(&mut table);
    table.checksum = table.own_checksum();
    bytes[range].copy_from_slice(bytemuck::bytes_of(&table));
    reads(&bytes)
}

#[test]
fn a_table_of_patches_that_lies_is_refused() {
    assert!(forged_table(|_| ()).is_ok());
    for count in [0, 1, 1 << 40, u64::MAX] {
        assert!(
            forged_table(|t| t.sections[0].count = count).is_err(),
            "{count}"
        );
    }
    for offset in [0, 64, 1 << 40, u64::MAX, u64::MAX - 63] {
        assert!(
            forged_table(|t| t.sections[0].offset = offset).is_err(),
            "{offset}"
        );
        assert!(
            forged_table(|t| t.sections[1].offset = offset).is_err(),
            "{offset}"
        );
    }
    assert!(forged_table(|t| t.sections[0].stride = 1).is_err());
    assert!(forged_table(|t| t.sections[1].count = 1).is_err());
    let error = forged_table(|t| t.sections[0].count = 2)
        .unwrap_err()
        .to_string();
    assert!(error.contains("not one record for each node"), "{error}");
}

/// Changes the header and makes its checksum right again.
fn forged(change: impl FnOnce(&mut TreeHeader)) -> Result<Model, Error> {
    let mut bytes = bytes();
    let mut header: TreeHeader = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
    change(&mut header);
    header.checksum = header_checksum(&header);
    bytes[..HEADER].copy_from_slice(bytemuck::bytes_of(&header));
    reads(&bytes)
}

#[test]
fn a_header_that_lies_is_refused() {
    assert!(forged(|_| ()).is_ok());
    for section in 0..SECTIONS {
        for count in [0, 1, 1 << 20, 1 << 40, u64::MAX / 8, u64::MAX] {
            assert!(
                forged(|h| h.sections[section].count = count).is_err(),
                "{section} {count}"
            );
        }
        for offset in [0, 64, 1 << 40, u64::MAX, u64::MAX - 63] {
            assert!(
                forged(|h| h.sections[section].offset = offset).is_err(),
                "{section} {offset}"
            );
        }
        assert!(forged(|h| h.sections[section].stride = 1).is_err());
    }
    assert!(forged(|h| h.used_vertices = u32::MAX).is_err());
    assert!(forged(|h| h.used_vertices = 3).is_err());
    assert!(forged(|h| h.section_count = 8).is_err());
    assert!(forged(|h| h.flags = 8).is_err());
    // Records of patches that are not there.
    assert!(forged(|h| h.flags = 4).is_err());
    assert!(forged(|h| h.min[0] = f32::NAN).is_err());
    assert!(forged(|h| h.file_length = 5).is_err());
    let error = forged(|h| h.version = 1).unwrap_err().to_string();
    assert!(
        error.contains("version 1 ") && error.contains("build the file again"),
        "{error}"
    );
}

/// Changes a section's bytes and makes all checksums right again.
fn forged_section(section: usize, change: impl FnOnce(&mut [u8])) -> Result<Model, Error> {
    let mut bytes = bytes();
    let mut header: TreeHeader = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
    let entry = &mut header.sections[section];
    let start = entry.offset as usize;
    let range = start..start + (entry.count * entry.stride) as usize;
    change(&mut bytes[range.clone()]);
    entry.checksum = checksum(&bytes[range]);
    header.checksum = header_checksum(&header);
    bytes[..HEADER].copy_from_slice(bytemuck::bytes_of(&header));
    reads(&bytes)
}

#[test]
fn indices_that_lead_nowhere_are_refused_in_spite_of_right_checksums() {
    // Triangles; nodes (first child, child count, flags); parents, first leaves, level starts.
    for (section, byte) in [
        (1, 5),
        (2, 16),
        (2, 19),
        (2, 30),
        (2, 31),
        (4, 4),
        (5, 8),
        (6, 4),
    ] {
        for value in [77, 255] {
            let result = forged_section(section, |bytes| bytes[byte] = value);
            assert!(result.is_err(), "section {section}, byte {byte}");
        }
    }
    // A position, a sphere of a node, one of a leaf that are no numbers.
    for (section, word) in [(0, 1), (2, 3), (7, 0)] {
        let nan = f32::NAN.to_le_bytes();
        let result = forged_section(section, |bytes| {
            bytes[4 * word..4 * word + 4].copy_from_slice(&nan)
        });
        assert!(result.is_err(), "section {section}");
    }
}
