//! A paged file as a frame draws it: the pages that its cut needs and that are in memory, each a part with a cut of its own.
//!
//! Before a frame, `PagedModel::prepare` takes the pages that were read meanwhile, chooses the cut over what is in memory
//! (`src/pages/cut.rs`) and tells the loader which pages would make the picture finer. What is not there yet is drawn as the
//! node that stands for it, so nothing is missing, only coarser.

use crate::cut::{CutSettings, WholeSphere};
use crate::gpu::Error;
use crate::math::camera::View;
use crate::pages::cache::PageCache;
use crate::pages::cut::{
    NeededPage, PageCutSelector, PageHiding, PageQuestion, PageSelectors, PageTests, PagedCut,
};
use crate::pages::file::PagedFile;
use crate::pages::format::{PageEntry, PageError};
use crate::pages::loader::{LoaderOptions, PageLoader};
use crate::pages::page::{DecodeOptions, DecodedPage};
use crate::pages::reading::PageReading;
use crate::patches::PatchCut;
use crate::progress::Progress;
use crate::render::cut_key::{CutKey, LARGEST_HIDDEN_PX, cut_settings};
use crate::render::frame_plan::resolved;
use crate::render::model_facts::{DrawnFacts, FactedModel, ModelFacts, point_radius};
use crate::render::{Culling, Method, Occlusion, Settings};
use crate::tree::{Model, ModelKind, Node};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Amount of a paged file that a picture with these settings needs; all of it where something besides them does.
pub fn page_reading(settings: &Settings, takes_all: bool) -> PageReading {
    if takes_all || settings.method != Method::Pop {
        PageReading::Whole
    } else if settings.drawn_patches().is_some() {
        PageReading::ByPageWithRecords
    } else {
        PageReading::ByPage
    }
}

/// Options of drawing a paged file.
#[derive(Debug, Clone, Copy)]
pub struct PagedModelOptions {
    /// Bytes of pages in memory. What the picture needs first is held first; what does not fit is drawn coarser.
    pub memory_bytes: u64,
    /// Threads that read and decode.
    pub threads: usize,
    /// World position of the zero of the space in which it is drawn; `None` for that of the file.
    pub origin: Option<DVec3>,
    /// The first part of the file, of which pages are read; `None` for all. The first page always is.
    pub prefix: Option<FilePrefix>,
    /// Longest time that [`PagedModel::load`] waits for pages, counted from the opening of the file; `None` for as long as it
    /// takes. It always waits for the first page.
    pub longest_wait: Option<Duration>,
}

/// The first part of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FilePrefix {
    /// Number of bytes.
    Bytes(u64),
    /// Part of the file's bytes, 0 to 1.
    Part(f64),
}

impl FilePrefix {
    /// Part that it is of a file of this length, 0 to 1.
    pub fn part_of(self, length: u64) -> f64 {
        match self {
            Self::Bytes(bytes) => bytes.min(length) as f64 / length.max(1) as f64,
            Self::Part(part) => part.clamp(0.0, 1.0),
        }
    }
}

impl Default for PagedModelOptions {
    /// 1 GiB, and two threads.
    fn default() -> Self {
        Self {
            memory_bytes: 1 << 30,
            threads: 2,
            origin: None,
            prefix: None,
            longest_wait: None,
        }
    }
}

/// Facts of a page in memory.
#[derive(Debug)]
struct PageFacts {
    /// The page that they are of: one that was read anew has others.
    page: Arc<DecodedPage>,
    facts: Arc<ModelFacts>,
    /// Of an upper page that stands for pages which are not there: its leaves are points of any size.
    coarse: Option<Arc<ModelFacts>>,
    /// Median radius of the points of a cloud that it has; else 0.
    point_radius: f32,
}

/// Inputs that decide the cut over pages; equal ones choose the same.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PagedCutKey {
    cut: CutKey,
    /// Number of changes of what is in memory.
    changes: u64,
}

/// A paged file that is drawn while its pages come.
#[derive(Debug)]
pub struct PagedModel {
    file: PagedFile,
    options: PagedModelOptions,
    stand_in: Model,
    facts: DrawnFacts,
    has_colors: bool,
    loader: PageLoader,
    cache: PageCache,
    known: BTreeMap<u32, PageFacts>,
    selector: PageCutSelector,
    cut: PagedCut,
    /// Facts of each part of the cut.
    cut_facts: Vec<Arc<ModelFacts>>,
    /// Key that the cut was chosen for.
    chosen: Option<PagedCutKey>,
    /// Grows with each cut that is chosen.
    generation: u64,
    changes: u64,
    /// Pages that are wanted do not fit beside those that the picture needs.
    is_full: bool,
    /// Part of the file in which the pages lie that may be read, 0 to 1.
    part: f64,
    opened: Instant,
}

impl PagedModel {
    /// Opens a file: reads its header and first page, and starts the threads that read the others.
    ///
    /// # Errors
    /// The first page cannot be read, or the system gives no thread.
    pub fn open(file: PagedFile, options: PagedModelOptions) -> Result<Self, PageError> {
        let origin = options.origin.unwrap_or_else(|| file.origin());
        let decode = DecodeOptions {
            moments: true,
            model_origin: Some(origin),
        };
        let stand_in = file.stand_in(origin)?;
        let facts = DrawnFacts {
            kind: match file.is_surface() {
                true => ModelKind::Surface,
                false => ModelKind::Points,
            },
            // Its leaves stand for pages, and which of those come first is no matter.
            point_radius: 0.0,
            ..DrawnFacts::from(&stand_in)
        };
        let loader_options = LoaderOptions {
            threads: options.threads.max(file.parallel_reads()),
            decode,
            ..LoaderOptions::default()
        };
        let loader =
            PageLoader::new(file.clone(), loader_options).map_err(|error| PageError::Io {
                name: file.name().to_owned(),
                offset: 0,
                end: 0,
                cause: format!("the system gives no thread to read it: {error}"),
            })?;
        Ok(Self {
            has_colors: file.has_colors(),
            part: (options.prefix).map_or(1.0, |prefix| prefix.part_of(file.total_bytes())),
            opened: Instant::now(),
            file,
            options,
            stand_in,
            facts,
            loader,
            cache: PageCache::new(options.memory_bytes),
            known: BTreeMap::new(),
            selector: PageCutSelector::default(),
            cut: PagedCut::default(),
            cut_facts: Vec::new(),
            chosen: None,
            generation: 0,
            changes: 0,
            is_full: false,
        })
    }

    /// The same file to be drawn in the space of a model with this origin, with nothing in memory yet.
    ///
    /// # Errors
    /// As [`PagedModel::open`].
    pub fn moved_to(self, origin: DVec3) -> Result<Self, PageError> {
        let options = PagedModelOptions {
            origin: Some(origin),
            ..self.options
        };
        Self::open(self.file, options)
    }

    /// The file.
    pub fn file(&self) -> &PagedFile {
        &self.file
    }

    /// A model with the first page's nodes and the whole file's box and sphere, for whatever asks where the model is.
    pub fn stand_in(&self) -> &Model {
        &self.stand_in
    }

    /// Facts of the whole file, on which frames rest.
    pub(crate) fn drawn_facts(&self) -> DrawnFacts {
        self.facts
    }

    /// Bytes of the pages in memory.
    pub fn resident_bytes(&self) -> u64 {
        self.cache.bytes()
    }

    /// Number of pages in memory.
    pub fn resident_pages(&self) -> usize {
        self.cache.len()
    }

    /// Number of pages that would make the picture of the last frame finer, and can be had.
    pub fn wanted_pages(&self) -> usize {
        match self.is_full {
            true => 0,
            false => self.cut.wanted.len(),
        }
    }

    /// Tells whether pages came that the last frame did not have.
    pub fn has_news(&self) -> bool {
        self.loader.has_pages()
    }

    /// Messages since the last call, one for each page that failed.
    pub fn messages(&self) -> Vec<String> {
        self.loader.messages()
    }

    /// Error of drawing page by page with these settings; `None` where that can be. The whole model can be drawn so.
    pub(crate) fn refusal(&self, settings: &Settings) -> Option<Error> {
        let (what, why) = if settings.method != Method::Pop {
            (
                "a paged file by a method that draws all of a model",
                "only the pages that the view needs are in memory; leave --method out, or use --method pop",
            )
        } else if settings.drawn_patches().is_some() && !self.file.has_patches() {
            (
                "error patches of this paged file",
                "its pages have no records of them; leave --error out, or build the file with --patches",
            )
        } else {
            return None;
        };
        let why = why.into();
        Some(Error::Unsupported { what, why })
    }

    /// Readies the parts of a frame, and gives the settings that it is drawn with.
    ///
    /// Leaf pages that are in memory hide each other. Where a closed surface surrounds the eye, faces that face away are drawn,
    /// as of whole models.
    ///
    /// # Errors
    /// [`Error::Unsupported`] of methods that draw all of a model: not all of it is in memory.
    pub(crate) fn prepare(&mut self, view: &View, settings: &Settings) -> Result<Settings, Error> {
        if let Some(refusal) = self.refusal(settings) {
            return Err(refusal);
        }
        let settings = *settings;
        self.take_pages();
        let is_inside = |view: &View| {
            view.is_perspective && self.facts.is_closed && surrounds(&self.stand_in, view.eye)
        };
        let mut drawn_with = resolved(&settings, &self.facts, view, is_inside);
        if drawn_with.occlusion == Occlusion::Auto && drawn_with.threshold_px > LARGEST_HIDDEN_PX[2]
        {
            drawn_with.occlusion = Occlusion::Off;
        }
        if drawn_with.culling != Culling::Off {
            drawn_with.culling = settings.culling;
        }
        let cut = CutKey::of(&drawn_with, &self.facts, view);
        let key = PagedCutKey {
            cut,
            changes: self.changes,
        };
        if self.chosen != Some(key) {
            if self.chosen.is_none_or(|old| old.cut != key.cut) {
                self.is_full = false;
            }
            self.choose(&drawn_with, &cut);
            self.chosen = Some(key);
        }
        // The rest is resolved with all that is drawn.
        Ok(Settings {
            culling: drawn_with.culling,
            ..settings
        })
    }

    /// Takes the pages that were read since the last call, and forgets those that went for them.
    fn take_pages(&mut self) {
        for loaded in self.loader.take() {
            let own = NeededPage {
                id: loaded.id,
                size_px: loaded.size_px,
            };
            let change = self.cache.insert(own, loaded.page.clone());
            for id in change.gone {
                self.known.remove(&id);
            }
            self.is_full |= !change.is_held;
            if change.is_held {
                self.know_page(loaded.id, loaded.page);
            }
            self.changes += 1;
        }
    }

    /// Notes facts of a page in memory, unless they are known.
    fn know_page(&mut self, id: u32, page: Arc<DecodedPage>) {
        let (drawn, has_colors) = (self.facts, self.has_colors);
        self.known.entry(id).or_insert_with(|| PageFacts {
            facts: Arc::new(ModelFacts::of_page(drawn, has_colors)),
            coarse: page.children.as_ref().map(|_| {
                let drawn = DrawnFacts {
                    kind: ModelKind::Points,
                    ..drawn
                };
                Arc::new(ModelFacts::of_page(drawn, has_colors))
            }),
            point_radius: match page.children {
                Some(_) => 0.0,
                None => point_radius(&page.model),
            },
            page,
        });
    }

    /// Median radius of a cloud's points, by the pages that are drawn; 0 of a surface, and where only pages above are there.
    fn median_point_radius(&self) -> f32 {
        let known = (self.cut.parts.iter()).filter_map(|part| self.known.get(&part.id));
        let radii = known.map(|own| own.point_radius);
        let mut radii: Vec<f32> = radii.filter(|&radius| radius > 0.0).collect();
        let middle = radii.len() / 2;
        match radii.is_empty() {
            true => 0.0,
            false => *radii.select_nth_unstable_by(middle, f32::total_cmp).1,
        }
    }

    /// Chooses the cut over the pages in memory.
    fn choose(&mut self, settings: &Settings, key: &CutKey) {
        self.generation += 1;
        let cut_settings = cut_settings(settings, self.facts);
        let known = &self.known;
        let alone = key.without_hiding();
        let rules = settings.drawn_patches();
        let choose =
            |selectors: &mut PageSelectors, asked: PageQuestion<'_>, cut: &mut PatchCut| {
                let Some(own) = known.get(&asked.id) else {
                    return;
                };
                let model = &asked.page.model;
                let cull_back = cut_settings.cull_back && !asked.keeps_back;
                if let Some(rules) = &rules {
                    let conditions = own.facts.patches(model).conditions(model, rules.is_strict);
                    let mut by_error = alone.by_error(rules);
                    by_error.cut.cull_back = cull_back;
                    let selector = &mut selectors.by_error;
                    return selector.select(model, conditions, alone.view(), &by_error, cut);
                }
                let (selector, cut) = (&mut selectors.by_size, &mut cut.rest);
                if asked.keeps_back {
                    let both_sides = CutSettings {
                        cull_back,
                        ..cut_settings
                    };
                    return selector.select(model, alone.view(), &both_sides, cut);
                }
                let undrawn = || own.facts.undrawn(model);
                match asked.hiding {
                    Some(PageHiding {
                        depth,
                        tests,
                        marks,
                    }) => {
                        selector.select_part(model, tests, depth, undrawn(), (cut, marks));
                    }
                    None => alone.select(selector, model, undrawn, cut),
                }
            };
        let whole = WholeSphere::of(&self.stand_in);
        let tests = PageTests {
            view: key.view(),
            settings: &cut_settings,
            choose: &choose,
            hides: (key.hiding())
                .filter(|_| rules.is_none())
                .map(|footprints| (footprints, whole)),
        };
        self.selector.recycle(std::mem::take(&mut self.cut));
        self.cut = self.selector.select(self.file.root(), &self.cache, tests);
        self.cache.begin_frame(&self.cut.needed);
        // What stands for pages that are missing has its own sizes.
        let is_coarse = !self.cut.wanted.is_empty();
        let (part, root) = (self.part, self.file.root().map(|root| root.id));
        let may_be_read =
            |entry: &PageEntry| self.file.part_before(entry) <= part || Some(entry.id) == root;
        self.cut.wanted.retain(|wanted| may_be_read(&wanted.entry));
        self.cut.parts.retain(|part| known.contains_key(&part.id));
        let facts_of = |id: &u32| {
            let own = known.get(id)?;
            let coarse = own.coarse.as_ref().filter(|_| is_coarse);
            Some(coarse.unwrap_or(&own.facts).clone())
        };
        let ids = self.cut.parts.iter().map(|part| &part.id);
        self.cut_facts = ids.filter_map(facts_of).collect();
        // Of all that is drawn the largest counts: one has it for all.
        let point_radius = self.median_point_radius();
        if point_radius > 0.0
            && let Some(first) = self.cut_facts.first_mut()
        {
            *first = Arc::new(first.with_point_radius(point_radius));
        }
        match self.is_full {
            true => self.loader.want(&[]),
            false => self.loader.want(&self.cut.wanted),
        }
    }

    /// The parts of the frame that was prepared, each with its cut.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (FactedModel<'_>, &Arc<ModelFacts>)> {
        let parts = self.cut.parts.iter().zip(&self.cut_facts);
        parts.map(|(part, facts)| {
            let facted = FactedModel {
                model: &part.page.model,
                facts,
                cut: Some(&part.cut),
            };
            (facted, facts)
        })
    }

    /// All pages in memory, with their facts.
    pub(crate) fn resident(&self) -> impl Iterator<Item = (&Model, &Arc<ModelFacts>)> {
        self.known.values().map(|own| (&own.page.model, &own.facts))
    }

    /// Number of the present parts and cuts: others have another.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    /// Tells whether it was waited as long as is allowed, and the first page is there.
    fn is_late(&self) -> bool {
        let longest = self.options.longest_wait;
        !self.cache.is_empty() && longest.is_some_and(|longest| self.opened.elapsed() >= longest)
    }

    /// Loads what the picture of a view needs, as far as memory allows, and gives a message for each page that failed: what
    /// stands for it is drawn instead. Ends early where `progress` is cancelled. All pages that a cut wants are read before
    /// the next is chosen: as many cuts as the file has pages one above another.
    ///
    /// # Errors
    /// [`Error::Unsupported`] of methods that draw all of a model.
    pub fn load(
        &mut self,
        view: &View,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Vec<String>, Error> {
        let mut messages = Vec::new();
        progress.stage("read pages", 0);
        loop {
            self.prepare(view, settings)?;
            messages.append(&mut self.loader.messages());
            let is_stuck = self.loader.is_stuck() && !self.loader.has_pages();
            let is_late = self.is_late();
            if is_late {
                self.loader.want(&[]);
            }
            if self.wanted_pages() == 0 || is_stuck || is_late || progress.is_cancelled() {
                return Ok(messages);
            }
            while self.loader.pending() > 0 && !self.loader.is_stuck() && !self.is_full {
                if progress.is_cancelled() || self.is_late() {
                    break;
                }
                self.loader.wait(Duration::from_millis(50));
                let before = self.cache.len();
                self.take_pages();
                let more = self.cache.len().saturating_sub(before);
                progress.advance(more as u64);
            }
        }
    }
}

/// Readies the paged ones of some models for a frame, and gives the settings that it is drawn with.
///
/// # Errors
/// As [`PagedModel::prepare`].
pub(crate) fn prepare_all<'a>(
    pages: impl Iterator<Item = &'a mut PagedModel>,
    view: &View,
    settings: &Settings,
) -> Result<Settings, Error> {
    let mut drawn_with = *settings;
    for own in pages {
        drawn_with = own.prepare(view, &drawn_with)?;
    }
    Ok(drawn_with)
}

/// A number that stands for the cuts of some paged models; 0 of none.
pub(crate) fn generation_of<'a>(pages: impl Iterator<Item = &'a PagedModel>) -> u64 {
    pages.fold(0, |sum: u64, own| {
        sum.wrapping_mul(0x0000_0100_0000_01b3) ^ (own.generation() + 1)
    })
}

/// Tells whether a closed surface surrounds a point, by what the nodes of a page's last level say of it: the sum of their solid
/// angles, each node's taken for that of its vector area at its center. Source: Barill, Dickson, Schmidt, Levin and Jacobson,
/// *Fast Winding Numbers for Soups and Clouds* (2018), order 0. Exact far from the surface; near it by a node's size.
fn surrounds(model: &Model, point: Vec3) -> bool {
    let tree = &model.tree;
    let Some(last) = tree.level_count().checked_sub(1) else {
        return false;
    };
    let solid_angle = |id: u32| {
        let node: &Node = &tree.nodes[id as usize];
        let area = tree.attributes[id as usize].area;
        let unit = crate::tree::SurfaceMoments::UNIT;
        let vector = tree.moments[id as usize].vector_area.map(f32::from);
        let vector = (Vec3::from_array(vector) * (area / unit)).as_dvec3();
        let to = node.center.as_dvec3() - point.as_dvec3();
        let distance = to.length().max(f64::from(node.radius) * 0.5);
        vector.dot(to) / distance.powi(3)
    };
    let sum: f64 = tree.level(last).map(solid_angle).sum();
    sum > 2.0 * std::f64::consts::PI
}

#[cfg(test)]
mod tests;
