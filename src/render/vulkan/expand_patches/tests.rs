//! Polygons of the device beside those of the processor, number by number.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::gpu::buffer::{BufferUsage, ReadbackBuffer};
use crate::gpu::device::DeviceKind as Device;
use crate::gpu::for_tests::{close_in_silence, device};
use crate::gpu::frame::FrameRing;
use crate::patches::ResidentPatches;
use crate::progress::SilentProgress;
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::{self, BuildOptions, Model, PackedPatch, PackedPatchColors, PatchRecords};
use bytemuck::Zeroable;

fn model_of(shape: GeneratedShape, triangles: u64, has_colors: bool) -> Model {
    let mut mesh = generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
    if has_colors {
        let color = |p: &glam::Vec3| (*p * 100.0 + 128.0).to_array().map(|c| c as u8);
        let colors = mesh.positions.iter().map(color);
        mesh.colors = colors.map(|[r, g, b]| [r, g, b, 255]).collect();
    }
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Polygons that the device makes of every node, in the order of `ids`.
fn made(
    gpu: &Arc<Gpu>,
    model: &Model,
    records: &PatchRecords,
    ids: &[u32],
) -> Vec<OrientedPolygon> {
    let scene = DeviceScene::new(gpu, model).unwrap();
    let mut tree = DeviceTree::new(gpu, model, &scene).unwrap();
    tree.add_patches(gpu, (records, &[])).unwrap();
    let expansion = PatchExpansion::new(gpu).unwrap();
    let bytes: &[u8] = bytemuck::cast_slice(ids);
    let mut list = UploadBuffer::new(gpu, "numbers", bytes.len() as u64).unwrap();
    list.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
    list.flush(0..bytes.len() as u64);
    let size = size_of::<OrientedPolygon>() as u64 * ids.len() as u64;
    let out = DeviceBuffer::new(gpu, "polygons", BufferUsage::List, size).unwrap();
    let mut read = ReadbackBuffer::new(gpu, "read", size).unwrap();
    let mut frames = FrameRing::new(gpu, 1, false).unwrap();
    let mut frame = frames.begin().unwrap();
    let (of, constants) = ((&list, ids.len(), &out), ListConstants::zeroed());
    expansion.record(&mut frame, &tree, of, constants).unwrap();
    frame.read_back_buffer("read", &out, &read);
    let ticket = frame.submit().unwrap();
    frames.finish(ticket).unwrap();
    bytemuck::pod_collect_to_vec(&read.bytes()[..size as usize])
}

/// Every second node backwards, so that no polygon has the place of its record.
fn some_ids(count: usize) -> Vec<u32> {
    (0..count as u32).rev().step_by(2).collect()
}

/// Largest difference of numbers that roots and quotients enter, relative to what they are of.
fn difference(a: &OrientedPolygon, b: &OrientedPolygon) -> f32 {
    let size = a.round_radius;
    let corners = a.corners.iter().zip(&b.corners);
    let corners = corners.map(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) / size);
    let bend = a.shape_operator.iter().zip(&b.shape_operator);
    let bend = bend.map(|(a, b)| (a - b).abs() * size);
    let direct = [
        a.center.distance(b.center) / size.max(a.center.length()),
        a.normal.distance(b.normal),
        a.axis.distance(b.axis),
        a.shading_normal.distance(b.shading_normal),
        (a.thickness - b.thickness).abs() / size,
    ];
    corners.chain(bend).chain(direct).fold(0.0, f32::max)
}

#[test]
fn numbers_become_the_polygons_that_the_host_writes() {
    let Some(gpu) = device() else { return };
    let is_exact = gpu.info().kind == Device::Cpu;
    for (shape, triangles, has_colors) in [
        (GeneratedShape::Sphere, 20_000, false),
        (GeneratedShape::Statue, 30_000, true),
        (GeneratedShape::Torus, 20_000, true),
    ] {
        let model = model_of(shape, triangles, has_colors);
        let patches = ResidentPatches::build(&model, &SilentProgress).unwrap();
        let conditions = patches.conditions(&model, false);
        let ids = some_ids(model.tree.nodes.len());
        let device = made(&gpu, &model, patches.records(), &ids);
        let host = patches.polygons(&model);
        let mut compared = 0;
        for (&id, of_device) in ids.iter().zip(&device) {
            let of_host = &host[id as usize];
            if !conditions.may_draw(id) {
                continue;
            }
            compared += 1;
            let what = format!("{shape:?}, node {id}");
            assert!(!is_exact || of_device == of_host, "{what}");
            assert!(difference(of_host, of_device) < 1e-5, "{what}");
            assert_eq!(of_device.color, of_host.color, "{what}");
            assert_eq!(of_device.corner_count, of_host.corner_count, "{what}");
        }
        assert!(compared > 500, "{shape:?}: {compared}");
    }
    close_in_silence(gpu);
}

/// Records of any bits, as a damaged file may have them: both make the same of what is finite.
#[test]
fn records_of_any_bits_become_the_same_polygons() {
    let Some(gpu) = device() else { return };
    if gpu.info().kind != Device::Cpu {
        return close_in_silence(gpu);
    }
    let model = model_of(GeneratedShape::Torus, 20_000, false);
    let count = model.tree.nodes.len();
    let mut records = PatchRecords {
        records: vec![PackedPatch::zeroed(); count],
        colors: vec![PackedPatchColors::zeroed(); count],
    };
    let mut state = 1u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as u8
    };
    bytemuck::cast_slice_mut::<_, u8>(&mut records.records).fill_with(&mut random);
    bytemuck::cast_slice_mut::<_, u8>(&mut records.colors).fill_with(&mut random);
    let ids = some_ids(count);
    let device = made(&gpu, &model, &records, &ids);
    let mut compared = 0;
    for (&id, of_device) in ids.iter().zip(&device) {
        let node = &model.tree.nodes[id as usize];
        if !records.record(id as usize, node).may_be_drawn() {
            continue;
        }
        compared += 1;
        assert_eq!(*of_device, records.polygon(id as usize, node), "node {id}");
    }
    assert!(compared > count / 8, "{compared}");
    close_in_silence(gpu);
}
