//! Small meshes of known shape.

use crate::mesh::Mesh;
use glam::Vec3;

/// The unit cube around the origin: 8 vertices, 12 triangles.
pub(crate) fn cube() -> Mesh {
    prism(
        &[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]],
        &[[0, 1, 2], [0, 2, 3]],
    )
}

/// An L of three unit squares, one unit high: 12 vertices, with one concave edge.
pub(crate) fn l_shape() -> Mesh {
    let outline = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [1.0, 2.0],
        [0.0, 2.0],
    ];
    prism(&outline, &[[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
}

/// What lies between z = -1/2 and 1/2 above an outline (counter-clockwise) that these triangles fill.
fn prism(outline: &[[f32; 2]], caps: &[[u32; 3]]) -> Mesh {
    let n = outline.len() as u32;
    let at = |z: f32| outline.iter().map(move |&[x, y]| Vec3::new(x, y, z));
    let mut triangles = Vec::new();
    for &[a, b, c] in caps {
        triangles.push([a, c, b]);
        triangles.push([n + a, n + b, n + c]);
    }
    for a in 0..n {
        let b = (a + 1) % n;
        triangles.push([a, b, n + b]);
        triangles.push([a, n + b, n + a]);
    }
    Mesh {
        positions: at(-0.5).chain(at(0.5)).collect(),
        triangles,
        ..Mesh::default()
    }
}

/// A grid of `n` x `n` unit squares in the plane z = 0, its vertices lifted by `height`.
pub(crate) fn grid(n: u32, height: impl Fn(f32, f32) -> f32) -> Mesh {
    let side = n + 1;
    let positions = (0..side * side)
        .map(|k| {
            let (x, y) = ((k % side) as f32, (k / side) as f32);
            Vec3::new(x, y, height(x, y))
        })
        .collect();
    let triangles = (0..n * n)
        .flat_map(|k| {
            let a = k / n * side + k % n;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        })
        .collect();
    Mesh {
        positions,
        triangles,
        ..Mesh::default()
    }
}
