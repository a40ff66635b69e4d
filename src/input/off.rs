//! OFF, the object file format of Geomview (its manual, section "OFF Files"): `[C][N]OFF`, comments, polygons.
//!
//! The keyword may be missing when the name ends in `.off`. Vertices and faces stand on lines of their own, which is
//! how everyone writes them. What follows the position of a vertex or the corners of a face is its color (three or four
//! numbers, of 0 to 1 or to 255); an index into a table of colors is left out. Colors and normals decide no shape: what is
//! wrong with them is a remark.

use glam::{DVec3, Vec3};

use super::assemble::{FileCoordinates, RawMesh};
use super::color::{ColorRange, ColorSink};
use super::job::{ReadJob, at_line};
use super::part::{PartFate, PartFault};
use super::polygon::FaceList;
use super::sniff::is_off_keyword;
use super::text::{TextScanner, parse_f64, parse_i64, words};
use super::{Error, FileCounts, ReadWarning};

/// Reads an OFF file.
pub(super) fn read(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let mut scanner = TextScanner::new(data, 0);
    let missing = |job: &ReadJob<'_>, what: &str| {
        job.truncated(at_line(data, data.len()), format!("{what} missing"))
    };

    let Some((mut line, mut at)) = scanner.meaningful_line() else {
        return Err(missing(job, "the counts of vertices and faces are"));
    };
    let mut keyword: &[u8] = b"OFF";
    if let Some(word) = words(line).next()
        && is_off_keyword(word)
    {
        keyword = word;
        if [b'4', b'n'].iter().any(|letter| keyword.contains(letter)) {
            return Err(job.unread("OFF with coordinates that are not three"));
        }
        // The counts may follow on the same line.
        line = line[word.len()..].trim_ascii();
        if line.is_empty() {
            (line, at) = scanner
                .meaningful_line()
                .ok_or_else(|| missing(job, "the counts of vertices and faces are"))?;
        }
    }
    if line.starts_with(b"BINARY") {
        return Err(job.unread("binary OFF"));
    }
    let (has_colors, has_normals) = (keyword.contains(&b'C'), keyword.contains(&b'N'));

    let mut counts = [0_u64; 2];
    let mut header = words(line);
    for count in &mut counts {
        let word = header.next().unwrap_or_default();
        let parsed = std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse().ok());
        *count = parsed.ok_or_else(|| job.number(at_line(data, at), word, "a count"))?;
    }
    let [vertices, faces] = counts;
    job.check_vertices(vertices)?;
    // The shortest vertex is `0 0 0` with a line end, the shortest face `0` with one.
    let left = (data.len() - scanner.at) as u64 + 1;
    let needed = vertices
        .saturating_mul(6)
        .saturating_add(faces.saturating_mul(2));
    if needed > left {
        let text = format!(
            "{vertices} vertices and {faces} faces need at least {needed} bytes, {left} are left"
        );
        return Err(job.truncated(at_line(data, at), text));
    }

    let mut positions = Vec::with_capacity(vertices as usize);
    let mut normals = Vec::with_capacity(if has_normals { vertices as usize } else { 0 });
    let mut colors = ColorSink::new([ColorRange::EITHER; 3]);
    let has_textures = keyword.starts_with(b"ST");
    let (mut wide_rows, mut alphas) = (0, 0);
    for _ in 0..vertices {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "vertices are"))?;
        let mut line_words = words(line);
        let mut position = [0.0; 3];
        for number in &mut position {
            let word = line_words.next().unwrap_or_default();
            *number = parse_f64(word)
                .ok_or_else(|| job.number(at_line(data, at), word, "a number of a vertex"))?;
        }
        positions.push(DVec3::from_array(position));
        if has_normals {
            let normal = [(); 3].map(|()| line_words.next().and_then(parse_f64));
            normals.push(if let [Some(x), Some(y), Some(z)] = normal {
                Vec3::new(x as f32, y as f32, z as f32)
            } else {
                job.fault(PartFault::NORMAL, data, at);
                Vec3::ZERO
            });
        }
        // Writers add colors without saying so in the keyword.
        let color = LineRest::of(&mut line_words);
        let is_likely = matches!(color.count, 3 | 4) && !has_textures && color.rgb.is_some();
        let is_color = has_colors || is_likely;
        if is_color {
            colors.colors.resize(positions.len() - 1, WHITE);
            match color.rgb {
                Some(rgb) => colors.push(rgb),
                None => job.fault(PartFault::COLOR, data, at),
            }
            alphas += u64::from(color.is_transparent);
        } else {
            wide_rows += u64::from(color.count > 0);
        }
        job.reach(scanner.at)?;
    }
    if !colors.colors.is_empty() {
        colors.colors.resize(positions.len(), WHITE);
    }

    let mut list = FaceList::default();
    list.triangles.reserve(faces as usize);
    let mut corners = Vec::new();
    let mut face_colors = ColorSink::new([ColorRange::EITHER; 3]);
    let (mut colored, mut indexed) = (0, 0);
    for _ in 0..faces {
        let (line, at) = scanner
            .meaningful_line()
            .ok_or_else(|| missing(job, "faces are"))?;
        let mut line_words = words(line);
        let word = line_words.next().unwrap_or_default();
        let length = parse_i64(word)
            .filter(|&length| length >= 0)
            .ok_or_else(|| job.number(at_line(data, at), word, "a count of corners"))?;
        corners.clear();
        for _ in 0..if length < 3 { 0 } else { length } {
            let word = line_words.next().unwrap_or_default();
            let index = parse_i64(word)
                .ok_or_else(|| job.number(at_line(data, at), word, "the index of a vertex"))?;
            match u32::try_from(index) {
                Ok(small) if u64::from(small) < vertices => corners.push(small),
                _ => return Err(job.index(at_line(data, at), "vertex", index, vertices, 0)),
            }
        }
        let before = list.triangles.len();
        list.push(&corners);
        if length < 3 {
            continue;
        }
        let color = LineRest::of(&mut line_words);
        match color.rgb {
            Some(rgb) => {
                face_colors.colors.resize(before, WHITE);
                let color = face_colors.convert(rgb);
                face_colors.colors.resize(list.triangles.len(), color);
                colored += 1;
            }
            None if color.count >= 3 => job.fault(PartFault::COLOR, data, at),
            None => indexed += u64::from(color.count > 0),
        }
        alphas += u64::from(color.is_transparent);
        job.reach(scanner.at)?;
    }
    list.warn(job);
    if scanner.meaningful_line().is_some() {
        let bytes = (data.len() - scanner.at) as u64;
        job.warn_count(bytes, |bytes| ReadWarning::TrailingBytes { bytes });
    }
    if let Some(remark) = [&colors, &face_colors]
        .iter()
        .find_map(|sink| sink.remark())
    {
        job.warn(remark);
    }
    let inventory = &mut job.inventory;
    inventory.add("vertices", vertices, PartFate::Used, "positions");
    if has_normals {
        inventory.add("normals of vertices", vertices, PartFate::Used, "");
    }
    let colored_vertices = colors.colors.len() as u64;
    inventory.add_some("colors of vertices", colored_vertices, PartFate::Used, "");
    inventory.add_some(
        "values after a vertex",
        wide_rows,
        PartFate::LeftOut,
        "not known",
    );
    inventory.add("faces", faces, PartFate::Used, "");
    let has_both = colored > 0 && colored_vertices > 0;
    let fate = if has_both {
        PartFate::LeftOut
    } else {
        PartFate::Used
    };
    inventory.add_some("colors of faces", colored, fate, "");
    inventory.add_some(
        "indices into a table of colors",
        indexed,
        PartFate::LeftOut,
        "the file has no table",
    );
    inventory.add_some(
        "transparent colors",
        alphas,
        PartFate::LeftOut,
        "drawn opaque",
    );
    for (what, count) in [
        ("values after vertices", wide_rows),
        (
            "colors of faces (vertices have their own)",
            u64::from(has_both) * colored,
        ),
        ("color indices of faces", indexed),
        ("transparency", alphas),
    ] {
        if count > 0 {
            inventory.leave_out(what);
        }
    }
    let mut raw = RawMesh {
        coordinates: FileCoordinates::Double(positions),
        normals,
        absent_normals: 0,
        colors: colors.colors,
        triangles: list.triangles,
        polygons: list.polygons,
        counts: FileCounts { vertices, faces },
        textures: None,
    };
    if colored > 0 && !has_both {
        face_colors.colors.resize(raw.triangles.len(), WHITE);
        raw.color_faces(&face_colors.colors);
    }
    Ok(raw)
}

/// The color of what has none.
const WHITE: [u8; 4] = [255; 4];

/// What follows on a line.
struct LineRest {
    /// How many words.
    count: usize,
    /// The first three, when there are so many numbers.
    rgb: Option<[f64; 3]>,
    /// The fourth says that the color is not opaque.
    is_transparent: bool,
}

impl LineRest {
    fn of<'a>(line_words: &mut impl Iterator<Item = &'a [u8]>) -> Self {
        let mut values = [0.0; 4];
        let (mut count, mut are_numbers) = (0, true);
        for word in line_words {
            if let Some(slot) = values.get_mut(count) {
                let value = parse_f64(word);
                are_numbers &= value.is_some();
                *slot = value.unwrap_or(0.0);
            }
            count += 1;
        }
        let [red, green, blue, alpha] = values;
        Self {
            count,
            rgb: (count >= 3 && are_numbers).then_some([red, green, blue]),
            is_transparent: count == 4 && alpha != 1.0 && alpha != 255.0,
        }
    }
}
