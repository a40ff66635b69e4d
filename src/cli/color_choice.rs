//! Values of `--color-by`.

use clap::ValueEnum;
use std::str::FromStr;
use surfel::input::PointColoring;

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum ColorByName {
    /// Light and vertex colors
    #[value(alias = "none")]
    Shading,
    /// Splats red, triangles blue
    Primitive,
    /// With --splat visibility: foreground white, holes gray, holes out of reach of any foreground red
    Classification,
    /// Levels of the tree, not lit: the root dark, leaves and triangles bright (--method pop and splats)
    Level,
    /// Normals in the axes of the world, not lit: (n + 1) / 2 as red, green, blue
    Normal,
    /// Distance along the view direction, not lit: the near side of the bounding sphere bright, the far one dark
    Depth,
    /// How many splats and triangles cover each pixel before they hide one another: from 1 (dark violet) over 8 (teal) to 64 and more (yellow)
    Overdraw,
}

/// Value of `--color-by`.
#[derive(Debug, Clone)]
pub(crate) enum ColorChoice {
    /// How the picture is drawn.
    Picture(ColorByName),
    /// Height, or an attribute that the points of a cloud carry.
    Points(PointColoring),
}

impl FromStr for ColorChoice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match ColorByName::from_str(name, false) {
            Ok(name) => Ok(Self::Picture(name)),
            Err(_) => name.parse().map(Self::Points),
        }
    }
}
