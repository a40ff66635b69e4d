//! Values of JSON files: numbers that may be written as text, and lists of them.

use super::source::read_text;
use crate::photos::error::PhotoError;
use serde_json::Value;
use std::path::Path;

/// Reads a JSON file.
pub(super) fn read_json(path: &Path) -> Result<Value, PhotoError> {
    serde_json::from_str(&read_text(path)?)
        .map_err(|e| PhotoError::at_line(path, e.line(), e.to_string()))
}

/// A number, also one that is written as text.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::String(text) => text.trim().parse().ok(),
        other => other.as_f64(),
    }
}

/// The numbers of a list; `None` where one is none or their count differs.
pub(super) fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list = value.as_array().filter(|list| list.len() == N)?;
    let mut values = [0.0; N];
    for (value, element) in values.iter_mut().zip(list) {
        *value = number(element)?;
    }
    Some(values)
}

/// A name that may be a number.
pub(super) fn name(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}
