//! Passes that fill images without drawing.

use super::access::ResourceAccess;
use super::buffer::AnyBuffer;
use super::image::DeviceImage;
use super::pass::PassBuilder;
use ash::vk;

impl PassBuilder<'_> {
    /// Records a pass that copies rectangles `[left, top, right, bottom]` into images made by [`DeviceImage::copied_to`], row by row
    /// from the byte of a buffer. What is beside them keeps its pixels.
    ///
    /// # Panics
    /// When a rectangle reaches out of its image, or a buffer has fewer pixels.
    pub fn copy_in(
        mut self,
        [left, top, right, bottom]: [u32; 4],
        copies: &[(&dyn AnyBuffer, u64, &DeviceImage)],
    ) {
        let (width, height) = (right.saturating_sub(left), bottom.saturating_sub(top));
        for &(buffer, offset, image) in copies {
            assert!(
                right <= image.width && bottom <= image.height,
                "pass {}: outside of {}",
                self.name,
                image.name()
            );
            let bytes = image.format.pixel_bytes() * u64::from(width) * u64::from(height);
            assert!(
                offset + bytes <= buffer.bytes(),
                "pass {}: {} is smaller than what is copied",
                self.name,
                buffer.name()
            );
            self.barriers.buffer(buffer, ResourceAccess::CopySource);
            let is_whole = (width, height) == (image.width, image.height);
            self.barriers
                .image(image, ResourceAccess::CopyTarget, is_whole);
        }
        let timing = self.begin();
        if width > 0 && height > 0 {
            for &(buffer, offset, image) in copies {
                self.copy_one((buffer, offset), image, [left, top, width, height]);
            }
        }
        timing.end(&self.slot.queries);
    }

    fn copy_one(
        &self,
        (buffer, offset): (&dyn AnyBuffer, u64),
        image: &DeviceImage,
        rectangle: [u32; 4],
    ) {
        let regions = [region(image, offset, rectangle)];
        // SAFETY: both are alive until the frame has finished (their Drop defers), the image is in the layout of copies by the
        // barrier before, rectangle and bytes lie in them, and offsets are multiples of a pixel's four bytes.
        unsafe {
            self.gpu.device.cmd_copy_buffer_to_image(
                self.slot.commands,
                buffer.handle(),
                image.handle,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &regions,
            );
        }
    }
}

/// A rectangle of an image (its first pixel, width and height), beside the bytes of a buffer from `offset` on, row by row.
pub(super) fn region(
    image: &DeviceImage,
    offset: u64,
    [x, y, width, height]: [u32; 4],
) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .buffer_offset(offset)
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: image.format.aspect(),
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        })
        .image_offset(vk::Offset3D {
            x: x as i32,
            y: y as i32,
            z: 0,
        })
        .image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        })
}
