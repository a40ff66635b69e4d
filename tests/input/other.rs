//! STL, OFF and TRI.

use glam::Vec3;
use surfel::input::{Format, ReadWarning};

use super::{SQUARE, message, read};

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
        [ReadWarning::TrailingBytes { bytes: 7 }]
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
        ("outer", "other", "line 4: a vertex stands outside"),
        (
            "vertex 1 1 0\n  endloop",
            "vertex 1 1 0\n",
            "line 8: `endfacet` before `endloop`",
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

#[test]
fn off_in_its_variants() {
    let plain = "# c\nOFF # c\n\n4 1 0\n0 0 0\n1 0 0\n# c\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n";
    let on_a_line = "OFF 4 1\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n4 0 1 2 3\r\n";
    let headless = "4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    for text in [plain, on_a_line, headless] {
        let loaded = read("a.off", text);
        assert_eq!(loaded.mesh.positions, SQUARE);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(loaded.mesh.normals, []);
        let color = [255, 0, 0, 255];
        let wanted = if text == plain {
            vec![color; 4]
        } else {
            vec![]
        };
        assert_eq!(loaded.mesh.colors, wanted);
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
    assert!(matches!(
        bare.warnings[..],
        [ReadWarning::PartMissing { .. }]
    ));
    for (text, wanted) in [
        (
            format!("Vertices\n{points}"),
            "the part `Triangles` is missing",
        ),
        (
            format!("Vertices\n{points}Triangles\n0 1 5\n"),
            "line 7: a face names vertex 5",
        ),
        (
            format!("Vertices\n{points}Triangles\n0 1 4\n"),
            "line 7: a face names vertex 4, but the file has 4 (numbered from 0)",
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
