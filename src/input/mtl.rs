//! Materials of OBJ: the files that define them, the diffuse color and the diffuse texture of each, nothing else.
//!
//! A material file is found as it is named, or beside the model by the last part of its name, whatever the case, the
//! slashes and the quotes: exporters write the paths of their own machine.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::ReadWarning;
use super::color::color_from_unit;
use super::job::ReadJob;
use super::material_texture::{ImagePlace, MaterialTexture};
use super::part::{PartFate, PartInventory};
use super::text::{TextScanner, parse_f64, shown, words};
use super::textures::{ImageBytes, ImageSource, ImageTint};
use crate::textures::NO_IMAGE;

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
    /// First triangle of these faces.
    pub(super) first: usize,
    /// The material's name as written.
    pub(super) name: Vec<u8>,
}

/// What materials give triangles.
#[derive(Debug, Default)]
pub(super) struct MaterialLooks {
    /// A color of each triangle; empty when there is nothing but white.
    pub(super) colors: Vec<[u8; 4]>,
    /// The texture of each triangle, or [`NO_IMAGE`]; empty when there is none.
    pub(super) image_of: Vec<u32>,
    /// The textures: as many as `sources`.
    pub(super) places: Vec<ImagePlace>,
    pub(super) sources: Vec<ImageSource>,
}

impl MaterialLooks {
    /// The number of a material's texture, which is added when it is new.
    fn image_of(&mut self, material: &MtlMaterial, folder: &mut Option<MaterialFolder<'_>>) -> u32 {
        let Some(texture) = &material.texture else {
            return NO_IMAGE;
        };
        let bytes = match folder {
            None => ImageBytes::Missing("the model was not read from a file".to_owned()),
            Some(folder) => {
                let beside = material.folder.join(texture.name.replace('\\', "/"));
                let found = match beside.is_file() {
                    true => Ok(beside),
                    false => folder.find(&texture.name),
                };
                found.map_or_else(ImageBytes::Missing, ImageBytes::File)
            }
        };
        let wrap = [texture.wrap; 2];
        let tint = material.tint();
        let known = self
            .sources
            .iter()
            .zip(&self.places)
            .position(|(known, place)| {
                let is_same = match (&known.bytes, &bytes) {
                    (ImageBytes::File(one), ImageBytes::File(other)) => one == other,
                    _ => known.name == texture.name,
                };
                is_same && (known.wrap, known.tint, *place) == (wrap, tint, texture.place)
            });
        known.unwrap_or_else(|| {
            self.sources.push(ImageSource {
                name: texture.name.clone(),
                bytes,
                wrap,
                tint,
            });
            self.places.push(texture.place);
            self.sources.len() - 1
        }) as u32
    }
}

/// What the materials give each triangle; nothing when not wanted. Textures only where triangles `have_places` in them.
pub(super) fn looks_of(
    job: &mut ReadJob<'_>,
    files: &[Vec<u8>],
    runs: &[MaterialRun],
    (triangles, have_places): (usize, bool),
) -> MaterialLooks {
    let mut looks = MaterialLooks::default();
    if !job.options.materials || triangles == 0 {
        job.inventory.left_materials(files, "not asked for");
        return looks;
    }
    let materials = read_files(job, files);
    if materials.list.is_empty() {
        return looks;
    }
    let has_images = job.options.textures && have_places;
    let mut folder = job.folder.map(MaterialFolder::new);
    let mut image_of_material: HashMap<usize, u32> = HashMap::new();
    let mut image_of = vec![NO_IMAGE; if has_images { triangles } else { 0 }];
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
                if has_images {
                    let material = &materials.list[found];
                    let image = *(image_of_material.entry(found))
                        .or_insert_with(|| looks.image_of(material, &mut folder));
                    image_of[run.first..end].fill(image);
                }
            }
            None if seen.insert(&run.name) => unknown.push(&run.name),
            None => {}
        }
    }
    for (material, count) in materials.list.iter().zip(counts) {
        let left = match (have_places, job.options.textures) {
            (_, true) if has_images => None,
            (false, _) => Some("the faces have no texture coordinates"),
            (true, _) => Some("not asked for"),
        };
        material.list(&mut job.inventory, count, left);
    }
    if materials
        .list
        .iter()
        .any(|material| material.is_transparent)
    {
        job.inventory.leave_out("transparency of materials");
    }
    let unplaced = materials.list.iter().filter(|_| !have_places);
    let mut unplaced = unplaced.filter_map(|material| material.texture.as_ref());
    if let Some(first) = unplaced.next() {
        job.warn(ReadWarning::TextureIgnored {
            name: shown(first.name.as_bytes()),
            count: 1 + unplaced.count() as u64,
        });
    }
    if let Some(name) = unknown.first() {
        job.warn(ReadWarning::MaterialUnknown {
            name: shown(name),
            count: unknown.len() as u64,
        });
    }
    if colors.iter().any(|&color| color != WHITE) {
        looks.colors = colors;
    }
    if !looks.sources.is_empty() {
        looks.image_of = image_of;
    }
    looks
}

impl PartInventory {
    /// Lists material files that were not looked for.
    pub(super) fn left_materials(&mut self, files: &[Vec<u8>], why: &str) {
        for name in files.iter().take(MOST_MATERIAL_FILES) {
            let name = format!("material file {}", shown(name));
            self.add(name, 1, PartFate::LeftOut, why);
        }
    }
}

fn read_files(job: &mut ReadJob<'_>, lines: &[Vec<u8>]) -> MaterialTable {
    let mut materials = MaterialTable::default();
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
                job.warn(ReadWarning::MaterialFileMissing { name, reason });
            }
        }
    }
    materials
}

/// The folder of a model, where its material files are.
pub(super) struct MaterialFolder<'a> {
    path: &'a Path,
    /// Names by their lower case, read when first needed.
    entries: Option<HashMap<String, PathBuf>>,
}

impl<'a> MaterialFolder<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self {
            path,
            entries: None,
        }
    }

    /// The file of a name that a model gives.
    pub(super) fn find(&mut self, name: &str) -> Result<PathBuf, String> {
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
struct MtlMaterial {
    name: Vec<u8>,
    diffuse: Option<[u8; 4]>,
    texture: Option<MaterialTexture>,
    is_transparent: bool,
    /// Of its file.
    folder: PathBuf,
}

impl MtlMaterial {
    /// White without a color. Black under a texture is what exporters write for no color.
    fn color(&self) -> [u8; 4] {
        match self.diffuse {
            Some([0, 0, 0, _]) if self.texture.is_some() => WHITE,
            diffuse => diffuse.unwrap_or(WHITE),
        }
    }

    /// What its texture is multiplied by. A gray is what exporters write for no color.
    fn tint(&self) -> Option<ImageTint> {
        let [red, green, blue, _] = self.color();
        (red != green || green != blue).then_some(ImageTint::Stored([red, green, blue]))
    }

    /// Lists the material with the triangles it has, and why its texture is `left` out.
    fn list(&self, inventory: &mut PartInventory, triangles: u64, left: Option<&str>) {
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
        if let (Some(texture), Some(why)) = (&self.texture, left) {
            let name = format!("texture {}", shown(texture.name.as_bytes()));
            inventory.add(name, 1, PartFate::LeftOut, why);
        }
    }
}

/// Materials in the order in which they were first defined.
#[derive(Debug, Default)]
struct MaterialTable {
    list: Vec<MtlMaterial>,
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

impl MaterialTable {
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
        let first = self.list.len();
        self.add(data.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&data));
        for material in &mut self.list[first..] {
            material.folder = path.parent().unwrap_or(Path::new("")).to_owned();
        }
        Ok(())
    }

    fn add(&mut self, data: &[u8]) {
        let mut scanner = TextScanner::new(data, 0);
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
                let text = String::from_utf8_lossy(&line[keyword.len()..]);
                material.texture = MaterialTexture::parse(&text).or(material.texture.take());
            } else if is(b"d") {
                material.is_transparent = number().is_some_and(|value| value < 1.0);
            } else if is(b"Tr") {
                material.is_transparent = number().is_some_and(|value| value > 0.0);
            }
        }
    }

    fn define(&mut self, name: &[u8]) -> usize {
        let material = MtlMaterial {
            name: name.to_vec(),
            ..MtlMaterial::default()
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
        let mut materials = MaterialTable::default();
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
        let texture = materials.list[0].texture.as_ref().unwrap();
        assert_eq!(texture.name, "a.png");
        assert!(materials.list[0].tint().is_some() && materials.list[1].tint().is_none());
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
