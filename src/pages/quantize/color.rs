//! Colors in 16 bits.

/// Packs red, green and blue in 5, 6 and 5 bits, rounded to the nearest: off by at most 4, 2 and 4 of 255.
#[inline]
pub fn color_to_565([r, g, b]: [u8; 3]) -> u16 {
    let scaled = |value: u8, most: u16| (u16::from(value) * most + 127) / 255;
    scaled(r, 31) << 11 | scaled(g, 63) << 5 | scaled(b, 31)
}

/// Unpacks red, green and blue; the upper bits stand again in the lower ones, so that black and white stay what they are.
#[inline]
pub fn color_from_565(code: u16) -> [u8; 3] {
    let five = |value: u16| (value << 3 | value >> 2) as u8;
    let green = code >> 5 & 63;
    [
        five(code >> 11),
        (green << 2 | green >> 4) as u8,
        five(code & 31),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_survive_and_colors_are_off_by_half_a_step() {
        for code in 0..=u16::MAX {
            assert_eq!(color_to_565(color_from_565(code)), code);
        }
        for value in 0..=255u8 {
            let [r, g, b] = color_from_565(color_to_565([value; 3]));
            assert!(r.abs_diff(value) <= 4 && g.abs_diff(value) <= 2, "{value}");
            assert_eq!(r, b);
        }
        assert_eq!(color_from_565(color_to_565([255; 3])), [255; 3]);
        assert_eq!(color_from_565(color_to_565([0; 3])), [0; 3]);
        assert_eq!(color_to_565([255, 0, 0]), 31 << 11);
        assert_eq!(color_to_565([0, 0, 255]), 31);
    }
}
