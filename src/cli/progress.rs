//! Progress bars from about a second on, only for people; Ctrl-C asks long work to stop.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use surfel::progress::Progress;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// The first Ctrl-C asks the work to stop and clean up; the second ends the program at once.
pub(crate) fn catch_interrupt() {
    let set = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
    if let Err(error) = set {
        tracing::debug!("Ctrl-C ends the program at once: {error}");
    }
}

/// Tells whether Ctrl-C was pressed.
pub(crate) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// A bar that appears once a job has taken a second.
#[derive(Debug)]
pub(crate) struct JobBar {
    bar: ProgressBar,
    start: Instant,
    is_for_people: bool,
}

const PATIENCE: Duration = Duration::from_millis(1000);

impl JobBar {
    /// A bar on standard error, unless `quiet` or no terminal is there.
    pub(crate) fn new(quiet: bool) -> Self {
        Self {
            bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()),
            start: Instant::now(),
            is_for_people: !quiet && std::io::stderr().is_terminal(),
        }
    }

    fn show_if_late(&self) {
        if !self.is_for_people || !self.bar.is_hidden() || self.start.elapsed() < PATIENCE {
            return;
        }
        self.bar.set_draw_target(ProgressDrawTarget::stderr());
        if let Ok(style) =
            ProgressStyle::with_template("{msg:>18} {wide_bar} {percent:>3}%  {elapsed}")
        {
            self.bar.set_style(style);
        }
    }
}

impl Progress for JobBar {
    fn stage(&self, name: &str, total: u64) {
        tracing::info!(target: "surfel::progress", "{name}");
        self.bar.set_length(total.max(1));
        self.bar.set_position(0);
        self.bar.set_message(name.to_owned());
        self.show_if_late();
    }

    fn advance(&self, amount: u64) {
        self.bar.inc(amount);
        self.show_if_late();
    }

    fn is_cancelled(&self) -> bool {
        is_interrupted()
    }
}

impl Drop for JobBar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
