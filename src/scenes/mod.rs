//! Scenes that methods fail at: each a small generated model, a camera, the size of a picture and a threshold at
//! which the failure shows.
//!
//! The failures are those of Benda, *Point Based Rendering*; Rusinkiewicz and Levoy, *QSplat*; Dietz, *Point
//! Rendering*; and of any renderer with finite memory and finite precision. Every scene is the same to the bit on every
//! machine (but for the camera's tangent), needs no file and has at most 60,000 triangles.
//!
//! Lengths behind or between surfaces are given in depth offsets ([`depth_offset`]): the distance up to which blended
//! splats count as one surface.
//!
//! ```
//! let entry = surfel::scenes::find("sheets-1").unwrap();
//! let scene = entry.make();
//! assert_eq!(scene.expected.gap, Some(1.0));
//! assert_eq!(scene.expected.covered_px, Some(15_876.0));
//! ```

mod color;
mod detail;
mod layers;
mod limits;
mod openings;
mod outline;
mod shape;
mod triangles;

use crate::math::camera::Camera;
use crate::mesh::Mesh;

/// A model, how it is looked at, and what is known about its picture.
#[derive(Debug, Clone)]
pub struct BuiltScene {
    /// The model; its leaves are points where it has no triangles.
    pub mesh: Mesh,
    /// The camera with the size of the picture.
    pub camera: Camera,
    /// Threshold at which the failure shows, pixels.
    pub threshold_px: f32,
    /// What a right picture shows, where that has a closed form.
    pub expected: ExpectedFigures,
}

/// Closed forms of a scene's picture; `None` where there is none.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct ExpectedFigures {
    /// Area that the surface covers in the picture, square pixels. Pictures with one sample a pixel may differ by half
    /// of the outline's length.
    pub covered_px: Option<f64>,
    /// Pixels that squares of the threshold's size cover, where that is what the scene is about.
    pub squares_px: Option<f64>,
    /// Perpendicular distance from the front surface to the next one behind it, in depth offsets of a facing splat with
    /// factor 1.
    pub gap: Option<f64>,
    /// Color of the pixel right of and above the picture's center (column width/2, row height/2 - 1), levels of 255,
    /// with two-sided light and vertex colors; within one level.
    pub color: Option<[u8; 3]>,
}

/// A scene by name.
#[derive(Debug, Clone, Copy)]
pub struct SceneEntry {
    /// Name on the command line.
    pub name: &'static str,
    /// What it shows, in one line.
    pub shows: &'static str,
    /// Which method fails there and how, in one line.
    pub fails: &'static str,
    make: fn() -> BuiltScene,
}

impl SceneEntry {
    /// Generates the scene; takes milliseconds.
    pub fn make(&self) -> BuiltScene {
        (self.make)()
    }
}

/// The depth offset of a splat: its radius in the world over the cosine of the viewing angle, times a factor
/// (Benda, section 2.3.3; the cosine limited to 0.1).
///
/// `threshold_px` is the splat's diameter on the picture (less than 1 counts as 1), `distance` the distance along the
/// view direction, `focal_px` the focal length in pixels, `cosine` that of the angle between normal and direction to the
/// eye, `factor` that of [`crate::render::Settings::depth_offset`]. The result is in units of `distance`.
pub fn depth_offset(
    threshold_px: f64,
    distance: f64,
    focal_px: f64,
    cosine: f64,
    factor: f64,
) -> f64 {
    factor * threshold_px.max(1.0) * distance / (2.0 * focal_px) / cosine.abs().max(0.1)
}

/// Every scene, in the order of the documents.
pub static ALL: &[SceneEntry] = &[
    SceneEntry {
        name: "silhouette",
        shows: "the unit sphere from distance 3, a closed form in every pixel",
        fails: "squares reach beyond the rim by up to half their diagonal",
        make: outline::silhouette,
    },
    SceneEntry {
        name: "horizon",
        shows: "a checkered plane up to the horizon",
        fails: "opaque squares show one cell of many near the horizon; depth offsets are clamped at flat angles",
        make: outline::horizon,
    },
    SceneEntry {
        name: "cube-edge",
        shows: "a finely cut cube of three colors, edge on",
        fails: "squares of one face stick out beyond the edges and over the next face",
        make: outline::cube_edge,
    },
    SceneEntry {
        name: "cube-corner",
        shows: "eight vertices with averaged normals, seen so that a vertex normal faces away from a visible face",
        fails: "culling by vertex normals loses the face; cones of geometric normals keep it",
        make: outline::cube_corner,
    },
    SceneEntry {
        name: "pedestal",
        shows: "a cube of 12 triangles on a finely cut pedestal",
        fails: "squares of the pedestal cover the foot of the cube",
        make: outline::pedestal,
    },
    SceneEntry {
        name: "statue-on-plinth",
        shows: "a detailed statue on a plinth of eight corners",
        fails: "splats of the plinth's corners are as large as it and swell its outline; --clip and --resample do not",
        make: outline::statue_on_plinth,
    },
    SceneEntry {
        name: "open-behind",
        shows: "an open sheet from behind",
        fails: "with --culling on it disappears; with --one-sided it is black",
        make: outline::open_behind,
    },
    SceneEntry {
        name: "edge-on",
        shows: "a sheet seen exactly along its plane: it covers nothing",
        fails: "squares draw a bar of the threshold's height",
        make: outline::edge_on,
    },
    SceneEntry {
        name: "thin-plate",
        shows: "a closed plate, red in front and green behind, one depth offset thick",
        fails: "blended splats mix in the back where culling is off",
        make: layers::thin_plate,
    },
    SceneEntry {
        name: "sheets-0.5",
        shows: "a red sheet half a depth offset in front of a green one",
        fails: "blended splats mix the two",
        make: layers::sheets_half,
    },
    SceneEntry {
        name: "sheets-1",
        shows: "a red sheet one depth offset in front of a green one",
        fails: "the border case of blended splats with factor 1",
        make: layers::sheets_one,
    },
    SceneEntry {
        name: "sheets-2",
        shows: "a red sheet two depth offsets in front of a green one",
        fails: "blended splats with a factor above 2 mix the two (--depth-offset)",
        make: layers::sheets_two,
    },
    SceneEntry {
        name: "sheets-4",
        shows: "a red sheet four depth offsets in front of a green one",
        fails: "no method: beyond every default offset",
        make: layers::sheets_four,
    },
    SceneEntry {
        name: "sheets-fine",
        shows: "sheets half a depth offset apart, cut so finely that a node of the threshold's size holds parts of both",
        fails: "every splat of a node: its color is the mean of both sheets",
        make: layers::sheets_fine,
    },
    SceneEntry {
        name: "sheets-tilted",
        shows: "sheets two depth offsets apart, tilted by 60 degrees",
        fails: "filtered splats mix the two; at a rim squares of the green sheet stick out",
        make: layers::sheets_tilted,
    },
    SceneEntry {
        name: "overlap",
        shows: "a red sheet and a green copy in the same place",
        fails: "every method: which of the two wins depends on the order, and blending mixes them",
        make: layers::overlap,
    },
    SceneEntry {
        name: "stack",
        shows: "500 tiny triangles of one color over one pixel",
        fails: "sums in 16-bit floats drift; in 32 bits the color stays",
        make: layers::stack,
    },
    SceneEntry {
        name: "opposite-normals",
        shows: "a sheet tilted by 60 degrees whose cells have normals of alternating sign",
        fails: "means of normals vanish; the tree keeps one of them, blended normals have none",
        make: color::opposite_normals,
    },
    SceneEntry {
        name: "zero-normals",
        shows: "a cloud whose normals are all zero",
        fails: "nothing to light by: every splat is as bright as a facing one",
        make: color::zero_normals,
    },
    SceneEntry {
        name: "checkerboard",
        shows: "black and white cells of less than half a pixel: their mean is gray",
        fails: "one sample a pixel shows a coarse board that is not there",
        make: color::checkerboard,
    },
    SceneEntry {
        name: "noise",
        shows: "a sheet of random heights below the size of a pixel",
        fails: "one sample a pixel, and opaque squares, show one facet of many",
        make: detail::noise,
    },
    SceneEntry {
        name: "foliage",
        shows: "5000 leaves of three pixels, turned at random",
        fails: "opaque squares make leaves too large; filtered splats mix what is close behind",
        make: detail::foliage,
    },
    SceneEntry {
        name: "fence",
        shows: "wires of 0.4 pixels",
        fails: "triangles lose most of the wires, squares make them a pixel wide",
        make: detail::fence,
    },
    SceneEntry {
        name: "under-pixel",
        shows: "a ball of 0.28 square pixels that no pixel center meets",
        fails: "triangles lose it, a square makes it a whole pixel; its mean normal is zero",
        make: detail::under_pixel,
    },
    SceneEntry {
        name: "pierced-sheet",
        shows: "a flat sheet with 256 holes of four pixels",
        fails: "splats larger than a hole close it; one polygon for a part with holes would, so its overhang refuses it",
        make: openings::pierced_sheet,
    },
    SceneEntry {
        name: "strips",
        shows: "strips of 2.3 pixels in one plane with gaps of 1.7",
        fails: "squares of the threshold close the gaps",
        make: openings::strips,
    },
    SceneEntry {
        name: "pillars",
        shows: "closed pillars of four pixels with gaps of four",
        fails: "nothing at a pixel; one polygon over several would close the gaps between them",
        make: openings::pillars,
    },
    SceneEntry {
        name: "thin-foil",
        shows: "a closed plate a third of a pixel thick, red in front and green behind",
        fails: "points show the back; a polygon of both sides would mix them",
        make: openings::thin_foil,
    },
    SceneEntry {
        name: "crossing",
        shows: "a red and a green sheet that cross in the middle of the picture",
        fails: "squares of one stick out of the other where they cross",
        make: openings::crossing,
    },
    SceneEntry {
        name: "waves",
        shows: "a wavy sheet from two degrees above itself",
        fails: "nothing at a pixel; polygons over several waves would flatten them",
        make: openings::waves,
    },
    SceneEntry {
        name: "needles",
        shows: "a torus of needles",
        fails: "spheres around needles are large; a row of splats has one normal for all of a needle's length",
        make: triangles::needles,
    },
    SceneEntry {
        name: "obtuse",
        shows: "a torus of obtuse triangles",
        fails: "as needles: spheres far larger than the triangles in them",
        make: triangles::obtuse,
    },
    SceneEntry {
        name: "huge-triangle",
        shows: "a triangle of 120 pixels beside twelve thousand of one",
        fails: "squares of the small ones cover the edge of the large one",
        make: triangles::huge_triangle,
    },
    SceneEntry {
        name: "spikes",
        shows: "a closed surface of spikes: normals in all directions in every node",
        fails: "cones wider than a half circle cull nothing: slow, not wrong; squares hide the valleys",
        make: triangles::spikes,
    },
    SceneEntry {
        name: "degenerate",
        shows: "a square whose triangles are there three times, with slivers of no area beside it",
        fails: "small slivers become squares, although they have no area",
        make: triangles::degenerate,
    },
    SceneEntry {
        name: "coincident-vertices",
        shows: "a square among 2000 triangles whose corners coincide",
        fails: "each such triangle becomes a square, although it has no area",
        make: triangles::coincident_vertices,
    },
    SceneEntry {
        name: "coincident-points",
        shows: "a cloud of 1000 points in one place",
        fails: "nothing: no spacing, so one square of the threshold's size",
        make: limits::coincident_points,
    },
    SceneEntry {
        name: "duplicate-points",
        shows: "a lattice of points, each there three times, one 100 times",
        fails: "with a spacing of zero between copies there would be holes; copies do not count",
        make: limits::duplicate_points,
    },
    SceneEntry {
        name: "near-points",
        shows: "nine points from very near: squares of 283 pixels, above the largest point of some devices",
        fails: "the points method leaves holes; squares above the limit are drawn as several",
        make: limits::near_points,
    },
    SceneEntry {
        name: "beside-view",
        shows: "a splat of 40 pixels whose center is 5 pixels left of the picture",
        fails: "devices drop points whose center is outside (the guard band keeps them); filtered splats cover it whole",
        make: limits::beside_view,
    },
    SceneEntry {
        name: "near-plane",
        shows: "a tilted plane through the near plane and past the eye",
        fails: "points whose center is before the near plane are dropped whole; pop has triangles there",
        make: limits::near_plane,
    },
    SceneEntry {
        name: "inside",
        shows: "the inside of a closed sphere",
        fails: "closed surfaces are culled from inside: an empty picture unless --culling off",
        make: limits::inside,
    },
    SceneEntry {
        name: "georeferenced",
        shows: "a statue five million meters from the origin",
        fails: "single precision without an origin of its own has steps of half a meter there",
        make: limits::georeferenced,
    },
    SceneEntry {
        name: "microscopic",
        shows: "a statue of two micrometers",
        fails: "absolute tolerances take it for a point",
        make: limits::microscopic,
    },
    SceneEntry {
        name: "one-triangle",
        shows: "a single triangle: a tree without nodes",
        fails: "nothing",
        make: limits::one_triangle,
    },
    SceneEntry {
        name: "one-point",
        shows: "a single point: no neighbor, no spacing",
        fails: "nothing",
        make: limits::one_point,
    },
    SceneEntry {
        name: "empty",
        shows: "nothing at all",
        fails: "nothing",
        make: limits::empty,
    },
];

/// The scene of that name.
pub fn find(name: &str) -> Option<&'static SceneEntry> {
    ALL.iter().find(|entry| entry.name == name)
}

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No scene has that name.
    #[error("there is no scene {0:?}; surfel scenes lists them")]
    Unknown(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_is_small_sound_and_the_same_twice() {
        for (k, entry) in ALL.iter().enumerate() {
            let name = entry.name;
            assert!(ALL[..k].iter().all(|other| other.name != name), "{name}");
            for line in [entry.shows, entry.fails] {
                assert!(line.len() < 120 && !line.contains('\n'), "{name}: {line}");
            }
            let BuiltScene {
                mesh,
                camera,
                threshold_px,
                ..
            } = entry.make();
            assert!(mesh.triangles.len() <= 60_000, "{name}");
            assert!(mesh.positions.iter().all(|p| p.is_finite()), "{name}");
            for corner in mesh.triangles.iter().flatten() {
                assert!((*corner as usize) < mesh.positions.len(), "{name}");
            }
            for attribute in [mesh.normals.len(), mesh.colors.len()] {
                assert!(
                    attribute == 0 || attribute == mesh.positions.len(),
                    "{name}"
                );
            }
            assert!(camera.view(mesh.origin).is_ok(), "{name}");
            assert!(threshold_px > 0.0, "{name}");
            let again = entry.make();
            assert!(mesh == again.mesh && camera == again.camera, "{name}");
            assert!(std::ptr::eq(find(name).unwrap(), entry), "{name}");
        }
        assert!(find("no-such-scene").is_none());
    }

    #[test]
    fn the_depth_offset_is_the_splats_radius_over_the_cosine() {
        // A splat of 6 pixels, 240 pixels to the unit of tangent, at distance 4.
        assert!((depth_offset(6.0, 4.0, 240.0, 1.0, 1.0) - 0.05).abs() < 1e-15);
        assert!((depth_offset(6.0, 4.0, 240.0, -0.5, 3.0) - 0.3).abs() < 1e-15);
        assert!((depth_offset(6.0, 4.0, 240.0, 0.0, 1.0) - 0.5).abs() < 1e-15);
        assert_eq!(
            depth_offset(0.0, 4.0, 240.0, 1.0, 1.0),
            depth_offset(1.0, 4.0, 240.0, 1.0, 1.0)
        );
    }
}
