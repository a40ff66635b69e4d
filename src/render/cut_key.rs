//! Inputs that decide the cut of a frame besides the model.

use crate::cut;
use crate::cut::SizeMetric;
use crate::math::camera::View;
use crate::pack::Footprint;
use crate::patches::{PatchCutSettings, PatchRules};
use crate::render::model_facts::DrawnFacts;
use crate::render::settings::PolygonSource;
use crate::render::technique::Technique;
use crate::render::{CutTraversal, Method, Occlusion, Path, Settings, SplatKind};
use crate::tree::Model;

/// Above this threshold hidden splats are drawn unless asked otherwise, pixels: discs, of which few are hidden, and squares
/// that may be drawn by compute, which is cheap; squares that are rasterized; and what the host draws.
pub(crate) const LARGEST_HIDDEN_PX: [f32; 3] = [2.0, 4.0, 1.0];

/// Tells whether it is known without their attributes what splats cover: of opaque squares and discs.
pub(crate) fn knows_footprints(settings: &Settings) -> bool {
    settings.has_cut()
        && Technique::of(settings) == Technique::Opaque
        && settings.footprint() != Footprint::Oriented
        && settings.size == SizeMetric::Exact
}

/// The cut settings of a frame.
pub fn cut_settings(settings: &Settings, facts: impl Into<DrawnFacts>) -> cut::CutSettings {
    let facts = facts.into();
    cut::CutSettings {
        threshold_px: settings.threshold_px,
        cull_back: settings.culls_back(facts.is_closed) && facts.kind.is_surface(),
        cull_frustum: true,
        size: settings.size,
        section: settings.section,
    }
}

/// Footprints that the cut of a frame takes splats for where it leaves out what covers no pixel or is hidden; `None` where it
/// does not.
///
/// Splats of a pixel at most are drawn where they contain a pixel's center, so that with a falling threshold pictures
/// become those of triangles with one sample a pixel. As whole pixels they would make outlines wider, by half a pixel
/// however fine they are. Points of a cloud are no surface that others would close: none is left out.
///
/// `Auto` leaves large ones alone: few of them fall into one pixel, and to look at all of their pixels costs what is saved.
fn footprints(settings: &Settings, facts: &DrawnFacts) -> Option<cut::SplatFootprints> {
    let is_wanted = match settings.occlusion {
        Occlusion::Auto => {
            let is_costly = settings.splat == SplatKind::Square
                && (settings.method == Method::Splats || settings.path == Path::Raster);
            settings.threshold_px <= LARGEST_HIDDEN_PX[usize::from(is_costly)]
        }
        Occlusion::On => true,
        Occlusion::Off => false,
    };
    let is_cloud = !facts.kind.is_surface();
    // A disc of this diameter contains a pixel's center wherever it lies.
    let may_miss = settings.threshold_px < std::f32::consts::SQRT_2 && !is_cloud;
    (knows_footprints(settings) && (is_wanted || may_miss)).then(|| cut::SplatFootprints {
        side_px: settings.threshold_px,
        hides: is_wanted,
        are_discs: settings.footprint() == Footprint::Circle,
        large_leaves: settings.method == Method::Splats,
        is_cloud,
    })
}

/// View, settings and footprints of a cut. Equal ones choose the same cut of a model: this is all that the selector is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CutKey {
    view: View,
    settings: cut::CutSettings,
    /// Footprints that splats are taken for, where those that are hidden are left out.
    seen: Option<cut::SplatFootprints>,
    /// Start of the traversal; the lists are the same.
    traversal: CutTraversal,
    /// Source of oriented polygons, where some are drawn.
    polygons: Option<PolygonSource>,
}

impl CutKey {
    /// Key of a frame; of settings that [`resolve_settings`](crate::render::frame_plan::resolve_settings) gave.
    pub(crate) fn of(settings: &Settings, facts: &DrawnFacts, view: &View) -> Self {
        Self {
            view: *settings.view_of_cut(view),
            settings: cut_settings(settings, *facts),
            // From elsewhere what the cut's own view does not show is seen.
            seen: footprints(settings, facts).filter(|_| !settings.holds_cut()),
            traversal: settings.traversal,
            polygons: settings.drawn_polygons(),
        }
    }

    /// Settings of a cut by error.
    pub(crate) fn by_error(&self, rules: &PatchRules) -> PatchCutSettings {
        PatchCutSettings {
            cut: self.settings,
            tolerances: rules.tolerances,
            tiny_polygons: rules.tiny_polygons,
            ..PatchCutSettings::default()
        }
    }

    /// Source of oriented polygons; `None` where none are drawn.
    pub(crate) fn polygons(&self) -> Option<PolygonSource> {
        self.polygons
    }

    /// Largest projected diameter of a node that is one splat, pixels.
    pub(crate) fn threshold_px(&self) -> f32 {
        self.settings.threshold_px
    }

    /// The view that decides it.
    pub(crate) fn view(&self) -> &View {
        &self.view
    }

    /// Tells whether it has to be known what of the model is not drawn.
    pub(crate) fn needs_undrawn(&self) -> bool {
        self.seen.is_some()
    }

    /// Tells whether splats that are hidden are left out.
    pub(crate) fn hides(&self) -> bool {
        self.seen.is_some_and(|seen| seen.hides)
    }

    /// Shape that splats are taken for where hidden ones are left out.
    pub(crate) fn hiding(&self) -> Option<cut::SplatFootprints> {
        self.seen.filter(|seen| seen.hides)
    }

    /// Makes a key of the same cut that leaves nothing out because it is hidden.
    pub(crate) fn without_hiding(&self) -> Self {
        let seen = self.seen.map(|seen| cut::SplatFootprints {
            hides: false,
            ..seen
        });
        Self { seen, ..*self }
    }

    /// Chooses the cut.
    pub(crate) fn select<'a>(
        &self,
        selector: &mut cut::CutSelector,
        model: &Model,
        undrawn: impl FnOnce() -> &'a cut::ZeroAreaSet,
        into: &mut cut::Cut,
    ) {
        let (view, settings) = (&self.view, &self.settings);
        selector.set_coherent(self.traversal == CutTraversal::Coherent);
        match self.seen {
            Some(footprints) => {
                selector.select_seen(model, view, settings, (footprints, undrawn()), into);
            }
            None => selector.select(model, view, settings, into),
        }
    }
}
