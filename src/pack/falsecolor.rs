//! False colors: levels of the tree, normals, depth and overdraw as colors that no light changes.
//!
//! The ramp is viridis (Smith and van der Walt, 2015), whose lightness grows evenly from end to end, so that its order is
//! seen without a legend, in gray and by eyes that tell few colors apart. Here it is a polynomial of degree 6 for each
//! channel, the fit by Zucker (2019, public domain), within 5 levels of the published colors.

use crate::abi::constants::MOST_OVERDRAW;
use crate::math::camera::View;
use crate::tree::Tree;
use glam::Vec3;

/// Where on the ramp leaves are: triangles, and splats of single leaves.
pub const LEAF: f32 = 1.0;

/// Red, green and blue of the ramp, each in 0..=1, at `t` in 0 (dark violet) to 1 (bright yellow).
pub fn ramp(t: f32) -> [f32; 3] {
    // Horner, the highest power first.
    const COEFFICIENTS: [[f32; 3]; 7] = [
        [-5.435_456, 4.645_852_6, 26.312_435],
        [4.776_385, -13.745_145, -65.353_03],
        [6.228_27, 14.179_933, 56.690_55],
        [-4.634_23, -5.799_101, -19.332_441],
        [-0.330_861_83, 0.214_847_56, 0.095_095_16],
        [0.105_093_04, 1.404_613_5, 1.384_590_1],
        [0.277_727_33, 0.005_407_344_5, 0.334_099_8],
    ];
    let t = t.clamp(0.0, 1.0);
    [0, 1, 2].map(|c| {
        let value = COEFFICIENTS.iter().fold(0.0, |sum, k| sum * t + k[c]);
        value.clamp(0.0, 1.0)
    })
}

fn eight_bits(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

/// The color of a node, none of a leaf: its level over the number of levels, on the ramp. So the root is at 0, and leaves
/// are at 1.
pub fn of_item(tree: &Tree, node: Option<u32>) -> [f32; 3] {
    let levels = tree.level_count().max(1) as f32;
    ramp(node.map_or(LEAF, |node| tree.level_of(node) as f32 / levels))
}

/// [`of_item`] in the eight bits of a record, with the alpha of its `color`.
pub fn of_record(tree: &Tree, node: Option<u32>, color: [u8; 4]) -> [u8; 4] {
    let [r, g, b] = of_item(tree, node).map(eight_bits);
    [r, g, b, color[3]]
}

/// A unit normal in model space as color: (n + 1) / 2, gray for the zero vector.
pub fn of_normal(normal: Vec3) -> [f32; 3] {
    (normal * 0.5 + Vec3::splat(0.5)).to_array()
}

/// The distances along the view direction, in view space, between which the ramp goes: those of a sphere around
/// everything (model space), what lies before the near plane left out.
pub fn depth_range(center: Vec3, radius: f32, view: &View) -> [f32; 2] {
    let middle = view.distance(center);
    let radius = radius * view.model_scale;
    let near = if view.is_perspective {
        (middle - radius).max(view.near)
    } else {
        middle - radius
    };
    let far = (middle + radius).max(near);
    // Of a model without any extent all is at the near end.
    [near, if far > near { far } else { near + 1.0 }]
}

/// A distance along the view direction as color: the near end of `range` is bright, the far one dark.
pub fn of_depth(distance: f32, [near, far]: [f32; 2]) -> [f32; 3] {
    ramp(1.0 - (distance - near) / (far - near))
}

/// How many primitives cover a pixel as color: 1 is at the dark end, twice as many are a sixth of the ramp farther,
/// [`MOST_OVERDRAW`] and more are at the bright end. Of 0 as of 1.
pub fn of_overdraw(count: u32) -> [f32; 3] {
    ramp((count.max(1) as f32).log2() / MOST_OVERDRAW.log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp8(t: f32) -> [u8; 3] {
        ramp(t).map(eight_bits)
    }

    #[test]
    fn the_ramp_is_viridis() {
        // As published in matplotlib.
        for (t, color) in [
            (0.0, [68, 1, 84]),
            (0.25, [59, 82, 139]),
            (0.5, [33, 145, 140]),
            (0.75, [94, 201, 98]),
            (1.0, [253, 231, 37]),
        ] {
            for (ours, theirs) in ramp8(t).iter().zip(color) {
                assert!(ours.abs_diff(theirs) <= 5, "{t}: {:?}", ramp8(t));
            }
        }
        assert_eq!(ramp(-1.0), ramp(0.0));
        assert_eq!(ramp(2.0), ramp(1.0));
    }

    #[test]
    fn its_lightness_grows_evenly() {
        // CIE L* of an sRGB color.
        let lightness = |t: f32| {
            let linear = ramp(t).map(|c| {
                if c <= 0.040_45 {
                    c / 12.92
                } else {
                    ((c + 0.055) / 1.055).powf(2.4)
                }
            });
            let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
            116.0 * y.cbrt() - 16.0
        };
        let steps: Vec<f32> = (0..20)
            .map(|i| lightness((i + 1) as f32 / 20.0) - lightness(i as f32 / 20.0))
            .collect();
        let mean = steps.iter().sum::<f32>() / 20.0;
        for step in &steps {
            assert!((0.6 * mean..1.4 * mean).contains(step), "{steps:?}");
        }
    }
}
