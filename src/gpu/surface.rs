//! Pictures in a window: surface, swapchain, and the images that frames are presented on.
//!
//! A presented frame needs two binary semaphores. `free` is signalled when the presentation engine gives an
//! image back; there is one for each frame in flight, reused once that frame has finished. `drawn` is
//! signalled by the frame and waited for by the presentation engine; there is one for each image of the
//! swapchain, reused once that image was acquired again (nothing else tells that the engine is done with it).

use super::access::ResourceAccess;
use super::{Error, Gpu, lock};
use ash::{khr, vk};
use std::sync::Arc;

/// Longest wait for an image, nanoseconds; a window that is covered may not give one back for long.
const PATIENCE_NS: u64 = 500_000_000;

/// An image of the window that a frame is about to be presented on.
#[derive(Debug)]
#[must_use = "an acquired image must be presented or abandoned"]
pub struct AcquiredImage {
    pub(super) image: vk::Image,
    pub(super) free: vk::Semaphore,
    pub(super) drawn: vk::Semaphore,
    index: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl AcquiredImage {
    /// The first thing a frame does with the image; its stages wait until the image is free.
    pub(super) const FIRST_ACCESS: ResourceAccess = ResourceAccess::BlitTarget;
}

#[derive(Debug)]
struct SurfaceSwapchain {
    handle: vk::SwapchainKHR,
    extent: vk::Extent2D,
    images: Vec<vk::Image>,
    /// One for each image.
    drawn: Vec<vk::Semaphore>,
    /// One for each frame in flight.
    free: Vec<vk::Semaphore>,
    /// Something was presented. Where even a new swapchain is called suboptimal, another would not be better.
    is_used: bool,
}

/// The surface of a window. Must be dropped before its window.
pub struct WindowSurface {
    swapchain: Option<SurfaceSwapchain>,
    surface: vk::SurfaceKHR,
    surfaces: khr::surface::Instance,
    swapchains: khr::swapchain::Device,
    in_flight: usize,
    vsync: bool,
    mode: vk::PresentModeKHR,
    /// The swapchain no longer fits the surface.
    is_stale: bool,
    /// The surface itself is gone.
    is_lost: bool,
    injected: Option<vk::Result>,
    rebuilt: u64,
    gpu: Arc<Gpu>,
}

impl std::fmt::Debug for WindowSurface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surface")
            .field("swapchain", &self.swapchain)
            .field("mode", &self.mode)
            .finish_non_exhaustive()
    }
}

fn create(gpu: &Gpu, window: &glfw::Window) -> Result<vk::SurfaceKHR, Error> {
    use vk::Handle;
    let refused = |result| Error::vulkan("glfwCreateWindowSurface", "the window")(result);
    if let Some(result) = gpu.fault_guard.as_ref().and_then(|g| g.making_surface()) {
        return Err(refused(result));
    }
    let mut raw = std::mem::MaybeUninit::uninit();
    // SAFETY: the instance is alive and has the extensions that GLFW asks for (`DeviceOptions::surface_extensions`);
    // the pointer takes one handle, which is written when the call succeeds.
    let surface = unsafe {
        let instance = gpu.instance.handle().as_raw() as _;
        let result = window.create_window_surface(instance, std::ptr::null(), raw.as_mut_ptr());
        match vk::Result::from_raw(result as i32) {
            vk::Result::SUCCESS => raw.assume_init(),
            result => return Err(refused(result)),
        }
    };
    Ok(vk::SurfaceKHR::from_raw(surface as u64))
}

impl WindowSurface {
    /// The surface of `window`, for `in_flight` frames at a time. With `vsync` frames wait for the screen
    /// (first in, first out); without it the newest frame replaces the waiting one (mailbox) or, where the
    /// device cannot do that, is shown at once. The swapchain is made when the first image is acquired.
    ///
    /// # Errors
    /// When the device was not opened with the window's extensions, cannot present to this window, or has no
    /// format or usage that a picture can be put on.
    pub fn new(
        gpu: &Arc<Gpu>,
        window: &glfw::Window,
        in_flight: usize,
        vsync: bool,
    ) -> Result<Self, Error> {
        let mut surface = Self {
            swapchain: None,
            surface: vk::SurfaceKHR::null(),
            surfaces: khr::surface::Instance::new(&gpu.entry, &gpu.instance),
            swapchains: gpu.swapchains(),
            in_flight: in_flight.max(1),
            vsync,
            mode: vk::PresentModeKHR::FIFO,
            is_stale: false,
            is_lost: false,
            injected: None,
            rebuilt: 0,
            gpu: gpu.clone(),
        };
        surface.attach(window)?;
        Ok(surface)
    }

    /// Way in which frames reach the screen: `fifo`, `mailbox` or `immediate`.
    pub fn present_mode(&self) -> &'static str {
        match self.mode {
            vk::PresentModeKHR::MAILBOX => "mailbox",
            vk::PresentModeKHR::IMMEDIATE => "immediate",
            _ => "fifo",
        }
    }

    /// Number of times that a swapchain was made.
    pub fn rebuilt(&self) -> u64 {
        self.rebuilt
    }

    /// For tests: the next acquisition answers `result` instead of asking the presentation engine.
    #[doc(hidden)]
    pub fn inject(&mut self, result: vk::Result) {
        self.injected = Some(result);
    }

    fn error(&self, call: &'static str) -> impl FnOnce(vk::Result) -> Error {
        Error::vulkan(call, "the window")
    }

    fn unusable(&self, cause: &str) -> Error {
        Error::Surface {
            device: self.gpu.info.name.clone(),
            cause: cause.into(),
        }
    }

    /// Makes the Vulkan surface of the window.
    fn attach(&mut self, window: &glfw::Window) -> Result<(), Error> {
        self.surface = create(&self.gpu, window)?;
        self.is_lost = false;
        // SAFETY: surface and physical device belong to the instance; the family was chosen from the
        // device's own list.
        let supported = unsafe {
            self.surfaces.get_physical_device_surface_support(
                self.gpu.physical,
                self.gpu.queue_family,
                self.surface,
            )
        }
        .map_err(self.error("vkGetPhysicalDeviceSurfaceSupportKHR"))?;
        if !supported {
            return Err(self.unusable("its graphics queue cannot present to this window"));
        }
        // SAFETY: as above.
        let modes = unsafe {
            self.surfaces
                .get_physical_device_surface_present_modes(self.gpu.physical, self.surface)
        }
        .map_err(self.error("vkGetPhysicalDeviceSurfacePresentModesKHR"))?;
        self.mode = choose_mode(self.vsync, &modes);
        tracing::info!("present mode {}", self.present_mode());
        Ok(())
    }

    /// Waits for the device and destroys the swapchain with its semaphores.
    fn drop_swapchain(&mut self) {
        let Some(old) = self.swapchain.take() else {
            return;
        };
        self.gpu.wait_idle();
        // SAFETY: the device is idle, so no submission uses an image or a semaphore of the swapchain, and no
        // acquired image is left (it was presented, or abandoned together with the swapchain).
        unsafe {
            for semaphore in old.drawn.into_iter().chain(old.free) {
                self.gpu.device.destroy_semaphore(semaphore, None);
            }
            self.swapchains.destroy_swapchain(old.handle, None);
        }
    }

    fn drop_surface(&mut self) {
        self.drop_swapchain();
        // SAFETY: its swapchain is gone; destroyed once (a null handle is ignored).
        unsafe { self.surfaces.destroy_surface(self.surface, None) };
        self.surface = vk::SurfaceKHR::null();
    }

    fn semaphore(&self, name: &str) -> Result<vk::Semaphore, Error> {
        // SAFETY: the device is alive.
        let semaphore = unsafe {
            self.gpu
                .device
                .create_semaphore(&vk::SemaphoreCreateInfo::default(), None)
        }
        .map_err(Error::vulkan("vkCreateSemaphore", name))?;
        self.gpu.name(semaphore, name);
        Ok(semaphore)
    }

    /// Makes a swapchain for the window's present size; none while the window has no area.
    fn rebuild(&mut self, window: &glfw::Window) -> Result<(), Error> {
        self.drop_swapchain();
        let outcome = self.make_swapchain(window);
        if outcome.is_err() {
            // Perhaps made in part.
            self.drop_swapchain();
        }
        outcome
    }

    fn make_swapchain(&mut self, window: &glfw::Window) -> Result<(), Error> {
        if self.is_lost {
            self.drop_surface();
        }
        if self.surface == vk::SurfaceKHR::null() {
            self.attach(window)?;
        }
        self.is_stale = false;
        let physical = self.gpu.physical;
        // SAFETY: surface and physical device belong to the instance.
        let (capabilities, formats) = unsafe {
            (
                self.surfaces
                    .get_physical_device_surface_capabilities(physical, self.surface)
                    .map_err(self.error("vkGetPhysicalDeviceSurfaceCapabilitiesKHR"))?,
                self.surfaces
                    .get_physical_device_surface_formats(physical, self.surface)
                    .map_err(self.error("vkGetPhysicalDeviceSurfaceFormatsKHR"))?,
            )
        };
        let extent = choose_extent(&capabilities, framebuffer(window));
        if extent.width == 0 || extent.height == 0 {
            return Ok(());
        }
        if !capabilities
            .supported_usage_flags
            .contains(vk::ImageUsageFlags::TRANSFER_DST)
        {
            return Err(self.unusable("nothing can be copied to its images"));
        }
        let format = self.choose_format(&formats)?;
        let usage = vk::ImageUsageFlags::TRANSFER_DST;
        let alpha = [
            vk::CompositeAlphaFlagsKHR::OPAQUE,
            vk::CompositeAlphaFlagsKHR::INHERIT,
            vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED,
            vk::CompositeAlphaFlagsKHR::POST_MULTIPLIED,
        ]
        .into_iter()
        .find(|a| capabilities.supported_composite_alpha.contains(*a))
        .unwrap_or(vk::CompositeAlphaFlagsKHR::OPAQUE);
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count(choose_count(&capabilities))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(usage)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(capabilities.current_transform)
            .composite_alpha(alpha)
            .present_mode(self.mode)
            .clipped(true);
        // SAFETY: the surface has no other swapchain, and every value is one that it offers.
        let handle = unsafe { self.swapchains.create_swapchain(&info, None) }
            .map_err(self.error("vkCreateSwapchainKHR"))?;
        // Owned from here on, so that a failure below does not leak it.
        let swapchain = self.swapchain.insert(SurfaceSwapchain {
            handle,
            extent,
            images: Vec::new(),
            drawn: Vec::new(),
            free: Vec::new(),
            is_used: false,
        });
        // SAFETY: the swapchain was just made.
        swapchain.images = unsafe { self.swapchains.get_swapchain_images(handle) }
            .map_err(Error::vulkan("vkGetSwapchainImagesKHR", "the window"))?;
        let images = swapchain.images.clone();
        self.gpu.name(handle, "window");
        for (index, &image) in images.iter().enumerate() {
            self.gpu.name(image, &format!("window image {index}"));
            let drawn = self.semaphore(&format!("window image {index} is drawn"))?;
            self.swapchain.iter_mut().for_each(|s| s.drawn.push(drawn));
        }
        for slot in 0..self.in_flight {
            let free = self.semaphore(&format!("window image of frame {slot} is free"))?;
            self.swapchain.iter_mut().for_each(|s| s.free.push(free));
        }
        self.rebuilt += 1;
        tracing::debug!(
            "swapchain {} x {}, {} images",
            extent.width,
            extent.height,
            images.len()
        );
        Ok(())
    }

    /// The format nearest to the renderer's bytes: without an sRGB encoding, which would change them.
    fn choose_format(
        &self,
        formats: &[vk::SurfaceFormatKHR],
    ) -> Result<vk::SurfaceFormatKHR, Error> {
        choose_format(formats, |format| {
            // SAFETY: the physical device belongs to the instance.
            let properties = unsafe {
                self.gpu
                    .instance
                    .get_physical_device_format_properties(self.gpu.physical, format)
            };
            properties
                .optimal_tiling_features
                .contains(vk::FormatFeatureFlags::BLIT_DST)
        })
        .ok_or_else(|| self.unusable("it offers no format that a picture can be copied to"))
    }

    /// An image to present the frame of ring slot `slot` on; `None` when the window has no area or gives no
    /// image for now. The last frame of that slot must have finished.
    ///
    /// Rebuilds the swapchain when the window has changed, and the surface when it was lost.
    ///
    /// # Errors
    /// When the device is lost or cannot present any more.
    pub fn acquire(
        &mut self,
        window: &glfw::Window,
        slot: usize,
    ) -> Result<Option<AcquiredImage>, Error> {
        let (width, height) = framebuffer(window);
        if width == 0 || height == 0 {
            return Ok(None);
        }
        // A window that is being resized can outrun a few swapchains; the next frame tries again.
        for _ in 0..3 {
            let fits = self
                .swapchain
                .as_ref()
                .is_some_and(|s| (s.extent.width, s.extent.height) == (width, height));
            if self.is_stale || self.is_lost || !fits {
                match self.rebuild(window) {
                    Err(Error::Vulkan {
                        result: vk::Result::ERROR_SURFACE_LOST_KHR,
                        ..
                    }) => {
                        self.is_lost = true;
                        continue;
                    }
                    other => other?,
                }
            }
            let Some(swapchain) = &self.swapchain else {
                return Ok(None);
            };
            let free = swapchain.free[slot % swapchain.free.len()];
            let result = match self.injected.take() {
                Some(result) => Err(result),
                // SAFETY: the swapchain is alive; the semaphore is not signalled and nothing waits for it,
                // because the frame that did has finished.
                None => unsafe {
                    self.swapchains.acquire_next_image(
                        swapchain.handle,
                        PATIENCE_NS,
                        free,
                        vk::Fence::null(),
                    )
                },
            };
            match result {
                Ok((index, is_suboptimal)) => {
                    // Still to be presented on; the one after it comes from a new swapchain.
                    self.is_stale = is_suboptimal && swapchain.is_used;
                    return Ok(Some(AcquiredImage {
                        image: swapchain.images[index as usize],
                        free,
                        drawn: swapchain.drawn[index as usize],
                        index,
                        width: swapchain.extent.width,
                        height: swapchain.extent.height,
                    }));
                }
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.is_stale = true,
                Err(vk::Result::ERROR_SURFACE_LOST_KHR) => self.is_lost = true,
                Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(None),
                Err(result) => {
                    return Err(Error::vulkan("vkAcquireNextImageKHR", "the window")(result));
                }
            }
        }
        Ok(None)
    }

    /// Shows an acquired image once the frame submitted onto it has finished. Returns whether it is shown:
    /// not when the window has changed meanwhile, and the frame must be drawn again.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn present(&mut self, acquired: AcquiredImage) -> Result<bool, Error> {
        let Some(swapchain) = &mut self.swapchain else {
            return Ok(false);
        };
        let was_used = std::mem::replace(&mut swapchain.is_used, true);
        let (handles, indices, waits) = ([swapchain.handle], [acquired.index], [acquired.drawn]);
        let info = vk::PresentInfoKHR::default()
            .swapchains(&handles)
            .image_indices(&indices)
            .wait_semaphores(&waits);
        let result = {
            let queue = lock(&self.gpu.queue);
            // SAFETY: the queue is locked; the image was acquired from this swapchain (rebuilding consumes or
            // abandons it first) and a submitted frame signals the semaphore.
            unsafe { self.swapchains.queue_present(*queue, &info) }
        };
        match result {
            Ok(is_suboptimal) => {
                self.is_stale |= is_suboptimal && was_used;
                Ok(!self.is_stale)
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.is_stale = true;
                Ok(false)
            }
            Err(vk::Result::ERROR_SURFACE_LOST_KHR) => {
                self.is_lost = true;
                Ok(false)
            }
            Err(result) => {
                // The image may still be acquired and its semaphore signalled: both go with the swapchain.
                self.is_stale = true;
                Err(Error::vulkan("vkQueuePresentKHR", "the window")(result))
            }
        }
    }

    /// Gives up an acquired image whose frame could not be submitted: swapchain and semaphores are made anew,
    /// because the semaphore of the image stays signalled.
    pub fn abandon(&mut self, acquired: AcquiredImage) {
        let _ = acquired;
        self.drop_swapchain();
    }
}

impl Drop for WindowSurface {
    fn drop(&mut self) {
        self.drop_surface();
    }
}

fn framebuffer(window: &glfw::Window) -> (u32, u32) {
    let (width, height) = window.get_framebuffer_size();
    (
        u32::try_from(width).unwrap_or(0),
        u32::try_from(height).unwrap_or(0),
    )
}

/// The mode for `vsync`: FIFO, which every device has; without it mailbox, then immediate.
fn choose_mode(vsync: bool, modes: &[vk::PresentModeKHR]) -> vk::PresentModeKHR {
    let wanted = [vk::PresentModeKHR::MAILBOX, vk::PresentModeKHR::IMMEDIATE];
    wanted
        .into_iter()
        .find(|mode| !vsync && modes.contains(mode))
        .unwrap_or(vk::PresentModeKHR::FIFO)
}

/// The surface's own size where it has one, else the window's within the limits.
fn choose_extent(
    capabilities: &vk::SurfaceCapabilitiesKHR,
    (width, height): (u32, u32),
) -> vk::Extent2D {
    if capabilities.current_extent.width != u32::MAX {
        return capabilities.current_extent;
    }
    let (min, max) = (capabilities.min_image_extent, capabilities.max_image_extent);
    vk::Extent2D {
        width: width.min(max.width).max(min.width),
        height: height.min(max.height).max(min.height),
    }
}

/// One image more than the least, so that acquiring does not wait for the one on screen.
fn choose_count(capabilities: &vk::SurfaceCapabilitiesKHR) -> u32 {
    let wanted = capabilities.min_image_count + 1;
    match capabilities.max_image_count {
        0 => wanted,
        max => wanted.min(max),
    }
}

/// The first format that can be blitted to, those that keep the bytes first.
fn choose_format(
    formats: &[vk::SurfaceFormatKHR],
    can_blit_to: impl Fn(vk::Format) -> bool,
) -> Option<vk::SurfaceFormatKHR> {
    let rank = |f: &vk::SurfaceFormatKHR| {
        let space = f.color_space != vk::ColorSpaceKHR::SRGB_NONLINEAR;
        let format = match f.format {
            vk::Format::B8G8R8A8_UNORM => 0,
            vk::Format::R8G8B8A8_UNORM | vk::Format::A8B8G8R8_UNORM_PACK32 => 1,
            vk::Format::A2B10G10R10_UNORM_PACK32 | vk::Format::A2R10G10B10_UNORM_PACK32 => 2,
            _ => 3,
        };
        (space, format)
    };
    let best = formats
        .iter()
        .filter(|f| can_blit_to(f.format))
        .min_by_key(|f| rank(f))
        .copied()?;
    if rank(&best) >= (false, 3) {
        tracing::warn!(
            "the window offers no plain 8-bit format; {:?} may look different from the picture",
            best.format
        );
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(format: vk::Format) -> vk::SurfaceFormatKHR {
        vk::SurfaceFormatKHR {
            format,
            color_space: vk::ColorSpaceKHR::SRGB_NONLINEAR,
        }
    }

    #[test]
    fn the_format_that_keeps_the_bytes_is_preferred() {
        let srgb = format(vk::Format::B8G8R8A8_SRGB);
        let rgba = format(vk::Format::R8G8B8A8_UNORM);
        let bgra = format(vk::Format::B8G8R8A8_UNORM);
        let wide = vk::SurfaceFormatKHR {
            color_space: vk::ColorSpaceKHR::EXTENDED_SRGB_LINEAR_EXT,
            ..bgra
        };
        let all = |_| true;
        assert_eq!(choose_format(&[srgb, wide, rgba, bgra], all), Some(bgra));
        assert_eq!(choose_format(&[srgb, wide, rgba], all), Some(rgba));
        assert_eq!(choose_format(&[wide, srgb], all), Some(srgb));
        let not_bgra = |f| f != vk::Format::B8G8R8A8_UNORM;
        assert_eq!(choose_format(&[bgra, rgba], not_bgra), Some(rgba));
        assert_eq!(choose_format(&[bgra], |_| false), None);
    }

    #[test]
    fn modes_follow_vsync_and_what_there_is() {
        use vk::PresentModeKHR as M;
        let all = [M::IMMEDIATE, M::MAILBOX, M::FIFO, M::FIFO_RELAXED];
        assert_eq!(choose_mode(true, &all), M::FIFO);
        assert_eq!(choose_mode(false, &all), M::MAILBOX);
        assert_eq!(choose_mode(false, &[M::FIFO, M::IMMEDIATE]), M::IMMEDIATE);
        assert_eq!(choose_mode(false, &[M::FIFO]), M::FIFO);
    }

    #[test]
    fn sizes_and_counts_keep_to_the_limits() {
        let extent = |width, height| vk::Extent2D { width, height };
        let mut c = vk::SurfaceCapabilitiesKHR {
            min_image_count: 3,
            max_image_count: 0,
            current_extent: extent(64, 48),
            min_image_extent: extent(16, 16),
            max_image_extent: extent(100, 100),
            ..vk::SurfaceCapabilitiesKHR::default()
        };
        assert_eq!(choose_extent(&c, (1, 1)), extent(64, 48));
        assert_eq!(choose_count(&c), 4);
        c.max_image_count = 3;
        assert_eq!(choose_count(&c), 3);
        c.current_extent = extent(u32::MAX, u32::MAX);
        assert_eq!(choose_extent(&c, (500, 2)), extent(100, 16));
    }
}
