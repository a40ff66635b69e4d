//! Numbers of PLY vertices that are neither position, normal, color nor texture coordinate.

use super::read;
use surfel::input::{self, ColorSetting, PointColoring, ReadOptions};
use surfel::mesh::attributes::{AttributeKind, AttributeValues};
use surfel::progress::SilentProgress;

/// Three vertices with four such numbers, as text and in both binary orders; with a triangle, or as points.
fn files(is_surface: bool) -> Vec<Vec<u8>> {
    let header = |encoding: &str| {
        let faces = match is_surface {
            true => "element face 1\nproperty list uchar int vertex_indices\n",
            false => "",
        };
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex 3\nproperty ushort Label\nproperty float x\n\
             property float y\nproperty float z\nproperty double scalar_Intensity\nproperty char low\n\
             property float same\n{faces}end_header\n"
        )
    };
    let mut text = header("ascii").into_bytes();
    text.extend(b"7 0 0 0 0.1 -3 2\n65535 1 0 0 0.2 4 2\n0 0 1 0 1e300 5 2\n");
    text.extend(if is_surface { &b"3 0 1 2\n"[..] } else { b"" });
    let binary = |is_big: bool| {
        let name = ["binary_little_endian", "binary_big_endian"][usize::from(is_big)];
        let mut bytes = header(name).into_bytes();
        let mut put = |mut number: Vec<u8>| {
            if is_big {
                number.reverse();
            }
            bytes.extend(number);
        };
        let rows = [
            (7_u16, [0.0_f32, 0.0], 0.1_f64, -3_i8),
            (65535, [1.0, 0.0], 0.2, 4),
            (0, [0.0, 1.0], 1e300, 5),
        ];
        for (label, [x, y], intensity, low) in rows {
            put(label.to_le_bytes().into());
            for v in [x, y, 0.0] {
                put(v.to_le_bytes().into());
            }
            put(intensity.to_le_bytes().into());
            put(low.to_le_bytes().into());
            put(2.0_f32.to_le_bytes().into());
        }
        if is_surface {
            put(vec![3]);
            for corner in 0..3_i32 {
                put(corner.to_le_bytes().into());
            }
        }
        bytes
    };
    vec![text, binary(false), binary(true)]
}

#[test]
fn numbers_of_points_are_attributes_of_the_types_of_the_file() {
    for file in files(false) {
        let loaded = read("a.ply", file);
        let columns = &loaded.attributes.columns;
        let found: Vec<_> = columns.iter().map(|c| (&c.name[..], c.kind)).collect();
        let (quantity, category) = (AttributeKind::Quantity, AttributeKind::Category);
        let wanted = [
            ("label", category),
            ("intensity", quantity),
            ("low", quantity),
            ("same", quantity),
        ];
        assert_eq!(found, wanted);
        assert_eq!(columns[0].values, AttributeValues::U16(vec![7, 65535, 0]));
        assert_eq!(
            columns[1].values,
            AttributeValues::F64(vec![0.1, 0.2, 1e300])
        );
        assert_eq!(columns[2].values, AttributeValues::I8(vec![-3, 4, 5]));
        let same = &columns[3].values;
        assert!(
            matches!(
                same,
                AttributeValues::Constant {
                    value: 2.0,
                    count: 3,
                    ..
                }
            ),
            "{same:?}"
        );
        let lines: Vec<_> = loaded.warnings.iter().map(ToString::to_string).collect();
        assert!(lines.is_empty(), "{lines:?}");
    }
}

#[test]
fn surfaces_are_colored_by_numbers_of_their_vertices_and_keep_none() {
    for file in files(true) {
        let options = ReadOptions {
            color: Some(ColorSetting {
                by: PointColoring::Attribute("low".to_owned()),
                range: Some([-3.0, 5.0]),
            }),
            ..ReadOptions::default()
        };
        let loaded = input::load_bytes("a.ply", &file, &options, &SilentProgress).unwrap();
        let [first, _, last] = loaded.mesh.colors[..] else {
            panic!("{:?}", loaded.mesh.colors)
        };
        // Dark blue to yellow.
        assert!(first[2] > first[1] && last[0] > 200 && last[1] > 200 && last[2] < 60);
        assert!(loaded.attributes.columns.is_empty());
        assert_eq!(read("a.ply", &file).mesh.colors, [[0; 4]; 0]);
    }
}
