//! Reports of a frame besides its picture: timestamps and counters, and the query pools that hold them.
//!
//! Timestamps stand outside of rendering, around each pass. Counters begin and end inside of the rendering scope of
//! the pass that they count, in the same subpass as Vulkan demands; copies have none.

use super::{Error, Gpu, RetiredResource};
use ash::vk;
use std::sync::Arc;

/// Most passes in one frame that get timestamps.
pub(super) const MAX_PASSES: u32 = 64;

/// Time of one pass on the device.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Milliseconds between the timestamps around it.
    pub ms: f64,
}

/// Choice of what the frames recorded from now on report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameMeasure {
    /// Times of the passes: two timestamps with a full barrier each.
    pub passes: bool,
    /// Time of the whole frame: two timestamps more.
    pub frame: bool,
    /// Counters of the passes. They slow some devices down, so times taken beside them mean little.
    pub counters: bool,
}

/// Times of the passes of a frame on the device's clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DeviceTimes {
    /// From the first command of the frame to the end of the last, milliseconds; `None` unless
    /// [`FrameMeasure::frame`] was set and the device has timestamps.
    pub frame_ms: Option<f64>,
    /// The first timestamp of the frame, ticks of the device's clock.
    pub first_tick: u64,
    /// When each pass began, milliseconds after `first_tick`, in the order of the passes.
    pub starts_ms: Vec<f64>,
}

/// Counts of the stages of the pipeline in one pass (`VkQueryPipelineStatisticFlagBits`).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PipelineStatistics {
    /// Vertices fetched.
    pub input_vertices: u64,
    /// Points and triangles assembled.
    pub input_primitives: u64,
    /// Runs of the vertex shader; a vertex may be shaded again.
    pub vertex_invocations: u64,
    /// Primitives that came to clipping.
    pub clipping_invocations: u64,
    /// Primitives that clipping let through; some devices count what is culled.
    pub clipping_primitives: u64,
    /// Runs of the fragment shader.
    pub fragment_invocations: u64,
}

impl PipelineStatistics {
    const FLAGS: vk::QueryPipelineStatisticFlags = vk::QueryPipelineStatisticFlags::from_raw(
        vk::QueryPipelineStatisticFlags::INPUT_ASSEMBLY_VERTICES.as_raw()
            | vk::QueryPipelineStatisticFlags::INPUT_ASSEMBLY_PRIMITIVES.as_raw()
            | vk::QueryPipelineStatisticFlags::VERTEX_SHADER_INVOCATIONS.as_raw()
            | vk::QueryPipelineStatisticFlags::CLIPPING_INVOCATIONS.as_raw()
            | vk::QueryPipelineStatisticFlags::CLIPPING_PRIMITIVES.as_raw()
            | vk::QueryPipelineStatisticFlags::FRAGMENT_SHADER_INVOCATIONS.as_raw(),
    );

    /// The counters by name, in the order of the pipeline.
    pub fn named(&self) -> [(&'static str, u64); 6] {
        [
            ("input_vertices", self.input_vertices),
            ("input_primitives", self.input_primitives),
            ("vertex_invocations", self.vertex_invocations),
            ("clipping_invocations", self.clipping_invocations),
            ("clipping_primitives", self.clipping_primitives),
            ("fragment_invocations", self.fragment_invocations),
        ]
    }
}

/// Counts of one pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PassCounters {
    /// Name of the pass.
    pub name: &'static str,
    /// Bytes of targets that the pass loads: what it does not clear. By its description, not measured.
    pub loaded_bytes: u64,
    /// Bytes of targets that the pass stores. By its description, not measured.
    pub stored_bytes: u64,
    /// Samples that passed the depth test; `None` where the device cannot count them exactly.
    pub samples: Option<u64>,
    /// The stages of the pipeline; `None` where the device does not count.
    pub pipeline: Option<PipelineStatistics>,
}

/// The query of the timestamp before a frame's first command; the one behind it comes next.
const FRAME_QUERY: u32 = 2 * MAX_PASSES;

/// The query pools of one frame slot, and what was recorded into them.
#[derive(Debug, Default)]
pub(super) struct SlotQueries {
    timestamps: vk::QueryPool,
    samples: vk::QueryPool,
    pipeline: vk::QueryPool,
    /// Choice for the frame being recorded.
    pub(super) measure: FrameMeasure,
    timed: Vec<&'static str>,
    counted: Vec<PassCounters>,
    /// The frame is not submitted: nothing is written.
    is_idle: bool,
}

fn pool(
    gpu: &Gpu,
    name: &str,
    kind: vk::QueryType,
    count: u32,
    statistics: vk::QueryPipelineStatisticFlags,
) -> Result<vk::QueryPool, Error> {
    let info = vk::QueryPoolCreateInfo::default()
        .query_type(kind)
        .query_count(count)
        .pipeline_statistics(statistics);
    // SAFETY: the device is alive and has the feature that the kind of query needs (the callers ask first).
    let pool = unsafe { gpu.device.create_query_pool(&info, None) }
        .map_err(Error::vulkan("vkCreateQueryPool", name))?;
    gpu.name(pool, name);
    Ok(pool)
}

impl SlotQueries {
    /// Makes the pools that `measure` needs and that are not there yet.
    pub(super) fn prepare(
        &mut self,
        gpu: &Gpu,
        slot: &str,
        measure: FrameMeasure,
    ) -> Result<(), Error> {
        let none = vk::QueryPipelineStatisticFlags::empty();
        let null = vk::QueryPool::null();
        if (measure.passes || measure.frame) && self.timestamps == null {
            let name = format!("timestamps of {slot}");
            let kind = vk::QueryType::TIMESTAMP;
            self.timestamps = pool(gpu, &name, kind, FRAME_QUERY + 2, none)?;
        }
        if measure.counters && gpu.info.has_sample_counts && self.samples == null {
            let name = format!("samples of {slot}");
            self.samples = pool(gpu, &name, vk::QueryType::OCCLUSION, MAX_PASSES, none)?;
        }
        if measure.counters && gpu.info.has_pipeline_statistics && self.pipeline == null {
            let name = format!("pipeline statistics of {slot}");
            let kind = vk::QueryType::PIPELINE_STATISTICS;
            let flags = PipelineStatistics::FLAGS;
            self.pipeline = pool(gpu, &name, kind, MAX_PASSES, flags)?;
        }
        Ok(())
    }

    /// Forgets the last frame of the slot, which has finished, and readies what `measure` asks for.
    pub(super) fn begin(&mut self, gpu: &Gpu, commands: vk::CommandBuffer, measure: FrameMeasure) {
        self.measure = measure;
        self.timed.clear();
        self.counted.clear();
        self.is_idle = false;
        let reset = |pool: vk::QueryPool, count: u32| {
            if pool != vk::QueryPool::null() {
                // SAFETY: no submission uses the pool any more; the feature hostQueryReset is enabled.
                unsafe { gpu.device.reset_query_pool(pool, 0, count) };
            }
        };
        if measure.passes || measure.frame {
            reset(self.timestamps, FRAME_QUERY + 2);
        }
        if measure.counters {
            reset(self.samples, MAX_PASSES);
            reset(self.pipeline, MAX_PASSES);
        }
        if measure.frame {
            self.stamp(gpu, commands, FRAME_QUERY);
        }
    }

    /// The end of the frame's last command.
    pub(super) fn end(&self, gpu: &Gpu, commands: vk::CommandBuffer) {
        if self.measure.frame {
            self.stamp(gpu, commands, FRAME_QUERY + 1);
        }
    }

    /// The frame, which has no pass, is not submitted: it takes the device no time.
    pub(super) fn forget(&mut self) {
        self.is_idle = true;
    }

    /// The first of the two timestamp queries of the next pass, if it is timed.
    pub(super) fn next_timed(&mut self, name: &'static str) -> Option<u32> {
        (self.measure.passes && self.timed.len() < MAX_PASSES as usize).then(|| {
            self.timed.push(name);
            2 * (self.timed.len() as u32 - 1)
        })
    }

    /// A timestamp after all work so far, and a full barrier behind it: without the barrier a device may let
    /// later work start first (or record the stamp late), and its time is booked to the wrong pass.
    pub(super) fn stamp(&self, gpu: &Gpu, commands: vk::CommandBuffer, query: u32) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(all)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(all)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is being recorded outside of a rendering scope; the query was reset when
        // the frame began and is written once.
        unsafe {
            gpu.device
                .cmd_write_timestamp2(commands, all, self.timestamps, query);
            gpu.device.cmd_pipeline_barrier2(commands, &info);
        }
    }

    /// Begins the counters of a pass, inside of its rendering scope; `None` when nothing is counted.
    pub(super) fn begin_counters(
        &mut self,
        gpu: &Gpu,
        commands: vk::CommandBuffer,
        name: &'static str,
        (loaded_bytes, stored_bytes): (u64, u64),
    ) -> Option<PassCounting> {
        if !self.measure.counters || self.counted.len() >= MAX_PASSES as usize {
            return None;
        }
        self.counted.push(PassCounters {
            name,
            loaded_bytes,
            stored_bytes,
            samples: None,
            pipeline: None,
        });
        let counting = PassCounting {
            query: self.counted.len() as u32 - 1,
            pools: [self.samples, self.pipeline],
        };
        let flags = [
            vk::QueryControlFlags::PRECISE,
            vk::QueryControlFlags::empty(),
        ];
        for (pool, flags) in counting.pools.into_iter().zip(flags) {
            if pool != vk::QueryPool::null() {
                // SAFETY: the command buffer is being recorded inside of a rendering scope without views; the
                // query was reset when the frame began; of each kind one is open at a time; precise counts are
                // enabled wherever the pool of samples is there.
                unsafe {
                    gpu.device
                        .cmd_begin_query(commands, pool, counting.query, flags);
                }
            }
        }
        Some(counting)
    }

    /// Reads what the finished frame of this slot reported.
    pub(super) fn read(&mut self, gpu: &Gpu) -> Result<QueryReport, Error> {
        let mut report = QueryReport::default();
        let mut ticks = [0u64; 2 * MAX_PASSES as usize];
        let ticks = &mut ticks[..2 * self.timed.len()];
        let mut frame = [0u64; 2];
        if self.is_idle {
            report.device.frame_ms = self.measure.frame.then_some(0.0);
            return Ok(report);
        }
        if !ticks.is_empty() {
            results(gpu, self.timestamps, 0, ticks)?;
        }
        if self.measure.frame {
            results(gpu, self.timestamps, FRAME_QUERY, &mut frame)?;
            report.device.frame_ms = Some(gpu.info.ms_between(frame[0], frame[1]));
            report.device.first_tick = frame[0];
        } else {
            report.device.first_tick = ticks.first().copied().unwrap_or_default();
        }
        for (pair, &name) in ticks.chunks_exact(2).zip(&self.timed) {
            report.passes.push(PassTime {
                name,
                ms: gpu.info.ms_between(pair[0], pair[1]).max(0.0),
            });
            let start = gpu.info.ms_between(report.device.first_tick, pair[0]);
            report.device.starts_ms.push(start);
        }
        if self.counted.is_empty() {
            return Ok(report);
        }
        let null = vk::QueryPool::null();
        if self.samples != null {
            let mut samples = [0u64; MAX_PASSES as usize];
            let samples = &mut samples[..self.counted.len()];
            results(gpu, self.samples, 0, samples)?;
            for (pass, &count) in self.counted.iter_mut().zip(&*samples) {
                pass.samples = Some(count);
            }
        }
        if self.pipeline != null {
            let mut rows = [[0u64; 6]; MAX_PASSES as usize];
            let rows = &mut rows[..self.counted.len()];
            results(gpu, self.pipeline, 0, rows)?;
            for (pass, row) in self.counted.iter_mut().zip(&*rows) {
                // In the order of the flags' bits.
                pass.pipeline = Some(PipelineStatistics {
                    input_vertices: row[0],
                    input_primitives: row[1],
                    vertex_invocations: row[2],
                    clipping_invocations: row[3],
                    clipping_primitives: row[4],
                    fragment_invocations: row[5],
                });
            }
        }
        report.counters.clone_from(&self.counted);
        Ok(report)
    }

    /// Hands the pools to the deferred destruction.
    pub(super) fn bury(&self, gpu: &Gpu) {
        for pool in [self.timestamps, self.samples, self.pipeline] {
            gpu.bury(RetiredResource::QueryPool(pool));
        }
    }
}

/// The results of queries that a finished submission wrote; a `T` holds one query's 64-bit values.
fn results<T: bytemuck::Pod>(
    gpu: &Gpu,
    pool: vk::QueryPool,
    first: u32,
    out: &mut [T],
) -> Result<(), Error> {
    // SAFETY: the queries were written by a submission that has finished, and `T` is plain 64-bit words, as many
    // as a query of the pool has.
    unsafe {
        gpu.device
            .get_query_pool_results(pool, first, out, vk::QueryResultFlags::TYPE_64)
    }
    .map_err(Error::vulkan("vkGetQueryPoolResults", "a frame"))
}

/// Report of a finished frame.
#[derive(Debug, Default)]
pub(super) struct QueryReport {
    pub(super) passes: Vec<PassTime>,
    pub(super) device: DeviceTimes,
    pub(super) counters: Vec<PassCounters>,
}

/// Open counters of a pass.
pub(super) struct PassCounting {
    query: u32,
    pools: [vk::QueryPool; 2],
}

impl PassCounting {
    /// Ends the counters, inside of the same rendering scope.
    pub(super) fn end(self, gpu: &Arc<Gpu>, commands: vk::CommandBuffer) {
        for pool in self.pools {
            if pool != vk::QueryPool::null() {
                // SAFETY: begun in this rendering scope by `SlotQueries::begin_counters`.
                unsafe { gpu.device.cmd_end_query(commands, pool, self.query) };
            }
        }
    }
}
