//! The axis of a model that points up.

use glam::DVec3;

/// The axis of world space that is up in pictures. Angles of an orbit (azimuth, elevation) are about it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// x.
    X,
    /// y, as in most programs that draw.
    #[default]
    Y,
    /// z, as in surveying, printing and most construction.
    Z,
}

impl UpAxis {
    /// The name in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The next one: y, z, x.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Y => Self::Z,
            Self::Z => Self::X,
            Self::X => Self::Y,
        }
    }

    /// A vector of a space whose y is up in world space; a rotation.
    pub fn to_world(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(y, -x, z),
            Self::Y => DVec3::new(x, y, z),
            Self::Z => DVec3::new(x, -z, y),
        }
    }

    /// The inverse of [`UpAxis::to_world`].
    pub fn from_world(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(-y, x, z),
            Self::Y => DVec3::new(x, y, z),
            Self::Z => DVec3::new(x, z, -y),
        }
    }

    /// The direction up, world space.
    pub fn direction(self) -> DVec3 {
        self.to_world(DVec3::Y)
    }
}

#[cfg(test)]
mod tests {
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
        }
    }
}
