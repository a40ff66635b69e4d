//! What people's programs write beside the formats' letter: read as they mean it, with a remark where something is left
//! out or guessed.

use std::f32::consts::PI;

use glam::Vec3;
use surfel::input::{self, FilePlace, LoadedMesh, PartFate, ReadOptions, ReadWarning};
use surfel::progress::SilentProgress;

use super::{check, message, read};

fn remarks(loaded: &LoadedMesh) -> String {
    let lines: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// A part of the inventory, by its name.
fn fate(loaded: &LoadedMesh, name: &str) -> (u64, PartFate) {
    let part = loaded.parts.iter().find(|part| part.name == name);
    let part = part.unwrap_or_else(|| panic!("no {name} in {:#?}", loaded.parts));
    (part.count, part.fate)
}

/// Twice the area of the triangles, with the sign that it has seen from +z.
fn areas(loaded: &LoadedMesh) -> Vec<f32> {
    let mesh = &loaded.mesh;
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
        (b - a).cross(c - a).z
    };
    mesh.triangles.iter().map(area).collect()
}

#[test]
fn concave_faces_are_covered_once_in_every_format() {
    // A star of five points; as fans from an inner corner or an outer one it would cover its outside.
    let points: Vec<Vec3> = (0..10)
        .map(|i| {
            let (sin, cos) = (i as f32 * PI / 5.0).sin_cos();
            let radius = if i % 2 == 0 { 2.0 } else { 0.7 };
            Vec3::new(radius * cos, radius * sin, 0.0)
        })
        .collect();
    let wanted: f32 = (0..10)
        .map(|i| points[i].cross(points[(i + 1) % 10]).z)
        .sum();
    let rows: String = points
        .iter()
        .map(|p| format!("{} {} {}\n", p.x, p.y, p.z))
        .collect();
    let from =
        |first: usize| -> String { (0..10).map(|i| format!(" {}", (i % 10) + first)).collect() };
    let obj: String = rows
        .lines()
        .map(|row| format!("v {row}\n"))
        .collect::<String>()
        + "f"
        + &from(1);
    let closed = format!("{obj} 1\n");
    let off = format!("OFF\n10 1 0\n{rows}10{}\n", from(0));
    let head = "element vertex 10\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
                property list uchar int vertex_indices\nend_header\n";
    let ply = format!("ply\nformat ascii 1.0\n{head}{rows}10{}\n", from(0));
    let mut binary = format!("ply\nformat binary_little_endian 1.0\n{head}").into_bytes();
    points
        .iter()
        .for_each(|p| binary.extend(bytemuck::bytes_of(p)));
    binary.push(10);
    (0..10_i32).for_each(|i| binary.extend(i.to_le_bytes()));
    // Faces before vertices.
    let faces_first = format!("f{}\n{}", from(1), obj.rsplit_once('\n').unwrap().0);
    let loops: String = rows.lines().map(|row| format!("vertex {row}\n")).collect();
    let stl =
        format!("solid\nfacet normal 0 0 1\nouter loop\n{loops}endloop\nendfacet\nendsolid\n");
    for (name, bytes) in [
        ("a.obj", obj.into_bytes()),
        ("closed.obj", closed.into_bytes()),
        ("first.obj", faces_first.into_bytes()),
        ("a.off", off.into_bytes()),
        ("a.ply", ply.into_bytes()),
        ("b.ply", binary),
        ("a.stl", stl.into_bytes()),
    ] {
        let loaded = read(name, &bytes);
        let areas = areas(&loaded);
        assert_eq!(areas.len(), 8, "{name}");
        assert!(areas.iter().all(|&area| area > 1e-4), "{name}: {areas:?}");
        assert!((areas.iter().sum::<f32>() - wanted).abs() < 1e-4, "{name}");
        if name == "closed.obj" {
            assert_eq!(
                loaded.warnings,
                [ReadWarning::FirstCornerRepeated { count: 1 }]
            );
        } else {
            assert_eq!(loaded.warnings, [], "{name}");
        }
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn obj_what_decides_no_shape_is_a_remark_with_its_place() {
    for (text, wanted) in [
        (
            "vn 0 0 1\nf 1//7 2//7 3//7\n",
            "3 corners name normals that the file does not have, the first on line 5",
        ),
        ("vn 0 0 1\nf 1//0 2 3\n", "line 5: corners name normals"),
        ("vn 0 0 1\nf 1//-2 2 3\n", "line 5: corners name normals"),
        ("vn 0 0 1\nf 1//x 2 3\n", "line 5: corners name normals"),
        (
            "f 1/1/1 2/2/2 3/3/3\n",
            "3 corners name texture coordinates that the file does not have, the first on line 4; ignored\n\
             3 corners name normals",
        ),
        (
            "vn a b c\nf 1//1 2//1 3//1\n",
            "line 4: normals are no three numbers",
        ),
        (
            "vn 1\nf 1//1 2//1 3//1\n",
            "line 4: normals are no three numbers",
        ),
        ("f 1/1/1/1 2 3\n", "line 4: corners say more than"),
        (
            "v 0 0 9 red\nf 1 2 3\n",
            "line 4: values beside the position are no numbers",
        ),
    ] {
        let loaded = read("a.obj", format!("{TRIANGLE}{text}"));
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]], "{text}");
        assert_eq!(loaded.mesh.normals, [], "{text}");
        assert!(
            remarks(&loaded).contains(wanted),
            "{text}: {}",
            remarks(&loaded)
        );
        check(&loaded, text.len() + TRIANGLE.len());
    }
    // What comes later is no fault, and good corners keep their normals beside bad ones.
    let later = read(
        "a.obj",
        format!("f 1/1/1 2/1/1 3/1/9\n{TRIANGLE}vt 0 0\nvn 0 0 1\n"),
    );
    assert_eq!(later.mesh.normals, [Vec3::Z, Vec3::Z, Vec3::ZERO]);
    assert_eq!(
        later.warnings[0].to_string(),
        "line 1: corners name normals that the file does not have; their normals are computed"
    );
    assert_eq!(
        fate(&later, "vt (texture coordinates)"),
        (1, PartFate::LeftOut)
    );
    // Positions and faces stay strict.
    assert!(message("a.obj", format!("{TRIANGLE}f 1 2 4\n")).contains("line 4"));
    assert!(message("a.obj", "v 0 0 x\n").contains("line 1"));
}

#[test]
fn ply_text_that_decides_no_shape_may_be_wrong() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n\
                property uchar blue\nproperty float quality\nelement face 1\nproperty list uchar int vertex_indices\n\
                property list uchar float texcoord\nend_header\n\
                0 0 0 0 0 1 9 9 9 -\n1 0 0 0 0 - 9 ? 9 1\n0 1 0 0 0 1 9 9 9 1\n3 0 1 2 2 a b\n";
    let loaded = read("a.ply", text);
    assert_eq!(loaded.mesh.normals, [Vec3::Z, Vec3::ZERO, Vec3::Z]);
    assert_eq!(loaded.mesh.colors[1], [9, 0, 9, 255]);
    let found = remarks(&loaded);
    for wanted in [
        "line 19: normals are no three numbers",
        "line 19: colors are no numbers",
        "3 values beside the position are no numbers, the first on line 18",
        "left out: texcoord of face",
    ] {
        assert!(found.contains(wanted), "{found}");
    }
}

/// A binary STL of a strip of `triangles`, with a header, the count that it says and 16 bits of color each.
fn stl(header: &[u8], count: u32, triangles: u32, color: impl Fn(u32) -> u16) -> Vec<u8> {
    let mut out = header.to_vec();
    out.resize(80, 0);
    out.extend(count.to_le_bytes());
    for i in 0..triangles {
        out.extend([0; 12]);
        for corner in if i % 2 == 0 {
            [i, i + 1, i + 2]
        } else {
            [i + 1, i, i + 2]
        } {
            let point = Vec3::new(corner as f32, (corner % 2) as f32, 0.0);
            out.extend(bytemuck::bytes_of(&point));
        }
        out.extend(color(i).to_le_bytes());
    }
    out
}

#[test]
fn stl_counts_are_not_believed_against_the_size() {
    let contradiction = |promised, found| {
        [ReadWarning::CountContradicts {
            what: "triangles",
            promised,
            found,
        }]
    };
    for count in [0, 3, 6, 8, 4_000_000_000] {
        let loaded = read("a.stl", stl(b"exporter", count, 7, |_| 0));
        assert_eq!(loaded.mesh.triangles.len(), 7, "{count}");
        assert_eq!(loaded.warnings, contradiction(u64::from(count), 7));
    }
    let more = read("a.stl", stl(b"exporter", 8, 7, |_| 0));
    assert!(remarks(&more).contains("check that the file has not been cut short"));
    // Cut short in the last triangle.
    let mut short = stl(b"exporter", 7, 7, |_| 0);
    short.truncate(short.len() - 20);
    assert!(
        message("a.stl", &short)
            .contains("7 triangles need 350 bytes after the header, there are 330")
    );
    // Something else than triangles follows.
    let mut longer = stl(b"exporter", 3, 3, |_| 0);
    longer.extend([b'x'; 120]);
    assert_eq!(
        read("a.stl", &longer).warnings,
        [ReadWarning::TrailingBytes { bytes: 120 }]
    );
    longer = stl(b"exporter", 3, 5, |_| 0);
    longer.extend(b"\r\n");
    let loaded = read("a.stl", &longer);
    assert_eq!(loaded.mesh.triangles.len(), 5);
    assert_eq!(loaded.warnings[..1], contradiction(3, 5));
}

#[test]
fn stl_colors_of_both_conventions() {
    let five = |r: u16, g: u16, b: u16| r << 10 | g << 5 | b;
    // VisCAM: valid with bit 15, red on top.
    let loaded = read(
        "a.stl",
        stl(b"viscam", 3, 3, |i| {
            [five(31, 0, 0) | 1 << 15, five(0, 16, 31) | 1 << 15, 0][i as usize]
        }),
    );
    let colors = |loaded: &LoadedMesh, triangle: usize| {
        loaded.mesh.triangles[triangle].map(|corner| loaded.mesh.colors[corner as usize])
    };
    assert_eq!(colors(&loaded, 0), [[255, 0, 0, 255]; 3]);
    assert_eq!(colors(&loaded, 1), [[0, 132, 255, 255]; 3]);
    assert_eq!(colors(&loaded, 2), [[255; 4]; 3]);
    // Corners of one color are one vertex: 3 and 3 and 3 of a strip of 5.
    assert_eq!(loaded.mesh.positions.len(), 9);
    // Magics: the color of the part with bit 15, red below.
    let loaded = read(
        "a.stl",
        stl(b"COLOR=\x10\x20\x30\xff,MATERIAL=", 2, 2, |i| {
            [1 << 15, five(0, 16, 31)][i as usize]
        }),
    );
    assert_eq!(colors(&loaded, 0), [[16, 32, 48, 255]; 3]);
    assert_eq!(colors(&loaded, 1), [[255, 132, 0, 255]; 3]);
    assert_eq!(
        fate(&loaded, "16 bits after each triangle"),
        (2, PartFate::Used)
    );
    // All of them zero: the color of the part.
    let loaded = read("a.stl", stl(b"COLOR=\x10\x20\x30\xff", 2, 2, |_| 0));
    assert_eq!(loaded.mesh.colors, [[16, 32, 48, 255]; 4]);
    // Bits that are no color.
    let loaded = read("a.stl", stl(b"x", 2, 2, |_| 7));
    assert_eq!(loaded.mesh.colors, [[0; 4]; 0]);
    assert_eq!(
        fate(&loaded, "16 bits after each triangle"),
        (2, PartFate::Unneeded)
    );
}

#[test]
fn stl_text_may_be_misspelt_where_no_shape_depends_on_it() {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let misspelt = "read all the same";
    for (text, wanted) in [
        (format!("solid a\n{facet}end solid a\n"), misspelt),
        (format!("solid a\n{facet}endsolit\n"), misspelt),
        (
            format!(
                "solid a\n{}endsolid\n",
                facet.replace("endloop", "end loop")
            ),
            misspelt,
        ),
        (
            format!("solid a\n{}endsolid\n", facet.replace("endloop", "endlop")),
            misspelt,
        ),
        (
            format!(
                "solid a\n{}endsolid\n",
                facet.replace("endfacet", "endface")
            ),
            misspelt,
        ),
        (
            format!("solid a\n{}endsolid\n", facet.replace("endfacet\n", "")),
            "",
        ),
        (format!("solid a\n{facet}"), "`endsolid` is missing"),
        (
            format!(
                "solid a\n{}endsolid\n",
                facet.replace("0 0 1\n", "nan nan\n")
            ),
            "normals are no three numbers",
        ),
        (
            format!("solid a\n{}endsolid\n", facet.replace("normal 0 0 1", "")),
            "line 2: normals are no three numbers",
        ),
        (
            format!(
                "solid a\n{}endsolid\n",
                facet.replace("0 0 1\n", "1,0 0 x\n")
            ),
            "line 2: normals are no three numbers",
        ),
        (
            format!("solid a\ncolor 0 1 0\n{facet}endsolid\n"),
            "line 2: lines are not known; ignored",
        ),
    ] {
        let loaded = read("a.stl", &text);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]], "{text}");
        let found = remarks(&loaded);
        assert!(
            found.contains(wanted) && found.is_empty() == wanted.is_empty(),
            "{text}: {found}"
        );
    }
    let cut = format!("solid a\n{}", facet.split("endloop").next().unwrap());
    assert!(message("a.stl", cut).contains("`endloop` is missing"));
}

#[test]
fn tri_counts_and_normals_are_remarks() {
    let points = "0 0 0\n1 0 0\n0 1 0\n";
    let loaded = read(
        "a.tri",
        format!("Vertices 5\n{points}Normals\n0 0 1\n0 0 x\nTriangles\n0 1 2\n"),
    );
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(loaded.mesh.normals, [Vec3::Z, Vec3::ZERO, Vec3::ZERO]);
    let found = remarks(&loaded);
    assert!(
        found.contains("the header says 5 vertices, the file holds 3"),
        "{found}"
    );
    assert!(
        found.contains("3 vertices with a normal, the file holds 2"),
        "{found}"
    );
}

/// The body of a PLY file with one property line each and rows of text.
fn ply(properties: &str, rows: &str) -> String {
    let head: String = properties
        .split(", ")
        .map(|property| format!("property {property}\n"))
        .collect();
    let count = rows.lines().count();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n{head}\
         end_header\n{rows}"
    )
}

#[test]
fn colors_have_the_range_of_their_values() {
    let rgb = |kind: &str| format!("{kind} Red, {kind} Green, {kind} Blue");
    let range = |largest| vec![ReadWarning::ColorRange { largest }];
    for (properties, rows, wanted, remark) in [
        (
            rgb("float"),
            "0 0 0 1 0.5 0\n1 0 0 0 1 1\n",
            [[255, 128, 0, 255], [0, 255, 255, 255]],
            vec![],
        ),
        (
            rgb("float"),
            "0 0 0 255 128 0\n1 0 0 1 2 3\n",
            [[255, 128, 0, 255], [1, 2, 3, 255]],
            range(255),
        ),
        (
            rgb("double"),
            "0 0 0 0.5 1 0\n1 0 0 10.4 200 3\n",
            [[1, 1, 0, 255], [10, 200, 3, 255]],
            range(255),
        ),
        (
            rgb("float"),
            "0 0 0 65535 32896 0\n1 0 0 257 0 0\n",
            [[255, 128, 0, 255], [1, 0, 0, 255]],
            range(65535),
        ),
        (
            rgb("ushort"),
            "0 0 0 65535 32896 0\n1 0 0 257 0 0\n",
            [[255, 128, 0, 255], [1, 0, 0, 255]],
            vec![],
        ),
        (
            rgb("ushort"),
            "0 0 0 255 128 0\n1 0 0 1 0 0\n",
            [[255, 128, 0, 255], [1, 0, 0, 255]],
            range(255),
        ),
        (
            rgb("int"),
            "0 0 0 255 128 0\n1 0 0 1 0 0\n",
            [[255, 128, 0, 255], [1, 0, 0, 255]],
            vec![],
        ),
        (
            rgb("char"),
            "0 0 0 -1 -128 0\n1 0 0 127 0 0\n",
            [[255, 128, 0, 255], [127, 0, 0, 255]],
            vec![],
        ),
    ] {
        let text = ply(&properties, rows);
        let loaded = read("a.ply", &text);
        assert_eq!(loaded.mesh.colors, wanted, "{text}");
        assert_eq!(loaded.warnings, remark, "{text}");
        // The same in binary, which is read in another way.
        let loaded = read("a.ply", binary(&text));
        let near = |a: &[u8; 4], b: &[u8; 4]| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
        let colors = &loaded.mesh.colors;
        assert!(
            colors.iter().zip(&wanted).all(|(a, b)| near(a, b)),
            "{text}: {colors:?}"
        );
        assert_eq!(loaded.warnings, remark, "{text}");
    }
    let obj = read("a.obj", "v 0 0 0 255 0 128\nv 1 0 0 0 0 1\n");
    assert_eq!(obj.mesh.colors, [[255, 0, 128, 255], [0, 0, 1, 255]]);
    assert_eq!(obj.warnings, range(255));
    // Colors without a C in the keyword.
    let off = read("a.off", "OFF\n2 0 0\n0 0 0 255 0 128\n1 0 0 0 0 1 255\n");
    assert_eq!(off.mesh.colors, [[255, 0, 128, 255], [0, 0, 1, 255]]);
    assert_eq!(off.warnings, []);
    let off = read("a.off", "COFF\n2 0 0\n0 0 0 255 0 x\n1 0 0 0 0 1 7\n");
    assert_eq!(off.mesh.colors, [[255, 255, 255, 255], [0, 0, 255, 255]]);
    assert!(remarks(&off).contains("line 3: colors are no numbers"));
    assert!(remarks(&off).contains("left out: transparency"));
}

/// The little-endian form of a PLY of text whose properties are numbers.
fn binary(text: &str) -> Vec<u8> {
    let (head, rows) = text.split_once("end_header\n").unwrap();
    let kinds: Vec<&str> = head
        .lines()
        .filter_map(|line| line.strip_prefix("property "))
        .map(|line| line.split(' ').next().unwrap())
        .collect();
    let head = head.replace("ascii", "binary_little_endian");
    let mut out = format!("{head}end_header\n").into_bytes();
    for row in rows.lines() {
        for (word, kind) in row.split(' ').zip(&kinds) {
            let value: f64 = word.parse().unwrap();
            match *kind {
                "float" => out.extend((value as f32).to_le_bytes()),
                "double" => out.extend(value.to_le_bytes()),
                "uchar" => out.push(value as u8),
                "char" => out.push(value as i8 as u8),
                "ushort" => out.extend((value as u16).to_le_bytes()),
                "int" => out.extend((value as i32).to_le_bytes()),
                "uint" => out.extend((value as u32).to_le_bytes()),
                other => panic!("{other}"),
            }
        }
    }
    out
}

#[test]
fn packed_colors_are_bits_or_numbers() {
    let bits = 0x00c8_6432_u32;
    let wanted = [200, 100, 50, 255];
    let opaque = bits | 0xff00_0000;
    let as_float = f32::from_bits(bits);
    for (properties, value) in [
        ("float rgb", format!("{as_float:e}")),
        ("float RGB", format!("{bits}")),
        ("int rgb", format!("{bits}")),
        ("uint rgba", format!("{opaque}")),
        ("int rgba", format!("{}", opaque as i32)),
    ] {
        let text = ply(properties, &format!("0 0 0 {value}\n"));
        assert_eq!(read("a.ply", &text).mesh.colors, [wanted], "{text}");
        assert_eq!(read("a.ply", binary(&text)).mesh.colors, [wanted], "{text}");
    }
    // The bits of a color with alpha are no number as a float, in both orders of bytes.
    for (encoding, bytes) in [
        ("binary_little_endian", opaque.to_le_bytes()),
        ("binary_big_endian", opaque.to_be_bytes()),
    ] {
        let head = ply("float rgba", "0 0 0 0\n").replace("ascii", encoding);
        let mut out = head
            .split_inclusive("end_header\n")
            .next()
            .unwrap()
            .as_bytes()
            .to_vec();
        out.extend([0; 12]);
        out.extend(bytes);
        let loaded = read("a.ply", out);
        assert_eq!(loaded.mesh.colors, [wanted]);
        assert_eq!(loaded.warnings, []);
    }
}

#[test]
fn colors_of_vertices_may_be_lists() {
    let header = |item: &str, name: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property list uchar {item} {name}\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let rows = "0 0 0 3 255 0 9\n1 0 0 4 0 255 9 77\n0 1 0 1 3\n3 0 1 2\n";
    let bytes = header("uchar", "rgb") + rows;
    let of_bytes = read("a.ply", &bytes);
    let colors = [[255, 0, 9, 255], [0, 255, 9, 255], [3, 0, 0, 255]];
    assert_eq!(of_bytes.mesh.colors, colors);
    assert_eq!(fate(&of_bytes, "property rgb of vertex").1, PartFate::Used);
    let floats =
        header("float", "Color") + "0 0 0 3 1 0 0\n1 0 0 3 0 1 0\n0 1 0 3 0 0 0.5\n3 0 1 2\n";
    let of_floats = read("a.ply", &floats);
    assert_eq!(
        of_floats.mesh.colors[..2],
        [[255, 0, 0, 255], [0, 255, 0, 255]]
    );
}

#[test]
fn gaussian_splats_have_their_base_color_and_a_sentence() {
    let properties = "float nx, float ny, float nz, float f_dc_0, float f_dc_1, float f_dc_2, float f_rest_0, float f_rest_1, \
                      float f_rest_2, float opacity, float scale_0, float rot_0";
    let row = "0 0 0 0 0 0 0 1.7724539 -3 9 9 9 0.5 1 1\n";
    let text = ply(properties, row);
    for bytes in [text.clone().into_bytes(), binary(&text)] {
        let loaded = read("a.ply", bytes);
        // 0.5, 0.5 + 0.28209479 * 1.7724539 = 1, below 0.
        assert_eq!(loaded.mesh.colors, [[128, 255, 0, 255]]);
        assert_eq!(loaded.mesh.normals, []);
        assert_eq!(loaded.warnings, [ReadWarning::GaussianSplats { count: 1 }]);
        assert_eq!(fate(&loaded, "property f_dc_0 of vertex").1, PartFate::Used);
        assert_eq!(
            fate(&loaded, "property scale_0 of vertex").1,
            PartFate::LeftOut
        );
    }
    let packed =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty uint packed_position\nend_header\n1\n";
    assert!(message("a.ply", packed).contains("compressed Gaussian-splat"));
}

/// The colors of the corners of every triangle.
fn corner_colors(loaded: &LoadedMesh) -> Vec<[[u8; 4]; 3]> {
    let mesh = &loaded.mesh;
    let colors = |triangle: &[u32; 3]| triangle.map(|corner| mesh.colors[corner as usize]);
    mesh.triangles.iter().map(colors).collect()
}

#[test]
fn colors_of_faces_are_kept() {
    let points = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let head = |extra: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{extra}\
             element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n\
             property uchar blue\nend_header\n"
        )
    };
    let (red, blue) = ([255, 0, 0, 255], [0, 0, 255, 255]);
    let text = head("") + points + "4 0 1 2 3 255 0 0\n3 0 2 3 0 0 255\n";
    // Rows of one size are read in another way.
    let mut fixed = head("")
        .replace("ascii", "binary_little_endian")
        .into_bytes();
    for number in points.split_whitespace() {
        fixed.extend(number.parse::<f32>().unwrap().to_le_bytes());
    }
    for (corners, color) in [([0_i32, 1, 2], [255, 0, 0]), ([0, 2, 3], [0, 0, 255])] {
        fixed.push(3);
        corners
            .iter()
            .for_each(|corner| fixed.extend(corner.to_le_bytes()));
        fixed.extend(color);
    }
    let off = format!("OFF\n4 2 0\n{points}3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n");
    let units = format!("OFF\n4 2 0\n{points}3 0 1 2 1.0 0.0 0.0 1.0\n3 0 2 3 0.0 0.0 1.0 1.0\n");
    for (name, bytes, first) in [
        ("a.ply", text.into_bytes(), 2),
        ("b.ply", fixed, 1),
        ("a.off", off.into_bytes(), 1),
        ("b.off", units.into_bytes(), 1),
    ] {
        let loaded = read(name, &bytes);
        let colors = corner_colors(&loaded);
        assert!(
            colors[..first].iter().all(|color| *color == [red; 3]),
            "{name}: {colors:?}"
        );
        assert_eq!(colors[first..], [[blue; 3]], "{name}");
        assert_eq!(loaded.warnings, [], "{name}");
    }
    // Colors of vertices go first, and a word says so.
    let both = head("property uchar red\nproperty uchar green\nproperty uchar blue\n")
        + &points.replace('\n', " 1 2 3\n")
        + "4 0 1 2 3 255 0 0\n3 0 2 3 0 0 255\n";
    let loaded = read("a.ply", both);
    assert_eq!(loaded.mesh.colors, [[1, 2, 3, 255]; 4]);
    assert_eq!(remarks(&loaded), "left out: red, green, blue of face");
    // An index into a table that is not there.
    let loaded = read("a.off", format!("OFF\n4 1 0\n{points}3 0 1 2 5\n"));
    assert_eq!(loaded.mesh.colors, [[0; 4]; 0]);
    assert_eq!(remarks(&loaded), "left out: color indices of faces");
}

#[test]
fn materials_are_found_and_black_under_a_texture_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(
        at("My Scan.MTL"),
        "newmtl Paint Red\nKd 1 0 0\nnewmtl photo\nKd 0 0 0\nmap_Kd a.png\nnewmtl tar\nKd 0 0 0\nd 0.5\n",
    )
    .unwrap();
    let named = |library: &str, material: &str| {
        let path = at("a.obj");
        let text = format!("mtllib {library}\nusemtl {material}\n{TRIANGLE}f 1 2 3\n");
        std::fs::write(&path, text).unwrap();
        input::load(&path, &ReadOptions::default(), &SilentProgress).unwrap()
    };
    for library in [
        "My Scan.MTL",
        "my scan.mtl",
        "\"My Scan.mtl\"",
        r"./C:\scans\My Scan.mtl",
        "/elsewhere/my scan.MTL",
    ] {
        for material in ["Paint Red", "paint red", "\"Paint Red\""] {
            let loaded = named(library, material);
            assert_eq!(
                loaded.mesh.colors,
                [[255, 0, 0, 255]; 3],
                "{library}, {material}"
            );
        }
    }
    assert_eq!(named("my scan.mtl", "photo").mesh.colors, [[0; 4]; 0]);
    let loaded = named("my scan.mtl", "tar");
    assert_eq!(loaded.mesh.colors, [[0, 0, 0, 255]; 3]);
    assert!(remarks(&loaded).contains("left out: transparency of materials"));
    assert_eq!(fate(&loaded, "material tar"), (1, PartFate::Used));
    assert_eq!(fate(&loaded, "material photo"), (0, PartFate::Used));
    assert_eq!(fate(&loaded, "texture a.png"), (1, PartFate::LeftOut));
    assert_eq!(
        fate(&loaded, "material file my scan.mtl"),
        (1, PartFate::Used)
    );
}

#[test]
fn every_part_of_a_file_is_listed_and_what_is_left_out_is_one_line() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n\
                property float scalar_a\nproperty float s1\nproperty float s2\nproperty float s3\nelement edge 1\n\
                property int a\nend_header\n0 0 0 1 2 3 255 0 0 0 0\n1\n";
    let loaded = read("a.ply", text);
    assert_eq!(remarks(&loaded), "left out: element edge (1 rows)");
    for name in ["attribute a", "attribute s3"] {
        assert_eq!(fate(&loaded, name), (1, PartFate::Kept), "{name}");
    }
    let names: Vec<&str> = loaded.parts.iter().map(|part| &part.name[..]).collect();
    assert_eq!(names.len(), 2 + 11 + 1, "{names:?}");
    assert_eq!(
        fate(&loaded, "property alpha of vertex"),
        (1, PartFate::Unneeded)
    );
    assert_eq!(fate(&loaded, "property x of vertex"), (1, PartFate::Used));
    assert_eq!(fate(&loaded, "element edge"), (1, PartFate::LeftOut));
    let obj = read(
        "a.obj",
        format!("g a\no b\ns 1\nvt 0 0\nweird 1\n{TRIANGLE}f 1 2 3\nl 1 2\n"),
    );
    assert_eq!(
        remarks(&obj),
        "1 lines, points and curves left out\nleft out: texture coordinates, lines that begin with weird"
    );
    assert_eq!(fate(&obj, "g (groups)"), (1, PartFate::Unneeded));
    assert_eq!(fate(&obj, "weird"), (1, PartFate::LeftOut));
    assert_eq!(fate(&obj, "f (faces)"), (1, PartFate::Used));
    // A place has its words.
    let fault = ReadWarning::PartFaulty {
        what: "colors are no numbers",
        outcome: "treated as white",
        count: 2,
        place: FilePlace::Byte(7),
    };
    assert_eq!(
        fault.to_string(),
        "2 colors are no numbers, the first at byte 7; treated as white"
    );
}

#[test]
fn a_sheet_made_two_sided_is_drawn_once_and_windings_agree() {
    let rows: String = (0..36)
        .map(|i| format!("v {} {} 0\n", i % 6, i / 6))
        .collect();
    let cells = || (0..25).map(|i| i / 5 * 6 + i % 5 + 1);
    let quad = |a: u32| format!("f {} {} {} {}\n", a, a + 1, a + 7, a + 6);
    let back = |a: u32| format!("f {} {} {} {}\n", a + 6, a + 7, a + 1, a);
    let once: String = cells().map(quad).collect();
    let load = |faces: &str, repair_faces| {
        let options = ReadOptions {
            repair_faces,
            ..ReadOptions::default()
        };
        let text = format!("{rows}{faces}");
        input::load_bytes("a.obj", text.as_bytes(), &options, &SilentProgress).unwrap()
    };
    let wanted = load(&once, true);
    assert_eq!(wanted.warnings, []);
    // The back of a quad begins at another corner.
    let twice = once.clone() + &cells().map(back).collect::<String>();
    let loaded = load(&twice, true);
    assert!(loaded.mesh == wanted.mesh);
    assert_eq!(loaded.warnings, [ReadWarning::FacesOpposed { count: 50 }]);
    assert_eq!(load(&twice, false).mesh.triangles.len(), 100);
    let mixed: String = cells()
        .enumerate()
        .map(|(i, a)| if i % 4 == 1 { back(a) } else { quad(a) })
        .collect();
    let mixed = load(&mixed, true);
    assert!(areas(&mixed).iter().all(|&area| area > 0.0));
    assert_eq!(mixed.warnings, [ReadWarning::FacesTurned { count: 12 }]);
}

#[test]
fn extents_beyond_single_precision_are_scaled_and_absurd_strays_left_out() {
    let mesh = |scale: f64, stray: &str| {
        let rows: String = (0..60)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * 0.4).sin_cos();
                format!(
                    "v {:e} {:e} {:e}\n",
                    scale * cos,
                    scale * sin,
                    scale * f64::from(i) / 60.0
                )
            })
            .collect();
        let faces: String = (1..58)
            .map(|i| format!("f {} {} {}\n", i, i + 1, i + 2))
            .collect();
        read("a.obj", format!("{rows}{stray}{faces}f 1 2 60\n"))
    };
    let usual = mesh(1.0, "");
    assert_eq!(usual.warnings, []);
    for scale in [1e19, 1e20, 1e30, 1e-18, 1e-30, 1e-40] {
        let loaded = mesh(scale, "");
        let ReadWarning::Scaled { exponent } = loaded.warnings[0] else {
            panic!("{}", remarks(&loaded))
        };
        let factor = scale * f64::from(exponent).exp2();
        assert!((0.25..4.0).contains(&factor), "{scale}: {factor}");
        let origin = loaded.mesh.origin;
        for (a, b) in loaded.mesh.positions.iter().zip(&usual.mesh.positions) {
            let error = (a.as_dvec3() + origin).distance(b.as_dvec3() * factor);
            assert!(error < 1e-6, "{scale}: {error}");
        }
        assert_eq!(loaded.mesh.triangles, usual.mesh.triangles);
    }
    for scale in [1e15, 1e-15] {
        assert_eq!(mesh(scale, "").warnings, [], "{scale}");
    }
    // One vertex at the end of single precision does not make the model a dot.
    let loaded = mesh(1.0, "v 1e30 0 0\nf 1 2 61\n");
    assert_eq!(
        loaded.warnings,
        [ReadWarning::FarOffDropped { vertices: 1 }]
    );
    assert_eq!(loaded.mesh.positions, usual.mesh.positions);
    assert_eq!(loaded.mesh.triangles.len(), 58);
}
