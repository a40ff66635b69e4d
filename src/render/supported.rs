//! Refusals, by name, of what settings ask for in vain.

use crate::cut::SizeMetric;
use crate::gpu::Error;
use crate::pack::splats::SplatPlan;
use crate::pack::{ColorBy, ids};
use crate::progress::SilentProgress;
use crate::render::capabilities::RendererCapabilities;
use crate::render::model_facts::{DrawnFacts, DrawnParts, FactedModel};
use crate::render::technique::Technique;
use crate::render::{
    AmbientOcclusion, Blend, EyeDome, ListOf, Method, Path, PictureOutputs, Settings, Shading,
    SplatKind,
};

/// Refuses by name what `settings` ask for in vain: with these outputs, and points of at most
/// `max_size_px` (infinite in the reference).
///
/// # Errors
/// [`Error::Unsupported`] with the reason and what to do, or [`Error::Limit`] for a threshold that is too large.
pub fn check(settings: &Settings, outputs: PictureOutputs, max_size_px: f32) -> Result<(), Error> {
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
    if settings.shows_photos() && settings.color_by.is_data() {
        return Err(Error::Unsupported {
            what: "photographs",
            why: "colors by level, normal, depth and overdraw are data and stay as they are; use --color-by shading, or leave --photos out"
                .into(),
        });
    }
    if settings.shows_photos() && settings.eye_dome == EyeDome::On {
        return Err(Error::Unsupported {
            what: "eye-dome lighting of photographs",
            why: "they have the light that they were taken in; leave --eye-dome or --photos out"
                .into(),
        });
    }
    if settings.eye_dome == EyeDome::On && settings.color_by.is_data() {
        return Err(Error::Unsupported {
            what: "eye-dome lighting",
            why: "colors by level, normal, depth and overdraw are data and are not darkened; leave --eye-dome out"
                .into(),
        });
    }
    check_ambient_occlusion(settings)?;
    if settings.background_bottom.is_some()
        && (settings.shows_photos() || settings.color_by == ColorBy::Overdraw)
    {
        return Err(Error::Unsupported {
            what: "a background of two colors",
            why: "photographs and overdraw have one behind them; give one --background".into(),
        });
    }
    if settings.section.is_some() && !settings.has_cut() && settings.method != Method::Triangles {
        return Err(Error::Unsupported {
            what: "a section",
            why: "vertices and splats from them are drawn without the tree, which it cuts; use --method pop, splats or triangles"
                .into(),
        });
    }
    let is_device = max_size_px.is_finite();
    if settings.drawn_vertex_splats().is_some() {
        return check_vertex_splats(settings);
    }
    if settings.drawn_patches().is_some() {
        return check_patches(settings);
    }
    if settings.draws_splats() {
        check_blend(settings, is_device)?;
    }
    if settings.draws_filtered() {
        check_filtered(settings, outputs, max_size_px)?;
    }
    Ok(())
}

/// Refuses by name where colors are not to be darkened.
fn check_ambient_occlusion(settings: &Settings) -> Result<(), Error> {
    let why = if settings.ambient_occlusion != AmbientOcclusion::On {
        return Ok(());
    } else if settings.shows_photos() {
        "photographs have the light that they were taken in; leave --ambient-occlusion or --photos out"
    } else if settings.color_by.is_data() {
        "colors by level, normal, depth and overdraw are data and are not darkened; leave --ambient-occlusion out"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "ambient occlusion",
        why: why.into(),
    })
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

/// Refuses by name what splats from vertices cannot do.
fn check_vertex_splats(settings: &Settings) -> Result<(), Error> {
    let why = if settings.splat == SplatKind::Filtered {
        "they are polygons, and filtered splats are squares; use --splat gauss to blend them"
    } else if matches!(settings.blend(), Blend::DepthThreshold | Blend::DepthRange) {
        "they are blended in two passes; use --blend two-pass"
    } else if settings.shading != Shading::PerSplat && Technique::of(settings) != Technique::Fuzzy {
        "only splats that are blended are lit once a pixel of blended normals; use --splat gauss"
    } else if settings.color_by == ColorBy::Overdraw {
        "their overdraw is not counted; use another --color-by"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "splats from vertices",
        why: why.into(),
    })
}

/// Makes the even splats of a frame unless they are there; refuses by name those that would be too many.
pub(crate) fn check_samples_of(settings: &Settings, parts: DrawnParts<'_>) -> Result<(), Error> {
    let Some((rules, choice)) = settings
        .drawn_vertex_splats()
        .and_then(|rules| Some((rules, rules.samples?)))
    else {
        return Ok(());
    };
    for part in parts.iter() {
        let made = (part.facts).even_splats(part.model, &choice, rules.crease(), &SilentProgress);
        made.map_err(|error| Error::Unsupported {
            what: "even splats (--resample)",
            why: error.to_string(),
        })?;
    }
    Ok(())
}

/// Refuses by name what patches of a cut by error cannot do.
fn check_patches(settings: &Settings) -> Result<(), Error> {
    let is_opaque = matches!(
        settings.splat,
        SplatKind::Square | SplatKind::Disc | SplatKind::Ellipse
    );
    let why = if !is_opaque || settings.blend() != Blend::Opaque {
        "they and the splats beside them are opaque; use --splat square, disc or ellipse without --blend"
    } else if settings.shading != Shading::PerSplat {
        "only splats that are blended are lit once a pixel of blended normals; leave --splat-shading out"
    } else if settings.color_by == ColorBy::Overdraw {
        "their overdraw is not counted; use another --color-by"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "error patches",
        why: why.into(),
    })
}

/// Refuses by name what of a model cannot be drawn as patches of a cut by error.
pub(crate) fn check_patches_of(settings: &Settings, parts: DrawnParts<'_>) -> Result<(), Error> {
    // Pages that stand for others are points meanwhile.
    let is_cloud =
        |part: FactedModel<'_>| part.cut.is_none() && part.facts.drawn().kind.is_points();
    let why = if settings.drawn_patches().is_none() {
        return Ok(());
    } else if parts.iter().any(is_cloud) {
        "only surfaces of triangles have patches; leave --error out"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported {
        what: "error patches",
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
                "they have a way of their own to blend and shade; leave --blend and --splat-shading out",
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
            "colors by level, normal, depth and overdraw are not lit; leave --splat-shading deferred out",
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

/// Why a frame cannot have its cut chosen on the device; `None` where it can.
pub(crate) fn device_cut_refusal(
    settings: &Settings,
    facts: &DrawnFacts,
    (plan, capabilities): (&SplatPlan, &RendererCapabilities),
) -> Option<&'static str> {
    let technique = Technique::of(settings);
    // Filtered splats are points of any size.
    let have_own_sizes =
        (plan.draws_large_leaves || !facts.kind.is_surface()) && technique != Technique::Filtered;
    if !settings.has_cut() {
        Some("methods without a cut choose nothing; use --method pop or splats")
    } else if technique == Technique::Polygons || settings.drawn_polygons().is_some() {
        Some(
            "oriented polygons are chosen by the processor; leave --error and splats from vertices out",
        )
    } else if matches!(technique, Technique::Fuzzy | Technique::Filtered)
        && settings.path == Path::Compute
    {
        Some("what compute draws of blended splats the processor makes; use --path raster")
    } else if settings.size != SizeMetric::Exact {
        Some("it knows one measure of size; use --metric exact")
    } else if settings.threshold_px < 1.0 {
        Some("it knows no splats below a pixel; use a threshold of at least 1")
    } else if settings.holds_cut() {
        Some("the cut is held")
    } else if settings.section.is_some() {
        Some("a section is cut by the processor")
    } else if settings.color_by == ColorBy::Level {
        Some("it does not tell levels of the tree; use another --color-by")
    } else if facts.has_textures {
        Some("it draws no textures")
    } else if !plan.fits_within_threshold() {
        Some("the device has no points of this size")
    } else if have_own_sizes && !capabilities.has_first_instance {
        Some("the device draws no instances from the middle of a list (drawIndirectFirstInstance)")
    } else {
        None
    }
}

/// Why the draw lists of a frame cannot hold ids of splats and triangles; `None` where they can. `may_use_compute`:
/// compute may draw.
pub(crate) fn ids_refusal(
    settings: &Settings,
    facts: &DrawnFacts,
    plan: &SplatPlan,
    may_use_compute: bool,
) -> Option<&'static str> {
    match Technique::of(settings) {
        _ if !settings.has_cut() => Some("methods without a cut have no lists"),
        Technique::Nothing => Some("there are no splats"),
        Technique::Filtered if facts.has_textures => {
            Some("the processor has the colors of filtered splats from images on surfaces")
        }
        // Where nobody insists the rasterizer gets ids, and compute what the processor makes.
        Technique::Fuzzy if may_use_compute && settings.list_of == ListOf::Ids => {
            Some("what compute draws of fuzzy splats the processor makes; use --path raster")
        }
        _ => ids::why_not(plan),
    }
}
