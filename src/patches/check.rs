//! Proof that records bound the surface below their nodes.

use super::record::NodePatch;
use crate::tree::{Model, geometric_normal};
use glam::{DVec2, Vec2};
use rayon::prelude::*;
use std::ops::Range;

/// Nodes whose records are wrong that are named; the rest are only counted.
const MOST_NAMED: usize = 8;

/// What is wrong with the records that a model has, a line each; empty where nothing is, and where there are none. Every
/// corner below a node must have its foot in the footprint, lie within the thickness, and no face may be turned further than
/// the half angle. O(n log n).
pub fn check_records(model: &Model) -> Vec<String> {
    let Some(records) = &model.patches else {
        return Vec::new();
    };
    let nodes = &model.tree.nodes;
    if records.records.len() != nodes.len() {
        return vec!["not one record of a patch for each node".into()];
    }
    let found: Vec<String> = (0..nodes.len())
        .into_par_iter()
        .filter_map(|index| {
            let patch = records.record(index, &nodes[index]);
            let cause = violation(model, index as u32, &patch, room_of(&patch))?;
            Some(format!("patch of node {index}: {cause}"))
        })
        .collect();
    let rest = found.len().saturating_sub(MOST_NAMED);
    let mut lines: Vec<String> = found.into_iter().take(MOST_NAMED).collect();
    if rest > 0 {
        lines.push(format!("{rest} more patches that do not bound their nodes"));
    }
    lines
}

/// Tests a record against all triangles of a model that lies below its node: says what is wrong, `None` where it bounds them.
pub fn check_record(model: &Model, patch: &NodePatch) -> Option<String> {
    violation_of(model, 0..model.tree.leaf_count(), patch, room_of(patch))
}

/// Rounding of the record's own numbers, and of coordinates to single precision.
fn room_of(patch: &NodePatch) -> f64 {
    let largest = patch.origin.abs().max_element() + patch.reach();
    1e-6 * f64::from(patch.reach()) + f64::from(f32::EPSILON * largest)
}

/// What a record says wrongly of the corners below its node, by more than `room` (model units); `None` where it bounds them,
/// or is never drawn.
pub(super) fn violation(model: &Model, node: u32, patch: &NodePatch, room: f64) -> Option<String> {
    violation_of(model, model.tree.leaf_range(node), patch, room)
}

fn violation_of(model: &Model, leaves: Range<u32>, patch: &NodePatch, room: f64) -> Option<String> {
    if !patch.may_be_drawn() {
        return None;
    }
    let (normal, axis) = (patch.normal.as_dvec3(), patch.axis.as_dvec3());
    let across = normal.cross(axis);
    let (corners, count) = patch.corners();
    for leaf in leaves {
        let positions = model.triangles[leaf as usize].map(|c| model.vertices[c as usize].position);
        let (face, area) = geometric_normal(positions);
        let angle = face.cross(normal).length().atan2(face.dot(normal));
        if area > 0.0 && angle > f64::from(patch.half_angle) {
            return Some(format!("a face is turned by {angle} radians"));
        }
        for position in positions {
            let offset = (position - patch.origin).as_dvec3();
            let height = offset.dot(normal).abs();
            if height > f64::from(patch.thickness) + room {
                return Some(format!("a vertex lies {height} from the plane"));
            }
            let foot = DVec2::new(offset.dot(axis), offset.dot(across));
            for i in 0..count {
                let [from, to] = [corners[i], corners[(i + 1) % count]].map(Vec2::as_dvec2);
                let inside = (to - from).normalize_or_zero().perp_dot(foot - from);
                if inside < -room {
                    return Some(format!("a vertex lies {} outside of it", -inside));
                }
            }
        }
    }
    None
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::patches::add_records;
    use crate::patches::tests::model_of;
    use crate::progress::SilentProgress;
    use crate::tree::PackedPatch;
    use std::sync::Arc;

    #[test]
    fn records_that_do_not_bound_their_node_are_named() {
        let mut model = model_of("sphere:2000");
        assert!(check_records(&model).is_empty(), "there are none");
        add_records(&mut model, &SilentProgress).unwrap();
        assert!(check_records(&model).is_empty());
        let good = model.patches.clone().unwrap();
        let mut found = |change: fn(&mut PackedPatch)| {
            let mut records = good.records.clone();
            records.iter_mut().for_each(change);
            model.patches = Some(Arc::new(crate::tree::PatchRecords {
                records,
                colors: Vec::new(),
            }));
            check_records(&model)
        };
        for (change, cause) in [
            (
                (|record| record.thickness = 0) as fn(&mut PackedPatch),
                "from the plane",
            ),
            (|record| record.half_extents[0] /= 2, "outside of it"),
            (|record| record.half_angle = 0, "a face is turned by"),
        ] {
            let lines = found(change);
            assert_eq!(lines.len(), MOST_NAMED + 1, "{lines:?}");
            assert!(lines[0].starts_with("patch of node "), "{lines:?}");
            assert!(lines.iter().any(|line| line.contains(cause)), "{lines:?}");
        }
        let mut records = good.records.clone();
        records.pop();
        model.patches = Some(Arc::new(crate::tree::PatchRecords {
            records,
            colors: Vec::new(),
        }));
        assert_eq!(check_records(&model).len(), 1);
    }
}
