//! What the settings mean for one frame: for the cut, the draw lists and the uniform block, and what they ask for
//! in vain.

use crate::cut::{self, SizeMetric};
use crate::gpu::Error;
use crate::math::camera::View;
use crate::pack;
use crate::pack::{ColorBy, Footprint};
use crate::render::PictureOutputs;
use crate::render::{
    Blend, Culling, Method, Occlusion, Path, Settings, Shading, SplatKind, Traversal,
};
use crate::tree::Model;

/// Above this threshold hidden splats are drawn unless asked otherwise, pixels: discs, of which few are hidden, and squares
/// that may be drawn by compute, which is cheap; squares that are rasterized; and what the host draws.
pub(super) const LARGEST_HIDDEN_PX: [f32; 3] = [2.0, 4.0, 1.0];

/// Opaque squares and discs of a mesh at thresholds above a pixel, and up to this, are drawn as at a pixel. There the cut asks
/// which centers of pixels a ball contains, so that next to nothing is drawn twice: up to twice as fast as squares of 1.25 pixels
/// that lie over each other, and nearer to the truth (docs/PERFORMANCE.md).
const AS_A_PIXEL_PX: f32 = 1.5;

/// The settings of one frame: with [`Culling::Auto`] nothing is culled where a closed surface surrounds the eye, since
/// what is seen from there is what faces away; and thresholds of little more than a pixel are a pixel, where that is better and faster.
pub fn for_view(settings: &Settings, model: &Model, view: &View) -> Settings {
    let of_cut = settings.view_of_cut(view);
    let is_inside = settings.culling == Culling::Auto
        && model.is_closed
        && of_cut.is_perspective
        && model.surrounds(of_cut.eye);
    let as_a_pixel = settings.method == Method::Pop
        && knows_footprints(settings)
        && model.kind().is_surface()
        && settings.threshold_px > 1.0
        && settings.threshold_px <= AS_A_PIXEL_PX;
    Settings {
        culling: if is_inside {
            Culling::Off
        } else {
            settings.culling
        },
        threshold_px: if as_a_pixel {
            1.0
        } else {
            settings.threshold_px
        },
        ..*settings
    }
}

/// The settings of one frame that the processor draws, see [`for_view`]. Splats of more than a pixel take it less time than to look
/// for hidden ones.
pub(crate) fn cpu_settings(settings: &Settings, model: &Model, view: &View) -> Settings {
    let mut settings = for_view(settings, model, view);
    if settings.occlusion == Occlusion::Auto
        && settings.threshold_px > LARGEST_HIDDEN_PX[2]
        && Drawing::of(&settings) == Drawing::Opaque
    {
        settings.occlusion = Occlusion::Off;
    }
    settings
}

/// Whether it is known without their attributes what splats cover: of opaque squares and discs.
fn knows_footprints(settings: &Settings) -> bool {
    settings.has_cut()
        && Drawing::of(settings) == Drawing::Opaque
        && settings.footprint() != Footprint::Oriented
        && settings.size == SizeMetric::Exact
}

/// The cut settings of a frame.
pub fn cut_settings(settings: &Settings, model: &Model) -> cut::Settings {
    cut::Settings {
        threshold_px: settings.threshold_px,
        cull_back: settings.culls_back(model.is_closed) && model.kind().is_surface(),
        cull_frustum: true,
        size: settings.size,
    }
}

/// What the cut of a frame takes splats for where it leaves out what covers no pixel or is hidden; `None` where it does not.
///
/// Splats of a pixel at most are drawn where they contain a pixel's center, so that with a falling threshold pictures
/// become those of triangles with one sample a pixel. As whole pixels they would make outlines wider, by half a pixel
/// however fine they are. Points of a cloud are no surface that others would close: none is left out.
///
/// `Auto` leaves large ones alone: few of them fall into one pixel, and to look at all of their pixels costs what is saved.
fn footprints(settings: &Settings, model: &Model) -> Option<cut::Footprints> {
    let is_wanted = match settings.occlusion {
        Occlusion::Auto => {
            let is_costly = settings.splat == SplatKind::Square
                && (settings.method == Method::Splats || settings.path == Path::Raster);
            settings.threshold_px <= LARGEST_HIDDEN_PX[usize::from(is_costly)]
        }
        Occlusion::On => true,
        Occlusion::Off => false,
    };
    let is_cloud = !model.kind().is_surface();
    // A disc of this diameter contains a pixel's center wherever it lies.
    let may_miss = settings.threshold_px < std::f32::consts::SQRT_2 && !is_cloud;
    (knows_footprints(settings) && (is_wanted || may_miss)).then(|| cut::Footprints {
        side_px: settings.threshold_px,
        hides: is_wanted,
        are_discs: settings.footprint() == Footprint::Circle,
        large_leaves: settings.method == Method::Splats,
        is_cloud,
    })
}

/// What decides the cut of a frame besides the model. Equal ones choose the same cut: this is all that the selector is
/// told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Choice {
    view: View,
    settings: cut::Settings,
    /// What splats are taken for, where those that are hidden are left out.
    seen: Option<cut::Footprints>,
    /// Where the traversal starts; the lists are the same.
    traversal: Traversal,
}

impl Choice {
    /// That of a frame; of settings that [`for_view`] gave.
    pub(super) fn of(settings: &Settings, model: &Model, view: &View) -> Self {
        Self {
            view: *settings.view_of_cut(view),
            settings: cut_settings(settings, model),
            // From elsewhere what the cut's own view does not show is seen.
            seen: footprints(settings, model).filter(|_| !settings.holds_cut()),
            traversal: settings.traversal,
        }
    }

    /// Whether it has to be known what of the model is not drawn.
    pub(super) fn needs_undrawn(&self) -> bool {
        self.seen.is_some()
    }

    /// Whether splats that are hidden are left out.
    pub(super) fn hides(&self) -> bool {
        self.seen.is_some_and(|seen| seen.hides)
    }

    /// Chooses the cut.
    pub(super) fn select<'a>(
        &self,
        selector: &mut cut::Selector,
        model: &Model,
        undrawn: impl FnOnce() -> &'a cut::Undrawn,
        into: &mut cut::Cut,
    ) {
        let (view, settings) = (&self.view, &self.settings);
        selector.set_coherent(self.traversal == Traversal::Coherent);
        match self.seen {
            Some(footprints) => {
                selector.select_seen(model, view, settings, (footprints, undrawn()), into);
            }
            None => selector.select(model, view, settings, into),
        }
    }
}

/// No splat is larger than this, pixels: infinite where splats have sizes of their own.
pub(super) fn largest_splat_px(model: &Model, settings: &Settings) -> f32 {
    let have_own = settings.method == Method::Splats || settings.holds_cut();
    if have_own || (settings.has_cut() && !model.kind().is_surface()) {
        f32::INFINITY
    } else {
        settings.threshold_px.max(1.0)
    }
}

/// Which passes draw the splats of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawing {
    /// There are none.
    Nothing,
    /// The nearest splat wins.
    Opaque,
    /// The weighted mean of all that is near the front.
    Fuzzy,
    /// Deposits of area.
    Filtered,
    /// Visible centers, and what lies between reconstructed.
    Visibility,
}

impl Drawing {
    /// That of settings that [`check`] found no fault with.
    pub(super) fn of(settings: &Settings) -> Self {
        match settings.splat {
            _ if !settings.draws_splats() => Self::Nothing,
            SplatKind::Filtered => Self::Filtered,
            SplatKind::Visibility => Self::Visibility,
            _ if settings.blend() != Blend::Opaque => Self::Fuzzy,
            _ => Self::Opaque,
        }
    }
}

/// What the packing of splats needs of the settings.
pub fn splat_plan(settings: &Settings, max_point_px: f32) -> pack::splats::Plan {
    pack::splats::Plan {
        footprint: settings.footprint(),
        threshold_px: settings.threshold_px.max(1.0),
        size: settings.size,
        draws_large_leaves: settings.method == Method::Splats,
        low_pass_px: settings.low_pass_px(),
        by_level: settings.color_by == ColorBy::Level,
        cut_view: settings.cut_view,
        max_point_px,
    }
}

/// What the packing of fuzzy splats for compute needs of the settings besides [`splat_plan`].
pub fn fuzzy_look(settings: &Settings, model: &Model) -> pack::fuzzy::Look {
    pack::fuzzy::Look {
        is_gauss: settings.splat == SplatKind::Gauss,
        depth_offset: settings.depth_offset(),
        two_sided: settings.two_sided,
        cull_back: settings.draws_fronts_only(model.is_closed),
        use_colors: settings.use_colors,
        color_by: settings.color_by,
        light: settings.light.in_model(model.origin),
    }
}

/// What the packing of filtered splats needs of the settings.
pub fn filtered_shade(
    settings: &Settings,
    model: &Model,
    max_size_px: f32,
) -> pack::filtered::Shade {
    let cull_back = settings.draws_fronts_only(model.is_closed) && model.kind().is_surface();
    pack::filtered::Shade {
        side_px: settings.threshold_px.max(1.0),
        max_size_px,
        splats_only: settings.method == Method::Splats,
        cut_view: settings.cut_view,
        // Both sides of a part are near the front at its rim: a smaller offset keeps the far one out.
        depth_offset: settings
            .depth_offset
            .unwrap_or(if cull_back { 3.0 } else { 2.0 }),
        cull_back,
        use_colors: settings.use_colors,
        color_by: settings.color_by,
        light: settings.light.in_model(model.origin),
    }
}

/// Refuses by name what `settings` ask for in vain: with this model, these outputs, and points of at most
/// `max_size_px` (infinite on the mirror).
///
/// # Errors
/// [`Error::Unsupported`] with the reason and what to do, or [`Error::Limit`] for a threshold that is too large.
pub fn check(
    _model: &Model,
    settings: &Settings,
    outputs: PictureOutputs,
    max_size_px: f32,
) -> Result<(), Error> {
    if settings.color_by == ColorBy::Classification && !settings.draws_visibility() {
        return Err(Error::Unsupported {
            what: "the classification of pixels",
            why: "only visibility splats have one; add --splat visibility".into(),
        });
    }
    if settings.color_by == ColorBy::Level && !settings.has_cut() {
        return Err(Error::Unsupported {
            what: "color by level",
            why: "only what is drawn from the tree has levels; use --method pop or splats".into(),
        });
    }
    if settings.color_by == ColorBy::Overdraw {
        check_overdraw(settings, outputs)?;
    }
    if outputs.values && settings.draws_visibility() {
        return Err(Error::Unsupported {
            what: "values of visibility splats",
            why: "they are put together from pixels of eight bits; ask for the picture without"
                .into(),
        });
    }
    let is_device = max_size_px.is_finite();
    if settings.draws_splats() {
        check_blend(settings, is_device)?;
    }
    if settings.draws_filtered() {
        check_filtered(settings, outputs, max_size_px)?;
    }
    Ok(())
}

/// Refuses by name where overdraw cannot be counted.
fn check_overdraw(settings: &Settings, outputs: PictureOutputs) -> Result<(), Error> {
    let why = if outputs.values {
        "a mean of the colors of counts is the color of no count; draw one sample a pixel"
    } else if settings.path == Path::Compute {
        "footprints are counted by the rasterizer; leave --path compute out"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "color by overdraw",
        why: why.into(),
    })
}

/// Refuses by name what the blending of splats cannot do.
fn check_blend(settings: &Settings, is_device: bool) -> Result<(), Error> {
    let refuse = |what, why: &str| {
        Err(Error::Unsupported {
            what,
            why: why.into(),
        })
    };
    let own = match settings.splat {
        SplatKind::Filtered => Some("filtered splats"),
        SplatKind::Visibility => Some("visibility splats"),
        _ => None,
    };
    if let Some(name) = own {
        if settings.blend.is_some_and(|blend| blend != Blend::Opaque)
            || settings.shading != Shading::PerSplat
        {
            return refuse(
                name,
                "they have a way of their own to blend and shade; leave --blend and --shading out",
            );
        }
        return Ok(());
    }
    match settings.blend() {
        Blend::Opaque if settings.shading == Shading::Deferred => refuse(
            "deferred shading",
            "only splats that are blended are lit once a pixel; use --blend two-pass",
        ),
        Blend::DepthThreshold | Blend::DepthRange if is_device => refuse(
            "blending in one pass",
            "it needs ordered access to a pixel; use --backend reference, or --blend two-pass",
        ),
        Blend::DepthThreshold | Blend::DepthRange if settings.shading == Shading::Deferred => {
            refuse("deferred shading", "use --blend two-pass")
        }
        Blend::Opaque => Ok(()),
        _ if settings.shading == Shading::Deferred && settings.color_by.is_data() => refuse(
            "deferred shading",
            "colors by level, normal, depth and overdraw are not lit; leave --shading deferred out",
        ),
        _ => Ok(()),
    }
}

/// Refuses by name what filtered splats cannot draw.
///
/// # Errors
/// For points without a tree, normals as output, one-sided light, and thresholds above
/// `max_size_px`.
fn check_filtered(
    settings: &Settings,
    outputs: PictureOutputs,
    max_size_px: f32,
) -> Result<(), Error> {
    let why = if settings.method == Method::Points {
        "points have no areas without a tree; use --method pop or splats"
    } else if outputs.normal {
        "they are sums over a pixel and have no normal; leave --normals out"
    } else if !settings.two_sided {
        "their sums do not tell the sides of a surface apart; leave --one-sided out"
    } else if settings.threshold_px > max_size_px {
        return Err(Error::Limit {
            what: "the size of filtered splats (--threshold, pixels)".into(),
            value: settings.threshold_px.ceil() as u64,
            limit: max_size_px as u64,
        });
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "filtered splats",
        why: why.into(),
    })
}
