//! The uniform block of a frame, and the few values from which it is made. No device is asked.

use crate::abi::{FrameConstants, constants};
use crate::math::camera::{HeadlightSource, View};
use crate::pack::lit_sphere::SphereLights;
use crate::pack::{ColorBy, LampSource, Phong, SurfaceLighting, falsecolor};
use crate::render::backdrop::BackgroundGradient;
use crate::render::model_facts::DrawnFacts;
use crate::render::{AmbientOcclusion, EyeDome, Settings, screen_bounds};
use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};

/// Values that every pass of a frame needs besides its resources.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrameContext {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Pixels by which the viewport reaches beyond the picture on every side.
    pub(crate) guard_px: u32,
    /// The part of the picture that something may be drawn in: left, top, and one past right and bottom, pixels.
    pub(crate) rect_px: [u32; 4],
    pub(crate) background: [f32; 3],
    pub(crate) cull_back: bool,
    /// The camera mirrors the picture, so that fronts turn clockwise.
    pub(crate) is_mirrored: bool,
    /// Positions in model space.
    pub(crate) light: SurfaceLighting,
    /// Of colors by depth.
    pub(crate) depth_range: [f32; 2],
    /// Height of what ambient occlusion takes for a plane, view-space units.
    pub(crate) occlusion_slack: f32,
    /// Looks or pictures need the depth of the surface, not that of the passes that draw it.
    pub(crate) reads_depth: bool,
}

/// Height of bumps that ambient occlusion takes for a plane, over the median radius of a cloud's points: points end as domes,
/// or are flat where the surface is not.
const SLACK_OF_POINTS: f32 = 0.5;

/// Value of [`FrameConstants::ambient_occlusion_slack`], view-space units.
pub(crate) fn occlusion_slack(facts: &DrawnFacts, view: &View) -> f32 {
    SLACK_OF_POINTS * facts.point_radius * view.model_scale
}

/// Distance that splats of this size may reach beyond the model, pixels.
pub(crate) fn margin_px(largest_px: f32) -> f32 {
    largest_px / 2.0 + 3.0
}

impl FrameContext {
    /// Values of a frame whose splats have at most `largest_px` pixels, drawn with a guard band of `guard_px`.
    pub(crate) fn new(
        facts: &DrawnFacts,
        view: &View,
        settings: &Settings,
        largest_px: f32,
        guard_px: u32,
    ) -> Self {
        let linear = view.view_from_model;
        Self {
            width: view.width,
            height: view.height,
            guard_px,
            rect_px: screen_bounds::rect_px(facts, view, margin_px(largest_px)),
            background: settings.background,
            cull_back: settings.draws_fronts_only(facts.is_closed),
            is_mirrored: (linear.determinant() * view.scale[0] * view.scale[1]).is_sign_negative(),
            light: settings.light.in_model(facts.origin),
            depth_range: falsecolor::depth_range(facts.orbit_center, facts.orbit_radius, view),
            occlusion_slack: occlusion_slack(facts, view),
            reads_depth: eye_dome_exponent(settings) > 0.0
                || openness_power(settings) > 0.0
                || settings.shows_photos(),
        }
    }

    /// All of the picture: left, top, and one past right and bottom, pixels.
    pub(crate) fn whole_px(&self) -> [u32; 4] {
        [0, 0, self.width, self.height]
    }

    /// The viewport: larger than the picture by the guard band. A point is dropped by the device when its
    /// center leaves the view volume, even if its square still reaches into the picture; with the view volume
    /// widened by half the largest square, none of those is lost.
    pub(crate) fn viewport(&self) -> [f32; 4] {
        let guard = self.guard_px as f32;
        [
            -guard,
            -guard,
            self.width as f32 + 2.0 * guard,
            self.height as f32 + 2.0 * guard,
        ]
    }

    /// The sign of the area of triangles that are not drawn (clockwise is positive); 0 where all are. Fronts turn
    /// counter-clockwise unless the camera mirrors.
    pub(crate) fn dropped_sign(&self) -> i32 {
        match (self.cull_back, self.is_mirrored) {
            (false, _) => 0,
            (true, false) => 1,
            (true, true) => -1,
        }
    }
}

/// The flags of a frame; `cull_back`: no triangle that shows its back is drawn.
pub(crate) fn frame_flags(view: &View, settings: &Settings, cull_back: bool) -> u32 {
    let mut flags = 0;
    for (on, flag) in [
        (settings.use_colors, constants::FLAG_USE_COLORS),
        (settings.two_sided, constants::FLAG_TWO_SIDED),
        (
            settings.color_by == ColorBy::Primitive,
            constants::FLAG_COLOR_BY_PRIMITIVE,
        ),
        (
            settings.color_by == ColorBy::Classification,
            constants::FLAG_COLOR_BY_CLASSIFICATION,
        ),
        (
            settings.color_by == ColorBy::Level,
            constants::FLAG_COLOR_BY_LEVEL,
        ),
        (
            settings.color_by == ColorBy::Normal,
            constants::FLAG_COLOR_BY_NORMAL,
        ),
        (
            settings.color_by == ColorBy::Depth,
            constants::FLAG_COLOR_BY_DEPTH,
        ),
        (
            view.light == HeadlightSource::Directional || !view.is_perspective,
            constants::FLAG_PARALLEL_LIGHT,
        ),
        (!view.is_perspective, constants::FLAG_ORTHOGRAPHIC),
        (cull_back, constants::FLAG_CULLS_BACK),
        (
            matches!(settings.light, SurfaceLighting::Phong(_)),
            constants::FLAG_PHONG,
        ),
        (
            matches!(settings.light, SurfaceLighting::Sphere(_)),
            constants::FLAG_LIT_SPHERE,
        ),
    ] {
        if on {
            flags |= flag;
        }
    }
    flags
}

/// Exponent of eye-dome lighting of strength 1, for each doubling of the distance from one neighbor of eight: a step of 1 %
/// along one side of a pixel takes a fifth of its light.
const EYE_DOME_EXPONENT: f32 = 18.0;

/// Value of [`FrameConstants::eye_dome`] of settings that [`resolve_settings`](crate::render::frame_plan::resolve_settings) gave.
pub(crate) fn eye_dome_exponent(settings: &Settings) -> f32 {
    match settings.eye_dome {
        EyeDome::On => EYE_DOME_EXPONENT * settings.eye_dome_strength,
        EyeDome::Auto | EyeDome::Off => 0.0,
    }
}

/// Power of the openness at strength 1: see `src/render/reference/ambient_occlusion.rs`.
const OPENNESS_POWER: f32 = 2.0;

/// Value of [`FrameConstants::ambient_occlusion`] of settings that
/// [`resolve_settings`](crate::render::frame_plan::resolve_settings) gave.
pub(crate) fn openness_power(settings: &Settings) -> f32 {
    match settings.ambient_occlusion {
        AmbientOcclusion::On => OPENNESS_POWER * settings.ambient_occlusion_strength,
        AmbientOcclusion::Auto | AmbientOcclusion::Off => 0.0,
    }
}

/// Lamps, colors and rim of a lit sphere as the uniform block has them.
fn sphere_words(lights: &SphereLights) -> ([[f32; 4]; 4], [[f32; 4]; 4], [f32; 4]) {
    let lamp = |i: usize| lights.directions[i].extend(lights.specular[i]).to_array();
    let color = |i: usize| lights.colors[i].extend(0.0).to_array();
    let (sky, ground) = (lights.sky.extend(lights.wrap), lights.ground.extend(0.0));
    (
        [lamp(0), lamp(1), lamp(2), sky.to_array()],
        [color(0), color(1), color(2), ground.to_array()],
        lights.rim.extend(lights.rim_power).to_array(),
    )
}

/// The uniform block of a frame.
pub(crate) fn frame_constants(
    view: &View,
    settings: &Settings,
    context: &FrameContext,
) -> FrameConstants {
    let [_, _, width, height] = context.viewport();
    // Maps the picture's clip space into the middle of the wider viewport.
    let shrink = Mat4::from_scale(Vec3::new(
        view.width as f32 / width,
        view.height as f32 / height,
        1.0,
    ));
    let clip = shrink * view.clip_from_view();
    // x_ndc = 2 px / W - 1 and x_ndc = (sx x + ox z) / -z with z = -1: x = (x_ndc + ox) / sx.
    let [sx, sy] = view.scale;
    let [ox, oy] = view.offset;
    let phong = match context.light {
        SurfaceLighting::Phong(phong) => phong,
        // Only the exponent is looked at.
        SurfaceLighting::Sphere(sphere) => Phong {
            shininess: sphere.lights().shininess,
            ..Phong::default()
        },
        // Not looked at.
        SurfaceLighting::Headlight => Phong::default(),
    };
    let (sphere_lamps, sphere_colors, sphere_rim) = match context.light {
        SurfaceLighting::Sphere(sphere) => sphere_words(&sphere.lights()),
        SurfaceLighting::Headlight | SurfaceLighting::Phong(_) => Default::default(),
    };
    let lamp = match phong.lamp.in_view(view) {
        LampSource::Direction(direction) => direction.as_vec3().extend(0.0),
        LampSource::Point(position) => position.as_vec3().extend(1.0),
    }
    .to_array();
    let columns = |m: Mat4| -> [[f32; 4]; 4] {
        [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c: Vec4| c.to_array())
    };
    let flags = frame_flags(view, settings, context.cull_back);
    FrameConstants {
        view_from_model: columns(view.view_from_model),
        clip_from_view: columns(clip),
        ray_scale: [
            2.0 / (view.width as f32 * sx),
            -2.0 / (view.height as f32 * sy),
        ],
        // Orthographic: x_ndc = sx x + ox.
        ray_offset: if view.is_perspective {
            [(ox - 1.0) / sx, (oy + 1.0) / sy]
        } else {
            [(-ox - 1.0) / sx, (1.0 - oy) / sy]
        },
        focal_px: view.focal_px(),
        splat_size_px: settings.threshold_px.max(1.0),
        model_scale: view.model_scale,
        flags,
        background: {
            let [r, g, b] = settings.background;
            [r, g, b, 0.0]
        },
        lamp,
        ambient: phong.ambient,
        specular: phong.specular,
        shininess: phong.shininess,
        low_pass_px: settings.low_pass_px(),
        depth_range: context.depth_range,
        eye_dome: eye_dome_exponent(settings),
        depth_offset: settings.depth_offset(),
        window_from_model: columns(window_from_model(view)),
        headlight: if flags & constants::FLAG_PARALLEL_LIGHT != 0 {
            view.backward.extend(0.0)
        } else {
            view.eye.extend(1.0)
        }
        .to_array(),
        ambient_occlusion: openness_power(settings),
        ambient_occlusion_px: settings.ambient_occlusion_radius_px(view.width, view.height),
        ambient_occlusion_slack: context.occlusion_slack,
        unused: 0.0,
        sphere_lamps,
        sphere_colors,
        sphere_rim,
        background_change: {
            let gradient = BackgroundGradient::of(settings);
            let [red, green, blue] = gradient.map_or([0.0; 3], |gradient| gradient.change);
            [red, green, blue, 0.0]
        },
    }
}

/// From model space to pixels and reversed depth, both times the last component; multiplied in double precision.
fn window_from_model(view: &View) -> Mat4 {
    let half = DVec3::new(
        f64::from(view.width) / 2.0,
        f64::from(view.height) / 2.0,
        1.0,
    );
    let window_from_clip = DMat4::from_translation(half.with_z(0.0)) * DMat4::from_scale(half);
    (window_from_clip * view.clip_from_view().as_dmat4() * view.view_from_model.as_dmat4())
        .as_mat4()
}
