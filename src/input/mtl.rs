//! Materials of OBJ: the files that define them, the diffuse color of each and the names of textures, nothing else.
//!
//! A material file is found as it is named, or beside the model by the last part of its name, whatever the case, the
//! slashes and the quotes: exporters write the paths of their own machine.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::Warning;
use super::color::color_from_unit;
use super::job::Job;
use super::part::{Inventory, PartFate};
use super::text::{Scanner, parse_f64, shown, words};

/// A material file longer than this is none.
const LARGEST_BYTES: u64 = 64 << 20;

/// Most names of material files that are looked for: a model made for harm could name millions.
const MOST_MATERIAL_FILES: usize = 100;

/// Most entries of a folder that are looked through for a file.
const MOST_ENTRIES: usize = 100_000;

const WHITE: [u8; 4] = [255; 4];

/// Where the faces of one material begin.
#[derive(Debug)]
pub(super) struct MaterialRun {
    /// Their first triangle.
    pub(super) first: usize,
    /// The material's name as written.
    pub(super) name: Vec<u8>,
}

/// A color per triangle from the materials; empty when not wanted, or when there is nothing but white.
pub(super) fn colors_of(
    job: &mut Job<'_>,
    files: &[Vec<u8>],
    runs: &[MaterialRun],
    triangles: usize,
) -> Vec<[u8; 4]> {
    if !job.options.materials || triangles == 0 {
        job.inventory.left_materials(files, "not asked for");
        return Vec::new();
    }
    let materials = read_files(job, files);
    if materials.list.is_empty() {
        return Vec::new();
    }
    let mut colors = vec![WHITE; triangles];
    let mut counts = vec![0; materials.list.len()];
    let mut unknown: Vec<&[u8]> = Vec::new();
    let mut seen = HashSet::new();
    for (index, run) in runs.iter().enumerate() {
        let end = runs.get(index + 1).map_or(triangles, |next| next.first);
        if run.first == end {
            continue;
        }
        match materials.find(&run.name) {
            Some(found) => {
                colors[run.first..end].fill(materials.list[found].color());
                counts[found] += (end - run.first) as u64;
            }
            None if seen.insert(&run.name) => unknown.push(&run.name),
            None => {}
        }
    }
    for (material, count) in materials.list.iter().zip(counts) {
        material.list(&mut job.inventory, count);
    }
    if materials
        .list
        .iter()
        .any(|material| material.is_transparent)
    {
        job.inventory.leave_out("transparency of materials");
    }
    if let Some(name) = unknown.first() {
        job.warn(Warning::MaterialUnknown {
            name: shown(name),
            count: unknown.len() as u64,
        });
    }
    if colors.iter().all(|&color| color == WHITE) {
        Vec::new()
    } else {
        colors
    }
}

impl Inventory {
    /// Lists material files that were not looked for.
    pub(super) fn left_materials(&mut self, files: &[Vec<u8>], why: &str) {
        for name in files.iter().take(MOST_MATERIAL_FILES) {
            let name = format!("material file {}", shown(name));
            self.add(name, 1, PartFate::LeftOut, why);
        }
    }
}

fn read_files(job: &mut Job<'_>, lines: &[Vec<u8>]) -> Materials {
    let mut materials = Materials::default();
    let mut folder = job.folder.map(MaterialFolder::new);
    let mut seen = HashSet::new();
    let mut names = Vec::new();
    for line in lines.iter().filter(|line| seen.insert(*line)) {
        if names.len() >= MOST_MATERIAL_FILES {
            break;
        }
        let line = String::from_utf8_lossy(line);
        // In quotes, one name with spaces, or several names.
        let is_one = line.contains('"')
            || folder
                .as_mut()
                .is_some_and(|folder| folder.find(&line).is_ok());
        if is_one {
            names.extend(
                line.split('"')
                    .map(str::trim)
                    .filter(|name| !name.is_empty())
                    .map(str::to_owned),
            );
        } else {
            names.extend(line.split_whitespace().map(str::to_owned));
        }
    }
    names.truncate(MOST_MATERIAL_FILES);
    for name in names {
        let result = match &mut folder {
            Some(folder) => folder
                .find(&name)
                .and_then(|path| materials.add_file(&path)),
            None => Err("the model was not read from a file".to_owned()),
        };
        let part = format!("material file {}", shown(name.as_bytes()));
        match result {
            Ok(()) => job.inventory.add(part, 1, PartFate::Used, ""),
            Err(reason) => {
                job.inventory
                    .add(part, 1, PartFate::LeftOut, reason.clone());
                let name = shown(name.as_bytes());
                job.warn(Warning::MaterialFileMissing { name, reason });
            }
        }
    }
    let textures = || {
        materials
            .list
            .iter()
            .flat_map(|material| &material.textures)
    };
    if let Some(name) = textures().next() {
        let (name, count) = (name.clone(), textures().count() as u64);
        job.warn(Warning::TextureIgnored { name, count });
    }
    materials
}

/// The folder of a model, where its material files are.
struct MaterialFolder<'a> {
    path: &'a Path,
    /// Names by their lower case, read when first needed.
    entries: Option<HashMap<String, PathBuf>>,
}

impl<'a> MaterialFolder<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            entries: None,
        }
    }

    /// The file of a name that a model gives.
    fn find(&mut self, name: &str) -> Result<PathBuf, String> {
        let name = name.trim().trim_matches('"').replace('\\', "/");
        let named = self.path.join(&name);
        if named.is_file() {
            return Ok(named);
        }
        let last = name.rsplit('/').next().unwrap_or_default().trim();
        let beside = self.path.join(last);
        if !last.is_empty() && beside.is_file() {
            return Ok(beside);
        }
        let path = self.path;
        let entries = self.entries.get_or_insert_with(|| {
            let folder = if path.as_os_str().is_empty() {
                Path::new(".")
            } else {
                path
            };
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            entries
                .take(MOST_ENTRIES)
                .map(|entry| {
                    let name = entry.file_name();
                    (name.to_string_lossy().to_lowercase(), path.join(name))
                })
                .collect()
        });
        match entries.get(&last.to_lowercase()) {
            Some(found) if found.is_file() => Ok(found.clone()),
            Some(_) => Err("not a file".to_owned()),
            None => Err("there is no such file".to_owned()),
        }
    }
}

/// A material of a material file.
#[derive(Debug, Clone, Default)]
struct Material {
    name: Vec<u8>,
    diffuse: Option<[u8; 4]>,
    /// Diffuse textures that were named.
    textures: Vec<String>,
    is_transparent: bool,
}

impl Material {
    /// White without a color. Black under a texture is what exporters write for no color.
    fn color(&self) -> [u8; 4] {
        match self.diffuse {
            Some([0, 0, 0, _]) if !self.textures.is_empty() => WHITE,
            diffuse => diffuse.unwrap_or(WHITE),
        }
    }

    /// Lists the material with the triangles it has.
    fn list(&self, inventory: &mut Inventory, triangles: u64) {
        let [red, green, blue, _] = self.color();
        let mut note = format!("triangles in color {red} {green} {blue}");
        if self.diffuse.is_some_and(|diffuse| diffuse != self.color()) {
            note += ", not in the black under its texture";
        }
        if self.is_transparent {
            note += "; drawn opaque";
        }
        let name = format!("material {}", shown(&self.name));
        inventory.add(name, triangles, PartFate::Used, note);
        for texture in &self.textures {
            let name = format!("texture {texture}");
            inventory.add(name, 1, PartFate::LeftOut, "textures are not read");
        }
    }
}

/// Materials in the order in which they were first defined.
#[derive(Debug, Default)]
struct Materials {
    list: Vec<Material>,
    by_name: HashMap<Vec<u8>, usize>,
    /// By the name in lower case without quotes, the first of each.
    by_likeness: HashMap<Vec<u8>, usize>,
}

/// A name in lower case without quotes.
fn likeness(name: &[u8]) -> Vec<u8> {
    let is_quote = |byte: &u8| matches!(byte, b'"' | b'\'');
    let bare: Vec<u8> = name
        .iter()
        .copied()
        .filter(|byte| !is_quote(byte))
        .collect();
    bare.trim_ascii().to_ascii_lowercase()
}

impl Materials {
    /// The material of a name: as written, or but for case and quotes.
    fn find(&self, name: &[u8]) -> Option<usize> {
        let exact = self.by_name.get(name);
        exact
            .or_else(|| self.by_likeness.get(&likeness(name)))
            .copied()
    }

    /// Adds the materials of a file; one defined twice keeps its last definition.
    ///
    /// # Errors
    /// A sentence why the file cannot be read. Its content never is an error: lines that are not understood define
    /// nothing.
    fn add_file(&mut self, path: &Path) -> Result<(), String> {
        // A model must not make us wait for a pipe or a device.
        let metadata = std::fs::metadata(path).map_err(|error| error.to_string())?;
        if !metadata.is_file() {
            return Err("not a file".to_owned());
        }
        let file = File::open(path).map_err(|error| error.to_string())?;
        let mut data = Vec::new();
        file.take(LARGEST_BYTES)
            .read_to_end(&mut data)
            .map_err(|error| error.to_string())?;
        // A byte order mark is no part of the first keyword.
        self.add(data.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&data));
        Ok(())
    }

    fn add(&mut self, data: &[u8]) {
        let mut scanner = Scanner::new(data, 0);
        let mut current: Option<usize> = None;
        while let Some((line, _)) = scanner.line() {
            let line = line.trim_ascii();
            let mut line_words = words(line);
            let Some(keyword) = line_words.next() else {
                continue;
            };
            let is = |wanted: &[u8]| keyword.eq_ignore_ascii_case(wanted);
            if is(b"newmtl") {
                current = Some(self.define(line[b"newmtl".len()..].trim_ascii()));
                continue;
            }
            let Some(material) = current.map(|index| &mut self.list[index]) else {
                continue;
            };
            let mut number = || line_words.next().and_then(parse_f64);
            if is(b"Kd") {
                // `Kd spectral file` and `Kd xyz` are not colors we can use; a single number is a gray.
                let Some(red) = number() else { continue };
                let (green, blue) = (number().unwrap_or(red), number().unwrap_or(red));
                // Some write bytes.
                let largest = if red.max(green).max(blue) > 2.0 {
                    255.0
                } else {
                    1.0
                };
                let [r, g, b] = [red, green, blue].map(|value| color_from_unit(value / largest));
                material.diffuse = Some([r, g, b, 255]);
            } else if is(b"map_Kd") {
                material.textures.extend(line_words.last().map(shown));
            } else if is(b"d") {
                material.is_transparent = number().is_some_and(|value| value < 1.0);
            } else if is(b"Tr") {
                material.is_transparent = number().is_some_and(|value| value > 0.0);
            }
        }
    }

    fn define(&mut self, name: &[u8]) -> usize {
        let material = Material {
            name: name.to_vec(),
            ..Material::default()
        };
        let next = self.list.len();
        let index = *self.by_name.entry(name.to_vec()).or_insert(next);
        if index == next {
            self.list.push(material);
            self.by_likeness.entry(likeness(name)).or_insert(next);
        } else {
            self.list[index] = material;
        }
        index
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn diffuse_colors_by_name() {
        let mut materials = Materials::default();
        materials.add(
            b"Kd 1 0 0\n# c\nnewmtl red one\r\nKd 1 0 0\r\nmap_Kd -s 1 1 a.png\nnewmtl gray\nKd 0.5\nmap_Kd \n\
              newmtl odd\nKd spectral a.rfl\nKd\nNEWMTL Bytes\nkd 255 0 51\nnewmtl photo\nmap_kd b.jpg\nKd 0 0 0\n\
              newmtl night\nKd 0 0 0\n",
        );
        let color = |name: &str| {
            let index = materials.find(name.as_bytes()).unwrap();
            materials.list[index].color()
        };
        assert_eq!(color("red one"), [255, 0, 0, 255]);
        assert_eq!(color("\"Red One\""), [255, 0, 0, 255]);
        assert_eq!(color("gray"), [128, 128, 128, 255]);
        assert_eq!(color("odd"), WHITE);
        assert_eq!(color("bytes"), [255, 0, 51, 255]);
        // Black says nothing under a texture, and is black without.
        assert_eq!((color("photo"), color("night")), (WHITE, [0, 0, 0, 255]));
        assert_eq!(materials.find(b"blue"), None);
        assert_eq!(materials.list.len(), 6);
        assert_eq!(materials.list[0].textures, ["a.png"]);
    }

    #[test]
    fn material_files_are_found_by_their_last_part() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join("Scan One.MTL"), "").unwrap();
        std::fs::create_dir(at.join("deep")).unwrap();
        std::fs::write(at.join("deep").join("a.mtl"), "").unwrap();
        let mut found = MaterialFolder::new(at);
        for name in [
            "Scan One.MTL",
            "scan one.mtl",
            "\"./scan one.mtl\"",
            r"C:\scans\of today\SCAN ONE.mtl",
            r"./D:\x\Scan One.MTL",
            "/elsewhere/Scan One.mtl",
        ] {
            assert_eq!(found.find(name), Ok(at.join("Scan One.MTL")), "{name}");
        }
        assert_eq!(found.find("deep/a.mtl"), Ok(at.join("deep/a.mtl")));
        assert_eq!(found.find(r"deep\a.mtl"), Ok(at.join("deep/a.mtl")));
        assert_eq!(found.find("deep"), Err("not a file".to_owned()));
        assert!(found.find("none.mtl").is_err() && found.find("").is_err());
    }
}
