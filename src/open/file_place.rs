//! Places of models in the coordinates of their files.

use crate::mesh::attributes::{PointAttributes, decimals_of_step};
use crate::tree::Model;
use glam::DVec3;

/// Gives a place of a model in the coordinates of its file, to the file's step, and how many digits behind the point each has.
pub fn in_file(model: &Model, attributes: &PointAttributes, place: DVec3) -> (DVec3, [usize; 3]) {
    let world = model.origin + place;
    if let Some(grid) = &attributes.grid {
        let digits = grid.step.to_array().map(decimals_of_step);
        let place = grid.nearest(world).to_array();
        // As it is written: products of steps have their own rounding.
        let written = |axis: usize| {
            let decimals = digits[axis];
            let text = format!("{:.decimals$}", place[axis]);
            if decimals < 9 {
                text.parse().unwrap_or(place[axis])
            } else {
                place[axis]
            }
        };
        return (DVec3::new(written(0), written(1), written(2)), digits);
    }
    // Half a unit in the last place of the coordinate that is farthest from the origin.
    let reach = model.min.abs().max(model.max.abs()).max_element();
    let unit = f64::from(reach) * f64::from(f32::EPSILON) / 2.0;
    let digits = if unit > 0.0 {
        // The cast saturates.
        (-unit.log10()).floor().clamp(0.0, 9.0) as usize
    } else {
        3
    };
    (world, [digits; 3])
}
