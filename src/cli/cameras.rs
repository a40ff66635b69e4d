//! Cameras of commands: files, orbits and sizes of pictures.

use super::{CommandFailure, usage};
use clap::Args as ClapArgs;
use std::path::{Path, PathBuf};
use surfel::OpenedModel;
use surfel::math::camera::Camera;
use surfel::math::up_axis::UpAxis;
use surfel::open::UpGuess;
use surfel::tree::OrbitSphere;

pub(crate) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match sides {
        Some((w, h)) if (1..=16_384).contains(&w) && (1..=16_384).contains(&h) => Ok((w, h)),
        Some(_) => Err("each side must be 1 to 16384 pixels".into()),
        None => Err("expected width x height such as 1024x768".into()),
    }
}

pub(crate) fn parse_orbit(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|p| p.trim().parse().ok()).collect();
    let [azimuth, elevation, fill] = match numbers.as_deref() {
        Some(&[a, e]) => [a, e, 1.0],
        Some(&[a, e, f]) => [a, e, f],
        _ => return Err("expected AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,FILL".into()),
    };
    if !azimuth.is_finite() || !(-90.0..=90.0).contains(&elevation) {
        return Err("the azimuth must be finite and the elevation -90 to 90 degrees".into());
    }
    if !(fill > 1e-6 && fill <= 1e4) {
        return Err("the fill must be above 0 (1 fills the picture)".into());
    }
    Ok([azimuth, elevation, fill])
}

/// The size of the picture, and a camera file.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct CameraArgs {
    /// Size of the picture in pixels [default: 500x500, or the camera's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Camera file to begin with (JSON: width, height, view, proj)
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    camera: Option<PathBuf>,
}

impl CameraArgs {
    /// The camera of the file, in the size asked for; none where an orbit decides.
    pub(crate) fn read(&self) -> Result<Option<Camera>, CommandFailure> {
        let camera = self.camera.as_deref().map(read_camera).transpose()?;
        camera.map(|camera| resized(camera, self.size)).transpose()
    }

    /// The size asked for.
    pub(crate) fn size(&self) -> Option<(u32, u32)> {
        self.size
    }
}

/// The axis that is up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum UpChoice {
    /// Chosen by format and place of the model; y where they do not tell
    #[default]
    Auto,
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl UpChoice {
    /// The axis that was asked for; none where the model decides.
    pub(crate) fn named(self) -> Option<UpAxis> {
        match self {
            Self::Auto => None,
            Self::X => Some(UpAxis::X),
            Self::Y => Some(UpAxis::Y),
            Self::Z => Some(UpAxis::Z),
        }
    }

    /// The axis of a model, with a word where it is a guess that turns the picture.
    pub(crate) fn of(self, guess: UpGuess, name: &str, quiet: bool) -> UpAxis {
        self.named().unwrap_or_else(|| {
            if guess.axis != UpAxis::Y && !quiet {
                let (axis, reason) = (guess.axis.name(), guess.reason);
                super::say(&format!(
                    "surfel: {name}: {axis} is up, as {reason} (--up y for another)"
                ));
            }
            guess.axis
        })
    }
}

/// The camera of `orbit` for a model.
pub(crate) fn orbit_camera(ready: &OpenedModel, size: (u32, u32), orbit: [f64; 3]) -> Camera {
    camera_around(UpAxis::Y, ready.model.orbit_sphere(), size, orbit)
}

/// The camera of `orbit` for a sphere.
fn camera_around(
    up: UpAxis,
    sphere: OrbitSphere,
    size: (u32, u32),
    [azimuth, elevation, fill]: [f64; 3],
) -> Camera {
    let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
    let angles = (azimuth, elevation, fill);
    Camera::orbit_about(up, size, sphere.center, sphere.radius, angles)
}

/// Reads a camera file; every error names it.
pub(crate) fn read_camera(path: &Path) -> Result<Camera, CommandFailure> {
    Camera::read(path).map_err(|error| match error {
        error @ surfel::math::camera::CameraError::Value(_) => {
            CommandFailure::Input(anyhow::Error::new(error).context(path.display().to_string()))
        }
        other => other.into(),
    })
}

/// The camera of a file, in the size asked for.
pub(crate) fn resized(
    mut camera: Camera,
    size: Option<(u32, u32)>,
) -> Result<Camera, CommandFailure> {
    if let Some((width, height)) = size {
        if u64::from(width) * u64::from(camera.height)
            != u64::from(height) * u64::from(camera.width)
        {
            return Err(usage(format!(
                "--size {width}x{height} has another shape than the camera's {}x{}",
                camera.width, camera.height
            )));
        }
        (camera.width, camera.height) = (width, height);
    }
    Ok(camera)
}

/// `frames` cameras of the standard orbit around a sphere, or the one of `--orbit`.
pub(crate) fn orbit_cameras(
    sphere: OrbitSphere,
    size: Option<(u32, u32)>,
    orbit: Option<[f64; 3]>,
    frames: u32,
) -> Vec<Camera> {
    orbit_cameras_about(UpAxis::Y, sphere, size, orbit, frames)
}

/// Cameras as of [`orbit_cameras`], about any axis.
pub(crate) fn orbit_cameras_about(
    up: UpAxis,
    sphere: OrbitSphere,
    size: Option<(u32, u32)>,
    orbit: Option<[f64; 3]>,
    frames: u32,
) -> Vec<Camera> {
    let size = size.unwrap_or((500, 500));
    if frames == 1 {
        return vec![camera_around(
            up,
            sphere,
            size,
            orbit.unwrap_or([30.0, 20.0, 1.0]),
        )];
    }
    let [azimuth, elevation, fill] = orbit.unwrap_or([0.0, 20.0, 1.0]);
    (0..frames)
        .map(|k| {
            let turn = (f64::from(k) + 0.5) * 360.0 / f64::from(frames);
            camera_around(up, sphere, size, [azimuth + turn, elevation, fill])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_options_are_read_as_documented() {
        assert_eq!(parse_size("1024x768"), Ok((1024, 768)));
        assert!(
            parse_size("0x5").is_err()
                && parse_size("5").is_err()
                && parse_size("99999x1").is_err()
        );
        assert_eq!(parse_orbit("30,20"), Ok([30.0, 20.0, 1.0]));
        assert_eq!(parse_orbit("-30,-20,0.5"), Ok([-30.0, -20.0, 0.5]));
        assert!(
            parse_orbit("1,91,1").is_err()
                && parse_orbit("1,2,0").is_err()
                && parse_orbit("x").is_err()
        );
    }
}
