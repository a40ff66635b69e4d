//! Meshes that are easy, awkward and broken.

use glam::{DVec3, Vec3};
use surfel::mesh::Mesh;

/// A grid of `nu` by `nv` cells over a surface; `closed_u`, `closed_v`: doubled seams with equal positions.
pub(crate) fn grid(
    nu: usize,
    nv: usize,
    wraps: (bool, bool),
    surface: impl Fn(f64, f64) -> DVec3,
) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=nv {
        for i in 0..=nu {
            let i = if wraps.0 { i % nu } else { i };
            let j = if wraps.1 { j % nv } else { j };
            mesh.positions
                .push(surface(i as f64 / nu as f64, j as f64 / nv as f64).as_vec3());
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let a = (j * (nu + 1) + i) as u32;
            let row = nu as u32 + 1;
            mesh.triangles.push([a, a + 1, a + row + 1]);
            mesh.triangles.push([a, a + row + 1, a + row]);
        }
    }
    mesh
}

pub(crate) fn torus(nu: usize, nv: usize) -> Mesh {
    let tau = std::f64::consts::TAU;
    grid(nu, nv, (true, true), |s, t| {
        let (u, w) = (tau * s, tau * (t - 0.5));
        DVec3::new(
            (1.0 + 0.4 * w.cos()) * u.sin(),
            0.4 * w.sin(),
            (1.0 + 0.4 * w.cos()) * u.cos(),
        )
    })
}

pub(crate) fn sphere(nu: usize, nv: usize) -> Mesh {
    grid(nu, nv, (true, false), |s, t| {
        let (u, w) = (std::f64::consts::TAU * s, std::f64::consts::PI * (t - 0.5));
        // Exact poles, so that the caps close.
        let ring = if t == 0.0 || t == 1.0 { 0.0 } else { w.cos() };
        DVec3::new(ring * u.sin(), w.sin(), ring * u.cos())
    })
}

pub(crate) fn square(n: usize) -> Mesh {
    grid(n, n, (false, false), |s, t| {
        DVec3::new(s - 0.5, t - 0.5, 0.0)
    })
}

pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) - 0.5
    }
}

/// Unconnected triangles of very different sizes, some of them points, segments or copies.
pub(crate) fn soup(count: usize, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let mut mesh = Mesh::default();
    for index in 0..count {
        let at = random.vector() * 10.0;
        let size = 10f32.powf(random.unit() * 6.0 - 5.0);
        let mut corners = [(); 3].map(|()| at + random.vector() * size);
        match index % 11 {
            3 => corners[1] = corners[0],
            5 => corners = [at; 3],
            7 => corners[2] = corners[0] + (corners[1] - corners[0]) * 0.25,
            8 if index > 20 => corners.copy_from_slice(&mesh.positions[30..33]),
            _ => {}
        }
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

pub(crate) fn needles(count: usize) -> Mesh {
    let mut random = Random(3);
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let at = random.vector() * 3.0;
        let axis = random.vector().normalize_or(Vec3::X);
        let first = mesh.positions.len() as u32;
        let side = axis.any_orthonormal_vector() * 1e-4;
        mesh.positions.extend([at, at + axis * 5.0, at + side]);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

pub(crate) fn cloud(count: usize) -> Mesh {
    let mut random = Random(17);
    Mesh {
        positions: (0..count)
            .map(|_| random.vector().normalize_or(Vec3::Y))
            .collect(),
        ..Mesh::default()
    }
}
