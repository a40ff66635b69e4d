//! Makes the files in `assets/` that stand for scans: `cargo run --example scan -- assets`
//!
//! `scan.ply.gz` is two range maps of the generated statue, as a scanner of few pixels would see it from two sides: noise
//! along the rays, pixels that came to nothing, open borders, needles where the surface turns away, triangles without
//! area, vertices twice in one place, vertices of no triangle, and two layers where the maps overlap. `ring.obj` is a ring
//! of polygons with normals, whose material file is missing.

use glam::{Vec3, Vec4};
use std::fmt::Write as _;
use std::path::Path;
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Method, Settings};
use surfel::tree;

/// Pixels of a range map, each way.
const SIDE: u32 = 110;

/// Positions are multiples of this, model units: what a scanner writes has no more digits, and it packs better.
const STEP: f32 = 1.0 / 8192.0;

/// Numbers of SplitMix64: the same everywhere.
struct Random(u64);

impl Random {
    /// From 0 to 1.
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    /// Around zero: a sum of four, so that large ones are rare. Its standard deviation is 0.58.
    fn noise(&mut self) -> f32 {
        (0..4).map(|_| self.unit() - 0.5).sum()
    }
}

/// Adds what is seen in a picture with depths, one vertex a pixel, to a mesh.
fn add_range_map(mesh: &mut Mesh, view: &View, seen: &Image, tint: [u8; 3], random: &mut Random) {
    let model_from_view = view.view_from_model.inverse();
    let pixel_width = |depth: f32| depth / view.focal_px();
    let side = SIDE as usize;
    let vertices: Vec<Option<u32>> = (0..side * side)
        .map(|i| {
            let depth = seen.depth[i];
            // Three of a hundred pixels come to nothing.
            if !depth.is_finite() || random.unit() < 0.03 {
                return None;
            }
            let depth = depth + 0.35 * pixel_width(depth) * random.noise();
            let ndc = |p: usize| 2.0 * (p as f32 + 0.5) / SIDE as f32 - 1.0;
            let ray = Vec3::new(
                (ndc(i % side) + view.offset[0]) / view.scale[0],
                (view.offset[1] - ndc(i / side)) / view.scale[1],
                -1.0,
            );
            let point = model_from_view * Vec4::from((depth * ray, 1.0));
            let index = mesh.positions.len() as u32;
            mesh.positions
                .push((point.truncate() / STEP).round() * STEP);
            let shade = 0.7 + 0.3 * random.unit();
            let [r, g, b] = tint.map(|c| (f32::from(c) * shade) as u8);
            mesh.colors.push([r, g, b, 255]);
            Some(index)
        })
        .collect();
    let at = |x: usize, y: usize| vertices[y * side + x];
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let corners = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            let [a, b, c, d] = corners;
            for triangle in [[a, d, b], [b, d, c]] {
                let [Some(a), Some(b), Some(c)] = triangle else {
                    continue;
                };
                // What is longer leads from one surface to another; what is a bit shorter is a needle.
                let edge = |p: u32, q: u32| {
                    mesh.positions[p as usize].distance(mesh.positions[q as usize])
                };
                let depth = seen.depth[y * side + x].min(10.0);
                let longest = edge(a, b).max(edge(b, c)).max(edge(c, a));
                let is_surface = longest < 8.0 * pixel_width(depth);
                let chance = (random.unit() * 200.0) as u32;
                if is_surface && chance >= 196 {
                    // A vertex next to another one: a needle, and a crack to the neighbor.
                    let beside = mesh.positions.len() as u32;
                    let [from, to] = [a, b].map(|corner| mesh.positions[corner as usize]);
                    mesh.positions.push(from.lerp(to, 0.03));
                    mesh.colors.push(mesh.colors[a as usize]);
                    mesh.triangles.extend([[a, beside, c], [beside, b, c]]);
                } else if is_surface {
                    mesh.triangles.push([a, b, c]);
                }
                match chance {
                    // One corner twice.
                    0 => mesh.triangles.push([a, b, b]),
                    // Another vertex in the same place.
                    1 => {
                        let twin = mesh.positions.len() as u32;
                        mesh.positions.push(mesh.positions[a as usize]);
                        mesh.colors.push(mesh.colors[a as usize]);
                        mesh.triangles.push([a, twin, c]);
                    }
                    // The same triangle again.
                    2 => mesh.triangles.push([a, b, c]),
                    _ => {}
                }
            }
        }
    }
}

fn scan() -> Result<Mesh, Box<dyn std::error::Error>> {
    let statue = generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Statue, 100_000)?);
    let model = tree::build(statue, &tree::BuildOptions::default(), &SilentProgress)?;
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let mut engine = Engine::new(&Backend::Reference, &model, (SIDE, SIDE), outputs)?;
    let settings = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let mut mesh = Mesh::default();
    let mut random = Random(7);
    for (azimuth, elevation, tint) in [(0.3, 0.15, [230, 205, 170]), (1.25, 0.4, [205, 210, 225])] {
        let camera = model.orbit_camera((SIDE, SIDE), azimuth, elevation, 1.1);
        let view = camera.view(model.origin)?;
        let seen = engine.render(&view, &settings)?;
        add_range_map(&mut mesh, &view, &seen, tint, &mut random);
    }
    Ok(mesh)
}

/// A ring of quads and pentagons with normals, as text.
fn ring() -> Result<String, std::fmt::Error> {
    let (around, across) = (24, 10);
    let mut text =
        String::from("# a ring of polygons; the material file is missing\nmtllib ring.mtl\n");
    let angle = |i: u32, n: u32| std::f64::consts::TAU * f64::from(i) / f64::from(n);
    for i in 0..around {
        let (sin, cos) = angle(i, around).sin_cos();
        for j in 0..across {
            let (up, out) = angle(j, across).sin_cos();
            let r = 1.0 + 0.35 * out;
            writeln!(text, "v {:.5} {:.5} {:.5}", r * cos, 0.35 * up, r * sin)?;
            writeln!(text, "vn {:.5} {:.5} {:.5}", out * cos, up, out * sin)?;
        }
    }
    writeln!(text, "usemtl clay")?;
    let corner = |i: u32, j: u32| {
        let index = i % around * across + j % across + 1;
        format!("{index}//{index}")
    };
    for i in 0..around {
        let mut j = 0;
        while j < across {
            // Two quads in one polygon of six corners, now and then.
            let width = 1 + u32::from(j + 1 < across && (i + j) % 5 == 0);
            let near = (j..=j + width).map(|j| corner(i, j));
            let far = (j..=j + width).rev().map(|j| corner(i + 1, j));
            let face: Vec<String> = near.chain(far).collect();
            writeln!(text, "f {}", face.join(" "))?;
            j += width;
        }
    }
    Ok(text)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(folder) = std::env::args().nth(1) else {
        return Err("usage: scan FOLDER".into());
    };
    let folder = Path::new(&folder);
    let mesh = scan()?;
    let file = std::fs::File::create(folder.join("scan.ply.gz"))?;
    let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::best());
    generate::ply::write_to(&mesh, &mut packed, &SilentProgress)?;
    packed.finish()?;
    std::fs::write(folder.join("ring.obj"), ring()?)?;
    println!(
        "{} vertices, {} triangles",
        mesh.positions.len(),
        mesh.triangles.len()
    );
    Ok(())
}
