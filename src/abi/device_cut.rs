//! Records that the passes read and write that choose a cut on the device.

use super::generated;
use bytemuck::{Pod, Zeroable};

/// Constants of the passes that choose a cut on the device: the uniform block of `shaders/common/cut.glsl`. Lengths are in a
/// unit of the cut's own, `unit` of them in a model unit, from `reference`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CutConstants {
    /// The sides of the view volume: inward unit normals, and what is added to a product with them.
    pub sides: [[f32; 4]; 4],
    /// The view direction, likewise.
    pub forward: [f32; 4],
    /// To the right in the picture, likewise.
    pub right: [f32; 4],
    /// Up in the picture.
    pub up: [f32; 4],
    /// Third row of the matrix from model to view space.
    pub view_row: [f32; 4],
    /// Pixels of a tangent (perspective) or of a unit.
    pub focal: [f32; 2],
    /// The middle of the picture, pixels.
    pub middle: [f32; 2],
    /// Where lengths start, model space.
    pub reference: [f32; 3],
    /// See above.
    pub unit: f32,
    /// From the scene to the viewer, a unit vector (orthographic).
    pub backward: [f32; 3],
    /// Absolute error of a distance to a plane.
    pub plane_error: f32,
    /// Distance of the near plane.
    pub near: f32,
    /// Distance of the far plane.
    pub far: f32,
    /// 2 f / threshold: a size in pixels over the threshold is a radius times this, over a distance.
    pub ratio: f32,
    /// Square of `ratio`.
    pub ratio_squared: f32,
    /// Of rows of splats: the threshold over 2 f.
    pub row_ball: f32,
    /// What the square of a count is limited by, see `cut::strip`.
    pub row_limit: f32,
    /// Widest strip over the ball that a splat stands for.
    pub row_width: f32,
    /// Square of `row_width`.
    pub row_width_squared: f32,
    /// First node of the lowest level.
    pub lowest_nodes: u32,
    /// First node of the level above it.
    pub low_nodes: u32,
    /// Leaves below one of these, on average.
    pub low_leaves: u32,
    /// Most splats in a row.
    pub most_in_row: u32,
    /// What the root inherits: 1, nothing is dropped by the view volume; 2, nothing by facing.
    pub start: u32,
    /// 0 for an orthographic view.
    pub is_perspective: u32,
    /// Records that the list of splats has room for.
    pub most_splats: u32,
    /// Triangles that the list of indices has room for.
    pub most_triangles: u32,
    /// Pixels that a place in the picture may be off, times the distance (perspective) or alone.
    pub place_error: f32,
    /// Pixels by which a device may place a splat elsewhere by rounding.
    pub snap: f32,
    /// The larger of the two focal lengths.
    pub focal_px: f32,
    /// 1 where splats are one pixel, drawn where their balls contain its center.
    pub are_samples: u32,
    /// 2 f / the largest triangle that compute draws, pixels; 0 where the rasterizer draws all.
    pub compute_ratio: f32,
    /// 1 where leaves are points, which are splats whatever their size.
    pub are_points: u32,
    /// 1 where large triangles are splats too.
    pub draws_large_leaves: u32,
    /// 1 where splats lie in the plane of the surface, with a radius of their own.
    pub are_oriented: u32,
    /// Capacity of each list of splats, items.
    pub room: u32,
    /// 2 f, pixels of a tangent (perspective) or of a unit of the cut's own.
    pub twice_focal_px: f32,
    /// Side of a splat without a size of its own, pixels.
    pub threshold_px: f32,
    /// Largest side of a leaf that is drawn as a point, pixels, without what it is widened by.
    pub largest_px: f32,
    /// 1 where large triangles are named at the end of the splats, as some may become filtered splats.
    pub names_triangles: u32,
    /// 1 where all of those do.
    pub are_pieces: u32,
    /// 2 f, pixels of a tangent (perspective) or of a unit of view space.
    pub view_focal_px: f32,
    /// Length in view space of a unit vector in model space.
    pub view_scale: f32,
}

same_layout!(
    CutConstants,
    cut_constants,
    sides = SIDES,
    forward = FORWARD,
    right = RIGHT,
    up = UP,
    view_row = VIEW_ROW,
    focal = FOCAL,
    middle = MIDDLE,
    reference = REFERENCE,
    unit = UNIT,
    backward = BACKWARD,
    plane_error = PLANE_ERROR,
    near = NEAR,
    far = FAR,
    ratio = RATIO,
    ratio_squared = RATIO_SQUARED,
    row_ball = ROW_BALL,
    row_limit = ROW_LIMIT,
    row_width = ROW_WIDTH,
    row_width_squared = ROW_WIDTH_SQUARED,
    lowest_nodes = LOWEST_NODES,
    low_nodes = LOW_NODES,
    low_leaves = LOW_LEAVES,
    most_in_row = MOST_IN_ROW,
    start = START,
    is_perspective = IS_PERSPECTIVE,
    most_splats = MOST_SPLATS,
    most_triangles = MOST_TRIANGLES,
    place_error = PLACE_ERROR,
    snap = SNAP,
    focal_px = FOCAL_PX,
    are_samples = ARE_SAMPLES,
    compute_ratio = COMPUTE_RATIO,
    are_points = ARE_POINTS,
    draws_large_leaves = DRAWS_LARGE_LEAVES,
    are_oriented = ARE_ORIENTED,
    room = ROOM,
    twice_focal_px = TWICE_FOCAL_PX,
    threshold_px = THRESHOLD_PX,
    largest_px = LARGEST_PX,
    names_triangles = NAMES_TRIANGLES,
    are_pieces = ARE_PIECES,
    view_focal_px = VIEW_FOCAL_PX,
    view_scale = VIEW_SCALE,
);

/// What these passes write beside the lists: the storage block `Counters` there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CutCounters {
    /// A draw of all splats that are points: number of vertices and instances, first vertex and instance.
    pub splats: [u32; 4],
    /// A draw of those that may be too large for points, an instance each.
    pub quads: [u32; 4],
    /// A draw of all triangles: number of indices and instances, first index, what is added to each, first instance.
    pub triangles: [u32; 5],
    /// A dispatch over the sibling groups of a level: workgroups.
    pub workgroups: [u32; 3],
    /// Sibling groups of the level.
    pub groups: u32,
    /// Of the next one, so far.
    pub opened: u32,
    /// Nodes and leaves that were looked at.
    pub visited: u32,
    /// Of those, dropped because outside of the view volume.
    pub outside: u32,
    /// Of those, dropped because facing away.
    pub facing_away: u32,
    /// Triangles that compute draws.
    pub small: u32,
    /// A dispatch over the points: workgroups.
    pub splat_groups: [u32; 3],
    /// A dispatch over the quads.
    pub quad_groups: [u32; 3],
    /// A dispatch over the small triangles.
    pub small_groups: [u32; 3],
    /// Large triangles that may become filtered splats.
    pub pieces: PieceCounters,
}

/// Counts of the large triangles of a cut, and what they become.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PieceCounters {
    /// Number of them.
    pub named: u32,
    /// Number of those that are small on the screen.
    pub small: u32,
    /// A dispatch over all of them.
    pub groups: [u32; 3],
    /// Pieces of those up to the limit, and of the others.
    pub pieces: [u32; 2],
    /// 1 where the latter are too many to be counted.
    pub are_too_many: u32,
    /// Largest that become splats, pixels.
    pub taken_px: f32,
    /// Largest that become several, pixels.
    pub halved_px: f32,
}

const _: () = {
    use generated::layout::counters as block;
    assert!(
        std::mem::offset_of!(CutCounters, splats) == block::SPLATS
            && std::mem::offset_of!(CutCounters, quads) == block::QUAD_VERTICES
            && std::mem::offset_of!(CutCounters, triangles) == block::INDICES
            && std::mem::offset_of!(CutCounters, workgroups) == block::GROUPS_X
            && std::mem::offset_of!(CutCounters, groups) == block::GROUPS
            && std::mem::offset_of!(CutCounters, opened) == block::OPENED
            && std::mem::offset_of!(CutCounters, visited) == block::VISITED
            && std::mem::offset_of!(CutCounters, outside) == block::OUTSIDE
            && std::mem::offset_of!(CutCounters, facing_away) == block::FACING_AWAY
            && std::mem::offset_of!(CutCounters, small) == block::SMALL
            && std::mem::offset_of!(CutCounters, splat_groups) == block::SPLAT_GROUPS
            && std::mem::offset_of!(CutCounters, quad_groups) == block::QUAD_GROUPS
            && std::mem::offset_of!(CutCounters, small_groups) == block::SMALL_GROUPS
            && std::mem::offset_of!(CutCounters, pieces.named) == block::NAMED
            && std::mem::offset_of!(CutCounters, pieces.small) == block::NAMED_SMALL
            && std::mem::offset_of!(CutCounters, pieces.groups) == block::NAMED_GROUPS
            && std::mem::offset_of!(CutCounters, pieces.pieces) == block::PIECES_WITHIN
            && std::mem::offset_of!(CutCounters, pieces.are_too_many) == block::ARE_TOO_MANY
            && std::mem::offset_of!(CutCounters, pieces.taken_px) == block::TAKEN_PX
            && std::mem::offset_of!(CutCounters, pieces.halved_px) == block::HALVED_PX
            && size_of::<CutCounters>() == block::END,
        "abi::CutCounters is not what the shaders have"
    );
    // `lists/quads.comp` reads the number of quads as a word.
    assert!(
        std::mem::offset_of!(CutCounters, quads) + 4
            == 4 * generated::constants::QUADS_WORD as usize
    );
};
