//! Tests of the cut on the device: the lists are those of the processor, item by item.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

mod filtered;

use super::*;
use crate::abi::{Splat, WeightedSplat};
use crate::cut::{Cut, CutSelector};
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::gpu::buffer::AnyBuffer as _;
use crate::gpu::for_tests::{close_in_silence, device};
use crate::gpu::frame::FrameRing;
use crate::math::camera::View;
use crate::pack::filtered::device_constants;
use crate::pack::splats;
use crate::progress::SilentProgress;
use crate::render::capabilities::RendererCapabilities;
use crate::render::cut_key::cut_settings;
use crate::render::frame_constants::{FrameContext, frame_constants};
use crate::render::model_facts::DrawnFacts;
use crate::render::pack_params::splat_plan;
use crate::render::supported::device_cut_refusal;
use crate::render::vulkan::expand_ids::{ExpansionFrame, IdExpansion};
use crate::render::{Culling, CutOn, Method, Settings, SplatKind};
use crate::tree::{self, BuildOptions};

fn model_of(shape: GeneratedShape, triangles: u64, is_cloud: bool) -> Model {
    let mut mesh = generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
    if is_cloud {
        mesh.triangles.clear();
    }
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn orbit(model: &Model, size: (u32, u32), fill: f64, step: u32) -> View {
    let camera = model.orbit_step(size, fill, step, 5);
    camera.view(model.origin).unwrap()
}

/// Words of records, in an order of their own.
fn sorted<T: bytemuck::Pod>(records: &[T]) -> Vec<Vec<u32>> {
    let words = |record: &T| bytemuck::pod_collect_to_vec(bytemuck::bytes_of(record));
    let mut words: Vec<Vec<u32>> = records.iter().map(words).collect();
    words.sort_unstable();
    words
}

/// Finds what `all` has and `some` has not, both sorted; `None` where `some` has what `all` has not.
fn more<T: Ord + Clone>(all: &[T], some: &[T]) -> Option<Vec<T>> {
    let mut rest = some.iter().peekable();
    let mut extra = Vec::new();
    for item in all {
        if rest.next_if(|next| *next == item).is_none() {
            extra.push(item.clone());
        }
    }
    rest.next().is_none().then_some(extra)
}

/// Settings and rules of a cut that is asked of the device.
#[derive(Clone, Copy)]
struct AskedCut<'a> {
    settings: &'a Settings,
    kind: ExpandedKind,
    rules: ChoiceRules,
    max_point_px: f32,
    /// Light and colors of filtered splats.
    shade: Option<FilteredShade>,
    /// Pixels of the picture, by which room for pieces of triangles is made.
    pixels: u64,
}

/// Lists that a cut on the device left.
struct ChosenLists<R> {
    points: Vec<R>,
    quads: Vec<R>,
    /// Corners of the triangles for compute, and of the others.
    corners: [Vec<[u32; 3]>; 2],
    counts: CutCounters,
}

/// Model whose cuts the device chooses, with what all of them share: pipelines take longer than a cut.
struct CutBed<'a> {
    gpu: Arc<Gpu>,
    model: &'a Model,
    scene: DeviceScene,
    tree: DeviceTree,
    expansion: IdExpansion,
    frames: FrameRing,
    lists: Option<BedLists>,
}

/// Lists of cuts of one kind, and what reads them back.
struct BedLists {
    cut: DeviceCut,
    splats: ReadbackBuffer,
    corners: ReadbackBuffer,
}

impl<'a> CutBed<'a> {
    fn new(gpu: &Arc<Gpu>, model: &'a Model) -> Self {
        let scene = DeviceScene::new(gpu, model).unwrap();
        Self {
            gpu: Arc::clone(gpu),
            model,
            tree: DeviceTree::new(gpu, model, &scene).unwrap(),
            expansion: IdExpansion::new(gpu, model.kind().is_surface()).unwrap(),
            frames: FrameRing::new(gpu, 1, false).unwrap(),
            scene,
            lists: None,
        }
    }

    /// Makes the lists, unless those of the last cut will do.
    fn ensure_lists(&mut self, kind: ExpandedKind, pixels: u64) {
        let will_do = |lists: &BedLists| lists.cut.is_of(&self.scene, (kind, pixels));
        if self.lists.as_ref().is_some_and(will_do) {
            return;
        }
        // Room for two is not needed.
        self.lists = None;
        let (tree, scene) = (&self.tree, &self.scene);
        let on = SceneTree { tree, scene };
        let cut = DeviceCut::new(&self.gpu, on, self.model, (kind, pixels, 1)).unwrap();
        let read = |name, bytes| ReadbackBuffer::new(&self.gpu, name, bytes).unwrap();
        self.lists = Some(BedLists {
            splats: read("splats", cut.records.bytes()),
            corners: read("corners", cut.indices.bytes()),
            cut,
        });
    }

    /// Lists that the device chooses.
    fn chosen<R>(&mut self, view: &View, asked: AskedCut<'_>) -> ChosenLists<R>
    where
        R: bytemuck::Pod + PartialEq + std::fmt::Debug,
    {
        let (settings, kind) = (asked.settings, asked.kind);
        let facts = DrawnFacts::from(self.model);
        let context = FrameContext::new(&facts, view, settings, 1.0, 0);
        let of_frame = frame_constants(view, settings, &context);
        let eye = asked.shade.map(|shade| device_constants(view, shade));
        if kind.are_filtered {
            self.tree.add_moments(&self.gpu, self.model).unwrap();
            (self.expansion)
                .ensure_filtered(&self.gpu, of_frame.flags)
                .unwrap();
        }
        self.ensure_lists(kind, asked.pixels);
        let (tree, scene) = (&self.tree, &self.scene);
        let on = SceneTree { tree, scene };
        let BedLists {
            cut,
            splats,
            corners,
        } = self.lists.as_mut().unwrap();
        let tester = cut::NodeTester::new(self.model, view, &cut_settings(settings, self.model));
        // Twice: the lists of the last frame are replaced.
        for _ in 0..2 {
            let mut frame = self.frames.begin().unwrap();
            let rules = cut.constants(&tester, view, asked.rules);
            let constants = frame.uniform(&rules).unwrap();
            cut.choose(&mut frame, on, constants);
            let ids = (cut.chosen_ids(), kind);
            let block = frame.uniform(&of_frame).unwrap();
            let seen = ExpansionFrame {
                context: &context,
                constants: block,
                eye: eye.as_ref(),
            };
            (self.expansion)
                .record_chosen(&mut frame, on, ids, seen)
                .unwrap();
            frame.read_back_buffer("splats", &cut.records, splats);
            frame.read_back_buffer("corners", &cut.indices, corners);
            let ticket = frame.submit().unwrap();
            self.frames.finish(ticket).unwrap();
        }
        let counts = cut.counts(0);
        assert!(u64::from(counts.splats[0]) <= u64::from(cut.most_splats));
        let splats: &[R] = bytemuck::cast_slice(ReadbackBuffer::bytes(splats));
        let corners: &[[u32; 3]] = bytemuck::cast_slice(ReadbackBuffer::bytes(corners));
        let first = counts.triangles[2] as usize / 3;
        assert_eq!(
            3 * corners.len() as u32,
            counts.triangles[0] + counts.triangles[2]
        );
        check_copies(splats, counts.splats[0], counts.splat_groups);
        let [vertices, quads, first_vertex, first_quad] = counts.quads;
        assert_eq!((vertices, first_vertex), (6, 0));
        assert_eq!(first_quad + quads, cut.room());
        assert!(kind.have_quads || quads == 0);
        check_copies(corners, counts.small, counts.small_groups);
        ChosenLists {
            points: splats[..counts.splats[0] as usize].to_vec(),
            quads: splats[first_quad as usize..cut.room() as usize].to_vec(),
            corners: [
                corners[..counts.small as usize].to_vec(),
                corners[first..].to_vec(),
            ],
            counts,
        }
    }
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

/// Cut that the processor chooses, and the records of its points and quads.
fn of_host<R: splats::SplatRecord + bytemuck::Pod + Send>(
    gpu: &Gpu,
    (model, undrawn): (&Model, &cut::ZeroAreaSet),
    view: &View,
    asked: AskedCut<'_>,
) -> (Cut, [Vec<R>; 2]) {
    let settings = asked.settings;
    let plan = splat_plan(settings, asked.max_point_px);
    let mut cut = Cut::default();
    let mut selector = CutSelector::default().with_subpixel_bits(gpu.info().subpixel_bits);
    let of_cut = cut_settings(settings, model);
    if asked.rules.are_samples {
        let footprints = cut::SplatFootprints {
            side_px: settings.threshold_px,
            hides: false,
            are_discs: false,
            large_leaves: false,
            is_cloud: false,
        };
        let seen = (footprints, undrawn);
        selector.select_seen(model, view, &of_cut, seen, &mut cut);
    } else {
        selector.select(model, view, &of_cut, &mut cut);
    }
    let mut records = vec![R::zeroed(); splats::count(&cut, &plan)];
    let packed = splats::pack::<R>(model, &cut, view, &plan, &mut records);
    let quads = records[records.len() - packed.quads..].to_vec();
    records.truncate(packed.points);
    (cut, [records, quads])
}

/// Checks that triangles are so edge-on that single precision may take their product for nothing.
fn check_edge_on(model: &Model, view: &View, triangles: &[Vec<u32>], what: &str) {
    for corners in triangles {
        let at = |i: usize| model.vertices[corners[i] as usize].position.as_dvec3();
        let [a, b, c] = [at(0), at(1), at(2)];
        let (e, g) = (b - a, c - a);
        let to_eye = match view.is_perspective {
            true => view.eye.as_dvec3() - a,
            false => -view.view_from_model.row(2).truncate().as_dvec3(),
        };
        let most = 3e-6 * e.length() * g.length() * to_eye.length();
        let along = e.cross(g).dot(to_eye).abs();
        assert!(along <= most, "{what}: {along} {most}");
    }
}

/// Compares the lists of the device with those of the host, and counts nodes, strips, leaves, triangles and quads of the cut.
fn compare<R>(
    bed: &mut CutBed<'_>,
    undrawn: &cut::ZeroAreaSet,
    view: &View,
    asked: AskedCut<'_>,
    what: &str,
) -> [usize; 5]
where
    R: splats::SplatRecord + bytemuck::Pod + Send + PartialEq + std::fmt::Debug,
{
    let (gpu, model) = (Arc::clone(&bed.gpu), bed.model);
    let (cut, host) = of_host::<R>(&gpu, (model, undrawn), view, asked);
    let ChosenLists {
        points,
        quads,
        corners: [small, large],
        counts,
    } = bed.chosen::<R>(view, asked);
    // Of sizes at the limit either may be the case.
    let of_host = host[1].len();
    let most = 2 + of_host / 1000;
    let of_device = quads.len();
    assert!(
        of_device.abs_diff(of_host) <= most,
        "{what}: {of_device} quads, {of_host}"
    );
    let (splats, host) = ([points, quads].concat(), host.concat());
    check_sizes(view, model, [&small, &large], asked.rules.by_compute);
    let kinds = [
        cut.nodes.len(),
        cut.strips.len(),
        cut.leaves.len(),
        cut.triangles.len(),
        of_device,
    ];
    // Elsewhere roots and quotients may differ in the last place, and with them single nodes.
    if !gpu.info().is_cpu() {
        let near = |a: u64, b: u64| a.abs_diff(b) <= 2 + b / 1000;
        assert!(near(u64::from(counts.visited), cut.stats.visited), "{what}");
        assert!(near(splats.len() as u64, host.len() as u64), "{what}");
        return kinds;
    }
    assert_eq!(u64::from(counts.visited), cut.stats.visited, "{what}");
    assert_eq!(u64::from(counts.outside), cut.stats.outside, "{what}");
    let Some(extra) = more(&sorted(&splats), &sorted(&host)) else {
        panic!("{what}: splats of the host are missing");
    };
    let corners: Vec<[u32; 3]> = match asked.rules.draws_large_leaves {
        true => Vec::new(),
        false => (cut.triangles.iter())
            .map(|&id| model.triangles[id as usize])
            .collect(),
    };
    let Some(edge_on) = more(&sorted(&[small, large].concat()), &sorted(&corners)) else {
        panic!("{what}: triangles of the host are missing");
    };
    let kept = cut.stats.facing_away - u64::from(counts.facing_away);
    let is_in_picture = |record: &&Vec<u32>| {
        let [x, y, z] = [0, 1, 2].map(|i| f32::from_bits(record[i]));
        let (x, y, _) = view.project(glam::Vec3::new(x, y, z));
        let is_in = |at: f32, size: u32| at > -0.1 && at < size as f32 + 0.1;
        is_in(x, view.width) && is_in(y, view.height)
    };
    let extra = match asked.rules.are_samples {
        false => extra.len(),
        true => extra.iter().filter(is_in_picture).count(),
    };
    assert!((extra + edge_on.len()) as u64 <= kept, "{what}");
    check_edge_on(model, view, &edge_on, what);
    kinds
}

/// Views of a model, the last one without perspective and off the middle of the picture.
fn views_of(model: &Model) -> Vec<View> {
    let mut views: Vec<View> = [(0.1, 0), (0.5, 1), (1.0, 2), (2.5, 3)]
        .map(|(fill, step)| orbit(model, (320, 200), fill, step))
        .to_vec();
    let mut camera = model.orbit_step((320, 200), 0.5, 4, 5);
    // A single point has no size.
    let radius = f64::from(model.orbit_radius).max(0.1);
    let (wide, near, far) = (0.6 / radius, 0.01, 100.0);
    camera.proj = glam::DMat4::from_cols(
        glam::DVec4::X * wide,
        glam::DVec4::Y * wide * 1.2,
        glam::DVec4::Z / (near - far),
        glam::DVec4::new(0.1, -0.05, near / (near - far), 1.0),
    );
    views.push(camera.view(model.origin).unwrap());
    views
}

/// The device chooses the very nodes, rows, leaves and triangles that the host chooses, and makes the same records of them for
/// every technique; what it has besides is seen edge-on, or beside the picture.
#[test]
fn the_device_chooses_what_the_host_chooses() {
    let Some(gpu) = device() else { return };
    // Of plain, oriented and weighted splats.
    let mut kinds = [[0; 5]; 3];
    for (shape, triangles, is_cloud) in [
        (GeneratedShape::Statue, 60_000, false),
        (GeneratedShape::Torus, 40_000, false),
        (GeneratedShape::Sphere, 20_000, false),
        (GeneratedShape::Square, 2, false),
        (GeneratedShape::Square, 5_000, false),
        (GeneratedShape::Statue, 60_000, true),
        (GeneratedShape::Sphere, 8_000, true),
    ] {
        let model = model_of(shape, triangles, is_cloud);
        let mut bed = CutBed::new(&gpu, &model);
        let undrawn = cut::ZeroAreaSet::new(&model);
        for (index, view) in views_of(&model).iter().enumerate() {
            for (splat, threshold_px, culling, method) in [
                (SplatKind::Square, 1.0, Culling::Auto, Method::Pop),
                (SplatKind::Square, 2.5, Culling::Off, Method::Pop),
                (SplatKind::Disc, 7.0, Culling::Auto, Method::Pop),
                (SplatKind::Square, 40.0, Culling::On, Method::Pop),
                (SplatKind::Ellipse, 1.0, Culling::Auto, Method::Pop),
                (SplatKind::Visibility, 5.0, Culling::Off, Method::Pop),
                (SplatKind::Gauss, 1.0, Culling::Off, Method::Pop),
                (SplatKind::Gauss, 3.5, Culling::Auto, Method::Pop),
                (SplatKind::Square, 1.5, Culling::Auto, Method::Splats),
                (SplatKind::Disc, 4.0, Culling::Off, Method::Splats),
                (SplatKind::Ellipse, 3.0, Culling::Off, Method::Splats),
                (SplatKind::Gauss, 2.0, Culling::Auto, Method::Splats),
            ] {
                let settings = Settings {
                    splat,
                    threshold_px,
                    culling,
                    method,
                    cut_on: CutOn::Device,
                    ..Settings::default()
                };
                let have_quads = is_cloud || method == Method::Splats;
                let usual = splat_plan(&settings, 255.0);
                let max_point_px = match have_quads {
                    true => usual.within_threshold_px() + 3.0,
                    false => 255.0,
                };
                let plan = splat_plan(&settings, max_point_px);
                let capable = RendererCapabilities {
                    has_first_instance: true,
                    ..RendererCapabilities::PROCESSOR
                };
                let facts = DrawnFacts::from(&model);
                assert_eq!(
                    device_cut_refusal(&settings, &facts, (&plan, &capable)),
                    None
                );
                let what = format!(
                    "{shape:?} {triangles}, cloud {is_cloud}, view {index}, {method:?}, {splat:?} of {threshold_px} px, {culling:?}"
                );
                let have_areas = splat == SplatKind::Gauss;
                let is_plain = matches!(splat, SplatKind::Square | SplatKind::Disc);
                let asked = AskedCut {
                    settings: &settings,
                    kind: ExpandedKind {
                        are_oriented: !is_plain,
                        have_areas,
                        have_quads,
                        are_filtered: false,
                    },
                    rules: ChoiceRules {
                        threshold_px,
                        by_compute: index % 2 == 0,
                        are_samples: is_plain && threshold_px <= 1.0 && !have_quads,
                        draws_large_leaves: method == Method::Splats,
                        are_oriented: !is_plain,
                        largest_px: plan.largest_side_px(),
                        are_pieces: false,
                    },
                    max_point_px,
                    shade: None,
                    pixels: 1,
                };
                let found = match have_areas {
                    true => compare::<WeightedSplat>(&mut bed, &undrawn, view, asked, &what),
                    false => compare::<Splat>(&mut bed, &undrawn, view, asked, &what),
                };
                let of_kind = &mut kinds[usize::from(!is_plain) + usize::from(have_areas)];
                for (sum, found) in of_kind.iter_mut().zip(found) {
                    *sum += found;
                }
            }
        }
    }
    assert!(kinds.as_flattened().iter().all(|&n| n > 300), "{kinds:?}");
    close_in_silence(gpu);
}

/// No cut has more splats than there is room for, and some tree has one with more splats than leaves below a row.
#[test]
fn there_is_room_for_every_cut() {
    for (shape, triangles, is_cloud) in [
        (GeneratedShape::Torus, 30_000, false),
        (GeneratedShape::Statue, 20_000, false),
        (GeneratedShape::Statue, 20_000, true),
        (GeneratedShape::Square, 2, false),
    ] {
        let model = model_of(shape, triangles, is_cloud);
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
