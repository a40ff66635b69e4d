//! Why a file could not be read: one enum that names the file, the place in it, the cause and the way out.

use std::fmt;
use std::path::PathBuf;

/// A place in a file, for messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilePlace {
    /// Line of a text file, counted from 1; of the unpacked text when the file is compressed.
    Line(u64),
    /// Offset in a binary file in bytes, counted from 0; in the unpacked data when the file is compressed.
    Byte(u64),
}

impl fmt::Display for FilePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FilePlace::Line(line) => write!(f, "line {line}"),
            FilePlace::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Writes bytes in metric units.
fn metric(bytes: u64) -> String {
    const UNITS: [(&str, f64); 4] = [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)];
    let value = bytes as f64;
    match UNITS.iter().find(|(_, size)| value >= *size) {
        Some((unit, size)) => format!("{:.1} {unit}", value / size),
        None => format!("{bytes} B"),
    }
}

/// Why a file could not be read as a model.
///
/// Every variant but [`Cancelled`](Error::Cancelled) and [`Remote`](Error::Remote) holds the file as the caller named it ("standard input"
/// for `-`), and its text ends with what can be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The user asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// The operating system did not give the bytes.
    #[error("{}: cannot be read: {source}; check the path and its permissions", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// An address of a network, where a file was wanted.
    #[error(
        "{url}: addresses are not fetched; download it and open the file, or pipe it to standard input (-)"
    )]
    Remote {
        /// The address.
        url: String,
    },
    /// A file on a web server cannot be opened.
    #[error("{url}: {cause}")]
    Fetch {
        /// The address.
        url: String,
        /// What went wrong, and what to do.
        cause: String,
    },
    /// The gzip stream is damaged or cut short.
    #[error("{}: the gzip data is damaged after {unpacked} unpacked bytes: {source}; fetch the file again", path.display())]
    Gzip {
        /// The file.
        path: PathBuf,
        /// Bytes that came out before the damage.
        unpacked: u64,
        /// What the decompressor said.
        source: std::io::Error,
    },
    /// Something is larger than [`ReadLimits`](super::ReadLimits) or the 32-bit index of a vertex allows.
    #[error("{}: {what}: {found} is over the limit of {limit}; split the model or raise the limit", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What was counted.
        what: &'static str,
        /// The number in or of the file; for a stream, what had been seen when the limit was passed.
        found: u64,
        /// The largest number accepted.
        limit: u64,
    },
    /// The model as a whole takes more memory than there is.
    #[error("{}: about {} of memory are needed for {what}, and {} are free; {advice}", path.display(), metric(*needed), metric(*free))]
    NeedsMemory {
        /// The file, or the name of a generator.
        path: PathBuf,
        /// Name of what takes it.
        what: String,
        /// Bytes, at least.
        needed: u64,
        /// Bytes that are free.
        free: u64,
        /// Advice: the way out.
        advice: String,
    },
    /// Neither the content nor the ending is known.
    #[error(
        "{}: not a model in a known format (OBJ, PLY, STL, OFF, TRI, glTF, LAS, LAZ, E57, PCD, XYZ text, each also gzipped); \
         convert it to PLY",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The format is known but has no reader yet.
    #[error("{}: this is {format}, which is not read yet; convert it to PLY", path.display())]
    UnreadFormat {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
    },
    /// The format has a reader, but not for how this file is packed.
    #[error("{}: {what}, which is not read; `{command} IN.glb OUT.glb` unpacks it", path.display())]
    NeedsConversion {
        /// The file.
        path: PathBuf,
        /// What is packed, and how.
        what: &'static str,
        /// The command that unpacks it, without its arguments.
        command: &'static str,
    },
    /// Colors are asked for by something that the points do not carry.
    #[error("{}: no attribute `{name}` to color by; there is {known}", path.display())]
    UnknownAttribute {
        /// The file.
        path: PathBuf,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A model cannot stand where it was to, or have the color that it was to have.
    #[error("{}: {cause}", path.display())]
    Placement {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// Points are to be kept by something that they do not carry.
    #[error("{}: no field `{name}` to keep by; there is {known}", path.display())]
    UnknownField {
        /// The file.
        path: PathBuf,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A mesh, where a point cloud was wanted.
    #[error("{}: this is a mesh; point clouds are exported", path.display())]
    NoCloud {
        /// The file.
        path: PathBuf,
    },
    /// No point or triangle is kept.
    #[error("{}: none of {count} {what} is kept by {filter}; widen it (`surfel info` lists the range of each field)", path.display())]
    NothingKept {
        /// The file.
        path: PathBuf,
        /// How many there are.
        count: u64,
        /// `points` or `triangles`.
        what: &'static str,
        /// What they are kept by.
        filter: String,
    },
    /// There is nothing to draw.
    #[error("{}: {what}; check that the export selected some geometry", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// What is empty: the file, or the list of vertices.
        what: &'static str,
    },
    /// Every vertex has a coordinate that is not a number, infinite, or beyond single precision.
    #[error("{}: none of the {vertices} vertices has finite coordinates; export the model again", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Vertices in the file.
        vertices: u64,
    },
    /// The header, or the structure of the file, is not what its format asks for.
    #[error("{}, {place}: {reason}; repair this place or export the model again", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where.
        place: FilePlace,
        /// What is wrong, with the value found.
        reason: String,
    },
    /// A number was expected.
    #[error("{}, {place}: `{token}` is not {wanted}; repair this place or export the model again", path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Where.
        place: FilePlace,
        /// The text found, shortened.
        token: String,
        /// What should stand there.
        wanted: &'static str,
    },
    /// A face names a vertex or normal that does not exist.
    #[error(
        "{}, {place}: a face names {what} {index}, but the file has {count} (numbered from {first}); \
         repair this place or export the model again",
        path.display()
    )]
    Index {
        /// The file.
        path: PathBuf,
        /// Where.
        place: FilePlace,
        /// "vertex" or "normal".
        what: &'static str,
        /// The index as written.
        index: i64,
        /// How many exist.
        count: u64,
        /// The number of the first one in this format.
        first: u32,
    },
    /// The file ends before what its header or structure promises.
    #[error("{}, {place}: the file ends early: {missing}; fetch or export it again", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Where the missing part would begin.
        place: FilePlace,
        /// What is missing.
        missing: String,
    },
}
