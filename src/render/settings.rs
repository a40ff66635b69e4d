//! Everything that decides a picture besides model and camera.

use crate::cut::SizeMetric;
use crate::math::camera::View;
use crate::math::section_box::SectionBox;
use crate::oriented::splats::SplatRules;
use crate::pack::{ColorBy, Footprint, SurfaceLighting};
use crate::patches::PatchRules;
use crate::render::outputs::PictureOutputs;

/// Method by which the model is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Every triangle of the mesh: the reference.
    Triangles,
    /// Every vertex as a splat of the threshold's size, without a tree.
    Points,
    /// Splats only: where a triangle is large on screen, a splat of its own size stands for it (QSplat).
    Splats,
    /// Triangles where they are large on screen, splats where they are small (Benda, POP).
    #[default]
    Pop,
}

/// Look of a splat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SplatKind {
    /// A square, facing the viewer.
    #[default]
    Square,
    /// A disc, facing the viewer.
    Disc,
    /// A disc in the plane of the surface, seen in perspective.
    Ellipse,
    /// Ellipses as [`SplatKind::Ellipse`] has, with weights that fall off as a Gaussian of half the radius.
    Gauss,
    /// One pixel at the center where it is visible; what lies between is reconstructed on the picture.
    Visibility,
    /// A rectangle that deposits the area its patch of surface covers; the sums are coverage and mean color.
    Filtered,
}

impl SplatKind {
    /// Tells whether the processor can draw such splats in the place of a software device.
    pub fn host_draws(self) -> bool {
        matches!(self, Self::Square | Self::Disc | Self::Filtered)
    }
}

/// Way in which splats that overlap become one surface. Square, disc, ellipse and Gaussian only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Blend {
    /// The nearest wins.
    Opaque,
    /// Two passes and a division: the weighted mean of all within the depth offset of the front.
    TwoPass,
    /// One pass with a depth threshold. Depends on the order of drawing; in the reference only.
    DepthThreshold,
    /// One pass with a depth range a pixel. Depends on the order of drawing; in the reference only.
    DepthRange,
}

/// When a splat is lit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shading {
    /// Once a splat; the colors are blended.
    #[default]
    PerSplat,
    /// Once a pixel: normals and albedo are blended, the mean is lit. Only where splats are blended.
    Deferred,
}

/// Of what the sums of blended splats are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SumFormat {
    /// 16-bit floats: half the memory; sums stall or overflow where thousands of splats meet in a pixel.
    Half,
    /// 32-bit floats.
    Float,
}

/// Way in which [`SplatKind::Visibility`] fills the pixels between the centers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reconstruction {
    /// A Gaussian of the threshold's radius.
    #[default]
    Gaussian,
    /// A Gaussian whose radius follows the density of centers around the pixel.
    Density,
    /// Pull-push over a pyramid of half sizes.
    PullPush,
}

/// Choice of what draws small primitives on a device. The picture is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// Compute shaders where the device and the splats allow it and they are cheaper ([`costs`](crate::render::cost::model)), else the
    /// rasterizer.
    #[default]
    Auto,
    /// The rasterizer alone.
    Raster,
    /// Compute shaders; refused where they cannot.
    Compute,
}

/// Choice of who makes the cut of a device's frame. The picture is the same, but where two surfaces are equally near.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CutOn {
    /// The device where it can and was measured to be faster, else the processor.
    #[default]
    Auto,
    /// The processor.
    Processor,
    /// The device; refused where it cannot.
    Device,
}

/// Start of the processor's traversal for the cut of a frame. The picture is the same to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CutTraversal {
    /// Start that was measured to be faster: at the root (docs/PERFORMANCE.md).
    #[default]
    Auto,
    /// At the root.
    Root,
    /// Start at the last cut, as far as that is known to give the same lists, else at the root
    /// ([`cut::Selector::set_coherent`](crate::cut::CutSelector::set_coherent)).
    Coherent,
}

/// Contents of what the processor tells a device of the splats and triangles of a cut. The picture is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ListOf {
    /// Numbers where the device has memory of its own and they will do, else records.
    #[default]
    Auto,
    /// The numbers of nodes, leaves and triangles: the device has the tree, and makes the records; refused where it cannot.
    Ids,
    /// Records of each: centers, normals, colors; corners.
    Records,
}

/// Choice to leave out splats that nearer splats hide. The picture is the same to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Occlusion {
    /// Left out where that pays.
    #[default]
    Auto,
    /// Wherever it can be told: of opaque squares and discs that a cut chooses.
    On,
    /// Never.
    Off,
}

/// Choice to darken pixels whose neighbors are nearer, so that depth shows where nothing is lit (eye-dome lighting).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EyeDome {
    /// Of points without normals.
    Auto,
    /// Always.
    On,
    /// Never.
    #[default]
    Off,
}

/// Choice to darken pixels that lie deeper than what is around them (ambient occlusion in screen space), so that shape shows
/// where the light is even.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AmbientOcclusion {
    /// Shaded colors of what has normals, but not where pushed depths of blended splats lie beside those of triangles.
    Auto,
    /// Always.
    On,
    /// Never.
    #[default]
    Off,
}

/// Contents of photographs that are shown on the surface, where some are given to the renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PhotoDisplay {
    /// Nothing.
    #[default]
    Off,
    /// Colors of the photographs.
    Color,
    /// Index of the photograph that is the best at a pixel, as a color.
    Source,
}

/// Source of oriented polygons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PolygonSource {
    /// Vertices of the mesh, by these rules.
    Vertices(SplatRules),
    /// Nodes of the tree, by these rules.
    Patches(PatchRules),
}

/// Choice to drop what faces away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Culling {
    /// Dropped where it cannot be seen: on surfaces that are closed and oriented outward, unless they surround the eye.
    #[default]
    Auto,
    /// Always. On an open surface its back disappears.
    On,
    /// Never.
    Off,
}

/// Everything that decides a picture besides model and camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Method by which the model is drawn.
    pub method: Method,
    /// Look of splats.
    pub splat: SplatKind,
    /// Splats are made from the vertices of the mesh instead of the tree, by these rules; of [`Method::Splats`] only.
    pub vertex_splats: Option<SplatRules>,
    /// Nodes whose error is small are drawn as one oriented polygon, whatever their size; of [`Method::Pop`] and surfaces only.
    /// Their records are made at the first frame that has patches, and kept: about 80 bytes a triangle.
    pub patches: Option<PatchRules>,
    /// Way of blending them; `None` is the usual way of their kind, [`Settings::blend`].
    pub blend: Option<Blend>,
    /// When splats are lit.
    pub shading: Shading,
    /// Of what the sums of blended splats are made; `None` is 32-bit floats where the device can blend them, else 16-bit.
    /// The reference has 32-bit floats.
    pub sums: Option<SumFormat>,
    /// Standard deviation of the Gaussian that [`SplatKind::Gauss`] splats are widened by where they are blended,
    /// pixels, 0 to 16; `None` is the usual one, [`Settings::low_pass_px`].
    pub low_pass_px: Option<f32>,
    /// Way of reconstructing between visibility splats.
    pub reconstruction: Reconstruction,
    /// Choice of what draws small primitives on a device.
    pub path: Path,
    /// Choice of who makes the cut on a device.
    pub cut_on: CutOn,
    /// Start of the processor's traversal for a cut.
    pub traversal: CutTraversal,
    /// Contents of draw lists on a device.
    pub list_of: ListOf,
    /// Choice to leave out what is hidden.
    pub occlusion: Occlusion,
    /// Largest projected diameter of a node drawn whole, and size of its splat; pixels. At least 0. Some frames take less than
    /// a pixel and a half for a pixel, see [`crate::render::frame_plan::resolve_settings`].
    pub threshold_px: f32,
    /// Factor of the depth offset where splats are blended; at least 0; `None` is the usual one of their kind,
    /// [`Settings::depth_offset`].
    pub depth_offset: Option<f32>,
    /// Darkening by what is nearer beside a pixel; never of colors that are data.
    pub eye_dome: EyeDome,
    /// Strength of that: 0 to 10, usually 1.
    pub eye_dome_strength: f32,
    /// Darkening of what lies deep between its surroundings; never of colors that are data.
    pub ambient_occlusion: AmbientOcclusion,
    /// Strength of that: 0 to 10, usually 1.
    pub ambient_occlusion_strength: f32,
    /// Radius around a pixel that it looks at, 1 to 256 pixels; `None` is the usual part of the picture, see
    /// [`Settings::ambient_occlusion_radius_px`].
    pub ambient_occlusion_reach_px: Option<f32>,
    /// Photographs on the surface, in place of its shaded colors.
    pub photos: PhotoDisplay,
    /// Surface that no photograph shows is marked; else it keeps its shaded color.
    pub marks_uncovered: bool,
    /// Back-face and normal-cone culling.
    pub culling: Culling,
    /// Source of the color.
    pub color_by: ColorBy,
    /// Light on surfaces; positions in world space.
    pub light: SurfaceLighting,
    /// Light both sides of a surface.
    pub two_sided: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// Background, red green blue in 0..=1.
    pub background: [f32; 3],
    /// Background at the lower edge of the picture, where it is not the same everywhere: what lies between changes evenly, and
    /// is dithered.
    pub background_bottom: Option<[f32; 3]>,
    /// Meaning of "projected diameter".
    pub size: SizeMetric,
    /// Draw the cut of this view, held while the camera looks at it from elsewhere; none: that of the view which is drawn.
    /// Splats have the size in the model that they have in that view, and what it does not see is not there. Methods without
    /// a cut draw as ever.
    pub cut_view: Option<View>,
    /// Draw only what touches this box; leaves that do are drawn whole. Rears are seen through what is cut open, so
    /// [`Culling::Auto`] keeps them. Of methods with a cut, and of [`Method::Triangles`].
    pub section: Option<SectionBox>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Pop,
            splat: SplatKind::Square,
            vertex_splats: None,
            patches: None,
            blend: None,
            shading: Shading::PerSplat,
            sums: None,
            low_pass_px: None,
            reconstruction: Reconstruction::Gaussian,
            path: Path::Auto,
            cut_on: CutOn::Auto,
            traversal: CutTraversal::Auto,
            list_of: ListOf::Auto,
            occlusion: Occlusion::Auto,
            depth_offset: None,
            threshold_px: 1.0,
            eye_dome: EyeDome::Off,
            eye_dome_strength: 1.0,
            ambient_occlusion: AmbientOcclusion::Off,
            ambient_occlusion_strength: 1.0,
            ambient_occlusion_reach_px: None,
            photos: PhotoDisplay::Off,
            marks_uncovered: false,
            culling: Culling::Auto,
            color_by: ColorBy::Shading,
            light: SurfaceLighting::Headlight,
            two_sided: true,
            use_colors: true,
            background: [0.0; 3],
            background_bottom: None,
            size: SizeMetric::Exact,
            cut_view: None,
            section: None,
        }
    }
}

impl Settings {
    /// Tells whether the headlight and nothing else decides how bright a surface is: no lamp, and no data as colors.
    pub fn has_headlight(&self) -> bool {
        self.light == SurfaceLighting::Headlight && !self.color_by.is_data()
    }

    /// Tells whether everything is gray, of models that have colors or none.
    pub(crate) fn shades_gray(&self, has_colors: bool) -> bool {
        let is_shaded = self.color_by == ColorBy::Shading;
        is_shaded && self.light.is_gray() && !(self.use_colors && has_colors)
    }

    /// Tells whether patches of a model with images show these.
    pub(crate) fn textures_patches(&self) -> bool {
        let shows_colors = self.use_colors && self.color_by == ColorBy::Shading;
        shows_colors && self.drawn_patches().is_some()
    }

    /// Tells whether photographs are put on the surface.
    pub fn shows_photos(&self) -> bool {
        self.photos != PhotoDisplay::Off
    }

    /// Contents that a frame of these settings has to hold besides color for its looks, and for pictures with these outputs:
    /// photographs are weighed by normals, where the splats have any.
    pub fn outputs_of_frame(&self, outputs: PictureOutputs) -> PictureOutputs {
        PictureOutputs {
            normal: outputs.normal || (self.shows_photos() && !self.draws_filtered()),
            depth: outputs.depth || self.shows_photos(),
            ..outputs
        }
    }

    /// Tells whether what faces away is dropped for a model that is closed or not, seen from outside.
    pub fn culls_back(&self, is_closed: bool) -> bool {
        match self.culling {
            Culling::Auto => is_closed,
            Culling::On => true,
            Culling::Off => false,
        }
    }

    /// Tells whether only what faces the eye is drawn: where the cut drops what faces away, unless it is looked at from
    /// elsewhere.
    pub fn draws_fronts_only(&self, is_closed: bool) -> bool {
        self.culls_back(is_closed) && !self.holds_cut()
    }

    /// Tells whether the cut is that of another view.
    pub fn holds_cut(&self) -> bool {
        self.cut_view.is_some() && self.has_cut()
    }

    /// The view whose cut is drawn in `view`.
    pub fn view_of_cut<'a>(&'a self, view: &'a View) -> &'a View {
        self.cut_view.as_ref().unwrap_or(view)
    }

    /// Tells whether any splat is drawn.
    pub fn draws_splats(&self) -> bool {
        self.method != Method::Triangles
    }

    /// The rules by which splats are made from vertices; `None` where they are not.
    pub fn drawn_vertex_splats(&self) -> Option<&SplatRules> {
        let rules = self.vertex_splats.as_ref();
        rules.filter(|_| self.method == Method::Splats)
    }

    /// Source of the oriented polygons that are drawn; `None` where there are none.
    pub(crate) fn drawn_polygons(&self) -> Option<PolygonSource> {
        match (self.drawn_vertex_splats(), self.drawn_patches()) {
            (Some(rules), _) => Some(PolygonSource::Vertices(*rules)),
            (None, rules) => rules.map(PolygonSource::Patches),
        }
    }

    /// The rules by which nodes are drawn as patches; `None` where none is.
    pub fn drawn_patches(&self) -> Option<PatchRules> {
        let is_cut = self.method == Method::Pop;
        self.patches.filter(|rules| is_cut && rules.draw_any())
    }

    /// Tells whether pixels at the rims of patches show how much of them is covered. Data and photographs are of one place.
    pub(crate) fn covers_rims(&self) -> bool {
        let is_asked = self.drawn_patches().is_some_and(|rules| rules.covers_rims);
        is_asked && self.color_by == ColorBy::Shading && !self.shows_photos()
    }

    /// Settings of a sample of a pixel, of which a picture is the mean of many.
    pub(crate) fn of_sample(&self) -> Self {
        Self {
            patches: self.patches.map(|rules| PatchRules {
                covers_rims: false,
                ..rules
            }),
            ..*self
        }
    }

    /// Tells whether what is drawn is chosen before the frame: by a cut, or as splats from vertices.
    pub(crate) fn has_lists(&self) -> bool {
        self.has_cut() || self.drawn_vertex_splats().is_some()
    }

    /// Tells whether the cut decides what is drawn.
    pub fn has_cut(&self) -> bool {
        match self.method {
            Method::Splats => self.vertex_splats.is_none(),
            Method::Pop => true,
            Method::Triangles | Method::Points => false,
        }
    }

    /// Tells whether filtered splats are drawn: they need the sums of the tree ([`crate::tree::SurfaceMoments`]).
    pub fn draws_filtered(&self) -> bool {
        self.draws_splats() && self.splat == SplatKind::Filtered
    }

    /// Radius around a pixel of a picture of this size that ambient occlusion looks at, pixels: 4 % of the shorter side, so that
    /// pictures of one view look alike in any size.
    pub fn ambient_occlusion_radius_px(&self, width: u32, height: u32) -> f32 {
        let usual = (0.04 * width.min(height) as f32).clamp(4.0, 64.0);
        self.ambient_occlusion_reach_px.unwrap_or(usual)
    }

    /// Tells whether splats are drawn as visible centers with a reconstruction between them.
    pub fn draws_visibility(&self) -> bool {
        self.draws_splats() && self.splat == SplatKind::Visibility
    }

    /// Way of blending splats: Gaussians in two passes, the others not at all unless asked for.
    pub fn blend(&self) -> Blend {
        self.blend.unwrap_or(match self.splat {
            SplatKind::Gauss => Blend::TwoPass,
            _ => Blend::Opaque,
        })
    }

    /// Standard deviation of the Gaussian that splats are widened by, pixels. About that of a pixel's own box (0.29):
    /// a sharper rim would be jagged, a wider one blurred. 0 for all but blended Gaussians.
    pub fn low_pass_px(&self) -> f32 {
        if self.splat == SplatKind::Gauss && self.blend() == Blend::TwoPass {
            self.low_pass_px.unwrap_or(0.3)
        } else {
            0.0
        }
    }

    /// Tells whether the sums of weights are coverage: Gaussians that stand for a known area of surface.
    pub fn sums_coverage(&self, has_triangles: bool) -> bool {
        self.splat == SplatKind::Gauss
            && self.blend() == Blend::TwoPass
            && self.has_cut()
            && has_triangles
    }

    /// Pixels that a splat covers, of the kinds that cover any.
    pub fn footprint(&self) -> Footprint {
        match self.splat {
            SplatKind::Square | SplatKind::Filtered => Footprint::Square,
            SplatKind::Disc => Footprint::Circle,
            SplatKind::Ellipse | SplatKind::Gauss | SplatKind::Visibility => Footprint::Oriented,
        }
    }

    /// Factor of the depth offset. A filtered splat is pushed away by the depth that it and what is next to it take (at
    /// most half its side over the cosine of the viewing angle, which is at least 0.1), any other by its radius over that
    /// cosine, times this. What lies behind the front by
    /// less is mixed into it. 1 is enough for a smooth surface seen from the front; at a rim the surface turns away
    /// under the splat, where 1 loses area that filtered splats need, hence 3 for them (2 on what is not culled, see
    /// [`crate::render::pack_params::filtered_shade`]). Larger lets what is near
    /// behind thin parts shine through.
    pub fn depth_offset(&self) -> f32 {
        self.depth_offset.unwrap_or(match self.splat {
            SplatKind::Filtered => 3.0,
            _ => 1.0,
        })
    }
}
