//! A texture of a material as `map_Kd` names it: options, and a name.

use glam::Vec2;

use crate::textures::WrapMode;

/// How texture coordinates are scaled and then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImagePlace {
    scale: Vec2,
    offset: Vec2,
}

impl ImagePlace {
    const WHOLE: Self = Self {
        scale: Vec2::ONE,
        offset: Vec2::ZERO,
    };

    /// Where a texture coordinate from the lower left is, from the upper left.
    pub(super) fn of(self, coordinate: Vec2) -> Vec2 {
        let Vec2 { x, y } = coordinate * self.scale + self.offset;
        Vec2::new(x, 1.0 - y)
    }
}

/// A diffuse texture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MaterialTexture {
    /// As written, without quotes.
    pub(super) name: String,
    pub(super) wrap: WrapMode,
    pub(super) place: ImagePlace,
}

impl MaterialTexture {
    /// What follows `map_Kd`: options, then a name that may hold spaces. `None` without a name.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut texture = Self {
            name: String::new(),
            wrap: WrapMode::Repeat,
            place: ImagePlace::WHOLE,
        };
        let mut rest = text.trim();
        // The next word, and what follows it, which must be something: the last word is a name.
        let next = |text: &'_ str| -> Option<(String, usize)> {
            let end = text.find(char::is_whitespace)?;
            let after = text[end..].trim_start();
            (!after.is_empty()).then(|| (text[..end].to_owned(), text.len() - after.len()))
        };
        while let Some((option, after)) = next(rest).filter(|(word, _)| word.starts_with('-')) {
            let (least, most) = match option.to_ascii_lowercase().as_str() {
                "-o" | "-s" | "-t" => (1, 3),
                "-mm" => (2, 2),
                "-blendu" | "-blendv" | "-cc" | "-clamp" | "-texres" | "-bm" | "-boost"
                | "-imfchan" | "-type" => (1, 1),
                _ => break,
            };
            rest = &rest[after..];
            let mut words = Vec::new();
            while words.len() < most
                && let Some((word, after)) = next(rest)
                && (words.len() < least || word.parse::<f32>().is_ok())
            {
                words.push(word);
                rest = &rest[after..];
            }
            let number = |index: usize, missing: f32| {
                let number = words.get(index).and_then(|word: &String| word.parse().ok());
                number.unwrap_or(missing)
            };
            match option.to_ascii_lowercase().as_str() {
                "-o" => texture.place.offset = Vec2::new(number(0, 0.0), number(1, 0.0)),
                "-s" => texture.place.scale = Vec2::new(number(0, 1.0), number(1, 1.0)),
                "-clamp" if words.first().is_some_and(|word| word == "on") => {
                    texture.wrap = WrapMode::Clamp;
                }
                _ => {}
            }
        }
        let quotes = |c: char| matches!(c, '"' | '\'') || c.is_whitespace();
        texture.name = rest.trim_matches(quotes).to_owned();
        (!texture.name.is_empty()).then_some(texture)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn textures_have_options_and_names_with_spaces() {
        let of = |text: &str| {
            let texture = MaterialTexture::parse(text).unwrap();
            let place = texture.place.of(Vec2::new(0.5, 0.25)).to_array();
            (texture.name, texture.wrap, place)
        };
        let plain = [0.5, 0.75];
        for (text, name, wrap, place) in [
            ("a.png", "a.png", WrapMode::Repeat, plain),
            ("  my scan 1.jpg ", "my scan 1.jpg", WrapMode::Repeat, plain),
            ("\"my scan.jpg\"", "my scan.jpg", WrapMode::Repeat, plain),
            ("-clamp on -bm 1 b.png", "b.png", WrapMode::Clamp, plain),
            (
                "-s 2 4 1 -o 1 0 0 c d.png",
                "c d.png",
                WrapMode::Repeat,
                [2.0, 0.0],
            ),
            ("-s 1 1 1", "1", WrapMode::Repeat, plain),
            (
                "-mm 0 1 -s 1 1 -texres 256 -blendu on 7.png",
                "7.png",
                WrapMode::Repeat,
                plain,
            ),
            (
                r"C:\scans\a b.png",
                r"C:\scans\a b.png",
                WrapMode::Repeat,
                plain,
            ),
            ("-odd name.png", "-odd name.png", WrapMode::Repeat, plain),
        ] {
            assert_eq!(of(text), (name.to_owned(), wrap, place), "{text}");
        }
        assert!(MaterialTexture::parse("  ").is_none());
    }
}
