//! Meaning of colors that stand for numbers, to be shown beside them.

/// Colors and the values that they stand for.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorLegend {
    /// Name of the attribute.
    pub title: String,
    /// Colors with their values.
    pub entries: LegendEntries,
}

/// Values of colors.
#[derive(Debug, Clone, PartialEq)]
pub enum LegendEntries {
    /// Colors at even steps from one value to another.
    Scale {
        /// Red, green and blue, from the lowest value on.
        colors: Vec<[u8; 3]>,
        /// The lowest, middle and highest value, as they are written.
        values: [String; 3],
        /// The lowest and the highest value.
        range: [f64; 2],
    },
    /// Categories, each with its color.
    List(Vec<([u8; 3], String)>),
}

impl ColorLegend {
    /// The values of the first and the last color; `None` for categories.
    pub fn range(&self) -> Option<[f64; 2]> {
        match self.entries {
            LegendEntries::Scale { range, .. } => Some(range),
            LegendEntries::List(_) => None,
        }
    }

    /// Adds categories that only another legend has, in the order of the numbers that their names begin with. Nothing of what has
    /// a range.
    pub fn join(&mut self, other: Self) {
        if let (LegendEntries::List(own), LegendEntries::List(more)) =
            (&mut self.entries, other.entries)
        {
            own.extend(more);
            let number = |name: &str| {
                let first = name.split(' ').next().and_then(|word| word.parse().ok());
                first.unwrap_or(u64::MAX)
            };
            own.sort_by(|a, b| (number(&a.1), &a.1).cmp(&(number(&b.1), &b.1)));
            own.dedup();
        }
    }
}
