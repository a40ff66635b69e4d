//! Lists without anything in them that could be drawn.

use crate::render::reference::filtered::tests::*;

#[test]
fn nothing_and_nonsense_draw_the_background() {
    let style = PrimitiveStyle {
        background: [1.0, 0.5, 0.0],
        ..style(2.0)
    };
    assert!(
        splat([f32::NAN, 1.0, 1.0], RED, 1.0)
            .place(&flat())
            .is_none()
    );
    let nan = FilteredSplat {
        window_px: [f32::NAN, 1.0],
        ..placed(&flat(), &[splat([1.0; 3], RED, 1.0)])[0]
    };
    let vertices = wall(f32::INFINITY, Vec3::Y);
    for list in [
        FilteredList::default(),
        FilteredList {
            vertices: &vertices,
            triangles: &[[0, 1, 2], [0, 1, 9]],
            splats: &[nan],
            textures: None,
        },
    ] {
        let got = render_filtered(&flat(), &list, &style, PictureOutputs::default());
        assert!(got.image.color == vec![[255, 128, 0, 0]; 48 * 40]);
        assert!(got.front == vec![0.0; 48 * 40]);
        assert!(got.sums == vec![[0.0; 4]; 48 * 40]);
        assert!(got.image.depth.is_empty() && got.image.normal.is_empty());
    }
    let hole = View { width: 0, ..flat() };
    let got = draw_splats(&hole, &[splat([1.0; 3], RED, 1.0)], &style);
    assert!(got.front.is_empty() && got.sums.is_empty() && got.image.color.is_empty());
    // What is not finite spoils its own pixels.
    let spoiled = [
        splat([10.5, 10.5, 8.0], RED, f32::NAN),
        splat([20.5, 10.5, 8.0], [f32::NAN; 3], 1.0),
    ];
    let got = draw_splats(
        &flat(),
        &spoiled,
        &PrimitiveStyle {
            splat_size_px: 1.0,
            ..style
        },
    );
    assert_eq!(got.image.color[at(10, 10)], [255, 128, 0, 0]);
    assert_eq!(got.image.color[at(20, 10)], [0, 0, 0, 255]);
}
