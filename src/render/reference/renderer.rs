//! Whole frames by the reference: cut, pack, draw.

use crate::abi::{FilteredSplat, OrientedPolygon, Splat, Vertex, WeightedSplat};
use crate::cut::{Cut, CutSelector};
use crate::image::Image;
use crate::math::camera::View;
use crate::pack;
use crate::pack::splats::{SplatPlan, SplatRecord};
use crate::pack::{ColorBy, DrawList, FilteredList, FuzzyList, ListTextures, PrimitiveStyle};
use crate::render::PictureOutputs;
use crate::render::backdrop::BackgroundGradient;
use crate::render::frame_constants::{eye_dome_exponent, occlusion_slack, openness_power};
use crate::render::frame_plan::{FramePlan, RecordFormat};
use crate::render::model_facts::{DrawnFacts, DrawnParts};
use crate::render::pack_params::largest_splat_px;
use crate::render::part_cuts::{PartCuts, PatchPlaces};
use crate::render::reference::ambient_occlusion::PixelSurroundings;
use crate::render::reference::eye_dome::darken;
use crate::render::reference::{BlendPasses, HoleFilling, OverdrawList, PolygonList};
use crate::render::stats::FrameCounts;
use crate::render::stats::FrameStage;
use crate::render::stats::FrameTimes;
use crate::render::stats::OverdrawSummary;
use crate::render::technique::Technique;
use crate::render::{Blend, Method, Settings, Shading, SplatKind};
use crate::textures::{TextureImage, TexturePoint};
use crate::tree::Model;
use bytemuck::Zeroable;
use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

/// Draws frames on the CPU, and keeps the last.
#[derive(Debug)]
pub(in crate::render) struct ReferenceRenderer {
    pub(in crate::render) outputs: PictureOutputs,
    /// As [`PrimitiveStyle::subpixel_bits`].
    subpixel_bits: u32,
    /// As [`PrimitiveStyle::albedo`].
    albedo: f32,
    selector: CutSelector,
    cuts: PartCuts,
    /// The picture of the last frame.
    pub(in crate::render) image: Image,
    /// Of the last frame, where overdraw was counted.
    pub(in crate::render) counts: Option<Vec<u32>>,
}

/// What one frame draws: splats of one kind at most.
#[derive(Default)]
struct PackedLists<'m> {
    /// Triangles of the model, or of the cut.
    triangles: Cow<'m, [[u32; 3]]>,
    splats: Vec<Splat>,
    weighted: Vec<WeightedSplat>,
    filtered: Vec<FilteredSplat>,
    polygons: Vec<OrientedPolygon>,
    /// Places of patches in images, where images are shown.
    patch_textures: PatchPlaces,
    /// Vertices of all models.
    vertices: Cow<'m, [Vertex]>,
    textures: Option<JoinedTextures>,
    /// Vertices are drawn as points.
    has_points: bool,
}

impl ReferenceRenderer {
    pub(in crate::render) fn new(outputs: PictureOutputs) -> Self {
        let PrimitiveStyle {
            subpixel_bits,
            albedo,
            ..
        } = PrimitiveStyle::default();
        Self {
            outputs,
            subpixel_bits,
            albedo,
            selector: CutSelector::default().with_subpixel_bits(subpixel_bits),
            cuts: PartCuts::default(),
            image: Image::default(),
            counts: None,
        }
    }

    /// Takes the binary places of window positions from a device; see [`PrimitiveStyle::subpixel_bits`].
    pub(in crate::render) fn set_subpixel_bits(&mut self, bits: u32) {
        self.subpixel_bits = bits;
        self.selector = CutSelector::default().with_subpixel_bits(bits);
    }

    /// Takes another [`PrimitiveStyle::albedo`], for pictures that are to be wrong.
    pub(in crate::render) fn set_albedo(&mut self, albedo: f32) {
        self.albedo = albedo;
    }

    /// Draws a planned frame.
    pub(in crate::render) fn draw_frame(
        &mut self,
        plan: &FramePlan,
        parts: DrawnParts<'_>,
    ) -> FrameTimes {
        let start = Instant::now();
        let mut times = FrameTimes::default();
        times.starts.frame = Some(start);
        let style = PrimitiveStyle {
            depth_range: plan.context.depth_range,
            subpixel_bits: self.subpixel_bits,
            albedo: self.albedo,
            ..style(&plan.settings, plan.facts)
        };
        let mut lists = PackedLists::default();
        match plan.settings.method {
            Method::Triangles => {
                let all = parts
                    .iter()
                    .map(|part| Cow::Borrowed(&part.model.triangles[..]));
                lists.triangles = joined_triangles(parts, all.collect());
            }
            Method::Points => lists.has_points = true,
            Method::Splats | Method::Pop => {
                let cutting = FrameStage::Cut.begin();
                self.cuts
                    .select(&mut self.selector, parts, |part| plan.cut_of(part));
                cutting.end(&mut times);
                let packing = FrameStage::Pack.begin();
                lists = self.pack_cuts(plan, parts);
                packing.end(&mut times);
                times.counts = self.cuts.frame_counts();
            }
        }
        lists.vertices = joined_vertices(parts);
        lists.textures = JoinedTextures::of(parts);
        lists.count(&mut times.counts);
        self.draw_lists(plan, &style, &lists);
        if let Some(counts) = &self.counts {
            times.overdraw = Some(OverdrawSummary::of(counts.iter().copied()));
            self.image.color = crate::render::reference::show_overdraw(counts, &style);
        }
        times.frame_ms = start.elapsed().as_secs_f64() * 1e3;
        times
    }

    /// The draw lists of the cuts, one part after the other.
    fn pack_cuts<'m>(&mut self, plan: &FramePlan, parts: DrawnParts<'m>) -> PackedLists<'m> {
        let FramePlan { view, settings, .. } = plan;
        let records = plan.records(plan.max_point_px);
        let mut lists = PackedLists {
            polygons: self
                .cuts
                .polygons(parts, settings.color_by == ColorBy::Level),
            patch_textures: match plan.primitives.textures_patches {
                true => self.cuts.joined_patch_textures(parts),
                false => PatchPlaces::default(),
            },
            ..PackedLists::default()
        };
        let mut corners = Vec::new();
        for (part, cut) in parts.iter().zip(self.cuts.iter_mut()) {
            let model = part.model;
            match records {
                RecordFormat::Splats(plan) => {
                    (lists.splats).append(&mut packed_splats(model, cut, view, &plan));
                }
                RecordFormat::Weighted(plan) | RecordFormat::Fuzzy(plan, _) => {
                    (lists.weighted).append(&mut packed_splats(model, cut, view, &plan));
                }
                RecordFormat::Filtered(shade) => {
                    let large = pack::filtered::take_triangles(model, view, &shade, cut);
                    let most = pack::filtered::splat_count(cut, large);
                    let mut splats = vec![FilteredSplat::zeroed(); most];
                    let count = pack::filtered::splats(model, cut, large, view, shade, &mut splats);
                    splats.truncate(count);
                    lists.filtered.append(&mut splats);
                }
                RecordFormat::Nothing => {}
            }
            if plan.primitives.has_triangles {
                let of = |&id: &u32| model.triangles[id as usize];
                corners.push(Cow::Owned(cut.triangles.iter().map(of).collect()));
            }
        }
        lists.triangles = joined_triangles(parts, corners);
        lists
    }

    /// Draws the picture, and counts overdraw where that is asked for.
    fn draw_lists(&mut self, plan: &FramePlan, style: &PrimitiveStyle, lists: &PackedLists<'_>) {
        let FramePlan {
            facts,
            view,
            settings,
            ..
        } = plan;
        let (vertices, triangles) = (&*lists.vertices, &*lists.triangles);
        let points = lists.points();
        let textures = lists.textures.as_ref().map(JoinedTextures::list);
        let eye_dome = eye_dome_exponent(settings);
        let openness_power = openness_power(settings);
        let is_darkened = eye_dome > 0.0 || openness_power > 0.0;
        let outputs = PictureOutputs {
            depth: self.outputs.depth || is_darkened,
            ..self.outputs
        };
        let opaque = DrawList {
            vertices,
            triangles,
            splats: &lists.splats,
            points,
            textures,
        };
        let fuzzy = FuzzyList {
            vertices,
            triangles,
            splats: &lists.weighted,
            points,
            has_coverage: settings.sums_coverage(facts.kind.is_surface()),
            textures,
        };
        let filtered = FilteredList {
            vertices,
            triangles,
            splats: &lists.filtered,
            textures,
        };
        let (image, list) = match plan.technique {
            Technique::Opaque | Technique::Nothing => (
                crate::render::reference::render(view, &opaque, style, outputs),
                OverdrawList::Opaque(&opaque),
            ),
            Technique::Polygons => {
                let polygons = PolygonList {
                    polygons: &lists.polygons,
                    are_patches: self.cuts.has_patches(),
                    textures: &lists.patch_textures.places,
                    images: &lists.patch_textures.images,
                    covers_rims: plan.primitives.covers_rims,
                };
                let drawn = crate::render::reference::render_with_polygons(
                    view, &opaque, polygons, style, outputs,
                );
                (drawn, OverdrawList::Opaque(&opaque))
            }
            Technique::Visibility => {
                let filling = HoleFilling {
                    reconstruction: settings.reconstruction,
                    largest_px: largest_splat_px(facts, settings),
                };
                let drawn = crate::render::reference::render_visibility_polygons(
                    view,
                    &opaque,
                    &lists.polygons,
                    style,
                    filling,
                    outputs,
                );
                (drawn.image, OverdrawList::Opaque(&opaque))
            }
            Technique::Fuzzy => {
                let passes = BlendPasses::of(settings.blend());
                let are_there = settings.drawn_vertex_splats().is_some();
                let polygons = are_there.then_some(&lists.polygons[..]);
                let drawn = crate::render::reference::render_fuzzy_polygons(
                    view, &fuzzy, polygons, style, passes, outputs,
                );
                (drawn.image, OverdrawList::Fuzzy(&fuzzy))
            }
            Technique::Filtered => {
                let drawn =
                    crate::render::reference::render_filtered(view, &filtered, style, outputs);
                (drawn.image, OverdrawList::Filtered(&filtered))
            }
        };
        self.image = image;
        if openness_power > 0.0 {
            let radius_px = settings.ambient_occlusion_radius_px(view.width, view.height);
            let around = PixelSurroundings::new(view, radius_px, occlusion_slack(facts, view));
            around.darken(&mut self.image, settings.background, openness_power);
        }
        if eye_dome > 0.0 {
            darken(&mut self.image, settings.background, eye_dome);
        }
        if is_darkened && !self.outputs.depth {
            self.image.depth = Vec::new();
        }
        if let Some(gradient) = BackgroundGradient::of(settings) {
            gradient.put_behind(&mut self.image);
        }
        self.counts = (settings.color_by == ColorBy::Overdraw)
            .then(|| crate::render::reference::count_overdraw(view, list, style));
    }
}

impl PackedLists<'_> {
    /// Vertices drawn as points.
    fn points(&self) -> &[Vertex] {
        if self.has_points { &self.vertices } else { &[] }
    }

    /// What there is to draw, and the bytes that were written for it.
    fn count(&self, counts: &mut FrameCounts) {
        let splats = self.splats.len() + self.weighted.len() + self.filtered.len();
        counts.splats = (splats + self.polygons.len()) as u64;
        counts.triangles = self.triangles.len() as u64;
        counts.points = self.points().len() as u64;
        let triangles = match &self.triangles {
            Cow::Borrowed(_) => 0,
            Cow::Owned(triangles) => size_of_val(&triangles[..]),
        };
        let splats = size_of_val(&self.splats[..])
            + size_of_val(&self.weighted[..])
            + size_of_val(&self.filtered[..])
            + size_of_val(&self.polygons[..]);
        counts.draw_list_bytes = (splats + triangles) as u64;
    }
}

impl BlendPasses {
    /// Passes of a kind of blending; of what is not blended the two.
    fn of(blend: Blend) -> Self {
        match blend {
            Blend::DepthThreshold => Self::DepthThreshold,
            Blend::DepthRange => Self::DepthRange,
            Blend::TwoPass | Blend::Opaque => Self::Two,
        }
    }
}

/// The splats of a cut as records.
fn packed_splats<R: SplatRecord + Copy + Send + Zeroable>(
    model: &Model,
    cut: &Cut,
    view: &View,
    plan: &SplatPlan,
) -> Vec<R> {
    let mut splats = vec![R::zeroed(); pack::splats::count(cut, plan)];
    let packed = pack::splats::pack(model, cut, view, plan, &mut splats);
    splats.truncate(packed.points);
    splats
}

/// The vertices that triangles of a model have.
fn used_vertices(model: &Model) -> &[Vertex] {
    &model.vertices[..model.used_vertices as usize]
}

/// Used vertices of all parts, one after the other.
fn joined_vertices(parts: DrawnParts<'_>) -> Cow<'_, [Vertex]> {
    match parts.single() {
        Some(part) => Cow::Borrowed(used_vertices(part.model)),
        None => (parts
            .iter()
            .flat_map(|part| used_vertices(part.model).iter().copied()))
        .collect(),
    }
}

/// Images of all parts, and where [`joined_vertices`] are in them.
struct JoinedTextures {
    points: Vec<TexturePoint>,
    images: Vec<Arc<TextureImage>>,
}

impl JoinedTextures {
    /// Textures of all parts; none where no part has any.
    fn of(parts: DrawnParts<'_>) -> Option<Self> {
        if parts.iter().all(|part| part.model.textures.is_none()) {
            return None;
        }
        let mut joined = Self {
            points: Vec::new(),
            images: Vec::new(),
        };
        for part in parts.iter() {
            let used = part.model.used_vertices as usize;
            let first = joined.images.len() as u32;
            let end = joined.points.len() + used;
            if let Some(textures) = &part.model.textures {
                let points = textures.points.iter().take(used);
                joined.points.extend(points.map(|point| TexturePoint {
                    image: point.image.saturating_add(first),
                    ..*point
                }));
                joined.images.extend(textures.images.iter().cloned());
            }
            joined.points.resize(end, TexturePoint::NOWHERE);
        }
        Some(joined)
    }

    fn list(&self) -> ListTextures<'_> {
        ListTextures {
            points: &self.points,
            images: &self.images,
        }
    }
}

/// Triangles of all parts as corners of [`joined_vertices`].
fn joined_triangles<'m>(
    parts: DrawnParts<'m>,
    mut own: Vec<Cow<'m, [[u32; 3]]>>,
) -> Cow<'m, [[u32; 3]]> {
    if own.len() <= 1 {
        return own.pop().unwrap_or_default();
    }
    let mut first = 0;
    let mut all = Vec::new();
    for (part, own) in parts.iter().zip(own) {
        all.extend(
            own.iter()
                .map(|corners| corners.map(|corner| first + corner)),
        );
        first += part.model.used_vertices;
    }
    Cow::Owned(all)
}

/// How primitives look under `settings`, but for [`PrimitiveStyle::depth_range`], [`PrimitiveStyle::subpixel_bits`] and [`PrimitiveStyle::albedo`].
pub fn style(settings: &Settings, facts: impl Into<DrawnFacts>) -> PrimitiveStyle {
    let facts = facts.into();
    PrimitiveStyle {
        splat_size_px: settings.threshold_px.max(1.0),
        footprint: settings.footprint(),
        is_gauss: settings.splat == SplatKind::Gauss,
        low_pass_px: settings.low_pass_px(),
        is_deferred: settings.shading == Shading::Deferred,
        background: settings.background,
        color_by: settings.color_by,
        cull_back_faces: settings.draws_fronts_only(facts.is_closed),
        light: settings.light.in_model(facts.origin),
        two_sided: settings.two_sided,
        use_colors: settings.use_colors,
        depth_offset: settings.depth_offset(),
        // Of the frame, whose camera and device are not known here.
        ..PrimitiveStyle::default()
    }
}
