#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;
use crate::mesh::Mesh;
use crate::patches::ResidentPatches;
use crate::patches::tests::{of_mesh, sheet};
use crate::progress::SilentProgress;
use crate::textures::{MeshTextures, TextureLevel, WrapMode};

fn image() -> Arc<TextureImage> {
    let level = TextureLevel::new(2, 2, vec![[9, 9, 9, 255]; 4]).unwrap();
    Arc::new(TextureImage::new("a", [2; 2], [WrapMode::Clamp; 2], level))
}

/// A mesh whose triangles are in images where `place` says: of the number of a triangle and a position.
fn textured(mut mesh: Mesh, place: impl Fn(usize, Vec3) -> (u32, Vec2)) -> Model {
    let of = |(index, triangle): (usize, &[u32; 3])| {
        triangle.map(|corner| place(index, mesh.positions[corner as usize]))
    };
    let places: Vec<[(u32, Vec2); 3]> = mesh.triangles.iter().enumerate().map(of).collect();
    mesh.textures = Some(MeshTextures {
        images: vec![image(), image()],
        corners: places.iter().map(|own| own.map(|(_, at)| at)).collect(),
        image_of: places.iter().map(|own| own[0].0).collect(),
    });
    of_mesh(mesh)
}

/// Records of a model, and where they are in images.
fn records_of(model: &Model) -> Vec<(NodePatch, PatchTexture)> {
    let patches = ResidentPatches::build(model, &SilentProgress).unwrap();
    let nodes = model.tree.nodes.iter().enumerate();
    let records = nodes.map(|(index, node)| patches.records().record(index, node));
    let both: Vec<_> = records.zip(patches.textures().iter().copied()).collect();
    assert_eq!(both.len(), model.tree.nodes.len());
    both
}

fn hill(x: f32, y: f32) -> Vec3 {
    Vec3::new(x, y, 0.2 * (5.0 * x).sin() * (4.0 * y).cos())
}

#[test]
fn a_plane_has_the_place_of_its_image() {
    let flat = sheet([16, 16], |x, y| Vec3::new(x, 3.0 * y, 0.0), |_, _| false);
    let of = |at: Vec3| Vec2::new(0.2 + 0.5 * at.x, 0.9 - 0.1 * at.y);
    let model = textured(flat, |_, at| (1, of(at)));
    let (patch, texture) = records_of(&model)[0];
    assert!(patch.may_be_drawn() && texture.image == 1);
    assert!(texture.slip < 1e-5, "{}", texture.slip);
    for uv in [Vec2::ZERO, Vec2::new(0.3, 0.1), Vec2::new(-0.2, 0.4)] {
        let expected = of(patch.point(uv));
        assert!(texture.place(uv).distance(expected) < 1e-5);
    }
}

#[test]
fn the_slip_is_a_bound_at_every_corner() {
    let bent = |at: Vec3| Vec2::new(at.x + 0.3 * at.y * at.y, at.y - 0.2 * at.x * at.x);
    let model = textured(sheet([48, 48], hill, |_, _| false), |_, at| (0, bent(at)));
    let mut small = 0;
    for (node, (patch, texture)) in records_of(&model).iter().enumerate() {
        if !texture.slip.is_finite() {
            continue;
        }
        let radius = model.tree.nodes[node].radius;
        small += usize::from(texture.slip < 0.02 * radius);
        for leaf in model.tree.leaf_range(node as u32) {
            for corner in model.triangles[leaf as usize] {
                let position = model.vertices[corner as usize].position;
                let uv = foot(patch, position);
                // Where the patch shows what belongs to the corner, by halving the distance.
                let mut shown = uv;
                for _ in 0..60 {
                    let off = bent(position) - texture.place(shown);
                    let [u, v] = [texture.along_u, texture.along_v].map(Vec2::from);
                    let determinant = u.perp_dot(v);
                    shown += Vec2::new(off.perp_dot(v), u.perp_dot(off)) / determinant;
                }
                let slip = shown.distance(uv);
                assert!(slip <= texture.slip * 1.001 + 1e-5, "{slip} {texture:?}");
            }
        }
    }
    assert!(small > 200, "{small}");
}

/// Where images meet: between columns of cells, off the middle.
const SEAM: f32 = 13.0 / 32.0;

#[test]
fn no_patch_reaches_over_a_seam() {
    let flat = || sheet([32, 32], |x, y| Vec3::new(x, y, 0.0), |_, _| false);
    let center = |triangle: usize| (triangle / 2 % 32) as f32 / 32.0;
    let apart = |triangle: usize, at: Vec3| {
        let moved = if center(triangle) < SEAM { 0.0 } else { 3.0 };
        (0, at.truncate() + Vec2::X * moved)
    };
    let in_two = |triangle: usize, at: Vec3| (u32::from(center(triangle) >= SEAM), at.truncate());
    let half = |triangle: usize, at: Vec3| match center(triangle) < SEAM {
        true => (0, at.truncate()),
        false => (NO_IMAGE, Vec2::ZERO),
    };
    for model in [
        textured(flat(), apart),
        textured(flat(), in_two),
        textured(flat(), half),
    ] {
        let (mut over, mut beside) = (0, 0);
        for (patch, texture) in records_of(&model) {
            if !patch.may_be_drawn() {
                continue;
            }
            let (corners, count) = patch.corners();
            let ends = corners[..count]
                .iter()
                .map(|&corner| patch.point(corner * 0.99).x);
            let (low, high) =
                ends.fold((1.0f32, 0.0f32), |(low, high), x| (low.min(x), high.max(x)));
            // A quarter of a cell at least.
            let reaches_over = low < SEAM - 0.25 / 32.0 && high > SEAM + 0.25 / 32.0;
            over += usize::from(reaches_over);
            beside += usize::from(!reaches_over && texture.slip < 1e-4);
            // What is fitted over both sides is as far off as they are wide.
            assert!(
                !reaches_over || texture.slip > 0.1 * patch.reach(),
                "{texture:?} {low} {high}"
            );
        }
        assert!(over > 3 && beside > 100, "{over} {beside}");
    }
}
