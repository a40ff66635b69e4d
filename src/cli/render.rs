//! `surfel render`

use super::auto::AutoArgs;
use super::costs::costs_of;
use super::look::LookArgs;
use super::progress::{Bar, is_interrupted};
use super::source::Source;
use super::{Failure, Outcome, say, usage, write_text};
use clap::Args as ClapArgs;
use std::path::{Path, PathBuf};
use surfel::OpenedModel;
use surfel::gpu::{DeviceOptions as GpuOptions, Error as GpuError, Gpu};
use surfel::image::{FloatImage, Image};
use surfel::math::camera::Camera;
use surfel::pack::ColorBy;
use surfel::progress::Progress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameTimes;
use surfel::render::stats::OverdrawSummary;
use surfel::render::vulkan::overdraw;
#[cfg(feature = "viewer")]
use surfel::render::window_renderer::WindowBackend;

/// Backends that can be asked for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum BackendChoice {
    /// The Vulkan device; the processor where that is faster than a software device, or where there is no Vulkan
    #[default]
    Auto,
    /// The Vulkan device alone
    Vulkan,
    /// The processor alone, without Vulkan: squares, discs and filtered splats, triangles
    Cpu,
    /// The reference on the processor, without Vulkan: exact and slow
    Reference,
}

/// Which device draws.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct DeviceArgs {
    /// Device by index or part of its name (see `surfel devices`); `cpu` and `mirror` stand for --backend cpu and reference
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

    /// The backend of a window's frames.
    #[cfg(feature = "viewer")]
    pub(crate) fn window_backend(&self) -> Result<WindowBackend, Failure> {
        let is_named = matches!(self.device.as_deref(), Some(Backend::CPU | Backend::MIRROR));
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
    pub(crate) fn open(&self) -> Result<Backend, Failure> {
        let options = self.options();
        if self.backend != BackendChoice::Auto && self.device.is_some() {
            let is_named = matches!(self.device.as_deref(), Some(Backend::CPU | Backend::MIRROR));
            if is_named || self.backend != BackendChoice::Vulkan {
                return Err(usage("--backend cpu and reference have no --device"));
            }
        }
        match self.backend {
            BackendChoice::Cpu => Ok(Backend::Cpu),
            BackendChoice::Reference => Ok(Backend::Mirror),
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
        Some(first) => Err(Failure::Run(anyhow::anyhow!(
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
  surfel render horse.ply -o horse.png --backend cpu     without Vulkan
  surfel render horse.ply -o close.png --orbit 30,20,4 --cut-camera far.json   the splats of a far view, seen close
  surfel render --scene fence -o fence.png --splat filtered   what a method does where it is hard (surfel scenes)";

/// Draw a model into a picture file.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
// The model of a scene is the scene's own.
#[command(mut_arg("model", |a| a.required(false).required_unless_present("scene").default_value("scene:").hide_default_value(true)))]
pub(crate) struct Args {
    #[command(flatten)]
    source: Source,
    /// Draw a built-in scene with its own camera, picture size and threshold, unless those are given; `list` lists them
    #[arg(long, value_name = "NAME", conflicts_with = "model")]
    scene: Option<String>,
    /// Picture to write: .png (8 bit) or .exr (float)
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
    /// Draw the cut of this camera, which shows from elsewhere what it draws (--method pop and splats)
    #[arg(long, value_name = "FILE")]
    cut_camera: Option<PathBuf>,
    /// Write the camera that was used
    #[arg(long, value_name = "FILE")]
    save_camera: Option<PathBuf>,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    auto: AutoArgs,
    /// Samples per pixel, averaged: 1, 4, 9, 16, 25, 36, 49 or 64
    #[arg(long, value_name = "N", default_value_t = 1)]
    samples: u32,
    /// Draw N views of the standard orbit in one process (azimuth (k + 1/2) 360/N degrees)
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "camera")]
    frames: u32,
    /// Write counts and times as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(crate) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match sides {
        Some((w, h)) if (1..=16_384).contains(&w) && (1..=16_384).contains(&h) => Ok((w, h)),
        Some(_) => Err("each side must be 1 to 16384 pixels".into()),
        None => Err("expected width x height such as 1024x768".into()),
    }
}

pub(crate) fn parse_orbit(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|p| p.trim().parse().ok()).collect();
    let [azimuth, elevation, fill] = match numbers.as_deref() {
        Some(&[a, e]) => [a, e, 1.0],
        Some(&[a, e, f]) => [a, e, f],
        _ => return Err("expected AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,FILL".into()),
    };
    if !azimuth.is_finite() || !(-90.0..=90.0).contains(&elevation) {
        return Err("the azimuth must be finite and the elevation -90 to 90 degrees".into());
    }
    if !(fill > 1e-6 && fill <= 1e4) {
        return Err("the fill must be above 0 (1 fills the picture)".into());
    }
    Ok([azimuth, elevation, fill])
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

/// `turn.png` of frame 7 is `turn-007.png` when there are several frames.
fn numbered(path: &Path, frame: u32, frames: u32) -> PathBuf {
    if frames <= 1 {
        return path.to_owned();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    // Wide enough for all of them, so that names sort like frames.
    let digits = (frames - 1).to_string().len().max(3);
    path.with_file_name(format!("{stem}-{frame:0digits$}.{extension}"))
}

/// The size of the picture, and a camera file.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct CameraArgs {
    /// Size of the picture in pixels [default: 500x500, or the camera's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Camera file to begin with (JSON: width, height, view, proj)
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    camera: Option<PathBuf>,
}

impl CameraArgs {
    /// The camera of the file, in the size asked for; none where an orbit decides.
    pub(crate) fn read(&self) -> Result<Option<Camera>, Failure> {
        let camera = self.camera.as_deref().map(read_camera).transpose()?;
        camera.map(|camera| resized(camera, self.size)).transpose()
    }

    /// The size asked for.
    pub(crate) fn size(&self) -> Option<(u32, u32)> {
        self.size
    }
}

/// The camera of `orbit` for a model.
pub(crate) fn orbit_camera(
    ready: &OpenedModel,
    size: (u32, u32),
    [azimuth, elevation, fill]: [f64; 3],
) -> Camera {
    let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
    ready.model.orbit_camera(size, azimuth, elevation, fill)
}

/// Reads a camera file; every error names it.
pub(crate) fn read_camera(path: &Path) -> Result<Camera, Failure> {
    Camera::read(path).map_err(|error| match error {
        error @ surfel::math::camera::Error::Value(_) => {
            Failure::Input(anyhow::Error::new(error).context(path.display().to_string()))
        }
        other => other.into(),
    })
}

/// The camera of a file, in the size asked for.
fn resized(mut camera: Camera, size: Option<(u32, u32)>) -> Result<Camera, Failure> {
    if let Some((width, height)) = size {
        if u64::from(width) * u64::from(camera.height)
            != u64::from(height) * u64::from(camera.width)
        {
            return Err(usage(format!(
                "--size {width}x{height} has another shape than the camera's {}x{}",
                camera.width, camera.height
            )));
        }
        (camera.width, camera.height) = (width, height);
    }
    Ok(camera)
}

/// `frames` cameras of the standard orbit, or the one of `--orbit`.
pub(crate) fn orbit_cameras(
    ready: &OpenedModel,
    size: Option<(u32, u32)>,
    orbit: Option<[f64; 3]>,
    frames: u32,
) -> Vec<Camera> {
    let size = size.unwrap_or((500, 500));
    if frames == 1 {
        return vec![orbit_camera(
            ready,
            size,
            orbit.unwrap_or([30.0, 20.0, 1.0]),
        )];
    }
    let [azimuth, elevation, fill] = orbit.unwrap_or([0.0, 20.0, 1.0]);
    (0..frames)
        .map(|k| {
            let turn = (f64::from(k) + 0.5) * 360.0 / f64::from(frames);
            orbit_camera(ready, size, [azimuth + turn, elevation, fill])
        })
        .collect()
}

impl Args {
    fn check(&self) -> Outcome {
        require_ending("--output", self.output.as_ref(), &["png", "exr"])?;
        require_ending("--depth", self.depth.as_ref(), &["exr", "npy"])?;
        require_ending("--normals", self.normals.as_ref(), &["exr"])?;
        require_ending("--coverage", self.coverage.as_ref(), &["png"])?;
        let root = f64::from(self.samples).sqrt().round() as u32;
        if self.samples == 0 || root * root != self.samples || self.samples > 64 {
            return Err(usage(format!(
                "--samples {}: expected a square from 1 to 64",
                self.samples
            )));
        }
        if self.samples > 1 && (self.depth.is_some() || self.normals.is_some()) {
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
        super::check_outputs(&paths, &self.source.model)
    }

    fn wants_picture(&self) -> bool {
        self.output.is_some()
            || self.depth.is_some()
            || self.normals.is_some()
            || self.coverage.is_some()
    }

    fn write_picture(&self, picture: &Picture, frame: u32) -> Outcome {
        let name = |path: &PathBuf| numbered(path, frame, self.frames);
        if let Some(path) = &self.output {
            match (picture, ending(path).as_str()) {
                (Picture::Single(image), "png") => image.save_png(&name(path))?,
                (Picture::Single(image), _) => image.save_exr(&name(path))?,
                (Picture::Mean(mean), "png") => mean.to_image().save_png(&name(path))?,
                (Picture::Mean(mean), _) => mean.save_exr(&name(path))?,
            }
        }
        if let Some(path) = &self.coverage {
            match picture {
                Picture::Single(image) => image.save_coverage_png(&name(path))?,
                Picture::Mean(mean) => mean.to_image().save_coverage_png(&name(path))?,
            }
        }
        if let (Some(path), Picture::Single(image)) = (&self.depth, picture) {
            match ending(path).as_str() {
                "npy" => image.save_npy(&name(path))?,
                _ => image.save_depth_exr(&name(path))?,
            }
        }
        if let (Some(path), Picture::Single(image)) = (&self.normals, picture) {
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

enum Picture {
    Single(Image),
    Mean(FloatImage),
}

/// Frames drawn before the first that counts when times are asked for: shaders are compiled at the first draw.
const WARM_UP: u32 = 2;

pub(crate) fn run(mut args: Args, quiet: bool) -> Outcome {
    match args.scene.as_deref() {
        Some("list") => return super::scenes::print_list(),
        Some(name) => args.source.model = PathBuf::from(format!("scene:{name}")),
        None => {}
    }
    args.check()?;
    args.auto.check(args.look.is_auto())?;
    args.look.default_eye_dome();
    let mut settings = args.look.settings_to_choose()?;
    if args.samples > 1 && settings.color_by == ColorBy::Overdraw {
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
    let ready = args.source.open(quiet)?;
    // A scene that is named as a model is looked at as any model.
    let scene = ready.scene.as_ref().filter(|_| args.scene.is_some());
    if let Some(scene) = scene
        && !args.look.is_auto()
    {
        args.look.default_threshold(scene.threshold_px);
        settings = args.look.settings_to_choose()?;
    }
    // Another view of the scene is one of its model.
    let is_its_own = args.camera.is_none() && args.orbit.is_none() && args.frames == 1;
    let own = scene.filter(|_| is_its_own).map(|s| s.camera.clone());
    let camera = read.or(own);
    let cameras = match camera {
        Some(camera) => vec![resized(camera, args.size)?],
        None => orbit_cameras(&ready, args.size, args.orbit, args.frames),
    };
    let backend = args.device.open()?;
    let size = (cameras[0].width, cameras[0].height);
    let outputs = PictureOutputs {
        depth: args.depth.is_some(),
        normal: args.normals.is_some(),
        values: false,
    };
    let mut engine = Engine::new(&backend, &ready.model, size, outputs)?;
    let views = cameras
        .iter()
        .map(|c| c.view(ready.model.origin))
        .collect::<Result<Vec<_>, _>>()?;
    if args.look.is_auto() {
        settings = args
            .auto
            .choose(settings, &backend, &ready, &views[0], quiet)?;
    }
    if let Some(camera) = cut_camera {
        settings.cut_view = Some(camera.view(ready.model.origin)?);
    }
    if let Some(path) = &args.save_camera {
        let text = serde_json::to_string_pretty(&cameras[0]).map_err(|e| Failure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    engine.set_costs(costs_of(&backend, &[settings]));
    if args.stats.is_some() {
        for _ in 0..WARM_UP {
            engine.draw(&views[0], &settings)?;
        }
    }
    let bar = Bar::new(quiet);
    bar.stage("draw", views.len() as u64);
    let mut times = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        if is_interrupted() {
            return Err(Failure::Run(anyhow::anyhow!(
                "cancelled after {index} frames"
            )));
        }
        times.push(engine.draw(view, &settings)?);
        if args.wants_picture() {
            let picture = if args.samples > 1 {
                let k = f64::from(args.samples).sqrt().round() as u32;
                Picture::Mean(engine.supersample(view, &settings, k)?)
            } else {
                Picture::Single(engine.read(view)?)
            };
            args.write_picture(&picture, index as u32)?;
        }
        bar.advance(1);
    }
    drop(bar);
    if !quiet {
        tell_overdraw(&times);
    }
    if let Some(path) = &args.stats {
        let stats = super::stats::of(&ready, &backend, &settings, size, &times);
        let text = serde_json::to_string_pretty(&stats).map_err(|e| Failure::Run(e.into()))?;
        write_text(path, &(text + "\n"))?;
    }
    validated(&backend)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_options_are_read_as_documented() {
        assert_eq!(parse_size("1024x768"), Ok((1024, 768)));
        assert!(
            parse_size("0x5").is_err()
                && parse_size("5").is_err()
                && parse_size("99999x1").is_err()
        );
        assert_eq!(parse_orbit("30,20"), Ok([30.0, 20.0, 1.0]));
        assert_eq!(parse_orbit("-30,-20,0.5"), Ok([-30.0, -20.0, 0.5]));
        assert!(
            parse_orbit("1,91,1").is_err()
                && parse_orbit("1,2,0").is_err()
                && parse_orbit("x").is_err()
        );
    }

    #[test]
    fn frames_are_numbered_only_when_there_are_several() {
        assert_eq!(
            numbered(Path::new("a/turn.png"), 7, 36),
            Path::new("a/turn-007.png")
        );
        assert_eq!(
            numbered(Path::new("turn.PNG"), 7, 2000),
            Path::new("turn-0007.PNG")
        );
        assert_eq!(numbered(Path::new("one.exr"), 0, 1), Path::new("one.exr"));
    }
}
