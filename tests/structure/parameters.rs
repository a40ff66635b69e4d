//! Parameters that a reader can name: no function takes two tuples or more. What does is counted, and the number only goes
//! down.

use super::sources;

/// Functions that take more than one. To be lowered with each that is mended, never raised.
const TUPLES: usize = 5;

/// The parameters of a function whose parenthesis was opened before `rest`.
fn parameters(rest: &str) -> Vec<&str> {
    let (mut depth, mut first, mut found) = (0, 0, Vec::new());
    for (at, letter) in rest.char_indices() {
        match letter {
            '(' | '[' | '{' | '<' => depth += 1,
            // The arrow of a closure's type closes nothing.
            '>' if rest[..at].ends_with('-') => {}
            ')' if depth == 0 => {
                found.push(&rest[first..at]);
                break;
            }
            ')' | ']' | '}' | '>' => depth -= 1,
            ',' if depth == 0 => {
                found.push(&rest[first..at]);
                first = at + 1;
            }
            _ => {}
        }
    }
    found
}

/// Names of functions with two parameters or more that are tuples.
fn with_tuples(code: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices("fn ") {
        let is_word = code[..at].ends_with(super::is_word);
        let declared = &code[at + 3..];
        let Some(end) = declared.find(['(', '<']).filter(|_| !is_word) else {
            continue;
        };
        let name = &declared[..end];
        // Generic parameters end before the line's first parenthesis that is none of theirs.
        let open = match declared[end..].starts_with('<') {
            true => {
                let mut depth = 0;
                let generic = declared[end..].char_indices().find(|&(at, letter)| {
                    let is_arrow = declared[end..end + at].ends_with('-');
                    depth += i32::from(letter == '<') - i32::from(letter == '>' && !is_arrow);
                    depth == 0
                });
                generic.map(|(at, _)| end + at + 1)
            }
            false => Some(end),
        };
        let Some(open) = open.filter(|&open| declared[open..].starts_with('(')) else {
            continue;
        };
        let is_tuple = |parameter: &&str| {
            let pattern = parameter.trim_start().starts_with('(');
            let typed = parameter
                .split_once(": ")
                .is_some_and(|(_, own)| own.starts_with('('));
            pattern || typed
        };
        if parameters(&declared[open + 1..])
            .iter()
            .filter(|p| is_tuple(p))
            .count()
            > 1
        {
            found.push(name);
        }
    }
    found
}

#[test]
fn functions_take_few_tuples() {
    let found: Vec<String> = sources()
        .iter()
        .flat_map(|(file, code)| {
            let names = with_tuples(code);
            names.into_iter().map(move |name| format!("{file}: {name}"))
        })
        .collect();
    assert_eq!(found.len(), TUPLES, "{found:#?}");
}

#[test]
fn tuples_of_parameters_are_seen() {
    let code = "fn one((a, b): (u8, u8), c: [u8; 2]) {}
        fn two((a, b): (u8, u8), c: (f32, f32)) {}
        fn of_type<F: Fn(u8) -> (u8, u8)>(a: (u8, u8), (b, c): (u8, F)) {}
        fn closure(a: &dyn Fn((u8, u8)) -> u8, b: &dyn Fn((u8, u8), u8)) {}
        fn nested(a: Option<(u8, u8)>, (b, c): (u8, [u8; 2])) {}";
    assert_eq!(with_tuples(code), ["two", "of_type"]);
}
