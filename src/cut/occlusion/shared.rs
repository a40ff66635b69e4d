//! Occlusion culling of several models that are parts of one picture, each with a cut of its own.

use super::{DepthMarks, OcclusionTest, SUBPIXEL_BITS, SoftwareDepthBuffer};
use crate::cut::frustum_and_size::NodeTester;
use crate::cut::occlusion::footprints::{SplatFootprints, ZeroAreaSet};
use crate::cut::select::NodeTests;
use crate::cut::whole_sphere::WholeSphere;
use crate::cut::{Cut, CutSelector, CutSettings};
use crate::math::camera::View;
use crate::tree::Model;

/// A depth buffer that the cuts of several parts share.
///
/// Each part is cut by [`CutSelector::select_part`](crate::cut::CutSelector::select_part), in any order and by any thread,
/// and leaves marks. Once all are cut, [`SharedDepth::repair`] is told the marks of each, and then
/// [`SharedDepth::finish`] leaves out of each what any other hides. All parts must be drawn as they were cut.
#[derive(Debug, Default)]
pub struct SharedDepth {
    nearest: SoftwareDepthBuffer,
    whole: WholeSphere,
    undrawn: ZeroAreaSet,
}

/// Questions that the cut of a part has asked the depth buffer, splat by splat and triangle by triangle. They are asked again
/// once all parts are cut.
#[derive(Debug, Default)]
pub struct PartMarks(pub(in crate::cut) DepthMarks);

/// View and settings of the cuts of all parts of a picture.
#[derive(Debug, Clone, Copy)]
pub struct PartTests<'a> {
    /// The view, in the space that all parts are in.
    pub view: &'a View,
    /// Settings of the cut: they decide which nodes are drawn.
    pub settings: &'a CutSettings,
    /// Shape on the picture of what is drawn of a node.
    pub footprints: SplatFootprints,
}

impl SharedDepth {
    /// Empties it for a picture of parts within a sphere, and tells whether it can: sides of the picture must fit 16 bits.
    pub fn begin(&mut self, view: &View, whole: WholeSphere) -> bool {
        self.whole = whole;
        self.nearest.clear(view.width, view.height)
    }

    /// The tests of a part.
    pub(in crate::cut) fn tester(&self, model: &Model, tests: &PartTests<'_>) -> NodeTester {
        NodeTester::of_part(model, self.whole, tests.view, tests.settings)
    }

    /// The questions of a part with these tests.
    pub(in crate::cut) fn questions<'a>(
        &'a self,
        tester: &NodeTester,
        tests: &PartTests<'_>,
        (undrawn, subpixel_bits): (&'a ZeroAreaSet, u32),
    ) -> OcclusionTest<'a> {
        let seen = (tests.footprints, undrawn);
        OcclusionTest::new(&self.nearest, tester, tests.view, seen, subpixel_bits)
    }

    /// The questions that need no model: those of marks.
    fn of_marks(&self, tests: &PartTests<'_>) -> OcclusionTest<'_> {
        let tester = self.tester(&Model::default(), tests);
        self.questions(&tester, tests, (&self.undrawn, *SUBPIXEL_BITS.start()))
    }

    /// Tells whether a part that lies within a sphere is wholly behind what was found so far. Its splats must not be larger
    /// than those of `tests` by more than what is in the sphere.
    pub fn hides(&self, tests: &PartTests<'_>, sphere: WholeSphere) -> bool {
        let tester = self.tester(&Model::default(), tests);
        let bits = *SUBPIXEL_BITS.start();
        let hiding = self.questions(&tester, tests, (&self.undrawn, bits));
        hiding.is_ball_hidden(&tester.ball(sphere.center, sphere.radius))
    }

    /// Stores the depths of a part once more over which other threads may have stored farther ones: to be done with the marks of
    /// all parts before the first is finished.
    pub fn repair(&self, tests: &PartTests<'_>, marks: &PartMarks) {
        self.of_marks(tests).repair(&marks.0);
    }

    /// Leaves out of a part what is hidden, now that all parts are cut.
    pub fn finish(&self, tests: &PartTests<'_>, cut: &mut Cut, marks: &PartMarks) {
        self.of_marks(tests).finish(cut, &marks.0, &mut []);
    }
}

impl CutSelector {
    /// As [`select_seen`](Self::select_seen), of one of several parts that hide each other: what is hidden by what was found
    /// so far is left out, and the rest leaves marks, for [`SharedDepth::finish`] once all are cut.
    pub fn select_part(
        &mut self,
        model: &Model,
        tests: &PartTests<'_>,
        depth: &SharedDepth,
        undrawn: &ZeroAreaSet,
        (cut, marks): (&mut Cut, &mut PartMarks),
    ) {
        let tester = &depth.tester(model, tests);
        let hiding = &depth.questions(tester, tests, (undrawn, self.subpixel_bits));
        let tests = NodeTests {
            tester,
            hiding: Some(hiding),
            is_part: true,
        };
        self.run(model, tests, cut);
        std::mem::swap(&mut self.marks, &mut marks.0);
    }
}
