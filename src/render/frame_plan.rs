//! The one place where it is decided how a frame is drawn: a plan is made once a frame, from settings, model, view and what
//! the renderer can do, and everything after it obeys. No device is asked, and what cannot be drawn is refused here.
//!
//! One thing can only be decided once the cut is there, since it depends on how much that is: which passes draw it
//! (`PassSelection` in `src/render/cost/select_passes.rs`).

use crate::abi::FrameConstants;
use crate::gpu::Error;
use crate::math::camera::View;
use crate::pack::splats::SplatPlan;
use crate::pack::{ColorBy, filtered, fuzzy};
use crate::patches::PatchRules;
use crate::render::capabilities::RendererCapabilities;
use crate::render::compute_limits;
use crate::render::compute_limits::may_use_compute;
use crate::render::cost::choose;
use crate::render::cost::model::DrawCosts;
use crate::render::cut_key::{CutKey, knows_footprints};
use crate::render::frame_constants::{FrameContext, frame_constants};
use crate::render::model_facts::{DrawnFacts, DrawnParts, FactedModel};
use crate::render::pack_params::{filtered_shade, fuzzy_look, splat_plan};
use crate::render::supported::{
    check, check_patches_of, check_samples_of, device_cut_refusal, ids_refusal,
};
use crate::render::technique::Technique;
use crate::render::{
    AmbientOcclusion, Culling, CutOn, EyeDome, ListOf, Method, Occlusion, Path, PictureOutputs,
    Settings, SplatKind,
};
use crate::tree::Model;

/// Opaque squares and discs of a mesh at thresholds above a pixel, and up to this, are drawn as at a pixel. There the cut asks
/// which centers of pixels a ball contains, so that next to nothing is drawn twice: up to twice as fast as squares of 1.25 pixels
/// that lie over each other, and nearer to the truth (docs/PERFORMANCE.md).
const AS_A_PIXEL_PX: f32 = 1.5;

/// The settings of one frame: with [`Culling::Auto`] nothing is culled where a closed surface surrounds the eye, since
/// what is seen from there is what faces away; thresholds of little more than a pixel are a pixel, where that is better and
/// faster; with [`EyeDome::Auto`] points without normals are darkened by what is nearer beside them, and with
/// [`AmbientOcclusion::Auto`] most others where they lie deep.
pub fn resolve_settings(settings: &Settings, model: &Model, view: &View) -> Settings {
    let surrounds = |view: &View| surrounds_eye(model, view);
    resolved(settings, &model.into(), view, surrounds)
}

/// Resolves settings as [`resolve_settings`] does, of several models.
pub(crate) fn resolve_of_parts(
    settings: &Settings,
    parts: DrawnParts<'_>,
    view: &View,
) -> Settings {
    let surrounds = |view: &View| {
        let mut models = parts.iter().map(|part| part.model);
        models.any(|model| surrounds_eye(model, view))
    };
    resolved(settings, &parts.facts(), view, surrounds)
}

/// Tells whether depths of triangles lie beside those of splats that were pushed away by several pixels' width: in such a picture
/// ambient occlusion sees a pit at each splat.
fn mixes_pushed_depths(settings: &Settings) -> bool {
    settings.method == Method::Pop
        && Technique::of(settings) == Technique::Fuzzy
        // Gaussians of a pixel are pushed away by less.
        && settings.threshold_px > 1.0
}

/// Resolves settings as [`resolve_settings`] does, of all that is drawn; `surrounds` tells whether a closed surface does
/// so to the eye of a view.
pub(crate) fn resolved(
    settings: &Settings,
    facts: &DrawnFacts,
    view: &View,
    surrounds: impl FnOnce(&View) -> bool,
) -> Settings {
    let of_cut = settings.view_of_cut(view);
    let is_cut_open = settings.section.is_some();
    let is_inside = settings.culling == Culling::Auto && (is_cut_open || surrounds(of_cut));
    // All triangles are what a cut without splats has.
    let are_cut = is_cut_open && settings.method == Method::Triangles;
    let as_a_pixel = settings.method == Method::Pop
        && knows_footprints(settings)
        && facts.kind.is_surface()
        && settings.threshold_px > 1.0
        && settings.threshold_px <= AS_A_PIXEL_PX;
    let is_dark_between = match settings.eye_dome {
        _ if settings.color_by.is_data() || settings.shows_photos() => false,
        EyeDome::Auto => settings.color_by == ColorBy::Shading && facts.lacks_normals,
        EyeDome::On => true,
        EyeDome::Off => false,
    };
    let is_darkened_in_depth = match settings.ambient_occlusion {
        _ if settings.color_by.is_data() || settings.shows_photos() => false,
        AmbientOcclusion::Auto => {
            settings.color_by == ColorBy::Shading
                && !facts.lacks_normals
                && !(facts.kind.is_surface() && mixes_pushed_depths(settings))
        }
        AmbientOcclusion::On => true,
        AmbientOcclusion::Off => false,
    };
    let settings = &match are_cut {
        true => Settings {
            method: Method::Pop,
            splat: SplatKind::Square,
            blend: None,
            patches: None,
            ..*settings
        },
        false => *settings,
    };
    Settings {
        ambient_occlusion: match is_darkened_in_depth {
            true => AmbientOcclusion::On,
            false => AmbientOcclusion::Off,
        },
        eye_dome: match is_dark_between {
            true => EyeDome::On,
            false => EyeDome::Off,
        },
        culling: if is_inside {
            Culling::Off
        } else {
            settings.culling
        },
        threshold_px: match (are_cut, as_a_pixel) {
            (true, _) => 0.0,
            (false, true) => 1.0,
            (false, false) => settings.threshold_px,
        },
        ..*settings
    }
}

/// Tells whether a closed surface surrounds the eye of a perspective view.
fn surrounds_eye(model: &Model, view: &View) -> bool {
    view.is_perspective && model.is_closed && model.surrounds(view.eye)
}

/// Parts that are drawn, seen in a view, and the renderer that is to draw them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanInput<'a> {
    pub(crate) parts: DrawnParts<'a>,
    pub(crate) view: &'a View,
    pub(crate) outputs: PictureOutputs,
    pub(crate) capabilities: &'a RendererCapabilities,
    /// Costs on the renderer's device, where they were measured.
    pub(crate) costs: Option<&'a DrawCosts>,
}

impl<'a> PlanInput<'a> {
    /// Input of a renderer whose costs decide nothing.
    fn without_costs(
        parts: DrawnParts<'a>,
        view: &'a View,
        outputs: PictureOutputs,
        capabilities: &'a RendererCapabilities,
    ) -> Self {
        Self {
            parts,
            view,
            outputs,
            capabilities,
            costs: None,
        }
    }
}

/// Who chooses what is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CutPlace {
    /// Nobody: the whole model is drawn.
    Nowhere,
    /// The processor.
    Processor,
    /// The device, which draws it without telling.
    Device,
}

/// The records that the splats of a cut are written as.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RecordFormat {
    /// None.
    Nothing,
    /// [`Splat`](crate::abi::Splat).
    Splats(SplatPlan),
    /// [`WeightedSplat`](crate::abi::WeightedSplat).
    Weighted(SplatPlan),
    /// [`FuzzySplat`](crate::abi::FuzzySplat) where compute draws them, else [`WeightedSplat`](crate::abi::WeightedSplat).
    Fuzzy(SplatPlan, fuzzy::FuzzyLook),
    /// [`FilteredSplat`](crate::abi::FilteredSplat).
    Filtered(filtered::FilteredShade),
}

/// Kinds of primitives in a frame, as far as they are known before its cut is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PlannedPrimitives {
    /// Triangles of the cut are drawn as such.
    pub(crate) has_triangles: bool,
    /// Splats may be larger than compute draws.
    pub(crate) has_large_splats: bool,
    /// Triangles that cover one pixel may become splats.
    pub(crate) may_sample: bool,
    /// Compute can read the vertices of triangles.
    pub(crate) binds_vertices: bool,
    /// Everything is gray.
    pub(crate) is_gray: bool,
    /// Vertices are drawn as quads: they are too large for points, or cheaper so.
    pub(crate) are_quads: bool,
    /// Patches show images.
    pub(crate) textures_patches: bool,
    /// Pixels at the rims of patches show how much of them is covered.
    pub(crate) covers_rims: bool,
}

/// A frame, planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FramePlan {
    /// [`DrawnParts::id`].
    pub(crate) drawn: u64,
    /// Facts of all that is drawn.
    pub(crate) facts: DrawnFacts,
    pub(crate) view: View,
    /// Settings that [`resolve_settings`] gave.
    pub(crate) settings: Settings,
    pub(crate) technique: Technique,
    /// Key of the cut, where there is one, of all parts alike; [`FramePlan::cut_of`] has that of each.
    pub(crate) cut: CutKey,
    pub(crate) cut_place: CutPlace,
    pub(crate) primitives: PlannedPrimitives,
    /// Compute may draw small primitives.
    pub(crate) may_use_compute: bool,
    /// Compute draws what the device chose, where it is small.
    pub(crate) draws_cut_by_compute: bool,
    /// Draw lists hold ids of splats and triangles.
    pub(crate) uploads_ids: bool,
    /// Largest point that is drawn, pixels.
    pub(crate) max_point_px: f32,
    /// Largest footprint of a splat, pixels; 0 without splats.
    pub(crate) largest_px: f32,
    pub(crate) context: FrameContext,
    pub(crate) constants: FrameConstants,
}

/// Inputs that decide the draw lists of a frame: equal ones give the same bytes, as long as the renderer's costs are the same.
/// Made of what cut and packing are told, and they are told nothing else but what follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PackKey {
    drawn: u64,
    cut: CutKey,
    view: View,
    records: RecordFormat,
    path: Path,
    primitives: PlannedPrimitives,
    may_use_compute: bool,
    uploads_ids: bool,
}

impl RecordFormat {
    /// Records of a planned frame, with points of at most `max_point_px` pixels.
    fn of(plan: &FramePlan, max_point_px: f32) -> Self {
        let (settings, facts) = (&plan.settings, &plan.facts);
        let splats = splat_plan(settings, max_point_px);
        match plan.technique {
            Technique::Opaque | Technique::Visibility | Technique::Polygons => Self::Splats(splats),
            Technique::Fuzzy if plan.may_use_compute => {
                Self::Fuzzy(splats, fuzzy_look(settings, facts))
            }
            Technique::Fuzzy => Self::Weighted(splats),
            Technique::Filtered => {
                let depth_range = plan.context.depth_range;
                Self::Filtered(filtered_shade(settings, facts, depth_range, max_point_px))
            }
            Technique::Nothing => Self::Nothing,
        }
    }
}

impl FramePlan {
    /// Plans a frame.
    ///
    /// # Errors
    /// [`Error::Unsupported`] or [`Error::Limit`] with what cannot be drawn, why, and what to do.
    pub(crate) fn new(settings: &Settings, input: &PlanInput<'_>) -> Result<Self, Error> {
        let PlanInput {
            parts,
            view,
            outputs,
            capabilities,
            costs,
        } = *input;
        check(settings, outputs, capabilities.max_point_px)?;
        check_patches_of(settings, parts)?;
        check_samples_of(settings, parts)?;
        let facts = parts.facts();
        let mut settings = resolve_of_parts(settings, parts, view);
        let technique = Technique::of(&settings);
        let is_slow_to_hide = settings.threshold_px > capabilities.largest_hidden_px;
        if settings.occlusion == Occlusion::Auto
            && technique == Technique::Opaque
            && is_slow_to_hide
        {
            settings.occlusion = Occlusion::Off;
        }
        let size = [view.width, view.height];
        let is_one = parts.single().is_some();
        // Splats of a tree are placed of one model alone.
        let is_placed = technique == Technique::Fuzzy && settings.drawn_vertex_splats().is_none();
        let may_use_compute = match settings.path {
            Path::Compute if is_placed && !is_one => {
                return Err(Error::Unsupported {
                    what: "fuzzy splats by compute",
                    why: "several models are drawn together; leave --path compute out".into(),
                });
            }
            _ if is_placed && !is_one => false,
            _ => may_use_compute(&settings, outputs, size, capabilities)?,
        };
        let cut_place = cut_place(&settings, &facts, is_one, capabilities)?;
        // What compute draws of blended splats only the processor makes.
        let is_chosen = cut_place == CutPlace::Device;
        let are_summed = matches!(technique, Technique::Fuzzy | Technique::Filtered);
        let may_use_compute = may_use_compute && !(is_chosen && are_summed);
        let uploads_ids = cut_place != CutPlace::Device
            && uploads_ids(&settings, (&facts, is_one), may_use_compute, capabilities)?;
        let is_whole = settings.method == Method::Splats;
        let has_own_sizes = is_whole || !facts.kind.is_surface() || settings.holds_cut();
        let is_opaque = technique == Technique::Opaque;
        let is_by_compute = cut_place == CutPlace::Processor && is_opaque && may_use_compute;
        // What the device chooses is drawn by compute as points up to here, or as large as the threshold is.
        let is_chosen_small = is_chosen && has_own_sizes && may_use_compute && is_opaque;
        let max_point_px = match (is_by_compute, is_chosen_small) {
            (true, _) => compute_limits::largest_point_px(&settings),
            (false, true) => {
                let usual = compute_limits::largest_point_px(&settings);
                let least = splat_plan(&settings, usual).within_threshold_px();
                usual.max(least).min(capabilities.max_point_px)
            }
            (false, false) => capabilities.max_point_px,
        };
        let vertex_px = splat_plan(&settings, max_point_px).vertex_px(view);
        let largest_px = match settings.method {
            Method::Triangles => 0.0,
            // Quads need no guard band; those that might be points have the same, so that both give the same picture.
            Method::Points if vertex_px > max_point_px => 0.0,
            Method::Points => vertex_px,
            // Of a size that only they know.
            Method::Splats if settings.drawn_vertex_splats().is_some() => {
                view.width.max(view.height) as f32
            }
            Method::Pop | Method::Splats => {
                let usual = match technique {
                    Technique::Filtered if has_own_sizes => max_point_px,
                    Technique::Filtered => settings.threshold_px.max(3.0) + 2.0,
                    _ => splat_plan(&settings, max_point_px).largest_point_px(facts.kind),
                };
                // Without a limit nothing is larger than the picture.
                let side_px = view.width.max(view.height) as f32;
                let limit_px = if max_point_px.is_finite() {
                    max_point_px
                } else {
                    side_px
                };
                // Patches are widened by what their error shows beside them, and reach over the surface by as much.
                let beside_px = match settings.drawn_patches() {
                    Some(PatchRules { tolerances, .. }) => {
                        4.0 * tolerances.rim_px.max(tolerances.inside_px)
                    }
                    None => 0.0,
                };
                usual.min(limit_px) + beside_px
            }
        };
        // What is drawn as triangles needs no guard band.
        let has_points = largest_px > 0.0 && (settings.has_cut() || !is_whole);
        let guard_px = match has_points {
            true => (largest_px.min(capabilities.largest_guarded_px) / 2.0).ceil() as u32 + 1,
            false => 0,
        };
        let cheapest_px = match costs {
            Some(costs) => choose::largest_point_px(costs, &settings, max_point_px),
            None => max_point_px,
        };
        let is_shaded = settings.color_by == ColorBy::Shading;
        let mut context = FrameContext::new(&facts, view, &settings, largest_px, guard_px);
        context.reads_depth |= outputs.depth;
        Ok(Self {
            drawn: parts.id(),
            facts,
            view: *view,
            settings,
            technique,
            cut: CutKey::of(&settings, &facts, view),
            cut_place,
            primitives: PlannedPrimitives {
                has_triangles: settings.method == Method::Pop
                    || settings.drawn_polygons().is_some(),
                has_large_splats: has_own_sizes,
                may_sample: capabilities.is_software
                    && !outputs.normal
                    && technique == Technique::Opaque
                    && settings.method == Method::Pop
                    && is_shaded
                    && !settings.holds_cut()
                    && !uploads_ids
                    && is_one,
                binds_vertices: capabilities.binds_vertices,
                is_gray: settings.shades_gray(parts.has_colors()),
                are_quads: settings.method == Method::Points && vertex_px > cheapest_px,
                // Beside pages of paged files, which have no images, the means of textures are drawn.
                textures_patches: facts.has_textures
                    && settings.textures_patches()
                    && parts.iter().all(|part| part.cut.is_none()),
                covers_rims: settings.covers_rims(),
            },
            may_use_compute,
            draws_cut_by_compute: may_use_compute
                && cut_place == CutPlace::Device
                && match settings.path {
                    Path::Compute => true,
                    _ if capabilities.is_software => false,
                    _ => {
                        let picture = (context.rect_px, (view.width, view.height));
                        choose::draws_chosen(costs, &settings, picture)
                    }
                },
            uploads_ids,
            max_point_px,
            largest_px,
            context,
            constants: frame_constants(view, &settings, &context),
        })
    }

    /// Plans a frame for the processor's own renderer, which has one rasterizer, and lists that nobody uploads.
    ///
    /// # Errors
    /// As [`FramePlan::new`].
    pub(crate) fn for_processor(
        settings: &Settings,
        parts: DrawnParts<'_>,
        view: &View,
        outputs: PictureOutputs,
    ) -> Result<Self, Error> {
        let settings = Settings {
            path: Path::Auto,
            list_of: ListOf::Records,
            ..*settings
        };
        let capabilities = &RendererCapabilities::PROCESSOR;
        let input = PlanInput::without_costs(parts, view, outputs, capabilities);
        Self::new(&settings, &input)
    }

    /// Plans a frame for the reference, which draws what the device would by the rasterizer.
    ///
    /// # Errors
    /// Refusals of [`FramePlan::new`].
    pub(crate) fn for_reference(
        settings: &Settings,
        parts: DrawnParts<'_>,
        view: &View,
        outputs: PictureOutputs,
    ) -> Result<Self, Error> {
        let settings = Settings {
            // The rasterizer leaves out more than compute of what is hidden, if it is named.
            path: match settings.path {
                Path::Compute => Path::Auto,
                path => path,
            },
            cut_on: CutOn::Processor,
            list_of: ListOf::Records,
            ..*settings
        };
        let capabilities = &RendererCapabilities::REFERENCE;
        let input = PlanInput::without_costs(parts, view, outputs, capabilities);
        Self::new(&settings, &input)
    }

    /// The records of its splats, where points have at most `max_point_px` pixels.
    pub(crate) fn records(&self, max_point_px: f32) -> RecordFormat {
        RecordFormat::of(self, max_point_px)
    }

    /// Values that its filtered splats depend on besides model and view; `None` of others.
    pub(crate) fn filtered_shade(&self) -> Option<filtered::FilteredShade> {
        match self.records(self.max_point_px) {
            RecordFormat::Filtered(shade) => Some(shade),
            _ => None,
        }
    }

    /// Key of the cut of one of its parts.
    pub(crate) fn cut_of(&self, part: FactedModel<'_>) -> CutKey {
        CutKey::of(&self.settings, &part.facts.drawn(), &self.view)
    }

    /// Key of its draw lists.
    pub(crate) fn pack_key(&self) -> PackKey {
        PackKey {
            drawn: self.drawn,
            cut: self.cut,
            view: self.view,
            records: self.records(self.max_point_px),
            path: self.settings.path,
            primitives: self.primitives,
            may_use_compute: self.may_use_compute,
            uploads_ids: self.uploads_ids,
        }
    }

    /// Tells whether its cut may have triangles that are drawn as such.
    pub(crate) fn chooses_triangles(&self) -> bool {
        self.primitives.has_triangles && self.facts.kind.is_surface()
    }

    /// Tells whether it has to be known what of the model has no area: that takes a look at all of it, once.
    pub(crate) fn needs_undrawn(&self) -> bool {
        let names_splats = self.uploads_ids && self.technique != Technique::Filtered;
        self.cut_place != CutPlace::Nowhere && (self.cut.needs_undrawn() || names_splats)
    }
}

/// Decides who chooses the cut; `is_one`: of one model.
///
/// # Errors
/// When the device is asked for and cannot.
fn cut_place(
    settings: &Settings,
    facts: &DrawnFacts,
    is_one: bool,
    capabilities: &RendererCapabilities,
) -> Result<CutPlace, Error> {
    let usual = match settings.has_cut() {
        true => CutPlace::Processor,
        false => CutPlace::Nowhere,
    };
    let plan = splat_plan(settings, capabilities.max_point_px);
    let refusal = match is_one {
        true => device_cut_refusal(settings, facts, (&plan, capabilities)),
        false => Some("several models are drawn together"),
    };
    let fits = match settings.splat {
        SplatKind::Filtered => capabilities.fits_filtered_cut,
        _ => capabilities.fits_device_cut,
    };
    match (settings.cut_on, refusal) {
        (CutOn::Processor, _) | (CutOn::Auto, Some(_)) => Ok(usual),
        (CutOn::Device, Some(why)) => Err(Error::Unsupported {
            what: "the cut on the device",
            why: why.into(),
        }),
        (CutOn::Auto, None) if !(capabilities.cuts_sooner && fits) => Ok(usual),
        (CutOn::Auto | CutOn::Device, None) => Ok(CutPlace::Device),
    }
}

/// Decides whether draw lists hold numbers; `is_one`: of one model.
///
/// # Errors
/// When they are asked to and cannot.
fn uploads_ids(
    settings: &Settings,
    (facts, is_one): (&DrawnFacts, bool),
    may_use_compute: bool,
    capabilities: &RendererCapabilities,
) -> Result<bool, Error> {
    let plan = splat_plan(settings, capabilities.max_point_px);
    let refusal = match is_one {
        true => ids_refusal(settings, facts, &plan, may_use_compute),
        false => Some("several models are drawn together"),
    };
    match (settings.list_of, refusal) {
        (ListOf::Records, _) | (ListOf::Auto, Some(_)) => Ok(false),
        (ListOf::Ids, Some(why)) => Err(Error::Unsupported {
            what: "draw lists of ids",
            why: why.into(),
        }),
        // What a software device calls its own is the processor's memory: the tree would be there twice.
        (ListOf::Auto, None) => Ok(!capabilities.is_software && capabilities.fits_tree),
        (ListOf::Ids, None) => Ok(true),
    }
}

#[cfg(test)]
mod tests;
