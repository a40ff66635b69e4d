//! Abilities of a renderer, as far as they decide how a frame is drawn.

/// Limits and abilities of the renderer that a frame is planned for, and what of the model fits it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RendererCapabilities {
    /// Largest size of a point, pixels; infinite without a limit.
    pub(crate) max_point_px: f32,
    /// Splats of more pixels have no wider guard band.
    pub(crate) largest_guarded_px: f32,
    /// Above this threshold, pixels, splats are drawn sooner than those that are hidden are found.
    pub(crate) largest_hidden_px: f32,
    /// The device is the processor: memory of its own is the processor's, and what compute does costs the processor's time.
    pub(crate) is_software: bool,
    /// 64-bit atomics on storage buffers, without which nothing is drawn by compute.
    pub(crate) has_int64_atomics: bool,
    /// Largest range of a storage binding, bytes.
    pub(crate) max_storage_range: u64,
    /// Vertices of each page of the model fit a storage binding.
    pub(crate) binds_vertices: bool,
    /// Draws whose arguments the device wrote may begin at any instance.
    pub(crate) has_first_instance: bool,
    /// The device chose cuts sooner than the host when that was measured.
    pub(crate) cuts_sooner: bool,
    /// The lists of a cut by the device fit its memory, as far as was tried.
    pub(crate) fits_device_cut: bool,
    /// Lists of filtered splats do, which are larger.
    pub(crate) fits_filtered_cut: bool,
    /// The tree fits its memory, as far as was tried.
    pub(crate) fits_tree: bool,
}

impl RendererCapabilities {
    /// Capabilities of the processor's own renderer.
    pub(crate) const PROCESSOR: Self = Self {
        max_point_px: f32::INFINITY,
        largest_guarded_px: 254.0,
        largest_hidden_px: 1.0,
        is_software: true,
        has_int64_atomics: false,
        max_storage_range: 0,
        binds_vertices: false,
        has_first_instance: false,
        cuts_sooner: false,
        fits_device_cut: false,
        fits_filtered_cut: false,
        fits_tree: false,
    };

    /// Capabilities of the reference: it has no limit, and its time decides nothing.
    pub(crate) const REFERENCE: Self = Self {
        largest_hidden_px: f32::INFINITY,
        ..Self::PROCESSOR
    };
}
