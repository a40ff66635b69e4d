//! From a cut to filtered splats: each patch of surface by its integrals, as the eye sees them.
//!
//! A node carries, over its triangles t of area A_t and unit normal n_t, the sums A = Σ A_t, c = Σ A_t p_t / A,
//! N = Σ A_t n_t and Q = Σ A_t n_t n_tᵀ ([`crate::tree::Moments`]). From an eye at e, with w = e - c, v = w / |w|, the
//! depth z along the view direction and the focal length f in pixels:
//!
//! * an area element dA of normal n covers f² dA (n·w) / z³ of the picture plane, so a patch that faces the eye
//!   covers exactly a = f² (N·w) / z³ (up to its depth range); orthographic f² (N·v);
//! * with light from the direction l, each element has the Lambert value |n·l| and the weight (n·v) that a pixel gives
//!   it. For light in the eye their mean is (vᵀ Q v) / (N·v); for parallel headlight |vᵀ Q l| / (N·v);
//! * a lamp anywhere else lights only what faces it: max(0, vᵀ Q l) / S, l taken at the centroid, with
//!   S = max(N·v, vᵀ Q v). The exact mean where all of the patch is seen and lit (then S = N·v, as n·v <= 1). What turns
//!   away from the lamp counts as negative: too dark. S > N·v tells that the patch has backs, which count as lit from
//!   the side that is seen. A triangle has max(0, n·l) of its shading normal;
//! * its highlight is that of the mean normal N, wider and weaker the shorter N is (Toksvig, "Mipmapping Normal Maps",
//!   Journal of Graphics Tools 10(3), 2005): with L = |N| / A and k = L / (L + s (1 - L)) the exponent s becomes k s and
//!   the value is multiplied by (1 + k s) / (1 + s).
//!
//! Where a patch mixes front and back, N·v counts what faces away as negative: too little area, never too much.

use crate::abi::constants::{FULL_HIGHLIGHT, LEAST_BACK};
use crate::abi::{FilteredSplat, Vertex};
use crate::cut::{Cut, StripRun, strip_center};
use crate::draw::{ALBEDO, ColorBy, Lighting, Phong, Source};
use crate::math::camera::{Light, View};
use crate::math::octahedral;
use crate::tree::{Model, Moments};
use glam::{Mat3, Vec3};

/// What the weights of a frame depend on besides the model.
#[derive(Debug, Clone, Copy)]
pub struct Shade {
    /// Side of a splat's square, pixels.
    pub side_px: f32,
    /// Factor of the depth offset, see [`crate::method::Settings::depth_offset`].
    pub depth_offset: f32,
    /// What faces away is dropped; else both sides count.
    pub cull_back: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// What decides the color.
    pub color_by: ColorBy,
    /// How surfaces are lit; positions in model space.
    pub light: Lighting,
}

/// Number of splats that [`splats`] writes at most.
pub fn splat_count(cut: &Cut) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    cut.nodes.len() + strips + cut.leaves.len()
}

/// A patch as the sums have it.
struct Patch {
    center: Vec3,
    area: f32,
    vector_area: Vec3,
    /// Sum of shading normals times areas.
    normals: Vec3,
    /// There is one shading normal, which may differ from that of the area.
    is_triangle: bool,
    second_moment: Mat3,
    color: [u8; 4],
}

impl Patch {
    fn of_node(moments: &Moments, color: [u8; 4]) -> Self {
        let [xx, yy, zz, xy, xz, yz] = moments.second_moment;
        Self {
            center: Vec3::from(moments.area_centroid) / moments.area,
            area: moments.area,
            vector_area: Vec3::from(moments.vector_area),
            normals: Vec3::from(moments.vector_area),
            is_triangle: false,
            second_moment: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
            color,
        }
    }

    /// A triangle. Its shading normal is the mean of its corners', as a picture of triangles interpolates it.
    fn of_triangle(corners: [Vertex; 3]) -> Self {
        let [a, b, c] = corners.map(|v| v.position);
        let vector_area = 0.5 * (b - a).cross(c - a);
        let area = vector_area.length();
        let shading: Vec3 = corners
            .iter()
            .filter(|v| v.color[3] != 0)
            .map(|v| octahedral::decode(v.normal))
            .sum();
        let n = shading.normalize_or(vector_area.normalize_or_zero());
        let channel =
            |i: usize| ((corners.iter().map(|v| u32::from(v.color[i])).sum::<u32>() + 1) / 3) as u8;
        Self {
            center: (a + b + c) / 3.0,
            area,
            vector_area,
            normals: n * area,
            is_triangle: true,
            second_moment: Mat3::from_cols(n * n.x, n * n.y, n * n.z) * area,
            color: [channel(0), channel(1), channel(2), 255],
        }
    }
}

/// The part of the frame that every splat needs.
struct Eye<'a> {
    view: &'a View,
    shade: Shade,
    /// Square of the focal length in pixels, times the square of the view's scale.
    focal_squared: f32,
    /// Model-space length of half a splat's side at distance 1, times the offset factor.
    half_side: f32,
    /// What surfaces make of the lamp, and the lamp; none with the headlight.
    lamp: Option<(Phong, Source)>,
}

impl Eye<'_> {
    fn splat(&self, patch: &Patch, share: f32, center: Vec3) -> Option<FilteredSplat> {
        let view = self.view;
        let (w, z) = if view.is_perspective {
            // Both in model units: the scale of the view cancels in the projected area.
            (view.eye - center, view.distance(center) / view.model_scale)
        } else {
            (view.backward, 1.0)
        };
        let distance = w.length();
        if !(z > 0.0 && distance > 0.0 && patch.area > 0.0) {
            return None;
        }
        let v = w / distance;
        let mut toward = patch.vector_area.dot(v);
        if !self.shade.cull_back {
            toward = toward.abs();
        }
        // Seen edge-on or from behind: covers nothing.
        if toward <= 1e-4 * patch.area {
            return None;
        }
        let area_px = if view.is_perspective {
            self.focal_squared * toward * distance / (z * z * z)
        } else {
            self.focal_squared * toward
        };
        let (lambert, highlight) = match &self.lamp {
            None => {
                let light = match view.light {
                    Light::Point if view.is_perspective => v,
                    _ => view.backward,
                };
                let lambert = (v.dot(patch.second_moment * light).abs() / toward).min(1.0);
                (lambert, 0.0)
            }
            Some((phong, source)) => self.in_lamp(phong, *source, patch, center, v, toward),
        };
        let base = match self.shade.color_by {
            ColorBy::Primitive => [1.0, 0.2, 0.2],
            ColorBy::Shading if self.shade.use_colors => {
                [0, 1, 2].map(|i| f32::from(patch.color[i]) / 255.0)
            }
            ColorBy::Shading | ColorBy::Classification => [1.0; 3],
        };
        let facing = (toward / patch.vector_area.length()).clamp(0.1, 1.0);
        Some(FilteredSplat {
            center,
            offset: self.half_side * z / facing,
            color: base.map(|c| (c * ALBEDO * lambert + highlight).min(1.0)),
            area_px: share * area_px,
        })
    }

    /// The factor of the albedo and the highlight of a patch that covers `toward` as seen along `v`.
    fn in_lamp(
        &self,
        phong: &Phong,
        source: Source,
        patch: &Patch,
        center: Vec3,
        v: Vec3,
        toward: f32,
    ) -> (f32, f32) {
        let l = match source {
            Source::Point(lamp) => (lamp - center.as_dvec3()).normalize_or_zero().as_vec3(),
            Source::Direction(direction) => direction.as_vec3(),
        };
        // Two-sided as it stands: an element of either side is lit when lamp and eye are on the same side of it.
        let of_second = v.dot(patch.second_moment * l);
        let seen = toward.max(v.dot(patch.second_moment * v));
        let length = (patch.normals.length() / patch.area).min(1.0);
        let mean = patch.normals.normalize_or_zero();
        let mean = if !self.shade.cull_back && mean.dot(v) < -LEAST_BACK {
            -mean
        } else {
            mean
        };
        // Q and N of a triangle have different normals, and their quotient is none.
        let lambert = if patch.is_triangle {
            mean.dot(l).max(0.0)
        } else {
            (of_second / seen).max(0.0)
        };
        let cosine = mean.dot((l + v).normalize_or_zero()).clamp(0.0, 1.0);
        let rise = (mean.dot(l) / FULL_HIGHLIGHT).clamp(0.0, 1.0);
        let highlight = if rise > 0.0 && cosine > 0.0 {
            let s = phong.shininess;
            let k = length / (length + s * (1.0 - length));
            rise * phong.specular * (1.0 + k * s) / (1.0 + s) * cosine.powf(k * s)
        } else {
            0.0
        };
        let ambient = phong.ambient;
        (ambient + (1.0 - ambient) * lambert.min(1.0), highlight)
    }
}

/// Writes the splats of a cut and returns how many they are. The model must have its moments.
///
/// # Panics
/// When `out` is shorter than [`splat_count`], or the model has no moments.
pub fn splats(
    model: &Model,
    cut: &Cut,
    view: &View,
    shade: Shade,
    out: &mut [FilteredSplat],
) -> usize {
    let tree = &model.tree;
    let focal = view.focal_px();
    let eye = Eye {
        view,
        shade,
        focal_squared: if view.is_perspective {
            focal * focal
        } else {
            focal * focal * view.model_scale * view.model_scale
        },
        half_side: shade.depth_offset * shade.side_px
            / (2.0 * focal)
            / if view.is_perspective {
                1.0
            } else {
                view.model_scale
            },
        lamp: match shade.light {
            Lighting::Headlight => None,
            Lighting::Phong(phong) => Some((phong, phong.lamp.in_model(view))),
        },
    };
    let mut len = 0;
    let mut write = |splat: Option<FilteredSplat>| {
        if let Some(splat) = splat {
            out[len] = splat;
            len += 1;
        }
    };
    for &id in &cut.nodes {
        let patch = Patch::of_node(
            &tree.moments[id as usize],
            tree.attributes[id as usize].color,
        );
        write(eye.splat(&patch, 1.0, patch.center));
    }
    for &StripRun { node: id, count } in &cut.strips {
        let patch = Patch::of_node(
            &tree.moments[id as usize],
            tree.attributes[id as usize].color,
        );
        let node = &tree.nodes[id as usize];
        for i in 0..count {
            write(eye.splat(&patch, 1.0 / count as f32, strip_center(node, count, i)));
        }
    }
    for &leaf in &cut.leaves {
        let corners = model.triangles[leaf as usize].map(|i| model.vertices[i as usize]);
        let patch = Patch::of_triangle(corners);
        write(eye.splat(&patch, 1.0, patch.center));
    }
    len
}
