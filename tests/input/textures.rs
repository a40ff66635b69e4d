//! Textures of models: which image each triangle has and where its corners are in it, in every format that names images.

use glam::Vec2;
use serde_json::json;
use std::io::Cursor;
use std::path::Path;
use surfel::input::{self, Format, LoadedMesh, PartFate, ReadLimits, ReadOptions, ReadWarning};
use surfel::progress::SilentProgress;
use surfel::textures::{MeshTextures, NO_IMAGE, WrapMode};

/// A picture of one color.
fn png(width: u32, height: u32, color: [u8; 3]) -> Vec<u8> {
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(color));
    let mut out = Cursor::new(Vec::new());
    picture.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

fn jpeg(width: u32, height: u32, color: [u8; 3]) -> Vec<u8> {
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(color));
    let mut out = Cursor::new(Vec::new());
    picture
        .write_to(&mut out, image::ImageFormat::Jpeg)
        .unwrap();
    out.into_inner()
}

fn load(path: &Path) -> LoadedMesh {
    load_with(path, &ReadOptions::default())
}

fn load_with(path: &Path, options: &ReadOptions) -> LoadedMesh {
    let options = ReadOptions {
        repair_faces: false,
        ..options.clone()
    };
    input::load(path, &options, &SilentProgress).unwrap_or_else(|error| panic!("{error}"))
}

fn textures(loaded: &LoadedMesh) -> &MeshTextures {
    let textures = loaded.mesh.textures.as_ref().unwrap();
    assert_eq!(textures.corners.len(), loaded.mesh.triangles.len());
    assert_eq!(textures.image_of.len(), loaded.mesh.triangles.len());
    textures
}

fn corners(textures: &MeshTextures, triangle: usize) -> [[f32; 2]; 3] {
    textures.corners[triangle].map(|corner| corner.to_array())
}

fn remarks(loaded: &LoadedMesh) -> String {
    let remarks: Vec<String> = loaded.warnings.iter().map(|w| w.to_string()).collect();
    remarks.join("\n")
}

const POINTS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const PLACES: &str = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.75\n";

#[test]
fn obj_materials_with_images_found_whatever_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("My Scan 1.PNG"), png(4, 2, [10, 20, 30])).unwrap();
    std::fs::write(at("b.jpg"), jpeg(8, 8, [200, 100, 0])).unwrap();
    let materials = "newmtl one\nmap_Kd -clamp on C:\\scans\\my scan 1.png\nKd 0 0 0\nnewmtl two\nKd 0.8 0.8 0.8\n\
                     map_Kd -s 2 2 -o 0.5 0 0 \"B.JPG\"\nnewmtl three\nKd 1 0 0\nnewmtl four\nmap_Kd gone.png\nKd 0 1 0\n";
    std::fs::write(at("m.mtl"), materials).unwrap();
    let text = format!(
        "mtllib m.mtl\n{POINTS}{PLACES}usemtl one\nf 1/1 2/2 3/3\nusemtl two\nf 1/1 3/3 4/-1\nusemtl three\nf 1/1 2/2 4/4\n\
         usemtl four\nf 1/1 2/2 3/3\nusemtl one\nf 1 2 3\n"
    );
    let path = at("a.obj");
    std::fs::write(&path, text).unwrap();
    let loaded = load(&path);
    let own = textures(&loaded);
    assert_eq!(own.image_of, [0, 1, NO_IMAGE, NO_IMAGE, NO_IMAGE]);
    // Rows of images begin at the top, v at the bottom.
    assert_eq!(corners(own, 0), [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    assert_eq!(corners(own, 1), [[0.5, 1.0], [2.5, -1.0], [0.5, -0.5]]);
    let sizes: Vec<_> = own.images.iter().map(|image| image.size()).collect();
    assert_eq!(sizes, [[4, 2], [8, 8]]);
    let wraps: Vec<_> = own.images.iter().map(|image| image.wrap()[0]).collect();
    assert_eq!(wraps, [WrapMode::Clamp, WrapMode::Repeat]);
    // Black and gray are no colors under a texture.
    assert_eq!(own.images[0].levels()[0].texels()[0], [10, 20, 30, 255]);
    let [red, green, _, _] = own.images[1].levels()[0].texels()[0];
    assert!(red.abs_diff(200) < 4 && green.abs_diff(100) < 4);
    let said = remarks(&loaded);
    assert!(
        said.contains("texture `gone.png` not read: there is no such file"),
        "{said}"
    );
    let part = |name: &str| {
        let part = loaded.parts.iter().find(|part| part.name == name).unwrap();
        (part.count, part.fate, &part.note[..])
    };
    let (count, fate, note) = part("texture C:\\scans\\my scan 1.png");
    assert_eq!((count, fate), (1, PartFate::Used));
    assert!(note.contains("4 x 2 texels"), "{note}");
    assert_eq!(part("texture gone.png").1, PartFate::LeftOut);
    // Its triangle has the color of its material.
    let corner = loaded.mesh.triangles[3][0] as usize;
    assert_eq!(loaded.mesh.colors[corner], [0, 255, 0, 255]);

    let without = ReadOptions {
        textures: false,
        ..ReadOptions::default()
    };
    let loaded = load_with(&path, &without);
    assert_eq!(loaded.mesh.textures, None);
    assert!(!remarks(&loaded).contains("gone"), "{}", remarks(&loaded));
}

/// A concave face is cut otherwise than its fan: corners keep their places.
#[test]
fn places_follow_the_corners_of_concave_faces() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.png"), png(1, 1, [1, 2, 3])).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl m\nmap_Kd a.png\n").unwrap();
    let path = folder.path().join("a.obj");
    let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
    let mut text = "mtllib m.mtl\nusemtl m\n".to_owned();
    for [x, y] in outline {
        text += &format!("v {x} {y} 0\nvt {x} {y}\n");
    }
    // The fan about the third corner turns back on itself.
    text += "f 3/3 4/4 5/5 1/1 2/2\n";
    std::fs::write(&path, text).unwrap();
    let loaded = load(&path);
    let own = textures(&loaded);
    let mut area = 0.0;
    for (triangle, places) in loaded.mesh.triangles.iter().zip(&own.corners) {
        let corners = triangle.map(|corner| loaded.mesh.positions[corner as usize]);
        for (point, place) in corners.into_iter().zip(places) {
            assert_eq!(*place, Vec2::new(point.x, 1.0 - point.y));
        }
        let [a, b, c] = corners;
        area += 0.5 * (b - a).cross(c - a).z.abs();
    }
    assert!((area - 10.0).abs() < 1e-4, "{area}");
}

/// Per vertex and per face, in text and in binary.
#[test]
fn ply_textures_by_vertex_and_by_face() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("tex 0.png"), png(2, 2, [9, 8, 7])).unwrap();
    std::fs::write(at("tex1.jpg"), jpeg(16, 4, [50, 60, 70])).unwrap();
    let points = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let faces: [&[i32]; 2] = [&[0, 1, 2], &[0, 2, 3]];
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for names in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]] {
            let head = format!(
                "ply\nformat {encoding} 1.0\ncomment TextureFile tex 0.png\nelement vertex 4\nproperty float x\n\
                 property float y\nproperty float z\nproperty float {}\nproperty float {}\nelement face 2\n\
                 property list uchar int vertex_indices\nend_header\n",
                names[0], names[1]
            );
            let mut file = PlyBytes::new(encoding, head);
            for [x, y] in points {
                for value in [x, y, 0.0, x, 0.25 * y] {
                    file.float(value);
                }
                file.end();
            }
            for face in faces {
                file.byte(3);
                face.iter().for_each(|&corner| file.int(corner));
                file.end();
            }
            let path = at("a.ply");
            std::fs::write(&path, file.bytes).unwrap();
            let loaded = load(&path);
            let own = textures(&loaded);
            assert_eq!(own.image_of, [0, 0], "{encoding}");
            assert_eq!(corners(own, 1), [[0.0, 1.0], [1.0, 0.75], [0.0, 0.75]]);
            assert_eq!(remarks(&loaded), "");
        }
        let head = format!(
            "ply\nformat {encoding} 1.0\ncomment TextureFile tex 0.png\ncomment TextureFile tex1.jpg\n\
             element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n\
             property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
             end_header\n"
        );
        let mut file = PlyBytes::new(encoding, head);
        for [x, y] in points {
            for value in [x, y, 0.0] {
                file.float(value);
            }
            file.end();
        }
        // A quad in the second image, a triangle without places, a triangle in an image that is not there.
        for (face, places, texture) in [
            (&[0, 1, 2, 3][..], 8, 1),
            (&[0, 1, 2], 0, 0),
            (&[0, 1, 2], 6, 7),
        ] {
            file.byte(face.len() as u8);
            face.iter().for_each(|&corner| file.int(corner));
            file.byte(places);
            (0..places).for_each(|index| file.float(f32::from(index) / 8.0));
            file.int(texture);
            file.end();
        }
        let path = at("b.ply");
        std::fs::write(&path, file.bytes).unwrap();
        let loaded = load(&path);
        let own = textures(&loaded);
        assert_eq!(own.image_of, [0, 0, NO_IMAGE, NO_IMAGE], "{encoding}");
        assert_eq!(own.images[0].size(), [16, 4]);
        let place = |index: u8| {
            [
                f32::from(2 * index) / 8.0,
                1.0 - f32::from(2 * index + 1) / 8.0,
            ]
        };
        assert_eq!(corners(own, 0), [place(0), place(1), place(2)]);
        assert_eq!(corners(own, 1), [place(0), place(2), place(3)]);
    }
}

/// A PLY file in text or in one of the binary orders.
struct PlyBytes {
    bytes: Vec<u8>,
    is_text: bool,
    is_big: bool,
}

impl PlyBytes {
    fn new(encoding: &str, head: String) -> Self {
        Self {
            bytes: head.into_bytes(),
            is_text: encoding == "ascii",
            is_big: encoding.ends_with("big_endian"),
        }
    }

    fn put<const N: usize>(&mut self, text: String, little: [u8; N]) {
        let mut bytes = little;
        if self.is_big {
            bytes.reverse();
        }
        match self.is_text {
            true => self.bytes.extend(format!("{text} ").bytes()),
            false => self.bytes.extend(bytes),
        }
    }

    fn float(&mut self, value: f32) {
        self.put(value.to_string(), value.to_le_bytes());
    }

    fn int(&mut self, value: i32) {
        self.put(value.to_string(), value.to_le_bytes());
    }

    fn byte(&mut self, value: u8) {
        self.put(value.to_string(), [value]);
    }

    fn end(&mut self) {
        if self.is_text {
            self.bytes.push(b'\n');
        }
    }
}

/// A glTF of one triangle whose buffer holds an image; `more` goes to the texture, `scale` to the node.
fn gltf(picture: &[u8], texture: serde_json::Value, scale: [f64; 3]) -> Vec<u8> {
    use base64::Engine;
    let mut bytes: Vec<u8> = Vec::new();
    for value in [
        0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0,
    ] {
        bytes.extend(value.to_le_bytes());
    }
    let at = bytes.len();
    bytes.extend(picture);
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}], "scene": 0,
        "nodes": [{"mesh": 0, "scale": scale}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_1": 1}, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 3},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 24},
            {"buffer": 0, "byteOffset": at, "byteLength": picture.len()},
        ],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{data}")}],
        "materials": [{"pbrMetallicRoughness": {
            "baseColorFactor": [1.0, 0.25, 1.0, 1.0], "baseColorTexture": texture,
        }}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"bufferView": 2, "mimeType": "image/png", "name": "skin"}],
    })
    .to_string()
    .into_bytes()
}

#[test]
fn gltf_images_in_the_file_moved_by_their_transform() {
    let picture = png(3, 5, [200, 255, 0]);
    let texture = json!({"index": 0, "texCoord": 1});
    let one = [1.0; 3];
    let loaded = super::read("a.gltf", gltf(&picture, texture, one));
    assert_eq!(loaded.format, Format::Gltf);
    let own = textures(&loaded);
    assert_eq!(corners(own, 0), [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    let image = &own.images[0];
    assert_eq!((image.size(), image.name()), ([3, 5], "skin"));
    assert_eq!(image.wrap(), [WrapMode::Clamp, WrapMode::Mirror]);
    // Factors multiply light: a quarter of white is 137.
    assert_eq!(image.levels()[0].texels()[0], [200, 137, 0, 255]);

    // A quarter turn counter-clockwise as it is seen, v downward.
    let moved = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {
        "texCoord": 1, "offset": [0.5, 0.25], "scale": [2.0, 1.0], "rotation": std::f64::consts::FRAC_PI_2,
    }}});
    let loaded = super::read("a.gltf", gltf(&picture, moved, one));
    let wanted = [[0.5, 0.25], [0.5, -1.75], [1.5, 0.25]];
    for (found, wanted) in corners(textures(&loaded), 0)
        .iter()
        .flatten()
        .zip(wanted.iter().flatten())
    {
        assert!((found - wanted).abs() < 1e-6, "{found} for {wanted}");
    }
    // Mirrored triangles turn, and their places with them.
    let texture = json!({"index": 0, "texCoord": 1});
    let loaded = super::read("a.gltf", gltf(&picture, texture, [-1.0, 1.0, 1.0]));
    assert_eq!(
        corners(textures(&loaded), 0),
        [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
    );
    // Sets that are not there, and images that are none, are remarks at most.
    let absent = json!({"index": 0, "texCoord": 3});
    assert_eq!(
        super::read("a.gltf", gltf(&picture, absent, one))
            .mesh
            .textures,
        None
    );
    let texture = json!({"index": 0, "texCoord": 1});
    let loaded = super::read("a.gltf", gltf(b"\xabKTX 20\xbb", texture, one));
    assert_eq!(loaded.mesh.textures, None);
    assert!(remarks(&loaded).contains("KTX2"), "{}", remarks(&loaded));
}

#[test]
fn images_beyond_the_budget_are_kept_smaller_and_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.png"), png(64, 32, [1, 2, 3])).unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl m\nmap_Kd a.png\n").unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(
        &path,
        format!("mtllib m.mtl\nusemtl m\n{POINTS}{PLACES}f 1/1 2/2 3/3\n"),
    )
    .unwrap();
    let options = ReadOptions {
        limits: ReadLimits {
            texture_bytes: 4 * (32 * 16 + 16 * 8 + 8 * 4 + 4 * 2 + 2 + 1),
            ..ReadLimits::default()
        },
        ..ReadOptions::default()
    };
    let loaded = load_with(&path, &options);
    let image = &textures(&loaded).images[0];
    assert_eq!((image.size(), image.file_size()), ([32, 16], [64, 32]));
    assert!(image.bytes() <= options.limits.texture_bytes);
    let reduced =
        |warning: &ReadWarning| matches!(warning, ReadWarning::TexturesReduced { count: 1, .. });
    assert!(loaded.warnings.iter().any(reduced), "{}", remarks(&loaded));
}

/// Whatever is cut off or changed: a mesh with whole lists, or an error in words.
#[test]
fn damaged_files_with_textures_never_panic() {
    let picture = png(3, 5, [200, 255, 0]);
    let whole = gltf(&picture, json!({"index": 0, "texCoord": 1}), [1.0; 3]);
    let sound = |loaded: &LoadedMesh| {
        if let Some(own) = &loaded.mesh.textures {
            assert_eq!(own.corners.len(), loaded.mesh.triangles.len());
            assert_eq!(own.image_of.len(), loaded.mesh.triangles.len());
        }
    };
    let text = String::from_utf8(whole.clone()).unwrap();
    for (from, to) in [
        ("\"index\":0", "\"index\":9"),
        ("\"source\":0", "\"source\":7"),
        ("\"sampler\":0", "\"sampler\":\"x\""),
        ("\"texCoord\":1", "\"texCoord\":-1"),
        ("\"byteLength\":24", "\"byteLength\":18446744073709551615"),
        ("\"byteOffset\":60", "\"byteOffset\":18446744073709551615"),
        ("\"bufferView\":2", "\"bufferView\":99"),
        ("\"type\":\"VEC2\"", "\"type\":\"VEC9\""),
    ] {
        assert!(text.contains(from), "{from}");
        match super::try_read("a.gltf", text.replace(from, to)) {
            Ok(loaded) => sound(&loaded),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    for length in (0..whole.len()).step_by(7) {
        if let Ok(loaded) = super::try_read("a.gltf", &whole[..length]) {
            sound(&loaded);
        }
    }
    let head = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                property list uchar float texcoord\nproperty int texnumber\nend_header\n";
    for body in [
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1 0\n",
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 200 0 0 1 0 0 1 0\n",
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 x y nan inf 1e99 1 -5\n",
        "0 0 0\n1 0 0\n0 1 0\n2 0 1 1 0 4000000000\n",
    ] {
        let whole = format!("{head}{body}");
        for length in head.len()..=whole.len() {
            if let Ok(loaded) = super::try_read("a.ply", &whole[..length]) {
                sound(&loaded);
            }
        }
    }
    for places in ["vt\nvt x\nvt nan inf\n", "vt 1e99 -1e99\nvt 0 0\nvt 1\n"] {
        let text =
            format!("mtllib none.mtl\nusemtl m\n{POINTS}{places}f 1/1 2/2 3/3\nf 1/9 2/-9 3/x\n");
        sound(&super::read("a.obj", text));
    }
}
