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
use crate::oriented::clip::{ReachedFaces, walk};
use crate::oriented::look::{VertexLook, take_look_of_face};
use crate::oriented::surface::{NO_FACE, WeldedSurface};
use crate::pack::polygons::{MOST_CUTS, PlaneFrame};
use crate::progress::Progress;
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
    /// Distance of neighbors, model units; `None` for [`SampleBounds::usual_spacing`], or more where that makes too many.
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
    /// Bounds of a mesh. Triangles without area, and with corners that are not there, count too.
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
    /// A spacing that is not above 0, or so small that there may be more than [`MOST_SAMPLES`]; without one, more faces than that.
    pub fn rules(&self, choice: &SampleChoice, crease: f64) -> Result<SampleRules, SampleError> {
        let pattern = choice.pattern;
        let spacing = match choice.spacing {
            Some(spacing) => spacing,
            None => self.least_spacing(pattern, self.usual),
        };
        if spacing.is_nan() || spacing <= 0.0 {
            return Err(SampleError::Spacing(spacing));
        }
        let count = self.most_samples(pattern, spacing);
        if count > f64::from(MOST_SAMPLES) {
            // A step more, so that two digits of it are enough too.
            let enough = 1.125 * self.least_spacing(pattern, spacing);
            return Err(
                match self.most_samples(pattern, enough) <= f64::from(MOST_SAMPLES) {
                    true => SampleError::TooMany {
                        spacing,
                        count,
                        enough,
                    },
                    false => SampleError::Faces(self.faces),
                },
            );
        }
        Ok(SampleRules {
            pattern,
            spacing,
            crease,
        })
    }

    /// Most samples that a pattern can make at a spacing.
    fn most_samples(&self, pattern: SamplePattern, spacing: f64) -> f64 {
        let faces = self.faces as f64;
        match pattern {
            SamplePattern::Lattice => (self.squares / spacing + 2.0 * self.sides) / spacing + faces,
            SamplePattern::Poisson | SamplePattern::Rays => {
                1.5 * self.area / (spacing * spacing) + faces
            }
        }
    }

    /// The first spacing of `from`, an eighth more, and so on that makes no more than [`MOST_SAMPLES`]; where none does, one at
    /// which almost all are those of faces.
    fn least_spacing(&self, pattern: SamplePattern, from: f64) -> f64 {
        let mut spacing = match from > 0.0 && from.is_finite() {
            true => from,
            // Nothing has no sides.
            false => return 1.0,
        };
        // Of a model as large as numbers go it is this many steps from the least of them.
        for _ in 0..20_000 {
            if self.most_samples(pattern, spacing) <= f64::from(MOST_SAMPLES)
                || spacing > 1e3 * (self.sides + self.area.sqrt())
            {
                break;
            }
            spacing *= 1.125;
        }
        spacing
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
        "a spacing of {spacing} makes up to {count:.0} splats; at most {MOST_SAMPLES} are made. Take a larger spacing: {enough:.1e} is enough"
    )]
    TooMany {
        /// The spacing.
        spacing: f64,
        /// About how many samples that makes.
        count: f64,
        /// A spacing that makes few enough.
        enough: f64,
    },
    /// There would be too many, however far apart.
    #[error(
        "the model has {0} triangles, each of which needs a splat at least, and at most {MOST_SAMPLES} are made. Draw it by splats from vertices without --resample"
    )]
    Faces(usize),
    /// The user asked for the end.
    #[error("cancelled")]
    Cancelled,
}

/// Most samples of a surface: seconds of work, and less memory than a model of millions.
pub const MOST_SAMPLES: u32 = 200_000;

/// Faces or darts between two questions for the end.
const CANCEL_STEP: u64 = 256;

/// By how much a radius is larger than it has to be.
const RADIUS_MARGIN: f64 = 0.02;

/// Darts that are thrown for each sample that there is room for.
const DARTS_A_SAMPLE: f64 = 12.0;

/// Places that are looked at for bare surface, in each square of the spacing, and in a face besides.
const LOOKS_A_SQUARE: f64 = 24.0;
const LOOKS_A_FACE: u64 = 12;

/// How far from the plane of a sample, in spacings, it still covers: from aside it lies that far beside the surface.
const MOST_HEIGHT: f64 = 0.1;

/// Splats that cover a surface evenly, in the order of its faces or of the darts.
///
/// # Errors
/// A spacing that is not above 0, or so small that there would be more than [`MOST_SAMPLES`]; [`SampleError::Cancelled`].
pub fn samples_of(
    surface: &WeldedSurface,
    looks: &[VertexLook],
    rules: &SampleRules,
    progress: &dyn Progress,
) -> Result<Vec<OrientedPolygon>, SampleError> {
    let choice = SampleChoice {
        pattern: rules.pattern,
        spacing: Some(rules.spacing),
    };
    let position = |p: u32| surface.points.get(p as usize).map(|p| p.as_vec3());
    SampleBounds::of(position, &surface.faces).rules(&choice, rules.crease)?;
    let mut samples = PlacedSamples {
        surface,
        looks,
        rules,
        progress,
        splats: Vec::new(),
        cells: HashMap::new(),
    };
    match rules.pattern {
        SamplePattern::Lattice => samples.each_face("even splats", lattice)?,
        SamplePattern::Poisson => {
            darts(&mut samples, surface.areas.iter().sum())?;
            samples.each_face("bare places", fill)?;
        }
        SamplePattern::Rays => {
            samples.each_face("even splats", rays)?;
            samples.each_face("bare places", fill)?;
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
    progress: &'a dyn Progress,
    splats: Vec<OrientedPolygon>,
    cells: HashMap<IVec3, Vec<u32>>,
}

impl PlacedSamples<'_> {
    /// Does something for each face, as long as nobody asks for the end and there are not too many samples.
    fn each_face(
        &mut self,
        stage: &str,
        mut of_face: impl FnMut(&mut Self, u32),
    ) -> Result<(), SampleError> {
        let count = self.surface.faces.len() as u32;
        self.progress.stage(stage, count.into());
        for face in 0..count {
            self.step(face.into())?;
            of_face(self, face);
        }
        Ok(())
    }

    /// Tells how far the work is; fails where it should end.
    fn step(&self, number: u64) -> Result<(), SampleError> {
        if number.is_multiple_of(CANCEL_STEP) {
            if self.progress.is_cancelled() {
                return Err(SampleError::Cancelled);
            }
            self.progress.advance(CANCEL_STEP);
        }
        Ok(())
    }

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
        let (mut reached, mut edges) = (ReachedFaces::default(), Vec::new());
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

    /// Tells whether a sample covers a place on the surface.
    fn covers(&self, at: DVec3, normal: DVec3) -> bool {
        self.near(at, normal).any(|splat| {
            let from_center = at - splat.center.as_dvec3();
            let [u, v, height] = [splat.axis, splat.second_axis(), splat.normal]
                .map(|axis| from_center.dot(axis.as_dvec3()));
            height.abs() <= MOST_HEIGHT * self.rules.spacing && splat.contains([u as f32, v as f32])
        })
    }
}

/// n² like parts of a face, the middle of each.
fn lattice(samples: &mut PlacedSamples<'_>, face: u32) {
    let [a, b, c] = samples.surface.corners(face);
    let n = (longest_side([a, b, c]) / samples.rules.spacing).ceil();
    let n = n.max(1.0) as u32;
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
fn darts(samples: &mut PlacedSamples<'_>, area: f64) -> Result<(), SampleError> {
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
    samples.progress.stage("even splats", count);
    for number in 0..count {
        samples.step(number)?;
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
    Ok(())
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

/// Samples of their own for what no sample covers, looked for at evenly spread places of a face.
fn fill(samples: &mut PlacedSamples<'_>, face: u32) {
    let surface = samples.surface;
    let spacing = samples.rules.spacing;
    let corners = surface.corners(face);
    let normal = surface.normals[face as usize];
    let squares = surface.areas[face as usize] / (spacing * spacing);
    let count = (LOOKS_A_SQUARE * squares).ceil() as u64 + LOOKS_A_FACE;
    for k in 0..count {
        // The R2 sequence (M. Roberts, 2018); the corners first.
        let place = match k {
            0..3 => corners[k as usize].lerp((corners[0] + corners[1] + corners[2]) / 3.0, 1e-3),
            _ => {
                let k = k as f64;
                let s = (0.5 + k * 0.754_877_666_246_692_8) % 1.0;
                let t = (0.5 + k * 0.569_840_290_998_053_2) % 1.0;
                place_in(corners, s, t)
            }
        };
        // What fills cannot be more than bounds allow by much: there may be no end to needles.
        if samples.splats.len() >= MOST_SAMPLES as usize {
            return;
        }
        if !samples.covers(place, normal) {
            samples.place(face, place, spacing, &[place]);
        }
    }
}

#[cfg(test)]
mod tests;
