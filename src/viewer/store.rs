//! The settings file: what the window looked like and how it drew, kept from one time to the next.

use super::choices::{self, name_of, named};
use super::lamp;
use crate::oriented::splats::SplatRules;
use crate::pack::lit_sphere::LitSphere;
use crate::pack::{Lamp, Phong, SurfaceLighting};
use crate::render::Settings;
use crate::render::{AmbientOcclusion, EyeDome};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file in words. Keys that are missing have their defaults, unknown ones are ignored, so that older and newer
/// programs read each other's files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StoredSettings {
    /// The window.
    pub window: StoredWindow,
    /// How models are drawn.
    pub look: StoredLook,
}

/// What the window looked like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StoredWindow {
    /// Width in the window system's units.
    pub width: u32,
    /// Height in the window system's units.
    pub height: u32,
    /// The panel is shown.
    pub panel: bool,
    /// The graph is shown.
    pub graph: bool,
    /// Statistics are in the title.
    pub statistics: bool,
    /// A bar that tells lengths is shown.
    pub scale_bar: bool,
    /// The axes are shown.
    pub axes: bool,
    /// The headlight is parallel, not a point in the eye.
    pub parallel_light: bool,
    /// Time that frames are held to while the view moves, milliseconds; 0 for none, nothing for that of the device.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_ms: Option<f64>,
    /// Files that were shown, the last one first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recent: Vec<PathBuf>,
}

/// How models are drawn; names as on the command line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StoredLook {
    method: String,
    threshold: f32,
    splat: String,
    /// Splats are made from vertices, by the usual rules.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    from_vertices: bool,
    blend: String,
    shading: String,
    reconstruct: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_offset: Option<f32>,
    size_metric: String,
    culling: String,
    eye_dome: String,
    ambient_occlusion: String,
    two_sided: bool,
    colors: bool,
    color_by: String,
    background: [u8; 3],
    /// Color at the lower edge, where it is another.
    #[serde(skip_serializing_if = "Option::is_none")]
    background_bottom: Option<[u8; 3]>,
    light: String,
    /// Azimuth and elevation of a lamp that goes with the viewer, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    light_at: Option<[f64; 2]>,
    /// Place of a lamp that stays in the world.
    #[serde(skip_serializing_if = "Option::is_none")]
    light_position: Option<[f64; 3]>,
    ambient: f32,
    specular: f32,
    shininess: f32,
}

impl Default for StoredWindow {
    fn default() -> Self {
        Self {
            width: 1024,
            height: 768,
            panel: true,
            graph: false,
            statistics: true,
            scale_bar: false,
            axes: false,
            parallel_light: false,
            frame_ms: None,
            recent: Vec::new(),
        }
    }
}

impl Default for StoredLook {
    fn default() -> Self {
        Self::of(&Settings {
            eye_dome: EyeDome::Auto,
            ambient_occlusion: AmbientOcclusion::Auto,
            light: SurfaceLighting::Sphere(LitSphere::Studio),
            ..Settings::default()
        })
    }
}

/// A color as the file has it.
fn bytes(color: [f32; 3]) -> [u8; 3] {
    color.map(|c| (c * 255.0).round() as u8)
}

impl StoredLook {
    /// The words for `settings`.
    pub fn of(settings: &Settings) -> Self {
        let (light, phong) = match settings.light {
            SurfaceLighting::Headlight => ("headlight", Phong::default()),
            SurfaceLighting::Phong(phong) => ("phong", phong),
            SurfaceLighting::Sphere(sphere) => (sphere.name(), Phong::default()),
        };
        let (light_at, light_position) = match (settings.light, phong.lamp) {
            (SurfaceLighting::Headlight | SurfaceLighting::Sphere(_), _) => (None, None),
            (_, Lamp::FromCamera { azimuth, elevation }) => (
                Some([lamp::degrees(azimuth), lamp::degrees(elevation)]),
                None,
            ),
            (_, Lamp::At(position)) => (None, Some(position.to_array())),
        };
        Self {
            light: light.into(),
            light_at,
            light_position,
            ambient: phong.ambient,
            specular: phong.specular,
            shininess: phong.shininess,
            method: name_of(choices::METHODS, settings.method).into(),
            threshold: settings.threshold_px,
            splat: name_of(choices::SPLATS, settings.splat).into(),
            from_vertices: settings.vertex_splats.is_some(),
            blend: name_of(choices::BLENDS, settings.blend).into(),
            shading: name_of(choices::SHADINGS, settings.shading).into(),
            reconstruct: name_of(choices::RECONSTRUCTIONS, settings.reconstruction).into(),
            depth_offset: settings.depth_offset,
            size_metric: name_of(choices::METRICS, settings.size).into(),
            culling: name_of(choices::CULLINGS, settings.culling).into(),
            eye_dome: name_of(choices::EYE_DOMES, settings.eye_dome).into(),
            ambient_occlusion: name_of(choices::AMBIENT_OCCLUSIONS, settings.ambient_occlusion)
                .into(),
            two_sided: settings.two_sided,
            colors: settings.use_colors,
            color_by: name_of(choices::COLORS_BY, settings.color_by).into(),
            background: bytes(settings.background),
            background_bottom: settings.background_bottom.map(bytes),
        }
    }

    /// The settings of these words.
    ///
    /// # Errors
    /// With key, value and what it may be.
    pub fn settings(&self) -> Result<Settings, String> {
        fn choice<T: Copy>(
            key: &str,
            list: &[choices::NamedChoice<T>],
            name: &str,
        ) -> Result<T, String> {
            named(list, name).ok_or_else(|| {
                let names: Vec<&str> = list.iter().map(|c| c.1).collect();
                format!("look.{key} is {name:?}; it may be {}", names.join(", "))
            })
        }
        if !(0.0..=4096.0).contains(&self.threshold) {
            return Err(format!(
                "look.threshold is {}; it may be 0 to 4096",
                self.threshold
            ));
        }
        if let Some(offset) = self.depth_offset
            && !(0.0..=1000.0).contains(&offset)
        {
            return Err(format!(
                "look.depth_offset is {offset}; it may be 0 to 1000"
            ));
        }
        Ok(Settings {
            light: self.lighting()?,
            method: choice("method", choices::METHODS, &self.method)?,
            threshold_px: self.threshold,
            splat: choice("splat", choices::SPLATS, &self.splat)?,
            vertex_splats: self.from_vertices.then(SplatRules::usual),
            blend: choice("blend", choices::BLENDS, &self.blend)?,
            shading: choice("shading", choices::SHADINGS, &self.shading)?,
            reconstruction: choice("reconstruct", choices::RECONSTRUCTIONS, &self.reconstruct)?,
            depth_offset: self.depth_offset,
            size: choice("size_metric", choices::METRICS, &self.size_metric)?,
            culling: choice("culling", choices::CULLINGS, &self.culling)?,
            eye_dome: choice("eye_dome", choices::EYE_DOMES, &self.eye_dome)?,
            ambient_occlusion: choice(
                "ambient_occlusion",
                choices::AMBIENT_OCCLUSIONS,
                &self.ambient_occlusion,
            )?,
            two_sided: self.two_sided,
            use_colors: self.colors,
            color_by: choice("color_by", choices::COLORS_BY, &self.color_by)?,
            background: self.background.map(|c| f32::from(c) / 255.0),
            background_bottom: (self.background_bottom)
                .map(|color| color.map(|c| f32::from(c) / 255.0)),
            ..Settings::default()
        })
    }
}

impl StoredLook {
    /// The light of these words.
    fn lighting(&self) -> Result<SurfaceLighting, String> {
        let sphere = LitSphere::ALL.into_iter().find(|s| s.name() == self.light);
        let is_lamp = match self.light.as_str() {
            "headlight" => false,
            "phong" => true,
            _ if sphere.is_some() => false,
            other => {
                let spheres = LitSphere::ALL.map(LitSphere::name).join(", ");
                return Err(format!(
                    "look.light is {other:?}; it may be headlight, phong, {spheres}"
                ));
            }
        };
        let within = |key: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(format!("look.{key} is {value}; it may be {low} to {high}"))
            }
        };
        within("ambient", f64::from(self.ambient), 0.0, 1.0)?;
        within("specular", f64::from(self.specular), 0.0, 1.0)?;
        let (least, most) = (*lamp::SHININESS.start(), *lamp::SHININESS.end());
        within(
            "shininess",
            f64::from(self.shininess),
            least.into(),
            most.into(),
        )?;
        if let Some([azimuth, elevation]) = self.light_at {
            within("light_at", azimuth, -360.0, 360.0)?;
            within("light_at", elevation, -90.0, 90.0)?;
        }
        for value in self.light_position.iter().flatten() {
            within("light_position", *value, -lamp::FARTHEST, lamp::FARTHEST)?;
        }
        if !is_lamp {
            return Ok(sphere.map_or(SurfaceLighting::Headlight, SurfaceLighting::Sphere));
        }
        Ok(SurfaceLighting::Phong(Phong {
            lamp: match (self.light_position, self.light_at) {
                (Some(position), _) => Lamp::At(DVec3::from(position)),
                (None, Some([azimuth, elevation])) => lamp::from_camera(azimuth, elevation),
                (None, None) => Phong::default().lamp,
            },
            ambient: self.ambient,
            specular: self.specular,
            shininess: self.shininess,
        }))
    }
}

/// Where the settings file is: in the folder that `SURFEL_CONFIG` names, else in `surfel` in the user's folder of
/// settings. None where there is no such folder, or the variable is empty.
pub fn place() -> Option<PathBuf> {
    let folder = match std::env::var_os("SURFEL_CONFIG") {
        Some(folder) if folder.is_empty() => return None,
        Some(folder) => PathBuf::from(folder),
        None => dirs::config_dir()?.join("surfel"),
    };
    Some(folder.join("viewer.toml"))
}

/// Reads the file; one that is not there gives the defaults.
///
/// # Errors
/// With the file and what is wrong with it.
pub fn load(path: &Path) -> Result<(StoredSettings, Settings), String> {
    let fail = |cause: String| {
        format!(
            "{}: {}; the file is ignored",
            path.display(),
            cause.trim_end()
        )
    };
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            let stored = StoredSettings::default();
            let settings = stored.look.settings().map_err(fail)?;
            return Ok((stored, settings));
        }
        Err(e) => return Err(fail(e.to_string())),
    };
    let stored: StoredSettings = toml::from_str(&text).map_err(|e| {
        // The message alone would not say where; the whole report has several lines.
        let line = e
            .span()
            .map(|span| text[..span.start].lines().count().max(1));
        fail(match line {
            Some(line) => format!("line {line}: {}", e.message()),
            None => e.message().to_owned(),
        })
    })?;
    let settings = stored.look.settings().map_err(fail)?;
    for (key, side) in [
        ("width", stored.window.width),
        ("height", stored.window.height),
    ] {
        if !(1..=crate::math::camera::MAX_SIDE).contains(&side) {
            return Err(fail(format!("window.{key} is {side}")));
        }
    }
    if let Some(ms) = stored.window.frame_ms
        && !(ms == 0.0 || (1.0..=10_000.0).contains(&ms))
    {
        return Err(fail(format!(
            "window.frame_ms is {ms}; it may be 1 to 10000, or 0 for none"
        )));
    }
    Ok((stored, settings))
}

/// Writes the file beside its place and renames it; its folder is made.
///
/// # Errors
/// With the file and the cause.
pub fn save(path: &Path, stored: &StoredSettings) -> Result<(), String> {
    let write = || -> Result<(), Box<dyn std::error::Error>> {
        let text = toml::to_string(stored)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::Builder::new()
            .prefix(".viewer-")
            .tempfile_in(folder)?;
        let head = "# How the window of surfel was left. Written when it closes; may be deleted.\n";
        std::io::Write::write_all(&mut file, head.as_bytes())?;
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(|e| format!("cannot write {}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::cut::SizeMetric;
    use crate::pack::ColorBy;
    use crate::render::{Blend, Culling, Method, Reconstruction, Shading, SplatKind};

    #[test]
    fn what_was_saved_is_loaded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/viewer.toml");
        let usual = Settings {
            eye_dome: EyeDome::Auto,
            ambient_occlusion: AmbientOcclusion::Auto,
            light: SurfaceLighting::Sphere(LitSphere::Studio),
            ..Settings::default()
        };
        assert_eq!(
            load(&path),
            Ok((StoredSettings::default(), usual)),
            "nothing there"
        );
        let settings = Settings {
            method: Method::Splats,
            splat: SplatKind::Gauss,
            blend: Some(Blend::DepthRange),
            shading: Shading::Deferred,
            reconstruction: Reconstruction::PullPush,
            threshold_px: 2.25,
            depth_offset: Some(0.5),
            culling: Culling::Off,
            eye_dome: EyeDome::On,
            ambient_occlusion: AmbientOcclusion::On,
            two_sided: false,
            use_colors: false,
            color_by: ColorBy::Primitive,
            background: [1.0, 0.2, 0.0],
            background_bottom: Some([0.0, 0.2, 0.4]),
            size: SizeMetric::Area,
            light: SurfaceLighting::Phong(Phong {
                lamp: lamp::from_camera(-123.4, 56.7),
                ambient: 0.25,
                specular: 0.75,
                shininess: 12.5,
            }),
            ..Settings::default()
        };
        let stored = StoredSettings {
            window: StoredWindow {
                width: 1280,
                height: 720,
                panel: false,
                graph: true,
                statistics: false,
                scale_bar: true,
                axes: true,
                parallel_light: true,
                frame_ms: Some(33.0),
                recent: vec!["/scans/a b.ply".into()],
            },
            look: StoredLook::of(&settings),
        };
        save(&path, &stored).unwrap();
        save(&path, &stored).unwrap();
        assert_eq!(load(&path), Ok((stored, settings)));
        let files: Vec<_> = std::fs::read_dir(path.parent().unwrap()).unwrap().collect();
        assert_eq!(files.len(), 1, "nothing is left beside it");
    }

    #[test]
    fn what_is_missing_has_its_default_and_what_is_new_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("viewer.toml");
        std::fs::write(
            &path,
            "future = 1\n[window]\npanel = false\n[look]\nthreshold = 3\n",
        )
        .unwrap();
        let (stored, settings) = load(&path).unwrap();
        assert!(!stored.window.panel && stored.window.width == 1024);
        assert_eq!(settings.threshold_px, 3.0);
        assert_eq!(settings.method, Method::Pop);
    }

    #[test]
    fn a_damaged_file_is_named_with_what_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("viewer.toml");
        for (text, part) in [
            ("[window\n", "line 1"),
            ("[window]\n\nwidth = \"wide\"\n", "line 3"),
            ("[window]\nwidth = 0\n", "window.width is 0"),
            ("[look]\nthreshold = -1\n", "threshold is -1"),
            ("[look]\nthreshold = nan\n", "threshold is NaN"),
            ("[look]\nsplat = \"round\"\n", "square, disc"),
            ("[look]\ndepth_offset = 2e9\n", "depth_offset"),
            ("[look]\nlight = \"sun\"\n", "headlight, phong"),
            ("[look]\nspecular = 1.5\n", "specular is 1.5"),
            (
                "[look]\nshininess = 0\n",
                "shininess is 0; it may be 1 to 1000",
            ),
            ("[look]\nlight_at = [0, 91]\n", "light_at is 91"),
            (
                "[look]\nlight_position = [0, nan, 0]\n",
                "light_position is NaN",
            ),
            ("[look]\nlight_at = [0]\n", "line 2"),
            ("[window]\nframe_ms = 0.5\n", "window.frame_ms is 0.5"),
            ("\u{0}\u{1}", "line 1"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = load(&path).unwrap_err();
            assert!(
                error.contains("viewer.toml") && error.contains(part) && error.contains("ignored"),
                "{text:?}: {error}"
            );
            assert!(!error.contains('\n'), "{error}");
        }
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(load(&path).is_err(), "no text at all");
        assert!(save(&path.join("below/a/file.toml"), &StoredSettings::default()).is_err());
    }
}
