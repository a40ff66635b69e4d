use super::*;

const NONE: KeyModifiers = KeyModifiers {
    shift: false,
    control: false,
    other: false,
};
const SHIFT: KeyModifiers = KeyModifiers {
    shift: true,
    ..NONE
};
const CONTROL: KeyModifiers = KeyModifiers {
    control: true,
    ..NONE
};

#[test]
fn the_keys_of_the_thesis_and_their_neighbors() {
    let letter = |c| command(KeyboardKey::Char(c), NONE);
    assert_eq!(letter('a'), Some(KeyCommand::Method(Method::Triangles)));
    assert_eq!(letter('s'), Some(KeyCommand::Method(Method::Points)));
    assert_eq!(letter('d'), Some(KeyCommand::Method(Method::Pop)));
    assert_eq!(letter('+'), Some(KeyCommand::ThresholdBy(0.25)));
    assert_eq!(letter('-'), Some(KeyCommand::ThresholdBy(-0.25)));
    assert_eq!(letter('ß'), None);
    assert_eq!(
        command(KeyboardKey::Digit(7), NONE),
        Some(KeyCommand::Threshold(7.0))
    );
    assert_eq!(command(KeyboardKey::Digit(0), NONE), None);
    assert_eq!(
        command(KeyboardKey::Pad(7), NONE),
        Some(KeyCommand::LookFrom(0.0, FRAC_PI_2))
    );
    assert_eq!(
        command(KeyboardKey::Pad(7), CONTROL),
        Some(KeyCommand::LookFrom(0.0, -FRAC_PI_2))
    );
    assert_eq!(
        command(KeyboardKey::Char('n'), SHIFT),
        Some(KeyCommand::Splat(-1)),
        "backward"
    );
    assert_eq!(
        command(KeyboardKey::Char('c'), CONTROL),
        Some(KeyCommand::CopyCamera)
    );
}

#[test]
fn every_key_that_is_listed_has_a_command_of_its_own_and_no_other_letter_has_one() {
    let listed: String = KEYS[1..]
        .iter()
        .flat_map(|(_, keys)| keys.iter())
        .map(|(key, _)| format!("{key} "))
        .collect();
    let words: Vec<&str> = listed.split([' ', ',']).collect();
    let mut commands = Vec::new();
    for c in 'a'..='z' {
        let found = command(KeyboardKey::Char(c), NONE);
        // Ctrl C and Ctrl V are listed as well.
        let is_listed = words.contains(&c.to_ascii_uppercase().to_string().as_str());
        assert!(found.is_none() || is_listed, "{c} is not listed");
        commands.extend(found);
    }
    for (index, command) in commands.iter().enumerate() {
        assert!(!commands[..index].contains(command), "{command:?} twice");
    }
    for (key, name) in [
        (KeyboardKey::Tab, "Tab"),
        (KeyboardKey::F(1), "F1"),
        (KeyboardKey::F(11), "F11"),
        (KeyboardKey::Space, "Space"),
        (KeyboardKey::Enter, "Enter"),
        (KeyboardKey::Backspace, "Backspace"),
        (KeyboardKey::Escape, "Esc"),
        (KeyboardKey::Left, "Arrows"),
        (KeyboardKey::PageDown, "Page"),
        (KeyboardKey::Home, "Home"),
    ] {
        assert!(command(key, NONE).is_some(), "{key:?}");
        assert!(words.contains(&name), "{name} is not listed");
    }
    assert!(help().contains("F11") && help().contains("turn about"));
    assert!(help().lines().all(|line| line.len() < 130), "{}", help());
}

#[test]
fn keys_of_the_lamp() {
    let lamp = |key, modifiers| match command(key, modifiers) {
        Some(KeyCommand::Lamp(change)) => Some(change),
        _ => None,
    };
    assert_eq!(
        lamp(KeyboardKey::Right, NONE),
        Some(LampChange::Turn(5.0, 0.0))
    );
    assert_eq!(
        lamp(KeyboardKey::Up, NONE),
        Some(LampChange::Turn(0.0, 5.0))
    );
    assert_eq!(lamp(KeyboardKey::Down, CONTROL), None);
    assert_eq!(
        lamp(KeyboardKey::Char('l'), SHIFT),
        Some(LampChange::Anchor)
    );
    assert_eq!(
        lamp(KeyboardKey::PageDown, NONE),
        Some(LampChange::Distance(0.8))
    );
    assert_eq!(
        lamp(KeyboardKey::End, NONE),
        Some(LampChange::Specular(-0.05))
    );
    assert_eq!(
        lamp(KeyboardKey::Home, SHIFT),
        Some(LampChange::Shininess(1.25))
    );
    assert_eq!(
        lamp(KeyboardKey::Home, CONTROL),
        Some(LampChange::Ambient(0.05))
    );
}

#[test]
fn shortcuts_of_the_desktop_are_left_alone() {
    let alt = KeyModifiers {
        other: true,
        ..NONE
    };
    assert_eq!(command(KeyboardKey::Char('q'), CONTROL), None);
    assert_eq!(command(KeyboardKey::Digit(1), alt), None);
    assert_eq!(command(KeyboardKey::Tab, alt), None);
}

#[test]
fn drags_follow_the_button_that_began_them() {
    let mut mouse = MouseState::default();
    let at = DVec2::new(10.0, 20.0);
    assert_eq!(mouse.moved(at), None);
    let press = |m: &mut MouseState, b, mods| m.button(b, true, mods, 0.0);
    assert_eq!(
        press(&mut mouse, MouseButton::Right, NONE),
        Some(MouseGesture::Begin(DragAction::Zoom, at))
    );
    assert_eq!(
        press(&mut mouse, MouseButton::Left, NONE),
        None,
        "one drag at a time"
    );
    assert_eq!(
        mouse.moved(at + DVec2::X),
        Some(MouseGesture::Move(DragAction::Zoom, DVec2::X))
    );
    mouse.button(MouseButton::Left, false, NONE, 0.0);
    assert!(
        mouse.drag.is_some(),
        "the other button's release ends nothing"
    );
    mouse.button(MouseButton::Right, false, NONE, 0.0);
    assert!(mouse.drag.is_none());
    assert_eq!(mouse.moved(at), None);
    let with_shift = press(&mut mouse, MouseButton::Left, SHIFT);
    assert_eq!(with_shift, Some(MouseGesture::Begin(DragAction::Pan, at)));
    mouse.release();
    let with_control = press(&mut mouse, MouseButton::Left, CONTROL);
    assert_eq!(
        with_control,
        Some(MouseGesture::Begin(DragAction::Lamp, at))
    );
    mouse.release();
    let middle = press(&mut mouse, MouseButton::Middle, NONE);
    assert_eq!(middle, Some(MouseGesture::Begin(DragAction::Pan, at)));
}

#[test]
fn two_quick_clicks_in_one_place_are_a_double_click() {
    let click = |mouse: &mut MouseState, time: f64| {
        let gesture = mouse.button(MouseButton::Left, true, NONE, time);
        mouse.button(MouseButton::Left, false, NONE, time + 0.05);
        gesture
    };
    let turn = Some(MouseGesture::Begin(DragAction::Turn, DVec2::ZERO));
    let mut mouse = MouseState::default();
    assert_eq!(click(&mut mouse, 1.0), turn);
    assert_eq!(
        click(&mut mouse, 1.2),
        Some(MouseGesture::DoubleClick(DVec2::ZERO))
    );
    assert_eq!(click(&mut mouse, 1.4), turn, "a third click begins anew");
    assert_eq!(click(&mut mouse, 3.0), turn, "too late");
    mouse.moved(DVec2::splat(50.0));
    let elsewhere = Some(MouseGesture::Begin(DragAction::Turn, DVec2::splat(50.0)));
    assert_eq!(click(&mut mouse, 3.1), elsewhere, "elsewhere");
}
