//! Records of the device beside those of the processor, number by number.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::cut::{Cut, CutSelector};
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::gpu::buffer::{BufferUsage, ReadbackBuffer, UploadBuffer};
use crate::gpu::device::DeviceKind as Device;
use crate::gpu::for_tests::{close_in_silence, device};
use crate::gpu::frame::FrameRing;
use crate::math::camera::{HeadlightSource, View};
use crate::mesh::Mesh;
use crate::pack::filtered;
use crate::pack::filtered::FilteredShade;
use crate::pack::lit_sphere::LitSphere;
use crate::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use crate::progress::SilentProgress;
use crate::render::cut_key::cut_settings;
use crate::render::frame_constants::{FrameContext, frame_constants};
use crate::render::model_facts::DrawnFacts;
use crate::render::pack_params::filtered_shade;
use crate::render::vulkan::device_tree::DeviceTree;
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::storage_ranges;
use crate::render::{Culling, Method, Settings, SplatKind};
use crate::tree::{self, BuildOptions, Model};
use glam::{DMat4, DVec3, DVec4, Vec3};

const SIZE: (u32, u32) = (320, 200);

/// Half of the vertices without a normal, all of colors of their own; triangles without area.
fn model_of(shape: GeneratedShape, triangles: u64, is_cloud: bool) -> Model {
    let mut mesh = generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
    let color = |p: &Vec3| (*p * 100.0 + 128.0).to_array().map(|c| c as u8);
    let colors = mesh.positions.iter().map(color);
    mesh.colors = colors.map(|[r, g, b]| [r, g, b, 255]).collect();
    let half = mesh.positions.len() / 2;
    mesh.normals[half..].fill(Vec3::ZERO);
    if is_cloud {
        mesh.triangles.clear();
    } else if let Some(&first) = mesh.triangles.first() {
        mesh.triangles.extend([[first[0]; 3]; 40]);
    }
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Points in one place, which have no neighbors.
fn in_one_place(points: usize) -> Model {
    let mesh = Mesh {
        positions: vec![Vec3::new(0.1, 0.2, 0.3); points],
        normals: vec![Vec3::Y; points],
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn views(model: &Model) -> Vec<View> {
    let of = |fill, step| model.orbit_step(SIZE, fill, step, 5);
    let mut views: Vec<View> = [(0.1, 0), (0.8, 1), (3.0, 2)]
        .map(|(fill, step)| of(fill, step).view(model.origin).unwrap())
        .to_vec();
    // As large, parallel, beside the middle.
    let mut parallel = of(0.8, 3);
    let (near, far) = (0.1, 100.0);
    parallel.proj = DMat4::from_cols(
        DVec4::X * 0.6,
        DVec4::Y * 0.9,
        DVec4::Z / (near - far),
        DVec4::new(0.1, -0.05, near / (near - far), 1.0),
    );
    views.push(parallel.view(model.origin).unwrap());
    // Of another unit, lit along the view direction.
    let mut scaled = of(1.5, 4);
    scaled.view = DMat4::from_scale(DVec3::splat(3.0)) * scaled.view;
    scaled.proj.w_axis.z *= 3.0;
    scaled.light = HeadlightSource::Directional;
    views.push(scaled.view(model.origin).unwrap());
    views
}

/// Model, scene and view of a comparison.
struct FilteredCase<'a> {
    model: &'a Model,
    facts: DrawnFacts,
    view: &'a View,
    settings: Settings,
}

impl FilteredCase<'_> {
    fn context(&self) -> FrameContext {
        FrameContext::new(&self.facts, self.view, &self.settings, 8.0, 4)
    }

    fn shade(&self) -> FilteredShade {
        let depth_range = self.context().depth_range;
        filtered_shade(&self.settings, &self.facts, depth_range, 255.0)
    }

    fn cut(&self) -> Cut {
        let mut cut = Cut::default();
        let of_cut = cut_settings(&self.settings, self.model);
        CutSelector::default().select(self.model, self.view, &of_cut, &mut cut);
        cut
    }

    /// Records of the processor, and numbers.
    fn written(&self) -> (Vec<FilteredSplat>, Vec<SplatId>) {
        let (model, view, shade) = (self.model, self.view, self.shade());
        let mut cut = self.cut();
        let large = filtered::take_triangles(model, view, &shade, &mut cut);
        let most = filtered::splat_count(&cut, large);
        let mut splats = vec![bytemuck::Zeroable::zeroed(); most];
        let count = filtered::splats(model, &cut, large, view, shade, &mut splats);
        splats.truncate(count);
        let mut ids = vec![SplatId::node(0); most];
        let named = filtered::ids(model, &cut, large, view, &shade, &mut ids);
        ids.truncate(named);
        (splats, ids)
    }

    /// Records that the device makes of numbers.
    fn made(&self, gpu: &Arc<Gpu>, scene: &DeviceScene, ids: &[SplatId]) -> Vec<FilteredSplat> {
        let mut tree = DeviceTree::new(gpu, self.model, scene).unwrap();
        tree.add_moments(gpu, self.model).unwrap();
        let bytes: &[u8] = bytemuck::cast_slice(ids);
        let mut list = UploadBuffer::new(gpu, "numbers", bytes.len() as u64).unwrap();
        list.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
        list.flush(0..bytes.len() as u64);
        let size = size_of_val(ids) as u64 / 8 * size_of::<FilteredSplat>() as u64;
        let out = DeviceBuffer::new(gpu, "records", BufferUsage::List, size).unwrap();
        let mut read = ReadbackBuffer::new(gpu, "read", size).unwrap();
        let context = self.context();
        let of_frame = frame_constants(self.view, &self.settings, &context);
        let has_triangles = self.model.kind().is_surface();
        let by_id = FilteredExpansion::new(gpu, of_frame.flags, has_triangles).unwrap();
        let mut frames = FrameRing::new(gpu, 1, false).unwrap();
        let mut frame = frames.begin().unwrap();
        let blocks = (
            frame.uniform(&of_frame).unwrap(),
            storage_ranges::constants(&context),
        );
        let named = NamedFiltered {
            ids: &list,
            count: ids.len(),
            groups: None,
            records: &out,
            eye: &filtered::device_constants(self.view, self.shade()),
        };
        let on = SceneTree { tree: &tree, scene };
        by_id.record(&mut frame, on, named, blocks).unwrap();
        frame.read_back_buffer("read", &out, &read);
        let ticket = frame.submit().unwrap();
        frames.finish(ticket).unwrap();
        bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut read))
    }
}

/// Numbers of a record: two of its place, two of the first pass, depth, area, two extents; then its color.
fn numbers(splat: &FilteredSplat) -> [f32; 12] {
    bytemuck::cast(*splat)
}

/// Lights and colors, and whether the device has the very colors: others have powers.
fn looks() -> Vec<(&'static str, Settings, bool)> {
    let usual = Settings {
        splat: SplatKind::Filtered,
        ..Settings::default()
    };
    let lit = |light| Settings { light, ..usual };
    let by = |color_by| Settings { color_by, ..usual };
    let at = Phong {
        lamp: Lamp::At(DVec3::new(1.5, 2.0, 0.5)),
        ..Phong::default()
    };
    vec![
        ("headlight", usual, true),
        ("primitives", by(ColorBy::Primitive), true),
        (
            "gray",
            Settings {
                use_colors: false,
                ..usual
            },
            true,
        ),
        ("lamp", lit(SurfaceLighting::Phong(Phong::default())), false),
        ("near lamp", lit(SurfaceLighting::Phong(at)), false),
        (
            "sphere",
            lit(SurfaceLighting::Sphere(LitSphere::Metal)),
            false,
        ),
        ("normals", by(ColorBy::Normal), false),
        ("depth", by(ColorBy::Depth), false),
    ]
}

/// Powers, of exponents of up to 40, make as many of the last places of a cosine, of 6e-8 each, and there are sums of some.
const COLOR_TOLERANCE: f32 = 1e-4;

/// Roots and quotients of other devices are off by some last places, of 1e-7 each. A tilt near a right angle is a small difference
/// of numbers near 1, whose root loses half of the places.
const NUMBER_TOLERANCE: f32 = 1e-3;

/// Tells whether the device has made what the host wrote.
fn are_same(
    host: &FilteredSplat,
    device: &FilteredSplat,
    is_exact: bool,
    has_colors: bool,
) -> bool {
    let both = numbers(host).into_iter().zip(numbers(device));
    both.enumerate().all(|(i, (a, b))| match i {
        0..8 if !is_exact => (a - b).abs() <= NUMBER_TOLERANCE * a.abs().max(1.0),
        8.. if !(is_exact && has_colors) => (a - b).abs() <= COLOR_TOLERANCE,
        _ => a.to_bits() == b.to_bits(),
    })
}

/// Kinds of numbers: nodes, splats of rows along which the color may change, leaves of the threshold's size, triangles and pieces
/// of a diameter of their own, pieces, splats of their own size, nodes and leaves in one place.
fn count_kinds(model: &Model, ids: &[SplatId], kinds: &mut [usize; 8]) {
    for id in ids {
        let is_leaf = id.part & SplatId::LEAF != 0;
        let cuts = id.part >> 26 & 15;
        let of_kind = [
            id.part == 0,
            !is_leaf && id.part >> 16 >= 4,
            is_leaf && cuts == 0,
            is_leaf && cuts > 0,
            is_leaf && cuts > 1,
            is_leaf && id.part & SplatId::OF_OWN_SIZE != 0,
            id.part == 0
                && !model.kind().is_surface()
                && model.tree.attributes[id.id as usize].area == 0.0,
            is_leaf
                && !model.kind().is_surface()
                && model.tree.leaves[id.id as usize].radius == 0.0,
        ];
        let counts = kinds.iter_mut().zip(of_kind);
        counts.for_each(|(kind, is_one)| *kind += usize::from(is_one));
    }
}

/// Cuts that every look is drawn of, and one alone.
const CUTS: [(f32, Culling, Method); 4] = [
    (4.0, Culling::Auto, Method::Splats),
    (1.0, Culling::Auto, Method::Pop),
    (3.0, Culling::Off, Method::Pop),
    (5.0, Culling::On, Method::Pop),
];

#[test]
fn numbers_become_the_splats_that_the_host_writes() {
    let Some(gpu) = device() else { return };
    let is_exact = gpu.info().kind == Device::Cpu;
    let mut kinds = [0; 8];
    let (mut all, mut nothing, mut wrong) = (0, 0, 0);
    for (name, model) in [
        ("statue", model_of(GeneratedShape::Statue, 40_000, false)),
        ("torus", model_of(GeneratedShape::Torus, 30_000, false)),
        ("cloud", model_of(GeneratedShape::Statue, 20_000, true)),
        ("square", model_of(GeneratedShape::Square, 2, false)),
        ("place", in_one_place(200)),
        ("point", in_one_place(1)),
    ] {
        let scene = DeviceScene::new(&gpu, &model).unwrap();
        for (index, view) in views(&model).iter().enumerate() {
            for (number, (look, settings, has_colors)) in looks().into_iter().enumerate() {
                let cuts = if number == 0 { &CUTS[..] } else { &CUTS[..1] };
                for &(threshold_px, culling, method) in cuts {
                    let case = FilteredCase {
                        model: &model,
                        facts: (&model).into(),
                        view,
                        settings: Settings {
                            threshold_px,
                            culling,
                            method,
                            ..settings
                        },
                    };
                    let (host, ids) = case.written();
                    if ids.is_empty() {
                        continue;
                    }
                    count_kinds(&model, &ids, &mut kinds);
                    let made = case.made(&gpu, &scene, &ids);
                    // What shows nothing lies before the near plane.
                    let drawn: Vec<FilteredSplat> = (made.into_iter())
                        .filter(|splat| splat.depth <= 1.0)
                        .collect();
                    let pairs = host.iter().zip(&drawn);
                    let off = pairs
                        .filter(|(a, b)| !are_same(a, b, is_exact, has_colors))
                        .count();
                    let has_same_count = host.len() == drawn.len();
                    assert!(
                        !is_exact || (has_same_count && off == 0),
                        "{look} of {name}, view {index}, {threshold_px} px, {culling:?}: \
                         {} of {}, device {}, {off} are others",
                        host.len(),
                        ids.len(),
                        drawn.len()
                    );
                    all += ids.len();
                    nothing += ids.len() - drawn.len();
                    wrong += if has_same_count { off } else { 0 };
                }
            }
        }
    }
    assert!(kinds.iter().all(|&n| n > 10), "{kinds:?}");
    assert!(nothing > 1000 && 2 * nothing < all, "{nothing} of {all}");
    // A last place decides what is its own size, or which normal is turned around.
    assert!(100 * wrong < all, "{wrong} of {all}");
    close_in_silence(gpu);
}
