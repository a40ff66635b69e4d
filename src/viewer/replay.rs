//! Recorded input again, with or without a window: the same steps, the same pictures.

use super::app::App;
use super::event::Event;
use super::loader::{Loader, OpenError};
use super::record::Entry;
use super::window::Window;
use super::{Error, Options};
use crate::tree::Model;
use std::path::Path;
use std::time::Duration;

/// Loads a model and waits for it.
fn load(
    loader: &mut Loader,
    path: &Path,
    should_stop: &dyn Fn() -> bool,
) -> Result<Result<Model, OpenError>, Error> {
    if let Err(error) = loader.start(path) {
        return Ok(Err(Box::new(error)));
    }
    loop {
        if let Some((_, result)) = loader.poll() {
            return Ok(result);
        }
        if should_stop() {
            return Err(Error::Closed);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Feeds `entries` to the app, step by step, and writes the picture of each step that drew a new one into
/// [`Options::pictures`].
pub(super) fn run(
    app: &mut App,
    entries: &[Entry],
    loader: &mut Loader,
    mut window: Option<(&mut Window, &mut glfw::Glfw)>,
    should_stop: &dyn Fn() -> bool,
) -> Result<(), Error> {
    let pictures = app.options.pictures.clone();
    if let Some(folder) = &pictures {
        std::fs::create_dir_all(folder).map_err(|source| crate::image::Error::Write {
            path: folder.clone(),
            source,
        })?;
    }
    let last = entries.last().map_or(0, |entry| entry.step);
    let mut rest = entries;
    for step in 0..=last {
        if app.is_closing || should_stop() {
            break;
        }
        let (now, later) = rest.split_at(rest.partition_point(|entry| entry.step <= step));
        rest = later;
        if now.is_empty() && !app.is_dirty() {
            continue;
        }
        for entry in now {
            if let (Event::Size { width, height, .. }, Some((window, glfw))) =
                (&entry.event, &mut window)
            {
                window.take_size((*width, *height), glfw);
            }
        }
        let window = window.as_ref().map(|(window, _)| &*window.window);
        app.handle(now)?;
        for entry in now {
            if let Event::Loaded(path) = &entry.event {
                let result = load(loader, path, should_stop)?;
                app.loaded(path, result)?;
            }
        }
        let frames = app.frames;
        let is_drawn = app.is_dirty();
        if app.is_dirty() {
            while !app.draw(window)? {
                // The window gives no image for now.
                if should_stop() {
                    return Ok(());
                }
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        if let Some(folder) = &pictures {
            let path = folder.join(format!("step-{step:06}.png"));
            if app.options.with_panel && is_drawn {
                app.save_shown(&path)?;
            } else if app.frames > frames {
                app.save(&path)?;
            }
        }
        // What the frames took is in the recording; files are opened where it says so.
        let _ = app.finished();
        app.asks.clear();
    }
    app.finish(window.as_ref().map(|(window, _)| &*window.window))
}

/// Size and scale of the first step.
pub(super) fn first_size(entries: &[Entry], options: &Options) -> (u32, u32) {
    entries
        .iter()
        .find_map(|entry| match entry.event {
            Event::Size { width, height, .. } => Some((width.max(1), height.max(1))),
            _ => None,
        })
        .unwrap_or(options.size)
}
