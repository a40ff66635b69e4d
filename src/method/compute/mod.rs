//! Small primitives by compute: the picture of [`super::hybrid`]'s rasterized squares and triangles, at a fraction of
//! their cost where they are a few pixels large.
//!
//! A rasterizer sets every primitive up before it draws it, which on a software device takes some 65 to 150 ns whatever
//! its size. Here `small.triangles` and `small.splats` let each leave (depth, number) in the pixels it covers by a 64-bit
//! atomic maximum, and `small.resolve` shades one of them a pixel. Source: Schütz, Kerbl and Wimmer, *Rendering Point
//! Clouds with Compute Shaders and Vertex Order Optimization* (Computer Graphics Forum, 2021). What is large, or reaches
//! the near plane, goes to the rasterizer.

use super::hybrid::Run;
use super::scene::Scene;
use super::targets::{Context, Targets};
use super::triangles::targets;
use super::{Method, Path, Settings, SplatKind};
use crate::abi::{ListConstants, Splat, Vertex, shaders};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::{AnyBuffer, Buffer, Upload, Usage};
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Record, Topology};
use crate::gpu::{Error, Gpu};
use crate::tree::Model;
use std::sync::Arc;

/// Largest side of a square that is drawn this way, pixels: above it a rasterizer fills faster than atomics do.
pub(crate) const LARGEST_SQUARE_PX: f32 = 6.0;
/// Largest bounding circle of a triangle that is drawn this way, pixels.
pub(crate) const LARGEST_TRIANGLE_PX: f32 = 8.0;

const NOTHING: Record = Record {
    stride: 0,
    attributes: &[],
};

/// Pipelines and the buffer of the nearest, for one picture size.
#[derive(Debug)]
pub(crate) struct Small {
    splats: Pipeline,
    triangles: Pipeline,
    resolve_splats: Pipeline,
    resolve_triangles: Pipeline,
    keys: Buffer,
    max_binding: u64,
}

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct List<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) corners: &'a Upload,
    pub(crate) runs: &'a [Run],
    pub(crate) splats: &'a Upload,
    pub(crate) splat_count: u32,
}

/// Items of a list that fit one binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    first: u32,
    count: u32,
    /// First byte of the binding.
    offset: u64,
    /// Items in the binding before the first.
    begin: u32,
}

/// The items `first .. first + count` in parts that fit bindings of `max_binding` bytes. Three alignments hold whole
/// records of 12 and of 24 bytes.
fn parts(first: u32, count: u32, record: u64, max_binding: u64) -> impl Iterator<Item = Part> {
    let step = 3 * Slice::ALIGNMENT / record;
    let most = (max_binding / (3 * Slice::ALIGNMENT)).saturating_sub(1) * step;
    let most = most.clamp(1, u64::from(u32::MAX / 2)) as u32;
    let end = first + count;
    (first..end).step_by(most as usize).map(move |first| {
        let aligned = u64::from(first) / step * step;
        Part {
            first,
            count: most.min(end - first),
            offset: aligned * record,
            begin: (u64::from(first) - aligned) as u32,
        }
    })
}

impl Part {
    fn slice<'a>(&self, buffer: &'a dyn AnyBuffer, record: u64) -> Slice<'a> {
        let bytes = u64::from(self.begin + self.count) * record;
        Slice::new(buffer, self.offset, bytes)
    }
}

/// A part with its uniform block, ready to be bound.
type Bound<'a> = (Slice<'a>, Uniform, u32);

/// Bytes of the keys of a picture.
fn key_bytes(targets: &Targets) -> u64 {
    let color = targets.color();
    8 * u64::from(color.width) * u64::from(color.height)
}

/// Whether `settings` want small primitives drawn by compute, and this device can.
///
/// # Errors
/// When they insist on it and it cannot be; the reason is in the error.
pub(crate) fn is_wanted(
    gpu: &Gpu,
    model: &Model,
    settings: &Settings,
    targets: &Targets,
) -> Result<bool, Error> {
    let info = gpu.info();
    let why = if settings.path == Path::Raster {
        return Ok(false);
    } else if settings.method != Method::Pop || settings.splat != SplatKind::Square {
        "it draws the squares of pop only"
    } else if model.triangles.is_empty() {
        "the squares of a cloud have sizes of their own, which may be large"
    } else if settings.threshold_px > LARGEST_SQUARE_PX {
        "squares of this size are cheaper to rasterize; use a threshold of at most 6 pixels"
    } else if !info.has_int64_atomics {
        "the device has no 64-bit atomics on storage buffers"
    } else if key_bytes(targets) > info.max_storage_range {
        "the picture does not fit one storage binding of the device"
    } else {
        return Ok(true);
    };
    if settings.path == Path::Compute {
        return Err(Error::Unsupported {
            what: "drawing by compute",
            why: why.into(),
        });
    }
    Ok(false)
}

impl Small {
    /// Whether the triangles of a scene can be drawn so: a page of vertices must fit one binding.
    pub(crate) fn takes_triangles(gpu: &Gpu, scene: &Scene) -> bool {
        let limit = gpu.info().max_storage_range;
        scene
            .pages
            .iter()
            .all(|page| page.vertices.bytes() <= limit)
    }

    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(gpu: &Arc<Gpu>, size: &Targets, normals: bool) -> Result<Self, Error> {
        let resolve = |name, fragment| {
            Pipeline::new(
                gpu,
                &Description {
                    name,
                    vertex: &shaders::COMPUTE_RESOLVE_VERT,
                    fragment: Some(fragment),
                    constants: &[normals],
                    record: NOTHING,
                    topology: Topology::Triangles,
                    colors: targets(normals),
                    depth: Depth::Nearest,
                    is_additive: false,
                },
            )
        };
        Ok(Self {
            splats: Pipeline::compute(gpu, "small.splats", &shaders::COMPUTE_SPLATS_COMP)?,
            triangles: Pipeline::compute(gpu, "small.triangles", &shaders::COMPUTE_TRIANGLES_COMP)?,
            resolve_splats: resolve(
                "small.resolve splats",
                &shaders::COMPUTE_RESOLVE_SPLATS_FRAG,
            )?,
            resolve_triangles: resolve(
                "small.resolve triangles",
                &shaders::COMPUTE_RESOLVE_TRIANGLES_FRAG,
            )?,
            keys: Buffer::new(
                gpu,
                "nearest small primitives",
                Usage::Storage,
                key_bytes(size),
            )?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    fn bound<'a>(
        &self,
        frame: &mut Frame<'_>,
        buffer: &'a dyn AnyBuffer,
        record: u64,
        (first, count): (u32, u32),
        context: &Context,
        out: &mut Vec<Bound<'a>>,
    ) -> Result<(), Error> {
        for part in parts(first, count, record, self.max_binding) {
            let constants = frame.uniform(&ListConstants {
                size_px: [context.width, context.height],
                guard_px: context.guard_px as f32,
                first: part.first,
                count: part.count,
                begin: part.begin,
                // Clockwise is positive. Fronts turn counter-clockwise unless the camera mirrors.
                dropped_sign: match (context.cull_back, context.is_mirrored) {
                    (false, _) => 0,
                    (true, false) => 1,
                    (true, true) => -1,
                },
            })?;
            out.push((part.slice(buffer, record), constants, part.count));
        }
        Ok(())
    }

    /// Passes small.clear, small.triangles, small.splats and small.resolve. Keeps what the targets hold where it is
    /// nearer.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: List<'_>,
        context: &Context,
        constants: Uniform,
    ) -> Result<(), Error> {
        if list.runs.is_empty() && list.splat_count == 0 {
            return Ok(());
        }
        let mut splats = Vec::new();
        self.bound(
            frame,
            list.splats,
            size_of::<Splat>() as u64,
            (0, list.splat_count),
            context,
            &mut splats,
        )?;
        // Each with the vertices of its page.
        let mut triangles = Vec::new();
        for run in list.runs {
            let mut own = Vec::new();
            let range = (run.first / 3, run.count / 3);
            self.bound(frame, list.corners, 12, range, context, &mut own)?;
            let vertices = Slice::whole(&list.scene.pages[run.page].vertices);
            triangles.extend(own.into_iter().map(|bound| (bound, vertices)));
        }
        let keys = Slice::whole(&self.keys);
        frame.pass("small.clear").fill(&self.keys, 0);
        if !triangles.is_empty() {
            let mut pass = frame
                .pass("small.triangles")
                .storage_read(list.corners)
                .storage(&self.keys);
            for page in &list.scene.pages {
                pass = pass.storage_read(&page.vertices);
            }
            pass.compute(|compute| {
                for &((part, uniform, count), vertices) in &triangles {
                    compute.bind(
                        &self.triangles,
                        &[constants, uniform],
                        &[part, vertices, keys],
                    );
                    compute.items(count);
                }
            });
        }
        if !splats.is_empty() {
            frame
                .pass("small.splats")
                .storage_read(list.splats)
                .storage(&self.keys)
                .compute(|compute| {
                    for &(part, uniform, count) in &splats {
                        compute.bind(&self.splats, &[constants, uniform], &[part, keys]);
                        compute.items(count);
                    }
                });
        }
        let mut pass = targets
            .attach_with(frame.pass("small.resolve"), context, |_| Load::Keep)
            .fragment_storage(list.splats)
            .fragment_storage(list.corners)
            .fragment_storage(&self.keys);
        for page in &list.scene.pages {
            pass = pass.fragment_storage(&page.vertices);
        }
        let picture = [0.0, 0.0, context.width as f32, context.height as f32];
        pass.draw(picture, |draw| {
            draw.cull_back_faces(false, false);
            for &((part, uniform, _), vertices) in &triangles {
                draw.bind_storage(
                    &self.resolve_triangles,
                    &[constants, uniform],
                    &[],
                    &[part, vertices, keys],
                );
                draw.draw(0, 3);
            }
            for &(part, uniform, _) in &splats {
                draw.bind_storage(
                    &self.resolve_splats,
                    &[constants, uniform],
                    &[],
                    &[part, keys],
                );
                draw.draw(0, 3);
            }
        });
        Ok(())
    }
}

const _: () = assert!(
    size_of::<Splat>() == 24 && size_of::<Vertex>() == 20,
    "parts() counts on records that fill three alignments"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_a_list_once_in_order_and_fit_their_bindings() {
        for (first, count, record, limit) in [
            (0, 0, 24, 4096),
            (0, 1, 24, 4096),
            (5, 400, 24, 4096),
            (77, 1000, 12, 4096),
            (64, 64, 12, 1 << 27),
        ] {
            let parts: Vec<Part> = parts(first, count, record, limit).collect();
            let numbers: Vec<u32> = parts
                .iter()
                .flat_map(|p| p.first..p.first + p.count)
                .collect();
            assert_eq!(numbers, (first..first + count).collect::<Vec<_>>());
            for part in parts {
                assert!(part.offset.is_multiple_of(Slice::ALIGNMENT));
                assert_eq!(
                    part.offset + u64::from(part.begin) * record,
                    u64::from(part.first) * record
                );
                assert!(u64::from(part.begin + part.count) * record <= limit);
            }
        }
    }
}
