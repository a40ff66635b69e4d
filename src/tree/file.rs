//! Tree files (`.surfel`): a built model as it lies in memory.
//!
//! Little-endian. A header with everything that is not an array, a table of sections, a checksum of both; then the
//! arrays, each at a multiple of 64 bytes, zeros between them. Every section has its own checksum, which any changed
//! word changes for certain and any other damage with a probability of all but 2^-64. A reader believes nothing: lengths
//! are compared with the file before memory is asked for, and all links are tested before the model is handed out.

use super::{
    AlignedRecords, Error, Leaf, Model, NodeAttributes, PackedPatch, PackedPatchColors,
    PatchRecords, SurfaceMoments, Tree, check, framed,
};
use crate::abi::Vertex;
use crate::progress::{Progress, SilentProgress};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::ops::DerefMut;
use std::path::Path;
use std::sync::Arc;

#[cfg(test)]
mod tests;

/// Ending of tree files, without the dot.
pub const EXTENSION: &str = "surfel";

/// First bytes of a tree file. The control characters show a transfer in text mode.
pub const MAGIC: [u8; 8] = *b"surfel\x1a\n";
/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 2;

const SECTIONS: usize = 9;
const ALIGNMENT: u64 = 64;
const NAMES: [&str; SECTIONS + MORE_SECTIONS] = [
    "vertices",
    "triangles",
    "nodes",
    "node attributes",
    "parents",
    "first leaves",
    "level starts",
    "leaves",
    "moments",
    "patches",
    "colors of patches",
];

/// Sections that a file may have after those, named in a table of their own.
const MORE_SECTIONS: usize = 2;

const CLOSED: u32 = 1;
const COLORS: u32 = 2;
/// Flag: a [`PatchTable`] follows the last section, and its sections after it.
const PATCHES: u32 = 4;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TreeHeader {
    magic: [u8; 8],
    version: u32,
    flags: u32,
    file_length: u64,
    origin: [f64; 3],
    min: [f32; 3],
    max: [f32; 3],
    orbit_center: [f32; 3],
    orbit_radius: f32,
    used_vertices: u32,
    section_count: u32,
    sections: [FileSection; SECTIONS],
    /// Of all bytes before.
    checksum: u64,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct FileSection {
    /// Bytes from the beginning of the file.
    offset: u64,
    /// Number of elements.
    count: u64,
    /// Bytes of an element.
    stride: u64,
    checksum: u64,
}

/// Records of error patches and their colors, after the sections that every file has.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PatchTable {
    sections: [FileSection; MORE_SECTIONS],
    /// Of all bytes before.
    checksum: u64,
}

const HEADER: usize = size_of::<TreeHeader>();

/// Places of what a file holds after its header.
struct FileLayout<'a> {
    end: u64,
    /// Offsets and bytes.
    pieces: Vec<(u64, &'a [u8])>,
}

impl<'a> FileLayout<'a> {
    /// Places an array of elements of `stride` bytes behind what is there.
    fn place(&mut self, bytes: &'a [u8], stride: usize) -> FileSection {
        let offset = self.end.next_multiple_of(ALIGNMENT);
        self.end = offset + bytes.len() as u64;
        self.pieces.push((offset, bytes));
        FileSection {
            offset,
            count: (bytes.len() / stride) as u64,
            stride: stride as u64,
            checksum: checksum(bytes),
        }
    }
}

impl PatchTable {
    fn own_checksum(&self) -> u64 {
        hash(bytemuck::bytes_of(&self.sections))
    }
}

/// Tells whether a file beginning with these bytes (at least 8) is a tree file.
pub fn is_tree_file(start: &[u8]) -> bool {
    start.starts_with(&MAGIC)
}

/// Writes a model; the file appears whole or not at all. A link is followed, and what is no plain file (a device, a pipe)
/// is written, not replaced.
///
/// # Errors
///
/// The folder cannot be written to, or the disk is full.
pub fn write(model: &Model, path: &Path) -> Result<(), Error> {
    require_little_endian(path)?;
    let mut header = TreeHeader {
        magic: MAGIC,
        version: VERSION,
        flags: flags_of(model),
        origin: model.origin.to_array(),
        min: model.min.to_array(),
        max: model.max.to_array(),
        orbit_center: model.orbit_center.to_array(),
        orbit_radius: model.orbit_radius,
        used_vertices: model.used_vertices,
        section_count: SECTIONS as u32,
        ..TreeHeader::zeroed()
    };
    let mut layout = FileLayout {
        end: HEADER as u64,
        pieces: Vec::new(),
    };
    header.sections = arrays(model).map(|(bytes, stride)| layout.place(bytes, stride));
    let (empty, mut table) = (PatchTable::zeroed(), PatchTable::zeroed());
    if let Some(patches) = &model.patches {
        let at = layout.pieces.len();
        layout.place(bytemuck::bytes_of(&empty), size_of::<PatchTable>());
        let arrays = [raw(&patches.records), raw(&patches.colors)];
        table.sections = arrays.map(|(bytes, stride)| layout.place(bytes, stride));
        table.checksum = table.own_checksum();
        layout.pieces[at].1 = bytemuck::bytes_of(&table);
    }
    header.file_length = layout.end;
    header.checksum = header_checksum(&header);

    let fill = |file: &mut File| -> std::io::Result<()> {
        let mut out = BufWriter::new(file);
        out.write_all(bytemuck::bytes_of(&header))?;
        let mut at = HEADER as u64;
        for &(offset, bytes) in &layout.pieces {
            let padding = (offset - at) as usize;
            out.write_all(&[0; ALIGNMENT as usize][..padding])?;
            out.write_all(bytes)?;
            at = offset + bytes.len() as u64;
        }
        out.flush()
    };
    write_whole(path, &fill)
}

/// Writes a file by `fill`; it appears whole or not at all. A link is followed, and what is no plain file (a device, a
/// pipe) is written, not replaced.
///
/// # Errors
///
/// The folder cannot be written to, or the disk is full.
pub fn write_whole(
    path: &Path,
    fill: &dyn Fn(&mut File) -> std::io::Result<()>,
) -> Result<(), Error> {
    let failed = |source| Error::Io {
        path: path.to_owned(),
        source,
    };
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if target.exists() && !target.is_file() && !target.is_dir() {
        let mut file = File::options().write(true).open(&target).map_err(failed)?;
        return fill(&mut file).map_err(failed);
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".surfel-");
    #[cfg(unix)]
    {
        // Temporary files are private by default; this one becomes an ordinary file (less the user's mask).
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(failed)?;
    fill(file.as_file_mut()).map_err(failed)?;
    file.persist(&target).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Reads a model. What it returns is sound: every index in it names something.
///
/// # Errors
///
/// The file cannot be read, is not a tree file, is of another version, or is damaged; with the path, the byte, and what
/// is wrong.
pub fn read(path: &Path) -> Result<Model, Error> {
    let failed = |source| Error::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    read_from(&mut file, length, path, &SilentProgress)
}

/// Reads a model from a file that somebody else opened, `length` bytes long; `path` is for the errors. Reports one stage,
/// `read tree`, in bytes.
///
/// # Errors
///
/// As [`read`]; cancelled.
pub fn read_from(
    file: &mut dyn Read,
    length: u64,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Model, Error> {
    require_little_endian(path)?;
    progress.stage("read tree", length);
    let failed = |source| Error::Io {
        path: path.to_owned(),
        source,
    };
    let damaged = |offset: u64, cause: String| Error::File {
        path: path.to_owned(),
        offset,
        cause,
    };
    let mut header = TreeHeader::zeroed();
    if length < HEADER as u64 {
        let mut start = Vec::new();
        file.read_to_end(&mut start).map_err(failed)?;
        let cause = if is_tree_file(&start) {
            "ends within its header"
        } else {
            "not a tree file"
        };
        return Err(damaged(length, cause.to_owned()));
    }
    file.read_exact(bytemuck::bytes_of_mut(&mut header))
        .map_err(failed)?;
    if header.magic != MAGIC {
        return Err(damaged(0, "not a tree file".to_owned()));
    }
    if header.version != VERSION {
        let cause = format!(
            "version {} of the format; this program reads version {VERSION}: build the file again from its model",
            header.version
        );
        return Err(damaged(8, cause));
    }
    if header.checksum != header_checksum(&header) {
        return Err(damaged(0, "the header's checksum is wrong".to_owned()));
    }
    if header.file_length != length {
        let cause = format!(
            "the file has {length} bytes, its header says {}",
            header.file_length
        );
        return Err(damaged(length.min(header.file_length), cause));
    }
    if header.section_count as usize != SECTIONS || header.flags & !(CLOSED | COLORS | PATCHES) != 0
    {
        return Err(damaged(12, "unknown flags or sections".to_owned()));
    }
    let mut reader = TreeReader {
        file,
        at: HEADER as u64,
        length,
        next: 0,
        sections: header.sections.to_vec(),
        path,
        progress,
    };
    let mut model = Model {
        vertices: reader.section::<Vertex>()?,
        triangles: reader.section::<[u32; 3]>()?,
        tree: Tree {
            nodes: reader.section_in(AlignedRecords::of_tree)?,
            attributes: reader.section_in(AlignedRecords::<NodeAttributes>::of_tree)?,
            parents: reader.section::<u32>()?,
            first_leaf: reader.section::<u32>()?,
            level_starts: reader.section::<u32>()?,
            leaves: reader.section_in(AlignedRecords::<Leaf>::zeroed)?,
            moments: reader.section_in(AlignedRecords::<SurfaceMoments>::zeroed)?,
        },
        used_vertices: header.used_vertices,
        origin: DVec3::from_array(header.origin),
        min: Vec3::from_array(header.min),
        max: Vec3::from_array(header.max),
        orbit_center: Vec3::from_array(header.orbit_center),
        orbit_radius: header.orbit_radius,
        framed: None,
        is_closed: header.flags & CLOSED != 0,
        has_colors: header.flags & COLORS != 0,
        // A tree file keeps the colors of vertices and nodes, which are means of the texels.
        textures: None,
        patches: None,
    };
    if header.flags & PATCHES != 0 {
        let nodes = model.tree.nodes.len();
        model.patches = Some(Arc::new(reader.patches(nodes, model.has_colors)?));
    }
    if reader.at != length {
        return Err(damaged(
            reader.at,
            "bytes after the last section".to_owned(),
        ));
    }
    check::links(&model).map_err(|cause| damaged(HEADER as u64, cause))?;
    let used = &model.vertices[..model.used_vertices as usize];
    let is_finite = model.origin.is_finite() && model.min.is_finite() && model.max.is_finite();
    if !is_finite || used.par_iter().any(|vertex| !vertex.position.is_finite()) {
        return Err(damaged(
            header.sections[0].offset,
            "a position that is not finite".to_owned(),
        ));
    }
    model.frame_within(framed::FAR);
    Ok(model)
}

/// Reads the sections one after the other.
struct TreeReader<'a> {
    file: &'a mut dyn Read,
    at: u64,
    length: u64,
    next: usize,
    sections: Vec<FileSection>,
    path: &'a Path,
    progress: &'a dyn Progress,
}

impl TreeReader<'_> {
    fn failed(&self, source: std::io::Error) -> Error {
        Error::Io {
            path: self.path.to_owned(),
            source,
        }
    }

    /// Reads up to `offset`, which is at most one alignment ahead; tells what is wrong with what is there.
    fn skip_zeros(&mut self, offset: u64) -> std::io::Result<Result<(), String>> {
        let mut padding = [0u8; ALIGNMENT as usize];
        let padding = &mut padding[..(offset - self.at) as usize];
        self.file.read_exact(padding)?;
        Ok(match padding.iter().all(|&byte| byte == 0) {
            true => Ok(()),
            false => Err("bytes before it that should be zero".to_owned()),
        })
    }

    /// Records of patches of a tree of `nodes`, behind their table.
    fn patches(&mut self, nodes: usize, has_colors: bool) -> Result<PatchRecords, Error> {
        let offset = self.at.next_multiple_of(ALIGNMENT);
        let path = self.path;
        let damaged = |cause: &str| Error::File {
            path: path.to_owned(),
            offset,
            cause: format!("table of patches: {cause}"),
        };
        let mut table = PatchTable::zeroed();
        if self.length < offset + size_of::<PatchTable>() as u64 {
            return Err(damaged("the file ends before it"));
        }
        let is_padded = self.skip_zeros(offset).map_err(|e| self.failed(e))?;
        self.file
            .read_exact(bytemuck::bytes_of_mut(&mut table))
            .map_err(|e| self.failed(e))?;
        is_padded.map_err(|cause| damaged(&cause))?;
        if table.checksum != table.own_checksum() {
            return Err(damaged("the checksum is wrong"));
        }
        let colors = if has_colors { nodes } else { 0 };
        if table.sections.map(|section| section.count) != [nodes as u64, colors as u64] {
            return Err(damaged("not one record for each node"));
        }
        self.at = offset + size_of::<PatchTable>() as u64;
        self.sections.extend(table.sections);
        Ok(PatchRecords {
            records: self.section::<PackedPatch>()?,
            colors: self.section::<PackedPatchColors>()?,
        })
    }

    fn section<T: Pod>(&mut self) -> Result<Vec<T>, Error> {
        self.section_in(|count| vec![T::zeroed(); count])
    }

    /// The next section, in memory made for its number of elements.
    fn section_in<T: Pod, V: DerefMut<Target = [T]>>(
        &mut self,
        zeroed: impl FnOnce(usize) -> V,
    ) -> Result<V, Error> {
        let (section, name) = (self.sections[self.next], NAMES[self.next]);
        self.next += 1;
        let path = self.path;
        let damaged = |offset: u64, cause: String| Error::File {
            path: path.to_owned(),
            offset,
            cause: format!("{name}: {cause}"),
        };
        if section.stride != size_of::<T>() as u64 {
            return Err(damaged(
                section.offset,
                format!("{} bytes an element", section.stride),
            ));
        }
        let size = section.count.checked_mul(section.stride);
        let end = size.and_then(|size| size.checked_add(section.offset));
        if section.offset != self.at.next_multiple_of(ALIGNMENT)
            || end.is_none_or(|end| end > self.length)
        {
            return Err(damaged(
                section.offset,
                format!("{} elements do not fit the file", section.count),
            ));
        }
        self.skip_zeros(section.offset)
            .map_err(|e| self.failed(e))?
            .map_err(|cause| damaged(self.at, cause))?;
        // Not more than the file has.
        let mut values = zeroed(section.count as usize);
        self.file
            .read_exact(bytemuck::cast_slice_mut(&mut values))
            .map_err(|e| self.failed(e))?;
        if checksum(bytemuck::cast_slice(&values)) != section.checksum {
            return Err(damaged(section.offset, "the checksum is wrong".to_owned()));
        }
        let end = section.offset + size.unwrap_or(0);
        self.progress.advance(end - self.at);
        self.at = end;
        if self.progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        Ok(values)
    }
}

/// An array as bytes, with the size of an element.
fn raw<T: Pod>(values: &[T]) -> (&[u8], usize) {
    (bytemuck::cast_slice(values), size_of::<T>())
}

/// All arrays that every file has, in the order of the sections.
fn arrays(model: &Model) -> [(&[u8], usize); SECTIONS] {
    let tree = &model.tree;
    [
        raw(&model.vertices),
        raw(&model.triangles),
        raw(&tree.nodes),
        raw(&tree.attributes),
        raw(&tree.parents),
        raw(&tree.first_leaf),
        raw(&tree.level_starts),
        raw(&tree.leaves),
        raw(&tree.moments),
    ]
}

fn flags_of(model: &Model) -> u32 {
    let all = [
        (model.is_closed, CLOSED),
        (model.has_colors, COLORS),
        (model.patches.is_some(), PATCHES),
    ];
    all.into_iter()
        .map(|(is_set, flag)| if is_set { flag } else { 0 })
        .sum()
}

fn header_checksum(header: &TreeHeader) -> u64 {
    let bytes = bytemuck::bytes_of(header);
    hash(&bytes[..HEADER - size_of::<u64>()])
}

/// Checksum of a section: its pieces' in parallel, then that of those.
fn checksum(bytes: &[u8]) -> u64 {
    let pieces: Vec<u64> = bytes.par_chunks(1 << 20).map(hash).collect();
    hash(bytemuck::cast_slice(&pieces)) ^ bytes.len() as u64
}

/// Checksum of bytes: four lanes of multiply and rotate. Each step maps a lane one to one for a given word, and a word one
/// to one for a given lane: a single changed word always shows.
pub fn hash(bytes: &[u8]) -> u64 {
    const PRIME: u64 = 0x9e37_79b1_85eb_ca87;
    let step = |lane: u64, word: u64| (lane ^ word).wrapping_mul(PRIME).rotate_left(29);
    let mut lanes = [1u64, 2, 3, 4];
    let mut feed = |stripe: &[u8]| {
        for (lane, word) in lanes.iter_mut().zip(stripe.chunks_exact(8)) {
            let mut buffer = [0u8; 8];
            buffer.copy_from_slice(word);
            *lane = step(*lane, u64::from_le_bytes(buffer));
        }
    };
    let mut stripes = bytes.chunks_exact(32);
    for stripe in &mut stripes {
        feed(stripe);
    }
    let rest = stripes.remainder();
    if !rest.is_empty() {
        let mut stripe = [0u8; 32];
        stripe[..rest.len()].copy_from_slice(rest);
        feed(&stripe);
    }
    lanes.into_iter().fold(bytes.len() as u64, step)
}

fn require_little_endian(path: &Path) -> Result<(), Error> {
    if cfg!(target_endian = "little") {
        Ok(())
    } else {
        Err(Error::File {
            path: path.to_owned(),
            offset: 0,
            cause: "tree files are little-endian; this machine is not".to_owned(),
        })
    }
}
