//! Handles on the faces of a section's box, which are dragged in the picture. Pure logic.

use crate::math::camera::View;
use crate::math::section_box::SectionBox;
use crate::projective::surface_rays::SurfaceRays;
use glam::{DVec2, DVec3, Vec3};

/// Farthest that a click may be from the middle of a handle, pixels.
const REACH_PX: f64 = 10.0;

/// Least square of the sine between the axis of a face and the ray of a pixel: closer to the axis a pixel is too long a way.
const LEAST_SINE_SQUARED: f64 = 1e-3;

/// A face of a box: it lies across an axis, at its lower or its upper end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionFace {
    /// The axis: 0 to 2 for x, y and z.
    pub axis: usize,
    /// The face is at the upper end.
    pub is_upper: bool,
}

impl SectionFace {
    /// All six.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..3).flat_map(|axis| [false, true].map(|is_upper| Self { axis, is_upper }))
    }
}

/// The box of a section in a view, as far as the model reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionHandles {
    /// The section's own ends, model space; infinite ones are those of the model.
    shown: SectionBox,
    /// Box of the model, model space.
    whole: SectionBox,
}

/// A handle that is being dragged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionDrag {
    /// Face that is dragged.
    pub face: SectionFace,
    /// Distance along the axis at which the face lies beyond the place that was taken hold of.
    off: f64,
}

impl SectionHandles {
    /// Handles of a section of a model that lies within `whole`.
    pub fn new(section: &SectionBox, whole: SectionBox) -> Self {
        let inside = |end: Vec3| end.clamp(whole.low, whole.high);
        let shown = SectionBox {
            low: inside(section.low),
            high: inside(section.high),
        };
        Self { shown, whole }
    }

    /// Middle of a face, model space.
    pub fn place(&self, face: SectionFace) -> Vec3 {
        let mut place = 0.5 * (self.shown.low + self.shown.high);
        place[face.axis] = self.end(face);
        place
    }

    fn end(&self, face: SectionFace) -> f32 {
        match face.is_upper {
            true => self.shown.high[face.axis],
            false => self.shown.low[face.axis],
        }
    }

    /// Edges of the box, model space.
    pub fn edges(&self) -> impl Iterator<Item = [Vec3; 2]> {
        let ends = [self.shown.low, self.shown.high];
        (0..3).flat_map(move |axis| {
            (0..4).map(move |corner| {
                let [one, two] = [(axis + 1) % 3, (axis + 2) % 3];
                [0, 1].map(|end: usize| {
                    let mut place = ends[end];
                    place[one] = ends[corner & 1][one];
                    place[two] = ends[corner >> 1][two];
                    place
                })
            })
        })
    }

    /// Position of the handle of a face in the picture, pixels, and its distance. None before the near plane.
    pub fn seen(&self, view: &View, face: SectionFace) -> Option<([f32; 2], f32)> {
        let (x, y, distance) = view.project(self.place(face));
        let is_seen = distance > view.near && x.is_finite() && y.is_finite();
        is_seen.then_some(([x, y], distance))
    }

    /// The handle at a position of the picture; where several are, the nearest to the eye.
    pub fn at(&self, view: &View, at: DVec2) -> Option<SectionFace> {
        let near = SectionFace::all().filter_map(|face| {
            let ([x, y], distance) = self.seen(view, face)?;
            let off = DVec2::new(x.into(), y.into()).distance(at);
            (off <= REACH_PX).then_some((distance, face))
        });
        let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, face)| face)
    }

    /// Takes hold of the handle at a position of the picture, if one is there.
    pub fn grab(&self, view: &View, at: DVec2) -> Option<SectionDrag> {
        let face = self.at(view, at)?;
        let held = self.along(view, face, at)?;
        Some(SectionDrag {
            face,
            off: f64::from(self.end(face)) - held,
        })
    }

    /// The section with the dragged face where the cursor is now: within the model, and not beyond the opposite face.
    pub fn dragged(&self, view: &View, drag: SectionDrag, at: DVec2) -> Option<SectionBox> {
        let face = drag.face;
        let end = (self.along(view, face, at)? + drag.off) as f32;
        let mut own = self.shown;
        let (axis, whole) = (face.axis, &self.whole);
        match face.is_upper {
            true => own.high[axis] = end.clamp(own.low[axis], whole.high[axis]),
            false => own.low[axis] = end.clamp(whole.low[axis], own.high[axis]),
        }
        Some(own)
    }

    /// Coordinate along the axis of a face of the place on the line through its middle that comes nearest to the ray of a pixel.
    /// None where the ray runs along that line.
    fn along(&self, view: &View, face: SectionFace, at: DVec2) -> Option<f64> {
        let rays = SurfaceRays::of(view);
        let (x, y) = (at.x as f32, at.y as f32);
        let (start, towards) = (rays.point(x, y, 0.0), rays.direction(x, y));
        let ray = towards.as_dvec3().normalize_or_zero();
        let offset = start.as_dvec3() - self.place(face).as_dvec3();
        let axis = DVec3::AXES[face.axis];
        let cosine = ray.dot(axis);
        let sine_squared = 1.0 - cosine * cosine;
        if sine_squared < LEAST_SINE_SQUARED {
            return None;
        }
        let along = (offset.dot(axis) - cosine * offset.dot(ray)) / sine_squared;
        Some(f64::from(self.end(face)) + along)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::math::camera::Camera;

    fn view() -> View {
        let eye = DVec3::new(4.0, 3.0, 9.0);
        let camera = Camera::look_at((800, 600), eye, DVec3::ZERO, DVec3::Y, 0.8, [0.1, 100.0]);
        camera.view(DVec3::ZERO).unwrap()
    }

    fn handles() -> SectionHandles {
        let whole = SectionBox {
            low: Vec3::splat(-2.0),
            high: Vec3::new(2.0, 1.0, 2.0),
        };
        let section = SectionBox {
            low: Vec3::new(-1.0, f32::NEG_INFINITY, -1.5),
            high: Vec3::new(1.5, f32::INFINITY, 0.5),
        };
        SectionHandles::new(&section, whole)
    }

    fn pixel(view: &View, place: Vec3) -> DVec2 {
        let (x, y, _) = view.project(place);
        DVec2::new(x.into(), y.into())
    }

    #[test]
    fn faces_follow_the_cursor_along_their_axis_and_stay_within_the_model() {
        let (view, own) = (view(), handles());
        for face in SectionFace::all() {
            let middle = own.place(face);
            let at = pixel(&view, middle) + DVec2::new(2.0, -3.0);
            let drag = own.grab(&view, at).unwrap();
            assert_eq!(drag.face, face);
            // Nothing moves before the cursor does.
            let same = own.dragged(&view, drag, at).unwrap();
            assert!(same.low.abs_diff_eq(own.shown.low, 1e-4), "{same:?}");
            assert!(same.high.abs_diff_eq(own.shown.high, 1e-4), "{same:?}");
            // From the middle the face goes where the cursor shows it.
            let drag = own.grab(&view, pixel(&view, middle)).unwrap();
            let mut there = middle;
            there[face.axis] += if face.is_upper { -0.3 } else { 0.3 };
            let moved = own.dragged(&view, drag, pixel(&view, there)).unwrap();
            let end = [moved.low, moved.high][usize::from(face.is_upper)][face.axis];
            assert!((end - there[face.axis]).abs() < 1e-3, "{face:?}: {end}");
            // Far away it stops at the opposite face or at the model's end.
            let inward = if face.is_upper { -4.0 } else { 4.0 };
            let ends = [inward, -inward].map(|way| {
                let mut far = middle;
                far[face.axis] += way;
                let own = own.dragged(&view, drag, pixel(&view, far)).unwrap();
                [own.low, own.high][usize::from(face.is_upper)][face.axis]
            });
            let (other, last) = match face.is_upper {
                true => (own.shown.low, own.whole.high),
                false => (own.shown.high, own.whole.low),
            };
            assert_eq!(ends, [other[face.axis], last[face.axis]], "{face:?}");
        }
    }

    #[test]
    fn the_box_has_twelve_edges_and_nothing_is_held_beside_a_handle() {
        let (view, own) = (view(), handles());
        let mut edges: Vec<[Vec3; 2]> = own.edges().collect();
        assert_eq!(edges.len(), 12);
        for [a, b] in &edges {
            let apart = (*b - *a).to_array().map(|d| usize::from(d != 0.0));
            assert_eq!(apart.iter().sum::<usize>(), 1, "{a} {b}");
        }
        edges.dedup();
        assert_eq!(edges.len(), 12);
        let upper = SectionFace {
            axis: 0,
            is_upper: true,
        };
        let beside = pixel(&view, own.place(upper)) + DVec2::new(11.0, 0.0);
        assert_ne!(own.at(&view, beside), Some(upper));
        // Along the axis a pixel tells no length.
        let eye = DVec3::new(9.0, 0.0, 0.0);
        let camera = Camera::look_at((80, 60), eye, DVec3::ZERO, DVec3::Y, 0.8, [0.1, 100.0]);
        let along = camera.view(DVec3::ZERO).unwrap();
        assert_eq!(own.along(&along, upper, DVec2::new(40.0, 30.0)), None);
    }
}
