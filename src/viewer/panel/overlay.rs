//! Painting over the picture of the window.

use egui::{Context, LayerId, Painter, Pos2, Rect, Vec2, pos2};

/// A painter over the picture, below the windows of egui.
pub(in crate::viewer) struct OverlayPainter {
    /// Painter that leaves out what lies beside the picture.
    pub(in crate::viewer) painter: Painter,
    left: f32,
    /// Pixels a point.
    pub(in crate::viewer) scale: f32,
}

impl OverlayPainter {
    /// Readies a painter for a window of this size in points, whose picture begins `inset` pixels from the left.
    pub(in crate::viewer) fn new(context: &Context, inset: f32, size: Vec2) -> Self {
        let scale = context.pixels_per_point();
        let left = inset / scale;
        let area = Rect::from_min_max(pos2(left, 0.0), pos2(size.x, size.y));
        let painter = context.layer_painter(LayerId::background());
        Self {
            painter: painter.with_clip_rect(area),
            left,
            scale,
        }
    }

    /// Place of a pixel of the picture in the window, points.
    pub(in crate::viewer) fn at(&self, [x, y]: [f32; 2]) -> Pos2 {
        pos2(self.left + x / self.scale, y / self.scale)
    }
}
