//! What the passes of a device need to choose the same cut.

use crate::abi::CutConstants;
use crate::cut::frustum_and_size::{NodeTester, low_levels};
use crate::cut::occlusion::SUBPIXEL_BITS;
use crate::cut::occlusion::pixel_centers::PixelCenters;
use crate::cut::strip::{LOW, MAX_COUNT, MAX_WIDTH};
use crate::math::camera::View;
use crate::tree::{Model, Node};

/// The most splats that any cut of a model has: a leaf is one at most, a node what its children are or one
/// row. A few milliseconds a million triangles.
pub fn most_splats(model: &Model) -> u64 {
    let nodes: &[Node] = &model.tree.nodes;
    if nodes.is_empty() {
        return model.tree.leaves.len() as u64;
    }
    let [low, lowest, low_leaves] = low_levels(&model.tree);
    // As `NodeTester::most_in_row` has it.
    let row = |id: u32, children: u32| match id {
        _ if id >= lowest => children.saturating_sub(1),
        _ if id >= low => low_leaves.saturating_sub(1).min(MAX_COUNT),
        _ => MAX_COUNT,
    };
    // Children come after their parents.
    let mut most = vec![1u32; nodes.len()];
    for (id, node) in nodes.iter().enumerate().rev() {
        let count = u32::from(node.child_count);
        let below: u32 = if node.has_leaves() {
            count
        } else {
            let first = node.first_child as usize;
            let children = most.get(first..first + count as usize);
            children.map_or(count, |children| {
                children
                    .iter()
                    .fold(0, |sum, &more| sum.saturating_add(more))
            })
        };
        most[id] = below.max(row(id as u32, count)).max(1);
    }
    u64::from(most[0])
}

impl NodeTester {
    /// Constants of the tester's view on a device whose window positions have so many binary places
    /// ([`Selector::with_subpixel_bits`](crate::cut::CutSelector::with_subpixel_bits)), for lists with room for so many splats and
    /// triangles. The passes know [`SizeMetric::Exact`](crate::cut::SizeMetric::Exact) alone, and thresholds from a pixel on, at
    /// which they choose what [`Selector::select_seen`](crate::cut::CutSelector::select_seen) does, hidden splats with it.
    pub fn constants(
        &self,
        (view, subpixel_bits): (&View, u32),
        most_splats: u32,
        most_triangles: u32,
    ) -> CutConstants {
        let bits = subpixel_bits.clamp(*SUBPIXEL_BITS.start(), *SUBPIXEL_BITS.end());
        let centers = PixelCenters::new(self, view, self.threshold_px, bits);
        let [right, up] = centers.axes();
        let kappa = self.threshold_px / self.twice_focal_px;
        let low = kappa * (1.0 - kappa * kappa).max(0.0);
        let row_limit = if self.is_perspective {
            low * low * LOW
        } else {
            kappa * kappa * LOW
        };
        CutConstants {
            sides: self.side_planes(),
            forward: self.forward_plane(),
            right,
            up,
            view_row: view.view_from_model.row(2).to_array(),
            focal: centers.focal,
            middle: centers.middle,
            reference: self.reference.to_array(),
            unit: self.unit,
            backward: self.backward.to_array(),
            plane_error: self.plane_error,
            near: self.near,
            far: self.far,
            ratio: self.ratio,
            ratio_squared: self.ratio_squared,
            row_ball: kappa,
            row_limit,
            row_width: MAX_WIDTH,
            row_width_squared: MAX_WIDTH * MAX_WIDTH,
            lowest_nodes: self.lowest_nodes,
            low_nodes: self.low_nodes,
            low_leaves: self.low_leaves,
            most_in_row: MAX_COUNT,
            start: u32::from(self.start()),
            is_perspective: u32::from(self.is_perspective),
            most_splats,
            most_triangles,
            place_error: centers.place_error,
            snap: centers.snap_px,
            focal_px: centers.focal_px(),
            are_samples: u32::from(self.threshold_px <= 1.0),
            compute_ratio: 0.0,
            are_points: 0,
            draws_large_leaves: 0,
            are_oriented: 0,
            room: most_splats,
            twice_focal_px: self.twice_focal_px,
            threshold_px: self.threshold_px,
            largest_px: f32::INFINITY,
            names_triangles: 0,
            are_pieces: 0,
            view_focal_px: 2.0 * view.focal_px(),
            view_scale: view.model_scale,
        }
    }
}
