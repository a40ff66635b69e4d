//! One way to draw a model for everything that does not care how: on a Vulkan device, or by the mirrors on
//! the CPU where there is none.

use crate::gpu::frame::Measure;
use crate::gpu::{Error, Gpu, Options};
use crate::image::{Accumulator, FloatImage, Image, jittered};
use crate::math::camera::View;
use crate::render::Settings;
use crate::render::cost::model::Costs;
use crate::render::frame_plan::{check, for_view};
use crate::render::reference::engine::MirrorEngine;
pub use crate::render::reference::engine::style;
use crate::render::vulkan::renderer::{FrameTimes, Outputs, Renderer};
use crate::render::vulkan::scene::Scene;
use crate::tree::Model;
use std::sync::Arc;

/// Where pictures are made.
#[derive(Debug, Clone)]
pub enum Backend {
    /// A Vulkan device.
    Device(Arc<Gpu>),
    /// The mirrors, on the CPU. Exact and slow; needs no driver.
    Mirror,
}

impl Backend {
    /// The name that stands for the mirror where a device is asked for.
    pub const MIRROR: &'static str = "mirror";

    /// Opens what `options.device` names: `mirror`, a device's index or a part of its name, or the best device.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open(options: &Options) -> Result<Self, Error> {
        if options.device.as_deref() == Some(Self::MIRROR) {
            Ok(Self::Mirror)
        } else {
            Ok(Self::Device(Gpu::open(options)?))
        }
    }

    /// Name of the device.
    pub fn name(&self) -> &str {
        match self {
            Self::Device(gpu) => &gpu.info().name,
            Self::Mirror => Self::MIRROR,
        }
    }
}

/// Draws one model in one picture size.
#[derive(Debug)]
pub struct Engine<'m> {
    model: &'m Model,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Device {
        renderer: Box<Renderer>,
        /// Draws what is averaged, once anything was.
        samples: Option<Box<Renderer>>,
        scene: Scene,
    },
    Mirror(Box<MirrorEngine>),
}

impl<'m> Engine<'m> {
    /// Readies a model for pictures of `width` x `height` pixels.
    ///
    /// # Errors
    /// When the device has not enough memory or a side is above its limit.
    pub fn new(
        backend: &Backend,
        model: &'m Model,
        (width, height): (u32, u32),
        outputs: Outputs,
    ) -> Result<Self, Error> {
        let kind = match backend {
            Backend::Device(gpu) => Kind::Device {
                renderer: Box::new(Renderer::new(gpu, width, height, outputs, true)?),
                samples: None,
                scene: Scene::new(gpu, model)?,
            },
            Backend::Mirror => Kind::Mirror(Box::new(MirrorEngine::new(outputs))),
        };
        Ok(Self { model, kind })
    }

    /// Lets the mirror snap positions to so many binary places of a pixel, 4..=8, in pictures that are compared with those
    /// of a device ([`Gpu::info`] has its number); 8 at first. A device has its own.
    #[must_use]
    pub fn with_subpixel_bits(mut self, bits: u32) -> Self {
        if let Kind::Mirror(mirror) = &mut self.kind {
            mirror.set_subpixel_bits(bits);
        }
        self
    }

    /// Draws a frame and waits until it is finished.
    ///
    /// # Errors
    /// As [`Renderer::draw`].
    pub fn draw(&mut self, view: &View, settings: &Settings) -> Result<FrameTimes, Error> {
        match &mut self.kind {
            Kind::Device {
                renderer, scene, ..
            } => renderer.draw(self.model, scene, view, settings),
            Kind::Mirror(mirror) => {
                check(self.model, settings, mirror.outputs, f32::INFINITY)?;
                let settings = for_view(settings, self.model, view);
                Ok(mirror.draw(self.model, view, &settings))
            }
        }
    }

    /// As [`Renderer::keep_lists`]; off at first. The mirror never does.
    pub fn keep_lists(&mut self, keep: bool) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.keep_lists(keep);
        }
    }

    /// As [`Renderer::let_host_draw`]. The mirror is the host.
    pub fn let_host_draw(&mut self, may: bool) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.let_host_draw(may);
        }
    }

    /// What drawing costs on the device: [`Renderer::set_costs`]. The mirror has one way to draw.
    pub fn set_costs(&mut self, costs: Option<Costs>) {
        if let Kind::Device { renderer, .. } = &mut self.kind {
            renderer.set_costs(costs);
        }
    }

    /// What the frames from now on report: [`Renderer::measure`]. The mirror has stages and counts only.
    ///
    /// # Errors
    /// As [`Renderer::measure`].
    pub fn measure(&mut self, measure: Measure) -> Result<(), Error> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.measure(measure),
            Kind::Mirror(_) => Ok(()),
        }
    }

    /// The picture of the last frame.
    ///
    /// # Errors
    /// As [`Renderer::read`].
    pub fn read(&mut self, view: &View) -> Result<Image, Error> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.read(view),
            Kind::Mirror(mirror) => Ok(mirror.image.clone()),
        }
    }

    /// As [`Renderer::overdraw`].
    pub fn overdraw(&mut self) -> Option<Vec<u32>> {
        match &mut self.kind {
            Kind::Device { renderer, .. } => renderer.overdraw(),
            Kind::Mirror(mirror) => mirror.counts.clone(),
        }
    }

    /// Draws and reads one picture.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn render(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        self.draw(view, settings)?;
        self.read(view)
    }

    /// Draws and reads one picture to be averaged with others: with [`Image::values`], so that only the mean is rounded,
    /// and without depth and normals. (Visibility splats are put together from pixels of eight bits, and have none.) On a
    /// device it goes to targets of its own, which stay.
    ///
    /// # Errors
    /// As [`Engine::draw`] and [`Engine::read`].
    pub fn sample(&mut self, view: &View, settings: &Settings) -> Result<Image, Error> {
        if settings.draws_visibility() {
            return self.render(view, settings);
        }
        match &mut self.kind {
            Kind::Device {
                renderer,
                samples,
                scene,
            } => {
                let samples = match samples {
                    Some(made) => made,
                    none => none.insert(Box::new(renderer.of_values()?)),
                };
                if samples.costs() != renderer.costs() {
                    samples.set_costs(renderer.costs());
                }
                samples.draw(self.model, scene, view, settings)?;
                samples.read(view)
            }
            Kind::Mirror(mirror) => {
                let values = Outputs {
                    values: true,
                    ..Outputs::default()
                };
                let outputs = std::mem::replace(&mut mirror.outputs, values);
                let image = self.render(view, settings);
                if let Kind::Mirror(mirror) = &mut self.kind {
                    mirror.outputs = outputs;
                }
                image
            }
        }
    }

    /// The box-filtered mean of `k` x `k` pictures, each shifted by a part of a pixel: `k * k` regular samples a
    /// pixel, each as [`Engine::sample`] draws it; of one it is the picture that [`Engine::render`] draws. Color and
    /// coverage only: a mean of depths or normals is neither.
    ///
    /// # Errors
    /// As [`Engine::render`].
    pub fn supersample(
        &mut self,
        view: &View,
        settings: &Settings,
        k: u32,
    ) -> Result<FloatImage, Error> {
        let mut mean = Accumulator::new();
        for i in 0..k * k {
            let view = jittered(view, i, k);
            let image = if k > 1 {
                self.sample(&view, settings)?
            } else {
                self.render(&view, settings)?
            };
            // Every picture has the size of the view, which is all that can go wrong.
            if let Err(error) = mean.add(&image) {
                unreachable!("pictures of one view: {error}");
            }
        }
        Ok(mean.mean())
    }
}
