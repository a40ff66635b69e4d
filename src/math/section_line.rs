//! A line on the map along which a model is cut upright, and the camera that looks at the cut.

use super::camera::{Camera, HeadlightSource};
use super::up_axis::UpAxis;
use glam::{DMat4, DVec3, DVec4};

/// An upright slab around a straight line: so long as the line, endless in height, and half of its width to either side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionLine {
    /// Start of the line, at height 0; world space.
    start: DVec3,
    /// Unit vector from start to end.
    along: DVec3,
    /// Unit vector to the left of one who walks the line.
    left: DVec3,
    /// Unit vector up.
    above: DVec3,
    length: f64,
    width: f64,
}

/// A place as the section has it, units of the coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPlace {
    /// Distance from the start along the line.
    pub distance: f64,
    /// Distance from the line, positive to the left of one who walks from start to end.
    pub offset: f64,
    /// Height: the coordinate along the axis that is up.
    pub height: f64,
}

/// Pixels of the picture around the part that shows the section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionMargins {
    /// Left of the start of the line.
    pub left: u32,
    /// Right of its end.
    pub right: u32,
    /// Above the greatest height.
    pub top: u32,
    /// Below the least one.
    pub bottom: u32,
}

/// Extent of a picture of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionFrame {
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Pixels around the section.
    pub margins: SectionMargins,
    /// Least and greatest height.
    pub heights: [f64; 2],
    /// Factor by which heights are drawn longer than distances.
    pub exaggeration: f64,
}

impl SectionLine {
    /// A line between two places, whose heights do not matter, and the width of its slab.
    ///
    /// # Errors
    /// Says what is wrong: ends above one another or not finite, or a width that is not above 0.
    pub fn new(ends: [DVec3; 2], width: f64, up: UpAxis) -> Result<Self, &'static str> {
        let above = up.direction();
        let [start, end] = ends.map(|end| end - above * end.dot(above));
        let (way, length) = (end - start, (end - start).length());
        if !(length.is_normal() && start.is_finite() && end.is_finite()) {
            return Err("the ends of the line are at one place of the map; two places are wanted");
        }
        if !(width.is_normal() && width > 0.0) {
            return Err("the width has to be above 0");
        }
        let along = way / length;
        Ok(Self {
            start,
            along,
            left: above.cross(along),
            above,
            length,
            width,
        })
    }

    /// Length of the line.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Width of the slab.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Axis that is up: 0 to 2 for x, y and z.
    pub fn up_axis(&self) -> usize {
        let is_up = |axis: &usize| self.above.to_array()[*axis] != 0.0;
        (0..3).find(is_up).unwrap_or(2)
    }

    /// The place of a point of world space.
    pub fn place_of(&self, world: DVec3) -> SectionPlace {
        let from_start = world - self.start;
        SectionPlace {
            distance: from_start.dot(self.along),
            offset: from_start.dot(self.left),
            height: world.dot(self.above),
        }
    }

    /// Tells whether a place lies in the slab; its sides belong to it.
    pub fn contains(&self, place: SectionPlace) -> bool {
        (0.0..=self.length).contains(&place.distance) && place.offset.abs() <= 0.5 * self.width
    }

    /// Units of the coordinates that a pixel is wide: as few as let the frame show the line and all heights.
    pub fn units_of_pixel(&self, frame: &SectionFrame) -> f64 {
        let [inner_width, inner_height] = frame.inner();
        let tall = (frame.heights[1] - frame.heights[0]) * frame.exaggeration;
        (self.length / inner_width).max(tall / inner_height)
    }

    /// The frame with the section in the middle of its picture: more heights, or wider margins.
    #[must_use]
    pub fn centered(&self, frame: &SectionFrame) -> SectionFrame {
        let unit = self.units_of_pixel(frame);
        let [inner_width, inner_height] = frame.inner();
        let [low, high] = frame.heights;
        let tall = inner_height * unit / frame.exaggeration;
        let more = (0.5 * (tall - (high - low))).max(0.0);
        // The cast saturates.
        let beside = (0.5 * (inner_width - self.length / unit)) as u32;
        SectionFrame {
            margins: SectionMargins {
                left: frame.margins.left + beside,
                right: frame.margins.right + beside,
                ..frame.margins
            },
            heights: [low - more, high + more],
            ..*frame
        }
    }

    /// An orthographic camera that looks at the slab from its right side, the start of the line to the left. Its near and far
    /// planes are the sides of the slab, moved out by `slack`.
    pub fn camera(&self, frame: &SectionFrame, slack: f64) -> Camera {
        let [width, height] = frame.size.map(f64::from);
        let unit = self.units_of_pixel(frame);
        let origin = self.start + self.above * frame.heights[0];
        // Before the slab by its width: distances are positive.
        let eye = origin - self.left * (self.width + 2.0 * slack);
        let [near, far] = [0.5, 1.5].map(|part| part * self.width);
        let [near, far] = [near + slack, far + 3.0 * slack];
        let [right, above, back] = [self.along, self.above, -self.left];
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        let margins = frame.margins;
        let scale = [
            2.0 / (unit * width),
            2.0 * frame.exaggeration / (unit * height),
        ];
        let offset = [
            2.0 * f64::from(margins.left) / width - 1.0,
            2.0 * f64::from(margins.bottom) / height - 1.0,
        ];
        Camera {
            width: frame.size[0],
            height: frame.size[1],
            view: DMat4::from_cols(row(right), row(above), row(back), DVec4::W).transpose(),
            proj: DMat4::from_cols(
                DVec4::new(scale[0], 0.0, 0.0, 0.0),
                DVec4::new(0.0, scale[1], 0.0, 0.0),
                DVec4::new(0.0, 0.0, 1.0 / (near - far), 0.0),
                DVec4::new(offset[0], offset[1], near / (near - far), 1.0),
            ),
            y_down: false,
            light: HeadlightSource::Directional,
            other: serde_json::Map::new(),
        }
    }

    /// Pixel of a distance and a height, from the upper left corner.
    pub fn pixel_of(&self, frame: &SectionFrame, distance: f64, height: f64) -> [f32; 2] {
        let unit = self.units_of_pixel(frame);
        let up = (height - frame.heights[0]) * frame.exaggeration / unit;
        let bottom = f64::from(frame.size[1].saturating_sub(frame.margins.bottom));
        [
            (f64::from(frame.margins.left) + distance / unit) as f32,
            (bottom - up) as f32,
        ]
    }
}

impl SectionFrame {
    /// Width and height of the part within the margins, pixels, at least one.
    fn inner(&self) -> [f64; 2] {
        let margins = self.margins;
        [
            self.size[0].saturating_sub(margins.left.saturating_add(margins.right)),
            self.size[1].saturating_sub(margins.top.saturating_add(margins.bottom)),
        ]
        .map(|side| f64::from(side.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARGINS: SectionMargins = SectionMargins {
        left: 60,
        right: 10,
        top: 20,
        bottom: 30,
    };

    fn frame(size: [u32; 2], heights: [f64; 2], exaggeration: f64) -> SectionFrame {
        SectionFrame {
            size,
            margins: MARGINS,
            heights,
            exaggeration,
        }
    }

    #[test]
    fn places_go_along_the_line_and_to_its_left() {
        let ends = [
            DVec3::new(1000.0, 2000.0, 7.0),
            DVec3::new(1003.0, 2004.0, -9.0),
        ];
        let line = SectionLine::new(ends, 2.0, UpAxis::Z).unwrap();
        assert_eq!(line.length(), 5.0);
        // Two along, one to the left of a line to the upper right.
        let world = DVec3::new(1000.0 + 1.2 - 0.8, 2000.0 + 1.6 + 0.6, 33.0);
        let place = line.place_of(world);
        assert!((place.distance - 2.0).abs() < 1e-9 && (place.offset - 1.0).abs() < 1e-9);
        assert_eq!(place.height, 33.0);
        let at = |distance, offset| SectionPlace {
            distance,
            offset,
            height: 1e9,
        };
        assert!(line.contains(at(0.0, -1.0)) && line.contains(at(5.0, 1.0)));
        assert!(!line.contains(at(-1e-9, 0.0)) && !line.contains(at(5.0 + 1e-9, 0.0)));
        assert!(!line.contains(at(2.0, 1.0 + 1e-9)) && !line.contains(at(f64::NAN, 0.0)));
    }

    #[test]
    fn lines_that_are_none_are_refused() {
        let a = DVec3::new(1.0, 2.0, 3.0);
        let above = DVec3::new(1.0, 2.0, 9.0);
        assert!(SectionLine::new([a, above], 1.0, UpAxis::Z).is_err());
        assert!(SectionLine::new([a, above], 1.0, UpAxis::Y).is_ok());
        assert!(SectionLine::new([a, DVec3::NAN], 1.0, UpAxis::Z).is_err());
        assert!(SectionLine::new([a, DVec3::INFINITY], 1.0, UpAxis::Z).is_err());
        for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(SectionLine::new([a, DVec3::ZERO], width, UpAxis::Z).is_err());
        }
    }

    #[test]
    fn sections_come_to_the_middle_of_pictures() {
        let line = SectionLine::new([DVec3::ZERO, DVec3::X * 10.0], 1.0, UpAxis::Z).unwrap();
        // 430 x 350 pixels for 10 x 2 units: heights are added. For 10 x 20 units: margins.
        let flat = line.centered(&frame([500, 400], [0.0, 2.0], 1.0));
        let [low, high] = flat.heights;
        assert!((high - low - 350.0 / 43.0).abs() < 1e-9 && (low + high - 2.0).abs() < 1e-9);
        assert_eq!(flat.margins, MARGINS);
        let tall = line.centered(&frame([500, 400], [0.0, 20.0], 1.0));
        let beside = (430 - 175) / 2;
        assert_eq!(
            (tall.margins.left, tall.margins.right),
            (60 + beside, 10 + beside)
        );
        assert!((tall.heights[0]).abs() < 1e-9 && (tall.heights[1] - 20.0).abs() < 1e-9);
    }

    /// The camera sees a place at the pixel that the frame says, between near and far where the slab holds it, whatever is up.
    #[test]
    fn the_camera_has_one_unit_on_both_axes_and_the_slab_for_its_depth() {
        for up in [UpAxis::X, UpAxis::Y, UpAxis::Z] {
            let own = |v: DVec3| up.to_world(UpAxis::Z.from_world(v)) + DVec3::new(4e5, 5e6, 300.0);
            let ends = [DVec3::ZERO, DVec3::new(30.0, 40.0, 0.0)].map(own);
            let line = SectionLine::new(ends, 4.0, up).unwrap();
            let base = line.place_of(ends[0]).height;
            for exaggeration in [1.0, 3.0] {
                let frame = frame([500, 400], [base - 2.0, base + 8.0], exaggeration);
                let view = line.camera(&frame, 0.0).view(ends[0]).unwrap();
                assert!(!view.is_perspective);
                for (distance, offset, height) in
                    [(0.0, -2.0, -2.0), (50.0, 2.0, 8.0), (20.0, 0.5, 3.0)]
                {
                    let (s, c) = (0.8, 0.6);
                    let x = c * distance - s * offset;
                    let y = s * distance + c * offset;
                    let world = own(DVec3::new(x, y, height));
                    let place = line.place_of(world);
                    assert!((place.distance - distance).abs() < 1e-6, "{up:?} {place:?}");
                    assert!((place.offset - offset).abs() < 1e-6, "{up:?} {place:?}");
                    let wanted = line.pixel_of(&frame, distance, base + height);
                    let (px, py, depth) = view.project((world - ends[0]).as_vec3());
                    assert!((px - wanted[0]).abs() < 0.01 && (py - wanted[1]).abs() < 0.01);
                    assert!((f64::from(depth) - (4.0 + offset)).abs() < 1e-4);
                }
                assert!((view.near - 2.0).abs() < 1e-5 && (view.far - 6.0).abs() < 1e-5);
                let pixel = |d: f64, h: f64| line.pixel_of(&frame, d, base + h);
                let across = f64::from(pixel(10.0, 0.0)[0] - pixel(0.0, 0.0)[0]);
                let upward = f64::from(pixel(0.0, 0.0)[1] - pixel(0.0, 1.0)[1]);
                assert!((10.0 * upward / across - exaggeration).abs() < 1e-4);
                assert!(pixel(50.0, 8.0)[0] <= 490.01 && pixel(50.0, 8.0)[1] >= 19.99);
            }
        }
    }
}
