//! Formats that models are read from.

use crate::input::Format;
use std::fmt;

/// Format that a model was read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SourceFormat {
    /// A model file of this format.
    Mesh(Format),
    /// A tree file.
    Tree,
    /// A paged tree file, all of whose pages are joined.
    PagedTree,
    /// A tree of QSplat 1.0, of which the leaves are taken as a point cloud.
    QSplat,
    /// The sparse points of a scene of photographs.
    Photographs,
    /// No file: a generator or a scene.
    Generated,
}

impl SourceFormat {
    /// Unit of length that the format demands; `None` where files have any.
    pub fn unit(self) -> Option<&'static str> {
        match self {
            Self::Mesh(Format::Gltf | Format::Glb | Format::E57) => Some("m"),
            _ => None,
        }
    }

    /// The name as people write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh(format) => format.name(),
            Self::Tree => "surfel tree",
            Self::PagedTree => "paged surfel tree",
            Self::QSplat => "QSplat tree",
            Self::Photographs => "scene of photographs",
            Self::Generated => "generated",
        }
    }
}

impl fmt::Display for SourceFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
