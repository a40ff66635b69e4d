//! The cut of `pop` on the device: the tree lies there, and so do the draw lists, which no one reads back.
//!
//! `cut.tree` goes down level by level ([`crate::cut::CutSelector`] does the same on the host): an invocation a node, a queue
//! of sibling groups a level, and each level tells how many workgroups the next one has. What is small is written to the
//! list of splats at once. `cut.leaves` writes the others, and the corners of triangles: from the start of their list those of
//! a few pixels, from its end the others. `cut.close` counts. The rasterizer or compute
//! ([`crate::render::vulkan::opaque::compute`]) draws the lists by arguments that the passes left beside them. Related: Schütz, Kerbl and Wimmer, *Rendering Point Clouds with Compute Shaders and
//! Vertex Order Optimization* (2021), where nodes are chosen on the device too.
//!
//! It chooses what the host chooses, by the same operations in the same order; but for triangles that single precision
//! takes for edge-on, which stay. Room is for the worst case, so that nothing is ever lost. What is hidden is not looked for,
//! and lists are in no order: of two equal depths another may win.

use crate::abi::{CutConstants, CutCounters, Splat, shaders};
use crate::cut;
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer, ReadbackBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::render::compute_limits::LARGEST_TRIANGLE_PX;
use crate::render::vulkan::device_tree;
use crate::render::vulkan::device_tree::DeviceTree;
use crate::render::vulkan::opaque::compute::ChosenLists;
use crate::render::vulkan::opaque::hardware::OpaqueSplats;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::tree::Model;
use std::sync::Arc;

/// The lists of a cut of a scene's tree.
#[derive(Debug)]
pub(crate) struct DeviceCut {
    scene: u64,
    levels: usize,
    most_splats: u32,
    most_triangles: u32,
    subpixel_bits: u32,
    /// Sibling groups of a level and of the next one, in turn.
    queues: [DeviceBuffer; 2],
    splats: DeviceBuffer,
    indices: DeviceBuffer,
    counters: DeviceBuffer,
    start: ShaderPipeline,
    next: ShaderPipeline,
    close: ShaderPipeline,
    of_nodes: ShaderPipeline,
    of_leaves: ShaderPipeline,
    /// What the frame of each slot counted.
    read: Vec<ReadbackBuffer>,
}

/// Room of the lists for copies that fill up the workgroups of a dispatch: 64 invocations each, and one workgroup less than there
/// are rows of them, which 2^31 records have 512 of.
const SPARE_RECORDS: u64 = 512 * 64;

/// Bytes that a list must be smaller than the largest binding, so that it is bound in one part: two alignments of records, of 6 KiB
/// at most.
const ALIGNMENT_ROOM: u64 = 1 << 14;

/// Number of bytes of so many records, of one at least.
fn bytes_of<T>(count: usize) -> u64 {
    (count.max(1) * size_of::<T>()) as u64
}

impl DeviceCut {
    /// Tells whether its lists have room for cuts of the scene.
    pub(crate) fn is_of(&self, scene: &DeviceScene) -> bool {
        self.scene == scene.id()
    }

    /// Makes room for the largest cut there is of a tree. `slots`: frames in flight.
    ///
    /// # Errors
    /// When it does not fit, or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        on_device: &DeviceTree,
        (model, scene): (&Model, &DeviceScene),
        slots: usize,
    ) -> Result<Self, Error> {
        let tree = &model.tree;
        let most_splats = cut::most_splats(model);
        let most_triangles = model.triangles.len();
        let groups = (0..tree.level_count()).map(|level| tree.level(level).len());
        let queue = bytes_of::<[u32; 2]>(groups.max().unwrap_or(0));
        let splats = (most_splats + SPARE_RECORDS) * size_of::<Splat>() as u64;
        let indices = bytes_of::<[u32; 3]>(most_triangles + SPARE_RECORDS as usize);
        // Compute binds a list as a whole, and leaves room for alignment.
        let with_room = |bytes| bytes + ALIGNMENT_ROOM;
        device_tree::fits_bindings(gpu, [queue, with_room(splats), with_room(indices)])?;
        device_tree::fits_memory(gpu, on_device.bytes() + 2 * queue + splats + indices)?;
        let pipeline = |name, shader| ShaderPipeline::compute(gpu, name, shader, &[]);
        let counters = bytes_of::<CutCounters>(1);
        let list = |name, bytes| DeviceBuffer::new(gpu, name, BufferUsage::List, bytes);
        Ok(Self {
            scene: scene.id(),
            levels: if tree.nodes.is_empty() {
                0
            } else {
                tree.level_count()
            },
            most_splats: most_splats as u32,
            most_triangles: most_triangles as u32,
            subpixel_bits: gpu.info().subpixel_bits,
            queues: [
                DeviceBuffer::new(gpu, "groups of even levels", BufferUsage::Storage, queue)?,
                DeviceBuffer::new(gpu, "groups of odd levels", BufferUsage::Storage, queue)?,
            ],
            splats: list("splats of the device's cut", splats)?,
            indices: list("triangles of the device's cut", indices)?,
            counters: list("counts of the device's cut", counters)?,
            start: pipeline("cut.start", &shaders::CUT_START_COMP)?,
            next: pipeline("cut.next", &shaders::CUT_NEXT_COMP)?,
            close: pipeline("cut.close", &shaders::CUT_CLOSE_COMP)?,
            of_nodes: pipeline("cut.nodes", &shaders::CUT_NODES_COMP)?,
            of_leaves: pipeline("cut.leaves", &shaders::CUT_LEAVES_COMP)?,
            read: (0..slots)
                .map(|slot| {
                    let name = format!("counts of the cut of frame {slot}");
                    ReadbackBuffer::new(gpu, &name, counters)
                })
                .collect::<Result<_, Error>>()?,
        })
    }

    /// What the passes know, of a frame's tester and view, with this threshold. `by_compute`: compute draws what is small.
    pub(crate) fn constants(
        &self,
        tester: &cut::NodeTester,
        view: &View,
        (threshold_px, by_compute): (f32, bool),
    ) -> CutConstants {
        let precision = (view, self.subpixel_bits);
        let usual = tester.constants(precision, self.most_splats, self.most_triangles);
        let compute_ratio = match by_compute {
            true => usual.ratio * threshold_px / LARGEST_TRIANGLE_PX,
            false => 0.0,
        };
        CutConstants {
            compute_ratio,
            ..usual
        }
    }

    /// Passes `cut.tree` and `cut.leaves`: replaces the lists.
    pub(crate) fn choose(
        &self,
        frame: &mut FrameRecorder<'_>,
        (tree, scene): (&DeviceTree, &DeviceScene),
        constants: UniformBlock,
    ) {
        let whole = |buffer| BufferSlice::whole(buffer);
        let counters = whole(&self.counters);
        let workgroups = std::mem::offset_of!(CutCounters, workgroups) as u64;
        frame
            .pass("cut.tree")
            .storage_read(&tree.nodes)
            .storage_read(&tree.attributes)
            .storage(&self.queues[0])
            .storage(&self.queues[1])
            .storage(&self.splats)
            .storage(&self.counters)
            .compute(|compute| {
                compute.bind(
                    &self.start,
                    &[constants],
                    &[counters, whole(&self.queues[0])],
                );
                compute.items(1);
                for level in 0..self.levels {
                    let (from, to) = (&self.queues[level % 2], &self.queues[(level + 1) % 2]);
                    compute.after();
                    compute.bind(
                        &self.of_nodes,
                        &[constants],
                        &[
                            counters,
                            whole(from),
                            whole(&self.splats),
                            whole(&tree.nodes),
                            whole(&tree.attributes),
                            whole(to),
                        ],
                    );
                    compute.groups_from(&self.counters, workgroups);
                    compute.after();
                    compute.bind(&self.next, &[constants], &[counters]);
                    compute.items(1);
                }
            });
        let [page] = scene.pages.as_slice() else {
            return;
        };
        let queue = &self.queues[self.levels % 2];
        frame
            .pass("cut.leaves")
            .storage_read(&tree.leaves)
            .storage_read(&tree.corners)
            .storage_read(&page.vertices)
            .storage_read(queue)
            .storage(&self.splats)
            .storage(&self.indices)
            .storage(&self.counters)
            .compute(|compute| {
                compute.after();
                compute.bind(
                    &self.of_leaves,
                    &[constants],
                    &[
                        counters,
                        whole(queue),
                        whole(&self.splats),
                        whole(&tree.leaves),
                        whole(&tree.corners),
                        whole(&page.vertices),
                        whole(&self.indices),
                    ],
                );
                compute.groups_from(&self.counters, workgroups);
                compute.after();
                let lists = [counters, whole(&self.splats), whole(&self.indices)];
                compute.bind(&self.close, &[constants], &lists);
                compute.items(1);
            });
        self.count(frame);
    }

    /// Pass `cut.counts`: reads back, for the time when the frame has finished, what the lists have.
    pub(crate) fn count(&self, frame: &mut FrameRecorder<'_>) {
        if let Some(read) = self.read.get(frame.slot()) {
            frame.read_back_buffer("cut.counts", &self.counters, read);
        }
    }

    /// The lists as compute draws them.
    pub(crate) fn lists(&self) -> ChosenLists<'_> {
        let at = |offset: usize| (&self.counters, offset as u64);
        ChosenLists {
            splats: &self.splats,
            most_splats: self.most_splats + SPARE_RECORDS as u32,
            corners: &self.indices,
            most_triangles: self.most_triangles + SPARE_RECORDS as u32,
            splat_groups: at(std::mem::offset_of!(CutCounters, splat_groups)),
            triangle_groups: at(std::mem::offset_of!(CutCounters, small_groups)),
        }
    }

    /// Pass `opaque.triangles`, which clears the targets: the triangles that compute does not draw.
    pub(crate) fn draw_triangles(
        &self,
        frame: &mut FrameRecorder<'_>,
        triangles: &ShaderPipeline,
        (targets, scene): (&FrameTargets, &DeviceScene),
        context: &Context,
        constants: UniformBlock,
    ) {
        let [page] = scene.pages.as_slice() else {
            return;
        };
        targets
            .attach(frame.pass("opaque.triangles"), context)
            .indices(&self.indices)
            .vertices(&page.vertices)
            .arguments(&self.counters)
            .draw(context.viewport(), |draw| {
                draw.cull_back_faces(context.cull_back, context.is_mirrored);
                draw.bind(triangles, &[constants], &[]);
                draw.indices(&self.indices, 0);
                draw.vertices(&page.vertices, 0);
                let offset = std::mem::offset_of!(CutCounters, triangles) as u64;
                draw.draw_indexed_from(&self.counters, offset);
            });
    }

    /// Pass `opaque.splats`, after the triangles: the splats by the rasterizer.
    pub(crate) fn draw_splats(
        &self,
        frame: &mut FrameRecorder<'_>,
        splats: &OpaqueSplats,
        targets: &FrameTargets,
        context: &Context,
        constants: UniformBlock,
    ) {
        let arguments = (
            &self.counters,
            std::mem::offset_of!(CutCounters, splats) as u64,
        );
        splats.record_from(
            frame,
            targets,
            (&self.splats, arguments),
            context,
            constants,
        );
    }

    /// What the frame of a slot, which has finished, counted.
    pub(crate) fn counts(&mut self, slot: usize) -> CutCounters {
        let read = self.read.get_mut(slot);
        read.map_or_else(CutCounters::default, |read| {
            bytemuck::pod_read_unaligned(&read.bytes()[..size_of::<CutCounters>()])
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::cut::{Cut, CutSelector};
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::gpu::buffer::AnyBuffer as _;
    use crate::gpu::for_tests::{close_in_silence, device};
    use crate::gpu::frame::FrameRing;
    use crate::math::camera::View;
    use crate::pack::splats;
    use crate::progress::SilentProgress;
    use crate::render::Settings;
    use crate::render::cut_key::cut_settings;
    use crate::render::pack_params::splat_plan;
    use crate::render::supported::device_cut_refusal;
    use crate::render::{Culling, CutOn};
    use crate::tree::{self, BuildOptions};

    fn model_of(shape: GeneratedShape, triangles: u64) -> Model {
        let mesh = generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
        tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
    }

    fn orbit(model: &Model, size: (u32, u32), fill: f64, step: u32) -> View {
        let camera = model.orbit_step(size, fill, step, 5);
        camera.view(model.origin).unwrap()
    }

    /// Records in an order of their own.
    fn sorted<T: bytemuck::Pod, const N: usize>(records: &[T]) -> Vec<[u32; N]>
    where
        [u32; N]: bytemuck::Pod,
    {
        let mut words: Vec<[u32; N]> = records.iter().map(|r| bytemuck::cast(*r)).collect();
        words.sort_unstable();
        words
    }

    /// What is in `all` and not in `some`, both sorted; `None` where `some` has what `all` has not.
    fn more<T: Ord + Copy>(all: &[T], some: &[T]) -> Option<Vec<T>> {
        let mut rest = some.iter().peekable();
        let mut extra = Vec::new();
        for item in all {
            if rest.next_if(|next| *next == item).is_none() {
                extra.push(*item);
            }
        }
        rest.next().is_none().then_some(extra)
    }

    /// The lists of the device: splats, corners, counts.
    fn chosen(
        gpu: &Arc<Gpu>,
        (model, scene): (&Model, &DeviceScene),
        view: &View,
        (settings, by_compute): (&Settings, bool),
    ) -> (Vec<Splat>, [Vec<[u32; 3]>; 2], CutCounters) {
        let mut frames = FrameRing::new(gpu, 1, false).unwrap();
        let tree = DeviceTree::new(gpu, model, scene).unwrap();
        let mut cut = DeviceCut::new(gpu, &tree, (model, scene), 1).unwrap();
        let mut splats = ReadbackBuffer::new(gpu, "splats", cut.splats.bytes()).unwrap();
        let mut corners = ReadbackBuffer::new(gpu, "corners", cut.indices.bytes()).unwrap();
        let tester = cut::NodeTester::new(model, view, &cut_settings(settings, model));
        // Twice: the lists of the last frame are replaced.
        for _ in 0..2 {
            let mut frame = frames.begin().unwrap();
            let how = (settings.threshold_px, by_compute);
            let constants = frame.uniform(&cut.constants(&tester, view, how)).unwrap();
            cut.choose(&mut frame, (&tree, scene), constants);
            frame.read_back_buffer("splats", &cut.splats, &splats);
            frame.read_back_buffer("corners", &cut.indices, &corners);
            let ticket = frame.submit().unwrap();
            frames.finish(ticket).unwrap();
        }
        let counts = cut.counts(0);
        assert!(u64::from(counts.splats[0]) <= u64::from(cut.most_splats));
        let splats = bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut splats));
        let corners: Vec<[u32; 3]> =
            bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut corners));
        let first = counts.triangles[2] as usize / 3;
        assert_eq!(
            3 * corners.len() as u32,
            counts.triangles[0] + counts.triangles[2]
        );
        check_copies(&splats, counts.splats[0], counts.splat_groups);
        check_copies(&corners, counts.small, counts.small_groups);
        (
            splats[..counts.splats[0] as usize].to_vec(),
            [
                corners[..counts.small as usize].to_vec(),
                corners[first..].to_vec(),
            ],
            counts,
        )
    }

    /// Compute draws no triangle of more than its limit, and all of clearly less, however they are turned.
    fn check_sizes(view: &View, model: &Model, [small, large]: [&[[u32; 3]]; 2], by_compute: bool) {
        let size_px = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|i| model.vertices[i as usize].position);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let nearest = [a, b, c].map(|at| splats::pixels_of_unit(view, at));
            longest * nearest.into_iter().fold(0.0, f32::max)
        };
        assert!(by_compute || small.is_empty());
        let largest = small.iter().map(size_px).fold(0.0, f32::max);
        assert!(largest <= LARGEST_TRIANGLE_PX * 1.01, "{largest} px");
        // The ball around a triangle is at most twice as wide as its longest side.
        let tiny = |t: &&[u32; 3]| size_px(t) < LARGEST_TRIANGLE_PX / 2.1;
        let tiny = large.iter().filter(tiny).count();
        assert!(!by_compute || tiny == 0, "{tiny} of {}", large.len());
    }

    /// Workgroups of a dispatch hold all records, and what they have room for besides is copies of the first.
    fn check_copies<T: bytemuck::Pod + PartialEq + std::fmt::Debug>(
        records: &[T],
        count: u32,
        [columns, rows, layers]: [u32; 3],
    ) {
        let end = 64 * columns * rows;
        assert!(layers == 1 && end >= count && end - count < 64 * rows);
        for copy in &records[count as usize..end as usize] {
            assert_eq!(*copy, records[0]);
        }
    }

    /// The device chooses the very nodes, rows, leaves and triangles that the host chooses, and writes the same records; what it
    /// has besides is seen edge-on, or beside the picture.
    #[test]
    fn the_device_chooses_what_the_host_chooses() {
        let Some(gpu) = device() else { return };
        // Elsewhere roots and quotients may differ in the last place, and with them single nodes.
        let is_exact = gpu.info().is_cpu();
        let mut kinds = [0; 4];
        for (shape, triangles) in [
            (GeneratedShape::Statue, 60_000),
            (GeneratedShape::Torus, 40_000),
            (GeneratedShape::Sphere, 20_000),
            (GeneratedShape::Square, 2),
            (GeneratedShape::Square, 5_000),
        ] {
            let model = model_of(shape, triangles);
            let scene = DeviceScene::new(&gpu, &model).unwrap();
            let undrawn = cut::ZeroAreaSet::new(&model);
            let mut views: Vec<View> = [(0.1, 0), (0.5, 1), (1.0, 2), (2.5, 3)]
                .map(|(fill, step)| orbit(&model, (320, 200), fill, step))
                .to_vec();
            let mut camera = model.orbit_step((320, 200), 0.5, 4, 5);
            // Without perspective, off the middle of the picture.
            let (wide, near, far) = (0.6 / f64::from(model.orbit_radius), 0.01, 100.0);
            camera.proj = glam::DMat4::from_cols(
                glam::DVec4::X * wide,
                glam::DVec4::Y * wide * 1.2,
                glam::DVec4::Z / (near - far),
                glam::DVec4::new(0.1, -0.05, near / (near - far), 1.0),
            );
            views.push(camera.view(model.origin).unwrap());
            for (index, view) in views.iter().enumerate() {
                for (threshold_px, culling) in [
                    (1.0, Culling::Auto),
                    (2.5, Culling::Off),
                    (7.0, Culling::Auto),
                    (40.0, Culling::On),
                ] {
                    let settings = Settings {
                        threshold_px,
                        culling,
                        cut_on: CutOn::Device,
                        ..Settings::default()
                    };
                    let plan = splat_plan(&settings, 255.0);
                    assert_eq!(device_cut_refusal(&settings, &(&model).into(), &plan), None);
                    let what = format!(
                        "{shape:?} {triangles}, view {index}, {threshold_px} px, {culling:?}"
                    );
                    let mut cut = Cut::default();
                    let mut selector =
                        CutSelector::default().with_subpixel_bits(gpu.info().subpixel_bits);
                    let of_cut = cut_settings(&settings, &model);
                    if threshold_px > 1.0 {
                        selector.select(&model, view, &of_cut, &mut cut);
                    } else {
                        let footprints = cut::SplatFootprints {
                            side_px: threshold_px,
                            hides: false,
                            are_discs: false,
                            large_leaves: false,
                            is_cloud: false,
                        };
                        let seen = (footprints, &undrawn);
                        selector.select_seen(&model, view, &of_cut, seen, &mut cut);
                    }
                    let mut host = vec![bytemuck::Zeroable::zeroed(); splats::count(&cut, &plan)];
                    let packed = splats::pack::<Splat>(&model, &cut, view, &plan, &mut host);
                    assert_eq!(packed.quads, 0);
                    host.truncate(packed.points);
                    let corners: Vec<[u32; 3]> = cut
                        .triangles
                        .iter()
                        .map(|&id| model.triangles[id as usize])
                        .collect();
                    let how = (&settings, index % 2 == 0);
                    let (splats, [small, large], counts) =
                        chosen(&gpu, (&model, &scene), view, how);
                    check_sizes(view, &model, [&small, &large], how.1);
                    let triangles = [small, large].concat();
                    kinds[0] += cut.nodes.len();
                    kinds[1] += cut.strips.len();
                    kinds[2] += cut.leaves.len();
                    kinds[3] += cut.triangles.len();
                    if !is_exact {
                        let near = |a: u64, b: u64| a.abs_diff(b) <= 2 + b / 1000;
                        assert!(near(u64::from(counts.visited), cut.stats.visited), "{what}");
                        assert!(near(splats.len() as u64, host.len() as u64), "{what}");
                        continue;
                    }
                    assert_eq!(u64::from(counts.visited), cut.stats.visited, "{what}");
                    assert_eq!(u64::from(counts.outside), cut.stats.outside, "{what}");
                    let Some(extra) = more(&sorted::<_, 6>(&splats), &sorted::<_, 6>(&host)) else {
                        panic!("{what}: splats of the host are missing");
                    };
                    let Some(edge_on) =
                        more(&sorted::<_, 3>(&triangles), &sorted::<_, 3>(&corners))
                    else {
                        panic!("{what}: triangles of the host are missing");
                    };
                    let kept = cut.stats.facing_away - u64::from(counts.facing_away);
                    let is_in_picture = |record: &&[u32; 6]| {
                        let [x, y, z] = [0, 1, 2].map(|i| f32::from_bits(record[i]));
                        let (x, y, _) = view.project(glam::Vec3::new(x, y, z));
                        let is_in = |at: f32, size: u32| at > -0.1 && at < size as f32 + 0.1;
                        is_in(x, view.width) && is_in(y, view.height)
                    };
                    let extra = match threshold_px > 1.0 {
                        true => extra.len(),
                        false => extra.iter().filter(is_in_picture).count(),
                    };
                    assert!((extra + edge_on.len()) as u64 <= kept, "{what}");
                    for corners in edge_on {
                        let [a, b, c] =
                            corners.map(|i| model.vertices[i as usize].position.as_dvec3());
                        let (e, g) = (b - a, c - a);
                        let to_eye = match view.is_perspective {
                            true => view.eye.as_dvec3() - a,
                            false => -view.view_from_model.row(2).truncate().as_dvec3(),
                        };
                        // What single precision may lose of the product.
                        let most = 3e-6 * e.length() * g.length() * to_eye.length();
                        let along = e.cross(g).dot(to_eye).abs();
                        assert!(along <= most, "{what}: {along} {most}");
                    }
                }
            }
        }
        assert!(kinds.iter().all(|&n| n > 300), "{kinds:?}");
        close_in_silence(gpu);
    }

    /// No cut has more splats than there is room for, and some tree has one with more splats than leaves below a row.
    #[test]
    fn there_is_room_for_every_cut() {
        for (shape, triangles) in [
            (GeneratedShape::Torus, 30_000),
            (GeneratedShape::Statue, 20_000),
            (GeneratedShape::Square, 2),
        ] {
            let model = model_of(shape, triangles);
            let most = cut::most_splats(&model);
            assert!(most >= model.tree.leaves.len() as u64);
            assert!(most <= 2 * model.tree.leaves.len() as u64);
            for fill in [0.02, 0.1, 0.4, 1.0, 3.0] {
                for threshold_px in [1.0, 4.0, 20.0] {
                    let view = orbit(&model, (300, 300), fill, 1);
                    let settings = Settings {
                        threshold_px,
                        ..Settings::default()
                    };
                    let mut cut = Cut::default();
                    CutSelector::default().select(
                        &model,
                        &view,
                        &cut_settings(&settings, &model),
                        &mut cut,
                    );
                    let count = splats::count(&cut, &splat_plan(&settings, 255.0));
                    assert!(count as u64 <= most, "{shape:?} {fill} {threshold_px}");
                }
            }
        }
    }
}
