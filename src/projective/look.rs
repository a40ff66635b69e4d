//! The photo look: the color of a place of the surface from the photographs that are chosen for a frame.
//!
//! O. Princ, *View-dependent texturing of meshes* (thesis), sections 2.3 and 3.4, with the errors of his equation 2.8 mended
//! (docs/METHODS.md); his own form as printed and as mended stay selectable. Ours, [`WeightForm::Quality`], weighs per pixel:
//! the angle between the ray of the view and that of the photograph (Buehler et al., *Unstructured Lumigraph Rendering*, 2001),
//! the angle to the surface, texels per pixel, the border, and what the photograph sees.
//!
//! Everything here is a function of plain values, so that a shader can do the same.

use crate::projective::depth_map::{DepthQuery, PhotoDepth, PhotoVisibility};
use crate::projective::projected::{PhotoPlace, ProjectedPhoto};
use crate::projective::pyramid::PhotoPyramid;
use glam::{Vec2, Vec3};

/// Formula of a photograph's weight at a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum WeightForm {
    /// Princ's equation 2.8 as it is printed: what faces away has weight too.
    Printed,
    /// The form that his listing means, each factor at least 0.
    Mended,
    /// Per pixel: rays, texels, borders.
    #[default]
    Quality,
}

/// Direction that Princ's forms take a photograph to look in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PhotoDirection {
    /// Its optical axis.
    Axis,
    /// Through the middle of the model in it.
    #[default]
    Hull,
    /// From its eye to the pixel's point.
    Ray,
}

/// Settings of the look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookSettings {
    /// Formula of the weights.
    pub form: WeightForm,
    /// Direction of a photograph, for Princ's forms.
    pub direction: PhotoDirection,
    /// Test of visibility.
    pub visibility: PhotoVisibility,
    /// Cosine of the largest angle between normal and photograph at which it has weight.
    pub limit_cos: f32,
    /// Photographs that are blended at most, 1 to 3.
    pub blend: u32,
    /// Difference of colors (of 1) up to which photographs agree; at twice that they do not.
    pub tolerance: f32,
    /// Photographs that disagree with the others of the best few lose weight.
    pub consensus: bool,
    /// Width of the border in which weights fade, of the photograph's shorter side.
    pub border: f32,
    /// Bring exposures together.
    pub gains: bool,
}

impl Default for LookSettings {
    fn default() -> Self {
        Self {
            form: WeightForm::Quality,
            direction: PhotoDirection::Ray,
            visibility: PhotoVisibility::DepthSoft,
            limit_cos: 0.1,
            blend: 3,
            tolerance: 0.06,
            consensus: true,
            border: 0.03,
            gains: true,
        }
    }
}

/// A pixel's place on the surface, in model space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePixel {
    /// The point.
    pub position: Vec3,
    /// Unit normal, on the side that is seen; zero where the surface has none.
    pub normal: Vec3,
    /// Steps on the surface to the next pixel to the right and below.
    pub steps: [Vec3; 2],
}

/// Where a frame is seen from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookView {
    /// The eye, model space.
    pub eye: Vec3,
    /// Direction that photographs are chosen for.
    pub direction: Vec3,
    /// Unit direction of all rays of a parallel view; `None` of a perspective, whose rays start in the eye.
    pub parallel: Option<Vec3>,
}

/// A chosen photograph with what it holds.
#[derive(Debug, Clone, Copy)]
pub struct LookPhoto<'a> {
    /// Camera and place in the choice.
    pub photo: &'a ProjectedPhoto,
    /// Its pixels.
    pub pixels: &'a PhotoPyramid,
    /// Its depth map.
    pub depth: &'a PhotoDepth,
    /// Its mask, where it has one: what is dark is not used.
    pub mask: Option<&'a PhotoPyramid>,
}

/// Color of a pixel and where it comes from.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LookPixel {
    /// Red, green, blue, 0..=1.
    pub color: [f32; 3],
    /// Weight of the best photograph; 0 where none has any: the pixel is uncovered.
    pub weight: f32,
    /// Place of the best photograph in the list.
    pub best: u32,
}

/// A photograph's weight at a pixel, and where the pixel is in it.
#[derive(Debug, Clone, Copy, Default)]
struct PixelCandidate {
    weight: f32,
    list_index: u32,
    pixel: Vec2,
    level: f32,
}

/// Candidates that compete at a pixel.
const CANDIDATES: usize = 6;

/// Candidates of less than this part of the best one's weight do not count: they would change no color by a level.
const LEAST_SHARE: f32 = 1.0 / 64.0;

/// Half the square of the angle between rays (0.8 degrees) that counts as next to none: a photograph that looks along the very
/// ray of the view outweighs all others, so that a photograph's own pose gives the photograph.
const SAME_RAY: f32 = 1e-4;

/// Smoothstep from 0 at `from` to 1 at `to`.
fn smooth(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Princ's weight (equation 2.8, printed or mended) of a photograph that looks along `d`.
pub fn princ_weight(
    form: WeightForm,
    photo: &ProjectedPhoto,
    d: Vec3,
    normal: Vec3,
    view: Vec3,
    limit_cos: f32,
) -> f32 {
    let towards_view = view.dot(d);
    let facing = -normal.dot(d);
    match form {
        WeightForm::Printed => {
            towards_view * ((1.0 + facing) / (1.0 - limit_cos) + 1.0) * photo.area
        }
        _ => {
            let part = (facing - limit_cos) / (1.0 - limit_cos);
            towards_view.max(0.0) * part.max(0.0) * photo.area
        }
    }
}

/// Weight of a photograph at a pixel; `None` where it does not show the point.
fn candidate(
    pixel: &SurfacePixel,
    view: &LookView,
    of: &LookPhoto<'_>,
    settings: &LookSettings,
) -> Option<PixelCandidate> {
    let photo = of.photo;
    let place = photo.place(pixel.position)?;
    let ray = photo.ray_to(pixel.position);
    let facing = -pixel.normal.dot(ray);
    let [across, down] = texel_steps(pixel, photo, place);
    let longest = across.max(down);
    let mut weight = match settings.form {
        WeightForm::Printed | WeightForm::Mended => {
            let d = match settings.direction {
                PhotoDirection::Axis => photo.rotation.transpose() * Vec3::Z,
                PhotoDirection::Hull => photo.direction,
                PhotoDirection::Ray => ray,
            };
            princ_weight(
                settings.form,
                photo,
                d,
                pixel.normal,
                view.direction,
                settings.limit_cos,
            )
        }
        WeightForm::Quality => {
            let to_pixel = || (pixel.position - view.eye).normalize_or_zero();
            let view_ray = view.parallel.unwrap_or_else(to_pixel);
            // 1 - cos of the angle between the rays, half the square of the angle.
            let apart = 1.0 - view_ray.dot(ray);
            let same = SAME_RAY / (SAME_RAY + apart.max(0.0));
            let has_normal = pixel.normal != Vec3::ZERO;
            let faces = if has_normal {
                smooth(settings.limit_cos, 0.6, facing)
            } else {
                1.0
            };
            // Fewer than one texel a pixel is blur, more is no gain.
            let texels = across.min(down).clamp(0.05, 1.0);
            same * faces * texels * border_weight(photo, place, settings.border)
        }
    };
    if weight > 0.0 && settings.visibility != PhotoVisibility::Off {
        let slope = (1.0 - facing * facing).max(0.0).sqrt() / facing.abs().max(0.05);
        let p = photo.rotation * (pixel.position - photo.center);
        let query = DepthQuery {
            ray: p.truncate() / p.z,
            depth: p.z,
            slope,
        };
        weight *= of.depth.visibility(query, settings.visibility);
    }
    if let Some(mask) = of.mask.filter(|_| weight > 0.0) {
        weight *= mask.sample((place.pixel / photo.size).to_array(), 0.0)[1];
    }
    (weight > 0.0).then_some(PixelCandidate {
        weight,
        list_index: 0,
        pixel: place.pixel,
        level: longest.max(1e-6).log2(),
    })
}

/// Weight of a photograph at a pixel; 0 where it does not show the point.
pub fn photo_weight(
    pixel: &SurfacePixel,
    view: &LookView,
    of: &LookPhoto<'_>,
    settings: &LookSettings,
) -> f32 {
    candidate(pixel, view, of, settings).map_or(0.0, |found| found.weight)
}

/// Texels that a step of a pixel takes in a photograph, to the right and down.
fn texel_steps(pixel: &SurfacePixel, photo: &ProjectedPhoto, place: PhotoPlace) -> [f32; 2] {
    pixel.steps.map(|step| {
        let next = photo.place_anywhere(pixel.position + step);
        next.map_or(1.0, |next| next.pixel.distance(place.pixel))
    })
}

/// 1 inside of a photograph, falling to little at its border.
fn border_weight(photo: &ProjectedPhoto, place: PhotoPlace, part: f32) -> f32 {
    let from_border = place.pixel.min(photo.size - place.pixel).min_element();
    let width = part * photo.size.min_element();
    if width > 0.0 {
        (from_border / width).clamp(0.02, 1.0)
    } else {
        1.0
    }
}

/// Color of a candidate, `coarser` levels above the one that fits.
fn color_of(candidate: &PixelCandidate, of: &LookPhoto<'_>, coarser: f32, gains: bool) -> Vec3 {
    let photo = of.photo;
    // Levels are counted from the largest that is held.
    let held = (of.pixels.size()[0] as f32 / photo.size.x.max(1.0))
        .max(1e-6)
        .log2();
    let level = (candidate.level + held - SHARPER).max(0.0) + coarser;
    // What is only compared is taken of one level.
    let level = if coarser > 0.0 {
        (level + 0.5).floor()
    } else {
        level
    };
    let color = Vec3::from(
        of.pixels
            .sample((candidate.pixel / photo.size).to_array(), level),
    );
    if gains { color * photo.gain } else { color }
}

/// The color of a pixel from the chosen photographs. Those of stage 1 are asked only where those of stage 0 have no weight.
/// Ties go to the first of the list. Without any weight the color is black and the weight 0.
pub fn look_at_pixel(
    pixel: &SurfacePixel,
    view: &LookView,
    photos: &[LookPhoto<'_>],
    settings: &LookSettings,
) -> LookPixel {
    for stage in 0..=1 {
        let mut best = [PixelCandidate::default(); CANDIDATES];
        let mut count = 0;
        for (index, of) in (0..).zip(photos) {
            if of.photo.stage != stage {
                continue;
            }
            let Some(mut found) = candidate(pixel, view, of, settings) else {
                continue;
            };
            found.list_index = index;
            // Insertion into the few best, an earlier one first where they tie.
            let mut at = count;
            while at > 0 && best[at - 1].weight < found.weight {
                at -= 1;
            }
            if at < CANDIDATES {
                count = (count + 1).min(CANDIDATES);
                best[at..count].rotate_right(1);
                best[at] = found;
            }
        }
        let least = LEAST_SHARE * best[0].weight;
        count = (best[..count].iter())
            .take_while(|own| own.weight >= least)
            .count();
        if count > 0 {
            return mixed(&mut best[..count], photos, settings);
        }
    }
    LookPixel::default()
}

/// The color of the best of some candidates, or of those that agree with it.
fn mixed(
    best: &mut [PixelCandidate],
    photos: &[LookPhoto<'_>],
    settings: &LookSettings,
) -> LookPixel {
    let of = |candidate: &PixelCandidate| &photos[candidate.list_index as usize];
    if settings.consensus && best.len() > 2 {
        agree(best, photos, settings);
    }
    let first = best[0];
    let chosen = color_of(&first, of(&first), 0.0, settings.gains);
    let (mut sum, mut weights) = (chosen * first.weight, first.weight);
    for other in best
        .iter()
        .skip(1)
        .take(settings.blend.saturating_sub(1) as usize)
    {
        let color = color_of(other, of(other), 0.0, settings.gains);
        let apart = (color - chosen).abs().max_element();
        let weight =
            other.weight * (1.0 - smooth(settings.tolerance, 2.0 * settings.tolerance, apart));
        sum += color * weight;
        weights += weight;
    }
    LookPixel {
        color: (sum / weights.max(1e-20))
            .clamp(Vec3::ZERO, Vec3::ONE)
            .to_array(),
        weight: first.weight,
        best: first.list_index,
    }
}

/// Levels below the one whose texels are as large as pixels: a pyramid of boxes, blended between its levels, blurs.
const SHARPER: f32 = 0.5;

/// Levels above the one that fits at which photographs are compared: what is there, not how sharp it is.
const COARSER: f32 = 2.0;

/// Multiplies each weight by the share of the others that show the same, and sorts again.
fn agree(best: &mut [PixelCandidate], photos: &[LookPhoto<'_>], settings: &LookSettings) {
    let mut colors = [Vec3::ZERO; CANDIDATES];
    for (color, candidate) in colors.iter_mut().zip(best.iter()) {
        *color = color_of(
            candidate,
            &photos[candidate.list_index as usize],
            COARSER,
            settings.gains,
        );
    }
    let mut weights = [0.0; CANDIDATES];
    for i in 0..best.len() {
        let (mut same, mut all) = (0.0, 0.0);
        for j in 0..best.len() {
            let apart = (colors[i] - colors[j]).abs().max_element();
            same += best[j].weight
                * (1.0 - smooth(settings.tolerance, 2.5 * settings.tolerance, apart));
            all += best[j].weight;
        }
        weights[i] = best[i].weight * same / all;
    }
    for (candidate, weight) in best.iter_mut().zip(weights) {
        candidate.weight = weight;
    }
    // Few values; stable, so that ties keep their order.
    best.sort_by(|a, b| b.weight.total_cmp(&a.weight));
}

#[cfg(test)]
#[path = "look/tests.rs"]
mod tests;
