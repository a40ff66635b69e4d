//! Reads `.qs` files.

use super::{
    COLORS, COMMENT, COMMENT_HEADER, HAS_GRANDCHILDREN, HEADER, MAGIC, NORMAL_CODES, QsError,
    QsNode, QsTree,
};
use crate::pages::quantize::{PageSphere, SPHERE_CODES};
use glam::Vec3;
use std::path::Path;

/// Tells whether a file beginning with these bytes is a `.qs` file.
pub fn is_qs_file(start: &[u8]) -> bool {
    start.starts_with(&MAGIC)
}

/// Reads all trees of a file, one a fragment; comments are left out. `path` is for the errors.
///
/// What it returns is sound: there are as many nodes as children, and every code is one. Memory is at most three times the
/// bytes.
///
/// # Errors
///
/// Not such a file, or damaged; with the byte and what is wrong.
pub fn read(bytes: &[u8], path: &Path) -> Result<Vec<QsTree>, QsError> {
    let mut trees = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let reader = FragmentReader::new(bytes, at, path)?;
        if reader.options & COMMENT == 0 {
            trees.push(reader.tree()?);
        }
        at = reader.end;
    }
    if trees.is_empty() {
        return Err(QsError {
            path: path.to_owned(),
            offset: at as u64,
            cause: "no tree in the file".to_owned(),
        });
    }
    Ok(trees)
}

/// A fragment of the file.
struct FragmentReader<'a> {
    bytes: &'a [u8],
    path: &'a Path,
    start: usize,
    /// Past its last byte, within the file.
    end: usize,
    options: u32,
}

impl<'a> FragmentReader<'a> {
    fn new(bytes: &'a [u8], start: usize, path: &'a Path) -> Result<Self, QsError> {
        let mut reader = Self {
            bytes,
            path,
            start,
            end: bytes.len(),
            options: 0,
        };
        let rest = &bytes[start..];
        if !rest.starts_with(&MAGIC) {
            let cause = "neither a fragment of QSplat 1.0 nor the end of the file";
            return Err(reader.wrong(start, cause));
        }
        if rest.len() < COMMENT_HEADER {
            return Err(reader.wrong(bytes.len(), "the file ends within a header"));
        }
        let length = reader.u32(start + 8)? as usize;
        reader.options = reader.u32(start + 16)?;
        let header = if reader.options & COMMENT == 0 {
            HEADER
        } else {
            COMMENT_HEADER
        };
        if reader.options & !(COLORS | COMMENT) != 0 {
            return Err(reader.wrong(start + 16, "unknown options"));
        }
        if length < header || length > rest.len() || !length.is_multiple_of(4) {
            let cause = format!(
                "a fragment of {length} bytes, where the file has {} more",
                rest.len()
            );
            return Err(reader.wrong(start + 8, &cause));
        }
        reader.end = start + length;
        Ok(reader)
    }

    fn wrong(&self, offset: usize, cause: &str) -> QsError {
        QsError {
            path: self.path.to_owned(),
            offset: offset as u64,
            cause: cause.to_owned(),
        }
    }

    fn word<const N: usize>(&self, at: usize) -> Result<[u8; N], QsError> {
        let within = self.bytes.get(..self.end).and_then(|own| own.get(at..));
        match within.and_then(|rest| rest.first_chunk::<N>()) {
            Some(word) => Ok(*word),
            None => Err(self.wrong(self.end, "the fragment ends before its last group")),
        }
    }

    fn u32(&self, at: usize) -> Result<u32, QsError> {
        self.word(at).map(u32::from_be_bytes)
    }

    fn f32(&self, at: usize) -> Result<f32, QsError> {
        self.word(at).map(f32::from_be_bytes)
    }

    fn node(&self, at: usize) -> Result<(QsNode, bool), QsError> {
        let first = u16::from_be_bytes(self.word(at)?);
        let second = u16::from_be_bytes(self.word(at + 2)?);
        let color = if self.options & COLORS == 0 {
            0
        } else {
            u16::from_be_bytes(self.word(at + 4)?)
        };
        let node = QsNode {
            sphere: first >> 3,
            normal: second >> 2,
            cone: (second & 3) as u8,
            children: match first & 3 {
                0 => 0,
                less => less as u8 + 1,
            },
            color,
        };
        if usize::from(node.sphere) >= SPHERE_CODES {
            let cause = format!("sphere {}, of {SPHERE_CODES} codes", node.sphere);
            return Err(self.wrong(at, &cause));
        }
        if node.normal >= NORMAL_CODES {
            let cause = format!("normal {}, of {NORMAL_CODES} codes", node.normal);
            return Err(self.wrong(at + 2, &cause));
        }
        if node.children == 0 && first & HAS_GRANDCHILDREN != 0 {
            return Err(self.wrong(at, "a node without children that has grandchildren"));
        }
        Ok((node, first & HAS_GRANDCHILDREN != 0))
    }

    fn tree(&self) -> Result<QsTree, QsError> {
        let at = |offset: usize| self.start + offset;
        let wanted_leaves = self.u32(at(12))? as usize;
        let root = PageSphere {
            center: Vec3::new(self.f32(at(20))?, self.f32(at(24))?, self.f32(at(28))?),
            radius: self.f32(at(32))?,
        };
        if !(root.center.is_finite() && root.radius >= 0.0 && root.radius.is_finite()) {
            return Err(self.wrong(at(20), "a root whose sphere is none"));
        }
        let root_children = match self.u32(at(36))? {
            count @ (0 | 2..=4) => count as u8,
            count => {
                let cause = format!("a root with {count} children; it has 2 to 4, or none");
                return Err(self.wrong(at(36), &cause));
            }
        };
        let mut tree = QsTree {
            has_colors: self.options & COLORS != 0,
            root,
            root_children,
            nodes: Vec::new(),
        };
        let end = self.groups(&mut tree)?;
        let padding = &self.bytes[end..self.end];
        if padding.len() > 3 || padding.iter().any(|&byte| byte != 0) {
            return Err(self.wrong(end, "bytes after the last group"));
        }
        let leaves = tree.leaf_count();
        if leaves != wanted_leaves {
            let cause = format!("{leaves} leaves, where the header says {wanted_leaves}");
            return Err(self.wrong(at(12), &cause));
        }
        Ok(tree)
    }

    /// Reads all groups; returns where they end.
    fn groups(&self, tree: &mut QsTree) -> Result<usize, QsError> {
        let size = if tree.has_colors { 6 } else { 4 };
        let mut at = self.start + HEADER;
        if tree.root_children == 0 {
            return Ok(at);
        }
        let root_children = usize::from(tree.root_children);
        // Nothing says whether the root has grandchildren, but that nothing follows if not.
        let without = (at + root_children * size).next_multiple_of(4);
        let groups = |has_pointer: bool| (root_children, has_pointer);
        // Groups to come, by size and whether they begin with a pointer.
        let mut waiting = std::collections::VecDeque::from([groups(self.end != without)]);
        // What waiting groups take: the next new one begins there.
        let bytes =
            |(count, has_pointer): (usize, bool)| count * size + usize::from(has_pointer) * 4;
        let mut next = at + bytes(waiting[0]);
        while let Some((count, has_pointer)) = waiting.pop_front() {
            let pointer = at;
            let first_group = next;
            if has_pointer {
                at += 4;
            }
            for _ in 0..count {
                let (node, has_grandchildren) = self.node(at)?;
                if node.children > 0 {
                    if !has_pointer {
                        return Err(self.wrong(at, "a node whose children nothing points to"));
                    }
                    let group = (usize::from(node.children), has_grandchildren);
                    next += bytes(group);
                    waiting.push_back(group);
                }
                tree.nodes.push(node);
                at += size;
            }
            if has_pointer {
                let distance = self.u32(pointer)? as usize;
                if first_group == next {
                    return Err(self.wrong(pointer, "a group without children that points to some"));
                }
                if pointer.checked_add(distance) != Some(first_group) {
                    let cause = format!(
                        "a pointer of {distance}, where the next group is {} away",
                        first_group - pointer
                    );
                    return Err(self.wrong(pointer, &cause));
                }
            }
        }
        Ok(at)
    }
}
