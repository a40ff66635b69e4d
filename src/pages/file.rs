//! Reads the pages of a paged file.

use super::format::{
    CLOSED, COLORS, HEADER, LARGEST_PAGE, PATCHES, PageEntry, PageError, PagedHeader, TRIANGLES,
};
use super::page::{DecodeOptions, DecodedPage, decode};
use super::source::ByteSource;
use crate::tree::file::hash;
use crate::tree::{Model, Tree};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// An open paged file: its header. Pages are read when they are asked for.
#[derive(Debug, Clone)]
pub struct PagedFile {
    source: Arc<dyn ByteSource>,
    header: PagedHeader,
}

impl PagedFile {
    /// Reads the header, and nothing else.
    ///
    /// # Errors
    /// The source does not give it, or it is damaged.
    pub fn open(source: Arc<dyn ByteSource>) -> Result<Self, PageError> {
        let damaged = |offset: u64, cause: String| PageError::Damaged {
            name: source.name().to_owned(),
            page: None,
            offset,
            cause,
        };
        if source.len() < HEADER as u64 {
            return Err(damaged(source.len(), "ends within its header".to_owned()));
        }
        let mut header = PagedHeader::zeroed();
        let start = bytemuck::bytes_of_mut(&mut header);
        source.read_at(0, start).map_err(|error| PageError::Io {
            name: source.name().to_owned(),
            offset: 0,
            end: HEADER as u64,
            cause: error.to_string(),
        })?;
        if cfg!(target_endian = "big") {
            let cause = "paged files are little-endian; this machine is not";
            return Err(damaged(0, cause.to_owned()));
        }
        header
            .validate(source.len())
            .map_err(|(offset, cause)| damaged(offset, cause))?;
        Ok(Self { source, header })
    }

    /// What the file says of itself.
    pub fn header(&self) -> &PagedHeader {
        &self.header
    }

    /// Name for messages.
    pub fn name(&self) -> &str {
        self.source.name()
    }

    /// The first page; `None` in a model without leaves.
    pub fn root(&self) -> Option<PageEntry> {
        (self.header.root.bytes > 0).then_some(self.header.root)
    }

    /// Whether leaves are triangles.
    pub fn is_surface(&self) -> bool {
        self.header.flags & TRIANGLES != 0
    }

    /// Whether the surface is closed and oriented outward.
    pub fn is_closed(&self) -> bool {
        self.header.flags & CLOSED != 0
    }

    /// Whether there are colors.
    pub fn has_colors(&self) -> bool {
        self.header.flags & COLORS != 0
    }

    /// Tells whether nodes have records of error patches.
    pub fn has_patches(&self) -> bool {
        self.header.flags & PATCHES != 0
    }

    /// World position of the model-space zero.
    pub fn origin(&self) -> DVec3 {
        DVec3::from_array(self.header.origin)
    }

    /// A model with the nodes of the first page, and the box and sphere of the whole file, in coordinates around `origin`
    /// (world space): for whatever asks where the model is and how large. Its leaves stand for pages.
    ///
    /// # Errors
    /// As [`PagedFile::read_page`].
    pub fn stand_in(&self, origin: DVec3) -> Result<Model, PageError> {
        let options = DecodeOptions {
            moments: true,
            model_origin: Some(origin),
        };
        let header = &self.header;
        let first = self.root().map(|root| self.read_page(&root, options));
        let model = first
            .transpose()?
            .map_or_else(without_leaves, |page| page.model);
        let shift = self.origin() - origin;
        let moved = |place: [f32; 3]| (shift + Vec3::from_array(place).as_dvec3()).as_vec3();
        Ok(Model {
            origin,
            min: moved(header.min),
            max: moved(header.max),
            orbit_center: moved(header.orbit_center),
            orbit_radius: header.orbit_radius,
            is_closed: self.is_closed(),
            has_colors: self.has_colors(),
            ..model
        })
    }

    /// Number of reads that are done at once where many are wanted.
    pub fn parallel_reads(&self) -> usize {
        self.source.parallel_reads()
    }

    /// Reads and decodes a page. Its bytes are asked for only where the file has them.
    ///
    /// # Errors
    /// The source does not give it, its checksum is another, or it is damaged: also where a page below it does not lie
    /// behind it and within the file.
    pub fn read_page(
        &self,
        entry: &PageEntry,
        options: DecodeOptions,
    ) -> Result<DecodedPage, PageError> {
        self.check_place(entry)?;
        let bytes = self.read_range(entry.offset, entry.end())?;
        self.decode_page(entry, &bytes, options)
    }

    /// Reads pages that lie in the file one after the other, gaps between them included, by one read of the source, and decodes
    /// each.
    pub fn read_neighbors(
        &self,
        entries: &[PageEntry],
        options: DecodeOptions,
    ) -> Vec<Result<DecodedPage, PageError>> {
        let is_sound = entries.iter().all(|entry| self.check_place(entry).is_ok())
            && entries.windows(2).all(|two| two[0].end() <= two[1].offset);
        let (Some(first), Some(last), true) = (entries.first(), entries.last(), is_sound) else {
            return entries
                .iter()
                .map(|entry| self.read_page(entry, options))
                .collect();
        };
        let start = first.offset;
        match self.read_range(start, last.end()) {
            Ok(bytes) => {
                let of_page = |entry: &PageEntry| {
                    let own = (entry.offset - start) as usize..(entry.end() - start) as usize;
                    self.decode_page(entry, &bytes[own], options)
                };
                entries.iter().map(of_page).collect()
            }
            Err(error) => entries.iter().map(|_| Err(error.clone())).collect(),
        }
    }

    /// Checks that the file has a page's bytes, before memory is asked for.
    fn check_place(&self, entry: &PageEntry) -> Result<(), PageError> {
        let is_there = entry.bytes <= LARGEST_PAGE
            && entry.offset >= HEADER as u64
            && entry.end() <= self.header.file_length
            && u64::from(entry.id) < self.header.page_count;
        match is_there {
            true => Ok(()),
            false => Err(self.damaged_page(
                entry,
                0,
                format!("{} bytes, which the file does not have", entry.bytes),
            )),
        }
    }

    fn damaged_page(&self, entry: &PageEntry, at: u64, cause: String) -> PageError {
        PageError::Damaged {
            name: self.name().to_owned(),
            page: Some(entry.id),
            offset: entry.offset.saturating_add(at),
            cause,
        }
    }

    fn read_range(&self, offset: u64, end: u64) -> Result<Vec<u8>, PageError> {
        let mut bytes = vec![0; (end - offset) as usize];
        match self.source.read_at(offset, &mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) => Err(PageError::Io {
                name: self.name().to_owned(),
                offset,
                end,
                cause: error.to_string(),
            }),
        }
    }

    /// Decodes the bytes of a page.
    fn decode_page(
        &self,
        entry: &PageEntry,
        bytes: &[u8],
        options: DecodeOptions,
    ) -> Result<DecodedPage, PageError> {
        let damaged = |at: u64, cause: String| self.damaged_page(entry, at, cause);
        let end = entry.end();
        if hash(bytes) != entry.checksum {
            return Err(damaged(0, "the checksum is wrong".to_owned()));
        }
        let mut page = decode(bytes, self.origin(), options)
            .map_err(|(at, cause)| damaged(at as u64, cause))?;
        if let Some(below) = &page.children {
            let (first, last) = (below.entries.first(), below.entries.last());
            let is_forward = first.is_none_or(|child| child.offset >= end && child.id > entry.id)
                && last.is_none_or(|child| {
                    child.end() <= self.header.file_length
                        && u64::from(child.id) < self.header.page_count
                });
            if !is_forward {
                let cause = "pages below it that do not lie behind it and in the file";
                return Err(damaged(24, cause.to_owned()));
            }
        } else {
            let is_surface = !page.model.triangles.is_empty();
            if is_surface != self.is_surface() || page.model.has_colors != self.has_colors() {
                let cause = "leaves of another kind than the header says";
                return Err(damaged(0, cause.to_owned()));
            }
            page.model.is_closed = self.is_closed();
        }
        if page.model.patches.is_some() != self.has_patches() {
            let cause =
                "records of patches that the header does not know, or none where it says some";
            return Err(damaged(4, cause.to_owned()));
        }
        let page = match options.model_origin {
            Some(origin) => page.in_model_space(origin),
            None => page,
        };
        // Moved by its place in the file, a sphere can leave single precision.
        let model = &page.model;
        let reach = model.orbit_center.as_dvec3() + page.base;
        let is_near = |center: Vec3| (center.as_dvec3() + page.base).as_vec3().is_finite();
        if !reach.as_vec3().is_finite()
            || !(model.tree.nodes.iter())
                .all(|node| is_near(node.center) && node.radius.is_finite())
            || !(model.tree.leaves.iter())
                .all(|leaf| is_near(leaf.center) && leaf.radius.is_finite())
        {
            return Err(damaged(0, "a sphere that is not finite".to_owned()));
        }
        Ok(page)
    }
}

/// A model of nothing, whose links hold.
fn without_leaves() -> Model {
    Model {
        tree: Tree {
            level_starts: vec![0],
            ..Tree::default()
        },
        ..Model::default()
    }
}
