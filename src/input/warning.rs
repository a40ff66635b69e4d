//! What a reader noticed and repaired or left out; returned with the mesh, never printed here.

use crate::mesh::color_legend::ColorLegend;
use crate::printable::printable;
use std::fmt;

use glam::DVec3;

use super::FilePlace;

/// A remark about a file that could be read all the same. Counts are of the whole file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum ReadWarning {
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
    /// Faces name their first corner again at their end; it counts once.
    FirstCornerRepeated {
        /// How many.
        count: u64,
    },
    /// Faces of so many corners that they are drawn as fans, which is wrong where they are concave.
    PolygonsTooLong {
        /// How many.
        count: u64,
        /// The most corners that are looked at.
        most: u64,
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
        /// Name as written in the model.
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
    /// Textures are named, and nothing says where surfaces are in them.
    TextureIgnored {
        /// The first texture's name.
        name: String,
        /// How many are named.
        count: u64,
    },
    /// Images could not be read; what they are on has the colors of materials and vertices.
    TextureMissing {
        /// The name of the first.
        name: String,
        /// Why not.
        reason: String,
        /// How many others there are.
        others: u64,
    },
    /// Images take more memory than they may, and are kept at smaller sizes.
    TexturesReduced {
        /// How many.
        count: u64,
        /// Bytes that all may take.
        budget: u64,
    },
    /// Coordinates are large against the extent: positions are stored relative to this origin.
    OriginMoved {
        /// World position of the model-space zero.
        origin: DVec3,
    },
    /// Something is wrong that decides no shape; the rest was read.
    PartFaulty {
        /// What is wrong, in the plural.
        what: &'static str,
        /// What was done.
        outcome: &'static str,
        /// How often.
        count: u64,
        /// The first.
        place: FilePlace,
    },
    /// The header counts something else than the file holds; what is there was read.
    CountContradicts {
        /// What is counted.
        what: &'static str,
        /// The number in the header.
        promised: u64,
        /// The number in the file.
        found: u64,
    },
    /// The values of the colors have a range that their type does not tell.
    ColorRange {
        /// The largest value of the range.
        largest: u32,
    },
    /// What the columns of a text were read as.
    ColumnsDecided {
        /// The columns, what separates them, and where that is known from.
        columns: String,
    },
    /// Points that stand for no measurement, or for no place, were left out.
    PointsDropped {
        /// What they are, in the plural.
        what: &'static str,
        /// How many.
        count: u64,
    },
    /// Colors stand for an attribute.
    ColoredBy {
        /// Name of the attribute.
        name: String,
        /// What the colors mean.
        meaning: String,
        /// Legend that pictures show: the meaning as colors with their values.
        legend: ColorLegend,
    },
    /// A part was asked for.
    PartKept {
        /// How many points or triangles are kept.
        kept: u64,
        /// Of how many.
        count: u64,
        /// `points` or `triangles`.
        what: &'static str,
        /// What they are kept by.
        filter: String,
    },
    /// Several scans of one file are one cloud.
    ScansJoined {
        /// How many.
        count: u64,
        /// How many of them the file moves or turns.
        posed: u64,
    },
    /// Parts that would change the picture were left out.
    LeftOut {
        /// Names of the parts.
        parts: Vec<String>,
    },
    /// A trained Gaussian-splat file, drawn as the points in the middle of the splats.
    GaussianSplats {
        /// How many splats.
        count: u64,
    },
    /// A sheet was made two-sided by its triangles turned round; these were left out.
    FacesOpposed {
        /// How many.
        count: u64,
    },
    /// Triangles that wind against their neighbors were turned round.
    FacesTurned {
        /// How many.
        count: u64,
    },
    /// Coordinates beyond what squares of single precision hold were multiplied by a power of two.
    Scaled {
        /// The exponent of that power.
        exponent: i32,
    },
    /// Vertices lie so far off that the first view does not frame them.
    FarOff {
        /// How many.
        vertices: u64,
        /// Distance of the farthest from the middle of the others, over the size of these.
        sizes: f32,
    },
    /// Vertices lie so far off that nothing else could be told apart; they were left out with their triangles.
    FarOffDropped {
        /// How many.
        vertices: u64,
    },
    /// A part that the format asks for is missing; the mesh is usable without.
    PartMissing {
        /// Name of the part.
        what: &'static str,
    },
}

impl fmt::Display for ReadWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = RawWarning(self).to_string();
        f.write_str(&printable(&words, MOST_WARNING_CHARS))
    }
}

/// Most characters of a warning: a list of columns is long.
const MOST_WARNING_CHARS: usize = 2000;

/// A warning with the words of the file as they are.
struct RawWarning<'a>(&'a ReadWarning);

impl fmt::Display for RawWarning<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            ReadWarning::EndingDisagrees { ending, format } => {
                write!(
                    f,
                    "the name ends in .{ending}, but the content is {format}; read as {format}"
                )
            }
            ReadWarning::NotFiniteDropped {
                vertices,
                triangles,
            } => write!(
                f,
                "{vertices} vertices without finite coordinates left out, with {triangles} triangles"
            ),
            ReadWarning::NormalsUnknown { count } => {
                write!(f, "{count} normals have no direction; treated as unknown")
            }
            ReadWarning::FacesTooSmall { count } => {
                write!(f, "{count} faces with fewer than three corners left out")
            }
            ReadWarning::FirstCornerRepeated { count } => write!(
                f,
                "{count} faces name their first corner again at their end; it counts once"
            ),
            ReadWarning::PolygonsTooLong { count, most } => write!(
                f,
                "{count} faces of over {most} corners are drawn as fans; where they are concave, divide them"
            ),
            ReadWarning::PartsIgnored { what, count } => write!(f, "{count} {what} left out"),
            ReadWarning::TrailingBytes { bytes } => {
                write!(f, "{bytes} bytes after the end of the model ignored")
            }
            ReadWarning::MaterialFileMissing { name, reason } => {
                write!(
                    f,
                    "material file `{name}` not read ({reason}); its colors are missing"
                )
            }
            ReadWarning::MaterialUnknown { name, count } => {
                write!(
                    f,
                    "{count} materials are not defined, the first is `{name}`; their faces are white"
                )
            }
            ReadWarning::TextureIgnored { name, count } => {
                write!(f, "{count} textures ignored, the first is `{name}`")
            }
            ReadWarning::TextureMissing {
                name,
                reason,
                others: 0,
            } => write!(f, "texture `{name}` not read: {reason}"),
            ReadWarning::TextureMissing {
                name,
                reason,
                others,
            } => write!(f, "texture `{name}` and {others} others not read: {reason}"),
            ReadWarning::TexturesReduced { count, budget } => write!(
                f,
                "{count} textures are kept at a smaller size: all may take {} MiB",
                budget >> 20
            ),
            ReadWarning::OriginMoved { origin } => write!(
                f,
                "coordinates are large against the extent; stored relative to ({}, {}, {})",
                origin.x, origin.y, origin.z
            ),
            ReadWarning::PartFaulty {
                what,
                outcome,
                count,
                place,
            } => match (count, place) {
                // The phrases are in the plural, or say what is missing.
                (1, FilePlace::Line(line)) => write!(f, "line {line}: {what}; {outcome}"),
                (_, FilePlace::Line(line)) => {
                    write!(f, "{count} {what}, the first on line {line}; {outcome}")
                }
                (_, FilePlace::Byte(byte)) => {
                    write!(f, "{count} {what}, the first at byte {byte}; {outcome}")
                }
            },
            ReadWarning::CountContradicts {
                what,
                promised,
                found,
            } => write!(
                f,
                "the header says {promised} {what}, the file holds {found}; all that is there was read{}",
                if promised > found {
                    ": check that the file has not been cut short"
                } else {
                    ""
                }
            ),
            ReadWarning::ColorRange { largest } => {
                write!(
                    f,
                    "colors are read as numbers of 0 to {largest}, as their values say"
                )
            }
            ReadWarning::ColumnsDecided { columns } => write!(f, "columns: {columns}"),
            ReadWarning::PointsDropped { what, count } => write!(f, "{count} {what} left out"),
            ReadWarning::ColoredBy { name, meaning, .. } => {
                write!(f, "colors show {name}: {meaning}")
            }
            ReadWarning::PartKept {
                kept,
                count,
                what,
                filter,
            } => write!(f, "kept {kept} of {count} {what}: {filter}"),
            ReadWarning::ScansJoined { count, posed } => write!(
                f,
                "{count} scans are drawn as one cloud, {posed} of them moved to where the file says"
            ),
            ReadWarning::LeftOut { parts } => write!(f, "left out: {}", parts.join(", ")),
            ReadWarning::GaussianSplats { count } => write!(
                f,
                "a trained Gaussian-splat file: the middles of its {count} splats are drawn as points in their base color; \
                 sizes, rotations, opacity and what changes with the view are left out"
            ),
            ReadWarning::FacesOpposed { count } => write!(
                f,
                "{count} triangles are others turned round, a sheet made two-sided; it is drawn once, from both sides"
            ),
            ReadWarning::FacesTurned { count } => write!(
                f,
                "{count} triangles were turned round to wind as their neighbors do"
            ),
            ReadWarning::Scaled { exponent } => write!(
                f,
                "coordinates are beyond single precision; multiplied by 2^{exponent}, in all that is said of places too"
            ),
            ReadWarning::FarOff { vertices, sizes } => write!(
                f,
                "{vertices} vertices lie up to {sizes:.0} times the model's size away; the first view frames the rest \
                 (--frame all frames everything)"
            ),
            ReadWarning::FarOffDropped { vertices } => write!(
                f,
                "{vertices} vertices lie more than {:e} times the model's size away; left out with their triangles",
                super::assemble::ABSURD
            ),
            ReadWarning::PartMissing { what } => write!(f, "{what} missing"),
        }
    }
}

/// Replaces the legend of a model whose colors stand for an attribute.
pub fn set_legend(warnings: &mut [ReadWarning], common: &ColorLegend) {
    for warning in warnings {
        if let ReadWarning::ColoredBy { legend, .. } = warning {
            legend.clone_from(common);
        }
    }
}

/// The legend of a model whose colors stand for an attribute.
pub fn legend_of(warnings: &[ReadWarning]) -> Option<&ColorLegend> {
    warnings.iter().find_map(|warning| match warning {
        ReadWarning::ColoredBy { legend, .. } => Some(legend),
        _ => None,
    })
}
