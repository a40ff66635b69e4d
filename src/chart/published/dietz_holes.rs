//! Pixels that splats leave bare, and what normals that are off do to them.

use super::{PublishedSubject, PublishedTable, count};
use crate::abi::OrientedPolygon;
use crate::chart::ChartError;
use crate::chart::run::orbit;
use crate::image::Image;
use crate::math::camera::View;
use crate::oriented::look::VertexLook;
use crate::oriented::radius::RadiusRule;
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::pack::polygons::PlaneFrame;
use crate::pack::{DrawList, PrimitiveStyle};
use crate::progress::Progress;
use crate::render::PictureOutputs;
use crate::render::reference::{PolygonList, render_with_polygons};
use crate::render::vertex_looks::looks_of;
use crate::tree::Model;
use glam::DVec3;

/// Views in which holes are looked for.
const HOLE_VIEWS: u32 = 12;
/// By how much normals are off, degrees.
pub(super) const OFF_DEGREES: f64 = 10.0;
/// Part of the model's radius by which a pixel is farther than the surface beside it where it shows what a hole lets through.
const HOLE_DEPTH: f32 = 0.01;

/// Pixels within the surface, by a pixel all around, that show nothing or what lies behind all that is near them there.
pub(super) fn bare_pixels(exact: &Image, picture: &Image, radius: f32) -> u64 {
    bare(exact, picture, radius).count() as u64
}

/// Indices of those.
pub(super) fn bare(exact: &Image, picture: &Image, radius: f32) -> impl Iterator<Item = usize> {
    let (width, height) = (exact.width as usize, exact.height as usize);
    let is_bare = move |&at: &usize| {
        let (x, y) = (at % width, at / width);
        if !(1..width - 1).contains(&x) || !(1..height - 1).contains(&y) {
            return false;
        }
        let around = (0..9).map(|k| exact.depth[(y + k / 3 - 1) * width + x + k % 3 - 1]);
        // Infinite beside an outline, where nothing is farther.
        let farthest = around.fold(0.0, f32::max);
        picture.depth[at] > farthest + HOLE_DEPTH * radius
    };
    (0..width * height).filter(is_bare)
}

/// Bare pixels where planes follow faces, and where their normals are off.
pub(super) fn hole_table(
    subject: &PublishedSubject<'_>,
    surface: &WeldedSurface,
    progress: &dyn Progress,
) -> Result<PublishedTable, ChartError> {
    let model = subject.model;
    let usual = SplatRules::default();
    let cut = SplatRules {
        clip: Some(5f64.to_radians()),
        ..usual
    };
    let with = |radius| SplatRules { radius, ..usual };
    let exact_looks = looks_of(model);
    let off_looks: Vec<VertexLook> = (exact_looks.iter().enumerate())
        .map(|(k, look)| VertexLook {
            normal: tilted(look.normal, k),
            ..*look
        })
        .collect();
    let rows = [
        ("whole, 0.5 d", with(RadiusRule::Dietz50)),
        ("whole, 0.65 d", with(RadiusRule::Dietz)),
        ("whole, covering", usual),
        ("cut 5\u{b0}", cut),
    ];
    let mut table = PublishedTable::new(
        format!(
            "Dietz: {}, bare pixels of {HOLE_VIEWS} views of 300 x 300, with normals as they are and off by {OFF_DEGREES} degrees",
            subject.name
        ),
        &["", "exact normals", "normals off", "remark"],
    );
    progress.stage("holes", 2 * rows.len() as u64);
    for (name, rules) in rows {
        let mut cells = vec![name.to_owned()];
        for is_off in [false, true] {
            if progress.is_cancelled() {
                return Err(ChartError::Cancelled);
            }
            let looks = if is_off { &off_looks } else { &exact_looks };
            let mut set = splats_of(surface, looks, &rules);
            if is_off && rules.clip.is_none() {
                for (k, splat) in set.splats.iter_mut().enumerate() {
                    tilt(splat, k);
                }
            }
            cells.push(count(bare_in_views(model, &set)?));
            progress.advance(1);
        }
        cells.push(match rules.clip {
            Some(_) => "planes are those of faces; normals decide light alone".into(),
            None => "the plane has the normal".into(),
        });
        table.row(cells);
    }
    Ok(table)
}

fn bare_in_views(model: &Model, set: &SplatSet) -> Result<u64, ChartError> {
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let beside: Vec<[u32; 3]> = (set.triangles.iter())
        .map(|&id| model.triangles[id as usize])
        .collect();
    let style = PrimitiveStyle::default();
    let mut bare = 0;
    for k in 0..HOLE_VIEWS {
        let view: View = orbit(model, (300, 300), 1.0, k, HOLE_VIEWS)?;
        let draw = |triangles: &[[u32; 3]], polygons| {
            let list = DrawList {
                vertices: &model.vertices,
                triangles,
                splats: &[],
                points: &[],
                textures: None,
            };
            let polygons = PolygonList {
                polygons,
                are_patches: false,
                ..PolygonList::default()
            };
            render_with_polygons(&view, &list, polygons, &style, outputs)
        };
        let exact = draw(&model.triangles, &[]);
        let picture = draw(&beside, &set.splats);
        bare += bare_pixels(&exact, &picture, model.orbit_radius);
    }
    Ok(bare)
}

/// A direction turned by [`OFF_DEGREES`] to a side that follows from a number.
pub(super) fn tilted(normal: DVec3, k: usize) -> DVec3 {
    let Some(normal) = normal.try_normalize() else {
        return normal;
    };
    let turn = k as f64 * 2.399_963_229_728_653;
    let (u, v) = normal.any_orthonormal_pair();
    let (sine, cosine) = OFF_DEGREES.to_radians().sin_cos();
    cosine * normal + sine * (turn.cos() * u + turn.sin() * v)
}

/// Turns the plane of a whole disc so.
pub(super) fn tilt(splat: &mut OrientedPolygon, k: usize) {
    let normal = tilted(splat.normal.as_dvec3(), k);
    if let Some(frame) = PlaneFrame::new(splat.center.as_dvec3(), normal) {
        splat.normal = frame.normal.as_vec3();
        splat.axis = frame.axis.as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, Vec3};

    fn flat(depth: f32) -> Image {
        Image {
            width: 5,
            height: 5,
            color: vec![[0; 4]; 25],
            depth: vec![depth; 25],
            ..Image::default()
        }
    }

    #[test]
    fn what_lies_behind_a_surface_is_bare_and_an_outline_is_not() {
        let mut exact = flat(1.0);
        // A hundredth of the radius decides, whatever that is.
        for (radius, depth, expected) in [
            (1.0, 1.009, 0),
            (1.0, 1.011, 9),
            (4.0, 1.039, 0),
            (4.0, 1.041, 9),
            (0.1, 1.0009, 0),
            (0.1, 1.0011, 9),
            (1.0, f32::INFINITY, 9),
            (1.0, 0.5, 0),
        ] {
            let found = bare_pixels(&exact, &flat(depth), radius);
            assert_eq!(found, expected, "{radius} {depth}: never at the rim");
        }
        let mut picture = flat(1.0);
        picture.depth[12] = f32::INFINITY;
        picture.depth[13] = 1.5;
        assert_eq!(bare(&exact, &picture, 1.0).collect::<Vec<_>>(), [12, 13]);
        // Before a step, what is as far as its far side is no hole; beyond that it is.
        exact.depth[17] = 1.5;
        assert_eq!(bare(&exact, &picture, 1.0).collect::<Vec<_>>(), [12]);
        // Beside what is bare in the exact picture too there is an outline.
        exact.depth[6] = f32::INFINITY;
        assert_eq!(bare_pixels(&exact, &picture, 1.0), 0);
    }

    #[test]
    fn tilted_normals_are_off_by_the_angle_whatever_they_are() {
        for (k, normal) in [DVec3::X, DVec3::NEG_Z, DVec3::ONE].into_iter().enumerate() {
            let off = tilted(normal, k).angle_between(normal).to_degrees();
            assert!((off - OFF_DEGREES).abs() < 1e-9, "{off}");
        }
        assert_eq!(tilted(DVec3::ZERO, 3), DVec3::ZERO);
        let disc = PlaneFrame::new(DVec3::ZERO, DVec3::Y)
            .and_then(|frame| OrientedPolygon::disc(&frame, 1.0, &[], [255; 4]));
        let mut disc = disc.unwrap_or_else(|| unreachable!("a disc"));
        tilt(&mut disc, 1);
        assert!((disc.normal.dot(disc.axis)).abs() < 1e-6);
        assert!((disc.normal.dot(Vec3::Y) - 10f32.to_radians().cos()).abs() < 1e-6);
        let axes = DMat3::from_cols(
            disc.axis.as_dvec3(),
            disc.second_axis().as_dvec3(),
            disc.normal.as_dvec3(),
        );
        assert!((axes.determinant() - 1.0).abs() < 1e-5);
    }
}
