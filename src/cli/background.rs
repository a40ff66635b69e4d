//! The option that says what is behind the model.

use super::{CommandFailure, usage};
use clap::Args as ClapArgs;

/// What is behind the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum BackgroundChoice {
    /// One color.
    Flat([f32; 3]),
    /// The colors of the upper and of the lower edge.
    Gradient([f32; 3], [f32; 3]),
    /// Nothing: pictures have alpha.
    Transparent,
}

/// Upper and lower edge of `gradient`.
const USUAL_GRADIENT: [[u8; 3]; 2] = [[96, 108, 124], [24, 26, 30]];

/// What is behind the model.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct BackgroundArgs {
    /// Background: black, white, gray, #rrggbb, or R,G,B with 0 to 255; two of these names with a comma between, from the upper to
    /// the lower edge, or gradient; in surfel render transparent (PNG and EXR with alpha)
    #[arg(long, value_name = "COLOR", default_value = "black", value_parser = parse_background)]
    background: BackgroundChoice,
    /// Pictures of the command may have alpha.
    #[arg(skip)]
    pub(crate) may_be_transparent: bool,
}

impl BackgroundArgs {
    /// Colors of the upper edge, and of the lower where that is another.
    ///
    /// # Errors
    /// When it is to be transparent in a command that writes no alpha.
    pub(crate) fn colors(&self) -> Result<([f32; 3], Option<[f32; 3]>), CommandFailure> {
        match self.background {
            BackgroundChoice::Flat(color) => Ok((color, None)),
            BackgroundChoice::Gradient(top, bottom) => Ok((top, Some(bottom))),
            // What is before black is premultiplied by what it covers.
            BackgroundChoice::Transparent if self.may_be_transparent => Ok(([0.0; 3], None)),
            BackgroundChoice::Transparent => Err(usage(
                "--background transparent: only surfel render writes pictures with alpha; give a color",
            )),
        }
    }

    /// Tells whether pictures have alpha.
    pub(crate) fn is_transparent(&self) -> bool {
        self.background == BackgroundChoice::Transparent
    }
}

fn parse_background(text: &str) -> Result<BackgroundChoice, String> {
    let expected = "expected black, white, gray, #rrggbb, R,G,B with 0 to 255, two names with a comma between, gradient, or transparent";
    match text {
        "gradient" => {
            let [top, bottom] = USUAL_GRADIENT.map(|color| color.map(|c| f32::from(c) / 255.0));
            return Ok(BackgroundChoice::Gradient(top, bottom));
        }
        "transparent" => return Ok(BackgroundChoice::Transparent),
        _ => {}
    }
    if let Ok(color) = parse_color(text) {
        return Ok(BackgroundChoice::Flat(color));
    }
    let colors = text.split_once(',').and_then(|(top, bottom)| {
        let color = |text: &str| parse_color(text.trim()).ok();
        Some(BackgroundChoice::Gradient(color(top)?, color(bottom)?))
    });
    colors.ok_or_else(|| expected.into())
}

pub(crate) fn parse_color(text: &str) -> Result<[f32; 3], String> {
    let bytes: Option<Vec<u8>> = match text {
        "black" => Some(vec![0; 3]),
        "white" => Some(vec![255; 3]),
        "gray" | "grey" => Some(vec![128; 3]),
        _ => match text.strip_prefix('#') {
            Some(hex) if hex.len() == 6 && hex.is_ascii() => (0..3)
                .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).ok())
                .collect(),
            Some(_) => None,
            None => text.split(',').map(|p| p.trim().parse().ok()).collect(),
        },
    };
    match bytes.as_deref() {
        Some(&[r, g, b]) => Ok([r, g, b].map(|c| f32::from(c) / 255.0)),
        _ => Err("expected black, white, gray, #rrggbb or R,G,B with 0 to 255".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_gradients_and_nothing_are_told_apart() {
        let of = |text: &str| parse_background(text).ok();
        let (black, white) = ([0.0; 3], [1.0; 3]);
        assert_eq!(of("black"), Some(BackgroundChoice::Flat(black)));
        assert_eq!(of("255,255,255"), Some(BackgroundChoice::Flat(white)));
        let gradient = Some(BackgroundChoice::Gradient(white, black));
        assert_eq!(of("white,black"), gradient);
        assert_eq!(of("#ffffff, #000000"), gradient);
        assert_eq!(of("transparent"), Some(BackgroundChoice::Transparent));
        assert!(matches!(
            of("gradient"),
            Some(BackgroundChoice::Gradient(..))
        ));
        for wrong in [
            "",
            ",",
            "white,",
            "1,2",
            "white,black,gray",
            "256,0,0",
            "clear",
        ] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn colors_are_read_as_documented() {
        assert_eq!(parse_color("#ff0080"), Ok([1.0, 0.0, 128.0 / 255.0]));
        assert_eq!(parse_color("0,255,0"), Ok([0.0, 1.0, 0.0]));
        assert!(
            parse_color("#ff00").is_err()
                && parse_color("256,0,0").is_err()
                && parse_color("pink").is_err()
        );
    }
}
