//! Pixels and depth maps of photographs in one buffer of the device. What is to be drawn is copied there, a part a frame where
//! frames may not take long; what was copied never changes while a frame may read it.
//!
//! Of the pixels of a photograph there are first words with where each level begins, then the levels, the largest first: red,
//! green, blue and mask, a byte each. They are copied from the smallest level to the largest. A texel of a depth map is the
//! depth without its lowest eight bits (2^-16 of it, far below the bias of visibility); these are the distance from an edge,
//! 255 of [`EDGE_TEXELS`].

use crate::gpu::buffer::{AnyBuffer, BufferUsage, DeviceBuffer};
use crate::gpu::{Error, Gpu};
use crate::projective::depth_map::{EDGE_TEXELS, PhotoDepth};
use crate::projective::frame_photos::{ChosenPhoto, FramePhotos, MOST_PHOTOS};
use crate::projective::pyramid::{PhotoPixels, PhotoPyramid};
use std::sync::Arc;

/// Words of a table of levels: no photograph has more.
const TABLE_WORDS: u32 = 32;

/// Parts are multiples of so many words.
const BLOCK_WORDS: u64 = 64;

/// Frames after which nothing reads what was given up any more.
const FRAMES_IN_FLIGHT: u64 = 4;

/// Words of a texel row that are made at a time.
const ROWS_AT_ONCE: u32 = 64;

/// Where the pixels of a photograph lie, as shaders read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PixelsPlace {
    /// Word of the table of levels.
    pub(crate) table: u32,
    /// Width and height of the first level, which may not be there.
    pub(crate) size: [u32; 2],
    /// The largest level that is there.
    pub(crate) first: u32,
    /// Levels.
    pub(crate) count: u32,
    /// Texels have a mask.
    pub(crate) has_mask: bool,
}

/// Where a depth map lies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct MapPlace {
    /// First word of the map.
    pub(crate) first: u32,
    /// Width and height; zeros without a map.
    pub(crate) size: [u32; 2],
}

/// A part of the buffer, words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct WordRange {
    first: u32,
    count: u32,
}

/// Pixels that are there or on their way.
#[derive(Debug)]
struct HeldPixels {
    pixels: Arc<PhotoPyramid>,
    mask: Option<Arc<PhotoPyramid>>,
    range: WordRange,
    /// The largest level that has room.
    largest: usize,
    /// The largest level that is copied whole; the number of levels: none.
    whole: usize,
    /// Rows of the next level that are copied.
    rows: u32,
}

/// A depth map that is there.
#[derive(Debug)]
struct HeldMap {
    map: Arc<PhotoDepth>,
    range: WordRange,
}

/// What is held of a photograph.
#[derive(Debug, Default)]
struct HeldPhoto {
    /// What frames read.
    shown: Option<HeldPixels>,
    /// What they will once it is whole.
    coming: Option<HeldPixels>,
    map: Option<HeldMap>,
    /// The last frame that had it.
    used: u64,
}

/// Memory of the device for photographs.
#[derive(Debug)]
pub struct PhotoPool {
    buffer: DeviceBuffer,
    capacity: u64,
    /// Words of each photograph of the frame at most, so that none is sharp at the cost of others.
    share: u64,
    /// Parts that nobody uses, in order.
    free: Vec<WordRange>,
    /// Parts that frames up to one may still read.
    retired: Vec<(u64, WordRange)>,
    /// By the index in the scene.
    held: Vec<HeldPhoto>,
    frame: u64,
    /// Bytes that a frame copies at most; none: all of it, and frames are waited for before the next.
    budget_bytes: Option<u64>,
    /// Texels are still to be copied.
    is_behind: bool,
}

/// Places of the photographs of a frame: of each its depth map and pixels, `None` where nothing of it is there yet.
pub(crate) type PhotoPlaces = Vec<Option<(MapPlace, PixelsPlace)>>;

impl PhotoPool {
    /// Words that all photographs of a frame take.
    pub fn words_of(photos: &FramePhotos) -> u64 {
        let of = |chosen: &ChosenPhoto| {
            let texels = chosen
                .pixels
                .levels
                .iter()
                .map(|level| level.rgb.len() as u64);
            u64::from(TABLE_WORDS) + texels.sum::<u64>() + chosen.depth.depth.len() as u64
        };
        photos.photos.iter().map(of).sum()
    }

    /// Memory for so many words, or as many as one binding holds. With `budget_bytes` a frame copies so many bytes at most, and
    /// photographs get sharper from frame to frame; without, the frame before must have finished.
    ///
    /// # Errors
    /// When device memory runs out.
    pub fn new(gpu: &Arc<Gpu>, words: u64, budget_bytes: Option<u64>) -> Result<Self, Error> {
        let info = gpu.info();
        let limit = (info.max_storage_range.min(info.max_buffer)).min(info.max_allocation);
        let most = (limit / 4).min(u64::from(u32::MAX / 4));
        // Parts are whole blocks.
        let words = (words + 4 * BLOCK_WORDS * MOST_PHOTOS as u64).min(most);
        let usage = BufferUsage::Storage;
        Ok(Self {
            buffer: DeviceBuffer::new(gpu, "photographs", usage, 4 * words)?,
            capacity: if words == most { u64::MAX } else { words },
            share: words,
            free: vec![WordRange {
                first: 0,
                count: words as u32,
            }],
            retired: Vec::new(),
            held: Vec::new(),
            frame: 0,
            budget_bytes,
            is_behind: false,
        })
    }

    /// Words that it holds; as many as one binding can have count as any number.
    pub fn capacity_words(&self) -> u64 {
        self.capacity
    }

    /// The buffer.
    pub(crate) fn buffer(&self) -> &DeviceBuffer {
        &self.buffer
    }

    /// Tells whether a frame would be sharper than the last, since its photographs were not all copied.
    pub fn is_behind(&self) -> bool {
        self.is_behind
    }

    /// Copies what a frame needs as far as its budget goes, and tells where everything lies.
    ///
    /// # Errors
    /// When copying fails.
    pub(crate) fn ready(
        &mut self,
        gpu: &Arc<Gpu>,
        photos: &FramePhotos,
    ) -> Result<PhotoPlaces, Error> {
        self.frame += 1;
        let frame = self.frame;
        let mut left = self.budget_bytes.unwrap_or(u64::MAX) / 4;
        let is_over =
            |retired: u64| self.budget_bytes.is_none() || retired + FRAMES_IN_FLIGHT < frame;
        let (over, retired): (Vec<_>, Vec<_>) = std::mem::take(&mut self.retired)
            .into_iter()
            .partition(|(at, _)| is_over(*at));
        self.retired = retired;
        over.into_iter()
            .for_each(|(_, range)| give_back(&mut self.free, range));
        let most = photos
            .photos
            .iter()
            .map(|p| p.photo.index as usize + 1)
            .max();
        if self.held.len() < most.unwrap_or(0) {
            self.held.resize_with(most.unwrap_or(0), HeldPhoto::default);
        }
        for chosen in &photos.photos {
            self.held[chosen.photo.index as usize].used = frame;
        }
        self.is_behind = false;
        // With a budget, old ones stay until new ones are whole.
        let parts = photos.photos.len() as u64 + if self.budget_bytes.is_some() { 2 } else { 0 };
        self.share = self.buffer.bytes() / 4 / parts.max(1);
        // Everything small first: a map and a thumbnail each.
        for chosen in &photos.photos {
            self.hold_map(gpu, chosen, &mut left)?;
            self.begin(chosen);
        }
        for chosen in &photos.photos {
            self.copy_levels(gpu, chosen, &mut left)?;
        }
        Ok(photos
            .photos
            .iter()
            .map(|chosen| self.place_of(chosen))
            .collect())
    }

    fn place_of(&self, chosen: &ChosenPhoto) -> Option<(MapPlace, PixelsPlace)> {
        let held = &self.held[chosen.photo.index as usize];
        let shown = held.shown.as_ref()?;
        let map = match &held.map {
            Some(own) => MapPlace {
                first: own.range.first,
                size: [own.map.width, own.map.height],
            },
            None if chosen.depth.depth.is_empty() => MapPlace::default(),
            // Without what it sees it would show through everything.
            None => return None,
        };
        let count = shown.pixels.levels.len();
        (shown.whole < count).then(|| {
            let place = PixelsPlace {
                table: shown.range.first,
                size: shown.pixels.size(),
                first: shown.whole as u32,
                count: count as u32,
                has_mask: shown.mask.is_some(),
            };
            (map, place)
        })
    }

    /// Finds room for the depth map of a photograph and copies it, where it is another than before.
    fn hold_map(
        &mut self,
        gpu: &Arc<Gpu>,
        chosen: &ChosenPhoto,
        left: &mut u64,
    ) -> Result<(), Error> {
        let index = chosen.photo.index as usize;
        let is_there =
            (self.held[index].map.as_ref()).is_some_and(|own| Arc::ptr_eq(&own.map, &chosen.depth));
        let count = chosen.depth.depth.len() as u32;
        if is_there || count == 0 {
            return Ok(());
        }
        if let Some(old) = self.held[index].map.take() {
            self.retired.push((self.frame, old.range));
        }
        // A part of a map is of no use: the first of a frame goes over the budget.
        if *left == 0 {
            self.is_behind = true;
            return Ok(());
        }
        let Some(range) = self.room(count) else {
            self.is_behind = self.budget_bytes.is_some();
            return Ok(());
        };
        let words: Vec<u32> = (chosen.depth.depth.iter().zip(&chosen.depth.edge))
            .map(|(depth, edge)| map_word(*depth, *edge))
            .collect();
        self.buffer.write(
            gpu,
            4 * u64::from(range.first),
            bytemuck::cast_slice(&words),
        )?;
        *left = left.saturating_sub(u64::from(count));
        self.held[index].map = Some(HeldMap {
            map: chosen.depth.clone(),
            range,
        });
        Ok(())
    }

    /// Finds room for the pixels of a photograph, where they are others than before; the largest levels are left out where
    /// there is none.
    fn begin(&mut self, chosen: &ChosenPhoto) {
        let index = chosen.photo.index as usize;
        let is_same = |own: &HeldPixels| {
            Arc::ptr_eq(&own.pixels, &chosen.pixels) && own.mask.is_some() == chosen.mask.is_some()
        };
        let held = &mut self.held[index];
        if held.coming.as_ref().is_some_and(is_same) {
            return;
        }
        if let Some(old) = held.coming.take() {
            self.retired.push((self.frame, old.range));
        }
        let levels = &chosen.pixels.levels;
        let is_shown = self.held[index].shown.as_ref().is_some_and(is_same);
        if is_shown || levels.is_empty() || levels.len() > TABLE_WORDS as usize {
            return;
        }
        let map = chosen.depth.depth.len() as u64 + u64::from(TABLE_WORDS) + 2 * BLOCK_WORDS;
        for largest in 0..levels.len() {
            let texels: u64 = levels[largest..]
                .iter()
                .map(|level| level.rgb.len() as u64)
                .sum();
            if texels + map > self.share && largest + 1 < levels.len() {
                continue;
            }
            let Ok(count) = u32::try_from(texels + u64::from(TABLE_WORDS)) else {
                continue;
            };
            if let Some(range) = self.room(count) {
                if largest > 0 {
                    tracing::info!(
                        photo = index,
                        largest,
                        "a photograph is shown at a smaller size: memory is full"
                    );
                }
                self.held[index].coming = Some(HeldPixels {
                    pixels: chosen.pixels.clone(),
                    mask: chosen.mask.clone(),
                    range,
                    largest,
                    whole: levels.len(),
                    rows: 0,
                });
                return;
            }
        }
    }

    /// Copies levels of a photograph, from the smallest on, while the budget lasts.
    fn copy_levels(
        &mut self,
        gpu: &Arc<Gpu>,
        chosen: &ChosenPhoto,
        left: &mut u64,
    ) -> Result<(), Error> {
        let index = chosen.photo.index as usize;
        let frame = self.frame;
        let Some(mut coming) = self.held[index].coming.take() else {
            // More levels of what is shown already.
            return self.copy_shown(gpu, index, left);
        };
        coming.copy(gpu, &mut self.buffer, left)?;
        let is_whole = coming.whole == coming.largest;
        let held = &mut self.held[index];
        // What is there is replaced once that is no loss.
        let width = |own: &HeldPixels| {
            own.pixels
                .levels
                .get(own.whole)
                .map_or(0, |level| level.width)
        };
        let is_better = held
            .shown
            .as_ref()
            .is_none_or(|shown| width(&coming) >= width(shown));
        if is_better && coming.whole < coming.pixels.levels.len() {
            if let Some(old) = held.shown.replace(coming) {
                self.retired.push((frame, old.range));
            }
        } else {
            held.coming = Some(coming);
        }
        self.is_behind |= !is_whole;
        Ok(())
    }

    fn copy_shown(&mut self, gpu: &Arc<Gpu>, index: usize, left: &mut u64) -> Result<(), Error> {
        let Some(mut shown) = self.held[index].shown.take() else {
            return Ok(());
        };
        let copied = shown.copy(gpu, &mut self.buffer, left);
        self.is_behind |= shown.whole != shown.largest;
        self.held[index].shown = Some(shown);
        copied
    }

    /// A part of so many words; photographs that the frame does not have give up theirs for it, those used longest ago first.
    fn room(&mut self, count: u32) -> Option<WordRange> {
        // Whole blocks, so that parts of one size fit again.
        let count = count.next_multiple_of(BLOCK_WORDS as u32);
        loop {
            if let Some(range) = take(&mut self.free, count) {
                return Some(range);
            }
            let others = self.held.iter().enumerate();
            let others = others.filter(|(_, own)| own.used < self.frame && !own.is_empty());
            let (oldest, _) = others.min_by_key(|(_, own)| own.used)?;
            let old = std::mem::take(&mut self.held[oldest]);
            for range in old.ranges() {
                match self.budget_bytes {
                    // The frame that read it has finished.
                    None => give_back(&mut self.free, range),
                    Some(_) => self.retired.push((self.frame, range)),
                }
            }
        }
    }
}

impl HeldPhoto {
    fn is_empty(&self) -> bool {
        self.ranges().next().is_none()
    }

    fn ranges(&self) -> impl Iterator<Item = WordRange> + '_ {
        let pixels = [&self.shown, &self.coming]
            .into_iter()
            .flatten()
            .map(|own| own.range);
        pixels.chain(self.map.iter().map(|own| own.range))
    }
}

impl HeldPixels {
    /// Words from the table to the first texel of a level.
    fn level_offset(&self, level: usize) -> u32 {
        let before = self.pixels.levels[self.largest..level].iter();
        TABLE_WORDS + before.map(|level| level.rgb.len() as u32).sum::<u32>()
    }

    /// Copies rows until the budget of words is used up or all is there.
    fn copy(
        &mut self,
        gpu: &Arc<Gpu>,
        buffer: &mut DeviceBuffer,
        left: &mut u64,
    ) -> Result<(), Error> {
        if self.whole == self.pixels.levels.len() && self.rows == 0 {
            let mut table = [0_u32; TABLE_WORDS as usize];
            for (level, word) in table.iter_mut().enumerate().take(self.pixels.levels.len()) {
                *word = self.level_offset(level.max(self.largest));
            }
            buffer.write(
                gpu,
                4 * u64::from(self.range.first),
                bytemuck::cast_slice(&table),
            )?;
        }
        while self.whole > self.largest && *left > 0 {
            let level = self.whole - 1;
            let pixels = &self.pixels.levels[level];
            let end = (self.rows + ROWS_AT_ONCE).min(pixels.height);
            let words = texel_words(pixels, self.mask.as_deref(), self.rows..end);
            let first = self.range.first + self.level_offset(level) + self.rows * pixels.width;
            buffer.write(gpu, 4 * u64::from(first), bytemuck::cast_slice(&words))?;
            *left = left.saturating_sub(words.len() as u64);
            self.rows = end;
            if end == pixels.height {
                (self.whole, self.rows) = (level, 0);
            }
        }
        Ok(())
    }
}

/// Texels of some rows of a level, with the mask at their centers.
fn texel_words(
    pixels: &PhotoPixels,
    mask: Option<&PhotoPyramid>,
    rows: std::ops::Range<u32>,
) -> Vec<u32> {
    let width = pixels.width as usize;
    let texels = &pixels.rgb[rows.start as usize * width..rows.end as usize * width];
    let Some(mask) = mask else {
        return texels
            .iter()
            .map(|[r, g, b]| u32::from_le_bytes([*r, *g, *b, 255]))
            .collect();
    };
    let (w, h) = (pixels.width as f32, pixels.height as f32);
    let word = |(index, [r, g, b]): (usize, &[u8; 3])| {
        let (column, row) = (index % width, rows.start as usize + index / width);
        let at = [(column as f32 + 0.5) / w, (row as f32 + 0.5) / h];
        let kept = (mask.sample(at, 0.0)[1] * 255.0 + 0.5) as u8;
        u32::from_le_bytes([*r, *g, *b, kept])
    };
    texels.iter().enumerate().map(word).collect()
}

/// Word of a texel of a depth map.
fn map_word(depth: f32, edge: f32) -> u32 {
    let edge = (edge / EDGE_TEXELS * 255.0 + 0.5).clamp(0.0, 255.0) as u32;
    // Rounded to what is left; infinite stays so.
    let rounded = if depth.is_finite() {
        depth.to_bits().saturating_add(0x80)
    } else {
        f32::INFINITY.to_bits()
    };
    (rounded & !0xff) | edge
}

/// Takes words from the first free part that has enough.
fn take(free: &mut Vec<WordRange>, count: u32) -> Option<WordRange> {
    let at = free.iter().position(|range| range.count >= count)?;
    let first = free[at].first;
    free[at].first += count;
    free[at].count -= count;
    if free[at].count == 0 {
        free.remove(at);
    }
    Some(WordRange { first, count })
}

/// Frees a part, and joins it with those beside it.
fn give_back(free: &mut Vec<WordRange>, range: WordRange) {
    let at = free.partition_point(|other| other.first < range.first);
    free.insert(at, range);
    if at + 1 < free.len() && free[at].first + free[at].count == free[at + 1].first {
        free[at].count += free.remove(at + 1).count;
    }
    if at > 0 && free[at - 1].first + free[at - 1].count == free[at].first {
        free[at - 1].count += free.remove(at).count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_taken_and_joined_again() {
        let whole = WordRange {
            first: 0,
            count: 256,
        };
        let mut free = vec![whole];
        let parts: Vec<_> = (0..4).filter_map(|_| take(&mut free, 64)).collect();
        assert_eq!((parts.len(), free.len(), take(&mut free, 1)), (4, 0, None));
        for index in [2, 0, 3, 1] {
            give_back(&mut free, parts[index]);
        }
        assert_eq!(free, [whole]);
        let first = take(&mut free, 64);
        assert_eq!(
            first,
            Some(WordRange {
                first: 0,
                count: 64
            })
        );
    }

    #[test]
    fn words_of_maps_keep_depths_to_a_part_of_65536() {
        for depth in [1e-3_f32, 0.7, 1.999_99, 123.456, 9e8] {
            let word = map_word(depth, EDGE_TEXELS);
            let back = f32::from_bits(word & !0xff);
            assert!(
                (back / depth - 1.0).abs() < 1.0 / 65_536.0,
                "{depth} {back}"
            );
            assert_eq!(word & 0xff, 255);
        }
        assert_eq!(f32::from_bits(map_word(f32::INFINITY, 0.0)), f32::INFINITY);
        assert_eq!(
            map_word(f32::INFINITY, EDGE_TEXELS) & !0xff,
            f32::INFINITY.to_bits()
        );
        assert_eq!(map_word(1.0, 2.0) & 0xff, 128);
    }

    #[test]
    fn masks_lie_in_the_last_byte() {
        let pixels = PhotoPixels::filled(4, 2, [10, 20, 30]);
        assert_eq!(texel_words(&pixels, None, 1..2), [0xff1e_140a; 4]);
        let mask = PhotoPyramid::new(PhotoPixels::filled(2, 2, [0, 128, 0]));
        assert_eq!(texel_words(&pixels, Some(&mask), 0..1), [0x801e_140a; 4]);
    }
}
