//! The field for what is kept, and the boxes of classes.

use super::*;
use crate::input::{ColorSetting, PointColoring};

const ENTER: Event = Event::Key {
    key: egui::Key::Enter,
    physical_key: None,
    pressed: true,
    repeat: false,
    modifiers: egui::Modifiers::NONE,
};

#[test]
fn conditions_are_written_and_classes_ticked() {
    let (facts, settings, mut stage) = (facts(), Settings::default(), Stage::new());
    let with = |text: &str| PanelState {
        keep: Some(KeepState {
            text: text.to_owned(),
            ..keep::for_tests()
        }),
        ..state(&settings, &facts)
    };
    let shown = with("");
    let controls = stage.controls(&shown);
    let at = find(&controls, Role::CheckBox, "6 building").middle;
    let wishes = stage.click(&shown, at);
    assert_eq!(wishes, [PanelWish::Keep("class=2".to_owned())]);
    let field = controls.iter().find(|own| own.role == Role::TextInput);
    let at = field.unwrap().middle;
    assert!(stage.click(&shown, at).is_empty());
    stage.pass(&shown, vec![Event::Text("height=1..".to_owned())]);
    let (_, _, wishes) = stage.pass(&shown, vec![ENTER]);
    assert_eq!(wishes, [PanelWish::Keep("height=1..".to_owned())]);
    // What is kept otherwise, such as by a key, stands in the field.
    let (_, texts, _) = stage.pass(&with("class=6"), vec![Event::PointerGone]);
    assert!(texts.iter().any(|text| text == "class=6"), "{texts:?}");
    let hidden = PanelState {
        keep: None,
        ..state(&settings, &facts)
    };
    let controls = stage.controls(&hidden);
    assert!(controls.iter().all(|own| own.role != Role::TextInput));
}

#[test]
fn points_take_the_colors_of_what_is_chosen_and_a_range() {
    let (facts, settings, mut stage) = (facts(), Settings::default(), Stage::new());
    let shown = state(&settings, &facts);
    let height = PointColoring::Height;
    let ask = |range| {
        let by = height.clone();
        [PanelWish::ColorPoints(Some(ColorSetting { by, range }))]
    };
    // Written into a field, an end takes effect when it is left.
    let controls = stage.controls(&shown);
    let end = controls
        .iter()
        .find(|own| own.name.starts_with("31.5"))
        .unwrap();
    let at = end.middle;
    assert!(stage.click(&shown, at).is_empty());
    stage.pass(&shown, vec![Event::Text("25".to_owned())]);
    let (_, _, wishes) = stage.pass(&shown, vec![ENTER]);
    assert_eq!(wishes, ask(Some([12.5, 25.0])));
}
