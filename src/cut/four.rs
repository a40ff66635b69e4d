//! The tests of the cut for four siblings at once, for cuts that other folders make: the same verdicts, to the bit.

use crate::cut::frustum_and_size::NodeTester;
use crate::cut::siblings::{self, PackedNodeLanes, SphereLanes};
use crate::tree::{Leaf, Node};
use glam::Vec4;

/// Balls of four siblings as lanes, in the unit of a tester, from the eye (orthographic: from the center of the root).
#[derive(Debug, Clone, Copy)]
pub struct FourBalls(SphereLanes);

impl FourBalls {
    /// Centers.
    #[inline(always)]
    pub fn center(&self) -> [Vec4; 3] {
        self.0.center
    }

    /// Radii.
    #[inline(always)]
    pub fn radius(&self) -> Vec4 {
        self.0.radius
    }

    /// Distances of the centers along the view direction.
    #[inline(always)]
    pub fn depth(&self) -> Vec4 {
        self.0.depth
    }
}

/// Four nodes as lanes: their balls, cones and strips.
#[derive(Debug, Clone, Copy)]
pub struct FourNodes {
    balls: FourBalls,
    words: PackedNodeLanes,
}

impl FourNodes {
    /// Balls of the four nodes.
    #[inline(always)]
    pub fn balls(&self) -> &FourBalls {
        &self.balls
    }
}

impl NodeTester {
    /// Four nodes, ready to be tested.
    #[inline(always)]
    pub fn four_nodes(&self, nodes: &[Node; 4]) -> FourNodes {
        let (spheres, [_, axis, sine, shape]) = siblings::of_nodes(nodes);
        FourNodes {
            balls: FourBalls(self.balls(spheres)),
            words: PackedNodeLanes { axis, sine, shape },
        }
    }

    /// The balls of four leaves.
    #[inline(always)]
    pub fn four_leaves(&self, leaves: &[Leaf; 4]) -> FourBalls {
        FourBalls(self.balls(siblings::of_leaves(leaves)))
    }

    /// Which balls lie outside of the view volume, and which wholly inside; a bit a lane.
    #[inline(always)]
    pub fn four_in_volume(&self, balls: &FourBalls) -> (u32, u32) {
        self.volume(&balls.0)
    }

    /// Which balls are small enough to be splats.
    #[inline(always)]
    pub fn four_small(&self, balls: &FourBalls) -> u32 {
        self.small(&balls.0)
    }

    /// Which nodes face away everywhere, and which face the viewer everywhere.
    #[inline(always)]
    pub fn four_facing(&self, nodes: &FourNodes) -> (u32, u32) {
        let (axis, sine) = (nodes.words.axis(), nodes.words.sine());
        self.cones(&nodes.balls.0, axis, sine)
    }

    /// Of how many splats along their strips rows would be, and for which nodes such a row will do: the nodes from `first` on,
    /// none of them small.
    #[inline(always)]
    pub fn four_rows(&self, first: u32, nodes: &FourNodes) -> ([u32; 4], u32) {
        let (balls, words) = (&nodes.balls.0, &nodes.words);
        let most = self.most_in_row(first, words);
        let likely = self.may_be_rows(balls, words, most);
        if likely == 0 {
            return ([0; 4], 0);
        }
        let (counts, fits) = self.rows(balls, words, most);
        (counts.to_array().map(|count| count as u32), likely & fits)
    }

    /// Four directions of packed axes ([`crate::math::octahedral`]) as lanes; not unit.
    #[inline(always)]
    pub fn four_directions(axes: [[i16; 2]; 4]) -> [Vec4; 3] {
        let lanes = |i: usize| Vec4::from_array(axes.map(|axis| f32::from(axis[i])));
        Self::cone_axes((lanes(0), lanes(1)))
    }

    /// Pixels that a length of the tester's unit has at a depth of 1, or anywhere in an orthographic view; and whether that is a
    /// perspective.
    #[inline(always)]
    pub fn px_per_unit(&self) -> (f32, bool) {
        (0.5 * self.twice_focal_px, self.is_perspective)
    }

    /// Distance of the near plane, tester units.
    #[inline(always)]
    pub fn near(&self) -> f32 {
        self.near
    }

    /// Unit vector toward the viewer, the same everywhere in an orthographic view.
    #[inline(always)]
    pub fn backward(&self) -> glam::Vec3 {
        self.backward
    }
}
