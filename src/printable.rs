//! Words out of files, fit to be shown: a file made for harm may hold what moves a terminal's cursor, or no end of text.

/// Most characters of a cause in an error.
pub(crate) const MOST_CHARS: usize = 300;

/// The text with control characters replaced, cut after `most` characters.
pub(crate) fn printable(text: &str, most: usize) -> String {
    let mut out: String = text
        .chars()
        .take(most)
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if text.chars().nth(most).is_some() {
        out.push_str("...");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_a_cursor_is_replaced_and_long_texts_end() {
        assert_eq!(
            printable("a\x1b[2Jb\0\n", 40),
            "a\u{fffd}[2Jb\u{fffd}\u{fffd}"
        );
        assert_eq!(printable("größer", 6), "größer");
        assert_eq!(printable("größer", 3), "grö...");
    }
}
