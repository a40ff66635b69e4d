//! Targets of another size, or with normals and without, and what depends on them.

use crate::gpu::Error;
use crate::render::vulkan::look::PictureLooks;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::targets::FrameTargets;

impl VulkanRenderer {
    /// Makes the targets of pictures of this size anew, with normals or without, and forgets what was made for others.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory runs out.
    pub(super) fn remake_targets(
        &mut self,
        (width, height): (u32, u32),
        normals: bool,
    ) -> Result<(), Error> {
        let format = self.targets.color.format;
        self.targets = FrameTargets::new(&self.gpu, width, height, (format, normals))?;
        self.readback = None;
        self.looks = PictureLooks::default();
        self.small = None;
        (self.polygons, self.spare_polygons) = (None, Vec::new());
        (self.filtered, self.spare_filtered) = (None, Vec::new());
        self.visibility = None;
        (self.fuzzy, self.spare_fuzzy) = (None, Vec::new());
        (self.overdraw, self.counted) = (None, None);
        Ok(())
    }

    /// Gives the targets normals or takes them away, as the next frame asks; its lists are packed anew then.
    ///
    /// # Errors
    /// When memory runs out.
    pub(super) fn set_normals(&mut self, normals: bool) -> Result<(), Error> {
        if self.targets.normal.is_some() == normals {
            return Ok(());
        }
        let size = (self.targets.color.width, self.targets.color.height);
        self.remake_targets(size, normals)?;
        // Their pipelines write all targets.
        self.splats.clear();
        self.lists.iter_mut().for_each(|lists| lists.held = None);
        Ok(())
    }
}
