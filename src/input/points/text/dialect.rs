//! How a text writes its points: separator, decimal mark, columns.

use super::super::super::text::{TextScanner, parse_f64};
use super::super::roles::{ColumnRole, role_of_name};

/// Lines looked at, and bytes they may have together.
const SNIFF_LINES: usize = 64;
const SNIFF_BYTES: usize = 1 << 16;

/// Most columns of a line that are looked at.
const MOST_COLUMNS: usize = 256;

/// What stands between two numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FieldSeparator {
    /// Spaces and tabs, any number of them.
    Spaces,
    Comma,
    Semicolon,
}

/// What a line is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LineKind {
    /// Blank, or a comment.
    Nothing,
    /// One whole number: it counts what follows.
    Count,
    /// Two numbers or more.
    Numbers,
    /// Anything else.
    Words,
}

/// How a text writes its points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextDialect {
    pub(super) separator: FieldSeparator,
    /// Numbers have a comma where others have a point.
    pub(super) is_decimal_comma: bool,
    pub(super) columns: Vec<ColumnRole>,
    /// Whether a line of names gave the columns.
    is_named: bool,
    /// Bytes before the first line of points: names and remarks.
    pub(super) skip_bytes: usize,
}

impl TextDialect {
    /// Decides by the first lines of a text. Columns are empty where no line has three numbers.
    pub(super) fn sniff(data: &[u8]) -> Self {
        let head = &data[..data.len().min(SNIFF_BYTES)];
        let mut scanner = TextScanner::new(head, 0);
        let mut lines = Vec::new();
        while lines.len() < SNIFF_LINES
            && let Some((line, start)) = scanner.line()
        {
            // What the look ahead cuts off is no line.
            if scanner.at < head.len() || head.len() == data.len() {
                lines.push((line, start));
            }
        }
        let mut dialect = Self {
            separator: FieldSeparator::Spaces,
            is_decimal_comma: false,
            columns: Vec::new(),
            is_named: false,
            skip_bytes: 0,
        };
        dialect.separate(lines.iter().map(|&(line, _)| line));
        let mut rows: Vec<Vec<f64>> = Vec::new();
        let mut numbers = Vec::new();
        let mut names: Option<&[u8]> = None;
        let mut is_first = true;
        for &(line, start) in &lines {
            match dialect.parse(line, &mut numbers) {
                LineKind::Numbers if numbers.len() >= 3 => {
                    if is_first {
                        dialect.skip_bytes = start;
                        is_first = false;
                    }
                    rows.push(numbers.clone());
                }
                LineKind::Words | LineKind::Nothing
                    if is_first && !line.trim_ascii().is_empty() =>
                {
                    names = Some(line);
                }
                LineKind::Count if is_first => {}
                _ => {}
            }
        }
        // Count lines before the first point stay part of the text.
        if names.is_none() {
            dialect.skip_bytes = 0;
        }
        let width = usual_length(&rows);
        rows.retain(|row| row.len() == width);
        if let Some(found) = names.and_then(|line| dialect.named(line, width)) {
            dialect.columns = found;
            dialect.is_named = true;
        } else if width >= 3 {
            dialect.columns = guessed(&rows, width);
        }
        dialect
    }

    /// Finds separator and decimal mark.
    fn separate<'a>(&mut self, lines: impl Iterator<Item = &'a [u8]>) {
        for line in lines {
            let line = line.trim_ascii();
            let begins_a_number =
                |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'-' | b'+' | b'.');
            if !line.first().is_some_and(begins_a_number) {
                continue;
            }
            let has = |wanted: u8| line.contains(&wanted);
            if has(b';') {
                self.separator = FieldSeparator::Semicolon;
                self.is_decimal_comma |= has(b',') && !has(b'.');
            } else if has(b',') && self.separator != FieldSeparator::Semicolon {
                let words: Vec<&[u8]> = line
                    .split(u8::is_ascii_whitespace)
                    .filter(|word| !word.is_empty())
                    .collect();
                let is_number = |word: &&[u8]| {
                    let commas = word.iter().filter(|&&byte| byte == b',').count();
                    commas <= 1 && !word.starts_with(b",") && !word.ends_with(b",")
                };
                if words.len() >= 3 && words.iter().all(is_number) && !has(b'.') {
                    self.is_decimal_comma = true;
                } else {
                    self.separator = FieldSeparator::Comma;
                    self.is_decimal_comma = false;
                }
            }
        }
    }

    /// The fields of a line.
    fn fields<'a>(&self, line: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let separator = self.separator;
        line.split(move |&byte| match separator {
            FieldSeparator::Spaces => matches!(byte, b' ' | b'\t' | b'\x0b' | b'\x0c'),
            FieldSeparator::Comma => byte == b',',
            FieldSeparator::Semicolon => byte == b';',
        })
        .map(<[u8]>::trim_ascii)
        .filter(move |field| separator != FieldSeparator::Spaces || !field.is_empty())
    }

    /// Reads the numbers of a line; an empty field of a table is no number (NaN).
    pub(super) fn parse(&self, line: &[u8], numbers: &mut Vec<f64>) -> LineKind {
        numbers.clear();
        let line = line.trim_ascii();
        if line.is_empty()
            || line.starts_with(b"#")
            || line.starts_with(b"//")
            || line.starts_with(b"!")
        {
            return LineKind::Nothing;
        }
        for field in self.fields(line).take(MOST_COLUMNS) {
            match self.number(field) {
                Some(number) => numbers.push(number),
                None if field.is_empty() => numbers.push(f64::NAN),
                // Remarks after the numbers of a line.
                None if numbers.len() >= self.columns.len().max(3) => break,
                None => return LineKind::Words,
            }
        }
        match numbers[..] {
            [count] if count >= 0.0 && count.fract() == 0.0 => LineKind::Count,
            [] | [_] => LineKind::Words,
            _ => LineKind::Numbers,
        }
    }

    #[inline]
    fn number(&self, field: &[u8]) -> Option<f64> {
        if !self.is_decimal_comma || !field.contains(&b',') {
            return parse_f64(field);
        }
        let mut copy = [0; 64];
        let copy = copy.get_mut(..field.len())?;
        copy.copy_from_slice(field);
        for byte in copy.iter_mut() {
            if *byte == b',' {
                *byte = b'.';
            }
        }
        parse_f64(copy)
    }

    /// The columns by a line of names, where it has as many as there are columns and names the position.
    fn named(&self, line: &[u8], width: usize) -> Option<Vec<ColumnRole>> {
        let line = line.trim_ascii();
        let line = line
            .strip_prefix(b"//")
            .or(line.strip_prefix(b"#"))
            .unwrap_or(line);
        let names = String::from_utf8_lossy(line.trim_ascii()).into_owned();
        let split = |separators: &[char]| -> Vec<ColumnRole> {
            names
                .split(separators)
                .filter(|name| !name.trim().is_empty())
                .map(role_of_name)
                .collect()
        };
        let by_own: &[char] = match self.separator {
            FieldSeparator::Spaces => &[' ', '\t'],
            FieldSeparator::Comma => &[','],
            FieldSeparator::Semicolon => &[';'],
        };
        [split(by_own), split(&[' ', '\t', ',', ';'])]
            .into_iter()
            .find(|roles| {
                let has = |axis| {
                    roles
                        .iter()
                        .filter(|role| **role == ColumnRole::Position(axis))
                        .count()
                        == 1
                };
                width >= 3 && roles.len() == width && (0..3).all(has)
            })
    }

    /// Names the columns as PTX has them: position, intensity, color.
    pub(super) fn name_as_ptx(&mut self) {
        let width = self.columns.len();
        self.columns = (0..width)
            .map(|at| match at {
                0..=2 => ColumnRole::Position(at),
                3 => ColumnRole::Attribute("intensity".to_owned()),
                4..=6 if width >= 7 => ColumnRole::Color(at - 4),
                _ => ColumnRole::Attribute(format!("column_{}", at + 1)),
            })
            .collect();
    }

    /// The decision in words.
    pub(super) fn words(&self) -> String {
        let name = |role: &ColumnRole| match role {
            ColumnRole::Position(axis) => ["x", "y", "z"][*axis].to_owned(),
            ColumnRole::Normal(axis) => ["nx", "ny", "nz"][*axis].to_owned(),
            ColumnRole::Color(channel) => ["red", "green", "blue"][*channel].to_owned(),
            ColumnRole::Attribute(name) => name.clone(),
        };
        let names: Vec<String> = self.columns.iter().take(24).map(name).collect();
        let separator = match self.separator {
            FieldSeparator::Spaces => "spaces",
            FieldSeparator::Comma => "commas",
            FieldSeparator::Semicolon => "semicolons",
        };
        let comma = if self.is_decimal_comma {
            ", decimal commas"
        } else {
            ""
        };
        let by = if self.is_named {
            "as its line of names says"
        } else {
            "by the first lines"
        };
        format!("{}; between {separator}{comma}, {by}", names.join(" "))
    }
}

/// The length that most rows have; of equals, the larger.
fn usual_length(rows: &[Vec<f64>]) -> usize {
    let mut counts = std::collections::BTreeMap::new();
    for row in rows {
        *counts.entry(row.len()).or_insert(0) += 1;
    }
    counts
        .into_iter()
        .max_by_key(|&(_, count)| count)
        .map_or(0, |(length, _)| length)
}

/// The columns by their values: three of the position, then colors and normals where the values are such, attributes else.
fn guessed(rows: &[Vec<f64>], width: usize) -> Vec<ColumnRole> {
    let is_byte = |value: f64| value.fract() == 0.0 && (0.0..=255.0).contains(&value);
    let are_bytes = |at: usize| {
        at + 3 <= width
            && rows
                .iter()
                .all(|row| row[at..at + 3].iter().all(|&value| is_byte(value)))
    };
    let are_units = |at: usize| {
        at + 3 <= width
            && rows.iter().all(|row| {
                let length: f64 = row[at..at + 3].iter().map(|value| value * value).sum();
                (length - 1.0).abs() < 0.02 || length == 0.0
            })
            && rows
                .iter()
                .any(|row| row[at..at + 3].iter().any(|&value| value != 0.0))
    };
    let mut columns: Vec<ColumnRole> = (0..3).map(ColumnRole::Position).collect();
    let mut scalars = 0;
    while columns.len() < width {
        let at = columns.len();
        let is_new = |role: ColumnRole| !columns.contains(&role);
        if are_units(at) && is_new(ColumnRole::Normal(0)) {
            columns.extend((0..3).map(ColumnRole::Normal));
        } else if are_bytes(at)
            && is_new(ColumnRole::Color(0))
            && !(at + 4 == width && are_bytes(at + 1))
        {
            // Of four whole numbers at the end the first is the intensity, as PTS has it.
            columns.extend((0..3).map(ColumnRole::Color));
        } else {
            scalars += 1;
            columns.push(ColumnRole::Attribute(if scalars == 1 {
                "intensity".to_owned()
            } else {
                format!("column_{}", at + 1)
            }));
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_decide() {
        for (text, columns) in [
            (
                "1 2 3\n4 5 6\n",
                "x y z; between spaces, by the first lines",
            ),
            (
                "1,2,3\n4,5,6\n",
                "x y z; between commas, by the first lines",
            ),
            ("1, 2, 3\n", "x y z; between commas, by the first lines"),
            (
                "1,5\t2,5\t3\n",
                "x y z; between spaces, decimal commas, by the first lines",
            ),
            (
                "1,5;2;3\r\n1,5;2;3\r\n",
                "x y z; between semicolons, decimal commas, by the first lines",
            ),
            (
                "2\n1.5 2 3 -900 1 2 255\n1.5 2 3 -901 1 2 255\n",
                "x y z intensity red green blue; between spaces, by the first lines",
            ),
            (
                "1 2 3 100 1 2 255\n",
                "x y z intensity red green blue; between spaces, by the first lines",
            ),
            (
                "1 2 3 1 2 255\n",
                "x y z red green blue; between spaces, by the first lines",
            ),
            (
                "1 2 3 0 0.6 0.8\n",
                "x y z nx ny nz; between spaces, by the first lines",
            ),
            (
                "1 2 3 9 8 7 0 1 0\n",
                "x y z red green blue nx ny nz; between spaces, by the first lines",
            ),
            (
                "//X Y Z R G B Scalar_field\n1 2 3 4 5 6 7\n",
                "x y z red green blue scalar_field; between spaces, as its line of names says",
            ),
            (
                "id;X;Y;Z\n7;1;2;3\n",
                "id x y z; between semicolons, as its line of names says",
            ),
            (
                "made by hand\n1 2 3 0.5\n",
                "x y z intensity; between spaces, by the first lines",
            ),
        ] {
            assert_eq!(
                TextDialect::sniff(text.as_bytes()).words(),
                columns,
                "{text}"
            );
        }
        for text in ["", "hello\n", "1 2\n3 4\n", ";;;\n"] {
            assert!(
                TextDialect::sniff(text.as_bytes()).columns.is_empty(),
                "{text}"
            );
        }
    }
}
