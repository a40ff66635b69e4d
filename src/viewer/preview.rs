//! A coarse picture of a mesh whose tree is not built yet: a few of its triangles or points, as points.

use crate::mesh::Mesh;
use crate::progress::{Progress, SilentProgress};
use crate::tree::{self, BuildOptions, Model};
use glam::Vec3;

/// Meshes of fewer triangles, or points, are built before anybody could look at a preview.
const LEAST: usize = 300_000;
/// Points of a preview, about.
const POINTS: usize = 40_000;

/// Every so-manieth triangle as a point with its normal, or point, with all that decides where a camera looks at the
/// whole: the preview has its box, and its sphere. None of a mesh that is built quickly.
pub fn of(mesh: &Mesh) -> Option<Mesh> {
    let count = if mesh.is_cloud() {
        mesh.positions.len()
    } else {
        mesh.triangles.len()
    };
    if count < LEAST {
        return None;
    }
    let mut preview = Mesh {
        origin: mesh.origin,
        ..Mesh::default()
    };
    let mut add = |corners: &[u32], normal: Vec3| {
        let sum: Vec3 = corners.iter().map(|&c| mesh.positions[c as usize]).sum();
        preview.positions.push(sum / corners.len() as f32);
        preview.normals.push(normal);
        if let Some(color) = mesh.colors.get(corners[0] as usize) {
            preview.colors.push(*color);
        }
    };
    let normal_of = |i: u32| mesh.normals.get(i as usize).copied().unwrap_or(Vec3::ZERO);
    let step = count.div_ceil(POINTS);
    if mesh.is_cloud() {
        for i in (0..count as u32).step_by(step) {
            add(&[i], normal_of(i));
        }
    } else {
        for corners in mesh.triangles.iter().step_by(step) {
            let [a, b, c] = corners.map(|i| mesh.positions[i as usize]);
            add(corners, (b - a).cross(c - a).normalize_or_zero());
        }
    }
    for i in outermost(mesh) {
        add(&[i], normal_of(i));
    }
    Some(preview)
}

/// The vertices that decide the box of a mesh and the sphere around its middle.
fn outermost(mesh: &Mesh) -> Vec<u32> {
    let mut is_used = vec![mesh.is_cloud(); mesh.positions.len()];
    for corner in mesh.triangles.iter().flatten() {
        is_used[*corner as usize] = true;
    }
    let used = || (0..mesh.positions.len() as u32).filter(|&i| is_used[i as usize]);
    let at = |i: u32| mesh.positions[i as usize];
    let by = |key: &dyn Fn(Vec3) -> f32| used().max_by(|&a, &b| key(at(a)).total_cmp(&key(at(b))));
    let mut found = Vec::new();
    for axis in 0..3 {
        found.extend(by(&|p| p[axis]));
        found.extend(by(&|p| -p[axis]));
    }
    let low = found.iter().map(|&i| at(i)).reduce(Vec3::min);
    let high = found.iter().map(|&i| at(i)).reduce(Vec3::max);
    if let (Some(low), Some(high)) = (low, high) {
        let middle = (low + high) / 2.0;
        found.extend(by(&|p| p.distance_squared(middle)));
    }
    found
}

/// The model of a sample.
pub fn of_sample(mesh: Mesh) -> Option<Model> {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).ok()
}

/// The model of a preview; none where there is to be none, or it was cancelled.
pub fn model(mesh: &Mesh, progress: &dyn Progress) -> Option<Model> {
    tree::build(of(mesh)?, &BuildOptions::default(), progress).ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::generate::{GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;

    #[test]
    fn a_preview_is_seen_by_the_camera_of_the_whole() {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 400_000).unwrap();
        let mut mesh = crate::generate::mesh(&spec);
        // A vertex that no triangle has decides nothing.
        mesh.positions.push(Vec3::splat(1e6));
        if !mesh.normals.is_empty() {
            mesh.normals.push(Vec3::X);
        }
        for cloud in [false, true] {
            if cloud {
                mesh.positions.pop();
                mesh.normals.truncate(mesh.positions.len());
                while mesh.positions.len() < LEAST {
                    let copy = mesh.positions.clone();
                    mesh.positions.extend(copy);
                }
                mesh.normals.clear();
                mesh.triangles.clear();
            }
            let preview = model(&mesh, &SilentProgress).unwrap();
            let whole =
                tree::build(mesh.clone(), &BuildOptions::default(), &SilentProgress).unwrap();
            assert_eq!(preview.orbit_center, whole.orbit_center);
            assert_eq!(preview.orbit_radius, whole.orbit_radius);
            assert_eq!(preview.origin, whole.origin);
            let points = preview.vertices.len();
            assert!((POINTS / 2..=POINTS + 8).contains(&points), "{points}");
            // Points lie on the surface: within its box, and their spheres are about as far apart as they are.
            assert!(preview.triangles.is_empty() && preview.min == whole.min);
        }
    }

    #[test]
    fn small_meshes_have_none() {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Sphere, 20_000).unwrap();
        assert!(of(&crate::generate::mesh(&spec)).is_none());
        assert!(of(&Mesh::default()).is_none());
    }
}
