//! What `--stats` writes.

use serde_json::json;
use surfel::OpenedModel;
use surfel::measure::ValueDistribution;
use surfel::render::Settings;
use surfel::render::engine::Backend;
use surfel::render::stats::{FrameStage, FrameTimes};

/// How the pictures were drawn.
pub(crate) fn settings_of(
    ready: &OpenedModel,
    settings: &Settings,
    size: (u32, u32),
) -> serde_json::Value {
    json!({
        "method": settings.method,
        "splat": settings.splat,
        "blend": settings.blend(),
        "shading": settings.shading,
        "reconstruction": settings.reconstruction,
        "path": settings.path,
        "threshold_px": settings.threshold_px,
        "traversal": settings.traversal,
        "depth_offset": settings.depth_offset(),
        "size_metric": settings.size,
        "width": size.0,
        "height": size.1,
        "light": super::light::facts(&settings.light),
        "culls_back": settings.culls_back(ready.model.is_closed),
    })
}

/// What drew them.
pub(crate) fn device_of(backend: &Backend) -> serde_json::Value {
    match backend.device() {
        Some(gpu) => json!(gpu.info()),
        None => json!({ "name": backend.name() }),
    }
}

/// Counts and times of a run, as `--stats` writes them.
pub(crate) fn of(
    ready: &OpenedModel,
    backend: &Backend,
    settings: &Settings,
    size: (u32, u32),
    times: &[FrameTimes],
) -> serde_json::Value {
    let spread = |of: &dyn Fn(&FrameTimes) -> f64| {
        ValueDistribution::of(&times.iter().map(of).collect::<Vec<_>>())
    };
    let mut names: Vec<&'static str> = Vec::new();
    for pass in times.iter().flat_map(|t| &t.passes) {
        if !names.contains(&pass.name) {
            names.push(pass.name);
        }
    }
    let passes: Vec<_> = names
        .iter()
        .map(|name| {
            let values: Vec<f64> = times
                .iter()
                .flat_map(|t| t.passes.iter().filter(|p| p.name == *name).map(|p| p.ms))
                .collect();
            json!({ "name": name, "gpu_ms": ValueDistribution::of(&values) })
        })
        .collect();
    let memory: Vec<_> = match backend.device() {
        Some(gpu) => gpu
            .memory_report()
            .into_iter()
            .map(|(name, bytes)| json!({ "name": name, "bytes": bytes }))
            .collect(),
        None => Vec::new(),
    };
    let model = &ready.model;
    let count = |of: fn(&FrameTimes) -> u64| {
        ValueDistribution::of(&times.iter().map(|t| of(t) as f64).collect::<Vec<_>>())
    };
    json!({
        "model": super::info::facts(ready),
        "device": device_of(backend),
        "settings": settings_of(ready, settings, size),
        "frames": times.len(),
        "frame_ms": spread(&|t| t.frame_ms),
        "cpu": FrameStage::ALL
            .map(|stage| json!({ "name": stage.name(), "ms": spread(&|t| t.of(stage)) })),
        "passes": passes,
        "counts": {
            "nodes_in_tree": model.tree.nodes.len() + model.tree.leaves.len(),
            "nodes_visited": count(|t| t.counts.nodes_visited),
            "hidden": count(|t| t.counts.hidden),
            "between": count(|t| t.counts.between),
            "splats": count(|t| t.counts.splats),
            "triangles": count(|t| t.counts.triangles),
            "points": count(|t| t.counts.points),
            "draw_list_bytes": count(|t| t.counts.draw_list_bytes),
        },
        "memory": memory,
    })
}
