//! The triangles of a cut, written page by page.

use crate::math::camera::View;
use crate::pack::triangles;
use crate::render::model_facts::FactedModel;
use crate::render::vulkan::draw_lists::{DrawLists, WrittenTriangles, whole_records};
use crate::render::vulkan::opaque::triangle_runs::PageRange;
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::Model;
use prefetch_index::prefetch_index;

/// Writes what `of` has of the chosen triangles of a model, page by page, after those that were written so far; those that
/// `is_small` go to a list of their own.
pub(super) fn write<T: bytemuck::Pod + Send>(
    part: FactedModel<'_>,
    scene: &DeviceScene,
    ids: &[u32],
    (lists, so_far, is_small): (
        &mut DrawLists,
        &mut WrittenTriangles,
        Option<impl Fn(u32) -> bool + Sync>,
    ),
    (of, ahead): (
        impl Fn(&[[u32; 3]], u32, u32) -> T + Sync,
        impl Fn(&[[u32; 3]], u32) + Sync,
    ),
) {
    let model = part.model;
    let out: &mut [T] = whole_records(lists.indices.bytes_mut());
    let small: &mut [T] = whole_records(lists.small.bytes_mut());
    // Large and small.
    let mut written = [so_far.large, so_far.small];
    let mut done = 0;
    let (first_page, pages) = scene.pages_of(part);
    // Vertices of a page of a paged file lie among those of others.
    let pooled = scene.pooled(part);
    let first_page = pooled.map_or(first_page, |(index, _)| index);
    let base = pooled.map_or(0, |(_, first)| first);
    let whole = [(0..u32::MAX, &*model.triangles)];
    let own = pages
        .iter()
        .map(|page| (page.triangles.clone(), page.corners(model)));
    let all = whole.into_iter().filter(|_| pooled.is_some()).chain(own);
    for (index, (range, corners)) in all.enumerate() {
        let end = done + ids[done..].partition_point(|&id| id < range.end);
        let ids = &ids[done..end];
        let first = range.start;
        let of = |id| of(corners, id - first, base);
        let before = written;
        match &is_small {
            Some(is_small) => {
                let lists = [&mut out[written[0]..], &mut small[written[1]..]];
                let is_large = |id| !is_small(id);
                let prefetch = |id| {
                    ahead(corners, id - first);
                    prefetch_index(&*model.tree.leaves, id as usize);
                };
                let found = triangles::split_triangles(ids, of, (is_large, prefetch), lists);
                written = [0, 1].map(|i| written[i] + found[i]);
            }
            None => {
                triangles::triangles(ids, of, &mut out[written[0]..]);
                written[0] += ids.len();
            }
        }
        for (which, runs) in [&mut lists.runs, &mut lists.small_runs]
            .into_iter()
            .enumerate()
        {
            if written[which] > before[which] {
                let run = PageRange {
                    page: first_page + index,
                    first: 3 * before[which] as u32,
                    count: 3 * (written[which] - before[which]) as u32,
                };
                match runs.last_mut() {
                    // Of the same buffer, one behind the other: one run.
                    Some(last) if last.page == run.page && last.first + last.count == run.first => {
                        last.count += run.count;
                    }
                    _ => runs.push(run),
                }
            }
        }
        done = end;
    }
    [so_far.large, so_far.small] = written;
}

/// Tells whether a leaf's bounding sphere is wholly in front of the near plane and at most `most_px` pixels wide.
pub(super) fn are_small_on_screen<'a>(
    model: &'a Model,
    view: &View,
    most_px: f32,
) -> impl Fn(u32) -> bool + use<'a> {
    let row = view.view_from_model.row(2);
    let (near, is_perspective) = (view.near, view.is_perspective);
    // In view space; the bound of the size is that of the sphere's nearest point.
    let ratio = 2.0 * view.focal_px() * view.model_scale / most_px;
    let scale = view.model_scale;
    move |leaf| {
        let sphere = &model.tree.leaves[leaf as usize];
        let nearest = -row.dot(sphere.center.extend(1.0)) - sphere.radius * scale;
        nearest > near && ratio * sphere.radius <= if is_perspective { nearest } else { 1.0 }
    }
}
