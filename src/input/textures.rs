//! Images that models name: PNG and JPEG, decoded in parallel within a budget of memory. One that cannot be read is a remark:
//! the mesh is drawn without it.

use std::borrow::Cow;
use std::io::{Cursor, Read};
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec2;
use image::{DynamicImage, ImageFormat, ImageReader};
use rayon::prelude::*;

use super::job::ReadJob;
use super::part::PartFate;
use super::points::guarded;
use super::text::shown;
use super::{Error, ReadWarning};
use crate::mesh::Mesh;
use crate::textures::capacity::{JPEG_PIXELS_A_BYTE, PNG_PIXELS_A_BYTE, can_hold};
use crate::textures::{MeshTextures, NO_IMAGE, TextureImage, TextureLevel, WrapMode};

/// Largest file of an image, bytes.
const LARGEST_FILE: u64 = 4 << 30;

/// Most memory that one image takes while it is decoded, bytes: 32,768 x 32,768 texels.
const LARGEST_DECODED: u64 = 4 << 30;

/// Images of more bytes than this are decoded one after the other.
const LARGE: u64 = 512 << 20;

/// Most different images of a file: a model made for harm could name millions.
const MOST_IMAGES: usize = 10_000;

/// Where the bytes of an image are.
#[derive(Debug, Clone)]
pub(super) enum ImageBytes {
    /// In a file of its own.
    File(PathBuf),
    /// In the model.
    Memory(Arc<[u8]>),
    /// Nowhere, and why.
    Missing(String),
}

/// What the texels are multiplied by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ImageTint {
    /// Values as they are stored.
    Stored([u8; 3]),
    /// Linear light, as glTF has it.
    Linear([f64; 3]),
}

/// An image that a model names.
#[derive(Debug, Clone)]
pub(super) struct ImageSource {
    pub(super) name: String,
    pub(super) bytes: ImageBytes,
    pub(super) wrap: [WrapMode; 2],
    pub(super) tint: Option<ImageTint>,
}

/// What a reader found: texture coordinates of the corners of all triangles, from the upper left of the image; and the image
/// of each triangle, or [`NO_IMAGE`]. Both lists may end early.
#[derive(Debug, Clone, Default)]
pub(super) struct RawTextures {
    pub(super) corners: Vec<[Vec2; 3]>,
    pub(super) image_of: Vec<u32>,
    pub(super) sources: Vec<ImageSource>,
}

impl RawTextures {
    /// Makes both lists as long as the triangles.
    pub(super) fn resize(&mut self, triangles: usize) {
        self.corners.resize(triangles, [Vec2::ZERO; 3]);
        self.image_of.resize(triangles, NO_IMAGE);
    }

    /// Keeps the triangles whose number `keep` accepts.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let mut lists = MeshTextures {
            corners: std::mem::take(&mut self.corners),
            image_of: std::mem::take(&mut self.image_of),
            images: Vec::new(),
        };
        lists.retain(keep);
        (self.corners, self.image_of) = (lists.corners, lists.image_of);
    }

    /// Gives corners their places again where faces of `before` were cut otherwise: `faces` calls back with each face's
    /// first triangle and number of triangles.
    pub(super) fn follow(
        &mut self,
        before: &[[u32; 3]],
        after: &[[u32; 3]],
        faces: impl Iterator<Item = (usize, usize)>,
    ) {
        for (first, count) in faces {
            let own = first..first + count;
            if own.end > self.corners.len() || before[own.clone()] == after[own.clone()] {
                continue;
            }
            let old = self.corners[own.clone()].to_vec();
            let known = || {
                let vertices = before[own.clone()].iter().flatten();
                vertices.zip(old.iter().flatten())
            };
            for index in own.clone() {
                for (corner, &vertex) in after[index].iter().enumerate() {
                    let place = known().find(|known| *known.0 == vertex);
                    if let Some((_, &place)) = place {
                        self.corners[index][corner] = place;
                    }
                }
            }
        }
    }

    /// Decodes the images that triangles have, and joins all to the mesh, whose triangles they are of.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(super) fn join(mut self, job: &mut ReadJob<'_>, mesh: &mut Mesh) -> Result<(), Error> {
        self.resize(mesh.triangles.len());
        self.sources.truncate(MOST_IMAGES);
        let mut counts = vec![0_u64; self.sources.len()];
        for image in &mut self.image_of {
            match counts.get_mut(*image as usize) {
                Some(count) => *count += 1,
                None => *image = NO_IMAGE,
            }
        }
        let used: Vec<Option<&ImageSource>> = (self.sources.iter().zip(&counts))
            .map(|(source, &count)| (count > 0).then_some(source))
            .collect();
        let decoded = decode_all(job, &used);
        if job.progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        let mut images = Vec::new();
        let mut number_of = vec![NO_IMAGE; self.sources.len()];
        let mut missing = Vec::new();
        for (index, (source, decoded)) in self.sources.iter().zip(decoded).enumerate() {
            let name = format!("texture {}", shown(source.name.as_bytes()));
            match decoded {
                None => job
                    .inventory
                    .add(name, 0, PartFate::Unneeded, "no triangle has it"),
                Some(Ok(image)) => {
                    let [width, height] = image.file_size();
                    let mut note = format!("triangles; {width} x {height} texels");
                    if image.size() != image.file_size() {
                        let [width, height] = image.size();
                        note += &format!(", kept at {width} x {height}");
                    }
                    job.inventory.add(name, counts[index], PartFate::Used, note);
                    number_of[index] = images.len() as u32;
                    images.push(Arc::new(image));
                }
                Some(Err(reason)) => {
                    job.inventory
                        .add(name, counts[index], PartFate::LeftOut, reason.clone());
                    missing.push((source.name.clone(), reason));
                }
            }
        }
        if let Some((name, reason)) = missing.first() {
            job.warn(ReadWarning::TextureMissing {
                name: shown(name.as_bytes()),
                reason: reason.clone(),
                others: missing.len() as u64 - 1,
            });
        }
        let reduced = images
            .iter()
            .filter(|image| image.size() != image.file_size());
        let count = reduced.count() as u64;
        job.warn_count(count, |count| ReadWarning::TexturesReduced {
            count,
            budget: job.options.limits.texture_bytes,
        });
        if images.is_empty() {
            return Ok(());
        }
        for image in &mut self.image_of {
            *image = number_of.get(*image as usize).copied().unwrap_or(NO_IMAGE);
        }
        mesh.textures = Some(MeshTextures {
            images,
            corners: self.corners,
            image_of: self.image_of,
        });
        Ok(())
    }
}

/// Image by image what was decoded, or why not; none of those that nobody needs.
fn decode_all(
    job: &ReadJob<'_>,
    sources: &[Option<&ImageSource>],
) -> Vec<Option<Result<TextureImage, String>>> {
    let opened: Vec<Option<Result<OpenedImage<'_>, String>>> = sources
        .iter()
        .map(|source| source.map(|source| OpenedImage::of(source, job.options.limits.file_bytes)))
        .collect();
    let mut sizes: Vec<[u32; 2]> = opened
        .iter()
        .map(|opened| match opened {
            Some(Ok(opened)) => opened.size,
            _ => [0; 2],
        })
        .collect();
    fit(&mut sizes, job.options.limits.texture_bytes);
    let progress = job.progress;
    let decode = |(opened, &size): (Option<Result<OpenedImage<'_>, String>>, &[u32; 2])| {
        opened.map(|opened| match opened {
            _ if progress.is_cancelled() => Err("cancelled".to_owned()),
            Ok(opened) => opened.decode(size),
            Err(reason) => Err(reason),
        })
    };
    let is_large = |opened: &Option<Result<OpenedImage<'_>, String>>| matches!(opened, Some(Ok(opened)) if opened.decoded_bytes() > LARGE);
    // Large ones use all threads for their smaller sizes, and would be too much together.
    if opened.iter().any(is_large) {
        opened.into_iter().zip(&sizes).map(decode).collect()
    } else {
        opened.into_par_iter().zip(&sizes).map(decode).collect()
    }
}

/// Halves the largest sizes until all images with their smaller sizes take at most so many bytes.
fn fit(sizes: &mut [[u32; 2]], budget: u64) {
    let bytes = |mut size: [u32; 2]| {
        let mut sum = 0;
        loop {
            sum += 4 * u64::from(size[0]) * u64::from(size[1]);
            if size.iter().all(|&side| side <= 1) {
                return sum;
            }
            size = size.map(|side| (side / 2).max(1));
        }
    };
    let mut total: u64 = sizes.iter().map(|&size| bytes(size)).sum();
    while total > budget {
        let Some(largest) = sizes.iter_mut().max_by_key(|size| bytes(**size)) else {
            return;
        };
        if largest.iter().all(|&side| side <= 1) {
            return;
        }
        let before = bytes(*largest);
        *largest = largest.map(|side| (side / 2).max(side.min(1)));
        total -= before - bytes(*largest);
    }
}

/// An image whose size is known.
struct OpenedImage<'a> {
    source: &'a ImageSource,
    bytes: Cow<'a, [u8]>,
    format: ImageFormat,
    size: [u32; 2],
}

impl<'a> OpenedImage<'a> {
    fn of(source: &'a ImageSource, largest_file: u64) -> Result<Self, String> {
        let bytes: Cow<'a, [u8]> = match &source.bytes {
            ImageBytes::Memory(bytes) => Cow::Borrowed(bytes),
            ImageBytes::Missing(reason) => return Err(reason.clone()),
            ImageBytes::File(path) => {
                let metadata = std::fs::metadata(path).map_err(|error| error.to_string())?;
                // A model must not make us wait for a pipe or a device.
                if !metadata.is_file() {
                    return Err("not a file".to_owned());
                }
                let limit = LARGEST_FILE.min(largest_file);
                if metadata.len() > limit {
                    return Err(format!(
                        "{} bytes; at most {limit} are read",
                        metadata.len()
                    ));
                }
                let file = std::fs::File::open(path).map_err(|error| error.to_string())?;
                let mut bytes = Vec::new();
                file.take(limit)
                    .read_to_end(&mut bytes)
                    .map_err(|error| error.to_string())?;
                Cow::Owned(bytes)
            }
        };
        let format = format_of(&bytes)?;
        let size = guarded(|| {
            let reader = ImageReader::with_format(Cursor::new(&*bytes), format);
            reader.into_dimensions().map_err(|error| error.to_string())
        })?;
        let opened = Self {
            source,
            bytes,
            format,
            size: size.into(),
        };
        let [width, height] = opened.size;
        let pixels_a_byte = match format {
            ImageFormat::Png => PNG_PIXELS_A_BYTE,
            _ => JPEG_PIXELS_A_BYTE,
        };
        let length = opened.bytes.len() as u64;
        if !can_hold(opened.size.map(u64::from), pixels_a_byte, length) {
            return Err(format!(
                "{width} x {height} texels, which {length} bytes cannot hold"
            ));
        }
        if opened.decoded_bytes() > LARGEST_DECODED || opened.decoded_bytes() == 0 {
            return Err(format!(
                "{width} x {height} texels; at most {} are decoded at once",
                LARGEST_DECODED / 4
            ));
        }
        Ok(opened)
    }

    /// Bytes of its texels.
    fn decoded_bytes(&self) -> u64 {
        let [width, height] = self.size.map(u64::from);
        4 * width * height
    }

    /// Decodes it, and makes it smaller until it has at most a size.
    fn decode(self, wanted: [u32; 2]) -> Result<TextureImage, String> {
        let [width, height] = self.size;
        let texels = guarded(|| {
            let mut reader = ImageReader::with_format(Cursor::new(&*self.bytes), self.format);
            let mut limits = image::Limits::default();
            limits.max_alloc = Some(4 * LARGEST_DECODED);
            reader.limits(limits);
            let decoded = reader.decode().map_err(|error| error.to_string())?;
            let texels: Vec<[u8; 4]> = match decoded {
                DynamicImage::ImageRgb8(image) => {
                    let (rows, _) = image.as_raw().as_chunks::<3>();
                    rows.iter().map(|&[r, g, b]| [r, g, b, 255]).collect()
                }
                other => {
                    let image = other.into_rgba8();
                    let (rows, _) = image.as_raw().as_chunks::<4>();
                    rows.iter().map(|&[r, g, b, _]| [r, g, b, 255]).collect()
                }
            };
            Ok(texels)
        })?;
        let level = TextureLevel::new(width, height, texels);
        let mut level = level.ok_or_else(|| "it ends early".to_owned())?;
        while level.width() > wanted[0].max(1) || level.height() > wanted[1].max(1) {
            let Some(smaller) = level.halved() else { break };
            level = smaller;
        }
        if let Some(tint) = self.source.tint {
            let table = tint.table();
            level.map(|[r, g, b, a]| {
                [
                    table[0][r as usize],
                    table[1][g as usize],
                    table[2][b as usize],
                    a,
                ]
            });
        }
        let (name, wrap) = (self.source.name.clone(), self.source.wrap);
        Ok(TextureImage::new(name, self.size, wrap, level))
    }
}

impl ImageTint {
    /// What each value of each channel becomes.
    fn table(self) -> [[u8; 256]; 3] {
        let linear = |value: f64| match value {
            // IEC 61966-2-1.
            v if v <= 0.040_45 => v / 12.92,
            v => ((v + 0.055) / 1.055).powf(2.4),
        };
        [0, 1, 2].map(|channel: usize| {
            std::array::from_fn(|value| {
                let stored = value as f64 / 255.0;
                match self {
                    Self::Stored(factor) => (f64::from(factor[channel]) * stored).round() as u8,
                    Self::Linear(factor) => {
                        super::color::encoded_byte(linear(stored) * factor[channel])
                    }
                }
            })
        })
    }
}

/// The format of an image by its first bytes.
fn format_of(bytes: &[u8]) -> Result<ImageFormat, String> {
    let refuse =
        |name: &str, help: &str| Err(format!("a {name} image; PNG and JPEG are read{help}"));
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Ok(ImageFormat::Png),
        [0xff, 0xd8, 0xff, ..] => Ok(ImageFormat::Jpeg),
        [0xab, b'K', b'T', b'X', ..] => refuse(
            "KTX2",
            " (`gltf-transform ktxdecompress IN.glb OUT.glb` unpacks it)",
        ),
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => refuse("WebP", ""),
        [b'B', b'M', ..] => refuse("BMP", ""),
        [b'I', b'I', b'*', 0, ..] | [b'M', b'M', 0, b'*', ..] => refuse("TIFF", ""),
        [b'D', b'D', b'S', b' ', ..] => refuse("DDS", ""),
        [b'G', b'I', b'F', b'8', ..] => refuse("GIF", ""),
        [] => Err("the file is empty".to_owned()),
        _ => Err("neither a PNG nor a JPEG image".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn source(bytes: Vec<u8>) -> ImageSource {
        ImageSource {
            name: "a.png".to_owned(),
            bytes: ImageBytes::Memory(bytes.into()),
            wrap: [WrapMode::Repeat; 2],
            tint: None,
        }
    }

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let picture =
            image::RgbImage::from_fn(33, 20, |x, y| image::Rgb([x as u8 * 7, y as u8 * 9, 50]));
        let mut out = Cursor::new(Vec::new());
        DynamicImage::ImageRgb8(picture)
            .write_to(&mut out, format)
            .unwrap();
        out.into_inner()
    }

    fn decoded(bytes: Vec<u8>) -> Result<TextureImage, String> {
        let source = source(bytes);
        let opened = OpenedImage::of(&source, u64::MAX)?;
        let size = opened.size;
        opened.decode(size)
    }

    #[test]
    fn damaged_images_are_words_and_never_panics() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let whole = encoded(format);
            assert_eq!(decoded(whole.clone()).unwrap().size(), [33, 20]);
            for length in 0..whole.len().min(400) {
                // A decoder may make do with most of an image.
                if let Ok(image) = decoded(whole[..length].to_vec()) {
                    assert_eq!(image.size(), [33, 20], "{length}");
                }
            }
            for at in 0..whole.len().min(300) {
                let mut bytes = whole.clone();
                bytes[at] ^= 0xff;
                if let Ok(image) = decoded(bytes) {
                    assert!(image.bytes() < LARGEST_DECODED);
                }
            }
            assert!(decoded(whole[..8].to_vec()).is_err());
        }
        for other in [
            &b"\xabKTX 20\xbb"[..],
            b"BM....",
            b"",
            b"abc",
            b"RIFF....WEBPVP8 ",
        ] {
            assert!(decoded(other.to_vec()).is_err());
        }
        let ktx = decoded(b"\xabKTX 20\xbb".to_vec()).unwrap_err();
        assert!(
            ktx.contains("KTX2") && ktx.contains("gltf-transform"),
            "{ktx}"
        );
    }

    #[test]
    fn an_image_that_claims_to_be_huge_is_refused_before_it_is_decoded() {
        let mut bytes = encoded(ImageFormat::Png);
        bytes[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
        // The check sum of the header, which a reader may look at first.
        let reason = decoded(bytes).unwrap_err();
        assert!(!reason.is_empty());
    }

    #[test]
    fn sizes_are_halved_until_they_fit() {
        let mut sizes = [[4096, 4096], [1024, 512], [0, 0]];
        fit(&mut sizes, u64::MAX);
        assert_eq!(sizes, [[4096, 4096], [1024, 512], [0, 0]]);
        fit(&mut sizes, 10 << 20);
        assert_eq!(sizes, [[1024, 1024], [1024, 512], [0, 0]]);
        fit(&mut sizes, 0);
        assert_eq!(sizes, [[1, 1], [1, 1], [0, 0]]);
    }

    #[test]
    fn tints_multiply_stored_values_or_light() {
        let stored = ImageTint::Stored([255, 128, 0]).table();
        assert_eq!(
            [stored[0][200], stored[1][200], stored[2][200]],
            [200, 100, 0]
        );
        let linear = ImageTint::Linear([1.0, 0.25, 0.0]).table();
        assert_eq!(
            [linear[0][200], linear[1][255], linear[2][200]],
            [200, 137, 0]
        );
    }

    #[test]
    fn places_follow_faces_that_are_cut_otherwise() {
        let place = |v: u32| Vec2::splat(v as f32);
        let before = [[9, 8, 7], [0, 1, 2], [0, 2, 3]];
        let after = [[9, 8, 7], [1, 2, 3], [1, 3, 0]];
        let mut raw = RawTextures {
            corners: before.map(|corners| corners.map(place)).to_vec(),
            ..RawTextures::default()
        };
        raw.follow(&before, &after, [(1, 2)].into_iter());
        assert_eq!(
            raw.corners,
            after.map(|corners| corners.map(place)).to_vec()
        );
    }
}
