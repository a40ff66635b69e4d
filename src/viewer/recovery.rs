//! How a window goes on after an error of the device.

use crate::gpu::Error;
use ash::vk::Result as R;

/// What an error leaves possible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecoveryWay {
    /// The settings ask for what cannot be drawn; others can.
    OtherSettings,
    /// There is not enough memory for this model.
    WithoutModel,
    /// The device must be opened anew.
    NewDevice,
    /// None.
    End,
}

/// How the window can go on after an error.
pub(super) fn way_after(error: &Error) -> RecoveryWay {
    match error {
        Error::Unsupported { .. } | Error::Limit { .. } => RecoveryWay::OtherSettings,
        Error::Memory { .. } => RecoveryWay::WithoutModel,
        Error::Vulkan { result, .. } => match *result {
            R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY => {
                RecoveryWay::WithoutModel
            }
            R::ERROR_DEVICE_LOST => RecoveryWay::NewDevice,
            _ => RecoveryWay::End,
        },
        _ => RecoveryWay::End,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_leave_the_most_that_is_possible() {
        let vulkan = |result| Error::Vulkan {
            call: "a call",
            object: "a thing".into(),
            result,
        };
        assert_eq!(
            way_after(&vulkan(R::ERROR_DEVICE_LOST)),
            RecoveryWay::NewDevice
        );
        assert_eq!(
            way_after(&vulkan(R::ERROR_OUT_OF_DEVICE_MEMORY)),
            RecoveryWay::WithoutModel
        );
        assert_eq!(way_after(&vulkan(R::ERROR_UNKNOWN)), RecoveryWay::End);
        let unsupported = Error::Unsupported {
            what: "these splats",
            why: "they are not drawn yet".into(),
        };
        assert_eq!(way_after(&unsupported), RecoveryWay::OtherSettings);
    }
}
