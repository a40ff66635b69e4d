//! A box that parts of a model are cut away by while it is drawn.

use glam::{DVec3, Vec3};

/// Box with sides along the axes of model space. What touches it is drawn, what lies outside is not. Its ends may be infinite: a
/// plane is a box with five such ends, a slab one with four.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionBox {
    /// Least coordinates.
    pub low: Vec3,
    /// Greatest coordinates, none less than the least ones.
    pub high: Vec3,
}

impl SectionBox {
    /// A box between two opposite corners in the coordinates of a file, of a model with this origin.
    pub fn of_file([a, b]: [DVec3; 2], origin: DVec3) -> Self {
        Self {
            low: (a.min(b) - origin).as_vec3(),
            high: (a.max(b) - origin).as_vec3(),
        }
    }

    /// Least and greatest coordinates in those of a file.
    pub fn in_file(&self, origin: DVec3) -> [DVec3; 2] {
        [self.low, self.high].map(|end| end.as_dvec3() + origin)
    }

    /// Distance of a point from the nearest of the six planes, negative outside of any.
    pub fn depth_of(&self, point: Vec3) -> f32 {
        (point - self.low).min(self.high - point).min_element()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_may_come_in_any_order() {
        let origin = DVec3::new(1000.0, 0.0, 0.0);
        let corners = [
            DVec3::new(1003.0, -1.0, 5.0),
            DVec3::new(1001.0, 2.0, f64::NEG_INFINITY),
        ];
        let own = SectionBox::of_file(corners, origin);
        assert_eq!(own.low, Vec3::new(1.0, -1.0, f32::NEG_INFINITY));
        assert_eq!(own.high, Vec3::new(3.0, 2.0, 5.0));
        assert_eq!(own.in_file(origin)[1], DVec3::new(1003.0, 2.0, 5.0));
        assert_eq!(own.depth_of(Vec3::new(1.5, 0.0, 0.0)), 0.5);
        assert_eq!(own.depth_of(Vec3::new(1.5, 0.0, 7.0)), -2.0);
    }
}
