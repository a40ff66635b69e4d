//! Even samples of a surface, where its vertices are too few or too uneven for splats (methods 11.5): a detailed statue on a
//! plinth of eight vertices.
//!
//! * Lattice: every face is cut into n² like parts, n sides long enough; a sample in the middle of each, with the least radius
//!   that covers the part. Nothing stays bare, whatever the face; needles have many.
//! * Poisson disc: darts on the surface, none nearer than the spacing to another, as blue noise has it; each with the spacing
//!   as radius.
//! * Rays: a lattice of parallel rays along each of three axes meets every face that faces that axis most (a layered depth
//!   cube): at most √3 spacings apart on it.
//!
//! The last two leave corners bare. Those are looked for, and filled with samples of their own. Samples lie in the plane of their
//! face and are cut at sharp edges and borders that they reach.

use crate::abi::OrientedPolygon;
use crate::oriented::clip::walk;
use crate::oriented::look::{VertexLook, take_look_of_face};
use crate::oriented::surface::{NO_FACE, WeldedSurface};
use crate::pack::polygons::{MOST_CUTS, PlaneFrame};
use glam::{DVec2, DVec3, IVec3, Vec3};
use std::collections::HashMap;

/// Where samples lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplePattern {
    /// In the middle of like parts of each face.
    Lattice,
    /// At random, none near another.
    Poisson,
    /// Where parallel rays meet the surface.
    Rays,
}

/// How a surface is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRules {
    /// Pattern in which samples lie.
    pub pattern: SamplePattern,
    /// Distance of neighbors, model units; above 0.
    pub spacing: f64,
    /// Splats are cut at edges whose faces differ by more than this, radians.
    pub crease: f64,
}

/// Places and density of samples, for a model that is not known yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleChoice {
    /// Pattern in which samples lie.
    pub pattern: SamplePattern,
    /// Distance of neighbors, model units; `None` for [`SampleBounds::usual_spacing`].
    pub spacing: Option<f64>,
}

/// Bounds of the number of samples of a mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SampleBounds {
    area: f64,
    /// Sums of the longest sides of triangles, and of their squares.
    sides: f64,
    squares: f64,
    faces: usize,
    usual: f64,
}

impl SampleBounds {
    /// Those of a mesh. Triangles without area, and with corners that are not there, count too.
    pub fn of(position: impl Fn(u32) -> Option<Vec3>, triangles: &[[u32; 3]]) -> Self {
        let mut bounds = Self::default();
        let mut sides = Vec::with_capacity(triangles.len());
        for corners in triangles {
            let [Some(a), Some(b), Some(c)] = corners.map(&position) else {
                continue;
            };
            let [a, b, c] = [a, b, c].map(|x| x.as_dvec3());
            let side = longest_side([a, b, c]);
            if !side.is_finite() {
                continue;
            }
            bounds.area += (b - a).cross(c - a).length() / 2.0;
            bounds.sides += side;
            bounds.squares += side * side;
            bounds.faces += 1;
            sides.push(side);
        }
        let middle = sides.len() / 2;
        if let Some(median) = sides.get(middle).copied() {
            sides.select_nth_unstable_by(middle, f64::total_cmp);
            bounds.usual = sides.get(middle).copied().unwrap_or(median);
        }
        bounds
    }

    /// The median of the longest sides of triangles: where a few faces are far larger than most, those get samples as dense
    /// as the others have vertices.
    pub fn usual_spacing(&self) -> f64 {
        self.usual
    }

    /// Chooses how a mesh with these bounds is sampled.
    ///
    /// # Errors
    /// A spacing that is not above 0, or so small that there may be more than [`MOST_SAMPLES`].
    pub fn rules(&self, choice: &SampleChoice, crease: f64) -> Result<SampleRules, SampleError> {
        let spacing = match choice.spacing {
            Some(spacing) => spacing,
            // Nothing has no sides.
            None if self.usual > 0.0 => self.usual,
            None => 1.0,
        };
        if spacing.is_nan() || spacing <= 0.0 {
            return Err(SampleError::Spacing(spacing));
        }
        let faces = self.faces as f64;
        let count = match choice.pattern {
            SamplePattern::Lattice => (self.squares / spacing + 2.0 * self.sides) / spacing + faces,
            SamplePattern::Poisson | SamplePattern::Rays => {
                1.5 * self.area / (spacing * spacing) + 4.0 * faces
            }
        };
        if count > f64::from(MOST_SAMPLES) {
            return Err(SampleError::TooMany { spacing, count });
        }
        Ok(SampleRules {
            pattern: choice.pattern,
            spacing,
            crease,
        })
    }
}

/// Why a surface cannot be sampled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SampleError {
    /// The spacing is no length.
    #[error("a spacing of {0} is no length; it must be above 0")]
    Spacing(f64),
    /// There would be too many samples.
    #[error(
        "a spacing of {spacing} makes up to {count:.0} samples; at most {MOST_SAMPLES} fit. Take a larger spacing"
    )]
    TooMany {
        /// The spacing.
        spacing: f64,
        /// About how many samples that makes.
        count: f64,
    },
}

/// Most samples of a surface.
pub const MOST_SAMPLES: u32 = 1 << 23;

/// By how much a radius is larger than it has to be.
const RADIUS_MARGIN: f64 = 0.02;

/// Darts that are thrown for each sample that there is room for.
const DARTS_A_SAMPLE: f64 = 12.0;

/// Places that are looked at for bare surface, in each square of the spacing.
const LOOKS_A_SQUARE: f64 = 24.0;

/// Splats that cover a surface evenly, in the order of its faces or of the darts.
///
/// # Errors
/// A spacing that is not above 0, or so small that there would be more than [`MOST_SAMPLES`].
pub fn samples_of(
    surface: &WeldedSurface,
    looks: &[VertexLook],
    rules: &SampleRules,
) -> Result<Vec<OrientedPolygon>, SampleError> {
    let SampleRules {
        pattern, spacing, ..
    } = *rules;
    if spacing.is_nan() || spacing <= 0.0 {
        return Err(SampleError::Spacing(spacing));
    }
    let parts = |face: u32| {
        (longest_side(surface.corners(face)) / spacing)
            .ceil()
            .max(1.0)
    };
    let faces = 0..surface.faces.len() as u32;
    let area: f64 = surface.areas.iter().sum();
    let count = match pattern {
        SamplePattern::Lattice => faces.clone().map(|face| parts(face) * parts(face)).sum(),
        SamplePattern::Poisson | SamplePattern::Rays => {
            1.5 * area / (spacing * spacing) + surface.faces.len() as f64
        }
    };
    if count > f64::from(MOST_SAMPLES) {
        return Err(SampleError::TooMany { spacing, count });
    }
    let mut samples = PlacedSamples {
        surface,
        looks,
        rules,
        splats: Vec::new(),
        cells: HashMap::new(),
    };
    match pattern {
        SamplePattern::Lattice => {
            for face in faces {
                lattice(&mut samples, face, parts(face) as u32);
            }
        }
        SamplePattern::Poisson => {
            darts(&mut samples, area);
            fill(&mut samples);
        }
        SamplePattern::Rays => {
            for face in faces {
                rays(&mut samples, face);
            }
            fill(&mut samples);
        }
    }
    Ok(samples.splats)
}

fn longest_side([a, b, c]: [DVec3; 3]) -> f64 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// Samples so far, by the cell of the spacing's size in which each lies.
struct PlacedSamples<'a> {
    surface: &'a WeldedSurface,
    looks: &'a [VertexLook],
    rules: &'a SampleRules,
    splats: Vec<OrientedPolygon>,
    cells: HashMap<IVec3, Vec<u32>>,
}

impl PlacedSamples<'_> {
    fn cell(&self, at: DVec3) -> IVec3 {
        (at / self.rules.spacing).floor().as_ivec3()
    }

    /// Adds a sample of a face that has to cover these places.
    fn place(&mut self, face: u32, at: DVec3, radius: f64, kept: &[DVec3]) {
        let surface = self.surface;
        let Some(frame) = PlaneFrame::new(at, surface.normals[face as usize]) else {
            return;
        };
        let radius = radius * (1.0 + RADIUS_MARGIN);
        let least = self.rules.crease.cos();
        let (mut reached, mut edges) = (Vec::new(), Vec::new());
        // Too many faces within a spacing leave the edges that were found.
        let _is_whole = walk(
            surface,
            NO_FACE,
            &frame,
            radius,
            least,
            &[face],
            &mut reached,
            &mut edges,
        );
        // What the sample has to cover stays.
        edges.retain(|edge| {
            let keeps =
                |x: &DVec3| edge.direction.dot(frame.coordinates(*x)) <= edge.limit + 1e-9 * radius;
            edge.limit < radius && kept.iter().all(keeps)
        });
        edges.sort_by(|a, b| a.limit.total_cmp(&b.limit));
        let cuts = &edges[..edges.len().min(MOST_CUTS)];
        if let Some(mut splat) = OrientedPolygon::disc(&frame, radius, cuts, [255; 4]) {
            take_look_of_face(&mut splat, surface, face, self.looks);
            let cell = self.cell(at);
            self.cells
                .entry(cell)
                .or_default()
                .push(self.splats.len() as u32);
            self.splats.push(splat);
        }
    }

    /// Samples within two spacings, on the same side.
    fn near(&self, at: DVec3, normal: DVec3) -> impl Iterator<Item = &OrientedPolygon> {
        let middle = self.cell(at);
        let around =
            (0..125).map(move |k| middle + IVec3::new(k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2));
        (around.filter_map(|cell| self.cells.get(&cell)).flatten())
            .map(|&index| &self.splats[index as usize])
            .filter(move |splat| splat.normal.as_dvec3().dot(normal) > 0.0)
    }

    /// Whether a sample covers a place on the surface.
    fn covers(&self, at: DVec3, normal: DVec3) -> bool {
        self.near(at, normal).any(|splat| {
            let from_center = at - splat.center.as_dvec3();
            let [u, v, height] = [splat.axis, splat.second_axis(), splat.normal]
                .map(|axis| from_center.dot(axis.as_dvec3()));
            height.abs() <= 0.5 * self.rules.spacing && splat.contains([u as f32, v as f32])
        })
    }
}

/// n² like parts of a face, the middle of each.
fn lattice(samples: &mut PlacedSamples<'_>, face: u32, n: u32) {
    let [a, b, c] = samples.surface.corners(face);
    let middle = (a + b + c) / 3.0;
    let radius = [a, b, c]
        .map(|x| x.distance(middle))
        .into_iter()
        .fold(0.0, f64::max);
    let (radius, step) = (radius / f64::from(n), 1.0 / f64::from(n));
    let at = |i: f64, j: f64| a + (b - a) * (i * step) + (c - a) * (j * step);
    for i in 0..n {
        for j in 0..n - i {
            let (i, j) = (f64::from(i), f64::from(j));
            let kept = [at(i, j), at(i + 1.0, j), at(i, j + 1.0)];
            samples.place(face, at(i + 1.0 / 3.0, j + 1.0 / 3.0), radius, &kept);
            if i + j + 2.0 <= f64::from(n) {
                let kept = [at(i + 1.0, j), at(i + 1.0, j + 1.0), at(i, j + 1.0)];
                samples.place(face, at(i + 2.0 / 3.0, j + 2.0 / 3.0), radius, &kept);
            }
        }
    }
}

/// Numbers in 0..1 that are the same on every machine (Steele and others, "SplitMix", 2014).
struct DartNumbers(u64);

impl DartNumbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A place in a triangle, from two numbers in 0..1.
fn place_in([a, b, c]: [DVec3; 3], s: f64, t: f64) -> DVec3 {
    let (s, t) = if s + t > 1.0 {
        (1.0 - s, 1.0 - t)
    } else {
        (s, t)
    };
    a + s * (b - a) + t * (c - a)
}

/// Darts by area; those that fall nearer than the spacing to one on the same side are taken out.
fn darts(samples: &mut PlacedSamples<'_>, area: f64) {
    let surface = samples.surface;
    let spacing = samples.rules.spacing;
    let mut sum = 0.0;
    let ends: Vec<f64> = (surface.areas.iter())
        .map(|area| {
            sum += area;
            sum
        })
        .collect();
    let mut numbers = DartNumbers(1);
    let count = (DARTS_A_SAMPLE * 0.7 * area / (spacing * spacing)).ceil() as u64;
    for _ in 0..count {
        let at = numbers.next() * sum;
        let face = ends.partition_point(|&end| end <= at).min(ends.len() - 1) as u32;
        let place = place_in(surface.corners(face), numbers.next(), numbers.next());
        let normal = surface.normals[face as usize];
        let is_free = !(samples.near(place, normal))
            .any(|splat| splat.center.as_dvec3().distance(place) < spacing);
        if is_free {
            samples.place(face, place, spacing, &[place]);
        }
    }
}

/// Where a lattice of rays along the axis that a face faces most meets it.
fn rays(samples: &mut PlacedSamples<'_>, face: u32) {
    let spacing = samples.rules.spacing;
    let corners = samples.surface.corners(face);
    let normal = samples.surface.normals[face as usize].abs();
    let axis = (0..3)
        .max_by(|&a, &b| normal[a].total_cmp(&normal[b]))
        .unwrap_or(0);
    let flat = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let [a, b, c] = corners.map(flat);
    let double = (b - a).perp_dot(c - a);
    let [low, high] = [a.min(b).min(c), a.max(b).max(c)];
    // Rays lie half a spacing from 0, so that faces on planes of whole numbers of spacings end between them.
    let first = (low / spacing - 0.5).ceil();
    let last = (high / spacing - 0.5).floor();
    let mut y = first.y;
    while y <= last.y {
        let mut x = first.x;
        while x <= last.x {
            let at = (DVec2::new(x, y) + 0.5) * spacing;
            let s = (at - a).perp_dot(c - a) / double;
            let t = (b - a).perp_dot(at - a) / double;
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                let [a, b, c] = corners;
                let place = a + s * (b - a) + t * (c - a);
                samples.place(face, place, spacing, &[place]);
            }
            x += 1.0;
        }
        y += 1.0;
    }
}

/// Samples of their own for what no sample covers, looked for at evenly spread places of each face.
fn fill(samples: &mut PlacedSamples<'_>) {
    let surface = samples.surface;
    let spacing = samples.rules.spacing;
    for face in 0..surface.faces.len() as u32 {
        let corners = surface.corners(face);
        let normal = surface.normals[face as usize];
        let squares = surface.areas[face as usize] / (spacing * spacing);
        let count = (LOOKS_A_SQUARE * squares).ceil() as u64 + 4;
        for k in 0..count {
            // The R2 sequence (M. Roberts, 2018); the corners first.
            let place = match k {
                0..3 => {
                    corners[k as usize].lerp((corners[0] + corners[1] + corners[2]) / 3.0, 1e-3)
                }
                _ => {
                    let k = k as f64;
                    let s = (0.5 + k * 0.754_877_666_246_692_8) % 1.0;
                    let t = (0.5 + k * 0.569_840_290_998_053_2) % 1.0;
                    place_in(corners, s, t)
                }
            };
            if !samples.covers(place, normal) {
                samples.place(face, place, spacing, &[place]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::mesh::Mesh;
    use crate::oriented::nearest::FaceBoxes;
    use crate::oriented::shapes::{cube, grid, l_shape};

    fn sampled(
        mesh: &Mesh,
        pattern: SamplePattern,
        spacing: f64,
    ) -> (WeldedSurface, Vec<OrientedPolygon>) {
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let rules = SampleRules {
            pattern,
            spacing,
            crease: 0.3,
        };
        let splats = samples_of(&surface, &[], &rules).unwrap();
        (surface, splats)
    }

    /// The share of places on the surface that no splat holds, by other places than those that are filled.
    fn bare(surface: &WeldedSurface, splats: &[OrientedPolygon]) -> f64 {
        let mut numbers = DartNumbers(77);
        let (mut all, mut bare) = (0, 0);
        for face in 0..surface.faces.len() as u32 {
            let normal = surface.normals[face as usize];
            for _ in 0..300 {
                let at = place_in(surface.corners(face), numbers.next(), numbers.next());
                let is_covered = splats.iter().any(|splat| {
                    let from = at - splat.center.as_dvec3();
                    let [u, v] =
                        [splat.axis, splat.second_axis()].map(|a| from.dot(a.as_dvec3()) as f32);
                    splat.normal.as_dvec3().dot(normal) > 0.9
                        && from.dot(normal).abs() < 1e-3
                        && splat.contains([u, v])
                });
                all += 1;
                bare += usize::from(!is_covered);
            }
        }
        bare as f64 / f64::from(all)
    }

    #[test]
    fn a_lattice_covers_exactly_and_stays_within_edges() {
        for mesh in [cube(), l_shape()] {
            let (surface, splats) = sampled(&mesh, SamplePattern::Lattice, 0.3);
            let expected: usize = (0..surface.faces.len() as u32)
                .map(|f| (longest_side(surface.corners(f)) / 0.3).ceil() as usize)
                .map(|n| n * n)
                .sum();
            assert_eq!(splats.len(), expected);
            assert_eq!(bare(&surface, &splats), 0.0);
        }
        let (surface, splats) = sampled(&cube(), SamplePattern::Lattice, 0.3);
        let boxes = FaceBoxes::new(&surface);
        let far = splats.iter().flat_map(|s| {
            s.footprint().iter().map(|&c| {
                let c = DVec2::from(c.map(f64::from)).clamp_length_max(s.round_radius.into());
                boxes.distance(s.point(c.as_vec2().to_array()).as_dvec3())
            })
        });
        assert!(far.fold(0.0, f64::max) < 1e-4);
    }

    #[test]
    fn poisson_discs_keep_their_distance_and_have_the_density_of_random_packing() {
        let mesh = grid(20, |_, _| 0.0);
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        let rules = SampleRules {
            pattern: SamplePattern::Poisson,
            spacing: 0.5,
            crease: 0.3,
        };
        let mut samples = PlacedSamples {
            surface: &surface,
            looks: &[],
            rules: &rules,
            splats: Vec::new(),
            cells: HashMap::new(),
        };
        darts(&mut samples, 400.0);
        let darts = samples.splats.len();
        for (i, a) in samples.splats.iter().enumerate() {
            let near = samples.splats[..i]
                .iter()
                .any(|b| a.center.distance(b.center) < 0.4999);
            assert!(!near);
        }
        // 0.70 area / spacing² at jamming; 12 darts a sample leave some room.
        let density = darts as f64 * 0.25 / 400.0;
        assert!((0.57..0.70).contains(&density), "{density}");
        fill(&mut samples);
        assert!(samples.splats.len() < darts * 5 / 4);
        assert!(bare(&surface, &samples.splats) < 1e-3);
    }

    #[test]
    fn rays_meet_every_face_and_gaps_are_filled() {
        for mesh in [cube(), l_shape()] {
            let (surface, splats) = sampled(&mesh, SamplePattern::Rays, 0.13);
            assert!(bare(&surface, &splats) < 1e-3);
            let area: f64 = surface.areas.iter().sum();
            let density = splats.len() as f64 * 0.13 * 0.13 / area;
            assert!((0.8..1.4).contains(&density), "{density}");
        }
    }

    #[test]
    fn spacings_that_are_none_are_refused() {
        let mesh = cube();
        let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
        for pattern in [
            SamplePattern::Lattice,
            SamplePattern::Poisson,
            SamplePattern::Rays,
        ] {
            for spacing in [0.0, -1.0, f64::NAN, 1e-9] {
                let rules = SampleRules {
                    pattern,
                    spacing,
                    crease: 0.3,
                };
                assert!(samples_of(&surface, &[], &rules).is_err(), "{spacing}");
            }
        }
        let none = WeldedSurface::default();
        let rules = SampleRules {
            pattern: SamplePattern::Poisson,
            spacing: 1.0,
            crease: 0.3,
        };
        assert_eq!(samples_of(&none, &[], &rules), Ok(Vec::new()));
    }
}
