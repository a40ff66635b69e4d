//! Every structure that a shader reads, byte for byte.
//!
//! `build.rs` reads the offsets from the compiled shaders and this file asserts them at compile time.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// One mesh vertex, 20 bytes: what the vertex buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// Position in model space.
    pub position: Vec3,
    /// Unit normal, [`octahedral`](crate::math::octahedral) 2 x 16 bit.
    pub normal: [i16; 2],
    /// Red, green, blue (0..=255, used as value / 255 without decoding); alpha 255, or 0 when the vertex
    /// has no normal and is to be shaded as if it faced the light.
    pub color: [u8; 4],
}

/// One splat to draw, 24 bytes: what the draw list holds.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Center in model space.
    pub center: Vec3,
    /// Radius, or the size of the frame.
    pub radius: SplatRadius,
    /// Unit normal, octahedral 2 x 16 bit.
    pub normal: [i16; 2],
    /// As in [`Vertex::color`].
    pub color: [u8; 4],
}

/// Radius of a splat in a draw list, 4 bytes: its own, or that of the frame. In the latter case there is room for what the
/// codes of normal and color leave out; shaders tell the two by the highest bit.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct SplatRadius(f32);

impl SplatRadius {
    /// Radius of the frame.
    pub const OF_FRAME: Self = Self(0.0);

    /// Bit that marks a rest. No radius is negative.
    const REST: u32 = 1 << 31;

    /// Radius of its own, model units; 0 is that of the frame.
    #[inline(always)]
    pub const fn own(radius: f32) -> Self {
        Self(radius)
    }

    /// Radius of the frame with the rests of normal (2 x 11 bit signed, steps of 2^-10 of its code) and color (3 x 3 bit, steps
    /// of 2^-3), from the lowest bit.
    #[inline(always)]
    pub const fn with_rest(bits: u32) -> Self {
        Self(f32::from_bits(bits | Self::REST))
    }

    /// Model units; 0 where it is that of the frame.
    #[inline(always)]
    pub const fn model_units(self) -> f32 {
        match self.0.to_bits() & Self::REST {
            0 => self.0,
            _ => 0.0,
        }
    }

    /// Bits of the rests, negative; 0 where there are none.
    #[inline(always)]
    pub const fn rest(self) -> i32 {
        let bits = self.0.to_bits() as i32;
        if bits < 0 { bits } else { 0 }
    }
}

/// A splat with the area that it stands for, 28 bytes: what fuzzy splats are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WeightedSplat {
    /// The splat.
    pub splat: Splat,
    /// Area of its patch of surface, model units squared; negative where it is unknown.
    pub area: f32,
}

/// A splat of a model by its number, 8 bytes: what a draw list holds where the device has the tree itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SplatId {
    /// The node or leaf.
    pub id: u32,
    /// 0: the node as one splat; in the halves, the lower first, which splat of a row of how many; or bits of a leaf.
    pub part: u32,
}

impl SplatId {
    /// The splat is a leaf.
    pub const LEAF: u32 = 1 << 31;
    /// The splat has its sphere's radius where others have the constant size.
    pub const OF_OWN_SIZE: u32 = 1 << 30;
    /// The splat lies in the plane of its triangle.
    pub const IN_PLANE: u32 = 1 << 29;

    /// First bit of how often the edges of a piece's triangle are halved, plus one.
    const PIECE_CUTS: u32 = 26;

    /// Most times that the edges of a piece's triangle are halved. A list of so many pieces of one triangle, 67 million records
    /// of 48 bytes, is all that 32 bits of a binding's size have room for.
    pub const MOST_CUTS: u32 = constants::MOST_PIECE_CUTS;

    /// A node as one splat.
    pub fn node(id: u32) -> Self {
        Self { id, part: 0 }
    }

    /// Splat `index` of the `count` (2 to [`cut::MAX_STRIP_COUNT`](crate::cut::MAX_STRIP_COUNT)) of a row.
    pub fn of_row(id: u32, count: u32, index: u32) -> Self {
        let part = count << 16 | index;
        Self { id, part }
    }

    /// A leaf.
    pub fn leaf(id: u32) -> Self {
        let part = Self::LEAF;
        Self { id, part }
    }

    /// Piece of a triangle, a filtered splat with a diameter of its own, whose edges are halved `cuts` times (at most
    /// [`SplatId::MOST_CUTS`]). The number of the piece has two bits for each time.
    pub fn of_piece(id: u32, cuts: u32, piece: u32) -> Self {
        let part = Self::LEAF | (cuts + 1) << Self::PIECE_CUTS | piece;
        Self { id, part }
    }
}

/// A fuzzy splat with its place in the picture, 48 bytes: what compute draws. Pairs of fields that lie in one word of 64 bits
/// are read together.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FuzzySplat {
    /// Where its center lies in the picture, pixels; x right and y down from the top left corner. Not finite where nothing
    /// is drawn.
    pub window_px: [f32; 2],
    /// Reversed depth (1 at the near, 0 at the far plane) of the center in the first pass, pushed away from the viewer by
    /// the depth offset; 0 hides nothing.
    pub pushed_depth: f32,
    /// xx, xy and yy of the inverse C of the footprint's quadratic form, square pixels: an offset x from the center is
    /// inside where x . C⁻¹ x <= (1 + skew . x)². Of a square its side in the first, pixels.
    pub inverse_px: [f32; 3],
    /// See `inverse_px`; 1 / pixels.
    pub skew: [f32; 2],
    /// Reversed depth of the center, 0..=1.
    pub depth: f32,
    /// Area that its patch of surface covers, square pixels; negative where it is unknown, or weights are 1.
    pub area_px: f32,
    /// In the headlight red, green and blue of the surface in the three lowest bytes, then the bits of their factor, a float.
    /// In the light of a lamp the shaded red and green in the halves of the first (lower half first), blue in the second,
    /// 65535 is 1.
    pub color: [u32; 2],
}

/// One filtered splat to draw, 48 bytes: a patch of surface by its integral over the pixel. Pairs of fields that lie in one
/// word of 64 bits are read together.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FilteredSplat {
    /// Where the center of the patch lies in the picture, pixels; x right and y down from the top left corner.
    pub window_px: [f32; 2],
    /// Reversed depth (1 at the near, 0 at the far plane) of the center in the first pass, pushed away from the viewer by
    /// the depth offset; 0 hides nothing.
    pub pushed_depth: f32,
    /// Side of the square that hides what is behind, at least 1 when drawn; pixels.
    pub side_px: f32,
    /// Reversed depth of the center, 0..=1.
    pub depth: f32,
    /// Projected area of what faces the viewer, square pixels.
    pub area_px: f32,
    /// Width and height of the rectangle over which that area is spread, above 0; pixels.
    pub extent_px: [f32; 2],
    /// Mean color of what is seen of the patch, shaded: red, green, blue in 0..=1.
    pub color: [f32; 3],
    /// Nothing.
    pub unused: u32,
}

/// A convex polygon in a plane, with a normal and a color that may vary over it; 152 bytes. Splats cut at sharp edges and patches of
/// a cut are such polygons.
///
/// A point of the plane is `center + u axis + v (normal x axis)`, u and v in model units.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct OrientedPolygon {
    /// Where u = v = 0, model space.
    pub center: Vec3,
    /// Radius around the center beyond which nothing is drawn (u² + v² above its square), model units; infinite where the
    /// corners alone bound the polygon.
    pub round_radius: f32,
    /// Unit normal of the plane, on the side that is seen.
    pub normal: Vec3,
    /// Greatest distance of the surface from the plane, model units: by what that is on the picture the polygon is
    /// widened. 0 for splats.
    pub thickness: f32,
    /// Unit vector in the plane, the direction of u.
    pub axis: Vec3,
    /// How many corners there are, 3 to [`OrientedPolygon::MOST_CORNERS`].
    pub corner_count: u32,
    /// (u, v) of the corners, counter-clockwise seen from the normal's side; those past the count repeat the last.
    pub corners: [[f32; 2]; 8],
    /// Normal for light at u = v = 0, model space; of length 1, or less where it averages a rough surface: the light that
    /// falls on it is multiplied by that length. Without direction it faces the light.
    pub shading_normal: Vec3,
    /// Red, green, blue at u = v = 0 (0..=255, used as value / 255 without decoding); alpha 255.
    pub color: [u8; 4],
    /// Change of that normal: it is `shading_normal + (s0 u + s1 v) axis + (s1 u + s2 v) (normal x axis)`, 1 / model
    /// units. 0 for splats.
    pub shape_operator: [f32; 3],
    /// Sine of the largest angle between the plane and a face that the polygon stands for: it is left out as facing away
    /// only where all of those do. 0 for the plane alone, 1 for never.
    pub spread: f32,
    /// Change of the color along u and along v: red, green, blue, of both times 2^e / 127 a model unit for the last of the
    /// first, the exponent e. 0 for splats.
    pub color_slopes: [[i8; 4]; 2],
}

impl OrientedPolygon {
    /// Most corners of a polygon.
    pub const MOST_CORNERS: usize = 8;
}

/// Constants of a frame that every pass knows, 480 bytes: the uniform block of `shaders/common/frame.glsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrameConstants {
    /// View space from model space, columns.
    pub view_from_model: [[f32; 4]; 4],
    /// Clip space (y down, reversed depth, guard band included) from view space, columns.
    pub clip_from_view: [[f32; 4]; 4],
    /// With `ray_offset`: view-space direction through framebuffer position p is (p * scale + offset, -1); in an
    /// orthographic view that is x and y of the position.
    pub ray_scale: [f32; 2],
    /// See `ray_scale`.
    pub ray_offset: [f32; 2],
    /// Pixels per unit of tangent (perspective) or per view-space unit (orthographic).
    pub focal_px: f32,
    /// Side of splats and points without a radius of their own, pixels.
    pub splat_size_px: f32,
    /// Length in view space of a unit vector in model space.
    pub model_scale: f32,
    /// Bits `FLAG_*` of [`constants`].
    pub flags: u32,
    /// Color of pixels where nothing is drawn; the last component is 0.
    pub background: [f32; 4],
    /// The lamp in view space: a position (last component 1), or the unit vector towards it (0).
    pub lamp: [f32; 4],
    /// Part of the lamp's light that comes from everywhere.
    pub ambient: f32,
    /// Value of the highlight at its middle.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Standard deviation of the Gaussian that fuzzy splats are widened by, pixels.
    pub low_pass_px: f32,
    /// Distances along the view direction between which the ramp of colors by depth goes, view-space units.
    pub depth_range: [f32; 2],
    /// Exponent of eye-dome lighting for each doubling of the distance from one neighbor of eight; 0 without.
    pub eye_dome: f32,
    /// Factor of the depth offset where splats are blended.
    pub depth_offset: f32,
    /// Window position (pixels of the picture) and reversed depth from model space, both times the last component, columns.
    pub window_from_model: [[f32; 4]; 4],
    /// Where the headlight is in model space: a position (last component 1), or the unit vector towards it (0).
    pub headlight: [f32; 4],
    /// Power of the openness of a pixel that ambient occlusion multiplies its color by; 0 without.
    pub ambient_occlusion: f32,
    /// How far around a pixel that looks, pixels.
    pub ambient_occlusion_px: f32,
    /// Rises of the surface by less than this hide nothing, view-space units.
    pub ambient_occlusion_slack: f32,
    /// Nothing.
    pub unused: f32,
    /// Lamps of a [`LitSphere`](crate::pack::lit_sphere::LitSphere): unit vectors towards them, each with the value of its
    /// highlight, and the light of the sky with the wrap; zero for other lights.
    pub sphere_lamps: [[f32; 4]; 4],
    /// Colors of the lamps, and the light of the ground.
    pub sphere_colors: [[f32; 4]; 4],
    /// Color of the rim, and its power.
    pub sphere_rim: [f32; 4],
    /// Color of the background at the lower edge of the picture less that at the upper; the last component is 0.
    pub background_change: [f32; 4],
}

/// What a pass over storage knows of the picture and of the bound part of a draw list: the uniform block of
/// `shaders/common/list.glsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ListConstants {
    /// The part of the picture that something may be drawn in, pixels: left, top, and one past right and bottom.
    pub rect_px: [u32; 4],
    /// Width and height of the picture, pixels.
    pub size_px: [u32; 2],
    /// Pixels by which the viewport of `clip_from_view` reaches beyond the picture on every side.
    pub guard_px: f32,
    /// Number of the first item of the bound part of the list.
    pub first: u32,
    /// How many items the bound part has.
    pub count: u32,
    /// Where the first lies in what is bound.
    pub begin: u32,
    /// Sign of twice the area (clockwise on the picture is positive) of the triangles that are dropped; 0: none.
    pub dropped_sign: i32,
}

/// Shaders as compiled by `build.rs`, with what they declare.
mod generated {
    #![allow(clippy::unreadable_literal, reason = "written by build.rs")]
    use super::{
        BindingKind, BoolConstant, CompiledShader, ShaderStage, ShaderVariants, UintConstant,
    };
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

pub use device_cut::{CutConstants, CutCounters};
pub use filtered_list::FilteredConstants;
pub use generated::{constants, specialization};
/// The compiled shaders: `<FOLDER>_<FILE>_<STAGE>`.
pub mod shaders {
    pub use super::generated::*;
}

/// Stage of a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShaderStage {
    /// Vertex shader.
    Vertex,
    /// Fragment shader.
    Fragment,
    /// Compute shader.
    Compute,
}

/// Kind of a descriptor binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum BindingKind {
    /// `uniform` block.
    UniformBuffer,
    /// `buffer` block.
    StorageBuffer,
    /// Combined image and sampler.
    SampledImage,
    /// Storage image.
    StorageImage,
}

/// A compiled shader and what it declares.
#[derive(Debug, Clone, Copy)]
pub struct CompiledShader {
    /// Folder, file and stage with dots: `triangles.draw.vert`.
    pub name: &'static str,
    /// Stage.
    pub stage: ShaderStage,
    /// SPIR-V.
    pub words: &'static [u32],
    /// Bindings of descriptor set 0, ascending.
    pub bindings: &'static [(u32, BindingKind)],
    /// Vertex inputs, ascending by location.
    pub inputs: &'static [(u32, &'static str)],
    /// Number of color outputs of a fragment shader: their locations are 0 up to it.
    pub outputs: u32,
    /// Numbers and names of the specialization constants, ascending.
    pub constants: &'static [(u32, &'static str)],
    /// Size of the push constant block, bytes.
    pub push_constant_bytes: u32,
    /// Workgroup size of a compute shader.
    pub local_size: [u32; 3],
}

/// Name of a specialization constant that is a truth value; all are in [`specialization`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoolConstant(&'static str);

impl BoolConstant {
    /// Gives it a value.
    pub const fn is(self, value: bool) -> ConstantValue {
        ConstantValue {
            name: self.0,
            value: value as u32,
        }
    }
}

/// Name of a specialization constant that is an unsigned number; all are in [`specialization`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UintConstant(&'static str);

impl UintConstant {
    /// Gives it a value.
    pub const fn is(self, value: u32) -> ConstantValue {
        ConstantValue {
            name: self.0,
            value,
        }
    }
}

/// A specialization constant with its value, for the shaders of a pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConstantValue {
    /// Name in the shaders.
    pub name: &'static str,
    /// A number, or 1 and 0 for true and false.
    pub value: u32,
}

/// A fragment shader with and without its last output, the normals; `build.rs` makes both.
#[derive(Debug, Clone, Copy)]
pub struct ShaderVariants {
    /// For passes without a target for normals.
    pub plain: &'static CompiledShader,
    /// For passes with one.
    pub with_normals: &'static CompiledShader,
}

impl ShaderVariants {
    /// The variant of passes with (`normals`) or without a target for normals.
    pub const fn of(self, normals: bool) -> &'static CompiledShader {
        if normals {
            self.with_normals
        } else {
            self.plain
        }
    }
}

/// Stops the build when a field of a structure here is not where the shaders have it.
macro_rules! same_layout {
    ($type:ident, $module:ident, $($field:ident = $constant:ident),+ $(,)?) => {
        const _: () = {
            $(assert!(
                std::mem::offset_of!($type, $field) == generated::layout::$module::$constant,
                concat!("abi::", stringify!($type), "::", stringify!($field), " is not where the shaders have it")
            );)+
            assert!(
                size_of::<$type>() == generated::layout::$module::END,
                concat!("abi::", stringify!($type), " does not end where the shaders' block ends")
            );
            assert!(
                [$(stringify!($field)),+].len() == generated::layout::$module::FIELDS,
                concat!("abi::", stringify!($type), " has another number of fields than the shaders' block")
            );
        };
    };
}

same_layout!(
    FrameConstants,
    frame_constants,
    view_from_model = VIEW_FROM_MODEL,
    clip_from_view = CLIP_FROM_VIEW,
    ray_scale = RAY_SCALE,
    ray_offset = RAY_OFFSET,
    focal_px = FOCAL_PX,
    splat_size_px = SPLAT_SIZE_PX,
    model_scale = MODEL_SCALE,
    flags = FLAGS,
    background = BACKGROUND,
    lamp = LAMP,
    ambient = AMBIENT,
    specular = SPECULAR,
    shininess = SHININESS,
    low_pass_px = LOW_PASS_PX,
    depth_range = DEPTH_RANGE,
    eye_dome = EYE_DOME,
    depth_offset = DEPTH_OFFSET,
    window_from_model = WINDOW_FROM_MODEL,
    headlight = HEADLIGHT,
    ambient_occlusion = AMBIENT_OCCLUSION,
    ambient_occlusion_px = AMBIENT_OCCLUSION_PX,
    ambient_occlusion_slack = AMBIENT_OCCLUSION_SLACK,
    unused = UNUSED,
    sphere_lamps = SPHERE_LAMPS,
    sphere_colors = SPHERE_COLORS,
    sphere_rim = SPHERE_RIM,
    background_change = BACKGROUND_CHANGE,
);
same_layout!(
    ListConstants,
    list_constants,
    rect_px = RECT_PX,
    size_px = SIZE_PX,
    guard_px = GUARD_PX,
    first = FIRST,
    count = COUNT,
    begin = BEGIN,
    dropped_sign = DROPPED_SIGN,
);
mod device_cut;
mod filtered_list;
mod patch_texture;
mod photos;
pub use patch_texture::PatchTexture;
pub use photos::{PhotoGroup, PhotoHeader, PhotoTable};

same_layout!(
    Splat,
    splat_record,
    center = CENTER,
    radius = RADIUS,
    normal = NORMAL,
    color = COLOR,
);
same_layout!(
    OrientedPolygon,
    polygon_record,
    center = CENTER,
    round_radius = ROUND_RADIUS,
    normal = NORMAL,
    thickness = THICKNESS,
    axis = AXIS,
    corner_count = CORNER_COUNT,
    corners = CORNERS,
    shading_normal = SHADING_NORMAL,
    color = COLOR,
    shape_operator = SHAPE_OPERATOR,
    spread = SPREAD,
    color_slopes = COLOR_SLOPES,
);
const _: () = {
    use generated::layout::filtered_record as record;
    assert!(
        std::mem::offset_of!(FilteredSplat, window_px) == record::WINDOW
            && std::mem::offset_of!(FilteredSplat, pushed_depth) == record::PUSHED_SIDE
            && std::mem::offset_of!(FilteredSplat, side_px) == record::PUSHED_SIDE + 4
            && std::mem::offset_of!(FilteredSplat, depth) == record::DEPTH_AREA
            && std::mem::offset_of!(FilteredSplat, area_px) == record::DEPTH_AREA + 4
            && std::mem::offset_of!(FilteredSplat, extent_px) == record::EXTENT
            && std::mem::offset_of!(FilteredSplat, color) == record::RED_GREEN
            && std::mem::offset_of!(FilteredSplat, unused) == record::BLUE_NOTHING + 4
            && size_of::<FilteredSplat>() == record::END,
        "abi::FilteredSplat is not what the shaders have"
    );
};
const _: () = {
    use generated::layout::fuzzy_record as record;
    assert!(
        std::mem::offset_of!(FuzzySplat, window_px) == record::WINDOW
            && std::mem::offset_of!(FuzzySplat, pushed_depth) == record::PUSHED_XX
            && std::mem::offset_of!(FuzzySplat, inverse_px) == record::PUSHED_XX + 4
            && record::XY_YY == record::PUSHED_XX + 8
            && std::mem::offset_of!(FuzzySplat, skew) == record::SKEW
            && std::mem::offset_of!(FuzzySplat, depth) == record::DEPTH_AREA
            && std::mem::offset_of!(FuzzySplat, area_px) == record::DEPTH_AREA + 4
            && std::mem::offset_of!(FuzzySplat, color) == record::COLOR
            && size_of::<FuzzySplat>() == record::END,
        "abi::FuzzySplat is not what the shaders have"
    );
};
same_layout!(
    Vertex,
    vertex_record,
    position = POSITION,
    normal = NORMAL,
    color = COLOR,
);
