//! Numbers that points carry beside position, normal and color: intensity, class, time and whatever else a file names.
//!
//! A column has the type of the file (64-bit integers become doubles) and costs its bytes a point, or nothing where all
//! points have the same value.

use glam::DVec3;

/// Attributes of all vertices of a cloud, column by column, in the order of its positions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointAttributes {
    /// The columns, all of the same length, in the order of the file.
    pub columns: Vec<AttributeColumn>,
    /// The grid on which the file has the positions; `None` where it has them as floating-point numbers.
    pub grid: Option<CoordinateGrid>,
    /// Colors of the points stand for categories, which have no mean.
    pub are_colors_categories: bool,
}

/// Coordinates that are whole numbers of steps: `offset + step * n`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoordinateGrid {
    /// The step of each axis, above 0.
    pub step: DVec3,
    /// The place of step 0.
    pub offset: DVec3,
}

impl CoordinateGrid {
    /// The whole numbers of the place next to `place`; not finite where the place is not.
    #[inline]
    pub fn steps(&self, place: DVec3) -> DVec3 {
        ((place - self.offset) / self.step).round()
    }

    /// The place on the grid next to `place`: what the file says, where that was rounded by less than half a step.
    #[inline]
    pub fn nearest(&self, place: DVec3) -> DVec3 {
        self.offset + self.step * self.steps(place)
    }
}

/// One attribute of all points.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeColumn {
    /// Name of the attribute: lower case, without spaces (`intensity`, `class`, `return`, `time`), or as the file writes it.
    pub name: String,
    /// Whether values can be averaged.
    pub kind: AttributeKind,
    /// Factor from stored values to values; 1 for nearly all.
    pub scale: f64,
    /// What is added after the factor; 0 for nearly all.
    pub offset: f64,
    /// The stored values.
    pub values: AttributeValues,
}

/// Meaning of the values of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AttributeKind {
    /// A measured quantity: means make sense.
    Quantity,
    /// A category or an index: only equality makes sense.
    Category,
}

/// Type of stored values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the names say sign and bits")]
pub enum NumberType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    F64,
}

impl NumberType {
    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            NumberType::U8 | NumberType::I8 => 1,
            NumberType::U16 | NumberType::I16 => 2,
            NumberType::U32 | NumberType::I32 | NumberType::F32 => 4,
            NumberType::F64 => 8,
        }
    }
}

/// Values of an attribute.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "the names say sign and bits")]
pub enum AttributeValues {
    /// All points have this value: no memory a point.
    Constant {
        /// Type of the values in the file.
        number: NumberType,
        /// The value.
        value: f64,
        /// How many points.
        count: usize,
    },
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// A number that a column can hold.
pub trait AttributeNumber: Copy + PartialEq + Sized {
    /// Type of the number.
    const NUMBER: NumberType;
    /// The column of these values.
    fn column(values: Vec<Self>) -> AttributeValues;
    /// The value as a double, exactly.
    fn to_double(self) -> f64;
    /// The value of a double that came from this type.
    fn of_double(value: f64) -> Self;
}

macro_rules! number {
    ($($variant:ident $number:ty),*) => {
        $(impl AttributeNumber for $number {
            const NUMBER: NumberType = NumberType::$variant;
            fn column(values: Vec<Self>) -> AttributeValues {
                AttributeValues::$variant(values)
            }
            #[inline]
            fn to_double(self) -> f64 {
                self as f64
            }
            #[inline]
            fn of_double(value: f64) -> Self {
                value as $number
            }
        })*

        /// An empty column of this type with room for `capacity` values, then `count` times `value`.
        fn filled(number: NumberType, value: f64, count: usize, capacity: usize) -> AttributeValues {
            match number {
                $(NumberType::$variant => {
                    let mut values = Vec::with_capacity(capacity.max(count));
                    values.resize(count, <$number>::of_double(value));
                    AttributeValues::$variant(values)
                })*
            }
        }

        impl AttributeValues {
            /// How many points have a value.
            pub fn len(&self) -> usize {
                match self {
                    AttributeValues::Constant { count, .. } => *count,
                    $(AttributeValues::$variant(values) => values.len(),)*
                }
            }

            /// Type of the values.
            pub fn number(&self) -> NumberType {
                match self {
                    AttributeValues::Constant { number, .. } => *number,
                    $(AttributeValues::$variant(_) => NumberType::$variant,)*
                }
            }

            /// The stored value of a point; `None` beyond the last.
            #[inline]
            pub fn get(&self, index: usize) -> Option<f64> {
                match self {
                    AttributeValues::Constant { value, count, .. } => {
                        (index < *count).then_some(*value)
                    }
                    $(AttributeValues::$variant(values) => values.get(index).map(|v| v.to_double()),)*
                }
            }

            /// Adds the values of further points. Columns of other types are converted to this one's.
            pub fn append(&mut self, other: AttributeValues) {
                if other.is_empty() {
                    return;
                }
                if self.is_empty() && !matches!(self, AttributeValues::Constant { .. })
                    && self.number() == other.number()
                {
                    *self = other;
                    return;
                }
                if let AttributeValues::Constant { number, value, count } = *self {
                    match other {
                        _ if count == 0 => {
                            *self = other;
                            return;
                        }
                        AttributeValues::Constant { value: again, count: more, .. }
                            if again.to_bits() == value.to_bits() =>
                        {
                            *self = AttributeValues::Constant { number, value, count: count + more };
                            return;
                        }
                        _ => *self = filled(number, value, count, count + other.len()),
                    }
                }
                match (self, other) {
                    $((AttributeValues::$variant(values), AttributeValues::$variant(more)) => {
                        values.extend_from_slice(&more);
                    })*
                    $((AttributeValues::$variant(values), other) => {
                        values.extend((0..other.len()).filter_map(|at| other.get(at)).map(<$number>::of_double));
                    })*
                    (AttributeValues::Constant { .. }, _) => {}
                }
            }

            /// The values in another type; those that it cannot hold become the nearest that it can.
            pub fn converted(&self, number: NumberType) -> AttributeValues {
                let values = (0..self.len()).filter_map(|at| self.get(at));
                match number {
                    $(NumberType::$variant => {
                        AttributeValues::$variant(values.map(<$number>::of_double).collect())
                    })*
                }
            }

            /// The values of these points, in this order; those beyond the last are left out.
            #[must_use]
            pub fn ordered(&self, order: &[u32]) -> AttributeValues {
                match self {
                    AttributeValues::Constant { number, value, count } => {
                        let there = order.iter().filter(|&&index| (index as usize) < *count);
                        AttributeValues::Constant { number: *number, value: *value, count: there.count() }
                    }
                    $(AttributeValues::$variant(values) => {
                        let there = order.iter().filter_map(|&index| values.get(index as usize));
                        AttributeValues::$variant(there.copied().collect())
                    })*
                }
            }

            /// Keeps the values of those points whose index `keep` accepts.
            pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
                match self {
                    AttributeValues::Constant { count, .. } => {
                        *count = (0..*count).filter(|&index| keep(index)).count();
                    }
                    $(AttributeValues::$variant(values) => {
                        let mut index = 0;
                        values.retain(|_| {
                            index += 1;
                            keep(index - 1)
                        });
                    })*
                }
            }
        }
    };
}
number!(U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, F32 f32, F64 f64);

impl AttributeValues {
    /// A column of these values; a constant where they are all equal.
    pub fn of<T: AttributeNumber>(values: Vec<T>) -> Self {
        match values.first() {
            Some(&first) if values.iter().all(|&value| value == first) => {
                AttributeValues::Constant {
                    number: T::NUMBER,
                    value: first.to_double(),
                    count: values.len(),
                }
            }
            _ => T::column(values),
        }
    }

    /// No values of a type yet.
    pub fn none_of(number: NumberType) -> Self {
        AttributeValues::Constant {
            number,
            value: 0.0,
            count: 0,
        }
    }

    /// Tells whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that a point costs.
    pub fn bytes_a_point(&self) -> usize {
        match self {
            AttributeValues::Constant { .. } => 0,
            other => other.number().bytes(),
        }
    }
}

/// Fewest digits behind the point that write whole numbers of a step; 9 where none do.
pub fn decimals_of_step(step: f64) -> usize {
    (0..9)
        .find(|&digits| {
            let whole = step * 10f64.powi(digits);
            (whole - whole.round()).abs() < 1e-6 && whole.round() >= 1.0
        })
        .map_or(9, |digits| digits as usize)
}

impl AttributeColumn {
    /// A column of this name without values yet.
    pub fn new(name: impl Into<String>, kind: AttributeKind, number: NumberType) -> Self {
        Self {
            name: name.into(),
            kind,
            scale: 1.0,
            offset: 0.0,
            values: AttributeValues::none_of(number),
        }
    }

    /// The value of a point; `None` beyond the last.
    #[inline]
    pub fn value(&self, index: usize) -> Option<f64> {
        Some(self.values.get(index)? * self.scale + self.offset)
    }

    /// Writes a value of the column with the digits that its type or its step has.
    pub fn written(&self, value: f64) -> String {
        if self.scale != 1.0 {
            let decimals = decimals_of_step(self.scale.abs());
            return format!("{value:.decimals$}");
        }
        match self.values.number() {
            NumberType::F32 if self.offset == 0.0 => (value as f32).to_string(),
            _ => value.to_string(),
        }
    }

    /// The smallest and largest value that are finite, smallest first; `None` without any.
    pub fn range(&self) -> Option<[f64; 2]> {
        let mut range: Option<[f64; 2]> = None;
        // A constant column is one value, however long.
        let count = match self.values {
            AttributeValues::Constant { count, .. } => count.min(1),
            ref values => values.len(),
        };
        for value in (0..count).filter_map(|index| self.value(index)) {
            if value.is_finite() {
                let [low, high] = range.unwrap_or([value; 2]);
                range = Some([low.min(value), high.max(value)]);
            }
        }
        range
    }
}

impl PointAttributes {
    /// The column of a name, whatever the case.
    pub fn find(&self, name: &str) -> Option<&AttributeColumn> {
        let mut columns = self.columns.iter();
        columns.find(|column| column.name.eq_ignore_ascii_case(name))
    }

    /// Puts the values in another order: that of the points with these indices.
    pub fn reorder(&mut self, order: &[u32]) {
        for column in &mut self.columns {
            column.values = column.values.ordered(order);
        }
    }

    /// Tells whether there are none.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Bytes that a point costs, all columns together.
    pub fn bytes_a_point(&self) -> usize {
        let columns = self.columns.iter();
        columns.map(|column| column.values.bytes_a_point()).sum()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn doubles(values: &AttributeValues) -> Vec<f64> {
        (0..values.len())
            .map(|at| values.get(at).unwrap())
            .collect()
    }

    #[test]
    fn values_are_written_with_the_digits_of_their_type_or_step() {
        assert_eq!(
            [1.0, 0.25, 1e-3, 5.0, 1.0 / 3.0].map(decimals_of_step),
            [0, 2, 3, 0, 9]
        );
        let column = |number, scale| AttributeColumn {
            scale,
            ..AttributeColumn::new("a", AttributeKind::Quantity, number)
        };
        let single = f64::from(0.1_f32);
        assert_eq!(column(NumberType::F32, 1.0).written(single), "0.1");
        assert_eq!(column(NumberType::F64, 1.0).written(0.1), "0.1");
        assert_eq!(column(NumberType::I16, 0.006).written(0.6), "0.600");
        assert_eq!(column(NumberType::U8, 1.0).written(7.0), "7");
    }

    #[test]
    fn constants_cost_nothing_until_a_value_differs() {
        let mut values = AttributeValues::none_of(NumberType::U8);
        values.append(AttributeValues::of(vec![7_u8; 3]));
        values.append(AttributeValues::of(vec![7_u8; 2]));
        assert_eq!((values.len(), values.bytes_a_point()), (5, 0));
        values.append(AttributeValues::of(vec![9_u8]));
        values.append(AttributeValues::of(vec![1_u8, 2]));
        assert_eq!(values, AttributeValues::U8(vec![7, 7, 7, 7, 7, 9, 1, 2]));
        assert_eq!(values.bytes_a_point(), 1);
        values.retain(|index| index % 2 == 1);
        assert_eq!(doubles(&values), [7.0, 7.0, 9.0, 2.0]);
        assert_eq!(values.get(4), None);
    }

    #[test]
    fn places_on_a_grid_are_those_of_the_file() {
        let grid = CoordinateGrid {
            step: DVec3::new(0.01, 0.01, 0.001),
            offset: DVec3::new(600_000.0, 4_000_000.0, -7.0),
        };
        let place = DVec3::new(636_012.34, 4_849_000.07, 412.345);
        // As far off as single precision puts a point 3 km from the origin.
        let moved = place + DVec3::new(1e-4, -1e-4, 1.2e-4);
        assert_eq!(grid.nearest(moved), grid.nearest(place));
        assert!(grid.nearest(moved).distance(place) < 1e-9);
        assert_eq!(
            grid.steps(place),
            DVec3::new(3_601_234.0, 84_900_007.0, 419_345.0)
        );
    }

    #[test]
    fn values_have_scale_offset_and_a_range() {
        let mut column = AttributeColumn::new("angle", AttributeKind::Quantity, NumberType::I16);
        column
            .values
            .append(AttributeValues::of(vec![-3_i16, 5, 0]));
        (column.scale, column.offset) = (0.5, 10.0);
        assert_eq!(column.value(0), Some(8.5));
        assert_eq!(column.range(), Some([8.5, 12.5]));
        let mut attributes = PointAttributes {
            columns: vec![column],
            grid: None,
            are_colors_categories: false,
        };
        assert_eq!(attributes.bytes_a_point(), 2);
        assert!(attributes.find("Angle").is_some() && attributes.find("time").is_none());
        attributes.reorder(&[2, 0]);
        assert_eq!(attributes.columns[0].value(0), Some(10.0));
        assert_eq!(attributes.columns[0].value(1), Some(8.5));
        let mut same = AttributeValues::of(vec![7_u8; 3]);
        same = same.ordered(&[1, 1, 2, 0, 9]);
        assert_eq!((same.len(), same.get(3)), (4, Some(7.0)));
        let holes = AttributeValues::of(vec![f32::NAN, f32::INFINITY, 2.0]);
        let column = AttributeColumn {
            values: holes,
            ..AttributeColumn::new("x", AttributeKind::Quantity, NumberType::F32)
        };
        assert_eq!(column.range(), Some([2.0, 2.0]));
    }
}
