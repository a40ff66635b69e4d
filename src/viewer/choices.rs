//! What can be chosen, with the names of the command line.

use crate::cut::SizeMetric;
use crate::pack::ColorBy;
use crate::render::{
    AmbientOcclusion, Blend, Culling, EyeDome, Method, PhotoDisplay, Reconstruction, Shading,
    SplatKind,
};

/// A value with its name and what it is, in a sentence.
pub type NamedChoice<T> = (T, &'static str, &'static str);

/// The methods.
pub const METHODS: &[NamedChoice<Method>] = &[
    (
        Method::Triangles,
        "triangles",
        "Every triangle: the reference (A)",
    ),
    (
        Method::Points,
        "points",
        "Every vertex as a square of the threshold's size (S)",
    ),
    (
        Method::Splats,
        "splats",
        "Splats only, also where triangles are large on screen (X)",
    ),
    (
        Method::Pop,
        "pop",
        "Triangles where they are large on screen, splats where small (D)",
    ),
];

/// The kinds of splats.
pub const SPLATS: &[NamedChoice<SplatKind>] = &[
    (SplatKind::Square, "square", "Squares that face the viewer"),
    (SplatKind::Disc, "disc", "Discs that face the viewer"),
    (
        SplatKind::Ellipse,
        "ellipse",
        "Discs in the plane of the surface, seen in perspective",
    ),
    (
        SplatKind::Gauss,
        "gauss",
        "As ellipse, fading outward; blended in two passes",
    ),
    (
        SplatKind::Visibility,
        "visibility",
        "Visible centers, and a reconstruction of the picture between them",
    ),
    (
        SplatKind::Filtered,
        "filtered",
        "Squares that deposit the area they cover: smooth rims, the mean of what is in a pixel",
    ),
];

/// The ways of blending; none is the usual one of the kind of splat.
pub const BLENDS: &[NamedChoice<Option<Blend>>] = &[
    (None, "usual", "What the kind of splat asks for"),
    (Some(Blend::Opaque), "opaque", "The nearest splat wins"),
    (
        Some(Blend::TwoPass),
        "two-pass",
        "The weighted mean of all splats within the depth offset of the front",
    ),
    (
        Some(Blend::DepthThreshold),
        "depth-threshold",
        "One pass with a depth threshold; in the reference only",
    ),
    (
        Some(Blend::DepthRange),
        "depth-range",
        "One pass with a depth range a pixel; in the reference only",
    ),
];

/// When splats are lit.
pub const SHADINGS: &[NamedChoice<Shading>] = &[
    (Shading::PerSplat, "per-splat", "Lit once a splat"),
    (
        Shading::Deferred,
        "deferred",
        "Lit once a pixel, from blended normals",
    ),
];

/// Which normals surfaces have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SurfaceNormals {
    /// Normals of the file; where it has none, computed ones.
    #[default]
    File,
    /// Computed: smooth but for sharp edges.
    Smooth,
    /// One for each triangle.
    Flat,
}

/// Normals of surfaces.
pub const NORMALS: &[NamedChoice<SurfaceNormals>] = &[
    (
        SurfaceNormals::File,
        "file",
        "Those of the file; where it has none, smooth",
    ),
    (
        SurfaceNormals::Smooth,
        "smooth",
        "Computed: smooth but for sharp edges",
    ),
    (SurfaceNormals::Flat, "flat", "One for each triangle"),
];

/// How visibility splats are filled in.
pub const RECONSTRUCTIONS: &[NamedChoice<Reconstruction>] = &[
    (
        Reconstruction::Gaussian,
        "gaussian",
        "A Gaussian of the threshold's radius",
    ),
    (
        Reconstruction::Density,
        "density",
        "A Gaussian whose radius follows the density of centers",
    ),
    (
        Reconstruction::PullPush,
        "pull-push",
        "Pull-push over a pyramid of half sizes",
    ),
];

/// Size metrics.
pub const METRICS: &[NamedChoice<SizeMetric>] = &[
    (
        SizeMetric::Exact,
        "exact",
        "The longer axis of the ellipse that its sphere covers",
    ),
    (
        SizeMetric::Center,
        "center",
        "Diameter over distance of the center along the view direction",
    ),
    (
        SizeMetric::Nearest,
        "nearest",
        "Diameter over distance of the nearest point along the view direction",
    ),
    (
        SizeMetric::Angle,
        "angle",
        "Twice the tangent of half the angle it is seen under",
    ),
    (
        SizeMetric::Area,
        "area",
        "Diameter of the circle of the ellipse's area",
    ),
];

/// When what faces away is dropped.
pub const CULLINGS: &[NamedChoice<Culling>] = &[
    (Culling::Auto, "auto", "On closed surfaces"),
    (Culling::On, "on", "Always"),
    (Culling::Off, "off", "Never"),
];

/// Which models are darkened where they lie behind their surroundings.
pub const EYE_DOMES: &[NamedChoice<EyeDome>] = &[
    (EyeDome::Auto, "auto", "Points without normals"),
    (EyeDome::On, "on", "Everything"),
    (EyeDome::Off, "off", "Nothing"),
];

/// What is darkened where its surroundings hide its sky.
pub const AMBIENT_OCCLUSIONS: &[NamedChoice<AmbientOcclusion>] = &[
    (
        AmbientOcclusion::Auto,
        "auto",
        "What has normals, but no blended splats beside triangles",
    ),
    (AmbientOcclusion::On, "on", "Everything"),
    (AmbientOcclusion::Off, "off", "Nothing"),
];

/// What of photographs is shown.
pub const PHOTOGRAPHS: &[NamedChoice<PhotoDisplay>] = &[
    (PhotoDisplay::Off, "off", "The model as it is"),
    (PhotoDisplay::Color, "on", "Photographs on the model"),
    (
        PhotoDisplay::Source,
        "which",
        "A color for each photograph, where it is the best",
    ),
];

/// What decides the color.
pub const COLORS_BY: &[NamedChoice<ColorBy>] = &[
    (ColorBy::Shading, "shading", "Light and vertex colors"),
    (
        ColorBy::Primitive,
        "primitive",
        "Splats red, triangles blue",
    ),
    (
        ColorBy::Classification,
        "classification",
        "Of visibility splats: centers white, holes gray, what stays a hole red",
    ),
    (
        ColorBy::Level,
        "level",
        "Levels of the tree: the root dark, leaves and triangles bright",
    ),
    (
        ColorBy::Normal,
        "normal",
        "Normals: x, y and z as red, green and blue",
    ),
    (
        ColorBy::Depth,
        "depth",
        "Distance: near is bright, far dark",
    ),
    (
        ColorBy::Overdraw,
        "overdraw",
        "How many splats and triangles cover a pixel before they hide one another: few dark, many bright",
    ),
];

/// The color behind the model, and that at the lower edge where it is another.
pub type BackgroundColors = ([f32; 3], Option<[f32; 3]>);

/// The backgrounds that a key goes through.
pub const BACKGROUNDS: &[NamedChoice<BackgroundColors>] = &[
    (([0.0; 3], None), "black", "Black"),
    (([128.0 / 255.0; 3], None), "gray", "Gray"),
    (([1.0; 3], None), "white", "White"),
    (
        (
            [96.0 / 255.0, 108.0 / 255.0, 124.0 / 255.0],
            Some([24.0 / 255.0, 26.0 / 255.0, 30.0 / 255.0]),
        ),
        "gradient",
        "Bluish gray above, nearly black below",
    ),
];

/// Times that frames are held to while the camera moves, milliseconds.
pub const FRAME_TIMES: &[NamedChoice<Option<f64>>] = &[
    (None, "none", "Frames take the time that they take"),
    (Some(16.0), "16 ms", "60 frames a second"),
    (Some(33.0), "33 ms", "30 frames a second"),
    (Some(50.0), "50 ms", "20 frames a second"),
    (Some(100.0), "100 ms", "10 frames a second"),
];

/// Name of a value; "other" of one that is not listed.
pub fn name_of<T: Copy + PartialEq>(list: &[NamedChoice<T>], value: T) -> &'static str {
    list.iter()
        .find(|c| c.0 == value)
        .map_or("other", |choice| choice.1)
}

/// The value of a name.
pub fn named<T: Copy>(list: &[NamedChoice<T>], name: &str) -> Option<T> {
    list.iter().find(|c| c.1 == name).map(|choice| choice.0)
}

/// The values that follow `value`, once around, without itself; all of them for a value that is not listed.
pub fn others<T: Copy + PartialEq>(list: &[NamedChoice<T>], value: T, backward: bool) -> Vec<T> {
    let at = list.iter().position(|c| c.0 == value);
    let mut after: Vec<T> = match at {
        Some(at) => list[at + 1..]
            .iter()
            .chain(&list[..at])
            .map(|c| c.0)
            .collect(),
        None => list.iter().map(|c| c.0).collect(),
    };
    if backward {
        after.reverse();
    }
    after
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names<T: Copy + PartialEq + std::fmt::Debug>(list: &[NamedChoice<T>]) {
        for (value, name, what) in list {
            assert_eq!(named(list, name), Some(*value));
            assert_eq!(name_of(list, *value), *name);
            assert!(!what.is_empty());
        }
    }

    #[test]
    fn names_and_values_belong_together() {
        names(METHODS);
        names(SPLATS);
        names(BLENDS);
        names(SHADINGS);
        names(NORMALS);
        names(RECONSTRUCTIONS);
        names(METRICS);
        names(CULLINGS);
        names(EYE_DOMES);
        names(AMBIENT_OCCLUSIONS);
        names(PHOTOGRAPHS);
        names(COLORS_BY);
        names(BACKGROUNDS);
        names(FRAME_TIMES);
        assert_eq!(named(SPLATS, "needle"), None);
        assert_eq!(name_of(BACKGROUNDS, ([0.1; 3], None)), "other");
    }

    #[test]
    fn keys_go_around_in_both_directions() {
        let after = others(SHADINGS, Shading::PerSplat, false);
        assert_eq!(after, [Shading::Deferred]);
        let kinds = others(SPLATS, SplatKind::Filtered, false);
        assert_eq!((kinds[0], kinds.len()), (SplatKind::Square, 5));
        assert_eq!(
            others(SPLATS, SplatKind::Square, true)[0],
            SplatKind::Filtered
        );
        assert_eq!(others(BACKGROUNDS, ([0.3; 3], None), false).len(), 4);
    }
}
