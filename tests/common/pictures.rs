//! Picture oracles: what may differ between two pictures that should be the same, in how many pixels, and why.
//!
//! All tests that compare pictures take their tolerances from here. An oracle is a list of rules, and each rule counts
//! the pixels that break it. `tests/device/pictures.rs` sees every oracle and every rule fail.

use glam::Vec3;
use surfel::gpu::Error;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::render::PictureOutputs;
use surfel::render::Settings;
use surfel::render::engine::{Backend, Engine};
use surfel::tree::Model;

/// Depths beside the color, and normals where `has_normals`.
pub(crate) fn with_depth(has_normals: bool) -> PictureOutputs {
    PictureOutputs {
        depth: true,
        normal: has_normals,
        values: false,
    }
}

/// The picture that a new engine draws. The reference snaps positions to as many bits as the device of the test has.
pub(crate) fn draw(
    backend: &Backend,
    model: &Model,
    view: &View,
    settings: &Settings,
    outputs: PictureOutputs,
) -> Result<Image, Error> {
    let engine = Engine::new(backend, model, (view.width, view.height), outputs)?;
    let mut engine = match backend {
        Backend::Reference => engine.with_subpixel_bits(super::subpixel_bits()),
        _ => engine,
    };
    engine.render(view, settings)
}

/// A property of a pixel in which two pictures may differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PixelAspect {
    /// Red, green or blue, by more than so many levels of 255.
    Color(u8),
    /// The covered fraction, by more than so many levels of 255.
    Coverage(u8),
    /// The view-space depth, in any bit.
    DepthBits,
    /// The view-space depth, by more than this share of it; or finite in one picture alone.
    DepthShare(f32),
    /// The view-space depth, by more than this share of the width of a pixel at the far plane; or finite in one picture
    /// alone.
    DepthFootprint(f32),
    /// The view-space depth, by more than 2e-5 of it and 1/32 of the steepest step to a neighbor; or finite in one
    /// picture alone.
    DepthSlope,
    /// The normal, in any bit.
    NormalBits,
    /// The normal, by more than this length.
    Normal(f32),
    /// Any of these.
    Any(&'static [PixelAspect]),
}

/// How many pixels may break a rule: `pixels`, and `share` of all pixels or of those that are covered, rounded down. Where a
/// share may, a tenth of the covered ones may besides on a graphics card ([`is_card`](super::is_card)): on an NVIDIA H200
/// 828 of 11,186 did at most, along the borders of squares of sizes of their own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelAllowance {
    pub(crate) pixels: usize,
    pub(crate) share: f64,
    pub(crate) of_covered: bool,
}

/// One rule of an oracle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PictureRule {
    pub(crate) aspect: PixelAspect,
    pub(crate) allowed: PixelAllowance,
}

/// What decides whether a picture is the wanted one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PictureOracle {
    /// Name of the constant.
    pub(crate) name: &'static str,
    /// All of these must hold.
    pub(crate) rules: &'static [PictureRule],
    /// The wanted picture covers more pixels than this, since an empty picture proves nothing.
    pub(crate) more_than: usize,
    /// Width of a pixel at the far plane, model units; NaN where [`PictureOracle::seen_in`] has not told it.
    footprint: f32,
}

const fn no_pixel(aspect: PixelAspect) -> PictureRule {
    picture_share(aspect, 0, 0.0)
}

/// `pixels`, and a share of all pixels.
const fn picture_share(aspect: PixelAspect, pixels: usize, share: f64) -> PictureRule {
    PictureRule {
        aspect,
        allowed: PixelAllowance {
            pixels,
            share,
            of_covered: false,
        },
    }
}

/// `pixels`, and a share of the covered pixels of the wanted picture.
const fn covered_share(aspect: PixelAspect, pixels: usize, share: f64) -> PictureRule {
    PictureRule {
        aspect,
        allowed: PixelAllowance {
            pixels,
            share,
            of_covered: true,
        },
    }
}

use PixelAspect::{
    Any, Color, Coverage, DepthBits, DepthFootprint, DepthShare, DepthSlope, Normal, NormalBits,
};

/// Another color or coverage: by more than one level, which is what rounding alone can give.
const LOOK: PixelAspect = Any(&[Color(1), Coverage(1)]);

/// Defines each oracle as a constant, and `ALL` of them.
macro_rules! oracles {
    ($($(#[$doc:meta])* $name:ident: $more_than:literal, $rules:expr;)*) => {
        $($(#[$doc])*
        pub(crate) const $name: PictureOracle = PictureOracle {
            name: stringify!($name),
            rules: $rules,
            more_than: $more_than,
            footprint: f32::NAN,
        };)*

        /// Every oracle.
        pub(crate) const ALL: &[PictureOracle] = &[$($name),*];
    };
}

oracles! {
    /// The same picture to the bit: the same work in the same order, or work whose result does not depend on it.
    SAME_BITS: 0, &[
        no_pixel(Color(0)), no_pixel(Coverage(0)), no_pixel(DepthBits), no_pixel(NormalBits),
    ];

    // Executors of one device.

    /// Compute and rasterizer. Colors differ where two surfaces tie or an edge runs through a pixel center: 0.01 percent
    /// of the pixels, and one. Depths: rasterizers interpolate that of a tiny triangle from where the picture begins, in
    /// single precision, and of a triangle seen edge-on a step of 1/256 pixel is more than a hundredth of a footprint.
    COMPUTE_AS_RASTER: 100, &[
        picture_share(LOOK, 1, 1e-4),
        picture_share(DepthFootprint(0.01), 1, 1e-3),
        picture_share(Normal(2e-3), 1, 7e-4),
    ];
    /// As [`COMPUTE_AS_RASTER`], beside splats that are blended: corners are pushed away by one to ten half thresholds,
    /// which over a triangle that is as large as a threshold is a slope of 4.5 footprints a pixel, and more where it is
    /// thinner: some hundredths over a few steps.
    COMPUTE_AS_RASTER_PUSHED: 100, &[
        picture_share(LOOK, 1, 1e-4),
        picture_share(DepthFootprint(0.05), 1, 1e-3),
        picture_share(Normal(2e-3), 1, 7e-4),
    ];
    /// Triangles handed over as samples, and the rasterizer's: the same pixels; two pixels where surfaces tie; depths as
    /// in [`COMPUTE_AS_RASTER`].
    SAMPLES_AS_RASTER: 500, &[
        picture_share(Color(1), 2, 0.0),
        no_pixel(Coverage(0)),
        picture_share(DepthFootprint(0.05), 1, 1e-3),
    ];
    /// Opaque splats by the processor's renderer and by compute, no triangles beside them: depths and coverage to the bit.
    /// Where a value lies in the middle between two of 255, the last place of a root decides, which a shader may find
    /// otherwise: some of 10,000 pixels.
    CPU_AS_COMPUTE: 0, &[
        picture_share(Color(0), 0, 5e-4),
        no_pixel(Color(1)),
        no_pixel(Coverage(0)),
        no_pixel(DepthBits),
    ];
    /// The processor's renderer and a device. For splats alone there is CPU_AS_COMPUTE. Where a value lies in the middle between two of 255, the last place of a root
    /// decides. A rasterizer interpolates the depth of a large triangle
    /// from a place some steps of 1/256 pixel away, which on what is seen edge-on is a thousandth in one of 1000 pixels; and
    /// so it hides other splats: another color in one of 10,000.
    CPU_AS_DEVICE: 0, &[
        picture_share(Any(&[Color(1), Coverage(1)]), 1, 1e-4),
        picture_share(DepthShare(1e-3), 1, 1e-3),
    ];
    /// Large splats by the processor and by the rasterizer. Depths that are the same but for their last place decide between
    /// splats, and samples of triangles between the rasterizer's: 0.01 percent of the pixels, and two. A last place of a size moves
    /// an edge of a large square by a pixel: one of 24 pixels.
    CPU_LARGE_AS_RASTER: 100, &[
        picture_share(LOOK, 26, 1e-4),
        picture_share(DepthShare(1e-3), 26, 1e-4),
    ];
    /// Many surfaces at exactly the same distance: which is seen may differ in single pixels.
    EQUALLY_FAR: 100, &[
        picture_share(Any(&[LOOK, DepthShare(1e-3)]), 4, 1e-6),
    ];
    /// The same primitives, by whatever costs chose: as [`COMPUTE_AS_RASTER`].
    ANY_COSTS: 100, &[
        picture_share(LOOK, 1, 1e-4),
    ];
    /// Quads in the place of points: corners of a quad are snapped one by one, a point as a whole; of equally deep splats the
    /// first drawn wins, and quads are drawn last.
    QUADS_AS_POINTS: 100, &[
        picture_share(LOOK, 1, 4e-3),
    ];
    /// A cut that the device chose, whose lists are in no order: the same coverage, the same nearest depths; colors but
    /// where two surfaces are equally near.
    DEVICE_CUT: 0, &[
        no_pixel(Coverage(0)),
        no_pixel(DepthBits),
        picture_share(Color(1), 1, 1e-3),
    ];
    /// The same of splats with sizes of their own. Squares as large as their leaves are parallel to the picture: of two that are
    /// equally near the first of the list wins in all pixels that both cover, and threads write the list in any order: 109 of
    /// 14,562 pixels were seen, in one of four runs. Coverage and depths are the same whichever wins.
    DEVICE_SPLATS: 0, &[
        no_pixel(Coverage(0)),
        no_pixel(DepthBits),
        picture_share(Color(1), 1, 5e-2),
    ];
    /// Filtered splats of such a cut: they are summed in the order of the list, so sums differ in their last places. Nothing more
    /// was seen; of what a limit decides single pixels may be others.
    DEVICE_FILTERED: 0, &[
        no_pixel(DepthBits),
        picture_share(LOOK, 1, 1e-4),
    ];
    /// Records that the device made of ids where its roots round otherwise than the host's.
    IDS_ROUNDED: 0, &[
        picture_share(LOOK, 1, 1e-3),
    ];
    /// The same triangles through another transform of the same place: the last bit of what is interpolated differs, so a
    /// gray value on the border of two levels can fall to the other in one of 5,000 pixels.
    ALMOST_EQUAL: 0, &[
        no_pixel(Coverage(0)),
        no_pixel(Color(1)),
        covered_share(Color(0), 1, 2e-4),
    ];
    /// Triangles by the passes of blended splats, none of which are there, and by their own: single pixels of the outline,
    /// since the guard band changes last bits.
    BLENDED_TRIANGLES: 100, &[
        picture_share(LOOK, 20, 0.0),
    ];
    /// A held cut in the view it was chosen in: sizes come out of a division, and backs count.
    HELD_CUT: 0, &[
        covered_share(LOOK, 0, 0.01),
    ];
    /// As [`HELD_CUT`]: filtered splats of what faces away are dropped one by one, but not where they may be seen from
    /// behind.
    HELD_CUT_FILTERED: 0, &[
        covered_share(LOOK, 0, 1.0 / 6.0),
    ];

    // The device against the reference.

    /// Surfaces by triangles, points and squares. The last bit of a vertex position moves a snapped edge by 1/256 pixel, so
    /// about 1/128 of the pixels on edges can change sides; where two surfaces tie in depth either may win. Depths:
    /// single precision of a reversed buffer resolves about 1e-6 of the distance; and the device interpolates between
    /// corners that are not snapped, the reference between snapped ones.
    REFERENCE_SURFACE: 0, &[
        covered_share(LOOK, 2, 0.003),
        covered_share(DepthSlope, 2, 0.003),
        covered_share(Normal(4e-3), 2, 0.003),
    ];
    /// As [`REFERENCE_SURFACE`], for scans and layered models, which have more edges and more ties.
    REFERENCE_LAYERS: 0, &[
        covered_share(LOOK, 2, 0.006),
        covered_share(DepthSlope, 2, 0.006),
        covered_share(Normal(4e-3), 2, 0.006),
    ];
    /// As [`REFERENCE_SURFACE`], for needles, which are all edge.
    REFERENCE_NEEDLES: 0, &[
        covered_share(LOOK, 2, 0.01),
        covered_share(DepthSlope, 2, 0.01),
        covered_share(Normal(4e-3), 2, 0.01),
    ];
    /// Opaque discs and ellipses. The last bit of a position moves the outline of a footprint by about 1e-4 of a pixel and
    /// the pixel of a small one by 1/256.
    REFERENCE_SPLATS: 50, &[
        covered_share(Any(&[LOOK, DepthShare(1e-3), Normal(4e-3)]), 2, 0.004),
    ];
    /// As [`REFERENCE_SPLATS`]. Squares of any size are snapped to 1/256 pixel in two ways, and all their borders show. The
    /// two triangles of a cell of a grid have the same sphere but for the last bit: where each is a splat, rounding decides
    /// which is nearer.
    REFERENCE_SNAPPED_SPLATS: 50, &[
        covered_share(Any(&[LOOK, DepthShare(1e-3), Normal(4e-3)]), 2, 0.012),
    ];
    /// Blended splats. A fragment at the very limit of the offset is in for one and out for the other: the pushed depth is
    /// single precision in both, with other roundings.
    REFERENCE_BLENDED: 50, &[
        covered_share(Any(&[LOOK, DepthShare(1e-3), Normal(4e-3)]), 2, 0.008),
    ];
    /// Filtered splats: as [`REFERENCE_BLENDED`]. At a rim the neighbors of such a pixel look at it, so one is four that
    /// differ.
    REFERENCE_FILTERED: 100, &[
        covered_share(Any(&[LOOK, DepthShare(1e-3)]), 4, 0.002),
    ];
    /// Opaque discs and ellipses in large pictures: the last bit of a position moves an outline by about a ten-thousandth of
    /// a pixel.
    REFERENCE_OUTLINES: 100, &[
        picture_share(Any(&[LOOK, DepthShare(1e-3)]), 1, 1e-4),
    ];
    /// Classes of visibility splats. The last bit of a position moves a snapped edge or center by 1/256 pixel: about 1/128
    /// of the pixels on edges, and all centers are edges.
    REFERENCE_CLASSES: 100, &[
        covered_share(Any(&[Color(0), Coverage(0)]), 2, 0.004),
    ];
    /// What visibility splats reconstruct, away from pixels of another class. Where two depths are equal but for rounding
    /// either wins.
    REFERENCE_RECONSTRUCTION: 100, &[
        covered_share(LOOK, 2, 0.004),
        covered_share(DepthShare(1e-3), 2, 0.004),
        covered_share(Normal(4e-3), 2, 0.004),
    ];
    /// The light of a lamp: a snapped edge moves by 1/256 pixel; where n . v is all but at its limit, the last bit decides
    /// which side is seen.
    REFERENCE_LAMP: 2000, &[
        covered_share(LOOK, 2, 0.003),
    ];
    /// Data as colors, which has strong steps at all edges of primitives: as [`REFERENCE_SURFACE`], and twice the share of
    /// pixels on edges.
    REFERENCE_DATA: 5000, &[
        covered_share(LOOK, 0, 1.0 / 64.0),
    ];

    // Kept pictures.

    /// A device and a kept picture. The same driver draws the same bits. Code made for another CPU or by another version of
    /// the driver rounds a last bit otherwise: 7 of 250,000 pixels were off by one level where AVX and FMA were missing. One
    /// level everywhere, and a thousandth of the picture for edges that change sides, leave room for other drivers.
    GOLDEN_DEVICE: 0, &[
        picture_share(Color(1), 0, 1e-3),
        picture_share(Coverage(1), 0, 1e-3),
    ];
    /// A device that cuts by itself and a kept picture. Its threads write the list in the order in which they end, and of two equally
    /// deep squares the first of the list wins: at most 18 pixels were seen, on a busy machine. As many again.
    GOLDEN_DEVICE_CUT: 0, &[
        picture_share(Color(1), 20, 1e-3),
        picture_share(Coverage(1), 20, 1e-3),
    ];
    /// The reference and a kept picture. It rounds nothing as a device does: [`REFERENCE_NEEDLES`] grants a hundredth of
    /// the covered pixels where all is edge, here half of the picture.
    GOLDEN_REFERENCE: 0, &[
        picture_share(Color(1), 0, 5e-3),
        picture_share(Coverage(1), 0, 5e-3),
    ];
    /// Error patches of the processor and a kept picture of a device. Margins of patches end square there, and of two
    /// patches that are equally near the last bit of a depth decides: up to 85 of 16,384 pixels are of another patch.
    GOLDEN_PATCHES: 0, &[
        picture_share(Color(1), 0, 7e-3),
        picture_share(Coverage(1), 0, 1e-3),
    ];
}

impl PictureOracle {
    /// The oracle for pictures of this view: [`PixelAspect::DepthFootprint`] needs it.
    pub(crate) fn seen_in(self, view: &View) -> Self {
        Self {
            footprint: view.far / view.focal_px(),
            ..self
        }
    }

    /// One line of what differs; an error that names the broken rules when it is more than allowed.
    pub(crate) fn judge(&self, wanted: &Image, got: &Image) -> Result<String, String> {
        let sizes = [wanted, got].map(|image| (image.width, image.height));
        if sizes[0] != sizes[1] {
            return Err(format!("{}: sizes {sizes:?}", self.name));
        }
        let lengths = |image: &Image| [image.color.len(), image.depth.len(), image.normal.len()];
        if lengths(wanted) != lengths(got) {
            return Err(format!("{}: other outputs", self.name));
        }
        let covered = wanted.covered_pixels() as usize;
        let mut line = format!("{}: {covered} covered", self.name);
        let mut is_broken = false;
        if covered <= self.more_than {
            line += &format!(", more than {} wanted: nothing to see", self.more_than);
            is_broken = true;
        }
        for rule in self.rules {
            let all = 0..wanted.color.len();
            let differ = all.filter(|&i| self.differs(rule.aspect, wanted, got, i));
            let (differ, allowed) = (differ.count(), rule.allowed.of(wanted));
            line += &format!("; {:?}: {differ} of {allowed} allowed", rule.aspect);
            if differ > allowed {
                line += " BROKEN";
                is_broken = true;
            }
        }
        if is_broken { Err(line) } else { Ok(line) }
    }

    /// Panics with `what` and the counts where [`PictureOracle::judge`] says no. Leaves both pictures in the folder that
    /// `SURFEL_KEEP` names.
    #[track_caller]
    pub(crate) fn assert_same(&self, wanted: &Image, got: &Image, what: &str) {
        match self.judge(wanted, got) {
            Ok(line) => println!("{what}: {line}"),
            Err(line) => {
                if let Some(folder) = std::env::var_os("SURFEL_KEEP") {
                    let folder = std::path::PathBuf::from(folder);
                    wanted.save_png(&folder.join("wanted.png")).unwrap();
                    got.save_png(&folder.join("got.png")).unwrap();
                }
                panic!("{what}: {line}");
            }
        }
    }

    fn differs(&self, aspect: PixelAspect, wanted: &Image, got: &Image, i: usize) -> bool {
        let far_apart = |allowed: &dyn Fn(f32) -> f32| {
            let depths = wanted.depth.get(i).zip(got.depth.get(i));
            depths.is_some_and(|(&a, &b)| {
                a.is_finite() != b.is_finite() || a.is_finite() && (a - b).abs() > allowed(a)
            })
        };
        let (a, b) = (wanted.color[i], got.color[i]);
        let normals = || wanted.normal.get(i).zip(got.normal.get(i));
        match aspect {
            Color(levels) => (0..3).any(|c| a[c].abs_diff(b[c]) > levels),
            Coverage(levels) => a[3].abs_diff(b[3]) > levels,
            DepthBits => {
                let depths = wanted.depth.get(i).zip(got.depth.get(i));
                depths.is_some_and(|(a, b)| a.to_bits() != b.to_bits())
            }
            DepthShare(share) => far_apart(&|depth| share * depth),
            DepthFootprint(share) => {
                assert!(self.footprint > 0.0, "{}: in which view?", self.name);
                far_apart(&|_| share * self.footprint)
            }
            DepthSlope => far_apart(&|depth| 2e-5 * depth + steepest_step(wanted, i) / 32.0),
            NormalBits => {
                normals().is_some_and(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits))
            }
            Normal(length) => normals().is_some_and(|(&a, &b)| {
                let apart = (Vec3::from(a) - Vec3::from(b)).length();
                apart.is_nan() || apart > length
            }),
            Any(aspects) => aspects.iter().any(|&one| self.differs(one, wanted, got, i)),
        }
    }
}

impl PixelAllowance {
    /// In a picture.
    pub(crate) fn of(&self, wanted: &Image) -> usize {
        let all = if self.of_covered {
            wanted.covered_pixels() as usize
        } else {
            wanted.color.len()
        };
        let of_card = match super::is_card() && self.share > 0.0 {
            true => wanted.covered_pixels() as usize / 10,
            false => 0,
        };
        self.pixels + (self.share * all as f64) as usize + of_card
    }
}

/// The largest finite difference of depth to the pixels left, right, above and below.
fn steepest_step(image: &Image, i: usize) -> f32 {
    let (width, count) = (image.width as usize, image.color.len());
    let x = i % width;
    [
        (x > 0).then(|| i - 1),
        (x + 1 < width).then_some(i + 1),
        i.checked_sub(width),
        (i + width < count).then_some(i + width),
    ]
    .into_iter()
    .flatten()
    .map(|n| (image.depth[n] - image.depth[i]).abs())
    .filter(|step| step.is_finite())
    .fold(0.0, f32::max)
}
