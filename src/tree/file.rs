//! Tree files (`.surfel`): a built model as it lies in memory.
//!
//! Little-endian. A header with everything that is not an array, a table of sections, a checksum of both; then the
//! arrays, each at a multiple of 64 bytes, zeros between them. Every section has its own checksum, which any changed
//! word changes for certain and any other damage with a probability of all but 2^-64. A reader believes nothing: lengths
//! are compared with the file before memory is asked for, and all links are tested before the model is handed out.

use super::{AlignedRecords, Error, Leaf, Model, Moments, NodeAttributes, Tree, check, framed};
use crate::abi::Vertex;
use crate::progress::{Progress, Silent};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::ops::DerefMut;
use std::path::Path;

/// Ending of tree files, without the dot.
pub const EXTENSION: &str = "surfel";

/// First bytes of a tree file. The control characters show a transfer in text mode.
pub const MAGIC: [u8; 8] = *b"surfel\x1a\n";
/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 2;

const SECTIONS: usize = 9;
const ALIGNMENT: u64 = 64;
const NAMES: [&str; SECTIONS] = [
    "vertices",
    "triangles",
    "nodes",
    "node attributes",
    "parents",
    "first leaves",
    "level starts",
    "leaves",
    "moments",
];

const CLOSED: u32 = 1;
const COLORS: u32 = 2;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
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

const HEADER: usize = size_of::<Header>();

/// Whether a file beginning with these bytes (at least 8) is a tree file.
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
    let arrays = arrays(model);
    let mut header = Header {
        magic: MAGIC,
        version: VERSION,
        flags: if model.is_closed { CLOSED } else { 0 } | if model.has_colors { COLORS } else { 0 },
        origin: model.origin.to_array(),
        min: model.min.to_array(),
        max: model.max.to_array(),
        orbit_center: model.orbit_center.to_array(),
        orbit_radius: model.orbit_radius,
        used_vertices: model.used_vertices,
        section_count: SECTIONS as u32,
        ..Header::zeroed()
    };
    let mut end = HEADER as u64;
    for (section, (bytes, stride)) in header.sections.iter_mut().zip(arrays) {
        *section = FileSection {
            offset: end.next_multiple_of(ALIGNMENT),
            count: (bytes.len() / stride) as u64,
            stride: stride as u64,
            checksum: checksum(bytes),
        };
        end = section.offset + bytes.len() as u64;
    }
    header.file_length = end;
    header.checksum = header_checksum(&header);

    let fill = |file: &mut File| -> std::io::Result<()> {
        let mut out = BufWriter::new(file);
        out.write_all(bytemuck::bytes_of(&header))?;
        let mut at = HEADER as u64;
        for (section, (bytes, _)) in header.sections.iter().zip(arrays) {
            let padding = (section.offset - at) as usize;
            out.write_all(&[0; ALIGNMENT as usize][..padding])?;
            out.write_all(bytes)?;
            at = section.offset + bytes.len() as u64;
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
    read_from(&mut file, length, path, &Silent)
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
    let mut header = Header::zeroed();
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
    if header.section_count as usize != SECTIONS || header.flags & !(CLOSED | COLORS) != 0 {
        return Err(damaged(12, "unknown flags or sections".to_owned()));
    }
    let mut reader = TreeReader {
        file,
        at: HEADER as u64,
        length,
        next: 0,
        sections: header.sections,
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
            moments: reader.section_in(AlignedRecords::<Moments>::zeroed)?,
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
    };
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
    model.framed = framed::of(&model);
    Ok(model)
}

/// Reads the sections one after the other.
struct TreeReader<'a> {
    file: &'a mut dyn Read,
    at: u64,
    length: u64,
    next: usize,
    sections: [FileSection; SECTIONS],
    path: &'a Path,
    progress: &'a dyn Progress,
}

impl TreeReader<'_> {
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
        let damaged = |offset: u64, cause: String| Error::File {
            path: self.path.to_owned(),
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
        let io = |source| Error::Io {
            path: self.path.to_owned(),
            source,
        };
        let mut padding = [0u8; ALIGNMENT as usize];
        let padding = &mut padding[..(section.offset - self.at) as usize];
        self.file.read_exact(padding).map_err(io)?;
        if padding.iter().any(|&byte| byte != 0) {
            return Err(damaged(
                self.at,
                "bytes before it that should be zero".to_owned(),
            ));
        }
        // Not more than the file has.
        let mut values = zeroed(section.count as usize);
        self.file
            .read_exact(bytemuck::cast_slice_mut(&mut values))
            .map_err(io)?;
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

/// All arrays as bytes, with the size of an element, in the order of the sections.
fn arrays(model: &Model) -> [(&[u8], usize); SECTIONS] {
    fn bytes<T: Pod>(values: &[T]) -> (&[u8], usize) {
        (bytemuck::cast_slice(values), size_of::<T>())
    }
    let tree = &model.tree;
    [
        bytes(&model.vertices),
        bytes(&model.triangles),
        bytes(&tree.nodes),
        bytes(&tree.attributes),
        bytes(&tree.parents),
        bytes(&tree.first_leaf),
        bytes(&tree.level_starts),
        bytes(&tree.leaves),
        bytes(&tree.moments),
    ]
}

fn header_checksum(header: &Header) -> u64 {
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::tree::{BuildOptions, build};

    /// A strip of triangles, as a file in memory.
    fn bytes() -> Vec<u8> {
        let mesh = Mesh {
            positions: (0..14)
                .map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.1))
                .collect(),
            triangles: (0..12).map(|i| [i, i + 1, i + 2]).collect(),
            ..Mesh::default()
        };
        let model = build(mesh, &BuildOptions::default(), &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.surfel");
        write(&model, &path).unwrap();
        std::fs::read(path).unwrap()
    }

    fn reads(mut bytes: &[u8]) -> Result<Model, Error> {
        let length = bytes.len() as u64;
        read_from(&mut bytes, length, Path::new("model.surfel"), &Silent)
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_refused() {
        let good = bytes();
        assert!(reads(&good).is_ok());
        for length in 0..good.len() {
            assert!(reads(&good[..length]).is_err(), "cut at {length}");
        }
        let mut bytes = good.clone();
        for bit in 0..8 * good.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(reads(&bytes).is_err(), "bit {bit} flipped");
            bytes[bit / 8] = good[bit / 8];
        }
        bytes.push(0);
        let error = reads(&bytes).unwrap_err().to_string();
        assert!(
            error.contains("model.surfel, byte") && error.contains("its header says"),
            "{error}"
        );
    }

    /// Changes the header and makes its checksum right again.
    fn forged(change: impl FnOnce(&mut Header)) -> Result<Model, Error> {
        let mut bytes = bytes();
        let mut header: Header = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
        change(&mut header);
        header.checksum = header_checksum(&header);
        bytes[..HEADER].copy_from_slice(bytemuck::bytes_of(&header));
        reads(&bytes)
    }

    #[test]
    fn a_header_that_lies_is_refused() {
        assert!(forged(|_| ()).is_ok());
        for section in 0..SECTIONS {
            for count in [0, 1, 1 << 20, 1 << 40, u64::MAX / 8, u64::MAX] {
                assert!(
                    forged(|h| h.sections[section].count = count).is_err(),
                    "{section} {count}"
                );
            }
            for offset in [0, 64, 1 << 40, u64::MAX, u64::MAX - 63] {
                assert!(
                    forged(|h| h.sections[section].offset = offset).is_err(),
                    "{section} {offset}"
                );
            }
            assert!(forged(|h| h.sections[section].stride = 1).is_err());
        }
        assert!(forged(|h| h.used_vertices = u32::MAX).is_err());
        assert!(forged(|h| h.used_vertices = 3).is_err());
        assert!(forged(|h| h.section_count = 8).is_err());
        assert!(forged(|h| h.flags = 4).is_err());
        assert!(forged(|h| h.min[0] = f32::NAN).is_err());
        assert!(forged(|h| h.file_length = 5).is_err());
        let error = forged(|h| h.version = 1).unwrap_err().to_string();
        assert!(
            error.contains("version 1 ") && error.contains("build the file again"),
            "{error}"
        );
    }

    /// Changes a section's bytes and makes all checksums right again.
    fn forged_section(section: usize, change: impl FnOnce(&mut [u8])) -> Result<Model, Error> {
        let mut bytes = bytes();
        let mut header: Header = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
        let entry = &mut header.sections[section];
        let start = entry.offset as usize;
        let range = start..start + (entry.count * entry.stride) as usize;
        change(&mut bytes[range.clone()]);
        entry.checksum = checksum(&bytes[range]);
        header.checksum = header_checksum(&header);
        bytes[..HEADER].copy_from_slice(bytemuck::bytes_of(&header));
        reads(&bytes)
    }

    #[test]
    fn indices_that_lead_nowhere_are_refused_in_spite_of_right_checksums() {
        // Triangles; nodes (first child, child count, flags); parents, first leaves, level starts.
        for (section, byte) in [
            (1, 5),
            (2, 16),
            (2, 19),
            (2, 30),
            (2, 31),
            (4, 4),
            (5, 8),
            (6, 4),
        ] {
            for value in [77, 255] {
                let result = forged_section(section, |bytes| bytes[byte] = value);
                assert!(result.is_err(), "section {section}, byte {byte}");
            }
        }
        // A position, a sphere of a node, one of a leaf that are no numbers.
        for (section, word) in [(0, 1), (2, 3), (7, 0)] {
            let nan = f32::NAN.to_le_bytes();
            let result = forged_section(section, |bytes| {
                bytes[4 * word..4 * word + 4].copy_from_slice(&nan)
            });
            assert!(result.is_err(), "section {section}");
        }
    }
}
