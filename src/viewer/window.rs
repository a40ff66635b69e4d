//! The window system: its events become ours, and what the app asks for is done.

use super::app::{FileAsk, ViewerApp};
use super::event::{KeyModifiers, KeyboardKey, MouseButton, ViewerEvent};
use super::file_watch::{FileWatch, WATCH_INTERVAL_S};
use super::loader::ModelLoader;
use super::record::{EventRecorder, RecordEntry};
use super::{ViewerError, ViewerOptions, text};
use glam::DVec2;
use glfw::{Action, GlfwReceiver, PWindow, WindowEvent, WindowHint, WindowMode};
use std::time::{Duration, Instant};

/// How long the event loop sleeps at most while a model is loaded, seconds.
const LOADING_WAIT_S: f64 = 0.05;
/// How long it sleeps at most when nothing happens, seconds: Ctrl-C is noticed after that.
const IDLE_WAIT_S: f64 = 0.5;
/// The key that opens files again: what a watched file that has changed is in a recording.
const RELOAD_PRESS: ViewerEvent = ViewerEvent::Key {
    key: KeyboardKey::F(5),
    pressed: true,
    repeat: false,
    modifiers: KeyModifiers {
        shift: false,
        control: false,
        other: false,
    },
};
/// Least time between two titles while frames are drawn.
const TITLE_INTERVAL: Duration = Duration::from_millis(250);

/// How long the window system has to give a window another size.
const RESIZE_PATIENCE: Duration = Duration::from_secs(5);

/// A window with its events.
pub(super) struct ViewerWindow {
    pub(super) window: PWindow,
    events: GlfwReceiver<(f64, WindowEvent)>,
    /// Place and size before full screen.
    windowed: Option<(i32, i32, i32, i32)>,
    ui_scale: Option<f32>,
    is_iconified: bool,
    title: String,
    title_time: Instant,
}

impl ViewerWindow {
    /// Opens the window; none where the window system gives none.
    pub(super) fn open(
        glfw: &mut glfw::Glfw,
        options: &ViewerOptions,
        title: &str,
    ) -> Option<Self> {
        let (mut width, mut height) = options.size;
        if options.size_is_usual {
            // On a dense screen as large as on others, and never larger than the screen.
            glfw.window_hint(WindowHint::ScaleToMonitor(true));
            let room = glfw.with_primary_monitor(|_, monitor| {
                let monitor = monitor?;
                let (_, _, w, h) = monitor.get_workarea();
                let (x, y) = monitor.get_content_scale();
                Some((w as f32 / x.max(0.25), h as f32 / y.max(0.25)))
            });
            if let Some((w, h)) = room
                && w >= 64.0
                && h >= 64.0
            {
                (width, height) = (width.min(w as u32), height.min(h as u32));
            }
        }
        let (mut window, events) =
            glfw.create_window(width, height, title, WindowMode::Windowed)?;
        window.set_key_polling(true);
        window.set_char_polling(true);
        window.set_mouse_button_polling(true);
        window.set_cursor_pos_polling(true);
        window.set_cursor_enter_polling(true);
        window.set_scroll_polling(true);
        window.set_drag_and_drop_polling(true);
        window.set_framebuffer_size_polling(true);
        window.set_content_scale_polling(true);
        window.set_refresh_polling(true);
        window.set_iconify_polling(true);
        window.set_focus_polling(true);
        Some(Self {
            window,
            events,
            windowed: None,
            ui_scale: options.ui_scale,
            is_iconified: false,
            title: title.to_owned(),
            title_time: Instant::now(),
        })
    }

    /// Size of the picture, pixels.
    pub(super) fn size(&self) -> (u32, u32) {
        let (width, height) = self.window.get_framebuffer_size();
        (
            u32::try_from(width).unwrap_or(0),
            u32::try_from(height).unwrap_or(0),
        )
    }

    /// Width and height in the window system's units, those of the window where it fills the screen.
    pub(super) fn windowed_size(&self) -> (u32, u32) {
        let (width, height) = match self.windowed {
            Some((_, _, width, height)) => (width, height),
            None => self.window.get_size(),
        };
        (
            u32::try_from(width).unwrap_or(1).max(1),
            u32::try_from(height).unwrap_or(1).max(1),
        )
    }

    fn can_draw(&self) -> bool {
        let (width, height) = self.size();
        width > 0 && height > 0 && !self.is_iconified
    }

    /// Pixels of the picture for one unit of the cursor's coordinates.
    fn cursor_scale(&self) -> DVec2 {
        let (width, height) = self.window.get_size();
        let (pixels_x, pixels_y) = self.size();
        DVec2::new(
            f64::from(pixels_x) / f64::from(width.max(1)),
            f64::from(pixels_y) / f64::from(height.max(1)),
        )
    }

    /// The size of the picture, and how many pixels make one point of the panel.
    fn size_event(&self) -> ViewerEvent {
        let (width, height) = self.size();
        let (x, y) = self.window.get_content_scale();
        ViewerEvent::Size {
            width,
            height,
            scale: self.ui_scale.unwrap_or(x.max(y)),
        }
    }

    /// What has happened since the last call.
    fn collect(&mut self, app: &mut ViewerApp, step: u64, out: &mut Vec<RecordEntry>) {
        while let Some((time, event)) = self.events.receive() {
            let event = match event {
                WindowEvent::Refresh => {
                    app.expose();
                    continue;
                }
                WindowEvent::Iconify(is_iconified) => {
                    self.is_iconified = is_iconified;
                    app.expose();
                    continue;
                }
                other => self.translate(other),
            };
            out.extend(event.map(|event| RecordEntry { step, time, event }));
        }
    }

    fn translate(&self, event: WindowEvent) -> Option<ViewerEvent> {
        Some(match event {
            WindowEvent::FramebufferSize(..) | WindowEvent::ContentScale(..) => self.size_event(),
            WindowEvent::Focus(has_focus) => ViewerEvent::Focus(has_focus),
            WindowEvent::FileDrop(mut paths) => match paths.len() {
                0 => return None,
                1 => ViewerEvent::Drop(paths.remove(0)),
                _ => ViewerEvent::DropAll(paths),
            },
            WindowEvent::CursorPos(x, y) => {
                ViewerEvent::Cursor((DVec2::new(x, y) * self.cursor_scale()).to_array())
            }
            WindowEvent::CursorEnter(false) => ViewerEvent::CursorGone,
            WindowEvent::MouseButton(button, action, modifiers) => ViewerEvent::Button {
                button: match button {
                    glfw::MouseButtonLeft => MouseButton::Left,
                    glfw::MouseButtonRight => MouseButton::Right,
                    glfw::MouseButtonMiddle => MouseButton::Middle,
                    _ => return None,
                },
                pressed: action == Action::Press,
                modifiers: flags(modifiers),
            },
            WindowEvent::Scroll(x, y) => ViewerEvent::Scroll([x, y]),
            WindowEvent::Char(c) => ViewerEvent::Text(c),
            WindowEvent::Key(key, scancode, action, modifiers) => {
                let printed = glfw::get_key_name(Some(key), Some(scancode));
                ViewerEvent::Key {
                    key: key_of(key, printed.as_deref())?,
                    pressed: action != Action::Release,
                    repeat: action == Action::Repeat,
                    modifiers: flags(modifiers),
                }
            }
            _ => return None,
        })
    }

    /// Takes the size that a recording had, as far as the window system allows.
    pub(super) fn take_size(&mut self, wanted: (u32, u32), glfw: &mut glfw::Glfw) {
        let scale = self.cursor_scale();
        let width = (f64::from(wanted.0) / scale.x).round() as i32;
        let height = (f64::from(wanted.1) / scale.y).round() as i32;
        self.window.set_size(width, height);
        let start = Instant::now();
        while self.size() != wanted && start.elapsed() < RESIZE_PATIENCE {
            glfw.wait_events_timeout(0.01);
        }
    }

    fn toggle_full_screen(&mut self, glfw: &mut glfw::Glfw) {
        if let Some((x, y, width, height)) = self.windowed.take() {
            let (width, height) = (width.max(1) as u32, height.max(1) as u32);
            self.window
                .set_monitor(WindowMode::Windowed, x, y, width, height, None);
            return;
        }
        let (x, y) = self.window.get_pos();
        let (width, height) = self.window.get_size();
        let window = &mut self.window;
        // The monitor that most of the window lies on.
        let is_done = glfw.with_connected_monitors(|_, monitors| {
            let place = |monitor: &glfw::Monitor| {
                let (left, top) = monitor.get_pos();
                let mode = monitor.get_video_mode()?;
                Some((left, top, mode.width as i32, mode.height as i32))
            };
            let places: Vec<_> = monitors.iter().map(|m| place(m)).collect();
            let best = &monitors[monitor_of((x, y, width, height), &places)?];
            let mode = best.get_video_mode()?;
            window.set_monitor(
                WindowMode::FullScreen(best),
                0,
                0,
                mode.width,
                mode.height,
                Some(mode.refresh_rate),
            );
            Some(())
        });
        if is_done.is_some() {
            self.windowed = Some((x, y, width, height));
        }
    }

    /// Does what the app asks for; answers come as events.
    pub(super) fn answer(
        &mut self,
        app: &mut ViewerApp,
        loader: &mut ModelLoader,
        glfw: &mut glfw::Glfw,
    ) -> Vec<ViewerEvent> {
        let mut events = Vec::new();
        for ask in std::mem::take(&mut app.asks) {
            match ask {
                FileAsk::Open { path, more } => {
                    app.tell_device(loader);
                    if let Err(error) = loader.start_all(&path, &more) {
                        app.warn(&format!("cannot start to load: {error}"));
                    }
                }
                FileAsk::Keep => app.start_keeping(loader),
                FileAsk::Copy(text) => self.window.set_clipboard_string(&text),
                FileAsk::Paste => {
                    events.extend(self.window.get_clipboard_string().map(ViewerEvent::Paste))
                }
                FileAsk::FullScreen => self.toggle_full_screen(glfw),
                FileAsk::HoldCursor(is_held) => self.window.set_cursor_mode(if is_held {
                    glfw::CursorMode::Disabled
                } else {
                    glfw::CursorMode::Normal
                }),
            }
        }
        events
    }

    pub(super) fn update_title(&mut self, app: &ViewerApp, loader: &ModelLoader) {
        self.title_time = Instant::now();
        let title = if let (Some(path), Some(status)) = (loader.path(), loader.status()) {
            text::loading(&text::name(path), &status)
        } else if let Some(message) = app.failure() {
            text::failed(message)
        } else if app.screen.model().is_none() {
            "drop a model here - surfel".to_owned()
        } else {
            let frame = (app.screen.frame_ms(), &app.screen.times().counts);
            text::title(
                &app.name,
                &app.settings,
                app.has_statistics.then_some(frame),
            )
        };
        if title != self.title {
            self.window.set_title(&title);
            self.title = title;
        }
    }

    /// Runs until the window is closed.
    pub(super) fn run(
        &mut self,
        app: &mut ViewerApp,
        glfw: &mut glfw::Glfw,
        loader: &mut ModelLoader,
        mut recorder: Option<&mut EventRecorder>,
        should_stop: &dyn Fn() -> bool,
    ) -> Result<(), ViewerError> {
        let mut step = 0;
        let mut has_drawn = true;
        let mut last_time = glfw.get_time();
        let mut watch = app.options.watches.then(FileWatch::default);
        let mut answers = vec![self.size_event(), ViewerEvent::Panel(app.has_panel)];
        while !(app.is_closing || self.window.should_close() || should_stop()) {
            let can_draw = app.is_dirty() && self.can_draw();
            let smooths_in = app.smooths_in().filter(|_| loader.path().is_none());
            if can_draw && has_drawn || !answers.is_empty() {
                glfw.poll_events();
            } else {
                // Nothing to do (or the window gives no image for now): the last frames end, then it sleeps.
                app.finish(Some(&self.window))?;
                app.save_awaited(false)?;
                self.update_title(app, loader);
                let is_loading = loader.path().is_some()
                    || app.screen.wanted_pages() > 0
                    || app.waits_for_photographs();
                let longest = if is_loading || can_draw {
                    LOADING_WAIT_S
                } else {
                    IDLE_WAIT_S
                };
                let longest = watch
                    .as_ref()
                    .map_or(longest, |_| longest.min(WATCH_INTERVAL_S));
                let longest = smooths_in.map_or(longest, |at| at.min(longest));
                let due = app.next_tick().map_or(longest, |at| at - glfw.get_time());
                if due > 0.0 && !app.has_finished() {
                    glfw.wait_events_timeout(due.min(longest));
                } else {
                    glfw.poll_events();
                }
            }
            app.take_pages();
            app.take_photographs();
            let now = glfw.get_time();
            let mut entries = Vec::new();
            let entry = |event| RecordEntry {
                step,
                time: now,
                event,
            };
            self.collect(app, step, &mut entries);
            entries.extend(answers.drain(..).map(entry));
            entries.extend(app.finished().into_iter().map(entry));
            let mut result = None;
            app.tell_device(loader);
            if let Some((path, loaded)) = loader.poll() {
                let is_preview = matches!(&loaded, Ok(loaded) if loaded.is_preview);
                entries.push(entry(if is_preview {
                    ViewerEvent::Preview(path.clone())
                } else {
                    ViewerEvent::Loaded(path.clone())
                }));
                result = Some((path, loaded));
            }
            if app.next_tick().is_some_and(|at| at <= now) {
                entries.push(entry(ViewerEvent::Tick(now - last_time)));
            }
            last_time = now;
            if let (Some(path), Some(status)) = (loader.path(), loader.status()) {
                app.set_status(format!("{}: {status}", text::name(path)));
            }
            let has_events = !entries.is_empty();
            if has_events {
                if let Some(recorder) = &mut recorder {
                    recorder.add(&entries)?;
                }
                app.handle(&entries)?;
                if let Some((path, result)) = result {
                    app.loaded(&path, result)?;
                }
            }
            has_drawn = true;
            let draws = app.is_dirty() && self.can_draw();
            if draws {
                has_drawn = app.draw(Some(&self.window))?;
            }
            if has_events || draws && has_drawn {
                step += 1;
            } else if smooths_in.is_some_and(|seconds| seconds <= 0.0) {
                app.smooth(Some(&self.window))?;
            }
            answers = self.answer(app, loader, glfw);
            let is_loading = loader.path().is_some();
            if let Some(watch) = &mut watch
                && watch.has_changed(app.shown_files(), glfw.get_time(), is_loading)
            {
                answers.push(RELOAD_PRESS);
            }
            if self.title_time.elapsed() >= TITLE_INTERVAL {
                self.update_title(app, loader);
            }
        }
        app.finish(Some(&self.window))?;
        app.save_awaited(true)
    }
}

/// Left, top, width and height.
type WindowPlace = (i32, i32, i32, i32);

/// The monitor that most of a window lies on; where it lies on none, the one nearest to its middle. Of those that are
/// alike the first; monitors without a place are not chosen.
fn monitor_of(window: WindowPlace, monitors: &[Option<WindowPlace>]) -> Option<usize> {
    let (x, y, width, height) = window;
    let key = |&(left, top, w, h): &WindowPlace| {
        let across = (x + width).min(left + w) - x.max(left);
        let down = (y + height).min(top + h) - y.max(top);
        let shared = i64::from(across.max(0)) * i64::from(down.max(0));
        let middle = (x + width / 2, y + height / 2);
        let away = |at: i32, from: i32, to: i32| i64::from((from - at).max(at - to).max(0));
        let apart = away(middle.0, left, left + w).pow(2) + away(middle.1, top, top + h).pow(2);
        (shared, -apart)
    };
    let with_place = monitors.iter().enumerate();
    with_place
        .filter_map(|(index, place)| Some((index, key(place.as_ref()?))))
        .rev()
        .max_by_key(|(_, key)| *key)
        .map(|(index, _)| index)
}

fn flags(modifiers: glfw::Modifiers) -> KeyModifiers {
    KeyModifiers {
        shift: modifiers.contains(glfw::Modifiers::Shift),
        control: modifiers.contains(glfw::Modifiers::Control),
        other: modifiers.intersects(glfw::Modifiers::Alt | glfw::Modifiers::Super),
    }
}

/// Our name of a key; `printed` is what the layout prints for it.
fn key_of(key: glfw::Key, printed: Option<&str>) -> Option<KeyboardKey> {
    use glfw::Key as K;
    let between = |first: glfw::Key, last: glfw::Key| {
        let (code, first, last) = (key as i32, first as i32, last as i32);
        (first..=last).contains(&code).then(|| (code - first) as u8)
    };
    if let Some(digit) = between(K::Num0, K::Num9) {
        return Some(KeyboardKey::Digit(digit));
    }
    if let Some(digit) = between(K::Kp0, K::Kp9) {
        return Some(KeyboardKey::Pad(digit));
    }
    if let Some(number) = between(K::F1, K::F25) {
        return Some(KeyboardKey::F(number + 1));
    }
    Some(match key {
        K::KpAdd => KeyboardKey::PadAdd,
        K::KpSubtract => KeyboardKey::PadSubtract,
        K::Enter | K::KpEnter => KeyboardKey::Enter,
        K::Escape => KeyboardKey::Escape,
        K::Space => KeyboardKey::Space,
        K::Tab => KeyboardKey::Tab,
        K::Backspace => KeyboardKey::Backspace,
        K::Delete => KeyboardKey::Delete,
        K::Home => KeyboardKey::Home,
        K::End => KeyboardKey::End,
        K::PageUp => KeyboardKey::PageUp,
        K::PageDown => KeyboardKey::PageDown,
        K::Left => KeyboardKey::Left,
        K::Right => KeyboardKey::Right,
        K::Up => KeyboardKey::Up,
        K::Down => KeyboardKey::Down,
        _ => KeyboardKey::Char(printed?.chars().next()?.to_lowercase().next()?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_screen_is_on_the_monitor_that_most_of_the_window_lies_on() {
        let (left, right) = (Some((0, 0, 1920, 1080)), Some((1920, 0, 2560, 1440)));
        let both = [left, right];
        assert_eq!(monitor_of((100, 100, 800, 600), &both), Some(0));
        assert_eq!(monitor_of((1500, 100, 800, 600), &both), Some(0));
        assert_eq!(monitor_of((1600, 100, 800, 600), &both), Some(1));
        // Above the upper one, which has negative coordinates on many desktops.
        let above = [left, Some((0, -1200, 1920, 1200))];
        assert_eq!(monitor_of((10, -700, 800, 600), &above), Some(1));
        // On none: the nearest one.
        assert_eq!(monitor_of((5000, 200, 100, 100), &both), Some(1));
        assert_eq!(monitor_of((-5000, 200, 100, 100), &both), Some(0));
        assert_eq!(monitor_of((100, 100, 800, 600), &[left, left]), Some(0));
        assert_eq!(monitor_of((100, 100, 800, 600), &[None, right]), Some(1));
        assert_eq!(monitor_of((100, 100, 800, 600), &[]), None);
    }

    #[test]
    fn letters_go_by_the_layout_and_digits_by_place() {
        use glfw::Key as K;
        // The key left of S prints Q on a French keyboard and must not quit where A is seen.
        assert_eq!(key_of(K::Q, Some("a")), Some(KeyboardKey::Char('a')));
        assert_eq!(key_of(K::Num1, Some("&")), Some(KeyboardKey::Digit(1)));
        assert_eq!(key_of(K::Kp7, Some("7")), Some(KeyboardKey::Pad(7)));
        assert_eq!(key_of(K::F11, None), Some(KeyboardKey::F(11)));
        assert_eq!(key_of(K::F1, None), Some(KeyboardKey::F(1)));
        assert_eq!(key_of(K::KpEnter, None), Some(KeyboardKey::Enter));
        assert_eq!(key_of(K::Tab, None), Some(KeyboardKey::Tab));
        assert_eq!(
            key_of(K::Semicolon, Some("Ö")),
            Some(KeyboardKey::Char('ö'))
        );
        assert_eq!(key_of(K::LeftShift, None), None);
    }
}
