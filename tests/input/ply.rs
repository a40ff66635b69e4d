//! PLY in its encodings, and headers of any format that lie.

use glam::{DVec3, Vec3};
use surfel::input::{Error, FilePlace, Format, ReadWarning};

use super::{SQUARE, message, read, try_read};

const PLY_HEAD: &str = "comment x\nobj_info y\nelement camera 1\nproperty float a\nproperty list uchar int b\n\
    element vertex 4\nproperty float x\nproperty double y\nproperty float32 z\nproperty list uint8 float extra\n\
    property uchar red\nproperty ushort green\nproperty float blue\nproperty uchar alpha\n\
    property float nx\nproperty float ny\nproperty float nz\n\
    element face 2\nproperty uchar flag\nproperty list uint int16 vertex_index\nproperty list uchar float texcoord\n\
    element tristrips 1\nproperty list int int vertex_indices\nend_header\n";

/// Bytes of [`PLY_HEAD`]'s body in one order.
fn ply_binary_body(big: bool) -> Vec<u8> {
    let mut out = Vec::new();
    macro_rules! put {
        ($value:expr) => {
            if big {
                out.extend($value.to_be_bytes())
            } else {
                out.extend($value.to_le_bytes())
            }
        };
    }
    put!(1.5_f32);
    put!(2_u8);
    put!(7_i32);
    put!(8_i32);
    for (index, point) in SQUARE.into_iter().enumerate() {
        put!(point.x);
        put!(f64::from(point.y));
        put!(point.z);
        put!(index as u8);
        (0..index).for_each(|_| put!(0.5_f32));
        put!(200_u8);
        put!(32_896_u16);
        put!(0.5_f32);
        put!(9_u8);
        put!(0.0_f32);
        put!(0.0_f32);
        put!(3.0_f32);
    }
    for (corners, texture) in [(&[0_i16, 1, 2, 3][..], 2), (&[0, 1][..], 0)] {
        put!(1_u8);
        put!(corners.len() as u32);
        corners.iter().for_each(|corner| put!(*corner));
        put!(texture as u8);
        (0..texture).for_each(|_| put!(0.25_f32));
    }
    put!(9_i32);
    // The strip 0 1 2 3, turned at its end by naming 3 twice, and one too short.
    for corner in [0_i32, 1, 2, 3, 3, 3, -1, 1, 2] {
        put!(corner);
    }
    out
}

const PLY_ASCII_BODY: &str = "1.5 2 7 8\n0 0 0 0 200 32896 .5 9 0 0 3\n1 0 0 1 .5 200 32896 .5 9 0 0 3\n\
    1 1 0 2 .5 .5 200 32896 .5 9 0 0 3\n0 1 0 3 .5 .5 .5 200 32896 .5 9 0 0 3\n\
    1 4 0 1 2 3 2 .25 .25\n1 2 0 1 0\n9 0 1 2 3 3 3 -1 1 2\n";

fn ply_variants() -> Vec<(Format, Vec<u8>)> {
    let with = |encoding: &str, body: &[u8]| {
        [
            format!("ply\nformat {encoding} 1.0\n{PLY_HEAD}").as_bytes(),
            body,
        ]
        .concat()
    };
    let crlf = String::from_utf8(with("ascii", PLY_ASCII_BODY.as_bytes()))
        .unwrap()
        .replace('\n', "\r\n");
    vec![
        (Format::PlyAscii, with("ascii", PLY_ASCII_BODY.as_bytes())),
        (Format::PlyAscii, crlf.into_bytes()),
        (
            Format::PlyBinaryLittleEndian,
            with("binary_little_endian", &ply_binary_body(false)),
        ),
        (
            Format::PlyBinaryBigEndian,
            with("binary_big_endian", &ply_binary_body(true)),
        ),
    ]
}

#[test]
fn ply_in_three_encodings_is_the_same_mesh() {
    for (format, bytes) in ply_variants() {
        let loaded = read("a.ply", &bytes);
        assert_eq!(loaded.format, format);
        assert_eq!(loaded.mesh.positions, SQUARE);
        assert_eq!(loaded.mesh.normals, [Vec3::Z; 4]);
        assert_eq!(loaded.mesh.colors, [[200, 128, 128, 255]; 4]);
        assert_eq!(
            loaded.mesh.triangles,
            [[0, 1, 2], [0, 2, 3], [0, 1, 2], [2, 1, 3]]
        );
        let left_out = [
            "element camera (1 rows)",
            "extra of vertex",
            "flag, texcoord of face",
        ];
        let alpha = "alpha of vertex";
        assert_eq!(
            loaded.warnings,
            [
                ReadWarning::FacesTooSmall { count: 1 },
                ReadWarning::LeftOut {
                    parts: left_out
                        .into_iter()
                        .chain([alpha])
                        .map(String::from)
                        .collect()
                }
            ]
        );
        assert_eq!((loaded.counts.vertices, loaded.counts.faces), (4, 4));
        assert_eq!(loaded.mesh.origin, DVec3::ZERO);
    }
}

/// A PLY of fixed rows, as nearly all are: `vertices` points on a line, `triangles` around them.
fn ply_fixed(vertices: u32, triangles: u32, big: bool, faces_first: bool) -> Vec<u8> {
    let encoding = if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let elements = [
        format!(
            "element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        ),
        format!(
            "element face {triangles}\nproperty list uchar int vertex_indices\nproperty uchar flag\n"
        ),
    ];
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for index in 0..vertices {
        for value in [index as f32 * 0.25, 1.0, -2.0] {
            points.extend(if big {
                value.to_be_bytes()
            } else {
                value.to_le_bytes()
            });
        }
    }
    for index in 0..triangles {
        faces.push(3);
        for corner in [index, index + 1, index + 2] {
            let corner = corner % vertices;
            faces.extend(if big {
                corner.to_be_bytes()
            } else {
                corner.to_le_bytes()
            });
        }
        faces.push(0xff);
    }
    let [vertex_head, face_head] = &elements;
    let mut out = format!("ply\nformat {encoding} 1.0\n").into_bytes();
    let order = if faces_first {
        [face_head, vertex_head]
    } else {
        [vertex_head, face_head]
    };
    order.iter().for_each(|head| out.extend(head.bytes()));
    out.extend(b"end_header\n");
    let bodies = if faces_first {
        [faces, points]
    } else {
        [points, faces]
    };
    bodies.iter().for_each(|body| out.extend(body));
    out
}

#[test]
fn ply_fixed_rows_over_several_pieces() {
    // Over two parallel pieces of 65,536 rows, with a remainder.
    let (vertices, triangles) = (140_001, 150_003);
    for (big, faces_first) in [(false, false), (true, true)] {
        let loaded = read("a.ply", ply_fixed(vertices, triangles, big, faces_first));
        let mesh = &loaded.mesh;
        assert_eq!(mesh.positions.len(), vertices as usize);
        assert!(
            (0_u32..)
                .zip(&mesh.positions)
                .all(|(i, p)| *p == Vec3::new(i as f32 * 0.25, 1.0, -2.0))
        );
        let wanted = |i: u32| [i, i + 1, i + 2].map(|corner| corner % vertices);
        assert_eq!(mesh.triangles.len(), triangles as usize);
        assert!((0_u32..).zip(&mesh.triangles).all(|(i, t)| *t == wanted(i)));
        let flag = ReadWarning::LeftOut {
            parts: vec!["flag of face".into()],
        };
        assert_eq!(loaded.warnings, [flag]);
        assert_eq!(loaded.counts.faces, u64::from(triangles));
    }
}

#[test]
fn ply_fixed_rows_fall_back_to_find_the_place() {
    let good = ply_fixed(9, 7, false, false);
    let body = good.len() - 7 * 14;
    // Row 5 names vertex 9; its third corner ends at byte 13 of the row.
    let mut bad = good.clone();
    bad[body + 5 * 14 + 9] = 9;
    let place = FilePlace::Byte((body + 5 * 14 + 12) as u64);
    assert!(
        matches!(try_read("a.ply", &bad), Err(Error::Index { index: 9, count: 9, place: p, .. }) if p == place)
    );
    bad[body + 5 * 14 + 12] = 0xff;
    assert!(matches!(
        try_read("a.ply", &bad),
        Err(Error::Index { index: ..0, .. })
    ));
    // A row of another length is no triangle but allowed: here a quad that takes the byte after it, and so the file
    // ends early.
    let mut quad = good.clone();
    quad[body] = 4;
    assert!(matches!(
        try_read("a.ply", &quad),
        Err(Error::Index { .. } | Error::Truncated { .. } | Error::Syntax { .. })
    ));
    // A row with two corners shifts all that follows; whatever that reads as, bytes are left over.
    quad[body] = 2;
    let left_over = |warning: &ReadWarning| matches!(warning, ReadWarning::TrailingBytes { .. });
    assert!(try_read("a.ply", &quad).map_or(true, |loaded| loaded.warnings.iter().any(left_over)));
}

#[test]
fn ply_headers_that_are_wrong_say_where() {
    let head = |body: &str| format!("ply\nformat ascii 1.0\n{body}end_header\n");
    let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    for (text, wanted) in [
        ("ply\nelement vertex 1\n".to_owned(), "end_header"),
        (
            format!("ply\n{vertex}end_header\n0 0 0\n"),
            "no `format` line",
        ),
        (
            "ply\nformat ebcdic 1.0\n".to_owned(),
            "line 2: unknown PLY format `ebcdic`",
        ),
        (
            head("property float x\n"),
            "line 3: a property stands before",
        ),
        (head("element vertex\n"), "line 3: an element line needs"),
        (
            head("element vertex -1\n"),
            "line 3: `-1` is not a count of rows",
        ),
        (
            head("element vertex 1\nproperty quad x\n"),
            "line 4: unknown property type `quad`",
        ),
        (
            head("element vertex 1\nproperty list float int x\n"),
            "line 4: the length of a list",
        ),
        (
            head("element vertex 1\nproperty list int x\n"),
            "line 4: a list property needs",
        ),
        (
            head("element vertex 1\nproperty float x\n"),
            "no properties x, y, z",
        ),
        (head("bogus\n"), "line 3: unknown keyword `bogus`"),
        (head("element face 0\n"), "no element `vertex`"),
        (
            head(&format!("{vertex}element face 1\nproperty int a\n")) + "0 0 0\n1\n",
            "no list `vertex_indices`",
        ),
        (
            head(vertex) + "0 0 zero\n",
            "line 8: `zero` is not a number",
        ),
        (
            head(vertex) + "0.00000 0\n",
            "ends early: a number is missing",
        ),
        (
            head("element vertex 0\nproperty float x\nproperty float y\nproperty float z\n"),
            "no vertices",
        ),
        (
            head(&format!(
                "{vertex}element face 1\nproperty list char int vertex_index\n"
            )) + "0 0 0\n-3 1\n",
            "line 11: a list",
        ),
        (
            head(&format!(
                "{vertex}element face 1\nproperty list char int vertex_index\n"
            )) + "0 0 0\n3 0 0 1\n",
            "line 11: a face names vertex 1, but the file has 1 (numbered from 0)",
        ),
    ] {
        let found = message("a.ply", &text);
        assert!(
            found.contains(wanted) && found.starts_with("a.ply"),
            "{text}\n{found}"
        );
    }
}

#[test]
fn headers_that_lie_are_refused_before_memory_is_reserved() {
    let vertex = |count: u64| {
        format!("element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n")
    };
    let face =
        |count: u64| format!("element face {count}\nproperty list uchar int vertex_indices\n");
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for elements in [
            vertex(4_000_000_000),
            vertex(u64::MAX),
            vertex(1) + &face(4_000_000_000_000),
            vertex(1) + &face(u64::MAX),
            format!(
                "element other {}\nproperty double a\nproperty double b\n{}",
                u64::MAX,
                vertex(1)
            ),
            format!(
                "element other {}\nproperty list uint int a\n{}",
                u64::MAX,
                vertex(1)
            ),
        ] {
            let text = format!(
                "ply\nformat {encoding} 1.0\n{elements}end_header\n0 0 0 0 0 0 0 0 0 0 0 0\n"
            );
            let error = try_read("a.ply", &text).expect_err("the file is far too short");
            // Refused by size, not by reading until the end.
            let by_size = matches!(&error, Error::Truncated { missing, .. } if missing.contains("need at least"));
            assert!(
                by_size || matches!(error, Error::TooLarge { .. }),
                "{error}"
            );
        }
        // A list that claims four thousand million corners.
        let head = format!(
            "ply\nformat {encoding} 1.0\n{}element face 1\nproperty list uint int vertex_indices\nend_header\n",
            vertex(1)
        );
        let body: &[u8] = if encoding == "ascii" {
            b"0 0 0 4000000000 0 0 0"
        } else {
            &[0xee; 64]
        };
        assert!(matches!(
            try_read("a.ply", [head.as_bytes(), body].concat()),
            Err(Error::Truncated { .. })
        ));
    }
    // Rows without properties take no bytes and no time.
    let empty = format!(
        "ply\nformat ascii 1.0\nelement nothing {}\n{}end_header\n0 0 0\n",
        u64::MAX,
        vertex(1)
    );
    assert_eq!(read("a.ply", empty).mesh.positions.len(), 1);
    for text in [
        "OFF 4000000000 1 0\n0 0 0\n",
        "OFF\n1 18446744073709551615 0\n0 0 0\n",
    ] {
        assert!(matches!(
            try_read("a.off", text),
            Err(Error::Truncated { .. } | Error::TooLarge { .. })
        ));
    }
    assert!(matches!(
        try_read("a.tri", "4000000000 9\n1 2 3\n"),
        Err(Error::Truncated { .. })
    ));
    let mut stl = vec![0; 84 + 49];
    stl[80..84].fill(0xff);
    assert!(matches!(
        try_read("a.stl", &stl),
        Err(Error::Truncated { .. })
    ));
}
