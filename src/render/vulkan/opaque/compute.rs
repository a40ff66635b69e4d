//! Small primitives by compute: the picture of [`crate::render::vulkan::opaque::triangle_runs`]'s rasterized squares, discs, ellipses and triangles, at a
//! fraction of their cost where they are a few pixels large.
//!
//! A rasterizer sets every primitive up before it draws it, which on a software device takes some 65 to 150 ns whatever
//! its size. Here `small.triangles` and `small.splats` let each leave (depth, number) in the pixels it covers by a 64-bit
//! atomic maximum, and `small.resolve` shades one of them a pixel. Source: Schütz, Kerbl and Wimmer, *Rendering Point
//! Clouds with Compute Shaders and Vertex Order Optimization* (Computer Graphics Forum, 2021). What is large, or reaches
//! the near plane, goes to the rasterizer.

pub(crate) use crate::render::vulkan::storage_ranges::List;

use crate::abi::constants;
use crate::abi::shaders;
use crate::abi::specialization::{ARE_DISCS, LOOKS_FIRST, SIDE_PX};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::{AnyBuffer, Buffer, Usage};
use crate::gpu::frame::{Frame, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Record, Topology};
use crate::gpu::{Error, Gpu};
use crate::pack::Footprint;
use crate::render::compute_limits::{LARGEST_SQUARE_PX, largest_threshold_px};
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use crate::render::vulkan::blended;
use crate::render::vulkan::raster_pass;
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::storage_ranges::Items;
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::{Method, Path, Settings, Shading, SplatKind};
use std::sync::Arc;

/// What decides the pipeline of splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Variant {
    footprint: Footprint,
    /// Where none has a size of its own that of all, rounded up to pixels; else 0.
    side_px: u32,
    /// Those of the frame that a footprint in the plane of the surface asks for.
    flags: u32,
}

impl Variant {
    /// Squares of a pixel.
    pub(crate) const SAMPLES: Self = Self {
        footprint: Footprint::Square,
        side_px: 1,
        flags: 0,
    };

    /// Of splats of one size, pixels, at most [`LARGEST_SQUARE_PX`]; or of sizes of their own; in frames of these flags.
    pub(crate) fn new(footprint: Footprint, one_size_px: Option<f32>, flags: u32) -> Self {
        Self {
            footprint,
            side_px: one_size_px.map_or(0, |px| px.clamp(1.0, LARGEST_SQUARE_PX).ceil() as u32),
            flags: match footprint {
                Footprint::Oriented => flags & constants::FLAG_ORTHOGRAPHIC,
                _ => 0,
            },
        }
    }
}

/// Pipelines and the buffer of the nearest, for one picture size.
#[derive(Debug)]
pub(crate) struct Small {
    gpu: Arc<Gpu>,
    /// Those that were asked for.
    splats: Vec<(Variant, Pipeline)>,
    triangles: Pipeline,
    resolve_splats: Pipeline,
    resolve_triangles: Pipeline,
    keys: Buffer,
    max_binding: u64,
}

/// Bytes of the keys of a picture.
fn key_bytes(targets: &Targets) -> u64 {
    let color = targets.color();
    8 * u64::from(color.width) * u64::from(color.height)
}

/// Whether `settings` want small primitives drawn by compute, and this device can.
///
/// # Errors
/// When they insist on it and it cannot be; the reason is in the error.
pub(crate) fn is_wanted(gpu: &Gpu, settings: &Settings, targets: &Targets) -> Result<bool, Error> {
    if settings.path == Path::Raster {
        return Ok(false);
    }
    let info = gpu.info();
    let color = targets.color();
    let (why, bytes) = match Technique::of(settings) {
        Technique::Opaque if settings.method == Method::Pop => {
            (not_as_opaque(settings), key_bytes(targets))
        }
        Technique::Filtered | Technique::Fuzzy if settings.has_cut() => {
            let bytes = blended::compute::storage_bytes((color.width, color.height));
            (not_as_blended(settings, targets), bytes)
        }
        Technique::Visibility if settings.has_cut() => {
            let bytes = crate::render::vulkan::visibility::compute::storage_bytes((
                color.width,
                color.height,
            ));
            (not_as_visible(settings), bytes)
        }
        _ => (
            Some(
                "it draws blended, filtered and visibility splats of a tree, and what pop does not blend",
            ),
            0,
        ),
    };
    let why = if why.is_some() {
        why
    } else if !info.has_int64_atomics {
        Some("the device has no 64-bit atomics on storage buffers")
    } else if bytes > info.max_storage_range {
        Some("the picture does not fit one storage binding of the device")
    } else {
        None
    };
    match why {
        None => Ok(true),
        Some(why) if settings.path == Path::Compute => Err(Error::Unsupported {
            what: "drawing by compute",
            why: why.into(),
        }),
        Some(_) => Ok(false),
    }
}

/// Why opaque splats are not drawn by compute.
fn not_as_opaque(settings: &Settings) -> Option<&'static str> {
    if !settings.has_headlight() {
        Some("it knows the headlight only, and no colors by level, normal or depth")
    } else if settings.threshold_px <= largest_threshold_px(settings) {
        None
    } else if settings.splat == SplatKind::Ellipse {
        Some("ellipses of this size are cheaper to rasterize; use a threshold of at most 10 pixels")
    } else {
        Some(
            "squares and discs of this size are cheaper to rasterize; use a threshold of at most 6 pixels",
        )
    }
}

/// Why filtered and fuzzy splats are not drawn by compute.
fn not_as_blended(settings: &Settings, targets: &Targets) -> Option<&'static str> {
    if settings.threshold_px > largest_threshold_px(settings) {
        Some("splats of this size are cheaper to rasterize; use a threshold of at most 16 pixels")
    } else if settings.shading == Shading::Deferred {
        Some("it sums colors, not normals; leave --shading out")
    } else if targets.normal().is_some() {
        Some("it sums colors, not normals; leave --normals out")
    } else if settings.color_by.is_data() {
        Some("it knows no colors by level, normal or depth")
    } else if settings.sums.is_some() {
        Some("its sums are numbers of fixed point; leave --sums out")
    } else {
        None
    }
}

/// Why visibility splats are not drawn by compute.
fn not_as_visible(settings: &Settings) -> Option<&'static str> {
    (settings.threshold_px > largest_threshold_px(settings)).then_some(
        "splats of this size are cheaper to rasterize; use a threshold of at most 16 pixels",
    )
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
    pub(crate) fn new(gpu: &Arc<Gpu>, targets: &Targets) -> Result<Self, Error> {
        let normals = targets.normal().is_some();
        let resolve = |name, fragment| {
            Pipeline::new(
                gpu,
                &Description {
                    name,
                    vertex: &shaders::COMPUTE_RESOLVE_VERT,
                    fragment: Some(fragment),
                    constants: &[],
                    record: Record::NOTHING,
                    topology: Topology::Triangles,
                    colors: targets.formats(),
                    depth: Depth::Nearest,
                    is_additive: false,
                },
            )
        };
        Ok(Self {
            gpu: gpu.clone(),
            splats: Vec::new(),
            triangles: Pipeline::compute(
                gpu,
                "small.triangles",
                &shaders::COMPUTE_TRIANGLES_COMP,
                &[],
            )?,
            resolve_splats: resolve(
                "small.resolve splats",
                shaders::COMPUTE_RESOLVE_SPLATS_FRAG.of(normals),
            )?,
            resolve_triangles: resolve(
                "small.resolve triangles",
                shaders::COMPUTE_RESOLVE_TRIANGLES_FRAG.of(normals),
            )?,
            keys: Buffer::new(
                gpu,
                "nearest small primitives",
                Usage::Storage,
                key_bytes(targets),
            )?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Makes the pipeline of splats of a variant, outside of the frame.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(crate) fn ensure(&mut self, variant: Variant) -> Result<(), Error> {
        if self.splats.iter().any(|made| made.0 == variant) {
            return Ok(());
        }
        let gpu = &self.gpu;
        let looks_first = !gpu.info().is_cpu();
        let of_one_size = |name, are_discs| {
            let constants = [
                ARE_DISCS.is(are_discs),
                LOOKS_FIRST.is(looks_first),
                SIDE_PX.is(variant.side_px),
            ];
            Pipeline::compute(gpu, name, &shaders::COMPUTE_SPLATS_COMP, &constants)
        };
        let pipeline = match variant.footprint {
            Footprint::Square => of_one_size("small squares", false)?,
            Footprint::Circle => of_one_size("small discs", true)?,
            Footprint::Oriented => Pipeline::compute_for_flags(
                gpu,
                "small ellipses",
                &shaders::COMPUTE_ELLIPSES_COMP,
                &[LOOKS_FIRST.is(looks_first)],
                variant.flags,
            )?,
        };
        self.splats.push((variant, pipeline));
        Ok(())
    }

    /// Passes small.clear, small.triangles, small.splats and small.resolve.
    /// Keeps what the targets hold where it is nearer; where these passes are the first of the frame, that is nothing.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: List<'_>,
        (context, is_first): (&Context, bool),
        constants: Uniform,
    ) -> Result<(), Error> {
        if list.is_empty() {
            return Ok(());
        }
        let items = list.bound(frame, context, self.max_binding)?;
        let Items {
            splats, triangles, ..
        } = &items;
        let keys = Slice::whole(&self.keys);
        frame.pass("small.clear").fill(
            &[(&self.keys, 8 * screen_bounds::pixels(context.rect_px))],
            0,
        );
        if !triangles.is_empty() {
            let mut pass = frame
                .pass("small.triangles")
                .storage_read(list.corners)
                .storage(&self.keys);
            for page in &list.scene.pages {
                pass = pass.storage_read(&page.vertices);
            }
            pass.compute(|compute| {
                for &((part, uniform, count), vertices) in triangles {
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
            let pipeline = |variant: Variant| {
                let made = self.splats.iter().find(|made| made.0 == variant);
                let Some((_, pipeline)) = made else {
                    unreachable!("ensure made the pipeline")
                };
                pipeline
            };
            frame
                .pass("small.splats")
                .storage_read(list.splats)
                .storage(&self.keys)
                .compute(|compute| {
                    for &(variant, (part, uniform, count)) in splats {
                        compute.bind(pipeline(variant), &[constants, uniform], &[part, keys]);
                        compute.items(count);
                    }
                });
        }
        let keys = (&self.keys as _, keys);
        self.resolve(
            frame,
            targets,
            &list,
            (&items, keys),
            (context, is_first),
            constants,
        );
        Ok(())
    }

    /// Pass small.resolve: shades what each pixel kept.
    fn resolve(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        list: &List<'_>,
        (items, (buffer, keys)): (&Items<'_>, (&dyn AnyBuffer, Slice<'_>)),
        (context, is_first): (&Context, bool),
        constants: Uniform,
    ) {
        let mut pass = targets
            .attach_after(frame.pass("small.resolve"), context, is_first)
            .fragment_storage(list.splats)
            .fragment_storage(list.corners)
            .fragment_storage(buffer);
        for page in &list.scene.pages {
            pass = pass.fragment_storage(&page.vertices);
        }
        pass.draw_whole(|draw| {
            for &((part, uniform, _), vertices) in &items.triangles {
                draw.bind_storage(
                    &self.resolve_triangles,
                    &[constants, uniform],
                    &[],
                    &[part, vertices, keys],
                );
                raster_pass::cover(draw, list.areas);
            }
            for &(part, uniform, _) in &items.all {
                draw.bind_storage(
                    &self.resolve_splats,
                    &[constants, uniform],
                    &[],
                    &[part, keys],
                );
                raster_pass::cover(draw, list.areas);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Blend;

    #[test]
    fn compute_ends_where_its_splats_are_cheaper_to_rasterize() {
        let of = |splat, blend| Settings {
            splat,
            blend: Some(blend),
            ..Settings::default()
        };
        for (settings, largest) in [
            (of(SplatKind::Square, Blend::Opaque), 6.0),
            (of(SplatKind::Disc, Blend::Opaque), 6.0),
            (of(SplatKind::Ellipse, Blend::Opaque), 10.0),
            (of(SplatKind::Square, Blend::TwoPass), 16.0),
            (of(SplatKind::Filtered, Blend::Opaque), 16.0),
            (of(SplatKind::Visibility, Blend::Opaque), 16.0),
        ] {
            assert_eq!(largest_threshold_px(&settings), largest, "{settings:?}");
        }
        let pixels = |threshold_px, splat| Settings {
            threshold_px,
            ..of(splat, Blend::Opaque)
        };
        for (splat, largest) in [(SplatKind::Square, 6.0), (SplatKind::Ellipse, 10.0)] {
            assert_eq!(not_as_opaque(&pixels(largest, splat)), None);
            assert!(not_as_opaque(&pixels(largest + 0.01, splat)).is_some());
        }
    }
}
