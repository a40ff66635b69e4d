//! Poses of the photographs of the window: drawn in the picture, chosen by a click, and shown on a map from above.

use super::ViewerApp;
use crate::photos::scene::PhotoScene;
use crate::projective::frame_photos::photo_tint;
use crate::viewer::panel::PhotographWish;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};

/// Part of the scene's size that a pose reaches.
const POSE_PART: f32 = 0.12;

/// Farthest that a click on a pose may be from its lines, pixels.
const CLICK_PX: f32 = 6.0;

/// Side of the map, points.
const MAP_SIDE: f32 = 180.0;

/// Dots on the map that stand for the surface.
const MAP_DOTS: usize = 500;

/// The pose of a photograph in the picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PoseMark {
    /// Index of the photograph in its scene.
    photo: usize,
    /// Edges of what it sees, pixels.
    lines: Vec<[[f32; 2]; 2]>,
    /// Place of the camera on the picture, pixels; `None` behind the eye.
    eye: Option<[f32; 2]>,
    /// The picture uses it.
    is_used: bool,
}

/// A place and a direction on the map; x to the right and y down, -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MapArrow {
    at: Vec2,
    towards: Vec2,
}

/// Photographs, camera and surface from above.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PoseMap {
    /// The photographs by their index; whether the picture uses them.
    photos: Vec<(usize, MapArrow, bool)>,
    /// The camera; beyond the border it is drawn at it.
    camera: Option<MapArrow>,
    surface: Vec<Vec2>,
}

/// Directions of a map in the world: to the right and upwards on it. What is up is where the tops of photographs mostly are;
/// upwards on the map is where they mostly look.
fn map_axes(rotations: impl Iterator<Item = DMat3> + Clone) -> [DVec3; 2] {
    let row = |index: usize| rotations.clone().map(move |own| own.transpose().col(index));
    let up = (-row(1).sum::<DVec3>()).try_normalize().unwrap_or(DVec3::Y);
    let ahead = row(2).sum::<DVec3>().reject_from_normalized(up);
    let ahead = (ahead.try_normalize()).unwrap_or_else(|| up.any_orthonormal_vector());
    [ahead.cross(up), ahead]
}

/// The map of a scene: photographs that `is_used` says are in the picture, the place and direction of the camera, and places
/// of the surface. Everything but the camera lies within -0.9 to 0.9.
fn pose_map(
    scene: &PhotoScene,
    is_used: &dyn Fn(usize) -> bool,
    (eye, forward): (DVec3, DVec3),
    surface: &[DVec3],
) -> PoseMap {
    let cameras = scene.photos.iter().map(|photo| &photo.camera);
    let [right, ahead] = map_axes(cameras.clone().map(|camera| camera.rotation));
    let flat = |v: DVec3| DVec2::new(v.dot(right), -v.dot(ahead));
    let places = cameras
        .clone()
        .map(|own| own.center)
        .chain(surface.iter().copied());
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for place in places.map(flat) {
        (low, high) = (low.min(place), high.max(place));
    }
    let middle = (low + high) / 2.0;
    let half = (0.5 * (high - low).max_element()).max(1e-12) / 0.9;
    let place = |v: DVec3| ((flat(v) - middle) / half).as_vec2();
    let arrow = |at: DVec3, towards: DVec3| MapArrow {
        at: place(at),
        towards: flat(towards).as_vec2().normalize_or_zero(),
    };
    let photos = cameras
        .enumerate()
        .map(|(index, own)| (index, arrow(own.center, own.axis()), is_used(index)));
    let border = Vec2::splat(0.97);
    let camera = Some(arrow(eye, forward)).filter(|own| own.at.is_finite());
    let camera = camera.map(|own| MapArrow {
        at: own.at.clamp(-border, border),
        ..own
    });
    PoseMap {
        photos: photos.collect(),
        camera,
        surface: surface.iter().map(|at| place(*at)).collect(),
    }
}

impl PoseMark {
    /// Distance of a place in the picture from the lines, pixels.
    fn distance(&self, at: Vec2) -> f32 {
        let to_line = |[a, b]: &[[f32; 2]; 2]| {
            let (a, b) = (Vec2::from(*a), Vec2::from(*b));
            let along = (at - a).dot(b - a) / (b - a).length_squared().max(1e-12);
            at.distance(a.lerp(b, along.clamp(0.0, 1.0)))
        };
        self.lines.iter().map(to_line).fold(f32::INFINITY, f32::min)
    }
}

impl ViewerApp {
    /// Tells whether the picture uses a photograph.
    fn uses_photograph(&self, index: usize) -> bool {
        let mut all = self
            .photographs
            .frame
            .iter()
            .flat_map(|frame| &frame.photos);
        self.settings.shows_photos() && all.any(|own| own.photo.index as usize == index)
    }

    /// Poses of all photographs in the picture but that of the camera.
    pub(super) fn poses(&self) -> Vec<PoseMark> {
        let own = &self.photographs;
        let (Some(scene), Some(view), true) = (&own.scene, self.view_of_picture(), own.has_frusta)
        else {
            return Vec::new();
        };
        let Some(model) = self.screen.model() else {
            return Vec::new();
        };
        let reach = f64::from(POSE_PART * model.orbit_radius);
        let is_here = |index: usize| own.pose.as_ref().is_some_and(|(pose, _)| *pose == index);
        let there = (scene.photos.iter().enumerate()).filter(|(index, _)| !is_here(*index));
        there
            .map(|(index, photo)| {
                let camera = photo.camera.pinhole();
                let [w, h] = [camera.width.max(1), camera.height.max(1)].map(f64::from);
                let at = |x: f64, y: f64| {
                    let ray = DVec3::new(
                        (x - camera.principal[0]) / camera.focal[0],
                        (y - camera.principal[1]) / camera.focal[1],
                        1.0,
                    );
                    let world = camera.center + camera.rotation.transpose() * ray * reach;
                    (world - model.origin).as_vec3()
                };
                let eye = (camera.center - model.origin).as_vec3();
                let corners = [at(0.0, 0.0), at(w, 0.0), at(w, h), at(0.0, h)];
                let edges =
                    (0..4).flat_map(|i| [[eye, corners[i]], [corners[i], corners[(i + 1) % 4]]]);
                PoseMark {
                    photo: index,
                    lines: edges.filter_map(|edge| view.visible_line(edge)).collect(),
                    eye: view.visible_line([eye, eye]).map(|[eye, _]| eye),
                    is_used: self.uses_photograph(index),
                }
            })
            .collect()
    }

    /// Looks from the pose that was clicked on, where one was.
    pub(super) fn click_pose(&mut self, at: DVec2) {
        let poses = self.poses();
        let near = poses
            .iter()
            .map(|own| (own.distance(at.as_vec2()), own.photo));
        let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, photo)) = nearest.filter(|(distance, _)| *distance <= CLICK_PX) {
            self.photograph_wish(PhotographWish::FlyTo(photo));
        }
    }

    /// The map of photographs, where it is shown.
    pub(super) fn pose_map(&self) -> Option<PoseMap> {
        let own = &self.photographs;
        let (scene, stage) = (own.scene.as_ref()?, own.stage.as_ref()?);
        let view = self.view_of_picture().filter(|_| own.has_radar)?;
        let origin = self.screen.model()?.origin;
        let world = |v: Vec3| origin + v.as_dvec3();
        let samples = stage.samples();
        let step = samples.len().div_ceil(MAP_DOTS).max(1);
        let surface: Vec<DVec3> = (samples.iter().step_by(step))
            .map(|own| world(own.position))
            .collect();
        let seen_from = (world(view.eye), -view.backward.as_dvec3());
        Some(pose_map(
            scene,
            &|index| self.uses_photograph(index),
            seen_from,
            &surface,
        ))
    }
}

fn tint(photo: usize) -> egui::Color32 {
    let [r, g, b] = photo_tint(photo as u32).map(|v| (v * 255.0) as u8);
    egui::Color32::from_rgb(r, g, b)
}

/// Paints poses over the picture, which begins `inset` pixels from the left, in the colors that stand for the photographs.
pub(super) fn paint_poses(
    context: &egui::Context,
    poses: &[PoseMark],
    inset: f32,
    size: egui::Vec2,
) {
    let scale = context.pixels_per_point();
    let left = inset / scale;
    let area = egui::Rect::from_min_max(egui::pos2(left, 0.0), egui::pos2(size.x, size.y));
    let painter = (context.layer_painter(egui::LayerId::background())).with_clip_rect(area);
    let place = |[x, y]: [f32; 2]| egui::pos2(left + x / scale, y / scale);
    for pose in poses {
        let color = tint(pose.photo);
        let width = if pose.is_used { 2.5 } else { 1.2 };
        for line in &pose.lines {
            painter.line_segment(line.map(place), egui::Stroke::new(width, color));
        }
        if let Some(eye) = pose.eye {
            painter.circle_filled(place(eye), 4.0, color);
        }
    }
}

/// Paints the map in the upper right corner of the picture, since messages have the lower left one. The picture begins `inset`
/// pixels from the left.
pub(super) fn paint_map(context: &egui::Context, map: &PoseMap, inset: f32, size: egui::Vec2) {
    let left = inset / context.pixels_per_point();
    let side = MAP_SIDE.min(size.x - left - 24.0).min(size.y - 24.0);
    if side < 60.0 {
        return;
    }
    let corner = egui::pos2(size.x - 12.0 - side, 12.0);
    let area = egui::Rect::from_min_size(corner, egui::Vec2::splat(side));
    let painter = (context.layer_painter(egui::LayerId::background())).with_clip_rect(area);
    painter.rect_filled(
        area,
        6.0,
        egui::Color32::from_rgba_unmultiplied(12, 14, 18, 215),
    );
    let place = |at: Vec2| area.center() + egui::vec2(at.x, at.y) * (side / 2.0);
    for at in &map.surface {
        painter.circle_filled(place(*at), 0.9, egui::Color32::from_gray(110));
    }
    let arrow = |own: &MapArrow, length: f32, radius: f32, color: egui::Color32| {
        let tip = own.at + own.towards * length;
        painter.line_segment([place(own.at), place(tip)], egui::Stroke::new(1.5, color));
        painter.circle_filled(place(own.at), radius, color);
    };
    for (photo, own, is_used) in &map.photos {
        let color = if *is_used {
            tint(*photo)
        } else {
            egui::Color32::from_gray(150)
        };
        arrow(own, 0.16, if *is_used { 4.5 } else { 2.5 }, color);
    }
    if let Some(camera) = &map.camera {
        arrow(camera, 0.3, 5.5, egui::Color32::WHITE);
        painter.circle_filled(place(camera.at), 2.5, egui::Color32::BLACK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photos::scene::{CalibratedCamera, SceneFormat, ScenePhoto};
    use crate::projective::lens::CameraLens;

    /// Two cameras that look along -z with y up, one beside the other.
    fn scene() -> PhotoScene {
        let photo = |x: f64| ScenePhoto {
            name: String::new(),
            file: None,
            mask: None,
            camera: CalibratedCamera {
                width: 100,
                height: 100,
                focal: [100.0; 2],
                principal: [50.0; 2],
                lens: CameraLens::default(),
                rotation: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
                center: DVec3::new(x, 7.0, 0.0),
            },
        };
        PhotoScene {
            format: SceneFormat::Bundler,
            path: Default::default(),
            photos: vec![photo(-1.0), photo(1.0)],
            points: Vec::new(),
            remarks: Vec::new(),
        }
    }

    #[test]
    fn a_map_has_what_is_ahead_above_and_what_is_right_at_the_right() {
        let camera = (DVec3::new(0.0, 2.0, 0.0), DVec3::new(1.0, 0.0, 0.0));
        let map = pose_map(
            &scene(),
            &|index| index == 1,
            camera,
            &[DVec3::new(0.0, 0.0, -1.0)],
        );
        let [(_, first, is_first_used), (_, second, is_second_used)] = map.photos[..] else {
            panic!("two photographs: {map:?}");
        };
        assert!(!is_first_used && is_second_used);
        assert!(
            (first.at - Vec2::new(-0.9, 0.45)).length() < 1e-5,
            "{map:?}"
        );
        assert!(
            (second.at - Vec2::new(0.9, 0.45)).length() < 1e-5,
            "{map:?}"
        );
        // They look upwards on it, towards the surface, and the camera to the right.
        assert!((first.towards - Vec2::NEG_Y).length() < 1e-5);
        assert!(
            (map.surface[0] - Vec2::new(0.0, -0.45)).length() < 1e-5,
            "{map:?}"
        );
        let found = map.camera.map(|own| own.towards);
        assert!(found.is_some_and(|own| (own - Vec2::X).length() < 1e-5));
        // One far off is at the border, one nowhere is not there.
        let far = pose_map(&scene(), &|_| false, (DVec3::X * 1e9, DVec3::Z), &[]);
        assert_eq!(far.camera.map(|own| own.at.x), Some(0.97));
        let nowhere = pose_map(&scene(), &|_| false, (DVec3::NAN, DVec3::Z), &[]);
        assert_eq!(nowhere.camera, None);
    }

    #[test]
    fn a_click_is_as_far_as_the_nearest_line() {
        let pose = PoseMark {
            photo: 0,
            lines: vec![[[0.0, 0.0], [10.0, 0.0]], [[50.0, 0.0], [50.0, 0.0]]],
            eye: None,
            is_used: false,
        };
        for (at, wanted) in [([5.0, 3.0], 3.0), ([-4.0, 0.0], 4.0), ([50.0, 2.0], 2.0)] {
            assert!(
                (pose.distance(Vec2::from(at)) - wanted).abs() < 1e-5,
                "{at:?}"
            );
        }
    }
}
