//! Numbers of filtered splats, for a device that makes the splats itself.

use crate::abi::SplatId;
use crate::cut::Cut;
use crate::math::camera::View;
use crate::pack::filtered::triangle_subdivision::{cuts, diameter_px};
use crate::pack::filtered::{FilteredPart, FilteredShade, FirstLarge, parts_of};
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::tree::Model;

/// Writes the numbers of the splats of a cut in the order of [`splats`](crate::pack::filtered::splats), also of those that
/// cover nothing, and returns how many they are.
///
/// # Panics
/// When `out` is shorter than [`splat_count`](crate::pack::filtered::splat_count).
pub fn ids(
    model: &Model,
    cut: &Cut,
    first_large: FirstLarge,
    view: &View,
    shade: &FilteredShade,
    out: &mut [SplatId],
) -> usize {
    let parts = parts_of(model, cut, first_large, view, shade);
    let is_surface = model.kind().is_surface();
    let written = parallel::write(parts, out, |part, sink| match part {
        FilteredPart::Nodes(ids) => ids.iter().for_each(|&id| sink.point(SplatId::node(id))),
        FilteredPart::Rows(rows) => {
            for row in rows {
                (0..row.count).for_each(|i| sink.point(SplatId::of_row(row.node, row.count, i)));
            }
        }
        FilteredPart::Large(ids) if is_surface => {
            for &leaf in ids {
                let px = diameter_px(model, leaf, view);
                pieces_of(leaf, (px, first_large.halved_px), shade, sink);
            }
        }
        FilteredPart::Leaves(ids) | FilteredPart::Large(ids) => {
            ids.iter().for_each(|&id| sink.point(SplatId::leaf(id)));
        }
    });
    written.points
}

/// Writes the numbers of the pieces of a triangle, whose diameter and whose largest one that is drawn in pieces are given.
fn pieces_of(
    leaf: u32,
    (diameter_px, halved_px): (f32, f32),
    shade: &FilteredShade,
    sink: &mut RecordSink<'_, SplatId>,
) {
    let is_own = diameter_px > halved_px.max(shade.side_px);
    let cuts = cuts(diameter_px, shade, halved_px).min(SplatId::MOST_CUTS);
    let own = match is_own {
        true => SplatId::OF_OWN_SIZE,
        false => 0,
    };
    for piece in 0..1 << (2 * cuts) {
        let SplatId { id, part } = SplatId::of_piece(leaf, cuts, piece);
        sink.point(SplatId {
            id,
            part: part | own,
        });
    }
}
