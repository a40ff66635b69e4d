//! OBJ (Wavefront, "Object Files", appendix B1 of the Advanced Visualizer manual): vertices with optional colors,
//! normals, polygons, and the diffuse colors of materials.
//!
//! Positions and normals have indices of their own, a mesh has one. Vertex `i` of the mesh is position `i` of the
//! file with the first normal and color that a face gives it; every further combination becomes a vertex at the
//! end. Normals that are equal in value count as equal, since many writers repeat them for every corner.
//!
//! A reader of our own, not the tobj crate: that one gives no line numbers, single precision only, drops vertices
//! that no face names, and gives up on a material file with an empty `map_Kd`.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::assemble::{Coordinates, Raw, color_from_unit};
use super::job::{Job, at_line};
use super::mtl::Materials;
use super::text::{Scanner, parse_f64, parse_i64, shown, words};
use super::{Counts, Error, Warning};

/// Index of a corner that names no normal.
const NO_NORMAL: u32 = u32::MAX;

/// The file as it was written, with indices from 0.
#[derive(Debug, Default)]
struct File {
    positions: Vec<DVec3>,
    /// Color of every position up to the last that has one.
    colors: Vec<[u8; 4]>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Normals of the corners of every triangle up to the last that has one.
    corner_normals: Vec<[u32; 3]>,
    /// First triangle and name of every run of one material.
    material_runs: Vec<(usize, Vec<u8>)>,
    material_files: Vec<Vec<u8>>,
    faces: u64,
    small_faces: u64,
    ignored: u64,
    /// The largest position and normal that a face names before they appear, and where.
    ahead: [Option<(u64, usize)>; 2],
}

/// Reads an OBJ file.
pub(super) fn read(job: &mut Job<'_>, data: &[u8]) -> Result<Raw, Error> {
    let file = File::parse(job, data)?;
    for (what, count, ahead) in [
        ("vertex", file.positions.len(), file.ahead[0]),
        ("normal", file.normals.len(), file.ahead[1]),
    ] {
        if let Some((index, at)) = ahead
            && index > count as u64
        {
            return Err(job.index(at_line(data, at), what, index as i64, count as u64, 1));
        }
    }
    job.warn_count(file.small_faces, |count| Warning::FacesTooSmall { count });
    job.warn_count(file.ignored, |count| Warning::PartsIgnored {
        what: "lines, points and curves",
        count,
    });
    let colors = material_colors(job, &file);
    Ok(file.split(colors))
}

impl File {
    fn parse(job: &mut Job<'_>, data: &[u8]) -> Result<File, Error> {
        let mut file = File::default();
        let mut scanner = Scanner::new(data, 0);
        let mut corners = Vec::new();
        while let Some((line, at)) = scanner.line() {
            let line = joined(line, &mut scanner);
            let mut line_words = words(&line);
            let Some(keyword) = line_words.next() else {
                continue;
            };
            match keyword {
                b"v" => file.vertex(job, data, at, line_words)?,
                b"vn" => {
                    let [x, y, z] = three(job, data, at, &mut line_words)?;
                    file.normals.push(Vec3::new(x as f32, y as f32, z as f32));
                }
                b"f" | b"fo" => file.face(job, data, at, line_words, &mut corners)?,
                b"usemtl" => {
                    file.material_runs
                        .push((file.triangles.len(), after_keyword(&line).to_vec()));
                }
                b"mtllib" => file.material_files.push(after_keyword(&line).to_vec()),
                b"l" | b"p" | b"curv" | b"curv2" | b"surf" => file.ignored += 1,
                // Texture coordinates, groups, smoothing, names, and whatever programs add of their own.
                _ => {}
            }
            job.reach(scanner.at)?;
        }
        job.check_vertices(file.positions.len() as u64)?;
        Ok(file)
    }

    /// `v x y z`, with a weight, or with a color (and an alpha, which is ignored).
    fn vertex<'a>(
        &mut self,
        job: &Job<'_>,
        data: &[u8],
        at: usize,
        mut line_words: impl Iterator<Item = &'a [u8]>,
    ) -> Result<(), Error> {
        self.positions
            .push(three(job, data, at, &mut line_words)?.into());
        let mut extra = [0.0; 4];
        let mut count = 0;
        for word in line_words.take_while(|word| !word.starts_with(b"#")) {
            let number =
                parse_f64(word).ok_or_else(|| job.number(at_line(data, at), word, "a number"))?;
            if let Some(slot) = extra.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if count >= 3 {
            self.colors.resize(self.positions.len() - 1, [255; 4]);
            let [r, g, b] = [extra[0], extra[1], extra[2]].map(color_from_unit);
            self.colors.push([r, g, b, 255]);
        }
        Ok(())
    }

    /// `f` with corners `p`, `p/t`, `p//n` or `p/t/n`; a fan of triangles about its first corner.
    fn face<'a>(
        &mut self,
        job: &Job<'_>,
        data: &[u8],
        at: usize,
        line_words: impl Iterator<Item = &'a [u8]>,
        corners: &mut Vec<(u32, u32)>,
    ) -> Result<(), Error> {
        corners.clear();
        for word in line_words.take_while(|word| !word.starts_with(b"#")) {
            let mut parts = word.split(|&byte| byte == b'/');
            let position = parts.next().unwrap_or_default();
            let position = self.resolve(job, data, at, word, position, 0)?;
            let texture = parts.next().unwrap_or_default();
            if !texture.is_empty() && parse_i64(texture).is_none() {
                return Err(job.number(at_line(data, at), word, "a corner of a face"));
            }
            let normal = match parts.next() {
                Some(normal) if !normal.is_empty() => {
                    self.resolve(job, data, at, word, normal, 1)?
                }
                _ => NO_NORMAL,
            };
            if parts.next().is_some() {
                return Err(job.number(at_line(data, at), word, "a corner of a face"));
            }
            corners.push((position, normal));
        }
        self.faces += 1;
        let Some((&first, fan)) = corners.split_first().filter(|_| corners.len() >= 3) else {
            self.small_faces += 1;
            return Ok(());
        };
        if corners.iter().any(|corner| corner.1 != NO_NORMAL) {
            self.corner_normals
                .resize(self.triangles.len(), [NO_NORMAL; 3]);
            self.corner_normals
                .extend(fan.windows(2).map(|pair| [first.1, pair[0].1, pair[1].1]));
        }
        self.triangles
            .extend(fan.windows(2).map(|pair| [first.0, pair[0].0, pair[1].0]));
        Ok(())
    }

    /// An index from 0 of a position (`list` 0) or normal (1), written from 1 or backwards from -1. One that points
    /// ahead is noted and checked when the file has been read.
    #[inline]
    fn resolve(
        &mut self,
        job: &Job<'_>,
        data: &[u8],
        at: usize,
        word: &[u8],
        part: &[u8],
        list: usize,
    ) -> Result<u32, Error> {
        let (what, count) = [
            ("vertex", self.positions.len()),
            ("normal", self.normals.len()),
        ][list];
        let index = parse_i64(part)
            .ok_or_else(|| job.number(at_line(data, at), word, "a corner of a face"))?;
        let from_one = if index < 0 {
            index.saturating_add(count as i64 + 1)
        } else {
            index
        };
        if from_one <= 0 || from_one >= i64::from(NO_NORMAL) {
            return Err(job.index(at_line(data, at), what, index, count as u64, 1));
        }
        let from_one = from_one as u64;
        if from_one > count as u64 && self.ahead[list].is_none_or(|(largest, _)| from_one > largest)
        {
            self.ahead[list] = Some((from_one, at));
        }
        Ok((from_one - 1) as u32)
    }

    /// Gives every combination of position, normal and color a vertex. `colors` holds a color per triangle, or
    /// nothing.
    fn split(mut self, colors: Vec<[u8; 4]>) -> Raw {
        let counts = Counts {
            vertices: self.positions.len() as u64,
            faces: self.faces,
        };
        if !self.colors.is_empty() {
            self.colors.resize(self.positions.len(), [255; 4]);
        }
        if self.normals.is_empty() || self.corner_normals.is_empty() {
            self.corner_normals = Vec::new();
        } else {
            self.corner_normals
                .resize(self.triangles.len(), [NO_NORMAL; 3]);
        }
        // A cloud with a normal per point, as some scanners write: the lists run side by side.
        if self.triangles.is_empty() && self.normals.len() == self.positions.len() {
            return self.raw(counts);
        }
        self.normals.push(Vec3::ZERO);
        let normals = std::mem::take(&mut self.normals);
        if self.corner_normals.is_empty() && colors.is_empty() {
            return self.raw(counts);
        }
        let has_normals = !self.corner_normals.is_empty();
        let mut absent = 0;

        type Attributes = ([u32; 3], [u8; 4]);
        let mut of_vertex: Vec<Option<Attributes>> = vec![None; self.positions.len()];
        let mut further: HashMap<(u32, Attributes), u32> = HashMap::new();
        for index in 0..self.triangles.len() {
            let color = colors.get(index).copied().unwrap_or([255; 4]);
            for corner in 0..3 {
                let position = self.triangles[index][corner];
                let normal = self
                    .corner_normals
                    .get(index)
                    .map_or(NO_NORMAL, |normals| normals[corner]);
                // The last normal is the unknown one.
                let normal = normals[(normal as usize).min(normals.len() - 1)];
                let wanted = (normal.to_array().map(f32::to_bits), color);
                let first = &mut of_vertex[position as usize];
                if *first.get_or_insert(wanted) == wanted {
                    continue;
                }
                let next = self.positions.len() as u32;
                let vertex = *further.entry((position, wanted)).or_insert(next);
                if vertex == next {
                    self.positions.push(self.positions[position as usize]);
                    if let Some(&color) = self.colors.get(position as usize) {
                        self.colors.push(color);
                    }
                    of_vertex.push(Some(wanted));
                }
                self.triangles[index][corner] = vertex;
            }
        }
        if has_normals {
            let normal = |attributes: &Option<Attributes>| {
                attributes.map_or(Vec3::ZERO, |(normal, _)| {
                    Vec3::from_array(normal.map(f32::from_bits))
                })
            };
            self.normals = of_vertex.iter().map(normal).collect();
            // Vertices that no face names, and corners without a normal; a zero in the list itself was written.
            let unknown = [0; 3];
            let is_absent =
                |of: &&Option<Attributes>| of.is_none_or(|(normal, _)| normal == unknown);
            absent = of_vertex.iter().filter(is_absent).count() as u64;
        }
        if !colors.is_empty() {
            self.colors = of_vertex
                .iter()
                .map(|attributes| attributes.map_or([255; 4], |(_, color)| color))
                .collect();
        }
        Raw {
            absent_normals: absent,
            ..self.raw(counts)
        }
    }

    fn raw(self, counts: Counts) -> Raw {
        Raw {
            coordinates: Coordinates::Double(self.positions),
            normals: self.normals,
            absent_normals: 0,
            colors: self.colors,
            triangles: self.triangles,
            counts,
        }
    }
}

/// The line with those that follow it while they end in a backslash.
fn joined<'a>(line: &'a [u8], scanner: &mut Scanner<'a>) -> Cow<'a, [u8]> {
    if !line.ends_with(b"\\") {
        return Cow::Borrowed(line);
    }
    let mut whole = line[..line.len() - 1].to_vec();
    while let Some((next, _)) = scanner.line() {
        whole.push(b' ');
        match next.strip_suffix(b"\\") {
            Some(next) => whole.extend(next),
            None => {
                whole.extend(next);
                break;
            }
        }
    }
    Cow::Owned(whole)
}

/// What follows the first word, trimmed; names may hold spaces.
fn after_keyword(line: &[u8]) -> &[u8] {
    let line = line.trim_ascii();
    line.iter()
        .position(u8::is_ascii_whitespace)
        .map_or(&[], |end| line[end..].trim_ascii())
}

fn three<'a>(
    job: &Job<'_>,
    data: &[u8],
    at: usize,
    line_words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<[f64; 3], Error> {
    let mut numbers = [0.0; 3];
    for number in &mut numbers {
        let word = line_words.next().unwrap_or_default();
        *number = parse_f64(word).ok_or_else(|| job.number(at_line(data, at), word, "a number"))?;
    }
    Ok(numbers)
}

/// A color per triangle from the materials; empty when vertices have colors, when not wanted, or when there is
/// nothing but white.
fn material_colors(job: &mut Job<'_>, file: &File) -> Vec<[u8; 4]> {
    if !job.options.materials || !file.colors.is_empty() || file.triangles.is_empty() {
        return Vec::new();
    }
    let materials = read_materials(job, &file.material_files);
    if materials.diffuse.is_empty() {
        return Vec::new();
    }
    let mut colors = vec![[255; 4]; file.triangles.len()];
    let mut unknown: Vec<&[u8]> = Vec::new();
    let mut seen = HashSet::new();
    for (run, (start, name)) in file.material_runs.iter().enumerate() {
        let end = file
            .material_runs
            .get(run + 1)
            .map_or(colors.len(), |next| next.0);
        if *start == end {
            continue;
        }
        match materials.diffuse.get(name) {
            Some(&color) => colors[*start..end].fill(color),
            None if seen.insert(name) => unknown.push(name),
            None => {}
        }
    }
    if let Some(name) = unknown.first() {
        job.warn(Warning::MaterialUnknown {
            name: shown(name),
            count: unknown.len() as u64,
        });
    }
    if colors.iter().all(|&color| color == [255; 4]) {
        Vec::new()
    } else {
        colors
    }
}

/// Most names of material files that are looked for: a model made for harm could name millions.
const MOST_MATERIAL_FILES: usize = 100;

fn read_materials(job: &mut Job<'_>, lines: &[Vec<u8>]) -> Materials {
    let mut materials = Materials::default();
    let mut seen = HashSet::new();
    let mut names = Vec::new();
    for line in lines.iter().filter(|line| seen.insert(*line)) {
        if names.len() >= MOST_MATERIAL_FILES {
            break;
        }
        // One name with spaces, or several names.
        let whole = String::from_utf8_lossy(line).replace('\\', "/");
        if job
            .folder
            .is_some_and(|folder| folder.join(&whole).is_file())
        {
            names.push(whole);
        } else {
            names.extend(whole.split_whitespace().map(str::to_owned));
        }
    }
    names.truncate(MOST_MATERIAL_FILES);
    for name in names {
        let result = match job.folder {
            Some(folder) => materials.add_file(&folder.join(&name)),
            None => Err("the model was not read from a file".to_owned()),
        };
        if let Err(reason) = result {
            let name = shown(name.as_bytes());
            job.warn(Warning::MaterialFileMissing { name, reason });
        }
    }
    if let Some(name) = materials.textures.first() {
        let (name, count) = (name.clone(), materials.textures.len() as u64);
        job.warn(Warning::TextureIgnored { name, count });
    }
    materials
}
