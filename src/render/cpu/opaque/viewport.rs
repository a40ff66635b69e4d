//! Where the device draws.

use crate::abi::FrameConstants;
use crate::render::cpu::opaque::ovals::OvalScreen;

/// Where the device draws splats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatScreen {
    /// From model to view space: the row of z.
    pub(super) along: [f32; 4],
    /// Factor of z in clip space and what is added: of depth and of the last component.
    pub(super) depth: [f32; 2],
    pub(super) last: [f32; 2],
    /// From model space to window positions times the last component: rows of x and y, pixels.
    pub(super) window: [[f32; 4]; 2],
    /// From a radius in model units to one in pixels: times both, over the last component.
    pub(super) model_scale: f32,
    pub(super) focal_px: f32,
    /// Side or diameter of splats without a radius of their own, pixels.
    pub(super) size_px: f32,
    /// The part of the picture that is drawn in: left, top, and one past right and bottom, pixels.
    pub(super) rect_px: [u32; 4],
    /// For discs in the plane of the surface.
    pub(super) ovals: OvalScreen,
}

impl SplatScreen {
    /// Screen of a frame; `None` where places do not fit their numbers.
    pub fn new(frame: &FrameConstants, rect_px: [u32; 4]) -> Option<Self> {
        let (view, clip) = (&frame.view_from_model, &frame.clip_from_view);
        let row =
            |of: &[[f32; 4]; 4], row: usize| [0, 1, 2, 3].map(|column: usize| of[column][row]);
        let [left, top, right, bottom] = rect_px;
        let fits = |low: u32, high: u32| low <= high && high - low <= u32::from(u16::MAX);
        (fits(left, right) && fits(top, bottom)).then(|| Self {
            along: row(view, 2),
            depth: [clip[2][2], clip[3][2]],
            last: [clip[2][3], clip[3][3]],
            window: [0, 1].map(|i| row(&frame.window_from_model, i)),
            model_scale: frame.model_scale,
            focal_px: frame.focal_px,
            size_px: frame.splat_size_px,
            rect_px,
            ovals: OvalScreen::new(frame),
        })
    }

    /// The part of the picture that is drawn in: left, top, and one past right and bottom, pixels.
    pub fn rect_px(&self) -> [u32; 4] {
        self.rect_px
    }

    /// Pixels of a row of it.
    pub fn width(&self) -> usize {
        (self.rect_px[2] - self.rect_px[0]) as usize
    }

    /// How many pixels all of it has.
    pub fn pixels(&self) -> usize {
        self.width() * (self.rect_px[3] - self.rect_px[1]) as usize
    }
}
