//! The graphics processor: found, opened once, and what it reports when something goes wrong.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use vg_geometry::threads::without_signals;
use vg_geometry::{Error, Result};

/// What is missing where no picture can be drawn.
const WHAT: &str = "graphics processor";

/// Which adapters are good enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Adapter {
    /// A graphics processor; not a driver that draws on the CPU.
    Hardware,
    /// Whatever the driver offers, a graphics processor first. Drivers that draw on the CPU (Mesa's lavapipe) are for
    /// tests: [`CpuRenderer`](crate::render::CpuRenderer) is faster there.
    Any,
}

/// What went wrong since it was last asked.
#[derive(Debug, Default)]
struct Trouble {
    /// The device is gone for good: why.
    lost: Option<String>,
    /// The first error since, in the driver's words.
    error: Option<String>,
}

/// An open device.
#[derive(Debug)]
pub(super) struct Device {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) info: wgpu::AdapterInfo,
    /// Largest buffer that a kernel may be given, bytes.
    pub(super) largest_binding: u64,
    trouble: Arc<Mutex<Trouble>>,
}

impl Device {
    /// Opens the best adapter that `wanted` allows. `WGPU_ADAPTER_NAME` in the environment, part of an adapter's name,
    /// chooses among them.
    pub(super) fn open(wanted: Adapter) -> Result<Self> {
        let mut description = wgpu::InstanceDescriptor::new_without_display_handle();
        description.backends = wgpu::Backends::VULKAN;
        // No layers of the developer's, whatever this is compiled for: they print.
        description.flags = wgpu::InstanceFlags::empty();
        let instance = wgpu::Instance::new(description);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
        let chosen = std::env::var("WGPU_ADAPTER_NAME").ok();
        if let Some(name) = &chosen {
            adapters.retain(|a| contains(&a.get_info().name, name));
        }
        adapters.retain(|a| {
            a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && (wanted == Adapter::Any || is_hardware(&a.get_info()))
        });
        adapters.sort_by_key(|a| rank(a.get_info().device_type));
        let Some(adapter) = adapters.first() else { return Err(none(wanted, &names, chosen.as_deref())) };
        let info = adapter.get_info();
        let mut limits = adapter.limits();
        // No kernel asks for more than every device has.
        limits.max_storage_buffers_per_shader_stage = limits.max_storage_buffers_per_shader_stage.min(8);
        let opened = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("vg"),
            required_features: wgpu::Features::empty(),
            required_limits: limits.clone(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        });
        let (device, queue) = without_signals(|| pollster::block_on(opened)).map_err(|e| Error::Missing {
            what: WHAT,
            found: format!("{} cannot be opened: {e}", info.name),
            remedy: "see to its driver, or draw on the CPU".into(),
        })?;

        let trouble = Arc::new(Mutex::new(Trouble::default()));
        let of_errors = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            locked(&of_errors).error.get_or_insert_with(|| words(&e));
        }));
        let of_loss = Arc::clone(&trouble);
        device.set_device_lost_callback(move |reason, message| {
            let message = message.trim().trim_end_matches('.').to_owned();
            let why = if message.is_empty() { format!("{reason:?}") } else { message };
            locked(&of_loss).lost.get_or_insert(why);
        });
        let largest_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Ok(Self { device, queue, info, largest_binding, trouble })
    }

    /// Whether it draws on the CPU.
    pub(super) fn is_software(&self) -> bool {
        !is_hardware(&self.info)
    }

    /// Whether it is gone for good.
    pub(super) fn is_lost(&self) -> bool {
        locked(&self.trouble).lost.is_some()
    }

    /// The error that came since this was last asked.
    pub(super) fn check(&self) -> Result<()> {
        let mut trouble = locked(&self.trouble);
        let error = trouble.error.take();
        let missing = |found: String, remedy: &str| {
            Err(Error::Missing { what: WHAT, found, remedy: remedy.to_owned() })
        };
        if let Some(why) = &trouble.lost {
            let found = format!("{} was lost ({why})", self.info.name);
            return missing(found, "make a new renderer, or draw on the CPU");
        }
        match error {
            Some(error) => missing(
                format!("{} reports: {error}", self.info.name),
                "draw fewer Gaussians or pixels at a time, or draw on the CPU",
            ),
            None => Ok(()),
        }
    }

    /// What is said where a kernel found out that it was not run to its end.
    pub(super) fn cuts_loops_short(&self) -> Error {
        Error::Missing {
            what: WHAT,
            found: format!(
                "{} leaves loops before their end, and a list of this picture is too long",
                self.info.name
            ),
            remedy: "draw fewer Gaussians that lie behind each other, or draw on the CPU".into(),
        }
    }

    /// Ends the device, as a driver's reset would.
    pub(super) fn lose(&self) {
        self.device.destroy();
        // The loss is told while waiting.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        locked(&self.trouble).lost.get_or_insert_with(|| "destroyed".into());
    }

    /// Hands each of `buffers`, of which the first so many bytes are wanted, to `take` when what was submitted is done.
    pub(super) fn read(
        &self,
        submitted: wgpu::SubmissionIndex,
        buffers: &[(&wgpu::Buffer, u64)],
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<()> {
        for (buffer, bytes) in buffers {
            // An error is one of the device's too; it is looked for below.
            buffer.map_async(wgpu::MapMode::Read, 0..*bytes, |_| {});
        }
        let wait = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None };
        let waited = self.device.poll(wait);
        self.check()?;
        if let Err(e) = waited {
            return Err(Error::Missing {
                what: WHAT,
                found: format!("{} does not answer: {e}", self.info.name),
                remedy: "draw on the CPU".into(),
            });
        }
        for (i, (buffer, bytes)) in buffers.iter().enumerate() {
            match buffer.get_mapped_range(0..*bytes) {
                Ok(view) => take(i, &view),
                Err(e) => {
                    return Err(Error::Missing {
                        what: WHAT,
                        found: format!("{} gives nothing back: {e}", self.info.name),
                        remedy: "draw on the CPU".into(),
                    });
                }
            }
            buffer.unmap();
        }
        self.check()
    }
}

fn locked(trouble: &Mutex<Trouble>) -> MutexGuard<'_, Trouble> {
    trouble.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_hardware(info: &wgpu::AdapterInfo) -> bool {
    info.device_type != wgpu::DeviceType::Cpu
}

/// Adapters in the order they are tried.
fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Whether an adapter's name has this part, whatever the case.
fn contains(name: &str, part: &str) -> bool {
    name.to_lowercase().contains(&part.to_lowercase())
}

fn none(wanted: Adapter, names: &[String], chosen: Option<&str>) -> Error {
    let found = match (names, wanted) {
        ([], _) => "no Vulkan driver".to_owned(),
        (names, _) if chosen.is_some_and(|chosen| !names.iter().any(|n| contains(n, chosen))) => {
            let chosen = chosen.unwrap_or_default();
            format!("none of WGPU_ADAPTER_NAME {chosen:?} among {}", names.join(", "))
        }
        (names, Adapter::Hardware) => format!("none among {}, which draw on the CPU", names.join(", ")),
        (names, Adapter::Any) => format!("none that can be used among {}", names.join(", ")),
    };
    Error::Missing {
        what: WHAT,
        found,
        remedy: "install its vendor's driver (Debian: mesa-vulkan-drivers), or draw on the CPU".into(),
    }
}

/// One line of an error's causes.
fn words(error: &wgpu::Error) -> String {
    let text = match error {
        wgpu::Error::OutOfMemory { .. } => "out of memory".to_owned(),
        other => other.to_string(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
