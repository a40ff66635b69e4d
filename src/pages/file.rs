//! Reads the pages of a paged file.

use super::forest_table::{self, ForestEntry};
use super::format::{
    CLOSED, COLORS, FOREST, HEADER, LARGEST_PAGE, PATCHES, PageEntry, PageError, PagedHeader,
    TRIANGLES,
};
#[cfg(feature = "remote")]
use super::http::HttpSource;
use super::page::{DecodeOptions, DecodedPage, decode};
use super::source::ByteSource;
use crate::tree::file::hash;
use crate::tree::{Model, Tree};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use std::sync::{Arc, Mutex, PoisonError};

/// An open paged file: its header. Pages are read when they are asked for.
///
/// A forest joins the trees of other files, its members: a few pages of its own stand above their first pages. Its pages are
/// numbered on through all members, and their places go on behind its own last byte, as if all were one file.
#[derive(Debug, Clone)]
pub struct PagedFile {
    source: Arc<dyn ByteSource>,
    header: PagedHeader,
    root: PageEntry,
    members: Arc<Vec<MemberFile>>,
}

/// A file whose tree a forest has. It is opened when a page of it is asked for.
#[derive(Debug)]
struct MemberFile {
    entry: ForestEntry,
    /// What is added to numbers and places of its pages.
    first_id: u32,
    first_byte: u64,
    open: Mutex<Option<PagedFile>>,
}

impl MemberFile {
    /// A page of the member by its number and place in the forest.
    fn own(&self, entry: &PageEntry) -> PageEntry {
        PageEntry {
            id: entry.id.saturating_sub(self.first_id),
            offset: entry.offset.saturating_sub(self.first_byte),
            ..*entry
        }
    }

    /// A page of the forest by its number and place in the member; past the last number stays past it.
    fn shifted(&self, entry: &PageEntry) -> PageEntry {
        PageEntry {
            id: entry.id.saturating_add(self.first_id),
            offset: entry.offset.saturating_add(self.first_byte),
            ..*entry
        }
    }
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
        let mut file = Self {
            source,
            header,
            root: header.root,
            members: Arc::default(),
        };
        if header.flags & FOREST != 0 {
            file.read_members()?;
        }
        Ok(file)
    }

    /// Reads the table of a forest.
    fn read_members(&mut self) -> Result<(), PageError> {
        let damaged = |cause: String| PageError::Damaged {
            name: self.name().to_owned(),
            page: None,
            offset: HEADER as u64,
            cause,
        };
        let end = self.header.root.offset;
        if end < HEADER as u64 || end > self.header.file_length {
            return Err(damaged(
                "a table of files that the file does not have".to_owned(),
            ));
        }
        let bytes = self.read_range(HEADER as u64, end)?;
        let entries = forest_table::decode(&bytes, &self.header).map_err(damaged)?;
        let mut members = Vec::new();
        let (mut first_id, mut first_byte) = (self.header.page_count, self.header.file_length);
        for entry in entries {
            let next = (
                first_id + entry.header.page_count,
                first_byte + entry.header.file_length,
            );
            members.push(MemberFile {
                entry,
                first_id: first_id as u32,
                first_byte,
                open: Mutex::default(),
            });
            (first_id, first_byte) = next;
        }
        self.members = Arc::new(members);
        self.root = self.translated(&self.header.root);
        Ok(())
    }

    /// A page that a page of this file names: in a forest the number past its own pages is that of a member.
    fn translated(&self, entry: &PageEntry) -> PageEntry {
        let index = u64::from(entry.id).checked_sub(self.header.page_count);
        match index.and_then(|index| self.members.get(index as usize)) {
            Some(member) => member.shifted(&member.entry.header.root),
            None => *entry,
        }
    }

    /// The member that has a page, by its place.
    fn member_index(&self, entry: &PageEntry) -> Option<usize> {
        let behind = |member: &MemberFile| member.first_byte <= entry.offset;
        self.members.partition_point(behind).checked_sub(1)
    }

    /// Opens the file of a member, unless it is open.
    ///
    /// # Errors
    /// It cannot be read, or is another than when it was joined.
    pub fn open_member(&self, index: usize) -> Result<Self, PageError> {
        let member = &self.members[index];
        // Nothing panics while it holds the lock.
        let mut open = member.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = &*open {
            return Ok(file.clone());
        }
        let path = &member.entry.path;
        let source = match path.contains("://") {
            true => open_address(path),
            false => self.source.beside(path),
        };
        let source = source.map_err(|error| PageError::Io {
            name: path.clone(),
            offset: 0,
            end: HEADER as u64,
            cause: error.to_string(),
        })?;
        let file = Self::open(source)?;
        if file.header != member.entry.header {
            return Err(PageError::Damaged {
                name: file.name().to_owned(),
                page: None,
                offset: 0,
                cause: format!(
                    "the file is another than the one that was joined; make {} again (surfel join)",
                    self.name()
                ),
            });
        }
        *open = Some(file.clone());
        Ok(file)
    }

    /// Names of the files whose trees a forest has; none of a file of its own.
    pub fn member_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.members.iter().map(|member| member.entry.path.as_str())
    }

    /// Number of all pages, those of members included.
    pub fn page_count(&self) -> u64 {
        let of_member = |member: &MemberFile| member.entry.header.page_count;
        self.header.page_count + self.members.iter().map(of_member).sum::<u64>()
    }

    /// Bytes of the file and of its members.
    pub fn total_bytes(&self) -> u64 {
        let of_member = |member: &MemberFile| member.entry.header.file_length;
        self.header.file_length + self.members.iter().map(of_member).sum::<u64>()
    }

    /// Part of the file, 0 to 1, up to the last byte of a page; of a forest, part of the file that has the page.
    pub fn part_before(&self, entry: &PageEntry) -> f64 {
        let (end, length) = match self.member_index(entry) {
            Some(index) => {
                let member = &self.members[index];
                (member.own(entry).end(), member.entry.header.file_length)
            }
            None => (entry.end(), self.header.file_length),
        };
        end as f64 / length as f64
    }

    /// The member that has a page, and the page there; `None` of pages of this file.
    pub(super) fn member_of(&self, entry: &PageEntry) -> Option<(usize, PageEntry)> {
        let index = self.member_index(entry)?;
        Some((index, self.members[index].own(entry)))
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
        (self.root.bytes > 0).then_some(self.root)
    }

    /// Tells whether leaves are triangles.
    pub fn is_surface(&self) -> bool {
        self.header.flags & TRIANGLES != 0
    }

    /// Tells whether the surface is closed and oriented outward.
    pub fn is_closed(&self) -> bool {
        self.header.flags & CLOSED != 0
    }

    /// Tells whether there are colors.
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
        if let Some((index, own)) = self.member_of(entry) {
            let page = self.open_member(index)?.read_page(&own, options)?;
            return Ok(self.of_member(index, page, options));
        }
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
        if !self.members.is_empty() {
            let is_of_one =
                |a: &PageEntry, b: &PageEntry| self.member_index(a) == self.member_index(b);
            let files = entries.chunk_by(is_of_one);
            return files
                .flat_map(|own| self.read_in_one(own, options))
                .collect();
        }
        self.read_in_one(entries, options)
    }

    /// As [`PagedFile::read_neighbors`], of pages that lie in one file.
    fn read_in_one(
        &self,
        entries: &[PageEntry],
        options: DecodeOptions,
    ) -> Vec<Result<DecodedPage, PageError>> {
        if let Some(index) = entries.first().and_then(|entry| self.member_index(entry)) {
            let own = |entry| self.members[index].own(entry);
            let own: Vec<PageEntry> = entries.iter().map(own).collect();
            return match self.open_member(index) {
                Ok(file) => (file.read_neighbors(&own, options).into_iter())
                    .map(|page| Ok(self.of_member(index, page?, options)))
                    .collect(),
                Err(error) => own.iter().map(|_| Err(error.clone())).collect(),
            };
        }
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

    /// A page of a member as one of the forest.
    fn of_member(
        &self,
        index: usize,
        mut page: DecodedPage,
        options: DecodeOptions,
    ) -> DecodedPage {
        let below = page.children.iter_mut().flat_map(|own| &mut own.entries);
        for entry in below {
            *entry = self.members[index].shifted(entry);
        }
        if options.model_origin.is_none() {
            page.base = page.model.origin - self.origin();
        }
        // Records of patches are those of whole files.
        if !self.has_patches() {
            page.model.patches = None;
        }
        page
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
        if let Some(below) = &mut page.children {
            for own in &mut below.entries {
                *own = self.translated(own);
            }
            let end_of_all = self.total_bytes();
            let (first, last) = (below.entries.first(), below.entries.last());
            let is_forward = first.is_none_or(|child| child.offset >= end && child.id > entry.id)
                && last.is_none_or(|child| {
                    child.end() <= end_of_all && u64::from(child.id) < self.page_count()
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
        if !page.is_finite() {
            return Err(damaged(0, "a sphere that is not finite".to_owned()));
        }
        Ok(page)
    }
}

/// Opens a file on a web server.
///
/// # Errors
/// What the server answers, or why it does not.
#[cfg(feature = "remote")]
pub fn open_address(url: &str) -> std::io::Result<Arc<dyn ByteSource>> {
    Ok(Arc::new(HttpSource::open(url)?))
}

/// Refuses all addresses.
///
/// # Errors
/// Always: this program has no network.
#[cfg(not(feature = "remote"))]
pub fn open_address(url: &str) -> std::io::Result<Arc<dyn ByteSource>> {
    let cause = format!("{url} is on a network, which this program was built without");
    Err(std::io::Error::new(std::io::ErrorKind::Unsupported, cause))
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
