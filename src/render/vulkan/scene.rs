//! A model on the device: vertices and, for the methods that draw every triangle, indices.

use crate::abi::Vertex;
use crate::cut::ZeroAreaSet;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::render::model_facts::ModelFacts;
use crate::tree::Model;
use std::ops::Range;
use std::sync::Arc;

/// Largest buffer of a scene unless the device allows less: larger models are split into pages.
const PAGE_BYTES: u64 = 1 << 30;

/// A run of triangles whose vertices lie in one vertex buffer.
#[derive(Debug)]
pub struct ScenePage {
    /// Vertices of the page.
    pub vertices: DeviceBuffer,
    /// Number of vertices that points draw.
    pub vertex_count: u32,
    /// Corner indices of all triangles of the page, made when a method first draws them all.
    pub indices: Option<DeviceBuffer>,
    /// Triangles (leaves) of the page.
    pub triangles: Range<u32>,
    /// Corners in page-local indices; `None` when the model's own indices are right (a single page).
    local: Option<Vec<[u32; 3]>>,
}

impl ScenePage {
    /// Corners of the page's triangles, first the one with id `triangles.start`.
    pub fn corners<'a>(&'a self, model: &'a Model) -> &'a [[u32; 3]] {
        match &self.local {
            Some(local) => local,
            None => &model.triangles[self.triangles.start as usize..self.triangles.end as usize],
        }
    }
}

/// A model on the device.
#[derive(Debug)]
pub struct DeviceScene {
    /// Pages in tree order.
    pub pages: Vec<ScenePage>,
    facts: ModelFacts,
    gpu: Arc<Gpu>,
}

impl DeviceScene {
    /// Copies a model to the device, split into pages where a buffer would be larger than the device allows.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn new(gpu: &Arc<Gpu>, model: &Model) -> Result<Self, Error> {
        let info = gpu.info();
        let limit = PAGE_BYTES.min(info.max_buffer).min(info.max_allocation);
        let vertices = limit / size_of::<Vertex>() as u64;
        let vertices = if info.has_full_index {
            vertices
        } else {
            vertices.min((1 << 24) - 1)
        };
        Self::with_page_limits(gpu, model, vertices as usize, (limit / 12) as usize)
    }

    /// As [`new`](DeviceScene::new), with the most vertices (at least 3) and triangles of a page given.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn with_page_limits(
        gpu: &Arc<Gpu>,
        model: &Model,
        max_vertices: usize,
        max_triangles: usize,
    ) -> Result<Self, Error> {
        let (max_vertices, max_triangles) = (max_vertices.max(3), max_triangles.max(1));
        let used = &model.vertices[..model.used_vertices as usize];
        let mut pages = Vec::new();
        if used.len() <= max_vertices && model.triangles.len() <= max_triangles {
            pages.push(ScenePage {
                vertices: upload(gpu, "vertices", used)?,
                vertex_count: used.len() as u32,
                indices: None,
                triangles: 0..model.triangles.len() as u32,
                local: None,
            });
        } else if !model.kind().is_surface() {
            for (index, chunk) in used.chunks(max_vertices).enumerate() {
                pages.push(ScenePage {
                    vertices: upload(gpu, &format!("vertices, page {index}"), chunk)?,
                    vertex_count: chunk.len() as u32,
                    indices: None,
                    triangles: 0..0,
                    local: Some(Vec::new()),
                });
            }
        } else {
            // Vertices that triangles of two pages share are copied into both.
            const NOWHERE: u32 = u32::MAX;
            let mut place = vec![(NOWHERE, 0u32); used.len()];
            let mut first = 0usize;
            while first < model.triangles.len() {
                let page = pages.len() as u32;
                let mut own: Vec<Vertex> = Vec::new();
                let mut local: Vec<[u32; 3]> = Vec::new();
                for corners in &model.triangles[first..] {
                    let new = corners
                        .iter()
                        .filter(|&&c| place[c as usize].0 != page)
                        .count();
                    if own.len() + new > max_vertices || local.len() == max_triangles {
                        break;
                    }
                    local.push(corners.map(|c| {
                        let entry = &mut place[c as usize];
                        if entry.0 != page {
                            *entry = (page, own.len() as u32);
                            own.push(used[c as usize]);
                        }
                        entry.1
                    }));
                }
                let end = first + local.len();
                pages.push(ScenePage {
                    vertices: upload(gpu, &format!("vertices, page {page}"), &own)?,
                    vertex_count: own.len() as u32,
                    indices: None,
                    triangles: first as u32..end as u32,
                    local: Some(local),
                });
                first = end;
            }
        }
        Ok(Self {
            pages,
            facts: ModelFacts::of(model),
            gpu: gpu.clone(),
        })
    }

    /// Facts of its model.
    pub(crate) fn facts(&self) -> &ModelFacts {
        &self.facts
    }

    /// Nodes and leaves without area; found at the first call.
    pub(super) fn undrawn(&self, model: &Model) -> &ZeroAreaSet {
        self.facts.undrawn(model)
    }

    /// Number that no other scene of this process has or had.
    pub(super) fn id(&self) -> u64 {
        self.facts.id()
    }

    /// Whether the copy is on this device, and not on one that was there before it.
    pub fn is_on(&self, gpu: &Arc<Gpu>) -> bool {
        Arc::ptr_eq(&self.gpu, gpu)
    }

    /// Makes sure that every page has its index buffer; waits for the copy the first time.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn ensure_indices(&mut self, model: &Model) -> Result<(), Error> {
        for (index, page) in self.pages.iter_mut().enumerate() {
            if page.indices.is_none() && !page.triangles.is_empty() {
                let name = format!("indices, page {index}");
                let corners = page.corners(model);
                let buffer = DeviceBuffer::with_data(
                    &self.gpu,
                    &name,
                    BufferUsage::Index,
                    bytemuck::cast_slice(corners),
                )?;
                page.indices = Some(buffer);
            }
        }
        Ok(())
    }
}

fn upload(gpu: &Arc<Gpu>, name: &str, vertices: &[Vertex]) -> Result<DeviceBuffer, Error> {
    DeviceBuffer::with_data(
        gpu,
        name,
        BufferUsage::Vertex,
        bytemuck::cast_slice(vertices),
    )
}
