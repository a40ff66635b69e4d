//! Layer that a window shows over its picture: triangles of egui, as the one pass `overlay`.
//!
//! The pass copies the picture into an image of its own and draws over that, so the picture stays as it is: it can
//! be read back, shown again under another overlay, and the overlay can be left out at no cost. Textures (the
//! glyphs of the fonts) are kept on the host as well, so that a device that was opened anew gets them again.

use super::buffer::{AnyBuffer, UploadBuffer};
use super::frame::{FrameRecorder, TargetLoad};
use super::image::{DeviceImage, ImageFormat};
use super::pipeline::{
    DepthMode, PipelineDescription, PrimitiveTopology, ShaderPipeline, VertexRecord, record,
};
use super::{Error, Gpu};
use crate::abi::shaders;
use bytemuck::{Pod, Zeroable};
use egui::TextureId;
use egui::epaint::{ClippedPrimitive, ImageData, Primitive, textures::TexturesDelta};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One corner, 20 bytes.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct OverlayCorner {
    /// Clip space.
    position: [f32; 2],
    /// Place in the texture, 0..=1.
    place: [f32; 2],
    /// Premultiplied, in the encoding of the screen.
    color: [u8; 4],
}

const RECORD: VertexRecord = record!(OverlayCorner {
    position: Float2,
    place: Float2,
    color: Unorm8x4,
});

/// A texture, on the host and, once it was drawn with, on the device.
#[derive(Debug, Default)]
struct OverlayTexture {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 4]>,
    image: Option<DeviceImage>,
    /// The device's copy is not that of the host.
    is_stale: bool,
}

/// Mapped memory of one slot of the ring.
#[derive(Debug)]
struct OverlayLists {
    corners: UploadBuffer,
    indices: UploadBuffer,
    texels: UploadBuffer,
}

/// A run of triangles with one texture and one clip rectangle.
#[derive(Debug, Clone, Copy)]
struct OverlayRun {
    texture: TextureId,
    scissor: [u32; 4],
    first: u32,
    count: u32,
    first_corner: i32,
}

/// Draws egui's triangles over a picture. One for each window.
#[derive(Debug)]
pub struct WindowOverlay {
    gpu: Arc<Gpu>,
    copy: ShaderPipeline,
    draw: ShaderPipeline,
    textures: BTreeMap<TextureId, OverlayTexture>,
    slots: Vec<OverlayLists>,
    primitives: Vec<ClippedPrimitive>,
    pixels_per_point: f32,
    runs: Vec<OverlayRun>,
    /// Stale textures with their places in the memory of the slot.
    writes: Vec<(TextureId, u64)>,
    shown: Option<DeviceImage>,
    /// Columns at the left that the picture leaves free.
    inset: u32,
}

/// Color behind them: no part of the picture, and dark where nothing is drawn there, in the encoding of the screen.
const BEHIND: [f32; 4] = [18.0 / 255.0, 20.0 / 255.0, 24.0 / 255.0, 1.0];
/// First size of the mapped lists, bytes.
const FIRST_BYTES: u64 = 1 << 18;

impl WindowOverlay {
    /// An empty overlay for a ring of `in_flight` frames.
    ///
    /// # Errors
    /// When a Vulkan call fails or memory runs out.
    pub fn new(gpu: &Arc<Gpu>, in_flight: usize) -> Result<Self, Error> {
        let base = PipelineDescription {
            name: "overlay.copy",
            vertex: &shaders::OVERLAY_COPY_VERT,
            fragment: Some(&shaders::OVERLAY_COPY_FRAG),
            constants: &[],
            record: VertexRecord::NOTHING,
            topology: PrimitiveTopology::Triangles,
            colors: &[ImageFormat::Rgba8],
            depth: DepthMode::None,
            is_additive: false,
        };
        let slots = (0..in_flight.max(1))
            .map(|slot| {
                let upload = |what: &str| {
                    UploadBuffer::new(gpu, &format!("overlay {what} of frame {slot}"), FIRST_BYTES)
                };
                Ok(OverlayLists {
                    corners: upload("corners")?,
                    indices: upload("indices")?,
                    texels: upload("texels")?,
                })
            })
            .collect::<Result<_, Error>>()?;
        Ok(Self {
            gpu: gpu.clone(),
            copy: ShaderPipeline::new(gpu, &base)?,
            draw: ShaderPipeline::over(
                gpu,
                &PipelineDescription {
                    name: "overlay.draw",
                    vertex: &shaders::OVERLAY_DRAW_VERT,
                    fragment: Some(&shaders::OVERLAY_DRAW_FRAG),
                    record: RECORD,
                    ..base
                },
            )?,
            textures: BTreeMap::new(),
            slots,
            primitives: Vec::new(),
            pixels_per_point: 1.0,
            runs: Vec::new(),
            writes: Vec::new(),
            shown: None,
            inset: 0,
        })
    }

    /// The textures of another overlay, for one that takes its place on a device opened anew.
    #[must_use]
    pub fn with_textures_of(mut self, other: Self) -> Self {
        self.textures = other.textures;
        for texture in self.textures.values_mut() {
            texture.image = None;
            texture.is_stale = true;
        }
        self.primitives = other.primitives;
        self.pixels_per_point = other.pixels_per_point;
        self
    }

    /// Sets what the next frames show: triangles in points of `pixels_per_point` pixels, and changes of textures since
    /// the last call. Every change must be handed over, also when nothing is shown.
    pub fn set(
        &mut self,
        primitives: Vec<ClippedPrimitive>,
        mut textures: TexturesDelta,
        pixels_per_point: f32,
    ) {
        self.primitives = primitives;
        self.pixels_per_point = pixels_per_point;
        std::mem::take(&mut textures.set)
            .into_iter()
            .for_each(|(id, deltas)| {
                for delta in deltas {
                    self.textures
                        .entry(id)
                        .or_default()
                        .change(&delta.image, delta.pos);
                }
            });
        std::mem::take(&mut textures.free)
            .into_iter()
            .for_each(|id| {
                self.textures.remove(&id);
            });
    }

    /// Forgets what the device has, after a frame that was recorded and not submitted.
    pub fn invalidate(&mut self) {
        for texture in self.textures.values_mut() {
            texture.is_stale = true;
        }
        self.shown = None;
    }

    /// Makes everything ready for a frame of `width` x `height` pixels in ring slot `slot`, whose last use has
    /// finished; must come before the frame is begun. The picture begins `inset` pixels from the left.
    ///
    /// # Errors
    /// When memory runs out or a side is above the device's limit.
    pub fn prepare(
        &mut self,
        slot: usize,
        (width, height): (u32, u32),
        inset: u32,
    ) -> Result<(), Error> {
        self.inset = inset.min(width);
        if self
            .shown
            .as_ref()
            .is_none_or(|i| (i.width, i.height) != (width, height))
        {
            self.shown = Some(DeviceImage::new(
                &self.gpu,
                "window with overlay",
                ImageFormat::Rgba8,
                width,
                height,
            )?);
        }
        let slot = slot % self.slots.len();
        self.pack(slot, width, height)?;
        self.writes.clear();
        let mut bytes = 0;
        for (&id, texture) in &mut self.textures {
            if texture.fits_image() && !texture.is_stale {
                continue;
            }
            if !texture.fits_image() {
                texture.image = Some(DeviceImage::copied_to(
                    &self.gpu,
                    "overlay texture",
                    ImageFormat::Rgba8,
                    texture.width as u32,
                    texture.height as u32,
                )?);
            }
            texture.is_stale = true;
            self.writes.push((id, bytes));
            bytes += 4 * texture.pixels.len() as u64;
        }
        let texels = &mut self.slots[slot].texels;
        reserve(&self.gpu, texels, bytes)?;
        for (id, offset) in &self.writes {
            let source = bytemuck::cast_slice(&self.textures[id].pixels);
            texels.bytes_mut()[*offset as usize..][..source.len()].copy_from_slice(source);
        }
        if bytes > 0 {
            texels.flush(0..bytes);
        }
        Ok(())
    }

    /// Writes corners and indices into the memory of a slot.
    fn pack(&mut self, slot: usize, width: u32, height: u32) -> Result<(), Error> {
        let meshes = || {
            self.primitives.iter().filter_map(|p| match &p.primitive {
                Primitive::Mesh(mesh) => Some((p.clip_rect, mesh)),
                Primitive::Callback(_) => None,
            })
        };
        let (mut corners, mut indices) = (0, 0);
        for (_, mesh) in meshes() {
            corners += mesh.vertices.len();
            indices += mesh.indices.len();
        }
        let corner_bytes = (corners * size_of::<OverlayCorner>()) as u64;
        let index_bytes = 4 * indices as u64;
        let lists = &mut self.slots[slot];
        reserve(&self.gpu, &mut lists.corners, corner_bytes)?;
        reserve(&self.gpu, &mut lists.indices, index_bytes)?;
        let scale = self.pixels_per_point;
        let (to_x, to_y) = (2.0 * scale / width as f32, 2.0 * scale / height as f32);
        let out: &mut [OverlayCorner] =
            bytemuck::cast_slice_mut(&mut lists.corners.bytes_mut()[..corner_bytes as usize]);
        let index_out: &mut [u32] =
            bytemuck::cast_slice_mut(&mut lists.indices.bytes_mut()[..index_bytes as usize]);
        self.runs.clear();
        let (mut at, mut index_at) = (0, 0);
        for (clip, mesh) in meshes() {
            for (corner, vertex) in out[at..].iter_mut().zip(&mesh.vertices) {
                *corner = OverlayCorner {
                    position: [vertex.pos.x * to_x - 1.0, vertex.pos.y * to_y - 1.0],
                    place: [vertex.uv.x, vertex.uv.y],
                    color: vertex.color.to_array(),
                };
            }
            index_out[index_at..][..mesh.indices.len()].copy_from_slice(&mesh.indices);
            let scissor = scissor(clip, scale, width, height);
            // Something whose texture is gone, or that lies outside, is not drawn.
            if let Some(scissor) = scissor
                && self.textures.contains_key(&mesh.texture_id)
            {
                self.runs.push(OverlayRun {
                    texture: mesh.texture_id,
                    scissor,
                    first: index_at as u32,
                    count: mesh.indices.len() as u32,
                    first_corner: at as i32,
                });
            }
            at += mesh.vertices.len();
            index_at += mesh.indices.len();
        }
        lists.corners.flush(0..corner_bytes);
        lists.indices.flush(0..index_bytes);
        Ok(())
    }

    /// Records what was prepared over `picture`, and gives the image that is to be shown.
    ///
    /// # Panics
    /// When `picture` has not the size that [`prepare`](WindowOverlay::prepare) was told, less the inset.
    pub fn record(&mut self, frame: &mut FrameRecorder<'_>, picture: &DeviceImage) -> &DeviceImage {
        let slot = frame.slot() % self.slots.len();
        let lists = &self.slots[slot];
        for (id, offset) in self.writes.drain(..) {
            let Some(texture) = self.textures.get_mut(&id) else {
                continue;
            };
            if let Some(image) = &texture.image {
                write(frame, &lists.texels, offset, image);
                texture.is_stale = false;
            }
        }
        let Some(shown) = &self.shown else {
            unreachable!("prepare made the image")
        };
        assert!(
            (shown.width, shown.height) == (picture.width + self.inset, picture.height),
            "the overlay was prepared for another size"
        );
        let mut pass = frame
            .pass("overlay")
            .color(shown, TargetLoad::Clear(BEHIND))
            .sampled(picture)
            .vertices(&lists.corners)
            .indices(&lists.indices);
        for image in self.textures.values().filter_map(|t| t.image.as_ref()) {
            pass = pass.sampled(image);
        }
        let (textures, runs) = (&self.textures, &self.runs);
        let (draw_pipeline, copy, inset) = (&self.draw, &self.copy, self.inset);
        pass.draw(
            [0.0, 0.0, shown.width as f32, shown.height as f32],
            |draw| {
                draw.cull_back_faces(false, false);
                draw.bind(copy, &[], &[picture]);
                draw.scissor([inset, 0, picture.width, picture.height]);
                draw.draw(3 * inset, 3);
                let mut bound = None;
                for run in runs {
                    let Some(image) = textures.get(&run.texture).and_then(|t| t.image.as_ref())
                    else {
                        continue;
                    };
                    if bound != Some(run.texture) {
                        draw.bind(draw_pipeline, &[], &[image]);
                        draw.vertices(&lists.corners, 0);
                        draw.indices(&lists.indices, 0);
                        bound = Some(run.texture);
                    }
                    draw.scissor(run.scissor);
                    draw.draw_indexed(run.first, run.count, run.first_corner);
                }
            },
        );
        shown
    }

    /// The image that the last frame showed, if it had an overlay.
    pub fn shown(&self) -> Option<&DeviceImage> {
        self.shown.as_ref()
    }
}

impl OverlayTexture {
    fn fits_image(&self) -> bool {
        let size = (self.width as u32, self.height as u32);
        self.image
            .as_ref()
            .is_some_and(|i| (i.width, i.height) == size)
    }

    /// The whole texture, or a part of it from `position` on. A part that reaches out is cut off.
    fn change(&mut self, image: &ImageData, position: Option<[usize; 2]>) {
        let ImageData::Color(image) = image;
        let [width, height] = image.size;
        if position.is_none() {
            (self.width, self.height) = (width, height);
            self.pixels.clear();
            self.pixels.resize(width * height, [0; 4]);
        }
        let [left, top] = position.unwrap_or_default();
        let copied = width.min(self.width.saturating_sub(left));
        for (row, source) in image.pixels.chunks_exact(width.max(1)).enumerate() {
            let start = (top + row) * self.width + left;
            if let Some(target) = self.pixels.get_mut(start..start + copied) {
                for (to, from) in target.iter_mut().zip(source) {
                    *to = from.to_array();
                }
            }
        }
        self.is_stale = true;
    }
}

/// A clip rectangle in points as pixels, cut to the picture; none where nothing is left.
fn scissor(clip: egui::Rect, scale: f32, width: u32, height: u32) -> Option<[u32; 4]> {
    // A float that is no number or out of range saturates.
    let pixel = |value: f32, limit: u32| ((value * scale).round() as u32).min(limit);
    let (left, top) = (pixel(clip.min.x, width), pixel(clip.min.y, height));
    let (right, bottom) = (pixel(clip.max.x, width), pixel(clip.max.y, height));
    (right > left && bottom > top).then(|| [left, top, right - left, bottom - top])
}

/// Grows a mapped buffer; its slot is free, so nothing reads it.
fn reserve(gpu: &Arc<Gpu>, buffer: &mut UploadBuffer, bytes: u64) -> Result<(), Error> {
    if bytes > buffer.bytes() {
        let name = buffer.name().to_owned();
        *buffer = UploadBuffer::new(gpu, &name, bytes.max(buffer.bytes() * 3 / 2))?;
    }
    Ok(())
}

/// Copies a whole image out of a mapped buffer, as the pass `overlay.texture`.
fn write(frame: &mut FrameRecorder<'_>, from: &UploadBuffer, offset: u64, image: &DeviceImage) {
    let whole = [0, 0, image.width, image.height];
    frame
        .pass("overlay.texture")
        .copy_in(whole, &[(from, offset, image)]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Color32, ColorImage, Rect, pos2};

    #[test]
    fn clip_rectangles_become_pixels_inside_of_the_picture() {
        let rect = |a: f32, b: f32, c: f32, d: f32| Rect::from_min_max(pos2(a, b), pos2(c, d));
        assert_eq!(
            scissor(rect(1.0, 2.0, 5.0, 9.0), 2.0, 100, 100),
            Some([2, 4, 8, 14])
        );
        assert_eq!(
            scissor(rect(-9.0, -9.0, 500.0, 3.0), 1.0, 100, 50),
            Some([0, 0, 100, 3])
        );
        assert_eq!(scissor(rect(10.0, 10.0, 10.2, 40.0), 1.0, 100, 50), None);
        assert_eq!(scissor(Rect::NOTHING, 1.0, 100, 50), None);
        assert_eq!(
            scissor(Rect::EVERYTHING, 1.5, 100, 50),
            Some([0, 0, 100, 50])
        );
        assert_eq!(scissor(rect(200.0, 0.0, 300.0, 9.0), 1.0, 100, 50), None);
    }

    #[test]
    fn parts_of_textures_land_where_they_belong() {
        let image = |w: usize, h: usize, value: u8| {
            let pixel = Color32::from_rgba_premultiplied(value, 0, 0, 255);
            ImageData::Color(Arc::new(ColorImage::new([w, h], vec![pixel; w * h])))
        };
        let mut texture = OverlayTexture::default();
        texture.change(&image(4, 3, 1), None);
        texture.is_stale = false;
        texture.change(&image(2, 2, 9), Some([2, 1]));
        assert!(texture.is_stale);
        let reds: Vec<u8> = texture.pixels.iter().map(|p| p[0]).collect();
        assert_eq!(reds, [1, 1, 1, 1, 1, 1, 9, 9, 1, 1, 9, 9]);
        texture.change(&image(3, 3, 7), Some([3, 2]));
        let reds: Vec<u8> = texture.pixels.iter().map(|p| p[0]).collect();
        assert_eq!(reds, [1, 1, 1, 1, 1, 1, 9, 9, 1, 1, 9, 7], "cut off");
    }
}
