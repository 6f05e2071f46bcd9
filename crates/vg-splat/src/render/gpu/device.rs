//! The graphics processor: selecting and opening it, and its errors.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use vg_geometry::threads::without_signals;
use vg_geometry::{Error, Result};

/// The missing component in errors.
const WHAT: &str = "graphics processor";

/// The adapters that are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Adapter {
    /// Graphics processors only, not drivers that draw on the CPU.
    Hardware,
    /// Any adapter, graphics processors first. Drivers that draw on the CPU (Mesa's lavapipe) are for tests:
    /// [`CpuRenderer`](crate::render::CpuRenderer) is faster there.
    Any,
}

/// Errors that the driver reported since the last check.
#[derive(Debug, Default)]
struct Trouble {
    /// The reason why the device was lost, if it was.
    lost: Option<String>,
    /// The first error since the last check, in the driver's words.
    error: Option<String>,
}

/// An open device.
#[derive(Debug)]
pub(super) struct Device {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) info: wgpu::AdapterInfo,
    /// Largest buffer that can be bound to a kernel, bytes.
    pub(super) largest_binding: u64,
    trouble: Arc<Mutex<Trouble>>,
}

impl Device {
    /// Opens the best adapter that `wanted` allows. The environment variable `WGPU_ADAPTER_NAME`, part of an adapter's
    /// name, selects among them.
    pub(super) fn open(wanted: Adapter) -> Result<Self> {
        let mut description = wgpu::InstanceDescriptor::new_without_display_handle();
        description.backends = wgpu::Backends::VULKAN;
        // No validation layers in any build: they print.
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
        let Some(adapter) = adapters.first() else {
            return Err(no_adapter(wanted, &names, chosen.as_deref()));
        };
        let info = adapter.get_info();
        let mut limits = adapter.limits();
        // No kernel needs more than every device provides.
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
            remedy: "check its driver, or draw on the CPU".into(),
        })?;

        let trouble = Arc::new(Mutex::new(Trouble::default()));
        let error_trouble = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            locked(&error_trouble).error.get_or_insert_with(|| error_text(&e));
        }));
        let loss_trouble = Arc::clone(&trouble);
        device.set_device_lost_callback(move |reason, message| {
            let message = message.trim().trim_end_matches('.').to_owned();
            let why = if message.is_empty() { format!("{reason:?}") } else { message };
            locked(&loss_trouble).lost.get_or_insert(why);
        });
        let largest_binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Ok(Self { device, queue, info, largest_binding, trouble })
    }

    /// Whether the driver draws on the CPU.
    pub(super) fn is_software(&self) -> bool {
        !is_hardware(&self.info)
    }

    /// Whether the device was lost.
    pub(super) fn is_lost(&self) -> bool {
        locked(&self.trouble).lost.is_some()
    }

    /// Returns an error that the driver reported since the last check.
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

    /// The error where a kernel detected that the driver ended a loop early.
    pub(super) fn loop_limit_error(&self) -> Error {
        Error::Missing {
            what: WHAT,
            found: format!(
                "the driver of {} ends long loops early, and a list of this picture is too long",
                self.info.name
            ),
            remedy: "draw fewer overlapping Gaussians, or draw on the CPU".into(),
        }
    }

    /// Destroys the device, as a driver's reset would.
    pub(super) fn lose(&self) {
        self.device.destroy();
        // The loss is reported while waiting.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        locked(&self.trouble).lost.get_or_insert_with(|| "destroyed".into());
    }

    /// Waits for a submission and passes the given number of leading bytes of each of `buffers` to `take`.
    pub(super) fn read(
        &self,
        submitted: wgpu::SubmissionIndex,
        buffers: &[(&wgpu::Buffer, u64)],
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<()> {
        for (buffer, bytes) in buffers {
            // An error is also reported by the device, and checked below.
            buffer.map_async(wgpu::MapMode::Read, 0..*bytes, |_| {});
        }
        let wait = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None };
        let waited = self.device.poll(wait);
        self.check()?;
        if let Err(e) = waited {
            return Err(Error::Missing {
                what: WHAT,
                found: format!("{} does not respond: {e}", self.info.name),
                remedy: "draw on the CPU".into(),
            });
        }
        for (i, (buffer, bytes)) in buffers.iter().enumerate() {
            match buffer.get_mapped_range(0..*bytes) {
                Ok(view) => take(i, &view),
                Err(e) => {
                    return Err(Error::Missing {
                        what: WHAT,
                        found: format!("{} returns no data: {e}", self.info.name),
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

/// Rank of an adapter; lower ones are preferred.
fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Whether an adapter's name contains this part, ignoring case.
fn contains(name: &str, part: &str) -> bool {
    name.to_lowercase().contains(&part.to_lowercase())
}

fn no_adapter(wanted: Adapter, names: &[String], chosen: Option<&str>) -> Error {
    let found = match (names, wanted) {
        ([], _) => "no Vulkan driver".to_owned(),
        (names, _) if chosen.is_some_and(|chosen| !names.iter().any(|n| contains(n, chosen))) => {
            let chosen = chosen.unwrap_or_default();
            format!("no adapter matches WGPU_ADAPTER_NAME {chosen:?} among {}", names.join(", "))
        }
        (names, Adapter::Hardware) => {
            format!("no hardware adapter, only drivers that draw on the CPU: {}", names.join(", "))
        }
        (names, Adapter::Any) => format!("no usable adapter among {}", names.join(", ")),
    };
    Error::Missing {
        what: WHAT,
        found,
        remedy: "install its vendor's driver (Debian: mesa-vulkan-drivers), or draw on the CPU".into(),
    }
}

/// Text of an error in one line.
fn error_text(error: &wgpu::Error) -> String {
    let text = match error {
        wgpu::Error::OutOfMemory { .. } => "out of memory".to_owned(),
        other => other.to_string(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
