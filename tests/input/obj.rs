//! OBJ and its materials.

use glam::Vec3;
use surfel::input::{self, Error, FilePlace, Format, ReadOptions, ReadWarning};
use surfel::progress::SilentProgress;

use super::{SQUARE, message, read, try_read};

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
        [
            ReadWarning::PartsIgnored {
                what: "lines, points and curves",
                count: 1
            },
            // It might name a texture, which goes before colors of vertices.
            ReadWarning::MaterialFileMissing {
                name: "none.mtl".into(),
                reason: "the model was not read from a file".into()
            },
            ReadWarning::LeftOut {
                parts: vec!["texture coordinates".into()]
            }
        ]
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
            place: FilePlace::Line(5),
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
        ("x", 4),
        ("/1/1", 4),
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
    let loaded = input::load(&path, &ReadOptions::default(), &SilentProgress).unwrap();
    let colors_of = |triangle: [u32; 3]| triangle.map(|corner| loaded.mesh.colors[corner as usize]);
    assert_eq!(colors_of(loaded.mesh.triangles[0]), [[255, 0, 0, 255]; 3]);
    assert_eq!(colors_of(loaded.mesh.triangles[1]), [[0, 0, 255, 255]; 3]);
    assert_eq!(colors_of(loaded.mesh.triangles[2]), [[255; 4]; 3]);
    // Four, two more for the second material, three for the third.
    assert_eq!(loaded.mesh.positions.len(), 9);
    assert!(loaded.warnings.contains(&ReadWarning::TextureIgnored {
        name: "t.png".into(),
        count: 1
    }));
    assert!(loaded.warnings.contains(&ReadWarning::MaterialUnknown {
        name: "c".into(),
        count: 1
    }));

    let plain = ReadOptions {
        materials: false,
        repair_faces: false,
        ..ReadOptions::default()
    };
    let loaded = input::load(&path, &plain, &SilentProgress).unwrap();
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

#[test]
fn obj_material_files_that_cannot_be_read_are_remarks() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder.mtl")).unwrap();
    let path = folder.path().join("a.obj");
    let many: String = (0..5000).map(|i| format!("mtllib {i}.mtl\n")).collect();
    std::fs::write(
        &path,
        format!("mtllib folder.mtl none.mtl\n{many}v 0 0 0\nf 1 1 1\n"),
    )
    .unwrap();
    let loaded = input::load(&path, &ReadOptions::default(), &SilentProgress).unwrap();
    let missing = |index: usize| match &loaded.warnings[index] {
        ReadWarning::MaterialFileMissing { name, reason } => (name.as_str(), reason.as_str()),
        other => panic!("{other}"),
    };
    assert_eq!(missing(0), ("folder.mtl", "not a file"));
    assert_eq!(missing(1).0, "none.mtl");
    assert_eq!(
        loaded.warnings.len(),
        100,
        "names beyond the first hundred are not looked for"
    );
}
