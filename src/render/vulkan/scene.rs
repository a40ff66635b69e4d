//! A model on the device: vertices and, for the methods that draw every triangle, indices.

use crate::abi::Vertex;
use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::render::model_facts::{DrawnParts, FactedModel, ModelFacts};
use crate::render::vulkan::device_textures::{self, PageTextures};
use crate::render::vulkan::page_pool::{PagePool, PoolPlace, PooledPage};
use crate::textures::TexturePoint;
use crate::tree::Model;
use std::collections::{HashMap, HashSet};
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
    /// Triangles (leaves) of its model that are in the page.
    pub triangles: Range<u32>,
    /// Corners in page-local indices; `None` when the model's own indices are right (a single page).
    local: Option<Vec<[u32; 3]>>,
    /// Where its vertices are in images, in a scene that has some.
    pub(super) textures: Option<PageTextures>,
    /// The page's model is drawn.
    pub(super) is_shown: bool,
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

/// Models on the device, in one space.
#[derive(Debug)]
pub struct DeviceScene {
    /// Pages of one model after the other, each in tree order.
    pub pages: Vec<ScenePage>,
    parts: Vec<DevicePart>,
    /// Vertices of pages of paged files.
    pool: PagePool,
    held: HashMap<u64, HeldPage>,
    gpu: Arc<Gpu>,
}

/// A model of a scene.
#[derive(Debug, Clone)]
struct DevicePart {
    facts: Arc<ModelFacts>,
    /// Pages of the model among those of the scene.
    pages: Range<usize>,
    is_shown: bool,
}

/// A page of a paged file, which is there while somebody else knows its facts.
#[derive(Debug)]
struct HeldPage {
    facts: Arc<ModelFacts>,
    place: Option<PoolPlace>,
}

/// Most vertices (at least 3) and triangles (at least 1) of a page.
#[derive(Debug, Clone, Copy)]
struct PageLimits {
    vertices: usize,
    triangles: usize,
}

impl PageLimits {
    /// Limits of a device.
    fn of(gpu: &Gpu) -> Self {
        let info = gpu.info();
        let limit = PAGE_BYTES.min(info.max_buffer).min(info.max_allocation);
        let vertices = limit / size_of::<Vertex>() as u64;
        let vertices = match info.has_full_index {
            true => vertices,
            false => vertices.min((1 << 24) - 1),
        };
        Self {
            vertices: vertices as usize,
            triangles: (limit / 12) as usize,
        }
    }
}

impl DeviceScene {
    /// Copies a model to the device, split into pages where a buffer would be larger than the device allows.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn new(gpu: &Arc<Gpu>, model: &Model) -> Result<Self, Error> {
        Self::of_models(gpu, &[model])
    }

    /// Copies models that share one space to the device. All are shown at first.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn of_models(gpu: &Arc<Gpu>, models: &[&Model]) -> Result<Self, Error> {
        Self::limited(gpu, models, PageLimits::of(gpu))
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
        let limits = PageLimits {
            vertices: max_vertices.max(3),
            triangles: max_triangles.max(1),
        };
        Self::limited(gpu, &[model], limits)
    }

    fn limited(gpu: &Arc<Gpu>, models: &[&Model], limits: PageLimits) -> Result<Self, Error> {
        let mut scene = Self {
            pages: Vec::new(),
            parts: Vec::new(),
            pool: PagePool::new(limits.vertices),
            held: HashMap::new(),
            gpu: gpu.clone(),
        };
        for model in models {
            let first = scene.pages.len();
            let is_textured = models.iter().any(|model| model.textures.is_some());
            let texels = match is_textured {
                true => Some(device_textures::upload(gpu, model)?),
                false => None,
            };
            scene
                .pages
                .append(&mut pages_of(gpu, model, limits, texels.as_ref())?);
            scene.parts.push(DevicePart {
                facts: Arc::new(ModelFacts::of(model)),
                pages: first..scene.pages.len(),
                is_shown: true,
            });
        }
        Ok(scene)
    }

    /// Copies pages of paged files that a frame draws triangles of, and that are not here yet; those that nobody else has in
    /// memory are dropped then. `pages` are all that are drawn, `resident` all in memory.
    ///
    /// # Errors
    /// When device memory runs out.
    pub(crate) fn hold<'m>(
        &mut self,
        pages: impl Iterator<Item = (FactedModel<'m>, &'m Arc<ModelFacts>)>,
        resident: impl Iterator<Item = (&'m Model, &'m Arc<ModelFacts>)>,
    ) -> Result<(), Error> {
        let mut is_new = false;
        for (part, facts) in pages {
            let has_triangles = part.cut.is_some_and(|cut| !cut.rest.triangles.is_empty());
            if has_triangles && !self.held.contains_key(&facts.id()) {
                is_new = true;
                let page = HeldPage {
                    facts: facts.clone(),
                    place: None,
                };
                self.held.insert(facts.id(), page);
            }
        }
        if !is_new {
            return Ok(());
        }
        self.held
            .retain(|_, page| Arc::strong_count(&page.facts) > 1);
        let mut ids = Vec::with_capacity(self.held.len());
        let mut placed = Vec::with_capacity(self.held.len());
        for (model, facts) in resident {
            if let Some(page) = self.held.get(&facts.id()) {
                ids.push(facts.id());
                placed.push(PooledPage {
                    vertices: &model.vertices[..model.used_vertices as usize],
                    place: page.place,
                });
            }
        }
        let outcome = self.pool.place_all(&self.gpu, &mut placed);
        if outcome.is_err() {
            self.held.clear();
            self.pool = PagePool::new(PageLimits::of(&self.gpu).vertices);
            return outcome;
        }
        let known: HashSet<u64> = ids.iter().copied().collect();
        self.held.retain(|id, _| known.contains(id));
        for (id, page) in ids.into_iter().zip(placed) {
            if let Some(held) = self.held.get_mut(&id) {
                held.place = page.place;
            }
        }
        Ok(())
    }

    /// Where the triangles of a page of a paged file have their vertices: the index of the buffer as of
    /// [`DeviceScene::vertices_of`], and the first vertex; `None` of a model that is here as a whole.
    pub(crate) fn pooled(&self, part: FactedModel<'_>) -> Option<(usize, u32)> {
        let place = self.held.get(&part.facts.id())?.place?;
        Some((self.pages.len() + place.chunk, place.first))
    }

    /// Vertices of a page, or of pages of paged files together behind those.
    pub(crate) fn vertices_of(&self, index: usize) -> &DeviceBuffer {
        match self.pages.get(index) {
            Some(page) => &page.vertices,
            None => &self.pool.chunks()[index - self.pages.len()].vertices,
        }
    }

    /// All buffers of vertices.
    pub(crate) fn vertex_buffers(&self) -> impl Iterator<Item = &DeviceBuffer> {
        let pages = self.pages.iter().map(|page| &page.vertices);
        pages.chain(self.pooled_buffers())
    }

    /// Buffers with the vertices of pages of paged files.
    pub(crate) fn pooled_buffers(&self) -> impl Iterator<Item = &DeviceBuffer> {
        self.pool.chunks().iter().map(|chunk| &chunk.vertices)
    }

    /// Draws a model from the next frame on, or leaves it out; nothing where there is no model of this index.
    pub fn show(&mut self, part: usize, is_shown: bool) {
        if let Some(part) = self.parts.get_mut(part) {
            part.is_shown = is_shown;
            for page in &mut self.pages[part.pages.clone()] {
                page.is_shown = is_shown;
            }
        }
    }

    /// The models of a frame with the facts of each: those of `models`, all of the scene's, that are shown.
    pub(crate) fn shown<'m>(&self, models: &[&'m Model]) -> Vec<(&'m Model, Arc<ModelFacts>)> {
        debug_assert_eq!(models.len(), self.parts.len(), "the models of the scene");
        let all = models.iter().zip(&self.parts);
        all.filter(|(_, part)| part.is_shown)
            .map(|(&model, part)| (model, part.facts.clone()))
            .collect()
    }

    /// Tells whether the model of this index is drawn.
    #[cfg(feature = "viewer")]
    pub(crate) fn is_shown(&self, index: usize) -> bool {
        self.parts.get(index).is_some_and(|part| part.is_shown)
    }

    /// The pages of models that are shown.
    pub(crate) fn shown_pages(&self) -> impl Iterator<Item = &ScenePage> {
        self.pages.iter().filter(|page| page.is_shown)
    }

    /// Facts of a model of this index, which there must be.
    pub(crate) fn facts_of(&self, index: usize) -> Arc<ModelFacts> {
        self.parts[index].facts.clone()
    }

    /// Pages of a model, with the index of the first.
    pub(crate) fn pages_of(&self, part: FactedModel<'_>) -> (usize, &[ScenePage]) {
        let id = part.facts.id();
        let own = self.parts.iter().find(|own| own.facts.id() == id);
        let pages = own.map_or(0..0, |own| own.pages.clone());
        (pages.start, &self.pages[pages])
    }

    /// Tells whether a model that is shown has textures: then all pages have [`ScenePage::textures`]. Beside pages of paged
    /// files, which have none, the means of textures are drawn.
    pub(super) fn is_textured(&self) -> bool {
        if !self.pool.chunks().is_empty() {
            return false;
        }
        let mut shown = self.parts.iter().filter(|part| part.is_shown);
        shown.any(|part| part.facts.drawn().has_textures)
    }

    /// Number that no other scene of this process has or had.
    pub(super) fn id(&self) -> u64 {
        self.parts.first().map_or(u64::MAX, |part| part.facts.id())
    }

    /// Tells whether the copy is on this device, and not on one that was there before it.
    pub fn is_on(&self, gpu: &Arc<Gpu>) -> bool {
        Arc::ptr_eq(&self.gpu, gpu)
    }

    /// Makes sure that every page has its index buffer; waits for the copy the first time.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn ensure_indices(&mut self, parts: DrawnParts<'_>) -> Result<(), Error> {
        for part in parts.iter() {
            let (first, count) = {
                let (first, pages) = self.pages_of(part);
                (first, pages.len())
            };
            self.ensure_indices_of(part.model, first..first + count)?;
        }
        Ok(())
    }

    fn ensure_indices_of(&mut self, model: &Model, pages: Range<usize>) -> Result<(), Error> {
        for (index, page) in self.pages[pages].iter_mut().enumerate() {
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

/// Copies a model to pages of its own.
///
/// # Errors
/// When device memory runs out.
fn pages_of(
    gpu: &Arc<Gpu>,
    model: &Model,
    limits: PageLimits,
    texels: Option<&Arc<DeviceBuffer>>,
) -> Result<Vec<ScenePage>, Error> {
    let point = |vertex: u32| {
        let points = model.textures.as_ref().map(|textures| &textures.points);
        let point = points.and_then(|points| points.get(vertex as usize));
        point.copied().unwrap_or(TexturePoint::NOWHERE)
    };
    let textures = |vertices: &mut dyn Iterator<Item = u32>| match texels {
        Some(texels) => PageTextures::new(gpu, vertices.map(point), texels).map(Some),
        None => Ok(None),
    };
    let PageLimits {
        vertices: max_vertices,
        triangles: max_triangles,
    } = limits;
    let used = &model.vertices[..model.used_vertices as usize];
    let mut pages = Vec::new();
    if used.len() <= max_vertices && model.triangles.len() <= max_triangles {
        pages.push(ScenePage {
            vertices: upload(gpu, "vertices", used)?,
            vertex_count: used.len() as u32,
            indices: None,
            triangles: 0..model.triangles.len() as u32,
            local: None,
            textures: textures(&mut (0..used.len() as u32))?,
            is_shown: true,
        });
    } else if !model.kind().is_surface() {
        for (index, chunk) in used.chunks(max_vertices).enumerate() {
            pages.push(ScenePage {
                vertices: upload(gpu, &format!("vertices, page {index}"), chunk)?,
                vertex_count: chunk.len() as u32,
                indices: None,
                triangles: 0..0,
                local: Some(Vec::new()),
                textures: textures(&mut std::iter::empty())?,
                is_shown: true,
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
            let mut numbers: Vec<u32> = Vec::new();
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
                        numbers.push(c);
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
                textures: textures(&mut numbers.into_iter())?,
                is_shown: true,
            });
            first = end;
        }
    }
    Ok(pages)
}
