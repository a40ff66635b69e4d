//! The error of the library: one variant a layer, each wrapping that layer's own enum.

/// Anything that can go wrong in the library.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read as a model.
    #[error(transparent)]
    Input(#[from] crate::input::Error),
    /// A tree could not be built, or a tree file is damaged.
    #[error(transparent)]
    Tree(#[from] crate::tree::Error),
    /// A camera file or camera parameter is unusable.
    #[error(transparent)]
    Camera(#[from] crate::math::camera::CameraError),
    /// A picture could not be written or read.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The device could not do what was asked.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// A model could not be generated, or a mesh not be written.
    #[error(transparent)]
    Generate(#[from] crate::generate::GenerateError),
    /// There is no built-in scene of that name.
    #[error(transparent)]
    Scene(#[from] crate::scenes::SceneError),
    /// A profile could not be made.
    #[error(transparent)]
    Profile(#[from] crate::measure::profile::ProfileError),
    /// Failures could not be measured.
    #[error(transparent)]
    Failures(#[from] crate::stability::FailuresError),
    /// Photographs cannot be used.
    #[error(transparent)]
    Photos(#[from] crate::photos::error::PhotoError),
    /// A chart could not be made.
    #[error(transparent)]
    Chart(#[from] crate::chart::ChartError),
    /// Something could not be measured.
    #[error(transparent)]
    Bench(#[from] crate::bench::BenchError),
}

impl Error {
    /// Tells whether the work stopped because its [`Progress`](crate::progress::Progress) was cancelled: nothing is wrong.
    pub fn is_cancelled(&self) -> bool {
        use crate::measure::profile::ProfileError;
        matches!(
            self,
            Self::Input(crate::input::Error::Cancelled)
                | Self::Tree(crate::tree::Error::Cancelled)
                | Self::Generate(crate::generate::GenerateError::Cancelled)
                | Self::Profile(ProfileError::Cancelled(_))
                | Self::Failures(crate::stability::FailuresError::Cancelled)
                | Self::Photos(crate::photos::error::PhotoError::Cancelled)
                | Self::Chart(crate::chart::ChartError::Cancelled)
                | Self::Bench(crate::bench::BenchError::Cancelled)
        )
    }
}
