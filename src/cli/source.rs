//! The model of a command: arguments become options of [`surfel::open`].

use super::progress::JobBar;
use super::{CommandFailure, Outcome, usage};
use clap::Args;
use glam::DVec3;
use std::path::PathBuf;
use surfel::input::{self, ColorSetting, FieldCondition, PointColoring, PointFilter};
use surfel::mesh::color_legend::LegendEntries;
use surfel::mesh::creases::USUAL_CREASE_DEGREES;
use surfel::mesh::placement::MeshPlacement;
use surfel::open::PageReading;
use surfel::open::recolor;
use surfel::progress::Progress;
use surfel::render::paged_model::{FilePrefix, PagedModelOptions};
use surfel::tree::{BuildOptions, PointNormals, SplitRule};
use surfel::{OpenOptions, OpenedModel};

/// The model of a command.
#[derive(Debug, Clone, Args)]
pub(crate) struct ModelArgs {
    /// Model file, - for standard input, generate:SHAPE[:TRIANGLES], scene:NAME, or the http:// address of a paged tree
    #[arg(value_name = "MODEL", index = 1)]
    pub(crate) model: PathBuf,
    /// Merge vertices that are equal in position, normal and color
    #[arg(long)]
    pub(crate) weld: bool,
    /// What the first view frames: without what lies far off, or all
    #[arg(long, value_name = "WHAT", default_value = "robust")]
    pub(crate) frame: ViewFraming,
    #[command(flatten)]
    pub(crate) surface: SurfaceArgs,
    #[command(flatten)]
    pub(crate) keep: KeepArgs,
}

/// What is kept of models.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct KeepArgs {
    /// Keep only points with these values of a field: class=2,6 height=10..80 intensity=..200 x=5.. or any attribute that `surfel info` lists; of several --keep all must hold. Triangles go by x, y, z and height of their middle
    #[arg(long, value_name = "FIELD=VALUES", value_parser = parse_condition)]
    keep: Vec<FieldCondition>,
    /// Keep only what is within this box, in the coordinates of the file
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = parse_box, allow_hyphen_values = true)]
    clip_box: Option<[DVec3; 2]>,
}

fn parse_condition(text: &str) -> Result<FieldCondition, String> {
    text.parse()
}

/// Two opposite corners.
pub(crate) fn parse_box(text: &str) -> Result<[DVec3; 2], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| {
            part.trim()
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite())
        })
        .collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) => Ok([DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)]),
        _ => Err("six numbers are wanted: two opposite corners, X0,Y0,Z0,X1,Y1,Z1".to_owned()),
    }
}

impl KeepArgs {
    /// All conditions together.
    pub(crate) fn filter(&self) -> PointFilter {
        let mut filter = PointFilter {
            conditions: self.keep.clone(),
        };
        if let Some(corners) = self.clip_box {
            filter.clip(corners);
        }
        filter
    }
}

/// How surfaces are shaded where triangles meet.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct SurfaceArgs {
    /// Normals of surfaces [default: file]
    #[arg(long, value_enum, value_name = "NORMALS")]
    shading: Option<NormalsChoice>,
    /// Edges of more than this angle are sharp; 0 shades each triangle flat, 180 smooths all, both without the file's normals [default: 40]
    #[arg(long, value_name = "DEGREES", value_parser = parse_crease)]
    crease: Option<f32>,
    /// Normals of points: those of the file, or where it has none those of planes through their neighbors
    #[arg(long, value_name = "NORMALS", value_enum, default_value_t)]
    point_normals: PointNormalsChoice,
    /// How triangles are divided into nodes: along the longest axis, or so that nodes are flat, for patches (builds longer)
    #[arg(long, value_name = "RULE", default_value = "longest")]
    split: SplitChoice,
    /// Show the images that the file names on its surfaces; without, the colors of materials and vertices
    #[arg(long, value_name = "WHETHER", value_enum, default_value_t)]
    textures: TextureChoice,
}

/// Which normals surfaces have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum NormalsChoice {
    /// One for each triangle
    Flat,
    /// Computed: smooth but for edges of more than --crease degrees
    Smooth,
    /// Normals of the file; where it has none, smooth
    File,
}

/// [`PointNormals`] by its name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum PointNormalsChoice {
    /// Of the file; where it has none, of planes through the neighbors of each point
    #[default]
    Estimate,
    /// Of the file alone
    File,
    /// None: points are not lit
    None,
}

impl SurfaceArgs {
    /// Gives points no normals, so that no light falls on them, unless those of the file are asked for.
    pub(crate) fn leave_points_unlit(&mut self) {
        if self.point_normals == PointNormalsChoice::Estimate {
            self.point_normals = PointNormalsChoice::None;
        }
    }

    /// The crease angle of the options of opening: none keeps the normals of the file.
    fn crease_degrees(self) -> Result<Option<f32>, CommandFailure> {
        use NormalsChoice::{File, Flat, Smooth};
        match (self.shading, self.crease) {
            (Some(name @ (Flat | File)), Some(_)) => Err(usage(format!(
                "--crease is of computed normals: --shading smooth, not {}",
                if name == Flat { "flat" } else { "file" }
            ))),
            (Some(Flat), None) => Ok(Some(0.0)),
            (Some(Smooth), crease) => Ok(Some(crease.unwrap_or(USUAL_CREASE_DEGREES))),
            (Some(File), None) => Ok(None),
            (None, crease) => Ok(crease),
        }
    }
}

/// [`SplitRule`] by its name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum SplitChoice {
    /// Along the longest axis.
    #[default]
    Longest,
    /// So that nodes are flat.
    Flat,
}

/// Whether images are read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum TextureChoice {
    /// Images are read, up to 2 GiB of them with their smaller sizes; beyond that at half their size or less.
    #[default]
    On,
    /// Images are left out.
    Off,
}

fn parse_crease(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(degrees) if (0.0..=180.0).contains(&degrees) => Ok(degrees),
        _ => Err("expected an angle from 0 to 180 degrees".into()),
    }
}

/// How much of paged files is in memory.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct PageArgs {
    /// Memory for the pages of paged tree files, such as 512MiB or 4GiB; what does not fit is drawn coarser [default: half of what is free, at most 4GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    memory: Option<u64>,
    /// Read only the first part of paged tree files, such as 10% or 20MiB; the rest is drawn coarser
    #[arg(long, value_name = "PART", value_parser = parse_prefix)]
    prefix: Option<FilePrefix>,
}

/// Seconds of `--wait`.
pub(crate) fn parse_wait(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.0..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected seconds, 0 to 86400".to_owned()),
    }
}

/// A part such as `10%`, or a number of bytes.
fn parse_prefix(text: &str) -> Result<FilePrefix, String> {
    match text
        .strip_suffix('%')
        .map(|text| text.trim().parse::<f64>())
    {
        Some(Ok(percent)) if (0.0..=100.0).contains(&percent) => {
            Ok(FilePrefix::Part(percent / 100.0))
        }
        Some(_) => Err("expected a part from 0% to 100%".to_owned()),
        None => parse_bytes(text).map(FilePrefix::Bytes),
    }
}

impl PageArgs {
    /// Bytes of pages in memory.
    pub(crate) fn bytes(self) -> u64 {
        self.memory
            .unwrap_or_else(surfel::pages::cache::usual_budget)
    }

    /// Options of drawing paged files.
    pub(crate) fn options(self) -> PagedModelOptions {
        PagedModelOptions {
            memory_bytes: self.bytes(),
            prefix: self.prefix,
            ..PagedModelOptions::default()
        }
    }
}

/// A number of bytes, such as `512MiB`, `1.5 GB` or `4096`.
pub(crate) fn parse_bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let split = text
        .find(|c: char| c.is_ascii_alphabetic())
        .unwrap_or(text.len());
    let (number, unit) = (text[..split].trim(), text[split..].to_ascii_lowercase());
    let unit: f64 = match unit.as_str() {
        "" | "b" => 1.0,
        "kib" => 1024.0,
        "mib" => 1_048_576.0,
        "gib" => 1_073_741_824.0,
        "tib" => 1_099_511_627_776.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err("the unit is one of B, KB, MB, GB, TB, KiB, MiB, GiB, TiB".to_owned()),
    };
    match number.parse::<f64>() {
        Ok(count) if count >= 0.0 && count * unit >= 1.0 && count * unit < 1e18 => {
            Ok((count * unit) as u64)
        }
        _ => Err("expected a size such as 512MiB or 4GiB".to_owned()),
    }
}

/// What colors a cloud.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ColorArgs {
    /// What colors the points: `--color-by` of the look.
    #[arg(skip)]
    pub(crate) by: Option<PointColoring>,
    /// Values of the first and the last color of points by --color-by [default: those that 2% of the points are below and above; of several models around those of all]
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse_range, allow_hyphen_values = true)]
    color_range: Option<[f64; 2]>,
}

/// Two numbers, the smaller first.
fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    match numbers.as_deref() {
        Some(&[low, high]) if low < high && low.is_finite() && high.is_finite() => Ok([low, high]),
        _ => Err("two numbers are wanted, the smaller first, such as 0,30".to_owned()),
    }
}

impl ColorArgs {
    /// Colors models that are shown together over the range of all, where there are several; tells what the colors mean and which
    /// have no such attribute. Those that were given a color keep it.
    pub(crate) fn share(
        &self,
        models: &mut [OpenedModel],
        placements: &[MeshPlacement],
    ) -> Outcome {
        let Some(setting) = self.setting()?.filter(|_| models.len() > 1) else {
            return Ok(());
        };
        let own = models.iter_mut().zip(placements);
        let own = own.filter(|(_, placement)| placement.color.is_none());
        let common = recolor::recolor_opened(own.map(|(opened, _)| opened), &setting)
            .map_err(surfel::Error::from)?;
        for name in &common.without {
            super::say(&format!(
                "surfel: {name}: warning: it has no {} and keeps its colors",
                setting.by
            ));
        }
        if let LegendEntries::Scale { values, .. } = &common.legend.entries {
            super::say(&format!(
                "surfel: all models are colored from {} to {}",
                values[0], values[2]
            ));
        }
        for opened in models {
            input::set_legend(&mut opened.warnings, &common.legend);
        }
        Ok(())
    }

    /// The setting of the options of opening.
    pub(crate) fn setting(&self) -> Result<Option<ColorSetting>, CommandFailure> {
        let range = self.color_range;
        match &self.by {
            Some(by) => Ok(Some(ColorSetting {
                by: by.clone(),
                range,
            })),
            None if range.is_some() => Err(usage(
                "--color-range goes with --color-by height or an attribute of the points",
            )),
            None => Ok(None),
        }
    }
}

/// What the first view frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ViewFraming {
    /// All but what lies far off.
    Robust,
    /// Everything.
    All,
}

/// The options of opening that the arguments ask for.
pub(crate) fn open_options(
    weld: bool,
    frame: ViewFraming,
    surface: SurfaceArgs,
) -> Result<OpenOptions, CommandFailure> {
    Ok(OpenOptions {
        input: input::ReadOptions {
            weld,
            textures: surface.textures == TextureChoice::On,
            ..input::ReadOptions::default()
        },
        frame_all: frame == ViewFraming::All,
        page_reading: PageReading::Whole,
        memory_bytes: None,
        placement: MeshPlacement::default(),
        keep: PointFilter::default(),
        tree: BuildOptions {
            crease_degrees: surface.crease_degrees()?,
            split: match surface.split {
                SplitChoice::Longest => SplitRule::Longest,
                SplitChoice::Flat => SplitRule::Flat,
            },
            point_normals: match surface.point_normals {
                PointNormalsChoice::Estimate => PointNormals::Estimate,
                PointNormalsChoice::File => PointNormals::File,
                PointNormalsChoice::None => PointNormals::None,
            },
            ..BuildOptions::default()
        },
    })
}

impl ModelArgs {
    /// The options of opening.
    pub(crate) fn options(&self) -> Result<OpenOptions, CommandFailure> {
        Ok(OpenOptions {
            keep: self.keep.filter(),
            ..open_options(self.weld, self.frame, self.surface)?
        })
    }

    /// Opens the model, with a progress bar from about a second on.
    pub(crate) fn open(&self, quiet: bool) -> Result<OpenedModel, CommandFailure> {
        self.open_with(&JobBar::new(quiet))
    }

    /// Opens the model, and says what was repaired or left out.
    pub(crate) fn open_with(&self, progress: &dyn Progress) -> Result<OpenedModel, CommandFailure> {
        self.open_colored(&ColorArgs::default(), progress)
    }

    /// Opens the model with colors by what is asked for.
    pub(crate) fn open_colored(
        &self,
        color: &ColorArgs,
        progress: &dyn Progress,
    ) -> Result<OpenedModel, CommandFailure> {
        self.open_as(
            color,
            PageReading::Whole,
            MeshPlacement::default(),
            progress,
        )
    }

    /// Opens as [`ModelArgs::open_colored`] does and places the model.
    pub(crate) fn open_as(
        &self,
        color: &ColorArgs,
        page_reading: PageReading,
        placement: MeshPlacement,
        progress: &dyn Progress,
    ) -> Result<OpenedModel, CommandFailure> {
        let mut options = self.options()?;
        options.input.color = color.setting()?;
        options.page_reading = page_reading;
        options.placement = placement;
        let opened = surfel::open(&self.model, &options, progress).map_err(|error| match error {
            surfel::Error::Input(input::Error::UnknownAttribute { .. }) => usage(format!(
                "{error}; looks of the picture are shading, primitive, classification, level, normal, depth and overdraw"
            )),
            other => other.into(),
        })?;
        for warning in &opened.warnings {
            super::say(&format!("surfel: {}: warning: {warning}", opened.name));
        }
        Ok(opened)
    }
}
