//! Reading models: every format and variant from hand-made bytes, every damage refused in words, the real models
//! counted.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use glam::{DVec3, Vec3};
use surfel::input::{self, Error, Format, Loaded, Options, Place, Warning};
use surfel::progress::Silent;

fn read(name: &str, bytes: impl AsRef<[u8]>) -> Loaded {
    try_read(name, bytes).unwrap_or_else(|error| panic!("{error}"))
}

fn try_read(name: &str, bytes: impl AsRef<[u8]>) -> Result<Loaded, Error> {
    input::load_bytes(name, bytes.as_ref(), &Options::default(), &Silent)
}

fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    try_read(name, bytes)
        .expect_err("this file is damaged")
        .to_string()
}

const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

// ---------------------------------------------------------------------------------------------------------- OBJ

#[test]
fn obj_square_with_everything() {
    let loaded = read(
        "a.obj",
        "# c\r\nmtllib none.mtl\r\nv 0 0 0 1 0 0\r\nv 1 0 0 0 1 0\r\nv 1 1 0 0 0 1\r\nv 0 1 0\r\nvt 0 0\r\nvn 0 0 2\r\n\
         g a\r\nusemtl x\r\nf 1/1/1 2//1 \\\r\n 3//-1 -1//1 # c\r\nl 1 2\r\n",
    );
    assert_eq!(loaded.mesh.positions, SQUARE);
    assert_eq!(loaded.mesh.normals, [Vec3::Z; 4]);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(
        loaded.mesh.colors,
        [
            [255, 0, 0, 255],
            [0, 255, 0, 255],
            [0, 0, 255, 255],
            [255; 4]
        ]
    );
    assert_eq!(
        (loaded.format, loaded.counts.vertices, loaded.counts.faces),
        (Format::Obj, 4, 1)
    );
    assert_eq!(
        loaded.warnings,
        [Warning::PartsIgnored {
            what: "lines, points and curves",
            count: 1
        }]
    );
}

#[test]
fn obj_vertices_split_only_where_normals_differ_in_value() {
    let loaded = read(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nvn 0 0 1\nvn 0 0 1\nvn 1 0 0\n\
         f 1//1 2//1 3//1\nf 1//2 3//2 4//3\nf 3//3 4//3 1\n",
    );
    // Corner 3 with the normal of x, and corner 1 with none, are new; vertex 9 is used by nobody but stays.
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3], [5, 3, 6]]);
    assert_eq!(
        loaded.mesh.positions[5..],
        [Vec3::new(1.0, 1.0, 0.0), Vec3::ZERO]
    );
    assert_eq!(
        loaded.mesh.normals[2..],
        [Vec3::Z, Vec3::X, Vec3::ZERO, Vec3::X, Vec3::ZERO]
    );
    assert_eq!(loaded.warnings, []);
}

#[test]
fn obj_faces_may_point_ahead_but_not_beyond() {
    let loaded = read("a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n";
    assert!(matches!(
        try_read("a.obj", text),
        Err(Error::Index {
            place: Place::Line(5),
            index: 4,
            count: 3,
            what: "vertex",
            ..
        })
    ));
    assert!(
        message("a.obj", text)
            .starts_with("a.obj, line 5: a face names vertex 4, but the file has 3")
    );
    for (corner, line) in [
        ("0", 4),
        ("-4", 4),
        ("99999999999999999999", 4),
        ("1//1", 4),
        ("x", 4),
        ("1/1/1/1", 4),
    ] {
        let text = format!("v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 {corner}\r\nf 1 2 3\r\n");
        assert!(
            message("a.obj", &text).contains(&format!("line {line}:")),
            "{corner}"
        );
    }
    assert!(message("a.obj", "v 0 0 0\nv 1 zwei 0\n").contains("line 2: `zwei` is not a number"));
    assert!(message("a.obj", "v 0 0 0\nv 1 2\n").contains("line 2"));
}

#[test]
fn obj_materials_color_their_faces() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("two colors.mtl"),
        "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\nmap_Kd t.png\n",
    )
    .unwrap();
    let path = folder.path().join("a.obj");
    let text = "mtllib two colors.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 1 2 4\n";
    std::fs::write(&path, text).unwrap();
    let loaded = input::load(&path, &Options::default(), &Silent).unwrap();
    let colors_of = |triangle: [u32; 3]| triangle.map(|corner| loaded.mesh.colors[corner as usize]);
    assert_eq!(colors_of(loaded.mesh.triangles[0]), [[255, 0, 0, 255]; 3]);
    assert_eq!(colors_of(loaded.mesh.triangles[1]), [[0, 0, 255, 255]; 3]);
    assert_eq!(colors_of(loaded.mesh.triangles[2]), [[255; 4]; 3]);
    // Four, two more for the second material, three for the third.
    assert_eq!(loaded.mesh.positions.len(), 9);
    assert!(loaded.warnings.contains(&Warning::TextureIgnored {
        name: "t.png".into(),
        count: 1
    }));
    assert!(loaded.warnings.contains(&Warning::MaterialUnknown {
        name: "c".into(),
        count: 1
    }));

    let plain = Options {
        materials: false,
        ..Options::default()
    };
    let loaded = input::load(&path, &plain, &Silent).unwrap();
    assert_eq!(
        (loaded.mesh.positions.len(), loaded.mesh.colors.len()),
        (4, 0)
    );
    assert_eq!(loaded.warnings, []);
}

#[test]
fn obj_points_are_a_cloud() {
    let loaded = read("a.obj", "v 0 0 0\nvn 0 0 1\nv 1 0 0\nvn 1 0 0\n");
    assert!(loaded.mesh.is_cloud());
    assert_eq!(loaded.mesh.normals, [Vec3::Z, Vec3::X]);
}

// ---------------------------------------------------------------------------------------------------------- PLY

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
        put!(65535_u16);
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
    put!(7_i32);
    for corner in [0_i32, 1, 2, 3, -1, 1, 2] {
        put!(corner);
    }
    out
}

const PLY_ASCII_BODY: &str = "1.5 2 7 8\n0 0 0 0 200 65535 .5 9 0 0 3\n1 0 0 1 .5 200 65535 .5 9 0 0 3\n\
    1 1 0 2 .5 .5 200 65535 .5 9 0 0 3\n0 1 0 3 .5 .5 .5 200 65535 .5 9 0 0 3\n\
    1 4 0 1 2 3 2 .25 .25\n1 2 0 1 0\n7 0 1 2 3 -1 1 2\n";

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
        assert_eq!(loaded.mesh.colors, [[200, 255, 128, 255]; 4]);
        assert_eq!(
            loaded.mesh.triangles,
            [[0, 1, 2], [0, 2, 3], [0, 1, 2], [2, 1, 3]]
        );
        assert_eq!(loaded.warnings, [Warning::FacesTooSmall { count: 1 }]);
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
        assert_eq!(loaded.warnings, []);
    }
}

#[test]
fn ply_fixed_rows_fall_back_to_find_the_place() {
    let good = ply_fixed(9, 7, false, false);
    let body = good.len() - 7 * 14;
    // Row 5 names vertex 9; its third corner ends at byte 13 of the row.
    let mut bad = good.clone();
    bad[body + 5 * 14 + 9] = 9;
    let place = Place::Byte((body + 5 * 14 + 12) as u64);
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
    let left_over = |warning: &Warning| matches!(warning, Warning::TrailingBytes { .. });
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
            assert!(
                matches!(error, Error::Truncated { .. } | Error::TooLarge { .. }),
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
    let mut stl = vec![0; 84 + 50];
    stl[80..84].fill(0xff);
    assert!(matches!(
        try_read("a.stl", &stl),
        Err(Error::Truncated { .. })
    ));
}

// ---------------------------------------------------------------------------------------------------------- STL

const STL_ASCII: &str = "solid a vertex facet\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   \
    vertex 1 1 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex -0 0 0\n   vertex 1 1 0\n   \
    vertex 0 1 0\n  endloop\n endfacet\nendsolid a\n";

fn stl_binary(header: &str) -> Vec<u8> {
    let mut out = header.as_bytes().to_vec();
    out.resize(80, b' ');
    out.extend(2_u32.to_le_bytes());
    for triangle in [[0, 1, 2], [0, 2, 3]] {
        out.extend([0; 12]);
        for corner in triangle {
            SQUARE[corner]
                .to_array()
                .iter()
                .for_each(|value| out.extend(value.to_le_bytes()));
        }
        out.extend([1, 2]);
    }
    out
}

#[test]
fn stl_of_both_kinds_is_a_welded_mesh() {
    for (format, bytes) in [
        (Format::StlAscii, STL_ASCII.as_bytes().to_vec()),
        (
            Format::StlAscii,
            STL_ASCII.to_uppercase().replace('\n', "\r\n").into_bytes(),
        ),
        (Format::StlBinary, stl_binary("binary")),
        (
            Format::StlBinary,
            stl_binary("solid facet normal outer loop"),
        ),
    ] {
        for name in ["a.stl", "no ending"] {
            let loaded = read(name, &bytes);
            assert_eq!(loaded.format, format);
            assert_eq!(loaded.mesh.positions, SQUARE);
            assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
            assert_eq!(loaded.mesh.normals, []);
            assert_eq!((loaded.counts.vertices, loaded.counts.faces), (6, 2));
            assert_eq!(loaded.warnings, []);
        }
    }
    let mut longer = stl_binary("solid");
    longer.extend([0; 7]);
    assert_eq!(
        read("a.stl", longer).warnings,
        [Warning::TrailingBytes { bytes: 7 }]
    );
}

#[test]
fn stl_that_is_wrong_says_where() {
    for (old, new, wanted) in [
        (
            "vertex 1 1 0\n  endloop",
            "vertex 1 x 0\n  endloop",
            "line 6: `x` is not a number",
        ),
        ("  outer loop\n", "", "line 3: a vertex stands outside"),
        ("endfacet", "endface", "line 8: unknown keyword `endface`"),
        ("outer", "other", "line 3: unknown keyword `other`"),
        ("endsolid a\n", "", "`endsolid` is missing"),
        (
            "normal",
            "nrml",
            "line 2: `nrml` where `normal` should stand",
        ),
    ] {
        assert!(STL_ASCII.contains(old));
        let found = message("a.stl", STL_ASCII.replacen(old, new, 1));
        assert!(found.contains(wanted), "{found}");
    }
    let mut short = stl_binary("solid");
    short.pop();
    assert!(
        message("a.stl", short)
            .contains("byte 183: the file ends early: 2 triangles need 100 bytes")
    );
}

// ----------------------------------------------------------------------------------------------------- OFF, TRI

#[test]
fn off_in_its_variants() {
    let plain = "# c\nOFF # c\n\n4 1 0\n0 0 0\n1 0 0\n# c\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n";
    let on_a_line = "OFF 4 1\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n4 0 1 2 3\r\n";
    let headless = "4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    for text in [plain, on_a_line, headless] {
        let loaded = read("a.off", text);
        assert_eq!(loaded.mesh.positions, SQUARE);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(
            (loaded.mesh.normals.len(), loaded.mesh.colors.len()),
            (0, 0)
        );
        assert_eq!((loaded.format, loaded.counts.faces), (Format::Off, 1));
    }
    let bytes = read("a.off", "COFF\n1 0 0\n0 0 0 255 0 128 255\n");
    assert_eq!(bytes.mesh.colors, [[255, 0, 128, 255]]);
    assert!(bytes.mesh.is_cloud());
    let units = read("a.off", "CNOFF\n1 0 0\n0 0 0 0 2 0 1 0 .5 1\n");
    assert_eq!(
        (units.mesh.normals[0], units.mesh.colors[0]),
        (Vec3::Y, [255, 0, 128, 255])
    );
    for (text, wanted) in [
        (
            "OFF\n1 1 0\n0 0 0\n3 0 0 1\n",
            "line 4: a face names vertex 1",
        ),
        ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "line 4: `` is not the index"),
        ("OFF\n1 1 0\n0 0 0\n-3 0 0\n", "line 4: `-3` is not a count"),
        ("OFF\n1 1 0\n0 0\n3 0 0 0\n", "line 3: `` is not a number"),
        (
            "OFF\n2 1 0\n0 0 0.0000000000000\n",
            "ends early: vertices are missing",
        ),
        (
            "OFF\n1 1 0\n0 0 0.0000000000000\n",
            "ends early: faces are missing",
        ),
        ("OFF\n", "ends early"),
        ("OFF\na b c\n", "line 2: `a` is not a count"),
        ("OFF BINARY\n", "binary OFF, which is not read yet"),
        ("4OFF\n", "not read yet"),
    ] {
        let found = message("a.off", text);
        assert!(found.contains(wanted), "{found}");
    }
}

#[test]
fn tri_of_both_kinds() {
    let points = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let normals = "0 0 1\n".repeat(4);
    let faces = "0 1 2\n0 2 3\n";
    let faces_from_one = "1 2 3\n1 3 4\n";
    for text in [
        format!("Vertices\n{points}Vertices' Normals\n{normals}Triangles\n{faces}"),
        format!("[VERTICES] 4\n{points}")
            .replace('[', "")
            .replace(']', ":")
            + &format!(
                "vertices_normals: 4\n{normals}Triangles' Normals\n0 0 1\n0 0 1\ntriangles 2\n{faces_from_one}"
            ),
        format!("Triangles\n2\n{faces}Vertices\n4\n{points}VerticesNormals\n4\n{normals}"),
        format!("4 2\n{}{faces}", points.replace('\n', " 0 0 1\n")),
        format!("4 2\n{}{faces}", points.replace('\n', " 0 0 1 1 0 0\n")),
    ] {
        let loaded = read("a.tri", &text);
        assert_eq!(loaded.format, Format::Tri);
        assert_eq!(loaded.mesh.positions, SQUARE, "{text}");
        assert_eq!(loaded.mesh.normals, [Vec3::Z; 4]);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{text}");
        assert!(
            loaded
                .mesh
                .colors
                .iter()
                .all(|&color| color == [255, 0, 0, 255])
        );
    }
    let bare = read("a.tri", format!("Vertices\n{points}Triangles\n{faces}"));
    assert_eq!(bare.mesh.normals, []);
    assert!(matches!(bare.warnings[..], [Warning::PartMissing { .. }]));
    for (text, wanted) in [
        (
            format!("Vertices\n{points}"),
            "the part `Triangles` is missing",
        ),
        (
            format!("Vertices 5\n{points}Triangles\n{faces}"),
            "line 1: 5 vertices promised, 4 found",
        ),
        (
            format!("Vertices\n{points}Triangles\n0 1 5\n"),
            "line 7: a face names vertex 5",
        ),
        (
            format!("Vertices\n{points}Normals\n0 0 1\nTriangles\n{faces}"),
            "1 normals for 4 vertices",
        ),
        (
            format!("Vertices\n{points}1 2\nTriangles\n{faces}"),
            "line 6: a row of 2 numbers",
        ),
        (
            format!("4 2\n{points}00000 00001 00002\n"),
            "ends early: triangles are missing",
        ),
        ("Triangles\n".to_owned(), "no vertices"),
    ] {
        let found = message("a.tri", &text);
        assert!(found.contains(wanted), "{found}");
    }
}
