//! Splats that wait until they are four.

use crate::abi::FilteredSplat;
use crate::pack::filtered::eye::FilteredEye;
use crate::pack::filtered::patch::SummedPatch;
use crate::pack::filtered::patch_x4::{FourPatches, SplatSizes};
use crate::pack::filtered::triangle_patches::Triangle;
use crate::pack::parallel::RecordSink;
use glam::{Vec3, Vec4};

/// Splats of rows that wait until they are four.
#[derive(Default)]
pub(super) struct RowGroup {
    pub(super) ids: [u32; 4],
    pub(super) centers: [Vec3; 4],
    pub(super) steps: [Vec3; 4],
    pub(super) shares: [f32; 4],
    pub(super) count: usize,
}

impl RowGroup {
    /// Adds one of `count` splats of a row; whether they are four then.
    #[inline]
    pub(super) fn add(&mut self, id: u32, center: Vec3, step: Vec3, count: u32) -> bool {
        let at = self.count;
        self.ids[at] = id;
        self.centers[at] = center;
        self.steps[at] = step;
        self.shares[at] = 1.0 / count as f32;
        self.count += 1;
        self.count == 4
    }
}

/// What leaves are made of.
pub(super) trait LeafPiece: Copy {
    fn four(pieces: [&Self; 4]) -> FourPatches;
    fn patch(&self) -> SummedPatch;
}

impl LeafPiece for Triangle {
    fn four(pieces: [&Self; 4]) -> FourPatches {
        FourPatches::of_triangles(pieces)
    }

    fn patch(&self) -> SummedPatch {
        self.patch()
    }
}

/// A point.
impl LeafPiece for SummedPatch {
    fn four(pieces: [&Self; 4]) -> FourPatches {
        FourPatches::of_points(pieces)
    }

    fn patch(&self) -> SummedPatch {
        *self
    }
}

/// Leaves that wait until they are four.
pub(super) struct WaitingLeaves<'a, P> {
    eye: &'a FilteredEye<'a>,
    pieces: [P; 4],
    diameters: [f32; 4],
    count: usize,
    is_own: bool,
}

impl<'a, P: LeafPiece> WaitingLeaves<'a, P> {
    /// `any` stands where there are none.
    pub(super) fn new(eye: &'a FilteredEye<'a>, any: P) -> Self {
        Self {
            eye,
            pieces: [any; 4],
            diameters: [0.0; 4],
            count: 0,
            is_own: false,
        }
    }

    #[inline]
    pub(super) fn add(
        &mut self,
        piece: P,
        diameter_px: f32,
        is_own: bool,
        sink: &mut RecordSink<'_, FilteredSplat>,
    ) {
        if self.count == 4 || is_own != self.is_own {
            self.flush(sink);
        }
        self.is_own = is_own;
        self.pieces[self.count] = piece;
        self.diameters[self.count] = diameter_px;
        self.count += 1;
    }

    pub(super) fn flush(&mut self, sink: &mut RecordSink<'_, FilteredSplat>) {
        let eye = self.eye;
        let size = SplatSizes {
            diameter_px: Vec4::from_array(self.diameters),
            is_own: self.is_own,
            ..eye.dense()
        };
        let four = P::four(self.pieces.each_ref());
        let seen = eye.seen(&four);
        let colors = eye.lit(&four, &seen);
        let group = (&four, &seen, self.count);
        eye.splats(
            group,
            &size,
            &colors,
            |lane| self.pieces[lane].patch(),
            |splat| sink.point(splat),
        );
        self.count = 0;
    }
}
