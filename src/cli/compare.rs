//! `surfel compare`

use super::render::require_ending;
use super::{CommandFailure, Outcome, print, usage};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use surfel::image::{
    ChannelComparison, FloatImage, Image, PictureChannels, PictureDifference, PixelSource, compare,
    compare_channels, contact_sheet, difference_picture,
};
use surfel::measure::{
    self, CoverageErrors, PIXELS_PER_DEGREE, PictureTile, SampleSpread, crop, flip, ssim,
    worst_tile,
};

/// Compare two pictures.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel compare reference.png picture.png\n  surfel compare reference.exr picture.exr --json\n  surfel compare a.png b.png --background black --difference d.png --gain 4 --worst worst.png\n  surfel compare a.png b.png --max-flip 0.01 --min-psnr 40\n\nPictures are PNG or EXR files of one size. Coverage and silhouette are compared where the pictures have alpha (the EXR\nfiles of surfel render do, both) or --background says what is not covered; normals where both files have them. Every other channel (alpha, depth, any of an\nEXR file) is compared value by value, and what one file lacks is said: it never counts as equal (--equal).\nExit codes: 0 within the bounds, 1 past one of them, 2 what cannot be compared."
)]
pub(crate) struct CompareArgs {
    /// The picture that is right
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    /// The picture to judge
    #[arg(value_name = "PICTURE")]
    picture: PathBuf,
    /// For pictures without alpha: pixels of exactly this color are not covered
    #[arg(long, value_name = "COLOR", value_parser = super::background::parse_color)]
    background: Option<[f32; 3]>,
    /// Write the absolute difference of each color: .png
    #[arg(long, value_name = "FILE")]
    difference: Option<PathBuf>,
    /// Factor of the difference picture
    #[arg(
        long,
        value_name = "FACTOR",
        default_value_t = 1.0,
        requires = "difference"
    )]
    gain: f64,
    /// Write the FLIP difference of each pixel, dark to bright: .png
    #[arg(long, value_name = "FILE")]
    flip_map: Option<PathBuf>,
    /// Write the worst place of both pictures and of their difference, enlarged: .png
    #[arg(long, value_name = "FILE")]
    worst: Option<PathBuf>,
    /// Side of the worst place in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=4096))]
    tile: u32,
    /// Pixels a degree of the viewer's eye, for FLIP
    #[arg(long, value_name = "PIXELS", default_value_t = PIXELS_PER_DEGREE)]
    pixels_per_degree: f32,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bounds: CompareBounds,
}

/// Past one of these the run fails.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Bounds")]
struct CompareBounds {
    /// Largest mean FLIP difference, 0 to 1
    #[arg(long, value_name = "MEAN")]
    max_flip: Option<f64>,
    /// Smallest PSNR over the whole picture, decibels
    #[arg(long, value_name = "DB")]
    min_psnr: Option<f64>,
    /// Smallest PSNR over object pixels (covered in either picture), decibels
    #[arg(long, value_name = "DB")]
    min_object_psnr: Option<f64>,
    /// Smallest SSIM
    #[arg(long, value_name = "SSIM")]
    min_ssim: Option<f64>,
    /// Fail unless both files hold the same, in every channel
    #[arg(long)]
    equal: bool,
    /// Largest difference of a value in any channel: color, alpha, depth
    #[arg(long, value_name = "VALUE")]
    max_difference: Option<f64>,
    /// Largest difference of a color or alpha, levels of 255
    #[arg(long, value_name = "LEVELS")]
    max_level: Option<f64>,
    /// Most pixels that the picture lacks
    #[arg(long, value_name = "PIXELS")]
    max_missing: Option<u64>,
    /// Most pixels that the reference has not
    #[arg(long, value_name = "PIXELS")]
    max_extra: Option<u64>,
    /// Most holes inside of the silhouette
    #[arg(long, value_name = "HOLES")]
    max_holes: Option<u64>,
    /// Largest mean distance of the silhouettes, pixels
    #[arg(long, value_name = "PIXELS")]
    max_silhouette: Option<f64>,
}

/// Everything that is measured.
struct CompareReport {
    size: [u32; 2],
    flip: f64,
    ssim: f64,
    difference: PictureDifference,
    worst: PictureTile,
    /// Coverage and silhouette, where pixels are told covered or not.
    shape: Option<(CoverageErrors, SampleSpread)>,
    normals: Option<SampleSpread>,
    /// Every channel of the files.
    channels: ChannelComparison,
    /// Both files have colors: flip, psnr and ssim mean something.
    has_colors: bool,
}

/// A difference up to this many levels is no difference to count.
const LEVEL: f64 = 1.0;

impl CompareReport {
    fn json(&self) -> serde_json::Value {
        let Self {
            size: [width, height],
            flip,
            ssim,
            difference: d,
            worst,
            shape,
            normals,
            channels,
            has_colors,
        } = self;
        let of_colors = |value: f64| has_colors.then_some(value);
        json!({
            "equal": channels.is_equal(),
            "channels": channels.channels,
            "not_compared": channels.not_compared,
            "width": width,
            "height": height,
            "flip": of_colors(*flip),
            "ssim": of_colors(*ssim),
            "psnr_db": of_colors(d.whole.psnr_db),
            "object_psnr_db": shape.as_ref().map(|_| d.object.psnr_db),
            "object_pixels": shape.as_ref().map(|_| d.object.pixels),
            "max_level": of_colors(d.whole.max_level),
            "mean_level": of_colors(255.0 * d.whole.mean_abs),
            "pixels_past_a_level": has_colors.then_some(d.whole.past_level),
            "coverage": shape.as_ref().map(|(coverage, _)| coverage),
            "silhouette_px": shape.as_ref().map(|(_, silhouette)| silhouette),
            "normals_degrees": normals,
            "worst_tile": has_colors.then_some(worst),
        })
    }

    fn text(&self) -> String {
        let d = &self.difference;
        let mut text = String::new();
        // Writing to a string does not fail.
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "{name:<12}{value}");
        };
        line("size", format!("{} x {}", self.size[0], self.size[1]));
        if !self.has_colors {
            line(
                "colors",
                "not in both files: no flip, psnr and ssim".to_owned(),
            );
            self.write_channels(&mut line);
            return text;
        }
        line("flip", format!("{:.5} (mean; 0 is equal)", self.flip));
        let object = match &self.shape {
            Some(_) => format!(
                "; {:.2} dB over {} object pixels",
                d.object.psnr_db, d.object.pixels
            ),
            None => String::new(),
        };
        line("psnr", format!("{:.2} dB{object}", d.whole.psnr_db));
        line("ssim", format!("{:.5}", self.ssim));
        line(
            "levels",
            format!(
                "{:.3} mean, {:.1} at most; {} pixels differ by more than {LEVEL}",
                255.0 * d.whole.mean_abs,
                d.whole.max_level,
                d.whole.past_level
            ),
        );
        if let Some((c, silhouette)) = &self.shape {
            line(
                "coverage",
                format!(
                    "{} pixels; {} missing, {} extra, {} holes of {} pixels",
                    c.covered, c.missing, c.extra, c.holes, c.hole_pixels
                ),
            );
            line(
                "silhouette",
                format!(
                    "{:.3} pixels apart (mean), {:.2} at the 99th percentile",
                    silhouette.mean, silhouette.p99
                ),
            );
        }
        if let Some(n) = &self.normals {
            line(
                "normals",
                format!(
                    "{:.3} degrees (mean), {:.2} at the 99th percentile",
                    n.mean, n.p99
                ),
            );
        }
        let w = &self.worst;
        line(
            "worst",
            format!(
                "{} x {} pixels at {},{}: {:.2} levels",
                w.width,
                w.height,
                w.x,
                w.y,
                255.0 * w.rmse
            ),
        );
        self.write_channels(&mut line);
        text
    }

    /// The channels beside the colors, what was not compared, and the verdict.
    fn write_channels(&self, line: &mut impl FnMut(&str, String)) {
        let is_color = |name: &str| matches!(name, "R" | "G" | "B");
        for channel in &self.channels.channels {
            if is_color(&channel.name) && self.has_colors {
                continue;
            }
            let unmatched = match channel.unmatched {
                0 => String::new(),
                count => format!(", {count} of them finite in one file alone"),
            };
            let (differing, values) = (channel.differing, channel.values);
            let (mean, largest) = (channel.mean_abs, channel.largest);
            line(
                &format!("channel {}", channel.name),
                format!(
                    " {differing} of {values} values differ{unmatched}; {mean:.6} mean, {largest:.6} at most"
                ),
            );
        }
        for what in &self.channels.not_compared {
            line("not compared", format!(" {what}"));
        }
        let differing = self.channels.channels.iter();
        let differing: Vec<&str> = differing
            .filter(|channel| channel.differing > 0)
            .map(|channel| &channel.name[..])
            .collect();
        let verdict = if self.channels.is_equal() {
            "equal in every channel".to_owned()
        } else if differing.is_empty() {
            "not known to be equal: not all was compared".to_owned()
        } else {
            format!("different in {}", differing.join(", "))
        };
        line("verdict", verdict);
    }

    /// The bounds that are missed, as a sentence.
    fn missed(&self, bounds: &CompareBounds) -> Result<Option<String>, CommandFailure> {
        let mut missed = Vec::new();
        let mut check = |option: &str, value: f64, bound: Option<f64>, is_least: bool| {
            if let Some(bound) = bound {
                let is_kept = if is_least {
                    value >= bound
                } else {
                    value <= bound
                };
                if !is_kept {
                    let side = if is_least { "below" } else { "above" };
                    missed.push(format!("{value} is {side} {option} {bound}"));
                }
            }
        };
        let d = &self.difference;
        if !self.has_colors && bounds.need_colors() {
            return Err(usage(
                "no colors in both files, so there is no flip, psnr, ssim and level to bound: --max-difference bounds any channel",
            ));
        }
        let channel = |name: &str| self.channels.channels.iter().find(|c| c.name == name);
        let alpha = channel("A").map_or(0.0, |alpha| 255.0 * alpha.largest);
        let max_level = d.whole.max_level.max(alpha);
        for channel in &self.channels.channels {
            let largest = match channel.unmatched {
                0 => channel.largest,
                _ => f64::INFINITY,
            };
            check("--max-difference", largest, bounds.max_difference, false);
        }
        check("--max-flip", self.flip, bounds.max_flip, false);
        check("--min-psnr", d.whole.psnr_db, bounds.min_psnr, true);
        check("--min-ssim", self.ssim, bounds.min_ssim, true);
        check("--max-level", max_level, bounds.max_level, false);
        match &self.shape {
            Some((c, silhouette)) => {
                let count = |bound: Option<u64>| bound.map(|b| b as f64);
                check(
                    "--min-object-psnr",
                    d.object.psnr_db,
                    bounds.min_object_psnr,
                    true,
                );
                check(
                    "--max-missing",
                    c.missing as f64,
                    count(bounds.max_missing),
                    false,
                );
                check(
                    "--max-extra",
                    c.extra as f64,
                    count(bounds.max_extra),
                    false,
                );
                check(
                    "--max-holes",
                    c.holes as f64,
                    count(bounds.max_holes),
                    false,
                );
                check(
                    "--max-silhouette",
                    silhouette.mean,
                    bounds.max_silhouette,
                    false,
                );
            }
            None if bounds.need_coverage() => {
                return Err(usage(
                    "both pictures are opaque everywhere, so nothing is known about coverage: give --background COLOR, or EXR files \
                     of surfel render",
                ));
            }
            None => {}
        }
        let is_unequal = !self.channels.is_equal();
        if is_unequal && bounds.equal {
            missed.push("the files are not equal, which --equal asks for".to_owned());
        }
        let not_compared = &self.channels.not_compared;
        if bounds.max_difference.is_some() && !not_compared.is_empty() {
            let what = not_compared.join(", ");
            missed.push(format!(
                "--max-difference bounds what was not compared: {what}"
            ));
        }
        missed.dedup();
        Ok((!missed.is_empty()).then(|| missed.join("; ")))
    }
}

impl CompareBounds {
    fn need_coverage(&self) -> bool {
        self.min_object_psnr.is_some()
            || self.max_missing.is_some()
            || self.max_extra.is_some()
            || self.max_holes.is_some()
            || self.max_silhouette.is_some()
    }

    fn need_colors(&self) -> bool {
        self.max_flip.is_some()
            || self.min_psnr.is_some()
            || self.min_object_psnr.is_some()
            || self.min_ssim.is_some()
            || self.max_level.is_some()
    }

    fn all(&self) -> [(&'static str, Option<f64>); 7] {
        [
            ("--max-difference", self.max_difference),
            ("--max-flip", self.max_flip),
            ("--min-psnr", self.min_psnr),
            ("--min-object-psnr", self.min_object_psnr),
            ("--min-ssim", self.min_ssim),
            ("--max-level", self.max_level),
            ("--max-silhouette", self.max_silhouette),
        ]
    }
}

impl CompareArgs {
    fn check(&self) -> Outcome {
        let outputs = [
            ("--difference", &self.difference),
            ("--flip-map", &self.flip_map),
            ("--worst", &self.worst),
        ];
        let mut seen: Vec<&Path> = vec![&self.reference, &self.picture];
        for (option, path) in outputs {
            require_ending(option, path.as_ref(), &["png"])?;
            if let Some(path) = path {
                if seen.contains(&path.as_path()) {
                    return Err(usage(format!(
                        "{option} {} would be written over another picture of this run",
                        path.display()
                    )));
                }
                seen.push(path);
                super::require_folder(path)?;
            }
        }
        if !(self.gain > 0.0 && self.gain.is_finite()) {
            return Err(usage(format!("--gain {} is no factor above 0", self.gain)));
        }
        if !(1.0..=1000.0).contains(&self.pixels_per_degree) {
            return Err(usage(format!(
                "--pixels-per-degree {} is not from 1 to 1000",
                self.pixels_per_degree
            )));
        }
        for (option, bound) in self.bounds.all() {
            if bound.is_some_and(f64::is_nan) {
                return Err(usage(format!("{option}: a bound has to be a number")));
            }
        }
        Ok(())
    }

    fn load(&self, path: &Path) -> Result<FloatImage, CommandFailure> {
        let mut image = FloatImage::load(path)?;
        if let Some(background) = self.background
            && is_opaque(&image)
        {
            // Files hold bytes: their values are multiples of 1/255 in single precision, as those of the option.
            image.cover_where_not(background);
        }
        Ok(image)
    }

    fn report(
        &self,
        reference: &FloatImage,
        picture: &FloatImage,
    ) -> Result<CompareReport, CommandFailure> {
        let has_coverage = self.background.is_some()
            || !is_opaque(reference)
            || !is_opaque(picture)
            || (tells_coverage(&self.reference, reference)
                && tells_coverage(&self.picture, picture));
        let files = [
            PictureChannels::load(&self.reference)?,
            PictureChannels::load(&self.picture)?,
        ];
        let names = [&self.reference, &self.picture].map(|path| path.display().to_string());
        let channels = compare_channels([&files[0], &files[1]], [&names[0], &names[1]]);
        let has_colors = files.iter().all(PictureChannels::has_colors);
        let has_normals = |image: &FloatImage| !image.normal.is_empty();
        let measured = || -> Result<CompareReport, surfel::image::Error> {
            Ok(CompareReport {
                size: reference.size(),
                flip: 0.0,
                ssim: ssim(reference, picture)?,
                difference: compare(reference, picture, LEVEL)?,
                worst: worst_tile(reference, picture, self.tile)?,
                shape: match has_coverage {
                    true => Some((
                        measure::coverage(reference, picture)?,
                        measure::silhouette(reference, picture)?,
                    )),
                    false => None,
                },
                channels: channels.clone(),
                has_colors,
                normals: (has_normals(reference) && has_normals(picture))
                    .then(|| measure::normal_error(&reference.normal, &picture.normal)),
            })
        };
        let mut report = measured()?;
        let map = flip(reference, picture, self.pixels_per_degree)?;
        report.flip = map.mean;
        if let Some(path) = &self.flip_map {
            flip_picture(reference.size(), &map.map).save_png(path)?;
        }
        if let Some(path) = &self.difference {
            difference_picture(reference, picture, self.gain)?.save_png(path)?;
        }
        if let Some(path) = &self.worst {
            worst_sheet(reference, picture, &report.worst)?.save_png(path)?;
        }
        Ok(report)
    }
}

fn is_opaque(image: &FloatImage) -> bool {
    image.color.iter().all(|c| c[3] >= 1.0)
}

/// Tells whether alpha means something: a PNG file that is opaque everywhere is one without alpha, for all that is known.
fn tells_coverage(path: &Path, image: &FloatImage) -> bool {
    !is_opaque(image) || super::render::ending(path) == "exr"
}

/// FLIP values as levels of gray.
fn flip_picture([width, height]: [u32; 2], map: &[f32]) -> Image {
    Image {
        width,
        height,
        color: map
            .iter()
            .map(|v| {
                let level = surfel::image::unorm8(f64::from(*v));
                [level, level, level, 255]
            })
            .collect(),
        ..Image::default()
    }
}

/// The worst place of both pictures and their difference, side by side.
fn worst_sheet(
    reference: &FloatImage,
    picture: &FloatImage,
    tile: &PictureTile,
) -> Result<Image, surfel::image::Error> {
    let enlarge = (256 / tile.width.max(tile.height).max(1)).max(1);
    let difference = difference_picture(reference, picture, 1.0)?;
    Ok(contact_sheet(
        &[
            (
                format!("reference {},{}", tile.x, tile.y),
                crop(reference, tile, enlarge),
            ),
            ("picture".into(), crop(picture, tile, enlarge)),
            ("difference".into(), crop(&difference, tile, enlarge)),
        ],
        3,
    ))
}

pub(crate) fn run(args: CompareArgs) -> Outcome {
    args.check()?;
    let (reference, picture) = (args.load(&args.reference)?, args.load(&args.picture)?);
    if reference.size() != picture.size() {
        let shown = |path: &Path, image: &FloatImage| {
            format!("{} has {} x {}", path.display(), image.width, image.height)
        };
        return Err(usage(format!(
            "pictures of different sizes cannot be compared: {} pixels, {}",
            shown(&args.reference, &reference),
            shown(&args.picture, &picture)
        )));
    }
    let report = args.report(&reference, &picture)?;
    let missed = report.missed(&args.bounds)?;
    if args.json {
        let text = serde_json::to_string_pretty(&report.json())
            .map_err(|e| CommandFailure::Run(e.into()))?;
        print(&(text + "\n"))?;
    } else {
        print(&report.text())?;
    }
    match missed {
        None => Ok(()),
        Some(what) => Err(CommandFailure::Run(anyhow::anyhow!(
            "{}: {what}",
            args.picture.display()
        ))),
    }
}
