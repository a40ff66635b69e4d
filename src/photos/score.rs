//! Leave one out: each photograph predicted from all the others, by a ladder of methods.

use crate::image::{FloatImage, Image};
use crate::photos::depth_map::PhotoVisibility;
use crate::photos::error::PhotoError;
use crate::photos::library::load_photo;
use crate::photos::look::{LookSettings, PhotoDirection, WeightForm};
use crate::photos::metrics::{ComparedPictures, RephotographyErrors};
use crate::photos::scene::{CalibratedCamera, ScenePhoto};
use crate::photos::session::{PhotoChoice, PhotoPicture, PhotoSession};
use crate::photos::surface::SurfacePicture;
use crate::progress::Progress;

/// A method of the ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LadderRung {
    /// Short name, also of files.
    pub name: &'static str,
    /// Sentence for people.
    pub text: &'static str,
    /// Settings; `None` for colors of vertices.
    pub settings: Option<LookSettings>,
    /// Photographs of a picture at most; `None`: as many as the session uses.
    pub most: Option<usize>,
    /// Comparison beside the ladder, no step of it.
    pub is_beside: bool,
    /// The mean of all photographs.
    pub is_mean: bool,
}

/// Photographs that Princ's rungs use: two by the direction of the view, two for what these leave uncovered. His choice is
/// the only thing in them that looks at the view much, so it must leave some out.
const PRINCS_PHOTOS: usize = 4;

/// The rungs, each with what the one before it has and one thing more, and after them what is compared with.
pub fn ladder() -> Vec<LadderRung> {
    let printed = LookSettings {
        form: WeightForm::Printed,
        direction: PhotoDirection::Axis,
        visibility: PhotoVisibility::Off,
        limit_cos: 70_f32.to_radians().cos(),
        blend: 1,
        consensus: false,
        gains: false,
        ..LookSettings::default()
    };
    let hull = LookSettings {
        direction: PhotoDirection::Hull,
        ..printed
    };
    let visible = LookSettings {
        visibility: PhotoVisibility::DepthSoft,
        ..hull
    };
    let mended = LookSettings {
        form: WeightForm::Mended,
        direction: PhotoDirection::Ray,
        ..visible
    };
    let best = LookSettings {
        blend: 1,
        consensus: false,
        gains: false,
        ..LookSettings::default()
    };
    let gains = LookSettings {
        gains: true,
        ..best
    };
    // A texture is made of all photographs, whatever view it is seen from.
    let atlas = LookSettings {
        form: WeightForm::Baked,
        blend: 1,
        ..LookSettings::default()
    };
    let rung = |name, text, settings: Option<LookSettings>| LadderRung {
        name,
        text,
        settings,
        most: (settings
            .is_some_and(|own| own.form == WeightForm::Printed || own.form == WeightForm::Mended))
        .then_some(PRINCS_PHOTOS),
        is_beside: false,
        is_mean: false,
    };
    let beside = |name, text, settings| LadderRung {
        is_beside: true,
        ..rung(name, text, Some(settings))
    };
    vec![
        rung("vertices", "mean colors of vertices", None),
        rung(
            "axis",
            "one photograph by optical axis, equation 2.8 as printed",
            Some(printed),
        ),
        rung(
            "hull",
            "the same with Princ's corrected direction",
            Some(hull),
        ),
        rung(
            "visible",
            "and visibility by depth, soft at edges",
            Some(visible),
        ),
        rung(
            "best",
            "one photograph by ray, texels and border",
            Some(best),
        ),
        rung("gains", "and exposures brought together", Some(gains)),
        rung(
            "blend",
            "and up to three blended by their weights",
            Some(LookSettings::default()),
        ),
        beside(
            "mended",
            "visible with Princ's weight mended, a ray for each pixel",
            mended,
        ),
        beside(
            "atlas",
            "a texture of unlimited size baked of the sharpest photograph, with gains",
            atlas,
        ),
        LadderRung {
            is_mean: true,
            ..beside("mean", "the same of the mean of all photographs", atlas)
        },
    ]
}

/// A method's differences from one photograph.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct RungScore {
    /// Over pixels that another photograph sees, as the picture is.
    pub seen: RephotographyErrors,
    /// Differences over those pixels after one gain a channel.
    pub seen_gain: RephotographyErrors,
    /// Over all pixels of the mesh; what is uncovered has the colors of vertices.
    pub mesh: RephotographyErrors,
    /// Energy across borders between photographs over the photograph's own.
    pub seams: f64,
    /// Share of the mesh's pixels that the method colors.
    pub coverage: f64,
}

/// The scores of one photograph.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct PhotoScore {
    /// Name of the photograph.
    pub name: String,
    /// Pixels of the mesh.
    pub mesh_pixels: u64,
    /// Pixels of these that another photograph sees.
    pub seen_pixels: u64,
    /// Scores of the rungs, in the order of the ladder.
    pub rungs: Vec<RungScore>,
    /// PSNR with the photograph itself among the others, decibels.
    pub self_psnr_db: f64,
    /// As `self_psnr_db`, with the principal point of its camera half a pixel off.
    pub shifted_self_psnr_db: f64,
}

/// Pictures of one photograph.
#[derive(Debug, Clone, Default)]
pub struct ScorePictures {
    /// The photograph itself.
    pub photo: Image,
    /// The picture of each rung.
    pub rungs: Vec<Image>,
    /// The pixels that another photograph sees, white.
    pub mask: Image,
}

/// A photograph at the size of the score, with its camera.
struct TargetPhoto {
    camera: CalibratedCamera,
    values: Vec<[f32; 3]>,
}

/// The photograph made smaller by a whole factor until no side is above `longest`, without distortion.
fn target(photo: &ScenePhoto, longest: u32) -> Result<TargetPhoto, PhotoError> {
    let pyramid = load_photo(photo, u32::MAX)?;
    let [w, h] = pyramid.size();
    let factor = w.max(h).div_ceil(longest.max(1)).max(1);
    let (width, height) = ((w / factor).max(1), (h / factor).max(1));
    let part = 1.0 / f64::from(factor);
    let camera = CalibratedCamera {
        width,
        height,
        focal: photo.camera.focal.map(|f| f * part),
        principal: photo.camera.principal.map(|c| c * part),
        ..photo.camera.pinhole()
    };
    // The box of a pixel: each of its parts through the lens.
    let values = (0..width * height).map(|at| {
        let mut sum = [0.0_f32; 3];
        let (x, y) = (at % width, at / width);
        for k in 0..factor * factor {
            let pixel =
                [x * factor + k % factor, y * factor + k / factor].map(|v| f64::from(v) + 0.5);
            let ray =
                [0, 1].map(|i| (pixel[i] - photo.camera.principal[i]) / photo.camera.focal[i]);
            let place = photo.camera.lens.distort(ray).map(|bent| {
                [0, 1].map(|i| bent[i] * photo.camera.focal[i] + photo.camera.principal[i])
            });
            let [u, v] = place.unwrap_or([0.0; 2]);
            let at = [(u / f64::from(w)) as f32, (v / f64::from(h)) as f32];
            let color = pyramid.sample(at, 0.0);
            sum = [0, 1, 2].map(|c| sum[c] + color[c]);
        }
        sum.map(|v| v / (factor * factor) as f32)
    });
    Ok(TargetPhoto {
        values: values.collect(),
        camera,
    })
}

fn image_of(size: [u32; 2], values: &[[f32; 3]]) -> Image {
    FloatImage {
        width: size[0],
        height: size[1],
        color: values.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect(),
        ..FloatImage::default()
    }
    .to_image()
}

/// Predicts photographs and compares.
#[derive(Debug)]
pub struct PhotoJudge<'s, 'm> {
    /// The model with its photographs.
    pub session: &'s mut PhotoSession<'m>,
    /// The ladder.
    pub rungs: Vec<LadderRung>,
    /// Longest side at which pictures are compared, pixels.
    pub longest_side: u32,
}

impl PhotoJudge<'_, '_> {
    /// Scores of the photograph at `index`, with its pictures.
    ///
    /// # Errors
    /// When a photograph cannot be decoded, or the backend cannot draw.
    pub fn score(&mut self, index: usize) -> Result<(PhotoScore, ScorePictures), PhotoError> {
        let photo = &self.session.scene().photos[index];
        let target = target(photo, self.longest_side)?;
        let size = [target.camera.width, target.camera.height];
        let surface = self.session.drawer().surface(&target.camera)?;
        let others: Vec<usize> = self
            .session
            .usable()
            .into_iter()
            .filter(|i| *i != index)
            .collect();
        let colors = self.session.vertex_colors(&others)?;
        let base: Vec<[f32; 3]> = (self
            .session
            .drawer()
            .vertex_colors(&colors, &target.camera)?)
        .iter()
        .map(|[r, g, b, _]| [*r, *g, *b])
        .collect();
        let on_mesh: Vec<bool> = surface.pixels.iter().map(Option::is_some).collect();
        // Seen by another photograph: what soft visibility and a mild limit of the angle leave.
        let choice = PhotoChoice::of(&others);
        let usual = LookSettings::default();
        let reference = (self.session).picture(&target.camera, &surface, choice, &usual)?;
        let seen: Vec<bool> = reference
            .pixels
            .iter()
            .map(|pixel| pixel.weight > 0.0)
            .collect();
        let mut score = PhotoScore {
            name: photo.name.clone(),
            mesh_pixels: on_mesh.iter().filter(|m| **m).count() as u64,
            seen_pixels: seen.iter().filter(|m| **m).count() as u64,
            ..PhotoScore::default()
        };
        let mut pictures = ScorePictures {
            photo: image_of(size, &target.values),
            mask: image_of(
                size,
                &seen
                    .iter()
                    .map(|m| [f32::from(u8::from(*m)); 3])
                    .collect::<Vec<_>>(),
            ),
            rungs: Vec::new(),
        };
        for rung in self.rungs.clone() {
            let choice = PhotoChoice {
                most: rung.most,
                is_mean: rung.is_mean,
                ..choice
            };
            let picture = match &rung.settings {
                Some(settings) => {
                    Some((self.session).picture(&target.camera, &surface, choice, settings)?)
                }
                None => None,
            };
            let values = composed(picture.as_ref(), &surface, &base);
            let labels = labels_of(picture.as_ref(), on_mesh.len());
            score
                .rungs
                .push(rung_score(&target, &values, [&seen, &on_mesh], &labels)?);
            pictures.rungs.push(image_of(size, &values));
        }
        let everything = self.session.usable();
        score.self_psnr_db = self.self_psnr(&target, target.camera, &everything)?;
        let mut shifted = target.camera;
        shifted.principal[0] += 0.5;
        score.shifted_self_psnr_db = self.self_psnr(&target, shifted, &everything)?;
        Ok((score, pictures))
    }

    /// PSNR of a picture from a camera, with the photograph itself among the others.
    fn self_psnr(
        &mut self,
        target: &TargetPhoto,
        camera: CalibratedCamera,
        all: &[usize],
    ) -> Result<f64, PhotoError> {
        let surface = self.session.drawer().surface(&camera)?;
        let settings = LookSettings {
            gains: false,
            ..LookSettings::default()
        };
        let choice = PhotoChoice::of(all);
        let picture = (self.session).picture(&camera, &surface, choice, &settings)?;
        let mask: Vec<bool> = picture
            .pixels
            .iter()
            .map(|pixel| pixel.weight > 0.0)
            .collect();
        let values: Vec<[f32; 3]> = picture.pixels.iter().map(|pixel| pixel.color).collect();
        Ok(compared(target, &values, &mask).errors()?.psnr_db)
    }

    /// Scores of all photographs that can be used; `on_photo` sees each with its pictures.
    ///
    /// # Errors
    /// As [`score`](Self::score), what `on_photo` says, or [`PhotoError::Cancelled`].
    pub fn score_all(
        &mut self,
        progress: &dyn Progress,
        on_photo: &mut dyn FnMut(&PhotoScore, &ScorePictures) -> Result<(), PhotoError>,
    ) -> Result<Vec<PhotoScore>, PhotoError> {
        let photos = self.session.usable();
        progress.stage("score", photos.len() as u64);
        let mut scores = Vec::new();
        for index in photos {
            if progress.is_cancelled() {
                return Err(PhotoError::Cancelled);
            }
            let (score, pictures) = self.score(index)?;
            on_photo(&score, &pictures)?;
            scores.push(score);
            progress.advance(1);
        }
        Ok(scores)
    }
}

/// The picture's colors where it has any, else those of vertices, else black.
fn composed(
    picture: Option<&PhotoPicture>,
    surface: &SurfacePicture,
    base: &[[f32; 3]],
) -> Vec<[f32; 3]> {
    let of = |at: usize| {
        let covered = picture
            .map(|p| p.pixels[at])
            .filter(|pixel| pixel.weight > 0.0);
        match (covered, &surface.pixels[at]) {
            (_, None) => [0.0; 3],
            (Some(pixel), Some(_)) => pixel.color,
            (None, Some(_)) => base[at],
        }
    };
    (0..base.len()).map(of).collect()
}

/// The photograph of each pixel; one for all without a picture.
fn labels_of(picture: Option<&PhotoPicture>, count: usize) -> Vec<u32> {
    match picture {
        None => vec![0; count],
        Some(picture) => picture
            .pixels
            .iter()
            .map(|pixel| {
                if pixel.weight > 0.0 {
                    pixel.best
                } else {
                    u32::MAX
                }
            })
            .collect(),
    }
}

fn compared<'a>(
    target: &'a TargetPhoto,
    picture: &'a [[f32; 3]],
    mask: &'a [bool],
) -> ComparedPictures<'a> {
    ComparedPictures {
        width: target.camera.width,
        height: target.camera.height,
        photo: &target.values,
        picture,
        mask,
    }
}

fn rung_score(
    target: &TargetPhoto,
    values: &[[f32; 3]],
    [seen, on_mesh]: [&Vec<bool>; 2],
    labels: &[u32],
) -> Result<RungScore, PhotoError> {
    let of = compared(target, values, seen);
    let gains = of.channel_gains();
    let corrected: Vec<[f32; 3]> = (values.iter())
        .map(|value| [0, 1, 2].map(|c| (value[c] * gains[c]).clamp(0.0, 1.0)))
        .collect();
    let mesh = on_mesh.iter().filter(|m| **m).count().max(1);
    let colored = labels
        .iter()
        .zip(on_mesh)
        .filter(|(label, on)| **on && **label != u32::MAX)
        .count();
    Ok(RungScore {
        seen: of.errors()?,
        seen_gain: compared(target, &corrected, seen).errors()?,
        mesh: compared(target, values, on_mesh).errors()?,
        seams: of.seam_energy(labels),
        coverage: colored as f64 / mesh as f64,
    })
}
