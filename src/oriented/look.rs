//! Color and normals of a splat, from those of the vertices around its point.
//!
//! A mesh is lit by normals that its triangles interpolate between vertices. A splat has one at its point and, as a patch of
//! a smooth surface has, a shape operator that turns it towards those of the neighbors: three numbers, by least squares.

use crate::abi::OrientedPolygon;
use crate::oriented::radius::{OwnPart, corner_of};
use crate::oriented::surface::WeldedSurface;
use glam::{DMat3, DVec2, DVec3};

/// What a vertex of the mesh looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VertexLook {
    /// Unit normal for light; zero where there is none.
    pub normal: DVec3,
    /// Red, green, blue, 0..=255; the last is not used.
    pub color: [u8; 4],
    /// The color is in an image, which no splat shows: faces of the vertex stay triangles where splats are cut.
    pub has_image: bool,
}

impl Default for VertexLook {
    /// White, without a normal.
    fn default() -> Self {
        Self {
            normal: DVec3::ZERO,
            color: [255; 4],
            has_image: false,
        }
    }
}

/// Most that a normal may turn from the middle of a splat to a corner, as a tangent: what turns more is no smooth surface.
const MOST_TURN: f64 = 1.0;

/// Differences of a splat from the look of what it has to cover.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LookMisfit {
    /// Greatest distance of the unit normal that the splat has from the one that the mesh interpolates there.
    pub turn: f64,
    /// Greatest difference of a color, levels of 255.
    pub levels: f64,
}

/// Normal and color of a face at its corner `k`.
fn look_at(surface: &WeldedSurface, looks: &[VertexLook], face: u32, k: usize) -> (DVec3, [u8; 4]) {
    let vertex = surface.vertices_of_face[face as usize][k];
    let look = looks.get(vertex as usize).copied().unwrap_or_default();
    let own = surface.normals[face as usize];
    // Normals of a file may point to the other side; both are lit.
    let normal = if look.normal == DVec3::ZERO {
        own
    } else if look.normal.dot(own) < 0.0 {
        -look.normal
    } else {
        look.normal
    };
    (normal, look.color)
}

/// Gives a splat the mean color and normal that `faces` have at its point, and the shape operator that their other corners
/// ask for. `looks` has one for each vertex of the mesh; faces of vertices without normals have their own.
pub fn take_look(
    splat: &mut OrientedPolygon,
    surface: &WeldedSurface,
    point: u32,
    faces: &[u32],
    looks: &[VertexLook],
) {
    let look_at = |face, k| look_at(surface, looks, face, k);
    let corners = |face: u32| (0..3).map(move |k| (k, surface.faces[face as usize][k]));
    let mut normal = DVec3::ZERO;
    let mut color = DVec3::ZERO;
    let mut weight = 0.0;
    for &face in faces {
        for (k, _) in corners(face).filter(|&(_, p)| p == point) {
            let (own, own_color) = look_at(face, k);
            let area = surface.areas[face as usize];
            normal += own * area;
            color += color_of(own_color) * area;
            weight += area;
        }
    }
    let Some(normal) = normal.try_normalize().filter(|_| weight > 0.0) else {
        return;
    };
    let [r, g, b] = (color / weight).round().as_u8vec3().to_array();
    splat.color = [r, g, b, 255];
    splat.shading_normal = normal.as_vec3();

    let center = surface.points[point as usize];
    let axes = [splat.axis, splat.second_axis()].map(|axis| axis.as_dvec3());
    let in_plane = |x: DVec3| DVec2::new(x.dot(axes[0]), x.dot(axes[1]));
    let mut sums = DMat3::ZERO;
    let mut turns = DVec3::ZERO;
    for &face in faces {
        for (k, other) in corners(face).filter(|&(_, p)| p != point) {
            let DVec2 { x: u, y: v } = in_plane(surface.points[other as usize] - center);
            let turn = in_plane(look_at(face, k).0 - normal);
            let area = surface.areas[face as usize];
            sums += DMat3::from_cols_array(&[
                u * u,
                u * v,
                0.0,
                u * v,
                u * u + v * v,
                u * v,
                0.0,
                u * v,
                v * v,
            ]) * area;
            turns += DVec3::new(u * turn.x, v * turn.x + u * turn.y, v * turn.y) * area;
        }
    }
    // A little of the identity makes one solution of many, where neighbors lie on a line.
    let trace = sums.x_axis.x + sums.y_axis.y + sums.z_axis.z;
    let bend = (sums + DMat3::from_diagonal(DVec3::splat(1e-6 * trace))).inverse() * turns;
    let turn = |&[u, v]: &[f32; 2]| {
        let corner = DVec2::new(u.into(), v.into());
        let DVec2 { x: u, y: v } = corner.clamp_length_max(splat.round_radius.into());
        DVec2::new(bend.x * u + bend.y * v, bend.y * u + bend.z * v).length()
    };
    if splat.footprint().iter().map(turn).fold(0.0, f64::max) <= MOST_TURN {
        splat.shape_operator = bend.as_vec3().to_array();
    }
}

/// Measures how far a splat is from the look of the mesh at the corners of the `parts` of `faces` that it stands for.
pub fn misfit(
    splat: &OrientedPolygon,
    surface: &WeldedSurface,
    point: u32,
    (faces, parts): (&[u32], &[OwnPart]),
    looks: &[VertexLook],
) -> LookMisfit {
    let center = surface.points[point as usize];
    let axes = [splat.axis, splat.second_axis()].map(|axis| axis.as_dvec3());
    let mean = color_of(splat.color);
    let mut misfit = LookMisfit::default();
    let mut least_cosine = 1.0_f64;
    for (&face, part) in faces.iter().zip(parts) {
        let vertices = surface.vertices_of_face[face as usize];
        let has_image = |&v: &u32| looks.get(v as usize).is_some_and(|look| look.has_image);
        if vertices.iter().any(has_image) {
            misfit.levels = f64::INFINITY;
        }
        let first = corner_of(surface, face, point);
        let seen = [0, 1, 2].map(|k| look_at(surface, looks, face, (first + k) % 3));
        let [colors, normals] = [seen.map(|s| color_of(s.1)), seen.map(|s| s.0)];
        for (&place, &weights) in part.corners().iter().zip(part.shares()) {
            let mix = |[a, b, c]: [DVec3; 3]| weights[0] * a + weights[1] * b + weights[2] * c;
            let offset = place - center;
            let uv = axes.map(|axis| axis.dot(offset) as f32);
            let (shown, normal) = (splat.normal_at(uv).as_dvec3(), mix(normals));
            let lengths = shown.length_squared() * normal.length_squared();
            least_cosine = least_cosine.min(shown.dot(normal) / lengths.sqrt().max(1e-300));
            misfit.levels = (misfit.levels).max((mix(colors) - mean).abs().max_element());
        }
    }
    // Distance of unit vectors.
    misfit.turn = (2.0 - 2.0 * least_cosine).max(0.0).sqrt();
    misfit
}

/// Red, green and blue.
fn color_of([r, g, b, _]: [u8; 4]) -> DVec3 {
    DVec3::new(r.into(), g.into(), b.into())
}

/// Weights of the corners of a face at a place in it.
fn weights_at([a, b, c]: [DVec3; 3], place: DVec3) -> [f64; 3] {
    let whole = (b - a).cross(c - a);
    let double = whole.length_squared();
    [(b, c), (c, a), (a, b)].map(|(from, to)| (from - place).cross(to - place).dot(whole) / double)
}

/// Gives a splat within a face the color and normal that the face has at its center.
pub fn take_look_of_face(
    splat: &mut OrientedPolygon,
    surface: &WeldedSurface,
    face: u32,
    looks: &[VertexLook],
) {
    let [a, b, c] = surface.corners(face);
    let vertices = surface.vertices_of_face[face as usize];
    let own = surface.normals[face as usize];
    let looks = vertices.map(|v| looks.get(v as usize).copied().unwrap_or_default());
    let weights = weights_at([a, b, c], splat.center.as_dvec3());
    let mut normal = DVec3::ZERO;
    let mut color = DVec3::ZERO;
    for (look, weight) in looks.iter().zip(weights) {
        let [red, green, blue, _] = look.color;
        color += weight * DVec3::new(red.into(), green.into(), blue.into());
        normal += weight
            * if look.normal == DVec3::ZERO {
                own
            } else {
                look.normal
            };
    }
    let [red, green, blue] = color.round().as_u8vec3().to_array();
    splat.color = [red, green, blue, 255];
    splat.shading_normal = normal.normalize_or(own).as_vec3();
    // Normals change evenly over a face; what of that is symmetric and in its plane a shape operator has.
    let length = normal.length();
    if length > 0.0 && looks.iter().all(|look| look.normal != DVec3::ZERO) {
        let axes = [splat.axis, splat.second_axis()].map(|axis| axis.as_dvec3());
        let change = axes.map(|axis| {
            let moved = weights_at([a, b, c], splat.center.as_dvec3() + axis);
            let of = |k: usize| (moved[k] - weights[k]) * looks[k].normal;
            (of(0) + of(1) + of(2)) / length
        });
        let [along, across] = change.map(|change| axes.map(|axis| axis.dot(change)));
        let bend = [along[0], (along[1] + across[0]) / 2.0, across[1]];
        splat.shape_operator = bend.map(|x| x as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oriented::shapes::grid;
    use crate::oriented::splats::{SplatRules, splats_of};

    #[test]
    fn a_paraboloid_has_the_shape_operator_of_its_curvatures() {
        // z = -(a x² + b y²) / 2 has the normal (a x, b y, 1) / length.
        let (a, b) = (0.02_f64, 0.05_f64);
        let at = |x: f32, y: f32| (f64::from(x) - 3.0, f64::from(y) - 3.0);
        let mesh = grid(6, |x, y| {
            let (x, y) = at(x, y);
            (-(a * x * x + b * y * y) / 2.0) as f32
        });
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let looks: Vec<VertexLook> = (mesh.positions.iter())
            .map(|p| {
                let (x, y) = at(p.x, p.y);
                VertexLook {
                    normal: DVec3::new(a * x, b * y, 1.0).normalize(),
                    color: [10 * p.x as u8, 20, 30, 0],
                    has_image: false,
                }
            })
            .collect();
        let set = splats_of(&surface, &looks, &SplatRules::default());
        let splat = set.splats_of_point(24)[0];
        assert!((splat.shading_normal.as_dvec3() - DVec3::Z).length() < 1e-6);
        assert_eq!(splat.color, [30, 20, 30, 255]);
        for (x, y) in [(1.0, 0.0), (0.0, 1.0), (-0.5, 0.5)] {
            let offset = DVec3::new(x, y, 0.0).as_vec3();
            let uv = [offset.dot(splat.axis), offset.dot(splat.second_axis())];
            let expected = DVec3::new(a * x, b * y, 1.0).as_vec3();
            let off = splat.normal_at(uv) - expected;
            assert!(off.length() < 3e-3, "{off}");
        }
    }

    #[test]
    fn a_fold_does_not_bend_normals() {
        let mesh = grid(4, |x, _| -(x - 2.0).abs() * 3.0);
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let set = splats_of(&surface, &[], &SplatRules::default());
        let splat = set.splats_of_point(12)[0];
        assert_eq!(
            splat.shading_normal, splat.normal,
            "without normals those of faces count"
        );
        let turns = splat
            .footprint()
            .iter()
            .map(|&uv| splat.normal_at(uv) - splat.shading_normal);
        assert!(turns.map(|turn| turn.length()).fold(0.0, f32::max) <= 2.0);
    }
}
