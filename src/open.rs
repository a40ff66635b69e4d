//! The one door to a model: [`open()`] takes what a name means (a file, standard input, a generator, a scene) and gives a
//! [`Model`] that can be drawn.
//!
//! Command line, window and library users all come through here. A stream is opened once and decided by its first bytes: a
//! tree file is read as it is, of a `.qs` file the leaves, of a scene of photographs its points; anything else goes to
//! [`input`] and then to [`tree::build`]. Nothing is printed: what was repaired or left out comes back as
//! [`OpenedModel::warnings`], what is wrong as one [`Error`].

pub mod cross_section;
pub mod export;
pub mod file_place;
pub(crate) mod keep;
pub mod memory_need;
mod paged;
pub mod photo_scene;
pub mod recolor;
mod source_format;
mod stream;
mod surface_section;
#[cfg(test)]
mod tests;

use memory_need::MemoryNeed;
use paged::{is_address, read_address, read_pages};
pub use source_format::SourceFormat;
pub use stream::{OpenedStream, external_options, open_stream};

use crate::Error;
use crate::generate::{self, ShapeSpec};
use crate::input::{self, FileCounts, FilePart, Format, InputStream, PointFilter, ReadWarning};
use crate::math::camera::Camera;
use crate::math::up_axis::UpAxis;
use crate::mesh::Mesh;
use crate::mesh::attributes::PointAttributes;
use crate::mesh::color_legend::LegendEntries;
use crate::mesh::creases::USUAL_CREASE_DEGREES;
use crate::mesh::placement::MeshPlacement;
use crate::pages;
use crate::pages::file::PagedFile;
use crate::pages::qs::{self, QsCloud};
pub use crate::pages::reading::PageReading;
use crate::pages::source::{ByteSource, FileSource, MemorySource};
use crate::progress::Progress;
use crate::scenes::{self, SceneError};
use crate::tree::{self, BuildOptions, Model, PointNormals};
use glam::DVec3;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Options of opening a model. The default keeps the vertices of a file as they are.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Options of reading files, and limits.
    pub input: input::ReadOptions,
    /// Let the first view frame everything, however far off ([`Model::framed`] is then `None`).
    pub frame_all: bool,
    /// Amount of a paged tree file that is read.
    pub page_reading: PageReading,
    /// Memory that the model may take as a whole, bytes; `None`: what the system has free, where it says so.
    pub memory_bytes: Option<u64>,
    /// Place and color of the model; trees, which are built already, have their own.
    pub placement: MeshPlacement,
    /// Points that are kept of the model; its tree is that of the whole, cut down ([`Model::kept`]).
    pub keep: PointFilter,
    /// Options of building the tree. A crease angle replaces the normals of the file; without one these are kept, and where there
    /// are none the angle is [`USUAL_CREASE_DEGREES`].
    pub tree: BuildOptions,
}

/// Source of a model.
#[derive(Debug, Clone)]
pub enum ModelSource {
    /// A file: a model or a tree.
    File(PathBuf),
    /// Standard input: a model or a tree.
    StandardInput,
    /// A generated model.
    Generator(ShapeSpec),
    /// A built-in scene.
    Scene(&'static scenes::SceneEntry),
    /// A paged tree on a web server.
    Address(String),
}

impl ModelSource {
    /// The source that a name means: `-` is standard input, `generate:SHAPE[:TRIANGLES]` a generator, `scene:NAME` a
    /// built-in scene, `http://...` a paged tree on a web server, anything else a file. A file with such a name is meant by `./`
    /// before it. Touches no file and no network.
    ///
    /// # Errors
    /// An unknown shape or scene, a bad number of triangles, or an address of a kind that is not fetched.
    pub fn parse(name: &Path) -> Result<Self, Error> {
        let file = || Self::File(name.to_owned());
        let Some(text) = name.to_str() else {
            return Ok(file());
        };
        if text == "-" {
            Ok(Self::StandardInput)
        } else if let Some(spec) = text.strip_prefix("generate:") {
            Ok(Self::Generator(spec.parse()?))
        } else if let Some(scene) = text.strip_prefix("scene:") {
            let entry = scenes::find(scene).ok_or_else(|| SceneError::Unknown(scene.to_owned()))?;
            Ok(Self::Scene(entry))
        } else if is_address(text) {
            let url = text.to_owned();
            let scheme = text.split(':').next().unwrap_or("").to_ascii_lowercase();
            match scheme.as_str() {
                "http" if cfg!(feature = "remote") => Ok(Self::Address(url)),
                "https" if cfg!(feature = "https") => Ok(Self::Address(url)),
                "https" if cfg!(feature = "remote") => {
                    let cause = "this program was built without https; build it with --features https, or download the file";
                    let cause = cause.to_owned();
                    Err(input::Error::Fetch { url, cause }.into())
                }
                _ => Err(input::Error::Remote { url }.into()),
            }
        } else {
            Ok(file())
        }
    }
}

/// View that a scene is looked at in.
#[derive(Debug, Clone)]
pub struct SceneView {
    /// The camera, with the size of the picture.
    pub camera: Camera,
    /// Threshold at which the scene's failure shows, pixels.
    pub threshold_px: f32,
}

/// The axis that is up in a model, and why that is thought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpGuess {
    /// The axis.
    pub axis: UpAxis,
    /// Why, in words; empty where nothing says another than y.
    pub reason: &'static str,
}

impl UpGuess {
    /// Decides by the format, then by where the model lies.
    fn of(format: SourceFormat, model: &Model) -> Self {
        let z = |reason| Self {
            axis: UpAxis::Z,
            reason,
        };
        let y = Self {
            axis: UpAxis::Y,
            reason: "",
        };
        match format {
            SourceFormat::Generated | SourceFormat::Mesh(Format::Gltf | Format::Glb) => {
                return y;
            }
            SourceFormat::Mesh(
                Format::Las | Format::Laz | Format::Copc | Format::E57 | Format::Ptx,
            ) => return z("surveys have it so"),
            SourceFormat::Mesh(Format::StlAscii | Format::StlBinary) => {
                return z("files for printing have it so");
            }
            _ => {}
        }
        // Coordinates of maps, meters: no other model is that far from its zero.
        if model.origin.abs().max_element() > 1e4 {
            return z("its coordinates are those of a map");
        }
        let (low, size) = (model.min, model.max - model.min);
        let middle = (model.min + model.max) / 2.0;
        let stands = |axis: usize| {
            let others = (0..3).filter(|&other| other != axis);
            size[axis] > 0.0
                && low[axis].abs() < 0.002 * size[axis]
                && others
                    .map(|i| middle[i].abs() / size[i].max(f32::MIN_POSITIVE))
                    .all(|off| off < 0.1)
        };
        if model.origin == DVec3::ZERO && stands(2) && !stands(1) {
            return z("it stands on z = 0");
        }
        y
    }
}

/// A model that was opened, and what is known about its source.
#[derive(Debug, Clone)]
pub struct OpenedModel {
    /// The model.
    pub model: Model,
    /// The source as it was named.
    pub name: String,
    /// Format that it was read as.
    pub format: SourceFormat,
    /// Size of the file as stored, bytes; 0 without a file.
    pub file_bytes: u64,
    /// Numbers of things that the source holds, before anything was divided, merged or left out.
    pub counts: FileCounts,
    /// Warnings of what was repaired or left out.
    pub warnings: Vec<ReadWarning>,
    /// Parts of the file, and what became of each; empty where it is no model file.
    pub parts: Vec<FilePart>,
    /// Attributes of the points of a cloud beside position, normal and color, in the order of the model's vertices; empty for
    /// most models and for tree files.
    pub attributes: PointAttributes,
    /// Normals of points are estimated: the file has none.
    pub has_estimated_normals: bool,
    /// Tells whether the file says where scanners stood: estimated normals are on their side.
    pub knows_scanners: bool,
    /// The file whose pages the model stands in for; `None` where the model is all.
    pub paged: Option<PagedFile>,
    /// The axis that is up, as far as format and place tell.
    pub up: UpGuess,
    /// View of the scene, where it is one.
    pub scene: Option<SceneView>,
    /// Time to read or generate it, milliseconds.
    pub load_ms: f64,
    /// Time to build the tree, milliseconds; 0 for a tree file.
    pub build_ms: f64,
}

/// Opens the model that `source` names, as [`ModelSource::parse`] reads it, and builds its tree.
///
/// # Errors
/// [`Error::Input`], [`Error::Tree`], [`Error::Generate`] or [`Error::Scene`]; see there. A cancelled `progress` gives an
/// error of which [`Error::is_cancelled`] is true.
pub fn open(
    source: impl AsRef<Path>,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<OpenedModel, Error> {
    open_with_preview(source.as_ref(), options, progress, &mut |_| ())
}

/// Opens as [`open()`] does; `on_mesh` sees the mesh before its tree is built, so that a coarse picture of it can be shown
/// meanwhile. A tree file has no such moment.
///
/// # Errors
/// As [`open()`].
pub fn open_with_preview(
    source: &Path,
    options: &OpenOptions,
    progress: &dyn Progress,
    on_mesh: &mut dyn FnMut(&Mesh),
) -> Result<OpenedModel, Error> {
    let start = Instant::now();
    let parsed = ModelSource::parse(source)?;
    if let Some(need) = MemoryNeed::of(&parsed, options) {
        return Err(need.refused(source).into());
    }
    let found = read(&parsed, options, progress)?;
    if let Some(setting) = &options.input.color
        && !matches!(found.format, SourceFormat::Mesh(_))
    {
        return Err(recolor::refused(source, setting).into());
    }
    let placed = place(found.content, &options.placement);
    let content = placed.map_err(|cause| input::Error::Placement {
        path: source.to_owned(),
        cause,
    })?;
    let load_ms = milliseconds_since(start);
    let mut attributes = found.attributes;
    if options.placement.transform.is_some() {
        // Places that were moved are on no grid of the file.
        attributes.grid = None;
    }
    attributes.are_colors_categories = input::legend_of(&found.warnings)
        .is_some_and(|legend| matches!(legend.entries, LegendEntries::List(_)));
    let estimates = options.tree.point_normals == PointNormals::Estimate;
    let (mut has_estimated_normals, mut knows_scanners) = (false, false);
    let (model, build_ms) = match content {
        OpenedContent::Model(model) => (*model, 0.0),
        OpenedContent::Mesh(mut mesh) => {
            let mut building = options.tree;
            match building.crease_degrees {
                Some(_) if !mesh.is_cloud() => mesh.normals = Vec::new(),
                Some(_) => {}
                None => building.crease_degrees = Some(USUAL_CREASE_DEGREES),
            }
            has_estimated_normals = estimates && mesh.is_cloud() && mesh.normals.is_empty();
            knows_scanners = mesh.scanners.is_any_known();
            on_mesh(&mesh);
            let start = Instant::now();
            let model = keep::build(mesh, &building, &mut attributes, progress)?;
            (model, milliseconds_since(start))
        }
        OpenedContent::Cloud(QsCloud { mesh, radii }) => {
            on_mesh(&mesh);
            let start = Instant::now();
            let model = tree::build_with_radii(mesh, &radii, progress)?;
            (model, milliseconds_since(start))
        }
    };
    let mut warnings = found.warnings;
    let mut model = model;
    if found.format == SourceFormat::Photographs {
        model.frame_within(tree::FAR_OF_SPARSE);
    }
    if options.frame_all {
        model.framed = None;
    }
    if let Some(part) = model.framed {
        warnings.push(ReadWarning::FarOff {
            vertices: part.far_vertices,
            sizes: part.farthest / (2.0 * part.radius).max(f32::MIN_POSITIVE),
        });
    }
    let up = UpGuess::of(found.format, &model);
    let whole = OpenedModel {
        model,
        name: source.display().to_string(),
        format: found.format,
        file_bytes: found.file_bytes,
        counts: found.counts,
        warnings,
        parts: found.parts,
        attributes,
        has_estimated_normals,
        knows_scanners,
        up,
        paged: found.paged,
        scene: found.scene,
        load_ms,
        build_ms,
    };
    if options.keep.is_empty() {
        return Ok(whole);
    }
    whole.kept(&options.keep, progress)
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Puts what was read where it is to stand.
fn place(mut content: OpenedContent, placement: &MeshPlacement) -> Result<OpenedContent, String> {
    match &mut content {
        _ if placement.is_identity() => {}
        OpenedContent::Mesh(mesh) => placement.apply(mesh)?,
        OpenedContent::Cloud(_) | OpenedContent::Model(_) => {
            let cause = "a tree stays where it was built and has its colors; name the file that it was built from";
            return Err(cause.to_owned());
        }
    }
    Ok(content)
}

/// Content of a source.
enum OpenedContent {
    Mesh(Mesh),
    /// Points whose radii are known.
    Cloud(QsCloud),
    Model(Box<Model>),
}

/// Content of a source, with its facts.
struct SourceContent {
    content: OpenedContent,
    format: SourceFormat,
    file_bytes: u64,
    counts: FileCounts,
    warnings: Vec<ReadWarning>,
    parts: Vec<FilePart>,
    attributes: PointAttributes,
    paged: Option<PagedFile>,
    scene: Option<SceneView>,
}

impl SourceContent {
    fn generated(mesh: Mesh, scene: Option<SceneView>) -> Self {
        Self {
            counts: FileCounts {
                vertices: mesh.positions.len() as u64,
                faces: mesh.triangles.len() as u64,
            },
            content: OpenedContent::Mesh(mesh),
            format: SourceFormat::Generated,
            file_bytes: 0,
            warnings: Vec::new(),
            parts: Vec::new(),
            attributes: PointAttributes::default(),
            paged: None,
            scene,
        }
    }

    fn tree(model: Model, file_bytes: u64) -> Self {
        Self {
            counts: FileCounts {
                vertices: model.vertices.len() as u64,
                faces: model.triangles.len() as u64,
            },
            content: OpenedContent::Model(Box::new(model)),
            format: SourceFormat::Tree,
            file_bytes,
            warnings: Vec::new(),
            parts: Vec::new(),
            attributes: PointAttributes::default(),
            paged: None,
            scene: None,
        }
    }
}

impl From<QsCloud> for SourceContent {
    fn from(cloud: QsCloud) -> Self {
        Self {
            counts: FileCounts {
                vertices: cloud.radii.len() as u64,
                faces: 0,
            },
            content: OpenedContent::Cloud(cloud),
            format: SourceFormat::QSplat,
            file_bytes: 0,
            warnings: Vec::new(),
            parts: Vec::new(),
            attributes: PointAttributes::default(),
            paged: None,
            scene: None,
        }
    }
}

impl From<input::LoadedMesh> for SourceContent {
    fn from(loaded: input::LoadedMesh) -> Self {
        Self {
            content: OpenedContent::Mesh(loaded.mesh),
            format: SourceFormat::Mesh(loaded.format),
            file_bytes: loaded.file_bytes,
            counts: loaded.counts,
            warnings: loaded.warnings,
            parts: loaded.parts,
            attributes: loaded.attributes,
            paged: None,
            scene: None,
        }
    }
}

fn read(
    source: &ModelSource,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    // Standard input may keep one waiting, and generators ask nobody.
    if progress.is_cancelled() {
        return Err(input::Error::Cancelled.into());
    }
    match source {
        ModelSource::File(path) => read_file(path, options, progress),
        ModelSource::StandardInput => {
            let stream = InputStream {
                path: Path::new(input::STANDARD_INPUT),
                folder: None,
                reader: &mut io::stdin().lock(),
                expected_bytes: 0,
            };
            read_stream(stream, false, options, progress)
        }
        ModelSource::Generator(spec) => {
            progress.stage("generate", 0);
            let mesh = generate::mesh(spec);
            if progress.is_cancelled() {
                return Err(generate::GenerateError::Cancelled.into());
            }
            Ok(SourceContent::generated(mesh, None))
        }
        ModelSource::Address(url) => read_address(url, options, progress),
        ModelSource::Scene(entry) => {
            let scene = entry.make();
            let view = SceneView {
                camera: scene.camera,
                threshold_px: scene.threshold_px,
            };
            Ok(SourceContent::generated(scene.mesh, Some(view)))
        }
    }
}

fn read_file(
    path: &Path,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    if let Some(points) = photo_scene::read_points(path)? {
        return Ok(points);
    }
    let failed = |source| unreadable(path, source);
    let mut file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    let stream = InputStream {
        path,
        folder: Some(path.parent().unwrap_or(Path::new(""))),
        reader: &mut file,
        expected_bytes: metadata.len(),
    };
    read_stream(stream, metadata.is_file(), options, progress)
}

/// Reads a stream as the tree or the model that it is. Its length is known where it `is_file`.
fn read_stream(
    stream: InputStream<'_>,
    is_file: bool,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    let path = stream.path;
    let mut start = Vec::new();
    let wanted = tree::file::MAGIC.len() as u64;
    (&mut *stream.reader)
        .take(wanted)
        .read_to_end(&mut start)
        .map_err(|source| unreadable(path, source))?;
    let is_tree = tree::file::is_tree_file(&start)
        // The reader of trees says what is wrong with an empty file of that name.
        || (start.is_empty() && is_file && has_tree_ending(path));
    // What was read from a pipe to look at it is gone.
    let mut whole = start.as_slice().chain(&mut *stream.reader);
    if is_tree && is_file {
        let model = tree::file::read_from(&mut whole, stream.expected_bytes, path, progress)?;
        return Ok(SourceContent::tree(model, stream.expected_bytes));
    }
    let mut stream = InputStream {
        reader: &mut whole,
        ..stream
    };
    if is_tree {
        let bytes = stream.read_all(&options.input.limits, progress)?;
        let length = bytes.len() as u64;
        let model = tree::file::read_from(&mut bytes.as_slice(), length, path, progress)?;
        return Ok(SourceContent::tree(model, length));
    }
    if pages::format::is_paged_file(&start) {
        let source: Arc<dyn ByteSource> = if is_file {
            let file = FileSource::open(path).map_err(|source| unreadable(path, source))?;
            Arc::new(file)
        } else {
            let bytes = stream.read_all(&options.input.limits, progress)?;
            Arc::new(MemorySource::new(path.display().to_string(), bytes))
        };
        return read_pages(source, options, progress);
    }
    if qs::is_qs_file(&start) {
        let bytes = stream.read_all(&options.input.limits, progress)?;
        let trees = qs::read(&bytes, path).map_err(tree::Error::from)?;
        return Ok(SourceContent {
            file_bytes: bytes.len() as u64,
            ..QsCloud::of_trees(&trees).into()
        });
    }
    Ok(input::load_stream(stream, &options.input, progress)?.into())
}

fn has_tree_ending(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case(tree::file::EXTENSION))
}

/// The error of a file that the system does not give.
fn unreadable(path: &Path, source: io::Error) -> Error {
    let path = path.to_owned();
    if has_tree_ending(&path) && !path.is_dir() {
        tree::Error::Io { path, source }.into()
    } else {
        input::Error::Open { path, source }.into()
    }
}
