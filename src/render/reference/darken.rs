//! A pixel that a look darkens.

use crate::image::unorm8;

/// Multiplies the color of a pixel, and the same as floats where there are any, by `light`, 0 to 1. What the pixel is not
/// covered by shows the background, and stays.
pub(super) fn darken_pixel(
    (color, value): (&mut [u8; 4], Option<&mut [f32; 4]>),
    background: [f32; 3],
    light: f64,
) {
    let darkened = |[r, g, b, a]: [f64; 4]| {
        let of = |i: usize, color: f64| {
            let behind = f64::from(background[i]) * (1.0 - a);
            behind + (color - behind) * light
        };
        [of(0, r), of(1, g), of(2, b), a]
    };
    let bytes = color.map(|byte| f64::from(byte) / 255.0);
    *color = match value {
        Some(value) => {
            *value = darkened(value.map(f64::from)).map(|v| v as f32);
            value.map(|v| unorm8(f64::from(v)))
        }
        None => darkened(bytes).map(unorm8),
    };
}
