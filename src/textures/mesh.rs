//! The textures of a mesh: which image each triangle shows, and where.

use super::TextureImage;
use glam::Vec2;
use std::sync::Arc;

/// The image of what has none.
pub const NO_IMAGE: u32 = u32::MAX;

/// Images and where the corners of triangles are in them. Both lists are as long as the triangles of the mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshTextures {
    /// The images.
    pub images: Vec<Arc<TextureImage>>,
    /// Texture coordinates of each triangle's corners; (0, 0) is the upper left corner of the image.
    pub corners: Vec<[Vec2; 3]>,
    /// The image of each triangle, or [`NO_IMAGE`].
    pub image_of: Vec<u32>,
}

/// Where a vertex is in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexturePoint {
    /// Texture coordinate.
    pub at: Vec2,
    /// The image, or [`NO_IMAGE`].
    pub image: u32,
}

impl TexturePoint {
    /// In no image.
    pub const NOWHERE: Self = Self {
        at: Vec2::ZERO,
        image: NO_IMAGE,
    };

    /// Bits that are the same of equal points.
    pub fn bits(self) -> [u32; 3] {
        let at = self.at + Vec2::ZERO;
        [at.x.to_bits(), at.y.to_bits(), self.image]
    }
}

impl MeshTextures {
    /// Where a corner of a triangle is in an image; nowhere where a triangle of this number has no image that there is.
    #[inline]
    pub fn point(&self, triangle: usize, corner: usize) -> TexturePoint {
        let image = self.image_of.get(triangle).copied().unwrap_or(NO_IMAGE);
        let at = self.corners.get(triangle).map(|corners| corners[corner]);
        match at {
            Some(at) if (image as usize) < self.images.len() => TexturePoint { at, image },
            _ => TexturePoint::NOWHERE,
        }
    }

    /// Keeps the triangles whose number `keep` accepts.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        fn retain<T>(items: &mut Vec<T>, keep: impl Fn(usize) -> bool) {
            let mut index = 0;
            items.retain(|_| {
                index += 1;
                keep(index - 1)
            });
        }
        retain(&mut self.corners, &keep);
        retain(&mut self.image_of, &keep);
    }

    /// The triangles of these numbers, in their order.
    #[must_use]
    pub fn arranged(&self, numbers: impl Iterator<Item = u32> + Clone) -> Self {
        let corners = |number: u32| self.corners.get(number as usize).copied();
        let image = |number: u32| self.image_of.get(number as usize).copied();
        Self {
            images: self.images.clone(),
            corners: (numbers.clone())
                .map(|number| corners(number).unwrap_or_default())
                .collect(),
            image_of: numbers
                .map(|number| image(number).unwrap_or(NO_IMAGE))
                .collect(),
        }
    }
}
