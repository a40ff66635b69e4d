//! Pixels of the splats of a list, and what they show.

/// Pixels of splats, counted from the corner of the rectangle: numbers of one kind in a list each. Words of two numbers have x in their
/// lower half. What has no pixels ends before it begins.
#[derive(Debug, Default)]
pub(super) struct SplatPixels {
    first: Vec<i32>,
    /// One past the last.
    end: Vec<i32>,
    /// Reversed depth, as bits.
    depth: Vec<f32>,
    /// What they look like, where that is asked for.
    colors: Vec<i32>,
}

/// Some of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct FoundPixels<'a> {
    pub(super) first: &'a [i32],
    pub(super) end: &'a [i32],
    pub(super) depth: &'a [f32],
    /// What their pixels show.
    pub(super) shown: &'a [i32],
}

/// Some of them, to be found.
#[derive(Debug, Default)]
pub(super) struct PixelSearch<'a> {
    pub(super) first: &'a mut [i32],
    pub(super) end: &'a mut [i32],
    pub(super) depth: &'a mut [f32],
    pub(super) colors: &'a mut [i32],
}

impl SplatPixels {
    /// The first so many, whatever was in them.
    pub(super) fn first(&mut self, count: usize) -> PixelSearch<'_> {
        let all = count.max(self.first.len());
        self.first.resize(all, 0);
        self.end.resize(all, 0);
        self.depth.resize(all, 0.0);
        self.colors.resize(all, 0);
        PixelSearch {
            first: &mut self.first[..count],
            end: &mut self.end[..count],
            depth: &mut self.depth[..count],
            colors: &mut self.colors[..count],
        }
    }

    /// What those that were found look like, by their number.
    pub(super) fn colors(&self) -> &[i32] {
        &self.colors
    }

    /// The same, to be found.
    pub(super) fn colors_mut(&mut self) -> &mut [i32] {
        &mut self.colors
    }
}

impl<'a> PixelSearch<'a> {
    /// The first so many, which are no longer among them.
    pub(super) fn split(&mut self, count: usize) -> Self {
        let Self {
            first,
            end,
            depth,
            colors,
        } = std::mem::take(self);
        let (first, end, depth, colors) = (
            first.split_at_mut(count),
            end.split_at_mut(count),
            depth.split_at_mut(count),
            colors.split_at_mut(count),
        );
        *self = Self {
            first: first.1,
            end: end.1,
            depth: depth.1,
            colors: colors.1,
        };
        Self {
            first: first.0,
            end: end.0,
            depth: depth.0,
            colors: colors.0,
        }
    }

    /// All of them, for a while.
    pub(super) fn again(&mut self) -> PixelSearch<'_> {
        PixelSearch {
            first: self.first,
            end: self.end,
            depth: self.depth,
            colors: self.colors,
        }
    }

    pub(super) fn found(self) -> FoundPixels<'a> {
        FoundPixels {
            first: self.first,
            end: self.end,
            depth: self.depth,
            shown: self.colors,
        }
    }
}
