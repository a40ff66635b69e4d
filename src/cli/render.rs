//! `surfel render`

use super::auto::AutoArgs;
use super::cameras::{
    UpChoice, orbit_cameras_about, parse_orbit, parse_size, read_camera, resized,
};
use super::costs::costs_of;
use super::look::LookArgs;
use super::mark_args::MarkArgs;
use super::photo_args::{PhotoArgs, StagedScene, camera_of, up_guess};
use super::placement_args::PlacementArgs;
use super::progress::{JobBar, is_interrupted};
use super::rendered_picture::{RenderedPicture, numbered};
use super::source::{ColorArgs, ModelArgs, PageArgs, parse_wait};
use super::vertex_splats::make_even_splats;
use super::{CommandFailure, Outcome, print_bytes, say, usage, write_text};
use clap::Args as ClapArgs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;
use surfel::OpenedModel;
use surfel::gpu::{DeviceOptions as GpuOptions, Error as GpuError, Gpu};
use surfel::image::MarkedLines;
use surfel::math::measured_line::MeasureList;
use surfel::open::PageReading;
use surfel::pack::ColorBy;
use surfel::progress::Progress;
use surfel::render::engine::{Backend, Engine, smooth_threshold};
use surfel::render::paged_model::{PagedModel, PagedModelOptions, page_reading};
use surfel::render::stats::{FrameTimes, OverdrawSummary};
use surfel::render::vulkan::overdraw;
#[cfg(feature = "viewer")]
use surfel::render::window_renderer::WindowBackend;
use surfel::render::{PictureOutputs, Settings};
use surfel::tree::OrbitSphere;

/// Backends that can be asked for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum BackendChoice {
    /// The Vulkan device; the processor where that is faster than a software device, or where there is no Vulkan
    #[default]
    Auto,
    /// The Vulkan device alone
    Vulkan,
    /// The processor alone, without Vulkan: squares, discs, ellipses and filtered splats, triangles
    Cpu,
    /// The reference on the processor, without Vulkan: exact and slow
    Reference,
}

/// Which device draws.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct DeviceArgs {
    /// Device by index or part of its name (see `surfel devices`); `cpu` and `reference` stand for --backend cpu and reference
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,
    /// Backend that draws
    #[arg(long, value_enum, default_value_t = BackendChoice::Auto, value_name = "BACKEND")]
    backend: BackendChoice,
    /// Load the Vulkan validation layer; the run fails if it finds anything
    #[arg(long)]
    validate: bool,
}

impl DeviceArgs {
    pub(crate) fn options(&self) -> GpuOptions {
        GpuOptions {
            device: self.device.clone(),
            validation: self.validate,
            ..GpuOptions::default()
        }
    }

    /// Tells whether the processor's own renderer is asked for by name.
    pub(crate) fn is_cpu(&self) -> bool {
        self.backend == BackendChoice::Cpu || self.device.as_deref() == Some(Backend::CPU)
    }

    /// The backend of a window's frames.
    #[cfg(feature = "viewer")]
    pub(crate) fn window_backend(&self) -> Result<WindowBackend, CommandFailure> {
        let is_named = self.device.as_deref().is_some_and(Backend::is_of_processor);
        match self.backend {
            BackendChoice::Auto if !is_named => Ok(WindowBackend::Auto),
            BackendChoice::Vulkan if !is_named => Ok(WindowBackend::Vulkan),
            BackendChoice::Cpu if !is_named => Ok(WindowBackend::Cpu),
            BackendChoice::Reference => Err(usage(
                "--backend reference draws pictures only; use it with surfel render",
            )),
            _ => Err(usage(
                "a window needs a Vulkan device that shows its frames: name one, or use --backend cpu without --device",
            )),
        }
    }

    /// Opens the backend. Without Vulkan, and unless a device is asked for by name, that is the processor.
    pub(crate) fn open(&self) -> Result<Backend, CommandFailure> {
        let options = self.options();
        if self.backend != BackendChoice::Auto && self.device.is_some() {
            let is_named = self.device.as_deref().is_some_and(Backend::is_of_processor);
            if is_named || self.backend != BackendChoice::Vulkan {
                return Err(usage("--backend cpu and reference have no --device"));
            }
        }
        match self.backend {
            BackendChoice::Cpu => Ok(Backend::Cpu),
            BackendChoice::Reference => Ok(Backend::Reference),
            BackendChoice::Vulkan => Ok(Backend::Vulkan(Gpu::open(&options)?)),
            BackendChoice::Auto => match Backend::open(&options) {
                Err(error @ (GpuError::NoLoader(_) | GpuError::NoDevice(_)))
                    if self.device.is_none() && !self.validate =>
                {
                    let reason = super::with_driver_hint(error.to_string());
                    eprintln!("surfel: warning: {reason}; the processor draws");
                    Ok(Backend::WithoutDevice)
                }
                opened => Ok(opened?),
            },
        }
    }
}

/// A failure if the validation layer had anything to say.
pub(crate) fn validated(backend: &Backend) -> Outcome {
    let Some(gpu) = backend.device() else {
        return Ok(());
    };
    let messages = gpu.messages().list();
    match messages.first() {
        None => Ok(()),
        Some(first) => Err(CommandFailure::Run(anyhow::anyhow!(
            "the validation layer found {} fault(s); the first: {}: {}",
            messages.len(),
            first.id,
            first.text
        ))),
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel render dragon.ply.gz -o dragon.png
  surfel render dragon.ply.gz -o near.png --orbit 30,20,2 --size 1024x768 --threshold 3
  surfel render scan.ply -o scan.png --depth scan-depth.exr --normals scan-normals.exr
  surfel render horse.ply -o ref.png --method triangles --samples 64
  surfel render horse.ply -o turn.png --frames 36        writes turn-000.png to turn-035.png
  surfel render horse.ply --frames 36 --stats -          times only
  surfel render horse.ply -o - | display                 to another program, as PNG
  surfel render horse.ply -o horse.png --backend cpu     without Vulkan
  surfel render tile.laz -o tile.png --color-by class
  surfel render tile.laz -o ground.png --keep class=2,6 --keep height=..80
  surfel render horse.ply -o close.png --orbit 30,20,4 --cut-camera far.json   the splats of a far view, seen close
  surfel render house.ply trees.ply -o place.png         several models in one picture
  surfel render a.ply b.ply -o pair.png --transform none --transform b-to-a.txt --model-color none --model-color '#4a90d9'
  surfel render castle.ply -o castle.png --photos castle      photographs on the model
  surfel render --scene fence -o fence.png --splat filtered   what a method does where it is hard (surfel scenes)";

/// Draw a model into a picture file.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
// The model of a scene is the scene's own.
#[command(mut_arg("model", |a| a.required(false).required_unless_present("scene").default_value("scene:").hide_default_value(true)))]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// More models, drawn in the same picture
    #[arg(value_name = "MODEL", index = 2)]
    more: Vec<PathBuf>,
    #[command(flatten)]
    placement: PlacementArgs,
    #[command(flatten)]
    color: ColorArgs,
    #[command(flatten)]
    pages: PageArgs,
    /// Wait at most this long for the pages of paged tree files, and draw what is there; 0 draws the first page [default: until all is there that the picture needs]
    #[arg(long, value_name = "SECONDS", value_parser = parse_wait)]
    wait: Option<f64>,
    /// Draw a built-in scene with its own camera, picture size and threshold, unless those are given; `list` lists them
    #[arg(long, value_name = "NAME", conflicts_with = "model")]
    scene: Option<String>,
    /// Picture to write: .png (8 bit) or .exr (float); - for a PNG to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the view-space distance of each pixel: .exr or .npy
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,
    /// Write the world-space normal of each pixel: .exr
    #[arg(long, value_name = "FILE")]
    normals: Option<PathBuf>,
    /// Write the covered fraction of each pixel: .png
    #[arg(long, value_name = "FILE")]
    coverage: Option<PathBuf>,
    /// Size of the picture in pixels [default: 500x500, or the camera's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Camera file (JSON: width, height, view, proj)
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    camera: Option<PathBuf>,
    /// Look at the model's middle from azimuth and elevation in degrees; fill 1 has the bounding sphere fill the picture [default: 30,20,1]
    #[arg(long, value_name = "AZIMUTH,ELEVATION,FILL", value_parser = parse_orbit, allow_hyphen_values = true)]
    orbit: Option<[f64; 3]>,
    /// Axis that is up for --orbit and --frames
    #[arg(long, value_enum, default_value_t = UpChoice::Auto, value_name = "AXIS", conflicts_with = "camera")]
    up: UpChoice,
    /// Draw the cut of this camera, which shows from elsewhere what it draws (--method pop and splats)
    #[arg(long, value_name = "FILE")]
    cut_camera: Option<PathBuf>,
    /// Write the camera that was used
    #[arg(long, value_name = "FILE")]
    save_camera: Option<PathBuf>,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    marks: MarkArgs,
    #[command(flatten)]
    auto: AutoArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    /// Draw from the pose of a photograph of --photos: its name or its number from 0
    #[arg(long, value_name = "PHOTO", requires = "photos", conflicts_with_all = ["camera", "orbit", "frames"])]
    camera_of: Option<String>,
    /// Samples per pixel, averaged: 1, 4, 9, 16, 25, 36, 49 or 64 [default: 32, or 64 where those differ much; 1 with --depth, --normals, --scene and colors that are data]
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Draw measures over the picture, as Ctrl S in the window writes them
    #[arg(long, value_name = "FILE", requires = "output")]
    measures: Option<PathBuf>,
    /// Draw N views of the standard orbit in one process (azimuth (k + 1/2) 360/N degrees)
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "camera")]
    frames: u32,
    /// Write counts and times as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(crate) fn ending(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

pub(crate) fn require_ending(option: &str, path: Option<&PathBuf>, allowed: &[&str]) -> Outcome {
    match path {
        Some(path) if !allowed.contains(&ending(path).as_str()) => Err(usage(format!(
            "{option} {}: the ending must be {}",
            path.display(),
            allowed.join(" or ")
        ))),
        _ => Ok(()),
    }
}

impl RenderArgs {
    fn check(&self) -> Outcome {
        let is_printed = self.output.as_deref() == Some(Path::new("-"));
        if is_printed && self.frames > 1 {
            return Err(usage(
                "-o -: standard output takes one picture; give a file for several --frames",
            ));
        }
        if is_printed && std::io::stdout().is_terminal() {
            return Err(usage(
                "-o -: standard output is a terminal; send it on, such as to a file: > picture.png",
            ));
        }
        let named = self.output.as_ref().filter(|_| !is_printed);
        require_ending("--output", named, &["png", "exr"])?;
        require_ending("--depth", self.depth.as_ref(), &["exr", "npy"])?;
        require_ending("--normals", self.normals.as_ref(), &["exr"])?;
        require_ending("--coverage", self.coverage.as_ref(), &["png"])?;
        let samples = self.samples.unwrap_or(1);
        let root = f64::from(samples).sqrt().round() as u32;
        if samples == 0 || root * root != samples || samples > 64 {
            return Err(usage(format!(
                "--samples {samples}: expected a square from 1 to 64"
            )));
        }
        if samples > 1 && (self.depth.is_some() || self.normals.is_some()) {
            return Err(usage(
                "--depth and --normals are those of one sample at the pixel center; leave --samples out",
            ));
        }
        if self.frames == 0 || self.frames > 100_000 {
            return Err(usage(format!(
                "--frames {}: expected 1 to 100000",
                self.frames
            )));
        }
        let outputs = [
            &self.output,
            &self.depth,
            &self.normals,
            &self.coverage,
            &self.stats,
            &self.save_camera,
        ];
        let paths: Vec<&PathBuf> = outputs.into_iter().flatten().collect();
        if paths.is_empty() {
            return Err(usage(
                "nothing to write: give -o FILE.png (or --depth, --normals, --coverage, --stats)",
            ));
        }
        if !self.more.is_empty() && self.look.is_auto() {
            return Err(usage(
                "--method auto chooses for one model; name a method for several",
            ));
        }
        if self.photos.photos.is_some() && (!self.more.is_empty() || self.look.is_auto()) {
            return Err(usage(
                "--photos puts photographs on one model, by a method that is named",
            ));
        }
        if let Some(measures) = &self.measures {
            super::check_outputs(&paths, measures)?;
        }
        for model in [&self.source.model].into_iter().chain(&self.more) {
            super::check_outputs(&paths, model)?;
        }
        Ok(())
    }

    /// Opens all models, and moves those after the first to the space of that.
    fn open(&self, reading: PageReading, quiet: bool) -> Result<Vec<OpenedModel>, CommandFailure> {
        let placements = self.placement.of_models(1 + self.more.len())?;
        let mut opened: Vec<OpenedModel> = Vec::with_capacity(1 + self.more.len());
        let paths = [&self.source.model].into_iter().chain(&self.more);
        for (path, &placement) in paths.zip(&placements) {
            let color = match opened.is_empty() {
                true => self.color.clone(),
                false => ColorArgs::default(),
            };
            let source = ModelArgs {
                model: path.clone(),
                ..self.source.clone()
            };
            opened.push(source.open_as(&color, reading, placement, &JobBar::new(quiet))?);
        }
        self.color.share(&mut opened, &placements)?;
        let origin = opened[0].model.origin;
        for other in &mut opened[1..] {
            let moving = JobBar::new(quiet);
            other.model = match &other.paged {
                Some(file) => file.stand_in(origin).map_err(surfel::tree::Error::from)?,
                None => std::mem::take(&mut other.model).moved_to(
                    origin,
                    &mut other.attributes,
                    &moving,
                )?,
            };
        }
        Ok(opened)
    }

    /// Tells whether the picture has as many samples as it takes to be smooth: nobody says how many, and it shows what is seen
    /// rather than data.
    fn is_smooth(&self, settings: &Settings) -> bool {
        let shows_light = matches!(settings.color_by, ColorBy::Shading | ColorBy::Primitive);
        let is_single = self.depth.is_some() || self.normals.is_some() || self.scene.is_some();
        let is_named = self.samples.is_some() || self.look.is_auto();
        !is_named && shows_light && !is_single && self.wants_picture()
    }

    fn wants_picture(&self) -> bool {
        self.output.is_some()
            || self.depth.is_some()
            || self.normals.is_some()
            || self.coverage.is_some()
    }

    fn write_picture(&self, picture: &RenderedPicture, frame: u32) -> Outcome {
        let name = |path: &PathBuf| numbered(path, frame, self.frames);
        let has_alpha = self.look.background.is_transparent();
        if let Some(path) = &self.output {
            match (picture, ending(path).as_str()) {
                _ if path == Path::new("-") => print_bytes(&picture.png(has_alpha)?)?,
                (_, "png") => picture.save_png(&name(path), has_alpha)?,
                (RenderedPicture::Single(image), _) => image.save_exr(&name(path))?,
                (RenderedPicture::Mean(mean), _) => mean.save_exr(&name(path))?,
            }
        }
        if let Some(path) = &self.coverage {
            match picture {
                RenderedPicture::Single(image) => image.save_coverage_png(&name(path))?,
                RenderedPicture::Mean(mean) => mean.to_image().save_coverage_png(&name(path))?,
            }
        }
        if let (Some(path), RenderedPicture::Single(image)) = (&self.depth, picture) {
            match ending(path).as_str() {
                "npy" => image.save_npy(&name(path))?,
                _ => image.save_depth_exr(&name(path))?,
            }
        }
        if let (Some(path), RenderedPicture::Single(image)) = (&self.normals, picture) {
            image.save_normal_exr(&name(path))?;
        }
        Ok(())
    }
}

/// What the colors of overdraw mean, with the figures of all frames.
fn tell_overdraw(times: &[FrameTimes]) {
    let counted = times.iter().filter_map(|t| t.overdraw);
    if let Some(all) = counted.reduce(OverdrawSummary::with) {
        say(&format!("surfel: {}", overdraw::legend_line()));
        say(&format!("surfel: {all}"));
    }
}

/// Frames drawn before the first that counts when times are asked for: shaders are compiled at the first draw.
const WARM_UP: u32 = 2;

pub(crate) fn run(mut args: RenderArgs, quiet: bool) -> Outcome {
    match args.scene.as_deref() {
        Some("list") => return super::scenes::print_list(),
        Some(name) => args.source.model = PathBuf::from(format!("scene:{name}")),
        None => {}
    }
    args.check()?;
    args.auto.check(args.look.is_auto())?;
    // A scene shows what a method does, as measuring commands draw it.
    match args.scene {
        Some(_) => args.look.darkening.default_eye_dome(),
        None => args.look.default_for_people(),
    }
    args.look.background.may_be_transparent = true;
    args.color.by = args.look.take_point_color();
    args.marks.check(args.color.by.is_some())?;
    let mut settings = args.look.settings_to_choose()?;
    if args.samples.is_some_and(|samples| samples > 1) && settings.color_by == ColorBy::Overdraw {
        return Err(usage(
            "--color-by overdraw: a mean of the colors of counts is the color of no count; leave --samples out",
        ));
    }
    let read = args.camera.as_deref().map(read_camera).transpose()?;
    let cut_camera = args.cut_camera.as_deref().map(read_camera).transpose()?;
    if cut_camera.is_some() && (args.look.is_auto() || !settings.has_cut()) {
        return Err(usage(
            "--cut-camera: only --method pop and --method splats draw a cut",
        ));
    }
    let takes_all = args.look.is_auto() || args.photos.photos.is_some();
    let mut opened = args.open(page_reading(&settings, takes_all), quiet)?;
    let others = opened.split_off(1);
    let ready = opened.remove(0);
    let mut models = vec![&ready.model];
    models.extend(others.iter().map(|other| &other.model));
    let sphere = (models.iter().map(|model| model.orbit_sphere()))
        .reduce(OrbitSphere::joined)
        .unwrap_or_else(|| ready.model.orbit_sphere());
    // A scene that is named as a model is looked at as any model.
    let scene = ready.scene.as_ref().filter(|_| args.scene.is_some());
    if let Some(scene) = scene
        && !args.look.is_auto()
    {
        args.look.default_threshold(scene.threshold_px);
        settings = args.look.settings_to_choose()?;
    }
    let is_surface = !ready.has_points();
    if !is_surface && args.scene.is_none() {
        args.look.default_ellipses();
        settings = args.look.settings_to_choose()?;
    }
    let is_smooth = args.is_smooth(&settings);
    if is_smooth && let Some(threshold) = smooth_threshold(&settings, is_surface) {
        args.look.default_threshold(threshold);
        settings = args.look.settings_to_choose()?;
    }
    let alone = args.more.is_empty() && !args.look.is_auto();
    settings = (args.photos).shown_on(&args.source.model, alone, settings);
    let of_photos = args.photos.read()?;
    let file = args.measures.as_deref().map(MeasureList::read);
    let measures = file.transpose().map_err(|e| usage(e.to_string()))?;
    let pose = match (&of_photos, &args.camera_of) {
        (Some(of_photos), Some(wanted)) => Some(camera_of(of_photos, wanted, &ready, args.size)?),
        _ => None,
    };
    // Another view of the scene is one of its model.
    let is_its_own = args.camera.is_none() && args.orbit.is_none() && args.frames == 1;
    let own = scene.filter(|_| is_its_own).map(|s| s.camera.clone());
    let camera = read.or(pose).or(own);
    let cameras = match camera {
        Some(camera) => vec![resized(camera, args.size)?],
        None => {
            let guess = up_guess(of_photos.as_ref(), ready.up);
            let up = args.up.of(guess, &ready.name, quiet);
            orbit_cameras_about(up, sphere, args.size, args.orbit, args.frames)
        }
    };
    let backend = args.device.open()?;
    let size = (cameras[0].width, cameras[0].height);
    let outputs = PictureOutputs {
        depth: args.depth.is_some(),
        normal: args.normals.is_some(),
        values: false,
    };
    let mut engine = Engine::of_models(&backend, &models, size, outputs)?;
    for (index, opened) in [&ready].into_iter().chain(&others).enumerate() {
        if let Some(file) = &opened.paged {
            let options = PagedModelOptions {
                origin: Some(ready.model.origin),
                longest_wait: args.wait.map(Duration::from_secs_f64),
                ..args.pages.options()
            };
            let pages =
                PagedModel::open(file.clone(), options).map_err(surfel::tree::Error::from)?;
            engine.set_pages(index, pages);
        }
    }
    let views = cameras
        .iter()
        .map(|c| c.view(ready.model.origin))
        .collect::<Result<Vec<_>, _>>()?;
    args.placement
        .set_section(&mut settings, ready.model.origin);
    if args.look.is_auto() {
        settings = args
            .auto
            .choose(settings, &backend, &ready, &views[0], quiet)?;
    }
    let mut staged = match of_photos {
        Some(scene) => {
            let most = args.photos.most();
            Some(StagedScene::new(scene, &ready, &backend, most, quiet)?)
        }
        None => None,
    };
    if let Some(camera) = cut_camera {
        settings.cut_view = Some(camera.view(ready.model.origin)?);
    }
    if let Some(path) = &args.save_camera {
        let text =
            serde_json::to_string_pretty(&cameras[0]).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    engine.build_patches(&settings, &JobBar::new(quiet))?;
    make_even_splats(&engine, &settings, quiet)?;
    engine.set_costs(costs_of(&backend, &[settings]));
    if let Some(staged) = &mut staged {
        engine.set_photos(Some(staged.frame(&views[0])))?;
    }
    if args.stats.is_some() {
        for _ in 0..WARM_UP {
            engine.draw(&views[0], &settings)?;
        }
    }
    let bar = JobBar::new(quiet);
    bar.stage("draw", views.len() as u64);
    let mut times = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        if is_interrupted() {
            return Err(CommandFailure::Run(anyhow::anyhow!(
                "cancelled after {index} frames"
            )));
        }
        if let (Some(staged), true) = (&mut staged, index > 0) {
            engine.set_photos(Some(staged.frame(view)))?;
        }
        times.push(engine.draw(view, &settings)?);
        for message in engine.take_page_messages() {
            say(&format!(
                "surfel: warning: {message}; what is known of that part is drawn coarser"
            ));
        }
        if args.wants_picture() {
            let mut picture = match args.samples {
                None if is_smooth => RenderedPicture::Mean(engine.smooth(view, &settings)?),
                None | Some(1) => RenderedPicture::Single(engine.read(view)?),
                Some(samples) => {
                    let k = f64::from(samples).sqrt().round() as u32;
                    RenderedPicture::Mean(engine.supersample(view, &settings, k)?)
                }
            };
            if let Some(list) = &measures {
                picture.mark_lines(&MarkedLines::of(&list.lines, view, ready.model.origin));
            }
            let center = (sphere.center - ready.model.origin).as_vec3();
            let unit = ready.format.unit().filter(|_| others.is_empty());
            let marks = args.marks.of_view(view, center, unit, &ready.warnings);
            picture.mark(&marks);
            args.write_picture(&picture, index as u32)?;
        }
        bar.advance(1);
    }
    drop(bar);
    if !quiet {
        tell_overdraw(&times);
    }
    if let Some(path) = &args.stats {
        let mut stats = super::stats::of(&ready, &backend, &settings, size, &times);
        if !others.is_empty() {
            stats["more_models"] = others.iter().map(super::info::facts).collect();
        }
        let text =
            serde_json::to_string_pretty(&stats).map_err(|e| CommandFailure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    validated(&backend)
}
