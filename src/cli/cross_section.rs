//! `surfel cross-section`

use super::cameras::{UpChoice, parse_size};
use super::look::LookArgs;
use super::placement_args::PlacementArgs;
use super::progress::JobBar;
use super::render::{DeviceArgs, require_ending, validated};
use super::rendered_picture::RenderedPicture;
use super::source::{ColorArgs, ModelArgs};
use super::{CommandFailure, Outcome, count, say, usage};
use glam::DVec3;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use surfel::OpenedModel;
use surfel::image::{MarkedLines, PictureMarks, ruler_margins};
use surfel::input::legend_of;
use surfel::math::section_line::{SectionFrame, SectionLine};
use surfel::math::up_axis::UpAxis;
use surfel::mesh::attributes::PointAttributes;
use surfel::open::PageReading;
use surfel::open::cross_section::{ModelSection, SectionedModel, write_csv, write_csv_file};
use surfel::pack::ColorBy;
use surfel::render::engine::{Engine, smooth_threshold};
use surfel::render::{PictureOutputs, Settings};
use surfel::tree::Model;

const EXAMPLES: &str = "\
Examples:
  surfel cross-section tile.laz --line 636200,849000,636800,849000 --width 2 -o section.png --csv section.csv
  surfel cross-section tile.laz --line 0,0,100,40 --width 1 --keep class=2,6 --color-by class -o section.png
  surfel cross-section road.laz --line 0,0,900,0 --width 5 --exaggerate 10 --size 1800x500 -o profile.png
  surfel cross-section house.ply scan.las --line 0,0,12,0 --width 0.1 --up z --csv - | head

The table has distance along the line, offset from it (positive to the left of one who walks from start to end), height, x, y, z
and what points carry, ordered by distance. Of surfaces it has the lines in which the upright plane through the line cuts them, as
polylines with numbers; a closed one ends where it begins. The picture looks from the right, so the start is at the left.";

/// Cut models upright along a line: a picture and a table of what is there.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CrossSectionArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// More models, cut by the same line
    #[arg(value_name = "MODEL", index = 2)]
    more: Vec<PathBuf>,
    /// Two places of the map in the coordinates of the file: x and y where z is up, x and z where y is up; or two points with all three coordinates, whose heights do not matter
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_line, allow_hyphen_values = true)]
    line: LineEnds,
    /// Width of the slab around the line, in units of the coordinates: half of it to either side
    #[arg(long, value_name = "UNITS", value_parser = parse_positive)]
    width: f64,
    /// Picture to write: .png; - for standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Table to write, with commas between; - for standard output
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Size of the picture in pixels [default: 1200 wide, as high as the heights need]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Draw heights so many times longer than distances
    #[arg(long, value_name = "TIMES", value_parser = parse_positive, default_value = "1")]
    exaggerate: f64,
    /// Axis that is up [default: z for points, as everywhere where heights of points are meant; for surfaces as in surfel render]
    #[arg(long, value_enum, default_value_t = UpChoice::Auto, hide_default_value = true, value_name = "AXIS")]
    up: UpChoice,
    #[command(flatten)]
    placement: PlacementArgs,
    #[command(flatten)]
    color: ColorArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The ends of a line: two numbers each, or three.
#[derive(Debug, Clone, Copy)]
enum LineEnds {
    Map([f64; 4]),
    Points([DVec3; 2]),
}

fn parse_line(text: &str) -> Result<LineEnds, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    let numbers = numbers.filter(|all| all.iter().all(|number| number.is_finite()));
    match numbers.as_deref() {
        Some(&[a, b, c, d]) => Ok(LineEnds::Map([a, b, c, d])),
        Some(&[a, b, c, d, e, f]) => {
            Ok(LineEnds::Points([DVec3::new(a, b, c), DVec3::new(d, e, f)]))
        }
        _ => Err("four numbers are wanted, X0,Y0,X1,Y1, or the six of two points".to_owned()),
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value < 1e12 => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

impl LineEnds {
    /// The ends in the coordinates of the file.
    fn places(self, up: UpAxis) -> [DVec3; 2] {
        let place = |a, b| match up {
            UpAxis::X => DVec3::new(0.0, a, b),
            UpAxis::Y => DVec3::new(a, 0.0, b),
            UpAxis::Z => DVec3::new(a, b, 0.0),
            UpAxis::Along(_) => up.to_world(DVec3::new(a, 0.0, b)),
        };
        match self {
            Self::Map([a, b, c, d]) => [place(a, b), place(c, d)],
            Self::Points(ends) => ends,
        }
    }
}

/// Pixels of pictures whose size is not said.
const USUAL_WIDTH: u32 = 1200;
const USUAL_HEIGHTS: [u32; 2] = [200, 1199];
/// Side of the dots that points are.
const DOT_PX: f32 = 3.0;

impl CrossSectionArgs {
    fn check(&self) -> Outcome {
        let outputs = [&self.output, &self.csv];
        let paths: Vec<&PathBuf> = outputs.into_iter().flatten().collect();
        if paths.is_empty() {
            return Err(usage(
                "nothing to write: give -o FILE.png, --csv FILE or both",
            ));
        }
        let is_printed = self.output.as_deref() == Some(Path::new("-"));
        let named = self.output.as_ref().filter(|_| !is_printed);
        require_ending("--output", named, &["png"])?;
        for model in [&self.source.model].into_iter().chain(&self.more) {
            super::check_outputs(&paths, model)?;
        }
        Ok(())
    }

    /// Opens all models.
    fn open(&self, quiet: bool) -> Result<Vec<OpenedModel>, CommandFailure> {
        let placements = self.placement.of_models(1 + self.more.len())?;
        let paths = [&self.source.model].into_iter().chain(&self.more);
        let mut opened: Vec<OpenedModel> = Vec::with_capacity(1 + self.more.len());
        for (path, &placement) in paths.zip(&placements) {
            let color = match opened.is_empty() {
                true => self.color.clone(),
                false => ColorArgs::default(),
            };
            let source = ModelArgs {
                model: path.clone(),
                ..self.source.clone()
            };
            opened.push(source.open_as(
                &color,
                PageReading::Whole,
                placement,
                &JobBar::new(quiet),
            )?);
        }
        self.color.share(&mut opened, &placements)?;
        Ok(opened)
    }

    /// The part of the picture that shows the section.
    fn frame(&self, line: &SectionLine, [low, high]: [f64; 2]) -> SectionFrame {
        let pad = match high - low {
            tall if tall > 0.0 => 0.02 * tall,
            _ => 0.02 * line.length() / self.exaggerate,
        };
        let heights = [low - pad, high + pad];
        let size = self.size.unwrap_or_else(|| {
            let (margins, _) = ruler_margins([USUAL_WIDTH, USUAL_HEIGHTS[0]]);
            let inner = f64::from(USUAL_WIDTH - margins.left - margins.right);
            let tall = inner * (heights[1] - heights[0]) * self.exaggerate / line.length();
            // The cast saturates.
            let height = (tall.ceil() as u32).saturating_add(margins.top + margins.bottom);
            (
                USUAL_WIDTH,
                height.clamp(USUAL_HEIGHTS[0], USUAL_HEIGHTS[1]),
            )
        });
        let size = [size.0, size.1];
        line.centered(&SectionFrame {
            size,
            margins: ruler_margins(size).0,
            heights,
            exaggeration: self.exaggerate,
        })
    }

    /// Settings of the picture, and whether it is smooth. Points are dots in their own colors, as sections show them: discs would
    /// be seen on edge.
    fn settings(&mut self, parts: &[Model]) -> Result<(Settings, bool), CommandFailure> {
        let is_surface = parts.iter().all(|model| model.kind().is_surface());
        let are_points = parts.iter().all(|model| model.kind().is_points());
        if are_points && self.draws_dots() {
            self.look.default_dots(DOT_PX);
            return Ok((self.look.settings()?, false));
        }
        self.look.default_for_people();
        if !is_surface {
            self.look.default_ellipses();
        }
        let settings = self.look.settings()?;
        let is_smooth = matches!(settings.color_by, ColorBy::Shading | ColorBy::Primitive);
        if is_smooth && let Some(threshold) = smooth_threshold(&settings, is_surface) {
            self.look.default_threshold(threshold);
        }
        Ok((self.look.settings()?, is_smooth))
    }

    /// Tells whether points become dots: nobody says how they are drawn, and the backend knows dots.
    fn draws_dots(&self) -> bool {
        self.look.has_usual_shapes() && !self.device.is_cpu()
    }

    fn write_picture(&self, path: &Path, picture: &RenderedPicture) -> Outcome {
        let has_alpha = self.look.background.is_transparent();
        if path == Path::new("-") {
            return super::print_bytes(&picture.png(has_alpha)?);
        }
        Ok(picture.save_png(path, has_alpha)?)
    }

    /// Draws what the slab holds, with its lines and rulers.
    fn draw(
        &mut self,
        models: &[SectionedModel<'_>],
        line: &SectionLine,
        quiet: bool,
    ) -> Result<RenderedPicture, CommandFailure> {
        let heights = models.iter().filter_map(|(_, section)| section.heights);
        let heights = heights.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let frame = self.frame(line, heights.unwrap_or([0.0; 2]));
        let parts = kept_parts(models, quiet)?;
        let is_surface = parts.iter().all(|model| model.kind().is_surface());
        let origin = parts.first().map_or(DVec3::ZERO, |model| model.origin);
        // Points are in the slab as wholes; surfaces are cut by the planes.
        let slack = if is_surface { 0.0 } else { line.width() };
        let view = line.camera(&frame, slack).view(origin)?;
        let (mut settings, is_smooth) = self.settings(&parts)?;
        self.placement.set_section(&mut settings, origin);
        let backend = self.device.open()?;
        let parts: Vec<&Model> = parts.iter().collect();
        let size = (frame.size[0], frame.size[1]);
        let mut engine = Engine::of_models(&backend, &parts, size, PictureOutputs::default())?;
        engine.build_patches(&settings, &JobBar::new(quiet))?;
        super::vertex_splats::make_even_splats(&engine, &settings, quiet)?;
        engine.set_costs(super::costs::costs_of(&backend, &[settings]));
        engine.draw(&view, &settings)?;
        let mut picture = match is_smooth {
            true => RenderedPicture::Mean(engine.smooth(&view, &settings)?),
            false => RenderedPicture::Single(engine.read(&view)?),
        };
        let pixel = |place: &surfel::open::cross_section::SectionPoint| {
            line.pixel_of(&frame, place.place.distance, place.place.height)
        };
        let polylines = models.iter().flat_map(|(_, section)| &section.polylines);
        let pieces = polylines.flat_map(|polyline| polyline.windows(2));
        picture.mark_lines(&MarkedLines {
            lines: pieces
                .map(|ends| [pixel(&ends[0]), pixel(&ends[1])])
                .collect(),
            places: Vec::new(),
        });
        let mut marks = PictureMarks::of_section(line, &frame);
        let mut legends = models.iter().map(|(opened, _)| legend_of(&opened.warnings));
        if let Some(legend) = legends.find_map(|legend| legend) {
            // Beside the ruler of heights.
            marks.add_legend(legend, frame.margins.left as f32);
        }
        picture.mark(&marks);
        validated(&backend)?;
        Ok(picture)
    }
}

/// Parts that the slab holds of each model, all in the space of the first.
fn kept_parts(models: &[SectionedModel<'_>], quiet: bool) -> Result<Vec<Model>, CommandFailure> {
    let mut parts: Vec<Model> = Vec::new();
    for (opened, section) in models {
        if section.mask.contains(&true) {
            let bar = JobBar::new(quiet);
            let mut part = opened.model.kept(&section.mask, &bar)?;
            let mut colors = PointAttributes {
                are_colors_categories: opened.attributes.are_colors_categories,
                ..PointAttributes::default()
            };
            if colors.are_colors_categories {
                part.color_by_majority();
            }
            let origin = parts.first().map_or(part.origin, |first| first.origin);
            parts.push(part.moved_to(origin, &mut colors, &bar)?);
        }
    }
    Ok(parts)
}

/// Says what there is of each model, in words.
fn tell(models: &[SectionedModel<'_>], line: &SectionLine) {
    let around = format!(
        "within {} of the line of {:.3}",
        0.5 * line.width(),
        line.length()
    );
    for (opened, section) in models {
        let [low, high] = section.heights.unwrap_or([0.0; 2]);
        let heights = format!("heights {low:.3} to {high:.3}");
        let name = &opened.name;
        say(&match (section.points.len(), section.polylines.len()) {
            (0, 0) => format!("surfel: {name}: nothing {around}"),
            (0, 1) => format!(
                "surfel: {name}: 1 polyline on the line of {:.3}, {heights}",
                line.length()
            ),
            (0, lines) => format!(
                "surfel: {name}: {} polylines on the line of {:.3}, {heights}",
                count(lines as u64),
                line.length()
            ),
            (points, _) => {
                let all = count(opened.model.tree.leaves.len() as u64);
                format!(
                    "surfel: {name}: {} of {all} points {around}, {heights}",
                    count(points as u64)
                )
            }
        });
    }
}

/// The failure where nothing is on the line.
fn nothing_there(models: &[SectionedModel<'_>], line: &SectionLine) -> CommandFailure {
    let corner = |model: &Model, corner: glam::Vec3| {
        let [x, y, z] = (model.origin + corner.as_dvec3()).to_array();
        format!("{x:.2},{y:.2},{z:.2}")
    };
    let reach = |(opened, _): &SectionedModel<'_>| {
        let model = &opened.model;
        let (low, high) = (corner(model, model.min), corner(model, model.max));
        format!("{} reaches from {low} to {high}", opened.name)
    };
    let reaches: Vec<String> = models.iter().map(reach).collect();
    let axis = ["x", "y", "z"][line.up_axis()];
    usage(format!(
        "nothing is on the line, {axis} being up: {}; give a --line through it, more --width or another --up",
        reaches.join("; ")
    ))
}

pub(crate) fn run(mut args: CrossSectionArgs, quiet: bool) -> Outcome {
    args.check()?;
    args.look.background.may_be_transparent = true;
    args.color.by = args.look.take_point_color();
    // What cannot be drawn is refused before minutes of reading.
    args.look.settings()?;
    if args.draws_dots() {
        args.source.surface.leave_points_unlit();
    }
    let opened = args.open(quiet)?;
    let Some(first) = opened.first() else {
        return Err(usage("a model is wanted"));
    };
    let up = match args.up.named() {
        None if first.has_points() => UpAxis::Z,
        _ => args.up.of(first.up, &first.name, quiet),
    };
    let line = SectionLine::new(args.line.places(up), args.width, up)
        .map_err(|cause| usage(format!("--line: {cause}")))?;
    let sections: Vec<ModelSection> = (opened.iter())
        .map(|opened| ModelSection::of(opened, &line))
        .collect();
    let models: Vec<SectionedModel<'_>> = opened.iter().zip(&sections).collect();
    if sections.iter().all(ModelSection::is_empty) {
        return Err(nothing_there(&models, &line));
    }
    if !quiet {
        tell(&models, &line);
    }
    match &args.csv {
        Some(path) if path.as_path() == Path::new("-") => print_csv(&models, &line)?,
        Some(path) => write_csv_file(&models, &line, path)?,
        None => {}
    }
    if let Some(path) = args.output.clone() {
        let picture = args.draw(&models, &line, quiet)?;
        args.write_picture(&path, &picture)?;
    }
    Ok(())
}

/// Writes the table to standard output; a reader that went away is no failure.
fn print_csv(models: &[SectionedModel<'_>], line: &SectionLine) -> Outcome {
    let mut out = BufWriter::with_capacity(1 << 16, io::stdout().lock());
    match write_csv(models, line, &mut out).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CommandFailure::Run(
            anyhow::Error::new(error).context("cannot write to standard output"),
        )),
        _ => Ok(()),
    }
}
