//! Which surface a pixel shows, and how it is shaded.

use super::scene::*;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use surfel::abi::{Splat, Vertex};
use surfel::math::camera::{Camera, HeadlightSource, View};
use surfel::math::octahedral;
use surfel::pack::{ColorBy, DrawList, PrimitiveStyle};
use surfel::render::PictureOutputs;
use surfel::render::reference::render;

#[test]
fn nearer_wins_and_the_first_drawn_wins_ties() {
    let red = |z| Vertex {
        color: [255, 0, 0, 255],
        ..vertex(at(10.5, 10.5, z))
    };
    let green = |z| Splat {
        color: [0, 255, 0, 255],
        ..splat(at(10.5, 10.5, z), 0.0)
    };
    let pixel = |points: &[Vertex], splats: &[Splat], triangles: &Model| {
        let list = DrawList {
            points,
            splats,
            ..triangles.list()
        };
        draw_flat(&list, &PrimitiveStyle::default()).color[10 * 64 + 10]
    };
    let none = Model::default();
    assert_eq!(pixel(&[red(5.0)], &[green(5.0)], &none), [0, 204, 0, 255]);
    assert_eq!(pixel(&[red(4.9)], &[green(5.0)], &none), [204, 0, 0, 255]);
    assert_eq!(pixel(&[red(5.1)], &[green(5.0)], &none), [0, 204, 0, 255]);
    let wall = |z| Model::from_corners(&[[at(0.0, 0.0, z), at(0.0, 60.0, z), at(60.0, 0.0, z)]]);
    assert_eq!(
        pixel(&[red(5.0)], &[green(5.0)], &wall(5.0)),
        [204, 204, 204, 255]
    );
    assert_eq!(pixel(&[], &[green(4.9)], &wall(5.0)), [0, 204, 0, 255]);
    assert_eq!(pixel(&[], &[green(5.1)], &wall(5.0)), [204, 204, 204, 255]);
    // Two of one kind.
    let blue = Splat {
        color: [0, 0, 255, 255],
        ..green(5.0)
    };
    assert_eq!(pixel(&[], &[blue, green(5.0)], &none), [0, 0, 204, 255]);
    assert_eq!(pixel(&[], &[green(5.0), blue], &none), [0, 204, 0, 255]);
}

#[test]
fn splats_before_the_near_and_behind_the_far_plane_are_dropped() {
    let view = from_origin((64, 64), 60.0, (1.0, 10.0));
    for (z, is_drawn) in [
        (0.99, false),
        (1.0, true),
        (9.99, true),
        (10.1, false),
        (-3.0, false),
    ] {
        let splats = [splat(Vec3::new(0.0, 0.0, -z), 0.0)];
        let list = DrawList {
            splats: &splats,
            ..DrawList::default()
        };
        let covered = render(
            &view,
            &list,
            &PrimitiveStyle::default(),
            PictureOutputs::default(),
        )
        .covered_pixels();
        assert_eq!(covered, u64::from(is_drawn), "distance {z}");
    }
}

#[test]
fn shading_follows_the_style() {
    // Facing away by 60 degrees from the light along the view.
    let tilted = Vec3::new(0.0, 3f32.sqrt() / 2.0, -0.5);
    let surfel = Splat {
        normal: octahedral::encode(tilted),
        color: [255, 51, 0, 255],
        ..splat(at(10.5, 10.5, 5.0), 0.0)
    };
    let color = |surfel: Splat, style: PrimitiveStyle| {
        let splats = [surfel];
        let list = DrawList {
            splats: &splats,
            ..DrawList::default()
        };
        draw_flat(&list, &style).color[10 * 64 + 10]
    };
    let plain = PrimitiveStyle::default();
    assert_eq!(color(surfel, plain), [102, 20, 0, 255]);
    assert_eq!(
        color(
            surfel,
            PrimitiveStyle {
                use_colors: false,
                ..plain
            }
        ),
        [102, 102, 102, 255]
    );
    assert_eq!(
        color(
            surfel,
            PrimitiveStyle {
                two_sided: false,
                ..plain
            }
        ),
        [0, 0, 0, 255]
    );
    let by_kind = PrimitiveStyle {
        color_by: ColorBy::Primitive,
        ..plain
    };
    assert_eq!(color(surfel, by_kind), [102, 20, 20, 255]);
    let without_normal = Splat {
        color: [255, 51, 0, 0],
        ..surfel
    };
    assert_eq!(color(without_normal, plain), [204, 41, 0, 255]);
    assert_eq!(
        color(
            without_normal,
            PrimitiveStyle {
                two_sided: false,
                ..plain
            }
        ),
        [204, 41, 0, 255]
    );

    let wall = Model::from_corners(&[[at(0.0, 0.0, 2.0), at(0.0, 60.0, 2.0), at(60.0, 0.0, 2.0)]]);
    assert_eq!(
        draw_flat(&wall.list(), &by_kind).color[0],
        [41, 71, 204, 255]
    );
}

#[test]
fn the_point_light_is_in_the_eye_and_the_directional_one_along_the_view() {
    let mut view = from_origin((100, 100), 90.0, (0.5, 10.0));
    let points = [vertex(Vec3::new(2.01, 0.01, -4.0))];
    let list = DrawList {
        points: &points,
        ..DrawList::default()
    };
    let level = |view: &View| {
        let image = render(
            view,
            &list,
            &PrimitiveStyle::default(),
            PictureOutputs::default(),
        );
        image.color.iter().find(|c| c[3] > 0).unwrap()[0]
    };
    let cosine = 4.0 / Vec3::new(2.01, 0.01, 4.0).length();
    assert_eq!(level(&view), (255.0 * 0.8 * cosine + 0.5).floor() as u8);
    view.light = HeadlightSource::Directional;
    assert_eq!(level(&view), 204);
}

#[test]
fn back_faces_are_culled_by_what_the_eye_sees() {
    let culling = PrimitiveStyle {
        cull_back_faces: true,
        ..PrimitiveStyle::default()
    };
    // A closed sphere loses nothing; turned inside out it shows its far side.
    let outside = sphere(DVec3::ZERO, 60, 30);
    let mut inside = outside.clone();
    for t in &mut inside.triangles {
        t.swap(0, 1);
    }
    let view = sphere_view(3.0, 200);
    let center = 100 * 200 + 100;
    let all = render(&view, &outside.list(), &PrimitiveStyle::default(), BOTH);
    assert_eq!(render(&view, &outside.list(), &culling, BOTH), all);
    let far_side = render(&view, &inside.list(), &culling, BOTH);
    assert!(
        (far_side.depth[center] - 4.0).abs() < 0.02,
        "{}",
        far_side.depth[center]
    );
    // A mirroring view still shows the outside.
    let mut camera = Camera::look_at(
        (200, 200),
        DVec3::new(0.0, 0.0, 3.0),
        DVec3::ZERO,
        DVec3::Y,
        PI / 3.0,
        [1.5, 4.5],
    );
    camera.proj.x_axis.x = -camera.proj.x_axis.x;
    let mirrored = render(
        &camera.view(DVec3::ZERO).unwrap(),
        &outside.list(),
        &culling,
        BOTH,
    );
    assert!(
        (mirrored.depth[center] - 2.0).abs() < 0.02,
        "{}",
        mirrored.depth[center]
    );
    assert_eq!(mirrored.covered_pixels(), all.covered_pixels());
}

#[test]
fn normals_are_normalized_after_interpolation_and_unknown_ones_do_not_count() {
    let tilted = |x: f32| octahedral::encode(Vec3::new(x, 0.0, 1.0));
    let mut wall =
        Model::from_corners(&[[at(0.0, 0.5, 2.0), at(30.5, 60.0, 2.0), at(61.0, 0.5, 2.0)]]);
    let shown = |model: &Model| draw_flat(&model.list(), &PrimitiveStyle::default());
    // Left and right lean apart by 45 degrees each; the middle of the top edge faces the light.
    wall.vertices[0].normal = tilted(-1.0);
    wall.vertices[2].normal = tilted(1.0);
    let middle = 64 + 30;
    let image = shown(&wall);
    assert_eq!(image.color[middle], [204, 204, 204, 255]);
    assert_eq!(image.normal[middle][2], 1.0);
    let level = f64::from(image.color[64 + 1][0]);
    assert!((level - 204.0 * 0.5f64.sqrt()).abs() < 5.0, "{level}");
    // Without a normal on the right, that of the others holds up to there.
    wall.vertices[1].normal = tilted(-1.0);
    wall.vertices[2].color[3] = 0;
    let image = shown(&wall);
    for x in [1, 30, 58] {
        let level = f64::from(image.color[64 + x][0]);
        assert!(
            (level - 204.0 * 0.5f64.sqrt()).abs() < 0.6,
            "column {x}: {level}"
        );
    }
    // Without any, the wall is shaded as if it faced the light, and has no normal to give.
    for v in &mut wall.vertices {
        v.color[3] = 0;
    }
    let image = shown(&wall);
    assert_eq!(image.color[64 + 1], [204, 204, 204, 255]);
    assert_eq!(image.normal[64 + 1], [0.0; 3]);
}
