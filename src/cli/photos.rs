//! `surfel photos`, and what `surfel info` says of a scene of photographs.

use super::progress::JobBar;
use super::render::DeviceArgs;
use super::{CommandFailure, Outcome, print, say, usage, write_text};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use surfel::chart::plot::walk::{WalkLine, walk_svg};
use surfel::image::FloatImage;
use surfel::math::camera::Camera;
use surfel::photos::check::{SceneCheck, check_scene};
use surfel::photos::error::PhotoError;
use surfel::photos::formats::read_scene;
use surfel::photos::look::{LookSettings, PhotoDirection, WeightForm};
use surfel::photos::report::{picture_file, score_json, score_page, score_text};
use surfel::photos::scene::{CalibratedCamera, PhotoScene};
use surfel::photos::score::{PhotoJudge, ladder};
use surfel::photos::session::{PhotoChoice, PhotoSession, SessionOptions};
use surfel::photos::stage::PhotoStage;
use surfel::photos::surface::{SurfaceDrawer, calibrated_camera};
use surfel::photos::walk::{PhotoWalk, WalkFigures, WalkStep, walk_cameras, walk_csv};
use surfel::tree::Model;

/// Examples of what is built in.
fn after_help() -> String {
    let of_window = "  surfel photos castle                 look at a scene in a window: its points with photographs\n  surfel photos castle --mesh castle/mesh.ply\n";
    let of_window = if cfg!(feature = "viewer") {
        of_window
    } else {
        ""
    };
    format!(
        "Examples:\n{of_window}  surfel photos score castle --mesh castle/mesh.ply -o scores\n  surfel photos render castle --mesh castle/mesh.ply --camera-of 3 --leave-out -o picture.png\n  surfel photos walk castle --mesh castle/mesh.ply -o walk.svg\n  surfel info castle                   cameras, and whether their conventions are right"
    )
}

/// Photographs on a mesh or on their own points: look at them in a window, draw, or measure how well they predict one that is
/// left out.
#[derive(Debug, clap::Args)]
#[cfg_attr(
    feature = "viewer",
    command(
        override_usage = "surfel photos [OPTIONS] SCENE\n       surfel photos <COMMAND>",
        mut_arg("model", |arg| arg
            .value_name("SCENE")
            .help("Scene of photographs to look at in a window: a file or folder, as of the commands")),
        mut_arg("more", |arg| arg.hide(true))
    )
)]
#[command(
    arg_required_else_help = true,
    subcommand_negates_reqs = true,
    after_help = after_help()
)]
pub(crate) struct PhotosArgs {
    #[command(subcommand)]
    command: Option<PhotosCommand>,
    /// Look at photographs on this mesh, in the frame of their cameras [default: on the points of the scene]
    #[cfg(feature = "viewer")]
    #[arg(long, value_name = "MODEL")]
    mesh: Option<PathBuf>,
    #[cfg(feature = "viewer")]
    #[command(flatten, next_help_heading = "Options of the window")]
    pub(super) view: super::view::ViewArgs,
}

#[derive(Debug, clap::Subcommand)]
enum PhotosCommand {
    /// Predict each photograph from the others by a ladder of methods, and compare
    Score(ScoreArgs),
    /// Draw the mesh with photographs on it
    Render(PhotoRenderArgs),
    /// Measure how much the picture changes on the way from photograph to photograph, beside a fixed texture
    Walk(WalkArgs),
}

/// A scene with its mesh.
#[derive(Debug, clap::Args)]
struct SceneArgs {
    /// Scene of photographs: a file or folder of Bundler, COLMAP, OpenMVS, VisualSFM, AliceVision, RealityCapture, nerfstudio
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Mesh or points in the frame of the cameras
    #[arg(long, value_name = "MODEL")]
    mesh: PathBuf,
    /// Folder of the photographs, where they are not beside the scene
    #[arg(long, value_name = "FOLDER")]
    photos: Option<PathBuf>,
    /// Photographs that a picture uses at most
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=64))]
    most: u32,
    #[command(flatten)]
    device: DeviceArgs,
}

#[derive(Debug, clap::Args)]
struct ScoreArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Longest side at which pictures are compared, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(16..=8192))]
    side: u32,
    /// Folder for a page with all pictures; made if it is not there
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct WalkArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Frames of the walk, evenly on the way through all poses
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    frames: u32,
    /// Longest side of pictures, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 500, value_parser = clap::value_parser!(u32).range(16..=8192))]
    side: u32,
    /// Every step: .csv, .svg or .png
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
struct PhotoRenderArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Draw from the pose of a photograph: its name or its number from 0
    #[arg(
        long,
        value_name = "PHOTO",
        required_unless_present = "camera",
        conflicts_with = "camera"
    )]
    camera_of: Option<String>,
    /// Draw from a camera file
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Use all photographs but the one of --camera-of
    #[arg(long, requires = "camera_of")]
    leave_out: bool,
    /// Longest side of the picture of --camera-of, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(16..=8192))]
    side: u32,
    /// Formula of the weights
    #[arg(long, value_enum, value_name = "FORM", default_value_t = FormChoice::Quality)]
    form: FormChoice,
    /// Photographs that a pixel blends at most, where they agree
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=3))]
    blend: u32,
    /// Picture: .png
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Formulas of the weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormChoice {
    /// By ray, texels, border and visibility.
    Quality,
    /// Princ's, mended.
    Mended,
    /// Princ's, as printed.
    Printed,
}

impl From<PhotoError> for CommandFailure {
    fn from(error: PhotoError) -> Self {
        surfel::Error::from(error).into()
    }
}

pub(crate) fn run(args: PhotosArgs, quiet: bool) -> Outcome {
    match args.command {
        Some(PhotosCommand::Score(args)) => score(args, quiet),
        Some(PhotosCommand::Render(args)) => render(args, quiet),
        Some(PhotosCommand::Walk(args)) => walk(args, quiet),
        #[cfg(feature = "viewer")]
        None => super::view::run(args.view.of_scene(args.mesh)?, quiet),
        #[cfg(not(feature = "viewer"))]
        None => Err(usage("no command; see surfel photos --help")),
    }
}

impl SceneArgs {
    /// Reads scene and mesh, and says what was left out.
    fn open(&self, quiet: bool) -> Result<(PhotoScene, Model), CommandFailure> {
        let scene = read_scene(&self.scene, self.photos.as_deref())?;
        for remark in &scene.remarks {
            say(&format!("surfel: {}: {remark}", self.scene.display()));
        }
        let opened = surfel::open(&self.mesh, &Default::default(), &JobBar::new(quiet))?;
        for warning in &opened.warnings {
            say(&format!("surfel: {}: warning: {warning}", opened.name));
        }
        Ok((scene, opened.model))
    }

    fn session<'m>(
        &self,
        scene: &'m PhotoScene,
        model: &'m Model,
        quiet: bool,
    ) -> Result<PhotoSession<'m>, CommandFailure> {
        let backend = self.device.open()?;
        let options = SessionOptions {
            most_photos: self.most as usize,
            ..SessionOptions::default()
        };
        let drawer = SurfaceDrawer::new(&backend, model);
        let session = PhotoSession::new(scene, drawer, options, &JobBar::new(quiet))?;
        for remark in &session.remarks {
            say(&format!("surfel: warning: {remark}"));
        }
        Ok(session)
    }
}

fn score(args: ScoreArgs, quiet: bool) -> Outcome {
    let (scene, model) = args.scene.open(quiet)?;
    let mut session = args.scene.session(&scene, &model, quiet)?;
    if let Some(folder) = &args.output {
        std::fs::create_dir_all(folder).map_err(|e| {
            let text = format!("cannot make the folder {}", folder.display());
            CommandFailure::Run(anyhow::Error::new(e).context(text))
        })?;
    }
    let rungs = ladder();
    let mut judge = PhotoJudge {
        session: &mut session,
        rungs: rungs.clone(),
        longest_side: args.side,
    };
    let mut number = 0;
    let scores = judge.score_all(&JobBar::new(quiet), &mut |_, pictures| {
        let Some(folder) = &args.output else {
            return Ok(());
        };
        let at = |what: &str| folder.join(picture_file(number, what));
        pictures.photo.save_png(&at("photo"))?;
        pictures.mask.save_png(&at("mask"))?;
        for (rung, picture) in rungs.iter().zip(&pictures.rungs) {
            picture.save_png(&at(rung.name))?;
        }
        number += 1;
        Ok(())
    })?;
    let json = serde_json::to_string_pretty(&score_json(&rungs, &scores));
    let json = json.map_err(|e| CommandFailure::Run(e.into()))? + "\n";
    if let Some(folder) = &args.output {
        write_text(&folder.join("scores.json"), &json)?;
        write_text(&folder.join("index.html"), &score_page(&rungs, &scores))?;
    }
    print(&if args.json {
        json
    } else {
        score_text(&rungs, &scores)
    })
}

/// The camera that is asked for, and the photograph that has it.
fn wanted_camera(
    args: &PhotoRenderArgs,
    scene: &PhotoScene,
) -> Result<(CalibratedCamera, Option<usize>), CommandFailure> {
    if let Some(path) = &args.camera {
        let camera = calibrated_camera(&Camera::read(path)?);
        let refused = || {
            usage(format!(
                "{}: photographs need a perspective camera",
                path.display()
            ))
        };
        return Ok((camera.ok_or_else(refused)?, None));
    }
    let name = args.camera_of.as_deref().unwrap_or_default();
    let index = scene.find(name).ok_or_else(|| {
        usage(format!(
            "{}: there is no photograph {name}; surfel info lists {} of them, numbered from 0",
            scene.path.display(),
            scene.photos.len()
        ))
    })?;
    let camera = scene.photos[index].camera;
    let longest = f64::from(camera.width.max(camera.height).max(1));
    let scale = (f64::from(args.side) / longest).min(1.0);
    let side = |pixels: u32| (f64::from(pixels) * scale).round().max(1.0) as u32;
    let scaled = camera
        .pinhole()
        .scaled(side(camera.width), side(camera.height));
    Ok((scaled, Some(index)))
}

fn render(args: PhotoRenderArgs, quiet: bool) -> Outcome {
    super::render::require_ending("--output", Some(&args.output), &["png"])?;
    super::check_outputs(&[&args.output], &args.scene.mesh)?;
    let (scene, model) = args.scene.open(quiet)?;
    let (camera, index) = wanted_camera(&args, &scene)?;
    let mut session = args.scene.session(&scene, &model, quiet)?;
    let left_out = index.filter(|_| args.leave_out);
    let allowed: Vec<usize> = session
        .usable()
        .into_iter()
        .filter(|i| Some(*i) != left_out)
        .collect();
    let usual = LookSettings::default();
    let settings = match args.form {
        FormChoice::Quality => usual,
        FormChoice::Mended => LookSettings {
            form: WeightForm::Mended,
            limit_cos: 70_f32.to_radians().cos(),
            ..usual
        },
        FormChoice::Printed => LookSettings {
            form: WeightForm::Printed,
            direction: PhotoDirection::Hull,
            limit_cos: 70_f32.to_radians().cos(),
            ..usual
        },
    };
    let settings = LookSettings {
        blend: args.blend,
        ..settings
    };
    let surface = session.drawer().surface(&camera)?;
    let picture = session.picture(&camera, &surface, PhotoChoice::of(&allowed), &settings)?;
    let colors = session.vertex_colors(&allowed)?;
    let base = session.drawer().vertex_colors(&colors, &camera)?;
    let color = picture
        .pixels
        .iter()
        .zip(&base)
        .map(|(pixel, base)| match pixel.weight > 0.0 {
            true => [pixel.color[0], pixel.color[1], pixel.color[2], 1.0],
            // Uncovered: the mean color of the vertices.
            false => *base,
        });
    let image = FloatImage {
        width: picture.width,
        height: picture.height,
        color: color.collect(),
        ..FloatImage::default()
    };
    Ok(image.to_image().save_png(&args.output)?)
}

fn walk(args: WalkArgs, quiet: bool) -> Outcome {
    let endings = &["csv", "svg", "png"];
    super::render::require_ending("--output", args.output.as_ref(), endings)?;
    super::check_outputs(&args.output.iter().collect::<Vec<_>>(), &args.scene.mesh)?;
    let (scene, model) = args.scene.open(quiet)?;
    let backend = args.scene.device.open()?;
    let drawer = SurfaceDrawer::new(&backend, &model);
    let most = args.scene.most as usize;
    // Twice the picture: levels beyond are seen by nobody.
    let longest_side = 2 * args.side;
    let bar = JobBar::new(quiet);
    let (mut stage, remarks) = PhotoStage::load(&scene, &drawer, most, longest_side, &bar)?;
    for remark in remarks {
        say(&format!("surfel: warning: {remark}"));
    }
    let mut walk = PhotoWalk {
        scene: &scene,
        model: &model,
        stage: &mut stage,
        backend: &backend,
        longest_side,
        settings: LookSettings::default(),
    };
    let cameras = walk_cameras(&walk.poses(), args.frames as usize, args.side);
    let steps = walk.measure(&cameras, &bar)?;
    drop(bar);
    let found = WalkFigures::of(&steps);
    if let Some(path) = &args.output {
        let ending = path.extension().map(|e| e.to_ascii_lowercase());
        if ending.is_some_and(|e| e == "csv") {
            write_text(path, &walk_csv(&steps))?;
        } else {
            super::reproduce::write_chart(path, &walk_chart(&steps, &found))?;
        }
    }
    print(&format!(
        "{} steps, mean FLIP from frame to frame: at most {:.4} by view (after frame {}), {:.4} with a fixed texture: {:.2} times; in one step at most {:.2} times\n",
        steps.len(),
        found.largest_by_view,
        found.worst_frame,
        found.largest_fixed,
        found.ratio,
        found.step_ratio
    ))
}

fn walk_chart(steps: &[WalkStep], found: &WalkFigures) -> String {
    let line = |name: &str, of: fn(&WalkStep) -> f64| WalkLine {
        name: name.into(),
        values: steps.iter().map(of).collect(),
    };
    let lines = [
        line("photographs by view", |step| step.by_view),
        line("a fixed texture", |step| step.fixed),
    ];
    let exchanges = steps
        .iter()
        .enumerate()
        .filter(|(_, step)| step.exchanged > 0);
    let exchanges: Vec<usize> = exchanges.map(|(step, _)| step).collect();
    let title = format!(
        "Change from frame to frame: the largest is {:.2} times that of a fixed texture",
        found.ratio
    );
    walk_svg(&title, "mean FLIP", &lines, &exchanges)
}

/// Prints what is in a scene of photographs.
pub(crate) fn info(path: &Path, as_json: bool) -> Outcome {
    let scene = read_scene(path, None)?;
    let check = check_scene(&scene);
    if as_json {
        let text = serde_json::to_string_pretty(&facts(&scene, &check));
        return print(&(text.map_err(|e| CommandFailure::Run(e.into()))? + "\n"));
    }
    print(&text(path, &scene, &check))
}

fn facts(scene: &PhotoScene, check: &SceneCheck) -> Value {
    let correlation = |index: usize| {
        let found = check.photos.iter().find(|photo| photo.photo == index);
        found.and_then(|photo| photo.correlation)
    };
    let photo = |index: usize| {
        let photo = &scene.photos[index];
        let camera = &photo.camera;
        json!({
            "name": photo.name,
            "file": photo.file,
            "mask": photo.mask,
            "width": camera.width,
            "height": camera.height,
            "focal": camera.focal,
            "principal": camera.principal,
            "distortion": camera.lens.model.name(),
            "coefficients": camera.lens.coefficients,
            "center": camera.center.to_array(),
            "axis": camera.axis().to_array(),
            "correlation": correlation(index),
        })
    };
    json!({
        "scene": scene.path,
        "format": scene.format.name(),
        "photos": (0..scene.photos.len()).map(photo).collect::<Vec<_>>(),
        "sparse_points": scene.points.len(),
        "correlation": check.correlation,
        "reprojection_px": check.reprojection_px,
        "remarks": scene.remarks,
        "warnings": check.warnings,
    })
}

fn text(path: &Path, scene: &PhotoScene, check: &SceneCheck) -> String {
    let there = scene
        .photos
        .iter()
        .filter(|photo| photo.file.is_some())
        .count();
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "{} ({})\n  {} cameras, {there} photographs, {} sparse points",
        path.display(),
        scene.format.name(),
        scene.photos.len(),
        scene.points.len()
    );
    let width = scene
        .photos
        .iter()
        .map(|photo| photo.name.chars().count())
        .max();
    let width = width.unwrap_or(0).min(44);
    for (index, photo) in scene.photos.iter().enumerate() {
        let camera = &photo.camera;
        let ending = photo.file.as_deref().and_then(Path::extension);
        let ending = ending.map_or("not there".into(), |e| e.to_string_lossy().to_uppercase());
        let [x, y] = camera.principal;
        let size = match camera.width > 0 {
            true => format!(
                "{} x {} (principal point {x:.1} {y:.1}) ",
                camera.width, camera.height
            ),
            false => String::new(),
        };
        let found = check.photos.iter().find(|found| found.photo == index);
        let correlation = found.and_then(|found| found.correlation);
        let correlation = correlation.map_or(String::new(), |r| format!(", correlation {r:.2}"));
        let _ = writeln!(
            out,
            "  {index:>4} {:<width$} {size}{ending}, focal length {:.1}, distortion {}{correlation}",
            photo.name,
            camera.focal[0],
            camera.lens.model.name()
        );
    }
    if let Some(r) = check.correlation {
        let _ = writeln!(out, "  sparse points and photographs correlate at {r:.2}");
    }
    if let Some(px) = check.reprojection_px {
        let _ = writeln!(
            out,
            "  points are measured {px:.2} pixels from where they project (median)"
        );
    }
    for remark in &scene.remarks {
        let _ = writeln!(out, "  {remark}");
    }
    for warning in &check.warnings {
        let _ = writeln!(out, "  warning: {warning}");
    }
    out
}
