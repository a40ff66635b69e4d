//! Differences between a picture and a photograph, over the pixels that count.
//!
//! PSNR, SSIM and FLIP as `surfel compare` has them; 1 - NCC over windows of 5 x 5 pixels is the measure of Waechter et al.,
//! *Virtual Rephotography* (TOG 2017). A seam is a border between pixels that different photographs colored.

use crate::image::{Error, FloatImage};
use crate::measure::{PIXELS_PER_DEGREE, flip, ssim};

/// A picture beside the photograph that it should be.
#[derive(Debug, Clone, Copy)]
pub struct ComparedPictures<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The photograph, 0..=1.
    pub photo: &'a [[f32; 3]],
    /// The picture, 0..=1.
    pub picture: &'a [[f32; 3]],
    /// The pixels that count.
    pub mask: &'a [bool],
}

/// Differences between a picture and a photograph.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct RephotographyErrors {
    /// Peak signal to noise ratio, decibels; 99 where nothing differs.
    pub psnr_db: f64,
    /// Structural similarity, 1 is equal.
    pub ssim: f64,
    /// Mean FLIP difference, 0 is equal.
    pub flip: f64,
    /// Mean of 1 - NCC over windows of 5 x 5, 0 is equal.
    pub one_minus_ncc: f64,
}

/// PSNR of equal pictures.
const BEST_DB: f64 = 99.0;

/// Half the window of NCC, pixels.
const HALF: usize = 2;

/// Variance (of values of 0..=1) of a window below which the photograph has nothing to correlate: a third of a level.
const FLAT: f64 = 1.7e-6;

impl ComparedPictures<'_> {
    fn counted(&self) -> usize {
        self.mask.iter().filter(|m| **m).count()
    }

    fn psnr_db(&self) -> f64 {
        let mut sum = 0.0;
        for ((photo, picture), _) in
            (self.photo.iter().zip(self.picture).zip(self.mask)).filter(|(_, m)| **m)
        {
            sum += (0..3)
                .map(|c| f64::from(picture[c] - photo[c]).powi(2))
                .sum::<f64>();
        }
        let mean = sum / (3 * self.counted().max(1)) as f64;
        if mean > 0.0 {
            (-10.0 * mean.log10()).min(BEST_DB)
        } else {
            BEST_DB
        }
    }

    /// Both pictures, equal where nothing counts.
    fn masked(&self) -> [FloatImage; 2] {
        let image = |values: &[[f32; 3]]| FloatImage {
            width: self.width,
            height: self.height,
            color: (values.iter().zip(self.photo).zip(self.mask))
                .map(|((value, photo), counts)| {
                    let [r, g, b] = if *counts { *value } else { *photo };
                    [r, g, b, 1.0]
                })
                .collect(),
            ..FloatImage::default()
        };
        [image(self.photo), image(self.picture)]
    }

    /// All differences. Zeros where no pixel counts.
    ///
    /// # Errors
    /// [`Error::Size`] where pictures and mask have not as many pixels as they say.
    pub fn errors(&self) -> Result<RephotographyErrors, Error> {
        let counted = self.counted();
        if counted == 0 {
            return Ok(RephotographyErrors::default());
        }
        let [photo, picture] = self.masked();
        let share = self.mask.len() as f64 / counted as f64;
        let map = flip(&photo, &picture, PIXELS_PER_DEGREE)?.map;
        let flip = (map.iter().zip(self.mask))
            .filter(|(_, m)| **m)
            .map(|(v, _)| f64::from(*v))
            .sum::<f64>();
        Ok(RephotographyErrors {
            psnr_db: self.psnr_db(),
            // What does not count is equal, so it adds no loss.
            ssim: 1.0 - (1.0 - ssim(&photo, &picture)?) * share,
            flip: flip / counted as f64,
            one_minus_ncc: self.one_minus_ncc(),
        })
    }

    fn one_minus_ncc(&self) -> f64 {
        let (w, h) = (self.width as usize, self.height as usize);
        let luma = |c: &[f32; 3]| {
            0.2126 * f64::from(c[0]) + 0.7152 * f64::from(c[1]) + 0.0722 * f64::from(c[2])
        };
        let first: Vec<f64> = self.photo.iter().map(luma).collect();
        let second: Vec<f64> = self.picture.iter().map(luma).collect();
        let (mut sum, mut windows) = (0.0, 0_usize);
        for y in HALF..h.saturating_sub(HALF) {
            for x in HALF..w.saturating_sub(HALF) {
                let rows =
                    (y - HALF..=y + HALF).map(|row| row * w + x - HALF..row * w + x + HALF + 1);
                if rows.clone().any(|row| self.mask[row].iter().any(|m| !*m)) {
                    continue;
                }
                let mut sums = [0.0; 5];
                for at in rows.flatten() {
                    let (a, b) = (first[at], second[at]);
                    for (sum, value) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                        *sum += value;
                    }
                }
                let n = ((2 * HALF + 1) * (2 * HALF + 1)) as f64;
                let [a, b, aa, bb, ab] = sums.map(|s| s / n);
                let (va, vb) = (aa - a * a, bb - b * b);
                if va < FLAT {
                    continue;
                }
                // A flat window of the picture does not correlate.
                let ncc = if vb > FLAT {
                    (ab - a * b) / (va * vb).sqrt()
                } else {
                    0.0
                };
                sum += 1.0 - ncc.clamp(-1.0, 1.0);
                windows += 1;
            }
        }
        sum / windows.max(1) as f64
    }

    /// The factor of each channel that brings the picture nearest to the photograph, by least squares.
    pub fn channel_gains(&self) -> [f32; 3] {
        let mut sums = [[0.0_f64; 2]; 3];
        for ((photo, picture), _) in
            (self.photo.iter().zip(self.picture).zip(self.mask)).filter(|(_, m)| **m)
        {
            for (c, sum) in sums.iter_mut().enumerate() {
                let (p, q) = (f64::from(photo[c]), f64::from(picture[c]));
                *sum = [sum[0] + p * q, sum[1] + q * q];
            }
        }
        sums.map(|[pq, qq]| if qq > 0.0 { (pq / qq) as f32 } else { 1.0 })
    }

    /// Energy of the differences across borders of `labels`, over that of the photograph at the same places; 1 without
    /// borders.
    pub fn seam_energy(&self, labels: &[u32]) -> f64 {
        let w = self.width as usize;
        let mut energy = [0.0_f64; 2];
        for at in 0..labels.len() {
            let right = (at % w.max(1) + 1 < w).then_some(at + 1);
            let below = (at + w < labels.len()).then_some(at + w);
            for other in [right, below].into_iter().flatten() {
                if !self.mask[at] || !self.mask[other] || labels[at] == labels[other] {
                    continue;
                }
                for (sum, values) in energy.iter_mut().zip([self.picture, self.photo]) {
                    let step = |c: usize| f64::from(values[at][c] - values[other][c]).powi(2);
                    *sum += (0..3).map(step).sum::<f64>();
                }
            }
        }
        if energy[1] > 0.0 {
            energy[0] / energy[1]
        } else {
            1.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 24;

    fn texture(at: usize) -> [f32; 3] {
        let (x, y) = ((at % W) as f32, (at / W) as f32);
        [0, 1, 2].map(|c| 0.4 + 0.2 * (1.3 * x + 0.7 * y + c as f32).sin())
    }

    fn compared<'a>(
        photo: &'a [[f32; 3]],
        picture: &'a [[f32; 3]],
        mask: &'a [bool],
    ) -> ComparedPictures<'a> {
        ComparedPictures {
            width: W as u32,
            height: W as u32,
            photo,
            picture,
            mask,
        }
    }

    #[test]
    fn equal_pictures_differ_nowhere_and_only_the_mask_counts() {
        let photo: Vec<_> = (0..W * W).map(texture).collect();
        let mut picture = photo.clone();
        picture[3] = [1.0; 3];
        let mask: Vec<bool> = (0..W * W).map(|at| at >= 2 * W).collect();
        let errors = compared(&photo, &picture, &mask).errors().unwrap();
        assert_eq!(errors.psnr_db, 99.0);
        assert!((errors.ssim - 1.0).abs() < 1e-9 && errors.flip < 1e-6);
        assert!(errors.one_minus_ncc.abs() < 1e-9);
        let all = vec![true; W * W];
        assert!(compared(&photo, &picture, &all).errors().unwrap().psnr_db < 50.0);
        let none = vec![false; W * W];
        assert_eq!(
            compared(&photo, &picture, &none).errors().unwrap(),
            RephotographyErrors::default()
        );
    }

    #[test]
    fn one_gain_a_channel_takes_exposure_out_and_correlation_never_had_it() {
        let photo: Vec<_> = (0..W * W).map(texture).collect();
        let picture: Vec<_> = photo
            .iter()
            .map(|c| [c[0] * 0.5, c[1] * 0.8, c[2]])
            .collect();
        let all = vec![true; W * W];
        let of = compared(&photo, &picture, &all);
        let gains = of.channel_gains();
        assert!(
            (gains[0] - 2.0).abs() < 1e-4
                && (gains[1] - 1.25).abs() < 1e-4
                && (gains[2] - 1.0).abs() < 1e-4
        );
        let gray: Vec<_> = photo.iter().map(|c| c.map(|v| 0.5 * v)).collect();
        assert!(
            compared(&photo, &gray, &all)
                .errors()
                .unwrap()
                .one_minus_ncc
                < 1e-6
        );
        // A difference of one tenth is 20 dB.
        let shifted: Vec<_> = photo.iter().map(|c| c.map(|v| v + 0.1)).collect();
        assert!((compared(&photo, &shifted, &all).errors().unwrap().psnr_db - 20.0).abs() < 1e-4);
        // The negative correlates at -1, a flat picture not at all.
        let negative: Vec<_> = photo.iter().map(|c| c.map(|v| 1.0 - v)).collect();
        assert!(
            (compared(&photo, &negative, &all)
                .errors()
                .unwrap()
                .one_minus_ncc
                - 2.0)
                .abs()
                < 1e-6
        );
        let flat = vec![[0.3; 3]; W * W];
        assert!(
            (compared(&photo, &flat, &all)
                .errors()
                .unwrap()
                .one_minus_ncc
                - 1.0)
                .abs()
                < 1e-9
        );
    }

    #[test]
    fn a_step_between_labels_is_a_seam() {
        let photo: Vec<_> = (0..W * W).map(texture).collect();
        let labels: Vec<u32> = (0..W * W).map(|at| u32::from(at % W >= 12)).collect();
        let stepped: Vec<_> = (photo.iter().zip(&labels))
            .map(|(c, l)| c.map(|v| v + 0.3 * *l as f32))
            .collect();
        let all = vec![true; W * W];
        assert!((compared(&photo, &photo, &all).seam_energy(&labels) - 1.0).abs() < 1e-9);
        assert!(compared(&photo, &stepped, &all).seam_energy(&labels) > 1.5);
        assert_eq!(
            compared(&photo, &stepped, &all).seam_energy(&vec![0; W * W]),
            1.0
        );
    }
}
