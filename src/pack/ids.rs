//! From a cut to the numbers of its splats, for a device that has the tree itself: in the order and in the places of the
//! records that [`splats::pack`] writes.

use crate::abi::SplatId;
use crate::cut::{Cut, SizeMetric, ZeroAreaSet};
use crate::math::camera::View;
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::pack::splats;
use crate::pack::splats::{PackedPart, PackedSplats, SplatPlan, parts_of};
use crate::tree::Model;

/// Why the splats of a cut by this plan are more than what the model has under their numbers; `None` where they are not.
pub fn why_not(plan: &SplatPlan) -> Option<&'static str> {
    if plan.by_level {
        Some("colors by level are the host's; use another --color-by")
    } else if plan.cut_view.is_some() {
        Some("splats of a held cut have sizes of their own")
    } else {
        None
    }
}

/// Writes the numbers of the splats of a cut into the first [`splats::count`] of `out`. `undrawn`: what has no area.
///
/// # Panics
/// When `out` is shorter.
pub fn pack(
    model: &Model,
    undrawn: &ZeroAreaSet,
    (cut, view, plan): (&Cut, &View, &SplatPlan),
    out: &mut [SplatId],
) -> PackedSplats {
    // Then nothing but the number decides where it goes.
    let is_plain = plan.fits_always(model.kind()) && plan.size == SizeMetric::Exact;
    if !is_plain {
        return splats::pack(model, cut, view, plan, out);
    }
    parallel::write(parts_of(cut, plan), out, |part, sink| {
        plain(undrawn, part, sink);
    })
}

fn plain(undrawn: &ZeroAreaSet, part: PackedPart<'_>, sink: &mut RecordSink<'_, SplatId>) {
    match part {
        PackedPart::Nodes(ids) => {
            let drawn = ids.iter().filter(|&&id| !undrawn.has_node(id));
            drawn.for_each(|&id| sink.point(SplatId::node(id)));
        }
        PackedPart::Rows(rows) => {
            for row in rows.iter().filter(|row| !undrawn.has_node(row.node)) {
                for i in (0..row.count).filter(|&i| row.is_seen(i)) {
                    sink.point(SplatId::of_row(row.node, row.count, i));
                }
            }
        }
        PackedPart::Leaves(ids) | PackedPart::Large(ids) => {
            let drawn = ids.iter().filter(|&&id| !undrawn.has_leaf(id));
            drawn.for_each(|&id| sink.point(SplatId::leaf(id)));
        }
    }
}
