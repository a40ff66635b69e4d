//! The options that place and color one of several models.

use super::background::parse_color;
use super::source::parse_box;
use super::{CommandFailure, usage};
use clap::Args;
use glam::DVec3;
use std::path::{Path, PathBuf};
use surfel::math::section_box::SectionBox;
use surfel::mesh::placement::{MeshPlacement, parse_transform};
use surfel::render::Settings;

/// Where models stand and what color they have, in the order of the models.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct PlacementArgs {
    /// Move a model: a file with 4 x 4 numbers, row by row, from its coordinates to those of the picture. The first --transform is of the first model, the second of the second; none leaves one where it is
    #[arg(long = "transform", value_name = "FILE|none")]
    transforms: Vec<PathBuf>,
    /// Color a model, as --background names colors; the first --model-color is of the first model; none leaves one its own
    #[arg(long = "model-color", value_name = "COLOR|none", value_parser = parse_model_color)]
    colors: Vec<ModelColor>,
    /// Draw only what touches this box, in the coordinates of the file: looks inside without reading or building anew
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = parse_box, allow_hyphen_values = true)]
    pub(crate) section: Option<[DVec3; 2]>,
}

/// The color of a model, or its own.
#[derive(Debug, Clone, Copy)]
struct ModelColor(Option<[u8; 3]>);

fn parse_model_color(text: &str) -> Result<ModelColor, String> {
    if text == "none" {
        return Ok(ModelColor(None));
    }
    let color = parse_color(text).map_err(|error| format!("{error}, or none"))?;
    Ok(ModelColor(Some(color.map(|c| (c * 255.0).round() as u8))))
}

impl PlacementArgs {
    /// Makes settings draw the section of the first model, which has this origin.
    pub(crate) fn set_section(&self, settings: &mut Settings, origin: DVec3) {
        settings.section = (self.section).map(|ends| SectionBox::of_file(ends, origin));
    }

    /// Reads the files: what is asked of each of so many models.
    ///
    /// # Errors
    /// When there are more options than models, or a file is no transform.
    pub(crate) fn of_models(&self, count: usize) -> Result<Vec<MeshPlacement>, CommandFailure> {
        for (option, given) in [
            ("--transform", self.transforms.len()),
            ("--model-color", self.colors.len()),
        ] {
            if given > count {
                return Err(usage(format!(
                    "{option} is given {given} times, for {count} model{}",
                    if count == 1 { "" } else { "s" }
                )));
            }
        }
        (0..count)
            .map(|index| {
                let file = self.transforms.get(index);
                let file = file.filter(|file| *file != Path::new("none"));
                let transform = file.map(|file| {
                    let text = std::fs::read_to_string(file).map_err(|e| e.to_string());
                    text.and_then(|text| parse_transform(&text))
                        .map_err(|e| usage(format!("--transform {}: {e}", file.display())))
                });
                Ok(MeshPlacement {
                    transform: transform.transpose()?,
                    color: self.colors.get(index).and_then(|color| color.0),
                })
            })
            .collect()
    }
}
