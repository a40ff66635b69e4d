//! LAS and LAZ, written by the crate `las` and read by it for a second opinion.

use std::io::Cursor;
use std::path::Path;

use glam::DVec3;
use las::point::{Classification, Format as PointFormat};
use las::{Builder, Color, Point, Transform, Vector, Writer};
use surfel::input::{Format, LoadedMesh, ReadWarning};

use super::super::{read, try_read};
use super::{column, damage, histogram, next, remarks, scan};

const OFFSET: DVec3 = DVec3::new(484_600.0, 6_632_600.0, 100.0);

/// A small file of a point format, with all that the format can hold.
fn small(version: (u8, u8), format: u8, packed: bool, points: u64) -> Vec<u8> {
    let mut builder = Builder::from(version);
    builder.point_format = PointFormat::new(format).unwrap();
    builder.point_format.is_compressed = packed;
    let axis = |offset| Transform {
        scale: 0.001,
        offset,
    };
    builder.transforms = Vector {
        x: axis(OFFSET.x),
        y: axis(OFFSET.y),
        z: axis(OFFSET.z),
    };
    let shape = builder.point_format;
    let header = builder.into_header().unwrap();
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).unwrap();
    let mut state = 1;
    for i in 0..points {
        let noise = |state: &mut u64| (next(state) % 1000) as f64 * 0.001;
        writer
            .write_point(Point {
                x: OFFSET.x + i as f64 * 0.1 + noise(&mut state),
                y: OFFSET.y + noise(&mut state),
                z: OFFSET.z + noise(&mut state),
                intensity: (i * 7 % 1000) as u16,
                return_number: 1 + (i % 2) as u8,
                number_of_returns: 2,
                classification: Classification::new([2, 5, 6][(i % 3) as usize]).unwrap(),
                scan_angle: (i % 20) as f32,
                user_data: 9,
                point_source_id: 4,
                gps_time: shape.has_gps_time.then_some(1e5 + i as f64),
                color: shape
                    .has_color
                    .then(|| Color::new(256 * (i % 256) as u16, 65_535, 0)),
                nir: shape.has_nir.then_some(i as u16),
                ..Point::default()
            })
            .unwrap();
    }
    writer.close().unwrap();
    writer.into_inner().unwrap().into_inner()
}

/// Compares every point with what the crate `las` reads.
fn assert_as_other_reader(path: &Path, loaded: &LoadedMesh) {
    let mut reader = las::Reader::from_path(path).unwrap();
    let points: Vec<Point> = {
        let data = reader.read_all().unwrap();
        data.points().map(|point| point.unwrap()).collect()
    };
    assert_eq!(points.len(), loaded.mesh.positions.len());
    let mesh = &loaded.mesh;
    let (mut farthest, mut size) = (0.0_f64, 0.0_f64);
    let columns = [
        "intensity",
        "return",
        "returns",
        "class",
        "user_data",
        "point_source",
    ];
    let columns = columns.map(|name| column(loaded, name));
    let time = loaded.attributes.find("time");
    let angle = column(loaded, "scan_angle");
    for (i, point) in points.iter().enumerate() {
        let place = mesh.origin + mesh.positions[i].as_dvec3();
        let other = DVec3::new(point.x, point.y, point.z);
        farthest = farthest.max((place - other).abs().max_element());
        size = size.max(mesh.positions[i].abs().max_element().into());
        let wanted = [
            point.intensity.into(),
            point.return_number.into(),
            point.number_of_returns.into(),
            f64::from(u8::from(point.classification)),
            point.user_data.into(),
            f64::from(point.point_source_id),
        ];
        let got = columns.map(|column| column.value(i).unwrap());
        // The other reader takes the class of overlapping points apart.
        assert!(got == wanted || got[3] == 12.0, "{i}: {got:?}, {wanted:?}");
        assert_eq!(time.map(|time| time.value(i).unwrap()), point.gps_time);
        let step = angle.value(i).unwrap() - f64::from(point.scan_angle);
        assert!(step.abs() < 1e-4, "{i}");
        if let (Some(color), Some(mine)) = (point.color, mesh.colors.get(i)) {
            let eight = remarks(loaded).contains("0 to 255");
            let byte = |value: u16| (if eight { value } else { value >> 8 }) as u8;
            assert_eq!(mine[..3], [color.red, color.green, color.blue].map(byte));
        }
    }
    // Half a step of single precision.
    assert!(farthest <= size * 6e-8 + 1e-9, "{farthest} of {size}");
}

#[test]
fn formats_packed_and_plain_are_read_as_the_other_reader_does() {
    let folder = tempfile::tempdir().unwrap();
    for (version, format) in [
        ((1, 2), 0),
        ((1, 2), 1),
        ((1, 2), 2),
        ((1, 2), 3),
        ((1, 4), 6),
        ((1, 4), 7),
        ((1, 4), 8),
    ] {
        for packed in [false, true] {
            let bytes = small(version, format, packed, 300);
            let path = folder.path().join(if packed { "a.laz" } else { "a.las" });
            std::fs::write(&path, &bytes).unwrap();
            let loaded = read(path.to_str().unwrap(), &bytes);
            let wanted = if packed { Format::Laz } else { Format::Las };
            assert_eq!(loaded.format, wanted);
            assert_as_other_reader(&path, &loaded);
            // Exact to the file's step at any offset.
            assert!((loaded.mesh.origin - OFFSET).abs().max_element() < 100.0);
            let one = loaded
                .parts
                .iter()
                .find(|part| part.name == "attribute user_data");
            assert_eq!(one.unwrap().note, "9 everywhere");
        }
    }
}

#[test]
fn chunks_are_kept_in_order() {
    let plain = read("a.las", small((1, 2), 3, false, 120_000));
    for (version, format) in [((1, 2), 3), ((1, 4), 7)] {
        let packed = read("a.laz", small(version, format, true, 120_000));
        assert_eq!(plain.mesh.positions, packed.mesh.positions);
        assert_eq!(plain.mesh.colors, packed.mesh.colors);
        assert_eq!(column(&plain, "time"), column(&packed, "time"));
    }
}

#[test]
fn what_is_cut_short_is_read_as_far_as_it_goes() {
    for (format, packed) in [(3, false), (3, true), (7, true)] {
        let version = if format > 5 { (1, 4) } else { (1, 2) };
        let bytes = small(version, format, packed, 120_000);
        let loaded = read("a.laz", &bytes[..bytes.len() / 2]);
        let found = loaded.mesh.positions.len();
        let promised = loaded.warnings.iter().find_map(|warning| match warning {
            ReadWarning::CountContradicts {
                promised, found, ..
            } => Some((*promised, *found as usize)),
            _ => None,
        });
        assert_eq!(promised, Some((120_000, found)));
        assert!((40_000..70_000).contains(&found), "{format}: {found}");
        let whole = read("a.laz", &bytes).mesh;
        let place =
            |mesh: &surfel::mesh::Mesh, at: usize| mesh.origin + mesh.positions[at].as_dvec3();
        for at in [0, 1, found / 2, found - 1] {
            let apart = place(&whole, at) - place(&loaded.mesh, at);
            assert!(
                apart.abs().max_element() < 1e-3,
                "{format} {packed} {at}: {apart}"
            );
        }
    }
}

#[test]
fn damage_is_read_or_refused() {
    for (version, format, packed) in [
        ((1, 2), 3, false),
        ((1, 2), 3, true),
        ((1, 4), 8, false),
        ((1, 4), 8, true),
    ] {
        let read = damage("a.laz", &small(version, format, packed, 40), 1500);
        assert!(
            (100..1500).contains(&read),
            "{format} {packed}: {read} read"
        );
    }
}

#[test]
fn numbers_that_lie_are_named() {
    let bytes = small((1, 4), 7, false, 40);
    let put = |at: usize, new: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        try_read("a.las", bytes)
            .err()
            .map(|error| error.to_string())
    };
    let says = |at, new: &[u8], words: &str| {
        let text = put(at, new).unwrap();
        assert!(text.contains(words), "{text}");
    };
    says(25, &[9], "LAS version 1.9 is not known");
    says(
        96,
        &[0xff; 4],
        "the points are said to begin at byte 4294967295",
    );
    says(104, &[40], "point format 40 is not known");
    says(105, &[3, 0], "point records are said to have 3 bytes");
    says(131, &[0; 8], "is no number of use");
    says(131, &f64::NAN.to_le_bytes(), "is no number of use");
    says(104, &[0x87], "no `laszip encoded` record");
    // More points than there are: what is there is read. More records than there are: what fits is walked.
    assert_eq!(put(247, &[0xff; 8]), None);
    assert_eq!(put(100, &[0xff; 4]), None);
    assert_eq!(put(235, &[0xff; 12]), None);
}

/// Counts of the models' own table (README of the folder), made there by laspy.
#[test]
fn real_scans_have_their_verified_counts() {
    for (name, points, format) in [
        ("autzen_trim.las", 110_000, Format::Las),
        ("autzen_trim.laz", 110_000, Format::Laz),
        ("simple.las", 1065, Format::Las),
        ("1.2-with-color.copc.laz", 1065, Format::Copc),
        ("pine_plot.laz", 114_024, Format::Laz),
        ("lion_takanawa.copc.laz", 341_989, Format::Copc),
        ("las_with_several_extra_byte_bloc.laz", 697_721, Format::Laz),
    ] {
        let Some((path, loaded)) = scan(name) else {
            return;
        };
        assert_eq!(loaded.mesh.positions.len(), points, "{name}");
        assert_eq!(loaded.format, format, "{name}");
        assert_as_other_reader(&path, &loaded);
        let colors = if name.starts_with("pine") { 0 } else { points };
        assert_eq!(loaded.mesh.colors.len(), colors, "{name}");
        let is_eight = remarks(&loaded).contains("0 to 255");
        println!(
            "{name}: {:?} {}",
            histogram(column(&loaded, "class")),
            remarks(&loaded)
        );
        if name.starts_with("autzen") {
            assert!(is_eight, "{name}");
            let largest = loaded
                .mesh
                .colors
                .iter()
                .flat_map(|color| &color[..3])
                .max();
            assert_eq!(largest, Some(&236));
        }
        if name.starts_with("las_with") {
            let low = loaded.mesh.origin + DVec3::ZERO;
            assert!((low.x - 484_649.0).abs() < 400.0 && (low.y - 6_632_629.0).abs() < 400.0);
            let extra = loaded
                .parts
                .iter()
                .filter(|part| part.name.starts_with("attribute"));
            println!("{:#?}", extra.collect::<Vec<_>>());
        }
    }
}

#[test]
fn packed_and_plain_autzen_are_one() {
    let (Some((_, plain)), Some((_, packed))) = (scan("autzen_trim.las"), scan("autzen_trim.laz"))
    else {
        return;
    };
    assert_eq!(plain.mesh, packed.mesh);
    assert_eq!(plain.attributes, packed.attributes);
}

#[test]
fn layers_longer_than_their_chunk_are_refused() {
    let mut bytes = small((1, 4), 7, true, 40);
    let word = |at: usize| u32::from_le_bytes(*bytes[at..].first_chunk().unwrap()) as usize;
    let record = usize::from(u16::from_le_bytes([bytes[105], bytes[106]]));
    // After the offset of the table: the first point, the number of points, the lengths of the layers.
    let lengths_at = word(96) + 8 + record + 4;
    bytes[lengths_at..lengths_at + 4].fill(0xff);
    let text = try_read("a.laz", bytes).unwrap_err().to_string();
    assert!(text.contains("its layers are said to have 42949"), "{text}");
}
