//! Which elements and properties of a PLY file we know, and under what names.

use super::super::job::ReadJob;
use super::super::part::{PartFate, grouped};
use super::super::{Error, FilePlace};
use super::header::{Named, PlyElement, PlyProperty, ScalarType};

/// A number of every row that is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct KeptColumn {
    /// Which property.
    pub(super) property: usize,
    pub(super) kind: ScalarType,
}

/// Where the color of a vertex is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColorColumns {
    /// Red, green and blue; whether a color is opaque is only looked at.
    Channels {
        rgb: [KeptColumn; 3],
        alpha: Option<KeptColumn>,
    },
    /// Three bytes in the bits of a number, as the Point Cloud Library has them: 0xRRGGBB.
    Packed(KeptColumn),
    /// The first three numbers of a list.
    Listed(KeptColumn),
    /// The constant part of spherical harmonics.
    Harmonics([KeptColumn; 3]),
}

/// Where the parts of a vertex are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct VertexColumns {
    pub(super) position: [KeptColumn; 3],
    pub(super) normal: Option<[KeptColumn; 3]>,
    pub(super) color: Option<ColorColumns>,
    /// Texture coordinates.
    pub(super) place: Option<[KeptColumn; 2]>,
    /// A trained Gaussian-splat file.
    pub(super) are_splats: bool,
}

/// Where the parts of a face are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FaceColumns {
    /// The list property that holds the corners.
    pub(super) corners: usize,
    pub(super) color: Option<[KeptColumn; 3]>,
    /// The list property that holds texture coordinates of the corners, two each.
    pub(super) places: Option<usize>,
    /// The number of the texture.
    pub(super) texture: Option<KeptColumn>,
}

/// What an element is to us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ElementRole {
    Vertices(VertexColumns),
    Faces(FaceColumns),
    /// Triangle strips, with the number of the list property that holds the corners.
    Strips(usize),
    Other,
}

/// The properties of an element, looked up by name, whatever the case.
struct PropertyLookup<'a>(&'a [(String, PlyProperty)]);

impl PropertyLookup<'_> {
    fn column(&self, wanted: &str) -> Option<KeptColumn> {
        let mut all = self.0.iter().enumerate();
        all.find_map(|(property, (name, kind))| match *kind {
            PlyProperty::Scalar(kind) if name.eq_ignore_ascii_case(wanted) => {
                Some(KeptColumn { property, kind })
            }
            _ => None,
        })
    }

    fn three(&self, [a, b, c]: [&str; 3]) -> Option<[KeptColumn; 3]> {
        Some([self.column(a)?, self.column(b)?, self.column(c)?])
    }

    fn place(&self) -> Option<[KeptColumn; 2]> {
        let names = [
            ["s", "t"],
            ["u", "v"],
            ["texture_u", "texture_v"],
            ["texture_s", "texture_t"],
            ["texcoord_u", "texcoord_v"],
            ["tex_u", "tex_v"],
            ["texture_x", "texture_y"],
        ];
        let mut found = names.into_iter();
        found.find_map(|[u, v]| Some([self.column(u)?, self.column(v)?]))
    }

    /// The list of a face's texture coordinates.
    fn places(&self) -> Option<usize> {
        let names = ["texcoord", "texcoords", "texture_coordinates", "uv", "uvs"];
        let is_list = |property: &PlyProperty| matches!(property, PlyProperty::List { .. });
        names.iter().find_map(|wanted| {
            let mut all = self.0.iter();
            all.position(|(name, property)| name.eq_ignore_ascii_case(wanted) && is_list(property))
        })
    }

    fn texture(&self) -> Option<KeptColumn> {
        let names = ["texnumber", "texture_number", "tex_number", "texture_id"];
        names.iter().find_map(|name| self.column(name))
    }

    /// Red, green and blue under the names that programs give them: alone, shortened, or with something before or after,
    /// the same for all three. Diffuse ones go first; ambient and specular ones are none.
    fn rgb(&self) -> Option<[KeptColumn; 3]> {
        let known = [
            ["red", "green", "blue"],
            ["r", "g", "b"],
            ["diffuse_red", "diffuse_green", "diffuse_blue"],
        ];
        if let Some(found) = known.into_iter().find_map(|names| self.three(names)) {
            return Some(found);
        }
        self.0.iter().find_map(|(name, _)| {
            let frame = NameFrame::of(name, ["red", "r"])?;
            let channel = |names: [&str; 2]| {
                self.0
                    .iter()
                    .find(|(name, _)| NameFrame::of(name, names).as_ref() == Some(&frame))
                    .and_then(|(name, _)| self.column(name))
            };
            Some([
                channel(["red", "r"])?,
                channel(["green", "g"])?,
                channel(["blue", "b"])?,
            ])
        })
    }

    fn vertex_color(&self) -> Option<ColorColumns> {
        if let Some(rgb) = self.rgb() {
            let names = ["alpha", "a", "diffuse_alpha", "opacity"];
            let alpha = names.into_iter().find_map(|name| self.column(name));
            return Some(ColorColumns::Channels { rgb, alpha });
        }
        if let Some(columns) = self.three(["f_dc_0", "f_dc_1", "f_dc_2"]) {
            return Some(ColorColumns::Harmonics(columns));
        }
        let names = ["rgb", "rgba", "packed_rgb", "color", "colour", "colors"];
        let listed = names.iter().find_map(|wanted| {
            self.0
                .iter()
                .enumerate()
                .find_map(|(property, (name, kind))| match *kind {
                    PlyProperty::List { item, .. } if name.eq_ignore_ascii_case(wanted) => {
                        Some(KeptColumn {
                            property,
                            kind: item,
                        })
                    }
                    _ => None,
                })
        });
        if let Some(column) = listed {
            return Some(ColorColumns::Listed(column));
        }
        let mut packed = names.into_iter().filter_map(|name| self.column(name));
        packed
            .find(|column| {
                matches!(
                    column.kind,
                    ScalarType::F32 | ScalarType::I32 | ScalarType::U32
                )
            })
            .map(ColorColumns::Packed)
    }

    /// The list of corners: by its name, or because no other list of integers is there.
    fn corners(&self) -> Option<usize> {
        let is_list = |property: &PlyProperty| matches!(property, PlyProperty::List { .. });
        let known = ["vertex_indices", "vertex_index", "vertex_indexes"];
        let named = known.iter().find_map(|wanted| {
            self.0
                .iter()
                .position(|(name, property)| name.eq_ignore_ascii_case(wanted) && is_list(property))
        });
        named.or_else(|| {
            let is_integers =
                |property: &PlyProperty| matches!(property, PlyProperty::List { item, .. } if !item.is_float());
            let mut lists = (0..self.0.len()).filter(|&index| is_integers(&self.0[index].1));
            let first = lists.next()?;
            lists.next().is_none().then_some(first)
        })
    }
}

/// What stands before and after the channel in a property's name, in lower case.
#[derive(Debug, PartialEq, Eq)]
struct NameFrame(String, String);

impl NameFrame {
    /// The frame of a name that holds one of the spellings of a channel, long or (between marks) short.
    fn of(name: &str, [long, short]: [&str; 2]) -> Option<NameFrame> {
        let name = name.to_ascii_lowercase();
        if ["ambient", "specular", "emissi", "reflect"]
            .iter()
            .any(|other| name.contains(other))
        {
            return None;
        }
        let frame = |at: usize, length: usize| {
            Some(NameFrame(
                name[..at].to_owned(),
                name[at + length..].to_owned(),
            ))
        };
        if let Some(at) = name.find(long)
            && (at == 0 || at + long.len() == name.len())
        {
            return frame(at, long.len());
        }
        let is_mark = |byte: u8| !byte.is_ascii_alphanumeric();
        let bytes = name.as_bytes();
        (0..bytes.len())
            .find(|&at| {
                bytes[at..].starts_with(short.as_bytes())
                    && (at == 0 || is_mark(bytes[at - 1]))
                    && bytes.get(at + 1).is_none_or(|&byte| is_mark(byte))
            })
            .and_then(|at| frame(at, short.len()))
    }
}

/// What an element is to us.
pub(super) fn role_of(
    job: &ReadJob<'_>,
    place: FilePlace,
    name: &str,
    count: u64,
    properties: &Named,
) -> Result<ElementRole, Error> {
    let lookup = PropertyLookup(properties);
    match &name.to_ascii_lowercase()[..] {
        "vertex" | "vertices" => {
            let Some(position) = lookup.three(["x", "y", "z"]) else {
                if lookup.column("packed_position").is_some() {
                    return Err(job.unread("a compressed Gaussian-splat file"));
                }
                return Err(job.syntax(place, "element `vertex` has no properties x, y, z"));
            };
            let are_splats = lookup.three(["f_dc_0", "f_dc_1", "f_dc_2"]).is_some()
                && lookup.column("opacity").is_some();
            let names = [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];
            let normal = names.into_iter().find_map(|names| lookup.three(names));
            Ok(ElementRole::Vertices(VertexColumns {
                position,
                // Splats have zeros there.
                normal: normal.filter(|_| !are_splats),
                color: lookup.vertex_color(),
                place: lookup.place(),
                are_splats,
            }))
        }
        "face" | "faces" => match lookup.corners() {
            Some(corners) => Ok(ElementRole::Faces(FaceColumns {
                corners,
                color: lookup.rgb(),
                places: lookup.places(),
                texture: lookup.texture(),
            })),
            None if count == 0 => Ok(ElementRole::Other),
            None => Err(no_corners(job, place, name)),
        },
        "tristrips" => match lookup.corners() {
            Some(list) => Ok(ElementRole::Strips(list)),
            None if count == 0 => Ok(ElementRole::Other),
            None => Err(no_corners(job, place, name)),
        },
        _ => Ok(ElementRole::Other),
    }
}

fn no_corners(job: &ReadJob<'_>, place: FilePlace, name: &str) -> Error {
    job.syntax(
        place,
        format!("element `{name}` has no list `vertex_indices`"),
    )
}

/// Lets the colors of vertices go before those of faces, and texture coordinates of faces before those of vertices; without
/// textures there are none. Lists all elements and properties.
pub(super) fn settle(job: &mut ReadJob<'_>, elements: &mut [PlyElement], has_textures: bool) {
    let have_places = |element: &PlyElement| matches!(element.role, ElementRole::Faces(columns) if columns.places.is_some());
    let have_places = elements.iter().any(have_places);
    for element in &mut *elements {
        match &mut element.role {
            ElementRole::Vertices(columns) if have_places || !has_textures => columns.place = None,
            ElementRole::Faces(columns) if !has_textures => {
                (columns.places, columns.texture) = (None, None);
            }
            _ => {}
        }
    }

    let has_vertex_colors = elements.iter().any(
        |element| matches!(element.role, ElementRole::Vertices(columns) if columns.color.is_some()),
    );
    for element in elements {
        let mut left_colors = Vec::new();
        if let ElementRole::Faces(columns) = &mut element.role
            && has_vertex_colors
        {
            left_colors.extend(
                columns
                    .color
                    .take()
                    .into_iter()
                    .flatten()
                    .map(|c| c.property),
            );
        }
        list(job, element, &left_colors);
    }
}

/// Lists an element and its properties; `left_colors` are colors of faces that are left out.
fn list(job: &mut ReadJob<'_>, element: &PlyElement, left_colors: &[usize]) {
    let PlyElement { name, count, .. } = element;
    let fate = match element.role {
        ElementRole::Other => PartFate::LeftOut,
        _ => PartFate::Used,
    };
    job.inventory
        .add(format!("element {name}"), *count, fate, "");
    let mut left_out = Vec::new();
    let attributes = attributes_of(element);
    for (index, property) in element.names.iter().enumerate() {
        let (fate, note) = match use_of(element, index) {
            Some(note) => (PartFate::Used, note),
            None if left_colors.contains(&index) => (PartFate::LeftOut, "the vertices have colors"),
            None => (PartFate::LeftOut, ""),
        };
        // Looked at when all is read.
        if matches!(element.role, ElementRole::Vertices(columns) if alpha_of(&columns) == Some(index))
            || attributes.iter().any(|column| column.property == index)
        {
            continue;
        }
        if fate == PartFate::LeftOut {
            left_out.push(&property[..]);
        }
        let part = format!("property {property} of {name}");
        job.inventory.add(part, *count, fate, note);
    }
    if *count == 0 {
        return;
    }
    if element.role == ElementRole::Other {
        job.inventory
            .leave_out(format!("element {name} ({count} rows)"));
    } else if !left_out.is_empty()
        && !matches!(
            element.role,
            ElementRole::Vertices(VertexColumns {
                are_splats: true,
                ..
            })
        )
    {
        let names = grouped(left_out).join(", ");
        job.inventory.leave_out(format!("{names} of {name}"));
    }
}

/// The property that says whether colors are opaque.
pub(super) fn alpha_of(columns: &VertexColumns) -> Option<usize> {
    match columns.color {
        Some(ColorColumns::Channels { alpha, .. }) if !columns.are_splats => {
            alpha.map(|alpha| alpha.property)
        }
        _ => None,
    }
}

/// Numbers that become attributes: all of vertices that are read as nothing else. Gaussian splats have none; what they leave out is
/// said at once.
pub(super) fn attributes_of(element: &PlyElement) -> Vec<KeptColumn> {
    let ElementRole::Vertices(columns) = element.role else {
        return Vec::new();
    };
    if columns.are_splats {
        return Vec::new();
    }
    let properties = element.properties.iter().enumerate();
    let free = properties.filter(|(property, _)| {
        use_of(element, *property).is_none() && alpha_of(&columns) != Some(*property)
    });
    free.filter_map(|(property, kind)| match *kind {
        PlyProperty::Scalar(kind) => Some(KeptColumn { property, kind }),
        PlyProperty::List { .. } => None,
    })
    .collect()
}

/// What a property is read as; `None` when it is not.
fn use_of(element: &PlyElement, property: usize) -> Option<&'static str> {
    let has = |columns: &[KeptColumn]| columns.iter().any(|column| column.property == property);
    match element.role {
        ElementRole::Vertices(columns) if has(&columns.position) => Some("position"),
        ElementRole::Vertices(columns) if columns.normal.is_some_and(|normal| has(&normal)) => {
            Some("normal")
        }
        ElementRole::Vertices(columns) if columns.place.is_some_and(|place| has(&place)) => {
            Some("texture coordinate")
        }
        ElementRole::Vertices(columns) => match columns.color? {
            ColorColumns::Channels { rgb, .. } if has(&rgb) => Some("color"),
            ColorColumns::Packed(column) if has(&[column]) => Some("color, packed"),
            ColorColumns::Listed(column) if has(&[column]) => Some("color, a list"),
            ColorColumns::Harmonics(columns) if has(&columns) => Some("color, 0.5 + 0.2821 of it"),
            _ => None,
        },
        ElementRole::Faces(columns) if columns.corners == property => Some("corners"),
        ElementRole::Faces(columns) if columns.places == Some(property) => {
            Some("texture coordinates")
        }
        ElementRole::Faces(columns) if columns.texture.is_some_and(|texture| has(&[texture])) => {
            Some("number of the texture")
        }
        ElementRole::Faces(columns) => columns.color.filter(|color| has(color)).map(|_| "color"),
        ElementRole::Strips(list) => (list == property).then_some("corners"),
        ElementRole::Other => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rgb(names: &[&str]) -> Option<[usize; 3]> {
        let properties: Vec<(String, PlyProperty)> = names
            .iter()
            .map(|name| (name.to_string(), PlyProperty::Scalar(ScalarType::U8)))
            .collect();
        PropertyLookup(&properties)
            .rgb()
            .map(|columns| columns.map(|column| column.property))
    }

    #[test]
    fn colors_have_many_names() {
        for names in [
            ["x", "red", "green", "blue"],
            ["x", "Red", "GREEN", "Blue"],
            ["x", "R", "G", "B"],
            ["x", "diffuse_red", "diffuse_green", "diffuse_blue"],
            ["x", "diffuseRed", "diffuseGreen", "diffuseBlue"],
            ["x", "color_r", "color_g", "color_b"],
            ["x", "red_value", "green_value", "blue_value"],
            ["x", "vertex.r", "vertex.g", "vertex.b"],
            [
                "scared",
                "base_color_red",
                "base_color_green",
                "base_color_blue",
            ],
        ] {
            assert_eq!(rgb(&names), Some([1, 2, 3]), "{names:?}");
        }
        for names in [
            ["x", "ambient_red", "ambient_green", "ambient_blue"],
            ["x", "red", "green", "blur"],
            ["x", "a_red", "b_green", "a_blue"],
            ["radius", "gain", "bias", "x"],
        ] {
            assert_eq!(rgb(&names), None, "{names:?}");
        }
        let mixed = [
            "ambient_red",
            "ambient_green",
            "ambient_blue",
            "diffuse_r",
            "diffuse_g",
            "diffuse_b",
        ];
        assert_eq!(rgb(&mixed), Some([3, 4, 5]));
    }
}
