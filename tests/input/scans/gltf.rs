//! glTF and GLB, described here piece by piece.

use glam::Vec3;
use serde_json::{Value, json};
use surfel::input::{Format, LoadedMesh};

use super::super::{SQUARE, message, read, try_read};
use super::{damage, remarks, scan_at};

/// A buffer and the views and accessors of its parts.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Parts {
    /// Adds bytes as a view; returns its number.
    fn view(&mut self, bytes: &[u8]) -> usize {
        let at = self.bytes.len();
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": at, "byteLength": bytes.len()});
        self.views.push(view);
        self.views.len() - 1
    }

    /// Adds an accessor of a view of its own; returns its number.
    fn accessor(&mut self, bytes: &[u8], code: u32, shape: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({"bufferView": view, "componentType": code, "type": shape, "count": count});
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn points(&mut self, points: &[Vec3]) -> usize {
        let bytes: Vec<u8> = points
            .iter()
            .flat_map(|p| p.to_array())
            .flat_map(f32::to_le_bytes)
            .collect();
        self.accessor(&bytes, 5126, "VEC3", points.len())
    }

    fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", indices.len())
    }

    /// The description with one mesh of these primitives, and what `more` says.
    fn document(&self, primitives: Value, more: Value) -> Value {
        let mut document = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"name": "m", "primitives": primitives}],
            "buffers": [{"byteLength": self.bytes.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        for (key, value) in more.as_object().unwrap() {
            document[key] = value.clone();
        }
        document
    }

    fn glb(&self, primitives: Value, more: Value) -> Vec<u8> {
        glb(&self.document(primitives, more), &self.bytes)
    }
}

fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((12 + 8 + json.len() as u32 + 8 + binary.len() as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    out.extend((binary.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

/// A square by indices.
fn square() -> (Parts, Value) {
    let mut parts = Parts::default();
    let position = parts.points(&SQUARE);
    let indices = parts.indices(&[0, 1, 2, 0, 2, 3]);
    let primitives = json!([{"attributes": {"POSITION": position}, "indices": indices}]);
    (parts, primitives)
}

fn triangles(loaded: &LoadedMesh) -> Vec<[Vec3; 3]> {
    let mesh = &loaded.mesh;
    let corner = |corner: u32| mesh.positions[corner as usize];
    mesh.triangles.iter().map(|t| t.map(corner)).collect()
}

#[test]
fn one_file_text_and_data_addresses_are_one_mesh() {
    let (parts, primitives) = square();
    let one = read("a.glb", parts.glb(primitives.clone(), json!({})));
    assert_eq!(one.format, Format::Glb);
    assert_eq!(one.mesh.positions, SQUARE);
    assert_eq!(one.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(one.warnings.is_empty() && one.mesh.colors.is_empty());
    use base64::Engine;
    let text = base64::engine::general_purpose::STANDARD.encode(&parts.bytes);
    let uri = format!("data:application/octet-stream;base64,{text}");
    let buffers = json!({"buffers": [{"byteLength": parts.bytes.len(), "uri": uri}]});
    let text = parts.document(primitives.clone(), buffers).to_string();
    let other = read("a.gltf", text);
    assert_eq!((other.format, other.mesh), (Format::Gltf, one.mesh.clone()));
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.bin"), &parts.bytes).unwrap();
    let buffers = json!({"buffers": [{"byteLength": parts.bytes.len(), "uri": "a%20b.bin"}]});
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, parts.document(primitives, buffers).to_string()).unwrap();
    assert_eq!(scan_at(&path).mesh, one.mesh);
    for (uri, words) in [
        ("../a.bin", "is not in the folder of the model"),
        ("/etc/passwd", "is not in the folder of the model"),
        ("http://a/b.bin", "addresses are not fetched"),
        ("data:,abc", "is not in base64"),
    ] {
        let text = parts.document(
            json!([]),
            json!({"buffers": [{"byteLength": 4, "uri": uri}]}),
        );
        let text = message("a.gltf", text.to_string());
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn strips_fans_and_points() {
    let mut parts = Parts::default();
    let position = parts.points(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)]);
    let primitive = |mode| json!([{"attributes": {"POSITION": position}, "mode": mode}]);
    let strip = read("a.glb", parts.glb(primitive(5), json!({})));
    assert_eq!(strip.mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
    let fan = read("a.glb", parts.glb(primitive(6), json!({})));
    assert_eq!(fan.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    let points = read("a.glb", parts.glb(primitive(0), json!({})));
    assert!(points.mesh.is_cloud() && points.mesh.positions.len() == 4);
    let both = json!([
        {"attributes": {"POSITION": position}, "mode": 5},
        {"attributes": {"POSITION": position}, "mode": 0},
        {"attributes": {"POSITION": position}, "mode": 1},
    ]);
    let both = read("a.glb", parts.glb(both, json!({})));
    assert_eq!(both.mesh.positions.len(), 4);
    let said = remarks(&both);
    assert!(
        said.contains("4 points beside triangles left out"),
        "{said}"
    );
    assert!(said.contains("1 primitives of lines left out"), "{said}");
    assert!(message("a.glb", parts.glb(primitive(9), json!({}))).contains("mode Some(9)"));
}

#[test]
fn nodes_move_turn_and_mirror() {
    let (mut parts, mut primitives) = square();
    let normal = parts.points(&[Vec3::new(0.0, 1.0, 1.0); 4]);
    primitives[0]["attributes"]["NORMAL"] = json!(normal);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let nodes = json!({
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"translation": [10, 0, 0], "children": [1]},
            {"rotation": [0, 0, half, half], "scale": [2, 2, 2], "mesh": 0},
            // Mirrored in x.
            {"matrix": [-1,0,0,0, 0,2,0,0, 0,0,1,0, 0,0,5,1], "mesh": 0},
        ],
    });
    let loaded = read("a.glb", parts.glb(primitives, nodes));
    let mesh = &loaded.mesh;
    assert_eq!(mesh.positions.len(), 8);
    // A quarter turn of the x axis is the y axis.
    assert!(mesh.positions[1].distance(Vec3::new(10.0, 2.0, 0.0)) < 1e-5);
    assert!(mesh.positions[5].distance(Vec3::new(-1.0, 0.0, 5.0)) < 1e-5);
    assert!(mesh.normals[0].distance(Vec3::new(-1.0, 0.0, 1.0).normalize_or_zero()) < 1e-5);
    // Stretched in y, the normal leans the other way.
    assert!(mesh.normals[4].distance(Vec3::new(0.0, 0.5, 1.0).normalize_or_zero()) < 1e-5);
    // All still wind towards their normals.
    for (t, corners) in triangles(&loaded).iter().zip(&mesh.triangles) {
        let face = (t[1] - t[0]).cross(t[2] - t[0]);
        assert!(face.dot(mesh.normals[corners[0] as usize]) > 0.0, "{t:?}");
    }
    // A node that is its own child ends.
    let (parts, primitives) = square();
    let circle = json!({"nodes": [{"mesh": 0, "children": [0, 0]}]});
    let loaded = read("a.glb", parts.glb(primitives, circle));
    assert_eq!(loaded.mesh.positions.len(), 4);
    assert!(remarks(&loaded).contains("2 nodes that are named twice"));
}

#[test]
fn accessors_interleaved_normalised_and_sparse() {
    // Positions of 16-bit integers (KHR_mesh_quantization) and colors of bytes, in rows of 12 bytes.
    let mut parts = Parts::default();
    let rows: Vec<u8> = SQUARE
        .iter()
        .flat_map(|p| {
            let step = |value: f32| ((value * 32767.0) as i16).to_le_bytes();
            let [x, y, z] = p.to_array().map(step);
            [&x[..], &y, &z, &[0, 0], &[255, 0, 128, 255]].concat()
        })
        .collect();
    let view = parts.view(&rows);
    parts.views[view]["byteStride"] = json!(12);
    parts.accessors.push(json!({"bufferView": view, "componentType": 5122, "normalized": true, "type": "VEC3", "count": 4}));
    parts.accessors.push(json!({"bufferView": view, "byteOffset": 8, "componentType": 5121, "normalized": true, "type": "VEC4", "count": 4}));
    let primitives = json!([{"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 0}]);
    let more = json!({"extensionsRequired": ["KHR_mesh_quantization"]});
    let loaded = read("a.glb", parts.glb(primitives, more));
    assert_eq!(loaded.mesh.positions, SQUARE);
    // Half of linear light is 188 of 255.
    assert_eq!(loaded.mesh.colors, [[255, 0, 188, 255]; 4]);

    // Zeros but for one.
    let mut parts = Parts::default();
    let places = parts.view(&[2, 0]);
    let values: Vec<u8> = [5.0_f32, 6.0, 7.0]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect();
    let values = parts.view(&values);
    let sparse = json!({"count": 1, "indices": {"bufferView": places, "componentType": 5123}, "values": {"bufferView": values}});
    parts
        .accessors
        .push(json!({"componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse}));
    let primitives = json!([{"attributes": {"POSITION": 0}, "mode": 0}]);
    let loaded = read("a.glb", parts.glb(primitives.clone(), json!({})));
    assert_eq!(
        loaded.mesh.positions,
        [Vec3::ZERO, Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0)]
    );
    parts.bytes[0] = 9;
    let text = message("a.glb", parts.glb(primitives, json!({})));
    assert!(text.contains("accessor 0: sparse index 9 of 3"), "{text}");
}

#[test]
fn base_colors_and_what_is_left_out() {
    let (mut parts, mut primitives) = square();
    let places = parts.accessor(&[0; 32], 5126, "VEC2", 4);
    primitives[0]["material"] = json!(0);
    primitives[0]["attributes"]["TEXCOORD_0"] = json!(places);
    let more = json!({
        "materials": [{
            "name": "paint",
            "alphaMode": "BLEND",
            "pbrMetallicRoughness": {
                "baseColorFactor": [1.0, 0.5, 0.0, 0.5],
                "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}},
            },
        }],
        "textures": [{"source": 0}],
        "images": [{"uri": "paint.ktx2"}],
        "animations": [{}],
    });
    let loaded = read("a.glb", parts.glb(primitives, more));
    assert_eq!(loaded.mesh.colors, [[255, 188, 0, 255]; 4]);
    let said = remarks(&loaded);
    for words in [
        "texture `paint.ktx2` not read: it is not in the folder of the model",
        "transparency of 1 materials",
        "gltf-transform ktxdecompress",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let parts: Vec<String> = loaded
        .parts
        .iter()
        .map(|part| format!("{}: {}", part.name, part.note))
        .collect();
    let listed = parts.join("\n");
    assert!(
        listed.contains("material paint: base color and its texture"),
        "{listed}"
    );
    assert!(
        listed.contains("animations") && listed.contains("attribute TEXCOORD_0"),
        "{listed}"
    );
}

#[test]
fn packed_geometry_is_refused_with_the_command() {
    let (parts, primitives) = square();
    for (name, words) in [
        (
            "KHR_draco_mesh_compression",
            "packed by Draco, which is not read; `gltf-transform copy IN.glb OUT.glb` unpacks it",
        ),
        ("EXT_meshopt_compression", "packed by meshoptimizer"),
        ("ACME_secret", "requires the extension `ACME_secret`"),
    ] {
        let more = json!({"extensionsRequired": [name]});
        let text = message("a.glb", parts.glb(primitives.clone(), more));
        assert!(text.contains(words), "{text}");
    }
    // What is only offered beside plain data is no hindrance.
    let more = json!({"extensionsUsed": ["KHR_draco_mesh_compression"]});
    assert!(try_read("a.glb", parts.glb(primitives, more)).is_ok());
}

#[test]
fn numbers_that_lie_are_named() {
    let (parts, primitives) = square();
    let says = |path: &str, value: Value, words: &str| {
        let mut document = parts.document(primitives.clone(), json!({}));
        *document.pointer_mut(path).unwrap() = value;
        let text = message("a.glb", glb(&document, &parts.bytes));
        assert!(text.contains(words), "{text}");
    };
    says("/accessors/0/count", json!(u64::MAX), "accessor 0");
    says(
        "/accessors/0/count",
        json!(5),
        "5 rows every 12 bytes do not fit in 48 bytes",
    );
    says(
        "/accessors/0/count",
        json!(0),
        "0 values are more than the file holds",
    );
    says(
        "/accessors/0/componentType",
        json!(1),
        "component type 1 is not known",
    );
    says(
        "/accessors/0/type",
        json!("MAT4"),
        "type `MAT4` where a vector is wanted",
    );
    says(
        "/accessors/0/bufferView",
        json!(9),
        "buffer view 9 does not exist",
    );
    says(
        "/bufferViews/0/byteLength",
        json!(u64::MAX),
        "buffer view 0 wants",
    );
    says(
        "/meshes/0/primitives/0/attributes/POSITION",
        json!(7),
        "accessor 7: does not exist",
    );
    says("/nodes/0/mesh", json!(3), "node 0 names mesh 3 of 1");
    says("/scenes/0/nodes/0", json!(3), "node 3 of 1 does not exist");
    says(
        "/asset/version",
        json!("1.0"),
        "glTF version `1.0`; version 2 is read",
    );
}

#[test]
fn damage_is_read_or_refused() {
    let (mut parts, mut primitives) = square();
    let normal = parts.points(&[Vec3::Z; 4]);
    primitives[0]["attributes"]["NORMAL"] = json!(normal);
    let read = damage("a.glb", &parts.glb(primitives, json!({})), 3000);
    assert!((100..3000).contains(&read), "{read}");
}

/// Counts of the models' own table (README of the folder).
#[test]
fn real_models_have_their_verified_counts() {
    for (name, triangles) in [
        ("sharp/building-small-c.glb", 834),
        ("sharp/grass-trees-tall.glb", 472),
        ("sharp/tree-lime.glb", 919),
    ] {
        let Some(path) = super::real_file(name) else {
            return;
        };
        let loaded = scan_at(&path);
        assert_eq!(loaded.counts.faces, triangles, "{name}");
        println!(
            "{name}: {} {:?}\n{}",
            loaded.counts.vertices,
            loaded.mesh.origin,
            remarks(&loaded)
        );
    }
}
