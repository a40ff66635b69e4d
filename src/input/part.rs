//! What a file holds, part by part, and what became of it; and the small faults that refuse no file.

use std::fmt;

use super::{FilePlace, ReadWarning};

/// A part of a file and what became of it: an element, a property, a kind of line, a material, a texture, a block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePart {
    /// Kind and name of the part, such as "vertex property quality".
    pub name: String,
    /// How many rows, lines or bytes there are of it.
    pub count: u64,
    /// What became of it.
    pub fate: PartFate,
    /// What it was read as, or why it was not read; may be empty.
    pub note: String,
}

/// What became of a part of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PartFate {
    /// The part is in the mesh.
    Used,
    /// The part is kept beside the mesh, as an attribute of its points.
    Kept,
    /// The part would change the picture, and is not in the mesh.
    LeftOut,
    /// No picture depends on it: names, groups, comments.
    Unneeded,
}

impl PartFate {
    /// The fate in words.
    pub fn name(self) -> &'static str {
        match self {
            PartFate::Used => "read",
            PartFate::Kept => "kept",
            PartFate::LeftOut => "left out",
            PartFate::Unneeded => "not needed",
        }
    }
}

impl fmt::Display for PartFate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A fault of something that decides no shape: what is wrong, in the plural, and what was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PartFault(&'static str, &'static str);

impl PartFault {
    pub(super) const NORMAL: PartFault =
        PartFault("normals are no three numbers", "treated as unknown");
    pub(super) const NORMAL_INDEX: PartFault = PartFault(
        "corners name normals that the file does not have",
        "their normals are computed",
    );
    pub(super) const TEXTURE: PartFault =
        PartFault("texture coordinates are no numbers", "treated as zero");
    pub(super) const TEXTURE_INDEX: PartFault = PartFault(
        "corners name texture coordinates that the file does not have",
        "ignored",
    );
    pub(super) const CORNER: PartFault = PartFault(
        "corners say more than position, texture coordinate and normal",
        "the rest is ignored",
    );
    pub(super) const COLOR: PartFault = PartFault("colors are no numbers", "treated as white");
    pub(super) const EXTRA: PartFault = PartFault(
        "values beside the position are no numbers",
        "treated as zero",
    );
    pub(super) const END_MARK: PartFault = PartFault("end marks are misspelt", "read all the same");
    pub(super) const NO_END: PartFault = PartFault(
        "`endsolid` is missing",
        "check that the file has not been cut short",
    );
    pub(super) const POINT_LINE: PartFault = PartFault("lines are no points", "left out");
    pub(super) const LINE: PartFault = PartFault("lines are not known", "ignored");

    /// The remark about `count` of them, the first at `place`.
    pub(super) fn remark(self, count: u64, place: FilePlace) -> ReadWarning {
        ReadWarning::PartFaulty {
            what: self.0,
            outcome: self.1,
            count,
            place,
        }
    }
}

/// Names that end in numbers, three or more of one stem, as one: `f_rest_*`.
pub(super) fn grouped<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for name in names {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        match groups.iter_mut().find(|group| group.0 == stem) {
            Some(group) => group.1.push(name),
            None => groups.push((stem, vec![name])),
        }
    }
    let mut out = Vec::new();
    for (stem, members) in groups {
        if members.len() >= 3 {
            out.push(format!("{stem}* ({})", members.len()));
        } else {
            out.extend(members.into_iter().map(str::to_owned));
        }
    }
    out
}

/// The parts of a file and its small faults while it is read.
#[derive(Debug, Default)]
pub(super) struct PartInventory {
    pub(super) parts: Vec<FilePart>,
    /// What the one line about what was left out names.
    left_out: Vec<String>,
    faults: Vec<(PartFault, u64, FilePlace)>,
}

/// Parts beyond this many are not listed: a file made for harm could name millions.
const MOST_PARTS: usize = 1000;

impl PartInventory {
    /// Adds a part.
    pub(super) fn add(
        &mut self,
        name: impl Into<String>,
        count: u64,
        fate: PartFate,
        note: impl Into<String>,
    ) {
        if self.parts.len() < MOST_PARTS {
            self.parts.push(FilePart {
                name: name.into(),
                count,
                fate,
                note: note.into(),
            });
        }
    }

    /// Adds a part that the file has some of.
    pub(super) fn add_some(
        &mut self,
        name: impl Into<String>,
        count: u64,
        fate: PartFate,
        note: impl Into<String>,
    ) {
        if count > 0 {
            self.add(name, count, fate, note);
        }
    }

    /// Adds words to the one line about what was left out.
    pub(super) fn leave_out(&mut self, what: impl Into<String>) {
        self.left_out.push(what.into());
    }

    /// Adds `count` to a fault; `place` is asked for at the first of its kind.
    #[cold]
    pub(super) fn fault(
        &mut self,
        fault: PartFault,
        count: u64,
        place: impl FnOnce() -> FilePlace,
    ) {
        match self.faults.iter_mut().find(|known| known.0 == fault) {
            Some(known) => known.1 += count,
            None => self.faults.push((fault, count, place())),
        }
    }

    /// The remarks about all of it.
    pub(super) fn remarks(&mut self) -> Vec<ReadWarning> {
        let mut remarks: Vec<_> = std::mem::take(&mut self.faults)
            .into_iter()
            .map(|(fault, count, place)| fault.remark(count, place))
            .collect();
        if !self.left_out.is_empty() {
            let parts = std::mem::take(&mut self.left_out);
            remarks.push(ReadWarning::LeftOut { parts });
        }
        remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_names_are_one_and_others_stay() {
        let names = ["f_rest_0", "x1", "f_rest_1", "alpha", "f_rest_12", "x2"];
        assert_eq!(grouped(names), ["f_rest_* (3)", "x1", "x2", "alpha"]);
    }

    #[test]
    fn faults_are_counted_and_the_first_is_placed() {
        let mut inventory = PartInventory::default();
        inventory.fault(PartFault::NORMAL, 1, || FilePlace::Line(3));
        inventory.fault(PartFault::COLOR, 1, || FilePlace::Line(4));
        inventory.fault(PartFault::NORMAL, 1, || FilePlace::Line(5));
        inventory.leave_out("alpha of vertex");
        let remarks = inventory.remarks();
        assert_eq!(remarks[0], PartFault::NORMAL.remark(2, FilePlace::Line(3)));
        assert_eq!(
            remarks[0].to_string(),
            "2 normals are no three numbers, the first on line 3; treated as unknown"
        );
        assert_eq!(remarks.len(), 3);
        assert_eq!(inventory.remarks(), []);
    }
}
