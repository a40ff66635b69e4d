//! Fuzzy splats with their places in the picture, for compute: what a shader would find of each by two matrices, four roots
//! and eight quotients, four splats at a time.
//!
//! A software device reads each number of a matrix for eight splats; that and the quotients took longer than the pixels of
//! a small splat. A graphics card has the arithmetic for nothing and waits for memory: there the 48 bytes of these records
//! instead of 28 are a loss, and packing is. So it is measured which of the two a device draws faster.
//!
//! **Footprint.** A disc with center c, unit normal n and radius r in view space lies, to first order around its projected
//! center, in the ellipse x . C⁻¹ x <= 1 with C = s² P (I - n nᵀ) Pᵀ: P = (1 0 a; 0 1 b), (a, b, -1) = c / distance,
//! s = r / (distance * tangent of a pixel). That is the inverse of the form in `shaders/common/disc.glsl`, without its
//! quotients, and a Gaussian widens it by a sum. What makes it exact in perspective is the skew.

use crate::abi::constants::{FULL_HIGHLIGHT, LARGEST_SMALL_BLENDED_PX, LEAST_BACK};
use crate::abi::{FuzzySplat, WeightedSplat};
use crate::cut::Cut;
use crate::math::camera::{HeadlightSource, View};
use crate::pack::light::{LampSource, Phong, SurfaceLighting};
use crate::pack::lit_sphere::{LitSurface, SphereLights};
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::pack::splats::{
    NumberedSplat, PackedSplats, SplatOutput, SplatPlan, SplatRecord as _, SplatWriter, count,
    parts_of,
};
use crate::pack::{ALBEDO, ColorBy, Footprint};
use crate::tree::Model;
use bytemuck::Zeroable;
use glam::{Mat4, Vec3, Vec4};

/// Smallest ratio of the axes of a footprint, and least cosine by which depth offsets are divided.
const LEAST_RATIO: f32 = 0.1;
/// The least cosine under which a patch is taken to be seen.
const LEAST_FACING: f32 = 0.02;

/// How fuzzy splats look, besides their [`SplatPlan`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FuzzyLook {
    /// Weights fall off, and where the area of a patch is known add up to it.
    pub is_gauss: bool,
    /// Factor of the depth offset, see [`crate::render::Settings::depth_offset`].
    pub depth_offset: f32,
    /// Light both sides.
    pub two_sided: bool,
    /// What faces away is dropped.
    pub cull_back: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// What decides the color; no data ([`ColorBy::is_data`]).
    pub color_by: ColorBy,
    /// How surfaces are lit; positions in model space.
    pub light: SurfaceLighting,
}

/// What was written: small splats with their places from the start of the list; up to its end [`WeightedSplat`]s that are
/// larger than [`LARGEST_SMALL_BLENDED_PX`], each in the first bytes of a record, first those to draw as points.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PlacedFuzzy {
    /// Number of small splats. Those that lie nowhere in the picture's depth count too; they cover no pixel.
    pub small: usize,
    /// Number of larger ones that are points.
    pub points: usize,
    /// Number of those that may be too large for points.
    pub quads: usize,
}

impl PlacedFuzzy {
    /// Number of all of them.
    pub fn all(&self) -> usize {
        self.small + self.points + self.quads
    }
}

/// Writes the splats of a cut, as [`crate::pack::splats::pack`] does, into the first [`count`] records of `out`.
///
/// # Panics
/// When `out` is shorter than [`count`].
pub fn pack(
    model: &Model,
    cut: &Cut,
    view: &View,
    (plan, look): (&SplatPlan, &FuzzyLook),
    out: &mut [FuzzySplat],
) -> PlacedFuzzy {
    let writer = SplatWriter::new(model, view, plan);
    let eye = FuzzyEye::new(view, plan, look);
    let PackedSplats { points, quads } = parallel::write(parts_of(cut, plan), out, |part, sink| {
        let mut four = WaitingSplats::new(&eye, sink);
        writer.part(part, &mut four);
        four.finish();
    });
    let end = count(cut, plan);
    let large = &mut out[end - quads..end];
    // Stable, so that the list does not depend on threads.
    large.sort_by_key(is_quad);
    let of_points = large.partition_point(|r| !is_quad(r));
    PlacedFuzzy {
        small: points,
        points: of_points,
        quads: quads - of_points,
    }
}

/// A splat that the rasterizer draws, in the place of a small one.
fn large(splat: WeightedSplat, is_quad: bool) -> FuzzySplat {
    let mut record = FuzzySplat::zeroed();
    bytemuck::bytes_of_mut(&mut record)[..size_of::<WeightedSplat>()]
        .copy_from_slice(bytemuck::bytes_of(&splat));
    record.color[1] = u32::from(is_quad);
    record
}

fn is_quad(large: &FuzzySplat) -> bool {
    large.color[1] != 0
}

/// Splats that wait until they are four.
struct WaitingSplats<'e, 's, 'o> {
    eye: &'e FuzzyEye<'e>,
    sink: &'s mut RecordSink<'o, FuzzySplat>,
    waiting: [WeightedSplat; 4],
    count: usize,
}

impl<'e, 's, 'o> WaitingSplats<'e, 's, 'o> {
    fn new(eye: &'e FuzzyEye<'e>, sink: &'s mut RecordSink<'o, FuzzySplat>) -> Self {
        Self {
            eye,
            sink,
            waiting: [WeightedSplat::zeroed(); 4],
            count: 0,
        }
    }

    /// Writes those that still wait.
    fn finish(mut self) {
        if self.count > 0 {
            self.write();
        }
    }

    fn write(&mut self) {
        let (records, is_large) = self.eye.place(&self.waiting);
        for (lane, record) in records.iter().enumerate().take(self.count) {
            if is_large >> lane & 1 == 0 {
                self.sink.point(*record);
            } else {
                self.sink.quad(large(self.waiting[lane], false));
            }
        }
        self.count = 0;
    }
}

impl SplatOutput for WaitingSplats<'_, '_, '_> {
    #[inline]
    fn point(&mut self, named: &NumberedSplat) {
        self.waiting[self.count] = WeightedSplat::of(named);
        self.count += 1;
        if self.count == 4 {
            self.write();
        }
    }

    fn quad(&mut self, named: &NumberedSplat) {
        self.sink.quad(large(WeightedSplat::of(named), true));
    }
}

impl FuzzySplat {
    /// One splat with its place in the picture; none where it is larger than [`LARGEST_SMALL_BLENDED_PX`].
    pub fn new(
        splat: WeightedSplat,
        view: &View,
        plan: &SplatPlan,
        look: &FuzzyLook,
    ) -> Option<Self> {
        let (records, is_large) = FuzzyEye::new(view, plan, look).place(&[splat; 4]);
        (is_large & 1 == 0).then_some(records[0])
    }
}

/// Three dimensions of four vectors.
type Vectors = [Vec4; 3];

fn dot([a, b, c]: &Vectors, [x, y, z]: &Vectors) -> Vec4 {
    *a * *x + *b * *y + *c * *z
}

/// Four rows become four columns.
fn columns([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let lanes = Mat4::from_cols(a, b, c, d).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis]
}

/// The part of a frame that every splat needs, each number four times.
struct FuzzyEye<'a> {
    look: &'a FuzzyLook,
    is_perspective: bool,
    footprint: Footprint,
    /// Light along the view direction.
    is_parallel: bool,
    /// Rows of the matrix to view space, and those of its rotation.
    rows: [[Vec4; 4]; 3],
    turn: [Vectors; 3],
    /// The third component in clip space is the first times z plus the second.
    depth: [Vec4; 2],
    /// As [`crate::abi::FrameConstants::ray_scale`] and `ray_offset`.
    ray_scale: [Vec4; 2],
    ray_offset: [Vec4; 2],
    /// 1 / ray_scale: pixels of a unit of tangent, or of length, with its sign.
    pixels: [Vec4; 2],
    focal_px: Vec4,
    model_scale: Vec4,
    /// Half the side of splats without a radius of their own, at distance 1.
    half_size: Vec4,
    near: Vec4,
    depth_offset: Vec4,
    lamp: Option<(Phong, LampSource)>,
    sphere: Option<SphereLights>,
}

impl<'a> FuzzyEye<'a> {
    fn new(view: &View, plan: &SplatPlan, look: &'a FuzzyLook) -> Self {
        let clip = view.clip_from_view();
        let [sx, sy] = view.scale;
        let [ox, oy] = view.offset;
        let ray_scale = [
            2.0 / (view.width as f32 * sx),
            -2.0 / (view.height as f32 * sy),
        ];
        let ray_offset = if view.is_perspective {
            [(ox - 1.0) / sx, (oy + 1.0) / sy]
        } else {
            [(-ox - 1.0) / sx, (1.0 - oy) / sy]
        };
        let rows = [0, 1, 2].map(|i| view.view_from_model.row(i).to_array().map(Vec4::splat));
        let inverse_scale = Vec4::splat(1.0 / view.model_scale);
        Self {
            look,
            is_perspective: view.is_perspective,
            footprint: plan.footprint,
            is_parallel: view.light == HeadlightSource::Directional || !view.is_perspective,
            turn: rows.map(|[x, y, z, _]| [x, y, z].map(|c| c * inverse_scale)),
            rows,
            depth: [clip.z_axis.z, clip.w_axis.z].map(Vec4::splat),
            ray_scale: ray_scale.map(Vec4::splat),
            ray_offset: ray_offset.map(Vec4::splat),
            pixels: ray_scale.map(|s| Vec4::splat(1.0 / s)),
            focal_px: Vec4::splat(view.focal_px()),
            model_scale: Vec4::splat(view.model_scale),
            half_size: Vec4::splat(0.5 * plan.threshold_px.max(1.0) / view.focal_px()),
            near: Vec4::splat(view.near),
            depth_offset: Vec4::splat(look.depth_offset),
            lamp: match look.light {
                SurfaceLighting::Headlight | SurfaceLighting::Sphere(_) => None,
                SurfaceLighting::Phong(phong) => Some((phong, phong.lamp.in_view(view))),
            },
            sphere: match look.light {
                SurfaceLighting::Headlight | SurfaceLighting::Phong(_) => None,
                SurfaceLighting::Sphere(sphere) => Some(sphere.lights()),
            },
        }
    }

    /// Places four splats; the bits of the second are set of those that are too large for compute.
    #[inline]
    fn place(&self, four: &[WeightedSplat; 4]) -> ([FuzzySplat; 4], u32) {
        let zero = Vec4::ZERO;
        // A record is seven words, read as two vectors that share the radius.
        let words = four.map(bytemuck::cast::<WeightedSplat, [f32; 7]>);
        let [x, y, z, own] = columns(words.map(|w| Vec4::new(w[0], w[1], w[2], w[3])));
        let [_, codes, colors, area] = columns(words.map(|w| Vec4::new(w[3], w[4], w[5], w[6])));
        let colors = colors.to_array().map(f32::to_bits);
        let [x, y, z] = self.rows.map(|[a, b, c, d]| a * x + b * y + c * z + d);
        let alpha = Vec4::from_array(colors.map(|c| (c >> 24) as i32 as f32));
        let has_normal = alpha.cmpgt(zero);
        let distance = if self.is_perspective { -z } else { Vec4::ONE };
        let inverse_distance = 1.0 / distance;
        let squared = x * x + y * y + z * z;
        // An eye in the center gives what is no number, and is no place to draw.
        let inverse_length = 1.0 / squared.sqrt();
        let eye = if self.is_perspective {
            [x, y, z].map(|c| c * -inverse_length)
        } else {
            [zero, zero, Vec4::ONE]
        };
        let normal = self
            .normal(codes)
            .map(|c| Vec4::select(has_normal, c, zero));
        let signed = dot(&normal, &eye);
        let facing = Vec4::select(has_normal, signed.abs(), Vec4::ONE);
        let thickness = (Vec4::splat(255.0) - alpha) * (1.0 / 254.0);
        let has_own = own.cmpgt(zero);
        let mut radius = own * self.model_scale;
        if !has_own.all() {
            radius = Vec4::select(has_own, radius, self.half_size * distance);
        }
        let radius_px = radius * self.focal_px * inverse_distance;

        let clip_z = self.depth[0] * z + self.depth[1];
        let offset = self.depth_offset * radius / facing.max(Vec4::splat(LEAST_RATIO));
        let (pushed, pushed_w) = if self.is_perspective {
            // Along the ray, so that the place stays. With an offset of 0 the factor is exactly 1: a splat is never behind
            // itself.
            let pushed = z * (Vec4::ONE + offset * inverse_length);
            (pushed, -pushed)
        } else {
            (z - offset, Vec4::ONE)
        };
        let pushed_depth = (self.depth[0] * pushed + self.depth[1]) / pushed_w;
        let hides = pushed_depth.cmpgt(zero);
        let pushed_depth = Vec4::select(hides, pushed_depth.min(Vec4::ONE), zero);

        let at = if self.is_perspective {
            [x * inverse_distance, y * inverse_distance]
        } else {
            [x, y]
        };
        let [px, py] = [0, 1].map(|i| (at[i] - self.ray_offset[i]) * self.pixels[i]);
        let (inverse, skew) = match self.footprint {
            Footprint::Square => {
                let side = (2.0 * radius_px).max(Vec4::ONE);
                ([side, zero, zero], [zero; 2])
            }
            Footprint::Circle => {
                let squared = radius_px * radius_px;
                ([squared, zero, squared], [zero; 2])
            }
            Footprint::Oriented => {
                let tilted = tilted(&normal, &eye, signed, thickness);
                let ellipse = self.ellipse(&at, &tilted, radius * inverse_distance);
                // Its plane may reach behind the eye, where it has no picture: a circle that faces the viewer.
                let across = (tilted[0] * tilted[0] + tilted[1] * tilted[1]).sqrt();
                let is_near = (distance - radius * across).cmple(self.near);
                if self.is_perspective && is_near.any() {
                    let extent = radius * self.focal_px / distance.max(self.near);
                    let circle = [extent * extent, zero, extent * extent];
                    let or = |a: Vec4, b: Vec4| Vec4::select(is_near, a, b);
                    let (inverse, skew) = ellipse;
                    (
                        [0, 1, 2].map(|i| or(circle[i], inverse[i])),
                        skew.map(|s| or(zero, s)),
                    )
                } else {
                    ellipse
                }
            }
        };
        let aside = if self.is_perspective {
            squared * inverse_length * inverse_distance
        } else {
            Vec4::ONE
        };
        let area_px = self.area_px(area, facing, thickness, inverse_distance, aside);

        // The view volume in depth, and nothing that is not finite.
        let limit = Vec4::splat(1e9);
        let w = distance;
        let is_seen = clip_z.cmpge(zero)
            & clip_z.cmple(w)
            & w.cmpgt(zero)
            & px.abs().cmplt(limit)
            & py.abs().cmplt(limit);
        let is_large = !(2.0 * radius_px).cmple(Vec4::splat(LARGEST_SMALL_BLENDED_PX));
        let nowhere = Vec4::INFINITY;
        let shade = self.headlight(signed, &normal, has_normal);
        let first = columns([
            Vec4::select(is_seen, px, nowhere),
            Vec4::select(is_seen, py, nowhere),
            pushed_depth,
            inverse[0],
        ]);
        let second = columns([inverse[1], inverse[2], skew[0], skew[1]]);
        let third = columns([clip_z / w, area_px, zero, shade]);
        let mut records = [0, 1, 2, 3].map(|i| -> FuzzySplat {
            let mut record: FuzzySplat = bytemuck::cast([first[i], second[i], third[i]]);
            record.color[0] = self.base(colors[i]);
            record
        });
        if self.lamp.is_some() || self.sphere.is_some() {
            for (lane, record) in records.iter_mut().enumerate() {
                let of = |v: &Vectors| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
                let base = record.color[0];
                let albedo = [0, 8, 16].map(|at| (base >> at & 0xff) as f32 / 255.0);
                let normal = (colors[lane] >> 24 != 0).then(|| of(&normal));
                let place = (of(&[x, y, z]), of(&eye));
                let color = self.in_lamps(place, normal, Vec3::from(albedo));
                let [r, g, b] = color.to_array().map(|c| (c * 65535.0 + 0.5) as u32);
                record.color = [r | g << 16, b];
            }
        }
        (records, (is_large & is_seen).bitmask())
    }

    /// Unit normals in view space; a code is the bits of its number.
    #[inline]
    fn normal(&self, codes: Vec4) -> Vectors {
        let codes = codes.to_array().map(f32::to_bits);
        let unit = |code: [f32; 4]| (Vec4::from_array(code) * (1.0 / 32767.0)).max(Vec4::NEG_ONE);
        let x = unit(codes.map(|c| ((c << 16) as i32 >> 16) as f32));
        let y = unit(codes.map(|c| (c as i32 >> 16) as f32));
        let z = Vec4::ONE - x.abs() - y.abs();
        let fold = (-z).max(Vec4::ZERO);
        let [x, y] = [x, y].map(|c| c - Vec4::select(c.cmpge(Vec4::ZERO), fold, -fold));
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let n = [x * inverse, y * inverse, z * inverse];
        self.turn.each_ref().map(|row| dot(row, &n))
    }

    /// The inverse of a footprint's form, xx, xy and yy, and its skew, of discs with these unit normals; `scale` is radius over
    /// distance.
    #[inline]
    fn ellipse(&self, at: &[Vec4; 2], n: &Vectors, scale: Vec4) -> ([Vec4; 3], [Vec4; 2]) {
        let zero = Vec4::ZERO;
        let [sx, sy] = self.pixels.map(|p| scale * p);
        let [a, b] = if self.is_perspective { *at } else { [zero; 2] };
        let (p, q) = (n[0] + a * n[2], n[1] + b * n[2]);
        let inverse = [
            sx * sx * (Vec4::ONE + a * a - p * p),
            sx * sy * (a * b - p * q),
            sy * sy * (Vec4::ONE + b * b - q * q),
        ];
        if !self.is_perspective {
            return (inverse, [zero; 2]);
        }
        let along = 1.0 / (a * n[0] + b * n[1] - n[2]);
        let skew = [0, 1].map(|i| n[i] * along * self.ray_scale[i]);
        (inverse, skew)
    }

    /// Pixels that patches of these areas cover; negative where that is not known or not asked for.
    #[inline]
    fn area_px(
        &self,
        area: Vec4,
        facing: Vec4,
        thickness: Vec4,
        inverse_distance: Vec4,
        aside: Vec4,
    ) -> Vec4 {
        if !self.look.is_gauss {
            return Vec4::NEG_ONE;
        }
        // A patch of some thickness has normals to all sides of the mean.
        let facing = (facing * facing + thickness * thickness)
            .sqrt()
            .clamp(Vec4::splat(LEAST_FACING), Vec4::ONE);
        let scale = self.focal_px * self.model_scale * inverse_distance;
        let covered = area * scale * scale * facing * aside;
        Vec4::select(area.cmpge(Vec4::ZERO), covered, Vec4::NEG_ONE)
    }

    /// The factor of the colors in the headlight.
    #[inline]
    fn headlight(&self, signed: Vec4, normal: &Vectors, has_normal: glam::BVec4A) -> Vec4 {
        let cosine = if self.is_parallel { normal[2] } else { signed };
        let cosine = if self.look.two_sided {
            cosine.abs()
        } else {
            cosine.max(Vec4::ZERO)
        };
        Vec4::select(has_normal, cosine.min(Vec4::ONE), Vec4::ONE) * ALBEDO
    }

    /// The color of the surface itself, bytes from the lowest.
    #[inline]
    fn base(&self, color: u32) -> u32 {
        match self.look.color_by {
            ColorBy::Primitive => u32::from_le_bytes([255, 51, 51, 0]),
            _ if self.look.use_colors => color & 0x00ff_ffff,
            _ => 0x00ff_ffff,
        }
    }

    /// The value of a surface at a place, with the direction to the eye, in light that is not the headlight.
    fn in_lamps(&self, place: (Vec3, Vec3), normal: Option<Vec3>, color: Vec3) -> Vec3 {
        match (&self.sphere, &self.lamp) {
            (Some(sphere), _) => {
                let surface = LitSurface {
                    normal: normal.unwrap_or(Vec3::ZERO),
                    to_eye: match self.is_perspective {
                        true => place.1,
                        false => Vec3::Z,
                    },
                    culls_back: self.look.cull_back,
                    two_sided: self.look.two_sided,
                };
                sphere.value(&surface, color)
            }
            (None, Some((phong, source))) => self.in_lamp(phong, *source, place, normal, color),
            (None, None) => color,
        }
    }

    /// The value of a surface in the light of a lamp, see [`crate::pack::light`]; no normal: as if it faced the lamp.
    fn in_lamp(
        &self,
        phong: &Phong,
        source: LampSource,
        (position, to_eye): (Vec3, Vec3),
        normal: Option<Vec3>,
        color: Vec3,
    ) -> Vec3 {
        let albedo = ALBEDO * color;
        let Some(normal) = normal else {
            return albedo;
        };
        let to_lamp = match source {
            LampSource::Point(lamp) => (lamp.as_vec3() - position).normalize_or_zero(),
            LampSource::Direction(direction) => direction.as_vec3(),
        };
        let is_back = !self.look.cull_back && normal.dot(to_eye) < -LEAST_BACK;
        // The side that is seen is the other one; lit from the front only, it has no light of the lamp.
        let side = match (is_back, self.look.two_sided) {
            (false, _) => 1.0,
            (true, true) => -1.0,
            (true, false) => 0.0,
        };
        let cosine = side * normal.dot(to_lamp);
        let half = side * normal.dot((to_lamp + to_eye).normalize_or_zero());
        let rise = (cosine / FULL_HIGHLIGHT).clamp(0.0, 1.0);
        let highlight = rise * half.clamp(0.0, 1.0).powf(phong.shininess);
        let ambient = phong.ambient + (1.0 - phong.ambient) * cosine.clamp(0.0, 1.0);
        (albedo * ambient + Vec3::splat(phong.specular * highlight)).min(Vec3::ONE)
    }
}

/// Normals of the planes in which the footprints of patches are discs, see `shaders/common/disc.glsl`; `signed` is the
/// cosine between normal and the direction to the eye.
#[inline]
fn tilted(normal: &Vectors, eye: &Vectors, signed: Vec4, thickness: Vec4) -> Vectors {
    let across = [0, 1, 2].map(|i| normal[i] - signed * eye[i]);
    let sine = dot(&across, &across).sqrt();
    let ratio = (signed.abs() + thickness * sine).clamp(Vec4::splat(LEAST_RATIO), Vec4::ONE);
    let side = (Vec4::ONE - ratio * ratio).sqrt() / sine;
    let side = Vec4::select(signed.cmpge(Vec4::ZERO), side, -side);
    // Towards the eye; facing where there is no normal or it points straight there.
    let faces = sine.cmplt(Vec4::splat(1e-6));
    [0, 1, 2].map(|i| {
        let tilted = ratio * eye[i] + side * across[i];
        Vec4::select(faces, eye[i], tilted)
    })
}
