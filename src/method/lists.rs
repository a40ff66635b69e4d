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

/// Writes the corners of the chosen triangles, page by page.
pub(super) fn pack_triangles(model: &Model, scene: &Scene, ids: &[u32], lists: &mut Lists) {
    lists.runs.clear();
    let out: &mut [[u32; 3]] = whole_records(lists.indices.bytes_mut());
    let mut done = 0;
    for (index, page) in scene.pages.iter().enumerate() {
        let end = done + ids[done..].partition_point(|&id| id < page.triangles.end);
        if end > done {
            pack::triangles(
                &ids[done..end],
                page.corners(model),
                page.triangles.start,
                &mut out[done..end],
            );
            lists.runs.push(Run {
                page: index,
                first: 3 * done as u32,
                count: 3 * (end - done) as u32,
            });
            done = end;
        }
    }
}
