//! Place and color of a mesh beside others: what a user says of one of several files.

use super::{Mesh, origin_of};
use glam::{DAffine3, DMat3, DVec3};

/// A transform and a color of a mesh; the default changes nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MeshPlacement {
    /// Moves, turns, scales or mirrors it: from the coordinates of its file to those of the picture.
    pub transform: Option<DAffine3>,
    /// Replaces its colors and images: red, green, blue.
    pub color: Option<[u8; 3]>,
}

impl MeshPlacement {
    /// Tells whether a mesh stays as it is.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Changes a mesh. Coordinates are computed in double precision and get an origin of their own where they are large.
    ///
    /// # Errors
    /// With the cause: a transform that flattens the mesh, or moves it beyond what single precision holds.
    pub fn apply(&self, mesh: &mut Mesh) -> Result<(), String> {
        if let Some([red, green, blue]) = self.color {
            mesh.colors = vec![[red, green, blue, 255]; mesh.positions.len()];
            mesh.textures = None;
        }
        match &self.transform {
            Some(transform) => moved(mesh, transform),
            None => Ok(()),
        }
    }
}

fn moved(mesh: &mut Mesh, transform: &DAffine3) -> Result<(), String> {
    let determinant = transform.matrix3.determinant();
    if !(determinant.is_normal() && transform.is_finite()) {
        return Err("its transform flattens it, or has numbers that are not finite".to_owned());
    }
    let world = |p: &glam::Vec3| transform.transform_point3(mesh.origin + p.as_dvec3());
    let (mut low, mut high, mut rounding) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0f64);
    for place in mesh.positions.iter().map(world) {
        (low, high) = (low.min(place), high.max(place));
        let off = place.as_vec3().as_dvec3() - place;
        rounding = rounding.max(off.abs().max_element());
    }
    let origin = match mesh.positions.is_empty() {
        true => DVec3::ZERO,
        false => origin_of(low, high, rounding),
    };
    let positions: Vec<glam::Vec3> = (mesh.positions.iter())
        .map(|p| (world(p) - origin).as_vec3())
        .collect();
    if !positions.iter().all(|p| p.is_finite()) {
        return Err("its transform moves it beyond 3.4e38 units".to_owned());
    }
    (mesh.positions, mesh.origin) = (positions, origin);
    mesh.scanners
        .transform(|place| transform.transform_point3(place));
    // Normals stay perpendicular; of unknown ones nothing is known.
    let of_normals: DMat3 = transform.matrix3.inverse().transpose();
    for normal in &mut mesh.normals {
        *normal = (of_normals * normal.as_dvec3())
            .normalize_or_zero()
            .as_vec3();
    }
    // A mirror turns triangles inside out.
    if determinant < 0.0 {
        (mesh.triangles.iter_mut()).for_each(|corners| corners.swap(1, 2));
        if let Some(textures) = &mut mesh.textures {
            (textures.corners.iter_mut()).for_each(|corners| corners.swap(1, 2));
        }
    }
    Ok(())
}

/// A transform from a text of 4 x 4 numbers, row by row, as CloudCompare, Open3D and NumPy write it: blanks, commas, semicolons,
/// brackets and lines between them, and remarks after `#`.
///
/// # Errors
/// With what is wrong: other than 16 numbers, or a last row other than 0 0 0 1.
pub fn parse_transform(text: &str) -> Result<DAffine3, String> {
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or(""));
    let words =
        lines.flat_map(|line| line.split(|c: char| c.is_whitespace() || ",;[]()".contains(c)));
    let mut numbers = Vec::new();
    for word in words.filter(|word| !word.is_empty()) {
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => numbers.push(number),
            _ => return Err(format!("{word:?} is no number")),
        }
    }
    let Ok(m) = <[f64; 16]>::try_from(numbers.as_slice()) else {
        return Err(format!(
            "16 numbers are wanted, 4 rows of 4, and there are {}",
            numbers.len()
        ));
    };
    let is_last = |four: [f64; 4]| four == [0.0, 0.0, 0.0, 1.0];
    if !is_last([m[12], m[13], m[14], m[15]]) {
        let hint = match is_last([m[3], m[7], m[11], m[15]]) {
            true => "; it seems to be written column by column",
            false => "",
        };
        return Err(format!("the last row is not 0 0 0 1{hint}"));
    }
    let column = |i: usize| DVec3::new(m[i], m[4 + i], m[8 + i]);
    Ok(DAffine3::from_mat3_translation(
        DMat3::from_cols(column(0), column(1), column(2)),
        column(3),
    ))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use glam::Vec3;

    fn triangle() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        }
    }

    fn placed(text: &str) -> Result<Mesh, String> {
        let placement = MeshPlacement {
            transform: Some(parse_transform(text)?),
            color: Some([1, 2, 3]),
        };
        let mut mesh = triangle();
        placement.apply(&mut mesh).map(|()| mesh)
    }

    #[test]
    fn rows_are_read_and_positions_normals_and_colors_follow() {
        // x to y, y to -x, z twice as far; then moved.
        let mesh = placed("[[0,-1,0,10],[1,0,0,20],\n[0,0,2,30]; 0 0 0 1] # turned").unwrap();
        assert_eq!(mesh.origin, DVec3::ZERO);
        let expected = [[10.0, 20.0, 30.0], [10.0, 21.0, 30.0], [9.0, 20.0, 30.0]];
        assert_eq!(mesh.positions, expected.map(Vec3::from_array));
        assert_eq!(mesh.normals, [Vec3::Z; 3]);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
        assert_eq!(mesh.colors, [[1, 2, 3, 255]; 3]);
        // A shear keeps normals perpendicular.
        let mesh = placed("1 0 0 0  0 1 0 0  1 0 1 0  0 0 0 1").unwrap();
        let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[i]);
        let geometric = (b - a).cross(c - a).normalize();
        assert!((mesh.normals[0] - geometric).length() < 1e-6);
    }

    #[test]
    fn a_mirror_keeps_fronts_and_far_places_their_detail() {
        let mesh = placed("-1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1").unwrap();
        assert_eq!(mesh.triangles, [[0, 2, 1]]);
        let mesh = placed("0.001 0 0 484649  0 0.001 0 6632629  0 0 0.001 0  0 0 0 1").unwrap();
        let side = mesh.positions[1] - mesh.positions[0];
        assert!(
            (side.x - 0.001).abs() < 1e-9 && mesh.origin.y > 6e6,
            "{mesh:?}"
        );
    }

    #[test]
    fn what_is_no_transform_is_refused_with_the_cause() {
        for (text, part) in [
            ("", "there are 0"),
            ("1 0 0 0 0 1 0 0 0 0 1 0", "there are 12"),
            ("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 x", "\"x\" is no number"),
            ("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 inf", "is no number"),
            ("1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1", "column by column"),
            ("1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 2", "is not 0 0 0 1"),
            ("1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1", "flattens"),
            ("1e300 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "beyond"),
        ] {
            let error = placed(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
