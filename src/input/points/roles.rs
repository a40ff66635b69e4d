//! Meanings of the columns of a table of points, by their names.

use crate::mesh::attributes::AttributeKind;

/// The part of a point that a column holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ColumnRole {
    /// An axis of the position, 0 to 2.
    Position(usize),
    /// An axis of the normal.
    Normal(usize),
    /// Red, green or blue.
    Color(usize),
    /// Kept under this name.
    Attribute(String),
}

/// The role that a name gives a column.
pub(super) fn role_of_name(name: &str) -> ColumnRole {
    let bare: String = name
        .trim_matches(|c: char| {
            c.is_whitespace() || matches!(c, '"' | '\'' | '#' | '/' | '<' | '>')
        })
        .to_lowercase();
    // Units in brackets: `x [m]`, `easting(m)`.
    let stem = bare.split(['[', '(']).next().unwrap_or("").trim();
    let at = |lists: [&[&str]; 3]| lists.iter().position(|list| list.contains(&stem));
    if let Some(axis) = at([
        &[
            "x",
            "easting",
            "coord_x",
            "x_coordinate",
            "pos_x",
            "px",
            "position_x",
            "e",
        ],
        &[
            "y",
            "northing",
            "coord_y",
            "y_coordinate",
            "pos_y",
            "py",
            "position_y",
            "n",
        ],
        &[
            "z",
            "height",
            "elevation",
            "altitude",
            "coord_z",
            "z_coordinate",
            "pos_z",
            "pz",
            "position_z",
            "h",
        ],
    ]) {
        return ColumnRole::Position(axis);
    }
    if let Some(axis) = at([
        &["nx", "normal_x", "normalx", "norm_x"],
        &["ny", "normal_y", "normaly", "norm_y"],
        &["nz", "normal_z", "normalz", "norm_z"],
    ]) {
        return ColumnRole::Normal(axis);
    }
    if let Some(channel) = at([
        &["r", "red", "color_r", "diffuse_red", "rf"],
        &["g", "green", "color_g", "diffuse_green", "gf"],
        &["b", "blue", "color_b", "diffuse_blue", "bf"],
    ]) {
        return ColumnRole::Color(channel);
    }
    ColumnRole::Attribute(attribute_name(stem))
}

/// The name under which an attribute is kept: the usual ones by their usual name, others as they are.
pub(in crate::input) fn attribute_name(name: &str) -> String {
    let name = name.trim().to_lowercase().replace([' ', '-'], "_");
    let known = match name.as_str() {
        "i" | "intensity" | "scalar_intensity" | "reflectance" | "intensities" => "intensity",
        "class" | "classification" | "scalar_classification" => "class",
        "return" | "return_number" | "returnnumber" | "return_num" => "return",
        "returns" | "number_of_returns" | "numberofreturns" | "num_returns" => "returns",
        "time" | "gps_time" | "gpstime" | "timestamp" | "scalar_gps_time" | "scalar_gpstime" => {
            "time"
        }
        "" => "value",
        other => other,
    };
    known.to_owned()
}

/// The kind of an attribute, by its name.
pub(in crate::input) fn kind_of(name: &str) -> AttributeKind {
    let words = [
        "class", "label", "segment", "object", "return", "returns", "ring", "_id", "index",
    ];
    if words.iter().any(|word| name.contains(word)) {
        AttributeKind::Category
    } else {
        AttributeKind::Quantity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_programs_are_known() {
        for (name, role) in [
            ("//X", ColumnRole::Position(0)),
            ("Northing [m]", ColumnRole::Position(1)),
            ("\"Z\"", ColumnRole::Position(2)),
            ("Nx", ColumnRole::Normal(0)),
            ("R", ColumnRole::Color(0)),
            ("Blue", ColumnRole::Color(2)),
            (
                "Scalar_Intensity",
                ColumnRole::Attribute("intensity".to_owned()),
            ),
            ("GPS time", ColumnRole::Attribute("time".to_owned())),
            ("Curvature", ColumnRole::Attribute("curvature".to_owned())),
        ] {
            assert_eq!(role_of_name(name), role, "{name}");
        }
        assert_eq!(kind_of("segment_index"), AttributeKind::Category);
        assert_eq!(kind_of("intensity"), AttributeKind::Quantity);
    }
}
