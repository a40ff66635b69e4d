//! Photographs on the surface of a picture of the reference, pixel by pixel: the mirror of `shaders/look/photos.frag`.

use crate::gpu::Error;
use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::projective::frame_photos::{FramePhotos, UNCOVERED, photo_tint};
use crate::projective::look::look_at_pixel;
use crate::projective::surface_rays::SurfaceRays;
use crate::render::{PhotoDisplay, Settings};
use glam::Vec3;
use rayon::prelude::*;

/// The photographs of a frame whose settings show some.
///
/// # Errors
/// [`Error::Unsupported`] where none are given.
pub(crate) fn given<T>(photos: Option<T>) -> Result<T, Error> {
    photos.ok_or_else(|| Error::Unsupported {
        what: "photographs",
        why: "none are given; name a scene of photographs with --photos".into(),
    })
}

/// Colors a picture that has depth (and normals, else those of depths count) by photographs.
pub(crate) fn color_picture(
    image: &mut Image,
    view: &View,
    photos: &FramePhotos,
    settings: &Settings,
) {
    let rays = SurfaceRays::of(view);
    let looks = photos.look();
    let look_view = rays.look_view(photos.direction);
    let width = image.width;
    let (depth, normals, values) = (&image.depth, &image.normal, &image.values);
    let color_at = |index: usize| -> Option<[f32; 4]> {
        let [column, row] = [index as u32 % width, index as u32 / width];
        let own = match values.get(index) {
            Some(value) => *value,
            None => image.color[index].map(|v| f32::from(v) / 255.0),
        };
        let at = [column as f32 + 0.5, row as f32 + 0.5];
        if let Some([r, g, b]) = photos.compared_color(&rays, at, width) {
            return Some([r, g, b, 1.0]);
        }
        let distance = depth[index];
        if !distance.is_finite() || own[3] <= 0.0 {
            return None;
        }
        let normal = match normals.get(index) {
            Some(normal) => Vec3::from(*normal),
            None => {
                let last = (width - 1, image.height - 1);
                let of = |is_there: bool, index: usize| match is_there {
                    true => depth[index],
                    false => f32::INFINITY,
                };
                let around = [
                    of(column > 0, index.wrapping_sub(1)),
                    of(column < last.0, index + 1),
                    of(row > 0, index.wrapping_sub(width as usize)),
                    of(row < last.1, index + width as usize),
                ];
                rays.normal_of_depths([column, row], distance, around)
            }
        };
        let pixel = rays.pixel([column, row], distance, normal);
        let found = look_at_pixel(&pixel, &look_view, &looks, &photos.settings);
        let color = match (found.weight > 0.0, settings.photos) {
            (true, PhotoDisplay::Source) => photo_tint(looks[found.best as usize].photo.index),
            (true, _) => found.color,
            (false, _) if settings.marks_uncovered => UNCOVERED,
            (false, _) => return None,
        };
        // The background shows through what a pixel is not covered by.
        let [r, g, b] =
            [0, 1, 2].map(|c| settings.background[c] * (1.0 - own[3]) + color[c] * own[3]);
        Some([r, g, b, own[3]])
    };
    let colors: Vec<Option<[f32; 4]>> = (0..image.color.len())
        .into_par_iter()
        .map(color_at)
        .collect();
    for (index, found) in colors.into_iter().enumerate() {
        let Some(found) = found else { continue };
        image.color[index] = found.map(|v| unorm8(f64::from(v)));
        if let Some(value) = image.values.get_mut(index) {
            *value = found;
        }
    }
}
