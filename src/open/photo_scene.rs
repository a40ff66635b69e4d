//! Scenes of photographs as models: the sparse points that calibrated the cameras, for where there is no mesh.

use super::{OpenedContent, SourceContent, SourceFormat};
use crate::Error;
use crate::input::FileCounts;
use crate::mesh::Mesh;
use crate::mesh::attributes::PointAttributes;
use crate::photos::error::PhotoError;
use crate::photos::formats::{locate_scene, read_scene};
use crate::photos::scene::PhotoScene;
use glam::DVec3;
use std::path::Path;

/// Coordinates from here on lose places in single precision, so that they are stored from the middle of the points.
const LARGE: f64 = 1e4;

/// Tells whether a file or folder is a scene of photographs.
pub fn is_photo_scene(path: &Path) -> bool {
    locate_scene(path).is_ok()
}

/// Tells whether a scene has photographs that are there, beside it or in a folder; `None` of what is no scene or has a fault,
/// which is told where it is opened.
pub fn has_photographs(path: &Path, folder: Option<&Path>) -> Option<bool> {
    locate_scene(path).ok()?;
    let scene = read_scene(path, folder).ok()?;
    Some(scene.photos.iter().any(|photo| photo.file.is_some()))
}

/// Says that a scene has no photographs.
pub fn without_photographs(path: &Path) -> String {
    format!(
        "{}: none of its photographs is there; its points are shown in their own colors",
        path.display()
    )
}

/// Reads the points of a scene of photographs; `None` of what is no such scene.
///
/// # Errors
/// The fault in the file, or that it has no points.
pub(super) fn read_points(path: &Path) -> Result<Option<SourceContent>, Error> {
    let Ok(location) = locate_scene(path) else {
        return Ok(None);
    };
    let scene = read_scene(path, None)?;
    let mesh = points_of(&scene);
    if mesh.positions.is_empty() {
        return Err(PhotoError::Usage(format!(
            "{}: this scene of photographs has no points to show; open its mesh with --photos {}",
            path.display(),
            path.display()
        ))
        .into());
    }
    Ok(Some(SourceContent {
        counts: FileCounts {
            vertices: mesh.positions.len() as u64,
            faces: 0,
        },
        content: OpenedContent::Mesh(mesh),
        format: SourceFormat::Photographs,
        file_bytes: location.path.metadata().map_or(0, |file| file.len()),
        warnings: Vec::new(),
        parts: Vec::new(),
        attributes: PointAttributes::default(),
        paged: None,
        scene: None,
    }))
}

/// Sparse points with their colors; those that are no place are left out.
fn points_of(scene: &PhotoScene) -> Mesh {
    let (middle, _) = scene.extent();
    let origin = match middle.abs().max_element() > LARGE {
        true => middle.round(),
        false => DVec3::ZERO,
    };
    let places = scene.points.iter().filter(|point| {
        let place = (point.position - origin).as_vec3();
        place.is_finite()
    });
    let mut mesh = Mesh {
        origin,
        ..Mesh::default()
    };
    for point in places {
        let [red, green, blue] = point.color;
        mesh.positions.push((point.position - origin).as_vec3());
        mesh.colors.push([red, green, blue, 255]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::open::{OpenOptions, open};
    use crate::progress::SilentProgress;
    use crate::tree::Model;

    /// A Bundler file with one camera and these points.
    fn bundle(points: &[[f64; 3]]) -> String {
        let mut text = format!(
            "# Bundle file v0.3\n1 {}\n500 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -4\n",
            points.len()
        );
        for [x, y, z] in points {
            text += &format!("{x} {y} {z}\n200 100 50\n1 0 0 3.5 -2.5\n");
        }
        text
    }

    fn opened(name: &str, text: &str) -> Result<crate::OpenedModel, Error> {
        let folder = std::env::temp_dir().join(format!("surfel-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        image::RgbImage::new(40, 30)
            .save(folder.join("a.png"))
            .unwrap();
        std::fs::write(folder.join("list.txt"), "a.png\n").unwrap();
        let file = folder.join("bundle.out");
        std::fs::write(&file, text).unwrap();
        assert!(is_photo_scene(&file) && is_photo_scene(&folder));
        let found = open(&file, &OpenOptions::default(), &SilentProgress);
        std::fs::remove_dir_all(&folder).unwrap();
        found
    }

    #[test]
    fn a_scene_without_a_mesh_is_its_points_in_their_colors() {
        let points: Vec<[f64; 3]> = (0..50)
            .map(|i| [0.1 * f64::from(i), f64::from(i % 7), 0.5])
            .collect();
        let found = opened("scene-points", &bundle(&points)).unwrap();
        assert_eq!(found.format, SourceFormat::Photographs);
        assert!(found.has_points());
        assert_eq!((found.counts.vertices, found.counts.faces), (50, 0));
        let model = &found.model;
        assert_eq!(model.vertices.len(), 50);
        assert!(
            model
                .vertices
                .iter()
                .all(|v| v.color[..3] == [200, 100, 50])
        );
        // Far from zero they keep their places.
        let far: Vec<[f64; 3]> = points.iter().map(|[x, y, z]| [x + 4e6, *y, *z]).collect();
        let far = opened("scene-far", &bundle(&far)).unwrap().model;
        assert!(far.origin.x > 3.9e6);
        let widest = |model: &crate::tree::Model| {
            let x = model.vertices.iter().map(|v| f64::from(v.position.x));
            x.clone().fold(f64::MIN, f64::max) - x.fold(f64::MAX, f64::min)
        };
        assert!((widest(&far) - widest(model)).abs() < 1e-3);
    }

    #[test]
    fn stray_points_are_not_framed() {
        let mut points: Vec<[f64; 3]> = (0..400)
            .map(|i| [f64::from(i % 20), f64::from(i / 20), 0.1 * f64::from(i % 3)])
            .collect();
        // As far as the strays of Kermit: 3 to 7 half diagonals.
        points.extend([[45.0, 9.0, 0.0], [-80.0, 30.0, 9.0]]);
        let model = opened("scene-strays", &bundle(&points)).unwrap().model;
        let part = model.framed.unwrap();
        assert_eq!(part.far_vertices, 2);
        assert!(part.radius < 14.0 && model.orbit_radius > 60.0, "{part:?}");
        let shown = Model::moved_to(
            model,
            DVec3::splat(1.0),
            &mut PointAttributes::default(),
            &SilentProgress,
        );
        assert_eq!(shown.unwrap().framed.unwrap().far_vertices, 2);
        // Where none is far, all are framed.
        points.truncate(400);
        let model = opened("scene-even", &bundle(&points)).unwrap().model;
        assert_eq!(model.framed, None);
    }

    #[test]
    fn a_scene_without_points_says_what_to_open() {
        let error = opened("scene-bare", &bundle(&[])).unwrap_err().to_string();
        assert!(
            error.contains("no points") && error.contains("--photos"),
            "{error}"
        );
    }
}
