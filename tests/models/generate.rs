//! The generated models from outside: counts, closed surfaces, closed forms, known answers, streams.

use glam::{DVec3, Vec3};
use std::{
    collections::{BTreeMap, HashMap},
    f64::consts::{FRAC_PI_4, PI},
    io::Write,
    sync::atomic::{AtomicU64, Ordering},
};
use surfel::{
    generate::{self, GenerateError, GeneratedShape, ShapeSpec, ply},
    mesh::Mesh,
    progress::{Progress, SilentProgress},
};

fn sized(shape: GeneratedShape, triangles: u64) -> ShapeSpec {
    ShapeSpec::with_triangles(shape, triangles).expect("a possible size")
}

fn grid(shape: GeneratedShape, columns: u32, rows: u32) -> ShapeSpec {
    ShapeSpec::with_grid(shape, columns, rows).expect("a possible grid")
}

/// One of each kind, small, with unequal sides where the shape has them.
fn small() -> Vec<ShapeSpec> {
    vec![
        grid(GeneratedShape::Square, 7, 5),
        grid(GeneratedShape::Sphere, 24, 11),
        grid(GeneratedShape::Torus, 31, 9),
        grid(GeneratedShape::Statue, 1, 1),
        grid(GeneratedShape::Statue, 2, 2),
        grid(GeneratedShape::Statue, 17, 17),
    ]
}

fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [DVec3; 3] {
    triangle.map(|k| mesh.positions[k as usize].as_dvec3())
}

fn area(mesh: &Mesh) -> f64 {
    let twice = |t| {
        let [a, b, c] = corners(mesh, t);
        (b - a).cross(c - a).length()
    };
    mesh.triangles.iter().map(twice).sum::<f64>() / 2.0
}

/// Positive when the triangles are counter-clockwise from outside; only meaningful for a closed surface.
fn volume(mesh: &Mesh) -> f64 {
    let six_times = |t| {
        let [a, b, c] = corners(mesh, t);
        a.dot(b.cross(c))
    };
    mesh.triangles.iter().map(six_times).sum::<f64>() / 6.0
}

#[test]
fn counts_are_exact() {
    for (spec, vertices, triangles) in [
        (sized(GeneratedShape::Sphere, 1_000_000), 501_501, 1_000_000),
        (
            sized(GeneratedShape::Torus, 4_000_000),
            2_020_101,
            4_000_000,
        ),
        (
            grid(GeneratedShape::Torus, 2000, 1000),
            2001 * 1001,
            4_000_000,
        ),
        (
            sized(GeneratedShape::Square, 2_000_000),
            1001 * 1001,
            2_000_000,
        ),
        (sized(GeneratedShape::Square, 14), 2 * 8, 14),
        (
            sized(GeneratedShape::Statue, 1_000_000),
            6 * 289 * 289 + 2,
            1_002_252,
        ),
        (
            sized(GeneratedShape::Statue, 2_000_000),
            6 * 408 * 408 + 2,
            1_997_568,
        ),
        (
            sized(GeneratedShape::Statue, 8_000_000),
            6 * 816 * 816 + 2,
            7_990_272,
        ),
    ] {
        assert_eq!(spec.counts(), (vertices, triangles), "{spec:?}");
    }
    assert_eq!(sized(GeneratedShape::Sphere, 1_000_000).grid(), (1000, 500));
    assert_eq!(
        sized(GeneratedShape::Torus, 4_000_000).grid(),
        (20_000, 100)
    );
    assert_eq!(sized(GeneratedShape::Square, 2 * 360).grid(), (20, 18));
    for spec in small() {
        let mesh = generate::mesh(&spec);
        let found = (mesh.positions.len() as u64, mesh.triangles.len() as u64);
        assert_eq!(found, spec.counts(), "{spec:?}");
        assert_eq!(mesh.normals.len(), mesh.positions.len());
    }
}

#[test]
fn every_vertex_is_used_finite_and_has_a_unit_normal_of_its_side() {
    for spec in small() {
        let mesh = generate::mesh(&spec);
        let mut is_used = vec![false; mesh.positions.len()];
        for triangle in &mesh.triangles {
            for corner in triangle {
                is_used[*corner as usize] = true;
            }
            let [a, b, c] = corners(&mesh, triangle);
            let face = (b - a).cross(c - a);
            for corner in triangle {
                let normal = mesh.normals[*corner as usize].as_dvec3();
                // The statue with two cells an edge is too coarse for its own waves.
                if spec.shape() != GeneratedShape::Statue && face != DVec3::ZERO {
                    assert!(face.dot(normal) > 0.0, "{spec:?}: a normal points inward");
                }
            }
        }
        assert!(is_used.iter().all(|used| *used), "{spec:?}");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(position.is_finite());
            assert!((normal.length() - 1.0).abs() < 1e-6, "{spec:?}: {normal}");
        }
    }
}

/// Welds by the bits of the positions, drops triangles that then have two equal corners, and counts each
/// directed edge. Returns how many triangles were dropped.
fn assert_closed(mesh: &Mesh, name: &str) -> usize {
    let mut index_of: HashMap<[u32; 3], u32> = HashMap::new();
    let welded: Vec<u32> = (0..)
        .zip(&mesh.positions)
        .map(|(k, p)| *index_of.entry(p.to_array().map(f32::to_bits)).or_insert(k))
        .collect();
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut dropped = 0;
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|k| welded[k as usize]);
        if a == b || b == c || c == a {
            dropped += 1;
            continue;
        }
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(
            count, 1,
            "{name}: edge {a}-{b} has two triangles on one side"
        );
        assert!(edges.contains_key(&(b, a)), "{name}: edge {a}-{b} is open");
    }
    dropped
}

#[test]
fn sphere_torus_and_statue_are_closed_and_face_outward() {
    let sphere = generate::mesh(&grid(GeneratedShape::Sphere, 24, 11));
    assert_eq!(assert_closed(&sphere, "sphere"), 2 * 24);
    assert_eq!(
        assert_closed(
            &generate::mesh(&grid(GeneratedShape::Torus, 31, 9)),
            "torus"
        ),
        0
    );
    for n in [1, 2, 3, 40] {
        let statue = generate::mesh(&grid(GeneratedShape::Statue, n, n));
        assert_eq!(assert_closed(&statue, "statue"), 0);
        assert!(volume(&statue) > 0.0, "statue of {n}");
    }
}

/// A row of cells around the y axis between two regular polygons is a frustum, whose area and volume are
/// elementary; the cells are planar, so the diagonals do not matter. `rows` are (radius, height) pairs.
fn area_and_volume_of_rings(columns: u32, rows: &[(f64, f64)]) -> (f64, f64) {
    let columns = f64::from(columns);
    let mut sums = (0.0, 0.0);
    for pair in rows.windows(2) {
        let [(r, y), (s, z)] = [pair[0], pair[1]];
        let slant = ((s - r) * (PI / columns).cos()).hypot(z - y);
        sums.0 += columns * (r + s) * (PI / columns).sin() * slant;
        let polygon = columns / 2.0 * (2.0 * PI / columns).sin();
        sums.1 += (z - y) / 3.0 * polygon * (r * r + r * s + s * s);
    }
    sums
}

fn assert_near(found: f64, wanted: f64, relative: f64, what: &str) {
    assert!(
        (found - wanted).abs() <= relative * wanted.abs(),
        "{what}: {found}, not {wanted}"
    );
}

#[test]
fn areas_and_volumes_follow_the_closed_forms() {
    let (nu, nv) = (1000, 500);
    let sphere = generate::mesh(&grid(GeneratedShape::Sphere, nu, nv));
    let rows: Vec<_> = (0..=nv)
        .map(|j| f64::from(j) / f64::from(nv) * PI - PI / 2.0)
        .map(|w| (w.cos(), w.sin()))
        .collect();
    let (a, v) = area_and_volume_of_rings(nu, &rows);
    assert_near(area(&sphere), a, 1e-6, "area of the sphere's polyhedron");
    assert_near(
        volume(&sphere),
        v,
        1e-6,
        "volume of the sphere's polyhedron",
    );
    // The polyhedron is inscribed: below the sphere, by about the square of a cell.
    assert!(a < 4.0 * PI && v < 4.0 / 3.0 * PI);
    assert_near(a, 4.0 * PI, 2e-5, "area of the sphere");
    assert_near(v, 4.0 / 3.0 * PI, 4e-5, "volume of the sphere");

    let (nu, nv) = (800, 400);
    let torus = generate::mesh(&grid(GeneratedShape::Torus, nu, nv));
    let rows: Vec<_> = (0..=nv)
        .map(|j| f64::from(j) / f64::from(nv) * 2.0 * PI - PI)
        .map(|w| (1.0 + 0.4 * w.cos(), 0.4 * w.sin()))
        .collect();
    let (a, v) = area_and_volume_of_rings(nu, &rows);
    assert_near(area(&torus), a, 1e-6, "area of the torus's polyhedron");
    assert_near(volume(&torus), v, 1e-6, "volume of the torus's polyhedron");
    assert_near(a, 4.0 * PI * PI * 0.4, 5e-5, "area of the torus");
    assert_near(v, 2.0 * PI * PI * 0.16, 1e-4, "volume of the torus");

    let square = generate::mesh(&grid(GeneratedShape::Square, 7, 5));
    assert_near(area(&square), 1.0, 1e-6, "area of the square");
    let box_of = |pick: fn(Vec3, Vec3) -> Vec3| square.positions.iter().copied().reduce(pick);
    assert_eq!(box_of(Vec3::min), Some(Vec3::new(-0.5, -0.5, 0.0)));
    assert_eq!(box_of(Vec3::max), Some(Vec3::new(0.5, 0.5, 0.0)));
    assert!(square.normals.iter().all(|n| *n == Vec3::Z));
    let toward_viewer = |t: &[u32; 3]| {
        let [a, b, c] = corners(&square, t);
        (b - a).cross(c - a).z > 0.0
    };
    assert!(square.triangles.iter().all(toward_viewer));
}

#[test]
fn sphere_and_torus_are_indexed_as_stated() {
    let (nu, nv) = (24_u32, 11_u32);
    for shape in [GeneratedShape::Sphere, GeneratedShape::Torus] {
        let mesh = generate::mesh(&grid(shape, nu, nv));
        for (i, j) in [(0, 1), (5, 0), (7, 4), (24, 9), (23, 11)] {
            let k = (j * (nu + 1) + i) as usize;
            let u = 2.0 * PI * f64::from(i) / f64::from(nu);
            let t = f64::from(j) / f64::from(nv);
            let (w, ring, height) = if shape == GeneratedShape::Sphere {
                let w = PI * t - PI / 2.0;
                (w, w.cos(), w.sin())
            } else {
                let w = 2.0 * PI * t - PI;
                (w, 1.0 + 0.4 * w.cos(), 0.4 * w.sin())
            };
            let point = DVec3::new(ring * u.sin(), height, ring * u.cos());
            let normal = DVec3::new(w.cos() * u.sin(), w.sin(), w.cos() * u.cos());
            assert!(
                (mesh.positions[k].as_dvec3() - point).length() < 2e-7,
                "{shape} {i} {j}"
            );
            assert!(
                (mesh.normals[k].as_dvec3() - normal).length() < 2e-7,
                "{shape} {i} {j}"
            );
        }
        let (i, j) = (7, 4);
        let a = j * (nu + 1) + i;
        let cell = (2 * (j * nu + i)) as usize;
        assert_eq!(mesh.triangles[cell], [a, a + 1, a + nu + 2]);
        assert_eq!(mesh.triangles[cell + 1], [a, a + nu + 2, a + nu + 1]);
    }
}

/// The statue's point over a point of the cube (coordinates -1 to 1), by the definition's own words.
fn statue_point(cube: [f64; 3]) -> DVec3 {
    let text = include_str!("../../assets/statue-waves.json");
    let rows: Vec<serde_json::Value> = serde_json::from_str(text).expect("a table");
    assert_eq!(rows.len(), 24);
    let p = DVec3::from(cube.map(|x| (x * FRAC_PI_4).tan())).normalize();
    let mut d = 0.0;
    for row in &rows {
        let number = |value: &serde_json::Value| value.as_f64().expect("a number");
        let q = DVec3::new(
            number(&row["q"][0]),
            number(&row["q"][1]),
            number(&row["q"][2]),
        );
        let wave = (p.dot(q) + number(&row["phase"])).sin();
        let s = match row["kind"].as_str() {
            Some("wave") => wave,
            Some("crease") => 0.6 - 1.6 * wave.abs(),
            other => panic!("unknown kind {other:?}"),
        };
        d += number(&row["amplitude"]) * s;
    }
    let mut v = p * (1.0 + d) * DVec3::new(0.8, 1.35, 0.7);
    v.x += 0.12 * (2.2 * v.y).sin();
    v
}

#[test]
fn the_statue_has_the_points_of_its_definition() {
    let n = 9;
    let mesh = generate::mesh(&grid(GeneratedShape::Statue, n, n));
    let mut left: Vec<Vec3> = mesh.positions.clone();
    let at = |k: u32| f64::from(k) / f64::from(n) * 2.0 - 1.0;
    for x in 0..=n {
        for y in 0..=n {
            for z in 0..=n {
                if ![x, y, z].iter().any(|k| *k == 0 || *k == n) {
                    continue;
                }
                let wanted = statue_point([at(x), at(y), at(z)]);
                let (index, distance) = left
                    .iter()
                    .map(|p| (p.as_dvec3() - wanted).length())
                    .enumerate()
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .expect("as many vertices as points");
                assert!(
                    distance < 2e-7,
                    "no vertex for cube point {x} {y} {z}: {distance:e}"
                );
                left.swap_remove(index);
            }
        }
    }
    assert!(left.is_empty());
}

/// The vertex over the middle of the cube's +z face, computed with Python's `math` from the definition.
const KNOWN_MIDDLE: [f64; 3] = [0.0, 0.0, 0.6330507763684233];
/// The same over the corner (1, 1, 1).
const KNOWN_CORNER: [f64; 3] = [0.600383429637633, 0.8156940376393048, 0.42295246396112096];

/// A figure that any other program can check.
#[test]
fn the_statue_known_answers() {
    for (cube, known) in [
        ([0.0, 0.0, 1.0], KNOWN_MIDDLE),
        ([1.0, 1.0, 1.0], KNOWN_CORNER),
    ] {
        assert!((statue_point(cube) - DVec3::from(known)).length() < 1e-12);
        let mesh = generate::mesh(&grid(GeneratedShape::Statue, 4, 4));
        let nearest = mesh
            .positions
            .iter()
            .map(|p| (p.as_dvec3() - DVec3::from(known)).length())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 2e-7, "{nearest:e}");
    }
}

/// More triangles on the same surface: every vertex of a coarse statue is one of a finer multiple.
#[test]
fn larger_statues_keep_the_surface() {
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    let coarse = generate::mesh(&grid(GeneratedShape::Statue, 8, 8));
    let fine = generate::mesh(&grid(GeneratedShape::Statue, 16, 16));
    let known: std::collections::HashSet<_> = fine.positions.iter().map(bits).collect();
    assert!(coarse.positions.iter().all(|p| known.contains(&bits(p))));
}

#[test]
fn any_number_of_threads_gives_the_same_model() {
    // Large enough for several blocks.
    for spec in [
        sized(GeneratedShape::Torus, 300_000),
        sized(GeneratedShape::Statue, 600_000),
    ] {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool");
            pool.install(|| {
                let mut bytes = Vec::new();
                generate::write_ply(&spec, &mut bytes, &SilentProgress).expect("written");
                (generate::mesh(&spec), bytes)
            })
        };
        let one = on(1);
        for threads in [2, 5] {
            assert!(on(threads) == one, "{spec:?} differs on {threads} threads");
        }
    }
}

#[test]
fn the_stream_has_the_bytes_of_the_mesh() {
    let mut specs = small();
    // Several blocks, of all row kinds, with borders within a face and a ring.
    specs.extend([
        sized(GeneratedShape::Sphere, 400_000),
        sized(GeneratedShape::Statue, 900_000),
        grid(GeneratedShape::Square, 200_000, 1),
    ]);
    for spec in specs {
        let mut streamed = Vec::new();
        generate::write_ply(&spec, &mut streamed, &SilentProgress).expect("written");
        let mut whole = Vec::new();
        ply::write_to(&generate::mesh(&spec), &mut whole, &SilentProgress).expect("written");
        assert!(streamed == whole, "{spec:?}");
    }
}

/// Counts what it is told; cancels after some bytes.
struct Meter {
    total: AtomicU64,
    done: AtomicU64,
    most: u64,
}

impl Meter {
    fn until(most: u64) -> Meter {
        Meter {
            total: AtomicU64::new(0),
            done: AtomicU64::new(0),
            most,
        }
    }
}

impl Progress for Meter {
    fn stage(&self, _name: &str, total: u64) {
        self.total.store(total, Ordering::Relaxed);
    }
    fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
    }
    fn is_cancelled(&self) -> bool {
        self.done.load(Ordering::Relaxed) > self.most
    }
}

#[test]
fn files_are_whole_or_absent() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("statue.ply");
    let spec = sized(GeneratedShape::Statue, 400_000);

    let meter = Meter::until(1000);
    let result = generate::write_ply_file(&spec, &path, &meter);
    assert!(matches!(result, Err(GenerateError::Cancelled)));
    let result = ply::write(&generate::mesh(&spec), &path, &meter);
    assert!(matches!(result, Err(GenerateError::Cancelled)));
    assert_eq!(std::fs::read_dir(&folder).expect("listed").count(), 0);

    let meter = Meter::until(u64::MAX);
    generate::write_ply_file(&spec, &path, &meter).expect("written");
    let size = path.metadata().expect("there").len();
    assert_eq!(meter.total.into_inner(), size);
    assert_eq!(meter.done.into_inner(), size);
    let streamed = std::fs::read(&path).expect("read");
    ply::write(&generate::mesh(&spec), &path, &SilentProgress).expect("written");
    assert!(streamed == std::fs::read(&path).expect("read"));
}

/// Takes some bytes, then is full.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self
            .0
            .checked_sub(bytes.len())
            .ok_or(std::io::ErrorKind::StorageFull)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let spec = grid(GeneratedShape::Sphere, 24, 11);
    for room in [0, 500, 7000] {
        let result = generate::write_ply(&spec, &mut Full(room), &SilentProgress);
        assert!(matches!(result, Err(GenerateError::Stream(_))), "{room}");
    }
}
