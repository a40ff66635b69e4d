//! What a reader noticed and repaired or left out; returned with the mesh, never printed here.

use std::fmt;

use glam::DVec3;

/// A remark about a file that could be read all the same. Counts are of the whole file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The ending of the name says one format, the content another; the content was believed.
    EndingDisagrees {
        /// The ending, without the dot.
        ending: String,
        /// The format that was read.
        format: &'static str,
    },
    /// Vertices with a coordinate that is not finite in single precision were left out, with their triangles.
    NotFiniteDropped {
        /// Vertices left out.
        vertices: u64,
        /// Triangles left out.
        triangles: u64,
    },
    /// Normals of length zero or not finite; they are stored as the zero vector, "unknown".
    NormalsUnknown {
        /// How many.
        count: u64,
    },
    /// Faces with fewer than three corners were left out.
    FacesTooSmall {
        /// How many.
        count: u64,
    },
    /// Lines, points, curves or other parts that are not drawn were left out.
    PartsIgnored {
        /// What they are.
        what: &'static str,
        /// How many.
        count: u64,
    },
    /// The file goes on after its end.
    TrailingBytes {
        /// How many bytes.
        bytes: u64,
    },
    /// A material file could not be read; its colors are missing.
    MaterialFileMissing {
        /// Its name as written in the model.
        name: String,
        /// Why.
        reason: String,
    },
    /// A material that no material file defines; its faces are white.
    MaterialUnknown {
        /// The first such name.
        name: String,
        /// How many names.
        count: u64,
    },
    /// Textures are not read.
    TextureIgnored {
        /// The first texture's name.
        name: String,
        /// How many are named.
        count: u64,
    },
    /// Coordinates are large against the extent: positions are stored relative to this origin.
    OriginMoved {
        /// World position of the model-space zero.
        origin: DVec3,
    },
    /// A part that the format asks for is missing; the mesh is usable without.
    PartMissing {
        /// Its name.
        what: &'static str,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::EndingDisagrees { ending, format } => {
                write!(
                    f,
                    "the name ends in .{ending}, but the content is {format}; read as {format}"
                )
            }
            Warning::NotFiniteDropped {
                vertices,
                triangles,
            } => write!(
                f,
                "{vertices} vertices without finite coordinates left out, with {triangles} triangles"
            ),
            Warning::NormalsUnknown { count } => {
                write!(f, "{count} normals have no direction; treated as unknown")
            }
            Warning::FacesTooSmall { count } => {
                write!(f, "{count} faces with fewer than three corners left out")
            }
            Warning::PartsIgnored { what, count } => write!(f, "{count} {what} left out"),
            Warning::TrailingBytes { bytes } => {
                write!(f, "{bytes} bytes after the end of the model ignored")
            }
            Warning::MaterialFileMissing { name, reason } => {
                write!(
                    f,
                    "material file `{name}` not read ({reason}); its colors are missing"
                )
            }
            Warning::MaterialUnknown { name, count } => {
                write!(
                    f,
                    "{count} materials are not defined, the first is `{name}`; their faces are white"
                )
            }
            Warning::TextureIgnored { name, count } => {
                write!(f, "{count} textures ignored, the first is `{name}`")
            }
            Warning::OriginMoved { origin } => write!(
                f,
                "coordinates are large against the extent; stored relative to ({}, {}, {})",
                origin.x, origin.y, origin.z
            ),
            Warning::PartMissing { what } => write!(f, "{what} missing"),
        }
    }
}
