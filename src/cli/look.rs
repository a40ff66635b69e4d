//! The options that decide how a model looks, shared by every command that draws.

use super::background::BackgroundArgs;
use super::color_choice::{ColorByName, ColorChoice};
use super::darkening::DarkeningArgs;
use super::error_patches::ErrorArgs;
use super::light::LightArgs;
use super::vertex_splats::VertexSplatArgs;
use super::{CommandFailure, usage};
use clap::builder::Resettable;
use clap::{Args as ClapArgs, Command, FromArgMatches, ValueEnum};
use std::ffi::OsString;
use surfel::cut::SizeMetric;
use surfel::input::PointColoring;
use surfel::pack::ColorBy;
use surfel::render::{
    Blend, Culling, CutOn, CutTraversal, ListOf, Method, Occlusion, Path, Reconstruction, Settings,
    Shading, SplatKind, SumFormat,
};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Every triangle: the reference
    Triangles,
    /// Every vertex as a splat of the threshold's size
    Points,
    /// Splats only, also where triangles are large on screen
    Splats,
    /// Triangles where large on screen, splats where small
    Pop,
    /// In surfel render: what keeps --max-error or --frame-ms, by a calibration of this device
    Auto,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Triangles => Self::Triangles,
            MethodName::Points => Self::Points,
            MethodName::Splats => Self::Splats,
            // What is chosen takes its place.
            MethodName::Pop | MethodName::Auto => Self::Pop,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CullingName {
    /// Drop what faces away on closed surfaces
    Auto,
    /// Always drop what faces away
    On,
    /// Draw both sides
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SplatName {
    /// Squares that face the viewer
    Square,
    /// Discs that face the viewer
    Disc,
    /// Discs in the plane of the surface, seen in perspective
    Ellipse,
    /// As ellipse, fading outward as a Gaussian; blended in two passes
    Gauss,
    /// Visible centers, and a reconstruction of the picture between them
    Visibility,
    /// Squares that deposit the area they cover: smooth rims, the mean of what is under a pixel
    Filtered,
}

impl From<SplatName> for SplatKind {
    fn from(name: SplatName) -> Self {
        match name {
            SplatName::Square => Self::Square,
            SplatName::Disc => Self::Disc,
            SplatName::Ellipse => Self::Ellipse,
            SplatName::Gauss => Self::Gauss,
            SplatName::Visibility => Self::Visibility,
            SplatName::Filtered => Self::Filtered,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum BlendName {
    /// The nearest splat wins
    Opaque,
    /// The weighted mean of all splats within the depth offset of the front
    TwoPass,
    /// One pass with a depth threshold, for comparison; with --backend reference
    DepthThreshold,
    /// One pass with a depth range a pixel, for comparison; with --backend reference
    DepthRange,
}

impl From<BlendName> for Blend {
    fn from(name: BlendName) -> Self {
        match name {
            BlendName::Opaque => Self::Opaque,
            BlendName::TwoPass => Self::TwoPass,
            BlendName::DepthThreshold => Self::DepthThreshold,
            BlendName::DepthRange => Self::DepthRange,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ShadingName {
    /// Once a splat
    PerSplat,
    /// Once a pixel, from blended normals
    Deferred,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SumName {
    /// 16-bit floats
    Half,
    /// 32-bit floats
    Float,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PathName {
    /// Compute shaders where the device and the splats allow it and they are cheaper, by what was measured on the device
    Auto,
    /// The rasterizer alone
    Raster,
    /// Compute shaders; an error where they cannot
    Compute,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CutOnName {
    /// The device where it can and was measured to be faster, else the processor
    Auto,
    /// The processor
    #[value(alias = "host")]
    Processor,
    /// The device; an error where it cannot
    Device,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum TraversalName {
    /// Where it was measured to be faster: at the root
    Auto,
    /// At the root
    Root,
    /// Where the traversal of the last frame ended (coherent traversal), as far as that gives the same picture, else at the root
    Coherent,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ListOfName {
    /// Ids where the device has memory of its own and they suffice, else records
    Auto,
    /// Ids of nodes and triangles, from which the device makes the records; an error where it cannot
    Ids,
    /// Centers, normals and colors of splats, corners of triangles
    Records,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum OcclusionName {
    /// Leave hidden splats out where that saves time
    Auto,
    /// Leave hidden splats out wherever it can be told: of squares and discs that are not blended
    On,
    /// Draw hidden splats too
    Off,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ReconstructionName {
    /// A Gaussian of the threshold's radius
    Gaussian,
    /// A Gaussian whose radius follows the density of centers
    Density,
    /// Pull-push over a pyramid of half sizes
    PullPush,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SizeName {
    /// The longer axis of the ellipse that its sphere covers
    Exact,
    /// Diameter over distance of the center along the view direction
    Center,
    /// Diameter over distance of the nearest point along the view direction
    Nearest,
    /// Twice the tangent of half the angle it is seen under
    Angle,
    /// Diameter of the circle of the ellipse's area
    Area,
}

impl From<SizeName> for SizeMetric {
    fn from(name: SizeName) -> Self {
        match name {
            SizeName::Exact => Self::Exact,
            SizeName::Center => Self::Center,
            SizeName::Nearest => Self::Nearest,
            SizeName::Angle => Self::Angle,
            SizeName::Area => Self::Area,
        }
    }
}

/// How the model is drawn.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct LookArgs {
    /// How the model is drawn
    #[arg(long, short, value_enum, default_value = "pop")]
    method: MethodName,
    /// Draw a node as a splat once it is this small on screen, and splats and points this large; pixels. Squares and discs of pop of
    /// 1 to 1.5 are drawn as 1, which is faster and more exact [default: 1, or the scene's]
    #[arg(long, short, value_name = "PIXELS")]
    threshold: Option<f32>,
    /// Shape of a splat [default: square; on points in surfel render and the window ellipse]
    #[arg(long, value_enum)]
    splat: Option<SplatName>,
    #[command(flatten)]
    vertex_splats: VertexSplatArgs,
    #[command(flatten)]
    errors: ErrorArgs,
    /// How splats that overlap become one surface [default: two-pass for gauss, else opaque]
    #[arg(long, value_enum)]
    blend: Option<BlendName>,
    /// When blended splats are lit
    #[arg(long, value_enum, default_value = "per-splat")]
    splat_shading: ShadingName,
    /// Floats that blended splats are summed in [default: float where the device can blend them, else half]
    #[arg(long, value_enum)]
    sums: Option<SumName>,
    /// Blended gauss splats: standard deviation of the Gaussian that smooths their rims [default: 0.3]
    #[arg(long, value_name = "PIXELS")]
    low_pass: Option<f32>,
    /// How visibility splats are reconstructed
    #[arg(long, value_enum, default_value = "gaussian")]
    reconstruct: ReconstructionName,
    /// Where splats are blended: how far behind the front a surface still counts as one with it, in radii of a splat [default: 3 for filtered, 2 of these where nothing is culled; else 1]
    #[arg(long, value_name = "FACTOR")]
    depth_offset: Option<f32>,
    /// What draws splats and triangles of a few pixels on a device; the picture is the same. Compute knows squares, discs and
    /// ellipses of --method pop, and blended, filtered and visibility splats of pop and splats
    #[arg(long, value_enum, default_value = "auto")]
    path: PathName,
    /// Traversal of the tree by the processor or the device; the picture is the same. The device knows all splats of --method pop and splats
    #[arg(long, value_enum, default_value = "auto")]
    cut_on: CutOnName,
    /// Where the CPU starts when it goes down the tree for a frame; the picture is the same
    #[arg(long, value_enum, default_value = "auto")]
    traversal: TraversalName,
    /// What goes to a device for each frame; the picture is the same
    #[arg(long, value_enum, default_value = "auto")]
    list_of: ListOfName,
    /// Whether splats that nearer splats hide are left out; the picture is the same
    #[arg(long, value_enum, default_value = "auto")]
    occlusion: OcclusionName,
    /// What the size of a node on screen is
    #[arg(long, value_enum, default_value = "exact")]
    size_metric: SizeName,
    /// Whether what faces away is dropped
    #[arg(long, value_enum, default_value = "auto")]
    culling: CullingName,
    #[command(flatten)]
    pub(crate) darkening: DarkeningArgs,
    /// Source of the color: shading (light and vertex colors), primitive (splats red, triangles blue, patches green); not lit: level (of the tree, the root dark), normal, depth (near bright), overdraw (from 1, dark violet, over 8 to 64, yellow); classification of visibility splats; or, of points, height, intensity, class, return, time or another attribute that `surfel info` lists
    #[arg(long, value_name = "WHAT", default_value = "shading", value_parser = str::parse::<ColorChoice>)]
    color_by: ColorChoice,
    #[command(flatten)]
    light: LightArgs,
    /// Light front sides only
    #[arg(long)]
    one_sided: bool,
    /// Ignore vertex colors
    #[arg(long)]
    no_colors: bool,
    #[command(flatten)]
    pub(crate) background: BackgroundArgs,
}

impl LookArgs {
    /// Takes the threshold of a scene where none is given.
    pub(crate) fn default_threshold(&mut self, pixels: f32) {
        self.threshold.get_or_insert(pixels);
    }

    /// Varies the look by the options in `text` (separated by blanks), which replace what it says otherwise.
    pub(crate) fn varied(&self, text: &str) -> Result<Self, CommandFailure> {
        // Without default values only what is written comes out; flags can be added and not taken back.
        let mut command =
            Self::augment_args_for_update(Command::new("--with").no_binary_name(true))
                .disable_help_flag(true)
                .mut_args(|arg| arg.default_value(Resettable::Reset));
        let mut look = self.clone();
        let words = super::renamed::in_words(text.split_whitespace().map(OsString::from).collect());
        let parsed = command.try_get_matches_from_mut(words);
        parsed
            .and_then(|mut matches| look.update_from_arg_matches_mut(&mut matches))
            .map_err(|error| {
                let error = error.render().to_string();
                // What follows the first paragraph speaks of a command of its own.
                let what = error.split("\n\n").next().unwrap_or_default();
                let what = what.trim_start_matches("error: ").replace('\n', " ");
                usage(format!("--with {text:?}: {what}"))
            })?;
        look.one_sided |= self.one_sided;
        look.no_colors |= self.no_colors;
        Ok(look)
    }

    /// Takes the looks that show shape best, for what a person looks at, where nothing is said of them.
    pub(crate) fn default_for_people(&mut self) {
        self.darkening.default_for_people();
        self.light.default_for_people();
    }

    /// Takes what colors the points of a cloud, if that was asked for: then light falls on those colors.
    pub(crate) fn take_point_color(&mut self) -> Option<PointColoring> {
        let shading = ColorChoice::Picture(ColorByName::Shading);
        match std::mem::replace(&mut self.color_by, shading) {
            ColorChoice::Points(by) => Some(by),
            picture @ ColorChoice::Picture(_) => {
                self.color_by = picture;
                None
            }
        }
    }

    /// Look that colors the picture.
    ///
    /// # Errors
    /// When points are to be colored, which this command does not do.
    fn picture_color(&self) -> Result<ColorByName, CommandFailure> {
        match &self.color_by {
            ColorChoice::Picture(name) => Ok(*name),
            ColorChoice::Points(_) => Err(usage(
                "--color-by: expected shading, primitive, classification, level, normal, depth or overdraw; height and attributes color points in surfel render and the window",
            )),
        }
    }

    /// Takes discs in the plane of the surface, for points that a person looks at, where no splat is named: squares of several pixels are
    /// boxes, and discs that face the viewer are coins beyond the outline.
    pub(crate) fn default_ellipses(&mut self) {
        if self.method == MethodName::Pop {
            self.splat.get_or_insert(SplatName::Ellipse);
        }
    }

    /// Tells whether neither a method nor a splat is named, as far as that can be told.
    pub(crate) fn has_usual_shapes(&self) -> bool {
        self.method == MethodName::Pop && self.splat.is_none()
    }

    /// Draws points as dots of this size, unless a size is given.
    pub(crate) fn default_dots(&mut self, pixels: f32) {
        self.method = MethodName::Points;
        self.default_threshold(pixels);
    }

    /// Tells whether a splat is named.
    #[cfg(feature = "viewer")]
    pub(crate) fn names_splat(&self) -> bool {
        self.splat.is_some()
    }

    /// Tells whether the method follows from a bound.
    pub(crate) fn is_auto(&self) -> bool {
        self.method == MethodName::Auto
    }

    /// The settings; of [`Self::is_auto`] only for a command that then chooses.
    pub(crate) fn settings_to_choose(&self) -> Result<Settings, CommandFailure> {
        let settings = self.all_settings()?;
        let usual = Settings::default();
        if self.is_auto()
            && (self.threshold.is_some()
                || settings.splat != usual.splat
                || settings.path != usual.path
                || settings.patches.is_some()
                || settings.blend.is_some()
                || settings.shading != usual.shading)
        {
            return Err(usage(
                "--method auto chooses threshold, splat, path, error, blend and shading; leave these options out",
            ));
        }
        Ok(settings)
    }

    pub(crate) fn settings(&self) -> Result<Settings, CommandFailure> {
        if self.is_auto() {
            return Err(usage("--method auto is for surfel render"));
        }
        self.all_settings()
    }

    fn all_settings(&self) -> Result<Settings, CommandFailure> {
        let threshold = self.threshold.unwrap_or(1.0);
        if !(0.0..=4096.0).contains(&threshold) {
            return Err(usage(format!(
                "--threshold {threshold} is no size in pixels from 0 to 4096"
            )));
        }
        self.darkening.check()?;
        if let Some(factor) = self.depth_offset
            && !(0.0..=1000.0).contains(&factor)
        {
            return Err(usage(format!(
                "--depth-offset {factor} is no factor from 0 to 1000"
            )));
        }
        if let Some(pixels) = self.low_pass {
            if !(0.0..=16.0).contains(&pixels) {
                return Err(usage(format!(
                    "--low-pass {pixels} is no width in pixels from 0 to 16"
                )));
            }
            let blend = self.blend.map(Blend::from);
            if self.splat != Some(SplatName::Gauss) || blend.is_some_and(|b| b != Blend::TwoPass) {
                return Err(usage(
                    "--low-pass smooths the rims of gauss splats blended in two passes; use --splat gauss",
                ));
            }
        }
        let (background, background_bottom) = self.background.colors()?;
        Ok(Settings {
            method: self.method.into(),
            splat: self.splat.unwrap_or(SplatName::Square).into(),
            vertex_splats: self.vertex_splats.rules(self.method.into())?,
            patches: self.errors.rules(self.method.into())?,
            blend: self.blend.map(Blend::from),
            shading: match self.splat_shading {
                ShadingName::PerSplat => Shading::PerSplat,
                ShadingName::Deferred => Shading::Deferred,
            },
            sums: self.sums.map(|name| match name {
                SumName::Half => SumFormat::Half,
                SumName::Float => SumFormat::Float,
            }),
            low_pass_px: self.low_pass,
            reconstruction: match self.reconstruct {
                ReconstructionName::Gaussian => Reconstruction::Gaussian,
                ReconstructionName::Density => Reconstruction::Density,
                ReconstructionName::PullPush => Reconstruction::PullPush,
            },
            threshold_px: threshold,
            path: match self.path {
                PathName::Auto => Path::Auto,
                PathName::Raster => Path::Raster,
                PathName::Compute => Path::Compute,
            },
            cut_on: match self.cut_on {
                CutOnName::Auto => CutOn::Auto,
                CutOnName::Processor => CutOn::Processor,
                CutOnName::Device => CutOn::Device,
            },
            traversal: match self.traversal {
                TraversalName::Auto => CutTraversal::Auto,
                TraversalName::Root => CutTraversal::Root,
                TraversalName::Coherent => CutTraversal::Coherent,
            },
            list_of: match self.list_of {
                ListOfName::Auto => ListOf::Auto,
                ListOfName::Ids => ListOf::Ids,
                ListOfName::Records => ListOf::Records,
            },
            occlusion: match self.occlusion {
                OcclusionName::Auto => Occlusion::Auto,
                OcclusionName::On => Occlusion::On,
                OcclusionName::Off => Occlusion::Off,
            },
            depth_offset: self.depth_offset,
            eye_dome: self.darkening.eye_dome(),
            eye_dome_strength: self.darkening.eye_dome_strength,
            ambient_occlusion: self.darkening.ambient_occlusion(),
            ambient_occlusion_strength: self.darkening.ambient_occlusion_strength,
            ambient_occlusion_reach_px: self.darkening.ambient_occlusion_radius_px,
            photos: Default::default(),
            marks_uncovered: false,
            culling: match self.culling {
                CullingName::Auto => Culling::Auto,
                CullingName::On => Culling::On,
                CullingName::Off => Culling::Off,
            },
            color_by: match self.picture_color()? {
                ColorByName::Shading => ColorBy::Shading,
                ColorByName::Primitive => ColorBy::Primitive,
                ColorByName::Classification => ColorBy::Classification,
                ColorByName::Level => ColorBy::Level,
                ColorByName::Normal => ColorBy::Normal,
                ColorByName::Depth => ColorBy::Depth,
                ColorByName::Overdraw => ColorBy::Overdraw,
            },
            light: self.light.lighting()?,
            two_sided: !self.one_sided,
            use_colors: !self.no_colors,
            background,
            background_bottom,
            size: self.size_metric.into(),
            cut_view: None,
            section: None,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[derive(Debug, clap::Parser)]
    struct VariedLine {
        #[command(flatten)]
        look: LookArgs,
    }

    fn look(line: &[&str]) -> LookArgs {
        let words = std::iter::once(&"test").chain(line);
        <VariedLine as clap::Parser>::parse_from(words).look
    }

    #[test]
    fn a_varied_look_keeps_what_is_not_said() {
        let base = look(&["--threshold", "3", "--no-colors", "--light", "phong"]);
        let varied = base.varied(" --splat  gauss --specular 0.5 ").unwrap();
        let expected = [
            "--threshold",
            "3",
            "--no-colors",
            "--light",
            "phong",
            "--splat",
            "gauss",
            "--specular",
            "0.5",
        ];
        assert_eq!(
            varied.settings().unwrap(),
            look(&expected).settings().unwrap()
        );
        assert_eq!(
            base.varied("").unwrap().settings().unwrap(),
            base.settings().unwrap()
        );
        let other = look(&["-m", "splats", "--splat", "disc"]);
        let other = other
            .varied("-t 2 --one-sided")
            .unwrap()
            .settings()
            .unwrap();
        let expected = look(&["-m", "splats", "--splat", "disc", "-t", "2", "--one-sided"]);
        assert_eq!(other, expected.settings().unwrap());
        for wrong in ["--splat rhombus", "gauss", "--steps 3", "--help"] {
            assert!(base.varied(wrong).is_err(), "{wrong}");
        }
    }
}
