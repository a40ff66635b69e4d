//! The direction of a model that points up: an axis, or where cameras say.

use glam::{DQuat, DVec3};

/// The axis of world space that is up in pictures. Angles of an orbit (azimuth, elevation) are about it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum UpAxis {
    /// x.
    X,
    /// y, as in most programs that draw.
    #[default]
    Y,
    /// z, as in surveying, printing and most construction.
    Z,
    /// A unit vector: a negative axis, or any direction that cameras have in common.
    Along(DVec3),
}

impl UpAxis {
    /// The axis along a vector; `None` of one without a direction.
    pub fn along(vector: DVec3) -> Option<Self> {
        let named = [Self::X, Self::Y, Self::Z];
        let unit = vector.try_normalize()?;
        let is_it = |own: &Self| own.direction() == unit;
        Some(named.into_iter().find(is_it).unwrap_or(Self::Along(unit)))
    }

    /// The name in options, or in sentences of what no option names.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Along(up) if up == -DVec3::X => "-x",
            Self::Along(up) if up == -DVec3::Y => "-y",
            Self::Along(up) if up == -DVec3::Z => "-z",
            Self::Along(_) => "a slanted direction",
        }
    }

    /// The next one: y, z, x, and y after any other.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Y => Self::Z,
            Self::Z => Self::X,
            Self::X | Self::Along(_) => Self::Y,
        }
    }

    /// A vector of a space whose y is up in world space; a rotation.
    pub fn to_world(self, v: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = v;
        match self {
            Self::X => DVec3::new(y, -x, z),
            Self::Y => DVec3::new(x, y, z),
            Self::Z => DVec3::new(x, -z, y),
            Self::Along(up) => turn_to(up) * v,
        }
    }

    /// The inverse of [`UpAxis::to_world`].
    pub fn from_world(self, v: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = v;
        match self {
            Self::X => DVec3::new(-y, x, z),
            Self::Y => DVec3::new(x, y, z),
            Self::Z => DVec3::new(x, z, -y),
            Self::Along(up) => turn_to(up).inverse() * v,
        }
    }

    /// The direction up, world space.
    pub fn direction(self) -> DVec3 {
        match self {
            Self::Along(up) => up,
            _ => self.to_world(DVec3::Y),
        }
    }
}

/// The smallest turn that takes y to a unit vector: about z or x where that is another axis.
fn turn_to(up: DVec3) -> DQuat {
    match up == -DVec3::Y {
        true => DQuat::from_rotation_x(std::f64::consts::PI),
        false => DQuat::from_rotation_arc(DVec3::Y, up),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]
    use super::*;

    #[test]
    fn each_is_a_rotation_that_turns_y_into_it() {
        for (axis, up) in [
            (UpAxis::X, DVec3::X),
            (UpAxis::Y, DVec3::Y),
            (UpAxis::Z, DVec3::Z),
        ] {
            assert_eq!(axis.direction(), up);
            let [x, y, z] = DVec3::AXES.map(|own| axis.to_world(own));
            assert_eq!(x.cross(y), z, "{axis:?}");
            let v = DVec3::new(1.0, 2.0, -3.0);
            assert_eq!(axis.from_world(axis.to_world(v)), v);
            assert_eq!(axis.next().next().next(), axis);
            assert_eq!(UpAxis::along(3.0 * up), Some(axis));
        }
    }

    #[test]
    fn any_direction_is_a_rotation_that_turns_y_into_it() {
        for up in [
            -DVec3::X,
            -DVec3::Y,
            -DVec3::Z,
            DVec3::new(0.3, -0.8, 0.5),
            DVec3::new(1e-9, -1.0, 0.0),
        ] {
            let axis = UpAxis::along(2.0 * up).unwrap();
            assert!(axis.direction().distance(up.normalize()) < 1e-12);
            assert!(axis.to_world(DVec3::Y).distance(axis.direction()) < 1e-9);
            let [x, y, z] = DVec3::AXES.map(|own| axis.to_world(own));
            assert!(x.cross(y).distance(z) < 1e-9, "{axis:?}");
            let v = DVec3::new(1.0, 2.0, -3.0);
            assert!(axis.from_world(axis.to_world(v)).distance(v) < 1e-9);
            assert_eq!(axis.next(), UpAxis::Y);
        }
        assert_eq!(UpAxis::along(-2.0 * DVec3::Z).unwrap().name(), "-z");
        assert_eq!(UpAxis::along(DVec3::ZERO), None);
        assert_eq!(UpAxis::along(DVec3::NAN), None);
        // Named axes turn as any direction would.
        for axis in [UpAxis::X, UpAxis::Z] {
            let v = DVec3::new(1.0, 2.0, -3.0);
            let other = UpAxis::Along(axis.direction());
            assert!(axis.to_world(v).distance(other.to_world(v)) < 1e-9);
        }
    }
}
