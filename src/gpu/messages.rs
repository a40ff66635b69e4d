//! Messages of the validation layers: a list that outlives the instance, so that teardown is covered.

use ash::vk;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

/// One message of a validation layer or of the loader.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LayerMessage {
    /// Identifier, such as `VUID-...`; empty when there is none.
    pub id: String,
    /// The message is an error (else a warning).
    pub is_error: bool,
    /// The text.
    pub text: String,
}

/// A message that is known and accepted, with its reason.
struct AcceptedMessage {
    id: &'static str,
    part: &'static str,
    #[expect(dead_code, reason = "read by people")]
    reason: &'static str,
}

/// Accepted messages: by identifier (empty: any) and a part of the text.
const ACCEPTED: &[AcceptedMessage] = &[
    AcceptedMessage {
        id: "Loader Message",
        part: "",
        reason: "the loader reports drivers it could not open; whether a device is left is our own check",
    },
    AcceptedMessage {
        id: "",
        part: "Decoration not allowed on struct members: SpvDecorationInvariant",
        reason: "Mesa 22.3's reader of SPIR-V remarks on `invariant gl_Position`, which the specification allows \
                 (Invariant applies to variables and structure members); it is no finding of the layer",
    },
];

/// Messages so far; shared by the messenger and whoever wants to read them.
#[derive(Debug, Clone, Default)]
pub struct LayerMessages(Arc<Mutex<Vec<LayerMessage>>>);

impl LayerMessages {
    /// Takes all messages out of the list.
    pub fn take(&self) -> Vec<LayerMessage> {
        std::mem::take(&mut *self.lock())
    }

    /// The messages so far.
    pub fn list(&self) -> Vec<LayerMessage> {
        self.lock().clone()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<LayerMessage>> {
        self.0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn push(&self, message: LayerMessage) {
        if ACCEPTED
            .iter()
            .any(|a| (a.id.is_empty() || message.id == a.id) && message.text.contains(a.part))
        {
            tracing::debug!(target: "vulkan", "accepted: {}: {}", message.id, message.text);
            return;
        }
        if message.is_error {
            tracing::error!(target: "vulkan", "{}: {}", message.id, message.text);
        } else {
            tracing::warn!(target: "vulkan", "{}: {}", message.id, message.text);
        }
        let mut list = self.lock();
        // A fault in a frame loop repeats without end; the first few thousand say all.
        if list.len() < 4096 {
            list.push(message);
        }
    }

    /// The pointer to hand to Vulkan as user data. The list must outlive the messenger: `Gpu` keeps both.
    pub(super) fn user_data(&self) -> *mut c_void {
        Arc::as_ptr(&self.0).cast_mut().cast()
    }
}

/// Called by the validation layers.
///
/// # Safety
/// `data` and its strings are valid for the call (Vulkan's promise); `user` is [`LayerMessages::user_data`] of a
/// list that is alive (the promise of whoever registers this function).
pub(super) unsafe extern "system" fn callback(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kinds: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    if data.is_null() || user.is_null() {
        return vk::FALSE;
    }
    // SAFETY: not null, and valid for the call as the function's contract says.
    let data = unsafe { &*data };
    let text = |pointer: *const std::ffi::c_char| {
        if pointer.is_null() {
            String::new()
        } else {
            // SAFETY: a string of the callback data, zero-terminated and valid for the call.
            unsafe { CStr::from_ptr(pointer) }
                .to_string_lossy()
                .into_owned()
        }
    };
    let message = LayerMessage {
        id: text(data.p_message_id_name),
        is_error: severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR),
        text: text(data.p_message),
    };
    let pointer = user.cast_const().cast::<Mutex<Vec<LayerMessage>>>();
    // SAFETY: `user` comes from `Arc::as_ptr` of a list that is alive (the function's contract); the count
    // raised here is given back when `list` drops.
    let list = unsafe {
        Arc::increment_strong_count(pointer);
        LayerMessages(Arc::from_raw(pointer))
    };
    list.push(message);
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepted_messages_are_not_kept_and_others_are() {
        let list = LayerMessages::default();
        list.push(LayerMessage {
            id: "Loader Message".into(),
            is_error: true,
            text: "no driver here".into(),
        });
        assert!(list.list().is_empty());
        list.push(LayerMessage {
            id: "VUID-x".into(),
            is_error: true,
            text: "wrong".into(),
        });
        assert_eq!(list.take().len(), 1);
        assert!(list.list().is_empty());
    }
}
