//! OBJ (Wavefront, "Object Files", appendix B1 of the Advanced Visualizer manual): vertices with optional colors,
//! normals, polygons, and the diffuse colors and textures of materials.
//!
//! Positions and normals have indices of their own, a mesh has one. Vertex `i` of the mesh is position `i` of the
//! file with the first normal and color that a face gives it; every further combination becomes a vertex at the
//! end. Normals that are equal in value count as equal, since many writers repeat them for every corner.
//!
//! A reader of our own, not the tobj crate: that one gives no line numbers, single precision only, drops vertices
//! that no face names, and gives up on a material file with an empty `map_Kd`.

use std::borrow::Cow;
use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3};

use super::assemble::{FileCoordinates, RawMesh};
use super::color::{ColorRange, ColorSink};
use super::job::{ReadJob, at_line};
use super::mtl::{self, MaterialLooks, MaterialRun};
use super::part::{PartFate, PartFault};
use super::pointed_index::{NO_INDEX, PointedIndex};
use super::polygon::{FaceList, without_repeated};
use super::text::{TextScanner, after_keyword, parse_f64, parse_i64, shown, words};
use super::textures::RawTextures;
use super::{Error, FileCounts, ReadWarning};

/// Corner of a face: indices of its position, normal and texture coordinate.
#[derive(Debug, Clone, Copy)]
struct FaceCorner {
    position: u32,
    normal: u32,
    texture: u32,
}

/// The file as it was written, with indices from 0.
#[derive(Debug)]
struct ObjFile {
    positions: Vec<DVec3>,
    /// Color of every position up to the last that has one.
    colors: ColorSink,
    normals: Vec<Vec3>,
    /// Texture coordinates from the lower left.
    textures: Vec<Vec2>,
    list: FaceList,
    /// Normals of the corners of every triangle up to the last that has one.
    corner_normals: Vec<[u32; 3]>,
    /// Texture coordinates of the corners, likewise.
    corner_textures: Vec<[u32; 3]>,
    material_runs: Vec<MaterialRun>,
    material_files: Vec<Vec<u8>>,
    ignored: u64,
    /// The largest position that a face names before it appears, and where.
    ahead: Option<(u64, usize)>,
    pointed_normals: PointedIndex,
    pointed_textures: PointedIndex,
    /// Other keywords, and on how many lines.
    others: Vec<(Vec<u8>, u64)>,
}

/// Most different keywords that are listed.
const MOST_KEYWORDS: usize = 40;

/// Reads an OBJ file.
pub(super) fn read(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let mut file = ObjFile::parse(job, data)?;
    let count = file.positions.len() as u64;
    if let Some((index, at)) = file.ahead
        && index > count
    {
        return Err(job.index(at_line(data, at), "vertex", index as i64, count, 1));
    }
    file.forget_missing(job, data);
    file.list.warn(job);
    job.warn_count(file.ignored, |count| ReadWarning::PartsIgnored {
        what: "lines, points and curves",
        count,
    });
    if let Some(remark) = file.colors.remark() {
        job.warn(remark);
    }
    let (has_colors, have_places) = (
        !file.colors.colors.is_empty(),
        !file.corner_textures.is_empty(),
    );
    let mut looks = MaterialLooks::default();
    if has_colors && !have_places {
        job.inventory
            .left_materials(&file.material_files, "vertices have colors");
    } else {
        let faces = (file.list.triangles.len(), have_places);
        looks = mtl::looks_of(job, &file.material_files, &file.material_runs, faces);
    }
    if has_colors {
        looks.colors = Vec::new();
    }
    let textures = file.textures_of(&mut looks);
    file.list_parts(job, textures.is_some());
    let mut raw = file.split(looks.colors);
    raw.textures = textures;
    Ok(raw)
}

impl ObjFile {
    fn parse(job: &mut ReadJob<'_>, data: &[u8]) -> Result<ObjFile, Error> {
        let mut file = ObjFile {
            positions: Vec::new(),
            colors: ColorSink::new([ColorRange::FLOAT; 3]),
            normals: Vec::new(),
            textures: Vec::new(),
            list: FaceList::default(),
            corner_normals: Vec::new(),
            corner_textures: Vec::new(),
            material_runs: Vec::new(),
            material_files: Vec::new(),
            ignored: 0,
            ahead: None,
            pointed_normals: PointedIndex::default(),
            pointed_textures: PointedIndex::default(),
            others: Vec::new(),
        };
        let mut scanner = TextScanner::new(data, 0);
        let mut corners = Vec::new();
        while let Some((line, at)) = scanner.line() {
            let line = joined(line, &mut scanner);
            let mut line_words = words(&line);
            let Some(keyword) = line_words.next() else {
                continue;
            };
            match keyword {
                b"v" => file.vertex(job, data, at, line_words)?,
                b"vt" => {
                    let (u, v) = (line_words.next(), line_words.next());
                    let number = |word: Option<&[u8]>| word.map_or(Some(0.0), parse_f64);
                    let place = match (u.and_then(parse_f64), number(v)) {
                        (Some(u), Some(v)) => Vec2::new(u as f32, v as f32),
                        _ => {
                            job.fault(PartFault::TEXTURE, data, at);
                            Vec2::ZERO
                        }
                    };
                    file.textures.push(place);
                }
                b"vn" => {
                    let mut number = || line_words.next().and_then(parse_f64);
                    let normal = [number(), number(), number()];
                    file.normals
                        .push(if let [Some(x), Some(y), Some(z)] = normal {
                            Vec3::new(x as f32, y as f32, z as f32)
                        } else {
                            job.fault(PartFault::NORMAL, data, at);
                            Vec3::ZERO
                        });
                }
                b"f" | b"fo" => file.face(job, data, at, line_words, &mut corners)?,
                b"usemtl" => {
                    file.material_runs.push(MaterialRun {
                        first: file.list.triangles.len(),
                        name: after_keyword(&line).to_vec(),
                    });
                }
                b"mtllib" => file.material_files.push(after_keyword(&line).to_vec()),
                b"l" | b"p" | b"curv" | b"curv2" | b"surf" => file.ignored += 1,
                // Groups, smoothing, names, and whatever programs add of their own.
                _ => file.other(keyword),
            }
            job.reach(scanner.at)?;
        }
        job.check_vertices(file.positions.len() as u64)?;
        Ok(file)
    }

    /// Counts a line that is not read.
    fn other(&mut self, keyword: &[u8]) {
        if keyword.starts_with(b"#") {
            return;
        }
        let known = self.others.iter().position(|other| other.0 == keyword);
        if let Some(index) = known {
            self.others[index].1 += 1;
        } else if self.others.len() < MOST_KEYWORDS {
            self.others.push((keyword.to_vec(), 1));
        }
    }

    /// `v x y z`, with a weight, or with a color (and an alpha, which is ignored).
    fn vertex<'a>(
        &mut self,
        job: &mut ReadJob<'_>,
        data: &[u8],
        at: usize,
        mut line_words: impl Iterator<Item = &'a [u8]>,
    ) -> Result<(), Error> {
        self.positions
            .push(three(job, data, at, &mut line_words)?.into());
        let mut extra = [0.0; 4];
        let mut count = 0;
        for word in line_words.take_while(|word| !word.starts_with(b"#")) {
            let Some(number) = parse_f64(word) else {
                job.fault(PartFault::EXTRA, data, at);
                return Ok(());
            };
            if let Some(slot) = extra.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if count >= 3 {
            self.colors
                .colors
                .resize(self.positions.len() - 1, [255; 4]);
            self.colors.push([extra[0], extra[1], extra[2]]);
        }
        Ok(())
    }

    /// `f` with corners `p`, `p/t`, `p//n` or `p/t/n`. Only the positions decide the shape: what is wrong with the others is
    /// a remark.
    fn face<'a>(
        &mut self,
        job: &mut ReadJob<'_>,
        data: &[u8],
        at: usize,
        line_words: impl Iterator<Item = &'a [u8]>,
        corners: &mut Vec<FaceCorner>,
    ) -> Result<(), Error> {
        corners.clear();
        for word in line_words.take_while(|word| !word.starts_with(b"#")) {
            let mut parts = word.split(|&byte| byte == b'/');
            let position = parts.next().unwrap_or_default();
            let position = self.resolve(job, data, at, word, position)?;
            let texture = match parts.next().unwrap_or_default() {
                [] => NO_INDEX,
                texture => {
                    let known = self.textures.len();
                    let texture = self.pointed_textures.index(texture, known, at);
                    if texture.is_none() {
                        job.fault(PartFault::TEXTURE_INDEX, data, at);
                    }
                    texture.unwrap_or(NO_INDEX)
                }
            };
            let normal = match parts.next() {
                Some(normal) if !normal.is_empty() => {
                    let known = self.normals.len();
                    let normal = self.pointed_normals.index(normal, known, at);
                    if normal.is_none() {
                        job.fault(PartFault::NORMAL_INDEX, data, at);
                    }
                    normal.unwrap_or(NO_INDEX)
                }
                _ => NO_INDEX,
            };
            if parts.next().is_some() {
                job.fault(PartFault::CORNER, data, at);
            }
            corners.push(FaceCorner {
                position,
                normal,
                texture,
            });
        }
        self.list.faces += 1;
        let length = without_repeated(corners, |corner| corner.position);
        self.list.closed += u64::from(length < corners.len());
        let Some((&first, fan)) = corners[..length].split_first().filter(|_| length >= 3) else {
            self.list.small += 1;
            return Ok(());
        };
        let triangles = &mut self.list.triangles;
        let keep = |list: &mut Vec<[u32; 3]>, index: fn(&FaceCorner) -> u32| {
            if corners.iter().any(|corner| index(corner) != NO_INDEX) {
                list.resize(triangles.len(), [NO_INDEX; 3]);
                let corners = |pair: &[FaceCorner]| [&first, &pair[0], &pair[1]].map(index);
                list.extend(fan.windows(2).map(corners));
            }
        };
        keep(&mut self.corner_normals, |corner| corner.normal);
        keep(&mut self.corner_textures, |corner| corner.texture);
        self.list.polygons.push(triangles.len(), length);
        let corners = |pair: &[FaceCorner]| [&first, &pair[0], &pair[1]].map(|c| c.position);
        triangles.extend(fan.windows(2).map(corners));
        Ok(())
    }

    /// The index from 0 of a position, written from 1 or backwards from -1. One that points ahead is noted and checked when
    /// the file has been read.
    #[inline]
    fn resolve(
        &mut self,
        job: &ReadJob<'_>,
        data: &[u8],
        at: usize,
        word: &[u8],
        part: &[u8],
    ) -> Result<u32, Error> {
        let count = self.positions.len();
        let index = parse_i64(part)
            .ok_or_else(|| job.number(at_line(data, at), word, "a corner of a face"))?;
        let from_one = if index < 0 {
            index.saturating_add(count as i64 + 1)
        } else {
            index
        };
        if from_one <= 0 || from_one >= i64::from(NO_INDEX) {
            return Err(job.index(at_line(data, at), "vertex", index, count as u64, 1));
        }
        let from_one = from_one as u64;
        if from_one > count as u64 && self.ahead.is_none_or(|(largest, _)| from_one > largest) {
            self.ahead = Some((from_one, at));
        }
        Ok((from_one - 1) as u32)
    }

    /// Takes back what corners say of normals and texture coordinates that the file does not have.
    fn forget_missing(&mut self, job: &mut ReadJob<'_>, data: &[u8]) {
        let normals = self.normals.len() as u64;
        let (pointed, textures) = (self.pointed_normals, self.pointed_textures);
        let known = self.textures.len() as u64;
        if textures.is_beyond(known) {
            let beyond = |texture: &&mut u32| u64::from(**texture) >= known;
            let all = self.corner_textures.iter_mut().flatten();
            all.filter(beyond).for_each(|texture| *texture = NO_INDEX);
            job.inventory
                .fault(PartFault::TEXTURE_INDEX, textures.count, || {
                    at_line(data, textures.first)
                });
        }
        if !pointed.is_beyond(normals) {
            return;
        }
        let mut missing = 0;
        for normal in self.corner_normals.iter_mut().flatten() {
            if *normal != NO_INDEX && u64::from(*normal) >= normals {
                *normal = NO_INDEX;
                missing += 1;
            }
        }
        // In triangles, corners count more than once.
        let count = pointed.count.min(missing).max(1);
        job.inventory.fault(PartFault::NORMAL_INDEX, count, || {
            at_line(data, pointed.first)
        });
    }

    /// Lists what the file holds, but for materials.
    fn list_parts(&self, job: &mut ReadJob<'_>, are_used: bool) {
        let inventory = &mut job.inventory;
        let count = |length: usize| length as u64;
        inventory.add(
            "v (vertices)",
            count(self.positions.len()),
            PartFate::Used,
            "",
        );
        let colors = count(self.colors.colors.len());
        inventory.add_some("colors of vertices", colors, PartFate::Used, "");
        let normals = count(self.normals.len());
        inventory.add_some("vn (normals)", normals, PartFate::Used, "");
        let (fate, note) = match are_used {
            true => (PartFate::Used, ""),
            false => (PartFate::LeftOut, "no texture is used"),
        };
        let textures = count(self.textures.len());
        inventory.add_some("vt (texture coordinates)", textures, fate, note);
        inventory.add_some("f (faces)", self.list.faces, PartFate::Used, "");
        let what = "l, p, curv, surf (lines, points and curves)";
        inventory.add_some(what, self.ignored, PartFate::LeftOut, "not drawn");
        let mut unknown = Vec::new();
        for (keyword, lines) in &self.others {
            let (meaning, fate) = match &keyword[..] {
                b"g" => (" (groups)", PartFate::Unneeded),
                b"o" => (" (objects)", PartFate::Unneeded),
                b"s" => (" (smoothing groups)", PartFate::LeftOut),
                b"vp" => (" (points of curves)", PartFate::LeftOut),
                _ => ("", PartFate::LeftOut),
            };
            let name = shown(keyword);
            if meaning.is_empty() {
                unknown.push(name.clone());
            }
            inventory.add(format!("{name}{meaning}"), *lines, fate, "");
        }
        if !are_used && !self.textures.is_empty() {
            inventory.leave_out("texture coordinates");
        }
        if !unknown.is_empty() {
            inventory.leave_out(format!("lines that begin with {}", unknown.join(", ")));
        }
    }

    /// Where triangles are in the textures of their materials.
    fn textures_of(&mut self, looks: &mut MaterialLooks) -> Option<RawTextures> {
        let corner_textures = std::mem::take(&mut self.corner_textures);
        let textures = std::mem::take(&mut self.textures);
        if looks.image_of.is_empty() {
            self.textures = textures;
            return None;
        }
        let mut image_of = std::mem::take(&mut looks.image_of);
        let corners = (corner_textures.iter().zip(&mut image_of))
            .map(|(corners, image)| {
                let place = looks.places.get(*image as usize);
                let known = corners.map(|corner| textures.get(corner as usize));
                match (place, known) {
                    (Some(place), [Some(&a), Some(&b), Some(&c)]) => {
                        [a, b, c].map(|coordinate| place.of(coordinate))
                    }
                    _ => {
                        *image = NO_INDEX;
                        [Vec2::ZERO; 3]
                    }
                }
            })
            .collect();
        image_of.truncate(corner_textures.len());
        self.textures = textures;
        Some(RawTextures {
            corners,
            image_of,
            sources: std::mem::take(&mut looks.sources),
        })
    }

    /// Gives every combination of position, normal and color a vertex. `colors` holds a color per triangle, or
    /// nothing.
    fn split(mut self, colors: Vec<[u8; 4]>) -> RawMesh {
        let counts = FileCounts {
            vertices: self.positions.len() as u64,
            faces: self.list.faces,
        };
        if !self.colors.colors.is_empty() {
            self.colors.colors.resize(self.positions.len(), [255; 4]);
        }
        if self.normals.is_empty() || self.corner_normals.is_empty() {
            self.corner_normals = Vec::new();
        } else {
            self.corner_normals
                .resize(self.list.triangles.len(), [NO_INDEX; 3]);
        }
        // A cloud with a normal per point, as some scanners write: the lists run side by side.
        if self.list.triangles.is_empty() && self.normals.len() == self.positions.len() {
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
        for index in 0..self.list.triangles.len() {
            let color = colors.get(index).copied().unwrap_or([255; 4]);
            for corner in 0..3 {
                let position = self.list.triangles[index][corner];
                let normal = self
                    .corner_normals
                    .get(index)
                    .map_or(NO_INDEX, |normals| normals[corner]);
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
                    if let Some(&color) = self.colors.colors.get(position as usize) {
                        self.colors.colors.push(color);
                    }
                    of_vertex.push(Some(wanted));
                }
                self.list.triangles[index][corner] = vertex;
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
            self.colors.colors = of_vertex
                .iter()
                .map(|attributes| attributes.map_or([255; 4], |(_, color)| color))
                .collect();
        }
        RawMesh {
            absent_normals: absent,
            ..self.raw(counts)
        }
    }

    fn raw(self, counts: FileCounts) -> RawMesh {
        RawMesh {
            coordinates: FileCoordinates::Double(self.positions),
            normals: self.normals,
            absent_normals: 0,
            colors: self.colors.colors,
            triangles: self.list.triangles,
            polygons: self.list.polygons,
            counts,
            textures: None,
        }
    }
}

/// The line with those that follow it while they end in a backslash.
fn joined<'a>(line: &'a [u8], scanner: &mut TextScanner<'a>) -> Cow<'a, [u8]> {
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

fn three<'a>(
    job: &ReadJob<'_>,
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
