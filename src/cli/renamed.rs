//! Options that have another name now: the old one still works, and says so.

use super::say;
use std::ffi::OsString;

/// Values of `--shading` that are of `--splat-shading` now.
const OLD_VALUES: [&str; 2] = ["per-splat", "deferred"];

/// The words of a command line, with new names for old ones.
pub(super) fn in_words(words: Vec<OsString>) -> Vec<OsString> {
    let mut out: Vec<OsString> = Vec::with_capacity(words.len());
    for word in words {
        let text = word.to_str().unwrap_or("");
        let joined = text
            .strip_prefix("--shading=")
            .filter(|v| OLD_VALUES.contains(v));
        let follows = out.last().is_some_and(|last| last == "--shading");
        if let Some(value) = joined {
            tell(value);
            out.push(format!("--splat-shading={value}").into());
        } else if follows && OLD_VALUES.contains(&text) {
            tell(text);
            out.pop();
            out.extend(["--splat-shading".into(), word]);
        } else {
            out.push(word);
        }
    }
    out
}

fn tell(value: &str) {
    say(&format!(
        "surfel: --shading {value} is now --splat-shading {value}; --shading is of normals: flat, smooth, file"
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_values_get_the_new_name_and_nothing_else_changes() {
        let of = |text: &str| {
            let words = in_words(text.split(' ').map(OsString::from).collect());
            words.join(&OsString::from(" "))
        };
        assert_eq!(
            of("render --shading deferred x"),
            "render --splat-shading deferred x"
        );
        assert_eq!(of("--shading=per-splat"), "--splat-shading=per-splat");
        for same in [
            "--shading flat",
            "--shading=smooth",
            "deferred --shading",
            "-o deferred",
        ] {
            assert_eq!(of(same), same);
        }
    }
}
