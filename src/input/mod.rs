//! Reads models: OBJ, PLY, STL, OFF, TRI, glTF, LAS, LAZ, E57, PCD and XYZ text, also gzipped or from standard input.
//!
//! [`load`] decides the format by content, then by ending, reads the whole file into memory and hands it to the
//! reader of that format. Readers are written for bytes that may be wrong: memory is reserved only for what the
//! bytes left in the file can hold, every index is checked, and whatever is wrong comes back as one [`Error`] with
//! its place. What could be repaired or left out comes back as a [`ReadWarning`].
//!
//! All readers end in the same step (`assemble`): it moves large coordinates to an origin of their own, drops
//! vertices that are not finite, normalizes normals.

mod assemble;
mod color;
mod color_by;
mod coordinate_records;
mod error;
mod gltf;
mod job;
mod material_texture;
mod mtl;
mod obj;
mod off;
mod part;
mod ply;
mod point_filter;
mod pointed_index;
mod points;
mod polygon;
mod sniff;
mod source;
mod stl;
mod stream;
mod text;
mod textures;
mod tri;
mod warning;

use std::fmt;
use std::io::Read;
use std::path::Path;

pub(crate) use color_by::{AttributeColors, AttributedPoints};
pub use color_by::{ColorSetting, PointColoring, name_of_class};
pub use coordinate_records::CoordinateRecords;
pub use error::{Error, FilePlace};
pub use part::{FilePart, PartFate};
pub use point_filter::{FieldCondition, FilterField, FilteredPoints, PointFilter};
pub use stream::{StreamedModel, open_stream};
pub use warning::{ReadWarning, legend_of, set_legend};

pub(crate) use points::las::write as write_las;

use crate::mesh::attributes::PointAttributes;
use crate::mesh::{Mesh, faces, weld};
use crate::progress::Progress;
use job::ReadJob;
use sniff::SniffedKind;

/// Standard input, as messages name it.
pub const STANDARD_INPUT: &str = "standard input";

/// How to read. The default keeps the vertices of the file as they are.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Merge vertices that are equal in position, normal and color, bit by bit. STL has no shared vertices, so
    /// its corners are always merged by position.
    pub weld: bool,
    /// Take the diffuse colors of an OBJ file's materials as vertex colors, unless the vertices have their own.
    /// Vertices between two colors are then doubled; when the file has no normals, those computed later have a
    /// crease there.
    pub materials: bool,
    /// Read the images that materials and comments name. Without, surfaces have the colors of materials and vertices.
    pub textures: bool,
    /// Leave out the backs of sheets made two-sided by the same faces turned round, and turn faces that wind against
    /// their neighbors ([`crate::mesh::faces`]).
    pub repair_faces: bool,
    /// Color by height or an attribute instead of the colors of the file.
    pub color: Option<ColorSetting>,
    /// What is too much.
    pub limits: ReadLimits,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            weld: false,
            materials: true,
            textures: true,
            repair_faces: true,
            color: None,
            limits: ReadLimits::default(),
        }
    }
}

/// Bounds against files that would fill the memory.
///
/// The arrays of a mesh take at most about 40 times the bytes they are read from (a text cloud of one-digit
/// coordinates), usually less than twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Largest file, or standard input, in bytes.
    pub file_bytes: u64,
    /// Largest size of a gzipped file once unpacked, in bytes. Beyond 64 MiB a file that unpacks to more than 256
    /// times its size is refused, too: no model does.
    pub unpacked_bytes: u64,
    /// Most vertices; values over 2^32 - 1 mean that, since indices have 32 bits.
    pub vertices: u64,
    /// Most memory of all images with their smaller sizes, bytes: beyond it the largest are kept at half their size, or less.
    pub texture_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self {
            file_bytes: 1 << 40,
            unpacked_bytes: 64 << 30,
            vertices: u64::from(u32::MAX),
            texture_bytes: 2 << 30,
        }
    }
}

/// A format with a reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// PLY, text.
    PlyAscii,
    /// PLY, binary, least significant byte first.
    PlyBinaryLittleEndian,
    /// PLY, binary, most significant byte first.
    PlyBinaryBigEndian,
    /// STL, text.
    StlAscii,
    /// STL, binary.
    StlBinary,
    /// Object File Format of Geomview, with colors (COFF) or normals (NOFF).
    Off,
    /// TRI, either kind (docs of the `tri` module).
    Tri,
    /// LAS, points of scanners.
    Las,
    /// LAS, compressed.
    Laz,
    /// LAS, compressed, its points ordered as a tree.
    Copc,
    /// Points as text: XYZ, PTS, CSV and their relatives.
    TextPoints,
    /// PTX, scans as text with their poses.
    Ptx,
    /// PCD of the Point Cloud Library.
    Pcd,
    /// E57, scans with poses.
    E57,
    /// glTF, its description as text.
    Gltf,
    /// glTF in one file.
    Glb,
}

impl Format {
    /// The name as people write it.
    pub fn name(self) -> &'static str {
        match self {
            Format::Obj => "OBJ",
            Format::PlyAscii => "PLY (text)",
            Format::PlyBinaryLittleEndian => "PLY (binary, little-endian)",
            Format::PlyBinaryBigEndian => "PLY (binary, big-endian)",
            Format::StlAscii => "STL (text)",
            Format::StlBinary => "STL (binary)",
            Format::Off => "OFF",
            Format::Tri => "TRI",
            Format::Las => "LAS",
            Format::Laz => "LAZ",
            Format::Copc => "LAZ (COPC)",
            Format::TextPoints => "XYZ text",
            Format::Ptx => "PTX",
            Format::Pcd => "PCD",
            Format::E57 => "E57",
            Format::Gltf => "glTF",
            Format::Glb => "glTF (GLB)",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How many things the file holds, before polygons became triangles and vertices were doubled, merged or dropped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FileCounts {
    /// Vertices (positions) in the file; for STL its corners, three a triangle.
    pub vertices: u64,
    /// Faces in the file, polygons counted once, a triangle strip as its triangles.
    pub faces: u64,
}

/// A model as read.
#[derive(Debug, Clone)]
pub struct LoadedMesh {
    /// The model; has at least one vertex. Vertices come in file order; those that OBJ files share between
    /// several normals or colors follow at the end.
    pub mesh: Mesh,
    /// The format that was recognized.
    pub format: Format,
    /// What was repaired or left out.
    pub warnings: Vec<ReadWarning>,
    /// What the file holds, part by part, and what became of it.
    pub parts: Vec<FilePart>,
    /// Size of the file as stored, in bytes (compressed when it is).
    pub file_bytes: u64,
    /// What the file holds by its own count.
    pub counts: FileCounts,
    /// What the points carry besides, in the order of the positions; empty for most models.
    pub attributes: PointAttributes,
    /// Coordinate system of a LAS file, as its records have it.
    pub coordinate_records: CoordinateRecords,
}

/// The bytes of a model that somebody else opened.
pub struct InputStream<'a> {
    /// The file as messages name it; its ending decides where the content leaves the format open.
    pub path: &'a Path,
    /// Where files that the model names (materials) are looked for; `None` looks for none, which is a warning.
    pub folder: Option<&'a Path>,
    /// The bytes, from the first to the last.
    pub reader: &'a mut dyn Read,
    /// How many there will be; 0 when unknown. Memory is reserved by it, and too large a file is refused by it.
    pub expected_bytes: u64,
}

impl fmt::Debug for InputStream<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InputStream")
            .field("path", &self.path)
            .field("expected_bytes", &self.expected_bytes)
            .finish_non_exhaustive()
    }
}

impl InputStream<'_> {
    /// Reads all bytes, within the limits. Reports one stage, `read`.
    ///
    /// # Errors
    /// [`Error::Open`], [`Error::TooLarge`], [`Error::Cancelled`].
    pub fn read_all(
        &mut self,
        limits: &ReadLimits,
        progress: &dyn Progress,
    ) -> Result<Vec<u8>, Error> {
        source::read_all(self, limits.file_bytes, progress)
    }
}

/// Reads the model at `path`, or from standard input when `path` is `-`.
///
/// Reports two stages, `read` and `parse`, in bytes (and `unpack` between them for gzip).
///
/// # Errors
/// See [`Error`]; a file that is damaged anywhere gives exactly one.
pub fn load(
    path: &Path,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<LoadedMesh, Error> {
    if path == Path::new("-") {
        let stream = InputStream {
            path: Path::new(STANDARD_INPUT),
            folder: None,
            reader: &mut std::io::stdin().lock(),
            expected_bytes: 0,
        };
        return load_stream(stream, options, progress);
    }
    let (mut file, expected_bytes) = source::open_file(path)?;
    let stream = InputStream {
        path,
        folder: Some(path.parent().unwrap_or(Path::new(""))),
        reader: &mut file,
        expected_bytes,
    };
    load_stream(stream, options, progress)
}

/// Reads the model in a stream to its end.
///
/// # Errors
/// As for [`load`].
pub fn load_stream(
    mut stream: InputStream<'_>,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<LoadedMesh, Error> {
    let _span = tracing::info_span!("input.load", path = %stream.path.display()).entered();
    let bytes = stream.read_all(&options.limits, progress)?;
    load_from(stream.path, stream.folder, bytes, options, progress)
}

/// Reads a model from memory. `name` serves messages and the ending of the name; files that the model names
/// (materials) are not looked for, which is a warning.
///
/// # Errors
/// As for [`load`].
pub fn load_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<LoadedMesh, Error> {
    load_from(Path::new(name), None, bytes, options, progress)
}

fn load_from<'a>(
    path: &Path,
    folder: Option<&Path>,
    bytes: impl Into<std::borrow::Cow<'a, [u8]>>,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<LoadedMesh, Error> {
    let stored = bytes.into();
    let file_bytes = stored.len() as u64;
    let mut job = ReadJob::new(path, folder, options, progress);
    if file_bytes > options.limits.file_bytes {
        return Err(job.too_large("bytes", file_bytes, options.limits.file_bytes));
    }
    let bytes = if source::is_gzip(&stored) {
        let unpacked = source::unpack(&job, &stored)?;
        drop(stored);
        unpacked.into()
    } else {
        stored
    };
    if bytes.is_empty() {
        return Err(job.empty("the file is empty"));
    }
    // A byte order mark is no part of any text format.
    let data = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);

    let kind = sniff::decide(&mut job, data)?;
    progress.stage("parse", data.len() as u64);
    let (format, raw) = match kind {
        SniffedKind::Obj => (Format::Obj, obj::read(&mut job, data)?),
        SniffedKind::Ply => ply::read(&mut job, data)?,
        SniffedKind::StlAscii => (Format::StlAscii, stl::read_ascii(&mut job, data)?),
        SniffedKind::StlBinary => (Format::StlBinary, stl::read_binary(&mut job, data)?),
        SniffedKind::Off => (Format::Off, off::read(&mut job, data)?),
        SniffedKind::Tri => (Format::Tri, tri::read(&mut job, data)?),
        SniffedKind::Las => points::las::read(&mut job, data)?,
        SniffedKind::Gltf => gltf::read(&mut job, data)?,
        SniffedKind::E57 => points::e57::read(&mut job, data)?,
        SniffedKind::Pcd => points::pcd::read(&mut job, data)?,
        SniffedKind::Text => points::text::read(&mut job, data)?,
    };
    job.report(data.len())?;
    drop(bytes);
    let remarks = job.inventory.remarks();
    job.warnings.extend(remarks);
    let counts = raw.counts;
    let mut mesh = assemble::finish(&mut job, raw)?;
    if let Some(setting) = &options.color {
        color_by::apply(&mut job, &mut mesh, setting)?;
        // Images would cover the colors.
        mesh.textures = None;
    }
    if !mesh.triangles.is_empty() {
        // Those of a surface color it, nothing else asks for them.
        job.attributes.columns = Vec::new();
    }
    if options.weld && !job.attributes.is_empty() {
        // Merged points would need merged values.
        job.attributes.columns = Vec::new();
        let parts = vec!["attributes, since points are merged".to_owned()];
        job.warn(ReadWarning::LeftOut { parts });
    }
    if options.weld || matches!(format, Format::StlAscii | Format::StlBinary) {
        weld::weld(&mut mesh);
    }
    if options.repair_faces {
        job.warn_repairs(faces::repair(&mut mesh));
    }
    Ok(LoadedMesh {
        mesh,
        format,
        warnings: job.warnings,
        parts: job.inventory.parts,
        file_bytes,
        counts,
        attributes: job.attributes,
        coordinate_records: job.coordinate_records,
    })
}
