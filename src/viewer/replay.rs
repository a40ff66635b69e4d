//! Recorded input again, with or without a window: the same steps, the same pictures.

use super::app::{FileAsk, ViewerApp};
use super::event::ViewerEvent;
use super::loaded_model::{LoadError, LoadedModel};
use super::loader::ModelLoader;
use super::record::RecordEntry;
use super::window::ViewerWindow;
use super::{ViewerError, ViewerOptions};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Waits for a model that is being loaded, or for its preview; previews that nobody waits for are passed over.
fn load(
    loader: &mut ModelLoader,
    (path, more): (&Path, &[PathBuf]),
    wants_preview: bool,
    should_stop: &dyn Fn() -> bool,
) -> Result<Result<LoadedModel, LoadError>, ViewerError> {
    if loader.path() != Some(path)
        && let Err(error) = loader.start_all(path, more)
    {
        return Ok(Err(LoadError::Thread(error)));
    }
    loop {
        match loader.poll() {
            Some((_, Ok(loaded))) if loaded.is_preview && !wants_preview => {}
            Some((_, result)) => return Ok(result),
            None => {
                if should_stop() {
                    return Err(ViewerError::Closed);
                }
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }
}

/// Feeds `entries` to the app, step by step, and writes the picture of each step that drew a new one into
/// [`ViewerOptions::pictures`].
pub(super) fn run(
    app: &mut ViewerApp,
    entries: &[RecordEntry],
    loader: &mut ModelLoader,
    mut window: Option<(&mut ViewerWindow, &mut glfw::Glfw)>,
    should_stop: &dyn Fn() -> bool,
) -> Result<(), ViewerError> {
    let pictures = app.options.pictures.clone();
    if let Some(folder) = &pictures {
        std::fs::create_dir_all(folder).map_err(|source| crate::image::Error::Write {
            path: folder.clone(),
            source,
        })?;
    }
    let last = entries.last().map_or(0, |entry| entry.step);
    // What frames took is in the recording; where it is not, those of now decide how coarse the next ones are.
    let is_timed = |entry: &RecordEntry| matches!(entry.event, ViewerEvent::Frame { .. });
    let is_live = app.is_paced() && !entries.iter().any(is_timed);
    let mut live = Vec::new();
    let options = &app.options;
    let mut first = (!options.model_is_usual).then(|| options.model.clone());
    let mut more = options.more.clone();
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
            if let (ViewerEvent::Size { width, height, .. }, Some((window, glfw))) =
                (&entry.event, &mut window)
            {
                window.take_size((*width, *height), glfw);
            }
        }
        let window = window.as_ref().map(|(window, _)| &*window.window);
        app.handle(&std::mem::take(&mut live))?;
        app.handle(now)?;
        for entry in now {
            // The first model is that of the command line, unless another was dropped before it came.
            match &entry.event {
                ViewerEvent::Drop(_) => (first, more) = (None, Vec::new()),
                ViewerEvent::DropAll(paths) => {
                    (first, more) = (None, paths.iter().skip(1).cloned().collect());
                }
                ViewerEvent::Preview(path) => {
                    let path = first.clone().unwrap_or_else(|| path.clone());
                    app.tell_device(loader);
                    let result = load(loader, (&path, &more), true, should_stop)?;
                    app.loaded(&path, result)?;
                }
                ViewerEvent::Loaded(path) => {
                    let asked = first.take();
                    let path = asked.as_ref().unwrap_or(path);
                    app.tell_device(loader);
                    match load(loader, (path, &more), false, should_stop)? {
                        // Nobody sees a message in the window, and pictures without the model are of no use.
                        Err(error) if asked.is_some() && window.is_none() => {
                            return Err(ViewerError::Open(error));
                        }
                        result => app.loaded(path, result)?,
                    }
                }
                _ => {}
            }
        }
        let frames = app.frames;
        let is_drawn = app.is_dirty();
        if app.is_dirty() {
            let start = Instant::now();
            while !app.draw(window)? {
                // The window gives no image for now.
                if should_stop() {
                    return Ok(());
                }
                std::thread::sleep(Duration::from_millis(10));
            }
            app.longest_draw = app.longest_draw.max(start.elapsed());
        }
        if let Some(folder) = &pictures {
            let path = folder.join(format!("step-{step:06}.png"));
            if app.options.with_panel && is_drawn {
                app.save_shown(&path)?;
            } else if app.frames > frames {
                app.save(&path)?;
            }
        }
        let time = now.last().map_or(0.0, |entry| entry.time);
        let finished = app.finished().into_iter();
        if is_live {
            live.extend(finished.map(|event| RecordEntry { step, time, event }));
        }
        if app.asks.contains(&FileAsk::Keep) {
            app.start_keeping(loader);
        }
        // Files are opened where the recording says so.
        app.asks.clear();
    }
    app.finish(window.as_ref().map(|(window, _)| &*window.window))?;
    let _ = app.finished();
    Ok(())
}

/// Size and scale of the first step.
pub(super) fn first_size(entries: &[RecordEntry], options: &ViewerOptions) -> (u32, u32) {
    entries
        .iter()
        .find_map(|entry| match entry.event {
            ViewerEvent::Size { width, height, .. } => Some((width.max(1), height.max(1))),
            _ => None,
        })
        .unwrap_or(options.size)
}
