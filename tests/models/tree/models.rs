//! Real models, read by the shortest code that can.

use glam::Vec3;
use surfel::mesh::Mesh;

/// The one binary layout of `horse.ply`: x y z nx ny nz, then triangles with a count byte.
pub(crate) fn horse(folder: &std::path::Path) -> Mesh {
    let bytes = std::fs::read(folder.join("thesis/horse.ply")).unwrap();
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let vector = |at: usize| Vec3::new(float(at), float(at + 4), float(at + 8));
    let faces = start + 48_485 * 24;
    let mesh = Mesh {
        positions: (0..48_485).map(|i| vector(start + i * 24)).collect(),
        normals: (0..48_485).map(|i| vector(start + i * 24 + 12)).collect(),
        triangles: (0..96_966)
            .map(|i| [1, 5, 9].map(|k| float(faces + i * 13 + k).to_bits()))
            .collect(),
        ..Mesh::default()
    };
    assert_eq!(faces + 96_966 * 13, bytes.len());
    mesh
}

/// Corners and polygons of an OBJ file, fanned; nothing else of it.
pub(crate) fn obj(path: &std::path::Path) -> Mesh {
    let mut mesh = Mesh::default();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let c: Vec<f32> = words.take(3).map(|w| w.parse().unwrap()).collect();
                mesh.positions.push(Vec3::from_slice(&c));
            }
            Some("f") => {
                let index = |w: &str| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                let corners: Vec<u32> = words.map(index).collect();
                let fan = corners[1..]
                    .windows(2)
                    .map(|pair| [corners[0], pair[0], pair[1]]);
                mesh.triangles.extend(fan);
            }
            _ => {}
        }
    }
    mesh
}
