//! Words, lines and numbers of text formats, straight from the bytes.
//!
//! Lines are not counted while reading: an error counts them up to its offset, so that good files pay nothing.

/// Reads words and lines of a byte slice. Never panics; at the end every reader returns `None`.
#[derive(Debug, Clone)]
pub(super) struct TextScanner<'a> {
    pub(super) data: &'a [u8],
    /// Offset of the next byte, at most `data.len()`.
    pub(super) at: usize,
}

impl<'a> TextScanner<'a> {
    pub(super) fn new(data: &'a [u8], at: usize) -> Self {
        Self {
            data,
            at: at.min(data.len()),
        }
    }

    /// The next word and its offset; line ends are like any other white space.
    #[inline]
    pub(super) fn word(&mut self) -> Option<(&'a [u8], usize)> {
        let mut at = self.at;
        while is_space(*self.data.get(at)?) {
            at += 1;
        }
        let start = at;
        while self.data.get(at).is_some_and(|&byte| !is_space(byte)) {
            at += 1;
        }
        self.at = at;
        Some((&self.data[start..at], start))
    }

    /// The rest of the current line without its end (`\n`, `\r\n` or a lone `\r`), and its offset; then stands
    /// on the next line.
    pub(super) fn line(&mut self) -> Option<(&'a [u8], usize)> {
        let start = self.at;
        let rest = self.data.get(start..).filter(|rest| !rest.is_empty())?;
        let length = rest
            .iter()
            .position(|&byte| byte == b'\n' || byte == b'\r')
            .unwrap_or(rest.len());
        let crlf = rest.get(length..length + 2) == Some(b"\r\n");
        self.at = (start + length + if crlf { 2 } else { 1 }).min(self.data.len());
        Some((&rest[..length], start))
    }

    /// The next line that holds more than white space and comments (`#` to the end), trimmed of both.
    pub(super) fn meaningful_line(&mut self) -> Option<(&'a [u8], usize)> {
        loop {
            let (line, start) = self.line()?;
            let end = line
                .iter()
                .position(|&byte| byte == b'#')
                .unwrap_or(line.len());
            let line = line[..end].trim_ascii();
            if !line.is_empty() {
                return Some((line, start));
            }
        }
    }
}

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&byte| is_space(byte))
        .filter(|word| !word.is_empty())
}

#[inline]
pub(super) fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// The number of the line, from 1, that holds the byte at `at`.
pub(super) fn line_of(data: &[u8], at: usize) -> u64 {
    let before = &data[..at.min(data.len())];
    let feeds = before.iter().filter(|&&byte| byte == b'\n').count();
    // Lone carriage returns end lines too; the one before a feed belongs to it.
    let returns = before.iter().filter(|&&byte| byte == b'\r').count();
    let pairs = before.windows(2).filter(|pair| *pair == b"\r\n").count();
    let split_pair = before.last() == Some(&b'\r') && data.get(at) == Some(&b'\n');
    (feeds + returns - pairs - usize::from(split_pair)) as u64 + 1
}

/// A word for a message: printable, at most 40 characters.
pub(super) fn shown(word: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(&word[..word.len().min(160)])
        .chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if text.chars().count() > 40 {
        text.chars().take(39).chain(['\u{2026}']).collect()
    } else {
        text
    }
}

const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// The decimal number of a whole word, correctly rounded; also `nan`, `inf` and the spellings of C libraries
/// (`1.#QNAN`, `nan(ind)`). `None` when the word is no number.
///
/// Fast path after W. D. Clinger, "How to Read Floating Point Numbers Accurately", PLDI 1990, section 3: a
/// mantissa below 2^53 and a power of ten up to 22 are both exact, so one operation rounds once.
#[inline]
pub(super) fn parse_f64(word: &[u8]) -> Option<f64> {
    let (negative, mut at) = match word.first()? {
        b'-' => (true, 1),
        b'+' => (false, 1),
        _ => (false, 0),
    };
    let mut mantissa = 0_u64;
    let mut exponent = 0_i32;
    let first_digit = at;
    let digit = |at: usize| {
        word.get(at)
            .map(|byte| byte.wrapping_sub(b'0'))
            .filter(|&digit| digit < 10)
    };
    while let Some(value) = digit(at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(value));
        at += 1;
    }
    let mut digits = at - first_digit;
    if word.get(at) == Some(&b'.') {
        at += 1;
        let fraction = at;
        while let Some(value) = digit(at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(value));
            at += 1;
        }
        digits += at - fraction;
        exponent = -((at - fraction).min(1000) as i32);
    }
    if matches!(word.get(at), Some(b'e' | b'E')) {
        at += 1;
        let negative_exponent = word.get(at) == Some(&b'-');
        at += usize::from(matches!(word.get(at), Some(b'-' | b'+')));
        let first = at;
        let mut written = 0_i32;
        while let Some(value) = digit(at) {
            written = (written * 10 + i32::from(value)).min(10_000);
            at += 1;
        }
        if at == first {
            return parse_f64_slowly(word);
        }
        exponent += if negative_exponent { -written } else { written };
    }
    // 19 digits cannot have wrapped around 64 bits; more go the slow way.
    let exact = at == word.len() && (1..=19).contains(&digits) && mantissa < (1 << 53);
    if !exact || exponent.unsigned_abs() > 22 {
        return parse_f64_slowly(word);
    }
    let power = POWERS_OF_TEN[exponent.unsigned_abs() as usize];
    let value = if exponent < 0 {
        mantissa as f64 / power
    } else {
        mantissa as f64 * power
    };
    Some(if negative { -value } else { value })
}

#[cold]
fn parse_f64_slowly(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let bare = text.trim_start_matches(['-', '+']).to_ascii_lowercase();
    let not_finite = ["nan(", "1.#qnan", "1.#snan", "1.#ind", "1.#inf"];
    not_finite
        .iter()
        .any(|spelling| bare.starts_with(spelling))
        .then_some(f64::NAN)
}

/// The integer of a whole word, with sign; `None` when it is none or beyond 64 bits.
pub(super) fn parse_i64(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The rest of a line behind its first word, trimmed; names may hold spaces.
pub(super) fn after_keyword(line: &[u8]) -> &[u8] {
    let line = line.trim_ascii();
    line.iter()
        .position(u8::is_ascii_whitespace)
        .map_or(&[], |end| line[end..].trim_ascii())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn numbers_equal_the_standard_parser() {
        let mut state = 7_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        for _ in 0..200_000 {
            let value = f64::from_bits(next() << 33 ^ next() << 11 ^ next());
            if !value.is_finite() {
                continue;
            }
            let small = f64::from(value as f32 % 1e4);
            for text in [
                format!("{value}"),
                format!("{value:e}"),
                format!("{small:.6}"),
                format!("{small}"),
                format!("{small:e}"),
            ] {
                let wanted: f64 = text.parse().unwrap();
                assert_eq!(
                    parse_f64(text.as_bytes()).unwrap().to_bits(),
                    wanted.to_bits(),
                    "{text}"
                );
            }
        }
    }

    #[test]
    fn odd_spellings() {
        for (text, value) in [
            ("1.", 1.0),
            (".5", 0.5),
            ("+2", 2.0),
            ("-0", -0.0),
            ("1e3", 1e3),
            ("1E-3", 1e-3),
            ("0e99999", 0.0),
        ] {
            assert_eq!(parse_f64(text.as_bytes()), Some(value), "{text}");
        }
        let long = format!("0.{}1", "0".repeat(5000));
        assert_eq!(parse_f64(long.as_bytes()), Some(0.0));
        for text in ["nan", "-NaN", "1.#QNAN", "-1.#IND", "nan(ind)"] {
            assert!(parse_f64(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        assert_eq!(parse_f64(b"-inf"), Some(f64::NEG_INFINITY));
        for text in [
            "", "-", ".", "e5", "1e", "1,5", "0x10", "1.2.3", "--1", "1#2", "\u{661}",
        ] {
            assert_eq!(parse_f64(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn lines_end_in_three_ways_and_are_counted_the_same() {
        let data = b"a\nb\r\nc\rd\r\n\r\nf";
        let mut scanner = TextScanner::new(data, 0);
        let mut lines = Vec::new();
        while let Some((line, at)) = scanner.line() {
            lines.push((String::from_utf8(line.to_vec()).unwrap(), line_of(data, at)));
        }
        let wanted = ["a", "b", "c", "d", "", "f"].map(String::from);
        assert_eq!(lines, wanted.into_iter().zip(1..).collect::<Vec<_>>());
    }

    #[test]
    fn words_report_their_place() {
        let mut scanner = TextScanner::new(b"  ab\tc\r\n", 0);
        assert_eq!(scanner.word(), Some((&b"ab"[..], 2)));
        assert_eq!(scanner.word(), Some((&b"c"[..], 5)));
        assert_eq!(scanner.word(), None);
        assert_eq!(words(b" x  y ").collect::<Vec<_>>(), [b"x", b"y"]);
        assert_eq!(shown(&[b'x'; 99]).chars().count(), 40);
    }
}
