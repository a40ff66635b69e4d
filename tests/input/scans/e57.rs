//! E57, written by the crate `e57`.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use std::io::Cursor;

use ::e57::{
    E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};
use glam::DVec3;
use surfel::input::{Format, LoadedMesh};

use super::super::{message, read};
use super::{column, damage, histogram, remarks, scan};

fn record(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

const DOUBLE: RecordDataType = RecordDataType::Double {
    min: None,
    max: None,
};

const fn whole(min: i64, max: i64) -> RecordDataType {
    RecordDataType::Integer { min, max }
}

/// Two scans: Cartesian in steps with colors and a hole; spherical, turned and moved.
fn small() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = E57Writer::new(Cursor::new(&mut bytes), "guid").unwrap();
    let steps = RecordDataType::ScaledInteger {
        min: -1_000_000,
        max: 1_000_000,
        scale: 0.001,
        offset: 500.0,
    };
    let prototype = vec![
        record(RecordName::CartesianX, steps.clone()),
        record(RecordName::CartesianY, steps.clone()),
        record(RecordName::CartesianZ, steps),
        record(RecordName::CartesianInvalidState, whole(0, 2)),
        record(RecordName::ColorRed, whole(0, 65_535)),
        record(RecordName::ColorGreen, whole(0, 65_535)),
        record(RecordName::ColorBlue, whole(0, 65_535)),
        record(RecordName::Intensity, whole(-2048, 2047)),
        record(RecordName::RowIndex, whole(7, 7)),
    ];
    let mut scan = writer.add_pointcloud("first", prototype).unwrap();
    for i in 0..20_i64 {
        let step = |value| RecordValue::ScaledInteger(value);
        scan.add_point(vec![
            step(i * 1000),
            step(-1),
            step(250),
            RecordValue::Integer(if i == 3 { 2 } else { 0 }),
            RecordValue::Integer(65_535),
            RecordValue::Integer(0),
            RecordValue::Integer(257 * i),
            RecordValue::Integer(i - 10),
            RecordValue::Integer(7),
        ])
        .unwrap();
    }
    scan.finalize().unwrap();
    let prototype = vec![
        record(RecordName::SphericalRange, DOUBLE),
        record(RecordName::SphericalAzimuth, DOUBLE),
        record(RecordName::SphericalElevation, DOUBLE),
    ];
    let mut scan = writer.add_pointcloud("second", prototype).unwrap();
    scan.set_transform(Some(Transform {
        rotation: Quaternion {
            w: FRAC_1_SQRT_2,
            x: 0.0,
            y: 0.0,
            z: FRAC_1_SQRT_2,
        },
        translation: Translation {
            x: 1000.0,
            y: 0.0,
            z: 0.0,
        },
    }));
    for [range, azimuth, elevation] in [
        [2.0, 0.0, 0.0],
        [3.0, FRAC_PI_2, 0.0],
        [4.0, 0.0, FRAC_PI_2],
    ] {
        let values = [range, azimuth, elevation].map(RecordValue::Double);
        scan.add_point(values.to_vec()).unwrap();
    }
    scan.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    bytes
}

fn place(loaded: &LoadedMesh, at: usize) -> DVec3 {
    loaded.mesh.origin + loaded.mesh.positions[at].as_dvec3()
}

#[test]
fn scans_stand_at_their_poses() {
    let loaded = read("a.e57", small());
    assert_eq!(loaded.format, Format::E57);
    assert_eq!(loaded.counts.vertices, 23);
    assert_eq!(loaded.mesh.positions.len(), 22);
    for (at, wanted) in [
        (0, DVec3::new(500.0, 499.999, 500.25)),
        (3, DVec3::new(504.0, 499.999, 500.25)),
        (19, DVec3::new(1000.0, 2.0, 0.0)),
        (20, DVec3::new(997.0, 0.0, 0.0)),
        (21, DVec3::new(1000.0, 0.0, 4.0)),
    ] {
        let apart = place(&loaded, at).distance(wanted);
        assert!(apart < 1e-4, "{at}: {apart}");
    }
    // The first scan does not say where its scanner stood; of the second, angles and a pose do.
    let scanners = [18, 19, 21].map(|point| loaded.mesh.scanners.of_point(point));
    let second = Some(DVec3::new(1000.0, 0.0, 0.0));
    assert_eq!(scanners, [None, second, second]);
    assert_eq!(loaded.mesh.colors[18], [255, 0, 19, 255]);
    assert_eq!(loaded.mesh.colors[20], [255; 4]);
    assert_eq!(histogram(column(&loaded, "scan")), [(0, 19), (1, 3)]);
    assert_eq!(column(&loaded, "intensity").value(18), Some(9.0));
    assert!(column(&loaded, "intensity").value(19).unwrap().is_nan());
    let said = remarks(&loaded);
    assert!(
        said.contains("1 points without a measurement left out"),
        "{said}"
    );
    assert!(
        said.contains("2 scans are drawn as one cloud, 1 of them moved"),
        "{said}"
    );
}

#[test]
fn damage_is_read_or_refused() {
    let bytes = small();
    // Every page has a checksum, so damage is nearly always seen; the header has the numbers that ask for memory.
    damage("a.e57", &bytes, 2000);
    for at in 8..48 {
        for value in [0, 1, 0x7f, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            super::survives("a.e57", &damaged);
        }
    }
    let text = message("a.e57", &bytes[..bytes.len() - 1024]);
    assert!(
        text.contains("the file ends early: the description"),
        "{text}"
    );
}

/// Checksums made right again after damage reach what is behind them.
#[test]
fn damage_behind_right_checksums_is_read_or_refused() {
    let bytes = small();
    let mut state = 5;
    let mut read = 0;
    for _ in 0..1500 {
        let mut damaged = bytes.clone();
        for _ in 0..=super::next(&mut state) % 3 {
            let at = 48 + (super::next(&mut state) % (damaged.len() as u64 - 48)) as usize;
            damaged[at] = super::next(&mut state) as u8;
        }
        for page in damaged.chunks_exact_mut(1024) {
            let sum = crc32c(&page[..1020]);
            page[1020..].copy_from_slice(&sum.to_be_bytes());
        }
        read += u32::from(super::survives("a.e57", &damaged));
    }
    assert!((100..1500).contains(&read), "{read}");
}

/// The checksum of E57 pages (Castagnoli's polynomial), bit by bit.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ (0x82f6_3b78 & 0_u32.wrapping_sub(sum & 1))
        })
    })
}

/// Counts of the models' own table (README of the folder), made there by pye57.
#[test]
fn the_real_scan_has_its_verified_count() {
    let Some((_, pump)) = scan("pumpAVisualReferenceImage.e57") else {
        return;
    };
    assert_eq!(pump.mesh.positions.len(), 155_201);
    assert_eq!(pump.mesh.colors.len(), 155_201);
    println!("{:#?}\n{}", pump.parts, remarks(&pump));
    for name in ["intensity", "row", "column"] {
        assert_eq!(column(&pump, name).values.len(), 155_201, "{name}");
    }
}
