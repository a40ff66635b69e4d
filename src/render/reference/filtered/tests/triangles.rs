//! Triangles in both passes, and beside splats.

use crate::render::reference::filtered::tests::*;

use crate::pack::DrawList;
use crate::render::reference::render;

struct Surface {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
}

/// A waving sheet across the picture of [`perspective`] at about `distance`, and its true normals.
fn sheet(distance: f32, wave: f32, extent: f32) -> Surface {
    let n = 12u32;
    let vertices = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (i as f32 / n as f32, j as f32 / n as f32)))
        .map(|(u, v)| {
            let (x, y) = (extent * (2.0 * u - 1.0), extent * (2.0 * v - 1.0));
            let z = -distance + wave * (x.sin() + (1.3 * y).cos());
            let normal = Vec3::new(-wave * x.cos(), 1.3 * wave * (1.3 * y).sin(), 1.0);
            vertex(
                Vec3::new(x, y, z),
                normal,
                [(250.0 * u) as u8, 90, (250.0 * v) as u8],
            )
        })
        .collect();
    let triangles = (0..n)
        .flat_map(|j| (0..n).map(move |i| j * (n + 1) + i))
        .flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]])
        .collect();
    Surface {
        vertices,
        triangles,
    }
}

#[test]
fn triangles_alone_look_as_in_one_pass() {
    let view = perspective();
    let near = sheet(10.0, 0.4, 4.0);
    // The farther sheet waves more than the nearer, which it comes close to here and there.
    let behind = sheet(10.8, 0.9, 6.0);
    let mut vertices = near.vertices.clone();
    vertices.extend(&behind.vertices);
    let shift = near.vertices.len() as u32;
    let shifted = behind.triangles.iter().map(|t| t.map(|i| i + shift));
    let triangles: Vec<[u32; 3]> = near.triangles.iter().copied().chain(shifted).collect();
    let style = PrimitiveStyle {
        background: [0.1, 0.2, 0.3],
        ..style(2.0)
    };
    let outputs = PictureOutputs {
        depth: true,
        normal: true,
        values: false,
    };
    let list = DrawList {
        vertices: &vertices,
        triangles: &triangles,
        ..DrawList::default()
    };
    let expected = render(&view, &list, &style, outputs);
    let list = FilteredList {
        vertices: &vertices,
        triangles: &triangles,
        splats: &[],
        textures: None,
    };
    let got = render_filtered(&view, &list, &style, outputs);
    assert!(got.image.normal.iter().all(|n| *n == [0.0; 3]));
    let mut covered = 0;
    for (i, (a, b)) in expected.color.iter().zip(&got.image.color).enumerate() {
        assert_eq!(got.sums[i][3], f32::from(a[3]) / 255.0);
        assert!((0..4).all(|c| a[c].abs_diff(b[c]) <= 1), "{i}: {a:?} {b:?}");
        let (one, two) = (expected.depth[i], got.image.depth[i]);
        assert!(
            one == two || (one - two).abs() < 1e-5 * one,
            "{i}: {one} {two}"
        );
        covered += usize::from(a[3] > 0);
    }
    assert!((500..48 * 40).contains(&covered), "{covered}");
}

#[test]
fn a_floor_from_behind_the_eye_to_behind_the_far_plane_has_no_holes() {
    let view = perspective();
    let vertices = [
        [-300.0, 50.0],
        [300.0, 50.0],
        [300.0, -500.0],
        [-300.0, -500.0],
    ]
    .map(|[x, z]| vertex(Vec3::new(x, -2.0, z), Vec3::Y, [255; 3]));
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let list = DrawList {
        vertices: &vertices,
        triangles: &triangles,
        ..DrawList::default()
    };
    let expected = render(&view, &list, &style(8.0), PictureOutputs::default());
    let list = FilteredList {
        vertices: &vertices,
        triangles: &triangles,
        splats: &[],
        textures: None,
    };
    let got = render_filtered(&view, &list, &style(8.0), PictureOutputs::default());
    let mut covered = 0;
    for (i, (a, b)) in expected.color.iter().zip(&got.image.color).enumerate() {
        covered += usize::from(a[3] == 255);
        assert_eq!(got.sums[i][3], f32::from(a[3]) / 255.0, "{i}");
        assert!((0..4).all(|c| a[c].abs_diff(b[c]) <= 1), "{i}: {a:?} {b:?}");
    }
    assert!(covered > 700, "{covered}");
}

#[test]
fn splats_blend_with_triangles_behind_them_by_their_offset() {
    let vertices = wall(100.0, Vec3::NEG_Z);
    let i = at(10, 10);
    let sum = |z: f32| {
        let splats = [wide(4.0, splat([10.5, 10.5, z], GREEN, 8.0))];
        let list = FilteredList {
            vertices: &vertices,
            triangles: &[[0, 1, 2]],
            splats: &placed(&flat(), &splats),
            textures: None,
        };
        render_filtered(&flat(), &list, &style(4.0), PictureOutputs::default()).sums[i]
    };
    // The wall in headlight is 0.8; the splat has half the weight and is 0.5 deep.
    for (z, weight, green) in [
        (99.0, 0.5, 0.5),
        (99.6, 1.5, 1.3),
        (100.0, 1.5, 1.3),
        (100.1, 1.0, 0.8),
    ] {
        let got = sum(z);
        assert_near(got[3], weight, 2e-5);
        assert_near(got[1], green, 2e-5);
    }
}

#[test]
fn backs_are_in_no_pass_when_they_are_culled() {
    let vertices = wall(100.0, Vec3::NEG_Z);
    for mirrored in [false, true] {
        let mut camera = flat_camera();
        if mirrored {
            camera.proj.x_axis.x = -camera.proj.x_axis.x;
        }
        let view = camera.view(DVec3::ZERO).unwrap();
        for (cull, corners, is_drawn) in [
            (true, [0, 1, 2], true),
            (true, [0, 2, 1], false),
            (false, [0, 2, 1], true),
        ] {
            let list = FilteredList {
                vertices: &vertices,
                triangles: &[corners],
                splats: &[],
                textures: None,
            };
            let style = PrimitiveStyle {
                cull_back_faces: cull,
                ..style(2.0)
            };
            let got = render_filtered(&view, &list, &style, PictureOutputs::default());
            assert_eq!(
                got.front.iter().any(|&d| d > 0.0),
                is_drawn,
                "{cull} {corners:?}"
            );
            assert_eq!(
                got.sums.iter().any(|s| s[3] > 0.0),
                is_drawn,
                "{cull} {corners:?}"
            );
        }
    }
}

#[test]
fn a_mirrored_view_gives_the_mirrored_picture() {
    let style = PrimitiveStyle {
        cull_back_faces: true,
        ..style(2.5)
    };
    for is_perspective in [false, true] {
        let mut camera = if is_perspective {
            Camera::look_at(SIZE, DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2, [1.0, 100.0])
        } else {
            flat_camera()
        };
        let view = camera.view(DVec3::ZERO).unwrap();
        camera.proj.x_axis.x = -camera.proj.x_axis.x;
        let mirrored = camera.view(DVec3::ZERO).unwrap();
        let splats = cloud(&view, 300, 2.5);
        let surface = if is_perspective {
            sheet(8.0, 0.4, 3.0)
        } else {
            Surface {
                vertices: wall(5.0, Vec3::NEG_Z),
                triangles: vec![[0, 1, 2]],
            }
        };
        let drawn = |view: &View| {
            let list = FilteredList {
                vertices: &surface.vertices,
                triangles: &surface.triangles,
                splats: &placed(view, &splats),
                textures: None,
            };
            render_filtered(view, &list, &style, PictureOutputs::default())
        };
        let (a, b) = (drawn(&view), drawn(&mirrored));
        // Sides and edges exactly at pixel centers fall the other way: a few, at 1/256 pixel.
        let mut differing = 0;
        for y in 0..40 {
            for x in 0..48 {
                let (p, q) = (a.sums[at(x, y)], b.sums[at(47 - x, y)]);
                differing += usize::from(p.iter().zip(&q).any(|(p, q)| (p - q).abs() > 1e-4));
            }
        }
        assert!(differing < 15, "{differing}");
        assert!(a.sums.iter().filter(|s| s[3] > 0.0).count() > 700);
        assert!(a.sums != b.sums);
    }
}
