//! What pictures hold besides eight bits: colors as floats, and normals.

use crate::render::PictureOutputs;
use crate::render::cpu::opaque::SurfacePlanes;
use crate::render::frame_plan::FramePlan;
use glam::Vec4;

/// Colors and normals of the rectangle that is drawn in, where they are asked for.
#[derive(Debug, Default)]
pub(crate) struct FloatPlanes {
    /// Asked for.
    asked: PictureOutputs,
    /// Outputs of the frame: looks may need more.
    outputs: PictureOutputs,
    values: Vec<[f32; 4]>,
    normals: Vec<[f32; 3]>,
    /// Left, top, and one past right and bottom, pixels.
    rect_px: [u32; 4],
    /// What pixels have that show nothing.
    background: [f32; 4],
}

/// A color as four bytes, rounded as a target of eight bits does: red in the lowest byte, coverage in the highest.
#[inline(always)]
pub(crate) fn word_of(color: Vec4) -> u32 {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round_ties_even() as u32;
    let [red, green, blue, alpha] = color.to_array().map(byte);
    red | green << 8 | blue << 16 | alpha << 24
}

impl FloatPlanes {
    /// Planes of pictures with these outputs.
    pub(crate) fn of(outputs: PictureOutputs) -> Self {
        Self {
            asked: outputs,
            outputs,
            ..Self::default()
        }
    }

    /// Outputs of the frame.
    pub(crate) fn outputs(&self) -> PictureOutputs {
        self.outputs
    }

    /// Empties them for a frame, in the rectangle that it draws in.
    pub(crate) fn begin(&mut self, plan: &FramePlan) {
        self.outputs = plan.settings.outputs_of_frame(self.asked);
        let (rect_px, background) = (plan.context.rect_px, plan.context.background);
        let [left, top, right, bottom] = rect_px.map(|edge| edge as usize);
        let pixels = (right - left) * (bottom - top);
        let [red, green, blue] = background;
        (self.rect_px, self.background) = (rect_px, [red, green, blue, 0.0]);
        self.values.clear();
        self.normals.clear();
        if self.outputs.values {
            self.values.resize(pixels, self.background);
        }
        if self.outputs.normal {
            self.normals.resize(pixels, [0.0; 3]);
        }
    }

    /// All of them, to be drawn in.
    pub(crate) fn planes(&mut self) -> SurfacePlanes<'_> {
        SurfacePlanes {
            values: &mut self.values,
            normals: &mut self.normals,
        }
    }

    /// Colors of a whole picture of this size; empty unless they are asked for.
    pub(crate) fn whole_values(&self, size: [u32; 2]) -> Vec<[f32; 4]> {
        match self.asked.values {
            true => self.whole(size, &self.values, self.background),
            false => Vec::new(),
        }
    }

    /// Normals of a whole picture of this size; empty unless they are asked for.
    pub(crate) fn whole_normals(&self, size: [u32; 2]) -> Vec<[f32; 3]> {
        match self.asked.normal {
            true => self.whole(size, &self.normals, [0.0; 3]),
            false => Vec::new(),
        }
    }

    fn whole<T: Copy>(&self, [width, height]: [u32; 2], plane: &[T], nothing: T) -> Vec<T> {
        let mut all = vec![nothing; width as usize * height as usize];
        let [left, top, right, _] = self.rect_px.map(|edge| edge as usize);
        if right > left {
            let rows = all.chunks_mut(width as usize).skip(top);
            for (row, own) in rows.zip(plane.chunks(right - left)) {
                row[left..right].copy_from_slice(own);
            }
        }
        all
    }
}
