//! The paged file: its header, the entries of its directory, and errors.
//!
//! Little-endian. The header stands first; then the pages, breadth-first: the page with the root, those below it, and so
//! on, so that any prefix of the file is a coarse whole model. The directory is itself paged: a page has the entries of
//! those below it, and the header that of the first. So a file of any size opens with two small reads, and the checksum of
//! a page is under that of the page above it.

use crate::tree::file::hash;
use bytemuck::{Pod, Zeroable};
use std::path::PathBuf;

/// First bytes of a paged file.
pub const MAGIC: [u8; 8] = *b"surfel\x1aP";
/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 1;

/// Bit of the header's flags: closed and oriented outward.
pub const CLOSED: u32 = 1;
/// Bit of the header's flags: vertices have colors.
pub const COLORS: u32 = 2;
/// Bit of the header's flags: leaves are triangles, not points.
pub const TRIANGLES: u32 = 4;

/// Bit of the header's flags: nodes have records of error patches.
pub const PATCHES: u32 = 8;

/// Bit of the header's flags: the file joins trees of other files, whose table follows the header.
pub const FOREST: u32 = 16;

/// Largest page in bytes, so that no entry can ask for much memory.
pub const LARGEST_PAGE: u32 = 1 << 26;
/// Most leaves and most vertices of a page.
pub const MOST_LEAVES: usize = 1 << 16;
/// Most levels of a page.
pub const MOST_LEVELS: usize = 16;

/// Tells whether a file beginning with these bytes is a paged file.
pub fn is_paged_file(start: &[u8]) -> bool {
    start.starts_with(&MAGIC)
}

/// What the header says about the model, with the entry of the first page.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PagedHeader {
    pub(super) magic: [u8; 8],
    pub(super) version: u32,
    /// [`CLOSED`], [`COLORS`], [`TRIANGLES`], [`PATCHES`], [`FOREST`].
    pub flags: u32,
    /// Bytes of the file.
    pub file_length: u64,
    /// Leaves of the model.
    pub leaf_count: u64,
    /// Interior nodes of the model.
    pub node_count: u64,
    /// World position of the model-space zero.
    pub origin: [f64; 3],
    /// Smallest corner of the box of the vertices, model space.
    pub min: [f32; 3],
    /// Largest corner.
    pub max: [f32; 3],
    /// Center of the box.
    pub orbit_center: [f32; 3],
    /// Largest distance of a vertex from it.
    pub orbit_radius: f32,
    /// Number of pages.
    pub page_count: u64,
    /// Entry of the first page; its bytes are 0 in a model without leaves.
    pub root: PageEntry,
    pub(super) checksum: u64,
}

/// Bytes of the header.
pub const HEADER: usize = size_of::<PagedHeader>();

impl PagedHeader {
    /// The checksum of the rest.
    pub(super) fn own_checksum(&self) -> u64 {
        hash(&bytemuck::bytes_of(self)[..HEADER - 8])
    }

    /// What is wrong with a header of a file of `length` bytes.
    ///
    /// # Errors
    /// The first fault, with its byte.
    pub(super) fn validate(&self, length: u64) -> Result<(), (u64, String)> {
        if self.magic != MAGIC {
            return Err((0, "not a paged tree file".to_owned()));
        }
        if self.version != VERSION {
            let cause = format!(
                "version {} of the paged format; this program reads version {VERSION}: build the file again",
                self.version
            );
            return Err((8, cause));
        }
        if self.checksum != self.own_checksum() {
            return Err((0, "the header's checksum is wrong".to_owned()));
        }
        if self.file_length != length {
            let cause = format!(
                "the file has {length} bytes, its header says {}",
                self.file_length
            );
            return Err((length.min(self.file_length), cause));
        }
        if self.flags & !(CLOSED | COLORS | TRIANGLES | PATCHES | FOREST) != 0
            || self.flags & (TRIANGLES | PATCHES) == PATCHES
            || self.flags & (FOREST | PATCHES) == FOREST | PATCHES
        {
            return Err((12, "unknown flags".to_owned()));
        }
        let numbers = [self.min, self.max, self.orbit_center];
        let is_finite = numbers.iter().flatten().all(|v| v.is_finite())
            && self.origin.iter().all(|v| v.is_finite())
            && self.orbit_radius >= 0.0;
        if !is_finite {
            return Err((48, "a box or an origin that is not finite".to_owned()));
        }
        if (self.leaf_count == 0) != (self.root.bytes == 0) {
            return Err((
                24,
                "leaves without a page, or a page without leaves".to_owned(),
            ));
        }
        // A page has 24 bytes at least.
        if self.page_count > length / 24 {
            return Err((24, "more pages than the file has room for".to_owned()));
        }
        Ok(())
    }
}

/// Where a page lies, and what its bytes add up to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PageEntry {
    /// Number of the page: pages are numbered as they lie in the file.
    pub id: u32,
    /// Length of the page.
    pub bytes: u32,
    /// First byte in the file.
    pub offset: u64,
    /// Checksum of its bytes.
    pub checksum: u64,
}

impl PageEntry {
    /// Past its last byte.
    pub fn end(&self) -> u64 {
        self.offset.saturating_add(u64::from(self.bytes))
    }
}

/// Why a paged file, or a page of one, cannot be read.
#[derive(Debug, Clone, thiserror::Error)]
pub enum PageError {
    /// The source does not give the bytes.
    #[error("{name}, bytes {offset} to {end}: {cause}")]
    Io {
        /// The file.
        name: String,
        /// First byte of the range.
        offset: u64,
        /// Past its last byte.
        end: u64,
        /// What the system says.
        cause: String,
    },
    /// The bytes are not what they should be.
    #[error("{name}, byte {offset}{}: {cause}", page.map_or(String::new(), |id| format!(" (page {id})")))]
    Damaged {
        /// The file.
        name: String,
        /// The page; `None` for the header.
        page: Option<u32>,
        /// Where, in the file.
        offset: u64,
        /// What is wrong.
        cause: String,
    },
}

impl From<PageError> for crate::tree::Error {
    fn from(error: PageError) -> Self {
        match error {
            PageError::Io {
                name,
                offset,
                end,
                cause,
            } => Self::File {
                path: PathBuf::from(name),
                offset,
                cause: format!("bytes to {end} cannot be read: {cause}"),
            },
            PageError::Damaged {
                name,
                page,
                offset,
                cause,
            } => Self::File {
                path: PathBuf::from(name),
                offset,
                cause: match page {
                    Some(id) => format!("page {id}: {cause}"),
                    None => cause,
                },
            },
        }
    }
}
