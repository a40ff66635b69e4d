//! Photographs on the surface that the processor's renderer drew: the mirror of `shaders/look/photos.frag`.

use crate::math::camera::View;
use crate::pack::parallel;
use crate::projective::frame_photos::{FramePhotos, UNCOVERED, photo_tint};
use crate::projective::look::{LookPhoto, LookPixel};
use crate::projective::surface_rays::SurfaceRays;
use crate::projective::wide_look::{SurfaceRow, WideLook};
use crate::render::cpu::float_planes::word_of;
use crate::render::cpu::opaque::SurfacePlanes;
use crate::render::cpu::picture::PixelWords;
use crate::render::frame_plan::FramePlan;
use crate::render::{PhotoDisplay, Settings};
use glam::Vec4;

/// Rows that one thread takes at a time.
const ROWS: usize = 8;

/// The rectangle of a picture that something may be drawn in.
pub(super) struct PhotographedPicture<'a> {
    /// Words from the first pixel of the rectangle on.
    pub(super) colors: &'a mut [u32],
    /// From a row of colors to the next, pixels.
    pub(super) pitch: usize,
    /// Reversed depths, row by row; 0 where nothing is.
    pub(super) depths: &'a [f32],
    /// Normals where splats have any, and colors as floats where those are asked for; else empty.
    pub(super) planes: SurfacePlanes<'a>,
}

/// Look over a rectangle, with all that it needs to know.
struct RectangleLook<'a> {
    wide: WideLook<'a>,
    rays: &'a SurfaceRays,
    view: &'a View,
    photos: &'a [LookPhoto<'a>],
    settings: &'a Settings,
    background: [f32; 3],
    /// Left, top, and one past right and bottom, pixels.
    rect_px: [u32; 4],
    depths: &'a [f32],
    normals: &'a [[f32; 3]],
}

/// Colors a drawn rectangle by photographs, where these show what is there.
pub(super) fn color_rectangle(
    photos: &FramePhotos,
    plan: &FramePlan,
    picture: PhotographedPicture<'_>,
) {
    let PhotographedPicture {
        colors,
        pitch,
        depths,
        planes,
    } = picture;
    let rect_px = plan.context.rect_px;
    let [left, top, right, bottom] = rect_px.map(|edge| edge as usize);
    if left >= right || top >= bottom {
        return;
    }
    let (width, height) = (right - left, bottom - top);
    let (rays, looks) = (SurfaceRays::of(&plan.view), photos.look());
    let look = RectangleLook {
        wide: WideLook::new(&rays, photos.direction, &looks, &photos.settings),
        rays: &rays,
        view: &plan.view,
        photos: &looks,
        settings: &plan.settings,
        background: plan.context.background,
        rect_px,
        depths,
        normals: planes.normals,
    };
    let end = (height - 1) * pitch + width;
    let mut values = planes.values.chunks_mut(ROWS * width);
    let bands: Vec<(&mut [u32], &mut [[f32; 4]])> = (colors[..end].chunks_mut(ROWS * pitch))
        .map(|colors| (colors, values.next().unwrap_or_default()))
        .collect();
    // A pixel takes as long as many records.
    let work = 64 * width * height;
    parallel::share(
        work,
        bands.into_iter().enumerate(),
        |(band, (colors, values))| {
            let mut values = values.chunks_mut(width);
            for (row, colors) in colors.chunks_mut(pitch).enumerate() {
                let values = values.next().unwrap_or_default();
                look.color_row(band * ROWS + row, &mut colors[..width], values);
            }
        },
    );
}

impl RectangleLook<'_> {
    /// Colors a row, counted from the first of the rectangle.
    fn color_row(&self, row: usize, colors: &mut [u32], values: &mut [[f32; 4]]) {
        let width = colors.len();
        let first = [self.rect_px[0], self.rect_px[1] + row as u32];
        let depths = &self.depths[row * width..][..width];
        let distances: Vec<f32> = (depths.iter().zip(&*colors))
            .map(|(depth, color)| match color >> 24 {
                0 => f32::INFINITY,
                _ => self.view.distance_of_depth(*depth),
            })
            .collect();
        let of_depths: Vec<[f32; 3]>;
        let normals = match self.normals.is_empty() {
            false => &self.normals[row * width..][..width],
            true => {
                of_depths = self.normals_of_depths(row, &distances);
                &of_depths
            }
        };
        let mut found = vec![LookPixel::default(); width];
        let surface = SurfaceRow {
            first,
            distances: &distances,
            normals,
        };
        self.wide.row(surface, &mut found);
        for (x, (word, found)) in colors.iter_mut().zip(&found).enumerate() {
            let color = match (found.weight > 0.0, self.settings.photos) {
                (true, PhotoDisplay::Source) => {
                    photo_tint(self.photos[found.best as usize].photo.index)
                }
                (true, _) => found.color,
                (false, _) if self.settings.marks_uncovered && distances[x].is_finite() => {
                    UNCOVERED
                }
                (false, _) => continue,
            };
            let alpha = values
                .get(x)
                .map_or((*word >> 24) as f32 / 255.0, |own| own[3]);
            // The background shows through what a pixel is not covered by.
            let [r, g, b] =
                [0, 1, 2].map(|c| self.background[c] * (1.0 - alpha) + color[c] * alpha);
            *word = word_of(Vec4::new(r, g, b, alpha));
            if let Some(value) = values.get_mut(x) {
                *value = [r, g, b, alpha];
            }
        }
    }

    /// Normals of a row by the depths around.
    fn normals_of_depths(&self, row: usize, distances: &[f32]) -> Vec<[f32; 3]> {
        let width = distances.len();
        let [left, top, ..] = self.rect_px;
        let distance_at = |x: Option<usize>, y: Option<usize>| -> f32 {
            let at = x.zip(y).filter(|(x, _)| *x < width);
            let depth = at.and_then(|(x, y)| self.depths.get(y * width + x));
            depth.map_or(f32::INFINITY, |depth| self.view.distance_of_depth(*depth))
        };
        let normal = |(x, distance): (usize, &f32)| match distance.is_finite() {
            false => [0.0; 3],
            true => {
                let around = [
                    distance_at(x.checked_sub(1), Some(row)),
                    distance_at(Some(x + 1), Some(row)),
                    distance_at(Some(x), row.checked_sub(1)),
                    distance_at(Some(x), Some(row + 1)),
                ];
                let pixel = [left + x as u32, top + row as u32];
                self.rays.normal_of_depths(pixel, *distance, around).into()
            }
        };
        distances.iter().enumerate().map(normal).collect()
    }
}

/// Lays the photograph that is compared over its part of a whole picture; tells whether there is one.
pub(super) fn lay_over(
    photos: &FramePhotos,
    view: &View,
    [width, height]: [u32; 2],
    pixels: &mut PixelWords<'_>,
) -> bool {
    if photos.compared_at(0.5, width).is_none() {
        return false;
    }
    let rays = SurfaceRays::of(view);
    for (row, words) in (0..height).zip(pixels.words.chunks_mut(pixels.pitch.max(1))) {
        for (column, word) in (0..width).zip(words) {
            let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
            if let Some([r, g, b]) = photos.compared_color(&rays, [x, y], width) {
                *word = word_of(Vec4::new(r, g, b, 1.0));
            }
        }
    }
    true
}
