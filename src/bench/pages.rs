//! Paged files beside whole trees: bytes at rest, building piece by piece, opening, decoding, the cut, and how near the
//! pictures are.
//!
//! Each model is measured as it is, and as the cloud of its vertices; both without colors and with some. Files are built
//! from binary PLY as `surfel build --memory` does, in the system's folder for temporary files.

use super::cases::{self, SIZE, views};
use super::verdict::BenchTarget;
use super::{BenchCase, BenchError, BenchFigure, BenchPlace, BenchPlan, BenchSession};
use crate::cut::{Cut, CutSelector, ZeroAreaSet};
use crate::generate::ply;
use crate::image::compare;
use crate::math::octahedral;
use crate::mesh::Mesh;
use crate::pages::external::{self, ExternalOptions, ExternalReport};
use crate::pages::file::PagedFile;
use crate::pages::format::PageEntry;
use crate::pages::page::DecodeOptions;
use crate::pages::source::{ByteSource, FileSource, MemorySource};
use crate::pages::write::{PagedOptions, to_bytes};
use crate::progress::{Progress, SilentProgress};
use crate::render::PictureOutputs;
use crate::render::cut_key::CutKey;
use crate::render::engine::{Backend, Engine};
use crate::render::frame_plan::resolve_settings;
use crate::render::paged_model::{PagedModel, PagedModelOptions};
use crate::tree::{self, BuildOptions, Model};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

const PART: &str = "pages";

/// Bytes of pages in memory: those of every standard model.
const ENOUGH: u64 = 8 << 30;

/// A model in one of the forms that are measured.
#[derive(Debug, Clone, Copy)]
struct PagedForm {
    is_cloud: bool,
    has_colors: bool,
}

impl PagedForm {
    const ALL: [Self; 4] = [
        Self::new(false, false),
        Self::new(false, true),
        Self::new(true, false),
        Self::new(true, true),
    ];

    const fn new(is_cloud: bool, has_colors: bool) -> Self {
        Self {
            is_cloud,
            has_colors,
        }
    }

    fn line(self) -> &'static str {
        match (self.is_cloud, self.has_colors) {
            (false, false) => "surface",
            (false, true) => "surface with colors",
            (true, false) => "points",
            (true, true) => "points with colors",
        }
    }

    /// Most bytes a leaf of its file: QSplat's and a byte for clouds, the best that is published for surfaces.
    fn most_bytes(self) -> f64 {
        match (self.is_cloud, self.has_colors) {
            (false, _) => 16.0,
            (true, false) => 7.0,
            (true, true) => 9.0,
        }
    }

    /// The model in this form; colors go by the position.
    fn mesh(self, model: &Model) -> Mesh {
        let vertices = &model.vertices;
        let scale = 1.0 / model.orbit_radius.max(f32::MIN_POSITIVE);
        let color = |p: glam::Vec3| {
            let [r, g, b] = ((p - model.orbit_center) * scale).to_array();
            let level = |x: f32| (x * 100.0 + 128.0) as u8;
            [level(r), level(g), level(b), 255]
        };
        Mesh {
            positions: vertices.iter().map(|v| v.position).collect(),
            normals: vertices
                .iter()
                .map(|v| octahedral::decode(v.normal))
                .collect(),
            colors: match self.has_colors {
                true => vertices.iter().map(|v| color(v.position)).collect(),
                false => Vec::new(),
            },
            triangles: match self.is_cloud {
                true => Vec::new(),
                false => model.triangles.clone(),
            },
            origin: model.origin,
            ..Mesh::default()
        }
    }
}

/// Measures a model in every form.
///
/// # Errors
/// A file cannot be written; a frame cannot be drawn; `progress` is cancelled.
pub fn figures(
    _session: &BenchSession,
    case: &BenchCase<'_>,
    plan: &BenchPlan,
    progress: &dyn Progress,
) -> Result<Vec<BenchFigure>, BenchError> {
    progress.stage(
        &format!("pages of {}", case.name),
        PagedForm::ALL.len() as u64,
    );
    let mut figures = Vec::new();
    for form in PagedForm::ALL {
        if progress.is_cancelled() {
            return Err(BenchError::Cancelled);
        }
        let mesh = form.mesh(case.model);
        let place = BenchPlace {
            size: (0, 0),
            fill: 0.0,
            ..case.place(SIZE, 1.0)
        };
        let measured = MeasuredForm { form, place };
        if !form.has_colors {
            measured.build(&mesh, plan, &mut figures)?;
        }
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress)?;
        measured.whole(&model, plan, &mut figures)?;
        progress.advance(1);
    }
    Ok(figures)
}

/// A form with its place in the rows.
#[derive(Debug)]
struct MeasuredForm {
    form: PagedForm,
    place: BenchPlace,
}

fn seconds<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let done = work();
    (start.elapsed().as_secs_f64(), done)
}

impl MeasuredForm {
    fn figure(&self, name: &str, value: f64, unit: &'static str) -> BenchFigure {
        BenchFigure::new(PART, &self.place, self.form.line(), name, value, unit)
    }

    fn median(&self, name: &str, values: &[f64], unit: &'static str) -> BenchFigure {
        BenchFigure::median(PART, &self.place, self.form.line(), name, values, unit)
    }

    /// The building of a file from binary PLY, and its opening.
    fn build(
        &self,
        mesh: &Mesh,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let folder = tempfile::tempdir()?;
        let input = folder.path().join("model.ply");
        let output = folder.path().join("model.surfel");
        ply::write(mesh, &input, &SilentProgress)?;
        let mut rates = Vec::new();
        let mut report = ExternalReport::default();
        for _ in 0..plan.rounds.clamp(1, 3) {
            let (time, built) = seconds(|| built_of(&input, &output));
            report = built?;
            rates.push(report.leaves as f64 / time / 1e6);
        }
        let length = std::fs::metadata(&output).map_or(0, |facts| facts.len());
        let rate = self.median("built from binary PLY", &rates, "M leaves/s");
        figures.push(rate.target(Some(BenchTarget::AtLeast(1.5))));
        let part = report.temporary_bytes as f64 / length.max(1) as f64;
        let temporary = self.figure("temporary bytes over the file's", part, "x");
        figures.push(temporary.target(Some(BenchTarget::AtMost(2.2))));
        self.open(&output, plan, figures)
    }

    /// The time from opening a file to the first picture of it, and to the whole one, by the processor.
    fn open(
        &self,
        path: &Path,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let (mut first, mut whole, mut resident) = (Vec::new(), Vec::new(), 0);
        for _ in 0..plan.rounds.clamp(1, 9) {
            for (waits, times) in [
                (Some(Duration::ZERO), &mut first),
                (None::<Duration>, &mut whole),
            ] {
                let (time, drawn) = seconds(|| first_picture(path, waits));
                resident = drawn?;
                times.push(time * 1e3);
            }
        }
        let note = format!("{resident} bytes of pages for the whole picture");
        let first = self.median("opened, first picture", &first, "ms");
        figures.push(first.target(Some(BenchTarget::AtMost(100.0))));
        figures.push(
            self.median("opened, whole picture", &whole, "ms")
                .note(note),
        );
        Ok(())
    }

    /// Comparisons of the file with the whole tree.
    fn whole(
        &self,
        model: &Model,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let bytes = to_bytes(model, &PagedOptions::default())?;
        let leaves = model.tree.leaves.len().max(1) as f64;
        let at_rest = self.figure("file", bytes.len() as f64 / leaves, "bytes/leaf");
        let today = model.memory_bytes().total() as f64 / leaves;
        figures.push(
            at_rest
                .target(Some(BenchTarget::AtMost(self.form.most_bytes())))
                .note(format!("{today:.1} bytes a leaf in memory as a whole")),
        );
        let source: Arc<dyn ByteSource> = Arc::new(MemorySource::new("pages", bytes));
        let file = PagedFile::open(source).map_err(crate::tree::Error::from)?;
        if !self.form.has_colors {
            self.decode(&file, plan, figures)?;
            self.cut(model, &file, plan, figures)?;
        }
        self.pictures(model, &file, plan, figures)
    }

    /// Decoding of all pages with leaves, by one thread.
    fn decode(
        &self,
        file: &PagedFile,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let pages = leaf_pages(file)?;
        let mut rates = Vec::new();
        for _ in 0..plan.rounds.clamp(1, 5) {
            let (time, leaves) = seconds(|| -> Result<u64, BenchError> {
                let mut leaves = 0;
                for page in &pages {
                    let page = file.read_page(page, in_space_of(file));
                    let page = page.map_err(crate::tree::Error::from)?;
                    leaves += u64::from(page.model.tree.leaf_count());
                }
                Ok(leaves)
            });
            rates.push(leaves? as f64 / time / 1e6);
        }
        let rate = self.median("decoded, one thread", &rates, "M leaves/s");
        figures.push(rate.target(Some(BenchTarget::AtLeast(60.0))));
        Ok(())
    }

    /// The cut over pages, and over the whole tree, in turn.
    fn cut(
        &self,
        model: &Model,
        file: &PagedFile,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let settings = cases::default(1.0).settings;
        let views = views(model, SIZE, 1.0, plan.views.clamp(2, 12))?;
        let mut pages = opened(file.clone(), None)?;
        for view in &views {
            pages.load(view, &settings, &SilentProgress)?;
        }
        let mut selector = CutSelector::default();
        let mut cut = Cut::default();
        let undrawn = ZeroAreaSet::new(model);
        let mut times = [vec![], vec![]];
        for round in 0..=plan.rounds.clamp(1, 5) {
            for view in &views {
                let own = resolve_settings(&settings, model, view);
                let key = CutKey::of(&own, &model.into(), view);
                let select = || key.select(&mut selector, model, || &undrawn, &mut cut);
                let (whole, ()) = seconds(select);
                let (paged, prepared) = seconds(|| pages.prepare(view, &settings));
                prepared?;
                if round > 0 {
                    times[0].push(whole * 1e3);
                    times[1].push(paged * 1e3);
                }
            }
        }
        let [whole, paged] = times.map(|times| self.median("", &times, "ms"));
        let ratio = paged.value / whole.value;
        for (name, figure) in [
            ("cut of the whole tree", whole),
            ("the same over pages", paged),
        ] {
            let name = name.to_owned();
            figures.push(BenchFigure { name, ..figure });
        }
        let ratio = self.figure("cut over pages over that of the whole tree", ratio, "x");
        figures.push(ratio.target(Some(BenchTarget::AtMost(1.25))));
        Ok(())
    }

    /// Pictures of the whole tree, and of the file, at a threshold of a pixel.
    fn pictures(
        &self,
        model: &Model,
        file: &PagedFile,
        plan: &BenchPlan,
        figures: &mut Vec<BenchFigure>,
    ) -> Result<(), BenchError> {
        let settings = cases::default(1.0).settings;
        let backend = Backend::Cpu;
        let outputs = PictureOutputs::default();
        let pages = opened(file.clone(), None)?;
        let stand_in = pages.stand_in().clone();
        let mut exact = Engine::new(&backend, model, SIZE, outputs)?;
        let mut quantized = Engine::new(&backend, &stand_in, SIZE, outputs)?;
        quantized.set_pages(0, pages);
        let mut psnr = Vec::new();
        for view in &views(model, SIZE, 1.0, plan.error_views.max(1))? {
            let exact = exact.render(view, &settings)?;
            let quantized = quantized.render(view, &settings)?;
            psnr.push(compare(&exact, &quantized, 1.0)?.whole.psnr_db);
        }
        let least = psnr.iter().copied().fold(f64::INFINITY, f64::min);
        let name = "picture beside the exact tree's, threshold 1";
        let near = self.median(name, &psnr, "dB");
        figures.push(
            near.target(Some(BenchTarget::AtLeast(40.0)))
                .note(format!("least {least:.1}")),
        );
        Ok(())
    }
}

/// Builds a file of a PLY file by the options of `surfel build`.
fn built_of(input: &Path, output: &Path) -> Result<ExternalReport, BenchError> {
    let options = crate::input::ReadOptions::default();
    let opened = crate::input::open_stream(input, &options, &SilentProgress)?;
    let Some(model) = opened else {
        unreachable!("binary PLY is read piece by piece")
    };
    let stream = model.stream.as_ref();
    Ok(external::build(
        stream,
        &ExternalOptions::default(),
        output,
        &SilentProgress,
    )?)
}

fn in_space_of(file: &PagedFile) -> DecodeOptions {
    DecodeOptions {
        moments: false,
        model_origin: Some(file.origin()),
    }
}

/// Entries of all pages that have leaves.
fn leaf_pages(file: &PagedFile) -> Result<Vec<PageEntry>, BenchError> {
    let mut wanted: Vec<PageEntry> = file.root().into_iter().collect();
    let mut leaves = Vec::new();
    while let Some(entry) = wanted.pop() {
        let page = file.read_page(&entry, in_space_of(file));
        match &page.map_err(crate::tree::Error::from)?.children {
            Some(below) => wanted.extend(below.entries.iter().copied()),
            None => leaves.push(entry),
        }
    }
    Ok(leaves)
}

fn opened(file: PagedFile, longest_wait: Option<Duration>) -> Result<PagedModel, BenchError> {
    let options = PagedModelOptions {
        memory_bytes: ENOUGH,
        longest_wait,
        ..PagedModelOptions::default()
    };
    Ok(PagedModel::open(file, options).map_err(crate::tree::Error::from)?)
}

/// Opens a file, draws it by the processor, and gives the bytes of pages that it took. Without a wait the picture has what
/// is there with the first page.
fn first_picture(path: &Path, longest_wait: Option<Duration>) -> Result<u64, BenchError> {
    let source = FileSource::open(path)?;
    let file = PagedFile::open(Arc::new(source)).map_err(crate::tree::Error::from)?;
    let mut pages = opened(file, longest_wait)?;
    let stand_in = pages.stand_in().clone();
    let view = views(&stand_in, SIZE, 1.0, 1)?[0];
    let settings = cases::default(1.0).settings;
    pages.load(&view, &settings, &SilentProgress)?;
    let bytes = pages.resident_bytes();
    let mut engine = Engine::new(&Backend::Cpu, &stand_in, SIZE, PictureOutputs::default())?;
    engine.set_pages(0, pages);
    engine.render(&view, &settings)?;
    Ok(bytes)
}
