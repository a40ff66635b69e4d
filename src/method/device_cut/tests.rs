#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::cut::{Cut, Selector};
use crate::draw::splats;
use crate::generate::{self, Shape, Spec};
use crate::gpu::Options;
use crate::gpu::device::Kind;
use crate::gpu::frame::Frames;
use crate::math::camera::{Camera, View};
use crate::method::plan::{cut_settings, splat_plan};
use crate::method::{Culling, CutOn};
use crate::progress::Silent;
use crate::tree::{self, BuildOptions};

fn model_of(shape: Shape, triangles: u64) -> Model {
    let mesh = generate::mesh(&Spec::with_triangles(shape, triangles).unwrap());
    tree::build(mesh, &BuildOptions::default(), &Silent).unwrap()
}

fn orbit(model: &Model, size: (u32, u32), fill: f64, step: u32) -> View {
    let center = model.origin + model.orbit_center.as_dvec3();
    let radius = f64::from(model.orbit_radius);
    let camera = Camera::orbit_view(size, center, radius, fill, step, 5);
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
    (model, scene): (&Model, &Scene),
    view: &View,
    settings: &Settings,
) -> (Vec<Splat>, Vec<[u32; 3]>, CutCounters) {
    let mut frames = Frames::new(gpu, 1, false).unwrap();
    let mut cut = DeviceCut::new(gpu, model, scene, 1).unwrap();
    let mut splats = Readback::new(gpu, "splats", cut.splats.bytes()).unwrap();
    let mut corners = Readback::new(gpu, "corners", cut.indices.bytes()).unwrap();
    let tester = cut::Tester::new(model, view, &cut_settings(settings, model));
    // Twice: the lists of the last frame are replaced.
    for _ in 0..2 {
        let mut frame = frames.begin().unwrap();
        let constants = frame.uniform(&cut.constants(&tester)).unwrap();
        cut.choose(&mut frame, scene, constants);
        frame.read_back_buffer("splats", &cut.splats, &splats);
        frame.read_back_buffer("corners", &cut.indices, &corners);
        let ticket = frame.submit().unwrap();
        frames.finish(ticket).unwrap();
    }
    let counts = cut.counts(0);
    assert!(u64::from(counts.splats[0]) <= u64::from(cut.most_splats));
    let splats = bytemuck::pod_collect_to_vec(Readback::bytes(&mut splats));
    let corners = bytemuck::pod_collect_to_vec(Readback::bytes(&mut corners));
    (
        splats[..counts.splats[0] as usize].to_vec(),
        corners[..counts.triangles[0] as usize / 3].to_vec(),
        counts,
    )
}

/// The device chooses the very nodes, rows, leaves and triangles that the host chooses, and writes the same records; what it
/// has besides is seen edge-on.
#[test]
fn the_device_chooses_what_the_host_chooses() {
    let options = Options {
        validation: true,
        ..Options::default()
    };
    let gpu = match Gpu::open(&options) {
        Ok(gpu) => gpu,
        Err(error) => {
            assert!(
                std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
                "a device is required here: {error}"
            );
            eprintln!("no device, nothing tested: {error}");
            return;
        }
    };
    // Elsewhere roots and quotients may differ in the last place, and with them single nodes.
    let is_exact = gpu.info().kind == Kind::Cpu;
    let mut kinds = [0; 4];
    for (shape, triangles) in [
        (Shape::Statue, 60_000),
        (Shape::Torus, 40_000),
        (Shape::Sphere, 20_000),
        (Shape::Square, 2),
        (Shape::Square, 5_000),
    ] {
        let model = model_of(shape, triangles);
        let scene = Scene::new(&gpu, &model).unwrap();
        let mut views: Vec<View> = [(0.1, 0), (0.5, 1), (1.0, 2), (2.5, 3)]
            .map(|(fill, step)| orbit(&model, (320, 200), fill, step))
            .to_vec();
        let center = model.origin + model.orbit_center.as_dvec3();
        let mut camera =
            Camera::orbit_view((320, 200), center, f64::from(model.orbit_radius), 0.5, 4, 5);
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
                assert_eq!(why_not(&settings, &model), None);
                let what =
                    format!("{shape:?} {triangles}, view {index}, {threshold_px} px, {culling:?}");
                let mut cut = Cut::default();
                Selector::default().select(
                    &model,
                    view,
                    &cut_settings(&settings, &model),
                    &mut cut,
                );
                let plan = splat_plan(&settings, 255.0);
                let mut host = vec![bytemuck::Zeroable::zeroed(); splats::count(&cut, &plan)];
                let packed = splats::pack::<Splat>(&model, &cut, view, &plan, &mut host);
                assert_eq!(packed.quads, 0);
                host.truncate(packed.points);
                let corners: Vec<[u32; 3]> = cut
                    .triangles
                    .iter()
                    .map(|&id| model.triangles[id as usize])
                    .collect();
                let (splats, triangles, counts) = chosen(&gpu, (&model, &scene), view, &settings);
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
                let extra = more(&sorted::<_, 6>(&splats), &sorted::<_, 6>(&host));
                let Some(extra) = extra else {
                    panic!("{what}: splats of the host are missing");
                };
                let Some(edge_on) = more(&sorted::<_, 3>(&triangles), &sorted::<_, 3>(&corners))
                else {
                    panic!("{what}: triangles of the host are missing");
                };
                let kept = cut.stats.facing_away - u64::from(counts.facing_away);
                assert!((extra.len() + edge_on.len()) as u64 <= kept, "{what}");
                for corners in edge_on {
                    let [a, b, c] = corners.map(|i| model.vertices[i as usize].position.as_dvec3());
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
    let messages = gpu.messages().clone();
    drop(gpu);
    let messages = messages.take();
    assert!(messages.is_empty(), "validation said: {messages:#?}");
}

/// No cut has more splats than there is room for, and some tree has one with more splats than leaves below a row.
#[test]
fn there_is_room_for_every_cut() {
    for (shape, triangles) in [
        (Shape::Torus, 30_000),
        (Shape::Statue, 20_000),
        (Shape::Square, 2),
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
                Selector::default().select(
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
