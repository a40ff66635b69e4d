//! Failures of the thesis as pictures: its ways of drawing beside ours, of surfaces that provoke each.
//!
//! Numbers are those of the list that the failures come from: F2 holes where normals are off, F3 holes of too small a radius,
//! F6 sharp edges, F7 uneven spacing, F8 cones that cull what is seen, F9 cones of vertex normals.

use super::dietz_holes::{OFF_DEGREES, bare, tilt, tilted};
use super::{PublishedTable, count};
use crate::abi::Vertex;
use crate::chart::ChartError;
use crate::image::{Image, contact_sheet};
use crate::math::camera::{Camera, View};
use crate::math::octahedral;
use crate::mesh::Mesh;
use crate::oriented::cones::{ConeRule, ConeTree};
use crate::oriented::look::VertexLook;
use crate::oriented::radius::RadiusRule;
use crate::oriented::shapes::{cube, grid, l_shape};
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::pack::{DrawList, PrimitiveStyle};
use crate::progress::Progress;
use crate::render::PictureOutputs;
use crate::render::reference::{PolygonList, render_with_polygons};
use glam::{DVec3, Vec3};
use std::rc::Rc;

/// Size of each picture, pixels.
const SIZE: (u32, u32) = (240, 160);
/// Color of bare pixels, and that which pixels beyond the outline are mixed with (Okabe and Ito).
const BARE: [u8; 3] = [213, 94, 0];
const BEYOND: [u8; 3] = [86, 180, 233];

/// A surface, each face with vertices and the normal of its own, and an eye.
struct FailureScene {
    surface: WeldedSurface,
    vertices: Vec<Vertex>,
    view: View,
    eye: DVec3,
    radius: f64,
}

/// A way to draw one.
struct FailureWay {
    scene: Rc<FailureScene>,
    name: String,
    set: SplatSet,
}

/// Two ways of the thesis, and ours.
type WaysOfFailure = Result<[FailureWay; 3], ChartError>;

/// The failures of the thesis in a row each: two ways of it and ours, bare pixels in orange and those beyond the outline in blue;
/// and how many of both there are.
///
/// # Errors
/// When `progress` is cancelled.
pub fn failures(progress: &dyn Progress) -> Result<(Image, PublishedTable), ChartError> {
    let mut table = PublishedTable::new(
        format!("Dietz: his failures, {} x {} pixels", SIZE.0, SIZE.1),
        &["", "splats", "triangles", "bare px", "beyond px", "remark"],
    );
    let rows = [
        holes_where_normals_are_off as fn() -> WaysOfFailure,
        holes_of_a_small_radius,
        sharp_edges,
        uneven_spacing,
        cones_of_faces,
        cones_of_vertices,
    ];
    progress.stage("failures", rows.len() as u64);
    let mut pictures = Vec::new();
    for row in rows {
        if progress.is_cancelled() {
            return Err(ChartError::Cancelled);
        }
        for (k, way) in row()?.into_iter().enumerate() {
            let mut picture = way.scene.draw(&way.set);
            let exact = way.scene.draw(&way.scene.all());
            let [bare, beyond] = mark(&exact, &mut picture, way.scene.radius as f32);
            table.row(vec![
                way.name.clone(),
                count(way.set.splats.len() as u64),
                count(way.set.triangles.len() as u64),
                count(bare),
                count(beyond),
                match k {
                    2 => "ours".into(),
                    _ => String::new(),
                },
            ]);
            pictures.push((way.name, picture));
        }
        progress.advance(1);
    }
    Ok((contact_sheet(&pictures, 3), table))
}

impl FailureScene {
    /// The surface of a mesh, seen from an eye that has its sphere in the picture, and so many times as near as that.
    fn new(
        mesh: &Mesh,
        zoom: f64,
        eye_of: impl FnOnce(&WeldedSurface) -> DVec3,
    ) -> Result<Rc<Self>, ChartError> {
        let corners = mesh.triangles.iter().flatten();
        let positions: Vec<Vec3> = corners.map(|&v| mesh.positions[v as usize]).collect();
        let triangles: Vec<[u32; 3]> = (0..mesh.triangles.len() as u32)
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        let surface = WeldedSurface::new(&positions, &triangles);
        let vertex = |(k, &position): (usize, &Vec3)| Vertex {
            position,
            normal: octahedral::encode(surface.normals[k / 3].as_vec3()),
            color: [255; 4],
        };
        let vertices = positions.iter().enumerate().map(vertex).collect();
        let radius = surface.diagonal() / 2.0;
        let (low, high) = (surface.points.iter())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
                (low.min(p), high.max(p))
            });
        let (center, eye) = ((low + high) / 2.0, eye_of(&surface));
        let distance = eye.distance(center);
        let opening = 2.0 * (1.05 * radius / distance / zoom).min(0.9).asin();
        let range = [0.05 * distance, distance + 2.0 * radius];
        let camera = Camera::look_at(SIZE, eye, center, DVec3::Z, opening, range);
        Ok(Rc::new(Self {
            view: camera.view(DVec3::ZERO)?,
            surface,
            vertices,
            eye,
            radius,
        }))
    }

    /// Every triangle.
    fn all(&self) -> SplatSet {
        SplatSet {
            triangles: (0..self.vertices.len() as u32 / 3).collect(),
            ..SplatSet::default()
        }
    }

    fn draw(&self, set: &SplatSet) -> Image {
        let corners = |&id: &u32| [3 * id, 3 * id + 1, 3 * id + 2];
        let triangles: Vec<[u32; 3]> = set.triangles.iter().map(corners).collect();
        let list = DrawList {
            vertices: &self.vertices,
            triangles: &triangles,
            splats: &[],
            points: &[],
            textures: None,
        };
        let polygons = PolygonList {
            polygons: &set.splats,
            are_patches: false,
            ..PolygonList::default()
        };
        let outputs = PictureOutputs {
            depth: true,
            ..PictureOutputs::default()
        };
        let style = PrimitiveStyle {
            cull_back_faces: true,
            ..PrimitiveStyle::default()
        };
        render_with_polygons(&self.view, &list, polygons, &style, outputs)
    }

    fn way(self: &Rc<Self>, name: &str, rules: &SplatRules) -> FailureWay {
        FailureWay {
            scene: self.clone(),
            name: name.into(),
            set: splats_of(&self.surface, &[], rules),
        }
    }

    /// The faces that these cones leave.
    fn faces_left(self: &Rc<Self>, name: &str, tree: &ConeTree<'_>) -> FailureWay {
        let mut is_left = vec![true; self.surface.faces.len()];
        for face in tree.culled(self.eye) {
            is_left[face as usize] = false;
        }
        let triangles = (self.surface.triangle_of_face.iter().zip(is_left))
            .filter(|(_, is_left)| *is_left)
            .map(|(&triangle, _)| triangle);
        FailureWay {
            scene: self.clone(),
            name: name.into(),
            set: SplatSet {
                triangles: triangles.collect(),
                ..SplatSet::default()
            },
        }
    }

    /// Splats of the points that a test leaves.
    fn points_left(
        self: &Rc<Self>,
        name: &str,
        rules: &SplatRules,
        is_culled: impl Fn(u32) -> bool,
    ) -> FailureWay {
        let all = splats_of(&self.surface, &[], rules);
        let left = (0..self.surface.points.len() as u32).filter(|&point| !is_culled(point));
        let splats = left.flat_map(|point| all.splats_of_point(point));
        FailureWay {
            scene: self.clone(),
            name: name.into(),
            set: SplatSet {
                splats: splats.copied().collect(),
                triangles: all.triangles.clone(),
                ..SplatSet::default()
            },
        }
    }
}

/// Colors bare pixels and those more than a pixel beyond the outline; returns how many of both there are.
fn mark(exact: &Image, picture: &mut Image, radius: f32) -> [u64; 2] {
    let (width, height) = (exact.width as usize, exact.height as usize);
    let is_near = |at: usize| {
        let (x, y) = (at % width, at / width);
        (y.saturating_sub(1)..(y + 2).min(height)).any(|y| {
            (x.saturating_sub(1)..(x + 2).min(width)).any(|x| exact.color[y * width + x][3] > 0)
        })
    };
    let bare: Vec<usize> = bare(exact, picture, radius).collect();
    let beyond: Vec<usize> = (0..width * height)
        .filter(|&at| picture.color[at][3] > 0 && !is_near(at))
        .collect();
    for &at in &bare {
        picture.color[at][..3].copy_from_slice(&BARE);
    }
    for &at in &beyond {
        for (level, blue) in picture.color[at].iter_mut().zip(BEYOND) {
            *level = level.midpoint(blue);
        }
    }
    [bare.len() as u64, beyond.len() as u64]
}

fn whole(radius: RadiusRule) -> SplatRules {
    SplatRules {
        radius,
        ..SplatRules::default()
    }
}

fn angle_test() -> SplatRules {
    SplatRules {
        angle_test: Some(20f64.to_radians()),
        ..whole(RadiusRule::Dietz)
    }
}

/// A grid of equilateral triangles.
fn equilateral() -> Mesh {
    let mut mesh = grid(12, |_, _| 0.0);
    let height = 3f32.sqrt() / 2.0;
    for p in &mut mesh.positions {
        *p = Vec3::new(p.x - 0.5 * p.y, p.y * height, 0.0);
    }
    mesh
}

fn holes_where_normals_are_off() -> WaysOfFailure {
    let eye = |surface: &WeldedSurface| {
        let center = surface.points.iter().sum::<DVec3>() / surface.points.len() as f64;
        center + DVec3::new(0.0, -1.0, 0.3).normalize() * 40.0
    };
    let scene = FailureScene::new(&equilateral(), 1.6, eye)?;
    let off = |name: &str, radius| {
        let mut way = scene.way(name, &whole(radius));
        for (k, splat) in way.set.splats.iter_mut().enumerate() {
            tilt(splat, k);
        }
        way
    };
    let looks: Vec<VertexLook> = (0..scene.vertices.len())
        .map(|k| VertexLook {
            normal: tilted(DVec3::Z, scene.surface.point_of_vertex[k] as usize),
            ..VertexLook::default()
        })
        .collect();
    let ours = FailureWay {
        scene: scene.clone(),
        name: format!("F2 cut, {OFF_DEGREES}\u{b0} off"),
        set: splats_of(&scene.surface, &looks, &SplatRules::usual()),
    };
    Ok([
        off(
            &format!("F2 0.5 d, {OFF_DEGREES}\u{b0} off"),
            RadiusRule::Dietz50,
        ),
        off(
            &format!("F2 0.65 d, {OFF_DEGREES}\u{b0} off"),
            RadiusRule::Dietz,
        ),
        ours,
    ])
}

fn holes_of_a_small_radius() -> WaysOfFailure {
    let eye = |surface: &WeldedSurface| {
        let center = surface.points.iter().sum::<DVec3>() / surface.points.len() as f64;
        center + DVec3::new(4.0, -12.0, 40.0)
    };
    let scene = FailureScene::new(&equilateral(), 1.2, eye)?;
    Ok([
        scene.way("F3 0.5 d", &whole(RadiusRule::Dietz50)),
        scene.way("F3 0.65 d", &whole(RadiusRule::Dietz)),
        scene.way("F3 covering, cut", &SplatRules::usual()),
    ])
}

fn sharp_edges() -> WaysOfFailure {
    let scene = FailureScene::new(&l_shape(), 1.0, |_| DVec3::new(5.0, 3.5, 3.0))?;
    Ok([
        scene.way("F6 whole, 0.65 d", &whole(RadiusRule::Dietz)),
        scene.way("F6 angle test 20\u{b0}", &angle_test()),
        scene.way("F6 cut", &SplatRules::usual()),
    ])
}

/// A strip of cells of a unit beside one triangle a hundred units long, folded by 15 degrees.
fn strip() -> Mesh {
    let cells = 100_u32;
    let row = |y: f32| (0..=cells).map(move |x| Vec3::new(x as f32, y, 0.0));
    let mut positions: Vec<Vec3> = row(0.0).chain(row(1.0)).collect();
    let (sine, cosine) = 15f32.to_radians().sin_cos();
    positions.push(Vec3::new(50.0, -30.0 * cosine, -30.0 * sine));
    let mut triangles: Vec<[u32; 3]> = (0..cells)
        .flat_map(|a| {
            let b = a + cells + 1;
            [[a, a + 1, b + 1], [a, b + 1, b]]
        })
        .collect();
    triangles.push([cells, 0, 2 * cells + 2]);
    Mesh {
        positions,
        triangles,
        ..Mesh::default()
    }
}

fn uneven_spacing() -> WaysOfFailure {
    let scene = FailureScene::new(&strip(), 1.2, |_| DVec3::new(80.0, -90.0, 130.0))?;
    Ok([
        scene.way("F7 whole, 0.65 d", &whole(RadiusRule::Dietz)),
        scene.way("F7 angle test 20\u{b0}", &angle_test()),
        scene.way("F7 cut", &SplatRules::usual()),
    ])
}

/// The inner side of a funnel of steep walls whose lower rim leans.
fn funnel() -> Mesh {
    let (sectors, steps, top) = (48_u32, 6_u32, 5.0_f32);
    let (sine, cosine) = 70f32.to_radians().sin_cos();
    let positions = (0..sectors * (steps + 1)).map(|k| {
        let turn = (k % sectors) as f32 / sectors as f32 * std::f32::consts::TAU;
        let least = 0.6 * (1.0 + turn.cos());
        let along = least + (top - least) * (k / sectors) as f32 / steps as f32;
        let radius = 1.0 + along * cosine;
        Vec3::new(radius * turn.cos(), radius * turn.sin(), along * sine)
    });
    let triangles = (0..sectors * steps).flat_map(|k| {
        let (a, b) = (k, k / sectors * sectors + (k + 1) % sectors);
        [[a, b + sectors, b], [a, a + sectors, b + sectors]]
    });
    Mesh {
        positions: positions.collect(),
        triangles: triangles.collect(),
        ..Mesh::default()
    }
}

/// The funnel from above, and from below, where the far wall is seen through its lower end: in cones of more than 45 degrees the
/// thesis moves points inward too far.
fn cones_of_faces() -> WaysOfFailure {
    let above = FailureScene::new(&funnel(), 1.1, |_| DVec3::new(3.0, -4.0, 14.0))?;
    let below = FailureScene::new(&funnel(), 2.2, |_| DVec3::new(-1.0, 0.1, -1.4))?;
    let tree = |rule| ConeTree::of_faces(&above.surface, rule);
    Ok([
        above.faces_left("F8 cones as printed", &tree(ConeRule::Printed)),
        below.faces_left("F8 turned round", &tree(ConeRule::Turned)),
        below.faces_left("F8 ours", &tree(ConeRule::Corrected)),
    ])
}

fn cones_of_vertices() -> WaysOfFailure {
    let scene = FailureScene::new(&cube(), 1.0, |_| DVec3::new(3.0, -2.9, -2.9))?;
    let surface = &scene.surface;
    let is_in = |culled: Vec<u32>| {
        move |point: u32| {
            let mut faces = surface.incident(point).iter();
            faces.all(|face| culled.contains(face))
        }
    };
    let of_vertex = |point: u32| {
        let cone = ConeTree::of_vertex(surface, point);
        !cone.culled(scene.eye).is_empty()
    };
    let by_faces = is_in(ConeTree::of_faces(surface, ConeRule::Corrected).culled(scene.eye));
    let dietz = whole(RadiusRule::Dietz);
    let cut = SplatRules::usual();
    Ok([
        scene.points_left("F9 vertex cones, whole", &dietz, of_vertex),
        scene.points_left("F9 vertex cones, cut", &cut, of_vertex),
        scene.points_left("F9 cones of faces, cut", &cut, by_faces),
    ])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::progress::SilentProgress;

    #[test]
    fn his_ways_fail_and_ours_do_not() {
        let (sheet, table) = failures(&SilentProgress).unwrap();
        assert!(sheet.width > 3 * SIZE.0 && sheet.height > 6 * SIZE.1);
        let is = |color: [u8; 3]| sheet.color.iter().filter(|c| c[..3] == color).count();
        let number = |row: &[String], column: usize| -> u64 {
            row[column].replace(',', "").parse().unwrap()
        };
        let mut bare = Vec::new();
        let mut beyond = Vec::new();
        for row in &table.rows {
            bare.push(number(row, 3));
            beyond.push(number(row, 4));
        }
        assert_eq!(is(BARE) as u64, bare.iter().sum::<u64>());
        for ours in [2, 5, 8, 11, 14, 17] {
            assert_eq!([bare[ours], beyond[ours]], [0, 0], "{:?}", table.rows[ours]);
        }
        // F2 and F3 of half the distance, F2 of 0.65; F8 both; F9 of cut splats.
        for (row, least) in [
            (0, 400),
            (1, 100),
            (3, 400),
            (12, 2000),
            (13, 2000),
            (16, 1000),
        ] {
            assert!(bare[row] > least, "{:?}", table.rows[row]);
        }
        assert_eq!(bare[4], 0, "0.65 is enough for a plane");
        // F6 whole, F7 whole and by the angle test, F9 whole.
        for row in [6, 9, 10, 15] {
            assert!(beyond[row] > 1000, "{:?}", table.rows[row]);
        }
    }
}
