//! Runs decoders of other people on bytes that may be damaged: what panics there is an error here, and prints nothing.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread runs a decoder whose panics are caught.
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Puts the hook of panics behind one that is silent for guarded threads; all other panics reach the hook that was there.
fn silence() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_GUARDED.get() {
                before(panic);
            }
        }));
    });
}

/// Runs `work`; its error, or words about its panic.
pub(in crate::input) fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    silence();
    let was_guarded = IS_GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    IS_GUARDED.set(was_guarded);
    result.unwrap_or_else(|_| Err("the decoder gave up: the bytes are damaged".to_owned()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn a_panic_is_an_error_and_what_was_guarded_is_not_later() {
        assert_eq!(guarded(|| Ok(1)), Ok(1));
        let nothing: Vec<u8> = Vec::new();
        let at = std::hint::black_box(7);
        let text = guarded(|| Ok(nothing[at])).unwrap_err();
        assert!(text.contains("gave up"), "{text}");
        assert_eq!(guarded::<()>(|| Err("no".to_owned())), Err("no".to_owned()));
        assert!(!IS_GUARDED.get());
    }
}
