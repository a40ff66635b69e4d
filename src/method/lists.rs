//! Draw lists in mapped memory: one set for each frame in flight, grown when a frame needs more.

use super::hybrid::Run;
use super::scene::Scene;
use crate::draw::pack;
use crate::gpu::buffer::{AnyBuffer, Upload};
use crate::gpu::{Error, Gpu};
use crate::tree::Model;
use std::sync::Arc;

/// Mapped draw lists of one slot.
#[derive(Debug)]
pub(super) struct Lists {
    pub(super) splats: Upload,
    pub(super) indices: Upload,
    pub(super) runs: Vec<Run>,
    /// Corners of the triangles that are small on screen, where those are drawn by compute.
    pub(super) small: Upload,
    pub(super) small_runs: Vec<Run>,
}

/// The records that fit a mapped buffer.
pub(super) fn whole_records<T: bytemuck::Pod>(bytes: &mut [u8]) -> &mut [T] {
    let whole = bytes.len() / size_of::<T>() * size_of::<T>();
    bytemuck::cast_slice_mut(&mut bytes[..whole])
}

/// A mapped buffer as `count` records at least, grown if need be.
pub(super) fn records<'a, T: bytemuck::Pod>(
    gpu: &Arc<Gpu>,
    buffer: &'a mut Upload,
    count: usize,
) -> Result<&'a mut [T], Error> {
    reserve(gpu, buffer, (count * size_of::<T>()) as u64)?;
    Ok(whole_records(buffer.bytes_mut()))
}

/// Grows a mapped buffer; its slot is free, so nothing reads it.
pub(super) fn reserve(gpu: &Arc<Gpu>, buffer: &mut Upload, bytes: u64) -> Result<(), Error> {
    if bytes > buffer.bytes() {
        let name = buffer.name().to_owned();
        *buffer = Upload::new(gpu, &name, bytes.max(buffer.bytes() * 3 / 2))?;
    }
    Ok(())
}

/// Writes the corners of the chosen triangles, page by page; those that `is_small` go to a list of their own.
pub(super) fn pack_triangles(
    model: &Model,
    scene: &Scene,
    ids: &[u32],
    lists: &mut Lists,
    is_small: Option<impl Fn(u32) -> bool>,
) {
    lists.runs.clear();
    lists.small_runs.clear();
    let out: &mut [[u32; 3]] = whole_records(lists.indices.bytes_mut());
    let small: &mut [[u32; 3]] = whole_records(lists.small.bytes_mut());
    // Triangles written so far, large and small.
    let mut written = [0, 0];
    let mut done = 0;
    for (index, page) in scene.pages.iter().enumerate() {
        let end = done + ids[done..].partition_point(|&id| id < page.triangles.end);
        let (ids, corners) = (&ids[done..end], page.corners(model));
        let before = written;
        match &is_small {
            Some(is_small) => {
                for &id in ids {
                    let corners = corners[(id - page.triangles.start) as usize];
                    let which = usize::from(is_small(id));
                    let list = if which == 1 { &mut *small } else { &mut *out };
                    list[written[which]] = corners;
                    written[which] += 1;
                }
            }
            None => {
                let out = &mut out[written[0]..written[0] + ids.len()];
                pack::triangles(ids, corners, page.triangles.start, out);
                written[0] += ids.len();
            }
        }
        for (which, runs) in [&mut lists.runs, &mut lists.small_runs]
            .into_iter()
            .enumerate()
        {
            if written[which] > before[which] {
                runs.push(Run {
                    page: index,
                    first: 3 * before[which] as u32,
                    count: 3 * (written[which] - before[which]) as u32,
                });
            }
        }
        done = end;
    }
}
