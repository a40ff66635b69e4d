//! The part of the panel for what is kept: conditions in a field, and classes to tick.

use super::PanelWish;
use super::point_colors::{self, PointColorState};
#[cfg(test)]
use crate::input::PointColoring;
use crate::input::{FieldCondition, FilterField, PointFilter, name_of_class};
use egui::{Key, TextEdit, Ui};

/// State of it that the panel shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeepState {
    /// The conditions, with blanks between.
    pub text: String,
    /// Classes that points have, and whether each is kept as far as conditions on classes say.
    pub classes: Vec<(u8, bool)>,
    /// Colors of points.
    pub colors: PointColorState,
}

/// Conditions as they are being written, and those that they were written over.
#[derive(Debug, Clone, Default)]
struct WrittenText {
    now: String,
    of: String,
}

/// Tells whether a condition is on classes.
fn is_of_classes(condition: &FieldCondition) -> bool {
    matches!(&condition.field, FilterField::Attribute(name) if name.eq_ignore_ascii_case("class"))
}

/// Tells whether conditions on classes keep a class.
pub fn has_class(filter: &PointFilter, class: u8) -> bool {
    let class = f64::from(class);
    let own = filter.conditions.iter().filter(|own| is_of_classes(own));
    own.map(|own| &own.ranges).all(|ranges| {
        ranges
            .iter()
            .any(|&[low, high]| low <= class && class <= high)
    })
}

/// The conditions with other classes; `None` where none is left.
fn with_classes(text: &str, classes: &[(u8, bool)]) -> Option<String> {
    let mut filter = PointFilter::of_words(text).unwrap_or_default();
    filter.conditions.retain(|own| !is_of_classes(own));
    let on = classes.iter().filter(|own| own.1);
    let ranges: Vec<[f64; 2]> = on.map(|own| [f64::from(own.0); 2]).collect();
    if ranges.is_empty() {
        return None;
    }
    if ranges.len() < classes.len() {
        let field = FilterField::Attribute("class".to_owned());
        filter.conditions.push(FieldCondition { field, ranges });
    }
    Some(filter.to_string())
}

/// Colors of points, a field for conditions, and a box for each class where there are several.
pub(super) fn show(ui: &mut Ui, state: &KeepState, wishes: &mut Vec<PanelWish>) {
    point_colors::show(ui, &state.colors, wishes);
    let tip = "Keep only what meets these conditions: class=2,6 height=10..80 intensity=..200 x=5.., or any attribute \
        that surfel info lists. Enter applies them; empty keeps all (Ctrl K)";
    let id = ui.id().with("keep");
    let mut written: WrittenText = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    if written.of != state.text {
        written.now.clone_from(&state.text);
        written.of.clone_from(&state.text);
    }
    ui.horizontal(|ui| {
        ui.label("keep").on_hover_text(tip);
        let field = TextEdit::singleline(&mut written.now)
            .hint_text("class=2,6 height=10..80")
            .desired_width(200.0);
        let response = ui.add(field).on_hover_text(tip);
        if response.lost_focus()
            && ui.input(|input| input.key_pressed(Key::Enter))
            && written.now.trim() != state.text
        {
            wishes.push(PanelWish::Keep(written.now.trim().to_owned()));
        }
    });
    ui.data_mut(|data| data.insert_temp(id, written));
    if state.classes.len() < 2 {
        return;
    }
    for (index, &(class, is_on)) in state.classes.iter().enumerate() {
        let name = name_of_class(class.into()).unwrap_or("class");
        let mut is_kept = is_on;
        let tip = "Keep the points of this class, or not (Ctrl K shows all)";
        ui.checkbox(&mut is_kept, format!("{class} {name}"))
            .on_hover_text(tip);
        if is_kept != is_on {
            let mut classes = state.classes.clone();
            classes[index].1 = is_kept;
            if let Some(text) = with_classes(&state.text, &classes) {
                wishes.push(PanelWish::Keep(text));
            }
        }
    }
}

/// Two classes, both kept, and colors by height.
#[cfg(test)]
pub(super) fn for_tests() -> KeepState {
    KeepState {
        text: String::new(),
        classes: vec![(2, true), (6, true)],
        colors: PointColorState {
            choices: vec![PointColoring::Height],
            by: Some(PointColoring::Height),
            opened_by: None,
            range: Some([12.5, 31.5]),
        },
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]
    use super::*;

    #[test]
    fn classes_are_conditions_beside_others() {
        let classes = |on: &[u8]| -> Vec<(u8, bool)> {
            [2, 5, 6]
                .into_iter()
                .map(|class| (class, on.contains(&class)))
                .collect()
        };
        let with = |text: &str, on: &[u8]| with_classes(text, &classes(on));
        assert_eq!(with("", &[2, 6]).unwrap(), "class=2,6");
        assert_eq!(
            with("class=5 height=1..", &[2]).unwrap(),
            "height=1.. class=2"
        );
        assert_eq!(
            with("height=1.. CLASS=2", &[2, 5, 6]).unwrap(),
            "height=1.."
        );
        assert_eq!(with("class=2", &[]), None);
        let filter = PointFilter::of_words("class=2..5 height=3..").unwrap();
        assert!(has_class(&filter, 5) && has_class(&filter, 2) && !has_class(&filter, 6));
        assert!(has_class(&PointFilter::default(), 6));
    }
}
