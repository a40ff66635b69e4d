//! Contents of pictures.

/// Contents of a picture besides color.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PictureOutputs {
    /// Fill [`Image::depth`](crate::image::Image::depth): view-space distance at each pixel center (of a splat or point: of
    /// its center).
    pub depth: bool,
    /// Fill [`Image::normal`](crate::image::Image::normal): the world-space unit normal that was shaded; zero where the
    /// surface has none.
    pub normal: bool,
    /// Fill [`Image::values`](crate::image::Image::values): the colors before they are rounded to eight bits. On a device the
    /// color target is one of 32-bit floats then. Visibility splats have none: they are put together from pixels of eight
    /// bits.
    pub values: bool,
}
