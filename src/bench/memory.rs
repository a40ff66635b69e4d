//! Memory that a generated model takes, so that one that does not fit is refused by name instead of ending the program.

use super::BenchError;

/// Bytes that a generated statue takes at most while its tree is built and it is drawn on a software device, a triangle: 127 of
/// the highest resident memory seen, with 50 million triangles, and 10 of vertices on the device.
const BYTES_A_TRIANGLE: u64 = 140;

/// Bytes that a generated model of so many triangles takes at most.
pub fn needed(triangles: u64) -> u64 {
    triangles.saturating_mul(BYTES_A_TRIANGLE)
}

/// Refuses a model for which too little memory is free. Where the system does not tell, it is tried.
///
/// # Errors
/// [`BenchError::Memory`].
pub fn require(model: &str, triangles: u64, available: Option<u64>) -> Result<(), BenchError> {
    match available {
        Some(available) if available < needed(triangles) => Err(BenchError::Memory {
            model: model.to_owned(),
            needed: needed(triangles),
            available,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_does_not_fit_is_named() {
        let error = require("statue of 64 M", 64_000_000, Some(1 << 30));
        assert!(
            matches!(
                &error,
                Err(BenchError::Memory {
                    needed: 8_960_000_000,
                    ..
                })
            ),
            "{error:?}"
        );
        assert!(error.is_err_and(|e| {
            e.to_string()
                .contains("statue of 64 M needs about 8960000000 bytes")
        }));
        assert!(require("statue", 64_000_000, Some(16 << 30)).is_ok());
        assert!(require("statue", u64::MAX, None).is_ok());
    }
}
