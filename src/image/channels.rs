//! All channels of a picture file, and how two files differ in each.

use super::Error;
use super::read::{checked_exr, decode_png, read_by_kind};
use crate::math::camera::MAX_SIDE;
use exr::prelude as openexr;
use openexr::{ReadChannels, ReadLayers};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// A channel of a picture file: red, alpha, depth, whatever it is called.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureChannel {
    /// Name of the channel; with the name of its layer and a dot before it where that is not the first.
    pub name: String,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major values; fewer than pixels where the channel is subsampled.
    pub values: Vec<f32>,
}

/// All channels of a picture file. Gray counts as red, green and blue.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PictureChannels {
    /// The channels, in the order of the file.
    pub channels: Vec<PictureChannel>,
    /// What could not be read, in words.
    pub left_out: Vec<String>,
}

impl PictureChannels {
    /// Reads all channels of a PNG or EXR file: of every layer the largest level.
    ///
    /// # Errors
    /// [`Error::Read`] as [`FloatImage::load`](super::FloatImage::load), but for an EXR file without colors and depth.
    pub fn load(path: &Path) -> Result<Self, Error> {
        read_by_kind(path, png_channels, exr_channels)
    }

    /// The channel of a name.
    pub fn find(&self, name: &str) -> Option<&PictureChannel> {
        self.channels.iter().find(|channel| channel.name == name)
    }

    /// Tells whether there is red, green or blue.
    pub fn has_colors(&self) -> bool {
        ["R", "G", "B"].iter().any(|name| self.find(name).is_some())
    }
}

fn png_channels(reader: BufReader<File>) -> Result<PictureChannels, String> {
    let picture = decode_png(reader)?;
    let has_alpha = picture.color().has_alpha();
    let picture = picture.into_rgba32f();
    let names = ["R", "G", "B", "A"];
    let channel = |index: usize| PictureChannel {
        name: names[index].to_owned(),
        width: picture.width() as usize,
        height: picture.height() as usize,
        values: picture.pixels().map(|p| p.0[index]).collect(),
    };
    Ok(PictureChannels {
        channels: (0..if has_alpha { 4 } else { 3 }).map(channel).collect(),
        left_out: Vec::new(),
    })
}

fn exr_channels(reader: BufReader<File>) -> Result<PictureChannels, String> {
    let mut data = Vec::new();
    let mut reader = checked_exr(reader)?;
    reader.read_to_end(&mut data).map_err(|e| e.to_string())?;
    let mut found = PictureChannels::default();
    let all = openexr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(io::Cursor::new(&data));
    let layers: Vec<_> = match all {
        Ok(picture) => picture.layer_data.into_iter().collect(),
        // A layer that cannot be read does not hide the first that can.
        Err(_) => {
            found.left_out.push("another layer".to_owned());
            let picture = openexr::read()
                .no_deep_data()
                .largest_resolution_level()
                .all_channels()
                .first_valid_layer()
                .all_attributes()
                .from_buffered(io::Cursor::new(&data));
            vec![picture.map_err(|e| e.to_string())?.layer_data]
        }
    };
    let largest = MAX_SIDE as usize;
    for (index, layer) in layers.into_iter().enumerate() {
        let (width, height) = (layer.size.x(), layer.size.y());
        if width > largest || height > largest {
            return Err(format!(
                "it has {width} x {height} pixels; each side may have {largest}"
            ));
        }
        let prefix = match (index, &layer.attributes.layer_name) {
            (0, _) => String::new(),
            (_, Some(name)) => format!("{name}."),
            (index, None) => format!("layer {}.", index + 1),
        };
        let list = layer.channel_data.list;
        let has = |name: &str| list.iter().any(|channel| channel.name.eq(name));
        let is_gray = has("Y") && !["R", "G", "B"].into_iter().any(has);
        for channel in &list {
            let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
            let name = channel.name.to_string();
            let names: &[&str] = if is_gray && name == "Y" {
                &["R", "G", "B"]
            } else {
                &[&name]
            };
            found
                .channels
                .extend(names.iter().map(|name| PictureChannel {
                    name: format!("{prefix}{name}"),
                    width,
                    height,
                    values: values.clone(),
                }));
        }
    }
    Ok(found)
}

/// How two files differ in one channel.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelDifference {
    /// The channel.
    pub name: String,
    /// Values looked at.
    pub values: u64,
    /// Values that differ at all.
    pub differing: u64,
    /// Values of which only one is finite, or that are different infinities.
    pub unmatched: u64,
    /// Mean absolute difference of those that are finite in both.
    pub mean_abs: f64,
    /// Largest absolute difference of those that are finite in both.
    pub largest: f64,
}

/// How two files differ in all of their channels.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct ChannelComparison {
    /// The channels that both have. Alpha that one lacks is 1 there.
    pub channels: Vec<ChannelDifference>,
    /// What was not compared, in words.
    pub not_compared: Vec<String>,
}

impl ChannelComparison {
    /// Tells whether everything in both files was compared and is equal.
    pub fn is_equal(&self) -> bool {
        self.not_compared.is_empty() && self.channels.iter().all(|channel| channel.differing == 0)
    }
}

/// Compares all channels of two files; `names` are theirs, for what cannot be compared.
pub fn compare_channels(files: [&PictureChannels; 2], names: [&str; 2]) -> ChannelComparison {
    let mut found = ChannelComparison::default();
    let [reference, other] = files;
    for channel in &reference.channels {
        match other.find(&channel.name) {
            Some(second) if has_shape_of(channel, second) => {
                let difference = differences(&channel.name, &channel.values, &second.values);
                found.channels.push(difference);
            }
            Some(_) => {
                let text = format!("{} has another size in each file", channel.name);
                found.not_compared.push(text);
            }
            None => found.only_in_one(channel, names[0]),
        }
    }
    for channel in &other.channels {
        if reference.find(&channel.name).is_none() {
            found.only_in_one(channel, names[1]);
        }
    }
    for (file, name) in files.into_iter().zip(names) {
        let words = file.left_out.iter().map(|what| format!("{what} of {name}"));
        found.not_compared.extend(words);
    }
    found
}

fn has_shape_of(first: &PictureChannel, second: &PictureChannel) -> bool {
    let shape = |channel: &PictureChannel| (channel.width, channel.height, channel.values.len());
    shape(first) == shape(second)
}

impl ChannelComparison {
    fn only_in_one(&mut self, channel: &PictureChannel, file: &str) {
        if channel.name == "A" {
            let opaque = vec![1.0; channel.values.len()];
            self.channels
                .push(differences("A", &channel.values, &opaque));
        } else {
            self.not_compared
                .push(format!("{} is only in {file}", channel.name));
        }
    }
}

fn differences(name: &str, first: &[f32], second: &[f32]) -> ChannelDifference {
    let mut found = ChannelDifference {
        name: name.to_owned(),
        values: first.len() as u64,
        differing: 0,
        unmatched: 0,
        mean_abs: 0.0,
        largest: 0.0,
    };
    let mut finite = 0_u64;
    for (&a, &b) in first.iter().zip(second) {
        if a.is_finite() && b.is_finite() {
            let difference = (f64::from(b) - f64::from(a)).abs();
            finite += 1;
            found.differing += u64::from(difference > 0.0);
            found.mean_abs += difference;
            found.largest = found.largest.max(difference);
        } else if !(a == b || (a.is_nan() && b.is_nan())) {
            found.differing += 1;
            found.unmatched += 1;
        }
    }
    found.mean_abs /= finite.max(1) as f64;
    found
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::image::{FloatImage, Image};

    fn image() -> Image {
        let mut image = Image::filled(4, 3, [10, 20, 30, 255]);
        image.depth = (0..12).map(|i| 1.0 + i as f32).collect();
        image.depth[3] = f32::INFINITY;
        image.normal = vec![[0.0, 0.0, 1.0]; 12];
        image
    }

    #[test]
    fn depth_normals_and_alpha_are_compared() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let compared = |a: &str, b: &str| {
            let [first, second] = [a, b].map(|name| PictureChannels::load(&at(name)).unwrap());
            compare_channels([&first, &second], [a, b])
        };
        let mut other = image();
        other.depth[5] += 0.5;
        other.depth[3] = 7.0;
        other.color[7][3] = 0;
        other.normal[1] = [0.0, 1.0, 0.0];
        image().save_depth_exr(&at("a.exr")).unwrap();
        other.save_depth_exr(&at("b.exr")).unwrap();
        assert!(compared("a.exr", "a.exr").is_equal());
        let found = compared("a.exr", "b.exr");
        assert!(!found.is_equal() && found.not_compared.is_empty());
        let depth = &found.channels[0];
        assert_eq!((&depth.name[..], depth.values), ("Z", 12));
        assert_eq!(
            (depth.differing, depth.unmatched, depth.largest),
            (2, 1, 0.5)
        );
        assert!((depth.mean_abs - 0.5 / 11.0).abs() < 1e-9);

        other.save_normal_exr(&at("n.exr")).unwrap();
        image().save_normal_exr(&at("m.exr")).unwrap();
        let found = compared("m.exr", "n.exr");
        let differing: Vec<u64> = found.channels.iter().map(|c| c.differing).collect();
        assert_eq!(differing, [0, 1, 1]);
        // Nothing in common is not equal.
        let found = compared("a.exr", "n.exr");
        assert!(found.channels.is_empty() && !found.is_equal());
        assert_eq!(found.not_compared[0], "Z is only in a.exr");
        assert_eq!(found.not_compared.len(), 4);

        image().save_png(&at("opaque.png")).unwrap();
        other.save_png_with_coverage(&at("alpha.png")).unwrap();
        for (a, b) in [("opaque.png", "alpha.png"), ("alpha.png", "opaque.png")] {
            let found = compared(a, b);
            let alpha = found.channels.iter().find(|c| c.name == "A").unwrap();
            assert_eq!((alpha.differing, alpha.largest), (1, 1.0));
            assert!(!found.is_equal() && found.not_compared.is_empty());
        }
        let float: FloatImage = image().to_float();
        float.save_exr(&at("float.exr")).unwrap();
        assert!(
            PictureChannels::load(&at("float.exr"))
                .unwrap()
                .has_colors()
        );
        assert!(!PictureChannels::load(&at("a.exr")).unwrap().has_colors());
    }
}
