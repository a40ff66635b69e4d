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
    /// Weight that is the same from everywhere, as a baked texture has it: texels on the surface, borders.
    Baked,
}

/// Direction that Princ's forms take a photograph to look in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PhotoDirection {
    /// The camera's optical axis.
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
    /// Difference of colors (of 1) up to which photographs agree; at two and a half times that they do not.
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

impl LookView {
    /// Unit direction in which a point is seen.
    pub(crate) fn ray_to(&self, position: Vec3) -> Vec3 {
        let from_eye = || (position - self.eye).normalize_or_zero();
        self.parallel.unwrap_or_else(from_eye)
    }
}

/// A chosen photograph with what it holds.
#[derive(Debug, Clone, Copy)]
pub struct LookPhoto<'a> {
    /// Camera and place in the choice.
    pub photo: &'a ProjectedPhoto,
    /// Pixels of the photograph.
    pub pixels: &'a PhotoPyramid,
    /// Depth map of the photograph.
    pub depth: &'a PhotoDepth,
    /// Mask of the photograph, where it has one: what is dark is not used.
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
pub(crate) const CANDIDATES: usize = 6;

/// Photographs that are blended at most.
pub(crate) const MOST_BLENDED: usize = 3;

/// Candidates of less than this part of the best one's weight do not count: they would change no color by a level.
pub(crate) const LEAST_SHARE: f32 = 1.0 / 64.0;

/// Half the square of the angle between rays (a quarter of a degree) at which a photograph weighs half.
pub(crate) const SAME_RAY: f32 = 1e-5;

/// Weight whose odds, w / (1 - w), are `part` times those of another. All that lessens a photograph's weight does so by its
/// odds: what looks along the very ray of the view has weight 1 at its own borders and edges too, so that a photograph's own
/// pose gives the photograph; far from that ray the weight itself goes by the same part.
pub(crate) fn lessened(weight: f32, part: f32) -> f32 {
    let lessened = weight * part;
    match lessened > 0.0 {
        true => lessened / (lessened + (1.0 - weight).max(0.0)),
        false => 0.0,
    }
}

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

/// Greatest weight that a photograph may have at a pixel by the quality form, by the directions alone.
pub(crate) fn most_weight(
    pixel: &SurfacePixel,
    view_ray: Vec3,
    photo: &ProjectedPhoto,
    settings: &LookSettings,
) -> f32 {
    let ray = photo.ray_to(pixel.position);
    // 1 - cos of the angle between the rays, half the square of the angle; exact near 0.
    let apart = 0.5 * (view_ray - ray).length_squared();
    let same = SAME_RAY / (SAME_RAY + apart);
    let faces = match pixel.normal == Vec3::ZERO {
        true => 1.0,
        false => smooth(settings.limit_cos, 0.6, -pixel.normal.dot(ray)),
    };
    lessened(same, faces)
}

/// Weight of a photograph at a pixel; `None` where it does not show the point. `most` is [`most_weight`] of it.
fn candidate(
    pixel: &SurfacePixel,
    view: &LookView,
    of: &LookPhoto<'_>,
    settings: &LookSettings,
    most: f32,
) -> Option<PixelCandidate> {
    let photo = of.photo;
    let place = photo.place(pixel.position)?;
    let ray = photo.ray_to(pixel.position);
    let facing = -pixel.normal.dot(ray);
    let [across, down] = texel_steps(pixel, photo, place);
    let longest = across.max(down);
    // The weight, and the part that it is lessened by.
    let (weight, mut part) = match settings.form {
        WeightForm::Printed | WeightForm::Mended => {
            let d = match settings.direction {
                PhotoDirection::Axis => photo.rotation.transpose() * Vec3::Z,
                PhotoDirection::Hull => photo.direction,
                PhotoDirection::Ray => ray,
            };
            let weight = princ_weight(
                settings.form,
                photo,
                d,
                pixel.normal,
                view.direction,
                settings.limit_cos,
            );
            (weight, 1.0)
        }
        WeightForm::Quality => {
            // Fewer than one texel a pixel is blur, more is no gain.
            let texels = across.min(down).clamp(0.05, 1.0);
            (most, texels * border_weight(photo, place, settings.border))
        }
        WeightForm::Baked => {
            // Texels on a unit of the surface's area.
            let scale = photo.focal / place.depth;
            let border = border_weight(photo, place, settings.border);
            (facing * scale.x * scale.y, border)
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
        part *= of.depth.visibility(query, settings.visibility);
    }
    if let Some(mask) = of.mask.filter(|_| weight > 0.0) {
        part *= mask.sample((place.pixel / photo.size).to_array(), 0.0)[1];
    }
    let weight = match settings.form {
        WeightForm::Quality => lessened(weight, part),
        _ => weight * part,
    };
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
    let most = most_weight(pixel, view.ray_to(pixel.position), of.photo, settings);
    candidate(pixel, view, of, settings, most).map_or(0.0, |found| found.weight)
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
        let mut count = best_of_stage(pixel, view, (photos, stage), settings, &mut best);
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

/// The mean color of a place over all photographs that show it, each by its weight: what a texture of means holds there.
pub fn mean_at_pixel(
    pixel: &SurfacePixel,
    view: &LookView,
    photos: &[LookPhoto<'_>],
    settings: &LookSettings,
) -> LookPixel {
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    let mut found = LookPixel::default();
    for (index, of) in (0..).zip(photos) {
        let most = most_weight(pixel, view.ray_to(pixel.position), of.photo, settings);
        let Some(own) = candidate(pixel, view, of, settings, most) else {
            continue;
        };
        sum += color_of(&own, of, 0.0, settings.gains) * own.weight;
        weights += own.weight;
        if own.weight > found.weight {
            (found.weight, found.best) = (own.weight, index);
        }
    }
    if weights > 0.0 {
        found.color = (sum / weights).clamp(Vec3::ZERO, Vec3::ONE).to_array();
    }
    found
}

/// Photographs that are looked at together.
const BLOCK: usize = 64;

/// The few photographs of a stage that weigh most at a pixel, heaviest first, an earlier one before a later where they tie;
/// how many. Which cannot weigh [`LEAST_SHARE`] of the best is not looked up.
fn best_of_stage(
    pixel: &SurfacePixel,
    view: &LookView,
    (photos, stage): (&[LookPhoto<'_>], u32),
    settings: &LookSettings,
    best: &mut [PixelCandidate; CANDIDATES],
) -> usize {
    let mut count = 0;
    let mut add = |found: PixelCandidate| {
        let mut at = count;
        while at > 0 && is_before(&found, &best[at - 1]) {
            at -= 1;
        }
        if at < CANDIDATES {
            count = (count + 1).min(CANDIDATES);
            best[at..count].rotate_right(1);
            best[at] = found;
        }
        best[0].weight
    };
    let is_bounded = settings.form == WeightForm::Quality;
    let view_ray = view.ray_to(pixel.position);
    let mut least = 0.0_f32;
    for (block, photos) in (0..).zip(photos.chunks(BLOCK)) {
        let mut bounds = [0.0_f32; BLOCK];
        let mut promising = 0;
        for (i, of) in photos.iter().enumerate() {
            bounds[i] = match (of.photo.stage == stage, is_bounded) {
                (false, _) => continue,
                (true, false) => 1.0,
                (true, true) => most_weight(pixel, view_ray, of.photo, settings),
            };
            if bounds[i] > bounds[promising] {
                promising = i;
            }
        }
        // The most promising first: it tells which are not worth a look.
        for i in std::iter::once(promising).chain((0..photos.len()).filter(|i| *i != promising)) {
            if bounds[i] <= 0.0 || bounds[i] < least {
                continue;
            }
            if let Some(found) = candidate(pixel, view, &photos[i], settings, bounds[i]) {
                let list_index = (BLOCK * block + i) as u32;
                let heaviest = add(PixelCandidate {
                    list_index,
                    ..found
                });
                if is_bounded {
                    least = LEAST_SHARE * heaviest;
                }
            }
        }
    }
    count
}

/// Tells whether a candidate comes before another: by weight, and where they tie by its place in the list.
fn is_before(one: &PixelCandidate, other: &PixelCandidate) -> bool {
    one.weight > other.weight || (one.weight == other.weight && one.list_index < other.list_index)
}

/// Part of a weight that is left where as many weigh the same as are mixed.
pub(crate) const LEAST_LEFT: f32 = 1e-3;

/// The color of the best few candidates, each by its part of the best weight. What the first that is left out weighs is taken
/// off all, so that none comes or goes at a step (Buehler et al., section 3.2).
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
    let most = (settings.blend as usize).clamp(1, MOST_BLENDED);
    let left_out = best.get(most).map_or(0.0, |next| next.weight);
    let left_out = left_out.max(LEAST_SHARE * first.weight) * (1.0 - LEAST_LEFT);
    let count = most.min(best.len());
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for candidate in &best[..count] {
        // Consensus may leave less of a weight than the limit.
        let part = ((candidate.weight - left_out) / (first.weight - left_out)).max(0.0);
        if part > 0.0 {
            sum += color_of(candidate, of(candidate), 0.0, settings.gains) * part;
            weights += part;
        }
    }
    LookPixel {
        color: (sum / weights).clamp(Vec3::ZERO, Vec3::ONE).to_array(),
        weight: first.weight,
        best: first.list_index,
    }
}

/// Levels below the one whose texels are as large as pixels: a pyramid of boxes, blended between its levels, blurs.
pub(crate) const SHARPER: f32 = 0.5;

/// Levels above the one that fits at which photographs are compared: what is there, not how sharp it is.
pub(crate) const COARSER: f32 = 2.0;

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
