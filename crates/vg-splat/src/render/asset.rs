//! Gaussians that are drawn many times: the backend is chosen once, and a device keeps its copy of them.

#[cfg(not(feature = "gpu"))]
use super::backend::not_built;
use super::backend::{Backend, Choice, is_built};
use super::{CpuRenderer, Picture, RenderOptions, Rendered};
use crate::gaussians::Gaussians;
use std::sync::{Arc, Mutex, PoisonError};
use vg_geometry::Camera;
#[cfg(feature = "gpu")]
use vg_geometry::Error;
use vg_geometry::Result;
use vg_geometry::progress::{UNWATCHED, Watch};

/// Number of Gaussians from which [`Backend::Auto`] uses a graphics processor: the CPU draws 20,000 in the few
/// milliseconds that the transfer of a picture may take.
pub const WORTH_A_DEVICE: usize = 20_000;

/// Gaussians prepared to be drawn many times.
///
/// ```
/// # use std::sync::Arc;
/// # use vg_splat::render::{AssetRenderer, Backend, RenderOptions};
/// # fn draw(gaussians: vg_splat::Gaussians, cameras: &[vg_geometry::Camera]) -> vg_geometry::Result<()> {
/// let ready = AssetRenderer::new(Arc::new(gaussians), Backend::Auto)?;
/// println!("{}", ready.choice());
/// for camera in cameras {
///     let picture = ready.render(camera, &RenderOptions::default())?;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct AssetRenderer {
    gaussians: Arc<Gaussians>,
    cpu: CpuRenderer,
    state: Mutex<State>,
    /// Whether the CPU may replace a device that fails.
    may_fall_back: bool,
}

#[derive(Debug)]
struct State {
    choice: Choice,
    #[cfg(feature = "gpu")]
    device: Option<Arc<OnDevice>>,
}

#[cfg(feature = "gpu")]
#[derive(Debug)]
struct OnDevice {
    renderer: Arc<super::GpuRenderer>,
    asset: super::GpuAsset,
}

impl AssetRenderer {
    /// Chooses the backend, and copies the Gaussians to the device where that is the choice.
    ///
    /// Errors, for [`Backend::Gpu`] alone: [`NotBuilt`](vg_geometry::Error::NotBuilt) in a build without the feature `gpu`,
    /// [`Missing`](vg_geometry::Error::Missing) without a driver, [`Argument`](vg_geometry::Error::Argument) for more Gaussians
    /// than fit the device.
    pub fn new(gaussians: Arc<Gaussians>, backend: Backend) -> Result<Self> {
        let cpu = CpuRenderer::new();
        let on_cpu =
            |why: &str| Choice { backend: Backend::Cpu, device: cpu.level().to_owned(), why: why.to_owned() };
        let state = match backend {
            Backend::Cpu => State::cpu(on_cpu("asked for")),
            Backend::Gpu => State::gpu(&gaussians, backend)?,
            Backend::Auto if !is_built() => State::cpu(on_cpu("this build draws on the CPU alone")),
            Backend::Auto if gaussians.len() < WORTH_A_DEVICE => {
                let why = format!("fewer than {WORTH_A_DEVICE} Gaussians are not worth a device");
                State::cpu(on_cpu(&why))
            }
            Backend::Auto => match State::gpu(&gaussians, backend) {
                Ok(state) => state,
                Err(e) => State::cpu(on_cpu(&e.to_string())),
            },
        };
        let may_fall_back = backend == Backend::Auto;
        Ok(Self { gaussians, cpu, state: Mutex::new(state), may_fall_back })
    }

    /// The backend in use, and the reason. It changes when a device fails under [`Backend::Auto`].
    pub fn choice(&self) -> Choice {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).choice.clone()
    }

    /// The Gaussians.
    pub fn gaussians(&self) -> &Arc<Gaussians> {
        &self.gaussians
    }

    /// Renders one picture. The camera may be distorted; it is validated.
    pub fn render(&self, camera: &Camera, options: &RenderOptions) -> Result<Rendered> {
        let mut target = Rendered::default();
        self.render_into(camera, options, &mut target)?;
        Ok(target)
    }

    /// As [`AssetRenderer::render`], into a picture whose memory is reused: planes, or 8 bits, which are less to fetch
    /// from a device.
    ///
    /// Errors of the device ([`Missing`](vg_geometry::Error::Missing)) end the call, but not under [`Backend::Auto`]: there
    /// the CPU draws this picture and all further ones.
    pub fn render_into<P: Picture>(
        &self,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut P,
    ) -> Result<()> {
        self.render_into_watched(camera, options, target, &UNWATCHED)
    }

    /// As [`AssetRenderer::render_into`], under `watch`. A device is not stopped in the middle of a picture.
    pub fn render_into_watched<P: Picture>(
        &self,
        camera: &Camera,
        options: &RenderOptions,
        target: &mut P,
        watch: &Watch,
    ) -> Result<()> {
        watch.check()?;
        #[cfg(feature = "gpu")]
        if let Some(device) = self.device() {
            match target.draw_on(&device.renderer, &device.asset, camera, options) {
                Err(e @ Error::Missing { .. }) if self.may_fall_back => self.fall_back(&e),
                done => return done,
            }
        }
        target.draw(self.cpu.watched(watch), &self.gaussians, camera, options)
    }

    /// Renders a picture for each camera into the memory of `picture` and passes it to `take` with the camera's index,
    /// in order. While `take` runs, a device draws the next.
    ///
    /// Errors: those of `take`, and of [`AssetRenderer::render_into`] for the first camera that has one.
    pub fn render_each<P: Picture>(
        &self,
        cameras: &[Camera],
        options: &RenderOptions,
        picture: &mut P,
        take: impl FnMut(usize, &P) -> Result<()>,
    ) -> Result<()> {
        self.render_each_watched(cameras, options, picture, &UNWATCHED, take)
    }

    /// As [`AssetRenderer::render_each`], under `watch`, which gets a report after every picture.
    pub fn render_each_watched<P: Picture>(
        &self,
        cameras: &[Camera],
        options: &RenderOptions,
        picture: &mut P,
        watch: &Watch,
        mut take: impl FnMut(usize, &P) -> Result<()>,
    ) -> Result<()> {
        let mut take = |i: usize, picture: &P| {
            take(i, picture)?;
            watch.report((i + 1) as f64 / cameras.len() as f64)
        };
        #[cfg_attr(not(feature = "gpu"), expect(unused_mut))]
        let mut done = 0;
        #[cfg(feature = "gpu")]
        if let Some(device) = self.device() {
            let mut was_taken = true;
            let counted = |i: usize, picture: &P| {
                let taken = take(i, picture);
                (was_taken, done) = (taken.is_ok(), i + 1);
                taken
            };
            match device.renderer.render_each(&device.asset, cameras, options, picture, counted) {
                Err(e @ Error::Missing { .. }) if self.may_fall_back && was_taken => self.fall_back(&e),
                all => return all,
            }
        }
        for (i, camera) in cameras.iter().enumerate().skip(done) {
            picture.draw(self.cpu.watched(watch), &self.gaussians, camera, options)?;
            take(i, picture)?;
        }
        Ok(())
    }

    #[cfg(feature = "gpu")]
    fn device(&self) -> Option<Arc<OnDevice>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).device.clone()
    }

    #[cfg(feature = "gpu")]
    fn fall_back(&self, error: &Error) {
        let choice =
            Choice { backend: Backend::Cpu, device: self.cpu.level().to_owned(), why: error.to_string() };
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = State::cpu(choice);
    }

    /// The device that draws, for tests.
    #[cfg(feature = "gpu")]
    #[doc(hidden)]
    pub fn gpu(&self) -> Option<Arc<super::GpuRenderer>> {
        self.device().map(|d| Arc::clone(&d.renderer))
    }

    /// Falls back as under [`Backend::Auto`], for tests on machines whose only device is software.
    #[doc(hidden)]
    pub fn falling_back(mut self) -> Self {
        self.may_fall_back = true;
        self
    }
}

impl State {
    fn cpu(choice: Choice) -> Self {
        Self {
            choice,
            #[cfg(feature = "gpu")]
            device: None,
        }
    }

    #[cfg(feature = "gpu")]
    fn gpu(gaussians: &Gaussians, backend: Backend) -> Result<Self> {
        use super::{Adapter, GpuRenderer};
        // A driver that draws on the CPU is used only on explicit request: under `Auto` it brings no gain.
        let adapter = if backend == Backend::Gpu { Adapter::Any } else { Adapter::Hardware };
        let renderer = GpuRenderer::shared(adapter)?;
        let asset = renderer.upload(gaussians)?;
        let why = match backend {
            Backend::Gpu => "asked for".to_owned(),
            _ => format!("{} Gaussians, and this machine has one", gaussians.len()),
        };
        let choice = Choice { backend: Backend::Gpu, device: renderer.name().to_owned(), why };
        Ok(Self { choice, device: Some(Arc::new(OnDevice { renderer, asset })) })
    }

    #[cfg(not(feature = "gpu"))]
    fn gpu(_: &Gaussians, _: Backend) -> Result<Self> {
        Err(not_built("backend"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_choice_contains_the_backend_and_the_reason() {
        let few = Arc::new(Gaussians::default());
        let asked = AssetRenderer::new(Arc::clone(&few), Backend::Cpu).unwrap().choice();
        assert!(asked.to_string().starts_with("cpu (") && asked.to_string().ends_with("): asked for"));
        let auto = AssetRenderer::new(Arc::clone(&few), Backend::Auto).unwrap().choice();
        assert_eq!(auto.backend, Backend::Cpu);
        match is_built() {
            true => assert!(auto.why.contains("not worth a device"), "{auto}"),
            false => {
                assert!(auto.why.contains("this build"), "{auto}");
                let error = AssetRenderer::new(few, Backend::Gpu).unwrap_err().to_string();
                assert!(error.starts_with("backend: gpu is not in this build"), "{error}");
            }
        }
    }
}
