//! What lies in squares and in no rectangle.

use crate::render::reference::filtered::tests::*;

#[test]
fn what_lies_between_rectangles_takes_the_color_of_its_own_part() {
    let grid = |color: [f32; 3], z: f32| {
        let at = move |i: usize| [10.5 + 4.0 * (i % 3) as f32, 10.5 + 4.0 * (i / 3) as f32, z];
        (0..9).map(move |i| FilteredPatch {
            side_px: 7.0,
            ..splat(at(i), color, 1.0)
        })
    };
    // One that lies far before the others, next to the pixel that is looked at.
    let before = splat([13.5, 12.5, 2.0], GREEN, 1.0);
    let splats: Vec<_> = grid(RED, 30.0).chain([before]).collect();
    let got = draw_splats(&flat(), &splats, &style(5.0));
    assert_eq!(got.sums[at(12, 12)], [0.0; 4], "nothing is deposited there");
    assert_eq!(got.image.color[at(12, 12)], [255, 0, 0, 255]);
    assert_eq!(got.image.color[at(13, 12)], [0, 255, 0, 255]);
    // Of the same part, the nearest counts.
    let near = FilteredPatch {
        center: Vec3::new(13.5, 12.5, 29.9),
        ..before
    };
    let splats: Vec<_> = grid(RED, 30.0).chain([near]).collect();
    let got = draw_splats(&flat(), &splats, &style(5.0));
    assert_eq!(got.image.color[at(12, 12)], [0, 255, 0, 255]);
    // No farther than it is looked for.
    let alone = FilteredPatch {
        side_px: 39.0,
        ..splat([20.5, 20.5, 8.0], RED, 1.0)
    };
    let got = draw_splats(&flat(), &[alone], &style(5.0)).image;
    let (nothing, red) = ([0, 0, 0, 0], [255, 0, 0, 255]);
    for distance in [1, 2, 3, 5, 8, 13] {
        assert_eq!(got.color[at(20 + distance, 20)], red, "{distance}");
        assert_eq!(
            got.color[at(20 - distance, 20 + distance)],
            red,
            "{distance}"
        );
    }
    // Between those directions all around, less far.
    let around = FILTERED_AROUND_PX as usize;
    assert_eq!(got.color[at(20 + around, 20 + 3)], red);
    assert_eq!(got.color[at(20 + around + 1, 20 + 3)], nothing);
    assert_eq!(got.color[at(20 + 14, 20)], nothing);
}
