//! Pictures out of files: PNG and OpenEXR, known by their first bytes. Sizes are held against the file before memory is
//! asked for.

use super::file::NORMAL_CHANNELS;
use super::{Error, FloatImage};
use crate::math::camera::MAX_SIDE;
use crate::textures::capacity::{EXR_PIXELS_A_BYTE, PNG_PIXELS_A_BYTE, can_hold};
use exr::prelude as openexr;
use openexr::{ReadChannels, ReadLayers};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

impl FloatImage {
    /// Reads a PNG or EXR file, told apart by their first bytes.
    ///
    /// PNG: integers over their largest value, no transfer function; grey counts for all three colors.
    /// EXR: the largest level of the first layer that is not deep; R, G, B or Y; Z as depth; N.X, N.Y, N.Z as
    /// normals. Without an alpha channel, coverage is 1 ([`cover_where_not`](Self::cover_where_not) helps); an
    /// EXR of depth alone is black and covered where the depth is finite.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read, is neither format, is damaged, or has a side above
    /// [`MAX_SIDE`].
    pub fn load(path: &Path) -> Result<Self, Error> {
        read_by_kind(path, read_png, read_exr)
    }
}

/// Reads a file by its first bytes.
pub(super) fn read_by_kind<T>(
    path: &Path,
    png: impl FnOnce(BufReader<File>) -> Result<T, String>,
    exr: impl FnOnce(BufReader<File>) -> Result<T, String>,
) -> Result<T, Error> {
    let fail = |cause: String| Error::Read {
        path: path.to_owned(),
        cause,
    };
    let mut file = File::open(path).map_err(|e| fail(e.to_string()))?;
    let mut magic = Vec::new();
    (&mut file)
        .take(4)
        .read_to_end(&mut magic)
        .and_then(|_| file.rewind())
        .map_err(|e| fail(e.to_string()))?;
    let reader = BufReader::new(file);
    match magic.as_slice() {
        [0x89, b'P', b'N', b'G'] => png(reader),
        [0x76, 0x2f, 0x31, 0x01] => exr(reader),
        _ => Err("it is neither a PNG nor an EXR file".into()),
    }
    .map_err(fail)
}

fn read_png(reader: BufReader<File>) -> Result<FloatImage, String> {
    let picture = decode_png(reader)?.into_rgba32f();
    Ok(FloatImage {
        width: picture.width(),
        height: picture.height(),
        color: picture.pixels().map(|p| p.0).collect(),
        ..FloatImage::default()
    })
}

/// Refuses a size that a file of so many bytes cannot have.
fn expect_room([width, height]: [u64; 2], pixels_a_byte: u64, file: &File) -> Result<(), String> {
    // What has no length, such as a pipe, may hold anything.
    let bytes = file.metadata().map_err(|e| e.to_string())?;
    if bytes.is_file() && !can_hold([width, height], pixels_a_byte, bytes.len()) {
        return Err(format!(
            "its header says {width} x {height} pixels, which {} bytes cannot hold",
            bytes.len()
        ));
    }
    Ok(())
}

/// The pixels of a PNG file.
pub(super) fn decode_png(reader: BufReader<File>) -> Result<::image::DynamicImage, String> {
    let file = reader.get_ref().try_clone().map_err(|e| e.to_string())?;
    let mut reader = ::image::ImageReader::with_format(reader, ::image::ImageFormat::Png);
    let mut limits = ::image::Limits::no_limits();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = ::image::ImageDecoder::dimensions(&decoder);
    expect_room([width, height].map(u64::from), PNG_PIXELS_A_BYTE, &file)?;
    ::image::DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())
}

/// The reader of an EXR file back at its beginning, once its header has a size that is read and that it can hold.
pub(super) fn checked_exr(mut reader: BufReader<File>) -> Result<BufReader<File>, String> {
    let header = exr::meta::MetaData::read_from_buffered(&mut reader, false);
    for header in header.map_err(|e| e.to_string())?.headers {
        let [width, height] = [header.layer_size.x(), header.layer_size.y()];
        let largest = MAX_SIDE as usize;
        if width > largest || height > largest {
            return Err(format!(
                "it has {width} x {height} pixels; each side may have {largest}"
            ));
        }
        let size = [width, height].map(|side| side as u64);
        expect_room(size, EXR_PIXELS_A_BYTE, reader.get_ref())?;
    }
    reader.rewind().map_err(|e| e.to_string())?;
    Ok(reader)
}

fn read_exr(reader: BufReader<File>) -> Result<FloatImage, String> {
    let reader = checked_exr(reader)?;
    let picture = openexr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(reader)
        .map_err(|e| e.to_string())?;
    let layer = picture.layer_data;
    let (width, height) = (layer.size.x(), layer.size.y());
    let largest = MAX_SIDE as usize;
    if width > largest || height > largest {
        return Err(format!(
            "it has {width} x {height} pixels; each side may have {largest}"
        ));
    }
    let channel = |name: &str| -> Option<Vec<f32>> {
        let channel = layer.channel_data.list.iter().find(|c| c.name.eq(name))?;
        let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
        // Subsampled channels have fewer.
        (values.len() == width * height).then_some(values)
    };
    let luminance = channel("Y");
    let color = ["R", "G", "B"].map(|name| channel(name).or_else(|| luminance.clone()));
    let depth = channel("Z");
    let normal = NORMAL_CHANNELS.map(channel);
    if color
        .iter()
        .chain([&depth])
        .chain(&normal)
        .all(Option::is_none)
    {
        return Err(
            "it has none of the channels R, G, B, Y, Z, N.X, N.Y, N.Z at full resolution".into(),
        );
    }
    let is_depth_alone = color.iter().all(Option::is_none);
    let alpha = channel("A").or_else(|| {
        depth.as_ref().filter(|_| is_depth_alone).map(|z| {
            z.iter()
                .map(|z| f32::from(u8::from(z.is_finite())))
                .collect()
        })
    });
    let at = |channel: &Option<Vec<f32>>, i: usize, otherwise: f32| {
        channel.as_ref().map_or(otherwise, |c| c[i])
    };
    let pixels = 0..width * height;
    Ok(FloatImage {
        width: width as u32,
        height: height as u32,
        color: pixels
            .clone()
            .map(|i| {
                let [r, g, b] = [0, 1, 2].map(|c: usize| at(&color[c], i, 0.0));
                [r, g, b, at(&alpha, i, 1.0)]
            })
            .collect(),
        normal: match &normal {
            [Some(x), Some(y), Some(z)] => pixels.map(|i| [x[i], y[i], z[i]]).collect(),
            _ => Vec::new(),
        },
        depth: depth.unwrap_or_default(),
    })
}
