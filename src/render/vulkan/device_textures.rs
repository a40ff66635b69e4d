//! Images of a model on the device: all of them in one buffer, which shaders sample themselves (`shaders/common/texels.glsl`).
//!
//! No image is too large for that, nor are there too many of them: only the bytes of all together are limited. Beyond, images
//! lose their largest sizes.

use crate::gpu::buffer::{BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::textures::{TextureImage, TexturePoint, WrapMode};
use crate::tree::Model;
use std::sync::Arc;

/// Words of the record of an image, and of a level.
const WORDS_OF_IMAGE: usize = 3;
const WORDS_OF_LEVEL: usize = 3;

/// Where the vertices of a page are in images.
#[derive(Debug)]
pub(crate) struct PageTextures {
    /// Of each vertex of the page three words: its place, two floats, and its image.
    pub(crate) points: DeviceBuffer,
    /// The images of its model.
    pub(crate) texels: Arc<DeviceBuffer>,
}

impl PageTextures {
    /// Textures of vertices at these points; nowhere where a model has no textures.
    ///
    /// # Errors
    /// When device memory runs out.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        points: impl Iterator<Item = TexturePoint>,
        texels: &Arc<DeviceBuffer>,
    ) -> Result<Self, Error> {
        let mut words: Vec<[u32; 3]> = points.map(TexturePoint::bits).collect();
        if words.is_empty() {
            words.push(TexturePoint::NOWHERE.bits());
        }
        let bytes = bytemuck::cast_slice(&words);
        let usage = BufferUsage::Storage;
        Ok(Self {
            points: DeviceBuffer::with_data(gpu, "places in images", usage, bytes)?,
            texels: texels.clone(),
        })
    }
}

/// Copies the images of a model to the device, with sizes as far as one binding holds them; four bytes of a model without.
///
/// # Errors
/// When device memory runs out.
pub(crate) fn upload(gpu: &Arc<Gpu>, model: &Model) -> Result<Arc<DeviceBuffer>, Error> {
    let info = gpu.info();
    let limit = (info.max_storage_range.min(info.max_buffer)).min(info.max_allocation);
    let images = model.textures.as_ref().map_or(&[][..], |own| &own.images);
    let words = words_of(images, limit / 4);
    let bytes = bytemuck::cast_slice(&words);
    let buffer = DeviceBuffer::with_data(gpu, "texels", BufferUsage::Storage, bytes)?;
    Ok(Arc::new(buffer))
}

/// Words of the levels of an image from one on.
fn texels_from(image: &TextureImage, first: usize) -> u64 {
    let levels = image.levels()[first..].iter();
    levels.map(|level| level.texels().len() as u64).sum()
}

/// What shaders read of some images, at most so many words: the largest levels are left out until the rest fits.
fn words_of(images: &[Arc<TextureImage>], limit: u64) -> Vec<u32> {
    let mut firsts = vec![0; images.len()];
    let heads = |image: &Arc<TextureImage>| WORDS_OF_IMAGE + WORDS_OF_LEVEL * image.levels().len();
    let head: usize = images.iter().map(heads).sum();
    let mut total: u64 = images.iter().map(|image| texels_from(image, 0)).sum();
    while total + head as u64 > limit {
        let left = |&index: &usize| images[index].levels()[firsts[index]].texels().len();
        let Some(largest) = (0..images.len()).max_by_key(left).filter(|i| left(i) > 1) else {
            break;
        };
        total -= left(&largest) as u64;
        firsts[largest] += 1;
    }
    if firsts.iter().any(|&first| first > 0) {
        tracing::warn!(
            limit_mib = limit >> 18,
            "textures are drawn at a smaller size: the device binds no more"
        );
    }
    let mut records = Vec::with_capacity(WORDS_OF_IMAGE * images.len());
    let mut levels = Vec::new();
    let mut at = head as u32;
    let level_words = WORDS_OF_IMAGE * images.len();
    for (image, &first) in images.iter().zip(&firsts) {
        let kept = &image.levels()[first..];
        let [u, v] = image.wrap().map(|mode| match mode {
            WrapMode::Repeat => 0,
            WrapMode::Mirror => 1,
            WrapMode::Clamp => 2,
        });
        records.extend([
            kept.len() as u32,
            u | v << 2,
            (level_words + levels.len()) as u32,
        ]);
        for level in kept {
            levels.extend([at, level.width(), level.height()]);
            at += level.texels().len() as u32;
        }
    }
    let mut words = Vec::with_capacity(at as usize + 1);
    words.append(&mut records);
    words.append(&mut levels);
    words.resize(head, 0);
    for (image, &first) in images.iter().zip(&firsts) {
        for level in &image.levels()[first..] {
            words.extend_from_slice(bytemuck::cast_slice(level.texels()));
        }
    }
    if words.is_empty() {
        words.push(0);
    }
    words
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::textures::TextureLevel;

    #[test]
    fn records_lead_to_their_texels_whatever_fits() {
        let image = |side: u32, red: u8| {
            let texels = vec![[red, 0, 0, 255]; (side * side) as usize];
            let level = TextureLevel::new(side, side, texels).unwrap();
            let wrap = [WrapMode::Clamp, WrapMode::Mirror];
            Arc::new(TextureImage::new("a", [side; 2], wrap, level))
        };
        let images = [image(8, 10), image(4, 20)];
        let head = 2 * 3 + 3 * (4 + 3);
        for (limit, sides) in [(u64::MAX, [8, 4]), (head + 21 + 21, [4, 4]), (0, [1, 1])] {
            let words = words_of(&images, limit);
            assert!(words.len() as u64 <= limit.max(head + 2));
            for (index, (side, red)) in sides.into_iter().zip([10, 20]).enumerate() {
                let [count, wrap, first] = [0, 1, 2].map(|i| words[3 * index + i]);
                assert_eq!((count, wrap), (u32::ilog2(side) + 1, 2 | 1 << 2));
                for level in 0..count {
                    let own = (first + 3 * level) as usize;
                    let [at, width, height] = [words[own], words[own + 1], words[own + 2]];
                    assert_eq!([width, height], [side >> level; 2], "{limit}");
                    let texels = &words[at as usize..][..(width * height) as usize];
                    assert!(texels.iter().all(|&texel| texel == 0xff00_0000 | red));
                }
            }
        }
        assert_eq!(words_of(&[], 0), [0]);
    }
}
