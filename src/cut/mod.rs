//! The cut: which nodes of the tree the current view needs, and as what.
//!
//! [`select`] (or a [`CutSelector`], which keeps its memory) traverses from the root and tests every node on its way. A selector may also
//! start where its last cut went ([`CutSelector::set_coherent`]); the lists are the same. Both ask one [`NodeTester`].

mod batch;
mod coherent;
mod device_constants;
mod four;
mod frustum_and_size;
mod normal_cone;
mod occlusion;
mod select;
mod siblings;
mod strip;
mod whole_sphere;

pub use crate::cut::device_constants::most_splats;
pub use crate::cut::four::{FourBalls, FourNodes};
pub use crate::cut::frustum_and_size::NodeTester;
pub use crate::cut::normal_cone::FacingTest;
pub use crate::cut::occlusion::footprints::{SplatFootprints, ZeroAreaSet};
pub use crate::cut::whole_sphere::WholeSphere;
pub use occlusion::shared::{PartMarks, PartTests, SharedDepth};
pub use select::{CutSelector, select};
pub use strip::{
    MAX_COUNT as MAX_STRIP_COUNT, strip_ball_radius, strip_center, strip_center_of, strip_centers,
    strip_steps,
};

use crate::math::section_box::SectionBox;
use fearless_simd::{Level, Simd, dispatch};

/// What the cut may drop and how small a node must be to be drawn whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutSettings {
    /// A node whose projected diameter is at most this many pixels is drawn as a splat. At least 0; 0 draws
    /// every triangle.
    pub threshold_px: f32,
    /// Drop what faces away everywhere (only right for closed surfaces).
    pub cull_back: bool,
    /// Drop what lies outside of the view volume.
    pub cull_frustum: bool,
    /// What "projected diameter" means.
    pub size: SizeMetric,
    /// Drop what lies outside of this box; `None` drops nothing.
    pub section: Option<SectionBox>,
}

impl Default for CutSettings {
    fn default() -> Self {
        Self {
            threshold_px: 1.0,
            cull_back: false,
            cull_frustum: true,
            size: SizeMetric::Exact,
            section: None,
        }
    }
}

/// The projected diameter of a bounding sphere, pixels. f is the focal length in pixels, R the radius, z the
/// distance of the center along the view direction, D its distance from the eye. All are infinite when the
/// sphere reaches the near plane; all are monotone over nested spheres.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SizeMetric {
    /// Major axis of the ellipse that the sphere covers: 2 f R sqrt(D² - R²) / (z² - R²).
    #[default]
    Exact,
    /// 2 f R / z, the size at the center's depth (Benda).
    Center,
    /// 2 f R / (z - R).
    Nearest,
    /// 2 f tan(asin(R / D)).
    Angle,
    /// Diameter of the circle of the same area as the ellipse.
    Area,
}

/// What is to be drawn, as ids in ascending order: of nodes the upper levels first, in a level in tree order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cut {
    /// Nodes drawn as one splat.
    pub nodes: Vec<u32>,
    /// Nodes drawn as a row of splats along their strip.
    pub strips: Vec<StripRun>,
    /// Leaves drawn as a splat.
    pub leaves: Vec<u32>,
    /// Leaves drawn as their triangle.
    pub triangles: Vec<u32>,
    /// How much work it was.
    pub stats: CutStats,
}

/// A node drawn as `count` splats spread evenly along its strip, less those that are hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StripRun {
    /// The node.
    pub node: u32,
    /// Number of splats, 2 to [`MAX_STRIP_COUNT`].
    pub count: u32,
    /// Bit i: splat i along the strip is drawn. All are where nothing is left out as hidden.
    pub seen: u32,
}

impl StripRun {
    /// All splats of a row.
    #[inline]
    pub fn new(node: u32, count: u32) -> Self {
        let seen = !(u32::MAX << count.min(31));
        Self { node, count, seen }
    }

    /// Number of splats that are drawn.
    #[inline]
    pub fn splats(&self) -> u32 {
        self.seen.count_ones()
    }

    /// The same of many rows.
    pub fn splats_of(rows: &[Self]) -> usize {
        #[inline(always)]
        fn sum<S: Simd>(_: S, rows: &[StripRun]) -> usize {
            let mut sum = 0;
            for row in rows {
                sum += row.splats() as usize;
            }
            sum
        }
        // Bits are counted by the processor where it can: else each row takes as long as a dozen sums.
        dispatch!(Level::new(), simd => sum(simd, rows))
    }

    /// Tells whether splat `index` is drawn.
    #[inline]
    pub fn is_seen(&self, index: u32) -> bool {
        self.seen >> (index & 31) & 1 != 0
    }
}

/// Counts of one cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct CutStats {
    /// Nodes and leaves whose size or visibility was looked at.
    pub visited: u64,
    /// Of those, dropped because outside of the view volume.
    pub outside: u64,
    /// Of those, dropped because facing away.
    pub facing_away: u64,
    /// Splats that were left out because nearer ones cover all of their pixels, or because they are a pixel at most and
    /// contain no center ([`CutSelector::select_seen`]); where splats are pixels, triangles that are hidden too.
    pub hidden: u64,
    /// Triangles that were left out because they lie between the centers of pixels (there).
    pub between: u64,
    /// Nodes that were dropped with all below them, as nearer splats cover all of their pixels (there, where splats are
    /// pixels). How many, and how many are visited and hidden below others, depends on how threads get on; what is left
    /// does not.
    pub behind: u64,
}

impl CutStats {
    /// Adds those of another part of the tree.
    pub(crate) fn add(&mut self, more: &Self) {
        self.visited += more.visited;
        self.outside += more.outside;
        self.facing_away += more.facing_away;
        self.hidden += more.hidden;
        self.between += more.between;
        self.behind += more.behind;
    }
}

impl Cut {
    /// Empties the lists and keeps their memory.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.strips.clear();
        self.leaves.clear();
        self.triangles.clear();
        self.stats = CutStats::default();
    }
}
