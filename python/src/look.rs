//! Options of a picture: words and numbers as `surfel render` has them.

use crate::errors::wrong;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use surfel::cut::SizeMetric;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use surfel::render::{
    AmbientOcclusion, Blend, Culling, EyeDome, Method, Occlusion, Path, Reconstruction, Settings,
    Shading, SplatKind,
};

/// Words of an option with what they mean.
type WordTable<T> = &'static [(&'static str, T)];

const METHODS: WordTable<Method> = &[
    ("triangles", Method::Triangles),
    ("points", Method::Points),
    ("splats", Method::Splats),
    ("pop", Method::Pop),
];
const SPLATS: WordTable<SplatKind> = &[
    ("square", SplatKind::Square),
    ("disc", SplatKind::Disc),
    ("ellipse", SplatKind::Ellipse),
    ("gauss", SplatKind::Gauss),
    ("visibility", SplatKind::Visibility),
    ("filtered", SplatKind::Filtered),
];
const BLENDS: WordTable<Blend> = &[
    ("opaque", Blend::Opaque),
    ("two-pass", Blend::TwoPass),
    ("depth-threshold", Blend::DepthThreshold),
    ("depth-range", Blend::DepthRange),
];
const SHADINGS: WordTable<Shading> = &[
    ("per-splat", Shading::PerSplat),
    ("deferred", Shading::Deferred),
];
const RECONSTRUCTIONS: WordTable<Reconstruction> = &[
    ("gaussian", Reconstruction::Gaussian),
    ("density", Reconstruction::Density),
    ("pull-push", Reconstruction::PullPush),
];
const PATHS: WordTable<Path> = &[
    ("auto", Path::Auto),
    ("raster", Path::Raster),
    ("compute", Path::Compute),
];
const OCCLUSIONS: WordTable<Occlusion> = &[
    ("auto", Occlusion::Auto),
    ("on", Occlusion::On),
    ("off", Occlusion::Off),
];
const CULLINGS: WordTable<Culling> = &[
    ("auto", Culling::Auto),
    ("on", Culling::On),
    ("off", Culling::Off),
];
const EYE_DOMES: WordTable<EyeDome> = &[
    ("auto", EyeDome::Auto),
    ("on", EyeDome::On),
    ("off", EyeDome::Off),
];
const LIGHTS: WordTable<SurfaceLighting> = &[
    ("headlight", SurfaceLighting::Headlight),
    ("studio", SurfaceLighting::Sphere(LitSphere::Studio)),
    ("clay", SurfaceLighting::Sphere(LitSphere::Clay)),
    ("porcelain", SurfaceLighting::Sphere(LitSphere::Porcelain)),
    ("metal", SurfaceLighting::Sphere(LitSphere::Metal)),
];
const AMBIENT_OCCLUSIONS: WordTable<AmbientOcclusion> = &[
    ("auto", AmbientOcclusion::Auto),
    ("on", AmbientOcclusion::On),
    ("off", AmbientOcclusion::Off),
];
const COLORS: WordTable<ColorBy> = &[
    ("shading", ColorBy::Shading),
    ("primitive", ColorBy::Primitive),
    ("classification", ColorBy::Classification),
    ("level", ColorBy::Level),
    ("normal", ColorBy::Normal),
    ("depth", ColorBy::Depth),
    ("overdraw", ColorBy::Overdraw),
];
const SIZES: WordTable<SizeMetric> = &[
    ("exact", SizeMetric::Exact),
    ("center", SizeMetric::Center),
    ("nearest", SizeMetric::Nearest),
    ("angle", SizeMetric::Angle),
    ("area", SizeMetric::Area),
];

/// The meaning of the word in `value`.
fn word<T: Copy>(option: &str, value: &Bound<'_, PyAny>, table: WordTable<T>) -> PyResult<T> {
    let given: String = value.extract()?;
    let found = table.iter().find(|(word, _)| *word == given);
    found.map(|(_, meaning)| *meaning).ok_or_else(|| {
        let words: Vec<&str> = table.iter().map(|(word, _)| *word).collect();
        wrong(format!("{option} '{given}': one of {}", words.join(", ")))
    })
}

/// The number in `value`, from `low` to `high`.
fn number(option: &str, value: &Bound<'_, PyAny>, low: f32, high: f32) -> PyResult<f32> {
    let given: f32 = value.extract()?;
    if (low..=high).contains(&given) {
        Ok(given)
    } else {
        Err(wrong(format!(
            "{option} {given}: a number from {low} to {high}"
        )))
    }
}

/// A color: three bytes.
fn color(value: &Bound<'_, PyAny>) -> PyResult<[f32; 3]> {
    let bytes: [u8; 3] = value.extract().map_err(|_| {
        wrong("background: three whole numbers from 0 to 255, such as (255, 255, 255)")
    })?;
    Ok(bytes.map(|byte| f32::from(byte) / 255.0))
}

/// A lamp: azimuth and elevation in degrees, as the camera sees it.
fn lamp(value: &Bound<'_, PyAny>) -> PyResult<SurfaceLighting> {
    let (azimuth, elevation): (f64, f64) = value.extract()?;
    if !((-360.0..=360.0).contains(&azimuth) && (-90.0..=90.0).contains(&elevation)) {
        return Err(wrong(
            "light_at: an azimuth of -360 to 360 and an elevation of -90 to 90 degrees",
        ));
    }
    Ok(SurfaceLighting::Phong(Phong {
        lamp: Lamp::FromCamera {
            azimuth: azimuth.to_radians(),
            elevation: elevation.to_radians(),
        },
        ..Phong::default()
    }))
}

/// Options as they were given.
pub(crate) struct PictureLook {
    pub(crate) settings: Settings,
    /// The threshold is one that was asked for.
    pub(crate) has_threshold: bool,
}

/// Settings of the options in `given`. What is not given is as in commands that measure: the headlight, and nothing darkened.
pub(crate) fn settings(given: Option<&Bound<'_, PyDict>>) -> PyResult<PictureLook> {
    let mut s = Settings {
        eye_dome: EyeDome::Auto,
        ..Settings::default()
    };
    let mut has_threshold = false;
    for (option, value) in given.into_iter().flatten() {
        let option: String = option.extract()?;
        let (name, v) = (option.as_str(), &value);
        match name {
            "method" => s.method = word(name, v, METHODS)?,
            "splat" => s.splat = word(name, v, SPLATS)?,
            "blend" => s.blend = Some(word(name, v, BLENDS)?),
            "shading" => s.shading = word(name, v, SHADINGS)?,
            "reconstruct" => s.reconstruction = word(name, v, RECONSTRUCTIONS)?,
            "path" => s.path = word(name, v, PATHS)?,
            "occlusion" => s.occlusion = word(name, v, OCCLUSIONS)?,
            "culling" => s.culling = word(name, v, CULLINGS)?,
            "eye_dome" => s.eye_dome = word(name, v, EYE_DOMES)?,
            "eye_dome_strength" => s.eye_dome_strength = number(name, v, 0.0, 10.0)?,
            "color_by" => s.color_by = word(name, v, COLORS)?,
            "size_metric" => s.size = word(name, v, SIZES)?,
            "depth_offset" => s.depth_offset = Some(number(name, v, 0.0, 1e6)?),
            "background" => s.background = color(v)?,
            "light" => s.light = word(name, v, LIGHTS)?,
            "light_at" => s.light = lamp(v)?,
            "ambient_occlusion" => s.ambient_occlusion = word(name, v, AMBIENT_OCCLUSIONS)?,
            "one_sided" => s.two_sided = !v.extract::<bool>()?,
            "colors" => s.use_colors = v.extract()?,
            "threshold" => {
                s.threshold_px = number(name, v, 0.0, 16_384.0)?;
                has_threshold = true;
            }
            _ => {
                return Err(PyTypeError::new_err(format!(
                    "unknown option '{name}'; there are method, splat, threshold, blend, shading, reconstruct, path, occlusion, culling, eye_dome, eye_dome_strength, color_by, size_metric, depth_offset, background, light, light_at, ambient_occlusion, one_sided, colors"
                )));
            }
        }
    }
    Ok(PictureLook {
        settings: s,
        has_threshold,
    })
}
